r"""Gapping of a run: what the linear motion about equilibrium would do, and what this motion did.

The linear motion is that in which every contact keeps the phase that it has at rest. Of a sine it is the steady one
(`beamsim.analyses.gapping`). Of a pulse, a record and other inputs it is marched from equilibrium: with
:math:`\delta_0` the penetration at rest and :math:`\delta` that of the linear motion, the contact opens where the input
is multiplied by

.. math:: \delta_0 / (\delta_0 - \min_t \delta)

or more, and touches where it is multiplied by :math:`\delta_0 / (\delta_0 - \max_t \delta)`. Of a random input the
standard deviation of the stationary linear motion is compared with :math:`\delta_0`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from beamsim.analyses.gapping import contact_levels, gapping, pressed_phases, static_penetration
from beamsim.analyses.run.figures import extremes_of
from beamsim.analyses.run.linear_prediction import Deviations, linear_input, stationary_deviations
from beamsim.analyses.run.motion import RunMotion
from beamsim.analyses.run.outputs import exact_flow
from beamsim.analyses.values import FORCE, PENETRATION, Extremes
from beamsim.contacts.laws import ContactLaw
from beamsim.flow.channels import Observed
from beamsim.flow.transient import simulate
from beamsim.scenario import Run, Scenario
from beamsim.scenario.excitation import Forces, Harmonic, RandomInput, Shock
from beamsim.scenario.quantities import INTEGRALS
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats, Ints

SIGMAS = 3.0  # of a stationary motion that a preload withstands
ALWAYS_CLOSED = 1e-12  # of the penetration at rest: a smaller excursion is round-off

OfSnubbers = dict[str, dict[str, Any]]


def gapping_of_run(
    scenario: Scenario,
    system: StructuralSystem,
    motion: RunMotion,
    summary: Mapping[str, Any],
    stop: Callable[[], bool],
) -> OfSnubbers:
    """By snubber, for the summary; empty where there is no linear motion to compare with.

    There is none beside nonlinear springs and friction that holds or that a snubber presses, of snubbers whose law is
    more than a stiffness and a dashpot, and of a motion that does not start at equilibrium.
    """
    contacts = system.dynamics.contacts
    unknown = system.cubic.count or contacts.ever_hold or contacts.pressed.size or system.static_equilibrium is None
    if not system.snubbers or unknown or motion.outcome.interrupted:
        return {}
    excitation = scenario.excitation
    if system.sine is not None:
        assert isinstance(excitation, Harmonic | Forces)
        of_snubber = _of_sine(system, excitation)
    elif isinstance(excitation, RandomInput):
        of_snubber = _of_random(scenario, system)
    else:
        settings = scenario.run
        assert settings is not None
        if settings.start != "static_equilibrium" or excitation.kind == "none" or motion.trajectory is None:
            return {}
        level = float(excitation.level) if isinstance(excitation, Shock) else None
        of_snubber = _of_motion(system, settings, motion, level, stop)
    names = [snubber.name for snubber in system.snubbers]
    for name, of in of_snubber.items():
        times = motion.events.time[motion.events.snubber == names.index(name)]
        of["first_change_s"] = float(times[0]) if times.size else None
        of["largest_gap_m"] = summary["largest_gap_m"][name]
    return of_snubber


def _of_sine(system: StructuralSystem, excitation: Harmonic | Forces) -> OfSnubbers:
    """The level that changes contact at the frequency of the sine."""
    frequency = np.array([excitation.frequency])
    levels = contact_levels(system, frequency)
    omega = 2.0 * np.pi * excitation.frequency
    power = INTEGRALS.get(excitation.quantity or "", 0)
    return gapping(levels, frequency, np.array([abs(excitation.level) * omega**power])) if levels else {}


class _Excursion(NamedTuple):
    """Extremes (m,) of penetration, m, and force, N, of a linear motion, and when they are reached, s."""

    lowest: Floats
    lowest_at: Floats
    highest: Floats
    highest_at: Floats
    lowest_force: Floats
    lowest_force_at: Floats


def _of_motion(
    system: StructuralSystem, settings: Run, motion: RunMotion, level: float | None, stop: Callable[[], bool]
) -> OfSnubbers:
    """Factors of the input at which the linear motion changes contact, from its extremes."""
    contacts, count = system.dynamics.contacts, len(system.snubbers)
    penetration = static_penetration(system)
    closed = penetration > 0
    resting, pressed = contacts.resting_phases(penetration), pressed_phases(system, penetration)
    unchanged = motion.work.events == 0
    at_rest = _excursion(motion.extremes) if unchanged else _linear_motion(system, settings, resting, stop)
    same = bool(np.array_equal(resting[:count], pressed[:count]))
    shut = at_rest if same else _linear_motion(system, settings, pressed, stop)
    if at_rest is None or shut is None:
        return {}
    of_snubber = {}
    for j, snubber in enumerate(system.snubbers):
        law = contacts.laws[j]
        if law.family is None:
            continue
        rest = float(penetration[j])
        factor, time = _factor(law, rest, at_rest, j)
        together = _needed(law, rest, shut, j)
        of_snubber[snubber.name] = {
            "closed_at_rest": bool(closed[j]),
            "share_of_level": factor,
            **({} if level is None else {"level": factor * abs(level)}),
            "time_s": time,
            "preload_n": together,
            "preload_alone_n": _needed(law, rest, at_rest, j) if closed[j] else together if same else float("nan"),
        }
    return of_snubber


def _factor(law: ContactLaw, rest: float, linear: _Excursion, j: int) -> tuple[float, float]:
    """Factor of the input from which contact changes, and when; inf where no input of this shape does."""
    if rest <= 0:
        return _ratio(-rest, float(linear.highest[j]) - rest), float(linear.highest_at[j])
    if law.parts is None:  # without tension: where the force vanishes
        force = law.stiffness * rest
        return _ratio(force, force - float(linear.lowest_force[j])), float(linear.lowest_force_at[j])
    return _ratio(rest, rest - float(linear.lowest[j])), float(linear.lowest_at[j])


def _ratio(rest: float, excursion: float) -> float:
    return rest / excursion if excursion > ALWAYS_CLOSED * rest else float("inf")


def _needed(law: ContactLaw, rest: float, linear: _Excursion, j: int) -> float:
    """Contact force at rest, N, that the linear motion just keeps positive."""
    if law.parts is None:
        return max(law.stiffness * rest - float(linear.lowest_force[j]), 0.0)
    return law.stiffness * max(rest - float(linear.lowest[j]), 0.0)


def _linear_motion(
    system: StructuralSystem, settings: Run, phases: Ints, stop: Callable[[], bool]
) -> _Excursion | None:
    """The motion from equilibrium in which no contact leaves its phase; None if it was interrupted."""
    contacts = system.dynamics.contacts
    laws = tuple(
        replace(law, phases=(replace(law.phases[phase], guards=()),), start=0)
        for law, phase in zip(contacts.laws, phases.tolist(), strict=True)
    )
    linear = replace(system, dynamics=replace(system.dynamics, contacts=replace(contacts, laws=laws)))
    flow = exact_flow(linear, settings.duration, settings.most_contact_states, memory=settings.memory)
    trajectory = simulate(flow, system.initial_state, max_events=settings.max_events, stop=stop)
    if not trajectory.outcome.complete:
        return None
    return _excursion(extremes_of(trajectory, Observed(flow, linear.channels.of_keys(PENETRATION, FORCE))))


def _excursion(extremes: Extremes) -> _Excursion:
    return _Excursion(*extremes[PENETRATION], *extremes[FORCE][:2])


def _of_random(scenario: Scenario, system: StructuralSystem) -> OfSnubbers:
    """How many standard deviations of the stationary linear motion contact withstands."""
    driven = linear_input(scenario, system)
    if driven is None:
        return {}
    contacts = system.dynamics.contacts
    penetration = static_penetration(system)
    resting, pressed = contacts.resting_phases(penetration), pressed_phases(system, penetration)
    at_rest = stationary_deviations(driven, resting)
    shut = at_rest if np.array_equal(resting, pressed) else stationary_deviations(driven, pressed)
    if at_rest is None or shut is None:  # an undamped resonance within the band
        return {}
    of_snubber = {}
    for j, snubber in enumerate(system.snubbers):
        law, rest = contacts.laws[j], float(penetration[j])
        if law.family is None:
            continue
        alone = _force_deviation(law, at_rest, snubber.name) if rest > 0 else float("nan")
        together = _force_deviation(law, shut, snubber.name)
        loses_by_force = rest > 0 and law.parts is None
        reserve = law.stiffness * rest if loses_by_force else abs(rest)
        deviation = alone if loses_by_force else at_rest[snubber.name, "penetration"]
        of_snubber[snubber.name] = {
            "closed_at_rest": rest > 0,
            "sigmas": reserve / deviation if deviation > 0 else float("inf"),
            "preload_n": SIGMAS * together,
            "preload_alone_n": SIGMAS * (alone if rest > 0 else together if shut is at_rest else float("nan")),
        }
    return of_snubber


def _force_deviation(law: ContactLaw, of: Deviations, name: str) -> float:
    """Of the force that contact is lost by: with tension that of the spring alone."""
    return of[name, "force"] if law.parts is None else law.stiffness * of[name, "penetration"]
