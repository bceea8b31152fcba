"""The figures of a run that are asked for, and nothing else: no histories, spectra or shapes."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.analyses.limits import STANDARD_GRAVITY
from beamsim.analyses.run.exact_motion import motion_in_stretches
from beamsim.analyses.run.figures import Extremes, by_name, largest, openings, static_figures
from beamsim.analyses.run.intervals import SKIPPED
from beamsim.analyses.run.motion import with_limit
from beamsim.analyses.run.outputs import (
    OutputSet,
    bending_stress,
    in_every_state,
    output_groups,
)
from beamsim.analyses.run.random_response import LEAST_SAMPLES
from beamsim.analyses.run.stretches import StretchFigures
from beamsim.flow.contact_state import OutputOf
from beamsim.interrupts import Stop, never
from beamsim.outcomes import Outcome
from beamsim.scenario.run import OrbitStart
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.flow.exact import ExactFlow
    from beamsim.flow.trajectory import Trajectory
    from beamsim.scenario import Scenario
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
    scenario: Scenario,
    asked: Collection[str],
    stop: Stop = never,
) -> tuple[dict[str, Any], Outcome]:
    """Some entries of the summary of a run, and its outcome.

    The energy balance of the motion is checked, whatever is asked for.

    Parameters
    ----------
    system : of the scenario.
    scenario : for which `gives_figures`.
    asked : among `ENTRIES`; what the system does not have (a stress, snubbers) is left out.
    stop : asked between blocks of events whether to end; then only what does not need the whole motion is found.
    """
    settings = scenario.run
    assert settings is not None
    motion, _ = motion_in_stretches(system, settings, most_events=settings.max_events, stop=stop)
    groups = output_groups(system, motion.flow)
    searched = _searched(system, motion.flow, groups, {_SEARCHED[entry] for entry in asked if entry in _SEARCHED})
    figures, squares = StretchFigures(searched), MeanSquares(groups, scenario, asked)
    for stretch in motion.stretches():
        figures.add(stretch)
        squares.add(stretch)
    balance = figures.balance.result()
    outcome = balance.checked(with_limit(motion.outcome))
    found: dict[str, Any] = {name: value for name, value in static_figures(system).items() if name in _STATIC}
    found["energy_error"] = balance.error
    snubbers = [s.name for s in system.snubbers]
    shares = motion.contact_share()[: len(snubbers)]
    found["contact_share"] = by_name(snubbers, shares)
    closings = motion.event_contact[motion.event_closing]
    found["contacts"] = dict(zip(snubbers, np.bincount(closings, minlength=len(snubbers)).tolist(), strict=False))
    if outcome.complete:
        found |= _named(system, figures.extremes, shares) | squares.root_mean_squares(system)
    return {entry: value for entry, value in found.items() if entry in asked}, outcome


class MeanSquares:
    """Mean squares of samples without the first part of a run, as `beamsim.analyses.run.random_response` has them.

    Parameters
    ----------
    groups : all outputs.
    scenario : of the run.
    asked : entries, of which those of `ROOT_MEAN_SQUARES` count.
    """

    def __init__(self, groups: OutputSet, scenario: Scenario, asked: Collection[str]) -> None:
        self._names = {entry: name for entry, name in ROOT_MEAN_SQUARES.items() if entry in asked}
        self._groups = OutputSet({name: groups.groups[name] for name in self._names.values()})
        assert scenario.run is not None
        self._rate = scenario.sample_rate
        self._last = int(np.floor(scenario.run.duration * self._rate * (1 + 1e-12))) + 1
        self._first = self._reached = int(SKIPPED * self._last)
        if self._last - self._first < LEAST_SAMPLES:
            self._names = {}
        self._squares: Floats | float = 0.0

    def add(self, stretch: Trajectory) -> None:
        """Include the samples of the next stretch."""
        upto = min(int(stretch.end * (1 + 1e-12) * self._rate) + 1, self._last) if self._names else 0
        for begin in range(self._reached, upto, SAMPLES_A_PART):
            times = np.arange(begin, min(begin + SAMPLES_A_PART, upto)) / self._rate
            self._squares = self._squares + np.sum(stretch.sample(times, self._groups) ** 2, axis=0)
        self._reached = max(upto, self._reached)
        self._start = stretch.flow.system.contacts.start

    def root_mean_squares(self, system: StructuralSystem) -> dict[str, Any]:
        """By entry and name."""
        if not self._names:
            return {}
        root = np.sqrt(self._squares / (self._last - self._first))
        values = self._groups.split(np.atleast_2d(root), self._start)
        owners = {"force": [s.name for s in system.snubbers]}
        probes = [p.name for p in system.probes]
        return {
            entry: dict(zip(owners.get(name, probes), values[name][0].tolist(), strict=False))
            for entry, name in self._names.items()
        }


def _searched(
    system: StructuralSystem, flow: ExactFlow, all_groups: OutputSet, names: Collection[str]
) -> dict[str, OutputOf]:
    """The outputs to be searched, by group; of contacts those of snubbers, and no groups without outputs."""
    groups, searched = all_groups.groups, {}
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


def _named(system: StructuralSystem, extremes: Extremes, shares: Floats) -> dict[str, Any]:
    """By entry of the summary the extremes of probes, snubbers and outputs, by name; snubbers touch (m,) ``shares``."""
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
        figures["largest_gap_m"] = by_name(snubbers, openings(extremes["penetration"][0], shares))
    if "output" in extremes:
        outputs = [output.name for output in system.linear_outputs]
        low, _, high, _ = extremes["output"]
        figures["min_output"], figures["max_output"] = by_name(outputs, low), by_name(outputs, high)
        figures["peak_output"] = by_name(outputs, largest(extremes["output"]))
    if system.stress is not None and "stress" in extremes:
        stress = largest(extremes["stress"])
        where = int(stress.argmax())
        figures["largest_bending_stress_pa"] = float(stress[where])
        figures["largest_bending_stress_position_m"] = float(system.stress.stations.position[where])
    return figures
