"""Pictures of bodies in space: the view, what is drawn where, and one way for frames and imported bodies."""

import numpy as np
import pytest
from shipped import config_path

import beamsim
from beamsim.analyses.run.animation import frames_of_run
from beamsim.plots.animation import scene_of
from beamsim.plots.bodies import body_figures, stops_of
from beamsim.plots.model import model_figure
from beamsim.plots.sketch import Sketch
from beamsim.plots.space import SpaceView, flat
from beamsim.plots.statics import static_figures, stops_at_rest
from beamsim.structures.places import Stations
from beamsim.system.build import build_system

PORTAL = {
    "bodies": {"portal": {
        "kind": "frame",
        "nodes": {"a": [0, 0, 0], "b": [0, 0, 1], "c": [2, 0, 1], "d": [2, 0, 0]},
        "sections": {"s": {"section": {"kind": "rectangle", "width": 0.05, "thickness": 0.03},
                           "youngs_modulus": 210e9, "density": 7850}},
        "members": {"left": {"nodes": ["a", "b"]}, "top": {"nodes": ["b", "c"]}, "right": {"nodes": ["c", "d"]}},
        "supports": {"a": "clamped", "d": "pinned"},
        "point_masses": [{"node": "b", "mass": 2.0}, {"member": "top", "position": "50 %", "mass": 3.0}],
    }},
    "gravity": 9.81,
    "snubbers": [{"name": "stop", "at": {"member": "top", "position": "50 %", "direction": "z"}, "side": "below",
                  "gap": 1e-4, "stiffness": 1e6}],
    "probes": [{"name": "corner", "at": {"node": "c", "direction": "x"}}],
}  # fmt: skip


@pytest.fixture(scope="module")
def portal():
    result = beamsim.static(PORTAL)
    return result, SpaceView.of(result.scenario, Stations.of_modes(result["modes"]), stops_at_rest(result))


def points_drawn(ax, label):
    return np.vstack([np.transpose(line.get_data()) for line in ax.lines if line.get_label() == label])


def test_the_view_has_one_scale_for_all_axes():
    """Lengths in the plane of the picture are kept: the projection is orthogonal."""
    screen = flat(np.eye(3))
    np.testing.assert_allclose(screen.T @ screen, np.eye(2), atol=1e-12)
    assert screen[2, 0] == pytest.approx(0.0)  # z is upright


def test_supports_and_masses_are_where_the_nodes_are(portal):
    system = build_system(portal[0].scenario)
    sketch = Sketch(system.scenario, system.stations, {stop.name: stop for stop in system.snubbers})
    ax = model_figure(sketch).figure().axes[0]
    np.testing.assert_allclose(points_drawn(ax, "clamped"), flat(np.array([[0.0, 0, 0]])), atol=1e-12)
    np.testing.assert_allclose(points_drawn(ax, "pinned"), flat(np.array([[2.0, 0, 0]])), atol=1e-12)
    np.testing.assert_allclose(points_drawn(ax, "mass"), flat(np.array([[0.0, 0, 1], [1, 0, 1]])), atol=1e-12)
    labels = " ".join(ax.get_legend_handles_labels()[1])
    assert "mass 3 kg" in labels
    assert "stop: 1 MN/m, gap 0.1 mm" in labels
    assert ax.get_aspect() == 1.0


def test_the_face_of_a_pressed_stop_is_at_the_deflected_member(portal):
    result, view = portal
    assert result.summary["touching"] == {"stop": True}
    (picture,) = static_figures(result).values()
    ax = picture.figure().axes[0]
    face = points_drawn(ax, "stop in contact").mean(axis=0)
    shape = result["equilibrium"]["deflection_in_space"].values
    factor = 0.12 * 2.0 / np.linalg.norm(shape, axis=1).max()
    middle = int(np.linalg.norm(view.points - [1.0, 0, 1], axis=1).argmin())
    np.testing.assert_allclose(face, flat(view.points[middle] + factor * shape[middle]), atol=1e-9)
    assert shape[middle, 2] == pytest.approx(-1e-4 - result.summary["static_force_n"]["stop"] / 1e6, rel=1e-6)


@pytest.mark.parametrize("name", ["pipe_two_elbows", "imported_panel"])
def test_frames_and_imported_bodies_have_the_same_pictures(name):
    short = {"run.duration": 0.06, "run.convergence": "off", "excitation.level": "60 g"}
    result = beamsim.run(beamsim.load_scenario(config_path(name), short))
    figures = body_figures(result)
    assert list(figures) == ["space_modes", "space_contact"]
    assert len(figures["space_modes"].figure().axes) == 6
    modes = result["modes"]
    np.testing.assert_allclose(modes["shapes_in_space"].sel(direction="z").values, modes["shapes"].values, atol=1e-12)


def test_bodies_without_coordinates_keep_their_sketch():
    system = build_system(beamsim.load_scenario(config_path("two_panels")))
    stops = {stop.name: stop for stop in system.snubbers}
    assert SpaceView.of(system.scenario, system.stations, stops) is None
    ax = model_figure(Sketch(system.scenario, system.stations, stops)).figure().axes[0]
    assert ax.get_xlabel() == "x (m)"


def test_an_animation_moves_along_all_axes_to_one_scale():
    """Points of the drawn lines move by the displacements of the motion as they are seen."""
    short = {"run.duration": 0.02, "run.convergence": "off"}
    result = beamsim.run(beamsim.load_scenario(config_path("pipe_two_elbows"), short))
    frames = frames_of_run(result)
    sketch = Sketch(result.scenario, Stations.of_modes(result["modes"]), stops_of(result))
    scene = scene_of(frames, sketch, "")
    seen = np.stack([scene.shifts, scene.heights], axis=2)
    factor = np.abs(seen).max() / np.abs(flat(frames.in_space)).max()
    np.testing.assert_allclose(seen, factor * flat(frames.in_space), atol=1e-9)
    np.testing.assert_allclose(frames.in_space[:, :, 2], frames.deflection, atol=1e-12)
    left, right, low, high = scene.limits
    assert (high - low) / (right - left) == pytest.approx((1.3 + 1.9 * scene.count) / 8.0)
    assert [stop.name for stop in scene.stops] == ["stop"]
