"""``beamsim sweep``, kind swept_sine: a continuous sweep, evaluated cycle by cycle."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from beamsim.analyses.sweep.cycles import CycleRecord, SinePhase, balanced, energy_errors, record_cycles
from beamsim.analyses.sweep.notching import Limited, compared, limited_of, not_held, notched_level, profile_through
from beamsim.analyses.sweep.outputs import LevelRun, SweepLevel
from beamsim.analyses.sweep.result import LevelWork, Notching, SweepCurve, SweepWork
from beamsim.errors import Problem, ScenarioError
from beamsim.flow.swept_motion import SweptLoads, SweptMotion
from beamsim.inputs.drift import CorrectionSize, jumps
from beamsim.inputs.profiles import Leg, Profile, make_leg, make_profile, phase_of_acceleration, power_of
from beamsim.inputs.signal import Signal
from beamsim.inputs.swept import SweepWindows, cut_into_windows, swept_signals
from beamsim.outcomes import never
from beamsim.scenario.excitation import Sine
from beamsim.scenario.quantities import level_unit
from beamsim.scenario.sweep import SweptSine
from beamsim.system.equations import Forcing
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats

MOST_CYCLES = 5_000_000
CONTROL = 0.8  # share of the work of a notched sweep that chooses the level


def legs_of(settings: SweptSine) -> list[Leg]:
    """The legs of the sweep, up or down, in order."""
    up = make_leg(settings.from_, settings.to, settings.rate)
    down = make_leg(settings.to, settings.from_, settings.rate)
    legs = {"up": [up], "down": [down], "both": [up, down]}[settings.direction]
    cycles = sum(leg.cycles for leg in legs)
    if cycles > MOST_CYCLES:
        raise ScenarioError(
            Problem(
                "sweep.rate",
                f"= {settings.rate} makes a sweep of {cycles:.3g} cycles (at most {MOST_CYCLES:.0e})",
                "sweep faster or over fewer frequencies",
            )
        )
    if cycles < 2:
        raise ScenarioError(
            Problem("sweep.rate", f"= {settings.rate} covers the range in {cycles:.2g} cycles", "sweep more slowly")
        )
    return legs


def _profile_of(settings: SweptSine, excitation: Sine, level: float) -> Profile:
    """Amplitude of acceleration or force against frequency; with a table ``level`` is a factor."""
    quantity = excitation.quantity or "acceleration"
    return make_profile(level, quantity, settings.profile, settings.between, settings.notches)


def swept_loads(system: StructuralSystem) -> SweptLoads:
    """The loads of a built system whose sine is replaced by the swept one; observed is the base's acceleration."""
    moves, forcing = system.base_acceleration, system.forcing

    def loads(windows: SweepWindows, carrier: float) -> tuple[Forcing, tuple[Signal, ...]]:
        if moves is None:
            assert system.sine is not None
            factors = system.sine.at(windows.omega)  # supports that move are known at constant frequency alone
            sines = (replace(windows, coefficient=factor[:, None] * windows.coefficient) for factor in factors.T)
            return replace(forcing, signal=tuple(swept_signals(sine, carrier)[0] for sine in sines)), ()
        acceleration, _, displacement = swept_signals(windows, carrier)
        signals = tuple(acceleration if signal is moves else displacement for signal in forcing.signal)
        felt = None if forcing.base_displacement is None else displacement
        return Forcing(forcing.load, signals, felt), (acceleration,)

    return loads


def sweep_level(
    one: SweepLevel, progress: Callable[[float], None] | None = None, stop: Callable[[], bool] = never
) -> LevelRun:
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
    system, settings, outputs = one.system, one.settings, one.outputs
    assert isinstance(settings, SweptSine)
    legs = legs_of(settings)
    profile = _profile_of(settings, one.excitation, one.value)
    phase = one.excitation.phase + phase_of_acceleration(one.quantity, one.value, settings.profile)
    notching: Notching | None = None
    notch_limits: tuple[Limited, ...] = ()
    if settings.notch_to is not None:
        notch_limits = limited_of(settings.notch_to, outputs, one.base_force)
        notching = _notching(one, notch_limits, legs[0], profile, phase, progress, stop)
        profile = profile_through(notching)
        progress = None if progress is None else partial(_second_part, progress)
    corrections = None if system.base_acceleration is None else jumps(legs, profile, phase)
    windows = cut_into_windows(legs, profile, phase=phase, corrections=corrections, tolerance=settings.tolerance)
    march = SweptMotion(
        system.dynamics, swept_loads(system), windows, system.initial_state, progress=progress, stop=stop
    )
    orders, rate = (0.0, *settings.tracked_orders), settings.history_rate
    times = np.zeros(0) if rate is None else _history_times(rate, windows.duration)
    parts: list[CycleRecord] = []
    samples: list[Floats] = []
    for stretch in march.stretches():
        output_of = outputs.rows(stretch.motion.flow)
        if stretch.reached:
            phases = SinePhase.of_windows(stretch.windows)
            record = record_cycles(stretch.motion, stretch.edge, output_of, orders, phases, outputs.searched)
            parts.append(record.some(slice(stretch.reached)))
        sampled = sum(values.shape[0] for values in samples)
        here = times[sampled : int(np.searchsorted(times, march.end * (1 + 1e-12), side="right"))]
        samples.append(stretch.motion.sample(here - float(windows.edge[stretch.first]), output_of))
    curves = _curves(one, profile, windows, CycleRecord.joined(parts)) if parts else ()
    history = None
    if rate is not None:
        values = np.concatenate(samples)
        history = outputs.history(times[: values.shape[0]], values)
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
        curves = tuple(replace(curve, notching=compared(notching, notch_limits, curve)) for curve in curves)
        missed = [out for curve in curves if (out := not_held(curve, notch_limits)) is not None]
        outcome = missed[0].but(*outcome.unless_complete) if missed else outcome
    return LevelRun(curves, LevelWork(float(one.value), outcome, windows.truncation, work, correction), history)


def _notching(
    one: SweepLevel,
    limits: Sequence[Limited],
    leg: Leg,
    profile: Profile,
    phase: float,
    progress: Callable[[float], None] | None,
    stop: Callable[[], bool],
) -> Notching:
    """The level of a leg that keeps the limits, in the quantity with which the sweep begins."""
    system, settings, quantity = one.system, one.settings, one.quantity
    assert isinstance(settings, SweptSine)
    of_base = system.base_acceleration is not None
    if settings.profile:
        quantity = settings.profile[0].quantity or ("acceleration" if power_of(quantity) else quantity)
    return notched_level(
        swept_loads(system), one.outputs, limits, leg, profile, quantity=quantity, phase=phase, of_base=of_base,
        progress=None if progress is None else lambda part: progress(CONTROL * part), stop=stop,
    )  # fmt: skip


def _second_part(progress: Callable[[float], None], part: float) -> None:
    progress(CONTROL + (1.0 - CONTROL) * part)


def _curves(one: SweepLevel, profile: Profile, windows: SweepWindows, record: CycleRecord) -> tuple[SweepCurve, ...]:
    """The curves of the legs that were reached."""
    settings = one.settings
    assert isinstance(settings, SweptSine)
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


def _history_times(rate: float, end: float) -> Floats:
    return np.arange(int(np.floor(end * rate * (1 + 1e-12))) + 1) / rate
