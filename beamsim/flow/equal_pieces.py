r"""Motions of very many equal pieces (random and sampled inputs), evaluated together.

At one time :math:`\tau` after their start, segments of one contact state differ in their amplitudes :math:`\zeta`
alone: an output is the same linear function of these on all of them. A matrix made once replaces exponentials for each.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby
from typing import Protocol

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.flow.basis import as_real
from beamsim.flow.exact import ExactFlow
from beamsim.flow.sources import MANY_PIECES
from beamsim.flow.stopping import check_stop
from beamsim.typing import Bools, Complexes, Floats, Ints

FEWEST = 64  # fewest like segments for which a matrix pays
FEWEST_SAMPLES = 24  # ... of outputs at one time, for which it is made faster than for integrals or bounds
AT_ONCE = 8192  # segments of one product of matrices, which bounds the memory
VALUES_AT_ONCE = 200_000  # of terms times outputs, at several times


class Segments(Protocol):
    """Segments of closed-form motion in order of time, see `beamsim.flow.trajectory.Trajectory`."""

    @property
    def flow(self) -> ExactFlow:
        """Its contact states."""

    @property
    def end(self) -> float:
        """s, reached."""

    @property
    def time(self) -> Floats:
        """(S,) s, starts."""

    @property
    def length(self) -> Floats:
        """(S,) s."""

    @property
    def state(self) -> Ints:
        """(S,) contact states."""

    @property
    def piece(self) -> Ints:
        """(S,) of the sources."""

    @property
    def y(self) -> Floats:
        """(S, N) state at the start."""


@dataclass(frozen=True)
class Alike:
    """Entries of a list of segments and times after their starts that share contact state and time."""

    state: int
    tau: float  # s
    entries: Ints


def many_pieces(motion: Segments) -> bool:
    """Whether a motion has so many pieces that looking for equal ones pays."""
    return not motion.flow.dropped and min(motion.flow.sources.start.size, motion.time.size) >= MANY_PIECES


def whole_pieces(motion: Segments, segments: Ints | slice = slice(None)) -> Bools:
    """Whether segments begin with a piece of the inputs, so that their sources are those of the piece."""
    return np.asarray(motion.time[segments] == motion.flow.sources.start[motion.piece[segments]])


def alike(motion: Segments, segment: Ints, tau: Floats, fewest: int = FEWEST) -> tuple[list[Alike], Ints]:
    """Entries (segment, time tau after its start) in groups of no less than some, and the entries outside of groups.

    Times are equal if they differ by no more than the round-off of the time at the end of the motion.
    """
    whole = np.flatnonzero(whole_pieces(motion, segment))
    state, tau_of_whole = motion.state[segment[whole]], tau[whole]
    order = np.lexsort((tau_of_whole, state))
    sorted_tau = tau_of_whole[order]
    same = (np.diff(state[order]) == 0) & (np.diff(sorted_tau) <= 4.0 * np.finfo(float).eps * motion.end)
    begin = np.concatenate([[0], np.flatnonzero(~same) + 1]) if whole.size else np.zeros(0, dtype=np.int64)
    size = np.diff(np.append(begin, whole.size))
    groups = []
    for first, count in zip(begin[size >= fewest], size[size >= fewest], strict=True):
        part, at = order[first : first + count], sorted_tau[first : first + count]
        groups.append(Alike(int(state[part[0]]), float(np.mean(at)), np.sort(whole[part])))
    single = np.ones(segment.size, dtype=bool)
    for group in groups:
        single[group.entries] = False
    return groups, np.flatnonzero(single)


def blocks(group: Alike) -> Iterator[Ints]:
    """The entries of a group, some at a time."""
    for first in range(0, group.entries.size, AT_ONCE):
        check_stop()
        yield group.entries[first : first + AT_ONCE]


def output_map(motion: Segments, state: int, basis: Complexes, table: Complexes) -> Floats:
    """(..., 2 Z, k) outputs for a unit of each amplitude, see `as_real`.

    Parameters
    ----------
    basis : (..., B) of the contact state, at one or several times.
    table : (T', k) of the contact state's terms, padded.
    """
    tables = motion.flow.states[state]
    return tables.of_amplitudes(basis[..., tables.term_basis, None] * table[: tables.term_basis.size])


def _basis(motion: Segments, state: int, tau: float | Floats) -> Complexes:
    """(..., B) at one or several times (...)."""
    tables, at = motion.flow.states[state], np.asarray(tau)[..., None]
    return np.asarray(at**tables.power * np.exp(tables.exponent * at))


def sample_alike(motion: Segments, times: Floats, table: Complexes, out: Floats) -> Ints:
    """Outputs at increasing times of which many are alike, into ``out`` (nt, k); returns the numbers of the others."""
    segment = np.clip(np.searchsorted(motion.time, times, side="right") - 1, 0, None)
    groups, single = alike(motion, segment, times - motion.time[segment], FEWEST_SAMPLES)
    for number, of_state in groupby(groups, key=lambda group: group.state):
        amplitude_of = as_real(motion.flow.states[number].amplitude_map())
        for group, outputs in _output_maps(motion, list(of_state), table[number]):
            matrix = amplitude_of @ outputs
            for part in blocks(group):
                at = segment[part]
                given = as_real(motion.flow.sources.amplitude[motion.piece[at]])
                out[part] = np.concatenate([given, motion.y[at]], axis=1) @ matrix
    return single


def _output_maps(motion: Segments, groups: list[Alike], table: Complexes) -> Iterator[tuple[Alike, Floats]]:
    """Groups of one contact state, each with its `output_map`; those of many times are made together."""
    together = max(1, VALUES_AT_ONCE // table.size)
    for first in range(0, len(groups), together):
        some = groups[first : first + together]
        basis = _basis(motion, some[0].state, np.array([group.tau for group in some]))
        yield from zip(some, output_map(motion, some[0].state, basis, table), strict=True)
