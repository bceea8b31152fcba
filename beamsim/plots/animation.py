"""Animations of motions: the geometry of every frame, for a page or as a GIF."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from beamsim.analyses.animate.frames import Frames
from beamsim.files import replacing
from beamsim.plots.drawing import finish_positions
from beamsim.plots.model import oblique
from beamsim.plots.sketch import BODY, REST, STOP, Sketch, scale_bar
from beamsim.plots.style import amount, round_length
from beamsim.scenario import Scenario
from beamsim.structures.places import Place, ends_of
from beamsim.structures.stations import Stations
from beamsim.system.structural import SnubberNumbers
from beamsim.typing import Bools, Floats

SUPPORTS = {"clamped": "s", "pinned": 6, "guided": "D"}
MILLISECONDS = 40  # of a frame
_HEIGHT = 0.34  # of the largest deflection or gap, over the distance of rows
_SPRING = 0.2
_RESOLUTION = 1e4  # heights are whole numbers of rows over this


@dataclass(frozen=True)
class PictureLine:
    """A line at rest in the picture: lengths in m to the right, rows upwards."""

    x: Floats
    y: Floats
    dots: bool


@dataclass(frozen=True)
class PictureStop:
    """A stop in the picture."""

    name: str
    side: str  # below, above, approach, separation
    x: tuple[float, ...]  # of the places that it acts on
    y: tuple[float, ...]  # the same at rest
    gap: float  # rows
    height: float  # rows, of what joins two masses of a row
    ends: Floats  # (nf, 1 or 2) rows above rest
    force: Floats  # (nf,) N


@dataclass(frozen=True)
class Scene:
    """Everything that is drawn, frame by frame."""

    title: str
    lines: tuple[PictureLine, ...]
    heights: Floats  # (nf, points of all lines) rows above rest
    stops: tuple[PictureStop, ...]
    time: Floats  # (nf,) s
    slow: Bools  # (nf,)
    names: tuple[tuple[str, float, float], ...]  # of bodies, and where
    bar: float  # rows
    bar_text: str
    supports: tuple[tuple[str, float, float], ...]  # kind, and where
    count: int  # rows of bodies

    @property
    def limits(self) -> tuple[float, float, float, float]:
        """Left, right, low, high."""
        x, y = (np.concatenate([getattr(line, name) for line in self.lines]) for name in "xy")
        margin = 0.09 * (float(np.ptp(x)) or 1.0)
        low, high = float((y + self.heights).min()), float((y + self.heights).max())
        return float(x.min()) - margin, float(x.max()) + 1.6 * margin, min(low - 0.12, -0.5), max(high + 0.3, 0.6)

    def as_json(self) -> dict[str, Any]:
        """For the player of pages; heights are whole numbers, `_RESOLUTION` a row."""
        return {
            "title": self.title, "limits": self.limits, "resolution": _RESOLUTION,
            "lines": [{"x": _short(line.x), "y": _short(line.y), "dots": line.dots} for line in self.lines],
            "heights": np.rint(self.heights * _RESOLUTION).astype(int).tolist(),
            "stops": [
                {"name": s.name, "side": s.side, "x": s.x, "y": s.y, "gap": s.gap, "height": s.height,
                 "force": _short(s.force),
                 "ends": np.rint(s.ends * _RESOLUTION).astype(int).tolist()}
                for s in self.stops
            ],
            "time": _short(self.time, 8), "slow": self.slow.astype(int).tolist(), "names": self.names,
            "supports": self.supports,
            "bar": self.bar, "barText": self.bar_text, "milliseconds": MILLISECONDS,
        }  # fmt: skip


def _short(values: Floats, digits: int = 5) -> list[float]:
    return [float(f"{value:.{digits}g}") for value in values]


def scene_of(
    frames: Frames, scenario: Scenario, stations: Stations, stops: Mapping[str, SnubberNumbers], title: str
) -> Scene:
    """The frames in the sketch of the model, deflections and gaps to one scale."""
    sketch = Sketch(scenario, stations, stops)
    gaps = [abs(stop.gap) for stop in stops.values() if np.isfinite(stop.gap)]
    largest = max(float(np.abs(frames.deflection).max(initial=0.0)), max(gaps, default=0.0) * 0.5) or 1.0
    factor = _HEIGHT / largest
    lines = []
    for line in frames.lines:
        xy = (
            np.array([oblique(sketch, place) for place in line.places]) if line.continuous else _dots(sketch, line.body)
        )
        lines.append(PictureLine(xy[:, 0], xy[:, 1], not line.continuous))
    drawn: list[PictureStop] = []
    for name, site in sketch.stop_sites.items():
        places = [oblique(sketch, place) for place in ends_of(site)]
        stop = stops[name]
        drawn.append(
            PictureStop(name, stop.side, tuple(x for x, _ in places), tuple(y for _, y in places),
                 (stop.gap if np.isfinite(stop.gap) else 0.0) * factor, 0.22 + 0.1 * len(drawn),
                 frames.ends[name] * factor, frames.force[name])
        )  # fmt: skip
    names = tuple(
        (name, float(sketch.lines_of(name)[0].x[0]), float(sketch.lines_of(name)[0].row))
        for name in scenario.all_bodies
        if len(scenario.all_bodies) > 1
    )
    supports = tuple(
        (kind, *oblique(sketch, Place(name, coordinate)))
        for name, body in scenario.all_bodies.items()
        for coordinate, kind in body.marks
        if kind in ("clamped", "pinned", "guided") and len(sketch.lines_of(name)) == 1
    )
    bar = round_length(largest)
    return Scene(
        title, tuple(lines), frames.deflection * factor, tuple(drawn), frames.time, frames.slow, names, bar * factor,
        amount(bar, "m"), supports, sketch.count,
    )  # fmt: skip


def _dots(sketch: Sketch, body: str) -> Floats:
    line = sketch.lines_of(body)[0]
    return np.column_stack([line.x, np.full(line.x.size, float(line.row))])


def save_gif(scene: Scene, path: Path, progress: Callable[[float], None] | None = None) -> Path:
    """Write the animation as a GIF that repeats.

    Raises
    ------
    ResultFileError
        If the file cannot be written.
    """
    from PIL import Image

    figure = Figure(figsize=(8.0, 1.3 + 1.9 * scene.count), dpi=90, layout="constrained")
    canvas: Any = FigureCanvasAgg(figure)
    ax = figure.subplots()
    update = _drawing(scene, ax)
    for artist in update(0):
        artist.set_animated(True)
    canvas.draw()
    background = canvas.copy_from_bbox(figure.bbox)

    def picture(k: int) -> Any:
        canvas.restore_region(background)
        for artist in update(k):
            ax.draw_artist(artist)
        return Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")

    forces = np.sum([stop.force for stop in scene.stops], axis=0) if scene.stops else np.zeros(1)
    palette = picture(int(np.argmax(forces))).quantize(64)  # it has the colour of contact
    pictures = []
    for k in range(scene.time.size):
        pictures.append(picture(k).quantize(palette=palette, dither=Image.Dither.NONE))
        if progress is not None:
            progress((k + 1) / scene.time.size)
    with replacing(path) as temporary:
        pictures[0].save(
            temporary, format="GIF", save_all=True, append_images=pictures[1:], duration=MILLISECONDS, loop=0
        )
    return path


def _drawing(scene: Scene, ax: Any) -> Callable[[int], list[Any]]:
    """Draw what does not move; returns what gives the rest its places in a frame."""
    left, right, low, high = scene.limits
    ax.set_xlim(left, right)
    ax.set_ylim(low, high)
    ax.set_yticks([])
    ax.spines[["top", "right", "left"]].set_visible(False)
    ax.set_title(scene.title, fontsize="medium", loc="left")
    if all(line.dots for line in scene.lines):
        ax.set_xticks([])
    else:
        finish_positions(ax)
    for line in scene.lines:
        ax.plot(line.x, line.y, color=REST, linewidth=0.8, zorder=1)
    for kind, x, y in scene.supports:
        ax.plot(x, y, marker=SUPPORTS[kind], markersize=9, color="0.3", linestyle="none", zorder=2)
    for name, x, y in scene.names:
        ax.annotate(
            name, (x, y), xytext=(-4, 9), textcoords="offset points", fontsize="small", color="0.35", ha="right"
        )
    scale_bar(ax, right - 0.055 * (right - left), scene.bar, scene.bar_text)
    moving = [
        ax.plot([], [], color=BODY, linewidth=1.0 if line.dots else 1.8, marker="s" if line.dots else "", markersize=7,
                zorder=3)[0]
        for line in scene.lines
    ]  # fmt: skip
    springs = [ax.plot([], [], zorder=4)[0] for _ in scene.stops]
    said = ax.text(0.99, 0.98, "", transform=ax.transAxes, ha="right", va="top", fontsize="small", family="monospace")
    width = 0.009 * (right - left)

    def update(k: int) -> list[Any]:
        first = 0
        for line, artist in zip(scene.lines, moving, strict=True):
            artist.set_data(line.x, line.y + scene.heights[k, first : first + line.x.size])
            first += line.x.size
        for stop, artist in zip(scene.stops, springs, strict=True):
            artist.set_data(*_spring(stop, k, width))
            pressed = stop.force[k] > 0.0
            artist.set(color=STOP if pressed else "0.45", linewidth=2.8 if pressed else 1.2)  # told apart in grey, too
        forces = "  ".join(f"{s.name} {amount(_settled(s.force[k]), 'N'):>9}" for s in scene.stops[:4])
        said.set_text(f"{'slow  ' if scene.slow[k] else ''}t = {scene.time[k]:.5f} s   {forces}")
        return [*moving, *springs, said]

    return update


def _settled(force: float) -> float:
    """Zero for what is round-off."""
    return 0.0 if abs(force) < 1e-9 else float(force)


def _spring(stop: PictureStop, k: int, width: float) -> tuple[Floats, Floats]:
    """The face and the zigzag of a stop in a frame; what acts between bodies is a rod or a cable."""
    y = np.array(stop.y) + stop.ends[k]
    if len(stop.x) == 2:
        if stop.y[0] == stop.y[1]:  # masses of a row
            high = max(stop.y) + stop.height
            return np.array([stop.x[0], *stop.x, stop.x[1]]), np.array([y[0], high, high, y[1]])
        end = y[0] if stop.side == "separation" else max(stop.y[0] + stop.ends[k, 1] + stop.gap, y[0])
        return np.array([stop.x[1], stop.x[0]]), np.array([y[1], end])
    side = -1.0 if stop.side == "below" else 1.0
    free = stop.y[0] + side * stop.gap
    face = min(free, y[0]) if side < 0 else max(free, y[0])
    ground = stop.y[0] + side * (max(stop.gap, 0.0) + _SPRING)
    across = np.array([-1.6, 1.6, 0, 0, 1, -1, 1, -1, 0, 0, -2, 2]) * width
    along = np.array([0, 0, 0, 0.15, 0.3, 0.45, 0.6, 0.75, 0.88, 1, 1, 1])
    return stop.x[0] + across, face + (ground - face) * along
