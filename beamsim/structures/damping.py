"""Damping of the open structure in reduced coordinates; the same in every contact state."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.scenario import ModalDamping, RayleighDamping, ViscousDamping
    from beamsim.structures.basis import ReducedBasis
    from beamsim.structures.structure import Structure


def damping_matrix(
    damping: ModalDamping | RayleighDamping | ViscousDamping | None,
    structure: Structure,
    basis: ReducedBasis,
    omega: Floats,
) -> Floats:
    """(n, n) symmetric C, 1/s, of one open body.

    Parameters
    ----------
    damping : of the body, from the scenario.
    structure, basis : the full model (dashpots and viscous damping) and the reduced basis.
    omega : (n,) physical angular frequencies of the coordinates, rad/s.

    Notes
    -----
    Modal: C = diag(2 xi_i omega_i). Ratio i of a list belongs to mode i as numbered in every table, counting rigid-body
    modes (which are not damped); higher modes and static vectors have the last ratio. Rayleigh:
    alpha I + beta diag(omega^2). Viscous damping and dashpots: projection of the physical matrix.
    """
    c = np.zeros((omega.size, omega.size))
    if damping is not None and damping.kind == "modal":
        given = np.atleast_1d(np.asarray(damping.ratio, dtype=float))
        ratio = np.full(omega.size, given[-1])
        count = min(given.size, basis.modes)
        ratio[:count] = given[:count]
        c += np.diag(2 * ratio * omega)
    elif damping is not None and damping.kind == "rayleigh":
        c += np.diag(damping.mass + damping.stiffness * omega**2)
    if structure.damping is not None:
        projected = basis.vectors.T @ (structure.damping @ basis.vectors) / structure.mass_scale
        c += (projected + projected.T) / 2
    return c


def damping_ratios(c: Floats, omega: Floats) -> Floats:
    """(n,) ratios C_ii / (2 omega_i); nan for rigid-body modes."""
    flexible = omega > 0
    ratio = np.full(omega.size, np.nan)
    ratio[flexible] = np.diag(c)[flexible] / (2 * omega[flexible])
    return ratio
