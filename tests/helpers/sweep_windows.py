"""The signals that the windows of a swept sine stand for, evaluated as written."""

import numpy as np


def _place(windows, time):
    time = np.asarray(time, dtype=float)
    window = np.clip(np.searchsorted(windows.start, time, side="right") - 1, 0, windows.count - 1)
    return window, time - windows.start[window] - 0.5 * windows.length[window]


def values_at(windows, coefficient, time):
    """Values of the signal with these coefficients at times (any shape); the end windows are extended outside."""
    window, since_middle = _place(windows, time)
    value = np.zeros(since_middle.shape, dtype=complex)
    for p in range(coefficient.shape[1] - 1, -1, -1):
        value = value * since_middle + coefficient[window, p]
    return (value * np.exp(1j * windows.omega[window] * since_middle)).real


def frequency_at(windows, time):
    """Instantaneous frequency, Hz."""
    window, since_middle = _place(windows, time)
    slope = np.zeros(since_middle.shape)
    for p in range(windows.deviation.shape[1] - 1, 0, -1):
        slope = slope * since_middle + p * windows.deviation[window, p]
    return (windows.omega[window] + slope) / (2 * np.pi)
