"""What all plots share: panels, curves on axes with units that can be distinguished in grey print, legends, files."""

from __future__ import annotations

import math
import textwrap
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import copy
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backend_bases import get_registered_canvas_class
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from matplotlib.ticker import LogFormatterSciNotation, LogLocator, MaxNLocator, NullFormatter
from numpy.typing import ArrayLike

from beamsim.errors import visible
from beamsim.files import replacement_file
from beamsim.outcomes import Stop, never
from beamsim.plots.style import Scale, scale_for
from beamsim.scenario.reporting import Limits
from beamsim.typing import Bools, Floats

MOST_PANELS = 6  # of one kind, in a picture
MOST_CURVES = 6  # in one plot; more cannot be distinguished
DARK, RED, GREEN, PALE = "#0b3c5d", "#d1495b", "#3a7d44", "0.65"
FARTHEST = 4.0  # of the largest value drawn: a line beyond that would leave no room for the curves
MOST_DRAWN = 12_000  # points of a curve: ten for every pixel of its width
MOST_AT_ONCE = 5_000  # points of a loop that are filled in one pass, for each of which the renderer takes some 10 kB
WIDE = 8.0  # ratio of the ends of an axis from which it is logarithmic; below, it has no room for its numbers
DOTS_PER_INCH = 150.0
HERTZ = Scale(1.0, "Hz")

# Colours of decreasing darkness, distinguishable by colour-blind readers, each with its own dashes for grey print.
_COLOURS = (DARK, RED, GREEN, "#e6a117", "#7b5ea7", "#6c757d")
_DASHES: tuple[str | tuple[int, tuple[float, ...]], ...] = (
    "-",
    (0, (5, 1.5)),
    (0, (1.2, 1.2)),
    (0, (6, 1.5, 1.2, 1.5)),
    (0, (9, 2)),
    (0, (3, 1, 1.2, 1, 1.2, 1)),
)


_CARETS: dict[Any, str] = {6: "^", 7: "v"}
Axis = tuple[str, str | Scale]  # words, and the SI unit or the scale in which it is shown


class Curve(NamedTuple):
    """A curve in SI units; what its style leaves open follows from its number."""

    label: str
    x: Floats
    y: Floats
    style: dict[str, Any] = {}  # noqa: RUF012 - never changed


def marks_curve(label: str, places: Any, **style: Any) -> Curve:
    """Places (n, 2) in SI units with marks that no line joins."""
    x, y = np.reshape(places, (-1, 2)).T
    return Curve(label, x, y, {"linestyle": "none", **style})


class Guide(NamedTuple):
    """A line across a panel that curves are compared with, in SI units."""

    label: str
    value: float
    style: dict[str, Any] = {}  # noqa: RUF012 - never changed


def limit_levels(limits: Limits | None, name: str, place: str = "", *, both_signs: bool = False) -> list[Guide]:
    """The limits on a value, where there are any: of all places, or by place.

    Parameters
    ----------
    limits : of the scenario; None without any.
    name : of the limit without a place.
    place : whose limits are shown; all where it is empty.
    both_signs : whether its negative is a limit, too.

    Returns
    -------
    A line for each limit, or two.
    """
    style, signs = {"linestyle": ":", "linewidth": 1.6}, (1.0, -1.0) if both_signs else (1.0,)
    parted = [
        (*each.partition("."), limit) for each, limit in ({} if limits is None else limits.values_by_name).items()
    ]
    shown = [(of, limit) for each, _, of, limit in parted if each == name and (not of or place in ("", of))]
    return [
        Guide(("limit" if of in ("", place) else f"limit of {of}") if sign > 0.0 else "", sign * limit, style)
        for of, limit in shown
        for sign in signs
    ]


def limit_curves(limits: Mapping[str, Floats | None], x: Floats) -> list[Curve]:
    """The limits (n or more,) over x (n,), Hz, by the names of the curves that are drawn, in their colours."""
    return [
        Curve(f"{name}, limit", x, limit[-x.size :], {**curve_style(k), "linestyle": ":", "linewidth": 1.8})
        for k, (name, limit) in enumerate(list(limits.items())[:MOST_CURVES])
        if limit is not None and not np.isnan(limit).all()
    ]


Ends = tuple[float | None, float | None]


class Chart(NamedTuple):
    """A panel of curves over common axes, in SI units: what `draw` draws, and what a page for a browser shows."""

    x_axis: Axis
    y_axis: Axis
    curves: Sequence[Curve]
    levels: Sequence[Guide] = ()  # on a linear axis those far above the curves are left out
    log: str = ""  # the letters of logarithmic axes
    integer_axes: str = ""  # those of axes that count: numbers between whole ones are not marked
    curve_noun: str = "curves"  # the first `MOST_CURVES` are drawn, and the legend says of how many; all where empty
    marks: Sequence[Curve] = ()  # drawn in addition to the curves, however many these are
    x_ends: Ends = (None, None)
    y_ends: Ends = (None, None)
    note: str = ""  # of a doubt, in the upper right corner
    title: str = ""
    legend: str = ""  # title of the legend, where no curves are left out
    names: Mapping[str, tuple[float, float]] = {}
    draw_extra: Callable[[Axes, Scale, Scale], Any] | None = None  # draws other things; is given the scales of the axes

    @property
    def drawn(self) -> list[Curve]:
        """The curves that are drawn."""
        return list(self.curves)[: MOST_CURVES if self.curve_noun else None]

    @property
    def scales(self) -> tuple[Scale, Scale]:
        """Scales in which the two axes are shown: the curves choose the prefixes of SI units."""
        x, y = (
            unit if isinstance(unit, Scale) else scale_for(unit, *(getattr(curve, name) for curve in self.drawn))
            for (_, unit), name in ((self.x_axis, "x"), (self.y_axis, "y"))
        )
        return x, y


class HeatMap(NamedTuple):
    """A panel of values over two axes in SI units, which draws itself."""

    x_axis: Axis
    y_axis: Axis
    z_axis: Axis
    x: Floats  # (nx,)
    y: Floats  # (ny,)
    values: Floats  # (ny, nx)
    draw: Callable[[Axes], Any]


class Picture(NamedTuple):
    """A title at the left edge, and panels row by row; what is neither chart nor map draws on the Axes it is given."""

    title: str
    panels: Sequence[Chart | HeatMap | Callable[[Axes], Any]]
    columns: int = 1
    size: tuple[float, float] | None = None  # width and height, inches; by default from the number of rows
    sharex: bool = False
    outer_labels: bool = False  # panels of a matrix: labels at its edges alone
    legend_below: bool = False  # one of each mark that any panel has a label for

    def figure(self) -> Figure:
        """The picture drawn; its axes are the panels in their order."""
        rows = -(-len(self.panels) // self.columns)
        figure = Figure(figsize=self.size or (8.0, max(4.4, 2.8 * rows)), layout="constrained")
        axes = list(figure.subplots(rows, self.columns, squeeze=False, sharex=self.sharex).ravel())
        for ax in axes[len(self.panels) :]:
            ax.remove()
        for ax, panel in zip(axes, self.panels, strict=False):
            if isinstance(panel, Chart):
                draw(ax, panel)
            else:
                (panel.draw if isinstance(panel, HeatMap) else panel)(ax)
            if self.outer_labels:
                ax.label_outer(remove_inner_ticks=False)
        if self.sharex:
            for ax in axes[: -self.columns]:
                ax.set_xlabel("")
        if self.title:
            figure.suptitle(in_lines(self.title, figure.bbox.width), x=0.012, ha="left", fontsize="medium", color="0.3")
        if self.legend_below:
            _legend_below(figure)
        show_unseen(figure)
        return figure


def show_unseen(figure: Figure) -> None:
    """Put escapes in place of control characters in the texts of a figure: names and titles may come from files."""
    for text in figure.findobj(Text):
        if (shown := visible(text.get_text())) != text.get_text():
            text.set_text(shown)


def in_lines(title: str, width: float) -> str:
    """A title in lines that fit into so many pixels, at most three; what is left out is marked by dots."""
    lines = title.split("\n")
    return "\n".join(
        part
        for line in lines
        for part in textwrap.wrap(line, max(int(width / 7.0), 20), max_lines=3, placeholder=" …") or [line]
    )


def curve_style(index: int) -> dict[str, Any]:
    """Colour, dashes and width of curve number ``index`` of a plot."""
    k = index % len(_COLOURS)
    return {"color": _COLOURS[k], "linestyle": _DASHES[k], "linewidth": 1.1}


def draw(ax: Axes, chart: Chart) -> None:
    """Draw curves, label both axes with their units, and name the curves."""
    curves, (x, y) = chart.drawn, chart.scales
    for k, curve in enumerate((*curves, *chart.marks)):
        style = {**curve_style(k), **curve.style}
        x_drawn, y_drawn = thin_out(curve.x, curve.y, MOST_DRAWN)
        ax.plot(x_drawn * x.factor, y_drawn * y.factor, label=curve.label or "_nolegend_", **style)
    largest = max((float(np.nanmax(np.abs(curve.y), initial=0.0)) for curve in curves), default=0.0)
    near = [level for level in chart.levels if "y" in chart.log or abs(level.value) <= FARTHEST * largest]
    for level in near:
        style = {"color": "0.35", **level.style}
        ax.axhline(level.value * y.factor, label=level.label or "_nolegend_", **style)
    ax.set(**{f"{letter}scale": "log" for letter in chart.log})
    if chart.draw_extra is not None:
        chart.draw_extra(ax, x, y)
    for set_ends, ends, scale in ((ax.set_xlim, chart.x_ends, x), (ax.set_ylim, chart.y_ends, y)):
        if ends != (None, None):
            set_ends(*(None if end is None else end * scale.factor for end in ends))
    for letter in chart.integer_axes:
        (ax.xaxis if letter == "x" else ax.yaxis).set_major_locator(MaxNLocator("auto", integer=True))
    for letter in chart.log:
        _label_logarithmic(ax.xaxis if letter == "x" else ax.yaxis)
    finish(ax, with_unit(chart.x_axis[0], x), with_unit(chart.y_axis[0], y))
    ax.set_title(chart.title, fontsize="small", loc="left")
    if chart.note:
        _write_note(ax, chart.note)
    left_out = f"{len(curves)} of {len(chart.curves)} {chart.curve_noun}" if len(chart.curves) > len(curves) else ""
    legend(ax, left_out or chart.legend)
    if chart.names:
        _annotate(ax, {name: (at[0] * x.factor, at[1] * y.factor) for name, at in chart.names.items()})


def _write_note(ax: Axes, note: str) -> None:
    """A doubt in the corner; wrapped, as text wider than the panel would leave no room for the curves."""
    ax.text(
        0.99, 0.97, textwrap.fill(note, 100),
        transform=ax.transAxes, ha="right", va="top", fontsize="small", color="#a3263d",
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8},
    )  # fmt: skip


def thin_out(x: Floats, y: Floats, largest_count: int) -> tuple[Floats, Floats]:
    """The same curve with at most about so many points: the lowest and highest value of every few.

    Parameters
    ----------
    x, y : (n,) arrays; y may have holes (nan).
    largest_count : number of points; a curve of fewer is kept as it is, and so is a loop, whose x decreases somewhere.

    Returns
    -------
    Arrays of equal length, in the order of the curve.
    """
    if y.size <= largest_count or np.any(x[1:] < x[:-1]):
        return x, y
    length = -(-2 * y.size // largest_count)
    whole = y.size // length * length
    blocks = y[:whole].reshape(-1, length)
    first = np.arange(blocks.shape[0]) * length
    lowest, highest = np.where(np.isnan(blocks), np.inf, blocks), np.where(np.isnan(blocks), -np.inf, blocks)
    ends = np.stack([first + lowest.argmin(axis=1), first + highest.argmax(axis=1)], axis=1)
    pick = np.append(np.sort(ends, axis=1).ravel(), np.arange(whole, y.size))
    return x[pick], y[pick]


def with_unit(quantity: str, scale: Scale) -> str:
    """Label of an axis."""
    return f"{quantity} ({scale.unit})" if scale.unit else quantity


def finish(ax: Axes, xlabel: str, ylabel: str) -> None:
    """Labels, grid and frame.

    Parameters
    ----------
    ax : to be finished.
    xlabel, ylabel : of its axes, with their units.
    """
    most = max(int(ax.bbox.height / 7.5), 1)  # letters; in a longer label what is in brackets, then words, begin lines
    if max(map(len, ylabel.split("\n"))) > most:
        ylabel = ylabel.replace(" (", "\n(", 1)
    ax.set_xlabel(xlabel)
    ax.set_ylabel("\n".join(textwrap.fill(line, most, break_long_words=False) for line in ylabel.split("\n")))
    ax.grid(visible=True, color="0.88", linewidth=0.6)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)


def _label_logarithmic(axis: Any) -> None:
    """Powers of ten on a logarithmic axis; numbers at 1, 2, 5 a decade, written out, on one of few decades."""
    axis.set_major_formatter(PowersOfTen())
    axis.set_minor_formatter(PowersOfTen())
    low, high = axis.get_view_interval()
    if 4.0 * low < high < 1e3 * low and low > 1e-3:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_minor_formatter(NullFormatter())
        axis.set_major_formatter("{x:g}")


def over_frequencies(chart: Chart, frequencies: Floats) -> Chart:
    """The chart from the lowest to the highest frequency, on a logarithmic axis where that is wide."""
    if not frequencies.size:
        return chart
    low, high = float(frequencies.min()), float(frequencies.max())
    return chart._replace(x_ends=(low, high), log=chart.log + logarithmic("x", frequencies))


def logarithmic(axis: str, values: Floats) -> str:
    """The name of an axis if it is to be logarithmic: where positive values are far apart; else nothing."""
    return axis if values.size and float(values.max()) > WIDE * float(values.min()) > 0.0 else ""


def legend(ax: Axes, title: str = "") -> None:
    """A legend above the panel, as wide as it: one curve alone has a name, too.

    Parameters
    ----------
    ax : whose labelled lines are listed.
    title : of the legend; without labels it is written next to the panel.
    """
    labels = ax.get_legend_handles_labels()[1]
    if labels:
        letters = max(map(len, labels)) + 6  # each 6 pixels wide; the mark before a label is as wide as 6 of them
        columns = max(1, min(len(labels), int(ax.bbox.width / (6.0 * letters))))
        ax.legend(
            title=title or None, loc="lower right", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize="small",
            title_fontsize="small", borderaxespad=0.1, handlelength=2.6, ncols=columns,
        )  # fmt: skip
    elif title:
        ax.set_title(title, loc="right", fontsize="small")


def _legend_below(figure: Figure) -> None:
    """One of each mark that any panel has a label for, below all panels."""
    shown = {
        label: copy(mark) for ax in figure.axes for mark, label in zip(*ax.get_legend_handles_labels(), strict=True)
    }
    for mark in shown.values():  # triangles whose tips are at a place would not be level with their texts
        if isinstance(mark, Line2D) and mark.get_marker() in _CARETS:
            mark.set_marker(_CARETS[mark.get_marker()])
    if shown:
        letters = max(map(len, shown)) + 6  # as in `legend`
        columns = max(1, min(len(shown), int(figure.bbox.width / (6.0 * letters))))
        figure.legend(
            list(shown.values()), list(shown), loc="outside lower center", frameon=False, fontsize="small",
            ncols=columns,
        )  # fmt: skip


def dashed_line(ax: Axes, x: ArrayLike, y: ArrayLike, label: str) -> None:
    """A line on coloured areas: white dashes on black, to be seen on dark and light ones.

    Parameters
    ----------
    ax : to draw on.
    x, y : (n,) in the units of the axes.
    label : for a legend; no legend where empty.
    """
    ax.plot(x, y, color="black", linewidth=2.4)
    ax.plot(x, y, color="white", linestyle=(0, (4, 3)), linewidth=1.2, label=label or None)
    if label:
        ax.legend(
            loc="upper left", fontsize="small", labelcolor="white", facecolor="black", framealpha=0.7, edgecolor="none"
        )


def with_neighbours(selected: Bools) -> Bools:
    """Whether a point is chosen or next to one that is, so that curves of chosen points have no holes."""
    return np.asarray(selected | np.append(selected[1:], False) | np.append(False, selected[:-1]))


def highest_in_bins(f: Floats, values: Floats, *, mean: bool = False) -> tuple[Floats, Floats]:
    """By increasing frequency; of many points the highest (or mean) value of each of 700 bins.

    Parameters
    ----------
    f, values : (n,) of the cycles of a sweep.
    mean : whether bins have the mean of their values.

    Returns
    -------
    Frequencies and values, both (n,), of more than 1400 points (700,) or fewer; a bin has the mean of its frequencies.
    """
    order = np.argsort(f, kind="stable")
    f, values = f[order], values[order]
    if f.size <= 1400:
        return f, values
    first = np.unique(np.searchsorted(f, np.geomspace(f[0], f[-1], 701)[:-1]))
    count = np.diff(np.append(first, f.size))
    of_bins = np.add.reduceat(values, first) / count if mean else np.maximum.reduceat(values, first)
    return np.add.reduceat(f, first) / count, of_bins


def _annotate(ax: Axes, places: Mapping[str, tuple[float, float]]) -> None:
    """Names of places (data coordinates) in a column right of the panel, ordered by height, with leaders."""
    ordered = sorted(places, key=lambda name: -places[name][1])
    for name, height in zip(ordered, np.linspace(1.0, 0.0, 2 * len(ordered) + 1)[1::2], strict=True):
        ax.annotate(
            name, places[name], xytext=(1.02, float(height)), textcoords="axes fraction", va="center", fontsize="small",
            color="0.25", arrowprops={"arrowstyle": "-", "color": "0.6", "linewidth": 0.5, "shrinkA": 0, "shrinkB": 1},
        )  # fmt: skip


def save_figures(
    figures: Mapping[str, Picture], folder: Path | str, stem: str, form: str = "png", stop: Stop = never
) -> list[Path]:
    """Draw and save every picture as ``<stem>_<name>.<form>``; slashes and spaces in names become underscores.

    Parameters
    ----------
    figures : by name.
    folder : that the files are written to; it is made if it is missing.
    stem : first part of the file names.
    form : png, pdf or svg.
    stop : asked after each picture whether to leave out the others.

    Returns
    -------
    The files, in the order of the figures.

    Raises
    ------
    ResultFileError
        If a file cannot be written.
    """
    written = []
    for name, figure in figures.items():
        path = Path(folder) / f"{stem}_{name.replace('/', '_').replace(' ', '_')}.{form}"
        with replacement_file(path) as temporary:
            write(figure, temporary, form)
        written.append(path)
        if stop():
            break
    return written


def write(picture: Picture, target: Any, form: str = "png") -> None:
    """Draw a picture to a file or stream.

    Parameters
    ----------
    picture : to draw.
    target : path or binary stream.
    form : png, pdf or svg.
    """
    # a sixth of the time less than the default
    packed: dict[str, Any] = {"pil_kwargs": {"compress_level": 1}} if form == "png" else {}
    # letters are as wide as in PDF and SVG
    with rc_context({"text.hinting": "none", "agg.path.chunksize": MOST_AT_ONCE}), plain_text():
        figure = picture.figure()
        figure.set_dpi(DOTS_PER_INCH)
        # the canvas lays a figure out as it draws it; `savefig` would draw it once more for the layout alone
        canvas: Any = get_registered_canvas_class(form)(figure)
        getattr(canvas, f"print_{form}")(target, **packed)


@contextmanager
def plain_text() -> Iterator[None]:
    """Draw texts as they are written, whatever the user's settings: no dollar begins mathematics.

    A character that the font lacks is drawn as a box, without a warning.
    """
    literal: Any = {"text.parse_math": False, "text.usetex": False, "axes.formatter.use_mathtext": False}
    with rc_context(literal), warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"Glyph \d+ .* missing from", UserWarning)
        warnings.filterwarnings("ignore", r".*Matplotlib currently does not support .* natively", UserWarning)
        yield


_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


class PowersOfTen(LogFormatterSciNotation):
    """Numbers of a logarithmic axis: 0.01, 0.6 and 200, and from 10⁴ and 10⁻⁴ on powers of ten as plain text."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        """The text of a tick; empty where ticks are too close for one."""
        if not super().__call__(x, pos):
            return ""
        exponent = math.floor(math.log10(x) + 1e-9) if x > 0.0 else 0
        if abs(exponent) < 4:
            return f"{x:g}"
        factor = f"{x / 10.0**exponent:.3g}"
        return ("" if factor == "1" else f"{factor}×") + f"10{str(exponent).translate(_SUPERSCRIPTS)}"
