"""``beamsim sweep``: files, summary, plots, exit codes, and sweeps that are killed and resumed."""

import json
import os
import signal
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray

from beamsim.store.results import load
from tests.helpers.commands import invoke
from tests.helpers.killed_commands import killed

CASE = """
title: Two masses and a stop
chain:
  masses: [1, 1]
  springs: [1, 1, 1]
  dashpots: [0.05, 0.05, 0.05]
  snubbers: [{name: stop, mass: 1, side: above, stiffness: 20, gap: 0.3}]
excitation: {kind: harmonic, applied_to: {mass: 2}, level: 0.2 N, frequency: 0.2 Hz}
probes: [{name: first, mass: 1}, {name: second, mass: 2}]
sweep: {kind: swept_sine, from: 0.1, to: 0.4, rate: 4 oct/min, direction: both, levels: [0.1, 0.3]}
"""
ALONE = ("--no-plots", "--set", "sweep.convergence=off")
STEPPED = "sweep={kind: stepped, from: 0.1, to: 0.4, points: 9, direction: both}"


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "case.yaml").write_text(CASE, encoding="utf-8")
    return tmp_path


def call(*arguments):
    return invoke("sweep", *arguments)


def same(a, b):
    """Two files hold the same datasets and the same numbers in the summary, processor and wall times aside."""
    with h5py.File(a) as one, h5py.File(b) as two:
        names = []
        one.visit(names.append)
        others = []
        two.visit(others.append)
        assert names == others
        for name in names:
            if isinstance(one[name], h5py.Dataset) and not name.endswith("/processor_time_s"):
                np.testing.assert_array_equal(one[name][()], two[name][()], err_msg=name)
        skip = {"processor_time_s", "command_processor_time_s", "created", "wall_time_s", "convergence_model"}
        models = [json.loads(file["summary"].attrs["convergence_model"]) for file in (one, two)]
        assert [model | {"finer_model_processor_time_s": 0.0} for model in models[:1]] == [
            models[1] | {"finer_model_processor_time_s": 0.0}
        ]
        for group in ("/", "summary"):
            for key, value in one[group].attrs.items():
                if key not in skip:
                    assert value == two[group].attrs[key], key


@pytest.mark.parametrize("kind", ["swept_sine", "stepped"])
def test_sweep_writes_prints_and_draws(here, kind):
    options = [] if kind == "swept_sine" else ["--set", STEPPED]
    done = call("case.yaml", "-v", *options)
    assert done.exit_code == 0, done.output
    assert "  peaks  " in done.output
    assert "Hz" in done.output
    with h5py.File("case.h5") as file:
        assert file.attrs["command"] == "sweep"
        assert file.attrs["status"] == "complete"
        group = file["cycles"]
        levels = 1 if kind == "stepped" else 2
        curves = [f"{direction}_{level}" for level in range(levels) for direction in ("up", "down")]
        assert file["curves/curve"].asstr()[()].tolist() == curves
        cycles = group["frequency_hz"].size
        for name in ("peak_displacement", "max_displacement", "rms_displacement", "peak_absolute_acceleration"):
            data = group[name]
            assert data.shape == (2, cycles)
            assert data.attrs["units"]
            assert [scale.name for scale in (data.dims[0][0], data.dims[1][0])] == ["/cycles/probe", "/cycles/cycle"]
        assert group["peak_force"].shape == (1, cycles)
        assert group["harmonic_displacement_real"].shape == (2, 5, cycles)
    pictures = {path.name for path in Path().glob("*.png")}
    assert {"case_response_0.png", "case_waterfall.png", "case_contact.png", "case_contact_levels.png"} <= pictures
    assert ("case_steady_states.png" in pictures) is (kind == "stepped")
    with xarray.open_dataset("case.h5", group="cycles", engine="h5netcdf") as data:
        assert data["frequency_hz"].attrs["units"] == "Hz"
    again = invoke("plot", "case.h5", "-o", "again")
    assert again.exit_code == 0, again.output
    assert {path.name for path in Path("again").iterdir()} == pictures
    told = invoke("info", "case.h5")
    assert told.exit_code == 0
    assert "  peaks  " in told.output


def test_json_has_the_fixed_names(here):
    done = call("case.yaml", "--json", *ALONE)
    assert done.exit_code == 0
    summary = json.loads(done.stdout)
    assert {"peaks", "cycles", "processor_time_s"} <= set(summary)
    assert {"frequency_hz", "value_m", "kind", "direction", "level"} <= set(summary["peaks"][0])
    assert not list(Path().glob("*.png"))


def test_a_limit_that_is_exceeded_ends_with_4(here):
    done = call("case.yaml", "--check", "--no-plots", "--set", "limits={peak_force: 1000 N}")
    assert done.exit_code == 0, done.output
    assert "peak force ok, " in done.output
    done = call("case.yaml", "--check", "--no-plots", "--set", "limits={peak_force: 1 mN}")
    assert done.exit_code == 4
    assert Path("case.h5").exists()


def test_profile_and_notch(here):
    profile = "sweep.profile=[{frequency: 0.1, level: 0.2 N}, {frequency: 0.2, level: 0.4 N}]"
    done = call("case.yaml", *ALONE, "--set", profile, "--set", "sweep.levels=null", "--set",
                "sweep.notches=[{from: 0.3, to: 0.35, level: 0.05 N}]")  # fmt: skip
    assert done.exit_code == 0, done.output
    with h5py.File("case.h5") as file:
        up = file["cycles/curve"][()] == file["curves/curve"].asstr()[()].tolist().index("up_0")
        f, a = (file[f"cycles/{name}"][up] for name in ("frequency_hz", "excitation_amplitude"))
    np.testing.assert_allclose(a, np.where(f < 0.2, 0.2, np.where((f >= 0.3) & (f < 0.35), 0.05, 0.4)))


def test_resume_of_what_is_complete_and_of_another_scenario(here):
    assert call("case.yaml", "--no-plots", "-o", "a.h5").exit_code == 0
    first = load("a.h5")
    assert call("case.yaml", "--no-plots", "-o", "a.h5", "--resume").exit_code == 0
    times = [result["levels"]["processor_time_s"].values.tolist() for result in (first, load("a.h5"))]
    assert times[0] == times[1]  # nothing was computed again
    done = call("case.yaml", "--no-plots", "-o", "a.h5", "--resume", "--set", "sweep.to=0.3")
    assert done.exit_code == 2
    assert "another scenario" in done.stderr


def test_resume_says_where_there_is_nothing_to_resume(here):
    """The case of a result file is written to another one, in which an earlier result is not looked for."""
    assert call("case.yaml", "--no-plots", "-o", "a.h5").exit_code == 0
    done = call("a.h5", "--no-plots", "--resume")
    assert done.exit_code == 0, done.output
    remedy = "; to go on with a.h5, give the YAML of its case"
    assert f"beamsim: there is nothing to resume in a_again.h5; the computation starts again{remedy}" in done.stderr
    assert "nothing to resume" not in call("a.h5", "--no-plots", "--resume").stderr


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="no SIGKILL here")
def test_a_killed_sweep_is_resumed_to_the_same_datasets(here):
    """It is killed before the second of three levels replaces the first in the file."""
    short = ["sweep.from=0.15", "sweep.to=0.25", "sweep.rate=8 oct/min", "sweep.levels=[0.1, 0.2, 0.3]"]
    arguments = ["case.yaml", "--no-plots", "-q", *(word for change in short for word in ("--set", change))]
    assert call(*arguments, "-o", "whole.h5").exit_code == 0
    killed("file", 2, "sweep", *arguments, "-o", "killed.h5")
    kept = load("killed.h5")
    assert kept.outcome.cut_short
    assert len(kept["levels"].labels("level_index")) == 1
    assert call(*arguments, "-o", "killed.h5", "--resume").exit_code == 0
    same("whole.h5", "killed.h5")
    leftovers = [name for name in os.listdir() if name.startswith(".beamsim-")]
    assert len(leftovers) <= 1  # what was being written when it was killed
