"""Records that do not repeat: peaks, scale, correlation and response spectra of a prediction and a measurement."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from beamsim.analyses.compare.result import RecordComparison
from beamsim.analyses.run.filters import PANELS_OF_OSCILLATOR, SAMPLES_OF_OSCILLATOR, geomspaced, shock_spectra
from beamsim.scenario.run import ShockSpectrumSettings
from beamsim.typing import Floats

PARTS = 10  # of a record, left out one by one for the standard error of the scale
MOST_PANELS = 100_000  # of an oscillator, which takes seconds: longer records have spectra up to a lower frequency


def compare_records(
    unit: str, predicted: tuple[Floats, Floats], measured: tuple[Floats, Floats], settings: ShockSpectrumSettings | None
) -> RecordComparison | None:
    """What two aligned records have in common while both last.

    Parameters
    ----------
    unit : of both.
    predicted, measured : times (nt,), s, and values.
    settings : range and quality of the oscillators; by default Q = 10 and six an octave over what the records resolve.

    Returns
    -------
    RecordComparison
        None where they overlap in less than twice as many samples as there are parts, or one is zero there.
    """
    begin, end = max(predicted[0][0], measured[0][0]), min(predicted[0][-1], measured[0][-1])
    inside = (measured[0] >= begin) & (measured[0] <= end)
    if np.count_nonzero(inside) < 2 * PARTS:
        return None
    time, y = measured[0][inside], measured[1][inside]
    begin, end = float(time[0]), float(time[-1])
    both = CubicSpline(*predicted), CubicSpline(*measured)
    own = predicted[1][(predicted[0] >= begin) & (predicted[0] <= end)]
    x = both[0](time)
    if not (np.any(own) and np.any(y)):
        return None
    first = np.linspace(0, time.size, PARTS, endpoint=False).astype(int)
    across, power, of_measured = (np.add.reduceat(product, first) for product in (x * y, x * x, y * y))
    without = (power.sum() - power) / (across.sum() - across)
    slowest = max(float(np.diff(t).max()) for t, _ in (predicted, measured))
    highest = min(1 / (SAMPLES_OF_OSCILLATOR * slowest), MOST_PANELS / (PANELS_OF_OSCILLATOR * (end - begin)))
    lowest, quality, per_octave = 2.0 / (end - begin), 10.0, 6
    if settings is not None:
        lowest, quality, per_octave = settings.from_, settings.quality, settings.per_octave
        highest = min(highest, settings.to)
    frequency = geomspaced(min(lowest, 0.5 * highest), highest, per_octave)
    ends, values = np.array([begin, end]), lambda at: np.column_stack([spline(at) for spline in both])
    spectra = shock_spectra(frequency, quality, ends, values, 0.0).max(axis=1)
    scale, scatter = power.sum() / across.sum(), np.sqrt((PARTS - 1) * np.mean((without - without.mean()) ** 2))
    correlation = across.sum() / np.sqrt(power.sum() * of_measured.sum())
    return RecordComparison(
        unit, float(np.abs(own).max()), float(np.abs(y).max()), float(scale), float(scatter), float(correlation),
        quality, frequency, spectra[0], spectra[1],
    )  # fmt: skip
