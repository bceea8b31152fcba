"""Random chains with an extreme of each sign that are as large: derivatives against one-sided differences of runs."""

import numpy as np
from sampling import first_apart
from scipy.optimize import brentq

import beamsim
from beamsim import load_scenario
from beamsim.analyses.studies.responses import run_responses
from beamsim.flow.exact import exact_flow
from beamsim.flow.transient import simulate
from beamsim.system.build import build_system
from tests.helpers.observed import rows

STEP = 3e-6  # of the number
AGREEMENT = 0.01
SMALL = 1e-4  # elasticity, below which the change of a value is none


def random_chain(seed):
    """A damped chain of one to four masses with one or two stops, kicked; half of them are shaken as well."""
    rng = np.random.default_rng(seed)
    masses = int(rng.integers(1, 5))
    sides = rng.permutation(["below", "above"])[: rng.integers(1, 3)].tolist()
    stops = [
        {"name": side, "mass": int(rng.integers(1, masses + 1)), "side": side, "gap": float(rng.uniform(5e-4, 5e-3)),
         "stiffness": float(10.0 ** rng.uniform(3.5, 5.0))}
        for side in sides
    ]  # fmt: skip
    frequency, level = float(rng.uniform(5.0, 25.0)), float(rng.uniform(1.0, 20.0))
    shaken = {"kind": "harmonic", "applied_to": "base", "level": level, "frequency": frequency}
    return {
        "chain": {
            "masses": rng.uniform(0.5, 2.0, masses).tolist(),
            "springs": (10.0 ** rng.uniform(3.7, 4.3, masses)).tolist(),
            "dashpots": rng.uniform(2.0, 15.0, masses).tolist(), "snubbers": stops,
        },
        "excitation": shaken if rng.random() < 0.5 else {"kind": "none"},
        "probes": [{"name": "m", "mass": int(rng.integers(1, masses + 1))}],
        "run": {
            "duration": float(rng.uniform(0.08, 0.3)), "convergence": "off",
            "start": {"velocity": rng.uniform(-1.0, 1.0, masses).tolist()},
        },
    }, (f"chain.snubbers.{sides[0]}.gap", "chain.springs[0]", "chain.masses[0]", "run.start.velocity[0]")  # fmt: skip


def balanced(case, path, value):
    """The value of a number with which both extremes of the probe are as large; as it is where there is none near."""

    def excess(factor):
        system = build_system(load_scenario(case, [f"{path}={value * factor!r}"]))
        flow = exact_flow(system, case["run"]["duration"])
        found = simulate(flow, system.initial_state).extrema(rows(flow, 1, displacement=system.probes[0].shape[None]))
        return float(found.high[0] + found.low[0])

    factors = np.geomspace(0.3, 3.0, 9).tolist()
    values = [excess(factor) for factor in factors]
    for low, high, one, other in zip(factors, factors[1:], values, values[1:], strict=False):
        if one * other < 0.0:
            return value * brentq(excess, low, high, xtol=1e-14, rtol=1e-14)
    return value


def faults(seed):
    """Values whose derivatives differ from one-sided differences of runs, and what a note says does so as well."""
    case, paths = random_chain(seed)
    path = paths[seed % len(paths)]
    number = balanced(case, path, number_at(case, path))
    scenario = load_scenario({**case, "run": case["run"] | {"sensitivities": [path]}}, [f"{path}={number!r}"])
    result, step = beamsim.run(scenario), STEP * abs(number)
    sides = {
        side: run_responses(beamsim.run(load_scenario(case, [f"{path}={number + side * step!r}"])).summary)
        for side in (-2, -1, 1, 2)
    }
    notes, found = " ".join(text for text in result.warnings if path in text), []
    grazed = "grazed" in notes or "on both sides" in notes
    for name, of in result.summary["sensitivities"].items():
        of, now = of[path], run_responses(result.summary)[name]
        for side, key in ((-1, "derivative_below"), (1, "derivative_above")):
            one, two = ((sides[k * side][name] - now) / (k * side * step) for k in (1, 2))
            difference = 2.0 * one - two  # of second order
            near = AGREEMENT * abs(difference) + SMALL * abs(now / number)
            alike, on_that_side = (abs(of[each] - difference) <= near for each in ("derivative", key))
            if not alike and not grazed and not (on_that_side and name in notes):
                found.append((seed, path, name, key, of["derivative"], of[key], difference, notes))
    return found


def number_at(case, path):
    """The number of a case at one of the paths."""
    if "gap" in path:
        return case["chain"]["snubbers"][0]["gap"]
    if "velocity" in path:
        return case["run"]["start"]["velocity"][0]
    return case["chain"]["springs" if "springs" in path else "masses"][0]


@first_apart("seed", 3, range(12))
def test_no_derivative_differs_from_one_sided_differences_of_runs_without_a_note(seed):
    assert faults(seed) == []
