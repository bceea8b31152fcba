r"""Contacts as harmonic balance takes them: one-sided springs, some behind a linear element, and linear springs.

The pad of :mod:`beamsim.contacts.pads` has a face at :math:`z`: where it touches, :math:`z = \delta`; released, it
moves by itself with N = 0 and :math:`z > \delta`. In every harmonic :math:`D(i\omega) Z = N - \sum_i F_i(z)`, D being
the stiffness of its first segment with dashpot and branches, the :math:`F_i` the springs by which the curve bends at
its other points. With any stiffness :math:`\rho > 0` both conditions are

.. math:: N = \rho\, e_+, \qquad e = N / \rho + \delta - z ,

since e is :math:`N/\rho > 0` in contact and :math:`\delta - z < 0` without it. So the pad is a one-sided spring of
stiffness :math:`\rho` behind the compliance :math:`1/D - 1/\rho`, and what bends its curve one-sided springs on z. No
internal state is left. With branches alone and :math:`\rho = D(\infty)` the compliance vanishes for high harmonics.

A two-sided spring that relaxes is a spring of dynamic stiffness D, beside the corners of its piecewise-linear force.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from beamsim.contacts.contacts import Contacts
from beamsim.contacts.laws import ContactLaw, kelvin_voigt
from beamsim.dataclass import dataclass
from beamsim.errors import MethodError
from beamsim.typing import Complexes, Floats, Ints


@dataclass(frozen=True)
class RelaxingPad:
    """A pad and where it stands among the springs."""

    owner: int  # number of its contact
    law: ContactLaw
    sign: float
    row: int  # of the spring of stiffness rho, whose deflection is that of e
    stiffness: float  # rho, N/m
    corners: Ints  # rows of the springs on z that bend its curve


@dataclass(frozen=True)
class RelaxingSpring:
    """A two-sided spring with branches."""

    owner: int
    law: ContactLaw
    row: int


@dataclass(frozen=True)
class BalancedContacts:
    """One-sided springs of a stiffness and a dashpot each, and what is linear behind and beside them."""

    springs: Contacts  # (m,) the one-sided ones, then (l,) rows of the two-sided springs that relax, without force
    owner: Ints  # (m + l,) contact that each is a part of
    direction: Floats  # (m + l,) of its force in that of the contact; 0 of what acts inside a pad
    one_sided: int  # m
    pads: tuple[RelaxingPad, ...] = ()
    relaxing: tuple[RelaxingSpring, ...] = ()
    source: Contacts | None = field(default=None, repr=False)

    @property
    def remember(self) -> bool:
        """Whether a contact has internal states."""
        return bool(self.pads or self.relaxing)

    @cached_property
    def plain(self) -> Ints:
        """Rows of the one-sided springs that are no part of a pad."""
        of_pads = [k for pad in self.pads for k in (pad.row, *pad.corners)]
        return np.setdiff1d(np.arange(self.one_sided), of_pads)

    def compliance(self, highest: int, fundamental: float, rows: int) -> tuple[Complexes, Complexes]:
        """(H + 1, r, r) deflections of the springs of pads by the forces on the structure, beyond those of the
        structure itself, m/N, and their derivative by the fundamental frequency."""
        out, slope = (np.zeros((highest + 1, rows, rows), dtype=complex) for _ in range(2))
        h: Floats = np.arange(float(highest + 1))
        for pad in self.pads:
            stiffness, by_frequency = pad_stiffness(pad.law, h * fundamental)
            moved, moved_slope = 1.0 / stiffness, -h * by_frequency / stiffness**2
            signs = np.append(pad.sign, np.ones(pad.corners.size))
            at = np.append(pad.row, pad.corners)
            place = np.ix_(np.arange(highest + 1), at, at)
            out[place] = moved[:, None, None] * np.outer(signs, signs)
            slope[place] = moved_slope[:, None, None] * np.outer(signs, signs)
            out[:, pad.row, pad.row] -= 1.0 / pad.stiffness
        return out, slope

    def faces(self, forces: Complexes, fundamental: float) -> list[Complexes]:
        """(H + 1,) harmonics of z of every pad, m, from the forces on the structure (H + 1, r)."""
        h: Floats = np.arange(float(forces.shape[0]))
        return [
            (pad.sign * forces[:, pad.row] + forces[:, pad.corners].sum(axis=1))
            / pad_stiffness(pad.law, h * fundamental)[0]
            for pad in self.pads
        ]

    def states_at_start(self, forces: Complexes, deflections: Complexes, base: Complexes, fundamental: float) -> Floats:
        """Internal states of all contacts at t = 0.

        From the forces on the structure and the springs' deflections (H + 1, r), and the base's motion (H + 1,).
        """
        assert self.source is not None
        states = [np.zeros(law.internal_states) for law in self.source.laws]
        w: Floats = np.arange(float(forces.shape[0])) * fundamental
        for pad, face in zip(self.pads, self.faces(forces, fundamental), strict=True):
            states[pad.owner] = _states(pad.law, _touching(pad.law), w, face)
            place = deflections[:, pad.row] + self.springs.felt[pad.row] * base
            inside = -self.springs.gap[pad.row] - pad.sign * place.sum().real
            compression = compression_state(pad.law)
            if inside < 0.0 and compression is not None:
                states[pad.owner][compression] = face.sum().real
        for spring in self.relaxing:
            place = deflections[:, spring.row] + self.springs.felt[spring.row] * base
            stretch = -float(self.springs.sign[spring.row]) * place
            states[spring.owner] = _states(spring.law, spring.law.start, w, stretch)
        return np.concatenate([np.zeros(0), *states])


def pad_stiffness(law: ContactLaw, omega: Floats) -> tuple[Complexes, Complexes]:
    """(w,) dynamic stiffness of a pad on its first segment, N/m, and its derivative by the frequency, rad/s."""
    return law.dynamic_stiffness(_touching(law), omega), law.dynamic_stiffness_slope(_touching(law), omega)


def compression_state(law: ContactLaw) -> int | None:
    """Number of the internal state that is the compression of the released face; None where the law has none."""
    reset = law.phases[_touching(law)].guards[0].reset
    if reset is None:
        return None
    return next(i for i, row in enumerate(reset) if row[0] == 1.0)


def _touching(law: ContactLaw) -> int:
    """The first phase in contact."""
    return next(k for k, phase in enumerate(law.phases) if phase.touching)


def _states(law: ContactLaw, phase: int, omega: Floats, motion: Complexes) -> Floats:
    """(r,) internal states at t = 0 within a phase whose penetration has these harmonics."""
    now, r, iw = law.phases[phase], law.internal_states, 1j * omega
    if not now.drive:
        return np.zeros(r)
    drive = np.array(now.drive, dtype=float)
    pushed = (drive[:, 0] + iw[:, None] * drive[:, 1]) * motion[:, None]
    moved = np.linalg.solve(iw[:, None, None] * np.eye(r) - np.array(now.dynamics), pushed[..., None])
    return np.asarray(moved[..., 0].sum(axis=0).real)


def balanced_contacts(contacts: Contacts, typical: float) -> BalancedContacts:
    """Contacts as one-sided springs and linear elements.

    Parameters
    ----------
    contacts : those of a system.
    typical : a typical frequency of the motion, rad/s, for the stiffness of pads with dashpots.

    Raises
    ------
    MethodError
        Where a law rubs, or a pad begins without stiffness.
    """
    for law in contacts.laws:
        if law.rubs:
            raise MethodError(
                "contacts", "with friction or hardening are beyond harmonic balance: their sliders stick and slip by "
                "themselves", "use shooting, or leave friction and hardening out",
            )  # fmt: skip
    if contacts.one_sided:
        springs = contacts.one_sided_parts()
        return BalancedContacts(springs, *contacts.owners_of_parts, springs.count, source=contacts)
    return _with_memory(contacts, typical)


class _Spring(NamedTuple):
    """One row: a one-sided spring of a contact, or ``inside`` a pad, or the row of a spring that relaxes."""

    contact: int
    direction: float
    gap: float
    law: ContactLaw
    inside: bool = False


def _with_memory(contacts: Contacts, typical: float) -> BalancedContacts:
    rows: list[_Spring] = []
    regular: dict[int, tuple[int, float]] = {}  # row and rho by pad
    for j, law in enumerate(contacts.laws):
        if law.recovers:
            regular[j] = len(rows), _regular(law, typical)
            rows.append(_Spring(j, 1.0, float(contacts.gap[j]), kelvin_voigt(regular[j][1])))
            continue
        for part in law.parts if law.parts is not None else law.static_springs:
            gap = part.direction * float(contacts.gap[j]) + part.offset
            rows.append(_Spring(j, part.direction, gap, kelvin_voigt(part.stiffness, part.dashpot)))
    pads = []
    for j, (row, stiffness) in regular.items():
        corners = [s for s in contacts.laws[j].static_springs if s.offset > 0.0]
        places = len(rows) + np.arange(len(corners))
        pads.append(RelaxingPad(j, contacts.laws[j], float(contacts.sign[j]), row, stiffness, places))
        rows += [_Spring(j, 0.0, s.offset, kelvin_voigt(s.stiffness), inside=True) for s in corners]
    one_sided = len(rows)
    beside = [j for j, law in enumerate(contacts.laws) if law.internal_states and not law.recovers]
    relaxing = [RelaxingSpring(j, contacts.laws[j], one_sided + k) for k, j in enumerate(beside)]
    rows += [_Spring(j, 1.0, 0.0, kelvin_voigt(0.0)) for j in beside]
    owner = np.array([row.contact for row in rows], dtype=np.int64)
    direction: Floats = np.array([row.direction for row in rows])
    inside = np.array([row.inside for row in rows], dtype=bool)
    springs = Contacts(
        np.where(inside[:, None], 0.0, contacts.shape[owner]),
        np.where(inside, -1.0, direction * contacts.sign[owner]),
        np.array([row.gap for row in rows]),
        contacts.on_ground[owner] & ~inside,
        tuple(row.law for row in rows),
        contacts.levers[owner],
    )
    return BalancedContacts(springs, owner, direction, one_sided, tuple(pads), tuple(relaxing), contacts)


def _regular(law: ContactLaw, typical: float) -> float:
    """The stiffness rho of a pad: at high frequencies, or about the motion's where dashpots make that infinite."""
    phase = law.phases[_touching(law)]
    if not law.dynamic_stiffness(_touching(law), np.zeros(1))[0].real > 0.0:
        raise MethodError(
            "contacts", "with a table that begins without force and a dashpot or Maxwell branches beside it are beyond "
            "harmonic balance: the face of the pad has no place of its own",
            "give the first segment a small force, or use shooting",
        )  # fmt: skip
    return float(np.hypot(phase.stiffness, typical * phase.dashpot))


def sampled_faces(
    pads: Sequence[RelaxingPad], contacts: Contacts, motion: tuple[Floats, Floats, Floats], phases: Ints
) -> list[tuple[Floats, Floats]]:
    """Of every pad (nt,) its force, N, and the place of its face, m, in a motion of shooting.

    ``motion`` are penetrations and their rates (nt, contacts) and all internal states (nt, r).
    """
    delta, rate, internal = motion
    force, own = contacts.forces(phases, delta, rate, internal), contacts.own_internal(internal)
    out = []
    for pad in pads:
        j, r = pad.owner, pad.law.internal_states
        y = np.column_stack([delta[:, j], rate[:, j], np.ones(len(delta)), own[:, j, :r]])
        rows = np.array([phase.guards[0].row(r) for phase in pad.law.phases])[phases[:, j]]
        scale = np.array([1.0 if phase.touching else -phase.guards[0].penetration for phase in pad.law.phases])
        ahead = np.einsum("tk,tk->t", rows, y) / scale[phases[:, j]]  # of the released face, by its guard
        touches = contacts.touching(phases)[:, j]
        out.append((np.where(touches, force[:, j], 0.0), delta[:, j] + np.where(touches, 0.0, np.maximum(ahead, 0.0))))
    return out
