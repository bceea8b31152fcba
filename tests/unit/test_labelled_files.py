"""The layout of result files: flat datasets of fixed names, users' names as values, ragged tables; read by others."""

import dataclasses
import subprocess
import sys

import h5py
import numpy as np
import pytest

from beamsim.labelled import Layout, Variable
from beamsim.store.export import tables_of
from beamsim.store.results import load, write_result

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


TABLE = Layout(
    "points",
    "Points of branches.",
    {
        "point": Variable(("point",), "1", "number of the point", int),
        "branch": Variable(("point",), "1", "number of the branch", int),
        "steps": Variable(("point",), "1", "number of steps", int, optional=True),
        "stable": Variable(("point",), "1", "whether it is stable", bool, optional=True, flags=("no", "yes")),
        "place": Variable(("place",), "", "name of the place", str),
        "contacts": Variable(("place", "point"), "1", "number of contacts", int),
    },
)


def test_absent_integers_are_no_numbers_in_tables():
    """An empty cell, where the file holds 0; a place without any has no column."""
    points = TABLE.dataset({
        "point": [1, 2, 3], "branch": [0, 0, 1], "steps": [None, 0, 7], "stable": [False, None, True],
        "place": ["a", "b"], "contacts": [[None, 2, 3], [None, None, None]],
    })  # fmt: skip
    (made,) = tables_of(points.read())
    columns = [*made.axes, *made.columns]
    cells = {column.header: values.tolist() for column, values in zip(columns, made.part(0, 3), strict=True)}
    assert cells == {
        "point": [1, 2, 3], "branch": [0, 0, 1], "steps": [None, 0, 7], "stable": [False, None, True],
        "a contacts": [None, 2, 3],
    }  # fmt: skip


def test_values_of_several_places_have_to_be_of_the_declared_shape():
    with pytest.raises(TypeError, match="contacts is along place, point"):
        TABLE.dataset({"point": [1, 2], "branch": [0, 0], "place": ["a"], "contacts": [[1, 2, 3]]})
