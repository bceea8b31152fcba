"""Snubbers: preloads, dashpots from ratios, and limits of very stiff ones."""

import numpy as np
import pytest

from beamsim.contacts.snubbers import dashpot_from_ratio
from beamsim.errors import ScenarioError
from beamsim.scenario import Scenario
from beamsim.system.build import build_system

pytestmark = pytest.mark.quick

BEAM = {"length": 1.0, "width": 0.05, "thickness": 0.01, "youngs_modulus": 70e9, "density": 2700.0}
EI = 70e9 * 0.05 * 0.01**3 / 12
RUN = {"duration": 1.0, "sample_rate": 2000.0}


def system(*snubbers, start="static_equilibrium", supports=None, **more):
    beam = {**BEAM, **({"supports": supports} if supports else {})}
    return build_system(
        Scenario.model_validate({"beam": beam, "snubbers": list(snubbers), "run": {**RUN, "start": start}, **more})
    )


def stop(position=1.0, side="below", stiffness=2e4, **more):
    return {"position": position, "side": side, "stiffness": stiffness, **more}


def contact_forces(s, q):
    c = s.dynamics.contacts
    return c.stiffness * np.maximum(-c.gap - c.sign * (c.shape @ q), 0)


def test_gap_of_a_preload_in_closed_form():
    s = system(stop(preload=3.0))
    assert s.snubbers[0].gap == pytest.approx(-3.0 / 2e4 - 3.0 / (3 * EI), rel=1e-10)
    assert s.snubbers[0].blocked_force == pytest.approx(2e4 * (3.0 / 2e4 + 3.0 / (3 * EI)), rel=1e-10)


def test_several_preloads_mixed_with_gaps():
    s = system(
        stop(0.5, preload=4.0),
        stop(1.0, "above", preload=2.0),
        stop(0.7, "above", gap=-2e-4),
        stop(0.8, "below", gap=0.02),
        gravity=9.81,
    )
    force = contact_forces(s, s.static_equilibrium)
    np.testing.assert_allclose(force[:2], [4.0, 2.0], rtol=1e-9)
    assert force[3] == 0.0
    np.testing.assert_allclose([i.preload for i in s.snubbers], force, rtol=1e-9, atol=1e-12)


def test_a_preload_that_no_gap_can_give_is_refused():
    with pytest.raises(ScenarioError, match=r"snubbers\[0\]\.preload") as caught:
        system(stop(preload=3.0), supports={"left": "pinned", "right": "free"}, gravity=9.81, start="rest")
    assert "gap" in str(caught.value)


def test_a_preload_on_a_hinged_panel_between_two_stops():
    s = system(
        stop(1.0, "below", preload=5.0), stop(1.0, "above", gap=0.0), supports={"left": "pinned", "right": "free"}
    )
    np.testing.assert_allclose(contact_forces(s, s.static_equilibrium), [5.0, 5.0], rtol=1e-9)


def test_no_equilibrium_when_gravity_pulls_a_hinged_panel_off():
    hinged = {"supports": {"left": "pinned", "right": "free"}}
    s = system(stop(side="above", gap=1e-3), gravity=9.81, start="rest", **hinged)
    assert s.static_equilibrium is None
    assert "not in balance" in s.static_reason
    assert np.isnan(s.snubbers[0].preload)
    with pytest.raises(ScenarioError, match=r"run\.start .*not in balance.*start from rest"):
        system(stop(side="above", gap=1e-3), gravity=9.81, **hinged)


def test_a_floating_panel_has_no_single_equilibrium():
    hinged = {"supports": {"left": "pinned", "right": "free"}}
    with pytest.raises(ScenarioError, match=r"run\.start .*floats"):
        system(stop(gap=1e-3), **hinged)
    assert system(stop(gap=1e-3), start="rest", **hinged).static_equilibrium is None


def test_a_hinged_panel_rests_on_its_stop():
    s = system(stop(gap=1e-3), gravity=9.81, supports={"left": "pinned", "right": "free"})
    weight = 2700 * 0.05 * 0.01 * 9.81
    assert s.snubbers[0].preload == pytest.approx(weight / 2, rel=1e-9)
    tip = s.snubbers[0].shape @ s.static_equilibrium
    assert tip == pytest.approx(-1e-3 - weight / 2 / 2e4, rel=1e-9)


def test_a_very_stiff_snubber_pins_the_point():
    """Clamped-free closed by k to infinity is clamped-pinned: first root 3.9266."""
    s = system(stop(stiffness=1e11, gap=0.0), reduction={"modes": 12})
    unit = np.sqrt(EI / (2700 * 0.05 * 0.01)) / (2 * np.pi)
    expected = np.array([3.9266023120479, 7.0685827456287, 10.2101761228130]) ** 2 * unit
    np.testing.assert_allclose(s.modes["closed_frequencies_hz"].values[:3], expected, rtol=5e-5)
    assert np.all(np.diff(s.modes["open_frequencies_hz"].values) > 0)


def test_dashpot_from_ratio_of_one_mass():
    # One mass on nothing: closed frequency sqrt(k/m), so c = 2 xi sqrt(k m).
    c = dashpot_from_ratio(0.05, 400.0, np.zeros(1), np.array([1 / np.sqrt(4.0)]), 1)
    assert c == pytest.approx(2 * 0.05 * np.sqrt(400.0 * 4.0), rel=1e-14)
    assert np.isnan(dashpot_from_ratio(0.05, 400.0, np.zeros(1), np.zeros(1), 1))


def test_dashpot_uses_only_its_own_snubber():
    alone = system(stop(gap=0.0, damping={"kind": "ratio", "ratio": 0.02}))
    pair = system(stop(gap=0.0, damping={"kind": "ratio", "ratio": 0.02}), stop(0.6, stiffness=5e6, gap=0.0))
    omega = 2 * np.pi * alone.modes["closed_frequencies_hz"].values[0]
    assert alone.snubbers[0].dashpot == pytest.approx(2 * 0.02 * 2e4 / omega, rel=1e-12)
    assert pair.snubbers[0].dashpot == pytest.approx(alone.snubbers[0].dashpot, rel=1e-6)
    assert pair.snubbers[1].dashpot == 0.0


def test_dashpot_skips_a_rigid_body_mode_that_the_snubber_leaves():
    # Free-free beam: one stop leaves one rigid-body mode at exactly zero; the next frequency counts.
    s = system(
        stop(gap=1e-3, damping={"kind": "ratio", "ratio": 0.02}),
        supports={"left": "free", "right": "free"},
        start="rest",
    )
    closed = s.modes["closed_frequencies_hz"].values
    assert closed[0] == 0.0
    assert closed[1] > 1.0
    assert s.snubbers[0].dashpot == pytest.approx(2 * 0.02 * 2e4 / (2 * np.pi * closed[1]), rel=1e-12)
