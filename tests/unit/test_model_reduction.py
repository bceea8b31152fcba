"""What the reduction keeps, how damping lands on it, and what bounds its error."""

import numpy as np
import pytest

from beamsim.scenario import Scenario
from beamsim.system.build import build_system

pytestmark = pytest.mark.quick

BEAM = {"length": 1.0, "width": 0.05, "thickness": 0.01, "youngs_modulus": 70e9, "density": 2700.0, "elements": 20}
STOP = {"position": 1.0, "side": "below", "stiffness": 2e4, "gap": 0.0}
SHAKE = {"kind": "harmonic", "applied_to": "base", "quantity": "acceleration", "level": 10.0, "frequency": 20.0}


def system(beam=None, rate=2e3, duration=1.0, **more):
    run = {"duration": duration, "sample_rate": rate, "start": "rest"}
    return build_system(Scenario.model_validate({"beam": {**BEAM, **(beam or {})}, "run": run, **more}))


def test_default_covers_64_times_the_first_bending_frequency_about():
    s = system(snubbers=[STOP])
    f = s.modes["open_frequencies_hz"].values
    rough = np.pi / 2 * np.sqrt(70e9 * 0.01**2 / 12 / 2700.0)
    assert s.modes["highest_frequency_hz"].item() == pytest.approx(64 * rough)
    kept = s.modes["kept_modes"].item()
    assert f[kept - 1] <= 96 * rough
    every = system(reduction={"modes": "all"}).modes["open_frequencies_hz"].values
    assert every[kept] > 96 * rough
    assert s.modes["static_vectors"].item() == 1


@pytest.mark.parametrize(
    ("rate", "duration"), [(50.0, 1.0), (1e5, 1.0), (1e4, 0.01), (2e3, 50.0), (None, 0.01), (None, 50.0)]
)
def test_the_output_has_no_part_in_the_model(rate, duration):
    modes, expected = (s.modes for s in (system(rate=rate, duration=duration), system()))
    assert modes["kept_modes"].item() == expected["kept_modes"].item()
    assert modes["highest_frequency_hz"].item() == expected["highest_frequency_hz"].item()


def test_without_a_run_the_default_keeps_six_flexible_modes():
    def of(supports):
        return build_system(Scenario.model_validate({"beam": {**BEAM, "supports": supports}}))

    s = of({"left": "clamped"})
    assert s.modes["kept_modes"].item() == 6
    assert s.modes["highest_frequency_hz"].item() == pytest.approx(s.modes["open_frequencies_hz"].values[5] / 1.5)
    assert of({"left": "free", "right": "free"}).modes["kept_modes"].item() == 8


def test_explicit_choices():
    assert system(reduction={"modes": 3}).modes["kept_modes"].item() == 3
    assert system(reduction={"modes": 1000}).modes["kept_modes"].item() == 40
    s = system(reduction={"modes": "all"}, snubbers=[STOP])
    assert (s.modes["kept_modes"].item(), s.modes["static_vectors"].item(), s.modes["reduction_bound"].item()) == (
        40,
        0,
        0.0,
    )
    by_frequency = system(reduction={"highest_frequency": 500.0})
    f = system(reduction={"modes": "all"}).modes["open_frequencies_hz"].values
    assert by_frequency.modes["kept_modes"].item() == np.sum(f <= 750.0)
    assert by_frequency.modes["highest_frequency_hz"].item() == pytest.approx(500.0)


def test_rigid_body_modes_are_never_left_out():
    s = system({"supports": {"left": "free", "right": "free"}}, reduction={"modes": 1})
    assert s.modes["kept_modes"].item() == 2
    assert s.dynamics.stiffness.tolist() == [0.0, 0.0]


def test_a_static_vector_for_every_kind_of_load():
    everything = {
        "snubbers": [STOP, {**STOP, "position": 0.5}],
        "constant_forces": [{"position": 0.3, "force": 1.0}],
        "excitation": {"kind": "harmonic", "applied_to": {"position": 0.7}, "level": 1.0, "frequency": 9.0},
        "gravity": 9.81,
    }
    assert system(reduction={"modes": 3}, **everything).modes["static_vectors"].item() == 5
    assert system(reduction={"modes": 3}).modes["static_vectors"].item() == 0


def test_modal_damping_list_and_static_vectors():
    s = system({"damping": {"kind": "modal", "ratio": [0.01, 0.03]}}, reduction={"modes": 3}, snubbers=[STOP])
    np.testing.assert_allclose(s.modes["damping_ratios"].values, [0.01, 0.03, 0.03, 0.03])
    expected = np.diag(2 * np.array([0.01, 0.03, 0.03, 0.03]) * np.sqrt(s.dynamics.stiffness))
    np.testing.assert_allclose(s.dynamics.damping, expected)


def test_rigid_body_modes_take_no_modal_damping():
    s = system({"damping": {"kind": "modal", "ratio": 0.02}, "supports": {"left": "pinned", "right": "free"}})
    assert s.dynamics.damping[0, 0] == 0.0
    assert np.isnan(s.modes["damping_ratios"].values[0])
    np.testing.assert_allclose(s.modes["damping_ratios"].values[1:], 0.02)


def test_rayleigh_damping():
    s = system({"damping": {"kind": "rayleigh", "mass": 3.0, "stiffness": 1e-5}}, snubbers=[STOP])
    np.testing.assert_allclose(s.dynamics.damping, np.diag(3.0 + 1e-5 * s.dynamics.stiffness))


def test_point_masses_take_no_viscous_damping():
    mass = 0.5
    s = system(
        {
            "damping": {"kind": "viscous", "coefficient": 2.0},
            "point_masses": [{"position": 1.0, "mass": mass}],
        },
        probes=[{"name": "tip", "position": 1.0}],
    )
    line, tip = 2700 * 0.05 * 0.01, s.probes[0].shape
    # M = rho S int + m phi phi^T = I, so xi int = xi / (rho S) (I - m phi phi^T).
    expected = 2.0 / line * (np.eye(tip.size) - mass * np.outer(tip, tip))
    np.testing.assert_allclose(s.dynamics.damping, expected, atol=1e-8)
    np.testing.assert_array_equal(s.dynamics.damping, s.dynamics.damping.T)


def test_the_bound_survives_an_excitation_on_a_resonance():
    f = system(reduction={"modes": "all"}).modes["open_frequencies_hz"].values[0]
    s = system(
        {"damping": {"kind": "modal", "ratio": 0.0}},
        reduction={"modes": 4},
        snubbers=[STOP],
        excitation={**SHAKE, "frequency": float(f)},
    )
    assert 0 < s.modes["reduction_bound"].item() < 1e-2


def test_the_bound_covers_an_excitation_above_the_frequencies_that_the_reduction_was_made_for():
    f = system(reduction={"modes": "all"}).modes["open_frequencies_hz"].values
    below, between, above = (
        system(reduction={"modes": 2}, snubbers=[STOP], excitation={**SHAKE, "frequency": float(at)})
        for at in (0.5 * f[1], 0.9 * f[2], 1.1 * f[2])
    )
    assert below.modes["highest_frequency_hz"].item() == pytest.approx(f[1] / 1.5)
    assert below.modes["reduction_bound"].item() < 0.1 * between.modes["reduction_bound"].item()
    assert above.modes["reduction_bound"].item() == np.inf
    assert any("may not be accurate" in text for text in above.warnings)
