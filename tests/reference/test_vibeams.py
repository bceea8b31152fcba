"""VIbeams, an open experiment (doi 10.18419/darus-4501): its frequencies, and the model in joined pieces."""

from pathlib import Path

import numpy as np
import pytest

import beamsim
from beamsim.scenario import load_scenario
from beamsim.system.build import build_system
from tests.helpers.branches import events_of, peaks_of

CONFIG = Path(__file__).parents[2] / "configs/continuation/vibeams.yaml"
MEASURED = {"left": [30.95, 199.04, 556.82, 1085.93], "right": [28.2, 205.54, 277.74, 594.98, 1168.62]}
COMPUTED = {"left": [30.9444, 202.07, 560.66, 1090.50], "right": [28.401, 208.87, 273.86, 588.79, 1124.3]}
"""Hz: of the rig, and of the same idealisation by an Euler-Bernoulli code of others."""


def frequencies(system):
    """Natural frequencies of each of the two structures without contact, Hz."""
    modes = system.modes
    left = next(part.stations for part in system.stations.bodies if part.body == "left")
    on_left = np.abs(modes["shapes"].values[:, left]).max(axis=1)
    is_left = on_left > 1e-6 * np.abs(modes["shapes"].values).max(axis=1)
    return {
        "left": modes["open_frequencies_hz"].values[is_left],
        "right": modes["open_frequencies_hz"].values[~is_left],
    }


def test_frequencies_are_those_of_an_independent_code_and_near_those_measured():
    found = frequencies(build_system(load_scenario(CONFIG, ["bodies.left.elements=80", "bodies.right.elements=80"])))
    for name in COMPUTED:
        ours = found[name][: len(COMPUTED[name])]
        np.testing.assert_allclose(ours, COMPUTED[name], rtol=3e-5)
        np.testing.assert_allclose(ours, MEASURED[name], rtol=0.04)
    assert found["left"][0] == pytest.approx(30.95, rel=2e-4)
    assert found["right"][0] == pytest.approx(28.2, rel=7.5e-3)


def test_folds_and_peaks_do_not_depend_on_mesh_and_modes():
    """As `docs/vibeams.md` states them; at the highest level with twice the elements and 24 instead of 12 modes too."""
    finer = [f"bodies.{name}.elements={count}" for name, count in (("left", 40), ("right", 40), ("leaf", 12))]
    results = [
        beamsim.continuation(load_scenario(CONFIG, overrides))
        for overrides in ([], [*finer, "reduction.modes=24", "sweep.levels=[0.0305 m/s^2]"])
    ]
    folds, peaks = (
        [[each(result, number, branch) for number, branch in enumerate(result.branches)] for result in results]
        for each in (
            lambda result, number, _: [point.parameter for point in events_of(result, number) if point.kind == "fold"],
            lambda _, number, branch: [1e3 * np.nanmax(peaks_of(branch, "right"))],
        )
    )
    assert [len(of_level) for of_level in folds[0]] == [0, 2, 2]
    for coarse, fine in zip((folds[0][-1], peaks[0][-1]), (*folds[1], *peaks[1]), strict=True):
        np.testing.assert_allclose(coarse, fine, rtol=0, atol=2e-4)
    np.testing.assert_allclose([of_level[0] for of_level in folds[0][1:]], [28.597, 28.654], atol=6e-4)
    np.testing.assert_allclose(np.ravel(peaks[0]), [0.1508, 0.2031, 0.2147], atol=1e-4)
