"""The beam's own parameters from frequencies measured without the snubber."""

import numpy as np
import pytest
import yaml

import beamsim
from beamsim.analyses.identify.analysis import identify_stiffness, mode_shapes
from beamsim.analyses.identify.stiffness import snubber_point
from beamsim.analyses.identify.update import free_frequencies
from beamsim.cli.measured import identification_screen
from beamsim.errors import ScenarioError
from beamsim.outcomes import exit_code
from beamsim.scenario import load_scenario
from beamsim.signals.mac import modal_assurance
from tests.helpers.tables import estimates, modes, profiles, variables

BASE = {
    "beam": {
        "length": 0.27, "width": 0.05, "thickness": 0.005, "youngs_modulus": 69e9, "density": 2700.0, "elements": 6,
        "point_masses": [{"position": 0.135, "mass": 0.004}, {"position": 0.27, "mass": 0.004}],
    },
    "snubbers": [{"name": "tip", "position": 0.27, "side": "below", "stiffness": 150e3}],
}  # fmt: skip


def case(measured, update, **section):
    return load_scenario(
        {
            **BASE,
            "identify_stiffness": {"snubber": "tip", "measured_without": list(measured), "update": update, **section},
        }
    )


def frequencies(count=3, **changes):
    return free_frequencies(load_scenario({**BASE}, changes), "tip", count)


def test_parameters_come_back_from_their_own_frequencies():
    measured = frequencies(4, **{"beam.youngs_modulus": 73e9, "beam.point_masses": [
        {"position": 0.135, "mass": 0.007}, {"position": 0.27, "mass": 0.007}]})  # fmt: skip
    result = identify_stiffness(case(measured, ["beam.youngs_modulus", "beam.point_masses[*].mass"]))
    values = {p.parameter: p.value for p in estimates(result, "update")}
    assert values == pytest.approx({"beam.youngs_modulus": 73e9, "beam.point_masses[*].mass": 0.007}, rel=1e-6)
    update = variables(result["update"])
    assert update.misfit_after < 1e-9 * update.misfit_before
    assert np.abs(modes(result, "without_snubber").difference_percent[:4]).max() < 1e-6
    assert load_scenario(yaml.safe_load(update.scenario)).beam.youngs_modulus == pytest.approx(73e9)


def test_the_snubber_is_identified_with_the_updated_beam():
    true = load_scenario(BASE, {"beam.youngs_modulus": 75e9})
    contact = snubber_point(true, "tip").frequencies(2e5, 1) / (2 * np.pi)
    section = {"measured_with": contact.tolist()}
    blind = identify_stiffness(case(free_frequencies(true, "tip", 3), [], **section))
    informed = identify_stiffness(case(free_frequencies(true, "tip", 3), ["beam.youngs_modulus"], **section))
    assert abs(blind.summary["stiffness_n_per_m"] / 2e5 - 1) > 0.05
    assert informed.summary["stiffness_n_per_m"] == pytest.approx(2e5, rel=1e-6)


def test_one_unknown_has_the_closed_form_deviation():
    """f is proportional to sqrt(E): with m frequencies of relative deviation s, E has 2 s / sqrt(m)."""
    result = identify_stiffness(case(frequencies(3), ["beam.youngs_modulus"], uncertainty="0.2 %"))
    (modulus,) = estimates(result, "update")
    assert modulus.standard_deviation / modulus.value == pytest.approx(2 * 0.002 / np.sqrt(3), rel=1e-5)
    (profile,) = profiles(result)
    assert profile.misfit.min() == pytest.approx(0, abs=1e-6)
    z = (profile.value - modulus.value) / modulus.standard_deviation
    assert profile.misfit == pytest.approx(z**2, rel=0.05, abs=1e-6)


def test_a_prior_holds_what_the_frequencies_cannot():
    measured = frequencies(3, **{"beam.youngs_modulus": 76e9})
    free = case(
        measured, ["beam.youngs_modulus", {"parameter": "beam.thickness", "prior": "0.1 %"}], uncertainty="0.2 %"
    )
    found = {p.parameter: p for p in estimates(identify_stiffness(free), "update")}
    assert found["beam.youngs_modulus"].value == pytest.approx(76e9, rel=5e-3)
    assert found["beam.thickness"].value == pytest.approx(0.005, rel=1e-3)


def test_more_frequencies_than_modes_are_refused_where_they_stand():
    chain = {"masses": [1.0, 1.0], "springs": [100.0, 100.0]}
    section = {"snubber": "s", "measured_without": [1.0, 2.0, 3.0], "update": ["chain.springs[0]"]}
    stop = {"name": "s", "mass": 2, "side": "above", "stiffness": 1e3}
    with pytest.raises(ScenarioError, match=r"measured_without has 3 frequencies, but the model has only 2 modes; "):
        identify_stiffness(load_scenario({"chain": chain, "snubbers": [stop], "identify_stiffness": section}))


def test_what_cannot_be_told_apart_is_named():
    result = identify_stiffness(case(frequencies(3), ["beam.youngs_modulus", "beam.width"]))
    assert not [w for w in result.warnings if "cannot be distinguished" in w]  # the point masses tell them apart
    bare = load_scenario(
        case(frequencies(3, **{"beam.point_masses": []}), ["beam.youngs_modulus", "beam.density"]),
        {"beam.point_masses": []},
    )
    result = identify_stiffness(bare)
    (said,) = (w for w in result.warnings if "beam.youngs_modulus and beam.density cannot be distinguished" in w)
    assert said.endswith("fix one of them, or give it a prior")


def test_a_prior_is_not_advised_where_there_is_one():
    """Two wide priors hold values that the frequencies do not tell apart."""
    sought = [{"parameter": f"beam.{name}", "prior": 5.0} for name in ("youngs_modulus", "density")]
    changed = case(frequencies(3, **{"beam.point_masses": []}), sought, uncertainty="0.01 %")
    result = identify_stiffness(load_scenario(changed, {"beam.point_masses": []}))
    (said,) = (w for w in result.warnings if "distinguished" in w)
    assert said.endswith("fix one of them")


def test_bounds_are_kept_and_reported():
    measured = frequencies(3, **{"beam.youngs_modulus": 80e9})
    bounded = case(measured, [{"parameter": "beam.youngs_modulus", "bounds": ["60 GPa", "72 GPa"]}])
    result = identify_stiffness(bounded)
    (modulus,) = estimates(result, "update")
    assert modulus.value == pytest.approx(72e9, rel=1e-5)
    assert modulus.at_bound
    assert exit_code(result.outcome) == 3
    assert result.status == (
        "not reliable: beam.youngs_modulus ended on its bound, 7.2e+10 Pa; widen the bounds, or check what was "
        "measured and the rest of the model"
    )
    assert identification_screen(result).text(result, ["case.h5"]).splitlines()[0].count("NOT RELIABLE") == 1
    wide = case(measured, [{"parameter": "beam.youngs_modulus", "bounds": ["60 GPa", "90 GPa"]}])
    assert exit_code(identify_stiffness(wide).outcome) == 0


def test_modes_that_a_rigid_stop_fits_best_are_not_reliable():
    """The first mode hardly lifted but uncertain; the second, of more weight, above that of the pinned point."""
    point = snubber_point(load_scenario(BASE), "tip", 2)
    measured = [point.reach(1)[0] * 1.001 / (2 * np.pi), point.reach(2)[1] * 1.01 / (2 * np.pi)]
    section = {"snubber": "tip", "measured_with": measured, "fit_to": [1, 2], "uncertainty": ["9 %", "0.01 %"]}
    result = identify_stiffness(load_scenario({**BASE, "identify_stiffness": section}))
    assert exit_code(result.outcome) == 3
    assert "a rigid stop fits these frequencies best" in result.status


def test_supports_are_chosen_by_trying_them(tmp_path):
    measured = frequencies(3, **{"beam.supports": {"left": "pinned", "right": "guided"}})
    result = identify_stiffness(case(measured, ["beam.supports.left", "beam.supports.right"]))
    assert result.summary["updated"] == {"beam.supports.left": "pinned", "beam.supports.right": "guided"}
    tried = dict(
        zip(result["update"].labels("combination"), variables(result["update"]).combination_misfit, strict=True)
    )
    assert len(tried) == 16
    assert min(tried, key=tried.get) == "pinned, guided"
    assert tried["pinned, guided"] == result["update"]["misfit_after"].item() < 1e-10
    # that a support was chosen was called damage when the file was read
    again = beamsim.load(beamsim.write_result(result, tmp_path / "supports.h5"))
    assert again.summary["updated"] == result.summary["updated"]
    assert {supports: each.item() for supports, each in again["update"].by_label("combination_misfit").items()} == tried


def test_mac_is_one_for_the_own_shapes_and_tells_swapped_ones():
    positions = (0.05, 0.1, 0.15, 0.2, 0.27)
    shapes = mode_shapes(load_scenario(BASE), "tip", 3, positions).T
    assert np.diag(modal_assurance(-3 * shapes.T, shapes.T)) == pytest.approx(np.ones(3))
    assert modal_assurance(np.array([[1.0], [0.0]]), np.array([[0.0], [2.0]])) == pytest.approx(np.zeros((1, 1)))
    swapped = {"positions": list(positions), "shapes": shapes[[1, 0, 2]].tolist()}
    result = identify_stiffness(case(frequencies(3), ["beam.youngs_modulus"], shapes_without=swapped))
    assert result["shapes"]["mac"].values.shape == (3, 3)
    assert sum("check the order of the modes" in w for w in result.warnings) == 2
