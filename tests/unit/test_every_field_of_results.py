"""Every field of every kind of result comes back from its file: results are made from the declarations alone."""

import dataclasses
import re
from pkgutil import resolve_name
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from beamsim.fields import ArrayField, Attribute, Counter, Group, Key, Members, Table, members_of
from beamsim.kinds import KINDS
from beamsim.outcomes import COMPLETE
from beamsim.scenario import load_scenario
from beamsim.store.datasets import Reader, items_of
from beamsim.store.results import read_items, write_items

pytestmark = pytest.mark.quick

SCENARIO = SimpleNamespace(title="made up", bodies_of_places={}, file_records=lambda **_: {})
WORDS = {"parameter": "energy", "quantity": "acceleration"}  # others can be any text
QUANTITIES = {"probes": ("displacement", "absolute_acceleration"), "snubbers": ("force", "penetration")}
STORED = load_scenario({"chain": {"masses": [1.0], "springs": [1.0]}})


def _rank(member):
    """Axes first, then what is along them, then what may be along the same."""
    declared = member.declaration
    if isinstance(declared, Group) and not declared.path:
        return 0
    return (1 if declared.scale else 2) if isinstance(declared, ArrayField) else 3


class Maker:
    """Dataclasses with random values for all their fields."""

    def __init__(self, seed):
        self.rng = np.random.default_rng(seed)

    def make(self, cls, sizes=(), **given):
        """An instance; ``sizes`` of the axes around it by name."""
        values = dict(given)
        stored = {member.name: member for member in members_of(cls) if not member.derived}
        ranked = sorted(stored.values(), key=_rank)
        for member in ranked:
            if member.name not in values:
                value = self.value(member, sizes)
                if value is not None:
                    values[member.name] = value
        for field in dataclasses.fields(cls):
            default = (field.default, field.default_factory)
            if field.name not in stored and field.name not in values and default == (dataclasses.MISSING,) * 2:
                values[field.name] = SCENARIO if field.name == "scenario" else "m"
        return cls(**values)

    def size(self, axis, sizes):
        name = axis.name if isinstance(axis, Counter) else axis
        if isinstance(axis, Counter) and axis.labels:
            return len(axis.labels)
        return sizes.setdefault(name, int(self.rng.integers(2, 6)))

    def value(self, member, sizes):
        d = member.declaration
        match d:
            case ArrayField(scale=True):
                return self.array(member.type, (self.size(member.stored_name, sizes),))
            case ArrayField():
                shape = tuple(self.size(axis, sizes) for axis in d.along or ())
                if d.per is not None:
                    return {name: self.array(member.type, shape) for name in self.names()}
                return self.array(member.type, shape)
            case Attribute():
                return self.attribute(member)
            case Group():
                if member.default is not None and self.rng.random() < 0.4:
                    return None
                return self.make(d.of, dict(sizes) if d.path else sizes)
            case Members():
                return self.members(member, sizes)
            case Table():
                count = int(self.rng.integers(1 if member.default is not None and member.default() is None else 0, 4))
                if d.rows is None:
                    count = sizes.setdefault(next(c.stored_name for c in members_of(d.of) if c.declaration.scale), 3)
                return tuple(self.make(d.of, dict(sizes)) for _ in range(count))
        raise AssertionError(d)

    def names(self):
        return ["tip", "a/b", "größe", "."][: int(self.rng.integers(1, 5))]

    def members(self, member, sizes):
        d = member.declaration
        if member.type.startswith("dict"):
            keyed = member.type.startswith("dict[int")
            keys = [0, 1, 3] if keyed else self.names()
            if "tuple" in member.type:
                keys = [(name, "absolute_acceleration") for name in keys]
            own = next((m.name for m in members_of(d.of) if isinstance(m.declaration, Key)), "")
            return {key: self.make(d.of, dict(sizes), **({own: key} if own else {})) for key in keys}
        if d.by:
            keys = [
                (name, q, "m")[: len(d.by)]
                for name in self.names()
                for q in QUANTITIES.get(member.name, ("acceleration", "force"))
            ]
            return tuple(self.make(d.of, dict(sizes), **dict(zip(d.by, key, strict=True))) for key in keys)
        own = next((m for m in members_of(d.of) if isinstance(m.declaration, Key)), None)
        labels = list(range(1, 4)) if own is not None and own.type == "int" else self.names()
        return tuple(self.make(d.of, dict(sizes), **({own.name: label} if own else {})) for label in labels)

    def attribute(self, member):
        if member.default is not None and member.default() is None and self.rng.random() < 0.5:
            return None
        if member.declaration.codec is not None:
            if member.stored_name == "status":
                return COMPLETE
            if member.type == "Scenario":
                return STORED
            if member.type.startswith("tuple[Case"):
                return ()
            if member.default is not None:
                return member.default()
            return ("a", "b") if member.type == "tuple[str, ...]" else {}
        if member.type in ("tuple[int, ...]",):
            return (1, 2)
        if member.type.startswith("tuple[float"):
            return (0.5, np.nan)
        if member.type.startswith("tuple[str"):
            return ("a", "b")
        return WORDS.get(member.name) or self.array(member.type, ())

    def array(self, kind, shape):
        kind = re.sub(r"^dict\[str, (.*)\]$", r"\1", kind)
        rng = self.rng
        if kind in ("float", "int", "bool", "str"):
            numbers = {"float": float(rng.random()), "int": int(rng.integers(9)), "bool": bool(rng.random() > 0.5)}
            return numbers.get(kind, "größe")
        if kind.startswith("tuple[str"):
            return tuple(f"word {k}" for k in range(shape[0]))
        if kind.startswith("tuple[int"):
            return tuple(range(shape[0]))
        if kind.startswith("tuple[float"):
            return tuple(rng.random(shape[0]).tolist())
        if kind == "Complexes":
            return rng.random(shape) + 1j * rng.random(shape)
        if kind == "Bools":
            return rng.random(shape) > 0.5
        if kind == "Ints":
            return rng.integers(0, 2, shape)
        if kind == "NDArray[Any]" and rng.random() < 0.5:
            return np.array(["a", "bc"])[rng.integers(0, 2, shape)]
        return rng.random(shape)


def differences(one, other, path=""):
    if dataclasses.is_dataclass(one):
        if type(one) is not type(other):
            return [path]
        of = (f.name for f in dataclasses.fields(one) if f.name not in ("scenario", "summary"))
        return [d for name in of for d in differences(getattr(one, name), getattr(other, name), f"{path}.{name}")]
    if isinstance(one, dict):
        if not isinstance(other, dict) or list(one) != list(other):
            return [path]
        return [d for key in one for d in differences(one[key], other[key], f"{path}[{key}]")]
    if isinstance(one, (tuple, list)):
        if type(one) is not type(other) or len(one) != len(other):
            return [path]
        return [d for k, pair in enumerate(zip(one, other, strict=True)) for d in differences(*pair, f"{path}[{k}]")]
    if isinstance(one, np.ndarray):
        right = isinstance(other, np.ndarray) and one.dtype.kind == other.dtype.kind and np.array_equal(one, other)
        return [] if right else [path]
    return [] if one == other or (one != one and other != other) else [path]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", KINDS)
def test_every_field_comes_back_from_the_file(kind, seed, tmp_path):
    cls = resolve_name(KINDS[kind].result)
    result = Maker(seed).make(cls, {"value": 6})
    items = items_of(result)
    write_items(items, tmp_path / "made.h5")
    with h5py.File(tmp_path / "made.h5") as file:
        read = cls(**{"scenario": SCENARIO, **Reader(read_items(file)).fields(cls)})
    assert differences(result, read) == []
