"""How values that are no numbers, texts or tuples of these are kept as attributes of a result file."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from beamsim.outcomes import Outcome


class Codec(NamedTuple):
    """A pair of functions: from a value to attributes, and back."""

    write: Callable[[str, Any], Mapping[str, Any]]  # of the attribute's name and the value
    read: Callable[[str, Mapping[str, Any]], Any]  # of the name and the attributes of the group


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


def as_text(write: Callable[[Any], str], read: Callable[[str], Any]) -> Codec:
    """A value as one text."""
    return Codec(lambda name, value: {name: write(value)}, lambda name, attributes: read(str(attributes[name])))


def as_json(null: float = math.nan) -> Codec:
    """A value as JSON, whose lists become tuples and whose nulls become numbers."""

    def value_of(item: Any) -> Any:
        if isinstance(item, list):
            return tuple(value_of(each) for each in item)
        if isinstance(item, dict):
            return {key: value_of(each) for key, each in item.items()}
        return null if item is None else item

    return as_text(lambda value: json.dumps(plain(value), ensure_ascii=False), lambda text: value_of(json.loads(text)))


JSON = as_json()


def _outcome_attributes(_: str, outcome: Outcome) -> dict[str, str]:
    values = outcome.as_dict()
    code = values.pop("code")
    return {"status": outcome.text, "outcome": code, "outcome_numbers": json.dumps(values, ensure_ascii=False)}


def _read_outcome(_: str, attributes: Mapping[str, Any]) -> Outcome:
    return Outcome.from_dict({"code": str(attributes["outcome"]), **json.loads(attributes["outcome_numbers"])})


OUTCOME = Codec(_outcome_attributes, _read_outcome)
