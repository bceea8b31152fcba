"""How near fronts of two objectives come to grids: ``python -m benchmarks.fronts``.

Five problems are searched with three seeds each, and compared with grids of runs: the best value of each objective; by
how much of the front a design of it is worse in both objectives than one of the grid; and the widest gap between
neighbours in the front, of its length. The table is kept in ``docs/fronts.yaml`` with the date and the commit; the page
of validation shows it. Ends are to be within 0.5 %, no design is dominated, and no gap is wider than a tenth.
"""

from __future__ import annotations

import argparse
import datetime
import subprocess
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml

import beamsim
from beamsim.analyses.studies.objectives import Objective, objectives
from beamsim.analyses.studies.result import StudyResult
from beamsim.typing import Floats

TABLE = Path(__file__).parents[1] / "docs" / "fronts.yaml"
SEEDS = 3

_MASSES = {"masses": ["2 kg", "0.5 kg"], "damping": {"kind": "modal", "ratio": "2 %"}}
_TWO_STOPS = {
    "title": "Two masses between stops, a shock",
    "chain": {**_MASSES, "springs": ["80 kN/m", "60 kN/m"], "snubbers": [
        {"name": "stop", "mass": 2, "side": "below", "stiffness": "100 kN/m", "gap": "0.5 mm",
         "damping": {"kind": "ratio", "ratio": "5 %"}},
        {"name": "up", "mass": 1, "side": "above", "stiffness": "300 kN/m", "gap": "1 mm"},
    ]},
    "excitation": {"kind": "half_sine", "applied_to": "base", "level": "30 g", "duration": "6 ms"},
    "probes": [{"name": "first", "mass": 1}, {"name": "second", "mass": 2}],
    "run": {"duration": "60 ms", "sample_rate": "20 kHz", "convergence": "off"},
}  # fmt: skip
_BEAM = {
    "title": "A beam's tip against a snubber",
    "beam": {"length": "270 mm", "width": "50 mm", "thickness": "5 mm", "youngs_modulus": "69 GPa",
             "density": "2700 kg/m^3", "elements": 6, "damping": {"kind": "modal", "ratio": "1 %"}},
    "reduction": {"modes": 4},
    "snubbers": [{"name": "tip", "position": "270 mm", "side": "below", "stiffness": "151 kN/m", "gap": "0.1 mm",
                  "damping": {"kind": "ratio", "ratio": "5 %"}}],
    "excitation": {"kind": "harmonic", "applied_to": "base", "level": "2 g", "frequency": "55 Hz"},
    "run": {"duration": "0.3 s", "sample_rate": "5 kHz", "convergence": "off"},
}  # fmt: skip


def _range(path: str, low: str, high: str, points: int, *, log: bool = False) -> dict[str, Any]:
    return {"path": path, "from": low, "to": high, "points": points, **({"spacing": "logarithmic"} if log else {})}


def _dampings(path: str, of: Mapping[str, str]) -> dict[str, Any]:
    return {"name": "pad", "choices": {name: {path: ratio} for name, ratio in of.items()}}


class Problem(NamedTuple):
    """A case with what may be chosen, and two objectives."""

    name: str
    case: dict[str, Any]
    parameters: list[dict[str, Any]]  # ranges with the points of their grid, and catalogues
    aims: dict[str, Any]  # minimise, maximise
    most_cases: int


def problems() -> Iterator[Problem]:
    """The five problems."""
    stop = "chain.snubbers.stop"
    pads = _dampings(f"{stop}.damping.ratio", {"bare": "1 %", "felt": "8 %", "gel": "25 %"})
    yield Problem(
        "two stops, three pads, a limit", _TWO_STOPS | {"limits": {"peak_acceleration": {"second": "100 g"}}},
        [_range(f"{stop}.gap", "0 mm", "4 mm", 25),
         _range(f"{stop}.stiffness", "10 kN/m", "1 MN/m", 25, log=True), pads],
        {"minimise": ["snubbers/stop/peak_force", "probes/second/peak_displacement"]}, 800,
    )  # fmt: skip
    yield Problem(
        "a stop that need not be hit", _TWO_STOPS,
        [_range(f"{stop}.gap", "0 mm", "12 mm", 41), _range(f"{stop}.stiffness", "20 kN/m", "500 kN/m", 16, log=True)],
        {"minimise": ["snubbers/stop/peak_force", "probes/second/peak_displacement"]}, 400,
    )  # fmt: skip
    held = {
        "title": "A mass that runs into stops",
        "chain": {"masses": ["2 kg"], "springs": ["10 N/m"]},
        "snubbers": [{"name": "stop", "mass": 1, "side": "both", "gap": "0 mm", "stiffness": "20 kN/m"}],
        "run": {"duration": "0.1 s", "start": {"displacement": [0.0], "velocity": ["0.5 m/s"]}, "convergence": "off"},
        "limits": {"peak_force": "150 N"},
    }
    masses = {"name": "mass", "choices": {f"{m} kg": {"chain.masses": [f"{m} kg"]} for m in (2, 3, 5)}}
    yield Problem(
        "a mass that runs into a stop", held,
        [_range("snubbers.stop.stiffness", "1 kN/m", "100 kN/m", 31, log=True),
         _range("snubbers.stop.gap", "0 mm", "2 mm", 6), masses],
        {"minimise": ["peak_force", "peak_displacement"]}, 300,
    )  # fmt: skip
    yield Problem(
        "a beam at a snubber", _BEAM,
        [_range("snubbers.tip.gap", "0 mm", "0.5 mm", 16),
         _range("snubbers.tip.stiffness", "5 kN/m", "500 kN/m", 25, log=True),
         _dampings("snubbers.tip.damping.ratio", {"hard": "2 %", "soft": "12 %"})],
        {"minimise": ["peak_force", "probes/tip/peak_displacement"]}, 600,
    )  # fmt: skip
    yield Problem(
        "a soft mounting, time in contact", _TWO_STOPS | {"limits": {"peak_force": {"stop": "700 N"}}},
        [_range(f"{stop}.gap", "0 mm", "3 mm", 16),
         _range("chain.springs[1]", "20 kN/m", "200 kN/m", 16, log=True), pads],
        {"minimise": "probes/second/peak_acceleration", "maximise": "snubbers/stop/contact_share"}, 800,
    )  # fmt: skip


def _costs(result: StudyResult, aims: Sequence[Objective]) -> Floats:
    """(2, n) the objectives of all designs, small where good; infinite of those that exceed a limit."""
    cases = result["cases"]
    values = np.array(
        [aim.sign * np.asarray(aim.of({n: x.values for n, x in result.responses.items()})) for aim in aims]
    )
    passing = cases["passing"].values if "passing" in cases else np.ones(result.count, dtype=bool)
    return np.where(passing & np.isfinite(values).all(axis=0), values, np.inf)


def efficient(values: Floats) -> Floats:
    """(n,) which points no other one is better than in one coordinate and as good in the other."""
    order = np.lexsort(values[::-1])
    least = np.minimum.accumulate(np.append(np.inf, values[1, order]))[:-1]
    of_front = np.zeros(order.size, dtype=bool)
    of_front[order] = values[1, order] < least
    return of_front


def efficient_values(values: Floats) -> Floats:
    """(2, m) of points (2, n) those of the front, by the first objective."""
    kept = values[:, efficient(values)]
    return kept[:, np.argsort(kept[0])]


def searched(problem: Problem, seed: int) -> StudyResult:
    """The front as a search finds it."""
    parameters = [{key: value for key, value in each.items() if key != "points"} for each in problem.parameters]
    settings = {**problem.aims, "parameters": parameters, "most_cases": problem.most_cases, "seed": seed}
    return beamsim.design_study(beamsim.load_scenario(problem.case | {"optimise": settings}), workers=1)


def grid(problem: Problem) -> StudyResult:
    """Runs of all designs of a grid."""
    vary = {"kind": "grid", "parameters": problem.parameters}
    return beamsim.design_study(beamsim.load_scenario(problem.case | {"vary": vary}), workers=1)


def dominated_by(front: Floats, others: Floats, ranges: Floats) -> float:
    """By how much of the ranges a point of a front (2, n) is worse in both objectives than one of others (2, m)."""
    worse = np.min((front[:, :, None] - others[:, None, :]) / ranges[:, None, None], axis=0)
    return max(float(worse.max()), 0.0)


def widest(front: Floats, ranges: Floats) -> float:
    """Widest gap between neighbours of a front (2, n) over its length, the range of each objective being one."""
    steps = np.linalg.norm(np.diff(front / ranges[:, None], axis=1), axis=0)
    return float(steps.max() / steps.sum())


def rows(problem: Problem, seed: int, of_grid: Callable[[Sequence[Objective]], Floats]) -> Iterator[dict[str, Any]]:
    """The lines of a search.

    Parameters
    ----------
    problem, seed : of the search.
    of_grid : gives the objectives of the grid.
    """
    result = searched(problem, seed)
    aims = objectives(result.scenario)
    right = efficient_values(of_grid(aims))
    values = _costs(result, aims)[:, result["cases"]["front"].values]
    front = values[:, np.argsort(values[0])]
    ranges = np.ptp(right, axis=1)
    about = {"problem": problem.name, "seed": seed, "cases": result.count, "status": result.outcome.code or "complete"}
    for aim, best, found in zip(aims, right.min(axis=1), front.min(axis=1), strict=True):
        short = (found - best) / abs(best) if best else found / float(np.ptp(right[0]))
        yield about | _line(aim.text, aim.sign * best, aim.sign * found, short)
    worse = dominated_by(front, right, ranges)
    yield about | _line("worse in both than a design of the grid, of the front", 0.0, worse, worse)
    gaps = widest(right, ranges), widest(front, ranges)
    yield about | _line("widest gap, of the length of the front", *gaps, gaps[1] - gaps[0])


def _line(quantity: str, right: float, value: float, difference: float) -> dict[str, Any]:
    figures = {"right value": right, "value": value, "difference": difference}
    return {"quantity": quantity, **{name: float(f"{figure:.5g}") for name, figure in figures.items()}}


def main() -> None:
    """Compute the table, print it and keep it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", help="part of the names of problems; the table is not kept then")
    parser.add_argument("--seeds", type=int, default=SEEDS)
    given = parser.parse_args()
    table = []
    for problem in problems():
        if given.only in problem.name:
            exact = grid(problem)
            for seed in range(given.seeds):
                for row in rows(problem, seed, partial(_costs, exact)):
                    print(*row.values(), sep="; ", flush=True)
                    table.append(row)
    if not given.only:
        command = ["git", "rev-parse", "--short", "HEAD"]
        commit = subprocess.run(command, capture_output=True, text=True, check=True, cwd=TABLE.parent).stdout.strip()
        about = {"date": datetime.date.today().isoformat(), "commit": commit, "rows": table}
        TABLE.write_text(yaml.safe_dump(about, sort_keys=False, width=200), encoding="utf-8")


if __name__ == "__main__":
    main()
