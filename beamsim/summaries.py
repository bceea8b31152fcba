"""What the summary of a result holds: its entries with units and meanings, their types, and names for people.

The summary is what is printed and what ``--json`` gives. An entry is a value that was computed for it, or repeats a
variable of the result's datasets, whose unit and meaning it then has.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from types import GenericAlias, MappingProxyType
from typing import Annotated, Any, NamedTuple, NotRequired

import numpy as np
from pydantic import Field, JsonValue, TypeAdapter, ValidationError
from typing_extensions import TypedDict  # comes with pydantic, which reads that of typing from Python 3.12 on


def as_builtin(value: Any, infinities: Mapping[float, str] = MappingProxyType({})) -> Any:
    """A value made of built-in types for strict JSON; numbers that are not finite become None.

    Parameters
    ----------
    value : numbers, texts and containers of them.
    infinities : texts in place of None for infinite numbers.
    """
    if isinstance(value, Mapping):
        return {str(key): as_builtin(item, infinities) for key, item in value.items()}
    if isinstance(value, (np.ndarray, np.generic)):
        return as_builtin(value.tolist(), infinities)
    if isinstance(value, (list, tuple)):
        return [as_builtin(item, infinities) for item in value]
    return infinities.get(value) if isinstance(value, float) and not math.isfinite(value) else value


Number = float | None
Text = str | None
Flag = bool | None
ByName = dict[str, Number]
Pair = Annotated[list[Number], Field(min_length=2, max_length=2)]
Plain = dict[str, JsonValue]  # a record that is shown as it is
"""Types of values of summaries, of which None is not known."""


def record(required: Mapping[str, Any], optional: Mapping[str, Any] | None = None) -> Any:
    """The type of a mapping with some keys whose values have types; other keys may have any values.

    Parameters
    ----------
    required, optional : types by key.
    """
    parts = {**required, **{name: NotRequired[of] for name, of in (optional or {}).items()}}
    return TypedDict("Record", parts)  # type: ignore[operator]


def by_name(value_type: Any) -> Any:
    """The type of a mapping from names to values of a type that `record` made."""
    return GenericAlias(dict, (str, value_type))


def list_of(value_type: Any) -> Any:
    """The type of a list of values of a type that `record` made."""
    return GenericAlias(list, (value_type,))


class Entry(NamedTuple):
    """An entry of a result's summary (by name of probe, snubber or curve where there are several).

    Entries of a section are printed in one table, by place where they have several; others in one of their own. An
    entry that repeats a variable of a dataset says which one; unit and meaning are then those of the variable. Every
    other entry says what type its value has.
    """

    name: str  # in ``--json`` and among the attributes of /summary
    unit: str = ""
    meaning: str = ""
    section: str = ""
    variable: str = ""  # the variable that it repeats, ``modes/kept_modes``; the entry is left out where there is none
    # type of the value as it is stored, `Number` by default; that of the variable where it repeats one
    form: Any = None
    ranked_by: str = ""  # of many records: what those that are printed have most of
    shown: str = ""  # of a list: the entry with the number of its values that are printed


UNITS = {
    "_n_s_per_m": "N s/m", "_n_m_s_per_rad": "N m s/rad", "_n_m_s": "N m s", "_n_m": "N m",
    "_rad_s": "rad/s", "_rad": "rad",
    "_n_per_m": "N/m", "_m_s2": "m/s^2", "_n_s": "N s", "_m_s": "m/s", "_m3": "m^3", "_percent": "%", "_deg": "deg",
    "_bytes": "B",
    "_pa": "Pa", "_hz": "Hz", "_db": "dB", "_m": "m", "_n": "N", "_g": "g", "_s": "s", "_j": "J", "_w": "W",
}  # fmt: skip
"""Of endings of names; longer ones first."""


def unit_in(name: str) -> str | None:
    """The unit that a name ends with; None where it has none."""
    return next((unit for end, unit in UNITS.items() if name.endswith(end)), None)


def words(name: str) -> str:
    """A name without its unit.

    >>> words("mean_peak_force_n"), words("contact_share")
    ('mean peak force', 'contact share')
    """
    return name.removesuffix(next((end for end in UNITS if name.endswith(end)), "")).replace("_", " ")


def value_in_words(key: str) -> str:
    """Name of a summary value in words: the entry without its unit, and the user's name of its place.

    >>> value_in_words("largest_bending_stress_pa"), value_in_words("peak_force_n.pad_n")
    ('largest bending stress', 'peak force of pad_n')
    >>> value_in_words("peak_moment_n_m.hinge")
    'peak moment of hinge'
    >>> value_in_words("spectral_lines.root_1 absolute_acceleration")
    'spectral lines of root_1 absolute acceleration'
    >>> value_in_words("random.tip absolute_acceleration crest_factor")
    'tip absolute acceleration crest factor'
    """
    entry, _, place = key.partition(".")
    if entry == "random":  # a group of values, each with its own name behind the quantity
        return place_in_words(entry, place)
    return f"{words(entry)} of {place_in_words(entry, place)}" if place else words(entry)


WORDS_AFTER_NAME = {"spectral_lines": 1, "srs": 1, "random": 2}
"""By entry of a summary how many words follow the user's name in the places of its values: quantity, statistic."""


def place_in_words(entry: str, place: str) -> str:
    """The place of a value of an entry: the name as the user gave it, and perhaps quantity and statistic in words.

    >>> place_in_words("random", "left_end tip_2 absolute_acceleration crest_factor")
    'left_end tip_2 absolute acceleration crest factor'
    """
    name, *after = place.rsplit(" ", WORDS_AFTER_NAME.get(entry, 0))
    return " ".join([name, *(word.replace("_", " ") for word in after)])


def summary_of(result: Any, **computed: Any) -> dict[str, Any]:
    """The summary that a result declares: values given here, and those of its variables, as plain Python values.

    Raises
    ------
    KeyError
        If a value has no entry.
    """
    undeclared = computed.keys() - {entry.name for entry in result.SUMMARY}
    if undeclared:
        raise KeyError(f"{type(result).__name__}.SUMMARY has no {', '.join(sorted(undeclared))}")
    values = {}
    for entry in result.SUMMARY:
        value = computed.get(entry.name)
        if value is None and entry.variable:
            value = _variable(result, entry)
        if value is not None:
            values[entry.name] = list(value) if isinstance(value, tuple) else value
    return values


def _variable(result: Any, entry: Entry) -> Any:
    """The values of the variable that an entry repeats; None where the result has none."""
    dataset, _, name = entry.variable.partition("/")
    variables = result.datasets.get(dataset, {})
    return variables[name].values.tolist() if name in variables else None


def demand_summary(result: Any) -> None:
    """Refuse a stored summary with entries that are not declared, of another type, or unlike the variable they repeat.

    Parameters
    ----------
    result : as read from a file, with its summary.

    Raises
    ------
    ValueError
        If it has one.
    """
    cls: Any = type(result)
    entries = {entry.name: entry for entry in cls.SUMMARY}
    for name, value in result.summary.items():
        if name not in entries:
            raise ValueError(f"summary: {name} is unknown")
        entry = entries[name]
        if entry.form is not None or not entry.variable:
            try:
                _checker(name, cls).validate_python(as_builtin(value), strict=True)
            except ValidationError as error:
                first = error.errors()[0]
                where = ".".join(map(str, (name, *first["loc"])))
                raise ValueError(f"summary: {where}: {first['msg']}") from None
        elif (of := _variable(result, entry)) is None or _form(value) != _form(as_builtin(of)):
            raise ValueError(f"summary: {name} is not what {entry.variable} holds")


@cache
def _checker(name: str, cls: Any) -> TypeAdapter[Any]:
    """What checks the type of an entry of the summary of a class."""
    form: Any = next(entry.form or Number for entry in cls.SUMMARY if entry.name == name)
    return TypeAdapter(form)


def _form(value: Any) -> Any:
    """What a plain value is made of: kinds of its parts, names and lengths; unknown numbers are numbers."""
    if isinstance(value, Mapping):
        return {name: _form(item) for name, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_form(item) for item in value]
    return "text" if isinstance(value, str) else "flag" if isinstance(value, bool) else "number"


def complete_entry(cls: Any, entry: Entry) -> Entry:
    """The entry of a result's summary with the unit and the meaning of the variable that it repeats."""
    if entry.meaning:
        return entry
    dataset, _, name = entry.variable.partition("/")
    variable = next(layout for layout in cls.DATASETS if layout.name == dataset).variables[name]
    return entry._replace(unit=variable.unit, meaning=variable.meaning)
