"""Dashpots that act in part: limited by the spring (ElastoGap of Modelica), or on approach only."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import beamsim
from beamsim.errors import ScenarioError
from beamsim.scenario import Scenario

LAWS = {  # force in contact at a penetration and its rate
    "limited_damping": lambda x, v, k, c: k * x + np.clip(c * v, -k * x, k * x),
    "damping_on_approach": lambda x, v, k, c: k * x + c * max(v, 0.0),
}
HARMONIC = {"kind": "harmonic", "applied_to": {"mass": 1}, "level": 8.0, "frequency": 0.6}


def case(law, mass=1.0, stiffness=10.0, dashpot=1.5, gap=0.5, stop=None, **rest):
    """A mass between two equal stops."""
    damping = {"kind": "viscous", "coefficient": dashpot}
    of_pair = {"name": "stop", "mass": 1, "side": "both", "gap": gap, "stiffness": stiffness, "law": law}
    chain = {
        "masses": [mass],
        "springs": [rest.pop("spring", 0.0)],
        "snubbers": [of_pair | {"damping": damping} | (stop or {})],
    }
    run = {"duration": 1.0, "sample_rate": 1000.0, "convergence": "off"} | rest.pop("run", {})
    return Scenario.model_validate({"chain": chain, "probes": [{"name": "m", "mass": 1}], "run": run} | rest)


def released(law, position, velocity, duration, **values):
    start = {"displacement": [position], "velocity": [velocity]}
    return beamsim.run(case(law, run={"duration": duration, "start": start, "impacts": {}}, **values))


def motion_at_end(result):
    histories = result["histories"].sel(probe="m")
    return [float(histories[name].values[-1]) for name in ("displacement", "velocity")]


def independent(law, y, times, load=lambda t: 0.0, spring=0.0, k=10.0, c=1.5, gap=0.5):
    def rates(t, y):
        push = sum(-s * LAWS[law](s * y[0] - gap, s * y[1], k, c) for s in (1, -1) if s * y[0] > gap)
        return [y[1], push - spring * y[0] + load(t)]

    return solve_ivp(rates, (0.0, times[-1]), y, "DOP853", t_eval=times, rtol=1e-11, atol=1e-13, max_step=5e-3).y


def test_published_elasto_gap():
    """Reference results of Modelica's ElastoGap, exact to about 1e-5: released at 2 m between stops at 0.5 m."""
    result = released("limited_damping", 2.0, 0.0, 0.95)
    np.testing.assert_allclose(result["events"]["time"].values[-2:], [0.583372760, 0.875160380], rtol=1e-5)
    in_flight = result["histories"]["velocity"].sel(probe="m").values[700]
    assert in_flight == pytest.approx(-3.42715020688, rel=2e-6)
    assert motion_at_end(result)[0] == pytest.approx(-0.75171559, rel=2e-5)


@pytest.mark.parametrize(
    ("time", "position", "velocity"),
    [(0.0236592180, 0.558190285, -66.1964949764), (0.0853423267, -0.525468083, 52.8937156)],
)
def test_published_backlash(time, position, velocity):
    """Modelica's Backlash: where the torque vanishes in the first and in the second contact."""
    values = {"mass": 5.0, "stiffness": 2e4, "dashpot": 50.0, "gap": 0.39269908169872}
    start = {"displacement": [1.570796326794897], "velocity": [0.0]}
    run = {"duration": time, "sample_rate": 100.0 / time, "start": start}
    result = beamsim.run(case("limited_damping", run=run, **values))
    np.testing.assert_allclose(motion_at_end(result), [position, velocity], rtol=1e-4)
    force = np.abs(result["histories"]["snubber_force"].values).sum(axis=0)
    assert force[-1] < 1e-2 * force.max()
    assert force[-2] > 1e-2 * force.max()


@pytest.mark.parametrize("law", LAWS)
def test_runs_agree_with_an_independent_integration(law):
    times = np.arange(0.0, 6.0005, 1e-3)
    result = beamsim.run(
        case(law, spring=3.0, excitation=HARMONIC, run={"duration": 6.0, "start": {"velocity": [1.0]}})
    )
    expected = independent(law, [0.0, 1.0], times, lambda t: 8.0 * np.sin(1.2 * np.pi * t), 3.0)
    histories = result["histories"].sel(probe="m")
    found = np.array([histories[name].values for name in ("displacement", "velocity")])
    np.testing.assert_allclose(found, expected, atol=2e-6)
    assert abs(result.summary["energy_error"]) < 1e-12


@pytest.mark.parametrize("law", LAWS)
def test_periodic_motions_return_and_their_multipliers_are_those_of_runs(law):
    """The periodic motion returns after a period; the multipliers are those of differences of runs over a period."""
    keys = {"stiffness": 10.0, "law": law, "damping": {"kind": "viscous", "coefficient": 1.5}}
    stops = [beamsim.Contact([sign], keys, 0.5, name) for sign, name in ((1.0, "above"), (-1.0, "below"))]
    system = beamsim.System([[1.0]], [[3.0]], [[0.1]], stops, {"f": [1.0]})
    sine = {"kind": "harmonic", "level": 8.0, "frequency": 0.6}
    orbit = beamsim.periodic_motion(system, 0.6, {"f": {"kind": "harmonic", "level": 8.0}})
    start = np.array([orbit["coordinates"].values[0, 0], orbit["coordinate_velocities"].values[0, 0]])
    multipliers = orbit["floquet_multipliers_real"].values[0] + 1j * orbit["floquet_multipliers_imag"].values[0]

    def after_a_period(start):
        state = ([start[0]], [start[1]])
        run = beamsim.simulate(system, 1 / 0.6, {"f": sine}, start=state, sample_rate=1.2, convergence="off")
        return np.array([run["histories"][name].values.ravel()[-1] for name in ("displacement", "velocity")])

    np.testing.assert_allclose(after_a_period(start), start, atol=1e-9)
    step = 1e-5 * np.eye(2)
    found = np.linalg.eigvals(np.array([after_a_period(start + e) - after_a_period(start - e) for e in step]).T / 2e-5)
    np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(multipliers), atol=1e-5)


@pytest.mark.parametrize("law", LAWS)
def test_stepping_in_time_gives_the_same_motion(law):
    run = {"duration": 3.0, "start": {"velocity": [1.0]}}
    exact, stepped = (
        beamsim.run(case(law, spring=3.0, excitation=HARMONIC, run=run | {"method": method}))
        for method in ("exact", "reference")
    )
    found, expected = (result["histories"]["displacement"].values for result in (exact, stepped))
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_the_force_of_limited_damping_is_within_bounds():
    result = beamsim.run(case("limited_damping", dashpot=9.0, spring=3.0, excitation=HARMONIC, run={"duration": 4.0}))
    force = result["histories"]["snubber_force"].values
    w = result["histories"]["displacement"].sel(probe="m").values
    elastic = 10.0 * np.maximum(np.abs(w) - 0.5, 0.0)
    total = np.abs(force).sum(axis=0)
    assert np.all(total >= -1e-9)
    assert np.all(total <= 2.0 * elastic + 1e-9)
    assert total.max() > 1.2 * elastic.max()


@pytest.mark.parametrize("law", LAWS)
def test_such_a_force_does_not_press_friction(law):
    stop = {"name": "stop", "mass": 1, "side": "above", "stiffness": 10.0, "law": law}
    stop |= {"damping": {"kind": "viscous", "coefficient": 1.5}}
    friction = {"mass": 2, "normal_force": {"snubber": "stop"}, "coefficient": 0.2}
    chain = {"masses": [1.0, 1.0], "springs": [1.0, 1.0], "snubbers": [stop]}
    with pytest.raises(ScenarioError, match=f"has law: {law}, which is not available as a normal force"):
        beamsim.load_scenario({"chain": chain, "friction": [friction], "run": {"duration": 1.0}})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"damping": None}, "damping is missing"),
        ({"latch": True}, "does not go with latch"),
        ({"hardening": {"yield_force": 1.0, "stiffness": 1.0}}, "does not go with hardening"),
        ({"stiffness": None, "force_deflection": [[0.0, 0.0], [1.0, 1.0]]}, "does not go with force_deflection"),
    ],
)
@pytest.mark.parametrize("law", LAWS)
def test_other_laws_of_a_stop_do_not_go_with_these(law, changes, message):
    stop = {"name": "stop", "mass": 1, "side": "above", "stiffness": 10.0, "law": law}
    stop |= {"damping": {"kind": "viscous", "coefficient": 1.5}} | changes
    given = {key: value for key, value in stop.items() if value is not None}
    chain = {"masses": [1.0], "springs": [1.0], "snubbers": [given]}
    with pytest.raises(ScenarioError, match=message):
        beamsim.load_scenario({"chain": chain, "run": {"duration": 1.0}})
