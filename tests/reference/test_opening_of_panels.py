"""The level that opens the preloaded snubber between two folded panels: that of the closed structure in closed form."""

from pathlib import Path

import numpy as np
import pytest
from independent import Beam
from scipy.linalg import block_diag, eigh

import beamsim
from beamsim.scenario import load_scenario

CONFIG = Path(__file__).parents[2] / "configs/two_panels_opening.yaml"
STIFFNESS, PRELOAD, STANDARD_GRAVITY = 150e3, 5.0, 9.80665


def force_for_a_unit_level(omega):
    """Amplitude of the force in the closed snubber for 1 m/s^2 of the base, N; 1 % modal damping of each panel."""
    inner = Beam(0.77, 0.44, 0.005, 70e9, 2700.0, 20, "clamped")
    outer = Beam(
        0.77, 1.0, 1.0, 12.0 * 210.0, 3.1, 20, "clamped"
    )  # of a section of 1 m by 1 m: E I and mass per length
    damping = []
    for beam in (inner, outer):
        squares, shapes = eigh(beam.K, beam.M)
        carried = beam.M @ shapes
        damping.append(carried * (0.02 * np.sqrt(squares)) @ carried.T)
    row = np.concatenate([inner.row(0.77), -outer.row(0.77)])
    mass, stiffness = block_diag(inner.M, outer.M), block_diag(inner.K, outer.K) + STIFFNESS * np.outer(row, row)
    dynamic = stiffness + 1j * omega * block_diag(*damping) - omega**2 * mass
    return STIFFNESS * abs(row @ np.linalg.solve(dynamic, -np.concatenate([inner.inertia, outer.inertia])))


@pytest.mark.slow
def test_the_snubber_opens_where_the_force_of_the_closed_structure_reaches_the_preload():
    scenario = load_scenario(
        CONFIG, ["sweep.continue_in.from=1 g", "sweep.continue_in.to=1.12 g", "reduction.modes=all"]
    )
    expected = PRELOAD / force_for_a_unit_level(2.0 * np.pi * 40.0)
    (branch,) = beamsim.continuation(scenario).branches
    assert branch.special[0].kind == "grazing"
    assert branch.special[0].parameter == pytest.approx(expected, rel=1e-6)
    largest = branch.peak_force["tip"][0]  # at 1 g: the preload and the amplitude of the closed structure
    assert largest == pytest.approx(PRELOAD + force_for_a_unit_level(2.0 * np.pi * 40.0) * STANDARD_GRAVITY, rel=1e-6)
