"""Sweeps, continuations and normal modes are compared with a finer model as runs are."""

from itertools import count

import pytest

import beamsim
from beamsim.analyses.run.result import ALLOWED_CHANGE
from beamsim.analyses.sweep.analysis import sweep as unchecked
from beamsim.cli.report import table_rows
from beamsim.scenario import load_scenario

BEAM = {"length": 0.27, "bending_stiffness": 2.0, "mass_per_length": 0.25, "damping": {"kind": "modal", "ratio": 0.05}}
TIP = {"name": "tip", "position": 0.27, "side": "below", "stiffness": "10 kN/m", "gap": "0.1 mm"}


def case(modes, **more):
    stepped = {"kind": "stepped", "from": "50 Hz", "to": "70 Hz", "points": 3, "accelerations": True}
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


def test_changes_of_a_sweep_are_those_of_the_finer_model():
    result = beamsim.sweep(case(3))
    s, model = result.summary, result.summary["convergence_model"]
    assert (model["first_modes"], model["modes"]) == (3, 5)
    finer = unchecked(case(5, beam=BEAM | {"elements": 40})).summary
    for entry in ("peak_displacement_m", "peak_acceleration_g", "peak_force_n", "contact_share"):
        for curve, values in s[entry].items():
            for name, a in values.items():
                b = finer[entry][curve][name]
                expected = abs(a - b) / max(abs(a), abs(b))
                assert s["convergence"][entry][f"{curve} {name}"] == pytest.approx(expected, rel=1e-5, abs=1e-9)


def test_a_sweep_with_too_few_modes_is_marked(tmp_path):
    """One mode: forces on the stop belong to the model."""
    result = beamsim.sweep(case(1, snubbers=[TIP | {"stiffness": "100 kN/m"}]))
    assert any(key.startswith("peak_force_n.") for key in result.summary["doubtful"])
    assert result.outcome.all_of("figures_doubtful")
    rows = list(table_rows("sweep", result))
    assert any("NOT CONVERGED" in text and " N" in text for _, text in rows)
    stored = beamsim.open_result(beamsim.write_result(result, tmp_path / "sweep.h5"))
    assert stored.summary["convergence"] == result.summary["convergence"]
    assert stored.outcome == result.outcome


def test_a_stop_between_the_sweep_and_its_comparison_is_told():
    """The result is whole, and said "complete", though nothing was compared."""
    saved = []
    result = beamsim.sweep(case(3), save=saved.append, stop=lambda: any(r.complete for r in saved))
    assert saved[-1].complete
    assert result.outcome.interrupted
    assert result.status == "interrupted during the comparison with a finer model"


def test_a_comparison_can_be_left_out_and_interrupted():
    off = beamsim.sweep(case(3, sweep={"kind": "stepped", "from": 50, "to": 70, "points": 2, "convergence": "off"}))
    assert dict(table_rows("sweep", off))["convergence"] == "not checked: not asked for"
    asked = count()
    whole = beamsim.sweep(case(3), stop=lambda: next(asked) < 0)
    first = next(asked)
    of_first_model = count()
    unchecked(case(3), stop=lambda: next(of_first_model) < 0)
    ended = next(of_first_model)
    assert ended < first
    again = count()
    partial = beamsim.sweep(case(3), stop=lambda: next(again) > ended + 1)
    assert partial.outcome.interrupted
    assert partial.summary["peak_force_n"] == whole.summary["peak_force_n"]  # nothing of the first model is lost
    assert "convergence" not in partial.summary


def test_a_continuation_where_it_is_asked_for():
    path = {"kind": "continuation", "from": "50 Hz", "to": "56 Hz", "side_branches": "none"}
    assert "not checked" in dict(table_rows("continuation", beamsim.continuation(case(2, sweep=path))))["convergence"]
    result = beamsim.continuation(case(2, sweep=path | {"convergence": "on"}))
    changes = result.summary["convergence"]
    assert result.summary["convergence_model"]["modes"] == 3
    assert 0.0 < max(changes["peak_displacement_m"].values()) < 0.5
    assert set(changes) >= {"peak_displacement_m", "peak_frequency_hz", "open_frequencies_hz"}
    listed = {
        key for entry, of in changes.items() for key in (f"{entry}.{x}" for x, y in of.items() if y > ALLOWED_CHANGE)
    }
    assert set(result.summary["doubtful"]) == listed


def test_a_normal_mode_where_it_is_asked_for():
    mode = {"mode": 1, "energy": "1 mJ", "continue_in": {"kind": "stiffness_factor", "from": 0.0, "to": 0.02}}
    result = beamsim.nnm(case(3, sweep=None, excitation={"kind": "none"}, nnm=mode | {"convergence": "on"}))
    changes = result.summary["convergence"]
    assert set(changes["frequency_hz"]) >= {"start", "end"}
    assert changes["frequency_hz"]["start"] < ALLOWED_CHANGE
    assert result.summary["convergence_model"]["modes"] == 5
