"""Plots of an identification: frequency over stiffness, residuals, profile likelihoods, harmonics."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from statistics import NormalDist
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from beamsim.analyses.identify.layouts import BEFORE, WITH, WITHOUT
from beamsim.analyses.identify.result import IdentificationResult
from beamsim.labelled import Dataset
from beamsim.plots.drawing import DARK, HERTZ, RED, Chart, Curve, Guide, Picture, finish, legend, marks_curve
from beamsim.plots.style import Scale
from beamsim.results.values import parameter_label

_MEASURED, _DOTTED = "0.45", (0, (2, 2))
_STIFFNESS = Scale(1e-3, "kN/m")


def frequencies(result: IdentificationResult, table: Dataset) -> Chart:
    """Natural frequencies over the stiffness of the snubber, with measured frequencies and identified stiffness.

    Parameters
    ----------
    result : of the identification.
    table : frequencies with the snubber.

    Returns
    -------
    A curve for each mode.
    """
    estimate, of_modes = result["stiffness"], result["curves"].groups("point_mode")
    curves = [
        Curve(f"mode {mode}", curve["stiffness"].values, curve["frequency_hz"].values)
        for mode, curve in of_modes.items()
    ]
    used, mode, predicted = estimate.labels("mode"), table["mode"].values, table["predicted_hz"].values
    measured = [
        Guide(
            "measured, thick where it is fitted" if k == 0 else "", float(f),
            {"color": _MEASURED, "linestyle": _DOTTED, "linewidth": 1.2 if mode[k] in used else 0.7},
        )
        for k, f in enumerate(table["measured_hz"].values[: len(curves)])
        if np.isfinite(f)
    ]  # fmt: skip
    stiffness = estimate["stiffness"].item()
    fitted = [(stiffness, predicted[number - 1]) for number in used]

    def bounds(ax: Axes, x: Scale, _: Scale) -> None:
        at, interval = stiffness * x.factor, x.factor * estimate["interval"].values
        ax.axvline(at, color=RED, linewidth=0.9, label=f"k = {at:.5g} {x.unit}")
        if np.all(np.isfinite(interval)):
            ax.axvspan(*interval, color=RED, alpha=0.12, linewidth=0)

    return Chart(
        ("Stiffness of the snubber", _STIFFNESS), ("Natural frequency", HERTZ), curves, measured, "xy",
        curve_noun="modes", draw_extra=bounds,
        marks=[marks_curve("", fitted, marker="o", markersize=5, color=RED, markerfacecolor="white")],
    )  # fmt: skip


def plot_residuals(before: Dataset, ax: Axes, after: Dataset | None, title: str = "") -> None:
    """Difference between predicted and measured frequencies, in percent of the measured frequency.

    Parameters
    ----------
    before : frequencies of the modes.
    ax : to draw on.
    after : the same with the updated model; None where nothing was updated.
    title : which frequencies, behind the word on the axis.
    """
    known = np.isfinite(before["measured_hz"].values)
    mode, values = before["mode"].values[known].astype(float), before["difference_percent"].values[known]
    shift = 0.0 if after is None else 0.18
    ax.axhline(0.0, color="0.4", linewidth=0.8)
    ax.bar(mode - shift, values, 0.36, color="0.8", edgecolor="0.3", label="before updating")
    if after is not None:
        values = after["difference_percent"].values[np.isfinite(after["measured_hz"].values)]
        ax.bar(mode + shift, values, 0.36, color=DARK, edgecolor=DARK, label="after")
        legend(ax)
    ax.set_xticks(mode, [f"{m:.0f}" for m in mode])
    finish(ax, f"Mode {title}".strip(), "Predicted − measured (%)")


def pad_curve(pad: Dataset, quantity: str = "stiffness") -> Chart:
    """Measured and fitted stiffness or loss factor of a pad over frequency, or its stiffness over time."""
    dynamic = "frequency_hz" in pad
    at, curve_at = pad["frequency_hz" if dynamic else "time"].values, pad["curve_at"].values
    y_axis = ("Storage stiffness" if dynamic else "Force over deflection", _STIFFNESS)
    if quantity == "loss_factor":
        y_axis = ("Loss factor", Scale(1.0, ""))
    measured, fitted = pad[f"measured_{quantity}"].values, pad[f"curve_{quantity}"].values
    dots = {"linestyle": "none", "marker": "o", "markersize": 4, "markerfacecolor": "white", "color": _MEASURED}
    line = Curve(f"{len(pad.labels('branch'))} branches", curve_at, fitted, {"color": RED})
    x_axis = ("Frequency", HERTZ) if dynamic else ("Time", Scale(1.0, "s"))
    return Chart(x_axis, y_axis, [line, Curve("measured", at, measured, dots)], log="x")


def profile_curve(profile: Dataset) -> Chart:
    """Profile likelihood: misfit above its minimum, with the level that bounds the confidence interval.

    Parameters
    ----------
    profile : of a parameter.

    Returns
    -------
    One curve.
    """
    words, unit = parameter_label(profile["parameter"].item()), profile["unit"].item()
    x_axis = (f"{words[:1].upper()}{words[1:]}", "" if unit == "1" else unit)
    coverage, value = profile["coverage"].item(), profile["value"].values
    style = {"marker": "." if value.size < 40 else ""}
    bound = NormalDist().inv_cdf(0.5 + coverage / 2) ** 2
    level = Guide(f"{100 * coverage:g} %", bound, {"linestyle": _DOTTED})
    curve = Curve("", value, profile["misfit"].values, style)
    return Chart(
        x_axis, ("Misfit above its minimum", ""), [curve], [level], y_ends=(0.0, max(3 * bound, 1e-12)),
        draw_extra=lambda ax, *_: ax.locator_params(axis="x", nbins=3),  # panels may be narrow
    )  # fmt: skip


def harmonics(test: Dataset) -> list[Chart]:
    """Measured and predicted harmonic amplitudes of one test, and the complex differences with the noise level."""
    measured, before, predicted = (
        test[f"harmonic_{name}_real"].values + 1j * test[f"harmonic_{name}_imag"].values
        for name in ("measured", "initial", "predicted")
    )
    order, name = test["harmonic_order"].values, test["name"].item()
    reference = float(np.max(np.abs(measured))) or 1.0
    amplitudes = (
        ("measured", "o", "0.2", measured),
        ("predicted before", "x", "0.6", before),
        ("predicted after", "+", RED, predicted),
    )
    residuals = (
        ("before", "x", "0.6", before - measured),
        ("after", "+", RED, predicted - measured),
        ("noise", "_", "0.3", test["harmonic_noise"].values * np.sqrt(2)),
    )
    charts, x_axis = [], ("Frequency / excitation frequency", "")
    for words, marks in ((f"{Path(name).stem}\nAmplitude", amplitudes), ("Residual", residuals)):
        curves = [
            Curve(label, order, 20 * np.log10(np.maximum(np.abs(values) / reference, 1e-9)),
                  {"linestyle": "none", "marker": mark, "color": colour, "markerfacecolor": "none"})
            for label, mark, colour, values in marks
        ]  # fmt: skip
        y_axis = (f"{words} (dB re largest)", "")
        charts.append(Chart(x_axis, y_axis, curves, draw_extra=lambda ax, *_: ax.set_xticks(order)))
    return charts


def transient(test: Dataset) -> list[Chart]:
    """A record with its prediction before and after the fit, and the residual compared with the noise."""
    x_axis, name, unit = ("Time", Scale(1.0, "s")), Path(test["name"].item()).stem, test["unit"].item()
    time, measured, before, predicted = (
        test[f"sample_{column}"].values for column in ("time", "measured", "initial", "predicted")
    )
    curves = [
        Curve("predicted before", time, before, {"color": "0.7", "linestyle": _DOTTED}),
        Curve("measured", time, measured, {"color": _MEASURED, "linestyle": "-", "linewidth": 1.6}),
        Curve("predicted after", time, predicted, {"color": RED, "linestyle": "-", "linewidth": 0.8}),
    ]
    left, noise = Curve("", time, measured - predicted, {"color": _MEASURED, "linewidth": 0.6}), test["noise"].item()
    bounds = [Guide("noise" if sign > 0 else "", sign * noise, {"linestyle": _DOTTED}) for sign in (1.0, -1.0)]
    words = test["quantity"].item().replace("_", " ")
    return [Chart(x_axis, (f"{name}\n{words}", unit), curves), Chart(x_axis, ("Residual", unit), [left], bounds)]


def swept(tests: Sequence[Dataset], branch: Dataset) -> Chart:
    """Measured peaks and jumps over the branch with the estimated values.

    Parameters
    ----------
    tests : sweeps at one level, with their peaks.
    branch : the first of them, with its branch.

    Returns
    -------
    A curve for the branch and for each number.
    """
    along = branch["point_peak"].values
    curves = [Curve("", branch["point_frequency_hz"].values, along, {"color": DARK, "linewidth": 0.9})]
    for k, test in enumerate(tests):
        colour, name, probe = f"C{k}", test["name"].item(), test["probe"].item()
        rows = dict(zip(test["peak_what"].values.tolist(), test["peak_measured"].values.tolist(), strict=True))
        if "jump" in rows:
            ends = np.array([along.min(), along.max()])
            curves.append(
                Curve(f"{name}: jump", np.full(2, rows["jump"]), ends, {"linestyle": _DOTTED, "color": colour})
            )
        if (peak := rows.get(f"peak of {probe}")) is not None:
            at = rows.get(f"frequency of {probe}", rows.get("jump", np.nan))
            marker = "^" if test["direction"].item() == "up" else "v"
            style = {"linestyle": "none", "marker": marker, "color": colour, "markersize": 7.0}
            curves.append(Curve(f"{name}: peak", np.array([at]), np.array([peak]), style))
    words = branch["quantity"].item().replace("_", " ")
    return Chart(("Frequency", HERTZ), (f"Largest {words}", branch["unit"].item()), curves)


def identification_figures(result: IdentificationResult) -> dict[str, Picture]:
    """All pictures of this result; the key is the last part of the file name."""
    panels: dict[str, list[Any]] = {}
    tables = result["frequencies"].groups("frequency_model")
    of_snubber, structure = tables.get(WITH), tables[WITHOUT]
    if of_snubber is not None:
        panels["frequencies"] = [frequencies(result, of_snubber)]
    residuals, without = [], "without the snubber"
    if BEFORE in tables:
        residuals.append(partial(plot_residuals, tables[BEFORE], after=structure, title=without))
    elif of_snubber is not None and np.isfinite(structure["measured_hz"].values).any():
        residuals.append(partial(plot_residuals, structure, after=None, title=without))
    if of_snubber is not None:
        residuals.append(partial(plot_residuals, of_snubber, after=None, title="with permanent contact"))
    if residuals:
        panels["residuals"] = residuals
    if profiles := _by_label(result, "profiles", "profile", "point"):
        panels["profiles"] = [profile_curve(profile) for profile in profiles]
    if "pad" in result.datasets:
        pad = result["pad"]
        quantities = ("stiffness", "loss_factor")[: 2 if "measured_loss_factor" in pad else 1]
        panels["pad"] = [pad_curve(pad, quantity) for quantity in quantities]
    if "tests" in result.datasets:
        panels |= _tests_of_fit(result)
    columns = {"profiles": min(len(profiles), 3), "harmonics": 2}
    return {name: Picture(result.title, each, columns=columns.get(name, 1)) for name, each in panels.items()}


def _by_label(result: IdentificationResult, dataset: str, owner: str, rows: str) -> list[Dataset]:
    """The members along a dimension of a dataset that have rows, each with its own alone."""
    if dataset not in result.datasets or rows not in result[dataset]:
        return []
    parts = result[dataset].groups(f"{rows}_{owner}").items()
    return [part.sel(**{owner: label}) for label, part in parts if part.labels(rows)]


def _tests_of_fit(result: IdentificationResult) -> dict[str, list[Any]]:
    """Panels of the tests that a fit is to, by their kind."""
    panels: dict[str, list[Any]] = {}
    if transients := _by_label(result, "tests", "test", "sample"):
        panels["transients"] = [chart for test in transients for chart in transient(test)]
    if sweeps := _by_label(result, "tests", "test", "peak"):
        branches = _by_label(result, "tests", "test", "point")
        alike: dict[tuple[float, str, str], list[int]] = {}
        for k, sweep in enumerate(sweeps):
            of = sweep["level"].item(), sweep["probe"].item(), sweep["quantity"].item()
            alike.setdefault(of, []).append(k)
        panels["sweeps"] = [swept([sweeps[k] for k in each], branches[each[0]]) for each in alike.values()]
    if steady := _by_label(result, "tests", "test", "harmonic"):
        panels["harmonics"] = [chart for test in steady for chart in harmonics(test)]
    return panels
