"""``beamsim sweep``, kind stepped: the steady motion at each frequency, started from the previous one."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from beamsim.analyses.sweep.cycles import CycleRecord, SinePhase, balanced, energy_errors, record_cycles
from beamsim.analyses.sweep.outputs import LevelRun, SweepLevel, SweepOutputs
from beamsim.analyses.sweep.result import LevelWork, SteadyStates, SweepCurve, SweepWork
from beamsim.flow.exact import ExactFlow
from beamsim.flow.march import Motion
from beamsim.flow.processor_time import processor_time
from beamsim.flow.transient import start
from beamsim.inputs.profiles import acceleration_amplitude, phase_of_acceleration
from beamsim.inputs.signal import Signal
from beamsim.orbits.steady import CycleStepper, Settled, largest_exponent, settle
from beamsim.outcomes import COMPLETE, Outcome, OutcomeKind, Where, interruption, never
from beamsim.scenario.quantities import level_unit
from beamsim.scenario.sweep import SteppedSine
from beamsim.system.equations import Forcing
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats

MOST_MEASURED = 240


@dataclass
class _Point:
    frequency_hz: float
    amplitude: float
    settled: Settled
    kind: str
    exponent: float
    measured: CycleRecord
    section: Floats


def frequencies_of(settings: SteppedSine) -> Floats:
    """Frequencies of the steps, increasing."""
    if settings.spacing == "logarithmic":
        return np.geomspace(settings.from_, settings.to, settings.points)
    return np.linspace(settings.from_, settings.to, settings.points)


def step_level(
    one: SweepLevel, progress: Callable[[float], None] | None = None, stop: Callable[[], bool] = never
) -> LevelRun:
    """Step through the frequencies at one level, in all directions.

    Parameters
    ----------
    one : the level, of a stepped sine.
    progress : called with the share of the frequencies that is done.
    stop : asked before every frequency but the first.

    Returns
    -------
    LevelRun
        Up to a frequency at which the motion could not be computed, or to where it was stopped.
    """
    begin, system, settings, level = processor_time(), one.system, one.settings, one.value
    assert isinstance(settings, SteppedSine)
    up = frequencies_of(settings)
    sequences = {"up": [("up", up)], "down": [("down", up[::-1])], "both": [("up", up), ("down", up[::-1])]}
    directions = sequences[settings.direction]
    quantity = one.quantity
    phase = one.excitation.phase + phase_of_acceleration(quantity, level)
    total = sum(f.size for _, f in directions)

    def under(f: float) -> tuple[Forcing, tuple[Signal, ...], float]:
        sine = -1j * acceleration_amplitude(abs(level), quantity, f) * np.exp(1j * phase)
        return *harmonic_loads(system, 2 * np.pi * f, sine), 1.0 / f

    forcing, observers, period = under(float(directions[0][1][0]))
    flow = ExactFlow(system.dynamics, forcing, period, observers)
    motion, _ = start(flow, system.initial_state)
    stepper = CycleStepper(flow, period)
    curves, outcome, done = [], COMPLETE, 0
    for direction, frequencies in directions:
        points: list[_Point] = []
        for f in frequencies:
            if done and stop():
                outcome = interruption(f"before {f:.6g} Hz")
                break
            forcing, observers, period = under(float(f))
            stepper.use(stepper.flow.under(forcing, observers, period), period, motion)
            amplitude = acceleration_amplitude(abs(level), quantity, float(f))
            try:
                points.append(_point(stepper, motion, settings, float(f), amplitude, one.outputs))
            except ArithmeticError as error:
                outcome = Outcome.of(OutcomeKind.STOPPED, "no_steady_state", str(error), at=Where(float(f), "Hz"))
                break
            done += 1
            if progress is not None:
                progress(done / total)
        if points:
            curves.append(_curve(one, direction, points))
        if not outcome.complete:
            break
    work = SweepWork(
        cycles=stepper.cycles,
        events=stepper.events,
        evaluations=stepper.evaluations,
        segments=stepper.segments,
        states=len(stepper.flow.visited),
        processor_time_s=processor_time() - begin,
    )
    return LevelRun(tuple(curves), LevelWork(float(level), balanced(outcome, curves), 0.0, work))


def harmonic_loads(system: StructuralSystem, omega: float, sine: complex) -> tuple[Forcing, tuple[Signal, ...]]:
    """The loads of a built system under a sine of one frequency.

    Parameters
    ----------
    system : whose excitation is harmonic.
    omega : rad/s.
    sine : complex amplitude of ``exp(i omega t)``, of which the sine is the real part.

    Returns
    -------
    forcing : the loads, and the displacement of the base where contacts feel it.
    observers : the base's acceleration; none where the base rests.
    """
    assert system.sine is not None

    def signal(amplitude: complex) -> Signal:
        return Signal(np.zeros(1), np.array([1j * omega]), np.full((1, 1, 1), amplitude))

    forcing, moves = system.forcing, system.base_acceleration is not None
    signals = tuple(signal(factor * sine) for factor in system.sine.at(np.array([omega]))[0])
    felt = None if forcing.base_displacement is None else signal(-sine / omega**2)
    return Forcing(forcing.load, signals, felt), (signal(sine),) if moves else ()


def _cycles_to_measure(settings: SteppedSine, period: int) -> int:
    """At least `measured_cycles`: a whole number of periods of the motion and, if possible, of the orders."""
    repeat = period
    for order in settings.tracked_orders:
        longer = math.lcm(repeat, Fraction(order).limit_denominator(12).denominator)
        if longer <= MOST_MEASURED:
            repeat = longer
    return max(repeat, min(math.ceil(settings.measured_cycles / repeat) * repeat, MOST_MEASURED // repeat * repeat))


def _point(
    stepper: CycleStepper,
    motion: Motion,
    settings: SteppedSine,
    frequency: float,
    amplitude: float,
    outputs: SweepOutputs,
) -> _Point:
    """The steady motion at one frequency."""
    settled = settle(
        stepper, motion, tolerance=settings.steady_to, longest_period=settings.longest_period,
        most_cycles=settings.most_cycles,
    )  # fmt: skip
    kind, exponent, section = "periodic", float("nan"), settled.section[:0]
    cycles = _cycles_to_measure(settings, settled.period) if settled.period else 64  # measured if there is no period
    if not settled.period:
        lyapunov = largest_exponent(stepper, motion, min(400, settings.most_cycles))
        kind, exponent, section = lyapunov.kind, lyapunov.value, settled.section
    measured = record_cycles(
        stepper.trajectory(motion, cycles), np.arange(cycles + 1.0) * stepper.period, outputs.rows(stepper.flow),
        (0.0, *settings.tracked_orders), SinePhase.constant(stepper.omega), outputs.searched,
    )  # fmt: skip
    return _Point(frequency, amplitude, settled, kind, exponent, measured, section)


def _curve(one: SweepLevel, direction: str, points: list[_Point]) -> SweepCurve:
    probes, n = one.system.probes, one.system.dynamics.size
    frequency = np.array([p.frequency_hz for p in points])
    shapes = np.array([p.shape for p in probes]).reshape(-1, n)
    section = np.concatenate([p.section for p in points])
    elapsed = np.cumsum([0.0] + [(p.settled.cycles + p.measured.count) / p.frequency_hz for p in points])
    steady = SteadyStates(
        kind=tuple(p.kind for p in points),
        period_cycles=np.array([p.settled.period for p in points], dtype=np.int64),
        cycles=np.array([p.settled.cycles for p in points], dtype=np.int64),
        change=np.array([p.settled.change for p in points]),
        lyapunov_exponent=np.array([p.exponent for p in points]),
        poincare_frequency_hz=np.repeat(frequency, [p.section.shape[0] for p in points]),
        probes=tuple(p.name for p in probes),
        poincare_displacement=section[:, :n] @ shapes.T,
        poincare_velocity=section[:, n : 2 * n] @ shapes.T,
    )
    return one.curve(
        CycleRecord.joined([p.measured.merged() for p in points]), direction,
        level_unit=level_unit(one.quantity), frequency_hz=frequency, time=elapsed[:-1],
        excitation_amplitude=np.array([p.amplitude for p in points]), steady=steady,
        energy_error=np.array([energy_errors(p.measured.imbalance, p.measured.energy).max() for p in points]),
    )  # fmt: skip
