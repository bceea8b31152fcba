"""``beamsim sweep``, kind swept_sine: a continuous sweep, evaluated cycle by cycle, with notching.

A notched level keeps the limits on responses and forces; the result names the limit that governs each range.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from beamsim.analyses.sweep.cycles import CycleRecord, SinePhase, check_balance, energy_errors, record_cycles
from beamsim.analyses.sweep.layouts import NOTCH_LIMITS, NOTCH_RANGES, NOTCHES
from beamsim.analyses.sweep.outputs import LevelRun, SweepLevel, level_row
from beamsim.analyses.sweep.result import NotchedRange, Notching, NotchLimit, SweepCurve
from beamsim.flow.exact import ExactFlow
from beamsim.flow.swept_motion import CLOSE, LevelControl, SweptLoads, SweptMotion
from beamsim.inputs.drift import Correction, CorrectionSize, jumps
from beamsim.inputs.measured import on_curve
from beamsim.inputs.profiles import Leg, Profile, make_leg, make_profile, phase_of_acceleration
from beamsim.inputs.swept import SweepWindows, cut_into_windows, swept_signals
from beamsim.labelled import Dataset
from beamsim.outcomes import Outcome, OutcomeKind, Progress, Where, combined, part_of, stop_requested
from beamsim.responses.histories import between_samples, samples_until, share_above_half_rate, times_reached
from beamsim.results.values import Margins, with_verdicts
from beamsim.results.values import parse_limit as limited_value
from beamsim.scenario.quantities import power_of
from beamsim.scenario.reporting import BASE_FORCE, LimitedQuantity, limited_quantity
from beamsim.scenario.scenario import Scenario
from beamsim.scenario.sweep import SweptSine
from beamsim.system.equations import Forcing, RowsOf
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats, not_none, of_kind

CONTROL_SHARE = 0.8  # share of the work of a notched sweep spent on the choice of the level


def legs_of(settings: SweptSine) -> list[Leg]:
    """Legs of the sweep, up or down, in order."""
    up = make_leg(settings.from_, settings.to, settings.rate)
    down = make_leg(settings.to, settings.from_, settings.rate)
    return {"up": [up], "down": [down], "both": [up, down]}[settings.direction]


def swept_loads(system: StructuralSystem) -> SweptLoads:
    """Loads of a system with the swept sine in place of its sine."""
    forcing, sine = system.forcing, not_none(system.sine)

    def loads(windows: SweepWindows, carrier: float) -> Forcing:
        if not system.base:
            # supports with imposed motion are known only at constant frequency
            sines = (replace(windows, coefficient=at[:, None] * windows.coefficient) for at in sine.at(windows.omega).T)
            return replace(forcing, signal=tuple(swept_signals(sine, carrier)[0] for sine in sines))
        acceleration, _, displacement = swept_signals(windows, carrier)
        of_power = {0: acceleration, -2: displacement}  # -2: the displacement is the exact integral of the acceleration
        pairs = zip(sine.coefficient.real.tolist(), sine.power.tolist(), strict=True)
        return replace(forcing, signal=tuple(factor * of_power[power] for factor, power in pairs))

    return loads


def sweep_profile(level: SweepLevel) -> tuple[Profile, float]:
    """Level over frequency (a table that the level multiplies), and the phase of the sine at the start."""
    settings = of_kind(SweptSine, level.settings)
    profile = make_profile(level.value, level.quantity, settings.profile, settings.between, settings.notches)
    return profile, level.system.scenario.sine.phase + phase_of_acceleration(
        level.quantity, level.value, settings.profile
    )


class SweptMarch(NamedTuple):
    """Motion of a level to be marched, and its excitation."""

    motion: SweptMotion
    profile: Profile
    corrections: tuple[Correction, ...] | None  # of the base acceleration


def swept_march(level: SweepLevel, notching: Notching | None, progress: Progress = None) -> SweptMarch:
    """Set up the motion of a level in all directions.

    Parameters
    ----------
    level : level of a swept sine.
    notching : lowered level, if limits are to be kept.
    progress : see `sweep_level`.

    Returns
    -------
    SweptMarch
    """
    system, settings = level.system, of_kind(SweptSine, level.settings)
    legs, (profile, phase) = legs_of(settings), sweep_profile(level)
    if notching is not None:  # with the same result as the table in a file
        table = zip(notching.frequency_hz.tolist(), notching.level.tolist(), strict=True)
        profile = Profile.log_log([(f, value, notching.quantity) for f, value in table])
    corrections = jumps(legs, profile, phase) if system.base else None
    windows = cut_into_windows(legs, profile, phase=phase, corrections=corrections, tolerance=settings.tolerance)
    march = SweptMotion(
        system.dynamics, swept_loads(system), windows, system.initial_state, stop=stop_requested, progress=progress
    )
    return SweptMarch(march, profile, corrections)


def sweep_level(level: SweepLevel, progress: Progress = None) -> LevelRun:
    """Sweep at one level in all directions; each direction starts from the final motion of the previous one.

    Parameters
    ----------
    level : level of a swept sine.
    progress : called with the completed fraction of the work.

    Returns
    -------
    LevelRun
        Curves up to where the computation ended; the last may be incomplete.
    """
    settings = of_kind(SweptSine, level.settings)
    beginning = 0.0 if settings.notch_to is None else CONTROL_SHARE
    notching: Notching | None = None
    notch_limits: tuple[LimitColumn, ...] = ()
    if settings.notch_to is not None:
        notch_limits = limit_columns(settings.notch_to, level)
        notching = notched_level(level, notch_limits, part_of(progress, 0.0, CONTROL_SHARE))
    march, profile, corrections = swept_march(level, notching, part_of(progress, beginning, 1.0))
    windows = march.windows
    parts, history, aliased = _record_cycles(level, march)
    curves = _curves(level, profile, windows, CycleRecord.join(parts)) if parts else ()
    columns = {
        "truncation": windows.truncation, "cycles": sum(part.count for part in parts), "events": march.events,
        "evaluations": march.evaluations, "segments": march.segments, "states": march.states,
        "processor_time_s": march.processor_time_s,
    }  # fmt: skip
    if corrections is not None:
        size = CorrectionSize.of(corrections)
        columns |= {f"base_correction_{name}": value for name, value in vars(size).items()}
    outcome = check_balance(march.outcome, curves)
    if notching is not None:
        columns["notch_trials"] = notching.trials
        judged = [with_notching(notching, notch_limits, curve) for curve in curves]
        curves, missed = tuple(curve for curve, _ in judged), [not_held for _, not_held in judged if not_held]
        outcome = missed[0].copy_with(*outcome.unless_complete) if missed else outcome
    return LevelRun(curves, level_row(level, outcome, columns, aliased), history)


def _record_cycles(
    level: SweepLevel, march: SweptMotion
) -> tuple[list[CycleRecord], Dataset | None, Mapping[str, Any] | None]:
    """March and record the cycles of each chunk, and the time history if requested.

    Returns
    -------
    parts : records of the cycles, in order.
    history, aliased : rows of `HISTORIES`, and the content above half their rate, see `SweepLevel.aliased_columns`.
    """
    settings, windows = of_kind(SweptSine, level.settings), march.windows
    orders, rate = (0.0, *settings.tracked_orders), settings.history_rate
    times = np.arange(0 if rate is None else samples_until(windows.duration, rate)) / (rate or 1.0)
    times = between_samples(times)
    parts: list[CycleRecord] = []
    samples: list[Floats] = []
    for chunk in march.chunks():
        output_of = level.rows(chunk.motion.flow)
        if chunk.cycle_count:
            phases = SinePhase.of_windows(chunk.windows)
            record = record_cycles(chunk.motion, chunk.edges, output_of, orders, phases, level.searched_columns)
            parts.append(record.select(slice(chunk.cycle_count)))
        sampled = sum(values.shape[0] for values in samples)
        here = times_reached(march.end, times)[sampled:]
        samples.append(chunk.motion.sample(here - float(windows.edge[chunk.first]), output_of))
    if rate is None:
        return parts, None, None
    values = np.concatenate(samples)
    values = values[: values.shape[0] - 1 + values.shape[0] % 2]  # the history may end between two samples
    history = level.history(times[: values.shape[0] : 2], values[::2])
    return parts, history, level.aliased_columns(share_above_half_rate(values))


def _curves(level: SweepLevel, profile: Profile, windows: SweepWindows, record: CycleRecord) -> tuple[SweepCurve, ...]:
    """Curves of the completed legs."""
    settings = of_kind(SweptSine, level.settings)
    tracked = replace(record, harmonic=np.moveaxis(record.tracked((0.0, *settings.tracked_orders)), 0, 2))
    curves = []
    for index, leg in enumerate(legs_of(settings)):
        computed = np.flatnonzero(windows.cycle_leg[: record.count] == index)
        complete = (computed < windows.cycles - 1) | windows.complete
        cycles = computed[complete]
        if not cycles.size:
            continue
        of_leg = tracked.select(computed)
        frequency = windows.frequency_hz[cycles]
        values = {
            "frequency_hz": frequency, "time": windows.edge[cycles], "excitation_amplitude": profile(frequency),
            "energy_error": energy_errors(of_leg.imbalance, of_leg.energy, complete),
        }  # fmt: skip
        direction = "up" if leg.last_hz > leg.first_hz else "down"
        curves.append(level.curve(of_leg if complete[-1] else of_leg.merge_incomplete_cycle(), direction, values))
    return tuple(curves)


ALLOWED_EXCESS = 0.05  # relative to a limit
NOTCH_EXCEEDED = "notch_not_held"
LEVEL_TOLERANCE = 1e-3  # relative tolerance of the table against the followed level
LARGEST_NOTCHED_RATIO = 0.995  # times the specification; at higher levels there is no notch
NARROW_RANGE = 0.01  # relative width below which a range is merged with its neighbours
STEP_TOLERANCE = 1e-9  # relative change of the specification that does not count as a step


@dataclass(frozen=True)
class LimitColumn:
    """Limit with the output column of the sweep that it applies to."""

    name: str
    limit: float
    quantity: LimitedQuantity
    column: int


def with_limited_outputs(scenario: Scenario) -> Scenario:
    """Copy of the scenario with the base force among the outputs, if a limit needs it."""
    limits = scenario.sweep.notch_to if isinstance(scenario.sweep, SweptSine) else None
    if limits and "base.force" in limits and scenario.base_force is None:
        return scenario.model_copy(update={"outputs": (*scenario.outputs, BASE_FORCE)})
    return scenario


def limit_columns(limits: Mapping[str, float], level: SweepLevel) -> tuple[LimitColumn, ...]:
    """Limits with the columns of a level that they apply to.

    Parameters
    ----------
    limits : limits by name, such as ``probes.tip.acceleration``, in SI units.
    level : level of the sweep.

    Returns
    -------
    tuple
        In the order of the limits.

    Raises
    ------
    KeyError
        If a limit is on a quantity that the sweep does not evaluate (refused earlier by `beamsim.scenario`).
    """
    columns = {
        LimitedQuantity(c.section, c.name, "" if c.section == "outputs" else c.quantity.removeprefix("absolute_")): k
        for c, k in level.channels.first_columns
    }
    limited, base_force = [], level.system.scenario.base_force or BASE_FORCE.name
    for name, limit in limits.items():
        of = not_none(limited_quantity(name, base_force))
        limited.append(LimitColumn(name, float(limit), of, columns[of]))
    return tuple(limited)


def notched_level(level: SweepLevel, limits: Sequence[LimitColumn], progress: Progress) -> Notching:
    """Follow the first leg and lower its level to the limits; the response is computed afterwards.

    Parameters
    ----------
    level : level of a swept sine.
    limits : limits with their columns.
    progress : called with the completed fraction of the leg.

    Returns
    -------
    Notching
        Table of the level, in the quantity at the start of the sweep, without limits and ranges.
    """
    system, settings, quantity = level.system, of_kind(SweptSine, level.settings), level.quantity
    if settings.profile:
        quantity = settings.profile[0].quantity or ("acceleration" if power_of(quantity) else quantity)
    leg, (profile, phase) = legs_of(settings)[0], sweep_profile(level)
    specification = with_leg_ends(profile, leg)
    columns = np.array([each.column for each in limits])

    def limited_outputs(flow: ExactFlow) -> RowsOf:
        rows = level.rows(flow)
        return lambda phases: rows(phases)[columns]

    control = LevelControl(
        system.dynamics, swept_loads(system), limited_outputs, np.array([each.limit for each in limits]), leg,
        specification, phase, bool(system.base), system.initial_state, stop_requested, progress,
    )  # fmt: skip
    frequency, amplitude = control.level()
    divisor = (2 * np.pi * frequency) ** power_of(quantity)
    return Notching(quantity, frequency, amplitude / divisor, specification(frequency) / divisor, trials=control.trials)


def with_leg_ends(profile: Profile, leg: Leg) -> Profile:
    """Profile with the ends of a leg among its points, and with steps that take one cycle."""
    low, high = sorted((leg.first_hz, leg.last_hz))
    edges = profile.edge[(profile.edge > low) & (profile.edge < high)]
    points = [low]
    for edge in edges:
        below = float(profile(np.nextafter(edge, 0.0)))
        if abs(float(profile(edge)) / below - 1.0) <= STEP_TOLERANCE:
            points.append(float(edge))
            continue
        turns = float(leg.turns(np.array(edge)))
        around = leg.frequency(np.clip([turns - 0.5, turns + 0.5], 0.0, leg.cycles))
        points += sorted(float(f) for f in around)
    frequency = np.unique([*points, high])
    return Profile.from_points(frequency, profile(np.append(frequency[:-1], np.nextafter(high, 0.0))))


def values_that_lower_level(scenario: Scenario) -> set[tuple[str, str]]:
    """Entries and places of the values for which the level is lowered, such as ``peak_force`` and a snubber."""
    limits = getattr(scenario.sweep, "notch_to", None) or {}
    of = [limited_quantity(name, scenario.base_force or BASE_FORCE.name) for name in limits]
    return {(f"peak_{each.quantity}" if each.quantity else each.section, each.item) for each in of if each is not None}


def with_notched_tolerance(scenario: Scenario, margins: Margins) -> Margins:
    """Margins with the accepted tolerance for limits that the lowered level keeps."""
    held = values_that_lower_level(scenario)

    def is_notched(name: str, at: str) -> bool:
        value, place = limited_value(name)
        return (value.limit, place or at.partition(",")[0]) in held

    return with_verdicts({
        name: item | ({"held_within": CLOSE} if is_notched(name, item["at"]) else {})
        for name, item in margins.items()
    })  # fmt: skip


def with_notching(
    notching: Notching, limited: Sequence[LimitColumn], curve: SweepCurve
) -> tuple[SweepCurve, Outcome | None]:
    """Curve with its notching: largest values, and the governing limit of each range.

    Parameters
    ----------
    notching : notching without limits and ranges.
    limited : limits with their columns.
    curve : response to the notched level.

    Returns
    -------
    curve : response with the notching.
    not_held : outcome if a limit is exceeded by more than the tolerance; None if all are kept.
    """
    values = [curve.limited_values(each.quantity) for each in limited]
    share = np.array([of.peak / each.limit for of, each in zip(values, limited, strict=True)])  # (limits, C)
    limits = [
        NotchLimit(
            each.name, of.unit, each.limit, float(of.peak[at]), float(shares[at]), float(curve.frequency_hz[at]),
        )
        for each, of, shares, at in zip(limited, values, share, np.nanargmax(share, axis=1), strict=True)
    ]  # fmt: skip
    ranges, points = _ranges(notching, limited, curve, share), notching.frequency_hz.size
    unit = [{"notch_unit": notching.unit}]
    table = {
        "point": 1 + np.arange(points), "curve": np.zeros(points, dtype=np.int64), "quantity": notching.quantity,
        "frequency_hz": notching.frequency_hz, "level": notching.level, "specified": notching.specification,
    }  # fmt: skip
    tables = {
        "notches": NOTCHES.dataset(table, {"point": unit}),
        "notch_limits": NOTCH_LIMITS.table(limits, curve=np.zeros(len(limits), dtype=np.int64)),
        "notch_ranges": NOTCH_RANGES.table(ranges, unit, curve=np.zeros(len(ranges), dtype=np.int64)),
    }
    return replace(curve, tables={**curve.tables, **tables}), _exceeded_outcome(curve, limited, share)


def _exceeded_outcome(curve: SweepCurve, limits: Sequence[LimitColumn], shares: Floats) -> Outcome | None:
    over = shares > 1.0 + ALLOWED_EXCESS
    if not over.any():
        return None
    row, at = (int(i) for i in np.unravel_index(np.nanargmax(shares), shares.shape))
    where = np.flatnonzero(over.any(axis=0))
    f = np.sort(curve.frequency_hz[where])
    parts = np.split(f, np.flatnonzero(np.diff(f) > NARROW_RANGE * f[:-1]) + 1)
    share = curve["contact_share"].values[:, where] if "contact_share" in curve.cycles else np.zeros(0)
    moved = bool(np.any((share > 0) & (share < 1)))
    reason = (
        "contacts open and close and the response does not settle from cycle to cycle" if moved else
        "the response changes faster than the level can follow"
    )  # fmt: skip
    percent = float(100 * (shares[row, at] - 1))
    return Outcome.of(
        OutcomeKind.NOT_HELD, NOTCH_EXCEEDED,
        f"notching: {limits[row].name} is exceeded by up to {percent:.3g} % at {curve.frequency_hz[at]:.4g} Hz, where "
        f"{reason}; limits are exceeded",
        at=Where([(float(part[0]), float(part[-1])) for part in parts], "Hz"),
        remedy="sweep more slowly, start further from the resonance or at a lower level, or raise the limit",
        limit=limits[row].name, percent=percent, frequency=float(curve.frequency_hz[at]),
    )  # fmt: skip


def combine_level_outcomes(outcomes: Sequence[Outcome], names: Sequence[Where]) -> Outcome:
    """Combine the outcomes of the levels of a sweep.

    The first incomplete outcome stands for all. For exceeded limits, the largest excess does, and the other levels
    with an excess are named.
    """
    over = [(each, name) for each, name in zip(outcomes, names, strict=True) if each.code == NOTCH_EXCEEDED]
    if len(outcomes) == 1 or not over:
        return combined(outcomes)
    over.sort(key=lambda item: -_number(item[0], "percent"))
    (largest, name), *rest = over
    parts = []
    for each, at in rest:
        percent, frequency = _number(each, "percent"), _number(each, "frequency")
        sentence = f"{each.numbers['limit']} is exceeded by up to {percent:.3g} % at {frequency:.4g} Hz"
        parts.append(each.copy_with(sentence=sentence, place=None, remedy="", context=at))
    others = combined([each for each in outcomes if each.code != NOTCH_EXCEEDED])
    return largest.copy_with(*parts, *others.unless_complete, context=name)


def _number(outcome: Outcome, name: str) -> float:
    return of_kind(float, outcome.numbers[name])


def _ranges(
    notching: Notching, limits: Sequence[LimitColumn], curve: SweepCurve, share: Floats
) -> Sequence[NotchedRange]:
    """Frequency ranges with a lowered level, each with the limit that governs most of it."""
    order = np.argsort(curve.frequency_hz)
    f = curve.frequency_hz[order]
    reduction = np.interp(np.log(f), np.log(notching.frequency_hz), np.log(notching.level / notching.specification))
    governing = np.where(reduction < np.log(LARGEST_NOTCHED_RATIO), np.argmax(share[:, order], axis=0), -1)
    starts = np.concatenate([[0], np.flatnonzero(np.diff(governing)) + 1])
    runs = [[int(a), int(b), int(governing[a])] for a, b in zip(starts, np.append(starts[1:], f.size), strict=True)]
    merged: list[list[int]] = []
    for run in runs:
        narrow = f[run[1] - 1] / f[run[0]] - 1.0 < NARROW_RANGE
        if merged and (merged[-1][2] == run[2] or (narrow and run[2] >= 0 and merged[-1][2] >= 0)):
            merged[-1][1] = run[1]
        else:
            merged.append(run)
    ranges = []
    for first, last, which in merged:
        if which < 0:
            continue
        deepest = first + int(np.argmin(reduction[first:last]))
        at = float(f[deepest])
        level = float(on_curve(at, notching.frequency_hz, notching.level))
        decibels = float(20 / np.log(10) * reduction[deepest])
        ranges.append(NotchedRange(limits[which].name, float(f[first]), float(f[last - 1]), at, level, decibels))
    return ranges
