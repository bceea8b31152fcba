"""Plots of a sweep: response over frequency, waterfall, levels, energy in the harmonics, contact."""

from __future__ import annotations

from fractions import Fraction
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.analyses.sweep.result import SweepResult
from beamsim.plots.bounds import draw_limit
from beamsim.plots.notching import notching_figure
from beamsim.plots.outputs import output_label
from beamsim.plots.style import (
    MOST_CURVES,
    curve_style,
    finish,
    legend,
    level_text,
    put_title,
    scale_for,
    where_other,
)
from beamsim.plots.sweep_axes import by_frequency, envelope, frequency_axis, name_level
from beamsim.plots.sweep_responses import (
    has_spectrogram,
    has_transmissibility,
    plot_acceleration,
    plot_spectrogram,
    plot_transmissibility,
)
from beamsim.scenario.limits import OF_OUTPUTS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from beamsim.analyses.sweep.result import SweepCurve
    from beamsim.typing import Floats

MOST_LEVELS = 4  # whose harmonics are drawn
ENERGY_SHOWN = 1e-8  # of the largest, below which harmonics are not drawn
MOST_PERIODS = 8  # that an axis numbers
MOST_MARKS = 8  # labelled peaks in one plot
_MARKS = {
    "linear resonance": "o",
    "nonlinear resonance": "o",
    "superharmonic": "^",
    "subharmonic": "v",
    "beat": "x",
    "level step": "|",
}


def plot_response(result: SweepResult, ax: Axes, probe: str, level_index: int = 0) -> Axes:
    """Peak displacement over frequency, up and down, with that of the linear structure without snubbers."""
    curves = [c for c in result.curves.values() if c.level_index == level_index]
    scale = scale_for("m", *(c.displacement[probe].peak for c in curves))
    if curves:
        linear = result.linear
        amplitude = np.interp(linear.frequency_hz, *by_frequency(curves[0], curves[0].excitation_amplitude))
        ax.plot(
            linear.frequency_hz,
            np.abs(linear.displacement[probe]) * amplitude * scale.factor,
            color="0.6",
            linewidth=1.0,
            label="without snubbers (linear)",
            zorder=1,
        )
    for k, curve in enumerate(curves):
        f, peak = envelope(curve, curve.displacement[probe].peak)
        ax.plot(f, peak * scale.factor, label=f"sweep {curve.direction}", **curve_style(k))
    names = {c.name for c in curves}
    named = [p for p in result.peaks if p.curve in names and p.probe == probe][:MOST_MARKS]
    for kind in dict.fromkeys(p.kind for p in named):
        peaks = [p for p in named if p.kind == kind]
        ax.plot(
            [p.frequency_hz for p in peaks],
            [p.value_m * scale.factor for p in peaks],
            linestyle="none",
            marker=_MARKS[kind],
            markersize=5,
            markerfacecolor="white" if "harmonic" in kind else "0.2",
            color="0.2",
            label=kind,
        )
    draw_limit(ax, result.scenario.limits, "peak_displacement", scale)
    frequency_axis(result, ax)
    ax.set_yscale("log")
    name_level(result, ax, level_index)
    finish(ax, "Excitation frequency (Hz)", f"Peak displacement of {probe} ({scale.unit})")
    ax.legend(loc="best", frameon=False, fontsize="small", handlelength=2.6)
    return ax


def plot_contact_force_curve(result: SweepResult, ax: Axes, level_index: int = 0) -> Axes:
    """Peak contact forces over frequency."""
    curves = [c for c in result.curves.values() if c.level_index == level_index]
    drawn = [(c, name) for c in curves for name in c.force]
    scale = scale_for("N", *(c.force[name].peak for c, name in drawn))
    for k, (curve, name) in enumerate(drawn[:6]):
        f, peak = envelope(curve, curve.force[name].peak)
        ax.plot(f, peak * scale.factor, label=f"{name}, {curve.direction}", **curve_style(k))
    draw_limit(ax, result.scenario.limits, "peak_force", scale)
    frequency_axis(result, ax)
    name_level(result, ax, level_index)
    finish(ax, "Excitation frequency (Hz)", f"Peak contact force ({scale.unit})")
    legend(ax, min(len(drawn), 6), len(drawn), "curves")
    return ax


def plot_output_peaks(result: SweepResult, ax: Axes, name: str) -> Axes:
    """Peaks of an output over frequency, by direction and level, with its limit."""
    curves = list(result.curves.values())
    scale = scale_for(curves[0].outputs[name].unit, *(curve.outputs[name].peak for curve in curves))
    several = len({curve.level_index for curve in curves}) > 1
    for k, curve in enumerate(curves[:MOST_CURVES]):
        f, peak = envelope(curve, curve.outputs[name].peak)
        level = f", {level_text(curve.level, result.scenario.level_unit)}" if several else ""
        ax.plot(f, peak * scale.factor, label=f"{curve.direction}{level}", **curve_style(k))
    draw_limit(ax, result.scenario.limits, OF_OUTPUTS + name, scale)
    frequency_axis(result, ax)
    finish(ax, "Excitation frequency (Hz)", output_label("Peak of", name, scale))
    ax.set_ylim(bottom=0.0)
    legend(ax, min(len(curves), MOST_CURVES), len(curves), "curves")
    return ax


def plot_waterfall(result: SweepResult, ax: Axes, probe: str, curve_name: str) -> Axes:
    """Tracked harmonics: response frequency over excitation frequency, coloured by amplitude in dB."""
    curve = result.curves[curve_name]
    amplitude = np.abs(curve.displacement[probe].harmonics)
    top = float(np.nanmax(amplitude, initial=0.0)) or 1.0
    step = max(1, curve.frequency_hz.size // 1500)
    drawn = None
    for r, order in enumerate(curve.orders):
        level = 20 * np.log10(np.maximum(amplitude[r, ::step], 1e-30) / top)
        drawn = ax.scatter(
            curve.frequency_hz[::step], order * curve.frequency_hz[::step], c=level, s=5, marker="s", linewidths=0,
            cmap="cividis_r", vmin=-60, vmax=0,
        )  # fmt: skip
        fraction = Fraction(float(order)).limit_denominator(12)
        end = (curve.frequency_hz.max(), order * curve.frequency_hz.max())
        ax.annotate(f"{fraction}", end, xytext=(4, 0), textcoords="offset points", va="center", fontsize="small")
    for f in result.modes.open_frequencies_hz:
        if f <= curve.orders.max(initial=1.0) * curve.frequency_hz.max():
            ax.axhline(f, color="0.75", linewidth=0.6, zorder=0)
    if drawn is not None and ax.figure is not None:
        ax.figure.colorbar(drawn, ax=ax, label="Amplitude (dB re largest)")
    finish(ax, f"Excitation frequency (Hz), {curve.direction}", f"Response frequency of {probe} (Hz)")
    return ax


def plot_level_family(result: SweepResult, ax: Axes, probe: str, direction: str) -> Axes:
    """Peak displacement divided by excitation amplitude for each level; all but the first where they differ by 1 %."""
    curves = [c for c in result.curves.values() if c.direction == direction]
    ratios = []
    for curve in curves[:6]:
        with np.errstate(divide="ignore", invalid="ignore"):
            ratios.append(curve.displacement[probe].peak / curve.excitation_amplitude)
    scale, unit = _per_level(curves, *ratios)
    for k, (curve, ratio) in enumerate(zip(curves, ratios, strict=False)):
        f, value = envelope(curve, ratio * scale)
        if k == 0:
            first = f, value
        else:
            value = where_other(np.interp(f, *first), value)
        level = level_text(curve.level, result.scenario.level_unit)
        ax.plot(f, value, label=level if np.any(np.isfinite(value)) else f"{level} (the same)", **curve_style(k))
    frequency_axis(result, ax)
    ax.set_yscale("log")
    finish(ax, f"Excitation frequency (Hz), {direction}", f"Peak displacement of {probe} / level ({unit})")
    legend(ax, min(len(curves), 6), len(curves), "levels")
    return ax


def plot_harmonic_energy(result: SweepResult, axes: list[Axes], probe: str, direction: str) -> None:
    """Mean-square response in each harmonic divided by mean-square excitation, a panel for each level."""
    curves = [c for c in result.curves.values() if c.direction == direction][: len(axes)]
    ratios = [np.abs(c.displacement[probe].harmonics[:MOST_CURVES]) / c.excitation_amplitude for c in curves]
    scale, unit = _per_level(curves, *ratios)
    top = max((float(np.nanmax((ratio * scale) ** 2, initial=0.0)) for ratio in ratios), default=0.0)
    for ax, curve, ratio in zip(axes, curves, ratios, strict=True):
        for r, order in enumerate(curve.orders[:MOST_CURVES]):
            f, value = envelope(curve, (ratio[r] * scale) ** 2, mean=True)
            label = f"order {Fraction(float(order)).limit_denominator(12)}"
            ax.plot(f, value, label=label, **curve_style(r))
        frequency_axis(result, ax)
        ax.set_yscale("log")
        if 0.0 < top < np.inf:
            ax.set_ylim(ENERGY_SHOWN * top, 3.0 * top)
        finish(
            ax,
            f"Excitation frequency (Hz), {direction}" if ax is axes[-1] else "",
            f"Mean square of {probe}\n/ that of the level, ({unit})²",
        )
        ax.set_title(level_text(curve.level, result.scenario.level_unit), loc="left", fontsize="small")
    if curves:
        legend(axes[0], min(curves[0].orders.size, MOST_CURVES), curves[0].orders.size, "orders")


def _per_level(curves: list[SweepCurve], *ratios: Floats) -> tuple[float, str]:
    """Factor and unit in which displacements divided by the excitation, in SI units, are shown."""
    excitation = curves[0].excitation_unit if curves else "m/s^2"
    level = scale_for(excitation)
    length = scale_for("m", *(ratio / level.factor for ratio in ratios))
    return length.factor / level.factor, f"{length.unit} per {level.unit.replace('^2', '²')}"


def plot_contact(result: SweepResult, ax: Axes, direction: str) -> Axes:
    """Fraction of time in contact over frequency: 0 without contact, 1 where contact is never lost.

    Further levels are drawn where they differ from the first by 1 %.
    """
    curves = [c for c in result.curves.values() if c.direction == direction]
    drawn = [(c, name) for c in curves for name in c.contact_share]
    first: dict[str, tuple[Floats, Floats]] = {}
    for k, (curve, name) in enumerate(drawn[:MOST_CURVES]):
        cycles = max(1, curve.frequency_hz.size // 600)  # averaged for one point
        whole = curve.frequency_hz.size // cycles * cycles
        f = curve.frequency_hz[:whole].reshape(-1, cycles).mean(axis=1)
        order = np.argsort(f)
        f, share = f[order], curve.contact_share[name][:whole].reshape(-1, cycles).mean(axis=1)[order]
        label = f"{name}, {level_text(curve.level, result.scenario.level_unit)}"
        if name in first:
            share = where_other(np.interp(f, *first[name]), share)
            label += "" if np.any(np.isfinite(share)) else " (the same)"
        first.setdefault(name, (f, share))
        ax.plot(f, 100 * share, label=label, **curve_style(k))
    frequency_axis(result, ax)
    ax.set_ylim(-2, 102)
    finish(ax, f"Excitation frequency (Hz), {direction}", "Time in contact (%)")
    legend(ax, min(len(drawn), MOST_CURVES), len(drawn), "curves")
    return ax


def plot_contact_levels(result: SweepResult, ax: Axes) -> Axes:
    """Level at which contact begins or is lost, over frequency, with the levels of the sweep."""
    linear = result.linear
    unit = next((c.excitation_unit for c in result.curves.values()), "m/s^2")
    scale = scale_for(unit)
    for k, (name, levels) in enumerate(list(linear.contact.items())[:MOST_CURVES]):
        what = "contact is lost" if levels.closed_at_rest else "contact begins"
        level = levels.changing * scale.factor
        if np.nanmax(level, initial=0.0) == 0.0:  # it just touches at rest: a logarithmic axis has no zero
            ax.plot([], [], linestyle="none", label=f"{name}: {what} at any level")
        else:
            ax.plot(linear.frequency_hz, level, label=f"{name}: {what}", **curve_style(k))
    for index, curve in enumerate({c.level_index: c for c in result.curves.values()}.values()):
        swept, amplitude = by_frequency(curve, np.abs(curve.excitation_amplitude))
        label = "sweep" if index == 0 else None
        ax.plot(swept, amplitude * scale.factor, color="0.6", linewidth=0.8, zorder=0, label=label)
    frequency_axis(result, ax)
    ax.set_yscale("log")
    finish(ax, "Excitation frequency (Hz)", f"Level ({scale.unit})")
    known = len(linear.contact)
    title = f"{MOST_CURVES} of {known} snubbers" if known > MOST_CURVES else None
    ax.legend(loc="best", frameon=False, fontsize="small", title=title, title_fontsize="small")
    return ax


def plot_preload_needed(result: SweepResult, ax: Axes) -> Axes:
    """Preload needed to keep contact at the highest excitation of the sweep, over frequency."""
    linear = result.linear
    curve = max(result.curves.values(), key=lambda c: float(c.excitation_amplitude.max(initial=0.0)))
    amplitude = np.interp(linear.frequency_hz, *by_frequency(curve, curve.excitation_amplitude))
    needed = {name: levels.preload_needed * amplitude for name, levels in linear.contact.items()}
    scale = scale_for("N", *needed.values())
    for k, (name, values) in enumerate(needed.items()):
        ax.plot(linear.frequency_hz, values * scale.factor, label=name, **curve_style(k))
    frequency_axis(result, ax)
    ax.set_yscale("log")
    finish(ax, "Excitation frequency (Hz)", f"Preload needed to keep contact ({scale.unit})")
    legend(ax, min(len(needed), 6), len(needed), "snubbers")
    return ax


def plot_steady_states(result: SweepResult, ax: Axes, curve_name: str) -> Axes:
    """Period of the steady motion in cycles of the excitation; crosses, below, where the motion has none."""
    curve = result.curves[curve_name]
    assert curve.steady is not None
    kind = np.array(curve.steady.kind)
    periodic = kind == "periodic"
    period = curve.steady.period_cycles[periodic]
    whole: dict[str, Any] = {"clip_on": False, "zorder": 3}  # marks at the ends of the axis
    ax.plot(curve.frequency_hz[periodic], period, "o", markersize=3, color="#0b3c5d", label="periodic", **whole)
    for k, name in enumerate(("quasi-periodic", "chaotic", "not settled")):
        here = kind == name
        if here.any():
            ax.plot(curve.frequency_hz[here], np.zeros(here.sum()), "x+1"[k], markersize=6, color="#d1495b", label=name,
                    **whole)  # fmt: skip
    longest = int(np.max(period, initial=1))
    ticks = {k: str(k) for k in range(1, longest + 1, -(-longest // MOST_PERIODS))}
    if not periodic.all():
        ticks = {0: "none", **ticks}
    ax.set_yticks(list(ticks), list(ticks.values()))
    frequency_axis(result, ax)
    finish(ax, f"Excitation frequency (Hz), {curve.direction}", "Period (cycles of the excitation)")
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4, frameon=False, fontsize="small", handlelength=1.2)
    return ax


def plot_poincare(result: SweepResult, ax: Axes, curve_name: str, probe: str) -> Axes:
    """Poincaré sections of the motions that are not periodic: displacement at phase 0 over frequency."""
    curve = result.curves[curve_name]
    assert curve.steady is not None
    index = list(curve.displacement).index(probe)
    displacement = curve.steady.poincare_displacement[:, index]
    scale = scale_for("m", displacement)
    ax.plot(curve.steady.poincare_frequency_hz, displacement * scale.factor, "ok", markersize=1.3, markeredgewidth=0)
    frequency_axis(result, ax)
    finish(ax, f"Excitation frequency (Hz), {curve.direction}", f"Displacement of {probe}\nat phase 0 ({scale.unit})")
    return ax


def sweep_figures(result: SweepResult) -> dict[str, Figure]:
    """All plots available for this result; the key is the last part of the file name."""
    from matplotlib.figure import Figure

    def page(height: float = 4.8, rows: int = 1) -> tuple[Figure, list[Axes]]:
        figure = Figure(figsize=(8.0, height), layout="constrained")
        if result.title:
            put_title(figure, result.title)
        return figure, list(figure.subplots(rows, 1, squeeze=False).ravel())

    figures: dict[str, Figure] = {}
    if not result.curves:
        return figures
    last = list(result.curves.values())[-1]
    probe = next(iter(last.displacement))
    direction = next(iter(result.curves.values())).direction
    for index in sorted({c.level_index for c in result.curves.values()}):
        figure, (ax,) = page()
        plot_response(result, ax, probe, index)
        figures[f"response_{index}"] = figure
    if last.acceleration:
        both = has_transmissibility(result)
        figure, axes = page(8.0 if both else 4.8, 2 if both else 1)
        plot_acceleration(result, axes[0], last.level_index)
        if both:
            plot_transmissibility(result, axes[1], last.level_index)
        figures["acceleration"] = figure
    for index in result.histories:
        if not has_spectrogram(result, probe, index):
            continue
        figure, (ax,) = page()
        plot_spectrogram(result, ax, probe, index)
        figures[f"spectrogram_{index}"] = figure
    figure, (ax,) = page()
    plot_waterfall(result, ax, probe, last.name)
    figures["waterfall"] = figure
    if last.force:
        figure, (above, below) = page(6.4, 2)
        plot_contact_force_curve(result, above, last.level_index)
        plot_contact(result, below, direction)
        figures["contact"] = figure
    if last.outputs:
        names = list(last.outputs)[:MOST_CURVES]
        figure, axes = page(max(4.8, 2.6 * len(names)), len(names))
        for ax, name in zip(axes, names, strict=True):
            plot_output_peaks(result, ax, name)
        figures["outputs"] = figure
    if result.linear.contact:
        figure, (above, below) = page(6.4, 2)
        plot_contact_levels(result, above)
        plot_preload_needed(result, below)
        figures["contact_levels"] = figure
    if len({c.level_index for c in result.curves.values()}) > 1:
        figure, (ax,) = page()
        plot_level_family(result, ax, probe, direction)
        figures["levels"] = figure
        shown = min(len([c for c in result.curves.values() if c.direction == direction]), MOST_LEVELS)
        figure, axes = page(max(4.8, 2.6 * shown), shown)
        plot_harmonic_energy(result, axes, probe, direction)
        figures["harmonic_energy"] = figure
    for curve in result.curves.values():
        if curve.notching is not None:
            figures[f"notching_{curve.name}"] = notching_figure(curve, result.title, partial(frequency_axis, result))
    if last.steady is not None:
        has_sections = last.steady.poincare_frequency_hz.size > 0  # of motions that are not periodic
        figure, axes = page(6.4 if has_sections else 4.4, 1 + has_sections)
        plot_steady_states(result, axes[0], last.name)
        if has_sections:
            plot_poincare(result, axes[1], last.name, probe)
        figures["steady_states"] = figure
    return figures
