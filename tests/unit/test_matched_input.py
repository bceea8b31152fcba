"""Records made for a shock response spectrum, against an independent recursive filter."""

import os

import numpy as np
import pytest
import yaml
from scipy.signal import lfilter

import beamsim
from beamsim.analyses.run.motion import output_times
from beamsim.cli.tables import all_rows
from beamsim.errors import ScenarioError
from beamsim.inputs.excitation import base_motion
from beamsim.scenario import load_scenario
from beamsim.store.results import load, write_result
from beamsim.system.build import build_system

G = 9.80665
SHOCK = {"srs": [[100, "20 g"], [2000, "500 g"]], "quality": 10, "duration": 0.05}
FLOOR = {"srs": [[1, "0.5 g"], [3, "3 g"], [8, "3 g"], [16, "1 g"], [50, "1 g"]], "quality": 20, "duration": 20.0}


def case(**excitation):
    return {
        "chain": {"masses": [1.0], "springs": [4e6], "dashpots": [100.0]},
        "excitation": {"kind": "matched", "applied_to": "base", **excitation},
        "probes": [{"name": "mass", "mass": 1}],
        "run": {"duration": 1.5 * excitation["duration"], "sample_rate": 2000, "convergence": "off"},
    }


def smallwood(samples, step, hz, quality):
    """Largest absolute acceleration by D. O. Smallwood's filter, Shock and Vibration Bulletin 51, 1981."""
    damping, omega = 0.5 / quality, 2 * np.pi * hz
    e = np.exp(-damping * omega * step)
    k = omega * step * np.sqrt(1 - damping**2)
    b = [1 - e * np.sin(k) / k, 2 * e * (np.sin(k) / k - np.cos(k)), e * (e - np.sin(k) / k)]
    return np.abs(lfilter(b, [1, -2 * e * np.cos(k), e * e], samples)).max()


@pytest.mark.parametrize("given", [SHOCK, FLOOR])
@pytest.mark.parametrize("seed", [0, 1])
def test_the_spectrum_of_a_record_is_the_curve_and_it_ends_at_rest(given, seed):
    """Within 1.6 dB everywhere and at the points, by samples ten times as fine as those that it is made of."""
    motion = base_motion(load_scenario(case(**given, seed=seed)).excitation)
    at = np.array([f for f, _ in given["srs"]], dtype=float)
    level = np.array([float(a.split()[0]) for _, a in given["srs"]]) * G
    end = given["duration"]
    step = 1 / (100 * at[-1])
    time = np.arange(0.0, end + 2 / at[0], step)
    samples = motion.acceleration(time)
    frequency = np.union1d(np.geomspace(at[0], at[-1], 40), at)
    curve = np.exp(np.interp(np.log(frequency), np.log(at), np.log(level)))
    found = np.array([smallwood(samples, step, hz, given["quality"]) for hz in frequency])
    assert np.abs(20 * np.log10(found / curve)).max() < 1.6
    velocity, displacement = motion.velocity(time), motion.displacement(time)
    after = time >= end
    assert np.abs(samples[time > end]).max() < 1e-30
    assert np.abs(velocity[after]).max() < 1e-11 * np.abs(velocity).max()
    assert np.abs(displacement[after]).max() < 1e-10 * np.abs(displacement).max()
    another = base_motion(load_scenario(case(**given, seed=7)).excitation).acceleration(time)
    assert np.abs(samples - another).max() > 0.1 * np.abs(samples).max()


def test_the_misfit_of_a_run_is_that_of_its_record(tmp_path):
    """The stated spectrum by the independent filter; a file says the same as points."""
    (tmp_path / "curve.csv").write_text("frequency (Hz),acceleration (g)\n100,20\n2000,500\n", encoding="utf-8")
    result = beamsim.run(load_scenario(case(**SHOCK)))
    short = {"run.duration": 0.051, "run.sample_rate": 1000.0}
    other = beamsim.run(load_scenario(case(**SHOCK | {"srs": str(tmp_path / "curve.csv")}), short))
    matched = {name: array.values for name, array in result["matched"].sel(base_motion="z").items()}
    np.testing.assert_allclose(matched["reached"], other["matched"]["reached"].values[0], rtol=1e-12)
    np.testing.assert_allclose(matched["target"][[0, -1]], [20 * G, 500 * G])
    step = 1 / 400_000
    time = np.arange(0.0, 0.08, step)
    samples = base_motion(result.scenario.excitation).acceleration(time)
    found = [smallwood(samples, step, hz, 10) for hz in matched["frequency_hz"]]
    np.testing.assert_allclose(matched["reached"], found, rtol=2e-3)
    misfit = 20 * np.log10(matched["reached"] / matched["target"])
    assert result.summary["matched"]["lowest_db"] == pytest.approx(misfit.min())
    assert result.summary["matched"]["highest_db"] == pytest.approx(misfit.max())
    assert any("dB from the curve" in text for _, text in all_rows("run", result))
    (chart,) = result.plot()["matched_spectrum"].axes
    assert "dB from the curve" in chart.get_title(loc="left")


def test_the_curve_of_a_result_is_that_which_was_solved(tmp_path, monkeypatch):
    """A result that is opened elsewhere finds it where the case was."""
    for name in ("case", "results", "elsewhere"):
        (tmp_path / name).mkdir()
    curve = tmp_path / "case" / "curve.csv"
    curve.write_text("frequency (Hz),acceleration (g)\n100,20\n2000,500\n")
    os.utime(curve, (1e9, 1e9))  # one that is as new as the result may have been changed since
    (tmp_path / "case" / "case.yaml").write_text(yaml.safe_dump(case(**SHOCK | {"srs": "curve.csv"})))
    monkeypatch.chdir(tmp_path / "elsewhere")
    result = beamsim.run(load_scenario(tmp_path / "case" / "case.yaml"))
    write_result(result, tmp_path / "results" / "case.h5")
    again = build_system(load(tmp_path / "results" / "case.h5").scenario)
    np.testing.assert_array_equal(
        again.base[0].acceleration(result["histories"]["time"].values),
        result["histories"]["base_acceleration"].values[0],
    )


def test_a_linear_oscillator_under_the_record_has_the_level_of_the_curve():
    """A mass of 318 Hz with Q = 20 on the base is the oscillator of that frequency; its level is the curve's within
    the misfit that is stated.
    """
    hz = np.sqrt(4e6) / (2 * np.pi)
    given = case(**SHOCK | {"quality": 20.0})
    given["run"]["srs"] = {"quality": 20.0, "from": hz, "to": 2 * hz, "per_octave": 1}
    result = beamsim.run(load_scenario(given))
    peak = result.summary["peak_acceleration_g"]["mass"] * G
    assert peak == pytest.approx(result["srs"]["maximax"].values[0, 0], rel=1e-4)
    level = 20 * G * np.exp(np.log(25.0) * np.log(hz / 100) / np.log(20.0))
    misfit = result.summary["matched"]
    assert misfit["lowest_db"] - 0.5 < 20 * np.log10(peak / level) < misfit["highest_db"] + 0.5


def test_samples_and_modes_follow_the_band_of_the_curve(tmp_path):
    """Ten samples in a period of its end, and modes up to ten times that; a file says the same as points."""
    (tmp_path / "curve.csv").write_text("frequency (Hz),acceleration (g)\n100,20\n2000,500\n", encoding="utf-8")
    beam = {"length": 1.0, "bending_stiffness": 20.0, "mass_per_length": 1.0, "elements": 120,
            "supports": {"left": "pinned", "right": "pinned"}}  # fmt: skip
    kept = []
    for srs in (SHOCK["srs"], str(tmp_path / "curve.csv"), [[100, "20 g"], [500, "500 g"]]):
        given = case(**SHOCK | {"srs": srs}) | {"beam": beam, "probes": [{"name": "p", "position": 0.5}],
                                                "run": {"duration": 0.06, "convergence": "off"}}  # fmt: skip
        del given["chain"]
        scenario = load_scenario(given)
        kept.append((1.0 / output_times(scenario)[1], build_system(scenario).modes["highest_frequency_hz"].item()))
    assert kept[0] == kept[1]
    for (rate, highest), end in zip(kept[1:], (2000.0, 500.0), strict=True):
        assert rate >= 10.0 * end
        assert rate / (10.0 * end) == pytest.approx(round(rate / (10.0 * end)), rel=1e-12)
        assert highest == pytest.approx(10.0 * end)


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        ({"duration": 0.01}, "is shorter than 1.5 cycles"),
        ({"srs": [[100, "20 g"]]}, "has 1 value, but takes at least 2"),
        ({"srs": [[100, "20 g"], [50, "20 g"]]}, "50 Hz"),
        ({"applied_to": {"mass": 1}}, "acceleration of the base"),
        ({"srs": "none.csv"}, "none.csv"),
        ({"duration": 1e3}, "samples up to 2000 Hz"),
    ],
)
def test_what_cannot_be_matched_is_refused(changed, text):
    with pytest.raises(ScenarioError, match=text):
        base_motion(load_scenario(case(**SHOCK | changed)).excitation)


def test_a_run_does_not_end_before_its_record():
    with pytest.raises(ScenarioError, match="ends before the matched record"):
        load_scenario(case(**SHOCK) | {"run": {"duration": 0.04}})


def test_records_for_two_axes_differ_and_each_has_its_spectrum():
    """Two motions with curves of their own over other bands: the statement is that of the one further off."""
    other = {"srs": [["200 Hz", "30 g"], ["1 kHz", "100 g"]], "duration": "30 ms", "quality": 20}
    beam = {"length": 0.3, "width": 0.03, "thickness": 0.01, "youngs_modulus": 70e9, "density": 2700, "elements": 4}
    matched = {"kind": "matched", "applied_to": "base"}
    forces = [{**matched, **SHOCK}, {**matched, **other}, {**matched, **other}]
    result = beamsim.run(load_scenario({
        "beam": {**beam, "damping": {"kind": "modal", "ratio": 0.02}}, "probes": [{"name": "p", "position": 0.3}],
        "excitation": {"kind": "forces", "forces": forces},
        "run": {"duration": 0.06, "start": "rest", "convergence": "off"},
    }))  # fmt: skip
    spectra, records = result["matched"], result["histories"]["base_acceleration"].values
    assert spectra.labels("base_motion") == ["z", "z 2", "z 3"]
    assert spectra["quality"].values.tolist() == [10.0, 20.0, 20.0]
    assert np.abs(records[1] - records[2]).max() > 0.1 * np.abs(records[1]).max()
    worst = np.nanmax(np.abs(spectra["misfit_db"].values), axis=1)
    stated = result.summary["matched"]
    assert max(-stated["lowest_db"], stated["highest_db"]) == pytest.approx(worst.max())
    band = spectra["frequency_hz"].values[np.isfinite(spectra["target"].values[1])]
    assert band[[0, -1]].tolist() == [200.0, 1000.0]
    assert len(result.plot()["matched_spectrum"].axes) == 3
