"""Pictures of nonlinear normal modes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from beamsim.analyses.nnm.result import NormalModeResult, RelaxedComparison
from beamsim.plots.branches import BranchLine, branch_curves
from beamsim.plots.drawing import (
    DARK,
    HERTZ,
    MOST_CURVES,
    RED,
    Chart,
    Curve,
    Guide,
    Picture,
    curve_style,
    logarithmic,
    marked,
)
from beamsim.plots.multiple_scales import FACTOR, expansion_figures
from beamsim.plots.phase_resonance import phase_resonance_figures
from beamsim.plots.stations import draw_along
from beamsim.plots.style import Scale
from beamsim.results.branch import ModeBranch
from beamsim.structures.places import Stations
from beamsim.typing import Floats

FLOOR = -120.0  # dB, of a spectrum

BRANCH_NAMES = {
    "backbone": "backbone",
    "tongue": "tongue of internal resonance",
    "non_brake": "non-brake orbits",
}
_STYLES = {"backbone": (0, 1.4), "tongue": (1, 1.0), "non_brake": (2, 1.4)}  # colour, width
_FATES = {
    "same": ("o", "near the backbone's motion"),
    "between": ("s", "where a tongue cuts the backbone"),
    "other": ("D", "near another motion"),
    "none": ("x", "near no periodic motion"),
}


def backbone(result: NormalModeResult) -> Chart:
    """Frequency over the stiffness factor, or largest deflection over frequency where energy or frequency changes.

    Unstable stretches are dashed, jumps grey, special points marked, tongues named.
    """
    if result.parameter == "stiffness_factor":
        drawn = [(b.parameter, b.frequency_hz) for b in result.branches]
        return _named(result, Chart(("Stiffness factor ε", ""), ("Frequency", HERTZ), _curves(result, drawn), of=""))
    largest = [np.abs(b.initial_displacement).max(axis=1) for b in result.branches]
    log = logarithmic("y", largest[0])
    curves = _curves(result, [(b.frequency_hz, y) for b, y in zip(result.branches, largest, strict=True)])
    across, up = ("Frequency", HERTZ), ("Largest deflection at the extreme", "m")
    return _named(result, Chart(across, up, curves, log=log, of=""))


def frequency_energy(result: NormalModeResult) -> Chart:
    """Frequency–energy plot, drawn likewise."""
    energy = result.backbone.energy
    curves = _curves(result, [(b.energy, b.frequency_hz) for b in result.branches])
    log = logarithmic("x", energy)
    return _named(result, Chart(("Energy", Scale(1.0, "J")), ("Frequency", HERTZ), curves, log=log, of=""))


def _named(result: NormalModeResult, chart: Chart) -> Chart:
    """The chart with n:m beside every resonance, each once: the first curves are the jumps."""
    names: dict[str, tuple[float, float]] = {}
    for jump, curve in zip(result.jumps, chart.curves, strict=False):
        if jump.ratio and jump.mode:
            names.setdefault(f"{jump.ratio}:1, mode {jump.mode}", (float(curve.x[0]), float(curve.y[0])))
    return chart._replace(names=names)


def _at(branch: ModeBranch, parameter: float) -> int:
    """The point of a branch closest to a parameter."""
    return int(np.argmin(np.abs(branch.parameter - parameter)))


def _curves(result: NormalModeResult, drawn: Sequence[tuple[Floats, Floats]]) -> list[Curve]:
    """Jumps, then every branch as a curve, the backbone cut at its jumps, with special points.

    Parameters
    ----------
    drawn : for each branch the two quantities at its points.
    """
    ends = [[_at(result.backbone, p) for p in (jump.start, jump.end)] for jump in result.jumps]
    grey = {"color": "0.5", "linestyle": "-", "linewidth": 2.6, "alpha": 0.5, "solid_capstyle": "butt", "zorder": 0}
    (x, y), words = drawn[0], "jump over a tongue"
    jumps = [Curve("" if k else words, x[at], y[at], grey) for k, at in enumerate(ends)]
    lines = []
    for branch, (x, y) in zip(result.branches, drawn, strict=True):
        main, (colour, width) = branch.kind == "backbone", _STYLES[branch.kind]
        cuts = np.unique([start + 1 for start, _ in ends]).astype(int) if main else np.zeros(0, dtype=int)
        style = {"color": curve_style(colour)["color"], "linewidth": width}
        lines.append(
            BranchLine(BRANCH_NAMES[branch.kind], np.insert(x, cuts, np.nan), np.insert(y, cuts, np.nan),
                       np.insert(branch.stable, cuts, True), style, _special(result, drawn) if main else ())
        )  # fmt: skip
    return [*jumps, *branch_curves(lines)]


def _special(result: NormalModeResult, drawn: Sequence[tuple[Floats, Floats]]) -> list[tuple[str, float, float]]:
    """Special points, each on the branch that it is closest to (some lie on tongues)."""
    span, places = max(float(np.ptp(result.backbone.parameter)), 1e-300), []
    for event in result.backbone.special:
        off = [
            np.abs(b.frequency_hz / event.frequency_hz - 1.0) + np.abs(b.parameter - event.parameter) / span
            for b in result.branches
        ]
        which = int(np.argmin([float(o.min()) for o in off])) if event.kind == "symmetry_breaking" else 0
        x, y = (float(values[np.argmin(off[which])]) for values in drawn[which])
        places.append((event.kind, x, y))
    return places


def plot_shapes(result: NormalModeResult, ax: Axes, shapes: Sequence[tuple[str, Floats]]) -> None:
    """Deflected shapes (nx,), m, with their names."""
    ax.axhline(0.0, color="0.75", linewidth=0.8, zorder=0)
    draw_along(ax, Stations.of_modes(result["modes"]), "Deflection", [(name, shape, {}) for name, shape in shapes])


def _shown_branch(result: NormalModeResult) -> ModeBranch:
    return result.branches[result.motion_branch]


def _nodes(result: NormalModeResult) -> list[tuple[int, str]]:
    """Stations to draw, evenly spread up to the last one that moves, with their names."""
    moving = np.flatnonzero(np.abs(result.motion.stations).max(axis=0) > 0)
    count = min(MOST_CURVES, moving.size)
    chosen = moving[(moving.size * np.arange(1, count + 1) / max(count, 1)).round().astype(int) - 1]
    stations = Stations.of_modes(result["modes"])
    return [(int(k), stations.name(int(k))) for k in chosen]


def motions(result: NormalModeResult) -> list[Chart]:
    """Displacement of the structure's nodes and contact forces over one period."""
    motion, across = result.motion, ("Time", "s")
    curves = [Curve(name, motion.time, motion.stations[:, at]) for at, name in _nodes(result)]
    forces = [Curve(name, motion.time, force) for name, force in motion.force.items()]
    pressed = [Chart(across, ("Contact force", "N"), forces, of="snubbers")] if forces else []
    return [Chart(across, ("Displacement", "m"), curves), *pressed]


def phase_portrait(result: NormalModeResult) -> Chart:
    """Velocity over displacement."""
    motion = result.motion
    curves = [Curve(name, x, motion.velocity[name]) for name, x in motion.displacement.items()]
    of = f" of {curves[0].label}" if len(curves) == 1 else ""
    return Chart((f"Displacement{of}", "m"), (f"Velocity{of}", "m/s"), curves, of="probes")


def configuration(result: NormalModeResult) -> Chart:
    """Displacements over one another: a line for a linear mode, a curve for a nonlinear one, a loop for a non-brake
    orbit. The probes over the first of them; with a single probe the nodes over the one that moves most."""
    motion = result.motion
    if len(motion.displacement) > 1:
        named = dict(motion.displacement)
        across = next(iter(named))
    else:
        named = {name: motion.stations[:, at] for at, name in _nodes(result)}
        across = max(named, key=lambda name: float(np.abs(named[name]).max()))
    others = [name for name in named if name != across] or [across]
    # a brake orbit retraces its path: drawn twice, its dashes would merge into one line
    part = slice((motion.time.size + 1) // 2 if _shown_branch(result).kind != "non_brake" else None)
    curves = [Curve(name, named[across][part], named[name][part]) for name in others]
    up = f"Displacement of {others[0]}" if len(others) == 1 else "Displacement"
    return Chart((f"Displacement of {across}", "m"), (up, "m"), curves)


def orbit_spectrum(result: NormalModeResult) -> Chart:
    """Spectrum over the motion's many periods, in dB of each probe's strongest line."""
    motion, f = result.motion, result.motion.spectrum_frequency_hz
    # as far as the harmonics that are stored: beyond them every line is small
    last = int(np.searchsorted(f, 20.5 / float(motion.time[-1])))
    curves = []
    for k, (name, amplitude) in enumerate(motion.spectrum.items()):
        level = 20.0 * np.log10(np.maximum(amplitude[:last], 1e-300) / amplitude[:last].max())
        marks = {"marker": "os^Dvx"[k % 6], "markersize": 4, "markerfacecolor": "none", "linewidth": 0.6}
        curves.append(Curve(name, f[:last], np.where(level > FLOOR, level, np.nan), marks))
    # a drift over the periods of the spectrum above 1e-6 is shown
    drift = f"; unstable: {100 * motion.drift:.3g} % away at their end" if motion.drift > 1e-6 else ""
    said = f"spectrum over {motion.periods} periods{drift}"
    return Chart(
        ("Frequency", HERTZ), ("Amplitude (dB re largest)", ""), curves, of="probes", y_ends=(FLOOR, 5.0), legend=said
    )


def nnm_figures(result: NormalModeResult) -> dict[str, Picture]:
    """Every picture of a nonlinear mode, by name."""
    branch, motion = _shown_branch(result), result.motion
    word = "at rest" if branch.least_kinetic[result.motion_point] == 0.0 or branch.kind == "backbone" else "slowest"
    at_rest = [*zip((f"{word}, t = 0", "t = T/2"), motion.at_rest, strict=True)]
    at_rest.append((f"linear mode {result.mode}", result.linear_shape))
    underway = list(zip(("t = T/8", "t = 3T/8"), motion.underway, strict=True))
    of_motion: dict[str, list[Any]] = {
        "mode_shapes": [partial(plot_shapes, result, shapes=at_rest)],
        "deflected_shapes": [partial(plot_shapes, result, shapes=underway)],
        "motion": motions(result),
        "phase_portrait": [phase_portrait(result)],
        "configuration": [configuration(result)],
        "spectrum": [orbit_spectrum(result)],
    }
    figures = {"backbone": Picture(result.title, [backbone(result)])}
    title = f"{result.title}\n{_motion_name(result)}"
    figures |= {name: Picture(title, panels, sharex=True) for name, panels in of_motion.items()}
    if result.parameter != "stiffness_factor":
        figures["frequency_energy"] = Picture(result.title, [frequency_energy(result)])
    if result.expansion is not None:
        figures |= expansion_figures(result)
    if result.relaxed is not None:
        figures["relaxed_minimisation"] = relaxed_figure(result)
    if result.phase_resonance is not None:
        figures |= phase_resonance_figures(result.phase_resonance, result.title, Stations.of_modes(result["modes"]))
    return figures


def _motion_name(result: NormalModeResult) -> str:
    """Which motion is drawn."""
    branch, k = _shown_branch(result), result.motion_point
    names = {"stiffness_factor": "ε = {:.4g}", "energy": "{:.4g} J", "frequency": "{:.6g} Hz"}
    at = names[result.parameter].format(branch.parameter[k])
    also = "" if result.parameter == "frequency" else f", {branch.frequency_hz[k]:.6g} Hz"
    return f"{BRANCH_NAMES[branch.kind]}, {at}{also}"


def relaxed_figure(result: NormalModeResult) -> Picture:
    """Frequency, differences, functional and cost over the stiffness factor."""
    assert result.relaxed is not None
    relaxed = result.relaxed
    title = f"{result.title}\nrelaxed minimisation (Hazim 2010) and shooting"
    differences = (("frequency", relaxed.frequency_difference), ("shape at rest", relaxed.shape_difference))
    apart = [Curve(text, relaxed.factor, np.where(y > 0, y, np.nan), {"marker": "."}) for text, y in differences]
    missed = ~relaxed.reached
    functional = [Curve("at the end of a step", relaxed.factor, relaxed.functional, {"marker": "."})]
    if missed.any():
        places = np.stack([relaxed.factor, relaxed.functional], axis=1)[missed]
        functional.append(marked("not reached", places, marker="x", markersize=7))
    tolerance = Guide("tolerance", relaxed.tolerance, {"linewidth": 0.9, "linestyle": "--"})
    cost = (
        f"{relaxed.passages.sum()} motions, {relaxed.processor_time_s.sum():.2g} s; "
        f"shooting {relaxed.shooting_passages}, {relaxed.shooting_processor_time_s:.2g} s"
    )
    steps = [Curve("", relaxed.factor, relaxed.passages.astype(float), {"drawstyle": "steps-mid"})]
    charts = [
        Chart(FACTOR, ("Frequency", HERTZ), list(_relaxed_frequencies(result, relaxed)), of=""),
        Chart(FACTOR, ("Difference from shooting", ""), apart, log="y"),
        Chart(FACTOR, ("Functional", ""), functional, [tolerance], log="y"),
        Chart(FACTOR, ("Motions computed in a step", ""), steps, title=cost, y_ends=(0.0, None)),
    ]
    return Picture(title, charts, columns=2, size=(9.0, 6.4), sharex=True)


def _relaxed_frequencies(result: NormalModeResult, relaxed: RelaxedComparison) -> Iterator[Curve]:
    """Shooting's backbone and tongues, and the steps by what they are beside."""
    for k, branch in enumerate(b for b in result.branches if b.kind != "non_brake"):
        style = {"color": DARK if branch.kind == "backbone" else "0.6", "linestyle": "-"}
        yield Curve(("shooting", "shooting, tongues", "")[min(k, 2)], branch.parameter, branch.frequency_hz, style)
    steps = np.stack([relaxed.factor, relaxed.frequency_hz], axis=1)
    for fate, (mark, text) in _FATES.items():
        here = np.array([f == fate for f in relaxed.fate], dtype=bool)
        if here.any():
            marks = {"marker": mark, "markersize": 3.5, "color": RED, "markerfacecolor": "white"}
            yield marked(f"relaxed, {text}", steps[here], **marks)
