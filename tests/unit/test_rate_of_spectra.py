"""Spectra say where they do not cover the modes kept."""

from __future__ import annotations

import beamsim

SHORT = ["run.duration=0.05 s", "run.spectrum.last=0.03 s", "reduction.modes=3", "run.convergence=off"]
STEPPED = [*SHORT, "run.method=reference", "run.integrator=DOP853"]


def run(*changes: str) -> beamsim.RunResult:
    return beamsim.run(beamsim.load_scenario("configs/one_sided_65hz.yaml", list(changes)))


def notes(result: beamsim.RunResult) -> list[str]:
    return [text for text in result.warnings if text.startswith("spectra ")]


def test_a_time_stepped_run_says_that_its_rate_is_too_low():
    shorter = [*STEPPED, "run.duration=0.02 s", "run.spectrum.last=0.01 s"]
    coarse, fine = (run(*shorter, f"run.sample_rate={rate} Hz") for rate in (1500.0, 40_000.0))
    (note,) = notes(coarse)
    assert "samples at 1500 Hz" in note
    assert "raise run.sample_rate" in note
    assert not notes(fine)


def test_spectra_of_a_motion_in_closed_form_cover_the_modes_whatever_the_output_rate():
    result = run(*SHORT, "run.sample_rate=500 Hz")
    highest = result["modes"]["closed_frequencies_hz"].values[: result["modes"]["kept_modes"].item()].max()
    assert result["spectra"]["frequency_hz"].values[-1] > highest
    assert "rate_hz" not in result["spectra"]
    assert not notes(result)


def test_a_curve_that_ends_below_the_modes_is_noted():
    """A mass swings at 100 Hz for 1000 s: 50,000 frequencies end at 50 Hz."""
    chain = {"masses": [1.0], "springs": [(200 * 3.14159) ** 2]}
    case = {"chain": chain, "run": {"duration": 1000.0, "sample_rate": 10.0, "start": {"displacement": [1e-3]}}}
    (note,) = notes(beamsim.run(beamsim.load_scenario(case, {})))
    assert "end at 50 Hz" in note
    assert "run.spectrum.last" in note
