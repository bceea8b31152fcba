"""Plots of a run: the pictures of a result, each of charts."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.ticker import MaxNLocator

from beamsim.analyses.run.result import (
    RunResult,
    misfit_of_matched,
)
from beamsim.labelled import Dataset, LabelledArray
from beamsim.plots.bodies import body_figures, mounting_motion, stops_of
from beamsim.plots.drawing import (
    DARK,
    HERTZ,
    MOST_CURVES,
    PALE,
    Axis,
    Chart,
    Curve,
    Guide,
    HeatMap,
    Picture,
    PowersOfTen,
    curve_style,
    finish,
    legend,
    limit_curves,
    limit_levels,
    marks_curve,
    with_neighbours,
    with_unit,
)
from beamsim.plots.style import ROUND_OFF, Scale, amount, plain_scale, scale_for
from beamsim.results.result import ALLOWED_ERROR
from beamsim.results.values import OUTPUT
from beamsim.scenario.reporting import INPUT
from beamsim.structures.assembly import site_in, snubber_site
from beamsim.summaries import place_in_words
from beamsim.system.structural import FORCE_UNITS
from beamsim.typing import Bools, Floats, not_none

MOST_STATES = 2**16  # samples in a phase portrait or force-deflection loop
CELLS = 20, 120  # along each axis of a phase portrait that is a density, at least and at most
MOST_BANDS = 400  # of the spectrum of a random motion
SPECTRUM_DB = 60.0  # below the highest point of a spectrum, down to which its frequencies are shown
DOUBTFUL_LINES = f"lines that are off by more than {100 * ALLOWED_ERROR:g} %"
DECAYING_LINES = "lines, weighted to the beginning"
DENSITY_SHOWN = 1e-7  # of the largest density, below which nothing is shown
POWER_NOTED = 0.01  # of the power of a response, outside the band of the input
POWER_SHOWN = 1e-3  # of the input's largest density, below which a transmissibility is that of leakage and round-off
_FREQUENCY = ("Frequency", "Hz")
_MOMENT = "Contact moment"
_CONTACT = (  # picture, label, unit, limit and entry of the peaks
    ("contact_force", "Contact force", "N", "peak_force", "peak_force_n"),
    ("contact_moment", _MOMENT, "N m", "peak_moment", "peak_moment_n_m"),
)
_FRICTION = (("m", "Displacement along the face", "Friction force"), ("rad", "Angle", "Friction moment"))
_PEAKS = {"m": ("Peak force of an impact", "N"), "rad": ("Peak moment of an impact", "N m")}  # of snubbers and hinges
_MARKS = ("o", "^", "s", "D", "v", "x")  # of snubbers
_LINE_MARKS = {"fundamental": "o", "superharmonic": "o", "subharmonic": "^", "other": "x", "chosen": "D"}
_FREE, _CLOSED = "0.62", "#a3263d"  # apart in grey print, too


def histories(
    result: RunResult, y_axis: Axis, values: Mapping[str, Floats], levels: Iterable[Guide] = (), note: str = "",
    noun: str = "probes",
) -> list[Chart]:  # fmt: skip
    """Time histories: the whole, and its last periods, unless that is the whole, or nothing happens then.

    Parameters
    ----------
    result : of the run.
    y_axis : words and unit of the values.
    values : (nt,) at the output times, by name; the first are drawn.
    levels : to compare with.
    note : on the whole.
    noun : what the values are of.

    Returns
    -------
    One panel, or two; none without values.
    """
    if not values:
        return []
    time = result["histories"]["time"].values
    begin, end = float(time[0]), float(time[-1])
    excitation = result.scenario.excitation.tone_hz
    # the close-up: six periods, or an eighth of a run without excitation frequency
    start = max(begin, end - (6 / excitation if np.isfinite(excitation) else 0.125 * (end - begin)))
    curves = [Curve(name, time, x) for name, x in values.items()]
    ends = begin, end if end > begin else begin + 1.0
    whole = Chart(("Time", plain_scale("s")), y_axis, curves, list(levels), curve_noun=noun, x_ends=ends, note=note)
    first = int(np.searchsorted(time, start))
    last = [Curve(name, time[first:], x[first:]) for name, x in values.items()]
    if result.scenario.excitation.shock or start <= begin or not any(np.any(curve.y) for curve in last):
        return [whole]
    return [whole, whole._replace(curves=last, x_ends=(start, end), note="")]


def _faces(result: RunResult) -> Iterator[Guide]:
    """Displacements at which stops on the base, at the place of a drawn probe, touch the body."""
    scenario, stops = result.scenario, stops_of(result)
    places = [site_in(scenario, probe) for probe in scenario.effective_probes[:MOST_CURVES]]
    for located in scenario.located_snubbers:
        stop = stops.get(located.item.name)
        if stop is None or snubber_site(located) not in places or located.item.mounted_on != "base":
            continue
        if any(each.moves_stop(stop.name) for _, each in scenario.excitation.items):
            continue
        side = "below" if stop.side == "below" else "above"
        if np.isfinite(stop.gap):
            face = (-1.0 if side == "below" else 1.0) * stop.gap
            dashes = (0, (7, 2.5)) if side == "below" else (0, (7, 2.5, 1.5, 2.5))
            yield Guide(f"face of {stop.name}", face, {"linewidth": 0.9, "linestyle": dashes})


def _convergence_note(result: RunResult, entry: str, noun: str = "peaks", quantity: str = "") -> str:
    """Which values of an entry have not converged, as a note: all, or those of one quantity."""
    errors = result.summary.get("convergence", {}).get(entry, {})
    listed = result.summary.get("doubtful", ())
    doubtful = [name for name in errors if f"{entry}.{name}" in listed]
    places = {name: place_in_words(entry, name) for name in doubtful}
    if quantity:  # the last word of a place
        places = {name: name.rpartition(" ")[0] for name in doubtful if name.rpartition(" ")[2] == quantity}
    texts = [f"{of} {100 * errors[name]:.2g}\N{NO-BREAK SPACE}%" for name, of in list(places.items())[:4]]
    note = f"{noun} not converged; error: {', '.join(texts)}{', …' * (len(places) > 4)}"
    return note if places else ""


def _over_bands(frequency: Floats, levels: Floats, end: float) -> tuple[Axis, Floats, Floats]:
    """The axis, places and levels of a spectrum in bands, of which not too many are shown up to an end, Hz."""
    count = max(int(np.searchsorted(frequency, end)) // MOST_BANDS, 1)
    x_axis = (f"Frequency in bands of {count * float(np.diff(frequency[:2])[0]):.2g} Hz", HERTZ)
    return x_axis, *band_levels(frequency, levels, count)


def spectrum(result: RunResult, quantity: str = "absolute_acceleration") -> Chart:
    """Levels over frequency divided by excitation frequency (or in Hz without one), with spectral lines marked.

    Neighbouring lines of a random motion differ by tens of dB and would cover a plot: of those the root mean square in
    bands is shown.
    """
    spectra = result["spectra"]
    shown = np.flatnonzero(spectra["quantity"].values == quantity)
    if not shown.size:
        return Chart(("Frequency", HERTZ), (quantity, ""), [])
    frequency, levels = spectra["frequency_hz"].values, spectra["amplitude_db"].values[shown]
    excitation = float(spectra["excitation_hz"].item())
    forced = math.isfinite(excitation)
    unit = excitation if forced else 1.0  # Hz
    # the end of the frequencies at which there is something to see
    top = float(levels.max())
    last = float(frequency[(levels > top - SPECTRUM_DB).any(axis=0)][-1]) / unit
    chosen = np.isin(spectra["line_signal"].values, shown) & (spectra["line_kind"].values == "chosen")
    seen = max(
        [float(np.clip(last, 4.0, 12.0)) if forced else last, *spectra["line_frequency_hz"].values[chosen] / unit]
    )
    end = min(1.05 * seen, float(frequency[-1]) / unit) or 1.0
    x_axis: Axis = ("Frequency", HERTZ) if unit == 1.0 else ("Frequency / excitation frequency", "")
    places = frequency / unit
    if result.scenario.excitation.stationary:
        x_axis, places, levels = _over_bands(frequency, levels, end)
    names = spectra["name"].values[shown].tolist()
    return Chart(
        x_axis, (f"{quantity.replace('_', ' ').capitalize()} (dB re peak)", ""),
        [Curve(name, places, level) for name, level in zip(names, levels, strict=True)], curve_noun="probes",
        marks=list(_marked_lines(spectra, int(shown[0]), unit, end)), x_ends=(0.0, end),
        y_ends=(top - 100.0, top + 6.0), note=_convergence_note(result, "spectral_lines", "lines", quantity),
    )  # fmt: skip


def band_levels(frequency: Floats, levels: Floats, count: int) -> tuple[Floats, Floats]:
    """Middles of bands of ``count`` lines (F,), Hz, and the root mean square of the lines (K, F) in each, dB."""
    whole = frequency.size - frequency.size % count
    middles, of_bands = (x[..., :whole].reshape(*x.shape[:-1], -1, count) for x in (frequency, levels))
    return middles.mean(axis=-1), 10.0 * np.log10(np.mean(10.0 ** (of_bands / 10.0), axis=-1))


def _marked_lines(spectra: Dataset, signal: int, unit: float, end: float) -> Iterator[Curve]:
    """The lines of a spectrum, that of a signal with this number, by their kind, and those that are doubtful."""
    of_signal = spectra["line_signal"].values == signal
    frequency, level, kinds, error = (
        spectra[f"line_{name}"].values[of_signal] for name in ("frequency_hz", "amplitude_db", "kind", "error")
    )
    falls = spectra["window"].values[signal] == "decaying"
    doubtful = (frequency <= end * unit) & (error > ALLOWED_ERROR)
    for kind, mark in (*_LINE_MARKS.items(), ("doubtful", "s")):
        these = doubtful if kind == "doubtful" else kinds == kind
        label, style = DECAYING_LINES if kind == "other" and falls else "", {"color": DARK, "markerfacecolor": "white"}
        if kind == "doubtful":
            label, style = DOUBTFUL_LINES, {"color": _CLOSED, "markerfacecolor": "none"}
        if these.any():
            places = list(zip((frequency[these] / unit).tolist(), level[these].tolist(), strict=True))
            yield marks_curve(label, places, marker=mark, markersize=8 if kind == "doubtful" else 4, **style)


class _Phases(NamedTuple):
    """The motion of a place, with the labels of its axes, and whether there is contact."""

    x_axis: tuple[str, Scale]
    y_axis: tuple[str, Scale]
    displacement: Floats  # (nt,) m or rad
    velocity: Floats  # (nt,)
    in_contact: Bools  # (nt,)


def _phases(result: RunResult, kind: str, name: str, samples: slice) -> _Phases:
    """The motion at a snubber or a probe; where the stop moves that relative to it, so that contact begins at its gap.

    Parameters
    ----------
    result : of the run.
    kind : snubber or probe.
    name : of it.
    samples : the samples that are drawn.
    """
    histories, place = result["histories"], {kind: name}
    start = "snubber_" if kind == "snubber" else ""
    displacement, velocity = (histories[f"{start}{of}"].sel(**place) for of in ("displacement", "velocity"))
    w, v, closed = displacement.values, velocity.values, np.zeros(displacement.values.size, dtype=bool)
    words, stand = ("Displacement", "Velocity") if displacement.unit == "m" else ("Angle", "Angular velocity"), None
    if start:
        closed, stand = histories["snubber_closed"].sel(**place).values, mounting_motion(result, stops_of(result)[name])
    if stand is not None:
        w, v = w - stand, v - np.gradient(stand, histories["time"].values)
    w, v = w[samples], v[samples]
    relative = "" if stand is None else ", relative to the stop"
    x_axis = f"At {name}{relative}\n{words[0]}", scale_for(displacement.unit, w)
    return _Phases(x_axis, (words[1], scale_for(f"{displacement.unit}/s", v)), w, v, closed[samples])


def phase_portrait(result: RunResult, kind: str, name: str) -> Chart:
    """Velocity over displacement at a snubber or probe, contact emphasised.

    Of a long run the last part is drawn. The part before the window of the spectrum is drawn in light grey.

    Parameters
    ----------
    result : of the run.
    kind : snubber or probe.
    name : of it.
    """
    time = result["histories"]["time"].values[-MOST_STATES:]
    x_axis, y_axis, w, v, closed = _phases(result, kind, name, slice(-MOST_STATES, None))
    early = time < (result["spectra"]["start_s"].item() if "spectra" in result.datasets else 0.0)
    parts = (
        (early, "", {"color": "0.85", "linewidth": 0.5, "zorder": 1}),
        (~early & ~closed, "free", {"color": _FREE, "linewidth": 0.9, "zorder": 2}),
        (with_neighbours(closed) & ~early, "in contact", {"color": _CLOSED, "linewidth": 1.8, "zorder": 3}),
    )
    curves = [
        Curve(label, w, np.where(kept, v, np.nan), {"linestyle": "-", **style})
        for kept, label, style in parts
        if kept.any()
    ]
    return Chart(x_axis, y_axis, curves)


def phase_density(result: RunResult, kind: str, name: str, start_s: float) -> HeatMap:
    """How long a random motion is in each cell of velocity over displacement, in red where it is mostly in contact.

    Parameters
    ----------
    result : of a run with a stationary input.
    kind : snubber or probe.
    name : of it.
    start_s : what comes before is left out, s.
    """
    first = int(np.searchsorted(result["histories"]["time"].values, start_s))
    x_axis, y_axis, w, v, closed = _phases(result, kind, name, slice(first, None))
    count, *edges = np.histogram2d(w, v, int(np.clip(0.6 * np.sqrt(w.size), *CELLS)))
    contact = np.histogram2d(w[closed], v[closed], edges)[0] > 0.5 * count
    share = np.where(count > 0.0, 100.0 * count / w.size, np.nan).T

    def plot(ax: Axes) -> None:
        norm = LogNorm(20.0 / w.size, float(np.nanmax(share)))  # a single sample is grey
        of_edges = [edge * scale.factor for edge, scale in zip(edges, (x_axis[1], y_axis[1]), strict=True)]
        for colours, where in (("Reds", contact.T), ("Greys", ~contact.T)):
            mesh = ax.pcolormesh(*of_edges, np.where(where, share, np.nan), cmap=colours, norm=norm, rasterized=True)
        label = "Share of the time (%)" + "; red: in contact" * bool(contact.any())
        bar = ax.figure.colorbar(mesh, ax=ax, label=label, format=PowersOfTen())
        bar.minorformatter = PowersOfTen()
        finish(ax, with_unit(*x_axis), with_unit(*y_axis))

    x, y = (0.5 * (edge[1:] + edge[:-1]) for edge in edges)
    return HeatMap(x_axis, y_axis, ("Share of the time (%)", ""), x, y, share, plot)


def force_deflection(result: RunResult, unit: str = "N") -> Chart:
    """Contact force over penetration of the snubbers: loops enclose the work that they lose.

    Only samples in contact are joined, so that stops without losses follow one line. With the unit N m it is the moment
    of the stops of hinges.
    """
    histories, loops = result["histories"], list[Curve]()
    for name, force in histories.by_label("snubber_force").items():
        if force.unit == unit:
            of_snubber = (histories[f"snubber_{of}"].sel(snubber=name) for of in ("penetration", "closed"))
            penetration, closed = (each.values[-MOST_STATES:] for each in of_snubber)
            in_contact = np.where(closed, force.values[-MOST_STATES:], np.nan)
            loops.append(Curve(name, penetration, in_contact, {"linewidth": 0.8}))
    x, words = (("Penetration", "m"), "Contact force") if unit == "N" else (("Angle beyond the stop", "rad"), _MOMENT)
    return Chart(x, (words, unit), loops, curve_noun="snubbers")


def shock_response(srs: Dataset, note: str) -> Chart:
    """Maximax spectra of inputs and probes; thin, the residual of a single input: what it leaves after its end."""
    f, names = srs["frequency_hz"].values, srs["name"].values.tolist()[:MOST_CURVES]
    maximax = srs["maximax"].values[: len(names)]
    curves = [Curve(name, f, x) for name, x in zip(names, maximax, strict=True)]
    curves += [
        Curve("input, residual", f, srs["residual"].values[k], {**curve_style(k), "linewidth": 0.55})
        for k, name in enumerate(names)
        if name == INPUT
    ]
    x_axis, y_axis = "Natural frequency of the oscillator", f"Peak acceleration, Q = {srs['quality'].item():g}"
    ends, low = (float(f[0]), float(f[-1])), 0.1 * float(maximax.min())
    limits = dict(zip(names, srs["limit"].values[: len(names)], strict=True)) if "limit" in srs else {}
    chart = Chart((x_axis, "Hz"), (y_axis, "m/s^2"), curves, log="xy", curve_noun="", x_ends=ends, note=note)
    squeezes = low > 0.0 and any(curve.y.min() < low for curve in curves)  # a residual that is nothing
    return chart._replace(marks=limit_curves(limits, f), y_ends=(low if squeezes else None, None))


def matched_spectra(matched: Dataset) -> list[Chart]:
    """The shock response spectrum of each matched record over the requested spectrum."""
    motions = matched.labels("base_motion")
    each = [matched_spectrum(matched.isel(base_motion=slice(k, k + 1))) for k in range(len(motions))]
    if len(motions) == 1:
        return each
    return [chart._replace(title=f"{name}: {chart.title}") for name, chart in zip(motions, each, strict=True)]


def matched_spectrum(matched: Dataset) -> Chart:
    """The shock response spectrum of a single matched record over the requested spectrum."""
    misfit, pale = misfit_of_matched(matched), {"color": PALE, "linewidth": 4.0, "linestyle": "-", "zorder": 1}
    frequency = matched["frequency_hz"].values
    known = np.isfinite(matched["target"].values[0])
    curves = [Curve("record", frequency[known], matched["reached"].values[0][known])]
    curve = Curve("curve asked for", frequency[known], matched["target"].values[0][known], pale)
    title = f"Record {misfit['lowest_db']:+.1f} to {misfit['highest_db']:+.1f} dB from the curve"
    y_axis = (f"Peak acceleration, Q = {misfit['quality']:g}", "m/s^2")
    x_axis = ("Natural frequency of the oscillator", "Hz")
    return Chart(x_axis, y_axis, curves, log="xy", curve_noun="", marks=[curve], title=title)


def friction_loops(result: RunResult, displacements: Mapping[str, LabelledArray]) -> list[Chart]:
    """Friction forces over displacements along the faces, and moments over angles: loops enclose the work lost.

    Parameters
    ----------
    result : of the run.
    displacements : displacements by friction contact.
    """
    forces, charts = result["histories"].by_label("friction_force"), []
    for unit, motion, label in _FRICTION:
        loops = [
            Curve(name, x.values[-MOST_STATES:], forces[name].values[-MOST_STATES:], {"linewidth": 0.8})
            for name, x in displacements.items()
            if x.unit == unit
        ]
        if loops:
            charts.append(Chart((motion, unit), (label, FORCE_UNITS[unit]), loops, curve_noun="friction contacts"))
    return charts


def spring_forces(result: RunResult, forces: Mapping[str, LabelledArray]) -> Chart:
    """Forces of springs, by name, over their extension; relaxing springs draw loops."""
    extension = result["histories"].by_label("spring_extension")
    last = slice(-MOST_STATES, None)
    curves = [Curve(name, extension[name].values[last], force.values[last]) for name, force in forces.items()]
    return Chart(("Extension", "m"), ("Spring force", "N"), curves, curve_noun="springs")


def _histories_of_all(result: RunResult) -> dict[str, list[Chart]]:
    """Histories of probes, snubbers and outputs, by picture."""
    limits, low_pass_hz = result.scenario.limits, not_none(result.scenario.run).low_pass
    words = "Absolute acceleration" if low_pass_hz is None else f"Acceleration below {low_pass_hz:g} Hz"
    kind = "absolute_acceleration" if low_pass_hz is None else "low_passed_acceleration"
    levels = [*limit_levels(limits, "peak_displacement", both_signs=True), *_faces(result)]
    values = {name: history.values for name, history in result["histories"].by_label("displacement").items()}
    note = _convergence_note(result, "peak_displacement_m")
    panels = {"displacement": histories(result, ("Relative displacement", "m"), values, levels, note)}
    levels = limit_levels(limits, "peak_acceleration", both_signs=True)
    values = {name: history.values for name, history in result["histories"].by_label(kind).items()}
    panels["acceleration"] = histories(
        result, (words, "m/s^2"), values, levels, _convergence_note(result, "peak_acceleration_g")
    )
    moved = result["histories"].by_label("base_acceleration") if result.scenario.excitation.shock else {}
    base = {name: of.values for name, of in moved.items() if of.unit == "m/s^2" and np.any(of.values)}
    if base:
        shown = {"" if len(base) == 1 else name: accelerations for name, accelerations in base.items()}
        panels["acceleration"] += histories(result, ("Acceleration of the base", "m/s^2"), shown)
    holds_what_it_met = any(each.item.latch for each in result.scenario.located_snubbers)
    forces = result["histories"].by_label("snubber_force")
    for picture, label, unit, limit, entry in _CONTACT:  # of many those with the largest peaks, in their order
        of_unit = {name: force.values for name, force in forces.items() if force.unit == unit}
        peaks = {name: float(np.max(np.abs(x), initial=0.0)) for name, x in of_unit.items()}
        strongest = sorted(peaks, key=lambda name: -peaks[name])[:MOST_CURVES]
        if any(peaks.values()):
            values = {name: of_unit[name] for name in sorted(peaks, key=lambda name: name not in strongest)}
            levels, note = limit_levels(limits, limit, both_signs=holds_what_it_met), _convergence_note(result, entry)
            panels[picture] = histories(result, (label, unit), values, levels, note, noun="snubbers")
    if outputs := result["histories"].by_label("output_value"):
        panels["outputs"] = _histories_of_outputs(result, outputs)
    return panels


def _histories_of_outputs(result: RunResult, outputs: Mapping[str, LabelledArray]) -> list[Chart]:
    """The whole history of each output, with its limit."""
    charts = []
    for name, output in list(outputs.items())[:MOST_CURVES]:
        levels = limit_levels(result.scenario.limits, OUTPUT.limit, name, both_signs=True)
        charts += histories(result, (name, output.unit), {"": output.values}, levels)[:1]
    return charts


def _signals(response: Dataset) -> list[Dataset]:
    """The values of each signal, the inputs first."""
    return [response.sel(signal=signal) for signal in response.labels("signal")]


def _driven_by_base(response: Dataset) -> bool:
    """Whether an input is an acceleration of the base along an axis."""
    return any(signal["unit"].item() == "m/s^2" for signal in _inputs(response))


def _inputs(response: Dataset) -> list[Dataset]:
    """The values of each input."""
    return [signal for signal in _signals(response) if signal["section"].item() == "excitation"]


def density(response: Dataset, note: str = "") -> Chart:
    """Spectral densities of the inputs and of the absolute accelerations of the probes (displacements under a force).

    Thick grey lines are those of the linear structures with every snubber always open and always closed. The axis is
    the band of the input; the share of the power of a response that lies outside is in its label.
    """
    on_base = _driven_by_base(response)
    quantities = ("acceleration", "absolute_acceleration") if on_base else ("displacement",)
    drawn = [s for s in _signals(response) if s["quantity"].item() in quantities and s["section"].item() != "outputs"]
    powers = [s["density"].values[1:] for s in drawn]
    unit = scale_for("m/s^2" if on_base else "m", *map(np.sqrt, powers))
    squared = f"({unit.unit})²" if "/" in unit.unit else f"{unit.unit}²"
    f, top = response["frequency_hz"].values[1:], max((float(np.max(power)) for power in powers), default=0.0)
    band = _has_input_power(response)[1:]

    def name_of(signal: Dataset) -> str:
        power = signal["density"].values[1:]
        outside = float(power[~band].sum() / power.sum()) if power.any() and band.any() else 0.0
        over = "" if np.any(power > DENSITY_SHOWN * top) else " (over before)"
        return str(signal["name"].item()) + (over or f" ({100 * outside:.2g} % outside)" * (outside > POWER_NOTED))

    curves = [Curve(name_of(s), f, power) for s, power in zip(drawn, powers, strict=True)]
    linear = []
    for signal in [s for s in drawn[:MOST_CURVES] if "linear_open" in s and np.isfinite(s["linear_open"].item())][:1]:
        for name, dashes in (("open", "-"), ("closed", "-.")):
            value = signal[f"density_{name}"].values[1:]
            style = {"color": PALE, "linewidth": 2.2, "linestyle": dashes, "zorder": 1}
            words = f"{signal['name'].item()}, linear, always {name}"
            linear.append(Curve(words, f, np.where(value > 0.0, value, np.nan), style))
    y_axis = (f"{'Acceleration' if on_base else 'Displacement'} density", Scale(unit.factor**2, f"{squared}/Hz"))
    chart = Chart(
        _FREQUENCY,
        y_axis,
        curves,
        log="xy",
        curve_noun="signals",
        marks=[*linear, *limit_curves(_limits(drawn), f)],
        note=note,
    )
    if not top > 0:
        return chart
    shown = f[band] if band.any() else f[np.max(powers, axis=0) >= top * DENSITY_SHOWN]
    room = 300.0 if note else 3.0  # above the curves
    return chart._replace(x_ends=(float(shown[0]), float(shown[-1])), y_ends=(top * DENSITY_SHOWN, room * top))


def _limits(signals: Sequence[Dataset]) -> dict[str, Floats | None]:
    """By name of each signal its limit; None where it has none."""
    limits = {s["name"].item(): s["limit"].values if "limit" in s else None for s in signals}
    return {name: None if limit is None or np.isnan(limit).all() else limit for name, limit in limits.items()}


def force_densities(response: Dataset) -> list[Chart]:
    """Densities of the forces of snubbers and of the moments of stops of hinges, where one of them has a limit."""
    frequency, charts = response["frequency_hz"].values, []
    f, shown = frequency[1:], frequency[_has_input_power(response)]
    for unit, label, squared in (("N", "Force density", "N²/Hz"), ("N m", "Moment density", "N² m²/Hz")):
        responses = [s for s in _signals(response) if s["section"].item() != "excitation"]
        drawn = [s for s in responses if (s["quantity"].item(), s["unit"].item()) == ("force", unit)]
        limits = _limits(drawn)
        if shown.size and any(limit is not None for limit in limits.values()):
            curves, y_axis = (
                [Curve(s["name"].item(), f, s["density"].values[1:]) for s in drawn],
                (label, Scale(1.0, squared)),
            )
            ends, marks = (float(shown[0]), float(shown[-1])), limit_curves(limits, f)
            charts.append(Chart(_FREQUENCY, y_axis, curves, log="xy", curve_noun="stops", marks=marks, x_ends=ends))
    return charts


def has_transmissibility(response: Dataset) -> bool:
    """Whether the input has power: a shock may be over before the part of the run that the densities are of."""
    return bool(response.labels("probe")) and bool(np.any(_has_input_power(response)))


def _has_input_power(response: Dataset) -> Bools:
    """(nf,) where an input has power that is neither round-off nor leakage, as from the mean into the first line."""
    powers = np.array([signal["density"].values for signal in _inputs(response)])
    driven = powers > np.maximum(POWER_SHOWN * powers.max(axis=1, keepdims=True), ROUND_OFF**2)
    return np.asarray(driven.any(axis=0) & (np.arange(powers.shape[1]) > 1))


def transmissibility(response: Dataset) -> Chart:
    """Magnitude of response over input, with gaps where the input has no power; lines are those of the densities."""
    driven, on_base = _has_input_power(response), _driven_by_base(response)
    parts = (response[f"transmissibility_{part}"].values for part in ("real", "imag"))
    sizes = zip(response.labels("probe"), np.hypot(*parts), strict=True)
    curves = [
        Curve(name, response["frequency_hz"].values, np.where(driven, size, np.nan), curve_style(k))
        for k, (name, size) in enumerate(sizes, int(on_base))  # 0 of the densities: input
    ]
    y_axis = ("Transmissibility", "") if on_base else ("Displacement / force", Scale(1.0, "m/N"))
    return Chart(_FREQUENCY, y_axis, curves, log="xy", curve_noun="probes")


def random_picture(result: RunResult, response: Dataset) -> Picture:
    """Spectral densities and transmissibilities of the response to a random input."""
    more = [transmissibility(response)] if has_transmissibility(response) else []
    of_input = density(response, _convergence_note(result, "random", "values"))
    return Picture(result.title, [of_input, *more, *force_densities(response)], sharex=True)


def crossings(response: Dataset) -> Chart:
    """Rates at which the signals cross levels upwards, over those of their means, and that of a Gaussian signal."""
    level = response["level"].values
    columns = ("section", "name", "quantity", "crossings_hz", "crossing_rate_hz")
    curves = [
        Curve(f"{name} {quantity.replace('_', ' ')}", level, crossed / rate)
        for section, name, quantity, crossed, rate in zip(*(response[of].values for of in columns), strict=True)
        if rate > 0 and section != "excitation"
    ]
    grey = {"color": "0.6", "linewidth": 2.2, "linestyle": "-", "zorder": 0}
    gaussian = Curve("Gaussian", level, np.exp(-0.5 * level**2), grey)
    least = min((float(np.min(c.y, where=c.y > 0, initial=1.0)) for c in curves[:MOST_CURVES]), default=1.0)
    x_axis, y_axis = ("Level above the mean (standard deviations)", ""), ("Upward crossings, those of the mean = 1", "")
    crossed = level[np.any([curve.y > 0.0 for curve in curves], axis=0)] if curves else level
    ends = min(float(crossed[0]), -4.0) - 0.5, max(float(crossed[-1]), 4.0) + 0.5
    return Chart(
        x_axis, y_axis, curves, log="y", curve_noun="signals", marks=[gaussian], x_ends=ends, y_ends=(0.5 * least, 3.0)
    )


def _strongest_impacts(result: RunResult, unit: str) -> dict[str, Dataset]:
    """Impacts by snubber (m) or stop of a hinge (rad): of those with the largest peaks, in their order."""
    peaks = result["impact_statistics"].by_label("peak_force_n")
    every = result["impacts"].groups("snubber", peaks)
    hit = [name for name, of in every.items() if of["impact"].values.size and peaks[name].unit == FORCE_UNITS[unit]]
    kept = sorted(hit, key=lambda name: -peaks[name].item())[:MOST_CURVES]
    return {name: every[name] for name in hit if name in kept}


def impact_map(impacts: Mapping[str, Dataset], impact_count: int, end: float, unit: str = "m") -> Chart:
    """Peak force of every impact over its time, each snubber with its mark; small marks where impacts are many.

    Parameters
    ----------
    impacts : by snubber.
    impact_count : number of all impacts of the run.
    end : of the run, s, with which the axis ends: a few impacts are seen where they are in it.
    unit : m of snubbers, rad of stops of hinges.
    """
    size = float(np.clip(120.0 / np.sqrt(max(impact_count, 1)), 1.5, 5.0))
    marks = {"linestyle": "none", "markersize": size, "markerfacecolor": "none", "rasterized": impact_count > 20_000}
    curves = [
        Curve(name, of["peak_time"].values, of["peak_force"].values, {**marks, "marker": _MARKS[k]})
        for k, (name, of) in enumerate(impacts.items())
    ]
    return Chart(("Time", plain_scale("s")), _PEAKS[unit], curves, x_ends=(-0.02 * end, 1.02 * end), y_ends=(0.0, None))


def plot_peak_forces(impacts: Mapping[str, Dataset], ax: Axes, unit: str = "m") -> None:
    """Histogram of the impacts' peak forces by snubber; with the unit rad of the moments of stops of hinges."""
    names, (label, force_unit) = list(impacts), _PEAKS[unit]
    peaks = [of["peak_force"].values for of in impacts.values()]
    newton = scale_for(force_unit, *peaks)
    forces = [peak * newton.factor for peak in peaks]
    top = max((float(x.max()) for x in forces), default=1.0)
    edges = np.linspace(0.0, top, 1 + int(np.clip(np.sqrt(sum(x.size for x in forces)), 5, 30)))
    for k, (name, x) in enumerate(zip(names, forces, strict=True)):
        ax.hist(x, edges.tolist(), label=name, histtype="stepfilled" if len(names) == 1 else "step", **curve_style(k))
    finish(ax, with_unit(label, newton), "Impacts")
    ax.yaxis.set_major_locator(MaxNLocator(integer=True))
    ax.set_xlim(left=0.0)
    legend(ax)


def cycles(cycles_by_name: Mapping[str, Dataset], label: str, unit: str, noun: str, title: str = "") -> Chart:
    """Number of counted cycles whose range is larger, over the range.

    Parameters
    ----------
    cycles_by_name : cycles by name.
    label, unit : of the axis of ranges.
    noun : what the cycles are counted of, for a legend that leaves some out.
    title : of the panel.

    Returns
    -------
    A curve for each name with cycles.
    """
    drawn = {name: rainflow for name, rainflow in cycles_by_name.items() if rainflow["range"].values.size}
    curves = []
    for name, rainflow in drawn.items():
        order = np.argsort(-rainflow["range"].values, kind="stable")
        ranges, number = rainflow["range"].values[order], np.cumsum(rainflow["count"].values[order])
        x, y = np.append(0.5 * number[:1], number), np.append(ranges, 0.0)
        curves.append(Curve(name, x, y, {"drawstyle": "steps-post"}))
    y_axis = (label, unit if drawn else "")
    return Chart(
        ("Cycles with a larger range", ""), y_axis, curves, log="x", curve_noun=noun, y_ends=(0.0, None), title=title
    )


def damage_text(result: RunResult, body: Mapping[str, Any], *, short: bool = False) -> str:
    """The damage of a body in the run and in the test, each with its interval, the life, and where that is.

    Parameters
    ----------
    result : of the run.
    body : its entry ``fatigue`` of the summary.
    short : whether intervals and life are left out.

    Returns
    -------
    For people: 1.9e-09 (8.9e-10 to 4.1e-09, 95 %) in 2 s, 1.1e-07 (...) in 2 min of test, life 33.1 years, at x = 0 m.
    """
    run, done, low = not_none(result.scenario.run), body["damage"], body.get("damage_low")
    duration = float(result["histories"]["time"].values[-1]) if result.outcome.ended_early else run.duration

    def over(times_as_much: float) -> str:
        text = f"{done * times_as_much:.2g}"
        ends = (
            "" if short or low is None else " to ".join(f"{x * times_as_much:.2g}" for x in (low, body["damage_high"]))
        )
        return f"{text} ({ends}, 95 %)" if ends else text

    texts = [f"{over(1.0)} in {amount(duration, 's')}"]
    if (tested := run.test_duration) is not None:
        texts.append(f"{over(tested / duration)} in {amount(tested, 's')} of test")
    life = f", life {amount(body['life_s'], 's', 3)}" if done > 0.0 and not short else ""
    return f"{', '.join(texts)}{life}, at {damage_place(body)}"


def damage_place(body: Mapping[str, Any]) -> str:
    """Where on a body the damage is largest, and of a plate by which stress.

    Parameters
    ----------
    body : its entry ``fatigue`` of the summary.

    Returns
    -------
    For people: x = 250 mm, or (135 mm, 60 mm), sigma_x.
    """
    x = amount(body["position"], "m") if body["position"] else "0"
    if "position_y" not in body:
        return f"x = {x}"
    stress = "tau_xy" if body["component"] == "xy" else f"sigma_{body['component']}"
    return f"({x}, {amount(body['position_y'], 'm')}), {stress}"


def impact_figures(result: RunResult) -> dict[str, Picture]:
    """Those of impacts, if there are any."""
    many, end = result["impacts"]["impact"].values.size, float(result["histories"]["time"].values[-1])
    maps: list[Chart] = []
    histograms: list[Any] = []
    for unit, label in (("m", "Force range"), ("rad", "Moment range")):
        if impacts := _strongest_impacts(result, unit):
            every = result["impact_statistics"].groups("cycle_snubber")
            maps.append(impact_map(impacts, many, end, unit))
            ranges = cycles({name: every[name] for name in impacts}, label, FORCE_UNITS[unit], "snubbers")
            histograms += [partial(plot_peak_forces, impacts, unit=unit), ranges]
    return (
        {"impact_map": Picture(result.title, maps), "impact_histogram": Picture(result.title, histograms)}
        if many
        else {}
    )


def stress_cycles(result: RunResult) -> Picture:
    """The stress ranges of each body where its damage is largest."""
    damage = [f"{name}: damage {damage_text(result, of, short=True)}" for name, of in result.summary["fatigue"].items()]
    counted, title = result["fatigue"].groups("cycle_body"), "\n".join(damage[:MOST_CURVES])
    return Picture(result.title, [cycles(counted, "Stress range", "Pa", "bodies", title)])


SHOWN = ("peak_force", "peak_moment", "peak_displacement", "contact_share")  # values with a tornado
MOST_TORNADOS = 4  # in one picture; more cannot be read


def plot_tornado(result: RunResult, ax: Axes, response: str) -> None:
    """How a value changes with the tolerance of each number, by its derivative: the number that matters most first.

    Parameters
    ----------
    result : with sensitivities.
    ax : to draw on.
    response : the value, as studies name it.
    """
    every = (row for row in result["sensitivities"].rows("row") if row["response"] == response)
    largest_first = sorted(every, key=lambda row: -max(abs(row["change"]), abs(row["change_below"])))
    value, rows = largest_first[0]["value"], np.arange(len(largest_first))
    changes = [[row[name] for row in largest_first] for name in ("change", "change_below")]
    scale = scale_for(largest_first[0]["value_unit"], [value, *changes[0], *changes[1]])
    ax.use_sticky_edges = False  # where both ends lie on one side of the value, its line is within the picture
    for change, label, colour in zip(changes, ("number + tolerance", "number - tolerance"), (DARK, PALE), strict=True):
        bars = ax.barh(rows, np.multiply(change, scale.factor), 0.6, value * scale.factor, label=label, color=colour)
        for bar, *both in zip(bars, change, *changes, strict=True):
            bar.set_zorder(2.0 if abs(both[0]) < np.abs(both).max() else 1.5)  # the shorter one is in front
    ax.axvline(value * scale.factor, color="black", linewidth=0.9)
    labels = [f"{row['path']} ± {amount(row['tolerance'], row['number_unit'], 3)}" for row in largest_first]
    ax.set_yticks(rows, labels, fontsize="x-small")
    ax.invert_yaxis()
    _, *place, quantity = ("", *response.split("/"))[-3:]
    finish(ax, with_unit(", ".join([quantity.replace("_", " ").capitalize(), *place]), scale), "")
    legend(ax)


def _tornados(result: RunResult, responses: Iterable[str]) -> list[Callable[[Axes], None]]:
    """Charts of the sensitivities of the values that matter most."""
    names = [name for q in SHOWN for name in responses if name.rpartition("/")[2] == q][:MOST_TORNADOS]
    return [partial(plot_tornado, result, response=name) for name in names]


def _random_figures(result: RunResult) -> dict[str, Picture]:
    """Those of the response to a random input."""
    random = result["random"]
    crossed = Picture(result.title, [crossings(random)])
    return {"level_crossings": crossed, "random": random_picture(result, random)}


def _shock_figures(result: RunResult) -> dict[str, Picture]:
    """That of shock response spectra."""
    return {"srs": Picture(result.title, [shock_response(result["srs"], _convergence_note(result, "srs", "spectra"))])}


def _matched_figures(result: RunResult) -> dict[str, Picture]:
    """The picture of records matched to spectra, if there are any."""
    return {"matched_spectrum": Picture(result.title, matched_spectra(result["matched"]))}


def ring_orbit(rings: Dataset, name: str) -> Chart:
    """Motion in the plane of a ring, relative to its centre, with the clearance.

    Parameters
    ----------
    rings : of the run.
    name : of the ring.
    """
    of = rings.sel(ring=name)
    x, y = (of[f"{each}_position"].values[-MOST_STATES:] for each in ("first", "second"))
    touching, turn = of["force"].values[-MOST_STATES:] > 0.0, np.linspace(0.0, 2.0 * np.pi, 181)
    wall = of["first_gap"].item() * np.cos(turn), of["second_gap"].item() * np.sin(turn)
    curves = [
        Curve("clearance", *wall, {"color": "black", "linewidth": 0.9, "linestyle": "--"}),
        Curve("free", x, np.where(touching, np.nan, y), {"color": _FREE, "linewidth": 0.8, "linestyle": "-"}),
        Curve("in contact", x, np.where(with_neighbours(touching), y, np.nan),
              {"color": _CLOSED, "linewidth": 1.6, "linestyle": "-"}),
    ]  # fmt: skip
    scale = scale_for("m", x, y, *wall)
    axes = [(f"{name}: {of[f'{each}_direction'].item()}", scale) for each in ("first", "second")]
    return Chart(axes[0], axes[1], curves, draw_extra=lambda ax, *_: ax.set_aspect("equal", adjustable="datalim"))


def _ring_figures(result: RunResult) -> dict[str, Picture]:
    """Orbits in the planes of the rings, and their forces."""
    rings = result["rings"]
    names = rings.labels("ring")[:MOST_CURVES]
    orbits = [ring_orbit(rings, name) for name in names]
    forces = {name: force.values for name, force in rings.by_label("force").items()}
    levels = limit_levels(result.scenario.limits, "peak_ring_force")
    charts = histories(result, ("Force of rings", "N"), forces, levels, noun="rings")
    return {
        "ring_orbit": Picture(result.title, orbits, columns=min(len(orbits), 3)),
        "ring_force": Picture(result.title, charts),
    }


FIGURES_OF_DATASETS: dict[str, Callable[[RunResult], dict[str, Picture]]] = {  # of what not every run has
    "random": _random_figures,
    "srs": _shock_figures,
    "matched": _matched_figures,
    "rings": _ring_figures,
    "impacts": impact_figures,
    "fatigue": lambda result: {"stress_cycles": stress_cycles(result)},
}


def run_figures(result: RunResult) -> dict[str, Picture]:
    """All pictures of this result; the key is the last part of the file name."""
    random, of_run = result.datasets.get("random"), result["histories"]
    panels = _histories_of_all(result)
    forces = of_run.by_label("snubber_force").values()
    if units := dict.fromkeys(force.unit for force in forces if np.any(force.values)):
        panels["force_deflection"] = [force_deflection(result, unit) for unit in units]
    if moved := of_run.by_label("friction_displacement"):
        panels["friction"] = friction_loops(result, moved)
    if springs := of_run.by_label("spring_force"):
        panels["spring_force"] = [spring_forces(result, springs)]
    if (spectra := result.datasets.get("spectra")) is not None:
        panels["spectrum"] = [spectrum(result, of) for of in dict.fromkeys(spectra["quantity"].values.tolist())]
    figures = {name: Picture(result.title, charts) for name, charts in panels.items() if charts}
    if (derivatives := result.summary.get("sensitivities")) and (tornados := _tornados(result, derivatives)):
        figures["sensitivities"] = Picture(result.title, tornados)
    places = [("snubber", name) for name in of_run.labels("snubber")[:MOST_CURVES]]
    places = places or [("probe", name) for name in of_run.labels("probe")[:1]]
    portraits = [
        phase_portrait(result, *at) if random is None else phase_density(result, *at, random["start_s"].item())
        for at in places
    ]
    if portraits:
        figures["phase_portrait"] = Picture(result.title, portraits, columns=min(len(places), 3))
    for name, of_dataset in FIGURES_OF_DATASETS.items():
        figures |= of_dataset(result) if name in result.datasets else {}
    return figures | body_figures(result)
