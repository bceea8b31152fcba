"""The shipped earthquake against matrices assembled here, in absolute coordinates; stops that move."""

import numpy as np
import pytest
from independent import free_beam
from scipy.integrate import simpson
from scipy.interpolate import CubicSpline
from scipy.linalg import eigh, expm
from scipy.optimize import brentq
from scipy.signal import lsim
from shipped import config_path

import beamsim
from beamsim.scenario import load_scenario

FLOORS = config_path("earthquake").parents[1] / "measurements" / "earthquake_floors.csv"
G = 9.80665
STEP = 1.25e-4  # s
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
    t, ground, *floors = np.loadtxt(FLOORS, delimiter=",", skiprows=1).T
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
    return load_scenario(config_path("earthquake"), changes | {"run.srs": None})


@pytest.mark.parametrize("dashpot", [0.0, 300.0])
def test_the_shipped_earthquake_is_that_of_an_independent_integration(dashpot):
    """A base that shakes, two anchors with their records, a stop on one of them: motion, forces and energies."""
    result = beamsim.run(shipped(dashpot=dashpot))
    assert result.summary["contacts"]["bumper"] >= 4
    assert result.summary["energy_error"] < 1e-10
    pipe, force, reaction, velocity, energy = by_hand(4.0, 200e3, dashpot, 1.5e-3)
    near = {"rtol": 0, "atol": 1e-6}
    found = (
        result["histories"]["displacement"].sel(probe="pipe").values,
        result["histories"]["snubber_force"].sel(snubber="bumper").values,
    )
    np.testing.assert_allclose(found[0], pipe, rtol=0, atol=1e-6 * np.abs(pipe).max())
    np.testing.assert_allclose(found[1] / force.max(), force / force.max(), rtol=0, atol=2e-5)
    left, right = (
        np.asarray(result["histories"]["output_value"].sel(output=f"{name} anchor").values)
        for name in ("left", "right")
    )
    np.testing.assert_allclose(
        np.transpose([left, right]) / np.abs(reaction).max(), reaction / np.abs(reaction).max(), **near
    )
    power = (left + found[1]) * velocity[0] + right * velocity[1]  # the bracket carries the bumper
    within = 3e-4 if dashpot else 1e-5  # a force that jumps between two samples
    assert simpson(power, x=result["histories"]["time"].values) == pytest.approx(energy, rel=within)


@pytest.mark.parametrize("modes", [37, 38])
def test_stresses_do_not_depend_on_which_of_the_highest_modes_are_kept(modes):
    """Of 39. Beside 38 modes there is one static vector for three loads, which had the moments of one: 10 GPa."""

    def stress(modes):
        changes = {"beam.elements": 20, "reduction.modes": modes, "run.duration": "1 s", "run.convergence": "off"}
        case = load_scenario(config_path("earthquake"), changes)
        return beamsim.run(case).summary["largest_bending_stress_pa"]

    assert stress(modes) == pytest.approx(stress(10), rel=2e-3)


def test_a_stop_moves_with_its_support_as_it_does_by_the_same_signal():
    """Mounted on the anchor, or on the base and moved by the anchor's record."""
    mounted = beamsim.run(shipped())
    entries = mounted.scenario.excitation.model_dump(by_alias=True, exclude_unset=True)["forces"]
    entries = [{**entry, "file": str(FLOORS)} for entry in entries]
    moved = {**entries[1], "applied_to": {"snubber": "bumper"}}
    changes = {"snubbers[0].mounted_on": "base", "excitation.forces": [*entries, moved]}
    alone = beamsim.run(shipped(**changes))
    np.testing.assert_allclose(
        alone["histories"]["snubber_force"].sel(snubber="bumper").values,
        mounted["histories"]["snubber_force"].sel(snubber="bumper").values,
        rtol=0,
        atol=1e-6,
    )
    np.testing.assert_allclose(
        alone["histories"]["output_value"].sel(output="left anchor").values,
        mounted["histories"]["output_value"].sel(output="left anchor").values,
        rtol=0,
        atol=1e-6,
    )
    assert alone.summary["energy_error"] < 1e-10
    resting = beamsim.run(shipped(**{"snubbers[0].mounted_on": "base"}))
    assert (
        np.abs(
            resting["histories"]["snubber_force"].sel(snubber="bumper").values
            - mounted["histories"]["snubber_force"].sel(snubber="bumper").values
        ).max()
        > 10.0
    )


def oscillators(frequency, quality, acceleration, duration):
    """Largest absolute acceleration of oscillators on what moves with an acceleration of time, at rest after it."""
    t = np.arange(0.0, duration + 1.0 / frequency[0], 3e-3 / frequency[-1])
    moved = np.where(t <= duration, acceleration(np.minimum(t, duration)), 0.0)
    found = []
    for omega in 2 * np.pi * frequency:
        filtered = [omega / quality, omega**2], [1.0, omega / quality, omega**2]
        found.append(np.abs(lsim(filtered, moved, t)[1]).max())
    return np.array(found)


def test_anchors_have_response_spectra_of_their_absolute_motion():
    """The base's acceleration and the record of the floor together, by SciPy's simulation of each oscillator."""
    asked = {"quality": 10, "from": 1.0, "to": 32.0, "per_octave": 1}
    entries = shipped().excitation.model_dump(by_alias=True, exclude_unset=True)["forces"]
    ground, left, right = ({**entry, "file": str(FLOORS)} for entry in entries)
    curve = [["1 Hz", "3 g"], ["32 Hz", "2 g"]]
    scenario = shipped(**{"excitation.forces": [ground, left, right]}).model_copy(update={"run": None})
    scenario = load_scenario(
        scenario.to_yaml(), {"run": {"duration": 4.0, "start": "rest", "convergence": "off", "srs": asked},
                             "limits": {"srs": {"support left": curve}}},
    )  # fmt: skip
    result = beamsim.run(scenario)
    spectra = dict(zip(result["srs"]["name"].values, result["srs"]["maximax"].values, strict=True))
    assert list(spectra) == ["input", "support left", "support right", "pipe"]
    _, anchors = held_motion()
    for k, name in enumerate(("support left", "support right")):
        expected = oscillators(result["srs"]["frequency_hz"].values, 10.0, lambda t, k=k: anchors(2, t)[k], 4.0)
        np.testing.assert_allclose(spectra[name], expected, rtol=2e-4)
    over = spectra["support left"] / (G * np.geomspace(3.0, 2.0, 6))
    limit = result.summary["margins"]["srs.support left"]
    assert limit["value"] == pytest.approx(over.max(), rel=1e-9)
    assert limit["verdict"] == ("exceeded" if over.max() > 1.0 else "ok")


@pytest.mark.parametrize(("axis", "levers"), [(None, (1.0, 1.0)), ("ry", (0.0, -1.2))])
def test_supports_follow_a_base_that_moves_or_turns(axis, levers):
    """The base carries an end by its distance from the axis, and the end moves by its own record beside that."""
    pulse = {"kind": "half_sine", "duration": "20 ms"}
    base = {"level": "30 rad/s^2", "direction": axis} if axis else {"level": "3 g"}
    own = {"applied_to": {"support": "right"}, "level": "2 g", "time": "10 ms"}
    scenario = load_scenario(
        {
            "beam": {"length": 1.2, "bending_stiffness": 2967.0, "mass_per_length": 2.4,
                     "supports": {"left": "pinned", "right": "pinned"}, "damping": {"kind": "modal", "ratio": 0.02}},
            "excitation": {"kind": "forces", "forces": [
                {**pulse, "applied_to": "base", **base}, {**pulse, **own},
                {**pulse, **own, "applied_to": {"support": "left"}, "level": 0.0},
            ]},
            "probes": [{"name": "middle", "position": 0.6}],
            "reduction": {"modes": 4},
            "run": {"duration": 0.05, "convergence": "off", "srs": {"from": 10.0, "to": 160.0, "per_octave": 1}},
        }
    )  # fmt: skip
    result = beamsim.run(scenario)
    frequency, size = result["srs"]["frequency_hz"].values, 30.0 if axis else 3 * G
    for name, lever, more in (("left", levers[0], 0.0), ("right", levers[1], 2 * G)):

        def moved(t, lever=lever, more=more):
            first, second = (np.where((t >= at) & (t <= at + 0.02), np.sin(np.pi * (t - at) / 0.02), 0.0)
                             for at in (0.0, 0.01))  # fmt: skip
            return lever * size * first + more * second

        (found,) = result["srs"]["maximax"].values[result["srs"]["name"].values == f"support {name}"]
        np.testing.assert_allclose(found, oscillators(frequency, 10.0, moved, 0.05), rtol=1e-4, atol=1e-9)
