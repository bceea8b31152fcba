"""The result file of a design study.

``/designs`` holds a coordinate for every varied path and a dataset for every response. The axes of a grid are
dimension scales; zipped and sampled studies have one axis, ``case``, and the varied numbers along it (CF
``coordinates``). Responses of a probe or snubber are in ``/designs/probes/<name>`` and ``/designs/snubbers/<name>``;
``/designs/margins`` holds limit / value - 1 for every limit, ``/designs/solved`` says which cases have responses.
What failed, and why, is the JSON attribute ``failures`` of ``/designs``. Attributes of ``/summary`` are the printed
numbers.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from beamsim.analyses.designs.result import CaseFailure, Coordinate, DesignsResult, Response
from beamsim.files import replacing
from beamsim.outcomes import Outcome
from beamsim.store import schema
from beamsim.store.datasets import put, texts, words
from beamsim.store.outcomes import outcome_of_text
from beamsim.store.schema import Field
from beamsim.store.stored import LazyScenario, creating, reading, root_fields, write_root

COMMAND = "sweep"
GROUP = "designs"


def write_designs(result: DesignsResult, path: Path | str) -> Path:
    """Write ``result`` to ``path``; an existing file is replaced only when the new one is complete.

    Raises
    ------
    ResultFileError
        When the file cannot be written.
    """
    with creating(path) as file:
        write_root(file, result, COMMAND)
        group = file.create_group(GROUP)
        group.attrs.update(
            {
                "analysis": result.analysis,
                "kind": result.kind,
                "paths": json.dumps([c.path for c in result.coordinates]),
                "responses": json.dumps(list(result.responses), ensure_ascii=False),
                "limits": json.dumps(dict(result.limits)),
                "failures": json.dumps(
                    [[f.case, list(f.values), f.outcome.text, f.outcome.as_dict()] for f in result.failures],
                    ensure_ascii=False,
                ),
                "fingerprint": result.fingerprint,
            }
        )
        scales, hint = _write_coordinates(group, result)
        _flags(group, result, scales, hint)
        for response in result.responses.values():
            _write_response(group, response, scales, hint)
        for margin in result.margins.values():
            _write_response(group.require_group("margins"), margin, scales, hint)
    return Path(path)


class StoredDesigns(LazyScenario, DesignsResult):
    """A study read from a file."""


def open_designs(path: Path | str) -> StoredDesigns:
    """Read the result file of a design study.

    Raises
    ------
    ResultFileError
        When the file is missing, damaged, or holds something else.
    """
    with reading(path, "designs") as file:
        return StoredDesigns.of(_fields(file))


def export_designs(result: DesignsResult, path: Path) -> Path:
    """Write the table of a study as CSV: a row a case, with the varied numbers first.

    Raises
    ------
    ResultFileError
        When the file cannot be written.
    """
    import csv

    names = ["case"]
    columns: list[list[Any]] = [np.arange(1, result.cases + 1).tolist()]
    rows = [result.case_values(k) for k in range(result.cases)]
    for k, c in enumerate(result.coordinates):
        names.append(_header(c.path, c.unit))
        columns.append([row[k] for row in rows])
    margins = {f"margins/{name}": margin for name, margin in result.margins.items()}
    for name, r in {**result.responses, **margins}.items():
        table = r.values.reshape(result.cases, -1)
        many = r.values.ndim > len(result.shape)
        for k, column in enumerate(table.T, 1):
            names.append(_header(f"{name}_{k}" if many else name, r.unit))
            columns.append(column.tolist())
    with replacing(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows(zip(*columns, strict=True))
    return path


def _header(name: str, unit: str) -> str:
    return name if unit == "1" else f"{name} ({unit})"


def _write_coordinates(group: h5py.Group, result: DesignsResult) -> tuple[list[h5py.Dataset], str]:
    """Write the coordinates; returns the scales of the design's axes, and the CF attribute of what lies along them."""
    if result.kind == "grid":
        return [_coordinate(group, c, scale=True) for c in result.coordinates], ""
    case = put(group, Field("case", "1", "number of the case"), np.arange(1, result.cases + 1), scale=True)
    for c in result.coordinates:
        _coordinate(group, c).dims[0].attach_scale(case)
    return [case], " ".join(c.path for c in result.coordinates)


def _coordinate(group: h5py.Group, coordinate: Coordinate, scale: bool = False) -> h5py.Dataset:
    values = coordinate.values
    if not coordinate.numeric:
        values = words(values.tolist())
    return put(group, Field(coordinate.path, coordinate.unit, f"varied {coordinate.path}"), values, scale=scale)


def _flags(group: h5py.Group, result: DesignsResult, scales: list[h5py.Dataset], hint: str) -> None:
    field = Field("solved", "1", "whether the case has responses", ("missing", "solved"))
    _hinted(put(group, field, result.solved, *scales), hint)


def _write_response(group: h5py.Group, response: Response, scales: list[h5py.Dataset], hint: str) -> None:
    *parents, quantity = response.name.split("/")
    for parent in parents:
        group = group.require_group(schema.group_name(parent))
    dataset = put(group, Field(quantity, response.unit, response.long_name), response.values, *scales)
    dataset.attrs["name"] = response.name
    _hinted(dataset, hint)
    if response.values.ndim > len(scales):
        modes = response.values.shape[-1]
        if "mode" not in group:
            put(group, schema.MODE_NUMBER, np.arange(1, modes + 1), scale=True)
        if group["mode"].size == modes:
            dataset.dims[len(scales)].attach_scale(group["mode"])


def _hinted(dataset: h5py.Dataset, hint: str) -> None:
    if hint:
        dataset.attrs["coordinates"] = hint


def _fields(file: h5py.File) -> dict[str, Any]:
    group = file[GROUP]
    solved = group["solved"][()].astype(bool)
    margins = group["margins"].values() if "margins" in group else ()
    return {
        **root_fields(file),
        "analysis": group.attrs["analysis"],
        "kind": group.attrs["kind"],
        "shape": solved.shape,
        "coordinates": tuple(_read_coordinate(group[path]) for path in json.loads(group.attrs["paths"])),
        "solved": solved,
        "responses": {name: _read_response(group[_link(name)]) for name in json.loads(group.attrs["responses"])},
        "margins": {item.attrs["name"]: _read_response(item) for item in margins},
        "limits": json.loads(group.attrs["limits"]),
        "failures": tuple(_failure(*item) for item in json.loads(group.attrs["failures"])),
        "fingerprint": group.attrs["fingerprint"],
    }


def _failure(case: int, values: list[Any], text: str, outcome: dict[str, Any] | None = None) -> CaseFailure:
    """A case without responses; older files have no more than the text."""
    return CaseFailure(case, tuple(values), outcome_of_text(text) if outcome is None else Outcome.from_dict(outcome))


def _link(name: str) -> str:
    *parents, quantity = name.split("/")
    return "/".join([*(schema.group_name(parent) for parent in parents), quantity])


def _read_coordinate(dataset: h5py.Dataset) -> Coordinate:
    values = np.array(texts(dataset)) if h5py.check_string_dtype(dataset.dtype) is not None else dataset[()]
    return Coordinate(dataset.name.rpartition("/")[2], values, dataset.attrs["units"])


def _read_response(dataset: h5py.Dataset) -> Response:
    attributes = dataset.attrs
    return Response(attributes["name"], dataset[()], attributes["units"], attributes["long_name"])
