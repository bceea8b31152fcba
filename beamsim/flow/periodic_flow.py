"""Interface of flows under periodic loads, as shooting and continuation use it.

Implemented in closed form (:mod:`beamsim.flow.variational`) and by Taylor series for cubic springs
(:mod:`beamsim.flow.smooth_flow`).

Shared by all flows of :mod:`beamsim.flow.periodic_flow`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np

from beamsim.contacts.contacts import Contacts
from beamsim.errors import MethodError
from beamsim.flow.exact import ExactFlow
from beamsim.flow.trajectory import Trajectory
from beamsim.inputs.signal import Signal
from beamsim.outcomes import COMPLETE
from beamsim.system.equations import Forcing, PiecewiseLinearSystem
from beamsim.typing import Complexes, Floats, Ints


class WorkExceeded(ArithmeticError):
    """A motion needed more events or evaluations than allowed (chattering)."""


class NotFinite(ArithmeticError):
    """A motion left the range of floating-point numbers."""


def check_finite(y: Floats | Complexes) -> None:
    """Raise an error if a state or loads are not finite.

    Raises
    ------
    NotFinite
    """
    if not np.all(np.isfinite(y)):
        raise NotFinite("the motion leaves the range of floating-point numbers")


@dataclass(frozen=True)
class PeriodicForcing:
    """H periodic loads, each ``level * Re(force (omega/reference)^power e^{i multiple omega t})``."""

    multiple: Ints  # (H,) of the fundamental frequency, from 1
    force: Complexes  # (H, n) generalised force for level 1 at the reference frequency
    force_power: Floats  # (H,) r_h
    base: Complexes  # (H, K) displacements of the base, m, for level 1 at the reference frequency; K is 0 if it rests
    base_power: Floats  # (H,)
    reference: float  # omega_0, rad/s

    @classmethod
    def none(cls, size: int) -> PeriodicForcing:
        """No excitation."""
        empty = np.zeros(0)
        return cls(
            np.zeros(0, dtype=np.int64), np.zeros((0, size), dtype=complex), empty, np.zeros((0, 0), dtype=complex),
            empty, 1.0
        )  # fmt: skip

    @classmethod
    def harmonic(cls, force: Floats, reference: float = 1.0) -> PeriodicForcing:
        """One load vector times ``sin(omega t)``."""
        return cls(
            np.ones(1, dtype=np.int64), -1j * np.asarray(force, dtype=complex)[None, :], np.zeros(1),
            np.zeros((1, 0), dtype=complex), np.zeros(1), reference,
        )  # fmt: skip

    @property
    def count(self) -> int:
        """H."""
        return int(self.multiple.size)

    def at(self, omega: float, level: float) -> tuple[Complexes, Complexes, Complexes, Complexes]:
        """Loads and base displacements at a frequency and level, and their derivatives by the frequency."""
        ratio = omega / self.reference
        force = self.force * (level * ratio**self.force_power)[:, None]
        base = self.base * (level * ratio**self.base_power)[:, None]
        by_omega = (self.force_power / omega)[:, None], (self.base_power / omega)[:, None]
        return force, base, force * by_omega[0], base * by_omega[1]

    def base_motion(self, omega: float, level: float, times: Floats) -> tuple[Floats, Floats]:
        """The motion of the base.

        Parameters
        ----------
        omega, level : rad/s, and factor of the loads.
        times : (nt,) s.

        Returns
        -------
        displacement, velocity : (nt, K) m, m/s.
        """
        iw, base = 1j * self.multiple * omega, self.at(omega, level)[1]
        turning = np.exp(np.multiply.outer(times, iw))
        return (turning @ base).real, ((turning * iw) @ base).real

    @cached_property
    def _rows(self) -> tuple[Ints, Complexes, Floats]:
        """(L,) harmonic, (L,) phasor and (L, n) load of each signal: the real and imaginary parts that are not zero."""
        parts = [
            (h, c, row) for h, of in enumerate(self.force) for c, row in ((1.0, of.real), (1j, of.imag)) if row.any()
        ]
        load = np.array([row for _, _, row in parts]).reshape(len(parts), self.force.shape[1])
        return (
            np.array([h for h, _, _ in parts], dtype=np.int64),
            np.array([c for _, c, _ in parts], dtype=complex),
            load,
        )

    @cached_property
    def _moves(self) -> Ints:
        """Numbers of the harmonics in which the base moves."""
        return np.flatnonzero(self.base.any(axis=1))

    def signals(self, omega: float, level: float) -> Forcing:
        """The loads as the forcing of an :class:`beamsim.flow.exact.ExactFlow`.

        Raises
        ------
        NotFinite
        """
        amplitude, exponent = self._amplitudes(omega, level)
        check_finite(amplitude)
        check_finite(exponent)
        start, count = np.zeros(1), self._rows[0].size
        signals = [Signal(start, exponent[k : k + 1], amplitude[None, k : k + 1, None]) for k in range(count)]
        if not self._moves.size:
            return Forcing(self._rows[2], tuple(signals))
        motions = self.base.shape[1]
        pairs = zip(np.split(exponent[count:], motions), np.split(amplitude[count:], motions), strict=True)
        signals += [Signal(start, turning, size[None, :, None]) for turning, size in pairs]
        load = np.pad(self._rows[2], ((0, motions), (0, 0)))
        return Forcing(load, tuple(signals), tuple(range(count, count + motions)))

    def _amplitudes(self, omega: float, level: float) -> tuple[Complexes, Complexes]:
        """Amplitudes and exponents of the signals of the loads, and then of each motion of the base."""
        harmonic, phasor, _ = self._rows
        ratio = omega / self.reference
        force = phasor * (level * ratio ** self.force_power[harmonic])
        base = self.base[self._moves] * (level * ratio ** self.base_power[self._moves])[:, None]
        multiple = self._of_terms(self.multiple, self.multiple)
        return np.concatenate([force, base.T.ravel()]), np.asarray(1j * omega * multiple)

    def _of_terms(self, of_loads: Floats | Ints, of_base: Floats | Ints) -> Floats:
        """(L + B,) numbers of the harmonics (H,) of loads and base, for each term of `signals`."""
        moves = np.tile(of_base[self._moves], self.base.shape[1] if self._moves.size else 1)
        return np.append(of_loads[self._rows[0]], moves)

    def rates_of_signals(self, omega: float, level: float, parameter: Frequency | Level) -> tuple[Complexes, Complexes]:
        """Derivatives of the amplitudes and exponents of `signals`.

        Parameters
        ----------
        omega, level : rad/s, and factor of the loads.
        parameter : by which they are taken.

        Returns
        -------
        amplitude, exponent : (L + B,) of the loads' signals and of the base's harmonics.
        """
        if isinstance(parameter, Level):
            amplitude = self._amplitudes(omega, 1.0)[0]
            return amplitude, np.zeros_like(amplitude)
        power = self._of_terms(self.force_power, self.base_power)
        multiple = self._of_terms(self.multiple, self.multiple)
        return self._amplitudes(omega, level)[0] * power / omega, np.asarray(1j * multiple)


@dataclass(frozen=True)
class Frequency:
    """The parameter omega, rad/s."""


@dataclass(frozen=True)
class Level:
    """The parameter that multiplies all periodic loads."""


@dataclass(frozen=True)
class ContactDirection:
    """Derivatives of the contacts' numbers by a parameter p."""

    stiffness: Floats  # (m,) of laws made of one stiffness and one dashpot
    dashpot: Floats  # (m,)
    gap: Floats  # (m,)
    shape: Floats  # (m, n)
    base_participation: Floats  # (m, K) of the motion of each place for a unit of each motion of the base
    added_contacts: Contacts | None = None  # contacts whose laws' forces are added
    cubic: Floats | None = None  # (nc,) stiffness of cubic springs in addition to the contacts

    @cached_property
    def scales_forces(self) -> bool:
        """Whether p only scales forces, so that all linear outputs are linear in p."""
        others = self.stiffness, self.dashpot, self.gap, self.shape, self.base_participation
        return self.added_contacts is not None and not any(map(np.any, others))

    @classmethod
    def of(
        cls,
        contacts: Contacts,
        added_contacts: Contacts | None = None,
        cubic: Floats | None = None,
        **rates: Floats | float,
    ) -> ContactDirection:
        """A direction along which only the given numbers change.

        Parameters
        ----------
        contacts : m of them.
        added_contacts, cubic : fields of the direction.
        rates : other fields, per unit of the parameter; one number for all contacts, or an entry for each.

        Returns
        -------
        The direction, with an entry for each contact.
        """
        shapes = dict.fromkeys(("stiffness", "dashpot", "gap"), contacts.gap.shape)
        shapes |= {"shape": contacts.shape.shape, "base_participation": contacts.base_participations.shape}
        entries = {name: np.full(shape, rates.pop(name, 0.0)) for name, shape in shapes.items()}
        if rates:
            raise TypeError(f"contacts have no {', '.join(rates)} to change along a direction")
        return cls(**entries, added_contacts=added_contacts, cubic=cubic)


Parameter = Frequency | Level | ContactDirection


@dataclass(frozen=True, eq=False)
class FlowMap:
    """A motion over a time: its segments, its events, and the derivatives of its final state.

    It holds no contact states: with them a branch of thousands of motions would not fit in memory.
    """

    start: Floats  # (N,) (q, q') and the contacts' internal states
    end: Floats  # (N,)
    transition: Floats  # (N, N) derivative by the start
    parameters: Floats  # (N, P) derivative by the parameters at fixed times
    slope: Floats  # (N,) time derivative at the end
    duration: float  # s
    time: Floats  # (G,) start of each segment, s
    length: Floats  # (G,) s
    phases: Ints  # (G, m) of the contacts in each segment
    y: Floats  # (G, N) at each segment's start
    event_time: Floats  # (E,) s
    event_contact: Ints  # (E,)
    event_before: Ints  # (E,) phase of the contact before the event
    event_phase: Ints  # (E,) after it

    @property
    def signature(self) -> tuple[tuple[int, int], ...]:
        """Order of events: contact and its new phase."""
        return tuple(zip(self.event_contact.tolist(), self.event_phase.tolist(), strict=True))

    def trajectory(self, flow: ExactFlow) -> Trajectory:
        """The trajectory of the motion, from which outputs are computed, on a flow of the same system and loads."""
        for phases in self.phases:
            flow.state_index(phases)
        number = {phases.tobytes(): k for k, phases in enumerate(flow.visited_phases)}
        state = np.array([number[phases.tobytes()] for phases in self.phases], dtype=np.int64)
        return Trajectory(
            flow, float(self.time[0] + self.duration), self.time, self.length, state, np.zeros_like(state), self.y,
            self.event_time, self.event_contact, self.event_before, self.event_phase, self.end, 0, COMPLETE,
        )  # fmt: skip

    @cached_property
    def multipliers(self) -> Complexes:
        """Floquet multipliers of a motion that closes, the largest first."""
        values = np.linalg.eigvals(self.transition).astype(complex)
        return np.asarray(values[np.lexsort((-values.imag, -np.abs(values)))])


def shift_system(system: PiecewiseLinearSystem, direction: ContactDirection, change: float) -> PiecewiseLinearSystem:
    """The system with its numbers changed along a direction.

    Parameters
    ----------
    system : stays as it is.
    direction : derivatives of the numbers by a parameter.
    change : change of the parameter.

    Returns
    -------
    The other system.
    """
    c = system.contacts
    moved = replace(
        c, gap=c.gap + change * direction.gap, shape=c.shape + change * direction.shape,
        base_participation=c.base_participations + change * direction.base_participation,
    )  # fmt: skip
    if direction.added_contacts is not None:
        pairs = zip(c.laws, direction.added_contacts.laws, strict=True)
        moved = replace(moved, laws=tuple(law.plus(other, change) for law, other in pairs))
    if np.any(direction.stiffness) or np.any(direction.dashpot):
        for j in np.flatnonzero((direction.stiffness != 0.0) | (direction.dashpot != 0.0)):
            k, c_j = moved.laws[j].stiffness, moved.laws[j].dashpot
            moved = moved.with_numbers(int(j), k + change * direction.stiffness[j], c_j + change * direction.dashpot[j])
    return replace(system, contacts=moved)


@dataclass
class PeriodicFlow(ABC):
    """A structure under periodic loads, ready to be followed over a time with all derivatives.

    Parameters
    ----------
    system : the structure.
    forcing : its periodic loads (default: none).
    omega, level : frequency, rad/s, and factor of the loads; `with_loads` gives the flow at others.
    """

    system: PiecewiseLinearSystem
    forcing: PeriodicForcing | None = None
    omega: float = 1.0
    level: float = 1.0
    _march_count: list[int] = field(init=False, repr=False)  # shared by all flows that come from this one

    def __post_init__(self) -> None:
        if any(law.latches for law in self.system.contacts.laws):
            message = "have a latch, which never opens again: no periodic motion closes it"
            raise MethodError("snubbers", message, "leave latch out, or use `beamsim run`")
        self.loads = PeriodicForcing.none(self.system.size) if self.forcing is None else self.forcing
        self._march_count = [0]
        self._prepare()

    @abstractmethod
    def _prepare(self) -> None:
        """Compute what depends on the system only."""

    @property
    def size(self) -> int:
        """N, of the state."""
        return 2 * self.system.size + self.system.contacts.internal_states

    @property
    def motions_computed(self) -> int:
        """Motions computed so far, of this flow and of those that come from it."""
        return self._march_count[0]

    def with_loads(self, omega: float | None = None, level: float | None = None) -> Self:
        """The flow of the same structure at another frequency and level."""
        flow = copy(self)
        flow.omega = self.omega if omega is None else float(omega)
        flow.level = self.level if level is None else float(level)
        return flow

    def with_system(self, system: PiecewiseLinearSystem) -> Self:
        """The flow of another structure, or of other contacts with as many phases, under the same loads."""
        flow = copy(self)
        flow.system = system
        flow._prepare()
        return flow

    def with_contacts(self, contacts: Contacts) -> Self:
        """The flow of the same structure with other contacts of as many phases."""
        return self.with_system(replace(self.system, contacts=contacts))

    @abstractmethod
    def flow_map(self, start: Floats, duration: float, parameters: Sequence[Parameter] = (), t: float = 0.0) -> FlowMap:
        """The state after ``duration``, with its derivatives.

        Parameters
        ----------
        start : (N,) state (q, q') and the contacts' internal states.
        duration : s, positive.
        parameters : parameters of the derivatives, in addition to the start.
        t : time at the start, s (the periodic loads' phase).

        Returns
        -------
        The motion with the derivatives of its end.

        Raises
        ------
        WorkExceeded : too many events (chattering).
        NotFinite : the motion leaves the range of floating-point numbers.
        """

    @abstractmethod
    def end(self, start: Floats, duration: float, t: float = 0.0) -> Floats:
        """(N,) the state after ``duration``, as that of `flow_map`, without derivatives; one march over many periods.

        Parameters
        ----------
        start, duration, t : see `flow_map`.

        Returns
        -------
        (N,) state.

        Raises
        ------
        WorkExceeded, NotFinite : see `flow_map`.
        """

    @abstractmethod
    def states_at(self, flow_map: FlowMap, times: Floats) -> Floats:
        """(nt, N) the state at increasing times within a motion."""

    @property
    @abstractmethod
    def fastest(self) -> float:
        """rad/s, largest rate of its motions."""

    @property
    def reversible(self) -> bool:
        """Undamped and unforced: motions run backwards as well."""
        return self.loads.count == 0 and not np.any(self.system.damping) and not self.system.contacts.damped

    @property
    def base_moves(self) -> bool:
        """Whether a contact is on the ground while the base moves."""
        return bool(self.loads.base.any() and np.any(self.system.contacts.on_ground))

    def penetration_of(self, y: Floats, times: Floats) -> tuple[Floats, Floats]:
        """Penetration and penetration rate of every contact, (nt, m) each, of states (nt, N) at times."""
        base = self.loads.base_motion(self.omega, self.level, times) if self.base_moves else None
        return self.system.contacts.penetrations(y, base)

    def contact_forces(self, phases: Ints, y: Floats, times: Floats) -> Floats:
        """Forces of the contacts along a motion.

        Parameters
        ----------
        phases : (nt, m) of the contacts.
        y : (nt, N) states.
        times : (nt,) s.

        Returns
        -------
        forces : (nt, m) N.
        """
        delta, rate = self.penetration_of(y, times)
        return self.system.contacts.forces(phases, delta, rate, y[:, 2 * self.system.size :])

    def penetration_derivative(
        self, flow_map: FlowMap, contact: int, parameters: Sequence[Parameter]
    ) -> tuple[Floats, Floats]:
        """Derivatives of a contact's penetration at the end of a motion from t = 0.

        Parameters
        ----------
        flow_map : with the derivatives by the parameters.
        contact : number of it.
        parameters : P of them.

        Returns
        -------
        by_start, by_parameters : (N,) and (P,).
        """
        n, c, j = self.system.size, self.system.contacts, contact
        row = -c.sign[j] * c.shape[j]
        by = row @ flow_map.parameters[:n]
        t = flow_map.duration
        for i, p in enumerate(parameters):
            if isinstance(p, ContactDirection):
                by[i] -= p.gap[j] + c.sign[j] * float(p.shape[j] @ flow_map.end[:n])
                if c.on_ground[j] and self.base_moves:
                    (moved,), _ = self.loads.base_motion(self.omega, self.level, np.array([t]))
                    by[i] -= c.sign[j] * float(p.base_participation[j] @ moved)
            elif self.base_moves:
                _, base, _, dbase = self.loads.at(self.omega, self.level)
                moving = dbase + 1j * t * self.loads.multiple[:, None] * base
                if isinstance(p, Level):
                    moving = self.loads.at(self.omega, 1.0)[1]
                turning = np.exp(1j * self.loads.multiple * self.omega * t)
                by[i] -= c.sign[j] * float(c.base_influence[j] @ (turning @ moving).real)
        return row @ flow_map.transition[:n], by
