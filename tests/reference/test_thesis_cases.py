"""Every case of chapters 1 and 2 that ships as a config, and what the thesis says of it."""

from functools import cache

import numpy as np
import pytest
from independent import Beam, Stop, integrate
from sampling import first_apart
from shipped import config_path

import beamsim
from tests.helpers.spectra import lines_of

ONE_SIDED = ["one_sided_45hz", "one_sided_65hz", "one_sided_78hz", "one_sided_160hz"]
PRESTRESSED_LINEAR = ["prestressed_90hz_0_5g", "prestressed_465hz_1g"]
PRESTRESSED = [
    "prestressed_45hz_3g", "prestressed_90hz_3g", "prestressed_160hz_5g", "prestressed_220hz_8g",
    "prestressed_465hz_15g",
]  # fmt: skip
BACKLASH = ["backlash_45hz_2g", "backlash_65hz_3g", "backlash_110hz_13g"]
POINT_FORCE = ["point_force_32hz", "point_force_100hz", "point_force_122hz", "point_force_124hz"]


@cache
def result(name):
    return beamsim.run(beamsim.load_scenario(config_path(name), {"run.convergence": "off"}))


def orders(name, quantity="absolute_acceleration", above_db=-60.0):
    """Orders of the tip's spectral lines that stand above a level."""
    return {
        round(line.order, 3)
        for line in lines_of(result(name), quantity, "tip")
        if line.amplitude_db > above_db and line.kind != "mean"
    }


@first_apart("name", 1, ONE_SIDED + PRESTRESSED_LINEAR + PRESTRESSED + BACKLASH + POINT_FORCE)
def test_energy_balance_and_status(name):
    r = result(name)
    assert r.complete
    assert r.summary["energy_error"] < 1e-8
    assert r.summary["reduction_bound"] < 0.01


@pytest.mark.parametrize("name", ONE_SIDED[:3])
def test_one_sided_contact_gives_odd_and_even_superharmonics(name):
    assert not result(name).summary["linear"]
    assert {1.0, 2.0, 3.0, 4.0} <= orders(name)


def test_one_sided_contact_at_160_hz_gives_subharmonics_too():
    found = orders("one_sided_160hz")
    assert {1.0, 2.0} <= found
    assert any(order < 1.0 or order % 1.0 != 0.0 for order in found)


@pytest.mark.parametrize("name", ONE_SIDED)
def test_the_stop_below_makes_the_mean_positive(name):
    tip = result(name)["histories"]["displacement"].sel(probe="tip").values
    assert tip[tip.size // 2 :].mean() > 0
    low, high = (result(name).summary[f"{which}_displacement_m"]["tip"] for which in ("min", "max"))
    assert high > 2 * abs(low)


def independent_displacement(hz, stiffness=151.1e3):
    """Largest tip displacement from 0.7 to 0.8 s of the rig at 2 g, three modes on four elements, by another code."""
    beam = Beam(0.27, 0.05, 0.005, 69e9, 2700.0, 4, "clamped", [(x, 4.2e-3) for x in (0.135, 0.2025, 0.27)])
    structure, shapes = beam.reduced(3, [0.27], 0.01)
    stop = Stop(beam.row(0.27) @ shapes, stiffness).with_damping_ratio(structure, 0.02)
    n, omega = len(stop.row), 2 * np.pi * hz
    motion = integrate(
        structure, [stop], lambda t: -structure.inertia * 2 * 9.80665 * np.sin(omega * t), np.zeros(2 * n),
        np.linspace(0.7, 0.8, 2001), most_step=1e-3, rtol=1e-6, atol=1e-9,
    )  # fmt: skip
    return (motion.state[:, :n] @ stop.row).max()


@pytest.mark.parametrize(
    ("hz", "axis_m", "fits"),
    [
        (45, 1.5e-4, False),
        (65, 4.0e-4, True),
        (78, 1.4e-3, False),
        (160, 3.0e-4, False),
    ],
)
def test_tip_displacement_against_the_printed_axes(hz, axis_m, fits):
    """Largest tip displacement from 0.7 to 0.8 s over the end of the thesis's axis, which bounds its curve.

    A finding, not an agreement: 65 Hz fits, 78 Hz comes out 18 % and 45 and 160 Hz 1.8 times above the printed axes.
    The thesis documents neither its damping model nor the frame of its displacements. That it is the printed axes
    that do not come out, and not the program, is what the independent code says of the one that fits and of the worst.
    """
    r = result(f"one_sided_{hz}hz")
    highest = r["histories"]["displacement"].sel(probe="tip").values[r["histories"]["time"].values >= 0.7].max()
    if hz in (65, 160):
        assert highest == pytest.approx(independent_displacement(hz), rel=0.015)
    assert bool(highest < 1.05 * axis_m) is fits


def test_the_independent_displacement_would_see_another_snubber():
    """Twin: a snubber 15 % softer moves the largest displacement by more than is allowed above."""
    changed = independent_displacement(65, 0.85 * 151.1e3)
    assert result("one_sided_65hz")["histories"]["displacement"].sel(probe="tip").values[-2001:].max() != pytest.approx(
        changed, rel=0.015
    )


@pytest.mark.parametrize("factor", [np.pi])
def test_zero_gap_scales_exactly_with_the_level(factor):
    scenario = config_path("one_sided_45hz")
    scaled = beamsim.run(beamsim.load_scenario(scenario, {"excitation.level": 2 * 9.80665 * factor}))
    reference = result("one_sided_45hz")
    for name in ("displacement", "absolute_acceleration"):
        expected = reference["histories"][name].sel(probe="tip").values
        found = scaled["histories"][name].sel(probe="tip").values / factor
        assert np.abs(found - expected).max() < 1e-10 * np.abs(expected).max()


@pytest.mark.parametrize("name", PRESTRESSED_LINEAR)
def test_small_excitation_on_a_prestressed_snubber_is_linear(name):
    """Contact is never lost: one line and a positive mean."""
    r = result(name)
    assert r.summary["linear"]
    assert r.summary["contact_share"]["tip"] == 1.0
    assert np.all(r["histories"]["snubber_force"].sel(snubber="tip").values > 0)
    line = max((x for x in lines_of(r, "displacement", "tip") if x.kind != "mean"), key=lambda x: x.amplitude)
    assert line.order == pytest.approx(1.0, abs=1e-3)
    assert all(
        x.amplitude < 0.02 * line.amplitude
        for x in lines_of(r, "displacement", "tip")
        if x.kind in ("superharmonic", "subharmonic")
    )
    assert r["histories"]["displacement"].sel(probe="tip").values.mean() > 0


@pytest.mark.parametrize("name", PRESTRESSED)
def test_large_excitation_on_a_prestressed_snubber_is_nonlinear(name):
    r = result(name)
    assert not r.summary["linear"]
    assert 0 < r.summary["contact_share"]["tip"] < 1
    assert orders(name) - {1.0}
    assert r["histories"]["displacement"].sel(probe="tip").values[r["histories"]["time"].values > 0.4].mean() > 0


@pytest.mark.parametrize("name", PRESTRESSED + PRESTRESSED_LINEAR)
def test_prestress_is_about_thirty_newton_blocked_and_one_at_equilibrium(name):
    s = result(name)
    assert s["histories"]["snubber_blocked_force"].sel(snubber="tip").item() == pytest.approx(30.2, abs=0.1)
    assert 0.5 < s["histories"]["snubber_preload"].sel(snubber="tip").item() < 2.0


@pytest.mark.parametrize("name", BACKLASH)
def test_half_a_millimetre_of_backlash_is_reached(name):
    r = result(name)
    assert not r.summary["linear"]
    assert r.summary["contacts"]["tip"] > 0
    assert 2.0 in orders(name, above_db=-70.0) or 3.0 in orders(name, above_db=-70.0)


def test_five_millimetres_of_backlash_never_close():
    """The printed 5 mm cannot be: the three cases are linear with it."""
    short = {"run.duration": "0.3 s", "run.spectrum": None, "run.convergence": "off"}
    for name in BACKLASH:
        scenario = beamsim.load_scenario(config_path(name), {"snubbers[0].gap": 5e-3, **short})
        assert beamsim.run(scenario).summary["linear"], name


@pytest.mark.parametrize("name", POINT_FORCE)
def test_point_force_against_one_sided_contact(name):
    assert not result(name).summary["linear"]
    assert orders(name) - {1.0}


def test_almost_positive_displacement_under_the_stiff_support_at_32_hz():
    summary = result("point_force_32hz").summary
    assert summary["max_displacement_m"]["tip"] > 4 * abs(summary["min_displacement_m"]["tip"])
