"""Sketches of assemblies, and pictures of plates: what is where."""

import numpy as np
import pytest

import beamsim
from beamsim.plots.bodies import body_figures, stops_of
from beamsim.plots.drawing import save_figures
from beamsim.plots.run import run_figures
from beamsim.scenario import load_scenario
from beamsim.store.results import load, write_result
from beamsim.structures.places import Stations

BEAM = {"kind": "beam", "width": 0.05, "thickness": 0.008, "youngs_modulus": 70e9, "density": 2700.0, "elements": 6}
PLATE = {"kind": "plate", "length": 0.5, "width": 0.3, "thickness": 0.003, "youngs_modulus": 70e9,
         "poissons_ratio": 0.3, "density": 2700.0, "elements": [4, 4], "supports": {"left": "clamped"}}  # fmt: skip
SHAKEN = {
    "excitation": {"kind": "harmonic", "applied_to": "base", "level": 30.0, "frequency": 25.0},
    "run": {"duration": 0.1, "sample_rate": 2000.0, "convergence": "off"},
}


def plate_of(x, y):
    return {"body": "plate", "position": [x, y]}


@pytest.fixture(scope="module")
def result():
    case = {
        **SHAKEN,
        "bodies": {
            "arm": {**BEAM, "length": 0.3, "point_masses": [{"position": 0.1, "mass": 0.1}]},
            "tip": {**BEAM, "length": 0.5, "supports": {"left": "free", "right": "free"}},
            "plate": PLATE,
        },
        "joints": [{"name": "h", "kind": "hinge", "rotational_stiffness": 50.0,
                    "between": [{"body": "arm", "position": 0.3}, {"body": "tip", "position": 0.0}]}],
        "snubbers": [
            {"name": "end", "at": {"body": "tip", "position": 0.5}, "side": "both", "stiffness": 1e5, "gap": 1e-3},
            {"name": "link", "between": [{"body": "tip", "position": 0.2}, plate_of(0.5, 0.0)],
             "resists": "approach", "stiffness": 1e4, "gap": 2e-3},
        ],
        "probes": [{"name": "tip", "at": {"body": "tip", "position": 0.5}}],
    }  # fmt: skip
    return beamsim.run(load_scenario(case))


def line(ax, label, number=0):
    return [each for each in ax.lines if each.get_label() == label][number].get_xydata()


def test_instant_of_the_largest_contact_force(result, tmp_path):
    contact, peaks = result["contact"], result.summary["peak_force_n"]
    name = contact.labels("snubber")[contact["contact_snubber"].item()]
    force, shape, at = contact["force"].item(), contact["deflection"].values, stops_of(result)[name]
    assert force == peaks[name] == max(peaks.values())
    stations = Stations.of_modes(result["modes"])
    place = next(part for part in stations.bodies if part.body == "tip").stations
    end = shape[place][stations.position[place].argmax()]
    penetration = {"below": -at.gap - end, "above": end - at.gap}[at.side]
    assert at.stiffness * penetration == pytest.approx(force, rel=1e-6)
    write_result(result, tmp_path / "r.h5")
    np.testing.assert_array_equal(load(tmp_path / "r.h5")["contact"]["deflection"], shape)


def test_sketch_puts_bodies_joints_and_stops_in_place(result):
    ax = body_figures(result)["assembly_contact"].figure().axes[0]
    # the tip begins where the arm ends, with the hinge between them; the plate is a row above
    hinge = line(ax, "hinge joint")[0]
    arm, tip, *edges = (each.get_xydata() for each in ax.lines if each.get_zorder() == 3)
    assert len(edges) == 2
    np.testing.assert_allclose(arm[-1], hinge, atol=1e-9)
    np.testing.assert_allclose(tip[0], hinge, atol=1e-9)
    assert tip[-1, 0] == pytest.approx(0.8)
    assert edges[0][0, 1] == pytest.approx(1.0)
    np.testing.assert_allclose(line(ax, "clamped")[0], [0.0, 0.0], atol=1e-12)
    assert line(ax, "mass")[0, 0] == pytest.approx(0.1)
    # stops have the scale of the deflection, and their side
    shape, stations = result["contact"]["deflection"].values, Stations.of_modes(result["modes"])
    place = next(part for part in stations.bodies if part.body == "tip").stations
    factor = tip[-1, 1] / shape[place][-1]
    faces = sorted(
        each.get_xydata()[0, 1] for each in ax.lines
        if str(each.get_label()).startswith("stop") and each.get_xydata()[0, 0] == pytest.approx(0.8)
    )  # fmt: skip
    pressed = min(-1e-3 * factor, tip[-1, 1])  # one in contact is where the body is
    np.testing.assert_allclose(faces, [pressed, 1e-3 * factor], rtol=1e-9)
    assert any(each.get_label() == "stop in contact" for each in ax.lines)


def test_single_bodies_have_no_sketch():
    one = beamsim.run(
        load_scenario({**SHAKEN, "beam": {k: v for k, v in BEAM.items() if k != "kind"} | {"length": 0.3}})
    )
    assert set(body_figures(one)) == {"deflected_shapes"}
    assert "contact" not in one.datasets


def test_plate_pictures_fill_their_figure_and_name_the_snubbers():
    snubbers = [
        {"name": name, "at": {"position": [0.5, y]}, "side": side, "stiffness": 1e4, "gap": 1e-4}
        for name, y, side in (("a", 0.0, "below"), ("b", 0.3, "above"))
    ]
    case = {**SHAKEN, "bodies": {"plate": PLATE}, "snubbers": snubbers, "gravity": 9.81}
    figure = body_figures(beamsim.run(load_scenario(case)))["plate_deflections"].figure()
    figure.canvas.draw()
    panels = [ax for ax in figure.axes if ax.get_title(loc="left")]
    assert len(panels) == 3
    assert min(ax.get_position().x0 for ax in panels) < 0.15
    assert max(ax.get_position().x1 for ax in panels) > 0.8
    texts = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert texts == ["snubber below", "snubber above"]
    straight = body_figures(beamsim.run(load_scenario({**case, "gravity": 0.0})))["plate_deflections"]
    assert len(straight.panels) == 2  # nothing bends it at rest


def test_a_body_with_nodes_alone_has_its_pictures(tmp_path):
    (tmp_path / "dofs.csv").write_text("node,direction\n1,z\n2,z\n3,z\n")
    np.savez(tmp_path / "m.npz", mass=np.diag([1.0, 1.0, 0.5]),
             stiffness=1e4 * np.array([[1.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]]))  # fmt: skip
    case = {
        "excitation": SHAKEN["excitation"], "run": SHAKEN["run"],
        "bodies": {"m": {"kind": "matrices", "mass": {"file": str(tmp_path / "m.npz"), "name": "mass"},
                         "stiffness": {"file": str(tmp_path / "m.npz"), "name": "stiffness"},
                         "dofs": str(tmp_path / "dofs.csv"), "base": {"nodes": [1], "direction": "z"}}},
        "probes": [{"name": "end", "at": {"node": 3}}],
    }  # fmt: skip
    result = beamsim.run(load_scenario(case))
    assert Stations.of_modes(result["modes"]).bodies[0].body == "m"
    files = save_figures(run_figures(result), tmp_path, "m")
    assert {path.name for path in files} >= {"m_displacement.png", "m_spectrum.png"}
