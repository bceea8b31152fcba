"""Ending early: what was found is kept, by the Python functions and by the commands that a signal reaches."""

import os
import signal
import subprocess
import sys
from itertools import count
from pathlib import Path

import numpy as np
import pytest

import beamsim
from beamsim.analyses.nnm.analysis import nnm
from beamsim.analyses.response.analysis import frequency_response
from beamsim.cli.conclusion import exit_code
from beamsim.cli.interruption import interruptible
from beamsim.outcomes import COMPLETE
from beamsim.plots.continuation import frequency_response_figures
from beamsim.plots.nnm import nnm_figures
from beamsim.scenario import load_scenario
from beamsim.store.results import open_nnm, open_response

CONFIGS = Path(__file__).parents[2] / "configs"
MODE, RESPONSE = CONFIGS / "nnm_chain_mass_5.yaml", CONFIGS / "chain_two_dof.yaml"
POINTS = 5


def after(points):
    """Ask for the end once so many points are there."""
    asked = count(1)
    return lambda: next(asked) >= points


# --- from Python ------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def mode():
    return nnm(load_scenario(MODE))


@pytest.fixture(scope="module")
def response():
    return frequency_response(load_scenario(RESPONSE))


@pytest.mark.parametrize("points", [1, 20])
def test_a_mode_keeps_the_points_it_has(mode, points):
    part = nnm(load_scenario(MODE), stop=after(points))
    assert mode.complete  # the twin that is not stopped
    assert part.status == f"interrupted at stiffness factor {part.backbone.parameter[-1]:.6g}"
    assert part.summary["status"] == part.status
    assert part.backbone.parameter.size == points < mode.backbone.parameter.size
    np.testing.assert_array_equal(part.backbone.initial_displacement, mode.backbone.initial_displacement[:points])
    nnm_figures(part)


@pytest.mark.parametrize("points", [1, 20])
def test_a_response_keeps_the_points_it_has(response, points):
    part = frequency_response(load_scenario(RESPONSE), stop=after(points))
    assert response.complete
    assert part.status.startswith("interrupted; range not covered: 0.0795")
    (branch,) = part.branches
    own, whole = branch.floquet_multipliers, response.branches[0].floquet_multipliers
    assert points <= len(own) < len(whole)  # special points are points too
    np.testing.assert_array_equal(own, whole[: len(own)])
    frequency_response_figures(part)


def test_what_was_not_begun_is_named():
    part = frequency_response(load_scenario(RESPONSE, ["sweep.levels=[0.1 N, 0.2 N, 0.3 N]"]), stop=after(2))
    assert part.status.startswith("interrupted; not started: level 0.2, level 0.3")
    scenario = load_scenario(CONFIGS / "nnm_chain_thesis_method.yaml")
    points = nnm(scenario).backbone.parameter.size
    assert nnm(scenario, stop=after(points + 1)).status == "interrupted before relaxed minimisation"
    part = nnm(scenario, stop=after(points + 4))
    assert part.status.endswith("during relaxed minimisation")
    assert 1 <= part.relaxed.factor.size < scenario.nnm.solver.steps


def test_nothing_found_is_nothing_kept(monkeypatch):
    monkeypatch.setattr("beamsim.analyses.response.branches.ShootingTracer.begin", lambda *_: None)
    with pytest.raises(KeyboardInterrupt):
        frequency_response(load_scenario(RESPONSE), stop=lambda: True)
    with pytest.raises(beamsim.ScenarioError, match="no periodic motion"):
        frequency_response(load_scenario(RESPONSE))


# --- as a process -----------------------------------------------------------------------------------------------------

CHILD = f"""
import signal
import sys
from contextlib import contextmanager
import beamsim.cli
import beamsim.cli.progress

@contextmanager
def telling(label, *, shown):
    reports = 0
    def tell(fraction):
        nonlocal reports
        reports += 1
        if reports == {POINTS}:
            print("under way", flush=True)
            sys.stdin.readline()
    yield tell

signal.signal(signal.SIGINT, signal.default_int_handler)  # the tests may run where it is ignored
beamsim.cli.progress.progress_bar = telling
beamsim.cli.main()
"""


@pytest.fixture
def under_way(tmp_path):
    """Start a command in an empty folder; it waits after a few reports of progress for a line on its input."""
    started = []

    def start(*arguments):
        process = subprocess.Popen(
            [sys.executable, "-c", CHILD, *map(str, arguments)], cwd=tmp_path, text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
        started.append(process)
        assert process.stdout.readline() == "under way\n", process.communicate()
        return process

    yield start
    for process in started:
        process.kill()
        process.communicate()


@pytest.mark.parametrize(
    ("command", "path", "read", "number", "code"),
    [
        ("nnm", MODE, open_nnm, signal.SIGINT, 130),
        ("sweep", RESPONSE, open_response, signal.SIGTERM, 143),
    ],
)
def test_a_signal_keeps_what_was_found(command, path, read, number, code, under_way, tmp_path):
    process = under_way(command, path, "-o", "case.h5")
    process.send_signal(number)
    output, errors = process.communicate("go on\n", timeout=120)
    assert process.returncode == code, errors
    assert errors.splitlines() == [
        "beamsim: stopping after the current point and saving the partial result; press again to stop immediately",
        "beamsim: interrupted; the partial result is in case.h5; `beamsim plot case.h5` plots it",
    ]
    assert "interrupted" in output
    assert os.listdir(tmp_path) == ["case.h5"]
    kept = read(tmp_path / "case.h5")
    assert kept.status.startswith("interrupted")
    assert POINTS <= kept.branches[0].parameter.size <= POINTS + 1  # the first need not be reported


@pytest.fixture
def heeded():
    """SIGINT as it is in a foreground process, wherever the tests run."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_are_the_commands_only_while_it_can_keep_something(number, heeded, capsys):
    handlers = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    with interruptible() as interrupted:
        assert not interrupted()
        signal.raise_signal(number)
        assert interrupted()
        assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == handlers
    assert "again to stop immediately" in capsys.readouterr().err
    assert exit_code(COMPLETE, interrupted.signal) == 128 + number
    with interruptible():
        assert signal.getsignal(number) not in handlers
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == handlers


def test_a_signal_that_is_ignored_stays_ignored(heeded):
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with interruptible() as interrupted:
        signal.raise_signal(signal.SIGINT)
        assert not interrupted()


def test_a_second_signal_ends_at_once(under_way, tmp_path):
    process = under_way("nnm", MODE)
    process.send_signal(signal.SIGINT)
    assert "again" in process.stderr.readline()
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 130
    assert errors == "beamsim: interrupted; no incomplete file was left\n"
    assert os.listdir(tmp_path) == []


LONG = {
    "run": ("one_sided_65hz.yaml", "run.duration=2000 s", "run.sample_rate=200 Hz"),
    "sweep": ("sweep_up_down.yaml", "sweep.rate=0.3 oct/min", "sweep.direction=up"),
}


@pytest.mark.parametrize(
    ("command", "number", "code"),
    [
        ("run", signal.SIGINT, 130),
        pytest.param("run", signal.SIGTERM, 143, marks=pytest.mark.slow),
        ("sweep", signal.SIGTERM, 143),
    ],
)
def test_a_signal_during_a_long_motion_keeps_what_was_computed(command, number, code, under_way, tmp_path):
    name, *overrides = LONG[command]
    sets = [x for override in overrides for x in ("--set", override)]
    process = under_way(command, CONFIGS / name, *sets, "-o", "case.h5")
    process.send_signal(number)
    _, errors = process.communicate("go on\n", timeout=120)
    assert process.returncode == code, errors
    assert "Traceback" not in errors
    assert os.listdir(tmp_path) == ["case.h5"]
    kept = beamsim.open_result(tmp_path / "case.h5")
    assert kept.outcome.interrupted
    assert not kept.complete
    if command == "run":
        assert 0.0 < kept.time[-1] < 2000.0
        assert kept.time[-1] <= kept.outcome.numbers["parameter"]
