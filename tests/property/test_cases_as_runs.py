"""A case has the same outcome, warnings, margins and values in a study as alone, whatever solves it."""

import math
from itertools import product
from pathlib import Path

import pytest
from sampling import first_apart
from shipped import PATHS, asked, config_path, one_of_each_sort, shipped

import beamsim
from beamsim.analyses.studies.plan import plan_draws
from beamsim.analyses.studies.responses import responses_of_result
from beamsim.outcomes import stop_requests
from beamsim.scenario.parameters import find_parameters, value_at
from beamsim.store.studies import journal_path, opened_journal, stored_study
from beamsim.trust.studies import design_study
from tests.helpers.solved import words_of

pytestmark = pytest.mark.portable

ALONE = {"run": beamsim.run, "continuation": beamsim.continuation}  # by analysis; all others are sweeps
VARIED = ("run.duration", "sweep.to", "sweep.parameter.to", "excitation.level")  # the first that a scenario has
QUICK = ("one_sided_65hz", "dry_friction", "foam_drop")
SHORT = {  # others are as long as where their screens are read, or as they stand
    "sweep_notched": {"sweep.to": "67 Hz", "sweep.rate": "32 oct/min"},  # too fast for its notch
    "continuation_60_120hz": {"sweep.from": "80 Hz", "sweep.to": "84 Hz"},
    "continuation_folds": {"sweep.follow_points_in.to": "0.1 N"},
    "special_points": {"sweep.from": "0.63 rad/s", "sweep.to": "0.61 rad/s", "sweep.follow_points_in.to": "0.12 N"},
    "isola": {"sweep.follow_points_in.to": "1.01 N"},
    "continuation_gap": {"sweep.continue_in.to": "0.1 mm"},
    "continuation_harmonic_balance": {"sweep.to": "76 Hz"},
    "continuation_level": {"sweep.continue_in.to": "0.5 g"},
    "continuation_overlay": {"sweep.from": "80 Hz", "sweep.to": "81 Hz"},
    "continuation_position": {"sweep.continue_in.from": "260 mm"},
    "continuation_stiffness": {"sweep.continue_in.to": "60 kN/m"},
    "two_panels_opening": {"sweep.continue_in.to": "0.5 g"},
    "shock_matched": {"run.duration": "0.1 s", "run.srs": None},  # shock_panel has response spectra
    "earthquake": {"run.duration": "1 s", "run.srs": None},
    "plate_panel": {"run.duration": "0.05 s"},
    "shock_panel": {"run.duration": "0.05 s"},
    "random_vibration": {"run.duration": "0.2 s", "run.spectrum.last": "0.1 s"},
}  # fmt: skip


def solves_cases(path):
    """Whether a config has a section whose cases a study can solve."""
    scenario = shipped(path)
    return scenario.run is not None if scenario.sweep is None else scenario.sweep.kind != "coexisting"


def written_in_sweep(path):
    """The keys of a config's sweep, or the config itself if its case is a run.

    A case that is a sweep is computed as a whole, as its command does; of a run a study computes what it asks for.
    """
    sweep = shipped(path).sweep
    return path.stem if sweep is None else (sweep.kind, *sorted(sweep.model_fields_set))


NOT_OF_A_CASE = ("vary", "optimise", "nnm", "identify_stiffness")
CASES: dict[object, Path] = {}
for path in one_of_each_sort([path for path in PATHS if solves_cases(path)], NOT_OF_A_CASE):
    CASES.setdefault(written_in_sweep(path), path)


def shortened(path):
    """Changes that shorten a config; of a continuation the curve is followed, and no branch that leaves it."""
    sweep = shipped(path).sweep
    curve = {"sweep.seek_at": 0, "sweep.side_branches": "none"} if sweep and sweep.kind == "continuation" else {}
    return curve | SHORT.get(path.stem, {})


def scenario_and_result(path, solve):
    """A shipped case and its result alone; of a run that of the command whose screen is read, unless it is shorter."""
    section = "run" if shipped(path).sweep is None else "sweep"
    words, more = words_of(section, path), shortened(path)
    compared = {"vary": None, "optimise": None, f"{section}.convergence": "on"}
    scenario = beamsim.load_scenario(beamsim.load_scenario(path, words[3::2]), compared | more)
    if more or shipped(path).study is not None or section == "sweep" or section not in asked(path):
        return scenario, alone(scenario)
    return scenario, beamsim.load(solve(*words).file)


def analysis_of(scenario):
    """The analysis that solves a scenario as a case."""
    return "run" if scenario.sweep is None else scenario.sweep.kind


def alone(scenario):
    """The result of a scenario."""
    return ALONE.get(analysis_of(scenario), beamsim.sweep)(scenario)


def in_a_study(scenario):
    """The outcome of the only case of a study that leaves a scenario as it is, and the study."""
    section = scenario.run if scenario.sweep is None else scenario.sweep
    for path in VARIED:
        try:
            value = value_at(scenario, find_parameters(scenario, path)[0])
            break
        except ValueError:
            continue
    outcomes = []
    study = design_study(plan_draws(scenario, {path: [value]}), on_outcome=outcomes.append)
    (case,) = outcomes
    assert case.compared == (section.convergence == "on")
    assert study["cases"]["compared"].values.tolist() == [case.compared]
    return case, study


def same(one, other):
    """Whether numbers, texts, and mappings and rows of them are the same, but for round-off."""
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(same(one[key], other[key]) for key in one)
    if isinstance(one, (list, tuple)):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, float):
        return math.isclose(one, other, rel_tol=1e-9, abs_tol=1e-11) or (math.isnan(one) and math.isnan(other))
    return one == other


def demand_same(result, case, study):
    """Compare a case with the result of its command."""
    assert case.outcome.text == result.outcome.text
    assert case.outcome.gravest_kind == result.outcome.gravest_kind
    assert case.warnings == result.warnings
    assert same(dict(case.margins), result.summary.get("margins", {}))
    whole = {} if case.failed else responses_of_result(result)  # of a motion that stopped early no study has values
    left_out = whole.keys() - case.values.keys()
    assert {name.rpartition("/")[2] for name in left_out} <= {"gapping"}  # which is computed on request
    assert case.values.keys() <= whole.keys()
    assert [name for name, x in case.values.items() if not same(whole[name], x)] == []
    assert study["cases"]["outcome"].values.tolist() == [result.outcome.text]
    assert study["cases"]["warnings"].values.tolist() == ["\n".join(result.warnings)]
    assert study.outcome.usable == result.outcome.usable
    assert study.outcome.complete == result.outcome.complete


@first_apart(
    "path", len(QUICK), sorted(CASES.values(), key=lambda path: path.stem not in QUICK),
    ids=lambda path: f"{path.parent.name}/{path.stem}",
)  # fmt: skip
def test_a_shipped_case_is_judged_in_a_study_as_alone(path, solve):
    scenario, result = scenario_and_result(path, solve)
    demand_same(result, *in_a_study(scenario))


@pytest.mark.parametrize("name", [*QUICK, "sweep_test", "continuation_gap"])
def test_a_case_that_is_not_compared_is_judged_in_a_study_as_alone(name):
    """Without a finer model, of each analysis."""
    path = config_path(name)
    section = "run" if shipped(path).sweep is None else "sweep"
    scenario = beamsim.load_scenario(path, {f"{section}.convergence": "off", **shortened(path)})
    demand_same(alone(scenario), *in_a_study(scenario))


BEAM = """\
beam: {length: 270 mm, width: 50 mm, thickness: 5 mm, youngs_modulus: 69 GPa, density: 2700, elements: 6,
  damping: {kind: modal, ratio: 1 %}}
snubbers: [{name: tip, position: 270 mm, side: below, stiffness: 151 kN/m, gap: 0 mm,
  damping: {kind: viscous, coefficient: 20 N s/m}}]
excitation: {kind: harmonic, applied_to: base, level: 2 g, frequency: 65 Hz}
run: {duration: 0.05 s, sample_rate: 5 kHz}
limits: {peak_force: 50 N, peak_acceleration: 100 g, gap: 5 mm, rms_displacement: 1 mm, gapping: 2}
"""
"""Its dashpot pulls, root mean squares are those of spectra, and acceleration jumps at touch-down."""


MORE = [
    {}, {"reduction": {"modes": 1}, "excitation.frequency": "400 Hz"}, {"run.low_pass": "2 kHz"},
    {"run.method": "reference", "run.duration": "1 ms", "reduction.modes": 2}, {"run.max_events": 3},
    {"snubbers[0].stiffness": "1e9 N/m"},
    {"run.spectrum": {"last": "20 ms"}, "snubbers[0].force_deflection": [[0, 0], [1e-6, 1]],
     "snubbers[0].stiffness": None}, {"run.from": "10 ms", "run.impacts": {}}, {"excitation.level": "40 g"},
]  # fmt: skip


@first_apart(("more", "convergence"), 3, product(MORE, ["off", "on"]))
def test_a_case_that_is_warned_of_or_not_reliable_is_so_in_a_study(more, convergence):
    scenario = beamsim.load_scenario(BEAM, {**more, "run.convergence": convergence})
    demand_same(alone(scenario), *in_a_study(scenario))


def test_the_comparison_can_fail():
    scenario = beamsim.load_scenario(BEAM, {"run.convergence": "off"})
    result, (case, study) = alone(scenario), in_a_study(scenario)
    other = beamsim.run(beamsim.load_scenario(BEAM, {"run.convergence": "off", "excitation.level": "40 g"}))
    with pytest.raises(AssertionError):
        demand_same(other, case, study)
    demand_same(result, case, study)


UNRELIABLE = {"reduction": {"modes": 1}, "excitation.frequency": "400 Hz"}
GAPS = {"vary": {"kind": "grid", "parameters": [{"path": "snubbers.tip.gap", "values": [0.0, 1e-4]}]}}


@pytest.mark.parametrize("workers", [1, 2])
def test_a_study_with_a_case_that_is_not_reliable_is_not_reliable(workers, tmp_path):
    """It said ok in all cases, with exit code 0."""
    case = beamsim.load_scenario(BEAM, {**UNRELIABLE, **GAPS, "run.convergence": "off"})
    study = beamsim.design_study(case, workers=workers)
    assert study.outcome.gravest_kind == "untrusted"
    assert study.summary["not_reliable"] == 2
    assert study["cases"]["passing"].values.tolist() == [False, False]
    assert {of["verdict"] for of in study.summary["margins"].values()} == {"not reliable"}
    assert {*study["cases"]["verdict"].sel(limit="peak_force").values.tolist()} == {"not reliable"}
    assert "best" not in study.summary
    path = beamsim.write_result(study, tmp_path / "study.h5")
    stored = beamsim.load(path)
    for name in ("outcome", "warnings", "compared", "verdict"):
        assert stored["cases"][name].values.tolist() == study["cases"][name].values.tolist()


def near_limit(**more):
    """Cases of which the second is nearer to a limit than its force changes with a finer model."""
    plain, base = BEAM[: BEAM.index("limits:")], {"reduction": {"modes": 2}, "run.duration": "20 ms"}
    alone = beamsim.run(beamsim.load_scenario(plain, {**base, "excitation.level": 20.0}))
    limits = {"peak_force": 1.0001 * alone.summary["peak_force_n"]["tip"]}
    vary = {"kind": "grid", "parameters": [{"path": "excitation.level", "values": [2.0, 5.0, 10.0, 19.99, 20.0]}]}
    return beamsim.load_scenario(plain, {**base, "limits": limits, "vary": {**vary, **more}})


def test_cases_that_decide_are_compared_unless_that_is_switched_off():
    case = near_limit(minimise="peak_force")
    study = beamsim.design_study(case)
    compared = study["cases"]["compared"].values.tolist()
    assert compared == [True, False, False, True, True]  # the best, a near one, and the worst
    assert study.summary["compared"] == 3
    worst = study.summary["margins"]["peak_force"]
    alone = beamsim.run(beamsim.load_scenario(case, {"vary": None, "excitation.level": 20.0}))
    assert worst["case"] in (3, 4)
    assert worst["lowest"] < worst["value"] < worst["highest"]
    verdict = study["cases"]["verdict"].sel(limit="peak_force").values[4]
    assert verdict == alone.summary["margins"]["peak_force"]["verdict"]
    assert study["cases"]["outcome"].values[4] == alone.status
    none = beamsim.design_study(beamsim.load_scenario(case, {"run.convergence": "off"}))
    assert not none["cases"]["compared"].values.any()
    every = beamsim.design_study(beamsim.load_scenario(case, {"run.convergence": "on"}))
    assert every["cases"]["compared"].values.all()


def demand_same_studies(one, other):
    """Compare the outcomes of two studies."""
    for name in ("compared", "outcome"):
        assert one["cases"][name].values.tolist() == other["cases"][name].values.tolist()
    assert one.summary["margins"] == other.summary["margins"]
    assert one.outcome == other.outcome


def test_workers_change_nothing():
    plan = beamsim.plan_designs(near_limit(minimise="peak_force"))
    demand_same_studies(design_study(plan, workers=2), design_study(plan))


def test_an_interruption_amid_the_comparison_changes_nothing(tmp_path):
    plan = beamsim.plan_designs(near_limit(minimise="peak_force"))
    target = tmp_path / "study.h5"
    seen = []
    with opened_journal(journal_path(target), plan.fingerprint, resume=True) as journal:
        journal_add = journal.add
        journal.add = lambda outcome: (seen.append(outcome), journal_add(outcome))
        with stop_requests(lambda: len(seen) > 5):
            part, _ = stored_study(plan, journal, target)
    assert part.outcome.interrupted
    assert part.status.startswith("interrupted during the comparison with a finer model")
    with opened_journal(journal_path(target), plan.fingerprint, resume=True) as journal:
        resumed, _ = stored_study(plan, journal, target)
    demand_same_studies(resumed, design_study(plan))
    assert not journal_path(target).exists()


def of_seeds(path):
    """A shipped config whose input has a seed, made short."""
    scenario = beamsim.load_scenario(path)
    short = {"run.duration": "0.2 s", "run.spectrum": None} if scenario.excitation.kind == "matched" else {}
    return beamsim.load_scenario(path, {"vary": None, **short})


SEEDED = [path for path in PATHS if hasattr(shipped(path).excitation, "seed")]


@pytest.mark.parametrize("path", SEEDED, ids=lambda path: path.stem)
def test_seeds_of_every_shipped_input_that_has_one_are_realisations(path):
    """Of a matched record that ended in a KeyError, and before in a refusal of the file of its curve."""
    scenario = of_seeds(path)
    found = beamsim.ensemble(scenario, {"excitation.seed": [1, 2]})
    amplitudes = {"excitation.amplitudes": "random"} if hasattr(scenario.excitation, "amplitudes") else {}
    changes = {"excitation.seed": 2, **amplitudes, "run.convergence": "off"}
    values = responses_of_result(beamsim.run(beamsim.load_scenario(scenario, changes)))
    force = next(name for name in values if name.endswith("peak_force"))
    assert found.responses[force].values[1] == pytest.approx(values[force], rel=1e-9)
    assert found.responses[force].values[0] != found.responses[force].values[1]
    vary = {"kind": "grid", "parameters": [{"path": "excitation.seed", "values": [1, 2]}]}
    study = beamsim.design_study(beamsim.load_scenario(scenario, {"vary": vary}))
    assert study.responses[force].values == pytest.approx(found.responses[force].values, rel=1e-12)


def test_there_are_shipped_inputs_with_seeds():
    assert {shipped(path).excitation.kind for path in SEEDED} >= {"random", "matched"}


MATCHED = """\
chain: {masses: [1 kg], springs: [100 kN/m], damping: {kind: modal, ratio: 5 %}}
snubbers: [{name: stop, mass: 1, side: below, gap: 0 mm, stiffness: 1 MN/m}]
excitation: {kind: matched, applied_to: base, srs: [[50 Hz, 20 g], [100 Hz, 40 g], [400 Hz, 40 g]], quality: 10,
  duration: 0.04 s, seed: 1}
run: {duration: 0.05 s, sample_rate: 5 kHz, convergence: off}
limits: {peak_force: 1 kN}
"""


@pytest.mark.parametrize(
    "vary",
    [
        {"kind": "grid", "parameters": [{"path": "excitation.seed", "values": [1, 2]}]},
        {"kind": "latin_hypercube", "samples": 2, "parameters": [{"path": "excitation.seed", "from": 1, "to": 9}]},
        {"kind": "one_at_a_time", "parameters": [{"path": "excitation.seed", "values": [2]}]},
        {"kind": "zip", "parameters": [{"path": "excitation.seed", "values": [1, 2]},
                                       {"path": "excitation.quality", "values": [10, 12]}]},
    ],
    ids=lambda vary: vary["kind"],
)  # fmt: skip
def test_seeds_of_a_matched_record_in_each_kind_of_study(vary):
    study = beamsim.design_study(beamsim.load_scenario(MATCHED, {"vary": vary}))
    force = study.responses["snubbers/stop/peak_force"].values
    assert force[0] != force[1]
    seed = int(study.table["excitation.seed"][0])
    if vary["kind"] != "zip":
        alone = beamsim.run(beamsim.load_scenario(MATCHED, {"excitation.seed": seed})).summary
        assert force[0] == pytest.approx(alone["peak_force_n"]["stop"], rel=1e-9)
