r"""A base acceleration record with a given shock response spectrum.

The record is a sum of wavelets (D. O. Smallwood, Shock and Vibration Bulletin 44, 1974), each a few half cycles of one
frequency f under half a cycle of a sine,

.. math:: w(t) = \sin(2 \pi f t / N)\, \sin(2 \pi f t), \qquad 0 \le t \le N / (2 f), \quad N \ge 3 \text{ odd},

which end with zero velocity and displacement. There is a frequency every sixth of an octave; times and signs are
random. The amplitudes are repeatedly scaled by the ratio of the curve to the spectrum of the record, averaged over a
sixth of an octave, until the spectrum is close enough; the best of a few random arrangements is used. Spectra are peaks
of absolute accelerations, computed by the ramp-invariant filter of ISO 18431-4 during the record and after it.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np

from beamsim.inputs.measured import SAMPLES_A_CYCLE, interpolate, on_curve, target_curve
from beamsim.inputs.signal import Signal
from beamsim.scenario.excitation import MatchedInput
from beamsim.typing import Floats

PER_OCTAVE = 6  # wavelets per octave; spectra are checked between them, too
MOST_HALF_CYCLES = 15
FILLED_SHARE = 0.5  # share of the record covered by the wavelets of each frequency
ARRANGEMENTS, STEPS, GAIN = 4, 15, 0.8
TOLERANCE_DB = 1.0  # deviation from the curve at which no further arrangement is tried


def matched_signal(excitation: MatchedInput, folder: Path | None = None) -> Signal:
    """Base acceleration, m/s^2: a cubic spline of samples, zero after the record.

    Raises
    ------
    ScenarioError
        As `target_curve`.
    """
    points = zip(*target_curve(excitation, folder), strict=True)
    time, samples = _record(tuple(points), excitation.quality, excitation.duration, excitation.seed)
    return interpolate(time, samples, "cubic")


@lru_cache(maxsize=4)
def _record(
    points: tuple[tuple[float, float], ...], quality: float, duration: float, seed: int
) -> tuple[Floats, Floats]:
    """Times, s, and accelerations, m/s^2."""
    at, value = np.transpose(points)
    steps = 2 * max(int(np.ceil(PER_OCTAVE * np.log2(at[-1] / at[0]))), 1)
    frequency = np.geomspace(at[0], at[-1], steps + 1)
    target = on_curve(frequency, at, value)
    time = np.linspace(0.0, duration, int(np.ceil(SAMPLES_A_CYCLE * frequency[-1] * duration)) + 1)
    generator, best, record = np.random.default_rng(seed), np.inf, np.zeros_like(time)
    for _ in range(ARRANGEMENTS):
        wavelets = np.array([_wavelets(time, hz, generator) for hz in frequency[::2]])
        amplitude = target[::2].copy()
        for step in range(STEPS + 1):
            samples = amplitude @ wavelets
            over = np.log(_peaks(samples, time[1], frequency, quality) / target)
            if step and (worst := float(np.abs(over).max())) < best:
                best, record = worst, samples
            padded = np.pad(over, 1, mode="edge")
            amplitude *= np.exp(-(GAIN if step else 1.0) * (0.25 * (padded[:-2] + padded[2:]) + 0.5 * over)[::2])
        if 20.0 * best / np.log(10.0) <= TOLERANCE_DB:
            break
    return time, _at_rest_after(time, record)


def _wavelets(time: Floats, frequency_hz: float, generator: np.random.Generator) -> Floats:
    """(nt,) wavelets of one frequency with unit amplitude, one in each part of the record."""
    end = float(time[-1])
    half_cycles = min((int(2.0 * frequency_hz * end * (1.0 + 1e-9)) - 1) // 2 * 2 + 1, MOST_HALF_CYCLES)
    length = half_cycles / (2.0 * frequency_hz)
    count = max(round(FILLED_SHARE * end / length), 1)
    begins = (np.arange(count) + generator.uniform(size=count)) * max(end - length, 0.0) / count
    out = np.zeros_like(time)
    for begin, sign in zip(begins, generator.choice([-1.0, 1.0], count), strict=True):
        first, last = np.searchsorted(time, [begin, begin + length])
        turned = 2.0 * np.pi * frequency_hz * (time[first:last] - begin)
        out[first:last] += sign * np.sin(turned / half_cycles) * np.sin(turned)
    return out


def _peaks(samples: Floats, step: float, frequency: Floats, quality: float) -> Floats:
    """(nf,) maximax absolute acceleration of oscillators, including one free period of the slowest."""
    from scipy.signal import lfilter

    record = np.append(samples, np.zeros(int(np.ceil(1.0 / (frequency[0] * step)))))
    peaks = []
    for omega in 2.0 * np.pi * frequency:
        damping = 0.5 / quality
        turned = omega * np.sqrt(1.0 - damping**2) * step
        fading = np.exp(-damping * omega * step)
        c, s = fading * np.cos(turned), fading * np.sin(turned)
        forward = [1.0 - s / turned, 2.0 * (s / turned - c), fading**2 - s / turned]
        peaks.append(np.abs(lfilter(forward, [1.0, -2.0 * c, fading**2], record)).max())
    return np.array(peaks)


def _at_rest_after(time: Floats, samples: Floats) -> Floats:
    """Samples with the remaining velocity and displacement at the end removed (about 1e-5 of the values)."""
    turned = np.pi * time / time[-1]
    pulses = np.stack([np.sin(turned) ** 4, np.sin(turned) ** 4 * np.cos(turned), samples])
    left = []
    for pulse in pulses:
        velocity = interpolate(time, pulse, "cubic").antiderivative()
        left.append([velocity(time[-1:])[0], velocity.antiderivative()(time[-1:])[0]])
    first, second, whole = np.array(left)
    return np.asarray(samples - np.linalg.solve(np.transpose([first, second]), whole) @ pulses[:2])
