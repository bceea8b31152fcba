"""``beamsim sweep``, kind swept_sine: a continuous sweep, evaluated cycle by cycle."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from beamsim.analyses.run.motion import reached, samples_until
from beamsim.analyses.sweep.cycles import CycleRecord, SinePhase, balanced, energy_errors, record_cycles
from beamsim.analyses.sweep.notching import Limited, limited_of, notched_level, with_notching
from beamsim.analyses.sweep.outputs import LevelRun, SweepLevel
from beamsim.analyses.sweep.result import LevelWork, Notching, SweepCurve, SweepHistory, SweepWork
from beamsim.errors import ScenarioError
from beamsim.flow.swept_motion import SweptLoads, SweptMotion
from beamsim.inputs.drift import Correction, CorrectionSize, jumps
from beamsim.inputs.profiles import Leg, Profile, make_leg, make_profile, phase_of_acceleration
from beamsim.inputs.signal import Signal
from beamsim.inputs.swept import SweepWindows, cut_into_windows, swept_signals
from beamsim.outcomes import Progress, Stop, never, part_of
from beamsim.scenario.quantities import level_unit
from beamsim.scenario.sweep import SweptSine
from beamsim.system.equations import Forcing
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats, not_none, of_kind

MOST_CYCLES = 5_000_000
CONTROL = 0.8  # share of the work of a notched sweep that chooses the level


def legs_of(settings: SweptSine) -> list[Leg]:
    """The legs of the sweep, up or down, in order."""
    up = make_leg(settings.from_, settings.to, settings.rate)
    down = make_leg(settings.to, settings.from_, settings.rate)
    legs = {"up": [up], "down": [down], "both": [up, down]}[settings.direction]
    cycles = sum(leg.cycles for leg in legs)
    if cycles > MOST_CYCLES:
        raise ScenarioError.at(
            "sweep.rate",
            f"= {settings.rate} makes a sweep of {cycles:.3g} cycles (at most {MOST_CYCLES:.0e})",
            "sweep faster or over fewer frequencies",
        )
    if cycles < 2:
        raise ScenarioError.at(
            "sweep.rate", f"= {settings.rate} covers the range in {cycles:.2g} cycles", "sweep more slowly"
        )
    return legs


def swept_loads(system: StructuralSystem) -> SweptLoads:
    """The loads of a built system whose sine is replaced by the swept one; observed is the base's acceleration."""
    moves, forcing = system.base_acceleration, system.forcing

    def loads(windows: SweepWindows, carrier: float) -> tuple[Forcing, tuple[Signal, ...]]:
        if moves is None:
            factors = not_none(system.sine).at(
                windows.omega
            )  # supports that move are known at constant frequency alone
            sines = (replace(windows, coefficient=factor[:, None] * windows.coefficient) for factor in factors.T)
            return replace(forcing, signal=tuple(swept_signals(sine, carrier)[0] for sine in sines)), ()
        acceleration, _, displacement = swept_signals(windows, carrier)
        signals = tuple(acceleration if signal is moves else displacement for signal in forcing.signal)
        base = None if forcing.base_displacement is None else displacement
        return Forcing(forcing.load, signals, base), (acceleration,)

    return loads


def sweep_profile(one: SweepLevel) -> tuple[Profile, float]:
    """The level over frequency, a table of which the level is a factor, and the phase of the sine at the start."""
    settings = of_kind(SweptSine, one.settings)
    profile = make_profile(one.value, one.quantity, settings.profile, settings.between, settings.notches)
    return profile, one.excitation.phase + phase_of_acceleration(one.quantity, one.value, settings.profile)


class SweptMarch(NamedTuple):
    """The motion of a level, to be marched, and what drives it."""

    motion: SweptMotion
    profile: Profile
    corrections: tuple[Correction, ...] | None  # of a base's acceleration


def swept_march(
    one: SweepLevel, notching: Notching | None, progress: Progress = None, stop: Stop = never
) -> SweptMarch:
    """The motion of a level in all directions.

    Parameters
    ----------
    one : the level, of a swept sine.
    notching : its table, where it is lowered to limits.
    progress, stop : as of `sweep_level`.

    Returns
    -------
    SweptMarch

    Raises
    ------
    ScenarioError
        Where the rate makes the sweep too long, or shorter than two cycles.
    """
    system, settings = one.system, of_kind(SweptSine, one.settings)
    legs, (profile, phase) = legs_of(settings), sweep_profile(one)
    if notching is not None:  # as the same table in a file would give it
        table = zip(notching.frequency_hz.tolist(), notching.level.tolist(), strict=True)
        profile = Profile.interpolated([(f, level, notching.quantity) for f, level in table])
    corrections = None if system.base_acceleration is None else jumps(legs, profile, phase)
    windows = cut_into_windows(legs, profile, phase=phase, corrections=corrections, tolerance=settings.tolerance)
    march = SweptMotion(
        system.dynamics, swept_loads(system), windows, system.initial_state, stop=stop, progress=progress
    )
    return SweptMarch(march, profile, corrections)


def sweep_level(one: SweepLevel, progress: Progress = None, stop: Stop = never) -> LevelRun:
    """Sweep at one level in all directions; each direction starts from the final motion of the previous one.

    Parameters
    ----------
    one : the level, of a swept sine.
    progress : called with the share of the work that is done.
    stop : asked between cycles.

    Returns
    -------
    LevelRun
        The directions up to where it ended, the last of which may be incomplete.

    Raises
    ------
    ScenarioError
        Where the rate makes the sweep too long, or shorter than two cycles.
    """
    system, settings = one.system, of_kind(SweptSine, one.settings)
    beginning = 0.0 if settings.notch_to is None else CONTROL
    notching: Notching | None = None
    notch_limits: tuple[Limited, ...] = ()
    if settings.notch_to is not None:
        notch_limits = limited_of(settings.notch_to, one)
        notching = notched_level(
            one, swept_loads(system), notch_limits, legs_of(settings)[0], *sweep_profile(one),
            part_of(progress, 0.0, CONTROL), stop,
        )  # fmt: skip
    march, profile, corrections = swept_march(one, notching, part_of(progress, beginning, 1.0), stop)
    windows = march.windows
    parts, history = _recorded(one, march)
    curves = _curves(one, profile, windows, CycleRecord.joined(parts)) if parts else ()
    work = SweepWork(
        cycles=sum(part.count for part in parts),
        events=march.events,
        evaluations=march.evaluations,
        segments=march.segments,
        states=march.states,
        processor_time_s=march.processor_time_s,
    )
    correction = None if corrections is None else CorrectionSize.of(corrections)
    outcome = balanced(march.outcome, curves)
    if notching is not None:
        judged = [with_notching(notching, notch_limits, curve) for curve in curves]
        curves, missed = tuple(curve for curve, _ in judged), [not_held for _, not_held in judged if not_held]
        outcome = missed[0].but(*outcome.unless_complete) if missed else outcome
    return LevelRun(curves, LevelWork(float(one.value), outcome, windows.truncation, work, correction), history)


def _recorded(one: SweepLevel, march: SweptMotion) -> tuple[list[CycleRecord], SweepHistory | None]:
    """March, with what is recorded of each stretch's cycles, and the time history where one is asked for."""
    settings, windows = of_kind(SweptSine, one.settings), march.windows
    orders, rate = (0.0, *settings.tracked_orders), settings.history_rate
    times = np.arange(0 if rate is None else samples_until(windows.duration, rate)) / (rate or 1.0)
    parts: list[CycleRecord] = []
    samples: list[Floats] = []
    for stretch in march.stretches():
        output_of = one.rows(stretch.motion.flow)
        if stretch.reached:
            phases = SinePhase.of_windows(stretch.windows)
            record = record_cycles(stretch.motion, stretch.edge, output_of, orders, phases, one.searched)
            parts.append(record.some(slice(stretch.reached)))
        sampled = sum(values.shape[0] for values in samples)
        here = reached(march.end, times)[sampled:]
        samples.append(stretch.motion.sample(here - float(windows.edge[stretch.first]), output_of))
    if rate is None:
        return parts, None
    values = np.concatenate(samples)
    return parts, one.history(times[: values.shape[0]], values)


def _curves(one: SweepLevel, profile: Profile, windows: SweepWindows, record: CycleRecord) -> tuple[SweepCurve, ...]:
    """The curves of the legs that were reached."""
    settings = of_kind(SweptSine, one.settings)
    tracked = replace(record, harmonic=np.moveaxis(record.tracked((0.0, *settings.tracked_orders)), 0, 2))
    curves = []
    for index, leg in enumerate(legs_of(settings)):
        computed = np.flatnonzero(windows.cycle_leg[: record.count] == index)
        complete = (computed < windows.cycles - 1) | windows.complete
        cycles = computed[complete]
        if not cycles.size:
            continue
        of_leg = tracked.some(computed)
        frequency = windows.frequency_hz[cycles]
        curve = one.curve(
            of_leg if complete[-1] else of_leg.with_rest_in_last(), "up" if leg.last_hz > leg.first_hz else "down",
            level_unit="" if settings.profile else level_unit(one.quantity), frequency_hz=frequency,
            time=windows.edge[cycles], excitation_amplitude=profile(frequency),
            energy_error=energy_errors(of_leg.imbalance, of_leg.energy, complete),
        )  # fmt: skip
        curves.append(curve)
    return tuple(curves)
