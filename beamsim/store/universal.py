"""Universal files: functions of time and frequency of a result of any kind, nodes, lines and mode shapes.

The data sets are 151 (header), 164 (units), 15 (nodes), 82 (lines), 55 (modes) and 58 (functions).

Nodes are the probes of the scenario, then its snubbers, then the base of a run (at the origin), then the stations of
the structure at which its modes are stored; x is the position along the beam or on the plate (the number of the mass in
a chain), y that on the plate, and motion is along +z. Bodies have no positions relative to each other: of several, each
lies above the one before, at a tenth of the longest. The force of a snubber above the structure is along -z. Amplitude
spectra are of function type 0 (general), because pyuff does not write type 12 (spectrum).

Imported bodies keep the numbers of their nodes, and those of the others follow; their modes are in the direction of
their base, those of frames along x, y and z, with lines along the members. A second body with the same numbers has its
own raised by a power of ten. Nodes that the table gives no coordinates are in no data set 15, and the header names
their bodies.
"""

from __future__ import annotations

import errno
import json
import os
import warnings
from collections.abc import Iterator, Sequence
from datetime import datetime
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from beamsim.dofs import DIRECTIONS
from beamsim.files import open_input, replacement_file
from beamsim.labelled import NAMES, OF_EACH, Dataset, Item, Items, absent_in, last, parent, part_of
from beamsim.scenario import Scenario
from beamsim.scenario.connections import HingeElement
from beamsim.structures.places import DEFLECTION, NODES, Stations
from beamsim.system.structural import MODES
from beamsim.typing import Floats, Ints

Coordinates = tuple[float, float, float]  # m

ORDERS = ("order", "harmonic")
"""Dimensions along which the functions of a variable are those of one harmonic after the other."""

OF_CHANNELS = {
    "/predicted_spectra/amplitude": ("/channels", "predicted spectrum"),
    "/measured_spectra/amplitude": ("/channels", "measured spectrum"),
    "/predicted_histories/history": ("/channels", "predicted"),
    "/measured_histories/history": ("/channels", "measured"),
}
"""Variables whose quantity is that of a channel, with the dataset of these and words for the label."""


class RowOwner(NamedTuple):
    """A branch, level or other member of a result to which rows of a table belong."""

    kind_name: str
    number: int = 0


_AXES = {"x": 1, "y": 2, "z": 3, "rx": 4, "ry": 5, "rz": 6}  # by direction of a motion of the base
_STATISTICS = ("peak_", "max_", "min_", "rms_", "mean_", "harmonic_")


def records_of(items: Items, result: Any) -> list[dict[str, Any]]:
    """The nodes, and records 58 of all functions of time or frequency at probes and snubbers.

    Parameters
    ----------
    items : of a result of any kind.
    result : the result itself; its scenario gives the positions.
    """
    import pyuff

    stations = _stations(result)
    heights = _heights(stations)
    placed = _placed(stations, heights)
    nodes = _nodes(result.scenario, stations, placed, heights)
    upside_down = {s.name for s in result.scenario.all_snubbers if getattr(s, "side", "") == "above"}
    if "/histories/base_acceleration" in items:
        nodes["base", "base"] = (0.0, 0.0, 0.0)
    own = _own_numbers(stations)
    first = 1 + max((int(numbers.max(initial=0)) for numbers in own.values()), default=0)
    root = items["/"].attributes
    source = Source(result.title, result.created, f"beamsim {root['beamsim_version']} {root['command']}")
    records = []
    for kind, name, function in _functions(items):
        place = (kind, "base") if kind == "base" else (kind, name)
        if place in nodes and function.x.size > 1:
            node = list(nodes).index(place) + first
            turned = function.quantity == "force" and name in upside_down
            axis = _AXES.get(name.partition(" ")[0], 3) if kind == "base" else 3
            records.append(record_58(source, function, name, node, -axis if turned else axis))
    if not records:
        return []
    number = first + len(nodes) + np.arange(stations.position.size)
    for part in stations.bodies:
        number[part.stations] = own.get(part.body, number[part.stations])
    points = np.concatenate([np.array([*nodes.values()], dtype=float).reshape(-1, 3), placed])
    numbers = np.concatenate([first + np.arange(len(nodes)), number])
    known = np.all(np.isfinite(points), axis=1)
    x, y, z = points[known].T
    of_nodes = pyuff.prepare_15(node_nums=numbers[known], x=x, y=y, z=z)
    nowhere = bodies_without_places(result)
    remark = f"nodes without coordinates: {', '.join(nowhere)}" if nowhere else ""
    shapes = [] if not stations.position.size else _mode_shapes(result, placed, number, source)
    return [header_151(source, remark), of_nodes, *shapes, *records]


def bodies_without_places(result: Any) -> list[str]:
    """Names of the imported bodies of whose nodes some have no coordinates, so that other programs cannot draw them."""
    stations = _stations(result)
    placed = _placed(stations, _heights(stations))
    lacking = [part.body for part in stations.bodies if not np.all(np.isfinite(placed[part.stations]))]
    return lacking if len(stations.bodies) > 1 else list(result.scenario.all_bodies)[: len(lacking)]


def _stations(result: Any) -> Stations:
    """Stations at which the mode shapes of a result are stored."""
    return Stations.of_modes(result["modes"]) if MODES in result.DATASETS else Stations.of_recoveries(())


def _heights(stations: Stations) -> dict[str, float]:
    """By body the z of its nodes, m; of imported bodies what is added to it."""
    on_axes = [stations.position[part.stations] for part in stations.bodies if part.axis.continuous]
    lengths = [np.ptp(x) for x in on_axes if x.size]
    if stations.points is not None:
        lengths += [np.ptp(of[np.isfinite(of)]) for of in stations.points.T if np.any(np.isfinite(of))]
    # 0.1: distance between bodies, of the longest
    return {part.body: 0.1 * max(lengths, default=1.0) * k for k, part in enumerate(stations.bodies)}


def _placed(stations: Stations, heights: dict[str, float]) -> Floats:
    """(nx, 3) coordinates of the stations of the modes, m; NaN for nodes of imported bodies that have none."""
    y = np.zeros(stations.position.size) if stations.position_y is None else np.nan_to_num(stations.position_y)
    placed = np.stack([stations.position, y, np.zeros(y.size)], axis=1)
    for part in stations.bodies:
        if part.axis is NODES:
            placed[part.stations] = np.nan if stations.points is None else stations.points[part.stations]
        placed[part.stations, 2] += heights[part.body]
    return placed


def _nodes(
    scenario: Scenario, stations: Stations, coordinates: Floats, heights: dict[str, float]
) -> dict[tuple[str, str], Coordinates]:
    """Coordinates of every probe and snubber, NaN where a table has none; the first place of a snubber between two.

    They are the position along the body, or the number of the mass, and y on a plate.
    """
    several = len(stations.bodies) > 1
    imported = {
        part.body if several else "": dict(
            zip(stations.position[part.stations].astype(int).tolist(), coordinates[part.stations].tolist(), strict=True)
        )
        for part in stations.bodies
        if part.axis is NODES
    }
    located: list[tuple[str, Any, str]] = [("probe", p, scenario.default_body) for p in scenario.effective_probes]
    snubbers = scenario.located_snubbers  # those of hinges have no function of a universal file
    located += [("snubber", each.item, each.body) for each in snubbers if not isinstance(each.item, HingeElement)]
    nodes = {}
    for kind, item, default in located:
        place = getattr(item, "probed_places", item.places)[0]
        body = place.body or default
        of_table = imported.get(body if several else "")
        in_space = scenario.all_bodies[body].coordinates_of(place)
        if in_space is not None:
            x, y, z = in_space
            z += heights.get(body, 0.0)
        elif of_table is not None:
            x, y, z = of_table.get(place.node or 0, (np.nan,) * 3)
        else:
            point = scenario.all_bodies[body].point_of(place)
            x, y = point if isinstance(point, tuple) else (point, 0.0)
            z = heights.get(place.body or "", 0.0)
        nodes[kind, item.name] = (float(x), float(y), float(z))
    return nodes


def _own_numbers(stations: Stations) -> dict[str, Ints]:
    """By imported body the numbers of its nodes; raised by a power of ten where another has the same."""
    own: dict[str, Ints] = {}
    for k, part in enumerate(part for part in stations.bodies if part.axis is NODES):
        numbers = stations.position[part.stations].astype(np.int64)
        if any(np.any(np.isin(numbers, other)) for other in own.values()):
            numbers = numbers + k * 10 ** len(str(int(max(np.max(stations.position), 1))))
        own[part.body] = numbers
    return own


def _mode_shapes(result: Any, coordinates: Floats, number: Ints, source: Source) -> list[dict[str, Any]]:
    """The lines through the stations (nx,) of the modes, at places (nx, 3), and a record for each mode."""
    modes, stations = result["modes"], _stations(result)
    several = len(stations.bodies) > 1
    lines = []
    for k, part in enumerate(stations.bodies, 1):
        nodes = number[part.stations]
        # how elements connect the nodes of imported bodies is unknown: one line shows only which body they are on
        through = [nodes[[i]] for i in range(nodes.size)] if part.axis is NODES else []
        joined = _joined_stations(stations, part.stations) if _has_members(result.scenario, part.body) else []
        if part.axis is not NODES:
            through = _lines(nodes, *coordinates[part.stations, :2].T)
        elif joined:
            through = [number[pair] for pair in joined]
        if several or part.axis is not NODES or joined:
            lines.append(trace_lines(k, part.body, through))
    along = [_direction(result.scenario, part.body) if part.axis is NODES else DEFLECTION for part in stations.bodies]
    sizes = [part.stations.stop - part.stations.start for part in stations.bodies]
    direction = np.repeat(along, sizes).tolist()
    each = zip(*(modes[of].values for of in ("open_frequencies_hz", "damping_ratios", "shapes")), strict=True)
    records = [
        record_55(source, mode, float(f), float(np.nan_to_num(ratio)), number, shape, direction)
        for mode, (f, ratio, shape) in enumerate(each, 1)
    ]
    if (in_space := stations.in_space) is not None:
        frames = [part.stations for part in stations.bodies if _has_members(result.scenario, part.body)]
        for (k, record), on, i in product(enumerate(records), frames, range(3)):
            record[f"r{i + 1}"] = _with_part(record[f"r{i + 1}"], on, in_space[on, i, k])
    return [*lines, *records]


def _has_members(scenario: Scenario, body: str) -> bool:
    """Whether a body is a frame; a single body may have no name here."""
    bodies = scenario.all_bodies
    return (bodies[body] if body in bodies else next(iter(bodies.values()))).has_members


def _joined_stations(stations: Stations, part: slice) -> list[Ints]:
    """Pairs of stations of a body between which a line is drawn."""
    pairs = np.zeros((0, 2), dtype=np.int64) if stations.lines is None else stations.lines
    return list(pairs[(pairs[:, 0] >= part.start) & (pairs[:, 0] < part.stop)])


def _with_part(values: Floats, part: slice, replacement: Floats) -> Floats:
    """A copy of values (k,) with a part replaced."""
    changed = values.copy()
    changed[part] = replacement
    return changed


def _direction(scenario: Scenario, body: str) -> str:
    """Direction in which an imported body's modes are stored: that of its base."""
    bodies = scenario.all_bodies
    base = getattr(bodies[body] if body in bodies else next(iter(bodies.values())), "base", None)
    return str(getattr(base, "direction", DEFLECTION))


def _lines(number: Ints, x: Floats, y: Floats) -> list[Ints]:
    """Nodes along each line of a mesh: of a plate those of equal y, then those of equal x."""
    if np.ptp(y) == 0.0:
        return [number[np.argsort(x, kind="stable")]]
    along = [number[y == at][np.argsort(x[y == at])] for at in np.unique(y)]
    across = [number[x == at][np.argsort(y[x == at])] for at in np.unique(x)]
    return [line for line in (*along, *across) if line.size > 1]


def _functions(items: Items) -> Iterator[tuple[str, str, Function]]:
    """All functions of time or frequency, each with the kind and the name of the place that has it."""
    for path, item in items.items():
        name = last(path)
        if item.array is None or item.scale or item.array.dtype.kind != "f" or name.endswith("_imag"):
            continue
        dataset = last(parent(path))
        if path == "/spectra/amplitude":
            yield from _of_spectra(items)
            continue
        if path in OF_CHANNELS:
            yield from _of_channels(items, path)
            continue
        name = name.removesuffix("_real")
        section = "snubber" if name.startswith("snubber_") else "base" if name.startswith("base_") else ""
        plain = name.removeprefix(f"{section}_")
        quantity = next((plain.removeprefix(start) for start in _STATISTICS if plain.startswith(start)), plain)
        dims = [last(axis) for axis in item.axes]
        places = [dim for dim in dims if dim in ("probe", "snubber", "base_motion")]
        along = [dim for dim in dims if dim not in (*places, *ORDERS)]
        numbered = next((dim for dim in dims if dim in ORDERS), None)
        if quantity not in ORDINATES or len(along) != 1 or len(places) != 1:
            continue
        axis = item.axes[dims.index(along[0])]
        for of, labels in _names_at(items, item, dims, places):
            kind = section or places[0]
            numbers = [None] if numbered is None else items[f"/{dataset}/{numbered}"].values
            unit = _unit_at(item, labels)
            for k, number in enumerate(numbers):
                index = tuple(labels.get(dim, k if dim == numbered else slice(None)) for dim in dims)
                y = _values(items, path, index)
                for whose, x, rows, of_time in _abscissae(items, axis):
                    text = " ".join(filter(None, (whose.kind_name, of, plain.replace("_", " "))))
                    if numbered is not None:
                        text += f" order {number / (_periods(items, whose) if numbered == 'harmonic' else 1):g}"
                    if dataset == "linear":
                        over = _input(items)
                        function = FREQUENCY_RESPONSE if over else GENERAL
                        yield kind, of, Function(quantity, unit, f"linear {text}", x, y, function, over)
                    else:
                        way = TIME_RESPONSE if of_time else GENERAL
                        yield kind, of, Function(quantity, unit, text, x, y[rows], way)


def _unit_at(item: Item, labels: dict[str, int]) -> str:
    """The unit of a variable at a place, whose number along the first dimension is given."""
    each = json.loads(str(item.attributes.get(OF_EACH, "[]")))
    return str(each[next(iter(labels.values()))]) if each and labels else item.unit


def _periods(items: Items, owner: RowOwner) -> int:
    """Periods of the excitation in one period of a branch."""
    return int(items["/branches/period_multiple"].values[owner.number])


def _names_at(
    items: Items, item: Item, dims: Sequence[str], places: Sequence[str]
) -> Iterator[tuple[str, dict[str, int]]]:
    """Names of the places that have a variable, each with its number along their dimension; the base without one."""
    if not places:
        yield "base", {}
        return
    axis, absent = dims.index(places[0]), absent_in(item) if item.absent else None
    for k, label in enumerate(items[item.axes[axis]].values):
        if absent is None or not absent.take(k, axis).all():
            yield str(label), {places[0]: k}


def _values(items: Items, path: str, index: tuple[Any, ...]) -> NDArray[Any]:
    """A part of a variable, complex where it has an imaginary part."""
    values = np.asarray(part_of(items[path].array, index))
    imaginary = items.get(f"{path.removesuffix('_real')}_imag") if path.endswith("_real") else None
    return values if imaginary is None else values + 1j * np.asarray(part_of(imaginary.array, index))


def _abscissae(items: Items, axis: str) -> Iterator[tuple[RowOwner, Floats, slice, bool]]:
    """Times or frequencies along an axis: owner, values, rows, and whether they are times.

    If rows of several members follow each other, each member gives one entry.
    """
    dataset = parent(axis)
    for name in ("time", "frequency_hz"):
        item = items.get(f"{dataset}/{name}")
        if item is None or item.values.dtype.kind != "f":
            continue
        if item.scale and f"{dataset}/{name}" == axis:
            yield RowOwner(""), item.values, slice(None), name == "time"
            return
        if item.axes == (axis,) and (name != "time" or f"{dataset}/frequency_hz" not in items):
            for whose, rows in members_along(items, axis):
                yield whose, item.values[rows], rows, name != "frequency_hz"
            return


def members_along(items: Items, axis: str) -> Iterator[tuple[RowOwner, slice]]:
    """The members whose rows are along an axis, one after the other, and their rows."""
    numbered = [(path, item) for path, item in items.items() if item.axes == (axis,) and NAMES in item.attributes]
    if not numbered:
        return
    path, item = numbered[0]
    numbers, coordinate = item.values, items[f"/{item.attributes[NAMES]}"].values
    borders = np.flatnonzero(np.diff(numbers)) + 1
    for begin, end in zip([0, *borders], [*borders, numbers.size], strict=True):
        if end > begin:
            number = int(numbers[begin])
            label = coordinate[number]
            called = str(label) if isinstance(label, str) else f"{last(path)} {label}"
            yield RowOwner(called, number), slice(int(begin), int(end))


def _of_spectra(items: Items) -> Iterator[tuple[str, str, Function]]:
    """The spectra of a run."""
    spectra = Dataset("spectra", items)
    names, quantities = (spectra[column].values.tolist() for column in ("name", "quantity"))
    for name, quantity, amplitude in zip(names, quantities, spectra["amplitude"].by_label().values(), strict=True):
        if quantity in ORDINATES:
            label = f"{name} {quantity} spectrum".replace("_", " ")
            frequency = spectra["frequency_hz"].values
            yield "probe", name, Function(quantity, amplitude.unit, label, frequency, amplitude.values, GENERAL)


def _of_channels(items: Items, path: str) -> Iterator[tuple[str, str, Function]]:
    """Histories and amplitude spectra of several quantities, one after the other."""
    about, text = OF_CHANNELS[path]
    columns = {last(place): item.values for place, item in items.items() if parent(place) == about}
    (axis,), values = items[path].axes, items[path].values
    for whose, x, rows, of_time in _abscissae(items, axis):
        name = str(columns["place"][whose.number])
        quantity, unit = (str(columns[key][whose.number]) for key in ("quantity", "unit"))
        if quantity in ORDINATES:
            kind = "snubber" if quantity in ("force", "penetration") else "probe"
            label = f"{name} {quantity} {text}".replace("_", " ")
            yield kind, name, Function(quantity, unit, label, x, values[rows], TIME_RESPONSE if of_time else GENERAL)


def _input(items: Items) -> str:
    """Input of the linear response of a sweep: a force, force per length or pressure, or acceleration of the base."""
    quantities = items["/curves/quantity"].values if "/curves/quantity" in items else []
    quantity = next(map(str, quantities), "")
    return quantity if quantity in LOAD_CODES else "acceleration"


# Codes of the universal file format: (specific data type, length exponent, force exponent).
ORDINATES = {
    "displacement": (8, 1, 0),
    "absolute_displacement": (8, 1, 0),
    "penetration": (8, 1, 0),
    "velocity": (11, 1, 0),
    "absolute_acceleration": (12, 1, 0),
    "acceleration": (12, 1, 0),
    "force": (9, 0, 1),
}
GENERAL, TIME_RESPONSE, FREQUENCY_RESPONSE = 0, 1, 4
_TIME, _FREQUENCY = 17, 18
LOAD_CODES = {"force": (13, 0, 1), "force_per_length": (0, -1, 1), "pressure": (15, -2, 1)}
"""Data type and exponents of length and force of the loads that a response may refer to."""


class Source(NamedTuple):
    """Origin of the records of one file."""

    title: str
    created: str  # ISO 8601
    software: str


class Function(NamedTuple):
    """A quantity at one place over time or frequency."""

    quantity: str  # one of `ORDINATES`
    unit: str
    label: str  # first line of the record
    x: Floats  # s of a time response, otherwise Hz
    y: NDArray[Any]  # may be complex
    kind: int = TIME_RESPONSE
    input_quantity: str = ""  # of a frequency response the input: "acceleration" of the base, or one of `LOAD_CODES`


def record_58(source: Source, function: Function, name: str, node: int, direction: int = 3) -> dict[str, Any]:
    """One function at one place, for :mod:`pyuff`.

    An equally spaced abscissa is stored as start and increment with 6 digits; if that is not exact, the record is
    stored in binary (58b) with all abscissae.

    Parameters
    ----------
    source : of the file.
    function : what is recorded.
    name : of the probe or snubber.
    node, direction : where, and along which axis.

    Returns
    -------
    dict
        The data set.
    """
    specific, length_exponent, force_exponent = ORDINATES[function.quantity]
    of_frequency, x, y = function.kind != TIME_RESPONSE, function.x, function.y
    quantity = function.quantity.replace("_", " ")
    exact = False
    if x.size > 1:
        increment = (x[-1] - x[0]) / (x.size - 1)
        even = np.allclose(np.diff(x), increment, rtol=1e-9, atol=0.0) and increment > 0
        exact = bool(even) and all(abs(float(f"{v:.5e}") - v) <= 1e-12 * increment for v in (x[0], increment))
    below = {"": (0, 0, 0), "acceleration": (12, 1, 0), **LOAD_CODES}[function.input_quantity]
    return {
        "type": 58,
        "binary": 0 if exact else 1,
        "func_type": function.kind,
        "rsp_ent_name": _ascii(name, 10),
        "rsp_node": node,
        "rsp_dir": direction,
        "ref_ent_name": "NONE",
        "ref_node": 0,
        "ref_dir": 0,
        "id1": _ascii(function.label, 80),
        "id2": _ascii(source.title, 80),
        "id3": _date(source.created),
        "id4": _ascii(source.software, 80),
        "abscissa_spacing": int(exact),
        "abscissa_spec_data_type": _FREQUENCY if of_frequency else _TIME,
        "abscissa_axis_lab": "Frequency" if of_frequency else "Time",
        "abscissa_axis_units_lab": "Hz" if of_frequency else "s",
        "ordinate_spec_data_type": specific,
        "ordinate_len_unit_exp": length_exponent,
        "ordinate_force_unit_exp": force_exponent,
        "ordinate_axis_lab": _ascii(quantity.capitalize(), 20),
        "ordinate_axis_units_lab": function.unit,
        "orddenom_spec_data_type": below[0],
        "orddenom_len_unit_exp": below[1],
        "orddenom_force_unit_exp": below[2],
        "x": np.array(x, dtype=float),
        "data": np.array(y, dtype=complex if np.iscomplexobj(y) else float),
    }


def header_151(source: Source, description: str = "") -> dict[str, Any]:
    """The header of a file: title, program and times."""
    import pyuff

    day, _, clock = _date(source.created).partition(" ")
    return dict(
        pyuff.prepare_151(
            model_name=_ascii(source.title, 80), description=_ascii(description, 80),
            db_app=_ascii(source.software, 80), program=_ascii(source.software, 80),
            date_db_created=day, time_db_created=clock, version_db1=0, version_db2=0,
            file_type=0, date_db_saved=day, time_db_saved=clock, date_db_written=day, time_db_written=clock,
        )
    )  # fmt: skip


def trace_lines(number: int, name: str, lines: Sequence[Ints]) -> dict[str, Any]:
    """The lines through the nodes of a body (data set 82): between two of them, as node 0, the pen is lifted.

    Parameters
    ----------
    number : of the trace.
    name : of the body.
    lines : numbers of the nodes along each line.

    Returns
    -------
    dict
        As pyuff writes it.
    """
    lifted = [part for line in lines for part in (np.zeros(1, dtype=np.int64), line)][1:]
    nodes = np.concatenate(lifted)
    return {"type": 82, "trace_num": number, "color": 0, "id": _ascii(name, 80), "n_nodes": nodes.size, "nodes": nodes}


def record_55(
    source: Source, mode: int, frequency_hz: float, damping_ratio: float, nodes: Ints, deflection: Floats,
    direction: str | Sequence[str] = "z",
) -> dict[str, Any]:  # fmt: skip
    """A normal mode of unit modal mass (data set 55).

    Parameters
    ----------
    source : title of the file, and the program that wrote it.
    mode : number of the mode, from 1.
    frequency_hz, damping_ratio : of the mode.
    nodes : (k,) numbers of the nodes.
    deflection : (k,) of the mass-normalised mode there.
    direction : of the deflection: one of all nodes, or one of each.

    Returns
    -------
    dict
        As pyuff writes it.
    """
    along = np.broadcast_to(np.asarray(direction), nodes.shape)
    turning = not set(direction if not isinstance(direction, str) else (direction,)) <= set(DIRECTIONS[:3])
    components = DIRECTIONS if turning else DIRECTIONS[:3]
    moved = np.asarray(deflection, dtype=float)
    return {
        "type": 55, "id1": _ascii(source.title, 80), "id2": "NONE", "id3": _date(source.created),
        "id4": _ascii(source.software, 80), "id5": f"mode {mode}", "model_type": 1, "analysis_type": 2,
        "data_ch": 3 if turning else 2, "spec_data_type": 8, "data_type": 2, "n_data_per_node": len(components),
        "load_case": 1, "mode_n": mode,
        "freq": frequency_hz, "modal_m": 1.0, "modal_damp_vis": damping_ratio, "modal_damp_his": 0.0,
        "node_nums": nodes.astype(float),
        **{f"r{k}": np.where(along == each, moved, 0.0) for k, each in enumerate(components, 1)},
    }  # fmt: skip


END_OF_SET = 16  # bytes, with the line -1


def write_uff(sets: Sequence[dict[str, Any]], path: Path) -> None:
    """Write data sets to a universal file, after the data set of the units (SI).

    Raises
    ------
    ResultFileError
        If the file cannot be written.
    """
    import pyuff

    units = pyuff.prepare_164(
        units_code=1, units_description="SI", temp_mode=1, length=1.0, force=1.0, temp=1.0, temp_offset=0.0
    )
    with replacement_file(path) as temporary, warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)  # pyuff leaves the closing of binary sets to Python
        try:
            pyuff.UFF(str(temporary)).write_sets([units, *sets], mode="overwrite")
        except Exception as error:  # pyuff raises errors of its own in place of a full disk
            if isinstance(error.__context__, OSError):
                raise error.__context__ from None
            raise
        with open_input(temporary) as file:  # what Python closes is not written, without an error, on a full disk
            file.seek(-min(END_OF_SET, temporary.stat().st_size), os.SEEK_END)
            if not file.read().rstrip().endswith(b"-1"):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def _ascii(text: str, width: int) -> str:
    return " ".join(text.encode("ascii", "replace").decode().split())[:width] or "NONE"


def _date(created: str) -> str:
    try:
        return datetime.fromisoformat(created).strftime("%d-%b-%y %H:%M:%S").upper()
    except ValueError:
        return "NONE"
