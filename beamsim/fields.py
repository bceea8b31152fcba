"""Declared fields: what a result says once of each of its numbers, and everything else derives from.

A result is a frozen dataclass made with `declared`; each of its fields is given by one of the functions here::

    @declared
    class ProbeHistory:
        name: str = key("name of the probe")
        position: float = attribute("m", "position along the beam")
        displacement: Floats = dataset("m", "displacement relative to the base", along=("time",))

    @declared
    class RunResult(Result):
        time: Floats = axis("s", "time")
        probes: dict[str, ProbeHistory] = named("probes")

The annotation says what a field is in Python, the function how it is stored, and its arguments what it means. HDF5
files are written and read by `beamsim.store.declared`, which is where exports and the documentation of result files
take their names, units and meanings from too. This module knows neither files nor analyses.

Texts (names, units, meanings) may hold ``{field}``, which stands for the value of that field of the same dataclass or
of one that contains it, and ``{field:words}``, the same with spaces for underscores: ``dataset("{unit}", "level")``
has the unit that the result's field ``unit`` says. An axis is looked for in the dataset's own group first, then in the
groups around it.

Fields that are None are left out of the file. A field that a file lacks gets its default, so that a file written before
the field was added still opens. Fields without a declaration are not stored.

An array that takes work to compute, or a `deferred` attribute, may be given as `later`: it is computed when the field
is first read, and then kept.
`changed` replaces other fields without reading it. A history may be given as `by_rows`, so that who takes it in parts
by `rows_of` (the writer of result files, plots, exports) never holds the whole of it.
"""

from __future__ import annotations

import dataclasses
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import cache, cached_property
from inspect import get_annotations
from types import NoneType, UnionType
from typing import Any, NamedTuple, TypeVar, Union, dataclass_transform, get_args, get_origin

import numpy as np

from beamsim.dataclass import dataclass

_DECLARED = "declared"
_Value = TypeVar("_Value")
_REQUIRED: Any = dataclasses.MISSING


class Counter(NamedTuple):
    """An axis with no field of its own: numbers from ``start``, or fixed labels."""

    name: str
    meaning: str
    start: int = 1
    labels: tuple[Any, ...] = ()


class Entry(NamedTuple):
    """An entry of a result's summary (by name of probe, snubber or curve where there are several).

    An entry with a label has a row, or several, in the printed table. An entry that repeats a field of the result says
    which one; unit and meaning are then those of the field.
    """

    name: str  # in ``--json`` and among the attributes of /summary
    unit: str = ""
    meaning: str = ""
    label: str = ""
    of: str = ""  # the field with the value, ``work.cycles``; the entry is left out where the field is None
    columns: tuple[str, ...] = ()  # of a tuple of dataclasses: the fields to be listed of each


def figure_in_words(key: str) -> str:
    """A figure for people: an entry of a summary without its unit, and whose it is, in the name that the user gave.

    >>> figure_in_words("largest_bending_stress_pa"), figure_in_words("peak_force_n.pad_n")
    ('largest bending stress', 'peak force of pad_n')
    >>> figure_in_words("spectral_lines.root_1 absolute_acceleration")
    'spectral lines of root_1 absolute acceleration'
    >>> figure_in_words("random.tip absolute_acceleration crest_factor")
    'tip absolute acceleration crest factor'
    """
    entry, _, place = key.partition(".")
    if entry == "random":  # a group of figures, each with its own name behind the quantity
        return place_in_words(place)
    words = re.sub(r"_(m|n|g|pa|hz|s|j)$", "", entry).replace("_", " ")
    return f"{words} of {place_in_words(place)}" if place else words


def place_in_words(place: str) -> str:
    """What stands behind the point of a figure's key: a name as it was given, and perhaps a quantity."""
    named, space, quantity = place.partition(" ")
    return f"{named}{space}{quantity.replace('_', ' ')}"


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


def _at(owner: Any, path: str) -> Any:
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
    *path, name = entry.of.split(".")
    for part in path:
        cls = next(member.annotation for member in members_of(cls) if member.name == part)
    declaration = next(member.declaration for member in members_of(cls) if member.name == name)
    return entry._replace(unit=declaration.unit, meaning=declaration.meaning)


class Axes(NamedTuple):
    """Axes that are known when the result is made.

    A dataset that is called like one of them is that axis, a dimension scale.
    """

    field: str  # of the result: their names
    called: str  # for people
    auxiliary: str = ""  # field with the names of the CF auxiliary coordinates of what is along them
    more: Counter | None = None  # the axis of a last dimension, where an array has one more


Along = tuple[str | Counter, ...] | Axes  # names of axes, axes that only count, or axes named by a field


@dataclass(frozen=True, kw_only=True)
class Dataset:
    """An array, a dimension scale, or a column of a table."""

    unit: str
    meaning: str
    along: Along = ()
    name: str = ""  # in the file, with the way there; the field's own by default
    scale: bool = False
    flags: tuple[str, str] | None = None  # what the values of a truth value mean
    imaginary: str = ""  # meaning of the imaginary part where it is not that of the real part
    phase: str = ""  # meaning of the phase of complex numbers that are stored as amplitude and phase


@dataclass(frozen=True, kw_only=True)
class PerName:
    """An array or a number for each probe or snubber: ``<folder>/<name>/<field>``."""

    folder: str
    values: Dataset


@dataclass(frozen=True, kw_only=True)
class Attribute:
    """A number or text that belongs to a whole group."""

    unit: str
    meaning: str
    name: str = ""
    at: str = ""  # the group or dataset that carries it, where it is not that of the dataclass
    codec: str = ""  # "json", "scenario" or "failures" where it is stored as text, "outcome" for an `Outcome`
    null: Any = float("nan")  # what stands for a number that JSON cannot hold
    deferred: bool = False  # whether it may be given as `later`


@dataclass(frozen=True, kw_only=True)
class Key:
    """What a group is called by, which is read from its name."""

    meaning: str


@dataclass(frozen=True, kw_only=True)
class Group:
    """A dataclass in a group; in the group around it where the path is empty."""

    path: str
    given: Mapping[str, Any]
    on: str = ""  # the dataset that carries the attributes


@dataclass(frozen=True, kw_only=True)
class Members:
    """Dataclasses, each in a group of its own."""

    folder: str
    pattern: str = "{}"  # name of a member's group, with {} for its key
    called: str = ""  # the same for people, where the key's own name does not say it
    parts: Callable[[Any], tuple[str, ...]] | None = None  # of a member: the way to its group, instead of the pattern
    key: Callable[[Any], Any] | None = None  # of a member: its key, instead of the name of its group
    start: int = 0  # of the numbers of a tuple's members
    labelled: bool = False  # with attributes ``name`` and ``index``
    indexed: bool = False  # with the attribute ``index``
    having: str = ""  # attribute or member by which such a group is known
    order: Callable[[Mapping[str, Any], Any], Any] | None = None  # to sort by: of the fields read before and the member
    given: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    required: bool = False  # at least one
    unless: str = ""  # folder whose members may stand in their place


@dataclass(frozen=True, kw_only=True)
class Arrays:
    """Dataclasses, each one dataset that carries its attributes; ``{link}`` stands for the name of the dataset."""

    folder: str
    called: str  # what the datasets are called by, for people
    listed: str = ""  # attribute of the folder: their names in order, where it is not that of HDF5


@dataclass(frozen=True, kw_only=True)
class Table:
    """Dataclasses as the rows of a table, their fields as columns."""

    path: str
    rows: Counter | None  # None where a column is the axis
    empty: bool = True  # whether a table without rows is written


Declaration = Dataset | PerName | Attribute | Key | Group | Members | Arrays | Table
_Class = TypeVar("_Class", bound=type)
_Function = TypeVar("_Function", bound=Callable[..., Any])


def _field(declaration: Declaration, default: Any, default_factory: Any) -> Any:
    return dataclasses.field(default=default, default_factory=default_factory, metadata={_DECLARED: declaration})


def dataset(
    unit: str, meaning: str, *, along: Along = (), name: str = "", flags: tuple[str, str] | None = None,
    imaginary: str = "", phase: str = "", default: Any = _REQUIRED, default_factory: Any = _REQUIRED,
) -> Any:  # fmt: skip
    """An array along axes.

    Complex numbers are two datasets, ``…_real`` and ``…_imag``; with `phase`, amplitude and ``…_phase_deg``. Truth
    values have `flags`, the meanings of false and true.
    """
    kept = Dataset(
        unit=unit, meaning=meaning, along=along, name=name, flags=flags, imaginary=imaginary, phase=phase
    )  # fmt: skip
    return _field(kept, default, default_factory)


def axis(unit: str, meaning: str, *, name: str = "", default: Any = _REQUIRED, default_factory: Any = _REQUIRED) -> Any:
    """An array that other datasets are along: a dimension scale."""
    return _field(Dataset(unit=unit, meaning=meaning, name=name, scale=True), default, default_factory)


def per_probe(
    unit: str, meaning: str, *, along: Along = (), name: str = "", imaginary: str = "", default: Any = _REQUIRED,
    default_factory: Any = _REQUIRED,
) -> Any:  # fmt: skip
    """An array (or a number, which becomes an attribute) for each probe, ``probes/<name>/<field>``."""
    values = Dataset(unit=unit, meaning=meaning, along=along, name=name, imaginary=imaginary)
    return _field(PerName(folder="probes", values=values), default, default_factory)


def per_snubber(
    unit: str, meaning: str, *, along: Along = (), name: str = "", default: Any = _REQUIRED,
    default_factory: Any = _REQUIRED,
) -> Any:  # fmt: skip
    """An array (or a number, which becomes an attribute) for each snubber, ``snubbers/<name>/<field>``."""
    values = Dataset(unit=unit, meaning=meaning, along=along, name=name)
    return _field(PerName(folder="snubbers", values=values), default, default_factory)


def per_name(
    folder: str, unit: str, meaning: str, *, along: Along = (), name: str = "", default: Any = _REQUIRED,
    default_factory: Any = _REQUIRED,
) -> Any:  # fmt: skip
    """An array for each name in a folder that is neither of probes nor of snubbers."""
    values = Dataset(unit=unit, meaning=meaning, along=along, name=name)
    return _field(PerName(folder=folder, values=values), default, default_factory)


def attribute(
    unit: str, meaning: str, *, name: str = "", at: str = "", codec: str = "", null: Any = float("nan"),
    deferred: bool = False, default: Any = _REQUIRED, default_factory: Any = _REQUIRED,
) -> Any:  # fmt: skip
    """A number or text that belongs to the group (or to what is at ``at`` in it); ``codec`` and ``deferred`` as in
    `Attribute`."""
    kept = Attribute(unit=unit, meaning=meaning, name=name, at=at, codec=codec, null=null, deferred=deferred)
    return _field(kept, default, default_factory)


def ending(meaning: str, *, at: str = "", default: Any = _REQUIRED) -> Any:
    """An `Outcome`: attributes ``status`` (text), ``outcome`` (code) and ``outcome_numbers`` (JSON)."""
    return _field(Attribute(unit="", meaning=meaning, name="status", at=at, codec="outcome"), default, _REQUIRED)


def key(meaning: str) -> Any:
    """The name or number that the group is called by."""
    return _field(Key(meaning=meaning), _REQUIRED, _REQUIRED)


def group(path: str, *, given: Mapping[str, Any] | None = None, on: str = "", default: Any = _REQUIRED) -> Any:
    """A dataclass in the group ``path``; ``given`` are fields of it that are not stored, ``on`` as in `Group`."""
    return _field(Group(path=path, given=given or {}, on=on), default, _REQUIRED)


def named(
    folder: str, *, given: Mapping[str, Any] | None = None, having: str = "", default: Any = _REQUIRED,
    default_factory: Any = _REQUIRED,
) -> Any:  # fmt: skip
    """A dataclass for each name, ``<folder>/<name>`` with the attributes ``name`` and ``index``.

    ``having`` is a dataset that tells which of the groups have such a dataclass, where not all of them do.
    """
    return _field(Members(folder=folder, labelled=True, given=given or {}, having=having), default, default_factory)


def numbered(
    folder: str, *, start: int = 0, indexed: bool = False, required: bool = False, unless: str = "",
    default: Any = _REQUIRED,
) -> Any:  # fmt: skip
    """A tuple of dataclasses, ``<folder>/<n>`` with n from ``start``; with the attribute ``index`` if ``indexed``."""
    kept = Members(folder=folder, start=start, indexed=indexed, required=required, unless=unless)
    return _field(kept, default, _REQUIRED)


def keyed(
    pattern: str = "{}", *, folder: str = "", having: str = "", parts: Callable[[Any], tuple[str, ...]] | None = None,
    key: Callable[[Any], Any] | None = None, order: Callable[[Mapping[str, Any], Any], Any] | None = None,
    indexed: bool = False, called: str = "", default: Any = _REQUIRED, default_factory: Any = _REQUIRED,
) -> Any:  # fmt: skip
    """Dataclasses in groups named after their keys; for a tuple, after the field that is a `key`. See `Members`."""
    kept = Members(
        folder=folder, pattern=pattern, parts=parts, key=key, having=having, order=order, indexed=indexed,
        called=called,
    )  # fmt: skip
    return _field(kept, default, default_factory)


def arrays(
    folder: str, *, called: str, listed: str = "", default: Any = _REQUIRED, default_factory: Any = _REQUIRED
) -> Any:
    """Dataclasses, a dataset each, whose names, units and meanings are known when the result is made. See `Arrays`."""
    return _field(Arrays(folder=folder, called=called, listed=listed), default, default_factory)


def table(path: str, rows: Counter | None = None, *, empty: bool = True, default: Any = _REQUIRED) -> Any:
    """A tuple of dataclasses as a table: counted by ``rows``, or by the field of a row that is an `axis`."""
    return _field(Table(path=path, rows=rows, empty=empty), default, _REQUIRED)


class _Later:
    """The value of a field that is computed when it is first read; copies of the result share it."""

    def __init__(self, compute: Callable[[], Any]) -> None:
        self._compute = compute

    @cached_property
    def value(self) -> Any:
        """The value."""
        return self._compute()


def later(compute: Callable[[], _Value]) -> _Value:
    """An array, or a `deferred` attribute, for a declared field, computed when the field is first read."""
    return _Later(compute)  # type: ignore[return-value]


class RowBlocks:
    """A one-dimensional array that is computed or read in parts; sliced (with step 1) like an array.

    Parameters
    ----------
    count : length of the array.
    rows : its part between two indices.
    whole : all of it, where that is cheaper than ``rows(0, count)``.
    dtype : of its values.
    block : number of values that are computed or read together; parts are best taken in multiples of it.
    """

    ndim = 1

    def __init__(
        self, count: int, rows: Callable[[int, int], Any], whole: Callable[[], Any] | None, dtype: type, block: int
    ) -> None:
        self.size, self.shape, self.dtype, self.block = count, (count,), np.dtype(dtype), block
        self._rows, self._whole = rows, whole

    def __len__(self) -> int:
        return self.size

    def __getitem__(self, part: slice) -> Any:
        first, last, step = part.indices(self.size)
        if step != 1:
            raise IndexError("blocks of rows have no step")
        return self._rows(first, max(first, last))

    @cached_property
    def value(self) -> Any:
        """The whole array."""
        return self._rows(0, self.size) if self._whole is None else self._whole()


def by_rows(
    count: int, rows: Callable[[int, int], _Value], *, block: int, whole: Callable[[], _Value] | None = None,
    dtype: type = float,
) -> _Value:  # fmt: skip
    """An array for a declared field that can be taken in parts; see `RowBlocks` and `rows_of`."""
    return RowBlocks(count, rows, whole, dtype, block)  # type: ignore[return-value]


def rows_of(owner: Any, name: str) -> Any:
    """A field to be sliced: an array, or `RowBlocks` whose parts are computed or read when they are asked for."""
    value = vars(owner).get(name)
    return value if isinstance(value, RowBlocks) else getattr(owner, name)


def changed(owner: _Value, **changes: Any) -> _Value:
    """As `dataclasses.replace`, but what is to be computed later is not computed."""
    kept = {f.name: vars(owner)[f.name] for f in dataclasses.fields(owner) if f.init}  # type: ignore[arg-type]
    return type(owner)(**{**kept, **changes})


class _Deferred:
    """Field of a class that may be given as `later`."""

    def __init__(self, name: str) -> None:
        self.name = name

    def __get__(self, owner: Any, cls: type | None = None) -> Any:
        values = {} if owner is None else vars(owner)
        if self.name not in values:
            raise AttributeError(self.name)
        if isinstance(values[self.name], (_Later, RowBlocks)):
            values[self.name] = values[self.name].value
        return values[self.name]

    def __set__(self, owner: Any, value: Any) -> None:
        vars(owner)[self.name] = value


def _with_deferred(cls: Any) -> Any:
    """A declared dataclass whose arrays and `deferred` attributes may be given as `later`; they are computed before it
    is pickled."""
    names = [f.name for f in dataclasses.fields(cls) if _may_wait(f.metadata.get(_DECLARED))]
    for name in names:
        setattr(cls, name, _Deferred(name))
    if names:
        cls.__getstate__ = lambda self: {name: getattr(self, name) for name in vars(self)}
    return cls


def _may_wait(declaration: Declaration | None) -> bool:
    if isinstance(declaration, Dataset):
        return bool(declaration.along) or declaration.scale
    return isinstance(declaration, Attribute) and declaration.deferred


@dataclass_transform(
    frozen_default=True,
    field_specifiers=(
        dataset, axis, per_probe, per_snubber, per_name, attribute, ending, key, group, named, numbered, keyed, arrays,
        table, dataclasses.field,
    ),
)  # fmt: skip
def declared(cls: _Class) -> _Class:
    """A frozen dataclass whose fields are declared."""
    return _with_deferred(dataclass(frozen=True)(cls))  # type: ignore[no-any-return]


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(attribute, ending, dataclasses.field))
def declared_base(cls: _Class) -> _Class:
    """The same with keywords only, so that classes derived from it may begin with fields without a default."""
    return _with_deferred(dataclass(frozen=True, kw_only=True)(cls))  # type: ignore[no-any-return]


def stored(field: Any) -> Callable[[_Function], _Function]:
    """Declare a property, which is written and not read: ``@property``, then ``@stored(dataset(...))``."""
    declaration = field.metadata[_DECLARED]

    def mark(function: _Function) -> _Function:
        function.__declared__ = declaration  # type: ignore[attr-defined]
        return function

    return mark


class Member(NamedTuple):
    """One declared field of a class."""

    name: str
    declaration: Any  # one of `Declaration`
    annotation: Any  # the type, without None
    optional: bool  # whether it may be None
    derived: bool  # whether it is a property, which is not read
    default: Callable[[], Any] | None

    @property
    def stored_name(self) -> str:
        """Name in the file; may hold ``{field}``."""
        return getattr(self.declaration, "name", "") or self.name


def members_of(cls: Any) -> tuple[Member, ...]:
    """The declared fields of a dataclass and its declared properties, in order."""
    return _members_of(cls)


@cache
def _members_of(cls: Any) -> tuple[Member, ...]:
    members = []
    for field in dataclasses.fields(cls):
        if _DECLARED in field.metadata:
            annotation, optional = _without_none(_annotation(cls, field.name))
            members.append(Member(field.name, field.metadata[_DECLARED], annotation, optional, False, _default(field)))
    for base in reversed(cls.__mro__):
        for name, value in vars(base).items():
            declaration = getattr(getattr(value, "fget", None), "__declared__", None)
            if declaration is not None:
                members.append(Member(name, declaration, Any, True, True, None))
    return tuple(members)


def _default(field: Any) -> Callable[[], Any] | None:
    if field.default_factory is not dataclasses.MISSING:
        return field.default_factory  # type: ignore[no-any-return]
    return None if field.default is dataclasses.MISSING else lambda: field.default


def _annotation(cls: type, name: str) -> Any:
    owner = next(base for base in cls.__mro__ if name in get_annotations(base))
    annotation = get_annotations(owner)[name]
    return eval(annotation, vars(sys.modules[owner.__module__])) if isinstance(annotation, str) else annotation


def _without_none(annotation: Any) -> tuple[Any, bool]:
    """The type without None, and whether it had it: ``Floats | None``, or the same as an `Optional`."""
    options = get_args(annotation) if get_origin(annotation) in (Union, UnionType) else ()
    inner = [option for option in options if option is not NoneType]
    return (inner[0], True) if len(inner) == 1 else (annotation, False)


def filled(text: str, names: Sequence[Any]) -> str:
    """A text with each ``{field}`` replaced by that of the first of ``names`` (objects or mappings) that has it."""

    def value(match: re.Match[str]) -> str:
        for owner in names:
            if isinstance(owner, Mapping):
                if match[1] in owner:
                    return _spoken(owner[match[1]], match[2])
            elif hasattr(owner, match[1]):
                return _spoken(getattr(owner, match[1]), match[2])
        raise KeyError(f"no field {match[1]} for {text!r}")

    return re.sub(r"\{(\w+)(:words)?\}", value, text) if "{" in text else text


def _spoken(value: Any, words: str | None) -> str:
    return str(value).replace("_", " ") if words else str(value)
