"""Values of two solutions of one case, and their relative changes.

Values are numbers by entry of a summary, or by entry and place: a probe, a snubber, a curve with one of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from beamsim.analyses.run.result import ALLOWED_CHANGE

FREQUENCIES = 6  # natural frequencies that are compared
ROUND_OFF = 1e-9  # of the largest value of its kind, which a smaller one is compared with

Values = dict[str, dict[str, float] | float]
Changes = Values  # relative


def compared(summary: Mapping[str, Any]) -> Values:
    """Values as numbers, or numbers by place; natural frequencies by their number."""
    values: Values = {}
    for name, value in summary.items():
        if isinstance(value, Sequence):
            values[name] = {str(k): float(x) for k, x in enumerate(value[:FREQUENCIES], 1)}
        else:
            values[name] = dict(by_place(value)) if isinstance(value, Mapping) else float(value)
    return values


def by_place(value: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    """Values by place; of several curves by curve and place."""
    for name, each in value.items():
        if isinstance(each, Mapping):
            yield from by_place(each, f"{before}{name} ")
        else:
            yield f"{before}{name}", each


def places(value: dict[str, float] | float) -> list[tuple[str, float]]:
    """Places with their numbers; the place of a single number is empty."""
    return list(value.items()) if isinstance(value, dict) else [("", value)]


def named(values: Values) -> Iterator[tuple[str, float]]:
    """``entry.place`` with the number, ``entry`` where there is one number alone."""
    for name, value in values.items():
        yield from ((f"{name}.{place}" if place else name, number) for place, number in places(value))


def unchanged(values: Values) -> Changes:
    """Changes of 0."""
    return {name: dict.fromkeys(value, 0.0) if isinstance(value, dict) else 0.0 for name, value in values.items()}


def relative_changes(
    first: Sequence[Values], second: Sequence[Values], *, scatter: bool = False, whole: Values | None = None
) -> Changes:
    """Relative change of the means of values, or two standard errors of it.

    Parameters
    ----------
    first, second : the values of parts of two motions, or of the whole of each.
    scatter : whether to return the standard errors.
    whole : values that the changes are relative to if they are larger.

    Returns
    -------
    By entry and place of the first; places that the second does not have are left out.
    """
    changes: Changes = {}
    for name, value in first[0].items():
        of_entry = list(value) if isinstance(value, dict) else [""]
        one, other = (np.array([_row(part.get(name, {}), of_entry) for part in parts]) for parts in (first, second))
        of_scale = (one, other)
        if name.startswith(("min_", "max_")):  # either may be zero
            peaks = [[_row(part[f"peak{name[3:]}"], of_entry) for part in parts] for parts in (first, second)]
            of_scale = (np.array(peaks[0]), np.array(peaks[1]))
        scale = np.maximum(*(np.abs(x).mean(axis=0) for x in of_scale))
        if whole is not None:
            of_whole = whole[f"peak{name[3:]}" if name.startswith(("min_", "max_")) else name]
            scale = np.maximum(scale, np.abs(_row(of_whole, of_entry)))
        if not name.endswith("_output"):  # which have units of their own
            scale = np.maximum(scale, ROUND_OFF * np.nanmax(scale, initial=0.0))
        difference = one - other
        size = np.abs(difference.mean(axis=0))
        if scatter:
            size = 2 * difference.std(axis=0, ddof=1) / math.sqrt(len(first))
        relative = np.divide(size, scale, out=np.zeros_like(size), where=size > 0)
        by_place = {place: float(x) for place, x in zip(of_entry, relative, strict=True) if not math.isnan(x)}
        changes[name] = by_place if isinstance(value, dict) else by_place.get("", 0.0)
    return changes


def _row(value: dict[str, float] | float, of_entry: Sequence[str]) -> list[float]:
    return [value.get(place, math.nan) for place in of_entry] if isinstance(value, dict) else [value]


def larger(one: Changes, other: Changes) -> Changes:
    """The larger of two changes of each value."""
    out = dict(one)
    for name, value in other.items():
        present = out.get(name, value)
        if isinstance(value, dict) and isinstance(present, dict):
            out[name] = {place: max(x, present.get(place, 0.0)) for place, x in value.items()}
        elif not isinstance(value, dict) and not isinstance(present, dict):
            out[name] = max(value, present)
    return out


def doubtful(changes: Changes, scatter: Changes) -> Iterator[str]:
    """``entry.place`` of the values that change by more than is allowed, and than their scatter explains."""
    chance = dict(named(scatter))
    yield from (key for key, change in named(changes) if change > ALLOWED_CHANGE + chance.get(key, 0.0))
