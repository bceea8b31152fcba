"""Files of data acquisition systems (TDMS, MDF, LVM, netCDF-3): what their libraries write or ship is read as it is."""

import json
import subprocess
import sys
from pathlib import Path

import asammdf
import lvm_read  # noqa: F401 - imported here so that no test takes the time
import nptdms
import numpy as np
import pytest
import xarray

import beamsim
from beamsim.errors import BeamsimError, InputFileError, ScenarioError
from beamsim.measurements.channels import channel_named, read_signals
from beamsim.measurements.read import read_file
from beamsim.measurements.signal import in_si
from beamsim.scenario.units import FORCE, LENGTH
from tests.helpers.commands import invoke

pytestmark = pytest.mark.portable

SHIPPED = Path(nptdms.__file__).parent / "test" / "data"
START = np.datetime64("2026-01-02T03:04:05")
TIME = np.arange(64) / 256.0
ACCELERATION = np.round(3.0 * np.sin(2 * np.pi * 7.0 * TIME), 3)  # g
G = 9.80665


def by_name(path):
    return {signal.name: signal for signal in read_file(path)}


def write_tdms(path, *channels):
    """Write channels (group, name, values, properties) in two segments each, as a running acquisition does."""
    with nptdms.TdmsWriter(path) as file:
        for half in (0, 1):
            parts = [np.array_split(values, 2)[half] for _, _, values, _ in channels]
            objects = zip(channels, parts, strict=True)
            file.write_segment([nptdms.ChannelObject(g, n, part, about) for (g, n, _, about), part in objects])


def write_mdf(path, *groups, version="4.10"):
    """Write groups (name, signals)."""
    with asammdf.MDF(version=version) as file:
        for name, signals in groups:
            file.append(signals, acq_name=name)
        file.save(path)


def lvm_text(columns, decimal=".", x_columns="No", samples=None, header=True, step=1 / 256):
    """An LVM file of columns {name: (unit, values)} at one rate, in the layout that LabVIEW writes."""
    count = len(columns)
    per = 2 if x_columns == "Multi" else 1
    gap = "\t" * per
    first = {
        "Writer_Version": 2, "Separator": "Tab", "Decimal_Separator": decimal, "X_Columns": x_columns,
        "Time_Pref": "Relative",
    }  # fmt: skip
    lines = ["LabVIEW Measurement\t", *(f"{key}\t{value}" for key, value in first.items())] if header else []
    lines += ["***End_of_Header***\t", "\t"] if header else []
    units, values = [unit for unit, _ in columns.values()], [each for _, each in columns.values()]
    about = {
        "Samples": samples or [len(each) for each in values], "Y_Unit_Label": units, "X_Dimension": ["Time"] * count,
        "X0": ["0.0"] * count, "Delta_X": [f"{step:.6E}"] * count,
    }  # fmt: skip
    lines += [f"Channels\t{count}{gap * count}", *(f"{key}\t{gap.join(map(str, of))}\t" for key, of in about.items())]
    heads = {"No": ["X_Value", *columns], "One": ["X_Value", *columns]}
    heads["Multi"] = [each for name in columns for each in ("X_Value", name)]
    lines += ["***End_of_Header***\t", "\t".join([*heads[x_columns], "Comment"])]
    for k in range(max(map(len, values))):
        cells, time = [], f"{k * step:.6f}"
        for each in values:
            cells += [time if k < len(each) else ""] * (x_columns == "Multi")
            cells.append(f"{each[k]:.6f}" if k < len(each) else "")
        lines.append("\t".join([{"No": "", "One": time}.get(x_columns, ""), *cells][x_columns == "Multi" :]))
    return "\n".join(lines).replace(".", decimal) + "\n"


def test_tdms_has_groups_scaling_units_and_one_origin_of_time(tmp_path):
    linear = {
        "NI_Number_Of_Scales": 1, "NI_Scaling_Status": "unscaled", "NI_Scale[0]_Scale_Type": "Linear",
        "NI_Scale[0]_Linear_Slope": 0.5, "NI_Scale[0]_Linear_Y_Intercept": 1.0,
        "NI_Scale[0]_Linear_Input_Source": np.uint32(0xFFFFFFFF),
    }  # fmt: skip
    counts = np.arange(40, dtype="i2")
    fast = {"wf_increment": 0.01, "wf_start_time": START, "unit_string": "g", **linear}
    slow = {"wf_increment": 0.5, "wf_start_time": START + np.timedelta64(250, "ms"), "wf_start_offset": 1.0}
    path = tmp_path / "a.tdms"
    write_tdms(path, ("bench", "acc", counts, fast), ("bench", "x", np.ones(8), slow), ("tank", "x", np.ones(6), slow))
    found = by_name(path)
    assert list(found) == ["acc", "bench x", "tank x"]
    np.testing.assert_allclose(found["acc"].y, 0.5 * counts + 1.0)
    np.testing.assert_allclose(found["acc"].x, 0.01 * np.arange(40))
    assert found["acc"].unit == "g"
    assert "NI_Scale" in found["acc"].description
    np.testing.assert_allclose(found["tank x"].x, 1.25 + 0.5 * np.arange(6))


def test_tdms_has_its_times_in_a_channel_of_the_group(tmp_path):
    path = tmp_path / "a.tdms"
    stamps = START + np.round(1e6 * TIME).astype("m8[us]")
    about = {"unit_string": "mm"}
    write_tdms(
        path,
        ("by number", "Time", TIME, {"unit_string": "s"}), ("by number", "way", TIME**2, about),
        ("by clock", "Timestamp", stamps, {}), ("by clock", "force", TIME**3, {"unit_string": "kN"}),
    )  # fmt: skip
    found = {signal.name: signal for signal in read_signals(path)}
    assert set(found) == {"way", "force"}
    for name, power in (("way", 2), ("force", 3)):
        np.testing.assert_allclose(found[name].x, TIME, atol=1e-6)
        np.testing.assert_allclose(found[name].y, TIME**power)


def test_tdms_that_its_package_ships():
    """Files of LabVIEW: the sine of one is a closed form, and the raw counts of the other have their NI scaling."""
    found = by_name(SHIPPED / "big_endian.tdms")
    first = found["Phase sweep"].last(None)
    assert (first.x[1], first.axis_unit, first.y.size) == (pytest.approx(0.001), "s", 3500)
    np.testing.assert_allclose(first.y[:500], np.sin(2 * np.pi * 10.1 * first.x[:500]), atol=1e-9)
    scaled = by_name(SHIPPED / "raw1.tdms")["First  Channel"]
    slope = 0.0003051850947599719
    np.testing.assert_allclose(scaled.y / slope, np.round(scaled.y / slope), atol=1e-9)
    assert scaled.x[1] == pytest.approx(2e-5)
    assert scaled.unit == "Volts"


def test_mdf_has_conversions_invalid_samples_rates_and_masters(tmp_path):
    counts, invalid = np.arange(5, dtype="i2"), np.array([0, 0, 1, 0, 0], dtype=bool)
    signals = [
        asammdf.Signal(counts, TIME[:5], "g", "acc", conversion={"a": 0.5, "b": 1.0}, invalidation_bits=invalid),
        asammdf.Signal(np.array([b"off", b"on", b"on", b"on", b"off"]), TIME[:5], "", "state", encoding="utf-8"),
    ]
    slow = asammdf.Signal(np.arange(7.0), 2.0 + np.arange(7) / 3.0, "mm", "way")
    again = asammdf.Signal(np.arange(3.0), np.arange(3) / 2.0, "mm", "way")
    angle = asammdf.Signal(np.arange(4.0), np.arange(4) * 1.0, "N", "force", master_metadata=("angle", 2))
    path = tmp_path / "a.mf4"
    write_mdf(path, ("bench", signals), ("slow", [slow]), ("again", [again]), ("crank", [angle]))
    signals = read_signals(path)
    found = {signal.name: signal for signal in signals}
    assert list(found) == ["acc", "slow way", "again way", "force"]
    np.testing.assert_allclose(found["acc"].y, [1.0, 1.5, np.nan, 2.5, 3.0])
    np.testing.assert_allclose(found["acc"].x, TIME[:5])
    np.testing.assert_allclose(found["slow way"].x, 2.0 + np.arange(7) / 3.0)
    assert found["again way"].axis_unit == "s"
    assert "converted" in found["acc"].description
    with pytest.raises(ScenarioError, match="has 1 values that are not finite, the first at sample 3"):
        channel_named(signals, "acc", "", path, required=True)
    with pytest.raises(ScenarioError, match=r"force is over angle \(deg\), not over time"):
        channel_named(signals, "force", "", path, required=True)


def test_mdf_3_is_read_too_with_its_usual_ending(tmp_path):
    path = tmp_path / "a.dat"
    write_mdf(tmp_path / "a.mdf", ("bench", [asammdf.Signal(ACCELERATION, TIME, "g", "acc")]), version="3.30")
    (tmp_path / "a.mdf").rename(path)
    (signal,) = read_signals(path)
    np.testing.assert_allclose(signal.y, ACCELERATION)
    np.testing.assert_allclose(signal.x, TIME)


@pytest.mark.parametrize("x_columns", ["No", "One", "Multi"])
@pytest.mark.parametrize("decimal", [".", ","])
def test_lvm_in_its_layouts(x_columns, decimal, tmp_path):
    path = tmp_path / "a.lvm"
    columns = {"acc": ("g", ACCELERATION), "way": ("mm", ACCELERATION[:50] / 8)}
    path.write_text(lvm_text(columns, decimal, x_columns))
    found = {signal.name: signal for signal in read_signals(path)}
    assert {name: signal.unit for name, signal in found.items()} == {"acc": "g", "way": "mm"}
    np.testing.assert_allclose(found["acc"].x, TIME, atol=1e-6)
    np.testing.assert_allclose(found["acc"].y, ACCELERATION, atol=1e-6)
    np.testing.assert_allclose(found["way"].y, ACCELERATION[:50] / 8, atol=1e-6)


def test_units_that_labview_spells_out(tmp_path):
    path = tmp_path / "a.lvm"
    path.write_text(lvm_text({"cell": ("Newtons", ACCELERATION), "way": ("Inches", ACCELERATION)}))
    found = {signal.name: signal for signal in read_signals(path)}
    assert in_si(found["cell"], None, FORCE, "unit").y == pytest.approx(ACCELERATION)
    assert in_si(found["way"], None, LENGTH, "unit").y == pytest.approx(0.0254 * ACCELERATION)


def test_lvm_has_a_record_for_each_segment_and_each_header(tmp_path):
    path = tmp_path / "a.lvm"
    one = {"acc": ("g", ACCELERATION)}
    path.write_text(lvm_text(one) + "\n" + lvm_text(one, header=False) + "\n\n" + lvm_text(one, ",") + "\n\n")
    found = by_name(path)
    assert list(found) == [f"segment {number} acc" for number in (1, 2, 3)]
    for signal in found.values():
        np.testing.assert_allclose(signal.y, ACCELERATION, atol=1e-6)


def test_netcdf_3_is_read_as_netcdf_4(tmp_path):
    time = xarray.Variable("time", TIME, {"units": "s"})
    counts = np.arange(64, dtype="i2")
    counts[5] = -1
    data = xarray.Dataset(
        {
            "acc": ("time", counts, {"units": "m s-2", "scale_factor": 0.5, "missing_value": np.int16(-1)}),
            "plate": (("sensor", "time"), np.arange(128.0).reshape(2, 64), {"units": "mm"}),
        },
        {"time": time, "sensor": ["tip", "middle"]},
    )
    found = []
    for engine in ("scipy", "h5netcdf"):
        path = tmp_path / f"{engine}.nc"
        data.to_netcdf(path, engine=engine)
        found.append(by_name(path))
    old, new = found
    assert set(old) == set(new) == {"time", "acc", "tip plate", "middle plate"}
    assert np.isnan(old["acc"].y[5])
    for name, signal in old.items():
        np.testing.assert_allclose(signal.y, new[name].y)
        np.testing.assert_allclose(signal.x, new[name].x)
        assert (signal.unit, signal.axis, signal.scaling) == (new[name].unit, new[name].axis, new[name].scaling)


def _cut(path, share):
    raw = path.read_bytes()
    path.write_bytes(raw[: int(share * len(raw))])


@pytest.mark.parametrize("ending", [".tdms", ".mf4", ".lvm", ".nc"])
def test_files_that_end_too_early_are_refused(ending, tmp_path):
    path = write_record(tmp_path, ending)
    _cut(path, 0.8)
    with pytest.raises(BeamsimError) as caught:
        read_signals(path)
    assert caught.value.exit_code == 2
    assert "export it again" in str(caught.value)


@pytest.mark.parametrize(
    ("ending", "module", "package"),
    [
        (".tdms", "nptdms", "npTDMS"),
        (".mf4", "asammdf", "asammdf"),
        (".lvm", "lvm_read", "lvm_read"),
        (".nc", "xarray", "xarray"),
    ],
)
def test_a_missing_library_is_named_with_its_extra(ending, module, package, tmp_path, monkeypatch):
    path = write_record(tmp_path, ending)
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(InputFileError, match=rf"{package} is needed; pip install 'beamsim\[lab\]'"):
        read_file(path)


def test_no_library_is_loaded_before_such_a_file_is_read():
    code = "import sys, beamsim.cli.app, beamsim.measurements.read, beamsim.analyses.compare.analysis as _; "
    code += "sys.exit(bool({'nptdms', 'asammdf', 'lvm_read', 'xarray', 'pandas'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def write_record(folder, ending):
    """The acceleration in a file of a format, the channel ``acc`` in g over times in s."""
    path = folder / f"record{ending}"
    if ending == ".csv":
        path.write_text("time (s),acc (g)\n" + "".join(f"{t},{a}\n" for t, a in zip(TIME, ACCELERATION, strict=True)))
    elif ending == ".tdms":
        write_tdms(path, ("bench", "acc", ACCELERATION, {"wf_increment": 1 / 256, "unit_string": "g"}))
    elif ending == ".mf4":
        write_mdf(path, ("bench", [asammdf.Signal(ACCELERATION, TIME, "g", "acc")]))
    elif ending == ".lvm":
        path.write_text(lvm_text({"acc": ("g", ACCELERATION)}, step=1 / 256))
    else:
        time = xarray.Variable("time", TIME, {"units": "s"})
        acc = xarray.Variable("time", ACCELERATION, {"units": "g"})
        xarray.Dataset({"acc": acc}, {"time": time}).to_netcdf(path, engine="scipy")
    return path


CASE = """
chain: {masses: [1 kg], springs: [1 kN/m], snubbers: [{name: stop, mass: 1, side: below, stiffness: 5 kN/m, gap: 1 mm}]}
probes: [{name: mass, mass: 1}]
"""
RUN = """
excitation: {kind: sampled, applied_to: base, file: FILE, column: acc}
run: {start: rest, duration: 0.2 s, sample_rate: 1 kHz}
"""
IDENTIFICATION = """
excitation: {kind: harmonic, applied_to: base, level: 1 g, frequency: 7 Hz}
identify_stiffness:
  snubber: stop
  nonlinear:
    estimate: [chain.snubbers.stop.stiffness]
    tests: [{file: FILE, channel: acc, frequency: 7 Hz, probe: mass}]
"""


@pytest.mark.parametrize("ending", [".tdms", ".mf4", ".lvm", ".nc"])
def test_every_format_excites_is_compared_and_identifies_like_csv(ending, tmp_path):
    found = []
    for each in (".csv", ending):
        path = write_record(tmp_path, each)
        for name, section in (("run", RUN), ("identification", IDENTIFICATION)):
            (tmp_path / f"{name}.yaml").write_text((CASE + section).replace("FILE", path.name))
        result = beamsim.run(tmp_path / "run.yaml")
        moved = np.asarray(result["histories"]["displacement"])
        choice = beamsim.ChannelChoice(place="mass", channel="acc", quantity="absolute_acceleration")
        ((_, _, measured),) = beamsim.pair_channels(result, path, choice)
        (test,) = beamsim.read_tests(tmp_path / "identification.yaml")
        found.append((moved, measured.y, test.y))
    for one, other in zip(*found, strict=True):
        np.testing.assert_allclose(other, one, atol=1e-6 * np.abs(one).max())


@pytest.mark.parametrize("ending", [".csv", ".tdms", ".lvm", ".nc"])
def test_info_lists_the_channels_of_a_record(ending, tmp_path):
    path = write_record(tmp_path, ending)
    printed = invoke("info", path)
    assert printed.exit_code == 0
    assert "g, 64 samples over" in printed.output
    assert "256 Hz" in printed.output
    channels = json.loads(invoke("info", path, "--json").stdout)["channels"]
    (acc,) = (channel for channel in channels if channel["name"].startswith("acc"))
    assert (acc["unit"], acc["samples"], acc["missing"], acc["function"]) == ("g", 64, 0, "time history")
    assert acc["samples_per_axis_unit"] == pytest.approx(256.0, rel=1e-4)


def test_info_of_a_record_that_cannot_be_read_names_it(tmp_path):
    path = tmp_path / "a.lvm"
    path.write_text("time,acc\n0,1\n")
    done = invoke("info", path)
    assert done.exit_code == 2
    assert f"{path} does not begin with LabVIEW Measurement" in done.output


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("a.mf4", "does not begin as an MDF file"),
        ("a.tdms", "cannot be read as TDMS"),
        ("a.lvm", "does not begin with LabVIEW Measurement"),
        ("text.tdms", "has no channel of numbers"),
    ],
)
def test_what_is_no_such_file_is_refused(name, message, tmp_path):
    path = tmp_path / name
    path.write_text("time (s),acc (g)\n0,1\n1,2\n")
    if name.startswith("text"):
        write_tdms(path, ("bench", "note", np.array(["a", "b"]), {}))
    with pytest.raises(ScenarioError, match=message) as caught:
        read_signals(path)
    assert "export" in str(caught.value)
