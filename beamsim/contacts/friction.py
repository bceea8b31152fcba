r"""Dry friction, with or without a tangential spring in front of the sliding face (Jenkins element).

With the spring's stiffness k, the tangential motion :math:`\delta` and the position p of the slider, the friction force
is :math:`T = k\,(\delta - p)`. While the slider sticks p rests, until \|T\| reaches the static limit :math:`\mu_s N`.
It then slides along the motion with :math:`T = \pm\mu_d N`; the spring has lost what lies between the two limits.
Sliding ends where the motion turns, :math:`\dot\delta = 0`, and p follows from the force there. The work of the force
while it slides is lost.

Without a spring the stuck face holds: T is whatever keeps it where it is.

N is constant, or the force of another contact: then both limits follow its motion, :math:`T = \pm\mu_d N` is linear in
the state but not symmetric, and a phase without force lasts while the other contact is open. With a spring sliding ends
where the slider stands still, :math:`\dot p = \dot\delta \mp \mu_d \dot N / k = 0`; while it slides or is free
the internal state follows :math:`\delta`, so that the spring is unstressed where the faces meet again.

A state that is to be started from again is written with the static limit in the spring where it slides, with two
coefficients with twice that: no motion sticks so.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from beamsim.contacts.laws import ContactLaw, Guard, Phase

STICK, FORWARDS, BACKWARDS = 0, 1, 2  # phases
FREE = 3  # of a contact that another one presses; without a spring those of motions to either side, 3 and 4
DIRECTION = np.array([0.0, 1.0, -1.0, 0.0, 0.0])  # of sliding, by phase


class FrictionForces(NamedTuple):
    """The numbers of a friction contact under a constant normal force."""

    normal: float  # N
    static: float  # N
    sliding: float  # N
    stiffness: float  # N/m, of the tangential spring; infinite without one

    @property
    def snap(self) -> float:
        """How far the slider moves at once where sliding begins, m."""
        return (self.static - self.sliding) / self.stiffness

    @property
    def snap_loss(self) -> float:
        """Energy of the spring that is lost there, J."""
        return 0.5 * (self.static + self.sliding) * self.snap


def _written(static: float, sliding: float) -> float:
    """Limit that the spring of a contact that slides is written with, where a motion is to be started from there again.

    With one coefficient it is that of sticking as well, and the written state is continuous where sliding ends.
    """
    return static if static == sliding else 2.0 * static


def drops(law: ContactLaw) -> bool:
    """Whether a friction force falls where sliding begins: the static limit is above the sliding one.

    Examples
    --------
    >>> [drops(friction_law(1e4, 3.0, 2.0)), drops(rigid_friction_law(3.0, 2.0)), drops(rigid_friction_law(2.0, 2.0))]
    [True, True, False]
    """
    stick = law.phases[STICK]
    if not stick.holds:
        return any(guard.loss > 0.0 or guard.pressing_loss > 0.0 for guard in stick.guards)
    slide = law.phases[FORWARDS]
    return any(abs(guard.reaction) * (slide.friction + slide.pressing) < 1.0 - 1e-12 for guard in stick.guards)


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
            force=sign * sliding, friction=sign * sliding, energy=0.5 * sliding**2 / k,
            kept=(-sign * _written(static, sliding) / k, 0.0), **memory,
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


@lru_cache(maxsize=1024)
def pressed_friction_law(stiffness: float | None, static: float, sliding: float) -> ContactLaw:
    """Dry friction under the force of another contact, with or without a tangential spring.

    Parameters
    ----------
    stiffness : of the tangential spring, N/m; None: the face does not move at all while it sticks.
    static, sliding : coefficients of friction.

    Examples
    --------
    >>> law = pressed_friction_law(None, 0.3, 0.2)
    >>> [(phase.name, phase.pressing, phase.when_released) for phase in law.phases[:3]]
    [('stick', 0.0, 3), ('sliding forwards', 0.2, 3), ('sliding backwards', -0.2, 4)]
    """
    if stiffness is None:
        return _rigid_and_pressed(static, sliding)
    k = stiffness
    resting: dict[str, Any] = {"dynamics": ((0.0,),), "drive": ((0.0, 0.0, 0.0),)}
    following: dict[str, Any] = {"dynamics": ((0.0,),), "drive": ((0.0, 1.0, 0.0),)}
    here = ((1.0, 0.0, 0.0, 0.0),)
    lost = 0.5 * (static - sliding) * (static + sliding) / k
    breaks_away = tuple(
        Guard(
            phase, penetration=-sign * k, internal=(sign * k,), pressing=static, reset=here, pressing_loss=lost
        )
        for phase, sign in ((FORWARDS, 1.0), (BACKWARDS, -1.0))
    )  # fmt: skip
    stick = Phase(
        "stick", breaks_away, touching=True, stiffness=k, internal=(-k,), stored=((k,),), when_released=FREE, **resting
    )
    slides = tuple(
        Phase(
            name,
            (
                Guard(
                    STICK, rate=sign, pressing_rate=-sliding / k, reset=here, reset_pressing=-sign * sliding / k
                ),
            ),
            touching=False, pressing=sign * sliding, compliance=1.0 / k,
            kept=(0.0, -sign * _written(static, sliding) / k), when_released=FREE, **following,
        )
        for name, sign in (("sliding forwards", 1.0), ("sliding backwards", -1.0))
    )  # fmt: skip
    free = Phase("free", (), touching=False, kept=(0.0, 0.0), when_pressed=STICK, **following)
    return ContactLaw((stick, *slides, free), internal_states=1, static=(), settled=lambda penetration: (penetration,))


def _rigid_and_pressed(static: float, sliding: float) -> ContactLaw:
    """Dry friction under the force of another contact, of a face that does not move at all while it sticks."""
    breaks_away = tuple(
        Guard(phase, pressing=1.0, reaction=-sign / static) for phase, sign in ((FORWARDS, 1.0), (BACKWARDS, -1.0))
    )
    slides, frees = [], []
    for name, sign, other in (("forwards", 1.0, FREE + 1), ("backwards", -1.0, FREE)):
        own = FREE if sign > 0.0 else FREE + 1
        slides.append(
            Phase(
                f"sliding {name}", (Guard(STICK, rate=sign),), touching=False, pressing=sign * sliding,
                when_released=own,
            )
        )  # fmt: skip
        back = FORWARDS if sign > 0.0 else BACKWARDS
        frees.append(Phase(f"free, {name}", (Guard(other, rate=sign),), touching=False, when_pressed=back))
    stick = Phase("stick", breaks_away, touching=True, holds=True, when_released=FREE)
    return ContactLaw((stick, *slides, *frees), sliding=(FORWARDS, BACKWARDS), static=())
