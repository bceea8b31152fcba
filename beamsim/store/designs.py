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
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from beamsim.analyses.designs_results import CaseFailure, Coordinate, DesignsResult, Response
from beamsim.errors import ResultFileError
from beamsim.files import replacing
from beamsim.store import schema

if TYPE_CHECKING:
    from beamsim.scenario import Scenario

__all__ = ["COMMAND", "StoredDesigns", "export_designs", "holds_designs", "open_designs", "write_designs"]

COMMAND = "sweep"
GROUP = "designs"


def write_designs(result: DesignsResult, path: Path | str) -> Path:
    """Write ``result`` to ``path``; an existing file is replaced only when the new one is complete.

    Raises
    ------
    ResultFileError
        When the file cannot be written.
    """
    with replacing(path) as temporary, h5py.File(temporary, "x") as file:
        _write_root(file, result)
        group = file.create_group(GROUP)
        group.attrs.update(
            {
                "analysis": result.analysis,
                "kind": result.kind,
                "paths": json.dumps([c.path for c in result.coordinates]),
                "responses": json.dumps(list(result.responses), ensure_ascii=False),
                "limits": json.dumps(dict(result.limits)),
                "failures": json.dumps(
                    [[f.case, list(f.values), f.reason] for f in result.failures], ensure_ascii=False
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
        file.create_group("summary").attrs.update(schema.encode_summary(result.summary))
    return Path(path)


def holds_designs(path: Path | str) -> bool:
    """Whether a file is the result of a design study."""
    try:
        with h5py.File(path, "r") as file:
            return file.attrs.get("command") == COMMAND and GROUP in file
    except OSError:
        return False


class StoredDesigns(DesignsResult):
    """A study read from a file; its scenario is parsed when it is first asked for."""

    scenario_yaml: str
    beamsim_version: str
    _title: str

    @cached_property
    def scenario(self) -> Scenario:
        """The resolved scenario."""
        from beamsim.scenario import load_scenario

        return load_scenario(self.scenario_yaml)

    @property
    def title(self) -> str:
        """The scenario's title, known without parsing it."""
        return self._title

    @classmethod
    def _of(cls, fields: dict[str, Any]) -> StoredDesigns:
        stored = cls.__new__(cls)
        stored.__dict__.update(fields)  # the scenario is left out, so __init__ cannot be called
        return stored


def open_designs(path: Path | str) -> StoredDesigns:
    """Read the result file of a design study.

    Raises
    ------
    ResultFileError
        When the file is missing, damaged, or holds something else.
    """
    if not Path(path).is_file():
        raise ResultFileError(f"{path}: no such result file; `beamsim sweep case.yaml` writes one")
    if not holds_designs(path):
        raise ResultFileError(f"{path}: holds no design study; give the file that `beamsim sweep` wrote")
    try:
        with h5py.File(path, "r") as file:
            version = file.attrs["schema_version"]
            if version != schema.SCHEMA_VERSION:
                raise ResultFileError(
                    f"{path}: schema_version {version}, but this beamsim reads {schema.SCHEMA_VERSION}; "
                    "run its scenario again"
                )
            return StoredDesigns._of(_fields(file))
    except (KeyError, ValueError, TypeError, OSError, RuntimeError) as error:
        raise ResultFileError(f"{path}: damaged ({error}); run the case again") from error


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


def _write_root(file: h5py.File, result: DesignsResult) -> None:
    from beamsim import __version__

    file.attrs.update(
        {
            "schema_version": schema.SCHEMA_VERSION,
            "beamsim_version": __version__,
            "command": COMMAND,
            "scenario": result.scenario.to_yaml(),
            "title": result.title,
            "status": result.status,
            "created": result.created,
            "wall_time_s": result.wall_time_s,
            "warnings": json.dumps(list(result.warnings), ensure_ascii=False),
            "provenance": json.dumps(dict(result.provenance), ensure_ascii=False),
        }
    )


def _write_coordinates(group: h5py.Group, result: DesignsResult) -> tuple[list[h5py.Dataset], str]:
    """Write the coordinates; returns the scales of the design's axes, and the CF attribute of what lies along them."""
    if result.kind == "grid":
        return [_coordinate(group, c, scale=True) for c in result.coordinates], ""
    case = group.create_dataset("case", data=np.arange(1, result.cases + 1))
    case.attrs.update({"units": "1", "long_name": "number of the case"})
    case.make_scale("case")
    for c in result.coordinates:
        _coordinate(group, c).dims[0].attach_scale(case)
    return [case], " ".join(c.path for c in result.coordinates)


def _coordinate(group: h5py.Group, coordinate: Coordinate, scale: bool = False) -> h5py.Dataset:
    if coordinate.numeric:
        dataset = group.create_dataset(coordinate.path, data=coordinate.values)
    else:
        dataset = group.create_dataset(
            coordinate.path, data=coordinate.values.tolist(), dtype=h5py.string_dtype("utf-8")
        )
    dataset.attrs.update({"units": coordinate.unit, "long_name": f"varied {coordinate.path}"})
    if scale:
        dataset.make_scale(coordinate.path)
    return dataset


def _flags(group: h5py.Group, result: DesignsResult, scales: list[h5py.Dataset], hint: str) -> None:
    dataset = group.create_dataset("solved", data=result.solved.astype(np.uint8))
    dataset.attrs.update({"units": "1", "long_name": "whether the case has responses"})
    dataset.attrs["flag_values"] = np.array([0, 1], dtype=np.uint8)
    dataset.attrs["flag_meanings"] = "missing solved"
    _attach(dataset, scales, hint)


def _write_response(group: h5py.Group, response: Response, scales: list[h5py.Dataset], hint: str) -> None:
    *parents, quantity = response.name.split("/")
    for parent in parents:
        group = group.require_group(schema.group_name(parent))
    dataset = group.create_dataset(quantity, data=response.values)
    dataset.attrs.update({"units": response.unit, "long_name": response.long_name, "name": response.name})
    _attach(dataset, scales, hint)
    if response.values.ndim > len(scales):
        modes = response.values.shape[-1]
        if "mode" not in group:
            number = group.create_dataset("mode", data=np.arange(1, modes + 1))
            number.attrs.update({"units": "1", "long_name": "mode number"})
            number.make_scale("mode")
        if group["mode"].size == modes:
            dataset.dims[len(scales)].attach_scale(group["mode"])


def _attach(dataset: h5py.Dataset, scales: list[h5py.Dataset], hint: str) -> None:
    for axis, scale in enumerate(scales):
        dataset.dims[axis].attach_scale(scale)
    if hint:
        dataset.attrs["coordinates"] = hint


def _fields(file: h5py.File) -> dict[str, Any]:
    attributes, group = file.attrs, file[GROUP]
    solved = group["solved"][()].astype(bool)
    margins = group["margins"].values() if "margins" in group else ()
    return {
        "scenario_yaml": attributes["scenario"],
        "beamsim_version": attributes["beamsim_version"],
        "_title": attributes["title"],
        "analysis": group.attrs["analysis"],
        "kind": group.attrs["kind"],
        "status": attributes["status"],
        "shape": solved.shape,
        "coordinates": tuple(_read_coordinate(group[path]) for path in json.loads(group.attrs["paths"])),
        "solved": solved,
        "responses": {name: _read_response(group[_link(name)]) for name in json.loads(group.attrs["responses"])},
        "margins": {item.attrs["name"]: _read_response(item) for item in margins},
        "limits": json.loads(group.attrs["limits"]),
        "failures": tuple(CaseFailure(case, tuple(v), why) for case, v, why in json.loads(group.attrs["failures"])),
        "summary": schema.decode_summary(dict(file["summary"].attrs)),
        "warnings": tuple(json.loads(attributes["warnings"])),
        "wall_time_s": float(attributes["wall_time_s"]),
        "created": attributes["created"],
        "provenance": json.loads(attributes["provenance"]),
        "fingerprint": group.attrs["fingerprint"],
    }


def _link(name: str) -> str:
    *parents, quantity = name.split("/")
    return "/".join([*(schema.group_name(parent) for parent in parents), quantity])


def _read_coordinate(dataset: h5py.Dataset) -> Coordinate:
    words = h5py.check_string_dtype(dataset.dtype) is not None
    values = np.array(dataset.asstr()[()].tolist()) if words else dataset[()]
    return Coordinate(dataset.name.rpartition("/")[2], values, dataset.attrs["units"])


def _read_response(dataset: h5py.Dataset) -> Response:
    attributes = dataset.attrs
    return Response(attributes["name"], dataset[()], attributes["units"], attributes["long_name"])
