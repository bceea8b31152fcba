"""Plots of a sweep: response over frequency, waterfall, levels, energy in the harmonics, contact."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import partial
from itertools import pairwise
from math import isfinite
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from beamsim.analyses.sweep.result import NotchLimit, SweepCurve, SweepResult, contact_levels_of
from beamsim.labelled import Dataset
from beamsim.plots.drawing import (
    DARK,
    HERTZ,
    MOST_CURVES,
    RED,
    Axis,
    Chart,
    Curve,
    Guide,
    Picture,
    dashed_line,
    finish,
    highest_in_bins,
    limit_curves,
    limit_levels,
    marks_curve,
    over_frequencies,
)
from beamsim.plots.style import Scale, amount, level_text, scale_for
from beamsim.responses.histories import NOTABLE
from beamsim.results.values import ACCELERATION, DISPLACEMENT, FORCE, OUTPUT, Value, peaks_in
from beamsim.scenario.reporting import limited_quantity
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
    result: SweepResult, y_axis: Axis, curves: Sequence[Curve], log: str = "y", direction: str = "", **options: Any
) -> Chart:
    """Curves over the frequencies of the sweep.

    Parameters
    ----------
    result : with curves.
    y_axis, curves : as of `Chart`.
    log : of the axis up; that of frequency is logarithmic where it is wide.
    direction : up or down, where the curves are of one.
    options : of `Chart`.

    Returns
    -------
    From the lowest to the highest frequency of all curves of the sweep.
    """
    chart = Chart((f"Excitation frequency{direction and f', {direction}'}", HERTZ), y_axis, curves, log=log, **options)
    return over_frequencies(chart, np.concatenate([curve.frequency_hz for curve in result.curves.values()]))


def _swept(label: str, curve: SweepCurve, values: Floats, *, mean: bool = False) -> Curve:
    """What belongs to each cycle; of many cycles the highest (or mean) values."""
    return Curve(label, *highest_in_bins(curve.frequency_hz, values, mean=mean))


def _of_level(result: SweepResult, index: int) -> list[SweepCurve]:
    return [curve for curve in result.curves.values() if curve.level_index == index]


def _in_direction(result: SweepResult, direction: str) -> list[SweepCurve]:
    return [curve for curve in result.curves.values() if curve.direction == direction]


def _level(result: SweepResult, curve: SweepCurve, *, even_if_single: bool = False) -> str:
    """The level of a curve, where there are several."""
    several = even_if_single or len({c.level_index for c in result.curves.values()}) > 1
    return f", {level_text(curve.level, result.scenario.level_unit)}" if several else ""


def responses(result: SweepResult, probe: str, level_index: int = 0) -> Chart:
    """Peak displacement from static equilibrium over frequency, with that of the linear structures.

    Grey are those with every snubber open and always closed; first, and full, the one that holds at rest.

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
    drawn = [_swept(f"sweep {c.direction}", c, c.response(probe)) for c in curves]
    linear, frequency_hz = result["linear"], result["linear"]["frequency_hz"].values
    amplitude = curves[0].amplitude_at(frequency_hz)
    states = {"open, linear": "displacement", "always closed, linear": "displacement_closed"}
    known = [
        (name, np.hypot(*(linear[f"{of}_{part}"].sel(probe=probe).values for part in ("real", "imag"))) * amplitude)
        for name, of in states.items()
        if f"{of}_real" in linear
    ]
    for k, (name, values) in enumerate(reversed(known) if linear["closed_at_rest"].item() else known):
        grey = {"color": "0.6", "linestyle": "--" if k else "-", "linewidth": 1.0, "zorder": 1}
        drawn.append(Curve(name if curves[0].cycles.labels("snubber") else "linear", frequency_hz, values, grey))
    # more than eight labels are not readable
    named = [p for p in result.peaks if p.curve in {c.name for c in curves} and p.probe == probe][:8]
    for kind in dict.fromkeys(p.kind for p in named):
        peaks, face = [(p.frequency_hz, p.value_m) for p in named if p.kind == kind], "harmonic" in kind
        marks = {"marker": _MARKS[kind], "markersize": 5, "markerfacecolor": "white" if face else "0.2"}
        drawn.append(marks_curve(kind, peaks, color="0.2", **marks))
    offset = curves[0].offset(probe)
    offset_text = f"\nfrom equilibrium at {amount(offset, 'm')}" if offset else ""
    y_axis = (f"Peak displacement of {probe}{_level(result, curves[0])}{offset_text}", "m")
    whole = not offset  # which limits are of
    levels = limit_levels(result.scenario.limits, "peak_displacement", probe) if whole else []
    limits = _limits(curves[0], "displacement", "m", probe) if whole else []
    return _chart(result, y_axis, drawn, levels=levels, curve_noun="", marks=limits)


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
        _swept(f"{name}, {curve.direction}", curve, peak.values)
        for curve in curves
        for name, peak in curve.cycles.by_label(f"peak_{value.quantity}").items()
        if peak.unit == value.unit
    ]
    y_axis = (f"{value.label.capitalize()}{_level(result, curves[0])}".replace(", ", "\nat "), value.unit)
    levels, marks = limit_levels(result.scenario.limits, value.limit), _limits(curves[0], value.quantity, value.unit)
    return _chart(result, y_axis, drawn, log="" if value.key == FORCE else "y", levels=levels, marks=marks)


def _limits(curve: SweepCurve, quantity: str, unit: str, name: str = "") -> list[Curve]:
    """Limits over frequency of what is drawn, of the first curve, in the colours of its envelopes."""
    peaks, limits = (curve.cycles.by_label(f"{of}_{quantity}") for of in ("peak", "limit"))
    alike = [at for at, peak in peaks.items() if peak.unit == unit and name in ("", at)]
    return limit_curves({at: limits[at].values if limits else None for at in alike}, curve.frequency_hz)


def transmissibility(result: SweepResult, level_index: int) -> Chart:
    """Fundamental of every probe's absolute acceleration over that of the base, with Q of its highest peak."""
    drawn = []
    for curve in _of_level(result, level_index):
        for name in curve.places("absolute_acceleration"):
            peak = curve.resonance(name)
            known = ""
            if peak and isfinite(peak.quality):
                known = f": Q {peak.quality:.3g} at {peak.frequency_hz:.4g} Hz"
            elif peak and peak.too_fast:
                known = f": swept too fast to show Q at {peak.frequency_hz:.4g} Hz"
            drawn.append(_swept(f"{name}, {curve.direction}{known}", curve, curve.transmissibility(name)))
    return _chart(result, ("Transmissibility", Scale(1.0, "g per g")), drawn)


def output_peaks(result: SweepResult, name: str) -> Chart:
    """Peaks of an output over frequency, by direction and level, with its limit."""
    curves = list(result.curves.values())
    drawn = [_swept(f"{c.direction}{_level(result, c)}", c, c.channel("output", name).peak) for c in curves]
    levels = limit_levels(result.scenario.limits, OUTPUT.limit, name)
    y_axis = (f"Peak of {name}", curves[0].channel("output", name).unit)
    return _chart(result, y_axis, drawn, log="", levels=levels, y_ends=(0.0, None))


def plot_waterfall(result: SweepResult, ax: Axes, probe: str, curve: SweepCurve) -> None:
    """Tracked harmonics: response frequency over excitation frequency, coloured by amplitude in dB.

    Parameters
    ----------
    result : of the sweep.
    ax : to draw on.
    probe : name.
    curve : one of its curves.
    """
    step = max(1, curve.frequency_hz.size // 1500)
    amplitude, f = np.abs(curve.channel("displacement", probe).harmonics)[:, ::step], curve.frequency_hz[::step]
    top = float(np.nanmax(amplitude, initial=0.0)) or 1.0
    for order, values in zip(curve.orders, amplitude, strict=True):
        level = 20 * np.log10(np.maximum(values, 1e-30) / top)
        drawn = ax.scatter(f, order * f, c=level, s=9, marker="s", linewidths=0, cmap="magma_r", vmin=-60, vmax=0)
        fraction = Fraction(float(order)).limit_denominator(12)
        ax.annotate(f"{fraction}", (f.max(), order * f.max()), xytext=(4, 0), textcoords="offset points", va="center",
                    fontsize="small", color="0.2")  # fmt: skip
    for natural in result["modes"]["open_frequencies_hz"].values:
        if natural <= curve.orders.max(initial=1.0) * f.max():
            ax.axhline(natural, color="0.75", linewidth=0.6, zorder=0)
    if curve.orders.size:
        ax.figure.colorbar(drawn, ax=ax, label="Amplitude (dB re largest)")
    finish(ax, f"Excitation frequency (Hz), {curve.direction}", f"Response frequency of {probe} (Hz)")
    ax.set_ylim(bottom=0.0)
    ax.grid(visible=False)


def _has_spectrogram(result: SweepResult, probe: str, level_index: int) -> bool:
    """Whether a time history is stored that moves and is long enough for some windows."""
    history = _histories(result)[level_index]
    return history["time"].values.size >= 8 * FEWEST_SAMPLES and bool(
        np.any(history["displacement"].sel(probe=probe).values)
    )


def _histories(result: SweepResult) -> dict[int, Dataset]:
    """The kept time histories by the number of the level."""
    if "histories" not in result.datasets:
        return {}
    histories, levels = result["histories"], result["levels"].labels("level_index")
    ends = np.searchsorted(histories["level"].values, np.arange(len(levels) + 1)).tolist()
    parts = zip(levels, pairwise(ends), strict=True)
    return {level: histories.isel(sample=slice(first, end)) for level, (first, end) in parts if end > first}


def plot_spectrogram(result: SweepResult, ax: Axes, probe: str, level_index: int) -> None:
    """Spectrum of the displacement over time, in dB re its largest line; the frequency of the sweep is dashed.

    Hann windows of 24 cycles of the lowest frequency, at most an eighth of the stored time history.

    Parameters
    ----------
    result : of a sweep with a stored time history of the level.
    ax : to draw on.
    probe : name.
    level_index : number of the level, from 0.
    """
    history, curves = _histories(result)[level_index], _of_level(result, level_index)
    x, (begin, end) = history["displacement"].sel(probe=probe).values, history["time"].values[[0, -1]]
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
    ax.figure.colorbar(image, ax=ax, label="Level (dB re largest)")
    finish(ax, "Time (s)", f"Frequency in the displacement of {probe} (Hz)")
    ax.grid(visible=False)
    ax.set_ylim(0.0, min(2.0 * max(float(np.max(curves[0].orders)), 1.0) * float(highest), 0.5 * rate))
    aliased = float(result["levels"]["aliased_displacement"].sel(level_index=level_index, probe=probe).item())
    if aliased > NOTABLE:
        text = f"{100.0 * aliased:.2g} % of the rms lies above {0.5 * rate:.4g} Hz and is aliased"
        ax.set_title(text, fontsize="small", loc="right")


def level_family(result: SweepResult, probe: str, direction: str) -> Chart:
    """Peak displacement from static equilibrium divided by excitation amplitude for each level."""
    curves = _in_direction(result, direction)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = [curve.response(probe) / curve.excitation_amplitude for curve in curves]
    drawn = [
        _swept(_level(result, curve, even_if_single=True)[2:], curve, ratio)
        for curve, ratio in zip(curves, ratios, strict=True)
    ]
    y_axis = (f"Peak displacement of {probe} / level", _per_level(curves, *ratios))
    return _chart(result, y_axis, drawn, direction=direction, curve_noun="levels")


def harmonic_energy(result: SweepResult, probe: str, curve: SweepCurve) -> Chart:
    """Mean-square response in each harmonic divided by mean-square excitation, at one level."""
    ratio = np.abs(curve.channel("displacement", probe).harmonics[:MOST_CURVES]) / curve.excitation_amplitude
    scale, top = _per_level([curve], ratio), float(np.nanmax(ratio**2, initial=0.0))
    drawn = [
        _swept(f"order {Fraction(float(order)).limit_denominator(12)}", curve, square, mean=True)
        for order, square in zip(curve.orders, ratio**2, strict=False)
    ]
    level = _level(result, curve, even_if_single=True)[2:]
    y_axis = (f"Mean square of {probe}\n/ that of {level}, ({scale.unit})²", Scale(scale.factor**2, ""))
    ends = (1e-8 * top, 3.0 * top) if 0.0 < top < np.inf else (None, None)
    return _chart(result, y_axis, drawn, direction=curve.direction, y_ends=ends)


def _per_level(curves: list[SweepCurve], *ratios: Floats) -> Scale:
    """In which displacements divided by the excitation are shown."""
    excitation = curves[0].excitation_unit if curves else "m/s^2"
    level = scale_for(excitation)
    length = scale_for("m", *(ratio / level.factor for ratio in ratios))
    return Scale(length.factor / level.factor, f"{length.unit} per {level.unit.replace('^2', '²')}")


def contact(result: SweepResult, direction: str) -> Chart:
    """Fraction of time in contact over frequency: 0 without contact, 1 where contact is never lost."""
    drawn = [
        _swept(f"{name}{_level(result, curve, even_if_single=True)}", curve, share.values, mean=True)
        for curve in _in_direction(result, direction)
        for name, share in curve.cycles.by_label("contact_share").items()
    ]
    y_axis = ("Time in contact", Scale(100.0, "%"))
    return _chart(result, y_axis, drawn, log="", direction=direction, y_ends=(-0.02, 1.02))


def contact_levels(result: SweepResult) -> Chart:
    """Level at which contact first begins or is lost, over frequency, with the levels of the sweep.

    The curve of a contact is drawn where no other one changes before; markers show the levels that the summary names.
    """
    frequency_hz, drawn = result["linear"]["frequency_hz"].values, []
    for name, levels in contact_levels_of(result["linear"]).items():
        what = "contact is lost" if levels.closed_at_rest else "contact begins"
        if np.all(np.isinf(levels.levels_of_change)):
            drawn.append(Curve(f"{name}: {what} at no level", np.zeros(0), np.zeros(0), {"linestyle": "none"}))
        elif not np.any(levels.predicted_levels > 0.0):
            drawn.append(Curve(f"{name}: {what} after another", np.zeros(0), np.zeros(0), {"linestyle": "none"}))
        else:
            drawn.append(Curve(f"{name}: {what}", frequency_hz, levels.predicted_levels))
    grey = {"color": "0.6", "linestyle": "-", "linewidth": 0.8, "zorder": 0}
    curves = {c.level_index: c for c in result.curves.values()}.values()
    swept = [
        Curve("" if k else "sweep", c.frequency_hz, np.abs(c.excitation_amplitude), grey) for k, c in enumerate(curves)
    ]
    marks = {
        "gapping": ("lowest level", {"marker": "v", "color": "k"}),
        "closest_to_test": ("closest to the test", {"marker": "o", "color": "k", "fillstyle": "none"}),
    }
    for entry, (label, style) in marks.items():
        shown = [of for of in result.summary.get(entry, {}).values() if np.isfinite(of["share_of_level"])]
        if shown:
            hz, level = (np.array([of[key] for of in shown]) for key in ("frequency_hz", "level"))
            swept.append(Curve(label, hz, level, style | {"linestyle": "none"}))
    scale = scale_for(next(iter(curves)).excitation_unit)
    return _chart(result, ("Level", scale), drawn, curve_noun="snubbers", marks=swept)


def preload_needed(result: SweepResult, unit: str = "N") -> Chart:
    """Preload (N, or N m) needed to keep contact at the highest excitation of the sweep, over frequency."""
    curve = max(result.curves.values(), key=lambda c: float(c.excitation_amplitude.max(initial=0.0)))
    frequency_hz = result["linear"]["frequency_hz"].values
    amplitude = curve.amplitude_at(frequency_hz)
    drawn = [
        Curve(name, frequency_hz, levels.preload_needed * amplitude)
        for name, levels in contact_levels_of(result["linear"]).items()
        if levels.force_unit == unit and np.any(levels.preload_needed > 0.0)  # of a latch none is needed
    ]
    return _chart(result, ("Preload needed to keep contact", unit), drawn, curve_noun="snubbers")


def steady_states(result: SweepResult, curve: SweepCurve) -> Chart:
    """Period of the steady motion in cycles of the excitation; crosses, below, where the motion has none."""
    steady = curve.tables["steady_states"]
    kind = steady["kind"].values
    whole: dict[str, Any] = {"clip_on": False, "zorder": 3, "linestyle": "none"}  # marks at the ends of the axis
    dots = {**whole, "marker": "o", "markersize": 3, "color": DARK}
    periodic = kind == "periodic"
    drawn = [Curve("periodic", curve.frequency_hz[periodic], steady["period_cycles"].values[periodic], dots)]
    for mark, name in zip("x+1", ("quasi-periodic", "chaotic", "not settled"), strict=True):
        here = curve.frequency_hz[kind == name]
        if here.size:
            marks = {**whole, "marker": mark, "markersize": 6, "color": RED}
            drawn.append(Curve(name, here, np.zeros(here.size), marks))
    longest = int(np.max(drawn[0].y, initial=1))
    ticks = {k: str(k) for k in range(1, longest + 1, -(-longest // MOST_PERIODS))}
    if not periodic.all():
        ticks = {0: "none", **ticks}
    return _chart(
        result, ("Period (cycles of the excitation)", ""), drawn, log="", direction=curve.direction,
        draw_extra=lambda ax, *_: ax.set_yticks(list(ticks), list(ticks.values())),
    )  # fmt: skip


def poincare(result: SweepResult, curve: SweepCurve, probe: str) -> Chart:
    """Poincaré sections of the motions that are not periodic: displacement at phase 0 over frequency."""
    points = curve.tables["poincare"]
    displacement = points["section_displacement"].sel(probe=probe).values
    dots = {"linestyle": "none", "marker": "o", "color": "black", "markersize": 1.3, "markeredgewidth": 0}
    drawn = [Curve("", points["frequency_hz"].values, displacement, dots)]
    return _chart(result, (f"Displacement of {probe}\nat phase 0", "m"), drawn, log="", direction=curve.direction)


def notching(result: SweepResult, curve: SweepCurve) -> Picture:
    """The level with and without notches over the limited responses, whose limits are those that are used most."""
    notched = curve.notching
    assert notched is not None
    drawn = [
        Curve("specified", notched.frequency_hz, notched.specification, {"color": "0.5", "linestyle": "--"}),
        Curve("notched", notched.frequency_hz, notched.level, {"color": DARK, "linestyle": "-", "linewidth": 1.4}),
    ]
    limits = sorted(notched.limits, key=lambda limit: -limit.share)[:MOST_LEVELS]
    panels = [_chart(result, ("Level", notched.unit), drawn), *(_limited_response(result, curve, x) for x in limits)]
    return Picture(f"{result.title}, {curve.direction}", panels, sharex=True)


def _limited_response(result: SweepResult, curve: SweepCurve, limit: NotchLimit) -> Chart:
    """Largest magnitude of a limited quantity in every cycle, with its limit; shaded where it governs."""
    assert curve.notching is not None
    quantities, places = (curve.cycles.by_label(f"output_{column}") for column in ("quantity", "at"))
    forces = [name for name in places if (quantities[name].item(), places[name].item()) == ("reaction_force", "base")]
    limited = limited_quantity(limit.name, *forces[:1])
    assert limited is not None
    peak = curve.limited_values(limited).peak
    level = Guide("limit", limit.limit, {"color": RED, "linestyle": (0, (5, 1.5)), "linewidth": 1.4})
    words = limit.name.replace("probes.", "").replace("snubbers.", "").replace(".", " ")
    response = [Curve("", curve.frequency_hz, peak, {"linewidth": 1.0})]
    governed = [part for part in curve.notching.ranges if part.limit == limit.name]

    def shade(ax: Axes, *_: Scale) -> None:
        for number, part in enumerate(governed):
            ax.axvspan(part.from_hz, part.to_hz, color="0.86", linewidth=0, zorder=0,
                       label="_nolegend_" if number else "governs")  # fmt: skip

    top = 1.25 * max(limit.limit, float(np.nanmax(peak)))
    return _chart(result, (words, limit.unit), response, log="", levels=[level], y_ends=(0.0, top), draw_extra=shade)


def sweep_figures(result: SweepResult) -> dict[str, Picture]:
    """All pictures of this result; the key is the last part of the file name."""
    if not result.curves:
        return {}
    last, direction = list(result.curves.values())[-1], next(iter(result.curves.values())).direction
    probe, index = next(iter(last.places("displacement")), ""), last.level_index
    levels = sorted({c.level_index for c in result.curves.values()})
    panels: dict[str, list[Any]] = {f"response_{k}": [responses(result, probe, k)] for k in levels if probe}
    names = {ACCELERATION: "acceleration", FORCE: "contact"}
    touched = "peak_force" in result["cycles"] and bool(np.any(result["cycles"]["peak_force"].values))
    left_out = (DISPLACEMENT,) if touched else (DISPLACEMENT, FORCE)
    for value in [value for value, _ in peaks_in(last.cycles) if value.in_sweeps and value.key not in left_out]:
        panels.setdefault(names.get(value.key, value.name), []).append(peaks(result, value, index))
    if last.has_transmissibility:
        panels["acceleration"].append(transmissibility(result, index))
    for k in _histories(result):
        if probe and _has_spectrogram(result, probe, k):
            panels[f"spectrogram_{k}"] = [partial(plot_spectrogram, result, probe=probe, level_index=k)]
    if probe:
        panels["waterfall"] = [partial(plot_waterfall, result, probe=probe, curve=last)]
    if touched:
        panels["contact"].append(contact(result, direction))
    if last.places("output"):
        panels["outputs"] = [output_peaks(result, name) for name in last.places("output")[:MOST_CURVES]]
    if levels_of_contact := contact_levels_of(result["linear"]):
        units = dict.fromkeys(of.force_unit for of in levels_of_contact.values())
        first = [contact_levels(result)]  # without a curve where a stop just touches: contact changes with any motion
        shown = first if any(curve.x.size for curve in first[0].curves) else []
        preloads = [preload_needed(result, unit) for unit in units]
        if shown := [*shown, *(chart for chart in preloads if chart.curves)]:
            panels["contact_levels"] = shown
    if len(levels) > 1 and probe:
        panels["levels"] = [level_family(result, probe, direction)]
        same = _in_direction(result, direction)[:MOST_LEVELS]
        panels["harmonic_energy"] = [harmonic_energy(result, probe, curve) for curve in same]
    if last.kind == "stepped":
        panels["steady_states"] = [steady_states(result, last)]
        if probe and last.tables["poincare"]["frequency_hz"].values.size:  # of motions that are not periodic
            panels["steady_states"].append(poincare(result, last, probe))
    figures = {name: Picture(result.title, each) for name, each in panels.items()}
    notched = [curve for curve in result.curves.values() if curve.notching is not None]
    return figures | {f"notching_{curve.name}": notching(result, curve) for curve in notched}
