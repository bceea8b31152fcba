r"""Modal reduction with residual-flexibility vectors, its error bound, and damping in reduced coordinates.

The basis consists of the lowest modes and, for each load pattern, the part of its static deflection that the kept modes
do not represent. If there are rigid-body modes, this is the deflection of the free structure in steady acceleration
(inertia relief). Linearly dependent vectors are dropped.

A vector that is M-orthogonal to exact modes is also K-orthogonal to them. The kept modes therefore keep their
frequencies, and only the added vectors are diagonalised among themselves.

A point that moves along a body needs coordinates that are valid at all its positions: static vectors are added where
the compliance is least accurate, until it is accurate at all positions.

Error bound of the reduced receptance at the places of forces. After the kept modes are removed from the loads, the
stiffness A (in the inner product of the mass matrix) has natural frequencies of at least :math:`\Omega`. The reduced
solution x leaves the residual :math:`r = a - (A - \omega^2) x` of a load a. The error of the undamped receptance
between two places is :math:`r_a^T (A - \omega^2)^{-1} r_b`, and therefore at most :math:`N_a N_b / (1 - \omega^2 /
\Omega^2)` with :math:`N = \sqrt{r^T A^{-1} r}`; at one place it is at least :math:`N^2`. N is the norm of a strain,
computed from a difference of static deflections and not from differences of sums.

The effect of damping is in docs/theory.md, section 4. Damping of the open structure is the same in every contact state.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import qr, solve_triangular
from scipy.sparse.linalg import eigsh

from beamsim.structures.modes import Modes, natural_modes, orient
from beamsim.structures.places import BaseDirection, Place
from beamsim.structures.structure import (
    BodyStructure,
    LoadPattern,
    MemberBody,
    ReducedBasis,
    Structure,
    Substructure,
    UnitMotion,
)
from beamsim.structures.symmetric_lu import DENSE_COUNT, negative_eigenvalues
from beamsim.typing import Complexes, Floats

# Modes are kept up to this multiple of the highest frequency of interest.
FREQUENCY_MARGIN = 1.5
_INDEPENDENT = 1e-12  # squared norm of the independent part of a deflection, relative to that of the whole


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
    factors, u = model.factorised_stiffness, np.zeros(loads.shape)
    for _ in range(3):
        left = loads - model.factor.T @ (model.factor @ u)
        left[factors.pinned] = 0.0
        u = u + factors.solve(left)
    return np.asarray(u - model.rigid @ (model.rigid.T @ (model.mass @ u)))


def _reduced_substructures(
    model: Structure,
    patterns: Sequence[LoadPattern],
    count: int | None,
    highest_frequency: float | None,
    *,
    default_reduction: bool,
    least_modes: int,
) -> ReducedBasis:
    """Reduce each uncoupled substructure separately, and sort by frequency; see `reduce_model`."""
    counts: list[int | None] = [None] * len(model.substructures)
    if count is not None:  # number of the lowest modes that belong to each substructure, at least one
        lowest = natural_modes(model, count=count).vectors[:, :count]
        counts = [max(1, int(np.any(lowest[part.dofs] != 0, axis=0).sum())) for part in model.substructures]
    physical = None if highest_frequency is None else highest_frequency * model.frequency_scale
    of_parts = []
    for part, part_count in zip(model.substructures, counts, strict=True):
        own, of_part = part.structure, _own_patterns(model, part, patterns)
        highest = None if physical is None else physical / own.frequency_scale
        of_parts.append(
            reduce_model(
                own,
                of_part,
                count=part_count,
                highest_frequency=highest,
                default_reduction=default_reduction,
                least_modes=least_modes,
            )
        )
    return _direct_sum(model, of_parts)


def reduce_model(
    model: Structure, patterns: Sequence[LoadPattern] = (), *, count: int | None = None,
    highest_frequency: float | None = None, default_reduction: bool = False, least_modes: int = 0, mode: int = 0,
) -> ReducedBasis:  # fmt: skip
    """Reduce a model to its lowest modes and the static vectors of load patterns.

    Parameters
    ----------
    model : the full model.
    patterns : loads whose static deflections must be exact.
    count : number of modes (at least the rigid-body modes).
    highest_frequency : scaled angular frequency of interest; modes up to `FREQUENCY_MARGIN` times this value
        are kept. Without `count` and `highest_frequency` all modes are kept, and no static vector is needed.
    default_reduction : True if the program chooses the number of modes. At least the ``least_modes`` lowest flexible
        modes and mode number ``mode`` are then kept, but none that the discretisation does not resolve; the reported
        frequency of interest is changed accordingly. A structure that resolves all of its modes keeps all of them.
    least_modes, mode : see ``default_reduction``.

    Returns
    -------
    ReducedBasis
        For several substructures all coordinates, sorted by frequency.
    """
    if model.substructures:
        least_modes = max(least_modes, mode)
        return _reduced_substructures(
            model, patterns, count, highest_frequency, default_reduction=default_reduction, least_modes=least_modes
        )
    rigid = model.rigid.shape[1]
    if default_reduction and model.most_modes is None:
        return _with_static_vectors(model, natural_modes(model), model.size, (), None)
    if count is not None:
        kept = min(max(count, rigid), model.size)
        modes = natural_modes(model, count=kept)
    elif highest_frequency is not None:
        limit = FREQUENCY_MARGIN * highest_frequency
        least = min(max(rigid + least_modes if default_reduction else 1, rigid, mode, 1), model.size)
        most = None if not default_reduction or model.most_modes is None else max(rigid + model.most_modes, least)
        modes = natural_modes(model, count=least, up_to=limit, most_modes=None if most is None else most + 1)
        kept = max(int(np.searchsorted(modes.omega, limit, side="right")), least)
        if kept == least or (most is not None and kept > most):
            kept = max(least, kept if most is None else min(kept, most))
            highest_frequency = max(float(modes.omega[kept - 1]) / FREQUENCY_MARGIN, 0.0)
    else:
        modes, kept = natural_modes(model), model.size
    return _with_static_vectors(model, modes, kept, tuple(patterns), highest_frequency)


def _own_patterns(model: Structure, part: Substructure, patterns: Sequence[LoadPattern]) -> list[LoadPattern]:
    """The load patterns of one substructure, in its own scales."""
    acting = []
    for pattern in patterns:
        vector = pattern.vector[part.dofs]
        if isinstance(pattern.site, BaseDirection):
            acting.append(LoadPattern(part.structure.base_load(pattern.site)[0], pattern.site))
        elif np.any(vector):
            # the pattern of a unit motion is a stiffness, in the unit of the structure
            of_motion = isinstance(pattern.site, UnitMotion)
            unit = model.stiffness_scale / part.structure.stiffness_scale if of_motion else 1.0
            acting.append(LoadPattern(vector * unit, pattern.site))
    return acting


def _direct_sum(model: Structure, bases: Sequence[ReducedBasis]) -> ReducedBasis:
    """Combine the bases of substructures: rigid-body modes, modes, static vectors, each by frequency."""
    scale = [part.structure.frequency_scale / model.frequency_scale for part in model.substructures]
    omega = np.concatenate([basis.omega * s for basis, s in zip(bases, scale, strict=True)])
    rank = np.concatenate(
        [np.repeat([0, 1, 2], [b.rigid_count, b.modes - b.rigid_count, b.size - b.modes]) for b in bases]
    )
    order = np.lexsort((omega, rank))  # stable: equal bodies keep their order
    place = np.empty(order.size, dtype=np.int64)
    place[order] = np.arange(order.size)
    vectors = np.zeros((model.size, omega.size))
    blocks, start = [], 0
    for part, basis in zip(model.substructures, bases, strict=True):
        columns = place[start : start + basis.size]
        vectors[part.dofs, columns] = basis.vectors * np.sqrt(model.mass_scale / part.structure.mass_scale)
        blocks.append((basis, columns))
        start += basis.size
    modes = sum(basis.modes for basis in bases)
    return ReducedBasis(
        omega=omega[order],
        vectors=vectors,
        rigid_count=sum(basis.rigid_count for basis in bases),
        modes=modes,
        patterns=(),
        pattern=np.zeros((0, omega.size)),
        acceleration_modes=np.zeros((modes, omega.size)),
        highest_frequency=min(b.highest_frequency * s for b, s in zip(bases, scale, strict=True)),
        blocks=tuple(blocks),
    )


def _with_static_vectors(
    model: Structure, modes: Modes, kept_count: int, patterns: tuple[LoadPattern, ...], highest_frequency: float | None
) -> ReducedBasis:
    phi, omega = modes.vectors[:, :kept_count], modes.omega[:kept_count]
    if highest_frequency is None:
        highest_frequency = float(omega[-1]) if kept_count == model.size else float(omega[-1]) / FREQUENCY_MARGIN
    transform, static = np.zeros((len(patterns), 0)), np.zeros((model.size, 0))
    loads = np.array([pattern.vector for pattern in patterns]).reshape(-1, model.size).T
    if kept_count < model.size and patterns:
        transform, static = _static_vectors(model, phi, loads)
        if kept_count + static.shape[1] == model.size:
            # same coordinates, but the moments of a load whose vector was dropped would be those of another load
            every = modes if modes.omega.size == model.size else natural_modes(model)
            return _with_static_vectors(model, every, model.size, patterns, highest_frequency)
    strain = np.asarray(model.factor @ static)
    static_omega = np.sqrt(np.sum(strain**2, axis=0) / np.sum(static * (model.mass @ static), axis=0))
    return ReducedBasis(
        np.concatenate([omega, static_omega]), np.hstack([phi, static]), model.rigid.shape[1], kept_count, patterns,
        np.hstack([np.zeros((len(patterns), kept_count)), transform]),
        np.hstack([np.diag(omega**2), -(phi.T @ loads) @ transform]), highest_frequency,
    )  # fmt: skip


def _residual_deflections(model: Structure, modes: Floats, loads: Floats) -> Floats:
    """(N, c) static deflections under loads (N, c), minus the contribution of modes (N, k).

    The load of the modes is subtracted before solving, so that small deflections stay accurate.
    """
    u = static_deflections(model, loads - model.mass @ (modes @ (modes.T @ loads)))
    for _ in range(2):
        u = u - modes @ (modes.T @ (model.mass @ u))
    return u


def _static_vectors(model: Structure, phi: Floats, loads: Floats) -> tuple[Floats, Floats]:
    """Independent parts of the residual deflections under loads (N, m): coefficients (m, k) and vectors (N, k).

    A pivoted decomposition selects them: a deflection is dropped if its remaining squared norm is below `_INDEPENDENT`
    of that of the whole deflection.
    """
    whole = np.sum(np.asarray(model.factor @ static_deflections(model, loads)) ** 2, axis=0)
    residual = _residual_deflections(model, phi, loads)
    scale = np.divide(1.0, np.sqrt(whole), out=np.zeros_like(whole), where=whole > 0)
    r, order = qr(np.asarray(model.factor @ residual) * scale, mode="r", pivoting=True)
    kept = int(np.sum(np.diag(r) ** 2 > _INDEPENDENT))
    transform = np.zeros((scale.size, kept))
    transform[order[:kept]] = solve_triangular(r[:kept, :kept], np.diag(np.sign(np.diag(r)[:kept])))
    transform = scale[:, None] * transform
    # Orthonormal in K; the eigenvalues of M in this basis are 1 / omega^2.
    basis = residual @ transform
    mu, y = np.linalg.eigh(basis.T @ (model.mass @ basis))
    transform = transform @ (y[:, ::-1] / np.sqrt(mu[::-1]))
    static = residual @ transform
    sign = np.sum(orient(static, model.deflections(static)) * static, axis=0) / np.sum(static * static, axis=0)
    return transform * sign, static * sign


# Relative shift of a limit at which the matrix is singular.
_COUNT_OFFSET = 1e-7
# Fractions of the way from the last kept frequency to the estimated next one, at which frequencies are counted.
_SHARES = (0.97, 0.9, 0.7, 0.4)


def frequency_beyond(model: Structure, kept_frequencies: Floats, guess: float) -> float:
    """A certified lower bound of the natural frequencies above the kept ones (scaled).

    Certified by Sturm counts, up to round-off of their factorisations: below the value returned there are no natural
    frequencies but those kept. Zero where the kept ones are not the lowest; nan where no count is known.

    Parameters
    ----------
    model : the full model.
    kept_frequencies : (k,) scaled angular frequencies.
    guess : an upper bound of the next frequency, such as a Ritz value above the kept modes.

    Returns
    -------
    float
        Scaled angular frequency; zero or nan as described above.
    """
    stiffness = model.stiffness
    last = float(kept_frequencies[-1]) if kept_frequencies.size else 0.0
    between = last + (guess - last) * np.array(_SHARES)
    limits = [*between[between > last], last * (1 + _COUNT_OFFSET), last * (1 - _COUNT_OFFSET)]
    undecided = False
    while limits:
        omega = limits.pop(0)
        count = negative_eigenvalues(stiffness - omega**2 * model.mass, model.order)
        known = int(np.sum(kept_frequencies < omega))
        if count == known:
            return float(omega)
        undecided |= count is None
        if model.size > DENSE_COUNT and count is not None and count > known + 3 and omega > last:
            # counts are expensive for a large model, whose modes are roughly evenly spaced: halfway to the expected
            # next frequency
            half_way = last + (omega - last) / (count - known) / 2
            limits = [half_way, *(limit for limit in limits if limit < half_way)]
    return np.nan if undecided else 0.0


@dataclass(frozen=True)
class ReceptanceBound:
    """Largest errors of the reduced receptance, relative to the receptances.

    0 if all modes are kept; infinite if modes below the highest frequency are missing; nan if round-off hides this. The
    size of a receptance is the geometric mean of those at its two places: the static compliance or, near resonances,
    the current value.
    """

    loads: float  # between two loads
    probes: float | None  # between a load and a probe; None without probes


def receptance_bound(
    model: Structure, basis: ReducedBasis, damping: Floats, loads: Floats, probes: Floats, omega: Sequence[float] = ()
) -> ReceptanceBound:
    """Error bounds up to the highest frequency of the reduction, and at the frequencies of the excitation.

    Parameters
    ----------
    model, basis : full model and its reduced coordinates.
    damping : (n, n) C of the reduced model, 1/s.
    loads : (m, N) rows of contacts and forces, and the inertia load of base motion.
    probes : (p, N) rows of observed places without static vectors.
    omega : angular frequencies of the excitation, rad/s.

    Returns
    -------
    ReceptanceBound
        Relative errors.
    """
    acting, known = loads.shape[0], None if not len(probes) else 0.0
    parts = [(part.structure, part.dofs) for part in model.substructures] or [(model, slice(None))]
    blocks = basis.blocks or ((basis, np.arange(basis.size)),)
    if all(reduced.modes == part.size for (part, _), (reduced, _) in zip(parts, blocks, strict=True)):
        return ReceptanceBound(0.0, known)
    truncations = [
        OmittedResponse.of(
            part, reduced, damping[np.ix_(columns, columns)], np.vstack([loads, probes])[:, dofs], acting
        )
        for (part, dofs), (reduced, columns) in zip(parts, blocks, strict=True)
    ]
    static: Floats = np.asarray(sum(part.compliances / part.model.stiffness_scale for part in truncations))
    moved = static > 0
    if not moved[:acting].any():
        return ReceptanceBound(0.0, known)
    # up to the highest frequency, which decides without damping, and at resonances
    highest, kept = basis.highest_frequency, basis.omega[: basis.modes]
    frequencies = np.unique(np.concatenate([kept[kept < highest], np.linspace(0, highest, 12)]))
    largest = np.zeros(moved.size)  # for each place and any load
    for frequency in np.concatenate([frequencies * model.frequency_scale, omega]):
        errors, present = np.zeros((moved.size, moved.size)), np.zeros(moved.size)
        for part in truncations:
            scaled = frequency / part.model.frequency_scale
            response = part.response(scaled)
            errors += part.errors(scaled, response) / part.model.stiffness_scale
            present += np.abs(np.einsum("ij,ji->i", part.shapes, response)) / part.model.stiffness_scale
        errors[~moved], errors[:, ~moved] = 0.0, 0.0
        size = np.where(moved, np.sqrt(np.maximum(static, present)), 1.0)
        largest = np.maximum(largest, (errors / np.outer(size, size))[:, :acting].max(axis=1))
    return ReceptanceBound(float(largest[:acting].max()), float(largest[acting:].max()) if known is not None else None)


NEGLIGIBLE_COMPLIANCE = (
    1e-24  # of the squared size of a load: with less compliance it moves the structure as a rigid body
)


@dataclass(frozen=True)
class OmittedResponse:
    """The part of the response to m loads that a reduced basis omits, in scaled units."""

    model: Structure
    basis: ReducedBasis
    damping: Floats  # (n, n) of the reduced model, 1/s
    loads: Floats  # (m, N)
    static_load_count: int  # loads that the static vectors are made for, the first of them
    shapes: Floats  # (m, n) generalised force of each load
    compliances: Floats  # (m,) static compliance of each load without rigid-body motion; 0 if it causes only that
    stated_damping: StatedDamping  # damping of the full model
    modal_damping: Floats  # (n, n) contribution of modal ratios to the reduced model's C, scaled
    # (p, m + 2 k [+ n]) terms of the residuals, orthogonally reduced (norms and products are unchanged). Columns:
    # deflections under the loads, static vectors, deflections under their inertia, and under the damping matrix
    strains: Floats
    omitted_from: float  # certified lower bound of the frequencies left out; infinite if none is
    damping_factor: float  # a number c with C <= c K for the known damping in all motion that is left out
    static_inverse: Floats  # (k, k) S^T A^-1 S of the static vectors S

    @classmethod
    def of(
        cls, model: Structure, basis: ReducedBasis, damping: Floats, loads: Floats, static_load_count: int
    ) -> OmittedResponse:
        """Compute the omitted response of a basis; see the fields."""
        deflected = np.asarray(model.factor @ static_deflections(model, loads.T))
        compliance = np.sum(deflected**2, axis=0)
        compliances = np.where(compliance > NEGLIGIBLE_COMPLIANCE * np.sum(loads**2, axis=1), compliance, 0.0)
        stated, modal_damping = stated_damping(model, basis), damping / model.frequency_scale
        if stated.matrix is not None:
            modal_damping = modal_damping - basis.vectors.T @ (stated.matrix @ basis.vectors)
        modes, static = np.hsplit(basis.vectors, [basis.modes])
        flexibility = _residual_deflections(model, modes, model.mass @ static)
        columns = [_residual_deflections(model, modes, loads.T), static, flexibility]
        kept, beyond, share = basis.omega[: basis.modes], np.inf, 0.0
        if basis.modes < model.size:
            trial = np.hstack([static, flexibility])
            if not trial.shape[1]:
                trial = _residual_deflections(model, modes, loads[:static_load_count].T)
            bent = np.asarray(model.factor @ trial)
            moving = np.einsum("ij,ij->j", trial, model.mass @ trial)
            ritz = np.sqrt(np.sum(bent**2, axis=0)[moving > 0] / moving[moving > 0])
            beyond = frequency_beyond(model, kept, float(ritz.min(initial=4 * max(kept[-1:], default=1.0))))
            if stated.matrix is not None:
                columns.append(_residual_deflections(model, modes, stated.matrix @ basis.vectors))
                share = stated.share_of(model, beyond)
        strains = np.asarray(np.linalg.qr(np.asarray(model.factor @ np.hstack(columns)), mode="r"))
        inverse = static.T @ (model.mass @ flexibility)
        return cls(
            model, basis, damping, loads, static_load_count, loads @ basis.vectors, compliances, stated, modal_damping,
            strains, beyond, share, (inverse + inverse.T) / 2,
        )  # fmt: skip

    def response(self, s: float) -> Complexes:
        """(n, m) response of the reduced model to the loads at scaled frequency s."""
        damping = self.damping / self.model.frequency_scale
        own = self.basis.omega**2 - s**2 + 1j * s * damping.diagonal()
        own[np.abs(own) <= 1e-12 * s**2] = 1e-12 * s**2 + (s == 0.0)
        if np.count_nonzero(damping) == np.count_nonzero(damping.diagonal()):
            return np.asarray(self.shapes.T / own[:, None])
        coupling = 1j * s * (damping - np.diag(damping.diagonal()))
        return np.asarray(np.linalg.solve(np.diag(own) + coupling, self.shapes.T))

    def errors(self, s: float, y: Complexes) -> Floats:
        """(m, m) error bounds of the receptance between the loads at scaled frequency s; y is the `response`."""
        stated, kept, beyond, count = self.stated_damping, self.basis.modes, self.omitted_from, self.loads.shape[0]
        if kept == self.model.size or beyond <= s:
            return np.full((count, count), 0.0 if kept == self.model.size else np.inf)
        static = y[kept:]
        inertia = s**2 * static
        if stated.is_composite:
            inertia = inertia - 1j * s * (self.modal_damping @ y)[kept:]
        rows = [-static, inertia]
        weights = np.vstack([*rows, -1j * s * y] if stated.matrix is not None else rows)
        # real and imaginary parts in one real product: a complex one would multiply the zero imaginary parts too
        residual = self.strains[:, count:] @ np.hstack([weights.real, weights.imag])
        residual[:, :count] += self.strains[:, :count]
        squares = np.sum(residual**2, axis=0)
        size = np.sqrt(squares[:count] + squares[count:])
        coupling, deviation = self.damping_factor, np.zeros((count, count))
        if stated.is_composite:
            within = self.modal_damping[kept:, kept:]
            coupling += float(np.linalg.norm(within, 2)) / beyond**2 if within.size else 0.0
        elif static.size and stated.highest != 0.0:
            size = size + 2 * stated.highest * s * np.linalg.norm(static, axis=0)
            # difference between the damping of the static vectors and of the modes that they represent: S^T A^(1/2) S
            # of these vectors S lies between lower and upper, by Jensen's operator inequality
            values, vectors = np.linalg.eigh(self.static_inverse)
            lower = (vectors / np.sqrt(np.maximum(values, np.finfo(float).tiny))) @ vectors.T
            given, upper = self.modal_damping[kept:, kept:], np.diag(self.basis.omega[kept:])
            largest, least = given - 2 * stated.lowest * lower, given - 2 * stated.highest * upper
            both = np.hstack([static.real, static.imag])
            within = np.sum(both * ((largest - least) / 2 @ both), axis=0)  # symmetric
            within = np.sqrt(np.maximum(within[:count] + within[count:], 0.0))
            real, imag = np.hsplit((largest + least) / 2 @ both, 2)
            deviation = s * (np.abs(static.T @ (real + 1j * imag)) + np.outer(within, within))
        open_share, half = 1 - (s / beyond) ** 2, s * coupling / 2
        # open_share if damping couples nothing; sqrt(open_share^2 + half^2) - half without cancellation
        divisor = open_share**2 / (np.hypot(open_share, half) + half)
        return np.asarray(np.outer(size, size) / divisor + deviation)


ACCURATE_COMPLIANCE = 3e-5  # relative to the compliance; the default reduction has an error of this size


def places_needed(
    structure: Structure, basis: ReducedBasis, first: Place, last: Place, places_with_vectors: Sequence[Place]
) -> list[Place]:
    """Place where a static vector should be added next; empty if the compliance is accurate everywhere between.

    Parameters
    ----------
    structure, basis : full model and its reduced coordinates.
    first, last : ends of the range.
    places_with_vectors : places that have a static vector.

    Returns
    -------
    list
        At most one place.
    """
    places = [replace(first, point=float(x)) for x in np.linspace(first.coordinate, last.coordinate, 41)]
    rows, moving = structure.rows(places), basis.omega > 0
    full = np.sum(rows.T * static_deflections(structure, rows.T), axis=0)
    reduced = np.sum((rows @ basis.vectors[:, moving] / basis.omega[moving]) ** 2, axis=1)
    # part of the static compliance that the reduced model does not represent
    defect = np.where(full > 0, (full - reduced) / np.where(full > 0, full, 1.0), 0.0)
    worst = int(np.argmax(defect))
    return [] if defect[worst] <= ACCURATE_COMPLIANCE or places[worst] in places_with_vectors else [places[worst]]


@dataclass(frozen=True)
class StatedDamping:
    """Damping of a full model: a matrix, and bounds of modal ratios (scaled units)."""

    matrix: Any  # (N, N) sparse, dashpots, viscous and Rayleigh damping; None without
    lowest: float  # bounds of the modal ratio of the omitted modes
    highest: float
    is_composite: bool  # modal damping is defined for the reduced coordinates alone (composite modal damping)

    def share_of(self, model: Structure, omega: float) -> float:
        """A number c with C <= c K for the damping matrix C in all motion above a scaled frequency ``omega``.

        It is certified by a Sturm count; nan if round-off hides the result.
        """
        norm = (model.factor.T @ model.factor + omega**2 * model.mass).tocsc()
        start = np.linspace(1.0, 2.0, model.size)
        share = 1.01 * float(eigsh(self.matrix.tocsc(), k=1, M=norm, which="LA", v0=start, tol=1e-3)[0][0])
        for _ in range(6):
            if share <= 0 or negative_eigenvalues(share * norm - self.matrix) == 0:
                return 2 * max(share, 0.0)  # K + omega^2 M <= 2 K in that motion
            share *= 2
        return np.nan


def stated_damping(model: Structure, basis: ReducedBasis) -> StatedDamping:
    """Damping of the full model; a basis keeps its lowest ``basis.modes`` modes."""
    known: Any = None if model.damping is None else model.damping / (model.mass_scale * model.frequency_scale)
    ratios = [_modal_ratios(member.body.stated_damping, model.size, model.size) for member in model.members]
    for member in model.members:
        if member.body.stated_damping is not None and member.body.stated_damping.kind == "rayleigh":
            matrix = _rayleigh_damping(member)
            known = matrix if known is None else known + matrix
    left_out = np.concatenate([ratio[min(basis.modes, ratio.size - 1) :] for ratio in ratios])
    equal = all(np.array_equal(ratio, ratios[0]) for ratio in ratios)
    springs = any(coupling.stiffness for coupling in model.couplings)
    composite = bool(np.any(ratios)) and (not equal or springs)
    return StatedDamping(known, float(left_out.min()), float(left_out.max()), composite)


def _rayleigh_damping(member: MemberBody) -> Any:
    """(N, N) sparse scaled Rayleigh damping of one body in its structure."""
    body, frequency = member.body, member.structure.frequency_scale
    of_mass, of_stiffness = body.stated_damping.factors
    mass, stiffness = body.mass * member.mass_ratio, body.factor.T @ body.factor
    matrix = mass * (of_mass / frequency) + stiffness * (member.stiffness_ratio * of_stiffness * frequency)
    return member.expansion.T @ matrix @ member.expansion


def reduced_damping(structure: Structure, basis: ReducedBasis, omega: Floats) -> Floats:
    r"""(n, n) symmetric C, 1/s, of the reduced model of an open structure.

    Parameters
    ----------
    structure, basis : the full model (given damping, dashpots and viscous damping) and the reduced basis.
    omega : (n,) physical angular frequencies of the coordinates, rad/s.

    Returns
    -------
    (n, n) array
        Block-diagonal for uncoupled substructures.

    Notes
    -----
    Modal damping: C = diag(2 xi_i omega_i). Ratio i of a list belongs to mode i as numbered in every table, including
    rigid-body modes (which are not damped); higher modes and static vectors have the last ratio. For joined bodies the
    ratios are weighted by strain energy: with the strain energy matrix :math:`E_b` of body b in the coordinates (the
    sum of these and of the joints' springs is diag(omega^2)),

    .. math:: C_{ij} = \sum_b 2 \sqrt{\xi_{b,i} \xi_{b,j}}\, (E_b)_{ij} / \sqrt{\omega_i \omega_j},

    so that a mode has the mean of its bodies' ratios, weighted by their shares of its strain energy (composite modal
    damping); equal ratios give that ratio. The sum is positive semidefinite. Ratio i of a list belongs to mode i of the
    joined structure. Springs of joints are damped only by their dashpots. Rayleigh damping uses the matrices of each
    body; for a single body it is alpha I + beta diag(omega^2). Viscous damping and dashpots are projections of the
    physical matrix.
    """
    if structure.substructures:
        return _damping_of_substructures(structure, basis, omega)
    if not isinstance(structure, BodyStructure):
        c = _damping_of_joined_bodies(structure, basis, omega)
    elif (stated := structure.stated_damping) is not None and stated.kind == "rayleigh":
        c = np.diag(stated.factors[0] + stated.factors[1] * omega**2)
    else:
        c = np.diag(2 * _modal_ratios(stated, omega.size, basis.modes) * omega)
    if structure.damping is not None:
        c += basis.vectors.T @ (structure.damping @ basis.vectors) / structure.mass_scale
    return np.asarray((c + c.T) / 2)


def _damping_of_substructures(structure: Structure, basis: ReducedBasis, omega: Floats) -> Floats:
    """(n, n) C, 1/s, of uncoupled substructures."""
    whole = np.zeros((omega.size, omega.size))
    for part, (reduced, columns) in zip(structure.substructures, basis.blocks, strict=True):
        whole[np.ix_(columns, columns)] = reduced_damping(part.structure, reduced, omega[columns])
    return whole


def _damping_of_joined_bodies(structure: Structure, basis: ReducedBasis, omega: Floats) -> Floats:
    """(n, n) composite modal damping and Rayleigh damping of joined bodies, 1/s; see `reduced_damping`."""
    root = np.sqrt(omega)
    inverse = np.divide(1.0, root, out=np.zeros_like(root), where=root > 0)
    ratios = [_modal_ratios(m.body.stated_damping, omega.size, basis.modes) for m in structure.members]
    # The ratio of the first body for everything, then differences for the others: equal ratios give exact zeros.
    common = np.sqrt(ratios[0])
    c = np.diag(2 * ratios[0] * omega)
    in_springs = np.diag(omega**2)
    for member, ratio in zip(structure.members, ratios, strict=True):
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
    return np.asarray(c)


def _modal_ratios(damping: Any, size: int, modes: int) -> Floats:
    """(size,) ratios of the coordinates, of which the first ``modes`` are modes; zeros without modal damping."""
    if damping is None or damping.kind != "modal":
        return np.zeros(size)
    given = np.atleast_1d(np.asarray(damping.ratio, dtype=float))
    count = min(given.size, modes)
    return np.pad(given[:count], (0, size - count), constant_values=given[-1])
