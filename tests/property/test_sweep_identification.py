"""Parameters of a stop from a table of slow sine sweeps: peaks and jumps, up and down.

A mass of 1 kg on a spring, 10 Hz, with a stop on one side, on a shaker. What a slow sweep shows is integrated apart
from the program, by the method of Runge and Kutta here and by `scipy.integrate` (DOP853).
"""

from functools import cache
from itertools import product
from statistics import NormalDist

import numpy as np
import pytest
from numba import njit
from scipy.integrate import solve_ivp

from beamsim.analyses.identify.analysis import identify_stiffness
from beamsim.analyses.identify.records import SweptPeaks
from beamsim.cli.measured import identification_screen
from beamsim.errors import ScenarioError
from beamsim.flow.channels import channel_values
from beamsim.scenario import load_scenario
from beamsim.system.reduced_model import SharedBuilds
from tests.helpers.tables import estimates, fitted_tests

SPRING = (2 * np.pi * 10.0) ** 2
STOP, GAP, DASHPOT = "chain.snubbers.stop.stiffness", "chain.snubbers.stop.gap", "chain.dashpots[0]"
TRUTH = {STOP: 3e3, GAP: 1.5e-3, DASHPOT: 2.0}
NUMBERS = tuple(TRUTH.values())
BEGIN = {STOP: 2.95e3, GAP: 1.525e-3, DASHPOT: 2.05}
SCATTER_HZ, SCATTER = 0.02, 0.02


def row(level, direction, numbers=(10.0, 10.0, 10.0), **more):
    """A jump, the frequency of the peak where the sweep goes up, and the peak."""
    *frequencies, height = numbers
    peak = {"absolute_acceleration": height, "scatter": SCATTER}
    if direction == "up":
        peak["frequency"] = frequencies[-1]
    return {
        "kind": "sweep", "name": f"{level} {direction}", "level": level, "direction": direction, "from": 9.8, "to": 12,
        "jump": frequencies[0], "scatter": SCATTER_HZ, "peaks": [peak], **more,
    }  # fmt: skip


def case(tests, numbers=TRUTH, **more):
    stop = {"name": "stop", "mass": 1, "side": "above", "gap": numbers[GAP], "stiffness": numbers[STOP]}
    fit = {"starts": 1, "profiles": False, "estimate": list(TRUTH), "tests": tests, **more}
    return load_scenario({
        "chain": {"masses": [1.0], "springs": [SPRING], "dashpots": [numbers[DASHPOT]], "snubbers": [stop]},
        "excitation": {"kind": "harmonic", "applied_to": "base", "level": 1.0, "frequency": 10.0},
        "probes": [{"name": "mass", "mass": 1}],
        "identify_stiffness": {"snubber": "stop", "nonlinear": fit},
    })  # fmt: skip


@cache
def shown(level, direction):
    """What a slow sweep shows with the true values."""
    scenario = case([row(level, direction)])
    test = SweptPeaks.of(0, scenario.identify_stiffness.nonlinear.tests[0], "mass")
    return test.predict(test.case(scenario), None, SharedBuilds()).predicted


def table(seed, levels=(1.0,)):
    """Rows with noise."""
    generator, rows = np.random.default_rng(seed), []
    for level in levels:
        for direction in ("up", "down"):
            exact = shown(level, direction)
            wide = np.full(exact.size, SCATTER_HZ)
            wide[-1] = SCATTER * exact[-1]
            rows.append(row(level, direction, (exact + wide * generator.standard_normal(exact.size)).tolist()))
    return rows


def cubic(x):
    """Terms of polynomials of the third degree in three numbers of order one."""
    powers = [p for p in product(range(4), repeat=3) if sum(p) <= 3]
    return np.stack([np.prod(x ** np.array(p), axis=-1) for p in powers], axis=-1)


@cache
def numbers_of():
    """Numbers of the table with one level as cubics of the logarithms of stiffness, gap and dashpot over the truth, for
    3.5 deviations about it; where they were fitted they are right to a thousandth of a deviation."""
    wide, truth, x, rows = np.array([0.056, 0.077, 0.067]), list(TRUTH.values()), [], []
    first = dict.fromkeys(("up", "down"))
    for corner in (np.zeros(3), *np.random.default_rng(0).uniform(-1.0, 1.0, (11, 3))):
        near = dict(first)
        for share in (1 / 3, 2 / 3, 1.0) if corner.any() else (0.0,):
            values = (truth * np.exp(share * corner * wide)).tolist()
            for direction in near:
                scenario = case([row(1.0, direction)], dict(zip(TRUTH, values, strict=True)))
                test = SweptPeaks.of(0, scenario.identify_stiffness.nonlinear.tests[0], "mass")
                near[direction] = test.predict(test.case(scenario), near[direction], SharedBuilds())
            first = first if first["up"] else dict(near)
            x.append(share * corner)
            rows.append(np.log(np.concatenate([each.predicted for each in near.values()])))
    x, rows = np.array(x), np.array(rows)
    factors, *_ = np.linalg.lstsq(cubic(x[:31]), rows[:31], rcond=None)
    assert np.abs(cubic(x[31:]) @ factors - rows[31:]).max() < 1e-4
    return lambda x: np.exp(cubic(x / wide) @ factors)


def least_squares(numbers, measured, sigma):
    """Logarithms (n, 3) that fit each of n tables, their deviations to first order, and chi squared."""
    x, step = np.zeros((len(measured), 3)), 1e-4
    for _ in range(12):
        change = [numbers(x + step * e) - numbers(x - step * e) for e in np.eye(3)]
        jacobian = np.stack(change, axis=-1) / (2 * step) / sigma[..., None]
        residual = (numbers(x) - measured) / sigma
        covariance = np.linalg.inv(np.einsum("nij,nik->njk", jacobian, jacobian))
        x = x - np.einsum("njk,nik,ni->nj", covariance, jacobian, residual)
    return x, np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)), np.sum(residual**2, axis=1)


@njit
def one_settled(numbers, level, omega, state, cycles):
    """State of a mass after so many periods of the base, and its largest absolute acceleration in the last of them.

    ``numbers`` are the stiffness and the gap of the stop, and the dashpot. Steps are of a thousandth of a period.
    """
    stiffness, gap, dashpot = numbers
    x, v = state
    step, highest = 2 * np.pi / omega / 1000, 0.0
    for k in range(1000 * cycles):
        rates, dx, dv = np.zeros((4, 2)), 0.0, 0.0
        for j in range(4):
            share = 0.0 if j == 0 else (1.0 if j == 3 else 0.5)
            at, speed = x + share * step * dx, v + share * step * dv
            pull = -SPRING * at - dashpot * speed - stiffness * max(at - gap, 0.0)
            if j == 0 and k >= 1000 * (cycles - 1):
                highest = max(highest, abs(pull))
            dx, dv = speed, pull - level * np.sin(omega * step * (k % 1000 + share))
            rates[j] = dx, dv
        x += step / 6 * (rates[0, 0] + 2 * rates[1, 0] + 2 * rates[2, 0] + rates[3, 0])
        v += step / 6 * (rates[0, 1] + 2 * rates[1, 1] + 2 * rates[2, 1] + rates[3, 1])
    return x, v, highest


def settled(level, frequency, state, cycles, numbers=NUMBERS):
    """States (n, 2) of n masses after so many periods, each at its own level and frequency; and their peaks."""
    found = np.array(
        [
            one_settled(numbers, a, 2 * np.pi * f, tuple(z), cycles)
            for a, f, z in zip(level, frequency, state, strict=True)
        ]
    )
    return found[:, :2], found[:, 2]


def test_a_stepped_sweep_that_is_integrated_jumps_and_peaks_where_it_is_said_to():
    """Up and down at three levels: just before a jump nothing happens, just behind it the amplitude has jumped."""
    level = np.array([0.6, 1.0, 1.5] * 3)
    jump = np.array([shown(a, way)[0] for way in ("up", "down", "up") for a in level[:3]])
    top = np.array([shown(a, "up")[1] for a in level[:3]])
    height = np.array([shown(a, way)[-1] for way in ("up", "down", "up") for a in level[:3]])
    way = np.array([1.0] * 3 + [-1.0] * 3 + [1.0] * 3)
    begin = np.array([shown(a, "down" if w > 0 else "up")[0] - 0.1 * w for a, w in zip(level, way, strict=True)])
    before = np.concatenate([jump[:6] * (1 - 0.003 * way[:6]), top])  # the last three stay at the peak
    state, _ = settled(level, begin, np.zeros((9, 2)), 150)
    for share in (0.4, 0.7, 0.9):
        state, _ = settled(level, begin + share * (before - begin), state, 60)
    state, at_hand = settled(level, before, state, 150)
    assert at_hand[6:] == pytest.approx(height[6:], rel=1e-3)
    state, behind = settled(level[:6], jump[:6] * (1 + 0.003 * way[:6]), state[:6], 300)
    assert np.all(behind[:3] < 0.85 * at_hand[:3])
    assert np.all(behind[3:] > 1.15 * at_hand[3:6])
    _, landed = settled(level[3:6], jump[3:6], state[3:], 300)
    assert landed == pytest.approx(height[3:6], rel=1e-3)


def test_intervals_hold_the_truth_as_often_as_they_say():
    """Of 20,000 tables that polynomials are fitted to; a fit of the program from other initial values is the same."""
    numbers, height = numbers_of(), [False, False, True, False, True]
    rows = table(0)
    up, down = rows[0]["peaks"][0], rows[1]["peaks"][0]
    measured = [rows[0]["jump"], up["frequency"], up["absolute_acceleration"], rows[1]["jump"]]
    measured = np.array([*measured, down["absolute_acceleration"]])
    sigma = np.where(height, SCATTER * measured, SCATTER_HZ)
    x, deviation, misfit = (each[0] for each in least_squares(numbers, measured[None], sigma[None]))
    found = identify_stiffness(case(rows, BEGIN), [])
    z = NormalDist().inv_cdf(0.975)
    for p, truth, at, wide in zip(estimates(found, "nonlinear"), TRUTH.values(), x, deviation, strict=True):
        assert np.log(p.value / truth) == pytest.approx(at, abs=0.01 * wide)
        assert np.diff(p.interval) / p.value == pytest.approx(2 * z * wide, rel=0.01)
    assert found["nonlinear"]["misfit"].item() == pytest.approx(misfit, abs=0.02)
    exact = numbers(np.zeros(3))
    noise = np.where(height, SCATTER * exact, SCATTER_HZ)
    measured = exact + noise * np.random.default_rng(1).standard_normal((20_000, 5))
    sigma = np.where(height, SCATTER * measured, SCATTER_HZ)
    x, deviation, misfit = least_squares(numbers, measured, sigma)
    x[:, 1] = -np.expm1(-x[:, 1])  # the interval of a gap is even in the gap, others in the logarithm
    held = np.mean(np.abs(x) <= z * deviation, axis=0)
    assert misfit.mean() == pytest.approx(2.0, abs=0.1)  # degrees of freedom
    assert np.all(np.abs(held - 0.95) < 0.006)  # four deviations of such a count


def two_masses(tests, dashpots, gap, stiffness):
    """A chain of two masses, 6.2 and 16.3 Hz, with a stop at the free one; each test is a level and where it goes."""
    stop = {"name": "stop", "mass": 2, "side": "above", "gap": gap, "stiffness": stiffness}
    rows = [
        {"kind": "sweep", "name": f"{k}", "level": level, "direction": direction, "from": low, "to": high,
         "scatter": SCATTER_HZ, "jump": jump, "peaks": peaks}
        for k, (level, direction, low, high, jump, peaks) in enumerate(tests)
    ]  # fmt: skip
    estimate = [STOP, GAP, DASHPOT, "chain.dashpots[1]"]
    return load_scenario({
        "chain": {"masses": [1, 1], "springs": [4e3, 4e3], "dashpots": dashpots, "snubbers": [stop]},
        "excitation": {"kind": "harmonic", "applied_to": "base", "level": 1.0, "frequency": 6.0},
        "probes": [{"name": "held", "mass": 1}, {"name": "free", "mass": 2}],
        "identify_stiffness": {
            "snubber": "stop",
            "nonlinear": {"starts": 1, "profiles": False, "estimate": estimate, "tests": rows},
        },
    })  # fmt: skip


def integrated(frequency, level, numbers, start):
    """State (displacements, velocities) of two masses after a period, and the largest deflection of the free one."""
    stiffness, gap, *dashpots = numbers

    def rate(t, y):
        (x1, x2), v = y[:2], y[2:]
        between = 4e3 * (x2 - x1) + dashpots[1] * (v[1] - v[0])
        stop = stiffness * max(x2 - gap, 0.0)
        base = level * np.sin(2 * np.pi * frequency * t)
        return [*v, between - 4e3 * x1 - dashpots[0] * v[0] - base, -between - stop - base]

    times = np.linspace(0.0, 1 / frequency, 20_001)
    found = solve_ivp(rate, times[[0, -1]], start, "DOP853", times, rtol=1e-11, atol=1e-13, max_step=1e-3)
    return found.y[:, -1], np.abs(found.y[1]).max()


def test_two_masses_with_two_probes_at_three_levels_tell_the_truth():
    """Up and down beside the stop in the first mode, without contact in the second one; motions integrated apart."""
    truth = [3e3, 3e-3, 2.0, 1.0]
    ranges = [(0.5, "up", 6, 8), (1.0, "up", 6, 8), (0.5, "down", 6, 8), (5, "up", 15.5, 17.5)]

    def peaks(f_free=7.0, free=1e-2, f_held=7.0, held=10.0):
        at_free = {"probe": "free", "frequency": f_free, "displacement": free}
        return [at_free, {"probe": "held", "frequency": f_held, "absolute_acceleration": held}]

    asked = [(*each, 7.0 if each[3] == 8 else None, peaks()) for each in ranges]
    scenario, measured = two_masses(asked, truth[2:], truth[1], truth[0]), []
    for k, test in enumerate(scenario.identify_stiffness.nonlinear.tests):
        row = SweptPeaks.of(k, test, "free")
        shown = row.predict(row.case(scenario), None, SharedBuilds())
        *jump, f_free, free, f_held, held = shown.predicted.tolist()
        up = test.direction == "up"  # after the jump down into contact the amplitude overshoots
        measured.append((*ranges[k], jump[0] if jump else None, peaks(f_free, free, f_held, held) if up else []))
        channels = shown.system.channels.of_keys(("probes", "displacement"), ("probes", "velocity"))
        start = channel_values(shown.motion, channels, np.zeros(1))[0]
        end, peak_found = integrated(f_free, test.level, truth, start)
        assert end == pytest.approx(start, rel=1e-5, abs=1e-6)
        assert peak_found == pytest.approx(free, rel=1e-5)
    found = identify_stiffness(two_masses(measured, [2.02, 0.99], 3.02e-3, 2.98e3), [])["nonlinear"]
    assert found["value"].values == pytest.approx(truth, rel=1e-5)
    assert found["degrees_of_freedom"].item() == 11


def test_a_row_with_a_wrong_level_is_named():
    rows = table(0, (0.6, 1.0))
    rows[0]["peaks"][0]["absolute_acceleration"] *= 1.3
    found = identify_stiffness(case(rows, estimate=[STOP, DASHPOT]), [])
    worst = min(fitted_tests(found), key=lambda record: record.misfit_without)
    assert worst.name == "0.6 up"
    assert worst.misfit > 0.5 * found["nonlinear"]["misfit"].item()
    assert any("0.6 up has" in warning for warning in found.warnings)


def test_a_level_below_contact_tells_the_structure_and_that_a_sweep_is_too_fast():
    """Peak of a linear oscillator under 0.06 m/s^2: its frequency and height in closed form."""
    zeta = 0.5 * TRUTH[DASHPOT] / np.sqrt(SPRING)
    r = np.linspace(0.99, 1.01, 200_001)
    amplitude = 0.06 * np.sqrt((1 + (2 * zeta * r) ** 2) / ((1 - r**2) ** 2 + (2 * zeta * r) ** 2))
    tests = [row(0.06, "up", rate="1 Hz/s")]
    del tests[0]["jump"]
    scenario = case(tests)
    test = SweptPeaks.of(0, scenario.identify_stiffness.nonlinear.tests[0], "mass")
    found = test.predict(test.case(scenario), None, SharedBuilds())
    assert found.predicted == pytest.approx([10.0 * r[np.argmax(amplitude)], amplitude.max()], rel=1e-6)
    assert found.bandwidth == pytest.approx(TRUTH[DASHPOT] / (2 * np.pi), rel=1e-9)  # c / m / (2 pi), in Hz
    assert "1 Hz/s is fast for a bandwidth of 0.318 Hz" in test.fit_warnings(found)[-1]  # 0.1 times its square is 0.01


def test_a_motion_that_loses_its_stability_on_the_way_to_a_peak_is_named():
    """The period doubles from 8.6 to 9.4 Hz beside a stiff stop, as it does integrated; the peak is at 14.8 Hz."""
    numbers = {STOP: 30e3, GAP: 1e-4, DASHPOT: 2.0}

    def doubts(direction, **more):
        scenario = case([row(1.0, direction, jump=None, **{"from": 8, "to": 16, **more})], numbers)
        test = SweptPeaks.of(0, scenario.identify_stiffness.nonlinear.tests[0], "mass")
        return test.fit_warnings(test.predict(test.case(scenario), None, SharedBuilds()))

    def differs(frequency):
        states = [[[0.0, 0.0]]]
        for cycles in (300, 1, 1):
            states.append(settled([1.0], [frequency], states[-1], cycles, tuple(numbers.values()))[0])
        x = [float(state[0, 0]) for state in states[1:]]
        return abs(x[1] - x[0]) > 0.05 * abs(x[0]), abs(x[2] - x[0]) > 1e-3 * abs(x[0])

    (said,) = doubts("up")
    assert "the motion at 8.6" in said
    assert doubts("down") == doubts("up", **{"from": 9.6}) == []  # the peak comes first
    assert [differs(f) for f in (8.4, 9.0, 9.6)] == [(False, False), (True, False), (False, False)]


def test_tests_of_which_none_can_be_spared_are_not_said_to_explain_the_misfit():
    """Two rows of two numbers each, for two parameters: without one of them nothing is left to judge the other by."""
    heights = {0.05: 0.26, 0.06: 0.31, 0.07: 0.37}
    tests = [row(at, "up", (10.0, x), jump=None, **{"from": 9.9, "to": 10.1}) for at, x in heights.items()]
    few, enough = (identify_stiffness(case(tests[:n], estimate=[DASHPOT, "chain.springs[0]"]), []) for n in (2, 3))
    assert few["nonlinear"]["degrees_of_freedom"].item() == 2
    assert np.isnan(few["tests"]["misfit_without"].values).all()
    assert not any("of the misfit" in line for line in identification_screen(few).lines)
    assert np.isfinite(enough["tests"]["misfit_without"].values).all()
    assert any("of the misfit" in line for line in identification_screen(enough).lines)


def test_rows_of_a_file_are_those_that_are_written(tmp_path):
    """With decimal commas and units of their own; a jump at which no peak was read; a row that is left out."""
    (tmp_path / "sweeps.csv").write_text(
        "# shaker\nname;level (g);direction;jump (Hz);mass frequency (Hz);"
        "mass absolute acceleration (g);mass scatter (%)\n"
        "first;0,1;up;11,1;11,0;4,2;3\n;0,1;down;10,77;;;\nbad;0,2;up;12;12;9;3\n", encoding="utf-8",
    )  # fmt: skip
    g = 9.80665
    at = {"kind": "sweep", "from": 9.8, "to": 12, "scatter": SCATTER_HZ}
    peak = {"probe": "mass", "frequency": 11.0, "absolute_acceleration": 4.2 * g, "scatter": 0.03}
    written = [
        {**at, "name": "first", "level": 0.1 * g, "jump": 11.1, "peaks": [peak]},
        {**at, "name": "lab 2", "level": 0.1 * g, "direction": "down", "jump": 10.77},
    ]
    file = {**at, "name": "lab", "file": str(tmp_path / "sweeps.csv"), "gain": 1.1}
    by_file, by_hand = (
        fitted_tests(identify_stiffness(case(tests, leave_out=out, estimate=[DASHPOT]), []), "peak")
        for tests, out in (([file], ["bad"]), ([{**row, "gain": 1.1} for row in written], []))
    )
    assert [each.name for each in by_hand] == ["first", "lab 2"]
    for one, other in zip(by_file, by_hand, strict=True):
        assert (one.name, one.direction, *one.peak_what) == (other.name, other.direction, *other.peak_what)
        for name in ("level", "peak_measured", "peak_noise", "peak_predicted"):
            assert getattr(one, name) == pytest.approx(getattr(other, name), rel=1e-9), name


def test_without_jump_in_the_model_the_row_is_named():
    with pytest.raises(ScenarioError, match=r"0\.06 up: the model does not jump"):
        identify_stiffness(case([row(0.06, "up"), row(1.0, "up")]), [])


@pytest.mark.parametrize(
    ("change", "text"),
    [({"to": 5}, "lies below from"), ({"jump": None, "peaks": []}, "has neither jump nor peaks"),
     ({"peaks": [{"frequency": 10.0}]}, "has no value, or two"),
     ({"peaks": [{"probe": "mas", "displacement": 1e-3}]}, "mas")],
)  # fmt: skip
def test_rows_that_say_too_little_are_refused(change, text):
    with pytest.raises(ScenarioError, match=text):
        case([row(1.0, "up", **change)])
