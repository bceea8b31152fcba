"""Frequencies of lines that are fitted together to a record that is no sum of sinusoids."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from beamsim.signals.records import SampledRecord, Window, refine_frequencies

RATE, SAMPLES = 200.0, 400
WINDOW = Window.of_name("blackmanharris")


def misfit(frequency_hz, time, record):
    """What a mean, a slope and sinusoids of the frequencies leave, times the root of the window."""
    angles = 2 * np.pi * np.multiply.outer(time, frequency_hz)
    functions = np.column_stack([np.ones(SAMPLES), time - time.mean(), np.sin(angles), np.cos(angles)])
    root = np.sqrt(WINDOW.values(np.arange(SAMPLES) / SAMPLES))
    fit = np.linalg.lstsq(functions * root[:, None], record * root, rcond=None)[0]
    return root * (record - functions @ fit)


@pytest.mark.parametrize("decay", [0.5, 1.0, 2.0, 4.0, 6.0])
def test_decaying_lines_near_each_other_have_the_frequencies_of_least_squares(decay):
    """Two decaying sinusoids four bins apart and a steady one, against SciPy's minimum of the same misfit."""
    time = np.arange(SAMPLES) / RATE
    true = np.array([10.0, 12.0, 31.0])
    record = np.exp(-decay * time) * np.sin(2 * np.pi * true[0] * time)
    record += 0.5 * np.exp(-1.3 * decay * time) * np.sin(2 * np.pi * true[1] * time + 1.0)
    record += 0.3 * np.sin(2 * np.pi * true[2] * time)
    start = true + np.array([0.05, -0.075, 0.05])
    found = refine_frequencies(SampledRecord(time, record, RATE), start, np.ones(3, dtype=bool), WINDOW)
    best = least_squares(misfit, found, "3-point", args=(time, record), xtol=1e-15, ftol=1e-15, gtol=1e-15).x
    np.testing.assert_allclose(found, best, rtol=0, atol=1e-7)  # Hz; a bin is 0.5 Hz
    assert np.abs(found - start).min() > 0.01
