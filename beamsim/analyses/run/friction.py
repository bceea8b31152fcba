"""What friction contacts did in a run: sliding, what it lost and what it wore.

Sliding speed is that of the face, which behind a tangential spring is the slider. Where sliding begins under less than
the static force the slider moves by what the spring springs back; this counts as sliding.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from beamsim.analyses.run.energy import contact_losses
from beamsim.analyses.run.impacts import BLOCKS, LEAST, SKIPPED, Sums, jackknife
from beamsim.analyses.run.result import FigureInterval
from beamsim.contacts.sliders import STICK
from beamsim.contacts.snubbers import FRICTION
from beamsim.flow.contact_state import LinearOutput
from beamsim.flow.exact import ExactFlow
from beamsim.flow.trajectory import Trajectory
from beamsim.scenario.connections import FrictionBase, OfHinge
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats, Ints


def friction_contacts(system: StructuralSystem) -> Ints:
    """(f,) numbers of the friction contacts among all contacts, in the order of the scenario."""
    of_springs = [spring.kind for spring in system.springs if spring.law is not None]
    return len(system.snubbers) + np.flatnonzero(np.array(of_springs) == FRICTION)


def sliding_figures(
    system: StructuralSystem, trajectory: Trajectory, contacts: Sequence[FrictionBase], *, random: bool = False
) -> list[dict[str, Any]]:
    """What friction contacts did in a motion, as fields of their histories.

    Parameters
    ----------
    system : of the contacts.
    trajectory : the motion that counts.
    contacts : f, those of the scenario in its order.
    random : whether the input is random, so that the figures have intervals.

    Returns
    -------
    Of each contact the fields of `FrictionHistory` about sliding, energy and wear.
    """
    begin, times = float(trajectory.time[0]), np.array([trajectory.end])
    if random:
        times = np.linspace(max(SKIPPED * trajectory.end, begin), trajectory.end, BLOCKS + 1)
    sums = _sliding(system, trajectory, contacts, times)
    duration = trajectory.end - begin if trajectory.end > begin else np.inf
    return [
        {
            "sliding_share": float(sums["time"][-1, k]) / duration,
            "sliding_distance": float(sums["distance"][-1, k]),
            "slides": int(sums["slides"][-1, k]),
            "dissipated_energy": float(sums["lost"][-1, k]),
            "dissipated_power": float(sums["lost"][-1, k]) / duration,
            "wear_power": None if isinstance(contact, OfHinge) else float(sums["wear"][-1, k]) / duration,
            "worn_volume": None if contact.wear_rate is None else contact.wear_rate * float(sums["wear"][-1, k]),
            "intervals": _intervals({name: of[:, k] for name, of in sums.items()}, times) if random else (),
        }
        for k, contact in enumerate(contacts)
    ]


def _intervals(sums: Sums, times: Floats) -> tuple[FigureInterval, ...]:
    """Intervals of one contact's figures from the sums until some times; none where it slides too rarely."""
    blocks = {name: np.diff(of) for name, of in sums.items()} | {"duration": np.diff(times)}
    return jackknife(blocks, _FIGURES) if blocks["slides"].sum() >= LEAST else ()


def _rate(name: str) -> Callable[[Sums], Floats]:
    return lambda sums: sums[name] / sums["duration"]


_FIGURES = {
    "slides_per_second": _rate("slides"),
    "sliding_share": _rate("time"),
    "mean_sliding_speed_m_s": _rate("distance"),
    "dissipated_power_w": _rate("lost"),
    "wear_power_w": _rate("wear"),
}
"""Figures that have an interval; what happens where sliding begins belongs to the block in which it does."""


def sliding_speeds(flow: ExactFlow, which: Ints, phases: Ints) -> LinearOutput:
    """Speeds at which friction contacts slide, the contacts being in given phases.

    Parameters
    ----------
    flow : of the system.
    which : (f,) numbers of the friction contacts among all.
    phases : (m,) of all contacts.

    Returns
    -------
    LinearOutput
        (f,) m/s, 0 of those that do not slide.
    """
    contacts, speed = flow.system.contacts, flow.penetrations[1].some(which)
    if contacts.presses(phases):  # the spring of a slider gives way
        own = (which[:, None] == contacts.pressed).astype(float)
        speed += flow.pressing_force_rates(phases).combined(-own * contacts.pressing_stretches(phases))
    return speed.scaled(contacts.slides(phases)[which, None])


def _normal_forces(flow: ExactFlow, contacts: Sequence[FrictionBase], which: Ints, phases: Ints) -> LinearOutput:
    forces = flow.empty_output(which.size)
    forces.direct[:, 0] = [c.constant_force if c.pressed_by is None else 0.0 for c in contacts]
    pressed = flow.system.contacts.pressed
    if pressed.size:
        forces += flow.pressing_forces(phases).combined((which[:, None] == pressed).astype(float))
    return forces


def _sliding(
    system: StructuralSystem, trajectory: Trajectory, contacts: Sequence[FrictionBase], times: Floats
) -> dict[str, Floats]:
    """Sums until some times, (nt, f) each: time of sliding, s, distance, m, wear as normal force times distance, J,
    energy lost, J, and slides."""
    flow, which = trajectory.flow, friction_contacts(system)
    every = trajectory.phases_of(trajectory.state)
    phases = every[:, which]

    def forces(state: Ints) -> LinearOutput:
        one = flow.empty_output(which.size)
        one.direct[:, 0] = 1.0
        lost = contact_losses(flow, state)[0].some(which)
        return LinearOutput.stacked(one, _normal_forces(flow, contacts, which, state), lost)

    def speeds(state: Ints) -> LinearOutput:
        speed = sliding_speeds(flow, which, state)
        return LinearOutput.stacked(speed, speed, contact_losses(flow, state)[1].some(which))

    begin = float(trajectory.time[0])
    integrals = trajectory.product_integrals(times, forces, speeds, np.eye(3 * which.size), begin)
    distance, wear, lost = integrals.reshape(times.size, 3, which.size).swapaxes(0, 1)
    slides = flow.system.contacts.slides(every)[:, which] != 0.0
    begins = slides.copy()
    begins[1:] &= ~slides[:-1]
    normal = trajectory.sample(trajectory.time, lambda state: _normal_forces(flow, contacts, which, state))
    drop = np.array([c.coefficients.static - c.coefficients.sliding for c in contacts])
    spring = np.array([c.stiffness or np.inf for c in contacts])
    snaps = np.zeros_like(normal)
    snaps[1:] = (begins[1:] & (phases[:-1] == STICK)) * normal[1:] * drop / spring
    begun = np.searchsorted(trajectory.time, times, side="right")

    def until(events: Floats) -> Floats:
        return np.asarray(np.vstack([np.zeros(which.size), np.cumsum(events, axis=0)])[begun])

    ends = np.append(trajectory.time, trajectory.end)
    slid = np.vstack([np.zeros(which.size), np.cumsum(slides * trajectory.length[:, None], axis=0)])
    return {
        "time": np.column_stack([np.interp(times, ends, column) for column in slid.T]),
        "distance": distance + until(snaps),
        "wear": wear + until(snaps * normal),
        "lost": lost + until(trajectory.event_losses()[:, which]),
        "slides": until(begins.astype(float)),
    }
