"""`beamsim sweep --compare multiple_scales`: response curves by forced multiple scales beside exact ones."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from shipped import config_path

import beamsim
from beamsim.analyses.continuation.forced_expansion import compare_forced_expansion
from beamsim.errors import ScenarioError
from beamsim.results.branch import rows_by_owner
from beamsim.scenario import load_scenario
from beamsim.store.results import load
from tests.helpers.commands import invoke

OSCILLATOR = config_path("ms_forced_oscillator")
RANGE = {"sweep.from": "0.5 rad/s", "sweep.to": "0.8 rad/s"}


def expanded(scenario):
    """Of each level the motions by multiple scales, and their differences from exact ones."""
    found = compare_forced_expansion(scenario)
    tables = ("multiple_scales_points", "multiple_scales_factors")
    return list(zip(*(rows_by_owner(found["multiple_scales"], found[of], "comparison") for of in tables), strict=True))


def test_oscillator_of_the_thesis():
    """e = 0.1: within 5 % (leading) and 0.3 % (first order); orders 1 and 2 as everything small is made smaller."""
    ((motions, differences),) = expanded(load_scenario(OSCILLATOR))
    assert motions["mode"].item() == 1
    assert differences["factor"].values[0] == 1.0
    assert differences["difference"].values[0, 0] < 0.05
    assert differences["difference"].values[0, 1] < 0.003
    np.testing.assert_allclose(differences["orders"].values[-2], [1.0, 2.0], atol=0.01)
    assert np.isnan(differences["orders"].values[-1]).all()  # there is no next factor
    assert motions["stable"].values.all()
    assert differences["stability_agrees"].values.all()
    # without a gap the slow flow is linear: a = F / |2 (psi - sigma)|, psi = 1/4 + i/2 in units of e
    leading, omega = motions["leading"].sel(probe="mass").values, 2 * np.pi * motions["frequency_hz"].values
    k = int(np.argmax(leading))
    assert omega[k] == pytest.approx(1.025, abs=1e-6)
    assert leading[k] == pytest.approx(1.0, abs=1e-4)  # between two of the 256 samples
    assert np.interp(1.1, omega, leading) == pytest.approx(0.5 / np.hypot(0.75, 0.5), rel=1e-3)


def test_bent_response_with_a_gap():
    """Stable, unstable, stable along the curve through its tip; both orders where the exact motion is near."""
    changes = RANGE | {"chain.snubbers[0].stiffness": 0.3}
    ((motions, differences),) = expanded(load_scenario(config_path("chain_two_dof"), changes))
    flips = np.flatnonzero(np.diff(motions["stable"].values.astype(int)))
    assert flips.size == 2
    found = np.isfinite(differences["difference"].values[:, 0])
    assert differences["stability_agrees"].values[found].all()
    np.testing.assert_allclose(differences["orders"].values[-2], [1.0, 2.0], atol=0.03)
    # the tip lies on the nonlinear mode's own frequency
    k = int(np.argmax(motions["leading"].sel(probe="first").values))
    assert motions["frequency_hz"].values[k] == pytest.approx(motions["backbone_hz"].values[k], rel=1e-5)


def test_levels_each_have_their_curve():
    changes = RANGE | {"chain.snubbers[0].stiffness": 0.3, "sweep.levels": ["0.05 N", "0.1 N"]}
    (low, _), (high, _) = expanded(load_scenario(config_path("chain_two_dof"), changes))
    assert (low["level"].item(), high["level"].item()) == (0.05, 0.1)
    first, second = (of["leading"].sel(probe="first").values.max() for of in (low, high))
    assert first < second


def test_steady_spectrum_of_the_thesis():
    """Fundamental and even harmonics, whatever the force: the odd ones are of second order."""
    result = beamsim.run(load_scenario(OSCILLATOR))
    lines = [row for row in result.summary["spectral_lines"] if row["quantity"] == "absolute_acceleration"]
    assert {row["order"] for row in lines} == {0.0, 1.0, 2.0, 4.0, 6.0}
    by_order = {row["order"]: row["amplitude"] for row in lines}
    assert 1.1**-2 * by_order[1.0] == pytest.approx(0.511, abs=1e-3)
    assert by_order[2.0] / by_order[1.0] == pytest.approx(0.0223, abs=1e-3)


@pytest.mark.parametrize(
    ("file", "changes", "text"),
    [
        ("sweep_up_down", {}, "kind: continuation"),
        ("chain_two_dof", {"chain.snubbers": []}, "needs a one-sided spring"),
        ("chain_two_dof", {"chain.springs_to_ground": [{"mass": 1, "kind": "cubic", "stiffness": 1}]}, "a cubic one"),
        (
            "continuation_60_120hz", {"snubbers[0].mounted_on": "ground"}, "the base also pushes",
        ),
        (
            "chain_two_dof",
            {
                "chain.snubbers[0].law": "no_tension",
                "chain.snubbers[0].damping": {"kind": "viscous", "coefficient": 0.1},
            },
            "Kelvin-Voigt snubbers",
        ),
    ],
)  # fmt: skip
def test_nonsense_is_refused_with_a_remedy(file, changes, text):
    with pytest.raises(ScenarioError, match=text):
        compare_forced_expansion(load_scenario(config_path(file), changes))


def test_command(tmp_path):
    done = invoke("sweep", OSCILLATOR, "--compare", "multiple_scales", "-o", tmp_path, "--json")
    assert done.exit_code == 0, done.output
    summary = json.loads(done.stdout)
    (level,) = summary["multiple_scales"]
    assert level["observed_orders"] == pytest.approx([1.0, 2.0], abs=0.01)
    names = {Path(f).name for f in summary["files"]}
    assert {"ms_forced_oscillator_multiple_scales_mass.png", "ms_forced_oscillator_multiple_scales_orders.png"} <= names
    with h5py.File(tmp_path / "ms_forced_oscillator.h5") as file:
        assert file["multiple_scales_factors/difference"].dims[0][0] == file["multiple_scales_factors/number"]
    stored = load(tmp_path / "ms_forced_oscillator.h5")
    first = stored["multiple_scales_points"]["first"].sel(probe="mass").values
    assert first.max() == level["largest_first_order_m"]["mass"]
    assert stored["multiple_scales_factors"]["stability_agrees"].values.all()


def test_only_beside_a_continuation(tmp_path):
    done = invoke("sweep", config_path("sweep_up_down"), "--compare", "multiple_scales")
    assert done.exit_code == 2
    assert "kind: continuation" in done.output
