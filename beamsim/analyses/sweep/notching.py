"""Notches of a swept sine: the level under which limits on responses and forces are met, and which of them governs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from beamsim.analyses.sweep.outputs import SweepLevel
from beamsim.analyses.sweep.result import NotchedRange, Notching, NotchLimit, SweepCurve
from beamsim.analyses.values import Margins, judged
from beamsim.analyses.values import limited as limited_value
from beamsim.flow.contact_state import OutputOf
from beamsim.flow.exact import ExactFlow
from beamsim.flow.swept_motion import LevelControl, SweptLoads
from beamsim.inputs.measured import on_curve
from beamsim.inputs.profiles import Leg, Profile
from beamsim.outcomes import Outcome, OutcomeKind, Progress, Stop, Where, never
from beamsim.scenario.quantities import power_of
from beamsim.scenario.reporting import BASE_FORCE, LimitedQuantity, limited_quantity
from beamsim.scenario.scenario import Scenario
from beamsim.scenario.sweep import SweptSine
from beamsim.typing import Floats, not_none, of_kind

ALLOWED_EXCESS = 0.05  # of a limit
LEVEL_KNOWN = 1e-3  # relative, to which the table is the level that was followed
LOWERED = 0.995  # of the specification; a higher level is none that is notched
NARROW = 0.01  # relative width below which a range between others is not told from them
SAME_STEP = 1e-9  # relative change of the specification that is no step


@dataclass(frozen=True)
class Limited:
    """A limit and the column of the sweep's outputs to which it applies."""

    name: str
    limit: float
    of: LimitedQuantity
    column: int


def with_limited_outputs(scenario: Scenario) -> Scenario:
    """The scenario with the force of its base among the outputs, where a limit needs it."""
    limits = scenario.sweep.notch_to if isinstance(scenario.sweep, SweptSine) else None
    if limits and "base.force" in limits and scenario.base_force is None:
        return scenario.model_copy(update={"outputs": (*scenario.outputs, BASE_FORCE)})
    return scenario


def limited_of(limits: Mapping[str, float], one: SweepLevel) -> tuple[Limited, ...]:
    """The limits with the columns of a level to which they apply.

    Parameters
    ----------
    limits : by name, such as ``probes.tip.acceleration``, in SI units.
    one : the level.

    Returns
    -------
    tuple
        In the order of the limits.

    Raises
    ------
    KeyError
        Where a limit is on what the sweep does not follow, which `beamsim.scenario` has refused.
    """
    columns = {
        LimitedQuantity(c.section, c.name, "" if c.section == "outputs" else c.quantity.removeprefix("absolute_")): k
        for c, k in one.channels.located
    }
    limited = []
    for name, limit in limits.items():
        of = not_none(limited_quantity(name, one.base_force))
        limited.append(Limited(name, float(limit), of, columns[of]))
    return tuple(limited)


def notched_level(
    one: SweepLevel,
    loads: SweptLoads,
    limited: Sequence[Limited],
    leg: Leg,
    profile: Profile,
    phase: float,
    progress: Progress = None,
    stop: Stop = never,
) -> Notching:
    """Follow a leg and lower its level to the limits; what the response is then is left to `compared`.

    Parameters
    ----------
    one : the level, of a swept sine.
    loads : on its system, under given windows.
    limited : the limits.
    leg : the sweep, up or down.
    profile : the level without notches.
    phase : of the sine at the start, rad.
    progress : called with the share of the leg that is done.
    stop : asked on the way; once it says so, the table ends there.

    Returns
    -------
    Notching
        The table of the level, in the quantity with which the sweep begins, without limits and ranges.
    """
    system, settings, quantity = one.system, of_kind(SweptSine, one.settings), one.quantity
    if settings.profile:
        quantity = settings.profile[0].quantity or ("acceleration" if power_of(quantity) else quantity)
    specification = continuous(profile, leg)
    columns = np.array([each.column for each in limited])

    def limited_outputs(flow: ExactFlow) -> OutputOf:
        rows = one.rows(flow)
        return lambda phases: rows(phases).some(columns)

    control = LevelControl(
        system.dynamics, loads, limited_outputs, np.array([each.limit for each in limited]), leg, specification,
        phase, system.base_acceleration is not None, system.initial_state, stop, progress,
    )  # fmt: skip
    frequency, amplitude = control.level()
    divisor = (2 * np.pi * frequency) ** power_of(quantity)
    return Notching(quantity, frequency, amplitude / divisor, specification(frequency) / divisor, control.trials)


def continuous(profile: Profile, leg: Leg) -> Profile:
    """A profile with the ends of a leg among its points, whose steps take a cycle."""
    low, high = sorted((leg.first_hz, leg.last_hz))
    edges = profile.edge[(profile.edge > low) & (profile.edge < high)]
    points = [low]
    for edge in edges:
        below = float(profile(np.nextafter(edge, 0.0)))
        if abs(float(profile(edge)) / below - 1.0) <= SAME_STEP:
            points.append(float(edge))
            continue
        turns = float(leg.turns(np.array(edge)))
        around = leg.frequency(np.clip([turns - 0.5, turns + 0.5], 0.0, leg.cycles))
        points += sorted(float(f) for f in around)
    frequency = np.unique([*points, high])
    return Profile.through(frequency, profile(np.append(frequency[:-1], np.nextafter(high, 0.0))))


def with_held_limits(scenario: Scenario, margins: Margins) -> Margins:
    """Margins of which those that the level keeps say how well it is known: its table is thinned by as much."""
    limits = getattr(scenario.sweep, "notch_to", None) or {}
    of = [limited_quantity(name, scenario.base_force or BASE_FORCE.name) for name in limits]
    held = {(f"peak_{each.quantity}" if each.quantity else each.section, each.item) for each in of if each is not None}

    def of_level(name: str, at: str) -> bool:
        value, place = limited_value(name)
        return (value.limit, place or at.partition(",")[0]) in held

    return judged({
        name: item | ({"held_within": LEVEL_KNOWN} if of_level(name, item["at"]) else {})
        for name, item in margins.items()
    })  # fmt: skip


def with_notching(
    notching: Notching, limited: Sequence[Limited], curve: SweepCurve
) -> tuple[SweepCurve, Outcome | None]:
    """The response under a notched level, with its largest values, and which limit governs where.

    Parameters
    ----------
    notching : without limits and ranges.
    limited : the limits.
    curve : the response.

    Returns
    -------
    curve : with the notching.
    not_held : what to say where a limit is exceeded by more than is allowed; None where all are met.
    """
    envelopes = [curve.envelope_of(each.of) for each in limited]
    share = np.array([of.peak / each.limit for of, each in zip(envelopes, limited, strict=True)])  # (limits, C)
    limits = tuple(
        NotchLimit(
            each.name, of.unit, each.limit, float(of.peak[at]), float(shares[at]), float(curve.frequency_hz[at]),
        )
        for each, of, shares, at in zip(limited, envelopes, share, np.nanargmax(share, axis=1), strict=True)
    )  # fmt: skip
    notching = replace(notching, limits=limits, ranges=tuple(_ranges(notching, limited, curve, share)))
    return replace(curve, notching=notching), _not_held(curve, limited, share)


def _not_held(curve: SweepCurve, limited: Sequence[Limited], shares: Floats) -> Outcome | None:
    over = shares > 1.0 + ALLOWED_EXCESS
    if not over.any():
        return None
    row, at = (int(i) for i in np.unravel_index(np.nanargmax(shares), shares.shape))
    where = np.flatnonzero(over.any(axis=0))
    f = np.sort(curve.frequency_hz[where])
    parts = np.split(f, np.flatnonzero(np.diff(f) > NARROW * f[:-1]) + 1)
    moved = any(np.any((share[where] > 0) & (share[where] < 1)) for share in curve.contact_share.values())
    reason = (
        "contacts open and close and the response does not settle from cycle to cycle" if moved else
        "the response changes faster than the level can follow"
    )  # fmt: skip
    percent = float(100 * (shares[row, at] - 1))
    return Outcome.of(
        OutcomeKind.INCOMPLETE, "notch_not_held",
        f"notching: {limited[row].name} is exceeded by up to {percent:.3g} % at {curve.frequency_hz[at]:.4g} Hz, where "
        f"{reason}; limits are exceeded",
        at=Where([(float(part[0]), float(part[-1])) for part in parts], "Hz"),
        remedy="sweep more slowly, start further from the resonance or at a lower level, or raise the limit",
        limit=limited[row].name, percent=percent, frequency=float(curve.frequency_hz[at]),
    )  # fmt: skip


def _ranges(notching: Notching, limited: Sequence[Limited], curve: SweepCurve, share: Floats) -> Sequence[NotchedRange]:
    """Ranges of frequency in which the level is lowered, each with the limit that governs most of it."""
    order = np.argsort(curve.frequency_hz)
    f = curve.frequency_hz[order]
    reduction = np.interp(np.log(f), np.log(notching.frequency_hz), np.log(notching.level / notching.specified))
    governing = np.where(reduction < np.log(LOWERED), np.argmax(share[:, order], axis=0), -1)
    starts = np.concatenate([[0], np.flatnonzero(np.diff(governing)) + 1])
    runs = [[int(a), int(b), int(governing[a])] for a, b in zip(starts, np.append(starts[1:], f.size), strict=True)]
    merged: list[list[int]] = []
    for run in runs:
        narrow = f[run[1] - 1] / f[run[0]] - 1.0 < NARROW
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
        ranges.append(NotchedRange(limited[which].name, float(f[first]), float(f[last - 1]), at, level, decibels))
    return ranges
