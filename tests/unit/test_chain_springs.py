"""Bumpers, cables and nonlinear springs of chains: what is refused, what is stored, what sweeps and branches name."""

import numpy as np
import pytest

import beamsim
from beamsim.analyses.continuation.analysis import continuation
from beamsim.scenario import load_scenario
from beamsim.scenario.connections import LinkSnubber, Snubber
from tests.helpers.branches import events_of

CASE = """
chain:
  masses: [1 kg, 2 kg, 1 kg]
  springs: [1, 1, 1, 1]
  dashpots: [0.1, 0.1, 0.1, 0.1]
  snubbers:
    - {between: [2, 1], stiffness: 5 N/m, gap: 5 cm}
    - {name: stop, mass: 3, side: above, stiffness: 4, gap: 0.3}
  springs_between:
    - {masses: [2, 3], kind: piecewise_linear, breakpoints: [-10 cm, 0.2], stiffnesses: [2 N/m, 1, 0.5]}
  springs_to_ground:
    - {mass: 1, kind: linear, stiffness: 0.1 N/m}
excitation: {kind: harmonic, applied_to: base, level: 0.3, frequency: 1.1 rad/s}
run: {duration: 60, sample_rate: 10}
sweep: {kind: continuation, from: 0.9 rad/s, to: 1.3 rad/s}
"""


def test_names_units_and_yaml():
    case = load_scenario(CASE)
    link, stop = case.chain.snubbers
    assert isinstance(link, LinkSnubber)
    assert isinstance(stop, Snubber)
    assert (link.name, link.gap, link.resists) == ("snubber_1", 0.05, "approach")
    assert [s.name for s in (*case.chain.springs_between, *case.chain.springs_to_ground)] == [
        "link_spring_1",
        "ground_spring_1",
    ]
    assert case.chain.springs_between[0].breakpoints == (-0.1, 0.2)
    assert load_scenario(case.to_yaml()) == case
    assert [(p.name, p.mass) for p in case.effective_probes] == [("stop", 3), ("mass_2", 2), ("mass_1", 1)]


@pytest.fixture(scope="module")
def result():
    return beamsim.run(load_scenario(CASE))


def test_breakpoints_are_no_contacts(result):
    s = result.summary
    assert list(s["contacts"]) == list(s["peak_force_n"]) == ["snubber_1", "stop"]
    assert s["breakpoints_passed"] > 0
    assert s["breakpoints_passed"] + s["events"] == result.summary["solver_events"]
    assert s["peak_spring_force_n"]["link_spring_1"] == pytest.approx(
        np.abs(result["histories"]["spring_force"].sel(spring="link_spring_1").values).max(), rel=1e-2
    )


def test_a_branch_names_the_spring_whose_breakpoint_it_grazes():
    found = continuation(load_scenario(CASE, {"sweep.seek_at": 0}))
    assert found.outcome.complete
    assert {e.snubber for e in events_of(found) if e.kind == "grazing"} >= {"link_spring_1"}
    assert found["points"].labels("snubber") == ["snubber_1", "stop"]
