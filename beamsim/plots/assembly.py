"""Sketches of several bodies seen from the side: deflected shapes with supports, masses, joints and stops in place."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from beamsim.plots.style import scale_for
from beamsim.scenario.joint import origins
from beamsim.structures.assembly import site_in, snubber_site
from beamsim.structures.places import Link, Place, Site

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from beamsim.analyses.run.result import RunResult
    from beamsim.structures.stations import StationPart
    from beamsim.typing import Floats, Ints

MOST_MODES = 6
_HEIGHT = 0.36  # of the largest deflection or gap, over the distance of rows
_REFINED = 4  # points between stations, by a cubic spline through them
_BODY, _REST, _STOP = "#0b3c5d", "0.75", "#d1495b"
_SHUT = "stop in contact"
_MARKERS = {"clamped": "s", "pinned": "^", "guided": "D", "springs": "v", "mass": "o"}
_JOINTS = {"rigid": ("s", _BODY), "hinge": ("o", "white"), "spring": ("d", "white")}


@dataclass(frozen=True)
class _Line:
    """One line of a body: a beam, a row of masses or nodes, or an edge of a plate."""

    x: Floats  # m in the sketch
    stations: Ints  # their numbers
    row: int  # counted upwards
    continuous: bool
    first: float  # in the coordinate of the body
    scale: float  # m of the sketch for one of that coordinate
    origin: float

    def at(self, coordinate: float, heights: Floats) -> tuple[float, float]:
        """Where a point of the body is drawn; ``heights`` (nx,) are those of its stations."""
        x = self.origin + (coordinate - self.first) * self.scale
        return x, self.row + float(np.interp(x, self.x, heights[self.stations]))


class Sketch:
    """The bodies of a run side by side where joints connect them, else one above the other."""

    def __init__(self, result: RunResult) -> None:
        self.result = result
        scenario, stations = result.scenario, result.modes.stations
        origin, group = origins(scenario.joints, scenario.default_body)
        names = [part.body for part in stations]
        rows = list(dict.fromkeys(group.get(name, name) for name in names))
        lengths = [float(np.ptp(stations.position[p.stations])) for p in stations if p.axis.continuous]
        self.span = max(lengths, default=1.0) or 1.0
        self.count = len(rows)
        self.lines: dict[str, list[_Line]] = {}
        for part in stations:
            row = rows.index(group.get(part.body, part.body))
            self.lines[part.body] = self._lines(part, row, origin.get(part.body, 0.0))

    def _lines(self, part: StationPart, row: int, origin: float) -> list[_Line]:
        stations = self.result.modes.stations
        position, numbers = stations.position[part.stations], np.arange(part.stations.start, part.stations.stop)
        continuous = part.axis.continuous
        first = 0.0 if continuous else float(position.min())
        scale = 1.0 if continuous else self.span / (float(np.ptp(position)) or 1.0)
        across = None if stations.across is None else stations.across[part.stations]
        edges = [np.ones(position.size, dtype=bool)]
        if across is not None and np.all(np.isfinite(across)):
            edges = [across == across.min(), across == across.max()]
        x = origin + (position - first) * scale
        return [_Line(x[on], numbers[on], row, continuous, first, scale, origin) for on in edges]

    def draw(self, ax: Axes, shape: Floats, factor: float, *, to_scale: bool) -> None:
        """The deflection (nx,) times a factor; ``to_scale`` says whether gaps have that scale too."""
        from scipy.interpolate import make_interp_spline

        heights = shape * factor
        for name, lines in self.lines.items():
            for line in lines:
                y = heights[line.stations]
                ax.plot(line.x[[0, -1]], [line.row, line.row], color=_REST, linewidth=0.8, zorder=1)
                if line.continuous and line.x.size > 3:
                    fine = np.interp(np.arange(0, line.x.size - 0.9, 1 / _REFINED), np.arange(line.x.size), line.x)
                    spline = make_interp_spline(line.x, y, 3)
                    ax.plot(fine, line.row + spline(fine), color=_BODY, linewidth=1.6, zorder=3)
                else:
                    ax.plot(line.x, line.row + y, color=_BODY, linewidth=0.7, marker="s", markersize=5, zorder=3)
            ax.annotate(
                name, (float(lines[0].x[0]), lines[0].row), xytext=(0, -9), textcoords="offset points",
                fontsize="x-small", color="0.35", va="top",
            )  # fmt: skip
        self._marks(ax, heights)
        self._joints(ax, heights)
        self._stops(ax, heights, factor if to_scale else 0.0)
        ax.set_ylim(-0.62, self.count - 0.38)
        ax.set_yticks([])
        ax.spines[["top", "right", "left"]].set_visible(False)

    def _point(self, place: Place, heights: Floats) -> tuple[float, float]:
        name = place.body if place.body in self.lines else next(iter(self.lines))
        lines = self.lines[name]
        nearest = lines[-1] if place.across is not None and len(lines) > 1 and place.across > 0 else lines[0]
        return nearest.at(place.coordinate, heights)

    def _marks(self, ax: Axes, heights: Floats) -> None:
        """Supports stay where they are; masses move."""
        for name, body in self.result.scenario.all_bodies.items():
            for coordinate, kind in body.marks:
                x, y = self._point(Place(name, coordinate), heights)
                still = kind in ("clamped", "pinned", "guided")
                ax.plot(
                    x, self.lines[name][0].row if still else y, marker=_MARKERS[kind], markersize=7, linestyle="none",
                    color="0.25" if still else _BODY, markerfacecolor="0.25" if still else "white", clip_on=False,
                    zorder=5, label=kind,
                )  # fmt: skip

    def _joints(self, ax: Axes, heights: Floats) -> None:
        for joint in self.result.scenario.joints:
            site = site_in(self.result.scenario, joint)
            ends = [self._point(place, heights) for place in _places(site)]
            marker, face = _JOINTS[joint.kind]
            if len(ends) == 2 and math.dist(*ends) > 1e-6:
                ax.plot(*zip(*ends, strict=True), color=_BODY, linestyle=":", linewidth=1.0, zorder=2)
            ax.plot(
                *ends[0], marker=marker, markersize=6, color=_BODY, markerfacecolor=face, linestyle="none", zorder=6,
                label=f"{joint.kind} joint",
            )  # fmt: skip

    def _stops(self, ax: Axes, heights: Floats, factor: float) -> None:
        """Faces at their gaps; a stop between two bodies is a rod on the second that ends at its clearance."""
        result = self.result
        sites = {located.item.name: snubber_site(located) for located in result.scenario.located_snubbers}
        for name, snubber in result.snubbers.items():
            site, up = sites[name], snubber.side == "below"
            if isinstance(site, Link):
                (x, low), (over, high) = (self._point(place, heights) for place in _places(site))
                rows = [self._point(place, np.zeros_like(heights))[1] for place in _places(site)]
                apart = snubber.gap * factor + (high - low) - (rows[1] - rows[0])
                shut = factor > 0 and apart < 0
                colour, dashes = _STOP if shut else "0.4", "-" if snubber.side == "approach" else "--"
                face = low + (max(apart, 0.0) if snubber.side == "approach" else 0.0)
                ax.plot([over, x], [high, face], linestyle=dashes, color=colour, linewidth=1.6)
                ax.plot(
                    x,
                    face,
                    marker=7,
                    markersize=8,
                    color=colour,
                    linestyle="none",
                    label=_SHUT if shut else "stop",
                    zorder=4,
                )
                continue
            x, y = self._point(site, heights)
            row = self._point(site, np.zeros_like(heights))[1]
            face = row + (-1.0 if up else 1.0) * snubber.gap * factor
            shut = factor > 0 and (y < face if up else y > face)
            ax.plot(
                x, face, marker=6 if up else 7, markersize=10, color=_STOP if shut else "0.4", linestyle="none",
                clip_on=False, label=_SHUT if shut else "stop", zorder=4,
            )  # fmt: skip


def _places(site: Site) -> tuple[Place, ...]:
    return (site.first, site.second) if isinstance(site, Link) else (site,)


def _legend(figure: Figure, panels: list[Axes]) -> None:
    """One of each mark that any panel shows."""
    marks = {line.get_label(): line for ax in panels for line in ax.lines if not str(line.get_label()).startswith("_")}
    if marks:
        figure.legend(
            marks.values(), [str(label) for label in marks], loc="outside lower center", ncols=min(len(marks), 6),
            frameon=False, fontsize="small",
        )  # fmt: skip


def plot_assembly_modes(result: RunResult, panels: list[Axes]) -> None:
    """The first modes of the open structure, one a panel; stops are at the bodies at rest, as modes have no size."""
    sketch, modes = Sketch(result), result.modes
    for k, ax in enumerate(panels):
        shape = modes.shapes[k]
        sketch.draw(ax, shape, _HEIGHT / (float(np.abs(shape).max()) or 1.0), to_scale=False)
        ax.set_title(f"mode {k + 1}, {modes.open_frequencies_hz[k]:.4g} Hz", fontsize="medium")
        ax.set_xlabel("x (m)")


def plot_assembly_contact(result: RunResult, ax: Axes) -> Axes:
    """The deflection relative to the base when the contact force is largest; gaps to the same scale."""
    contact = result.contact
    if contact is None:
        raise ValueError("no snubber was in contact")
    sketch, shape = Sketch(result), contact.deflection(result.modes)
    gaps = [abs(snubber.gap) for snubber in result.snubbers.values()]
    largest = max(float(np.abs(shape).max()), *(gap for gap in gaps if math.isfinite(gap)), 0.0) or 1.0
    factor = _HEIGHT / largest
    sketch.draw(ax, shape, factor, to_scale=True)
    force, length = (scale_for(unit, np.array([value])) for unit, value in (("N", contact.force), ("m", largest)))
    ax.set_title(
        f"largest contact force, {contact.force * force.factor:.4g} {force.unit} at {contact.snubber}, "
        f"t = {contact.time:.4g} s", fontsize="medium",
    )  # fmt: skip
    bar = _round(largest * length.factor) / length.factor
    end = ax.get_xlim()[1]
    ax.plot([end, end], [-0.5 * bar * factor, 0.5 * bar * factor], color="black", linewidth=2.0, clip_on=False)
    ax.annotate(
        f"{bar * length.factor:g} {length.unit}", (end, 0.0), xytext=(5, 0), textcoords="offset points", va="center",
        fontsize="small", annotation_clip=False,
    )  # fmt: skip
    ax.set_xlabel("x (m)")
    return ax


def _round(value: float) -> float:
    """1, 2 or 5 times a power of ten, not above the value."""
    power = 10.0 ** math.floor(math.log10(value))
    return float(next(digit for digit in (5.0, 2.0, 1.0) if digit * power <= value) * power)


def assembly_figures(result: RunResult) -> dict[str, Figure]:
    """Modes, and the instant of the largest contact force, of a structure of several bodies."""
    from matplotlib.figure import Figure

    if len(result.modes.stations.parts) < 2:
        return {}
    figures: dict[str, Figure] = {}
    rows_of_bodies = Sketch(result).count
    count = min(MOST_MODES, result.modes.shapes.shape[0])
    rows = -(-count // 2)
    figure = Figure(figsize=(8.0, 0.8 + rows * (1.0 + 0.7 * rows_of_bodies)), layout="constrained")
    panels = list(figure.subplots(rows, 2, squeeze=False).ravel())
    plot_assembly_modes(result, panels[:count])
    for ax in panels[count:]:
        ax.set_visible(False)
    _legend(figure, panels[:count])
    figures["assembly_modes"] = figure
    if result.contact is not None:
        figure = Figure(figsize=(8.0, 1.6 + 1.4 * rows_of_bodies), layout="constrained")
        ax = figure.subplots()
        plot_assembly_contact(result, ax)
        _legend(figure, [ax])
        figures["assembly_contact"] = figure
    for figure in figures.values():
        if result.title:
            figure.suptitle(result.title, x=0.012, ha="left", fontsize="medium", color="0.3")
    return figures
