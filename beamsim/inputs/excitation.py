"""The signals of an excitation: force or base motion.

Harmonic base motions are integrated without drift: an acceleration A sin has d = -A / omega^2 sin. Pulses and steps
start from d = d' = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from beamsim.errors import Problem, ScenarioError
from beamsim.inputs.drift import Correction, jumps
from beamsim.inputs.legs import Leg, make_leg
from beamsim.inputs.profiles import make_profile, phase_of_acceleration, power_of
from beamsim.inputs.random_input import random_signals
from beamsim.inputs.sampled import sampled_signal
from beamsim.inputs.signal import MOST_PIECES, Signal
from beamsim.inputs.swept import SweepWindows, cut_into_windows, swept_signals
from beamsim.scenario import Excitation, HalfSine, Harmonic, MultiTone, Step
from beamsim.scenario.excitation import RandomInput, SampledInput, Sawtooth, SweptSineInput, Trapezoid

Driven = Harmonic | MultiTone | Step | HalfSine | Trapezoid | Sawtooth | SweptSineInput | SampledInput | RandomInput


@dataclass(frozen=True)
class BaseMotion:
    """Acceleration, velocity and displacement of the base: exact derivatives of one another."""

    acceleration: Signal  # m/s^2
    velocity: Signal  # m/s
    displacement: Signal  # m
    corrections: tuple[Correction, ...] | None = None  # of a swept sine, where its velocity would jump


def step(level: float, time: float) -> Signal:
    """0 before `time`, `level` from then on."""
    if time <= 0:
        return Signal.polynomial_pieces([0.0], [[level]])
    return Signal.polynomial_pieces([0.0, time], [[0.0], [level]])


def linear_pieces(time: float, *pieces: tuple[float, float, float]) -> Signal:
    """A pulse of (duration, value at the begin, value at the end) each, from ``time`` on; 0 before and after."""
    pieces = tuple(piece for piece in pieces if piece[0] > 0)
    before = [(time, 0.0, 0.0)] if time > 0 else []
    start = np.cumsum([0.0, *(piece[0] for piece in (*before, *pieces))])
    coefficient = [[first, (last - first) / duration] for duration, first, last in (*before, *pieces)]
    return Signal.polynomial_pieces(start, [*coefficient, [0.0, 0.0]])


def half_sine(level: float, duration: float, time: float) -> Signal:
    """``level * sin(pi (t - time) / duration)`` during the pulse, 0 outside.

    Parameters
    ----------
    level : peak, in SI units.
    duration, time : s, of the pulse, and when it begins.

    Returns
    -------
    Signal
        Of three pieces, or of two from t = 0 on.
    """
    start = np.array([0.0, time, time + duration]) if time > 0 else np.array([0.0, duration])
    coefficient = np.zeros((start.size, 1, 1), dtype=complex)
    coefficient[-2] = -1j * level
    return Signal(start, np.array([1j * np.pi / duration]), coefficient)


def sweep_windows(
    excitation: SweptSineInput, duration: float | None
) -> tuple[SweepWindows, tuple[Correction, ...] | None]:
    """The windows of a swept sine up to a duration in s, and the corrections of a base's acceleration.

    Raises
    ------
    ScenarioError
        If the sweep ends before the run, or has too many cycles.
    """
    quantity = excitation.quantity or "acceleration"
    level = 1.0 if excitation.level is None else excitation.level
    profile = make_profile(level, quantity, excitation.profile, excitation.between, excitation.notches)
    phase = excitation.phase + phase_of_acceleration(quantity, level, excitation.profile)
    leg = make_leg(excitation.from_, excitation.to, excitation.rate)
    corrections = jumps([leg], profile, phase) if excitation.on_base else None  # whatever part of the sweep is run
    if duration is not None:
        if duration > leg.duration * (1 + 1e-9):
            raise ScenarioError(
                Problem(
                    "run.duration",
                    f"= {duration:g} s is longer than the sweep, which ends at {leg.duration:g} s",
                    f"use at most {np.floor(leg.duration * 1e4) / 1e4:g} s, or a wider or slower sweep",
                )
            )
        turns = float(leg.turns_after(np.array(leg.first_hz), np.array(duration)))
        last = float(leg.frequency(np.array(min(turns + 1.0, leg.cycles))))
        leg = Leg(leg.first_hz, last, leg.rate, leg.logarithmic)
    if leg.cycles * 8 > MOST_PIECES:
        raise ScenarioError(
            Problem(
                "excitation", f"has {leg.cycles:.3g} cycles, too many for a run", "use `beamsim sweep` or a shorter run"
            )
        )
    return cut_into_windows([leg], profile, phase=phase, corrections=corrections), corrections


def level_signal(excitation: Driven, duration: float | None = None, folder: Path | None = None) -> Signal:
    """The prescribed quantity as a signal.

    Parameters
    ----------
    excitation : of the scenario.
    duration : s, of the run, which an input in time must cover; by default all of it.
    folder : of the scenario, to which the paths of files are relative.

    Returns
    -------
    Signal
        In SI units.

    Raises
    ------
    ScenarioError
        If a swept or measured input ends before the run, or its file cannot be read.
    """
    if excitation.kind == "swept_sine":
        return swept_signals(sweep_windows(excitation, duration)[0])[0]
    if excitation.kind == "random":
        return random_signals(excitation, duration)[0]
    if excitation.kind == "sampled":
        return sampled_signal(excitation, duration, folder)
    if excitation.kind == "harmonic":
        return Signal.harmonic(excitation.level, 2 * np.pi * excitation.frequency, excitation.phase)
    if excitation.kind == "multi_tone":
        tones = excitation.tones
        return Signal.harmonic(
            [tone.level for tone in tones],
            [2 * np.pi * tone.frequency for tone in tones],
            [tone.phase for tone in tones],
        )
    level = excitation.level
    if excitation.kind == "step":
        if excitation.duration is None:
            return step(level, excitation.time)
        return linear_pieces(excitation.time, (excitation.duration, level, level))
    if excitation.kind == "sawtooth":
        return linear_pieces(excitation.time, (excitation.duration, 0.0, level))
    if excitation.kind == "trapezoid":
        rise, fall = excitation.rise, excitation.fall
        flat = max(excitation.duration - rise - fall, 0.0)
        return linear_pieces(excitation.time, (rise, 0.0, level), (flat, level, level), (fall, level, 0.0))
    return half_sine(level, excitation.duration, excitation.time)


def _without_drift(signal: Signal) -> Signal:
    """Integral of a sum of harmonics with zero mean."""
    return Signal(signal.start, signal.exponent, signal.coefficient / signal.exponent[None, :, None])


def base_motion(excitation: Driven, duration: float | None = None, folder: Path | None = None) -> BaseMotion:
    """Motion of the base from the prescribed quantity.

    A step or half-sine of base displacement and a step of base velocity would need infinite accelerations; the
    scenario does not accept them.

    Parameters
    ----------
    excitation, duration, folder : see `level_signal`.

    Returns
    -------
    BaseMotion
        Harmonics have no mean; what begins in the run begins at rest.

    Raises
    ------
    ScenarioError
        As `level_signal`.
    """
    if excitation.kind == "swept_sine":
        windows, corrections = sweep_windows(excitation, duration)
        acceleration, velocity, displacement = swept_signals(windows)
        return BaseMotion(acceleration, velocity, displacement, corrections)
    if excitation.kind == "random":
        return BaseMotion(*random_signals(excitation, duration))
    given = level_signal(excitation, duration, folder)
    integral = _without_drift if excitation.kind in ("harmonic", "multi_tone") else Signal.antiderivative
    integrals = int(power_of(str(excitation.quantity)))
    motion = [given]  # acceleration, velocity and displacement
    for _ in range(integrals):
        motion.insert(0, motion[0].derivative())
    for _ in range(2 - integrals):
        motion.append(integral(motion[-1]))
    acceleration, velocity, displacement = motion
    return BaseMotion(acceleration, velocity, displacement)


def single_frequency_hz(excitation: Excitation) -> float:
    """The excitation frequency if there is exactly one, otherwise nan."""
    frequencies = set(excitation.frequencies_hz)
    return float(frequencies.pop()) if len(frequencies) == 1 else float("nan")
