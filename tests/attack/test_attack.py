"""A slice of the attack (`python -m tests.attack` runs all of it), and the cases that it found."""

import adversity
import pytest
import yaml_mutants
from comparison import compare, own_motion
from random_systems import random_case

FAST = range(12)
SLOW = range(12, 40)
UNEXPLAINED = {
    23: "a pair of events at a stop of no gap parts; the motions stay within 2e-9",
    291: "one event of a pinned beam comes 1.4e-7 s later",
}
"""Differences that nobody has explained yet, by seed: the list only shrinks."""


def assert_agreement(seeds, folder):
    findings = [compare(seed, folder) for seed in seeds]
    assert {f.seed for f in findings if f.differences} == set(UNEXPLAINED) & set(seeds)
    return [f for f in findings if f.outcome == "agrees"]


def test_random_systems(tmp_path):
    agreeing = assert_agreement(FAST, tmp_path)
    assert len(agreeing) > 0.9 * len(FAST)
    assert sum(f.events for f in agreeing) > 300


@pytest.mark.slow
def test_more_random_systems(tmp_path):
    agreeing = assert_agreement(SLOW, tmp_path)
    assert len(agreeing) > 0.8 * len(SLOW)


@pytest.mark.slow
def test_the_same_contact_is_not_counted_twice(tmp_path):
    """A stop of 1.2 GN/m without dashpot: contacts ended and began anew in the same instant, by round-off."""
    finding = compare(291, tmp_path)
    assert bool(finding.differences) == (291 in UNEXPLAINED)
    assert finding.events > 500
    assert not any("events of ours" in text for text in finding.differences)


def test_our_own_motion_has_the_accuracy_it_claims(tmp_path):
    """Half the step gives the same motion: the twin without which agreement would say nothing."""
    case, _ = random_case(5, tmp_path)
    own = own_motion(case)
    assert own.apart[own.outputs[0]] < 1e-9


def test_a_changed_system_differs(tmp_path, monkeypatch):
    """The comparison can fail: a stiffness that is off by 1e-5 is seen."""
    import beamsim

    validate = beamsim.Scenario.model_validate

    def changed(case):
        chain = dict(case["chain"])
        chain["snubbers"] = [{**s, "stiffness": s["stiffness"] * (1 + 1e-5)} for s in chain["snubbers"]]
        return validate({**case, "chain": chain})

    seed = next(s for s in range(100) if "chain" in random_case(s, tmp_path)[0] and compare(s, tmp_path).events > 20)
    monkeypatch.setattr(beamsim.Scenario, "model_validate", changed)
    assert compare(seed, tmp_path).differences


def test_mutated_scenarios():
    codes, faults = yaml_mutants.attack(10, 7)
    assert faults == []
    assert codes[2] > 0


@pytest.mark.slow
def test_more_mutated_scenarios():
    codes, faults = yaml_mutants.attack(200, 8)
    assert faults == []
    assert codes[2] > 20
    assert codes[0] + codes[3] > 20


@pytest.mark.slow
def test_damaged_files():
    assert adversity.damaged(40, 1)[1] == []
