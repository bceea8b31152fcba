"""Comparison of sweeps with measured ones: peaks, Q, FRAC and FDAC, and files as laboratories write them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import wofz

from beamsim.analyses.compare.sweeps import Tracking, compare_sweep, track
from beamsim.analyses.sweep.analysis import sweep
from beamsim.errors import ScenarioError
from beamsim.measurements.channels import read_signals
from beamsim.measurements.functions import BY_NUMBER
from beamsim.measurements.read import read_file
from beamsim.measurements.signal import MeasuredSignal
from beamsim.scenario import load_scenario
from beamsim.signals.mac import modal_assurance
from beamsim.signals.resonance_peaks import peaks_of
from beamsim.store.results import load, write_result
from tests.helpers.commands import invoke
from tests.helpers.universal_files import function

G = 9.80665
CASE = {
    "chain": {"masses": [1, 0.5], "springs": [39478.4, 60000, 0], "damping": {"kind": "modal", "ratio": "2 %"}},
    "excitation": {"kind": "harmonic", "applied_to": "base", "level": "1 g", "frequency": "20 Hz"},
    "probes": [{"name": "first", "mass": 1}, {"name": "second", "mass": 2}],
    "sweep": {
        "kind": "swept_sine",
        "from": "15 Hz",
        "to": "35 Hz",
        "rate": "30 oct/min",
        "orders": [1],
        "history_rate": "2 kHz",
    },
}


@pytest.fixture(scope="module")
def swept():
    return sweep(load_scenario(CASE))


@pytest.fixture(scope="module")
def stored(swept, tmp_path_factory):
    path = tmp_path_factory.mktemp("swept") / "sweep.h5"
    write_result(swept, path)
    return path


def measured(swept, place, factor=1.0, shift=1.0, *, complex_values=True):
    """The sweep itself with another level and other frequencies, as a laboratory's channel."""
    curve = swept.curves["up_0"]
    of = curve.channel("absolute_acceleration", place)
    y = factor * (of.harmonics[0] if complex_values else of.peak)
    return MeasuredSignal(f"{place} absolute acceleration", shift * curve.frequency_hz, y, True, "m/s^2")


@pytest.mark.parametrize("complex_values", [True, False])
def test_a_louder_and_stiffer_specimen_is_told(swept, complex_values):
    """1.5 times the level is 3.52 dB, and frequencies that are 4 % higher shift the peak and lower FRAC."""
    signal = measured(swept, "second", 1.5, 1.04, complex_values=complex_values)
    (channel,) = compare_sweep(swept, [("second", "absolute_acceleration", signal)]).sweeps
    assert channel.detector == ("fundamental" if complex_values else "peak")
    peak = max(channel.peaks, key=lambda each: each.measured_level)
    assert peak.frequency_difference == pytest.approx(1 / 1.04 - 1, abs=2e-3)
    assert peak.difference_db == pytest.approx(-20 * np.log10(1.5), abs=0.05)
    assert channel.frac < 0.9


def test_q_is_given_of_a_sweep_that_is_slow_enough(swept, tmp_path):
    """At 30 oct/min no peak has the Q of its damping; at 5 oct/min one of 5 % has, as the file says, too."""
    slow = sweep(load_scenario(CASE, {"sweep.rate": "5 oct/min", "chain.damping.ratio": 0.05}))
    of_fast, of_slow = (
        compare_sweep(each, [("second", "absolute_acceleration", measured(each, "second"))]) for each in (swept, slow)
    )
    assert all(np.isnan([peak.predicted_q, peak.measured_q]).all() for peak in of_fast.sweeps[0].peaks)
    peak = max(of_slow.sweeps[0].peaks, key=lambda each: each.measured_level)
    assert peak.predicted_q == pytest.approx(1 / (2 * 0.05), rel=0.05)
    assert peak.measured_q == pytest.approx(peak.predicted_q, rel=1e-6)
    write_result(of_slow, tmp_path / "slow.h5")
    stored = max(load(tmp_path / "slow.h5", "compare").sweeps[0].peaks, key=lambda each: each.measured_level)
    assert stored.predicted_q == peak.predicted_q


def test_q_of_an_oscillator_is_that_of_its_damping():
    zeta, f = 0.02, np.linspace(5.0, 15.0, 4001)
    r = f / 10.0
    (peak,) = peaks_of(f, 1 / np.abs(1 - r**2 + 2j * zeta * r))
    assert peak[0] == pytest.approx(10 * np.sqrt(1 - 2 * zeta**2), rel=1e-5)
    assert peak[1] == pytest.approx(1 / (2 * zeta * np.sqrt(1 - zeta**2)), rel=1e-5)
    assert peak[2] == pytest.approx(1 / (2 * zeta), rel=2e-3)


@pytest.mark.parametrize("rate_of_bandwidth", [0.05, 0.3, 1.0, 14.0, 300.0])
def test_q_of_a_sweep_is_within_five_percent_or_not_given(rate_of_bandwidth):
    """The envelope of an oscillator that is swept through, by the Faddeeva function; Q is 50."""
    q, natural = 50.0, 65.0
    rate = rate_of_bandwidth * natural**2 / q**2  # Hz/s
    sigma, widths = np.pi * natural / q, 6.0 * (1.0 + np.sqrt(rate_of_bandwidth))
    f = natural + np.linspace(-widths, widths, 20001) * natural / (2 * q)
    mu = np.pi * rate / sigma**2
    s = sigma * (f - natural) / rate
    root = np.sqrt(-1j * mu)
    envelope = np.abs(wofz(1j * (1 + 2j * mu * s) / (2 * root)) / root)
    peak = max(peaks_of(f, envelope, np.full(f.size, rate)), key=lambda each: each.level)
    assert peak.too_fast == (rate_of_bandwidth > 0.35)
    if peak.too_fast:
        assert np.isnan(peak.quality)
    else:
        assert peak.quality == pytest.approx(q, rel=0.05)
    unknown = max(peaks_of(f, envelope), key=lambda each: each.level)
    assert (abs(unknown.quality / q - 1) > 0.05) == peak.too_fast


def test_a_peak_at_a_jump_has_no_q():
    """Half of an oscillator's peak, and nothing beyond it."""
    f = np.linspace(5.0, 15.0, 401)
    r = f / 10.0
    response = np.where(f <= 10.0, 1 / np.abs(1 - r**2 + 0.04j * r), 0.1)
    (peak,) = peaks_of(f, response)
    assert peak[0] == pytest.approx(10.0, abs=0.03)
    assert np.isnan(peak[2])


def test_a_lone_peak_has_no_partner(swept):
    x = np.linspace(16.0, 34.0, 200)
    signal = MeasuredSignal("second", x, 1.0 + np.exp(-(((x - 20.0) / 0.5) ** 2)) * 5, True, "m/s^2")
    (channel,) = compare_sweep(swept, [("second", "absolute_acceleration", signal)]).sweeps
    (lone,) = channel.peaks
    assert np.isnan(lone.predicted_hz)
    assert lone.measured_hz == pytest.approx(20.0, abs=0.05)


def test_frac_ignores_a_factor_and_notices_a_difference():
    one = np.exp(1j * np.linspace(0, 3, 50))
    assert modal_assurance(one[:, None], -2.5j * one[:, None]) == pytest.approx(1.0, abs=1e-12)
    assert modal_assurance(one[:, None], one.conj()[:, None]) < 0.5


@pytest.mark.parametrize(
    ("signal", "words"),
    [
        (MeasuredSignal("second", np.arange(2000) / 50, np.ones(2000)), "is sampled at 50 Hz"),
        (MeasuredSignal("second", np.arange(50) / 1000, np.ones(50)), "0 cycles"),
        (MeasuredSignal("second", np.linspace(1.0, 14.0, 50), np.ones(50), True), "0 frequencies"),
    ],
)
def test_what_cannot_be_compared_is_refused(swept, signal, words):
    with pytest.raises(ScenarioError, match=words):
        compare_sweep(swept, [("second", "absolute_acceleration", signal)])
    with pytest.raises(ScenarioError, match="unknown"):
        compare_sweep(swept, [], curve="down_0")


def record_of(swept, late=0.3):
    """Time of a record that begins before the sweep, the excitation and the response of the second mass in it."""
    history, curve = swept["histories"], swept.curves["up_0"]
    before = np.arange(round(2000 * late)) / 2000
    rate = np.log(2) * 30 / 60
    drive = G * np.sin(2 * np.pi * 15 * np.expm1(rate * history["time"].values) / rate)
    at_rest = np.zeros(before.size)
    time = np.append(before, history["time"].values + late)
    response = np.append(at_rest, history["absolute_acceleration"].sel(probe="second").values)
    assert curve.time[0] == 0.0
    return time, np.append(at_rest, drive), response


def test_a_tracked_history_is_what_the_sweep_computes(swept):
    """The history of the sweep itself, resampled at its cycles, against the exact values of each cycle."""
    time, _, response = record_of(swept)
    of = track(swept.curves["up_0"], MeasuredSignal("second", time, response), 0.3)
    envelope = swept.curves["up_0"].channel("absolute_acceleration", "second")
    known = slice(of.frequency_hz.size)
    size = envelope.peak.max()
    np.testing.assert_allclose(of.frequency_hz, swept.curves["up_0"].frequency_hz[known], rtol=1e-12)
    np.testing.assert_allclose(of.fundamental, envelope.harmonics[0][known], atol=1e-3 * size)
    np.testing.assert_allclose(of.peak, envelope.peak[known], atol=1e-3 * size)
    np.testing.assert_allclose(of.rms, envelope.rms[known], atol=1e-3 * size)


def test_time_histories_of_a_test(swept, stored, tmp_path):
    """A CSV with the excitation beside the response: where the sweep begins is found, and phases are compared."""
    time, drive, response = record_of(swept)
    rows = "".join(f"{t:.4f},{a:.6f},{b:.6f}\n" for t, a, b in zip(time, drive / G, response / G, strict=True))
    (tmp_path / "test.csv").write_text("time (s),drive (g),second (g)\n" + rows)
    arguments = [
        "compare",
        stored,
        str(tmp_path / "test.csv"),
        "--no-plots",
        "--channel",
        "second (g)",
    ]
    options = ["-v", "-o", str(tmp_path / "c.h5"), "--reference", "drive", "--cycles", "4"]
    done = invoke(*arguments, *options)
    assert done.exit_code == 0, done.output
    assert any(line.split()[:2] == ["bandwidth", "0.25"] for line in done.output.splitlines())
    (channel,) = load(tmp_path / "c.h5", "compare").sweeps
    assert channel.begin_s == pytest.approx(0.3, abs=2e-3)
    assert channel.has_phase
    assert channel.frac > 1 - 1e-4


@pytest.mark.parametrize("heading", ["second (mm)", "second_mm"])
def test_the_unit_of_a_heading_says_what_was_measured(swept, stored, tmp_path, heading):
    """`second (mm)` was taken for an acceleration: `--unit is missing, and test.csv has values in mm`."""
    time, drive, _ = record_of(swept)
    rows = "".join(f"{t:.4f},{a:.6f},{a:.6f}\n" for t, a in zip(time, drive / G, strict=True))
    (tmp_path / "test.csv").write_text(f"time (s),base (mm),{heading}\n" + rows)
    arguments = ("compare", stored, tmp_path / "test.csv", "--no-plots", "-o", tmp_path)
    done = invoke(*arguments, "--reference", "base")
    assert done.exit_code == 0, done.output
    (channel,) = load(tmp_path / "sweep_compare.h5", "compare").sweeps
    assert (channel.place, channel.quantity, channel.unit) == ("second", "displacement", "m")
    # what a name and its unit contradict is still refused, and so is another quantity that is asked for
    (tmp_path / "test.csv").write_text("time (s),base (mm),second acceleration (mm)\n" + rows)
    assert "in mm, which must be an acceleration" in invoke(*arguments, "--reference", "base").output


def test_where_the_sweep_begins_is_found_without_the_excitation(swept):
    time, _, response = record_of(swept, late=3.0)
    signal = MeasuredSignal("second", time, response)
    (channel,) = compare_sweep(swept, [("second", "absolute_acceleration", signal)]).sweeps
    assert channel.begin_s == pytest.approx(3.0, abs=0.05)
    assert not channel.has_phase
    assert channel.frac > 0.99
    other = MeasuredSignal("second", 0.6 * time, response)  # a faster test
    with pytest.raises(ScenarioError, match="use the rate and range"):
        compare_sweep(swept, [("second", "absolute_acceleration", other)])


def test_tracking_that_cannot_be_is_refused(swept):
    time, drive, response = record_of(swept)
    history = ("second", "absolute_acceleration", MeasuredSignal("second", time, response))
    excitation = MeasuredSignal("drive", time, drive)
    over_frequency = ("second", "absolute_acceleration", measured(swept, "second"))
    stepped = replace(
        swept, datasets=swept.datasets | {"curves": swept["curves"].assign(kind=np.array(["stepped"], dtype=object))}
    )
    for result, pair, detector, tracking, words in (
        (swept, history, None, Tracking(0.9, excitation), "does not follow the sweep"),
        (swept, history, "peak", Tracking(0.3, cycles=3), "leave one of them out"),
        (swept, over_frequency, None, Tracking(cycles=3), "belong to time histories"),
        (stepped, history, None, None, "the sweep is stepped"),
    ):
        with pytest.raises(ScenarioError, match=words):
            compare_sweep(result, [pair], detector=detector, tracking=tracking)


CHANNELS = "first absolute acceleration;second absolute acceleration"
HEADERS = {
    "titles and a row of units": (f"Sine sweep;;\nRun 7;2026;\nFrequency;{CHANNELS}\nHz;g;g\n", ";", ","),
    "units in the headings": (f"frequency (Hz);{CHANNELS.replace(';', ' (g);')} (g)\n".replace(";", ","), ",", "."),
    "tabs and units in brackets": (f"Frequency;{CHANNELS}\n[Hz];[g];[g]\n".replace(";", "\t"), "\t", ","),
    "not called absolute": ("Frequency;first acceleration;second acceleration\nHz;g;g\n", ";", ","),
}


@pytest.mark.parametrize("kind", HEADERS)
def test_csv_files_of_laboratories(swept, stored, tmp_path, kind):
    header, separator, point = HEADERS[kind]
    curve = swept.curves["up_0"]
    columns = [curve.frequency_hz, *(curve.channel("absolute_acceleration", p).peak / G for p in ("first", "second"))]
    rows = [separator.join(f"{v:.9g}".replace(".", point) for v in row) for row in zip(*columns, strict=True)]
    path = tmp_path / "test.csv"
    path.write_text(header + "\n".join(rows) + "\n")
    signals = read_signals(path)
    assert [signal.unit for signal in signals] == ["g", "g"]
    assert all(signal.is_over_frequency for signal in signals)
    np.testing.assert_allclose(signals[1].y, columns[2], rtol=1e-8)
    assert [signal.unit for signal in read_file(path)] == ["Hz", "g", "g"]
    target = tmp_path / "sweep_compare.h5"
    done = invoke("compare", stored, path, "--no-plots", "-v", "-o", target)
    assert done.exit_code == 0, done.output
    assert "FRAC" in done.output
    assert "FDAC" in done.output
    sweeps = load(target, "compare").sweeps
    assert [channel.place for channel in sweeps] == ["first", "second"]
    assert min(channel.frac for channel in sweeps) > 1 - 1e-9


def test_a_fault_right_above_the_samples_is_still_one(tmp_path):
    (tmp_path / "bad.csv").write_text("frequency (Hz),second (g)\nabc,1.0\n2,1\n3,1\n")
    with pytest.raises(ScenarioError, match="sample 1 of frequency"):
        read_signals(tmp_path / "bad.csv")


def test_stored_and_drawn(swept, tmp_path):
    pairs = [(place, "absolute_acceleration", measured(swept, place, 1.1, 1.02)) for place in ("first", "second")]
    comparison = compare_sweep(swept, pairs)
    write_result(comparison, tmp_path / "c.h5")
    stored = load(tmp_path / "c.h5", "compare")
    np.testing.assert_array_equal(stored.assurance.fdac, comparison.assurance.fdac)
    qualities = [[peak.measured_q for peak in each.sweeps[0].peaks] for each in (stored, comparison)]
    np.testing.assert_array_equal(*qualities)
    figures = comparison.plot()
    assert set(figures) == {"first_absolute_acceleration", "second_absolute_acceleration", "fdac"}
    for figure in figures.values():
        figure.savefig(tmp_path / "picture.png", dpi=40)


def response(swept, *, over, kind=4, level=1.0):
    """The sweep as a frequency response: a data set 58 of the second probe over what excites it."""
    curve = swept.curves["up_0"]
    f = np.arange(16.0, 34.0, 0.1)
    values = curve.channel("absolute_acceleration", "second").harmonics[0]
    phase = np.interp(f, curve.frequency_hz, np.unwrap(np.angle(values)))
    y = np.interp(f, curve.frequency_hz, np.abs(values)) * np.exp(1j * phase) / level
    fields = {"kind": kind, "over": over, "begin": f[0], "step": 0.1, "axis": (0, "", "Hz"), "name": "second"}
    return function(y, **fields)


@pytest.mark.parametrize(("kind", "unit", "level"), [(4, "g", G), (5, "m/s^2", 1.0)])
def test_a_frequency_response_times_its_level_is_compared_with_the_sweep(stored, swept, tmp_path, kind, unit, level):
    (tmp_path / "a.uff").write_text(response(swept, over=(12, "", unit), kind=kind, level=G / level))
    output = ["-o", tmp_path / "c.h5", "--no-plots"]
    without = invoke("compare", stored, tmp_path / "a.uff", *output)
    assert without.exit_code == 2
    assert "a structure with stops responds differently at each level; give" in without.stderr
    assert f"--level '2 {unit}'" in without.stderr
    assert invoke("compare", stored, tmp_path / "a.uff", "--level", "1 g", *output).exit_code == 0
    result = load(tmp_path / "c.h5")
    (channel,) = result.sweeps
    assert channel.frac == pytest.approx(1.0, abs=1e-4)
    assert channel.peaks[0].difference_db == pytest.approx(0.0, abs=0.05)
    assert channel.channel == "second, times 1 g"
    assert result.warnings == ()


def test_a_response_at_another_level_is_warned_of_and_one_to_a_force_refused(stored, swept, tmp_path):
    (tmp_path / "a.uff").write_text(response(swept, over=(12, "", "g"), level=G))
    output = ["-o", tmp_path / "c.h5", "--no-plots"]
    assert invoke("compare", stored, tmp_path / "a.uff", "--level", "2 g", *output).exit_code == 0
    (warning,) = load(tmp_path / "c.h5").warnings
    assert "second was measured at 19.61 m/s^2, but the sweep is computed at 9.807 m/s^2" in warning
    (tmp_path / "a.uff").write_text(response(swept, over=(13, "", "N")))
    refused = invoke("compare", stored, tmp_path / "a.uff", "--level", "2 N")
    assert refused.exit_code == 2
    assert "was measured with an excitation in N, but the sweep has an excitation in m/s^2" in refused.stderr


@pytest.mark.parametrize("kind", [2, 3, 6, 9, 10, 18, 24])
def test_what_is_no_amplitude_is_not_compared_with_a_sweep(stored, swept, tmp_path, kind):
    (tmp_path / "a.uff").write_text(response(swept, over=(0, "", "NONE"), kind=kind))
    refused = invoke("compare", stored, tmp_path / "a.uff", "--unit", "g")
    assert refused.exit_code == 2
    assert f"{BY_NUMBER[kind]} in second" in refused.stderr
    assert "a comparison with a sweep needs a time history, an amplitude spectrum" in refused.stderr


def test_channels_that_cannot_be_compared_are_left_out_where_others_can(stored, swept, tmp_path):
    coherence = response(swept, over=(0, "", "NONE"), kind=6).replace("second", "second absolute acceleration")
    (tmp_path / "a.uff").write_text(coherence + response(swept, over=(0, "", "NONE"), kind=12))
    assert invoke("compare", stored, tmp_path / "a.uff", "-o", tmp_path / "c.h5", "--no-plots").exit_code == 0
    assert load(tmp_path / "c.h5").sweeps[0].frac == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize("unit", ["g/N", "g^2/Hz"])
def test_signals_from_python_are_asked_for_their_function_type(swept, unit):
    signal = replace(measured(swept, "second"), unit=unit)
    with pytest.raises(ScenarioError, match="a comparison with a sweep needs a time history or an amplitude spectrum"):
        compare_sweep(swept, [("second", "absolute_acceleration", signal)])
