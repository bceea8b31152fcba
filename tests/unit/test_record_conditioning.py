"""Records as they are measured: rounded time stamps, offsets, digits, filters, signs; what is done is stated."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from typer.testing import CliRunner

import beamsim
from beamsim.errors import ScenarioError
from beamsim.inputs.measured import read_record
from beamsim.measurements.channels import read_signals
from beamsim.measurements.conditioning import high_pass, resample_signal, resolution, rounding_warnings, with_even_times
from beamsim.measurements.signal import MeasuredSignal
from beamsim.scenario import load_scenario

G = 9.80665
CHAIN = {
    "chain": {"masses": [1], "springs": [39478.4176], "damping": {"kind": "modal", "ratio": "5 %"}},
    "probes": [{"name": "m", "at": {"mass": 1}}],
}


def case(file, duration=0.5, **more):
    excitation = {"kind": "sampled", "applied_to": "base", "file": str(file), **more}
    return {**CHAIN, "excitation": excitation, "run": {"duration": duration, "start": "rest", "convergence": "off"}}


def write(path, time, values, form="%.6f,%.8f", heading="time (s),acc (m/s^2)"):
    rows = [form % row for row in zip(time, values, strict=True)]
    path.write_text("\n".join([heading, *rows]), encoding="utf-8")
    return path


def record(file, **more):
    return read_record(load_scenario(case(file, **more)).excitation)


def signal(time, values, **more):
    return MeasuredSignal("acc", time, values, unit="m/s^2", source="acc", axis="time", axis_unit="s", **more)


RATES = [
    (2048.0, 4, 1.0), (2048.0, 3, 1e-3), (1024.0, 3, 1.0), (51200.0, 5, 1.0), (44100.0, 5, 1.0), (3000.0, 4, 1.0),
    (1652.9, 4, 1.0), (4096.0, 4, 1.0), (60.0, 2, 1.0),
]  # fmt: skip


@pytest.mark.parametrize(("rate", "decimals", "unit"), RATES)
def test_rounded_time_stamps_get_the_sampling_rate_that_fits_them(rate, decimals, unit):
    """A rate, the decimals of the stamps, and their unit in seconds."""
    time = np.arange(4000) / rate
    stamps = np.round(time / unit, decimals)
    read = with_even_times(
        MeasuredSignal("a", stamps, np.sin(time), axis="t", axis_unit={1.0: "s", 1e-3: "ms"}[unit], unit="g")
    )
    half = 0.5 * 10.0**-decimals
    assert np.abs(read.x - stamps).max() <= half * (1 + 1e-5)
    assert np.ptp(np.diff(read.x)) < 1e-9 * np.diff(read.x).mean()
    found = (read.x.size - 1) / (read.x[-1] - read.x[0]) / unit
    assert found == pytest.approx(rate, rel=1e-9 if rate != 1652.9 else 2e-4)
    assert f"{found:.7g} Hz" in read.scaling[0]
    warned = bool(np.ptp(np.diff(stamps)) > 1e-3 * np.diff(stamps).mean())
    assert [f"{10.0**-decimals:g}" in text for text in read.warnings] == [True] * warned


@pytest.mark.parametrize(
    "stamps",
    [
        np.arange(100) * 1e-3,  # even
        np.delete(np.arange(100) * 1e-3, 40),  # a gap
        np.sort(np.append(np.arange(100) * 1e-3, 0.04)),  # a line that stands twice
        np.cumsum(np.where(np.arange(200) % 2, 1e-3, 3e-3)),  # two steps in turn
        np.round(np.linspace(0, 1, 300) ** 1.5, 4),  # a rate that changes
        np.cumsum(np.random.default_rng(0).uniform(1e-3, 2e-3, 300)),  # full precision
    ],
)
def test_stamps_that_no_single_rate_explains_stay_as_they_are(stamps):
    read = with_even_times(signal(stamps, np.sin(stamps)))
    assert read.x is stamps
    assert read.warnings == ()


@pytest.mark.parametrize("form", ["%.5g", "%.4g", "%.6g", "%.4e", "%.7g"])
@pytest.mark.parametrize("rate", [2048.0, 44_100.0, 1000.0])
def test_stamps_of_few_significant_digits_as_matlab_and_numpy_write_them(form, rate):
    stamps = np.array([float(form % t) for t in np.arange(6000) / rate])
    read = with_even_times(signal(stamps, np.sin(stamps)))
    assert (read.x.size - 1) / (read.x[-1] - read.x[0]) == pytest.approx(rate, rel=2e-7)


def test_stamps_in_single_precision_and_cut_stamps():
    exact = np.arange(50_000) / 3000.0
    for stamps in (exact.astype(np.float32).astype(float), np.floor(exact * 1e4) / 1e4):
        read = with_even_times(signal(stamps, np.sin(stamps)))
        assert (read.x.size - 1) / (read.x[-1] - read.x[0]) == pytest.approx(3000.0, rel=1e-9)


def test_a_record_with_rounded_stamps_gives_the_motion_of_the_exact_ones(tmp_path):
    """A sweep through the resonance, written at 2048 Hz with four decimals."""
    t = np.arange(4096) / 2048
    a = 5.0 * np.sin(2 * np.pi * (10 * t + 60 * t**2))
    exact, rounded = (
        beamsim.run(load_scenario(case(write(tmp_path / name, t, a, form), 1.9)))
        for name, form in (("exact.csv", "%.12f,%.8f"), ("rounded.csv", "%.4f,%.8f"))
    )
    of_exact, of_rounded = (run["histories"]["absolute_acceleration"].sel(probe="m").values for run in (exact, rounded))
    assert np.abs(of_rounded - of_exact).max() < 1e-6 * np.abs(of_exact).max()
    assert any("rounded to 0.0001 s" in text and "2048 Hz" in text for text in rounded.warnings)
    assert "sampled at 2048 Hz" in rounded.summary["inputs"]["excitation"]["treatment"]
    assert not exact.warnings


def test_channels_that_are_compared_get_the_rate_of_rounded_stamps(tmp_path):
    t = np.arange(2048) / 2048
    write(tmp_path / "a.csv", 1e3 * t, np.sin(t), "%.1f,%.8f", "time (ms),m acceleration (g)")
    (read,) = read_signals(tmp_path / "a.csv")
    np.testing.assert_allclose(read.x, t, atol=5.1e-5)
    assert np.ptp(np.diff(read.x)) < 1e-12


@pytest.mark.parametrize(("old", "new"), [(10_000.0, 2000.0), (2048.0, 1000.0), (51_200.0, 1999.5), (4096.0, 4000.0)])
def test_nothing_is_aliased_when_the_sampling_rate_is_lowered(old, new):
    t = np.arange(int(2 * old) + 1) / old
    slow = np.sin(2 * np.pi * 10 * t) + 0.5 * np.cos(2 * np.pi * 100 * t) + 3.0
    low = resample_signal(signal(t, slow), new)
    reached = (low.x.size - 1) / (low.x[-1] - low.x[0])
    assert reached == pytest.approx(new, rel=1e-3)
    expected = np.sin(2 * np.pi * 10 * low.x) + 0.5 * np.cos(2 * np.pi * 100 * low.x) + 3.0
    np.testing.assert_allclose(low.y[50:-50], expected[50:-50], atol=1e-4)
    np.testing.assert_allclose(low.y, expected, atol=0.02)  # also at the ends
    assert "low-pass" in low.scaling[0]
    for f in (0.52 * new, 0.8 * new, 0.98 * new):
        if f < 0.5 * old:
            fast = resample_signal(signal(t, 50.0 * np.sin(2 * np.pi * f * t)), new)
            assert np.abs(fast.y[60:-60]).max() < 50.0 * 2e-5
            assert "takes away 100 %" in fast.warnings[0] or "takes away 99.9 %" in fast.warnings[0]


def test_a_record_with_a_fast_vibration_moves_an_oscillator_as_without_resample(tmp_path):
    """5 g at 1968.4 Hz on 0.1 g at 10 Hz were 50.4 g at 2 kHz. The fast vibration starts with a step of the velocity by
    A / omega, which is kept; independent integration."""
    t = np.arange(10_001) * 1e-4
    omega, fast, level = np.sqrt(39478.4176), 2 * np.pi * 1968.4, 5 * G
    write(tmp_path / "a.csv", t, 0.1 * G * np.sin(2 * np.pi * 10 * t) + level * np.sin(fast * t), "%.4f,%.5f")
    result = beamsim.run(load_scenario(case(tmp_path / "a.csv", 0.9, resample="2 kHz")))
    slow = solve_ivp(
        lambda t, x: [x[1], -0.1 * omega * x[1] - omega**2 * x[0] - 0.1 * G * np.sin(2 * np.pi * 10 * t)],
        (0, 0.9), [0.0, -level / fast], rtol=1e-9, atol=1e-12, max_step=1e-3,
    )  # fmt: skip
    peak = np.abs(-0.1 * omega * slow.y[1] - omega**2 * slow.y[0]).max() / G
    assert result.summary["peak_acceleration_g"]["m"] == pytest.approx(peak, rel=0.02)
    assert any("takes away 99.9 %" in text or "takes away 100 %" in text for text in result.warnings)
    treatment = result.summary["inputs"]["excitation"]["treatment"]
    assert "resampled from 10000 to 2000 Hz" in treatment


def test_a_displacement_begins_as_before_when_it_is_resampled(tmp_path):
    t = np.arange(4096) / 2048
    file = write(tmp_path / "d.csv", t, np.sin(2 * np.pi * 30 * t), "%.9f,%.6f", "time (s),d (mm)")
    low = record(file, quantity="displacement", resample="256 Hz")
    np.testing.assert_allclose(low.y, 1e-3 * np.sin(2 * np.pi * 30 * low.x), atol=2e-6)
    assert low.warnings == ()
    with pytest.raises(ScenarioError, match=r"would have 6 samples at resample = 3 Hz \(at least 80\)"):
        record(file, quantity="displacement", resample="3 Hz")


def test_a_higher_rate_is_interpolated():
    t = np.arange(1001) / 1000
    high = resample_signal(signal(t, np.sin(2 * np.pi * 20 * t)), 2500.0)
    np.testing.assert_allclose(high.y, np.sin(2 * np.pi * 20 * high.x), atol=1e-5)
    assert high.scaling == ("interpolated from 1000 to 2500 Hz",)


def test_a_sensor_upside_down_mean_and_trend(tmp_path):
    t = np.arange(1000) / 1000
    file = write(tmp_path / "a.csv", t, 2.0 + 3.0 * t + np.sin(2 * np.pi * 5 * t))
    turned = record(file, factor=-1)
    np.testing.assert_allclose(turned.y, -(2.0 + 3.0 * t + np.sin(2 * np.pi * 5 * t)), atol=1e-7)
    assert turned.scaling == ("times -1",)
    level = record(file, remove="mean")
    assert level.y.mean() == pytest.approx(0.0, abs=1e-12)
    assert level.scaling[0].startswith("mean of 3.49")
    flat = record(file, remove="trend")
    assert np.polyfit(t, flat.y, 1) == pytest.approx(0.0, abs=1e-9)
    assert "trend of" in flat.scaling[0]


@pytest.mark.parametrize("ratio", [0.25, 0.5, 1.0, 2.0, 5.0])
def test_the_high_pass_filter_is_a_butterworth_filter_without_phase(ratio):
    t = np.arange(20_000) / 1000
    sine = np.sin(2 * np.pi * 5.0 * ratio * t)
    filtered = high_pass(signal(t, sine), 5.0)
    middle = slice(5000, -5000)
    gain = 1.0 / (1.0 + (np.sqrt(2.0) - 1.0) / ratio**4)  # two passes, -3 dB at 5 Hz
    np.testing.assert_allclose(filtered.y[middle], gain * sine[middle], atol=2e-3)


def test_gravity_drift_and_a_high_pass_filter(tmp_path):
    t = np.arange(4000) / 1000
    file = write(tmp_path / "a.csv", t, 9.81 + 0.5 * t + np.sin(2 * np.pi * 30 * t))
    filtered = record(file, high_pass="2 Hz")
    np.testing.assert_allclose(filtered.y[500:-500], np.sin(2 * np.pi * 30 * t)[500:-500], atol=0.02)
    assert "-3 dB at 2 Hz" in filtered.scaling[0]
    with pytest.raises(ScenarioError, match=r"filter from 0\.5"):
        record(file, high_pass="0.1 Hz")


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (lambda t: G + np.sin(2 * np.pi * 30 * t), r"9\.807 m/s\^2 \(1 g\).*contains gravity"),
        (lambda t: -G + 2000 * np.exp(-((t - 0.5) ** 2) / 1e-4), "contains gravity"),  # 0.5 % of the largest value
        (lambda t: 0.3 + np.sin(2 * np.pi * 30 * t), "contains an offset"),
        (lambda t: np.cos(2 * np.pi * 30 * t), r"begins with 1 m/s\^2, 100 % .*as a jump at t = 0"),
        (lambda t: np.exp(-5 * t), "begins with 1 m/s"),
    ],
)
def test_a_value_that_is_not_zero_at_the_start_or_throughout_is_warned_of(tmp_path, values, message):
    t = np.arange(1000) / 1000
    file = write(tmp_path / "a.csv", t, values(t))
    (text,) = record(file).warnings
    import re

    assert re.search(message, text)


@pytest.mark.parametrize(
    "values",
    [
        lambda t: np.sin(2 * np.pi * 30 * t),
        lambda t: np.sin(np.pi * t / t[-1]),  # one half-sine, whose mean is not zero
        lambda t: 0.01 * np.sin(2 * np.pi * 333 * t) + np.exp(-((t - 0.5) ** 2) / 1e-4),  # noise before a shock
        lambda t: np.random.default_rng(2).normal(size=t.size) * np.sin(np.pi * t / t[-1]),
    ],
)
def test_records_that_begin_at_rest_are_not_warned_of(tmp_path, values):
    t = np.arange(1000) / 1000
    assert record(write(tmp_path / "a.csv", t, values(t))).warnings == ()


@pytest.mark.parametrize(("form", "step"), [("%.6f,%.3f", 1e-6), ("%.6f,%.2f", 1e-5), ("%.6f,%.3e", None)])
def test_an_acceleration_from_the_last_digit_of_a_displacement_is_warned_of(tmp_path, form, step):
    """The noise is that which the rounding makes in the derived acceleration, by its difference from the exact one."""
    t = np.arange(4000) / 2000
    d = 1e-4 * np.sin(2 * np.pi * 7.3 * t) ** 3
    file = write(tmp_path / "d.csv", t, 1e3 * d, form, "time (s),d (mm)")
    result = beamsim.run(load_scenario(case(file, 1.5, quantity="displacement")))
    (text,) = [each for each in result.warnings if "derived from the displacement" in each]
    from scipy.interpolate import CubicSpline

    rounded = record(file, quantity="displacement")
    if step:
        assert resolution(rounded.y) == pytest.approx(step, rel=1e-3)
    noise = np.std(CubicSpline(t, rounded.y - d)(t, 2))
    stated = float(text.split("alone gives ")[1].split()[0])
    assert stated == pytest.approx(noise, rel=0.1 if step == 1e-6 else 0.5)  # coarse steps are no white noise


def test_a_displacement_with_enough_digits_is_not_warned_of():
    t = np.arange(4000) / 2000
    for d in (1e-3 * np.sin(2 * np.pi * 7.3 * t), np.round(1e-3 * np.sin(2 * np.pi * 7.3 * t), 9)):
        assert rounding_warnings(signal(t, d), signal(t, d), 1.0, 2) == []


def test_oscillators_above_a_tenth_of_the_sampling_rate_are_warned_of(tmp_path):
    t = np.arange(1024) / 2048
    file = write(tmp_path / "a.csv", t, np.sin(2 * np.pi * 30 * t), "%.12f,%.8f")
    for highest, warned in ((200, False), (1000, True)):
        given = case(file, 0.4)
        given["run"]["srs"] = {"from": 20, "to": highest, "per_octave": 3}
        result = beamsim.run(load_scenario(given))
        found = [text for text in result.warnings if "a tenth of the record's sampling rate, 2048 Hz" in text]
        assert len(found) == warned
        assert all("from 204.8 to 1000 Hz" in text for text in found)


def test_options_of_compare_prepare_the_measurement(tmp_path):
    from beamsim.cli.app import app

    t = np.arange(0, 1, 1e-3)
    write(tmp_path / "base.csv", t, np.sin(2 * np.pi * 10 * t), "%.6f,%.8f")
    import yaml

    (tmp_path / "case.yaml").write_text(yaml.safe_dump(case(tmp_path / "base.csv", 0.9)), encoding="utf-8")
    runner = CliRunner()
    stored = tmp_path / "case.h5"
    assert runner.invoke(app, ["run", str(tmp_path / "case.yaml"), "-o", str(stored), "--no-plots"]).exit_code == 0
    run = beamsim.run(load_scenario(tmp_path / "case.yaml"))
    measured = 9.81 - run["histories"]["absolute_acceleration"].sel(probe="m").values  # upside down, with gravity
    write(
        tmp_path / "m.csv",
        run["histories"]["time"].values,
        measured,
        "%.9f,%.9f",
        "time (s),m absolute acceleration (m/s^2)",
    )
    command = ["compare", str(stored), str(tmp_path / "m.csv"), "--no-plots", "--json", "-o", str(tmp_path / "c.h5")]
    plain = runner.invoke(app, command)
    assert "contains gravity" in plain.output
    import json

    told = runner.invoke(app, [*command, "--factor", "-1", "--remove", "mean"])
    (compared,) = json.loads(told.stdout)["comparisons"]
    assert compared["rms_difference"] < 0.02
    assert "times -1" in compared["channel"]
    refused = runner.invoke(app, [*command, "--factor", "0"])
    assert refused.exit_code == 2
    assert "--factor" in refused.output


def test_keys_of_a_test_of_an_identification_prepare_its_record(tmp_path):
    t = np.arange(1000) / 1000
    write(tmp_path / "m.csv", t, 9.81 - np.sin(2 * np.pi * 20 * t), heading="time (s),m acceleration (m/s^2)")
    test = {"file": "m.csv", "kind": "transient", "factor": -1, "remove": "mean"}
    stop = {"name": "stop", "mass": 1, "side": "below", "stiffness": 1e5, "gap": "1 mm"}
    given = case("m.csv", 0.5) | {"chain": CHAIN["chain"] | {"snubbers": [stop]}}
    given["identify_stiffness"] = {
        "snubber": "stop", "nonlinear": {"estimate": ["chain.snubbers.stop.gap"], "tests": [test]},
    }  # fmt: skip
    (read,) = beamsim.read_tests(load_scenario(given), tmp_path)
    np.testing.assert_allclose(read.y, np.sin(2 * np.pi * 20 * t) - 9.81, atol=1e-7)
    assert read.scaling == ("times -1",)  # what is taken away from a transient is taken away from the motion as well
    test["high_pass"] = "0.5 Hz"
    with pytest.raises(ScenarioError, match=r"tests\[0\]\.file = m\.csv lasts 0\.899 s .*high_pass"):
        beamsim.identify_stiffness(load_scenario(given), [read])
    given["excitation"] = {"kind": "harmonic", "applied_to": "base", "level": "1 g", "frequency": "20 Hz"}
    steady = {"file": "m.csv", "kind": "steady", "factor": -1, "remove": "mean", "frequency": "20 Hz"}
    given["identify_stiffness"]["nonlinear"]["tests"] = [steady]
    (read,) = beamsim.read_tests(load_scenario(given), tmp_path)
    np.testing.assert_allclose(read.y, np.sin(2 * np.pi * 20 * t), atol=1e-7)
    assert read.scaling[0] == "times -1"
    assert read.scaling[1].startswith("mean of -9.81")
