"""Springs that are plastic in both directions: friction behind a spring, with and without hardening."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import beamsim

FORCE = [0.0, 5.0, 8.0, 7.0, 5.0, 3.0, 2.0, 1.0, 0.0, 0.0, 0.0]  # N, every 0.1 s
TIMES = 0.1 * np.arange(11)


def solved(folder, hardening, factor=1.0):
    file = folder / "force.csv"
    file.write_text(
        "time (s),force (N)\n" + "\n".join(f"{t:.1f},{factor * f}" for t, f in zip(TIMES, FORCE, strict=True))
    )
    column = {"name": "column", "mass": 1, "normal_force": 6.0, "coefficient": 1.0, "stiffness": 5.0}
    case = {
        "chain": {"masses": [0.1], "springs": [hardening], "dashpots": [0.2]},
        "friction": [column],
        "probes": [{"name": "m", "mass": 1}],
        "excitation": {"kind": "sampled", "applied_to": {"mass": 1}, "file": str(file), "interpolation": "linear"},
        "run": {"duration": 1.0, "sample_rate": 1000.0, "convergence": "off", "start": "rest"},
    }
    return beamsim.run(beamsim.load_scenario(case))


def independent(hardening, factor=1.0):
    """Mass 0.1 kg, dashpot 0.2 N s/m, elastic 5 N/m, yield 6 N: the slider moves where the limit would be exceeded."""

    def rates(t, y):
        x, v, spring = y
        yields = abs(spring) >= 6.0 and spring * v > 0.0
        push = factor * np.interp(t, TIMES, FORCE) - 0.2 * v - hardening * x - np.clip(spring, -6.0, 6.0)
        return [v, push / 0.1, 0.0 if yields else 5.0 * v]

    return solve_ivp(rates, (0.0, 1.0), np.zeros(3), "RK45", t_eval=TIMES[1:], rtol=1e-9, atol=1e-11, max_step=2e-4).y[
        0
    ]


def test_elastoplastic_frame_of_clough_and_penzien(tmp_path):
    """The example of Clough and Penzien, Dynamics of Structures; displacements of exact integration."""
    result = solved(tmp_path, 0.0)
    x = result["histories"]["displacement"].values.ravel()[100::100]
    expected = [0.07740, 0.51821, 1.29191, 2.03866, 2.55640, 2.72123, 2.50245, 1.98276, 1.37113, 0.93607]
    np.testing.assert_allclose(x, expected, atol=6e-6)
    assert abs(result.summary["energy_error"]) < 1e-12


@pytest.mark.parametrize("hardening", [0.0, 1.5])
def test_agrees_with_an_independent_integration(tmp_path, hardening):
    x = solved(tmp_path, hardening, 2.0)["histories"]["displacement"].values.ravel()[100::100]
    np.testing.assert_allclose(x, independent(hardening, 2.0), atol=2e-4)
    assert x.max() > 2.0 * 6.0 / 5.0
