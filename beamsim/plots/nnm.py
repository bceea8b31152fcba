"""Pictures of nonlinear normal modes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from beamsim.analyses.nnm.result import NormalModeResult
from beamsim.labelled import Dataset
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
    marks_curve,
)
from beamsim.plots.multiple_scales import FACTOR, expansion_figures
from beamsim.plots.phase_resonance import phase_resonance_figures
from beamsim.plots.stations import draw_along
from beamsim.plots.style import Scale
from beamsim.structures.places import Stations
from beamsim.typing import TINY, Floats

FLOOR = -120.0  # dB, of a spectrum

BRANCH_NAMES = {
    "backbone": "backbone",
    "tongue": "tongue of internal resonance",
    "non_brake": "non-brake orbits",
}
_STYLES = {"backbone": (0, 1.4), "tongue": (1, 1.0), "non_brake": (2, 1.4)}  # colour, width
_NEARBY_MOTIONS = {
    "same": ("o", "near the backbone's motion"),
    "between": ("s", "where a tongue cuts the backbone"),
    "other": ("D", "near another motion"),
    "none": ("x", "near no periodic motion"),
}


def backbone(result: NormalModeResult) -> Chart:
    """Frequency over the stiffness factor, or largest deflection over frequency where energy or frequency changes.

    Unstable pieces are dashed, jumps grey, special points marked, tongues named.
    """
    if result.parameter == "stiffness_factor":
        drawn = [_columns(b, "parameter", "frequency_hz") for b in result.branches]
        return _with_resonance_names(
            result, Chart(("Stiffness factor ε", ""), ("Frequency", HERTZ), _curves(result, drawn), curve_noun="")
        )
    largest = [np.abs(b["initial_displacement"].values).max(axis=1) for b in result.branches]
    log = logarithmic("y", largest[0])
    curves = _curves(result, [(b["frequency_hz"].values, y) for b, y in zip(result.branches, largest, strict=True)])
    x_axis, y_axis = ("Frequency", HERTZ), ("Largest deflection at the extreme", "m")
    return _with_resonance_names(result, Chart(x_axis, y_axis, curves, log=log, curve_noun=""))


def _columns(branch: Dataset, x_name: str, y_name: str) -> tuple[Floats, Floats]:
    return branch[x_name].values, branch[y_name].values


def frequency_energy(result: NormalModeResult) -> Chart:
    """Frequency–energy plot, drawn likewise."""
    curves = _curves(result, [_columns(b, "energy", "frequency_hz") for b in result.branches])
    log = logarithmic("x", result.branches[0]["energy"].values)
    return _with_resonance_names(
        result, Chart(("Energy", Scale(1.0, "J")), ("Frequency", HERTZ), curves, log=log, curve_noun="")
    )


def _jumps(result: NormalModeResult) -> list[tuple[float, float, int, int]]:
    """Start and end of each jump in the parameter, the other mode, and n of n:1."""
    if "jumps" not in result.datasets:
        return []
    columns = (result["jumps"][name].values.tolist() for name in ("start", "end", "mode", "ratio"))
    return list(zip(*columns, strict=True))


def _with_resonance_names(result: NormalModeResult, chart: Chart) -> Chart:
    """The chart with n:m at every resonance, each once: the first curves are the jumps."""
    names: dict[str, tuple[float, float]] = {}
    for (_, _, mode, ratio), curve in zip(_jumps(result), chart.curves, strict=False):
        if ratio and mode:
            names.setdefault(f"{ratio}:1, mode {mode}", (float(curve.x[0]), float(curve.y[0])))
    return chart._replace(names=names)


def _curves(result: NormalModeResult, drawn: Sequence[tuple[Floats, Floats]]) -> list[Curve]:
    """Jumps, then every branch as a curve, the backbone cut at its jumps, with special points.

    Parameters
    ----------
    drawn : for each branch the two quantities at its points.
    """
    parameter = result.branches[0]["parameter"].values
    ends = [[int(np.argmin(np.abs(parameter - p))) for p in jump[:2]] for jump in _jumps(result)]
    grey = {"color": "0.5", "linestyle": "-", "linewidth": 2.6, "alpha": 0.5, "solid_capstyle": "butt", "zorder": 0}
    (x, y), words = drawn[0], "jump over a tongue"
    jumps = [Curve("" if k else words, x[at], y[at], grey) for k, at in enumerate(ends)]
    lines = []
    for branch, (x, y) in zip(result.branches, drawn, strict=True):
        kind = branch["kind"].item()
        main, (colour, width) = kind == "backbone", _STYLES[kind]
        cuts = np.unique([start + 1 for start, _ in ends]).astype(int) if main else np.zeros(0, dtype=int)
        style = {"color": curve_style(colour)["color"], "linewidth": width}
        lines.append(
            BranchLine(BRANCH_NAMES[kind], np.insert(x, cuts, np.nan), np.insert(y, cuts, np.nan),
                       np.insert(branch["stable"].values, cuts, True), style, _special(result, drawn) if main else ())
        )  # fmt: skip
    return [*jumps, *branch_curves(lines)]


def _special(result: NormalModeResult, drawn: Sequence[tuple[Floats, Floats]]) -> list[tuple[str, float, float]]:
    """Special points, each on the branch that it is closest to (some lie on tongues)."""
    span, places = max(float(np.ptp(result.branches[0]["parameter"].values)), TINY), []
    columns = (result["special_points"][name].values.tolist() for name in ("kind", "parameter", "frequency_hz"))
    for kind, parameter, hz in zip(*columns, strict=True):
        off = [
            np.abs(b["frequency_hz"].values / hz - 1.0) + np.abs(b["parameter"].values - parameter) / span
            for b in result.branches
        ]
        which = int(np.argmin([float(o.min()) for o in off])) if kind == "symmetry_breaking" else 0
        x, y = (float(values[np.argmin(off[which])]) for values in drawn[which])
        places.append((kind, x, y))
    return places


def plot_shapes(result: NormalModeResult, ax: Axes, shapes: Sequence[tuple[str, Floats]]) -> None:
    """Deflected shapes (nx,), m, with their names."""
    ax.axhline(0.0, color="0.75", linewidth=0.8, zorder=0)
    draw_along(ax, Stations.of_modes(result["modes"]), "Deflection", [(name, shape, {}) for name, shape in shapes])


def _branch_to_draw(result: NormalModeResult) -> Dataset:
    number: int = result["motion"]["branch"].item()
    return result.branches[number]


def _nodes(result: NormalModeResult) -> list[tuple[str, Floats]]:
    """Deflections of stations to draw, evenly spread up to the last one that moves, with their names."""
    deflection = result["motion"]["deflection"].values
    moving = np.flatnonzero(np.abs(deflection).max(axis=0) > 0)
    count = min(MOST_CURVES, moving.size)
    chosen = moving[(moving.size * np.arange(1, count + 1) / max(count, 1)).round().astype(int) - 1]
    stations = Stations.of_modes(result["modes"])
    return [(stations.name(int(k)), deflection[:, k]) for k in chosen]


def motions(result: NormalModeResult) -> list[Chart]:
    """Displacement of the structure's nodes and contact forces over one period."""
    time, x_axis = result["motion"]["time"].values, ("Time", "s")
    curves = [Curve(name, time, deflection) for name, deflection in _nodes(result)]
    forces = [Curve(name, time, force.values) for name, force in result["motion"].by_label("force").items()]
    pressed = [Chart(x_axis, ("Contact force", "N"), forces, curve_noun="snubbers")] if forces else []
    return [Chart(x_axis, ("Displacement", "m"), curves), *pressed]


def phase_portrait(result: NormalModeResult) -> Chart:
    """Velocity over displacement."""
    displacement, velocity = (result["motion"].by_label(name) for name in ("displacement", "velocity"))
    curves = [Curve(name, x.values, velocity[name].values) for name, x in displacement.items()]
    of = f" of {curves[0].label}" if len(curves) == 1 else ""
    return Chart((f"Displacement{of}", "m"), (f"Velocity{of}", "m/s"), curves, curve_noun="probes")


def configuration(result: NormalModeResult) -> Chart:
    """Displacements over one another: a line for a linear mode, a curve for a nonlinear one, a loop for a non-brake
    orbit. The probes over the first of them; with a single probe the nodes over the one that moves most."""
    motion = result["motion"]
    named = {name: x.values for name, x in motion.by_label("displacement").items()}
    if len(named) > 1:
        x_name = next(iter(named))
    else:
        named = dict(_nodes(result))
        x_name = max(named, key=lambda name: float(np.abs(named[name]).max()))
    others = [name for name in named if name != x_name] or [x_name]
    # a brake orbit retraces its path: drawn twice, its dashes would merge into one line
    part = slice(
        (motion["time"].values.size + 1) // 2 if _branch_to_draw(result)["kind"].item() != "non_brake" else None
    )
    curves = [Curve(name, named[x_name][part], named[name][part]) for name in others]
    y_label = f"Displacement of {others[0]}" if len(others) == 1 else "Displacement"
    return Chart((f"Displacement of {x_name}", "m"), (y_label, "m"), curves)


DRIFT_SHOWN = 1e-6  # relative, over the periods of a spectrum, above which a drift is shown


def orbit_spectrum(result: NormalModeResult) -> Chart:
    """Spectrum over the motion's many periods, in dB of each probe's strongest line."""
    motion = result["motion"]
    f, drift = motion["spectrum_frequency_hz"].values, motion["drift"].item()
    # as far as the harmonics that are stored: beyond them every line is small
    last = int(np.searchsorted(f, 20.5 / float(motion["time"].values[-1])))
    curves = []
    for k, (name, amplitude) in enumerate(motion.by_label("spectrum").items()):
        lines = amplitude.values[:last]
        level = 20.0 * np.log10(np.maximum(lines, TINY) / lines.max())
        marks = {"marker": "os^Dvx"[k % 6], "markersize": 4, "markerfacecolor": "none", "linewidth": 0.6}
        curves.append(Curve(name, f[:last], np.where(level > FLOOR, level, np.nan), marks))
    away = f"; unstable: {100 * drift:.3g} % away at their end" if drift > DRIFT_SHOWN else ""
    legend = f"spectrum over {motion['periods'].item()} periods{away}"
    return Chart(
        ("Frequency", HERTZ),
        ("Amplitude (dB re largest)", ""),
        curves,
        curve_noun="probes",
        y_ends=(FLOOR, 5.0),
        legend=legend,
    )


def _at_rest(result: NormalModeResult) -> list[tuple[str, Floats]]:
    """Shapes at the slowest instant and half a period later, and that of the linear mode, with their names."""
    motion, branch = result["motion"], _branch_to_draw(result)
    least = branch["least_kinetic"].values[motion["branch_point"].item() - 1]
    word = "at rest" if least == 0.0 or branch["kind"].item() == "backbone" else "slowest"
    slowest, later = motion["extreme_shapes"].values
    linear = (f"linear mode {result.summary['mode']}", motion["linear_shape"].values)
    return [(f"{word}, t = 0", slowest), ("t = T/2", later), linear]


def _shapes_within_period(result: NormalModeResult) -> list[tuple[str, Floats]]:
    """Shapes an eighth and three eighths of a period later."""
    deflection = result["motion"]["deflection"].values
    eighth = (deflection.shape[0] - 1) // 8
    return [("t = T/8", deflection[eighth]), ("t = 3T/8", deflection[3 * (deflection.shape[0] - 1) // 8])]


def nnm_figures(result: NormalModeResult) -> dict[str, Picture]:
    """Every picture of a nonlinear mode, by name."""
    of_motion: dict[str, list[Any]] = {
        "mode_shapes": [partial(plot_shapes, result, shapes=_at_rest(result))],
        "deflected_shapes": [partial(plot_shapes, result, shapes=_shapes_within_period(result))],
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
    if "multiple_scales" in result.datasets:
        figures |= expansion_figures(result)
    if "relaxed_minimisation" in result.datasets:
        figures["relaxed_minimisation"] = relaxed_figure(result)
    if "phase_resonance" in result.datasets:
        figures |= phase_resonance_figures(result)
    return figures


def _motion_name(result: NormalModeResult) -> str:
    """Which motion is drawn."""
    branch, k = _branch_to_draw(result), result["motion"]["branch_point"].item() - 1
    names = {"stiffness_factor": "ε = {:.4g}", "energy": "{:.4g} J", "frequency": "{:.6g} Hz"}
    parameter, hz = (branch[name].values[k] for name in ("parameter", "frequency_hz"))
    also = "" if result.parameter == "frequency" else f", {hz:.6g} Hz"
    return f"{BRANCH_NAMES[branch['kind'].item()]}, {names[result.parameter].format(parameter)}{also}"


def relaxed_figure(result: NormalModeResult) -> Picture:
    """Frequency, differences, functional and cost over the stiffness factor."""
    relaxed = result["relaxed_minimisation"]
    factor, functional, motions = (relaxed[name].values for name in ("factor", "functional", "motions"))
    title = f"{result.title}\nrelaxed minimisation (Hazim 2010) and shooting"
    differences = {"frequency": "frequency_difference", "shape at rest": "shape_difference"}
    apart = [
        Curve(text, factor, np.where(relaxed[name].values > 0, relaxed[name].values, np.nan), {"marker": "."})
        for text, name in differences.items()
    ]
    missed = ~relaxed["converged"].values
    ended = [Curve("at the end of a step", factor, functional, {"marker": "."})]
    if missed.any():
        places = np.stack([factor, functional], axis=1)[missed]
        ended.append(marks_curve("not converged", places, marker="x", markersize=7))
    tolerance = Guide("tolerance", relaxed["tolerance"].item(), {"linewidth": 0.9, "linestyle": "--"})
    cost = (
        f"{motions.sum()} motions, {relaxed['processor_time_s'].values.sum():.2g} s; "
        f"shooting {relaxed['shooting_motions'].item()}, {relaxed['shooting_processor_time_s'].item():.2g} s"
    )
    steps = [Curve("", factor, motions.astype(float), {"drawstyle": "steps-mid"})]
    charts = [
        Chart(FACTOR, ("Frequency", HERTZ), list(_relaxed_frequencies(result)), curve_noun=""),
        Chart(FACTOR, ("Difference from shooting", ""), apart, log="y"),
        Chart(FACTOR, ("Functional", ""), ended, [tolerance], log="y"),
        Chart(FACTOR, ("Motions computed in a step", ""), steps, title=cost, y_ends=(0.0, None)),
    ]
    return Picture(title, charts, columns=2, size=(9.0, 6.4), sharex=True)


def _relaxed_frequencies(result: NormalModeResult) -> Iterator[Curve]:
    """Shooting's backbone and tongues, and the steps by the branch that they are nearest to."""
    for k, branch in enumerate(b for b in result.branches if b["kind"].item() != "non_brake"):
        style = {"color": DARK if branch["kind"].item() == "backbone" else "0.6", "linestyle": "-"}
        label = ("shooting", "shooting, tongues", "")[min(k, 2)]
        yield Curve(label, *_columns(branch, "parameter", "frequency_hz"), style)
    relaxed = result["relaxed_minimisation"]
    steps = np.stack(_columns(relaxed, "factor", "frequency_hz"), axis=1)
    for name, (mark, text) in _NEARBY_MOTIONS.items():
        here = relaxed["nearby_motion"].values == name
        if here.any():
            marks = {"marker": mark, "markersize": 3.5, "color": RED, "markerfacecolor": "white"}
            yield marks_curve(f"relaxed, {text}", steps[here], **marks)
