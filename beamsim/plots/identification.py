"""Plots of an identification: frequency over stiffness, residuals, profile likelihoods, harmonics."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from statistics import NormalDist
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from beamsim.analyses.designs.result import parameter_label
from beamsim.analyses.identify.result import (
    FrequencyTable,
    IdentificationResult,
    PadFit,
    ProfileLikelihood,
    TestFit,
)
from beamsim.plots.drawing import DARK, HERTZ, RED, Chart, Curve, Guide, draw_curves, finish, legend, picture
from beamsim.plots.style import Scale
from beamsim.scenario import Scenario
from beamsim.scenario.parameters import field_type_at, find_parameters
from beamsim.scenario.quantities import Quantity
from beamsim.typing import Floats

_MEASURED, _DOTTED = "0.45", (0, (2, 2))
_STIFFNESS = Scale(1e-3, "kN/m")


def frequencies(result: IdentificationResult) -> Chart:
    """Natural frequencies over the stiffness of the snubber."""
    curves = [Curve(f"mode {curve.mode}", curve.stiffness, curve.frequency_hz) for curve in result.curves]
    across = ("Stiffness of the snubber", _STIFFNESS)
    return Chart(across, ("Natural frequency", HERTZ), curves, log="xy", of="modes")


def plot_frequency_curves(result: IdentificationResult, ax: Axes) -> Axes:
    """Natural frequencies over the snubber stiffness, with measured frequencies and identified stiffness."""
    estimate, table = result.estimate, result.with_snubber
    if estimate is None or table is None:
        raise ValueError("no stiffness was identified from frequencies")
    draw_curves(ax, *frequencies(result))
    for k, measured in enumerate(table.measured_hz[: len(result.curves)]):
        if np.isfinite(measured):
            used = table.mode[k] in estimate.fit_to
            ax.axhline(
                measured, color=_MEASURED, linestyle=_DOTTED, linewidth=1.2 if used else 0.7,
                label="measured, thick where it is fitted" if k == 0 else "_nolegend_",
            )  # fmt: skip
    at = estimate.stiffness / 1e3
    ax.axvline(at, color=RED, linewidth=0.9, label=f"k = {at:.5g} kN/m")
    if np.all(np.isfinite(estimate.interval)):
        low, high = estimate.interval
        ax.axvspan(low / 1e3, high / 1e3, color=RED, alpha=0.12, linewidth=0)
    fitted = [table.predicted_hz[mode - 1] for mode in estimate.fit_to]
    ax.plot([at] * len(fitted), fitted, "o", markersize=5, color=RED, markerfacecolor="white")
    legend(ax)
    return ax


def plot_residuals(before: FrequencyTable, ax: Axes, after: FrequencyTable | None, title: str = "") -> Axes:
    """Difference between predicted and measured frequencies, in percent of the measured frequency.

    Parameters
    ----------
    before : frequencies of the modes.
    ax : to draw on.
    after : the same with the updated model; None where nothing was updated.
    title : which frequencies, behind the word on the axis.

    Returns
    -------
    The axes.
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
    return ax


def plot_pad(pad: PadFit, ax: Axes, quantity: str = "stiffness") -> Axes:
    """Measured and fitted stiffness or loss factor of a pad over frequency, or its stiffness over time.

    Parameters
    ----------
    pad : with what was measured on it.
    ax : to draw on.
    quantity : stiffness, or loss_factor where that was measured over frequency.

    Returns
    -------
    The axes.

    Raises
    ------
    ValueError
        If the fit has neither frequencies nor times that were measured.
    """
    dynamic = pad.frequency_hz is not None
    at = pad.frequency_hz if dynamic else pad.time
    if at is None:
        raise ValueError("nothing was measured on the pad")
    up = ("Storage stiffness" if dynamic else "Force over deflection", _STIFFNESS)
    if quantity == "loss_factor":
        up = ("Loss factor", Scale(1.0, ""))
    measured, fitted = getattr(pad, f"measured_{quantity}"), getattr(pad, f"curve_{quantity}")
    dots = {"linestyle": "none", "marker": "o", "markersize": 4, "markerfacecolor": "white", "color": _MEASURED}
    line = Curve(f"{pad.branch_stiffness.size} branches", pad.curve_at, fitted, {"color": RED})
    across = ("Frequency", HERTZ) if dynamic else ("Time", Scale(1.0, "s"))
    draw_curves(ax, across, up, [line, Curve("measured", at, measured, dots)], log="x")
    return ax


def plot_profile(profile: ProfileLikelihood, ax: Axes, coverage: float, unit: str = "") -> Axes:
    """Profile likelihood: misfit above its minimum, with the level that bounds the confidence interval.

    Parameters
    ----------
    profile : of a parameter.
    ax : to draw on.
    coverage : of the confidence interval, between 0 and 1.
    unit : SI unit of the parameter, empty of a ratio.

    Returns
    -------
    The axes.
    """
    words = parameter_label(profile.parameter)
    across = (f"{words[:1].upper()}{words[1:]}", unit)
    style = {"marker": "." if profile.value.size < 40 else ""}
    bound = NormalDist().inv_cdf(0.5 + coverage / 2) ** 2
    level = Guide(f"{100 * coverage:g} %", bound, {"linestyle": _DOTTED})
    curve = Curve("", profile.value, profile.misfit, style)
    draw_curves(ax, across, ("Misfit above its minimum", ""), [curve], [level])
    ax.set_ylim(0.0, max(3 * bound, 1e-12))
    ax.locator_params(axis="x", nbins=3)  # panels may be narrow
    return ax


def plot_harmonics(test: TestFit, ax: Axes) -> Axes:
    """Measured and predicted harmonic amplitudes of one test, dB re the largest measured one."""
    marks = (
        ("measured", "o", "0.2", np.abs(test.measured)),
        ("predicted before", "x", "0.6", np.abs(test.before)),
        ("predicted after", "+", RED, np.abs(test.predicted)),
    )
    return _draw_harmonics(test, ax, f"{Path(test.name).stem}\nAmplitude (dB re largest)", marks)


def plot_harmonic_residuals(test: TestFit, ax: Axes) -> Axes:
    """Complex difference between predicted and measured harmonics before and after the fit, with the noise level."""
    marks = (
        ("before", "x", "0.6", np.abs(test.before - test.measured)),
        ("after", "+", RED, np.abs(test.predicted - test.measured)),
        ("noise", "_", "0.3", test.noise * np.sqrt(2)),
    )
    return _draw_harmonics(test, ax, "Residual (dB re largest)", marks)


def _draw_harmonics(test: TestFit, ax: Axes, label: str, marks: Sequence[tuple[str, str, str, Floats]]) -> Axes:
    reference = float(np.max(np.abs(test.measured))) or 1.0
    curves = [
        Curve(name, test.order, 20 * np.log10(np.maximum(values / reference, 1e-9)),
              {"linestyle": "none", "marker": mark, "color": colour, "markerfacecolor": "none"})
        for name, mark, colour, values in marks
    ]  # fmt: skip
    draw_curves(ax, ("Frequency / excitation frequency", ""), (label, ""), curves)
    ax.set_xticks(test.order)
    return ax


def identification_figures(result: IdentificationResult) -> dict[str, Figure]:
    """All plots available for this result; the key is the last part of the file name."""
    plots: dict[str, list[Any]] = {}
    update, fit, pad = result.update, result.nonlinear, result.pad
    of_snubber = result.with_snubber if result.estimate is not None else None
    if of_snubber is not None:
        plots["frequencies"] = [partial(plot_frequency_curves, result)]
    if update is not None or of_snubber is not None:
        plots["residuals"] = residuals = []
        if update is not None:
            residuals.append(partial(plot_residuals, update.before, after=update.after, title="without the snubber"))
        elif np.isfinite(result.without_snubber.measured_hz).any():
            residuals.append(partial(plot_residuals, result.without_snubber, after=None, title="without the snubber"))
        if of_snubber is not None:
            residuals.append(partial(plot_residuals, of_snubber, after=None, title="with permanent contact"))
    if profiles := _profiles(result):
        plots["profiles"] = [
            partial(plot_profile, profile, coverage=coverage, unit=unit) for profile, coverage, unit in profiles
        ]
    if pad is not None:
        quantities = ("stiffness", "loss_factor")[: 1 if pad.measured_loss_factor is None else 2]
        plots["pad"] = [partial(plot_pad, pad, quantity=quantity) for quantity in quantities]
    if fit is not None:
        drawn = (plot_harmonics, plot_harmonic_residuals)
        plots["harmonics"] = [partial(plot, test) for test in fit.tests for plot in drawn]
    columns = {"profiles": min(len(profiles), 3), "harmonics": 2}
    return {name: picture(result.title, *panels, columns=columns.get(name, 1)) for name, panels in plots.items()}


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
