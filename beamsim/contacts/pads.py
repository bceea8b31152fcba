r"""Laws of pads: a force-deflection curve, a dashpot and Maxwell branches side by side.

With :math:`N_t` the curve's force, a dashpot c and branches of stiffness :math:`k_j` and relaxation time
:math:`\tau_j`, the force in contact is

.. math:: N = N_t(\delta) + c\,\dot\delta + \sum_j k_j (\delta - p_j), \qquad \tau_j \dot p_j = \delta - p_j .

Contact ends where N reaches zero. The released pad recovers by itself: its face is at the compression u at which the
same force with u in the place of :math:`\delta` is zero, and contact is made again where :math:`\delta` meets u.
Without a dashpot u is linear in the p of the segment in which it lies; with one it is an internal state of its own.
There is a phase in contact and a released phase for each segment of the curve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from beamsim.contacts.force_curve import ForceCurve
from beamsim.contacts.laws import ContactLaw, Guard, Phase, piecewise_linear
from beamsim.dataclass import dataclass
from beamsim.typing import Floats


@dataclass(frozen=True)
class MaxwellBranch:
    """A spring in series with a dashpot."""

    stiffness: float  # N/m
    relaxation_time: float  # s, dashpot over stiffness


def table_law(curve: ForceCurve, dashpot: float = 0.0) -> ContactLaw:
    """A force-deflection curve beside a dashpot, which push while there is penetration: one phase a segment.

    Examples
    --------
    >>> law = table_law(ForceCurve(np.array([0.0, 1.0, 3.0]), np.array([0.0, 2.0, 10.0])))
    >>> [(phase.name, phase.stiffness, phase.force) for phase in law.phases]
    [('open', 0.0, 0.0), ('segment 1', 2.0, 0.0), ('segment 2', 4.0, -2.0)]
    """
    law = piecewise_linear(curve.deflection[:-1].tolist(), [0.0, *curve.slopes.tolist()], 0)
    names = ["open", *(f"segment {i + 1}" for i in range(len(law.phases) - 1))]
    phases = tuple(
        replace(phase, name=name, dashpot=dashpot if phase.touching else 0.0)
        for name, phase in zip(names, law.phases, strict=True)
    )
    assert law.parts is not None
    parts = (replace(law.parts[0], dashpot=dashpot), *law.parts[1:])
    return replace(law, phases=phases, parts=parts, stiffness=curve.stiffness, dashpot=dashpot)


def recovering_law(curve: ForceCurve, dashpot: float = 0.0, branches: Sequence[MaxwellBranch] = ()) -> ContactLaw:
    """A pad that never pulls and recovers by itself; see the module's equations.

    The internal states are the compression u of the released face, where there is a dashpot, then the p of the
    branches. In contact u means nothing: it starts from zero and decays.
    """
    count = curve.slopes.size
    pad = _Pad(curve, dashpot, tuple(branches))
    phases = [pad.released(i, count) for i in range(count)] + [pad.touching(i, count) for i in range(count)]

    def settled(penetration: float) -> tuple[float, ...]:
        return (0.0,) * pad.first + (max(penetration, 0.0),) * len(branches)

    return ContactLaw(
        tuple(phases),
        internal_states=pad.states,
        stiffness=curve.stiffness,
        dashpot=dashpot,
        static=table_law(curve).parts,
        settled=settled,
        undamped_law=None if branches else table_law(curve),
    )


def relaxing_law(law: ContactLaw | None, branches: Sequence[MaxwellBranch]) -> ContactLaw:
    """Branches beside a two-sided law without internal states, or alone: a spring that relaxes.

    Examples
    --------
    >>> (phase,) = relaxing_law(None, [MaxwellBranch(3.0, 0.5)]).phases
    >>> phase.stiffness, phase.internal, phase.dynamics, phase.drive
    (3.0, (-3.0,), ((-2.0,),), ((2.0, 0.0, 0.0),))
    """
    k = [b.stiffness for b in branches]
    rows = np.zeros((len(k), 3 + len(k)))
    for j, branch in enumerate(branches):
        rows[j, 0], rows[j, 3 + j] = 1.0 / branch.relaxation_time, -1.0 / branch.relaxation_time
    memory: dict[str, Any] = {
        **_motion(rows), "internal": tuple(-x for x in k), "stored": _tuples(np.diag(k)),
        "losses": tuple(b.stiffness * b.relaxation_time for b in branches),
    }  # fmt: skip
    phases = (Phase("stretched", (), touching=False),) if law is None else law.phases
    return ContactLaw(
        tuple(replace(phase, stiffness=phase.stiffness + sum(k), **memory) for phase in phases),
        internal_states=len(k),
        start=0 if law is None else law.start,
        static=() if law is None else law.parts,
        settled=lambda stretch: (stretch,) * len(k),
    )


@dataclass(frozen=True)
class _Pad:
    """Rows are factors of the penetration, its rate, 1, and the internal states."""

    curve: ForceCurve
    dashpot: float
    branches: tuple[MaxwellBranch, ...]

    @property
    def first(self) -> int:
        """Number of the first branch's state."""
        return 1 if self.dashpot > 0.0 else 0

    @property
    def states(self) -> int:
        return self.first + len(self.branches)

    @property
    def k(self) -> Floats:
        """(r,) stiffness of the branch of each state, zero of u."""
        return np.array([0.0] * self.first + [b.stiffness for b in self.branches])

    def offset(self, i: int) -> float:
        """Force at zero deflection on the line of a segment, N."""
        return float(self.curve.force[i] - self.curve.slopes[i] * self.curve.deflection[i])

    def energy(self, i: int) -> float:
        """Energy at zero deflection on the parabola of a segment, J."""
        x, force = self.curve.deflection[: i + 1], self.curve.force[: i + 1]
        below = float(np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(x)))
        return below - 0.5 * float(self.curve.slopes[i] * x[i] ** 2) - self.offset(i) * float(x[i])

    def stiffness(self, i: int) -> float:
        return float(self.curve.slopes[i] + self.k.sum())

    def face(self, i: int) -> Floats:
        """(3 + r,) row of u in the released phase of a segment."""
        row = np.zeros(3 + self.states)
        if self.first:
            row[3] = 1.0
        else:
            row[2], row[3:] = -self.offset(i) / self.stiffness(i), self.k / self.stiffness(i)
        return row

    def losses(self) -> tuple[float, ...]:
        """Of the dashpot with the rate of u, and of the branches' dashpots."""
        return (self.dashpot,) * self.first + tuple(b.stiffness * b.relaxation_time for b in self.branches)

    def rates(self, i: int, compression: Floats, *, released: bool) -> Floats:
        """(r, 3 + r) rows of the rates of the states, the branches being compressed by a row."""
        rows = np.zeros((self.states, 3 + self.states))
        for j, branch in enumerate(self.branches, start=self.first):
            rows[j] = compression / branch.relaxation_time
            rows[j, 3 + j] -= 1.0 / branch.relaxation_time
        if self.first:
            rows[0, 3] = -self.stiffness(i) / self.dashpot
            if released:
                rows[0, 3:] += self.k / self.dashpot
                rows[0, 2] = -self.offset(i) / self.dashpot
        return rows

    def crossings(self, i: int, count: int, compression: Floats, shift: int) -> list[Guard]:
        """Guards at the ends of a segment."""
        guards = []
        if i > 0:
            guards.append(_guard(i - 1 + shift, compression, -self.curve.deflection[i]))
        if i + 1 < count:
            guards.append(_guard(i + 1 + shift, -compression, self.curve.deflection[i + 1]))
        return guards

    def reset(self, face: Floats | None) -> tuple[tuple[float, ...], ...] | None:
        """The states after contact is made (face None) or lost: those of the branches go on."""
        if not self.first:
            return None
        rows = np.zeros((self.states, 3 + self.states))
        rows[:, 3:] = np.eye(self.states)
        rows[0] = 0.0 if face is None else face
        return tuple(map(tuple, rows.tolist()))

    def released(self, i: int, count: int) -> Phase:
        face = self.face(i)
        delta = np.eye(3 + self.states)[0]
        meets = replace(_guard(count + i, face - delta), reset=self.reset(None))
        # energy of the curve and of the branches with u in the place of the penetration
        quadratic, linear = np.zeros((self.states, self.states)), np.zeros(self.states)
        u, constant = face[3:], float(face[2])
        slope, offset = float(self.curve.slopes[i]), self.offset(i)
        quadratic += slope * np.outer(u, u)
        linear += (slope * constant + offset) * u
        energy = self.energy(i) + offset * constant + 0.5 * slope * constant**2
        for j, k in enumerate(self.k):
            stretch = u - np.eye(self.states)[j]
            quadratic += k * np.outer(stretch, stretch)
            linear += k * constant * stretch
            energy += 0.5 * float(k) * constant**2
        return Phase(
            f"released {i + 1}", (meets, *self.crossings(i, count, face, 0)), touching=False,
            **_motion(self.rates(i, face, released=True)), stored=_tuples(quadratic),
            stored_linear=tuple(linear.tolist()), losses=self.losses(), energy=energy,
        )  # fmt: skip

    def touching(self, i: int, count: int) -> Phase:
        delta = np.eye(3 + self.states)[0]
        force = np.concatenate([[self.stiffness(i), self.dashpot, self.offset(i)], -self.k])
        lets_go = replace(_guard(i, force), reset=self.reset(delta))
        losses = (0.0,) * self.first + self.losses()[self.first :]
        return Phase(
            f"segment {i + 1}", (lets_go, *self.crossings(i, count, delta, count)), touching=True,
            stiffness=self.stiffness(i), dashpot=self.dashpot, force=self.offset(i), internal=tuple((-self.k).tolist()),
            **_motion(self.rates(i, delta, released=False)), stored=_tuples(np.diag(self.k)), losses=losses,
            energy=self.energy(i),
        )  # fmt: skip


def _guard(following: int, row: Floats, constant: float = 0.0) -> Guard:
    return Guard(following, float(row[0]), float(row[1]), float(row[2]) + constant, tuple(row[3:].tolist()))


def _motion(rows: Floats) -> dict[str, Any]:
    """Dynamics and drive of internal states from the rows of their rates."""
    return {"dynamics": _tuples(rows[:, 3:]), "drive": _tuples(rows[:, :3])}


def _tuples(rows: Floats) -> tuple[tuple[float, ...], ...]:
    return tuple(map(tuple, rows.tolist()))
