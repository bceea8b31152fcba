"""Declared fields: what a result says once of each of its numbers, and everything else derives from.

A result is a frozen dataclass made with `declared`; each of its fields is given by one of the functions here::

    @declared(along=("frequency_hz",))
    class Spectrum:
        window: str = attribute("", "window")
        frequency_hz: Floats = axis("Hz", "frequency")
        amplitude: Floats = dataset("m", "single-sided peak amplitude")

    @declared
    class RunResult(Result):
        spectra: dict[str, Spectrum] = members("signals", Spectrum, "signal", rows="spectra")

There are four kinds of declarations: an array along axes (`ArrayField`), a number or text of a dataclass
(`Attribute`), a table whose rows are dataclasses (`Table`), and dataclasses (`Group` one, `Members` several along a
dimension). The function says how a field is stored, and its arguments what it means. `beamsim.store.layout` says where
each is in a result file, `beamsim.store.datasets` writes and reads them; `docs/result_files.md` lists the declarations.
This module knows neither files nor analyses. Units and meanings may hold ``{field}``, which stands for the value of
that field of the same dataclass or of one that contains it: ``dataset("{unit}", "level")`` has the unit that the
result's field ``unit`` says. An axis is looked for among the fields of the same dataclass first, then of those around
it. Fields that are None are left out of the file. A field that a file lacks gets its default. Fields without a
declaration are not stored.
"""

from __future__ import annotations

import dataclasses
import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cache, partial
from types import GenericAlias
from typing import Annotated, Any, NamedTuple, NotRequired, TypeVar, cast, dataclass_transform

import numpy as np
from pydantic import Field, JsonValue, TypeAdapter, ValidationError
from typing_extensions import TypedDict  # comes with pydantic, which reads that of typing from Python 3.12 on

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


OUTCOME = Codec(lambda _, outcome: outcome.as_texts(), lambda _, attributes: Outcome.from_texts(attributes))


_DECLARED = "declared"
_DEFERRED = "_deferred"  # of an object: its values that are not known yet, by field
_REQUIRED: Any = dataclasses.MISSING
_SCALARS: dict[str, Callable[[Any], Any]] = {"float": float, "int": int, "bool": bool, "str": str}


class Counter(NamedTuple):
    """An axis with no field of its own: numbers from ``start``, or fixed labels."""

    name: str
    meaning: str
    start: int = 1
    labels: tuple[Any, ...] = ()
    shared: bool = False  # whether it is the same in all members, so that they are stacked instead of put end to end


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


def by_name(of: Any) -> Any:
    """The type of a mapping from names to values of a type that `record` made."""
    return GenericAlias(dict, (str, of))


def list_of(of: Any) -> Any:
    """The type of a list of values of a type that `record` made."""
    return GenericAlias(list, (of,))


class Entry(NamedTuple):
    """An entry of a result's summary (by name of probe, snubber or curve where there are several).

    Entries of a section are printed in one table, by place where they have several; others in one of their own. An
    entry that repeats a field of the result says which one; unit and meaning are then those of the field. Every other
    entry says what type its value has.
    """

    name: str  # in ``--json`` and among the attributes of /summary
    unit: str = ""
    meaning: str = ""
    section: str = ""
    # the variable with the value, ``modes/kept_modes``, or the field, ``work.cycles``; left out where there is none
    of: str = ""
    columns: tuple[str, ...] = ()  # of a tuple of dataclasses: the fields to be listed of each
    form: Any = None  # type of the value as it is stored, `Number` by default; that of the field where it repeats one
    ranked_by: str = ""  # of many records: what those that are printed have most of
    shown: str = ""  # of a list: the entry with the number of its values that are printed


UNITS = {
    "_n_s_per_m": "N s/m", "_n_m_s_per_rad": "N m s/rad", "_n_m_s": "N m s", "_n_m": "N m",
    "_rad_s": "rad/s", "_rad": "rad",
    "_n_per_m": "N/m", "_m_s2": "m/s^2", "_n_s": "N s", "_m_s": "m/s", "_m3": "m^3", "_percent": "%", "_deg": "deg",
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


def figure_in_words(key: str) -> str:
    """A figure for people: an entry of a summary without its unit, and whose it is, in the name that the user gave.

    >>> figure_in_words("largest_bending_stress_pa"), figure_in_words("peak_force_n.pad_n")
    ('largest bending stress', 'peak force of pad_n')
    >>> figure_in_words("peak_moment_n_m.hinge")
    'peak moment of hinge'
    >>> figure_in_words("spectral_lines.root_1 absolute_acceleration")
    'spectral lines of root_1 absolute acceleration'
    >>> figure_in_words("random.tip absolute_acceleration crest_factor")
    'tip absolute acceleration crest factor'
    """
    entry, _, place = key.partition(".")
    if entry == "random":  # a group of figures, each with its own name behind the quantity
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
    """The summary that a result declares: values given here, and those of its fields, as plain Python values.

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
        if value is None and entry.of:
            value = _at(result, entry.of)
        if value is not None:
            values[entry.name] = _listed(value, entry.columns)
    return values


def demand_summary(result: Any) -> None:
    """Refuse a stored summary with entries that are not declared, of another type, or of another form than their field.

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
        field = _at(result, entry.of) if entry.of else None
        if entry.form is not None or not entry.of:
            try:
                _checker(name, cls).validate_python(plain(value), strict=True)
            except ValidationError as error:
                first = error.errors()[0]
                where = ".".join(map(str, (name, *first["loc"])))
                raise ValueError(f"summary: {where}: {first['msg']}") from None
        elif field is None or _form(value) != _form(plain(_listed(field, entry.columns))):
            raise ValueError(f"summary: {name} is not what its field {entry.of} holds")


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


def _at(owner: Any, path: str) -> Any:
    """The value of a variable or of a field of a result; None where it has none."""
    dataset, _, variable = path.partition("/")
    if variable:
        of = owner.datasets.get(dataset, {})
        return of[variable].values if variable in of else None
    for name in path.split("."):
        owner = None if owner is None else getattr(owner, name)
    return owner


def _listed(value: Any, columns: tuple[str, ...]) -> Any:
    if columns:
        return [{name: getattr(item, name) for name in columns} for item in value]
    if hasattr(value, "tolist"):
        return value.tolist()
    return list(value) if isinstance(value, tuple) else value


def described(cls: Any, entry: Entry) -> Entry:
    """The entry of a result's summary with the unit and the meaning of the field that it repeats."""
    if entry.meaning:
        return entry
    dataset, _, variable = entry.of.partition("/")
    if variable:
        layout = next(layout for layout in cls.DATASETS if layout.name == dataset)
        return entry._replace(unit=layout.variables[variable].unit, meaning=layout.variables[variable].meaning)
    *path, name = entry.of.split(".")
    for part in path:
        cls = next(member.declaration.of for member in members_of(cls) if member.name == part)
    declaration = next(member.declaration for member in members_of(cls) if member.name == name)
    return entry._replace(unit=declaration.unit, meaning=declaration.meaning)


Along = tuple[str | Counter, ...]  # names of axes, or axes that only count


@dataclass(frozen=True)
class ArrayField:
    """An array, a dimension scale, or a column of a table; with ``per`` a mapping of arrays or numbers by name."""

    unit: str
    meaning: str
    along: Along | None = None  # by default those of the class, see `declared`
    name: str = ""  # of the variable; the field's own by default
    scale: bool = False
    shared: bool = False  # of a scale: whether it is the same in all members
    rows: str = "sample"  # of a scale: dimension of what is along it, where that differs from member to member
    per: str | None = None  # dimension whose coordinate has the names
    flags: tuple[str, str] | None = None  # what the values of a truth value mean
    names: str = ""  # of numbers from 0: the coordinate whose values they number, ``histories/snubber``
    imaginary: str = ""  # meaning of the imaginary part where it is not that of the real part


@dataclass(frozen=True)
class Attribute:
    """A number or text that belongs to a whole dataclass: an attribute, or a value along the dimension of members."""

    unit: str
    meaning: str
    name: str = ""
    codec: Codec | None = None


@dataclass(frozen=True)
class Key:
    """What a member is called by: its value of the coordinate."""

    meaning: str


@dataclass(frozen=True)
class Group:
    """A dataclass in a dataset of its own; in that around it where the path is empty."""

    path: str
    of: Any  # its class
    prefix: str = ""  # of the names of its variables


@dataclass(frozen=True)
class Members:
    """Dataclasses of a mapping or a tuple, stacked along a dimension whose coordinate has their keys or numbers.

    An attribute of the dataset around them, called as the field, lists their keys in order.
    """

    path: str  # of the dataset that has them; that around them where it is empty
    of: Any  # their class
    dim: str  # the dimension
    prefix: str = ""  # of the names of their variables
    rows: str = ""  # dataset of what they have along axes that differ from member to member
    by: tuple[str, ...] = ()  # fields of a tuple's member that are its key, instead of its `key` field or its number
    split: str = ""  # the one of these that ends the names of the variables, while the first is the coordinate


@dataclass(frozen=True)
class Table:
    """Dataclasses as the rows of a table, their fields as columns; a table without rows is not stored."""

    path: str
    of: Any  # the class of a row
    rows: Counter | None = None  # the axis along which rows are counted; None where a column, an `axis`, is that


Declaration = ArrayField | Attribute | Key | Group | Members | Table
_Class = TypeVar("_Class", bound=type)
_Function = TypeVar("_Function", bound=Callable[..., Any])


def _field(
    kind: Any, *declared: Any, default: Any = _REQUIRED, default_factory: Any = _REQUIRED, **options: Any
) -> Any:
    """A field of a dataclass with its declaration.

    Parameters
    ----------
    kind : class of the declaration.
    declared : its fields, in order.
    default, default_factory : as of `dataclasses.field`.
    options : its fields by name.

    Returns
    -------
    dataclasses.Field
    """
    metadata = {_DECLARED: kind(*declared, **options)}
    return dataclasses.field(default=default, default_factory=default_factory, metadata=metadata)


# Each takes the fields of its declaration, the first of them in order, and `default` or `default_factory`.
dataset = partial(_field, ArrayField)
"""An array along axes; complex numbers are two variables, ``…_real`` and ``…_imag``."""
axis = partial(_field, ArrayField, scale=True)
"""An array that others are along: a dimension scale."""
per_probe = partial(_field, ArrayField, per="probe")
"""An array or a number for each probe: along the dimension ``probe``."""
per_snubber = partial(_field, ArrayField, per="snubber")
"""The same for each snubber."""
attribute = partial(_field, Attribute)
"""A number or text that belongs to the group."""
ending = partial(_field, Attribute, "", name="status", codec=OUTCOME)
"""An `Outcome`, of which the meaning says what ended: ``status`` (text), ``outcome`` (code), ``outcome_numbers``."""
key = partial(_field, Key)
"""The name or number that a member is called by."""
group = partial(_field, Group)
"""A dataclass in a dataset of its own."""
members = partial(_field, Members)
"""Dataclasses of a mapping or a tuple along a dimension."""
table = partial(_field, Table)
"""A tuple of dataclasses as a table."""


@dataclass_transform(
    frozen_default=True,
    field_specifiers=(
        dataset, axis, per_probe, per_snubber, attribute, ending, key, group, members, table,
        dataclasses.field,
    ),
)  # fmt: skip
def declared(cls: Any = None, *, kw_only: bool = False, repr: bool = True, along: Along = ()) -> Any:
    """A frozen dataclass whose fields are declared.

    Parameters
    ----------
    cls : the class.
    kw_only, repr : as of `dataclasses.dataclass`.
    along : the axes of its arrays that do not name theirs; by default those of the class that it is made from.

    Returns
    -------
    The dataclass; without ``cls`` the decorator that makes it.
    """
    if cls is None:
        return partial(declared, kw_only=kw_only, repr=repr, along=along)
    cls.__along__ = along
    made = dataclass(frozen=True, kw_only=kw_only, repr=repr)(cls)
    for field in dataclasses.fields(made):
        if isinstance(field.metadata.get(_DECLARED), ArrayField):
            setattr(made, field.name, _ReadWhenUsed(field.name))
    return made


class Deferred(NamedTuple):
    """A value that is not known yet."""

    read: Callable[[], Any]  # finds it


def made_of(cls: _Class, values: Mapping[str, Any]) -> Any:
    """An object of a declared class; values that are `Deferred` are found when its field is first used.

    Parameters
    ----------
    cls : the class, made with `declared`.
    values : by name of the field; those of arrays may be `Deferred`.
    """
    made = cls(**values)
    vars(made)[_DEFERRED] = {
        name: vars(made).pop(name) for name, value in values.items() if isinstance(value, Deferred)
    }
    return made


class _ReadWhenUsed:
    """Attribute of a class for a field: it finds a deferred value once; other values Python finds in the object."""

    def __init__(self, name: str) -> None:
        self.name = name

    def __get__(self, owner: Any, cls: Any = None) -> Any:
        if owner is None:
            return self
        deferred = vars(owner).get(_DEFERRED, {})
        if self.name not in deferred:
            raise AttributeError(f"{type(owner).__name__} has no {self.name} yet")
        value = vars(owner)[self.name] = deferred[self.name].read()
        deferred.pop(self.name, None)  # another thread may have done the same
        return value


def stored(field: Any) -> Callable[[_Function], _Function]:
    """Declare a property, which is written and not read: ``@property``, then ``@stored(dataset(...))``."""

    def mark(function: _Function) -> _Function:
        function.__declared__ = field.metadata[_DECLARED]  # type: ignore[attr-defined]
        return function

    return mark


class Member(NamedTuple):
    """One declared field of a class."""

    name: str
    declaration: Any  # one of `Declaration`
    stored_name: str  # name in the file, without a prefix
    type: str = ""  # as it is written in the class, without None
    scalar: Callable[[Any], Any] | None = None  # type of a number or text, or of each of a mapping of them
    default: Callable[[], Any] | None = None
    derived: bool = False  # whether it is a property, which is not read


@cache
def members_of(cls: Any) -> tuple[Member, ...]:
    """The declared fields of a dataclass and its declared properties, in order; arrays that name no axes have those
    of the class."""
    along = next((given for base in cls.__mro__ if (given := vars(base).get("__along__"))), ())
    found = {each.name: each for each in dataclasses.fields(cls) if _DECLARED in each.metadata}
    declarations = {name: each.metadata[_DECLARED] for name, each in found.items()}
    for base in reversed(cls.__mro__):
        for name, value in vars(base).items():
            if hasattr(getattr(value, "fget", None), "__declared__"):
                declarations.pop(name, None)
                declarations[name] = value.fget.__declared__
    members = []
    for name, declaration in declarations.items():
        if isinstance(declaration, ArrayField) and declaration.along is None:
            declaration = dataclasses.replace(declaration, along=() if declaration.scale else along)
        stored_name = getattr(declaration, "name", "") or name
        if name not in found:
            members.append(Member(name, declaration, stored_name, derived=True))
            continue
        each, default = found[name], cast(Any, None)
        written = each.type if isinstance(each.type, str) else getattr(each.type, "__name__", str(each.type))
        written = written.removesuffix(" | None")
        if each.default_factory is not _REQUIRED:
            default = each.default_factory
        elif each.default is not _REQUIRED:
            default = partial(copy, each.default)
        scalar = _SCALARS.get(re.sub(r"dict\[str, (.*)\]", r"\1", written))
        members.append(Member(name, declaration, stored_name, written, scalar, default))
    return tuple(members)


def key_of(cls: Any) -> str:
    """The field of a dataclass that is its `key`; empty where it has none."""
    return next((member.name for member in members_of(cls) if isinstance(member.declaration, Key)), "")


def filled(text: str, owners: Sequence[Any]) -> str:
    """A text with each ``{field}`` replaced by that of the first of ``owners`` that has it."""
    for name in re.findall(r"\{(\w+)\}", text):
        text = text.replace(f"{{{name}}}", str(next(getattr(each, name) for each in owners if hasattr(each, name))))
    return text
