"""Names given by users: those that collide with fields of results are refused, no other is, and all mean themselves."""

from __future__ import annotations

import numpy as np
import pytest

import beamsim
from beamsim.analyses.studies.responses import matches_request
from beamsim.errors import ScenarioError
from beamsim.scenario import load_scenario
from beamsim.summaries import value_in_words
from tests.helpers.commands import invoke

CASE = {
    "chain": {"masses": [1, 1], "springs": [1000, 1000, 1000], "damping": {"kind": "modal", "ratio": "2 %"}},
    "snubbers": [{"name": "stop", "mass": 2, "side": "above", "gap": "1 mm", "stiffness": 20000}],
    "probes": [{"name": "one", "mass": 1}, {"name": "two", "mass": 2}],
    "excitation": {"kind": "harmonic", "applied_to": {"mass": 1}, "level": "2 N", "frequency": "5 Hz"},
    "run": {"duration": "0.5 s", "sample_rate": "500 Hz", "convergence": "off"},
    "limits": {"peak_force": "60 N"},
}
CHOICES = {"hard": {"snubbers.stop.stiffness": 40000}, "soft": {"snubbers.stop.stiffness": 10000}}
RANDOM = {
    "kind": "random", "applied_to": {"mass": 1}, "seed": 1,
    "psd": [{"frequency": 2, "density": "1 N^2/Hz"}, {"frequency": 20, "density": "1 N^2/Hz"}],
}  # fmt: skip


def study(name, **more):
    vary = {"kind": "grid", "parameters": [{"name": name, "choices": CHOICES}]}
    return load_scenario(CASE | more | {"vary": vary})


RESPONSES = ("snubbers", "probes", "energy_error", "open_frequencies_hz", "open_frequencies_hz_2", "up_0", "stable_1")


@pytest.mark.parametrize("name", RESPONSES)
def test_a_choice_called_as_a_response_is_refused_before_anything_is_computed(name):
    with pytest.raises(ScenarioError, match=rf"vary.parameters\[0\].name = {name} is a name that the result"):
        beamsim.plan_designs(study(name))


@pytest.mark.parametrize("name", ["my margins", "x_real"])
def test_any_other_choice_is_stored_as_it_was_given(name, tmp_path):
    found = beamsim.design_study(study(name))
    beamsim.write_result(found, tmp_path / "study.h5")
    read = beamsim.load(tmp_path / "study.h5")
    assert read["cases"].labels("parameter") == [name]
    assert read["cases"]["parameter_text"].sel(parameter=name).values.tolist() == ["hard", "soft"]
    assert read["cases"]["solved"].values.tolist() == [True, True]
    assert list(read.table[name]) == ["hard", "soft"]
    assert read.responses.keys() == found.responses.keys()
    for key, response in found.responses.items():
        np.testing.assert_array_equal(read.responses[key].values, response.values)
    for form in ("csv", "mat"):
        done = invoke("export", "--format", form, tmp_path / "study.h5", "-o", tmp_path / form)
        assert done.exit_code == 0, done.output


@pytest.mark.parametrize("name", ["", "a/b", "."])
def test_a_choice_without_a_usable_name(name):
    with pytest.raises(ScenarioError, match="is not a usable name"):
        study(name)


@pytest.mark.parametrize("name", ["frequency_hz", "größe"])
def test_any_name_of_a_probe_and_a_snubber_can_have_statistics(name, tmp_path):
    more = {
        "excitation": RANDOM, "run": {"duration": "6 s", "sample_rate": "200 Hz", "convergence": "off"}, "limits": None,
        "probes": [{"name": name, "mass": 1}, {"name": f"{name} two", "mass": 2}],
        "snubbers": [CASE["snubbers"][0] | {"name": name}],
    }  # fmt: skip
    found = beamsim.run(load_scenario(CASE | more))
    beamsim.write_result(found, tmp_path / "run.h5")
    read = beamsim.load(tmp_path / "run.h5")
    assert list(read["random"]) == list(found["random"])
    assert read["random"]["name"].values[1] == name
    for variable, values in found["random"].items():
        np.testing.assert_array_equal(read["random"][variable], values)


@pytest.mark.parametrize("section", ["probes", "snubbers"])
def test_only_the_input_is_called_input(section):
    named = {section: [CASE[section][0] | {"name": "input"}]}
    load_scenario(CASE | named)
    with pytest.raises(ScenarioError, match=rf"{section}\[0\].name = input is the name of the input's own"):
        load_scenario(CASE | named | {"excitation": RANDOM})


def test_a_limit_of_tip_is_not_that_of_left_tip():
    """The range of the limited value is that of its own place, though the other name ends alike."""
    beam = {
        "length": "1 m", "width": "50 mm", "thickness": "5 mm", "youngs_modulus": "69 GPa", "density": 2700,
        "elements": 2, "supports": {"left": "clamped"}, "damping": {"kind": "modal", "ratio": "1 %"},
    }  # fmt: skip
    case = {
        "beam": beam, "reduction": {"modes": 1},
        "excitation": {"kind": "half_sine", "applied_to": "base", "level": "5 g", "duration": "2 ms"},
        "probes": [{"name": "tip", "position": "1 m"}, {"name": "left tip", "position": "0.3 m"}],
        "run": {"duration": "0.1 s", "sample_rate": "5 kHz"},
        "limits": {"peak_displacement": {"tip": "1 m"}},
    }  # fmt: skip
    summary = beamsim.run(load_scenario(case)).summary
    changes = summary["convergence"]["peak_displacement_m"]
    limited = summary["margins"]["peak_displacement.tip"]
    assert changes["left tip"] > 2.0 * changes["tip"]
    assert limited["lowest"] == pytest.approx(limited["value"] * (1.0 - changes["tip"]), rel=1e-12)
    assert limited["highest"] == pytest.approx(limited["value"] * (1.0 + changes["tip"]), rel=1e-12)


def test_names_are_shown_as_they_were_given():
    assert value_in_words("peak_displacement_m.left_end tip_2") == "peak displacement of left_end tip_2"
    assert (
        value_in_words("spectral_lines.left_end tip_2 absolute_acceleration")
        == "spectral lines of left_end tip_2 absolute acceleration"
    )
    assert not matches_request("tip/peak_force", "snubbers/left tip/peak_force")
    assert not matches_request("force", "snubbers/tip/peak_force")
