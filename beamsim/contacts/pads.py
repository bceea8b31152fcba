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
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from beamsim.contacts.force_curve import ForceCurve
from beamsim.contacts.laws import (
    DEPTH,
    OWN,
    ContactLaw,
    Guard,
    LawRow,
    LawSpring,
    Phase,
    kelvin_voigt,
    piecewise_linear,
)
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
    >>> [(phase.name, spring.stiffness, spring.force) for phase in law.phases for spring in phase.springs]
    [('open', 0.0, 0.0), ('segment 1', 2.0, 0.0), ('segment 2', 4.0, -2.0)]
    """
    law = piecewise_linear(curve.deflection[:-1].tolist(), [0.0, *curve.slopes.tolist()], 0)
    names = ["open", *(f"segment {i + 1}" for i in range(len(law.phases) - 1))]
    phases = tuple(
        replace(phase, name=name, lost=LawRow(rate=dashpot if phase.touching else 0.0))
        for name, phase in zip(names, law.phases, strict=True)
    )
    assert law.parts is not None
    parts = (replace(law.parts[0], dashpot=dashpot), *law.parts[1:])
    return replace(law, phases=phases, parts=parts, stiffness=curve.stiffness, dashpot=dashpot)


def recovering_law(curve: ForceCurve, dashpot: float = 0.0, branches: Sequence[MaxwellBranch] = ()) -> ContactLaw:
    """A pad that never pulls and recovers by itself; see the module's equations.

    Parameters
    ----------
    curve : force over deflection, N and m.
    dashpot : beside it, N s/m.
    branches : beside both.

    Returns
    -------
    ContactLaw
        The internal states are the compression u of the released face, where there is a dashpot, then the p of the
        branches. In contact u means nothing: it starts from zero and decays.
    """
    count = curve.slopes.size
    pad = _Pad(curve, dashpot, tuple(branches))
    phases = [pad.released(i) for i in range(count)] + [pad.touching(i) for i in range(count)]

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


@lru_cache(maxsize=1024)
def no_tension(stiffness: float, dashpot: float = 0.0) -> ContactLaw:
    """As :func:`kelvin_voigt`, but the snubber lets go where it would pull, and relaxes until it is met again.

    It is the pad whose curve is a line. The compression p of the released snubber, ``p' = -(k/c) p``, begins as the
    penetration at release; contact is made where the penetration reaches it. Without a dashpot the law is that of
    Kelvin–Voigt.
    """
    undamped = replace(kelvin_voigt(stiffness), family=no_tension)
    if dashpot == 0.0:
        return undamped
    return replace(recovering_law(ForceCurve.line(stiffness), dashpot), family=no_tension, undamped_law=undamped)


def relaxing_law(law: ContactLaw | None, branches: Sequence[MaxwellBranch]) -> ContactLaw:
    """Branches beside a two-sided law without internal states, or alone: a spring that relaxes.

    Examples
    --------
    >>> (phase,) = relaxing_law(None, [MaxwellBranch(3.0, 0.5)]).phases
    >>> phase.stiffness, phase.force(1)[[0, 6]].tolist(), phase.rates[0].array(1)[[0, 6]].tolist()
    (3.0, [3.0, -3.0], [2.0, -2.0])
    """
    pad = _Pad(ForceCurve(np.zeros(1), np.zeros(1)), 0.0, tuple(branches))
    phases = (Phase("stretched", (), touching=False),) if law is None else law.phases
    return ContactLaw(
        tuple(
            replace(
                phase,
                springs=(*phase.springs, *pad.of_branches(pad.delta)),
                rates=pad.relaxing(pad.delta),
                losses=pad.losses,
            )
            for phase in phases
        ),
        internal_states=pad.states,
        start=0 if law is None else law.start,
        static=() if law is None else law.parts,
        settled=lambda stretch: (stretch,) * pad.states,
    )


@dataclass(frozen=True)
class _Pad:
    """Rows are factors of the penetration, its rate, 1, and the internal states."""

    curve: ForceCurve
    dashpot: float
    branches: tuple[MaxwellBranch, ...]

    @property
    def first(self) -> int:
        """Number of the first branch's state; before it that of the face, beside a dashpot."""
        return 1 if self.dashpot > 0.0 else 0

    @property
    def states(self) -> int:
        return self.first + len(self.branches)

    @property
    def delta(self) -> Floats:
        """(3 + r,) row of the penetration."""
        return self.unit(0)

    def unit(self, column: int) -> Floats:
        """(3 + r,) row of one quantity."""
        return np.asarray(np.eye(OWN + self.states)[column])

    @property
    def losses(self) -> tuple[float, ...]:
        """Of the dashpot with the rate of the face, and of the branches' dashpots."""
        return (self.dashpot,) * self.first + tuple(b.stiffness * b.relaxation_time for b in self.branches)

    def offset(self, i: int) -> float:
        """Force at zero deflection on the line of a segment, N."""
        return float(self.curve.force[i] - self.curve.slopes[i] * self.curve.deflection[i])

    def of_branches(self, compression: Floats) -> tuple[LawSpring, ...]:
        """The springs of the branches, compressed by a row."""
        stretches = [_row(compression - self.unit(OWN + j)) for j in range(self.first, self.states)]
        return tuple(LawSpring(b.stiffness, stretch) for b, stretch in zip(self.branches, stretches, strict=True))

    def springs(self, i: int, compression: Floats) -> tuple[LawSpring, ...]:
        """Curve and branches on a segment, compressed by a row."""
        x, force, slope = self.curve.deflection[: i + 1], self.curve.force[: i + 1], float(self.curve.slopes[i])
        below = float(np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(x)))
        energy = below - 0.5 * slope * float(x[i]) ** 2 - self.offset(i) * float(x[i])
        return (LawSpring(slope, _row(compression), self.offset(i), energy), *self.of_branches(compression))

    def force(self, i: int, compression: Floats) -> Floats:
        """(3 + r,) row of the force of curve and branches on a segment, compressed by a row."""
        k = np.array([b.stiffness for b in self.branches])
        row = (float(self.curve.slopes[i]) + k.sum()) * compression
        row[2] += self.offset(i)
        row[OWN + self.first :] -= k
        return np.asarray(row)

    def face(self, i: int) -> Floats:
        """(3 + r,) row of u in the released phase of a segment."""
        if self.first:
            return self.unit(OWN)
        without = self.force(i, np.zeros(OWN + self.states))
        return np.asarray(-without / self.force(i, self.delta)[0])

    def relaxing(self, compression: Floats) -> tuple[LawRow, ...]:
        """Rates of the branches' states, compressed by a row."""
        return tuple(
            _row((compression - self.unit(OWN + j)) / branch.relaxation_time)
            for j, branch in enumerate(self.branches, start=self.first)
        )

    def recovering(self, i: int, *, released: bool) -> tuple[LawRow, ...]:
        """The rate of u, where it is a state: its dashpot moves by the force; in contact it decays."""
        if not self.first:
            return ()
        force = self.force(i, self.unit(OWN))
        return (_row(-(force if released else force[OWN] * self.unit(OWN)) / self.dashpot),)

    def crossings(self, i: int, compression: Floats, shift: int) -> list[Guard]:
        """Guards at the ends of a segment; ``shift`` is the number of the first segment's phase."""
        guards = []
        if i > 0:
            guards.append(Guard(i - 1 + shift, _row(compression, -self.curve.deflection[i])))
        if i + 1 < self.curve.slopes.size:
            guards.append(Guard(i + 1 + shift, _row(-compression, self.curve.deflection[i + 1])))
        return guards

    def reset(self, face: LawRow) -> tuple[LawRow, ...] | None:
        """The states after contact is made or lost: those of the branches go on."""
        return (face, *(_row(self.unit(OWN + j)) for j in range(1, self.states))) if self.first else None

    def released(self, i: int) -> Phase:
        face = self.face(i)
        meets = Guard(self.curve.slopes.size + i, _row(face - self.delta), self.reset(LawRow()))
        return Phase(
            f"released {i + 1}", (meets, *self.crossings(i, face, 0)), touching=False, springs=self.springs(i, face),
            rates=(*self.recovering(i, released=True), *self.relaxing(face)), losses=self.losses,
        )  # fmt: skip

    def touching(self, i: int) -> Phase:
        force = self.force(i, self.delta)
        force[1] = self.dashpot
        lets_go = Guard(i, _row(force), self.reset(DEPTH))
        return Phase(
            f"segment {i + 1}", (lets_go, *self.crossings(i, self.delta, self.curve.slopes.size)), touching=True,
            springs=self.springs(i, self.delta), lost=LawRow(rate=self.dashpot),
            rates=(*self.recovering(i, released=False), *self.relaxing(self.delta)),
            losses=(0.0,) * self.first + self.losses[self.first :],
        )  # fmt: skip


def _row(own: Floats, constant: float = 0.0) -> LawRow:
    return LawRow(float(own[0]), float(own[1]), float(own[2] + constant), tuple(own[OWN:].tolist()))
