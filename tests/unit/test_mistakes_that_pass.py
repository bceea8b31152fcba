"""Mistakes that make a valid case are noted by `validate` and with every result: a missing unit, nothing that moves."""

import numpy as np
import pytest

from beamsim.errors import ScenarioError
from beamsim.scenario import load_scenario
from beamsim.system.build import build_system

BEAM = {
    "length": 0.27, "width": 0.05, "thickness": 0.005, "youngs_modulus": 69e9, "density": 2700.0,
    "damping": {"kind": "modal", "ratio": 0.01},
}  # fmt: skip
TIP = {"name": "tip", "position": "100 %", "side": "below", "stiffness": 100e3, "gap": 1e-4}
SHAKEN = {"kind": "harmonic", "applied_to": "base", "level": 20.0, "frequency": 65.0}
CASE = {"beam": BEAM, "snubbers": [TIP], "excitation": SHAKEN, "run": {"duration": 1.0}}
UNDAMPED = BEAM | {"damping": {"kind": "modal", "ratio": 0.0}}


def notes(changes, *overrides):
    scenario = load_scenario({**CASE, **changes}, overrides)
    return " | ".join((*scenario.warnings, *build_system(scenario).warnings))


SAID = {
    "length": ({"beam": BEAM | {"length": 270.0}}, "beam.length = 270 m is long for a structure; was 270 mm meant?"),
    "nothing": ({"excitation": {"kind": "none"}}, "nothing moves: there is no excitation"),
    "zero": ({"excitation": SHAKEN | {"level": 0.0}}, "nothing moves: the level of the excitation is zero"),
    "stiffness": ({"snubbers": [TIP | {"stiffness": 1.0}]}, "the stiffness has no effect"),
    "damping": ({"beam": UNDAMPED}, "nothing is damped"),
}


@pytest.mark.parametrize(("changes", "said"), SAID.values(), ids=SAID)
def test_it_is_noted_with_its_remedy(changes, said):
    assert said in notes(changes)


@pytest.mark.parametrize("said", [said for _, said in SAID.values()], ids=SAID)
def test_a_case_without_it_has_no_such_note(said):
    assert said not in notes({})


@pytest.mark.parametrize(
    ("changes", "overrides"),
    [
        ({"snubbers": [TIP | {"damping": {"kind": "viscous", "coefficient": 1.0}}]}, ()),
        ({"snubbers": [TIP | {"law": "no_tension", "maxwell": [{"stiffness": 1e4, "relaxation_time": 0.001}]}]}, ()),
        ({"snubbers": [TIP | {"hardening": {"yield_force": 10.0, "stiffness": 1e3}}]}, ()),
        ({"friction": [{"name": "rub", "position": "100 %", "coefficient": 0.3, "normal_force": 3.0}]}, ()),
        ({"excitation": {"kind": "none"}}, ("run.start=rest",)),
        ({"nnm": {"mode": 1}}, ()),
    ],
    ids=["dashpot", "branch", "yields", "friction", "free", "nnm"],
)
def test_what_takes_energy_out_or_is_free_needs_no_damping(changes, overrides):
    assert "nothing is damped" not in notes({"beam": UNDAMPED, **changes}, *overrides)


def test_a_note_on_stiffness_follows_the_frequencies():
    """Just below and above a change of 0.1 % of the first frequency, k = 2e-3 of the modal stiffness at the tip."""
    modes = build_system(load_scenario(CASE)).modes
    first = modes["open_frequencies_hz"].values[0]
    mass = 0.27 * 0.05 * 0.005 * 2700 / 4  # of the first mode of a cantilever, at its tip
    k = 2e-3 * mass * (2 * np.pi * first) ** 2
    assert "no effect" in notes({"snubbers": [TIP | {"stiffness": 0.9 * k}]})
    assert "no effect" not in notes({"snubbers": [TIP | {"stiffness": 1.1 * k}]})


def test_the_default_sample_rate_of_a_stiff_arm():
    """It gave 5,000,000 samples."""
    arm = load_scenario({**CASE, "beam": BEAM | {"length": 0.06}, "run": {"duration": 100.0}})
    assert arm.sample_rate * 100.0 <= 2.01e6
    assert arm.sample_rate >= 20 * 65.0


def test_an_output_called_as_a_probe_by_default_is_refused():
    """Signals are called by name and quantity: two would be "tip displacement", in spectra and in statistics."""
    output = {"name": "tip", "kind": "displacement", "position": "50 %"}
    alone = {key: value for key, value in CASE.items() if key != "probes"} | {"snubbers": [TIP], "outputs": [output]}
    with pytest.raises(ScenarioError, match=r"outputs\[0\].name = tip is already the name of a probe"):
        load_scenario(alone)
    load_scenario(alone | {"outputs": [output | {"name": "middle"}]})
    load_scenario(alone | {"probes": [{"name": "end", "position": "100 %"}]})
