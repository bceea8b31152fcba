"""Plots of a design study: curves over one parameter, maps over two, a matrix of scatter plots over more."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator

from beamsim.analyses.designs.choice import Objective
from beamsim.analyses.designs.realisations import judged
from beamsim.analyses.designs.result import Coordinate, DesignsResult, Response, SobolIndices, responses_of
from beamsim.plots.drawing import (
    DARK,
    MOST_CURVES,
    RED,
    Curve,
    Guide,
    colour_bar,
    curve_style,
    draw_curves,
    finish,
    panels,
    plain_logarithmic,
    with_unit,
)
from beamsim.plots.style import scale_for
from beamsim.scenario.limits import OF_OUTPUTS
from beamsim.typing import Floats

SHOWN = (
    "peak_displacement", "peak_force", "bending_stress", "contact_share", "resonance_frequency", "largest_gap",
    "closed_frequencies_hz", "open_frequencies_hz", "peak_acceleration",
)  # fmt: skip
MOST_PANELS = 6
MOST_MODES = 3
MOST_SLICES = 4  # maps of one response of three or more parameters
MOST_SLICED = 3  # responses
CONTOURS = 5
BESIDE_LIMIT = 0.05  # of the range of values; a contour that is closer to that of the limit is left out
MOST_TICKS = 6  # values of an axis that are all written out
LIGHT = 0.55  # of the range of colours
MOST_NUMBERED = (12, 6)  # rows and columns of a map whose cells have room for numbers
FEWEST_ALONG = 3  # cases along both axes of a map with contours: between fewer they would show the interpolation alone
MOST_PARAMETERS = 6  # columns of a matrix
NAMED = {
    "closed_frequencies_hz": "Natural frequencies, closed",
    "open_frequencies_hz": "Natural frequencies, open",
    "contact_share": "Share of time in contact",
}
LIMITING = {"largest_gap": "gap"}  # quantity -> limit, where the names differ
_PEAK = "/peak_output"


def shown_quantities(result: DesignsResult) -> list[str]:
    """The quantities to plot, by importance: those that vary."""
    known = dict.fromkeys(_quantity(r) for r in result.responses.values())
    peaks = [q for q in known if q.endswith(_PEAK)]
    ranked = [q for q in SHOWN if q in known] + peaks
    ranked += [q for q in known if q not in (*SHOWN, *peaks) and not q.endswith("_output") and len(ranked) < 3]
    objective = Objective.of(result.scenario.vary).response
    limited = [q for q in ranked if f"/{objective}".endswith(f"/{q}") or _limit(result, q) is not None]
    ranked = limited + [q for q in ranked if q not in limited]
    return [q for q in ranked if any(_varies(r) for r in _of(result, q))][:MOST_PANELS] or ranked[:1]


def plot_response_curves(result: DesignsResult, ax: Axes, quantity: str) -> Axes:
    """A quantity at every place where it is known, over the first parameter, with its limit."""
    x, label = _axis(result.coordinates[0])
    order = np.argsort(x, kind="stable")
    marks = {"marker": "o" if x.size <= 30 else "", "markersize": 3}
    curves = [Curve(name, x[order], values[order], marks) for name, values in _curves(_of(result, quantity))]
    across, up = (label, ""), (_words(quantity), _of(result, quantity)[0].unit)
    _, scale = draw_curves(ax, across, up, curves, _limit_level(result, quantity))
    for k, curve in enumerate(curves[:MOST_CURVES]):
        if (band := _band(result, quantity, curve.label)) is not None:
            low, high = (values[order] * scale.factor for values in band)
            ax.fill_between(x[order], low, high, color=curve_style(k)["color"], alpha=0.18, linewidth=0)
    _ticks_along(ax.xaxis, result.coordinates[0])
    return ax


def _limit_level(result: DesignsResult, quantity: str) -> list[Guide]:
    limit = _limit(result, quantity)
    return [] if limit is None else [Guide("limit", limit, {"color": RED, "linewidth": 1.4})]


def plot_response_map(
    result: DesignsResult, ax: Axes, response: Response, at: tuple[int, ...] = (), best: int | None = None
) -> Axes:
    """One response over the first two parameters of a grid, with labelled contours, its limit and the best case.

    The cells of small maps have numbers instead, and those beyond the limit an outline: contours would show the
    interpolation alone.

    Parameters
    ----------
    at : numbers of the values of all further parameters.
    best : number of the best case, which is marked if it is on the map.
    """
    (x, xlabel), (y, ylabel) = (_axis(c) for c in result.coordinates[:2])
    quantity = _quantity(response)
    scale = scale_for(response.unit, response.values)
    every: Any = np.ma.masked_invalid(response.values * scale.factor)
    values = every[(slice(None), slice(None), *at)].T
    edges = _edges(x, result.coordinates[0]), _edges(y, result.coordinates[1])
    mesh = ax.pcolormesh(*edges, values, cmap="cividis", vmin=every.min(), vmax=every.max())
    where = f", {response.place}" if response.place else ""
    bar = colour_bar(ax, mesh, with_unit(_words(quantity), scale) + where)
    limit = _limit(result, quantity)
    shown_limit = None if limit is None else limit * scale.factor
    starred = None if best is None else tuple(int(k) for k in np.unravel_index(best, result.shape))
    if starred is not None and starred[2:] != at:
        starred = None
    if all(size <= most for size, most in zip(values.shape, MOST_NUMBERED, strict=True)):
        _write_cells(ax, x, y, values, mesh.norm, starred)
        if shown_limit is not None:
            _outline_beyond(ax, *edges, values > shown_limit)
    else:
        if min(values.shape) > 1 and values.count():
            _draw_contours(ax, x, y, values, shown_limit)
        if starred is not None:
            i, j = starred[:2]
            ax.plot(x[i], y[j], marker="*", markersize=11, color="white", markeredgecolor="black", clip_on=False)
    if shown_limit is not None:
        bar.ax.axhline(shown_limit, color=RED, linewidth=1.8)
    for axis, coordinate in zip((ax.xaxis, ax.yaxis), result.coordinates, strict=False):
        _ticks_along(axis, coordinate)
    finish(ax, xlabel, ylabel)
    ax.grid(visible=False)
    return ax


def _draw_contours(ax: Axes, x: Floats, y: Floats, values: Any, limit: float | None) -> None:
    """Labelled contours, that of the limit in its own colour and thick, with a white edge in grey print."""
    low, high = float(values.min()), float(values.max())
    within = limit if limit is not None and low < limit < high else None
    levels = [
        level
        for level in MaxNLocator(CONTOURS + 1, min_n_ticks=1).tick_values(low, high)
        if low < level < high and (within is None or abs(level - within) >= BESIDE_LIMIT * (high - low))
    ]
    if levels and min(values.shape) >= FEWEST_ALONG and high - low > 1e-9 * max(abs(low), abs(high)):
        _outlined(ax, ax.contour(x, y, values, levels=levels, colors="white", linewidths=0.6), "%g", "0.2", 1.5)
    if within is not None:
        line = ax.contour(x, y, values, levels=[within], colors=RED, linewidths=1.8)
        _outlined(ax, line, {within: "limit"}, "white", 3.4)


def _outlined(ax: Axes, lines: Any, text: Any, colour: str, width: float) -> None:
    """Label contours, and give them an edge by which they are seen on light and dark cells."""
    edge: Any = [withStroke(linewidth=width, foreground=colour)]
    for drawn in (lines, *ax.clabel(lines, fontsize="x-small", fmt=text)):
        drawn.set_path_effects(edge)


def _write_cells(ax: Axes, x: Floats, y: Floats, values: Any, norm: Any, starred: tuple[int, ...] | None) -> None:
    """The number in every cell, black on light ones, with a star in the best case."""
    for j, i in zip(*np.nonzero(~np.ma.getmaskarray(values)), strict=True):
        value = values[j, i]
        star = "★ " if starred is not None and (i, j) == starred[:2] else ""
        ax.text(
            x[i], y[j], f"{star}{value:.3g}", ha="center", va="center", clip_on=True,
            fontsize="small" if star else "x-small", fontweight="bold" if star else "normal",
            color="black" if norm(value) > LIGHT else "white",
        )  # fmt: skip


def _outline_beyond(ax: Axes, x: Floats, y: Floats, beyond: Any) -> None:
    """A line between the cells (edges ``x`` and ``y``) beyond the limit and the others, white beside it for grey."""

    cells = np.ma.filled(beyond, False)
    rows, columns = (np.nonzero(np.diff(cells, axis=axis)) for axis in (0, 1))
    sides = [[(x[i], y[j + 1]), (x[i + 1], y[j + 1])] for j, i in zip(*rows, strict=True)]
    sides += [[(x[i + 1], y[j]), (x[i + 1], y[j + 1])] for j, i in zip(*columns, strict=True)]
    edge: Any = [withStroke(linewidth=3.8, foreground="white")]
    ax.add_collection(LineCollection(sides, colors=RED, linewidths=2.0, path_effects=edge), autolim=False)


def _ticks_along(axis: Any, coordinate: Coordinate) -> None:
    """Words, or numbers, all of which are written out if they are few."""
    values, words = np.unique(_axis(coordinate)[0]), _tick_words(coordinate)
    if _logarithmic(coordinate):
        plain_logarithmic(axis)
    if words:
        axis.set_ticks(np.arange(len(words)), words)
    elif values.size <= MOST_TICKS:
        axis.set_ticks(values, [f"{value:.4g}" for value in values])
    elif not _logarithmic(coordinate):
        axis.axes.locator_params(axis.axis_name, nbins=5)


def plot_sensitivity(result: DesignsResult, ax: Axes, indices: SobolIndices) -> Axes:
    """Sobol' indices of a response: first and total of every parameter, with their 95 % intervals."""
    place = np.arange(len(result.coordinates))
    for shift, name, values, low, high, colour in (
        (-0.2, "alone", indices.first_order, indices.first_order_low, indices.first_order_high, "#8fb8de"),
        (0.2, "with interactions", indices.total_order, indices.total_order_low, indices.total_order_high, "#0b3c5d"),
    ):
        spread = np.abs(np.stack([np.minimum(low - values, 0.0), np.maximum(high - values, 0.0)]))
        ax.barh(place + shift, 100.0 * values, 0.38, label=name, color=colour)
        ax.errorbar(
            100.0 * values, place + shift, xerr=100.0 * spread, fmt="none", ecolor="0.35", elinewidth=0.9, capsize=2
        )
    ax.set_yticks(place, [c.label for c in result.coordinates])
    ax.invert_yaxis()
    ax.set_xlim(left=min(0.0, ax.get_xlim()[0]))
    response = result.responses[indices.name]
    ax.set_title(
        f"{_words(_quantity(response))}{f', {response.place}' if response.place else ''}", fontsize="small", loc="left"
    )
    finish(ax, "Share of the variance (%)", "")
    return ax


def plot_response_scatter(result: DesignsResult, ax: Axes, coordinate: int, quantity: str) -> Axes:
    """A quantity (largest over all places) of every case over one parameter; cases beyond the limit are marked."""
    x, label = _axis(result.coordinates[coordinate])
    along, values = _cases(result, coordinate, x), _worst(result, quantity)
    limit = _limit(result, quantity)
    beyond = np.zeros(values.size, dtype=bool) if limit is None else values > limit
    kinds = ((~beyond, {"marker": ".", "color": DARK, "markersize": 3}), (beyond, {"marker": "x", "color": RED}))
    curves = [
        Curve("", along[which], values[which], {"linestyle": "none", "markersize": 4, **style})
        for which, style in kinds
    ]
    up = (_words(quantity), scale_for(_of(result, quantity)[0].unit, values))
    draw_curves(ax, (label, ""), up, curves, [level._replace(label="") for level in _limit_level(result, quantity)])
    _ticks_along(ax.xaxis, result.coordinates[coordinate])
    return ax


def _judgement(result: DesignsResult) -> str:
    """What a study with tolerances shows."""
    tolerances = result.summary.get("tolerances")
    if tolerances is None:
        return ""
    if len(result.coordinates) == 1 or result.kind == "zip":
        return f"   (bands: {tolerances['realisations']} realisations within the tolerances)"
    which = "worst" if tolerances["quantile"] == 1.0 else f"{100 * tolerances['quantile']:.4g} % quantile"
    return f"   ({which} of {tolerances['realisations']} realisations within the tolerances)"


def design_figures(result: DesignsResult) -> dict[str, Figure]:
    """All plots available for this study; the key is the last part of the file name."""
    if not np.any(result.solved):
        return {}
    best = result.summary["best"][0]["case"] if result.summary.get("best") else None
    title = result.title + _judgement(result)
    starred = title + (f"   (star: best case, {result.summary['objective']})" if best is not None else "")
    quantities, dimensions = shown_quantities(result), len(result.coordinates)
    if dimensions == 1 or result.kind == "zip":
        figure, axes = _grid(title, len(quantities), 2, (5.2, 3.2))
        for ax, quantity in zip(axes, quantities, strict=True):
            plot_response_curves(result, ax, quantity)
        return {"curves": figure}
    figures: dict[str, Figure] = {}
    maps = [r for q in quantities for r in _of(result, q)[:2] if r.values.ndim == dimensions and _varies(r)]
    if result.kind == "grid" and min(result.shape[:2]) > 1 and maps:
        if dimensions == 2:
            figure, axes = _grid(starred, len(maps[:MOST_PANELS]), 2, (5.2, 3.6))
            for ax, response in zip(axes, maps, strict=False):
                plot_response_map(result, ax, _as_judged(result, response), (), best)
            return {"maps": figure}
        figures["slices"] = _slice_maps(result, maps, best, starred)
    if result.sensitivity:
        figures["sensitivity"] = _sensitivities(result, quantities, title)
    scalar = [q for q in quantities if any(r.values.shape == result.shape for r in _of(result, q))][:4]
    columns = min(dimensions, MOST_PARAMETERS)
    figures["scatter"], axes = _grid(title, len(scalar) * columns, columns, (2.9, 2.4))
    for k, ax in enumerate(axes):
        row, column = divmod(k, columns)
        plot_response_scatter(result, ax, column, scalar[row])
        if row < len(scalar) - 1:
            ax.set_xlabel("")
        if column:
            ax.set_ylabel("")
    return figures


def _grid(title: str, count: int, columns: int, size: tuple[float, float]) -> tuple[Figure, list[Axes]]:
    """Panels of a size, inches, at most so many in a row."""
    columns = min(columns, count)
    return panels(title, count, columns, (size[0] * columns, size[1] * -(-count // columns)))


def _slice_maps(result: DesignsResult, maps: Sequence[Response], best: int | None, title: str) -> Figure:
    """A row for each of the first quantities, a map for each of some values of the further parameters."""
    places, rows = _slices(result, best), list({_quantity(r): r for r in reversed(maps)}.values())[::-1][:MOST_SLICED]
    figure, axes = _grid(title, len(rows) * len(places), len(places), (3.9, 3.1))
    for k, ax in enumerate(axes):
        at = places[k % len(places)]
        plot_response_map(result, ax, _as_judged(result, rows[k // len(places)]), at, best)
        text = ", ".join(_value_text(c, i) for c, i in zip(result.coordinates[2:], at, strict=True))
        ax.set_title(text, fontsize="small", loc="left")
    return figure


def _sensitivities(result: DesignsResult, quantities: Sequence[str], title: str) -> Figure:
    chosen = [s for q in quantities for s in result.sensitivity if _quantity(result.responses[s.name]) == q]
    chosen = (chosen or list(result.sensitivity))[:MOST_PANELS]
    figure, axes = _grid(title, len(chosen), 2, (4.8, 0.9 + 0.45 * len(result.coordinates)))
    for ax, indices in zip(axes, chosen, strict=True):
        plot_sensitivity(result, ax, indices)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2, fontsize="small", frameon=False)
    return figure


def _slices(result: DesignsResult, best: int | None) -> list[tuple[int, ...]]:
    """Of all parameters but the first two, numbers of the values at which maps are shown.

    The third takes up to `MOST_SLICES` of its values, the others that of the best case, or their middle.
    """
    further = result.shape[2:]
    middle = tuple(n // 2 for n in further)
    fixed = middle if best is None else tuple(int(k) for k in np.unravel_index(best, result.shape)[2:])
    along = {*np.linspace(0, further[0] - 1, min(further[0], MOST_SLICES)).round().astype(int).tolist()}
    if best is not None and fixed[0] not in along:
        along.remove(min(along, key=lambda k: abs(k - fixed[0])))
        along.add(fixed[0])
    return [(k, *fixed[1:]) for k in sorted(along)]


def _band(result: DesignsResult, quantity: str, place: str) -> tuple[Floats, Floats] | None:
    """The smallest and largest value of each case within the tolerances."""
    names = [r.name for r in _of(result, quantity) if r.place == place and r.name in result.realised]
    if not names:
        return None
    values = result.realised[names[0]].values
    return values.min(axis=-1), values.max(axis=-1)


def _quantity(response: Response) -> str:
    """Of an output with its name, as each has a unit of its own."""
    return "/".join(response.name.split("/")[-2:]) if response.quantity.endswith("_output") else response.quantity


def _of(result: DesignsResult, quantity: str) -> list[Response]:
    return [r for r in result.responses.values() if _quantity(r) == quantity]


def _as_judged(result: DesignsResult, response: Response) -> Response:
    """A response with the values by which cases are judged, where there are tolerances."""
    if response.name not in result.realised:
        return response
    objective = Objective.of(result.scenario.vary)
    asked = {r.name for r in responses_of(result.responses, objective.response)}
    good = objective.largest and response.name in asked
    quantile = result.summary["tolerances"]["quantile"]
    return replace(response, values=judged(result.realised[response.name], quantile, large_is_good=good))


def _varies(response: Response) -> bool:
    known = response.values[np.isfinite(response.values)]
    return bool(known.size) and bool(np.ptp(known) > 1e-12 * np.max(np.abs(known)))


def _curves(responses: Sequence[Response]) -> Iterator[tuple[str, Floats]]:
    for response in responses:
        if response.values.ndim == 1:
            yield response.place, response.values
        else:
            for k in range(min(MOST_MODES, response.values.shape[-1])):
                if not np.isfinite(response.values[..., k]).any():
                    continue  # a chain of two masses has no third mode
                yield f"{response.place} mode {k + 1}".strip(), response.values[..., k]


def _worst(result: DesignsResult, quantity: str) -> Floats:
    """Largest value over all places, for each case."""
    shown = [_as_judged(result, r) for r in _of(result, quantity) if r.values.shape == result.shape]
    values = np.stack([r.values.ravel() for r in shown])
    known = np.isfinite(values)
    worst = np.where(known, values, -np.inf).max(axis=0)
    return np.where(known.any(axis=0), worst, np.nan)


def _cases(result: DesignsResult, coordinate: int, x: Floats) -> Floats:
    """Value of a coordinate in every case."""
    if result.kind != "grid":
        return x
    return np.asarray(np.meshgrid(*[_axis(c)[0] for c in result.coordinates], indexing="ij")[coordinate]).ravel()


def _axis(coordinate: Coordinate) -> tuple[Floats, str]:
    """Values along the axis, words by their numbers, and the label of the axis."""
    name = coordinate.label[:1].upper() + coordinate.label[1:]
    if words := _tick_words(coordinate):
        return np.array([words.index(str(v)) for v in coordinate.values], dtype=float), name
    values = coordinate.values.astype(float)
    scale = scale_for(coordinate.unit, values)
    return values * scale.factor, with_unit(name, scale)


def _tick_words(coordinate: Coordinate) -> list[str]:
    """The different values, if they are words."""
    return [] if coordinate.numeric else list(dict.fromkeys(str(v) for v in coordinate.values))


def _value_text(coordinate: Coordinate, k: int) -> str:
    """``tip gap = 0.1 mm`` for value k of the axis."""
    if not coordinate.numeric:
        return f"{coordinate.label} = {coordinate.values[k]}"
    scale = scale_for(coordinate.unit, coordinate.values.astype(float))
    return f"{coordinate.label} = {coordinate.values[k] * scale.factor:.4g} {scale.unit}".rstrip()


def _logarithmic(coordinate: Coordinate) -> bool:
    if not coordinate.numeric:
        return False
    values = np.unique(coordinate.values.astype(float))
    if values.size < 3 or values[0] <= 0.0 or values[-1] / values[0] < 5.0:
        return False
    steps, ratios = np.diff(values), np.diff(np.log(values))
    return float(np.ptp(ratios) / ratios.mean()) < float(np.ptp(steps) / steps.mean())


def _edges(values: Floats, coordinate: Coordinate) -> Floats:
    """Edges of the cells around increasing or decreasing values."""
    logarithmic = _logarithmic(coordinate)
    v = np.log(values) if logarithmic else values
    inner = 0.5 * (v[1:] + v[:-1])
    edges = np.concatenate([[v[0] - (inner[0] - v[0])], inner, [v[-1] + (v[-1] - inner[-1])]])
    return np.exp(edges) if logarithmic else edges


def _limit(result: DesignsResult, quantity: str) -> float | None:
    if quantity.endswith(_PEAK):
        return result.limits.get(OF_OUTPUTS + quantity.removesuffix(_PEAK))
    return result.limits.get(LIMITING.get(quantity, quantity))


def _words(quantity: str) -> str:
    if quantity.endswith(_PEAK):
        return f"Peak of {quantity.removesuffix(_PEAK)}"
    return NAMED.get(quantity) or quantity.removesuffix("_hz").replace("_", " ").capitalize()
