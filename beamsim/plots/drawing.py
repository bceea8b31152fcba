"""What all plots share: panels, curves on axes with units that can be told apart in grey print, legends."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator
from numpy.typing import ArrayLike

from beamsim.plots.style import Scale, plain_scale, scale_for
from beamsim.typing import Bools, Floats

MOST_CURVES = 6  # in one plot; more cannot be distinguished
SMALL = (6.4, 4.4)  # of a picture with one panel, inches
SAME_CURVE = 0.01  # relative difference up to which two curves are drawn as one
DARK, RED, GREEN, PALE = "#0b3c5d", "#d1495b", "#3a7d44", "0.65"
FARTHEST = 4.0  # of the largest value drawn: a line beyond that would leave no room for the curves
WIDE = 8.0  # ratio of the ends of an axis of frequency from which it is logarithmic

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


class Curve(NamedTuple):
    """A curve in SI units; what its style leaves open follows from its number."""

    label: str
    x: Floats
    y: Floats
    style: dict[str, Any] = {}  # noqa: RUF012 - never changed


class Guide(NamedTuple):
    """A line across a panel that curves are compared with, in SI units."""

    label: str
    value: float
    style: dict[str, Any] = {}  # noqa: RUF012 - never changed


def panels(
    title: str, count: int = 1, columns: int = 1, size: tuple[float, float] = (8.0, 4.4), **options: Any
) -> tuple[Figure, list[Axes]]:
    """A figure with its title at the left edge, and its panels row by row.

    Parameters
    ----------
    size : (width, height) of the figure, inches.
    options : of `matplotlib.figure.Figure.subplots`.
    """
    figure = Figure(figsize=size, layout="constrained")
    axes = list(figure.subplots(-(-count // columns), columns, squeeze=False, **options).ravel())
    for ax in axes[count:]:
        ax.set_visible(False)
    put_title(figure, title)
    return figure, axes[:count]


def put_title(figure: Figure, text: str) -> None:
    """The title of a figure: what it is of, at its left edge."""
    if text:
        figure.suptitle(text, x=0.012, ha="left", fontsize="medium", color="0.3")


def curve_style(index: int) -> dict[str, Any]:
    """Colour, dashes and width of curve number ``index`` of a plot."""
    k = index % len(_COLOURS)
    return {"color": _COLOURS[k], "linestyle": _DASHES[k], "linewidth": 1.1}


def draw_curves(
    ax: Axes,
    across: tuple[str, str | Scale],
    up: tuple[str, str | Scale],
    curves: Sequence[Curve],
    levels: Iterable[Guide] = (),
    *,
    of: str = "curves",
    known: int = 0,
) -> tuple[Scale, Scale]:
    """Draw curves, label both axes with their units, and name the curves; returns the scales of the axes.

    Parameters
    ----------
    across, up : words for the axis, and its SI unit or the scale in which it is shown.
    levels : lines to compare with, see `draw_levels`.
    of, known : what the curves are of, and how many there are, if not all are given.
    """
    drawn, known = list(curves)[:MOST_CURVES], max(known, len(curves))
    x, y = (
        unit if isinstance(unit, Scale) else scale_for(unit, *(getattr(curve, name) for curve in drawn))
        for (_, unit), name in ((across, "x"), (up, "y"))
    )
    for k, curve in enumerate(drawn):
        style = {**curve_style(k), **curve.style}
        ax.plot(curve.x * x.factor, curve.y * y.factor, label=curve.label or "_nolegend_", **style)
    draw_levels(ax, levels, max((float(np.nanmax(np.abs(curve.y), initial=0.0)) for curve in drawn), default=0.0), y)
    finish(ax, with_unit(across[0], x), with_unit(up[0], y))
    legend(ax, f"{len(drawn)} of {known} {of}" if known > len(drawn) else "", least=1 if ax.lines[len(drawn) :] else 2)
    return x, y


def draw_levels(ax: Axes, levels: Iterable[Guide], largest: float, scale: Scale) -> None:
    """Lines to compare curves with, whose largest magnitude is given; those far above would leave no room for them."""
    for level in levels:
        if abs(level.value) <= FARTHEST * largest:
            style = {"color": "0.35", **level.style}
            ax.axhline(level.value * scale.factor, label=level.label or "_nolegend_", **style)


def with_unit(words: str, scale: Scale) -> str:
    """Label of an axis."""
    return f"{words} ({scale.unit})" if scale.unit else words


def finish(ax: Axes, xlabel: str, ylabel: str) -> None:
    """Labels, grid and frame."""
    ax.set_xlabel(xlabel)
    ax.set_ylabel(ylabel)
    ax.grid(visible=True, color="0.88", linewidth=0.6)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)


def finish_positions(ax: Axes) -> None:
    """Label an axis of positions that are drawn in metres: in the unit chosen for lengths, if there is one."""
    scale = plain_scale("m")
    ax.set_xlabel(f"x ({scale.unit})")
    if scale.unit != "m":
        ax.xaxis.set_major_formatter(lambda x, _: f"{x * scale.factor:.4g}")


def plain_logarithmic(axis: Any) -> None:
    """A logarithmic axis with 1, 2, 5 a decade, written out."""
    axis.axes.set(**{f"{axis.axis_name}scale": "log"})
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter("{x:g}")


def frequency_axis(ax: Axes, low: float, high: float) -> None:
    """From ``low`` to ``high``, logarithmic where that is wide."""
    ax.set_xlim(low, high)
    if high > WIDE * low > 0.0:
        plain_logarithmic(ax.xaxis)


def legend_columns(ax: Axes, most: int) -> int:
    """In how many columns the labelled curves fit into the width of a panel, at most."""
    figure, place = ax.figure, ax.get_subplotspec()
    longest = max(map(len, ax.get_legend_handles_labels()[1]), default=0)
    if figure is None or longest == 0:
        return most
    beside = 1 if place is None else place.get_gridspec().ncols
    letters = 13.0 * figure.bbox.width / figure.get_dpi() / beside  # 13 an inch, and 6 for the line before each label
    return max(1, min(most, int(letters / (longest + 6))))


def legend(ax: Axes, title: str = "", *, least: int = 2) -> None:
    """A legend above the panel, if it has a title or at least so many entries."""
    entries = len(ax.get_legend_handles_labels()[1])
    if entries >= (1 if title else least):
        columns = legend_columns(ax, min(entries, 6))
        ax.legend(
            title=title or None, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=columns, frameon=False,
            fontsize="small", title_fontsize="small", borderaxespad=0.1, handlelength=2.6,
        )  # fmt: skip
    elif title:
        ax.set_title(title, loc="right", fontsize="small")


def legend_below(figure: Figure, axes: Iterable[Axes]) -> None:
    """One of each mark that any panel has a label for, below all panels."""
    marks = {str(line.get_label()): line for ax in axes for line in ax.lines}
    shown = {label: line for label, line in marks.items() if not label.startswith("_")}
    if shown:
        figure.legend(
            list(shown.values()), list(shown), loc="outside lower center", ncols=min(len(shown), 6), frameon=False,
            fontsize="small",
        )  # fmt: skip


def colour_bar(ax: Axes, mappable: Any, label: str) -> Any:
    """A bar of colours beside a panel."""
    assert ax.figure is not None
    return ax.figure.colorbar(mappable, ax=ax, label=label)


def dashed_line(ax: Axes, x: ArrayLike, y: ArrayLike, label: str) -> None:
    """A line on coloured areas: white dashes on black, to be seen on dark and light ones; with a legend if labelled."""
    ax.plot(x, y, color="black", linewidth=2.4)
    ax.plot(x, y, color="white", linestyle=(0, (4, 3)), linewidth=1.2, label=label or None)
    if label:
        ax.legend(
            loc="upper left", fontsize="small", labelcolor="white", facecolor="black", framealpha=0.7, edgecolor="none"
        )


def beside(chosen: Bools) -> Bools:
    """Whether a point is chosen or next to one that is, so that curves of chosen points have no holes."""
    return np.asarray(chosen | np.append(chosen[1:], False) | np.append(False, chosen[:-1]))


def where_other(first: Floats, second: Floats) -> Floats:
    """The second of two curves where it differs from the first by 1 %, and a point beside that; else nan."""
    with np.errstate(divide="ignore", invalid="ignore"):
        other = np.abs(second / first - 1.0) > SAME_CURVE
    return np.where(beside(other), second, np.nan)


def thinned(time: Floats, x: Floats, most: int = 40_000, begin: int = 0) -> tuple[Floats, Floats]:
    """The same curve with at most about ``most`` points: the minimum and maximum of every few samples.

    Parameters
    ----------
    time, x : (n,) arrays.
    most : number of points that is kept as it is.
    begin : number of the first sample.
    """
    count = x.size - begin
    length = -(-2 * count // most)
    if count <= most or length < 3:
        return time[begin:], x[begin:]
    time, x = time[begin:], x[begin:]
    whole = x.size // length * length
    blocks = x[:whole].reshape(-1, length)
    first = np.arange(blocks.shape[0]) * length
    pick = np.sort(np.stack([first + blocks.argmin(axis=1), first + blocks.argmax(axis=1)], axis=1), axis=1).ravel()
    pick = np.append(pick, np.arange(whole, x.size))
    return time[pick], x[pick]


def highest_in_bins(f: Floats, values: Floats, *, mean: bool = False) -> tuple[Floats, Floats]:
    """By increasing frequency; of many points the highest (or mean) value of each of 700 bins.

    Parameters
    ----------
    f, values : (n,) of the cycles of a sweep.
    """
    order = np.argsort(f, kind="stable")
    f, values = f[order], values[order]
    if f.size <= 1400:
        return f, values
    first = np.unique(np.searchsorted(f, np.geomspace(f[0], f[-1], 701)[:-1]))
    count = np.diff(np.append(first, f.size))
    of_bins = np.add.reduceat(values, first) / count if mean else np.maximum.reduceat(values, first)
    return np.add.reduceat(f, first) / count, of_bins


def name_beside(ax: Axes, places: Mapping[str, tuple[float, float]]) -> None:
    """Names of places (data coordinates) in a column right of the panel, ordered by height, with leaders."""
    ordered = sorted(places, key=lambda name: -places[name][1])
    for name, height in zip(ordered, np.linspace(1.0, 0.0, 2 * len(ordered) + 1)[1::2], strict=True):
        ax.annotate(
            name, places[name], xytext=(1.02, float(height)), textcoords="axes fraction", va="center", fontsize="small",
            color="0.25", arrowprops={"arrowstyle": "-", "color": "0.6", "linewidth": 0.5, "shrinkA": 0, "shrinkB": 1},
        )  # fmt: skip
