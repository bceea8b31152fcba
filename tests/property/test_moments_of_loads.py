"""Bending moments do not depend on how often a load is listed, nor on what of it is level and what is shape."""

import numpy as np
import pytest
from random_systems import random_case

import beamsim
from beamsim.system.build import build_system

ELEMENTS = 3  # with all modes three are not resolved, fewer than there are loads
PLACES = (0.12, 0.2, 0.29, 0.41)


def stress_rows(places, line=None, modes="all", elements=ELEMENTS):
    """(nx, n) stresses of a beam with stops at places, and a constant force along a line."""
    case = {
        "beam": {"length": 0.5, "width": 0.03, "thickness": 0.003, "youngs_modulus": 7e10, "density": 2700.0,
                 "elements": elements},
        "snubbers": [{"name": f"stop {k}", "position": x, "side": "below", "stiffness": 1e4, "gap": 1e-3}
                     for k, x in enumerate(places)],
        "constant_forces": [] if line is None else [{"line": [0.1, 0.35]} | line],
        "gravity": 9.81,
        "reduction": {"modes": modes},
    }  # fmt: skip
    system = build_system(beamsim.load_scenario(case))
    return system.stress.stations.position, system.stress.row


def apart(one, other):
    """Largest difference of the rows at the stations that both have."""
    (x, row), (y, again) = one, other
    nearest = np.abs(y - x[:, None]).argmin(axis=1)
    assert np.abs(y[nearest] - x).max() < 1e-12
    return np.abs(again[nearest] - row).max() / np.abs(row).max()


@pytest.mark.parametrize("elements", [3, 5])
@pytest.mark.parametrize("again", PLACES)
def test_a_place_counts_once_however_often_it_is_listed(elements, again):
    """At the same number, or at one that differs by round-off."""
    first = stress_rows(PLACES, elements=elements)
    for listed in (again, again * (1 + 2e-16), again * (1 - 3e-16)):
        assert apart(first, stress_rows((*PLACES, listed), elements=elements)) < 1e-9
    assert apart(first, stress_rows(PLACES[::-1], elements=elements)) < 1e-9


def test_a_load_weighs_the_same_whatever_its_level():
    """A shape of 1 and one of 20, of which the level is a twentieth."""
    one = stress_rows(PLACES, {"force_per_length": 1.0, "shape": {"kind": "polynomial", "coefficients": [1.0, 2.0]}})
    other = stress_rows(
        PLACES, {"force_per_length": 0.05, "shape": {"kind": "polynomial", "coefficients": [20.0, 40.0]}}
    )
    assert apart(one, other) < 1e-9


def test_another_place_is_another_load():
    """Twin: a stop a tenth of a millimetre away is another one where the fit is not exact."""
    assert apart(stress_rows(PLACES), stress_rows((*PLACES, PLACES[1] + 1e-4))) > 1e-4


JOINED = """
bodies:
  panel: {kind: beam, length: 0.23, width: 0.03, thickness: 2.5 mm, youngs_modulus: 70 GPa, density: 2700, elements: 6,
          supports: {left: pinned, right: clamped}}
  boom: {kind: beam, length: 1.7, bending_stiffness: 8.0, mass_per_length: 0.3, elements: 2,
         supports: {left: guided, right: pinned}}
  arm: {kind: beam, length: 0.8, bending_stiffness: 2.0, mass_per_length: 0.8, elements: 1,
        supports: {left: free, right: free}}
joints:
  - {kind: hinge, between: [{body: panel, position: 0.15}, {body: boom, position: 0.85}]}
  - {kind: spring, between: [{body: boom, position: 0.85}, {body: arm, position: 0.0}], stiffness: 30.0,
     rotational_stiffness: 10.0}
excitation: {kind: half_sine, applied_to: {body: panel, position: 0.1}, level: 1 N, duration: 0.2 ms}
reduction: {modes: all}
probes: [{name: tip, at: {body: arm, position: 100 %}}]
outputs: [{name: moment, kind: bending_moment, at: {body: arm, position: 0.6}}]
run: {duration: 0.5, sample_rate: 2000, convergence: off,
      start: {released_force: {at: {body: arm, position: 100 %}, force: 1.0}}}
"""


def test_modes_of_a_stiff_beam_bend_no_other():
    """The moment of a soft arm while a pulse shakes the modes of a stiff panel, which its coarse mesh has none of.

    A force of 1 N at 0.2 m bends it at the start; meshes of 12, 8 and 6 elements say 0.211 N m for the peak.
    """
    moment = {}
    for elements in ((6, 2, 1), (6, 2, 2), (12, 8, 6)):
        overrides = {f"bodies.{name}.elements": n for name, n in zip(("panel", "boom", "arm"), elements, strict=True)}
        moment[elements] = (
            beamsim.run(beamsim.load_scenario(JOINED, overrides=overrides))["histories"]["output_value"]
            .sel(output="moment")
            .values
        )
        assert moment[elements][0] == pytest.approx(0.2, rel=1e-9)
    peaks = [np.abs(each).max() for each in moment.values()]
    np.testing.assert_allclose(peaks[:2], peaks[2], rtol=0.1)


def test_round_off_of_loads_on_other_beams_corrects_nothing(tmp_path):
    """A beam behind a soft spring, on which no load acts: its moments in another order of the bodies."""
    case = random_case(37_000_153, tmp_path)[0] | {"reduction": {"modes": "all"}}
    case["run"] = {"duration": 0.1, "sample_rate": 1000.0}
    rows = []
    for names in (list(case["bodies"]), list(case["bodies"])[::-1]):
        system = build_system(beamsim.load_scenario(case | {"bodies": {name: case["bodies"][name] for name in names}}))
        rows.append(np.abs(system.bodies[names.index("body_3")].bending_moment))
    np.testing.assert_allclose(rows[1], rows[0], rtol=0, atol=1e-5 * rows[0].max())


DAMPED_JOINT = {"kind": "spring", "stiffness": 5e4, "dashpot": 2e3, "rotational_stiffness": 60.0,
                "rotational_dashpot": 5.0}  # fmt: skip


def sprung(joined, elements, modes):
    """A beam of 150 mm that begins at a damped spring: the system, and the rotations that the spring resists, (n,)."""
    beam = {"length": 0.15, "width": 0.05, "thickness": 0.005, "youngs_modulus": 6.9e10, "density": 2700.0,
            "elements": elements, "damping": {"kind": "modal", "ratio": 0.08}}  # fmt: skip
    others = {"reduction": {"modes": modes}, "gravity": 0.0}
    if joined:
        case = {
            "bodies": {"arm": {"kind": "beam", **beam}, "flap": {"kind": "beam", **beam, "supports": {"left": "free"}}},
            "joints": [{"name": "root", **DAMPED_JOINT,
                        "between": [{"body": "arm", "position": 0.15}, {"body": "flap", "position": 0.0}]}],
            "snubbers": [{"name": "tip", "at": {"body": "flap", "position": 0.14}, "side": "below", "stiffness": 4e4}],
            **others,
        }  # fmt: skip
    else:
        left = {name: DAMPED_JOINT[name] for name in ("rotational_stiffness", "rotational_dashpot")}
        case = {"beam": {**beam, "supports": {"left": {"kind": "pinned", **left}}},
                "snubbers": [{"name": "tip", "position": 0.14, "side": "below", "stiffness": 4e4}],
                **others}  # fmt: skip
    return build_system(beamsim.load_scenario(case))


@pytest.mark.parametrize("joined", [True, False])
def test_moments_beside_a_dashpot_are_those_of_equilibrium(joined):
    """Under a sine at the stop a massless beam has the force times the lever; here the inertia adds half a percent.

    The models have four and sixteen elements, a few modes or all.
    """
    omega = 2 * np.pi * 2.0
    for elements, modes in ((4, "all"), (4, 4), (16, "all"), (16, 6)):
        system = sprung(joined, elements, modes)
        flap = system.bodies[-1]
        dynamics = system.dynamics
        matrix = np.diag(dynamics.stiffness - omega**2) + 1j * omega * dynamics.damping
        q = np.linalg.solve(matrix, dynamics.contacts.shape[0].astype(complex))
        moment = flap.bending_moment @ q
        lever = np.clip(0.14 - flap.position, 0.0, None)
        np.testing.assert_allclose(np.abs(moment), lever, rtol=0, atol=0.01 * 0.14)
