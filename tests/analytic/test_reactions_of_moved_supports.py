"""Reactions, joint forces, motions and energies while supports move, against full matrices and equal models."""

import numpy as np
import pytest
from independent import Beam
from scipy.linalg import expm

import beamsim
from beamsim.scenario import load_scenario

L, W, H, E, RHO = 0.9, 0.03, 0.004, 70e9, 2700.0
BETA = 2e-5
BEAM = {
    "length": L, "width": W, "thickness": H, "youngs_modulus": E, "density": RHO, "elements": 9,
    "damping": {"kind": "rayleigh", "stiffness": BETA},
}  # fmt: skip
PINNED = {"left": "pinned", "right": "pinned"}
LEFT = {"kind": "harmonic", "applied_to": {"support": "left"}, "level": "1 mm", "frequency": 23.0}
RIGHT = {"kind": "harmonic", "applied_to": {"support": "right"}, "level": "0.5 mm", "frequency": 31.0, "phase": 1.0}
PUSH = {"kind": "harmonic", "applied_to": {"position": 0.4}, "level": 2.0, "frequency": 61.0}
RUN = {"duration": 0.2, "convergence": "off"}


def force(name, **where):
    return {"name": name, "kind": "reaction_force", **where}


def moment(name, **where):
    return {"name": name, "kind": "reaction_moment", **where}


ENERGIES = [{"name": kind, "kind": f"{kind}_energy"} for kind in ("kinetic", "strain")]


def values(scenario):
    result = beamsim.run(scenario)
    return result["histories"]["time"].values, {
        name: np.asarray(output.values) for name, output in result["histories"].by_label("output_value").items()
    }


def agree(one, other, rtol):
    np.testing.assert_allclose(one, other, rtol=0, atol=rtol * np.abs(other).max())


def of_time(derivative, start, times):
    """(nt, n) states of a linear system."""
    return np.array([expm(derivative * t) @ start for t in times])


def test_of_a_beam_against_its_full_matrices():
    """Forces on both moved ends, motion of an end and beside it, and energies with what the ends carry along."""
    outputs = [
        force("left", support="left"), force("right", support="right"), force("base", support="base"), *ENERGIES,
        {"name": "end", "kind": "displacement", "position": L}, {"name": "slope", "kind": "rotation", "position": 0.85},
        {"name": "fast", "kind": "velocity", "position": 0.04}, {"name": "hard", "kind": "acceleration", "position": L},
    ]  # fmt: skip
    time, found = values(load_scenario({
        "beam": {**BEAM, "supports": PINNED}, "excitation": {"kind": "forces", "forces": [PUSH, LEFT, RIGHT]},
        "run": RUN, "reduction": {"modes": "all"}, "outputs": outputs, "probes": [{"name": "p", "position": 0.6}],
    }))  # fmt: skip
    whole = Beam(L, W, H, E, RHO, 9, "free")
    m, k, size = whole.M, whole.K, whole.K.shape[0]
    b = [0, size - 2]
    q = np.setdiff1d(np.arange(size), b)
    kqq, n = k[np.ix_(q, q)], q.size
    static = -np.linalg.solve(kqq, k[np.ix_(q, b)])
    c = np.zeros_like(k)  # of the motion relative to the static shape
    c[np.ix_(q, q)] = BETA * kqq
    c[np.ix_(q, b)] = -BETA * kqq @ static
    c[np.ix_(b, q)] = c[np.ix_(q, b)].T
    c[np.ix_(b, b)] = static.T @ (BETA * kqq) @ static
    a = np.zeros((2 * n + 6, 2 * n + 6))  # with sine and cosine of both ends and of the force
    inverse = np.linalg.inv(m[np.ix_(q, q)])
    a[:n, n : 2 * n] = np.eye(n)
    a[n : 2 * n, :n], a[n : 2 * n, n : 2 * n] = -inverse @ kqq, -inverse @ c[np.ix_(q, q)]
    start = np.zeros(2 * n + 6)
    push = np.zeros((size, 2 * n + 6))
    moved, rate, slope = np.zeros((3, size, 2 * n + 6))  # displacement, velocity and acceleration of all dofs
    for i, (level, hz, phase) in enumerate(((1e-3, 23.0, 0.0), (5e-4, 31.0, 1.0), (2.0, 61.0, 0.0))):
        s, w = 2 * n + 2 * i, 2 * np.pi * hz
        a[s, s + 1], a[s + 1, s] = w, -w
        start[s], start[s + 1] = np.sin(phase), np.cos(phase)
        if i == 2:
            push[:, s] = level * whole.whole_row(0.4)
            a[n : 2 * n, s] = inverse @ push[q, s]
            continue
        moved[b[i], s], rate[b[i], s + 1], slope[b[i], s] = level, level * w, -level * w**2
        a[n : 2 * n, s] = inverse @ (-k[q, b[i]] * level + m[q, b[i]] * level * w**2)
        a[n : 2 * n, s + 1] = inverse @ (-c[q, b[i]] * level * w)
        start[:n] += level * np.sin(phase) * static[:, i]
        start[n : 2 * n] += level * w * np.cos(phase) * static[:, i]
    moved[q, np.arange(n)] = 1.0
    rate[q, np.arange(n, 2 * n)] = 1.0
    slope[q] = a[n : 2 * n]
    every = slice(None, None, max(1, time.size // 30))
    y = of_time(a, start, time[every])
    exerted = y @ (m @ slope + c @ rate + k @ moved - push).T
    agree(found["left"][every], exerted[:, b[0]], 1e-8)
    agree(found["right"][every], exerted[:, b[1]], 1e-8)
    agree(found["base"][every], exerted[:, b].sum(axis=1), 1e-8)
    u, v = y @ moved.T, y @ rate.T
    agree(found["kinetic"][every], 0.5 * np.einsum("ti,ij,tj->t", v, m, v), 1e-8)
    agree(found["strain"][every], 0.5 * np.einsum("ti,ij,tj->t", u, k, u), 1e-8)
    agree(found["end"][every], u[:, b[1]], 1e-9)
    agree(found["fast"][every], v @ whole.whole_row(0.04), 1e-8)
    step = 1e-6
    agree(found["slope"][every], u @ (whole.whole_row(0.85 + step) - whole.whole_row(0.85 - step)) / (2 * step), 1e-6)
    agree(found["hard"][every], y @ slope[b[1]], 1e-9)


def test_of_the_walls_of_a_chain():
    """Springs and dashpots of the walls by themselves, and the energy of all springs."""
    time, found = values(load_scenario({
        "chain": {"masses": [1.0, 2.0], "springs": [300.0, 200.0, 400.0], "dashpots": [0.5, 0.0, 0.3]},
        "excitation": {**RIGHT, "frequency": 3.0}, "run": {"duration": 1.0, "convergence": "off"},
        "outputs": [force("left", support="left"), force("right", support="right"), *ENERGIES] + [
            {"name": f"{kind}{mass}", "kind": kind, "mass": mass} for kind in ("displacement", "velocity")
            for mass in (1, 2)],
    }))  # fmt: skip
    x, y, v, w = (found[name] for name in ("displacement1", "displacement2", "velocity1", "velocity2"))
    wall, rate = (5e-4 * f(6 * np.pi * time + 1.0) for f in (np.sin, np.cos))
    rate *= 6 * np.pi
    agree(found["left"], -300.0 * x - 0.5 * v, 1e-10)
    agree(found["right"], 400.0 * (wall - y) + 0.3 * (rate - w), 1e-10)
    agree(found["strain"], 150.0 * x**2 + 100.0 * (y - x) ** 2 + 200.0 * (wall - y) ** 2, 1e-10)
    agree(found["kinetic"], 0.5 * v**2 + w**2, 1e-10)


def joined(*joints, excitation, outputs, **changed):
    body = {**BEAM, "kind": "beam", "supports": {"left": "free"}, **changed}
    between = lambda at: [{"body": "panel", "position": at}, "base"]  # noqa: E731
    return load_scenario({
        "bodies": {"panel": body}, "run": RUN, "outputs": outputs,
        "joints": [{**joint, "between": between(joint["between"])} for joint in joints], "excitation": excitation,
        "probes": [{"name": "p", "at": {"body": "panel", "position": 0.6 * L}}],
    })  # fmt: skip


@pytest.mark.parametrize("direction", ["z", "slope"])
def test_a_joint_to_the_base_exerts_what_the_support_exerts_that_it_stands_for(direction):
    level = {"level": "1 mm" if direction == "z" else "1 deg"}
    outputs = [{"name": f"joint_{what}", "kind": f"joint_{what}", "joint": "root"} for what in ("force", "moment")]
    excitation = {**LEFT, **level, "applied_to": {"joint": "root", "direction": direction}}
    root = {"name": "root", "kind": "rigid", "between": 0}
    _, one = values(joined(root, excitation=excitation, outputs=[*outputs, *ENERGIES]))
    outputs = [force("joint_force", support="left"), moment("joint_moment", support="left")]
    _, other = values(load_scenario({
        "beam": {**BEAM, "supports": {"left": "clamped"}}, "run": RUN, "outputs": [*outputs, *ENERGIES],
        "excitation": {**LEFT, **level, "applied_to": {"support": "left", "direction": direction}},
        "probes": [{"name": "p", "position": 0.6 * L}],
    }))  # fmt: skip
    for name in other:
        agree(one[name], other[name], 1e-7)


def test_a_hinge_and_a_spring_to_the_base_that_both_move():
    """Against a pinned end and a spring at the other end: what one moves, the other feels."""
    hinge = {"name": "root", "kind": "hinge", "between": 0}
    spring = {"name": "strut", "kind": "spring", "between": L, "stiffness": 3e3, "dashpot": 2.0}
    both = {"kind": "forces", "forces": [{**LEFT, "applied_to": {"joint": "root"}},
                                         {**RIGHT, "applied_to": {"joint": "strut"}}]}  # fmt: skip
    outputs = [{"name": name, "kind": "joint_force", "joint": joint}
               for name, joint in (("left", "root"), ("right", "strut"))]  # fmt: skip
    kinetic = ENERGIES[:1]
    damping = {"kind": "rayleigh", "mass": 3.0}  # which has no part in the spring
    _, one = values(joined(hinge, spring, excitation=both, outputs=[*outputs, *kinetic], damping=damping))
    _, other = values(load_scenario({
        "beam": {**BEAM, "damping": damping,
                 "supports": {"left": "pinned", "right": {"stiffness": 3e3, "dashpot": 2.0}}},
        "excitation": {"kind": "forces", "forces": [LEFT, RIGHT]}, "run": RUN,
        "outputs": [force("left", support="left"), force("right", support="right"), *kinetic],
        "probes": [{"name": "p", "position": 0.6 * L}],
    }))  # fmt: skip
    for name in other:
        agree(one[name], other[name], 1e-8)


def test_a_spring_between_masses_that_moves_acts_as_two_opposite_forces():
    """Its second point by d against the first: k d and -k d. It was refused, though springs could be named."""
    link = {"name": "link", "kind": "linear", "between": [1, 2], "stiffness": 300.0}
    model = {"chain": {"masses": [1.0, 2.0], "springs": [900.0, 0.0, 700.0]}, "springs_between": [link]}
    step = {"kind": "step", "rise": "50 ms"}  # begins at rest
    moved = {**step, "applied_to": {"joint": "link"}, "level": "2 mm"}
    forces = [{**step, "applied_to": {"mass": n}, "level": level} for n, level in ((1, -0.6), (2, 0.6))]
    probes = [{"name": f"m{n}", "mass": n} for n in (1, 2)]
    one, other = (
        beamsim.run(load_scenario({**model, "excitation": given, "probes": probes, "run": RUN}))["histories"][
            "displacement"
        ]
        for given in (moved, {"kind": "forces", "forces": forces})
    )
    for name in ("m1", "m2"):
        agree(one.sel(probe=name).values, other.sel(probe=name).values, 1e-12)
