"""Random input with random amplitudes: scatter between seeds as in a Gaussian process, in the input and in studies."""

import numpy as np
import pytest

from beamsim.analyses.studies.plan import plan_designs
from beamsim.inputs.density import SpectralDensity
from beamsim.inputs.excitation import random_signals
from beamsim.scenario import load_scenario
from beamsim.scenario.excitation import RandomInput
from beamsim.trust.studies import design_study

TABLE = (np.array([5.0, 20.0, 80.0]), np.array([0.01, 0.04, 0.01]))
DURATION = 8.0


def scatter_in_theory(frequency, s, duration):
    """Relative standard deviation of the root mean square over the duration (S. O. Rice, 1944)."""
    step = frequency[1] - frequency[0]
    return 0.5 * np.sqrt(np.sum(s**2) / (duration * step)) / np.sum(s)


def noise(seed, amplitudes, duration=DURATION):
    psd = [{"frequency": f, "density": s} for f, s in zip(*map(np.ndarray.tolist, TABLE), strict=True)]
    given = {"applied_to": "base", "psd": psd, "sample_rate": 400.0, "seed": seed, "amplitudes": amplitudes}
    signal = random_signals(RandomInput.model_validate(given), duration)[0]
    return signal(np.arange(round(400 * duration)) / 400.0)


def rms_of_seeds(count, amplitudes, duration):
    x = (noise(seed, amplitudes, duration) for seed in range(count))
    return np.array([np.sqrt(np.mean(samples**2)) for samples in x])


def test_rms_scatters_between_seeds_as_theory_says():
    f, seeds, duration = np.linspace(0, 100, 100_001), 500, 2.0
    expected = scatter_in_theory(f, SpectralDensity(*TABLE)(f), duration)
    rms = rms_of_seeds(seeds, "random", duration)
    # the standard deviation of a sample of 500 is known to 3.2 %
    assert rms.std() / rms.mean() == pytest.approx(expected, rel=0.06)
    total = np.sum(SpectralDensity(*TABLE)(f)) * (f[1] - f[0])
    assert np.mean(rms**2) == pytest.approx(total, rel=4 * 2 * expected / np.sqrt(seeds))
    fixed = rms_of_seeds(20, "fixed", duration)
    assert fixed.std() / fixed.mean() < 1e-9 < expected


def test_the_density_is_kept_on_average_and_lines_are_exponentially_distributed():
    lines = []
    for seed in range(100):
        x = noise(seed, "random")
        lines.append(np.abs(np.fft.rfft(x)[1:]) ** 2 * 2 * DURATION / x.size**2)
    frequency = np.arange(1, len(lines[0]) + 1) / DURATION
    inside = (frequency > 6) & (frequency < 79)
    power = np.array(lines)[:, inside] / SpectralDensity(*TABLE)(frequency[inside])
    assert power.mean() == pytest.approx(1.0, abs=0.02)
    # mean and standard deviation of an exponential distribution agree
    assert power.std() == pytest.approx(1.0, abs=0.03)
    assert np.mean(power > 3.0) == pytest.approx(np.exp(-3.0), rel=0.05)


def study(seeds, **excitation):
    psd = [{"frequency": 5, "density": "0.02 g^2/Hz"}, {"frequency": 60, "density": "0.02 g^2/Hz"}]
    return load_scenario({
        "chain": {"masses": [1], "springs": [15_000], "damping": {"kind": "modal", "ratio": 0.2}},
        "probes": [{"name": "mass", "mass": 1}],
        "excitation": {"kind": "random", "applied_to": "base", "psd": psd, **excitation},
        "run": {"duration": DURATION, "sample_rate": 300, "start": "rest"},
        "vary": {"kind": "grid", "parameters": [{"path": "excitation.seed", "values": list(range(seeds))}]},
    })  # fmt: skip


@pytest.mark.parametrize("amplitudes", ["random", "fixed"])
def test_a_study_over_seeds_says_what_its_scatter_means(amplitudes):
    result = design_study(study(2, **({} if amplitudes == "random" else {"amplitudes": "fixed"})), workers=1)
    assert result.responses["probes/mass/rms_displacement"].values.shape == (2,)
    assert any(f"amplitudes{': ' if amplitudes == 'random' else ' = '}{amplitudes}" in w for w in result.warnings)


def test_other_studies_and_single_runs_keep_fixed_amplitudes():
    scenario = study(2)
    assert plan_designs(scenario).study.case.excitation.amplitudes == "random"
    assert scenario.excitation.amplitudes is None
    other = load_scenario(scenario.model_dump(mode="json", by_alias=True, exclude_none=True), [
        "vary={kind: grid, parameters: [{path: 'chain.masses[0]', values: [1, 2]}]}",
    ])  # fmt: skip
    assert getattr(plan_designs(other).study.case.excitation, "amplitudes", None) is None


def test_a_blend_is_the_sum_of_realisations_and_has_their_scatter():
    first, second = noise(4, "random"), noise(7, "random")
    blend = noise("0.8*4 + 0.6*7", "random")
    assert blend == pytest.approx(0.8 * first + 0.6 * second, abs=1e-12 * np.abs(blend).max())
    assert noise("8*4+6*7", "random") == pytest.approx(blend, abs=1e-12 * np.abs(blend).max())  # shares of a whole
    assert np.array_equal(noise("1*4", "random"), first)
    total = np.mean([np.mean(noise(f"0.8*{k} + 0.6*{k + 1000}", "random") ** 2) for k in range(60)])
    assert total == pytest.approx(np.mean([np.mean(noise(k, "random") ** 2) for k in range(2000, 2060)]), rel=0.1)
