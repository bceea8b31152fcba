"""Stops whose crushing force follows a curve that rises and falls: areas by hand, and a clipped spring."""

import numpy as np
import pytest

import beamsim
from beamsim.errors import ScenarioError

STIFF = 4e5
CURVE = [[0.0, 0.0], [1e-3, 200.0], [4e-3, 80.0], [9e-3, 140.0], [12e-3, 140.0]]


def case(run, stop=None, mass=2.0, **more):
    foam = {"name": "tube", "mass": 1, "side": "below", "force_deflection": CURVE, "unloading": {"stiffness": STIFF}}
    chain = {"masses": [mass], "springs": [0.0], "snubbers": [foam | (stop or {})]}
    run = {"sample_rate": 1e5, "convergence": "off", **run}
    return beamsim.load_scenario({"chain": chain, "probes": [{"name": "m", "mass": 1}], "run": run} | more)


@pytest.mark.parametrize("depth", [0.5e-3, 2.5e-3, 6e-3, 14e-3])
def test_one_impact_by_hand(depth):
    """The energy is the area under the curve up to the depth; the elastic part of the force there is returned."""
    x, force = np.array(CURVE).T
    at = np.union1d(x[x < depth], [depth])
    energy = np.trapezoid(np.interp(at, x, force), at)
    end = np.interp(depth, x, force)
    thrown = {"displacement": [0.0], "velocity": [-np.sqrt(energy)]}  # 2 kg
    result = beamsim.run(case({"duration": 0.1, "start": thrown, "impacts": {}}))
    assert result.summary["min_displacement_m"]["m"] == pytest.approx(-depth, rel=1e-9)
    assert result.summary["peak_force_n"]["tube"] == pytest.approx(np.interp(at, x, force).max(), rel=1e-9)
    assert result.summary["residual_crush_m"]["tube"] == pytest.approx(depth - end / STIFF, rel=1e-9)
    speed = result["histories"]["velocity"].sel(probe="m").values[-1]
    assert speed == pytest.approx(np.sqrt(end**2 / STIFF / 2.0), rel=1e-9)
    assert result.summary["impacts"]["tube"]["mean_energy_lost_j"] == pytest.approx(
        energy - end**2 / STIFF / 2, rel=1e-9
    )
    assert abs(result.summary["energy_error"]) < 1e-12


def test_repeated_loading_is_a_clipped_spring_on_the_same_path():
    drive = {"kind": "harmonic", "applied_to": {"mass": 1}, "level": 60.0, "frequency": 9.0}
    start = {"displacement": [0.0], "velocity": [-0.6]}
    result = beamsim.run(case({"duration": 0.3, "start": start}, excitation=drive, gravity=10.0))
    delta = -result["histories"]["displacement"].sel(probe="m").values
    found = result["histories"]["snubber_force"].values.ravel()
    x, force = np.array(CURVE).T
    face, expected = 0.0, []
    for position in delta:
        most = np.interp(max(position, 0.0), x, force)
        face = max(face, position - most / STIFF)
        expected.append(max(STIFF * (position - face), 0.0))
    assert delta.max() > 4e-3
    np.testing.assert_allclose(found, expected, atol=0.02)
    assert abs(result.summary["energy_error"]) < 1e-10


def test_stepping_a_beam_in_time_gives_the_same_motion():
    """The beam is softer than the stop while it is crushed: a mode grows there."""
    stop = {
        "name": "tube",
        "position": 0.5,
        "side": "below",
        "force_deflection": CURVE,
        "unloading": {"stiffness": STIFF},
    }
    beam = {"length": 0.5, "bending_stiffness": 60.0, "mass_per_length": 2.0, "supports": {"left": "clamped"}}
    found = []
    for method in ("exact", "reference"):
        run = {"duration": 0.02, "sample_rate": 2e4, "convergence": "off", "method": method}
        run["start"] = {"displacement": [0.0, 0.0, 0.0], "velocity": [0.0, 0.0, -24.0]}
        case_ = {"beam": beam | {"damping": {"kind": "modal", "ratio": 0.01}}, "snubbers": [stop]}
        case_ |= {"reduction": {"modes": 4}, "probes": [{"name": "tip", "position": 0.5}], "run": run}
        found.append(beamsim.run(beamsim.load_scenario(case_)))
    exact, stepped = (result["histories"]["displacement"].values.ravel() for result in found)
    assert -exact.min() > 4e-3
    np.testing.assert_allclose(exact, stepped, atol=1e-7)
    assert abs(found[0].summary["energy_error"]) < 1e-10


@pytest.mark.parametrize(
    ("stop", "message"),
    [
        ({"unloading": {"stiffness": STIFF, "force_deflection": [[0.0, 0.0], [1e-2, 10.0]]}}, "needs unloading"),
        ({"force_deflection": CURVE[:3]}, "add a last point with the same force"),
        ({"force_deflection": [*CURVE[:3], [5e-3, 0.0], [6e-3, 0.0]]}, "give the force that remains, above zero"),
        ({"force_deflection": {"points": CURVE[:3]}}, "add a last point with the same force"),
    ],
)
def test_curves_that_fall_for_ever_are_refused(stop, message):
    with pytest.raises(ScenarioError) as error:
        case({"duration": 0.1}, stop)
    assert message in str(error.value)


def test_a_falling_curve_needs_a_stop_that_stays_crushed(tmp_path):
    stop = {"name": "tube", "mass": 1, "side": "below", "force_deflection": {"points": CURVE}}
    chain = {"masses": [2.0], "springs": [1.0], "snubbers": [stop]}
    with pytest.raises(ScenarioError, match="falls below"):
        beamsim.load_scenario({"chain": chain, "run": {"duration": 0.1}})
    file = tmp_path / "tube.csv"
    file.write_text("way (m),force (N)\n" + "\n".join(f"{x},{y}" for x, y in CURVE))
    chain["snubbers"] = [stop | {"force_deflection": str(file)}]
    with pytest.raises(ScenarioError, match="forces that fall"):
        beamsim.run(beamsim.load_scenario({"chain": chain, "run": {"duration": 0.1}}))
