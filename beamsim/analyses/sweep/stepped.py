"""``beamsim sweep``, kind stepped: the steady motion at each frequency, each started from the previous one."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np

from beamsim.analyses.sweep.cycles import CycleRecord, SinePhase, check_balance, energy_errors, record_cycles
from beamsim.analyses.sweep.layouts import POINCARE, STEADY_STATES
from beamsim.analyses.sweep.outputs import LevelRun, SweepLevel, level_row
from beamsim.analyses.sweep.result import SweepCurve
from beamsim.flow.compiled import processor_time
from beamsim.flow.exact import ExactFlow
from beamsim.flow.transient import Motion, start
from beamsim.orbits.steady import CycleStepper, Exponent, Periodicity, largest_exponent, settle
from beamsim.outcomes import (
    COMPLETE,
    Outcome,
    OutcomeKind,
    Progress,
    Where,
    interruption,
    report_progress,
    stop_requested,
)
from beamsim.responses.loads import harmonic_loads, sine_of
from beamsim.scenario.quantities import acceleration_amplitude
from beamsim.scenario.sweep import SteppedSine
from beamsim.system.equations import Forcing
from beamsim.typing import Floats, of_kind

MOST_MEASURED_CYCLES = 240

_SteadyPoint = tuple[float, Periodicity, Exponent | None, CycleRecord]  # frequency, Hz, and its steady motion


def frequencies_of(settings: SteppedSine) -> Floats:
    """Frequencies of the steps, in increasing order."""
    if settings.spacing == "logarithmic":
        return np.geomspace(settings.from_, settings.to, settings.points)
    return np.linspace(settings.from_, settings.to, settings.points)


def steps_of(level: SweepLevel) -> list[tuple[str, float]]:
    """Direction and frequency, Hz, of every step at a level."""
    settings = of_kind(SteppedSine, level.settings)
    up, way = frequencies_of(settings).tolist(), settings.direction
    ways = {"up": up, "down": up[::-1]}
    return [(direction, f) for direction, of in ways.items() if way in (direction, "both") for f in of]


def step_level(level: SweepLevel, progress: Progress = None) -> LevelRun:
    """Step through the frequencies at one level, in all directions.

    Parameters
    ----------
    level : level of a stepped sine.
    progress : called with the completed fraction of the frequencies.

    Returns
    -------
    LevelRun
        Curves up to an interruption, or a frequency at which the motion could not be computed.
    """
    begin, outcome, steps = processor_time(), COMPLETE, steps_of(level)
    stepper, motion = stepper_of(level)
    points: dict[str, list[_SteadyPoint]] = {}
    for done, (direction, f) in enumerate(steps, 1):
        if done > 1 and stop_requested():
            outcome = interruption(f"before {f:.6g} Hz")
            break
        try:
            points.setdefault(direction, []).append((f, *steady_at(level, f, stepper, motion)))
        except ArithmeticError as error:
            outcome = Outcome.of(OutcomeKind.STOPPED, "no_steady_state", str(error), at=Where(f, "Hz"))
            break
        report_progress(progress, done / len(steps))
    curves = [_curve(level, direction, of) for direction, of in points.items() if of]
    work = {
        "truncation": 0.0, "cycles": stepper.cycles, "events": stepper.events, "evaluations": stepper.evaluations,
        "segments": stepper.segments, "states": len(stepper.flow.visited_phases),
        "processor_time_s": processor_time() - begin,
    }  # fmt: skip
    return LevelRun(tuple(curves), level_row(level, check_balance(outcome, curves), work))


def stepper_of(level: SweepLevel) -> tuple[CycleStepper, Motion]:
    """Stepper that advances a motion cycle by cycle, and the motion at its start."""
    _, first = steps_of(level)[0]
    flow = ExactFlow(level.system.dynamics, loads_at(level, first), 1.0 / first)
    return CycleStepper(flow, 1.0 / first), start(flow, level.system.initial_state)[0]


def loads_at(level: SweepLevel, frequency_hz: float) -> Forcing:
    """Loads of a level at a frequency, Hz; see `harmonic_loads`."""
    omega = 2 * np.pi * frequency_hz
    return harmonic_loads(level.system, omega, sine_of(level.system.scenario.sine, omega, level.value))


def _cycles_to_measure(settings: SteppedSine, period: int) -> int:
    """Number of measured cycles: at least `measured_cycles`, a multiple of the motion's period and of the orders."""
    repeat = period
    for order in settings.tracked_orders:
        longer = math.lcm(repeat, Fraction(order).limit_denominator(12).denominator)
        if longer <= MOST_MEASURED_CYCLES:
            repeat = longer
    return max(
        repeat, min(math.ceil(settings.measured_cycles / repeat) * repeat, MOST_MEASURED_CYCLES // repeat * repeat)
    )


def steady_at(
    level: SweepLevel, frequency_hz: float, stepper: CycleStepper, motion: Motion
) -> tuple[Periodicity, Exponent | None, CycleRecord]:
    """March to the steady motion at the next frequency; with the Lyapunov exponent if it is not periodic.

    Parameters
    ----------
    level : level of the sweep.
    frequency_hz : frequency, Hz.
    stepper, motion : state after the previous step; changed in place.

    Raises
    ------
    ArithmeticError
        If the limit of the stepper's work is exceeded.
    """
    settings, forcing = of_kind(SteppedSine, level.settings), loads_at(level, frequency_hz)
    stepper.use(stepper.flow.with_loads(forcing, 1.0 / frequency_hz), 1.0 / frequency_hz, motion)
    settled = settle(
        stepper, motion, tolerance=settings.steady_to, longest_period=settings.longest_period,
        most_cycles=settings.most_cycles,
    )  # fmt: skip
    cycles = _cycles_to_measure(settings, settled.period) if settled.period else 64  # 64 if not periodic
    exponent = None if settled.period else largest_exponent(stepper, motion, min(400, settings.most_cycles))
    measured = record_cycles(
        stepper.trajectory(motion, cycles), np.arange(cycles + 1.0) * stepper.period, level.rows(stepper.flow),
        (0.0, *settings.tracked_orders), SinePhase.constant(stepper.omega), level.searched_columns,
    )  # fmt: skip
    return settled, exponent, measured


def _curve(level: SweepLevel, direction: str, points: list[_SteadyPoint]) -> SweepCurve:
    probes, n = level.system.probes, level.system.dynamics.size
    shapes = np.array([p.shape for p in probes]).reshape(-1, n)
    frequencies, settled, exponents, measured = zip(*points, strict=True)
    frequency = np.array(frequencies)
    sections = [each.section[: 0 if each.period else None] for each in settled]
    section, count = np.concatenate(sections), np.array([each.shape[0] for each in sections])
    elapsed = np.cumsum([0.0] + [(each.cycles + m.count) / f for f, each, _, m in points])
    of_curve = np.zeros(frequency.size, dtype=np.int64)
    steady = STEADY_STATES.dataset({
        "cycle": 1 + np.arange(frequency.size),
        "curve": of_curve,
        "frequency_hz": frequency,
        "kind": ["periodic" if each is None else each.kind for each in exponents],
        "period_cycles": [each.period for each in settled],
        "cycles": [each.cycles for each in settled],
        "change": [each.change for each in settled],
        "lyapunov_exponent": [np.nan if each is None else each.value for each in exponents],
    })  # fmt: skip
    at_phase_0 = POINCARE.dataset({
        "point": 1 + np.arange(section.shape[0]),
        "curve": np.repeat(of_curve, count),
        "frequency_hz": np.repeat(frequency, count),
        "probe": [p.name for p in probes],
        "section_displacement": (section[:, :n] @ shapes.T).T,
        "section_velocity": (section[:, n : 2 * n] @ shapes.T).T,
    })  # fmt: skip
    amplitude = abs(level.value)
    values = {
        "frequency_hz": frequency, "time": elapsed[:-1],
        "excitation_amplitude": [acceleration_amplitude(amplitude, level.quantity, f) for f in frequencies],
        "energy_error": np.array([energy_errors(m.imbalance, m.energy).max() for m in measured]),
    }  # fmt: skip
    merged = CycleRecord.join([m.merge() for m in measured])
    tables = {"steady_states": steady, "poincare": at_phase_0}
    return level.curve(merged, direction, values, tables)
