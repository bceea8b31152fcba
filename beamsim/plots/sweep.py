"""Plots of a sweep: response over frequency, waterfall, levels, energy in the harmonics, contact."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import partial
from math import isfinite
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from beamsim.analyses.sweep.result import NotchLimit, SweepCurve, SweepResult
from beamsim.analyses.values import ACCELERATION, DISPLACEMENT, FORCE, Value
from beamsim.plots.drawing import (
    DARK,
    HERTZ,
    MOST_CURVES,
    RED,
    Axis,
    Chart,
    Curve,
    Guide,
    colour_bar,
    dashed_line,
    draw_curves,
    finish,
    frequency_axis,
    highest_in_bins,
    legend,
    limit_levels,
    marked,
    picture,
)
from beamsim.plots.style import Scale, level_text, scale_for
from beamsim.scenario.reporting import OF_OUTPUTS, limited_quantity
from beamsim.typing import Floats

MOST_LEVELS = 4  # whose harmonics are drawn; limits of notches
MOST_PERIODS = 8  # that an axis numbers
FEWEST_SAMPLES = 16  # in a window of a spectrogram, of which there are at least eight
_MARKS = {
    "linear resonance": "o",
    "nonlinear resonance": "o",
    "superharmonic": "^",
    "subharmonic": "v",
    "beat": "x",
    "level step": "|",
}


def _chart(
    up: Axis, curves: Sequence[Curve], levels: Sequence[Guide] = (), log: str = "y", of: str = "curves", note: str = ""
) -> Chart:
    """Curves over the excitation frequency, of whose axis the note says more."""
    return Chart((f"Excitation frequency{note and f', {note}'}", HERTZ), up, curves, levels, log, of)


def draw_sweep(result: SweepResult, ax: Axes, chart: Chart) -> Axes:
    """Curves over the frequencies of the sweep.

    Parameters
    ----------
    result : of the sweep.
    ax : to draw on.
    chart : curves over its frequencies.

    Returns
    -------
    The axes.
    """
    draw_curves(ax, *chart)
    swept = [curve.frequency_hz for curve in result.curves.values() if curve.frequency_hz.size]
    if swept:
        frequency_axis(ax, *(float(pick([pick(f) for f in swept])) for pick in (np.min, np.max)))
    return ax


def _swept(label: str, curve: SweepCurve, values: Floats, *, mean: bool = False) -> Curve:
    """What belongs to each cycle; of many cycles the highest (or mean) values."""
    return Curve(label, *highest_in_bins(curve.frequency_hz, values, mean=mean))


def _of_level(result: SweepResult, index: int) -> list[SweepCurve]:
    return [curve for curve in result.curves.values() if curve.level_index == index]


def _in_direction(result: SweepResult, direction: str) -> list[SweepCurve]:
    return [curve for curve in result.curves.values() if curve.direction == direction]


def _level(result: SweepResult, curve: SweepCurve, *, always: bool = False) -> str:
    """The level of a curve, where there are several."""
    several = always or len({c.level_index for c in result.curves.values()}) > 1
    return f", {level_text(curve.level, result.scenario.level_unit)}" if several else ""


def responses(result: SweepResult, probe: str, level_index: int = 0) -> Chart:
    """Peak displacement over frequency, up and down, with that of the linear structure without snubbers.

    Parameters
    ----------
    result : of the sweep.
    probe : name.
    level_index : number of the level, from 0.

    Returns
    -------
    Curves of all directions at the level, with marks at up to eight classified peaks.
    """
    curves = _of_level(result, level_index)
    linear = np.abs(result.linear.displacement[probe]) * curves[0].amplitude_at(result.linear.frequency_hz)
    grey = {"color": "0.6", "linestyle": "-", "linewidth": 1.0, "zorder": 1}
    drawn = [_swept(f"sweep {c.direction}", c, c.displacement[probe].peak) for c in curves]
    drawn.append(Curve("without snubbers (linear)", result.linear.frequency_hz, linear, grey))
    # more than eight labels are not readable
    named = [p for p in result.peaks if p.curve in {c.name for c in curves} and p.probe == probe][:8]
    for kind in dict.fromkeys(p.kind for p in named):
        peaks, face = [(p.frequency_hz, p.value_m) for p in named if p.kind == kind], "harmonic" in kind
        marks = {"marker": _MARKS[kind], "markersize": 5, "markerfacecolor": "white" if face else "0.2"}
        drawn.append(marked(kind, peaks, color="0.2", **marks))
    up = (f"Peak displacement of {probe}{_level(result, curves[0])}", "m")
    return _chart(up, drawn, limit_levels(result.scenario.limits, "peak_displacement"), of="")


def peaks(result: SweepResult, value: Value, level_index: int) -> Chart:
    """Largest magnitude of a channel of every probe or snubber in each cycle.

    Parameters
    ----------
    result : of the sweep.
    value : which value.
    level_index : number of the level, from 0.

    Returns
    -------
    Curves of all directions at the level, with the limit.
    """
    curves = _of_level(result, level_index)
    drawn = [
        _swept(f"{name}, {curve.direction}", curve, envelope.peak)
        for curve in curves
        for name, envelope in curve.envelopes(value.quantity).items()
    ]
    up = (f"{value.label.capitalize()}{_level(result, curves[0])}".replace(", ", "\nat "), value.unit)
    return _chart(up, drawn, limit_levels(result.scenario.limits, value.limit), log="" if value.key == FORCE else "y")


def plot_transmissibility(result: SweepResult, ax: Axes, level_index: int) -> Axes:
    """Fundamental of every probe's absolute acceleration over that of the base, with Q of its highest peak.

    Parameters
    ----------
    result : of a sweep of a base, with accelerations.
    ax : to draw on.
    level_index : number of the level, from 0.

    Returns
    -------
    The axes.
    """
    drawn = []
    for curve in _of_level(result, level_index):
        for name in curve.acceleration:
            peak = curve.resonance(name)
            known = f": Q {peak.quality:.3g} at {peak.frequency_hz:.4g} Hz" if peak and isfinite(peak.quality) else ""
            drawn.append(_swept(f"{name}, {curve.direction}{known}", curve, curve.transmissibility(name)))
    return draw_sweep(result, ax, _chart(("Transmissibility", Scale(1.0, "g per g")), drawn))


def plot_output_peaks(result: SweepResult, ax: Axes, name: str) -> Axes:
    """Peaks of an output over frequency, by direction and level, with its limit.

    Parameters
    ----------
    result : of the sweep.
    ax : to draw on.
    name : of the output.

    Returns
    -------
    The axes.
    """
    curves = list(result.curves.values())
    drawn = [_swept(f"{c.direction}{_level(result, c)}", c, c.outputs[name].peak) for c in curves]
    limits = limit_levels(result.scenario.limits, OF_OUTPUTS + name)
    draw_sweep(result, ax, _chart((f"Peak of {name}", curves[0].outputs[name].unit), drawn, limits, log=""))
    ax.set_ylim(bottom=0.0)
    return ax


def plot_waterfall(result: SweepResult, ax: Axes, probe: str, curve_name: str) -> Axes:
    """Tracked harmonics: response frequency over excitation frequency, coloured by amplitude in dB.

    Parameters
    ----------
    result : of the sweep.
    ax : to draw on.
    probe : name.
    curve_name : direction and number of the level, such as up_0.

    Returns
    -------
    The axes.
    """
    curve = result.curves[curve_name]
    step = max(1, curve.frequency_hz.size // 1500)
    amplitude, f = np.abs(curve.displacement[probe].harmonics)[:, ::step], curve.frequency_hz[::step]
    top = float(np.nanmax(amplitude, initial=0.0)) or 1.0
    for order, values in zip(curve.orders, amplitude, strict=True):
        level = 20 * np.log10(np.maximum(values, 1e-30) / top)
        drawn = ax.scatter(f, order * f, c=level, s=5, marker="s", linewidths=0, cmap="cividis_r", vmin=-60, vmax=0)
        fraction = Fraction(float(order)).limit_denominator(12)
        ax.annotate(f"{fraction}", (f.max(), order * f.max()), xytext=(4, 0), textcoords="offset points", va="center",
                    fontsize="small")  # fmt: skip
    for natural in result.modes.open_frequencies_hz:
        if natural <= curve.orders.max(initial=1.0) * f.max():
            ax.axhline(natural, color="0.75", linewidth=0.6, zorder=0)
    if curve.orders.size:
        colour_bar(ax, drawn, "Amplitude (dB re largest)")
    finish(ax, f"Excitation frequency (Hz), {curve.direction}", f"Response frequency of {probe} (Hz)")
    return ax


def _has_spectrogram(result: SweepResult, probe: str, level_index: int) -> bool:
    """Whether a time history is stored that moves and is long enough for some windows."""
    history = result.histories[level_index]
    return history.time.size >= 8 * FEWEST_SAMPLES and bool(np.any(history.displacement[probe]))


def plot_spectrogram(result: SweepResult, ax: Axes, probe: str, level_index: int) -> Axes:
    """Spectrum of the displacement over time, in dB re its largest line; the frequency of the sweep is dashed.

    Hann windows of 24 cycles of the lowest frequency, at most an eighth of the stored time history.

    Parameters
    ----------
    result : of a sweep with a stored time history of the level.
    ax : to draw on.
    probe : name.
    level_index : number of the level, from 0.

    Returns
    -------
    The axes.
    """
    history, curves = result.histories[level_index], _of_level(result, level_index)
    x, (begin, end) = history.displacement[probe], history.time[[0, -1]]
    rate = (x.size - 1) / float(end - begin)
    lowest, highest = (pick([pick(c.frequency_hz) for c in curves]) for pick in (np.min, np.max))
    length = int(min(x.size // 8, max(24.0 * rate / lowest, FEWEST_SAMPLES)))
    step = max(1, (x.size - length) // 300)
    left = (length - step) / 2.0 / rate  # before the first window's share
    *_, image = ax.specgram(
        x, NFFT=length, Fs=rate, noverlap=length - step, mode="magnitude", scale="dB", cmap="cividis",
        xextent=(begin + left, end - left),
    )  # fmt: skip
    level = np.asarray(image.get_array())
    image.set_data(level - level.max())
    image.set_clim(-80.0, 0.0)
    for k, curve in enumerate(curves):
        dashed_line(ax, curve.time, curve.frequency_hz, "" if k else "frequency of the sweep")
    colour_bar(ax, image, "Level (dB re largest)")
    finish(ax, "Time (s)", f"Frequency in the displacement of {probe} (Hz)")
    ax.grid(visible=False)
    ax.set_ylim(0.0, min(2.0 * max(float(np.max(curves[0].orders)), 1.0) * float(highest), 0.5 * rate))
    return ax


def plot_level_family(result: SweepResult, ax: Axes, probe: str, direction: str) -> Axes:
    """Peak displacement divided by excitation amplitude for each level.

    Parameters
    ----------
    result : of the sweep.
    ax : to draw on.
    probe : name.
    direction : up or down.

    Returns
    -------
    The axes.
    """
    curves = _in_direction(result, direction)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = [curve.displacement[probe].peak / curve.excitation_amplitude for curve in curves]
    drawn = [
        _swept(_level(result, curve, always=True)[2:], curve, ratio)
        for curve, ratio in zip(curves, ratios, strict=True)
    ]
    up = (f"Peak displacement of {probe} / level", _per_level(curves, *ratios))
    return draw_sweep(result, ax, _chart(up, drawn, of="levels", note=direction))


def plot_harmonic_energy(result: SweepResult, ax: Axes, probe: str, curve: SweepCurve) -> Axes:
    """Mean-square response in each harmonic divided by mean-square excitation, at one level.

    Parameters
    ----------
    result : of the sweep.
    ax : to draw on.
    probe : name.
    curve : one of its curves.

    Returns
    -------
    The axes.
    """
    ratio = np.abs(curve.displacement[probe].harmonics[:MOST_CURVES]) / curve.excitation_amplitude
    scale = _per_level([curve], ratio)
    drawn = [
        _swept(f"order {Fraction(float(order)).limit_denominator(12)}", curve, square, mean=True)
        for order, square in zip(curve.orders, ratio**2, strict=False)
    ]
    level = _level(result, curve, always=True)[2:]
    up = (f"Mean square of {probe}\n/ that of {level}, ({scale.unit})²", Scale(scale.factor**2, ""))
    draw_sweep(result, ax, _chart(up, drawn, note=curve.direction))
    top = float(np.nanmax(ratio**2, initial=0.0)) * scale.factor**2
    if 0.0 < top < np.inf:
        ax.set_ylim(1e-8 * top, 3.0 * top)
    return ax


def _per_level(curves: list[SweepCurve], *ratios: Floats) -> Scale:
    """In which displacements divided by the excitation are shown."""
    excitation = curves[0].excitation_unit if curves else "m/s^2"
    level = scale_for(excitation)
    length = scale_for("m", *(ratio / level.factor for ratio in ratios))
    return Scale(length.factor / level.factor, f"{length.unit} per {level.unit.replace('^2', '²')}")


def plot_contact(result: SweepResult, ax: Axes, direction: str) -> Axes:
    """Fraction of time in contact over frequency: 0 without contact, 1 where contact is never lost.

    Parameters
    ----------
    result : of a sweep with snubbers.
    ax : to draw on.
    direction : up or down.

    Returns
    -------
    The axes.
    """
    drawn = [
        _swept(f"{name}{_level(result, curve, always=True)}", curve, share, mean=True)
        for curve in _in_direction(result, direction)
        for name, share in curve.contact_share.items()
    ]
    draw_sweep(result, ax, _chart(("Time in contact", Scale(100.0, "%")), drawn, log="", note=direction))
    ax.set_ylim(-2, 102)
    return ax


def plot_contact_levels(result: SweepResult, ax: Axes) -> Axes:
    """Level at which contact first begins or is lost, over frequency, with the levels of the sweep.

    The curve of a contact is drawn where no other one changes before.
    """
    linear = result.linear
    drawn = []
    for name, levels in linear.contact.items():
        what = "contact is lost" if levels.closed_at_rest else "contact begins"
        if not np.any(levels.predicted > 0.0):  # it just touches at rest: a logarithmic axis has no zero
            when = "with any motion" if np.any(levels.predicted == 0.0) else "after another"
            drawn.append(Curve(f"{name}: {what} {when}", np.zeros(0), np.zeros(0), {"linestyle": "none"}))
        else:
            drawn.append(Curve(f"{name}: {what}", linear.frequency_hz, levels.predicted))
    grey = {"color": "0.6", "linestyle": "-", "linewidth": 0.8, "zorder": 0}
    curves = {c.level_index: c for c in result.curves.values()}.values()
    swept = [(c.frequency_hz, np.abs(c.excitation_amplitude)) for c in curves]
    drawn = [*drawn[:MOST_CURVES], *(Curve("" if k else "sweep", *at, grey) for k, at in enumerate(swept))]
    scale = scale_for(next(iter(curves)).excitation_unit)
    return draw_sweep(result, ax, _chart(("Level", scale), drawn, of=""))


def plot_preload_needed(result: SweepResult, ax: Axes) -> Axes:
    """Preload needed to keep contact at the highest excitation of the sweep, over frequency."""
    curve = max(result.curves.values(), key=lambda c: float(c.excitation_amplitude.max(initial=0.0)))
    amplitude = curve.amplitude_at(result.linear.frequency_hz)
    drawn = [
        Curve(name, result.linear.frequency_hz, levels.preload_needed * amplitude)
        for name, levels in result.linear.contact.items()
    ]
    return draw_sweep(result, ax, _chart(("Preload needed to keep contact", "N"), drawn, of="snubbers"))


def plot_steady_states(result: SweepResult, ax: Axes, curve_name: str) -> Axes:
    """Period of the steady motion in cycles of the excitation; crosses, below, where the motion has none.

    Parameters
    ----------
    result : of a stepped sweep.
    ax : to draw on.
    curve_name : direction and number of the level, such as up_0.

    Returns
    -------
    The axes.
    """
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
    draw_sweep(result, ax, _chart(("Period (cycles of the excitation)", ""), drawn, log="", note=curve.direction))
    longest = int(np.max(drawn[0].y, initial=1))
    ticks = {k: str(k) for k in range(1, longest + 1, -(-longest // MOST_PERIODS))}
    if not periodic.all():
        ticks = {0: "none", **ticks}
    ax.set_yticks(list(ticks), list(ticks.values()))
    return ax


def plot_poincare(result: SweepResult, ax: Axes, curve_name: str, probe: str) -> Axes:
    """Poincaré sections of the motions that are not periodic: displacement at phase 0 over frequency.

    Parameters
    ----------
    result : of a stepped sweep.
    ax : to draw on.
    curve_name : direction and number of the level, such as up_0.
    probe : name.

    Returns
    -------
    The axes.
    """
    curve = result.curves[curve_name]
    assert curve.steady is not None
    displacement = curve.steady.poincare_displacement[:, list(curve.displacement).index(probe)]
    dots = {"linestyle": "none", "marker": "o", "color": "black", "markersize": 1.3, "markeredgewidth": 0}
    drawn = [Curve("", curve.steady.poincare_frequency_hz, displacement, dots)]
    up = (f"Displacement of {probe}\nat phase 0", "m")
    return draw_sweep(result, ax, _chart(up, drawn, log="", note=curve.direction))


def plot_notched_level(curve: SweepCurve, ax: Axes) -> Axes:
    """The level with and without notches, and the ranges in which it is lowered."""
    notching = curve.notching
    assert notching is not None
    drawn = [
        Curve("specified", notching.frequency_hz, notching.specified, {"color": "0.5", "linestyle": "--"}),
        Curve("notched", notching.frequency_hz, notching.level, {"color": DARK, "linestyle": "-", "linewidth": 1.4}),
    ]
    draw_curves(ax, ("Excitation frequency", HERTZ), ("Level", notching.unit), drawn, log="y")
    return ax


def plot_limited_response(curve: SweepCurve, ax: Axes, limit: NotchLimit) -> Axes:
    """Largest magnitude of a limited quantity in every cycle, with its limit; shaded where it governs.

    Parameters
    ----------
    curve : with notches.
    ax : to draw on.
    limit : one of those that it keeps.

    Returns
    -------
    The axes.
    """
    assert curve.notching is not None
    peak = limited_peak(curve, limit.name)
    level = Guide("limit", limit.limit, {"color": RED, "linestyle": (0, (5, 1.5)), "linewidth": 1.4})
    words = limit.name.replace("probes.", "").replace("snubbers.", "").replace(".", " ")
    response = [Curve("", curve.frequency_hz, peak, {"linewidth": 1.0})]
    _, scale = draw_curves(ax, ("Excitation frequency", HERTZ), (words, limit.unit), response, [level])
    governed = [part for part in curve.notching.ranges if part.limit == limit.name]
    for number, part in enumerate(governed):
        ax.axvspan(part.from_hz, part.to_hz, color="0.86", linewidth=0, zorder=0,
                   label="_nolegend_" if number else "governs")  # fmt: skip
    legend(ax)
    ax.set_ylim(0.0, 1.25 * max(limit.limit, float(np.nanmax(peak))) * scale.factor)
    return ax


def limited_peak(curve: SweepCurve, name: str) -> Floats:
    """(C,) largest magnitude in each cycle of what a limit of ``sweep.notch_to`` applies to."""
    forces = [n for n, o in curve.outputs.items() if o.quantity == "reaction_force" and o.at == "base"]
    of = limited_quantity(name, *forces[:1])
    assert of is not None
    return curve.envelope_of(of).peak


def notching_figure(curve: SweepCurve, title: str) -> Figure:
    """Level and limited responses over frequency, one above the other."""
    assert curve.notching is not None
    limits = sorted(curve.notching.limits, key=lambda limit: -limit.share)[:MOST_LEVELS]
    below = [partial(plot_limited_response, curve, limit=limit) for limit in limits]
    figure = picture(f"{title}, {curve.direction}", partial(plot_notched_level, curve), *below, sharex=True)
    frequency_axis(figure.axes[-1], float(curve.frequency_hz.min()), float(curve.frequency_hz.max()))
    return figure


def charts(result: SweepResult) -> dict[str, Chart]:
    """Displacements of the first probe at every level, and other peaks at the last, by name."""
    if not result.curves:
        return {}
    last = list(result.curves.values())[-1]
    probe, indices = next(iter(last.displacement)), sorted({c.level_index for c in result.curves.values()})
    drawn = {f"response_{index}": responses(result, probe, index) for index in indices}
    names = {ACCELERATION: "acceleration", FORCE: "contact"}
    followed = [value for value, _ in last.peaks() if value.followed and value.key != DISPLACEMENT]
    return drawn | {names.get(value.key, value.name): peaks(result, value, last.level_index) for value in followed}


def sweep_figures(result: SweepResult) -> dict[str, Figure]:
    """All plots available for this result; the key is the last part of the file name."""
    if not result.curves:
        return {}
    last, direction = list(result.curves.values())[-1], next(iter(result.curves.values())).direction
    probe, same = next(iter(last.displacement)), _in_direction(result, direction)
    plots = {name: [partial(draw_sweep, result, chart=chart)] for name, chart in charts(result).items()}
    if last.has_transmissibility:
        plots["acceleration"].append(partial(plot_transmissibility, result, level_index=last.level_index))
    for index in result.histories:
        if _has_spectrogram(result, probe, index):
            plots[f"spectrogram_{index}"] = [partial(plot_spectrogram, result, probe=probe, level_index=index)]
    plots["waterfall"] = [partial(plot_waterfall, result, probe=probe, curve_name=last.name)]
    if last.force:
        plots["contact"].append(partial(plot_contact, result, direction=direction))
    if last.outputs:
        names = list(last.outputs)[:MOST_CURVES]
        plots["outputs"] = [partial(plot_output_peaks, result, name=name) for name in names]
    if result.linear.contact:
        plots["contact_levels"] = [partial(plot_contact_levels, result), partial(plot_preload_needed, result)]
    if len({c.level_index for c in result.curves.values()}) > 1:
        plots["levels"] = [partial(plot_level_family, result, probe=probe, direction=direction)]
        energies = [partial(plot_harmonic_energy, result, probe=probe, curve=curve) for curve in same[:MOST_LEVELS]]
        plots["harmonic_energy"] = energies
    if last.steady is not None:
        plots["steady_states"] = [partial(plot_steady_states, result, curve_name=last.name)]
        if last.steady.poincare_frequency_hz.size:  # of motions that are not periodic
            plots["steady_states"].append(partial(plot_poincare, result, curve_name=last.name, probe=probe))
    figures = {name: picture(result.title, *panels) for name, panels in plots.items()}
    for curve in result.curves.values():
        if curve.notching is not None:
            figures[f"notching_{curve.name}"] = notching_figure(curve, result.title)
    return figures
