"""The shipped earthquake against matrices assembled here, in absolute coordinates; stops that move."""

from pathlib import Path

import numpy as np
import pytest
from independent import free_beam
from scipy.integrate import simpson
from scipy.interpolate import CubicSpline
from scipy.linalg import eigh, expm
from scipy.optimize import brentq

import beamsim
from beamsim.scenario import load_scenario

CONFIGS = Path(__file__).parents[2] / "configs"
G = 9.80665
STEP = 1e-4  # s
LENGTH, ELEMENTS, RATIO = 4.0, 5, 0.02
H = LENGTH / ELEMENTS
OUTER, INNER = 0.0603, 0.0603 - 2 * 0.0036
BENDING = 200e9 * np.pi / 64 * (OUTER**4 - INNER**4)
LINE = 7850.0 * np.pi / 4 * (OUTER**2 - INNER**2)


def shape(x):
    """Deflection at x for a unit of each of (w, w') at all nodes."""
    e = min(int(x / H + 1e-9), ELEMENTS - 1)
    s, row = x / H - e, np.zeros(2 * ELEMENTS + 2)
    row[2 * e : 2 * e + 4] = 1 - 3 * s**2 + 2 * s**3, H * (s - 2 * s**2 + s**3), 3 * s**2 - 2 * s**3, H * (s**3 - s**2)
    return row


def held_motion():
    """Deflections of the ground and, absolute, of both anchors, with their derivatives, of time."""
    t, ground, *floors = np.loadtxt(CONFIGS / "measurements" / "earthquake_floors.csv", delimiter=",", skiprows=1).T
    acceleration = CubicSpline(t, G * ground)
    base = [acceleration.antiderivative(2), acceleration.antiderivative(1), acceleration]
    base += [acceleration.derivative(d) for d in (1, 2, 3)]
    relative = [[of.derivative(d) if d else of for d in range(4)] for of in (CubicSpline(t, 1e-3 * w) for w in floors)]
    return base, lambda d, at: np.array([base[d](at) + (of[d](at) if d < 4 else 0.0) for of in relative])


def by_hand(duration, stiffness, dashpot, gap):
    """Pipe at 2.4 m from the ground, force of the bumper, reactions and velocities of the anchors; an energy balance.

    The pipe moves by x beside the static shape of the anchors. They follow splines, polynomials of the fifth degree
    between two samples: with their derivatives as states the motion in each contact state is a matrix exponential. It
    is stepped, and the step in which contact changes is cut where it does. The balance is the energy at the end, what
    is lost included, less that at the start.
    """
    M, K = free_beam(BENDING, LINE, H, ELEMENTS)
    held, free = np.array([0, 2 * ELEMENTS]), np.setdiff1d(np.arange(2 * ELEMENTS + 2), [0, 1, 2 * ELEMENTS])
    both = np.concatenate([held, free])  # the slope at the clamped end is zero
    m, k = M[np.ix_(free, free)], K[np.ix_(free, free)]
    omega2, phi = eigh(k, m)
    lost = m @ phi @ np.diag(2 * RATIO * np.sqrt(omega2)) @ phi.T @ m
    static = -np.linalg.solve(k, K[np.ix_(free, held)])  # of the anchors: modal damping acts on the rest of the motion
    follows = M[np.ix_(free, held)] + m @ static
    n, row, (base, anchors) = free.size, shape(1.6), held_motion()
    size = 2 * n + 13  # x, x', six derivatives of each anchor, 1
    w = [2 * n + 2 * d + np.arange(2) for d in range(6)]
    apart, rate = np.zeros((2, size))
    for r, d in ((apart, 0), (rate, 1)):
        r[d * n : d * n + n], r[w[d]] = row[free], row[free] @ static + row[held]
        r[w[d][0]] -= 1.0
    force = -stiffness * apart - dashpot * rate
    force[-1] = -stiffness * gap
    flows = []
    for closed in (False, True):
        A = np.zeros((size, size))
        A[:n, n : 2 * n] = np.eye(n)
        A[n : 2 * n, :n], A[n : 2 * n, n : 2 * n], A[n : 2 * n, w[2]] = -k, -lost, -follows
        A[n : 2 * n] += np.outer(row[free], force) * closed
        A[n : 2 * n] = np.linalg.solve(m, A[n : 2 * n])
        for d in range(5):
            A[w[d], w[d + 1]] = 1.0
        flows.append(A)
    whole = [expm(A * STEP) for A in flows]
    z, closed, states, phases = np.zeros(size), False, [], []
    z[-1] = 1.0
    for step in range(round(duration / STEP) + 1):
        if step % round(0.01 / STEP) == 0:  # a sample of the records
            z[2 * n : -1] = np.concatenate([anchors(d, step * STEP + 1e-9) for d in range(6)])
            z[2 * n : 2 * n + 6] = np.concatenate([anchors(d, step * STEP) for d in range(3)])
        states.append(z)
        phases.append(closed)
        left = STEP
        while (
            (after := whole[closed] @ z if left == STEP else expm(flows[closed] * left) @ z) @ apart < -gap
        ) != closed:
            here, A = z, flows[closed]
            cut = brentq(lambda t, here=here, A=A: apart @ expm(A * t) @ here + gap, 0.0, left, xtol=1e-14)
            z, left, closed = expm(A * cut) @ here, left - cut, not closed
        z = after
    z, phases = np.array(states), np.array(phases)
    pushed = phases * (z @ force)
    rates = np.array([flows[int(c)][n : 2 * n] @ x for c, x in zip(phases, z, strict=True)])
    moved = z[:, n : 2 * n]
    reaction = (
        rates @ M[np.ix_(free, held)] + z[:, w[2]] @ (M[np.ix_(held, held)] + static.T @ M[np.ix_(free, held)])
        + z[:, w[0]] @ (K[np.ix_(held, held)] + static.T @ K[np.ix_(free, held)]) + z[:, :n] @ K[np.ix_(free, held)]
        - moved @ lost @ static - np.outer(pushed, row[held])
    )  # fmt: skip
    heat = np.einsum("ti,ij,tj->t", moved, lost, moved) + phases * dashpot * (z @ rate) ** 2
    u, v = (np.hstack([z[:, w[d]], z[:, d * n : d * n + n] + z[:, w[d]] @ static.T]) for d in (0, 1))
    stored = [
        0.5 * (b @ M[np.ix_(both, both)] @ b + a @ K[np.ix_(both, both)] @ a) for a, b in ((u[0], v[0]), (u[-1], v[-1]))
    ]
    squeezed = min(0.0, gap + apart @ z[-1])
    energy = stored[1] - stored[0] + 0.5 * stiffness * squeezed**2 + simpson(heat, dx=STEP)
    pipe = u @ shape(2.4)[both] - base[0](STEP * np.arange(len(z)))
    return pipe, pushed, reaction, z[:, w[1]].T, energy


def shipped(*, dashpot=0.0, **more):
    changes = {
        "beam.elements": ELEMENTS,
        "run.duration": 4.0,
        "run.sample_rate": 1 / STEP,
        "run.convergence": "off",
        **more,
    }
    if dashpot:
        changes["snubbers[0].damping"] = {"kind": "viscous", "coefficient": dashpot}
    return load_scenario(CONFIGS / "earthquake.yaml", changes | {"run.srs": None})


@pytest.mark.parametrize("dashpot", [0.0, 300.0])
def test_the_shipped_earthquake_is_that_of_an_independent_integration(dashpot):
    """A base that shakes, two anchors with their records, a stop on one of them: motion, forces and energies."""
    result = beamsim.run(shipped(dashpot=dashpot))
    assert result.summary["contacts"]["bumper"] >= 4
    assert result.summary["energy_error"] < 1e-10
    pipe, force, reaction, velocity, energy = by_hand(4.0, 200e3, dashpot, 1.5e-3)
    near = {"rtol": 0, "atol": 1e-6}
    found = result.probes["pipe"].displacement, result.snubbers["bumper"].force
    np.testing.assert_allclose(found[0], pipe, rtol=0, atol=1e-6 * np.abs(pipe).max())
    np.testing.assert_allclose(found[1] / force.max(), force / force.max(), rtol=0, atol=2e-5)
    left, right = (np.asarray(result.outputs[f"{name} anchor"].value) for name in ("left", "right"))
    np.testing.assert_allclose(
        np.transpose([left, right]) / np.abs(reaction).max(), reaction / np.abs(reaction).max(), **near
    )
    power = (left + found[1]) * velocity[0] + right * velocity[1]  # the bracket carries the bumper
    within = 3e-4 if dashpot else 1e-5  # a force that jumps between two samples
    assert simpson(power, x=result.time) == pytest.approx(energy, rel=within)


def test_a_stop_moves_with_its_support_as_it_does_by_the_same_signal():
    """Mounted on the anchor, or on the base and moved by the anchor's record."""
    mounted = beamsim.run(shipped())
    entries = mounted.scenario.excitation.model_dump(by_alias=True, exclude_unset=True)["forces"]
    entries = [{**entry, "file": str(CONFIGS / entry["file"])} for entry in entries]
    moved = {**entries[1], "applied_to": {"snubber": "bumper"}}
    changes = {"snubbers[0].mounted_on": "base", "excitation.forces": [*entries, moved]}
    alone = beamsim.run(shipped(**changes))
    np.testing.assert_allclose(alone.snubbers["bumper"].force, mounted.snubbers["bumper"].force, rtol=0, atol=1e-6)
    np.testing.assert_allclose(
        alone.outputs["left anchor"].value, mounted.outputs["left anchor"].value, rtol=0, atol=1e-6
    )
    assert alone.summary["energy_error"] < 1e-10
    resting = beamsim.run(shipped(**{"snubbers[0].mounted_on": "base"}))
    assert np.abs(resting.snubbers["bumper"].force - mounted.snubbers["bumper"].force).max() > 10.0
