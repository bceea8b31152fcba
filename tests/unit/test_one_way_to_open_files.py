"""Input files are opened in one module: every other place that opens or reads a file is listed here with its reason."""

import ast
from collections import Counter
from pathlib import Path

import pytest

import beamsim

pytestmark = pytest.mark.quick
PACKAGE = Path(beamsim.__file__).parent
OPENING = {
    "open", "fdopen", "open_code", "read_text", "read_bytes", "FileIO",
    "File", "open_dataset", "open_datatree", "open_groups", "load_dataset", "netcdf_file",
    "loadtxt", "genfromtxt", "fromfile", "memmap", "load", "load_npz", "read_csv", "read_excel", "read_hdf",
    "loadmat", "whosmat", "mmread", "hb_read", "UFF", "OP2", "read_op2", "read_op4", "dir", "rddmig", "rdcards",
    "ZipFile", "TarFile", "is_hdf5", "is_zipfile", "imread", "connect",
}  # fmt: skip
"""Functions of the standard library and of packages that open files, or read open ones."""
PERMITTED = {
    # the one way in, and HDF5 behind it
    ("files.py", "open"): 4,  # two of them to write
    ("hdf5.py", "h5py.File"): 1,
    # readers of what `open_input` has opened: its content, a checked copy, or, of pyYeti, its path
    ("matrix_files.py", "ZipFile"): 1, ("matrix_files.py", "archive.open"): 1, ("matrix_files.py", "np.loadtxt"): 2,
    ("matrix_files.py", "whosmat"): 1, ("matrix_files.py", "loadmat"): 1, ("matrix_files.py", "rdcards"): 1,
    ("matrix_files.py", "dir"): 1, ("matrix_files.py", "load"): 1, ("matrix_files.py", "nastran.OP2"): 1,
    ("measurements/universal.py", "pyuff.UFF"): 1,
    ("measurements/laboratory.py", "open"): 1, ("measurements/laboratory.py", "xarray.load_dataset"): 1,
    # what a process of its own has read, in its temporary folder
    ("measurements/mdf.py", "np.load"): 1,
    # files of this package, and of plotly
    ("flow/compiled.py", "file.read_bytes"): 1, ("report/page.py", "read_text"): 1,
    ("report/page.py", "script.read_bytes"): 1, ("scenario/scenario.py", "read_text"): 1,
    ("store/describe.py", "document.read_text"): 1, ("version.py", "file.read_bytes"): 1,
    # files that are written, one of which is read back at once
    ("matrix_files.py", "open"): 1, ("store/export.py", "open"): 2,
    ("store/export.py", "xr.open_datatree"): 1, ("store/export.py", "tree.load"): 1, ("store/results.py", "open"): 1,
    ("store/results.py", "h5py.File"): 1, ("store/universal.py", "pyuff.UFF"): 1,
    ("structures/named_matrices.py", "open"): 1,
    # the null device in place of closed streams
    ("cli/__init__.py", "open"): 1, ("cli/__init__.py", "os.open"): 1, ("cli/session.py", "os.open"): 1,
}  # fmt: skip


def opening_calls(source):
    """Names of the calls in a source that may open a file, but for functions of this package."""
    tree = ast.parse(source)
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    own = {
        each.asname or each.name for node in imports if (node.module or "").startswith("beamsim") for each in node.names
    }
    own |= {node.name for node in ast.iter_child_nodes(tree) if isinstance(node, ast.FunctionDef)}
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        called = node.func
        if isinstance(called, ast.Name) and called.id in OPENING - own:
            yield called.id
        elif isinstance(called, ast.Attribute) and called.attr in OPENING:
            owner = called.value.id if isinstance(called.value, ast.Name) else ""
            if owner not in own:
                yield f"{owner}.{called.attr}".removeprefix(".")


def test_input_files_are_opened_in_one_place():
    found = Counter(
        (path.relative_to(PACKAGE).as_posix(), name)
        for path in PACKAGE.rglob("*.py")
        for name in opening_calls(path.read_text(encoding="utf-8"))
    )
    found[("files.py", "open")] += found.pop(("files.py", "os.open"))
    assert found == PERMITTED


def test_other_ways_to_open_files_are_seen():
    for source in (
        "def f(p):\n    with open(p) as file: return file", "Path(p).read_text()", "np.load(p)", "h5py.File(p)",
        "x.y.mmread(p)",
        "from scipy.io import loadmat\nloadmat(p)", "os.open(p, 0)", "p.open()", "io.open(p)",
    ):  # fmt: skip
        assert len(list(opening_calls(source))) == 1, source
    assert not list(opening_calls("from beamsim.files import read_text\nread_text(p)"))
