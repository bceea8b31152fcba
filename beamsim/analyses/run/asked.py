"""The figures of a run that are asked for, and nothing else: no histories, spectra or shapes."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from beamsim.analyses.limits import STANDARD_GRAVITY
from beamsim.analyses.run.energy import energy_of_segments
from beamsim.analyses.run.figures import SEEDS, by_name, openings, static_figures
from beamsim.analyses.run.intervals import SKIPPED
from beamsim.analyses.run.outputs import (
    bending_stress,
    exact_flow,
    in_every_state,
    output_groups,
    stack,
)
from beamsim.analyses.run.random_response import LEAST_SAMPLES
from beamsim.errors import NotTrustedError
from beamsim.flow.contact_state import OutputOf
from beamsim.flow.stopping import Stopped, check_stop, heeding, never
from beamsim.flow.transient import simulate
from beamsim.outcomes import Outcome, OutcomeCode
from beamsim.scenario.run import OrbitStart
from beamsim.typing import Floats, Ints

if TYPE_CHECKING:
    from beamsim.flow.contact_state import LinearOutput
    from beamsim.flow.trajectory import Trajectory
    from beamsim.scenario import Run, Scenario
    from beamsim.system.shared import SharedBuilds
    from beamsim.system.structural import StructuralSystem

SAMPLES_A_PART = 100_000  # of those whose squares are added up

_SEARCHED = {
    "peak_displacement_m": ("displacement", "largest"),
    "min_displacement_m": ("displacement", "lowest"),
    "max_displacement_m": ("displacement", "highest"),
    "peak_acceleration_g": ("acceleration", "largest"),
    "peak_force_n": ("force", "highest"),
    "largest_gap_m": ("penetration", "lowest"),
    "peak_output": ("output", "largest"),
    "min_output": ("output", "lowest"),
    "max_output": ("output", "highest"),
    "largest_bending_stress_pa": ("stress", "largest"),
    "largest_bending_stress_position_m": ("stress", "largest"),
}
"""Entries of a run's summary that are extremes: of which outputs, and which (``largest``: of either sign)."""
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
    return any(_SEARCHED[entry][0] in ("stress", "output") for entry in asked if entry in _SEARCHED)


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


class _Search(NamedTuple):
    """Outputs of which the largest values are searched for."""

    output_of: OutputOf
    group: Ints  # (k,) of each output; where only the largest value of a group is asked for, its outputs share one


def _extremes(system: StructuralSystem, trajectory: Trajectory, asked: Collection[str]) -> dict[str, Any]:
    """The entries that are extremes, from one search for all of them."""
    searches = _searches(system, trajectory, asked)
    if not searches:
        return {}

    def every_output(phases: Ints) -> LinearOutput:
        return stack(*(search.output_of(phases) for search in searches.values()))

    sizes = [search.group.size for search in searches.values()]
    offsets = np.cumsum([0, *(int(search.group.max(initial=-1)) + 1 for search in searches.values())])
    group = np.concatenate([search.group + first for search, first in zip(searches.values(), offsets, strict=False)])
    if trajectory.bounded and group.size == offsets[-1]:
        unknown = np.full(group.size, -np.inf)
        highest, _, _ = trajectory.maxima(every_output, unknown, np.zeros(group.size))
    else:
        times = np.linspace(0.0, trajectory.end, SEEDS)
        values = trajectory.sample(times, every_output)
        sampled = values.max(axis=0)
        largest = np.full(int(offsets[-1]), -np.inf)
        np.maximum.at(largest, group, sampled)
        highest, _, _ = trajectory.maxima(every_output, largest[group], times[values.argmax(axis=0)])
        highest = np.where(highest > largest[group], highest, sampled)
    parts = np.split(highest, np.cumsum(sizes)[:-1])
    return _named(system, asked, dict(zip(searches, parts, strict=True)))


def _searches(system: StructuralSystem, trajectory: Trajectory, asked: Collection[str]) -> dict[str, _Search]:
    """The searches by what they find: ``lowest`` is that of the negative, ``largest`` that of both signs."""
    flow = trajectory.flow
    groups = output_groups(system, flow).groups
    ends = {"min_displacement_m", "max_displacement_m"} <= set(asked)
    snubbers = len(system.snubbers)
    searches: dict[str, _Search] = {}
    for entry, (name, which) in _SEARCHED.items():
        if entry not in asked or (ends and entry == "peak_displacement_m"):
            continue
        if name == "stress":
            if system.stress is None:
                continue
            output_of = in_every_state(bending_stress(flow, system.stress))
            group = np.zeros(system.stress.row.shape[0], dtype=np.int64)
        elif name == "output":
            if not system.linear_outputs:
                continue
            output_of, group = groups[name], np.arange(len(system.linear_outputs))
        elif name in ("force", "penetration"):
            output_of, group = _first(groups[name], snubbers), np.arange(snubbers)
        else:
            output_of, group = groups[name], np.arange(len(system.probes))
        if not group.size:
            continue
        signed = {"highest": output_of, "lowest": _negative(output_of), "largest": _both(output_of)}[which]
        searches[f"{which} {name}"] = _Search(signed, np.tile(group, 2) if which == "largest" else group)
    return searches


def _first(output_of: OutputOf, count: int) -> OutputOf:
    return lambda phases: output_of(phases).some(slice(count))


def _negative(output_of: OutputOf) -> OutputOf:
    return lambda phases: -output_of(phases)


def _both(output_of: OutputOf) -> OutputOf:
    def both(phases: Ints) -> LinearOutput:
        output = output_of(phases)
        return stack(output, -output)

    return both


def _named(system: StructuralSystem, asked: Collection[str], extremes: Mapping[str, Floats]) -> dict[str, Any]:
    """The entries of the summary from what the searches found."""
    probes, snubbers = [p.name for p in system.probes], [s.name for s in system.snubbers]
    signed = {key: x.reshape(2, -1).max(axis=0) for key, x in extremes.items() if key.startswith("largest")}
    figures: dict[str, Any] = {}
    low, high = extremes.get("lowest displacement"), extremes.get("highest displacement")
    if low is not None:
        figures["min_displacement_m"] = by_name(probes, -low)
    if high is not None:
        figures["max_displacement_m"] = by_name(probes, high)
    if "peak_displacement_m" in asked:
        if low is not None and high is not None:
            figures["peak_displacement_m"] = by_name(probes, np.maximum(np.abs(low), np.abs(high)))
        else:
            figures["peak_displacement_m"] = by_name(probes, signed["largest displacement"])
    if "largest acceleration" in signed:
        figures["peak_acceleration_g"] = by_name(probes, signed["largest acceleration"] / STANDARD_GRAVITY)
    if "highest force" in extremes:
        figures["peak_force_n"] = by_name(snubbers, extremes["highest force"])
    if "lowest penetration" in extremes:
        figures["largest_gap_m"] = by_name(snubbers, np.maximum(extremes["lowest penetration"], 0.0))
    outputs = [output.name for output in system.linear_outputs]
    if "largest output" in signed:
        figures["peak_output"] = by_name(outputs, signed["largest output"])
    if "lowest output" in extremes:
        figures["min_output"] = by_name(outputs, -extremes["lowest output"])
    if "highest output" in extremes:
        figures["max_output"] = by_name(outputs, extremes["highest output"])
    if "largest stress" in signed and system.stress is not None:
        where = int(signed["largest stress"].argmax())
        figures["largest_bending_stress_pa"] = float(signed["largest stress"][where])
        figures["largest_bending_stress_position_m"] = float(system.stress.stations.position[where])
    return figures
