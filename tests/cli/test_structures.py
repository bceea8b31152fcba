"""The commands `check` and `export-structure`."""

import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.io import mmread, mmwrite
from shipped import CONFIGS

from tests.helpers.commands import invoke

pytestmark = pytest.mark.quick

CASE = """
bodies:
  panel: {kind: beam, length: 0.5, width: 50 mm, thickness: 5 mm, youngs_modulus: 70 GPa, density: 2700, elements: 8,
          supports: {left: clamped, right: free}}
probes: [{name: tip, at: {body: panel, position: 0.5}}]
"""
IMPORTED = "probes: [{name: tip, at: {body: panel, node: 9, direction: z}}]\n"


@pytest.fixture
def case(tmp_path):
    path = tmp_path / "case.yaml"
    path.write_text(CASE)
    return path


def rows(path):
    outcome = invoke("check", path, "--json")
    return outcome.exit_code, json.loads(outcome.stdout)


@pytest.mark.parametrize("ending", ["op4", "mat", "mtx", "npz"])
def test_what_is_exported_is_read_and_checks_alike(tmp_path, case, ending):
    outcome = invoke("export-structure", case, "-o", tmp_path / f"panel.{ending}", "--json")
    assert outcome.exit_code == 0, outcome.output
    written = json.loads(outcome.stdout)
    assert all(Path(file).exists() for file in written["files"])
    assert written["body"].endswith("# panel 0.5 m: {node: 9, direction: z}")
    (tmp_path / "again.yaml").write_text(written["body"] + "\n" + IMPORTED)
    code, known = rows(case)
    again_code, again = rows(tmp_path / "again.yaml")
    assert code == again_code == 0
    for name in ("fixed_frequencies_hz", "effective_masses"):
        one, other = (each["bodies"]["panel"][name]["value"] for each in (known, again))
        assert other == pytest.approx(one, rel=1e-7)


def test_nastran_files_without_the_package_for_them_end_with_2_and_say_what_to_install(tmp_path, case, monkeypatch):
    for name in ("matrices_op4.yaml", "panel.op4", "panel_dofs.csv"):
        shutil.copy(CONFIGS / name, tmp_path)
    monkeypatch.setitem(sys.modules, "pyyeti", None)
    monkeypatch.setitem(sys.modules, "pyyeti.nastran", None)
    outcome = invoke("validate", tmp_path / "matrices_op4.yaml")
    assert outcome.exit_code == 2
    message = " ".join(outcome.output.split())
    assert "matrices_op4.yaml:8: bodies.panel.mass.file is one of Nastran" in message
    assert "pip install 'beamsim[nastran]'" in message
    outcome = invoke("export-structure", case, "-o", tmp_path / "written.op4")
    assert outcome.exit_code == 2
    assert "pip install 'beamsim[nastran]'" in " ".join(outcome.output.split())
    assert not (tmp_path / "written.op4").exists()


def test_mass_centre_and_inertia_of_a_strip(case):
    mass = 2700 * 0.5 * 0.05 * 0.005
    values = rows(case)[1]["bodies"]["panel"]
    assert values["mass"]["value"]["z"] == pytest.approx(mass, rel=1e-12)
    assert values["fixed_frequencies_hz"]["value"][0] == pytest.approx(
        1.8751040687**2 / (2 * 3.14159265359 * 0.25) * (70e9 * 0.005**2 / 12 / 2700) ** 0.5, rel=1e-4
    )
    assert values["centre_of_mass"]["verdict"] == values["inertia"]["verdict"] == "note"
    assert invoke("check", case).output.count("about: supports hold ry, and elements next to them bend") == 2
    case.write_text(CASE.replace("left: clamped", "left: free"))
    values = rows(case)[1]["bodies"]["panel"]
    assert values["centre_of_mass"]["verdict"] == values["inertia"]["verdict"] == "ok"
    assert values["centre_of_mass"]["value"]["x"] == pytest.approx(0.25, rel=1e-9)
    assert values["inertia"]["value"]["ry"] == pytest.approx(mass * 0.5**2 / 12, rel=1e-9)
    assert values["free_frequencies_hz"]["value"][:2] == [0.0, 0.0]


def test_a_grounded_model_fails_with_exit_code_3(tmp_path, case):
    case.write_text(CASE.replace("left: clamped", "left: free"))
    written = json.loads(invoke("export-structure", case, "-o", tmp_path / "panel.mtx", "--json").stdout)
    (tmp_path / "again.yaml").write_text(written["body"] + "\n" + IMPORTED)
    assert rows(tmp_path / "again.yaml")[0] == 0
    stiffness = mmread(tmp_path / "panel_stiff.mtx", spmatrix=False).toarray()
    stiffness[4, 4] += 1e-3 * np.abs(stiffness).max()  # a spring to the ground at node 3
    mmwrite(tmp_path / "panel_stiff.mtx", stiffness, precision=17)
    code, found = rows(tmp_path / "again.yaml")
    assert (code, found["failed"]) == (3, ["grounding"])
    assert "at node 3 z" in invoke("check", tmp_path / "again.yaml").stdout


def test_an_unknown_body_is_named(case, tmp_path):
    outcome = invoke("export-structure", case, "--body", "pannel", "-o", tmp_path)
    assert outcome.exit_code == 2
    assert "did you mean panel?" in outcome.stderr


def test_a_format_that_is_only_read_is_refused(case, tmp_path):
    outcome = invoke("export-structure", case, "-o", tmp_path / "panel.pch")
    assert outcome.exit_code == 2
    assert "panel.pch has a format that can only be read; give a name that ends with .op4," in outcome.stderr
    assert list(tmp_path.iterdir()) == [case]
