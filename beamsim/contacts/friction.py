r"""Dry friction, with or without a tangential spring in front of the sliding face (Jenkins element).

With the spring's stiffness k, the tangential motion :math:`\delta` and the position p of the slider, the friction force
is :math:`T = k\,(\delta - p)`. While the slider sticks p rests, until \|T\| reaches the static limit :math:`\mu_s N`.
It then slides along the motion with :math:`T = \pm\mu_d N`; the spring has lost what lies between the two limits.
Sliding ends where the motion turns, :math:`\dot\delta = 0`, and p follows from the force there. The work of the force
while it slides is lost.

Without a spring the stuck face holds: T is whatever keeps it where it is.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from beamsim.contacts.laws import ContactLaw, Guard, Phase

STICK, FORWARDS, BACKWARDS = 0, 1, 2  # phases


@lru_cache(maxsize=1024)
def friction_law(stiffness: float, static: float, sliding: float, start: float = 0.0) -> ContactLaw:
    """Dry friction behind a tangential spring.

    Parameters
    ----------
    stiffness : of the tangential spring, N/m.
    static, sliding : friction forces at which sliding begins and while it lasts, N.
    start : friction force at the beginning of a motion, N, below the static one.

    Examples
    --------
    >>> law = friction_law(1e4, 3.0, 2.0)
    >>> [(phase.name, phase.stiffness, phase.force) for phase in law.phases]
    [('stick', 10000.0, 0.0), ('sliding forwards', 0.0, 2.0), ('sliding backwards', 0.0, -2.0)]
    """
    k = stiffness
    lost = 0.5 * (static - sliding) * (static + sliding) / k  # of the spring's energy when sliding begins
    memory: dict[str, Any] = {"dynamics": ((0.0,),), "drive": ((0.0, 0.0, 0.0),)}
    breaks_away = tuple(
        Guard(phase, penetration=-sign * k, internal=(sign * k,), constant=static, loss=lost)
        for phase, sign in ((FORWARDS, 1.0), (BACKWARDS, -1.0))
    )
    stick = Phase("stick", breaks_away, touching=True, stiffness=k, internal=(-k,), stored=((k,),), **memory)
    slides = tuple(
        Phase(
            name, (Guard(STICK, rate=sign, reset=((1.0, 0.0, -sign * sliding / k, 0.0),)),), touching=False,
            force=sign * sliding, friction=sign * sliding, energy=0.5 * sliding**2 / k, **memory,
        )
        for name, sign in (("sliding forwards", 1.0), ("sliding backwards", -1.0))
    )  # fmt: skip
    return ContactLaw(
        (stick, *slides),
        internal_states=1,
        static=(),
        settled=lambda penetration: (penetration - start / k,),
        resting_force=start,
    )


@lru_cache(maxsize=1024)
def rigid_friction_law(static: float, sliding: float, start: float = 0.0) -> ContactLaw:
    """Dry friction of a face that does not move at all while it sticks; numbers as in :func:`friction_law`.

    Examples
    --------
    >>> [(phase.name, phase.holds, phase.force) for phase in rigid_friction_law(3.0, 2.0).phases]
    [('stick', True, 0.0), ('sliding forwards', False, 2.0), ('sliding backwards', False, -2.0)]
    """
    breaks_away = tuple(
        Guard(phase, constant=1.0, reaction=-sign / static) for phase, sign in ((FORWARDS, 1.0), (BACKWARDS, -1.0))
    )  # relative: of several that are exceeded at once, the one that is exceeded most lets go first
    slides = tuple(
        Phase(name, (Guard(STICK, rate=sign),), touching=False, force=sign * sliding, friction=sign * sliding)
        for name, sign in (("sliding forwards", 1.0), ("sliding backwards", -1.0))
    )
    stick = Phase("stick", breaks_away, touching=True, holds=True)
    return ContactLaw((stick, *slides), sliding=(FORWARDS, BACKWARDS), static=(), resting_force=start)
