r"""Stops that are crushed: bilinear force with kinematic hardening, which never pulls.

A spring of the hardening stiffness :math:`k_h` beside a slider behind a spring :math:`k_s = k - k_h` (Masing, Iwan).
With the penetration :math:`\delta` and the position p of the slider,

.. math:: N = k_h\,\delta + k_s\,(\delta - p) + c\,\dot\delta, \qquad k_s\,|\delta - p| \le f = F_y\,(1 - k_h / k) .

On first loading the stiffness is k up to the yield force :math:`F_y` and :math:`k_h` beyond. Unloading is elastic over
2 f, then yields back. The face stays where the force of springs and slider is zero, :math:`\delta = k_s\,p / k`: this
is the residual crush, at most :math:`f / k_h`. The work of the slider is lost.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

from beamsim.contacts.laws import DEPTH, ContactLaw, Guard, LawRow, LawSpring, OneSidedSpring, Phase

OPEN, ELASTIC, LOADING, UNLOADING = 0, 1, 2, 3  # phases; the last two yield


@lru_cache(maxsize=1024)
def hardening_law(stiffness: float, yield_force: float, hardening: float, dashpot: float = 0.0) -> ContactLaw:
    """A stop that yields and stays crushed; see the module's equations.

    Parameters
    ----------
    stiffness : before it yields, N/m.
    yield_force : at which it yields when it is loaded first, N.
    hardening : stiffness while it yields, N/m, positive and below ``stiffness``.
    dashpot : beside the springs in contact, N s/m.

    Returns
    -------
    ContactLaw
        With the phases OPEN, ELASTIC, LOADING and UNLOADING, and one internal state, the slider.

    Examples
    --------
    >>> law = hardening_law(1e5, 100.0, 2e4)
    >>> [(phase.name, phase.stiffness, phase.lost.constant) for phase in law.phases]
    [('open', 0.0, 0.0), ('elastic', 100000.0, 0.0), ('loading', 20000.0, 80.0), ('unloading', 20000.0, -80.0)]
    """
    k_s = stiffness - hardening
    f = yield_force * k_s / stiffness
    share = k_s / stiffness  # of the slider's position, at which the face is
    face, beside = LawRow(internal=(share,)), LawSpring(hardening, DEPTH)
    open_ = Phase(
        "open", (Guard(ELASTIC, LawRow(-1.0, internal=(share,))),), touching=False,
        springs=(LawSpring(hardening, face), LawSpring(k_s, LawRow(internal=(share - 1.0,)))),
    )  # fmt: skip
    elastic = Phase(
        "elastic",
        (
            Guard(OPEN, LawRow(1.0, internal=(-share,))),
            Guard(LOADING, LawRow(-k_s, internal=(k_s,), constant=f)),
            Guard(UNLOADING, LawRow(k_s, internal=(-k_s,), constant=f)),
        ),
        touching=True, springs=(beside, LawSpring(k_s, LawRow(1.0, internal=(-1.0,)))), lost=LawRow(rate=dashpot),
    )  # fmt: skip

    springs, damping = (beside, LawSpring(k_s, LawRow(constant=f / k_s))), LawRow(rate=dashpot, constant=f)
    loading = _yielding("loading", springs, damping, ((ELASTIC, LawRow(rate=1.0)),))
    springs, damping = (beside, LawSpring(k_s, LawRow(constant=-f / k_s))), LawRow(rate=dashpot, constant=-f)
    lets_go = LawRow(penetration=hardening, constant=-f)
    unloading = _yielding("unloading", springs, damping, ((OPEN, lets_go), (ELASTIC, LawRow(rate=-1.0))))

    return ContactLaw(
        (open_, elastic, loading, unloading),
        internal_states=1,
        stiffness=stiffness,
        dashpot=dashpot,
        static=(
            OneSidedSpring(1.0, stiffness, dashpot, 0.0),
            OneSidedSpring(1.0, hardening - stiffness, 0.0, yield_force / stiffness),
        ),
        settled=lambda penetration: (max(penetration - f / k_s, 0.0),),
    )


def _yielding(
    name: str, springs: tuple[LawSpring, LawSpring], lost: LawRow, ends: Sequence[tuple[int, LawRow]]
) -> Phase:
    """A phase that yields: its second spring has a constant stretch, with which it goes on where yielding ends."""
    stretch = springs[1].stretch
    slider = (LawRow(1.0, constant=-stretch.constant),)
    guards = tuple(Guard(following, row, reset=slider) for following, row in ends)
    return Phase(name, guards, touching=True, springs=springs, lost=lost, written=stretch)


def residual_crush(law: ContactLaw, phase: int, penetration: float, slider: float) -> float:
    """How far the face of a stop is from where it was when new.

    Parameters
    ----------
    law : of :func:`hardening_law`.
    phase : number of the phase that it is in.
    penetration, slider : of the motion, m.

    Returns
    -------
    The residual crush, m; in a phase that yields that after unloading from there.
    """
    (face,) = law.phases[OPEN].guards[0].row.internal
    yielding = law.phases[phase].written
    if yielding is not None:  # where it would stay if it were unloaded now
        slider = penetration - yielding.constant
    return face * slider
