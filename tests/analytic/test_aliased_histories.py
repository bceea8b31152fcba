"""What lies above half the rate of stored histories: closed forms of sinusoids, and where it is named."""

import numpy as np
import pytest
from matplotlib.figure import Figure

import beamsim
from beamsim.analyses.compare.analysis import compare
from beamsim.measurements.signal import MeasuredSignal
from beamsim.plots.sweep import plot_spectrogram
from beamsim.responses.histories import NOTABLE, between_samples, share_above_half_rate
from beamsim.scenario import load_scenario
from tests.helpers.spectra import lines_of

RATE = 1000.0


@pytest.mark.parametrize("hz", [560.0, 700.0, 955.0, 1045.0, 1300.0])
def test_a_sinusoid_above_half_the_rate(hz):
    time = between_samples(np.arange(4001) / RATE)
    x = np.sin(100 * np.pi * time) + 0.1 * np.sin(2 * np.pi * hz * time + 0.3)
    assert share_above_half_rate(x[:, None])[0] == pytest.approx(0.1 / np.sqrt(1.01), rel=5e-3)


@pytest.mark.parametrize("hz", [1600.0, 2000.0, 2600.0, 3100.0])
def test_no_sinusoid_far_above_the_rate_is_missed(hz):
    """Content of many times the rate counts with a known factor, none with zero."""
    time = between_samples(np.arange(4001) / RATE)
    x = np.sin(100 * np.pi * time) + 0.1 * np.sin(2 * np.pi * hz * time + 0.3)
    assert 0.03 < share_above_half_rate(x[:, None])[0] < 0.11


@pytest.mark.parametrize("hz", [50.0, 200.0, 400.0])
def test_nothing_lies_above_half_the_rate(hz):
    time = between_samples(np.arange(4001) / RATE)
    assert share_above_half_rate(3.0 + np.sin(2 * np.pi * hz * time)[:, None])[0] < 0.5 * NOTABLE


def test_few_samples_do_not_tell():
    assert np.isnan(share_above_half_rate(np.zeros((41, 2)))).all()


def two_tones(rate, **run):
    """Two equal masses that swing by 1 mm at 10 Hz and by 1 mm at 70 Hz."""
    outer = (20 * np.pi) ** 2
    springs = [outer, 0.5 * ((140 * np.pi) ** 2 - outer), outer]
    settings = {"duration": 5.0, "sample_rate": rate, "convergence": "off", "start": {"displacement": [2e-3, 0.0]}}
    return load_scenario({
        "chain": {"masses": [1.0, 1.0], "springs": springs}, "probes": [{"name": "m1", "mass": 1}],
        "run": {**settings, **run},
    })  # fmt: skip


def test_a_run_names_the_histories_that_are_sampled_too_slowly():
    """At 100 Hz the line at 70 Hz shows at 30 Hz in samples, never in the spectra of the run."""
    result = beamsim.run(two_tones(100.0))
    a = np.array([10.0, 70.0])
    shares = {
        "displacement": np.sqrt(0.5),
        "velocity": 70.0 / np.hypot(*a),
        "absolute_acceleration": 49.0 / np.hypot(1, 49),
    }
    expected = {f"m1 {quantity}": share for quantity, share in shares.items()}
    assert result.summary["aliased_in_histories"] == pytest.approx(expected, rel=5e-3)
    lines = [line.frequency_hz for line in lines_of(result, "displacement", "m1")[1:]]
    assert lines == pytest.approx(a, rel=1e-9)
    assert "aliased_in_histories" not in beamsim.run(two_tones(500.0)).summary


def test_a_time_stepped_motion_counts_from_a_quarter_of_its_rate():
    run = {"method": "reference", "integrator": "DOP853", "duration": 2.0}
    slow, fast = (beamsim.run(two_tones(rate, **run)).summary for rate in (200.0, 500.0))
    assert slow["aliased_in_histories"]["m1 displacement"] == pytest.approx(np.sqrt(0.5), rel=0.02)
    assert "aliased_in_histories" not in fast


@pytest.mark.parametrize(("rate", "aliased"), [(100.0, True), (500.0, False)])
def test_a_comparison_names_what_is_aliased(rate, aliased):
    result = beamsim.run(two_tones(rate))
    time = np.arange(0.0, 5.0, 1e-3)
    measured = MeasuredSignal("m1", time, 1e-3 * (np.cos(20 * np.pi * time) + np.cos(140 * np.pi * time)))
    found = compare(result, [("m1", "displacement", measured)])
    named = [text for text in found.warnings if "above half its output rate of 100 Hz" in text]
    assert len(named) == aliased
    assert found.summary["comparisons"][0]["aliased_share"] == (
        pytest.approx(np.sqrt(0.5), rel=5e-3) if aliased else None
    )


def test_a_spectrogram_names_what_is_aliased():
    """A mass that hits a stop in a swept sine: at 100 Hz its history has lost what the impacts excite."""
    case = {
        "chain": {"masses": [1.0], "springs": [4e3, 0.0], "damping": {"kind": "modal", "ratio": 0.02},
                  "snubbers": [{"name": "s", "mass": 1, "side": "below", "gap": 1e-3, "stiffness": 4e5}]},
        "probes": [{"name": "m", "mass": 1}],
        "excitation": {"kind": "harmonic", "applied_to": "base", "level": 5.0, "frequency": 8.0},
        "sweep": {"kind": "swept_sine", "from": 8.0, "to": 12.0, "rate": "4 oct/min", "convergence": "off"},
    }  # fmt: skip
    for rate, expected in ((100.0, True), (2e3, False)):
        result = beamsim.sweep(load_scenario(case, {"sweep.history_rate": rate}))
        share = result["levels"]["aliased_displacement"].sel(level_index=0, probe="m").item()
        ax = Figure().subplots()
        plot_spectrogram(result, ax, "m", 0)
        title = ax.get_title(loc="right")
        assert (share > 1e-3) == expected
        assert title == (f"{100 * share:.2g} % of the rms lies above 50 Hz and is aliased" if expected else "")
