"""What a result names is not opened to show it: files that are opened are observed in another process."""

import gzip
import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import h5py
import pytest

from beamsim.files import seal

ROOT = Path(__file__).parents[2]
STORED = ROOT / "tests" / "data" / "results" / "run_chain.h5.gz"
OBSERVED = """
import json, os, sys
opened = []

def note(event, arguments):
    if event == "open" and isinstance(arguments[0], (str, bytes)):
        opened.append(os.path.abspath(os.fsdecode(arguments[0])))

sys.addaudithook(note)
from tests.helpers.commands import invoke
codes = {" ".join(each): invoke(*each).exit_code for each in json.loads(sys.argv[1])}
print(json.dumps([codes, sorted(set(opened))]))
"""
EXCITATION = """excitation:
  kind: harmonic
  applied_to: {mass: 1}
  level: 0.4
  frequency: 0.1
  phase: 0.0
  quantity: force
"""
SAMPLED = "excitation: {{kind: sampled, applied_to: base, quantity: acceleration, file: '{}'}}\n"
STOP = "stiffness: 5.0, gap: 0.2"


def crafted(folder, name, old, new, files=None):
    """The kept result with a changed text of its scenario and records of the files in it, and a right seal."""
    path = folder / f"{name}.h5"
    path.write_bytes(gzip.decompress(STORED.read_bytes()))
    with h5py.File(path, "r+") as file:
        text = str(file.attrs["scenario"])
        assert old in text
        file.attrs["scenario"] = text.replace(old, new)
        file.attrs["input_files"] = json.dumps(files or {})
    seal(path)
    return path


def record_of(file):
    content = file.read_bytes()
    digest = hashlib.sha256(content).hexdigest()
    return {"file": str(file), "folder": str(file.parent), "bytes": len(content), "sha256": digest}


def observed(commands):
    """Exit codes by command, and the files that were opened."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])}
    arguments = [sys.executable, "-c", OBSERVED, json.dumps([[str(each) for each in one] for one in commands])]
    done = subprocess.run(arguments, capture_output=True, text=True, env=environment, timeout=300, check=True)
    return json.loads(done.stdout.splitlines()[-1])


@pytest.fixture
def named(tmp_path):
    """A record, a pipe without a writer and a file of the system, which crafted results name, and these results."""
    secrets = tmp_path / "secrets"
    secrets.mkdir()
    record, pipe, system = secrets / "record.csv", secrets / "pipe.csv", Path("/etc/passwd")
    record.write_text("time (s),acceleration (m/s^2)\n" + "".join(f"{k / 50},{k % 7}\n" for k in range(3001)))
    if hasattr(os, "mkfifo"):
        os.mkfifo(pipe)
    known = {"excitation.file": record_of(record)}
    table = f"force_deflection: {{file: '{record}'}}, gap: 0.2"
    return {record, pipe, system}, [
        crafted(tmp_path, "record", EXCITATION, SAMPLED.format(record), known),
        crafted(tmp_path, "pipe", EXCITATION, SAMPLED.format(pipe)),
        crafted(tmp_path, "system", EXCITATION, SAMPLED.format(system)),
        crafted(tmp_path, "table", STOP, table),
        crafted(tmp_path, "extends", "title:", f"extends: '{record}'\ntitle:"),
    ]


def test_showing_a_result_opens_no_file_that_it_names(named, tmp_path):
    files, results = named
    out, measured = tmp_path / "out", tmp_path / "measured.csv"
    measured.write_text("time (s),one (m/s^2)\n" + "".join(f"{k / 20},{k % 200 - 100}\n" for k in range(800)))
    shown = [
        command
        for path in results
        for command in (
            ("info", path), ("report", path, "-q", "-o", out / f"{path.stem}.html"),
            ("animate", path, "-q", "-o", out / f"{path.stem}_motion.html"),
            *(("export", path, "-q", "-o", out / f"{path.stem}.{form}") for form in ("csv", "mat", "uff")),
            ("compare", path, measured, "-q", "--no-plots", "-o", out / f"{path.stem}_compare.h5"),
        )
    ]  # fmt: skip
    codes, opened = observed([*shown, ("plot", results[0], "-q", "-o", out)])
    assert set(codes.values()) <= {0, 2}
    assert {code for command, code in codes.items() if "extends" in command} == {2}
    assert {code for command, code in codes.items() if command.startswith("animate")} == {2}
    assert sum(code == 0 for code in codes.values()) >= 4 * 5
    assert not {str(file) for file in files} & set(opened)
    here = [Path(path) for path in opened if Path(path).is_relative_to(tmp_path) and not Path(path).is_relative_to(out)]
    written = [path for path in here if path.name.startswith(".beamsim-")]  # temporary files of the command
    assert set(here) <= {*results, measured, *written}


def test_a_file_that_may_be_opened_is_observed(named, tmp_path):
    files, results = named
    _, opened = observed([("animate", results[0], "--open-files", "-q", "-o", tmp_path / "out" / "motion.html")])
    assert str(next(file for file in files if file.name == "record.csv")) in opened
