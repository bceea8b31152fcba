"""The flow with its derivatives: what shooting and continuation ask of a system, at compiled speed.

A :class:`VariationalFlow` keeps the eigenvalue problems of the contact states and rewrites only the periodic loads'
responses when the frequency or the level changes. :meth:`VariationalFlow.carry` maps a state over a time and returns
the exact derivatives with respect to the initial state, the duration and any parameters.

For periodic loads :math:`f(t) = A\\,\\mathrm{Re} \\sum_h f_h (\\omega/\\omega_0)^{r_h} e^{i k_h \\omega t}` and, for
contacts on the ground, a base displacement of the same form.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.contacts.contacts import Contacts
from beamsim.flow.contact_state import ContactState, build_state
from beamsim.flow.resonant_passage import carry_by_series, is_resonant
from beamsim.flow.sources import Sources, compile_sources
from beamsim.flow.undamped_state import undamped_state
from beamsim.inputs.signal import Signal
from beamsim.system.equations import Forcing, PiecewiseLinearSystem
from beamsim.typing import Bools, Complexes, Floats, Ints

if TYPE_CHECKING:
    from beamsim.flow.exact import ExactFlow

MOST_EVALUATIONS = 20_000_000
FIRST_LOG = 64
LONGEST_WINDOW_RADIANS = 64.0  # of the slowest oscillation, before the series of a segment are started anew
LARGEST_LOG = 65536
LIGHT = 1e-4  # damping over frequency of a mode below which resonance takes more than four digits
RIGID = 1e-13  # of the largest eigenvalue: a rigid-body mode that stays one


class WorkExceeded(ArithmeticError):
    """A passage needed more events or evaluations than allowed (chattering)."""


def penetration_of_states(contacts: Contacts, y: Floats, base: tuple[Floats, Floats] | None) -> tuple[Floats, Floats]:
    """Penetration and its rate, (nt, m) each, of states (nt, N) and the base's displacement and velocity (nt,)."""
    n, shape = contacts.shape.shape[1], -contacts.sign[:, None] * contacts.shape
    delta, rate = y[:, :n] @ shape.T - contacts.gap, y[:, n:] @ shape.T
    if base is not None:
        sign = -contacts.sign * contacts.on_ground
        delta, rate = delta + np.multiply.outer(base[0], sign), rate + np.multiply.outer(base[1], sign)
    return delta, rate


@dataclass(frozen=True)
class PeriodicForcing:
    """H periodic loads, each ``level * Re(force (omega/reference)^power e^{i multiple omega t})``."""

    multiple: Ints  # (H,) of the fundamental frequency, from 1
    force: Complexes  # (H, n) generalised force for level 1 at the reference frequency
    force_power: Floats  # (H,) r_h
    base: Complexes  # (H,) base displacement, m, for level 1 at the reference frequency
    base_power: Floats  # (H,)
    reference: float  # omega_0, rad/s

    @classmethod
    def none(cls, size: int) -> PeriodicForcing:
        """No excitation."""
        nothing = np.zeros(0)
        return cls(
            np.zeros(0, dtype=np.int64), np.zeros((0, size), dtype=complex), nothing, nothing.astype(complex),
            nothing, 1.0
        )  # fmt: skip

    @classmethod
    def harmonic(cls, force: Floats, reference: float = 1.0) -> PeriodicForcing:
        """One load vector times ``sin(omega t)``."""
        return cls(
            np.ones(1, dtype=np.int64), -1j * np.asarray(force, dtype=complex)[None, :], np.zeros(1),
            np.zeros(1, dtype=complex), np.zeros(1), reference,
        )  # fmt: skip

    @property
    def count(self) -> int:
        """H."""
        return int(self.multiple.size)

    def at(self, omega: float, level: float) -> tuple[Complexes, Complexes, Complexes, Complexes]:
        """Loads and base displacements at a frequency and level, and their derivatives by the frequency."""
        ratio = omega / self.reference
        force = self.force * (level * ratio**self.force_power)[:, None]
        base = self.base * (level * ratio**self.base_power)
        return force, base, force * (self.force_power / omega)[:, None], base * (self.base_power / omega)

    def base_motion(self, omega: float, level: float, times: Floats) -> tuple[Floats, Floats]:
        """(nt,) displacement and velocity of the base."""
        iw = 1j * self.multiple * omega
        moving = self.at(omega, level)[1] * np.exp(np.multiply.outer(times, iw))
        return moving.sum(axis=1).real, (moving * iw).sum(axis=1).real

    def signals(self, omega: float, level: float) -> Forcing:
        """The same loads for :class:`beamsim.flow.exact.ExactFlow`."""
        force, base, _, _ = self.at(omega, level)
        load: list[Floats] = []
        signal: list[Signal] = []
        for h in range(self.count):
            w = float(self.multiple[h]) * omega
            load += [force[h].real, force[h].imag]
            signal += [Signal.harmonic(1.0, w, np.pi / 2), Signal.harmonic(-1.0, w)]
        displacement = None
        if np.any(base):
            displacement = Signal.harmonic(np.abs(base), self.multiple * omega, np.angle(base) + np.pi / 2)
        n = self.force.shape[1]
        return Forcing(np.array(load).reshape(len(load), n), tuple(signal), displacement)


@dataclass(frozen=True)
class Frequency:
    """The parameter omega, rad/s."""


@dataclass(frozen=True)
class Level:
    """The parameter that multiplies all periodic loads."""


@dataclass(frozen=True)
class ContactDirection:
    """A parameter p along which the contacts' numbers change: their derivatives by p (shape by its vector)."""

    stiffness: Floats  # (m,)
    dashpot: Floats  # (m,)
    gap: Floats  # (m,)
    shape: Floats  # (m, n)

    @classmethod
    def of(
        cls,
        contacts: Contacts,
        stiffness: Any = 0.0,
        dashpot: Any = 0.0,
        gap: Any = 0.0,
        shape: Any = 0.0,
    ) -> ContactDirection:
        """Broadcast numbers to all contacts."""

        def spread(value: Any, like: Floats) -> Floats:
            return np.array(np.broadcast_to(np.asarray(value, dtype=float), like.shape))

        return cls(
            spread(stiffness, contacts.stiffness),
            spread(dashpot, contacts.stiffness),
            spread(gap, contacts.stiffness),
            spread(shape, contacts.shape),
        )


@dataclass(frozen=True)
class StructureDirection:
    """A parameter p along which the structure's matrices and loads change: their derivatives by p.

    The mass matrix is one at p = 0.
    """

    stiffness: Floats  # (n, n) symmetric, 1/s^2
    damping: Floats  # (n, n) symmetric, 1/s
    mass: Floats  # (n, n) symmetric
    load: Floats  # (n,) constant loads
    force: Complexes  # (H, n) periodic loads, as they are at the present frequency and level

    @classmethod
    def of(
        cls,
        size: int,
        stiffness: Any = 0.0,
        damping: Any = 0.0,
        mass: Any = 0.0,
        load: Any = 0.0,
        force: Any = None,
        harmonics: int = 0,
    ) -> StructureDirection:
        """Matrices (n, n) or their diagonals (n,), loads (n,) and (H, n); what isn't given doesn't change."""

        def matrix(value: Any) -> Floats:
            value = np.asarray(value, dtype=float)
            return np.array(value if value.ndim == 2 else np.diag(np.broadcast_to(value, size)))

        none = np.zeros((harmonics, size), dtype=complex)
        return cls(
            matrix(stiffness), matrix(damping), matrix(mass),
            np.array(np.broadcast_to(np.asarray(load, dtype=float), size)),
            none if force is None else np.array(force, dtype=complex),
        )  # fmt: skip


Direction = ContactDirection | StructureDirection
Parameter = Frequency | Level | Direction


@dataclass(frozen=True)
class Passage:
    """One carried state: where it ended, what happened, and the derivatives."""

    start: Floats  # (N + m,) y and faces
    end: Floats  # (N + m,)
    transition: Floats  # (N + m, N + m) derivative by the start
    parameters: Floats  # (N + m, P) derivative by the parameters at fixed times
    slope: Floats  # (N + m,) time derivative at the end
    duration: float  # s
    time: Floats  # (G,) start of each segment, s
    length: Floats  # (G,) s
    state: Ints  # (G,) contact state of each segment
    y: Floats  # (G, N) at each segment's start
    face: Floats  # (G, m)
    event_time: Floats  # (E,) s
    event_contact: Ints  # (E,)
    event_closing: Bools  # (E,)
    smallest_event_speed: float  # |dg/dt| at events whose force jumps, infinite without one

    @property
    def signature(self) -> tuple[tuple[int, bool], ...]:
        """Order of contacts closing and opening."""
        return tuple(zip(self.event_contact.tolist(), self.event_closing.tolist(), strict=True))


@dataclass
class VariationalFlow:
    """A system under periodic loads, ready to be carried over a time with all derivatives.

    Parameters
    ----------
    system : the structure.
    forcing : its periodic loads (default: none).
    omega, level : where to begin; change them by :meth:`set`.
    twin : a flow of the same structure with other contacts: its open state is shared, and the states it visited are
        expected here.
    """

    system: PiecewiseLinearSystem
    forcing: PeriodicForcing | None = None
    omega: float = 1.0
    level: float = 1.0
    twin: VariationalFlow | None = None
    passages: int = field(init=False, default=0)

    def __post_init__(self) -> None:
        n, m = self.system.size, self.system.contacts.count
        self.loads = PeriodicForcing.none(n) if self.forcing is None else self.forcing
        H = self.loads.count
        self.size = 2 * n + m
        self._grounded = bool(H) and bool(np.any(self.system.contacts.on_ground))
        self._sources = _constant_source()
        self._constant = Forcing(np.zeros((0, n)), ())
        self._states: list[ContactState] = []
        self._lightly_damped = False
        self._index: dict[bytes, int] = {}
        self._follower = np.full((0, m), -1, dtype=np.int64)
        self._tables: Any = None
        self._known_parameters: dict[tuple[type[Parameter], ...], Any] = {}
        self._log: tuple[Any, ...] = ()
        self._event_log: tuple[Any, ...] = ()
        self._room(FIRST_LOG)
        contacts = self.system.contacts
        from beamsim.flow.kernels import Inputs
        from beamsim.flow.orbit_kernels import ContactArrays

        def plain(a: Any) -> Any:
            return np.ascontiguousarray(a)

        self._contacts = ContactArrays(
            plain(contacts.shape), plain(contacts.sign), plain(contacts.stiffness), plain(contacts.dashpot),
            plain(contacts.gap), plain(contacts.on_ground),
        )  # fmt: skip
        with np.errstate(divide="ignore", invalid="ignore"):
            rate = np.where(contacts.dashpot > 0, contacts.stiffness / contacts.dashpot, 0.0)
        self._has_face = np.asarray(contacts.no_tension & (contacts.dashpot > 0))
        self._resonant = False
        self._series: ExactFlow | None = None
        self._any_face = bool(self._has_face.any())
        self._inputs = Inputs(
            np.zeros(1), np.ones((1, 1 + H), dtype=complex), np.zeros(1 + H, dtype=complex),
            np.zeros(1 + H, dtype=np.int64), np.arange(1 + H), self._has_face, rate,
        )  # fmt: skip
        rates = np.concatenate([self.system.stiffness, contacts.stiffness * (contacts.shape**2).sum(axis=1)])
        slowest = float(np.sqrt(rates[rates > 0].min())) if np.any(rates > 0) else 1.0
        self._window = LONGEST_WINDOW_RADIANS / slowest
        if self.twin is not None:
            for state in self.twin._states:
                if not state.closed.any() and not self._has_face.any() and state.horizon <= self._window:
                    self._keep(state)
                else:
                    self.state_index(state.closed)
            self.twin = None
        self.free = np.concatenate([np.ones(2 * n, dtype=bool), self._has_face])

    # -- contact states ------------------------------------------------------------------------------------------

    @property
    def reversible(self) -> bool:
        """Undamped and unforced: motions run backwards as well."""
        return self.loads.count == 0 and not np.any(self.system.damping) and not np.any(self.system.contacts.dashpot)

    def state_index(self, closed: Bools) -> int:
        """Number of the contact state, diagonalised when it is first asked for."""
        key = closed.tobytes()
        found = self._index.get(key)
        if found is None:
            state = undamped_state(self.system, closed, self._window)
            if state is None:
                state = build_state(self.system, self._constant, self._sources, -1, closed, self._window)
            found = self._keep(state)
        return found

    def learn(self, other: VariationalFlow) -> None:
        """Number the contact states that another flow of the same structure visited, in its order."""
        for state in other._states:
            self.state_index(state.closed)

    def _keep(self, state: ContactState) -> int:
        """Number a new state and connect it with those it follows."""
        found, closed = len(self._states), state.closed
        self._index[closed.tobytes()] = found
        self._follower = np.vstack([self._follower, np.full((1, closed.size), -1, dtype=np.int64)])
        for index, other in enumerate(self._states):
            different = np.flatnonzero(other.closed != closed)
            if different.size == 1:
                self._follower[index, different[0]] = found
                self._follower[found, different[0]] = index
        self._states.append(state)
        self._tables = None
        if self.loads.count:
            light = np.abs(state.exponent.real) < LIGHT * np.abs(state.exponent.imag)
            self._lightly_damped = self._lightly_damped or bool(light.any())
        return found

    def _prepare(self) -> None:
        """Pad the states' tables to one size, with room for the periodic loads."""
        from beamsim.flow.kernels import Tables
        from beamsim.flow.orbit_kernels import Variation

        n, m, H = self.system.size, self.system.contacts.count, self.loads.count
        S, N = len(self._states), 2 * n
        B = max(s.exponent.size for s in self._states) + H
        T = max(s.term_basis.size for s in self._states) + H
        Z = max(s.projector.shape[0] for s in self._states)
        exponent = np.zeros((S, B), dtype=complex)
        power = np.zeros((S, B), dtype=np.int64)
        projector = np.zeros((S, Z, N), dtype=complex)
        term_basis = np.zeros((S, T), dtype=np.int64)
        term_source = np.zeros((S, T), dtype=np.int64)
        term_vector = np.zeros((S, T, N), dtype=complex)
        watch = np.zeros((S, T, 2 * m), dtype=complex)
        free: list[tuple[Ints, Ints, Complexes]] = []
        first_forced, first_basis = np.zeros(S, dtype=np.int64), np.zeros(S, dtype=np.int64)
        simple = True
        for i, s in enumerate(self._states):
            nb, nt, nz = s.exponent.size, s.term_basis.size, s.projector.shape[0]
            exponent[i, :nb], power[i, :nb] = s.exponent, s.power
            projector[i, :nz] = s.projector
            term_basis[i, :nt] = s.term_basis
            term_source[i, :nt] = s.term_source + np.where(s.term_source > 0, H, 0)
            term_vector[i, :nt] = s.term_vector
            term_basis[i, nt : nt + H] = nb + np.arange(H)
            term_source[i, nt : nt + H] = 1 + np.arange(H)
            watch[i, :nt] = self._watch(s)
            first_forced[i], first_basis[i] = nt, nb
            own = np.flatnonzero(s.term_source >= 1 + m)
            free.append((s.term_basis[own], s.term_source[own] - 1 - m, s.term_vector[own]))
            simple = simple and own.size == nz and not np.any(s.power)
        self._simple = simple
        Tf = max(f[0].size for f in free)
        left = np.zeros((S, 2 * Z, N))
        right = np.zeros((S, N, 2 * Tf))
        free_basis, free_source = np.zeros((S, Tf), dtype=np.int64), np.zeros((S, Tf), dtype=np.int64)
        for i, (basis, source, vector) in enumerate(free):
            left[i, 0::2], left[i, 1::2] = projector[i].real, projector[i].imag
            k = basis.size
            free_basis[i, :k], free_source[i, :k] = basis, source
            right[i, :, 0 : 2 * k : 2] = vector.real.T
            right[i, :, 1 : 2 * k : 2] = -vector.imag.T
        count = [(s.exponent.size + H, s.projector.shape[0], s.term_basis.size + H) for s in self._states]
        self._tables = Tables(
            np.array([c[0] for c in count]), exponent, power, np.array([c[1] for c in count]), projector,
            np.array([c[2] for c in count]), term_basis, term_source, term_vector, watch,
            np.abs(watch[:, :, :m]), np.array([s.horizon for s in self._states]), np.array([s.closed for s in
            self._states]).reshape(S, m), self._follower.copy(),
        )  # fmt: skip
        self._variation = Variation(
            left, right, np.array([f[0].size for f in free]), free_basis, free_source, first_forced,
            self.loads.multiple.astype(float), np.zeros(H, dtype=complex),
        )  # fmt: skip
        self._first_basis = first_basis
        self._K = np.array([s.stiffness for s in self._states])
        self._C = np.array([s.damping for s in self._states])
        self._derivative = np.zeros((2, S, H, N), dtype=complex)
        self._base_derivative = np.zeros((2, H), dtype=complex)
        self._known_parameters.clear()
        self._force()

    def _watch(self, s: ContactState) -> Complexes:
        """(T, 2 m) watched functions and penetrations of the state's terms, without the periodic loads'."""
        n, contacts = self.system.size, self.system.contacts
        m = contacts.count
        shape = -contacts.sign[:, None] * contacts.shape
        delta = s.term_vector[:, :n] @ shape.T
        rate = s.term_vector[:, n:] @ shape.T
        constant = int(np.flatnonzero((s.term_source == 0) & (s.power[s.term_basis] == 0))[0])
        delta[constant] -= contacts.gap
        watched = np.where(s.closed, delta, -delta)
        by_force = self._has_face & s.closed
        watched = np.where(by_force, contacts.stiffness * delta + contacts.dashpot * rate, watched)
        for t in np.flatnonzero((s.term_source >= 1) & (s.term_source < 1 + m)):
            watched[t, s.term_source[t] - 1] += 1.0
        return np.asarray(np.concatenate([watched, delta], axis=1))

    def _force(self) -> None:
        """Rewrite the periodic loads' responses at the present frequency and level."""
        if self.loads.count == 0:
            return
        from beamsim.flow.orbit_kernels import force_terms

        self._resonant = self._lightly_damped and is_resonant(self._states, self.loads.multiple, self.omega)
        if self._resonant:  # the particular solution has no bound: see carry
            return
        level = self.level
        unit, unit_base, dforce, dbase = self.loads.at(self.omega, 1.0)
        self._base_derivative[0], self._base_derivative[1] = level * dbase, unit_base
        np.multiply(level, unit_base, out=self._variation.base)
        force_terms(
            self._tables, self._inputs, self._contacts, self._variation.first_forced, self._first_basis, self._K,
            self._C, self.omega, self._variation.multiple, level * unit, self._variation.base, level * dforce,
            self._base_derivative[0], unit, unit_base, self._derivative,
        )  # fmt: skip

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

    def moved(self, direction: ContactDirection, amount: float) -> VariationalFlow:
        """A flow of the same structure with its contacts moved along a direction."""
        moved = moved_system(self.system, direction, amount)
        return VariationalFlow(moved, self.forcing, self.omega, self.level, twin=self)

    # -- motion --------------------------------------------------------------------------------------------------

    def _room(self, length: int) -> None:
        N, m = 2 * self.system.size, self.system.contacts.count
        self._log = (
            np.empty(length), np.empty(length), np.empty(length, np.int64), np.empty(length, np.int64),
            np.empty((length, N)), np.empty((length, m)),
        )  # fmt: skip
        self._event_log = (np.empty(length + 1), np.empty(length + 1, np.int64), np.empty(length + 1, np.bool_))

    def base_motion(self, t: float) -> tuple[float, float]:
        """Displacement and velocity of the base."""
        if self.loads.count == 0:
            return 0.0, 0.0
        base = self.loads.at(self.omega, self.level)[1]
        iw = 1j * self.loads.multiple * self.omega
        moving = base * np.exp(iw * t)
        return float(moving.sum().real), float((iw * moving).sum().real)

    def starting_state(self, z: Floats, t: float = 0.0) -> Bools:
        """Which contacts are closed at a motion (y and faces); at zero gap the sign of rate, then acceleration."""
        from beamsim.flow.orbit_kernels import signs_at_start

        n, m = self.system.size, self.system.contacts.count
        closed = np.zeros(m, dtype=bool)
        if m == 0:
            return closed
        d, dv = self.base_motion(t) if self._grounded else (0.0, 0.0)
        if not signs_at_start(self._contacts, z[: 2 * n], z[2 * n :], d, dv, closed):
            contacts = self.system.contacts
            load = self.system.constant_load.astype(float)
            force = self.loads.at(self.omega, self.level)[0]
            load = load + (force * np.exp(1j * self.loads.multiple * self.omega * t)[:, None]).sum(axis=0).real
            q, v = z[:n], z[n : 2 * n]
            delta = -contacts.gap - contacts.sign * (contacts.shape @ q + np.where(contacts.on_ground, d, 0.0))
            at_zero = np.abs(delta - z[2 * n :]) <= 1e-12 * (np.abs(contacts.gap) + np.abs(contacts.shape) @ np.abs(q))
            push = contacts.shape.T @ (contacts.sign * contacts.stiffness * delta * (closed & ~at_zero))
            acceleration = load - self.system.stiffness * q - self.system.damping @ v + push
            closed |= at_zero & (contacts.shape @ v == 0.0) & (-contacts.sign * (contacts.shape @ acceleration) > 0.0)
        return closed

    def carry(self, start: Floats, duration: float, parameters: Sequence[Parameter] = (), t: float = 0.0) -> Passage:
        """The state after ``duration``, with its derivatives.

        Parameters
        ----------
        start : (N + m,) state (q, q') followed by the compression of the contacts' faces, m (zero where closed).
        duration : s, positive.
        parameters : what to take derivatives by, besides the start; at most one that is not exact costs two more
            passages.
        t : time at the start, s (the periodic loads' phase).

        Raises
        ------
        WorkExceeded : too many events (chattering).
        """
        from beamsim.flow import kernels
        from beamsim.flow.orbit_kernels import carry_sensitivity

        n, m = self.system.size, self.system.contacts.count
        N = 2 * n
        self.passages += 1
        index = self.state_index(self.starting_state(start, t))
        while True:
            if self._tables is None:
                self._prepare()
            if self._resonant:
                return carry_by_series(self, self.by_series(), start, duration, parameters, t)
            y, face = start[:N].copy(), start[N:].copy()
            code, now, last, n_seg, n_ev, _, contact = kernels.advance(  # type: ignore[call-arg]
                self._tables, self._inputs, t, t + duration, index, -1, y, face, *self._log, *self._event_log,
                MOST_EVALUATIONS,
            )  # fmt: skip
            if code == kernels.DONE:
                break
            if code == kernels.NEED_STATE:
                following = self._states[last].closed.copy()
                following[contact] = ~following[contact]
                self.state_index(following)
            elif code == kernels.FULL and self._log[0].size < LARGEST_LOG:
                self._room(4 * self._log[0].size)
            else:
                raise WorkExceeded(f"no end after {n_ev} contact events in {now - t:.6g} of {duration:.6g} s")
        exact = [p for p in parameters if self._simple or isinstance(p, Frequency | Level)]
        P = len(exact)
        sens = np.zeros((N + m, N + m + P))
        sens.flat[:: N + m + P + 1] = self.free
        slope = np.zeros(N)
        seg = tuple(a[:n_seg] for a in self._log)
        smallest = carry_sensitivity(  # type: ignore[call-arg]
            self._tables, self._inputs, self._contacts, self._variation, self._parameters(exact), n_seg, *seg,
            self._event_log[1], sens, slope,
        )  # fmt: skip
        end, rate = np.zeros(N + m), np.zeros(N + m)
        end[:N], rate[:N] = y, slope
        if self._any_face:
            end[N:] = np.where(self._tables.closed[last] | ~self._has_face, 0.0, face)
            rate[N:] = -self._inputs.face_rate * end[N:]
        passage = Passage(
            start, end, sens[:, : N + m], sens[:, N + m :], rate, duration,
            seg[0].copy(), seg[1].copy(), seg[2].copy(), seg[4].copy(), seg[5].copy(),
            self._event_log[0][:n_ev].copy(), self._event_log[1][:n_ev].copy(), self._event_log[2][:n_ev].copy(),
            float(smallest),
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
        P, S = len(parameters), len(self._states)
        k = n if StructureDirection in kinds else 0
        out = Parameters(
            np.zeros(P, dtype=bool), np.zeros((P, S, H, 2 * n), dtype=complex), np.zeros((P, H), dtype=complex),
            np.zeros(P, dtype=bool), np.zeros((P, m)), np.zeros((P, m)), np.zeros((P, m)), np.zeros((P, m, n)),
            np.zeros(P, dtype=bool), np.zeros((P, k, k)), np.zeros((P, k, k)), np.zeros((P, k, k)), np.zeros((P, k)),
            np.zeros((P, H, k), dtype=complex),
        )  # fmt: skip
        periodic = [0 if kind is Frequency else 1 if kind is Level else -1 for kind in kinds]
        out.moves_frequency[:] = [H > 0 and which == 0 for which in periodic]
        if P == 0 or (P == 1 and periodic[0] >= 0):
            if P and H:
                own = slice(periodic[0], periodic[0] + 1)
                out = out._replace(terms=self._derivative[own], base=self._base_derivative[own])
            self._known_parameters[kinds] = out
            return out
        for i, (p, which) in enumerate(zip(parameters, periodic, strict=True)):
            if isinstance(p, ContactDirection):
                out.moves_contacts[i] = True
                out.stiffness[i], out.dashpot[i], out.gap[i], out.shape[i] = p.stiffness, p.dashpot, p.gap, p.shape
            elif isinstance(p, StructureDirection):
                out.moves_structure[i] = True
                out.structure_stiffness[i], out.structure_damping[i] = p.stiffness, p.damping
                out.structure_mass[i], out.load[i], out.force[i] = p.mass, p.load, p.force
            elif H:
                out.terms[i] = self._derivative[which]
                out.base[i] = self._base_derivative[which]
        return out

    def by_difference(self, start: Floats, duration: float, direction: Direction, t: float) -> Floats:
        """Central difference by a direction, for states whose motion isn't made of pure exponentials."""
        if isinstance(direction, StructureDirection):
            return self._by_structure(start, duration, direction, t)
        contacts = self.system.contacts
        scale = max(
            (
                float(np.max(np.abs(rate), initial=0.0)) / max(float(np.max(np.abs(value), initial=0.0)), 1e-12)
                for rate, value in (
                    (direction.stiffness, contacts.stiffness), (direction.dashpot, contacts.dashpot),
                    (direction.shape, contacts.shape),
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
                self._series.state_index(state.closed)
        return self._series

    def number_in(self, exact: ExactFlow, closed: Bools) -> int:
        """Number of a contact state, made the same in a transient flow."""
        index = self.state_index(closed)
        for state in self._states[len(exact.states) :]:
            exact.state_index(state.closed)
        return index

    def exact_flow(self, duration: float) -> ExactFlow:
        """The same structure and loads for long runs and outputs."""
        from beamsim.flow.exact import ExactFlow

        return ExactFlow(self.system, self.loads.signals(self.omega, self.level), duration)

    def penetration(self, passage: Passage, times: Floats) -> tuple[Floats, Floats]:
        """Penetration and penetration rate of every contact, (nt, m) each, at times of a passage."""
        return self.penetration_of(self.states_at(passage, times), times)

    def penetration_of(self, y: Floats, times: Floats) -> tuple[Floats, Floats]:
        """The same of states (nt, N) that are known."""
        base = self.loads.base_motion(self.omega, self.level, times) if self._grounded else None
        return penetration_of_states(self.system.contacts, y, base)

    def closed_in(self, passage: Passage) -> Bools:
        """(G, m) which contacts are closed in each segment of a passage."""
        return np.array([self._states[k].closed for k in passage.state]).reshape(-1, self.system.contacts.count)

    def penetration_derivative(
        self, passage: Passage, contact: int, parameters: Sequence[Parameter]
    ) -> tuple[Floats, Floats]:
        """Derivatives of a contact's penetration at the end of a passage from t = 0: by the start (N + m,), and by the
        parameters that the passage was carried with (P,)."""
        n, c, j = self.system.size, self.system.contacts, contact
        row = -c.sign[j] * c.shape[j]
        by = row @ passage.parameters[:n]
        t, sign = passage.duration, -float(c.sign[j] * c.on_ground[j])
        for i, p in enumerate(parameters):
            if isinstance(p, ContactDirection):
                by[i] -= p.gap[j] + c.sign[j] * float(p.shape[j] @ passage.end[:n])
            elif sign and self._grounded and not isinstance(p, StructureDirection):
                _, base, _, dbase = self.loads.at(self.omega, self.level)
                moving = dbase + 1j * self.loads.multiple * t * base
                if isinstance(p, Level):
                    moving = self.loads.at(self.omega, 1.0)[1]
                by[i] += sign * float((moving * np.exp(1j * self.loads.multiple * self.omega * t)).sum().real)
        return row @ passage.transition[:n], by

    def states_at(self, passage: Passage, times: Floats) -> Floats:
        """(nt, N) the state (q, q') at increasing times within a passage."""
        from beamsim.flow import kernels

        N = 2 * self.system.size
        if self._tables is None:
            self._prepare()
        out = np.empty((times.size, N))
        tables, inputs = self._tables, self._inputs
        if self._resonant:
            tables, inputs = self.by_series().tables(), self.by_series().inputs()
        table = np.ascontiguousarray(tables.term_vector)
        piece = np.zeros(passage.time.size, dtype=np.int64)
        kernels.sample(
            tables, inputs, table, passage.time, passage.state, piece, passage.y, passage.face,
            np.ascontiguousarray(times), out,
        )  # fmt: skip
        return out


@cache
def _constant_source() -> Sources:
    return compile_sources(())


def moved_system(system: PiecewiseLinearSystem, direction: ContactDirection, amount: float) -> PiecewiseLinearSystem:
    """The system with its contacts' numbers moved by ``amount`` along a direction."""
    c = system.contacts
    return replace(
        system,
        contacts=replace(
            c,
            stiffness=c.stiffness + amount * direction.stiffness,
            dashpot=c.dashpot + amount * direction.dashpot,
            gap=c.gap + amount * direction.gap,
            shape=c.shape + amount * direction.shape,
        ),
    )


def floquet_multipliers(monodromy: Floats) -> Complexes:
    """Eigenvalues of a monodromy matrix, the largest first."""
    values = np.linalg.eigvals(monodromy).astype(complex)
    return np.asarray(values[np.lexsort((-values.imag, -np.abs(values)))])
