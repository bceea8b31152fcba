r"""Motions of one system, each under harmonic loads of its own, evaluated together.

In a contact state the motions differ in the exponents and the shapes of what the loads force; the free motion is a sum
of the same functions of time. Values of all segments in a state are therefore products of arrays: extremes, Fourier
integrals :math:`\int x(t) e^{-i \omega (t - t_0)} dt`, and integrals of products of outputs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from beamsim.flow.contact_state import ContactState
from beamsim.flow.exact import ExactFlow
from beamsim.flow.extrema import PARTS_AT_ONCE, Sums, search_extrema
from beamsim.flow.moments import exponential_moments
from beamsim.flow.periodic_flow import FlowMap
from beamsim.inputs.signal import Sources
from beamsim.outcomes import check_stop
from beamsim.system.equations import ChannelSet, RowsOf
from beamsim.typing import Bools, Complexes, Floats, Ints

VALUES_AT_ONCE = 1_000_000  # of integrals, which bounds the memory


class _SegmentsInState(NamedTuple):
    """S segments in one contact state, of J motions in which it has the same T terms of B functions."""

    state: ContactState  # under the loads of one of the motions
    vector: Complexes  # (J, T, N) of the terms
    exponent: Complexes  # (J, B) of the functions
    source_exponent: Complexes  # (J, F) exponents of the sources
    motion: Ints  # (S,) which of the J motions
    segment: Ints  # (S,) numbers among all segments
    amplitude: Complexes  # (S, T) of the terms
    noise: Floats  # (S, T) round-off of the amplitudes

    def part(self, rows: slice | Bools) -> _SegmentsInState:
        """Some of the segments."""
        return self._replace(
            motion=self.motion[rows], segment=self.segment[rows], amplitude=self.amplitude[rows], noise=self.noise[rows]
        )

    def coefficients(self, rows: Floats) -> Complexes:
        """(J, T, K) factors of the terms in outputs with rows (K, V)."""
        y, inputs, slopes = np.split(rows, np.cumsum([self.vector.shape[2], self.source_exponent.shape[1]]), axis=1)
        table = self.vector @ y.T
        table[:, self.state.terms_of_sources[0]] += inputs.T + self.source_exponent[:, :, None] * slopes.T
        return table

    def integrals(self, length: Floats, weight: Complexes, power: Ints) -> Complexes:
        r"""Integrals :math:`\int_0^L \tau^{p + q} e^{(\lambda + \mu) \tau} d\tau` of the functions times W weights.

        Parameters
        ----------
        length : (S,) L, s.
        weight, power : exponents mu (S, W), 1/s, and powers q (W,) of the weights.

        Returns
        -------
        (S, B, W) integrals; those of functions without amplitude, which may grow without bound, are of another one.
        """
        of_terms = self.state.term_basis[:, None] == np.arange(self.exponent.shape[1])
        acts = (self.amplitude != 0.0).astype(float) @ of_terms > 0.0
        rate = np.where(acts, self.exponent[self.motion], 0.0)[:, :, None] + weight[:, None, :]
        degree = self.state.power[:, None] + power
        moments = exponential_moments(rate * length[:, None, None], int(degree.max()))
        every = np.take_along_axis(moments, np.broadcast_to(degree[..., None], (*rate.shape, 1)), axis=3)[..., 0]
        return np.asarray(every * length[:, None, None] ** (degree + 1))


class HarmonicMotions:
    """M motions of one system, each under harmonic loads of its own.

    Parameters
    ----------
    flow : of the system, under loads that differ from theirs in their signals alone.
    maps : the motions.
    sources : of the loads of each, of one piece without powers of time, see `ExactFlow.sources_under`.
    """

    def __init__(self, flow: ExactFlow, maps: Sequence[FlowMap], sources: Sequence[Sources]) -> None:
        self.flow, self.maps, count = flow, maps, [each.time.size for each in maps]
        self.motion: Ints = np.repeat(np.arange(len(maps)), count)  # of each segment
        self.first = np.cumsum([0, *count])[:-1]  # segment of each motion
        self.time, self.length = (np.concatenate([getattr(m, name) for m in maps]) for name in ("time", "length"))
        self.y, self.phases = np.concatenate([m.y for m in maps]), np.concatenate([m.phases for m in maps])
        self.duration = np.array([each.duration for each in maps])
        self._exponent = np.array([each.exponent for each in sources])
        self._amplitude = np.array([each.amplitude[0] for each in sources])
        self._groups = list(self._groups_of_segments(sources))

    def inputs(self, motion: Ints, time: Floats) -> Complexes:
        """(n, F) amplitudes of the sources of motions (n,) at times (n,), s."""
        return np.asarray(self._amplitude[motion] * np.exp(self._exponent[motion] * time[:, None]))

    def _groups_of_segments(self, sources: Sequence[Sources]) -> Iterator[_SegmentsInState]:
        latest: dict[bytes, ContactState] = {}  # by the phases
        visits: dict[tuple[bytes, int], dict[int, ContactState]] = {}  # by phases and list of terms, then by motion
        segments: dict[tuple[bytes, int], list[int]] = {}
        for first, each, own in zip(self.first.tolist(), self.maps, sources, strict=True):
            number, seen = int(self.motion[first]), dict[bytes, ContactState]()
            for segment, phases in enumerate(each.phases, first):
                key = phases.tobytes()
                if key not in seen:
                    known = latest.get(key) or self.flow.states[self.flow.state_index(phases)]
                    seen[key] = latest[key] = known.with_loads(own)
                group = key, id(seen[key].term_basis)
                visits.setdefault(group, {})[number] = seen[key]
                segments.setdefault(group, []).append(segment)
        given = self.inputs(self.motion, self.time)
        for group, states in visits.items():
            at = np.array(segments[group])
            numbers, members = np.array([*states]), [*states.values()]
            state, of = members[0], np.searchsorted(numbers, self.motion[at])
            forced = np.array([each.forced_at_start for each in members])
            y, projector = self.y[at], state.projector.T
            free = y - (given[at, None] @ forced[of])[:, 0].real
            size = np.abs(y) + (np.abs(given[at, None]) @ np.abs(forced)[of])[:, 0]
            noise = np.finfo(float).eps * size @ np.abs(projector)
            yield _SegmentsInState(
                state, np.array([each.term_vector for each in members]),
                np.array([each.exponent for each in members]), self._exponent[numbers], of, at,
                np.hstack([given[at], free @ projector])[:, state.term_source],
                np.hstack([np.zeros((at.size, given.shape[1])), noise])[:, state.term_source],
            )  # fmt: skip

    def _shares(self, width: int) -> Iterator[_SegmentsInState]:
        """All segments, no more at once than the memory has room for with so many values for each function."""
        for group in self._groups:
            rows = max(1, VALUES_AT_ONCE // (group.exponent.shape[1] * width))
            for first in range(0, group.motion.size, rows):
                check_stop()
                yield group.part(slice(first, first + rows))

    def extrema(self, rows_of: RowsOf, squares: Ints | None = None) -> tuple[Floats, Floats]:
        """Largest and smallest values of K outputs over each motion, see `Trajectory.extrema`.

        Parameters
        ----------
        rows_of : the outputs, by the phases of the contacts.
        squares : (j,) first of each group of consecutive outputs, where half the sums of their squares are asked for.

        Returns
        -------
        high, low : (M, K), or (M, j).
        """
        lasts = (self.length > 0.0) | (not self.flow.system.contacts.any_sticks_rigidly)

        def sums() -> Iterator[Sums]:
            for group in self._groups:
                state, lasting, table = group.state, group.part(lasts[group.segment]), None
                for first in range(0, lasting.motion.size, PARTS_AT_ONCE):
                    some = lasting.part(slice(first, first + PARTS_AT_ONCE))
                    table = group.coefficients(rows_of(state.phases)) if table is None else table
                    unit = np.ones(some.motion.size)
                    place = np.stack([0.0 * unit, unit, self.time[some.segment], self.length[some.segment]])
                    yield Sums(
                        group.exponent[some.motion], state.power, state.term_basis, some.amplitude, some.noise,
                        table[some.motion], place, self.motion[some.segment],
                    )  # fmt: skip

        outputs = rows_of(self.flow.system.contacts.start).shape[0]
        found = search_extrema(sums(), outputs, len(self.maps), squares)
        return found.high, found.low

    def channel_extrema(self, channels: ChannelSet, linear: RowsOf, squared: RowsOf) -> tuple[Floats, Floats]:
        """(M, C) largest and smallest values of channels, from the rows of linear ones and of energies."""
        ends = [self.extrema(linear)]
        if channels.squares.size:
            ends.append(self.extrema(squared, channels.squares))
        high, low = (np.hstack(values)[:, channels.order] for values in zip(*ends, strict=True))
        return high, low

    def fourier_integrals(self, rows_of: RowsOf, omega: Floats) -> Complexes:
        """(M, K, W) Fourier integrals of K outputs over each motion, at frequencies (M, W) of each, rad/s."""
        outputs, W = rows_of(self.flow.system.contacts.start).shape[0], omega.shape[1]
        out, none = np.zeros((len(self.maps), outputs, W), dtype=complex), np.zeros(W, dtype=np.int64)
        for group in self._shares(2 * W):
            of, at, basis = group.motion, group.segment, group.state.term_basis
            factors = 0.5 * group.amplitude[:, :, None] * group.coefficients(rows_of(group.state.phases))[of]
            turning: Complexes = np.asarray(-1j * omega[self.motion[at]], dtype=complex)
            elapsed = self.time[at] - self.time[self.first[self.motion[at]]]
            own, other = (group.integrals(self.length[at], rate, none)[:, basis] for rate in (turning, -turning))
            values = factors.swapaxes(1, 2) @ own + factors.conj().swapaxes(1, 2) @ other.conj()
            np.add.at(out, self.motion[at], values * np.exp(turning * elapsed[:, None])[:, None])
        return out

    def product_integrals(self, left_of: RowsOf, right_of: RowsOf, weight: Floats) -> Floats:
        """(M, Q) integrals over each motion of ``sum_k weight[k, q] left_k right_k``, of outputs by the phases."""
        out = np.zeros((len(self.maps), weight.shape[1]))
        for group in self._shares(2 * max(each.exponent.shape[1] for each in self._groups)):
            state, of, at = group.state, group.motion, group.segment
            left, right, basis = left_of(state.phases), right_of(state.phases), state.term_basis
            acting = np.flatnonzero(left.any(axis=1) & right.any(axis=1))  # open contacts have no force
            one, other = (group.amplitude[:, :, None] * group.coefficients(x[acting])[of] for x in (left, right))
            rate, length = np.where(group.amplitude != 0.0, group.exponent[of][:, basis], 0.0), self.length[at]
            total = np.zeros((at.size, acting.size))
            for weights, factors in ((rate, other), (rate.conj(), other.conj())):
                moments = group.integrals(length, weights, state.power[basis])[:, basis]
                total += 0.5 * (one * (moments @ factors)).sum(axis=1).real
            np.add.at(out, self.motion[at], total @ weight[acting])
        return out

    def event_losses(self) -> Floats:
        """(M,) energy that contacts lose at once at the events of each motion, J."""
        contacts, change = self.flow.system.contacts, np.delete(np.arange(1, self.time.size), self.first[1:] - 1)
        before, after, out = self.phases[change - 1], self.phases[change], np.zeros(len(self.maps))
        losses = contacts.event_losses(before, after).sum(axis=1)
        if contacts.pressed_contacts.size:
            given = self.inputs(self.motion[change], self.time[change])
            z = np.hstack([self.y[change], given.real, (given * self._exponent[self.motion[change]]).real])
            pressing = np.array([self.flow.at(of).normal_force @ each for of, each in zip(after, z, strict=True)])
            losses += (contacts.pressing_losses(before, after) * pressing.reshape(change.size, -1) ** 2).sum(axis=1)
        np.add.at(out, self.motion[change], losses)
        return out

    def contact_share(self) -> Floats:
        """(M, m) share of the time during which each contact touches."""
        touching = self.flow.system.contacts.closed(self.phases) * self.length[:, None]
        return np.asarray(np.add.reduceat(touching, self.first) / np.add.reduceat(self.length, self.first)[:, None])
