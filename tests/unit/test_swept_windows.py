"""Windows of a swept sine: exact phases and levels, bounded truncation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sweep_windows import values_at

from beamsim.analyses.sweep.swept_sine import legs_of
from beamsim.errors import ScenarioError
from beamsim.inputs.profiles import Leg, Profile
from beamsim.inputs.swept import cut_into_windows, swept_signals
from beamsim.scenario import load_scenario
from beamsim.scenario.sweep import SweptSine

pytestmark = pytest.mark.quick


OCTAVES = float(np.log(2) / 30)  # 2 oct/min


def sine(leg, t, profile):
    r, f = leg.signed_rate, leg.first_hz
    turns = f * np.expm1(r * t) / r if leg.logarithmic else f * t + 0.5 * r * t**2
    now = f * np.exp(r * t) if leg.logarithmic else f + r * t
    return profile(now) * np.sin(2 * np.pi * turns)


@settings(max_examples=15, deadline=None)
@given(
    first=st.floats(1.0, 100.0), last=st.floats(1.0, 100.0), rate=st.floats(0.01, 3.0), logarithmic=st.booleans(),
    power=st.sampled_from([0.0, 1.0, 2.0, -1.5, 0.3]),
)  # fmt: skip
def test_windows_are_the_sine_to_the_bound(first, last, rate, logarithmic, power):
    if abs(first - last) < 1e-2:
        return
    leg = Leg(first, last, rate if logarithmic else 20 * rate, logarithmic)
    if leg.cycles > 20_000:
        return
    profile = Profile(np.array([first]), np.array([2.0]), np.array([power]))
    windows = cut_into_windows([leg], profile)
    assert windows.truncation <= 1e-12
    assert windows.duration == pytest.approx(leg.duration, rel=1e-12)
    t = np.linspace(0, leg.duration, 5000)
    largest = np.maximum(profile(first), profile(last))
    # what is compared with loses the digits of a phase of many radians
    tolerance = (1e-11 + 1e-15 * 2 * np.pi * leg.cycles) * largest
    assert np.abs(values_at(windows, windows.coefficient, t) - sine(leg, t, profile)).max() < tolerance


def test_the_number_of_cycles_of_the_thesis_sweep():
    windows = cut_into_windows([Leg(20.0, 400.0, OCTAVES, True)], Profile.constant(1.0))
    assert windows.cycles == 16447
    assert windows.duration == pytest.approx(129.66, abs=0.01)
    assert windows.count == windows.cycles  # a window a cycle is short enough
    assert windows.frequency_hz[0] == pytest.approx(20.0, abs=0.02)
    assert np.diff(windows.edge[:-1]) @ windows.frequency_hz[:-1] == pytest.approx(windows.cycles - 1, rel=1e-6)


def test_windows_of_some_cycles_are_those_of_the_sweep():
    """Beside its own frequency a window is one piece, and the phase runs on from cycle to cycle."""
    windows = cut_into_windows([Leg(10.0, 25.0, 0.01, True)], Profile.constant(2.0), corrections=())
    some = windows.of_cycles(30, 40)
    begin = windows.edge[30]
    signal, _, _ = swept_signals(some, some.omega[5])
    assert signal.start.size == some.count == 10
    t = np.linspace(0, some.duration * (1 - 1e-12), 1000)
    expected = values_at(windows, windows.coefficient, begin + t)
    assert np.abs(signal(t) - expected).max() < 1e-12 * np.abs(expected).max()


def test_held_profile():
    profile = Profile.from_steps([(5.0, 0.01, "displacement"), (20.0, 0.5, "velocity"), (80.0, 30.0, "acceleration")])
    omega = 2 * np.pi * np.array([2.0, 10.0, 40.0, 200.0])
    np.testing.assert_allclose(profile(omega / (2 * np.pi)), [0.01, 0.01, 0.5, 30.0] * omega ** [2, 2, 1, 0])
    line = Profile.log_log([(10.0, 1.0, "acceleration"), (40.0, 8.0, "acceleration")])
    np.testing.assert_allclose(line([5.0, 10.0, 20.0, 40.0, 100.0]), [1.0, 1.0, 8.0**0.5, 8.0, 8.0])
    assert Profile.log_log([(10.0, 2.0, "force")])(33.0) == 2.0
    np.testing.assert_allclose(profile.scaled(0.5)([10.0]), profile([10.0]) / 2)


@settings(max_examples=30, deadline=None)
@given(
    low=st.floats(1, 60), width=st.floats(1, 60), level=st.floats(0.1, 100),
    quantity=st.sampled_from(["acceleration", "velocity", "displacement"]),
)  # fmt: skip
def test_a_notch_is_never_exceeded_and_nothing_else_changes(low, width, level, quantity):
    profile = Profile.from_steps([(5.0, 0.01, "displacement"), (20.0, 0.5, "velocity"), (80.0, 30.0, "acceleration")])
    high = low + width
    level = level / (2 * np.pi * 20) ** {"acceleration": 0, "velocity": 1, "displacement": 2}[quantity]
    notched = profile.with_notch(low, high, level, quantity)
    assert np.all(np.diff(notched.edge) > 0)
    f = np.linspace(1.0, 130.0, 3001)
    omega = 2 * np.pi * f
    limit = level * omega ** {"acceleration": 0, "velocity": 1, "displacement": 2}[quantity]
    inside = (f >= low) & (f < high)
    expected = np.where(inside, np.minimum(profile(f), limit), profile(f))
    np.testing.assert_allclose(notched(f), expected, rtol=1e-9)


@pytest.mark.parametrize(
    ("rate", "says"),
    [
        ("1e-5 Hz/s", r"sweep.rate = 1e-05 Hz/s makes a sweep of 8.38e\+09 cycles \(at most 5e\+06\); sweep faster"),
        ("1e6 Hz/s", r"sweep.rate = 1000000.0 Hz/s covers the range in 0.084 cycles; sweep more slowly"),
    ],
)
def test_too_long_and_too_short_sweeps_are_refused(rate, says):
    case = {"from": 20.0, "to": 410.0, "rate": rate, "kind": "swept_sine"}
    with pytest.raises(ScenarioError, match=says):
        load_scenario("configs/one_sided_65hz.yaml", {"sweep": case})


@pytest.mark.parametrize(("rate", "direction"), [("2 oct/min", "up"), ("1 Hz/s", "both")])
def test_the_cycles_of_a_sweep_are_those_of_its_legs(rate, direction):
    settings = SweptSine.model_validate({"from": 20.0, "to": 410.0, "rate": rate, "direction": direction})
    np.testing.assert_allclose(settings.cycles, sum(leg.cycles for leg in legs_of(settings)), rtol=1e-12)
