"""Supports and joints that move by signals of their own."""

import numpy as np
import pytest

import beamsim
from beamsim.scenario import load_scenario
from beamsim.structures.assembly import assemble
from beamsim.structures.support_forces import supports_of
from beamsim.system.build import build_system

L, W, H, E, RHO = 0.9, 0.03, 0.004, 70e9, 2700.0
EI = E * W * H**3 / 12
BETA = 2e-5
BEAM = {
    "length": L, "width": W, "thickness": H, "youngs_modulus": E, "density": RHO, "elements": 9,
    "supports": {"left": "pinned", "right": "pinned"}, "damping": {"kind": "rayleigh", "stiffness": BETA},
}  # fmt: skip
LEFT = {"kind": "harmonic", "applied_to": {"support": "left"}, "level": "1 mm", "frequency": 23.0}
RIGHT = {"kind": "harmonic", "applied_to": {"support": "right"}, "level": "0.5 mm", "frequency": 31.0, "phase": 1.0}
CLAMPED = {"left": "clamped", "right": "clamped"}


def together(*items):
    return {"kind": "forces", "forces": list(items)}


def case(excitation, *, beam=None, **more):
    return load_scenario(
        {
            "beam": {**BEAM, **(beam or {})}, "excitation": excitation, "run": {"duration": 0.2},
            "probes": [{"name": "p", "position": 0.7 * L}], **more,
        }
    )  # fmt: skip


def held(system, motion):
    """Coordinates while support number ``motion`` stays displaced by one unit."""
    return system.forcing.load[3 * motion + 2] / system.dynamics.stiffness


@pytest.mark.parametrize("modes", [2, 4, "all"])
def test_a_moved_end_of_a_clamped_beam_bends_it_as_a_cubic(modes):
    """By a displacement and by a rotation of the end; deflections and moments in closed form."""
    turn = {**RIGHT, "applied_to": {"support": "right", "direction": "slope"}, "level": "1 deg"}
    system = build_system(case(together(RIGHT, turn), beam={"supports": CLAMPED}, reduction={"modes": modes}))
    body, s = system.bodies[0], system.bodies[0].position / L
    inner = np.isin(np.round(s * 18), np.arange(2, 17, 2))
    for motion, w, bent in (
        (0, 3 * s**2 - 2 * s**3, EI / L**2 * (6 - 12 * s)),
        (1, L * (s**3 - s**2), EI / L * (6 * s - 2)),
    ):
        q = held(system, motion)
        np.testing.assert_allclose((body.deflection @ q)[inner], w[inner], rtol=0, atol=1e-9)
        np.testing.assert_allclose(body.bending_moment @ q, bent, rtol=0, atol=1e-6 * np.abs(bent).max())


def test_energies_balance_with_a_snubber_between_supports_that_move():
    stop = {"name": "s", "position": 0.5, "side": "below", "stiffness": 2e4, "gap": 2e-4}
    result = beamsim.run(case(together(LEFT, RIGHT), snubbers=[stop]))
    assert result.summary["contacts"]["s"] >= 2
    assert result.summary["energy_error"] < 1e-10


@pytest.mark.parametrize("length", [0.5, 1.0, 2.0])
def test_a_rotation_on_a_spring_meets_spring_and_beam_in_series(length):
    """The moment per rotation of what a rotational spring stands on: 1 / (1 / k + L / (3 E I)) of a beam on pins."""
    flexural, spring = 70e9 * 0.04 * 0.005**3 / 12, 30.0
    beam = {
        "length": length, "width": 0.04, "thickness": 0.005, "youngs_modulus": 70e9, "density": 2700.0, "elements": 10,
        "supports": {"left": {"kind": "pinned", "rotational_stiffness": spring}, "right": "pinned"},
    }  # fmt: skip
    supports = supports_of(assemble(load_scenario({"beam": beam})))
    (turned,) = [each for each in supports if each.name == "left" and each.direction == "slope"]
    expected = 1 / (1 / spring + length / (3 * flexural))
    assert turned.force_per_motion(turned)[0] == pytest.approx(expected, rel=1e-9)
