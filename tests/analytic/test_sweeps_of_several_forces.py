"""Sweeps, continuations and harmonic balance under several forces and supports that move, each with its own phase."""

import numpy as np
import pytest

import beamsim
from beamsim.analyses.sweep.analysis import sweep as sweep_alone
from beamsim.results.branch import harmonics_of
from beamsim.scenario import load_scenario
from tests.helpers.branches import long_steps, peaks_of
from tests.helpers.independent import Beam

L, W, H, E, RHO, BETA = 0.9, 0.03, 0.004, 70e9, 2700.0, 3e-3
BEAM = {
    "length": L, "width": W, "thickness": H, "youngs_modulus": E, "density": RHO, "elements": 9,
    "damping": {"kind": "rayleigh", "stiffness": BETA},
}  # fmt: skip
PINNED = {"left": "pinned", "right": "pinned"}
FORCE = {"kind": "harmonic", "applied_to": {"position": 0.3}, "level": 4.0, "frequency": 25.0, "phase": "40 deg"}
LINE = {"kind": "harmonic", "applied_to": {"line": "whole"}, "level": 3.0, "frequency": 25.0, "phase": "130 deg"}
LEFT = {"kind": "harmonic", "applied_to": {"support": "left"}, "level": "0.5 mm", "frequency": 25.0, "phase": 0.4}
RIGHT = {"kind": "harmonic", "applied_to": {"support": "right"}, "level": "5 m/s^2", "frequency": 25.0, "phase": 2.0}
STOP = {"name": "s", "position": 0.6, "side": "below", "stiffness": 500.0, "gap": 2e-4,
        "damping": {"kind": "viscous", "coefficient": 0.0}}  # fmt: skip
STEPPED = {"kind": "stepped", "from": 24.0, "to": 25.0, "points": 3, "steady_to": 1e-11}
CONTINUED = {"kind": "continuation", "from": 24.0, "to": 25.0, "points_at": [25.0], "side_branches": "none"}


def case(*forces, sweep=None, excitation=None, supports=PINNED, **more):
    return load_scenario(
        {
            "beam": {**BEAM, "supports": supports},
            "excitation": excitation or {"kind": "forces", "forces": list(forces)},
            "probes": [{"name": "p", "position": 0.6}],
            "reduction": {"modes": "all"},
            **({} if sweep is None else {"sweep": sweep}),
            **more,
        }
    )


def receptances(hz, *forces):
    """(F,) steady motion of the probe, by matrices of its own: the forces and supports of this file."""
    whole = Beam(L, W, H, E, RHO, 9, "free")
    held = [0, 18]
    free = np.setdiff1d(np.arange(20), held)
    m, k = whole.M, whole.K
    # consistent load of a uniform force per length
    h = L / 9
    line = np.zeros(20)
    for e in range(9):
        line[2 * e : 2 * e + 4] += h * np.array([0.5, h / 12, 0.5, -h / 12])
    out = []
    for f in hz:
        w = 2 * np.pi * f
        z = k - w**2 * m + 1j * w * BETA * k
        load = np.zeros(free.size, dtype=complex)
        moved = np.zeros(2, dtype=complex)
        for force in forces:
            phase = np.deg2rad(float(force["phase"].split()[0])) if isinstance(force["phase"], str) else force["phase"]
            turned = np.exp(1j * phase)
            if force is FORCE:
                load += 4.0 * turned * whole.whole_row(0.3)[free]
            elif force is LINE:
                load += 3.0 * turned * line[free]
            elif force is LEFT:
                moved[0] = 5e-4 * turned
            else:
                moved[1] = -5.0 / w**2 * turned
        load -= z[np.ix_(free, held)] @ moved
        q = np.linalg.solve(z[np.ix_(free, free)], load)
        out.append(whole.whole_row(0.6)[free] @ q)
    return np.array(out)


@pytest.mark.parametrize("forces", [(FORCE, LINE), (LEFT, RIGHT), (FORCE, LEFT, RIGHT)])
def test_the_linear_response_is_that_of_independent_matrices(forces):
    """The forces' phases count, each its own; supports follow levels of displacement and of acceleration."""
    result = sweep_alone(case(*forces, sweep={**STEPPED, "from": 5.0, "to": 60.0, "points": 5}))
    linear, curve = result["linear"].sel(probe="p"), result.curves["up_0"]
    response = linear["displacement_real"].values + 1j * linear["displacement_imag"].values
    stepped = 1j * curve.channel("displacement", "p").harmonics[list(curve.orders).index(1.0)]  # over a sine
    for hz, of in (
        (linear["frequency_hz"].values[::97], response[::97]),
        (curve.frequency_hz, stepped),
    ):
        expected = receptances(hz, *forces)
        np.testing.assert_allclose(of, expected, rtol=0, atol=1e-7 * np.abs(expected).max())
    with long_steps():
        followed = beamsim.continuation(case(*forces, sweep={**CONTINUED, "from": 20.0, "to": 30.0}))
    branch = followed.branches[0]
    expected = np.abs(receptances(branch["frequency_hz"].values, *forces))
    np.testing.assert_allclose(peaks_of(branch, "p"), expected, rtol=0, atol=1e-7 * expected.max())


@pytest.mark.parametrize("forces", [(FORCE, LINE), (LEFT, RIGHT)])
def test_stepped_sine_continuation_and_balance_meet_the_settled_run(forces):
    """With a stop that closes: three methods against the run, which knows each force by its own signal."""
    stop = {"snubbers": [STOP]}
    settled = beamsim.run(case(*forces, run={"duration": 6.0, "sample_rate": 25.0 * 512, "convergence": "off"}, **stop))
    assert settled.summary["contacts"]["s"] >= 30
    x = settled["histories"]["displacement"].sel(probe="p").values[-513:-1]
    first = 2 * np.fft.rfft(x)[1] / x.size
    stepped = sweep_alone(case(*forces, sweep=STEPPED, **stop)).curves["up_0"]
    of = stepped.channel("displacement", "p").harmonics[list(stepped.orders).index(1.0), -1]
    assert abs(of - first) < 1e-6 * abs(first)
    for method in ({"kind": "shooting"}, {"kind": "harmonic_balance", "harmonics": 63}):
        with long_steps():
            followed = beamsim.continuation(case(*forces, sweep={**CONTINUED, "method": method}, **stop))
        branch = followed.branches[0]
        k = int(np.argmin(np.abs(branch["frequency_hz"].values - 25.0)))
        assert abs(branch["frequency_hz"].values[k] - 25.0) < 1e-9
        assert peaks_of(branch, "p")[k] == pytest.approx(np.abs(x).max(), rel=2e-4)
        assert np.abs(harmonics_of(branch)["p"][k, 1]) == pytest.approx(abs(first), rel=1e-4)
