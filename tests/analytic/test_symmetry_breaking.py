"""Motions that are never at rest: where they leave in closed form, and what an independent integrator says of them."""

from dataclasses import replace
from itertools import count

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar
from shipped import config_path

from beamsim.analyses.nnm.analysis import conservative_system, nnm
from beamsim.analyses.nnm.full_period import follow_full_period, over_full_period
from beamsim.analyses.nnm.paths import mode_path
from beamsim.orbits.backbone import Backbone
from beamsim.orbits.continuation import Settings, solve_at
from beamsim.orbits.free_orbits import BrakeOrbits, linear_mode
from beamsim.orbits.spring_families import SpringFamily
from beamsim.outcomes import stop_requests
from beamsim.scenario import load_scenario
from tests.helpers.branches import events_of, of_kind

CUBIC = {
    "title": "Two masses on cubic springs",
    "chain": {
        "masses": [1, 1],
        "springs": [1, 1.7, 1],
        "springs_to_ground": [
            {"mass": 1, "kind": "cubic", "stiffness": 0.5},
            {"mass": 2, "kind": "cubic", "stiffness": 0.5},
        ],
    },
    "nnm": {"mode": 1, "method": "full_period", "continue_in": {"kind": "energy", "from": 0.3, "to": 1}},
}


@pytest.fixture(scope="module")
def cubic():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("beamsim.analyses.nnm.paths.POINTS", 20)
        return nnm(load_scenario(CUBIC))


@pytest.fixture(scope="module")
def stops(request):
    return nnm(load_scenario(config_path("nnm_never_at_rest")))


def test_where_they_leave_in_closed_form(cubic):
    """In phase x'' + x + x^3 / 2 = 0, x = a cn. Across, y'' + (4.4 + 1.5 x^2) y = 0, Lamé's equation of order 2.

    The kick that reaches the same place after half a period is its solution sn cn, of eigenvalue 4 + k^2: with
    W^2 = 1 + a^2 / 2 and k^2 W^2 = a^2 / 4 this is 4.4 = 4 + 0.75 a^2, so a^2 = 8/15, E = a^2 + a^4 / 4 = 136/225.
    """
    breaking = [e for e in events_of(cubic) if e.kind == "symmetry_breaking"]
    assert len(breaking) == 1
    assert breaking[0].parameter == pytest.approx(136 / 225, rel=1e-10)


def test_an_interruption_ends_the_search_for_where_they_leave():
    near = {"kind": "energy", "from": 0.5, "to": 0.7}  # about 136 / 225
    scenario = load_scenario({**CUBIC, "nnm": {**CUBIC["nnm"], "continue_in": near}})
    job = mode_path(conservative_system(scenario))
    followed, asked = job.follow(None), count()
    points = len(followed.backbone.points)
    # once after every point over the whole period, once before the search, and after its first step
    with stop_requests(lambda: next(asked) > points):
        found = follow_full_period(job, followed, scenario.nnm.method)
    assert found.backbone.outcome.complete
    assert len(found.backbone.points) == points
    assert found.symmetry_breakings == ()


def test_a_branch_point_in_closed_form(monkeypatch):
    """Out of phase x'' + 1.2 x + x^3 = 0, x = a cn; in phase y'' + (1 + 3 x^2) y = 0, Lamé's equation of order 2.

    Its solution cn dn, at rest where x is, has the eigenvalue 1 + k^2: with W^2 = 1.2 + a^2 and k^2 W^2 = a^2 / 2 this
    is 1 + 3 a^2 = W^2 + a^2 / 2, so a^2 = 2/15, E = 1.2 a^2 + a^4 / 2 = 38/225.
    """
    monkeypatch.setattr("beamsim.analyses.nnm.paths.POINTS", 20)
    case = {
        "chain": {
            "masses": [1, 1],
            "springs": [1, 0.1, 1],
            "springs_to_ground": [{"mass": k, "kind": "cubic", "stiffness": 1} for k in (1, 2)],
        },
        "nnm": {"mode": 2, "continue_in": {"kind": "energy", "from": 0.01, "to": 1}},
    }
    (point,) = events_of(nnm(load_scenario(case)))
    assert point.kind == "branch_point"
    assert point.parameter == pytest.approx(38 / 225, rel=1e-10)


def test_a_fold_in_frequency():
    """A mass pressed onto a stop, another at a distance: it softens, then hardens. The lowest frequency is a fold.

    Closed about x = 0.75 with w = 2 below x = 1, open with w = 1, against the other stop about x = 5/3 with w^2 = 6
    beyond x = 2, where the speed is v.
    """
    stops = [
        {"name": "below", "mass": 1, "side": "below", "stiffness": 3, "gap": -1},
        {"name": "above", "mass": 1, "side": "above", "stiffness": 5, "gap": 2},
    ]
    chain = {"masses": [1], "springs": [1], "snubbers": stops}
    path = {"kind": "frequency", "from": 0.31, "to": 0.2}
    result = nnm(load_scenario({"chain": chain, "nnm": {"mode": 1, "continue_in": path}}))
    (fold,) = (e for e in events_of(result) if e.kind == "fold")

    def frequency(v):
        below, reach = np.sqrt(v**2 + 3), np.sqrt(v**2 + 4)
        closed = (np.pi - np.arctan2(below / 2, 0.25)) / 2
        opened = np.arccos(1 / reach) - np.arccos(2 / reach)
        return 0.5 / (closed + opened + np.arctan2(v / np.sqrt(6), 1 / 3) / np.sqrt(6))

    lowest = minimize_scalar(frequency, bounds=(0, 2), method="bounded", options={"xatol": 1e-9})
    assert fold.frequency_hz == pytest.approx(lowest.fun, rel=1e-9)


def integrated(result, branch, k, kick=0.0):
    """State of the masses after a period by an eighth-order Runge-Kutta method, from a point of a branch."""
    shapes = result["modes"]["shapes"].values.T
    y0 = np.concatenate([shapes @ branch["coordinates"].values[k], shapes @ branch["coordinate_velocities"].values[k]])
    y0[-1] += kick

    def slope(t, y):
        x, v = y[:2], y[2:]
        stop = np.maximum(np.abs(x) - 1.0, 0.0) * np.sign(x)
        return [*v, -x[0] - 1.7 * (x[0] - x[1]) - stop[0], -x[1] - 1.7 * (x[1] - x[0]) - stop[1]]

    period = 1.0 / branch["frequency_hz"].values[k]
    done = solve_ivp(slope, (0, period), y0, method="DOP853", rtol=1e-12, atol=1e-13, max_step=0.01, dense_output=True)
    return y0, done.y[:, -1], done


def test_two_masses_between_stops_are_never_at_rest(stops):
    """Closed after a period, and moving all along, for an integrator that knows nothing of contacts."""
    assert len(of_kind(stops, "non_brake")) >= 1
    for branch in of_kind(stops, "non_brake"):
        assert (branch["mode"].item(), branch["ratio"].item()) == (2, 2)
        assert branch["residual"].values.max() < 1e-10
        k = int(np.argmax(branch["least_kinetic"].values))
        y0, end, done = integrated(stops, branch, k)
        np.testing.assert_allclose(end, y0, atol=1e-8)
        y = done.sol(np.linspace(0, done.t[-1], 4001))
        kinetic = 0.5 * (y[2:] ** 2).sum(axis=0) / branch["energy"].values[k]
        assert kinetic.min() == pytest.approx(branch["least_kinetic"].values[k], abs=1e-6)
        assert kinetic.min() > 0.2
        assert branch["least_kinetic"].values.min() < 0.02  # it leaves, and comes back to, motions at rest
        assert branch["outcome"].item() == "back_to_brake_orbits"


def test_the_integrator_would_see_a_motion_that_is_not_periodic(stops):
    branch = of_kind(stops, "non_brake")[0]
    y0, end, _ = integrated(stops, branch, int(np.argmax(branch["least_kinetic"].values)), kick=1e-3)
    assert np.abs(end - y0).max() > 1e-4


def test_full_period_shooting_would_see_a_wrong_half_period(make_system):
    """Points put off by 1e-4 are not what shooting over the period finds beside them, and the path says so."""
    system = make_system([1.0, 1.7], [0.0, 0.0], shape=[[0.8, 0.6]], stiffness=1.0)
    orbits = BrakeOrbits(SpringFamily(system), energy=1.0)
    start = solve_at(orbits, linear_mode(orbits, 0, 0.0, np.array([0.8, 0.6])), Settings(), 0.0)
    points = list(Backbone(orbits, start, 0.2, 0, points=10))
    right = over_full_period(orbits, points)
    assert len(right.points) == len(points)
    assert right.outcome.complete
    off = np.append(np.full(3, 1.0 + 1e-4), 1.0)  # shape and period, at the same factor
    wrong = over_full_period(orbits, [replace(p, u=p.u * off) for p in points])
    assert not wrong.points
    assert wrong.outcome.code == "full_period_diverged"
