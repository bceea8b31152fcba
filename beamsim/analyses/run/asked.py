"""The figures of a run that are asked for, and nothing else: no histories, spectra or shapes."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np

from beamsim.analyses.gapping import gapping_ratios
from beamsim.analyses.run.exact_motion import VALUES_AT_ONCE, exact_motion_of
from beamsim.analyses.run.impacts import SKIPPED
from beamsim.analyses.run.linear_prediction import gapping_of_sine
from beamsim.analyses.run.motion import RunMotion, samples_until
from beamsim.analyses.run.random_response import LEAST_SAMPLES
from beamsim.analyses.run.summary import by_name, figures_of_motion
from beamsim.analyses.values import BY_ENTRY, STRESS, VALUES, Value, largest
from beamsim.flow.channels import Observed
from beamsim.inputs.measured import highest_excited_hz
from beamsim.outcomes import Outcome, Stop, never
from beamsim.scenario import Scenario
from beamsim.scenario.run import OrbitStart
from beamsim.system.structural import StructuralSystem
from beamsim.typing import not_none

_PLACE = "largest_bending_stress_position_m"


def gives_figures(scenario: Scenario) -> bool:
    """Whether `asked_figures` finds the figures of a run: it is in closed form, unfiltered, and of this model alone."""
    settings = not_none(scenario.run)
    in_closed_form = settings.method != "reference" and all(s.item.kind != "cubic" for s in scenario.nonlinear_springs)
    of_curves = scenario.limits is not None and any(scenario.limits.given_curves())
    plain = settings.low_pass is None and settings.convergence != "on" and not of_curves
    return in_closed_form and plain and not isinstance(settings.start, OrbitStart)


def needs_recovery(asked: Collection[str]) -> bool:
    """Whether one of the entries needs the stress along the bodies, or the outputs of the scenario."""
    return any(value.section in ("bodies", "outputs") for value in _values(asked))


def _values(asked: Collection[str]) -> list[Value]:
    """The values among the entries, with the stress where its place is asked for, and displacements of probes where
    round-off is told by them."""
    found = [value for value in VALUES if value.entry in asked]
    needed = [BY_ENTRY["largest_bending_stress_pa"]] * (_PLACE in asked)
    needed += [BY_ENTRY["peak_displacement_m"]] * any(value.section in ("probes", "outputs") for value in found)
    return found + needed


def asked_figures(
    system: StructuralSystem, asked: Collection[str], stop: Stop = never
) -> tuple[dict[str, Any], Outcome]:
    """Some entries of the summary of a run, and its outcome.

    The energy balance of the motion is checked, whatever is asked for.

    Parameters
    ----------
    system : of a scenario for which `gives_figures`.
    asked : entries of `beamsim.analyses.values.VALUES`; what the system does not have (a stress, snubbers) is left out.
    stop : asked between blocks of events whether to end.

    Returns
    -------
    figures, outcome
        By entry, as in the summary; how the motion ended.

    Raises
    ------
    ScenarioError
        If the input has too many pieces, see `beamsim.analyses.run.exact_motion.motion_in_stretches`.
    """
    settings = not_none(system.scenario.run)
    motion = exact_motion_of(system, settings, np.zeros(0), None, stop, values=_values(asked))
    found = {**figures_of_motion(motion), "energy_error": motion.balance.error}
    if STRESS in motion.extremes and system.stress is not None:
        found[_PLACE] = float(system.stress.stations.position[largest(motion.extremes[STRESS]).argmax()])
    if motion.outcome.complete:
        found |= _root_mean_squares(motion, asked)
    if "gapping_ratio" in asked:
        found["gapping_ratio"] = gapping_ratios(gapping_of_sine(system))
    return {entry: value for entry, value in found.items() if entry in asked}, motion.outcome


def _root_mean_squares(motion: RunMotion, asked: Collection[str]) -> dict[str, Any]:
    """Those of samples without the first part of a run, as `beamsim.analyses.run.random_response` has them.

    Parameters
    ----------
    motion : of the run.
    asked : entries, of which those of a stationary input count.
    """
    keys = {entry: value.key for entry, value in BY_ENTRY.items() if entry.startswith("rms_") and entry in asked}
    scenario = motion.system.scenario
    rate = scenario.sample_rate_up_to(highest_excited_hz(scenario))
    number = samples_until(not_none(scenario.run).duration, rate)
    first = reached = int(SKIPPED * number)
    if not keys or number - first < LEAST_SAMPLES:
        return {}
    observed = Observed(motion.marched.flow, motion.system.channels.of_keys(*keys.values()))
    squares = np.zeros(observed.channels.order.size)
    at_once = max(VALUES_AT_ONCE // max(squares.size, 1), 1)
    for stretch in motion.parts():
        upto = min(samples_until(stretch.end, rate), number)
        for begin in range(reached, upto, at_once):
            times = np.arange(begin, min(begin + at_once, upto)) / rate
            squares += np.sum(observed.values(stretch, times) ** 2, axis=0)
        reached = max(upto, reached)
    roots = observed.channels.split(np.sqrt(squares / (number - first)))
    names = {key: [c.name for c in observed.channels.channels if c.key == key] for key in roots}
    return {entry: by_name(names[key], roots[key]) for entry, key in keys.items() if key in roots}
