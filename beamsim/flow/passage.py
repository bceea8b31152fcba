"""One passage of a motion over a time: periodic loads, what derivatives are taken by, and what comes out.

Shared by all flows of :mod:`beamsim.flow.periodic_flow`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from beamsim.contacts.contacts import Contacts
from beamsim.dataclass import dataclass
from beamsim.inputs.signal import Signal
from beamsim.system.equations import Forcing, PiecewiseLinearSystem
from beamsim.typing import Complexes, Floats, Ints

MOST_EVALUATIONS = 20_000_000
LARGEST_LOG = 65536  # segments of a passage


class WorkExceeded(ArithmeticError):
    """A passage needed more events or evaluations than allowed (chattering)."""


class NotFinite(ArithmeticError):
    """A passage left the range of floating-point numbers."""


def check_finite(y: Floats | Complexes) -> None:
    """Refuse a state, or loads, that are not finite.

    Raises
    ------
    NotFinite
    """
    if not np.all(np.isfinite(y)):
        raise NotFinite("the motion leaves the range of floating-point numbers")


def penetration_of_states(contacts: Contacts, y: Floats, base: tuple[Floats, Floats] | None) -> tuple[Floats, Floats]:
    """Penetration and its rate, (nt, m) each, of states (nt, N) and the base's displacement and velocity (nt,)."""
    n, shape = contacts.shape.shape[1], -contacts.sign[:, None] * contacts.shape
    delta, rate = y[:, :n] @ shape.T - contacts.gap, y[:, n : 2 * n] @ shape.T
    if base is not None:
        sign = -contacts.sign * contacts.felt
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
        empty = np.zeros(0)
        return cls(
            np.zeros(0, dtype=np.int64), np.zeros((0, size), dtype=complex), empty, empty.astype(complex),
            empty, 1.0
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

    stiffness: Floats  # (m,) of laws made of one stiffness and one dashpot
    dashpot: Floats  # (m,)
    gap: Floats  # (m,)
    shape: Floats  # (m, n)
    along: Contacts | None = None  # contacts whose laws' forces are added

    @classmethod
    def of(
        cls,
        contacts: Contacts,
        stiffness: Any = 0.0,
        dashpot: Any = 0.0,
        gap: Any = 0.0,
        shape: Any = 0.0,
        along: Contacts | None = None,
    ) -> ContactDirection:
        """Broadcast numbers to all contacts."""

        def spread(value: Any, like: Floats) -> Floats:
            return np.array(np.broadcast_to(np.asarray(value, dtype=float), like.shape))

        return cls(
            spread(stiffness, contacts.gap),
            spread(dashpot, contacts.gap),
            spread(gap, contacts.gap),
            spread(shape, contacts.shape),
            along,
        )

    def law_rates(self, contacts: Contacts) -> tuple[Floats, Floats]:
        """Derivatives of the phases' forces, (m, P, 3) factors of penetration, rate and 1, and (m, P) of the rate at
        which a single internal state moves by itself."""
        a = contacts.arrays
        force = np.zeros((*a.touching.shape, 3)) if self.along is None else self.along.arrays.force[:, :, :3].copy()
        decay = np.zeros(a.touching.shape)
        for j in np.flatnonzero((self.stiffness != 0.0) | (self.dashpot != 0.0)):
            law, dk, dc = contacts.laws[j], self.stiffness[j], self.dashpot[j]
            law.with_numbers(law.stiffness, law.dashpot)  # only laws that are made of these have such a derivative
            for k, phase in enumerate(law.phases):
                if phase.touching:
                    force[j, k, :2] += dk, dc
                if law.internal_states:
                    decay[j, k] = -(dk - law.stiffness / law.dashpot * dc) / law.dashpot
        return force, decay


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
        """Matrices (n, n) or their diagonals (n,), loads (n,) and (H, n); what is not given does not change."""

        def matrix(value: Any) -> Floats:
            value = np.asarray(value, dtype=float)
            return np.array(value if value.ndim == 2 else np.diag(np.broadcast_to(value, size)))

        none = np.zeros((harmonics, size), dtype=complex)
        return cls(
            matrix(stiffness), matrix(damping), matrix(mass),
            np.array(np.broadcast_to(np.asarray(load, dtype=float), size)),
            none if force is None else np.array(force, dtype=complex),
        )  # fmt: skip


@dataclass(frozen=True)
class SpringFactor:
    """The parameter that multiplies the cubic springs' and the contacts' stiffness: its derivatives."""

    cubic: Floats  # (nc,)
    stiffness: Floats  # (m,)


Direction = ContactDirection | StructureDirection
Parameter = Frequency | Level | Direction | SpringFactor


@dataclass(frozen=True, eq=False)
class Passage:
    """One carried state: where it ended, what happened, and the derivatives."""

    start: Floats  # (N,) (q, q') and the contacts' internal states
    end: Floats  # (N,)
    transition: Floats  # (N, N) derivative by the start
    parameters: Floats  # (N, P) derivative by the parameters at fixed times
    slope: Floats  # (N,) time derivative at the end
    duration: float  # s
    time: Floats  # (G,) start of each segment, s
    length: Floats  # (G,) s
    state: Ints  # (G,) contact state of each segment
    y: Floats  # (G, N) at each segment's start
    event_time: Floats  # (E,) s
    event_contact: Ints  # (E,)
    event_phase: Ints  # (E,) of the contact after the event

    @property
    def signature(self) -> tuple[tuple[int, int], ...]:
        """Order of events: contact and its new phase."""
        return tuple(zip(self.event_contact.tolist(), self.event_phase.tolist(), strict=True))


def moved_system(system: PiecewiseLinearSystem, direction: ContactDirection, amount: float) -> PiecewiseLinearSystem:
    """The system with its contacts' numbers moved by ``amount`` along a direction."""
    c = system.contacts
    moved = replace(c, gap=c.gap + amount * direction.gap, shape=c.shape + amount * direction.shape)
    if direction.along is not None:
        pairs = zip(c.laws, direction.along.laws, strict=True)
        moved = replace(moved, laws=tuple(law.plus(other, amount) for law, other in pairs))
    if np.any(direction.stiffness) or np.any(direction.dashpot):
        for j in np.flatnonzero((direction.stiffness != 0.0) | (direction.dashpot != 0.0)):
            k, c_j = moved.laws[j].stiffness, moved.laws[j].dashpot
            moved = moved.with_numbers(int(j), k + amount * direction.stiffness[j], c_j + amount * direction.dashpot[j])
    return replace(system, contacts=moved)
