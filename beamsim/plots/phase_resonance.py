"""Pictures of a damped structure held on its nonlinear mode."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from beamsim.analyses.nnm.result import NormalModeResult
from beamsim.labelled import Dataset
from beamsim.plots.branches import BranchLine, branch_curves
from beamsim.plots.drawing import HERTZ, RED, Chart, Curve, Picture, curve_style, marks_curve
from beamsim.plots.stations import draw_along
from beamsim.plots.style import Scale, scale_for
from beamsim.results.branch import rows_by_owner
from beamsim.structures.places import Stations
from beamsim.typing import TINY, Bools


def _level_scale(result: NormalModeResult) -> Scale:
    """Levels of acceleration in g, others with an SI prefix."""
    level = result["phase_resonance"]["level"]
    return scale_for(level.unit, level.values)


def _level_text(value: float, level: Scale) -> str:
    return f"{value * level.factor:.4g} {level.unit}"


def _compared_probe(result: NormalModeResult) -> str:
    """The probe whose amplitude is compared."""
    return str(result["phase_resonance"]["compared_probe"].item())


def _is_followed(result: NormalModeResult) -> Bools:
    """(levels,) whether the held structure was followed."""
    of_levels = result["phase_resonance"]
    if "departure" in of_levels:
        return np.asarray(np.isfinite(of_levels["departure"].values).all(axis=1))
    return np.zeros(of_levels["level"].values.size, dtype=bool)


def resonances(result: NormalModeResult) -> Chart:
    """Response curves over the backbone: frequency against amplitude, named by level, unstable pieces dashed."""
    name, of_levels, ridge = _compared_probe(result), result["phase_resonance"], result["predicted_levels"]
    known = "resonance_curves" in result.datasets
    followed = rows_by_owner(of_levels, result["resonance_curves"], "level_index") if known else ()
    lines = {
        k: BranchLine("", curve["frequency_hz"].values, curve["amplitude"].sel(probe=name).values,
                      curve["stable"].values, {"color": curve_style(k)["color"], "linewidth": 1.2})
        for k, curve in enumerate(followed) if curve["frequency_hz"].values.size
    }  # fmt: skip
    thick = {"color": "0.55", "linestyle": "-", "linewidth": 2.6, "zorder": 1}
    predicted, found = (
        np.column_stack(
            [of_levels[f"{before}frequency_hz"].values, of_levels[f"{before}amplitude"].sel(probe=name).values]
        )
        for before in ("predicted_", "")
    )
    curves = [
        Curve("nonlinear mode", ridge["frequency_hz"].values, ridge["amplitude"].sel(probe=name).values, thick),
        *branch_curves(list(lines.values())),
        marks_curve("predicted", predicted, color="0.15", marker="o", markersize=7, markerfacecolor="white"),
        marks_curve("phase resonance", found, color="0.15", marker="D", markersize=4, zorder=6),
    ]
    shown = [predicted[:, 1], found[:, 1], *(line.y for line in lines.values())]
    y_axis = (f"Largest deflection of {name}", scale_for("m", *shown))
    chart = Chart(("Frequency", HERTZ), y_axis, curves, curve_noun="")
    if not lines:
        return chart
    at, scale = np.concatenate([line.x for line in lines.values()]), _level_scale(result)
    levels = [_level_text(float(of_levels["level"].values[k]), scale) for k in lines]
    tops = [(float(line.x[np.argmax(line.y)]), float(line.y.max())) for line in lines.values()]
    top = 1.12 * max(float(np.nanmax(y)) for y in shown)
    ends = float(at.min()), float(at.max())
    return chart._replace(x_ends=ends, y_ends=(0.0, top), names=dict(zip(levels, tops, strict=True)))


def levels(result: NormalModeResult) -> Chart:
    """The level predicted against the amplitude, and the exact motions."""
    name, of_levels, ridge = _compared_probe(result), result["phase_resonance"], result["predicted_levels"]
    order = np.argsort(ridge["energy"].values)
    amplitude = ridge["amplitude"].sel(probe=name).values
    curves = [Curve("energy balance", amplitude[order], ridge["level"].values[order])]
    found = np.column_stack([of_levels["amplitude"].sel(probe=name).values, of_levels["level"].values])
    for stable, face in ((True, RED), (False, "white")):
        shown = found[of_levels["stable"].values == stable]
        if shown.size:
            label, size = f"exact, {'stable' if stable else 'unstable'}", {"marker": "D", "markersize": 6}
            curves.append(marks_curve(label, shown, color=RED, markerfacecolor=face, **size))
    return Chart((f"Largest deflection of {name}", "m"), ("Level", _level_scale(result)), curves, log="xy")


def plot_held_shapes(level: Dataset, ax: Axes, stations: Stations) -> None:
    """Deflected shapes at two instants of the last period, over those of the mode (thesis, figures 4.14 and 4.17).

    Parameters
    ----------
    level : of a level, with its shapes (2, nx) and those of the mode.
    ax : to draw on.
    stations : nx, where shapes are known.
    """
    shapes: list[tuple[str, Any, dict[str, Any]]] = []
    instants, of_held, of_mode = (level[name].values for name in ("instants", "shapes", "mode_shapes"))
    for k in (0, 1):
        colour = {"color": curve_style(k)["color"]}
        shapes.append((f"held, t = {instants[k]:.4g} s", of_held[k], {**colour, "linestyle": "-"}))
        dotted = {**colour, "linestyle": (0, (2, 2)), "linewidth": 1.8, "alpha": 0.6, "marker": ""}
        shapes.append(("nonlinear mode then", of_mode[k], dotted))
    draw_along(ax, stations, "Deflection", shapes)


def level_spectrum(spectrum: Dataset, periods: int) -> Chart:
    """Lines of a level over all periods, in dB of the strongest."""
    frequency = spectrum["frequency_hz"].values
    highest = 20.5 * float(frequency[periods])
    reach, lines = frequency <= highest, {name: of.values for name, of in spectrum.by_label("line").items()}
    top = max(float(line[1:].max()) for line in lines.values())
    curves = [
        Curve(name, frequency[reach], 20 * np.log10(np.maximum(line[reach] / top, TINY)))
        for name, line in lines.items()
    ]
    x_axis, y_axis = ("Frequency", HERTZ), ("Amplitude (dB re largest)", "")
    return Chart(x_axis, y_axis, curves, curve_noun="probes", x_ends=(0.0, highest), y_ends=(-120.0, 6.0))


def departure(result: NormalModeResult) -> Chart:
    """Distance from the mode in every period, for all levels."""
    of_levels, scale = result["phase_resonance"], _level_scale(result)
    curves = [
        Curve(_level_text(float(of_levels["level"].values[k]), scale), of_levels["period"].values.astype(float),
              of_levels["departure"].values[k])
        for k in np.flatnonzero(_is_followed(result))
    ]  # fmt: skip
    y_axis = ("Distance from the mode\n(norm of energy)", "")
    return Chart(("Period", ""), y_axis, curves, curve_noun="levels", y_ends=(0.0, None))


def phase_resonance_figures(result: NormalModeResult) -> dict[str, Picture]:
    """Every picture of a held mode, by name; shapes and spectrum are those of the last level.

    Parameters
    ----------
    result : with at least one level.

    Returns
    -------
    By the last part of the file name.
    """
    title, of_levels = result.title, result["phase_resonance"]
    figures = {
        "phase_resonance": Picture(title, [resonances(result)]),
        "phase_resonance_level": Picture(title, [levels(result)]),
        "held_departure": Picture(title, [departure(result)]),
    }
    if _is_followed(result)[-1]:
        last, periods = of_levels.sel(level_index=of_levels.labels("level_index")[-1]), len(of_levels.labels("period"))
        under = f"{title}, {_level_text(last['level'].item(), _level_scale(result))}, {periods} periods"
        spectrum = rows_by_owner(of_levels, result["uncontrolled_spectra"], "level_index")[-1]
        shapes = partial(plot_held_shapes, last, stations=Stations.of_modes(result["modes"]))
        figures["held_shapes"] = Picture(under, [shapes])
        figures["held_spectrum"] = Picture(under, [level_spectrum(spectrum, periods)])
    return figures
