"""HDF5 from declared fields (`beamsim.fields`): one writer and one reader of every result."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from contextvars import ContextVar
from pathlib import Path
from typing import Any, TypeGuard, get_args, get_origin

import h5py
import numpy as np

from beamsim.errors import ResultFileError
from beamsim.fields import (
    Along,
    Arrays,
    Attribute,
    Axes,
    Counter,
    Dataset,
    Group,
    Key,
    Member,
    Members,
    PerName,
    RowBlocks,
    Table,
    by_rows,
    filled,
    members_of,
    rows_of,
)
from beamsim.measurements.hdf5_file import scale_along
from beamsim.store.outcomes import failures_text, outcome_attributes, read_failures, read_outcome
from beamsim.store.schema import group_name, plain
from beamsim.store.small_objects import TEXT, create_dataset, set_text
from beamsim.typing import Bools, Complexes, Floats, Ints

ROWS_AT_ONCE = 2**18  # of a history that are held in memory; longer ones are written and read in parts

_unfilled: ContextVar[list[tuple[h5py.Dataset, RowBlocks]]] = ContextVar("unfilled")
_axes: ContextVar[dict[tuple[str, str], h5py.Dataset]] = ContextVar("axes")
"""Axes found so far while a result is written, by the group that they were searched for and their name."""


# --- Writing ---------------------------------------------------------------------------------------------------------


def write(group: h5py.Group, value: Any, names: Sequence[Any] = (), *, on: str = "", cls: Any = None) -> None:
    """Write the declared fields of ``value`` into ``group``.

    Parameters
    ----------
    names : dataclasses or mappings that contain the value, the innermost first; they fill ``{field}`` in texts.
    on : dataset that carries the attributes, if it is not the group.
    cls : class whose fields are written, if it is a base class of the value's.
    """
    names, cls = (value, *names), cls or type(value)
    for member in sorted(members_of(cls), key=_rank):
        field = rows_of(value, member.name)
        if field is not None:
            _write_member(group, member, field, names, on)


def write_in_parts(file: h5py.File, value: Any) -> Iterator[tuple[int, int]]:
    """Write the declared fields of a result into a file, its long histories part by part, all of them side by side.

    Yields
    ------
    Rows written so far and rows in all, after each part. All histories have the same length then.
    """
    token, axes = _unfilled.set([]), _axes.set({})
    try:
        write(file, value)
        histories = _unfilled.get()
    finally:
        _unfilled.reset(token)
        _axes.reset(axes)
    count = max((history.size for _, history in histories), default=0)
    part = max((history.block for _, history in histories), default=1)
    for first in range(0, count, part):
        last = min(first + part, count)
        values = [history[first:last] for _, history in histories]  # none is written before all are there
        for (dataset, _), item in zip(histories, values, strict=True):
            dataset.resize((last,))
            dataset[first:last] = item
        yield last, count


def is_long(value: Any) -> TypeGuard[RowBlocks]:
    """Whether an array is written in parts."""
    return isinstance(value, RowBlocks) and value.size > ROWS_AT_ONCE


def _rank(member: Member) -> int:
    """Order of writing: axes before the datasets along them, attributes after the datasets that may carry them."""
    declaration = member.declaration
    if isinstance(declaration, Dataset) and declaration.scale:
        return 0
    return 2 if isinstance(declaration, Attribute) else 1


def _write_member(group: h5py.Group, member: Member, value: Any, names: Sequence[Any], on: str) -> None:
    match member.declaration:
        case Dataset() as declared:
            _write_array(group, group, member.stored_name, declared, value, names)
        case Attribute() as declared:
            at = declared.at or on
            owner = group.get(at) if at else group
            if owner is not None:
                owner.attrs.update(_attributes(member, declared, value))
        case PerName(folder=folder, values=declared):
            for index, (name, item) in enumerate(value.items()):
                home = _labelled(group, folder, name, index, names)
                if np.ndim(item):
                    _write_array(group, home, declared.name or member.name, declared, item, names)
                else:
                    home.attrs[declared.name or member.name] = item
        case Group() as declared:
            write(group.require_group(declared.path) if declared.path else group, value, names, on=declared.on)
        case Members() as declared:
            _write_members(group, declared, value, names)
        case Arrays() as declared:
            _write_arrays(group, declared, value, names)
        case Table() as declared:
            _write_table(group, declared, value, member, names)


def _write_members(group: h5py.Group, declared: Members, value: Any, names: Sequence[Any]) -> None:
    for index, (key, item) in enumerate(_items(value)):
        if declared.labelled:
            home = _labelled(group, declared.folder, key, index, names)
        else:
            link = declared.pattern.format(key if key is not None else declared.start + index)
            parts = declared.parts(item) if declared.parts else (link,)
            home = group.require_group("/".join([*filter(None, [declared.folder]), *map(group_name, parts)]))
            if declared.indexed:
                home.attrs["index"] = index
        write(home, item, names)


def _write_arrays(group: h5py.Group, declared: Arrays, value: Any, names: Sequence[Any]) -> None:
    items = _items(value)
    home = group.require_group(declared.folder) if items else group
    for called, item in items:
        write(home, item, ({"link": _link(called)}, *names), on=_link(called))
    if declared.listed and items:
        home.attrs[declared.listed] = json.dumps([called for called, _ in items], ensure_ascii=False)


def _link(name: str) -> str:
    """Path of an array in its folder; slashes in its name separate groups."""
    *parents, last = name.split("/")
    return "/".join([*map(group_name, parents), last])


def _items(value: Any) -> list[tuple[Any, Any]]:
    """Pairs of key and member."""
    return list(value.items()) if isinstance(value, Mapping) else [(_key(item), item) for item in value]


def _key(item: Any) -> Any:
    """Key of a member of a tuple; None if members are numbered."""
    name = _key_field(type(item))
    return getattr(item, name) if name else None


def _key_field(cls: type) -> str:
    return next((m.name for m in members_of(cls) if isinstance(m.declaration, Key)), "")


def _labelled(group: h5py.Group, folder: str, name: str, index: int, names: Sequence[Any]) -> h5py.Group:
    """The group ``<folder>/<name>`` with its attributes, among them the body if there are several."""
    path = f"{folder}/{group_name(name)}" if folder else group_name(name)
    if path in group:
        return group[path]
    home = group.create_group(path)
    home.attrs.update({"name": name, "index": index})
    scenario = getattr(names[-1], "scenario", None)
    body = scenario.bodies_of_places.get(folder, {}).get(name) if scenario else None
    if body:
        home.attrs["body"] = body
    return home


def _write_table(group: h5py.Group, declared: Table, rows: Sequence[Any], member: Member, names: Sequence[Any]) -> None:
    if not rows and not declared.empty:
        return
    home = group.require_group(declared.path) if declared.path else group
    size = len(rows)
    scale = None if declared.rows is None else _counted(home, declared.rows, size)
    for column in sorted(members_of(_item_of(member.annotation)), key=_rank):
        values = [getattr(row, column.name) for row in rows]
        if column.optional and all(value is None for value in values):
            continue
        cells = _column(values, column)
        dataset = _put(home, column.stored_name, column.declaration, cells, names)
        if column.declaration.scale:
            scale = dataset
            continue
        dataset.dims[0].attach_scale(scale)
        _attach(home, dataset, column.declaration.along, names, first=1)


def _column(values: list[Any], column: Member) -> Any:
    if column.annotation is str:
        return np.array(values, dtype=TEXT)
    if get_origin(column.annotation) is tuple:
        return np.array(values, dtype=float).reshape(len(values), -1)
    return np.array(values, dtype=column.annotation if column.annotation in (int, float, bool) else float)


def _write_array(
    group: h5py.Group, home: h5py.Group, name: str, declared: Dataset, value: Any, names: Sequence[Any]
) -> None:
    """Write one dataset into ``home``, or the two of a complex number; counted axes are in ``group``."""
    unit, meaning = declared.unit, declared.meaning
    if declared.phase:
        parts = [(name, np.abs(value), unit, meaning)]
        parts.append((f"{name}_phase_deg", np.degrees(np.angle(value)), "degree", declared.phase))
    elif not isinstance(value, RowBlocks) and np.iscomplexobj(value):
        real, imaginary = (meaning, declared.imaginary) if declared.imaginary else (
            f"{meaning}, real part", f"{meaning}, imaginary part"
        )  # fmt: skip
        parts = [(f"{name}_real", value.real, unit, real), (f"{name}_imag", value.imag, unit, imaginary)]
    else:
        parts = [(name, value, unit, meaning)]
    for link, values, units, long_name in parts:
        dataset = _put(home, link, declared, values, names, units, long_name)
        if not declared.scale:
            _attach(group, dataset, declared.along, names)


def _put(
    group: h5py.Group, name: str, declared: Dataset, value: Any, names: Sequence[Any], unit: str = "", meaning: str = ""
) -> h5py.Dataset:
    if is_long(value):
        dataset = group.create_dataset(
            filled(name, names), (0,), np.uint8 if declared.flags else value.dtype, maxshape=(value.size,),
            chunks=(value.block,),
        )  # fmt: skip
        _unfilled.get().append((dataset, value))
        return _described(dataset, declared, names, unit, meaning)
    values = np.asarray(value.value if isinstance(value, RowBlocks) else value)
    if values.dtype.kind == "U" or (isinstance(value, tuple) and not value):
        values = np.array(value, dtype=TEXT)
    if declared.flags is not None:
        values = values.astype(np.uint8)
    return _described(create_dataset(group, filled(name, names), values), declared, names, unit, meaning)


def _described(dataset: h5py.Dataset, declared: Dataset, names: Sequence[Any], unit: str, meaning: str) -> h5py.Dataset:
    """The dataset with its attributes."""
    set_text(dataset, "units", filled(unit or declared.unit, names))
    set_text(dataset, "long_name", filled(meaning or declared.meaning, names))
    if declared.flags is not None:
        dataset.attrs["flag_values"] = np.array([0, 1], dtype=np.uint8)
        dataset.attrs["flag_meanings"] = " ".join(declared.flags)
    if declared.scale:
        _make_scale(dataset, dataset.name.rpartition("/")[2])
    return dataset


def _make_scale(dataset: h5py.Dataset, name: str) -> None:
    """Make a dataset an axis; it may be nearer than those found before."""
    dataset.make_scale(name)
    known = _axes.get({})
    for place in [place for place in known if place[1] == name]:
        del known[place]


def _attach(group: h5py.Group, dataset: h5py.Dataset, along: Along, names: Sequence[Any], first: int = 0) -> None:
    if isinstance(along, Axes):
        along = _named_axes(dataset, along, names)
    for number, item in enumerate(along, first):
        scale = _counted(group, item, dataset.shape[number]) if isinstance(item, Counter) else _axis(dataset, item)
        h5py.h5ds.attach_scale(dataset.id, scale.id, number)


def _named_axes(dataset: h5py.Dataset, axes: Axes, names: Sequence[Any]) -> tuple[str | Counter, ...]:
    """The axes of a dataset; a dataset with the name of one of them becomes that axis."""
    link = dataset.name.rpartition("/")[2]
    along: tuple[str, ...] = getattr(names[-1], axes.field)
    auxiliary: tuple[str, ...] = getattr(names[-1], axes.auxiliary) if axes.auxiliary else ()
    if link in along:
        _make_scale(dataset, link)
        return ()
    if auxiliary and link not in auxiliary:
        dataset.attrs["coordinates"] = " ".join(auxiliary)
    return (*along, axes.more) if axes.more and dataset.ndim > len(along) else along


def _counted(group: h5py.Group, counter: Counter, size: int) -> h5py.Dataset:
    """The axis of a counter in ``group``, created on first use."""
    known, place = _axes.get({}), (group.name, counter.name)
    if place not in known:
        known[place] = group[counter.name] if counter.name in group else _count(group, counter, size)
    return known[place]


def _count(group: h5py.Group, counter: Counter, size: int) -> h5py.Dataset:
    """A new axis of a counter."""
    labels = np.arange(counter.start, counter.start + size) if not counter.labels else counter.labels
    text = bool(counter.labels) and isinstance(counter.labels[0], str)
    dataset = create_dataset(group, counter.name, np.array(labels, dtype=TEXT if text else None))
    set_text(dataset, "units", "1")
    set_text(dataset, "long_name", counter.meaning)
    _make_scale(dataset, counter.name)
    return dataset


def _axis(dataset: h5py.Dataset, name: str) -> h5py.Dataset:
    """The axis of this name in the group of the dataset, or in the nearest group around it that has one."""
    known, place = _axes.get({}), (dataset.name.rpartition("/")[0], name)
    if place not in known:
        known[place] = _nearest_axis(dataset, name)
    return known[place]


def _nearest_axis(dataset: h5py.Dataset, name: str) -> h5py.Dataset:
    group = dataset.parent
    while name not in group or not isinstance(group[name], h5py.Dataset) or not group[name].is_scale:
        if group.name == "/":
            raise KeyError(f"{dataset.name} has no axis {name}")
        group = group.parent
    return group[name]


def _attributes(member: Member, declared: Attribute, value: Any) -> dict[str, Any]:
    if declared.codec == "outcome":
        return outcome_attributes(value)
    if declared.codec == "json":
        value = json.dumps(plain(value), ensure_ascii=False)
    elif declared.codec == "failures":
        value = failures_text(value)
    elif declared.codec == "scenario":
        value = value.to_yaml()
    elif isinstance(value, tuple) and value and not isinstance(value[0], str):
        value = np.array(value)
    return {member.stored_name: value}


# --- Reading ---------------------------------------------------------------------------------------------------------


def read(cls: type, group: h5py.Group, names: Sequence[Any] = (), *, key: Any = None, on: str = "") -> dict[str, Any]:
    """The declared fields of a ``cls`` read from ``group``, by name; ``names`` as in `write`.

    Raises
    ------
    KeyError
        If a field without a default is missing.
    """
    fields: dict[str, Any] = {}
    for member in sorted(members_of(cls), key=_reading_rank):
        if member.derived:
            continue
        if isinstance(member.declaration, Key):
            fields[member.name] = _converted(key, member.annotation)
            continue
        try:
            fields[member.name] = _read_member(group, member, (fields, *names), key, on)
        except _MissingError as missing:
            if member.optional:
                fields[member.name] = None
            elif member.default is not None:
                fields[member.name] = member.default()
            else:
                raise KeyError(str(missing)) from None
    return fields


class _MissingError(Exception):
    """The file lacks a field."""


def _reading_rank(member: Member) -> int:
    return 0 if isinstance(member.declaration, Attribute) else 1


def _read_member(group: h5py.Group, member: Member, names: Sequence[Any], key: Any, on: str) -> Any:
    match member.declaration:
        case Dataset() as declared:
            return _read_array(group, member, declared, names)
        case Attribute() as declared:
            at = declared.at or on
            owner = group.get(at) if at else group
            if owner is None or member.stored_name not in owner.attrs:
                raise _MissingError(f"{group.name}: no {member.stored_name}")
            if declared.codec == "outcome":
                return read_outcome(owner.attrs)
            return _decoded(owner.attrs[member.stored_name], member, declared)
        case PerName() as declared:
            return _read_per_name(group, member, declared, names)
        case Group() as declared:
            if (declared.path and declared.path not in group) or (declared.on and declared.on not in group):
                raise _MissingError(f"{group.name}: no {declared.path or declared.on}")
            home, around = group[declared.path] if declared.path else group, (declared.given, *names)
            return member.annotation(**declared.given, **read(member.annotation, home, around, key=key, on=declared.on))
        case Members() as declared:
            return _read_members(group, member, declared, names)
        case Arrays() as declared:
            return _read_arrays(group, member, declared, names)
        case Table() as declared:
            return _read_table(group, member, declared)
    raise TypeError(f"{member.name} is not stored")


def _read_per_name(group: h5py.Group, member: Member, declared: PerName, names: Sequence[Any]) -> dict[str, Any]:
    values: dict[str, Any] = {}
    item = member._replace(declaration=declared.values, annotation=_item_of(member.annotation))
    for place in ordered(group, declared.folder):
        if item.annotation in (int, float, bool, str):
            values[_true_name(place)] = _converted(place.attrs[item.stored_name], item.annotation)
        else:
            try:
                values[_true_name(place)] = _read_array(place, item, declared.values, names)
            except _MissingError:
                continue  # not all places have it
    return values


def _read_members(group: h5py.Group, member: Member, declared: Members, names: Sequence[Any]) -> Any:
    cls = _item_of(member.annotation)
    folder = group.get(declared.folder) if declared.folder else group
    members = []
    for link, home in _candidates(folder, declared) if folder is not None else ():
        called = _true_name(home) if declared.labelled else link
        members.append((called, cls(**declared.given, **read(cls, home, (declared.given, *names), key=called))))
    if not members and declared.required and not (declared.unless and declared.unless in group):
        raise KeyError(f"{group.name}{declared.folder} is missing")
    if declared.order is not None:
        members.sort(key=lambda entry: declared.order(names[0], entry[1]))  # type: ignore[misc]
    if get_origin(member.annotation) is tuple:
        return tuple(item for _, item in members)
    kind = get_args(member.annotation)[0]
    keys = [declared.key(item) if declared.key else _converted(called, kind) for called, item in members]
    return dict(zip(keys, (item for _, item in members), strict=True))


def _read_arrays(group: h5py.Group, member: Member, declared: Arrays, names: Sequence[Any]) -> Any:
    cls, home = _item_of(member.annotation), group.get(declared.folder)
    called: list[str] = []
    if home is not None:
        listed = declared.listed
        called = json.loads(home.attrs.get(listed, "[]")) if listed else [_true_name(item) for item in home.values()]
    links = {name: _link(name) for name in called}
    items = [cls(**read(cls, home, ({"link": link}, *names), key=name, on=link)) for name, link in links.items()]
    return tuple(items) if get_origin(member.annotation) is tuple else dict(zip(links, items, strict=True))


def _candidates(folder: h5py.Group, declared: Members) -> Iterator[tuple[str, h5py.Group]]:
    """Groups of the members with their keys by the pattern, in order."""
    pattern = re.compile(re.escape(declared.pattern).replace(r"\{\}", "(.+)"))
    groups = _groups_below(folder) if declared.parts else (g for g in folder.values() if isinstance(g, h5py.Group))
    matching = []
    for home in groups:
        link = home.name.rpartition("/")[2]
        match = pattern.fullmatch(link)
        if match and (not declared.having or declared.having in home.attrs or declared.having in home):
            matching.append((match[1], home))
    if declared.labelled or declared.indexed:
        return iter(sorted(matching, key=lambda entry: _index(entry[1])))
    return iter(sorted(matching, key=lambda entry: (int(entry[0]), "") if entry[0].isdigit() else (-1, entry[0])))


def _groups_below(group: h5py.Group) -> Iterator[h5py.Group]:
    for item in group.values():
        if isinstance(item, h5py.Group):
            yield item
            yield from _groups_below(item)


def ordered(group: h5py.Group, folder: str) -> list[h5py.Group]:
    """The groups of a folder in the order of their indices."""
    home = group.get(folder, {}) if folder else group
    return sorted((item for item in home.values() if isinstance(item, h5py.Group)), key=_index)


def _index(group: h5py.Group) -> int:
    """Index of a group in its folder; without one, the smallest index of the groups in it."""
    if "index" in group.attrs:
        return int(group.attrs["index"])
    return min((_index(item) for item in group.values() if isinstance(item, h5py.Group)), default=0)


def _true_name(group: h5py.Group | h5py.Dataset) -> str:
    """Name of a group or dataset; its link may be spelt differently."""
    if "name" in group.attrs:
        return str(group.attrs["name"])
    inner = [item for item in group.values() if isinstance(item, h5py.Group) and "name" in item.attrs]
    return str(inner[0].attrs["name"]) if inner else str(group.name.rpartition("/")[2])


def _read_table(group: h5py.Group, member: Member, declared: Table) -> tuple[Any, ...]:
    cls = _item_of(member.annotation)
    if declared.path and declared.path not in group:
        if declared.empty:
            raise _MissingError(f"{group.name}: no {declared.path}")
        return ()
    home = group[declared.path] if declared.path else group
    columns = {}
    for column in members_of(cls):
        if not column.derived:
            dataset = home.get(column.stored_name)
            if dataset is None and column.default is not None:
                continue  # not in files written before the field was added
            if dataset is None:
                raise KeyError(f"{home.name}/{column.stored_name} is missing")
            values = _words(dataset) if _is_text(dataset) else dataset[()].tolist()
            columns[column.name] = [_converted(value, column.annotation) for value in values]
    return tuple(cls(**dict(zip(columns, row, strict=True))) for row in zip(*columns.values(), strict=True))


def _read_array(group: h5py.Group, member: Member, declared: Dataset, names: Sequence[Any]) -> Any:
    name = filled(member.stored_name, names)
    if f"{name}_real" in group:
        return np.asarray(group[f"{name}_real"][()] + 1j * group[f"{name}_imag"][()])
    if name not in group:
        raise _MissingError(f"{group.name}: no {name}")
    dataset = _expected(group[name], member, declared)
    if declared.phase:
        return np.asarray(dataset[()] * np.exp(1j * np.radians(group[f"{name}_phase_deg"][()])))
    if _is_text(dataset):
        words = _words(dataset)
        return np.array(words) if get_origin(member.annotation) is np.ndarray else tuple(words)
    if dataset.ndim == 1 and dataset.size > ROWS_AT_ONCE and get_origin(member.annotation) is np.ndarray:
        return _stored_rows(dataset, bool if declared.flags is not None else float)
    values = dataset[()]
    if np.ndim(values) == 0 or get_origin(member.annotation) is tuple:
        return _converted(values, member.annotation)
    return values.astype(bool) if declared.flags is not None else values


def _stored_rows(dataset: h5py.Dataset, dtype: type) -> Any:
    """A long history, read when it is used and where it is used.

    The file is opened for each part, so that nobody has to close it.
    """
    path, name = Path(dataset.file.filename), dataset.name
    known = _identity(path)

    def rows(first: int, last: int) -> Any:
        if not path.exists() or _identity(path) != known:
            raise ResultFileError(f"{path}: changed since it was opened; open it again")
        with h5py.File(path, "r") as file:
            return file[name][first:last].astype(dtype, copy=False)

    return by_rows(dataset.size, rows, dtype=dtype, block=ROWS_AT_ONCE)


def _identity(path: Path) -> tuple[int, int, int]:
    """What changes when another file takes the place of this one."""
    state = path.stat()
    return state.st_ino, state.st_mtime_ns, state.st_size


def _expected(dataset: Any, member: Member, declared: Dataset) -> h5py.Dataset:
    """The dataset, if it is of the declared kind: text or numbers, and with as many dimensions as axes.

    Raises
    ------
    TypeError, ValueError
        If it is not.
    """
    if not isinstance(dataset, h5py.Dataset):
        raise TypeError(f"{dataset.name} is a group")
    if not _is_text(dataset) and not np.issubdtype(dataset.dtype, np.number) and dataset.dtype != np.bool_:
        raise TypeError(f"{dataset.name} holds {dataset.dtype}, neither numbers nor text")
    if member.annotation in (Floats, Complexes, Ints, Bools) and _is_text(dataset):
        raise TypeError(f"{dataset.name} holds text instead of numbers")
    along = () if isinstance(declared.along, Axes) else declared.along
    if along and get_origin(member.annotation) is np.ndarray and not _is_text(dataset) and dataset.ndim < len(along):
        raise ValueError(f"{dataset.name} has {dataset.ndim} dimensions, not {len(along)}")
    for k in range(dataset.ndim):
        scale = scale_along(dataset, k)
        if scale is not None and scale.shape != dataset.shape[k : k + 1]:
            raise ValueError(f"{dataset.name} has {dataset.shape[k]} values along {scale.name}")
    return dataset


def _decoded(value: Any, member: Member, declared: Attribute) -> Any:
    if declared.codec == "json":
        return _converted(json.loads(value), member.annotation, declared.null)
    if declared.codec == "scenario":
        from beamsim.scenario import load_scenario

        return load_scenario(str(value))
    if declared.codec == "failures":
        return read_failures(value)
    return _converted(value, member.annotation)


def _converted(value: Any, annotation: Any, null: Any = math.nan) -> Any:
    """A value from a file, converted to the annotated type."""
    origin, inner = get_origin(annotation), get_args(annotation)
    if origin is tuple:
        kinds = [inner[0]] * len(value) if inner[-1] is Ellipsis else inner
        return tuple(_converted(item, kind, null) for item, kind in zip(value, kinds, strict=True))
    if isinstance(value, Mapping):
        return {key: _converted(item, inner[1], null) for key, item in value.items()}
    if value is None:
        return null
    if annotation in (str, int, float, bool):
        return annotation(value)
    return value.item() if isinstance(value, np.generic) else value


def _is_text(dataset: h5py.Dataset) -> bool:
    return h5py.check_string_dtype(dataset.dtype) is not None


def _words(dataset: h5py.Dataset) -> list[str]:
    return [str(text) for text in dataset.asstr()[()]]


def _item_of(annotation: Any) -> Any:
    """Class of the members of a tuple or a dict."""
    arguments = get_args(annotation)
    return arguments[1] if get_origin(annotation) is dict else arguments[0]
