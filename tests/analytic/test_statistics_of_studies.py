"""What a sample of cases says, against closed forms and numbers by hand."""

import math

import numpy as np
import pytest
from scipy.stats import beta, spearmanr

import beamsim
from beamsim.analyses.studies.plan import latin_hypercube, one_at_a_time, plan_designs
from beamsim.analyses.studies.statistics import populations, rank_correlations, statistics, swings
from beamsim.analyses.studies.summary import result_of
from beamsim.cases import CaseOutcome, probability
from beamsim.errors import ScenarioError
from beamsim.outcomes import Outcome, OutcomeKind
from beamsim.scenario import load_scenario
from beamsim.scenario.studies import Correlation, VariedParameter
from tests.fabricated import solved_case

pytestmark = pytest.mark.quick


def ends(groups):
    return [(group[0], group[-1], group.size) for group in groups]


# --- populations ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(5))
def test_two_populations_are_seen_behind_a_mean_that_describes_neither(seed):
    rng = np.random.default_rng(seed)
    low, high = rng.uniform(46.0, 80.0, 80), rng.uniform(95.0, 122.0, 40)
    values = rng.permutation(np.concatenate([low, high]))
    assert ends(populations(values)) == [(low.min(), low.max(), 80), (high.min(), high.max(), 40)]
    first, second = statistics(values)["populations"]
    assert (first["mean"], second["mean"]) == pytest.approx((low.mean(), high.mean()))
    assert first["largest"] < statistics(values)["mean"] + 15.0 < second["smallest"] + 15.0


def test_three_populations_and_one_that_is_a_single_value():
    rng = np.random.default_rng(0)
    touching, striking = rng.normal(5.0, 1.0, 60), rng.normal(60.0, 2.0, 60)
    groups = populations(np.concatenate([np.zeros(40), 30.0 + touching, striking]))
    assert [group.size for group in groups] == [40, 60, 60]
    assert not np.any(groups[0])


@pytest.mark.parametrize("name", ["uniform", "normal", "exponential", "lognormal", "standard_cauchy"])
@pytest.mark.parametrize("size", [12, 60, 300])
def test_one_population_is_hardly_taken_for_two(name, size):
    """At most in one sample of twenty, whatever the shape of its one peak."""
    rng = np.random.default_rng(3)
    several = [len(populations(getattr(rng, name)(size=size))) > 1 for _ in range(400)]
    assert np.mean(several) < 0.05


def test_numbers_of_contacts_are_no_populations():
    assert len(populations(np.repeat([52.0, 54.0, 55.0], [40, 30, 30]))) == 1
    assert len(populations(np.full(50, 3.0))) == 1
    assert "populations" not in statistics(np.repeat([52.0, 54.0, 55.0], [40, 30, 30]))


# --- probabilities and percentiles ------------------------------------------------------------------------------------


def test_the_interval_of_a_probability():
    """Clopper and Pearson, 1934: quantiles of the beta distribution; of no failure in n the root of the level."""
    of = probability(np.arange(100) < 87)
    assert of["share"] == 0.87
    assert of["low"] == pytest.approx(beta.ppf(0.025, 87, 14), rel=1e-6)
    assert of["high"] == pytest.approx(beta.ppf(0.975, 88, 13), rel=1e-6)
    sure = probability(np.ones(60, dtype=bool))
    assert (sure["share"], sure["high"]) == (1.0, 1.0)
    assert sure["low"] == pytest.approx(0.025 ** (1 / 60), rel=1e-6)


def test_the_interval_of_a_quantile_holds_it_in_95_samples_of_100():
    rng = np.random.default_rng(2)
    held = []
    for _ in range(200):
        low, high = statistics(rng.exponential(size=150))["quantile_95_percent_interval"]
        held.append(low <= -math.log(0.05) <= high)
    assert 0.93 < np.mean(held) < 0.99


def test_quantiles_of_known_values():
    of = statistics(np.arange(101.0))
    assert [of[f"quantile_{p}_percent"] for p in (5, 50, 95)] == [5.0, 50.0, 95.0]
    assert of["standard_deviation"] == pytest.approx(math.sqrt(101 * 102 / 12))


# --- what a response goes with ----------------------------------------------------------------------------------------


def test_rank_correlation_by_hand():
    """1 - 6 sum d^2 / (n (n^2 - 1)) with d = 1, -1, 1, -1, 0; a curved but monotone dependence has 1."""
    x = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 9.0])
    y = np.array([20.0, 10.0, 40.0, 30.0, 50.0, np.nan])
    of = rank_correlations(y, {"a": x, "b": np.exp(y), "fixed": np.ones(6)})
    assert of["a"]["rank_correlation"] == pytest.approx(0.8)
    assert of["b"]["rank_correlation"] == pytest.approx(1.0)
    assert "fixed" not in of


def parameter(path, low, high, **more):
    return VariedParameter(path, ((path,),), "1", 0.5 * (low + high), (), low, high, **more)


VARIED = (
    parameter("a", -1.0, 1.0),
    parameter("b", 1.0, 100.0, spacing="logarithmic"),
    parameter("c", 0.0, 2.0, distribution="normal"),
)


def correlated(*pairs):
    return [Correlation(between=between, coefficient=coefficient) for between, coefficient in pairs]


@pytest.mark.parametrize("coefficient", [0.7, -0.4, 0.95])
def test_what_is_drawn_has_the_rank_correlation_and_keeps_its_distribution(coefficient):
    free = np.array(latin_hypercube(VARIED, 400, 1))
    bound = np.array(latin_hypercube(VARIED, 400, 1, correlated((("a", "b"), coefficient))))
    np.testing.assert_array_equal(np.sort(bound), np.sort(free))
    found = spearmanr(bound.T).statistic
    assert found[0, 1] == pytest.approx(coefficient, abs=0.03)
    assert abs(found[0, 2]) < 0.05
    assert abs(found[1, 2]) < 0.05
    assert abs(spearmanr(free.T).statistic[0, 1]) < 0.15


def test_correlations_that_no_numbers_have_together():
    pairs = correlated((("a", "b"), 0.9), (("b", "c"), 0.9), (("a", "c"), -0.9))
    with pytest.raises(
        ScenarioError, match=r"not possible together: 0\.9 of a and b, 0\.9 of b and c, -0\.9 of a and c"
    ):
        latin_hypercube(VARIED, 100, 1, pairs)


# --- one parameter at a time ------------------------------------------------------------------------------------------


def test_each_parameter_alone_gives_its_range():
    """y = a^2 - 3 b about a = 0, b = 1: a at -1, 0.5 and 2, b at 0 and 2; a's smallest is where it is as it was."""
    varied = (
        VariedParameter("a", (("a",),), "1", 0.0, (-1.0, 0.0, 0.5, 2.0)),
        VariedParameter("b", (("b",),), "1", 1.0, (), 0.0, 2.0, 3),
        VariedParameter("word", (("word",),), "1", "free", ("free", "pinned")),
    )
    columns = one_at_a_time(varied)
    assert list(zip(*columns, strict=True)) == [
        (0.0, 1.0, "free"), (-1.0, 1.0, "free"), (0.5, 1.0, "free"), (2.0, 1.0, "free"),
        (0.0, 0.0, "free"), (0.0, 2.0, "free"), (0.0, 1.0, "pinned"),
    ]  # fmt: skip
    a, b, word = map(np.array, columns)
    of = swings(a**2 - 3.0 * b + 0.5 * (word == "pinned"), {"a": a, "b": b, "word": word})
    assert of["a"] == {"smallest": -3.0, "smallest_at": 0.0, "largest": 1.0, "largest_at": 2.0}
    assert of["b"] == {"smallest": -6.0, "smallest_at": 2.0, "largest": 0.0, "largest_at": 0.0}
    assert of["word"] == {"smallest": -3.0, "smallest_at": "free", "largest": -2.5, "largest_at": "pinned"}


STEP = """
chain: {masses: [2 kg], springs: [8 kN/m]}
excitation: {kind: step, applied_to: {mass: 1}, level: 16 N}
probes: [{name: m, mass: 1}]
run: {duration: 0.2 s}
limits: {peak_displacement: 4 mm}
vary: """


def test_a_tornado_of_a_mass_under_a_sudden_force():
    """Without damping it moves to 2 F / k, whatever its mass."""
    study = "{kind: one_at_a_time, parameters: [{path: 'chain.springs[0]', tolerance: 20 %}, "
    study += "{path: excitation.level, from: 12 N, to: 24 N, points: 3}, {path: 'chain.masses[0]', tolerance: 10 %}]}"
    summary = beamsim.design_study(load_scenario(STEP + study)).summary
    of = summary["sensitivity"]["probes/m/peak_displacement"]
    spring, force, mass = of["chain.springs[0]"], of["excitation.level"], of["chain.masses[0]"]
    assert (spring["smallest"], spring["largest"]) == pytest.approx((32.0 / 9600.0, 32.0 / 6400.0), rel=1e-9)
    assert (spring["smallest_at"], spring["largest_at"]) == pytest.approx((9600.0, 6400.0))
    assert (force["smallest"], force["largest"]) == pytest.approx((24.0 / 8000.0, 48.0 / 8000.0), rel=1e-9)
    assert (mass["smallest"], mass["largest"]) == pytest.approx((0.004, 0.004), rel=1e-9)
    assert "best" not in summary


# --- a study as a whole -----------------------------------------------------------------------------------------------


def sampled(kind, samples, force, failed=()):
    """A study whose peak displacements are 2 F / k, as the solver would have them."""
    spring, mass = "{path: 'chain.springs[0]', from: 6 kN/m, to: 10 kN/m}", "{path: 'chain.masses[0]', tolerance: 5 %}"
    text = f"{{kind: {kind}, samples: {samples}, parameters: [{spring}, {mass}]}}"
    plan = plan_designs(load_scenario(STEP + text))
    outcomes = {
        case.number: solved_case(
            plan.scenario.limits.values_by_name,
            case.number,
            {"probes/m/peak_displacement": 2.0 * force / case.values[0]},
        )
        for case in plan.cases
    }
    lost = Outcome.of(OutcomeKind.FAILED, "failed", "lost")
    return result_of(plan, outcomes | {k: CaseOutcome(k, {}, lost) for k in failed})


def test_the_probability_that_a_limit_is_met():
    """2 F / k <= 4 mm for k >= 8.5 kN/m, which 37.5 % of the springs are; a case that failed does not meet it."""
    result = sampled("latin_hypercube", 400, 17.0)
    of = result.summary["margins"]["peak_displacement"]["probability"]
    assert of == result.summary["probability"]
    assert of["cases"] == 400
    assert of["share"] == pytest.approx(0.375, abs=1 / 400)
    assert of["low"] < 0.375 < of["high"]
    assert of["high"] - of["low"] == pytest.approx(2 * 1.96 * math.sqrt(0.375 * 0.625 / 400), rel=0.05)
    best = np.argsort([-k for k in result.table["chain.springs[0]"]])[:4].tolist()
    fewer = sampled("latin_hypercube", 400, 17.0, failed=best).summary["probability"]
    assert fewer["share"] == pytest.approx(of["share"] - 4 / 400)
    assert result.summary["sensitivity"]["probes/m/peak_displacement"]["chain.springs[0]"][
        "rank_correlation"
    ] == pytest.approx(-1.0)


def test_of_sobol_indices_the_independent_cases_count():
    assert sampled("sobol", 64, 17.0).summary["probability"]["cases"] == 128
