"""Measured mode shapes from files: CSV, UFF dataset 55."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from beamsim.analyses.compare_modes.measured import ShapesAtPlaces
from beamsim.errors import Problem, ScenarioError
from beamsim.measurements.read import TEXT, UFF, data_sets, read_rows
from beamsim.measurements.signal import MeasurementError, split_heading
from beamsim.scenario import Scenario, units
from beamsim.scenario.body import AtPlace, Body

_PLACE = ("body", "position", "x", "y", "mass", "node", "direction")
_COMPONENTS = {"x": "r1", "y": "r2", "z": "r3", "rx": "r4", "ry": "r5", "rz": "r6"}
_LAYOUT = "give columns position (and y), mass, or node and direction, then a column a mode, headed by its frequency"


def read_shapes(path: Path, scenario: Scenario) -> ShapesAtPlaces:
    """The mode shapes of a file; nodes of a UFF file are placed by their coordinates where bodies have no nodes.

    Raises
    ------
    ScenarioError
        If the file is missing or empty, or a value in it is wrong: with its line and column.
    """
    if not path.is_file():
        raise _wrong(path, "does not exist", "check the path")
    if path.stat().st_size == 0:
        raise _wrong(path, "is empty", "export the shapes again")
    suffix = path.suffix.lower()
    try:
        if suffix in (*UFF, ".55"):
            return _read_uff(path, scenario)
        if suffix in TEXT:
            return _read_csv(path)
    except MeasurementError as fault:
        raise _wrong(path, fault.message, fault.remedy) from None
    raise _wrong(path, "has an unknown format", "use .csv or .uff")


def _wrong(path: Path, message: str, remedy: str) -> ScenarioError:
    return ScenarioError(Problem("", f"{path} {message}", remedy))


def _read_csv(path: Path) -> ShapesAtPlaces:
    rows, _ = read_rows(path)
    if len(rows) < 2:
        raise _wrong(path, "has no table", _LAYOUT)
    first, heading = rows[0]
    named = [split_heading(cell) for cell in heading]
    of_place = {name.lower(): k for k, (name, _) in enumerate(named) if name.lower() in _PLACE}
    modes = [k for k in range(len(heading)) if k not in of_place.values()]
    if not of_place or not modes:
        raise _wrong(path, f"line {first}: has no {'mode' if of_place else 'place'} among its columns", _LAYOUT)
    frequencies = [_frequency(path, first, k, heading[k]) for k in modes]
    places, labels, shapes = [], [], []
    for number, row in rows[1:]:
        if len(row) != len(heading):
            raise _wrong(path, f"line {number}: has {len(row)} columns, its heading {len(heading)}", "complete the row")
        given = {name: (row[k], named[k][1]) for name, k in of_place.items() if row[k]}
        places.append(_place(path, number, given))
        labels.append(f"line {number}")
        shapes.append([_number(path, number, k, row[k]) for k in modes])
    return ShapesAtPlaces(tuple(places), np.array(frequencies), np.array(shapes), str(path), tuple(labels))


def _frequency(path: Path, line: int, column: int, text: str) -> float:
    try:
        return units.read_quantity(text, units.FREQUENCY)
    except units.UnitError as error:
        message = f"line {line}, column {column + 1} = {text} is neither a place nor a frequency: {error.message}"
        raise _wrong(path, message, _LAYOUT) from None


def _number(path: Path, line: int, column: int, text: str) -> complex:
    try:
        value = complex(text.replace(" ", "").replace("i", "j"))
    except ValueError:
        value = complex("nan")
    if not np.isfinite(value):
        raise _wrong(path, f"line {line}, column {column + 1} = {text} is not a number", "write 0.3, or 0.3+0.1j")
    return value


def _place(path: Path, line: int, given: Mapping[str, tuple[str, str]]) -> AtPlace:
    def length(name: str) -> Any:
        text, unit = given[name]
        return text if text.endswith("%") else f"{text} {unit}" if unit else text

    keys: dict[str, Any] = {name: given[name][0] for name in ("body", "direction") if name in given}
    keys |= {name: _whole(given[name][0]) for name in ("mass", "node") if name in given}
    first = "position" if "position" in given else "x"
    if first in given:
        keys["position"] = [length(first), length("y")] if "y" in given else length(first)
    try:
        return AtPlace.model_validate(keys)
    except ValidationError as error:
        details = error.errors(include_url=False)[0]
        context = details.get("ctx", {})
        message = context.get("message", details["msg"])
        raise _wrong(path, f"line {line}: the place {message}", str(context.get("remedy") or _LAYOUT)) from None


def _whole(text: str) -> Any:
    return int(text) if text.isdigit() else text


def _read_uff(path: Path, scenario: Scenario) -> ShapesAtPlaces:
    sets = data_sets(path)
    modes = [each for each in sets if each["type"] == 55 and each.get("analysis_type") in (2, 3)]
    if not modes:
        raise _wrong(path, "has no mode shapes", "export them as dataset 55 (normal or complex modes)")
    per_metre = next((float(each["length"]) for each in sets if each["type"] == 164 and each.get("length")), 1.0)
    coordinates = {
        int(node): (float(x), float(y))
        for each in sets
        if each["type"] == 15
        for node, x, y in zip(each["node_nums"], each["x"], each["y"], strict=True)
    }
    nodes = [int(node) for node in modes[0]["node_nums"]]
    if any([int(node) for node in mode["node_nums"]] != nodes for mode in modes):
        raise _wrong(path, "has modes at different nodes", "export all modes at the same nodes")
    frequencies = np.array([_uff_frequency(mode) for mode in modes])
    bodies = scenario.all_bodies
    lines = {str(each["id"]).strip(): each["nodes"] for each in sets if each["type"] == 82}
    owners = {int(node): name for name, numbers in lines.items() if name in bodies for node in numbers if node}
    places, labels, rows = [], [], []
    for k, node in enumerate(nodes):
        name = owners.get(node) if len(bodies) > 1 else next(iter(bodies))
        if name is None:
            raise _wrong(
                path, f"says of no body that node {node} is on it, and there are several",
                f"give each a trace line (dataset 82) named {', '.join(bodies)}, or use CSV with a column body",
            )  # fmt: skip
        body = bodies[name]
        of = {"body": name} if len(bodies) > 1 else {}
        has_nodes = not any(body.node_problems((), ()))
        for direction, component in _COMPONENTS.items():
            row = [complex(np.atleast_1d(mode.get(component, np.zeros(len(nodes))))[k]) for mode in modes]
            if not any(row) or not (has_nodes or direction == "z"):
                continue
            if has_nodes:
                places.append(AtPlace.model_validate({**of, "node": node, "direction": direction}))
            elif node in coordinates:
                places.append(AtPlace.model_validate({**of, **_point_of(body, coordinates[node], per_metre)}))
            else:
                raise _wrong(path, f"has no coordinates of node {node}", "export dataset 15 too, or use CSV")
            labels.append(f"node {node} {direction}")
            rows.append(row)
    return ShapesAtPlaces(tuple(places), frequencies, np.array(rows).reshape(len(rows), -1), str(path), tuple(labels))


def _point_of(body: Body, coordinates: tuple[float, float], per_metre: float) -> dict[str, Any]:
    """The keys of a place: both coordinates on a plate, x along a beam, which numbers the masses of a chain."""
    usual = body.default_probe()[1] if body.has_default_probe else None
    if usual is not None and usual.mass is not None:
        return {"mass": round(coordinates[0])}
    x, y = (each / per_metre for each in coordinates)
    return {"position": (x, y) if usual is not None and isinstance(usual.position, tuple) else x}


def _uff_frequency(mode: Mapping[str, Any]) -> float:
    if mode["analysis_type"] == 2:
        return float(np.real(mode["freq"]))
    return float(abs(np.imag(mode["eig"])) / (2 * np.pi))
