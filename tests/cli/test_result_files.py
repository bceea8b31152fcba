"""``info``, ``plot`` and ``export`` of the result file of every command, and what they do with files that are none."""

import csv
import gzip
import json
import math
import os
from pathlib import Path

import h5py
import numpy as np
import pytest
from sampling import first_apart

import beamsim
from tests.helpers.commands import invoke

STORED = Path(__file__).parents[1] / "data" / "results"
CASES = {
    "run": "run_chain", "sweep": "sweep", "stepped": "stepped", "continuation": "continuation", "designs": "designs",
    "identify-stiffness": "identify_snubber", "nnm": "nnm", "compare": "compare", "compare-modes": "compare_modes",
}  # fmt: skip
WITHOUT_RECORDS = {"compare-modes", "designs", "identify-stiffness"}


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Path of a kept result file by name of the case."""
    folder = tmp_path_factory.mktemp("results")

    def path(name):
        file = folder / f"{name}.h5"
        if not file.exists():
            file.write_bytes(gzip.decompress((STORED / f"{CASES[name]}.h5.gz").read_bytes()))
        return file

    return path


def stored_datasets(path, *, named=False):
    """Path -> values of every dataset that is no scale, read without beamsim; ``named``: names for indices."""
    found = {}

    def note(name, item):
        if isinstance(item, h5py.Dataset) and not item.is_scale:
            words = h5py.check_string_dtype(item.dtype) is not None
            found[name] = np.asarray(item.asstr()[()], dtype=object) if words else np.asarray(item[()])
            if named and "names" in item.attrs and item.dims[0][0].attrs["long_name"] != "number of the row":
                labels = file[item.attrs["names"]]
                words = h5py.check_string_dtype(labels.dtype) is not None
                found[name] = np.asarray(labels.asstr()[()] if words else labels[()])[found[name]]
            elif not named and "names" in item.attrs:
                found[name] = found[name] + 1  # MATLAB counts from one

    with h5py.File(path) as file:
        file.visititems(note)
    return found


def columns_of(path, place, values):
    """The values of a dataset as columns of a table: one for each name along its axes with names, if it has others."""
    with h5py.File(path) as file:
        scales = [dimension[0] for dimension in file[place].dims]
        absent = json.loads(file[place].attrs.get("absent", "[]"))
        named = [axis for axis, scale in enumerate(scales) if h5py.check_string_dtype(scale.dtype) is not None]
    if len(named) == values.ndim:
        return [values]
    parts = np.moveaxis(values, named, range(len(named)))
    columns = [parts[index] for index in np.ndindex(parts.shape[: len(named)])]
    return [column for number, column in enumerate(columns) if number not in absent]


def same(texts, values):
    """Whether the cells of a column are the values, to the bit."""
    values = np.asarray(values).ravel().tolist()
    if len(values) != len(texts):
        return False
    if values and isinstance(values[0], str):
        return values == list(texts)
    try:
        numbers = np.array(texts, dtype=float)
    except ValueError:  # a column of texts
        return False
    return np.array_equal(numbers, np.array(values, dtype=float), equal_nan=True)


def floats(value):
    """Every number of a JSON value that is no integer."""
    if isinstance(value, (dict, list)):
        for item in value.values() if isinstance(value, dict) else value:
            yield from floats(item)
    elif isinstance(value, float):
        yield value


@first_apart("name", 3, CASES)
def test_info_and_plot(name, files, tmp_path):
    path = files(name)
    said = invoke("info", path)
    assert said.exit_code == 0, said.output
    title = beamsim.load(path).title
    assert said.stdout.splitlines()[0] == (f"{path}: {title}" if title else str(path))
    assert "by beamsim " in said.stdout
    told = invoke("info", path, "--json")
    assert told.exit_code == 0, told.output
    values = json.loads(told.stdout)
    assert values["kind"] == ("sweep" if name == "stepped" else name)
    assert {"title", "status", "created", "wall_time_s", "warnings"} <= set(values)
    assert all(math.isfinite(number) for number in floats(values))  # others are null
    drawn = invoke("plot", path, "--format", "svg", "-o", tmp_path, "--json")
    assert drawn.exit_code == 0, drawn.output
    pictures = json.loads(drawn.stdout)["files"]
    assert pictures
    assert all(Path(picture).read_text(encoding="utf-8").startswith("<?xml") for picture in pictures)


@pytest.mark.parametrize("name", CASES)
def test_the_result_opens_whatever_it_is(name, files):
    result = beamsim.load(files(name))
    assert result.complete
    with h5py.File(files(name)) as file:
        assert result.scenario == beamsim.load_scenario(file.attrs["scenario"])
        assert result.title == file.attrs["title"]


@first_apart("name", 3, CASES)
def test_csv_holds_every_number(name, files, tmp_path):
    path = files(name)
    done = invoke("export", path, "--format", "csv", "-o", tmp_path, "--json")
    assert done.exit_code == 0, done.output
    written = [Path(file) for file in json.loads(done.stdout)["files"]]
    assert {file.parent for file in written} == {tmp_path / f"{name}_csv"}
    columns, described = {}, {}
    for file in written:
        if file.suffix == ".csv" and file.name not in ("columns.csv", "attributes.csv", "summary.csv"):
            with open(file, newline="", encoding="utf-8") as stream:
                header, *rows = csv.reader(stream)
            assert len(set(header)) == len(header)
            columns.update({(file.name, title): [row[k] for row in rows] for k, title in enumerate(header)})
    with open(tmp_path / f"{name}_csv" / "columns.csv", newline="", encoding="utf-8") as stream:
        described = {(row["file"], row["column"]): row for row in csv.DictReader(stream)}
    assert set(described) == set(columns)
    expected = stored_datasets(path, named=True)
    assert len(expected) > 5
    for place, values in expected.items():
        last = place.rpartition("/")[2]
        stem = last.rpartition("_")[0] or last  # a unit at the end of a stored name is in brackets in the heading
        own = [cells for (_, title), cells in columns.items() if last in title or stem in title]
        for column in columns_of(path, place, values):
            assert any(same(cells, column) for cells in own), place
            if column.dtype.kind == "f" and np.isfinite(column).any():  # the comparison can fail
                wrong = np.where(np.isfinite(column), column * (1 + 4e-16) + 1e-300, column)
                assert not any(same(cells, wrong) for cells in own), place
    scenario = beamsim.load_scenario(tmp_path / f"{name}_csv" / "scenario.yaml")
    assert scenario.title == beamsim.load(path).title


def lookup(struct, path):
    for part in path.split("/"):
        name = "".join(c if (c.isalnum() and c.isascii()) or c == "_" else "_" for c in part)
        struct = struct[name if name[0].isalpha() else f"x{name}"]
    return np.asarray(struct)


@first_apart("name", 3, CASES)
def test_mat_holds_every_number(name, files, tmp_path):
    from scipy.io import loadmat

    path = files(name)
    done = invoke("export", path, "--format", "mat", "-o", tmp_path)
    assert done.exit_code == 0, done.output
    mat = loadmat(tmp_path / f"{name}.mat", simplify_cells=True)
    assert mat["info"]["title"] == beamsim.load(path).title
    for place, values in stored_datasets(path).items():
        stem, part = place, np.asarray
        for suffix, taken in (("_real", np.real), ("_imag", np.imag)):
            if place.endswith(suffix):
                stem, part = place.removesuffix(suffix), taken
        found = part(lookup(mat, stem))
        if values.dtype == object:
            texts = [str(text) if np.size(text) else "" for text in found.ravel()]  # SciPy has an array for no text
            expected = values.ravel().tolist()
            assert (texts or [""] * len(expected)) == expected, place  # of one text SciPy reads back the text
        else:
            assert np.array_equal(found.ravel(), values.ravel(), equal_nan=True), place


@pytest.mark.parametrize("name", [name for name in CASES if name not in ("run", *WITHOUT_RECORDS)])
def test_uff_holds_what_depends_on_time_or_frequency(name, files, tmp_path):
    import pyuff

    path = files(name)
    done = invoke("export", path, "--format", "uff", "-o", tmp_path)
    assert done.exit_code == 0, done.output
    units, _, nodes, *others = pyuff.UFF(str(tmp_path / f"{name}.uff")).read_sets()
    assert units["length"] == 1.0
    assert len(nodes["x"]) > 0
    assert {other["type"] for other in others} <= {55, 58, 82}  # modes, functions, lines of the structure
    functions = [other for other in others if other["type"] == 58]
    stored = [values.astype(float) for values in stored_datasets(path).values() if values.dtype.kind == "f"]
    for function in (each for each in functions if " order " not in each["id1"]):
        values, size = function["data"], function["x"].size
        assert size == values.size
        for part in (values.real, values.imag) if np.iscomplexobj(values) else (values,):
            first = part[np.flatnonzero(np.isfinite(part))[0]]
            starts = [
                (whole, int(at))
                for whole in map(np.ravel, stored)
                for at in np.flatnonzero(np.isclose(whole, first, 1e-11, 1e-30))
            ]
            assert any(
                np.allclose(whole[at : at + size], part, rtol=1e-11, atol=1e-30, equal_nan=True)
                for whole, at in starts
                if at + size <= whole.size
            ), function["id1"]
    assert len(functions) > 3


@pytest.mark.parametrize("name", sorted(WITHOUT_RECORDS))
def test_uff_refuses_what_has_no_functions(name, files, tmp_path):
    done = invoke("export", files(name), "--format", "uff", "-o", tmp_path)
    assert done.exit_code == 2
    assert "use --format csv or --format mat" in done.stderr
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("command", [("info",), ("plot",), ("export", "--format", "csv")])
def test_files_that_cannot_be_read(command, files, tmp_path, without_examination):
    whole = files("run")
    (tmp_path / "text.h5").write_text("title: x\n")
    (tmp_path / "empty.h5").write_bytes(b"")
    (tmp_path / "junk.h5").write_bytes(bytes(range(256)) * 40)
    (tmp_path / "folder.h5").mkdir()
    with h5py.File(tmp_path / "alien.h5", "w") as file:
        file["x"] = 1
    data = whole.read_bytes()
    (tmp_path / "cut.h5").write_bytes(data[: len(data) // 2])
    for name, attribute, value in (("newer", "schema_version", 99), ("unknown", "kind", "dance")):
        (tmp_path / f"{name}.h5").write_bytes(data)
        with h5py.File(tmp_path / f"{name}.h5", "a") as file:
            file.attrs[attribute] = value
    messages = {
        "gone": "no such result file",
        "text": "not an HDF5 file, or damaged",
        "empty": "not an HDF5 file, or damaged",
        "junk": "not an HDF5 file, or damaged",
        "folder": "is a folder",
        "alien": "not from beamsim",
        "cut": "damaged",
        "newer": "schema_version 99",
        "unknown": "is unknown to this version",
    }
    for name, message in messages.items():
        done = invoke(*command, tmp_path / f"{name}.h5", "-o" if command[0] != "info" else "--json", *(
            [tmp_path / "out"] if command[0] != "info" else []
        ))  # fmt: skip
        assert done.exit_code == 2, (name, done.output)
        assert message in done.stderr, (name, done.stderr)
        assert f"{name}.h5" in done.stderr
        assert not done.stdout


@first_apart("name", 4, CASES)
@pytest.mark.parametrize("command", [("info",), ("plot",)])
def test_a_file_with_a_part_missing_is_damaged(name, command, files, tmp_path, monkeypatch, without_examination):
    """The first group or dataset that is taken away makes the file unreadable, never a traceback."""
    monkeypatch.setattr("beamsim.cli.stored.save_figures", lambda figures, *_: [])  # which takes longer than the rest
    data = files(name).read_bytes()
    with h5py.File(files(name)) as file:
        parts = [part for part in file if part not in ("summary",)]
    outcomes = set()
    for part in ["summary", *parts[: 2 if command[0] == "info" else 1]]:
        path = tmp_path / f"{part}.h5"
        path.write_bytes(data)
        with h5py.File(path, "a") as file:
            del file[part]
        done = invoke(*command, path, *(("-o", tmp_path / "p") if command[0] == "plot" else ()))
        outcomes.add(done.exit_code)
        assert done.exit_code in (0, 2), done.output
        if done.exit_code == 2:
            assert f"{part}.h5" in done.stderr
    assert 2 in outcomes


def test_a_comparison_without_channels_is_damaged(files, tmp_path, without_examination):
    path = tmp_path / "compare.h5"
    path.write_bytes(files("compare").read_bytes())
    with h5py.File(path, "a") as file:
        del file["channels"]
    done = invoke("info", path)
    assert done.exit_code == 2
    assert "it was changed after it was written" in done.stderr


@pytest.mark.parametrize("value", [3, "text", np.zeros(3), -1.5])
def test_axes_that_refer_to_nothing_are_damaged(value, files, tmp_path, without_examination):
    """HDF5 follows the references of this attribute whatever they are: the process died."""
    path = tmp_path / "nnm.h5"
    path.write_bytes(files("nnm").read_bytes())
    with h5py.File(path, "a") as file:
        axes = file["modes/closed_frequencies_hz"].attrs
        del axes["DIMENSION_LIST"]
        axes["DIMENSION_LIST"] = value
    done = invoke("info", path)
    assert done.exit_code == 2
    assert "DIMENSION_LIST of /modes/closed_frequencies_hz does not refer to its axes" in done.stderr


def test_text_that_is_no_utf_8_is_damage(files, tmp_path, without_examination):
    """It was an internal error of the export, long after it had been read."""
    path, text = tmp_path / "nnm.h5", b"natural frequencies with every contact closed"
    whole = files("nnm").read_bytes()
    assert text in whole
    path.write_bytes(whole.replace(text, text.replace(b"f", b"\xe0")))
    for command in (("info",), ("export", "--format", "csv", "-o", tmp_path / "out")):
        done = invoke(command[0], path, *command[1:])
        assert done.exit_code == 2, done.output
        assert "damaged" in done.stderr
