"""Plots of a run: the pictures of a result, each of charts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np

from beamsim.analyses.run.records import Window
from beamsim.analyses.run.result import ALLOWED_CHANGE, ProbeHistory, RunResult, ShockResponse, SnubberHistory, Spectrum
from beamsim.plots.bodies import body_figures
from beamsim.plots.drawing import (
    DARK,
    HERTZ,
    MOST_CURVES,
    Axis,
    Chart,
    Curve,
    Guide,
    Picture,
    beside,
    curve_style,
    limit_levels,
    marked,
)
from beamsim.plots.impacts import impact_figures
from beamsim.plots.random_response import crossings, density, has_transmissibility, transmissibility
from beamsim.plots.style import plain_scale, scale_for
from beamsim.scenario.reporting import OF_OUTPUTS
from beamsim.structures.assembly import site_in, snubber_site
from beamsim.typing import Floats

MOST_STATES = 2**18  # samples in a phase portrait
MOST_BANDS = 400  # of the spectrum of a random motion
SPECTRUM_DB = 60.0  # below the highest point of a spectrum, down to which its frequencies are shown
DOUBTFUL_LINES = f"lines that change by more than {100 * ALLOWED_CHANGE:g} % with a finer model"
DECAYING_LINES = "lines, weighted to the beginning"
_LINE_MARKS = {"fundamental": "o", "superharmonic": "o", "subharmonic": "^", "other": "x", "chosen": "D"}
_FREE, _CLOSED = "0.62", "#a3263d"  # apart in grey print, too


def histories(
    result: RunResult, up: Axis, values: Mapping[str, Floats], levels: Iterable[Guide] = (), note: str = "",
    of: str = "probes",
) -> list[Chart]:  # fmt: skip
    """Time histories: the whole, and its last periods, unless that is the whole or a shock is over then.

    Parameters
    ----------
    result : of the run.
    up : words and unit of the values.
    values : (nt,) at the output times, by name; the first are drawn.
    levels : to compare with.
    note : on the whole.
    of : what the values are of.

    Returns
    -------
    One panel, or two.
    """
    time, start = result.time, _last_part(result)
    begin, end = float(time[0]), float(time[-1])
    curves = [Curve(name, time, x) for name, x in values.items()]
    ends = begin, end if end > begin else begin + 1.0
    whole = Chart(("Time", plain_scale("s")), up, curves, list(levels), of=of, x_ends=ends, note=note)
    if result.scenario.excitation.shock or start <= begin:
        return [whole]
    first = int(np.searchsorted(time, start))
    last = [Curve(name, time[first:], x[first:]) for name, x in values.items()]
    return [whole, whole._replace(curves=last, x_ends=(start, end), note="")]


def _faces(result: RunResult) -> Iterator[Guide]:
    """Where each stop on the base that is at the place of a drawn probe touches the body."""
    scenario = result.scenario
    places = [site_in(scenario, probe) for probe in scenario.effective_probes[:MOST_CURVES]]
    for located in scenario.located_snubbers:
        stop = result.snubbers.get(located.item.name)
        if stop is None or snubber_site(located) not in places or located.item.mounted_on != "base":
            continue
        side = "below" if stop.side == "below" else "above"
        if np.isfinite(stop.gap):
            face = (-1.0 if side == "below" else 1.0) * stop.gap
            dashes = (0, (7, 2.5)) if side == "below" else (0, (7, 2.5, 1.5, 2.5))
            yield Guide(f"face of {stop.name}", face, {"linewidth": 0.9, "linestyle": dashes})


def _contact_forces(result: RunResult) -> dict[str, Floats]:
    """Contact forces by snubber; of many those with the largest peaks come first."""
    peaks = {name: float(np.max(snubber.force, initial=0.0)) for name, snubber in result.snubbers.items()}
    strongest = sorted(peaks, key=lambda name: -peaks[name])[:MOST_CURVES]
    return {name: result.snubbers[name].force for name in sorted(peaks, key=lambda name: name not in strongest)}


def _doubts(result: RunResult, figure: str, called: str = "peaks", of: str = "") -> str:
    """Which values have not converged, as a note: all, or those whose name ends with ``of``."""
    changes = result.summary.get("convergence", {}).get(figure, {})
    listed = result.summary.get("doubtful", ())
    doubtful = [name for name in changes if f"{figure}.{name}" in listed and name.endswith(of)]
    texts = [
        f"{name.removesuffix(of).replace('_', ' ').strip()} {100 * changes[name]:.2g}\N{NO-BREAK SPACE}%"
        for name in doubtful[:4]
    ]
    said = f"{called} not converged; change with a finer model: {', '.join(texts)}{', …' * (len(doubtful) > 4)}"
    return said if doubtful else ""


def spectrum(result: RunResult, quantity: str = "absolute_acceleration") -> Chart:
    """Levels over frequency divided by excitation frequency (or in Hz without one), with spectral lines marked.

    Neighbouring lines of a random motion differ by tens of dB and would cover a plot: of those the root mean square in
    bands is shown.
    """
    shown = [s for s in result.spectra.values() if s.quantity == quantity]
    if not shown:
        return Chart(("Frequency", HERTZ), (quantity, ""), [])
    unit, end = _unit_of(shown), _end_of_spectra(shown)
    curves = [Curve(s.probe, s.frequency_hz / unit, s.amplitude_db) for s in shown]
    across: Axis = ("Frequency", HERTZ) if unit == 1.0 else ("Frequency / excitation frequency", "")
    if result.scenario.excitation.kind == "random":  # a record may hold tones, which are lines
        count = max(int(np.searchsorted(curves[0].x, end)) // MOST_BANDS, 1)
        across = (f"Frequency in bands of {count * float(np.diff(curves[0].x[:2])[0]):.2g} Hz", HERTZ)
        curves = [Curve(s.probe, *s.in_bands(count)) for s in shown]
    top = max(float(np.max(s.amplitude_db)) for s in shown)
    return Chart(
        across, (f"{quantity.replace('_', ' ').capitalize()} (dB re peak)", ""), curves, of="probes",
        marks=list(_marked_lines(shown[0], unit, end)), x_ends=(0.0, end), y_ends=(top - 100.0, top + 6.0),
        note=_doubts(result, "spectral_lines", "lines", f" {quantity}"),
    )  # fmt: skip


def _unit_of(shown: Sequence[Spectrum]) -> float:
    """Excitation frequency of spectra, Hz; 1 where there is none."""
    return shown[0].excitation_hz if shown and np.isfinite(shown[0].excitation_hz) else 1.0


def _marked_lines(s: Spectrum, unit: float, end: float) -> Iterator[Curve]:
    """The lines of a spectrum by their kind, and those that are doubtful."""
    falls = Window.named(s.window).one_sided
    doubtful = [
        line for line in s.lines if line.frequency_hz <= end * unit and (line.relative_change or 0.0) > ALLOWED_CHANGE
    ]
    for kind, mark in (*_LINE_MARKS.items(), ("doubtful", "s")):
        lines = doubtful if kind == "doubtful" else [line for line in s.lines if line.kind == kind]
        label, style = DECAYING_LINES if kind == "other" and falls else "", {"color": DARK, "markerfacecolor": "white"}
        if kind == "doubtful":
            label, style = DOUBTFUL_LINES, {"color": _CLOSED, "markerfacecolor": "none"}
        if lines:
            places = [(line.frequency_hz / unit, line.amplitude_db) for line in lines]
            yield marked(label, places, marker=mark, markersize=8 if kind == "doubtful" else 4, **style)


def _end_of_spectra(shown: Sequence[Spectrum]) -> float:
    """End of the frequencies at which there is something to see, over the excitation frequency where there is one."""
    unit = _unit_of(shown)
    top = max(float(np.max(s.amplitude_db)) for s in shown)
    last = max(float(s.frequency_hz[s.amplitude_db > top - SPECTRUM_DB][-1]) for s in shown) / unit
    if np.isfinite(shown[0].excitation_hz):
        last = float(np.clip(last, 4.0, 12.0))
    chosen = [line.frequency_hz / unit for s in shown for line in s.lines if line.kind == "chosen"]
    return min(1.05 * max([last, *chosen]), float(shown[0].frequency_hz[-1]) / unit) or 1.0


def phase_portrait(result: RunResult, place: SnubberHistory | ProbeHistory) -> Chart:
    """Velocity over displacement at a snubber or probe, contact emphasised.

    Of a long run the last part is drawn. The part before the window of the spectrum is drawn in light grey.
    """
    shown = _end_of_run(result)
    time, w, v = result.time[shown], place.displacement[shown], place.velocity[shown]
    closed = place.closed[shown] if isinstance(place, SnubberHistory) else np.zeros(time.size, dtype=bool)
    early = time < min((s.start_s for s in result.spectra.values()), default=0.0)
    parts = (
        (early, "", {"color": "0.85", "linewidth": 0.5, "zorder": 1}),
        (~early & ~closed, "free", {"color": _FREE, "linewidth": 0.9, "zorder": 2}),
        (beside(closed) & ~early, "in contact", {"color": _CLOSED, "linewidth": 1.8, "zorder": 3}),
    )
    curves = [
        Curve(label, w, np.where(kept, v, np.nan), {"linestyle": "-", **style})
        for kept, label, style in parts
        if kept.any()
    ]
    across = f"At {place.name}\nDisplacement"
    return Chart((across, scale_for("m", w)), ("Velocity", scale_for("m/s", v)), curves)


def _end_of_run(result: RunResult) -> slice:
    """The part of a long run that is drawn."""
    return slice(max(result.time.size - MOST_STATES, 0), None)


def force_deflection(result: RunResult) -> Chart:
    """Contact force over penetration of the snubbers: loops enclose the work that they lose.

    Only samples in contact are joined, so that stops without losses follow one line.
    """
    shown = _end_of_run(result)
    loops = [
        Curve(name, s.penetration[shown], np.where(s.closed[shown], s.force[shown], np.nan), {"linewidth": 0.8})
        for name, s in result.snubbers.items()
    ]
    title = "" if any(np.isfinite(loop.y).any() for loop in loops) else "no contact"
    return Chart(("Penetration", "m"), ("Contact force", "N"), loops, of="snubbers", title=title)


def shock_response(response: ShockResponse, note: str) -> Chart:
    """Maximax spectra of the input and of the probes; thin, the residual of the input: what it leaves after its end."""
    f, drawn = response.frequency_hz, response.signals[:MOST_CURVES]
    curves = [Curve(signal.name, f, signal.maximax) for signal in drawn]
    curves += [
        Curve("input, residual", f, signal.residual, {**curve_style(k), "linewidth": 0.55})
        for k, signal in enumerate(drawn)
        if signal.name == "input"
    ]
    across, up = "Natural frequency of the oscillator", f"Peak acceleration, Q = {response.quality:g}"
    ends = float(f[0]), float(f[-1])
    return Chart((across, "Hz"), (up, "m/s^2"), curves, log="xy", of="", x_ends=ends, note=note)


def _histories_of_all(result: RunResult) -> dict[str, list[Chart]]:
    """Histories of probes, snubbers and outputs, by picture."""
    limits, filtered = result.scenario.limits, result.low_pass_hz is not None
    words = f"Acceleration below {result.low_pass_hz:g} Hz" if filtered else "Absolute acceleration"
    kind = "low_passed_acceleration" if filtered else "absolute_acceleration"
    levels = [*limit_levels(limits, "peak_displacement", both_signs=True), *_faces(result)]
    values = {name: probe.displacement for name, probe in result.probes.items()}
    note = _doubts(result, "peak_displacement_m")
    panels = {"displacement": histories(result, ("Relative displacement", "m"), values, levels, note)}
    levels = limit_levels(limits, "peak_acceleration", both_signs=True)
    values = {name: getattr(probe, kind) for name, probe in result.probes.items()}
    panels["acceleration"] = histories(result, (words, "m/s^2"), values, levels, _doubts(result, "peak_acceleration_g"))
    if result.scenario.excitation.shock and result.base_unit == "m" and np.any(result.base_acceleration):
        up = ("Acceleration of the base", "m/s^2")
        panels["acceleration"] += histories(result, up, {"": result.base_acceleration})
    if result.snubbers:
        up, levels, note = ("Contact force", "N"), limit_levels(limits, "peak_force"), _doubts(result, "peak_force_n")
        panels["contact_force"] = histories(result, up, _contact_forces(result), levels, note, of="snubbers")
    for name, output in list(result.outputs.items())[:MOST_CURVES]:
        levels = limit_levels(limits, OF_OUTPUTS + name, both_signs=True)
        whole, *_ = histories(result, (name, output.unit), {"": output.value}, levels)
        panels.setdefault("outputs", []).append(whole)
    return panels


def run_figures(result: RunResult) -> dict[str, Picture]:
    """All pictures of this result; the key is the last part of the file name."""
    random, srs, shown = result.random, result.srs, _end_of_run(result)
    panels = _histories_of_all(result)
    if result.snubbers:
        panels["force_deflection"] = [force_deflection(result)]
    if result.friction:  # loops enclose the work that is lost
        thin = {"linewidth": 0.8}
        loops = [Curve(name, of.displacement[shown], of.force[shown], thin) for name, of in result.friction.items()]
        across, up = ("Displacement along the face", "m"), ("Friction force", "N")
        panels["friction"] = [Chart(across, up, loops, of="friction contacts")]
    if result.springs:  # those that relax draw loops
        curves = [Curve(name, spring.stretch[shown], spring.force[shown]) for name, spring in result.springs.items()]
        panels["spring_force"] = [Chart(("Stretch", "m"), ("Spring force", "N"), curves, of="springs")]
    if result.spectra:
        panels["spectrum"] = [spectrum(result, quantity) for quantity in ("absolute_acceleration", "displacement")]
    if random is not None and random.level is not None:
        panels["level_crossings"] = [crossings(random)]
    if srs is not None:
        panels["srs"] = [shock_response(srs, _doubts(result, "srs", "spectra"))]
    figures = {name: Picture(result.title, charts) for name, charts in panels.items()}
    places = list(result.snubbers.values())[:MOST_CURVES] or list(result.probes.values())[:1]
    portraits = [phase_portrait(result, place) for place in places]
    figures["phase_portrait"] = Picture(result.title, portraits, columns=min(len(places), 3))
    if random is not None:
        more = [transmissibility(random)] if has_transmissibility(random) else []
        note = _doubts(result, "random", "values")
        figures["random"] = Picture(result.title, [density(random, note), *more], sharex=True)
    return figures | impact_figures(result) | body_figures(result)


def _last_part(result: RunResult) -> float:
    """Start of a close-up: a few excitation periods before the end."""
    begin, end = float(result.time[0]), float(result.time[-1])
    excitation = next((s.excitation_hz for s in result.spectra.values()), float("nan"))
    # six periods, or an eighth of a run without excitation frequency
    length = 6 / excitation if np.isfinite(excitation) else 0.125 * (end - begin)
    return max(begin, end - length)
