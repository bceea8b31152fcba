"""How files scale their values: packing, units, signs, numbers of samples, encodings."""

import warnings

import h5netcdf
import h5py
import numpy as np
import pytest
import pyuff

from beamsim.errors import InputFileError, ScenarioError
from beamsim.inputs.measured import read_record
from beamsim.measurements.read import read_file
from beamsim.scenario.excitation import SampledInput
from tests.helpers.universal_files import OVER_FREQUENCY, TAG, function, units

pytestmark = [pytest.mark.quick, pytest.mark.usefixtures("without_examination")]

Y = np.sin(np.arange(20.0)) + 0.1


def channels(tmp_path, *sets, encoding="ascii"):
    """The channels of a universal file."""
    (tmp_path / "a.uff").write_bytes("".join(sets).encode(encoding))
    return read_file(tmp_path / "a.uff")


def hdf5(tmp_path, values=Y, **attributes):
    """The channel ``acc`` of an HDF5 file with times in s."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["time"], file["acc"] = np.arange(len(values)) / 100, values
        file["time"].attrs["units"] = "s"
        for name, value in attributes.items():
            file["acc"].attrs[name] = value
    (signal,) = (each for each in read_file(tmp_path / "a.h5") if each.name == "acc")
    return signal


@pytest.mark.parametrize(
    ("attributes", "missing"),
    [
        ({"_FillValue": -99}, [3]),
        ({"missing_value": [-99, -98]}, [3, 4]),
        ({"valid_min": 0}, [3, 4]),
        ({"valid_max": np.int16(11)}, [12, 13, 14, 15, 16, 17, 18, 19]),
        ({"valid_range": [-98, 18]}, [3, 19]),
        ({"_FillValue": -99, "scale_factor": 0.5, "add_offset": 1.0}, [3]),
    ],
)
def test_missing_values_are_no_samples(tmp_path, attributes, missing):
    """They are found in the stored numbers, before these are scaled."""
    stored = np.arange(20, dtype="i2")
    stored[3:5] = -99, -98
    signal = hdf5(tmp_path, stored, units="m/s^2", **attributes)
    assert np.flatnonzero(np.isnan(signal.y)).tolist() == missing
    with pytest.raises(InputFileError, match=f"{len(missing)} values that are not finite, the first at sample"):
        signal.check()


def test_values_that_netcdf_never_wrote_are_missing(tmp_path):
    signal = hdf5(tmp_path, np.where(np.arange(20) == 7, 9.969209968386869e36, Y).astype("f4"), units="m/s^2")
    assert np.flatnonzero(np.isnan(signal.y)).tolist() == [7]


@pytest.mark.parametrize(
    ("values", "attributes", "message"),
    [
        (Y, {"scale_factor": "0.001"}, "an attribute scale_factor of acc that is not one number"),
        (Y, {"add_offset": [1.0, 2.0]}, "an attribute add_offset of acc that is not one number"),
        (Y, {"scale_factor": np.nan}, "an attribute scale_factor of acc that is not one number"),
        (np.arange(20), {"gain": 0.001}, "integers in acc with the attribute gain"),
        (np.arange(20), {"NI_Scale[0]_Linear_Slope": 0.001}, "integers in acc with the attribute NI_Scale"),
        (np.arange(20), {"sensitivity": "100 mV/g"}, "integers in acc with the attribute sensitivity"),
        (Y, {"unit": "g", "units": "m/s^2"}, r"several units of acc: g, m/s\^2"),
    ],
)
def test_scaling_that_is_not_understood_is_refused(tmp_path, values, attributes, message):
    with pytest.raises(InputFileError, match=message):
        hdf5(tmp_path, values, **attributes).check()


def test_a_sensitivity_of_values_in_their_unit_is_no_scaling(tmp_path):
    signal = hdf5(tmp_path, Y, units="m/s^2", sensitivity=0.01).check()
    np.testing.assert_array_equal(signal.y, Y)
    assert signal.scaling == ()


def test_a_netcdf_dimension_without_a_variable_is_no_axis(tmp_path):
    with h5netcdf.File(tmp_path / "a.nc", "w") as file:
        file.dimensions = {"time": 20}
        file.create_variable("acc", ("time",), data=Y).attrs["units"] = "g"
    (signal,) = read_file(tmp_path / "a.nc")
    assert (signal.name, signal.axis) == ("acc", "")


def test_an_axis_is_known_by_its_unit_and_may_be_packed(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["Messachse"], file["acc"] = np.arange(20, dtype="i4"), Y
        for name, value in {"units": np.bytes_("s"), "scale_factor": 0.01}.items():
            file["Messachse"].attrs[name] = value
        file["Messachse"].make_scale("Messachse")
        file["acc"].dims[0].attach_scale(file["Messachse"])
    (signal,) = (each for each in read_file(tmp_path / "a.h5") if each.name == "acc")
    np.testing.assert_allclose(signal.on_si_axis(None, "").x, np.arange(20) / 100)


def test_two_axes_of_as_many_values_are_refused(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["time"], file["frequency"], file["acc"] = np.arange(20.0), np.arange(20.0), Y
    (signal,) = (each for each in read_file(tmp_path / "a.h5") if each.name == "acc")
    with pytest.raises(InputFileError, match="several axes of as many values as acc: frequency, time"):
        signal.check()


def test_characters_and_cells_of_matlab_7_3_are_no_channels(tmp_path):
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        for name, values, kind in (
            ("test/time_s", np.arange(20.0)[None] / 100, "double"),
            ("test/acc", Y[None], "double"),
            ("test/unit", np.frombuffer("m/s^2".encode("utf-16-le"), "u2")[:, None], "char"),
            ("test/note", np.frombuffer("hammer".encode("utf-16-le"), "u2")[:, None], "char"),
        ):
            file.create_dataset(name, data=values).attrs["MATLAB_class"] = np.bytes_(kind)
        file["test"].attrs["MATLAB_class"] = np.bytes_("struct")
    for name in ("a.mat", "b.h5"):
        (tmp_path / name).write_bytes((tmp_path / "a.mat").read_bytes())
        found = {each.name: each for each in read_file(tmp_path / name)}
        assert found.keys() == {"test.acc", "test.time_s"}
        assert found["test.acc"].unit == "m/s^2"
        np.testing.assert_array_equal(found["test.acc"].y, Y)


def test_each_record_has_the_units_before_it(tmp_path):
    labelled = {"values": (12, "Acceleration", "NONE")}
    before, first, second = channels(
        tmp_path, function(Y, name="a", **labelled), units(1.0), function(Y, name="b", **labelled), units(1e3),
        function(Y, name="c", **labelled),
    )  # fmt: skip
    assert [each.unit for each in (before, first, second)] == ["", "m/s^2", "mm/s^2"]


@pytest.mark.parametrize(
    ("fields", "unit"),
    [
        ({"values": (8, "", "NONE")}, "mm"),
        ({"values": (11, "", "NONE")}, "mm/s"),
        ({"values": (13, "", "NONE")}, "kN"),
        ({"values": (9, "", "NONE"), "direction": 5}, "kN mm"),
        ({"values": (12, "", "NONE"), "direction": -6}, "rad/s^2"),
        ({"values": (8, "", "NONE"), "direction": 4}, "rad"),
        ({"values": (15, "", "NONE")}, "kN/mm^2"),
        ({"values": (1, "", "NONE", 1, 1)}, "kN mm"),
        ({"values": (1, "", "NONE", -1, 1)}, "kN/mm"),
        ({"values": (0, "", "NONE")}, ""),
        ({"values": (12, "", "g")}, "g"),
    ],
)
def test_units_by_data_types_and_their_exponents(tmp_path, fields, unit):
    (signal,) = channels(tmp_path, units(1e3, 1e-3), function(Y, **fields))
    assert signal.unit == unit


@pytest.mark.parametrize(
    ("fields", "sign"),
    [
        ({"direction": -3}, -1.0),
        ({"direction": -1}, -1.0),
        ({"direction": -6, "values": (12, "", "rad/s^2")}, -1.0),
        ({"direction": 3}, 1.0),
        ({"direction": 0}, 1.0),
        ({"direction": -3, "kind": 4, "over": (13, "", "N"), "over_direction": 3, **OVER_FREQUENCY}, -1.0),
        ({"direction": -3, "kind": 4, "over": (13, "", "N"), "over_direction": -3, **OVER_FREQUENCY}, 1.0),
        ({"direction": 3, "kind": 4, "over": (13, "", "N"), "over_direction": -1, **OVER_FREQUENCY}, -1.0),
        ({"direction": -3, "kind": 12, **OVER_FREQUENCY}, -1.0),
    ],
)
def test_values_are_along_the_positive_direction(tmp_path, fields, sign):
    values = Y if fields.get("kind", 1) == 1 else Y * (1 + 1j)
    (signal,) = channels(tmp_path, function(values, **fields))
    np.testing.assert_allclose(signal.y, sign * values, rtol=1e-5)
    negative = [fields.get(key, 0) < 0 for key in ("direction", "over_direction")]
    assert any("sign of direction" in each for each in signal.scaling) == any(negative)


@pytest.mark.parametrize("kind", [2, 6, 9, 12, 24])
def test_magnitudes_have_no_sign(tmp_path, kind):
    (signal,) = channels(tmp_path, function(np.abs(Y), kind=kind, direction=-3, **OVER_FREQUENCY))
    np.testing.assert_allclose(signal.y, np.abs(Y), rtol=1e-5)


@pytest.mark.parametrize(
    ("count", "stored", "message"),
    [
        (20, Y[:17], "states 20 samples and has 17 .data set 58 in line 1.: it is truncated"),
        (18, Y, "states 18 samples and has 20"),
        (20, np.concatenate([Y, np.zeros(3), [1.0]]), "states 20 samples and has 24"),
    ],
)
def test_another_number_of_samples_than_stated_is_refused(tmp_path, count, stored, message):
    (tmp_path / "a.uff").write_text(function(stored, count=count))
    with pytest.raises(ScenarioError, match=message):
        read_record(SampledInput(kind="sampled", applied_to="base", file="a.uff"), tmp_path)


@pytest.mark.parametrize("zeros", [0, 4, 30])
def test_zeros_after_the_stated_samples_are_left_out(tmp_path, zeros):
    (signal,) = channels(tmp_path, function(np.concatenate([Y, np.zeros(zeros)]), count=20))
    assert signal.x.size == signal.y.size == 20
    assert any("zeros" in each for each in signal.scaling) == (zeros >= 6)


@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("cut", [8, 9, 100, 10**4])
def test_a_file_that_was_cut_is_refused(tmp_path, binary, cut):
    """pyuff leaves out the last data set where its end is missing."""
    whole = tmp_path / "whole.uff"
    record = {"type": 58, "func_type": 1, "rsp_node": 1, "rsp_dir": 3, "ref_node": 0, "ref_dir": 0, "binary": binary,
              "abscissa_spacing": 1, "abscissa_spec_data_type": 17, "ordinate_spec_data_type": 12,
              "ordinate_axis_units_lab": "g", "orddenom_spec_data_type": 0, "x": np.arange(2000) / 1e3,
              "data": np.sin(np.arange(2000.0))}  # fmt: skip
    for name in ("first", "second"):
        write(whole, {**record, "id1": name})
    (tmp_path / "a.uff").write_bytes(whole.read_bytes()[:-cut])
    with pytest.raises(InputFileError, match="ends within the data set that begins in line"):
        read_file(tmp_path / "a.uff")


def write(path, *sets):
    """Write data sets; pyuff leaves the closing of binary ones to Python."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)
        pyuff.UFF(str(path)).write_sets([*sets], "add")


@pytest.mark.parametrize("encoding", ["cp1252", "utf-8"])
def test_text_in_windows_1252_is_read(tmp_path, encoding):
    (signal,) = channels(
        tmp_path, function(Y, name="Rücken µ", values=(12, "Beschleunigung", "m/s²")), encoding=encoding
    )
    assert (signal.name, signal.unit) == ("Rücken µ", "m/s²")
    np.testing.assert_allclose(signal.y, Y, rtol=1e-5)


def test_exponents_of_fortran_are_read(tmp_path):
    """Also where a name has a D before a sign, which is none."""
    (signal,) = channels(tmp_path, function(Y, name="3D-1 beam").replace("E+", "D+").replace("E-", "D-"))
    np.testing.assert_allclose(signal.y, Y, rtol=1e-5)
    assert signal.name == "3D-1 beam"


def test_numbers_of_another_machine_are_refused(tmp_path):
    path = tmp_path / "a.uff"
    write(path, {"type": 58, "func_type": 1, "rsp_node": 1, "rsp_dir": 3, "ref_node": 0, "ref_dir": 0, "binary": 1,
                 "abscissa_spacing": 1, "abscissa_spec_data_type": 17, "ordinate_spec_data_type": 12,
                 "orddenom_spec_data_type": 0, "x": np.arange(20.0), "data": Y})  # fmt: skip
    header = b"58b     1     2"
    assert header in path.read_bytes()
    path.write_bytes(path.read_bytes().replace(header, b"58b     1     1"))
    (signal,) = read_file(path)
    with pytest.raises(InputFileError, match="numbers in a format of another machine"):
        signal.check()


def test_a_record_that_is_not_used_may_be_wrong(tmp_path):
    good, bad = channels(tmp_path, function(Y, name="good"), function(Y[:9], name="bad", count=20))
    np.testing.assert_allclose(good.on_si_axis(None, "").check().y, Y, rtol=1e-5)
    assert bad.fault is not None
    assert bad.fault[0].startswith("states 20 samples and has 9")
    assert TAG in (tmp_path / "a.uff").read_text()


def reactions(path, **attributes):
    """Three outputs of a result, of which the last is not known at any time."""
    with h5py.File(path, "w") as file:
        group = file.create_group("outputs")
        group["output"], group["time"] = np.array(["foot", "hinge", "none"], dtype=object), np.arange(20) / 100
        group["time"].attrs["units"] = "s"
        group["value"] = np.array([Y, 2 * Y, np.nan * Y])
        for axis, name in enumerate(("output", "time")):
            group[name].make_scale(name)
            group["value"].dims[axis].attach_scale(group[name])
        of_each = {
            "units": "see units_of_each",
            "units_of_each": '["N", "N m", "N"]',
            "absent": str(list(range(40, 60))),
        }
        group["value"].attrs.update(of_each | attributes)
    return {each.name: each for each in read_file(path) if each.name.endswith("value")}


def test_rows_of_a_result_have_units_of_their_own(tmp_path):
    signals = reactions(tmp_path / "a.h5")
    assert {name: each.unit for name, each in signals.items()} == {"foot value": "N", "hinge value": "N m"}
    np.testing.assert_array_equal(signals["hinge value"].y, 2 * Y)


@pytest.mark.parametrize("given", ['["N"]', "N", '{"foot": "N"}', "[1, 2, 3]", "[[]]"])
def test_units_of_rows_that_are_not_listed_are_damage(tmp_path, given):
    with pytest.raises(InputFileError, match=r"is damaged .units_of_each of"):
        reactions(tmp_path / "a.h5", units_of_each=given)
