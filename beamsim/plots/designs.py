"""Plots of a design study: curves over one parameter, maps over two, a matrix of scatter plots over more."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke

from beamsim.analyses.designs.result import (
    Coordinate,
    DesignsResult,
    Response,
    is_scalar,
    objectives,
    responses_of,
    varies,
)
from beamsim.plots.drawing import (
    DARK,
    MOST_CURVES,
    MOST_PANELS,
    PALE,
    RED,
    Chart,
    Curve,
    Guide,
    HeatMap,
    Picture,
    curve_style,
    finish,
    limit_levels,
    with_unit,
)
from beamsim.plots.style import Scale, amount, extent, scale_for
from beamsim.results.values import BY_NAME, OUTPUT, parameter_label
from beamsim.typing import Floats

SHOWN = (
    "peak_displacement", "peak_force", "bending_stress", "contact_share", "resonance_frequency", "largest_gap",
    "closed_frequencies_hz", "open_frequencies_hz", "peak_acceleration",
)  # fmt: skip
MOST_MODES = 3
MOST_SLICES = 4  # maps of one response of three or more parameters
MOST_SLICED = 3  # responses
MOST_NUMBERED = (12, 6)  # rows and columns of a map whose cells have room for numbers
MOST_BARS = 12
NAMED = {
    "closed_frequencies_hz": "Natural frequencies, closed",
    "open_frequencies_hz": "Natural frequencies, open",
    "contact_share": "Share of time in contact",
}


def shown_quantities(result: DesignsResult) -> list[str]:
    """The quantities to plot, by importance: those that vary."""
    known = dict.fromkeys(_quantity(r) for r in result.responses.values())
    ranked = [q for q in SHOWN if q in known] + [q for q in known if _peak_of_output(q)]
    ranked += [q for q in known if q not in ranked and "/" not in q][: max(3 - len(ranked), 0)]
    terms = [name for objective in objectives(result.scenario) for name, _ in objective.terms]
    asked = {_quantity(r) for name in terms for r in responses_of(result.responses, name)}
    limited = [q for q in ranked if q in asked or _limit(result, q) is not None]
    ranked = limited + [q for q in ranked if q not in limited]
    return [q for q in ranked if any(varies(r) for r in _of(result, q))][:MOST_PANELS] or ranked[:1]


def response_curves(result: DesignsResult, quantity: str) -> Chart:
    """A quantity at every place where it is known, over the first parameter, with its limit and the range within the
    tolerances."""
    coordinate = result.coordinates[0]
    x, label = _axis(coordinate)
    order = np.argsort(x, kind="stable")
    marks = {"marker": "o" if x.size <= 30 else "", "markersize": 3}
    if result.kind not in ("grid", "zip"):  # samples are in no order
        marks = {"marker": ".", "markersize": 3, "linestyle": "none"}
    curves = [Curve(name, x[order], values[order], marks) for name, values in _curves(_of(result, quantity))]

    def bands(ax: Axes, _: Scale, y: Scale) -> None:
        for k, curve in enumerate(curves[:MOST_CURVES]):
            if (band := _band(result, quantity, curve.label)) is not None:
                low, high = (values[order] * y.factor for values in band)
                ax.fill_between(curve.x, low, high, color=curve_style(k)["color"], alpha=0.18, linewidth=0)
        _write_words(ax, coordinate)

    up = (_words(quantity), _of(result, quantity)[0].unit)
    return Chart((label, ""), up, curves, _limit_level(result, quantity), log=_log(result, coordinate), more=bands)


def _limit_level(result: DesignsResult, quantity: str) -> list[Guide]:
    limit = _limit(result, quantity)
    return [] if limit is None else [Guide("limit", limit, {"color": RED, "linewidth": 1.4})]


def plot_response_map(
    result: DesignsResult, ax: Axes, response: Response, at: tuple[int, ...] = (), best: int | None = None
) -> None:
    """One response over the first two parameters of a grid, a cell for each case, crossed where beyond the limit.

    The cells of small maps have numbers, large maps have contours. The values of further parameters are above it.

    Parameters
    ----------
    result : of a grid of two or more parameters.
    ax : to draw on.
    response : with one value a case.
    at : numbers of the values of all further parameters.
    best : number of the best case, which is marked if it is on the map.
    """
    quantity = _quantity(response)
    scale, limit = scale_for(response.unit, response.values, digits=3), _limit(result, quantity)
    every: Any = np.ma.masked_invalid(response.values * scale.factor)
    values = every[(slice(None), slice(None), *at)].T
    beyond = np.ma.filled(values > (np.inf if limit is None else limit * scale.factor), False)
    cells = ax.imshow(values, origin="lower", aspect="auto", cmap="cividis", vmin=every.min(), vmax=every.max())
    bar = ax.figure.colorbar(cells, ax=ax, label=with_unit(_titled(response), scale))
    starred = () if best is None else tuple(int(k) for k in np.unravel_index(best, result.shape))
    star = starred[:2] if starred[2:] == at else ()
    if all(size <= most for size, most in zip(values.shape, MOST_NUMBERED, strict=True)):
        _write_cells(ax, values, beyond, cells.norm, star)
    else:
        lines = ax.contour(values, colors="white", linewidths=0.6)
        for drawn in (lines, *ax.clabel(lines, fontsize="x-small")):
            drawn.set_path_effects([withStroke(linewidth=1.5, foreground="0.2")])  # seen on light and dark cells
        if star:
            ax.plot(*star, marker="*", markersize=11, color="white", markeredgecolor="black", clip_on=False)
        ax.plot(*np.nonzero(beyond.T), linestyle="none", marker="x", markersize=3.5, color=RED)
    if limit is not None:
        bar.ax.axhline(limit * scale.factor, color=RED, linewidth=1.8)
    for axis, coordinate in zip((ax.xaxis, ax.yaxis), result.coordinates, strict=False):
        texts = [_value_text(coordinate, k) for k in range(coordinate.values.size)]
        shown = range(0, len(texts), -(-len(texts) // 4))
        axis.set_ticks(list(shown), [texts[k] for k in shown])
    finish(ax, *(_axis(coordinate)[1] for coordinate in result.coordinates[:2]))
    ax.grid(visible=False)
    further = zip(result.coordinates[2:], at, strict=True)
    ax.set_title(", ".join(f"{_axis(c)[1]}: {_value_text(c, k)}" for c, k in further), fontsize="small", loc="left")


def _write_cells(ax: Axes, values: Any, beyond: Any, norm: Any, star: tuple[int, ...]) -> None:
    """The number in every cell, black on light ones, with a star in the best case and a cross beyond the limit.

    Parameters
    ----------
    values, beyond : (ny, nx) masked numbers, and whether they are beyond the limit.
    norm : of the colours.
    star : (i, j) of the best case; empty where it is not on the map.
    """
    for j, i in zip(*np.nonzero(~np.ma.getmaskarray(values)), strict=True):
        best, text = (i, j) == star, f"{'✕ ' * bool(beyond[j, i])}{values[j, i]:.3g}"
        ax.text(
            i, j, f"★ {text}" if best else text, ha="center", va="center", fontsize="x-small",
            fontweight="bold" if best else "normal", color="black" if norm(values[j, i]) > 0.55 else "white",
        )  # fmt: skip


def _write_words(ax: Axes, coordinate: Coordinate) -> None:
    """Words in place of their numbers."""
    if words := _tick_words(coordinate):
        ax.set_xticks(np.arange(len(words)), words)


def plot_sensitivity(result: DesignsResult, ax: Axes, name: str) -> None:
    """What a response depends on, the most important parameter first.

    These are Sobol' indices with their 95 % intervals, ranges over each parameter alone (a tornado), or rank
    correlations.

    Parameters
    ----------
    result : of a study that has them.
    ax : to draw on.
    name : of the response.
    """
    of, response = result.summary["sensitivity"][name], result.responses[name]
    paths = sorted(of, key=lambda path: -_importance(of[path]))[:MOST_BARS]
    rows = np.arange(len(paths))

    def column(key: str) -> Floats:
        return np.array([of[path][key] for path in paths], dtype=float)

    if result.kind == "sobol":
        label = "Share of the variance (%)"
        for shift, order, meaning, colour in (
            (-0.2, "first_order", "alone", "#8fb8de"), (0.2, "total_order", "with interactions", DARK),
        ):  # fmt: skip
            values, low, high = (100.0 * column(f"{order}{end}") for end in ("", "_low", "_high"))
            spread = np.maximum([values - low, high - values], 0.0)
            ax.barh(rows + shift, values, 0.38, label=meaning, color=colour)
            ax.errorbar(values, rows + shift, xerr=spread, fmt="none", ecolor="0.35", elinewidth=0.9, capsize=2)
        ax.set_xlim(left=min(0.0, ax.get_xlim()[0]))
    elif result.kind == "one_at_a_time":
        scale = scale_for(response.unit, response.values)
        label, nominal = with_unit(_words(_quantity(response)), scale), float(response.values[0]) * scale.factor
        units = {c.path: c.unit for c in result.coordinates}
        for end, align in (("smallest", "right"), ("largest", "left")):
            values = column(end) * scale.factor
            ax.barh(rows, values - nominal, 0.6, nominal, color=DARK)
            for row, path in enumerate(paths):
                at = of[path][f"{end}_at"]
                text = at if isinstance(at, str) else amount(at, units[path])
                if values[row] != nominal:
                    ax.text(values[row], row, f" {text} ", ha=align, va="center", fontsize="x-small")
        ax.axvline(nominal, color="black", linewidth=0.9)
        ax.margins(x=0.4)
    else:
        label, values, chance = "Rank correlation", column("rank_correlation"), column("p_value") > 0.05
        ax.barh(rows[~chance], values[~chance], 0.6, color=DARK)
        ax.barh(rows, np.where(chance, values, 0.0), 0.6, color="0.8", label="may be chance" if chance.any() else "")
        ax.set(xlim=(-1.0, 1.0), xticks=(-1.0, -0.5, 0.0, 0.5, 1.0))
    ax.set_yticks(rows, [parameter_label(path) for path in paths])
    ax.invert_yaxis()
    ax.set_title(_titled(response), fontsize="small", loc="left")
    finish(ax, label, "")


def _importance(of: Mapping[str, Any]) -> float:
    """What ranks a parameter among those of a response."""
    if "largest" in of:
        return float(of["largest"] - of["smallest"])
    return abs(float(of["total_order"] if "total_order" in of else of["rank_correlation"]))


def histogram(result: DesignsResult, response: Response, values: Floats, of: Mapping[str, Any]) -> Chart:
    """How many cases have which value, a colour for each population, with the limit and the quantiles that are known.

    Parameters
    ----------
    result : of a sample.
    response : that the values are of.
    values : (cases,) of a sample, or of the realisations of one case; nan where not known.
    of : what the summary says of them.
    """
    known, limit = values[np.isfinite(values)], _limit(result, _quantity(response))
    edges = np.linspace(known.min(), known.max(), min(max(10, known.size // 5), 30) + 1)
    curves = []
    for k, group in enumerate(of.get("populations", [of])):
        own = known[(known >= group["smallest"]) & (known <= group["largest"])]
        heights = np.concatenate([[0.0], np.repeat(np.histogram(own, edges)[0], 2), [0.0]])
        cases = f"{extent(group['smallest'], group['largest'], response.unit)}, {own.size} cases"
        style = {**curve_style(k + 2 if k else 0), "linestyle": "-"}  # the second colour is that of the limit
        curves.append(Curve(cases if "populations" in of else "", np.repeat(edges, 2), heights, style))

    def more(ax: Axes, x: Scale, _: Scale) -> None:
        for curve in curves:
            ax.fill_between(curve.x * x.factor, curve.y, color=curve.style["color"], alpha=0.3, linewidth=0)
        at = {f"{percent} %": (of[f"quantile_{percent}_percent"], "0.35", "--") for percent in (5, 50, 95)}
        for text, (value, colour, dashes) in (at | ({} if limit is None else {"limit": (limit, RED, "-")})).items():
            ax.axvline(value * x.factor, color=colour, linewidth=1.2, linestyle=dashes)
            ax.text(
                value * x.factor, 0.98, text, transform=ax.get_xaxis_transform(), ha="right", va="top",
                fontsize="x-small", rotation=90, color=colour,
            )  # fmt: skip
        ax.margins(y=0.2)

    what = "Realisations of the best case" if "nominal" in of else "Cases"
    return Chart((_titled(response), response.unit), (what, ""), curves, more=more, y_ends=(0.0, None))


def _histograms(result: DesignsResult, quantities: Sequence[str]) -> Iterator[Chart]:
    """Of the responses that are shown of a sample, or of the best case within tolerances."""
    scatter = result.summary.get("scatter", {})
    said = scatter.get("responses", result.summary["responses"])
    for response in (r for q in quantities for r in _of(result, q)[:2]):
        values = response.values
        if scatter and response.name in result.realised:
            values = result.realised[response.name].values.reshape(result.cases, -1)[scatter["case"]]
        of = said.get(response.name, {})
        if "quantile_50_percent" in of and of["smallest"] < of["largest"]:
            yield histogram(result, response, values, of)


def response_scatter(result: DesignsResult, k: int, quantity: str) -> Chart:
    """A quantity (at its worst place) of every case over parameter k; cases beyond the limit are marked."""
    coordinate = result.coordinates[k]
    x, label = _axis(coordinate)
    known = [response for response in _of(result, quantity) if is_scalar(response, result.shape)]
    along, values = _cases(result, k, x), result.judged(*known).ravel()
    limit = _limit(result, quantity)
    beyond = np.zeros(values.size, dtype=bool) if limit is None else values > limit
    kinds = ((~beyond, {"marker": ".", "color": DARK, "markersize": 3}), (beyond, {"marker": "x", "color": RED}))
    curves = [
        Curve("", along[which], values[which], {"linestyle": "none", "markersize": 4, **style})
        for which, style in kinds
    ]
    up = (_words(quantity), scale_for(_of(result, quantity)[0].unit, values))
    levels = [level._replace(label="") for level in _limit_level(result, quantity)]
    return Chart(
        (label, ""), up, curves, levels, log=_log(result, coordinate), more=lambda ax, *_: _write_words(ax, coordinate)
    )


def _judgement(result: DesignsResult) -> str:
    """What a study with tolerances shows."""
    tolerances = result.summary.get("tolerances")
    if tolerances is None:
        return ""
    if len(result.coordinates) == 1 or result.kind == "zip":
        return f"   (bands: {tolerances['realisations']} realisations within the tolerances)"
    which = "worst" if tolerances["quantile"] == 1.0 else f"{100 * tolerances['quantile']:.4g} % quantile"
    return f"   ({which} of {tolerances['realisations']} realisations within the tolerances)"


def design_figures(result: DesignsResult) -> dict[str, Picture]:
    """All pictures of this study; the key is the last part of the file name."""
    if result.kind == "reliability":
        return {"probability": _probability(result)} if result.rounds else {}
    if not np.any(result.solved):
        return {}
    best = result.summary["best"][0]["case"] if result.summary.get("best") else None
    title = result.title + _judgement(result)
    quantities, dimensions = shown_quantities(result), len(result.coordinates)
    figures: dict[str, Picture] = _searched(result)
    if causes := _explained(result, quantities):
        shares = [partial(plot_sensitivity, result, name=name) for name in causes]
        size = 1.4 + 0.4 * min(dimensions, MOST_BARS)
        figures["sensitivity"] = _grid(title, shares, 2, size, width=5.0)._replace(legend_below=True)
    if result.kind == "one_at_a_time":
        return figures
    if counts := list(_histograms(result, quantities))[:MOST_PANELS]:
        figures["histograms"] = _grid(result.title, counts, 2, 3.0)
    if dimensions == 1 or result.kind == "zip":
        return {"curves": _grid(title, [response_curves(result, q) for q in quantities], 2, 3.2), **figures}
    maps = [r for q in quantities for r in _of(result, q)[:2] if r.values.ndim == dimensions and varies(r)]
    if result.kind == "grid" and min(result.shape[:2]) > 1 and maps:
        starred = title + (f"   (star: best case, {result.summary['objective']})" if best is not None else "")
        places = _slices(result, best)
        if dimensions > 2:
            maps = list({_quantity(r): r for r in reversed(maps)}.values())[::-1][:MOST_SLICED]
        plots = [_map(result, response, at, best) for response in maps[:MOST_PANELS] for at in places]
        figures["maps" if dimensions == 2 else "slices"] = _grid(starred, plots, max(len(places), 2), 3.4)
    if dimensions == 2 and "maps" in figures:
        return figures
    scalar = [q for q in quantities if any(is_scalar(r, result.shape) for r in _of(result, q))][:4]
    columns = min(dimensions, MOST_PANELS)
    cases = [response_scatter(result, k, q) for q in scalar for k in range(columns)]
    figures["scatter"] = _grid(title, cases, columns, 2.4)._replace(outer_labels=True)
    return figures


def search_chart(result: DesignsResult, objective: Response) -> Chart:
    """One objective of every design in the order in which they were tried, and the best one up to there."""
    values, number, dots = objective.values, np.arange(1.0, result.cases + 1.0), {"linestyle": "none", "markersize": 3}
    meets = np.isfinite(values) & (True if result.passing is None else result.passing)
    largest = objective.long_name.startswith("largest")
    tried = np.where(meets & (number > 1.0), values, -np.inf if largest else np.inf)  # the first one is as it is
    best = (np.maximum if largest else np.minimum).accumulate(tried)
    curves = [
        Curve("beyond a limit", number[~meets], values[~meets], {**dots, "marker": "x", "color": RED, "alpha": 0.5}),
        Curve("meets every limit", number[meets], values[meets], {**dots, "marker": "o", "color": PALE}),
        Curve("best so far", number, np.where(np.isfinite(best), best, np.nan),
              {"color": DARK, "linestyle": "-", "drawstyle": "steps-post"}),
    ]  # fmt: skip
    return Chart(("Number of the design", ""), _axis_of(objective), curves if result.limits else curves[1:])


def front_chart(result: DesignsResult, x: Response, y: Response) -> Chart:
    """Two objectives of all designs that meet every limit, and the front of those that none is better than in both.

    Parameters
    ----------
    result : of a search for two objectives.
    x, y : the objectives.
    """
    front = np.flatnonzero(np.asarray(result.front))
    front = front[np.argsort(x.values[front])]
    others = np.flatnonzero(~np.asarray(result.front) & (True if result.passing is None else result.passing))
    curves = [
        Curve(label, x.values[which], y.values[which], style)
        for label, which, style in (
            ("dominated", others, {"linestyle": "none", "marker": ".", "markersize": 3, "color": PALE}),
            ("front", front, {"linestyle": "-", "linewidth": 0.8, "marker": "o", "markersize": 3.5, "color": DARK}),
            ("as it is", np.array([0]), {"linestyle": "none", "marker": "D", "markersize": 5, "color": RED}),
        )
    ]
    return Chart(_axis_of(x), _axis_of(y), curves)


def _axis_of(objective: Response) -> tuple[str, str]:
    """What is to be large or small, and its unit."""
    text = objective.long_name.partition(" ")[2]
    return text[:1].upper() + text[1:], objective.unit


def _searched(result: DesignsResult) -> dict[str, Picture]:
    """The pictures that only searches have: designs in their order, the front, and the run of the best design."""
    aims = list((result.objectives or {}).values())
    panels = [search_chart(result, aim) for aim in aims]
    if result.front is not None:
        panels.append(front_chart(result, *aims))
    figures = {"search": _grid(result.title, panels, 3, 3.4, 4.6)} if panels else {}
    runs = {name.replace("_", " "): run for name, run in (result.runs or {}).items()}
    styles = {"as it is": {"color": PALE, "linestyle": "-"}, "best": {"color": DARK, "linestyle": "-"}}
    order = sorted(runs)  # the best one in front
    if runs:
        probe = runs["best"].probe
        curves = [Curve(name, runs[name].time, runs[name].displacement, styles[name]) for name in order]
        charts = [Chart(("Time", "s"), (f"Displacement {probe}", "m"), curves)]
        forces = [(name, run, run.force) for name in order if (run := runs[name]).force is not None]
        if forces:
            levels = limit_levels(result.scenario.limits, "peak_force")
            lines = [Curve(f"{name}, {run.snubber}", run.time, force, styles[name]) for name, run, force in forces]
            charts.append(Chart(("Time", "s"), ("Contact force", forces[0][1].unit), lines, levels))
        figures["best"] = Picture(f"{result.title}, best design", charts, 1, (6.4, 2.7 * len(charts)))
    return figures


def _probability(result: DesignsResult) -> Picture:
    """The probability over the number of histories, and what each number has to do with it."""
    names = ("histories", "level", "probability", "variation")
    x, level, p, v = (np.array([getattr(each, name) for each in result.rounds or ()], dtype=float) for name in names)
    spread, last = np.exp(1.96 * np.sqrt(np.log1p(np.where(np.isfinite(v), v, 0.0) ** 2))), level == 0.0
    kinds = (("the limit", last, DARK), ("levels below it", ~last, PALE))
    curves = [
        Curve(name, x[of], p[of], {"marker": "o", "markersize": 3, "color": colour})
        for name, of, colour in kinds
        if any(of)
    ]

    def band(ax: Axes, *_: Scale) -> None:
        ax.fill_between(x[last], (p / spread)[last], (p * spread)[last], color=DARK, alpha=0.18, linewidth=0)

    panels: list[Any] = [Chart(("Histories", ""), ("Probability", ""), curves, log="y", more=band)]
    if result.random_numbers:
        panels.append(partial(_plot_importance, result))
    title = f"{result.title}   (probability of exceeding the limits, 95 % interval)"
    return Picture(title, panels, len(panels), (5.0 * len(panels), 3.6))


def _plot_importance(result: DesignsResult, ax: Axes) -> None:
    """Bars of the importance of the numbers that scatter, with their values at the design point."""
    numbers = sorted(result.random_numbers or (), key=lambda number: number.importance)[-MOST_BARS:]
    shares = [100.0 * number.importance for number in numbers]
    ax.barh(range(len(numbers)), shares, 0.6, color=DARK)
    for row, number in enumerate(numbers):
        away = (number.design - number.mean) / number.deviation
        text = f" {amount(number.design, number.unit, 3)}, {away:+.1f} deviations"
        ax.text(shares[row], row, text, va="center", fontsize="x-small")
    ax.set_yticks(range(len(numbers)), [parameter_label(number.path) for number in numbers])
    ax.set_title("Value at the design point", fontsize="small", loc="left")
    ax.set_xlim(0.0, 1.6 * max(shares))
    finish(ax, "Importance (%)", "")


def _explained(result: DesignsResult, quantities: Sequence[str]) -> list[str]:
    """The responses whose dependence on the parameters is drawn: those of the quantities that are shown, or others."""
    known = [name for name, of in result.summary.get("sensitivity", {}).items() if of]
    return ([r.name for q in quantities for r in _of(result, q) if r.name in known] or known)[:MOST_PANELS]


def _grid(title: str, panels: Sequence[Any], columns: int, height: float, width: float = 3.6) -> Picture:
    """Panels of a height and width, inches, at most so many in a row."""
    columns = min(columns, len(panels))
    return Picture(title, panels, columns, (max(width * columns, 6.4), height * -(-len(panels) // columns)))


def _map(result: DesignsResult, response: Response, at: tuple[int, ...], best: int | None) -> Any:
    """One response over the first two parameters; of two that are numbers a map that pages can show, too."""
    judged = replace(response, values=result.judged(response))
    plot = partial(plot_response_map, result, response=judged, at=at, best=best)
    if len(result.coordinates) > 2 or not all(c.numeric for c in result.coordinates):
        return plot
    across, up = ((c.label, c.unit) for c in result.coordinates)
    x, y = (c.values.astype(float) for c in result.coordinates)
    words = f"{response.quantity.replace('_', ' ')} {response.place}".strip()
    return HeatMap(across, up, (words, response.unit), x, y, judged.values.T, plot)


def _slices(result: DesignsResult, best: int | None) -> list[tuple[int, ...]]:
    """Of all parameters but the first two, numbers of the values at which maps are shown.

    The third takes up to `MOST_SLICES` of its values, the others that of the best case, or their middle.
    """
    further = result.shape[2:]
    if not further:
        return [()]
    fixed = tuple(n // 2 for n in further) if best is None else tuple(np.unravel_index(best, result.shape)[2:])
    along = {*np.linspace(0, further[0] - 1, min(further[0], MOST_SLICES)).round().astype(int).tolist()}
    return [(k, *map(int, fixed[1:])) for k in sorted(along)]


def _band(result: DesignsResult, quantity: str, place: str) -> tuple[Floats, Floats] | None:
    """The smallest and largest value of each case within the tolerances."""
    names = [r.name for r in _of(result, quantity) if r.place == place and r.name in result.realised]
    if not names:
        return None
    values = result.realised[names[0]].values
    return values.min(axis=-1), values.max(axis=-1)


def _quantity(response: Response) -> str:
    """Of an output with its name, as each has a unit of its own."""
    of_output = BY_NAME[response.quantity].section == OUTPUT.section
    return "/".join(response.name.split("/")[-2:]) if of_output else response.quantity


def _peak_of_output(quantity: str) -> str:
    """The name of the output of which a quantity is the peak; empty if it is none."""
    name, _, of = quantity.rpartition("/")
    return name if of == OUTPUT.name else ""


def _of(result: DesignsResult, quantity: str) -> list[Response]:
    return [r for r in result.responses.values() if _quantity(r) == quantity]


def _curves(responses: Sequence[Response]) -> Iterator[tuple[str, Floats]]:
    for response in responses:
        if response.values.ndim == 1:
            yield response.place, response.values
        else:
            for k in range(min(MOST_MODES, response.values.shape[-1])):
                if not np.isfinite(response.values[..., k]).any():
                    continue  # a chain of two masses has no third mode
                yield f"{response.place} mode {k + 1}".strip(), response.values[..., k]


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
    scale = scale_for(coordinate.unit, values, digits=3)
    return values * scale.factor, with_unit(name, scale)


def _tick_words(coordinate: Coordinate) -> list[str]:
    """The different values, if they are words."""
    return [] if coordinate.numeric else list(dict.fromkeys(str(v) for v in coordinate.values))


def _value_text(coordinate: Coordinate, k: int) -> str:
    """Value k of the axis, without its unit."""
    if not coordinate.numeric:
        return str(coordinate.values[k])
    return f"{coordinate.values[k] * scale_for(coordinate.unit, coordinate.values.astype(float), digits=3).factor:.3g}"


def _log(result: DesignsResult, coordinate: Coordinate) -> str:
    """The letter of the axis across, where the values are spread so that it is logarithmic; of a search those asked
    for, as designs crowd where they are good."""
    if not coordinate.numeric:
        return ""
    if (search := result.scenario.optimise) is not None:
        return "x" * any(
            (p.path, getattr(p, "spacing", "")) == (coordinate.path, "logarithmic") for p in search.parameters
        )
    values = np.unique(coordinate.values.astype(float))
    if values.size < 3 or values[0] <= 0.0 or values[-1] / values[0] < 5.0:
        return ""
    steps, ratios = np.diff(values), np.diff(np.log(values))
    return "x" if float(np.ptp(ratios) / ratios.mean()) < float(np.ptp(steps) / steps.mean()) else ""


def _limit(result: DesignsResult, quantity: str) -> float | None:
    if output := _peak_of_output(quantity):
        return result.limits.get(f"{OUTPUT.limit}.{output}")
    return result.limits.get(BY_NAME[quantity].limit)


def _titled(response: Response) -> str:
    return _words(_quantity(response)) + (f", {response.place}" if response.place else "")


def _words(quantity: str) -> str:
    if output := _peak_of_output(quantity):
        return f"Peak of {output}"
    return NAMED.get(quantity) or quantity.removesuffix("_hz").replace("_", " ").capitalize()
