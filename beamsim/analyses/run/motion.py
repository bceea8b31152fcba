"""The motion of a run at its output times, and what a result holds of it, by place."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from beamsim.analyses.run.energy import EnergyBalance
from beamsim.analyses.run.impacts import friction_contacts
from beamsim.analyses.run.layouts import events_of
from beamsim.analyses.run.observers import AtContact, Histories, largest_contact, samples_until
from beamsim.analyses.run.result import (
    ONLY_BEAM,
    BodyResult,
    ContactInstant,
    Work,
)
from beamsim.flow.exact import ExactFlow
from beamsim.flow.reference import ReferenceTrajectory
from beamsim.flow.trajectory import EVENT_LIMIT, Trajectory
from beamsim.flow.transient import MotionInChunks
from beamsim.inputs.measured import highest_excited_hz
from beamsim.labelled import Dataset
from beamsim.outcomes import Interrupted, Outcome, Stop, check_stop, stopped_by
from beamsim.results.values import (
    FORCE,
    STRESS,
    Extremes,
    extreme_times,
    largest,
    largest_pulls,
)
from beamsim.scenario import Scenario
from beamsim.scenario.run import Run
from beamsim.structures.stations import COMPONENTS
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats, not_none

if TYPE_CHECKING:
    from beamsim.analyses.run.fatigue import PlateStress, StressObserver
    from beamsim.analyses.run.impacts import ImpactObserver

Value = TypeVar("Value")

SMALLEST_PULL = 1e-3  # of the largest contact force, that is worth a warning


@dataclass
class Evaluation:
    """What is derived from a motion, one step after the other; after an interruption the others are left out.

    Parameters
    ----------
    stop : asked before and during every step whether to leave it out.
    """

    stop: Stop
    left_out: list[str] = field(default_factory=list)  # what is missing

    def computed(self, what: str, compute: Callable[[], Value], instead: Value, minor: bool = False) -> Value:
        """The result of a step; ``instead`` if it is left out.

        Parameters
        ----------
        what : is noted as missing.
        compute, instead : the result.
        minor : whether it is noted only where nothing before it is left out.
        """
        with suppress(Interrupted), stopped_by(self.stop):
            if not self.left_out:
                check_stop()
                return compute()
        if not (minor and self.left_out):
            self.left_out.append(what)
        return instead


@dataclass(frozen=True)
class RunMotion:
    """The motion of a run, from the closed form or from time stepping."""

    system: StructuralSystem
    method: str
    marched: MotionInChunks | ReferenceTrajectory
    outcome: Outcome
    balance: EnergyBalance
    extremes: Extremes
    extreme_states: Floats  # (2, 2n) at `extreme_times`
    contact_share: Floats
    histories: Histories | None = None  # at the output times
    at_contact: AtContact | None = None  # at the largest contact force
    states: Floats | None = None  # (nt, 2n or more) at the times that were asked for; of a time-stepped motion none
    low_passed: Floats | None = None  # (nt or more, probes) acceleration behind the filter, where there is one
    trajectory: Trajectory | None = None  # of the closed form, its last part where not all is kept
    impacts: ImpactObserver | None = None
    stresses: StressObserver | None = None
    plates: PlateStress | None = None
    memory: Mapping[str, int] = field(default_factory=dict)  # entries of the summary
    compared_s: float | None = None  # s, first part that is compared with a finer model, where not all is kept
    warnings: tuple[str, ...] = ()

    @property
    def known(self) -> Trajectory | Histories:
        """That of the closed form, or from time stepping at the output times."""
        return self.trajectory or not_none(self.histories)

    def von_mises(self) -> dict[str, Floats]:
        """(nx,) Pa, largest of the samples, by plate; none of a time-stepped motion."""
        return {} if self.plates is None else self.plates.result()

    @cached_property
    def work(self) -> Work:
        """Of the solver."""
        of = self.marched
        return Work(of.event_time.size, of.evaluations, of.segments, of.states, of.processor_time_s)

    @cached_property
    def events(self) -> Dataset:
        """Contacts of the snubbers made and ended, without breakpoints of their tables; contacts with higher numbers
        are piecewise-linear springs."""
        of, count = self.marched, len(self.system.snubbers)
        of_snubber = (of.event_contact < count) & (of.touch_changes != 0)
        return events_of(of.event_time[of_snubber], of.event_contact[of_snubber], of.event_closing[of_snubber])

    @property
    def breakpoints(self) -> int:
        """Number of breakpoints of piecewise-linear springs that are passed, the start left out."""
        rubbing = np.isin(self.marched.event_contact, friction_contacts(self.system))
        of_spring = (self.marched.event_contact >= len(self.system.snubbers)) & ~rubbing
        return int(np.sum(of_spring & (self.marched.event_time > 0)))

    @property
    def extreme_times(self) -> Floats:
        """See `beamsim.results.values.extreme_times`."""
        return extreme_times(self.extremes)


def output_times(scenario: Scenario) -> Floats:
    """(nt,) s, the times at which the motion of a run is asked for."""
    rate = scenario.sample_rate_up_to(highest_excited_hz(scenario))
    return np.asarray(np.arange(samples_until(not_none(scenario.run).duration, rate)) / rate)


def memory_of(flow: ExactFlow, settings: Run) -> dict[str, int]:
    """Bounds on the memory of a run, for the summary."""
    kept = {"contact_states_kept": len(flow.states)} if flow.dropped else {}
    return {"memory_bytes": round(settings.memory), **kept}


def pull_warnings(motion: RunMotion) -> list[str]:
    """A warning for each snubber whose dashpot pulls before the contact opens.

    Parameters
    ----------
    motion : of the run.

    Returns
    -------
    One sentence a snubber.
    """
    if not motion.system.snubbers:
        return []
    forces = motion.extremes[FORCE]
    pulls = largest_pulls(forces)
    return [
        f"{s.label}: its dashpot pulls with up to {pulls[j]:.3g} {s.item.units[1]} before the contact opens"
        + ("; law: no_tension opens it before" if not s.item.yields else "")
        for j, s in enumerate(motion.system.scenario.located_snubbers)
        if pulls[j] > SMALLEST_PULL * forces[2][j] and not s.item.latch
    ]


def with_limit(outcome: Outcome, limit: str = "run.max_events") -> Outcome:
    """The outcome, with the key of the scenario that limits the events."""
    if outcome.code != EVENT_LIMIT:
        return outcome
    return outcome.but(remedy=f"raise {limit}, or check for a chattering contact")


def contact_instant(motion: RunMotion) -> ContactInstant | None:
    """The motion when a contact force is largest, for the sketch of several bodies; None without contact."""
    system, at, contact = motion.system, motion.at_contact, largest_contact(motion.system, motion.extremes)
    if contact is None or at is None:
        return None
    time, places = np.array([contact.time]), [place for body in system.bodies for place in body.places]
    supports = system.with_supports(places, time)[0]
    instant = ContactInstant(
        contact.time, system.snubbers[contact.snubber].name, contact.force, at.state[: system.dynamics.size]
    )  # fmt: skip
    opening = at.opening[: len(system.snubbers)]
    return replace(instant, supports=supports if supports.any() else None, opening=opening)


def bodies_of_run(motion: RunMotion, evaluation: Evaluation) -> dict[str, Any]:
    """Results along each body that has a continuous axis, as fields of the result.

    Parameters
    ----------
    motion : of the run.
    evaluation : what is computed from the motion.

    Returns
    -------
    By field of `RunResult`: the only body, or those that have names.
    """
    system = motion.system
    stress = {} if system.stress is None else {part.body: part.stations for part in system.stress.stations}

    def peaks(of_body: slice, moments: int) -> Floats:
        return np.asarray(largest(motion.extremes[STRESS])[of_body].reshape(moments, -1).max(axis=0))

    equilibrium, von_mises = system.static_equilibrium, dict[str, Floats]()
    if any(body.moments == len(COMPONENTS) for body in system.bodies):
        von_mises = evaluation.computed("the von Mises stress of plates", motion.von_mises, von_mises)
    bodies = {
        body.body: BodyResult(
            position=body.position,
            across=body.across,
            peak_bending_stress=peaks(stress[body.body], body.moments) if body.body in stress else None,
            peak_von_mises_stress=von_mises.get(body.body),
            extreme_shapes=motion.extreme_states[:, : system.dynamics.size] @ body.deflection.T
            + system.with_supports(body.places, motion.extreme_times),
            extreme_times=motion.extreme_times,
            static_shape=np.full(body.position.size, np.nan) if equilibrium is None else body.deflection @ equilibrium,
        )
        for body in system.bodies
        if body.axis.continuous
    }
    if len(system.scenario.all_bodies) == 1 and set(bodies) <= {ONLY_BEAM}:
        return {"only_body": bodies.get(ONLY_BEAM)}
    return {"only_body": None, "named_bodies": bodies}
