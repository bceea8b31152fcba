"""`beamsim nnm` and `beamsim sweep` of kind continuation, from the config to the file."""

import json
from functools import cache
from pathlib import Path

import h5py
import numpy as np
import pytest
from sampling import first_apart
from shipped import PATHS, config_path, shipped

from beamsim.analyses.nnm.analysis import nnm
from beamsim.scenario import load_scenario
from tests.helpers.commands import invoke
from tests.helpers.tables import rows

ELSEWHERE = ("ms_", "nnm_forced_")  # tests/reference/test_multiple_scales_thesis.py, tests/cli/test_phase_resonance.py
NNM = [path for path in PATHS if not path.stem.startswith(ELSEWHERE) and shipped(path).nnm is not None]


@cache
def followed(name):
    """The result of a shipped config, computed once for all tests here."""
    return nnm(load_scenario(config_path(name)))


LONG = ("nnm_first", "nnm_thesis_mode_1", "nnm_thesis_mode_2", "nnm_energy", "vibeams_backbone")  # test_configs.py


@first_apart("path", 4, [p for p in NNM if p.stem not in LONG], ids=lambda path: path.stem)
def test_every_mode_config(path):
    result = followed(path.stem)
    assert result.complete
    backbone = result.branches[0]
    assert backbone["parameter"].values.size >= 75
    assert backbone["residual"].values.max() < 1e-10
    assert backbone["share"].values.min() > 0.5
    result.plot()


def test_nnm_writes_a_file_and_pictures(tmp_path):
    done = invoke("nnm", config_path("nnm_chain_mass_5"), "-o", tmp_path, "--json")
    assert done.exit_code == 0
    summary = json.loads(done.stdout)
    assert {"points", "start", "end", "processor_time_s", "status"} <= summary.keys()
    assert summary["start"]["parameter"] == 0.0
    assert summary["end"]["parameter"] == 1.0
    assert {Path(f).suffix for f in summary["files"]} == {".h5", ".png"}
    assert all(Path(f).is_file() for f in summary["files"])
    with h5py.File(tmp_path / "nnm_chain_mass_5.h5") as file:
        assert file.attrs["command"] == "nnm"
        branch, motion = file["points"], file["motion"]
        assert branch["frequency_hz"].attrs["units"] == "Hz"
        assert branch["initial_displacement"].shape == (summary["points"], 6)
        assert branch["initial_displacement"].dims[1][0] == branch["station"]
        fifth = motion["probe"].asstr()[()].tolist().index("fifth")
        displacement = motion["displacement"][fifth]
        assert displacement[0] == pytest.approx(displacement[-1], abs=1e-9)
        assert motion["velocity"][fifth, 0] == 0.0
        assert load_scenario(file.attrs["scenario"]).nnm.mode == 4
        for group in (motion, branch):
            for item in group.values():
                if isinstance(item, h5py.Dataset):
                    assert item.attrs["long_name"]


def test_nnm_table(tmp_path):
    shorter = ("--set", "nnm.continue_in.to=0.1", "--set", "reduction.modes=4")
    done = invoke("nnm", config_path("nnm_first"), *shorter, "-o", tmp_path, "--no-plots", "-v")
    assert done.exit_code == 0
    tongues = [line.split()[1:3] for line in done.stdout.partition("mode   ratio   parameter")[2].splitlines()[1:6]]
    assert ["2", "6"] in tongues  # mode and ratio
    assert ["2", "5"] in tongues
    assert not list(tmp_path.glob("*.png"))


def test_no_stretch_of_the_backbone_is_lost_between_its_tongues():
    """From 62 to 75 Hz tongues follow each other closely; the motions of the mode are found between them, too."""
    changes = {"nnm.continue_in.from": "80 uJ", "nnm.continue_in.to": "700 uJ"}
    result = nnm(load_scenario(config_path("nnm_energy"), changes))
    backbone = result.branches[0]
    assert result.complete
    assert np.min(backbone["share"].values) > 0.5
    assert 5 in {jump.ratio for jump in rows(result["jumps"], "jump") if jump.mode == 2}
    assert np.max(np.diff(backbone["frequency_hz"].values)) < 4.0


def test_in_frequency():
    changes = {"nnm.continue_in": {"kind": "frequency", "from": "52.45 Hz", "to": "52.6 Hz"}}
    result = nnm(load_scenario(config_path("nnm_energy"), changes))
    assert result.branches[0]["frequency_hz"].values[0] == pytest.approx(52.45, rel=1e-9)
    assert result.complete
    assert result.branches[0]["frequency_hz"].values[-1] == pytest.approx(52.6, rel=1e-9)
    assert np.all(np.diff(result.branches[0]["energy"].values) > 0)
