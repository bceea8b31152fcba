"""MATLAB files have the layout that the documents give: structs as the groups of the result file."""

import re
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import loadmat

import beamsim
from beamsim.store.export import export_result

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
CASES = {
    "run": ("one_sided_65hz.yaml", beamsim.run, ["run.duration=0.05", "run.spectrum.last=0.04"]),
    "two_bodies": ("two_panels.yaml", beamsim.run, ["run.duration=0.05"]),
    "sweep": ("sweep_one_sided_2g.yaml", beamsim.sweep, ["sweep.from=60 Hz", "sweep.to=64 Hz"]),
    "continuation": ("continuation_level.yaml", beamsim.frequency_response, []),
}


def field(name):
    valid = re.sub(r"[^0-9A-Za-z_]", "_", name)
    return valid if valid[0].isalpha() else f"x{valid}"


def compared(group, struct):
    """Every dataset is in the struct of its group, with its shape and values; how many there are."""
    count = 0
    for name, item in group.items():
        if name == "summary":
            continue
        stem = re.sub("_(real|imag)$", "", name)
        split = name != stem and f"{stem}_real" in group and f"{stem}_imag" in group
        key = field(stem if split else name)
        value = struct[key] if isinstance(struct, dict) else struct[key][0, 0]
        if isinstance(item, h5py.Group):
            count += compared(item, value) if len(item) else 0
        elif item.dtype.kind in "fiub":
            data = item[...]
            if split:
                value = value.real if name.endswith("_real") else value.imag
            expected = data + 1 if item.name == "/events/snubber" else data
            if data.ndim > 1:
                assert value.shape == data.shape, item.name
            np.testing.assert_array_equal(np.ravel(value), np.ravel(expected), err_msg=item.name)
            if "units" in item.attrs:
                units = struct["units"] if isinstance(struct, dict) else struct["units"][0, 0]
                assert key in units.dtype.names, item.name
            count += 1
    return count


@pytest.mark.parametrize("case", CASES)
def test_structs_are_the_groups_of_the_result_file(case, tmp_path):
    config, analyse, changes = CASES[case]
    result = analyse(beamsim.load_scenario(CONFIGS / config, [*changes]))
    path = beamsim.write_result(result, tmp_path / "case.h5")
    (mat,) = export_result(path, tmp_path / "case.mat", "mat")
    with h5py.File(path) as file:
        assert compared(file, loadmat(mat)) > 20
