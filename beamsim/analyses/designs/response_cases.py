"""A continuation as one case of a design study: the largest stable motions of every level."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.analyses.response.analysis import frequency_response
from beamsim.outcomes import Outcome

if TYPE_CHECKING:
    from beamsim.analyses.response.result import FrequencyResponse
    from beamsim.scenario import Scenario

SHORT = 0.01  # share of the range that is followed in a rehearsal


def response_responses(result: FrequencyResponse) -> dict[str, float | list[float]]:
    """Of the stable motions of every level, ``stable_<index>/…``, the largest values and where they are.

    All periods count. Where no motion is stable the value is not a number.
    """
    values: dict[str, float | list[float]] = {}
    for index, level in enumerate(dict.fromkeys(repr(b.level) for b in result.branches)):
        own = [b for b in result.branches if repr(b.level) == level]
        stable = np.concatenate([b.stable for b in own])
        parameter = np.concatenate([b.parameter for b in own])
        sources: list[tuple[str, dict[str, Any]]] = [
            (f"probes/{name}/{quantity}", {"of": quantity, "name": name})
            for quantity in ("peak_displacement", "peak_acceleration")
            for name in own[0].peak_displacement
        ]
        sources += [(f"snubbers/{name}/peak_force", {"of": "peak_force", "name": name}) for name in own[0].peak_force]
        sources += [
            (f"snubbers/{name.partition(' ')[2]}/largest_gap" if " " in name else name, {"of": "limited", "name": name})
            for name in own[0].limited
        ]
        for place, source in sources:
            of = np.concatenate([getattr(b, source["of"])[source["name"]] for b in own])
            best = int(np.argmax(np.where(stable, of, -np.inf)))
            known = bool(stable.any())
            values[f"stable_{index}/{place}"] = float(of[best]) if known else float("nan")
            if source["of"] == "peak_displacement" and result.parameter == "frequency":
                at = f"stable_{index}/probes/{source['name']}/resonance_frequency"
                values[at] = float(parameter[best]) if known else float("nan")
    return values


def solve_response(scenario: Scenario) -> tuple[dict[str, float | list[float]], Outcome]:
    """Responses and outcome of one case."""
    from beamsim.analyses.designs.cases import frequency_responses

    result = frequency_response(scenario)
    modes = result.modes
    linear = frequency_responses(
        modes.open_frequencies_hz.tolist(), modes.closed_frequencies_hz.tolist(), bool(scenario.all_snubbers)
    )
    return response_responses(result) | linear, result.outcome


def rehearse_response(scenario: Scenario) -> object:
    """A short stretch of a case, which compiles what a whole one needs."""
    settings: Any = scenario.sweep
    path = settings.parameter
    short = path.from_ + SHORT * (path.to - path.from_)
    change: dict[str, object] = {"levels": settings.levels[:1], "overlay": None, "follow_folds_in": None}
    if settings.continue_in is None:
        change["to"] = short
    else:
        change["continue_in"] = path.model_copy(update={"to": short})
    return frequency_response(scenario.model_copy(update={"sweep": settings.model_copy(update=change)}))
