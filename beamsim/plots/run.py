"""Plots of a run. Every function draws on the given Axes and returns them."""

from __future__ import annotations

import textwrap
from bisect import bisect_left
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.analyses.run.result import ALLOWED_CHANGE, ProbeHistory, RunResult, SnubberHistory, Spectrum
from beamsim.analyses.run.windows import Window
from beamsim.plots.assembly import assembly_figures
from beamsim.plots.bounds import draw_faces, draw_limit
from beamsim.plots.impacts import impact_figures
from beamsim.plots.outputs import plot_output
from beamsim.plots.plates import plate_figures
from beamsim.plots.random_response import has_transmissibility, plot_crossings, plot_density, plot_transmissibility
from beamsim.plots.shock_response import plot_shock_response
from beamsim.plots.style import (
    MOST_CURVES,
    acceleration_scale,
    curve_style,
    finish,
    legend,
    put_title,
    scale_for,
    thinned,
    time_scale,
)
from beamsim.structures.assembly import snubber_site
from beamsim.structures.places import Place
from beamsim.typing import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_BANDS = 400  # of the spectrum of a random motion
MOST_STATES = 2**18  # samples in a phase portrait
MOST_DOUBTS = 4  # named in a plot
WIDEST_DOUBTS = 100  # characters in a line of them
ROOM_FOR_DOUBTS = 100.0  # factor of the upper end of densities
PERIODS_SHOWN = 6  # in a close-up
SHARE_SHOWN = 0.125  # of a run without excitation frequency
MOST_STRETCHED = 3.2  # ratio of the ends of two spectra up to which they have one axis: 4 to 12.5 orders
DEEPEST_DB = 100.0  # below the highest line of a spectrum
CONTENT_DB = 40.0  # below the highest point of a broadband spectrum, down to which it is shown
DOUBTFUL_LINES = f"lines that change by more than {100 * ALLOWED_CHANGE:g} % with a finer model"
DECAYING_LINES = "lines, weighted to the beginning"
_LINE_MARKS = {"fundamental": "o", "superharmonic": "o", "subharmonic": "^", "other": "x", "chosen": "D"}
_FREE, _CLOSED = "0.62", "#a3263d"  # apart in grey print, too


def plot_displacement(result: RunResult, ax: Axes, *, last_part: bool = False) -> Axes:
    """Time history of the probe displacements relative to the base."""
    names = dict.fromkeys(result.probes, "displacement")
    _histories(result, ax, result.probes, names, "Relative displacement", "m", last_part, "peak_displacement")
    return ax if last_part else _doubts(result, ax, "peak_displacement_m")


def plot_absolute_acceleration(result: RunResult, ax: Axes, *, last_part: bool = False) -> Axes:
    """Time history of the absolute accelerations of the probes, in g; behind the filter where there is one."""
    label = "Absolute acceleration" if result.low_pass_hz is None else f"Acceleration below {result.low_pass_hz:g} Hz"
    kind = "absolute" if result.low_pass_hz is None else "low_passed"
    names = dict.fromkeys(result.probes, f"{kind}_acceleration")
    _histories(result, ax, result.probes, names, label, "m/s^2", last_part, "peak_acceleration")
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
            0.99, 0.97, textwrap.fill(said, WIDEST_DOUBTS),
            transform=ax.transAxes, ha="right", va="top", fontsize="small", color=_CLOSED,
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8},
        )  # fmt: skip
    return ax


def plot_contact_force(result: RunResult, ax: Axes, *, last_part: bool = False) -> Axes:
    """Time history of the contact forces; if there are many snubbers, those with the largest peaks."""
    peaks = {name: float(np.max(thinned(s.force, s.force)[1], initial=0.0)) for name, s in result.snubbers.items()}
    strongest = sorted(peaks, key=lambda name: -peaks[name])[:MOST_CURVES]
    names = {name: "force" for name in result.snubbers if name in strongest}
    _histories(result, ax, result.snubbers, names, "Contact force", "N", last_part, "peak_force")
    if ax.lines and not any(np.any(line.get_ydata()) for line in ax.lines):
        ax.set_ylim(-0.05, 1.0)
        ax.text(0.5, 0.5, "no contact", transform=ax.transAxes, ha="center", color="0.5")
    return ax if last_part else _doubts(result, ax, "peak_force_n")


def plot_spectrum(
    result: RunResult, ax: Axes, quantity: str = "absolute_acceleration", end: float | None = None
) -> Axes:
    """Level in dB over frequency divided by excitation frequency (or in Hz without one), with spectral lines marked.

    ``end`` is that of the frequencies shown, which otherwise follows from the lines of the quantity.
    """
    spectra = [s for s in result.spectra.values() if s.quantity == quantity]
    forced = bool(spectra) and bool(np.isfinite(spectra[0].excitation_hz))
    noisy = result.scenario.excitation.kind == "random" and bool(spectra)  # a record may hold tones, which are lines
    end = end or _end_of_spectra(result, quantity)
    band = max(int(np.searchsorted(spectra[0].frequency_hz, end)) // MOST_BANDS, 1) if noisy else 1
    for k, s in enumerate(spectra[:MOST_CURVES]):
        unit = s.excitation_hz if forced else 1.0
        style = curve_style(k)
        falls = Window.named(s.window).one_sided
        ax.plot(*thinned(*_in_bands(s.frequency_hz / unit, s.amplitude_db, band)), label=s.probe, **style)
        for kind, mark in _LINE_MARKS.items():
            marked = [line for line in s.lines if line.kind == kind] if k == 0 else []
            ax.plot(
                [line.frequency_hz / unit for line in marked],
                [line.amplitude_db for line in marked],
                linestyle="none",
                marker=mark,
                markersize=4,
                markerfacecolor="white",
                color=style["color"],
                label=DECAYING_LINES if marked and kind == "other" and falls else "_nolegend_",
            )
        shown = [line for line in s.lines if line.frequency_hz <= end * unit] if k == 0 else []
        doubtful = [line for line in shown if (line.relative_change or 0.0) > ALLOWED_CHANGE]
        ax.plot(
            [line.frequency_hz / unit for line in doubtful],
            [line.amplitude_db for line in doubtful],
            linestyle="none", marker="s", markersize=8, markerfacecolor="none", color=_CLOSED,
            label=DOUBTFUL_LINES if doubtful else "_nolegend_",
        )  # fmt: skip
    if spectra:
        ax.set_xlim(0.0, end)
        top = max(float(np.max(s.amplitude_db)) for s in spectra)
        bottom = min(float(np.percentile(s.amplitude_db, 5)) for s in spectra)
        ax.set_ylim(min(max(top - DEEPEST_DB, bottom), top - 40.0), top + 6.0)
    named = quantity.replace("_", " ").capitalize()
    axis = "Frequency / excitation frequency" if forced else "Frequency (Hz)"
    if band > 1:
        axis += f", rms of lines in bands of {band * float(np.diff(spectra[0].frequency_hz[:2])[0]):.2g} Hz"
    finish(ax, axis, f"{named} (dB re peak)")
    legend(ax, min(len(spectra), MOST_CURVES), len(spectra), "probes")
    return _doubts(result, ax, "spectral_lines", "lines", f" {quantity}")


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

    Of a long run the last part is drawn, which the picture says. The part before the window of the spectrum is drawn in
    light grey.
    """
    place = _place(result, at)
    times = result.time
    shown = slice(max(times.size - MOST_STATES, 0), times.size)
    time, w, v = times[shown], place.displacement[shown], place.velocity[shown]
    closed = place.closed[shown] if isinstance(place, SnubberHistory) else np.zeros(time.size, dtype=bool)
    length, speed = scale_for("m", w), scale_for("m/s", v)
    w, v = w * length.factor, v * speed.factor
    begin = min((s.start_s for s in result.spectra.values()), default=0.0)
    early = time < begin
    if np.any(early):
        ax.plot(w[early], v[early], color="0.85", linewidth=0.5, zorder=1)
    free = np.where(early | closed, np.nan, v)
    # One more sample on either side, so that the two curves meet.
    touching = closed | np.roll(closed, 1) | np.roll(closed, -1)
    ax.plot(w, free, color=_FREE, linewidth=0.9, zorder=2, label="free")
    if np.any(closed & ~early):
        ax.plot(w, np.where(touching & ~early, v, np.nan), color=_CLOSED, linewidth=1.8, zorder=3, label="in contact")
        if at is None or at == next(iter(result.snubbers)):
            legend(ax, 2, 2, "")
    part = "" if time.size == times.size else f", last {time[-1] - time[0]:.3g} s"
    finish(ax, f"Displacement ({length.unit})\nat {place.name}{part}", f"Velocity ({speed.unit})")
    return ax


def plot_force_deflection(result: RunResult, ax: Axes) -> Axes:
    """Contact force over penetration of the snubbers: loops enclose the work that they lose.

    Of a long run the last part is drawn. Stops without losses follow one line: theirs is drawn in order of penetration,
    as lines between samples would cut its corners and look like loops.
    """
    lossy = {stop.name for _, _, stop in result.scenario.located_snubbers if stop.maxwell or stop.hardening}
    snubbers = list(result.snubbers.values())[:MOST_CURVES]
    shown = slice(max(result.time.size - MOST_STATES, 0), None)
    loops = []
    for snubber in snubbers:
        closed = snubber.closed[shown]
        drawn = closed.copy()  # and one more sample on either side
        drawn[1:] |= closed[:-1]
        drawn[:-1] |= closed[1:]
        values = [getattr(snubber, name)[shown] for name in ("penetration", "force")]
        if snubber.dashpot or snubber.name in lossy:
            loops.append([np.where(drawn, value, np.nan) for value in values])
        else:
            rising = np.argsort(values[0][drawn], kind="stable")
            loops.append([value[drawn][rising] for value in values])
    length, newton = (scale_for(unit, *(loop[k] for loop in loops)) for k, unit in enumerate(("m", "N")))
    for k, (snubber, (penetration, force)) in enumerate(zip(snubbers, loops, strict=True)):
        style = {**curve_style(k), "linewidth": 0.8}
        ax.plot(penetration * length.factor, force * newton.factor, label=snubber.name, **style)
    if not any(np.isfinite(penetration).any() for penetration, _ in loops):
        ax.text(0.5, 0.5, "no contact", transform=ax.transAxes, ha="center", va="center", color="0.4")
    finish(ax, f"Penetration ({length.unit})", f"Contact force ({newton.unit})")
    legend(ax, len(snubbers), len(result.snubbers), "snubbers")
    return ax


def plot_friction(result: RunResult, ax: Axes) -> Axes:
    """Friction force over displacement: loops enclose the work that is lost. Of a long run the last part is drawn."""
    contacts = list(result.friction.values())[:MOST_CURVES]
    shown = slice(max(result.time.size - MOST_STATES, 0), None)
    loops = [[getattr(contact, name)[shown] for name in ("displacement", "force")] for contact in contacts]
    length, newton = (scale_for(unit, *(loop[k] for loop in loops)) for k, unit in enumerate(("m", "N")))
    for k, (contact, (displacement, force)) in enumerate(zip(contacts, loops, strict=True)):
        style = {**curve_style(k), "linewidth": 0.8}
        ax.plot(displacement * length.factor, force * newton.factor, label=contact.name, **style)
    finish(ax, f"Displacement along the face ({length.unit})", f"Friction force ({newton.unit})")
    legend(ax, len(contacts), len(result.friction), "friction contacts")
    return ax


def plot_spring_force(result: RunResult, ax: Axes) -> Axes:
    """Force of the nonlinear springs over their stretch, in the range covered by the motion."""
    springs = list(result.springs.values())[:MOST_CURVES]
    curves = []
    for spring in springs:
        force, stretch = thinned(spring.force, spring.stretch, 250_000)  # one follows from the other, or nearly so
        relaxes = spring.kind in ("linear", "spring")  # then the motion draws loops
        order = slice(None) if relaxes else np.argsort(stretch, kind="stable")
        curves.append((stretch[order], force[order]))
    length = scale_for("m", *(stretch for stretch, _ in curves))
    newton = scale_for("N", *(force for _, force in curves))
    for k, (spring, (stretch, force)) in enumerate(zip(springs, curves, strict=True)):
        stretch, force = stretch * length.factor, force * newton.factor
        ax.plot(*thinned(stretch, force), label=spring.name, **curve_style(k))
    finish(ax, f"Stretch ({length.unit})", f"Spring force ({newton.unit})")
    legend(ax, len(springs), len(result.springs), "springs")
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
    faces = [(-1.0 if s.side == "below" else 1.0) * s.gap for s in snubbers]
    length = scale_for("m", beam.extreme_shapes, np.array(faces))
    along = scale_for("m", beam.position)
    x = beam.position * along.factor
    ax.axhline(0.0, color="0.6", linewidth=0.7, zorder=1)
    first = next(iter(result.probes), "")
    curves = [
        (beam.extreme_shapes[1], "-", f"{first} highest, t = {beam.extreme_times[1]:.4g} s"),
        (beam.extreme_shapes[0], (0, (5, 1.5)), f"{first} lowest, t = {beam.extreme_times[0]:.4g} s"),
        (beam.static_shape, (0, (1.2, 1.2)), "static equilibrium"),
    ]
    for shape, dashes, label in curves:
        if np.all(np.isfinite(shape)):
            ax.plot(x, shape * length.factor, color="#0b3c5d", linestyle=dashes, linewidth=1.5, label=label)
    for s, face in zip(snubbers, faces, strict=True):
        ax.plot(
            [s.position * along.factor],
            [face * length.factor],
            marker=6 if s.side == "below" else 7,  # a triangle whose tip is the face
            markersize=11,
            color=_CLOSED,
            linestyle="none",
            clip_on=False,
        )
    if snubbers:  # in the legend a mark that is drawn around its place: below it, it seemed another snubber
        mark = "^" if snubbers[0].side == "below" else "v"
        ax.plot([], [], marker=mark, markersize=7, color=_CLOSED, linestyle="none", label="snubber")
    what = body if len(result.bodies) > 1 else "the beam"
    finish(ax, f"Position along {what} ({along.unit})", f"Relative deflection ({length.unit})")
    shown = len(ax.get_legend_handles_labels()[1])
    legend(ax, shown, shown, "shapes")
    return ax


def run_figures(result: RunResult) -> dict[str, Figure]:
    """All plots available for this result; the key is the last part of the file name."""
    from matplotlib.figure import Figure

    def panels(rows: int, columns: int = 1, height: float = 5.6) -> tuple[Figure, list[Axes]]:
        figure = Figure(figsize=(8.0, height), layout="constrained")
        if result.title:
            put_title(figure, result.title)
        return figure, list(figure.subplots(rows, columns, squeeze=False).ravel())

    shock = result.scenario.excitation.shock

    def whole_and_last_part(draw: Callable[..., Axes]) -> Figure:
        if shock or _last_part(result) <= _ends(result)[0]:  # a shock is over in the last part
            figure, (ax,) = panels(1, height=4.4)
            draw(result, ax)
            return figure
        figure, (above, below) = panels(2)
        draw(result, above)
        draw(result, below, last_part=True)
        above.set_xlabel("")
        if (drawn := below.get_legend()) is not None:
            drawn.remove()
        return figure

    figures = {
        "displacement": whole_and_last_part(plot_displacement),
        "acceleration": whole_and_last_part(plot_absolute_acceleration),
    }
    if shock and result.base_unit == "m" and np.any(result.base_acceleration):
        figure, (above, below) = panels(2)
        plot_absolute_acceleration(result, above)
        plot_base_acceleration(result, below)
        above.set_xlabel("")
        figures["acceleration"] = figure
    if result.snubbers:
        figures["contact_force"] = whole_and_last_part(plot_contact_force)
        figure, (ax,) = panels(1, height=4.4)
        figures["force_deflection"] = figure
        plot_force_deflection(result, ax)
    if result.friction:
        figure, (ax,) = panels(1, height=4.4)
        plot_friction(result, ax)
        figures["friction"] = figure
    if result.springs:
        figure, (ax,) = panels(1, height=4.4)
        plot_spring_force(result, ax)
        figures["spring_force"] = figure
    if result.outputs:
        names = list(result.outputs)[:MOST_CURVES]
        figure, axes = panels(len(names), height=max(4.4, 1.9 * len(names)))
        for ax, output in zip(axes, names, strict=True):
            plot_output(result, ax, output)
        for ax in axes[:-1]:
            ax.set_xlabel("")
        figures["outputs"] = figure
    figure, (above, below) = panels(2)
    ends = [_end_of_spectra(result, quantity) for quantity in ("absolute_acceleration", "displacement")]
    together = max(ends) <= MOST_STRETCHED * min(ends)  # then the same lines stand one above the other
    for ax, quantity, end in zip((above, below), ("absolute_acceleration", "displacement"), ends, strict=True):
        plot_spectrum(result, ax, quantity, max(ends) if together else end)
    if together:
        above.set_xlabel("")
    if (drawn := below.get_legend()) is not None:
        drawn.remove()
    figures["spectrum"] = figure
    places: list[str | None] = [*list(result.snubbers)[:MOST_CURVES]] or [None]
    columns = min(len(places), 3)
    rows = -(-len(places) // columns)
    figure, axes = panels(rows, columns, 5.0 if rows == 1 else 6.4)
    for ax, name in zip(axes, places, strict=False):
        plot_phase_portrait(result, ax, name)
    for ax in axes[len(places) :]:
        ax.set_visible(False)
    figures["phase_portrait"] = figure
    if result.random is not None:
        both = has_transmissibility(result.random)
        figure, axes = panels(2) if both else panels(1, height=4.4)
        _doubts(result, plot_density(result.random, axes[0]), "random", "figures")
        if axes[0].texts:  # room for them above the curves
            low, high = axes[0].get_ylim()
            axes[0].set_ylim(low, ROOM_FOR_DOUBTS * high)
        if both:
            plot_transmissibility(result.random, axes[1])
            axes[1].set_xlim(axes[0].get_xlim())
            axes[0].set_xlabel("")
        figures["random"] = figure
        if result.random.level is not None:
            figure, (ax,) = panels(1, height=4.4)
            plot_crossings(result.random, ax)
            figures["level_crossings"] = figure
    if result.srs is not None:
        figure, (ax,) = panels(1, height=4.4)
        _doubts(result, plot_shock_response(result.srs, ax), "srs", "spectra")
        figures["srs"] = figure
    beams = [name for name, body in result.bodies.items() if body.across is None]
    if beams:
        figure, axes = panels(len(beams), height=4.4 if len(beams) == 1 else 3.2 * len(beams))
        for ax, body in zip(axes, beams, strict=True):
            plot_deflected_shapes(result, ax, body)
        figures["deflected_shapes"] = figure
    return figures | impact_figures(result, panels) | plate_figures(result) | assembly_figures(result)


def plot_base_acceleration(result: RunResult, ax: Axes) -> Axes:
    """Time history of the acceleration of the base, the input."""
    t, x = thinned(result.time, result.base_acceleration)
    scale, clock = acceleration_scale(), time_scale()
    ax.plot(t * clock.factor, x * scale.factor, **curve_style(0))
    ax.set_xlim(t[0] * clock.factor, t[-1] * clock.factor)
    finish(ax, f"Time ({clock.unit})", f"Acceleration of the base ({scale.unit})")
    return ax


def _histories(
    result: RunResult,
    ax: Axes,
    places: Mapping[str, ProbeHistory] | Mapping[str, SnubberHistory],
    fields: Mapping[str, str],
    label: str,
    unit: str,
    last_part: bool,
    limit: str,
) -> Axes:
    """Draw one field of each of some places, with its limit; displacements with the faces of stops."""
    time, names = result.time, list(fields)[:MOST_CURVES]
    begin, end = _ends(result)
    if last_part:
        begin = _last_part(result)
    first = _first_from(time, begin)
    curves = [thinned(time, getattr(places[name], fields[name]), begin=first) for name in names]
    scale = scale_for(unit, *(x for _, x in curves))
    clock = time_scale()
    for k, (name, (t, x)) in enumerate(zip(names, curves, strict=True)):
        ax.plot(t * clock.factor, x * scale.factor, label=name, **curve_style(k))
    draw_limit(ax, result.scenario.limits, limit, scale, both_signs=limit != "peak_force")
    if limit == "peak_displacement":
        draw_faces(result, ax, scale)
    ax.set_xlim(begin * clock.factor, (end if end > begin else begin + 1.0) * clock.factor)
    finish(ax, f"Time ({clock.unit})", f"{label} ({scale.unit})")
    legend(ax, len(names), len(places), "probes" if places is result.probes else "snubbers")
    return ax


def _ends(result: RunResult) -> tuple[float, float]:
    """First and last output time, s."""
    time = result.time
    return float(time[0]), float(time[-1])


def _first_from(time: Any, begin: float) -> int:
    """Number of the first output time that is not before ``begin``; not all of them are read."""
    return bisect_left(range(time.size), True, key=lambda k: bool(time[k : k + 1][0] >= begin))


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


def _place(result: RunResult, at: str | None) -> SnubberHistory | ProbeHistory:
    if at is not None:
        return result.snubbers[at]
    return next(iter(result.snubbers.values()), None) or next(iter(result.probes.values()))
