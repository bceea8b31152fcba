"""Lines that curves are compared with: limits of the scenario, faces of stops."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.structures.assembly import snubber_site
from beamsim.structures.places import site_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from beamsim.analyses.run.result import RunResult
    from beamsim.plots.style import Scale
    from beamsim.scenario.limits import Limits

FARTHEST = 4.0  # of the largest value drawn: a line beyond that would leave no room for the curves
_LIMIT: dict[str, Any] = {"color": "0.35", "linestyle": ":", "linewidth": 1.6}
_FACE: dict[str, Any] = {"color": "0.35", "linewidth": 0.9}
_DASHES = {"below": (0, (7, 2.5)), "above": (0, (7, 2.5, 1.5, 2.5))}  # of the face of a stop on this side


def draw_limit(ax: Axes, limits: Limits | None, name: str, scale: Scale, *, both_signs: bool = False) -> None:
    """A line at the limit ``name``, where there is one that is not far above the curves drawn before."""
    limit = None if limits is None else limits.given.get(name)
    if limit is None or limit * scale.factor > FARTHEST * _largest(ax):
        return
    for sign in (1.0, -1.0) if both_signs else (1.0,):
        ax.axhline(sign * limit * scale.factor, **_LIMIT, label="limit" if sign > 0.0 else None)


def draw_faces(result: RunResult, ax: Axes, scale: Scale) -> None:
    """A line where each stop on the base that is at the place of a drawn probe touches the body."""
    scenario, drawn = result.scenario, {line.get_label() for line in ax.lines}
    body = next(iter(scenario.all_bodies), "")
    places = [site_of(probe, body) for probe in scenario.effective_probes if probe.name in drawn]
    largest = _largest(ax)
    for located in scenario.located_snubbers:
        stop = result.snubbers.get(located.item.name)
        if stop is None or snubber_site(located) not in places or located.item.mounted_on != "base":
            continue
        side = "below" if stop.side == "below" else "above"
        face = (-1.0 if side == "below" else 1.0) * stop.gap * scale.factor
        if np.isfinite(face) and abs(face) <= FARTHEST * largest:
            ax.axhline(face, **_FACE, linestyle=_DASHES[side], label=f"face of {stop.name}")


def _largest(ax: Axes) -> float:
    """Largest finite magnitude of the curves."""
    values = [np.asarray(line.get_ydata(), dtype=float) for line in ax.lines]
    return max((float(np.max(np.abs(y), initial=0.0, where=np.isfinite(y))) for y in values), default=0.0)
