"""Result files, exports and continuation of a scenario with several bodies."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import loadmat

import beamsim
from beamsim.scenario import load_scenario

EXAMPLE = Path(__file__).parents[1] / "data/examples/two_panels.yaml"
STOPS = """
- {name: between, between: [{body: inner, position: 770 mm}, {body: outer, position: 770 mm}], resists: approach,
   stiffness: 150 kN/m, gap: 5 mm}
- {name: base, at: {body: inner, position: 700 mm}, side: below, stiffness: 50 kN/m, gap: 0.2 mm}
"""
CHANGES = [f"snubbers={STOPS}"]
BODIES = {"snubbers/between": "inner, outer", "snubbers/base": "inner", "probes/inner_tip": "inner",
          "probes/outer_tip": "outer"}  # fmt: skip


def files(folder):
    """A run and a continuation in the position of a stop of one of two panels."""
    path = "{kind: continuation, longest_period: 1, continue_in: {kind: position, snubber: base, from: 0.7, to: 0.77}}"
    drive = "{kind: harmonic, applied_to: base, level: 0.3 g, frequency: 12 Hz}"
    case = load_scenario(EXAMPLE, [*CHANGES, "run.duration=0.05", f"excitation={drive}", f"sweep={path}"])
    run, curve = beamsim.run(case), beamsim.frequency_response(case)
    beamsim.write_run(run, folder / "run.h5")
    beamsim.write_frequency_response(curve, folder / "curve.h5")
    return curve


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("files")
    return folder, files(folder)


@pytest.mark.slow
def test_a_stop_moves_along_one_of_two_bodies(written):
    _, curve = written
    (branch,) = curve.branches
    assert curve.complete
    assert branch.parameter[[0, -1]] == pytest.approx([0.7, 0.77])
    assert branch.residual.max() < 1e-11
    assert branch.parameter.size < 60  # small steps would mean that Newton's method does not converge


@pytest.mark.slow
def test_the_last_motion_is_that_of_a_stop_built_there(written):
    _, curve = written
    (branch,) = curve.branches
    path = (
        "{kind: continuation, longest_period: 1, continue_in: {kind: gap, snubber: base, from: 0.2 mm, to: 0.201 mm}}"
    )
    drive = "{kind: harmonic, applied_to: base, level: 0.3 g, frequency: 12 Hz}"
    there = load_scenario(
        EXAMPLE,
        [*CHANGES, f"excitation={drive}", f"sweep={path}", "snubbers[1].at.position=0.77"],
    )
    other = beamsim.frequency_response(there).branches[0]
    for probe in ("inner_tip", "outer_tip"):
        assert branch.peak_displacement[probe][-1] == pytest.approx(other.peak_displacement[probe][0], rel=1e-3)


@pytest.mark.slow
def test_groups_name_their_bodies(written):
    folder, _ = written
    with h5py.File(folder / "run.h5") as run, h5py.File(folder / "curve.h5") as curve:
        for path, body in BODIES.items():
            assert run[path].attrs["body"] == body
            assert curve[f"branches/0/{path}"].attrs["body"] == body


def test_one_body_is_not_named(fabricated_run, tmp_path):
    beamsim.write_run(fabricated_run(), tmp_path / "run.h5")
    with h5py.File(tmp_path / "run.h5") as run:
        assert all("body" not in group.attrs for group in run["probes"].values())


@pytest.mark.parametrize("name", ["run", "curve"])
def test_exports(written, name, tmp_path):
    folder, curve = written
    source = folder / f"{name}.h5"
    tables = beamsim.export_result(source, tmp_path / "csv", "csv")
    assert len(tables) > 5
    (mat,) = beamsim.export_result(source, tmp_path / "case.mat", "mat")
    data = loadmat(mat, simplify_cells=True)
    (uff,) = beamsim.export_result(source, tmp_path / "case.uff", "uff")
    pyuff = pytest.importorskip("pyuff")
    file = pyuff.UFF(str(uff))
    nodes = next(s for s in (file.read_sets(k) for k in range(file.get_n_sets())) if s["type"] == 15)
    np.testing.assert_allclose(nodes["x"][:4], [0.77, 0.77, 0.77, 0.7])
    if name == "curve":
        stored = data["branches"]["x0"]["probes"]["outer_tip"]["peak_displacement"]
        np.testing.assert_array_equal(stored, curve.branches[0].peak_displacement["outer_tip"])
        attributes = next(path for path in tables if path.name == "attributes.csv").read_text()
        assert "inner, outer" in attributes
