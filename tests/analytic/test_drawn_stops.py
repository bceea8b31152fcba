"""Where animations draw the face of a stop: crushed, recovering, latched, on a moving base, between two masses."""

import numpy as np
import pytest

import beamsim
from beamsim.analyses.run.animation import frames_of_run
from beamsim.plots.animation import scene_of
from beamsim.plots.bodies import stops_of
from beamsim.plots.sketch import Sketch
from beamsim.scenario import load_scenario
from beamsim.structures.places import Stations

MASS, THROWN, STIFF, LOADED = 2.0, 0.6, 2e5, 5e4
GAP = 1e-3


def drawn(scenario):
    """A run, its frames and their drawing, and heights in the drawing over deflections in m."""
    result = beamsim.run(load_scenario(scenario))
    frames = frames_of_run(result)
    scene = scene_of(frames, Sketch(result.scenario, Stations.of_modes(result["modes"]), stops_of(result)), "case")
    return result, frames, scene, float(np.abs(scene.heights).max() / np.abs(frames.deflection).max())


def thrown(stop, side=-1.0, duration=0.05):
    """A free mass that is thrown at a stop."""
    name = "below" if side < 0.0 else "above"
    snubber = {"name": "s", "mass": 1, "side": name, "gap": GAP, **stop}
    return {
        "chain": {"masses": [MASS], "springs": [0.0], "snubbers": [snubber]}, "probes": [{"name": "m", "mass": 1}],
        "run": {"duration": duration, "sample_rate": 2e4, "convergence": "off", "start": {"velocity": [side * THROWN]}},
    }  # fmt: skip


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_crushed_face_is_drawn_where_it_was_left(side):
    """Loaded along 50 kN/m and unloaded along 200 kN/m, it keeps three quarters of its largest deflection."""
    pad = {"force_deflection": [[0.0, 0.0], [1e-2, 1e-2 * LOADED]], "unloading": {"stiffness": STIFF}}
    _, frames, scene, scale = drawn(thrown(pad, side))
    residual = THROWN * np.sqrt(MASS / LOADED) * (1.0 - LOADED / STIFF)
    body = side * frames.deflection[:, 0]  # towards the stop
    after = frames.time > frames.time[frames.force["s"].argmax()]
    free = frames.force["s"] == 0.0
    assert np.sum(free & ~after) > 10
    assert np.sum(free & after) > 10
    expected = np.where(free, GAP + np.where(after, residual, 0.0), body)
    (stop,) = scene.stops
    np.testing.assert_allclose(side * stop.face / scale, expected, atol=1e-12)
    assert side * stop.mounting_row > (side * stop.face).max()
    low, high = scene.limits[2:]
    assert low < stop.face.min() <= stop.face.max() < high


def test_a_latch_that_pulls_is_drawn_at_the_body():
    """A mass latches and swings at the stop, which pulls it for half of the time."""
    _, frames, scene, scale = drawn(thrown({"stiffness": 1e4, "latch": True}, duration=0.12))
    force, body = frames.force["s"], frames.deflection[:, 0]
    (stop,) = scene.stops
    assert force.min() == pytest.approx(-THROWN * np.sqrt(MASS * 1e4), rel=1e-2)
    held = force != 0.0
    np.testing.assert_allclose(stop.face[held] / scale, body[held], atol=1e-12)
    np.testing.assert_allclose(force[held], 1e4 * (-GAP - body[held]), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(stop.face[~held] / scale, -GAP, atol=1e-12)


def test_a_stop_on_the_ground_is_drawn_where_the_ground_is():
    """Deflections are those relative to the base, against which the ground moves."""
    case = {
        "chain": {"masses": [1.0], "springs": [1e5, 0.0], "damping": {"kind": "modal", "ratio": 0.05},
                  "snubbers": [{"name": "s", "mass": 1, "side": "below", "gap": 5e-3, "stiffness": 1e5,
                                "mounted_on": "ground"}]},
        "probes": [{"name": "m", "mass": 1}],
        "excitation": {"kind": "harmonic", "applied_to": "base", "level": 10.0, "frequency": 6.0},
        "run": {"duration": 1.0, "sample_rate": 2e4, "convergence": "off"},
    }  # fmt: skip
    result, frames, scene, scale = drawn(case)
    base = np.interp(
        frames.time, result["histories"]["time"].values, result["histories"]["base_displacement"].values[0]
    )
    assert np.ptp(base) > 5e-3
    free = frames.force["s"] == 0.0
    np.testing.assert_allclose((scene.stops[0].face / scale + base)[free], -5e-3, atol=1e-7)


@pytest.mark.parametrize("kind", ["approach", "separation"])
def test_what_acts_between_two_masses(kind):
    """Openings follow from the distance of the masses, of which one is thrown at the other or away from it."""
    way = 1.0 if kind == "approach" else -1.0
    case = {
        "chain": {"masses": [1.0, 1.0], "springs": [1e3, 0.0, 1e3], "damping": {"kind": "modal", "ratio": 0.02},
                  "snubbers": [{"name": "s", "between": [1, 2], "resists": kind, "gap": 1e-3, "stiffness": 1e4}]},
        "probes": [{"name": "m", "mass": 1}],
        "run": {"duration": 0.5, "convergence": "off", "start": {"velocity": [way * 0.3, 0.0]}},
    }  # fmt: skip
    _, frames, scene, scale = drawn(case)
    distance = way * (frames.ends["s"][:, 1] - frames.ends["s"][:, 0])
    np.testing.assert_allclose(frames.opening["s"], np.maximum(1e-3 + distance, 0.0), atol=1e-12)
    assert frames.force["s"].max() > 1.0
    (stop,) = scene.stops
    at_first = frames.ends["s"][:, 0] + (frames.opening["s"] if kind == "approach" else 0.0)
    np.testing.assert_allclose((stop.face - stop.y[0]) / scale, at_first, atol=1e-9)
