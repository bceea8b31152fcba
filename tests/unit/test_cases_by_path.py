"""What is given in place of a scenario: paths, text, mappings; of anything else it is said what to do."""

import inspect
from pathlib import Path

import numpy as np
import pytest

import beamsim
from beamsim.kinds import KINDS
from tests.helpers.commands import invoke

CASE = """
chain: {masses: [1 kg, 1 kg], springs: [1 kN/m, 1 kN/m], damping: {kind: modal, ratio: 2 %}}
snubbers: [{name: stop, at: {mass: 1}, side: below, gap: 0 mm, stiffness: 10 kN/m}]
excitation: {kind: harmonic, applied_to: base, frequency: 5 Hz, level: 2 g}
probes: [{name: mass, mass: 1}]
run: {duration: 0.2 s, sample_rate: 500 Hz, convergence: off}
nnm: {mode: 1, continue_in: {kind: stiffness_factor, from: 0, to: 0.1}, convergence: off}
"""
SWEEPS = {
    "sweep": "{kind: stepped, from: 4 Hz, to: 5 Hz, points: 2, convergence: off}",
    "continuation": "{kind: continuation, from: 30 Hz, to: 30.5 Hz, convergence: off}",
    "coexisting": "{kind: coexisting, at: [30 Hz], starts: {kind: phases, number: 2}, most_cycles: 2000}",
}


@pytest.fixture
def case(tmp_path):
    def written(more=""):
        path = tmp_path / "case.yaml"
        path.write_text(CASE + more)
        return path

    return written


def test_a_run_takes_a_path_text_or_a_mapping(case):
    path = case()
    expected = beamsim.run(beamsim.load_scenario(path))
    assert expected.scenario.source == "case"
    for source in (path, str(path), CASE, beamsim.load_scenario(path)):
        result = beamsim.run(source)
        assert result.summary["peak_force_n"] == expected.summary["peak_force_n"]
    path.write_text("\n" + CASE.replace("[1 kg,", "[0 kg,"))
    with pytest.raises(beamsim.ScenarioError, match=r"case\.yaml:3: chain\.masses\[0\] = 0 kg must be positive"):
        beamsim.run(path)


@pytest.mark.parametrize("name", [*SWEEPS, "nnm", "design_study", "plan_designs", "ensemble"])
def test_so_do_the_other_analyses(name, case):
    more = f"sweep: {SWEEPS[name]}\n" if name in SWEEPS else ""
    if "design" in name:
        more = "vary: {kind: grid, parameters: [{path: snubbers.stop.gap, values: [1 mm, 2 mm]}]}\n"
    path = case(more)
    draws = ({"snubbers.stop.gap": [1e-3, 2e-3]}, ["peak_force"]) if name == "ensemble" else ()
    function = getattr(beamsim, name)
    one, other = function(str(path), *draws), function(beamsim.load_scenario(path), *draws)
    if name != "plan_designs":
        assert one.complete
        assert one.summary.keys() == other.summary.keys()
        assert one.scenario == other.scenario


def test_shapes_are_read_from_their_file(case, tmp_path):
    path, shapes = case(), tmp_path / "shapes.csv"
    shapes.write_text("mass,3.1 Hz\n1,1\n2,1.6\n")
    read = beamsim.compare_modes(str(path), str(shapes))
    other = beamsim.compare_modes(beamsim.load_scenario(path), beamsim.read_shapes(shapes, path))
    assert read.summary == other.summary


SCENARIOS = [of.analysis.partition(":")[2] for name, of in KINDS.items() if name != "compare"]


@pytest.mark.parametrize("name", [*SCENARIOS, "ensemble", "plan_designs", "read_tests"])
def test_what_is_no_case_is_refused_with_what_to_do(name, case, tmp_path):
    result = beamsim.run(case())
    stored = beamsim.write_result(result, tmp_path / "case.h5")
    function = getattr(beamsim, name)
    others = [None for each in inspect.signature(function).parameters.values() if each.default is each.empty][1:]
    for source, said in (
        (stored, rf'an HDF5 file, not YAML; a result is read by beamsim\.load\("{stored}"\), its case is'),
        (result, "scenario is a RunResult, which no scenario can be read from; take its scenario"),
        (None, "scenario is a NoneType, which no scenario can be read from; give a path, YAML text or a mapping"),
        (tmp_path / "none.yaml", "none.yaml: does not exist"),
    ):
        with pytest.raises(beamsim.ScenarioError, match=said):
            function(source, *others)


def test_what_is_no_result_is_refused_with_what_to_do(case, tmp_path):
    stored = beamsim.write_result(beamsim.run(case()), tmp_path / "case.h5")
    said = r"a result is needed, not a \w+; beamsim\.load reads that of a file"
    for call in (
        lambda: beamsim.write_result(str(stored), tmp_path / "x.h5"),
        lambda: beamsim.pair_channels(stored, "x.csv"),
        lambda: beamsim.compare(str(stored), []),
    ):
        with pytest.raises(TypeError, match=said):
            call()
    with pytest.raises(TypeError, match=r"the path of a result file is needed, not a result; beamsim\.write_result"):
        beamsim.export_result(beamsim.load(stored), tmp_path, "csv")


def test_a_command_runs_the_case_of_a_result_again(case, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = invoke("run", case(), "--no-plots", "-o", "case.h5")
    assert done.exit_code == 0, done.output
    first = Path("case.h5").read_bytes()
    done = invoke("run", "case.h5", "--no-plots")
    assert done.exit_code == 0, done.output
    assert done.stdout.rstrip().endswith("case_again.h5")
    assert Path("case.h5").read_bytes() == first
    one, again = beamsim.load("case.h5"), beamsim.load("case_again.h5")
    for name in one["histories"]:
        np.testing.assert_array_equal(one["histories"][name].values, again["histories"][name].values)
    done = invoke("run", "case.h5", "--no-plots", "--set", "excitation.level=0.1 g", "-o", "other.h5")
    assert done.exit_code == 0, done.output
    assert max(beamsim.load("other.h5").summary["peak_force_n"].values()) < max(one.summary["peak_force_n"].values())
    for command in (["validate"], ["check"], ["export-structure"]):
        done = invoke(command[0], "case.h5", *command[1:])
        assert done.exit_code == 0, done.output
    done = invoke("run", "case.h5", "-o", "case.h5")
    assert (done.exit_code, Path("case.h5").read_bytes()) == (2, first)
    assert "this command reads that file" in done.output


def test_files_of_the_case_of_a_result_must_be_as_they_were(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "base.csv").write_text("\n".join(["time (s),a (m/s^2)", *(f"{k / 500},{k % 7}" for k in range(101))]))
    sampled = "excitation: {kind: sampled, file: base.csv, applied_to: base}"
    (tmp_path / "case.yaml").write_text(
        CASE.replace("excitation: {kind: harmonic, applied_to: base, frequency: 5 Hz, level: 2 g}", sampled)
    )
    done = invoke("run", "case.yaml", "--no-plots")
    assert done.exit_code == 0, done.output
    assert invoke("run", "case.h5", "--no-plots", "-q").exit_code == 0
    (tmp_path / "base.csv").write_text((tmp_path / "base.csv").read_text().replace(",3\n", ",4\n"))
    done = invoke("run", "case.h5", "--no-plots", "-q")
    assert done.exit_code == 2
    assert "is not the file that was solved: its content is another" in done.output


@pytest.mark.parametrize(
    ("call", "kind", "remedy"),
    [
        (beamsim.sweep, "continuation", "call beamsim.continuation"),
        (beamsim.sweep, "coexisting", "call beamsim.coexisting"),
        (beamsim.continuation, "sweep", "kind: continuation"),
        (beamsim.coexisting, "continuation", "kind: coexisting"),
    ],
)
def test_another_kind_of_sweep_is_refused_with_what_to_do(call, kind, remedy, case):
    with pytest.raises(beamsim.ScenarioError, match=remedy):
        call(case(f"sweep: {SWEEPS[kind]}\n"))
