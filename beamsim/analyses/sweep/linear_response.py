"""Steady response of the structure without its snubbers, for comparison with a sweep.

.. math:: q = (K - \\omega^2 + i \\omega C)^{-1} \\Big(l_1 - \\frac{l_2}{\\omega^2}\\Big) A,

with :math:`l_1` the load of a unit of base acceleration (or of the force) and :math:`l_2` that of a unit of base
displacement on springs to ground.
"""

from __future__ import annotations

import numpy as np

from beamsim.analyses.sweep.result import ContactLevels, LinearCurve
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Complexes, Floats, Ints

POINTS = 2000
SLIGHT = 1e-9  # penetration, of the gap or m, at which a contact has just been made


def transfer(system: StructuralSystem, frequency_hz: Floats, phases: Ints | None = None) -> Complexes:
    """(F, n) coordinates for a unit amplitude of base acceleration or force, all contacts staying in phases (m,).

    By default no contact acts.
    """
    dynamics = system.dynamics
    contacts, n = dynamics.contacts, dynamics.size
    omega = 2 * np.pi * np.asarray(frequency_hz)
    shape = contacts.shape
    pushed = contacts.dynamic_stiffness(contacts.start if phases is None else phases, omega)
    inertia = np.diag(dynamics.stiffness) - omega[:, None, None] ** 2 * np.eye(n)
    matrix = inertia + 1j * omega[:, None, None] * dynamics.damping + (shape.T * pushed[:, None, :]) @ shape
    per_unit = np.repeat(system.forcing.load[:1].astype(complex), omega.size, axis=0)
    if system.base_acceleration is not None:
        base = -1.0 / omega[:, None] ** 2
        if system.forcing.load.shape[0] > 1:
            per_unit += system.forcing.load[1] * base
        per_unit -= ((pushed * contacts.on_ground) @ shape) * base
    try:
        return np.asarray(np.linalg.solve(matrix, per_unit[:, :, None])[:, :, 0])
    except np.linalg.LinAlgError:
        return np.full(per_unit.shape, np.nan, dtype=complex)  # one of the frequencies is an undamped resonance


def contact_levels(system: StructuralSystem, frequency_hz: Floats) -> dict[str, ContactLevels]:
    """Levels at which contact is made or lost, from the linear motion about static equilibrium."""
    contacts = system.dynamics.contacts
    if system.static_equilibrium is None or contacts.count == 0:
        return {}
    penetration = -contacts.gap - contacts.sign * (contacts.shape @ system.static_equilibrium)
    closed = penetration > 0
    omega = 2 * np.pi * frequency_hz
    base = np.zeros(omega.size) if system.base_acceleration is None else -1.0 / omega**2

    def opening(phases: Ints) -> Complexes:
        moved = transfer(system, frequency_hz, phases) @ contacts.shape.T
        return np.asarray(moved + base[:, None] * contacts.on_ground)

    resting = contacts.resting_phases(penetration)
    pressed = resting.copy()  # piecewise-linear springs keep their phase at rest
    for j in range(len(system.snubbers)):
        if not closed[j]:
            pressed[j] = contacts.laws[j].resting_phase(SLIGHT * abs(penetration[j]) or SLIGHT)
    at_rest, shut = opening(resting), opening(pressed)
    unknown = np.full(omega.size, np.nan)
    levels = {}
    for j, snubber in enumerate(system.snubbers):
        with np.errstate(divide="ignore", invalid="ignore"):
            if closed[j]:
                # contact is lost when the penetration vanishes, not the force
                onset, loss = unknown, penetration[j] / np.abs(at_rest[:, j])
            else:
                onset, loss = -penetration[j] / np.abs(at_rest[:, j]), unknown
        levels[snubber.name] = ContactLevels(onset, loss, contacts.laws[j].static_force(np.abs(shut[:, j])))
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
