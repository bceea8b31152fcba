"""Histories of long runs are read, drawn and exported in parts: little memory, the same numbers."""

import h5py
import numpy as np
import pytest
from shipped import config_path

import beamsim
from beamsim.flow import moments
from beamsim.responses import histories
from beamsim.store import export, results
from beamsim.store.export import export_result
from beamsim.store.results import write_result

RATE = 100e3
LONG = {"run.duration": "0.5 s", "run.sample_rate": "100 kHz", "run.convergence": "off"}
PART = 4096


def long_run(**changes):
    return beamsim.run(beamsim.load_scenario(config_path("one_sided_65hz"), {**LONG, **changes}))


@pytest.fixture
def small_parts(monkeypatch):
    """Parts of a few thousand samples."""
    monkeypatch.setattr(histories, "VALUES_AT_ONCE", 2**17)
    monkeypatch.setattr(moments, "VALUES_AT_ONCE", 2**15)
    monkeypatch.setattr(export, "ROWS_AT_ONCE", PART)


def along_time(path):
    """By name, the arrays along the time of a run, the time included."""
    with h5py.File(path) as file:
        items = results.read_items(file)
    return {name: np.array(item.values) for name, item in items.items() if "/histories/time" in (name, *item.axes)}


def test_histories_are_the_same_in_one_piece_and_in_parts(monkeypatch, tmp_path):
    whole = long_run()
    monkeypatch.setattr(histories, "VALUES_AT_ONCE", 2**17)
    write_result(long_run(), tmp_path / "parts.h5")
    stored = along_time(tmp_path / "parts.h5")
    probes = ("displacement", "velocity", "absolute_displacement", "absolute_acceleration")
    energies = ("energy_work_in", "energy_dissipated", "energy_stored")
    for name in (*probes, "snubber_force", "snubber_penetration", *energies):
        values = whole["histories"][name].values
        size = np.abs(values).max(axis=-1, keepdims=True)
        np.testing.assert_allclose(stored[f"/histories/{name}"] / size, values / size, rtol=0, atol=1e-12, err_msg=name)
    np.testing.assert_array_equal(stored["/histories/time"], np.arange(50_001) / RATE)
    np.testing.assert_array_equal(
        stored["/histories/base_acceleration"], whole["histories"]["base_acceleration"].values
    )


def test_tables_in_parts_hold_every_sample(small_parts, tmp_path):
    path = tmp_path / "long.h5"
    write_result(long_run(**{"run.duration": "0.12 s", "run.spectrum.last": "0.1 s"}), path)
    export_result(path, tmp_path / "csv", "csv")
    with open(tmp_path / "csv" / "histories_by_time.csv", encoding="utf-8") as stream:
        names = stream.readline().strip().split(",")
        rows = np.loadtxt(stream, delimiter=",")
    stored = along_time(path)
    np.testing.assert_array_equal(rows[:, names.index("time (s)")], stored["/histories/time"])
    for heading, name in (("tip snubber_force (N)", "snubber_force"), ("tip snubber_closed", "snubber_closed")):
        np.testing.assert_array_equal(rows[:, names.index(heading)], stored[f"/histories/{name}"][0])


def test_the_bound_on_memory_is_in_the_summary_and_ends_a_motion_that_exceeds_it(monkeypatch):
    from beamsim.analyses.run import motion

    short = {"run.duration": "0.5 s", "run.sample_rate": "1 kHz"}
    result = long_run(**short, **{"run.memory": "100 MB"})
    assert result.summary["memory_bytes"] == 100_000_000
    assert result.complete
    event = 16 * (2 * len(result.summary["open_frequencies_hz"]) + 8)  # bytes
    monkeypatch.setattr(motion, "MOTION_SHARE", 10.5 * event / result.summary["memory_bytes"])  # room for ten
    limited = long_run(**short, **{"run.memory": "100 MB"})
    assert limited.summary["events"] < 15 < result.summary["events"]
    assert "raise run.memory" in limited.status
    assert limited["histories"]["time"].values[-1] < 0.5
