"""`beamsim sweep` with `optimise:`: files, exit codes, going on after being killed, the same with any workers."""

import json
import os
import signal
import time
from pathlib import Path

import numpy as np
import pytest

import beamsim
from beamsim.store.studies import journal_path
from beamsim.trust.studies import CaseSolver
from tests.helpers.commands import invoke

CASE = """\
title: Stop of a mass
chain: {masses: [2 kg], springs: [10 N/m]}
snubbers: [{name: stop, mass: 1, side: above, gap: 0 mm, stiffness: 20 kN/m}]
run: {duration: 50 ms, start: {displacement: [0], velocity: [0.5 m/s]}}
limits: {peak_force: 120 N, peak_displacement: 30 mm}
optimise:
  minimise: {peak_force: 60 N, peak_displacement: 10 mm}
  most_cases: 60
  parameters:
    - {path: snubbers.stop.stiffness, from: 1 kN/m, to: 100 kN/m, spacing: logarithmic}
    - {path: snubbers.stop.gap, from: 0 mm, to: 2 mm}
"""


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("case.yaml").write_text(CASE)


def same_tables(one, other):
    one, other = (beamsim.load(path) for path in (one, other))
    assert one.table.keys() == other.table.keys()
    for name, column in one.table.items():
        np.testing.assert_array_equal(column, other.table[name], err_msg=name)
    assert one.summary["best"] == other.summary["best"]
    assert one.status == other.status


def test_the_best_design_is_written_as_a_scenario_and_drawn():
    done = invoke("sweep", "case.yaml", "--workers", 1, "--json")
    summary = json.loads(done.stdout)
    best = summary["best"][0]
    assert done.exit_code == 0, done.output
    assert summary["files"] == ["case.h5", "case_best.yaml", "case_search.png", "case_best.png", "case_scatter.png"]
    assert all(Path(name).stat().st_size > 0 for name in summary["files"])
    alone = json.loads(invoke("run", "case_best.yaml", "--json", "--no-plots").stdout)
    force, displacement = alone["peak_force_n"]["stop"], max(alone["peak_displacement_m"].values())
    assert force / 60.0 + displacement / 10e-3 == pytest.approx(best["value"], rel=1e-6)
    assert alone["margins"]["peak_force"]["verdict"] == summary["margins"]["peak_force"]["verdict"] == "ok"
    stored = beamsim.load("case.h5")
    runs = stored["runs"].groups("sample_design")
    assert runs.keys() == {"best", "as_it_is"}
    assert runs["best"]["force"].values.max() == pytest.approx(force, rel=1e-2)  # between samples
    shown = invoke("info", "case.h5").stdout
    for text in ("as it is", "within 1 %", "convergence", "search of"):
        assert text in shown


def test_another_seed_tries_other_designs():
    for seed in (0, 1):
        sets = ("--set", f"optimise.seed={seed}", "--set", "optimise.most_cases=25")
        done = invoke("sweep", "case.yaml", "--workers", 1, *sets, "--no-plots", "-o", f"{seed}.h5")
        assert done.exit_code == 0, done.output
    assert not np.array_equal(*(beamsim.load(f"{seed}.h5").parameters[0].values[:20] for seed in (0, 1)))


def test_an_interrupted_or_killed_search_goes_on_where_it_was(monkeypatch, heeded):
    """Killed, it leaves the journal as it is on the disk at that time, perhaps with half of a line."""
    assert invoke("sweep", "case.yaml", "--workers", 1, "--no-plots", "-o", "whole.h5").exit_code == 0
    solved, whole, journals = [], beamsim.load("whole.h5").count, []

    def solve(self, case, real=CaseSolver.__call__):
        if not case.compared:
            solved.append(case.number)
        if len(solved) == 25:  # amid a generation
            journals.append(journal_path(Path("case.h5")).read_bytes())
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.3)
        return real(self, case)

    monkeypatch.setattr(CaseSolver, "__call__", solve)
    done = invoke("sweep", "case.yaml", "--workers", 1, "--no-plots")
    assert done.exit_code == 130, done.output
    assert "24 of at most 60 cases are kept in case.h5.partial; --resume computes the others" in done.output
    assert "has tried 24 of at most 60 designs" in beamsim.load("case.h5").status
    again = invoke("sweep", "case.yaml", "--workers", 1, "--no-plots", "--resume")
    assert again.exit_code == 0, again.output
    assert sorted(solved) == sorted([24, *range(whole)])  # only the one that was under way is solved twice
    same_tables("whole.h5", "case.h5")
    assert not journal_path(Path("case.h5")).exists()
    assert "nothing to compute" in invoke("sweep", "case.yaml", "--resume").output
    last = journals[0].splitlines()[-1]
    journal_path(Path("killed.h5")).write_bytes(journals[0] + last[: len(last) // 2])
    assert invoke("sweep", "case.yaml", "--workers", 1, "--no-plots", "--resume", "-o", "killed.h5").exit_code == 0
    assert len(solved) == whole + 1 + whole - 24
    same_tables("whole.h5", "killed.h5")


def test_cases_that_are_sweeps_are_solved_by_processes():
    shaken = CASE.replace("run: {duration: 50 ms, start: {displacement: [0], velocity: [0.5 m/s]}}", (
        "excitation: {kind: harmonic, applied_to: base, level: 1, frequency: 5 Hz}\n"
        "sweep: {kind: stepped, from: 8 Hz, to: 12 Hz, points: 2, most_cycles: 10}"
    ))  # fmt: skip
    Path("case.yaml").write_text(shaken.replace("most_cases: 60", "most_cases: 8"))
    for workers in (1, 2):
        done = invoke("sweep", "case.yaml", "--workers", workers, "--no-plots", "-o", f"{workers}.h5")
        assert done.exit_code in (0, 3), done.output
    same_tables("1.h5", "2.h5")


def test_a_front_names_the_best_design_of_each_objective():
    """The softest stop has the least force, the stiffest one the least displacement; both are ends of the range."""
    aims = CASE.replace("{peak_force: 60 N, peak_displacement: 10 mm}", "[peak_force, snubbers/stop/contact_share]")
    Path("case.yaml").write_text(aims.replace("limits: {peak_force: 120 N, peak_displacement: 30 mm}\n", ""))
    lines = invoke("sweep", "case.yaml", "--workers", 1, "--no-plots").output.splitlines()
    force, share = (k for k, line in enumerate(lines) if line.startswith("best in "))
    assert lines[force].startswith("best in peak force: peak force ")
    assert "stop stiffness 1 kN/m" in lines[force]
    assert lines[force + 1].startswith("stop stiffness")
    assert lines[share].startswith("best in snubbers stop contact share: ")
    assert "stop stiffness 100 kN/m" in lines[share]


def test_exit_codes_say_whether_a_design_meets_the_limits():
    assert invoke("sweep", "case.yaml", "--workers", 1, "--check", "--no-plots").exit_code == 0
    sets = ["--set", "limits.peak_force=1 N", "--set", "optimise.most_cases=20", "--no-plots", "--workers", "1"]
    without = invoke("sweep", "case.yaml", *sets)
    assert without.exit_code == 3
    assert "no feasible design found after 20 of 20 cases" in without.output
    checked = invoke("sweep", "case.yaml", *sets, "--check")
    assert checked.exit_code == 4
    assert "exceeds limits.peak_force" in checked.output


def test_an_objective_that_no_design_has_is_refused():
    done = invoke("sweep", "case.yaml", "--workers", 1, "--set", "optimise.minimise=rms_force", "--no-plots")
    assert done.exit_code == 2
    assert "optimise asks for rms_force, but no design has it" in done.output


def test_a_search_that_may_try_too_few_designs_says_so():
    done = invoke("sweep", "case.yaml", "--workers", 1, "--set", "optimise.most_cases=18", "--no-plots")
    assert done.exit_code == 0
    assert "NOT CONVERGED" in done.output
    assert "ended after 18 designs while it still found better ones" in done.output


def test_a_doubt_about_what_is_searched_for_is_said_of_the_best_design():
    """The bending stress is none of the values that are read first of a run, but it is the aim of this search."""
    Path("beam.yaml").write_text("""
beam: {length: 270 mm, width: 50 mm, thickness: 5 mm, youngs_modulus: 69 GPa, density: 2700 kg/m^3,
  damping: {kind: modal, ratio: 1 %}}
snubbers: [{name: tip, position: 100 mm, side: below, stiffness: 500 kN/m, gap: 0 mm}]
probes: [{name: tip, position: 270 mm}]
excitation: {kind: half_sine, applied_to: base, level: 20 g, duration: 0.3 ms}
reduction: {modes: 3}
run: {duration: 20 ms}
optimise: {minimise: bending_stress, most_cases: 6, parameters: [{path: snubbers.tip.gap, from: 0 mm, to: 0.1 mm}]}
""")
    result = beamsim.design_study("beam.yaml")
    assert result.summary["doubtful"] == ["largest_bending_stress_pa"]
    assert "the best design: not converged: values are off by more than 2 %" in result.status
    assert ": largest bending stress by 3" in result.status  # and not its acceleration, which nobody asks for
    assert "acceleration" not in result.status
