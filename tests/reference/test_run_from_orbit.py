"""Runs that start on a stored periodic motion: they stay on it, return to it, or leave it as its stability says."""

from pathlib import Path

import numpy as np
import pytest

import beamsim
from beamsim.errors import ScenarioError
from beamsim.scenario import load_scenario
from beamsim.system.build import build_system
from tests.helpers.branches import long_steps, multipliers, peaks_of

BEAM = Path(__file__).parents[2] / "configs/one_sided_65hz.yaml"
LAW = "snubbers[0].law"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("orbits")


def continued(folder, name, sweep, *changes):
    case = load_scenario(BEAM, [f"sweep={{kind: continuation, seek_at: 0, longest_period: 1, {sweep}}}", *changes])
    with long_steps():
        result = beamsim.continuation(case)
    return beamsim.write_result(result, folder / f"{name}.h5"), result.branches[0]


@pytest.fixture(scope="module")
def in_frequency(folder):
    return continued(folder, "frequency", "from: 84 Hz, to: 88 Hz, points_at: [84.5 Hz]")


def run_from(path, k, periods, frequency, *changes, **start):
    given = {"orbit": str(path), "point": k + 1, **start}
    case = load_scenario(BEAM, {"run.duration": periods / frequency, "run.spectrum.last": None, "run.start": given})
    return beamsim.run(load_scenario(case.to_yaml(), list(changes)))


def test_a_stable_motion_goes_on(in_frequency):
    path, branch = in_frequency
    (k,) = np.flatnonzero(np.isclose(branch["parameter"].values, 84.5, rtol=1e-13))
    result = run_from(path, int(k), 20, 84.5, "run.sample_rate=16900")
    assert result.scenario.excitation.frequency == pytest.approx(84.5, rel=1e-14)
    assert result.summary["peak_displacement_m"]["tip"] == pytest.approx(peaks_of(branch, "tip")[k], rel=1e-7)
    assert result.summary["contact_share"]["tip"] == pytest.approx(
        branch["contact_share"].sel(snubber="tip").values[k], rel=1e-9
    )
    x = result["histories"]["displacement"].sel(probe="tip").values[:-1].reshape(20, 200)
    np.testing.assert_allclose(x, np.tile(x[0], (20, 1)), atol=1e-9 * np.abs(x).max())
    disturbed = run_from(path, int(k), 20, 84.5, "run.sample_rate=16900", factor=1.02)
    y = disturbed["histories"]["displacement"].sel(probe="tip").values[:-1].reshape(20, 200)
    assert np.abs(y[0] - x[0]).max() > 5e-3 * np.abs(x).max()  # the comparison can fail
    assert np.abs(y[-1] - x[-1]).max() < 0.5 * np.abs(y[0] - x[0]).max()


def test_an_unstable_motion_is_left(in_frequency):
    path, branch = in_frequency
    k = int(np.argmax(np.where(branch["stable"].values, 0.0, np.abs(multipliers(branch)[:, 0]))))
    frequency = float(branch["frequency_hz"].values[k])
    growth = abs(multipliers(branch)[k, 0])
    assert growth > 1.01
    rate = f"run.sample_rate={200 * frequency!r}"
    disturbed = run_from(path, k, 300, frequency, rate, factor=1.0 + 1e-4)
    tip = disturbed["histories"]["displacement"].sel(probe="tip").values
    early, late = (tip[a : a + 200] for a in (0, 200 * 290))
    exact = run_from(path, k, 2, frequency, rate)["histories"]["displacement"].sel(probe="tip").values[:200]
    assert np.abs(late - exact).max() > 20 * np.abs(early - exact).max()


@pytest.mark.parametrize(
    ("sweep", "changes"),
    [
        ("continue_in: {kind: gap, from: 0 mm, to: 0.1 mm}", ()),
        ("continue_in: {kind: level, from: 1 g, to: 2 g}", (f"{LAW}=no_tension",)),
    ],
    ids=["gap", "no_tension"],
)
def test_what_was_followed_is_taken_over(folder, sweep, changes):
    path, branch = continued(folder, (changes and "law") or "gap", sweep, *changes)
    k = branch["parameter"].values.size - 1
    result = run_from(path, k, 10, 65.0, *changes)
    if changes:
        assert result.scenario.excitation.level == pytest.approx(2 * 9.80665)
        assert branch["internal_states"].values.shape == (branch["parameter"].values.size, 1)
    else:
        assert result.scenario.snubbers[0].gap == pytest.approx(1e-4)
    assert result.summary["peak_displacement_m"]["tip"] == pytest.approx(peaks_of(branch, "tip")[k], rel=1e-6)
    kept = run_from(path, 0, 10, 65.0, *changes, keep_excitation=True)
    assert kept.scenario.excitation.level == load_scenario(BEAM).excitation.level


@pytest.mark.parametrize(
    ("second", "changed"),
    [
        ("{kind: gap, from: 0 mm, to: 0.05 mm}", lambda scenario: scenario.snubbers[0].gap),
        ("{kind: level, from: 1.5 g, to: 2.2 g}", lambda scenario: scenario.excitation.level),
    ],
    ids=["gap", "level"],
)
def test_a_motion_of_a_special_curve_is_periodic(folder, second, changed):
    """At the point's frequency and second parameter; at a fold the state returns, but slowly where it is disturbed."""
    path, _ = continued(folder, "folds", f"from: 78 Hz, to: 88 Hz, side_branches: none, follow_points_in: {second}")
    (curve, *_) = beamsim.load(path).special_curves
    k = curve["parameter"].values.size // 2
    frequency = float(curve["frequency_hz"].values[k])
    rate = f"run.sample_rate={1000 * frequency!r}"
    result = run_from(path, k, 10, frequency, rate, special_curve=0)
    assert result.scenario.excitation.frequency == pytest.approx(frequency, rel=1e-14)
    assert changed(result.scenario) == pytest.approx(curve["parameter"].values[k], rel=1e-12)
    assert result.summary["peak_displacement_m"]["tip"] == pytest.approx(peaks_of(curve, "tip")[k], rel=1e-6)
    x = result["histories"]["displacement"].sel(probe="tip").values[:-1].reshape(10, 1000)
    np.testing.assert_allclose(x, np.tile(x[0], (10, 1)), atol=1e-6 * np.abs(x).max())
    kept = run_from(
        path, k, 10, frequency, rate, special_curve=0, keep_excitation=True
    )  # the twin: at 65 Hz it is none
    y = kept["histories"]["displacement"].sel(probe="tip").values
    assert np.abs(y[1000:2000] - y[:1000]).max() > 1e-2 * np.abs(x).max()


def test_harmonic_balance_states_are_close(folder):
    path, branch = continued(folder, "balance", "method: harmonic_balance, from: 80 Hz, to: 80.5 Hz")
    result = run_from(path, 2, 10, float(branch["frequency_hz"].values[2]))
    assert result.summary["peak_displacement_m"]["tip"] == pytest.approx(peaks_of(branch, "tip")[2], rel=0.02)


def test_states_survive_the_file(in_frequency):
    path, branch = in_frequency
    (read, *_) = beamsim.load(path).branches
    np.testing.assert_array_equal(read["coordinates"].values, branch["coordinates"].values)
    np.testing.assert_array_equal(read["coordinate_velocities"].values, branch["coordinate_velocities"].values)


def refused(text, **changes):
    with pytest.raises(ScenarioError, match=text):
        beamsim.run(load_scenario(BEAM, {"run.duration": 0.1, "run.spectrum.last": None, **changes}))


def test_refusals(in_frequency, folder):
    path, branch = in_frequency
    start = {"orbit": str(path), "point": 1}
    refused("does not exist", **{"run.start": {**start, "orbit": "nothing.h5"}})
    refused(f"points 1 to {branch['parameter'].values.size}", **{"run.start": {**start, "point": 9999}})
    refused("its branches are 0 to", **{"run.start": {**start, "branch": 99}})
    refused("it has none", **{"run.start": {**start, "special_curve": 0}})
    refused("another structure", **{"run.start": start, "beam.thickness": 0.004})
    refused("harmonic excitation", **{"run.start": start, "excitation": {"kind": "none"}})
    ran = beamsim.write_result(
        beamsim.run(load_scenario(BEAM, {"run.duration": 0.01, "run.spectrum.last": None})), folder / "run.h5"
    )
    refused("holds no continuation", **{"run.start": {**start, "orbit": str(ran)}})
    text = str(folder / "text.h5")
    Path(text).write_text("no HDF5")
    refused("damaged; run the continuation again", **{"run.start": {**start, "orbit": text}})
    with pytest.raises(ScenarioError, match="starts a run"):
        build_system(load_scenario(BEAM, {"run.start": start}))
