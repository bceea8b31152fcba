"""Studies on a Dask cluster that loses its parts, with Dask's own processes on this machine."""

import json
import os
import subprocess
import sys
import time
from contextlib import contextmanager

import pytest
from sampling import needs

from beamsim.version import __version__

pytestmark = needs("distributed")
CASE = """\
chain: {masses: [1 kg], springs: [1 kN/m]}
snubbers: [{name: stop, mass: 1, side: below, gap: 1 mm, stiffness: 1e5}]
excitation: {kind: harmonic, applied_to: base, frequency: 5 Hz, level: 2}
run: {duration: 20 s, convergence: off}
vary:
  kind: grid
  responses: [peak_force]
  parameters: [{path: snubbers.stop.gap, from: 0 mm, to: 3 mm, points: POINTS}]
"""
HERE = f"Python {sys.version_info.major}.{sys.version_info.minor}"


@contextmanager
def started(*words, **options):
    process = subprocess.Popen([sys.executable, "-m", *map(str, words)], text=True, **options)
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def until(condition, seconds=60.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "too late"
        time.sleep(0.05)


@pytest.fixture
def scheduler(tmp_path):
    """A scheduler and its address."""
    file = tmp_path / "scheduler.json"
    words = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", file)
    with started("distributed.cli.dask_scheduler", *words, stderr=subprocess.DEVNULL) as process:
        until(file.exists)
        time.sleep(0.5)
        yield process, json.loads(file.read_text())["address"]


def worker(address, *words):
    words = (address, "--nthreads", "1", "--no-dashboard", *words)
    return started("distributed.cli.dask_worker", *words, stderr=subprocess.DEVNULL)


def sweep(folder, address, *words, points=20):
    (folder / "case.yaml").write_text(CASE.replace("POINTS", str(points)))
    command = ("beamsim", "sweep", "case.yaml", "--no-plots", "--scheduler", address, *words)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([os.getcwd(), os.environ.get("PYTHONPATH", "")])}
    return started(*command, cwd=folder, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, env=environment)


def ended(process):
    text = process.communicate(timeout=240)[1]
    print(text)
    assert "internal error" not in text
    assert "Traceback" not in text
    return process.returncode, " ".join(text.split())


def test_a_scheduler_that_dies(scheduler, tmp_path):
    process, address = scheduler
    journal = tmp_path / "case.h5.partial"
    with worker(address), sweep(tmp_path, address, points=2000) as study:
        until(lambda: journal.exists() and journal.read_bytes().count(b"\n") > 5)
        process.kill()
        code, text = ended(study)
    assert code == 3, text
    kept = journal.read_bytes().count(b"\n") - 1
    assert f"{kept} of 2000 cases are kept in case.h5.partial; --resume computes the others" in text
    assert f"lost the connection to the cluster at {address}" in text


def test_no_worker_is_waited_for_as_long_as_asked(scheduler, tmp_path):
    with sweep(tmp_path, scheduler[1], "--wait-for-workers", "33") as study:
        code, text = ended(study)
    assert code == 3, text
    assert "has had no workers for 30 s; waiting for up to 33 s (--wait-for-workers); start some with" in text
    assert "has had no workers for 33 s" in text
    assert "remain" not in text


def test_a_worker_that_comes_late_is_used(scheduler, tmp_path):
    with sweep(tmp_path, scheduler[1]) as study:
        time.sleep(3.0)
        with worker(scheduler[1]):
            code, text = ended(study)
    assert code == 0, text


@pytest.mark.parametrize(
    ("preload", "theirs"),
    [
        (
            "import beamsim.version; beamsim.version.__version__ = '0.0.1'\n"
            "import platform; platform.python_version = lambda: '3.99.1'",
            "beamsim 0.0.1 with Python 3.99",
        ),
        ("import sys; sys.modules['beamsim'] = None", f"with {HERE}, this command"),
        (
            "import beamsim.version; beamsim.version.code_digest = lambda: 'abc'\n"
            "import importlib.metadata as m; m.version = lambda name: '1.99'",
            f"with {HERE}, numpy 1.99, scipy 1.99, numba 1.99, code abc, this command",
        ),
    ],
    ids=["beamsim and Python", "no beamsim", "packages and code"],
)
def test_a_worker_of_another_version_is_refused(scheduler, tmp_path, preload, theirs):
    (tmp_path / "preload.py").write_text(preload)
    with worker(scheduler[1], "--no-nanny", "--preload", tmp_path / "preload.py"):
        time.sleep(4.0)
        with sweep(tmp_path, scheduler[1]) as study:
            code, text = ended(study)
    assert code == 2, text
    assert theirs in text
    assert f"this command beamsim {__version__} with {HERE}" in text
