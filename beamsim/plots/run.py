"""Plots of a run. Every function draws on the given Axes and returns them."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

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
    beside,
    curve_style,
    draw_curves,
    legend,
    limit_levels,
    picture,
)
from beamsim.plots.impacts import impact_figures
from beamsim.plots.random_response import has_transmissibility, plot_crossings, plot_density, plot_transmissibility
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


def displacements(result: RunResult) -> Chart:
    """Displacements of the probes relative to the base, with limits and the faces of stops."""
    levels = limit_levels(result.scenario.limits, "peak_displacement", both_signs=True)
    levels += _faces(result)
    values = {name: probe.displacement for name, probe in result.probes.items()}
    return _histories(result, "Relative displacement", "m", values, levels)


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


def accelerations(result: RunResult) -> Chart:
    """Absolute accelerations of the probes, behind the filter where there is one."""
    words = "Absolute acceleration" if result.low_pass_hz is None else f"Acceleration below {result.low_pass_hz:g} Hz"
    kind = "absolute" if result.low_pass_hz is None else "low_passed"
    levels = limit_levels(result.scenario.limits, "peak_acceleration", both_signs=True)
    values = {name: getattr(probe, f"{kind}_acceleration") for name, probe in result.probes.items()}
    return _histories(result, words, "m/s^2", values, levels)


def contact_forces(result: RunResult) -> Chart:
    """Contact forces; of many snubbers those with the largest peaks come first."""
    peaks = {name: float(np.max(snubber.force, initial=0.0)) for name, snubber in result.snubbers.items()}
    strongest = sorted(peaks, key=lambda name: -peaks[name])[:MOST_CURVES]
    values = {name: s.force for name, s in result.snubbers.items() if name in strongest}
    values |= {name: s.force for name, s in result.snubbers.items()}
    levels = limit_levels(result.scenario.limits, "peak_force")
    return _histories(result, "Contact force", "N", values, levels, of="snubbers")


def _histories(
    result: RunResult,
    words: str,
    unit: str,
    values: dict[str, Floats],
    levels: Iterable[Guide] = (),
    of: str = "probes",
) -> Chart:
    curves = [Curve(name, result.time, x) for name, x in values.items()]
    return Chart(("Time", plain_scale("s")), (words, unit), curves, list(levels), of=of)


def plot_history(result: RunResult, ax: Axes, chart: Chart, figure: str = "", *, last_part: bool = False) -> Axes:
    """Time histories, whole, or of a few last periods.

    Parameters
    ----------
    result : of the run.
    ax : to draw on.
    chart : curves over its time.
    figure : entry of the summary that says which peaks are doubtful, written above the whole.
    last_part : whether to draw the last periods alone.

    Returns
    -------
    The axes.
    """
    begin, end = (_last_part(result) if last_part else float(result.time[0])), float(result.time[-1])
    first = int(np.searchsorted(result.time, begin))
    shown = [Curve(c.label, c.x[first:], c.y[first:], c.style) for c in chart.curves]
    clock, _ = draw_curves(ax, *chart._replace(curves=shown))
    ax.set_xlim(begin * clock.factor, (end if end > begin else begin + 1.0) * clock.factor)
    return ax if last_part else _doubts(result, ax, figure)


def plot_displacement(result: RunResult, ax: Axes, *, last_part: bool = False) -> Axes:
    """Time history of the probe displacements relative to the base.

    Parameters
    ----------
    result : of the run.
    ax : to draw on.
    last_part : whether to draw the last periods alone.

    Returns
    -------
    The axes.
    """
    return plot_history(result, ax, displacements(result), "peak_displacement_m", last_part=last_part)


def plot_absolute_acceleration(result: RunResult, ax: Axes, *, last_part: bool = False) -> Axes:
    """Time history of the absolute accelerations of the probes, in g; behind the filter where there is one.

    Parameters
    ----------
    result : of the run.
    ax : to draw on.
    last_part : whether to draw the last periods alone.

    Returns
    -------
    The axes.
    """
    return plot_history(result, ax, accelerations(result), "peak_acceleration_g", last_part=last_part)


def plot_contact_force(result: RunResult, ax: Axes, *, last_part: bool = False) -> Axes:
    """Time history of the contact forces; if there are many snubbers, those with the largest peaks.

    Parameters
    ----------
    result : of the run.
    ax : to draw on.
    last_part : whether to draw the last periods alone.

    Returns
    -------
    The axes.
    """
    return plot_history(result, ax, contact_forces(result), "peak_force_n", last_part=last_part)


def plot_base_acceleration(result: RunResult, ax: Axes) -> Axes:
    """Time history of the acceleration of the base, the input."""
    chart = _histories(result, "Acceleration of the base", "m/s^2", {"": result.base_acceleration})
    return plot_history(result, ax, chart)


def plot_output(result: RunResult, ax: Axes, name: str) -> Axes:
    """Time history of an output.

    Parameters
    ----------
    result : of the run.
    ax : to draw on.
    name : of the output.

    Returns
    -------
    The axes.
    """
    output = result.outputs[name]
    levels = limit_levels(result.scenario.limits, OF_OUTPUTS + name, both_signs=True)
    return plot_history(result, ax, _histories(result, name, output.unit, {"": output.value}, levels))


def _doubts(result: RunResult, ax: Axes, figure: str, called: str = "peaks", of: str = "") -> Axes:
    """Say which values have not converged: all, or those whose name ends with ``of``."""
    changes = result.summary.get("convergence", {}).get(figure, {})
    listed = result.summary.get("doubtful", ())
    doubtful = [name for name in changes if f"{figure}.{name}" in listed and name.endswith(of)]
    if doubtful:
        texts = [
            f"{name.removesuffix(of).replace('_', ' ').strip()} {100 * changes[name]:.2g}\N{NO-BREAK SPACE}%"
            for name in doubtful[:4]
        ]
        said = f"{called} not converged; change with a finer model: {', '.join(texts)}{', …' * (len(doubtful) > 4)}"
        ax.text(  # wrapped, as text wider than the panel would leave no room for the curves
            0.99, 0.97, textwrap.fill(said, 100),
            transform=ax.transAxes, ha="right", va="top", fontsize="small", color=_CLOSED,
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8},
        )  # fmt: skip
    return ax


def spectra(result: RunResult, quantity: str = "absolute_acceleration") -> Chart:
    """Levels over frequency divided by excitation frequency, or in Hz without one.

    Neighbouring lines of a random motion differ by tens of dB and would cover a plot: of those the root mean square in
    bands is shown.
    """
    shown = [s for s in result.spectra.values() if s.quantity == quantity]
    unit = _unit_of(shown)
    curves = [Curve(s.probe, s.frequency_hz / unit, s.amplitude_db) for s in shown]
    across: Axis = ("Frequency", HERTZ) if unit == 1.0 else ("Frequency / excitation frequency", "")
    if result.scenario.excitation.kind == "random" and shown:  # a record may hold tones, which are lines
        count = max(int(np.searchsorted(curves[0].x, _end_of_spectra(shown))) // MOST_BANDS, 1)
        across = (f"Frequency in bands of {count * float(np.diff(curves[0].x[:2])[0]):.2g} Hz", HERTZ)
        curves = [Curve(s.probe, *s.in_bands(count)) for s in shown]
    return Chart(across, (f"{quantity.replace('_', ' ').capitalize()} (dB re peak)", ""), curves, of="probes")


def _unit_of(shown: Sequence[Spectrum]) -> float:
    """Excitation frequency of spectra, Hz; 1 where there is none."""
    return shown[0].excitation_hz if shown and np.isfinite(shown[0].excitation_hz) else 1.0


def plot_spectrum(result: RunResult, ax: Axes, quantity: str = "absolute_acceleration") -> Axes:
    """Level in dB over frequency divided by excitation frequency (or in Hz without one), with spectral lines marked.

    Parameters
    ----------
    result : of the run.
    ax : to draw on.
    quantity : of the probes, absolute_acceleration or displacement.

    Returns
    -------
    The axes.
    """
    shown = [s for s in result.spectra.values() if s.quantity == quantity]
    draw_curves(ax, *spectra(result, quantity))
    if shown:
        unit, end = _unit_of(shown), _end_of_spectra(shown)
        _mark_lines(ax, shown[0], unit, end)
        ax.set_xlim(0.0, end)
        top = max(float(np.max(s.amplitude_db)) for s in shown)
        ax.set_ylim(top - 100.0, top + 6.0)
        legend(ax, f"{MOST_CURVES} of {len(shown)} probes" if len(shown) > MOST_CURVES else "")
    return _doubts(result, ax, "spectral_lines", "lines", f" {quantity}")


def _mark_lines(ax: Axes, s: Spectrum, unit: float, end: float) -> None:
    """The lines of a spectrum by their kind, and those that are doubtful."""
    falls = Window.named(s.window).one_sided
    kinds: list[tuple[list[Any], str, dict[str, Any]]] = [
        ([line for line in s.lines if line.kind == kind], DECAYING_LINES if kind == "other" and falls else "",
         {"marker": mark, "markersize": 4, "markerfacecolor": "white", "color": DARK})
        for kind, mark in _LINE_MARKS.items()
    ]  # fmt: skip
    doubtful = [
        line for line in s.lines if line.frequency_hz <= end * unit and (line.relative_change or 0.0) > ALLOWED_CHANGE
    ]
    squares = {"marker": "s", "markersize": 8, "markerfacecolor": "none", "color": _CLOSED}
    kinds.append((doubtful, DOUBTFUL_LINES, squares))
    for lines, label, style in kinds:
        if lines:
            at, level = np.array([(line.frequency_hz / unit, line.amplitude_db) for line in lines]).T
            ax.plot(at, level, linestyle="none", label=label or "_nolegend_", **style)


def _end_of_spectra(shown: Sequence[Spectrum]) -> float:
    """End of the frequencies at which there is something to see, over the excitation frequency where there is one."""
    unit = _unit_of(shown)
    top = max(float(np.max(s.amplitude_db)) for s in shown)
    last = max(float(s.frequency_hz[s.amplitude_db > top - SPECTRUM_DB][-1]) for s in shown) / unit
    if np.isfinite(shown[0].excitation_hz):
        last = float(np.clip(last, 4.0, 12.0))
    chosen = [line.frequency_hz / unit for s in shown for line in s.lines if line.kind == "chosen"]
    return min(1.05 * max([last, *chosen]), float(shown[0].frequency_hz[-1]) / unit) or 1.0


def plot_phase_portrait(result: RunResult, ax: Axes, at: str | None = None) -> Axes:
    """Velocity over displacement at a snubber (at the first probe if there is none), contact emphasised.

    Of a long run the last part is drawn. The part before the window of the spectrum is drawn in light grey.

    Parameters
    ----------
    result : of the run.
    ax : to draw on.
    at : name of the snubber, or of the probe where there is no snubber; the first by default.

    Returns
    -------
    The axes.
    """
    places: dict[str, Any] = {**result.snubbers} or {**result.probes}
    place: SnubberHistory | ProbeHistory = places[at or next(iter(places))]
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
    draw_curves(ax, ("Displacement", scale_for("m", w)), ("Velocity", scale_for("m/s", v)), curves)
    ax.set_xlabel(f"{ax.get_xlabel()}\nat {place.name}")
    return ax


def _end_of_run(result: RunResult) -> slice:
    """The part of a long run that is drawn."""
    return slice(max(result.time.size - MOST_STATES, 0), None)


def plot_force_deflection(result: RunResult, ax: Axes) -> Axes:
    """Contact force over penetration of the snubbers: loops enclose the work that they lose.

    Of a long run the last part is drawn. Only samples in contact are joined, so that stops without losses follow one
    line.
    """
    shown = _end_of_run(result)
    loops = [
        Curve(name, s.penetration[shown], np.where(s.closed[shown], s.force[shown], np.nan), {"linewidth": 0.8})
        for name, s in result.snubbers.items()
    ]
    draw_curves(ax, ("Penetration", "m"), ("Contact force", "N"), loops, of="snubbers")
    if not any(np.isfinite(loop.y).any() for loop in loops):
        ax.text(0.5, 0.5, "no contact", transform=ax.transAxes, ha="center", va="center", color="0.4")
    return ax


def plot_friction(result: RunResult, ax: Axes) -> Axes:
    """Friction force over displacement: loops enclose the work that is lost. Of a long run the last part is drawn."""
    shown = _end_of_run(result)
    loops = [
        Curve(name, contact.displacement[shown], contact.force[shown], {"linewidth": 0.8})
        for name, contact in result.friction.items()
    ]
    draw_curves(ax, ("Displacement along the face", "m"), ("Friction force", "N"), loops, of="friction contacts")
    return ax


def plot_spring_force(result: RunResult, ax: Axes) -> Axes:
    """Force of the nonlinear springs over their stretch; those that relax draw loops. Of a long run its last part."""
    shown = _end_of_run(result)
    curves = [Curve(name, spring.stretch[shown], spring.force[shown]) for name, spring in result.springs.items()]
    draw_curves(ax, ("Stretch", "m"), ("Spring force", "N"), curves, of="springs")
    return ax


def plot_shock_response(response: ShockResponse, ax: Axes) -> Axes:
    """Maximax spectra of the input and of the probes; thin, the residual of the input: what it leaves after its end."""
    f, drawn = response.frequency_hz, response.signals[:MOST_CURVES]
    curves = [Curve(signal.name, f, signal.maximax) for signal in drawn]
    curves += [
        Curve("input, residual", f, signal.residual, {**curve_style(k), "linewidth": 0.55})
        for k, signal in enumerate(drawn)
        if signal.name == "input"
    ]
    across = ("Natural frequency of the oscillator", "Hz")
    draw_curves(ax, across, (f"Peak acceleration, Q = {response.quality:g}", "m/s^2"), curves, log="xy", of="")
    ax.set_xlim(f[0], f[-1])
    return ax


def run_figures(result: RunResult) -> dict[str, Figure]:
    """All plots available for this result; the key is the last part of the file name."""
    shock, random, srs = result.scenario.excitation.shock, result.random, result.srs
    whole = shock or _last_part(result) <= result.time[0]

    def history(plot: Any) -> list[Any]:
        """Whole, and its last part; a shock is over then."""
        return [partial(plot, result), *([] if whole else [partial(plot, result, last_part=True)])]

    panels = {"displacement": history(plot_displacement), "acceleration": history(plot_absolute_acceleration)}
    if shock and result.base_unit == "m" and np.any(result.base_acceleration):
        panels["acceleration"] = [partial(plot_absolute_acceleration, result), partial(plot_base_acceleration, result)]
    if result.snubbers:
        panels["contact_force"] = history(plot_contact_force)
        panels["force_deflection"] = [partial(plot_force_deflection, result)]
    if result.friction:
        panels["friction"] = [partial(plot_friction, result)]
    if result.springs:
        panels["spring_force"] = [partial(plot_spring_force, result)]
    if result.outputs:
        panels["outputs"] = [partial(plot_output, result, name=name) for name in list(result.outputs)[:MOST_CURVES]]
    if result.spectra:
        quantities = ("absolute_acceleration", "displacement")
        panels["spectrum"] = [partial(plot_spectrum, result, quantity=quantity) for quantity in quantities]
    if random is not None and random.level is not None:
        panels["level_crossings"] = [partial(plot_crossings, random)]
    if srs is not None:
        panels["srs"] = [lambda ax: _doubts(result, plot_shock_response(srs, ax), "srs", "spectra")]
    figures = {name: picture(result.title, *plots) for name, plots in panels.items()}
    places = list(result.snubbers)[:MOST_CURVES] or list(result.probes)[:1]
    portraits = [partial(plot_phase_portrait, result, at=name) for name in places]
    figures["phase_portrait"] = picture(result.title, *portraits, columns=min(len(places), 3))
    if random is not None:
        more = [partial(plot_transmissibility, random)] if has_transmissibility(random) else []
        figures["random"] = picture(result.title, partial(_plot_density, result), *more, sharex=True)
    return figures | impact_figures(result) | body_figures(result)


def _plot_density(result: RunResult, ax: Axes) -> Axes:
    assert result.random is not None
    _doubts(result, plot_density(result.random, ax), "random", "values")
    if ax.texts:  # room for them above the curves
        low, high = ax.get_ylim()
        ax.set_ylim(low, 100.0 * high)
    return ax


def _last_part(result: RunResult) -> float:
    """Start of a close-up: a few excitation periods before the end."""
    begin, end = float(result.time[0]), float(result.time[-1])
    excitation = next((s.excitation_hz for s in result.spectra.values()), float("nan"))
    # six periods, or an eighth of a run without excitation frequency
    length = 6 / excitation if np.isfinite(excitation) else 0.125 * (end - begin)
    return max(begin, end - length)
