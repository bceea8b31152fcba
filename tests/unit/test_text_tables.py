"""Numbers and columns of text tables, wherever they are read: records, stops, nodes, shapes, sweeps and curves."""

import json

import h5py
import numpy as np
import pytest
import pyuff

from beamsim.analyses.identify.records import sweeps_of
from beamsim.analyses.pad.analysis import KnownPad, pad
from beamsim.errors import InputFileError, MethodError, ScenarioError
from beamsim.inputs.measured import read_record, target_curve
from beamsim.measurements.tables import read_csv
from beamsim.scenario import load_scenario
from beamsim.structures.named_matrices import read_dof_table
from beamsim.system.force_tables import read_forces

G = 9.80665


def values(tmp_path, text, decimal=None, encoding="utf-8"):
    """Columns of a table."""
    (tmp_path / "a.csv").write_bytes(text.encode(encoding))
    return [signal.y.tolist() for signal in read_csv(tmp_path / "a.csv", decimal)]


@pytest.mark.parametrize(
    ("cells", "expected"),
    [
        (["0.0030", "1,104"], [0.003, 1104.0]),
        (["0,0030", "1.104"], [0.003, 1104.0]),
        (["1.104,5", "2"], [1104.5, 2.0]),
        (["1'104.5", "2’208"], [1104.5, 2208.0]),
        (["1 104,5", "1\u00a0104", "1\u202f104", "1\u2009104"], [1104.5, 1104.0, 1104.0, 1104.0]),
        (["+1,5E+03", "1.5"[:1]], [1500.0, 1.0]),
        (["1.5D-03", "2d2"], [0.0015, 200.0]),
        (["12,345,678", "0"], [12345678.0, 0.0]),
        (["1,1045", "1,104"], [1.1045, 1.104]),
        (["0,376", "1,104"], [0.376, 1.104]),  # no number of thousands begins with zero
        (["1234,567", "1,104"], [1234.567, 1.104]),
        (["−1,5", "-0,5"], [-1.5, -0.5]),
        (["3", "1e3"], [3.0, 1000.0]),
        (["NaN", "-inf", "", "0,5"], [np.nan, -np.inf, np.nan, 0.5]),
    ],
)  # fmt: skip
def test_the_numbers_of_a_file_show_their_decimal_mark(tmp_path, cells, expected):
    rows = "".join(f"{k};{cell}\n" for k, cell in enumerate(cells))
    np.testing.assert_array_equal(values(tmp_path, f"run 1,5 of 2.3;x\n{rows}")[1], expected)


@pytest.mark.parametrize("mark", [".", ","])
def test_three_digits_behind_every_mark_leave_it_open(tmp_path, mark):
    text = f"t (s);F (N)\n0;-1{mark}104\n1;2{mark}208\n"
    with pytest.raises(InputFileError, match=rf"-1\{mark}104 in line 2, which can be -1\.?104") as caught:
        values(tmp_path, text)
    assert f'decimal: "{mark}"' in caught.value.remedy
    assert values(tmp_path, text, mark)[1] == [-1.104, 2.208]
    assert values(tmp_path, text, "," if mark == "." else ".")[1] == [-1104.0, 2208.0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("t;a;b\n0;0,5;1\n1;1;0.5\n", "0,5 in line 2 and 0.5 in line 3: of point and comma one must be"),
        ("t;a\n0;1.104,5\n1;1,104.5\n", "of point and comma one must be the decimal mark"),
        ("t;a\n0;0\n1;1'04\n", 'has "1\'04" in line 3'),
        ("t;a\n0;0\n1;1 04\n", "has '1 04' in line 3"),
        ("t;a\n0;0\n1;1_000\n", "has '1_000' in line 3"),
        ("t,a\n0,0,1,5\n0,5,2,0\n", "decimal commas"),
        ("0,000,1,104\n0,001,1,445\n", "decimal commas between commas, as in line 1"),
        ("5 104,5\n6 208,5\n", "separated by commas or by blanks: line 1 is 5 104,5"),
    ],
)
def test_numbers_that_contradict_each_other_are_refused_with_their_lines(tmp_path, text, message):
    with pytest.raises(InputFileError) as caught:
        values(tmp_path, text)
    assert message in caught.value.message


def test_a_stated_decimal_mark_that_a_number_contradicts_is_refused(tmp_path):
    with pytest.raises(InputFileError, match=r"has 0,5 in line 2, which is no number with a decimal point"):
        values(tmp_path, "t;a\n0;0,5\n1;1\n", ".")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "cp1252"])
@pytest.mark.parametrize(
    "text",
    [
        "Zeit (s);Weg (µm)\n0,5;1.104\n1,0;-2.208,5\n",
        "Zeit (s);Weg (µm);\n0,5;1104;\n1,0;-2208,5;\n",
        "Ort: Prüfstand 3, Halle 1,5\nDatum;12.05.2024\n\nZeit\tWeg\t\ns\tµm\n0,5\t1 104\n1\t-2\u00a0208,5\n",
        '"Zeit (s)","Weg (µm)"\n"0,5","1.104,0"\n"1,0","-2.208,5"\n',
        "  Zeit (s)   Weg (µm)\n  0,5       1104,0\n  1,0      -2208,5\n",
        "  Zeit (s)   Weg (µm)\n  5.0D-01   1.104D+03\n  1.0D+00  -2.2085D+03\n",
        "# Zeit (s), Weg (µm)\n0.5, 1104\n1.0, -2208.5\n",
        ";Zeit (s);Weg (µm)\n0;0,5;1104\n1;1,0;-2208,5\n",
        'sep=;\n"Zeit (s)";"Weg (µm)"\n"0,5";"1.104"\n"1";"-2.208,5"\n',
    ],
)
def test_tables_read_back_however_they_are_written(tmp_path, text, encoding):
    (tmp_path / "a.txt").write_bytes(text.encode(encoding))
    *_, signal = read_csv(tmp_path / "a.txt")
    assert (signal.x.tolist(), signal.y.tolist()) == ([0.5, 1.0], [1104.0, -2208.5])
    assert (signal.unit, signal.axis_unit) == ("µm", "s")


@pytest.mark.parametrize(
    ("headings", "axes"),
    [
        (["time", "a", "time", "b"], ["", "time (1)", "", "time (3)"]),
        (["X_1", "a", "X_2", "b"], ["", "X_1", "", "X_2"]),
        (["Zeit (s)", "a", "b", "Zeit 2 (s)", "c"], ["", "Zeit (s)", "Zeit (s)", "", "Zeit 2 (s)"]),
        (["Time 1 - fast", "a", "Time 2 - Default sample rate", "b"],
         ["", "Time 1 - fast", "", "Time 2 - Default sample rate"]),
        (["f (Hz)", "a", "f (Hz)", "b"], ["", "f (Hz) (1)", "", "f (Hz) (3)"]),
        (["t", "x_1", "x_2"], ["", "t", "t"]),  # displacements of two masses
        (["t", "F", "T (°C)"], ["", "t", "t"]),
        (["n", "time", "a"], ["", "", "time"]),
        (["a", "time"], ["time", ""]),
        (["time", "frequency", "a"], ["", "time", "time"]),  # of the same samples
        (["time", "clock (ms)", "a"], ["", "time", ""]),  # over which of the two is not known
        (["x (mm)", "F (N)"], ["", "x (mm)"]),
    ],
)  # fmt: skip
def test_columns_are_along_the_axis_before_them(tmp_path, headings, axes):
    rows = np.arange(3)[:, None] + (0.5 * np.arange(len(headings)) if headings[0] != "n" else [0, 0.5, 1])
    rows[:, -1] *= -1.0 if headings[-1] != "time" else 1.0
    text = "\n".join(";".join(map(str, row)) for row in [headings, *rows.tolist()])
    (tmp_path / "a.csv").write_text(text)
    assert [signal.axis for signal in read_csv(tmp_path / "a.csv")] == axes


def sampled(tmp_path, text, **more):
    """Times and values of a record that shakes the base, its first table row being 0, 0."""
    (tmp_path / "r.csv").write_text(text)
    excitation = {"kind": "sampled", "applied_to": "base", "file": str(tmp_path / "r.csv"), **more}
    chain = {"masses": [1], "springs": [100]}
    record = read_record(load_scenario({"chain": chain, "excitation": excitation}).excitation)
    return record.x, record.y


RECORD = [0.5, -1.5, 2.0, 0.25]


def rows_of(*columns, heading):
    """Lines of a table."""
    return "\n".join([heading, *(";".join(map(str, row)) for row in zip(*columns, strict=True))]) + "\n"


@pytest.mark.parametrize(
    ("heading", "first", "more"),
    [
        ("time;acc", [[0, 0.1, 0.2, 0.3]], {"sample_rate": "10 Hz", "unit": "g"}),
        ("Zeit (s);acc (g)", [[0, 0.1, 0.2, 0.3]], {"sample_rate": "10 Hz"}),
        ("n;time;acc", [[0, 1, 2, 3], [0, 0.1, 0.2, 0.3]], {"time_column": "time", "unit": "g", "time_unit": "s"}),
        (";time (s);acc (g)", [[0, 1, 2, 3], [0, 0.1, 0.2, 0.3]], {}),
        ("X_Value;Comment;acc (g)", [[0, 0.1, 0.2, 0.3], ["", "", "", ""]], {"time_unit": "s"}),
        ("n;acc (g)", [[1, 2, 3, 4]], {"sample_rate": "10 Hz"}),
        ("t (s);F (N);x (mm);a_g (g)", [[0, 0.1, 0.2, 0.3], [9, 8, 7, 6], [1, 2, 3, 5]], {}),
        ("a;b;c", [[0, 0.1, 0.2, 0.3], [7, 7, 7, 7]], {"column": "c", "unit": "g", "time_unit": "s"}),
    ],
)
def test_the_time_is_never_the_signal(tmp_path, heading, first, more):
    time, samples = sampled(tmp_path, rows_of(*first, RECORD, heading=heading), **more)
    np.testing.assert_allclose(time - time[0], [0, 0.1, 0.2, 0.3], atol=1e-12)
    np.testing.assert_allclose(samples, G * np.array(RECORD))


@pytest.mark.parametrize(
    ("heading", "more", "message"),
    [
        ("time (s);a (g);b (g)", {}, "has 2 columns that can be the acceleration: a (g), b (g)"),
        ("time (s);a;b (g)", {}, "has 2 columns that can be the acceleration: a, b (g)"),
        ("x;y;z", {"sample_rate": "1 Hz", "unit": "g"}, "has 3 columns that can be the acceleration: x, y, z"),
        ("a (g);a (g);b (g)", {"column": "a", "sample_rate": "1 Hz"}, "has 2 columns a: a (g) (1), a (g) (2)"),
        ("time (s);a (g);b (N)", {"column": "time", "sample_rate": "1 Hz"}, "has the axis time (s), not values"),
        ("time (s);a_g;CH_G", {"column": "a_g"}, "states no unit of a_g"),
        ("time_s;x_m;v_mm", {"column": "x_m", "unit": "g"}, "states no unit of its times"),
    ],
)
def test_what_a_file_leaves_open_is_asked_for(tmp_path, heading, more, message):
    with pytest.raises(ScenarioError) as caught:
        sampled(tmp_path, rows_of([0, 1, 2, 3], RECORD, RECORD[::-1], heading=heading), **more)
    assert message in str(caught.value)


def test_a_file_of_several_channels_needs_a_column_in_every_format(tmp_path):
    time = np.arange(8) / 8
    function = {
        "type": 58, "binary": 0, "func_type": 1, "rsp_node": 1, "rsp_dir": 3, "ref_ent_name": "NONE", "ref_node": 0,
        "ref_dir": 0, "id2": "NONE", "id3": "NONE", "id4": "NONE", "abscissa_spacing": 1, "abscissa_spec_data_type": 17,
        "abscissa_axis_lab": "Time", "abscissa_axis_units_lab": "s", "ordinate_spec_data_type": 12,
        "ordinate_axis_lab": "a", "ordinate_axis_units_lab": "g", "orddenom_spec_data_type": 0, "x": time,
    }  # fmt: skip
    sets = [{**function, "rsp_ent_name": name, "id1": name, "data": size * time} for size, name in ((1, "a"), (2, "b"))]
    pyuff.UFF(str(tmp_path / "r.uff")).write_sets(sets, mode="overwrite")
    with h5py.File(tmp_path / "r.h5", "w") as file:
        for name, column, unit in (("time", time, "s"), ("a", time, "g"), ("b", 2 * time, "g")):
            file[name] = column
            file[name].attrs["units"] = unit
    for name in ("r.uff", "r.h5"):
        excitation = {"kind": "sampled", "applied_to": "base", "file": str(tmp_path / name)}
        case = {"chain": {"masses": [1], "springs": [100]}, "excitation": excitation}
        with pytest.raises(ScenarioError, match="has 2 columns that can be the acceleration: a, b; name one in"):
            read_record(load_scenario(case).excitation)
        samples = read_record(load_scenario(case, ["excitation.column=b"]).excitation).y
        np.testing.assert_allclose(samples, 2 * G * time, rtol=1e-6)


STOP = "crosshead (mm);extensometer (mm);force (kN)\n0;0;0\n1,5;1;1.104\n3;2;2.208\n"


def test_two_deflections_are_asked_for_and_chosen(tmp_path):
    (tmp_path / "pad.csv").write_text(STOP)
    with pytest.raises(InputFileError, match=r"crosshead \(mm\), extensometer \(mm\) each have a unit of length"):
        read_forces(tmp_path / "pad.csv")
    deflection, force, _ = read_forces(tmp_path / "pad.csv", ["extensometer"])
    np.testing.assert_allclose(deflection, [0, 1e-3, 2e-3])
    np.testing.assert_allclose(force, [0, 1104e3, 2208e3])
    known = KnownPad(curve=tmp_path / "pad.csv", segments=1, columns=("crosshead",))
    assert pad(known).stiffness == pytest.approx(736e6)


def test_columns_over_other_times_make_no_curve(tmp_path):
    (tmp_path / "pad.csv").write_text("X_1 (s);x (mm);X_2 (s);F (N)\n0;0;0;0\n1;1;2;9\n")
    with pytest.raises(InputFileError, match="measured at different times"):
        read_forces(tmp_path / "pad.csv")
    (tmp_path / "pad.csv").write_text("X_1 (s);x (mm);X_2 (ms);F (N)\n0;0;0;0\n1;1;1000;9\n")
    np.testing.assert_array_equal(read_forces(tmp_path / "pad.csv")[2], [0.0, 1.0])


@pytest.mark.parametrize(
    "text",
    [
        "node,direction,z,y,x\n1,z,0,0,0.3\n12,ry,0.05,,0.5\n",
        "direction;Node;x (mm);y (mm);z (mm)\nZ;1;300;0;0\nRY;12;500;;50\n",
        "node;direction;x (cm);y;z [mm]\n1;z;30;0;0,0\n12;ry;50;;50,0\n",
    ],
)
def test_nodes_are_read_by_headings_and_their_units(tmp_path, text):
    (tmp_path / "dofs.csv").write_text(text)
    table = read_dof_table(tmp_path / "dofs.csv")
    assert table.dofs == ((1, "z"), (12, "ry"))
    np.testing.assert_allclose(table.coordinates, [[0.3, 0, 0], [0.5, np.nan, 0.05]], rtol=1e-15)
    in_mm = read_dof_table(tmp_path / "dofs.csv", length=1e-3).coordinates
    assert in_mm[0, 0] == pytest.approx(300 if "(mm)" in text or "(cm)" in text else 0.3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1,z,0,0,0.3\n", "has no heading node and no heading direction in line 1"),
        ("node,direction,X1\n1,z,0\n", "has an unknown heading X1 in line 1"),
        ("node,direction,x,X\n1,z,0,1\n", "has two columns x"),
        ("node,direction,x (kg)\n1,z,0\n", "must be a length"),
        ("node,direction,x\n1,z\n", "has 2 columns in line 2 instead of 3"),
        ("node;direction;x\n1;z;1,104\n", "1,104 in line 2, which can be 1.104 or 1104"),
        ("node;direction;x;y\n1;z;0,5;0.5\n", "of point and comma one must be the decimal mark"),
    ],
)
def test_tables_of_nodes_that_leave_something_open_are_refused(tmp_path, text, message):
    (tmp_path / "dofs.csv").write_text(text)
    with pytest.raises(MethodError) as caught:
        read_dof_table(tmp_path / "dofs.csv")
    assert message in caught.value.message
    assert caught.value.remedy


def test_sweeps_and_samples_read_numbers_as_records_do(tmp_path):
    (tmp_path / "s.csv").write_text("name;level (g);jump (Hz)\nno 1.5;1,5;1.011,5\n")
    test = {"name": "lab", "kind": "sweep", "file": "s.csv", "from": 7, "to": 1600, "scatter": 0.02}
    fit = {"estimate": ["snubbers.stop.gap"], "tests": [test]}
    case = {
        "chain": {"masses": [1], "springs": [4000]},
        "snubbers": [{"name": "stop", "mass": 1, "side": "above", "gap": "1 mm", "stiffness": 3000}],
        "excitation": {"kind": "harmonic", "applied_to": "base", "level": 1, "frequency": 10},
        "identify_stiffness": {"snubber": "stop", "nonlinear": fit},
    }
    section = load_scenario(case).identify_stiffness.nonlinear.tests[0]
    (sweep,) = sweeps_of(section, tmp_path, [])
    assert (sweep.name, sweep.jump) == ("no 1.5", 1011.5)
    assert float(sweep.level) == pytest.approx(1.5 * G)


@pytest.mark.parametrize(
    ("given", "refused"),
    [
        ({"file": "curve.csv"}, "has 20,125 in line 2"),
        ({"file": "curve.csv", "decimal": ",", "column": "new"}, ""),
        ({"file": "curve.csv", "decimal": ","}, "has 2 columns that can be the acceleration: old (g), new (g)"),
    ],
)
def test_a_curve_states_its_column_and_decimal_mark(tmp_path, given, refused):
    (tmp_path / "curve.csv").write_text("frequency (Hz);old (g);new (g)\n20,125;9;1\n200,125;9;2\n")
    shock = {"kind": "matched", "applied_to": "base", "srs": given, "duration": "1 s"}
    (tmp_path / "case.yaml").write_text(json.dumps({"chain": {"masses": [1], "springs": [100]}, "excitation": shock}))
    scenario = load_scenario(tmp_path / "case.yaml")
    if refused:
        with pytest.raises(ScenarioError) as caught:
            target_curve(scenario.excitation, tmp_path)
        assert refused in str(caught.value)
        return
    frequency, level = target_curve(scenario.excitation, tmp_path)
    np.testing.assert_allclose(frequency, [20.125, 200.125])
    np.testing.assert_allclose(level, [G, 2 * G])
