"""MATLAB files (version 5): nested structs under valid field names."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from beamsim.files import replacing


def write_mat(variables: Mapping[str, Any], path: Path) -> None:
    """Write nested mappings as structs; lists of numbers become columns, other lists cells, None becomes NaN.

    Raises
    ------
    ResultFileError
        If the file cannot be written.
    """
    from scipy.io import savemat

    with replacing(path) as temporary:
        savemat(
            str(temporary), _matlab(variables), appendmat=False, long_field_names=True, oned_as="column",
            do_compression=True,
        )  # fmt: skip


def _matlab(value: Any) -> Any:
    if isinstance(value, Mapping):
        fields: dict[str, Any] = {}
        for name, item in value.items():
            field = _field_name(str(name))
            while field in fields:
                field += "_"
            fields[field] = _matlab(item)
        return fields
    if isinstance(value, (list, tuple)):
        if all(isinstance(item, (int, float)) for item in value):
            return np.array(value, dtype=float)
        cells = np.empty(len(value), dtype=object)
        cells[:] = [_matlab(item) for item in value]
        return cells
    return np.nan if value is None else value


def _field_name(name: str) -> str:
    field = re.sub(r"[^0-9A-Za-z_]", "_", name)[:60]
    return field if re.match(r"[A-Za-z]", field) else f"x{field}"
