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
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from scipy.stats import norm

from beamsim.analyses.studies import sampling
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
    exact: float
    method: str = "importance_sampling"
    random: bool = False  # whether there is a random process besides the variables


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


def exact_of_contact() -> float:
    """By quadrature over stiffness and gap: the speed whose energy deflects the stop up to the limit."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(80)
    z, y = np.meshgrid(nodes, nodes, indexing="ij")
    width = math.sqrt(math.log1p(0.2**2))
    stop, gap = 20e3 * np.exp(width * z - 0.5 * width**2), 1e-3 * (1.0 + 0.2 * y)
    speed = np.sqrt((stop * (150.0 / stop) ** 2 + 1e3 * (gap + 150.0 / stop) ** 2) / 2.0)
    return float(weights @ norm.sf((speed / 0.5 - 1.0) / 0.1) @ weights) / (2.0 * math.pi)


@cache
def realisation(seed: int) -> Floats:
    """(parts,) normal numbers that a realisation consists of."""
    return np.random.default_rng(seed).standard_normal(PARTS)


def of_noise(points: sampling.Points) -> Floats:
    """The largest of many values that are linear in the noise, either way, and a limit that scatters."""
    largest = [np.abs(sum(share * realisation(seeds[0]) for seeds, share in of)).max() for of in points.blends]
    return 1.0 - np.array(largest) / (4.0 + 0.2 * points.u[:, 0])


def exact_of_noise() -> float:
    """By quadrature over the limit."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(60)
    beyond = -np.expm1(PARTS * np.log1p(-2.0 * norm.sf(4.0 + 0.2 * nodes)))
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
        "one region, ten variables", 10, of(lambda u: 1.0 - u.sum(axis=1) / math.sqrt(10.0) / 4.75), norm.sf(4.75)
    )
    yield Problem(
        "two regions", 1, of(lambda u: 1.0 - np.abs(1.0 + 10.0 * u[:, 0]) / 41.0), norm.sf(4.0) + norm.sf(4.2)
    )
    yield Problem(
        "four regions", 2, of(lambda u: 1.0 - np.max(np.hstack([u, -u]) / limits, axis=1)),
        1.0 - float(np.prod(norm.cdf(limits[:2]) - norm.cdf(-limits[2:]))),
    )  # fmt: skip
    yield Problem("a ring", 2, of(ring), math.exp(-(4.5**2) / 2.0))
    yield Problem("a contact, three variables", 3, of(of_contact), exact_of_contact())
    yield Problem(
        "all of two limits", 2, of(lambda u: np.max(1.0 - (1.0 + 0.1 * u) / np.array([1.3, 1.25]), axis=1)),
        norm.sf(3.0) * norm.sf(2.5),
    )  # fmt: skip
    yield Problem("random excitation", 1, of_noise, exact_of_noise(), "subset", random=True)
    yield Problem("histories that fail", 2, of(failing), 1.0 - norm.cdf(3.5) * norm.cdf(3.2))


def estimated(problem: Problem, samples: int, seed: int) -> Estimator:
    """One estimate of a problem."""
    origin = sampling.points_at(np.zeros((1, problem.variables)), np.zeros((1, int(problem.random)), dtype=int))
    estimator = Estimator(
        problem.state, origin, method=problem.method, samples=samples, target=0.1, seed=seed
    )  # fmt: skip
    estimator.estimated()
    return estimator


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
        "histories": round(float(np.mean([of.asked for of in every]))),
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
