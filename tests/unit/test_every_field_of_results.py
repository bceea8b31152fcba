"""Every variable of every kind of result comes back from its file, and has a place of its own there."""

import re
from itertools import product
from pkgutil import resolve_name

import numpy as np
import pytest
from sampling import first_apart

from beamsim.kinds import KINDS
from beamsim.labelled import last
from beamsim.outcomes import COMPLETE, Outcome, OutcomeKind
from beamsim.scenario import load_scenario
from beamsim.store.results import items_of, load, write_result

pytestmark = pytest.mark.quick

SCENARIO = load_scenario({"chain": {"masses": [1.0], "springs": [1.0]}})
NAMES = ("tip", "a/b", "größe", ".", "")
CUT_SHORT = Outcome.of(OutcomeKind.INCOMPLETE, "interrupted", "stopped", done=3, remedy="go on")


def words_of(layout):
    """A word for each that stands in the declared units and meanings."""
    texts = (text for variable in layout.variables.values() for text in (variable.unit, variable.meaning))
    return {word: f"word_{word}" for text in texts for word in re.findall(r"\{(\w+)\}", text)}


def made(layout, rng, optional):
    """A dataset with random values of all variables; of those that it may lack a share."""
    sizes = {}
    for name, variable in layout.variables.items():
        if variable.dims == (name,):
            sizes[name] = 0 if variable.type is str and rng.random() < 0.1 else int(rng.integers(1, 6))
    values = {}
    for name, variable in layout.variables.items():
        shape = tuple(sizes[dim] for dim in variable.dims)
        if variable.optional and rng.random() > optional:
            values[name] = None
        elif variable.type is str:
            values[name] = np.array(NAMES, dtype=object)[rng.integers(0, len(NAMES), shape)]
        elif variable.type is float:
            values[name] = np.where(rng.random(shape) < 0.1, np.nan, rng.random(shape))
        else:
            numbers = np.asarray(rng.integers(0, 2, shape), dtype=object)
            if variable.optional and shape and numbers.size:
                numbers.flat[0] = None
            values[name] = numbers.tolist()
    if layout.name == "histories" and values["time"] is not None:  # that of a run or of the curves of a sweep
        values["time"] = np.sort(rng.random(values["time"].shape))
    return layout.dataset(values, **words_of(layout))


def result_of(kind, seed, optional=0.7):
    """A result with random datasets."""
    rng, cls = np.random.default_rng(seed), resolve_name(KINDS[kind].result)
    layouts = [layout for layout in cls.DATASETS if not layout.optional or rng.random() < optional]
    datasets = {layout.name: made(layout, rng, optional) for layout in layouts}
    outcome = CUT_SHORT if seed % 2 else COMPLETE
    warnings = ("größe", "b")[: seed % 3]
    return cls(scenario=SCENARIO, outcome=outcome, datasets=datasets, warnings=warnings, wall_time_s=0.1 * seed)


def described(items):
    """Attributes, axes and values of all items, to be compared."""
    return {
        path: (
            {name: np.asarray(value).tolist() for name, value in item.attributes.items()},
            item.axes,
            item.scale,
            None if item.array is None else (item.values.dtype.kind, repr(item.values.tolist())),
        )
        for path, item in items.items()
    }


@first_apart(("seed", "kind"), len(KINDS), [*product([0], KINDS), *product([1], list(KINDS)[::3])])
def test_every_variable_comes_back_from_the_file(kind, seed, tmp_path):
    result = result_of(kind, seed, optional=0.7 if seed else 1.0)
    read = load(write_result(result, tmp_path / "made.h5"), kind)
    assert described(items_of(read)) == described(items_of(result))
    assert (read.outcome, read.warnings, read.wall_time_s) == (result.outcome, result.warnings, result.wall_time_s)


def test_the_comparison_sees_a_difference():
    one, other = result_of("run", 0), result_of("run", 0)
    assert described(items_of(one)) == described(items_of(other))
    other.datasets["histories"] = other["histories"].assign(time=other["histories"]["time"].values + 1e-12)
    assert described(items_of(one)) != described(items_of(other))


@pytest.mark.parametrize("kind", KINDS)
def test_every_variable_has_a_place_and_every_number_of_a_name_a_coordinate(kind):
    layouts = {layout.name: layout for layout in resolve_name(KINDS[kind].result).DATASETS}
    assert len(layouts) == len(resolve_name(KINDS[kind].result).DATASETS)
    for layout in layouts.values():
        for name, variable in layout.variables.items():
            assert name == last(f"/{layout.name}/{name}")
            assert set(variable.dims) <= layout.variables.keys()
            dataset, _, coordinate = variable.names.partition("/")
            if variable.names:
                assert layouts[dataset].variables[coordinate].dims == (coordinate,)
