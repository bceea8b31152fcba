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

from beamsim.fields import ArrayField, Counter, Folded, Group, Member, Members, Table, members_of

ROWS = "sample"  # dimension of rows along an axis that has no name for them


class Axis(NamedTuple):
    """An axis, and what has it."""

    name: str
    place: StoragePlace  # of the dataclass that has it
    dim: str  # dimension of what is along it: its name where all members have the same
    counter: Counter | None  # None of one with values
    table: str = ""  # dataset of what is along it where it differs from member to member; empty otherwise

    @property
    def counts(self) -> str:
        """Path of the variable with the number of rows of each member."""
        return f"/{self.place.dataset}/{self.place.prefix}{self.name}_count"

    @property
    def known(self) -> str:
        """Path of the variable that says which of its values each member has, where they differ."""
        return f"/{self.place.dataset}/{self.place.prefix}{self.name}_known"


@dataclass(frozen=True)
class StoragePlace:
    """Where a dataclass is stored."""

    dataset: str
    prefix: str = ""
    suffix: str = ""  # of the names of variables, after that
    split: str = ""  # the part of the members' keys that is this end
    dims: tuple[str, ...] = ()  # of the members that it is one of, outermost first
    rows: str = ""  # dataset of what is along its own axes that differ from member to member
    stem: str = ""  # with which the names of datasets in it begin
    axes: Mapping[str, Axis] = field(default_factory=dict)

    @property
    def attributes(self) -> str:
        """Path of the group whose attributes belong to it."""
        return f"/{self.dataset}" if self.stem or self.dims or self.prefix else "/"

    def below(self, path: str) -> StoragePlace:
        """The place of a dataset in this one, or below the root with a slash; this place where the path is empty."""
        if not path:
            return self
        name = f"{self.stem}_{path}" if self.stem and path[0] != "/" else path.lstrip("/")
        return replace(self, dataset=name, stem=name, prefix="", suffix="", split="", rows="")


class Spot(NamedTuple):
    """A variable and its dimensions."""

    dataset: str
    name: str
    kept: tuple[str, ...]  # dimensions of members
    axes: tuple[Axis, ...]  # dimensions after them
    ragged: int | None = None  # which of the axes has the rows of the members that are not kept
    scale: bool = False  # whether it is the coordinate of its axis

    @property
    def path(self) -> str:
        """Of the variable."""
        return f"/{self.dataset}/{self.name}"

    @property
    def whose(self) -> Axis | None:
        """The axis whose rows are those of several members, end to end."""
        return None if self.ragged is None else self.axes[self.ragged]


def root_place(cls: Any) -> StoragePlace:
    """The place of the class of a result."""
    return inside(cls, StoragePlace(cls.DATASET))


def inside(cls: Any, place: StoragePlace) -> StoragePlace:
    """The place of a class with the axes that its fields have or count, which those in it may be along."""
    return replace(place, axes={**place.axes, **_own_axes(cls, place)})


def _own_axes(cls: Any, place: StoragePlace) -> dict[str, Axis]:
    axes: dict[str, Axis] = {}
    for member in members_of(cls):
        match member.declaration:
            case ArrayField(scale=True) as declared:
                axes[member.stored_name] = _axis(member.stored_name, place, declared.rows, declared.shared)
            case ArrayField() as declared:
                for counter in counters(declared):
                    if counter.name not in place.axes and counter.name not in axes:
                        shared = counter.shared or _follows_rows(counter, declared, {**place.axes, **axes})
                        axes[counter.name] = _axis(counter.name, place, counter.name, shared, counter)
            case Group(path="") as declared:
                axes |= _own_axes(declared.of, replace(place, prefix=place.prefix + declared.prefix))
            case Table(path="", rows=None) as declared:
                columns = (each for each in members_of(declared.of) if each.declaration.scale)
                axes |= {each.stored_name: _axis(each.stored_name, place, "", True) for each in columns}
    return axes


def _follows_rows(counter: Counter, declared: ArrayField, axes: Mapping[str, Axis]) -> bool:
    """Whether an array has rows that differ from member to member before an axis: the axis is then the same in all."""
    along = declared.along if isinstance(declared.along, tuple) and not isinstance(declared.along, Folded) else ()
    before = (
        (a.name if isinstance(a, Counter) else a for a in along[: along.index(counter)]) if counter in along else ()
    )
    return any(name in axes and axes[name].table for name in before)


def counters(declared: ArrayField) -> tuple[Counter, ...]:
    """The axes of an array that only count."""
    if isinstance(declared.along, Folded):
        return tuple(each for each in (declared.along.cases, declared.along.more) if each is not None)
    return tuple(each for each in declared.along or () if isinstance(each, Counter))


def _axis(name: str, place: StoragePlace, rows: str, shared: bool, counter: Counter | None = None) -> Axis:
    if not place.dims or shared:
        return Axis(name, place, name, counter)
    table = place.rows or f"{place.dataset}_{place.prefix}{name.removesuffix('_hz')}"
    return Axis(name, place, rows or ROWS, counter, table)


def spot(member: Member, place: StoragePlace, more: bool = False, suffix: str = "") -> Spot:
    """Where an array, number or text of a class is.

    Parameters
    ----------
    member : declared as a `ArrayField` or an `Attribute`.
    place : of its class, with its axes; with one more dimension where it is a mapping by name.
    more : whether it has the last axis that some of a design have.
    suffix : of the name of the variable.
    """
    declared, name = member.declaration, f"{place.prefix}{member.stored_name}{place.suffix}{suffix}"
    if not isinstance(declared, ArrayField):
        return Spot(place.dataset, name, place.dims, ())
    if declared.scale:
        axis = place.axes[member.stored_name]
        return _along(place, name, (axis,), scale=not axis.table)
    along: tuple[Any, ...]
    if isinstance(declared.along, Folded):
        along = (declared.along.cases, *((declared.along.more,) if more else ()))
    else:
        along = declared.along or ()
    return _along(place, name, tuple(place.axes[a.name if isinstance(a, Counter) else a] for a in along))


def _along(place: StoragePlace, name: str, axes: tuple[Axis, ...], scale: bool = False) -> Spot:
    ragged = next((k for k, axis in enumerate(axes) if axis.table), None)
    if ragged is None:
        return Spot(place.dataset, axes[0].name if scale else name, () if scale else place.dims, axes, scale=scale)
    kept = place.dims[len(axes[ragged].place.dims) :]
    return Spot(axes[ragged].table, name, kept, axes, ragged)


def group_place(place: StoragePlace, declared: Group) -> StoragePlace:
    """The place of a dataclass in another."""
    below = place.below(declared.path)
    return inside(declared.of, replace(below, prefix=below.prefix + declared.prefix))


def members_place(place: StoragePlace, declared: Members) -> StoragePlace:
    """The place of dataclasses that are stacked along a dimension."""
    below = place.below(declared.folder)
    stacked = replace(
        below,
        prefix=below.prefix + declared.prefix,
        dims=(*place.dims, declared.dim),
        rows=declared.rows,
        split=declared.split,
    )
    return inside(declared.of, stacked)


def by_name(place: StoragePlace, declared: ArrayField) -> StoragePlace:
    """The place of the values of a mapping by name."""
    return replace(place, dims=(*place.dims, declared.per or ""))


def table_place(place: StoragePlace, name: str, declared: Table) -> StoragePlace:
    """The place of the rows of a table: its columns are along the only axis that they do not declare."""
    below = place.below(declared.path)
    if declared.rows is None:
        column = next(each.stored_name for each in members_of(declared.of) if each.declaration.scale)
        return replace(
            below, axes={**place.axes, "": Axis(column, below, column, None), **_of_columns(declared, below)}
        )
    table = below.dataset if place.dims else ""
    axis = Axis(name if place.dims else declared.rows.name, place, declared.rows.name, declared.rows, table)
    return replace(below, axes={**place.axes, "": axis, **_of_columns(declared, below)})


def _of_columns(declared: Table, place: StoragePlace) -> dict[str, Axis]:
    found = (c for column in members_of(declared.of) for c in counters(column.declaration))
    return {c.name: Axis(c.name, replace(place, dims=()), c.name, c) for c in found}


def column_spot(column: Member, place: StoragePlace) -> Spot:
    """Where a column of a table is."""
    declared = column.declaration
    along = tuple(place.axes[a.name if isinstance(a, Counter) else a] for a in declared.along or ())
    return _along(place, f"{place.prefix}{column.stored_name}", (place.axes[""], *along), scale=declared.scale)


def places_in(cls: Any, place: StoragePlace) -> Iterator[tuple[Any, StoragePlace]]:
    """A class with its place, and those of the dataclasses in it."""
    yield cls, place
    for member in members_of(cls):
        match member.declaration:
            case Group() as declared:
                yield from places_in(declared.of, group_place(place, declared))
            case Members() as declared:
                yield from places_in(declared.of, members_place(place, declared))
