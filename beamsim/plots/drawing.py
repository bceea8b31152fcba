"""What all plots share: panels, curves on axes with units that can be told apart in grey print, legends."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator
from numpy.typing import ArrayLike

from beamsim.plots.style import Scale, scale_for
from beamsim.scenario.reporting import Limits
from beamsim.typing import Bools, Floats

MOST_CURVES = 6  # in one plot; more cannot be distinguished
DARK, RED, GREEN, PALE = "#0b3c5d", "#d1495b", "#3a7d44", "0.65"
FARTHEST = 4.0  # of the largest value drawn: a line beyond that would leave no room for the curves
WIDE = 8.0  # ratio of the ends of an axis of frequency from which it is logarithmic
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


Axis = tuple[str, str | Scale]  # words, and the SI unit or the scale in which it is shown


class Curve(NamedTuple):
    """A curve in SI units; what its style leaves open follows from its number."""

    label: str
    x: Floats
    y: Floats
    style: dict[str, Any] = {}  # noqa: RUF012 - never changed


def marked(label: str, places: Any, **style: Any) -> Curve:
    """Places (n, 2) in SI units with marks that no line joins."""
    x, y = np.reshape(places, (-1, 2)).T
    return Curve(label, x, y, {"linestyle": "none", **style})


class Guide(NamedTuple):
    """A line across a panel that curves are compared with, in SI units."""

    label: str
    value: float
    style: dict[str, Any] = {}  # noqa: RUF012 - never changed


def limit_levels(limits: Limits | None, name: str, *, both_signs: bool = False) -> list[Guide]:
    """The limit ``name``, where there is one.

    Parameters
    ----------
    limits : of the scenario; None without any.
    name : of the limit.
    both_signs : whether its negative is a limit, too.

    Returns
    -------
    No line, one or two.
    """
    limit = None if limits is None else limits.given.get(name)
    if limit is None:
        return []
    style = {"linestyle": ":", "linewidth": 1.6}
    return [Guide("limit", limit, style), *([Guide("", -limit, style)] if both_signs else [])]


class Chart(NamedTuple):
    """Curves over common axes: what `draw_curves` draws, and what a page for a browser shows."""

    across: Axis
    up: Axis
    curves: Sequence[Curve]
    levels: Sequence[Guide] = ()
    log: str = ""
    of: str = "curves"


def picture(
    title: str,
    *plots: Chart | Callable[[Axes], Any],
    columns: int = 1,
    size: tuple[float, float] | None = None,
    **options: Any,
) -> Figure:
    """A figure with its title at the left edge and a panel for each plot, row by row.

    Parameters
    ----------
    title : of the figure; none where empty.
    plots : charts, or functions that draw on the Axes that they are given.
    columns : panels in a row.
    size : (width, height) of the figure, inches; by default from the number of rows.
    options : of `matplotlib.figure.Figure.subplots`.

    Returns
    -------
    Its axes are the panels in the order of the plots.
    """
    rows = -(-len(plots) // columns)
    figure = Figure(figsize=size or (8.0, max(4.4, 2.8 * rows)), layout="constrained")
    axes = list(figure.subplots(rows, columns, squeeze=False, **options).ravel())
    for ax in axes[len(plots) :]:
        ax.remove()
    for ax, plot in zip(axes, plots, strict=False):
        if isinstance(plot, Chart):
            draw_curves(ax, *plot)
        else:
            plot(ax)
    if options.get("sharex"):
        for ax in axes[:-columns]:
            ax.set_xlabel("")
    if title:
        figure.suptitle(title, x=0.012, ha="left", fontsize="medium", color="0.3")
    return figure


def curve_style(index: int) -> dict[str, Any]:
    """Colour, dashes and width of curve number ``index`` of a plot."""
    k = index % len(_COLOURS)
    return {"color": _COLOURS[k], "linestyle": _DASHES[k], "linewidth": 1.1}


def scales_of(across: Axis, up: Axis, curves: Sequence[Curve]) -> tuple[Scale, Scale]:
    """Scales in which curves are shown over their axes.

    Parameters
    ----------
    across, up : words for the axis, and its SI unit or the scale in which it is shown.
    curves : whose values choose the prefixes of SI units.

    Returns
    -------
    Of the axis across, and of the one up.
    """
    x, y = (
        unit if isinstance(unit, Scale) else scale_for(unit, *(getattr(curve, name) for curve in curves))
        for (_, unit), name in ((across, "x"), (up, "y"))
    )
    return x, y


def draw_curves(
    ax: Axes,
    across: Axis,
    up: Axis,
    curves: Sequence[Curve],
    levels: Iterable[Guide] = (),
    log: str = "",
    of: str = "curves",
) -> tuple[Scale, Scale]:
    """Draw curves, label both axes with their units, and name the curves.

    Parameters
    ----------
    ax : to draw on.
    across, up : words for the axis, and its SI unit or the scale in which it is shown.
    curves : in SI units.
    levels : lines to compare with; on a linear axis those far above the curves would leave no room for them, and are
        left out.
    log : the letters of logarithmic axes.
    of : what the curves are of: the first `MOST_CURVES` are drawn, and the legend says of how many. All where empty.

    Returns
    -------
    Scales of the axis across, and of the one up.
    """
    drawn = list(curves)[: MOST_CURVES if of else None]
    x, y = scales_of(across, up, drawn)
    for k, curve in enumerate(drawn):
        style = {**curve_style(k), **curve.style}
        ax.plot(curve.x * x.factor, curve.y * y.factor, label=curve.label or "_nolegend_", **style)
    largest = max((float(np.nanmax(np.abs(curve.y), initial=0.0)) for curve in drawn), default=0.0)
    near = [level for level in levels if "y" in log or abs(level.value) <= FARTHEST * largest]
    for level in near:
        style = {"color": "0.35", **level.style}
        ax.axhline(level.value * y.factor, label=level.label or "_nolegend_", **style)
    ax.set(**{f"{letter}scale": "log" for letter in log})
    finish(ax, with_unit(across[0], x), with_unit(up[0], y))
    legend(ax, f"{len(drawn)} of {len(curves)} {of}" if len(curves) > len(drawn) else "", least=1 if near else 2)
    return x, y


def with_unit(words: str, scale: Scale) -> str:
    """Label of an axis."""
    return f"{words} ({scale.unit})" if scale.unit else words


def finish(ax: Axes, xlabel: str, ylabel: str) -> None:
    """Labels, grid and frame.

    Parameters
    ----------
    ax : to be finished.
    xlabel, ylabel : of its axes, with their units.
    """
    ax.set_xlabel(xlabel)
    ax.set_ylabel(ylabel)
    ax.grid(visible=True, color="0.88", linewidth=0.6)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)


def plain_logarithmic(axis: Any) -> None:
    """A logarithmic axis with 1, 2, 5 a decade, written out."""
    axis.axes.set(**{f"{axis.axis_name}scale": "log"})
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter("{x:g}")


def frequency_axis(ax: Axes, low: float, high: float) -> None:
    """An axis of frequency, logarithmic where it is wide.

    Parameters
    ----------
    ax : whose axis across is of frequency.
    low, high : its ends, in the unit shown.
    """
    ax.set_xlim(low, high)
    if high > WIDE * low > 0.0:
        plain_logarithmic(ax.xaxis)


def legend(ax: Axes, title: str = "", *, least: int = 2) -> None:
    """A legend above the panel, as wide as it, if it has a title or enough entries.

    Parameters
    ----------
    ax : whose labelled lines are listed.
    title : of the legend; beside the panel without one if nothing is labelled.
    least : entries without a title from which there is a legend.
    """
    labels = ax.get_legend_handles_labels()[1]
    if len(labels) >= (1 if title else least):
        ax.legend(
            title=title or None, loc="lower right", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize="small",
            title_fontsize="small", borderaxespad=0.1, handlelength=2.6, ncols=_columns(labels, ax.bbox.width),
        )  # fmt: skip
    elif title:
        ax.set_title(title, loc="right", fontsize="small")


def _columns(labels: Sequence[str], width: float) -> int:
    """Of a legend: letters are 6 pixels wide, and the mark before each label as 6 of them."""
    return max(1, min(len(labels), int(width / (6.0 * (max(map(len, labels)) + 6)))))


def legend_below(figure: Figure) -> Figure:
    """One of each mark that any panel has a label for, below all panels; returns the figure."""
    marks = {str(line.get_label()): line for ax in figure.axes for line in ax.lines}
    shown = {label: line for label, line in marks.items() if not label.startswith("_")}
    if shown:
        figure.legend(
            list(shown.values()), list(shown), loc="outside lower center", frameon=False, fontsize="small",
            ncols=_columns(list(shown), figure.bbox.width),
        )  # fmt: skip
    return figure


def colour_bar(ax: Axes, mappable: Any, label: str) -> Any:
    """A bar of colours beside a panel.

    Parameters
    ----------
    ax : the panel.
    mappable : what is drawn on it in colours.
    label : of the bar, with its unit.

    Returns
    -------
    `matplotlib.colorbar.Colorbar`
    """
    assert ax.figure is not None
    return ax.figure.colorbar(mappable, ax=ax, label=label)


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


def beside(chosen: Bools) -> Bools:
    """Whether a point is chosen or next to one that is, so that curves of chosen points have no holes."""
    return np.asarray(chosen | np.append(chosen[1:], False) | np.append(False, chosen[:-1]))


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


def name_beside(ax: Axes, places: Mapping[str, tuple[float, float]]) -> None:
    """Names of places (data coordinates) in a column right of the panel, ordered by height, with leaders."""
    ordered = sorted(places, key=lambda name: -places[name][1])
    for name, height in zip(ordered, np.linspace(1.0, 0.0, 2 * len(ordered) + 1)[1::2], strict=True):
        ax.annotate(
            name, places[name], xytext=(1.02, float(height)), textcoords="axes fraction", va="center", fontsize="small",
            color="0.25", arrowprops={"arrowstyle": "-", "color": "0.6", "linewidth": 0.5, "shrinkA": 0, "shrinkB": 1},
        )  # fmt: skip
