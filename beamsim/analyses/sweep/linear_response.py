"""Steady response of the structure without its snubbers, for comparison with a sweep.

.. math:: q = (K - \\omega^2 + i \\omega C)^{-1} \\Big(l_1 - \\frac{l_2}{\\omega^2}\\Big) A,

with :math:`l_1` the load of a unit of base acceleration (or of the force) and :math:`l_2` that of a unit of base
displacement on springs to ground.
"""

from __future__ import annotations

import numpy as np

from beamsim.analyses.sweep.result import ContactLevels, LinearCurve
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Bools, Complexes, Floats

POINTS = 2000


def transfer(system: StructuralSystem, frequency_hz: Floats, closed: Bools | None = None) -> Complexes:
    """(F, n) coordinates for a unit amplitude of base acceleration or force, with some contacts permanently closed."""
    dynamics = system.dynamics
    contacts, n = dynamics.contacts.split(), dynamics.size
    closed = np.zeros(contacts.count, dtype=bool) if closed is None else closed
    omega = 2 * np.pi * np.asarray(frequency_hz)
    shape, k, c = contacts.shape[closed], contacts.stiffness[closed], contacts.dashpot[closed]
    stiffness = np.diag(dynamics.stiffness) + (shape.T * k) @ shape
    damping = dynamics.damping + (shape.T * c) @ shape
    per_unit = np.repeat(system.forcing.load[:1].astype(complex), omega.size, axis=0)
    if system.base_acceleration is not None:
        base = -1.0 / omega[:, None] ** 2
        if system.forcing.load.shape[0] > 1:
            per_unit += system.forcing.load[1] * base
        grounded = contacts.on_ground[closed]
        pull = (k * grounded)[None, :] + 1j * omega[:, None] * (c * grounded)[None, :]
        per_unit -= (pull @ shape) * base
    matrix = stiffness - omega[:, None, None] ** 2 * np.eye(n) + 1j * omega[:, None, None] * damping
    try:
        return np.asarray(np.linalg.solve(matrix, per_unit[:, :, None])[:, :, 0])
    except np.linalg.LinAlgError:
        return np.full(per_unit.shape, np.nan, dtype=complex)  # one of the frequencies is an undamped resonance


def contact_levels(system: StructuralSystem, frequency_hz: Floats) -> dict[str, ContactLevels]:
    """Levels at which contact is made or lost, from the linear motion about static equilibrium."""
    contacts = system.dynamics.contacts.split()
    if system.static_equilibrium is None or contacts.count == 0:
        return {}
    penetration = -contacts.gap - contacts.sign * (contacts.shape @ system.static_equilibrium)
    closed = penetration > 0
    omega = 2 * np.pi * frequency_hz
    base = np.zeros(omega.size) if system.base_acceleration is None else -1.0 / omega**2

    def opening(which: Bools) -> Complexes:
        moved = transfer(system, frequency_hz, which) @ contacts.shape.T
        return np.asarray(moved + base[:, None] * contacts.on_ground)

    snubbers = np.arange(contacts.count) < len(system.snubbers)  # piecewise-linear springs keep their state at rest
    at_rest, shut = opening(closed), opening(closed | snubbers)
    unknown = np.full(omega.size, np.nan)
    levels = {}
    for j, snubber in enumerate(system.snubbers):
        with np.errstate(divide="ignore", invalid="ignore"):
            if closed[j]:
                # contact is lost when the penetration vanishes, not the force
                onset, loss = unknown, penetration[j] / np.abs(at_rest[:, j])
            else:
                onset, loss = -penetration[j] / np.abs(at_rest[:, j]), unknown
        needed = contacts.stiffness[j] * np.abs(shut[:, j])
        levels[snubber.name] = ContactLevels(onset, loss, needed)
    return levels


def linear_curve(system: StructuralSystem, low_hz: float, high_hz: float, logarithmic: bool) -> LinearCurve:
    """The curve between two frequencies; the resonances are among its points."""
    frequency = np.geomspace(low_hz, high_hz, POINTS) if logarithmic else np.linspace(low_hz, high_hz, POINTS)
    resonances = system.modes.open_frequencies_hz
    frequency = np.unique(np.append(frequency, resonances[(resonances > low_hz) & (resonances < high_hz)]))
    q = transfer(system, frequency)
    omega2 = (2 * np.pi * frequency) ** 2
    base = 0.0 if system.base_acceleration is None else 1.0
    displacement = {probe.name: q @ probe.shape for probe in system.probes}
    acceleration = {name: base - omega2 * w for name, w in displacement.items()}
    return LinearCurve(frequency, displacement, acceleration, contact_levels(system, frequency))
