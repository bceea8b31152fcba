"""Imported bodies are drawn at the coordinates of their nodes, with edges of the elements that the stiffness shows."""

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from scipy.io import mmwrite
from scipy.sparse import csc_array

import beamsim
from beamsim.analyses.run.animation import frames_of_run
from beamsim.plots.model import model_figure
from beamsim.plots.sketch import Sketch
from beamsim.plots.space import flat
from beamsim.store.results import load, write_result
from beamsim.structures.places import Stations
from beamsim.system.build import build_system

GRID = np.array([(x, y, 0.0) for y in (0.0, 0.3, 0.6) for x in (0.0, 0.5, 1.0)])  # of 2 x 2 elements
EDGES = {(a, b) for a in range(9) for b in range(a, 9) if np.abs(GRID[a] - GRID[b]).sum() in (0.5, 0.3)}


def stiffness():
    """Every element couples all of its four nodes; the ground holds each a little."""
    k = 1e3 * np.eye(9)
    for corner in (0, 1, 3, 4):
        nodes = np.array([corner, corner + 1, corner + 3, corner + 4])
        k[np.ix_(nodes, nodes)] += 1e4 * (4.0 * np.eye(4) - 1.0)
    return k


def case(folder, k, *, coordinates=True):
    mmwrite(folder / "k.mtx", csc_array(k))
    mmwrite(folder / "m.mtx", csc_array(0.1 * np.eye(9)))
    places = [f"{n + 1},z,{','.join(map(str, GRID[n]))}" if coordinates else f"{n + 1},z" for n in range(9)]
    (folder / "dofs.csv").write_text("\n".join(["node,direction,x,y,z" if coordinates else "node,direction", *places]))
    files = {name: {"file": str(folder / f"{letter}.mtx")} for name, letter in (("mass", "m"), ("stiffness", "k"))}
    corner = {"at": {"body": "panel", "node": 9, "direction": "z"}}
    return beamsim.load_scenario({
        "bodies": {"panel": {"kind": "matrices", **files, "dofs": str(folder / "dofs.csv"), "base": "free",
                             "damping": {"kind": "modal", "ratio": 0.02}}},
        "snubbers": [{"name": "corner", **corner, "side": "below", "stiffness": 1e5, "gap": 1e-5}],
        "probes": [{"name": "corner", **corner}],
        "excitation": {"kind": "harmonic", "applied_to": corner["at"], "level": "1 N", "frequency": 10.0},
        "run": {"duration": 0.2, "sample_rate": 2000.0, "convergence": "off"},
    })  # fmt: skip


def test_edges_of_elements_are_drawn_without_diagonals(tmp_path):
    stations = build_system(case(tmp_path, stiffness())).stations
    np.testing.assert_allclose(stations.points, GRID)
    assert set(map(tuple, stations.lines.tolist())) == EDGES


def test_a_condensed_matrix_shows_points_alone(tmp_path):
    stations = build_system(case(tmp_path, stiffness() + 10.0)).stations
    assert stations.lines is None
    np.testing.assert_allclose(stations.points, GRID)


def test_the_sketch_has_nodes_where_they_are(tmp_path):
    scenario = case(tmp_path, stiffness())
    system = build_system(scenario)
    figure = model_figure(Sketch(scenario, system.stations, {stop.name: stop for stop in system.snubbers})).figure()
    (nodes,) = [line.get_xydata() for line in figure.axes[0].lines if line.get_xdata().size == 9]
    np.testing.assert_allclose(nodes, flat(np.array(GRID)), atol=1e-12)
    corners = nodes.reshape(3, 3, 2)
    assert corners[1, 0, 1] > corners[0, 0, 1]  # y is towards the back
    (drawn,) = [each for each in figure.axes[0].collections if isinstance(each, LineCollection)]
    assert len(drawn.get_segments()) == len(EDGES)


def test_animations_move_nodes_with_their_edges(tmp_path):
    result = beamsim.run(case(tmp_path, stiffness()))
    frames = frames_of_run(result)
    assert {tuple(line.stations) for line in frames.lines} == EDGES
    ends = [number for line in frames.lines for number in line.stations]
    expected = np.interp(
        frames.time, result["histories"]["time"].values, result["histories"]["displacement"].sel(probe="corner").values
    )
    drawn = frames.deflection[:, [k for k, number in enumerate(ends) if number == 8]]
    np.testing.assert_allclose(drawn, expected[:, None] * np.ones(drawn.shape[1]), atol=2e-2 * np.abs(expected).max())
    stored = load(write_result(result, tmp_path / "run.h5"))
    np.testing.assert_array_equal(Stations.of_modes(stored["modes"]).lines, Stations.of_modes(result["modes"]).lines)


def test_nodes_without_coordinates_stay_in_a_row(tmp_path):
    stations = build_system(case(tmp_path, stiffness(), coordinates=False)).stations
    assert stations.points is None
    assert stations.lines is None


@pytest.mark.parametrize("coordinates", [True, False])
def test_both_have_an_animation(tmp_path, coordinates):
    frames = frames_of_run(beamsim.run(case(tmp_path, stiffness(), coordinates=coordinates)))
    assert len(frames.lines) == (len(EDGES) if coordinates else 1)
