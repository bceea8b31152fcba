"""Steady response of the structure without its snubbers, for comparison with a sweep."""

from __future__ import annotations

import numpy as np

from beamsim.analyses.gapping import contact_levels, transfer
from beamsim.analyses.sweep.result import LinearCurve
from beamsim.system.structural import StructuralSystem

POINTS = 2000


def linear_curve(system: StructuralSystem, low_hz: float, high_hz: float, logarithmic: bool) -> LinearCurve:
    """The curve between two frequencies; the resonances are among its points."""
    frequency = np.geomspace(low_hz, high_hz, POINTS) if logarithmic else np.linspace(low_hz, high_hz, POINTS)
    resonances = system.modes.open_frequencies_hz
    frequency = np.unique(np.append(frequency, resonances[(resonances > low_hz) & (resonances < high_hz)]))
    q = transfer(system, frequency)
    omega2 = (2 * np.pi * frequency) ** 2
    displacement = {probe.name: q @ probe.shape for probe in system.probes}
    acceleration = {
        name: carried - omega2 * w for carried, (name, w) in zip(system.carried, displacement.items(), strict=True)
    }
    return LinearCurve(frequency, displacement, acceleration, contact_levels(system, frequency))
