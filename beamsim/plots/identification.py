"""Plots of an identification: frequency over stiffness, residuals, profile likelihoods, harmonics."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from statistics import NormalDist
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from beamsim.analyses.identify.result import (
    FrequencyTable,
    IdentificationResult,
    NonlinearEstimate,
    PadFit,
    ProfileLikelihood,
    StiffnessEstimate,
    SweepFit,
    TestFit,
    TransientFit,
)
from beamsim.plots.drawing import DARK, HERTZ, RED, Chart, Curve, Guide, Picture, finish, legend, marked
from beamsim.plots.style import Scale
from beamsim.results.values import parameter_label
from beamsim.scenario import Scenario
from beamsim.scenario.parameters import field_type_at, find_parameters
from beamsim.scenario.quantities import Quantity

_MEASURED, _DOTTED = "0.45", (0, (2, 2))
_STIFFNESS = Scale(1e-3, "kN/m")


def frequencies(result: IdentificationResult, estimate: StiffnessEstimate, table: FrequencyTable) -> Chart:
    """Natural frequencies over the stiffness of the snubber, with measured frequencies and identified stiffness.

    Parameters
    ----------
    result : of the identification.
    estimate : of the stiffness.
    table : frequencies with the snubber.

    Returns
    -------
    A curve for each mode.
    """
    curves = [Curve(f"mode {curve.mode}", curve.stiffness, curve.frequency_hz) for curve in result.curves]
    measured = [
        Guide(
            "measured, thick where it is fitted" if k == 0 else "", float(f),
            {"color": _MEASURED, "linestyle": _DOTTED, "linewidth": 1.2 if table.mode[k] in estimate.fit_to else 0.7},
        )
        for k, f in enumerate(table.measured_hz[: len(result.curves)])
        if np.isfinite(f)
    ]  # fmt: skip
    fitted = [(estimate.stiffness, table.predicted_hz[mode - 1]) for mode in estimate.fit_to]

    def bounds(ax: Axes, x: Scale, _: Scale) -> None:
        at, interval = estimate.stiffness * x.factor, x.factor * np.array(estimate.interval)
        ax.axvline(at, color=RED, linewidth=0.9, label=f"k = {at:.5g} {x.unit}")
        if np.all(np.isfinite(interval)):
            ax.axvspan(*interval, color=RED, alpha=0.12, linewidth=0)

    return Chart(
        ("Stiffness of the snubber", _STIFFNESS), ("Natural frequency", HERTZ), curves, measured, "xy", of="modes",
        marks=[marked("", fitted, marker="o", markersize=5, color=RED, markerfacecolor="white")], more=bounds,
    )  # fmt: skip


def plot_residuals(before: FrequencyTable, ax: Axes, after: FrequencyTable | None, title: str = "") -> None:
    """Difference between predicted and measured frequencies, in percent of the measured frequency.

    Parameters
    ----------
    before : frequencies of the modes.
    ax : to draw on.
    after : the same with the updated model; None where nothing was updated.
    title : which frequencies, behind the word on the axis.
    """
    known = np.isfinite(before.measured_hz)
    mode = before.mode[known].astype(float)
    shift = 0.0 if after is None else 0.18
    ax.axhline(0.0, color="0.4", linewidth=0.8)
    ax.bar(mode - shift, before.difference_percent[known], 0.36, color="0.8", edgecolor="0.3", label="before updating")
    if after is not None:
        values = after.difference_percent[np.isfinite(after.measured_hz)]
        ax.bar(mode + shift, values, 0.36, color=DARK, edgecolor=DARK, label="after")
        legend(ax)
    ax.set_xticks(mode, [f"{m:.0f}" for m in mode])
    finish(ax, f"Mode {title}".strip(), "Predicted − measured (%)")


def pad_curve(pad: PadFit, quantity: str = "stiffness") -> Chart:
    """Measured and fitted stiffness or loss factor of a pad over frequency, or its stiffness over time."""
    dynamic = pad.frequency_hz is not None
    at = pad.frequency_hz if dynamic else pad.time
    assert at is not None  # as the fit is to what was measured over one of them
    up = ("Storage stiffness" if dynamic else "Force over deflection", _STIFFNESS)
    if quantity == "loss_factor":
        up = ("Loss factor", Scale(1.0, ""))
    measured, fitted = getattr(pad, f"measured_{quantity}"), getattr(pad, f"curve_{quantity}")
    dots = {"linestyle": "none", "marker": "o", "markersize": 4, "markerfacecolor": "white", "color": _MEASURED}
    line = Curve(f"{pad.branch_stiffness.size} branches", pad.curve_at, fitted, {"color": RED})
    across = ("Frequency", HERTZ) if dynamic else ("Time", Scale(1.0, "s"))
    return Chart(across, up, [line, Curve("measured", at, measured, dots)], log="x")


def profile_curve(profile: ProfileLikelihood, coverage: float, unit: str = "") -> Chart:
    """Profile likelihood: misfit above its minimum, with the level that bounds the confidence interval.

    Parameters
    ----------
    profile : of a parameter.
    coverage : of the confidence interval, between 0 and 1.
    unit : SI unit of the parameter, empty of a ratio.

    Returns
    -------
    One curve.
    """
    words = parameter_label(profile.parameter)
    across = (f"{words[:1].upper()}{words[1:]}", unit)
    style = {"marker": "." if profile.value.size < 40 else ""}
    bound = NormalDist().inv_cdf(0.5 + coverage / 2) ** 2
    level = Guide(f"{100 * coverage:g} %", bound, {"linestyle": _DOTTED})
    curve = Curve("", profile.value, profile.misfit, style)
    return Chart(
        across, ("Misfit above its minimum", ""), [curve], [level], y_ends=(0.0, max(3 * bound, 1e-12)),
        more=lambda ax, *_: ax.locator_params(axis="x", nbins=3),  # panels may be narrow
    )  # fmt: skip


def harmonics(test: TestFit) -> list[Chart]:
    """Measured and predicted harmonic amplitudes of one test, and the complex differences with the noise level."""
    reference = float(np.max(np.abs(test.measured))) or 1.0
    amplitudes = (
        ("measured", "o", "0.2", test.measured),
        ("predicted before", "x", "0.6", test.before),
        ("predicted after", "+", RED, test.predicted),
    )
    residuals = (
        ("before", "x", "0.6", test.before - test.measured),
        ("after", "+", RED, test.predicted - test.measured),
        ("noise", "_", "0.3", test.noise * np.sqrt(2)),
    )
    charts, across = [], ("Frequency / excitation frequency", "")
    for words, marks in ((f"{Path(test.name).stem}\nAmplitude", amplitudes), ("Residual", residuals)):
        curves = [
            Curve(name, test.order, 20 * np.log10(np.maximum(np.abs(values) / reference, 1e-9)),
                  {"linestyle": "none", "marker": mark, "color": colour, "markerfacecolor": "none"})
            for name, mark, colour, values in marks
        ]  # fmt: skip
        up = (f"{words} (dB re largest)", "")
        charts.append(Chart(across, up, curves, more=lambda ax, *_: ax.set_xticks(test.order)))
    return charts


def transient(test: TransientFit) -> list[Chart]:
    """A record with what is predicted before and after the fit, and what the fit leaves beside the noise."""
    time, name = ("Time", Scale(1.0, "s")), Path(test.name).stem
    curves = [
        Curve("predicted before", test.time, test.before, {"color": "0.7", "linestyle": _DOTTED}),
        Curve("measured", test.time, test.measured, {"color": _MEASURED, "linestyle": "-", "linewidth": 1.6}),
        Curve("predicted after", test.time, test.predicted, {"color": RED, "linestyle": "-", "linewidth": 0.8}),
    ]
    left = Curve("", test.time, test.measured - test.predicted, {"color": _MEASURED, "linewidth": 0.6})
    bounds = [Guide("noise" if sign > 0 else "", sign * test.noise, {"linestyle": _DOTTED}) for sign in (1.0, -1.0)]
    words = test.quantity.replace("_", " ")
    return [Chart(time, (f"{name}\n{words}", test.unit), curves), Chart(time, ("Residual", test.unit), [left], bounds)]


def swept(tests: Sequence[SweepFit]) -> Chart:
    """Measured peaks and jumps over the branches with the estimated values."""
    curves = [Curve("", tests[0].branch_frequency_hz, tests[0].branch_peak, {"color": DARK, "linewidth": 0.9})]
    for k, test in enumerate(tests):
        colour = f"C{k}"
        rows = dict(zip(test.what, test.measured.tolist(), strict=True))
        if "jump" in rows:
            ends = np.array([test.branch_peak.min(), test.branch_peak.max()])
            curves.append(
                Curve(f"{test.name}: jump", np.full(2, rows["jump"]), ends, {"linestyle": _DOTTED, "color": colour})
            )
        if (peak := rows.get(f"peak of {test.probe}")) is not None:
            at = rows.get(f"frequency of {test.probe}", rows.get("jump", np.nan))
            marker = "^" if test.direction == "up" else "v"
            style = {"linestyle": "none", "marker": marker, "color": colour, "markersize": 7.0}
            curves.append(Curve(f"{test.name}: peak", np.array([at]), np.array([peak]), style))
    words = tests[0].quantity.replace("_", " ")
    return Chart(("Frequency", HERTZ), (f"Largest {words}", tests[0].unit), curves)


def identification_figures(result: IdentificationResult) -> dict[str, Picture]:
    """All pictures of this result; the key is the last part of the file name."""
    panels: dict[str, list[Any]] = {}
    update, fit, pad, estimate = result.update, result.nonlinear, result.pad, result.estimate
    of_snubber = result.with_snubber if estimate is not None else None
    if estimate is not None and of_snubber is not None:
        panels["frequencies"] = [frequencies(result, estimate, of_snubber)]
    residuals, without = [], "without the snubber"
    if update is not None:
        residuals.append(partial(plot_residuals, update.before, after=update.after, title=without))
    elif of_snubber is not None and np.isfinite(result.without_snubber.measured_hz).any():
        residuals.append(partial(plot_residuals, result.without_snubber, after=None, title=without))
    if of_snubber is not None:
        residuals.append(partial(plot_residuals, of_snubber, after=None, title="with permanent contact"))
    if residuals:
        panels["residuals"] = residuals
    if profiles := _profiles(result):
        panels["profiles"] = [profile_curve(profile, coverage, unit) for profile, coverage, unit in profiles]
    if pad is not None:
        quantities = ("stiffness", "loss_factor")[: 1 if pad.measured_loss_factor is None else 2]
        panels["pad"] = [pad_curve(pad, quantity) for quantity in quantities]
    if fit is not None:
        panels |= _tests_of_fit(fit)
    columns = {"profiles": min(len(profiles), 3), "harmonics": 2}
    return {name: Picture(result.title, each, columns=columns.get(name, 1)) for name, each in panels.items()}


def _tests_of_fit(fit: NonlinearEstimate) -> dict[str, list[Any]]:
    """Panels of the tests that a fit is to, by their kind."""
    panels: dict[str, list[Any]] = {}
    if fit.transients:
        panels["transients"] = [chart for test in fit.transients for chart in transient(test)]
    if fit.sweeps:
        alike: dict[tuple[float, str, str], list[SweepFit]] = {}
        for sweep in fit.sweeps:
            alike.setdefault((sweep.level, sweep.probe, sweep.quantity), []).append(sweep)
        panels["sweeps"] = [swept(tests) for tests in alike.values()]
    if fit.tests:
        panels["harmonics"] = [chart for test in fit.tests for chart in harmonics(test)]
    return panels


def _profiles(result: IdentificationResult) -> list[tuple[ProfileLikelihood, float, str]]:
    profiles: list[tuple[ProfileLikelihood, float, str]] = []
    if result.profile is not None and result.estimate is not None:
        profiles.append((result.profile, result.estimate.coverage, "N/m"))
    section = result.scenario.identify_stiffness
    coverage = 0.95 if section is None else section.coverage
    if result.update is not None:
        profiles += [(each, coverage, _unit(result.scenario, each.parameter)) for each in result.update.profiles]
    if (fit := result.nonlinear) is not None:
        profiles += [(each, fit.coverage, _unit(result.scenario, each.parameter)) for each in fit.profiles]
    return profiles


def _unit(scenario: Scenario, path: str) -> str:
    """SI unit of a parameter of the scenario; empty of a ratio."""
    places = find_parameters(scenario, path)
    field = field_type_at(scenario, places[0]) if places else None
    return field.dimension.unit if isinstance(field, Quantity) else ""
