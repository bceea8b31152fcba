"""Limits on the level of a sine over that at which contact first changes, against the closed form of an oscillator."""

import math

import numpy as np
import pytest

import beamsim
from beamsim.errors import ScenarioError
from beamsim.scenario import load_scenario

K, STOP, RATIO, HZ, LEVEL = 1e3, 4e3, 0.05, 7.0, 2.0  # N/m, N/m, -, Hz, m/s^2


def case(excitation="{kind: harmonic, applied_to: base, level: 2, frequency: 7 Hz}", limits="{gapping: 80 %}", more=""):
    """A mass on a spring, and on a stop that presses against it at rest."""
    return load_scenario(f"""\
chain: {{masses: [1 kg], springs: [1 kN/m], damping: {{kind: modal, ratio: 5 %}}}}
snubbers: [{{name: stop, mass: 1, side: below, gap: -10 mm, stiffness: 4 kN/m}}]
probes: [{{name: mass, mass: 1}}]
excitation: {excitation}
limits: {limits}
run: {{duration: 30 s, sample_rate: 200 Hz}}
{more}""")


def level_of_loss(gap=-10e-3, hz=HZ):
    """Amplitude of the base's acceleration, m/s^2, with which the mass just leaves the stop."""
    at_rest = -gap * STOP / (K + STOP) + gap  # displacement, at which the stop still presses
    w = 2.0 * math.pi * hz
    impedance = complex(K + STOP - w**2, 2.0 * RATIO * math.sqrt(K) * w)
    return abs(at_rest) * abs(impedance)


def test_the_value_is_that_of_the_closed_form_and_judged():
    result = beamsim.run(case())
    exact = LEVEL / level_of_loss()
    assert result.summary["gapping_ratio"]["stop"] == pytest.approx(exact, rel=1e-9)
    margin = result.summary["margins"]["gapping"]
    assert margin["value"] == pytest.approx(exact, rel=1e-9)
    assert margin["margin"] == pytest.approx(0.8 / exact - 1.0, rel=1e-9)
    assert margin["exceeded"] == (exact > 0.8)


@pytest.mark.parametrize(("share", "parts"), [(0.97, False), (1.03, True)])
def test_contact_is_lost_from_that_level_on(share, parts):
    """In a sweep that comes to 7 Hz from below, where a higher level would be needed."""
    level = share * level_of_loss()
    sweep = f"sweep: {{kind: stepped, from: 1 Hz, to: 7 Hz, points: 25, levels: [{level!r} m/s^2]}}"
    result = beamsim.sweep(case(limits="{gapping: {stop: 100 %}}", more=sweep))
    (curve,) = result.curves.values()
    assert np.flatnonzero(curve["contact_share"].sel(snubber="stop").values < 1.0 - 1e-12).tolist() == (
        [24] if parts else []
    )
    margin = result.summary["margins"]["gapping.stop"]
    assert margin["exceeded"] == parts
    assert margin["value"] == pytest.approx(share, rel=1e-3)


def test_cases_of_studies_have_it_where_it_is_asked_for_or_limited():
    vary = "vary: {kind: grid, parameters: [{path: excitation.level, values: [1, 3]}]}"
    exact = [level / level_of_loss() for level in (1.0, 3.0)]
    result = beamsim.design_study(case(more=vary), workers=1)
    assert result.responses["snubbers/stop/gapping"].values == pytest.approx(exact, rel=1e-9)
    asked = vary[:-1] + ", responses: [peak_force]}"
    of_all = beamsim.design_study(case(more=asked, limits="{peak_force: 1 kN}"), workers=1)
    assert set(of_all.responses) == {"snubbers/stop/peak_force"}
    named = vary[:-1] + ", responses: [stop/gapping]}"
    alone = beamsim.design_study(case(more=named, limits="null"), workers=1)
    assert set(alone.responses) == {"snubbers/stop/gapping"}


def test_the_smallest_preload_that_keeps_contact_is_found():
    """The level grows with the depth to which the stop is pressed in."""
    parameters = "[{path: snubbers.stop.gap, from: -60 mm, to: -1 mm}]"
    more = f"optimise: {{minimise: stop/static_force, parameters: {parameters}, most_cases: 100}}"
    result = beamsim.design_study(case(limits="{gapping: 100 %}", more=more), workers=1)
    depth = 10e-3 * LEVEL / level_of_loss()
    best = result.summary["best"][0]
    assert -best["parameters"]["snubbers.stop.gap"] == pytest.approx(depth, rel=5e-3)
    assert -best["parameters"]["snubbers.stop.gap"] >= depth * (1.0 - 1e-9)


def test_what_is_not_predicted_is_not_reliable():
    """Friction that holds has no linear motion beside it."""
    result = beamsim.run(case(more="friction: [{name: dry, mass: 1, normal_force: 1 N, coefficient: 0.5}]"))
    margin = result.summary["margins"]["gapping"]
    assert math.isnan(margin["value"])
    assert margin["verdict"] == "not reliable"


@pytest.mark.parametrize(
    "excitation",
    [
        "{kind: half_sine, applied_to: base, level: 2 g, duration: 10 ms}",
        "{kind: none}",
        "{kind: swept_sine, applied_to: base, level: 2, from: 5 Hz, to: 9 Hz, rate: 1 oct/min}",
    ],
)
def test_other_inputs_are_refused(excitation):
    with pytest.raises(ScenarioError, match=r"limits\.gapping needs a run or a sweep of a harmonic excitation"):
        case(excitation)


def test_continuations_are_refused():
    with pytest.raises(ScenarioError, match=r"limits\.gapping needs a run or a sweep"):
        case(more="sweep: {kind: continuation, from: 5 Hz, to: 9 Hz}")


def latch_at(gap, level=LEVEL):
    """The case with a latch at this gap, m, and this level, m/s^2."""
    stop = {"name": "stop", "mass": 1, "side": "below", "gap": gap, "stiffness": 4e3, "latch": True}
    whole = case().model_dump(mode="json", exclude_unset=True)
    whole["snubbers"], whole["excitation"]["level"] = [stop], level
    return load_scenario({**whole, "run": {"duration": 1.0, "sample_rate": 200.0, "convergence": "off"}})


def test_a_latch_that_is_held_opens_at_no_level():
    result = beamsim.run(latch_at(-10e-3))
    margin, of = result.summary["margins"]["gapping"], result.summary["gapping"]["stop"]
    assert result.summary["contact_share"]["stop"] == 1.0
    assert (margin["value"], margin["verdict"]) == (0.0, "ok")
    assert (of["closed_at_rest"], of["level"], of["preload_n"], of["preload_alone_n"]) == (True, math.inf, 0.0, 0.0)


def test_an_open_latch_touches_where_an_open_mass_reaches_it():
    result = beamsim.run(latch_at(2e-3))
    w = 2.0 * math.pi * HZ
    onset = 2e-3 * abs(complex(K - w**2, 2.0 * RATIO * math.sqrt(K) * w))
    of = result.summary["gapping"]["stop"]
    assert of["level"] == pytest.approx(onset, rel=1e-9)
    assert result.summary["margins"]["gapping"]["value"] == pytest.approx(LEVEL / onset, rel=1e-9)
    assert of["preload_n"] == 0.0
