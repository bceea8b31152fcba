"""Exports: what other programs find in the files."""

import dataclasses

import numpy as np
import pytest
from shipped import config_path

import beamsim
from beamsim.analyses.compare_modes.analysis import read_shapes
from beamsim.errors import ResultFileError
from beamsim.scenario import load_scenario
from beamsim.store.export import export_result
from beamsim.store.results import write_result
from tests.helpers.spectra import spectrum_of


def export_run(result, target, form):
    return export_result(write_result(result, target.parent / "run.h5"), target, form)


def test_uff_is_read_back_by_pyuff(fabricated_run, tmp_path):
    pyuff = pytest.importorskip("pyuff")
    stops = [
        {"name": name, "position": x, "side": side, "stiffness": 151100.0}
        for name, x, side in (("stop", 0.27, "below"), ("top", 0.135, "above"))
    ]
    probes = [{"name": "tip", "position": 0.27}, {"name": "middle", "position": 0.135}]
    scenario = load_scenario(config_path("one_sided_65hz"), {"snubbers": stops, "probes": probes})
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
    np.testing.assert_allclose(acceleration["x"], result["histories"]["time"].values, atol=1e-12)
    np.testing.assert_allclose(
        acceleration["data"], result["histories"]["absolute_acceleration"].sel(probe="tip").values, rtol=1e-11
    )
    force = by_label["top force"]
    assert (force["ordinate_spec_data_type"], force["rsp_node"], force["rsp_dir"]) == (9, 4, -3)
    assert by_label["stop force"]["rsp_dir"] == 3
    spectrum = by_label["middle displacement spectrum"]
    assert (spectrum["func_type"], spectrum["abscissa_spec_data_type"]) == (0, 18)
    stored = spectrum_of(result, "displacement", "middle")
    np.testing.assert_allclose(spectrum["x"], stored.frequency_hz, rtol=1e-12)
    np.testing.assert_allclose(spectrum["data"], stored.amplitude, rtol=1e-11, atol=1e-30)
    assert acceleration["id3"].strip() == "01-JAN-26 00:00:00"


def test_uff_is_ascii_where_that_is_exact(fabricated_run, tmp_path):
    pyuff = pytest.importorskip("pyuff")
    name = "Spitze über 80 Zeichen " + 70 * "x"
    scenario = load_scenario(config_path("one_sided_65hz"), {"probes": [{"name": name, "position": 0.27}]})
    result = dataclasses.replace(fabricated_run(probes=(name,)), scenario=scenario)
    (path,) = export_run(result, tmp_path / "case.uff", "uff")
    assert path.read_bytes().isascii()
    functions = [each for each in pyuff.UFF(str(path)).read_sets() if each["type"] == 58]
    function = next(each for each in functions if each["id1"].startswith("Spitze ?ber 80 Zeichen"))
    np.testing.assert_allclose(function["x"], result["histories"]["time"].values, atol=1e-15)


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
    scenario = load_scenario(config_path("one_sided_65hz"), changes)
    result = beamsim.run(scenario)
    (path,) = export_run(result, tmp_path / "case.uff", "uff")
    sets = pyuff.UFF(str(path)).read_sets()
    kinds = [each["type"] for each in sets]
    assert kinds[:4] == [164, 151, 15, 82]
    header, nodes, line = sets[1:4]
    assert header["model_name"].strip() == scenario.title
    modes = [each for each in sets if each["type"] == 55]
    hz = result["modes"]["open_frequencies_hz"].values
    assert len(modes) == hz.size
    position = {int(node): x for node, x in zip(nodes["node_nums"], nodes["x"], strict=True)}
    np.testing.assert_array_equal(line["nodes"], modes[0]["node_nums"])
    placed = [position[int(node)] for node in line["nodes"]]
    np.testing.assert_allclose(placed, result["modes"]["position"], rtol=1e-4)
    for mode, frequency, shape in zip(modes, hz, result["modes"]["shapes"].values, strict=True):
        assert mode["freq"] == pytest.approx(frequency, rel=1e-4)
        np.testing.assert_allclose(mode["r3"], shape, atol=1e-4 * np.abs(shape).max())
    shapes = read_shapes(path, scenario)
    assert shapes.frequency_hz == pytest.approx(hz, rel=1e-4)
