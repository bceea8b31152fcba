"""The exact flow: a system under its forcing, with its contact states built as they are visited."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from beamsim.contacts.laws import INTERNAL
from beamsim.flow.contact_state import ContactState
from beamsim.flow.invariant_blocks import LEAST_COORDINATES
from beamsim.flow.kernels import Inputs, Tables
from beamsim.flow.sources import Sources, compile_sources, sources_of_pieces
from beamsim.flow.state_tables import (
    HIGHEST_DERIVATIVE,
    ROUND_OFF,
    USUAL_DERIVATIVE,
    InputsAtStart,
    StateTables,
    first_signs,
)
from beamsim.inputs.signal import CubicRecord, Signal, common_record
from beamsim.system.equations import Forcing, PiecewiseLinearSystem
from beamsim.system.state_equations import Equations, EventFunctions, RowsOf, StateEquations
from beamsim.typing import Bools, Complexes, Floats, Ints

LONGEST_WINDOW_RADIANS = 64.0  # of the slowest oscillation, before the series of a segment are started anew


def states_in_memory(system: PiecewiseLinearSystem, memory: float) -> int:
    """Number of contact states whose tables fit into ``memory`` bytes."""
    N, functions = 2 * system.size + system.contacts.internal_states, 2 * system.contacts.count
    return max(8, int(memory / (56.0 * N * N + 40.0 * N * functions)))


def same_at_rest(a: PiecewiseLinearSystem, b: PiecewiseLinearSystem) -> bool:
    """Whether two systems differ in nothing but the forces of their contacts while these act."""
    parts = [
        (s.stiffness, s.damping, s.constant_load, s.contacts.shape, s.contacts.gap, s.contacts.base_influence,
         s.contacts.arrays.guard)
        for s in (a, b)
    ]  # fmt: skip
    return all(map(np.array_equal, *parts))


class StartOfMotion(NamedTuple):
    """Contacts at the start of a motion.

    Before it a contact was in the phase that its law has for the state there; where a guard is zero, what follows is
    decided by the motion. A contact is made at the start if it did not touch before and does after. One whose face is
    where the structure has pressed it to, with or without a force, touched before.
    """

    before: Ints  # (m,) phases before the start
    phases: Ints  # (m,)
    made: Bools  # (m,) whether contact is made at this very time
    state: Floats  # (N,) with the internal states of contacts that were in other phases before


@dataclass
class ExactFlow:
    """A system under its forcing, with the contact states diagonalised so far.

    Where a motion visits more states than are kept at once, the least recently used are dropped, and built again when
    they are needed: ``states`` are those that are there, ``visited`` the phases of all. The two have the same order
    until the first is dropped.

    Parameters
    ----------
    system, forcing : the structure and its loads.
    duration : longest time the flow will be asked for, s.
    observers : further signals (the base's motion) that outputs may contain; they load nothing.
    most_states : states kept at once, 2 at least; by default all.
    pieces : first and last (left out) of those of a record of which all signals are made; by default all pieces of
        the signals. Others follow with `on_pieces`.
    """

    system: PiecewiseLinearSystem
    forcing: Forcing
    duration: float
    observers: tuple[Signal, ...] = ()
    most_states: int | None = None
    pieces: tuple[int, int] | None = None
    sources: Sources = field(init=False)
    base_channel: int = field(init=False)
    influence: Floats = field(init=False)  # (channels, m) displacement of each contact's place from its stand by a unit
    equations: Equations = field(init=False)  # shared with flows under other loads
    states: list[ContactState] = field(init=False)  # those that are kept
    visited: list[Ints] = field(init=False)  # phases of all states visited

    def __post_init__(self) -> None:
        self._load()
        self._write_equations()
        slowest = self.system.stiffness[self.system.stiffness > 0]
        period = LONGEST_WINDOW_RADIANS / float(np.sqrt(slowest.min())) if slowest.size else np.inf
        self.longest_window = min(period, max(self.duration, 1e-300))
        self._clear()

    def _load(self) -> None:
        """Put the channels of the forcing and of the observers together."""
        channels = list(self.forcing.signal)
        self.base_channel = -1
        if self.forcing.base_displacement is not None and bool(self.system.contacts.on_ground.any()):
            self.base_channel = len(channels)
            channels.append(self.forcing.base_displacement)
        self.first_observer = len(channels)
        channels.extend(self.observers)
        self._channels = tuple(channels)
        self.influence = np.zeros((len(channels), self.system.contacts.count))
        if self.forcing.influence is not None:
            self.influence[: len(self.forcing.signal)] = self.forcing.influence.T
        if self.base_channel >= 0:
            self.influence[self.base_channel] = self.system.contacts.base_influence
        record = self.record
        if record is None:
            self.sources = compile_sources(self._channels, self.duration)
        else:
            self.sources = sources_of_pieces(self._channels, *(self.pieces or (0, record.pieces)), self.duration)
        self._inputs: Inputs | None = None

    def _write_equations(self) -> None:
        self.equations = Equations(self.system, self.forcing.load, self.influence, self.sources.channel)

    def _clear(self, like: StateTables | None = None) -> None:
        """Remove all states; tables get the sizes of others."""
        self.largest_exponent = 0.0  # 1/s, of all states visited
        self.highest_frequency = 0.0  # rad/s, of all states visited
        self._tables = StateTables(self.system.contacts, self.most_states, like)
        self.states, self.visited = self._tables.states, self._tables.visited

    @property
    def record(self) -> CubicRecord | None:
        """That of which all signals are made, whose pieces can be taken in parts; None where they are not."""
        return common_record(self._channels)

    def on_pieces(self, first: int, last: int) -> ExactFlow:
        """The same flow, which shares its contact states, with other pieces of the record."""
        flow = copy(self)
        flow.pieces = first, last
        flow.sources = sources_of_pieces(self._channels, first, last, self.duration)
        flow._inputs = None
        return flow

    def under(
        self, forcing: Forcing, observers: tuple[Signal, ...] | None = None, duration: float | None = None
    ) -> ExactFlow:
        """The same flow under other loads, with the contact states that were used, whose modes are shared.

        Where only amplitudes differ, the responses to the loads are shared, too.

        Parameters
        ----------
        forcing : differs in its signals alone; what each load acts on stays as it is.
        observers : signals in place of those of this flow; the same by default.
        duration : s, in place of that of this flow.

        Returns
        -------
        ExactFlow
            With sources of its own.
        """
        flow = copy(self)
        flow.forcing = forcing
        flow.observers = self.observers if observers is None else observers
        flow.duration = self.duration if duration is None else duration
        flow._load()
        if flow.sources.respond_as(self.sources):
            return flow
        if not np.array_equal(flow.sources.channel, self.sources.channel):
            flow._write_equations()
            flow._clear()
            return flow
        flow._clear(self._tables)
        for index in self._tables.used:  # its motions will visit these
            flow._append(self.states[index].under(flow.sources))
        flow._tables.lead_as(self._tables)
        return flow

    def with_system(self, system: PiecewiseLinearSystem) -> ExactFlow:
        """The same flow of a structure with other contacts of as many phases, with the contact states that were used.

        Those in which neither system's contacts act are shared.
        """
        flow = replace(self, system=system)
        flow._clear(self._tables)
        share = flow.longest_window == self.longest_window and same_at_rest(self.system, system)
        for state in [self.states[index] for index in self._tables.used]:
            inert = share and not (self.system.acts(state.phases) or system.acts(state.phases))
            flow._append(state if inert else flow._new_state(state.phases))
        flow._tables.lead_as(self._tables)
        return flow

    @property
    def dropped(self) -> bool:
        """Whether states were visited that are not kept any more."""
        return len(self.visited) > len(self.states)

    def visits(self, states: Ints) -> Ints:
        """Numbers, among all states visited, of states that are kept and were used in this order."""
        return self._tables.visits(states)

    def visited_state(self, number: int) -> ContactState:
        """A state by its number among all visited; one that was dropped is built again, and not kept."""
        if not self.dropped:
            return self.states[number]
        kept = self._tables.index(self.visited[number])
        return self._new_state(self.visited[number]) if kept is None else self.states[kept]

    def holding(self, visited: Ints) -> ExactFlow:
        """The same flow with some of the visited states alone, in their order."""
        flow = copy(self)
        flow.most_states = None
        flow._clear()
        kept = {state.phases.tobytes(): state for state in self.states}
        for phases in (self.visited[k] for k in visited):
            flow._append(kept.get(phases.tobytes()) or flow._new_state(phases))
        return flow

    def state_index(self, phases: Ints) -> int:
        """Number of the contact state, built when it is first asked for."""
        index = self._tables.index(phases)
        return self._append(self._new_state(phases)) if index is None else index

    def _new_state(self, phases: Ints) -> ContactState:
        """A contact state that is not kept, from the one that is nearest to it."""
        updates = self.system.size >= LEAST_COORDINATES and self.system.acts(phases)
        nearest = self._tables.nearest(phases) if updates else None
        equations = StateEquations(self.equations, phases.copy())
        return ContactState.of(equations, self.sources, self.longest_window, nearest)

    def _append(self, state: ContactState) -> int:
        """Number of a state that is added."""
        self.largest_exponent = max(self.largest_exponent, float(np.abs(state.exponent).max()))
        self.highest_frequency = max(self.highest_frequency, float(np.abs(state.exponent.imag).max()))
        return self._tables.append(state, self.sources)

    def follow(self, state: int, guard: int) -> int:
        """The state after the event of a guard."""
        index = self.state_index(self._tables.following(state, guard))
        self._tables.lead(state, guard, index)
        return index

    def tables(self) -> Tables:
        """The states' tables for the kernels."""
        return self._tables.arrays()

    def inputs(self) -> Inputs:
        """The sources as the kernels take them."""
        if self._inputs is None:
            from beamsim.flow.kernels import Inputs

            sources = self.sources
            self._inputs = Inputs(
                sources.start, sources.amplitude, sources.exponent, sources.power, sources.group_last
            )  # fmt: skip
        return self._inputs

    def at(self, phases: Ints) -> StateEquations:
        """The equations in given phases of the contacts (m,)."""
        return self._tables.equations(phases) or StateEquations(self.equations, phases)

    def output_table(self, rows_of: RowsOf) -> Complexes:
        """(S, T, k) coefficients of outputs that may depend on the contact state."""
        if not self.states:
            return np.zeros((0, 0, 0), dtype=complex)
        rows = rows_of(self.states[0].phases)
        terms = max(state.term_basis.size for state in self.states)
        table = np.zeros((len(self.states), terms, rows.shape[0]), dtype=complex)
        for number, state in enumerate(self.states):
            rows = rows_of(state.phases) if number else rows
            state.coefficients(rows, self.sources, table[number, : state.term_basis.size])
        return table

    def is_like(self, other: ExactFlow) -> bool:
        """Whether another flow has as many coordinates, contacts with as many phases, and sources on as many pieces."""
        sizes = [
            (each.system.size, [(len(law.phases), law.internal_states) for law in each.system.contacts.laws],
             each.sources.power.tolist(), each.sources.channel.tolist(), each.sources.start.size)
            for each in (self, other)
        ]  # fmt: skip
        return sizes[0] == sizes[1]

    @property
    def size(self) -> int:
        """N, of the state vector."""
        return 2 * self.system.size + self.system.contacts.internal_states

    def whole_state(self, initial: Floats) -> Floats:
        """The state vector from its first entries, (q, q') at least; internal states that are left out are zero."""
        y = np.zeros(self.size)
        y[: initial.size] = initial
        return y

    @property
    def stands(self) -> Ints:
        """Channels whose displacement moves the stand of a contact."""
        return np.flatnonzero(self.influence.any(axis=1))

    def apart(self, times: Floats) -> Floats:
        """(nt, m) displacement of each contact's place from its stand at times, that of the structure left out, m."""
        moved = [np.multiply.outer(self._channels[c](times), self.influence[c]) for c in self.stands]
        return np.asarray(sum(moved, np.zeros((times.size, self.system.contacts.count))))

    def begin(self, state: Floats, time: float = 0.0) -> StartOfMotion:
        """How a motion starts from a state (N,).

        A guard that is negative hands over to the phase it names: the contact was in it before, with the internal
        states of that event (the face of a pad that is released lies where the structure left it). Where a guard is
        zero the first derivative that is not zero decides, which counts as zero when it is below the round-off of the
        terms that make it up; the phase that it hands over to is entered here. The lowest derivative is the first to
        act, and a contact that would leave again at once is not entered: its derivative was round-off.
        """
        contacts, n = self.system.contacts, self.system.size
        rate = self.equations.penetrations
        start = contacts.starting_at(rate @ state[n : 2 * n], 1e-12 * np.abs(rate) @ np.abs(state[n : 2 * n]))
        phases, entered = contacts.pressed_at_start(start, start), np.zeros(contacts.count, dtype=bool)
        before: Ints | None = None
        piece = np.maximum(np.searchsorted(self.sources.start, [time], side="right") - 1, 0)
        given = self.sources.amplitudes_at(np.array([time]), piece)[0]
        unvisited = [set(range(len(law.phases))) - {int(k)} for law, k in zip(contacts.laws, start, strict=True)]

        entered_by = np.zeros(contacts.count, dtype=np.int64)  # order of the derivative

        def hands_over(events: EventFunctions, g: int, order: int) -> bool:
            j, following = int(events.contact[g]), int(events.next[g])
            returns = entered[j] and following == start[j] and order >= entered_by[j]  # a lower one is round-off itself
            return following in unvisited[j] or bool(returns)

        while True:
            equations = self.states[self.state_index(phases)].equations
            events = equations.events
            signs, orders = self._first_signs(equations, given, state)
            acting = [g for g in range(events.count) if signs[g] < 0 and hands_over(events, g, int(orders[g]))]
            if not acting:
                before = phases if before is None else before
                made = entered & contacts.touching(phases) & ~contacts.touching(before)
                faces = made & contacts.arrays.opening[np.arange(contacts.count), before, INTERNAL:].any(axis=1)  # move
                if faces.any():
                    made[faces] = ~self._pressed_in(np.flatnonzero(faces), given, state)
                return StartOfMotion(before, phases, made, state)
            g = min(acting, key=lambda g: orders[g])
            j, following = int(events.contact[g]), int(events.next[g])
            if orders[g] > 0 and before is None:
                before = phases
            state = equations.state_after(g) @ np.append(state, self._inputs_at_start(given, 0).value[0])
            unvisited[j].discard(following)
            if following == start[j]:
                unvisited[j].clear()
            phases = contacts.after(phases, j, following)
            if j in contacts.pressing:
                phases = contacts.pressed_at_start(phases, start)
            entered[j] |= orders[g] > 0
            entered_by[j] = orders[g]

    def _pressed_in(self, which: Ints, given: Complexes, state: Floats) -> Bools:
        """Whether contacts penetrate where their faces lie when they are new, by more than round-off."""
        rows = self.equations.penetration[which]
        return np.asarray(first_signs(rows, rows[:0], self._inputs_at_start(given, 0), state)[0] > 0.0)

    def _first_signs(self, equations: StateEquations, given: Complexes, state: Floats) -> tuple[Floats, Ints]:
        """(g,) signs and orders of the first derivatives of a contact state's guards that are beyond their round-off.

        A sign is 0 where all derivatives are within round-off. The derivatives of the state follow from the equation of
        motion: in a sum over the modes of a stiff contact the round-off of the highest would hide them.
        """
        guards, nothing = equations.events.guards, np.zeros((0, self.equations.width))
        signs, orders = first_signs(guards, nothing, self._inputs_at_start(given, 0), state)
        for highest in (USUAL_DERIVATIVE, HIGHEST_DERIVATIVE):
            if signs.all():
                break
            signs, orders = first_signs(guards, equations.rates, self._inputs_at_start(given, highest), state)
        return signs, orders

    def _inputs_at_start(self, given: Complexes, highest: int) -> InputsAtStart:
        """The inputs with amplitudes (F,) at the start of a piece, with derivatives up to the highest."""
        inputs = given * self.sources.derivatives_at_start[: highest + 2]
        pairs = np.hstack([inputs[:-1], inputs[1:]])
        fit = self._round_off_of_fits(given)[: highest + 1]
        return InputsAtStart(pairs.real, np.abs(pairs), np.hstack([fit, np.zeros_like(fit)]))

    def inputs_at(self, times: Floats, orders: int = 1, since: Floats | None = None) -> Floats:
        """Derivatives of the inputs at times, from order 0 on, and beside them those of their slopes.

        After a state (N,) they make up the columns z of `beamsim.system.state_equations`.

        Parameters
        ----------
        times : (nt,) s.
        orders : how many derivatives, the inputs themselves among them.
        since : (nt,) s, whose pieces count; those of the times by default.

        Returns
        -------
        (nt, orders, 2 F) array
        """
        sources = self.sources
        piece = np.maximum(np.searchsorted(sources.start, times if since is None else since, side="right") - 1, 0)
        given = sources.amplitudes_at(times, piece)[:, None, :]
        inputs = (given * sources.derivatives_at_start[: orders + 1]).real
        return np.concatenate([inputs[:, :-1], inputs[:, 1:]], axis=2)

    def outputs_of_states(
        self, times: Floats, y: Floats, phases: Ints, rows_of: RowsOf, since: float | None = None
    ) -> Floats:
        """Outputs where the states are known.

        Parameters
        ----------
        times : (nt,) s.
        y : (nt, N) states then.
        phases : (nt, m) of the contacts.
        rows_of : rows of k outputs in given phases.
        since : s, time whose piece of the inputs counts; by default those at the times themselves.

        Returns
        -------
        values : (nt, k).
        """
        out = np.empty((times.size, rows_of(self.system.contacts.start).shape[0]))
        inputs = self.inputs_at(times, since=None if since is None else np.full(times.size, since))[:, 0]
        z = np.hstack([y, inputs])
        known, which = np.unique(phases, axis=0, return_inverse=True)
        for k, each in enumerate(known):
            here = np.flatnonzero(which.reshape(-1) == k)
            out[here] = z[here] @ rows_of(each).T
        return out

    def _round_off_of_fits(self, given: Complexes) -> Floats:
        """(orders, F) of the derivatives of inputs that are fitted by polynomials (swept sines), with amplitudes (F,).

        A coefficient is known to the round-off of the whole polynomial on its piece, not to its own.
        """
        sources, orders = self.sources, np.arange(HIGHEST_DERIVATIVE + 1)[:, None]
        fit = np.zeros((orders.size, sources.power.size))
        # 6: of polynomials that are fitted to inputs, at least
        for channel in set(sources.channel[sources.power >= 6].tolist()):
            of = sources.channel == channel
            length = float(sources.longest_piece[of].max())
            fit[:, of] = ROUND_OFF * float(np.abs(given[of]) @ length ** sources.power[of]) / length**orders
        return fit
