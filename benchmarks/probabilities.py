"""How often intervals of probabilities hold the exact ones: ``python -m benchmarks.probabilities``.

Eight limit states with an exact probability, each estimated with 60 seeds and several numbers of samples. They are
functions of standard normal variables, as `beamsim.analyses.studies.estimators` takes them, so that this takes minutes.
The table is kept in ``docs/probabilities.yaml`` with the date and the commit, and shown by the page of validation.
Intervals of 95 % hold the exact value in 54 of 60 or more.
"""

from __future__ import annotations

import argparse
import datetime
import math
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import yaml
from scipy.optimize import brentq
from scipy.stats import ncx2, norm

from beamsim.analyses.studies import sampling
from beamsim.analyses.studies.dependence import SIDES, dependence
from beamsim.analyses.studies.estimators import FAILED, Estimator
from beamsim.analyses.studies.reliability import interval
from beamsim.outcomes import COMPLETE
from beamsim.typing import Floats

TABLE = Path(__file__).parents[1] / "docs" / "probabilities.yaml"
SEEDS, SAMPLES = 60, (100, 250, 1000)
PARTS = 20  # normal numbers that a realisation of the random excitation consists of


class Problem(NamedTuple):
    """A limit state with its exact probability."""

    name: str
    variables: int
    state: Callable[[sampling.Points], Floats]
    probability: Callable[[Floats], float]  # exact, with the means of the variables moved by so much (variables,)
    method: str = "importance_sampling"
    random: bool = False  # whether there is a random process besides the variables

    @property
    def exact(self) -> float:
        """The probability with the means where they are."""
        return self.probability(np.zeros(self.variables))

    @property
    def importance(self) -> Floats:
        """(variables,) shares of the squared derivatives of the probability by the means; nan where all are 0."""
        step = 1e-4
        by_mean = np.array([self.probability(by) - self.probability(-by) for by in step * np.eye(self.variables)])
        if np.abs(by_mean).max() < 1e-3 * step * self.exact:
            return np.full(self.variables, math.nan)
        return by_mean**2 / np.sum(by_mean**2)

    def doubles(self, variable: int, sign: float) -> float:
        """The smallest move of a mean to one side that doubles the probability; nan where none of up to 3 does."""
        unit, twice = sign * np.eye(self.variables)[variable], 2.0 * self.exact
        moves = np.linspace(0.0, 3.0, 121)
        above = np.flatnonzero([self.probability(by * unit) >= twice for by in moves])
        if not above.size:
            return math.nan
        ends = moves[above[0] - 1], moves[above[0]]
        return sign * float(brentq(lambda by: self.probability(by * unit) - twice, *ends))


class StandardNumbers:
    """Numbers that are standard normal variables themselves, as `Scatter` has them."""

    def __init__(self, count: int) -> None:
        self.numbers = [SimpleNamespace(path=f"u{k}", unit="1") for k in range(count)]
        self.means, self.deviations = np.zeros(count), np.ones(count)

    def values(self, u: Floats) -> Floats:
        """They are the variables."""
        return u

    def shifted(self, u: Floats, number: int, by: float) -> Floats:
        """(n, d) by how much variables change when the mean of a number is moved."""
        return np.broadcast_to(-by * np.eye(u.shape[1])[number], u.shape)

    def widened(self, u: Floats, number: int, by: float) -> Floats:
        """(n, d) the same when its deviation grows, ``by`` in logarithms."""
        return -by * u * np.eye(u.shape[1])[number]


def ring(u: Floats) -> Floats:
    """Exceeded in all directions."""
    return 1.0 - np.linalg.norm(u, axis=1) / 4.5


def of_contact(u: Floats) -> Floats:
    """The force of a spring behind a gap that a mass hits: speed, stiffness and gap scatter, the limit is 150 N."""
    mass, spring, width = 2.0, 1e3, math.sqrt(math.log1p(0.2**2))
    speed, stop = 0.5 * (1.0 + 0.1 * u[:, 0]), 20e3 * np.exp(width * u[:, 1] - 0.5 * width**2)
    gap = 1e-3 * (1.0 + 0.2 * u[:, 2])
    share = spring * gap / (spring + stop)  # by which the spring alone would deflect the stop
    left = np.maximum(mass * speed**2 - spring * gap**2, 0.0)
    return 1.0 - stop * (np.sqrt(share**2 + left / (spring + stop)) - share) / 150.0


def exact_of_contact(by: Floats) -> float:
    """By quadrature over stiffness and gap: the speed whose energy deflects the stop up to the limit."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(80)
    z, y = np.meshgrid(nodes + by[1], nodes + by[2], indexing="ij")
    width = math.sqrt(math.log1p(0.2**2))
    stop, gap = 20e3 * np.exp(width * z - 0.5 * width**2), 1e-3 * (1.0 + 0.2 * y)
    speed = np.sqrt((stop * (150.0 / stop) ** 2 + 1e3 * (gap + 150.0 / stop) ** 2) / 2.0)
    return float(weights @ norm.sf((speed / 0.5 - 1.0) / 0.1 - by[0]) @ weights) / (2.0 * math.pi)


@cache
def realisation(seed: int) -> Floats:
    """(parts,) normal numbers that a realisation consists of."""
    return np.random.default_rng(seed).standard_normal(PARTS)


def of_noise(points: sampling.Points) -> Floats:
    """The largest of many values that are linear in the noise, either way, and a limit that scatters."""
    largest = [np.abs(sum(share * realisation(seeds[0]) for seeds, share in of)).max() for of in points.blends]
    return 1.0 - np.array(largest) / (4.0 + 0.2 * points.u[:, 0])


def exact_of_noise(by: Floats) -> float:
    """By quadrature over the limit."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(60)
    beyond = -np.expm1(PARTS * np.log1p(-2.0 * norm.sf(4.0 + 0.2 * (nodes + by[0]))))
    return float(weights @ beyond) / math.sqrt(2.0 * math.pi)


def failing(u: Floats) -> Floats:
    """Histories with a small second number fail, without any sign of it nearby."""
    return np.where(u[:, 1] < -3.2, FAILED, 1.0 - u[:, 0] / 3.5)


def problems() -> Iterator[Problem]:
    """The eight problems."""

    def of(function: Callable[[Floats], Floats]) -> Callable[[sampling.Points], Floats]:
        return lambda points: function(points.u)

    limits = np.array([3.6, 3.8, 4.0, 4.1])
    yield Problem(
        "one region, ten variables", 10, of(lambda u: 1.0 - u.sum(axis=1) / math.sqrt(10.0) / 4.75),
        lambda by: float(norm.sf(4.75 - by.sum() / math.sqrt(10.0))),
    )  # fmt: skip
    yield Problem(
        "two regions",
        1,
        of(lambda u: 1.0 - np.abs(1.0 + 10.0 * u[:, 0]) / 41.0),
        lambda by: float(norm.sf(4.0 - by[0]) + norm.sf(4.2 + by[0])),
    )
    yield Problem(
        "four regions",
        2,
        of(lambda u: 1.0 - np.max(np.hstack([u, -u]) / limits, axis=1)),
        lambda by: 1.0 - float(np.prod(norm.cdf(limits[:2] - by) - norm.cdf(-limits[2:] - by))),
    )
    yield Problem("a ring", 2, of(ring), lambda by: float(ncx2.sf(4.5**2, 2, max(by @ by, 1e-30))))
    yield Problem("a contact, three variables", 3, of(of_contact), exact_of_contact)
    yield Problem(
        "all of two limits", 2, of(lambda u: np.max(1.0 - (1.0 + 0.1 * u) / np.array([1.3, 1.25]), axis=1)),
        lambda by: float(norm.sf(3.0 - by[0]) * norm.sf(2.5 - by[1])),
    )  # fmt: skip
    yield Problem("random excitation", 1, of_noise, exact_of_noise, "subset", random=True)
    yield Problem(
        "histories that fail", 2, of(failing), lambda by: 1.0 - float(norm.cdf(3.5 - by[0]) * norm.cdf(3.2 + by[1]))
    )


def estimated(problem: Problem, samples: int, seed: int) -> Estimator:
    """One estimate of a problem."""
    origin = sampling.points_at(np.zeros((1, problem.variables)), np.zeros((1, int(problem.random)), dtype=int))
    estimator = Estimator(
        problem.state, origin, method=problem.method, samples=samples, target=0.1, seed=seed
    )  # fmt: skip
    estimator.sample_until_sure()
    return estimator


def held_intervals(problem: Problem, every: Sequence[Estimator]) -> dict[str, int]:
    """How many intervals of importance and of what doubles the probability hold the exact values, and of how many.

    Where the method gives no interval, or says that nothing doubles it, there is none to count.
    """
    exact = np.array([[problem.doubles(k, sign) for sign in SIDES.values()] for k in range(problem.variables)])
    numbers: Any = StandardNumbers(problem.variables)
    counts = dict.fromkeys(("doubles_held", "doubles", "importance_held", "importances"), 0)
    for of in every:
        table = dependence(numbers, of, numbers.numbers)
        low, high, right = (np.abs(x) for x in (table["doubles_low"].values, table["doubles_high"].values, exact))
        shown = np.isfinite(low) & np.isfinite(right)
        counts["doubles"] += int(shown.sum())
        counts["doubles_held"] += int(np.sum(((low <= right) & (right <= high))[shown]))
        low, high = table["importance_low"].values, table["importance_high"].values
        shown = np.isfinite(low) & np.isfinite(problem.importance) & (problem.variables > 1)
        counts["importances"] += int(shown.sum())
        counts["importance_held"] += int(np.sum(((low <= problem.importance) & (problem.importance <= high))[shown]))
    return counts


def row(problem: Problem, samples: int, seeds: int) -> dict[str, Any]:
    """A line of the table."""
    every = [estimated(problem, samples, seed) for seed in range(seeds)]
    realisation.cache_clear()
    held = [low < problem.exact < high for low, high in map(interval, every)]
    return {
        "problem": problem.name, "samples": samples, "exact": float(f"{problem.exact:.5g}"),
        "mean": float(f"{np.mean([of.estimate.probability for of in every]):.5g}"), "held": int(sum(held)),
        "seeds": seeds,
        "check_agrees": sum(of.check is COMPLETE for of in every),
        "histories": round(float(np.mean([of.evaluated_count for of in every]))),
        **held_intervals(problem, every),
    }  # fmt: skip


def main() -> None:
    """Compute the table, print it and keep it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", help="part of the names of problems; the table is not kept then")
    parser.add_argument("--samples", type=int, nargs="*", default=SAMPLES)
    parser.add_argument("--seeds", type=int, default=SEEDS)
    given = parser.parse_args()
    rows = []
    for problem in problems():
        for samples in given.samples if given.only in problem.name else ():
            rows.append(row(problem, samples, given.seeds))
            print(rows[-1], file=sys.stderr, flush=True)
    if not given.only:
        commit = subprocess.run(
            ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True, cwd=TABLE.parent
        ).stdout.strip()
        about = {"date": datetime.date.today().isoformat(), "commit": commit, "rows": rows}
        TABLE.write_text(yaml.safe_dump(about, sort_keys=False, width=200), encoding="utf-8")


if __name__ == "__main__":
    main()
