"""Animations of motions: the geometry of every frame, for a page or as a GIF."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.animation import FFMpegWriter
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from beamsim.errors import ResultFileError, visible
from beamsim.files import replacement_file
from beamsim.outcomes import report_progress
from beamsim.plots.drawing import in_lines, plain_text, show_unseen
from beamsim.plots.sketch import BODY, HEIGHT, REST, STOP, SUPPORTS, Sketch, finish_positions, scale_bar
from beamsim.plots.space import LARGEST, SpaceView, flat
from beamsim.plots.style import amount, round_length
from beamsim.responses.frames import Frames
from beamsim.structures.places import Place, ends_of
from beamsim.typing import Bools, Floats

MILLISECONDS = 40  # of a frame
NOTABLE = 0.05  # share of the largest deflection between frames above which a note is shown
_SIDES = {"below": -1.0, "above": 1.0, "approach": 1.0, "separation": 0.0}  # of the face from the first place; a cable
_MOUNT = 0.2  # rows, from the farthest face to what holds it


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
    face: Floats  # (nf,) row of its face
    mounting_row: float  # row of what holds the face of a stop at one place
    height: float  # rows, of what joins two masses of a row
    ends: Floats  # (nf, 1 or 2) rows above rest
    force: Floats  # (nf,) N


@dataclass(frozen=True)
class Scene:
    """Everything that is drawn, frame by frame."""

    title: str
    limits: tuple[float, float, float, float]  # left, right, low, high
    lines: tuple[PictureLine, ...]
    heights: Floats  # (nf, points of all lines) rows above rest
    stops: tuple[PictureStop, ...]
    time: Floats  # (nf,) s
    slow: Bools  # (nf,)
    names: tuple[tuple[str, float, float], ...]  # of bodies, and where
    bar: float  # rows
    bar_text: str
    supports: tuple[tuple[str, int], ...]  # kind, and which of the points moves with it
    count: int  # rows of bodies
    shifts: Floats  # (nf, points of all lines) m to the right of rest
    in_space: bool = False  # whether both axes have the same scale

    def as_json(self) -> dict[str, Any]:
        """For the player of pages."""
        return {**asdict(self), "slow": self.slow.tolist(), "milliseconds": MILLISECONDS}


def scene_of(frames: Frames, sketch: Sketch, title: str) -> Scene:
    """The frames in the sketch of the model, deflections and openings of stops to one scale."""
    view = SpaceView.of(sketch.scenario, sketch.stations, sketch.stops) if frames.in_space is not None else None
    if frames.in_space is not None and view is not None:
        return _scene_in_space(frames, view, frames.in_space, title)
    stops = sketch.stops
    in_sketch = {name: stop for name, stop in stops.items() if stop.gap_unit == "m"}  # others act within a hinge
    openings = {name: np.where(np.isfinite(frames.opening[name]), frames.opening[name], 0.0) for name in in_sketch}
    sizes = [float(np.abs(of).max(initial=0.0)) for of in (frames.deflection, *(0.5 * x for x in openings.values()))]
    largest = max(sizes) or 1.0
    factor, bar = HEIGHT / largest, round_length(largest)
    heights = frames.deflection * factor
    points = [np.array([sketch.point(place) for place in line.places]) for line in frames.lines]
    lines = [PictureLine(at[:, 0], at[:, 1], not of.continuous) for at, of in zip(points, frames.lines, strict=True)]
    drawn: list[PictureStop] = []
    for name in in_sketch:
        site = sketch.sites[name]
        x, y = zip(*(sketch.point(place) for place in ends_of(site)), strict=True)
        height, ends = 0.22 + 0.1 * len(drawn), frames.ends[name] * factor
        side = _SIDES[stops[name].side]
        face = y[0] + ends[:, 0] + side * openings[name] * factor
        mount = y[0] + side * (float((side * (face - y[0])).max(initial=0.0)) + _MOUNT)
        drawn.append(PictureStop(name, stops[name].side, x, y, face, mount, height, ends, frames.force[name]))
    bodies = sketch.scenario.all_bodies
    firsts = {name: sketch.lines_of(name)[0] for name in bodies if len(bodies) > 1}
    xy = np.concatenate(points)
    supports = tuple(
        (kind, int(np.hypot(*(xy - sketch.point(Place(name, coordinate))).T).argmin()))
        for name, body in bodies.items()
        for coordinate, kind in body.marks
        if kind in SUPPORTS and not sketch.width(name)
    )
    (left, _), (right, _) = (pick(xy, axis=0) for pick in (np.min, np.max))
    rest = xy[:, 1]
    drawn_at = [(rest + heights).ravel(), *(stop.face for stop in drawn)]
    low, high = (float(pick([pick(of) for of in drawn_at])) for pick in (np.min, np.max))
    margin = 0.09 * (float(right - left) or 1.0)
    limits = float(left) - margin, float(right) + 1.6 * margin, min(low - 0.12, -0.5), max(high + 0.3, 0.6)
    if frames.difference_between > NOTABLE:
        title += (
            f"; up to {100.0 * frames.difference_between:.2g} % of the largest deflection is too fast for these frames"
        )
    return Scene(
        title, limits, tuple(lines), heights, tuple(drawn), frames.time, frames.in_slow_motion,
        tuple((name, float(line.x[0]), line.row) for name, line in firsts.items()), bar * factor, amount(bar, "m"),
        supports, sketch.count, np.zeros_like(heights),
    )  # fmt: skip


def _scene_in_space(frames: Frames, view: SpaceView, displacement: Floats, title: str) -> Scene:
    """The frames of bodies in space, with displacements (nf, points, 3), m, and gaps to one scale."""
    numbers = [line.stations for line in frames.lines if line.stations is not None]
    largest = float(np.linalg.norm(displacement, axis=2).max(initial=0.0)) or 1.0
    factor, bar, middle = LARGEST * view.size / largest, round_length(largest), flat(view.points).mean(axis=0)
    at = flat(view.points) - middle
    moved = flat(displacement) * factor
    drawn = []
    for name, (face, holder) in view.faces(factor).items():
        (x, y), (x_end, y_end) = flat(face) - middle, flat(holder) - middle
        force, still = frames.force[name], np.zeros((frames.time.size, 2))
        y_end += 1e-9 * view.size * (y == y_end)  # else it would be a rod between masses of a row
        drawn.append(
            PictureStop(name, "approach", (float(x), float(x_end)), (float(y), float(y_end)),
                        np.full(frames.time.size, y), 0.0, 0.0, still, force)
        )  # fmt: skip
    supports = tuple(
        (kind, int(np.linalg.norm(view.points[np.concatenate(numbers)] - point, axis=1).argmin()))
        for name, body in view.scenario.all_bodies.items()
        for coordinate, kind in body.marks
        if kind in SUPPORTS and (point := view.point(Place(name, coordinate))) is not None
    )
    width, height = np.abs(at).max(axis=0) + 0.2 * view.size
    count = int(np.clip(round(3.2 * height / width), 1, 3))
    share = (1.3 + 1.9 * count) / 8.0  # of the picture, height over width
    width = max(width, height / share)
    lines = tuple(PictureLine(at[of, 0], at[of, 1], of.size == 1) for of in numbers)
    return Scene(
        title, (-width, width, -share * width, share * width), lines, moved[:, :, 1], tuple(drawn), frames.time,
        frames.in_slow_motion, (), bar * factor, amount(bar, "m"), supports, count, moved[:, :, 0], in_space=True,
    )  # fmt: skip


def save_gif(scene: Scene, path: Path, progress: Callable[[float], None] | None = None) -> Path:
    """Write the animation as a GIF that repeats.

    Parameters
    ----------
    scene : with its frames.
    path : of the file.
    progress : called with the share of the frames that is drawn.

    Returns
    -------
    The path.

    Raises
    ------
    ResultFileError
        If the file cannot be written.
    """
    from PIL import Image

    with plain_text():
        figure, draw = _canvas(scene)

        def picture(k: int) -> Any:
            draw(k)
            return Image.fromarray(np.asarray(figure.canvas.buffer_rgba())).convert("RGB")

        forces = np.sum([stop.force for stop in scene.stops], axis=0) if scene.stops else np.zeros(1)
        palette = picture(int(np.argmax(forces))).quantize(64)  # it has the colour of contact
        pictures = []
        for k in range(scene.time.size):
            pictures.append(picture(k).quantize(palette=palette, dither=Image.Dither.NONE))
            report_progress(progress, (k + 1) / scene.time.size)
    with replacement_file(path) as temporary:
        pictures[0].save(
            temporary, format="GIF", save_all=True, append_images=pictures[1:], duration=MILLISECONDS, loop=0
        )
    return path


def demand_ffmpeg(path: Path) -> None:
    """Refuse to write a video where there is no ffmpeg.

    Raises
    ------
    ResultFileError
        Where Matplotlib finds none.
    """
    if not FFMpegWriter.isAvailable():
        raise ResultFileError(
            f"cannot write {path}: a video needs the program ffmpeg, which is not found; install it, or give a name"
            " that ends with .gif or .html"
        )


def save_video(scene: Scene, path: Path, progress: Callable[[float], None] | None = None) -> Path:
    """Write the animation as a video in MP4 by ffmpeg.

    Parameters
    ----------
    scene, path, progress : as of `save_gif`.

    Returns
    -------
    The path.

    Raises
    ------
    ResultFileError
        If there is no ffmpeg, or the file cannot be written.
    """
    demand_ffmpeg(path)
    even = ["-f", "mp4", "-pix_fmt", "yuv420p", "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2"]  # which players demand
    with plain_text(), replacement_file(path) as temporary:
        figure, draw = _canvas(scene)
        writer = FFMpegWriter(fps=round(1000 / MILLISECONDS), codec="h264", extra_args=even)
        with writer.saving(figure, str(temporary), figure.dpi):
            for k in range(scene.time.size):
                draw(k)
                writer.grab_frame()
                report_progress(progress, (k + 1) / scene.time.size)
    return path


def _canvas(scene: Scene) -> tuple[Any, Callable[[int], None]]:
    """The figure of an animation, and what draws a frame in it."""
    figure = Figure(figsize=(8.0, 1.3 + 1.9 * scene.count), dpi=90, layout="constrained")
    canvas: Any = FigureCanvasAgg(figure)
    update = _drawing(scene, figure.subplots())
    show_unseen(figure)

    def draw(k: int) -> None:
        update(k)
        canvas.draw()
        figure.set_layout_engine("none")  # that of the first one stays

    return figure, draw


def _drawing(scene: Scene, ax: Axes) -> Callable[[int], None]:
    """Draw the fixed parts; returns a function that updates the moving parts for a frame."""
    left, right, low, high = scene.limits
    ax.set(xlim=(left, right), ylim=(low, high), yticks=[])
    ax.spines[["top", "right", "left"]].set_visible(False)
    ax.set_title(in_lines(scene.title, ax.bbox.width), fontsize="medium", loc="left")
    if scene.in_space:
        ax.set(xticks=[], aspect="equal")
        ax.spines["bottom"].set_visible(False)
    elif all(line.dots for line in scene.lines):
        ax.set_xticks([])
    else:
        finish_positions(ax)
    for line in scene.lines:
        ax.plot(line.x, line.y, color=REST, linewidth=0.8, zorder=1)
    rest = [np.concatenate(each) for each in zip(*((line.x, line.y) for line in scene.lines), strict=True)]
    supports = [
        ax.plot([], [], marker=SUPPORTS[kind], markersize=9, color="0.3", linestyle="none", zorder=2)[0]
        for kind, _ in scene.supports
    ]
    for name, x, y in scene.names:
        ax.annotate(name, (x, y), xytext=(-4, 9), textcoords="offset points", fontsize="small", ha="right")
    scale_bar(ax, right - 0.055 * (right - left), scene.bar, scene.bar_text)
    moving = [
        ax.plot([], [], color=BODY, linewidth=1.0 if line.dots else 1.8, marker="s" if line.dots else "", markersize=7,
                zorder=3)[0]
        for line in scene.lines
    ]  # fmt: skip
    marks = {"below": 6, "above": 7}
    stops = [ax.plot([], [], zorder=4, marker=marks.get(stop.side, ""), markersize=9)[0] for stop in scene.stops]
    caption = ax.text(
        0.99, 0.98, "", transform=ax.transAxes, ha="right", va="top", fontsize="small", family="monospace"
    )

    def update(k: int) -> None:
        first = 0
        for line, artist in zip(scene.lines, moving, strict=True):
            of_line = slice(first, first + line.x.size)
            artist.set_data(line.x + scene.shifts[k, of_line], line.y + scene.heights[k, of_line])
            first += line.x.size
        for (_, point), artist in zip(scene.supports, supports, strict=True):
            artist.set_data([rest[0][point] + scene.shifts[k, point]], [rest[1][point] + scene.heights[k, point]])
        for stop, artist in zip(scene.stops, stops, strict=True):
            artist.set_data(*_stop(stop, k))
            pressed = stop.force[k] != 0.0
            artist.set(color=STOP if pressed else "0.45", linewidth=2.8 if pressed else 1.2)  # distinct in grey, too
        forces = "  ".join(f"{s.name} {amount(float(np.round(s.force[k], 9)), 'N'):>9}" for s in scene.stops[:4])
        caption.set_text(visible(f"{'slow  ' if scene.slow[k] else ''}t = {scene.time[k]:.5f} s   {forces}"))

    return update


def _stop(stop: PictureStop, k: int) -> tuple[list[float], list[float]]:
    """The face of a stop in a frame; what acts between bodies is a rod or a cable."""
    y = (np.array(stop.y) + stop.ends[k]).tolist()
    if len(stop.x) == 1:
        return [stop.x[0]], [float(stop.face[k])]
    if stop.y[0] == stop.y[1]:  # masses of a row
        top = stop.y[0] + stop.height
        return [stop.x[0], *stop.x, stop.x[1]], [y[0], top, top, y[1]]
    return [stop.x[1], stop.x[0]], [y[1], float(stop.face[k])]
