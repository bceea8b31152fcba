"""Where each declared field of a result is stored: a variable of a dataset, and its dimensions.

It follows from the declarations (`beamsim.fields`) alone: names of datasets, variables and dimensions are fixed, and
names that users gave are values of coordinates. A result file has datasets in groups below the root, none in another.

Members (probes, branches, signals) are stacked along a dimension. What they have along an axis that differs from one to
the other, such as the points of branches, is put end to end along one dimension, as a contiguous ragged array of the CF
conventions: a column says whose each row is, and ``<axis>_count`` how many rows each member has.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from beamsim.fields import (
    ArrayField,
    Attribute,
    Counter,
    Group,
    Member,
    Members,
    Table,
    members_of,
)

ROWS = "sample"  # dimension of rows along an axis that has no name for them


class Axis(NamedTuple):
    """An axis, and what has it."""

    name: str
    place: StoragePlace  # of the dataclass that has it
    path: str  # of its values; with ``_count`` of the number of rows of each member, with ``_known`` of which it has
    dim: str  # dimension of what is along it: its name where all members have the same
    counter: Counter | None  # None of one with values
    table: str = ""  # dataset of what is along it where it differs from member to member; empty otherwise


@dataclass(frozen=True)
class StoragePlace:
    """Where a dataclass is stored."""

    dataset: str
    attributes: str  # path of the group whose attributes belong to it
    prefix: str = ""
    suffix: str = ""  # of the names of variables, after that
    split: str = ""  # the part of the members' keys that is this end
    dims: tuple[str, ...] = ()  # of the members that it is one of, outermost first
    rows: str = ""  # dataset of what is along its own axes that differ from member to member
    stem: str = ""  # with which the names of datasets in it begin
    axes: Mapping[str, Axis] = field(default_factory=dict)  # that its fields may be along; "" counts rows of a table


class Spot(NamedTuple):
    """A variable and its dimensions."""

    path: str
    dataset: str
    kept: tuple[str, ...]  # dimensions of members
    axes: tuple[Axis, ...]  # dimensions after them
    ragged: int | None = None  # which of the axes has the rows of several members, end to end
    whose: Axis | None = None  # that axis
    scale: bool = False  # whether it is the coordinate of its axis


def root_place(cls: Any) -> StoragePlace:
    """The place of the class of a result."""
    place = StoragePlace(cls.DATASET, "/")
    return replace(place, axes=_own_axes(cls, place))


def place_in(place: StoragePlace, name: str, declared: ArrayField | Group | Members | Table) -> StoragePlace:
    """The place of what a field holds: a dataclass, members, the rows of a table, or the values of a mapping by name.

    Parameters
    ----------
    place : of the dataclass that has the field.
    name : of the field.
    declared : the declaration of the field.

    Returns
    -------
    StoragePlace
        With the axes that its fields have or count, which those in it may be along.
    """
    if isinstance(declared, ArrayField):
        return replace(place, dims=(*place.dims, declared.per or ""))
    below = place
    if path := declared.path:  # below the root with a slash
        dataset = f"{place.stem}_{path}" if place.stem and path[0] != "/" else path.lstrip("/")
        below = StoragePlace(dataset, f"/{dataset}", dims=place.dims, stem=dataset, axes=place.axes)
    if isinstance(declared, Table):
        columns = members_of(declared.of)
        if declared.rows is None:
            column = next(each.stored_name for each in columns if each.declaration.scale)
            rows = Axis(column, below, f"/{below.dataset}/{below.prefix}{column}", column, None)
        else:
            called = name if place.dims else declared.rows.name
            path = f"/{place.dataset}/{place.prefix}{called}"
            table = below.dataset if place.dims else ""
            rows = Axis(called, place, path, declared.rows.name, declared.rows, table)
        counters = [each for column in columns for each in along(column.declaration) if isinstance(each, Counter)]
        outside = replace(below, dims=())
        own = {c.name: Axis(c.name, outside, f"/{below.dataset}/{below.prefix}{c.name}", c.name, c) for c in counters}
        return replace(below, axes={**place.axes, "": rows, **own})
    if isinstance(declared, Members):
        dims = (*place.dims, declared.dim)
        below = replace(below, dims=dims, rows=declared.rows, split=declared.split, attributes=f"/{below.dataset}")
    if declared.prefix:
        below = replace(below, prefix=below.prefix + declared.prefix, attributes=f"/{below.dataset}")
    return replace(below, axes={**place.axes, **_own_axes(declared.of, below)})


def _own_axes(cls: Any, place: StoragePlace) -> dict[str, Axis]:
    """The axes that the fields of a class have or count."""
    axes: dict[str, Axis] = {}

    def add(name: str, rows: str, shared: bool, counter: Counter | None = None) -> None:
        path = f"/{place.dataset}/{place.prefix}{name}"
        if not place.dims or shared:
            axes[name] = Axis(name, place, path, name, counter)
        else:
            table = place.rows or f"{place.dataset}_{place.prefix}{name.removesuffix('_hz')}"
            axes[name] = Axis(name, place, path, rows or ROWS, counter, table)

    for member in members_of(cls):
        match member.declaration:
            case ArrayField(scale=True) as declared:
                add(member.stored_name, declared.rows, declared.shared)
            case ArrayField() as declared:
                follows_rows = False  # an axis after rows that differ from member to member is the same in all
                for each in along(declared):
                    name = each.name if isinstance(each, Counter) else each
                    if isinstance(each, Counter) and name not in place.axes and name not in axes:
                        add(name, name, each.shared or follows_rows, each)
                    known = axes.get(name) or place.axes.get(name)
                    follows_rows |= known is not None and known.table != ""
            case Group(path="") as declared:
                axes |= _own_axes(declared.of, replace(place, prefix=place.prefix + declared.prefix))
            case Table(path="", rows=None) as declared:
                for column in members_of(declared.of):
                    if column.declaration.scale:
                        add(column.stored_name, "", shared=True)
    return axes


def along(declared: ArrayField) -> tuple[str | Counter, ...]:
    """The axes of an array."""
    return declared.along or ()


def spot(member: Member, place: StoragePlace, suffix: str = "") -> Spot:
    """Where an array, number or text of a class, or a column of a table, is.

    Parameters
    ----------
    member : declared as a `ArrayField` or an `Attribute`.
    place : of its class, with its axes; with one more dimension where it is a mapping by name.
    suffix : of the name of the variable.

    Returns
    -------
    Spot
    """
    declared, name = member.declaration, f"{place.prefix}{member.stored_name}{place.suffix}{suffix}"
    if isinstance(declared, Attribute):
        return Spot(f"/{place.dataset}/{name}", place.dataset, place.dims, ())
    rows = [place.axes[""]] if "" in place.axes else []
    if declared.scale:
        axes = rows or [place.axes[member.stored_name]]
    else:
        axes = rows + [place.axes[each.name if isinstance(each, Counter) else each] for each in along(declared)]
    for k, axis in enumerate(axes):
        if axis.table:
            kept = place.dims[len(axis.place.dims) :]
            return Spot(f"/{axis.table}/{name}", axis.table, kept, tuple(axes), k, axis)
    if declared.scale:
        return Spot(f"/{place.dataset}/{axes[0].name}", place.dataset, (), tuple(axes), scale=True)
    return Spot(f"/{place.dataset}/{name}", place.dataset, place.dims, tuple(axes))


def places_in(cls: Any, place: StoragePlace) -> Iterator[tuple[Any, StoragePlace]]:
    """A class with its place, and those of the dataclasses in it."""
    yield cls, place
    for member in members_of(cls):
        if isinstance(member.declaration, (Group, Members)):
            yield from places_in(member.declaration.of, place_in(place, member.name, member.declaration))
