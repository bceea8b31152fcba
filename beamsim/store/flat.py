"""A result as flat items by path, and back: what result files and exports are made of.

The declarations of its fields (`beamsim.fields`) say where each of its numbers is, its unit, meaning and axes.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from pydantic import TypeAdapter

from beamsim.fields import (
    JSON,
    Along,
    Attribute,
    Axes,
    Counter,
    Dataset,
    Deferred,
    Group,
    Key,
    Member,
    Members,
    Table,
    filled,
    is_array,
    key_of,
    made_of,
    members_of,
)


@dataclass
class Item:
    """A group, or an array with its axes."""

    attributes: dict[str, Any] = field(default_factory=dict)
    array: Any = (
        None  # None of a group; a large array of a file is not read yet, see `beamsim.store.results.StoredArray`
    )
    axes: tuple[str, ...] = ()  # paths of the scales of an array, one a dimension; empty where one is unknown
    scale: bool = False

    @property
    def values(self) -> Any:
        """The values of the array, which are read from its file if they were not; None of a group."""
        return None if self.array is None else np.asarray(self.array)

    @property
    def unit(self) -> str:
        """Unit of the values."""
        return str(self.attributes.get("units", ""))

    @property
    def meaning(self) -> str:
        """What the values are."""
        return str(self.attributes.get("long_name", ""))


Items = dict[str, Item]  # by path, the groups around an item before it; the root is "/"


def group_name(name: str) -> str:
    """A name as a link: no slash, not ``.``."""
    link = name.replace("/", "∕")
    return f"_{link}" if link.strip(".") == "" else link


def joined(home: str, name: str) -> str:
    """The path of what is called ``name`` in a group; the group itself where that is empty or ``.``."""
    return home if name in ("", ".") else f"{home.rstrip('/')}/{name}"


def parent(path: str) -> str:
    """The group around an item."""
    return path.rpartition("/")[0] or "/"


def last(path: str) -> str:
    """The name of an item in its group."""
    return path.rpartition("/")[2]


def _nearest_axis(items: Items, path: str, name: str) -> str | None:
    """The scale of this name in the group of an item, else in the nearest group around it that has one."""
    group = path
    while group != "/":
        group = parent(group)
        found = items.get(joined(group, name))
        if found is not None and found.scale:
            return joined(group, name)
    return None


class _Here(NamedTuple):
    """Where a dataclass is."""

    path: str
    owners: tuple[Any, ...]  # itself and what contains it, the innermost first: they fill ``{field}`` in texts
    counters: str  # the group of its axes that only count


# --- From a result to items ------------------------------------------------------------------------------------------


def items_of(result: Any) -> Items:
    """The declared fields of a result as items."""
    walk = _Walk(getattr(result, "scenario", None))
    walk.add(result, "/", ())
    return walk.items


class _Walk:
    """The items of a result, one declared field after the other."""

    def __init__(self, scenario: Any) -> None:
        self.items: Items = {"/": Item()}
        self.scenario = scenario

    def item(self, path: str) -> Item:
        """The item of this path, which may be new, with the groups around it."""
        if path not in self.items:
            self.item(parent(path))
            self.items[path] = Item()
        return self.items[path]

    def add(self, value: Any, path: str, owners: tuple[Any, ...], counters: str = "") -> None:
        """The declared fields of a dataclass."""
        here = _Here(path, (value, *owners), counters or path)
        for member in sorted(members_of(type(value)), key=_writing_rank):
            of = getattr(value, member.name)
            if of is not None:
                self._member(member, of, here)

    def _member(self, member: Member, value: Any, here: _Here) -> None:
        match member.declaration:
            case Dataset(per=None) as declared:
                self._array(declared, joined(here.path, filled(member.stored_name, here.owners)), value, here)
            case Dataset() as declared:
                for index, (name, item) in enumerate(value.items()):
                    home = self._labelled(joined(here.path, declared.per or ""), name, index)
                    if np.ndim(item):
                        self._array(declared, joined(home, member.stored_name), item, here)
                    else:
                        self.item(home).attributes[member.stored_name] = item
            case Attribute() as declared:
                place, name = joined(here.path, declared.at), member.stored_name
                if not declared.at or place in self.items:
                    coded = {name: value} if declared.codec is None else declared.codec.write(name, value)
                    self.item(place).attributes.update(coded)
            case Group() as declared:
                path = joined(here.path, declared.path)
                self.item(path)
                self.add(value, path, here.owners)
            case Members() as declared:
                self._members(member, declared, value, here)
            case Table() as declared:
                self._table(declared, value, here)

    def _members(self, member: Member, declared: Members, value: Any, here: _Here) -> None:
        folder = joined(here.path, declared.folder)
        pairs = list(value.items()) if isinstance(value, Mapping) else _with_keys(declared, value)
        labels = list(dict.fromkeys(key[0] if isinstance(key, tuple) else key for key, _ in pairs))
        for key, item in pairs:
            if declared.labelled:
                label = key[0] if isinstance(key, tuple) else key
                home = self._labelled(folder, label, labels.index(label))
            else:
                home = joined(folder, _way(declared, key))
                self.item(home)
            self.add(item, home, here.owners, folder if is_array(declared.of) else "")
        self.item(here.path).attributes[member.name] = json.dumps([key for key, _ in pairs], ensure_ascii=False)

    def _labelled(self, folder: str, name: str, index: int) -> str:
        """The group ``<folder>/<name>`` with its attributes, among them the body if there are several."""
        path = joined(folder, group_name(name))
        home = self.item(path)
        if "index" not in home.attributes:
            home.attributes |= {"name": name, "index": index}
            body = self.scenario.bodies_of_places.get(last(folder), {}).get(name) if self.scenario else None
            if body:
                home.attributes["body"] = body
        return path

    def _table(self, declared: Table, rows: Sequence[Any], here: _Here) -> None:
        if not rows and not declared.empty:
            return
        home = joined(here.path, declared.path)
        axis = "" if declared.rows is None else self._counted(home, declared.rows, len(rows))
        for column in sorted(members_of(declared.of), key=_writing_rank):
            values = [getattr(row, column.name) for row in rows]
            if column.default is not None and column.default() is None and all(value is None for value in values):
                continue
            place = joined(home, column.stored_name)
            if column.declaration.scale:
                axis = place
            self._put(column.declaration, place, _cells(values, column), here._replace(counters=home), rows=(axis,))

    def _array(self, declared: Dataset, path: str, value: Any, here: _Here) -> None:
        """One array, or the two of complex numbers."""
        if declared.phase:
            self._put(declared, path, np.abs(value), here)
            phase = {"units": "degree", "long_name": declared.phase}
            self._put(declared, f"{path}_phase_deg", np.degrees(np.angle(value)), here, phase)
        elif np.iscomplexobj(value):
            meaning = declared.meaning
            texts = (meaning, declared.imaginary) if declared.imaginary else (
                f"{meaning}, real part", f"{meaning}, imaginary part"
            )  # fmt: skip
            for suffix, part, text in zip(("_real", "_imag"), (value.real, value.imag), texts, strict=True):
                self._put(declared, path + suffix, part, here, {"long_name": text})
        else:
            self._put(declared, path, value, here)

    def _put(
        self,
        declared: Dataset,
        path: str,
        value: Any,
        here: _Here,
        texts: Mapping[str, str] | None = None,
        rows: tuple[str, ...] = (),
    ) -> None:
        """One array with its attributes and axes, which begin with that of the rows of a table."""
        item = self.item(path)
        texts = {"units": declared.unit, "long_name": declared.meaning, **(texts or {})}
        item.attributes |= {name: filled(text, here.owners) for name, text in texts.items()}
        item.array, item.scale = _array(value), declared.scale
        if declared.flags is not None:
            item.attributes |= {
                "flag_values": np.array([0, 1], dtype=np.uint8),
                "flag_meanings": " ".join(declared.flags),
            }
        if not declared.scale:
            item.axes = (*rows, *self._axes(declared.along or (), path, here, len(rows)))

    def _axes(self, along: Along, path: str, here: _Here, first: int = 0) -> tuple[str, ...]:
        """Paths of the axes of an array, from the dimension ``first`` on."""
        if isinstance(along, Axes):
            along = self._named_axes(along, path, here.owners[-1])
        if along and first + len(along) != np.ndim(self.items[path].array):
            raise TypeError(
                f"{path} is declared along {first + len(along)} axes, not {np.shape(self.items[path].array)}"
            )
        axes = []
        for number, axis in enumerate(along, first):
            if isinstance(axis, Counter):
                axes.append(self._counted(here.counters, axis, self.items[path].array.shape[number]))
                continue
            found = _nearest_axis(self.items, path, axis)
            if found is None:
                raise KeyError(f"{path} has no axis {axis}")
            axes.append(found)
        return tuple(axes)

    def _named_axes(self, axes: Axes, path: str, result: Any) -> tuple[str | Counter, ...]:
        """The axes that a result names; an array with the name of one of them becomes that axis."""
        item, along = self.items[path], getattr(result, axes.field)
        auxiliary = getattr(result, axes.auxiliary) if axes.auxiliary else ()
        if last(path) in along:
            item.scale = True
            return ()
        if auxiliary and last(path) not in auxiliary:
            item.attributes["coordinates"] = " ".join(auxiliary)
        return (*along, axes.more) if axes.more and item.array.ndim > len(along) else tuple(along)

    def _counted(self, group: str, counter: Counter, size: int) -> str:
        """The axis of a counter, made on first use."""
        path = joined(group, counter.name)
        if path not in self.items:
            numbers = np.arange(counter.start, counter.start + size)
            item = self.item(path)
            item.array, item.scale = _array(counter.labels) if counter.labels else numbers, True
            item.attributes |= {"units": "1", "long_name": counter.meaning}
        return path


def _writing_rank(member: Member) -> int:
    """Axes before the arrays along them, attributes after the arrays that may carry them."""
    if isinstance(member.declaration, Dataset) and member.declaration.scale:
        return 0
    return 2 if isinstance(member.declaration, Attribute) else 1


def _with_keys(declared: Members, items: Sequence[Any]) -> list[tuple[Any, Any]]:
    """The members of a tuple with their keys."""
    own = key_of(declared.of)
    if declared.by:
        return [(tuple(getattr(item, name) for name in declared.by), item) for item in items]
    return [(getattr(item, own) if own else number, item) for number, item in enumerate(items, declared.start)]


def _way(declared: Members, key: Any) -> str:
    """The path of a member in its folder."""
    if declared.way is not None:
        parts = declared.way(key)
    elif isinstance(key, tuple):
        parts = tuple(map(str, key[:1] if declared.labelled else key))
    else:
        called = declared.pattern.format(key)
        parts = tuple(called.split("/")) if is_array(declared.of) else (called,)
    return "/".join(map(group_name, parts))


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


class Missing(Exception):
    """The items lack a field."""


class Reader:
    """Dataclasses from items."""

    def __init__(self, items: Items) -> None:
        self.items = items
        self._labelled: dict[str, list[tuple[int, str, str]]] = {}  # by folder index, name and path
        for path, item in items.items():
            if "index" in item.attributes:
                label = int(item.attributes["index"]), str(item.attributes["name"]), path
                self._labelled.setdefault(parent(path), []).append(label)

    def fields(self, cls: Any, path: str = "/", owners: tuple[Any, ...] = (), key: Any = None) -> dict[str, Any]:
        """The declared fields of a class, by name.

        Parameters
        ----------
        cls : the class.
        path : the group, or the array, that holds them.
        owners : objects or mappings whose fields ``{field}`` in texts may stand for, the nearest first.
        key : what the group is called by, for the field that is the `key`.

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
        fields: dict[str, Any] = {}
        here = _Here(path, (fields, *owners), path)
        for member in sorted(members_of(cls), key=lambda member: not isinstance(member.declaration, Attribute)):
            if member.derived:
                continue
            if isinstance(member.declaration, Key):
                fields[member.name] = _of_type(key, member)
                continue
            try:
                fields[member.name] = self._member(member, here, key)
            except Missing as missing:
                if member.default is None:
                    raise KeyError(str(missing)) from None
                fields[member.name] = member.default()
        return fields

    def _member(self, member: Member, here: _Here, key: Any) -> Any:
        match member.declaration:
            case Dataset(per=None) as declared:
                return self._array(member, declared, joined(here.path, filled(member.stored_name, here.owners)))
            case Dataset() as declared:
                return self._per_name(member, declared, here)
            case Attribute() as declared:
                item, name = self.items.get(joined(here.path, declared.at)), member.stored_name
                if item is None or name not in item.attributes:
                    raise Missing(f"{joined(here.path, name)} is missing")
                if declared.codec is not None:
                    return _decoded(declared.codec.read(name, item.attributes), member)
                return _of_type(item.attributes[name], member)
            case Group() as declared:
                path = joined(here.path, declared.path)
                if path not in self.items:
                    raise Missing(f"{path} is missing")
                return made_of(declared.of, self.fields(declared.of, path, here.owners, key))
            case Members() as declared:
                return self._members(member, declared, here)
            case Table() as declared:
                return self._table(declared, joined(here.path, declared.path))
        raise TypeError(f"{member.name} is not stored")

    def _per_name(self, member: Member, declared: Dataset, here: _Here) -> dict[str, Any]:
        values: dict[str, Any] = {}
        name = member.stored_name
        for _, key, home in sorted(self._labelled.get(joined(here.path, declared.per or ""), ())):
            if member.scalar is not None:
                values[key] = _of_type(self.items[home].attributes[name], member)
            elif joined(home, name) in self.items or joined(home, f"{name}_real") in self.items:
                values[key] = self._array(member, declared, joined(home, name))
        return values

    def _members(self, member: Member, declared: Members, here: _Here) -> Any:
        listed = self.items[here.path].attributes.get(member.name)
        if listed is None:
            raise Missing(f"{joined(here.path, member.name)} is missing")
        keys, members = JSON.read("", {"": listed}), {}
        if not isinstance(keys, tuple):
            raise ValueError(f"{joined(here.path, member.name)} is no list")
        stored = {each.name for each in members_of(declared.of)}
        for key in keys:
            path = joined(joined(here.path, declared.folder), _way(declared, key))
            if path not in self.items:
                raise KeyError(f"{path} is missing")
            known = dict(zip(declared.by, key, strict=True)) if declared.by else {}
            given = {name: value for name, value in known.items() if name not in stored}
            own = known.get(key_of(declared.of), key)
            fields = self.fields(declared.of, path, (given, *here.owners), own)
            members[key] = made_of(declared.of, {**given, **fields})
        return members if member.type.startswith("dict") else tuple(members.values())

    def _table(self, declared: Table, home: str) -> tuple[Any, ...]:
        if home not in self.items:
            if declared.empty:
                raise Missing(f"{home} is missing")
            return ()
        columns = {}
        for column in members_of(declared.of):
            item = self.items.get(joined(home, column.stored_name))
            if column.derived or (item is None and column.default is not None):
                continue
            if item is None or np.ndim(item.array) == 0:
                raise KeyError(f"{joined(home, column.stored_name)} is missing")
            columns[column.name] = [_of_type(value, column) for value in item.values]
        return tuple(declared.of(**dict(zip(columns, row, strict=True))) for row in zip(*columns.values(), strict=True))

    def _array(self, member: Member, declared: Dataset, path: str) -> Any:
        if f"{path}_real" in self.items:
            parts = (self._numbers(f"{path}{part}", member, declared) for part in ("_real", "_imag"))
            return _when_used(_of_parts, *parts)
        item = self.items.get(path)
        if item is None:
            raise Missing(f"{path} is missing")
        if item.array is not None and item.array.dtype == object and member.may_be_text:
            words = [str(word) for word in np.ravel(item.values)]
            return tuple(words) if member.type.startswith("tuple") else np.array(words).reshape(item.array.shape)
        array = self._numbers(path, member, declared)
        if declared.phase:
            return _when_used(_of_amplitude, array, self._numbers(f"{path}_phase_deg", member, declared))
        return _when_used(np.asarray, array) if array.ndim else _of_type(array[()], member)

    def _numbers(self, path: str, member: Member, declared: Dataset) -> Any:
        """An array, read or not, if it has numbers along as many axes as declared, and of their lengths."""
        item = self.items.get(path)
        if item is None or item.array is None:
            raise ValueError(f"{path} is a group")
        if item.array.dtype == object:
            raise ValueError(f"{path} holds text instead of numbers")
        if declared.scale and not item.scale:
            raise ValueError(f"{path} is no dimension scale")
        if isinstance(declared.along, Axes) and item.array.ndim == 0:
            raise ValueError(f"{path} is a single number, not an array")
        along = () if isinstance(declared.along, Axes) else declared.along or ()
        dimensions = 1 if declared.scale else len(along)
        if member.scalar is None and dimensions and item.array.ndim != dimensions:
            raise ValueError(f"{path} has {item.array.ndim} dimensions, not {dimensions}")
        for axis, size in zip(along, item.array.shape, strict=False):
            name = axis.name if isinstance(axis, Counter) else axis
            scale = _nearest_axis(self.items, path, name)
            if scale is None:
                raise ValueError(f"{path} has no axis {name}")
            if self.items[scale].array.shape != (size,):
                raise ValueError(f"{path} has {size} values along {scale}")
        return item.array


def _when_used(make: Callable[..., Any], *arrays: Any) -> Any:
    """What a function makes of arrays: now if all of them were read, otherwise when it is first used."""
    if all(isinstance(array, np.ndarray) for array in arrays):
        return make(*arrays)
    return Deferred(partial(make, *arrays))


def _of_parts(real: Any, imaginary: Any) -> Any:
    """Complex numbers of their parts."""
    return np.asarray(real) + 1j * np.asarray(imaginary)


def _of_amplitude(amplitude: Any, phase_deg: Any) -> Any:
    """Complex numbers of amplitude and phase."""
    return np.asarray(amplitude) * np.exp(1j * np.radians(phase_deg))


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
