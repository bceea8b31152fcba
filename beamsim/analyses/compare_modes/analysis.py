r"""``beamsim compare-modes``: pairs of measured and computed modes.

Shapes m and p at the same places are compared by the modal assurance criterion
:math:`|m^H p|^2 / (m^H m\; p^T p)` (R. J. Allemang, D. L. Brown, A correlation coefficient for modal vector analysis,
IMAC 1982), which is 1 for shapes that differ only by a factor. Modes are paired so that the sum of the criterion is
largest; for shapes that are similar at the places, the closer frequency decides. Measured shapes are read from CSV, or
UFF dataset 55.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any, Literal

import numpy as np
from pydantic import ValidationError

from beamsim.errors import InputFileError, ScenarioError
from beamsim.files import reading
from beamsim.labelled import Layout, Variable
from beamsim.measurements.read import TEXT, UNIVERSAL, ending_of
from beamsim.measurements.signal import split_heading
from beamsim.measurements.tables import read_named_columns
from beamsim.measurements.universal import DataSet, data_sets
from beamsim.outcomes import COMPLETE
from beamsim.results.result import Result
from beamsim.scenario import Scenario, Source, scenario_of, units
from beamsim.scenario.body import AtPlace, Body
from beamsim.scenario.files import DecimalMark
from beamsim.scenario.run import Reduction
from beamsim.signals.mac import modal_assurance
from beamsim.structures.assembly import no_structure, site_in
from beamsim.structures.modes import closed_modes
from beamsim.summaries import Entry, Number, list_of, record
from beamsim.system.build import build_system
from beamsim.system.reduced_model import build_reduced_model
from beamsim.typing import Complexes, Floats, Ints

_MEASURED, _PREDICTED = ("measured",), ("predicted",)
COMPARED_MODES = Layout(
    "compared_modes",
    "Measured and computed modes, and how alike their shapes are at the measured places.",
    {
        "contacts": Variable((), "", "open or closed: how the snubbers are in the computed modes", str),
        "source": Variable((), "", "file of the measured shapes", str),
        "measured": Variable(_MEASURED, "1", "number of the measured mode", int),
        "predicted": Variable(_PREDICTED, "1", "number of the computed mode", int),
        "other": Variable(("other",), "1", "number of the other computed mode", int),
        "measured_hz": Variable(_MEASURED, "Hz", "measured natural frequency"),
        "predicted_hz": Variable(_PREDICTED, "Hz", "computed natural frequency"),
        "mac": Variable(
            _MEASURED + _PREDICTED, "1",
            "modal assurance criterion |m^H p|^2 / (m^H m p^T p) of measured and computed shapes at the places",
        ),
        "auto_mac": Variable(
            (*_PREDICTED, "other"), "1",
            "MAC of computed shapes with each other: near 1 off the diagonal, the places cannot tell them apart",
        ),
        "paired": Variable(_MEASURED, "1", "number of the computed mode of each measured one, 0 where none fits", int),
        "difference": Variable(_MEASURED, "1", "computed over measured frequency less 1; NaN where no mode fits"),
    },
)  # fmt: skip
LEAST_PAIR_MAC = 0.2  # MAC below which modes are not paired


MODE_PAIR = record(dict.fromkeys(("number", "measured_hz", "predicted", "predicted_hz", "difference", "mac"), Number))


@dataclass(frozen=True, repr=False)
class ModeComparison(Result):
    """Result of `beamsim.compare_modes`: pairs of measured and computed modes, and the matrix of their MAC.

    Examples
    --------
    >>> import beamsim, pathlib, tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> file = pathlib.Path(folder.name) / "shapes.csv"
    >>> _ = file.write_text("position (mm), 52 Hz, 330 Hz\\n90, 0.16, 0.8\\n180, 0.54, 0.45\\n270, 1.0, -1.0\\n")
    >>> result = beamsim.compare_modes("configs/one_sided_65hz.yaml", file)
    >>> result["compared_modes"]["paired"].values.tolist(), result["compared_modes"]["mac"].dims
    ([1, 2], ('measured', 'predicted'))
    >>> round(result.summary["lowest_mac"], 3), round(result.summary["largest_difference"], 3)
    (0.984, 0.008)
    >>> folder.cleanup()
    """

    KIND = "compare-modes"
    DATASETS = (COMPARED_MODES,)
    SUMMARY = (
        Entry("pairs", "", "by measured mode: number, measured_hz, predicted (0 where no mode fits), predicted_hz, "
                 "difference (relative, of the prediction), mac", form=list_of(MODE_PAIR)),
        Entry("lowest_mac", "1", "smallest MAC of the pairs, 0 where a mode has no partner"),
        Entry("largest_difference", "1", "largest relative difference of a paired frequency"),
    )  # fmt: skip


@dataclass(frozen=True)
class ShapesAtPlaces:
    """Natural frequencies and shapes of m modes at p places, as `beamsim.read_shapes` reads them.

    Examples
    --------
    >>> import beamsim, pathlib, tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> file = pathlib.Path(folder.name) / "shapes.csv"
    >>> _ = file.write_text("position (mm), 52 Hz, 330 Hz\\n90, 0.16, 0.8\\n180, 0.54, 0.45\\n270, 1.0, -1.0\\n")
    >>> shapes = beamsim.read_shapes(file, "configs/one_sided_65hz.yaml")
    >>> shapes.frequency_hz.tolist(), shapes.shapes.shape, shapes.places[0].position
    ([52.0, 330.0], (3, 2), 0.09)
    >>> folder.cleanup()
    """

    places: tuple[AtPlace, ...]  #: p places on the structure
    frequency_hz: Floats  #: (m,) natural frequencies
    shapes: Complexes  #: (p, m) in any unit, the same within a mode
    source: str = "the measurement"  #: name of the file
    labels: tuple[str, ...] = ()  #: where each place is defined, for messages


def compare_modes(
    scenario: Source, measured: ShapesAtPlaces | Path | str, *, contacts: Literal["open", "closed"] = "open"
) -> ModeComparison:
    """Pair measured mode shapes with computed ones.

    Parameters
    ----------
    scenario : scenario with the structure, or anything that `beamsim.load_scenario` reads.
    measured : shapes at two or more places with their frequencies, or a file for `read_shapes`.
    contacts : state of the snubbers in the computed modes: all open or all closed.

    Returns
    -------
    ModeComparison
        Warns about measured modes without a partner, and about modes that the places cannot distinguish.

    Raises
    ------
    ScenarioError
        If a place is not on the structure, there are fewer than two places, a shape is zero or not finite, or a
        frequency is not positive.

    Examples
    --------
    >>> import beamsim, pathlib, tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> file = pathlib.Path(folder.name) / "shapes.csv"
    >>> _ = file.write_text("position (mm), 52 Hz, 330 Hz\\n90, 0.16, 0.8\\n180, 0.54, 0.45\\n270, 1.0, -1.0\\n")
    >>> result = beamsim.compare_modes("configs/one_sided_65hz.yaml", file)
    >>> result["compared_modes"]["mac"].values.round(2)[:, :2].tolist()
    [[1.0, 0.19], [0.16, 0.98]]
    >>> folder.cleanup()
    """
    scenario, begin = scenario_of(scenario), perf_counter()
    if not isinstance(measured, ShapesAtPlaces):
        measured = read_shapes(measured, scenario)
    _check(measured)
    frequencies, shapes = _computed_modes(scenario, measured, closed=contacts == "closed")
    mac, auto = (np.nan_to_num(modal_assurance(shape, shapes)) for shape in (measured.shapes, shapes))
    paired = _pair(mac, measured.frequency_hz, frequencies)
    pairs = _pairs_of_frequencies(measured.frequency_hz, frequencies, mac, paired)
    number = 1 + np.arange(frequencies.size)
    modes = COMPARED_MODES.dataset({
        "contacts": contacts, "source": measured.source, "measured": 1 + np.arange(paired.size), "predicted": number,
        "other": number, "measured_hz": measured.frequency_hz, "predicted_hz": frequencies, "mac": mac,
        "auto_mac": auto, "paired": paired,
        "difference": [np.nan if pair["difference"] is None else pair["difference"] for pair in pairs],
    })  # fmt: skip
    fitting: list[dict[str, Any]] = [pair for pair in pairs if pair["predicted"]]
    return ModeComparison(
        scenario=scenario,
        outcome=COMPLETE,
        warnings=tuple(_warnings(scenario, paired, auto, measured)),
        datasets={"compared_modes": modes},
        wall_time_s=perf_counter() - begin,
    ).with_summary(
        pairs=pairs,
        lowest_mac=min(pair["mac"] for pair in fitting) if len(fitting) == len(pairs) else 0.0,
        largest_difference=max((abs(pair["difference"]) for pair in fitting), default=float("nan")),
    )


def _pairs_of_frequencies(measured: Floats, computed: Floats, mac: Floats, paired: Ints) -> list[dict[str, Any]]:
    """For each measured mode its entries of the summary.

    Parameters
    ----------
    measured, computed : (a,) and (b,) frequencies, Hz.
    mac : (a, b) modal assurance criterion.
    paired : (a,) number of the computed mode, from 1; 0 without one.
    """
    return [
        {
            "number": k + 1,
            "measured_hz": float(f),
            "predicted": int(number),
            "predicted_hz": float(computed[number - 1]) if number else None,
            "difference": float(computed[number - 1] / f - 1.0) if number else None,
            "mac": float(mac[k, number - 1] if number else mac[k].max(initial=0.0)),
        }
        for k, (f, number) in enumerate(zip(measured, paired, strict=True))
    ]


def _check(measured: ShapesAtPlaces) -> None:
    if len(measured.places) < 2:
        raise _record_error(measured.source, f"has {len(measured.places)} place", "give at least two places")
    norms = np.linalg.norm(measured.shapes, axis=0)
    if not np.all(np.isfinite(norms)) or np.any(norms == 0.0):
        k = int(np.flatnonzero(~(norms > 0.0) | ~np.isfinite(norms))[0])
        raise _record_error(
            measured.source, f"has no motion in the mode at {measured.frequency_hz[k]:g} Hz", "leave the mode out"
        )
    if np.any(measured.frequency_hz <= 0.0):
        raise _record_error(measured.source, "has a frequency that is not positive", "give natural frequencies in Hz")


def _computed_modes(scenario: Scenario, measured: ShapesAtPlaces, *, closed: bool) -> tuple[Floats, Floats]:
    """(n,) frequencies, Hz, and (p, n) shapes of computed modes at the places."""
    # 1.5: times the highest measured frequency, up to which computed modes are compared
    # 4: more than were measured
    highest, least = 1.5 * float(measured.frequency_hz.max()), measured.frequency_hz.size + 4
    sites = []
    for label, place in zip(measured.labels or [""] * len(measured.places), measured.places, strict=True):
        for problem in place.problems(scenario, ("probes",)):
            raise _record_error(measured.source, f"{label}: {problem.message}".strip(": "), problem.remedy)
        sites.append(site_in(scenario, place))
    if scenario.reduction is None:
        scenario = scenario.model_copy(update={"reduction": Reduction(highest_frequency=highest)})
        if build_reduced_model(scenario).basis.modes < least:
            scenario = scenario.model_copy(update={"reduction": Reduction(modes=least)})
    model = build_reduced_model(scenario)
    try:
        shapes = model.shapes(sites)
    except ValueError as error:
        raise _record_error(measured.source, f"names a place that the structure does not have: {error}", "") from None
    omega = model.omega[: model.basis.modes]
    if closed:
        contacts, count = build_system(scenario).dynamics.contacts, len(model.snubber_sites)
        omega, modes = closed_modes(
            model.omega, contacts.shape[:count], contacts.quasi_static[0][:count], model.basis.rigid_count
        )
        shapes = shapes @ modes
    frequencies = omega / (2 * np.pi)
    order = np.argsort(frequencies, kind="stable")
    most = max(int(np.sum(frequencies <= highest)), min(least, frequencies.size))
    return frequencies[order][:most], shapes[:, order[:most]]


FREQUENCY_WEIGHT = 0.01  # weight of a difference of log frequencies relative to the MAC, for the pairing


def _pair(mac: Floats, measured: Floats, computed: Floats) -> Ints:
    """(m,) number from 1 of the computed mode paired with each measured one; 0 if none fits."""
    from scipy.optimize import linear_sum_assignment

    apart = np.abs(np.log(np.maximum(computed, 1e-3 * measured.min())[None, :] / measured[:, None]))
    rows, columns = linear_sum_assignment(mac - FREQUENCY_WEIGHT * apart, maximize=True)
    paired = np.zeros(measured.size, dtype=np.int64)
    fits = mac[rows, columns] > LEAST_PAIR_MAC
    paired[rows[fits]] = columns[fits] + 1
    return paired


INDISTINCT_MAC = 0.9  # MAC of two computed shapes above which the places cannot distinguish them


MOST_WARNINGS = 4  # about shapes that cannot be distinguished; more are combined into one


def _warnings(scenario: Scenario, paired: Ints, auto_mac: Floats, measured: ShapesAtPlaces) -> Iterator[str]:
    for k in np.flatnonzero(paired == 0):
        yield f"no computed mode fits the measured mode at {measured.frequency_hz[k]:g} Hz"
    count = auto_mac.shape[0]
    groups: dict[tuple[int, ...], list[int]] = {}  # by the modes that look like a paired one, itself included
    for number in paired[paired > 0] - 1:
        alike = tuple(j + 1 for j in range(count) if j == number or auto_mac[number, j] > INDISTINCT_MAC)
        if len(alike) > 1:
            groups.setdefault(alike, []).append(number + 1)
    if len(groups) > MOST_WARNINGS:
        doubtful = sum(map(len, groups.values()))
        yield (
            f"{len(measured.places)} measured places cannot distinguish {doubtful} of {np.count_nonzero(paired)} "
            "paired modes from others: measure at more places"
        )
        return
    for alike, numbers in groups.items():
        listed = ", ".join(str(number) for number in alike if number not in numbers or len(numbers) > 1)
        called = f"modes {listed} look alike" if len(numbers) > 1 else f"mode {numbers[0]} looks like mode {listed}"
        yield f"at the measured places {called}: measure at more places"


_PLACE = ("body", "position", "x", "y", "mass", "node", "direction")
_COMPONENTS = {"x": "r1", "y": "r2", "z": "r3", "rx": "r4", "ry": "r5", "rz": "r6"}
_LAYOUT = "give columns position (and y), mass, or node and direction, then a column a mode, headed by its frequency"


def read_shapes(path: Path | str, scenario: Source, decimal: DecimalMark | None = None) -> ShapesAtPlaces:
    """Read mode shapes from a file; nodes of a UFF file are placed by coordinates if the bodies have no nodes.

    Parameters
    ----------
    path : path of the file.
    scenario : scenario with the bodies, or anything that `beamsim.load_scenario` reads.
    decimal : decimal mark of a text file, if the user states it.

    Returns
    -------
    ShapesAtPlaces

    Raises
    ------
    ScenarioError
        If the file is missing or empty, or a value is wrong; the message gives line and column.

    Examples
    --------
    >>> import beamsim, pathlib, tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> file = pathlib.Path(folder.name) / "shapes.csv"
    >>> _ = file.write_text("position (mm), 52 Hz, 330 Hz\\n90, 0.16, 0.8\\n180, 0.54, 0.45\\n270, 1.0, -1.0\\n")
    >>> beamsim.read_shapes(file, "configs/one_sided_65hz.yaml").frequency_hz.tolist()
    [52.0, 330.0]
    >>> folder.cleanup()
    """
    path, scenario = Path(path), scenario_of(scenario)
    if not scenario.all_bodies:
        raise no_structure()
    try:
        suffix = ending_of(path)
        with reading(path, "mode shapes"):
            if suffix in (*UNIVERSAL, ".55"):
                return _read_uff(path, scenario)
            if suffix in TEXT:
                return _read_csv(path, decimal)
    except InputFileError as fault:
        raise _record_error(path, fault.message, fault.remedy) from None
    raise _record_error(path, "has an unknown format", "use .csv or .uff")


def _read_csv(path: Path, decimal: DecimalMark | None) -> ShapesAtPlaces:
    table = read_named_columns(path, decimal, texts=("body", "direction"))
    if not table.rows:
        raise _record_error(path, "has no table", _LAYOUT)
    first, heading = table.line, table.headings
    named = [split_heading(cell) for cell in heading]
    of_place = {name.lower(): k for k, (name, _) in enumerate(named) if name.lower() in _PLACE}
    modes = [k for k in range(len(heading)) if k not in of_place.values()]
    if not of_place or not modes:
        raise _record_error(path, f"line {first}: has no column of a {'mode' if of_place else 'place'}", _LAYOUT)
    frequencies = [_frequency(path, first, k, heading[k]) for k in modes]
    places, labels, shapes = [], [], []
    for number, row in table.rows:
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
        raise _record_error(path, message, _LAYOUT) from None


def _number(path: Path, line: int, column: int, text: str) -> complex:
    try:
        value = complex(text.replace(" ", "").replace("i", "j"))
    except ValueError:
        value = complex("nan")
    if not np.isfinite(value):
        raise _record_error(
            path, f"line {line}, column {column + 1} = {text} is not a number", "write 0.3, or 0.3+0.1j"
        )
    return value


def _place(path: Path, line: int, cells: Mapping[str, tuple[str, str]]) -> AtPlace:
    def length(name: str) -> Any:
        text, unit = cells[name]
        return text if text.endswith("%") else f"{text} {unit}" if unit else text

    keys: dict[str, Any] = {name: cells[name][0] for name in ("body", "direction") if name in cells}
    numbers = {name: cells[name][0] for name in ("mass", "node") if name in cells}
    keys |= {name: int(text) if text.isdigit() else text for name, text in numbers.items()}
    first = "position" if "position" in cells else "x"
    if first in cells:
        keys["position"] = [length(first), length("y")] if "y" in cells else length(first)
    try:
        return AtPlace.model_validate(keys)
    except ValidationError as error:
        details = error.errors(include_url=False)[0]
        context = details.get("ctx", {})
        message = context.get("message", details["msg"])
        raise _record_error(path, f"line {line}: the place {message}", str(context.get("remedy") or _LAYOUT)) from None


def _read_uff(path: Path, scenario: Scenario) -> ShapesAtPlaces:
    sets = data_sets(path)
    modes = _modes(path, sets)
    nodes = [int(node) for node in modes[0].fields["node_nums"]]
    if any([int(node) for node in mode.fields["node_nums"]] != nodes for mode in modes):
        raise _record_error(path, "has modes at different nodes", "export all modes at the same nodes")
    frequencies = np.array([_uff_frequency(mode.fields) for mode in modes])
    motion = {direction: _motion(path, modes, direction, len(nodes)) for direction in _COMPONENTS}
    coordinates, owners = _coordinates(sets), _owners(sets, scenario)
    bodies = scenario.all_bodies
    places, labels, rows = [], [], []
    for k, node in enumerate(nodes):
        name = owners.get(node) if len(bodies) > 1 else next(iter(bodies))
        if name is None:
            raise _record_error(
                path, f"does not assign node {node} to a body, and there are several bodies",
                f"give each a trace line (dataset 82) named {', '.join(bodies)}, or use CSV with a column body",
            )  # fmt: skip
        body = bodies[name]
        of = {"body": name} if len(bodies) > 1 else {}
        named = body.node_of_number(node)
        has_nodes = named is not None
        if body.has_members and not has_nodes:  # a point inside a member
            continue
        for direction, row in ((direction, motion[direction][k]) for direction in _COMPONENTS):
            if not row.any() or not (has_nodes or direction == "z"):
                continue
            if has_nodes:
                places.append(AtPlace.model_validate({**of, "node": named, "direction": direction}))
            elif node in coordinates:
                places.append(AtPlace.model_validate({**of, **_point_of(body, coordinates[node])}))
            else:
                raise _record_error(
                    path, f"has no coordinates of node {node}", "export dataset 15 or 2411 too, or use CSV"
                )
            labels.append(f"node {node} {direction}")
            rows.append(row)
    if not rows:
        moving = [direction for direction, values in motion.items() if values.any()]
        if not moving:
            raise _record_error(path, "has shapes without any motion", "export them again")
        raise _record_error(
            path, f"has shapes with motion only in {' and '.join(moving)}, but the bodies of this case deflect in z",
            "turn the axes of the measurement so that z is the direction of the deflection, or use CSV",
        )  # fmt: skip
    return ShapesAtPlaces(tuple(places), frequencies, np.array(rows), str(path), tuple(labels))


# normal modes, and complex ones by eigenvalues of the first and of the second order
_MODES = (2, 3, 7)


def _modes(path: Path, data_sets: Sequence[DataSet]) -> list[DataSet]:
    """Data sets 55 with displacements, velocities or accelerations of a mode."""
    of_modes = [each for each in data_sets if each.number == 55 and each.fields.get("analysis_type") in _MODES]
    # 2, 3: vectors of three and of six components; 2 to 7, 9, 10: of stresses, strains, forces and energies
    moving = [
        each
        for each in of_modes
        if each.fields["data_ch"] in (0, 2, 3) and each.fields["spec_data_type"] in (0, 1, 8, 11, 12)
    ]
    if of_modes and not moving:
        first = of_modes[0]
        raise _record_error(
            path, f"has only modes of stresses, strains or forces ({first.place})", "export displacements"
        )
    if not moving:
        raise _record_error(path, "has no mode shapes", "export them as dataset 55 (normal or complex modes)")
    return moving


def _motion(path: Path, modes: Sequence[DataSet], direction: str, count: int) -> Complexes:
    """(count, m) motion of the nodes in one direction, m or rad up to a factor for each mode.

    Components below 1e-6 of the motion of all modes count as round-off.
    """
    columns = []
    for mode in modes:
        values = np.asarray(mode.fields.get(_COMPONENTS[direction], np.zeros(count)), dtype=complex)
        if values.shape != (count,):
            raise _record_error(path, f"has {count} nodes and {values.size} values ({mode.place})", "export it again")
        largest = max(np.abs(mode.fields[key]).max(initial=0.0) for key in mode.fields if re.fullmatch("r[1-6]", key))
        values = np.where(np.abs(values) > 1e-6 * largest, values, 0.0)
        columns.append(values / (mode.units.per_metre or 1.0) if len(direction) == 1 else values)
    return np.column_stack(columns)


def _coordinates(data_sets: Sequence[DataSet]) -> dict[int, tuple[float, float]]:
    """x and y of the nodes, m, from data sets 15 and 2411 in the units that precede each."""
    found = {}
    for each in data_sets:
        if each.number in (15, 2411):
            size, fields = each.units.per_metre or 1.0, each.fields
            for node, x, y in zip(fields["node_nums"], fields["x"], fields["y"], strict=True):
                found[int(node)] = (float(x) / size, float(y) / size)
    return found


def _owners(data_sets: Sequence[DataSet], scenario: Scenario) -> dict[int, str]:
    """Body of each node on a trace line that has the name of a body."""
    lines = {str(each.fields["id"]).strip(): each.fields["nodes"] for each in data_sets if each.number == 82}
    return {
        int(node): name for name, numbers in lines.items() if name in scenario.all_bodies for node in numbers if node
    }


def _point_of(body: Body, coordinates: tuple[float, float]) -> dict[str, Any]:
    """Keys of a place: x and y, m, on a plate; x along a beam; the number of a mass in a chain."""
    usual = body.default_probe()[1] if body.has_default_probe else None
    if usual is not None and usual.mass is not None:
        return {"mass": round(coordinates[0])}
    x, y = coordinates
    return {"position": (x, y) if usual is not None and isinstance(usual.position, tuple) else x}


def _uff_frequency(mode: Mapping[str, Any]) -> float:
    if mode["analysis_type"] == 2:
        return float(np.real(mode["freq"]))
    return float(abs(np.imag(mode["eig"])) / (2 * np.pi))


def _record_error(source: Path | str, message: str, remedy: str) -> ScenarioError:
    return ScenarioError.at("", f"{source} {message}", remedy)
