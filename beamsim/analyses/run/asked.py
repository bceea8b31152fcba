"""The figures of a run that are asked for, and nothing else: no histories, spectra or shapes."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np

from beamsim.analyses.run.exact_motion import StretchFigures, motion_in_stretches
from beamsim.analyses.run.impacts import SKIPPED
from beamsim.analyses.run.motion import with_limit
from beamsim.analyses.run.random_response import LEAST_SAMPLES
from beamsim.analyses.run.summary import by_name, motion_figures, static_figures
from beamsim.analyses.values import BY_ENTRY, STRESS, VALUES, Value, largest, searched
from beamsim.flow.channels import Observed
from beamsim.flow.exact import ExactFlow
from beamsim.flow.trajectory import Trajectory
from beamsim.outcomes import Outcome, Stop, never
from beamsim.scenario import Scenario
from beamsim.scenario.run import OrbitStart
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats

SAMPLES_A_PART = 100_000  # of those whose squares are added up

ROOT_MEAN_SQUARES = {entry: value.key for entry, value in BY_ENTRY.items() if entry.startswith("rms_")}
"""By entry the channels whose root mean square it is, of a random or sampled input."""
_PLACE = "largest_bending_stress_position_m"


def gives_figures(scenario: Scenario) -> bool:
    """Whether `asked_figures` finds the figures of a run: it is in closed form, unfiltered, and of this model alone."""
    settings = scenario.run
    assert settings is not None
    in_closed_form = settings.method != "reference" and all(s.item.kind != "cubic" for s in scenario.nonlinear_springs)
    plain = settings.low_pass is None and settings.convergence != "on"
    return in_closed_form and plain and not isinstance(settings.start, OrbitStart)


def needs_recovery(asked: Collection[str]) -> bool:
    """Whether one of the entries needs the stress along the bodies, or the outputs of the scenario."""
    return any(value.section in ("bodies", "outputs") for value in _values(asked))


def _values(asked: Collection[str]) -> list[Value]:
    """The values among the entries, with the stress where its place is asked for."""
    needed = {*asked, "largest_bending_stress_pa"} if _PLACE in asked else asked
    return [value for value in VALUES if value.entry in needed]


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
    asked : entries of `beamsim.analyses.values.VALUES`; what the system does not have (a stress, snubbers) is left out.
    stop : asked between blocks of events whether to end; then only what does not need the whole motion is found.

    Returns
    -------
    figures, outcome
        By entry, as in the summary; how the motion ended.

    Raises
    ------
    ScenarioError
        If the input has too many pieces, see `beamsim.analyses.run.exact_motion.motion_in_stretches`.
    """
    settings = scenario.run
    assert settings is not None
    motion, _ = motion_in_stretches(system, settings, most_events=settings.max_events, stop=stop)
    figures = StretchFigures(Observed(motion.flow, searched(system.channels, _values(asked))))
    squares = MeanSquares(system, motion.flow, scenario, asked)
    for stretch in motion.stretches():
        figures.add(stretch)
        squares.add(stretch)
    outcome = figures.balance.checked(with_limit(motion.outcome))
    found = {**static_figures(system), "energy_error": figures.balance.error}
    closings = np.bincount(motion.event_contact[motion.event_closing], minlength=motion.flow.system.contacts.count)
    extremes = figures.extremes if outcome.complete else {}
    found |= motion_figures(system, extremes, motion.contact_share(), closings)
    if STRESS in extremes and system.stress is not None:
        found[_PLACE] = float(system.stress.stations.position[largest(extremes[STRESS]).argmax()])
    if outcome.complete:
        found |= squares.root_mean_squares()
    return {entry: value for entry, value in found.items() if entry in asked}, outcome


class MeanSquares:
    """Mean squares of samples without the first part of a run, as `beamsim.analyses.run.random_response` has them.

    Parameters
    ----------
    system, flow : of the motion.
    scenario : of the run.
    asked : entries, of which those of `ROOT_MEAN_SQUARES` count.
    """

    def __init__(self, system: StructuralSystem, flow: ExactFlow, scenario: Scenario, asked: Collection[str]) -> None:
        self._names = {entry: key for entry, key in ROOT_MEAN_SQUARES.items() if entry in asked}
        self._observed = Observed(flow, system.channels.of_keys(*self._names.values()))
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
            self._squares = self._squares + np.sum(self._observed.values(stretch, times) ** 2, axis=0)
        self._reached = max(upto, self._reached)

    def root_mean_squares(self) -> dict[str, Any]:
        """By entry and name."""
        if not self._names:
            return {}
        channels = self._observed.channels
        roots = channels.split(np.sqrt(self._squares / (self._last - self._first)))
        names = {key: [c.name for c in channels.channels if c.key == key] for key in roots}
        return {entry: by_name(names[key], roots[key]) for entry, key in self._names.items() if key in roots}
