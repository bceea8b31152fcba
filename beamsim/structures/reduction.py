r"""Modal reduction with residual-flexibility vectors.

The basis has the lowest modes and, for each load pattern, the part of its static deflection that the kept modes
do not represent. If the structure has rigid-body modes, this is the deflection of the free-flying structure in steady
acceleration (inertia relief). Linearly dependent vectors are dropped.

A vector that is M-orthogonal to exact modes is also K-orthogonal to them. The kept modes therefore keep their
frequencies, and only the added vectors are diagonalised among themselves.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import qr, solve_triangular

from beamsim.structures.base_motion import BaseDirection
from beamsim.structures.basis import LoadPattern, ReducedBasis
from beamsim.structures.modes import Modes, natural_modes, orient
from beamsim.structures.structure import Part, Structure
from beamsim.structures.supports import UnitMotion
from beamsim.structures.symmetric_lu import pinned_rows
from beamsim.typing import Floats

# Modes are kept up to this multiple of the highest frequency of interest.
FREQUENCY_MARGIN = 1.5


def static_deflections(model: Structure, loads: Floats) -> Floats:
    """(N, c) deflections under (N, c) loads; with rigid-body modes, under the loads minus their rigid-body inertia.

    The deflection is M-orthogonal to the rigid-body modes. Two steps of iterative refinement, with the residual
    computed as B^T (B u), restore the digits lost to the conditioning of K.

    Parameters
    ----------
    model : the full model.
    loads : (N, c) scaled.

    Returns
    -------
    (N, c) array
        Scaled.
    """
    loads = loads - model.mass @ (model.rigid @ (model.rigid.T @ loads))
    pinned = pinned_rows(model.rigid)
    u = np.zeros(loads.shape)
    for _ in range(3):
        left = loads - model.factor.T @ (model.factor @ u)
        left[pinned] = 0.0
        u = u + model.factorised_stiffness.solve(left)
    return np.asarray(u - model.rigid @ (model.rigid.T @ (model.mass @ u)))


def _independent(energy_vectors: Floats, reference: Floats) -> Floats:
    """(c, k) coefficients T with orthonormal energy_vectors (p, c) @ T, by a decomposition with pivoting.

    A column is left out if its remaining squared norm is below 1e-12 of its reference (c,).
    """
    scale = np.divide(1.0, np.sqrt(reference), out=np.zeros_like(reference), where=reference > 0)
    r, order = qr(energy_vectors * scale, mode="r", pivoting=True)
    kept = int(np.sum(np.diag(r) ** 2 > 1e-12))
    transform = np.zeros((scale.size, kept))
    transform[order[:kept]] = solve_triangular(r[:kept, :kept], np.diag(np.sign(np.diag(r)[:kept])))
    return scale[:, None] * transform


def reduce_model(
    model: Structure,
    patterns: Sequence[LoadPattern] = (),
    *,
    count: int | None = None,
    highest_frequency: float | None = None,
    default: bool = False,
    least: int = 0,
    mode: int = 0,
) -> ReducedBasis:
    """Lowest modes plus the static vectors of the load patterns.

    Parameters
    ----------
    model : the full model.
    patterns : loads whose static deflection must be exact.
    count : number of modes (at least the rigid-body modes are kept).
    highest_frequency : scaled angular frequency of interest; modes up to `FREQUENCY_MARGIN` times this value
        are kept. Without `count` and `highest_frequency` all modes are kept, and no static vector is needed.
    default : whether the scenario leaves the reduction to the program. Then at least the ``least`` lowest flexible
        modes and mode number ``mode`` are kept, but no modes that the discretisation does not resolve, and the reported
        frequency of interest is changed accordingly. A structure that resolves all of its modes keeps them all.

    Returns
    -------
    ReducedBasis
        Of several parts that of each, and all in order of frequency.
    """
    if model.parts:
        counts = [None] * len(model.parts) if count is None else _counts(model, count)
        physical = None if highest_frequency is None else highest_frequency * model.frequency_scale
        of_parts = []
        for part, part_count in zip(model.parts, counts, strict=True):
            own, of_part = part.structure, _own_patterns(model, part, patterns)
            highest = None if physical is None else physical / own.frequency_scale
            of_parts.append(
                reduce_model(
                    own, of_part, count=part_count, highest_frequency=highest, default=default, least=max(least, mode)
                )
            )
        return _direct_sum(model, of_parts)
    rigid = model.rigid.shape[1]
    if default and model.most_modes is None:
        return _with_static_vectors(model, natural_modes(model), (), None)
    if count is not None:
        kept = min(max(count, rigid), model.size)
        modes = natural_modes(model, count=kept).first(kept)
    elif highest_frequency is not None:
        limit = FREQUENCY_MARGIN * highest_frequency
        least = min(max(rigid + least if default else 1, rigid, mode, 1), model.size)
        most = None if not default or model.most_modes is None else max(rigid + model.most_modes, least)
        modes = natural_modes(model, count=least, below=limit, most=None if most is None else most + 1)
        kept = max(int(np.searchsorted(modes.omega, limit, side="right")), least)
        if kept == least or (most is not None and kept > most):
            kept = max(least, kept if most is None else min(kept, most))
            highest_frequency = max(float(modes.omega[kept - 1]) / FREQUENCY_MARGIN, 0.0)
        modes = modes.first(kept)
    else:
        modes = natural_modes(model)
    return _with_static_vectors(model, modes, tuple(patterns), highest_frequency)


def _own_patterns(model: Structure, part: Part, patterns: Sequence[LoadPattern]) -> list[LoadPattern]:
    """What of the load patterns acts on one body, in its own scales."""
    acting = []
    for pattern in patterns:
        vector = pattern.vector[part.dofs]
        if isinstance(pattern.site, BaseDirection):
            acting.append(LoadPattern(part.structure.base_load(pattern.site)[0], pattern.site))
        elif np.any(vector):
            # that of a unit motion is a stiffness, in the unit of the structure
            of_motion = isinstance(pattern.site, UnitMotion)
            unit = model.stiffness_scale / part.structure.stiffness_scale if of_motion else 1.0
            acting.append(LoadPattern(vector * unit, pattern.site))
    return acting


def _counts(model: Structure, count: int) -> list[int]:
    """How many of the lowest modes are each body's own, at least one of each."""
    modes = natural_modes(model, count=count).first(count)
    return [max(1, int(np.any(modes.vectors[part.dofs] != 0, axis=0).sum())) for part in model.parts]


def _direct_sum(model: Structure, bases: Sequence[ReducedBasis]) -> ReducedBasis:
    """The bases of several bodies as one: rigid-body modes, then modes, then static vectors, by frequency."""
    scale = [part.structure.frequency_scale / model.frequency_scale for part in model.parts]
    omega = np.concatenate([basis.omega * s for basis, s in zip(bases, scale, strict=True)])
    rank = np.concatenate([np.repeat([0, 1, 2], [b.rigid, b.modes - b.rigid, b.static_vectors]) for b in bases])
    order = np.lexsort((omega, rank))  # stable: equal bodies keep their order
    place = np.empty(order.size, dtype=np.int64)
    place[order] = np.arange(order.size)
    vectors = np.zeros((model.size, omega.size))
    blocks, start = [], 0
    for part, basis in zip(model.parts, bases, strict=True):
        columns = place[start : start + basis.size]
        vectors[part.dofs, columns] = basis.vectors * np.sqrt(model.mass_scale / part.structure.mass_scale)
        blocks.append((basis, columns))
        start += basis.size
    modes = sum(basis.modes for basis in bases)
    return ReducedBasis(
        omega=omega[order],
        vectors=vectors,
        rigid=sum(basis.rigid for basis in bases),
        modes=modes,
        patterns=(),
        pattern=np.zeros((0, omega.size)),
        acceleration_modes=np.zeros((modes, omega.size)),
        highest_frequency=min(b.highest_frequency * s for b, s in zip(bases, scale, strict=True)),
        blocks=tuple(blocks),
    )


def _with_static_vectors(
    model: Structure, modes: Modes, patterns: tuple[LoadPattern, ...], highest_frequency: float | None
) -> ReducedBasis:
    phi, omega = modes.vectors, modes.omega
    kept = omega.size
    if highest_frequency is None:
        highest_frequency = float(omega[-1]) if kept == model.size else float(omega[-1]) / FREQUENCY_MARGIN
    transform, static = np.zeros((len(patterns), 0)), np.zeros((model.size, 0))
    loads = np.array([pattern.vector for pattern in patterns]).reshape(-1, model.size).T
    if kept < model.size and patterns:
        transform, static = _static_vectors(model, phi, loads)
    strain = np.asarray(model.factor @ static)
    static_omega = np.sqrt(np.sum(strain**2, axis=0) / np.sum(static * (model.mass @ static), axis=0))
    return ReducedBasis(
        np.concatenate([omega, static_omega]),
        np.hstack([phi, static]),
        model.rigid.shape[1],
        kept,
        patterns,
        np.hstack([np.zeros((len(patterns), kept)), transform]),
        np.hstack([np.diag(omega**2), -(phi.T @ loads) @ transform]),
        highest_frequency,
    )


def _static_vectors(model: Structure, phi: Floats, loads: Floats) -> tuple[Floats, Floats]:
    """What kept modes leave of the deflections under loads (N, m): coefficients (m, k) and vectors (N, k)."""
    whole = static_deflections(model, loads)
    # Solve for the load that the kept modes do not take, so that small residuals stay accurate.
    residual = static_deflections(model, loads - model.mass @ (phi @ (phi.T @ loads)))
    for _ in range(2):
        residual = residual - phi @ (phi.T @ (model.mass @ residual))
    transform = _independent(np.asarray(model.factor @ residual), np.sum(np.asarray(model.factor @ whole) ** 2, axis=0))
    # Orthonormal in K; the eigenvalues of M in this basis are 1 / omega^2.
    basis = residual @ transform
    mu, y = np.linalg.eigh(basis.T @ (model.mass @ basis))
    transform = transform @ (y[:, ::-1] / np.sqrt(mu[::-1]))
    static = residual @ transform
    sign = np.sum(orient(static, model.deflections(static)) * static, axis=0) / np.sum(static * static, axis=0)
    return transform * sign, static * sign
