"""Damping of the open structure in reduced coordinates; the same in every contact state."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse.linalg import eigsh

from beamsim.structures.structure import ReducedBasis, Structure
from beamsim.structures.symmetric_lu import negative_eigenvalues
from beamsim.typing import Floats


@dataclass(frozen=True)
class StatedDamping:
    """Damping of a full model: a matrix, and ratios of modes that are known by their bounds (scaled units)."""

    known: Any  # (N, N) sparse, dashpots, viscous and Rayleigh damping; None without
    lowest: float  # modal ratio of the modes that a reduction leaves out: bounds
    highest: float
    on_coordinates: bool  # modal damping is defined for the reduced coordinates alone (composite modal damping)

    def share_of(self, model: Structure, omega: float) -> float:
        """A number c with C <= c K for the known damping C in all motion of frequencies beyond ``omega``, scaled.

        Certified by a Sturm count; nan where round-off leaves that open.
        """
        norm = (model.factor.T @ model.factor + omega**2 * model.mass).tocsc()
        start = np.linspace(1.0, 2.0, model.size)
        share = 1.01 * float(eigsh(self.known.tocsc(), k=1, M=norm, which="LA", v0=start, tol=1e-3)[0][0])
        for _ in range(6):
            if share <= 0 or negative_eigenvalues(share * norm - self.known) == 0:
                return 2 * max(share, 0.0)  # K + omega^2 M <= 2 K in that motion
            share *= 2
        return np.nan


def stated_damping(model: Structure, basis: ReducedBasis) -> StatedDamping:
    """What damps the full model, of which a basis keeps ``basis.modes`` modes."""
    frequency = model.frequency_scale
    known: Any = None if model.damping is None else model.damping / (model.mass_scale * frequency)
    ratios = []
    for member in model.members:
        stated = member.body.stated_damping
        ratios.append(_modal_ratios(stated, model.size, model.size))
        if stated is not None and stated.kind == "rayleigh":
            mass, stiffness = member.body.mass * member.mass_ratio, member.body.factor.T @ member.body.factor
            of_mass, of_stiffness = stated.factors
            matrix = mass * (of_mass / frequency) + stiffness * (member.stiffness_ratio * of_stiffness * frequency)
            matrix = member.expansion.T @ matrix @ member.expansion
            known = matrix if known is None else known + matrix
    left_out = [ratio[min(basis.modes, ratio.size - 1) :] for ratio in ratios]
    equal = all(np.array_equal(ratio, ratios[0]) for ratio in ratios)
    springs = any(coupling.stiffness for coupling in model.couplings)
    composite = bool(np.any(ratios)) and (not equal or springs)
    lowest, highest = min(float(r.min()) for r in left_out), max(float(r.max()) for r in left_out)
    return StatedDamping(known, lowest, highest, composite)


def reduced_damping(structure: Structure, basis: ReducedBasis, omega: Floats) -> Floats:
    r"""(n, n) symmetric C, 1/s, of the reduced model of an open structure.

    Parameters
    ----------
    structure, basis : the full model (stated damping, dashpots and viscous damping) and the reduced basis.
    omega : (n,) physical angular frequencies of the coordinates, rad/s.

    Returns
    -------
    (n, n) array
        Block by block where nothing linear couples the parts.

    Notes
    -----
    Modal: C = diag(2 xi_i omega_i). Ratio i of a list belongs to mode i as numbered in every table, counting rigid-body
    modes (which are not damped); higher modes and static vectors have the last ratio. Of bodies that are joined the
    ratios are weighted by strain energy: with the strain energy matrix :math:`E_b` of body b in the coordinates (their
    sum with that of the joints' springs is diag(omega^2)),

    .. math:: C_{ij} = \sum_b 2 \sqrt{\xi_{b,i} \xi_{b,j}}\, (E_b)_{ij} / \sqrt{\omega_i \omega_j},

    so that a mode has the mean of its bodies' ratios, weighted by the share of its strain energy in each (composite
    modal damping), and equal ratios give that ratio. The sum is positive semidefinite. Ratio i of a list belongs to
    mode i of the joined structure. Springs of joints are not damped but by their dashpots. Rayleigh damping is that of
    the body's own matrices, of one alone alpha I + beta diag(omega^2). Viscous damping and dashpots: projection of the
    physical matrix.
    """
    if structure.parts:
        whole = np.zeros((omega.size, omega.size))
        for part, (reduced, columns) in zip(structure.parts, basis.blocks, strict=True):
            whole[np.ix_(columns, columns)] = reduced_damping(part.structure, reduced, omega[columns])
        return whole
    root = np.sqrt(omega)
    inverse = np.divide(1.0, root, out=np.zeros_like(root), where=root > 0)
    ratios = [_modal_ratios(m.body.stated_damping, omega.size, basis.modes) for m in structure.members]
    # The first body's ratio for everything, then the others' differences: equal ratios leave exact zeros.
    common = np.sqrt(ratios[0])
    c = np.diag(2 * ratios[0] * omega)
    in_springs = np.diag(omega**2)
    for member, ratio in zip(structure.members, ratios, strict=True):
        # mass and stiffness, 1/s^2, of the body in the coordinates, which are modes of a body alone
        moving, energy = np.eye(omega.size), np.diag(omega**2)
        if member.body is not structure:
            fields = member.expansion @ basis.vectors
            bent = np.asarray(member.body.factor @ fields)
            moving = member.mass_ratio * (fields.T @ (member.body.mass @ fields))
            energy = (bent.T @ bent) * (member.stiffness_ratio * structure.frequency_scale**2)
        in_springs -= energy
        weight = np.outer(np.sqrt(ratio), np.sqrt(ratio)) - np.outer(common, common)
        c += 2 * weight * energy * np.outer(inverse, inverse)
        stated = member.body.stated_damping
        if stated is not None and stated.kind == "rayleigh":
            of_mass, of_stiffness = stated.factors
            c += of_mass * moving + of_stiffness * energy
    if any(coupling.stiffness for coupling in structure.couplings):
        c -= 2 * np.outer(common, common) * in_springs * np.outer(inverse, inverse)
    if structure.damping is not None:
        c += basis.vectors.T @ (structure.damping @ basis.vectors) / structure.mass_scale
    return np.asarray((c + c.T) / 2)


def _modal_ratios(damping: Any, size: int, modes: int) -> Floats:
    """(size,) ratios of the coordinates, the first ``modes`` of which are modes; zeros without modal damping."""
    if damping is None or damping.kind != "modal":
        return np.zeros(size)
    given = np.atleast_1d(np.asarray(damping.ratio, dtype=float))
    ratio = np.full(size, given[-1])
    count = min(given.size, modes)
    ratio[:count] = given[:count]
    return ratio
