"""What only large models do differently, on models for which the direct way is still short."""

import tempfile
from pathlib import Path

import pytest

from beamsim.matrix_files.formats import write_matrices
from beamsim.scenario import load_scenario
from beamsim.structures import symmetric_lu
from beamsim.structures.assembly import assemble
from beamsim.structures.modes import natural_modes
from beamsim.structures.named_matrices import write_dof_table
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
CASE = """
bodies:
  panel:
    kind: matrices
    mass: {{file: {folder}/panel.op4, name: mass}}
    stiffness: {{file: {folder}/panel.op4, name: stiff}}
    dofs: {folder}/dofs.csv
    base: {{nodes: [{base}], direction: z}}
    damping: {{kind: modal, ratio: 1 %}}
snubbers:
  - {{name: corner, at: {{body: panel, node: {node}, direction: z}}, side: below, stiffness: 50 kN/m, gap: 0.1 mm}}
excitation: {{kind: harmonic, applied_to: base, level: 2 g, frequency: 5 Hz}}
run: {{duration: 0.1 s, sample_rate: 10 kHz, convergence: 'off'}}
"""


def plate():
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "case.yaml"
        path.write_text(PLATE + "excitation: {kind: harmonic, applied_to: base, level: 2 g, frequency: 5 Hz}\n")
        return assemble(load_scenario(path))


def exported():
    return plate().named_matrices


@pytest.fixture(scope="module")
def panel(tmp_path_factory):
    """1,368 degrees of freedom, and the scenario that reads them."""
    folder = tmp_path_factory.mktemp("large")
    given = exported()
    write_matrices(folder / "panel.op4", {"mass": given.mass, "stiff": given.stiffness}, binary=True)
    write_dof_table(folder / "dofs.csv", given.table)
    nodes = [node for node, direction in given.table.dofs if direction == "z" and node not in given.base]
    (folder / "case.yaml").write_text(CASE.format(folder=folder, base=given.base[0], node=nodes[-1]))
    return given, load_scenario(folder / "case.yaml")


def test_signs_of_inaccurate_factors_count_where_no_eigenvalue_is_near_zero(panel, monkeypatch):
    model = plate()
    omega = natural_modes(model, 12).omega
    between = model.stiffness - ((omega[9] + omega[10]) / 2) ** 2 * model.mass
    at = model.stiffness - (omega[9] * (1 + 1e-15)) ** 2 * model.mass
    monkeypatch.setattr(symmetric_lu, "DENSE_COUNT", 1000)
    assert negative_eigenvalues(between) == 10
    assert negative_eigenvalues(at) is None
