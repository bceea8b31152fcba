r"""Stops that are crushed: bilinear force with kinematic hardening, which never pulls.

A spring of the hardening stiffness :math:`k_h` beside a slider behind a spring :math:`k_s = k - k_h` (Masing, Iwan).
With the penetration :math:`\delta` and the position p of the slider,

.. math:: N = k_h\,\delta + k_s\,(\delta - p) + c\,\dot\delta, \qquad k_s\,|\delta - p| \le f = F_y\,(1 - k_h / k) .

On first loading the stiffness is k up to the yield force :math:`F_y` and :math:`k_h` beyond. Unloading is elastic over
2 f, then yields back. The face stays where the force of springs and slider is zero, :math:`\delta = k_s\,p / k`: this
is the residual crush, at most :math:`f / k_h`. The work of the slider is lost.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from beamsim.contacts.laws import ContactLaw, Guard, OneSidedSpring, Phase

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

    Examples
    --------
    >>> law = hardening_law(1e5, 100.0, 2e4)
    >>> [(phase.name, phase.stiffness, phase.force) for phase in law.phases]
    [('open', 0.0, 0.0), ('elastic', 100000.0, 0.0), ('loading', 20000.0, 80.0), ('unloading', 20000.0, -80.0)]
    """
    k_s = stiffness - hardening
    f = yield_force * k_s / stiffness
    share = k_s / stiffness  # of the slider's position, at which the face is
    memory: dict[str, Any] = {"dynamics": ((0.0,),), "drive": ((0.0, 0.0, 0.0),)}
    touching: dict[str, Any] = {"touching": True, "dashpot": dashpot, **memory}
    slider = {sign: ((1.0, 0.0, -sign * f / k_s, 0.0),) for sign in (1.0, -1.0)}
    open_ = Phase(
        "open", (Guard(ELASTIC, penetration=-1.0, internal=(share,)),), touching=False,
        stored=((hardening * share,),), **memory,
    )  # fmt: skip
    elastic = Phase(
        "elastic",
        (
            Guard(OPEN, penetration=1.0, internal=(-share,)),
            Guard(LOADING, penetration=-k_s, internal=(k_s,), constant=f),
            Guard(UNLOADING, penetration=k_s, internal=(-k_s,), constant=f),
        ),
        stiffness=stiffness, internal=(-k_s,), stored=((k_s,),), **touching,
    )  # fmt: skip
    energy = 0.5 * f**2 / k_s
    loading = Phase(
        "loading", (Guard(ELASTIC, rate=1.0, reset=slider[1.0]),),
        stiffness=hardening, force=f, friction=f, energy=energy, kept=(-f / k_s, 0.0), **touching,
    )  # fmt: skip
    unloading = Phase(
        "unloading",
        (
            Guard(OPEN, penetration=hardening, constant=-f, reset=slider[-1.0]),
            Guard(ELASTIC, rate=-1.0, reset=slider[-1.0]),
        ),
        stiffness=hardening, force=-f, friction=-f, energy=energy, kept=(f / k_s, 0.0), **touching,
    )  # fmt: skip

    def settled(penetration: float) -> tuple[float, ...]:
        return (max(penetration - f / k_s, 0.0),)

    return ContactLaw(
        (open_, elastic, loading, unloading),
        internal_states=1,
        stiffness=stiffness,
        dashpot=dashpot,
        static=(
            OneSidedSpring(1.0, stiffness, dashpot, 0.0),
            OneSidedSpring(1.0, hardening - stiffness, 0.0, yield_force / stiffness),
        ),
        settled=settled,
    )


def yields(law: ContactLaw) -> bool:
    """Whether a law is that of a stop that yields: it loses work in phases in which its force still rises.

    Examples
    --------
    >>> yields(hardening_law(1e5, 100.0, 2e4))
    True
    """
    return any(phase.friction != 0.0 and phase.stiffness != 0.0 for phase in law.phases)


def residual_crush(law: ContactLaw, phase: int, penetration: float, slider: float) -> float:
    """How far the face of a stop is from where it was when new, m, in a motion at a penetration, m."""
    (face,) = law.phases[OPEN].guards[0].internal
    reset = law.phases[phase].guards[-1].reset
    if phase in (LOADING, UNLOADING) and reset is not None:  # where it would stay if it were unloaded now
        slider = reset[0][0] * penetration + reset[0][2]
    return face * slider
