"""Result file, journal, tables and pictures of design studies, from outcomes that no solver made."""

import json
import subprocess
import sys

import numpy as np
import pytest
from sampling import first_apart

import beamsim
from beamsim.analyses.studies.plan import plan_designs, plan_draws
from beamsim.analyses.studies.summary import result_of
from beamsim.cases import CaseOutcome
from beamsim.errors import ResultFileError
from beamsim.files import replacement_file
from beamsim.outcomes import Outcome, OutcomeKind
from beamsim.plots.drawing import save_figures
from beamsim.plots.studies import design_figures, shown_quantities
from beamsim.scenario import load_scenario
from beamsim.store.results import write_result
from beamsim.store.studies import journal_path, opened_journal
from tests.fabricated import solved_case

BASE = """\
title: Fabricated study
beam: {length: 270 mm, width: 50 mm, thickness: 5 mm, youngs_modulus: 69 GPa, density: 2700, elements: 4}
snubbers: [{name: tip, position: 270 mm, side: below, stiffness: 151.1 kN/m, gap: 0 mm}]
excitation: {kind: harmonic, applied_to: base, level: 2 g, frequency: 65 Hz}
run: {duration: 0.05 s}
limits: {peak_force: 30 N, gap: 1 mm, bending_stress: 8 MPa}
"""
ONE = "{path: snubbers.tip.stiffness, from: 10 kN/m, to: 1000 kN/m, points: 5, spacing: logarithmic}"
TWO = "{path: snubbers.tip.gap, values: [0 mm, 0.1 mm, 0.3 mm]}"
WORD = "{path: beam.supports.right, values: [free, pinned]}"
STUDIES = {
    "curve": f"vary: {{kind: grid, parameters: [{ONE}]}}",
    "words": f"vary: {{kind: grid, parameters: [{WORD}]}}",
    "map": f"vary: {{kind: grid, parameters: [{ONE}, {TWO}]}}",
    "map_of_words": f"vary: {{kind: grid, parameters: [{ONE}, {WORD}]}}",
    "three": f"vary: {{kind: grid, parameters: [{ONE}, {TWO}, {WORD}]}}",
    "zip": f"vary: {{kind: zip, parameters: [{ONE}, {{path: excitation.level, from: 1, to: 2, points: 5}}]}}",
    "tornado": f"vary: {{kind: one_at_a_time, parameters: [{ONE}, {TWO}, {WORD}]}}",
    "sobol": "vary: {kind: sobol, samples: 4, minimise: peak_force, parameters: "
    "[{path: beam.thickness, tolerance: 5 %}, {path: snubbers.tip.gap, tolerance: 0.1 mm}]}",
    "tolerances": f"vary: {{kind: grid, minimise: peak_force, parameters: [{ONE}, {TWO}], tolerances: "
    "{samples: 4, quantile: 60 %, parameters: [{path: snubbers.tip.stiffness, tolerance: 10 %}, "
    "{path: beam.thickness, tolerance: 0.1 mm}]}}",
    "sample": "vary: {kind: latin_hypercube, samples: 12, parameters: "
    "[{path: beam.thickness, tolerance: 5 %}, {path: snubbers.tip.gap, tolerance: 0.1 mm}]}",
}


def limits_of(plan):
    return {} if plan.scenario.limits is None else plan.scenario.limits.values_by_name


def outcome(limits, index, rng):
    force, gap = rng.uniform(10, 50), rng.uniform(0, 2e-3)
    values = {
        "probes/tip/peak_displacement": rng.uniform(1e-4, 1e-3),
        "probes/middle/peak_displacement": rng.uniform(1e-5, 1e-4),
        "snubbers/tip/peak_force": force,
        "snubbers/tip/largest_gap": gap,
        "snubbers/tip/contact_share": rng.uniform(0, 1),
        "bending_stress": 1e6 * rng.uniform(1, 9),
        "closed_frequencies_hz": [200.0 + force, 500.0 + force, np.nan],
    }
    return solved_case(limits, index, values, processor_time_s=0.1)


def failure(index, reason):
    return CaseOutcome(index, {}, Outcome.of(OutcomeKind.FAILED, "failed", reason))


def fabricated(name, failed=(), missing=()):
    plan = plan_designs(load_scenario(f"{BASE}{STUDIES[name]}\n"))
    rng = np.random.default_rng(1)
    outcomes = {case.number: outcome(limits_of(plan), case.number, rng) for case in plan.cases}
    outcomes |= {k: failure(k, "more than max_events events") for k in failed}
    return result_of(plan, {k: o for k, o in outcomes.items() if k not in missing}, 1.5)


@pytest.mark.filterwarnings("default")
def test_xarray_sees_parameters_as_coordinates(tmp_path):
    xarray = pytest.importorskip("xarray")
    result = fabricated("map")
    path = write_result(result, tmp_path / "study.h5")
    with xarray.open_dataset(path, group="cases", engine="h5netcdf") as data:
        stress, gap = (
            data["value"].sel(response="bending_stress"),
            data["parameter_value"].sel(parameter="snubbers.tip.gap"),
        )
        assert stress.dims == gap.dims == ("case",)
        np.testing.assert_array_equal(np.unique(gap), [0.0, 1e-4, 3e-4])
        assert data["modal_value"].dims == ("modal_response", "case", "mode")
        assert json.loads(data["value"].units_of_each)[list(data["response"]).index("bending_stress")] == "Pa"
        picked = stress.values[gap.values == 1e-4]
    expected = result.responses["bending_stress"].values.reshape(result.shape)[:, 1]
    np.testing.assert_array_equal(picked, expected)
    sample = fabricated("sample")
    path = write_result(sample, tmp_path / "sample.h5")
    with xarray.open_dataset(path, group="cases", engine="h5netcdf") as data:
        assert {"beam.thickness", "snubbers.tip.gap"} <= set(data["parameter"].values)
        for parameter in sample.parameters:
            values = data["parameter_value"].sel(parameter=parameter.path)
            np.testing.assert_array_equal(values, parameter.values)


def test_a_file_of_many_cases_is_opened_again(tmp_path):
    """Where arrays were larger than 1 MiB, and some responses had no part of them, it was refused as damaged."""
    gaps = np.linspace(0.0, 1e-3, 1500)
    plan = plan_draws(load_scenario(BASE, {"limits": None}), {"snubbers.tip.gap": gaps})
    values = {f"snubbers/stop_{k}/peak_force": 20.0 for k in range(20)}
    values["closed_frequencies_hz"] = [200.0, 500.0, 900.0, 1e3, 2e3, 3e3]
    result = result_of(plan, {case.number: CaseOutcome(case.number, values) for case in plan.cases})
    read = beamsim.load(write_result(result, tmp_path / "study.h5"))
    np.testing.assert_array_equal(read.table["snubbers.tip.gap"], gaps)
    np.testing.assert_array_equal(read.table["closed_frequencies_hz_6"], np.full(1500, 3e3))


# --- pictures ---------------------------------------------------------------------------------------------------------


@first_apart(("name", "picture"), 2, [
        ("map", "maps"), ("sample", "sensitivity histograms scatter"), ("curve", "curves"), ("words", "curves"),
        ("map_of_words", "maps"), ("three", "slices scatter"),
        ("tolerances", "histograms maps"), ("tornado", "sensitivity"),
    ])  # fmt: skip
def test_pictures(name, picture, tmp_path):
    result = fabricated(name, failed=(1,))
    paths = save_figures(design_figures(result), tmp_path, "study")
    assert [path.name for path in paths] == [f"study_{name}.png" for name in picture.split()]
    assert all(path.stat().st_size > 10_000 for path in paths)


def test_limited_quantities_come_first_and_their_limit_is_drawn():
    result = fabricated("curve")
    assert shown_quantities(result)[:2] == ["peak_force", "bending_stress"]
    figure = result.plot()["curves"]
    ax = figure.axes[0]
    assert ax.get_ylabel() == "Peak force (N)"
    flat = [line for line in ax.lines if len(set(line.get_ydata())) == 1]
    assert [line.get_ydata()[0] for line in flat] == [30.0]
    np.testing.assert_allclose(ax.lines[0].get_ydata(), result.responses["snubbers/tip/peak_force"].values)
    assert ax.get_xscale() == "log"


def test_a_search_is_drawn_over_its_range_and_the_case_as_it_is_is_no_design():
    """Designs that crowd at an end of a range are no reason for a logarithmic axis."""
    text = "optimise: {minimise: peak_force, parameters: [{path: snubbers.tip.gap, from: 0 mm, to: 1 mm}]}"
    plan = plan_designs(load_scenario(BASE + text))
    gaps, forces = [0.0, *np.geomspace(9e-4, 1e-9, 11)], [5.0, *np.linspace(29.0, 10.0, 11)]
    tried = {
        k: solved_case(
            limits_of(plan), k,
            {"snubbers/tip/peak_force": force, "snubbers/tip/largest_gap": gap, "bending_stress": 1e6}, given=(gap,),
        )
        for k, (gap, force) in enumerate(zip(gaps, forces, strict=True))
    }  # fmt: skip
    figures = result_of(plan, tried, 1.0).plot()
    assert {ax.get_xscale() for ax in figures["curves"].axes} == {"linear"}
    best = next(line for line in figures["search"].axes[0].lines if line.get_drawstyle() == "steps-post")
    np.testing.assert_array_equal(best.get_ydata(), [np.nan, *forces[1:]])


# --- journal ----------------------------------------------------------------------------------------------------------


def outcomes(count):
    rng = np.random.default_rng(0)
    return [outcome({"peak_force": 30.0}, k, rng) for k in range(count)]


def same(kept, read):
    """NaN equals NaN."""
    return [str(vars(o)) for o in kept] == [str(vars(o)) for o in read]


def test_a_journal_gives_back_the_same_bits(tmp_path):
    path = tmp_path / "deep" / "x.h5.partial"
    with opened_journal(path, "print", resume=False) as journal:
        for item in outcomes(5):
            journal.add(item)
    with opened_journal(path, "print", resume=True) as journal:
        assert same(outcomes(5), journal.outcomes.values())
        journal.add(failure(7, "why"))
    with opened_journal(path, "print", resume=True) as journal:
        assert journal.outcomes[7] == failure(7, "why")


def test_a_limit_is_judged_with_the_change_of_its_value_also_after_a_study_was_resumed(tmp_path):
    """29 N of 30 N, each with another change with a finer model; the range of the last one is not known."""
    ranges = [(29.0, 29.0), (28.0, 29.9), (28.0, 31.0), (31.0, 32.0), (-np.inf, np.inf)]
    with opened_journal(tmp_path / "x.partial", "print", resume=False) as journal:
        for k, ends in enumerate(ranges):
            journal.add(solved_case({"peak_force": 30.0}, k, {"snubbers/tip/peak_force": 29.0}, {"peak_force": ends}))
    with opened_journal(tmp_path / "x.partial", "print", resume=True) as journal:
        case = load_scenario(f"{BASE}{STUDIES['curve']}\n", ["limits.gap=null", "limits.bending_stress=null"])
        result = result_of(plan_designs(case), journal.outcomes)
    assert result["cases"]["passing"].values.tolist() == [True, True, False, False, False]
    assert result.summary["best"][0]["case"] in (0, 1)


def test_a_journal_cut_anywhere_keeps_every_whole_line(tmp_path):
    path = tmp_path / "x.partial"
    with opened_journal(path, "print", resume=False) as journal:
        for item in outcomes(4):
            journal.add(item)
    whole = path.read_bytes()
    ends = [k + 1 for k, byte in enumerate(whole) if byte == ord("\n")]
    for cut in sorted({*range(0, len(whole) + 1, 41), *ends, *(end - 1 for end in ends)}):
        path.write_bytes(whole[:cut])
        with opened_journal(path, "print", resume=True) as journal:
            expected = max(0, sum(end - 1 <= cut for end in ends) - 1)  # a whole line may lack its end
            assert same(outcomes(expected), journal.outcomes.values())
            journal.add(outcomes(4)[3])  # the broken line is gone, so this one can be read
        with opened_journal(path, "print", resume=True) as journal:
            assert len(journal.outcomes) == (expected if expected == 4 else expected + 1)


def test_a_journal_of_another_study(tmp_path):
    path = journal_path(tmp_path / "x.h5")
    assert path.name == "x.h5.partial"
    with opened_journal(path, "one", resume=False) as journal:
        journal.add(outcomes(1)[0])
    with pytest.raises(ResultFileError, match="another study"), opened_journal(path, "two", resume=True):
        pass
    with opened_journal(path, "one", resume=False) as anew:
        assert (anew.outcomes, anew.added) == ({}, False)
    with opened_journal(path, "two", resume=False) as other:
        assert (other.outcomes, other.added) == ({}, False)


DAMAGED = [
    b"7",
    b"[1]",
    b"null",
    b"{}",
    b"[" * 100_000,
    b'{"index": "x"}',
    b"\0\0",
    b"\xff\xfe",
    b'"text"',
    b"1" * 10_000,
]


@pytest.mark.parametrize("line", DAMAGED, ids=range(len(DAMAGED)))
def test_damaged_lines_of_a_journal_are_dropped_and_reported(line, tmp_path, caplog):
    path = tmp_path / "x.partial"
    with opened_journal(path, "print", resume=False) as journal:
        for item in outcomes(3):
            journal.add(item)
    lines = path.read_bytes().splitlines()
    path.write_bytes(b"\n".join([*lines[:2], line, *lines[2:]]) + b"\n")
    with opened_journal(path, "print", resume=True) as journal:
        assert same(outcomes(3), journal.outcomes.values())
    assert "line 3" in caplog.text


def test_a_journal_is_kept_until_another_study_has_a_case(tmp_path):
    path = tmp_path / "x.partial"
    with opened_journal(path, "one", resume=False) as journal:
        journal.add(outcomes(1)[0])
    before = path.read_bytes()
    with opened_journal(path, "two", resume=False):
        pass
    assert path.read_bytes() == before
    with opened_journal(path, "two", resume=False) as journal:
        journal.add(outcomes(2)[1])
    assert (tmp_path / "x.partial.1").read_bytes() == before


def test_temporary_files_of_killed_processes_are_removed(tmp_path):
    """A process that has ended, one that runs (this one), and one of another machine."""
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    with replacement_file(tmp_path / "x") as temporary:
        temporary.write_text("x")
        begin, machine, own, *_ = temporary.name.split("-")
        others = {
            name: tmp_path / f"{begin}-{name}-0.tmp"
            for name in (f"{machine}-{ended.pid}", f"{machine}-{own}", f"0-{ended.pid}")
        }
        for path in others.values():
            path.touch()
    with replacement_file(tmp_path / "y") as temporary:
        temporary.write_text("y")
    assert [path.exists() for path in others.values()] == [False, True, True]


def test_a_journal_in_use_is_left_alone(tmp_path):
    pytest.importorskip("fcntl")
    path = tmp_path / "x.partial"
    with opened_journal(path, "print", resume=False) as journal:
        journal.add(outcomes(1)[0])
        with pytest.raises(ResultFileError, match="another process"), opened_journal(path, "print", resume=True):
            pass
        journal.add(outcomes(2)[1])
    with opened_journal(path, "print", resume=True) as journal:
        assert len(journal.outcomes) == 2
