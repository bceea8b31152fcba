"""Plots of a design study: curves over one parameter, maps over two, a matrix of scatter plots over more."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.analyses.designs.result import Coordinate, DesignsResult, Response
from beamsim.plots.outputs import output_label, output_scale
from beamsim.plots.style import MOST_CURVES, Scale, curve_style, finish, legend, scale_for
from beamsim.scenario.limits import OF_OUTPUTS
from beamsim.typing import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHOWN = (
    "peak_displacement", "peak_force", "bending_stress", "contact_share", "resonance_frequency", "largest_gap",
    "closed_frequencies_hz", "open_frequencies_hz", "peak_acceleration",
)  # fmt: skip
MOST_PANELS = 6
MOST_MODES = 3
MOST_PARAMETERS = 6  # columns of a matrix
NAMED = {
    "closed_frequencies_hz": "Natural frequencies, closed",
    "open_frequencies_hz": "Natural frequencies, open",
    "contact_share": "Share of time in contact",
}
LIMITING = {"largest_gap": "gap"}  # quantity -> limit, where the names differ
_PEAK = "/peak_output"
_LIMIT = "#d1495b"


def shown_quantities(result: DesignsResult) -> list[str]:
    """The quantities to plot, by importance: those that vary."""
    known = dict.fromkeys(_quantity(r) for r in result.responses.values())
    peaks = [q for q in known if q.endswith(_PEAK)]
    ranked = [q for q in SHOWN if q in known] + peaks
    ranked += [q for q in known if q not in (*SHOWN, *peaks) and not q.endswith("_output") and len(ranked) < 3]
    limited = [q for q in ranked if _limit(result, q) is not None]
    ranked = limited + [q for q in ranked if q not in limited]
    return [q for q in ranked if any(_varies(r) for r in _of(result, q))][:MOST_PANELS] or ranked[:1]


def plot_response_curves(result: DesignsResult, ax: Axes, quantity: str) -> Axes:
    """A quantity at every place where it is known, over the first parameter, with its limit."""
    coordinate = result.coordinates[0]
    x, ticks, label = _axis(coordinate)
    order = np.argsort(x, kind="stable")
    curves = list(_curves(_of(result, quantity)))
    scale = _scale(result, quantity, [values for _, values in curves])
    for k, (name, values) in enumerate(curves[:MOST_CURVES]):
        style = curve_style(k)
        ax.plot(
            x[order], values[order] * scale.factor, marker="o" if x.size <= 30 else "", markersize=3,
            label=name or "_nolegend_", **style,
        )  # fmt: skip
    if (limit := _limit(result, quantity)) is not None:
        ax.axhline(limit * scale.factor, color=_LIMIT, linewidth=1.4, label="_nolegend_")
        ax.annotate(
            "limit", (1.0, limit * scale.factor), xycoords=("axes fraction", "data"), ha="right", va="bottom",
            fontsize="small", color=_LIMIT,
        )  # fmt: skip
    if ticks is not None:
        ax.set_xticks(np.arange(len(ticks)), ticks)
    elif _logarithmic(coordinate):
        _logarithmic_axis(ax.xaxis)
    finish(ax, label, _label(result, quantity, scale))
    legend(ax, min(len(curves), MOST_CURVES), len(curves), "curves")
    return ax


def plot_response_map(result: DesignsResult, ax: Axes, response: Response) -> Axes:
    """One response over the first two parameters of a grid, with the contour of its limit."""
    from matplotlib.ticker import MaxNLocator

    (x, xticks, xlabel), (y, yticks, ylabel) = (_axis(c) for c in result.coordinates[:2])
    quantity = _quantity(response)
    scale = _scale(result, quantity, [response.values])
    values = np.ma.masked_invalid(response.values.T * scale.factor)
    mesh = ax.pcolormesh(_edges(x, result.coordinates[0]), _edges(y, result.coordinates[1]), values, cmap="cividis")
    where = f", {response.place}" if response.place else ""
    assert ax.figure is not None
    bar = ax.figure.colorbar(mesh, ax=ax)
    bar.set_label(_label(result, quantity, scale) + where)
    limit = _limit(result, quantity)
    if limit is not None and min(values.shape) > 1:
        reached = limit * scale.factor
        if values.min() < reached < values.max():
            ax.contour(x, y, values, levels=[reached], colors=_LIMIT, linewidths=1.8)
        bar.ax.axhline(reached, color=_LIMIT, linewidth=1.8)
    for axis, ticks, coordinate in (
        (ax.xaxis, xticks, result.coordinates[0]),
        (ax.yaxis, yticks, result.coordinates[1]),
    ):
        if ticks is not None:
            axis.set_ticks(np.arange(len(ticks)), ticks)
        elif _logarithmic(coordinate):
            _logarithmic_axis(axis)
        else:
            axis.set_major_locator(MaxNLocator(5))
    finish(ax, xlabel, ylabel)
    ax.grid(visible=False)
    return ax


def plot_response_scatter(result: DesignsResult, ax: Axes, coordinate: int, quantity: str) -> Axes:
    """A quantity (largest over all places) of every case over one parameter; cases beyond the limit are marked."""
    x, ticks, label = _axis(result.coordinates[coordinate])
    along = _cases(result, coordinate, x)
    values = _worst(result, quantity)
    scale = _scale(result, quantity, [values])
    limit = _limit(result, quantity)
    beyond = np.zeros(values.size, dtype=bool) if limit is None else values > limit
    ax.plot(along[~beyond], values[~beyond] * scale.factor, ".", color="#0b3c5d", markersize=3)
    ax.plot(along[beyond], values[beyond] * scale.factor, "x", color=_LIMIT, markersize=4)
    if limit is not None:
        ax.axhline(limit * scale.factor, color=_LIMIT, linewidth=1.2)
    if ticks is not None:
        ax.set_xticks(np.arange(len(ticks)), ticks)
    elif _logarithmic(result.coordinates[coordinate]):
        _logarithmic_axis(ax.xaxis)
    finish(ax, label, _label(result, quantity, scale))
    return ax


def design_figures(result: DesignsResult) -> dict[str, Figure]:
    """All plots available for this study; the key is the last part of the file name."""
    from matplotlib.figure import Figure

    if not np.any(result.solved):
        return {}

    def panels(count: int, columns: int, size: tuple[float, float]) -> tuple[Figure, list[Axes]]:
        rows = -(-count // columns)
        figure = Figure(figsize=(size[0] * columns, size[1] * rows), layout="constrained")
        if result.title:
            figure.suptitle(result.title, x=0.012, ha="left", fontsize="medium", color="0.3")
        axes = list(figure.subplots(rows, columns, squeeze=False).ravel())
        for ax in axes[count:]:
            ax.set_visible(False)
        return figure, axes

    quantities = shown_quantities(result)
    dimensions = len(result.coordinates)
    if dimensions == 1 or result.kind == "zip":
        figure, axes = panels(len(quantities), min(2, len(quantities)), (5.2, 3.0))
        for ax, quantity in zip(axes, quantities, strict=False):
            plot_response_curves(result, ax, quantity)
        return {"curves": figure}
    if dimensions == 2 and result.kind == "grid" and min(result.shape) > 1:
        maps = [r for q in quantities for r in _of(result, q)[:2] if r.values.ndim == 2 and _varies(r)][:MOST_PANELS]
        if maps:
            figure, axes = panels(len(maps), min(2, len(maps)), (5.2, 3.6))
            for ax, response in zip(axes, maps, strict=False):
                plot_response_map(result, ax, response)
            return {"maps": figure}
    scalar = [q for q in quantities if any(r.values.shape == result.shape for r in _of(result, q))][:4]
    columns = min(dimensions, MOST_PARAMETERS)
    figure, axes = panels(len(scalar) * columns, columns, (2.9, 2.4))
    for k, ax in enumerate(axes):
        row, column = divmod(k, columns)
        plot_response_scatter(result, ax, column, scalar[row])
        if row < len(scalar) - 1:
            ax.set_xlabel("")
        if column:
            ax.set_ylabel("")
    return {"scatter": figure}


def _quantity(response: Response) -> str:
    """Of an output with its name, as each has a unit of its own."""
    return "/".join(response.name.split("/")[-2:]) if response.quantity.endswith("_output") else response.quantity


def _of(result: DesignsResult, quantity: str) -> list[Response]:
    return [r for r in result.responses.values() if _quantity(r) == quantity]


def _varies(response: Response) -> bool:
    known = response.values[np.isfinite(response.values)]
    return bool(known.size) and bool(np.ptp(known) > 1e-12 * np.max(np.abs(known)))


def _curves(responses: Sequence[Response]) -> Iterator[tuple[str, Floats]]:
    for response in responses:
        if response.values.ndim == 1:
            yield response.place, response.values
        else:
            for k in range(min(MOST_MODES, response.values.shape[-1])):
                yield f"{response.place} mode {k + 1}".strip(), response.values[..., k]


def _worst(result: DesignsResult, quantity: str) -> Floats:
    """Largest value over all places, for each case."""
    values = np.stack([r.values.ravel() for r in _of(result, quantity) if r.values.shape == result.shape])
    known = np.isfinite(values)
    worst = np.where(known, values, -np.inf).max(axis=0)
    return np.where(known.any(axis=0), worst, np.nan)


def _cases(result: DesignsResult, coordinate: int, x: Floats) -> Floats:
    """Value of a coordinate in every case."""
    if result.kind != "grid":
        return x
    return np.asarray(np.meshgrid(*[_axis(c)[0] for c in result.coordinates], indexing="ij")[coordinate]).ravel()


def _axis(coordinate: Coordinate) -> tuple[Floats, list[str] | None, str]:
    """Values along the axis, tick labels if the values are words, and the axis label."""
    if not coordinate.numeric:
        words = list(dict.fromkeys(str(v) for v in coordinate.values))
        return np.array([words.index(str(v)) for v in coordinate.values], dtype=float), words, coordinate.path
    values = coordinate.values.astype(float)
    if coordinate.unit == "1":
        return values, None, coordinate.path
    scale = scale_for(coordinate.unit, values) if " " not in coordinate.unit else Scale(1.0, coordinate.unit)
    return values * scale.factor, None, f"{coordinate.path} ({scale.unit})"


def _logarithmic(coordinate: Coordinate) -> bool:
    if not coordinate.numeric:
        return False
    values = np.unique(coordinate.values.astype(float))
    if values.size < 3 or values[0] <= 0.0 or values[-1] / values[0] < 5.0:
        return False
    steps, ratios = np.diff(values), np.diff(np.log(values))
    return float(np.ptp(ratios) / ratios.mean()) < float(np.ptp(steps) / steps.mean())


def _logarithmic_axis(axis: Any) -> None:
    """Logarithmic, with ticks at 1, 2, 5, 10, ... written as plain numbers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    getattr(axis.axes, f"set_{axis.axis_name}scale")("log")
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


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


def _scale(result: DesignsResult, quantity: str, values: Sequence[Any]) -> Scale:
    unit = _of(result, quantity)[0].unit
    if unit == "m/s^2" and quantity.endswith(_PEAK):
        return output_scale(unit)
    if unit in ("1", "Hz"):
        return Scale(1.0, "" if unit == "1" else unit)
    return scale_for(unit, *[np.asarray(v)[np.isfinite(v)] for v in values])


def _label(result: DesignsResult, quantity: str, scale: Scale) -> str:
    if quantity.endswith(_PEAK):
        return output_label("Peak of", quantity.removesuffix(_PEAK), scale)
    words = NAMED.get(quantity) or quantity.removesuffix("_hz").replace("_", " ").capitalize()
    return f"{words} ({scale.unit})" if scale.unit else words
