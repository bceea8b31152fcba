"""Probabilities of exceeding limits of real histories, against quadrature and draws of a time stepping of its own."""

import math

import numpy as np
import pytest
from sampling import needs
from scipy.stats import binomtest, norm

from beamsim.scenario import load_scenario
from beamsim.trust.studies import design_study

pytestmark = needs("openturns")
LIMIT = 86.0
SHOCK = f"""\
title: Oscillator with a stop under a shock of its base
chain: {{masses: [1 kg], springs: [1 kN/m], damping: {{kind: modal, ratio: 2 %}}}}
snubbers: [{{name: stop, mass: 1, side: above, stiffness: 20 kN/m, gap: 10 mm}}]
probes: [{{name: mass, mass: 1}}]
excitation: {{kind: half_sine, applied_to: base, level: -4 g, duration: 20 ms}}
run: {{duration: 80 ms, sample_rate: 1 kHz, start: rest}}
limits: {{peak_force: {LIMIT} N}}
vary:
  kind: reliability
  samples: 100
  coefficient_of_variation: 0.2
  parameters:
    - {{path: snubbers.stop.gap, deviation: 0.5 mm}}
    - {{path: snubbers.stop.stiffness, deviation: 10 %, distribution: lognormal}}
    - {{path: excitation.level, deviation: 10 %}}
"""
NOISE = """\
title: Oscillator with a stop under noise
chain: {masses: [1 kg], springs: [10 kN/m], damping: {kind: modal, ratio: 5 %}}
snubbers: [{name: stop, mass: 1, side: above, stiffness: 50 kN/m, gap: 2 mm}]
probes: [{name: mass, mass: 1}]
excitation:
  kind: random
  applied_to: base
  psd: [{frequency: 5 Hz, density: 0.01 g^2/Hz}, {frequency: 40 Hz, density: 0.01 g^2/Hz}]
run: {duration: 0.25 s, sample_rate: 1 kHz, start: rest}
limits: {peak_force: 55 N}
vary:
  kind: reliability
  samples: 100
  parameters: [{path: snubbers.stop.gap, deviation: 0.2 mm}]
"""
G = 9.80665


def peak_forces(gap, stiffness, base, spring, damping, step, steps):
    """Largest forces of the stop of oscillators of 1 kg, (n,): the method of Runge and Kutta for all of them at once.

    ``base(k)`` is the acceleration of their bases, (n,), after k half steps; peaks are those of parabolas.
    """

    def rates(k, x, v):
        contact = stiffness * np.maximum(x - gap, 0.0)
        return v, -base(k) - spring * x - 2.0 * damping * math.sqrt(spring) * v - contact

    x, v = np.zeros((2, gap.size))
    before = older = highest = x
    for k in range(0, 2 * steps, 2):
        v1, a1 = rates(k, x, v)
        v2, a2 = rates(k + 1, x + step / 2 * v1, v + step / 2 * a1)
        v3, a3 = rates(k + 1, x + step / 2 * v2, v + step / 2 * a2)
        v4, a4 = rates(k + 2, x + step * v3, v + step * a3)
        older, before = before, x
        x, v = x + step / 6 * (v1 + 2 * v2 + 2 * v3 + v4), v + step / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
        bend = np.minimum(older - 2.0 * before + x, -1e-30)
        peak = np.where((before > older) & (before >= x), before - 0.125 * (x - older) ** 2 / bend, x)
        highest = np.maximum(highest, peak)
    return stiffness * np.maximum(highest - gap, 0.0)


def of_shocks(gap, stiffness, level):
    """Forces under half sines of 20 ms; half the step changes them by 4e-5 at most."""
    step = 2e-4
    return peak_forces(
        gap, stiffness, lambda k: level * (math.sin(math.pi * k * step / 0.04) if k * step <= 0.04 else 0.0),
        1e3, 0.02, step, 400,
    )  # fmt: skip


def of_noise(rng, gap):
    """Forces under noise: a cosine and a sine of normal amplitudes every 4 Hz from 8 to 40 Hz.

    Steps of 0.2 ms change them by 0.1 % at most.
    """
    step, frequency = 5e-4, np.arange(8.0, 41.0, 4.0)
    angle = 2.0 * math.pi * np.outer(np.arange(1001) * 0.5 * step, frequency)
    size = math.sqrt(0.01 * 4.0) * G
    waves = np.hstack([np.cos(angle), np.sin(angle)]) @ (size * rng.standard_normal((2 * frequency.size, gap.size)))
    return peak_forces(gap, np.full(gap.size, 50e3), lambda k: waves[k], 1e4, 0.05, step, 500)


def exact_of_shocks(limit):
    """Probability that the force under a shock exceeds a limit: by quadrature over gap and stiffness, of the levels
    that lead to the limit with each; more nodes change it by 1e-3 at most."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(10)
    width = math.sqrt(math.log1p(0.1**2))
    z, y = (each.ravel() for each in np.meshgrid(nodes, nodes))
    gap, stiffness = 0.01 + 5e-4 * z, 20e3 * np.exp(width * y - 0.5 * width**2)
    before, share = np.full(z.size, 1.2), np.full(z.size, 1.4)  # of the level
    over = of_shocks(gap, stiffness, -4.0 * G * before) - limit
    for _ in range(6):  # secants
        after = of_shocks(gap, stiffness, -4.0 * G * share) - limit
        slope = np.where(after == over, 1.0, (after - over) / np.where(after == over, 1.0, share - before))
        before, share, over = share, share - after / slope, after
    np.testing.assert_allclose(of_shocks(gap, stiffness, -4.0 * G * share), limit, rtol=1e-9)
    return float(np.outer(weights, weights).ravel() @ norm.sf((share - 1.0) / 0.1)) / (2.0 * math.pi)


def test_shocks_of_an_oscillator_with_a_stop():
    """About one in a million exceeds the limit."""
    exact = exact_of_shocks(LIMIT)
    assert 5e-7 < exact < 2e-6
    result = design_study(load_scenario(SHOCK))
    of = result.summary["reliability"]
    assert result.complete
    assert of["coefficient_of_variation"] <= 0.2
    assert of["histories"] < 3_000
    assert of["low"] < exact < of["high"]
    assert of["high"] < 2.0 * of["probability"] < 4.0 * of["low"]  # it would tell a factor of two
    at = np.array([[value] for value in of["design_point"].values()])
    assert of_shocks(*at)[0] == pytest.approx(LIMIT, rel=1e-3)


def test_noise_by_subset_simulation():
    """About one in twenty, of 18 normal amplitudes and a gap; smaller ones: tests/analytic/test_reliability.py."""
    rng = np.random.default_rng(3)
    beyond = sum(int(np.sum(of_noise(rng, rng.normal(2e-3, 2e-4, 2000)) > 55.0)) for _ in range(10))
    assert 500 < beyond < 1500
    result = design_study(load_scenario(NOISE))
    of = result.summary["reliability"]
    brute = binomtest(beyond, 20_000).proportion_ci(0.95)
    assert result.complete
    assert (of["method"], of["coefficient_of_variation"] <= 0.3, of["histories"] <= 20_000) == ("subset", True, True)
    assert of["low"] < brute.high
    assert brute.low < of["high"]
