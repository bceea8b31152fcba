"""CSV of a design study."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np

from beamsim.analyses.designs.result import DesignsResult
from beamsim.files import replacing


def export_designs(result: DesignsResult, path: Path) -> Path:
    """Write the table of a study as CSV: a row a case, with the varied numbers first.

    Raises
    ------
    ResultFileError
        When the file cannot be written.
    """
    names = ["case"]
    columns: list[list[Any]] = [np.arange(1, result.cases + 1).tolist()]
    rows = [result.case_values(k) for k in range(result.cases)]
    for k, c in enumerate(result.coordinates):
        names.append(_header(c.path, c.unit))
        columns.append([row[k] for row in rows])
    for name, realised in result.realised.items():
        for suffix, values in (("smallest", realised.values.min(axis=-1)), ("largest", realised.values.max(axis=-1))):
            names.append(_header(f"{name}_{suffix}", realised.unit))
            columns.append(values.ravel().tolist())
    margins = {f"margins/{name}": margin for name, margin in result.margins.items()}
    for name, r in {**result.responses, **margins}.items():
        table = r.values.reshape(result.cases, -1)
        many = r.values.ndim > len(result.shape)
        for k, column in enumerate(table.T, 1):
            names.append(_header(f"{name}_{k}" if many else name, r.unit))
            columns.append(column.tolist())
    if result.passing is not None:
        names.append("passing")
        columns.append(result.passing.ravel().astype(int).tolist())
    if result.passing_share is not None:
        names.append("passing_share")
        columns.append(result.passing_share.ravel().tolist())
    with replacing(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows(zip(*columns, strict=True))
    return path


def _header(name: str, unit: str) -> str:
    return name if unit == "1" else f"{name} ({unit})"
