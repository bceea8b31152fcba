r"""What a finite sweep rate does to the resonance of a linear oscillator: it is displaced, lowered and widened.

With the detuning :math:`x = 2 Q (f - f_n) / f_n` and the time in units of :math:`Q / (\pi f_n)` the slowly varying
amplitude of an oscillator under a sine of constant level follows

.. math:: A' = -(1 + i x) A + 1, \quad x' = s = \frac{2}{\pi} \frac{\dot f Q^2}{f_n^2},

whose solution is a Faddeeva function. All that a sweep does depends on s alone (F. M. Lewis, "Vibration during
acceleration through a critical speed", Transactions of the ASME 54, 1932; J. A. Lollock, "The effect of swept
sinusoidal excitation on the response of a single-degree-of-freedom oscillator", AIAA 2002-1230).
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from beamsim.typing import Floats

SLOWEST, FASTEST_KNOWN = 1e-4, 5.0
"""Sweep rate times the squared Q over the squared frequency: below it the sweep has no effect. Above it the effect does
not follow from the peak: its band widens with the square root of the rate, so that the number formed with it stays."""


class SweepEffect(NamedTuple):
    """What a sweep does to a peak: the ratio of the swept value to that of a steady sine."""

    frequency: float
    amplitude: float
    damping: float


FRESNEL_MAXIMUM = 1.217
"""Argument at which the distance of a Cornu spiral from its beginning is largest: the amplitude without damping."""
NARROWEST = 1.4
"""Sweep rate over the squared half-power bandwidth that no oscillator exceeds: without damping it is 1.3."""
NO_EFFECT = SweepEffect(1.0, 1.0, 1.0)


def sweep_effect(frequency_hz: float, quality: float, rate: float) -> SweepEffect:
    """What a sweep does to a peak that was measured in it.

    Parameters
    ----------
    frequency_hz : Hz, of the peak in the sweep.
    quality : frequency over the half-power bandwidth of the peak in the sweep; nan if that is not known.
    rate : Hz/s, sweep rate at the peak, negative of a falling frequency.

    Returns
    -------
    SweepEffect
        Its values are nan if the quality is not known, or the sweep is so fast that it cannot be derived from the peak.

    >>> effect = sweep_effect(50.0, 48.0, 0.3)  # 0.3 Hz/s
    >>> print(f"{effect.frequency:.5f} {effect.amplitude:.4f} {effect.damping:.4f}")
    1.00342 0.9876 1.0392
    """
    known = _known_effects()
    measured = abs(rate) * quality**2 / frequency_hz**2
    if measured < SLOWEST:
        return NO_EFFECT
    if not measured <= known[1][-1]:
        return SweepEffect(np.nan, np.nan, np.nan)
    displaced, amplitude, width = (np.interp(np.log(measured), np.log(known[1]), each) for each in known[2:])
    shift = np.sign(rate) * displaced / (2.0 * quality * width)  # of a frequency, by the Q of the damping
    return SweepEffect(float(1.0 + shift), float(amplitude), float(width))


def largest_displacement(rate: float) -> float:
    """Largest displacement of a resonance by a sweep, Hz, whatever its damping; that without any damping.

    Parameters
    ----------
    rate : Hz/s, of either sign, which is that of the displacement.

    >>> print(f"{largest_displacement(4.0):.2f} Hz")
    1.72 Hz
    """
    return float(np.sign(rate) * FRESNEL_MAXIMUM * np.sqrt(0.5 * abs(rate)))


def is_too_narrow(frequency_hz: float, quality: float, rate: float) -> bool:
    """Whether a peak in a sweep is narrower than that of any oscillator, so that it is a beat.

    Parameters
    ----------
    frequency_hz, quality : Hz, and over the half-power bandwidth; nan if that is not known.
    rate : Hz/s.

    >>> is_too_narrow(38.0, 175.0, 2.6), is_too_narrow(38.0, 20.0, 2.6)
    (True, False)
    """
    return bool(abs(rate) * quality**2 > NARROWEST * frequency_hz**2)


RIPPLE = 0.08  # least ratio of two vibrations whose beats are peaks: 1.17 times as high as their lowest values
MOST_BEATS, BEAT_TOLERANCE = 30, 0.25  # beats that are recognised by their distance, in their order


def is_beat(frequency_hz: float, peak_hz: float, quality: float, rate: float) -> bool:
    """Whether a lower peak may be a beat of the excitation with the free vibration that a higher one left behind.

    The free vibration of a resonance that was passed has the amplitude :math:`\\sqrt{2 \\pi / s}\\, e^{-x/s}` and the
    forced one :math:`1 / x`. Without damping the beats are largest at :math:`\\sqrt{(4 k + 3/2) \\dot f / 2}`.

    Parameters
    ----------
    frequency_hz : Hz, of the lower peak.
    peak_hz, quality : of the higher one in the sweep; its quality is nan if it is not known.
    rate : Hz/s, sweep rate there, negative of a falling frequency.

    Returns
    -------
    bool
        False of what the sweep met before the higher peak.

    >>> is_beat(52.5, 50.8, 31.0, 2.3), is_beat(60.0, 50.8, 31.0, 2.3), is_beat(48.0, 50.8, 31.0, 2.3)
    (True, False, False)
    """
    if (frequency_hz - peak_hz) * rate <= 0.0:
        return False
    effect = sweep_effect(peak_hz, quality, rate)
    if np.isnan(effect.damping):
        distance = abs(frequency_hz - peak_hz + largest_displacement(rate))
        order = 0.25 * (2.0 * distance**2 / abs(rate) - 1.5)
        return bool(0.5 < order < MOST_BEATS and abs(order - round(order)) < BEAT_TOLERANCE)
    natural, quality = peak_hz / effect.frequency, quality * effect.damping
    slope = 2.0 / np.pi * abs(rate) * quality**2 / natural**2
    x = 2.0 * quality * abs(frequency_hz - natural) / natural
    free_over_forced = x * np.sqrt(2.0 * np.pi / slope) * np.exp(-x / slope) if slope > 0.0 else 0.0
    return bool(free_over_forced > RIPPLE)


@cache
def _known_effects() -> tuple[Floats, ...]:
    """For rates (n,): the rate with the Q of the damping and of the peak, displacement, relative height and width."""
    rates = np.geomspace(SLOWEST, FASTEST_KNOWN, 200)
    found = np.array([_peak_of_sweep(float(rate)) for rate in rates]).T
    return rates, rates / found[2] ** 2, *found


def _peak_of_sweep(rate: float) -> tuple[float, float, float]:
    """Displacement of the peak in halves of the bandwidth, its height and width over those of a steady sine.

    Parameters
    ----------
    rate : sweep rate times the squared Q over the squared frequency.
    """
    from scipy.special import wofz

    slope = 2.0 / np.pi * rate
    x = np.linspace(-3.0, 3.0 + 6.0 * np.sqrt(slope), 4001)  # the peak lags by less
    root = np.sqrt(-0.5j * slope)
    with np.errstate(over="ignore", invalid="ignore"):
        size = np.abs(0.5 * np.sqrt(np.pi) / root * wofz(0.5j * (1.0 + 1j * x) / root))
    top = int(np.argmax(size))
    a, b, c = np.polyfit(x[top - 1 : top + 2] - x[top], size[top - 1 : top + 2], 2)
    height = float(c - b * b / (4.0 * a))
    half = height / np.sqrt(2.0)
    after = top + int(np.argmax(size[top:] < half))
    before = top - int(np.argmax(size[top::-1] < half))
    upper = np.interp(-half, -size[after - 1 : after + 1], x[after - 1 : after + 1])
    lower = np.interp(half, size[before : before + 2], x[before : before + 2])
    return float(x[top] - b / (2.0 * a)), height, float(0.5 * (upper - lower))
