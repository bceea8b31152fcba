"""Result files, exports and continuation of a scenario with several bodies."""

from pathlib import Path

import h5py
import pytest

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


DRIVE = "excitation={kind: harmonic, applied_to: base, level: 0.3 g, frequency: 12 Hz}"


@pytest.fixture(scope="module")
def run_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("files") / "run.h5"
    beamsim.write_result(beamsim.run(load_scenario(EXAMPLE, [*CHANGES, "run.duration=0.05", DRIVE])), path)
    return path


@pytest.fixture(scope="module")
def curve(tmp_path_factory):
    """A continuation in the position of a stop of one of two panels, and its file."""
    path = "{kind: continuation, longest_period: 1, continue_in: {kind: position, snubber: base, from: 0.75, to: 0.77}}"
    result = beamsim.continuation(load_scenario(EXAMPLE, [*CHANGES, DRIVE, f"sweep={path}"]))
    file = tmp_path_factory.mktemp("files") / "curve.h5"
    beamsim.write_result(result, file)
    return result, file


@pytest.mark.slow
def test_a_stop_moves_along_one_of_two_bodies(curve):
    (branch,) = curve[0].branches
    assert curve[0].complete
    assert branch.parameter[[0, -1]] == pytest.approx([0.75, 0.77])
    assert branch.residual.max() < 1e-11
    assert branch.parameter.size < 60  # small steps would mean that Newton's method does not converge


@pytest.mark.slow
def test_groups_name_their_bodies(run_file, curve):
    with h5py.File(run_file) as run, h5py.File(curve[1]) as branches:
        for path, body in BODIES.items():
            assert run[path].attrs["body"] == body
            assert branches[f"branches/0/{path}"].attrs["body"] == body
