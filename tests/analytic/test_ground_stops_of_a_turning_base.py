"""Stops and springs on the ground while the base turns: each feels the motion of the base at its own place."""

import numpy as np
import pytest

import beamsim
from beamsim.scenario import load_scenario
from beamsim.system.build import build_system
from tests.helpers.branches import peaks_of

L, ABOUT = 0.9, 0.3
BEAM = {
    "length": L, "width": 0.03, "thickness": 0.004, "youngs_modulus": 70e9, "density": 2700.0, "elements": 6,
    "supports": {"left": "pinned", "right": "pinned"}, "nodes": [0.25, 0.6],
    "damping": {"kind": "rayleigh", "stiffness": 2e-5},
}  # fmt: skip
STOPS = [
    {
        "name": "near",
        "position": 0.25,
        "side": "below",
        "stiffness": 2e4,
        "damping": {"kind": "viscous", "coefficient": 3.0},
        "gap": 3e-4,
    },
    {"name": "far", "position": 0.6, "side": "above", "stiffness": 1e4, "gap": 2e-4},
]
GROUNDED = [{**stop, "mounted_on": "ground"} for stop in STOPS]
TURN = {
    "kind": "harmonic",
    "applied_to": "base",
    "direction": "ry",
    "about": ABOUT,
    "level": "0.1 deg",
    "frequency": 17,
}
COMMON = {"beam": BEAM, "probes": [{"name": "p", "position": 0.6}], "reduction": {"modes": "all"}}
RUN = {"duration": 0.3, "convergence": "off"}


def turning(**more):
    return load_scenario({**COMMON, "snubbers": GROUNDED, "excitation": TURN, "run": RUN, **more})


def test_against_ends_that_move_one_by_one():
    """A base at rest, whose ends move as the turning base moves them: stops on it are on the ground."""
    angle = np.deg2rad(0.1)
    ends = [
        {"kind": "harmonic", "applied_to": {"support": end}, "level": f"{abs(lever) * angle} m", "frequency": 17,
         "phase": 0.0 if lever > 0 else np.pi}
        for end, lever in (("left", ABOUT), ("right", ABOUT - L))
    ]  # fmt: skip
    moved = beamsim.run(load_scenario(
        {**COMMON, "snubbers": STOPS, "excitation": {"kind": "forces", "forces": ends}, "run": RUN}
    ))  # fmt: skip
    turned = beamsim.run(turning())
    assert turned.summary["contacts"] == moved.summary["contacts"]
    assert min(turned.summary["contacts"].values()) >= 2
    for name in ("near", "far"):
        one, other = (
            np.asarray(result["histories"]["snubber_force"].sel(snubber=name).values) for result in (turned, moved)
        )
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-7 * other.max())
    one, other = (
        np.asarray(turned["histories"]["absolute_displacement"].sel(probe="p").values),
        np.asarray(moved["histories"]["displacement"].sel(probe="p").values),
    )
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-8 * np.abs(other).max())
    assert turned.summary["energy_error"] < 1e-10


@pytest.mark.parametrize("method", ["shooting", "harmonic_balance"])
def test_periodic_motions_are_those_of_a_run(method):
    """The continuation's peaks at the frequency of a long run, whose start has died out, by both methods."""
    beam = {**BEAM, "damping": {"kind": "modal", "ratio": 0.1}}
    more = {"beam": beam, "reduction": {"modes": 3}}
    settled = beamsim.run(turning(**more, run={"duration": 3.0, "convergence": "off"}))
    time, values = (
        settled["histories"]["time"].values,
        np.asarray(settled["histories"]["displacement"].sel(probe="p").values),
    )
    last = np.abs(values[time > 2.9]).max()
    solver = {"kind": method} | ({"harmonics": 40} if method == "harmonic_balance" else {})
    sweep = {"kind": "continuation", "from": 16.9, "to": 17.0, "seek_at": 0, "method": solver}
    followed = beamsim.continuation(turning(**more, sweep=sweep))
    branch = followed.branches[0]
    at = int(np.argmax(branch["frequency_hz"].values))
    assert branch["frequency_hz"].values[at] == pytest.approx(17.0, rel=1e-9)
    assert peaks_of(branch, "p")[at] == pytest.approx(last, rel=3e-3)


def test_a_cubic_spring_feels_the_base_at_its_place():
    """The load of the base's motion is that of levers, so that a spring on the axis does not feel it."""
    spring = {"kind": "cubic", "stiffness": 1e9}
    at = [{**spring, "name": name, "at": {"position": x}} for name, x in (("axis", ABOUT), ("right", 0.6))]
    system = build_system(turning(snubbers=[], springs_to_ground=at, reduction={"modes": 3}))
    assert system.cubic.base_influence[:, 0] == pytest.approx([0.0, ABOUT - 0.6], abs=1e-12)
    contacts = build_system(turning()).dynamics.contacts
    assert contacts.base_influence[:, 0] == pytest.approx([ABOUT - 0.25, ABOUT - 0.6], abs=1e-12)
    on_base = build_system(turning(snubbers=STOPS)).dynamics.contacts
    assert not on_base.base_influence.any()
