"""Cases that are asked for in batches: numbered in the order asked, known ones not solved again."""

from functools import partial

import pytest

import beamsim
from beamsim.analyses.studies.plan import plan_draws
from beamsim.cases import Evaluator, failed_case
from beamsim.outcomes import stop_requests
from beamsim.parallel import Computation, worker_pool
from beamsim.scenario import load_scenario
from beamsim.trust.studies import CaseSolver

BASE = """\
chain: {masses: [1 kg], springs: [1 kN/m]}
snubbers: [{name: stop, mass: 1, side: below, gap: 1 mm, stiffness: 1e5}]
excitation: {kind: harmonic, applied_to: base, frequency: 5 Hz, level: 2}
run: {duration: 0.2 s}
"""
GAPS = [(1e-3,), (2e-3,), (0.0,), (3e-3,)]
FORCE = "snubbers/stop/peak_force"


@pytest.fixture
def solver():
    study = plan_draws(load_scenario(BASE), {"snubbers.stop.gap": [1e-3]}, ["peak_force"]).study
    return Computation(partial(CaseSolver, study), failed_case)


@pytest.fixture
def solved(monkeypatch):
    """Numbers of the cases that are solved."""
    numbers = []

    def solve(self, case, real=CaseSolver.__call__):
        numbers.append(case.number)
        return real(self, case)

    monkeypatch.setattr(CaseSolver, "__call__", solve)
    return numbers


@pytest.mark.parametrize("workers", [1, 2])
def test_batches_give_what_single_runs_give(solver, workers):
    with Evaluator(worker_pool(solver, 4, workers=workers), most_cases=4) as evaluate:
        first, second = evaluate(GAPS[:3]), evaluate(GAPS[3:])
    assert evaluate.ended == ""
    assert evaluate.rows == GAPS
    for (gap,), (outcome,) in zip(GAPS, first + second, strict=True):
        alone = beamsim.run(load_scenario(BASE, {"snubbers.stop.gap": gap})).summary
        assert outcome.values[FORCE] == pytest.approx(alone["peak_force_n"]["stop"], rel=1e-10)


def test_outcomes_that_are_known_are_taken_where_they_belong_to_the_same_case(solver, solved):
    with Evaluator(worker_pool(solver, 4), most_cases=4) as evaluate:
        evaluate(GAPS)
    solved.clear()
    with Evaluator(worker_pool(solver, 4), most_cases=4, solved_before=evaluate.outcomes.values()) as again:
        again([GAPS[0]])
        again([GAPS[1], (5e-3,), GAPS[3]])  # the third case is another one than before
    assert solved == [2]
    assert again.outcomes[3] == evaluate.outcomes[3]
    assert again.outcomes[2].given == (5e-3,)


def test_the_block_ends_after_the_cases_that_are_allowed_and_after_a_stop(solver, solved):
    with Evaluator(worker_pool(solver, 3), most_cases=3) as evaluate:
        evaluate(GAPS)
        pytest.fail("went on")
    assert (evaluate.ended, sorted(evaluate.outcomes)) == ("most_cases", [0, 1, 2])
    with stop_requests(lambda: len(solved) > 4), Evaluator(worker_pool(solver, 9), most_cases=9) as evaluate:
        evaluate(GAPS[:1])
        evaluate(GAPS[1:])
        pytest.fail("went on")
    assert evaluate.ended == "interrupted"
    assert sorted(evaluate.outcomes) == [0]
