"""Several bodies joined by nothing but snubbers, against assemblies made by hand and against single bodies."""

from pathlib import Path

import numpy as np
import pytest
from independent import Beam, Stop, Structure, integrate
from scipy.linalg import block_diag, eigh

import beamsim
from beamsim.scenario import load_scenario
from beamsim.system.build import build_system

EXAMPLE = Path(__file__).parents[1] / "data/examples/two_panels.yaml"
FEW = ["bodies.inner.elements=3", "bodies.outer.elements=3", "reduction.modes=all"]


def panel(stiffness, mass):
    """A clamped-free beam of the second opinion; its matrices are those of E I and the mass per length."""
    return Beam(0.77, 12 * stiffness, 1.0, 1.0, mass / (12 * stiffness), 3, "clamped")


def panels():
    """The two panels of the example, body after body, and the row of the gap: the second above the first."""
    both = panel(70e9 * 0.44 * 0.005**3 / 12, 2700 * 0.44 * 0.005), panel(210.0, 3.1)
    damping = []
    for one in both:
        squared, shapes = eigh(one.K, one.M)
        damping.append(one.M @ shapes @ np.diag(2 * 0.01 * np.sqrt(squared)) @ shapes.T @ one.M)
    matrices = (block_diag(*parts) for parts in ([one.M for one in both], damping, [one.K for one in both]))
    inertia = np.concatenate([one.inertia for one in both])
    return Structure(*matrices, inertia), *(one.row(0.77) for one in both)


def test_two_panels_against_integration_with_restarts_at_contacts():
    duration, stiffness, gap = 0.15, 150e3, 0.1e-3
    changes = [*FEW, "run.start=rest", f"run.duration={duration}", "run.sample_rate=2 kHz", "excitation.level=4 g"]
    case = load_scenario(EXAMPLE, [*changes, "snubbers[0].preload=null", f"snubbers[0].gap={gap}"])
    result = beamsim.run(case)
    structure, inner, outer = panels()
    stop = Stop(np.concatenate([-inner, outer]), stiffness, gap=gap)
    omega, level, n = 2 * np.pi * 40, 4 * 9.80665, structure.inertia.size
    motion = integrate(
        structure, [stop], lambda t: -structure.inertia * level * np.sin(omega * t), np.zeros(2 * n),
        np.asarray(result["histories"]["time"].values), most_step=1e-3, rtol=1e-11,
    )  # fmt: skip
    expected = motion.state[:, : n // 2] @ inner, motion.state[:, n // 2 : n] @ outer
    assert motion.event_closing.sum() == result.summary["contacts"]["tip"] >= 2
    scale = np.abs(expected).max()
    for name, own in zip(("inner_tip", "outer_tip"), expected, strict=True):
        np.testing.assert_allclose(
            result["histories"]["displacement"].sel(probe=name).values, own, rtol=0, atol=1e-7 * scale
        )


def test_preload_is_the_force_at_equilibrium_and_the_reduced_model_is_close_to_the_full_one():
    system = build_system(load_scenario(EXAMPLE))
    (tip,) = system.snubbers
    assert tip.preload == pytest.approx(5.0)
    assert system.modes["static_vectors"].item() == 2
    assert system.modes["reduction_bound"].item() < 1e-5
    full = build_system(load_scenario(EXAMPLE, "reduction.modes=all"))
    assert tip.gap == pytest.approx(full.snubbers[0].gap, rel=1e-8)


CHAINS = """
bodies:
  left: {kind: chain, masses: [1, 1], springs: [100, 100], dashpots: [0.2, 0.1]}
  right: {kind: chain, masses: [2], springs: [150], dashpots: [0.1]}
snubbers:
  - {name: bump, between: [{body: left, mass: 2}, {body: right, mass: 1}], stiffness: 1000, gap: 1 mm, law: no_tension,
     damping: {kind: viscous, coefficient: 3}}
  - {name: stop, at: {body: right, mass: 1}, side: above, stiffness: 500, gap: 1 mm}
excitation: {kind: harmonic, applied_to: {body: left, mass: 1}, level: 1 N, frequency: 1 Hz}
probes: [{name: a, at: {body: left, mass: 2}}, {name: b, at: {body: right, mass: 1}}]
run: {duration: 8 s, sample_rate: 100 Hz}
"""
CHAIN = """
chain:
  masses: [1, 1, 2]
  springs: [100, 100, 0, 150]
  dashpots: [0.2, 0.1, 0, 0.1]
  snubbers:
    - {name: bump, between: [2, 3], stiffness: 1000, gap: 1 mm, law: no_tension,
       damping: {kind: viscous, coefficient: 3}}
    - {name: stop, mass: 3, side: above, stiffness: 500, gap: 1 mm}
excitation: {kind: harmonic, applied_to: {mass: 1}, level: 1 N, frequency: 1 Hz}
probes: [{name: a, mass: 2}, {name: b, mass: 3}]
run: {duration: 8 s, sample_rate: 100 Hz}
"""


def test_two_chains_are_one_chain_with_a_spring_of_nothing():
    two, one = (beamsim.run(load_scenario(text)) for text in (CHAINS, CHAIN))
    assert two.summary["contacts"] == one.summary["contacts"]
    assert min(two.summary["contacts"].values()) > 2
    for name in ("a", "b"):
        of_two, of_one = (each["histories"]["displacement"].sel(probe=name).values for each in (two, one))
        np.testing.assert_allclose(of_two, of_one, rtol=0, atol=1e-9)
