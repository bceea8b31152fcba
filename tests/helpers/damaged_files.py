"""Sound files of every format that is read, seeded damage to them, and what comes of reading each.

`python -m tests.helpers.damaged_files FIRST FORMAT:COUNT...` reads damaged files in its own process and prints a line
for each, within 5 GB and 30 s a file; `outcomes` starts it again behind a file that ends it.
"""

import gzip
import os
import signal
import struct
import subprocess
import sys
import tempfile
import warnings
from collections import Counter
from functools import cache
from pathlib import Path

import h5netcdf
import h5py
import numpy as np
import pyuff
import xarray
from asammdf import MDF, Signal
from nptdms import ChannelObject, TdmsWriter
from scipy.io import mmwrite, savemat
from scipy.sparse import csc_array, save_npz

from beamsim.analyses.compare_modes.analysis import read_shapes
from beamsim.analyses.identify.records import sweeps_of
from beamsim.errors import BeamsimError
from beamsim.hdf5 import examine
from beamsim.inputs.measured import limit_curve, read_density, read_profile, target_curve
from beamsim.matrix_files import read_matrices, write_matrices
from beamsim.measurements.channels import read_signals
from beamsim.measurements.mdf import convert
from beamsim.measurements.read import read_file
from beamsim.scenario import Scenario, load_scenario
from beamsim.scenario.files import CurveFile
from beamsim.store.results import load
from beamsim.structures.named_matrices import read_dof_table
from beamsim.system.force_tables import force_tables
from tests.helpers.universal_files import function, nodes_2411, shapes_55, units

MATRIX = csc_array(np.diag([2.0, 3.0, 4.0, 5.0]) + np.diag([-1.0, -1.0, -1.5], 1) + np.diag([-1.0, -1.0, -1.5], -1))
TIME = np.arange(20) / 100
DMIG = """DMIG    K       0       6       1       0
DMIG    K       1       1               1       1       2.0
        1       3       -1.0
DMIG    K       1       3               1       3       3.0
"""
HARWELL_BOEING = """title                                                                   key
             3             1             1             1             0
RUA                        2             2             3             0
(3I8)           (3I8)           (3E20.12)
       1       3       4
       1       2       2
  2.000000000000E+00 -1.000000000000E+00  3.000000000000E+00
"""
ABAQUS = "*MATRIX INPUT\n1,1,1,1,2.0\n1,1,2,1,-1.0\n2,1,2,1,3.0\n"
DOFS = "node,direction,x (mm),y (mm),z (mm)\n" + "".join(f"{n},z,{n}.5,0,0\n" for n in range(1, 9))
SCENARIO = """# a beam with a stop
title: small
beam: {length: 270 mm, width: 50 mm, thickness: 5 mm, youngs_modulus: 69 GPa, density: 2700 kg/m^3, elements: 6}
snubbers:
- &stop {name: tip, position: 270 mm, side: below, stiffness: 20 kN/m, gap: 0.1 mm}
- {<<: *stop, name: middle, position: 50 %}
excitation: {kind: harmonic, applied_to: base, level: 2 g, frequency: 65 Hz}
probes: [{name: end, position: 100 %}]
run: {duration: 0.1 s, sample_rate: 2 kHz}
limits: {peak_force: 2 kN}
vary: {kind: grid, parameters: [{path: snubbers.tip.gap, values: [0.1 mm, 0.2 mm]}]}
"""
LIMITS = "frequency (Hz),level (g)\n" + "".join(f"{f},{5 + f / 100}\n" for f in (20, 50, 50, 200, 800, 2000))
TARGET = "frequency (Hz);level (g)\n" + "".join(f"{f},5;{level},2561\n" for f, level in ((20, 3), (50, 4), (200, 9)))
PROFILE = "frequency (Hz)  level (g)\n" + "".join(f"{f} {5 + f / 100}\n" for f in (20, 50, 200, 800))
DENSITY = "frequency (Hz)\tPSD (g^2/Hz)\n" + "".join(f"{f}\t{1 / f:.4f}\n" for f in (20, 50, 50, 200, 800, 1900))
STOP = "time (s),deflection (mm),force (N)\n" + "".join(
    f"{t:.2f},{2 * np.sin(t):.4f},{40 * np.sin(t) + 9 * np.sin(t) ** 3:.4f}\n" for t in np.arange(0.0, 1.5, 0.1)
)
SHAPES = "position (mm),10.5 Hz,70.2 Hz\n" + "".join(f"{x},{x**2},{x * (200 - x)}+0.1j\n" for x in range(0, 280, 30))
SWEEPS = "level (g),direction,jump (Hz),frequency (Hz),absolute_acceleration (g)\n" + "".join(
    f"{level},{way},{60 + level},{61 + level},{9 * level}\n" for level in (1, 2, 4) for way in ("up", "down")
)


LVM = """LabVIEW Measurement\t
Writer_Version\t2
Reader_Version\t2
Separator\tTab
Decimal_Separator\t.
Multi_Headings\tNo
X_Columns\tNo
Time_Pref\tRelative
***End_of_Header***\t
\t
Channels\t2\t\t
Samples\t20\t20\t
Y_Unit_Label\tg\tmm\t
X_Dimension\tTime\tTime\t
X0\t0.0\t0.0\t
Delta_X\t0.010000\t0.010000\t
***End_of_Header***\t\t\t
X_Value\ta\tway\tComment
"""


@cache
def _beam():
    return load_scenario(SCENARIO)


def _read_limits(path):
    case = load_scenario(_beam(), {"limits": {"srs": {"end": str(path)}}, "run.srs": {"from": 10.0, "to": 1e3}})
    return limit_curve(case, "srs", "end", "absolute_acceleration", np.array([30.0, 50.0, 400.0]))


def _read_target(path):
    matched = {"kind": "matched", "applied_to": "base", "srs": {"file": str(path)}, "duration": "1 s"}
    return target_curve(_chain(excitation=matched).excitation)


def _read_density(path):
    random = {"kind": "random", "applied_to": "base", "psd": {"file": str(path)}, "seed": 1}
    case = _chain(excitation=random)
    return read_density(case.excitation, case.excitation.psd)


def _read_stop(path):
    """The curve of a stop: the measured points themselves, and a line of three segments through them."""
    for curve in ({"file": str(path)}, {"file": str(path), "fit": {"segments": 3}}):
        stop = {"name": "stop", "mass": 1, "side": "below", "gap": 1e-3, "force_deflection": curve}
        force_tables(_chain(snubbers=[stop]))


def _chain(snubbers=(), **sections):
    chain = {"masses": [1.0], "springs": [1e3], "snubbers": [*snubbers]}
    run = {"duration": 1.0, "sample_rate": 8000.0}
    return Scenario.model_validate({"chain": chain, "run": run, **sections})


@cache
def _sweeps_of(name):
    """The test of a scenario that reads a file of sweeps."""
    test = {"name": "lab", "kind": "sweep", "file": name, "from": 7, "to": 1600, "scatter": 0.02}
    fit = {"estimate": ["snubbers.tip.stiffness"], "tests": [test]}
    case = load_scenario(_beam(), {"identify_stiffness": {"snubber": "tip", "nonlinear": fit}})
    return case.identify_stiffness.nonlinear.tests[0]


def _read_sweeps(path):
    return sweeps_of(_sweeps_of(path.name), path.parent, ["end"])


def _csv(path):
    path.write_text("time (s),a (g)\n" + "".join(f"{t},{np.sin(9 * t):.6f}\n" for t in TIME))


def _hdf5(path):
    with h5py.File(path, "w") as file:
        time = file.create_dataset("time", data=TIME)
        time.make_scale("time")
        a = file.create_dataset("group/a", data=np.sin(9 * TIME), chunks=(10,), compression="gzip")
        a.dims[0].attach_scale(time)
        a.attrs["units"], time.attrs["units"] = "m/s^2", "s"


def _mat73(path):
    with h5py.File(path, "w") as file:
        group = file.create_group("K")
        group.attrs["MATLAB_class"], group.attrs["MATLAB_sparse"] = np.bytes_("double"), np.uint64(4)
        group["data"], group["ir"], group["jc"] = MATRIX.data, MATRIX.indices, MATRIX.indptr
        file["M"] = np.eye(4)
        file["M"].attrs["MATLAB_class"] = np.bytes_("double")


def _netcdf(path):
    with h5netcdf.File(path, "w") as file:
        file.dimensions = {"time": TIME.size}
        file.create_variable("time", ("time",), data=TIME).attrs["units"] = "s"
        a = file.create_variable("a", ("time",), data=np.sin(9 * TIME))
        a.attrs["units"], a.attrs["long_name"] = "m s-2", "acceleration"


def _netcdf3(path):
    time = xarray.Variable("time", TIME, {"units": "s"})
    a = xarray.Variable("time", np.round(900 * np.sin(9 * TIME)).astype("i2"), {"units": "m s-2", "scale_factor": 0.01})
    xarray.Dataset({"a": a}, {"time": time}).to_netcdf(path, engine="scipy")


def _tdms(path):
    waveform = {"wf_increment": 0.01, "wf_start_time": np.datetime64("2026-01-02T03:04:05"), "unit_string": "g"}
    with TdmsWriter(path) as file:
        for part in (TIME[:10], TIME[10:]):
            file.write_segment([ChannelObject("bench", "a", np.sin(9 * part), waveform)])


def _mdf(path):
    linear = {"a": 0.01, "b": 0.0}
    a = Signal(np.round(900 * np.sin(9 * TIME)).astype("i2"), TIME, "m/s^2", "a", conversion=linear)
    slow = Signal(np.cos(TIME[::4]), TIME[::4], "mm", "way")
    with MDF() as file:
        file.append([a], acq_name="bench")
        file.append([slow], acq_name="slow")
        file.save(path)


def _lvm(path):
    rows = "".join(f"\t{np.sin(9 * t):.6f}\t{np.cos(9 * t):.6f}\n" for t in TIME)
    path.write_text(LVM + rows)


def _uff(path):
    path.write_text(function(np.sin(9 * TIME)))


def _uff_binary(path):
    record = pyuff.prepare_58(
        binary=1, func_type=1, rsp_node=1, rsp_dir=3, ref_dir=0, ref_node=0, data=np.sin(9 * TIME), x=TIME,
        abscissa_spacing=1, abscissa_spec_data_type=17, ordinate_spec_data_type=12, orddenom_spec_data_type=0,
        ordinate_axis_units_lab="g", id1="a", rsp_ent_name="a", ref_ent_name="NONE",
    )  # fmt: skip
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)  # pyuff leaves the closing of binary ones to Python
        pyuff.UFF(str(path)).write_sets([record], "add")


def _uff_shapes(path):
    x = np.linspace(0.03, 0.27, 5)
    shapes = [shapes_55(f, 0 * x, 0 * x, column) for f, column in ((50.0, x**2), (300.0, x * (0.2 - x)))]
    path.write_text("".join([units(), nodes_2411(x), *shapes]))


def _op2(path):
    """An OUTPUT2 file with a heading and a matrix of doubles; each record stands between two counts of its bytes."""
    heading = [3, (11, 29, 26), 7, b"NASTRAN FORT TAPE ID CODE - ", 2, b"XXXXXXXX", -1, 0]
    of_matrix = [2, b"KHH     ", -1, 7, (101, 4, 4, 6, 2, 4, 7500), -2, 1, 0, 2, b"KHH     ", -3, 1, 1]
    records = heading + of_matrix
    for column, values in enumerate(MATRIX.toarray().T, 1):
        first_row_and_numbers = _integers(1) + values.tobytes()
        records += [len(first_row_and_numbers) // 4, first_row_and_numbers, -3 - column, 1, int(column < values.size)]
    content = [each if isinstance(each, bytes) else _integers(each) for each in [*records, 0, 0]]
    path.write_bytes(b"".join(_integers(len(each)) + each + _integers(len(each)) for each in content))


def _integers(values):
    return struct.pack(f"{np.size(values)}i", *np.atleast_1d(values))


def _result(path):
    kept = Path(__file__).parents[1] / "data" / "results" / "run_chain.h5.gz"
    path.write_bytes(gzip.decompress(kept.read_bytes()))


def _npz(path):
    with path.open("wb") as file:
        save_npz(file, MATRIX)


def _text(text):
    return lambda path: path.write_text(text)


def _by_program(**how):
    return lambda path: write_matrices(path, {"kxx": MATRIX, "mxx": MATRIX}, **how)


# by name: ending, what writes a sound file, what reads it
FORMATS = {
    "csv": (".csv", _csv, read_signals),
    "hdf5": (".h5", _hdf5, read_signals),
    "mat5 records": (
        ".mat", lambda path: savemat(path, {"time_s": TIME, "a": np.sin(TIME), "s": {"b": TIME}}), read_file
    ),
    "uff": (".uff", _uff, read_file),
    "mat5": (".mat", lambda path: savemat(path, {"K": MATRIX, "M": np.eye(4)}), read_matrices),
    "mat5 packed": (".mat", lambda path: savemat(path, {"K": MATRIX}, do_compression=True), read_matrices),
    "mat7.3": (".mat", _mat73, read_matrices),
    "npz": (".npz", _npz, read_matrices),
    "npz arrays": (".npz", lambda path: np.savez_compressed(path, K=MATRIX.toarray(), M=np.eye(4)), read_matrices),
    "mtx": (".mtx", lambda path: mmwrite(path, MATRIX), read_matrices),
    "abaqus": (".mtx", _text(ABAQUS), read_matrices),
    "hb": (".hb", _text(HARWELL_BOEING), read_matrices),
    "op4": (".op4", _by_program(), read_matrices),
    "op4 binary": (".op4", _by_program(binary=True), read_matrices),
    "dmig": (".pch", _text(DMIG), read_matrices),
    "dofs": (".csv", _text(DOFS), read_dof_table),
    "op2": (".op2", _op2, read_matrices),
    "netcdf": (".nc", _netcdf, read_signals),
    "netcdf 3": (".nc", _netcdf3, read_signals),
    "tdms": (".tdms", _tdms, read_signals),
    "mdf": (".mf4", _mdf, read_signals),
    "lvm": (".lvm", _lvm, read_signals),
    "result": (".h5", _result, load),
    "uff binary": (".uff", _uff_binary, read_file),
    "uff shapes": (".uff", _uff_shapes, lambda path: read_shapes(path, _beam())),
    "shapes": (".csv", _text(SHAPES), lambda path: read_shapes(path, _beam())),
    "limits": (".csv", _text(LIMITS), _read_limits),
    "target": (".csv", _text(TARGET), _read_target),
    "density": (".csv", _text(DENSITY), _read_density),
    "profile": (
        ".csv", _text(PROFILE), lambda path: read_profile(CurveFile(file=str(path)), Path(), ("acceleration",))
    ),
    "stop": (".csv", _text(STOP), _read_stop),
    "sweeps": (".csv", _text(SWEEPS), _read_sweeps),
    "scenario": (".yaml", _text(SCENARIO), load_scenario),
}  # fmt: skip


def sound(name, folder):
    """The content of a sound file of a format."""
    ending, write, read = FORMATS[name]
    path = folder / f"sound{ending}"
    write(path)
    read(path)
    return path.read_bytes()


TEXTS = (b"nan", b"-1", b"1e400", b"99999999999999999999", b"0", b"", b"x", b"\xff\xfe", b"\0", b"-0.5", b"1,1", b"\n")


def damaged(raw, number):
    """The content of a file with one of ten kinds of damage, by the number of the file."""
    rng = np.random.default_rng(number)
    size = len(raw)
    at, length = int(rng.integers(size)), int(rng.integers(1, 1 + min(64, size)))
    begin, end = raw[:at], raw[at + length :]
    match number % 10:
        case 0 | 1:  # bytes are changed, one or up to thirty
            content = bytearray(raw)
            for k in rng.integers(size, size=1 if number % 10 == 0 else int(rng.integers(2, 31))):
                content[k] = int(rng.integers(256))
            return bytes(content)
        case 2:
            return raw[:at]
        case 3:
            return begin + bytes(min(length, size - at)) + end
        case 4:
            return begin + rng.bytes(length) + raw[at:]
        case 5:
            return begin + end
        case 6:
            return begin + 2 * raw[at : at + length] + end
        case 7:  # a word, as a number, of a text, else four bytes
            words = raw.split(b" ") if b"\0" not in raw else [raw[k : k + 4] for k in range(0, size, 4)]
            new_words = TEXTS if b"\0" not in raw else (b"\xff\xff\xff\x7f", b"\0\0\0\x80")
            new = new_words[int(rng.integers(len(new_words)))]
            words[int(rng.integers(len(words)))] = new
            return (b" " if b"\0" not in raw else b"").join(words)
        case 8:  # lines are exchanged
            lines = raw.split(b"\n")
            i, j = rng.integers(len(lines), size=2)
            lines[i], lines[j] = lines[j], lines[i]
            return b"\n".join(lines)
        case _:
            bit = bytearray(raw)
            bit[at] ^= 1 << int(rng.integers(8))
            return bytes(bit)


def outcome(name, raw, number, folder):
    """``read`` or ``refused`` of a damaged file, else what went wrong."""
    ending, _, read = FORMATS[name]
    path = folder / f"damaged{ending}"
    path.write_bytes(damaged(raw, number))
    try:
        read(path)
    except BeamsimError as error:
        text = str(getattr(error, "remedy", "") or error)
        return "refused" if error.exit_code == 2 and text else f"{type(error).__name__} without a remedy"
    except Exception as error:
        return f"{type(error).__name__}: {error}".replace("\n", " ")[:200]
    return "read"


def outcomes(counts):
    """How often each outcome came of damaged files, and what went wrong.

    Parameters
    ----------
    counts : dict
        Number of files by name of the format.

    Returns
    -------
    dict
        A counter of outcomes by format.
    dict
        What went wrong, by format and number of the file.
    """
    files = [(name, number) for name, count in counts.items() for number in range(count)]
    found, wrong, first = {name: Counter() for name in counts}, {}, 0
    plan = [f"{name}:{count}" for name, count in counts.items()]
    while first < len(files):
        child = [sys.executable, "-m", "tests.helpers.damaged_files", str(first), *plan]
        done = subprocess.run(child, capture_output=True, text=True, check=False)
        lines = done.stdout.splitlines()
        for (name, number), line in zip(files[first:], lines, strict=False):
            found[name][line if line in ("read", "refused") else "wrong"] += 1
            if line not in ("read", "refused"):
                wrong[name, number] = line
        first += len(lines)
        if first < len(files):
            wrong[files[first]] = f"ended the process with {done.returncode}: {done.stderr[-300:]}"
            first += 1
    return found, wrong


def _forked(command, *, timeout=None, **_):
    """As `subprocess.run` of code about a damaged file, in a process that need not load the libraries again."""
    process = os.fork()
    if not process:
        signal.alarm(int(timeout))
        for stream in (1, 2):
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
        (examine if "examine" in command[3] else convert)(*command[4:])
        os._exit(0)
    code = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
    return subprocess.CompletedProcess(command, code, b"", b"")


def main(first, *plan):
    """Print the outcome of each of some damaged files."""
    import resource  # of Unix alone

    resource.setrlimit(resource.RLIMIT_AS, (5 << 30, 5 << 30))
    subprocess.run = _forked
    number = 0
    for name, count in (each.rsplit(":", 1) for each in plan):
        skipped, number = max(int(first) - number, 0), number + int(count)
        if skipped >= int(count):
            continue
        with tempfile.TemporaryDirectory() as folder:
            raw = sound(name, Path(folder))
            for k in range(skipped, int(count)):
                signal.alarm(30)
                print(outcome(name, raw, k, Path(folder)), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
