r"""Contacts with a slider: dry friction, and stops that are crushed for good.

**Friction.** With or without a tangential spring in front of the sliding face (Jenkins element).

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

**Falling with speed** (Stribeck). :math:`T = \pm(\mu_s N - (\mu_s - \mu_d) N |\dot\delta| / v)` up to the speed v and
:math:`\pm\mu_d N` beyond: the force is continuous where sliding begins, and up to v that of a negative dashpot.
The slider behind a spring has no mass and would reach v at once; there two coefficients say the same.

A state that is to be started from again is written with the static limit in the spring where it slides, with two
coefficients with twice that: no motion sticks so.

**Hardening.** Stops that are crushed: bilinear force with kinematic hardening, which never pulls.

A spring of the hardening stiffness :math:`k_h` in parallel with a slider behind a spring :math:`k_s = k - k_h`
(Masing, Iwan).
With the penetration :math:`\delta` and the position p of the slider,

.. math:: N = k_h\,\delta + k_s\,(\delta - p) + c\,\dot\delta, \qquad k_s\,|\delta - p| \le f = F_y\,(1 - k_h / k) .

On first loading the stiffness is k up to the yield force :math:`F_y` and :math:`k_h` beyond. Unloading is elastic over
2 f, then yields back. The face stays where the force of springs and slider is zero, :math:`\delta = k_s\,p / k`: this
is the residual crush, at most :math:`f / k_h`. The work of the slider is lost.

**Unloading.** A curve :math:`N_l(\delta)` in parallel with a slider behind a spring k, whose force h lies between 0 and
:math:`D = N_u(\delta) - N_l(\delta)`, the distance of the loading curve,

.. math:: N = N_l(\delta) + h + c\,\dot\delta, \qquad h = k\,(\delta - p), \qquad 0 \le h \le D(\delta) .

Where the motion turns the force leaves either curve with the slope :math:`k + N_l'`. While it loads, h = D and
:math:`h\,(1 - D' / k)\,\dot\delta` is lost; a loop from zero loses the area between the curves. Without a curve
of unloading :math:`N_l = 0`, and at h = 0 the slider stays where it is: the stop is open, and crushed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from beamsim.contacts.laws import PENETRATION_ROW, ContactLaw, Guard, LawRow, LawSpring, OneSidedSpring, Phase
from beamsim.contacts.pads import ForceCurve, table_law

STICK, FORWARDS, BACKWARDS = 0, 1, 2  # phases of friction
FREE = 3  # of a contact that another one presses; without a spring those of motions to either side, 3 and 4
_SIDES = ((FORWARDS, 1.0), (BACKWARDS, -1.0))  # phases of sliding and the direction of their friction force
_NAMES = {FORWARDS: "sliding forwards", BACKWARDS: "sliding backwards"}
OPEN, ELASTIC, LOADING, UNLOADING = 0, 1, 2, 3  # phases of hardening; the last two yield
_EXTENSION = LawRow(penetration=1.0, internal=(-1.0,))  # of the tangential spring


def _restart_limit(static: float, sliding: float) -> float:
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
    if not stick.sticks_rigidly:
        return bool(law.arrays.event_loss[STICK].any())
    return any(abs(guard.row.reaction) * sliding_limit(law) < 1.0 - 1e-12 for guard in stick.guards)


def snap(law: ContactLaw) -> float:
    """How far the slider moves at once where sliding begins, m; of a pressed contact for a unit of the force, m/N."""
    stick, slide = law.phases[STICK].guards[0].row, law.phases[FORWARDS]
    if not slide.springs:
        return 0.0
    return (stick.constant + stick.normal_force - sliding_limit(law)) / slide.springs[0].stiffness


def sliding_limit(law: ContactLaw) -> float:
    """The friction force while a contact slides, N; of a pressed contact the coefficient."""
    lost = law.phases[FORWARDS].dissipative_force
    return lost.constant + lost.normal_force


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
    >>> [(phase.name, phase.stiffness, phase.dissipative_force.constant) for phase in law.phases]
    [('stick', 10000.0, 0.0), ('sliding forwards', 0.0, 2.0), ('sliding backwards', 0.0, -2.0)]
    """
    return ContactLaw(
        _behind_spring(stiffness, static, sliding, pressed=False),
        internal_states=1,
        static=(),
        relaxed_states=lambda penetration: (penetration - start / stiffness,),
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
    >>> law = rigid_friction_law(3.0, 2.0)
    >>> [(phase.name, phase.sticks_rigidly, phase.dissipative_force.constant) for phase in law.phases]
    [('stick', True, 0.0), ('sliding forwards', False, 2.0), ('sliding backwards', False, -2.0)]
    """
    return ContactLaw(_rigid(static, sliding, pressed=False), static=(), resting_force=start)


@lru_cache(maxsize=1024)
def falling_friction_law(static: float, sliding: float, speed: float, start: float = 0.0) -> ContactLaw:
    """Dry friction whose force falls in a straight line with the speed of sliding, and is constant beyond a speed.

    Parameters
    ----------
    static : friction force at which sliding begins, and with which it does, N.
    sliding, speed : friction force, N, from a speed of sliding on, m/s.
    start : see :func:`friction_law`, N.

    Returns
    -------
    ContactLaw
        With the phases STICK, FORWARDS and BACKWARDS, in which it slides slowly, and two in which it slides fast.

    Examples
    --------
    >>> law = falling_friction_law(3.0, 2.0, 0.1)
    >>> [(phase.name, phase.dissipative_force.rate, phase.dissipative_force.constant) for phase in law.phases[1::2]]
    [('sliding forwards', -10.0, 3.0), ('sliding fast forwards', 0.0, 2.0)]
    """
    stick, *slow = _rigid(static, static, pressed=False)
    damping = LawRow(rate=(sliding - static) / speed)
    fast = []
    for k, (phase, sign) in enumerate(_SIDES):
        faster = Guard(phase + len(_SIDES), LawRow(rate=-sign, constant=speed))
        slower = Guard(phase, LawRow(rate=sign, constant=-speed))
        name, lost = slow[k].name.replace(" ", " fast "), LawRow(constant=sign * sliding)
        fast.append(Phase(name, (slower,), closed=False, sliding_direction=sign, dissipative_force=lost))
        lost = damping._replace(constant=sign * static)
        slow[k] = replace(slow[k], guards=(*slow[k].guards, faster), dissipative_force=lost)
    return ContactLaw((stick, *slow, *fast), static=(), resting_force=start)


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
        In addition to STICK, FORWARDS and BACKWARDS it has phases without force, which last while the other contact is
        open.

    Examples
    --------
    >>> law = pressed_friction_law(None, 0.3, 0.2)
    >>> [(phase.name, phase.dissipative_force.normal_force) for phase in law.phases[:3]]
    [('stick', 0.0), ('sliding forwards', 0.2), ('sliding backwards', -0.2)]
    """
    if stiffness is not None:
        free = Phase(
            "free",
            (),
            closed=False,
            rates=(LawRow(rate=1.0),),
            restart_extension=LawRow(),
            phase_when_normal_contact_changes=STICK,
        )
        phases = [
            replace(phase, phase_when_normal_contact_changes=FREE)
            for phase in _behind_spring(stiffness, static, sliding, pressed=True)
        ]
        return ContactLaw(
            (*phases, free), internal_states=1, static=(), relaxed_states=lambda penetration: (penetration,)
        )
    stick, *slides = _rigid(static, sliding, pressed=True)
    touching = [replace(stick, phase_when_normal_contact_changes=FREE)]
    frees = []
    for slide, (phase, sign) in zip(slides, _SIDES, strict=True):
        touching.append(replace(slide, phase_when_normal_contact_changes=FREE + phase - FORWARDS))
        turns = Guard(FREE + BACKWARDS - phase, LawRow(rate=sign))
        frees.append(
            Phase(
                slide.name.replace("sliding", "free,"), (turns,), closed=False, phase_when_normal_contact_changes=phase
            )
        )
    return ContactLaw((*touching, *frees), static=())


def _plus(row: LawRow, friction_limit: float, pressed: bool) -> LawRow:
    """A row with a friction force, which is constant or follows the force of another contact."""
    return row._replace(normal_force=friction_limit) if pressed else row._replace(constant=friction_limit)


def _behind_spring(k: float, static: float, sliding: float, pressed: bool) -> tuple[Phase, ...]:
    """Sticking and sliding behind a tangential spring.

    While a pressed contact slides the internal state follows the face, and it is set where sliding ends.
    """
    breaks_away = tuple(
        Guard(
            phase,
            _plus(LawRow(penetration=-sign * k, internal=(sign * k,)), static, pressed),
            (PENETRATION_ROW,) if pressed else None,
        )
        for phase, sign in _SIDES
    )
    slides = []
    for phase, sign in _SIDES:
        extension, written = sign * sliding / k, sign * _restart_limit(static, sliding) / k
        ends = LawRow(rate=sign, normal_force_rate=-sliding / k if pressed else 0.0)
        slides.append(
            Phase(
                _NAMES[phase], (Guard(STICK, ends, reset=(_plus(PENETRATION_ROW, -extension, pressed),)),),
                closed=False, sliding_direction=sign, springs=(LawSpring(k, _plus(LawRow(), extension, pressed)),),
                dissipative_force=_plus(LawRow(), sign * sliding, pressed),
                rates=(LawRow(rate=1.0),) if pressed else (), restart_extension=_plus(LawRow(), written, pressed),
            )
        )  # fmt: skip
    return Phase("stick", breaks_away, closed=True, springs=(LawSpring(k, _EXTENSION),)), *slides


def _rigid(static: float, sliding: float, pressed: bool) -> tuple[Phase, ...]:
    """Sticking and sliding of a face without a spring.

    Its guards are relative: of several limits that are exceeded at once, the one that is exceeded most lets go first.
    """
    breaks_away = tuple(Guard(phase, _plus(LawRow(reaction=-sign / static), 1.0, pressed)) for phase, sign in _SIDES)
    slides = (
        Phase(
            _NAMES[phase],
            (Guard(STICK, LawRow(rate=sign)),),
            closed=False,
            sliding_direction=sign,
            dissipative_force=_plus(LawRow(), sign * sliding, pressed),
        )
        for phase, sign in _SIDES
    )
    return Phase("stick", breaks_away, closed=True, sticks_rigidly=True), *slides


@lru_cache(maxsize=1024)
def hardening_law(stiffness: float, yield_force: float, hardening: float, dashpot: float = 0.0) -> ContactLaw:
    """A stop that yields and stays crushed; see the module's equations.

    Parameters
    ----------
    stiffness : before it yields, N/m.
    yield_force : at which it yields when it is loaded first, N.
    hardening : stiffness while it yields, N/m, positive and below ``stiffness``.
    dashpot : in parallel with the springs in contact, N s/m.

    Returns
    -------
    ContactLaw
        With the phases OPEN, ELASTIC, LOADING and UNLOADING, and one internal state, the slider.

    Examples
    --------
    >>> law = hardening_law(1e5, 100.0, 2e4)
    >>> [(phase.name, phase.stiffness, phase.dissipative_force.constant) for phase in law.phases]
    [('open', 0.0, 0.0), ('elastic', 100000.0, 0.0), ('loading', 20000.0, 80.0), ('unloading', 20000.0, -80.0)]
    """
    k_s = stiffness - hardening
    f = yield_force * k_s / stiffness
    share = k_s / stiffness  # of the slider's position, at which the face is
    face, parallel = LawRow(internal=(share,)), LawSpring(hardening, PENETRATION_ROW)
    open_ = Phase(
        "open", (Guard(ELASTIC, LawRow(-1.0, internal=(share,))),), closed=False,
        springs=(LawSpring(hardening, face), LawSpring(k_s, LawRow(internal=(share - 1.0,)))),
    )  # fmt: skip
    elastic = Phase(
        "elastic",
        (
            Guard(OPEN, LawRow(1.0, internal=(-share,))),
            Guard(LOADING, LawRow(-k_s, internal=(k_s,), constant=f)),
            Guard(UNLOADING, LawRow(k_s, internal=(-k_s,), constant=f)),
        ),
        closed=True, springs=(parallel, LawSpring(k_s, LawRow(1.0, internal=(-1.0,)))),
        dissipative_force=LawRow(rate=dashpot),
    )  # fmt: skip

    springs, damping = (parallel, LawSpring(k_s, LawRow(constant=f / k_s))), LawRow(rate=dashpot, constant=f)
    loading = _yielding_phase("loading", springs, damping, ((ELASTIC, LawRow(rate=1.0)),))
    springs, damping = (parallel, LawSpring(k_s, LawRow(constant=-f / k_s))), LawRow(rate=dashpot, constant=-f)
    lets_go = LawRow(penetration=hardening, constant=-f)
    unloading = _yielding_phase("unloading", springs, damping, ((OPEN, lets_go), (ELASTIC, LawRow(rate=-1.0))))

    return ContactLaw(
        (open_, elastic, loading, unloading),
        internal_states=1,
        stiffness=stiffness,
        dashpot=dashpot,
        static=(
            OneSidedSpring(1.0, stiffness, dashpot, 0.0),
            OneSidedSpring(1.0, hardening - stiffness, 0.0, yield_force / stiffness),
        ),
        relaxed_states=lambda penetration: (max(penetration - f / k_s, 0.0),),
    )


def _yielding_phase(
    name: str, springs: tuple[LawSpring, LawSpring], dissipative_force: LawRow, ends: Sequence[tuple[int, LawRow]]
) -> Phase:
    """A phase that yields: its second spring has a constant extension, with which it goes on where yielding ends."""
    extension = springs[1].extension
    slider = (LawRow(1.0, constant=-extension.constant),)
    guards = tuple(Guard(following, row, reset=slider) for following, row in ends)
    return Phase(
        name, guards, closed=True, springs=springs, dissipative_force=dissipative_force, restart_extension=extension
    )


ELASTIC_SHARE = 1.0 - 1e-12  # of the force of the first loading, up to which small motions about it are elastic


def unloading_law(
    loading: ForceCurve, stiffness: float, recovery: ForceCurve | None = None, dashpot: float = 0.0
) -> ContactLaw:
    """A stop whose force falls along another way than it rises; see the module's equations.

    Parameters
    ----------
    loading : force over deflection while it is pressed further than before, N and m.
    stiffness : with which the force leaves a curve where the motion turns, N/m, above all slopes between the curves.
    recovery : force over deflection that the falling force goes down, not above ``loading``, as far as that goes; by
        default none, and the stop stays crushed.
    dashpot : in parallel with it in contact, N s/m.

    Returns
    -------
    ContactLaw
        Phases for each segment: on the lower curve, or open, between the curves, and loading; one internal state p.

    Raises
    ------
    ValueError
        If the curves cross, or the stiffness is too small.

    Examples
    --------
    >>> law = unloading_law(ForceCurve(np.array([0.0, 1.0, 3.0]), np.array([0.0, 2.0, 10.0])), 8.0)
    >>> [(phase.name, force[[0, 2, 6]].tolist()) for phase, force in zip(law.phases[:3], law.arrays.force)]
    [('open 1', [0.0, 0.0, 0.0]), ('between 1', [8.0, 0.0, -8.0]), ('loading 1', [2.0, 0.0, 0.0])]
    """
    x = loading.deflection[:-1] if recovery is None else np.union1d(loading.deflection, recovery.deflection)
    lower = _recovery_everywhere(loading, recovery)
    at = np.append(x, x[-1] + 1.0)
    low, width = lower.at(at), loading.at(at) - lower.at(at)
    if width.min() < -1e-9 * loading.force[-1]:
        k = int(np.argmin(width))
        raise ValueError(
            f"goes down a curve that lies above the loading curve at {at[k]:.6g}: {low[k]:.6g} above "
            f"{low[k] + width[k]:.6g} (SI)"
        )
    below, apart = np.diff(low) / np.diff(at), np.diff(width) / np.diff(at)
    if apart.max() >= stiffness:
        raise ValueError(f"has a stiffness of {stiffness:.6g}, not above {apart.max():.6g}, the steepest of the curve")
    area = 0.5 * (low[1:] + low[:-1]) * np.diff(at)
    offset, zero = low[:-1] - below * x, width[:-1] - apart * x  # at zero deflection
    energy = np.cumsum(area) - area - (0.5 * below * x + offset) * x
    phases = [] if recovery is None else [Phase("open", (Guard(2, LawRow(-1.0), (LawRow(),)),), closed=False)]
    for i, of_segment in enumerate(zip(below, offset, energy, apart, zero, strict=True)):
        ends = (float(x[i]) if i else None, float(x[i + 1]) if i + 1 < x.size else None)
        phases += _segment(3 * i + (recovery is not None), ends, of_segment, stiffness, dashpot)

    def relax(penetration: float) -> tuple[float, ...]:
        limit = ELASTIC_SHARE * float(loading.at(np.array(penetration)) - lower.at(np.array(penetration)))
        return (max(penetration, 0.0) - limit / stiffness,)

    static = table_law(loading).one_sided_springs
    return ContactLaw(
        tuple(phases), internal_states=1, stiffness=loading.stiffness, dashpot=dashpot, static=static,
        relaxed_states=relax,
    )  # fmt: skip


def _recovery_everywhere(loading: ForceCurve, recovery: ForceCurve | None) -> ForceCurve:
    """The curve of unloading at all deflections: beyond its last point it keeps its distance to the loading curve."""
    if recovery is None:
        return ForceCurve(loading.deflection, 0.0 * loading.force)
    end = recovery.deflection[-1]
    beyond = loading.deflection[loading.deflection > end]
    beyond = np.append(beyond, max(end, loading.deflection[-1]) + 1.0)
    distance = loading.at(end) - recovery.force[-1]
    return ForceCurve(np.append(recovery.deflection, beyond), np.append(recovery.force, loading.at(beyond) - distance))


def _segment(
    first_phase: int, ends: tuple[float | None, float | None], curves: Sequence[float], k: float, dashpot: float
) -> tuple[Phase, Phase, Phase]:
    """The phases of a segment of the curves: on the lower one, or open, between them, and loading.

    Parameters
    ----------
    first_phase : number of the first of the three phases; 1 for the first segment if there is a lower curve.
    ends : deflections, m; None where there is none.
    curves : slope, N/m, force at zero deflection, N, and energy, J, of the lower curve; slope of the distance of the
        loading curve, N/m, and distance at zero deflection, N.
    k, dashpot : see :func:`unloading_law`.
    """
    below, offset, energy, apart, zero = map(float, curves)
    spring, damping, turn = (
        LawSpring(below, PENETRATION_ROW, offset, energy),
        LawRow(rate=dashpot),
        LawRow(1.0, internal=(-1.0,)),
    )
    limit, share = LawRow(apart / k, constant=zero / k), 1.0 - apart / k

    def phase(
        name: str, mode: int, guards: tuple[Guard, ...], springs: tuple[LawSpring, ...], dissipative_force: LawRow
    ) -> Phase:
        before, after = ends
        crossings = [] if before is None else [Guard(first_phase - 3 + mode, LawRow(1.0, constant=-before))]
        crossings += [] if after is None else [Guard(first_phase + 3 + mode, LawRow(-1.0, constant=after))]
        return Phase(
            f"{name} {first_phase // 3 + 1}",
            (*guards, *crossings),
            name != "open",
            springs=springs,
            dissipative_force=dissipative_force,
        )

    if first_phase % 3 == 1:  # recovers
        lets_go = (Guard(0, PENETRATION_ROW),) if ends[0] is None else ()
        guards = (Guard(first_phase + 1, LawRow(rate=-1.0), (PENETRATION_ROW,)), *lets_go)
        lowest = phase("recovering", 0, guards, (spring,), damping)
    else:
        lowest = phase("open", 0, (Guard(first_phase + 1, LawRow(-1.0, internal=(1.0,))),), (), LawRow())
    slack, yields = Guard(first_phase, turn), Guard(first_phase + 2, LawRow(apart - k, constant=zero, internal=(k,)))
    back = Guard(first_phase + 1, LawRow(rate=1.0), (LawRow(share, constant=-limit.constant),))
    lost = LawRow(apart * share, dashpot, zero * share)
    return (
        lowest,
        phase("between", 1, (slack, yields), (spring, LawSpring(k, turn)), damping),
        phase("loading", 2, (back,), (spring, LawSpring(k, limit)), lost),
    )


def residual_crush(law: ContactLaw, phase: int, penetration: float, slider: float) -> float:
    """How far the face of a stop is from where it was when new.

    Parameters
    ----------
    law : of :func:`hardening_law` or :func:`unloading_law`.
    phase : number of the phase that it is in.
    penetration, slider : of the motion, m.

    Returns
    -------
    The residual crush, m; in a phase that yields that after unloading from there.
    """
    (face,) = law.phases[OPEN].guards[0].row.internal
    for row in (guard.reset[0] for guard in law.phases[phase].guards if guard.reset):  # if it were unloaded now
        slider = row.penetration * penetration + row.constant
    return face * slider
