"""Several point forces: superposition, static limits, independent integration, energies, errors."""

import numpy as np
from scipy.integrate import solve_ivp

import beamsim
from beamsim.scenario import load_scenario
from beamsim.system.build import build_system

L = 0.8
BEAM = {
    "length": L, "width": 0.04, "thickness": 0.006, "youngs_modulus": 70e9, "density": 2700.0,
    "damping": {"kind": "modal", "ratio": 0.01},
}  # fmt: skip
HARMONIC = {"kind": "harmonic", "applied_to": {"position": 0.3}, "level": 4.0, "frequency": 17.0, "phase": 0.7}
TONES = {
    "kind": "multi_tone",
    "applied_to": {"position": L},
    "tones": [{"level": 1.0, "frequency": 31.0}, {"level": 0.5, "frequency": 90.0, "phase": 1.0}],
}
PULSE = {"kind": "half_sine", "applied_to": {"position": 0.5}, "level": 3.0, "duration": 0.01, "time": 0.05}
STEP = {"kind": "step", "applied_to": {"position": 0.6}, "level": -2.0, "time": 0.02}
FORCES = (HARMONIC, TONES, PULSE, STEP)


def case(excitation, **more):
    return {
        "beam": BEAM,
        "excitation": excitation,
        "probes": [{"name": "p", "position": 0.7}],
        "reduction": {"modes": 6},
        "run": {"duration": 0.2, "sample_rate": 2000.0, "convergence": "off"},
        **more,
    }


def together(*forces):
    return {"kind": "forces", "forces": list(forces)}


def run(excitation, **more):
    return beamsim.run(load_scenario(case(excitation, **more)))


def test_a_single_force_in_the_list_is_that_force():
    stop = {"snubbers": [{"name": "s", "position": L, "side": "below", "stiffness": 2e4, "gap": 2e-4}]}
    one, listed = run(HARMONIC, **stop), run(together(HARMONIC), **stop)
    assert one.summary["contacts"]["s"] >= 2
    assert listed.summary["contacts"] == one.summary["contacts"]
    np.testing.assert_array_equal(
        listed["histories"]["displacement"].sel(probe="p").values,
        one["histories"]["displacement"].sel(probe="p").values,
    )


def test_contact_under_several_forces_against_independent_integration():
    stop = {"name": "s", "position": L, "side": "below", "stiffness": 2e4, "gap": 2e-4}
    scenario = load_scenario(case(together(*FORCES), snubbers=[stop]))
    result, system = beamsim.run(scenario), build_system(scenario)
    assert result.summary["contacts"]["s"] >= 2
    assert result.summary["energy_error"] < 1e-10
    n, shape = system.dynamics.size, system.snubbers[0].shape
    rows = [system.forcing.load[i] for i in range(4)]

    def values(t):
        tones = np.sin(2 * np.pi * 31 * t) + 0.5 * np.sin(2 * np.pi * 90 * t + 1.0)
        pulse = 3.0 * np.sin(np.pi * (t - 0.05) / 0.01) if 0.05 <= t <= 0.06 else 0.0
        return 4.0 * np.sin(2 * np.pi * 17 * t + 0.7), tones, pulse, -2.0 if t >= 0.02 else 0.0

    def rhs(t, y):
        q, v = y[:n], y[n:]
        force = 2e4 * max(-(2e-4 + shape @ q), 0.0)
        load = sum(value * row for value, row in zip(values(t), rows, strict=True))
        return np.concatenate([v, load - system.dynamics.stiffness * q - system.dynamics.damping @ v + force * shape])

    # from break to break of the forces
    y, at = system.initial_state, result["histories"]["time"].values <= 0.06
    expected = np.zeros(0)
    for begin, end in ((0.0, 0.02), (0.02, 0.05), (0.05, 0.06)):
        times = result["histories"]["time"].values[
            (result["histories"]["time"].values >= begin - 1e-12) & (result["histories"]["time"].values < end - 1e-12)
        ]
        solution = solve_ivp(
            rhs, (begin, end - 1e-13), y, method="DOP853", rtol=1e-9, atol=1e-12, t_eval=[*times, end - 1e-13]
        )
        expected = np.append(expected, system.probes[0].shape @ solution.y[:n, :-1])
        y = solution.y[:, -1]
    got = result["histories"]["displacement"].sel(probe="p").values[at][: expected.size]
    np.testing.assert_allclose(got, expected, atol=2e-6 * np.abs(expected).max())
