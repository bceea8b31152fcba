"""Commands that a signal reaches end before their work is done, with what was found kept."""

import os
import signal
import subprocess
import sys
import time
from itertools import cycle
from pathlib import Path

import pytest

import beamsim

CONFIGS = Path(__file__).parents[2] / "configs"
UNDER_WAY = 5.0  # s of processor time at most; twice what imports, kernels and the first result take on a slow machine
HANG = 180.0  # s, far above the second or so of processor time that ending takes
# command, what makes it long (minutes), what makes it short
CASES = {
    "run": (
        "run one_sided_65hz.yaml", ("run.duration=2000 s", "run.sample_rate=200 Hz"), ("run.duration=1 s",),
    ),
    "stiff run": (
        "run one_sided_65hz.yaml", ("run.duration=500 s", "run.sample_rate=200 Hz", "snubbers[0].stiffness=1e8"),
        ("run.duration=1 s",),
    ),
    "random run": (
        "run random_vibration.yaml", ("run.duration=40 s", "run.sample_rate=10 kHz"), ("run.duration=2 s",),
    ),
    "stepped sine": (
        "sweep one_sided_65hz.yaml", ("sweep={kind: stepped, from: 78 Hz, to: 400 Hz, points: 2000}",),
        ("sweep={kind: stepped, from: 78 Hz, to: 80 Hz, points: 2}",),
    ),
    "continuation": (
        "sweep continuation_60_120hz.yaml", ("sweep.from=20 Hz", "sweep.to=400 Hz"), ("sweep.to=63 Hz",),
    ),
    "nnm": ("nnm nnm_thesis_mode_2.yaml", ("beam.elements=60",), ("nnm.continue_in.to=0.05",)),
}  # fmt: skip
COMMAND = """
import signal
import beamsim.cli
signal.signal(signal.SIGINT, signal.default_int_handler)  # the tests may run where it is ignored
beamsim.cli.main()
"""


def processor_time(pid):
    """s of a process and of its children that ended."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")


def arguments(name, overrides):
    command, config = CASES[name][0].split()
    sets = [x for override in overrides for x in ("--set", override)]
    return [sys.executable, "-c", COMMAND, command, str(CONFIGS / config), *sets, "--no-plots", "-o", "case.h5"]


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """Run a short form of a case to its end, once, so that its kernels are compiled.

    Returns the processor time in s after which a long one is under way.
    """
    done = {}

    def run(name):
        if name not in done:
            folder, before = tmp_path_factory.mktemp("short"), os.times()
            subprocess.run(arguments(name, CASES[name][2]), cwd=folder, check=True, capture_output=True)
            after = os.times()
            whole = after.children_user + after.children_system - before.children_user - before.children_system
            done[name] = min(1.5 * whole + 1.0, UNDER_WAY)
        return done[name]

    return run


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processor time of another process is read from /proc")
@pytest.mark.parametrize(
    ("name", "number"), list(zip(CASES, cycle([signal.SIGTERM, signal.SIGINT]), strict=False))
)  # one handler serves both: tests/cli/test_interruption.py
def test_a_command_ends_at_a_signal_with_what_there_is(name, number, compiled, tmp_path):
    under_way = compiled(name)
    with (tmp_path / "errors").open("w") as errors:
        process = subprocess.Popen(
            arguments(name, CASES[name][1]), cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=errors
        )
        try:
            while processor_time(process.pid) < under_way:
                assert process.poll() is None, (tmp_path / "errors").read_text()
                time.sleep(0.02)
            process.send_signal(number)
            process.wait(timeout=HANG)
        except BaseException:
            process.kill()
            process.wait()
            raise
    text = (tmp_path / "errors").read_text()
    assert process.returncode == 128 + number, text
    assert "Traceback" not in text
    assert (tmp_path / "case.h5").exists(), text
    assert beamsim.open_result(tmp_path / "case.h5").outcome.interrupted


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processor time of another process is read from /proc")
@pytest.mark.parametrize("name", ["run", "continuation"])
def test_a_command_ends_while_it_compiles(name, tmp_path):
    """The kernel that is being compiled is finished; the motion ends before it has gone far."""
    cache = tmp_path / "cache"
    cache.mkdir()
    process = subprocess.Popen(
        arguments(name, CASES[name][1]), cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        env={**os.environ, "NUMBA_CACHE_DIR": str(cache)},
    )  # fmt: skip
    try:
        while not list(cache.rglob("*.nbc")):  # the first inner function is there
            assert process.poll() is None
            time.sleep(0.02)
        process.send_signal(signal.SIGTERM)
        _, errors = process.communicate(timeout=HANG)
    except BaseException:
        process.kill()
        process.wait()
        raise
    assert process.returncode == 128 + signal.SIGTERM, errors
    assert "beamsim: interrupted; " in errors.splitlines()[-1]
    assert "Traceback" not in errors
