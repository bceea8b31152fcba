"""``beamsim static``: screens, limits, files, studies and refusals."""

import numpy as np
import pytest
from shipped import config_path

import beamsim
from beamsim.plots.statics import static_figures
from tests.helpers.commands import invoke

REST = config_path("resting_beam")


def static(*words):
    return invoke("static", *words, "--no-plots")


def test_limits_decide_the_exit_code(tmp_path):
    target = tmp_path / "rest.h5"
    assert static(REST, "--check", "-o", target).exit_code == 0
    done = static(REST, "--check", "--set", "limits.peak_force.middle=40 N", "-o", target)
    assert done.exit_code == 4
    assert "peak force of middle = 46.538 N" in done.stderr
    assert "EXCEEDED" in done.stdout


def test_the_file_holds_the_result(tmp_path):
    result = beamsim.static(REST)
    again = beamsim.load(beamsim.write_result(result, tmp_path / "rest.h5"))
    assert again.summary["reaction_n"] == result.summary["reaction_n"]
    np.testing.assert_array_equal(again["equilibrium"]["deflection"].values, result["equilibrium"]["deflection"].values)
    assert again["equilibrium"]["reaction"].sel(support="left moment").unit == "N m"
    assert "equilibrium_by_support" in again.to_pandas()


def test_reactions_of_a_hinge_are_moments_and_its_stop_has_an_angle(tmp_path):
    done = static(config_path("deployed_boom"), "-o", tmp_path / "boom.h5")
    assert done.exit_code == 0, done.output
    assert "root.end   touches   -       34.7 mN m" in done.stdout
    assert "friction stuck" in done.stdout


def test_a_study_varies_gaps_and_loads():
    """With a gap of 25 mm the tip is open and the stop in the middle carries what it carries alone."""
    study = {"vary": {"kind": "zip", "parameters": [{"path": "snubbers.tip.gap", "values": ["5 mm", "25 mm"]}]}}
    table = beamsim.design_study(beamsim.load_scenario(REST, study)).table
    tip, middle = (np.asarray(table[f"snubbers/{name}/static_force"]) for name in ("tip", "middle"))
    assert tip[0] > 0.0
    assert tip[1] == 0.0
    assert middle[1] == pytest.approx(beamsim.static(REST).summary["static_force_n"]["middle"], rel=1e-9)
    loads = (7850 * 3.84e-4 + 1.5) * 9.81 + 8.0
    assert table["supports/left/reaction"][0] == pytest.approx(loads - tip[0] - middle[0], rel=1e-6)
    assert table["stuck_frequencies_hz_1"][1] == pytest.approx(23.5778, rel=1e-5)


def test_a_study_names_cases_that_float():
    case = {
        "chain": {"masses": ["2 kg"], "springs": ["0 N/m"]}, "gravity": "9.81 m/s^2",
        "probes": [{"name": "m", "mass": 1}],
        "snubbers": [{"name": "floor", "at": {"mass": 1}, "side": "below", "gap": "0 mm", "stiffness": "4 kN/m"}],
        "vary": {"kind": "zip", "parameters": [{"path": "gravity", "values": ["9.81 m/s^2", "-9.81 m/s^2"]}]},
    }  # fmt: skip
    result = beamsim.design_study(beamsim.load_scenario(case))
    assert result.summary["failed"] == 1
    assert result.summary["solved"] == 1


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (["gravity=-9.81 m/s^2"], ["no support or snubber can hold the structure", "moves freely"]),
        (["snubbers=null"], ["no support or snubber can hold the structure"]),
        (["gravity=0 m/s^2"], ["the structure floats"]),
    ],
)
def test_a_structure_that_nothing_holds_is_refused(changes, words, tmp_path):
    case = tmp_path / "free.yaml"
    case.write_text(
        "chain: {masses: [2 kg], springs: [0 N/m]}\ngravity: 9.81 m/s^2\nprobes: [{name: m, mass: 1}]\n"
        "snubbers: [{name: floor, at: {mass: 1}, side: below, gap: 1 mm, stiffness: 4 kN/m}]\n"
    )
    assert static(case, "-o", tmp_path / "rest.h5").exit_code == 0
    done = static(case, *(word for change in changes for word in ("--set", change)), "-o", tmp_path / "x.h5")
    assert done.exit_code == 2
    for text in (*words, "hold the structure with a support"):
        assert text in done.stderr
    assert not (tmp_path / "x.h5").exists()


def test_nothing_acts_and_other_limits_are_named():
    case = {"chain": {"masses": [1.0], "springs": [1e3]}, "probes": [{"name": "m", "mass": 1}],
            "excitation": {"kind": "random", "applied_to": "base", "seed": 1,
                           "psd": [{"frequency": f, "density": "0.1 g^2/Hz"} for f in (10, 50)]},
            "run": {"duration": 2.0, "sample_rate": 1e3}, "limits": {"rms_displacement": "1 mm"}}  # fmt: skip
    result = beamsim.static(case)
    assert any(text.startswith("nothing acts") for text in result.warnings)
    assert any("limits on motions are not compared: rms_displacement" in text for text in result.warnings)
    assert result.summary["margins"] == {}


def test_a_study_with_an_excitation_and_no_run_is_refused():
    change = {"excitation": {"kind": "harmonic", "applied_to": "base", "level": "1 g", "frequency": "5 Hz"},
              "vary": {"kind": "zip", "parameters": [{"path": "snubbers.tip.gap", "values": ["5 mm"]}]}}  # fmt: skip
    with pytest.raises(beamsim.ScenarioError, match=r"run is missing.*without excitation a static equilibrium"):
        beamsim.plan_designs(beamsim.load_scenario(REST, change))


@pytest.mark.parametrize(
    ("name", "figures"),
    [
        ("resting_beam", {"deflection"}),
        ("plate_panel", {"deflection_panel"}),
        ("chain_bumpers", {"equilibrium"}),
        ("two_panels", {"deflection", "equilibrium"}),
    ],
)
def test_every_kind_of_body_has_its_picture(name, figures):
    changes = {"reduction": {"modes": 4}} if name == "plate_panel" else {}
    pictures = static_figures(beamsim.static(beamsim.load_scenario(config_path(name), changes)))
    assert set(pictures) == figures
    (ax, *_) = pictures[min(figures)].figure().axes
    assert ax.get_legend_handles_labels()[1]
