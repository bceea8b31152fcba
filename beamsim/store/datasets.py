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
    Folded,
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
    parent,
    part_of,
)
from beamsim.store.layout import (
    Axis,
    Spot,
    StoragePlace,
    by_name,
    column_spot,
    group_place,
    members_place,
    root_place,
    spot,
    table_place,
)

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

_OfAxis = tuple[str, str, str]  # dataset, prefix and name
Labels = tuple[Any, ...]  # of a member and of those that it belongs to, outermost first


class _Instance(NamedTuple):
    """A dataclass, with its labels."""

    labels: Labels
    owners: tuple[Any, ...]  # itself and what contains it, the innermost first: they fill ``{field}`` in texts


class _Value(NamedTuple):
    """A value of a field of an instance."""

    labels: Labels
    owners: tuple[Any, ...]
    value: Any


@dataclass
class _Variable:
    """A variable whose parts are gathered."""

    spot: Spot
    more: dict[str, Any]  # attributes
    parts: list[tuple[Labels, Any]] = field(default_factory=list)
    units: list[str] = field(default_factory=list)
    meanings: list[str] = field(default_factory=list)


def items_of(result: Any) -> Items:
    """The declared fields of a result as items."""
    writer = _Writer(getattr(result, "scenario", None))
    cls = type(result)
    writer.add(cls, root_place(cls), [_Instance((), (result,))])
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
        self.labels: dict[str, dict[Any, None]] = {}  # of members, by path of the coordinate, in order
        self._indices: dict[str, dict[Any, int]] = {}
        self.rows: dict[str, dict[Labels, int]] = {}  # of each member, by path of the counts
        self.values_of_axes: dict[_OfAxis, dict[Labels, Any]] = {}  # of the members that have the axis
        self.texts_of_axes: dict[_OfAxis, tuple[str, str]] = {}
        self.shared: dict[_OfAxis, Axis] = {}  # axes that members have the same of, or some of the same values
        self.coordinates: dict[str, Axis] = {}  # by path, those that variables are along

    def item(self, path: str) -> Item:
        """The item of this path, which may be new, after the group around it."""
        if path not in self.items:
            if path != "/":
                self.item(parent(path))
            self.items[path] = Item()
        return self.items[path]

    def add(self, cls: Any, place: StoragePlace, instances: list[_Instance]) -> None:
        """The declared fields of instances of a class."""
        for member in sorted(members_of(cls), key=_writing_rank):
            found = [_Value(*each, getattr(each.owners[0], member.name)) for each in instances]
            known = [each for each in found if each.value is not None]
            match member.declaration:
                case Members() as declared:
                    self._members(member, declared, place, found)
                case Group() as declared if known:
                    self._group(member, declared, place, known)
                case Table() as declared:
                    self._table(member, declared, place, known)
                case Attribute() as declared if known:
                    self._attribute(member, declared, place, known)
                case ArrayField(per=str()) as declared:
                    self._by_name(member, declared, place, known)
                case ArrayField() as declared if known:
                    self._arrays(member, declared, place, known)

    def _attribute(self, member: Member, declared: Attribute, place: StoragePlace, values: list[_Value]) -> None:
        name = member.stored_name
        for labels, owners, value in values:
            coded = {name: value} if declared.codec is None else declared.codec.write(name, value)
            for key, one in coded.items():
                if not place.dims:
                    group = self.item(place.attributes)
                    if place.prefix + key in group.attributes:
                        raise TypeError(f"two fields are called {place.attributes}@{place.prefix}{key}")
                    group.attributes[place.prefix + key] = np.uint8(one) if isinstance(one, bool) else one
                else:
                    one = json.dumps(one) if isinstance(one, (tuple, list)) else one
                    at = spot(member, place)._replace(name=place.prefix + key + place.suffix)
                    more = flagged(("false", "true")) if isinstance(one, (bool, np.bool_)) else None
                    texts = (filled(declared.unit, owners), declared.meaning)
                    self._part(at, labels, np.asarray(_array(one)), texts, more)

    def _by_name(self, member: Member, declared: ArrayField, place: StoragePlace, values: list[_Value]) -> None:
        below = by_name(place, declared)
        each = [
            _Value((*labels, name), owners, item) for labels, owners, value in values for name, item in value.items()
        ]
        self._arrays(member, declared, below, each)
        listed = [list(value) for _, _, value in values]
        self.item(place.attributes).attributes[place.prefix + member.name] = _listed(listed)

    def _group(self, member: Member, declared: Group, place: StoragePlace, values: list[_Value]) -> None:
        below = group_place(place, declared)
        self.item(f"/{below.dataset}" if declared.path else place.attributes)
        if place.dims:
            having = json.dumps([labels for labels, _, _ in values], ensure_ascii=False)
            self.item(place.attributes).attributes[place.prefix + member.name] = having
        self.add(declared.of, below, [_Instance(labels, (value, *owners)) for labels, owners, value in values])

    def _members(self, member: Member, declared: Members, place: StoragePlace, values: list[_Value]) -> None:
        below, listed, instances = members_place(place, declared), list[Any](), list[tuple[Any, _Instance]]()
        for labels, owners, value in values:
            pairs = None if value is None else _with_keys(declared, value)
            listed.append(None if pairs is None else [key for key, _ in pairs])
            for key, item in pairs or ():
                own = (*labels, label_of(declared, key))
                instances.append((_part_of_key(declared, key), _Instance(own, (item, *owners))))
        if all(each is None for each in listed):
            return
        self.item(place.attributes).attributes[place.prefix + member.name] = _listed(listed)
        for part in dict.fromkeys(part for part, _ in instances):
            of_part = [each for which, each in instances if which == part]
            self.add(declared.of, _ending(below, part), of_part)
            self._own(declared, below, of_part)

    def _own(self, declared: Members, place: StoragePlace, instances: list[_Instance]) -> None:
        """What is known of members besides their fields: their labels, and the body of places."""
        path = f"/{place.dataset}/{declared.dim}"
        self.labels.setdefault(path, {}).update(dict.fromkeys(each.labels[-1] for each in instances))
        self._counts_of(place, instances)
        bodies = self.scenario.bodies_of_places.get(f"{declared.dim}s", {}) if self.scenario else {}
        if len(place.dims) == 1 and any(bodies.get(each.labels[0]) for each in instances):
            at = Spot(place.dataset, f"{declared.dim}_body", place.dims, ())
            if at.path not in self.variables:
                for each in instances:
                    body = np.asarray(bodies.get(each.labels[0]) or "", dtype=object)
                    self._part(at, each.labels, body, ("1", "name of the body"))

    def _counts_of(self, place: StoragePlace, instances: list[_Instance]) -> None:
        """Labels of the members that a place is in, which rows refer to by their numbers."""
        for k, dim in enumerate(place.dims):
            known = self.labels.setdefault(f"/{place.dataset}/{dim}", {})
            known.update(dict.fromkeys(each.labels[k] for each in instances))

    def _table(self, member: Member, declared: Table, place: StoragePlace, values: list[_Value]) -> None:
        below = table_place(place, member.name, declared)
        with_rows = [each for each in values if each.value]
        self._counts_of(place, [_Instance(labels, owners) for labels, owners, _ in values])
        for column in sorted(members_of(declared.of), key=_writing_rank):
            at = column_spot(column, below)
            cells = [(each, [getattr(row, column.name) for row in each.value]) for each in with_rows]
            optional = column.default is not None and column.default() is None
            if optional and all(value is None for _, of_rows in cells for value in of_rows):
                continue
            for each, of_rows in cells:
                texts = (filled(column.declaration.unit, each.owners), filled(column.declaration.meaning, each.owners))
                self._part(at, each.labels, _cells(of_rows, column), texts, _more_of(column.declaration))

    def _arrays(self, member: Member, declared: ArrayField, place: StoragePlace, values: list[_Value]) -> None:
        """An array of each of some instances, with the two of complex numbers, words apart from numbers."""
        arrays = [(each, _array(each.value)) for each in values]
        mixed = {array.dtype.kind == "O" for _, array in arrays} == {True, False}
        for each, whole in arrays:
            array, more = whole, False
            if isinstance(declared.along, Folded):
                shape = getattr(each.owners[-1], declared.along.shape)
                more = array.ndim > len(shape)
                array = array.reshape(-1, *array.shape[len(shape) :])
            unit, meaning = (filled(text, each.owners) for text in (declared.unit, declared.meaning))
            suffix = _more_suffix(declared, more)
            if array.dtype.kind == "c":
                imaginary = filled(declared.imaginary, each.owners) or f"{meaning}, imaginary part"
                real = meaning if declared.imaginary else f"{meaning}, real part"
                for end, part, text in (("_real", array.real, real), ("_imag", array.imag, imaginary)):
                    self._part(spot(member, place, more, suffix + end), each.labels, part, (unit, text))
                continue
            suffix += "_text" if mixed and array.dtype.kind == "O" else ""
            self._part(spot(member, place, more, suffix), each.labels, array, (unit, meaning), _more_of(declared))

    def _part(
        self, at: Spot, labels: Labels, array: Any, texts: tuple[str, str], more: Mapping[str, Any] | None = None
    ) -> None:
        """The part of a variable that a member has."""
        if array.ndim != len(at.axes):
            raise TypeError(f"{at.path} is declared along {len(at.axes)} axes, not {array.shape}")
        absorbed = len(labels) - len(at.kept)
        for k, axis in enumerate(at.axes):
            if axis.table and k == at.ragged:
                self._row_count(axis, labels[:absorbed], array.shape[k])
            elif axis.table:
                raise TypeError(f"{at.path} is along two axes that differ from member to member")
            else:
                self._own_values(at, axis, labels, array, k)
        if at.scale:
            self.texts_of_axes.setdefault(_key(at.axes[0]), texts)
            return
        variable = self.variables.setdefault(at.path, _Variable(at, dict(more or {})))
        if at != variable.spot:
            raise TypeError(f"two fields are called {at.path}")
        variable.parts.append((labels, array))
        variable.units.append(texts[0] or "1")
        variable.meanings.append(texts[1])
        for dim, label in zip(at.kept, labels[absorbed:], strict=True):
            self.labels.setdefault(f"/{at.dataset}/{dim}", {})[label] = None

    def _own_values(self, at: Spot, axis: Axis, labels: Labels, array: Any, k: int) -> None:
        """Note the values of an axis that a member has, of which an array has as many."""
        self.shared[_key(axis)] = self.coordinates[f"/{at.dataset}/{axis.name}"] = axis
        known = self.values_of_axes.setdefault(_key(axis), {})
        own = labels[: len(axis.place.dims)]
        if at.scale:
            known[own] = array
        elif own not in known and axis.counter is not None:
            counter, size = axis.counter, array.shape[k]
            known[own] = _array(counter.labels[:size] if counter.labels else counter.start + np.arange(size))
            self.texts_of_axes[_key(axis)] = ("1", counter.meaning)
        if own not in known:
            raise KeyError(f"{at.path} has no axis {axis.name}")
        if known[own].shape != array.shape[k : k + 1]:
            raise TypeError(f"{at.path} has {array.shape[k]} values along {axis.name}, which has {known[own].shape}")

    def _row_count(self, axis: Axis, labels: Labels, size: int) -> None:
        for dim, label in zip(axis.place.dims, labels, strict=True):
            self.labels.setdefault(f"/{axis.place.dataset}/{dim}", {})[label] = None
        if self.rows.setdefault(axis.counts, {}).setdefault(labels, size) != size:
            raise TypeError(f"{axis.counts} of {labels} is {size}, and is not")

    # What is gathered, as items

    def finish(self) -> None:
        """Make the items of the variables that are gathered."""
        for path, known in self.labels.items():
            values = _array(tuple(known))
            text = "name of the" if values.dtype == object else "number of the"
            meaning = f"{text} {last(path).replace('_', ' ')}"
            self._put(path, Item({"units": "1", "long_name": meaning}, values, (), True))
        for path, axis in self.coordinates.items():
            unit, meaning = self.texts_of_axes[_key(axis)]
            texts = {"units": unit or "1", "long_name": meaning}
            self._put(path, Item(texts, self._all_values(axis), (), True))
        for axis in self.shared.values():
            self._known_values(axis)
        for counts, rows in self.rows.items():
            self._counted(counts, rows)
        for variable in self.variables.values():
            self._assemble(variable)

    def _all_values(self, axis: Axis) -> Any:
        """The values of an axis that any member has, in order of appearance; one count of a name is the same axis."""
        dataset, prefix, name = _key(axis)
        alike = (
            own
            for of, own in self.values_of_axes.items()
            if of == (dataset, prefix if axis.counter is None else of[1], name)
        )
        first, *others = (values for own in alike for values in own.values())
        if all(each is first or np.array_equal(each, first) for each in others):
            return first
        return _array(tuple(dict.fromkeys(value for each in (first, *others) for value in each.tolist())))

    def _known_values(self, axis: Axis) -> None:
        """Where members have different values of an axis: which of them each has."""
        whole, own = self._all_values(axis), self.values_of_axes[_key(axis)]
        if all(each.size == whole.size for each in own.values()):
            return
        dims = axis.place.dims
        paths = [f"/{axis.place.dataset}/{dim}" for dim in dims]
        scale = f"/{axis.place.dataset}/{axis.name}"
        if scale not in self.items:
            self._put(scale, Item({"units": "1", "long_name": self.texts_of_axes[_key(axis)][1]}, whole, (), True))
        known = np.zeros([*(len(self.labels[path]) for path in paths), whole.size], dtype=bool)
        for labels, values in own.items():
            known[self._numbers(axis.place.dataset, dims, labels)] = np.isin(whole, values)
        text = {"units": "1", "long_name": f"whether it has this value of {axis.name}"}
        self._put(axis.known, Item(text | flagged(("no", "yes")), known, (*paths, scale)))

    def _in_all_values(self, at: Spot, labels: Labels, array: Any, fill: Any) -> Any:
        """An array along all values of axes of which a member has some."""
        for k, axis in enumerate(at.axes):
            if axis.table or axis.known not in self.items:
                continue
            whole = self._all_values(axis)
            own = self.values_of_axes[_key(axis)][labels[: len(axis.place.dims)]]
            shape = list(array.shape)
            shape[k] = whole.size
            expanded = np.full(shape, fill, dtype=array.dtype)
            expanded[(slice(None),) * k + (np.isin(whole, own),)] = array
            array = expanded
        return array

    def _put(self, path: str, item: Item) -> None:
        self.item(path)
        if self.items[path].array is not None:
            raise TypeError(f"two fields are called {path}")
        self.items[path] = item

    def _counted(self, path: str, rows: Mapping[Labels, int]) -> None:
        """The number of rows of each member, and in their dataset whose each row is."""
        axis = self._axis_of(path)
        dims = axis.place.dims
        sizes = np.zeros([len(self.labels[f"/{axis.place.dataset}/{dim}"]) for dim in dims], dtype=np.int64)
        for labels, size in rows.items():
            sizes[self._numbers(axis.place.dataset, dims, labels)] = size
        along = tuple(f"/{axis.place.dataset}/{dim}" for dim in dims)
        text = {"units": "1", "long_name": f"number of rows in {axis.table}", "sample_dimension": axis.dim}
        self._put(path, Item(text, sizes, along))
        total = int(sizes.sum())
        start = axis.counter.start if axis.counter is not None else 0
        scale = f"/{axis.table}/{axis.dim}"
        meaning = axis.counter.meaning if axis.counter is not None else "number of the row"
        of_each = [start + np.arange(size) for size in sizes.ravel()] if axis.counter is not None else []
        if scale not in self.items:
            self._put(scale, Item({"units": "1", "long_name": ROW}, np.arange(total), (), True))
        elif self.items[scale].array.size != total:
            raise TypeError(f"{scale} has {self.items[scale].array.size} rows, not {total}")
        if of_each and f"/{axis.table}/{axis.dim}_number" not in self.items:
            numbers = np.concatenate([np.zeros(0, dtype=np.int32), *of_each]).astype(np.int32)
            self._put(f"/{axis.table}/{axis.dim}_number", Item({"units": "1", "long_name": meaning}, numbers, (scale,)))
        for dim, index in zip(dims, np.indices(sizes.shape), strict=True):
            if f"/{axis.table}/{dim}" in self.items:
                continue
            of_rows = np.repeat(index.ravel().astype(np.int32), sizes.ravel())
            text = {"units": "1", "long_name": f"number of the {dim.replace('_', ' ')}, from 0"}
            text[NAMES] = f"{axis.place.dataset}/{dim}"
            self._put(f"/{axis.table}/{dim}", Item(text, of_rows, (scale,)))

    def _axis_of(self, counts: str) -> Axis:
        axes = (variable.spot.whose for variable in self.variables.values())
        return next(axis for axis in axes if axis is not None and axis.counts == counts)

    def _numbers(self, dataset: str, dims: Sequence[str], labels: Labels) -> tuple[int, ...]:
        """Of labels their numbers along dimensions of a dataset."""
        return tuple(self._index(f"/{dataset}/{dim}")[label] for dim, label in zip(dims, labels, strict=True))

    def _index(self, path: str) -> dict[Any, int]:
        """By label of a coordinate its number, once all labels are known."""
        if path not in self._indices:
            self._indices[path] = {label: k for k, label in enumerate(self.labels[path])}
        return self._indices[path]

    def _assemble(self, variable: _Variable) -> None:
        at, whose = variable.spot, variable.spot.whose
        coordinates = [f"/{at.dataset}/{dim}" for dim in at.kept]
        kept = [len(self.labels[path]) for path in coordinates]
        sizes, offsets = np.ones(1, dtype=np.int64), np.zeros(1, dtype=np.int64)
        if whose is not None:
            sizes = self.items[whose.counts].array
            offsets = np.concatenate([[0], np.cumsum(sizes)[:-1]])
        dtype = np.result_type(*{array.dtype for _, array in variable.parts})
        fill: Any = "" if dtype.kind == "O" else np.nan if dtype.kind == "f" else 0
        tail = list(self._in_all_values(at, *variable.parts[0], fill).shape)
        if at.ragged is not None:
            tail[at.ragged] = int(sizes.sum())
        parts, places, present = [], list[tuple[int, ...]](), np.zeros((sizes.size, *kept), dtype=bool)
        for labels, own in variable.parts:
            array = self._in_all_values(at, labels, own, fill)
            absorbed = len(labels) - len(kept)
            of_rows = 0
            if whose is not None:
                index = self._numbers(whose.place.dataset, whose.place.dims, labels[:absorbed])
                of_rows = int(np.ravel_multi_index(index, sizes.shape))
            of_members = self._numbers(at.dataset, at.kept, labels[absorbed:])
            begin = int(offsets[of_rows])
            rows = [slice(None)] * array.ndim
            if at.ragged is not None:
                rows[at.ragged] = slice(begin, begin + array.shape[at.ragged])
            if present[(of_rows, *of_members)]:
                raise TypeError(f"two fields are called {at.path}")
            present[(of_rows, *of_members)] = True
            places.append((of_rows, *of_members))
            parts.append(((*of_members, *rows, ...), array))
        whole: Any = InParts((*kept, *tail), dtype, tuple(parts), fill)
        if whole.nbytes <= ASSEMBLED or dtype.kind == "O":
            whole = np.asarray(whole)
        axes = (f"/{at.dataset}/{axis.dim}" for axis in at.axes)
        attributes: dict[str, Any] = {"units": variable.units[0], "long_name": variable.meanings[0]}
        if len(set(variable.units)) > 1:
            units = np.full(present.shape, "", dtype=object)
            for where, unit in zip(places, variable.units, strict=True):
                units[where] = unit
            attributes |= {"units": MIXED, OF_EACH: json.dumps(units.ravel().tolist(), ensure_ascii=False)}
        if len(set(variable.meanings)) > 1:
            attributes["long_name"] = " | ".join(dict.fromkeys(variable.meanings))
        if not present.all():
            attributes[ABSENT] = json.dumps(np.flatnonzero(~present).tolist())
        self._put(at.path, Item(attributes | variable.more, whole, (*coordinates, *axes)))


def _key(axis: Axis) -> _OfAxis:
    """What an axis is known by in all datasets."""
    return axis.place.dataset, axis.place.prefix, axis.name


def _more_of(declared: ArrayField) -> dict[str, Any]:
    """Attributes of a variable besides unit and meaning."""
    return ({} if declared.flags is None else flagged(declared.flags)) | (
        {NAMES: declared.names} if declared.names else {}
    )


def _writing_rank(member: Member) -> int:
    """Axes before the arrays along them."""
    scale = isinstance(member.declaration, ArrayField) and member.declaration.scale
    return 0 if scale else 1 if isinstance(member.declaration, Group) and not member.declaration.path else 2


def _listed(lists: list[Any]) -> str:
    """Lists of instances as JSON; one where all are the same."""
    return json.dumps(lists[:1] if all(each == lists[0] for each in lists) else lists, ensure_ascii=False)


def _with_keys(declared: Members, value: Any) -> list[tuple[Any, Any]]:
    """Dataclasses with their keys."""
    if isinstance(value, Mapping):
        return list(value.items())
    own = key_of(declared.of)
    if declared.by:
        return [(tuple(getattr(item, name) for name in declared.by), item) for item in value]
    return [(getattr(item, own) if own else number, item) for number, item in enumerate(value)]


def label_of(declared: Members, key: Any) -> Any:
    """The value of the coordinate that a key has."""
    if not isinstance(key, tuple):
        return key
    return key[0] if declared.split else " ".join(map(str, key))


def _part_of_key(declared: Members, key: Any) -> str:
    """What of a key ends the names of the variables."""
    return str(key[declared.by.index(declared.split)]) if declared.split else ""


def _ending(place: StoragePlace, part: str) -> StoragePlace:
    """The place of those members whose key has this part."""
    return replace(place, suffix=f"_{part}") if part else place


def _more_suffix(declared: ArrayField, more: bool) -> str:
    along = declared.along
    return f"_by_{along.more.name}" if more and isinstance(along, Folded) and along.more else ""


def _array(value: Any) -> Any:
    """An array, of objects where it holds text."""
    values = np.asarray(value)
    return values.astype(object) if values.dtype.kind == "U" or (isinstance(value, tuple) and not value) else values


def _cells(values: list[Any], column: Member) -> Any:
    if column.scalar is str:
        return np.array(values, dtype=object)
    if column.type.startswith("tuple"):
        return np.array(values, dtype=float).reshape(len(values), -1)
    kind: Any = column.scalar or float
    return np.array(values, dtype=kind)


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
        below = group_place(place, declared)
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
        below = members_place(place, declared)
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
                labels = (*instance.labels, label_of(declared, key))
                read = _Read(labels, (given, *instance.owners), own)
                within.setdefault(_part_of_key(declared, key), []).append((number, key, read))
        made: dict[tuple[int, Any], Any] = {}
        for part, each in within.items():
            found = self._read(declared.of, _ending(below, part), [read for _, _, read in each])
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
        below, found = by_name(place, declared), list[Any]()
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
        below, columns = table_place(place, member.name, declared), dict[str, list[Any]]()
        for column in members_of(declared.of):
            at = column_spot(column, below)
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
        shape = None
        if isinstance(declared.along, Folded):
            stored = np.atleast_1d(self.items["/"].attributes[declared.along.shape])
            shape = tuple(int(size) for size in stored)
        for more in (False, True):
            suffix = _more_suffix(declared, more)
            if more and not suffix:
                break
            for ends in (("",), ("_real", "_imag"), ("_text",)):
                spots = [spot(member, place, more, suffix + end) for end in ends]
                if any(at.path not in self.items for at in spots):
                    continue
                parts = [self._part(at, instance.labels) for at in spots]
                if any(part is MISSING for part in parts):
                    continue
                return self._made(member, spots[0], parts, shape)
        return MISSING

    def _made(self, member: Member, at: Spot, parts: list[Any], shape: tuple[int, ...] | None) -> Any:
        """The value of a field that is stored as an array, or as two of them."""
        if parts[0].dtype == object:
            if not member.may_be_text:
                raise ValueError(f"{at.path} holds text instead of numbers")
            words = [str(word) for word in np.ravel(np.asarray(parts[0]))]
            if member.scalar is str:
                return words[0]
            return tuple(words) if member.type.startswith("tuple") else _unfolded(shape, np.array(words, dtype=str))
        if member.scalar is not None or (not parts[0].ndim and not at.axes):
            return _of_type(np.asarray(parts[0])[()], member)
        if member.type.startswith("tuple"):
            return tuple(np.asarray(parts[0]).tolist())
        return _when_used(partial(_unfolded, shape), *parts)

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
            if axis.table or not axis.place.dims or axis.known not in self.items:
                continue
            dims = axis.place.dims
            known = self.items[axis.known].values[self._numbers(axis.place.dataset, dims, labels[: len(dims)])]
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
        if axis.counts not in self._offsets:
            counts = self.items[axis.counts].values
            if counts.dtype.kind not in "iu" or (counts < 0).any():
                raise ValueError(f"{axis.counts} does not count rows")
            self._offsets[axis.counts] = counts.shape, np.concatenate([[0], np.cumsum(counts)])
        return self._offsets[axis.counts]

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
        at = self.at._replace(name=called)
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


def _unfolded(shape: tuple[int, ...] | None, *arrays: Any) -> Any:
    """The numbers of one array, or complex ones of their two parts; of cases in the shape of their design."""
    values = np.asarray(arrays[0]) if len(arrays) == 1 else np.asarray(arrays[0]) + 1j * np.asarray(arrays[1])
    return values if shape is None else values.reshape(*shape, *values.shape[1:])


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
