"""A slice of the attack (`python -m tests.attack` runs all of it), and the cases that it found."""

import pytest
import seeded_faults
from comparison import compare, own_motion
from random_systems import AIMED, ASSEMBLIES, MORE, random_case
from sampling import first_apart


def assert_agreement(seeds, folder):
    findings = [compare(seed, folder) for seed in seeds]
    assert [(f.seed, f.differences) for f in findings if f.differences] == []
    return [f for f in findings if f.outcome == "agrees"]


def test_random_systems(tmp_path):
    seeds = range(20)
    agreeing = assert_agreement(seeds, tmp_path)
    assert len(agreeing) > 0.8 * len(seeds)
    assert sum(f.events for f in agreeing) > 150


FOUND = {
    23: "a pair of events at a stop of no gap, too shallow to tell from none",
    5847: "a stop of no gap that 5 mN press against and the base leaves after 4 ns, passed over by our own search",
    8306: "a contact of no gap that ends after 2 ns, passed over by our own search",
    1000019: "a peak that the search of our own passed over",
    5000011: "the spline of a random input bent towards the end of the run",
    5000043: "inputs fitted by polynomials, an ill-conditioned fit of our own",
    7000391: "a flight of a tenth of a step, passed over by our own search",
    7000474: "a spring that turns at a bend",
    7001607: "a penetration of zero, in steps of 1e-9 s",
    7001866: "a soft structure beside a stiff stop was taken to float",
    7006206: "the extremes of a quantity that is zero but for round-off",
    8002001: "a stiff stop between masses that move together: round-off of its force in slow modes",
    9000545: "a low derivative of a contact of no gap, hidden by the motion of a stiff stop",
    10000128: "an equilibrium in the first segment of a table, from the last one: Newton's method of our own",
    10000295: "what a step follows from was too small for a number, and the march stood still",
    10002643: "a pressed pad that lets go at the start: its face was not compressed in the energy balance",
    10003016: "a million contacts on the spot: states of Maxwell branches that jumped by round-off at each",
    10007960: "a pad that is left too fast at the start of a swept sine, released without its face",
    10001117: "a contact of 2 ns against a stiff stop, which our own motion has as well",
    10001174: "a contact that our own steps passed over",
    10003388: "the same, enlarged by the eigenvalue solver",
    10003504: "an overdamped stop beside friction with a spring: its round-off in slow motions",
    13001935: "energy in a stiff stop on the ground, of a beam that drifts 10,000 times as far as it bends",
    30001467: "a soft mode that our own eigenvalue solver drowned in the round-off of a stiff one",
    30001812: "the same behind a hinge",
}


@first_apart("seed", 1, FOUND)
def test_what_was_found_before(tmp_path, seed):
    assert compare(seed, tmp_path).differences == []


SEEDED = seeded_faults.SEEDED | seeded_faults.OF_PLACES
MORE_FEATURES = (
    "table",
    "Maxwell branches",
    "friction behind a spring",
    "friction that holds exactly",
    "several forces",
)


def test_tables_branches_friction_forces_and_joints(tmp_path):
    seeds = range(MORE, MORE + 24)
    agreeing = assert_agreement(seeds, tmp_path)
    features = {feature for f in agreeing for feature in f.features}
    assert features.issuperset(MORE_FEATURES)
    assert any(feature.startswith("joint") for feature in features)


ASSEMBLED = ("imported matrices", "joint with Maxwell branches", "joint with a rotational spring", "joint to the base",
             "joint rigid", "joint hinge", "base that turns", "3 bodies")  # fmt: skip


def test_assemblies_of_joined_bodies(tmp_path):
    agreeing = assert_agreement(range(ASSEMBLIES, ASSEMBLIES + 24), tmp_path)
    assert {feature for f in agreeing for feature in f.features}.issuperset(ASSEMBLED)


def test_the_same_contact_is_not_counted_twice(tmp_path):
    """A stop of 1.2 GN/m without dashpot: contacts ended and began anew in the same instant, by round-off."""
    finding = compare(291, tmp_path)
    assert finding.differences == []
    assert finding.events > 500


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


def test_the_systems_aimed_at_seeded_faults_agree(tmp_path):
    assert len(assert_agreement(AIMED, tmp_path)) == len(AIMED)


@pytest.mark.parametrize("name", SEEDED)
def test_what_a_seeded_fault_changes_is_there(name):
    file, text, _ = SEEDED[name]
    assert (seeded_faults.ROOT / file).read_text(encoding="utf-8").count(text) == 1


def test_a_seeded_fault_is_caught():
    """Others, and the twin without a fault, by `python -m tests.attack`."""
    assert seeded_faults.catch("decay taken at the far end", 0, 20, compiled=False).startswith(
        "seed 2000000000: stop_1: 6 events of ours, 2"
    )


def test_a_seeded_fault_of_places_is_caught():
    """All of them, and the twin without a fault, by `python -m tests.attack`."""
    assert "test_places.py::" in seeded_faults.caught_by_tests("y is a share of the length")
