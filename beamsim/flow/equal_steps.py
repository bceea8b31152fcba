r"""The march over very many pieces of the inputs that are equally long, by a product of a matrix and a vector for each.

On a whole piece of length h the state at its end, the free amplitudes and the watched functions are linear in the
amplitudes a of the inputs and in the state y at its start. A matrix made once for each contact state gives them all,

.. math:: (y(h),\ \mathrm{Re}\,\zeta,\ \mathrm{Im}\,\zeta,\ g(0),\ \dot g(0),\ g(h)) = M\,(a,\ y),

in place of some hundred exponentials and terms for each piece. Where these show that no watched function reaches zero
on the piece the motion goes on to the next one; else the certified search decides.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from beamsim.flow.basis import as_real, basis_derivatives, largest_curvature
from beamsim.flow.contact_state import ContactState
from beamsim.flow.sources import MANY_PIECES, Sources
from beamsim.flow.state_tables import pad
from beamsim.typing import Complexes, Floats

if TYPE_CHECKING:
    from beamsim.flow.march_kernels import PieceSteps

EPS = float(np.finfo(float).eps)


class PieceStep(NamedTuple):
    """A contact state over one piece: X = F + N numbers go in, R = N + 2 Z + 3 g come out."""

    matrix: Floats  # (X, R)
    curvature: Floats  # (F + Z, g) bound on that of the watched functions, for a unit of each amplitude
    doubt: Floats  # (F + Z, g) twice their round-off, likewise
    valid: bool  # whether the state's tables hold for a whole piece


def common_length(sources: Sources) -> float | None:
    """Length of most pieces, s; None where they are few or differ, or the inputs are not real polynomials."""
    if sources.start.size < MANY_PIECES or np.any(sources.exponent != 0) or np.any(sources.amplitude.imag != 0):
        return None
    length = np.diff(sources.start)
    equal = np.abs(length - float(np.median(length))) <= round_off(sources)
    return float(length[equal].mean()) if 2 * np.count_nonzero(equal) > length.size else None


def round_off(sources: Sources) -> float:
    """Difference of the lengths of two pieces that is round-off of the times of their ends, s."""
    return float(4.0 * EPS * sources.start[-1])


def step_of(state: ContactState, watch: Complexes, roughness: Floats, sources: Sources, length: float) -> PieceStep:
    """The step of a contact state over a piece.

    Parameters
    ----------
    state : the contact state.
    watch, roughness : (T, g) coefficients of its guards, and their round-off scale.
    sources : of the loads.
    length : s, of the piece.
    """
    F, Z, of_term = sources.count, state.projector.shape[0], state.term_basis
    start = basis_derivatives(state.exponent, state.power, 0.0, 2)[:, of_term, None]
    end = basis_derivatives(state.exponent, state.power, length, 1)[0, of_term, None]
    amplitude = np.delete(state.amplitude_map(), np.arange(1, 2 * F, 2), axis=0)  # (X, F + Z): the inputs are real
    free = amplitude[:, F:]
    outputs = (
        as_real(amplitude) @ state.of_amplitudes(of_terms)
        for of_terms in (end * state.term_vector, start[0] * watch, start[1] * watch, end * watch)
    )
    of_state, *of_watched = outputs
    size, power = np.abs(watch), state.power[of_term, None]
    bend = largest_curvature(state.exponent, state.power, length)[of_term, None] * size
    curvature, doubt = np.zeros((F + Z, watch.shape[1])), np.zeros((F + Z, watch.shape[1]))
    np.add.at(curvature, state.term_source, bend)
    np.add.at(doubt, state.term_source, 8.0 * EPS * length**power * roughness + 16.0 * EPS * size * (power == 0))
    matrix = np.concatenate([of_state, free.real, free.imag, *of_watched], axis=1)
    return PieceStep(matrix, curvature, doubt, state.horizon >= length)


def as_arrays(steps: list[PieceStep], sources: Sources, length: float) -> PieceSteps:
    """Steps side by side, as the march takes them.

    Parameters
    ----------
    steps : of the contact states, in their order.
    sources : of the loads.
    length : s, of a piece.
    """
    from beamsim.flow.march_kernels import PieceSteps

    return PieceSteps(
        pad([step.matrix for step in steps]), pad([step.curvature for step in steps]),
        pad([step.doubt for step in steps]), np.array([step.valid for step in steps]),
        np.array([step.matrix.shape[1] for step in steps]),
        np.array([step.curvature.shape[1] for step in steps]), length, round_off(sources),
    )  # fmt: skip
