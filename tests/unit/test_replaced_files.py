"""What becomes of the file in the place of a new one: `beamsim.files.destination` and the results that ask it."""

import dataclasses
import errno
import os
import re
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from pathlib import Path

import h5py
import pytest
from sampling import first_apart

from beamsim.errors import NotWrittenError, ResultFileError
from beamsim.files import Content, destination, protect, protected_files, replacement_file
from beamsim.outcomes import Outcome, OutcomeKind
from beamsim.store import results
from beamsim.store.results import keep_result, load, write_result
from tests.fabricated import FabricatedScenario

PARTIAL = Outcome.of(OutcomeKind.INTERRUPTED, "interrupted", "interrupted")


@dataclasses.dataclass(frozen=True)
class OtherScenario(FabricatedScenario):
    def to_yaml(self):
        return super().to_yaml() + "# another\n"


@pytest.fixture
def whole(fabricated_run):
    return fabricated_run()


@pytest.fixture
def part(fabricated_run):
    return fabricated_run(outcome=PARTIAL)


def written(result, path, **options):
    """Write a result as a command of its own does."""
    with protected_files([]):
        return write_result(result, path, **options)


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.parametrize("new", [Content.OUTPUT, Content.RESULT, Content.PARTIAL, Content.JOURNAL])
@pytest.mark.parametrize("found", Content)
def test_every_pair_of_contents(new, found, tmp_path):
    path = tmp_path / "case.h5"
    assert not destination(path, new, lambda _: found).moves_aside  # nothing is there
    path.touch()
    assert not destination(path, new, lambda _: found).moves_aside  # nothing is in it
    path.write_text("x")
    decided = destination(path, new, lambda there: found if there == path else Content.OUTPUT)
    beside = new is Content.PARTIAL and found is Content.RESULT
    assert decided.path == (tmp_path / "case_partial.h5" if beside else path)
    assert decided.moves_aside == (found in (Content.PARTIAL, Content.JOURNAL, Content.UNKNOWN))


def test_a_complete_result_stays_where_a_partial_one_is_written(whole, part, tmp_path):
    path = written(whole, tmp_path / "case.h5")
    before = path.read_bytes()
    with protected_files([]):
        assert write_result(part, path) == write_result(part, path) == tmp_path / "case_partial.h5"
        assert path.read_bytes() == before
        assert load(tmp_path / "case_partial.h5").outcome.cut_short
        assert write_result(whole, path) == path
    assert list(contents(tmp_path)) == ["case.h5"]  # the partial one of the same command is contained in it


def test_a_partial_result_is_moved_aside_unless_the_new_one_contains_it(whole, part, tmp_path, caplog):
    path = tmp_path / "case.h5"
    of_another = dataclasses.replace(whole, scenario=OtherScenario())
    for new, options, kept in (
        (part, {}, True),
        (part, {"resumed": True}, False),
        (whole, {}, False),
        (of_another, {}, True),
        (of_another, {"resumed": True}, True),
    ):
        path.unlink(missing_ok=True)
        before = written(part, path).read_bytes()
        caplog.clear()
        assert written(new, path, **options) == path
        aside = tmp_path / "case.h5.1"
        assert aside.exists() == kept
        if kept:
            assert aside.read_bytes() == before
            assert "case.h5 held a partial result; it is kept in" in caplog.text
            aside.unlink()
        assert list(contents(tmp_path)) == ["case.h5"]


def test_names_of_files_that_are_moved_aside_are_free(part, tmp_path):
    path = tmp_path / "case.h5"
    (tmp_path / "case.h5.1").write_text("somebody's")
    (tmp_path / "case.h5.2").symlink_to("nowhere")
    for _ in range(3):
        written(part, path)
    assert sorted(os.listdir(tmp_path)) == ["case.h5", *(f"case.h5.{k}" for k in (1, 2, 3, 4))]
    assert (tmp_path / "case.h5.1").read_text() == "somebody's"


def damaged(path):
    path.write_bytes(path.read_bytes()[:3000])


def of_another_layout(path):
    with h5py.File(path, "r+") as file:
        file.attrs["schema_version"] = 1


def of_another_program(path):
    with h5py.File(path, "w") as file:
        file["strain"] = [1.0, 2.0]


def without_outcome(path):
    with h5py.File(path, "r+") as file:
        del file.attrs["outcome"]


def no_hdf5(path):
    path.write_text("the only copy of something else")


@first_apart(
    ("change", "outcome"),
    3,
    [
        *product([damaged, of_another_layout], [PARTIAL, None]),
        *product([of_another_program, without_outcome, no_hdf5], [None]),
    ],
)
def test_what_is_no_result_of_this_version_is_moved_aside(
    change, outcome, whole, part, tmp_path, caplog, without_examination
):
    caplog.clear()
    path = written(whole, tmp_path / "case.h5")
    change(path)
    before = path.read_bytes()
    written(part if outcome else whole, path)
    assert (tmp_path / "case.h5.1").read_bytes() == before
    assert "cannot be read as a result or a journal of this version; it is kept in" in caplog.text
    assert load(path).outcome.cut_short == bool(outcome)


def test_a_complete_result_with_damaged_arrays_still_counts_as_complete(whole, part, tmp_path, without_examination):
    path = written(whole, tmp_path / "case.h5")
    with h5py.File(path, "r") as file:
        at = file["/histories/time"].id.get_chunk_info(0).byte_offset
    content = bytearray(path.read_bytes())
    content[at : at + 8] = b"\xff" * 8
    path.write_bytes(content)
    with pytest.raises(ResultFileError, match="damaged"):
        load(path)
    assert written(part, path) == tmp_path / "case_partial.h5"
    assert path.read_bytes() == content


def test_only_attributes_of_the_older_file_are_read_and_only_once(whole, part, tmp_path, monkeypatch):
    path, opened = written(part, tmp_path / "case.h5"), []

    def counting(file, *given, real=results.open_result):
        opened.append(file)
        return real(file, *given)

    monkeypatch.setattr(results, "open_result", counting)
    monkeypatch.setattr(results, "read_items", None)
    with protected_files([]):
        for _ in range(5):
            write_result(part, path, resumed=True)
    assert len(opened) == 1


def test_two_commands_on_one_file_lose_nothing(whole, part, tmp_path):
    """Each has a thread of its own, and so knows nothing of the other, like processes; they save by turns."""
    path = tmp_path / "case.h5"
    own = [dataclasses.replace(part, wall_time_s=float(k)) for k in (1, 2)]
    scopes, threads = [protected_files([]), protected_files([])], [ThreadPoolExecutor(1), ThreadPoolExecutor(1)]

    def save(k, result):
        return threads[k].submit(write_result, result, path).result()

    with threads[0], threads[1]:
        for thread, scope in zip(threads, scopes, strict=True):
            thread.submit(scope.__enter__).result()
        for _ in range(3):
            for k in (0, 1):
                save(k, own[k])
        kept = [load(file).wall_time_s for file in tmp_path.iterdir()]
        save(1, whole)  # which contains what its own command saved before
        last = save(0, own[0])
        for thread, scope in zip(threads, scopes, strict=True):
            thread.submit(scope.__exit__, None, None, None).result()
    assert sorted(kept) == [1.0, 1.0, 2.0]  # the first file of one was moved aside by the other
    assert last != path
    assert load(path).complete
    assert load(last).wall_time_s == 1.0


@pytest.mark.parametrize("old", [PARTIAL, None])
def test_a_failure_at_the_last_step_leaves_the_older_file(old, whole, part, fabricated_run, tmp_path, monkeypatch):
    path = written(part if old else whole, tmp_path / "case.h5")
    before = contents(tmp_path)

    def fail(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(NotWrittenError, match="No space left on device"):
        written(dataclasses.replace(whole, scenario=OtherScenario()), path)
    assert contents(tmp_path) == before


def test_a_file_system_without_links_renames(part, tmp_path, monkeypatch):
    def refuse(*_):
        raise OSError(errno.EPERM, "Operation not permitted")

    path = written(part, tmp_path / "case.h5")
    before = path.read_bytes()
    monkeypatch.setattr(os, "link", refuse)
    written(part, path)
    assert (tmp_path / "case.h5.1").read_bytes() == before
    assert path.exists()

    def fail(*_):
        raise OSError(errno.EIO, "Input/output error")

    before = contents(tmp_path)
    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(NotWrittenError):
        written(part, path)
    assert contents(tmp_path) == before


def test_a_link_is_followed_and_its_file_moved_aside(part, tmp_path):
    disk = tmp_path / "disk"
    disk.mkdir()
    link = tmp_path / "case.h5"
    link.symlink_to(disk / "big.h5")
    for _ in range(2):
        assert written(part, link) == link
    assert link.is_symlink()
    assert sorted(os.listdir(disk)) == ["big.h5", "big.h5.1"]


def test_an_output_that_became_a_folder_is_written_elsewhere(whole, tmp_path, monkeypatch):
    monkeypatch.setattr(results.tempfile, "tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    (tmp_path / "case.h5").mkdir()
    with pytest.raises(NotWrittenError, match="it is a folder") as raised:
        keep_result(whole, tmp_path / "case.h5")
    assert load(re.search(r"is in (\S+\.h5)", str(raised.value))[1]).complete
    assert raised.value.exit_code == 5


def test_an_output_folder_that_vanished_is_made_again(whole, tmp_path):
    assert load(keep_result(whole, tmp_path / "gone" / "deep" / "case.h5")).complete


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
def test_only_regular_files_are_replaced(tmp_path):
    os.mkfifo(tmp_path / "pipe.h5")
    (tmp_path / "link.h5").symlink_to("pipe.h5")
    for name in ("pipe.h5", "link.h5"):
        with pytest.raises(ResultFileError, match="not a regular file"):
            destination(tmp_path / name)


def test_a_file_that_is_read_is_refused_by_every_name(tmp_path, monkeypatch):
    """By a relative path, a link, a hard link, and a path through another folder."""
    monkeypatch.chdir(tmp_path)
    read = Path("a.h5")
    read.write_text("x")
    os.link(read, "hard.h5")
    os.symlink("a.h5", "soft.h5")
    os.mkdir("folder")
    for new in Content:
        for name in ("a.h5", "hard.h5", "soft.h5", "folder/../a.h5", tmp_path / "a.h5"):
            with protected_files([]):
                protect(read)
                with pytest.raises(ResultFileError, match="reads that file"):
                    destination(name, new)
    with protected_files([]):
        protect(read)
        with replacement_file("b.h5") as temporary:
            temporary.write_text("y")
    assert read.read_text() == "x"
