r"""The energy balance of a sum of harmonics: work in = dissipated, over a period.

Galerkin's method makes the residual of the equations of motion orthogonal to every harmonic up to the highest, and so
to the velocity, which has no others: the work of all forces over a period is zero whatever the number of harmonics, if
the harmonics of the springs' forces are exact integrals. The balance therefore checks condensation, instants of
contact and convergence, but not the truncation, whose size is estimated by
:func:`beamsim.orbits.harmonic_balance.truncation`.

Work and losses are taken from the motion of the whole structure. Those of contacts are integrated in time, between
instants of contact that are sought again on that motion.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from beamsim.orbits.aft import close_intervals
from beamsim.typing import Complexes, Floats

if TYPE_CHECKING:
    from beamsim.contacts.contacts import Contacts
    from beamsim.contacts.equilibrium import CubicSprings
    from beamsim.orbits.harmonic_motion import HarmonicMotion
    from beamsim.system.equations import PiecewiseLinearSystem

NODES = 20  # of a panel
LONGEST_TURN = 15.0  # rad, of the power of a contact on a panel: the rule's error is then below 1e-12
SAMPLES_A_HARMONIC = 8  # more than 4, so that the mean over a period of a cubic spring's power is exact


def energy_error(
    system: PiecewiseLinearSystem, cubic: CubicSprings | None, motion: HarmonicMotion, base: Complexes
) -> float:
    """Imbalance over a period, over the largest stored energy, or the dissipated one if it is more.

    Parameters
    ----------
    system : the structure; its contacts are the springs of the motion.
    cubic : its cubic springs.
    motion : harmonics of coordinates, loads and the forces of springs.
    base : (H + 1,) harmonics of the base's displacement, m, which contacts and cubic springs on the ground feel.
    """
    fundamental, coordinates, load = motion.fundamental, motion.coordinates, motion.load
    H = coordinates.shape[0] - 1
    turning = 1j * fundamental * np.arange(H + 1)
    velocity, base_rate = turning[:, None] * coordinates, turning * base
    period = 2 * np.pi / fundamental
    work = 0.5 * period * float(np.sum(load.conj() * velocity).real)
    lost = 0.5 * period * float(np.sum(velocity.conj() * (velocity @ system.damping)).real)

    angle = np.linspace(0.0, 2 * np.pi, SAMPLES_A_HARMONIC * (H + 1), endpoint=False)
    stored = 0.5 * (_values(velocity, angle) ** 2).sum(axis=1)
    stored += 0.5 * _values(coordinates, angle) ** 2 @ system.stiffness
    contacts = system.contacts
    for j in range(contacts.count):
        delta = _penetration(contacts, j, coordinates, base)
        pushed, rubbed = _of_contact(contacts, j, delta, turning * delta, base_rate)
        work, lost = work + pushed / fundamental, lost + rubbed / fundamental
        stored += 0.5 * contacts.stiffness[j] * np.maximum(_values(delta, angle), 0.0) ** 2
    if cubic is not None and cubic.count:
        stretch = _values(coordinates, angle) @ cubic.shape.T + np.multiply.outer(_values(base, angle), cubic.felt)
        stored += 0.25 * stretch**4 @ cubic.stiffness
        pull = stretch**3 @ (cubic.stiffness * cubic.felt)
        work += period * float(np.mean(pull * _values(base_rate, angle)))
    scale = max(float(stored.max()), abs(lost))
    return abs(work - lost) / scale if scale > 0.0 else 0.0


def _values(harmonics: Complexes, angle: Floats) -> Floats:
    """(nt, …) the sum of harmonics (H + 1, …) at angles (nt,)."""
    return np.asarray((np.exp(1j * np.multiply.outer(angle, np.arange(harmonics.shape[0]))) @ harmonics).real)


def _penetration(contacts: Contacts, j: int, coordinates: Complexes, base: Complexes) -> Complexes:
    """(H + 1,) harmonics of a contact's penetration."""
    delta = -contacts.sign[j] * (coordinates @ contacts.shape[j] + contacts.felt[j] * base)
    delta[0] = delta[0].real - contacts.gap[j]
    return np.asarray(delta)


def _of_contact(
    contacts: Contacts, j: int, delta: Complexes, rate: Complexes, base_rate: Complexes
) -> tuple[float, float]:
    """What the moving ground puts in through a contact, and what its dashpot dissipates: integrals over the angle."""
    node, weight = _rule()
    pushed = rubbed = 0.0
    for begin, end in close_intervals(delta):
        panels = max(int(np.ceil((end - begin) * 2 * delta.size / LONGEST_TURN)), 1)
        half = 0.5 * (end - begin) / panels
        angle = (begin + half * (2 * np.arange(panels)[:, None] + 1 + node)).ravel()
        share = np.tile(half * weight, panels)
        speed = _values(rate, angle)
        rubbed += contacts.dashpot[j] * float(share @ speed**2)
        if contacts.felt[j]:
            force = contacts.stiffness[j] * _values(delta, angle) + contacts.dashpot[j] * speed
            pushed -= contacts.sign[j] * contacts.felt[j] * float(share @ (force * _values(base_rate, angle)))
    return pushed, rubbed


@cache
def _rule() -> tuple[Floats, Floats]:
    """Nodes and weights on (-1, 1)."""
    return np.polynomial.legendre.leggauss(NODES)
