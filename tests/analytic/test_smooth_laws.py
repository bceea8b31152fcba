"""Laws that are not piecewise linear, as tables: Hertz and other powers against closed forms."""

import numpy as np
import pytest
from scipy.special import gamma

import beamsim
from beamsim.contacts.pads import power_curve
from beamsim.errors import ScenarioError

MASS, SPEED, RADIUS, MODULUS = 0.1, 0.3, 0.01, 115e9
HERTZ = {"radius": RADIUS, "modulus": MODULUS, "range": 2e-5}


def impact(smooth, **run):
    stop = {"name": "plate", "mass": 1, "side": "below", "force_deflection": {"smooth": smooth}}
    chain = {"masses": [MASS], "springs": [0.0], "snubbers": [stop]}
    start = {"displacement": [0.0], "velocity": [-SPEED]}
    run = {"duration": 3e-4, "sample_rate": 1e6, "start": start, "impacts": {}} | run
    return beamsim.load_scenario({"chain": chain, "probes": [{"name": "m", "mass": 1}], "run": run})


def closed_form(n, factor):
    """Largest penetration and force of an impact against ``factor delta^n``, and its duration."""
    depth = (0.5 * (n + 1) * MASS * SPEED**2 / factor) ** (1 / (n + 1))
    duration = 2 * depth / SPEED * np.sqrt(np.pi) * gamma(1 + 1 / (n + 1)) / gamma(0.5 + 1 / (n + 1))
    return depth, factor * depth**n, duration


@pytest.mark.parametrize("exponent", [0.5, 0.8, 1.2, 1.5, 3.0, 8.0])
@pytest.mark.parametrize("segments", [1, 3, 20])
def test_errors_of_tables_are_the_largest(exponent, segments):
    curve, force_error, work_error = power_curve(exponent, 2e-3, 50.0, segments)
    x = 2e-3 * np.linspace(0.0, 1.0, 40001) ** 4
    exact = 50.0 * (x / 2e-3) ** exponent
    assert np.abs(curve.at(x) - exact).max() / 50.0 == pytest.approx(force_error, rel=1e-3)
    work = np.trapezoid(curve.at(x), x) / np.trapezoid(exact, x) - 1.0
    assert work == pytest.approx(work_error, abs=1e-5)
    assert force_error < 0.6 / segments**2
    assert np.all(curve.slopes > 0.0)


@pytest.mark.parametrize(
    ("smooth", "exponent", "factor"),
    [
        (HERTZ, 1.5, 4 / 3 * MODULUS * RADIUS**0.5),
        ({"exponent": 2.5, "point": [1e-5, 600.0], "range": 2e-5}, 2.5, 600.0 / 1e-5**2.5),
        ({"exponent": 0.7, "point": [1e-5, 300.0], "range": 3e-5}, 0.7, 300.0 / 1e-5**0.7),
    ],
)
def test_impacts_have_the_closed_form(smooth, exponent, factor):
    result = beamsim.run(impact(smooth | {"segments": 40}, convergence="off"))
    depth, force, duration = closed_form(exponent, factor)
    impacts = result.summary["impacts"]["plate"]
    assert result.summary["min_displacement_m"]["m"] == pytest.approx(-depth, rel=6e-4)
    assert result.summary["peak_force_n"]["plate"] == pytest.approx(force, rel=6e-4)
    assert impacts["mean_contact_time_s"] == pytest.approx(duration, rel=3e-3)
    assert impacts["restitution"] == pytest.approx(1.0, abs=1e-9)
    assert abs(result.summary["energy_error"]) < 1e-12


def test_the_finer_model_has_more_segments():
    """The stated error of the peak force contains the true one, and no contact is missed between segments."""
    result = beamsim.run(impact(HERTZ))
    error = result.summary["convergence"]["peak_force_n"]["plate"]
    force = closed_form(1.5, 4 / 3 * MODULUS * RADIUS**0.5)[1]
    true = abs(result.summary["peak_force_n"]["plate"] / force - 1.0)
    assert 0.8 * true < error < 3.0 * true
    assert result.outcome.trusted
    assert result.summary["convergence_model"]["contact_divergence_s"] is None
    assert any("4 straight lines give the force to 0.71 % of 1371 N" in text for text in result.warnings)


def test_a_motion_beyond_the_range_has_a_warning():
    result = beamsim.run(impact(HERTZ | {"range": 1e-5}, convergence="off"))
    assert any("its table ends at 0.01 mm" in text for text in result.warnings)


@pytest.mark.parametrize(
    ("smooth", "message"),
    [
        (HERTZ | {"segments": 4, "tolerance": 0.1}, "segments and tolerance exclude each other"),
        (HERTZ | {"radius": 0.0}, "must be positive"),
        (HERTZ | {"tolerance": 0.0}, "must be from 1e-05 to 0.1"),
        ({"radius": 0.01, "range": 1e-5}, "modulus is missing"),
        ({"radius": 0.01, "modulus": 1e9}, "range is missing"),
        ({"exponent": 1.0, "point": [1e-5, 1.0], "range": 1e-5}, "exponent = 1 is a spring"),
        ({"exponent": 1.5, "point": [0.0, 1.0], "range": 1e-5}, "point is not on a curve"),
        ({"exponent": 0.1, "point": [1e-5, 1.0], "range": 1e-5}, "must be from 0.5 to 10"),
    ],
)
def test_wrong_laws_are_refused(smooth, message):
    with pytest.raises(ScenarioError, match=message):
        impact(smooth)


def test_a_law_has_one_source():
    with pytest.raises(ScenarioError, match="smooth and fit exclude each other"):
        beamsim.load_scenario(
            {
                "chain": {
                    "masses": [1.0], "springs": [1.0],
                    "snubbers": [
                        {"mass": 1, "side": "below", "force_deflection": {"smooth": HERTZ, "fit": {"segments": 3}}}
                    ],
                },
                "run": {"duration": 1.0},
            }
        )  # fmt: skip
