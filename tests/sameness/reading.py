"""What a printed summary and a result file hold, as paths and values that can be compared.

A value is a number (float or integer), a text, or a list:

- ``["f", shape, not finite, sum of absolute values, Euclidean norm, product with a fixed vector]`` of many numbers,
- ``["i", shape, sum of absolute values, CRC32]`` of many integers or booleans.
"""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np

LEFT_OUT = {
    *("files", "input_files", "created", "provenance", "scenario", "schema_version", "beamsim_version", "json_encoded"),
    *("wall_time_s", "processor_time_s", "shooting_processor_time_s", "cost_ratio"),
    *("CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST"),
}
"""Names of values that depend on time, machine or version, and of what HDF5 needs itself."""

SORTED = ("floquet_multipliers",)
"""Beginnings of the names of datasets whose rows have no order of their own."""

GATHERED = ("long_name", "units", "flag_meanings")
"""Texts that are gathered by the last part of a path, as they are the same for every probe and branch."""


def rounded(value: float) -> float | str:
    """A number to 12 significant digits; text where JSON has none for it."""
    return float(f"{value:.12g}") if math.isfinite(value) else str(value)


def digest(array: Any) -> Any:
    """What the table holds of a number or an array of numbers."""
    array = np.asarray(array)
    if array.dtype.kind in "biu":
        whole = array.astype(np.int64)
        if whole.ndim == 0:
            return int(whole)
        return ["i", list(whole.shape), int(np.abs(whole).sum()), zlib.crc32(np.ascontiguousarray(whole).tobytes())]
    if array.dtype.kind == "c":
        array = np.stack([array.real, array.imag])
    array = array.astype(float)
    if array.ndim == 0:
        return rounded(float(array))
    finite = np.isfinite(array)
    flat = np.where(finite, array, 0.0).ravel()
    product = flat @ np.cos(1.0 + 0.7 * np.arange(flat.size))
    sums = [rounded(float(x)) for x in (np.abs(flat).sum(), np.sqrt(flat @ flat), product)]
    return ["f", list(array.shape), int((~finite).sum()), *sums]


def flattened(path: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Paths and leaves of a JSON value; lists of records become columns, lists of numbers checksums."""
    if isinstance(value, dict):
        for name, part in value.items():
            yield from flattened(f"{path}/{name}" if path else name, part)
    elif isinstance(value, list):
        scalar = (bool, int, float, type(None))
        if value and all(isinstance(part, scalar) for part in value):
            yield path, digest([math.nan if part is None else part for part in value])
        elif value and all(isinstance(part, str | None) for part in value):
            yield path, " ".join(map(str, value))
        elif (
            value
            and all(isinstance(part, dict) for part in value)
            and not any(isinstance(leaf, dict | list) for part in value for leaf in part.values())
        ):
            yield f"{path}/count", len(value)
            for name in dict.fromkeys(name for part in value for name in part):
                yield from flattened(f"{path}/{name}", [part.get(name) for part in value])
        else:
            yield f"{path}/count", len(value)
            for index, part in enumerate(value):
                yield from flattened(f"{path}/{index}", part)
    else:
        yield path, value if isinstance(value, str) else "none" if value is None else digest(value)


def stored(path: Path) -> Iterator[tuple[str, Any]]:
    """Paths and leaves of a result file: datasets by their names, attributes after an ``@``."""

    def attributes(name: str, holder: Any) -> Iterator[tuple[str, Any]]:
        for key, value in holder.attrs.items():
            text = value.decode() if isinstance(value, bytes) else value
            place = f"{name.split('/')[-1] if key in GATHERED else name}@{key}"
            if isinstance(text, np.ndarray) and text.dtype.kind in "OSU":
                yield place, " ".join(x.decode() if isinstance(x, bytes) else str(x) for x in text.ravel())
            elif isinstance(text, str):
                if text[:1] not in ("[", "{"):
                    yield place, text
                elif name != "summary":  # printed as well
                    yield from flattened(place, json.loads(text))
            elif isinstance(text, np.ndarray | np.generic) and text.dtype.kind in "biufc":
                yield place, digest(text)

    names: list[str] = []
    with h5py.File(path) as file:
        file.visit(names.append)
        yield from attributes("", file)
        for name in names:
            item = file[name]
            if isinstance(item, h5py.Dataset):
                stem = name.removesuffix("_real")
                if item.dtype.kind == "O":
                    yield name, " ".join(map(str, item.asstr()[...].ravel()))
                elif stem != name and f"{stem}_imag" in file:
                    both = np.stack([item[...], file[f"{stem}_imag"][...]])
                    yield f"{stem}_complex", digest(np.sort(both) if stem.split("/")[-1].startswith(SORTED) else both)
                elif item.dtype.kind in "biufc" and not (name.endswith("_imag") and f"{name[:-5]}_real" in file):
                    yield name, digest(item[...])
            yield from attributes(name, item)


def kept(pairs: Iterable[tuple[str, Any]], prefix: str) -> dict[str, Any]:
    """The values that the table holds; different texts of one path are joined."""
    result: dict[str, Any] = {}
    for path, value in pairs:
        place = prefix + path
        if LEFT_OUT & set(path.replace("@", "/").split("/")):
            continue
        if place in result and value not in result[place].split(" | "):
            result[place] = f"{result[place]} | {value}"
        result.setdefault(place, value)
    return result


def is_text(value: Any) -> bool:
    """Whether a value is a text, and not a number that JSON cannot write."""
    return isinstance(value, str) and value not in ("nan", "inf", "-inf", "none")
