r"""Error of the reduced model, as one number.

The reduced and the full model are compared in the two linear states "every contact open" and "every contact closed".
The error is the largest relative difference in the dynamic receptance at the contacts, in the response to the
excitation (both at the excitation frequencies), and in the closed natural frequencies up to the highest frequency of
interest. The kept modes are common to both models, so only the part outside their span is computed, with one sparse
solve per frequency. The receptance of the full model in the M-complement of the kept modes is

.. math:: (K - \omega^2 M)^{-1} (I - M \Phi \Phi^T) f,

which stays regular at the resonances of the kept modes. The damping of this part is neglected, because its resonances
are far above the excitation frequencies.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.structures.modes import DENSE_LIMIT, LARGE, closed_frequencies
from beamsim.structures.reduction import static_deflections
from beamsim.typing import Complexes, Floats

if TYPE_CHECKING:
    from beamsim.structures.basis import ReducedBasis
    from beamsim.structures.structure import Structure

Complex = Complexes

# Above this size the closed modes of the full model are not computed anew.
_VERY_LARGE = 20_000
_DEPENDENT = 1e-12
_SOLVES = 30  # that replace a factorisation of a large model at most
_CONVERGED = 1e-10


@dataclass(frozen=True)
class LinearState:
    """Contacts, outputs and excitation of the comparison; rows act on the dofs of the full model."""

    contact_rows: Floats  # (m, N)
    stiffness: Floats  # (m,) N/m
    dashpot: Floats  # (m,) N s/m
    output_rows: Floats  # (o, N) where responses are compared, besides the contacts
    loads: Floats  # (L, N) scaled excitation patterns
    omega: tuple[float, ...]  # excitation frequencies, rad/s


def reduction_error(model: Structure, basis: ReducedBasis, damping: Floats, state: LinearState) -> float:
    """Largest relative difference between the reduced and the full linear models (0 if all modes are kept).

    Parameters
    ----------
    model, basis : full model and reduced basis.
    damping : (n, n) C of the reduced model, 1/s.
    state : contacts, outputs, excitation.
    """
    if basis.modes == model.size:
        return 0.0
    errors = [_frequency_error(model, basis, state)]
    errors += [_response_error(model, basis, damping, state, omega) for omega in state.omega]
    return float(max(errors))


def _response_error(model: Structure, basis: ReducedBasis, damping: Floats, state: LinearState, omega: float) -> float:
    m = state.stiffness.size
    outputs = np.vstack([state.contact_rows, state.output_rows])
    loads = np.vstack([state.contact_rows, state.loads]).T
    if outputs.size == 0 or loads.size == 0:
        return 0.0
    s = omega / model.frequency_scale
    if np.any(np.abs(s - basis.omega) <= 1e-9 * s):
        s *= 1 + 1e-6  # at an undamped resonance both responses are infinite: compare next to it
    v = basis.vectors
    impedance = np.diag(basis.omega**2 - s**2) + 1j * s * damping / model.frequency_scale
    reduced = np.asarray((outputs @ v) @ np.linalg.solve(impedance, v.T @ loads), dtype=complex)

    phi, static = v[:, : basis.modes], v[:, basis.modes :]
    outside = _complement_response(model, phi, loads, s)
    known = static @ ((static.T @ loads) / (basis.omega[basis.modes :] ** 2 - s**2)[:, None])
    full = np.asarray(reduced + outputs @ (outside - known), dtype=complex)

    spring = np.asarray(np.diag((state.stiffness + 1j * omega * state.dashpot) / model.stiffness_scale), dtype=complex)
    error = _difference(full, reduced)
    if m:
        error = max(error, _difference(_close(full, spring), _close(reduced, spring)))
    return error


def _complement_response(model: Structure, phi: Floats, loads: Floats, s: float) -> Floats:
    """Undamped response at scaled frequency s in the complement of the kept modes."""
    forced = loads - model.mass @ (phi @ (phi.T @ loads))
    if model.size > LARGE:
        found = _refined_response(model, phi, forced, s)
        if found is not None:
            return found
    x = np.asarray(model.factorise(model.stiffness - s**2 * model.mass).solve(forced))
    return np.asarray(x - phi @ (phi.T @ (model.mass @ x)))


def _refined_response(model: Structure, phi: Floats, forced: Floats, s: float) -> Floats | None:
    """The same from static deflections alone, without other factors; None where that does not converge soon.

    What is left falls by the square of s over the lowest frequency left out with each solve.
    """
    x = np.zeros(forced.shape)
    for _ in range(_SOLVES):
        left = forced - model.stiffness @ x + s**2 * (model.mass @ x)
        step = static_deflections(model, left, refinements=0)
        step = step - phi @ (phi.T @ (model.mass @ step))
        x = x + step
        if np.all(np.abs(step).max(axis=0) <= _CONVERGED * np.abs(x).max(axis=0)):
            return np.asarray(x)
    return None


def _close(receptance: Complex, spring: Complex) -> Complex:
    """Receptance (outputs, inputs) with the springs closed; the first m outputs and inputs are the contacts."""
    m = spring.shape[0]
    at_contacts = np.linalg.solve(np.eye(m) + receptance[:m, :m] @ spring, receptance[:m])
    return receptance - receptance[:, :m] @ spring @ at_contacts


def _difference(full: Complex, reduced: Complex) -> float:
    """Largest difference over the outputs relative to the largest output, for the worst input."""
    size = np.abs(full).max(axis=0)
    return float(np.max(np.abs(full - reduced).max(axis=0) / np.where(size > 0, size, 1.0)))


def _frequency_error(model: Structure, basis: ReducedBasis, state: LinearState) -> float:
    """Natural frequencies with every contact closed, up to the highest frequency of interest."""
    if state.stiffness.size == 0:
        return 0.0
    stiffness = state.stiffness / model.stiffness_scale
    reduced = closed_frequencies(basis.omega, state.contact_rows @ basis.vectors, stiffness, basis.rigid)
    of_interest = reduced <= basis.highest_frequency
    rigid = int(np.sum(reduced == 0))
    count = int(of_interest.sum())
    if count <= rigid:
        return 0.0
    full = _full_closed(model, basis, state.contact_rows, stiffness, count)
    return float(np.max(np.abs(full[rigid:count] / reduced[rigid:count] - 1)))


def _full_closed(model: Structure, basis: ReducedBasis, rows: Floats, stiffness: Floats, count: int) -> Floats:
    """The lowest `count` scaled frequencies of the full model with springs added."""
    from scipy.linalg import solve_triangular, svdvals
    from scipy.sparse import csc_array, vstack

    springs = rows * np.sqrt(stiffness)[:, None]
    if model.size <= DENSE_LIMIT:
        lower = np.linalg.cholesky(model.mass.toarray())
        factor = np.vstack([model.factor.toarray(), springs])
        values = svdvals(solve_triangular(lower, factor.T, lower=True).T)
        # Fewer rows than columns: the missing singular values are rigid-body modes.
        return np.concatenate([np.zeros(model.size - values.size), values[::-1]])[:count]
    if model.size > _VERY_LARGE:
        return _enriched_closed(model, basis, springs)[:count]
    factor_sparse: Any = vstack([model.factor, csc_array(springs)], format="csc")
    vectors = _closed_modes(model, csc_array(springs), count)
    lower = np.linalg.cholesky(vectors.T @ (model.mass @ vectors))
    ritz = svdvals(solve_triangular(lower, np.asarray(factor_sparse @ vectors).T, lower=True).T)
    return np.asarray(ritz[::-1])


def _enriched_closed(model: Structure, basis: ReducedBasis, springs: Floats) -> Floats:
    """Closed frequencies in the reduced coordinates and the deflections under the inertia of the static vectors.

    These carry the next power of the frequency, and cost one solve for each static vector.
    """
    added = static_deflections(model, model.mass @ basis.vectors[:, basis.modes :])
    for _ in range(2):  # orthonormal, and to the basis; what depends on the others is dropped
        added = added - basis.vectors @ (basis.vectors.T @ (model.mass @ added))
        moving, y = np.linalg.eigh(added.T @ (model.mass @ added))
        apart = moving > _DEPENDENT * moving[-1:]
        added = added @ (y[:, apart] / np.sqrt(moving[apart]))
    stretch = springs @ np.hstack([basis.vectors, added])
    closed = stretch.T @ stretch
    size = basis.size
    closed[:size, :size] += np.diag(basis.omega**2)
    force = np.asarray(model.stiffness @ added)
    beside = basis.vectors.T @ force
    closed[:size, size:] += beside
    closed[size:, :size] += beside.T
    closed[size:, size:] += added.T @ force
    return np.asarray(np.sqrt(np.maximum(np.linalg.eigvalsh(closed), 0.0)))


def _closed_modes(model: Structure, springs: Any, count: int) -> Floats:
    """(N, count) the lowest modes of the full model with springs added."""
    from scipy.sparse.linalg import LinearOperator, eigsh

    closed: Any = model.stiffness + springs.T @ springs
    inverse = LinearOperator(model.mass.shape, matvec=model.factorise(closed + 1e-3 * model.mass).solve)
    start = np.linspace(1, 2, model.size)
    return np.asarray(eigsh(closed, k=count, M=model.mass, sigma=-1e-3, OPinv=inverse, v0=start)[1])
