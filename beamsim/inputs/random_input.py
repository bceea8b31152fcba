"""Random input from a table of power spectral density.

.. math:: s(t) = \\sum_k r_k \\sqrt{2 S(f_k) \\Delta f}\\, \\cos(2\\pi f_k t + \\varphi_k), \\qquad f_k = k \\Delta f,

with independent uniform phases. With fixed amplitudes, :math:`r_k = 1`, every realisation has exactly the given
density; the sum is Gaussian by the central limit theorem, but its mean square over a period is always the same. With
random ones, :math:`r_k^2` exponentially distributed with unit mean, the sum is a Gaussian process: its mean square over
a period T has the relative variance :math:`\\int S^2 df / (T (\\int S df)^2)` (S. O. Rice, Bell System Technical
Journal 23, 1944).
"""

from __future__ import annotations

import numpy as np

from beamsim.errors import Problem, ScenarioError
from beamsim.inputs.signal import Signal
from beamsim.inputs.streamed import CubicRecord, StreamedSignal
from beamsim.scenario.excitation import RandomInput
from beamsim.typing import Complexes, Floats, Ints

MOST_OF_ANY_SIZE = (
    4_000_000  # of a period; more are rounded up, as else the transform may need several times the memory
)


def density(frequency_hz: Floats, at_hz: Floats, value: Floats) -> Floats:
    """One-sided density by log-log interpolation, zero outside the table.

    Parameters
    ----------
    frequency_hz : (n,) Hz, where it is asked for.
    at_hz, value : (p,) Hz and (p,) unit^2/Hz, the table.

    Returns
    -------
    ndarray
        (n,) unit^2/Hz.
    """
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
    used = np.flatnonzero(amplitude)
    out = np.zeros(frequency.size, dtype=complex)
    out[used] = np.exp(1j * generator.uniform(0, 2 * np.pi, frequency.size)[used])
    if gaussian:
        amplitude = amplitude * np.sqrt(generator.standard_exponential(frequency.size))
    out[used] *= amplitude[used]
    return frequency, out


def noise(
    at_hz: Floats, value: Floats, period: float, rate: float, generator: np.random.Generator, gaussian: bool = False
) -> Floats:
    """Samples of one period of the noise.

    Parameters
    ----------
    at_hz, value : (p,) Hz and (p,) unit^2/Hz, its density.
    period : s.
    rate : Hz, of the samples, rounded up to a whole number of them.
    generator : of the phases.
    gaussian : whether the amplitudes are random too.

    Returns
    -------
    ndarray
        (period times rate,) unit.
    """
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
    rate = excitation.sample_rate or 20 * float(at[-1])  # samples in a cycle of the highest frequency
    total = duration if duration is not None else period
    for samples, most, remedy in (
        (period * rate, 50_000_000, "give a shorter excitation.period, after which the noise repeats"),
        (total * rate, 1_000_000_000, "shorten run.duration, or give a lower excitation.sample_rate"),
    ):
        if samples > most:
            raise ScenarioError(Problem("excitation", f"needs {samples:.3g} samples (at most {most:.0e})", remedy))
    count = int(np.ceil(period * rate))
    if count > MOST_OF_ANY_SIZE:
        from scipy.fft import next_fast_len

        count = int(next_fast_len(count, real=True))
    generator = np.random.default_rng(excitation.seed)
    frequency, amplitude = _spectrum(at, value, period, count, generator, excitation.amplitudes == "random")
    step = period / count
    pieces = int(np.ceil(total / step)) + 1
    velocity_0 = displacement_0 = 0.0
    if excitation.ramp == 0:
        used = np.flatnonzero(amplitude)
        omega = 2 * np.pi * frequency[used]
        velocity_0 = float(np.sum(amplitude[used] / (1j * omega)).real)
        displacement_0 = float(np.sum(-amplitude[used] / omega**2).real)
    del frequency
    amplitude *= 0.5 * count
    one_period = np.fft.irfft(amplitude, count)
    del amplitude

    def samples_at(index: Ints) -> Floats:
        samples = np.asarray(one_period[index % count], dtype=float)
        if excitation.ramp > 0:
            x = np.clip(index * step / excitation.ramp, 0, 1)
            samples = samples * x**2 * (3 - 2 * x)
        return samples

    record = CubicRecord(samples_at, step, pieces, (velocity_0, displacement_0))
    return StreamedSignal(record, 0), StreamedSignal(record, 1), StreamedSignal(record, 2)
