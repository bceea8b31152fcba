"""Six columns of one record as motions of the base, from text, HDF5 and UFF files."""

import h5py
import numpy as np
import pytest
import pyuff

import beamsim
from beamsim.errors import ScenarioError
from beamsim.scenario import load_scenario

AXES = ("x", "y", "z", "rx", "ry", "rz")
COLUMNS = {axis: axis.upper() for axis in AXES}
UNITS = dict(zip(AXES, ["m/s^2"] * 3 + ["rad/s^2"] * 3, strict=True))
TIME = np.arange(61) / 500.0
ABOUT = [0.1, 0.0, 0.2]


@pytest.fixture(scope="module")
def record():
    """(6, nt) accelerations, m/s^2 and rad/s^2."""
    rng = np.random.default_rng(3)
    return rng.normal(size=(6, 1)) * np.sin(2 * np.pi * rng.uniform(8, 30, size=(6, 1)) * TIME) * TIME / TIME[-1]


@pytest.fixture(scope="module")
def files(tmp_path_factory, record):
    """The record in three formats, by ending."""
    folder = tmp_path_factory.mktemp("records")
    head = ",".join(["time (s)", *(f"{COLUMNS[axis]} ({unit})" for axis, unit in UNITS.items())])
    np.savetxt(folder / "r.csv", np.column_stack([TIME, *record]), delimiter=",", header=head, comments="", fmt="%.15g")
    with h5py.File(folder / "r.h5", "w") as file:
        for name, unit, values in (("time", "s", TIME), *zip(COLUMNS.values(), UNITS.values(), record, strict=True)):
            file[name] = values
            file[name].attrs["units"] = unit
    for k, values in enumerate(record):
        part = pyuff.prepare_58(
            binary=0, func_type=1, rsp_node=1, rsp_dir=k + 1, ref_dir=0, ref_node=0, data=values, x=TIME, ver_num=0,
            num_pts=TIME.size, abscissa_spacing=1, abscissa_inc=TIME[1], abscissa_spec_data_type=17, id1=f"axis {k}",
            ordinate_spec_data_type=12, orddenom_spec_data_type=0, rsp_ent_name="a", ref_ent_name="b",
            ordinate_axis_units_lab=UNITS[AXES[k]], abscissa_axis_units_lab="s",
        )  # fmt: skip
        pyuff.UFF(str(folder / "r.uff")).write_sets(part, "add")
    return {ending: str(folder / f"r.{ending}") for ending in ("csv", "h5", "uff")}


def case(excitation, **more):
    return load_scenario({
        "bodies": {"arm": {
            "kind": "frame", "nodes": {"a": [0, 0, 0], "b": [0.3, 0, 0.2]},
            "sections": {"s": {"section": {"kind": "circle", "diameter": 0.02}, "youngs_modulus": 70e9,
                               "density": 2700}},
            "members": {"m": {"nodes": ["a", "b"]}}, "elements": 2, "supports": {"a": "clamped"},
            "damping": {"kind": "modal", "ratio": 0.05},
        }},
        "excitation": excitation, "probes": [{"name": "y", "at": {"node": "b", "direction": "y"}}],
        "run": {"duration": 0.1, "start": "rest", "convergence": "off"}, **more,
    })  # fmt: skip


def columns_of(file, **more):
    columns = {axis: str(k + 1) for k, axis in enumerate(AXES)} if file.endswith("uff") else COLUMNS
    return {"kind": "sampled", "applied_to": "base", "file": file, "columns": columns, "about": ABOUT, **more}


@pytest.mark.parametrize("ending", ["csv", "h5", "uff"])
def test_columns_of_a_record_are_motions_of_the_base(files, record, ending):
    """The accelerations of the base are those of the file, and each input is stated with its unit."""
    result = beamsim.run(case(columns_of(files[ending])))
    histories = result["histories"]
    assert histories.labels("base_motion") == list(AXES)
    at = np.searchsorted(histories["time"].values, TIME[:50] - 1e-9)
    for axis, values in zip(AXES, record, strict=True):
        found = histories["base_acceleration"].sel(base_motion=axis)
        assert found.unit == UNITS[axis]
        same = np.interp(TIME[:50], histories["time"].values, found.values)
        np.testing.assert_allclose(same, values[:50], rtol=0, atol=1e-2 * np.abs(values).max())
    assert at.size == 50
    assert result["inputs"]["path"].values.tolist() == [f"excitation.columns.{axis}" for axis in AXES]


def test_columns_are_short_for_a_list_of_motions(files):
    """The same motion, reactions and statements as with one entry for each column."""
    each = [
        {"kind": "sampled", "applied_to": "base", "file": files["csv"], "column": COLUMNS[axis], "direction": axis,
         **({"about": ABOUT} if "r" in axis else {})}
        for axis in AXES
    ]  # fmt: skip
    outputs = {"outputs": [{"name": "foot", "kind": "reaction_force", "support": "base", "direction": "x"}]}
    alone, listed, six = (
        beamsim.run(case(excitation, **outputs))
        for excitation in (
            columns_of(files["csv"]), {"kind": "forces", "forces": each},
            {"kind": "forces", "forces": [columns_of(files["csv"])]},
        )
    )  # fmt: skip
    for name in ("displacement", "absolute_acceleration", "output_value", "base_displacement"):
        for other in (listed, six):
            np.testing.assert_array_equal(other["histories"][name].values, alone["histories"][name].values)
    assert alone["inputs"]["rms"].values == pytest.approx(listed["inputs"]["rms"].values, rel=1e-14)


def test_units_of_translations_and_rotations(tmp_path):
    """unit and angular_unit state what the file does not; a quantity applies to both."""
    rows = np.column_stack([TIME, np.sin(60 * TIME) ** 3, np.cos(60 * TIME) - 1.0])
    np.savetxt(tmp_path / "r.csv", rows, delimiter=",", header="t,A,B", comments="")
    given = {"columns": {"z": "A", "ry": "B"}, "time_unit": "s", "about": ABOUT}
    excitation = {**columns_of(str(tmp_path / "r.csv")), **given, "unit": "mm", "angular_unit": "deg"}
    moved = beamsim.run(case(excitation))["histories"]["base_displacement"]
    assert moved.sel(base_motion="z").values.max() == pytest.approx(1e-3, rel=1e-3)
    assert moved.sel(base_motion="ry").values.min() == pytest.approx(np.radians(-2.0), rel=1e-3)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"columns": {}}, "excitation.columns names no column; name one, for example {x: TX, rz: RZ}"),
        ({"column": "TX"}, "excitation.column is also given by columns"),
        ({"direction": "x"}, "excitation.direction is also given by columns"),
        ({"applied_to": {"node": "b", "direction": "z"}, "about": None}, "excitation.columns belong to motions of the"),
        ({"columns": {"x": "TX"}}, "excitation.about belongs to a rotation of the base"),
        ({"columns": {"x": "TX"}, "about": None, "angular_unit": "deg"}, "angular_unit is the unit of columns of"),
        ({"columns": {"w": "TX"}}, "excitation.columns.w"),
    ],
)  # fmt: skip
def test_contradictions_are_refused(files, change, words):
    with pytest.raises(ScenarioError) as refused:
        case(columns_of(files["csv"]) | change)
    assert words in str(refused.value)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"columns": {"x": "TQ"}, "about": None}, "TQ"),
        ({"columns": {"x": "RX"}, "about": None}, "rad/s^2, which must be an acceleration"),
        ({"columns": {"rx": "TX"}}, "TX"),
    ],
)
def test_a_column_that_does_not_fit_is_named(files, change, words):
    with pytest.raises(ScenarioError) as refused:
        beamsim.run(case(columns_of(files["csv"]) | change))
    assert words in str(refused.value)
    assert "excitation.columns" in str(refused.value)


def test_a_body_that_cannot_follow_a_column_is_named(files):
    chain = {"chain": {"masses": [1.0], "springs": [1e3]}, "excitation": columns_of(files["csv"], about=None)}
    with pytest.raises(ScenarioError) as refused:
        load_scenario(chain | {"run": {"duration": 0.1}})
    assert "excitation.columns.x moves the base in x, which moves no point of chain" in str(refused.value)
