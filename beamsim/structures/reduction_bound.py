r"""Bound of the error of the reduced receptance at the places where forces act.

With the kept modes taken out of the loads, the stiffness A (in the inner product of the mass matrix) has natural
frequencies of :math:`\Omega` and more. The reduced solution x leaves the residual
:math:`r = a - (A - \omega^2) x` of a load a. The error of the undamped receptance between two places is
:math:`r_a^T (A - \omega^2)^{-1} r_b`, and therefore at most :math:`N_a N_b / (1 - \omega^2 / \Omega^2)` with
:math:`N = \sqrt{r^T A^{-1} r}`; at one place it is at least :math:`N^2`. N is the norm of a strain, computed from a
difference of static deflections and not from differences of sums.

What damping adds is in docs/theory.md, section 4.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from beamsim.structures.basis import ReducedBasis
from beamsim.structures.damping import StatedParts, stated_parts
from beamsim.structures.reduction import static_deflections
from beamsim.structures.structure import Structure
from beamsim.structures.sturm import frequency_beyond
from beamsim.typing import Complexes, Floats


@dataclass(frozen=True)
class ReceptanceBound:
    """Largest errors of the reduced receptance, over the size of the receptances.

    0 where all modes are kept; infinite where the modes kept lack some below the highest of the frequencies; nan where
    round-off leaves that open. The size of a receptance is the geometric
    mean of those at its two places, each of which is its static compliance or, near resonances, its present amount.
    """

    loads: float  # between two loads
    probes: float | None  # between a load and a probe; None without probes


def receptance_bound(
    model: Structure, basis: ReducedBasis, damping: Floats, loads: Floats, probes: Floats, omega: Sequence[float] = ()
) -> ReceptanceBound:
    """Bounds up to the highest frequency that the reduction was made for, and at those of the excitation.

    Parameters
    ----------
    model, basis : full model and its reduced coordinates.
    damping : (n, n) C of the reduced model, 1/s.
    loads : (m, N) rows of contacts and forces, and the inertia load where the base moves.
    probes : (p, N) rows of what is observed only, of which the basis has no static vectors.
    omega : angular frequencies of the excitation, rad/s.

    Returns
    -------
    ReceptanceBound
        Relative errors of what the module's equation bounds.
    """
    acting, known = loads.shape[0], None if not len(probes) else 0.0
    parts = [(part.structure, part.dofs) for part in model.parts] or [(model, slice(None))]
    blocks = basis.blocks or ((basis, np.arange(basis.size)),)
    truncations = [
        LeftOut(structure, reduced, damping[np.ix_(columns, columns)], np.vstack([loads, probes])[:, dofs], acting)
        for (structure, dofs), (reduced, columns) in zip(parts, blocks, strict=True)
    ]
    if all(part.complete for part in truncations):
        return ReceptanceBound(0.0, known)
    static: Floats = np.asarray(sum(part.compliances / part.model.stiffness_scale for part in truncations))
    moved = static > 0
    if not moved[:acting].any():
        return ReceptanceBound(0.0, known)
    largest = np.zeros(moved.size)  # of each place and any load
    for frequency in np.concatenate([_frequencies(basis) * model.frequency_scale, omega]):
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


def _frequencies(basis: ReducedBasis) -> Floats:
    """Scaled frequencies of the bounds: up to the highest one, which decides without damping, and resonances."""
    highest, kept = basis.highest_frequency, basis.omega[: basis.modes]
    return np.unique(np.concatenate([kept[kept < highest], np.linspace(0, highest, 12)]))


@dataclass(frozen=True)
class LeftOut:
    """What a reduced basis leaves out of the response to m loads, in scaled units."""

    model: Structure
    basis: ReducedBasis
    damping: Floats  # (n, n) of the reduced model, 1/s
    loads: Floats  # (m, N)
    acting: int  # loads that the static vectors are made for, the first of them

    @property
    def complete(self) -> bool:
        """Whether nothing is left out."""
        return self.basis.modes == self.model.size

    @cached_property
    def compliances(self) -> Floats:
        """(m,) static compliance that each load meets, rigid-body motion apart; 0 where it causes only that."""
        strain = np.asarray(self.model.factor @ static_deflections(self.model, self.loads.T))
        compliance = np.sum(strain**2, axis=0)
        # a load with less of what its size would give moves the structure as a rigid body
        return np.where(compliance > 1e-24 * np.sum(self.loads**2, axis=1), compliance, 0.0)

    @cached_property
    def stated(self) -> StatedParts:
        """Damping of the full model."""
        return stated_parts(self.model, self.basis)

    @cached_property
    def modal_damping(self) -> Floats:
        """(n, n) what modal ratios give of the reduced model's C, scaled."""
        known = self.stated.known
        vectors = self.basis.vectors
        whole = self.damping / self.model.frequency_scale
        return whole if known is None else np.asarray(whole - vectors.T @ (known @ vectors))

    def _left_out(self, loads: Floats) -> Floats:
        """(N, c) static deflections under (N, c) loads without what kept modes make of them."""
        model, modes = self.model, self.basis.vectors[:, : self.basis.modes]
        u = static_deflections(model, loads - model.mass @ (modes @ (modes.T @ loads)))
        for _ in range(2):
            u = u - modes @ (modes.T @ (model.mass @ u))
        return u

    @cached_property
    def static(self) -> Floats:
        """(N, k) static vectors of the basis."""
        return self.basis.vectors[:, self.basis.modes :]

    @cached_property
    def flexibility(self) -> Floats:
        """(N, k) static deflections under the inertia of the static vectors, without the kept modes."""
        return self._left_out(self.model.mass @ self.static)

    @cached_property
    def strains(self) -> Floats:
        """(p, m + 2 k [+ n]) of what residuals are made of, orthogonally reduced: norms and products are kept.

        Columns: deflections under the loads, the static vectors, deflections under their inertia, and under the known
        damping of each coordinate.
        """
        columns = [self._left_out(self.loads.T), self.static, self.flexibility]
        if self.stated.known is not None:
            columns.append(self._left_out(self.stated.known @ self.basis.vectors))
        return np.asarray(np.linalg.qr(np.asarray(self.model.factor @ np.hstack(columns)), mode="r"))

    @cached_property
    def beyond(self) -> float:
        """Certified lower bound of the frequencies left out."""
        trial = np.hstack([self.static, self.flexibility])
        kept = self.basis.omega[: self.basis.modes]
        if not trial.shape[1]:
            trial = self._left_out(self.loads[: self.acting].T)
        bent = np.asarray(self.model.factor @ trial)
        moving = np.einsum("ij,ij->j", trial, self.model.mass @ trial)
        ritz = np.sqrt(np.sum(bent**2, axis=0)[moving > 0] / moving[moving > 0])
        return frequency_beyond(self.model, kept, float(ritz.min(initial=4 * max(kept[-1:], default=1.0))))

    @cached_property
    def _known_share(self) -> float:
        """A number c with C <= c K for the known damping in all motion that is left out."""
        return self.stated.share_of(self.model, self.beyond)

    @cached_property
    def _static_range(self) -> tuple[Floats, Floats]:
        """(k, k) lower and upper bound of S^T A^(1/2) S for the static vectors S, by Jensen's operator inequality."""
        inverse = self.static.T @ (self.model.mass @ self.flexibility)  # S^T A^-1 S
        values, vectors = np.linalg.eigh((inverse + inverse.T) / 2)
        upper = np.diag(self.basis.omega[self.basis.modes :])
        return (vectors / np.sqrt(np.maximum(values, np.finfo(float).tiny))) @ vectors.T, upper

    @cached_property
    def shapes(self) -> Floats:
        """(m, n) work of each load for a unit of each coordinate."""
        return np.asarray(self.loads @ self.basis.vectors)

    def errors(self, s: float, y: Complexes) -> Floats:
        """(m, m) bounds of the error of the receptance between the loads at scaled frequency s; y is the `response`."""
        if self.complete:
            return np.zeros((self.loads.shape[0],) * 2)
        stated, kept, beyond = self.stated, self.basis.modes, self.beyond
        if beyond <= s:
            return np.full((self.loads.shape[0],) * 2, np.inf)
        size = self._residual_sizes(s, y)
        coupling = self._known_share
        deviation: Floats | float = 0.0
        if stated.on_coordinates:
            within = self.modal_damping[kept:, kept:]
            coupling += float(np.linalg.norm(within, 2)) / beyond**2 if within.size else 0.0
        else:
            size = size + 2 * stated.highest * s * np.linalg.norm(y[kept:], axis=0)
            deviation = s * self._deviation(y[kept:])
        open_share, half = 1 - (s / beyond) ** 2, s * coupling / 2
        # open_share where damping couples nothing; sqrt(open_share^2 + half^2) - half without cancellation
        divisor = open_share**2 / (np.hypot(open_share, half) + half)
        return np.asarray(np.outer(size, size) / divisor + deviation)

    def response(self, s: float) -> Complexes:
        """(n, m) of the reduced model to the loads at scaled frequency s, just beside undamped modes' resonances."""
        damping = self.damping / self.model.frequency_scale
        own = self.basis.omega**2 - s**2 + 1j * s * damping.diagonal()
        own[np.abs(own) <= 1e-12 * s**2] = 1e-12 * s**2 + (s == 0.0)
        if np.count_nonzero(damping) == np.count_nonzero(damping.diagonal()):
            return np.asarray(self.shapes.T / own[:, None])
        impedance = 1j * s * damping
        np.fill_diagonal(impedance, own)
        return np.asarray(np.linalg.solve(impedance, self.shapes.T))

    def _residual_sizes(self, s: float, y: Complexes) -> Floats:
        """(m,) norms of the strains under the residuals of the loads, from the columns of `strains`."""
        count, static = self.loads.shape[0], y[self.basis.modes :]
        inertia = s**2 * static
        if self.stated.on_coordinates:
            inertia = inertia - 1j * s * (self.modal_damping @ y)[self.basis.modes :]
        rows = [-static, inertia]
        weights = np.vstack([*rows, -1j * s * y] if self.stated.known is not None else rows)
        # real and imaginary parts of all in one real product: a complex one would take the zeros of the strains as well
        parts = self.strains[:, count:] @ np.hstack([weights.real, weights.imag])
        parts[:, :count] += self.strains[:, :count]
        squares = np.sum(parts**2, axis=0)
        return np.asarray(np.sqrt(squares[:count] + squares[count:]))

    def _deviation(self, static: Complexes) -> Floats:
        """(m, m) bound of what the damping of the static vectors differs by from that of the modes they stand for."""
        kept = self.basis.modes
        if not static.size or self.stated.highest == 0.0:
            return np.zeros((static.shape[1],) * 2)
        lower, upper = self._static_range
        given = self.modal_damping[kept:, kept:]
        largest, least = given - 2 * self.stated.lowest * lower, given - 2 * self.stated.highest * upper
        middle, radius = (largest + least) / 2, (largest - least) / 2
        both = np.hstack([static.real, static.imag])
        within = np.sum(both * (radius @ both), axis=0).reshape(2, -1)  # radius is symmetric
        size = np.sqrt(np.maximum(within.sum(axis=0), 0.0))
        real, imag = np.hsplit(middle @ both, 2)
        return np.asarray(np.abs(static.T @ (real + 1j * imag)) + np.outer(size, size))
