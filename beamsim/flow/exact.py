"""The exact flow: a system under its forcing, with its contact states built as they are visited."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field, replace
from operator import lt
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from beamsim.contacts.laws import INTERNAL
from beamsim.flow.contact_state import ContactState
from beamsim.flow.invariant_blocks import LEAST_COORDINATES
from beamsim.flow.kernels import Inputs, Tables
from beamsim.inputs.signal import (
    ORDERS,
    CubicRecord,
    Sources,
    common_record,
    compile_sources,
    refuse_many_pieces,
    sources_of_pieces,
)
from beamsim.system.equations import Equations, Forcing, PiecewiseLinearSystem, RowsOf, StateEquations
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Bools, Complexes, Floats, Ints

LONGEST_WINDOW_RADIANS = 64.0  # longest segment before re-expansion, in radians of the slowest oscillation
ROUND_OFF = 1e-12  # of the terms of a derivative: below it the derivative counts as zero
EPS = 1e-15  # relative round-off of a state and of the terms of its rate
HIGHEST_DERIVATIVE = ORDERS - 2  # highest order that is evaluated, the slopes of the inputs included
USUAL_DERIVATIVE = 3  # highest order that is needed under most loads; higher ones are computed on demand
TABLES_SHARE = 0.2  # of the memory, for tables of contact states
# arrays of a contact state that are copied into the kernels' tables unchanged
OF_STATES = ("exponent", "power", "projector", "term_basis", "term_source", "term_vector", "horizon")
FITTED = 6  # lowest power of time of inputs that are fitted polynomials (swept sines)


def same_at_rest(a: PiecewiseLinearSystem, b: PiecewiseLinearSystem) -> bool:
    """Whether two systems are equal as long as no contact acts."""
    parts = [
        (s.stiffness, s.damping, s.constant_load, s.contacts.shape, s.contacts.gap, s.contacts.base_influence,
         s.contacts.arrays.guard)
        for s in (a, b)
    ]  # fmt: skip
    return all(map(np.array_equal, *parts))


class StartOfMotion(NamedTuple):
    """Contacts at the start of a motion.

    Before the start a contact is in the phase that its law has for that state; if a guard is zero, the motion decides
    on the phase. Contact is made at the start if the contact is open before and closed after. A contact whose face was
    moved by the structure counts as closed before, with or without a force.
    """

    phases_before: Ints  # (m,) phases before the start
    phases: Ints  # (m,)
    contact_made: Bools  # (m,) whether contact is made at this very time
    state: Floats  # (N,) with the internal states of contacts that were in other phases before


def certain_signs(value: Floats, roundoff: Floats) -> tuple[Floats, Ints]:
    """(k,) sign and order of the first derivative that exceeds its round-off; the sign is 0 if none does.

    ``value`` and ``roundoff`` are (orders, k), from order 0 on.
    """
    beyond = np.abs(value) > roundoff
    first = beyond.argmax(axis=0)
    at = first, np.arange(first.size)
    return np.where(beyond[at], np.sign(value[at]), 0.0), first


Number = TypeVar("Number", bound=np.generic)


@dataclass
class ExactFlow:
    """A system under its forcing, with the contact states diagonalised so far.

    Of all combinations of the contacts' phases few are visited; a state is built when it is first visited. Where a
    motion visits more states than are kept at once, the least recently used are dropped, and built again when they are
    needed: ``states`` are those in memory, ``visited_phases`` the phases of all visited ones. The two have the same
    order until the first is dropped. For the kernels the states are in padded arrays that grow; ``successor[s, g]``
    among them is the state after the event of guard g in state s, or -1 if that state is not in memory.

    Parameters
    ----------
    system, forcing : the structure and its loads.
    duration : s, longest motion that will be computed.
    most_states : states kept at once, 2 at least; by default all.
    pieces : first piece of a record and the one after the last, if all signals are made of one record; by default all
        pieces. `on_pieces` gives the flow on others.
    """

    system: PiecewiseLinearSystem
    forcing: Forcing
    duration: float
    most_states: int | None = None
    pieces: tuple[int, int] | None = None
    sources: Sources = field(init=False)
    inputs: Inputs = field(init=False)  # the sources as the kernels take them
    # the record, if all signals are made of one: it can be taken in chunks
    record: CubicRecord | None = field(init=False)
    size: int = field(init=False)  # N, of the state vector
    influence: Floats = field(init=False)  # (L, m) displacement of each contact's mounting for a unit of each signal
    equations: Equations = field(init=False)  # shared with flows under other loads
    states: list[ContactState] = field(init=False)  # those that are kept
    visited_phases: list[Ints] = field(init=False)  # phases of all states visited

    def __post_init__(self) -> None:
        self._load()
        self.equations = Equations(self.system, self.forcing.load, self.influence, self.sources.channel)
        self.size = self.equations.states
        slowest = self.system.stiffness[self.system.stiffness > 0]
        period = LONGEST_WINDOW_RADIANS / float(np.sqrt(slowest.min())) if slowest.size else np.inf
        self.longest_window = min(period, max(self.duration, 1e-300))
        self._clear()

    def _load(self) -> None:
        """List the sources of the signals, and what moves the mountings of contacts."""
        forcing, contacts = self.forcing, self.system.contacts
        self.influence = np.zeros((len(forcing.signal), contacts.count))
        if forcing.influence is not None:
            self.influence += forcing.influence.T
        if forcing.base_displacements:
            self.influence[list(forcing.base_displacements)] += contacts.base_influence.T
        self.stands = np.flatnonzero(self.influence.any(axis=1))  # channels that move the mounting of a contact
        self.record = common_record(forcing.signal)
        if self.record is None:
            sources = compile_sources(forcing.signal, self.duration)
        else:
            sources = sources_of_pieces(forcing.signal, *(self.pieces or (0, self.record.pieces)), self.duration)
        self.sources = sources
        self.inputs = Inputs(sources.start, sources.amplitude, sources.exponent, sources.power, sources.group_last)

    def sources_under(self, forcing: Forcing) -> Sources:
        """The sources of other loads, which differ in their signals alone."""
        return compile_sources(forcing.signal, self.duration)

    def _clear(self, arrays: dict[str, NDArray[np.generic]] | None = None) -> None:
        """Remove all states; ``arrays`` holds the table rows of the first states that will be added."""
        self.states, self.visited_phases = [], []
        self.largest_exponent = 0.0  # 1/s, of all states visited
        self.highest_frequency = 0.0  # rad/s, of all states visited
        self._visit_numbers: dict[bytes, int] = {}  # numbers in ``visited``, by the phases
        self._index: OrderedDict[bytes, int] = OrderedDict()  # of states, the least recently used first
        self._used: set[int] = set()  # numbers of states that were asked for, or that a motion visited
        self._arrays: dict[str, NDArray[np.generic]] = arrays or {}

    def on_pieces(self, first: int, last: int) -> ExactFlow:
        """The same flow, which shares its contact states, with other pieces of the record."""
        flow = copy(self)
        flow.pieces = first, last
        flow._load()
        return flow

    def with_loads(self, forcing: Forcing, duration: float | None = None) -> ExactFlow:
        """The same flow under other loads, with the contact states that were used, whose modes are shared.

        Only the forced motions in these states are new. Where only amplitudes differ, they are shared, too.

        Parameters
        ----------
        forcing : differs in its signals alone; what each load acts on stays as it is.
        duration : s, in place of that of this flow.

        Returns
        -------
        ExactFlow
            With sources of its own.
        """
        flow = copy(self)
        flow.forcing = forcing
        flow.duration = self.duration if duration is None else duration
        flow._load()
        if flow.sources.has_responses_of(self.sources):
            return flow
        if not np.array_equal(flow.sources.channel, self.sources.channel):
            flow.equations = Equations(flow.system, forcing.load, flow.influence, flow.sources.channel)
            flow._clear()
            return flow
        return flow._with_states_of(self, lambda state: state.with_loads(flow.sources))

    def with_system(self, system: PiecewiseLinearSystem) -> ExactFlow:
        """The same flow of a structure with other contacts of as many phases, with the contact states that were used.

        Those in which neither system's contacts act are shared.
        """
        flow = replace(self, system=system)
        share = flow.longest_window == self.longest_window and same_at_rest(self.system, system)

        def renewed(state: ContactState) -> ContactState:
            inert = share and not (self.system.contacts_act(state.phases) or system.contacts_act(state.phases))
            return state if inert else flow._new_state(state.phases)

        return flow._with_states_of(self, renewed)

    def _with_states_of(self, original: ExactFlow, renew: Callable[[ContactState], ContactState]) -> ExactFlow:
        """This flow with the used states of another flow, each rebuilt by ``renew``.

        States with the same terms keep their tables, except for the entries that depend on the loads.
        """
        used, number = sorted(original._used), np.full(len(original.states) + 1, -1)
        number[used] = np.arange(len(used))
        tables, old = (
            {name: array[used] for name, array in original._arrays.items()},
            [original.states[k] for k in used],
        )
        states, successor = [renew(state) for state in old], number[tables.get("successor", number[:0])]
        alike = all(state.term_basis is known.term_basis for state, known in zip(states, old, strict=True))
        self._clear(tables if alike else {name: np.zeros_like(array) for name, array in tables.items()})
        for index, (state, known) in enumerate(zip(states, old, strict=True)):
            if not alike:
                self._append(state)
            else:
                self._enter(index, state)
                if state is not known:
                    self._write_loads(index, state)
        if used:
            self._arrays["successor"][: len(used), : successor.shape[1]] = successor
        return self

    @property
    def has_dropped_states(self) -> bool:
        """Whether some visited states have been dropped."""
        return len(self.visited_phases) > len(self.states)

    def visit_numbers(self, states: Ints) -> Ints:
        """Numbers, among all states visited, of states that are kept and were used in this order."""
        self._used.update(states.tolist())
        if len(self.states) != self.most_states:
            return states  # none was dropped: both numberings agree
        for state in states:
            self._index.move_to_end(self.states[state].phases.tobytes())
        return np.array([self._visit_numbers[self.states[state].phases.tobytes()] for state in states], dtype=np.int64)

    def visited_state(self, number: int) -> ContactState:
        """A state by its number among all visited; one that was dropped is built again, and not kept."""
        if not self.has_dropped_states:
            return self.states[number]
        kept = self._index.get(self.visited_phases[number].tobytes())
        return self._new_state(self.visited_phases[number]) if kept is None else self.states[kept]

    def with_states(self, numbers: Ints) -> ExactFlow:
        """The same flow with only the visited states of these numbers, in their order."""
        flow = copy(self)
        flow.most_states = None
        flow._clear()
        kept = {state.phases.tobytes(): state for state in self.states}
        for phases in (self.visited_phases[k] for k in numbers):
            flow._append(kept.get(phases.tobytes()) or flow._new_state(phases))
        return flow

    def state_index(self, phases: Ints) -> int:
        """Number of the contact state, built when it is first asked for."""
        index = self._index.get(phases.tobytes())
        if index is None:
            return self._append(self._new_state(phases))
        self._used.add(index)
        return index

    def _new_state(self, phases: Ints) -> ContactState:
        """Build a contact state; in a large structure from the state that differs in the fewest contacts."""
        nearest = None
        if self.states and self.system.size >= LEAST_COORDINATES and self.system.contacts_act(phases):
            differing = np.count_nonzero(self._arrays["phase"][: len(self.states)] != phases, axis=1)
            nearest = self.states[int(np.argmin(differing))]
        return ContactState.of(
            StateEquations(self.equations, phases.copy()), self.sources, self.longest_window, nearest
        )

    def _append(self, state: ContactState) -> int:
        """Add a state to the tables; its number may be that of the least recently used one, which is dropped for it."""
        events = state.equations.events
        watch = state.coefficients(events.rows, self.sources)
        full = self.most_states is not None and len(self.states) >= self.most_states
        index = self._drop() if full else len(self.states)
        self._enter(index, state)
        rows: dict[str, NDArray[np.generic]] = {name: np.asarray(getattr(state, name)) for name in OF_STATES}
        rows |= {
            "n_basis": np.array(state.exponent.size),
            "n_free": np.array(state.projector.shape[0]),
            "n_terms": np.array(state.term_basis.size),
            "event_function": watch,
            "roundoff_scale": state.roundoff_scale(events.guards, watch[:, : events.count]),
            "phase": state.phases,
            "n_guards": np.array(events.count),
            "n_joining": np.array(events.joining_count),
            "guard_contact": events.contact,
            "reset": events.reset_row,
            "successor": np.full(events.count, -1, dtype=np.int64),
        }
        for name, row in rows.items():
            old = self._arrays.get(name, np.zeros((0, *row.shape), dtype=row.dtype))
            need = (index + 1, *row.shape)
            if any(map(lt, old.shape, need)):
                self._arrays[name] = old = self._enlarge(old, need)
            if row.shape != old.shape[1:]:
                old[index] = 0
            place: tuple[int | slice, ...] = (index, *map(slice, row.shape))
            old[place] = row
        return index

    def _enter(self, index: int, state: ContactState) -> None:
        """Register a state in a new row, or in the row of a dropped state; its tables are written separately."""
        self.largest_exponent = max(self.largest_exponent, float(np.abs(state.exponent).max()))
        self.highest_frequency = max(self.highest_frequency, float(np.abs(state.exponent.imag).max()))
        key = state.phases.tobytes()
        if key not in self._visit_numbers:
            self._visit_numbers[key] = len(self.visited_phases)
            self.visited_phases.append(state.phases)
        self.states[index : index + 1] = [state]
        self._index[key] = index
        self._used.discard(index)

    def _write_loads(self, index: int, state: ContactState) -> None:
        """Write the first F terms, which depend on the loads, into the tables of a state that has the other terms."""
        F, events, arrays = self.sources.power.size, state.equations.events, self._arrays
        forced = replace(state, term_vector=state.term_vector[:F])
        watch = forced.coefficients(events.rows, self.sources)
        arrays["exponent"][index, : state.exponent.size] = state.exponent
        arrays["term_vector"][index, :F] = state.term_vector[:F]
        arrays["event_function"][index, :F, : watch.shape[1]] = watch
        roundoff_scale = forced.roundoff_scale(events.guards, watch[:, : events.count])
        arrays["roundoff_scale"][index, :F, : events.count] = roundoff_scale

    def _enlarge(self, array: NDArray[Number], shape: tuple[int, ...]) -> NDArray[Number]:
        """An array with more rows, or wider ones; rows that no state has yet are zeros."""
        most, rows = self.most_states or np.inf, array.shape[0]
        if rows < shape[0]:
            rows = 4 * shape[0] + 4  # memory is taken when a row is written
            rows = rows if 4 * rows < most else int(most)  # otherwise the next growth would copy all rows to add a few
        grown = np.zeros(tuple(map(max, array.shape, (rows, *shape[1:]))), dtype=array.dtype)
        known = (slice(min(array.shape[0], len(self.states))), *map(slice, array.shape[1:]))
        grown[known] = array[known]
        return grown

    def _drop(self) -> int:
        """Remove the least recently used state; returns its number."""
        index = self._index.popitem(last=False)[1]
        for array in self._arrays.values():
            array[index] = 0
        successor = self._arrays["successor"]
        successor[successor == index] = -1
        return index

    def follow(self, state: int, guard: int) -> int:
        """The state after the event of a guard."""
        phases, events = self.states[state].phases, self.states[state].equations.events
        self._index.move_to_end(phases.tobytes())
        after = self.system.contacts.phases_after(phases, int(events.contact[guard]), int(events.next[guard]))
        index = self.state_index(after)
        self._arrays["successor"][state, guard] = index
        return index

    def tables(self) -> Tables:
        """The states' tables for the kernels; rows beyond the number of states are unused."""
        contacts, internal = self.system.contacts, self.equations.internal.start
        return Tables(first=internal + contacts.first_state, states=contacts.state_counts, **self._arrays)

    def at(self, phases: Ints) -> StateEquations:
        """The equations in given phases of the contacts (m,)."""
        index = self._index.get(phases.tobytes())
        return StateEquations(self.equations, phases) if index is None else self.states[index].equations

    def has_same_layout(self, other: ExactFlow) -> bool:
        """Whether another flow has as many coordinates, contacts with as many phases, and sources on as many pieces."""
        sizes = [
            (each.system.size, [(len(law.phases), law.internal_states) for law in each.system.contacts.laws],
             each.sources.power.tolist(), each.sources.channel.tolist(), each.sources.start.size)
            for each in (self, other)
        ]  # fmt: skip
        return sizes[0] == sizes[1]

    def mounting_displacements(self, times: Floats) -> Floats:
        """(nt, m) displacement of each contact point relative to its mounting due to the base's motion alone, m."""
        moved = [np.multiply.outer(self.forcing.signal[c](times), self.influence[c]) for c in self.stands]
        return np.asarray(sum(moved, np.zeros((times.size, self.system.contacts.count))))

    def begin(self, state: Floats, time: float = 0.0) -> StartOfMotion:
        """How a motion starts from a state (N,).

        If a guard is negative, the contact was already in the phase after that guard's event, with the internal states
        of the event (the face of a released pad lies where the structure left it). If a guard is zero, its first
        nonzero
        derivative decides whether the event happens at the start; a derivative below the round-off of its terms counts
        as zero. The guard with the lowest such order acts first. A contact that would change back at once does not
        change: its derivative was round-off.
        """
        contacts, n, every = self.system.contacts, self.system.size, np.arange(self.system.contacts.count)
        rate = self.equations.penetrations
        start = contacts.start
        if contacts.any_sticks_rigidly:
            start = contacts.starting_phases(rate @ state[n : 2 * n], 1e-12 * np.abs(rate) @ np.abs(state[n : 2 * n]))
        phases, before = contacts.pressed_at_start(start, start) if contacts.pressed_contacts.size else start, None
        piece = np.maximum(np.searchsorted(self.sources.start, [time], side="right") - 1, 0)
        given = self.sources.amplitudes_at(np.array([time]), piece)[0]
        inputs = (given * self.sources.derivatives_at_start[:2]).real.ravel()
        unvisited = np.ones(contacts.arrays.force.shape[:2], dtype=bool)  # phases of each contact
        unvisited[every, start] = False
        entered, entered_by = np.zeros(every.size, dtype=bool), np.zeros(every.size, dtype=np.int64)  # order
        while True:
            equations = self.states[self.state_index(phases)].equations
            events = equations.events
            signs, orders = self._first_signs(events.guards, equations.rates, given, state)
            # a derivative of lower order that reverses a change is round-off
            returns = (events.next == start[events.contact]) & (orders >= entered_by[events.contact])
            returns &= entered[events.contact]
            acting = np.flatnonzero((signs < 0) & (unvisited[events.contact, events.next] | returns))
            if not acting.size:
                break
            g = int(acting[np.argmin(orders[acting])])
            j, following = int(events.contact[g]), int(events.next[g])
            if orders[g] > 0 and before is None:
                before = phases
            state = equations.state_after(g) @ np.append(state, inputs)
            unvisited[j, following] = False
            if following == start[j]:
                unvisited[j] = False
            phases = contacts.phases_after(phases, j, following)
            if j in contacts.pressing_contacts:
                phases = contacts.pressed_at_start(phases, start)
            entered[j] |= orders[g] > 0
            entered_by[j] = orders[g]
        before = phases if before is None else before
        made = entered & contacts.closed(phases) & ~contacts.closed(before)
        faces = np.flatnonzero(made & contacts.arrays.opening[every, before, INTERNAL:].any(axis=1))  # movable ones
        if faces.size:  # closed before, if the penetration of the unused face exceeds round-off
            rows = self.equations.penetration[faces]
            made[faces] = self._first_signs(rows, rows[:0], given, state)[0] <= 0.0
        return StartOfMotion(before, phases, made, state)

    def _first_signs(
        self, rows: Floats, rates: Floats, input_amplitudes: Complexes, state: Floats
    ) -> tuple[Floats, Ints]:
        """Sign and order of the first derivative of each function that exceeds its round-off, see `certain_signs`.

        The derivatives of the state are taken from the equation of motion: in a sum over the modes of a stiff contact
        the round-off of the highest mode would hide them.

        Parameters
        ----------
        rows : (k, V) the functions.
        rates : (N, V) the time derivative of the state; (0, V) if only the signs of the functions themselves are
            needed.
        input_amplitudes : (F,) amplitudes of the inputs.
        state : (N,).

        Returns
        -------
        signs, orders : (k,).
        """
        N, count, every = state.size, rows.shape[0], np.vstack([rows, rates])
        sizes, load_size = np.abs(every[:, :N]), np.abs(every[:, N:]).T
        fit = self._round_off_of_fits(input_amplitudes) if self.sources.power.max() >= FITTED else None
        for orders in (1, USUAL_DERIVATIVE + 1, HIGHEST_DERIVATIVE + 1) if rates.size else (1,):
            derivatives = input_amplitudes * self.sources.derivatives_at_start[: orders + 1]
            inputs = np.hstack([derivatives[:-1], derivatives[1:]])  # and their slopes
            driven = inputs.real @ every[:, N:].T
            y = np.empty((orders, N))  # the state and its derivatives
            y[0] = state
            for order in range(1, orders):
                y[order] = rates[:, :N] @ y[order - 1] + driven[order - 1, count:]
            terms = np.abs(y) @ sizes.T + np.abs(inputs) @ load_size
            hidden = np.zeros_like(terms) if fit is None else fit[:orders] @ load_size
            added, doubt = EPS * terms + hidden, np.empty_like(y)
            doubt[0] = EPS * np.abs(state)
            for order in range(1, orders):
                doubt[order] = sizes[count:] @ doubt[order - 1] + added[order - 1, count:]
            value = y @ rows[:, :N].T + driven[:, :count]
            found = certain_signs(value, (ROUND_OFF * terms + hidden)[:, :count] + doubt @ sizes[:count].T)
            if found[0].all():
                break
        return found

    def inputs_at(self, times: Floats, orders: int = 1, piece_times: Floats | None = None) -> Floats:
        """Derivatives of the inputs at times, from order 0 on, followed by those of their slopes.

        After a state (N,) they make up the columns z of `beamsim.system.equations`.

        Parameters
        ----------
        times : (nt,) s.
        orders : number of derivatives, order 0 included.
        piece_times : (nt,) s, times that select the piece of the inputs; by default ``times``.

        Returns
        -------
        (nt, orders, 2 F) array
        """
        sources = self.sources
        piece = np.maximum(
            np.searchsorted(sources.start, times if piece_times is None else piece_times, side="right") - 1, 0
        )
        given = sources.amplitudes_at(times, piece)[:, None, :]
        inputs = (given * sources.derivatives_at_start[: orders + 1]).real
        return np.concatenate([inputs[:, :-1], inputs[:, 1:]], axis=2)

    def outputs_of_states(
        self, times: Floats, y: Floats, phases: Ints, rows_of: RowsOf, piece_time: float | None = None
    ) -> Floats:
        """Outputs at times at which the states are known.

        Parameters
        ----------
        times : (nt,) s.
        y : (nt, N) states then.
        phases : (nt, m) of the contacts.
        rows_of : rows of k outputs in given phases.
        piece_time : s, time that selects the piece of the inputs; by default each of ``times``.

        Returns
        -------
        values : (nt, k).
        """
        out = np.empty((times.size, rows_of(self.system.contacts.start).shape[0]))
        inputs = self.inputs_at(times, piece_times=None if piece_time is None else np.full(times.size, piece_time))[
            :, 0
        ]
        z = np.hstack([y, inputs])
        known, which = np.unique(phases, axis=0, return_inverse=True)
        for k, each in enumerate(known):
            here = np.flatnonzero(which.reshape(-1) == k)
            out[here] = z[here] @ rows_of(each).T
        return out

    def _round_off_of_fits(self, amplitudes: Complexes) -> Floats:
        """(orders, 2 F) round-off of the derivatives of inputs with amplitudes (F,) that are fitted polynomials.

        The second half is zero. A coefficient is accurate to the round-off of the whole polynomial on its piece.
        """
        sources, orders = self.sources, np.arange(HIGHEST_DERIVATIVE + 1)[:, None]
        fit = np.zeros((orders.size, 2 * amplitudes.size))
        for channel in set(sources.channel[sources.power >= FITTED].tolist()):
            of = np.flatnonzero(sources.channel == channel)
            length = float(sources.longest_piece[of].max())
            fit[:, of] = ROUND_OFF * float(np.abs(amplitudes[of]) @ length ** sources.power[of]) / length**orders
        return fit


def exact_flow(
    system: StructuralSystem, duration: float, most_states: int | None = None, memory: float = 2e9,
    pieces: tuple[int, int] | None = None,
) -> ExactFlow:  # fmt: skip
    """The exact flow of a built system.

    Parameters
    ----------
    system : with its forcing.
    duration : s, longest motion that will be computed.
    most_states : contact states that are kept at once; by default those that fit into their share of the memory.
    memory : bytes.
    pieces : see `ExactFlow`.

    Returns
    -------
    ExactFlow

    Raises
    ------
    ScenarioError
        If a record has too many pieces for the memory.
    """
    # each contact state's tables: matrices of the state vector, and the functions that end it
    dynamics, functions = system.dynamics, 2 * system.dynamics.contacts.count
    states = 2 * dynamics.size + dynamics.contacts.internal_states
    most = most_states or max(8, int(TABLES_SHARE * memory / (56.0 * states**2 + 40.0 * states * functions)))
    if pieces is None:
        refuse_many_pieces(system.forcing.signal)
    return ExactFlow(system.dynamics, system.forcing, duration, most, pieces)
