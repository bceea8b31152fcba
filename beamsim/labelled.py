"""Labelled data: variables along named dimensions, with units and meanings, as results hold and files store them.

The variables of a dataset are declared once (`Layout`); what is computed becomes a `Dataset` of these, and so does what
a result file holds. Names of variables and dimensions are fixed, names that users gave are values of coordinates:
``result["histories"]["displacement"].sel(probe="tip")``. The names of methods are those of xarray, and `to_xarray`
makes its datasets; a run does not use them, because importing xarray takes longer than many runs.

`Item` and its path are how a file stores a variable. This module knows neither files nor analyses.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import xarray

ABSENT = "absent"
"""Attribute of an array with integers, truth values or texts that are not known: JSON list of their places, numbered
from 0 over the whole array in C order."""
OF_EACH = "units_of_each"
"""Attribute of an array whose unit differs from member to member: JSON list of their units, in the same order."""
MIXED = f"see {OF_EACH}"
FLAG_VALUES: dict[str, Any] = {
    "flag_values": np.array([0, 1], dtype=np.uint8)
}  # of what is false or true, with flag_meanings
NAMES = "names"
"""Attribute of numbers from 0: the path of the coordinate whose values they number."""
ROW = "number of the row"
"""Meaning of the coordinate of rows that belong to several members, one after the other (cycles of curves, points of
branches). A text table of these has numbers alone, so that it can be read back: also those of the members."""
_Record = TypeVar("_Record")
_KINDS = {float: "f", int: "iu", bool: "b", str: "O"}  # of NumPy, by the type of the values of a variable


class Described:
    """Values with attributes: unit, meaning and missing values."""

    attributes: Mapping[str, Any]

    @property
    def unit(self) -> str:
        """SI unit of the values, "1" without one."""
        return str(self.attributes.get("units", ""))

    @property
    def meaning(self) -> str:
        """What the values are."""
        return str(self.attributes.get("long_name", ""))

    @property
    def absent(self) -> frozenset[int]:
        """Places of the integers, truth values or texts that are not known, numbered in C order."""
        return frozenset(json.loads(str(self.attributes.get(ABSENT, "[]"))))


# --- As a file stores it ---------------------------------------------------------------------------------------------


@dataclass
class Item(Described):
    """A group, or an array with its axes."""

    attributes: dict[str, Any] = field(default_factory=dict)
    # None of a group; a large array is one that is in parts, or one of a file that is not read yet
    array: Any = None
    axes: tuple[str, ...] = ()  # paths of the scales of an array, one a dimension; empty where one is unknown
    scale: bool = False

    @property
    def values(self) -> Any:
        """The values of the array, which are read from its file if they were not; None of a group."""
        return None if self.array is None else np.asarray(self.array)


Items = dict[str, Item]  # by path, "/" of the root, "/histories" of a dataset, "/histories/time" of a variable


def absent_in(item: Item) -> NDArray[np.bool_]:
    """Which values of an array `Described.absent` names, in the shape of the array."""
    flags = np.zeros(item.array.shape, dtype=bool)
    flags.flat[sorted(item.absent)] = True
    return flags


def parent(path: str) -> str:
    """The group around an item."""
    return path.rpartition("/")[0] or "/"


def last(path: str) -> str:
    """The name of an item in its group."""
    return path.rpartition("/")[2]


@dataclass(frozen=True)
class LargeArray:
    """What is known of a large array without its values."""

    shape: tuple[int, ...]
    dtype: np.dtype[Any]

    @property
    def ndim(self) -> int:
        """Number of axes."""
        return len(self.shape)

    @property
    def size(self) -> int:
        """Number of values."""
        return math.prod(self.shape)

    @property
    def nbytes(self) -> int:
        """Bytes that the values take in memory."""
        return self.size * self.dtype.itemsize


def part_of(array: Any, index: tuple[Any, ...]) -> Any:
    """A part of an array, which is read when it is used if the array is."""
    if isinstance(array, np.ndarray):
        part = array[index]
        return part if isinstance(part, np.ndarray) else np.asarray(part, dtype=array.dtype)
    return array.part(index)


# --- As a result holds it --------------------------------------------------------------------------------------------


@dataclass(eq=False)
class LabelledArray(Described):
    """A variable of a dataset, or a part of it: values in SI units along named dimensions.

    NumPy and matplotlib take it as an array.

    Examples
    --------
    >>> import beamsim, numpy as np
    >>> histories = beamsim.run("configs/stops/chain_bumpers.yaml")["histories"]
    >>> displacement = histories["displacement"]
    >>> displacement.dims, displacement.unit, displacement.meaning
    (('probe', 'time'), 'm', 'displacement relative to the base')
    >>> third = displacement.sel(probe="third")
    >>> third.dims, third.values.shape, f"{1e3 * np.abs(third).max():.2f} mm"
    (('time',), (6001,), '7.99 mm')
    >>> {name: f"{1e3 * part.values.max():.2f} mm" for name, part in displacement.by_label().items()}
    {'first': '2.94 mm', 'second': '6.65 mm', 'third': '7.73 mm'}
    >>> histories["snubber_stiffness"].sel(snubber="cable").item()
    20000.0
    """

    name: str  #: in its dataset
    dims: tuple[str, ...]  #: names of the dimensions, of which the values are along; none of a single value
    array: Any  # that of NumPy, or one that is read when it is used
    attributes: Mapping[str, Any]  #: as a file stores them: ``units``, ``long_name`` and further ones
    coordinates: Mapping[str, Item]  #: by dimension the names or numbers along it, with their unit; see ``values``
    _parts: dict[Any, LabelledArray] = field(default_factory=dict, repr=False)

    @cached_property
    def values(self) -> NDArray[Any]:
        """Array of the values, in SI units; those of a file are read once, when they are first used."""
        return np.asarray(self.array)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.asarray(self.values, dtype=dtype)

    def item(self) -> Any:
        """The only value."""
        return self.values.item()

    def sel(self, **labels: Any) -> LabelledArray:
        """The part at some labels of dimensions, which is all that is read of a file.

        Parameters
        ----------
        labels : by dimension the name or number along it, ``probe="tip"``.

        Returns
        -------
        LabelledArray
            Along the other dimensions.

        Raises
        ------
        KeyError
            If the variable does not have the dimension, or that does not have the label.
        """
        key: list[int | None] = [None] * len(self.dims)
        for dim, label in labels.items():
            if dim not in self.dims:
                raise KeyError(f"{self.name} is along {', '.join(self.dims) or 'no dimension'}, not {dim}")
            labels_along = self.coordinates[dim].values
            found = np.flatnonzero(labels_along == label)
            if not found.size:
                known = ", ".join(map(str, labels_along[:20].tolist()))
                raise KeyError(f"no {dim} {label!r} in {self.name}; there are {known}")
            key[self.dims.index(dim)] = int(found[0])
        return self._part(tuple(key))

    def _part(self, key: tuple[int | None, ...]) -> LabelledArray:
        """The part at some numbers along dimensions, None for all along one."""
        if key not in self._parts:
            attributes = dict(self.attributes)
            if key and key[0] is not None and OF_EACH in attributes:
                attributes["units"] = json.loads(attributes.pop(OF_EACH))[key[0]]
            dims = tuple(dim for dim, at in zip(self.dims, key, strict=True) if at is None)
            whole = vars(self).get("values", self.array)  # not read for a part alone
            part = part_of(whole, tuple(slice(None) if at is None else at for at in key))
            self._parts[key] = LabelledArray(self.name, dims, part, attributes, self.coordinates)
        return self._parts[key]

    def by_label(self) -> dict[Any, LabelledArray]:
        """The parts by name or number along the first dimension."""
        after = (None,) * (len(self.dims) - 1)
        labels = self.coordinates[self.dims[0]].values.tolist()
        return {label: self._part((number, *after)) for number, label in enumerate(labels)}

    def __repr__(self) -> str:
        return f"<{self.name} ({', '.join(self.dims)}) {self.unit}: {self.meaning}>"


class Dataset(Mapping[str, LabelledArray]):
    """Variables along named dimensions; the variable with the name of a dimension is its coordinate.

    It is a mapping from names to `LabelledArray`. Printing it lists the variables with dimensions, units and meanings.

    Parameters
    ----------
    name : of the dataset.
    items : its group and variables by path.

    Examples
    --------
    >>> import beamsim
    >>> result = beamsim.run("configs/stops/chain_bumpers.yaml")
    >>> events = result["events"]
    >>> print(events)
    <dataset events>
      <event (event) 1: number of the contact event>
      <time (event) s: time of the contact event; 0 where contact begins at the start of the run>
      <snubber (event) 1: number of the snubber, from 0>
      <closing (event) 1: whether the contact closes>
    >>> list(events), len(events), events["time"].unit
    (['event', 'time', 'snubber', 'closing'], 4, 's')
    >>> events.rows("event", "snubber", "closing")[:2]
    [{'snubber': 0, 'closing': True}, {'snubber': 0, 'closing': False}]
    >>> names = result["histories"].labels("snubber")
    >>> {name: len(own["time"].values) for name, own in events.groups("snubber", names).items()}
    {'bumper': 60, 'cable': 58}
    >>> start = result["histories"].sel(probe="third").isel(time=slice(0, 3))
    >>> start["displacement"].dims, start["time"].values.round(5).tolist()
    (('time',), [0.0, 0.00033, 0.00067])
    >>> start.to_xarray()["displacement"].attrs["units"]
    'm'
    """

    def __init__(self, name: str, items: Items) -> None:
        self.name, self.items_by_path = name, items
        self._arrays: dict[str, LabelledArray] = {}

    def __getitem__(self, name: str) -> LabelledArray:
        """One of the variables, ``dataset["displacement"]``; a KeyError names those that there are."""
        if name not in self._arrays:
            item = self.items_by_path.get(f"/{self.name}/{name}")
            if item is None:
                raise KeyError(f"{self.name} has no {name}; it has {', '.join(self)}")
            dims = (name,) if item.scale else tuple(map(last, item.axes))
            coordinates = {dim: self.items_by_path[f"/{self.name}/{dim}"] for dim in dims}
            self._arrays[name] = LabelledArray(name, dims, item.array, item.attributes, coordinates)
        return self._arrays[name]

    def __iter__(self) -> Iterator[str]:
        return (last(path) for path, item in self.items_by_path.items() if item.array is not None)

    def __len__(self) -> int:
        return sum(item.array is not None for item in self.items_by_path.values())

    def __repr__(self) -> str:
        return "\n".join([f"<dataset {self.name}>", *(f"  {self[name]!r}" for name in self)])

    def labels(self, dim: str) -> list[Any]:
        """Names or numbers along a dimension; none where nothing is along it."""
        item = self.items_by_path.get(f"/{self.name}/{dim}")
        return [] if item is None else list(item.values.tolist())

    def sel(self, **labels: Any) -> Dataset:
        """The dataset at a name or number along some dimensions, as `LabelledArray.sel`; all else stays as it is."""
        items: Items = {f"/{self.name}": Item()}
        for name in (name for name in self if name not in labels):
            array = self[name]
            part = array.sel(**{dim: label for dim, label in labels.items() if dim in array.dims})
            scale = part.dims == (name,)
            axes = () if scale else tuple(f"/{self.name}/{dim}" for dim in part.dims)
            items[f"/{self.name}/{name}"] = Item(dict(part.attributes), part.array, axes, scale)
        return Dataset(self.name, items)

    def isel(self, **rows: slice | NDArray[np.bool_]) -> Dataset:
        """The dataset at some numbers along dimensions, by slices, or flags of one; what is not along them stays."""
        items = dict(self.items_by_path)
        for path, item in self.items_by_path.items():
            dims = (last(path),) if item.scale else tuple(map(last, item.axes))
            if not rows.keys() & set(dims):
                continue
            attributes, index = dict(item.attributes), tuple(rows.get(dim, slice(None)) for dim in dims)
            if ABSENT in attributes:
                attributes[ABSENT] = json.dumps(np.flatnonzero(absent_in(item)[index]).tolist())
            if OF_EACH in attributes:
                units = np.array(json.loads(attributes[OF_EACH]), dtype=object)[index[0]].tolist()
                attributes[OF_EACH] = json.dumps(units, ensure_ascii=False)
            by_slices = all(isinstance(part, slice) for part in index)
            array = part_of(item.array, index) if by_slices else item.values[index]
            items[path] = replace(item, attributes=attributes, array=array)
        return Dataset(self.name, items)

    def by_label(self, name: str) -> dict[Any, LabelledArray]:
        """The parts of a variable by label along its first dimension; none where the dataset lacks it."""
        return self[name].by_label() if f"/{self.name}/{name}" in self.items_by_path else {}

    def groups(self, column: str, names: Iterable[Any] | None = None) -> dict[Any, Dataset]:
        """The rows of a table by what they belong to; what is not along the rows stays as it is.

        Parameters
        ----------
        column : numbers the names along a dimension of this dataset, such as ``station_body`` those along ``body``.
        names : those that it numbers where they are of another dataset.

        Returns
        -------
        dict
            By name, in order.
        """
        rows, found = self[column], dict[Any, Dataset]()
        if names is None:
            names = self.items_by_path[f"/{rows.attributes[NAMES]}"].values.tolist()
        for number, name in enumerate(names):
            found[name] = self.isel(**{rows.dims[0]: rows.values == number})
        return found

    def rows(self, dim: str, *names: str) -> list[dict[str, Any]]:
        """The rows of a table: by column their values, None for integers, flags and texts that are not known.

        Parameters
        ----------
        dim : that the rows are along; what is along others, too, is no column. No rows if nothing is along it.
        names : of the columns; all of them by default.
        """
        columns = {}
        for name in names or self:
            array = self[name]
            if array.dims == (dim,):
                values = columns[name] = array.values.tolist()
                for unknown in array.absent:
                    values[unknown] = None
        return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]

    def records(self, dim: str, kind: type[_Record]) -> list[_Record]:
        """The rows of a table along a dimension as named tuples of a kind, whose fields are the columns."""
        return [kind(**row) for row in self.rows(dim, *kind.__annotations__)]

    def read(self) -> Items:
        """The items of the dataset, all of whose values are read from their file if they were not, and kept."""
        for name in self:
            self.items_by_path[f"/{self.name}/{name}"].array = self[name].values
        self._arrays.clear()
        return self.items_by_path

    def assign(self, **values: Any) -> Dataset:
        """A copy with other values of some variables."""
        changed = {f"/{self.name}/{name}": array for name, array in values.items()}
        items = {p: replace(i, array=changed[p]) if p in changed else i for p, i in self.items_by_path.items()}
        return Dataset(self.name, items)

    def to_xarray(self) -> xarray.Dataset:
        """The same as a dataset of xarray, whose values are read.

        Raises
        ------
        ImportError
            If xarray is not installed.
        """
        try:
            make = import_module("xarray").Dataset
        except ImportError as error:
            raise ImportError("this needs xarray, which is not installed: pip install xarray") from error
        made: xarray.Dataset = make({name: (v.dims, v.values, dict(v.attributes)) for name, v in self.items()})
        return made


def join_tables(tables: Sequence[Dataset], **values: Any) -> Dataset:
    """Tables of the same variables as one, the rows of one after those of another.

    Parameters
    ----------
    tables : at least one; what is not along the rows is that of the first.
    values : along the rows, which take the place of their own: first the numbers of the rows, by the name of the
        dimension.

    Returns
    -------
    Dataset
    """
    first, dim = tables[0], next(iter(values))
    items = dict(first.items_by_path)
    for name, array in first.items():
        if dim in array.dims:
            along = array.dims.index(dim)
            whole = values[name] if name in values else np.concatenate([part[name].values for part in tables], along)
            items[f"/{first.name}/{name}"] = replace(items[f"/{first.name}/{name}"], array=np.asarray(whole))
    return Dataset(first.name, items)


# --- As it is declared -----------------------------------------------------------------------------------------------


class Variable(NamedTuple):
    """What is declared of a variable.

    Unit and meaning may hold ``{word}``, which is replaced by what the members along the first dimension say, or all.
    """

    dims: tuple[str, ...]  # its own name of a coordinate
    unit: str
    meaning: str
    type: type = float  # of a value
    optional: bool = False  # whether a dataset may lack it
    flags: tuple[str, str] | None = None  # what the values of a truth value mean
    names: str = ""  # of numbers from 0: the coordinate whose values they number, ``histories/snubber``


Words = Mapping[str, str]  # what stands for ``{word}``


@dataclass(frozen=True)
class Layout:
    """The variables of a dataset; a dimension of names is left out where there is none, with what is along it."""

    name: str
    text: str  # what the dataset holds
    variables: Mapping[str, Variable]
    optional: bool = False  # whether a result may lack it

    def dataset(
        self, values: Mapping[str, Any], member_words: Mapping[str, Sequence[Words]] | None = None, **words: str
    ) -> Dataset:
        """The dataset of these values.

        Parameters
        ----------
        values : by variable an array along its dimensions; None where there is none.
        member_words : by dimension what each member says in units and meanings.
        words : what all say.

        Returns
        -------
        Dataset

        Raises
        ------
        TypeError
            If an array is not declared, of another shape, or missing.
        """
        if unknown := values.keys() - self.variables.keys():
            raise TypeError(f"{self.name} has no {', '.join(sorted(unknown))}")
        known = {name: value for name, value in values.items() if value is not None}
        sizes = {name: len(known[name]) for name in self._dimensions(known)}
        items: Items = {f"/{self.name}": Item()}
        for name, declared in self.variables.items():
            if not sizes.keys() >= set(declared.dims) or (declared.optional and name not in known):
                continue
            if name not in known:
                raise TypeError(f"{self.name} lacks {name}")
            array, absent = _array_of(known[name], declared.type)
            if array.shape != tuple(sizes[dim] for dim in declared.dims):
                raise TypeError(f"{name} is along {', '.join(declared.dims)}, not of the shape {array.shape}")
            each = (member_words or {}).get(declared.dims[0] if declared.dims else "")
            units, meanings = (_texts(text, each, words) for text in (declared.unit or "1", declared.meaning))
            together = [" | ".join(dict.fromkeys(texts)) for texts in (units, meanings)]
            attributes: dict[str, Any] = {"units": together[0] or "1", "long_name": together[1]}
            if len(set(units)) > 1:
                attributes |= {"units": MIXED, OF_EACH: json.dumps(units, ensure_ascii=False)}
            attributes |= {**FLAG_VALUES, "flag_meanings": " ".join(declared.flags)} if declared.flags else {}
            attributes |= {NAMES: declared.names} if declared.names else {}
            attributes |= {ABSENT: json.dumps(absent)} if absent else {}
            scale = declared.dims == (name,)
            axes = () if scale else tuple(f"/{self.name}/{dim}" for dim in declared.dims)
            items[f"/{self.name}/{name}"] = Item(attributes, array, axes, scale)
        return Dataset(self.name, items)

    def table(self, rows: Sequence[Any], row_words: Sequence[Words] = (), **values: Any) -> Dataset:
        """The dataset of a table whose columns are attributes of its rows.

        Parameters
        ----------
        rows : objects, with an attribute for each variable along the first dimension alone that is not in ``values``.
        row_words : what each row says in units and meanings.
        values : of the other variables; those of the first dimension are numbers from 1 unless they are given.

        Returns
        -------
        Dataset
        """
        dim = next(iter(self.variables))
        columns: dict[str, Any] = {dim: 1 + np.arange(len(rows))}
        for name, declared in self.variables.items():
            if declared.dims == (dim,) and name not in (dim, *values):
                column = [getattr(row, name) for row in rows]
                lacking = declared.optional and all(value is None for value in column)
                columns[name] = None if lacking else column
        return self.dataset(columns | values, {dim: row_words} if row_words or not rows else None)

    def _dimensions(self, variables: Mapping[str, Any]) -> list[str]:
        """The dimensions of a dataset with these variables."""
        return [
            name
            for name, declared in self.variables.items()
            if declared.dims == (name,) and name in variables and (declared.type is not str or len(variables[name]))
        ]

    def read(self, items: Items) -> Dataset:
        """The dataset among the items of a file.

        Parameters
        ----------
        items : of the file.

        Returns
        -------
        Dataset
            Its large arrays are read when they are used.

        Raises
        ------
        KeyError
            If a variable is missing.
        ValueError
            If one is along other axes, or of another type.
        """
        start = f"/{self.name}/"
        known = {last(path): item for path, item in items.items() if path.startswith(start)}
        dimensions = set(self._dimensions({name: item.array for name, item in known.items()}))
        found: Items = {f"/{self.name}": items[f"/{self.name}"]}
        for name, declared in self.variables.items():
            if not dimensions >= set(declared.dims) or (declared.optional and name not in known):
                continue
            if name not in known:
                raise KeyError(f"{start}{name} is missing")
            item = found[f"{start}{name}"] = known[name]
            axes = (f"{start}{name}",) if item.scale else item.axes
            if axes != tuple(f"{start}{dim}" for dim in declared.dims):
                along = ", ".join(map(last, axes)) or "no axes"
                raise ValueError(f"{start}{name} is along {along}, not {', '.join(declared.dims)}")
            if item.array.dtype.kind not in _KINDS[declared.type]:
                raise ValueError(f"{start}{name} holds {item.array.dtype}, not {declared.type.__name__}")
        return Dataset(self.name, found)


def _array_of(values: Any, kind: type) -> tuple[NDArray[Any], list[int]]:
    """An array of values of a type, text as objects, and the places, in C order, of integers, flags or texts not known.

    Values that are not known are given as None. A number is NaN there, an integer 0, a flag false, a text empty.
    """
    if isinstance(values, np.ndarray) and kind is not str:
        return values, []
    if kind is float:
        return np.asarray(values, dtype=float), []
    array = np.array(values, dtype=object)
    unknown = np.array([value is None for value in array.flat], dtype=bool).reshape(array.shape)
    if unknown.any():
        array[unknown] = kind()
    return np.asarray(array, dtype=object if kind is str else kind), np.flatnonzero(unknown).tolist()


def _texts(text: str, member_words: Sequence[Words] | None, words: Words) -> list[str]:
    """A text with its words replaced: one, or one for each member where they say something in it."""
    if "{" not in text:
        return [text]
    return [text.format_map({**words, **of}) for of in (({},) if member_words is None else member_words)]
