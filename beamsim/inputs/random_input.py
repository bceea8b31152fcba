"""Random input from a table of power spectral density.

.. math:: s(t) = \\sum_k r_k \\sqrt{2 S(f_k) \\Delta f}\\, \\cos(2\\pi f_k t + \\varphi_k), \\qquad f_k = k \\Delta f,

with independent uniform phases. With fixed amplitudes, :math:`r_k = 1`, every realisation has exactly the given
density; the sum is Gaussian by the central limit theorem, but its mean square over a period is always the same. With
random ones, :math:`r_k^2` exponentially distributed with unit mean, the sum is a Gaussian process: its mean square over
a period T has the relative variance :math:`\\int S^2 df / (T (\\int S df)^2)` (S. O. Rice, Bell System Technical
Journal 23, 1944).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from beamsim.errors import Problem, ScenarioError
from beamsim.inputs.sampled import MOST_SAMPLES, interpolate
from beamsim.inputs.signal import Signal
from beamsim.typing import Complexes, Floats

if TYPE_CHECKING:
    from beamsim.scenario.broadband import RandomInput

SAMPLES_PER_CYCLE = 20  # of the highest frequency
MARGIN = 32  # samples before and after the run: what a spline takes of its ends falls by 2 - sqrt(3) with each sample


def density(frequency_hz: Floats, at_hz: Floats, value: Floats) -> Floats:
    """One-sided density at frequencies by log-log interpolation, zero outside the table."""
    inside = (frequency_hz >= at_hz[0] * (1 - 1e-12)) & (frequency_hz <= at_hz[-1] * (1 + 1e-12))
    out = np.zeros(frequency_hz.shape)
    f = np.clip(frequency_hz[inside], at_hz[0], at_hz[-1])
    k = np.clip(np.searchsorted(at_hz, f, side="right") - 1, 0, at_hz.size - 2)
    a, b = value[k], value[k + 1]
    share = np.log(f / at_hz[k]) / np.log(at_hz[k + 1] / at_hz[k])
    with np.errstate(divide="ignore", invalid="ignore"):
        logarithmic = np.exp((1 - share) * np.log(a) + share * np.log(b))
    out[inside] = np.where((a > 0) & (b > 0), logarithmic, np.where(share == 0, a, 0.0))
    return out


def _spectrum(
    at_hz: Floats, value: Floats, period: float, count: int, generator: np.random.Generator, gaussian: bool
) -> tuple[Floats, Complexes]:
    """Frequencies (Hz) and complex amplitudes of the sines."""
    frequency = np.arange(count // 2 + 1) / period
    amplitude = np.sqrt(2 * density(frequency, at_hz, value) / period)
    phase = generator.uniform(0, 2 * np.pi, frequency.size)
    if gaussian:
        amplitude = amplitude * np.sqrt(generator.standard_exponential(frequency.size))
    return frequency, amplitude * np.exp(1j * phase)


def noise(
    at_hz: Floats, value: Floats, period: float, rate: float, generator: np.random.Generator, gaussian: bool = False
) -> Floats:
    """Samples of one period, at ``rate`` (rounded up to a whole number of samples); amplitudes fixed or Gaussian."""
    count = int(np.ceil(period * rate))
    _, amplitude = _spectrum(at_hz, value, period, count, generator, gaussian)
    return np.asarray(np.fft.irfft(0.5 * count * amplitude, count))


def random_signals(excitation: RandomInput, duration: float | None) -> tuple[Signal, Signal, Signal]:
    """The noise as a smooth piecewise cubic over the run, and its integrals; it does not depend on where the run ends.

    The integrals start at the values of the integrated sines, so that a base does not drift, or at 0 with a ramp.
    """
    at = np.array([p.frequency for p in excitation.psd])
    value = np.array([p.density for p in excitation.psd])
    period = excitation.period or duration or 1.0
    rate = excitation.sample_rate or SAMPLES_PER_CYCLE * float(at[-1])
    total = duration if duration is not None else period
    if max(period, total) * rate > MOST_SAMPLES:
        raise ScenarioError(
            Problem(
                "excitation",
                f"needs {max(period, total) * rate:.3g} samples (at most {MOST_SAMPLES:.0e})",
                "shorten run.duration, or give excitation.period or a lower excitation.sample_rate",
            )
        )
    count = int(np.ceil(period * rate))
    generator = np.random.default_rng(excitation.seed)
    frequency, amplitude = _spectrum(at, value, period, count, generator, excitation.amplitudes == "random")
    one_period = np.fft.irfft(0.5 * count * amplitude, count)
    step = period / count
    pieces = int(np.ceil(total / step)) + 1
    index = np.arange(-MARGIN, pieces + MARGIN)
    time, samples = np.asarray(index * step, dtype=float), np.asarray(one_period[index % count], dtype=float)
    velocity_0 = displacement_0 = 0.0
    if excitation.ramp > 0:
        x = np.clip(time / excitation.ramp, 0, 1)
        samples = samples * x**2 * (3 - 2 * x)
    else:
        omega = 2 * np.pi * frequency[1:]
        velocity_0 = float(np.sum(amplitude[1:] / (1j * omega)).real)
        displacement_0 = float(np.sum(-amplitude[1:] / omega**2).real)
    wider, within = interpolate(time, samples, "cubic"), slice(MARGIN, MARGIN + pieces)
    signal = Signal(wider.start[within], wider.exponent, wider.coefficient[within])
    velocity = signal.antiderivative(velocity_0)
    return signal, velocity, velocity.antiderivative(displacement_0)
