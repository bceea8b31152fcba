"""Sweeps, continuations and normal modes are compared with a finer model as runs are."""

import math
from itertools import count

import numpy as np
import pytest

import beamsim
from beamsim.analyses.sweep.analysis import sweep as unchecked
from beamsim.cli.tables import table_rows
from beamsim.outcomes import stop_requests
from beamsim.results.result import ALLOWED_ERROR
from beamsim.scenario import load_scenario
from tests.helpers.branches import long_steps

BEAM = {"length": 0.27, "bending_stiffness": 2.0, "mass_per_length": 0.25, "damping": {"kind": "modal", "ratio": 0.05}}
TIP = {"name": "tip", "position": 0.27, "side": "below", "stiffness": "10 kN/m", "gap": "0.1 mm"}


def case(modes, **more):
    stepped = {"kind": "stepped", "from": "50 Hz", "to": "70 Hz", "points": 2, "accelerations": True}
    return load_scenario(
        {
            "beam": BEAM,
            "snubbers": [TIP],
            "excitation": {"kind": "harmonic", "applied_to": "base", "level": "2 g", "frequency": "60 Hz"},
            "reduction": {"modes": modes},
            "sweep": stepped,
        }
        | more
    )


def highest(curve, quantity, name):
    """The five largest values of a curve, the largest first."""
    return np.sort(curve.channel(quantity, name).peak)[:-6:-1]


def test_errors_of_a_sweep_follow_from_the_finer_model():
    """From the values of the cycles that are near the largest, and from the shares of all cycles."""
    swept = {"kind": "swept_sine", "from": "50 Hz", "to": "60 Hz", "rate": "60 oct/min", "accelerations": True}
    result = beamsim.sweep(case(3, sweep=swept))
    s, model = result.summary, result.summary["convergence_model"]
    assert (model["first_modes"], model["modes"]) == (3, 9)
    finer = unchecked(case(9, beam=BEAM | {"elements": 40}, sweep=swept))
    (name, one), (_, two) = *result.curves.items(), *finer.curves.items()
    for entry, quantity, least in (
        ("peak_force_n", "force", 0.0),
        ("peak_acceleration_g", "absolute_acceleration", 1e-3),
    ):
        for place, stated in s["convergence"][entry].items():
            a, b = (highest(curve, quantity, place.partition(" ")[2]) for curve in (one, two))
            change = np.abs(a - b)[a >= 0.9 * a[0]].max() / max(a[0], b[0])
            assert stated == pytest.approx(max(9 / 8 * change, least), rel=1e-5) or least
            assert stated >= max(9 / 8 * change, least) * (1 - 1e-9)
    shares = [curve["contact_share"].sel(snubber="tip").values for curve in (one, two)]
    change = one.weights * (shares[0] - shares[1])
    error = 9 / 8 * (abs(change.sum()) + 2 * np.sqrt(np.sum(change**2))) / max(one.weights @ share for share in shares)
    assert s["convergence"]["contact_share"][f"{name} tip"] == pytest.approx(error, rel=1e-6)


def test_stated_errors_of_a_sweep_hold_the_true_ones():
    """The truth has 40 modes and 80 elements; the bounce of a dashpot makes every cycle another one."""
    stop = TIP | {"damping": {"kind": "ratio", "ratio": "2 %"}, "stiffness": "150 kN/m", "gap": 0}
    beam = {"length": 0.27, "bending_stiffness": 35.9, "mass_per_length": 0.675}
    beam |= {"damping": {"kind": "modal", "ratio": 0.01}, "point_masses": [{"position": 0.27, "mass": "4.2 g"}]}
    swept = {"kind": "swept_sine", "from": "70 Hz", "to": "90 Hz", "rate": "80 oct/min", "direction": "down"}
    more = {"snubbers": [stop], "sweep": swept, "probes": [{"name": "middle", "position": 0.135}]}
    more["sweep"] |= {"accelerations": True}
    s = beamsim.sweep(case(6, beam=beam, **more)).summary
    truth = unchecked(case(40, beam=beam | {"elements": 80}, **more)).summary
    for entry in ("peak_displacement_m", "peak_acceleration_g", "peak_force_n", "contact_share"):
        for curve, values in s[entry].items():
            for name, value in values.items():
                true = abs(value - truth[entry][curve][name]) / max(value, truth[entry][curve][name])
                assert true <= max(s["convergence"][entry][f"{curve} {name}"], 1e-6), (entry, name)


def test_values_under_a_notched_level_are_known_as_well_as_it_holds_its_limits():
    """Every level that holds them as well would do; what it is lowered for is known to the tolerance of its table."""
    swept = {"kind": "swept_sine", "from": "45 Hz", "to": "60 Hz", "rate": "60 oct/min", "accelerations": True}
    more = {"snubbers": [], "probes": [{"name": name, "position": x} for name, x in (("end", 0.27), ("middle", 0.135))]}
    result = beamsim.sweep(case(3, sweep=swept | {"notch_to": {"probes.end.acceleration": "5 g"}}, **more))
    (curve,), errors = result.curves.values(), result.summary["convergence"]
    (limit,) = curve.notching.limits
    excess = max(limit.share - 1.0, 2e-3)
    assert errors["peak_acceleration_g"][f"{curve.name} end"] >= 1e-3
    assert errors["peak_acceleration_g"][f"{curve.name} middle"] >= excess * (1 - 1e-9)
    assert errors["peak_displacement_m"][f"{curve.name} end"] >= excess * (1 - 1e-9)


def test_a_sweep_with_too_few_modes_is_marked(tmp_path):
    """One mode: forces on the stop belong to the model."""
    result = beamsim.sweep(case(1, snubbers=[TIP | {"stiffness": "100 kN/m"}]))
    assert any(key.startswith("peak_force_n.") for key in result.summary["doubtful"])
    assert result.outcome.outcomes_with_code("figures_doubtful")
    rows = list(table_rows(result))
    assert any("NOT CONVERGED" in text and " N" in text for _, text in rows)
    stored = beamsim.load(beamsim.write_result(result, tmp_path / "sweep.h5"))
    assert stored.summary["convergence"] == result.summary["convergence"]
    assert stored.outcome == result.outcome


def test_an_acceleration_at_a_dashpot_without_mass_is_marked_however_many_modes_there_are():
    """It grows with the modes, and carried no mark."""
    damped = [TIP | {"stiffness": "100 kN/m", "damping": {"kind": "ratio", "ratio": 0.05}}]
    one = {"kind": "stepped", "from": "63 Hz", "to": "64 Hz", "points": 2}
    peaks = []
    for modes in (6, 9):
        result = beamsim.sweep(case(modes, snubbers=damped, sweep=one))
        assert result.summary["doubtful"] == ["peak_acceleration_g.up_0 tip"]
        assert result.outcome.remedy.startswith("for the peak acceleration of up_0 tip give the structure a point mass")
        peaks.append(result.summary["peak_acceleration_g"]["up_0"]["tip"])
    assert peaks[1] > 1.2 * peaks[0]


def test_a_limit_on_what_a_sweep_does_not_follow_is_neither_met_nor_exceeded():
    """`--check` passed."""
    left_out = {"kind": "stepped", "from": 50, "to": 60, "points": 2, "accelerations": False, "convergence": "off"}
    result = beamsim.sweep(case(3, sweep=left_out, limits={"peak_acceleration": "1 g", "peak_force": "1 kN"}))
    verdicts = {name: item["verdict"] for name, item in result.summary["margins"].items()}
    assert verdicts == {"peak_acceleration": "not reliable", "peak_force": "ok"}
    assert "limits.peak_acceleration is not checked: this sweep does not compute its value" in result.warnings


def test_a_stop_between_the_sweep_and_its_comparison_is_told():
    """The result is whole, and said "complete", though nothing was compared."""
    saved = []
    result = beamsim.sweep(case(3), save=saved.append, stop=lambda: any(r.complete for r in saved))
    assert saved[-1].complete
    assert result.outcome.interrupted
    assert result.status == "interrupted during the comparison with a finer model"


def test_a_comparison_can_be_left_out_and_interrupted():
    off = beamsim.sweep(case(3, sweep={"kind": "stepped", "from": 50, "to": 70, "points": 2, "convergence": "off"}))
    assert (off.summary["convergence_model"]["reason"], "not requested" in str(off)) == ("not requested", True)
    asked = count()
    whole = beamsim.sweep(case(3), stop=lambda: next(asked) < 0)
    first = next(asked)
    of_first_model = count()
    with stop_requests(lambda: next(of_first_model) < 0):
        unchecked(case(3))
    ended = next(of_first_model)
    assert ended < first
    again = count()
    partial = beamsim.sweep(case(3), stop=lambda: next(again) > ended + 1)
    assert partial.outcome.interrupted
    assert partial.summary["peak_force_n"] == whole.summary["peak_force_n"]  # nothing of the first model is lost
    assert "convergence" not in partial.summary


def test_a_continuation_where_it_is_asked_for():
    path = {"kind": "continuation", "from": "50 Hz", "to": "56 Hz", "side_branches": "none"}
    assert "not checked" in str(beamsim.continuation(case(2, sweep=path)))
    result = beamsim.continuation(case(2, sweep=path | {"convergence": "on"}))
    changes = result.summary["convergence"]
    assert result.summary["convergence_model"]["modes"] == 6
    assert 0.0 < max(changes["peak_displacement_m"].values()) < 0.5
    assert set(changes) >= {"peak_displacement_m", "peak_frequency_hz", "open_frequencies_hz"}
    listed = {
        key for entry, of in changes.items() for key in (f"{entry}.{x}" for x, y in of.items() if y > ALLOWED_ERROR)
    }
    assert set(result.summary["doubtful"]) == listed


PATH = {"kind": "continuation", "from": "50 Hz", "to": "56 Hz", "side_branches": "none"}


@pytest.mark.parametrize(
    "sweep", [None, PATH | {"from": "30 Hz", "to": "32 Hz", "convergence": "on"}], ids=["stepped", "continuation"]
)
def test_limits_near_values_that_change_are_neither_met_nor_exceeded(sweep):
    """Gaps among them, which the summary does not have."""
    more = {"sweep": sweep} if sweep else {}
    analysis = beamsim.continuation if sweep else beamsim.sweep
    far = {"peak_force": "1 MN", "peak_displacement": "1 m", "peak_acceleration": "1e6 g", "gap": "1 m"}
    with long_steps():
        first = analysis(case(1, limits=far, **more)).summary["margins"]
    assert {item["verdict"] for item in first.values()} == {"ok"}
    assert all(item["lowest"] < item["value"] < item["highest"] for item in first.values())
    near = {name: 0.5 * (item["value"] + item["highest"]) for name, item in first.items()}
    with long_steps():
        again = analysis(case(1, limits=near, **more)).summary["margins"]
    assert {item["verdict"] for item in again.values()} == {"not reliable"}
    below = {name: 0.99 * item["lowest"] for name, item in first.items()}
    with long_steps():
        again = analysis(case(1, limits=below, **more)).summary["margins"]
    assert {item["verdict"] for item in again.values()} == {"exceeded"}


def test_a_value_that_the_finer_model_does_not_have_does_not_say_that_it_stays():
    """No motion between 50 and 56 Hz is stable in the finer model: the change was 0."""
    limits = {"peak_force": "1 MN"}
    with long_steps():
        result = beamsim.continuation(case(1, limits=limits, sweep=PATH | {"convergence": "on"}))
        finer = beamsim.continuation(case(2, limits=limits, sweep=PATH, beam=BEAM | {"elements": 40}))
    assert math.isfinite(result.summary["margins"]["peak_force"]["value"])
    assert math.isnan(finer.summary["margins"]["peak_force"]["value"])
    assert "tip" not in result.summary["convergence"]["peak_force_n"]
    assert result.summary["margins"]["peak_force"]["verdict"] == "not reliable"
    assert finer.summary["margins"]["peak_force"]["verdict"] == "not reliable"
    vary = {"kind": "grid", "parameters": [{"path": "excitation.level", "values": ["2 g"]}]}
    with long_steps():
        study = beamsim.design_study(case(1, limits=limits, sweep=PATH | {"convergence": "on"}, vary=vary))
    assert study["cases"]["passing"].values.tolist() == [False]
    assert study.summary["margins"]["peak_force"]["verdict"] == "not reliable"


def test_a_study_judges_its_cases_as_their_runs_are_judged():
    """Where its cases are compared with a finer model: one that may exceed a limit does not pass."""
    run = {"duration": 0.1, "convergence": "on"}
    alone = beamsim.run(case(1, sweep=None, run=run, limits={"peak_acceleration": "1e6 g"})).summary["margins"]
    limit = 0.5 * (alone["peak_acceleration"]["value"] + alone["peak_acceleration"]["highest"])
    vary = {"kind": "grid", "parameters": [{"path": "excitation.level", "values": ["0.1 g", "2 g"]}]}
    study = beamsim.design_study(case(1, sweep=None, run=run, vary=vary, limits={"peak_acceleration": limit}))
    assert study["cases"]["passing"].values.tolist() == [True, False]
    margin = study.summary["margins"]["peak_acceleration"]
    assert margin["value"] < limit < margin["highest"] == pytest.approx(alone["peak_acceleration"]["highest"])
    assert margin["verdict"] == "not reliable"
    assert margin["cases_exceeding"] == 0
    chosen = case(1, sweep=None, run={"duration": 0.1}, vary=vary, limits={"peak_acceleration": limit})
    judged = beamsim.design_study(chosen)["cases"]["passing"].values.tolist()
    assert judged == [True, False]  # the worst case of a limit is compared
    run = {"duration": 0.1, "convergence": "off"}
    unchecked = case(1, sweep=None, run=run, vary=vary, limits={"peak_acceleration": limit})
    assert beamsim.design_study(unchecked)["cases"]["passing"].values.tolist() == [True, True]


def test_a_normal_mode_where_it_is_asked_for():
    mode = {"mode": 1, "energy": "1 mJ", "continue_in": {"kind": "stiffness_factor", "from": 0.0, "to": 0.02}}
    result = beamsim.nnm(case(3, sweep=None, excitation={"kind": "none"}, nnm=mode | {"convergence": "on"}))
    changes = result.summary["convergence"]
    assert set(changes["frequency_hz"]) >= {"start", "end"}
    assert changes["frequency_hz"]["start"] < ALLOWED_ERROR
    assert result.summary["convergence_model"]["modes"] == 9
