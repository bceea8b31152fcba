"""Functions of time and frequency in a result file of any kind, and mode shapes, as records of a universal file.

Nodes are the probes of the scenario, then its snubbers, then the base of a run (at the origin), then the stations of
the structure at which its modes are stored; x is the position along the beam or on the plate (the number of the mass in
a chain), y that on the plate, and motion is along +z. Bodies have no positions relative to each other: of several, each
lies above the one before, at a tenth of the longest. The force of a snubber above the structure is along -z. Amplitude
spectra are of function type 0 (general), because pyuff does not write type 12 (spectrum).

Imported bodies keep the numbers of their nodes, and those of the others follow; their modes are in the direction of
their base. A second body with the same numbers has its own raised by a power of ten. Nodes that the table gives no
coordinates are in no data set 15, and the header names their bodies.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from beamsim.scenario import Scenario
from beamsim.store.flat import Item, Items, joined, last, parent
from beamsim.store.uff import (
    FREQUENCY_RESPONSE,
    GENERAL,
    LOAD_CODES,
    ORDINATES,
    UP,
    Function,
    Source,
    header_151,
    record_55,
    record_58,
    trace_lines,
)
from beamsim.structures.places import DEFLECTION
from beamsim.structures.stations import NODES, Stations
from beamsim.system.structural import ModeTable
from beamsim.typing import Floats, Ints

Coordinates = tuple[float, float, float]  # m
APART = 0.1  # between bodies, of the longest

_OF_SNUBBERS = ("force", "penetration")
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
    nodes, upside_down = _nodes(result.scenario, heights)
    if "/base" in items:
        nodes["base", "base"] = (0.0, 0.0, 0.0)
    placed = _placed(stations, heights)
    nodes |= _at_nodes(result.scenario, stations, placed)
    first = _first_free(stations)
    root = items["/"].attributes
    source = Source(result.title, result.created, f"beamsim {root['beamsim_version']} {root['command']}")
    records = []
    for path, item in items.items():
        if item.values is None or item.scale:
            continue
        name = _name(items, path)
        for function in _functions(items, path, name):
            place = (_kind_of_place(path, function.quantity), name)
            if place in nodes and function.x.size > 1:
                node = list(nodes).index(place) + first
                turned = function.quantity == "force" and name in upside_down
                records.append(record_58(source, function, name, node, -UP if turned else UP))
    if not records:
        return []
    number = _numbers(stations, first + len(nodes))
    points = np.concatenate([np.array([*nodes.values()], dtype=float).reshape(-1, 3), placed])
    numbers = np.concatenate([first + np.arange(len(nodes)), number])
    known = np.all(np.isfinite(points), axis=1)
    x, y, z = points[known].T
    of_nodes = pyuff.prepare_15(node_nums=numbers[known], x=x, y=y, z=z)
    nowhere = bodies_without_places(result)
    remark = f"nodes without coordinates: {', '.join(nowhere)}" if nowhere else ""
    shapes = [] if stations is None else _mode_shapes(result, placed, number, source)
    return [header_151(source, remark), of_nodes, *shapes, *records]


def bodies_without_places(result: Any) -> list[str]:
    """Names of the imported bodies of whose nodes some have no coordinates, so that other programs cannot draw them."""
    stations = _stations(result)
    if stations is None:
        return []
    placed = _placed(stations, _heights(stations))
    lacking = [part.body for part in stations if not np.all(np.isfinite(placed[part.stations]))]
    return lacking if len(stations.parts) > 1 else list(result.scenario.all_bodies)[: len(lacking)]


def _stations(result: Any) -> Stations | None:
    """Where the mode shapes of a result are known; None where there are none."""
    stations: Stations | None = getattr(getattr(result, "modes", None), "stations", None)
    return stations if stations is not None and stations.position.size else None


def _heights(stations: Stations | None) -> dict[str, float]:
    """By body the z of its nodes, m; of imported bodies what is added to it."""
    if stations is None:
        return {}
    lengths = [np.ptp(stations.position[part.stations]) for part in stations if part.axis.continuous]
    if stations.points is not None:
        lengths += [np.ptp(of[np.isfinite(of)]) for of in stations.points.T if np.any(np.isfinite(of))]
    return {part.body: APART * max(lengths, default=1.0) * k for k, part in enumerate(stations)}


def _placed(stations: Stations | None, heights: dict[str, float]) -> Floats:
    """(nx, 3) coordinates of the stations of the modes, m; NaN for nodes of imported bodies that have none."""
    if stations is None:
        return np.zeros((0, 3))
    y = np.zeros(stations.position.size) if stations.across is None else np.nan_to_num(stations.across)
    placed = np.stack([stations.position, y, np.zeros(y.size)], axis=1)
    for part in stations:
        if part.axis is NODES:
            placed[part.stations] = np.nan if stations.points is None else stations.points[part.stations]
        placed[part.stations, 2] += heights[part.body]
    return placed


def _at_nodes(scenario: Scenario, stations: Stations | None, placed: Floats) -> dict[tuple[str, str], Coordinates]:
    """Coordinates of the probes and snubbers at nodes of imported bodies; NaN where the table has none."""
    imported = [part for part in stations or () if part.axis is NODES]
    if stations is None or not imported:
        return {}
    alone = len(stations.parts) == 1
    at = {
        ("" if alone else part.body, int(stations.position[k])): placed[k]
        for part in imported
        for k in range(part.stations.start, part.stations.stop)
    }
    nodes = {}
    for kind, items in (("probe", scenario.effective_probes), ("snubber", scenario.all_snubbers)):
        for item in items:
            place = getattr(item, "probed_places", item.places)[0]
            body = "" if alone else place.body or ""
            if alone or body in {part.body for part in imported}:
                x, y, z = at.get((body, place.node or 0), np.full(3, np.nan))
                nodes[kind, item.name] = (float(x), float(y), float(z))
    return nodes


def _own_numbers(stations: Stations | None) -> dict[str, Ints]:
    """By imported body the numbers of its nodes; raised by a power of ten where another has the same."""
    own: dict[str, Ints] = {}
    if stations is None:
        return own
    for k, part in enumerate(part for part in stations if part.axis is NODES):
        numbers = stations.position[part.stations].astype(np.int64)
        if any(np.any(np.isin(numbers, other)) for other in own.values()):
            numbers = numbers + k * 10 ** len(str(int(max(np.max(stations.position), 1))))
        own[part.body] = numbers
    return own


def _first_free(stations: Stations | None) -> int:
    """The first number of a node that no imported body has."""
    return 1 + max((int(numbers.max(initial=0)) for numbers in _own_numbers(stations).values()), default=0)


def _numbers(stations: Stations | None, first: int) -> Ints:
    """(nx,) node of each station: of imported bodies its own, else from ``first`` on."""
    if stations is None:
        return np.zeros(0, dtype=np.int64)
    own, numbers = _own_numbers(stations), first + np.arange(stations.position.size)
    for part in stations:
        if part.body in own:
            numbers[part.stations] = own[part.body]
    return numbers


def _mode_shapes(result: Any, placed: Floats, number: Ints, source: Source) -> list[dict[str, Any]]:
    """The lines through the stations (nx,) of the modes, at places (nx, 3), and a record for each mode."""
    modes: ModeTable = result.modes
    stations, several = modes.stations, len(modes.stations.parts) > 1
    lines = []
    for k, part in enumerate(stations, 1):
        nodes = number[part.stations]
        # what joins the nodes of imported bodies is unknown: their line says only which body they are on
        through = [nodes[[i]] for i in range(nodes.size)] if part.axis is NODES else []
        if part.axis is not NODES:
            through = _lines(nodes, *placed[part.stations, :2].T)
        if several or part.axis is not NODES:
            lines.append(trace_lines(k, part.body, through))
    along = [_direction(result.scenario, part.body) if part.axis is NODES else DEFLECTION for part in stations]
    sizes = [part.stations.stop - part.stations.start for part in stations]
    direction = np.repeat(along, sizes).tolist()
    each = zip(modes.open_frequencies_hz, modes.damping_ratios, modes.shapes, strict=True)
    records = [
        record_55(source, mode, float(f), float(np.nan_to_num(ratio)), number, shape, direction)
        for mode, (f, ratio, shape) in enumerate(each, 1)
    ]
    return [*lines, *records]


def _direction(scenario: Scenario, body: str) -> str:
    """In which an imported body's modes are stored: that of its base."""
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


def _nodes(scenario: Scenario, heights: dict[str, float]) -> tuple[dict[tuple[str, str], Coordinates], set[str]]:
    """Coordinates of every probe and snubber, and the snubbers that push downwards."""
    probes = {
        ("probe", p.name): _coordinates(p, scenario.default_body, scenario, heights) for p in scenario.effective_probes
    }
    snubbers = {
        ("snubber", each.item.name): _coordinates(each.item, each.body, scenario, heights)
        for each in scenario.located_snubbers
    }
    return {**probes, **snubbers}, {s.name for s in scenario.all_snubbers if getattr(s, "side", "") == "above"}


def _kind_of_place(path: str, quantity: str) -> str:
    """Whether an array belongs to a probe, a snubber, the base or, in a chain, a spring."""
    parts = path.split("/")
    for folder, kind in (
        ("base", "base"),
        ("springs", "spring"),
        ("friction", "friction"),
        ("snubbers", "snubber"),
        ("probes", "probe"),
    ):
        if folder in parts[:-1]:
            return kind
    return "snubber" if quantity in _OF_SNUBBERS else "probe"


def _coordinates(item: Any, body: str, scenario: Scenario, heights: dict[str, float]) -> Coordinates:
    """Position along its body, or number of the mass, and y on a plate; the first place of a snubber between two."""
    place = getattr(item, "probed_places", item.places)[0]
    point = scenario.all_bodies[place.body or body].point_of(place)
    x, y = point if isinstance(point, tuple) else (point, 0.0)
    return float(x), float(y), heights.get(place.body or "", 0.0)


def _name(items: Items, path: str) -> str:
    """Name of the probe or snubber of an array, from the attributes of the groups around it."""
    group = parent(path)
    if group == "/base":
        return "base"
    while group != "/":
        for key in ("name", "place", "probe"):
            if key in items[group].attributes:
                return str(items[group].attributes[key])
        group = parent(group)
    return ""


def _label(path: str, name: str, quantity: str) -> str:
    """First line of a record: place and quantity for a run, else the path of the array."""
    folder, *below = path.strip("/").split("/")
    if folder == "spectra":
        return f"{name} {quantity} spectrum".replace("_", " ")
    if folder in ("probes", "snubbers", "base"):
        return f"{name} {below[-1].replace('_', ' ')}"
    return path.strip("/").replace("/", " ").replace("_", " ").removesuffix(" real")


def _functions(items: Items, path: str, place: str) -> Iterator[Function]:
    """Functions in an array: one, one for each order of harmonics, or none."""
    item, name = items[path], last(path).removesuffix("_real")
    if last(path).endswith("_imag") or item.values.dtype.kind != "f":
        return
    y = item.values
    if last(path).endswith("_real"):
        y = y + 1j * items[f"{path.removesuffix('_real')}_imag"].values
    about = items[parent(path)].attributes
    if name == "amplitude" and "quantity" in about:
        quantity = str(about["quantity"])
    else:
        quantity = next((name.removeprefix(s) for s in _STATISTICS if name.startswith(s)), name)
    if quantity not in ORDINATES:
        return
    text, names = _label(path, place, quantity), [last(axis) for axis in item.axes]
    if names == ["time"]:
        yield Function(quantity, item.unit, text, items[item.axes[0]].values, y)
        return
    frequencies = {k: x for k, axis in enumerate(item.axes) if (x := _frequency(items, axis)) is not None}
    if len(frequencies) != 1:
        return
    (along, x), *_ = frequencies.items()
    if y.ndim == 1:
        over = _input(items) if path.startswith("/linear/") else ""
        yield Function(quantity, item.unit, text, x, y, FREQUENCY_RESPONSE if over else GENERAL, over)
    elif y.ndim == 2 and "order" in names:
        for order, values in zip(items[item.axes[1 - along]].values, np.moveaxis(y, along, 1), strict=True):
            yield Function(quantity, item.unit, f"{text} order {order:g}", x, values, GENERAL)


def _frequency(items: Items, axis: str) -> Floats | None:
    """Frequencies along an axis: its own values, or those of ``frequency_hz`` beside it, along a branch."""
    if not axis:
        return None
    if last(axis) == "frequency_hz":
        return np.asarray(items[axis].values)
    beside: Item | None = items.get(joined(parent(axis), "frequency_hz"))
    return np.asarray(beside.values) if beside is not None and beside.axes == (axis,) else None


def _input(items: Items) -> str:
    """Input of the linear response of a sweep: a force, force per length or pressure, or acceleration of the base."""
    curves = (str(item.attributes["quantity"]) for item in items.values() if "direction" in item.attributes)
    quantity = next(curves, "")
    return quantity if quantity in LOAD_CODES else "acceleration"
