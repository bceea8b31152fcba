"""Arrays of sparse matrices and claims of sizes are checked before compiled code follows them."""

import io
import itertools
import struct
import sys
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pytest
import pyuff
import scipy.io
import scipy.sparse as sp

from beamsim.errors import InputFileError, MethodError, ResultFileError
from beamsim.hdf5 import open_hdf5, read_array
from beamsim.matrix_files import read_matrices
from beamsim.measurements.read import read_file
from beamsim.sparse_parts import from_columns, from_diagonals, from_rows
from beamsim.store.results import load
from tests.helpers.universal_files import function

pytestmark = pytest.mark.quick
MATRIX = sp.random_array((12, 6), density=0.4, rng=np.random.default_rng(1)).tocsc()


@pytest.mark.parametrize("layout", ["csr", "csc", "coo", "bsr", "dia"])
@pytest.mark.parametrize("compressed", [True, False])
def test_every_layout_of_numpy_is_read_as_scipy_reads_it(layout, compressed, tmp_path):
    values = sp.bsr_array(MATRIX.toarray(), blocksize=(4, 3)) if layout == "bsr" else MATRIX.asformat(layout)
    sp.save_npz(tmp_path / "k.npz", values, compressed=compressed)
    (read,) = read_matrices(tmp_path / "k.npz")
    np.testing.assert_array_equal(read.values.toarray(), MATRIX.toarray())


COMPRESSED = {"format": b"csr", "shape": [2, 2], "data": [1.0, 2.0], "indices": [0, 1], "indptr": [0, 1, 2]}
COORDINATES = {"format": b"coo", "shape": [2, 2], "data": [1.0, 2.0], "row": [0, 1], "col": [0, 1]}
BLOCKS = {**COMPRESSED, "format": b"bsr", "data": np.ones((2, 1, 1))}
DIAGONALS = {"format": b"dia", "shape": [2, 2], "data": np.ones((1, 2)), "offsets": [0]}
DAMAGE = [
    (COMPRESSED, {"indices": [0, 10**9]}, "the column of entry 2 is 1000000001, outside 1 to 2"),
    (COMPRESSED, {"indices": [0, -1]}, "the column of entry 2 is 0, outside"),
    (COMPRESSED, {"indices": [0.5, 1]}, "not whole numbers"),
    (COMPRESSED, {"indices": [[0, 1]]}, "no list"),
    (COMPRESSED, {"indices": [0, 2**63]}, "."),
    (COMPRESSED, {"indptr": [0, 3, 2]}, "the pointer of row 3 is less than that of row 2"),
    (COMPRESSED, {"indptr": [1, 1, 2]}, "its pointers go from 1 to 2, instead of 0 to its 2 entries"),
    (COMPRESSED, {"indptr": [0, 2, 10**12]}, "its pointers go from 0 to 1000000000000"),
    (COMPRESSED, {"indptr": [0, 2]}, "it has 2 pointers for 2 rows"),
    (COMPRESSED, {"data": [1.0]}, "it has 1 entries, and 2 of them have a column"),
    (COMPRESSED, {"data": ["a", "b"]}, "no list of numbers"),
    (COMPRESSED, {"shape": [2, 10**12]}, "up to 10000000 rows and columns are read"),
    (COMPRESSED, {"shape": [-2, 2]}, "its shape is -2 x 2"),
    (COMPRESSED, {"shape": [2, 2, 2]}, "its shape is not two whole numbers"),
    (COMPRESSED, {"format": b"xyz"}, "its sparse format is 'xyz'"),
    (COMPRESSED, {"format": b"dia"}, "it lacks the array offsets"),
    ({**COMPRESSED, "format": b"csc"}, {"indices": [0, 2]}, "the row of entry 2 is 3, outside 1 to 2"),
    (COORDINATES, {"row": [0, 2]}, "the row of entry 2 is 3, outside 1 to 2"),
    (COORDINATES, {"col": [0, -5]}, "the column of entry 2 is -4, outside 1 to 2"),
    (COORDINATES, {"row": [0]}, "it has 2 entries, and 1 of them have a row"),
    (BLOCKS, {"indices": [0, 7]}, "the block column of entry 2 is 8, outside 1 to 2"),
    (BLOCKS, {"indptr": [0, 5, 2]}, "the pointer of block row 3 is less"),
    (BLOCKS, {"data": np.ones((2, 0, 1))}, "do not divide its shape"),
    (BLOCKS, {"data": np.ones((2, 3, 1))}, "do not divide its shape"),
    (DIAGONALS, {"offsets": [10**6]}, "the offset of entry 1 is"),
    (DIAGONALS, {"offsets": [0, 1]}, "it has 1 diagonals with 2 offsets"),
    (DIAGONALS, {"offsets": [0, 0], "data": np.ones((2, 2))}, "two of its diagonals have the same offset"),
]  # fmt: skip


@pytest.mark.parametrize(("parts", "damage", "message"), DAMAGE)
def test_indices_and_pointers_of_numpy_are_checked(parts, damage, message, tmp_path):
    np.savez(tmp_path / "k.npz", **{key: np.array(value) for key, value in (parts | damage).items()})
    with pytest.raises(MethodError, match=rf"k\.npz.*{message}"):
        read_matrices(tmp_path / "k.npz")


def test_archives_are_not_unpacked_before_their_sizes_are_known(tmp_path):
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }".ljust(117) + b"\n"
    claim = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + bytes(80)
    bomb = io.BytesIO()
    np.save(bomb, np.zeros(10))
    for name, content, message in (
        ("claim", claim, "claims 8 TB for shape"),
        ("cut", bomb.getvalue()[:-8], "claims 80"),
    ):
        with zipfile.ZipFile(tmp_path / f"{name}.npz", "w") as archive:
            archive.writestr("a.npy", content)
        with pytest.raises(MethodError, match=f"{name}.npz.*{message}"):
            read_matrices(tmp_path / f"{name}.npz")


def matrices_7_3(path, **parts):
    sound = {"data": [1.0, 2.0], "ir": [0, 1], "jc": [0, 1, 2], "rows": 2} | parts
    with h5py.File(path, "w", userblock_size=512) as file:
        group = file.create_group("K")
        group.attrs["MATLAB_sparse"] = sound.pop("rows")
        for key, values in sound.items():
            group[key] = np.array(values)
    with open(path, "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file")


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        ({"ir": [0, 5]}, "the row of entry 2 is 6, outside 1 to 2"),
        ({"jc": [0, 2, 1]}, "go from 0 to 1"),
        ({"jc": [0, 3, 2]}, "the pointer of column 3 is less"),
        ({"jc": []}, "its shape is 2 x -1"),
        ({"rows": 2**40}, "up to 10000000 rows"),
        ({"data": [1.0]}, "it has 1 entries, and 2 of them have a row"),
    ],
)
def test_sparse_matrices_of_matlab_7_3_are_checked(damage, message, tmp_path, without_examination):
    matrices_7_3(tmp_path / "k.mat", **damage)
    with pytest.raises(MethodError, match=rf"k\.mat.*{message}"):
        read_matrices(tmp_path / "k.mat")
    matrices_7_3(tmp_path / "k.mat")
    assert read_matrices(tmp_path / "k.mat")[0].values.nnz == 2


@pytest.mark.parametrize("compressed", [False, True])
def test_matlab_5_is_read_as_scipy_reads_it_and_no_damage_reaches_its_reader(compressed, tmp_path):
    path, content = tmp_path / "k.mat", {
        "K": MATRIX, "D": MATRIX.toarray(), "Z": 1j * np.eye(3), "b": np.eye(2) > 0, "note": "text µ",
        "model": {"inner": {"m": np.eye(2)}}, "cells": np.array([np.eye(2), "a"], dtype=object),
        "small": np.arange(6, dtype=np.int8).reshape(2, 3), "none": np.empty((0, 3)),
    }  # fmt: skip
    scipy.io.savemat(path, content, do_compression=compressed)
    found = {each.name: each.values for each in read_matrices(path)}
    for name in ("K", "D", "Z", "small", "model.inner.m"):
        expected = {"K": MATRIX.toarray(), "model.inner.m": np.eye(2)}.get(name, content.get(name))
        np.testing.assert_array_equal(found[name].toarray(), expected)
    sound, rng = path.read_bytes(), np.random.default_rng(2)
    refused = 0
    for _ in range(150):
        damaged = bytearray(sound)
        at = int(rng.integers(128, len(damaged) - 4))
        damaged[at : at + 4] = struct.pack("<I", int(rng.choice([0, 1, 7, 200, 2**16, 2**31 - 1, 2**32 - 1])))
        path.write_bytes(damaged[: rng.choice([len(damaged), at + 4])])
        try:
            read_matrices(path)
        except MethodError as error:
            assert "k.mat" in str(error)  # noqa: PT017 (some damage is in numbers alone)
            refused += 1
    assert refused > 50


def test_nesting_of_matlab_structs_is_bounded(tmp_path):
    deep: object = np.eye(2)
    for _ in range(40):
        deep = {"a": deep}
    scipy.io.savemat(tmp_path / "deep.mat", {"deep": deep})
    with pytest.raises(MethodError, match=r"deep\.mat.*nested more than 30 deep"):
        read_matrices(tmp_path / "deep.mat")


MARKET = "%%MatrixMarket matrix"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            f"{MARKET} array real symmetric\n2 2\n1\n2\n3\n4\n",
            "4 lines of entries instead of 3",
        ),  # kills SciPy's reader
        (f"{MARKET} array real general\n1000000000 1000000000\n1\n", "up to 10000000 rows"),
        (f"{MARKET} array real general\n1000000 1000000\n1\n", "a dense matrix of 1000000 x 1000000"),
        (
            f"{MARKET} coordinate real general\n2 2 1000000000000\n1 1 1\n",
            "1 lines of entries instead of 1",
        ),
        (f"{MARKET} coordinate real general\n2 2 1\n3 1 1\n", "the row of entry 1 is 3, outside 1 to 2"),
        (f"{MARKET} coordinate real general\n2 2 1\n1 0 1\n", "the column of entry 1 is 0, outside 1 to 2"),
        (f"{MARKET} coordinate real general\n2 2 1\n1 1.5 1\n", "not whole numbers"),
        (f"{MARKET} coordinate real general\n2 2 1\n1 1\n", "have 2 numbers instead of 3"),
        (f"{MARKET} coordinate real general\n-2 2 1\n1 1 1\n", "its shape is -2 x 2"),
        (f"{MARKET} coordinate real other\n2 2 1\n1 1 1\n", "its heading is"),
        (f"{MARKET} coordinate real general\n", "its heading is"),
    ],
)
def test_matrix_market_files_hold_what_they_claim(text, message, tmp_path):
    (tmp_path / "k.mtx").write_text(text)
    with pytest.raises(MethodError, match=rf"k\.mtx.*{message}"):
        read_matrices(tmp_path / "k.mtx")


@pytest.mark.parametrize(
    ("layout", "field", "symmetry"),
    [
        *itertools.product(["coordinate", "array"], ["real", "complex"], ["general", "symmetric", "skew-symmetric"]),
        ("coordinate", "complex", "hermitian"),
        ("array", "complex", "hermitian"),
        ("coordinate", "pattern", "symmetric"),
        ("coordinate", "pattern", "general"),
    ],
)
def test_matrix_market_is_read_as_scipy_reads_it(layout, field, symmetry, tmp_path):
    square = MATRIX.toarray()[:6] * (1.0 if field == "real" else 1.0 + 2.0j if field == "complex" else 1.0)
    values = {
        "general": square, "symmetric": square + square.T, "skew-symmetric": square - square.T,
        "hermitian": square + square.conj().T,
    }[symmetry]  # fmt: skip
    values = (values != 0).astype(float) if field == "pattern" else values
    source = sp.coo_array(values) if layout == "coordinate" else values
    scipy.io.mmwrite(tmp_path / "k.mtx", source, field=field, symmetry=symmetry, precision=17)
    (read,) = read_matrices(tmp_path / "k.mtx")
    np.testing.assert_array_equal(read.values.toarray(), values)


@pytest.mark.parametrize("damage", [("   1   2   3", "   1   3   2"), ("   1   2   3", "   1   9   3"), (" 3 ", " 9 ")])
def test_harwell_boeing_pointers_and_rows_are_checked(damage, tmp_path):
    scipy.io.hb_write(tmp_path / "k.hb", sp.csc_array(np.diag([1.0, 2.0])))
    text = Path(tmp_path / "k.hb").read_text()
    lines = text.splitlines()
    lines[4] = lines[4].replace(*[each.strip() for each in damage]) if damage[0].strip() in lines[4] else "1 9 3"
    (tmp_path / "k.hb").write_text("\n".join(lines))
    with pytest.raises(MethodError, match=r"k\.hb cannot be read as Harwell-Boeing"):
        read_matrices(tmp_path / "k.hb")


def test_hdf5_claims_no_more_than_it_stores(tmp_path, without_examination):
    with h5py.File(tmp_path / "claims.h5", "w") as file:
        options = {"dtype": "f8", "compression": "gzip", "fillvalue": 1.0}
        file.create_dataset("bomb", shape=(300_000_000,), chunks=(10_000_000,), **options)
        file.create_dataset("chunk", shape=(10,), maxshape=(None,), chunks=(50_000_000,), **options)
        file["nothing"] = h5py.Empty("f8")
        layout = h5py.VirtualLayout((3,), "f8")
        layout[:] = h5py.VirtualSource("other.h5", "a", (3,))
        file.create_virtual_dataset("virtual", layout)
        file.create_dataset("outside", (3,), "f8", external=[("other.bin", 0, 24)])
        file["sound"] = np.arange(3.0)
    with open_hdf5(tmp_path / "claims.h5") as file:
        for name, message in (
            ("bomb", "claims 2.4 GB for values of /bomb, of which 0 bytes are stored"),
            ("chunk", "claims 400 MB for a chunk of /chunk"),
            ("nothing", "has no values in /nothing"),
            ("virtual", "has the values of /virtual in another file"),
            ("outside", "has the values of /outside in another file"),
        ):
            with pytest.raises(InputFileError, match=rf"claims\.h5 {message}"):
                read_array(file[name])
        np.testing.assert_array_equal(read_array(file["sound"]), np.arange(3.0))
    with pytest.raises(InputFileError, match="claims"):
        read_file(tmp_path / "claims.h5")


def test_compressed_matrices_are_those_of_scipy():
    for build, values in ((from_columns, MATRIX), (from_rows, MATRIX.tocsr())):
        built = build(values.data, values.indices, values.indptr, values.shape)
        np.testing.assert_array_equal(built.toarray(), MATRIX.toarray())
    diagonals = MATRIX.todia()
    built = from_diagonals(diagonals.data, diagonals.offsets, diagonals.shape)
    np.testing.assert_array_equal(built.toarray(), MATRIX.toarray())


BUSY = """
import sys
from beamsim import hdf5

def read_for_ever(owner):
    while True:
        pass

hdf5._read_all = read_for_ever
hdf5.examine(sys.argv[1], float(sys.argv[2]))
"""
BOUNDED = pytest.mark.skipif(sys.platform == "win32", reason="Windows bounds no processor time of a process")


@pytest.mark.parametrize(
    ("end", "message"),
    [
        ("import os; os.abort()", "the HDF5 library cannot read it to its end"),
        ("import time; time.sleep(60)", "was not read to its end by the HDF5 library within 0.3 s"),
        pytest.param(BUSY, "the HDF5 library cannot read it to its end", marks=BOUNDED),
        ("raise ImportError('no module')", "cannot be examined: ImportError: no module"),
        ("pass", ""),
    ],
)
def test_a_file_that_ends_the_process_of_hdf5_is_refused(end, message, tmp_path, monkeypatch):
    with h5py.File(path := tmp_path / "a.h5", "w") as file:
        file["time"], file["a"] = np.arange(9.0), np.ones(9)
    monkeypatch.setattr("beamsim.hdf5._EXAMINE", end)
    longest_s = 0.3 if "sleep" in end else 1.0 if end == BUSY else 60.0
    monkeypatch.setattr("beamsim.hdf5.LONGEST_EXAMINATION_S", longest_s)
    monkeypatch.setattr("beamsim.hdf5.WAITING", 1.0 if "sleep" in end else 60.0)
    if not message:
        assert len(read_file(path)) == 2
        return
    with pytest.raises(InputFileError, match=message):
        read_file(path)
    if end != BUSY:  # a second of processor time
        with pytest.raises(ResultFileError, match=message):
            load(path)


def test_a_universal_file_claims_no_more_values_than_it_can_hold(tmp_path):
    time = np.arange(64) / 100
    record = pyuff.prepare_58(
        binary=0, func_type=1, rsp_node=1, rsp_dir=3, ref_dir=0, ref_node=0, data=np.sin(time), x=time, num_pts=64,
        abscissa_spacing=1, abscissa_inc=0.01, abscissa_spec_data_type=17, ordinate_spec_data_type=12,
        orddenom_spec_data_type=0, id1="a", ver_num=0, rsp_ent_name="a", ref_ent_name="b",
    )  # fmt: skip
    pyuff.UFF(str(tmp_path / "a.uff")).write_sets(record, "overwrite")
    content = (tmp_path / "a.uff").read_bytes()
    assert len(read_file(tmp_path / "a.uff")) == 1
    (tmp_path / "a.uff").write_bytes(content.replace(b"        64", b" 999999999"))
    with pytest.raises(InputFileError, match="a data set 58 claims 999999999 values"):
        read_file(tmp_path / "a.uff")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1,1,2.0\n9,999999999,9.5\n", "its shape is 999999999 x 999999999"),
        ("1,1,2.0\n2,nan,9.5\n", "its entry 2 holds a number that is not finite"),
        ("1,1,2.0\n2,2,inf\n", "its entry 2 holds a number that is not finite"),
        ("1,1,2.0\n1.5,2,9.5\n", "its rows are not whole numbers"),
        ("1,1,2.0\n0,2,9.5\n", "outside 1 to 2"),
        ("1,1,1,1,2.0\nnan,1,2,1,-1\n", "its entry 2 holds a number that is not finite"),
        ("1,1,1,1,2.0\n1e300,1,2,1,-1\n", "its nodes and components are not whole numbers"),
        ("1,1,1,1,2.0\n1.5,1,2,1,-1\n", "its nodes and components are not whole numbers"),
    ],
)
def test_entries_of_abaqus_are_finite_and_at_whole_places(text, message, tmp_path):
    (tmp_path / "k.mtx").write_text(text)
    with pytest.raises(MethodError, match=rf"k\.mtx.*{message}"):
        read_matrices(tmp_path / "k.mtx")


def test_output4_claims_no_more_columns_than_are_read(tmp_path):
    def record(content):
        return struct.pack("<i", len(content)) + content + struct.pack("<i", len(content))

    def content(size):
        heading = record(struct.pack("<4i8s", size, size, 2, 2, b"KXX     "))
        return heading + b"".join(record(struct.pack("<3id", column, 1, 2, 1.0)) for column in (1, size + 1))

    (tmp_path / "k.op4").write_bytes(content(3))
    assert read_matrices(tmp_path / "k.op4")[0].values.shape == (3, 3)
    (tmp_path / "k.op4").write_bytes(content(300_000_000))
    with pytest.raises(MethodError, match=r"its shape is 300000000 x 300000000"):
        read_matrices(tmp_path / "k.op4")


def test_matlab_has_one_entry_for_each_place(tmp_path, without_examination):
    sparse = sp.csc_array(([1.0, 2.0, 3.0], [0, 1, 1], [0, 2, 3]), shape=(2, 2))
    scipy.io.savemat(tmp_path / "5.mat", {"K": sparse})
    content = (tmp_path / "5.mat").read_bytes()
    rows = np.array([0, 1, 1], "<i4").tobytes()
    (tmp_path / "5.mat").write_bytes(content.replace(rows, np.array([1, 1, 1], "<i4").tobytes()))
    with h5py.File(tmp_path / "7.mat", "w") as file:
        file.create_group("K").attrs["MATLAB_sparse"] = np.uint64(2)
        file["K/data"], file["K/ir"], file["K/jc"] = sparse.data, [1, 1, 1], sparse.indptr
    for name in ("5.mat", "7.mat"):
        with pytest.raises(MethodError, match="two entries for row 2, column 1 of K, numbers 1 and 2"):
            read_matrices(tmp_path / name)


def test_no_room_for_a_copy_and_no_other_process_are_refusals(tmp_path, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    (tmp_path / "a.uff").write_text(function(np.sin(np.arange(20.0))))
    monkeypatch.setattr("beamsim.measurements.universal.TemporaryDirectory", full)
    with pytest.raises(InputFileError, match=r"written \(No space left on device\)") as refused:
        read_file(tmp_path / "a.uff")
    assert "TMPDIR" in refused.value.remedy
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["time"], file["a"] = np.arange(9.0), np.ones(9)
    monkeypatch.setattr("subprocess.run", full)
    with pytest.raises(InputFileError, match="no other process can be started"):
        read_file(tmp_path / "a.h5")
