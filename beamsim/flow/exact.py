"""The exact flow: a system under its forcing, with its contact states built as they are visited."""

from __future__ import annotations

from collections import OrderedDict
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from beamsim.contacts.contacts import Watched
from beamsim.flow.contact_state import (
    ContactState,
    LinearOutput,
    OutputOf,
    acting_loads,
    contact_modes,
    held_contacts,
    state_matrices,
    tabulated,
)
from beamsim.flow.kernels import Inputs, Tables
from beamsim.flow.sources import Sources, compile_sources, sources_of_pieces
from beamsim.flow.state_tables import (
    HIGHEST_DERIVATIVE,
    ROUND_OFF,
    USUAL_DERIVATIVE,
    FunctionsAtStart,
    InputsAtStart,
    KnownState,
    StateTables,
)
from beamsim.inputs.signal import CubicRecord, Signal, common_record
from beamsim.system.equations import Forcing, PiecewiseLinearSystem
from beamsim.typing import Bools, Complexes, Floats, Ints

LONGEST_WINDOW_RADIANS = 64.0  # of the slowest oscillation, before the series of a segment are started anew
FIRST = 1e6  # factor of functions that are looked at before others
MOST_MODES = 64  # contact states whose modes flows under other loads share; the one not used for longest is dropped


def states_in_memory(system: PiecewiseLinearSystem, memory: float) -> int:
    """Number of contact states whose tables fit into ``memory`` bytes."""
    N, watched = 2 * system.size + system.contacts.internal_states, 2 * system.contacts.count
    return max(8, int(memory / (48.0 * N * N + 24.0 * N * watched)))


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

    def __post_init__(self) -> None:
        self._most_known = min(MOST_MODES, self.most_states or MOST_MODES)
        self._known: OrderedDict[bytes, KnownState] = OrderedDict()  # shared with flows under other loads
        self._load()
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

    def _clear(self, like: StateTables | None = None) -> None:
        """Remove all states; tables get the sizes of others."""
        self.built = 0  # states, those built again included
        self.largest_exponent = 0.0  # 1/s, of all states visited
        self.highest_frequency = 0.0  # rad/s, of all states visited
        self._tables = StateTables(self.system.contacts, self.most_states, like)

    @property
    def states(self) -> list[ContactState]:
        """Those that are kept."""
        return self._tables.states

    @property
    def visited(self) -> list[Ints]:
        """Phases of all states visited."""
        return self._tables.visited

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

        Responses to the loads are shared, too, where they hold for pieces that are alike, else new.

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
        if self.sources.power.any() and self.sources.serve(flow.sources):
            tables = self.sources
            flow.sources = replace(flow.sources, longest_piece=tables.longest_piece, limit=tables.limit)
            return flow
        if not np.array_equal(flow.sources.channel, self.sources.channel):
            flow.__dict__.pop("penetrations", None)
            flow._known = OrderedDict()
            flow._clear()
            return flow
        flow._clear(self._tables)
        for index in self._tables.used:  # its motions will visit these
            flow._append(self._tables.known[index])
        flow._tables.lead_as(self._tables)
        return flow

    def with_system(self, system: PiecewiseLinearSystem) -> ExactFlow:
        """The same flow of a structure with other contacts of as many phases, with the contact states that were used.

        Those in which neither system's contacts act are shared.
        """
        flow = replace(self, system=system)
        flow._clear(self._tables)
        share = flow.longest_window == self.longest_window and same_at_rest(self.system, system)
        for known in [self._tables.known[index] for index in self._tables.used]:
            phases = known.modes.phases
            inert = share and not (self.system.acts(phases) or system.acts(phases))
            flow._append(known if inert else flow._known_state(phases))
        flow._tables.lead_as(self._tables)
        return flow

    @property
    def dropped(self) -> bool:
        """Whether states were visited that are not kept any more."""
        return len(self.visited) > len(self.states)

    def visits(self, states: Ints) -> Ints:
        """Numbers, among all states visited, of states that are kept and were used in this order."""
        return self._tables.visits(states)

    def holding(self, visited: Ints) -> ExactFlow:
        """The same flow with some of the visited states alone, in their order."""
        flow = copy(self)
        flow.most_states = None
        flow._clear()
        kept = {known.modes.phases.tobytes(): known for known in self._tables.known}
        for phases in (self.visited[k] for k in visited):
            flow._append(kept.get(phases.tobytes()) or flow._known_state(phases))
        return flow

    def state_index(self, phases: Ints) -> int:
        """Number of the contact state, built when it is first asked for."""
        index = self._tables.index(phases)
        return self._append(self._known_state(phases)) if index is None else index

    def _append(self, known: KnownState) -> int:
        """Number of a state that is built here."""
        state, watched = tabulated(known.modes, self.sources), known.watched
        watch = state.coefficients(known.functions, self.sources)
        roughness = np.ascontiguousarray(state.roughness(known.functions, watch)[:, : watched.guards])
        index = self._tables.append(state, known, watch, roughness)
        self.built += 1
        self.largest_exponent = max(self.largest_exponent, float(np.abs(state.exponent).max()))
        self.highest_frequency = max(self.highest_frequency, float(np.abs(state.exponent.imag).max()))
        return index

    def _known_state(self, phases: Ints) -> KnownState:
        """What a contact state is under all signals, made when it is first asked for."""
        key = phases.tobytes()
        if key not in self._known:
            watched = self.system.contacts.watched(phases)
            nearest = self._tables.nearest(phases) if self.system.acts(phases) else None
            modes = contact_modes(
                self.system, self.forcing, self.sources, self.influence, phases, self.longest_window,
                None if nearest is None else nearest.modes,
            )  # fmt: skip
            functions, guards = self.watched(watched, phases), watched.guards
            at_start = FunctionsAtStart.of(functions.some(slice(0, guards)), guards)
            self._known[key] = KnownState(modes, watched, functions, at_start)
            if len(self._known) > self._most_known:
                self._known.popitem(last=False)
        self._known.move_to_end(key)
        return self._known[key]

    def following(self, state: int, guard: int) -> Ints:
        """Phases of the contacts after the event of a guard."""
        return self._tables.following(state, guard)

    def follow(self, state: int, guard: int) -> int:
        """The state after the event of a guard."""
        phases = self.following(state, guard)
        self._tables.use(np.array([state]))
        index = self.state_index(phases)
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

    def output_table(self, output_of: OutputOf) -> Complexes:
        """(S, T, k) coefficients of outputs that may depend on the contact state."""
        if not self.states:
            return np.zeros((0, 0, 0), dtype=complex)
        output = output_of(self.states[0].phases)
        terms = max(state.term_basis.size for state in self.states)
        table = np.zeros((len(self.states), terms, output.row.shape[0]), dtype=complex)
        for number, state in enumerate(self.states):
            output = output_of(state.phases) if number else output
            state.coefficients(output, self.sources, table[number, : state.term_basis.size])
        return table

    def empty_output(self, count: int) -> LinearOutput:
        """An all-zero output to fill in."""
        F = self.sources.count
        return LinearOutput(np.zeros((count, self.size)), np.zeros((count, F)), np.zeros((count, F)))

    def constant_output(self, values: Floats) -> LinearOutput:
        """Outputs (k,) that do not change."""
        output = self.empty_output(values.size)
        output.direct[:, 0] = values
        return output

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

    def equation_of_motion(self, phases: Ints) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        """K (n, n), C (n, n), (n, r) loads of the internal states, and (F, n) loads per unit of each source and of its
        time derivative; all without what the reactions of contacts that hold balance."""
        held, forces = held_contacts(self.system, phases), self._acting_forces(phases)
        if held is None:
            return forces
        K, C, internal, load, slope = forces
        return held.free(K.T).T, held.free(C.T).T, held.free(internal.T).T, held.free(load), held.free(slope)

    def _acting_forces(self, phases: Ints) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        """As `equation_of_motion`, with what reactions balance."""
        n, contacts = self.system.size, self.system.contacts
        load, slope = acting_loads(self.system, self.forcing, self.sources, self.influence, phases)
        internal = contacts.pushes(phases).T @ contacts.force_rows(phases)[1]
        return *state_matrices(self.system, phases), internal, load[:, :n], slope[:, :n]

    def reactions(self, phases: Ints) -> LinearOutput:
        """(m,) forces of the contacts that hold in given phases, 0 of the others."""
        output, held = self.empty_output(self.system.contacts.count), held_contacts(self.system, phases)
        if held is not None:
            K, C, internal, load, slope = self._acting_forces(phases)
            output.row[held.contact] = held.share @ np.hstack([-K, -C, internal])
            output.direct[held.contact] = held.share @ load.T
            output.direct_slope[held.contact] = held.share @ slope.T
        return output

    @cached_property
    def penetrations(self) -> tuple[LinearOutput, LinearOutput]:
        """Penetration and penetration rate of every contact."""
        n, contacts = self.system.size, self.system.contacts
        delta, rate = self.empty_output(contacts.count), self.empty_output(contacts.count)
        delta.row[:, :n] = -contacts.sign[:, None] * contacts.shape
        delta.direct[:, 0] = -contacts.gap
        rate.row[:, n : 2 * n] = delta.row[:, :n]
        for channel in self.stands:
            moving = self.sources.channel == channel
            moved = -(self.influence[channel] * contacts.sign)[:, None]
            delta.direct[:, moving] = moved
            rate.direct_slope[:, moving] = moved
        return delta, rate

    @property
    def stands(self) -> Ints:
        """Channels whose displacement moves the stand of a contact."""
        return np.flatnonzero(self.influence.any(axis=1))

    def apart(self, times: Floats) -> Floats:
        """(nt, m) displacement of each contact's place from its stand at times, that of the structure left out, m."""
        moved = [np.multiply.outer(self._channels[c](times), self.influence[c]) for c in self.stands]
        return np.asarray(sum(moved, np.zeros((times.size, self.system.contacts.count))))

    def contact_forces(self, phases: Ints) -> LinearOutput:
        """Force of every contact in given phases."""
        contacts = self.system.contacts
        forces = self.combined(np.arange(contacts.count), *contacts.force_rows(phases))
        if contacts.presses(phases):
            forces += self.pressed_forces(phases)
        return forces + self.reactions(phases) if contacts.ever_hold else forces

    def pressing_forces(self, phases: Ints) -> LinearOutput:
        """Of each contact that another one presses the force of that one."""
        contacts = self.system.contacts
        row, internal = contacts.force_rows(phases)
        return self.combined(contacts.pressing, row[contacts.pressing], internal[contacts.pressing])

    def pressing_force_rates(self, phases: Ints) -> LinearOutput:
        """Their time derivatives, N/s, of contacts without a dashpot."""
        contacts = self.system.contacts
        row, internal = contacts.force_rows(phases)
        rate = self.penetrations[1].some(contacts.pressing).scaled(row[contacts.pressing, :1])
        if contacts.internal_states:
            rate += self.internal_rates(phases).combined(internal[contacts.pressing])
        return rate

    def pressed_forces(self, phases: Ints) -> LinearOutput:
        """(m,) forces of friction that are proportional to the force of another contact, 0 of the others."""
        contacts = self.system.contacts
        place = np.zeros((contacts.count, contacts.pressed.size))
        place[contacts.pressed, np.arange(contacts.pressed.size)] = contacts.pressing_factors(phases)
        return self.pressing_forces(phases).combined(place)

    def internal_rates(self, phases: Ints) -> LinearOutput:
        """(r,) time derivatives of the contacts' internal states in given phases."""
        n, contacts = self.system.size, self.system.contacts
        free, drive = contacts.internal_rates(phases)
        delta, rate = self.penetrations
        output = delta.combined(drive[:, :, 0]) + rate.combined(drive[:, :, 1])
        output.row[:, 2 * n :] += free
        output.direct[:, 0] += drive[:, :, 2].sum(axis=1)
        return output

    def openings(self, phases: Ints) -> LinearOutput:
        """(m,) distances of the contacts to their faces as these are now, m; 0 of what touches or is held."""
        return self.combined(np.arange(self.system.contacts.count), *self.system.contacts.openings(phases))

    def watched(self, watched: Watched, phases: Ints) -> LinearOutput:
        """The functions watched in a contact state (see `beamsim.contacts.contacts.Watched`)."""
        functions = self.combined(watched.contact, watched.row, watched.internal)
        pressing, rate, reaction = watched.joint.T[:, :, None]
        if pressing.any() or rate.any():
            of = np.zeros((watched.contact.size, self.system.contacts.pressed.size))
            of[:] = watched.contact[:, None] == self.system.contacts.pressed
            functions += self.pressing_forces(phases).combined(of * pressing)
            if rate.any():
                functions += self.pressing_force_rates(phases).combined(of * rate)
        held = held_contacts(self.system, phases)
        if held is None:
            return functions
        functions += self.reactions(phases).some(watched.contact).scaled(reaction)
        resting = held.resting(self.penetrations[1].row[:, self.system.size : 2 * self.system.size])
        for g in np.flatnonzero(resting[watched.contact[: watched.guards]]).tolist():
            if watched.row[g, 1] != 0.0:
                self._join(functions, g, phases, int(watched.contact[g]), int(watched.following[g]))
        return functions

    def _join(self, functions: LinearOutput, g: int, phases: Ints, contact: int, following: int) -> None:
        """Replace the rate of a contact whose motion others hold, zero: it sticks where that takes less than its limit.

        Until then it gives what it can, and this comes before any of the others gives way.
        """
        contacts = self.system.contacts
        limit = next(x for x in contacts.laws[contact].phases[following].guards if x.next == phases[contact])
        joined = self.reactions(contacts.after(phases, contact, following)).scaled(-FIRST * limit.row.reaction)
        functions.row[g], functions.direct[g] = joined.row[contact], joined.direct[contact]
        functions.direct_slope[g] = joined.direct_slope[contact]
        functions.direct[g, 0] -= FIRST * limit.row.constant

    def combined(self, contact: Ints, row: Floats, internal: Floats) -> LinearOutput:
        """Combinations of penetrations, their rates, 1 (k, 3) and internal states (k, r), for each of ``contact``."""
        delta, rate = self.penetrations
        output = delta.some(contact).scaled(row[:, :1]) + rate.some(contact).scaled(row[:, 1:2])
        output.direct[:, 0] += row[:, 2]
        output.row[:, 2 * self.system.size :] += internal
        return output

    def begin(self, state: Floats, time: float = 0.0) -> StartOfMotion:
        """How a motion starts from a state (N,).

        A guard that is negative hands over to the phase it names: the contact was in it before, with the internal
        states of that event (the face of a pad that is released lies where the structure left it). Where a guard is
        zero the first derivative that is not zero decides, which counts as zero when it is below the round-off of the
        terms that make it up; the phase that it hands over to is entered here. The lowest derivative is the first to
        act, and a contact that would leave again at once is not entered: its derivative was round-off.
        """
        contacts, n = self.system.contacts, self.system.size
        rate = self.penetrations[1].row[:, n : 2 * n]
        start = contacts.starting_at(rate @ state[n : 2 * n], 1e-12 * np.abs(rate) @ np.abs(state[n : 2 * n]))
        phases, entered = contacts.pressed_at_start(start, start), np.zeros(contacts.count, dtype=bool)
        before: Ints | None = None
        piece = np.maximum(np.searchsorted(self.sources.start, [time], side="right") - 1, 0)
        given = self.sources.amplitudes_at(np.array([time]), piece)[0]
        unvisited = [set(range(len(law.phases))) - {int(k)} for law, k in zip(contacts.laws, start, strict=True)]

        entered_by = np.zeros(contacts.count, dtype=np.int64)  # order of the derivative

        def hands_over(watched: Watched, g: int, order: int) -> bool:
            j, following = int(watched.contact[g]), int(watched.following[g])
            returns = entered[j] and following == start[j] and order >= entered_by[j]  # a lower one is round-off itself
            return following in unvisited[j] or bool(returns)

        while True:
            index = self.state_index(phases)
            watched = self._tables.known[index].watched
            signs, orders = self._first_signs(index, phases, given, state)
            acting = [g for g in range(watched.guards) if signs[g] < 0 and hands_over(watched, g, int(orders[g]))]
            if not acting:
                before = phases if before is None else before
                made = entered & contacts.touching(phases) & ~contacts.touching(before)
                faces = made & contacts.openings(before)[1].any(axis=1)  # that move
                if faces.any():
                    made[faces] = ~self._pressed_in(np.flatnonzero(faces), given, state)
                return StartOfMotion(before, phases, made, state)
            g = min(acting, key=lambda g: orders[g])
            j, following = int(watched.contact[g]), int(watched.following[g])
            if orders[g] > 0 and before is None:
                before = phases
            state = self._after_event(watched, g, phases, given, state)
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
        depth = FunctionsAtStart.of(self.penetrations[0].some(which), which.size)
        return np.asarray(depth.signs(self._inputs_at_start(given, 0), state, 0)[0] > 0.0)

    def _after_event(self, watched: Watched, guard: int, phases: Ints, given: Complexes, state: Floats) -> Floats:
        """(N,) state with the internal states that the event of a guard gives its contact."""
        if watched.reset[guard] < 0:
            return state
        contacts, j, count = self.system.contacts, watched.contact[guard], self.sources.count
        after = self.watched(watched, phases).some(watched.reset[guard] + np.arange(contacts.states[j]))
        values, slopes = np.split(self._inputs_at_start(given, 0).value, [count], axis=1)
        state, first = state.copy(), 2 * self.system.size + contacts.first[j]
        state[first : first + contacts.states[j]] = after.values(state[None, :], values, slopes)[0]
        return state

    def _first_signs(self, index: int, phases: Ints, given: Complexes, state: Floats) -> tuple[Floats, Ints]:
        """(g,) signs and orders of the first derivatives of a contact state's guards that are beyond their round-off.

        A sign is 0 where all derivatives are within round-off. The derivatives of the state follow from the equation of
        motion: in a sum over the modes of a stiff contact the round-off of the highest would hide them.
        """
        known = self._tables.known[index]
        signs, orders = known.guards.signs(self._inputs_at_start(given, 0), state, 0)
        if signs.all():
            return signs, orders
        count = known.watched.guards
        guards = known.functions.some(slice(0, count))
        functions = FunctionsAtStart.of(self._above_rates(guards, phases), count)
        inputs = self._inputs_at_start(given, HIGHEST_DERIVATIVE)
        for highest in (USUAL_DERIVATIVE, HIGHEST_DERIVATIVE):
            signs, orders = functions.signs(inputs, state, highest)
            if signs.all():
                break
        return signs, orders

    def _inputs_at_start(self, given: Complexes, highest: int) -> InputsAtStart:
        """The inputs with amplitudes (F,) at the start of a piece, with derivatives up to the highest."""
        inputs = given * self.sources.derivatives_at_start(highest + 2)
        pairs = np.hstack([inputs[:-1], inputs[1:]])
        fit = self._round_off_of_fits(given)[: highest + 1]
        return InputsAtStart(pairs.real, np.abs(pairs), np.hstack([fit, np.zeros_like(fit)]))

    def inputs_at(self, times: Floats, orders: int = 1, since: Floats | None = None) -> Floats:
        """Derivatives of the inputs at times, from order 0 on, and beside them those of their slopes.

        These are the columns of a `LinearOutput`'s two kinds of direct factors.

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
        inputs = (given * sources.derivatives_at_start(orders + 1)).real
        return np.concatenate([inputs[:, :-1], inputs[:, 1:]], axis=2)

    def rates(self, phases: Ints) -> LinearOutput:
        """(N,) time derivative of the state in given phases."""
        return self._above_rates(self.empty_output(0), phases)

    def outputs_of_states(
        self, times: Floats, y: Floats, phases: Ints, output_of: OutputOf, since: float | None = None
    ) -> Floats:
        """Outputs where the states are known.

        Parameters
        ----------
        times : (nt,) s.
        y : (nt, N) states then.
        phases : (nt, m) of the contacts.
        output_of : k outputs in given phases.
        since : s, time whose piece of the inputs counts; by default those at the times themselves.

        Returns
        -------
        values : (nt, k).
        """
        F, out = self.sources.count, np.empty((times.size, output_of(self.system.contacts.start).row.shape[0]))
        inputs = self.inputs_at(times, since=None if since is None else np.full(times.size, since))[:, 0]
        known, which = np.unique(phases, axis=0, return_inverse=True)
        for k, row in enumerate(known):
            here = np.flatnonzero(which.reshape(-1) == k)
            out[here] = output_of(row).values(y[here], inputs[here, :F], inputs[here, F:])
        return out

    def _round_off_of_fits(self, given: Complexes) -> Floats:
        """(orders, F) of the derivatives of inputs that are fitted by polynomials (swept sines), with amplitudes (F,).

        A coefficient is known to the round-off of the whole polynomial on its piece, not to its own.
        """
        sources, orders = self.sources, np.arange(HIGHEST_DERIVATIVE + 1)[:, None]
        fit = np.zeros((orders.size, sources.count))
        # 6: of polynomials that are fitted to inputs, at least
        for channel in set(sources.channel[sources.power >= 6].tolist()):
            of = sources.channel == channel
            length = float(sources.longest_piece[of].max())
            fit[:, of] = ROUND_OFF * float(np.abs(given[of]) @ length ** sources.power[of]) / length**orders
        return fit

    def _above_rates(self, functions: LinearOutput, phases: Ints) -> LinearOutput:
        """The functions (k,) and then the time derivative of the state (N,) in given phases."""
        n, k = self.system.size, functions.row.shape[0]
        position, speed, internal = slice(k, k + n), slice(k + n, k + 2 * n), slice(k + 2 * n, None)
        output = self.empty_output(k + self.size)
        output.row[:k], output.direct[:k], output.direct_slope[:k] = (
            functions.row, functions.direct, functions.direct_slope
        )  # fmt: skip
        stiffness, damping, pushes, load, slope = self.equation_of_motion(phases)
        output.row[position, n : 2 * n].flat[:: n + 1] = 1.0
        output.row[speed, :n], output.row[speed, n : 2 * n], output.row[speed, 2 * n :] = -stiffness, -damping, pushes
        output.direct[speed], output.direct_slope[speed] = load.T, slope.T
        if self.size > 2 * n:
            own = self.internal_rates(phases)
            output.row[internal], output.direct[internal], output.direct_slope[internal] = (
                own.row, own.direct, own.direct_slope
            )  # fmt: skip
        return output
