"""Plots of a design study: curves over one parameter, maps over two, a matrix of scatter plots over more."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.contour import ContourSet
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from scipy.spatial.distance import cdist

from beamsim.analyses.studies.objectives import objectives
from beamsim.analyses.studies.plan import ParameterColumn
from beamsim.analyses.studies.responses import matches_request, place_of, quantity_of
from beamsim.analyses.studies.result import StudyResult
from beamsim.analyses.studies.statistics import varies
from beamsim.analyses.studies.worst import SAMPLED
from beamsim.labelled import Dataset
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
from beamsim.typing import Bools, Floats

SHOWN = (
    "peak_displacement", "peak_force", "bending_stress", "contact_share", "resonance_frequency", "largest_gap",
    "closed_frequencies_hz", "open_frequencies_hz", "peak_acceleration",
)  # fmt: skip
MOST_MODES = 3
MOST_SLICES = 4  # maps of one response of three or more parameters
MOST_SLICED = 3  # responses
MOST_NUMBERED = (12, 6)  # rows and columns of a map whose cells have room for numbers
MOST_BARS = 12
LABELS_APART = 1.5  # heights of letters between the middles of two labels of a map
NAMED = {
    "closed_frequencies_hz": "Natural frequencies, closed",
    "open_frequencies_hz": "Natural frequencies, open",
    "contact_share": "Share of time in contact",
}


def shown_quantities(result: StudyResult) -> list[str]:
    """The quantities to plot, by importance: those that vary."""
    known = dict.fromkeys(map(_quantity, result.responses))
    ranked = [q for q in SHOWN if q in known] + [q for q in known if _peak_of_output(q)]
    ranked += [q for q in known if q not in ranked and "/" not in q][: max(3 - len(ranked), 0)]
    terms = [name for objective in objectives(result.scenario) for name, _ in objective.terms]
    asked = {_quantity(name) for term in terms for name in result.responses if matches_request(term, name)}
    limited = [q for q in ranked if q in asked or _limit(result, q) is not None]
    ranked = limited + [q for q in ranked if q not in limited]
    varying = [q for q in ranked if any(varies(result.responses[name].values) for name in _of(result, q))]
    return varying[:MOST_PANELS] or ranked[:1]


def response_curves(result: StudyResult, quantity: str) -> Chart:
    """A quantity at every place where it is known, over the first parameter, with its limit and the range within the
    tolerances."""
    parameter = result.parameters[0]
    x, label = _axis(parameter)
    order = np.argsort(x, kind="stable")
    marks = {"marker": "o" if x.size <= 30 else "", "markersize": 3}
    if result.kind not in ("grid", "zip"):  # samples are in no order
        marks = {"marker": ".", "markersize": 3, "linestyle": "none"}
    curves = [Curve(name, x[order], values[order], marks) for name, values in _curves(result, quantity)]

    def bands(ax: Axes, _: Scale, y: Scale) -> None:
        for k, curve in enumerate(curves[:MOST_CURVES]):
            if (band := _band(result, quantity, curve.label)) is not None:
                low, high = (values[order] * y.factor for values in band)
                ax.fill_between(curve.x, low, high, color=curve_style(k)["color"], alpha=0.18, linewidth=0)
        _write_words(ax, parameter)

    y_axis = (_words(quantity), _unit(result, quantity))
    return Chart(
        (label, ""), y_axis, curves, _limit_level(result, quantity), log=_log(result, parameter), draw_extra=bands
    )


def _limit_level(result: StudyResult, quantity: str) -> list[Guide]:
    limit = _limit(result, quantity)
    return [] if limit is None else [Guide("limit", limit, {"color": RED, "linewidth": 1.4})]


def _label_contours(ax: Axes, lines: ContourSet) -> list[Text]:
    """Label the lines of a map; of labels that would lie over each other the first one stays.

    Parameters
    ----------
    ax : with the lines, before its last layout, which may make it smaller.
    lines : whose levels are written.
    """
    kept: list[tuple[Text, Floats]] = []
    for label in ax.clabel(lines, fontsize="x-small"):
        height = float(label.get_fontsize()) * ax.figure.dpi / 72.0  # pixels
        letters, turn = len(label.get_text()), np.deg2rad(label.get_rotation())
        along = np.linspace(-0.3 * letters * height, 0.3 * letters * height, 2 * letters + 1)[:, None]
        points = ax.transData.transform(label.get_position()) + along * [np.cos(turn), np.sin(turn)]
        if any(float(cdist(points, others).min()) < LABELS_APART * height for _, others in kept):
            label.remove()
        else:
            kept.append((label, points))
    return [label for label, _ in kept]


def plot_response_map(
    result: StudyResult, ax: Axes, name: str, slice_index: tuple[int, ...] = (), best_case: int | None = None
) -> None:
    """One response over the first two parameters of a grid, a cell for each case, crossed where beyond the limit.

    The cells of small maps have numbers, large maps have contours. The values of further parameters are above it.

    Parameters
    ----------
    result : of a grid of two or more parameters.
    ax : to draw on.
    name : of a response with one value a case.
    slice_index : numbers of the values of all further parameters.
    best_case : number of the best case, which is marked if it is on the map.
    """
    judged = result.deciding_values(name).reshape(result.shape)
    scale, limit = scale_for(result.units[name], judged, digits=3), _limit(result, _quantity(name))
    every: Any = np.ma.masked_invalid(judged * scale.factor)
    values = every[(slice(None), slice(None), *slice_index)].T
    beyond = np.ma.filled(values > (np.inf if limit is None else limit * scale.factor), False)
    cells = ax.imshow(values, origin="lower", aspect="auto", cmap="cividis", vmin=every.min(), vmax=every.max())
    bar = ax.figure.colorbar(cells, ax=ax, label=with_unit(_title_of(name), scale))
    starred = () if best_case is None else tuple(int(k) for k in np.unravel_index(best_case, result.shape))
    star = starred[:2] if starred[2:] == slice_index else ()
    if all(size <= most for size, most in zip(values.shape, MOST_NUMBERED, strict=True)):
        _write_cells(ax, values, beyond, cells.norm, star)
    else:
        lines = ax.contour(values, colors="white", linewidths=0.6)
        for drawn in (lines, *_label_contours(ax, lines)):
            drawn.set_path_effects([withStroke(linewidth=1.5, foreground="0.2")])  # seen on light and dark cells
        if star:
            ax.plot(*star, marker="*", markersize=11, color="white", markeredgecolor="black", clip_on=False)
        ax.plot(*np.nonzero(beyond.T), linestyle="none", marker="x", markersize=3.5, color=RED)
    if limit is not None:
        bar.ax.axhline(limit * scale.factor, color=RED, linewidth=1.8)
    axes = axes_of_grid(result)
    for axis, parameter in zip((ax.xaxis, ax.yaxis), axes, strict=False):
        texts = [_value_text(parameter, k) for k in range(parameter.values.size)]
        shown = range(0, len(texts), -(-len(texts) // 4))
        axis.set_ticks(list(shown), [texts[k] for k in shown])
    finish(ax, *(_axis(parameter)[1] for parameter in axes[:2]))
    ax.grid(visible=False)
    further = zip(axes[2:], slice_index, strict=True)
    ax.set_title(", ".join(f"{_axis(p)[1]}: {_value_text(p, k)}" for p, k in further), fontsize="small", loc="left")


def _write_cells(ax: Axes, values: Any, exceeds: Any, norm: Any, star: tuple[int, ...]) -> None:
    """The number in every cell, black on light ones, with a star in the best case and a cross beyond the limit.

    Parameters
    ----------
    values, exceeds : (ny, nx) masked numbers, and whether they are beyond the limit.
    norm : of the colours.
    star : (i, j) of the best case; empty where it is not on the map.
    """
    for j, i in zip(*np.nonzero(~np.ma.getmaskarray(values)), strict=True):
        best, text = (i, j) == star, f"{'✕ ' * bool(exceeds[j, i])}{values[j, i]:.3g}"
        ax.text(
            i, j, f"★ {text}" if best else text, ha="center", va="center", fontsize="x-small",
            fontweight="bold" if best else "normal", color="black" if norm(values[j, i]) > 0.55 else "white",
        )  # fmt: skip


def _write_words(ax: Axes, parameter: ParameterColumn) -> None:
    """Words in place of their numbers."""
    if words := _tick_words(parameter):
        ax.set_xticks(np.arange(len(words)), words)


def plot_sensitivity(result: StudyResult, ax: Axes, name: str) -> None:
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
        label, nominal = with_unit(_words(_quantity(name)), scale), float(response.values[0]) * scale.factor
        for end, align in (("smallest", "right"), ("largest", "left")):
            values = column(end) * scale.factor
            ax.barh(rows, values - nominal, 0.6, nominal, color=DARK)
            for row, path in enumerate(paths):
                at = of[path][f"{end}_at"]
                text = at if isinstance(at, str) else amount(at, result.units[path])
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
    ax.set_title(_title_of(name), fontsize="small", loc="left")
    finish(ax, label, "")


def _importance(entry: Mapping[str, Any]) -> float:
    """Importance of a parameter for a response, by which parameters are ranked."""
    if "largest" in entry:
        return float(entry["largest"] - entry["smallest"])
    return abs(float(entry["total_order"] if "total_order" in entry else entry["rank_correlation"]))


def histogram(result: StudyResult, name: str, values: Floats, statistics: Mapping[str, Any]) -> Chart:
    """Histogram of a response, one colour for each population, with its limit and known quantiles.

    Parameters
    ----------
    result : of a sample.
    name : of the response that the values are of.
    values : (cases,) of a sample, or of the realisations of one case; nan where not known.
    statistics : what the summary says of them.
    """
    known, limit, unit = values[np.isfinite(values)], _limit(result, _quantity(name)), result.units[name]
    edges = np.linspace(known.min(), known.max(), min(max(10, known.size // 5), 30) + 1)
    curves = []
    for k, group in enumerate(statistics.get("populations", [statistics])):
        own = known[(known >= group["smallest"]) & (known <= group["largest"])]
        heights = np.concatenate([[0.0], np.repeat(np.histogram(own, edges)[0], 2), [0.0]])
        cases = f"{extent(group['smallest'], group['largest'], unit)}, {own.size} cases"
        style = {**curve_style(k + 2 if k else 0), "linestyle": "-"}  # the second colour is that of the limit
        curves.append(Curve(cases if "populations" in statistics else "", np.repeat(edges, 2), heights, style))

    def more(ax: Axes, x: Scale, _: Scale) -> None:
        for curve in curves:
            ax.fill_between(curve.x * x.factor, curve.y, color=curve.style["color"], alpha=0.3, linewidth=0)
        at = {f"{percent} %": (statistics[f"quantile_{percent}_percent"], "0.35", "--") for percent in (5, 50, 95)}
        for text, (value, colour, dashes) in (at | ({} if limit is None else {"limit": (limit, RED, "-")})).items():
            ax.axvline(value * x.factor, color=colour, linewidth=1.2, linestyle=dashes)
            ax.text(
                value * x.factor, 0.98, text, transform=ax.get_xaxis_transform(), ha="right", va="top",
                fontsize="x-small", rotation=90, color=colour,
            )  # fmt: skip
        ax.margins(y=0.2)

    what = "Sampled realisations of the best case" if "nominal" in statistics else "Cases"
    return Chart((_title_of(name), unit), (what, ""), curves, integer_axes="y", draw_extra=more, y_ends=(0.0, None))


def _histograms(result: StudyResult, quantities: Sequence[str]) -> Iterator[Chart]:
    """Of the responses that are shown of a sample, or of the best case within tolerances."""
    scatter = result.summary.get("scatter", {})
    statistics = scatter.get("responses", result.summary["responses"])
    realised = _values_within_tolerances(result) if scatter else {}
    for name in (name for q in quantities for name in _of(result, q)[:2]):
        values = realised[name][scatter["case"]] if name in realised else result.responses[name].values
        of = statistics.get(name, {})
        if "quantile_50_percent" in of and of["smallest"] < of["largest"]:
            yield histogram(result, name, values, of)


def response_scatter(result: StudyResult, k: int, quantity: str) -> Chart:
    """A quantity (at its worst place) of every case over parameter k; cases beyond the limit are marked."""
    parameter = result.parameters[k]
    along, label = _axis(parameter)
    values = result.deciding_values(*_of(result, quantity))
    limit = _limit(result, quantity)
    beyond = np.zeros(values.size, dtype=bool) if limit is None else values > limit
    kinds = ((~beyond, {"marker": ".", "color": DARK, "markersize": 3}), (beyond, {"marker": "x", "color": RED}))
    curves = [
        Curve("", along[which], values[which], {"linestyle": "none", "markersize": 4, **style})
        for which, style in kinds
    ]
    y_axis = (_words(quantity), scale_for(_unit(result, quantity), values))
    levels = [level._replace(label="") for level in _limit_level(result, quantity)]
    return Chart(
        (label, ""),
        y_axis,
        curves,
        levels,
        log=_log(result, parameter),
        draw_extra=lambda ax, *_: _write_words(ax, parameter),
    )


def _judgement(result: StudyResult) -> str:
    """What a study with tolerances shows."""
    tolerances = result.summary.get("tolerances")
    if tolerances is None:
        return ""
    of, worst = f"{tolerances['realisations']} realisations within the tolerances", result.summary.get("worst")
    how = (
        "" if worst is None or worst["kind"] == SAMPLED else f"; limits and objective of the best case {worst['kind']}"
    )
    if len(result.parameters) == 1 or result.kind == "zip":
        return f"   (bands: sample of {of}{how})"
    if tolerances["quantile"] < 1.0:
        return f"   ({100 * tolerances['quantile']:.4g} % quantile of {of})"
    return f"   (worst of a sample of {of}{how})"


def design_figures(result: StudyResult) -> dict[str, Picture]:
    """All pictures of this study; the key is the last part of the file name."""
    if result.kind == "reliability":
        return {"probability": _probability(result)} if "rounds" in result.datasets else {}
    if not np.any(result["cases"]["solved"].values):
        return {}
    best = result.summary["best"][0]["case"] if result.summary.get("best") else None
    title = result.title + _judgement(result)
    quantities, dimensions = shown_quantities(result), len(result.parameters)
    modal = result["cases"].labels("modal_response")
    figures: dict[str, Picture] = _search_pictures(result)
    if causes := _responses_to_explain(result, quantities):
        shares = [partial(plot_sensitivity, result, name=name) for name in causes]
        size = 1.4 + 0.4 * min(dimensions, MOST_BARS)
        figures["sensitivity"] = _grid(title, shares, 2, size, width=5.0)._replace(legend_below=True)
    if result.kind == "one_at_a_time":
        return figures
    if counts := list(_histograms(result, quantities))[:MOST_PANELS]:
        figures["histograms"] = _grid(result.title, counts, 2, 3.0)
    if dimensions == 1 or result.kind == "zip":
        return {"curves": _grid(title, [response_curves(result, q) for q in quantities], 2, 3.2), **figures}
    numbers = [name for q in quantities for name in _of(result, q)[:2] if name not in modal]
    maps = [name for name in numbers if varies(result.responses[name].values)]
    if result.kind == "grid" and min(result.shape[:2]) > 1 and maps:
        starred = title + (f"   (star: best case, {result.summary['objective']})" if best is not None else "")
        places = _slices(result, best)
        if dimensions > 2:
            maps = list({_quantity(name): name for name in reversed(maps)}.values())[::-1][:MOST_SLICED]
        plots = [_map(result, name, at, best) for name in maps[:MOST_PANELS] for at in places]
        figures["maps" if dimensions == 2 else "slices"] = _grid(starred, plots, max(len(places), 2), 3.4)
    if dimensions == 2 and "maps" in figures:
        return figures
    scalar = [q for q in quantities if any(name not in modal for name in _of(result, q))][:4]
    columns = min(dimensions, MOST_PANELS)
    cases = [response_scatter(result, k, q) for q in scalar for k in range(columns)]
    figures["scatter"] = _grid(title, cases, columns, 2.4)._replace(outer_labels=True)
    return figures


def search_chart(result: StudyResult, objective: str) -> Chart:
    """One objective of every design in the order in which they were tried, and the best one up to there."""
    values, number = (
        result["cases"]["objective_value"].sel(objective=objective).values,
        np.arange(1.0, result.count + 1.0),
    )
    dots: dict[str, Any] = {"linestyle": "none", "markersize": 3}
    meets = np.isfinite(values) & _passing(result)
    largest = next(aim.maximised for aim in objectives(result.scenario) if aim.name == objective)
    tried = np.where(meets & (number > 1.0), values, -np.inf if largest else np.inf)  # the first one is as it is
    best = (np.maximum if largest else np.minimum).accumulate(tried)
    curves = [
        Curve("beyond a limit", number[~meets], values[~meets], {**dots, "marker": "x", "color": RED, "alpha": 0.5}),
        Curve("meets every limit", number[meets], values[meets], {**dots, "marker": "o", "color": PALE}),
        Curve("best so far", number, np.where(np.isfinite(best), best, np.nan),
              {"color": DARK, "linestyle": "-", "drawstyle": "steps-post"}),
    ]  # fmt: skip
    return Chart(
        ("Number of the design", ""),
        _axis_of(result, objective),
        curves if result.limits else curves[1:],
        integer_axes="x",
    )


def front_chart(result: StudyResult, x_objective: str, y_objective: str) -> Chart:
    """Two objectives of all designs that meet every limit, and the front of those that none is better than in both.

    Parameters
    ----------
    result : of a search for two objectives.
    x_objective, y_objective : names of the objectives.
    """
    x, y = (result["cases"]["objective_value"].sel(objective=name).values for name in (x_objective, y_objective))
    of_front = result["cases"]["front"].values
    front = np.flatnonzero(of_front)
    front = front[np.argsort(x[front])]
    others = np.flatnonzero(~of_front & _passing(result))
    curves = [
        Curve(label, x[which], y[which], style)
        for label, which, style in (
            ("dominated", others, {"linestyle": "none", "marker": ".", "markersize": 3, "color": PALE}),
            ("front", front, {"linestyle": "-", "linewidth": 0.8, "marker": "o", "markersize": 3.5, "color": DARK}),
            ("as it is", np.array([0]), {"linestyle": "none", "marker": "D", "markersize": 5, "color": RED}),
        )
    ]
    return Chart(_axis_of(result, x_objective), _axis_of(result, y_objective), curves)


def _passing(result: StudyResult) -> Bools:
    """(cases,) which meet every limit; all without limits."""
    cases = result["cases"]
    return cases["passing"].values if "passing" in cases else np.ones(result.count, dtype=bool)


def _axis_of(result: StudyResult, objective: str) -> tuple[str, str]:
    """What is to be large or small, and its unit."""
    text = objective.replace("_", " ")
    return text[:1].upper() + text[1:], result["cases"]["objective_value"].sel(objective=objective).unit


def _search_pictures(result: StudyResult) -> dict[str, Picture]:
    """The pictures that only searches have: designs in their order, the front, and the run of the best design."""
    aims = result["cases"].labels("objective") if result.kind == "optimise" else []
    panels = [search_chart(result, aim) for aim in aims]
    if "front" in result["cases"]:
        panels.append(front_chart(result, *aims))
    figures = {"search": _grid(result.title, panels, 3, 3.4, 4.6)} if panels else {}
    if "runs" in result.datasets:
        charts = list(_run_charts(result, result["runs"]))
        figures["best"] = Picture(f"{result.title}, best design", charts, 1, (6.4, 2.7 * len(charts)))
    return figures


def _run_charts(result: StudyResult, runs: Dataset) -> Iterator[Chart]:
    """The motions and the contact forces of the best design and of the scenario as it is."""
    styles = {"as_it_is": {"color": PALE, "linestyle": "-"}, "best": {"color": DARK, "linestyle": "-"}}
    of = dict(sorted(runs.groups("sample_design").items()))  # the best one in front
    probe = runs["probe"].sel(design="best").item()
    curves = [
        Curve(name.replace("_", " "), run["time"].values, run["displacement"].values, styles[name])
        for name, run in of.items()
    ]
    yield Chart(("Time", "s"), (f"Displacement {probe}", "m"), curves)
    lines = [
        Curve(f"{name.replace('_', ' ')}, {snubber}", run["time"].values, run["force"].values, styles[name])
        for name, run in of.items()
        if (snubber := runs["snubber"].sel(design=name).item())
    ]
    if lines:
        levels = limit_levels(result.scenario.limits, "peak_force")
        yield Chart(("Time", "s"), ("Contact force", runs["force"].unit), lines, levels)


def _probability(result: StudyResult) -> Picture:
    """The probability over the number of histories, and what each number has to do with it."""
    rounds, names = result["rounds"], ("histories", "level", "probability", "variation")
    x, level, p, v = (rounds[name].values.astype(float) for name in names)
    spread, last = np.exp(1.96 * np.sqrt(np.log1p(np.where(np.isfinite(v), v, 0.0) ** 2))), level == 0.0
    kinds = (("the limit", last, DARK), ("levels below it", ~last, PALE))
    curves = [
        Curve(name, x[of], p[of], {"marker": "o", "markersize": 3, "color": colour})
        for name, of, colour in kinds
        if any(of)
    ]

    def band(ax: Axes, *_: Scale) -> None:
        ax.fill_between(x[last], (p / spread)[last], (p * spread)[last], color=DARK, alpha=0.18, linewidth=0)

    panels: list[Any] = [Chart(("Histories", ""), ("Probability", ""), curves, log="y", draw_extra=band)]
    if "random_numbers" in result.datasets:
        panels.append(partial(_plot_importance, result))
    title = f"{result.title}   (probability of exceeding the limits, 95 % interval)"
    return Picture(title, panels, len(panels), (5.0 * len(panels), 3.6))


def _plot_importance(result: StudyResult, ax: Axes) -> None:
    """Bars of the importance of the numbers that scatter, with their values at the design point."""
    numbers = result["random_numbers"]
    order = np.argsort(numbers["importance"].values, kind="stable")[-MOST_BARS:]
    shares, paths = 100.0 * numbers["importance"].values[order], [numbers.labels("number")[k] for k in order]
    ax.barh(range(order.size), shares, 0.6, color=DARK)
    low, high = (100.0 * numbers[f"importance_{end}"].values[order] for end in ("low", "high"))
    ends = np.maximum([shares - low, high - shares], 0.0)
    if np.isfinite(ends).all():
        ax.errorbar(shares, range(order.size), xerr=ends, fmt="none", ecolor=RED, capsize=2, linewidth=1)
    text_at = np.fmax(high, shares)
    for row, path in enumerate(paths):
        design, mean, deviation = (numbers[name].sel(number=path) for name in ("design", "mean", "deviation"))
        away = (design.item() - mean.item()) / deviation.item()
        text = f" {amount(design.item(), design.unit, 3)}, {away:+.1f} deviations"
        ax.text(text_at[row], row, text, va="center", fontsize="x-small")
    ax.set_yticks(range(order.size), list(map(parameter_label, paths)))
    ax.set_title("Value at the design point", fontsize="small", loc="left")
    ax.set_xlim(0.0, 1.6 * max(text_at))
    finish(ax, "Importance (%)", "")


def _responses_to_explain(result: StudyResult, quantities: Sequence[str]) -> list[str]:
    """The responses whose dependence on the parameters is drawn: those of the quantities that are shown, or others."""
    known = [name for name, of in result.summary.get("sensitivity", {}).items() if of]
    return ([name for q in quantities for name in _of(result, q) if name in known] or known)[:MOST_PANELS]


def _grid(title: str, panels: Sequence[Any], columns: int, height: float, width: float = 3.6) -> Picture:
    """Panels of a height and width, inches, at most so many in a row."""
    columns = min(columns, len(panels))
    return Picture(title, panels, columns, (max(width * columns, 6.4), height * -(-len(panels) // columns)))


def axes_of_grid(result: StudyResult) -> list[ParameterColumn]:
    """The parameters of a grid with their values along its axes."""
    each = enumerate(result.parameters)
    return [
        p._replace(values=np.moveaxis(p.values.reshape(result.shape), k, 0).reshape(result.shape[k], -1)[:, 0])
        for k, p in each
    ]


def _map(result: StudyResult, name: str, slice_index: tuple[int, ...], best_case: int | None) -> Any:
    """One response over the first two parameters; of two that are numbers a map that pages can show, too."""
    plot = partial(plot_response_map, result, name=name, slice_index=slice_index, best_case=best_case)
    axes = axes_of_grid(result)
    if len(axes) > 2 or not all(parameter.numeric for parameter in axes):
        return plot
    x_axis, y_axis = ((parameter.label, parameter.unit) for parameter in axes)
    x, y = (parameter.values.astype(float) for parameter in axes)
    words = f"{quantity_of(name).replace('_', ' ')} {place_of(name)}".strip()
    return HeatMap(
        x_axis, y_axis, (words, result.units[name]), x, y, result.deciding_values(name).reshape(result.shape).T, plot
    )


def _slices(result: StudyResult, best_case: int | None) -> list[tuple[int, ...]]:
    """Of all parameters but the first two, numbers of the values at which maps are shown.

    The third takes up to `MOST_SLICES` of its values, the others that of the best case, or their middle.
    """
    further = result.shape[2:]
    if not further:
        return [()]
    fixed = (
        tuple(n // 2 for n in further) if best_case is None else tuple(np.unravel_index(best_case, result.shape)[2:])
    )
    along = {*np.linspace(0, further[0] - 1, min(further[0], MOST_SLICES)).round().astype(int).tolist()}
    return [(k, *map(int, fixed[1:])) for k in sorted(along)]


def _band(result: StudyResult, quantity: str, place: str) -> tuple[Floats, Floats] | None:
    """The smallest and largest value of each case within the tolerances, of the sample and of further realisations."""
    realised = _values_within_tolerances(result)
    name = next((name for name in _of(result, quantity) if place_of(name) == place and name in realised), None)
    if name is None:
        return None
    low, high = realised[name].min(axis=1), realised[name].max(axis=1)
    if (further := result.datasets.get("further_realisations")) is not None:
        of, values = further["further_case"].values, further["value"].sel(response=name).values
        np.minimum.at(low, of, values)
        np.maximum.at(high, of, values)
    return low, high


def _values_within_tolerances(result: StudyResult) -> dict[str, Floats]:
    """(cases, realisations) values of the responses within tolerances; none without tolerances."""
    if "realisations" not in result.datasets:
        return {}
    return {name: column.values for name, column in result["realisations"].by_label("value").items()}


def _quantity(name: str) -> str:
    """The quantity of a response; of an output with its name, as each has a unit of its own."""
    quantity = quantity_of(name)
    return "/".join(name.split("/")[-2:]) if BY_NAME[quantity].section == OUTPUT.section else quantity


def _peak_of_output(quantity: str) -> str:
    """The name of the output of which a quantity is the peak; empty if it is none."""
    name, _, of = quantity.rpartition("/")
    return name if of == OUTPUT.name else ""


def _of(result: StudyResult, quantity: str) -> list[str]:
    """Names of the responses of a quantity."""
    return [name for name in result.responses if _quantity(name) == quantity]


def _unit(result: StudyResult, quantity: str) -> str:
    """Unit of a quantity."""
    return result.units[_of(result, quantity)[0]]


def _curves(result: StudyResult, quantity: str) -> Iterator[tuple[str, Floats]]:
    for name in _of(result, quantity):
        values, place = result.responses[name].values, place_of(name)
        if values.ndim == 1:
            yield place, values
        else:
            for k in range(min(MOST_MODES, values.shape[1])):
                if not np.isfinite(values[:, k]).any():
                    continue  # a chain of two masses has no third mode
                yield f"{place} mode {k + 1}".strip(), values[:, k]


def _axis(parameter: ParameterColumn) -> tuple[Floats, str]:
    """Values along the axis, words by their numbers, and the label of the axis."""
    name = parameter.label[:1].upper() + parameter.label[1:]
    if words := _tick_words(parameter):
        return np.array([words.index(str(v)) for v in parameter.values], dtype=float), name
    values = parameter.values.astype(float)
    scale = scale_for(parameter.unit, values, digits=3)
    return values * scale.factor, with_unit(name, scale)


def _tick_words(parameter: ParameterColumn) -> list[str]:
    """The different values, if they are words."""
    return [] if parameter.numeric else list(dict.fromkeys(str(v) for v in parameter.values))


def _value_text(parameter: ParameterColumn, k: int) -> str:
    """Value k of the axis, without its unit."""
    if not parameter.numeric:
        return str(parameter.values[k])
    return f"{parameter.values[k] * scale_for(parameter.unit, parameter.values.astype(float), digits=3).factor:.3g}"


def _log(result: StudyResult, parameter: ParameterColumn) -> str:
    """The letter of the axis across, where the values are spread so that it is logarithmic; of a search those asked
    for, as designs crowd where they are good."""
    if not parameter.numeric:
        return ""
    if (search := result.scenario.optimise) is not None:
        return "x" * any(
            (p.path, getattr(p, "spacing", "")) == (parameter.path, "logarithmic") for p in search.parameters
        )
    values = np.unique(parameter.values.astype(float))
    if values.size < 3 or values[0] <= 0.0 or values[-1] / values[0] < 5.0:
        return ""
    steps, ratios = np.diff(values), np.diff(np.log(values))
    return "x" if float(np.ptp(ratios) / ratios.mean()) < float(np.ptp(steps) / steps.mean()) else ""


def _limit(result: StudyResult, quantity: str) -> float | None:
    if output := _peak_of_output(quantity):
        return result.limits.get(f"{OUTPUT.limit}.{output}")
    return result.limits.get(BY_NAME[quantity].limit)


def _title_of(name: str) -> str:
    place = place_of(name)
    return _words(_quantity(name)) + (f", {place}" if place else "")


def _words(quantity: str) -> str:
    if output := _peak_of_output(quantity):
        return f"Peak of {output}"
    return NAMED.get(quantity) or quantity.removesuffix("_hz").replace("_", " ").capitalize()
