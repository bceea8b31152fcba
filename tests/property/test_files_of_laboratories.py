"""Arrays and records that other libraries write are read back the same, or refused.

Each file is written from values in SI units by pyuff, h5py, xarray and h5netcdf, or SciPy, in units, signs, packings
and function types at random; what is read in SI units must be these values within the digits of the file.
"""

import warnings

import h5netcdf  # noqa: F401 - imported here so that no test takes the time
import h5py
import numpy as np
import pytest
import pyuff
import scipy.io
import xarray
from hypothesis import given, settings
from hypothesis import strategies as st

from beamsim.errors import InputFileError, ScenarioError
from beamsim.measurements.functions import FunctionType
from beamsim.measurements.read import read_file
from beamsim.measurements.signal import in_si
from beamsim.scenario.units import ACCELERATION

pytestmark = [pytest.mark.quick, pytest.mark.portable]

G = 9.80665
SIZES = {"m/s^2": 1.0, "g": G, "mm/s^2": 1e-3, "m/s²": 1.0, "cm/s2": 1e-2, "m s-2": 1.0, "in/s^2": 0.0254}
"""SI values of units of an acceleration, as files spell them."""
SEED = st.integers(0, 2**16)


def record(seed, count=37):
    """Times, s, and accelerations, m/s^2, of one to three significant places."""
    rng = np.random.default_rng(seed)
    return np.arange(count) / 512.0, rng.normal(size=count) * 10.0 ** rng.integers(-2, 3)


def history(path, name):
    """The time history of a name in SI units."""
    (signal,) = (each for each in read_file(path) if each.name == name)
    signal = signal.require((FunctionType.TIME_HISTORY,), "a test").on_si_axis(None, "axis_unit").check()
    return in_si(signal, None, ACCELERATION, "unit")


@st.composite
def uff_records(draw):
    """A record of data set 58, the SI value of its unit and its sign."""
    code, label = draw(st.sampled_from([(0, each) for each in SIZES] + [(12, "NONE")]))
    kind = draw(st.sampled_from([0, 1, 2, 3, 4, 6, 9]))
    direction = draw(st.sampled_from([-3, -2, -1, 0, 1, 2, 3]))
    options = {
        "func_type": kind,
        "rsp_dir": direction,
        "ordinate_spec_data_type": code or 12,
        "ordinate_axis_units_lab": label,
        "binary": draw(st.integers(0, 1)),
        "abscissa_spacing": draw(st.integers(0, 1)),
    }
    return options, SIZES.get(label), -1.0 if direction < 0 else 1.0, draw(st.booleans())


def written_by_pyuff(path, *sets):
    """Add data sets to a file; pyuff leaves the closing of binary ones to Python."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)
        pyuff.UFF(str(path)).write_sets([*sets], "add")


@settings(max_examples=25, deadline=None, derandomize=True)
@given(records=st.lists(uff_records(), min_size=1, max_size=3), lengths=st.data(), seed=SEED)
def test_records_that_pyuff_writes(tmp_path_factory, records, lengths, seed):
    path = tmp_path_factory.mktemp("uff") / "a.uff"
    expected, per_metre = [], None
    for number, (options, size, sign, new_units) in enumerate(records):
        if new_units:
            per_metre = lengths.draw(st.sampled_from([1.0, 1e3, 1 / 0.0254]))
            written_by_pyuff(
                path,
                pyuff.prepare_164(
                    units_code=9, units_description="any", temp_mode=1, length=per_metre, force=1.0, temp=1.0,
                    temp_offset=0.0,
                ),
            )  # fmt: skip
        if size is None and per_metre is not None:
            size = 1.0 / per_metre
        time, values = record(seed + number)
        written_by_pyuff(
            path,
            {
                "type": 58, "id1": f"c{number}", "rsp_node": 1, "ref_node": 0, "ref_dir": 0,
                "abscissa_spec_data_type": 17, "orddenom_spec_data_type": 0, "x": time,
                "data": sign * values / (size or 1.0), **options,
            },
        )  # fmt: skip
        expected.append((f"c{number}", values, size, options["func_type"]))
    for name, values, size, kind in expected:
        if kind not in (0, 1) or size is None:
            with pytest.raises((InputFileError, ScenarioError)):
                history(path, name)
            continue
        signal = history(path, name)
        np.testing.assert_allclose(signal.y, values, rtol=1e-10, atol=1e-9 * np.abs(values).max())
        np.testing.assert_allclose(signal.x, np.arange(values.size) / 512.0, atol=1e-6)


PACKINGS = ("float64", "float32", "int16", "int32", "uint8 signed", ">f4")


def packed(values, packing):
    """Stored numbers, attributes, and the largest error that packing leaves."""
    if packing in ("float64", "float32", ">f4"):
        return values.astype(packing), {}, 1e-6 * np.abs(values).max()
    bits = 8 if "8" in packing else int(packing[3:])
    offset, scale = 0.5 * float(values.min() + values.max()), float(np.ptp(values)) / (2**bits - 4)
    numbers = np.round((values - offset) / scale)
    if packing == "uint8 signed":  # as netCDF-3 stores bytes without a sign
        lowest = float(values.min())
        numbers = np.round((values - lowest) / scale)
        stored = numbers.astype("u1").view("i1")
        return stored, {"scale_factor": scale, "add_offset": lowest, "_Unsigned": "true"}, scale
    return numbers.astype(packing), {"scale_factor": scale, "add_offset": offset}, scale


def as_attribute(text, form):
    """A unit as Python, C, MATLAB and Fortran programs write it."""
    return {
        "text": text,
        "bytes": np.bytes_(text.encode("utf-8")),
        "windows": np.bytes_(text.encode("cp1252")),
        "padded": np.bytes_(text.encode("utf-8").ljust(16, b" ")),
        "array of bytes": np.array([text.encode("utf-8")]),
        "array of text": np.array([text], dtype=object),
        "characters": np.array([*text.encode("ascii", "ignore").decode()], dtype="S1"),
    }[form]


@settings(max_examples=12, deadline=None, derandomize=True)
@given(
    unit=st.sampled_from([*SIZES]),
    key=st.sampled_from(["unit", "units", "Units", "UNITS", "Unit"]),
    form=st.sampled_from(["text", "bytes", "windows", "padded", "array of bytes", "array of text"]),
    packing=st.sampled_from(PACKINGS),
    folder=st.sampled_from(["", "run 1/", "a/b/"]),
    axis=st.sampled_from([("time", "s", 1.0), ("t", "ms", 1e3), ("Time", "seconds", 1.0), ("zeit", "us", 1e6)]),
    attached=st.booleans(),
    seed=SEED,
)
def test_arrays_that_h5py_writes(tmp_path_factory, unit, key, form, packing, folder, axis, attached, seed):
    time, values = record(seed)
    stored, attributes, error = packed(values / SIZES[unit], packing)
    path = tmp_path_factory.mktemp("h5") / "a.h5"
    with h5py.File(path, "w") as file:
        channel = file.create_dataset(f"{folder}acc", data=stored)
        times = file.create_dataset(f"{folder}{axis[0]}", data=time * axis[2])
        for name, value in attributes.items():
            channel.attrs[name] = value
        channel.attrs[key], times.attrs[key] = as_attribute(unit, form), as_attribute(axis[1], form)
        if attached:
            times.make_scale(axis[0])
            channel.dims[0].attach_scale(times)
    signal = history(path, f"{folder}acc".replace("/", " "))
    np.testing.assert_allclose(signal.y, values, atol=1.01 * error * SIZES[unit])
    np.testing.assert_allclose(signal.x, time, atol=1e-12)
    assert any("scale_factor" in each for each in signal.scaling) == ("scale_factor" in attributes)


@settings(max_examples=8, deadline=None, derandomize=True)
@given(
    unit=st.sampled_from([*SIZES]),
    packing=st.sampled_from(["float64", "float32", "int16"]),
    missing=st.booleans(),
    dates=st.sampled_from(["", "seconds", "milliseconds", "nanoseconds"]),
    seed=SEED,
)
def test_files_that_xarray_writes(tmp_path_factory, unit, packing, missing, dates, seed):
    time, values = record(seed)
    written = values.copy()
    if missing:
        written[5] = np.nan
    axis = ("time", time, {"units": "s"})
    encoding = {}
    if dates:
        axis = ("time", np.datetime64("2024-11-28T10:00:00", "ns") + (time * 1e9).astype("timedelta64[ns]"))
        encoding["time"] = {"units": f"{dates} since 2024-11-28", "dtype": "f8" if dates != "nanoseconds" else "i8"}
    scale = float(np.ptp(values)) / 2**15 / SIZES[unit]
    if packing == "int16":
        middle = 0.5 * float(values.min() + values.max()) / SIZES[unit]
        encoding["acc"] = {"dtype": "i2", "scale_factor": scale, "add_offset": middle, "_FillValue": -(2**15)}
    else:
        encoding["acc"] = {"dtype": packing}
    path = tmp_path_factory.mktemp("nc") / "a.nc"
    data = xarray.DataArray(written / SIZES[unit], dims="time", coords={"time": axis}, attrs={"units": unit})
    xarray.Dataset({"acc": data}).to_netcdf(path, engine="h5netcdf", encoding=encoding)
    if missing:
        with pytest.raises(InputFileError, match="1 values that are not finite, the first at sample 6"):
            history(path, "acc")
        return
    signal = history(path, "acc")
    np.testing.assert_allclose(signal.y, values, atol=max(1.01 * scale * SIZES[unit], 1e-6 * np.abs(values).max()))
    np.testing.assert_allclose(signal.x, time, atol=2e-8)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(
    unit=st.sampled_from([each for each in SIZES if each.isascii()]),
    place=st.sampled_from(["top", "struct", "nested"]),
    column=st.booleans(),
    where=st.sampled_from(["beside", "in the struct", "nowhere"]),
    seed=SEED,
)
def test_structs_that_scipy_writes(tmp_path_factory, unit, place, column, where, seed):
    time, values = record(seed)
    fields = {"time_s": time, "acc": (values / SIZES[unit])[:, None] if column else values / SIZES[unit]}
    if where == "beside":
        fields["acc_unit"] = unit
    elif where == "in the struct":
        fields["unit"] = unit
    name = {"top": "acc", "struct": "test.acc", "nested": "test.run.acc"}[place]
    content = {"top": fields, "struct": {"test": fields}, "nested": {"test": {"run": fields}}}[place]
    path = tmp_path_factory.mktemp("mat") / "a.mat"
    scipy.io.savemat(path, content)
    if where == "nowhere" or (where == "in the struct" and place == "top"):
        with pytest.raises(ScenarioError, match="states no unit of"):
            history(path, name)
        return
    signal = history(path, name)
    np.testing.assert_allclose(signal.y, values, rtol=1e-12)
    np.testing.assert_allclose(signal.x, time, rtol=1e-12)
