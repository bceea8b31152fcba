"""Plots of a run. Every function draws on the given Axes and returns them."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from beamsim.analyses.run.result import ALLOWED_CHANGE, ProbeHistory, RunResult, ShockResponse, SnubberHistory, Spectrum
from beamsim.analyses.run.windows import Window
from beamsim.plots.assembly import assembly_figures
from beamsim.plots.bounds import face_levels, limit_levels
from beamsim.plots.drawing import (
    DARK,
    MOST_CURVES,
    Curve,
    Guide,
    beside,
    curve_style,
    draw_curves,
    legend,
    panels,
    thinned,
    where_other,
)
from beamsim.plots.impacts import impact_figures
from beamsim.plots.plates import plate_figures
from beamsim.plots.random_response import has_transmissibility, plot_crossings, plot_density, plot_transmissibility
from beamsim.plots.style import plain_scale, scale_for
from beamsim.scenario.limits import OF_OUTPUTS
from beamsim.structures.assembly import snubber_site
from beamsim.structures.places import Place
from beamsim.typing import Floats

MOST_BANDS = 400  # of the spectrum of a random motion
MOST_STATES = 2**18  # samples in a phase portrait
MOST_DOUBTS = 4  # named in a plot
PERIODS_SHOWN = 6  # in a close-up
SHARE_SHOWN = 0.125  # of a run without excitation frequency
DEEPEST_DB = 100.0  # below the highest line of a spectrum
CONTENT_DB = 40.0  # below the highest point of a broadband spectrum, down to which it is shown
DOUBTFUL_LINES = f"lines that change by more than {100 * ALLOWED_CHANGE:g} % with a finer model"
DECAYING_LINES = "lines, weighted to the beginning"
_LINE_MARKS = {"fundamental": "o", "superharmonic": "o", "subharmonic": "^", "other": "x", "chosen": "D"}
_FREE, _CLOSED = "0.62", "#a3263d"  # apart in grey print, too


def plot_history(
    result: RunResult,
    ax: Axes,
    up: tuple[str, str],
    values: dict[str, Any],
    levels: Iterable[Guide] = (),
    *,
    last_part: bool = False,
    of: str = "probes",
) -> Axes:
    """Time histories, whole or of a few last periods.

    Parameters
    ----------
    up : words and SI unit.
    values : (nt,) by name, as arrays or read in parts.
    """
    time, clock = result.time, plain_scale("s")
    begin, end = _ends(result)
    if last_part:
        begin = _last_part(result)
    first = int(np.searchsorted(time, begin))
    drawn = [Curve(name, *thinned(time, x, begin=first)) for name, x in list(values.items())[:MOST_CURVES]]
    draw_curves(ax, ("Time", clock), up, drawn, levels, known=len(values), of=of)
    ax.set_xlim(begin * clock.factor, (end if end > begin else begin + 1.0) * clock.factor)
    return ax


def plot_displacement(result: RunResult, ax: Axes, *, last_part: bool = False) -> Axes:
    """Time history of the probe displacements relative to the base."""
    values = {name: probe.displacement for name, probe in result.probes.items()}
    levels = limit_levels(result.scenario.limits, "peak_displacement", both_signs=True)
    levels += face_levels(result, list(values)[:MOST_CURVES])
    plot_history(result, ax, ("Relative displacement", "m"), values, levels, last_part=last_part)
    return ax if last_part else _doubts(result, ax, "peak_displacement_m")


def plot_absolute_acceleration(result: RunResult, ax: Axes, *, last_part: bool = False) -> Axes:
    """Time history of the absolute accelerations of the probes, in g; behind the filter where there is one."""
    label = "Absolute acceleration" if result.low_pass_hz is None else f"Acceleration below {result.low_pass_hz:g} Hz"
    kind = "absolute" if result.low_pass_hz is None else "low_passed"
    values = {name: getattr(probe, f"{kind}_acceleration") for name, probe in result.probes.items()}
    levels = limit_levels(result.scenario.limits, "peak_acceleration", both_signs=True)
    plot_history(result, ax, (label, "m/s^2"), values, levels, last_part=last_part)
    return ax if last_part else _doubts(result, ax, "peak_acceleration_g")


def _doubts(result: RunResult, ax: Axes, figure: str, called: str = "peaks", of: str = "") -> Axes:
    """Say which figures have not converged: all, or those whose name ends with ``of``."""
    changes = result.summary.get("convergence", {}).get(figure, {})
    listed = result.summary.get("doubtful", ())
    doubtful = [name for name in changes if f"{figure}.{name}" in listed and name.endswith(of)]
    if doubtful:
        texts = [
            f"{name.removesuffix(of).replace('_', ' ').strip()} {100 * changes[name]:.2g}\N{NO-BREAK SPACE}%"
            for name in doubtful[:MOST_DOUBTS]
        ]
        more = ", …" if len(doubtful) > MOST_DOUBTS else ""
        said = f"{called} not converged; change with a finer model: {', '.join(texts)}{more}"
        ax.text(  # wrapped, as text wider than the panel would leave no room for the curves
            0.99, 0.97, textwrap.fill(said, 100),
            transform=ax.transAxes, ha="right", va="top", fontsize="small", color=_CLOSED,
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8},
        )  # fmt: skip
    return ax


def plot_contact_force(result: RunResult, ax: Axes, *, last_part: bool = False) -> Axes:
    """Time history of the contact forces; if there are many snubbers, those with the largest peaks."""
    forces = {name: snubber.force for name, snubber in result.snubbers.items()}
    peaks = {name: float(np.max(thinned(x, x)[1], initial=0.0)) for name, x in forces.items()}
    weakest = sorted(peaks, key=lambda name: -peaks[name])[MOST_CURVES:]
    ordered = {name: x for name, x in forces.items() if name not in weakest} | forces
    levels = limit_levels(result.scenario.limits, "peak_force")
    plot_history(result, ax, ("Contact force", "N"), ordered, levels, last_part=last_part, of="snubbers")
    if not any(peaks.values()):
        ax.set_ylim(-0.05, 1.0)
        ax.text(0.5, 0.5, "no contact", transform=ax.transAxes, ha="center", color="0.5")
    return ax if last_part else _doubts(result, ax, "peak_force_n")


def plot_base_acceleration(result: RunResult, ax: Axes) -> Axes:
    """Time history of the acceleration of the base, the input."""
    return plot_history(result, ax, ("Acceleration of the base", "m/s^2"), {"": result.base_acceleration})


def plot_output(result: RunResult, ax: Axes, name: str) -> Axes:
    """Time history of an output."""
    output = result.outputs[name]
    levels = limit_levels(result.scenario.limits, OF_OUTPUTS + name, both_signs=True)
    return plot_history(result, ax, (name, output.unit), {"": output.value}, levels)


def plot_spectrum(result: RunResult, ax: Axes, quantity: str = "absolute_acceleration") -> Axes:
    """Level in dB over frequency divided by excitation frequency (or in Hz without one), with spectral lines marked."""
    spectra = [s for s in result.spectra.values() if s.quantity == quantity]
    forced = bool(spectra) and bool(np.isfinite(spectra[0].excitation_hz))
    unit = spectra[0].excitation_hz if forced else 1.0
    noisy = result.scenario.excitation.kind == "random" and bool(spectra)  # a record may hold tones, which are lines
    end = _end_of_spectra(result, quantity)
    band = max(int(np.searchsorted(spectra[0].frequency_hz, end)) // MOST_BANDS, 1) if noisy else 1
    words = "Frequency / excitation frequency" if forced else "Frequency (Hz)"
    if band > 1:
        words += f", rms of lines in bands of {band * float(np.diff(spectra[0].frequency_hz[:2])[0]):.2g} Hz"
    curves = [
        Curve(s.probe, *thinned(*_in_bands(s.frequency_hz / unit, s.amplitude_db, band))) for s in spectra[:MOST_CURVES]
    ]
    named = quantity.replace("_", " ").capitalize()
    draw_curves(ax, (words, ""), (f"{named} (dB re peak)", ""), curves, known=len(spectra), of="probes")
    if spectra:
        _mark_lines(ax, spectra[0], unit, end)
        ax.set_xlim(0.0, end)
        top = max(float(np.max(s.amplitude_db)) for s in spectra)
        bottom = min(float(np.percentile(s.amplitude_db, 5)) for s in spectra)
        ax.set_ylim(min(max(top - DEEPEST_DB, bottom), top - 40.0), top + 6.0)
        legend(ax, f"{MOST_CURVES} of {len(spectra)} probes" if len(spectra) > MOST_CURVES else "")
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


def _in_bands(frequency: Floats, level_db: Floats, count: int) -> tuple[Floats, Floats]:
    """Middles of bands of ``count`` lines, and the root mean square of the lines in each, dB.

    Neighbouring lines of a random motion differ by tens of dB: drawn one by one they cover a plot.

    >>> middles, levels = _in_bands(np.arange(5.0), np.array([0.0, 0.0, 0.0, -400.0, 7.0]), 2)
    >>> middles.tolist(), levels.round(2).tolist()
    ([0.5, 2.5], [0.0, -3.01])
    """
    if count == 1:
        return frequency, level_db
    whole = level_db.size - level_db.size % count
    power = np.mean(10.0 ** (level_db[:whole].reshape(-1, count) / 10.0), axis=1)
    return frequency[:whole].reshape(-1, count).mean(axis=1), 10.0 * np.log10(power)


def plot_phase_portrait(result: RunResult, ax: Axes, at: str | None = None) -> Axes:
    """Velocity over displacement at a snubber (at the first probe if there is none), contact emphasised.

    Of a long run the last part is drawn. The part before the window of the spectrum is drawn in light grey.
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

    Of a long run the last part is drawn. Stops without losses follow one line: theirs is drawn in order of penetration,
    as lines between samples would cut its corners and look like loops.
    """
    lossy = {stop.name for _, _, stop, _ in result.scenario.located_snubbers if stop.maxwell or stop.hardening}
    shown, loops = _end_of_run(result), []
    for snubber in list(result.snubbers.values())[:MOST_CURVES]:
        drawn = beside(snubber.closed[shown])
        penetration, force = snubber.penetration[shown], snubber.force[shown]
        if snubber.dashpot or snubber.name in lossy:
            force = np.where(drawn, force, np.nan)
        else:
            rising = np.flatnonzero(drawn)[np.argsort(penetration[drawn], kind="stable")]
            penetration, force = penetration[rising], force[rising]
        loops.append(Curve(snubber.name, np.where(np.isfinite(force), penetration, np.nan), force, {"linewidth": 0.8}))
    draw_curves(ax, ("Penetration", "m"), ("Contact force", "N"), loops, known=len(result.snubbers), of="snubbers")
    if not any(np.isfinite(loop.y).any() for loop in loops):
        ax.text(0.5, 0.5, "no contact", transform=ax.transAxes, ha="center", va="center", color="0.4")
    return ax


def plot_friction(result: RunResult, ax: Axes) -> Axes:
    """Friction force over displacement: loops enclose the work that is lost. Of a long run the last part is drawn."""
    shown = _end_of_run(result)
    loops = [
        Curve(name, contact.displacement[shown], contact.force[shown], {"linewidth": 0.8})
        for name, contact in list(result.friction.items())[:MOST_CURVES]
    ]
    across, up = ("Displacement along the face", "m"), ("Friction force", "N")
    draw_curves(ax, across, up, loops, known=len(result.friction), of="friction contacts")
    return ax


def plot_spring_force(result: RunResult, ax: Axes) -> Axes:
    """Force of the nonlinear springs over their stretch, in the range covered by the motion."""
    curves = []
    for spring in list(result.springs.values())[:MOST_CURVES]:
        force, stretch = thinned(spring.force, spring.stretch, 250_000)
        relaxes = spring.kind in ("linear", "spring")  # then the motion draws loops
        order = slice(None) if relaxes else np.argsort(stretch, kind="stable")
        curves.append(Curve(spring.name, *thinned(stretch[order], force[order])))
    draw_curves(ax, ("Stretch", "m"), ("Spring force", "N"), curves, known=len(result.springs), of="springs")
    return ax


def plot_deflected_shapes(result: RunResult, ax: Axes, body: str = "") -> Axes:
    """Static shape of a body (by default the first), its shapes at the extremes of the first probe, the snubbers."""
    if not result.bodies:
        raise ValueError("no body has a deflected shape: the masses of a chain are points")
    body = body or next(iter(result.bodies))
    beam = result.bodies[body]
    snubbers = list(result.snubbers.values())
    if len(result.modes.stations.parts) > 1:  # those that stand on the base or the ground, at this body
        sites = {located.item.name: snubber_site(located) for located in result.scenario.located_snubbers}
        snubbers = [s for s in snubbers if isinstance(site := sites[s.name], Place) and site.body == body]
    faces = np.array([(-1.0 if s.side == "below" else 1.0) * s.gap for s in snubbers])
    first = next(iter(result.probes), "")
    shapes = (
        (f"{first} highest, t = {beam.extreme_times[1]:.4g} s", beam.extreme_shapes[1]),
        (f"{first} lowest, t = {beam.extreme_times[0]:.4g} s", beam.extreme_shapes[0]),
        ("static equilibrium", beam.static_shape),
    )
    curves = [Curve(label, beam.position, y, {"color": DARK}) for label, y in shapes if np.isfinite(y).all()]
    ax.axhline(0.0, color="0.6", linewidth=0.7, zorder=1)
    of = body if len(result.bodies) > 1 else "the beam"
    scale = scale_for("m", beam.extreme_shapes, faces)
    x, y = draw_curves(ax, (f"Position along {of}", "m"), ("Relative deflection", scale), curves)
    for k, (s, face) in enumerate(zip(snubbers, faces, strict=True)):
        ax.plot(
            s.position * x.factor, face * y.factor, linestyle="none", color=_CLOSED, markersize=11, clip_on=False,
            marker=6 if s.side == "below" else 7,  # a triangle whose tip is the face
            label="_nolegend_" if k else "snubber",
        )  # fmt: skip
    legend(ax)
    return ax


def plot_shock_response(response: ShockResponse, ax: Axes) -> Axes:
    """Maximax spectra of the input and of the probes; thin, the residual of the input where it is another.

    The residual is what the input leaves after its end; that of a sawtooth is nearly its maximax spectrum.
    """
    f, drawn = response.frequency_hz, response.signals[:MOST_CURVES]
    curves = [Curve(signal.name, f, signal.maximax, curve_style(k)) for k, signal in enumerate(drawn)]
    for k, signal in enumerate(drawn):
        if signal.name == "input":
            residual = where_other(signal.maximax, signal.residual)
            known = np.isfinite(residual)
            same = "" if known.all() else " (where it is lower)" if known.any() else " (the same)"
            curves.insert(k + 1, Curve(f"input, residual{same}", f, residual, {**curve_style(k), "linewidth": 0.55}))
    words = ("Natural frequency of the oscillator", "Hz")
    _, scale = draw_curves(ax, words, ("Peak acceleration", "m/s^2"), curves, of="signals")
    ax.set_ylabel(f"{ax.get_ylabel()}, Q = {response.quality:g}")
    ax.set(xscale="log", yscale="log", xlim=(f[0], f[-1]))
    top = max((float(s.maximax.max()) for s in drawn), default=0.0) * scale.factor
    if top > 0:
        bottom = min(float(s.maximax.min()) for s in drawn) * scale.factor
        ax.set_ylim(max(0.5 * bottom, 1e-6 * top), 2.0 * top)
    return ax


def run_figures(result: RunResult) -> dict[str, Figure]:
    """All plots available for this result; the key is the last part of the file name."""
    title, shock = result.title, result.scenario.excitation.shock
    figures: dict[str, Figure] = {}

    def draw(
        name: str, *plots: Callable[[RunResult, Axes], Any], columns: int = 1, height: float = 0.0, sharex: bool = False
    ) -> None:
        """One panel for each plot."""
        rows = -(-len(plots) // columns)
        size = (8.0, height or (4.4 if rows == 1 else 2.8 * rows))
        figures[name], axes = panels(title, len(plots), columns, size, sharex=sharex)
        for ax, plot in zip(axes, plots, strict=True):
            plot(result, ax)
            if sharex:
                ax.label_outer()

    def history(name: str, plot: Callable[..., Axes]) -> None:
        """Whole, and its last part; a shock is over then."""
        if shock or _last_part(result) <= _ends(result)[0]:
            draw(name, plot)
        else:
            draw(name, plot, lambda result, ax: plot(result, ax, last_part=True))

    history("displacement", plot_displacement)
    if shock and result.base_unit == "m" and np.any(result.base_acceleration):
        draw("acceleration", plot_absolute_acceleration, plot_base_acceleration)
    else:
        history("acceleration", plot_absolute_acceleration)
    if result.snubbers:
        history("contact_force", plot_contact_force)
        draw("force_deflection", plot_force_deflection)
    if result.friction:
        draw("friction", plot_friction)
    if result.springs:
        draw("spring_force", plot_spring_force)
    if result.outputs:
        draw("outputs", *(_of(plot_output, name) for name in list(result.outputs)[:MOST_CURVES]))
    if result.spectra:
        draw("spectrum", *(_of(plot_spectrum, quantity) for quantity in ("absolute_acceleration", "displacement")))
    places = list(result.snubbers)[:MOST_CURVES] or list(result.probes)[:1]
    draw("phase_portrait", *(_of(plot_phase_portrait, name) for name in places), columns=min(len(places), 3),
         height=5.0 if len(places) <= 3 else 6.4)  # fmt: skip
    if (random := result.random) is not None:
        more = [_plot_transmissibility] if has_transmissibility(random) else []
        draw("random", _plot_density, *more, sharex=True)
        if random.level is not None:
            draw("level_crossings", lambda _, ax: plot_crossings(random, ax))
    if (srs := result.srs) is not None:
        draw("srs", lambda result, ax: _doubts(result, plot_shock_response(srs, ax), "srs", "spectra"))
    beams = [name for name, body in result.bodies.items() if body.across is None]
    if beams:
        draw("deflected_shapes", *(_of(plot_deflected_shapes, name) for name in beams))
    return figures | impact_figures(result) | plate_figures(result) | assembly_figures(result)


def _of(plot: Callable[..., Axes], name: str) -> Callable[[RunResult, Axes], Axes]:
    """A plot of one of several things."""
    return lambda result, ax: plot(result, ax, name)


def _plot_density(result: RunResult, ax: Axes) -> None:
    assert result.random is not None
    _doubts(result, plot_density(result.random, ax), "random", "figures")
    if ax.texts:  # room for them above the curves
        low, high = ax.get_ylim()
        ax.set_ylim(low, 100.0 * high)


def _plot_transmissibility(result: RunResult, ax: Axes) -> None:
    assert result.random is not None
    plot_transmissibility(result.random, ax)


def _ends(result: RunResult) -> tuple[float, float]:
    """First and last output time, s."""
    return float(result.time[0]), float(result.time[-1])


def _last_part(result: RunResult) -> float:
    """Start of a close-up: a few excitation periods before the end."""
    begin, end = _ends(result)
    excitation = next((s.excitation_hz for s in result.spectra.values()), float("nan"))
    length = PERIODS_SHOWN / excitation if np.isfinite(excitation) else SHARE_SHOWN * (end - begin)
    return max(begin, end - length)


def _end_of_spectra(result: RunResult, quantity: str) -> float:
    """End of the frequencies at which there is something to see, over the excitation frequency where there is one."""
    spectra = [s for s in result.spectra.values() if s.quantity == quantity]
    if not spectra:
        return 1.0
    forced = bool(np.isfinite(spectra[0].excitation_hz))
    return _highest_shown(spectra, forced, broadband=result.random is not None)


def _highest_shown(spectra: Sequence[Spectrum], forced: bool, broadband: bool) -> float:
    unit = spectra[0].excitation_hz if forced else 1.0
    end = float(spectra[0].frequency_hz[-1]) / unit
    strong = [
        line.frequency_hz / unit
        for s in spectra
        for line in s.lines
        if line.amplitude_db > -60.0 and line.kind not in ("mean", "residual")
    ]
    chosen = max((line.frequency_hz / unit for s in spectra for line in s.lines if line.kind == "chosen"), default=0.0)
    limit = min(max([*strong, 4.0]) + 0.5, 12.5) if forced else 1.5 * max(strong, default=end)
    if broadband:  # the content is not in lines alone
        limit = max(limit, *(float(s.frequency_hz[_content(s)]) / unit for s in spectra))
    limit = max(limit, 1.05 * chosen)
    return min(limit, end) or 1.0


def _content(s: Spectrum) -> int:
    """The last point of a spectrum less than `CONTENT_DB` below its highest."""
    return int(np.flatnonzero(s.amplitude_db > np.max(s.amplitude_db) - CONTENT_DB)[-1])
