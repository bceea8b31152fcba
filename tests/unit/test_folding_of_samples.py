"""What sampling folds into spectra of time-stepped and of random motions is stated."""

from __future__ import annotations

import numpy as np
import pytest

import beamsim
from beamsim.analyses.run.records import SampledRecord
from beamsim.analyses.run.windows import Window
from beamsim.flow import fourier
from beamsim.flow.fourier import MotionPart
from tests.unit.test_equal_pieces import DURATION, motion  # noqa: F401

SHORT = ["run.duration=0.05 s", "run.spectrum.last=0.03 s", "reduction.modes=3", "run.convergence=off"]
STEPPED = [*SHORT, "run.method=reference", "run.integrator=DOP853"]


def stepped(rate: float):
    return beamsim.run(beamsim.load_scenario("configs/one_sided_65hz.yaml", [*STEPPED, f"run.sample_rate={rate} Hz"]))


def test_a_sine_above_half_the_rate_is_seen_in_finer_samples():
    rate, count, times = 1000.0, 1000, 4
    finer = 0.3 * np.sin(2 * np.pi * 700.0 * np.arange(count * times) / (rate * times))
    x = finer[::times]
    record = SampledRecord(np.arange(count) / rate, x, rate, finer)
    assert record.folded(Window.named("hann")) == pytest.approx(0.3, rel=1e-6)
    slow = np.sin(2 * np.pi * 100.0 * np.arange(count * times) / (rate * times))
    assert SampledRecord(record.time, slow[::times], rate, slow).folded(Window.named("hann")) < 1e-12


@pytest.mark.slow
def test_a_time_stepped_run_states_what_it_folds_and_warns():
    coarse, fine = stepped(2000.0), stepped(40_000.0)
    for key, s in coarse.spectra.items():
        assert s.folded > 100 * fine.spectra[key].folded > 0.0
    said = [text for text in coarse.warnings if "run.sample_rate" in text]
    assert len(said) == 2  # the accelerations of two probes
    assert not [text for text in fine.warnings if "run.sample_rate" in text]
    # it is at least the difference from the spectrum at the higher rate
    key = ("tip", "absolute_acceleration")
    one, other = coarse.spectra[key], fine.spectra[key]
    shown = one.frequency_hz.size // 2
    difference = np.abs(
        one.amplitude[:shown] - np.interp(one.frequency_hz, other.frequency_hz, other.amplitude)[:shown]
    )
    assert difference.max() < 1.1 * one.folded


def test_the_spectra_of_one_part_share_one_bound(motion, monkeypatch):  # noqa: F811
    trajectory, groups = motion
    calls = []
    right = fourier.folded_by_products
    monkeypatch.setattr(fourier, "folded_by_products", lambda *of: (calls.append(1), right(*of))[1])
    part = MotionPart.of(trajectory, groups, 0.01, DURATION, np.pi * 60e3)
    bounds = [part.one(j).folded(1 / 60e3, 1e5, open_ends=False) for j in range(part.table.shape[2])]
    assert len(calls) == 1
    np.testing.assert_array_equal(np.concatenate(bounds), part.folded(1 / 60e3, 1e5, open_ends=False))
