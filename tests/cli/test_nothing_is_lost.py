"""Commands that are interrupted, fail or lack `--resume` leave all solved cases and complete results in some file."""

import errno
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sampling import first_apart

import beamsim
from beamsim.analyses.sweep.analysis import level_outcomes
from beamsim.files import protected_files
from beamsim.labelled import Dataset
from tests.helpers.commands import invoke

CHAIN = """
chain: {masses: [1 kg], springs: [1 kN/m], dashpots: [1 N s/m]}
snubbers: [{name: stop, mass: 1, side: below, gap: 1 mm, stiffness: 1e5}]
excitation: {kind: harmonic, applied_to: base, frequency: 5 Hz, level: 2}
run: {duration: 0.2 s, convergence: off}
"""
STUDY = CHAIN + "vary: {kind: grid, parameters: [{path: snubbers.stop.gap, from: 1 mm, to: 2 mm, points: 6}]}\n"
OPTIMUM = CHAIN + (
    "limits: {peak_force: 1 kN}\n"
    "optimise: {minimise: peak_force, most_cases: 12, parameters: [{path: snubbers.stop.gap, from: 1 mm, to: 2 mm}]}\n"
)
SAMPLE = CHAIN + (
    "vary: {kind: latin_hypercube, samples: 6, seed: 1,\n"
    "  parameters: [{path: snubbers.stop.gap, tolerance: 0.1 mm}]}\n"
)
PROBABILITY = CHAIN + (
    "limits: {peak_displacement: 1.0 mm}\n"
    "vary: {kind: reliability, method: monte_carlo, samples: 8, most_cases: 12,\n"
    "  parameters: [{path: snubbers.stop.gap, deviation: 5 %}]}\n"
)
SWEPT = CHAIN + "sweep: {kind: stepped, from: 4 Hz, to: 6 Hz, points: 5, most_cycles: 20, convergence: off}\n"
OPTIONS = ("--workers", "1", "--no-plots")


@pytest.fixture
def here(tmp_path, monkeypatch, heeded):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def contents(folder="."):
    return {path.name: path.read_bytes() for path in Path(folder).iterdir()}


def cases_in(path):
    """Lines of a journal after the one that names the study."""
    return Path(path).read_bytes().splitlines()[1:]


def interrupted_after(monkeypatch, count, signals=1):
    """Let signals arrive while the case after so many is solved."""
    from beamsim.trust.studies import CaseSolver

    solved = []

    def solve(self, case, real=CaseSolver.__call__):
        solved.append(case.number)
        if len(solved) == count + 1:
            for _ in range(signals):
                os.kill(os.getpid(), signal.SIGINT)
                time.sleep(0.05)  # in which the main thread hears of it
        return real(self, case)

    monkeypatch.setattr(CaseSolver, "__call__", solve)


# --- a forgotten --resume ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "change"),
    [(STUDY, ""), (OPTIMUM, ""), (SAMPLE, ""), (PROBABILITY, ""), (STUDY, "title: another study\n")],
    ids=["grid", "optimum", "sample", "reliability", "another grid"],
)
def test_a_forgotten_resume_keeps_the_cases(text, change, here, monkeypatch, caplog):
    Path("case.yaml").write_text(text)
    with monkeypatch.context() as patch:
        interrupted_after(patch, 3)
        first = invoke("sweep", "case.yaml", *OPTIONS)
    assert first.exit_code == 130, first.output
    before, kept = contents(), cases_in("case.h5.partial")
    assert kept
    Path("case.yaml").write_text(change + text)
    again = invoke("sweep", "case.yaml", *OPTIONS)
    assert again.exit_code in (0, 3), again.output  # of so few cases a search or a probability may not converge
    after = contents()
    assert after["case.h5.partial.1"] == before["case.h5.partial"]
    assert "case.h5.partial held the cases solved before; it is kept in case.h5.partial.1" in caplog.text
    assert not beamsim.load("case.h5").outcome.cut_short
    # and the cases can still be used
    os.rename("case.h5.partial.1", "case.h5.partial")
    os.unlink("case.h5")
    Path("case.yaml").write_text(text)
    resumed = invoke("sweep", "case.yaml", *OPTIONS, "--resume")
    assert resumed.exit_code == again.exit_code, resumed.output
    assert f"{len(kept)} of" in resumed.output


@pytest.mark.parametrize("change", ["", "title: another sweep\n"], ids=["same", "another"])
def test_a_partial_sweep_is_moved_aside_unless_the_new_one_has_all_of_it(change, here, caplog):
    Path("case.yaml").write_text(SWEPT)
    stop = iter([False] * 2)
    part = beamsim.sweep(beamsim.load_scenario("case.yaml"), stop=lambda: next(stop, True))
    assert part.outcome.cut_short
    with protected_files([]):
        beamsim.write_result(part, "case.h5")
    before = Path("case.h5").read_bytes()
    Path("case.yaml").write_text(change + SWEPT)
    done = invoke("sweep", "case.yaml", "--no-plots")
    assert done.exit_code == 0, done.output
    assert beamsim.load("case.h5").complete
    assert set(contents()) == {"case.yaml", "case.h5", *(["case.h5.1"] if change else [])}
    if change:
        assert Path("case.h5.1").read_bytes() == before
        assert "case.h5 held a partial result; it is kept in case.h5.1" in caplog.text


def test_a_partial_sweep_beside_a_complete_result_of_another_kind_is_resumed(here):
    Path("case.yaml").write_text(SWEPT)
    assert invoke("run", "case.yaml", "--no-plots").exit_code == 0
    whole = Path("case.h5").read_bytes()
    stop = iter([False] * 2)
    part = beamsim.sweep(beamsim.load_scenario("case.yaml"), stop=lambda: next(stop, True))
    assert beamsim.write_result(part, "case.h5") == Path("case_partial.h5")
    assert Path("case.h5").read_bytes() == whole
    done = invoke("sweep", "case.yaml", "--no-plots", "--resume", "-o", "swept.h5")
    assert done.exit_code == 0, done.output
    os.rename("case_partial.h5", "swept.h5")
    done = invoke("sweep", "case.yaml", "--no-plots", "--resume", "-o", "swept.h5")
    assert done.exit_code == 0, done.output


@pytest.fixture
def half_swept(here):
    """A case of two levels, and the file of a sweep that was interrupted in the second one."""
    text = SWEPT.replace("kind: stepped", "kind: stepped, levels: [2, 3]")
    Path("case.yaml").write_text(text)
    stop = iter([False] * 5)
    part = beamsim.sweep(beamsim.load_scenario("case.yaml"), stop=lambda: next(stop, True))
    assert [outcome.complete for outcome in level_outcomes(part["levels"])] == [True, False]
    with protected_files([]):
        return beamsim.write_result(part, "case.h5")


def test_an_error_of_the_solver_in_a_resumed_sweep_is_not_reported_as_a_damaged_file(half_swept, monkeypatch):
    def failing(*_):
        raise KeyError("an error in the solver")

    monkeypatch.setattr("beamsim.analyses.sweep.analysis.step_level", failing)
    done = invoke("sweep", "case.yaml", "--no-plots", "--resume")
    assert done.exit_code == 1
    assert "internal error" in done.output
    assert "case.h5" not in done.output


def with_values(dataset, **factors):
    """A dataset with some variables times factors."""
    return dataset.assign(**{name: factor * dataset[name].values for name, factor in factors.items()})


def without(dataset, *names):
    """A dataset without some variables."""
    left = {path: item for path, item in dataset.items_by_path.items() if path.rpartition("/")[2] not in names}
    return Dataset(dataset.name, left)


EDITS = {
    "no displacement": ("cycles", lambda cycles: without(cycles, "max_displacement")),
    "another probe": ("cycles", lambda cycles: cycles.assign(probe=np.array(["x"], dtype=object))),
    "no contact_share": ("cycles", lambda cycles: without(cycles, "contact_share")),
    "share above 1": ("cycles", lambda cycles: cycles.assign(contact_share=cycles["contact_share"].values + 1.0)),
    "another share": ("cycles", lambda cycles: with_values(cycles, contact_share=0.9)),
    "larger peaks": ("cycles", lambda cycles: with_values(cycles, peak_displacement=2.0)),
    "larger maxima": ("cycles", lambda cycles: with_values(cycles, max_displacement=2.0)),
    "peaks of a nanometre more": (
        "cycles", lambda cycles: cycles.assign(peak_displacement=cycles["peak_displacement"].values + 1e-9)
    ),
    "another level": ("curves", lambda curves: curves.assign(level=curves["level"].values + 1.0)),
    "rows of another curve": ("cycles", lambda cycles: cycles.assign(curve=cycles["curve"].values[::-1].copy())),
    "no snubber": ("cycles", lambda cycles: without(cycles, *(x for x in cycles if "snubber" in cycles[x].dims))),
}  # fmt: skip


@first_apart("contradiction", 3, EDITS)
def test_a_resumed_sweep_whose_file_contradicts_itself_is_refused(contradiction, half_swept):
    name, edit = EDITS[contradiction]
    part, content = beamsim.load(half_swept, whole=True), half_swept.read_bytes()
    with protected_files([]):
        beamsim.write_result(replace(part, datasets={**part.datasets, name: edit(part[name])}), half_swept)
    done = invoke("sweep", "case.yaml", "--resume", "--no-plots")
    half_swept.write_bytes(content)
    assert done.exit_code == 2, done.output
    assert "case.h5: its contents contradict each other" in done.output or "case.h5: damaged" in done.output


# --- errors and signals -----------------------------------------------------------------------------------------------


def complete_result(text=STUDY):
    Path("case.yaml").write_text(text)
    done = invoke("run", "case.yaml", "--no-plots")
    assert done.exit_code == 0, done.output
    return Path("case.h5").read_bytes()


def test_a_second_signal_leaves_a_complete_result_and_keeps_the_cases(here, monkeypatch):
    before = complete_result()
    interrupted_after(monkeypatch, 2, signals=2)
    done = invoke("sweep", "case.yaml", *OPTIONS)
    assert done.exit_code == 130, done.output
    assert Path("case.h5").read_bytes() == before
    assert len(cases_in("case.h5.partial")) == 2
    assert beamsim.load("case_partial.h5").outcome.cut_short
    assert set(contents()) == {"case.yaml", "case.h5", "case.h5.partial", "case_partial.h5"}


def test_an_optimum_of_a_partial_study_replaces_no_other(here, monkeypatch):
    Path("case.yaml").write_text(OPTIMUM)
    assert invoke("sweep", "case.yaml", *OPTIONS).exit_code == 0
    before = contents()
    assert "case_best.yaml" in before
    Path("case.yaml").write_text(OPTIMUM + "title: another\n")
    interrupted_after(monkeypatch, 5)
    done = invoke("sweep", "case.yaml", *OPTIONS)
    assert done.exit_code == 130, done.output
    assert {name: contents()[name] for name in ("case.h5", "case_best.yaml")} == {
        name: before[name] for name in ("case.h5", "case_best.yaml")
    }


def test_the_optimum_is_never_written_over_the_case(here):
    """`case_best.yaml` of an earlier search is what this case extends: it is refused before anything is computed."""
    Path("case_best.yaml").write_text(OPTIMUM)
    Path("case.yaml").write_text("extends: case_best.yaml\n")
    done = invoke("sweep", "case.yaml", *OPTIONS)
    assert done.exit_code == 2
    assert "cannot write case_best.yaml: this command reads that file" in done.output
    assert Path("case_best.yaml").read_text() == OPTIMUM
    assert set(contents()) == {"case.yaml", "case_best.yaml"}


def test_a_scheduler_that_cannot_be_reached_touches_nothing(here, monkeypatch):
    pytest.importorskip("distributed")
    complete_result()
    with monkeypatch.context() as patch:
        interrupted_after(patch, 2)
        assert invoke("sweep", "case.yaml", *OPTIONS).exit_code == 130
    before = contents()
    for words in ([], ["--resume"]):
        done = invoke("sweep", "case.yaml", "--no-plots", "--scheduler", "tcp://127.0.0.1:1", *words)
        assert done.exit_code == 2, done.output
        assert "127.0.0.1:1" in done.output
        assert contents() == before
    Path("case.yaml").write_text(STUDY + "title: another\n")
    done = invoke("sweep", "case.yaml", "--no-plots", "--scheduler", "tcp://127.0.0.1:1")
    assert done.exit_code == 2, done.output
    assert {name: data for name, data in contents().items() if name != "case.yaml"} == {
        name: data for name, data in before.items() if name != "case.yaml"
    }


@pytest.mark.skipif(os.name != "posix", reason="limits of file size are POSIX")
@pytest.mark.parametrize("room", [100, 3000])
def test_a_full_disk_under_a_journal(room, here):
    """No file may become larger than so many bytes; the journal of all cases would."""
    import resource

    before = complete_result(STUDY.replace("points: 6", "points: 40"))

    command = [sys.executable, "-m", "beamsim", "sweep", "case.yaml", *OPTIONS]
    environment = {name: value for name, value in os.environ.items() if not name.startswith("COVERAGE_")}
    environment |= {"PYTHONDONTWRITEBYTECODE": "1", "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, env=environment,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (room, room)),
    )  # fmt: skip
    assert done.returncode == 5, done.stderr
    last = done.stderr.splitlines()[-1]
    assert last.startswith("beamsim: cannot write case.h5.partial: File too large; the ")
    assert last.endswith("make room and continue with --resume")
    assert Path("case.h5").read_bytes() == before
    whole = [
        line for line in Path("case.h5.partial").read_bytes().splitlines(keepends=True)[1:] if line.endswith(b"\n")
    ]
    assert f"the {len(whole)} case" in last
    again = invoke("sweep", "case.yaml", *OPTIONS, "--resume")
    assert again.exit_code == 0, again.output
    assert (f"{len(whole)} of 40 cases are already computed" in again.stderr) == bool(whole)
    result = beamsim.load("case.h5")
    assert result.complete
    assert np.isfinite(result.responses["snubbers/stop/peak_force"].values).all()
    assert set(contents()) == {"case.yaml", "case.h5"}


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EIO])
def test_a_disk_that_fails_under_the_result_of_a_study(code, here, monkeypatch):
    """The journal has every case, so the table is written once there is room."""
    complete_result()
    before = contents()

    def fail(*_):
        raise OSError(code, os.strerror(code))

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", fail)
        done = invoke("sweep", "case.yaml", *OPTIONS)
    assert done.exit_code == 5, done.output
    assert os.strerror(code) in done.output
    assert "case.h5" in done.output
    assert contents()["case.h5"] == before["case.h5"]
    assert len(cases_in("case.h5.partial")) == 6
    interrupted_after(monkeypatch, 0)  # any case that is solved again is an interruption
    again = invoke("sweep", "case.yaml", *OPTIONS, "--resume")
    assert again.exit_code == 0, again.output
    assert beamsim.load("case.h5").complete
