"""Computations that stop early say why by a code with its numbers, and keep what they have."""

import traceback
from contextvars import copy_context

import numpy as np
import pytest
from shipped import config_path

import beamsim
from beamsim.analyses.sweep.analysis import sweep
from beamsim.errors import ScenarioError
from beamsim.scenario import load_scenario

CHAIN = config_path("chain_bumpers")


def test_a_run_with_too_many_events():
    result = beamsim.run(load_scenario(CHAIN, ["run.max_events=3"]))
    assert result.outcome.code == "event_limit"
    assert result.outcome.place.value == pytest.approx(
        result["histories"]["time"].values[-1], abs=2.0 / result.scenario.sample_rate
    )
    assert "more than 3 contact events" in result.status
    assert result.outcome.remedy.startswith("raise run.max_events")
    assert result.summary["status"] == result.status


def test_a_hopeless_motion_is_refused(monkeypatch):
    """A mass of 1e-24 kg has 1e12 periods in a second, and the gap of its closed stop is evaluated in each."""
    monkeypatch.setattr("beamsim.flow.transient.SPENT", 2000)
    stiff = {
        "chain": {"masses": [1e-24], "springs": [100.0]},
        "snubbers": [{"mass": 1, "side": "above", "stiffness": 100.0, "gap": 0.0}],
        "excitation": {"kind": "harmonic", "applied_to": "base", "level": 1.0, "frequency": 65.0},
        "run": {"duration": 1.0, "sample_rate": 1000.0},
    }
    with pytest.raises(ScenarioError, match=r"run\.duration = 1 s would take about .* evaluations") as refused:
        beamsim.run(load_scenario(stiff))
    assert refused.value.problems[0].remedy.startswith("check stiffnesses")


class During:
    """A request to end that comes when it is asked for in a function for the n-th time."""

    def __init__(self, function, times=1):
        self.function, self.left, self.later = function, times, 0

    def __call__(self):
        if self.left == 0:
            self.later += 1
        elif any(frame.f_code.co_name == self.function for frame, _ in traceback.walk_stack(None)):
            self.left -= 1
        return self.left == 0


SAMPLED = ["run.sample_rate=20 kHz", "run.convergence=off", "run.spectrum=null"]


@pytest.fixture(scope="module")
def undisturbed():
    result = beamsim.run(load_scenario(CHAIN, SAMPLED))
    assert result.complete
    return result


@pytest.fixture
def no_grace(monkeypatch):
    """No time to evaluate what was marched, as if the motion were a very long one."""
    from beamsim.analyses.run import motion
    from beamsim.responses import histories

    for name, value in {"GRACE_S": -1.0, "BEGINNING_S": -1.0, "FEWEST_SEGMENTS": 8}.items():
        monkeypatch.setattr(motion, name, value)
    for name, value in {"FEWEST_SAMPLES": 10, "VALUES_AT_ONCE": 20_000}.items():
        monkeypatch.setattr(histories, name, value)


@pytest.mark.parametrize(
    ("function", "times", "left_out"),
    [
        ("compute", 1, None),
        ("compute", 4, None),
        ("record", 200, "the histories after"),
        ("spectra_of", 20, "the spectra"),
        ("summary_of_run", 1, "the level that changes contact"),
        ("aliased_in_histories", 5, "aliasing"),
    ],
)
def test_a_long_motion_interrupted_anywhere_keeps_a_part_that_is_right(
    function, times, left_out, undisturbed, no_grace
):
    """What is kept is that of a run which ends where the part does, and little is computed after the request."""
    request = During(function, times)
    part = beamsim.run(load_scenario(CHAIN, SAMPLED), stop=request)
    assert part.outcome.interrupted
    assert request.later < 20  # of some 500 times
    count = part["histories"]["time"].values.size
    assert count >= 10
    times, whole_times = (each["histories"]["time"].values for each in (part, undisturbed))
    np.testing.assert_array_equal(times, whole_times[:count])
    for name in part["histories"].labels("probe"):
        whole = undisturbed["histories"]["displacement"].sel(probe=name).values
        np.testing.assert_allclose(
            part["histories"]["displacement"].sel(probe=name).values,
            whole[:count],
            rtol=0,
            atol=1e-9 * np.abs(whole).max(),
        )
    compared = undisturbed
    if left_out is None:  # the motion is cut
        end = part.outcome.place.value
        assert end < undisturbed["histories"]["time"].values[-1]
        compared = beamsim.run(load_scenario(CHAIN, [*SAMPLED, f"run.duration={end!r} s"]))
    else:
        assert part.status.startswith(f"interrupted before {left_out}")
        assert (count < undisturbed["histories"]["time"].values.size) == (function == "record")
    assert part.summary["contacts"] == compared.summary["contacts"]
    for entry in ("peak_displacement_m", "peak_force_n", "contact_share"):
        assert part.summary[entry] == pytest.approx(compared.summary[entry], rel=1e-9)
    assert part.summary["energy_error"] < 1e-9


def test_blocks_end_on_request():
    from beamsim.outcomes import Interrupted, check_stop, never, stop_requests

    check_stop()  # nobody asks
    with stop_requests(lambda: True, at_once=True), pytest.raises(Interrupted):
        check_stop()
    with (
        stop_requests(lambda: True, at_once=True),
        stop_requests(never, at_once=True),
        pytest.raises(Interrupted),
    ):  # of a block around
        check_stop()
    check_stop()


def test_an_integrator_that_fails(monkeypatch):
    import scipy.integrate

    real = scipy.integrate.BDF.step

    def failing(self):
        return "the step became too small" if self.t > 0.1 else real(self)

    monkeypatch.setattr(scipy.integrate.BDF, "step", failing)
    result = beamsim.run(load_scenario(CHAIN, ["run.method=reference"]))
    assert result.outcome.code == "integrator_failed"
    assert "the step became too small" in result.status
    assert result["histories"]["time"].values[-1] == pytest.approx(0.1, rel=0.2)


def test_a_stepped_sweep_that_costs_too_much(monkeypatch):
    from beamsim.orbits.steady import CycleStepper

    def march_cycles(self, motion, cycles, *_, go_on=CycleStepper.march_cycles, **options):
        if self.cycles > 300:
            raise ArithmeticError("too many evaluations")
        return go_on(self, motion, cycles, *_, **options)

    monkeypatch.setattr(CycleStepper, "march_cycles", march_cycles)
    step = "sweep={kind: stepped, from: 78 Hz, to: 84 Hz, points: 4}"
    result = sweep(load_scenario(config_path("sweep_up_down"), [step]))
    assert result.outcome.code == "no_steady_state"
    (curve,) = result.curves.values()
    assert result.outcome.place.value > curve.frequency_hz[-1]
    assert result["levels"]["outcome"].values.tolist() == ["no_steady_state"]


def test_a_fit_with_too_few_evaluations(monkeypatch):
    few = {"identify_stiffness.nonlinear.starts": 1, "identify_stiffness.nonlinear.profiles": False}
    monkeypatch.setattr("beamsim.analyses.identify.fit.MOST_EVALUATIONS", 1)
    path = config_path("identify_nonlinear")
    scenario = load_scenario(path, few)
    result = beamsim.identify_stiffness(scenario, beamsim.read_tests(scenario, path.parent))
    assert result.outcome.code == "fit_limit"
    assert not result.complete
    assert np.isfinite(result["nonlinear"]["value"].values).all()


def test_a_request_is_polled_and_ends_only_the_blocks_that_allow_it():
    from beamsim.outcomes import (
        Interrupted,
        check_stop,
        stop_requested,
        stop_requests,
        until_stop,
    )

    assert not stop_requested()
    with stop_requests(lambda: True):
        assert stop_requested()
        check_stop()
        assert list(until_stop("abc")) == ["a"]
        around = copy_context()
        with stop_requests(at_once=True), pytest.raises(Interrupted):
            check_stop()
    assert around.run(stop_requested)
    assert not stop_requested()


def rosenbrock(at):
    """Residuals of a narrow valley whose least misfit, zero, is at (1, 1)."""
    return np.array([10.0 * (at[1] - at[0] ** 2), 1.0 - at[0]])


@pytest.mark.parametrize("most", [3, 8, 20])
def test_a_fit_that_is_asked_to_stop_within_its_residuals_gives_the_best_so_far(most):
    from beamsim.analyses.identify.fit import Fit, FitParameter
    from beamsim.outcomes import check_stop, stop_requests

    evaluated = []

    def measured(x, beside):
        check_stop()
        evaluated.append(rosenbrock(x))
        return evaluated[-1]

    numbers = [FitParameter(name, ((name,),), (0.0,), (0.0, np.inf), np.nan, shift=1.0) for name in ("a", "b")]
    with stop_requests(lambda: len(evaluated) >= most):
        part = Fit(numbers, measured).minimise(np.array([0.2, 0.9]))
    assert len(evaluated) == most
    assert not part.converged
    assert part.misfit == min(float(each @ each) for each in evaluated)
    np.testing.assert_array_equal(rosenbrock(part.x) @ rosenbrock(part.x), part.misfit)
    whole = Fit(numbers, lambda x, beside: rosenbrock(x)).minimise(np.array([0.2, 0.9]))
    assert whole.converged
    np.testing.assert_allclose(whole.x, 1.0, rtol=0, atol=1e-6)


def test_a_sweep_that_ends_in_its_finer_model_keeps_its_curves():
    """The finer model had not begun its second curve, with whose cycles those of the first were compared."""
    changes = {"sweep.from": "60 Hz", "sweep.to": "64 Hz", "sweep.rate": "60 oct/min", "sweep.levels": [9.81]}
    request = During("_convergence", times=3)
    part = beamsim.sweep(load_scenario(config_path("sweep_up_down"), changes), stop=request)
    assert request.left == 0
    assert part.outcome.interrupted
    assert len(part.curves) == 2
