"""Lines that curves are compared with: limits of the scenario, faces of stops."""

from __future__ import annotations

from collections.abc import Collection, Iterator

import numpy as np

from beamsim.analyses.run.result import RunResult
from beamsim.plots.drawing import Guide
from beamsim.scenario.limits import Limits
from beamsim.structures.assembly import site_in, snubber_site

_DASHES = {"below": (0, (7, 2.5)), "above": (0, (7, 2.5, 1.5, 2.5))}  # of the face of a stop on this side


def limit_levels(limits: Limits | None, name: str, *, both_signs: bool = False) -> list[Guide]:
    """The limit ``name``, where there is one."""
    limit = None if limits is None else limits.given.get(name)
    if limit is None:
        return []
    style = {"linestyle": ":", "linewidth": 1.6}
    return [Guide("limit", limit, style), *([Guide("", -limit, style)] if both_signs else [])]


def face_levels(result: RunResult, drawn: Collection[str]) -> Iterator[Guide]:
    """Where each stop on the base that is at the place of a drawn probe touches the body."""
    scenario = result.scenario
    places = [site_in(scenario, probe) for probe in scenario.effective_probes if probe.name in drawn]
    for located in scenario.located_snubbers:
        stop = result.snubbers.get(located.item.name)
        if stop is None or snubber_site(located) not in places or located.item.mounted_on != "base":
            continue
        side = "below" if stop.side == "below" else "above"
        if np.isfinite(stop.gap):
            face = (-1.0 if side == "below" else 1.0) * stop.gap
            yield Guide(f"face of {stop.name}", face, {"linewidth": 0.9, "linestyle": _DASHES[side]})
