"""Motions under inputs whose pieces differ widely in length, against Duhamel's integral to round-off."""

from fractions import Fraction

import numpy as np
import pytest
from sampling import first_apart

import beamsim
from beamsim.contacts.contacts import Contacts
from beamsim.contacts.laws import kelvin_voigt
from beamsim.flow.exact import ExactFlow
from beamsim.inputs.signal import Signal
from beamsim.system.equations import Forcing, PiecewiseLinearSystem

DAMPING = 0.02


def duhamel(force, cuts, mass, frequency, time):
    """Displacement from rest: Gauss-Legendre quadrature on every interval between cuts, (nt,)."""
    node, weight = np.polynomial.legendre.leggauss(24)
    omega = 2 * np.pi * frequency
    decay, damped = DAMPING * omega, omega * np.sqrt(1 - DAMPING**2)
    out = []
    for t in time:
        ends = np.concatenate([cuts[cuts < t], [t]])
        half = 0.5 * np.diff(ends)[:, None]
        s = ends[:-1, None] + half * (1 + node)
        answer = np.exp(-decay * (t - s)) * np.sin(damped * (t - s)) / (mass * damped)
        out.append(np.sum(half * weight * answer * force(s)))
    return np.array(out)


def run(excitation, frequency, duration):
    scenario = beamsim.Scenario.model_validate({
        "chain": {
            "masses": [2.0], "springs": [2.0 * (2 * np.pi * frequency) ** 2],
            "damping": {"kind": "modal", "ratio": DAMPING},
        },
        "excitation": excitation,
        "run": {"duration": duration, "sample_rate": 40 / duration, "convergence": "off"},
        "probes": [{"name": "mass", "mass": 1}],
    })  # fmt: skip
    result = beamsim.run(scenario)
    return result["histories"]["time"].values, result["histories"]["displacement"].sel(probe="mass").values


@first_apart("natural", 2, [2.0, 25.0, 10.0, 60.0])
@pytest.mark.parametrize("last", [42.0, 400.0])
def test_swept_sine_far_above_the_mode(natural, last):
    """An input's powers of time meet modes much slower than they are: nothing cancels."""
    first, rate = 5.0, (last - 5.0) / 1.5
    time, x = run(
        {"kind": "swept_sine", "applied_to": {"mass": 1}, "level": 30.0, "from": first, "to": last,
         "rate": f"{rate!r} Hz/s"}, natural, 1.5,
    )  # fmt: skip
    expected = duhamel(
        lambda s: 30.0 * np.sin(2 * np.pi * (first * s + 0.5 * rate * s**2)),
        np.linspace(0, 1.5, 2400), 2.0, natural, time,
    )  # fmt: skip
    assert np.abs(x - expected).max() < 1e-12 * np.abs(expected).max()


@pytest.mark.parametrize("ratio", [0.0, 0.1, 2.0])
def test_equilibrium_on_a_stop_of_any_stiffness_is_at_rest(ratio):
    """The load of a stiff stop's gap is millions of times what slow motions feel of it.

    What rounding of the stop's position can do is 2e-16 times the ratio of stiffnesses, 2.7e7.
    """
    scenario = beamsim.Scenario.model_validate({
        "chain": {
            "masses": [1.56, 0.38, 1.22], "springs": [730.0, 5370.0, 740.0],
            "damping": {"kind": "modal", "ratio": 0.05},
            "snubbers": [{
                "name": "stop", "mass": 2, "side": "below", "stiffness": 2e10, "gap": "1 mm",
                **({"damping": {"kind": "ratio", "ratio": ratio}} if ratio else {}),
            }],
        },
        "gravity": 9.81,
        "run": {"start": "static_equilibrium", "duration": 0.3, "sample_rate": 200, "convergence": "off"},
        "probes": [{"name": "mass", "mass": 1}],
    })  # fmt: skip
    result = beamsim.run(scenario)
    displacement = result["histories"]["displacement"].sel(probe="mass").values
    assert result["events"]["time"].values.size == 0
    assert result["histories"]["snubber_force"].sel(snubber="stop").values.min() > 1.0
    assert np.abs(displacement - displacement[0]).max() < 1e-8 * abs(displacement[0])


def test_a_stiff_stop_between_masses_that_gravity_moves_together():
    """Its force is a small difference of large ones; what is lost there pushed the slow modes."""
    stop = {
        "name": "link", "between": [5, 3], "resists": "approach", "stiffness": 53033740460.79558,
        "gap": -9.915409702155702e-09, "damping": {"kind": "ratio", "ratio": 0.19020905218502934}, "law": "no_tension",
    }  # fmt: skip
    chain = {
        "masses": [0.6296818840284317, 0.45268075352233805, 0.6618679171045614, 0.9592851343838155, 0.756159088471187],
        "springs": [830.8448037585206, 298.4280857985809, 259.6970989173671, 247.42728589203944, 1077.0036948174472],
        "damping": {"kind": "rayleigh", "mass": 0.18160824040422086, "stiffness": 0.0009703172840014648},
        "snubbers": [stop],
    }
    scenario = beamsim.Scenario.model_validate({
        "chain": chain, "gravity": 0.01974283423550074, "probes": [{"name": "m", "mass": 5}],
        "excitation": {"kind": "harmonic", "applied_to": {"mass": 4}, "level": 0.47930797045629864,
                       "frequency": 6.511120080638127, "phase": -0.8736947559221231},
        "run": {"start": "rest", "duration": 0.02, "sample_rate": 2000.0, "convergence": "off"},
    })  # fmt: skip
    result = beamsim.run(scenario)
    assert result["events"]["time"].values.size > 0
    assert result.summary["energy_error"] < 1e-9


def exactly_solved(matrix, right):
    """Solution of equations with fractions."""
    rows = [[*row, value] for row, value in zip(matrix, right, strict=True)]
    for i in range(len(rows)):
        pivot = max(range(i, len(rows)), key=lambda k: abs(rows[k][i]))
        rows[i], rows[pivot] = rows[pivot], rows[i]
        for k in range(len(rows)):
            if k != i:
                factor = rows[k][i] / rows[i][i]
                rows[k] = [a - factor * b for a, b in zip(rows[k], rows[i], strict=True)]
    return [row[-1] / row[i] for i, row in enumerate(rows)]


@pytest.mark.parametrize("dashpot", [0.0, 3.7e9])
def test_what_follows_the_base_by_a_stop_far_stiffer_than_itself(dashpot):
    """The force of the stop's place is 1e9 times what stretches the slow modes; its round-off is no load of theirs.

    The steady motion of three modes in phase and in quadrature with the base, in fractions.
    """
    stiffness, shape, spring, omega = [51.5, 400.8, 1428.5], [0.73, 1.23, 0.25], 4.4e10, 7.9
    contacts = Contacts(np.array([shape]), np.ones(1), np.array([-1.0]), np.ones(1, dtype=bool),
                        (kelvin_voigt(spring, dashpot),))  # fmt: skip
    system = PiecewiseLinearSystem(np.array(stiffness), np.zeros((3, 3)), contacts, np.zeros(3))
    flow = ExactFlow(system, Forcing(np.zeros((1, 3)), (Signal.harmonic(1.0, omega),), (0,)), 0.5)
    state = flow.states[flow.state_index(np.ones(1, dtype=np.int64))]
    found = state.forced_at_start[1, :3]

    k, row = [Fraction(x) for x in stiffness], [Fraction(x) for x in shape]
    s, c, w = Fraction(spring), Fraction(dashpot), Fraction(omega)
    matrix = [[Fraction(0)] * 6 for _ in range(6)]
    for i in range(3):
        matrix[i][i] = matrix[3 + i][3 + i] = k[i] - w * w
        for j in range(3):
            push = row[i] * row[j]
            matrix[i][j] += s * push
            matrix[3 + i][3 + j] += s * push
            matrix[i][3 + j] -= c * w * push
            matrix[3 + i][j] += c * w * push
    exact = exactly_solved(matrix, [-s * r for r in row] + [-c * w * r for r in row])
    exact = np.array([complex(float(a), float(b)) for a, b in zip(exact[:3], exact[3:], strict=True)])
    np.testing.assert_allclose(found, exact, rtol=1e-13)
