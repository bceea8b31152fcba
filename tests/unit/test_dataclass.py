"""Data classes of the package behave as those of the standard library, and are compiled when they are first made."""

import copy
import dataclasses
import inspect
import pickle
import sys

import numpy as np
import pytest

import beamsim.dataclass


def samples(dataclass):
    """The same classes by one or the other decorator."""

    @dataclass(frozen=True)
    class Point:
        x: float
        y: float = 2.0
        tags: list[str] = dataclasses.field(default_factory=list)
        label: str = dataclasses.field(default="", compare=False, repr=False)

        def __post_init__(self):
            if self.x < 0.0:
                raise ValueError(self.x)

    @dataclass(frozen=True)
    class Named(Point):
        name: str = "a"

    @dataclass
    class Counter:
        start: int
        count: int = dataclasses.field(default=0, init=False)
        seen: dict[str, int] = dataclasses.field(default_factory=dict, init=False)
        step: int = dataclasses.field(default=1, kw_only=True)

    @dataclass(frozen=True, kw_only=True)
    class Options:
        most: int = 3
        least: int

    @dataclass(frozen=True, eq=False)
    class Matrix:
        values: np.ndarray

    @dataclass(frozen=True)
    class Own:
        value: int

        def __hash__(self):
            return 1

        def __repr__(self):
            return "own"

    @dataclass(frozen=True)
    class Nothing:
        pass

    return Point, Named, Counter, Options, Matrix, Own, Nothing


def outcome(function):
    """What a call gives or raises, in words."""
    try:
        return repr(function())
    except Exception as error:
        return type(error).__name__, str(error)


def what_may_be_done(cls, given, named):
    """With an object, what comes of it; with arguments that are refused, the error."""
    made = outcome(lambda: cls(*given, **named))
    if not isinstance(made, str):
        return [made]
    value, same = cls(*given, **named), cls(*given, **named)
    return [
        made,
        *(outcome(lambda other=other: value == other) for other in (value, same, copy.copy(value), 1)),
        outcome(lambda: isinstance(hash(value), int)),
        outcome(lambda: hash(value) == hash(same)),
        outcome(lambda: setattr(value, "x", 1)),
        outcome(lambda: setattr(value, "other", 1)),
        outcome(lambda: delattr(same, "value")),
        outcome(lambda: dataclasses.asdict(value)),
        outcome(lambda: dataclasses.replace(value, x=7.0)),
        repr(value),
    ]


ARGUMENTS = ((), (1.0,), (1.0, 3.0, ["a"]), (-1.0,), (1, 2, 3, 4, 5, 6), (1.0, 2.0, (), "label", "b"))
KEYWORDS = ({}, {"least": 1}, {"y": 5.0}, {"step": 4}, {"label": "c"}, {"nothing": 1})


@pytest.mark.parametrize("k", range(7), ids=["point", "named", "counter", "options", "matrix", "own", "nothing"])
def test_classes_are_those_of_the_standard_library(k):
    ours, theirs = (samples(each)[k] for each in (beamsim.dataclass.dataclass, dataclasses.dataclass))
    assert outcome(lambda: inspect.signature(ours)) == outcome(lambda: inspect.signature(theirs))
    assert ours.__match_args__ == theirs.__match_args__
    made = 0
    for given in ARGUMENTS:
        for named in KEYWORDS:
            found = what_may_be_done(ours, given, named)
            expected = what_may_be_done(theirs, given, named)
            assert found == expected, (given, named)
            made += len(found) > 1
    assert made


def test_objects_with_equal_fields_are_equal_and_pickled():
    point, named, _, _, matrix, _, nothing = samples(beamsim.dataclass.dataclass)
    assert hash(named(1.0, tags=())) == hash(named(1.0, tags=(), label="b"))
    assert len({matrix(np.zeros(2)), matrix(np.zeros(2)), nothing(), nothing()}) == 3
    assert point(1.0) != named(1.0)
    from beamsim.outcomes import COMPLETE

    assert pickle.loads(pickle.dumps(COMPLETE)) == COMPLETE


def test_only_used_classes_are_compiled():
    before = sys.modules["beamsim.dataclass"]._compiled
    compiled = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("beamsim.dataclass._compiled", lambda *given: compiled.append(given) or before(*given))
        named = samples(beamsim.dataclass.dataclass)[1]
        assert not compiled
        named(1.0), named(2.0)
        assert [cls for cls, _ in compiled] == [named]
