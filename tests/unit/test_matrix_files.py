"""Matrices in files of other programs."""

import struct
import sys
import warnings
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
from scipy.sparse import coo_array, csc_array, save_npz

from beamsim.errors import MethodError
from beamsim.files import bytes_text
from beamsim.matrix_files import FORMATS, read_matrices, read_matrix, read_op4, write_matrices
from tests.helpers.damaged_files import FORMATS as FORMATS_OF_FILES
from tests.helpers.damaged_files import MATRIX, sound

pytestmark = pytest.mark.quick

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    from pyyeti.nastran import op4


def random_matrices():
    rng = np.random.default_rng(3)
    sparse = coo_array(
        (rng.normal(size=40), (rng.integers(0, 30, 40), rng.integers(0, 20, 40))), shape=(30, 20)
    ).tocsc()
    square = rng.normal(size=(6, 6))
    return {"dense": square, "sparse": sparse, "sym": square + square.T}


def dense(values):
    return values.toarray() if hasattr(values, "toarray") else np.asarray(values)


@pytest.mark.parametrize("binary", [False, True])
def test_op4_written_is_read_back_exactly(tmp_path, binary):
    written = random_matrices() | {"long": csc_array(([1.0, -2.5], ([0, 69_999], [0, 1])), shape=(70_000, 2))}
    path = tmp_path / "model.op4"
    write_matrices(path, written, binary=binary)
    read = {matrix.name: matrix.values for matrix in read_op4(path)}
    assert list(read) == list(written)
    for name, values in written.items():
        np.testing.assert_array_equal(dense(read[name]), dense(values))


def test_op4_with_one_triangle_of_a_symmetric_matrix(tmp_path):
    values = np.array(STIFFNESS)
    op4.write(tmp_path / "model.op4", {"k": (np.tril(values), 6), "general": (np.tril(values), 1)}, binary=False)
    symmetric, general = read_matrices(tmp_path / "model.op4")
    np.testing.assert_array_equal(dense(symmetric.values), values)
    np.testing.assert_array_equal(dense(general.values), np.tril(values))


@pytest.mark.parametrize(("binary", "cut"), [(False, 120), (True, 120), (True, 20)])
def test_a_cut_op4_file_is_refused(tmp_path, binary, cut):
    path = tmp_path / "cut.op4"
    write_matrices(path, {"m": np.arange(1.0, 37.0).reshape(6, 6)}, binary=binary)
    path.write_bytes(path.read_bytes()[:-cut])
    with pytest.raises(MethodError, match="cannot be read as OP4"):
        read_matrices(path)


def test_junk_is_no_op2_file(tmp_path):
    (tmp_path / "junk.op2").write_bytes(b"junk" * 30)
    with pytest.raises(MethodError, match="cannot be read as OP2"):
        read_matrices(tmp_path / "junk.op2")


@pytest.mark.parametrize("count", [-32, 0, 4, 2**30])
def test_records_of_an_op2_file_end_where_they_say(tmp_path, count):
    """A negative count of bytes sent pyYeti back to where it had been, for ever."""
    path = tmp_path / "k.op2"
    path.write_bytes(sound("op2", tmp_path))
    np.testing.assert_array_equal(dense(read_matrix(path, "KHH").values), dense(MATRIX))
    content = bytearray(path.read_bytes())
    at = content.index(struct.pack("<i", 36))  # before the first column: its row and four numbers
    content[at : at + 4] = struct.pack("<i", count)
    path.write_bytes(content)
    with pytest.raises(MethodError, match=rf"k\.op2 cannot be read as OP2 \(the record at byte {at} does not end"):
        read_matrices(path)


DMIG_LARGE = """\
$ punched
DMIG    KAAX           0       6       1       0                       3
DMIG*   KAAX                           7               3
*                      7               3 4.000000000D+05
DMIG*   KAAX                           7               5
*                      7               3-1.500000000D+02
*                      7               5 2.000000000D+03
DMIG*   KAAX                         101               0
*                    101               0 9.000000000D+04
"""
STIFFNESS = [[4e5, -150.0, 0.0], [-150.0, 2e3, 0.0], [0.0, 0.0, 9e4]]
NAMES = ((7, "z"), (7, "ry"), (101, "modal"))


def test_dmig_of_large_fields(tmp_path):
    path = tmp_path / "model.pch"
    path.write_text(DMIG_LARGE)
    matrix = read_matrix(path, "kAAx")
    assert matrix.rows == matrix.columns == NAMES
    np.testing.assert_array_equal(dense(matrix.values), STIFFNESS)


@pytest.mark.parametrize(
    ("heading", "column", "expected"),
    [
        ("DMIG,KAAX,0,6,1,0", "DMIG,KAAX,101,,,101,,9.0E4", [[9e4]]),  # blank components of scalar points
        ("DMIG,KAAX,0,6,3,0", "DMIG,KAAX,7,3,,7,3,2.\n,7,5,1.,-1.", [[2.0, 1 - 1j], [1 - 1j, 0.0]]),
        ("DMIG,KAAX,0,2,1,0", "DMIG,KAAX,8,1,,7,3,2.\n,7,5,1.", [[2.0], [1.0]]),
        ("DMIG,KAAX,0,1,1,0", "DMIG,KAAX,7,5,,7,3,2.", [[0.0, 2.0], [0.0, 0.0]]),
        ("DMIG,KAAX,0,9,1,0,,,4", "DMIG,KAAX,2,,,7,3,2.\nDMIG,KAAX,1,,,7,3,1.", [[1.0, 2.0]]),
    ],
)
def test_dmig_of_every_form(tmp_path, heading, column, expected):
    path = tmp_path / "model.bdf"
    path.write_text(f"SOL 101\nBEGIN BULK\nINCLUDE 'elsewhere.bdf'\nGRID,7\n{heading}\n{column}\nDMIGOUT,1\n")
    np.testing.assert_array_equal(dense(read_matrix(path, None).values), expected)


def test_dmig_tells_the_number_that_cannot_be_read(tmp_path):
    path = tmp_path / "model.pch"
    path.write_text(DMIG_LARGE.replace("2.000000000D+03", "2.0000x0000D+03"))
    with pytest.raises(MethodError, match=r"cannot be read as DMIG .*2\.0000x0000D"):
        read_matrices(path)


OF_NASTRAN = Path(op4.__file__).parents[1] / "tests"  # files that Nastran wrote, part of pyYeti


@pytest.mark.skipif(not OF_NASTRAN.is_dir(), reason="pyYeti is installed without its test data")
def test_files_that_nastran_wrote():
    table, punched = (
        {matrix.name: matrix for matrix in read_matrices(OF_NASTRAN / "nastran_dmig_data" / name)}
        for name in ("matrix.op2", "matrix_factory.pch")
    )
    assert {"patrn", "randm", "cmplx"} <= set(punched)
    for name, matrix in punched.items():
        same = table[f"m{name}"]
        assert (matrix.rows, matrix.columns) == (same.rows, same.columns)
        np.testing.assert_allclose(dense(matrix.values), dense(same.values), rtol=1e-6)
    stiffness = read_matrix(OF_NASTRAN / "nas2cam_extseout" / "full.op2", "khh").values
    assert stiffness.shape == (278, 278)
    assert abs(stiffness - stiffness.T).max() <= 1e-6 * abs(stiffness).max()


@pytest.mark.skipif(not OF_NASTRAN.is_dir(), reason="pyYeti is installed without its test data")
def test_damaged_tables_of_an_op2_file_are_refused(tmp_path):
    raw = (OF_NASTRAN / "nastran_dmig_data" / "matrix.op2").read_bytes()
    path = tmp_path / "k.op2"
    no_end, unknown_type = raw.replace(8 * b"\xff", 2 * b"\1\0\0\0"), bytearray(raw)
    first_table = raw.index(struct.pack("<3i", 114, 1, 120))
    unknown_type[first_table + 28 : first_table + 32] = struct.pack("<i", 9)
    for content, message in ((no_end, "a column .* does not end"), (bytes(unknown_type), "is of an unknown type")):
        path.write_bytes(content)
        with pytest.raises(MethodError, match=rf"k\.op2 cannot be read as OP2 \(.*{message}"):
            read_matrices(path)


@pytest.mark.parametrize(
    ("name", "what"),
    [
        ("op2", "up to the 4 x 4 numbers of KHH"), ("op4", "for the {size} of the file"),
        ("op4 binary", "for the {size} of the file"), ("dmig", "for the {size} of the file"),
        ("mtx", "for the {size} of the file"), ("abaqus", "for the {size} of the file"),
        ("hb", "for the {size} of the file"), ("mat5", "to be read from {size}"), ("npz", "for its arrays"),
    ],
)  # fmt: skip
def test_a_matrix_file_without_room_in_memory_is_refused_with_its_size(name, what, tmp_path, monkeypatch):
    path = tmp_path / f"k{FORMATS_OF_FILES[name][0]}"
    path.write_bytes(sound(name, tmp_path))
    size = bytes_text(path.stat().st_size)
    monkeypatch.setattr("beamsim.files.ALWAYS_TRIED", 0)
    monkeypatch.setattr("beamsim.files.free_memory", lambda: 200.0)
    what = what.format(size=size)
    with pytest.raises(
        MethodError, match=rf"= {path.name} needs .* of memory {what}, and 200 bytes are free"
    ) as refused:
        read_matrices(path)
    assert "a machine with more memory" in refused.value.remedy


@pytest.mark.parametrize("ending", FORMATS)
def test_an_empty_file_is_called_that(ending, tmp_path):
    (tmp_path / f"k{ending}").touch()
    with pytest.raises(MethodError, match=rf"= k{ending} is empty"):
        read_matrix(tmp_path / f"k{ending}", None)


def test_a_file_without_a_matrix_is_called_that(tmp_path):
    scipy.io.savemat(tmp_path / "k.mat", {"note": "text"})
    with pytest.raises(MethodError, match=r"= k\.mat holds no matrix"):
        read_matrix(tmp_path / "k.mat", None)


@pytest.mark.parametrize("ending", [".op4", ".op2", ".pch"])
def test_without_pyyeti_a_message_tells_what_to_install(tmp_path, monkeypatch, ending):
    monkeypatch.setitem(sys.modules, "pyyeti", None)
    monkeypatch.setitem(sys.modules, "pyyeti.nastran", None)
    path = tmp_path / f"model{ending}"
    path.write_text("x")
    with pytest.raises(MethodError, match=r"pip install 'beamsim\[nastran\]'"):
        read_matrix(path, None)
    with pytest.raises(MethodError, match=r"pip install 'beamsim\[nastran\]'"):
        write_matrices(path.with_suffix(".op4"), random_matrices())


@pytest.mark.parametrize(
    "text",
    [
        "** MATRIX INPUT\n7,3, 7,3, 4e5\n7,5, 7,3, -150.\n7,5, 7,5, 2000\n101,0, 101,0, 9e4\n",
        "7 3 7 3 4D5\n7 3 7 5 -150.\n7 5 7 5 2000\n101 0 101 0 9e4\n",
    ],
)
def test_abaqus_by_nodes(tmp_path, text):
    path = tmp_path / "job_STIF1.mtx"
    path.write_text(text)
    matrix = read_matrix(path, None)
    assert matrix.rows == NAMES
    np.testing.assert_array_equal(dense(matrix.values), STIFFNESS)


def test_abaqus_by_numbers(tmp_path):
    path = tmp_path / "job_STIF1.mtx"
    path.write_text("1 1 4e5\n2 1 -150\n2 2 2000\n3 3 9e4\n")
    np.testing.assert_array_equal(dense(read_matrix(path, None).values), STIFFNESS)
    path.write_text("1 1 4e5\n2 1\n")
    with pytest.raises(MethodError, match="changed from 3 to 2 at row 2"):
        read_matrix(path, None)


def test_general_formats(tmp_path):
    import h5py

    stiffness = csc_array(np.array(STIFFNESS))
    scipy.io.mmwrite(tmp_path / "k.mtx", stiffness, symmetry="symmetric", precision=17)
    scipy.io.hb_write(tmp_path / "k.hb", stiffness)
    scipy.io.savemat(tmp_path / "k.mat", {"Kxx": stiffness, "Mxx": np.eye(3), "note": "text"})
    save_npz(tmp_path / "k.npz", stiffness)
    np.savez(tmp_path / "both.npz", Kxx=stiffness.toarray(), Mxx=np.eye(3))
    with h5py.File(tmp_path / "new.mat", "w", userblock_size=512) as file:
        group = file.create_group("Kxx")
        group.attrs["MATLAB_sparse"] = 3
        for key, values in (("data", stiffness.data), ("ir", stiffness.indices), ("jc", stiffness.indptr)):
            group[key] = values
        file["Full"] = np.arange(6.0).reshape(2, 3)
    with open(tmp_path / "new.mat", "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file")
    for name, called in (
        ("k.mtx", None), ("k.hb", None), ("k.mat", "KXX"), ("k.npz", None), ("both.npz", "kxx"), ("new.mat", "kxx"),
    ):  # fmt: skip
        np.testing.assert_allclose(
            dense(read_matrix(tmp_path / name, called).values), STIFFNESS, rtol=1e-7, err_msg=name
        )
    np.testing.assert_array_equal(
        dense(read_matrix(tmp_path / "new.mat", "full").values), np.arange(6.0).reshape(2, 3).T
    )


def test_harwell_boeing_of_complex_numbers_without_blanks(tmp_path):
    path = tmp_path / "k.hb"
    path.write_text(
        "damping".ljust(72) + "K".ljust(8) + "\n"
        f"{3:14d}{1:14d}{1:14d}{1:14d}{0:14d}\n"
        f"CUA{2:25d}{2:14d}{2:14d}{0:14d}\n"
        "(3I2)           (2I2)           (1P,4D11.4)         \n"
        " 1 2 3\n 2 1\n"
        "-1.5000D+00-2.5000D+00-3.5000D+00-4.5000D+00\n"
    )
    np.testing.assert_array_equal(dense(read_matrix(path, None).values), [[0, -3.5 - 4.5j], [-1.5 - 2.5j, 0]])


@pytest.mark.parametrize("numbers", ["  1.0E+5-2.0D+003.0E+100", "  1.0E+5  -2.E0  3E+100"])
def test_harwell_boeing_exponents_of_any_length(tmp_path, numbers):
    path = tmp_path / "k.hb"
    path.write_text(
        "stiffness".ljust(72) + "K".ljust(8) + "\n"
        f"{3:14d}{1:14d}{1:14d}{1:14d}{0:14d}\n"
        f"RSA{2:25d}{2:14d}{3:14d}{0:14d}\n"
        "(3I4)           (3I4)           (3E8.1)             \n"
        "   1   3   4\n   1   2   2\n"
        f"{numbers}\n"
    )
    np.testing.assert_array_equal(dense(read_matrix(path, None).values), [[1e5, -2.0], [-2.0, 3e100]])


def test_harwell_boeing_with_one_triangle(tmp_path):
    path = tmp_path / "k.rsa"
    path.write_text(
        "stiffness".ljust(72) + "K".ljust(8) + "\n"
        f"{3:14d}{1:14d}{1:14d}{1:14d}{0:14d}\n"
        f"RSA{3:25d}{3:14d}{4:14d}{0:14d}\n"
        "(4I8)           (4I8)           (4E16.8)            \n"
        f"{1:8d}{3:8d}{4:8d}{5:8d}\n{1:8d}{2:8d}{2:8d}{3:8d}\n"
        f"{4e5:16.8E}{-150.0:16.8E}{2e3:16.8E}{9e4:16.8E}\n"
    )
    np.testing.assert_array_equal(dense(read_matrix(path, None).values), STIFFNESS)


@pytest.mark.parametrize("name", ["missing.op4", "missing.mtx", "missing.mat", "matrix.txt"])
def test_a_file_that_does_not_exist_or_has_an_unknown_ending(tmp_path, name):
    with pytest.raises(MethodError, match=r"does not exist|unknown ending"):
        read_matrix(tmp_path / name, None)


def test_names_that_the_file_does_not_have(tmp_path):
    path = tmp_path / "model.op4"
    write_matrices(path, random_matrices())
    with pytest.raises(MethodError, match=r"= kxx is not a matrix of model.op4; it holds dense, sparse, sym"):
        read_matrix(path, "kxx")
    with pytest.raises(MethodError, match="holds 3 matrices; name one: dense, sparse, sym"):
        read_matrix(path, None)


TWICE = """DMIG    KAA     0       6       1       0
DMIG    KAA     1       1               1       1       2.0
DMIG    MAA     0       6       1       0
DMIG    MAA     1       1               1       1       1.0
"""


@pytest.mark.parametrize("binary", [False, True])
def test_a_matrix_that_an_op4_file_holds_twice_is_refused_with_both_places(tmp_path, binary):
    path, k = tmp_path / "twice.op4", np.array(STIFFNESS)
    op4.write(str(path), ["KAA", "MAA", "KAA"], [k, k, 2 * k], binary=binary)
    np.testing.assert_array_equal(dense(read_matrix(path, "maa").values), k)
    with pytest.raises(MethodError, match=r"2 matrices kaa: matrix 1 of the file and matrix 3 of the file"):
        read_matrix(path, "KAA")


@pytest.mark.parametrize(
    ("text", "places"),
    [
        (TWICE + "$ the second subcase\n" + TWICE, "line 1 and line 6"),
        (TWICE + TWICE.replace("    ", ",", 1).replace("DMIG,KAA     0       6", "DMIG,KAA,0,6"), "line 1 and line 5"),
        ("$\n" + TWICE.replace("DMIG    KAA     0       6", f"DMIG*   KAA{0:>29}{6:>16}") + TWICE, "line 2 and line 6"),
    ],
)
def test_a_matrix_that_a_punch_file_holds_twice_is_refused_with_both_lines(tmp_path, text, places):
    path = tmp_path / "twice.pch"
    path.write_text(text)
    with pytest.raises(MethodError, match=f"holds 2 matrices kaa: {places}"):
        read_matrix(path, "kaa")


@pytest.mark.parametrize(
    ("name", "text", "places"),
    [
        ("a.dmig", TWICE + "DMIG    KAA     1       1               1       1       2.0\n", "numbers 1 and 2"),
        ("a.mtx", 2 * "*MATRIX INPUT\n1,1,1,1,2.0\n1,1,2,1,-1.0\n2,1,2,1,3.0\n", "node 1 1, numbers 1 and 4"),
        ("a.mtx", "1 1 2.0\n1 2 -1\n2 2 3\n1 1 5\n", "row 1, column 1, numbers 1 and 4"),
        (
            "a.mtx",
            "%%MatrixMarket matrix coordinate real general\n2 2 3\n2 1 2.0\n2 2 3\n2 1 5\n",
            "row 2, column 1, numbers 1 and 3",
        ),
    ],
)
def test_entries_of_one_place_are_not_summed(tmp_path, name, text, places):
    """Two matrices in one file would be added."""
    (tmp_path / name).write_text(text)
    with pytest.raises(MethodError, match=places):
        read_matrix(tmp_path / name, "kaa" if name.endswith("dmig") else None)


def test_matrices_in_structs_of_matlab_are_found_by_their_path(tmp_path):
    k, parts = np.array(STIFFNESS), np.zeros((1, 2), dtype=[("K", "O"), ("name", "O")])
    parts[0, 0], parts[0, 1] = (k, "panel"), (2 * k, "rib")
    model = {"K": k, "note": "text", "inner": {"M": csc_array(k)}}
    scipy.io.savemat(tmp_path / "five.mat", {"model": model, "parts": parts, "K": 3 * k, "k": 4 * k})
    found = {each.name: dense(each.values) for each in read_matrices(tmp_path / "five.mat")}
    factors = {"model.K": 1, "model.inner.M": 1, "parts(1).K": 1, "parts(2).K": 2, "K": 3, "k": 4}
    assert found.keys() == factors.keys()
    for name, factor in factors.items():
        np.testing.assert_array_equal(found[name], factor * k)
        np.testing.assert_array_equal(dense(read_matrix(tmp_path / "five.mat", name).values), factor * k)
    with pytest.raises(MethodError, match=r"it holds model\.K"):
        read_matrix(tmp_path / "five.mat", "stiffness")


def test_matrices_in_structs_of_matlab_7_3_are_found_by_their_path(tmp_path):
    k = np.array(STIFFNESS) + np.triu(np.ones((len(STIFFNESS), len(STIFFNESS))))
    with h5py.File(tmp_path / "new.mat", "w", userblock_size=512) as file:
        for path, kind in (("model", "struct"), ("model/inner", "struct")):
            file.create_group(path).attrs["MATLAB_class"] = np.bytes_(kind)
        for path, values, kind in (
            ("model/inner/M", k.T, "double"),
            ("model/note", np.array([[75], [76]], dtype="u2"), "char"),
        ):
            file.create_dataset(path, data=values).attrs["MATLAB_class"] = np.bytes_(kind)
    np.testing.assert_array_equal(dense(read_matrix(tmp_path / "new.mat", "MODEL.inner.m").values), k)
    assert [each.name for each in read_matrices(tmp_path / "new.mat")] == ["model.inner.M"]


def test_a_variable_that_a_matlab_file_holds_twice_is_refused(tmp_path):
    for number, name in enumerate(("one.mat", "other.mat"), 1):
        scipy.io.savemat(tmp_path / name, {"K": number * np.array(STIFFNESS)})
    header = 128  # bytes before the first variable
    both = (tmp_path / "one.mat").read_bytes() + (tmp_path / "other.mat").read_bytes()[header:]
    (tmp_path / "both.mat").write_bytes(both)
    with pytest.raises(MethodError, match="the variable K occurs twice, as number 1 and 2"):
        read_matrix(tmp_path / "both.mat", "K")
