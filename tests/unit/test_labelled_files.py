"""The layout of result files: flat datasets of fixed names, users' names as values, ragged tables; read by others."""

import dataclasses
import subprocess
import sys
from pkgutil import resolve_name

import h5py
import numpy as np
import pytest

from beamsim.fields import (
    ArrayField,
    Counter,
    attribute,
    axis,
    dataset,
    declared,
    group,
    key,
    members,
    members_of,
    table,
)
from beamsim.kinds import KINDS
from beamsim.store.datasets import Reader, items_of
from beamsim.store.export import tables_of
from beamsim.store.layout import place_in, places_in, root_place, spot
from beamsim.store.results import load, read_items, write_items, write_result

pytestmark = pytest.mark.quick

NAMES = ("a/b", ".", "CON", "größe", "", "tip velocity")


def test_any_name_is_a_value_of_a_coordinate(fabricated_run, tmp_path):
    xarray = pytest.importorskip("xarray")
    run = fabricated_run(probes=NAMES)
    path = write_result(run, tmp_path / "case.h5")
    read = load(path)
    assert read["histories"].labels("probe") == list(NAMES)
    with xarray.open_datatree(path, engine="h5netcdf") as tree:
        for name in NAMES:
            found = tree["histories"].displacement.sel(probe=name)
            np.testing.assert_array_equal(found, run["histories"]["displacement"].sel(probe=name).values)
            np.testing.assert_array_equal(
                read["histories"]["displacement"].sel(probe=name).values,
                run["histories"]["displacement"].sel(probe=name).values,
            )
            np.testing.assert_array_equal(found["time"], run["histories"]["time"].values)


def test_the_root_has_no_dimensions_and_no_group_is_below_another(fabricated_run, tmp_path):
    xarray = pytest.importorskip("xarray")
    sizes = []
    for names in (("tip",), tuple(f"s{k}" for k in range(100))):
        path = write_result(fabricated_run(probes=names, snubbers=names), tmp_path / "case.h5")
        with h5py.File(path) as file:
            assert all(isinstance(item, h5py.Group) for item in file.values())
            assert all(isinstance(item, h5py.Dataset) for group in file.values() for item in group.values())
            sizes.append((len(file), sum(len(group) for group in file.values())))
        with xarray.open_datatree(path, engine="h5netcdf") as tree:
            assert not tree.to_dataset().dims
            assert not tree.to_dataset().coords
    assert sizes[0] == sizes[1]  # 100 snubbers take as many variables as one


def test_other_libraries_read_the_file(fabricated_run, tmp_path):
    pytest.importorskip("netCDF4")
    run = fabricated_run(probes=NAMES)
    path = write_result(run, tmp_path / "case.h5")
    script = """
import sys, netCDF4
with netCDF4.Dataset(sys.argv[1]) as file:
    group = file["histories"]
    assert group["displacement"].dimensions == ("probe", "time"), group["displacement"].dimensions
    assert group["displacement"].units == "m"
    print(list(group["probe"][:]), repr(float(group["displacement"][3, 7])))
"""  # in a process of its own: the HDF5 library of h5py is another one
    done = subprocess.run([sys.executable, "-c", script, path], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (
        done.stdout.strip() == f"{list(NAMES)} {float(run['histories']['displacement'].sel(probe='größe').values[7])!r}"
    )


def test_a_file_that_xarray_has_open_is_replaced(fabricated_run, tmp_path):
    xarray = pytest.importorskip("xarray")
    path = write_result(fabricated_run(), tmp_path / "case.h5")
    with xarray.open_datatree(path, engine="h5netcdf") as tree:
        write_result(dataclasses.replace(fabricated_run(), wall_time_s=3.0), path)
        assert tree["histories"].displacement.load().size
    assert load(path).wall_time_s == 3.0


@pytest.mark.parametrize("kind", KINDS)
def test_every_variable_has_a_place_of_its_own(kind):
    """No two fields of a kind of result share one, and none is along two axes that differ from member to member."""
    cls = resolve_name(KINDS[kind].result)
    found = []
    for of, place in places_in(cls, root_place(cls)):
        for member in members_of(of):
            if isinstance(member.declaration, ArrayField) and not place.split:
                by_name = member.declaration.per is not None
                at = spot(member, place_in(place, member.name, member.declaration) if by_name else place)
                assert [k for k, each in enumerate(at.axes) if each.table] in ([], [at.ragged])
                found.append(at.path)
    assert len(set(found)) == len(found)


# --- A result of members of different lengths -------------------------------------------------------------------------

POINT = (Counter("point", "number of the point"),)


@declared
class Special:
    """A point of a branch."""

    kind: str = dataset("1", "what it is")
    at: float = dataset("{unit}", "where it is")


@declared(along=POINT)
class Channel:
    """One channel along a branch."""

    name: str = key("name of the place")
    quantity: str
    unit: str
    maximum: np.ndarray = dataset("{unit}", "largest {quantity}", name="max")


@declared
class Motion:
    """One motion of a branch."""

    time: np.ndarray = axis("s", "time")
    x: np.ndarray = dataset("m", "deflection", along=("time",))
    periods: int = attribute("1", "periods")


@declared(along=POINT)
class Branch:
    """A branch."""

    unit: str = attribute("", "unit of the parameter")
    parameter: np.ndarray = dataset("{unit}", "the parameter")
    stable: np.ndarray = dataset("1", "whether it is stable", flags=("unstable", "stable"))
    multipliers: "Complexes" = dataset("1", "multipliers", along=(*POINT, Counter("multiplier", "number")))  # noqa: F821
    orders: np.ndarray = axis("1", "order", name="order", shared=True)
    harmonic: np.ndarray = dataset("m", "harmonic", along=("order", *POINT))
    channels: tuple[Channel, ...] = members("", Channel, "probe", by=("name", "quantity", "unit"), split="quantity")
    special: tuple[Special, ...] = table("special_points", Special, Counter("event", "number"))
    motion: Motion | None = group("motion", Motion, default=None)
    remark: str | None = attribute("", "remark", default=None)
    steps: "Ints | None" = dataset("1", "steps to each point", default=None)  # noqa: F821
    trials: int | None = attribute("1", "points that were tried", default=None)
    accepted: "Bools | None" = dataset("1", "whether each point was accepted", default=None)  # noqa: F821


@declared
class Branches:
    """Branches."""

    DATASETS = ()
    DATASET = "result"
    branches: tuple[Branch, ...] = members("branches", Branch, "branch", rows="points")


def branch(number, size, rng):
    orders = np.arange(2.0 + number % 2)
    quantities = (("displacement", "m"), ("force", "N" if number % 2 else "N m"))
    return Branch(
        unit="Hz" if number % 2 else "m", parameter=rng.random(size), stable=rng.random(size) > 0.5,
        multipliers=rng.random((size, 3)) + 1j * rng.random((size, 3)), orders=orders,
        harmonic=rng.random((orders.size, size)),
        channels=tuple(
            Channel(name, quantity, unit, rng.random(size))
            for quantity, unit in quantities for name in NAMES[: 3 + number % 3]
        ),
        special=tuple(Special(f"fold {k}", float(k)) for k in range(number % 4)),
        motion=Motion(np.arange(5.0 + number), rng.random(5 + number), number) if number % 3 == 1 else None,
        remark=f"branch {number}" if number % 2 else None,
        steps=rng.integers(1, 9, size) if number % 2 else None,
        accepted=rng.random(size) > 0.5 if number % 3 else None,
        trials=number if number % 2 else None,
    )  # fmt: skip


def same(one, other):
    if dataclasses.is_dataclass(one):
        return type(one) is type(other) and all(
            same(getattr(one, f.name), getattr(other, f.name)) for f in dataclasses.fields(one)
        )
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    return np.array_equal(one, other) and type(one) is type(other)


@pytest.mark.parametrize("sizes", [(3,), (4, 0, 7), tuple(range(1, 21)), ()])
def test_branches_of_different_lengths_come_back_as_they_were(sizes, tmp_path):
    rng = np.random.default_rng(len(sizes))
    result = Branches(tuple(branch(number, size, rng) for number, size in enumerate(sizes)))
    items = items_of(result)
    write_items(items, tmp_path / "branches.h5")
    with h5py.File(tmp_path / "branches.h5") as file:
        stored = read_items(file)
    for known in (items, stored):
        assert same(Branches(**Reader(known).fields(Branches)), result)
    if not sizes:
        return
    points = np.repeat(np.arange(len(sizes)), sizes)
    np.testing.assert_array_equal(stored["/points/branch"].values, points)
    np.testing.assert_array_equal(stored["/branches/point_count"].values, sizes)
    np.testing.assert_array_equal(
        stored["/points/parameter"].values, np.concatenate([each.parameter for each in result.branches])
    )
    assert stored["/points/stable"].values.dtype == bool
    assert stored["/points/max_displacement"].axes == ("/points/probe", "/points/point")
    assert stored["/points/max_displacement"].unit == "m"


@pytest.mark.parametrize("sizes", [(3, 4, 2, 5), (1, 0, 7), (2, 2, 2, 2, 2)])
def test_absent_integers_are_no_numbers_in_tables(sizes):
    """Of rows and of members, as the branches give them: an empty cell, where it was 0."""
    result = Branches(tuple(branch(number, size, np.random.default_rng(3)) for number, size in enumerate(sizes)))
    cells = {}
    for each in tables_of(items_of(result), Branches):
        for column, values in zip([*each.axes, *each.columns], each.part(0, each.size), strict=True):
            cells[each.name, column.header] = values.tolist()
    for name in ("steps", "accepted"):
        expected = [
            None if getattr(each, name) is None else getattr(each, name)[k].item()
            for each in result.branches
            for k in range(each.parameter.size)
        ]
        assert cells["points_by_point", name] == expected
    trials = [each.trials for each in result.branches]
    assert [values for (_, header), values in cells.items() if header == "trials"] == [trials]
    assert None in trials
    stable = [bool(x) for each in result.branches for x in each.stable]
    assert cells["points_by_point", "stable"] == stable  # nothing is taken away of what is there


def test_the_comparison_sees_a_difference():
    rng = np.random.default_rng(1)
    one = branch(1, 3, rng)
    assert same(one, dataclasses.replace(one))
    assert not same(one, dataclasses.replace(one, parameter=one.parameter + 1e-12))
    assert not same(one, dataclasses.replace(one, remark=None))


def test_what_is_declared_twice_is_refused():
    @declared
    class Twice:
        """Two fields of one name."""

        DATASET = "twice"
        one: np.ndarray = dataset("1", "one", name="x", along=POINT)
        two: np.ndarray = dataset("1", "two", name="x", along=POINT)

    with pytest.raises(TypeError, match="two fields are called /twice/x"):
        items_of(Twice(np.zeros(2), np.ones(2)))
