"""A result as variables of datasets, and back: what result files and exports are made of.

The declarations of its fields (`beamsim.fields`) say what each of its numbers is; `beamsim.store.layout` where it is.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from pydantic import TypeAdapter

from beamsim.fields import (
    JSON,
    ArrayField,
    Attribute,
    Deferred,
    Group,
    Key,
    Member,
    Members,
    Table,
    filled,
    key_of,
    made_of,
    members_of,
)
from beamsim.labelled import (
    ABSENT,
    MIXED,
    NAMES,
    OF_EACH,
    Item,
    Items,
    LargeArray,
    flagged,
    last,
    part_of,
)
from beamsim.store.layout import Axis, Spot, StoragePlace, place_in, root_place, spot

ROW = "number of the row"
"""Meaning of the coordinate of rows that belong to several members, one after the other."""
ASSEMBLED = 2**20  # bytes of an array up to which it is put together before it is written


@dataclass(frozen=True)
class InParts(LargeArray):
    """A large array that members share, which is written part by part."""

    parts: tuple[tuple[Any, Any], ...]  # index and values
    fill: Any

    def part(self, index: Any) -> Any:
        """A part of the whole array."""
        return np.asarray(self)[index]

    def __getitem__(self, index: Any) -> Any:
        return self.part(index)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:
        whole = np.full(self.shape, self.fill, dtype=self.dtype)
        for index, values in self.parts:
            whole[index] = values
        return whole if dtype is None else whole.astype(dtype)


# --- From a result to items ------------------------------------------------------------------------------------------

Labels = tuple[Any, ...]  # of a member and of those that it belongs to, outermost first


class _Value(NamedTuple):
    """A value of a field, or a dataclass."""

    labels: Labels
    owners: tuple[Any, ...]  # what contains it, the innermost first: they fill ``{field}`` in texts
    value: Any


@dataclass
class _Variable:
    """A variable whose parts are gathered."""

    spot: Spot
    more: dict[str, Any]  # attributes
    parts: list[tuple[Labels, Any]] = field(default_factory=list)
    units: list[str] = field(default_factory=list)
    meanings: list[str] = field(default_factory=list)


@dataclass
class _AxisValues:
    """The values of an axis by the labels of the members that have them."""

    axis: Axis
    texts: tuple[str, str] = ("1", "")  # unit and meaning
    by_labels: dict[Labels, Any] = field(default_factory=dict)


def items_of(result: Any) -> Items:
    """The declared fields of a result as items."""
    writer = _Writer(getattr(result, "scenario", None))
    cls = type(result)
    writer.add(cls, root_place(cls), [_Value((), (), result)])
    writer.finish()
    for each in getattr(result, "datasets", {}).values():
        writer.items |= each.read()
    return writer.items


class _Writer:
    """The items of a result, one declared field after the other."""

    def __init__(self, scenario: Any) -> None:
        self.items: Items = {"/": Item()}
        self.scenario = scenario
        self.variables: dict[str, _Variable] = {}
        self.numbers: dict[str, dict[Any, int]] = {}  # of members by label, by path of the coordinate
        self.rows: dict[str, tuple[Axis, dict[Labels, int]]] = {}  # of each member, by path of the axis
        self.axes: dict[str, _AxisValues] = {}  # by path, those that are no rows of several members
        self.coordinates: dict[str, _AxisValues] = {}  # the same by path of each coordinate that variables are along

    def add(self, cls: Any, place: StoragePlace, instances: Sequence[_Value]) -> None:
        """The declared fields of instances of a class."""
        for member in sorted(members_of(cls), key=_writing_rank):
            values = [_Value(labels, (of, *owners), getattr(of, member.name)) for labels, owners, of in instances]
            known = [each for each in values if each.value is not None]
            match member.declaration:
                case Members() as declared if known:
                    self._members(member, declared, place, values)
                case Group() as declared if known:
                    if declared.path:
                        self.items.setdefault(f"/{place_in(place, member.name, declared).dataset}", Item())
                    if place.dims:
                        having = json.dumps([each.labels for each in known], ensure_ascii=False)
                        self._attributes(place)[place.prefix + member.name] = having
                    self.add(declared.of, place_in(place, member.name, declared), known)
                case Table() as declared if any(each.value for each in known):
                    self._table(member, declared, place, known)
                case Attribute() as declared:
                    self._attribute(member, declared, place, known)
                case ArrayField() as declared if known:
                    self._arrays(member, declared, place, known)

    def _attributes(self, place: StoragePlace) -> dict[str, Any]:
        """The attributes of the group of a place, which may be new."""
        return self.items.setdefault(place.attributes, Item()).attributes

    def _attribute(self, member: Member, declared: Attribute, place: StoragePlace, values: Sequence[_Value]) -> None:
        stored = member.stored_name
        for labels, owners, value in values:
            coded = {stored: value} if declared.codec is None else declared.codec.write(stored, value)
            for key, one in coded.items():
                name = f"{place.prefix}{key}{place.suffix}"
                if place.dims:
                    at = Spot(f"/{place.dataset}/{name}", place.dataset, place.dims, ())
                    array = _array(json.dumps(one) if isinstance(one, (tuple, list)) else one)
                    more = flagged(("false", "true")) if array.dtype == np.bool_ else {}
                    self._part(at, labels, array, (filled(declared.unit, owners), declared.meaning), more)
                elif name in self._attributes(place):
                    raise TypeError(f"two fields are called {place.attributes}@{name}")
                else:
                    self._attributes(place)[name] = np.uint8(one) if isinstance(one, bool) else one

    def _members(self, member: Member, declared: Members, place: StoragePlace, values: Sequence[_Value]) -> None:
        below, own, listed = place_in(place, member.name, declared), key_of(declared.of), list[Any]()
        parts: dict[str, list[_Value]] = {}
        for labels, owners, value in values:
            pairs: Any = value
            if isinstance(value, Mapping):
                pairs = value.items()
            elif value is not None and declared.by:
                pairs = [(tuple(getattr(item, name) for name in declared.by), item) for item in value]
            elif value is not None:
                pairs = [(getattr(item, own) if own else number, item) for number, item in enumerate(value)]
            listed.append(None if value is None else [key for key, _ in pairs])
            for key, item in pairs or ():
                label, end = label_of(declared, key)
                parts.setdefault(end, []).append(_Value((*labels, label), owners, item))
        self._attributes(place)[place.prefix + member.name] = _listed(listed)
        bodies = self.scenario.bodies_of_places.get(f"{declared.dim}s", {}) if self.scenario else {}
        for end, instances in parts.items():
            self.add(declared.of, replace(below, suffix=end), instances)
            for each in instances:
                self._numbers(below.dataset, below.dims, each.labels)
            at = Spot(f"/{below.dataset}/{declared.dim}_body", below.dataset, below.dims, ())
            if (
                len(below.dims) == 1
                and at.path not in self.variables
                and any(bodies.get(v.labels[0]) for v in instances)
            ):
                for each in instances:
                    body = np.asarray(bodies.get(each.labels[0]) or "", dtype=object)
                    self._part(at, each.labels, body, ("1", "name of the body"), {})

    def _table(self, member: Member, declared: Table, place: StoragePlace, values: Sequence[_Value]) -> None:
        below = place_in(place, member.name, declared)
        for each in values:
            self._numbers(place.dataset, place.dims, each.labels)
        for column in sorted(members_of(declared.of), key=_writing_rank):
            cells = [[getattr(row, column.name) for row in each.value] for each in values]
            optional = column.default is not None and column.default() is None
            if not optional or any(value is not None for of_rows in cells for value in of_rows):
                kind: Any = object if column.scalar is str else column.scalar or float
                pairs = zip(values, cells, strict=True)
                arrays = [each._replace(value=np.array(of_rows, dtype=kind)) for each, of_rows in pairs if of_rows]
                self._arrays(column, column.declaration, below, arrays)

    def _arrays(self, member: Member, declared: ArrayField, place: StoragePlace, values: Sequence[_Value]) -> None:
        """An array of each of some instances, with the two of complex numbers, words apart from numbers."""
        if declared.per is not None:
            self._attributes(place)[place.prefix + member.name] = _listed([list(each.value) for each in values])
            values = [_Value((*v.labels, name), v.owners, item) for v in values for name, item in v.value.items()]
            place = place_in(place, member.name, declared)
        arrays = [_array(each.value) for each in values]
        mixed = {array.dtype.kind == "O" for array in arrays} == {True, False}
        for (labels, owners, _), array in zip(values, arrays, strict=True):
            unit, meaning = (filled(text, owners) for text in (declared.unit, declared.meaning))
            parts = [("_text" if mixed and array.dtype.kind == "O" else "", array, meaning)]
            if array.dtype.kind == "c":
                imaginary = filled(declared.imaginary, owners) or f"{meaning}, imaginary part"
                real = meaning if declared.imaginary else f"{meaning}, real part"
                parts = [("_real", array.real, real), ("_imag", array.imag, imaginary)]
            for end, part, text in parts:
                attributes = flagged(declared.flags) if declared.flags else {}
                attributes |= {NAMES: declared.names} if declared.names else {}
                self._part(spot(member, place, end), labels, part, (unit, text), attributes)

    def _part(self, at: Spot, labels: Labels, array: Any, texts: tuple[str, str], more: dict[str, Any]) -> None:
        """The part of a variable that a member has."""
        if array.ndim != len(at.axes):
            raise TypeError(f"{at.path} is declared along {len(at.axes)} axes, not {array.shape}")
        absorbed = len(labels) - len(at.kept)
        for k, axis in enumerate(at.axes):
            if axis is at.whose:
                self._numbers(axis.place.dataset, axis.place.dims, labels[:absorbed])
                rows = self.rows.setdefault(axis.path, (axis, {}))[1]
                if rows.setdefault(labels[:absorbed], array.shape[k]) != array.shape[k]:
                    raise TypeError(f"{axis.path}_count of {labels[:absorbed]} is {array.shape[k]}, and is not")
            elif axis.table:
                raise TypeError(f"{at.path} is along two axes that differ from member to member")
            else:
                self._values_along(at, k, labels, array, texts)
        if at.scale:
            return
        variable = self.variables.setdefault(at.path, _Variable(at, more))
        if at != variable.spot:
            raise TypeError(f"two fields are called {at.path}")
        variable.parts.append((labels, array))
        variable.units.append(texts[0] or "1")
        variable.meanings.append(texts[1])
        self._numbers(at.dataset, at.kept, labels[absorbed:])

    def _values_along(self, at: Spot, k: int, labels: Labels, array: Any, texts: tuple[str, str]) -> None:
        """Note the values of an axis that a member has, of which an array has as many."""
        axis, size = at.axes[k], array.shape[k]
        known = self.axes.setdefault(axis.path, _AxisValues(axis))
        self.coordinates[f"/{at.dataset}/{axis.name}"] = known
        own = labels[: len(axis.place.dims)]
        if at.scale:
            known.by_labels[own] = array
            known.texts = known.texts if known.texts[1] else (texts[0] or "1", texts[1])
        elif own not in known.by_labels and axis.counter is not None:
            counter = axis.counter
            known.by_labels[own] = _array(counter.labels[:size] if counter.labels else counter.start + np.arange(size))
            known.texts = ("1", counter.meaning)
        if own not in known.by_labels:
            raise KeyError(f"{at.path} has no axis {axis.name}")
        if known.by_labels[own].shape != (size,):
            raise TypeError(f"{at.path} has {size} values along {axis.name}, which has {known.by_labels[own].shape}")

    def _numbers(self, dataset: str, dims: Sequence[str], labels: Labels) -> tuple[int, ...]:
        """Of labels their numbers along dimensions of a dataset, new ones in order of appearance."""
        numbers = []
        for dim, label in zip(dims, labels, strict=True):
            known = self.numbers.setdefault(f"/{dataset}/{dim}", {})
            numbers.append(known.setdefault(label, len(known)))
        return tuple(numbers)

    # What is gathered, as items

    def finish(self) -> None:
        """Make the items of the variables that are gathered."""
        for path, known in self.numbers.items():
            values = _array(tuple(known))
            text = "name of the" if values.dtype == object else "number of the"
            self._put(path, values, {"units": "1", "long_name": f"{text} {last(path).replace('_', ' ')}"})
        for path, along in self.coordinates.items():
            self._put(path, self._all_values(along.axis), {"units": along.texts[0], "long_name": along.texts[1]})
        for along in self.axes.values():
            if {each.size for each in along.by_labels.values()} != {self._all_values(along.axis).size}:
                self._known_values(along)
        for axis, rows in self.rows.values():
            self._count_rows(axis, rows)
        for variable in self.variables.values():
            self._assemble(variable)

    def _put(self, path: str, array: Any, attributes: dict[str, Any], axes: tuple[str, ...] | None = None) -> None:
        """The item of a variable, or of a coordinate if it has no axes."""
        self.items.setdefault(path[: path.rindex("/")], Item())
        if path in self.items:
            raise TypeError(f"two fields are called {path}")
        self.items[path] = Item(attributes, array, axes or (), axes is None)

    def _all_values(self, axis: Axis) -> Any:
        """The values of an axis that any member has, in order of appearance; one count of a name is the same axis."""
        first, *others = (
            values
            for path, along in self.axes.items()
            if path == axis.path
            or (axis.counter and (along.axis.place.dataset, along.axis.name) == (axis.place.dataset, axis.name))
            for values in along.by_labels.values()
        )
        if all(each is first or np.array_equal(each, first) for each in others):
            return first
        return _array(tuple(dict.fromkeys(value for each in (first, *others) for value in each.tolist())))

    def _known_values(self, along: _AxisValues) -> None:
        """Where members have different values of an axis: which of them each has."""
        axis, whole = along.axis, self._all_values(along.axis)
        dataset, dims = axis.place.dataset, axis.place.dims
        paths, scale = [f"/{dataset}/{dim}" for dim in dims], f"/{dataset}/{axis.name}"
        if scale not in self.items:
            self._put(scale, whole, {"units": "1", "long_name": along.texts[1]})
        known = np.zeros([*(len(self.numbers[path]) for path in paths), whole.size], dtype=bool)
        for labels, values in along.by_labels.items():
            known[self._numbers(dataset, dims, labels)] = np.isin(whole, values)
        text = {"units": "1", "long_name": f"whether it has this value of {axis.name}"}
        self._put(f"{axis.path}_known", known, text | flagged(("no", "yes")), (*paths, scale))

    def _in_all_values(self, at: Spot, labels: Labels, array: Any, fill: Any) -> Any:
        """An array along all values of axes of which a member has some."""
        for k, axis in enumerate(at.axes):
            if f"{axis.path}_known" in self.items and not axis.table:
                whole = self._all_values(axis)
                own = self.axes[axis.path].by_labels[labels[: len(axis.place.dims)]]
                expanded = np.full((*array.shape[:k], whole.size, *array.shape[k + 1 :]), fill, dtype=array.dtype)
                expanded[(slice(None),) * k + (np.isin(whole, own),)] = array
                array = expanded
        return array

    def _count_rows(self, axis: Axis, rows: Mapping[Labels, int]) -> None:
        """The number of rows of each member, and in their dataset whose each row is."""
        dataset, dims, counter = axis.place.dataset, axis.place.dims, axis.counter
        paths = tuple(f"/{dataset}/{dim}" for dim in dims)
        sizes = np.zeros([len(self.numbers[path]) for path in paths], dtype=np.int64)
        for labels, size in rows.items():
            sizes[self._numbers(dataset, dims, labels)] = size
        text = {"units": "1", "long_name": f"number of rows in {axis.table}", "sample_dimension": axis.dim}
        self._put(f"{axis.path}_count", sizes, text, paths)
        total, scale = int(sizes.sum()), f"/{axis.table}/{axis.dim}"
        if scale not in self.items:
            self._put(scale, np.arange(total), {"units": "1", "long_name": ROW})
        elif self.items[scale].array.size != total:
            raise TypeError(f"{scale} has {self.items[scale].array.size} rows, not {total}")
        columns: dict[str, tuple[Any, dict[str, Any]]] = {}
        if counter is not None:
            numbers = [np.zeros(0), *(counter.start + np.arange(size) for size in sizes.ravel())]
            columns[f"{axis.dim}_number"] = np.concatenate(numbers), {"units": "1", "long_name": counter.meaning}
        for dim, path, index in zip(dims, paths, np.indices(sizes.shape), strict=True):
            text = {"units": "1", "long_name": f"number of the {dim.replace('_', ' ')}, from 0", NAMES: path[1:]}
            columns[dim] = np.repeat(index.ravel(), sizes.ravel()), text
        for name, (of_rows, text) in columns.items():
            if f"/{axis.table}/{name}" not in self.items:
                self._put(f"/{axis.table}/{name}", of_rows.astype(np.int32), text, (scale,))

    def _assemble(self, variable: _Variable) -> None:
        """The item of a variable, from its parts."""
        at, whose = variable.spot, variable.spot.whose
        coordinates = [f"/{at.dataset}/{dim}" for dim in at.kept]
        kept = [len(self.numbers[path]) for path in coordinates]
        sizes = np.ones(1, dtype=np.int64) if whose is None else self.items[f"{whose.path}_count"].array
        offsets = np.concatenate([[0], np.cumsum(sizes)])
        dtype = np.result_type(*{array.dtype for _, array in variable.parts})
        fill: Any = "" if dtype.kind == "O" else np.nan if dtype.kind == "f" else 0
        tail: list[int] = []
        parts, units = [], np.full((sizes.size, *kept), "", dtype=object)  # none where a member has no part
        for (labels, own), unit in zip(variable.parts, variable.units, strict=True):
            array = own
            if any(f"{axis.path}_known" in self.items for axis in at.axes):
                array = self._in_all_values(at, labels, own, fill)
            tail = list(array.shape)
            absorbed, of_rows, rows = len(labels) - len(kept), 0, [slice(None)] * array.ndim
            if whose is not None and at.ragged is not None:
                numbers = self._numbers(whose.place.dataset, whose.place.dims, labels[:absorbed])
                of_rows = int(np.ravel_multi_index(numbers, sizes.shape))
                rows[at.ragged] = slice(int(offsets[of_rows]), int(offsets[of_rows]) + array.shape[at.ragged])
                tail[at.ragged] = int(offsets[-1])
            of_members = self._numbers(at.dataset, at.kept, labels[absorbed:])
            if units[(of_rows, *of_members)]:
                raise TypeError(f"two fields are called {at.path}")
            units[(of_rows, *of_members)] = unit
            parts.append(((*of_members, *rows, ...), array))
        shape = (*kept, *tail)
        if dtype.kind != "O" and math.prod(shape) * dtype.itemsize > ASSEMBLED:
            whole: Any = InParts(shape, dtype, tuple(parts), fill)
        else:
            whole = np.full(shape, fill, dtype=dtype)
            for index, values in parts:
                whole[index] = values
        attributes: dict[str, Any] = {"units": variable.units[0], "long_name": variable.meanings[0]}
        if len(set(variable.units)) > 1:
            attributes |= {"units": MIXED, OF_EACH: json.dumps(units.ravel().tolist(), ensure_ascii=False)}
        if len(set(variable.meanings)) > 1:
            attributes["long_name"] = " | ".join(dict.fromkeys(variable.meanings))
        if not units.all():
            attributes[ABSENT] = json.dumps(np.flatnonzero(units == "").tolist())
        axes = (f"/{at.dataset}/{axis.dim}" for axis in at.axes)
        self._put(at.path, whole, attributes | variable.more, (*coordinates, *axes))


def _writing_rank(member: Member) -> int:
    """Axes before the arrays along them."""
    scale = isinstance(member.declaration, ArrayField) and member.declaration.scale
    return 0 if scale else 1 if isinstance(member.declaration, Group) and not member.declaration.path else 2


def _listed(lists: list[Any]) -> str:
    """Lists of instances as JSON; one where all are the same."""
    return json.dumps(lists[:1] if all(each == lists[0] for each in lists) else lists, ensure_ascii=False)


def label_of(declared: Members, key: Any) -> tuple[Any, str]:
    """The value of the coordinate that a key has, and what of it ends the names of the variables."""
    if not isinstance(key, tuple):
        return key, ""
    if declared.split:
        return key[0], f"_{key[declared.by.index(declared.split)]}"
    return " ".join(map(str, key)), ""


def _array(value: Any) -> Any:
    """An array, of objects where it holds text."""
    values = np.asarray(value)
    return values.astype(object) if values.dtype.kind == "U" or (isinstance(value, tuple) and not value) else values


# --- From items to a result ------------------------------------------------------------------------------------------


class _Missing:
    """What stands for a value that the items lack."""


MISSING: Any = _Missing()


class _Read(NamedTuple):
    """A dataclass that is read: its labels, and the fields of it and of what contains it, the innermost first."""

    labels: Labels
    owners: tuple[dict[str, Any], ...]
    key: Any = None


class Reader:
    """Dataclasses from items."""

    def __init__(self, items: Items) -> None:
        self.items = items
        self._indices: dict[str, dict[Any, int]] = {}
        self._offsets: dict[str, tuple[tuple[int, ...], Any]] = {}
        self._absent: dict[str, frozenset[int]] = {}

    def fields(self, cls: Any) -> dict[str, Any]:
        """The declared fields of the class of a result, by name.

        Parameters
        ----------
        cls : the class.

        Returns
        -------
        dict
            Fields that the items lack have their defaults; those of arrays that were not read yet are `Deferred`.

        Raises
        ------
        KeyError
            If a field without a default is missing.
        ValueError
            If one is of another type or shape.
        """
        (found,) = self._read(cls, root_place(cls), [_Read((), ())])
        return found

    def _read(self, cls: Any, place: StoragePlace, instances: Sequence[_Read]) -> list[dict[str, Any]]:
        """Of each instance of a class its fields."""
        found: list[dict[str, Any]] = [{} for _ in instances]
        own = [_Read(each.labels, (of, *each.owners), each.key) for each, of in zip(instances, found, strict=True)]
        members = (member for member in members_of(cls) if not member.derived)
        for member in sorted(members, key=lambda member: not isinstance(member.declaration, Attribute)):
            for of, value in zip(found, self._values(member, place, own), strict=True):
                if value is MISSING:
                    if member.default is None:
                        raise KeyError(f"/{place.dataset}/{place.prefix}{member.stored_name} is missing")
                    value = member.default()
                of[member.name] = value
        return found

    def _values(self, member: Member, place: StoragePlace, instances: Sequence[_Read]) -> list[Any]:
        match member.declaration:
            case Key():
                return [_of_type(each.key, member) for each in instances]
            case Attribute() as declared:
                return [self._attribute(member, declared, place, each) for each in instances]
            case Group() as declared:
                return self._group(member, declared, place, instances)
            case Members() as declared:
                return self._members(member, declared, place, instances)
            case Table() as declared:
                return [self._table(member, declared, place, each) for each in instances]
            case ArrayField(per=str()) as declared:
                return self._by_name(member, declared, place, instances)
            case ArrayField() as declared:
                return [self._array(member, declared, place, each) for each in instances]
        raise TypeError(f"{member.name} is not stored")

    def _listed(self, member: Member, place: StoragePlace, count: int) -> list[Any]:
        """What the attribute that is called as a field lists for each instance."""
        item = self.items.get(place.attributes)
        text = None if item is None else item.attributes.get(place.prefix + member.name)
        if text is None:
            return [MISSING] * count
        listed = JSON.read("", {"": text})
        if not isinstance(listed, tuple) or len(listed) not in (1, count):
            raise ValueError(f"{place.attributes}@{place.prefix}{member.name} is no list of what there is")
        each = listed * count if len(listed) == 1 else listed
        return [MISSING if isinstance(of, float) else of for of in each]  # null: none

    def _attribute(self, member: Member, declared: Attribute, place: StoragePlace, instance: _Read) -> Any:
        columns = _Columns(self, member, place, instance.labels)
        if member.stored_name not in columns:
            return MISSING
        if declared.codec is not None:
            return _decoded(declared.codec.read(member.stored_name, columns), member)
        value = columns[member.stored_name]
        if place.dims and member.type.startswith("tuple"):
            value = JSON.read("", {"": value})
        return _of_type(value, member)

    def _group(self, member: Member, declared: Group, place: StoragePlace, instances: Sequence[_Read]) -> list[Any]:
        below = place_in(place, member.name, declared)
        if place.dims:
            item = self.items.get(place.attributes)
            text = None if item is None else item.attributes.get(place.prefix + member.name)
            having = () if text is None else JSON.read("", {"": text})
            known = {tuple(labels) for labels in having}
            present = [each for each in instances if each.labels in known]
        elif declared.path and f"/{below.dataset}" not in self.items:
            present = []
        else:
            present = list(instances)
        try:
            made = self._read(declared.of, below, present)
        except KeyError:
            if member.default is None or declared.path:
                raise
            return [MISSING] * len(instances)
        found = {each.labels: made_of(declared.of, of) for each, of in zip(present, made, strict=True)}
        return [found.get(each.labels, MISSING) for each in instances]

    def _members(self, member: Member, declared: Members, place: StoragePlace, instances: Sequence[_Read]) -> list[Any]:
        below = place_in(place, member.name, declared)
        stored = {each.name for each in members_of(declared.of)}
        within: dict[str, list[tuple[int, Any, _Read]]] = {}
        keys_of = self._listed(member, place, len(instances))
        for number, (instance, keys) in enumerate(zip(instances, keys_of, strict=True)):
            if keys is MISSING:
                continue
            for key in keys:
                given = dict(zip(declared.by, key, strict=True)) if declared.by else {}
                given = {name: value for name, value in given.items() if name not in stored}
                own = dict(zip(declared.by, key, strict=True)).get(key_of(declared.of), key) if declared.by else key
                label, end = label_of(declared, key)
                read = _Read((*instance.labels, label), (given, *instance.owners), own)
                within.setdefault(end, []).append((number, key, read))
        made: dict[tuple[int, Any], Any] = {}
        for end, each in within.items():
            found = self._read(declared.of, replace(below, suffix=end), [read for _, _, read in each])
            for (number, key, read), of in zip(each, found, strict=True):
                made[number, key] = made_of(declared.of, {**read.owners[0], **of})
        of_instances: list[Any] = []
        for number, keys in enumerate(keys_of):
            if keys is MISSING:
                of_instances.append(MISSING)
                continue
            own_members = {key: made[number, key] for key in keys}
            of_instances.append(own_members if member.type.startswith("dict") else tuple(own_members.values()))
        return of_instances

    def _by_name(
        self, member: Member, declared: ArrayField, place: StoragePlace, instances: Sequence[_Read]
    ) -> list[Any]:
        below, found = place_in(place, member.name, declared), list[Any]()
        for instance, names in zip(instances, self._listed(member, place, len(instances)), strict=True):
            if names is MISSING:
                found.append(MISSING)
                continue
            of = {}
            for name in names:
                of[name] = self._array(member, declared, below, instance._replace(labels=(*instance.labels, name)))
                if of[name] is MISSING:
                    raise KeyError(f"{member.stored_name} of {name} is missing")
            found.append(of)
        return found

    def _table(self, member: Member, declared: Table, place: StoragePlace, instance: _Read) -> Any:
        below, columns = place_in(place, member.name, declared), dict[str, list[Any]]()
        for column in members_of(declared.of):
            at = spot(column, below)
            if column.derived or (at.path not in self.items and column.default is not None):
                continue
            if at.path not in self.items:
                if f"/{below.dataset}" in self.items and not columns and declared.path and not place.dims:
                    raise KeyError(f"{at.path} is missing")
                return () if member.default is None else MISSING
            values = self._part(at, instance.labels)
            if values is MISSING:
                return () if member.default is None else MISSING
            if np.ndim(values) == 0:
                raise ValueError(f"{at.path} is no column")
            columns[column.name] = [_of_type(value, column) for value in np.asarray(values)]
        return tuple(declared.of(**dict(zip(columns, row, strict=True))) for row in zip(*columns.values(), strict=True))

    def _array(self, member: Member, declared: ArrayField, place: StoragePlace, instance: _Read) -> Any:
        """The array of one instance, in whichever way it is stored."""
        for ends in (("",), ("_real", "_imag"), ("_text",)):
            spots = [spot(member, place, end) for end in ends]
            if any(at.path not in self.items for at in spots):
                continue
            parts = [self._part(at, instance.labels) for at in spots]
            if any(part is MISSING for part in parts):
                continue
            return self._made(member, spots[0], parts)
        return MISSING

    def _made(self, member: Member, at: Spot, parts: list[Any]) -> Any:
        """The value of a field that is stored as an array, or as two of them."""
        if parts[0].dtype == object:
            if member.type not in ("str", "tuple[str, ...]", "NDArray[Any]"):
                raise ValueError(f"{at.path} holds text instead of numbers")
            words = [str(word) for word in np.ravel(np.asarray(parts[0]))]
            if member.scalar is str:
                return words[0]
            return tuple(words) if member.type.startswith("tuple") else np.array(words, dtype=str)
        if member.scalar is not None or (not parts[0].ndim and not at.axes):
            return _of_type(np.asarray(parts[0])[()], member)
        if member.type.startswith("tuple"):
            return tuple(np.asarray(parts[0]).tolist())
        return _when_used(_joined, *parts)

    def _part(self, at: Spot, labels: Labels) -> Any:
        """What a member has of a variable, not read if it is large; `MISSING` if the member does not have it."""
        item = self._variable(at)
        whose, offsets = at.whose, None
        sizes: tuple[int, ...] = ()
        absorbed = len(labels) - len(at.kept)
        of_rows = 0
        if whose is not None:
            sizes, offsets = self._rows(whose)
            numbers = self._numbers(whose.place.dataset, whose.place.dims, labels[:absorbed])
            of_rows = int(np.ravel_multi_index(numbers, sizes))
        index = self._numbers(at.dataset, at.kept, labels[absorbed:])
        kept = tuple(item.array.shape[: len(at.kept)])
        flat = int(np.ravel_multi_index((of_rows, *index), (math.prod(sizes), *kept)))
        if flat in self._absent_of(at.path, item):
            return MISSING
        rows = [slice(None)] * len(at.axes)
        if at.ragged is not None and offsets is not None:
            if offsets[-1] != item.array.shape[len(at.kept) + at.ragged]:
                raise ValueError(f"{at.path} has not as many rows as its members have")
            rows[at.ragged] = slice(int(offsets[of_rows]), int(offsets[of_rows + 1]))
        if index or any(each != slice(None) for each in rows):
            return self._of_known(at, labels, part_of(item.array, (*index, *rows)))
        return self._of_known(at, labels, item.array)

    def _of_known(self, at: Spot, labels: Labels, array: Any) -> Any:
        """An array along those values of its axes that a member has."""
        for k, axis in enumerate(at.axes):
            if axis.table or not axis.place.dims or f"{axis.path}_known" not in self.items:
                continue
            dims = axis.place.dims
            known = self.items[f"{axis.path}_known"].values[
                self._numbers(axis.place.dataset, dims, labels[: len(dims)])
            ]
            array = np.compress(known, np.asarray(array), axis=k)
        return array

    def _variable(self, at: Spot) -> Item:
        item = self.items[at.path]
        if item.array is None:
            raise ValueError(f"{at.path} is a group")
        if at.scale:
            if not item.scale:
                raise ValueError(f"{at.path} is no dimension scale")
        else:
            axes = tuple(f"/{at.dataset}/{dim}" for dim in (*at.kept, *(axis.dim for axis in at.axes)))
            if tuple(item.axes) != axes:
                along = ", ".join(map(last, item.axes)) or "no axes"
                raise ValueError(f"{at.path} is along {along}, not {', '.join(map(last, axes))}")
        return item

    def _numbers(self, dataset: str, dims: Sequence[str], labels: Labels) -> tuple[int, ...]:
        return tuple(self._index(f"/{dataset}/{dim}")[label] for dim, label in zip(dims, labels, strict=True))

    def _index(self, path: str) -> dict[Any, int]:
        """By label of a coordinate its number."""
        if path not in self._indices:
            values = self.items[path].values
            labels = map(str, values) if values.dtype == object else values.tolist()
            self._indices[path] = {label: k for k, label in enumerate(labels)}
        return self._indices[path]

    def _rows(self, axis: Axis) -> tuple[tuple[int, ...], Any]:
        """Sizes of the dimensions of members, and where the rows of each begin, with the end."""
        if axis.path not in self._offsets:
            counts = self.items[f"{axis.path}_count"].values
            if counts.dtype.kind not in "iu" or (counts < 0).any():
                raise ValueError(f"{axis.path}_count does not count rows")
            self._offsets[axis.path] = counts.shape, np.concatenate([[0], np.cumsum(counts)])
        return self._offsets[axis.path]

    def _absent_of(self, path: str, item: Item) -> frozenset[int]:
        if path not in self._absent:
            self._absent[path] = item.absent
        return self._absent[path]


class _Columns(Mapping[str, Any]):
    """Attributes of an instance by name, which for members are variables along their dimension."""

    def __init__(self, reader: Reader, member: Member, place: StoragePlace, labels: Labels) -> None:
        self.reader, self.place, self.labels = reader, place, labels
        self.at = spot(member, place)
        group = reader.items.get(place.attributes)
        self.attributes = {} if group is None else group.attributes

    def __getitem__(self, name: str) -> Any:
        called = self.place.prefix + name + self.place.suffix
        if not self.place.dims:
            return self.attributes[called]
        at = self.at._replace(path=f"/{self.place.dataset}/{called}")
        if at.path not in self.reader.items:
            raise KeyError(f"{at.path} is missing")
        value = self.reader._part(at, self.labels)
        if value is MISSING:
            raise KeyError(f"{at.path} is missing")
        return np.asarray(value)[()] if not isinstance(value, str) else value

    def __iter__(self) -> Iterator[str]:
        return iter(self.attributes)

    def __len__(self) -> int:
        return len(self.attributes)


def _joined(*arrays: Any) -> Any:
    """The numbers of one array, or complex ones of their two parts."""
    return np.asarray(arrays[0]) if len(arrays) == 1 else np.asarray(arrays[0]) + 1j * np.asarray(arrays[1])


def _when_used(make: Callable[..., Any], *arrays: Any) -> Any:
    """What a function makes of arrays: now if all of them were read, otherwise when it is first used."""
    if all(isinstance(array, np.ndarray) for array in arrays):
        return make(*arrays)
    return Deferred(partial(make, *arrays))


def _decoded(value: Any, member: Member) -> Any:
    """A value from a text, checked where its type is one of texts or numbers."""
    checked = _OF_JSON.get(member.type)
    return value if checked is None else checked.validate_python(value, strict=True)


_OF_JSON: dict[str, Any] = {
    written: TypeAdapter(meant)
    for written, meant in (
        ("tuple[str, ...]", tuple[str, ...]), ("dict[str, str]", dict[str, str]), ("dict[str, float]", dict[str, float])
    )
}  # fmt: skip
_KINDS = {float: "iufb", int: "iub", bool: "bu", str: "U"}  # of NumPy, that a scalar of this type is stored as


def _of_type(value: Any, member: Member) -> Any:
    """A number or text of the type of its field; several as a tuple where it is one.

    Raises
    ------
    ValueError
        If it is of another type.
    """
    if member.scalar is not None:
        kinds = _KINDS.get(member.scalar, "")  # type: ignore[call-overload]
        if np.ndim(value) or np.asarray(value).dtype.kind not in kinds:
            raise ValueError(f"{member.stored_name} is {type(value).__name__}, not {member.type}")
        return member.scalar(value)
    if isinstance(value, np.ndarray):
        return tuple(value.tolist()) if member.type.startswith("tuple") else value
    return value.item() if isinstance(value, np.generic) else value
