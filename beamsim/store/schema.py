"""Conventions of all result files: version of the layout, links made from names, the summary as attributes.

The contents are declared by the results (`beamsim.fields`) and listed in docs/result_files.md.

``/summary`` has no datasets, only attributes under the names of the summary. Numbers and texts are
native attributes; everything else (per-probe values, lists, truth values, nothing) is a JSON text, and the
attribute ``json_encoded`` lists the names of those, separated by spaces. A NaN is ``null`` in JSON: inside a
list or an object read it back as NaN.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

SCHEMA_VERSION = 1
JSON_ENCODED = "json_encoded"


def group_name(name: str) -> str:
    """A probe's or snubber's name as an HDF5 link: no slash, not ``.``."""
    link = name.replace("/", "∕")
    return f"_{link}" if link.strip(".") == "" else link


def plain(value: Any) -> Any:
    """A value made of built-in types for strict JSON; numbers that are not finite become None."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def encode_summary(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Summary as attributes, see the module's docstring."""
    attributes: dict[str, Any] = {}
    encoded = []
    for name, value in summary.items():
        if isinstance(value, (str, int, float, np.integer, np.floating)) and not isinstance(value, bool):
            attributes[name] = value
        else:
            attributes[name] = json.dumps(plain(value), ensure_ascii=False)
            encoded.append(name)
    attributes[JSON_ENCODED] = " ".join(encoded)
    return attributes


def decode_summary(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Inverse of `encode_summary`."""
    encoded = set(str(attributes[JSON_ENCODED]).split())
    summary: dict[str, Any] = {}
    for name, value in attributes.items():
        if name in encoded:
            decoded = json.loads(value)
            summary[name] = _nan_for_null(decoded) if isinstance(decoded, (dict, list)) else decoded
        elif name != JSON_ENCODED:
            summary[name] = value.item() if isinstance(value, np.generic) else value
    return summary


def _nan_for_null(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _nan_for_null(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_nan_for_null(item) for item in value]
    return math.nan if value is None else value
