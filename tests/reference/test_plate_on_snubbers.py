"""The plate on two corner snubbers against Ritz's method with polynomials: preload, levels that open and close."""

from pathlib import Path

import numpy as np
import pytest
from numpy.polynomial import Legendre, Polynomial
from scipy.linalg import eigh

import beamsim
from beamsim.responses.gapping import contact_levels
from beamsim.scenario import load_scenario
from beamsim.system.build import build_system

CONFIG = Path(__file__).parents[2] / "configs/structures/plate_panel.yaml"
LENGTH, WIDTH, THICKNESS, YOUNG, NU, DENSITY = 0.77, 0.44, 0.005, 70e9, 0.33, 2700.0
SNUBBER, NEAR_GAP, FAR_GAP = 60e3, -0.1e-3, 0.2e-3
STANDARD_GRAVITY = 9.80665


def family(power: int, degree: int, points, weights):
    """Orthonormal polynomials x^power P(x) on [0, 1]: (functions, derivative, points), and their values at 0 and 1."""
    edge = Polynomial([0.0, 1.0]) ** power
    functions = [edge * Legendre.basis(k, domain=[0.0, 1.0]).convert(kind=Polynomial) for k in range(degree)]
    table = np.array([[f.deriv(order)(points) if order else f(points) for order in range(3)] for f in functions])
    ends = np.array([[f(0.0), f(1.0)] for f in functions])
    r = np.linalg.qr((table[:, 0] * np.sqrt(weights)).T)[1]
    inverse = np.linalg.inv(r)
    return np.einsum("kop,kj->jop", table, inverse), np.einsum("ke,kj->je", ends, inverse)


class Panel:
    """Modes of the panel clamped at x = 0, in mass-normalised coordinates."""

    def __init__(self, degree: int = 14) -> None:
        points, weights = np.polynomial.legendre.leggauss(degree + 8)
        points, weights = (points + 1) / 2, weights / 2
        (x, x_ends), (y, y_ends) = (family(power, degree, points, weights) for power in (2, 0))

        def product(of, i, j):
            return np.einsum("ap,bp,p->ab", of[:, i], of[:, j], weights)

        rigidity = YOUNG * THICKNESS**3 / (12 * (1 - NU**2))
        a, b = LENGTH, WIDTH
        stiffness = rigidity * a * b * (
            np.kron(product(x, 2, 2), product(y, 0, 0)) / a**4
            + np.kron(product(x, 0, 0), product(y, 2, 2)) / b**4
            + NU / (a * b) ** 2 * (
                np.kron(product(x, 2, 0), product(y, 0, 2)) + np.kron(product(x, 0, 2), product(y, 2, 0))
            )
            + 2 * (1 - NU) / (a * b) ** 2 * np.kron(product(x, 1, 1), product(y, 1, 1))
        )  # fmt: skip
        mass = DENSITY * THICKNESS * a * b * np.kron(product(x, 0, 0), product(y, 0, 0))
        squares, shapes = eigh(stiffness, mass)
        self.squares = squares
        load = DENSITY * THICKNESS * a * b * np.kron(x[:, 0] @ weights, y[:, 0] @ weights)
        self.inertia = shapes.T @ load
        self.near, self.far = (shapes.T @ np.kron(x_ends[:, 1], y_ends[:, end]) for end in (0, 1))

    def response(self, omega: float):
        """Complex amplitudes at the corners for 1 m/s^2 of the base, near snubber closed, 1 % damping."""
        dynamic = np.diag(self.squares - omega**2 + 0.02j * omega * np.sqrt(self.squares))
        q = np.linalg.solve(dynamic + SNUBBER * np.outer(self.near, self.near), -self.inertia)
        return self.near @ q, self.far @ q


def test_frequencies_preload_and_the_levels_that_open_and_close():
    panel = Panel()
    compliance = (panel.near**2 / panel.squares).sum()
    preload = -NEAR_GAP / (compliance + 1 / SNUBBER)
    near, far = panel.response(2 * np.pi * 9.0)
    deflection = preload * (panel.near * panel.far / panel.squares).sum()  # of the far corner under the preload
    opens, touches = preload / (SNUBBER * abs(near)), (FAR_GAP + deflection) / abs(far)

    finer = ["bodies.panel.elements=[16, 10]", "bodies.panel.grading=2", "reduction.modes=40"]
    scenario = load_scenario(CONFIG, [*finer, "run.duration=0.01 s", "run.convergence=off", "run.sample_rate=2 kHz"])
    result = beamsim.run(scenario)
    frequencies = np.sqrt(panel.squares[:6]) / (2 * np.pi)
    np.testing.assert_allclose(result["modes"]["open_frequencies_hz"].values[:6], frequencies, rtol=5e-4)
    assert result.summary["static_force_n"]["near"] == pytest.approx(preload, rel=3e-4)
    level = result.summary["gapping"]["near"]["share_of_level"] * scenario.excitation.level
    assert level == pytest.approx(opens, rel=5e-4)
    linear = contact_levels(build_system(scenario), np.array([9.0]))["far"]
    assert linear.onset[0] == pytest.approx(touches, rel=5e-4)
    assert np.isnan(linear.predicted_levels[0])  # near opens before
    assert result.summary["gapping"]["far"]["not_predicted"] == "near opens first"
    assert opens / STANDARD_GRAVITY == pytest.approx(0.00914, abs=1e-5)  # as the document states them
    assert touches / STANDARD_GRAVITY == pytest.approx(0.0810, abs=1e-4)
