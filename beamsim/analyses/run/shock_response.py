r"""Shock response spectra: peaks of the absolute acceleration of oscillators on a base that moves as a signal does.

An oscillator of natural frequency :math:`\omega` and damping ratio :math:`\zeta = 1 / (2 Q)` is the linear filter
:math:`H(s) = (2 \zeta \omega s + \omega^2) / (s^2 + 2 \zeta \omega s + \omega^2)` (ISO 18431-4). It is led through
the signal in closed form but for a quadrature that is exact to 1e-10, so there is no sample rate to choose. After the
end of the record the oscillator moves freely, and its peaks follow from its state there.

The record of the base's motion ends with its pulse, if it is one, and that of a response with the run.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.interpolate import CubicSpline

from beamsim.analyses.run.filters import LONGEST_TURN, LinearFilter, Signal, panels
from beamsim.analyses.run.result import MAIN_QUANTITY, ShockResponse, ShockSpectrum
from beamsim.analyses.values import ACCELERATION
from beamsim.flow.channels import Observed
from beamsim.flow.trajectory import Trajectory
from beamsim.inputs.signal import Signal as Pieces
from beamsim.scenario.run import ShockSpectrumSettings
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Complexes, Floats

PANELS_A_PERIOD = 16  # of the highest oscillator; peaks between panels are then right to 1e-4
SAMPLES_A_PERIOD = 10  # of the highest oscillator, of a time-stepped motion


def frequencies_of(settings: ShockSpectrumSettings) -> Floats:
    """(nf,) Hz, equally spaced in the logarithm from the lowest to the highest, which both belong to them."""
    steps = max(round(settings.per_octave * np.log2(settings.to / settings.from_)), 1)
    return np.geomspace(settings.from_, settings.to, steps + 1)


def shock_spectra(settings: ShockSpectrumSettings, times: Floats, signal: Signal, fastest: float) -> Floats:
    """(k, 4, nf) positive and negative peaks during the record and after it, of k signals, in their unit.

    Parameters
    ----------
    times : increasing, s, from the begin of the record to its end; the signal is smooth between two of them.
    signal : times (nt,) -> (nt, k); zero before the record and after it.
    fastest : rad/s, of the signal's motion.
    """
    frequency = frequencies_of(settings)
    longest = min(LONGEST_TURN / fastest if fastest > 0 else np.inf, 1.0 / (PANELS_A_PERIOD * frequency[-1]))
    count = signal(times[:1]).shape[1]
    oscillators = [LinearFilter(*_oscillator(hz, settings.quality), count) for hz in frequency]
    blocks, _ = panels(times, signal, longest)
    for block in blocks:
        for oscillator in oscillators:
            oscillator.through(block)
    peaks = np.empty((count, 4, frequency.size))
    for i, oscillator in enumerate(oscillators):
        low, _, high, _ = oscillator.extremes
        after_low, after_high = _free_peaks(oscillator.poles[0], oscillator.residues[0] * oscillator.state[0])
        peaks[:, :, i] = np.column_stack([high, -low, after_high, -after_low])
    return peaks


def shock_response(
    settings: ShockSpectrumSettings, system: StructuralSystem, motion: Trajectory | tuple[Floats, Floats]
) -> ShockResponse:
    """Spectra of the base's acceleration, where it moves, and of the absolute acceleration of every probe.

    Parameters
    ----------
    motion : in closed form; or output times (nt,) and accelerations (nt, probes), which a cubic spline joins.
    """
    names, peaks = [(probe.name, MAIN_QUANTITY) for probe in system.probes], []
    if isinstance(motion, Trajectory):
        times, fastest = np.append(motion.time, motion.end), motion.flow.largest_exponent
        accelerations = Observed(motion.flow, system.channels.of_keys(ACCELERATION)).linear
        responses: Signal = lambda at: motion.sample(at, accelerations)  # noqa: E731
    else:
        times, fastest = motion[0], 0.0
        responses = CubicSpline(*motion)
    times = np.unique(times)
    if (base := system.base_acceleration) is not None:
        end = _end(base, float(times[-1]))
        until = np.append(times[times < end], end)
        names.insert(0, ("input", "acceleration"))
        peaks.append(shock_spectra(settings, until, lambda at: base(at)[:, None], fastest))
    peaks.append(shock_spectra(settings, times, responses, fastest))
    spectra = tuple(_spectrum(*of, *signal) for of, signal in zip(names, np.concatenate(peaks), strict=True))
    return ShockResponse(settings.quality, frequencies_of(settings), spectra)


def _spectrum(
    name: str, quantity: str, high: Floats, low: Floats, after_high: Floats, after_low: Floats
) -> ShockSpectrum:
    """From the positive and negative peaks during the record and after it."""
    primary, residual = np.maximum(high, low), np.maximum(after_high, after_low)
    return ShockSpectrum(
        name=name, quantity=quantity, maximax=np.maximum(primary, residual), primary=primary, residual=residual,
        positive=np.maximum(high, after_high), negative=np.maximum(low, after_low),
    )  # fmt: skip


def _end(signal: Callable[[Floats], Floats], end: float) -> float:
    """When the record of the base's motion ends: with its pulse, at the latest with the run."""
    if isinstance(signal, Pieces) and not signal.coefficient[-1].any() and signal.start[-1] > 0.0:
        return min(float(signal.start[-1]), end)
    return end


def _oscillator(frequency_hz: float, quality: float) -> tuple[Complexes, Complexes]:
    """Pole with a positive imaginary part, rad/s, and its residue."""
    omega, damping = 2 * np.pi * frequency_hz, 0.5 / quality
    pole = omega * (-damping + 1j * np.sqrt(1.0 - damping**2))
    return np.array([pole]), np.array([(2 * damping * omega * pole + omega**2) / (2j * pole.imag)])


def _free_peaks(pole: complex, state: Complexes) -> tuple[Floats, Floats]:
    """Lowest and highest value of ``2 Re(state exp(pole t))`` for t >= 0, not above and not below zero."""
    # the slope vanishes where pole * state * exp(pole t) is imaginary
    first = np.mod(0.5 * np.pi - np.angle(state) - np.angle(pole), np.pi) / pole.imag
    times = (np.zeros_like(first), first, first + np.pi / pole.imag)
    values = np.stack([2 * (state * np.exp(pole * t)).real for t in times])
    return np.minimum(values.min(axis=0), 0.0), np.maximum(values.max(axis=0), 0.0)
