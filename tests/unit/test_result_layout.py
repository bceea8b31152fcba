"""Result files of earlier versions still open, and are written again just as they were."""

import gzip
from pathlib import Path

import h5py
import numpy as np
import pytest

import beamsim
from beamsim.kinds import KINDS
from beamsim.store.results import kind_of

FILES = sorted((Path(__file__).parents[1] / "data" / "results").glob("*.h5.gz"))
WRITERS = {
    "run": beamsim.write_run,
    "sweep": beamsim.write_sweep,
    "continuation": beamsim.write_continuation,
    "designs": beamsim.write_designs,
    "identify-stiffness": beamsim.write_identification,
    "nnm": beamsim.write_nnm,
    "compare": beamsim.write_comparison,
    "compare-modes": beamsim.write_mode_comparison,
}
OF_HDF5 = {"DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME"}
# What may differ: the scenario's text has the form of the version that writes it.
UNLIKE = {("/", "scenario"), ("/", "beamsim_version"), ("/update", "scenario")}
# What later versions write in addition: attributes, the kind on every branch, a column of the lines.
ADDED = {
    "outcome",
    "outcome_numbers",
    "kind",
    "rms_low",
    "rms_high",
    "degrees_of_freedom",
    "linear_open",
    "linear_closed",
}
ADDED_COLUMNS = {"relative_change"}
# What they no longer know: the estimate beside the bound of the reduction's error, which earlier files may lack.
GONE = {"reduction_error", "peak_acceleration_m_s2"}
UNKNOWN = {"/modes@reduction_bound", "/modes@probe_bound", "/modes@highest_frequency_hz"}
# Long names that were reworded: those of earlier files, and the current ones.
_PARTS = (", real part", ", imaginary part")
_HARMONICS = (
    "measured harmonic",
    "harmonic predicted with the scenario's values",
    "harmonic predicted with the estimated values",
)
_FREQUENCIES = ("excitation frequency", "excitation frequency of the fold", "frequency of the motion")
_RESPONSES = ("displacement per unit of excitation, without snubbers", "absolute acceleration per unit of excitation")
_SWEPT = ("absolute acceleration", "displacement", "force")
REWORDED = {
    "20 log10(predicted / measured)": ["20 log10(predicted / measured); NaN where one is round-off"],
    "energy stored, kinetic and elastic, snubbers included": [
        "energy stored, kinetic and elastic, snubbers included; where supports move relative to the base, that of the "
        "degrees of freedom which they leave",
    ],
    **{
        f"amplitude of cos(order x phase) in the {x}": [
            f"amplitude of cos(order x phase) in the {x}; of order p/q over q cycles up to this one"
        ]
        for x in _SWEPT
    },
    **{f"mean {x} of a cycle": [f"mean of the {x} over the time of a cycle"] for x in _SWEPT},
    **{
        f"root mean square of the {x} over a cycle": [f"root mean square of the {x} over the time of a cycle"]
        for x in _SWEPT
    },
    "stretch of the spring; to the ground the absolute displacement of the mass": [
        "stretch of the spring; to the ground the absolute displacement there"
    ],
    "amplitude of the excitation, zero to peak": ["amplitude of the base's acceleration or of the force, zero to peak"],
    "level of the excitation, SI": ["level of the excitation"],
    "position along the beam": ["position along the beam, or on the plate from its left edge"],
    "time of the contact event": ["time of the contact event; 0 where contact begins at the start of the run"],
    "share of the time in contact": ["share of the cycle's time in contact"],
    "coordinates at the slowest instant": [
        "coordinates at phase zero of the excitation; of a free motion at its slowest instant"
    ],
    "their velocities then; zero at rest": ["their velocities then; of a brake orbit zero"],
    **{text: [f"{text}{part}" for part in _PARTS] for text in _RESPONSES},
    **{f"{text}, imag part": [f"{text}, imaginary part"] for text in _HARMONICS},
    **{text: ["frequency of the excitation, or of a free motion"] for text in _FREQUENCIES},
    "mean, fundamental, superharmonic, subharmonic or other": [
        "mean, fundamental, superharmonic, subharmonic, other, chosen; residual: of no mode"
    ],
    "curve of the peak": ["name of the curve"],
    "probe of the peak": ["name of the probe"],
    "direction of the peak": ["direction of the sweep"],
    "order of the harmonic that resonates": ["order of the resonant harmonic"],
    "largest miss of periodicity, against the motion's size": [
        "largest periodicity error, relative to the size of the motion"
    ],
    "phase of the measured harmonic as a sine, on the predicted clock": [
        "phase of the measured harmonic as a sine, in the time of the prediction"
    ],
    "phase of the predicted harmonic as a sine, on the predicted clock": [
        "phase of the predicted harmonic as a sine, in the time of the prediction"
    ],
    "relative standard deviation known beforehand": ["relative standard deviation of the prior"],
    "share of the energy in the mode asked for, at the slowest instant": [
        "share of the energy in the requested mode, at the slowest instant"
    ],
}


def described(path):
    """Everything a file says: attributes of groups, and of datasets also their values, types and axes."""
    told = {}

    def note(name, item):
        name = f"/{name}".rstrip("/") or "/"
        if name.rpartition("/")[2] in ADDED_COLUMNS and "/lines/" in name:
            return
        for key, value in item.attrs.items():
            if key not in OF_HDF5 | ADDED and (name, key) not in UNLIKE:
                told[f"{name}@{key}"] = sorted(value.split()) if key == "json_encoded" else np.asarray(value).tolist()
        if isinstance(item, h5py.Dataset):
            text = h5py.check_string_dtype(item.dtype) is not None
            told[name] = np.asarray(item.asstr()[()] if text else item[()])
            axes = [[scale.name for scale in dimension.values()] for dimension in item.dims]
            told[f"{name} axes"] = item.is_scale, axes

    with h5py.File(path) as file:
        note("", file)
        file.visititems(note)
    return told


def unpacked(packed, folder):
    path = folder / packed.name.removesuffix(".gz")
    path.write_bytes(gzip.decompress(packed.read_bytes()))
    return path


@pytest.fixture(scope="module", params=FILES, ids=[path.name.partition(".")[0] for path in FILES])
def earlier(request, tmp_path_factory):
    """The path of an earlier file, its result, and the path of the file that is written from it now."""
    folder = tmp_path_factory.mktemp("earlier")
    path = unpacked(request.param, folder)
    result = beamsim.open_result(path)
    return path, result, WRITERS[kind_of(path)](result, folder / "again.h5")


def test_an_earlier_file_is_written_again_as_it_was(earlier):
    earlier, _, again = earlier
    old, new = described(earlier), described(again)
    old, new = ({name: x for name, x in of.items() if name.rpartition("@")[2] not in GONE} for of in (old, new))
    new = {name: value for name, value in new.items() if name in old or name not in UNKNOWN or not np.isnan(value)}
    # a unit that earlier files do not state stays empty
    later = {"level_unit": "", "base_unit": "m"}  # attributes that earlier files lack, with what they then stand for
    assert set(old) == {name for name, value in new.items() if (name.rpartition("@")[2], value) not in later.items()}
    for name, value in old.items():
        if name.endswith("@long_name") and value != new[name]:
            assert new[name] in REWORDED.get(value, ()), name
        elif isinstance(value, np.ndarray) and value.dtype != object:
            assert value.dtype == new[name].dtype, name
            round_off = 1e-11 if name.endswith(("_db", "_deg")) else 0.0  # of what is worked out again
            np.testing.assert_allclose(new[name], value, rtol=1e-13, atol=round_off, err_msg=name)
        else:
            np.testing.assert_equal(new[name], value, name)


@pytest.mark.filterwarnings("ignore:Duplicate dimension names")
def test_xarray_opens_every_group_of_every_kind(earlier):
    xarray = pytest.importorskip("xarray")
    _, _, path = earlier
    with h5py.File(path) as file:
        groups = ["/"]
        file.visititems(lambda name, item: groups.append(f"/{name}") if isinstance(item, h5py.Group) else None)
    opened = xarray.open_groups(path, engine="h5netcdf", phony_dims="sort")
    assert set(opened) == set(groups)
    for dataset in opened.values():
        with dataset:
            dataset.load()


def test_there_is_a_file_of_every_kind(tmp_path):
    assert {kind_of(unpacked(packed, tmp_path)) for packed in FILES} == set(KINDS)
    assert max(path.stat().st_size for path in FILES) < 100_000


def test_every_number_of_the_summary_is_declared(earlier):
    _, result, _ = earlier
    declared = [quantity.name for quantity in type(result).SUMMARY]
    assert len(set(declared)) == len(declared)
    assert set(result.summary) <= set(declared) | GONE


def test_a_difference_is_seen(tmp_path):
    """The comparison fails where a unit, an axis, an attribute or a value is another."""
    path = unpacked(FILES[-1], tmp_path)
    before = described(path)

    def differing(change):
        other = unpacked(FILES[-1], tmp_path)
        with h5py.File(other, "a") as file:
            change(file)
        after = described(other)
        return [name for name, value in before.items() if not _equal(value, after[name])]

    assert differing(lambda file: None) == []
    name = next(name for name, value in before.items() if isinstance(value, np.ndarray) and value.dtype.kind == "f")
    assert f"{name}@units" in differing(lambda file: file[name].attrs.modify("units", "furlong"))
    assert name in differing(lambda file: file[name].write_direct(np.full(file[name].shape, 7.0)))
    axes = next(name for name, value in before.items() if name.endswith(" axes") and value[1] and value[1][0])

    def detach(file):
        dimension = file[axes.removesuffix(" axes")].dims[0]
        dimension.detach_scale(dimension[0])

    assert axes in differing(detach)


def _equal(old, new):
    try:
        np.testing.assert_equal(new, old)
    except AssertionError:
        return False
    return True
