"""Exports: what other programs find in the files."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import beamsim
from beamsim.analyses.compare_modes.analysis import compare_modes
from beamsim.errors import ResultFileError
from beamsim.scenario import load_scenario
from beamsim.store.export import export_result
from beamsim.store.results import write_result
from beamsim.store.shapes import read_shapes
from beamsim.store.uff import Source, record_55, write_uff
from tests.helpers.commands import invoke

CONFIGS = Path(__file__).parents[2] / "configs"


def export_run(result, target, form):
    return export_result(write_result(result, target.parent / "run.h5"), target, form)


def test_uff_is_read_back_by_pyuff(fabricated_run, tmp_path):
    pyuff = pytest.importorskip("pyuff")
    stops = [
        {"name": name, "position": x, "side": side, "stiffness": 151100.0}
        for name, x, side in (("stop", 0.27, "below"), ("top", 0.135, "above"))
    ]
    probes = [{"name": "tip", "position": 0.27}, {"name": "middle", "position": 0.135}]
    scenario = load_scenario(CONFIGS / "one_sided_65hz.yaml", {"snubbers": stops, "probes": probes})
    result = fabricated_run(snubbers=("stop", "top"), rate=9_000.0)  # an increment of 1/9000 s needs more than 6 digits
    result = dataclasses.replace(result, scenario=scenario)
    (path,) = export_run(result, tmp_path / "case.uff", "uff")
    file = pyuff.UFF(str(path))
    kinds = file.get_set_types().tolist()
    assert kinds[:3] == [164, 151, 15]
    assert set(kinds[3:]) <= {58, 55, 82}
    units, _, nodes, *others = file.read_sets()
    functions = [each for each in others if each["type"] == 58]
    assert (units["length"], units["force"]) == (1.0, 1.0)
    assert nodes["x"][:5] == pytest.approx([0.27, 0.135, 0.27, 0.135, 0.0])

    by_label = {f["id1"].strip(): f for f in functions}
    acceleration = by_label["tip absolute acceleration"]
    assert (acceleration["func_type"], acceleration["rsp_node"], acceleration["rsp_dir"]) == (1, 1, 3)
    assert (acceleration["abscissa_spec_data_type"], acceleration["ordinate_spec_data_type"]) == (17, 12)
    assert acceleration["ordinate_axis_units_lab"].strip() == "m/s^2"
    assert acceleration["abscissa_axis_units_lab"].strip() == "s"
    np.testing.assert_allclose(acceleration["x"], result.time, atol=1e-12)
    np.testing.assert_allclose(acceleration["data"], result.probes["tip"].absolute_acceleration, rtol=1e-11)
    force = by_label["top force"]
    assert (force["ordinate_spec_data_type"], force["rsp_node"], force["rsp_dir"]) == (9, 4, -3)
    assert by_label["stop force"]["rsp_dir"] == 3
    spectrum = by_label["middle displacement spectrum"]
    assert (spectrum["func_type"], spectrum["abscissa_spec_data_type"]) == (0, 18)
    stored = result.spectra["middle", "displacement"]
    np.testing.assert_allclose(spectrum["x"], stored.frequency_hz, rtol=1e-12)
    np.testing.assert_allclose(spectrum["data"], stored.amplitude, rtol=1e-11, atol=1e-30)
    assert acceleration["id3"].strip() == "01-JAN-26 00:00:00"


def test_uff_is_ascii_where_that_is_exact(fabricated_run, tmp_path):
    pyuff = pytest.importorskip("pyuff")
    name = "Spitze über 80 Zeichen " + 80 * "x"
    scenario = load_scenario(CONFIGS / "one_sided_65hz.yaml", {"probes": [{"name": name, "position": 0.27}]})
    result = dataclasses.replace(fabricated_run(probes=(name,)), scenario=scenario)
    (path,) = export_run(result, tmp_path / "case.uff", "uff")
    assert path.read_bytes().isascii()
    functions = [each for each in pyuff.UFF(str(path)).read_sets() if each["type"] == 58]
    function = next(each for each in functions if each["id1"].startswith("Spitze ?ber 80 Zeichen"))
    np.testing.assert_allclose(function["x"], result.time, atol=1e-15)


def test_refusals(fabricated_run, tmp_path):
    with pytest.raises(ResultFileError, match="choose one of csv, uff, mat"):
        export_run(fabricated_run(), tmp_path / "x", "xlsx")
    (tmp_path / "case_csv").write_text("a file")
    with pytest.raises(ResultFileError, match="exists and is not a folder"):
        export_run(fabricated_run(), tmp_path / "case_csv", "csv")
    with pytest.raises(ResultFileError, match="is a folder"):
        export_run(fabricated_run(), tmp_path, "mat")


def test_modes_of_a_beam_are_in_the_universal_file(tmp_path):
    """Data sets 151, 15, 82 and 55, read by pyuff and compared with the structure's own modes."""
    pyuff = pytest.importorskip("pyuff")
    changes = ["run.duration=0.02 s", "run.spectrum=null", "run.sample_rate=5 kHz"]
    scenario = load_scenario(CONFIGS / "one_sided_65hz.yaml", changes)
    result = beamsim.run(scenario)
    (path,) = export_run(result, tmp_path / "case.uff", "uff")
    sets = pyuff.UFF(str(path)).read_sets()
    kinds = [each["type"] for each in sets]
    assert kinds[:4] == [164, 151, 15, 82]
    header, nodes, line = sets[1:4]
    assert header["model_name"].strip() == scenario.title
    modes = [each for each in sets if each["type"] == 55]
    assert len(modes) == result.modes.open_frequencies_hz.size
    position = {int(node): x for node, x in zip(nodes["node_nums"], nodes["x"], strict=True)}
    np.testing.assert_array_equal(line["nodes"], modes[0]["node_nums"])
    assert [position[int(node)] for node in line["nodes"]] == pytest.approx(
        list(result.modes.stations.position), rel=1e-4
    )
    for mode, frequency, shape in zip(modes, result.modes.open_frequencies_hz, result.modes.shapes, strict=True):
        assert mode["freq"] == pytest.approx(frequency, rel=1e-4)
        np.testing.assert_allclose(mode["r3"], shape, atol=1e-4 * np.abs(shape).max())
    shapes = read_shapes(path, scenario)
    assert shapes.frequency_hz == pytest.approx(result.modes.open_frequencies_hz, rel=1e-4)


IMPORTED = """
bodies:
  {name}:
    kind: matrices
    mass: {{file: {configs}/matrices/panel.op4, name: mxx}}
    stiffness: {{file: {configs}/matrices/panel.op4, name: kxx}}
    dofs: {dofs}
    base: {{nodes: [15], direction: z}}
    damping: {{kind: modal, ratio: 1 %}}
"""
SHORT = """
excitation: {kind: harmonic, applied_to: base, level: 2 g, frequency: 20 Hz}
reduction: {modes: 5}
probes: [{name: corner, at: {body: panel, node: 14, direction: z}}]
run: {duration: 0.02 s, sample_rate: 5 kHz, convergence: 'off', spectrum: null}
"""


@pytest.mark.parametrize(("several", "placed"), [(False, True), (False, False), (True, True)])
def test_modes_of_imported_bodies_are_in_the_universal_file(tmp_path, several, placed):
    """At their own nodes, where a second body has the same at others; read back, each mode pairs with itself."""
    pyuff = pytest.importorskip("pyuff")
    table = (CONFIGS / "matrices" / "panel_dofs.csv").read_text()
    if not placed:
        table = "\n".join(",".join(line.split(",")[:2]) for line in table.splitlines())
    (tmp_path / "dofs.csv").write_text(table)
    text = IMPORTED.format(name="panel", configs=CONFIGS, dofs=tmp_path / "dofs.csv")
    if several:
        text += IMPORTED.format(name="other", configs=CONFIGS, dofs=tmp_path / "dofs.csv").replace("\nbodies:\n", "")
    scenario = load_scenario(text + SHORT)
    result = beamsim.run(scenario)
    path = write_result(result, tmp_path / "case.h5")
    done = invoke("export", path, "--format", "uff", "-o", tmp_path)
    assert done.exit_code == 0, done.output
    assert ("cannot draw" in done.output) is not placed
    sets = pyuff.UFF(str(tmp_path / "case.uff")).read_sets()
    (nodes,) = (each for each in sets if each["type"] == 15)
    (header,) = (each for each in sets if each["type"] == 151)
    assert ("panel" in header["description"]) is not placed
    modes = [each for each in sets if each["type"] == 55]
    assert len(modes) == result.modes.open_frequencies_hz.size
    own = modes[0]["node_nums"].astype(int)
    np.testing.assert_array_equal(own[:13], np.arange(2, 15))
    assert len(set(own)) == own.size == (26 if several else 13)
    at = {int(n): (x, z) for n, x, z in zip(nodes["node_nums"], nodes["x"], nodes["z"], strict=True)}
    responses = {each["rsp_node"] for each in sets if each["type"] == 58}
    assert not responses & set(own.tolist())  # probes and the base have numbers of their own
    if placed:
        assert at[3] == pytest.approx((0.075, 0.0), abs=1e-6)
        assert [at[n][0] for n in responses].count(pytest.approx(at[14][0])) == 1
    else:
        assert not set(at) & set(own.tolist())
    if several:
        lines = {each["id"].strip(): set(each["nodes"].astype(int)) - {0} for each in sets if each["type"] == 82}
        assert lines == {"panel": set(own[:13].tolist()), "other": set(own[13:].tolist())}
        assert at[int(own[14])] == pytest.approx((0.075, 0.1 * 0.45), rel=0.2)
    else:
        found = compare_modes(scenario, read_shapes(tmp_path / "case.uff", scenario))
        np.testing.assert_allclose(np.diagonal(found.mac)[:4], 1.0, atol=1e-4)


def test_rotations_of_a_mode_have_their_own_columns(tmp_path):
    pyuff = pytest.importorskip("pyuff")
    mode = record_55(Source("t", "", "b"), 1, 50.0, 0.01, np.array([1, 2]), np.array([0.3, 1.0]), ["x", "ry"])
    write_uff([mode], tmp_path / "m.uff")
    read = next(each for each in pyuff.UFF(str(tmp_path / "m.uff")).read_sets() if each["type"] == 55)
    assert (list(read["r1"]), list(read["r5"])) == ([pytest.approx(0.3), 0.0], [0.0, 1.0])
    assert not np.any([read[f"r{k}"] for k in (2, 3, 4, 6)])
