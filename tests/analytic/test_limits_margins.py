"""Margins of safety against answers that can be computed by hand."""

import math

import pytest

import beamsim
from beamsim.results.values import limits_not_met, margin_of, margins
from beamsim.scenario import load_scenario
from beamsim.scenario.reporting import Limits

DROPPED = """\
title: A mass that flies into a stop
chain:
  masses: [2 kg]
  springs: [0]
  snubbers: [{name: stop, mass: 1, side: below, mounted_on: ground, stiffness: 800 N/m, gap: 10 mm}]
excitation: {kind: none}
run: {duration: 0.3 s, sample_rate: 1 kHz, start: {displacement: [0], velocity: [-0.5]}}
"""


def test_margin():
    assert margin_of(50.0, 40.0) == 0.25
    assert margin_of(50.0, 100.0) == -0.5
    assert margin_of(50.0, 50.0) == 0.0
    assert math.isinf(margin_of(50.0, 0.0))
    assert math.isnan(margin_of(50.0, math.nan))


def test_force_and_gap_of_a_thrown_mass():
    """It stays in contact half a period of 20 rad/s: force v sqrt(k m), gap 10 mm at the start, then growing."""
    limits = {"peak_force": 25.0, "gap": 0.04, "peak_displacement": 0.1}
    summary = beamsim.run(load_scenario(DROPPED, {"limits": limits})).summary
    force = 0.5 * math.sqrt(800.0 * 2.0)
    found = summary["margins"]
    assert found["peak_force"]["value"] == pytest.approx(force, rel=1e-10)
    assert found["peak_force"]["margin"] == pytest.approx(25.0 / force - 1.0, rel=1e-9)
    assert found["peak_force"]["at"] == "stop"
    assert not found["peak_force"]["exceeded"]
    free = 0.3 - 0.01 / 0.5 - math.pi / 20.0  # after the contact, at the speed it came with
    assert summary["largest_gap_m"]["stop"] == pytest.approx(0.5 * free, rel=1e-9)
    assert found["gap"]["exceeded"]
    assert found["gap"]["margin"] == pytest.approx(0.04 / (0.5 * free) - 1.0, rel=1e-8)


def test_closed_all_the_time_is_no_gap():
    text = DROPPED.replace("gap: 10 mm", "gap: -10 mm").replace("springs: [0]", "springs: [800]")
    text = text.replace("velocity: [-0.5]", "velocity: [0]").replace("displacement: [0]", "displacement: [0.001]")
    summary = beamsim.run(load_scenario(text, {"limits": {"gap": 0.001}})).summary
    assert summary["largest_gap_m"]["stop"] == 0.0
    assert math.isinf(summary["margins"]["gap"]["margin"])


def test_without_limits_there_are_no_margins():
    assert "margins" not in beamsim.run(load_scenario(DROPPED)).summary
    assert margins(None, {}) == {}


def test_every_limit_takes_the_worst_place():
    summary = {
        "peak_force_n": {"a": 10.0, "b": 30.0},
        "peak_displacement_m": {"p": 1e-3, "q": 5e-4},
        "peak_acceleration_g": {"p": 2.0, "q": 3.0},
        "largest_gap_m": {"a": 0.0, "b": 1e-3},
        "largest_bending_stress_pa": 4e7,
        "largest_bending_stress_position_m": 0.135,
    }
    limits = Limits(
        peak_force="20 N", peak_displacement="2 mm", peak_acceleration="3.5 g", gap="1 mm", bending_stress="80 MPa"
    )
    found = margins(limits, summary)
    assert {name: item["at"] for name, item in found.items()} == {
        "peak_force": "b", "peak_displacement": "p", "peak_acceleration": "q", "gap": "b",
        "bending_stress": "x = 0.135 m",
    }  # fmt: skip
    assert found["peak_acceleration"]["value"] == pytest.approx(3.0 * 9.80665)
    assert [name for name, item in found.items() if item["exceeded"]] == ["peak_force"]
    assert limits_not_met(load_scenario(DROPPED), found) == ["peak force = 30 N exceeds limits.peak_force = 20 N"]
