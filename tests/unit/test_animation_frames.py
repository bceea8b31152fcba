"""Frames of an animation: the motion of the run, the true shape functions, slow around contact."""

import numpy as np
import pytest

import beamsim
from beamsim.analyses.run.animation import frames_of_run
from beamsim.plots.animation import scene_of
from beamsim.plots.bodies import stops_of
from beamsim.plots.sketch import Sketch
from beamsim.responses.frames import FRAMES
from beamsim.scenario import load_scenario
from beamsim.structures.places import Stations

CASE = {
    "beam": {"length": 0.27, "width": 0.05, "thickness": 0.005, "youngs_modulus": 69e9, "density": 2700.0,
             "elements": 4, "damping": {"kind": "modal", "ratio": 0.02}},
    "snubbers": [{"name": "tip", "position": 0.27, "side": "below", "stiffness": 1.5e5, "gap": 1e-5}],
    "excitation": {"kind": "harmonic", "applied_to": "base", "level": 20.0, "frequency": 45.0},
    "probes": [{"name": "tip", "position": 0.27}, {"name": "between", "position": 0.1}],
    "run": {"duration": 0.2, "sample_rate": 50000.0, "convergence": "off"},
}  # fmt: skip


@pytest.fixture(scope="module")
def result():
    return beamsim.run(load_scenario(CASE))


def test_frames_are_the_motion_of_the_run(result):
    frames = frames_of_run(result)
    assert frames.time.size == FRAMES
    assert np.all(np.diff(frames.time) >= 0.0)
    (line,) = frames.lines
    for name, at in (("tip", 0.27), ("between", 0.1)):
        expected = np.interp(
            frames.time, result["histories"]["time"].values, result["histories"]["displacement"].sel(probe=name).values
        )
        column = np.array([np.interp(at, line.x, shape) for shape in frames.deflection])
        # the probe between two nodes: to what a chord between the drawn points leaves
        np.testing.assert_allclose(column, expected, atol=2e-4 * np.abs(expected).max())
    np.testing.assert_allclose(frames.ends["tip"][:, 0], frames.deflection[:, -1], rtol=1e-12)


def test_contact_is_slow_and_its_peak_is_shown(result):
    frames = frames_of_run(result)
    assert frames.force["tip"].max() == pytest.approx(result.summary["peak_force_n"]["tip"], rel=1e-4)
    steps = np.diff(frames.time)
    both = frames.in_slow_motion[1:] & frames.in_slow_motion[:-1]
    neither = ~frames.in_slow_motion[1:] & ~frames.in_slow_motion[:-1]
    assert both.any()
    assert np.median(steps[neither]) == pytest.approx(6.0 * np.median(steps[both]), rel=0.05)
    closed = frames.force["tip"] > 0.0
    assert frames.in_slow_motion[closed].mean() > 0.9


def test_a_stop_that_presses_is_drawn_at_the_body(result):
    frames = frames_of_run(result)
    scene = scene_of(frames, Sketch(result.scenario, Stations.of_modes(result["modes"]), stops_of(result)), "case")
    (stop,) = scene.stops
    scale = np.abs(scene.heights).max() / np.abs(frames.deflection).max()
    assert stop.force.max() > 1.0
    expected = np.minimum(-1e-5, frames.ends["tip"][:, 0]) * scale  # a gap below the body at rest, or at the body
    np.testing.assert_allclose(stop.face, expected, atol=1e-9 * scale)


@pytest.mark.parametrize(("fast_hz", "missed"), [(10.0, False), (600.0, True)])
def test_what_is_too_fast_for_the_frames_is_named(fast_hz, missed):
    """Two equal masses swing by 1 mm at 5 Hz and by 1 mm at 2 or 120 times that, with 53 frames a period of 5 Hz."""
    outer = (10.0 * np.pi) ** 2
    springs = [outer, 0.5 * ((2.0 * np.pi * fast_hz) ** 2 - outer), outer]
    run = {"duration": 1.0, "sample_rate": 1e4, "convergence": "off", "start": {"displacement": [2e-3, 0.0]}}
    case = {"chain": {"masses": [1.0, 1.0], "springs": springs}, "probes": [{"name": "m", "mass": 1}], "run": run}
    result = beamsim.run(load_scenario(case))
    frames = frames_of_run(result)
    scene = scene_of(frames, Sketch(result.scenario, Stations.of_modes(result["modes"]), stops_of(result)), "case")
    assert ("too fast for these frames" in scene.title) == missed
    if missed:  # two cycles of it and more lie between two frames
        assert 0.3 < frames.difference_between < 1.5
    else:
        assert frames.difference_between < 1e-3


PIPE = {
    "beam": {"length": 0.9, "width": 0.03, "thickness": 0.004, "youngs_modulus": 70e9, "density": 2700.0, "elements": 5,
             "supports": {"left": "pinned", "right": "pinned"}, "damping": {"kind": "modal", "ratio": 0.02}},
    "excitation": {"kind": "forces", "forces": [
        {"kind": "harmonic", "applied_to": {"support": "left"}, "level": "1 mm", "frequency": 0.05},
        {"kind": "harmonic", "applied_to": {"support": "right"}, "level": "0.6 mm", "frequency": 0.05, "phase": 1.2},
    ]},
    "probes": [{"name": "middle", "position": 0.45}],
    "run": {"duration": 20.0, "sample_rate": 40.0, "convergence": "off", "start": "rest"},
}  # fmt: skip


@pytest.fixture(scope="module")
def pipe():
    """So slow that the beam stays straight between its two supports."""
    return beamsim.run(load_scenario(PIPE))


def ends_of_pipe(time):
    """(nt, 2) m, the motion of both supports."""
    return np.stack([1e-3 * np.sin(0.1 * np.pi * time), 6e-4 * np.sin(0.1 * np.pi * time + 1.2)], axis=-1)


def test_supports_that_move_are_drawn_where_they_are(pipe):
    body = pipe["bodies"]
    left, right = ends_of_pipe(body["extreme_time"].values).T
    straight = left[:, None] + (right - left)[:, None] * body["position"].values / 0.9
    np.testing.assert_allclose(body["extreme_shape"], straight, atol=2e-6)
    frames = frames_of_run(pipe)
    (line,) = frames.lines
    left, right = ends_of_pipe(frames.time).T
    straight = left[:, None] + (right - left)[:, None] * line.x / 0.9  # at places within elements, too
    np.testing.assert_allclose(frames.deflection, straight, atol=2e-6)


def test_the_animation_moves_the_supports(pipe):
    frames = frames_of_run(pipe)
    scene = scene_of(frames, Sketch(pipe.scenario, Stations.of_modes(pipe["modes"]), stops_of(pipe)), "case")
    scale = scene.heights.max() / frames.deflection.max()
    moved = np.stack([scene.heights[:, point] for _, point in scene.supports], axis=1)
    np.testing.assert_allclose(moved, scale * ends_of_pipe(frames.time), atol=1e-9 * scale)


def test_a_contact_is_drawn_with_the_supports_where_they_are():
    bodies = {
        "pipe": {"kind": "beam", **PIPE["beam"]},
        "wall": {"kind": "beam", **PIPE["beam"], "supports": {"left": "clamped", "right": "clamped"}},
    }
    stop = {"name": "stop", "between": [{"body": "wall", "position": 0.45},
            {"body": "pipe", "position": 0.45}], "stiffness": 1e4, "gap": 1e-4}  # fmt: skip
    forces = [{**each, "applied_to": {**each["applied_to"], "body": "pipe"}} for each in PIPE["excitation"]["forces"]]
    case = {"bodies": bodies, "snubbers": [stop], "excitation": {"kind": "forces", "forces": forces},
            "probes": [{"name": "middle", "at": {"body": "pipe", "position": 0.45}}], "run": PIPE["run"]}  # fmt: skip
    result = beamsim.run(load_scenario(case))
    shape = result["contact"]["deflection"].values
    part = next(each.stations for each in Stations.of_modes(result["modes"]).bodies if each.body == "pipe")
    assert shape[part][[0, -1]] == pytest.approx(ends_of_pipe(result["contact"]["time"].values), abs=1e-9)
