"""What only large models do differently, on models for which the direct way is still short."""

import tempfile
from pathlib import Path

import pytest

from beamsim.scenario import load_scenario
from beamsim.structures import symmetric_lu
from beamsim.structures.assembly import assemble
from beamsim.structures.modes import natural_modes
from beamsim.structures.symmetric_lu import negative_eigenvalues

pytestmark = pytest.mark.quick

PLATE = """
bodies:
  panel:
    kind: plate
    length: 0.8
    width: 0.7
    thickness: 4 mm
    youngs_modulus: 70 GPa
    poissons_ratio: 0.33
    density: 2700
    elements: [18, 18]
    supports: {left: clamped}
    damping: {kind: modal, ratio: 1 %}
"""


def plate():
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "case.yaml"
        path.write_text(PLATE + "excitation: {kind: harmonic, applied_to: base, level: 2 g, frequency: 5 Hz}\n")
        return assemble(load_scenario(path))


def test_signs_of_inaccurate_factors_count_where_no_eigenvalue_is_near_zero(monkeypatch):
    model = plate()
    omega = natural_modes(model, 12).omega
    between = model.stiffness - ((omega[9] + omega[10]) / 2) ** 2 * model.mass
    at = model.stiffness - (omega[9] * (1 + 1e-15)) ** 2 * model.mass
    monkeypatch.setattr(symmetric_lu, "DENSE_COUNT", 1000)
    assert negative_eigenvalues(between) == 10
    assert negative_eigenvalues(at) is None
