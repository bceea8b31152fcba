"""Newton's method that is compiled finds what the same method in Python finds, in as many steps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import beamsim
from beamsim.analyses.response.paths import response_model
from beamsim.flow.passage import Frequency, NotFinite
from beamsim.flow.stopping import Stopped, heeding
from beamsim.orbits.compiled_newton import NotCompiled, compiled_newton
from beamsim.orbits.continuation import Settings, newton
from beamsim.orbits.shooting import ForcedOrbits, find_orbit

CONFIG = Path(__file__).parents[2] / "configs" / "one_sided_65hz.yaml"
SETTINGS = Settings(iterations=15)


def problem_of(parameter: str, hz: float, **changes: object) -> ForcedOrbits:
    """Of the README's case at a frequency."""
    scenario = beamsim.load_scenario(
        CONFIG, {"sweep": {"kind": "continuation", "from": 20.0, "to": 400.0}, "reduction.modes": 3, **changes}
    )
    model = response_model(scenario)
    orbits = model.orbits(model.levels[0])
    orbits.flow.set(2 * np.pi * hz, model.levels[0])
    return ForcedOrbits(orbits.flow, parameter)  # type: ignore[arg-type]


def corrected(problem: ForcedOrbits, method: object, moved: float) -> object:
    """Both methods from the same guess, beside a motion."""
    point = find_orbit(problem)
    assert point is not None
    scale = point.scale
    row = np.zeros(scale.size)
    row[-1] = 1.0
    guess = point.u * (1.0 + moved * np.sin(np.arange(scale.size)))
    return method(guess, row, float(guess[-1] / scale[-1]), scale, SETTINGS, np.inf)  # type: ignore[operator]


@pytest.mark.parametrize("ground", [False, True], ids=["stop on the base", "stop on the ground"])
@pytest.mark.parametrize("parameter", ["frequency", "level"])
@pytest.mark.parametrize("moved", [1e-6, 1e-3, 0.3])
def test_it_finds_what_the_method_in_python_finds(parameter: str, ground: bool, moved: float) -> None:
    changes = {"snubbers.tip.mounted_on": "ground"} if ground else {}
    compiled, python = problem_of(parameter, 65.0, **changes), problem_of(parameter, 65.0, **changes)
    a = corrected(compiled, compiled.newton, moved)
    b = corrected(python, lambda *arguments: newton(python, *arguments), moved)
    assert (a is None) == (b is None)
    if a is None:
        return
    assert a.iterations == b.iterations
    np.testing.assert_allclose(a.u, b.u, rtol=1e-11, atol=1e-13 * np.abs(b.u[:-1]).max())
    np.testing.assert_allclose(a.jacobian, b.jacobian, rtol=1e-7, atol=1e-7)
    assert a.data.signature == b.data.signature
    assert a.data.duration == pytest.approx(b.data.duration, rel=1e-14)
    for name in ("start", "end", "transition", "parameters", "slope", "time", "length", "y", "event_time"):
        value = getattr(b.data, name)
        np.testing.assert_allclose(getattr(a.data, name), value, rtol=1e-8, atol=1e-8 * np.abs(value).max(initial=0.0))
    assert compiled.flow.omega == pytest.approx(python.flow.omega, rel=1e-14)


def test_a_step_costs_one_passage_and_the_flow_is_left_where_the_method_ends():
    problem = problem_of("frequency", 65.0)
    point = find_orbit(problem)
    before = problem.flow.passages
    row = np.zeros(point.u.size)
    row[-1] = 1.0
    moved = point.u.copy()
    moved[-1] *= 1.0001
    found = problem.newton(moved, row, float(moved[-1] / point.scale[-1]), point.scale, SETTINGS, np.inf)
    assert found.iterations >= 1
    assert problem.flow.passages == before + found.iterations + 1
    assert problem.flow.omega == found.u[-1]
    again = problem.flow.carry(found.u[:-1], found.data.duration)
    np.testing.assert_allclose(again.end, found.data.end, rtol=0, atol=1e-14 * np.abs(found.u[:-1]).max())


def test_light_damping_is_left_to_python():
    problem = problem_of("frequency", 65.0, **{"beam.damping": {"kind": "modal", "ratio": 1e-7}})
    row = np.zeros(problem.flow.size + 1)
    row[-1] = 1.0
    guess = np.append(np.zeros(problem.flow.size), problem.flow.omega)
    scale, _ = problem.scale(guess)
    arguments = (guess, row, 1.0, scale, SETTINGS)
    with pytest.raises(NotCompiled):
        compiled_newton(problem.flow, Frequency(), problem.omega, problem.level, 1, 1e-6, *arguments)
    own, python = problem.newton(*arguments, np.inf), newton(problem, *arguments)
    assert (own is None) == (python is None)


def test_loads_that_are_not_finite_are_left_to_python_which_says_so():
    problem = problem_of("frequency", 65.0)
    guess = np.append(np.zeros(problem.flow.size), problem.flow.omega)
    scale, row = problem.scale(guess)[0], np.eye(guess.size)[-1]
    with pytest.raises(NotCompiled):
        compiled_newton(problem.flow, Frequency(), problem.omega, np.nan, 1, 1e-6, guess, row, 1.0, scale, SETTINGS)
    problem.level = np.nan
    with pytest.raises(NotFinite):
        problem.residual(guess)
    assert problem.newton(guess, row, 1.0, scale, SETTINGS, np.inf) is None


def test_a_request_to_stop_ends_it():
    problem = problem_of("frequency", 65.0)
    row = np.zeros(problem.flow.size + 1)
    row[-1] = 1.0
    guess = np.append(np.zeros(problem.flow.size), problem.flow.omega)
    with heeding(lambda: True), pytest.raises(Stopped):
        problem.newton(guess, row, 1.0, problem.scale(guess)[0], SETTINGS, np.inf)
