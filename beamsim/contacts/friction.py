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

from dataclasses import replace
from functools import lru_cache

import numpy as np

from beamsim.contacts.laws import DEPTH, ContactLaw, Guard, LawRow, LawSpring, Phase

STICK, FORWARDS, BACKWARDS = 0, 1, 2  # phases
FREE = 3  # of a contact that another one presses; without a spring those of motions to either side, 3 and 4
DIRECTION = np.array([0.0, 1.0, -1.0, 0.0, 0.0])  # of sliding, by phase
_SIDES = ((FORWARDS, 1.0), (BACKWARDS, -1.0))  # phases of sliding and the direction of their friction force
_NAMES = {FORWARDS: "sliding forwards", BACKWARDS: "sliding backwards"}
_STRETCH = LawRow(penetration=1.0, internal=(-1.0,))  # of the tangential spring


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
        return bool(law.arrays.event_loss[STICK].any())
    return any(abs(guard.row.reaction) * sliding_limit(law) < 1.0 - 1e-12 for guard in stick.guards)


def snap(law: ContactLaw) -> float:
    """How far the slider moves at once where sliding begins, m; of a pressed contact for a unit of the force, m/N."""
    stick, slide = law.phases[STICK].guards[0].row, law.phases[FORWARDS]
    if not slide.springs:
        return 0.0
    return (stick.constant + stick.pressing - sliding_limit(law)) / slide.springs[0].stiffness


def sliding_limit(law: ContactLaw) -> float:
    """The friction force while a contact slides, N; of a pressed contact the coefficient."""
    lost = law.phases[FORWARDS].lost
    return lost.constant + lost.pressing


@lru_cache(maxsize=1024)
def friction_law(stiffness: float, static: float, sliding: float, start: float = 0.0) -> ContactLaw:
    """Dry friction behind a tangential spring.

    Parameters
    ----------
    stiffness : of the tangential spring, N/m.
    static, sliding : friction forces at which sliding begins and while it lasts, N.
    start : friction force at the beginning of a motion, N, below the static one.

    Returns
    -------
    ContactLaw
        With the phases STICK, FORWARDS and BACKWARDS, and one internal state, the slider.

    Examples
    --------
    >>> law = friction_law(1e4, 3.0, 2.0)
    >>> [(phase.name, phase.stiffness, phase.lost.constant) for phase in law.phases]
    [('stick', 10000.0, 0.0), ('sliding forwards', 0.0, 2.0), ('sliding backwards', 0.0, -2.0)]
    """
    return ContactLaw(
        _behind_spring(stiffness, static, sliding, pressed=False),
        internal_states=1,
        static=(),
        settled=lambda penetration: (penetration - start / stiffness,),
        resting_force=start,
    )


@lru_cache(maxsize=1024)
def rigid_friction_law(static: float, sliding: float, start: float = 0.0) -> ContactLaw:
    """Dry friction of a face that does not move at all while it sticks.

    Parameters
    ----------
    static, sliding, start : see :func:`friction_law`, N.

    Returns
    -------
    ContactLaw
        With the phases STICK, FORWARDS and BACKWARDS.

    Examples
    --------
    >>> [(phase.name, phase.holds, phase.lost.constant) for phase in rigid_friction_law(3.0, 2.0).phases]
    [('stick', True, 0.0), ('sliding forwards', False, 2.0), ('sliding backwards', False, -2.0)]
    """
    return ContactLaw(_rigid(static, sliding, pressed=False), static=(), resting_force=start)


@lru_cache(maxsize=1024)
def pressed_friction_law(stiffness: float | None, static: float, sliding: float) -> ContactLaw:
    """Dry friction under the force of another contact, with or without a tangential spring.

    Parameters
    ----------
    stiffness : of the tangential spring, N/m; None: the face does not move at all while it sticks.
    static, sliding : coefficients of friction.

    Returns
    -------
    ContactLaw
        With phases without force beside STICK, FORWARDS and BACKWARDS, which last while the other contact is open.

    Examples
    --------
    >>> law = pressed_friction_law(None, 0.3, 0.2)
    >>> [(phase.name, phase.lost.pressing, phase.otherwise) for phase in law.phases[:3]]
    [('stick', 0.0, 3), ('sliding forwards', 0.2, 3), ('sliding backwards', -0.2, 4)]
    """
    if stiffness is not None:
        free = Phase("free", (), touching=False, rates=(LawRow(rate=1.0),), written=LawRow(), otherwise=STICK)
        phases = [replace(phase, otherwise=FREE) for phase in _behind_spring(stiffness, static, sliding, pressed=True)]
        return ContactLaw((*phases, free), internal_states=1, static=(), settled=lambda penetration: (penetration,))
    stick, *slides = _rigid(static, sliding, pressed=True)
    touching = [replace(stick, otherwise=FREE)]
    frees = []
    for slide, (phase, sign) in zip(slides, _SIDES, strict=True):
        touching.append(replace(slide, otherwise=FREE + phase - FORWARDS))
        turns = Guard(FREE + BACKWARDS - phase, LawRow(rate=sign))
        frees.append(Phase(slide.name.replace("sliding", "free,"), (turns,), touching=False, otherwise=phase))
    return ContactLaw((*touching, *frees), static=())


def _plus(row: LawRow, limit: float, pressed: bool) -> LawRow:
    """A row with a friction force, which is constant or follows the force of another contact."""
    return row._replace(pressing=limit) if pressed else row._replace(constant=limit)


def _behind_spring(k: float, static: float, sliding: float, pressed: bool) -> tuple[Phase, ...]:
    """Sticking and sliding behind a tangential spring.

    While a pressed contact slides the internal state follows the face, and it is set where sliding ends.
    """
    breaks_away = tuple(
        Guard(
            phase,
            _plus(LawRow(penetration=-sign * k, internal=(sign * k,)), static, pressed),
            (DEPTH,) if pressed else None,
        )
        for phase, sign in _SIDES
    )
    slides = []
    for phase, sign in _SIDES:
        stretch, written = sign * sliding / k, sign * _written(static, sliding) / k
        ends = LawRow(rate=sign, pressing_rate=-sliding / k if pressed else 0.0)
        slides.append(
            Phase(
                _NAMES[phase], (Guard(STICK, ends, reset=(_plus(DEPTH, -stretch, pressed),)),), touching=False,
                springs=(LawSpring(k, _plus(LawRow(), stretch, pressed)),),
                lost=_plus(LawRow(), sign * sliding, pressed),
                rates=(LawRow(rate=1.0),) if pressed else (), written=_plus(LawRow(), written, pressed),
            )
        )  # fmt: skip
    return Phase("stick", breaks_away, touching=True, springs=(LawSpring(k, _STRETCH),)), *slides


def _rigid(static: float, sliding: float, pressed: bool) -> tuple[Phase, ...]:
    """Sticking and sliding of a face without a spring.

    Its guards are relative: of several limits that are exceeded at once, the one that is exceeded most lets go first.
    """
    breaks_away = tuple(Guard(phase, _plus(LawRow(reaction=-sign / static), 1.0, pressed)) for phase, sign in _SIDES)
    slides = (
        Phase(
            _NAMES[phase],
            (Guard(STICK, LawRow(rate=sign)),),
            touching=False,
            lost=_plus(LawRow(), sign * sliding, pressed),
        )
        for phase, sign in _SIDES
    )
    return Phase("stick", breaks_away, touching=True, holds=True), *slides
