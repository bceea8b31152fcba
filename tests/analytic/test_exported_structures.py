"""Structures that export-structure wrote, read back: the same contact run as the one that was written."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from shipped import config_path

import beamsim
from beamsim.cli.structures import write_export
from beamsim.errors import ScenarioError
from beamsim.matrix_files import read_op4, write_matrices
from beamsim.scenario import load_scenario
from beamsim.structures.named_matrices import read_dof_table, write_dof_table

CONFIGS = Path(__file__).parents[2] / "configs"
DAMPING = {"kind": "modal", "ratio": 0.01}
PANEL = {
    "kind": "plate", "length": 0.77, "width": 0.44, "thickness": 0.005, "youngs_modulus": 70e9, "poissons_ratio": 0.33,
    "density": 2700, "elements": [5, 3], "supports": {"left": "clamped"}, "damping": DAMPING,
}  # fmt: skip
BEAM = {
    "kind": "beam", "length": 0.4, "width": 0.05, "thickness": 0.005, "youngs_modulus": 70e9, "density": 2700,
    "elements": 6, "damping": DAMPING,
}  # fmt: skip
SHAKEN = {
    "excitation": {"kind": "harmonic", "applied_to": "base", "level": "3 g", "frequency": 9},
    "reduction": {"modes": 6},
    "run": {"duration": 0.5, "sample_rate": 5e3, "convergence": "off", "start": "rest"},
}


def corner(at, name, gap):
    return {"name": name, "at": at, "side": "below", "stiffness": 60e3, "gap": gap}


def plate(near, far):
    return {"snubbers": [corner(near, "near", 1e-4), corner(far, "far", 2e-4)], "probes": [{"name": "a", "at": near}]}


def hinged(joint_kind="hinge", **joint):
    """Two beams, the second upside down in nothing but its numbers, joined within the first."""
    ends = [{"body": "first", "position": 0.4}, {"body": "second", "position": 0.0}]
    return {
        "bodies": {
            "first": {**BEAM, "supports": {"left": "clamped", "right": "free"}},
            "second": {**BEAM, "thickness": 0.004, "supports": {"left": "free", "right": "free"}},
        },
        "joints": [{"name": "joint", "kind": joint_kind, "between": ends, **joint}],
    }


def at_tip(place):
    return {"snubbers": [corner(place, "tip", 1e-4)], "probes": [{"name": "tip", "at": place}]}


def read_back(folder, case, acting, modes=None, damping=DAMPING, units="SI"):
    """The exported structure with the same snubbers."""
    _, text = write_export(load_scenario(case), folder / "it.op4", modes=modes, units=units)
    body = yaml.safe_load(text)
    for section in body["bodies"].values():
        section["damping"] = damping
    path = folder / "again.yaml"
    path.write_text(yaml.safe_dump({**body, **acting, **SHAKEN}))
    return load_scenario(path)


def same_motion(known, again):
    assert known.summary["contacts"] == again.summary["contacts"]
    assert max(known.summary["contacts"].values()) > 3
    for name, force in known["histories"].by_label("snubber_force").items():
        one, other = force.values, again["histories"]["snubber_force"].sel(snubber=name).values
        assert np.abs(one).max() > 1.0
        assert np.abs(one - other).max() <= 1e-9 * np.abs(one).max()
    for name, displacement in known["histories"].by_label("displacement").items():
        one, other = displacement.values, again["histories"]["displacement"].sel(probe=name).values
        assert np.abs(one - other).max() <= 1e-9 * np.abs(one).max()


@pytest.mark.parametrize(("modes", "units"), [(None, "mm-t-s"), (10_000, "in-lbf-s")])
def test_a_plate_by_its_nodes_and_as_a_craig_bampton_model(tmp_path, modes, units):
    """With all modes of the held boundary a Craig-Bampton model is the same in other coordinates."""
    places = ({"position": [0.77, 0.0]}, {"position": [0.77, 0.44]})
    nodes = ({"body": "panel", "node": 21, "direction": "z"}, {"body": "panel", "node": 24, "direction": "z"})
    built = {"bodies": {"panel": PANEL}, **plate(*places), **SHAKEN}
    known = beamsim.run(load_scenario(built))
    same_motion(known, beamsim.run(read_back(tmp_path, built, plate(*nodes), modes, units=units)))
    table = read_dof_table(tmp_path / "it_dofs.csv")
    if modes:
        assert table.dofs[-3:] == ((21, "z"), (24, "z"), (25, "z"))  # corners and the base
        assert sum(direction == "modal" for _, direction in table.dofs) == 4 * 5 * 4 - 2
    corner_in_si = table.coordinates[table.number[24, "z"]] * {"mm-t-s": 1e-3, "in-lbf-s": 0.0254}[units]
    np.testing.assert_allclose(corner_in_si, [0.77, 0.44, 0.0], rtol=1e-15)


def test_the_shipped_craig_bampton_model_is_that_of_the_shipped_plate(tmp_path):
    """Written by ``export-structure plate_panel.yaml --modes 40``, nodes 68, 127, 135, 136 renamed."""
    written = write_export(load_scenario(config_path("plate_panel")), tmp_path / "it.op4", modes=40)[0]
    one, other = ({m.name: m.values for m in read_op4(file)} for file in (written[0], CONFIGS / "panel.op4"))
    for now, shipped in (("mass", "mxx"), ("stiff", "kxx")):
        difference = abs(abs(one[now]) - abs(other[shipped]))  # signs of modes are free
        assert difference.max() <= 1e-8 * abs(other[shipped]).max()
    tables = [read_dof_table(file) for file in (written[1], CONFIGS / "panel_dofs.csv")]
    np.testing.assert_array_equal(tables[0].coordinates, tables[1].coordinates)
    assert tables[1].dofs[-4:] == ((12, "z"), (24, "z"), (32, "z"), (3, "z"))


def test_a_boundary_between_nodes_is_refused(tmp_path):
    built = {"bodies": {"panel": PANEL}, **plate({"position": [0.7, 0.0]}, {"position": [0.77, 0.44]}), **SHAKEN}
    with pytest.raises(ScenarioError, match=r"boundary is not at a node: \(0.7, 0\) m; change the number of elements"):
        write_export(load_scenario(built), tmp_path / "it.op4", modes=5)


def test_a_boundary_that_does_not_hold_the_structure_is_refused(tmp_path):
    body = {**BEAM, "supports": {"left": "free", "right": "free"}}
    built = {"bodies": {"beam": body}, **at_tip({"position": 0.4}), **SHAKEN}
    with pytest.raises(
        ScenarioError, match="boundary does not restrain the structure: it can move without force; let more"
    ):
        write_export(load_scenario(built), tmp_path / "it.op4", modes=5)


def test_springs_to_the_ground_are_refused(tmp_path):
    built = {
        **hinged("rigid"),
        "springs_to_ground": [
            {"kind": "linear", "name": "g", "at": {"body": "second", "position": 0.4}, "stiffness": 1e3}
        ],
        **at_tip({"body": "second", "position": 0.4}),
        **SHAKEN,
    }
    with pytest.raises(ScenarioError, match="springs to the ground connect the structure to a fixed point"):
        write_export(load_scenario(built), tmp_path / "it.op4")


def test_the_order_of_bodies_and_of_imported_degrees_of_freedom_changes_nothing(tmp_path):
    """Bodies in reverse, and rows of a Craig-Bampton model in random order: the same contact run."""
    tip = {"body": "second", "position": 0.4}
    case = {**hinged("rigid"), **at_tip(tip), **SHAKEN}
    known = beamsim.run(load_scenario(case))
    bodies = dict(reversed(case["bodies"].items()))
    same_motion(known, beamsim.run(load_scenario({**case, "bodies": bodies})))
    read = read_back(tmp_path, case, at_tip({"node": 14, "direction": "z"}), 99)
    straight = beamsim.run(read)
    matrices = {each.name: each.values for each in read_op4(tmp_path / "it.op4")}
    table = read_dof_table(tmp_path / "it_dofs.csv")
    order = np.random.default_rng(1).permutation(len(table.dofs))
    write_matrices(tmp_path / "it.op4", {name: values[order][:, order] for name, values in matrices.items()})
    write_dof_table(tmp_path / "it_dofs.csv", table.part(order))
    same_motion(straight, beamsim.run(load_scenario(tmp_path / "again.yaml")))
