"""Imported matrices with dashpots to the ground: right where the base is at rest, refused where it moves."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.sparse import csc_array

import beamsim
from beamsim.matrix_files import write_matrices

MASS = np.diag([1.0, 2.0])
HELD = np.array([[1500.0, -500.0], [-500.0, 500.0]])  # 1 kN/m to the ground
LOOSE = np.array([[500.0, -500.0], [-500.0, 500.0]])
DAMPING = np.array([[7.0, -2.0], [-2.0, 9.0]])  # 5 and 7 N s/m to the ground
HZ, FORCE = 3.0, 4.0


def scenario(folder, stiffness, damping, excitation, more=""):
    write_matrices(folder / "m.op4", {"mxx": csc_array(MASS), "kxx": csc_array(stiffness), "bxx": csc_array(damping)})
    (folder / "dofs.csv").write_text("node,direction\n1,z\n2,z\n")
    (folder / "case.yaml").write_text(f"""
bodies:
  panel:
    kind: matrices
    mass: {{file: m.op4, name: mxx}}
    stiffness: {{file: m.op4, name: kxx}}
    viscous: {{file: m.op4, name: bxx}}
    dofs: dofs.csv
    base: free
probes:
  - {{name: one, at: {{node: 1, direction: z}}}}
  - {{name: two, at: {{node: 2, direction: z}}}}
excitation: {excitation}
reduction: {{modes: all}}
{more}
run: {{duration: 2 s, sample_rate: 1 kHz, convergence: off, start: rest}}
""")
    return folder / "case.yaml"


def forced(stiffness, damping, time):
    """Displacements (2, nt) from rest under a sine at the second node, by the exponential of the augmented matrix."""
    inverse, omega = np.linalg.inv(MASS), 2 * np.pi * HZ
    a = np.zeros((6, 6))
    a[:2, 2:4] = np.eye(2)
    a[2:4, :2], a[2:4, 2:4] = -inverse @ stiffness, -inverse @ damping
    a[2:4, 4] = inverse @ [0.0, FORCE]
    a[4, 5], a[5, 4] = omega, -omega  # sine and cosine
    return np.array([(expm(a * t) @ [0, 0, 0, 0, 0, 1.0])[:2] for t in time]).T


@pytest.mark.parametrize("stiffness", [HELD, LOOSE], ids=["held", "loose"])
def test_a_free_body_with_dashpots_to_the_ground(stiffness, tmp_path):
    force = f"{{kind: harmonic, applied_to: {{node: 2, direction: z}}, level: {FORCE} N, frequency: {HZ} Hz}}"
    result = beamsim.run(scenario(tmp_path, stiffness, DAMPING, force))
    assert result.complete
    at = slice(None, None, 100)
    expected = forced(stiffness, DAMPING, result["histories"]["time"].values[at])
    found = result["histories"]["displacement"].values[:, at]
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())
    assert result.summary["energy_error"] < 1e-9


def test_a_base_that_moves_is_refused_with_the_reason(tmp_path):
    base = "{kind: harmonic, applied_to: base, direction: z, level: 1 g, frequency: 3 Hz}"
    with pytest.raises(beamsim.ScenarioError) as caught:
        beamsim.run(scenario(tmp_path, HELD, DAMPING, base))
    assert "excitation.direction = z: viscous damps a rigid motion of the base: dashpots go to something" in str(
        caught.value
    )
    assert "load it by forces, so that the base is at rest" in str(caught.value)
    between = DAMPING - np.diag([5.0, 7.0])
    assert beamsim.run(scenario(tmp_path, HELD, between, base)).complete  # twin: dashpots between the nodes alone
