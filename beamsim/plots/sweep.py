"""Plots of a sweep: response over frequency, waterfall, levels, energy in the harmonics, contact."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from beamsim.analyses.compare.sweeps import peaks_of
from beamsim.analyses.sweep.result import SweepCurve, SweepResult
from beamsim.analyses.values import ACCELERATION, BY_ENTRY, DISPLACEMENT, FORCE, Value
from beamsim.plots.bounds import limit_levels
from beamsim.plots.drawing import (
    DARK,
    MOST_CURVES,
    RED,
    Curve,
    Guide,
    colour_bar,
    dashed_line,
    draw_curves,
    finish,
    frequency_axis,
    highest_in_bins,
    panels,
    where_other,
)
from beamsim.plots.notching import notching_figure
from beamsim.plots.style import Scale, level_text, scale_for
from beamsim.scenario.limits import OF_OUTPUTS
from beamsim.scenario.quantities import amplitude_unit
from beamsim.typing import Floats

MOST_LEVELS = 4  # whose harmonics are drawn
ENERGY_SHOWN = 1e-8  # of the largest, below which harmonics are not drawn
MOST_PERIODS = 8  # that an axis numbers
MOST_MARKS = 8  # labelled peaks in one plot
DEEPEST_DB = 80.0
COLUMNS, LINES = 300, 240  # of time and of frequency in a spectrogram
WINDOWS, FEWEST_SAMPLES, RESOLVED = 8, 16, 24  # in a time history; in a window; cycles of the lowest frequency in one
_MARKS = {
    "linear resonance": "o",
    "nonlinear resonance": "o",
    "superharmonic": "^",
    "subharmonic": "v",
    "beat": "x",
    "level step": "|",
}


def draw_sweep(
    result: SweepResult,
    ax: Axes,
    up: tuple[str, str | Scale],
    curves: Sequence[Curve],
    levels: Sequence[Guide] = (),
    *,
    logarithmic: bool = True,
    of: str = "curves",
    note: str = "",
) -> Scale:
    """Curves over the frequencies of the sweep; returns the scale of their values.

    Parameters
    ----------
    up : words and SI unit, or scale, of the values.
    note : what else the axis of frequency says.
    """
    _, scale = draw_curves(ax, ("Excitation frequency", Scale(1.0, "Hz")), up, curves, levels, of=of)
    ax.set_xlabel(ax.get_xlabel() + (f", {note}" if note else ""))
    swept = [curve.frequency_hz for curve in result.curves.values() if curve.frequency_hz.size]
    if swept:
        frequency_axis(ax, *(float(pick([pick(f) for f in swept])) for pick in (np.min, np.max)))
    if logarithmic:
        ax.set_yscale("log")
    return scale


def _swept(label: str, curve: SweepCurve, values: Floats, *, mean: bool = False, **style: Any) -> Curve:
    return Curve(label, *highest_in_bins(curve.frequency_hz, values, mean=mean), style)


def _of_level(result: SweepResult, index: int) -> list[SweepCurve]:
    return [curve for curve in result.curves.values() if curve.level_index == index]


def _in_direction(result: SweepResult, direction: str) -> list[SweepCurve]:
    return [curve for curve in result.curves.values() if curve.direction == direction]


def _level(result: SweepResult, curve: SweepCurve, *, always: bool = False) -> str:
    """The level of a curve, where there are several."""
    several = always or len({c.level_index for c in result.curves.values()}) > 1
    return f", {level_text(curve.level, result.scenario.level_unit)}" if several else ""


def _over_linear(result: SweepResult, curve: SweepCurve, values: Floats) -> Floats:
    """What belongs to each cycle, at the frequencies of the linear structure."""
    order = np.argsort(curve.frequency_hz)
    return np.interp(result.linear.frequency_hz, curve.frequency_hz[order], values[order])


def plot_response(result: SweepResult, ax: Axes, probe: str, level_index: int = 0) -> Axes:
    """Peak displacement over frequency, up and down, with that of the linear structure without snubbers."""
    curves = _of_level(result, level_index)
    scale = scale_for("m", *(curve.displacement[probe].peak for curve in curves))
    amplitude = _over_linear(result, curves[0], curves[0].excitation_amplitude)
    drawn = [_swept(f"sweep {curve.direction}", curve, curve.displacement[probe].peak) for curve in curves]
    ax.plot(
        result.linear.frequency_hz, np.abs(result.linear.displacement[probe]) * amplitude * scale.factor,
        color="0.6", linewidth=1.0, label="without snubbers (linear)", zorder=1,
    )  # fmt: skip
    named = [p for p in result.peaks if p.curve in {c.name for c in curves} and p.probe == probe][:MOST_MARKS]
    for kind in dict.fromkeys(p.kind for p in named):
        peaks = [(p.frequency_hz, p.value_m * scale.factor) for p in named if p.kind == kind]
        face = "white" if "harmonic" in kind else "0.2"
        ax.plot(*np.transpose(peaks), linestyle="none", marker=_MARKS[kind], markersize=5, markerfacecolor=face,
                color="0.2", label=kind)  # fmt: skip
    limits = limit_levels(result.scenario.limits, "peak_displacement")
    draw_sweep(result, ax, (f"Peak displacement of {probe}{_level(result, curves[0])}", scale), drawn, limits)
    return ax


def plot_peaks(result: SweepResult, ax: Axes, value: Value, level_index: int) -> Axes:
    """Largest magnitude of a channel of every probe or snubber in each cycle."""
    drawn = [
        _swept(f"{name}, {curve.direction}", curve, envelope.peak)
        for curve in _of_level(result, level_index)
        for name, envelope in curve.envelopes(value.quantity).items()
    ]
    limits = limit_levels(result.scenario.limits, value.limit)
    level = _level(result, _of_level(result, level_index)[0]).replace(", ", "\nat ")
    draw_sweep(result, ax, (f"Peak {value.quantity.replace('_', ' ')}{level}", value.unit), drawn, limits)
    return ax


def has_transmissibility(result: SweepResult) -> bool:
    """Whether the base moves, and accelerations and the fundamental were kept."""
    return any(
        c.acceleration and np.any(c.orders == 1.0) and amplitude_unit(c.quantity) == "m/s^2"
        for c in result.curves.values()
    )


def plot_transmissibility(result: SweepResult, ax: Axes, level_index: int) -> Axes:
    """Fundamental of every probe's absolute acceleration over that of the base, with Q of its highest peak."""
    drawn = []
    for curve in _of_level(result, level_index):
        order, first = np.argsort(curve.frequency_hz), int(np.flatnonzero(curve.orders == 1.0)[0])
        for name in curve.acceleration:
            with np.errstate(divide="ignore", invalid="ignore"):
                ratio = np.abs(curve.acceleration[name].harmonics[first]) / np.abs(curve.excitation_amplitude)
            at, _, quality = max(
                peaks_of(curve.frequency_hz[order], ratio[order]), key=lambda peak: peak[1], default=(0.0, 0.0, np.nan)
            )
            known = f": Q {quality:.3g} at {at:.4g} Hz" if np.isfinite(quality) else ""
            drawn.append(_swept(f"{name}, {curve.direction}{known}", curve, ratio))
    draw_sweep(result, ax, ("Transmissibility", Scale(1.0, "g per g")), drawn)
    return ax


def plot_contact_force_curve(result: SweepResult, ax: Axes, level_index: int = 0) -> Axes:
    """Peak contact forces over frequency."""
    curves = _of_level(result, level_index)
    drawn = [_swept(f"{name}, {c.direction}", c, c.force[name].peak) for c in curves for name in c.force]
    limits = limit_levels(result.scenario.limits, "peak_force")
    up = (f"Peak contact force{_level(result, curves[0])}".replace(", ", "\nat "), "N")
    draw_sweep(result, ax, up, drawn, limits, logarithmic=False)
    return ax


def plot_output_peaks(result: SweepResult, ax: Axes, name: str) -> Axes:
    """Peaks of an output over frequency, by direction and level, with its limit."""
    curves = list(result.curves.values())
    drawn = [_swept(f"{c.direction}{_level(result, c)}", c, c.outputs[name].peak) for c in curves]
    limits = limit_levels(result.scenario.limits, OF_OUTPUTS + name)
    draw_sweep(result, ax, (f"Peak of {name}", curves[0].outputs[name].unit), drawn, limits, logarithmic=False)
    ax.set_ylim(bottom=0.0)
    return ax


def plot_waterfall(result: SweepResult, ax: Axes, probe: str, curve_name: str) -> Axes:
    """Tracked harmonics: response frequency over excitation frequency, coloured by amplitude in dB."""
    curve = result.curves[curve_name]
    amplitude = np.abs(curve.displacement[probe].harmonics)
    top = float(np.nanmax(amplitude, initial=0.0)) or 1.0
    step = max(1, curve.frequency_hz.size // 1500)
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
    if curve.orders.size:
        colour_bar(ax, drawn, "Amplitude (dB re largest)")
    finish(ax, f"Excitation frequency (Hz), {curve.direction}", f"Response frequency of {probe} (Hz)")
    return ax


def has_spectrogram(result: SweepResult, probe: str, level_index: int) -> bool:
    """Whether a time history is stored that moves and is long enough for some windows."""
    history = result.histories[level_index]
    return history.time.size >= WINDOWS * FEWEST_SAMPLES and bool(np.any(history.displacement[probe]))


def plot_spectrogram(result: SweepResult, ax: Axes, probe: str, level_index: int) -> Axes:
    """Spectrum of the displacement over time, in dB re its largest line; the frequency of the sweep is dashed.

    Hann windows of 24 cycles of the lowest frequency, at most an eighth of the stored time history.
    """
    from scipy.signal import spectrogram

    history, curves = result.histories[level_index], _of_level(result, level_index)
    rate = (history.time.size - 1) / float(history.time[-1] - history.time[0])
    lowest, highest = (pick([pick(c.frequency_hz) for c in curves]) for pick in (np.min, np.max))
    length = int(min(history.time.size // WINDOWS, max(RESOLVED * rate / lowest, FEWEST_SAMPLES)))
    step = max(1, (history.time.size - length) // COLUMNS)
    x = history.displacement[probe]
    f, t, power = spectrogram(x, rate, "hann", length, length - step, scaling="spectrum", mode="magnitude")
    top = max(float(np.max(curves[0].orders)), 1.0) * float(highest)
    shown = f <= min(2.0 * top, 0.5 * rate)
    thin = max(1, int(np.count_nonzero(shown) // LINES))
    whole = np.count_nonzero(shown) // thin * thin
    lines = power[shown][:whole].reshape(-1, thin, power.shape[1]).max(axis=1)
    level = 20 * np.log10(np.maximum(lines / lines.max(), 1e-12))
    mesh = ax.pcolormesh(history.time[0] + t, f[shown][:whole:thin], level, cmap="cividis", vmin=-DEEPEST_DB, vmax=0.0,
                         shading="nearest", rasterized=True)  # fmt: skip
    for k, curve in enumerate(curves):
        dashed_line(ax, curve.time, curve.frequency_hz, "" if k else "frequency of the sweep")
    colour_bar(ax, mesh, "Level (dB re largest)")
    finish(ax, "Time (s)", f"Frequency in the displacement of {probe} (Hz)")
    ax.set_xlim(history.time[0] + t[0], history.time[0] + t[-1])
    return ax


def plot_level_family(result: SweepResult, ax: Axes, probe: str, direction: str) -> Axes:
    """Peak displacement divided by excitation amplitude for each level; all but the first where they differ by 1 %."""
    curves = _in_direction(result, direction)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = [curve.displacement[probe].peak / curve.excitation_amplitude for curve in curves]
    levels = [_level(result, curve, always=True)[2:] for curve in curves]
    drawn = _where_others(list(map(_swept, levels, curves, ratios)))
    up = (f"Peak displacement of {probe} / level", _per_level(curves, *ratios))
    draw_sweep(result, ax, up, drawn, of="levels", note=direction)
    return ax


def _where_others(curves: Sequence[Curve]) -> list[Curve]:
    """The first curve, and the others where they differ from it."""
    drawn = list(curves[:1])
    for curve in curves[1:]:
        y = where_other(np.interp(curve.x, curves[0].x, curves[0].y), curve.y)
        label = curve.label if np.any(np.isfinite(y)) else f"{curve.label} (the same)"
        drawn.append(curve._replace(label=label, y=y))
    return drawn


def plot_harmonic_energy(result: SweepResult, axes: list[Axes], probe: str, direction: str) -> None:
    """Mean-square response in each harmonic divided by mean-square excitation, a panel for each level."""
    curves = _in_direction(result, direction)[: len(axes)]
    ratios = [np.abs(c.displacement[probe].harmonics[:MOST_CURVES]) / c.excitation_amplitude for c in curves]
    scale = _per_level(curves, *ratios)
    squared = Scale(scale.factor**2, "")
    top = max((float(np.nanmax(ratio**2, initial=0.0)) for ratio in ratios), default=0.0) * squared.factor
    for ax, curve, ratio in zip(axes, curves, ratios, strict=True):
        drawn = [
            _swept(f"order {Fraction(float(order)).limit_denominator(12)}", curve, ratio[r] ** 2, mean=True)
            for r, order in enumerate(curve.orders[:MOST_CURVES])
        ]
        level = _level(result, curve, always=True)[2:]
        draw_sweep(
            result, ax, (f"Mean square of {probe}\n/ that of {level}, ({scale.unit})²", squared), drawn, note=direction
        )
        if ax is not axes[-1]:
            ax.set_xlabel("")
        if 0.0 < top < np.inf:
            ax.set_ylim(ENERGY_SHOWN * top, 3.0 * top)


def _per_level(curves: list[SweepCurve], *ratios: Floats) -> Scale:
    """In which displacements divided by the excitation are shown."""
    excitation = curves[0].excitation_unit if curves else "m/s^2"
    level = scale_for(excitation)
    length = scale_for("m", *(ratio / level.factor for ratio in ratios))
    return Scale(length.factor / level.factor, f"{length.unit} per {level.unit.replace('^2', '²')}")


def plot_contact(result: SweepResult, ax: Axes, direction: str) -> Axes:
    """Fraction of time in contact over frequency: 0 without contact, 1 where contact is never lost.

    Further levels are drawn where they differ from the first by 1 %.
    """
    curves = _in_direction(result, direction)
    by_snubber = [
        [_swept(f"{name}{_level(result, c, always=True)}", c, c.contact_share[name], mean=True) for c in curves]
        for name in curves[0].contact_share
    ]
    drawn = [curve for levels in zip(*map(_where_others, by_snubber), strict=True) for curve in levels]
    up = ("Time in contact", Scale(100.0, "%"))
    draw_sweep(result, ax, up, drawn, logarithmic=False, note=direction)
    ax.set_ylim(-2, 102)
    return ax


def plot_contact_levels(result: SweepResult, ax: Axes) -> Axes:
    """Level at which contact begins or is lost, over frequency, with the levels of the sweep."""
    linear = result.linear
    scale = scale_for(next(iter(result.curves.values())).excitation_unit)
    drawn = []
    for name, levels in linear.contact.items():
        what = "contact is lost" if levels.closed_at_rest else "contact begins"
        if np.nanmax(levels.changing, initial=0.0) == 0.0:  # it just touches at rest: a logarithmic axis has no zero
            drawn.append(Curve(f"{name}: {what} with any motion", np.zeros(0), np.zeros(0), {"linestyle": "none"}))
        else:
            drawn.append(Curve(f"{name}: {what}", linear.frequency_hz, levels.changing))
    for k, curve in enumerate({c.level_index: c for c in result.curves.values()}.values()):
        order = np.argsort(curve.frequency_hz)
        ax.plot(curve.frequency_hz[order], np.abs(curve.excitation_amplitude[order]) * scale.factor, color="0.6",
                linewidth=0.8, zorder=0, label="_nolegend_" if k else "sweep")  # fmt: skip
    draw_sweep(result, ax, ("Level", scale), drawn, of="snubbers")
    return ax


def plot_preload_needed(result: SweepResult, ax: Axes) -> Axes:
    """Preload needed to keep contact at the highest excitation of the sweep, over frequency."""
    linear = result.linear
    curve = max(result.curves.values(), key=lambda c: float(c.excitation_amplitude.max(initial=0.0)))
    amplitude = _over_linear(result, curve, curve.excitation_amplitude)
    drawn = [
        Curve(name, linear.frequency_hz, levels.preload_needed * amplitude) for name, levels in linear.contact.items()
    ]
    draw_sweep(result, ax, ("Preload needed to keep contact", "N"), drawn, of="snubbers")
    return ax


def plot_steady_states(result: SweepResult, ax: Axes, curve_name: str) -> Axes:
    """Period of the steady motion in cycles of the excitation; crosses, below, where the motion has none."""
    curve = result.curves[curve_name]
    assert curve.steady is not None
    kind = np.array(curve.steady.kind)
    whole: dict[str, Any] = {"clip_on": False, "zorder": 3, "linestyle": "none"}  # marks at the ends of the axis
    dots = {**whole, "marker": "o", "markersize": 3, "color": DARK}
    periodic = kind == "periodic"
    drawn = [Curve("periodic", curve.frequency_hz[periodic], curve.steady.period_cycles[periodic], dots)]
    for mark, name in zip("x+1", ("quasi-periodic", "chaotic", "not settled"), strict=True):
        here = curve.frequency_hz[kind == name]
        if here.size:
            marks = {**whole, "marker": mark, "markersize": 6, "color": RED}
            drawn.append(Curve(name, here, np.zeros(here.size), marks))
    draw_sweep(result, ax, ("Period (cycles of the excitation)", ""), drawn, logarithmic=False, note=curve.direction)
    longest = int(np.max(drawn[0].y, initial=1))
    ticks = {k: str(k) for k in range(1, longest + 1, -(-longest // MOST_PERIODS))}
    if not periodic.all():
        ticks = {0: "none", **ticks}
    ax.set_yticks(list(ticks), list(ticks.values()))
    return ax


def plot_poincare(result: SweepResult, ax: Axes, curve_name: str, probe: str) -> Axes:
    """Poincaré sections of the motions that are not periodic: displacement at phase 0 over frequency."""
    curve = result.curves[curve_name]
    assert curve.steady is not None
    displacement = curve.steady.poincare_displacement[:, list(curve.displacement).index(probe)]
    dots = {"linestyle": "none", "marker": "o", "color": "black", "markersize": 1.3, "markeredgewidth": 0}
    drawn = [Curve("", curve.steady.poincare_frequency_hz, displacement, dots)]
    up = (f"Displacement of {probe}\nat phase 0", "m")
    draw_sweep(result, ax, up, drawn, logarithmic=False, note=curve.direction)
    return ax


def sweep_figures(result: SweepResult) -> dict[str, Figure]:
    """All plots available for this result; the key is the last part of the file name."""
    if not result.curves:
        return {}
    figures: dict[str, Figure] = {}

    def draw(name: str, *plots: Any) -> None:
        """A panel for each plot, one below the other."""
        figures[name], axes = panels(result.title, len(plots), size=(8.0, max(4.8, 3.2 * len(plots))))
        for ax, plot in zip(axes, plots, strict=True):
            plot(result, ax)

    last, first = list(result.curves.values())[-1], next(iter(result.curves.values()))
    probe, direction = next(iter(last.displacement)), first.direction
    indices = sorted({c.level_index for c in result.curves.values()})
    for index in indices:
        draw(f"response_{index}", partial(plot_response, probe=probe, level_index=index))
    if last.acceleration:
        plots: list[Any] = [partial(plot_peaks, value=BY_ENTRY["peak_acceleration_g"])]
        plots += [plot_transmissibility] if has_transmissibility(result) else []
        draw("acceleration", *(partial(plot, level_index=last.level_index) for plot in plots))
    for value, _ in last.peaks():
        if value.followed and value.key not in (DISPLACEMENT, ACCELERATION, FORCE):
            draw(value.name, partial(plot_peaks, value=value, level_index=last.level_index))
    for index in result.histories:
        if has_spectrogram(result, probe, index):
            draw(f"spectrogram_{index}", partial(plot_spectrogram, probe=probe, level_index=index))
    draw("waterfall", partial(plot_waterfall, probe=probe, curve_name=last.name))
    if last.force:
        force = partial(plot_contact_force_curve, level_index=last.level_index)
        draw("contact", force, partial(plot_contact, direction=direction))
    if last.outputs:
        draw("outputs", *(partial(plot_output_peaks, name=name) for name in list(last.outputs)[:MOST_CURVES]))
    if result.linear.contact:
        draw("contact_levels", plot_contact_levels, plot_preload_needed)
    if len(indices) > 1:
        draw("levels", partial(plot_level_family, probe=probe, direction=direction))
        shown = min(len(_in_direction(result, direction)), MOST_LEVELS)
        figures["harmonic_energy"], axes = panels(result.title, shown, size=(8.0, max(4.8, 2.6 * shown)))
        plot_harmonic_energy(result, axes, probe, direction)
    for curve in result.curves.values():
        if curve.notching is not None:
            figures[f"notching_{curve.name}"] = notching_figure(curve, result.title)
    if last.steady is not None:
        plots = [partial(plot_steady_states, curve_name=last.name)]
        if last.steady.poincare_frequency_hz.size:  # of motions that are not periodic
            plots.append(partial(plot_poincare, curve_name=last.name, probe=probe))
        draw("steady_states", *plots)
    return figures
