"""`beamsim compare-modes`: pairs of measured and computed modes, from CSV and UFF files; errors and exit codes."""

import json

import numpy as np
import pytest
import pyuff

import beamsim
from beamsim.analyses.compare_modes.analysis import read_shapes
from beamsim.errors import ScenarioError
from beamsim.scenario import load_scenario
from beamsim.store.universal import Source, record_55, write_uff
from beamsim.structures.places import Place
from beamsim.system.reduced_model import build_reduced_model
from tests.helpers.commands import invoke
from tests.helpers.universal_files import nodes_2411, shapes_55, units

pytestmark = pytest.mark.quick

CHAIN = """
chain: {masses: [1, 1], springs: [100, 100], snubbers: [{name: stop, mass: 2, side: above, stiffness: 100, gap: 0.1}]}
"""
BEAM = """
beam: {length: 0.5, width: 0.05, thickness: 0.005, youngs_modulus: 70e9, density: 2700}
"""
TWO = """
bodies:
  arm: {kind: beam, length: 0.3, width: 0.05, thickness: 0.005, youngs_modulus: 70e9, density: 2700}
  panel: {kind: plate, length: 0.4, width: 0.3, thickness: 0.003, youngs_modulus: 70e9, poissons_ratio: 0.3,
          density: 2700, elements: [4, 4], supports: {left: clamped}}
"""
X = np.array([0.1, 0.2, 0.3, 0.4, 0.5])


def write(folder, text, shapes):
    (folder / "case.yaml").write_text(text)
    (folder / "shapes.csv").write_text(shapes)
    return folder / "case.yaml", folder / "shapes.csv"


def call(*arguments):
    return invoke("compare-modes", *arguments)


def own_shapes(text, places):
    model = build_reduced_model(load_scenario(text))
    return model.omega / (2 * np.pi), model.shapes(places)


def test_nodes_of_no_body_are_refused(tmp_path):
    nodes = np.array([1, 2])
    sets = [pyuff.prepare_15(node_nums=nodes, x=[0.1, 0.3], y=[0.0, 0.0], z=[0.0, 0.0]),
            record_55(Source("t", "", "b"), 1, 50.0, 0.01, nodes, np.array([0.3, 1.0]))]  # fmt: skip
    write_uff(sets, tmp_path / "modes.uff")
    with pytest.raises(ScenarioError, match=r"trace line .dataset 82. named arm, panel"):
        read_shapes(tmp_path / "modes.uff", load_scenario(TWO))


def test_own_shapes_scaled_and_in_another_order_are_found_again(tmp_path):
    frequency, shapes = own_shapes(BEAM, [Place("beam", x) for x in X])
    order, factors = [2, 0, 1], [3.0, -0.2, 1e-3 * np.exp(0.4j)]
    rows = ["position (mm)," + ",".join(f"{1.05 * frequency[k]} Hz" for k in order)]
    for x, row in zip(X, shapes, strict=True):
        cells = [f"{value.real}{value.imag:+}j" for value in (f * row[k] for k, f in zip(order, factors, strict=True))]
        rows.append(",".join([f"{1e3 * x}", *cells]))
    case, measured = write(tmp_path, BEAM, "\n".join(rows))
    done = call(case, measured, "-o", tmp_path, "--json")
    assert done.exit_code == 0, done.output
    summary = json.loads(done.stdout)
    assert [pair["predicted"] for pair in summary["pairs"]] == [3, 1, 2]
    for pair in summary["pairs"]:
        assert pair["mac"] == pytest.approx(1.0, abs=1e-12)
        assert pair["difference"] == pytest.approx(1 / 1.05 - 1, rel=1e-9)
    stored = beamsim.load(tmp_path / "case_modes.h5")
    assert stored["compared_modes"]["mac"].values.shape == (3, stored["compared_modes"]["predicted_hz"].values.size)
    assert stored["compared_modes"]["paired"].values.tolist() == [3, 1, 2]
    assert (tmp_path / "case_modes_mac.png").stat().st_size > 5000


def test_criterion_and_closed_contacts_in_closed_form(tmp_path):
    """Shapes (1, golden ratio) and (golden ratio, -1) of two masses; a closed stop makes the chain symmetric."""
    golden = (1 + np.sqrt(5)) / 2
    case, measured = write(tmp_path, CHAIN, "mass,1 Hz,2.5\n1,1,1\n2,1,-1\n")
    opened = beamsim.compare_modes(load_scenario(case), read_shapes(measured, load_scenario(case)))
    expected = (1 + golden) ** 2 / (2 * (1 + golden**2))
    np.testing.assert_allclose(
        opened["compared_modes"]["mac"].values, [[expected, 1 - expected], [1 - expected, expected]], rtol=1e-12
    )
    np.testing.assert_allclose(
        opened["compared_modes"]["predicted_hz"].values, 10 / (2 * np.pi) * np.array([1 / golden, golden]), rtol=1e-12
    )
    closed = beamsim.compare_modes(load_scenario(case), read_shapes(measured, load_scenario(case)), contacts="closed")
    np.testing.assert_allclose(closed["compared_modes"]["mac"].values, np.eye(2), atol=1e-12)
    np.testing.assert_allclose(
        closed["compared_modes"]["predicted_hz"].values, 10 / (2 * np.pi) * np.array([1.0, np.sqrt(3)]), rtol=1e-12
    )


def test_limits_give_exit_code_four_and_keep_the_result(tmp_path):
    case, measured = write(tmp_path, CHAIN, "mass,1 Hz,2.5\n1,1,1\n2,1,-1\n")
    done = call(case, measured, "-o", tmp_path, "--least-mac", "0.96", "--no-plots")
    assert done.exit_code == 4
    assert "MAC 0.947 is below 0.96" in done.output
    assert (tmp_path / "case_modes.h5").exists()
    done = call(case, measured, "-o", tmp_path, "--most-difference", "1", "--no-plots")
    assert done.exit_code == 4
    assert "mode measured at 1 Hz: computed 0.9836 Hz, -1.64 %, over 1 %" in done.output
    assert call(case, measured, "-o", tmp_path, "--least-mac", "0.9", "--no-plots").exit_code == 0


def test_modes_that_fit_nothing_are_said(tmp_path):
    case, measured = write(tmp_path, CHAIN, "mass,1 Hz,2.5 Hz,7 Hz\n1,1,1,1\n2,1.6,-0.6,0\n")
    result = beamsim.compare_modes(load_scenario(case), read_shapes(measured, load_scenario(case)))
    assert result["compared_modes"]["paired"].values.tolist() == [1, 2, 0]
    assert result.summary["lowest_mac"] == 0.0
    assert result.warnings == ("no computed mode fits the measured mode at 7 Hz",)
    done = call(case, measured, "-o", tmp_path, "--least-mac", "0.1", "--no-plots")
    assert done.exit_code == 4
    assert "mode measured at 7 Hz: no computed mode fits" in done.output


def test_places_that_do_not_tell_modes_apart_are_said(tmp_path):
    case, measured = write(tmp_path, BEAM, "position,17 Hz\n0.49,1\n0.5,1.02\n")
    few = beamsim.compare_modes(load_scenario(case), read_shapes(measured, load_scenario(case)))
    assert few["compared_modes"]["predicted_hz"].values.size == 5
    assert few["compared_modes"]["paired"].values.tolist() == [1]  # the nearest frequency of those that look alike
    assert few.warnings == ("at the measured places mode 1 looks like mode 2, 3, 4, 5: measure at more places",)


def test_places_on_several_bodies(tmp_path):
    places = [Place("arm", 0.3), Place("panel", (0.4, 0.0)), Place("panel", (0.4, 0.3))]
    frequency, shapes = own_shapes(TWO, places)
    rows = ["body,position,y," + ",".join(f"{f}" for f in frequency[:3])]
    for name, row in zip(("arm,100 %,", "panel,0.4,0", "panel,400 mm,300 mm"), shapes, strict=True):
        rows.append(",".join([name, *(f"{value}" for value in row[:3])]))
    case, measured = write(tmp_path, TWO, "\n".join(rows))
    result = beamsim.compare_modes(load_scenario(case), read_shapes(measured, load_scenario(case)))
    assert result["compared_modes"]["paired"].values.tolist() == [1, 2, 3]
    assert result.summary["lowest_mac"] == pytest.approx(1.0, abs=1e-12)


def uff(path, nodes, frequencies, shapes, coordinates=None, component="r3"):
    file = pyuff.UFF(str(path))
    if coordinates is not None:
        zero = np.zeros(len(nodes))
        file.write_sets({"type": 15, "node_nums": nodes, "def_cs": zero, "disp_cs": zero, "color": zero,
                         "x": coordinates, "y": zero, "z": zero}, "add")  # fmt: skip
    for k, f in enumerate(frequencies):
        zero = np.zeros(len(nodes))
        mode = {"type": 55, "analysis_type": 2, "data_ch": 2, "spec_data_type": 8, "load_case": 1, "mode_n": k + 1,
                "modal_m": 1.0, "modal_damp_vis": 0.0, "modal_damp_his": 0.0, "freq": f, "node_nums": nodes,
                "r1": zero, "r2": zero, "r3": zero, **{f"id{i}": "NONE" for i in range(1, 6)}}  # fmt: skip
        file.write_sets({**mode, component: shapes[:, k]}, "add")


def test_shapes_of_a_universal_file(tmp_path):
    frequency, shapes = own_shapes(BEAM, [Place("beam", x) for x in X])
    (tmp_path / "case.yaml").write_text(BEAM)
    millimetres = pyuff.prepare_164(
        units_code=9, units_description="mm (N)", temp_mode=1, length=1e3, force=1.0, temp=1.0, temp_offset=0.0
    )
    write_sets = pyuff.UFF(str(tmp_path / "lab.uff")).write_sets
    write_sets(millimetres, "add")
    uff(tmp_path / "lab.uff", [1, 2, 3, 4, 5], frequency[:3], shapes, 1e3 * np.array(X))
    done = call(
        tmp_path / "case.yaml", tmp_path / "lab.uff", "-o", tmp_path, "--json", "--no-plots", "--least-mac", "0.99"
    )
    assert done.exit_code == 0, done.output
    assert [pair["predicted"] for pair in json.loads(done.stdout)["pairs"]] == [1, 2, 3]
    uff(tmp_path / "bare.uff", [1, 2, 3, 4, 5], frequency[:3], shapes)
    done = call(tmp_path / "case.yaml", tmp_path / "bare.uff", "-o", tmp_path)
    assert done.exit_code == 2
    assert "no coordinates of node 1" in done.output


@pytest.mark.parametrize(
    ("shapes", "message"),
    [
        ("", "is empty"),
        ("position,17 Hz\n", "has no table"),
        ("a,b\n1,2\n", "no column of a place"),
        ("position\n0.1\n", "no column of a mode"),
        ("position,first\n0.1,1\n", "column 2 = first is neither a place nor a frequency"),
        ("position,17 Hz\n0.1,x\n0.2,1\n", "line 2, column 2 = x is not a number"),
        ("position,17 Hz\n0.1,1\n0.2\n", "has 1 columns in line 3 instead of 2"),
        ("# lab\nposition,17 Hz\n0.1,1\n0.7,1\n", "line 4: = 0.7 m lies beyond"),
        ("position,17 Hz\nend,1\n0.2,1\n", "line 2: the place"),
        ("mass,17 Hz\n1,1\n2,1\n", "line 2: applies to a chain"),
        ("node,17 Hz\n1,1\n2,1\n", "line 2: applies to imported matrices"),
        ("position,17 Hz\n0.1,1\n", "has 1 place"),
        ("position,17 Hz\n0.1,0\n0.2,0\n", "no motion in the mode at 17 Hz"),
        ("position,0 Hz\n0.1,1\n0.2,2\n", "not positive"),
    ],
)
def test_wrong_files_are_refused_with_their_line(tmp_path, shapes, message):
    case, measured = write(tmp_path, BEAM, shapes)
    with pytest.raises(ScenarioError) as caught:
        beamsim.compare_modes(load_scenario(case), read_shapes(measured, load_scenario(case)))
    problem = caught.value.problems[0]
    assert str(measured) in problem.message
    assert message in problem.message
    assert problem.remedy
    done = call(case, measured, "-o", tmp_path)
    assert done.exit_code == 2


ZERO = np.zeros(5)


@pytest.mark.parametrize(
    ("columns", "count", "moving"),
    [
        ((ZERO, X**2, ZERO), 3, "y"),
        ((X**2, ZERO, ZERO), 3, "x"),
        ((X, X**2, ZERO), 3, "x and y"),
        ((ZERO, X**2, 1e-9 * X), 3, "y"),
        ((ZERO, X**2, ZERO, ZERO, ZERO, X), 6, "y and rz"),
        ((ZERO, X**2 * (1 + 0.1j), ZERO), 3, "y"),
    ],
)
@pytest.mark.parametrize("text", [BEAM, CHAIN])
def test_shapes_that_do_not_move_in_z_are_refused(tmp_path, text, columns, count, moving):
    (tmp_path / "case.yaml").write_text(text)
    (tmp_path / "a.uff").write_text(
        nodes_2411(X) + shapes_55(56.0, *columns, count=count, values=(8, 2 if count == 3 else 3))
    )
    refused = call(tmp_path / "case.yaml", tmp_path / "a.uff")
    assert refused.exit_code == 2
    assert f"a.uff has shapes with motion only in {moving}, but the bodies of this case deflect in z" in refused.stderr


@pytest.mark.parametrize("kind", [2, 3, 7])
def test_nodes_of_data_set_2411_and_modes_of_every_kind_in_the_units_of_the_file(tmp_path, kind):
    """Shapes and coordinates in mm: the units of the second data set 164 are those of what follows it."""
    frequency, shapes = own_shapes(BEAM, [Place("beam", x) for x in X])
    (tmp_path / "case.yaml").write_text(BEAM)
    turned = 1.0 if kind == 2 else np.exp(0.3j)
    modes = (shapes_55(f, ZERO, ZERO, 1e3 * turned * shape, kind=kind)
             for f, shape in zip(frequency[:2], shapes.T[:2], strict=True))  # fmt: skip
    (tmp_path / "a.uff").write_text(units(1.0) + units(1e3) + nodes_2411(1e3 * X) + "".join(modes))
    measured = read_shapes(tmp_path / "a.uff", load_scenario(BEAM))
    np.testing.assert_allclose(measured.frequency_hz, frequency[:2], rtol=1e-5)
    assert [place.position for place in measured.places] == pytest.approx(X)
    np.testing.assert_allclose(measured.shapes, turned * shapes[:, :2], rtol=1e-4)
    assert call(tmp_path / "case.yaml", tmp_path / "a.uff", "--least-mac", "0.999").exit_code == 0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (nodes_2411(X) + shapes_55(50.0, ZERO, ZERO, X, values=(2, 4)), "only modes of stresses, strains or forces"),
        (nodes_2411(X) + shapes_55(50.0, ZERO, ZERO, X, kind=5), "has no mode shapes"),
        (shapes_55(50.0, ZERO, ZERO, X), "no coordinates of node 1; export dataset 15 or 2411"),
        ((nodes_2411(X) + shapes_55(50.0, ZERO, ZERO, X))[:-60], "ends within the data set that begins in line 14"),
        (nodes_2411(X) + shapes_55(50.0, ZERO, ZERO, X) + shapes_55(90.0, ZERO, ZERO, X, nodes=(1, 2, 3, 4, 6)),
         "modes at different nodes"),
    ],
)  # fmt: skip
def test_universal_files_without_usable_shapes_are_refused(tmp_path, text, message):
    (tmp_path / "a.uff").write_text(text)
    with pytest.raises(ScenarioError, match=message):
        read_shapes(tmp_path / "a.uff", load_scenario(BEAM))


@pytest.mark.parametrize("end", ["\n", " \n", "\r\n"])
def test_nodes_of_data_set_15_in_free_columns(tmp_path, end):
    """pyuff joins their lines."""
    nodes = "".join(f"{k} 0 0 8 {x:.5e} 0 0{end}".replace("e", "D") for k, x in enumerate(X, 1))
    (tmp_path / "a.uff").write_bytes(
        f"    -1{end.strip(' ')}    15{end}{nodes}    -1{end.strip(' ')}".encode()
        + shapes_55(50.0, ZERO, ZERO, X).encode()
    )
    measured = read_shapes(tmp_path / "a.uff", load_scenario(BEAM))
    assert [place.position for place in measured.places] == pytest.approx(X)
