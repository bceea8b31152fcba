"""Plots of an identification: frequency over stiffness, residuals, profile likelihoods, harmonics."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from statistics import NormalDist
from typing import TYPE_CHECKING

import numpy as np

from beamsim.analyses.designs.result import parameter_label
from beamsim.analyses.identify.result import (
    FrequencyTable,
    IdentificationResult,
    PadFit,
    ProfileLikelihood,
    TestFit,
)
from beamsim.plots.style import MOST_CURVES, curve_style, finish, put_title, scale_for
from beamsim.scenario.parameters import field_type_at, find_parameters
from beamsim.scenario.quantities import Quantity
from beamsim.typing import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from beamsim.scenario import Scenario

_MEASURED, _FITTED, _PALE = "0.45", "#d1495b", "0.8"


def plot_frequency_curves(result: IdentificationResult, ax: Axes) -> Axes:
    """Natural frequencies over the snubber stiffness, with measured frequencies and identified stiffness."""
    estimate = result.estimate
    if estimate is None or result.with_snubber is None:
        raise ValueError("no stiffness was identified from frequencies")
    for k, curve in enumerate(result.curves[:MOST_CURVES]):
        ax.plot(curve.stiffness / 1e3, curve.frequency_hz, label=f"mode {curve.mode}", **curve_style(k))
    table = result.with_snubber
    for k, measured in enumerate(table.measured_hz[: len(result.curves)]):
        if np.isfinite(measured):
            used = table.mode[k] in estimate.fit_to
            ax.axhline(
                measured, color=_MEASURED, linestyle=(0, (2, 2)), linewidth=1.2 if used else 0.7,
                label="measured, thick where it is fitted" if k == 0 else "_nolegend_",
            )  # fmt: skip
    ax.axvline(estimate.stiffness / 1e3, color=_FITTED, linewidth=0.9, label=f"k = {estimate.stiffness / 1e3:.5g} kN/m")
    low, high = estimate.interval
    if np.isfinite(low) and np.isfinite(high):
        ax.axvspan(low / 1e3, high / 1e3, color=_FITTED, alpha=0.12, linewidth=0)
    for mode in estimate.fit_to:
        ax.plot(
            [estimate.stiffness / 1e3], [table.predicted_hz[mode - 1]], marker="o", markersize=5, color=_FITTED,
            markerfacecolor="white", linestyle="none",
        )  # fmt: skip
    ax.set_xscale("log")
    ax.set_yscale("log")
    finish(ax, "Stiffness of the snubber (kN/m)", "Natural frequency (Hz)")
    ax.legend(loc="best", frameon=False, fontsize="small", handlelength=2.6)
    return ax


def plot_residuals(before: FrequencyTable, after: FrequencyTable | None, ax: Axes, names: tuple[str, str]) -> Axes:
    """Difference between predicted and measured frequencies, in percent of the measured frequency."""
    known = np.isfinite(before.measured_hz)
    mode = before.mode[known].astype(float)
    width = 0.36 if after is not None else 0.5
    shift = width / 2 if after is not None else 0.0
    ax.axhline(0.0, color="0.4", linewidth=0.8)
    ax.bar(mode - shift, before.difference_percent[known], width, color=_PALE, edgecolor="0.3", label=names[0])
    if after is not None:
        values = after.difference_percent[np.isfinite(after.measured_hz)]
        ax.bar(mode + shift, values, width, color="#0b3c5d", edgecolor="#0b3c5d", label=names[1])
        ax.legend(loc="best", frameon=False, fontsize="small")
    ax.set_xticks(mode, [f"{m:.0f}" for m in mode])
    finish(ax, "Mode", "Predicted − measured (%)")
    return ax


def plot_pad(pad: PadFit, axes: Sequence[Axes]) -> None:
    """Measured and fitted stiffness of a pad over frequency, with its loss factor, or over time; one or two axes."""
    dynamic = pad.frequency_hz is not None
    at = pad.frequency_hz if dynamic else pad.time
    if at is None:
        raise ValueError("nothing was measured on the pad")
    rows = [("Storage stiffness (kN/m)" if dynamic else "Force over deflection (kN/m)", 1e-3, pad.measured_stiffness,
             pad.curve_stiffness)]  # fmt: skip
    if pad.measured_loss_factor is not None:
        rows.append(("Loss factor", 1.0, pad.measured_loss_factor, pad.curve_loss_factor))
    for ax, (label, factor, measured, fitted) in zip(axes, rows, strict=True):
        ax.plot(
            pad.curve_at, factor * fitted, color=_FITTED, linewidth=1.2, label=f"{pad.branch_stiffness.size} branches"
        )
        ax.plot(at, factor * measured, "o", color=_MEASURED, markersize=4, markerfacecolor="white", label="measured")
        ax.set_xscale("log")
        finish(ax, "Frequency (Hz)" if dynamic else "Time (s)", label)
    axes[0].legend(loc="best", frameon=False, fontsize="small")


def plot_profile(profile: ProfileLikelihood, ax: Axes, coverage: float, unit: str = "") -> Axes:
    """Profile likelihood: misfit above its minimum, with the level that bounds the confidence interval."""
    scale = scale_for(unit, profile.value)
    x = profile.value * scale.factor
    ax.plot(x, profile.misfit, color="#0b3c5d", linewidth=1.2, marker="." if x.size < 40 else "")
    level = NormalDist().inv_cdf(0.5 + coverage / 2) ** 2
    ax.axhline(level, color=_MEASURED, linestyle=(0, (2, 2)), linewidth=1.0)
    ax.annotate(f"{100 * coverage:g} %", (1.0, level), xycoords=("axes fraction", "data"), ha="right", va="bottom",
                fontsize="small", color="0.3")  # fmt: skip
    ax.set_ylim(0.0, max(3 * level, 1e-12))
    words = parameter_label(profile.parameter)
    unit = f" ({scale.unit})" if scale.unit else ""
    finish(ax, f"{words[:1].upper()}{words[1:]}{unit}", "Misfit above its minimum")
    return ax


def plot_harmonics(test: TestFit, ax: Axes) -> Axes:
    """Measured and predicted harmonic amplitudes of one test, dB re the largest measured one."""
    for values, label, mark, colour in (
        (test.measured, "measured", "o", "0.2"),
        (test.before, "predicted before", "x", "0.6"),
        (test.predicted, "predicted after", "+", _FITTED),
    ):
        ax.plot(test.order, _level(test, np.abs(values)), mark, color=colour, label=label, markerfacecolor="none")
    return _finish_harmonics(test, ax, f"{Path(test.name).stem}\nAmplitude (dB re largest)")


def plot_harmonic_residuals(test: TestFit, ax: Axes) -> Axes:
    """Complex difference between predicted and measured harmonics before and after the fit, with the noise level."""
    ax.plot(test.order, _level(test, np.abs(test.before - test.measured)), "x", color="0.6", label="before")
    ax.plot(test.order, _level(test, np.abs(test.predicted - test.measured)), "+", color=_FITTED, label="after")
    ax.plot(test.order, _level(test, test.noise * np.sqrt(2)), "_", color="0.3", label="noise")
    return _finish_harmonics(test, ax, "Residual (dB re largest)")


def _level(test: TestFit, values: Floats) -> Floats:
    reference = float(np.max(np.abs(test.measured))) or 1.0
    return np.asarray(20 * np.log10(np.maximum(values / reference, 1e-9)))


def _finish_harmonics(test: TestFit, ax: Axes, label: str) -> Axes:
    ax.set_xticks(test.order)
    finish(ax, "Frequency / excitation frequency", label)
    ax.legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, frameon=False, fontsize="small", borderaxespad=0.1,
        handlelength=1.2,
    )  # fmt: skip
    return ax


def identification_figures(result: IdentificationResult) -> dict[str, Figure]:
    """All plots available for this result; the key is the last part of the file name."""
    figures: dict[str, Figure] = {}
    if result.estimate is not None and result.with_snubber is not None:
        figure, (ax,) = _panels(result.title, 1)
        plot_frequency_curves(result, ax)
        figures["frequencies"] = figure
        figure, axes = _panels(result.title, 2, height=5.6)
        update = result.update
        if update is not None:
            plot_residuals(update.before, update.after, axes[0], ("before updating", "after"))
        elif np.isfinite(result.without_snubber.measured_hz).any():
            plot_residuals(result.without_snubber, None, axes[0], ("", ""))
        else:
            axes[0].set_visible(False)
        axes[0].set_title("without the snubber", fontsize="small", loc="left")
        plot_residuals(result.with_snubber, None, axes[1], ("", ""))
        axes[1].set_title("with permanent contact", fontsize="small", loc="left")
        figures["residuals"] = figure
    elif result.update is not None:
        figure, (ax,) = _panels(result.title, 1)
        plot_residuals(result.update.before, result.update.after, ax, ("before updating", "after"))
        figures["residuals"] = figure
    profiles = _profiles(result)
    if profiles:
        columns = min(len(profiles), 3)
        rows = -(-len(profiles) // columns)
        figure, axes = _panels(result.title, rows, columns, 3.4 * rows)
        for ax, (profile, coverage, unit) in zip(axes, profiles, strict=False):
            plot_profile(profile, ax, coverage, unit)
            if columns > 1:  # narrow panels
                ax.locator_params(axis="x", nbins=4)
        for ax in axes[len(profiles) :]:
            ax.set_visible(False)
        figures["profiles"] = figure
    if result.pad is not None:
        panels = 1 if result.pad.measured_loss_factor is None else 2
        figure, axes = _panels(result.title, panels, height=4.6 if panels == 1 else 5.6)
        plot_pad(result.pad, axes)
        figures["pad"] = figure
    if result.nonlinear is not None:
        tests = result.nonlinear.tests
        figure, axes = _panels(result.title, len(tests), 2, height=0.6 + 3.0 * len(tests))
        for k, test in enumerate(tests):
            plot_harmonics(test, axes[2 * k])
            plot_harmonic_residuals(test, axes[2 * k + 1])
        figures["harmonics"] = figure
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


def _panels(title: str, rows: int, columns: int = 1, height: float = 4.6) -> tuple[Figure, list[Axes]]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, height), layout="constrained")
    if title:
        put_title(figure, title)
    return figure, list(figure.subplots(rows, columns, squeeze=False).ravel())
