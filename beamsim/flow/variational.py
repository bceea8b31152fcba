"""The flow with its derivatives: what shooting and continuation ask of a system, at compiled speed.

A :class:`VariationalFlow` keeps the eigenvalue problems of the contact states and rewrites only the periodic loads'
responses when the frequency or the level changes. :meth:`VariationalFlow.carry` maps a state over a time and returns
the exact derivatives with respect to the initial state, the duration and any parameters.

For periodic loads :math:`f(t) = A\\,\\mathrm{Re} \\sum_h f_h (\\omega/\\omega_0)^{r_h} e^{i k_h \\omega t}` and, for
contacts on the ground, a base displacement of the same form.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field, replace
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from beamsim.contacts.contacts import Contacts, Watched
from beamsim.dataclass import dataclass
from beamsim.flow.contact_state import ContactState, build_state, state_matrices
from beamsim.flow.march import Motion, carry
from beamsim.flow.passage import (
    LARGEST_LOG,
    MOST_EVALUATIONS,
    ContactDirection,
    Direction,
    Frequency,
    Level,
    NotFinite,
    Parameter,
    Passage,
    PeriodicForcing,
    StructureDirection,
    WorkExceeded,
    check_finite,
    moved_system,
)
from beamsim.flow.resonant_passage import SeriesFlow, carry_by_series, is_resonant
from beamsim.flow.sources import Sources, compile_sources
from beamsim.flow.state_tables import StateTables, pad
from beamsim.flow.undamped_state import undamped_state
from beamsim.system.equations import Forcing, PiecewiseLinearSystem
from beamsim.typing import Complexes, Floats, Ints

if TYPE_CHECKING:
    from beamsim.flow.exact import ExactFlow
    from beamsim.flow.kernels import Inputs, Tables

LONGEST_WINDOW_RADIANS = 64.0  # of the slowest oscillation, before the series of a segment are started anew
LIGHT = 1e-4  # damping over frequency of a mode below which resonance takes more than four digits
RIGID = 1e-13  # of the largest eigenvalue: a rigid-body mode that stays one


class ExponentialTerms(NamedTuple):
    """Coefficients of the terms that the motion of a passage is made of, in the U contact states which it visits."""

    tables: Tables  # of these states, as far as integrals need them
    inputs: Inputs
    state: Ints  # (G,) number among these of each segment's state
    phases: Ints  # (U, m)
    displacement: Complexes  # (U, T, n)
    velocity: Complexes  # (U, T, n)
    load: Complexes  # (U, T, n) from outside
    penetration: Complexes  # (U, T, m)
    rate: Complexes  # (U, T, m) of penetration
    force: Complexes  # (U, T, m) of the contacts, without internal states
    base_rate: Complexes  # (U, T, m) velocity of the base at contacts that feel it


@dataclass
class VariationalFlow(SeriesFlow):
    """A system under periodic loads, ready to be carried over a time with all derivatives.

    Parameters
    ----------
    system : the structure.
    forcing : its periodic loads (default: none).
    omega, level : where to begin; change them by :meth:`set`.
    twin : a flow of the same structure with other contacts: its open state is shared, and the states it visited are
        expected here.
    """

    differentiates = (Frequency, Level, ContactDirection, StructureDirection)

    system: PiecewiseLinearSystem
    forcing: PeriodicForcing | None = None
    omega: float = 1.0
    level: float = 1.0
    twin: VariationalFlow | None = None
    passages: int = field(init=False, default=0)

    def __post_init__(self) -> None:
        n = self.system.size
        self.loads = PeriodicForcing.none(n) if self.forcing is None else self.forcing
        H = self.loads.count
        self.size = 2 * n + self.system.contacts.internal_states
        self._sources = _constant_source()
        self._constant = Forcing(np.zeros((0, n)), ())
        self._states: list[ContactState] = []
        self._lightly_damped = False
        self._state_tables = StateTables(self.system.contacts)
        self._tables: Any = None
        self._known_parameters: dict[tuple[type[Parameter], ...], Any] = {}
        contacts = self.system.contacts
        from beamsim.flow.kernels import Inputs

        self._coupled = contacts.jointly_acting  # for the compiled sensitivities a contact acts by itself
        self._resonant = self._coupled
        self._series: ExactFlow | None = None
        self._terms: tuple[Passage, tuple[float, float], ExponentialTerms | None] | None = None  # of the last passage
        self._inputs = Inputs(
            np.zeros(1), np.ones((1, 1 + H), dtype=complex), np.zeros(1 + H, dtype=complex),
            np.zeros(1 + H, dtype=np.int64), np.arange(1 + H),
        )  # fmt: skip
        stiffest = np.abs(contacts.arrays.force[:, :, 0]).max(axis=1, initial=0.0)
        rates = np.concatenate([self.system.stiffness, stiffest * (contacts.shape**2).sum(axis=1)])
        slowest = float(np.sqrt(rates[rates > 0].min())) if np.any(rates > 0) else 1.0
        self._window = LONGEST_WINDOW_RADIANS / slowest
        if self.twin is not None:
            for state in self.twin._states:
                free = not any(np.any(c.force_rows(state.phases)[0]) for c in (contacts, self.twin.system.contacts))
                if free and not contacts.internal_states and state.horizon <= self._window:
                    self._keep(state)
                else:
                    self.state_index(state.phases)
            self.twin = None

    # -- contact states ------------------------------------------------------------------------------------------

    def state_index(self, phases: Ints) -> int:
        """Number of the contact state, diagonalised when it is first asked for."""
        known = self._state_tables.index(phases)
        if known is not None:
            return known
        state = undamped_state(self.system, phases, self._window)
        if state is None:
            nearest = self._state_tables.nearest(phases)
            state = build_state(
                self.system, self._constant, self._sources, -1, phases, self._window,
                None if nearest is None else self._states[nearest],
            )  # fmt: skip
        return self._keep(state)

    def _keep(self, state: ContactState) -> int:
        """Number a new state."""
        self._states.append(state)
        self._tables = None
        forced, watched = self._with_forced(state), self.system.contacts.watched(state.phases)
        watch = self._watch(forced, watched)
        self._coupled = self._coupled or self.system.contacts.coupled(state.phases)
        if self.loads.count:
            light = np.abs(state.exponent.real) < LIGHT * np.abs(state.exponent.imag)
            self._lightly_damped = self._lightly_damped or bool(light.any())
        return self._state_tables.append(forced, watched, watch, np.abs(watch[:, : watched.guards]))

    def _prepare(self) -> None:
        """Tables of all states so far, and what the sensitivities need beside them."""
        from beamsim.flow.orbit_kernels import PeriodicLoads, Variation

        S, H = len(self._states), self.loads.count
        free = [np.flatnonzero(s.term_source >= 1) for s in self._states]
        columns = [s.term_vector[terms].T for s, terms in zip(self._states, free, strict=True)]
        self._simple = all(
            terms.size == s.projector.shape[0] and not np.any(s.power)
            for s, terms in zip(self._states, free, strict=True)
        )
        self._tables = self._state_tables.arrays()
        self._variation = Variation(
            pad([np.stack([s.projector.real, s.projector.imag], 1).reshape(-1, self.size) for s in self._states]),
            pad([np.stack([u.real, -u.imag], 2).reshape(self.size, -1) for u in columns]),
            np.array([terms.size for terms in free]),
            pad([s.term_basis[terms] for s, terms in zip(self._states, free, strict=True)]),
            pad([s.term_source[terms] - 1 for s, terms in zip(self._states, free, strict=True)]),
            np.array([s.term_basis.size for s in self._states]),
            self.loads.multiple.astype(float),
            np.zeros(H, dtype=complex),
        )
        self._first_basis = np.array([s.exponent.size for s in self._states])
        matrices = [state_matrices(self.system, s.phases) for s in self._states]
        self._K, self._C = (np.array(each) for each in zip(*matrices, strict=True))
        self._derivative = np.zeros((2, S, H, self.size), dtype=complex)
        self._base_derivative = np.zeros((2, H), dtype=complex)
        loads = self.loads
        self._periodic_loads = PeriodicLoads(
            np.ascontiguousarray(loads.force, dtype=complex), loads.force_power, loads.base, loads.base_power,
            loads.reference, self._first_basis, self._K, self._C, self._derivative, self._base_derivative,
        )  # fmt: skip
        self._known_parameters.clear()
        self._force()

    def _with_forced(self, s: ContactState) -> ContactState:
        """The state with zero responses to the periodic loads, which are rewritten with the frequency."""
        H = self.loads.count
        new, none = np.arange(H), np.zeros(H, dtype=np.int64)
        return replace(
            s,
            exponent=np.append(s.exponent, none),
            power=np.append(s.power, none),
            term_basis=np.append(s.term_basis, s.exponent.size + new),
            term_source=np.append(np.where(s.term_source > 0, s.term_source + H, 0), 1 + new),
            term_vector=np.vstack([s.term_vector, np.zeros((H, self.size))]),
        )

    def _watch(self, s: ContactState, watched: Watched) -> Complexes:
        """(T, w) watched functions of a state's terms, zero for the periodic loads'."""
        n, contacts = self.system.size, self.system.contacts
        shape = -contacts.sign[:, None] * contacts.shape
        delta = s.term_vector[:, :n] @ shape.T
        rate = s.term_vector[:, n : 2 * n] @ shape.T
        constant = int(np.flatnonzero((s.term_source == 0) & (s.power[s.term_basis] == 0))[0])
        delta[constant] -= contacts.gap
        row, of = watched.row, watched.contact
        table = row[:, 0] * delta[:, of] + row[:, 1] * rate[:, of] + s.term_vector[:, 2 * n :] @ watched.internal.T
        table[constant] += row[:, 2]
        return np.asarray(table)

    def _force(self) -> None:
        """Rewrite the periodic loads' responses at the present frequency and level."""
        self._resonant = self._coupled
        if self.loads.count == 0 or self._coupled:
            return
        from beamsim.flow.orbit_kernels import set_loads

        self._resonant = self._lightly_damped and is_resonant(self._states, self.loads.multiple, self.omega)
        if self._resonant:  # the particular solution has no bound: see carry
            return
        contacts = self.system.contacts.arrays
        if not set_loads(
            self._tables, self._inputs, contacts, self._variation, self._periodic_loads, self.omega, self.level
        ):
            raise NotFinite("the loads or the responses to them leave the range of floating-point numbers")

    def set(self, omega: float | None = None, level: float | None = None) -> None:
        """Change frequency and level; contact states are kept."""
        omega = self.omega if omega is None else float(omega)
        level = self.level if level is None else float(level)
        if omega == self.omega and level == self.level:
            return
        self.omega, self.level = omega, level
        self._series = None
        if self._tables is not None:
            self._force()

    def note_loads(self, omega: float, level: float) -> None:
        """Frequency and level at which a kernel has left the responses to the loads."""
        self.omega, self.level = float(omega), float(level)
        self._series = None

    def under(self, omega: float, level: float) -> VariationalFlow:
        """A flow of the same structure at another frequency and level."""
        return VariationalFlow(self.system, self.forcing, omega, level)

    def moved(self, direction: ContactDirection, amount: float) -> VariationalFlow:
        """A flow of the same structure with its contacts moved along a direction."""
        return self.with_contacts(moved_system(self.system, direction, amount).contacts)

    def with_contacts(self, contacts: Contacts) -> VariationalFlow:
        """The flow of the same structure with other contacts of as many phases, its states numbered alike."""
        system = replace(self.system, contacts=contacts)
        return VariationalFlow(system, self.forcing, self.omega, self.level, twin=self)

    def with_damping(self, damping: Floats) -> VariationalFlow:
        """The flow of the same structure with another damping matrix (n, n), its states numbered alike."""
        flow = VariationalFlow(replace(self.system, damping=damping), self.forcing, self.omega, self.level)
        for state in self._states:
            flow.state_index(state.phases)
        return flow

    @property
    def fastest(self) -> float:
        """rad/s, largest rate of any motion in the contact states so far, and of the loads."""
        free = max((float(np.abs(s.exponent).max(initial=0.0)) for s in self._states), default=0.0)
        return max(free, float(np.abs(self.loads.multiple * self.omega).max(initial=0.0)))

    # -- motion --------------------------------------------------------------------------------------------------

    def kernel_arguments(self) -> tuple[Tables, Inputs, None]:
        """What the march takes; see :class:`beamsim.flow.march.Marched`."""
        if self._tables is None:
            self._prepare()
        return self._tables, self._inputs, None

    def equal_steps(self) -> None:
        """None: the loads have no pieces."""

    def shooting_tables(self, kind: Frequency | Level) -> tuple[Any, ...] | None:
        """What :func:`beamsim.orbits.newton_kernels.solve_periodic` takes, which rewrites the loads' responses; None
        where these may have no bound."""
        if self.system.contacts.jointly_acting:
            return None
        if not self._states:
            self.state_index(self.system.contacts.start)
        if self._tables is None:
            self._prepare()
        if self._coupled or self._lightly_damped:
            return None
        contacts, parameters = self.system.contacts.arrays, self._parameters((kind,))
        return self._tables, self._inputs, contacts, self._variation, parameters, self._periodic_loads

    def follow(self, state: int, guard: int) -> int:
        """The state after the event of a guard."""
        return self.state_index(self._state_tables.following(state, guard))

    def visits(self, states: Ints) -> Ints:
        """The numbers of the states, which are all kept."""
        return states

    def time_of(self, motion: Motion) -> float:
        """Time of a motion, s."""
        return motion.time

    def starting_state(self, z: Floats, t: float = 0.0) -> Ints:
        """Phases of the contacts at a motion; where a guard is zero the sign of its rate decides, then of the next."""
        from beamsim.flow.orbit_kernels import phases_at_start

        n, contacts = self.system.size, self.system.contacts
        if contacts.jointly_acting:
            return self.by_series().starting_state(z, t)
        phases = contacts.start
        if contacts.count == 0:
            return phases
        d, dv = self.base_motion(t) if self.base_moves else (0.0, 0.0)
        if not phases_at_start(contacts.arrays, z, d, dv, phases):
            load = self.system.constant_load.astype(float)
            force = self.loads.at(self.omega, self.level)[0]
            load = load + (force * np.exp(1j * self.loads.multiple * self.omega * t)[:, None]).sum(axis=0).real
            q, v = z[:n], z[n : 2 * n]
            delta = -contacts.gap - contacts.sign * (contacts.shape @ q + contacts.felt * d)
            rate = -contacts.sign * (contacts.shape @ v + contacts.felt * dv)
            push = contacts.forces(phases[None], delta[None], rate[None], z[None, 2 * n :])[0] * contacts.sign
            acceleration = load - self.system.stiffness * q - self.system.damping @ v + push @ contacts.shape
            bend = -contacts.sign * (contacts.shape @ acceleration)
            watched, size = contacts.watched(phases), np.abs(contacts.gap) + np.abs(contacts.shape) @ np.abs(q)
            for g in range(watched.guards):
                j, row = watched.contact[g], watched.row[g]
                value = row[0] * delta[j] + row[2] + watched.internal[g] @ z[2 * n :]
                near = row[1] == 0.0 and rate[j] == 0.0 and abs(value) <= 1e-12 * abs(row[0]) * size[j]
                if near and row[0] * bend[j] < 0.0:
                    phases[j] = watched.following[g]
        return phases

    def carry(self, start: Floats, duration: float, parameters: Sequence[Parameter] = (), t: float = 0.0) -> Passage:
        """The state after ``duration``, with its derivatives; see :class:`beamsim.flow.periodic_flow.PeriodicFlow`.

        A change of contacts or structure costs two more passages where the motion is not made of pure exponentials.
        """
        from beamsim.flow.orbit_kernels import carry_sensitivity

        N = self.size
        self.passages += 1
        if not self.system.contacts.jointly_acting:
            motion = Motion(start.copy(), self.state_index(self.starting_state(start, t)), time=t)
            self.kernel_arguments()
        if not self._resonant:
            carried = carry(
                self, motion, (t + duration,), keep=True, max_events=LARGEST_LOG, max_evaluations=MOST_EVALUATIONS
            )
        if self._resonant:  # from the start, or since a state that was not known before
            return carry_by_series(self, self.by_series(), start, duration, parameters, t)
        check_finite(motion.y)
        if not carried.outcome.complete:
            raise WorkExceeded(carried.outcome.message)
        log = carried.log
        assert log is not None
        exact = [p for p in parameters if self._simple or isinstance(p, Frequency | Level)]
        P = len(exact)
        sens = np.zeros((N, N + P))
        sens.flat[:: N + P + 1] = 1.0
        slope = np.zeros(N)
        carry_sensitivity(
            self._tables, self._inputs, self.system.contacts.arrays, self._variation, self._parameters(exact),
            log.time.size, *log[:5], log.event_contact, sens, slope,
        )  # fmt: skip
        passage = Passage(
            start, motion.y, sens[:, :N], sens[:, N:], slope, duration, log.time, log.length, log.state, log.y,
            log.event_time, log.event_contact, log.event_phase,
        )  # fmt: skip
        if len(parameters) > P:
            columns, k = [], 0
            for p in parameters:
                if isinstance(p, ContactDirection | StructureDirection):
                    columns.append(self.by_difference(start, duration, p, t))
                else:
                    columns.append(passage.parameters[:, k])
                    k += 1
            passage = replace(passage, parameters=np.array(columns).T)
        return passage

    def _parameters(self, parameters: Sequence[Parameter]) -> Any:
        from beamsim.flow.orbit_kernels import Parameters

        kinds = tuple(type(p) for p in parameters)
        known = self._known_parameters.get(kinds)
        if known is not None:  # what moves with frequency and level in it is a view of what _force writes
            return known
        n, m, H = self.system.size, self.system.contacts.count, self.loads.count
        P, S, phases = len(parameters), len(self._states), self.system.contacts.arrays.touching.shape[1]
        k = n if StructureDirection in kinds else 0
        out = Parameters(
            np.zeros(P, dtype=bool), np.zeros((P, S, H, self.size), dtype=complex), np.zeros((P, H), dtype=complex),
            np.zeros(P, dtype=bool), np.zeros((P, m, phases, 3)), np.zeros((P, m, phases)), np.zeros((P, m)),
            np.zeros((P, m, n)),
            np.zeros(P, dtype=bool), np.zeros((P, k, k)), np.zeros((P, k, k)), np.zeros((P, k, k)), np.zeros((P, k)),
            np.zeros((P, H, k), dtype=complex),
        )  # fmt: skip
        periodic = [0 if kind is Frequency else 1 if kind is Level else -1 for kind in kinds]
        out.moves_frequency[:] = [H > 0 and which == 0 for which in periodic]
        if P == 0 or (P == 1 and periodic[0] >= 0):
            if P and H:
                row = slice(periodic[0], periodic[0] + 1)
                out = out._replace(terms=self._derivative[row], base=self._base_derivative[row])
            self._known_parameters[kinds] = out
            return out
        for i, (p, which) in enumerate(zip(parameters, periodic, strict=True)):
            if isinstance(p, ContactDirection):
                out.moves_contacts[i] = True
                out.gap[i], out.shape[i] = p.gap, p.shape
                out.law[i], out.decay[i] = p.law_rates(self.system.contacts)
            elif isinstance(p, StructureDirection):
                out.moves_structure[i] = True
                out.structure_stiffness[i], out.structure_damping[i] = p.stiffness, p.damping
                out.structure_mass[i], out.load[i], out.force[i] = p.mass, p.load, p.force
            elif H:
                out.terms[i] = self._derivative[which]
                out.base[i] = self._base_derivative[which]
        return out

    def by_difference(self, start: Floats, duration: float, direction: Direction, t: float) -> Floats:
        """Central difference by a direction, for states whose motion is not made of pure exponentials."""
        if isinstance(direction, StructureDirection):
            return self._by_structure(start, duration, direction, t)
        contacts = self.system.contacts
        scale = max(
            (
                float(np.max(np.abs(rate), initial=0.0)) / max(float(np.max(np.abs(value), initial=0.0)), 1e-12)
                for rate, value in (
                    (direction.stiffness, contacts.arrays.force[:, :, 0]),
                    (direction.dashpot, contacts.arrays.force[:, :, 1]), (direction.shape, contacts.shape),
                    (np.array([direction.along is not None], dtype=float), np.ones(1)),
                )
            ),
            default=0.0,
        )  # fmt: skip
        gap = float(np.max(np.abs(direction.gap), initial=0.0))
        if gap > 0:
            scale = max(scale, gap / max(float(np.max(np.abs(start[: self.system.size] @ contacts.shape.T))), 1e-9))
        h = 1e-6 / scale if scale > 0 else 1e-6
        up = self.moved(direction, h).carry(start, duration, (), t).end
        down = self.moved(direction, -h).carry(start, duration, (), t).end
        return np.asarray((up - down) / (2 * h))

    def _by_structure(self, start: Floats, duration: float, direction: StructureDirection, t: float) -> Floats:
        n, s = self.system.size, self.system
        elastic = s.stiffness[s.stiffness > 0]
        lowest, highest = (float(elastic.min()), float(elastic.max())) if elastic.size else (1.0, 1.0)
        pull = lowest * float(np.linalg.norm(start[:n])) + float(np.abs(s.constant_load).max())
        scale = max(
            float(np.abs(direction.mass).max()), float(np.abs(direction.stiffness).max()) / lowest,
            float(np.abs(direction.damping).max()) / float(np.sqrt(highest)),
            float(np.abs(direction.load).max()) / max(pull, 1e-9),
            float(np.max(np.abs(direction.force), initial=0.0))
            / max(float(np.max(np.abs(self.loads.force), initial=0.0)) * abs(self.level), 1e-9),
        )  # fmt: skip
        h = 1e-6 / scale if scale > 0 else 1e-6
        ends = []
        for amount in (h, -h):
            flow, shapes = self.restructured(direction, amount)
            back = np.linalg.inv(shapes)
            z = start.copy()
            z[:n], z[n : 2 * n] = back @ start[:n], back @ start[n : 2 * n]
            end = flow.carry(z, duration, (), t).end
            end[:n], end[n : 2 * n] = shapes @ end[:n], shapes @ end[n : 2 * n]
            ends.append(end)
        return np.asarray((ends[0] - ends[1]) / (2 * h))

    def restructured(self, direction: StructureDirection, amount: float) -> tuple[VariationalFlow, Floats]:
        """The flow of the structure moved along a direction, in its own modes, and their shapes (n, n) in the present
        coordinates."""
        s, loads = self.system, self.loads
        L = np.linalg.cholesky(np.eye(s.size) + amount * direction.mass)
        half = np.linalg.solve(L, np.diag(s.stiffness) + amount * direction.stiffness)
        values, vectors = np.linalg.eigh(np.linalg.solve(L, half.T))
        T = np.linalg.solve(L.T, vectors)
        rigid = np.abs(values) <= RIGID * float(np.abs(values).max())
        moved = replace(
            s,
            stiffness=np.where(rigid, 0.0, values),
            damping=T.T @ (s.damping + amount * direction.damping) @ T,
            contacts=replace(s.contacts, shape=s.contacts.shape @ T),
            constant_load=T.T @ (s.constant_load + amount * direction.load),
        )
        if loads.count:
            unit = self.level * (self.omega / loads.reference) ** loads.force_power
            loads = replace(loads, force=(loads.force + amount * direction.force / unit[:, None]) @ T)
        return VariationalFlow(moved, loads, self.omega, self.level), T

    def by_series(self) -> ExactFlow:
        """The transient flow under the present loads, its contact states numbered as here."""
        if self._series is None:
            self._series = self.exact_flow(self._window)
            for state in self._states:
                self._series.state_index(state.phases)
        self._number_states_of(self._series)
        return self._series

    def _number_states_of(self, exact: ExactFlow) -> None:
        """Make here the states that the transient flow has made by itself to find how a motion starts."""
        for phases in exact.visited[len(self._states) :]:
            self.state_index(phases)

    def number_in(self, exact: ExactFlow, phases: Ints) -> int:
        """Number of a contact state, made the same in a transient flow."""
        self._number_states_of(exact)
        index = self.state_index(phases)
        for state in self._states[len(exact.states) :]:
            exact.state_index(state.phases)
        return index

    def exact_flow(self, duration: float) -> ExactFlow:
        """The same structure and loads for long runs and outputs."""
        from beamsim.flow.exact import ExactFlow

        return ExactFlow(self.system, self.loads.signals(self.omega, self.level), duration)

    def contact_forces(self, phases: Ints, y: Floats, times: Floats) -> Floats:
        """(nt, m) forces of the contacts at states (nt, N) in phases (nt, m), N."""
        if self.system.contacts.jointly_acting:
            return self.by_series().forces_at(phases, y, times)
        return super().contact_forces(phases, y, times)

    def phases_in(self, passage: Passage) -> Ints:
        """(G, m) phases of the contacts in each segment of a passage."""
        phases = np.array([self._states[k].phases for k in passage.state], dtype=np.int64)
        return phases.reshape(passage.state.size, self.system.contacts.count)

    def states_at(self, passage: Passage, times: Floats) -> Floats:
        """(nt, N) the state at increasing times within a passage."""
        from beamsim.flow.march_kernels import sample

        out = np.empty((times.size, self.size))
        tables, inputs, segments = self._segments(passage)
        sample(tables, inputs, None, tables.term_vector, *segments, np.ascontiguousarray(times), out)
        return out

    def states_evenly(self, passage: Passage, count: int) -> Floats:
        """(count, N) the state at equidistant times of a passage from t = 0, the end left out."""
        from beamsim.flow.march_kernels import sample_evenly

        out, step = np.empty((count, self.size)), passage.duration / count
        tables, inputs, segments = self._segments(passage)
        sample_evenly(tables, inputs, tables.term_vector, *segments, np.arange(count) * step, step, out)
        return out

    def exponential_terms(self, passage: Passage) -> ExponentialTerms | None:
        """The terms of a passage's motion, those of the last one kept; None where some have powers of time."""
        known = self._terms
        if known is None or known[0] is not passage or known[1] != (self.omega, self.level):
            known = self._terms = passage, (self.omega, self.level), self._terms_of(passage)
        return known[2]

    def _terms_of(self, passage: Passage) -> ExponentialTerms | None:
        if self._tables is None:
            self._prepare()
        t, n, contacts = self._tables, self.system.size, self.system.contacts
        used, state = np.unique(passage.state, return_inverse=True)
        if self._resonant or np.any(t.power[used]):
            return None
        source, vector = t.term_source[used], t.term_vector[used]
        load = np.zeros((used.size, vector.shape[1], n), dtype=complex)
        base = np.zeros((used.size, vector.shape[1], contacts.count), dtype=complex)
        base_rate = np.zeros_like(base)
        constant = np.arange(used.size), np.argmax(source == 0, axis=1)
        load[constant] = self.system.constant_load
        force, moved, _, _ = self.loads.at(self.omega, self.level)
        for h, multiple in enumerate(self.loads.multiple):
            load[source == 1 + h] = force[h]
            base[source == 1 + h] = contacts.felt * moved[h]
            base_rate[source == 1 + h] = 1j * multiple * self.omega * contacts.felt * moved[h]
        displacement, velocity = vector[:, :, :n], vector[:, :, n : 2 * n]
        penetration = -contacts.sign * (displacement @ contacts.shape.T + base)
        penetration[constant] -= contacts.gap
        rate = -contacts.sign * (velocity @ contacts.shape.T + base_rate)
        row = contacts.arrays.force[np.arange(contacts.count), t.phase[used]]
        contact_force = row[:, None, :, 0] * penetration + row[:, None, :, 1] * rate
        contact_force[constant] += row[:, :, 2]
        tables = t._replace(
            n_terms=t.n_terms[used], term_basis=t.term_basis[used], term_source=source, term_vector=vector,
            exponent=t.exponent[used], power=t.power[used], n_free=t.n_free[used], projector=t.projector[used],
        )  # fmt: skip
        return ExponentialTerms(
            tables, self._inputs, state, t.phase[used], displacement, velocity, load, penetration, rate,
            contact_force, base_rate,
        )  # fmt: skip

    def _segments(self, passage: Passage) -> tuple[Tables, Inputs, tuple[Floats, Ints, Ints, Floats]]:
        """Tables, sources and segments of a passage as the samplers take them."""
        if self._tables is None:
            self._prepare()
        tables, inputs = self._tables, self._inputs
        if self._resonant:
            tables, inputs = self.by_series().tables(), self.by_series().inputs()
        return tables, inputs, (passage.time, passage.state, np.zeros_like(passage.state), passage.y)


@cache
def _constant_source() -> Sources:
    return compile_sources(())


def floquet_multipliers(monodromy: Floats) -> Complexes:
    """Eigenvalues of a monodromy matrix, the largest first."""
    values = np.linalg.eigvals(monodromy).astype(complex)
    return np.asarray(values[np.lexsort((-values.imag, -np.abs(values)))])
