"""Every file comes in through one function, which refuses what is not a regular file and what is too large."""

import os
import socket
from pathlib import Path

import h5py
import pytest

from beamsim.analyses.compare_modes.analysis import read_shapes
from beamsim.errors import BeamsimError, InputFileError
from beamsim.files import open_input, open_to_append, read_input, read_text
from beamsim.hdf5 import open_hdf5
from beamsim.matrix_files import FORMATS, read_matrices
from beamsim.measurements.channels import read_signals
from beamsim.measurements.read import TEXT
from beamsim.scenario import load_scenario
from beamsim.store.results import load
from beamsim.store.studies import opened_journal
from beamsim.structures.named_matrices import read_dof_table
from beamsim.system.build import build_system

pytestmark = pytest.mark.quick
NEEDS_PIPES = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes and links of POSIX")
BEAM = """beam: {length: 270 mm, width: 50 mm, thickness: 5 mm, youngs_modulus: 69 GPa, density: 2700 kg/m^3}
"""


def places(folder):
    """By kind a place that is no regular file, and a word of what is said about it."""
    os.mkfifo(folder / "pipe")
    (folder / "linked").symlink_to("pipe")
    (folder / "loop").symlink_to("back")
    (folder / "back").symlink_to("loop")
    (folder / "nowhere").symlink_to("gone")
    (folder / "zeros").symlink_to("/dev/zero")
    (folder / "within").mkdir()
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(str(folder / "socket"))
    listener.close()
    return {
        "pipe": "is a pipe", "linked": "is a pipe", "loop": "leads back to itself", "nowhere": "does not exist",
        "zeros": "is a device", "within": "is a folder", "socket": "is a socket",
    }  # fmt: skip


@NEEDS_PIPES
def test_only_regular_files_are_opened(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # the name of a socket may be no longer than 107 characters
    for name, message in places(Path()).items():
        with pytest.raises(InputFileError, match=message) as refused:
            open_input(name)
        assert name in str(refused.value)
        assert refused.value.exit_code == 2
        if name != "nowhere":  # which is made where the link leads
            with pytest.raises(InputFileError, match=message):
                open_to_append(name)
    Path("file").write_bytes(b"content")
    Path("link").symlink_to("file")
    with open_input("link") as file:
        assert file.read() == b"content"
        assert file.name == "link"


def test_a_journal_too_large_for_memory_is_refused(tmp_path):
    path = tmp_path / "case.h5.partial"
    with open(path, "wb") as file:
        file.truncate(2**40)
    message = r"case\.h5\.partial needs 11 TB of memory for its cases.*leave out --resume to move it aside"
    with pytest.raises(InputFileError, match=message), opened_journal(path, "study", resume=True):
        pass
    with opened_journal(path, "study", resume=False):
        assert path.stat().st_size == 2**40


def readers():
    """By name, with the ending of its files, every reader of a file."""
    yield "scenario", ".yaml", load_scenario
    yield "extends", ".yaml", lambda path: load_scenario({"extends": str(path)})
    yield "result", ".h5", load
    for ending in (*TEXT, ".h5", ".nc", ".mat", ".uff"):
        yield "record", ending, read_signals
    for ending in FORMATS:
        yield "matrices", ending, read_matrices
    for ending in (".csv", ".uff"):
        yield "shapes", ending, lambda path: read_shapes(path, load_scenario(BEAM))
    yield "table of degrees of freedom", ".csv", read_dof_table
    for key in ("excitation", "pad", "dofs"):
        yield key, ".csv", lambda path, key=key: build(path, key)


def build(path, key):
    case = {
        "excitation": "excitation: {kind: sampled, applied_to: base, file: 'FILE'}\nrun: {duration: 1 s}\n",
        "pad": "snubbers: [{position: 0.27, side: below, force_deflection: 'FILE'}]\n",
        "dofs": "",
    }[key].replace("FILE", str(path))
    imported = f"""bodies: {{a: {{kind: matrices, dofs: '{path}', mass: {{file: m.mtx}}, stiffness: {{file: m.mtx}},
      base: {{nodes: [1], direction: z}}}}}}
"""
    return build_system(load_scenario(imported if key == "dofs" else BEAM + case))


@NEEDS_PIPES
@pytest.mark.parametrize(("ending", "read"), [pytest.param(*each, id=name + each[0]) for name, *each in readers()])
def test_every_reader_refuses_what_is_no_regular_file(ending, read, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.mtx").write_text("%%MatrixMarket matrix coordinate real general\n1 1 1\n1 1 2.0\n")
    for name, message in places(Path()).items():
        place = Path(f"{name}{ending}")
        place.symlink_to(name)
        with pytest.raises((BeamsimError, InputFileError), match=f"{message}|no such result"):
            read(place)


def test_sizes_are_bounded_before_anything_is_read(tmp_path):
    large = tmp_path / "large.csv"
    with open(large, "wb") as file:
        file.truncate(2**40)  # takes no room on the disk
    with pytest.raises(InputFileError, match=r"large\.csv has 1\.1 TB, more than the 1 GB of the largest"):
        read_text(large)
    with pytest.raises(
        InputFileError, match=r"large\.csv needs 1\.1 TB of memory to be read from 1\.1 TB, and .* are free"
    ):
        read_input(large, most_bytes=2**41)
    with pytest.raises(BeamsimError, match=r"large\.yaml: has 1\.1 TB, more than the 4 MB"):
        load_scenario(large.rename(tmp_path / "large.yaml"))


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="files without a size of Linux")
def test_files_of_the_system_have_no_size():
    with pytest.raises(InputFileError, match="a file of the system"):
        read_input("/proc/self/status")


def test_an_hdf5_file_links_to_no_other_file(tmp_path):
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["a"] = [1.0, 2.0, 3.0]
    with h5py.File(tmp_path / "linked.h5", "w") as file:
        file["group/time"] = [0.0, 0.1, 0.2]
        file["group/alias"] = h5py.SoftLink("/group/time")
    open_hdf5(tmp_path / "linked.h5").close()
    with h5py.File(tmp_path / "linked.h5", "a") as file:
        file["group/a"] = h5py.ExternalLink("other.h5", "a")
    for read in (open_hdf5, load, read_signals):
        with pytest.raises(BeamsimError, match="has group/a in another file"):
            read(tmp_path / "linked.h5")
