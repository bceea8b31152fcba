"""Plots of an identification: frequency over stiffness, residuals, profile likelihoods, harmonics."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from statistics import NormalDist

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
from beamsim.plots.drawing import DARK, RED, Curve, Guide, draw_curves, finish, legend, panels
from beamsim.plots.style import Scale
from beamsim.scenario import Scenario
from beamsim.scenario.parameters import field_type_at, find_parameters
from beamsim.scenario.quantities import Quantity
from beamsim.typing import Floats

_MEASURED, _DOTTED = "0.45", (0, (2, 2))
_STIFFNESS = Scale(1e-3, "kN/m")


def plot_frequency_curves(result: IdentificationResult, ax: Axes) -> Axes:
    """Natural frequencies over the snubber stiffness, with measured frequencies and identified stiffness."""
    estimate, table = result.estimate, result.with_snubber
    if estimate is None or table is None:
        raise ValueError("no stiffness was identified from frequencies")
    curves = [Curve(f"mode {curve.mode}", curve.stiffness, curve.frequency_hz) for curve in result.curves]
    across = ("Stiffness of the snubber", _STIFFNESS)
    draw_curves(ax, across, ("Natural frequency", Scale(1.0, "Hz")), curves, of="modes")
    for k, measured in enumerate(table.measured_hz[: len(result.curves)]):
        if np.isfinite(measured):
            used = table.mode[k] in estimate.fit_to
            ax.axhline(
                measured, color=_MEASURED, linestyle=_DOTTED, linewidth=1.2 if used else 0.7,
                label="measured, thick where it is fitted" if k == 0 else "_nolegend_",
            )  # fmt: skip
    at = estimate.stiffness / 1e3
    ax.axvline(at, color=RED, linewidth=0.9, label=f"k = {at:.5g} kN/m")
    low, high = estimate.interval
    if np.isfinite(low) and np.isfinite(high):
        ax.axvspan(low / 1e3, high / 1e3, color=RED, alpha=0.12, linewidth=0)
    fitted = [table.predicted_hz[mode - 1] for mode in estimate.fit_to]
    ax.plot([at] * len(fitted), fitted, "o", markersize=5, color=RED, markerfacecolor="white")
    ax.set(xscale="log", yscale="log")
    legend(ax)
    return ax


def plot_residuals(before: FrequencyTable, after: FrequencyTable | None, ax: Axes, title: str = "") -> Axes:
    """Difference between predicted and measured frequencies, in percent of the measured frequency."""
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


def plot_pad(pad: PadFit, axes: Sequence[Axes]) -> None:
    """Measured and fitted stiffness of a pad over frequency, with its loss factor, or over time; one or two axes."""
    dynamic = pad.frequency_hz is not None
    at = pad.frequency_hz if dynamic else pad.time
    if at is None:
        raise ValueError("nothing was measured on the pad")
    stiffness = ("Storage stiffness" if dynamic else "Force over deflection", _STIFFNESS)
    rows = [(stiffness, pad.measured_stiffness, pad.curve_stiffness)]
    if pad.measured_loss_factor is not None:
        rows.append((("Loss factor", Scale(1.0, "")), pad.measured_loss_factor, pad.curve_loss_factor))
    dots = {"linestyle": "none", "marker": "o", "markersize": 4, "markerfacecolor": "white", "color": _MEASURED}
    for ax, (up, measured, fitted) in zip(axes, rows, strict=True):
        line = Curve(f"{pad.branch_stiffness.size} branches", pad.curve_at, fitted, {"color": RED})
        across = ("Frequency", Scale(1.0, "Hz")) if dynamic else ("Time", Scale(1.0, "s"))
        draw_curves(ax, across, up, [line, Curve("measured", at, measured, dots)])
        ax.set_xscale("log")


def plot_profile(profile: ProfileLikelihood, ax: Axes, coverage: float, unit: str = "") -> Axes:
    """Profile likelihood: misfit above its minimum, with the level that bounds the confidence interval."""
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
    figures: dict[str, Figure] = {}
    update, fit = result.update, result.nonlinear
    if result.estimate is not None and result.with_snubber is not None:
        figures["frequencies"], (ax,) = panels(result.title, size=(8.0, 4.6))
        plot_frequency_curves(result, ax)
    tables: list[tuple[FrequencyTable, FrequencyTable | None, str]] = []
    if update is not None:
        tables.append((update.before, update.after, "without the snubber"))
    elif np.isfinite(result.without_snubber.measured_hz).any():
        tables.append((result.without_snubber, None, "without the snubber"))
    if result.estimate is not None and result.with_snubber is not None:
        tables.append((result.with_snubber, None, "with permanent contact"))
    if update is not None or result.estimate is not None:
        figures["residuals"], axes = panels(result.title, len(tables), size=(8.0, 1.2 + 2.4 * len(tables)))
        for ax, (before, after, title) in zip(axes, tables, strict=True):
            plot_residuals(before, after, ax, title)
    if profiles := _profiles(result):
        columns = min(len(profiles), 3)
        size = (8.0, 3.4 * -(-len(profiles) // columns))
        figures["profiles"], axes = panels(result.title, len(profiles), columns, size)
        for ax, (profile, coverage, unit) in zip(axes, profiles, strict=True):
            plot_profile(profile, ax, coverage, unit)
    if result.pad is not None:
        count = 1 if result.pad.measured_loss_factor is None else 2
        figures["pad"], axes = panels(result.title, count, size=(8.0, 4.6 if count == 1 else 5.6))
        plot_pad(result.pad, axes)
    if fit is not None:
        figures["harmonics"], axes = panels(result.title, 2 * len(fit.tests), 2, (8.0, 0.6 + 3.0 * len(fit.tests)))
        for k, test in enumerate(fit.tests):
            plot_harmonics(test, axes[2 * k])
            plot_harmonic_residuals(test, axes[2 * k + 1])
    return figures


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
