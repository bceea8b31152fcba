"""Shares of coexisting motions: against own integration from every start, and against published ones.

The Duffing oscillator x'' + 0.08 x' + x^3 = 0.2 cos t has five stable motions (J. M. T. Thompson, H. B. Stewart,
Nonlinear Dynamics and Chaos, 1986, figure 1.9). It is the first case of bSTAB (M. Stender, N. Hoffmann, Nonlinear
Dynamics 107, 2022), whose shares of 10,000 random starts in -1 < x < 1, -0.5 < x' < 1, as they are kept with the tests
of pyBasin, are 20.27 % for the small motion of period one, 49.50 % for the large one, 2.88 % and 2.57 % for the two of
period two, 24.78 % for that of period three.
"""

import numpy as np
import pytest
from independent import Stop, chain, integrate
from scipy.stats import beta

import beamsim
from tests.helpers.tables import rows

OMEGA = 2 * np.pi * 14.0


def oscillator(number):
    return beamsim.load_scenario({
        "chain": {
            "masses": [1.0], "springs": [4e3], "dashpots": [4.0],
            "snubbers": [{"name": "stop", "mass": 1, "side": "below", "stiffness": 4e4, "gap": "2 mm"}],
        },
        "excitation": {"kind": "harmonic", "applied_to": {"mass": 1}, "level": "4 N", "frequency": "14 Hz"},
        "probes": [{"name": "mass", "mass": 1}],
        "sweep": {
            "kind": "coexisting", "at": ["14 Hz"], "unstable": False,
            "starts": {"kind": "states", "number": number, "seed": 11, "box": [
                {"probe": "mass", "displacement": ["-10 mm", "10 mm"], "velocity": ["-1 m/s", "1 m/s"]}
            ]},
        },
    })  # fmt: skip


def states(result):
    """State at phase zero of every motion, by number, of one mass of 1 kg."""
    pairs = zip(rows(result["motions"], "motion"), result.branches, strict=True)
    return {
        m.number: np.array([b["coordinates"].values[0, 0], b["coordinate_velocities"].values[0, 0]]) for m, b in pairs
    }


def test_30_starts_end_where_dop853_with_events_takes_them():
    result = beamsim.coexisting(oscillator(30), workers=1)
    known, times = states(result), np.array([60.0 / 14.0])
    assert len(known) == 2
    stop, structure = Stop(np.ones(1), 4e4, gap=2e-3), chain([1.0], [4e3, 0.0], [4.0, 0.0])
    differ = []
    for start, number in zip(result["starts"]["start"].values, result["starts"]["destination"].values[0], strict=True):
        end = integrate(
            structure, [stop], lambda t: np.array([4.0 * np.sin(OMEGA * t)]), start, times, most_step=0.02, rtol=1e-9
        ).state[0]
        away = {k: np.linalg.norm((end - z) * [OMEGA, 1.0]) for k, z in known.items()}
        near, far = sorted(away, key=away.get)
        assert away[near] < 0.05 * away[far]
        differ += [] if near == number else [start]
    assert differ == []


def test_the_result_does_not_depend_on_the_workers():
    one, two = (beamsim.coexisting(oscillator(20), workers=workers) for workers in (1, 2))
    np.testing.assert_array_equal(*(each["starts"]["destination"].values for each in (one, two)))
    np.testing.assert_array_equal(one["starts"]["cycles"].values, two["starts"]["cycles"].values)
    assert rows(one["motions"], "motion") == rows(two["motions"], "motion")


DUFFING = {"small": 0.2027, "large": 0.4950, "two": 0.0288, "other two": 0.0257, "three": 0.2478}
NEAR = {
    "small": (-0.21, 0.02),
    "large": (1.05, 0.79),
    "two": (-0.67, 0.02),
    "other two": (-0.45, 0.29),
    "three": (-0.43, 0.12),
}
"""A state at phase zero of each motion, to two decimals, by which it is told apart."""


@pytest.fixture(scope="module")
def duffing():
    box = {"probe": "mass", "mode": 1, "displacement": ["-1 m", "1 m"], "velocity": ["-0.5 m/s", "1 m/s"]}
    return beamsim.coexisting(beamsim.load_scenario({
        "chain": {
            "masses": [1.0], "springs": [0.0], "dashpots": [0.08],
            "springs_to_ground": [{"mass": 1, "kind": "cubic", "stiffness": 1.0}],
        },
        "excitation": {
            "kind": "harmonic", "applied_to": {"mass": 1}, "level": "0.2 N", "frequency": "1 rad/s", "phase": "90 deg",
        },
        "probes": [{"name": "mass", "mass": 1}],
        "sweep": {
            "kind": "coexisting", "at": ["1 rad/s"], "unstable": False,
            "starts": {"kind": "states", "number": 150, "seed": 7, "box": [box]},
        },
    }), workers=1)  # fmt: skip


def own_sections(start, cycles, steps=160):
    """Runge-Kutta steps of all starts (n, 2) at once: sections (6, n, 2) of the last cycles."""
    x, v = start.T.copy()
    h = 2 * np.pi / steps

    def rate(t, x, v):
        return v, -0.08 * v - x**3 + 0.2 * np.cos(t)

    sections = []
    for _ in range(cycles):
        for k in range(steps):
            t = k * h
            a, b = rate(t, x, v)
            c, d = rate(t + h / 2, x + h / 2 * a, v + h / 2 * b)
            e, f = rate(t + h / 2, x + h / 2 * c, v + h / 2 * d)
            p, q = rate(t + h, x + h * e, v + h * f)
            x, v = x + h / 6 * (a + 2 * c + 2 * e + p), v + h / 6 * (b + 2 * d + 2 * f + q)
        sections.append(np.column_stack([x, v]))
    return np.array(sections[-6:])


def told_apart(sections):
    """Name of the motion of each start: one of whose states is near the last sections."""
    return [
        next((name for name, z in NEAR.items() if np.abs(of - z).max(axis=1).min() < 0.03), "")
        for of in np.swapaxes(sections, 0, 1)
    ]


def test_the_five_motions_of_the_duffing_oscillator_and_their_starts(duffing):
    assert sorted(m.period_cycles for m in rows(duffing["motions"], "motion")) == [1, 1, 2, 2, 3]
    ends = np.array(list(states(duffing).values()))
    names = dict(zip(states(duffing), told_apart(own_sections(ends, 6)), strict=True))
    assert sorted(names.values()) == sorted(NEAR)
    own = told_apart(own_sections(duffing["starts"]["start"].values, 170))
    assert own == [names[number] for number in duffing["starts"]["destination"].values[0]]


def test_published_shares_lie_within_the_intervals(duffing):
    ends = np.array(list(states(duffing).values()))
    names = dict(zip(states(duffing), told_apart(own_sections(ends, 6)), strict=True))
    intervals = {}
    for motion in rows(duffing["motions"], "motion"):
        k, n = motion.starts, 150  # 99.9 %: five shares at once
        low, high = beta.ppf(0.0005, k, n - k + 1), beta.ppf(0.9995, k + 1, n - k)
        intervals[names[motion.number]] = (low, high)
    assert all(intervals[name][0] < share < intervals[name][1] for name, share in DUFFING.items())
    assert not intervals["large"][0] < DUFFING["small"] < intervals["large"][1]  # they tell the shares apart
    assert not intervals["three"][0] < DUFFING["two"] < intervals["three"][1]
