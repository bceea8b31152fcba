"""`beamsim.ensemble`: draws of any numbers, a table, and going on after an interruption."""

import numpy as np
import pytest

import beamsim
from beamsim.cases import CaseOutcome
from beamsim.store.studies import journal_path, opened_journal
from beamsim.trust.studies import CaseSolver

CASE = """\
chain: {masses: [1], springs: [100, 0], snubbers: [{name: stop, mass: 1, side: below, stiffness: 1 kN/m, gap: 2 mm}]}
excitation: {kind: harmonic, applied_to: {mass: 1}, level: 1 N, frequency: 1 Hz}
run: {duration: 3 s, start: rest}
"""
GAPS = np.array([0.0, 1e-3, 2e-3, 4e-3])
LEVELS = np.array([1.0, 2.0, 3.0, 4.0])
DRAWS = {"chain.snubbers.stop.gap": GAPS, "excitation.level": LEVELS}


@pytest.fixture(scope="module")
def scenario():
    return beamsim.load_scenario(CASE)


@pytest.fixture(scope="module")
def whole(scenario):
    return beamsim.ensemble(scenario, DRAWS, workers=1)


def test_a_row_is_the_run_of_its_draw(whole):
    table = whole.table
    np.testing.assert_array_equal(table["chain.snubbers.stop.gap"], GAPS)
    for k, (gap, level) in enumerate(zip(GAPS, LEVELS, strict=True)):
        changes = {"chain.snubbers[0].gap": gap, "excitation.level": level}
        summary = beamsim.run(beamsim.load_scenario(CASE, changes)).summary
        for name, expected in (
            ("snubbers/stop/peak_force", summary["peak_force_n"]["stop"]),
            ("snubbers/stop/contacts", summary["contacts"]["stop"]),
            ("probes/stop/peak_displacement", summary["peak_displacement_m"]["stop"]),
            ("closed_frequencies_hz_1", summary["closed_frequencies_hz"][0]),
        ):
            assert table[name][k] == pytest.approx(expected, rel=1e-10), name
    assert whole.kind == "draws"
    assert whole.summary["responses"]["snubbers/stop/peak_force"]["mean"] > 0


def test_the_number_of_workers_changes_no_bit(scenario, whole):
    shared = beamsim.ensemble(scenario, DRAWS, workers=2)
    assert list(shared.table) == list(whole.table)
    for name, column in whole.table.items():
        np.testing.assert_array_equal(shared.table[name], column, err_msg=name)


def test_seeds_of_a_random_input_are_realisations(scenario):
    random = beamsim.load_scenario(
        CASE,
        {"excitation": {"kind": "random", "applied_to": {"mass": 1}, "psd": [{"frequency": 0.5, "density": 0.1},
         {"frequency": 5, "density": 0.1}], "seed": 1}, "run.duration": 20},
    )  # fmt: skip
    result = beamsim.ensemble(random, {"excitation.seed": [1, 2, 3]}, ["rms_displacement"])
    (values,) = (r.values for r in result.responses.values())
    assert np.unique(values).size == 3
    one = beamsim.run(beamsim.load_scenario(random, {"excitation.seed": 2, "excitation.amplitudes": "random"}))
    (signal,) = (row for row in one["random"].rows("signal") if row["quantity"] == "displacement")
    assert values[1] == pytest.approx(signal["rms"], rel=1e-12)


@pytest.mark.parametrize(
    ("draws", "responses", "message"),
    [
        ({}, (), "draws is empty"),
        ({"chain.snubbers.stop.gape": [0.0]}, (), "has no gape; did you mean gap?"),
        ({"chain.snubbers.stop.gap": [0.0], "excitation.level": [1.0, 2.0]}, (), "have different numbers of values"),
        ({"chain.snubbers.stop.gap": ["1 kg"]}, (), "draws['chain.snubbers.stop.gap'] = 1 kg"),
        ({"chain.snubbers.stop.stiffness": [1e3, -5.0]}, (), "chain.snubbers.stop.stiffness = -5 N/m: "),
        ({"chain.snubbers.stop.gap": [0.0, float("nan")]}, (), "chain.snubbers[0].gap"),
        ({"chain.snubbers.stop.gap": [0.0]}, ("peak_forse",), "did you mean peak_force?"),
        ({"chain.snubbers.stop.gap": [0.0]}, "peak_forse", "did you mean peak_force?"),
        # one of the two won without a word
        (
            {"chain.snubbers.stop.gap": [0.0], "chain.snubbers[0].gap": [1e-3]},
            (),
            "that chain.snubbers.stop.gap names too",
        ),
        ({"chain.snubbers.stop.gap": 1e-3}, (), "is a single value; give one value for each case"),
        ({"chain.snubbers.stop.gap": np.zeros((2, 3))}, (), "is an array of the shape (2, 3)"),
        ({"chain.snubbers.stop.gap": [[0.0], [0.0, 1.0]]}, (), "is no array"),
        ({"chain.snubbers.stop.gap": [1j]}, (), "has values of type complex128"),
        ({"chain.snubbers.stop.gap": []}, (), "has no values"),
    ],
)
def test_what_cannot_be_drawn_is_refused_with_its_place(scenario, draws, responses, message):
    with pytest.raises(beamsim.ScenarioError) as refused:
        beamsim.ensemble(scenario, draws, responses)
    assert message in str(refused.value)
    assert all(problem.remedy for problem in refused.value.problems)
    with pytest.raises(beamsim.ScenarioError, match="workers = 0 is no number of workers"):
        beamsim.ensemble(scenario, {"chain.snubbers.stop.gap": [0.0]}, workers=0)


def test_an_interrupted_ensemble_goes_on_where_it_was(scenario, whole, tmp_path, monkeypatch):
    file = tmp_path / "gaps.h5"
    real, solved = CaseSolver.__call__, []

    def until_the_third(self, case):
        if len(solved) == 2:
            raise KeyboardInterrupt
        solved.append(case.number)
        return real(self, case)

    with monkeypatch.context() as patch:
        patch.setattr(CaseSolver, "__call__", until_the_third)
        with pytest.raises(KeyboardInterrupt):
            beamsim.ensemble(scenario, DRAWS, file=file, workers=1)
    assert journal_path(file).exists()
    fractions = []
    result = beamsim.ensemble(scenario, DRAWS, file=file, workers=1, progress=fractions.append)
    assert fractions == [0.5, 0.75, 1.0]
    assert not journal_path(file).exists()
    stored = beamsim.load(file)
    for name, column in whole.table.items():
        np.testing.assert_array_equal(result.table[name], column, err_msg=name)
        np.testing.assert_array_equal(stored.table[name], column, err_msg=name)
    with opened_journal(journal_path(file), "another", resume=False) as journal:
        journal.add(CaseOutcome(0, {}))
    with pytest.raises(beamsim.ResultFileError, match="belongs to another study"):
        beamsim.ensemble(scenario, {"excitation.level": [1.0]}, file=file)


def test_failed_draws_are_counted_and_the_others_kept(scenario, monkeypatch):
    """Of many draws only a selection is checked beforehand; a bad one among the others costs its row alone."""
    monkeypatch.setattr("beamsim.analyses.studies.plan.MOST_CHECKED", 10)
    stiffness = np.full(25, 1e3)
    stiffness[1] = -1.0
    result = beamsim.ensemble(scenario, {"chain.snubbers.stop.stiffness": stiffness}, ["contacts"])
    assert not result.complete
    assert result.summary["failed"] == 1
    assert "chain.snubbers[0].stiffness" in result["cases"]["failure"].values[1]
    assert np.isnan(result.table["snubbers/stop/contacts"][1])
    assert np.isfinite(np.delete(result.table["snubbers/stop/contacts"], 1)).all()


def test_a_measured_input_is_found_beside_its_scenario(tmp_path, monkeypatch):
    """The cases are plain data, which have no folder; the study may be called from anywhere."""
    folder, elsewhere = tmp_path / "case", tmp_path / "elsewhere"
    folder.mkdir()
    elsewhere.mkdir()
    time = np.linspace(0.0, 2.0, 201)
    values = np.column_stack([time, np.sin(6 * time)])
    np.savetxt(folder / "force.csv", values, delimiter=",", header="t (s),f (N)", comments="")
    text = CASE.replace("{kind: harmonic, applied_to: {mass: 1}, level: 1 N, frequency: 1 Hz}",
                        "{kind: sampled, applied_to: {mass: 1}, file: force.csv}").replace("3 s", "2 s")  # fmt: skip
    (folder / "case.yaml").write_text(text)
    monkeypatch.chdir(elsewhere)
    scenario = beamsim.load_scenario(folder / "case.yaml")
    table = beamsim.ensemble(scenario, {"chain.snubbers.stop.gap": [0.0, 1e-3]}).table
    summary = beamsim.run(scenario).summary
    assert summary["peak_force_n"]["stop"] > 0
    again = beamsim.load_scenario(folder / "case.yaml", {"chain.snubbers[0].gap": 1e-3})
    assert table["snubbers/stop/peak_force"][1] == pytest.approx(beamsim.run(again).summary["peak_force_n"]["stop"])
