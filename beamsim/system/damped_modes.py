r"""Natural frequencies and damping ratios of a structure whose contacts stay in given phases, and its dashpots.

The frequencies are those without damping. The ratios are those of the damped motion,

.. math:: \zeta = -\mathrm{Re}\,\lambda / |\lambda|,

with :math:`\lambda` the eigenvalues of the first-order equations, in which dashpots couple the undamped modes and
Maxwell branches have states of their own. Each undamped mode has the eigenvalue whose motion is most its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from beamsim.contacts.contacts import Contacts
from beamsim.contacts.laws import ContactLaw
from beamsim.outcomes import first_of
from beamsim.scenario import Located
from beamsim.scenario.base import counted
from beamsim.structures.modes import closed_modes
from beamsim.system.equations import PiecewiseLinearSystem
from beamsim.system.structural import ModeTable
from beamsim.typing import Floats, Ints

DIFFERENT = 1.3  # factor between damping ratios that are told apart
SLOW = 1e-6  # rad/s, at which Maxwell branches have relaxed


def modes_of_states(
    dynamics: PiecewiseLinearSystem, stops: Contacts, equilibrium: Floats | None, rigid: int
) -> dict[str, Any]:
    """Natural frequencies, Hz, and damping ratios of `ModeTable` with contacts open, closed, and as they are at rest.

    Parameters
    ----------
    dynamics : the structure and all its contacts.
    stops : those that are snubbers, which alone are open and closed.
    equilibrium : (n,) coordinates at rest; None where that is not known, or not linear.
    rigid : number of rigid-body coordinates.

    Returns
    -------
    By name of the field.
    """
    contacts = dynamics.contacts  # whose arrays the motion needs, too
    alone = dynamics if contacts.count == stops.count else replace(dynamics, contacts=stops)
    shut = np.array([law.closed_phase for law in stops.laws], dtype=np.int64)
    _, opened = damped_modes(alone, stops.start, rigid)
    omega, closed = damped_modes(alone, shut, rigid)
    modes: dict[str, Any] = {
        "damping_ratios": opened, "closed_frequencies_hz": omega / (2 * np.pi), "closed_damping_ratios": closed,
    }  # fmt: skip
    if equilibrium is None or contacts.jointly_acting:
        return modes
    resting = contacts.resting_phases(-contacts.gap - contacts.sign * (contacts.shape @ equilibrium))
    if np.all(contacts.dynamic_stiffness(resting, np.full(1, SLOW))[0].real >= 0.0):
        omega, ratio = damped_modes(dynamics, resting, rigid)
        modes |= {"resting_frequencies_hz": omega / (2 * np.pi), "resting_damping_ratios": ratio}
    return modes


def dashpots(located: Sequence[Located], contacts: Contacts) -> dict[str, dict[str, Any]]:
    """By snubber its dashpot, N s/m, and what that follows from, for people; the snubbers are the first contacts."""
    pairs = [(at.item, law) for at, law in zip(located, contacts.laws, strict=False)]
    return {s.name: {"dashpot_n_s_per_m": law.dashpot, "from": _dashpot_source(s, law)} for s, law in pairs}


def _dashpot_source(snubber: Any, law: ContactLaw) -> str:
    number = len(snubber.maxwell)
    beside = f", beside {counted(number, 'Maxwell branch', 'Maxwell branches')}" if number else ""
    if snubber.damping is None:
        return f"none written{beside}"
    if snubber.damping.kind == "viscous" or not law.dashpot:
        return f"as written{beside}"
    hz = snubber.damping.ratio * law.stiffness / (np.pi * law.dashpot)
    written = f"{100 * snubber.damping.ratio:.4g} % of {hz:.4g} Hz, the first natural frequency with it alone closed"
    return f"{written}{beside}"


def damping_remarks(snubbers: Sequence[Located], modes: ModeTable) -> list[str]:
    """That the first closed mode is damped otherwise than a ratio says, which is that of another mode."""
    closed = np.flatnonzero(modes.closed_frequencies_hz > 0.0)
    if not closed.size or modes.closed_damping_ratios is None:
        return []
    hz, ratio = modes.closed_frequencies_hz[closed[0]], float(modes.closed_damping_ratios[closed[0]])
    written = {s.name: s.damping.ratio for _, _, s, _ in snubbers if s.damping and s.damping.kind == "ratio"}
    other = {name: x for name, x in written.items() if x > 0.0 and not 1.0 / DIFFERENT < ratio / x < DIFFERENT}
    if not other:
        return []
    shares = ", ".join(dict.fromkeys(f"{100 * x:.3g}" for x in other.values()))
    return [
        f"snubbers: the first mode with all snubbers closed, {hz:.4g} Hz, has a damping ratio of {100 * ratio:.3g} %, "
        f"{shares} % is written for {first_of(list(other), 4)}: the dashpot 2 ratio k / Omega damps a mode by the "
        "snubber's share of its energy, and Omega is the first natural frequency with that snubber alone closed; give "
        "the dashpot in N s/m where the damping of this mode is known"
    ]


def damped_modes(dynamics: PiecewiseLinearSystem, phases: Ints, rigid: int) -> tuple[Floats, Floats]:
    """Natural frequencies and damping ratios with contacts in their phases.

    Parameters
    ----------
    dynamics : the structure and its contacts, none of which holds or is pressed by another.
    phases : (m,) of the contacts.
    rigid : number of rigid-body coordinates.

    Returns
    -------
    (n,), (n,)
        rad/s, ascending, without damping; and the ratios, nan of rigid-body modes. A mode that does not oscillate has
        that of its own coordinate alone, which is 1 or more for a single mass.
    """
    contacts, n = dynamics.contacts, dynamics.size
    slow = contacts.dynamic_stiffness(phases, np.full(1, SLOW))[0].real
    omega, shapes = closed_modes(np.sqrt(dynamics.stiffness), contacts.shape, slow, rigid)
    force, by_states = contacts.force_rows(phases)
    depth = -contacts.sign[:, None] * (contacts.shape @ shapes)
    damping = shapes.T @ dynamics.damping @ shapes + (depth.T * force[:, 1]) @ depth
    ratio = np.divide(np.diag(damping), 2.0 * omega, out=np.full(n, np.nan), where=omega > 0.0)
    if not by_states.any() and np.count_nonzero(damping) == np.count_nonzero(np.diag(damping)):
        return omega, ratio

    scale = np.maximum(omega, 1e-3 * omega.max() or 1.0)  # of displacements; a rigid mode has none
    states, drive = contacts.internal_rates(phases)
    beyond = (depth.T * (force[:, 0] - slow)) @ depth  # of branches that have not relaxed
    matrix = np.block([
        [np.zeros((n, n)), np.diag(scale), np.zeros((n, contacts.internal_states))],
        [-(np.diag(omega**2) + beyond) / scale, -damping, -depth.T @ by_states],
        [drive[:, :, 0] @ depth / scale, drive[:, :, 1] @ depth, states],
    ])  # fmt: skip
    values, vectors = np.linalg.eig(matrix)
    values, vectors = values[values.imag > 0.0], vectors[: 2 * n, values.imag > 0.0]
    share = np.abs(vectors[:n]) ** 2 + np.abs(vectors[n:]) ** 2
    share /= share.sum(axis=0)
    modes, of = share.argmax(axis=0), np.arange(share.shape[1])
    if np.unique(modes).size < modes.size:  # of two that have most of the same mode
        from scipy.optimize import linear_sum_assignment  # which takes as long to import as a validation

        modes, of = linear_sum_assignment(share, maximize=True)
    ratio[modes] = -values[of].real / np.abs(values[of])
    ratio[omega == 0.0] = np.nan
    return omega, ratio
