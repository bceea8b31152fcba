"""Spectra and harmonics against Fourier series known in closed form."""

from types import SimpleNamespace

import numpy as np
import pytest

from beamsim.analyses.run.spectra import Label, spectra_of_samples
from beamsim.plots.run import band_levels
from tests.helpers.spectra import spectra_by_signal

pytestmark = pytest.mark.quick

RATE = 20_000.0


def settings(last=None, periods=None, window="hann"):
    return SimpleNamespace(last=last, periods=periods, window=window, frequencies=())


def clock(duration, rate=RATE):
    return np.arange(round(duration * rate) + 1) / rate


def analyse(time, x, excitation_hz=65.0, **how):
    label = Label("tip", "displacement", "m")
    spectra = spectra_of_samples(time, np.asarray(x)[None], [label], settings(**how), excitation_hz, {})
    return spectra_by_signal(spectra)["tip", "displacement"]


def by_kind(result, kind):
    return {round(line.order, 6): line for line in result.lines if line.kind == kind}


@pytest.mark.parametrize("window", ["rectangular", "hann", "blackman", "flattop", "hamming"])
@pytest.mark.parametrize("how", [{"last": 0.4}, {"periods": 26}, {}])
def test_pure_tone_over_whole_periods_shows_its_amplitude(window, how):
    time = clock(0.8)
    x = 3e-4 * np.sin(2 * np.pi * 65 * time + 0.3)
    result = analyse(time, x, window=window, **how)
    top = int(np.argmax(result.amplitude))
    assert result.frequency_hz[top] == pytest.approx(65, rel=1e-12)
    assert result.amplitude[top] == pytest.approx(3e-4, rel=1e-12)
    if window == "rectangular":
        assert np.max(np.delete(result.amplitude, top)) < 1e-12 * 3e-4
    assert result.amplitude_db[top] == pytest.approx(20 * np.log10(3e-4 / np.max(np.abs(x[1:]))), abs=1e-10)


@pytest.mark.parametrize("how", [{"last": 0.39731}, {"periods": 7}, {"periods": 3, "window": "flattop"}])
def test_lines_do_not_leak_when_the_record_is_no_whole_number_of_samples(how):
    # 65.3 Hz: a period is 306.28 samples, so the spectrum leaks and only the projection is exact.
    time = clock(0.8)
    x = 2.0 * np.sin(2 * np.pi * 65.3 * time - 1.0) + 0.5 * np.sin(4 * np.pi * 65.3 * time + 2.0) - 0.25
    result = analyse(time, x, excitation_hz=65.3, **how)
    mean, first, second = result.lines
    assert [line.kind for line in result.lines] == ["mean", "fundamental", "superharmonic"]
    assert (mean.amplitude, mean.phase_deg) == (pytest.approx(0.25, rel=1e-10), 180.0)
    assert first.amplitude == pytest.approx(2.0, rel=1e-11)
    assert first.phase_deg == pytest.approx(np.degrees(-1.0), abs=1e-8)
    assert second.amplitude == pytest.approx(0.5, rel=1e-10)
    assert second.phase_deg == pytest.approx(np.degrees(2.0), abs=1e-8)
    assert second.order == 2.0


@pytest.mark.parametrize("length", [16_000, 15_999])
def test_parseval(length):
    x = np.random.default_rng(1).normal(size=length) + 0.7
    result = analyse(np.arange(length) / RATE, x, np.nan, window="rectangular")
    power = result.amplitude**2
    power[1:] /= 2.0  # a zero-to-peak amplitude A carries A^2 / 2
    if length % 2 == 0:
        power[-1] *= 2.0  # except at half the sample rate
    assert np.sum(power) == pytest.approx(np.mean(x**2), rel=1e-12)


def test_a_band_has_the_root_mean_square_of_its_lines():
    """A line of the peak beside one that is nothing: half the power."""
    middles, levels = band_levels(np.arange(5.0), np.array([0.0, 0.0, 0.0, -400.0, 7.0]), 2)
    np.testing.assert_array_equal(middles, [0.5, 2.5])
    np.testing.assert_allclose(levels, [0.0, -10.0 * np.log10(2.0)], atol=1e-12)


def test_half_wave_rectified_sine():
    # max(sin, 0) = 1/pi + sin/2 - (2/pi) sum cos(2 k w t) / (4 k^2 - 1)
    time = clock(0.8, 200_000.0)
    x = np.maximum(np.sin(2 * np.pi * 65 * time), 0.0)
    result = analyse(time, x, last=0.4)
    lines = {round(line.order): line for line in result.lines}
    assert lines[0].amplitude == pytest.approx(1 / np.pi, rel=1e-6)
    assert lines[1].amplitude == pytest.approx(0.5, rel=1e-6)
    assert lines[1].kind == "fundamental"
    for k in range(1, 11):
        assert lines[2 * k].amplitude == pytest.approx(2 / np.pi / (4 * k**2 - 1), rel=1e-4)
        assert lines[2 * k].kind == "superharmonic"
        assert lines[2 * k].phase_deg == pytest.approx(-90.0, abs=0.01)  # -cos = sin(. - 90 degrees)
    assert not {order for order in lines if order % 2 == 1} - {1}


def test_subharmonics_are_told_from_superharmonics():
    time = clock(0.8)
    orders = {0.5: 0.3, 1 / 3: 0.05, 1.0: 1.0, 1.5: 0.1, 2.0: 0.2, 5 / 3: 0.01}
    x = sum(a * np.sin(2 * np.pi * 160 * order * time + order) for order, a in orders.items())
    result = analyse(time, x, excitation_hz=160.0, last=0.4)
    assert {k: pytest.approx(v.amplitude, rel=1e-9) for k, v in by_kind(result, "subharmonic").items()} == {
        round(k, 6): v for k, v in orders.items() if k % 1
    }
    assert set(by_kind(result, "superharmonic")) == {2.0}
    assert not by_kind(result, "other")


def test_transient_near_a_superharmonic_is_not_taken_for_one():
    time = clock(0.8)
    x = np.sin(2 * np.pi * 65 * time) + 0.3 * np.exp(-6 * time) * np.sin(2 * np.pi * 195.6 * time)
    result = analyse(time, x, last=0.4)
    assert not by_kind(result, "superharmonic")
    (transient,) = by_kind(result, "other").values()
    assert transient.frequency_hz == pytest.approx(195.6, abs=0.3)
    # The same tone without decay, on the order, is one.
    steady = analyse(time, np.sin(2 * np.pi * 65 * time) + 0.3 * np.sin(2 * np.pi * 195 * time), last=0.4)
    assert set(by_kind(steady, "superharmonic")) == {3.0}


def test_noise_makes_no_lines():
    time = clock(0.8)
    noise = np.random.default_rng(7).normal(size=time.size)
    result = analyse(time, np.sin(2 * np.pi * 65 * time) + 0.05 * noise, last=0.4)
    assert [line.kind for line in result.lines] == ["mean", "fundamental"]
    assert [line.kind for line in analyse(time, noise, last=0.4).lines] == ["mean"]


def test_without_excitation_the_main_peaks_are_listed():
    time = clock(1.0)
    x = 1.0 + 0.5 * np.sin(2 * np.pi * 52.7 * time) + 0.01 * np.sin(2 * np.pi * 328.5 * time)
    result = analyse(time, x, excitation_hz=np.nan)
    assert [line.kind for line in result.lines] == ["mean", "other", "other"]
    assert [line.frequency_hz for line in result.lines] == pytest.approx([0, 52.7, 328.5], abs=0.01)
    assert [line.amplitude for line in result.lines] == pytest.approx([1.0, 0.5, 0.01], rel=1e-3)
    assert all(np.isnan(line.order) for line in result.lines)


def test_a_drift_does_not_leak_into_the_lines():
    time = clock(0.4)
    x = 20.0 * time + 1e-3 * np.sin(2 * np.pi * 235 * time)
    (line,) = (k for k in analyse(time, x, excitation_hz=np.nan).lines if k.kind == "other")
    assert line.amplitude == pytest.approx(1e-3, rel=0.01)  # 26e-3 without the weight


@pytest.mark.parametrize("length", [1, 2, 3, 8])
@pytest.mark.parametrize("excitation_hz", [np.nan, 65.0, 9000.0])
@pytest.mark.parametrize("how", [{}, {"periods": 3}, {"last": 1.0, "window": "blackman"}])
def test_very_short_records_give_a_spectrum(length, excitation_hz, how):
    x = np.random.default_rng(length).normal(size=length)
    result = analyse(np.arange(length) / RATE, x, excitation_hz=excitation_hz, **how)
    assert np.all(np.isfinite(result.amplitude))
    assert result.frequency_hz.shape == result.amplitude.shape == result.amplitude_db.shape
    assert result.lines[0].kind == "mean"


def test_periods_longer_than_the_record_use_the_whole_periods_there_are():
    time = clock(0.05)  # 3.25 periods
    result = analyse(time, np.sin(2 * np.pi * 65 * time), periods=40)
    assert result.duration_s == pytest.approx(3 / 65, abs=0.5 / RATE)
    assert result.start_s == pytest.approx(0.05 - 3 / 65, abs=2 / RATE)


def test_empty_record_is_refused():
    with pytest.raises(ValueError, match="time history"):
        analyse(np.array([]), np.array([]))
    with pytest.raises(ValueError, match="shapes"):
        analyse(np.zeros(3), np.zeros(4))
