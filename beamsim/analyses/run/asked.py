"""The figures of a run that are asked for, and nothing else: no histories, spectra or shapes."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.analyses.limits import STANDARD_GRAVITY
from beamsim.analyses.run.energy import energy_of_segments
from beamsim.analyses.run.figures import Extremes, by_name, largest, openings, searched_extremes, static_figures
from beamsim.analyses.run.intervals import SKIPPED
from beamsim.analyses.run.outputs import (
    bending_stress,
    exact_flow,
    in_every_state,
    output_groups,
)
from beamsim.analyses.run.random_response import LEAST_SAMPLES
from beamsim.errors import NotTrustedError
from beamsim.flow.contact_state import OutputOf
from beamsim.flow.stopping import Stopped, check_stop, heeding, never
from beamsim.flow.transient import simulate
from beamsim.outcomes import Outcome, OutcomeCode
from beamsim.scenario.run import OrbitStart

if TYPE_CHECKING:
    from beamsim.flow.exact import ExactFlow
    from beamsim.flow.trajectory import Trajectory
    from beamsim.scenario import Run, Scenario
    from beamsim.system.shared import SharedBuilds
    from beamsim.system.structural import StructuralSystem

SAMPLES_A_PART = 100_000  # of those whose squares are added up

_SEARCHED = {
    "peak_displacement_m": "displacement",
    "min_displacement_m": "displacement",
    "max_displacement_m": "displacement",
    "peak_acceleration_g": "acceleration",
    "peak_force_n": "force",
    "largest_gap_m": "penetration",
    "peak_output": "output",
    "min_output": "output",
    "max_output": "output",
    "largest_bending_stress_pa": "stress",
    "largest_bending_stress_position_m": "stress",
}
"""Entries of a run's summary that are extremes: of which outputs."""
ROOT_MEAN_SQUARES = {
    "rms_displacement": "displacement",
    "rms_absolute_acceleration": "acceleration",
    "rms_force": "force",
}
"""By entry the output whose root mean square it is, of a random or sampled input."""
_STATIC = ("static_force_n", "open_frequencies_hz", "closed_frequencies_hz")
ENTRIES = (*_SEARCHED, "contact_share", "contacts", *_STATIC, "energy_error", *ROOT_MEAN_SQUARES)
"""Entries that can be asked for: of a run's summary, and those of `root_mean_squares`."""


def gives_figures(scenario: Scenario) -> bool:
    """Whether `asked_figures` finds the figures of a run: it is in closed form, unfiltered, and of this model alone."""
    settings = scenario.run
    assert settings is not None
    in_closed_form = settings.method != "reference" and all(s.item.kind != "cubic" for s in scenario.nonlinear_springs)
    plain = settings.low_pass is None and settings.convergence != "on"
    plain = plain and not any(output.kind.endswith("energy") for _, output in scenario.requested_outputs)
    return in_closed_form and plain and not isinstance(settings.start, OrbitStart)


def needs_recovery(asked: Collection[str]) -> bool:
    """Whether one of the entries needs the stress along the bodies, or the outputs of the scenario."""
    return any(_SEARCHED[entry] in ("stress", "output") for entry in asked if entry in _SEARCHED)


def asked_figures(
    system: StructuralSystem,
    settings: Run,
    asked: Collection[str],
    shared: SharedBuilds | None = None,
    stop: Callable[[], bool] = never,
) -> tuple[dict[str, Any], Outcome]:
    """Some entries of the summary of a run, and its outcome.

    The energy balance of the motion is checked, whatever is asked for.

    Parameters
    ----------
    system : of a scenario for which `gives_figures`.
    asked : among `ENTRIES`; what the system does not have (a stress, snubbers) is left out.
    shared : keeps what the motions of several systems have in common.
    stop : asked several times a second whether to give up.

    Raises
    ------
    NotTrustedError
        Once ``stop`` says so.
    """
    flow = exact_flow(system, settings.duration, settings.most_contact_states, shared, settings.memory)
    trajectory = simulate(flow, system.initial_state, max_events=settings.max_events, stop=stop)
    try:
        with heeding(stop):
            return _evaluated(system, settings, trajectory, asked)
    except Stopped:
        raise NotTrustedError("interrupted") from None


def _evaluated(
    system: StructuralSystem, settings: Run, trajectory: Trajectory, asked: Collection[str]
) -> tuple[dict[str, Any], Outcome]:
    check_stop()
    balance = energy_of_segments(trajectory)
    outcome = balance.checked(trajectory.outcome)
    if outcome.code is OutcomeCode.EVENT_LIMIT:
        outcome = outcome.but(limit="run.max_events")
    of_model = [name for name in _STATIC if name in asked]
    static = static_figures(system) if of_model else {}
    figures: dict[str, Any] = {name: static[name] for name in of_model}
    if "energy_error" in asked:
        figures["energy_error"] = balance.error
    snubbers = [s.name for s in system.snubbers]
    if "contact_share" in asked:
        figures["contact_share"] = by_name(snubbers, trajectory.contact_share()[: len(snubbers)])
    if "contacts" in asked:
        closings = trajectory.event_contact[trajectory.event_closing]
        figures["contacts"] = dict(zip(snubbers, np.bincount(closings, minlength=len(snubbers)).tolist(), strict=False))
    if outcome.complete:
        figures |= _extremes(system, trajectory, asked)
        if openings_of := figures.get("largest_gap_m"):
            lowest = -np.array(list(openings_of.values()))
            shares = trajectory.contact_share()[: len(snubbers)]
            figures["largest_gap_m"] = by_name(snubbers, openings(lowest, shares))
        figures |= _root_mean_squares(system, settings, trajectory, asked)
    return figures, outcome


def _root_mean_squares(
    system: StructuralSystem, settings: Run, trajectory: Trajectory, asked: Collection[str]
) -> dict[str, Any]:
    """Those of the samples, without the first part of the run, as `beamsim.analyses.run.random_response` has them."""
    names = [entry for entry in ROOT_MEAN_SQUARES if entry in asked]
    count = int(np.floor(settings.duration * settings.output_rate * (1 + 1e-12))) + 1
    first = int(SKIPPED * count)
    if not names or count - first < LEAST_SAMPLES:
        return {}
    groups = output_groups(system, trajectory.flow)
    table = trajectory.flow.output_table(groups)
    squares = 0.0
    for begin in range(first, count, SAMPLES_A_PART):
        times = np.arange(begin, min(begin + SAMPLES_A_PART, count)) / settings.output_rate
        squares = squares + np.sum(trajectory.sample_table(times, table) ** 2, axis=0)
    root = np.sqrt(squares / (count - first))[None, :]
    values = groups.split(root, trajectory.flow.system.contacts.start)
    owners = {"force": [s.name for s in system.snubbers]}
    probes = [p.name for p in system.probes]
    return {
        entry: dict(zip(owners.get(name, probes), values[name][0].tolist(), strict=False))
        for entry, name in ROOT_MEAN_SQUARES.items()
        if entry in names
    }


def _extremes(system: StructuralSystem, trajectory: Trajectory, asked: Collection[str]) -> dict[str, Any]:
    """The entries that are extremes, from one search for all of them."""
    searched = _searched(system, trajectory.flow, {_SEARCHED[entry] for entry in asked if entry in _SEARCHED})
    if not searched:
        return {}
    extremes = searched_extremes(trajectory, searched)
    figures = _named(system, extremes)
    if system.stress is not None and "stress" in extremes:
        stress = largest(extremes["stress"])
        where = int(stress.argmax())
        figures["largest_bending_stress_pa"] = float(stress[where])
        figures["largest_bending_stress_position_m"] = float(system.stress.stations.position[where])
    return {entry: value for entry, value in figures.items() if entry in asked}


def _searched(system: StructuralSystem, flow: ExactFlow, names: Collection[str]) -> dict[str, OutputOf]:
    """The outputs to be searched, by group; of contacts those of snubbers, and no groups without outputs."""
    groups = output_groups(system, flow).groups
    searched = {}
    for name in sorted(names):
        if name == "stress":
            if system.stress is not None:
                searched[name] = in_every_state(bending_stress(flow, system.stress))
        elif name in ("force", "penetration"):
            if system.snubbers:
                searched[name] = _first(groups[name], len(system.snubbers))
        elif system.linear_outputs if name == "output" else system.probes:
            searched[name] = groups[name]
    return searched


def _first(output_of: OutputOf, count: int) -> OutputOf:
    return lambda phases: output_of(phases).some(slice(count))


def _named(system: StructuralSystem, extremes: Extremes) -> dict[str, Any]:
    """By entry of the summary the extremes of probes, snubbers and outputs, by name."""
    probes, snubbers = [p.name for p in system.probes], [s.name for s in system.snubbers]
    figures: dict[str, Any] = {}
    if "displacement" in extremes:
        low, _, high, _ = extremes["displacement"]
        figures["min_displacement_m"], figures["max_displacement_m"] = by_name(probes, low), by_name(probes, high)
        figures["peak_displacement_m"] = by_name(probes, largest(extremes["displacement"]))
    if "acceleration" in extremes:
        figures["peak_acceleration_g"] = by_name(probes, largest(extremes["acceleration"]) / STANDARD_GRAVITY)
    if "force" in extremes:
        figures["peak_force_n"] = by_name(snubbers, extremes["force"][2])
    if "penetration" in extremes:
        figures["largest_gap_m"] = by_name(snubbers, np.maximum(-extremes["penetration"][0], 0.0))
    if "output" in extremes:
        outputs = [output.name for output in system.linear_outputs]
        low, _, high, _ = extremes["output"]
        figures["min_output"], figures["max_output"] = by_name(outputs, low), by_name(outputs, high)
        figures["peak_output"] = by_name(outputs, largest(extremes["output"]))
    return figures
