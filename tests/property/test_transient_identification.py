"""Parameters from transients, alone and with steady vibrations: recovered, with honest intervals.

The records are integrated here with SciPy, apart from the package: a mass on a spring at a stop below it.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from beamsim.analyses.identify.analysis import identify_stiffness
from beamsim.errors import ScenarioError
from beamsim.measurements.channels import read_tests
from beamsim.measurements.signal import MeasuredSignal
from beamsim.scenario import load_scenario
from tests.helpers.tables import estimates, fitted_tests

STIFFNESS, DASHPOT, GAP = "chain.snubbers.stop.stiffness", "chain.dashpots[0]", "chain.snubbers.stop.gap"
TRUTH = {STIFFNESS: 20.0, DASHPOT: 0.1, GAP: 0.3}
BEGIN = {STIFFNESS: 23.0, DASHPOT: 0.08, GAP: 0.25}
GAIN = "identify_stiffness.nonlinear.tests[0].gain"
RELEASED = {"released_force": {"mass": 1, "force": 2.0}}  # upwards, with a stop below
STEP, SAMPLES = 0.05, 400
DROP = np.sin(np.arange(SAMPLES) * STEP) * np.exp(-0.1 * np.arange(SAMPLES) * STEP)


def motion(times, start=(0.0, 0.0), force=lambda t: 0.0, numbers=TRUTH):
    """(2, nt) displacement and velocity, from contact to contact."""

    def rate(t, z):
        pressed = max(-z[0] - numbers[GAP], 0.0)
        return z[1], force(t) - z[0] - numbers[DASHPOT] * z[1] + numbers[STIFFNESS] * pressed

    def touching(_, z):
        return z[0] + numbers[GAP]

    touching.terminal = True
    found, t, z, end = [np.array(start)[:, None]], times[0], np.array(start), times[-1]
    while t < end:
        part = solve_ivp(
            rate, (t, end), z, "DOP853", events=touching, rtol=1e-10, atol=1e-12, dense_output=True, max_step=0.4
        )
        inside = times[(times > t) & (times <= part.t[-1])]
        found.append(part.sol(inside))
        if part.status != 1:
            break
        t, z = part.t[-1], part.y[:, -1]
        t += 1e-9  # off the border
        z = z + 1e-9 * np.array(rate(t, z))
    return np.hstack(found)


def case(*tests, estimate=tuple(TRUTH), numbers=BEGIN, start="static_equilibrium", excitation=None, **fit):
    stop = {"name": "stop", "mass": 1, "side": "below", "gap": numbers[GAP], "stiffness": numbers[STIFFNESS]}
    nonlinear = {"estimate": list(estimate), "tests": list(tests), "starts": 1, "profiles": False, **fit}
    return {
        "chain": {"masses": [1.0], "springs": [1.0], "dashpots": [numbers[DASHPOT]], "snubbers": [stop]},
        "excitation": excitation or {"kind": "none"},
        "run": {"duration": 1.0, "start": start},
        "probes": [{"name": "mass", "mass": 1}],
        "identify_stiffness": {"snubber": "stop", "nonlinear": nonlinear},
    }


def transient(**keys):
    return {"kind": "transient", "file": "a.csv", "quantity": "displacement", **keys}


@pytest.fixture(scope="module")
def released():
    """Sixty samples at rest, held up, then a release; on a grid twenty times as fine as that of a record."""
    fine = np.arange(SAMPLES * 20) * (STEP / 20)
    return np.concatenate([np.full(60 * 20, 2.0), motion(fine, (2.0, 0.0))[0]])


def record(released, seed, gain=1.1, offset=0.7, noise=0.02):
    """A channel with noise, another zero and a wrong gain; when it was released, and the record, 0 to 20 early."""
    generator = np.random.default_rng(seed)
    first = int(generator.integers(0, 20))  # of the fine samples
    y = gain * released[first::20] + offset + noise * generator.standard_normal(released[first::20].size)
    return 60 * STEP - first * STEP / 20, MeasuredSignal("mass", np.arange(y.size) * STEP, y, unit="m")


def steady(frequency=0.2, seed=0, noise=0.01):
    """A record of a steady vibration under a unit force, begun at any time."""
    times = np.arange(0.0, 60.0 / frequency, 1 / (64 * frequency))
    x = motion(times, force=lambda t: np.sin(2 * np.pi * frequency * t))[0][-16 * 64 - 7 :]
    y = x + noise * np.abs(x).max() * np.random.default_rng(seed).standard_normal(x.size)
    return MeasuredSignal("mass", np.arange(y.size) / (64 * frequency), y, unit="m")


def holds(result, truth, deviations=3.5):
    for p in estimates(result, "nonlinear"):
        assert p.value == pytest.approx(truth[p.parameter], abs=deviations * p.standard_deviation)
        assert 0.0 < p.standard_deviation < 0.1 * abs(p.value)


def test_a_release_with_an_unknown_begin_zero_and_gain(released):
    begun, signal = record(released, 1)
    scenario = load_scenario(case(transient(begin="2.5 s"), start=RELEASED, estimate=(*TRUTH, GAIN)))
    result = identify_stiffness(scenario, [signal])
    holds(result, TRUTH | {GAIN: 1.1})
    assert not result.warnings
    (test,) = fitted_tests(result, "sample")
    low, high = test.delay_interval
    assert low - (high - low) < 2.5 - begun < high + (high - low)  # measured(t - 2.5 s) = predicted(t - begun)
    assert high - low < STEP
    assert test.noise == pytest.approx(0.02, rel=0.1)
    assert test.misfit == pytest.approx(result["nonlinear"]["degrees_of_freedom"].item(), rel=0.01)
    assert result.summary["test_delays_s"] == {"a.csv": [test.delay_s, low, high]}
    assert np.std(test.sample_measured - test.sample_predicted) == pytest.approx(0.02, rel=0.1)
    assert np.mean(test.sample_measured - test.sample_predicted) == pytest.approx(0.0, abs=1e-12)


def test_a_release_and_a_steady_vibration_in_one_fit(released):
    """Each alone tells less than both: the errors of both together are those of their summed information."""
    _, signal = record(released, 2)
    shaken = {"kind": "harmonic", "applied_to": {"mass": 1}, "level": 1.0, "frequency": 0.2}
    free = transient(begin="2.5 s", excitation={"kind": "none"}, start=RELEASED, name="released")
    periodic = {"file": "b.csv", "quantity": "displacement", "harmonics": 5}
    found = {}
    for name, tests in {"free": [free], "periodic": [periodic], "both": [free, periodic]}.items():
        signals = [{"a.csv": signal, "b.csv": steady()}[test["file"]] for test in tests]
        gains = ["identify_stiffness.nonlinear.tests.released.gain"] if free in tests else []
        scenario = load_scenario(case(*tests, excitation=shaken, estimate=[*TRUTH, *gains], numbers=TRUTH))
        found[name] = identify_stiffness(scenario, signals)
        holds(found[name], TRUTH | dict.fromkeys(gains, 1.1))
    information = {name: fit["nonlinear"]["standard_deviation"].values[:3] ** -2 for name, fit in found.items()}
    for alone in ("free", "periodic"):
        assert np.all(information["both"] > information[alone])
    both = found["both"]["tests"]
    assert both["name"].values.tolist() == ["released", "b.csv"]
    assert both["kind"].values.tolist() == ["transient", "steady"]
    np.testing.assert_array_equal(both["frequency_hz"].values, [np.nan, 0.2])  # of a steady vibration alone
    assert set(both["sample_test"].values) == {0}
    assert both["harmonic_test"].values.tolist() == [1] * 5


def test_a_drop_whose_base_was_recorded(tmp_path):
    """The motion of the base is a channel of the file that has the response; its time is that of the excitation."""
    times = np.arange(SAMPLES) * STEP
    base = CubicSpline(times, DROP)
    x, v = motion(times, force=lambda t: -base(t))
    pressed = np.maximum(-x - TRUTH[GAP], 0.0)
    absolute = -x - TRUTH[DASHPOT] * v + TRUTH[STIFFNESS] * pressed  # the forces on the mass
    generator = np.random.default_rng(3)
    y = absolute + 0.02 * generator.standard_normal(times.size)
    rows = "\n".join(f"{t:.17g},{b:.17g},{a:.17g}" for t, b, a in zip(times, DROP, y, strict=True))
    (tmp_path / "drop.csv").write_text(f"time (s),table (m/s^2),mass (m/s^2)\n{rows}\n")
    moved = {"kind": "sampled", "applied_to": "base", "file": "drop.csv", "column": "table"}
    test = {"kind": "transient", "file": "drop.csv", "phase": "of_excitation", "excitation": moved}
    (tmp_path / "case.yaml").write_text(load_scenario(case(test)).to_yaml())
    scenario = load_scenario(tmp_path / "case.yaml")
    result = identify_stiffness(scenario, read_tests(scenario, tmp_path))
    holds(result, TRUTH)
    assert not result.warnings
    assert result["tests"]["delay_s"].values.tolist() == [0.0]
    assert np.isnan(result["tests"]["delay_interval"].values).all()
    assert result.summary["test_delays_s"] == {}


def test_a_sampled_force_and_a_velocity(tmp_path, monkeypatch):
    times = np.arange(SAMPLES) * STEP
    force = CubicSpline(times, 2 * DROP)
    rows = "\n".join(f"{t:.17g},{f:.17g}" for t, f in zip(times, 2 * DROP, strict=True))
    (tmp_path / "force.csv").write_text(f"time (s),force (N)\n{rows}\n")
    monkeypatch.chdir(tmp_path)
    pushed = {"kind": "sampled", "applied_to": {"mass": 1}, "file": "force.csv"}
    y = motion(times, force=force)[1] + 0.02 * np.random.default_rng(4).standard_normal(times.size)
    scenario = load_scenario(case(transient(quantity="velocity", excitation=pushed), numbers=BEGIN))
    result = identify_stiffness(scenario, [MeasuredSignal("mass", times, y, unit="m/s")])
    holds(result, TRUTH)
    low, high = result["tests"]["delay_interval"].values[0]
    assert low - (high - low) < 0.0 < high + (high - low)


def test_noise_that_is_stated_too_small_widens_the_intervals(released):
    _, signal = record(released, 1, gain=1.0)
    stated = load_scenario(case(transient(begin="2.5 s", noise="0.1 %"), start=RELEASED))
    told, own = (identify_stiffness(each, [signal]) for each in (stated, load_scenario(
        case(transient(begin="2.5 s"), start=RELEASED))))  # fmt: skip
    assert any("more than their noise" in warning for warning in told.warnings)
    told, own = (each["nonlinear"]["standard_deviation"].values for each in (told, own))
    assert told == pytest.approx(own, rel=0.01)


def test_a_wrong_model_is_told_from_noise(released):
    """A record of a mass at a stop is not explained without one: the noise is not taken from what such a fit leaves."""
    _, signal = record(released, 1, gain=1.0)
    wrong = {**BEGIN, GAP: 5.0}
    result = identify_stiffness(
        load_scenario(case(transient(begin="2.5 s"), start=RELEASED, numbers=wrong, estimate=[DASHPOT])), [signal]
    )
    assert any("more than their noise" in warning for warning in result.warnings)
    assert any("no contact opens or closes" in warning for warning in result.warnings)
    assert result["tests"]["noise"].values == pytest.approx([0.02], rel=0.2)


@pytest.mark.parametrize(
    ("keys", "change", "says"),
    [
        ({"begin": "100 s"}, {}, "has 0 samples after begin = 100 s"),
        ({}, {"is_over_frequency": True}, "is a spectrum"),
        ({}, {"y": np.ones(460)}, "does not change"),
        ({}, {"y": np.full(460, np.nan)}, "not numbers"),
    ],
)
def test_records_that_cannot_be_used(released, keys, change, says):
    signal = record(released, 1)[1]
    kept = {"x": signal.x[:460], "y": signal.y[:460], **change}
    with pytest.raises(ScenarioError, match=says) as caught:
        identify_stiffness(load_scenario(case(transient(**keys))), [MeasuredSignal("mass", **kept, unit="m")])
    assert caught.value.problems[0].path == "identify_stiffness.nonlinear.tests[0].file"


def test_a_steady_test_needs_a_sine_and_a_transient_does_not():
    load_scenario(case(transient()))
    with pytest.raises(ScenarioError, match="a harmonic excitation"):
        load_scenario(case(transient(), {"file": "b.csv"}))
    with pytest.raises(ScenarioError, match="absolute_displacement"):
        load_scenario(case(transient(quantity="absolute_displacement")))
    with pytest.raises(ScenarioError, match="give kind: steady"):
        load_scenario(case({"kind": "decay", "file": "a.csv"}))


def test_estimates_and_intervals_are_those_of_least_squares_to_first_order(released):
    """Noise, an unknown begin, another zero and a wrong gain that is fitted: the same from derivatives by integration.

    Least squares of a model that is nearly linear have intervals that hold the truth as often as they say.
    """
    begun, signal = record(released, 1)
    test = transient(begin="2.5 s", duration="15 s")
    found = identify_stiffness(load_scenario(case(test, start=RELEASED, estimate=(*TRUTH, GAIN))), [signal])
    (test,) = fitted_tests(found, "sample")
    late = np.maximum(test.sample_time + 2.5 - begun, 0.0)  # since the release

    def displacement_and_velocity(**changed):
        after = motion(np.append(0.0, late[late > 0.0]), (2.0, 0.0), numbers=TRUTH | changed)[:, 1:]
        before = np.count_nonzero(late == 0.0)
        return np.hstack([np.tile([[2.0], [0.0]], before), after])

    x, v = displacement_and_velocity()
    columns = []
    for name, value in TRUTH.items():
        up, down = (displacement_and_velocity(**{name: value * (1.0 + h)})[0] for h in (1e-4, -1e-4))
        columns.append(1.1 * (up - down) / (2e-4 * value))
    by = np.column_stack([*columns, x, 1.1 * v, np.ones(x.size)])  # the gain, the begin and the zero as well
    covariance = np.linalg.inv(by.T @ by)
    moved = covariance @ by.T @ (test.sample_measured - 1.1 * x - 0.7)
    deviation = test.noise * np.sqrt(np.diag(covariance))
    for k, p in enumerate(estimates(found, "nonlinear")):
        assert p.value == pytest.approx((TRUTH | {GAIN: 1.1})[p.parameter] + moved[k], abs=0.1 * deviation[k])
        assert p.standard_deviation == pytest.approx(deviation[k], rel=0.03)
        assert np.diff(p.interval) == pytest.approx(2 * 1.96 * deviation[k], rel=0.03)
    assert test.delay_s == pytest.approx(2.5 - begun + moved[4], abs=0.1 * deviation[4])
    assert np.diff(test.delay_interval) == pytest.approx(2 * 1.96 * deviation[4], rel=0.03)


def test_sweeps_up_and_down_with_their_jumps():
    """The record of a sweep is a transient, exact at any rate and over jumps; both directions together."""
    tests, signals = [], []
    for first, last in ((0.12, 0.3), (0.3, 0.12)):
        rate, times = 0.0024 * np.sign(last - first), np.arange(0.0, 75.0, 0.2)
        x = motion(times, force=lambda t, f=first, r=rate: np.sin(2 * np.pi * (f * t + 0.5 * r * t**2)))[0]
        y = 1.1 * x + 0.4 + 0.02 * np.abs(x).max() * np.random.default_rng(len(tests)).standard_normal(x.size)
        swept = {"kind": "swept_sine", "applied_to": {"mass": 1}, "from": first, "to": last, "rate": "0.0024 Hz/s"}
        name = "up" if last > first else "down"
        tests.append(transient(name=name, excitation=swept | {"level": 1.0}, phase="of_excitation"))
        signals.append(MeasuredSignal("mass", times, y, unit="m"))
    scenario = load_scenario(case(*tests, estimate=(*TRUTH, "identify_stiffness.nonlinear.tests[*].gain")))
    result = identify_stiffness(scenario, signals)
    holds(result, TRUTH | {"identify_stiffness.nonlinear.tests[*].gain": 1.1})
    assert not result.warnings
    assert [test.name for test in fitted_tests(result, "sample")] == ["up", "down"]


@pytest.mark.parametrize(
    ("keys", "path"),
    [
        ({"excitation": {"kind": "sampled", "applied_to": {"mass": 1}, "file": "no.csv"}}, "tests[0].excitation.file"),
        ({"start": {"mode": 3, "amplitude": 1.0}}, "tests[0].start.mode"),
    ],
)
def test_what_is_wrong_with_a_test_is_said_of_its_keys(keys, path):
    times = np.arange(100.0)
    signals = [MeasuredSignal("mass", times, np.sin(times), unit="m")]
    with pytest.raises(ScenarioError) as caught:
        identify_stiffness(load_scenario(case(transient(**keys))), signals)
    assert caught.value.problems[0].path == f"identify_stiffness.nonlinear.{path}"


def test_a_tests_own_start_and_level_are_of_any_quantity():
    """A displaced start was refused: "is a level of 0, and the excitation is of acceleration"."""
    base = {"kind": "harmonic", "applied_to": "base", "level": "1 g", "frequency": "24 Hz"}
    pulse = {"kind": "half_sine", "applied_to": {"mass": 1}, "level": "20 N", "duration": "10 ms"}
    own = [transient(start={"displacement": ["-4 mm"]}), transient(excitation=pulse)]
    given = load_scenario(case(*own, excitation=base)).identify_stiffness.nonlinear.tests
    assert given[0].start.displacement == (-4e-3,)
    assert given[1].excitation.level == 20.0


@pytest.mark.parametrize("filtered", [{"high_pass": 0.12}, {"remove": "trend"}])
@pytest.mark.parametrize("begin", [0.0, 3.0])
def test_what_is_done_to_a_record_is_done_to_the_motion_as_well(filtered, begin):
    """Displacement of a released mass beside a drift of its sensor, through a filter near its 0.16 Hz: exact values.

    Of the record alone, the filter took away a part of the motion, and the estimates were wrong by several percent.
    """
    times = np.arange(SAMPLES) * STEP
    y = np.concatenate([np.full(int(begin / STEP), 2.0), motion(times, (2.0, 0.0))[0]])
    drift = 0.02 * np.arange(y.size) * STEP if "remove" in filtered else 0.0
    signal = MeasuredSignal("mass", np.arange(y.size) * STEP, y + drift, unit="m")
    test = transient(start=RELEASED, begin=begin, phase="of_excitation", **filtered)
    result = identify_stiffness(load_scenario(case(test)), [signal])
    for estimate in estimates(result, "nonlinear"):
        assert estimate.value == pytest.approx(TRUTH[estimate.parameter], rel=1e-4)
    (treatment,) = result["tests"]["treatment"].values
    assert "removed" in treatment
