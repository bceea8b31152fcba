"""Pictures of deflected bodies: beams along their axes, plates from above, several bodies from the side."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from beamsim.analyses.run.result import RunResult
from beamsim.labelled import Dataset
from beamsim.plots.drawing import DARK, MOST_PANELS, RED, Chart, Curve, Guide, Picture, marks_curve
from beamsim.plots.sketch import HEIGHT, Sketch, scale_bar
from beamsim.plots.style import Scale, amount, round_length, scale_for
from beamsim.structures.assembly import snubber_site
from beamsim.structures.places import Place, Stations
from beamsim.system.structural import SnubberNumbers
from beamsim.typing import Floats

BELOW = ("below", "approach")  # sides of stops that resist negative displacements
NO_MOTION = 1e-9  # of a stop, over the motion of the structure at it: less is round-off
LEVELS = MaxNLocator(12, symmetric=True)  # of a deflection, round numbers


def stops_of(result: RunResult) -> dict[str, SnubberNumbers]:
    """By name the numbers of the snubbers of a run."""
    histories = result["histories"]
    forces = histories.by_label("snubber_force")
    described = (
        [each.name for each in fields(SnubberNumbers) if each.name not in ("name", "gap_unit")] if forces else []
    )
    rows = zip(*(histories[f"snubber_{each}"].values.tolist() for each in described), strict=True)
    return {
        name: SnubberNumbers(
            **dict(zip(described, row, strict=True)), name=name, gap_unit="rad" if force.unit == "N m" else "m"
        )
        for (name, force), row in zip(forces.items(), rows, strict=True)
    }


def mounting_motion(result: RunResult, stop: SnubberNumbers) -> Floats | None:
    """How a stop moves relative to the base: with a support, by itself, or as it stays on the ground of a moving base.

    Parameters
    ----------
    result : of the run.
    stop : one of its stops.

    Returns
    -------
    (nt,) m or rad, at the output times; None of a stop that moves with the base.
    """
    w, penetration = (
        result["histories"][f"snubber_{of}"].sel(snubber=stop.name).values for of in ("displacement", "penetration")
    )
    beyond = penetration + stop.gap
    moved = np.asarray(w + beyond if stop.side in BELOW else w - beyond)
    still = not math.isfinite(stop.gap) or np.ptp(moved) <= NO_MOTION * max(float(np.ptp(w)), abs(stop.gap))
    return None if still else moved


def deflected_shapes(result: RunResult, name: str) -> Chart:
    """Static shape of a beam, its shapes at the extremes of the first probe, the snubbers where they are then."""
    bodies = result["bodies"].groups("station_body")
    beam, position = bodies[name], bodies[name]["position"].values
    snubbers = [s for s in stops_of(result).values() if s.gap_unit == "m"]
    if len(result["modes"].labels("body")) > 1:  # those that stand on the base or the ground, at this body
        sites = {located.item.name: snubber_site(located) for located in result.scenario.located_snubbers}
        snubbers = [s for s in snubbers if isinstance(site := sites[s.name], Place) and site.body == name]
    curves = [Curve(label, position, y, {"color": DARK}) for y, label in _shapes(result, beam)]
    marks: list[Curve] = []
    time = result["histories"]["time"].values
    for s in snubbers:
        moved = mounting_motion(result, s)
        shapes = [("at rest", np.nan_to_num(beam["static_shape"]), 0.0)]
        if moved is not None:
            instants = zip(beam["extreme_time"].values, beam["extreme_shape"].values, strict=True)
            shapes += [("then", shape, float(np.interp(t, time, moved))) for t, shape in instants if np.isfinite(t)]
        marks += [stop_mark(s, float(np.interp(s.position, position, y)), at, when, marks) for when, y, at in shapes]
    of = name if len(bodies) > 1 else "the beam"
    scale = deflection_scale(beam["extreme_shape"].values, marks)
    rest = Guide("", 0.0, {"color": "0.6", "linewidth": 0.7, "zorder": 1})
    x_axis, y_axis = (f"Position along {of}", "m"), ("Relative deflection", scale)
    return Chart(x_axis, y_axis, curves, [rest], marks=marks)


def deflection_scale(shapes: Floats, marks: Sequence[Curve]) -> Scale:
    """Scale of deflections, m, that are drawn with the faces of stops."""
    return scale_for("m", shapes, np.array([mark.y for mark in marks]))


def stop_mark(stop: SnubberNumbers, deflection: float, stand: float, when: str, others: Sequence[Curve]) -> Curve:
    """The face of a stop at a beam: it follows the beam until it is free.

    Parameters
    ----------
    stop : with its gap and side.
    deflection : m, of the beam there.
    stand : m, motion of the stop's mounting.
    when : end of its label.
    others : marks that are drawn before; a label is written once.
    """
    side = -1.0 if stop.side == "below" else 1.0
    free = stand + side * stop.gap
    shut = side * (deflection - free) >= 0.0
    label = f"snubber, {'closed' if shut else 'open'} {when}".rstrip()
    triangle = {"marker": 6 if side < 0.0 else 7, "markersize": 11, "color": RED, "clip_on": False,
                "markerfacecolor": RED if shut else "white"}  # fmt: skip
    face = (stop.position, deflection if shut else free)  # which is the tip of the triangle
    return marks_curve("" if label in [mark.label for mark in others] else label, face, **triangle)


def plot_contours(ax: Axes, x: Floats, y: Floats, shape: Floats, title: str, unit: str = "") -> None:
    """A deflection at the nodes of a plate; zero is in the middle of the colours, and a thick line.

    Parameters
    ----------
    ax : to draw on.
    x, y : (n,) m, of the nodes, which form a grid.
    shape : (n,) the deflection there.
    title : of the panel.
    unit : of the deflection, for a bar of colours; none where empty.
    """
    metres = scale_for("m", x, y)
    x_values, y_values = np.unique(x), np.unique(y)
    seen = (
        x_values * metres.factor,
        y_values * metres.factor,
        shape[np.lexsort((x, y))].reshape(y_values.size, x_values.size),
    )
    largest = float(np.abs(shape).max()) or 1.0
    levels = np.asarray(LEVELS.tick_values(-largest, largest))
    drawn = ax.contourf(*seen, levels=levels, cmap="RdBu_r", extend="both")
    ax.contour(*seen, levels=levels, colors="0.2", linewidths=np.where(levels == 0.0, 1.4, 0.5))  # dashed below zero
    if unit:
        ax.figure.colorbar(drawn, ax=ax, label=f"Relative deflection ({unit})")
    ax.set_aspect("equal")
    ax.set_xlabel(f"x ({metres.unit})")
    ax.set_ylabel(f"y ({metres.unit})")
    ax.set_title(title, fontsize="medium", loc="left")


def plot_plate_mode(modes: Dataset, ax: Axes, body: str, number: int) -> None:
    """A mode shape of the open structure on a plate, by its number from 1; a line of no deflection is thick.

    Parameters
    ----------
    modes : with their shapes.
    ax : to draw on.
    body : name of the plate.
    number : of the mode, from 1.
    """
    stations = Stations.of_modes(modes)
    on = next(part for part in stations.bodies if part.body == body).stations
    assert stations.position_y is not None
    title = f"mode {number}, {modes['open_frequencies_hz'].values[number - 1]:.4g} Hz"
    plot_contours(ax, stations.position[on], stations.position_y[on], modes["shapes"].values[number - 1, on], title)


def plot_plate_deflection(result: RunResult, ax: Axes, plate: Dataset, shape: Floats, title: str) -> None:
    """A deflection of a plate, with the snubbers on it.

    Parameters
    ----------
    result : of the run.
    ax : to draw on.
    plate : what is known along it.
    shape : (nx,) m, of the plate.
    title : of the panel.
    """
    x, y = plate["position"].values, plate["position_y"].values
    metres, scale = scale_for("m", x, y), scale_for("m", shape)
    plot_contours(ax, x, y, shape * scale.factor, title, scale.unit)
    snubber_y = result["histories"].by_label("snubber_position_y")
    for name, snubber in stops_of(result).items():
        if name in snubber_y and np.isfinite(snubber_y[name].item()):
            ax.plot(
                snubber.position * metres.factor, snubber_y[name].item() * metres.factor, linestyle="none",
                color="black", marker=6 if snubber.side == "below" else 7, markersize=9, clip_on=False,
                label=f"snubber {snubber.side}",
            )  # fmt: skip


def _shapes(result: RunResult, body: Dataset) -> list[tuple[Floats, str]]:
    """When the first probe is highest and lowest, and at static equilibrium; with titles."""
    first = next(iter(result["histories"].labels("probe")), "")
    extreme, times = body["extreme_shape"].values, body["extreme_time"].values
    shapes = [
        (extreme[1], f"{first} highest, t = {times[1]:.4g} s"),
        (extreme[0], f"{first} lowest, t = {times[0]:.4g} s"),
        (body["static_shape"].values, "static equilibrium"),
    ]
    return [each for each in shapes if np.all(np.isfinite(each[0]))]


def _sketch(result: RunResult) -> Sketch:
    return Sketch(result.scenario, Stations.of_modes(result["modes"]), stops_of(result))


def plot_assembly_mode(result: RunResult, ax: Axes, number: int) -> None:
    """A mode of the open structure, by its number from 1; stops are at the bodies at rest, as modes have no size.

    Parameters
    ----------
    result : of the run.
    ax : to draw on.
    number : of the mode, from 1.
    """
    modes = result["modes"]
    shape = modes["shapes"].sel(mode=number).values
    _sketch(result).draw(ax, shape * HEIGHT / (float(np.abs(shape).max()) or 1.0))
    ax.set_title(
        f"mode {number}, {modes['open_frequencies_hz'].sel(mode=number).item():.4g} Hz", fontsize="medium", loc="left"
    )


def plot_assembly_contact(result: RunResult, ax: Axes) -> None:
    """The deflection relative to the base when the contact force is largest; openings of stops to the same scale."""
    contact, stops = result["contact"], stops_of(result)
    shape = contact["deflection"].values
    known = {name: opening.item() for name, opening in contact.by_label("opening").items()}
    openings = {name: known.get(name, s.gap) for name, s in stops.items() if s.gap_unit == "m"}
    largest = max(float(np.abs(shape).max()), *(x for x in openings.values() if math.isfinite(x)), 0.0) or 1.0
    factor, bar = HEIGHT / largest, round_length(largest)
    _sketch(result).draw(ax, shape * factor, factor, openings=known)
    ax.set_title(_largest_contact_text(contact), fontsize="medium", loc="left")
    scale_bar(ax, ax.get_xlim()[1], bar * factor, amount(bar, "m"))


def body_figures(result: RunResult) -> dict[str, Picture]:
    """Deflections of every body, mode shapes of plates and of several bodies, by the last part of the file name."""
    figures: dict[str, Picture] = {}
    bodies = result["bodies"].groups("station_body") if "bodies" in result.datasets else {}
    plates = {name: b for name, b in bodies.items() if "position_y" in b and np.isfinite(b["position_y"]).all()}
    if beams := [name for name in bodies if name not in plates]:
        figures["deflected_shapes"] = Picture(result.title, [deflected_shapes(result, name) for name in beams])
    for name, plate in plates.items():
        of_plate = plate_figures(result, name, plate)
        figures |= {what if len(bodies) == 1 else f"{what}_{name}": picture for what, picture in of_plate.items()}
    if "shapes_in_space" in result["modes"] and (in_space := _space_figures(result)):
        figures |= in_space
    elif len(result["modes"].labels("body")) > 1:
        figures |= assembly_figures(result)
    return figures


def _space_figures(result: RunResult) -> dict[str, Picture]:
    """Modes and the deflection at the largest contact force in space; empty if a body has no coordinates."""
    from beamsim.plots.space import SpaceView, deflected_picture, space_modes

    view = SpaceView.of(result.scenario, Stations.of_modes(result["modes"]), stops_of(result))
    if view is None:
        return {}
    figures = {"space_modes": space_modes(view, result["modes"], result.title)}
    if "contact" in result.datasets and "deflection_in_space" in result["contact"]:
        contact = result["contact"]
        touching = [name for name, opening in contact.by_label("opening").items() if opening.item() <= 0.0]
        words = result.title, _largest_contact_text(contact)
        figures["space_contact"] = deflected_picture(view, contact["deflection_in_space"].values, touching, words)
    return figures


def _largest_contact_text(contact: Dataset) -> str:
    """The largest contact force of a run with its place and time."""
    at = contact.labels("snubber")[contact["contact_snubber"].item()]
    return f"largest contact force, {amount(contact['force'].item(), 'N')} at {at}, t = {contact['time'].item():.4g} s"


ROUND_OFF = 1e-9  # of the largest deflection of a plate: less is drawn as none


def plate_figures(result: RunResult, name: str, plate: Dataset) -> dict[str, Picture]:
    """Deflections of a plate, where it has any, and its mode shapes.

    Parameters
    ----------
    result : of the run.
    name, plate : of the body, and its dataset.
    """
    figures: dict[str, Picture] = {}
    least = ROUND_OFF * float(np.nanmax(np.abs(plate["extreme_shape"]), initial=0.0))
    shapes = [
        partial(plot_plate_deflection, result, plate=plate, shape=shape, title=title)
        for shape, title in _shapes(result, plate)
        if np.abs(shape).max() > least
    ]
    if shapes:
        figures["plate_deflections"] = Picture(result.title, shapes, columns=2, legend_below=True)
    count = min(MOST_PANELS, len(result["modes"]["mode"].values))
    modes = [partial(plot_plate_mode, result["modes"], body=name, number=k + 1) for k in range(count)]
    return figures | {"plate_modes": Picture(result.title, modes, columns=2)}


def assembly_figures(result: RunResult) -> dict[str, Picture]:
    """Mode shapes of several bodies, and their deflection at the largest contact force."""
    rows, count = _sketch(result).count, min(MOST_PANELS, len(result["modes"]["mode"].values))
    drawn = [partial(plot_assembly_mode, result, number=k + 1) for k in range(count)]
    size = (8.0, 0.8 + -(-count // 2) * (1.0 + 0.7 * rows))
    figures = {"assembly_modes": Picture(result.title, drawn, columns=2, size=size, legend_below=True)}
    if "contact" in result.datasets:
        plots, size = [partial(plot_assembly_contact, result)], (8.0, 1.6 + 1.4 * rows)
        figures["assembly_contact"] = Picture(result.title, plots, size=size, legend_below=True)
    return figures
