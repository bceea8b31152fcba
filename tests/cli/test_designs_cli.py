"""`beamsim sweep` with `vary:`, `--check`, and going on after being killed."""

import json
import os
import signal
import subprocess
import sys
import time

import h5py
import numpy as np
import psutil
import pytest

from beamsim.store.results import load
from tests.helpers.commands import invoke
from tests.helpers.killed_commands import killed

CASE = """\
title: Small study
beam: {length: 270 mm, width: 50 mm, thickness: 5 mm, youngs_modulus: 69 GPa, density: 2700, elements: 4,
  damping: {kind: modal, ratio: 1 %}}
snubbers: [{name: tip, position: 270 mm, side: below, stiffness: 151.1 kN/m, gap: 0 mm}]
excitation: {kind: harmonic, applied_to: base, level: 2 g, frequency: 65 Hz}
run: {duration: 0.05 s, convergence: off}
limits: {peak_force: 20 N, bending_stress: 80 MPa}
vary:
  kind: grid
  parameters:
    - {path: snubbers.tip.stiffness, values: [50 kN/m, 200 kN/m]}
    - {path: snubbers.tip.gap, from: 0 mm, to: 0.3 mm, points: 3}
"""


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "case.yaml").write_text(CASE)
    return tmp_path


def datasets(path):
    found = {}
    with h5py.File(path) as file:
        file.visititems(lambda name, item: found.update({name: item[()]}) if isinstance(item, h5py.Dataset) else None)
    return found


def assert_same_datasets(one, other):
    one, other = datasets(one), datasets(other)
    assert set(one) == set(other)
    for name, values in one.items():
        np.testing.assert_array_equal(values, other[name], err_msg=name)


# --- success ----------------------------------------------------------------------------------------------------------


def test_a_study_leaves_its_file_and_maps_and_prints_margins(here):
    done = invoke("sweep", "case.yaml", "--workers", 1, "-v")
    assert done.exit_code == 0, done.output
    assert set(os.listdir(here)) == {"case.yaml", "case.h5", "case_maps.png"}
    for text in ("grid of 2 x 3 = 6 cases, each a run", "snubbers.tip.gap", "EXCEEDED", "of 6 cases: ",
                 ", tip stiffness 200 kN/m",
                 "tip peak force", "case_maps.png", ", with its workers"):  # fmt: skip
        assert text in done.stdout, text
    assert load("case.h5").outcome.usable


@pytest.mark.skipif(sys.platform == "win32", reason="processes that have ended are not counted there")
def test_the_processor_time_of_a_command_is_what_the_system_counts_for_it(here):
    """Nearly all: what is used after it is printed, and by helpers of Python's that end later, is little."""
    before = sum(os.times()[2:4])
    command = [sys.executable, "-m", "beamsim", "sweep", "case.yaml", "--workers", "2", "--json"]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    used, values = sum(os.times()[2:4]) - before, json.loads(done.stdout)
    assert 0.8 * used < values["command_processor_time_s"] <= used + 0.05  # ticks of a clock
    assert values["processor_time_s"] < values["command_processor_time_s"]


def test_the_best_of_the_cases_that_meet_every_limit(here):
    """Without an objective the one with the largest margin; the picture marks it."""
    arguments = ("sweep", "case.yaml", "--workers", 1, "--json", "--no-plots")
    done = invoke(*arguments, "--set", "limits.peak_force=17 N", "--set", "vary.minimise=peak_displacement")
    summary = json.loads(done.stdout)
    result = load("case.h5")
    displacement = result.table["probes/tip/peak_displacement"]
    passing = result.table["snubbers/tip/peak_force"] <= 17.0
    assert 0 < summary["passing"] == passing.sum() < 6
    np.testing.assert_array_equal(result["cases"]["passing"].values, passing)
    order = np.flatnonzero(passing)[np.argsort(displacement[passing], kind="stable")]
    assert [case["case"] for case in summary["best"]] == order.tolist()
    assert summary["best"][0]["value"] == displacement[order[0]]
    varied = ("snubbers.tip.stiffness", "snubbers.tip.gap")
    assert summary["best"][0]["parameters"] == {path: result.table[path][order[0]] for path in varied}
    margins = json.loads(invoke(*arguments, "--set", "limits.peak_force=17 N").stdout)
    assert margins["objective"] == "largest margin"
    assert [case["margin"] for case in margins["best"]] == sorted((c["margin"] for c in margins["best"]), reverse=True)
    done = invoke("sweep", "case.yaml", "--workers", 1, "--no-plots", "--set", "limits.peak_force=1 N")
    assert "no case meets every limit" in done.stdout
    assert "best" not in done.stdout


def test_shares_of_the_parameters_in_the_variance(here):
    text = (
        CASE[: CASE.index("vary:")]
        + """\
vary:
  kind: sobol
  samples: 8
  parameters: [{path: excitation.level, tolerance: 10 %}, {path: snubbers.tip.gap, tolerance: 0.01 mm}]
"""
    )
    (here / "case.yaml").write_text(text)
    done = invoke("sweep", "case.yaml", "--workers", 1, "-v")
    assert done.exit_code == 0, done.output
    assert "Sobol' sample of 32" in done.stdout
    assert "sensitivity" in done.stdout
    assert (here / "case_sensitivity.png").stat().st_size > 10_000
    (here / "case.yaml").write_text(text.replace("samples: 8", "samples: 9"))
    done = invoke("sweep", "case.yaml")
    assert done.exit_code == 2
    assert "vary.samples = 9 is not a power of two; take 8 or 16" in done.stderr


def test_objectives_that_cannot_be(here):
    done = invoke("sweep", "case.yaml", "--set", "vary.minimise=peak_forse")
    assert done.exit_code == 2
    assert "vary.minimise = peak_forse is not a response; did you mean peak_force" in done.stderr
    done = invoke("sweep", "case.yaml", "--set", "vary.minimise=peak_force", "--set", "vary.maximise=peak_force")
    assert done.exit_code == 2
    assert "vary.maximise and minimise exclude each other" in done.stderr
    done = invoke("sweep", "case.yaml", "--set", "vary.minimise=snubbers/top/peak_force")
    assert done.exit_code == 2
    assert "vary.minimise = snubbers/top/peak_force names no response: no top; did you mean tip" in done.stderr
    # of random input
    done = invoke("sweep", "case.yaml", "--no-plots", "--workers", 1, "-v", "--set", "vary.minimise=rms_force")
    assert "vary.minimise = rms_force: no case has such a response; they have " in done.stderr
    assert "best" not in done.stdout


def test_json_is_alone_on_standard_output(here):
    done = invoke("sweep", "case.yaml", "--workers", 1, "--json", "--no-plots", "-o", "deep/out.h5")
    assert done.exit_code == 0, done.output
    summary = json.loads(done.stdout, parse_constant=lambda _: pytest.fail("NaN is no JSON"))
    assert summary["cases"] == summary["solved"] == 6
    assert summary["margins"]["peak_force"]["parameters"]["snubbers.tip.stiffness"] == 200e3
    assert summary["files"] == ["deep/out.h5"]


def test_check_ends_with_4_when_a_limit_is_exceeded():
    arguments = ("sweep", "case.yaml", "--workers", 1, "--no-plots", "-q", "--check")
    done = invoke(*arguments)
    assert done.exit_code == 4
    assert "peak force = " in done.stderr
    assert "exceeds limits.peak_force = 20 N" in done.stderr
    assert invoke(*arguments, "--set", "limits.peak_force=200 N").exit_code == 0


def test_check_of_a_run():
    arguments = ("run", "case.yaml", "--no-plots", "--check")
    done = invoke(*arguments)
    assert done.exit_code == 0, done.output
    assert " ok, " in done.stdout
    done = invoke(*arguments, "--set", "limits.peak_force=10 N", "--json")
    assert done.exit_code == 4
    assert json.loads(done.stdout)["margins"]["peak_force"]["exceeded"] is True
    assert "exceeds limits.peak_force = 10 N" in done.stderr


@pytest.mark.parametrize("command", ["run", "sweep"])
def test_check_without_limits(command, here):
    (here / "case.yaml").write_text(CASE.replace("limits:", "nnm: null\n#"))
    done = invoke(command, "case.yaml", "--check")
    assert done.exit_code == 2
    assert "--check has nothing to check" in done.stderr
    assert os.listdir(here) == ["case.yaml"]


# --- refusals ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("values: [50 kN/m, 200 kN/m]", "values: []"), "vary.parameters[0].values is an empty list"),
        (("snubbers.tip.stiffness", "snubbers.tp.stiffness"), "case.yaml:11: vary.parameters[0].path"),
        (("values: [50 kN/m, 200 kN/m]", "from: 1, to: 2, points: 100000"), "asks for 3e+05 cases"),
        (("to: 0.3 mm", "to: 0.3 kg"), "case.yaml:12: vary.parameters[1].to = 0.3 kg must be a length"),
        (("snubbers.tip.gap, from: 0 mm, to: 0.3 mm", "snubbers.tip.position, from: 1 mm, to: 1 m"),
         "case.yaml:8: vary with snubbers.tip.stiffness = 50000 N/m, snubbers.tip.position = 0.5005 m"),
    ],
)  # fmt: skip
def test_nonsense_ends_with_2_where_it_stands(change, message, here):
    text = CASE.replace(*change)
    assert text != CASE
    (here / "case.yaml").write_text(text)
    (here / "case.h5").write_bytes(b"old")
    for command in ("sweep", "validate"):
        done = invoke(command, "case.yaml")
        assert done.exit_code == 2, done.output
        assert message in done.stderr
        assert "Traceback" not in done.output
    assert (here / "case.h5").read_bytes() == b"old"
    assert set(os.listdir(here)) == {"case.yaml", "case.h5"}


def test_neither_sweep_nor_vary(here):
    (here / "case.yaml").write_text(CASE[: CASE.index("vary:")])
    assert invoke("sweep", "case.yaml").exit_code == 2
    for option in (("--workers", 2), ("--scheduler", "tcp://127.0.0.1:1")):
        done = invoke("sweep", "case.yaml", *option)
        assert done.exit_code == 2
        assert f"vary is missing, but {option[0]}" in done.stderr


def test_failed_cases_are_saved_around_and_end_with_3(here):
    extra = "    - {path: run.max_events, values: [2, 1000000]}\n"
    (here / "case.yaml").write_text(CASE + extra)
    done = invoke("sweep", "case.yaml", "--workers", 1, "--no-plots")
    assert done.exit_code == 3
    assert "6 of 12 cases failed; the first is case 1:" in done.stderr
    result = load("case.h5")
    solved = result["cases"]["solved"].values.reshape(result.shape)
    assert solved.sum() == 6
    assert not solved[..., 0].any()


# --- going on ---------------------------------------------------------------------------------------------------------


def test_resume_of_a_complete_study_computes_nothing(here, monkeypatch):
    assert invoke("sweep", "case.yaml", "--workers", 1, "-q", "--no-plots").exit_code == 0
    before = (here / "case.h5").read_bytes()
    monkeypatch.setattr("beamsim.trust.studies.design_study", lambda *_, **__: pytest.fail("computed again"))
    done = invoke("sweep", "case.yaml", "--resume")
    assert done.exit_code == 0, done.output
    assert "there is nothing to compute" in done.stderr
    assert (here / "case.h5").read_bytes() == before


def test_beginning_anew_moves_the_journal_aside(here, monkeypatch):
    from beamsim.analyses.studies.plan import plan_designs
    from beamsim.cases import CaseOutcome
    from beamsim.scenario import load_scenario
    from beamsim.store.studies import opened_journal

    plan = plan_designs(load_scenario("case.yaml"))
    with opened_journal(here / "case.h5.partial", plan.fingerprint, resume=False) as journal:
        journal.add(CaseOutcome(0, {"bending_stress": 1.0}))
    done = invoke("sweep", "case.yaml", "--workers", 1, "--no-plots", "-q")
    assert done.exit_code == 0
    assert (here / "case.h5.partial.1").read_bytes().count(b"\n") == 2  # the study and its case
    assert load("case.h5").responses["bending_stress"].values.min() > 1.0


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="no SIGKILL here")
def test_a_killed_study_goes_on_and_gives_the_same_datasets(here):
    """It is killed between cases, with two workers; another kill leaves half of a line of the journal."""
    survivors = killed("journal", 2, "sweep", "case.yaml", "--workers", 2, "-q", "--no-plots")
    assert len(survivors) >= 2
    journal = here / "case.h5.partial"
    lines = journal.read_bytes().splitlines(keepends=True)
    assert len(lines) == 3  # of the study and two cases
    journal.write_bytes(b"".join(lines) + lines[-1][: len(lines[-1]) // 2])
    done = invoke("sweep", "case.yaml", "--resume", "--workers", 1, "--no-plots")
    assert done.exit_code == 0, done.output
    assert "2 of 6 cases are already computed" in done.stderr
    assert invoke("sweep", "case.yaml", "--workers", 1, "--no-plots", "-q", "-o", "whole.h5").exit_code == 0
    assert_same_datasets("case.h5", "whole.h5")
    assert not [name for name in os.listdir(here) if name.endswith(".partial")]
    deadline = time.monotonic() + 60.0
    while [pid for pid in survivors if psutil.pid_exists(pid)] and time.monotonic() < deadline:
        time.sleep(0.1)
    assert not [pid for pid in survivors if psutil.pid_exists(pid)], "workers outlived their parent"


# --- the result file again --------------------------------------------------------------------------------------------
