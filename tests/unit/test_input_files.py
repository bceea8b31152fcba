"""Results whose scenario names files: where these are looked for, and that others are not taken for them."""

import hashlib
import os
import shutil
from datetime import UTC, datetime

import numpy as np
import pytest
from shipped import config_path

import beamsim
from beamsim.analyses.studies.plan import plan_designs
from beamsim.cli.html_report import sketch_of_result
from beamsim.errors import ScenarioError
from beamsim.scenario import load_scenario
from beamsim.scenario.scenario import named_files
from beamsim.store.results import load
from beamsim.structures.places import Stations
from beamsim.system.build import build_system
from tests.helpers.commands import invoke

SHORT = ["run.duration=1 ms", "run.convergence='off'", "reduction.modes=2", "reduction.highest_frequency=null"]
KEYS = [("bodies", "panel", *key) for key in (("mass", "file"), ("stiffness", "file"), ("dofs", "file"))]


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """A folder with a case and its matrices, a result in another one, and the result before it was written."""
    case, results = tmp_path_factory.mktemp("case"), tmp_path_factory.mktemp("results")
    (case / "matrices").mkdir()
    for name in ("strip.op4", "strip_dofs.csv"):
        shutil.copy(config_path("imported_panel").parents[1] / "matrices" / name, case / "matrices")
    text = config_path("imported_panel").read_text(encoding="utf-8")
    (case / "imported_panel.yaml").write_text(text.replace("../matrices/", "matrices/"), encoding="utf-8")
    result = beamsim.run(load_scenario(case / "imported_panel.yaml", SHORT))
    beamsim.write_result(result, results / "panel.h5")
    return case / "matrices", results / "panel.h5", result


def test_files_are_found_where_they_were_beside_the_result_and_in_the_current_folder(solved, tmp_path, monkeypatch):
    matrices, written, result = solved
    file = tmp_path / "results" / "panel.h5"
    for folder in (tmp_path, file.parent):
        shutil.copytree(matrices, folder / "matrices")
    shutil.copy(written, file)
    monkeypatch.chdir(tmp_path)
    scenario = load(file).scenario
    assert load_scenario(result.scenario, ["run.duration=2 ms"]).folder_of(*KEYS[0]) == matrices.parent
    assert load_scenario(scenario, ["run.duration=2 ms"]).folder_of(*KEYS[0]).absolute() == tmp_path
    for folder in (tmp_path, file.parent, matrices.parent):
        assert {scenario.folder_of(*key).absolute() for key in KEYS} == {folder}
        if folder != matrices.parent:
            shutil.rmtree(folder / "matrices")
    np.testing.assert_array_equal(build_system(scenario).modes["shapes"].values, result["modes"]["shapes"].values)


def test_a_file_with_another_content_is_refused_and_a_missing_one_says_where_it_was_looked_for(
    solved, tmp_path, monkeypatch
):
    matrices, file, result = solved
    monkeypatch.chdir(tmp_path)
    kept = matrices.rename(matrices.parent / "kept")
    try:
        with pytest.raises(ScenarioError) as caught:
            build_system(load(file).scenario)
        assert "bodies.panel.mass.file = matrices/strip.op4 is not found" in str(caught.value)
        assert all(str(folder) in str(caught.value) for folder in (tmp_path, file.parent, matrices.parent))
        sketch = sketch_of_result(load(file), None)  # from the result's own numbers
        np.testing.assert_array_equal(sketch.stations.points, Stations.of_modes(result["modes"]).points)
        assert sketch.stops["corner"].gap == result["histories"]["snubber_gap"].sel(snubber="corner").item()
        shutil.copytree(kept, tmp_path / "matrices")
        matrix = tmp_path / "matrices" / "strip.op4"
        matrix.write_text(matrix.read_text().replace("1", "2", 1))  # as long as it was
        with pytest.raises(ScenarioError, match=r"strip\.op4 in the current folder, .*: its content is another"):
            build_system(load(file).scenario)
    finally:
        kept.rename(matrices)


def test_a_file_that_was_changed_during_the_run_is_not_taken_for_the_one_that_was_solved(solved, tmp_path):
    matrices, _, result = solved
    os.utime(matrices / "strip.op4", (1.0, 1.0))  # another time, which is not later
    beamsim.write_result(result, tmp_path / "again.h5")
    table = (matrices / "strip_dofs.csv").rename(matrices / "gone.csv")
    beamsim.write_result(result, tmp_path / "without.h5")
    table.rename(matrices / "strip_dofs.csv")
    scenario = load(tmp_path / "again.h5").scenario
    assert scenario.folder_of(*KEYS[2]) == matrices.parent
    for key, of in ((KEYS[0], scenario), (KEYS[2], load(tmp_path / "without.h5").scenario)):
        with pytest.raises(ScenarioError, match="was changed or removed while the case was solved"):
            of.folder_of(*key)


@pytest.mark.parametrize(("clock", "stamp"), [("1970-01-01", 1e10), ("2100-01-01", 0.0)])
def test_clocks_and_time_stamps_change_nothing(stamp, clock, tmp_path, monkeypatch):
    """Files of long ago and of the year 2286, solved on a computer whose clock is set to another century."""

    class Clock(datetime):
        @classmethod
        def now(cls, tz=None):
            return cls.fromisoformat(clock).replace(tzinfo=tz)

    monkeypatch.setattr("beamsim.results.result.datetime", Clock)
    monkeypatch.setattr("time.time", lambda: Clock.now(UTC).timestamp())
    (tmp_path / "pad.csv").write_text("deflection (mm),force (N)\n0,0\n1,5\n")
    os.utime(tmp_path / "pad.csv", (stamp, stamp))
    (tmp_path / "case.yaml").write_text("""
chain: {masses: [1], springs: [100]}
snubbers: [{name: stop, mass: 1, side: below, gap: 1 mm, force_deflection: pad.csv}]
excitation: {kind: harmonic, applied_to: base, frequency: 1 Hz, level: 1}
run: {duration: 1 ms, convergence: off}
""")
    result = beamsim.run(load_scenario(tmp_path / "case.yaml"))
    digest = hashlib.sha256((tmp_path / "pad.csv").read_bytes()).hexdigest()
    assert [record["sha256"] for record in result.input_files.values()] == [digest]
    stored = load(beamsim.write_result(result, tmp_path / "case.h5"))
    assert stored.created.startswith(clock)
    build_system(stored.scenario)
    (tmp_path / "pad.csv").write_text("deflection (mm),force (N)\n0,0\n1,6\n")  # as long as it was
    os.utime(tmp_path / "pad.csv", (stamp + 1.0, stamp + 1.0))
    assert [record.get("sha256") for record in result.input_files.values()] == [None]
    with pytest.raises(ScenarioError, match="its content is another"):
        build_system(load(tmp_path / "case.h5").scenario)


def test_every_form_of_naming_a_file_is_known():
    chain = {"masses": [1], "springs": [100]}
    stops = [
        {"mass": 1, "side": "below", "gap": 0.1, "force_deflection": table} for table in ("a.csv", {"file": "b.csv"})
    ]
    shaken = {"kind": "sampled", "file": "c.csv", "column": "force", "applied_to": {"mass": 1}}
    found = named_files(load_scenario({"chain": chain, "snubbers": stops, "excitation": shaken}))
    at = [("snubbers", 0, "force_deflection"), ("snubbers", 1, "force_deflection", "file"), ("excitation", "file")]
    assert dict(found) == dict(zip(at, ("a.csv", "b.csv", "c.csv"), strict=True))


def test_studies_find_files_beside_the_case_and_are_others_where_a_file_has_changed(tmp_path):
    case, table = tmp_path / "case.yaml", tmp_path / "pad.csv"
    case.write_text("""
chain: {masses: [1], springs: [100]}
snubbers: [{name: stop, mass: 1, side: below, gap: 0.1, force_deflection: {file: pad.csv}}]
run: {duration: 1}
vary: {kind: grid, parameters: [{path: snubbers.stop.gap, values: [0.1, 0.2]}]}
""")
    table.write_text("deflection (mm),force (N)\n0,0\n1,5\n")
    plan = plan_designs(load_scenario(case))
    assert plan.study.case.snubbers[0].force_deflection.file == str(table)
    assert plan_designs(load_scenario(case)).fingerprint == plan.fingerprint
    table.write_text("deflection (mm),force (N)\n0,0\n1,6\n")
    assert plan_designs(load_scenario(case)).fingerprint != plan.fingerprint


def test_files_that_a_result_names_are_not_opened_to_show_it(solved, tmp_path):
    _, file, _ = solved
    scenario = load(file, open_files=False).scenario
    with pytest.raises(
        ScenarioError, match=r"mass\.file = matrices/strip\.op4 is a file that the result names.*--open-files"
    ):
        build_system(scenario)
    refused = invoke("animate", file, "-o", tmp_path / "motion.html")
    assert refused.exit_code == 2
    assert "--open-files" in refused.output
    assert invoke("animate", file, "--open-files", "-q", "-o", tmp_path / "motion.html").exit_code == 0
