"""Histories of long runs are computed, written, read and drawn in parts: bounded memory, the same numbers."""

import tracemalloc
from pathlib import Path

import h5py
import numpy as np
import pytest
from beamsim.store.tables import datasets

import beamsim
from beamsim.analyses.run import histories
from beamsim.errors import ResultFileError
from beamsim.fields import RowBlocks, rows_of
from beamsim.flow import moments, trajectory
from beamsim.plots import style
from beamsim.plots.run import plot_displacement
from beamsim.plots.style import thinned
from beamsim.store import csv_folder, declared
from beamsim.store.export import export_result
from beamsim.store.results import open_run, write_result, write_until

CONFIGS = Path(__file__).parents[2] / "configs"
RATE = 100e3
LONG = {"run.duration": "1 s", "run.sample_rate": "100 kHz", "run.convergence": "off"}
PART = 4096


def long_run(**changes):
    return beamsim.run(beamsim.load_scenario(CONFIGS / "one_sided_65hz.yaml", {**LONG, **changes}))


@pytest.fixture
def small_parts(monkeypatch):
    """Parts of a few thousand samples."""
    monkeypatch.setattr(histories, "VALUES_A_BLOCK", 2**17)
    monkeypatch.setattr(trajectory, "VALUES_AT_ONCE", 2**14)
    monkeypatch.setattr(moments, "AT_ONCE", 2**15)
    monkeypatch.setattr(declared, "ROWS_AT_ONCE", PART)
    monkeypatch.setattr(csv_folder, "ROWS_AT_ONCE", PART)
    monkeypatch.setattr(style, "AT_ONCE", 2 * PART)


def peak_memory(work):
    """Largest memory, bytes, that was allocated during some work beyond what there was."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def along_time(path):
    """By name, the arrays along the time of a run, the time included."""
    with h5py.File(path) as file:
        arrays = {d.name: d[()] for d in datasets(file) if len(d.dims[0]) and d.dims[0][0].name == "/time"}
        return {**arrays, "/time": file["time"][()]}


def test_histories_are_the_same_in_one_piece_and_in_parts(small_parts, tmp_path):
    parts, whole = tmp_path / "parts.h5", long_run()
    write_result(long_run(), parts)
    stored = along_time(parts)
    for name, probe in whole.probes.items():
        for field in ("displacement", "absolute_displacement", "velocity", "absolute_acceleration"):
            np.testing.assert_array_equal(stored[f"/probes/{name}/{field}"], getattr(probe, field))
    for field in ("force", "penetration", "closed", "displacement", "velocity"):
        np.testing.assert_array_equal(stored[f"/snubbers/tip/{field}"], getattr(whole.snubbers["tip"], field))
    for field in ("work_in", "dissipated", "stored"):
        np.testing.assert_array_equal(stored[f"/energy/{field}"], getattr(whole.energy, field))
    np.testing.assert_array_equal(stored["/time"], np.arange(100_001) / RATE)
    np.testing.assert_array_equal(stored["/base/acceleration"], whole.base_acceleration)


def test_energies_in_parts_balance(small_parts):
    energy = long_run().energy
    imbalance = energy.work_in - energy.dissipated - (energy.stored - energy.stored[0])
    assert np.abs(imbalance).max() < 1e-10 * energy.stored.max()


def test_any_part_of_a_history_is_that_of_the_whole(small_parts):
    late, whole = long_run(), long_run()
    part = slice(70_003, 80_001)  # before any other is computed
    np.testing.assert_array_equal(rows_of(late.energy, "dissipated")[part], whole.energy.dissipated[part])
    np.testing.assert_array_equal(rows_of(late.snubbers["tip"], "force")[part], whole.snubbers["tip"].force[part])


@pytest.mark.slow
def test_a_long_run_is_written_read_drawn_and_exported_in_little_memory(small_parts, tmp_path, monkeypatch):
    from matplotlib.figure import Figure

    path, result = tmp_path / "long.h5", long_run(**{"run.duration": "2 s"})
    write_result(long_run(**{"run.duration": "0.5 s"}), tmp_path / "first.h5")  # compiles
    column = 8 * 200_001
    written = peak_memory(lambda: write_result(result, path))
    everything = sum(values.nbytes for values in along_time(path).values())
    assert everything > 15 * column
    assert written < 0.2 * everything
    stored = open_run(path)
    plot_displacement(stored, Figure().subplots())
    time, displacement = rows_of(stored, "time"), rows_of(stored.probes["tip"], "displacement")
    assert isinstance(displacement, RowBlocks)  # the plot did not read the whole
    assert peak_memory(lambda: thinned(time, displacement, 2000)) < 0.4 * column
    assert peak_memory(lambda: open_run(path)) < 0.5 * column
    rows = []  # turned into text one by one: that takes no memory, but half a minute while memory is traced
    monkeypatch.setattr(csv_folder.np, "savetxt", lambda stream, values, **_: rows.append(len(values)))
    assert peak_memory(lambda: export_result(path, tmp_path / "csv", "csv")) < 2 * column
    assert max(rows) == PART
    assert sum(rows) >= 200_001
    assert peak_memory(lambda: open_run(path).snubbers["tip"].force) > column  # the measure sees a whole column


def test_tables_in_parts_hold_every_sample(small_parts, tmp_path):
    path = tmp_path / "long.h5"
    write_result(long_run(**{"run.duration": "0.15 s", "run.spectrum.last": "0.1 s"}), path)
    export_result(path, tmp_path / "csv", "csv")
    with open(tmp_path / "csv" / "time_histories.csv", encoding="utf-8") as stream:
        names = stream.readline().strip().split(",")
        rows = np.loadtxt(stream, delimiter=",")
    stored = along_time(path)
    np.testing.assert_array_equal(rows[:, names.index("time_s")], stored["/time"])
    np.testing.assert_array_equal(rows[:, names.index("snubber_tip_force_n")], stored["/snubbers/tip/force"])
    np.testing.assert_array_equal(rows[:, names.index("snubber_tip_closed")], stored["/snubbers/tip/closed"])


def test_an_interruption_while_writing_keeps_what_is_written(small_parts, tmp_path):
    path, shares = tmp_path / "stopped.h5", []
    kept = write_until(long_run(), path, lambda: len(shares) >= 3, shares.append)
    assert len(shares) == 3
    assert kept.outcome.interrupted
    stored, whole = open_run(path), long_run()
    assert stored.status == kept.status == stored.summary["status"]
    assert "writing of the histories" in stored.status
    sizes = {values.size for values in along_time(path).values()}
    assert len(sizes) == 1
    size = sizes.pop()
    assert 0 < size < 0.5 * whole.time.size
    np.testing.assert_array_equal(stored.snubbers["tip"].force, whole.snubbers["tip"].force[:size])
    np.testing.assert_array_equal(stored.energy.work_in, whole.energy.work_in[:size])
    assert stored.summary["peak_force_n"] == whole.summary["peak_force_n"]  # of the whole motion


def test_a_stop_that_comes_with_the_last_part_changes_nothing(small_parts, tmp_path):
    shares = []
    kept = write_until(long_run(), tmp_path / "all.h5", lambda: shares[-1] == 1.0, shares.append)
    assert shares[-1] == 1.0
    assert kept.complete
    assert open_run(tmp_path / "all.h5").complete


def test_a_history_of_a_file_that_was_replaced_is_refused(small_parts, tmp_path):
    path = tmp_path / "replaced.h5"
    write_result(long_run(**{"run.duration": "0.5 s"}), path)
    stored = open_run(path)
    write_result(long_run(**{"run.duration": "0.6 s"}), path)
    with pytest.raises(ResultFileError, match="changed since it was opened"):
        _ = stored.snubbers["tip"].force


def test_envelopes_of_parts_are_those_of_the_whole(monkeypatch):
    rng = np.random.default_rng(4)
    x = rng.normal(size=300_007)
    time = np.arange(x.size) / RATE
    in_parts = [RowBlocks(a.size, lambda i, j, a=a: a[i:j], None, float, 1000) for a in (time, x)]
    whole = thinned(time, x, 5000, begin=11)
    monkeypatch.setattr(style, "AT_ONCE", 7000)
    parts = thinned(*in_parts, 5000, begin=11)
    assert parts[1].size <= 5200
    for a, b in zip(whole, parts, strict=True):
        np.testing.assert_array_equal(a, b)
    assert (parts[1].max(), parts[1].min()) == (x[11:].max(), x[11:].min())


def test_the_bound_on_memory_is_in_the_summary_and_ends_a_motion_that_exceeds_it(monkeypatch):
    from beamsim.analyses.run import exact_motion

    short = {"run.duration": "0.5 s", "run.sample_rate": "1 kHz"}
    result = long_run(**short, **{"run.memory": "100 MB"})
    assert result.summary["memory_bytes"] == 100_000_000
    assert result.complete
    monkeypatch.setattr(exact_motion, "events_in_memory", lambda flow, memory: int(memory / 1e7))
    limited = long_run(**short, **{"run.memory": "100 MB"})
    assert limited.summary["events"] < 15 < result.summary["events"]
    assert "raise run.memory" in limited.status
    assert limited.time[-1] < 0.5
