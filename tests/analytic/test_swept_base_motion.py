"""The base under a swept sine: displacement, velocity and acceleration belong together, without drift."""

import numpy as np
import pytest
from sampling import first_apart
from scipy.special import exp1, wofz
from sweep_windows import frequency_at

import beamsim
from beamsim.inputs.drift import CorrectionSize, drift_free, jumps
from beamsim.inputs.profiles import Leg, Profile
from beamsim.inputs.swept import cut_into_windows
from beamsim.scenario import load_scenario

FLAT = Profile.constant(9.8)
HELD = Profile.from_steps([(5, 0.004, "displacement"), (11.3, 2.0, "acceleration"), (63, 0.02, "velocity")])
PROFILES = {
    "one level": FLAT,
    "notch in one level": FLAT.with_notch(17.0, 23.0, 2.0, "acceleration"),
    "table": HELD,
    "table and notch": HELD.with_notch(17.0, 30.0, 0.4, "acceleration"),
    "log-log": Profile.log_log([(5, 1.0, "acceleration"), (12, 9.0, "acceleration"), (60, 2.0, "acceleration")]),
    # steps as log-log tables have them: powers of -8, -135, 37 and 1,610
    "steep lines": Profile.from_points(
        np.array([5, 8, 10, 12, 12.2, 30, 31, 60, 60.06]), np.array([5.0, 5.0, 0.8, 0.8, 0.086, 0.3, 1.0, 1.0, 5.0])
    ),
}
SWEEPS = {
    f"{rate} Hz/s, {name}": legs
    for rate in (100, 20, 5)
    for name, legs in {
        "up": [Leg(5, 100, rate, False)],
        "down": [Leg(100, 5, rate, False)],
        "both": [Leg(5, 100, rate, False), Leg(100, 5, rate, False)],
    }.items()
} | {"2 oct/min, both": [Leg(5, 100, np.log(2) / 30, True), Leg(100, 5, np.log(2) / 30, True)]}


def sine(legs, profile, phase, t):
    """The acceleration without corrections, from the law of the sweep."""
    out, before, turns = np.zeros(t.shape), 0.0, 0.0
    for leg in legs:
        x, r, f = t - before, leg.signed_rate, leg.first_hz
        now = f * np.exp(r * x) if leg.logarithmic else f + r * x
        cycles = f * np.expm1(r * x) / r if leg.logarithmic else f * x + 0.5 * r * x**2
        inside = (x >= 0) & (x <= leg.duration)
        out[inside] = (profile(now) * np.sin(2 * np.pi * (turns + cycles) + phase))[inside]
        before, turns = before + leg.duration, turns + leg.cycles
    return out


def values(windows, coefficient, sigma):
    """Values (W, ...) at times ``sigma`` from the middle of each window."""
    power = np.arange(coefficient.shape[1])
    polynomial = np.einsum("wp,wkp->wk", coefficient, sigma[:, :, None] ** power)
    return (polynomial * np.exp(1j * windows.omega[:, None] * sigma)).real


# slower sweeps both ways, which have the legs of those one way; of the slowest, the most varied profiles
@first_apart(
    ("kind", "sweep"),
    6,
    [(kind, name) for name in SWEEPS if name.startswith("100 Hz/s") or name.endswith("both")
     for kind in reversed(PROFILES)
     if not name.startswith(("5 Hz/s", "2 oct")) or kind in ("steep lines", "table and notch")],
)  # fmt: skip
def test_displacement_velocity_and_acceleration_belong_together(kind, sweep):
    legs, profile = SWEEPS[sweep], PROFILES[kind]
    corrections = jumps(legs, profile, 0.3)
    windows = cut_into_windows(legs, profile, phase=0.3, corrections=corrections)
    omega, half = windows.omega, 0.5 * windows.length[:, None]
    level = profile(omega / (2 * np.pi))
    larger = np.maximum(level[1:], level[:-1])
    node, weight = np.polynomial.legendre.leggauss(24)
    motion = (windows.displacement, windows.velocity, windows.coefficient)
    for power, integral, integrand in ((2, *motion[:2]), (1, *motion[1:])):
        start, end = values(windows, integral, half * [-1.0, 1.0]).T
        assert np.all(np.abs(start[1:] - end[:-1]) <= 1e-10 * larger / omega[1:] ** power)
        growth = half[:, 0] * (values(windows, integrand, half * node) @ weight)
        assert np.all(np.abs(end - start - growth) <= 1e-11 * level / omega**power)

    # what is applied is the specified sine and the corrections: short smooth pulses, small beside the level
    time = (windows.start + half[:, 0])[:, None] + half * node
    pulses = sum((c.acceleration(time) for c in corrections), np.zeros(time.shape))
    specified = sine(legs, profile, 0.3, time)
    assert np.abs(values(windows, windows.coefficient, half * node) - specified - pulses).max() <= 1e-9 * level.max()
    assert all(CorrectionSize.of([correction]).share < 0.09 for correction in corrections)
    share = CorrectionSize.of(corrections).share
    assert np.abs(pulses).max() <= 1.001 * share * max((c.level for c in corrections), default=0.0)


@pytest.mark.parametrize("sweep", SWEEPS)
def test_no_drift(sweep):
    """From start to end the displacement has the size that belongs to the frequency; it is symmetrical about zero."""
    legs = SWEEPS[sweep]
    windows = cut_into_windows(legs, FLAT, corrections=jumps(legs, FLAT, 0.0))
    within = 0.5 * windows.length[:, None] * np.linspace(-1, 1, 41)
    time = windows.start[:, None] + 0.5 * windows.length[:, None] + within
    displacement, frequency = values(windows, windows.displacement, within), frequency_at(windows, time)
    assert np.all(np.abs(displacement) <= 1.01 * 9.8 / (2 * np.pi * frequency) ** 2)
    fast = frequency > 60.0
    scaled = displacement[fast] * (2 * np.pi * frequency[fast]) ** 2 / 9.8
    assert scaled.max() == pytest.approx(1.0, abs=0.01)
    assert scaled.min() == pytest.approx(-1.0, abs=0.01)


@pytest.mark.parametrize("change", [1e-7, 1e-3, 0.00999, 0.0101, 0.3, 5.0, 2e3])
@pytest.mark.parametrize("sign", [1, -1])
def test_factors_of_a_constant_level_in_closed_form(change, sign):
    """Error functions for a linear sweep, exponential integrals for a logarithmic one."""
    f = 10.0
    last = f + sign
    linear = Leg(f, last, change * 2 * np.pi * f**2, False)
    a = 0.5j * change * sign
    root = np.sqrt(a)
    velocity = 0.5 * np.sqrt(np.pi) / root * wofz(0.5j / root)
    if change > 1e-2:  # the closed form of the second cancels in slow sweeps
        np.testing.assert_allclose(drift_free(linear, 0.0, np.array([f]))[1], (1 - velocity) / (2 * a), rtol=1e-11)
    np.testing.assert_allclose(drift_free(linear, 0.0, np.array([f]))[0], velocity, rtol=1e-12)
    logarithmic = Leg(f, last, change * 2 * np.pi * f, True)
    if change > 2e-3:  # the exponential overflows
        z = 1 / (1j * change * sign)
        np.testing.assert_allclose(drift_free(logarithmic, 0.0, np.array([f]))[0], z * np.exp(z) * exp1(z), rtol=1e-11)
    for leg in (linear, logarithmic):  # constant velocity
        np.testing.assert_allclose(drift_free(leg, 1.0, np.array([f]))[0], 1.0, rtol=1e-13)


def scenario(duration=0.9, **changes):
    return load_scenario({
        "chain": {
            "masses": [1, 0.5], "springs": ["20 kN/m", "9 kN/m"], "dashpots": [2, 2],
            "snubbers": [{"name": "stop", "mass": 2, "side": "above", "stiffness": "30 kN/m", "gap": "2 mm",
                          "mounted_on": "ground"}],
        },
        "excitation": {"kind": "swept_sine", "applied_to": "base", "from": "5 Hz", "to": "100 Hz", **changes},
        "run": {"duration": duration, "sample_rate": "20 kHz", "start": "rest", "convergence": "off"},
    })  # fmt: skip


NOTCH = {"notches": [{"from": "17 Hz", "to": "30 Hz", "level": "0.4 g"}]}


def test_the_end_of_a_run_does_not_change_its_input():
    """A correction that begins before a run ends is there although its corner comes later."""
    excitation = {"level": "2 g", "rate": "100 Hz/s", **NOTCH}
    short, long = (
        beamsim.run(scenario(duration, **excitation))["histories"]["base_acceleration"].values[0]
        for duration in (0.118, 0.9)
    )
    np.testing.assert_allclose(short, long[: short.size], atol=1e-9 * np.abs(long).max())
