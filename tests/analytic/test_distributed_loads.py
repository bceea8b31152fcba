"""Force per length of beams and pressure on plates: load vectors, statics, single modes, errors."""

import numpy as np
import pytest
from numpy.polynomial.polynomial import polyval, polyval2d

from beamsim.scenario import load_scenario
from beamsim.structures.assembly import assemble, load_site_in
from beamsim.system.build import build_system

L, W, H, E, RHO = 0.9, 0.03, 0.004, 70e9, 2700.0
EI = E * W * H**3 / 12
BEAM = {
    "length": L, "width": W, "thickness": H, "youngs_modulus": E, "density": RHO, "elements": 7,
    "damping": {"kind": "modal", "ratio": 0.02},
}  # fmt: skip
PLATE = {
    "kind": "plate", "length": 0.5, "width": 0.3, "thickness": 0.002, "youngs_modulus": E, "poissons_ratio": 0.3,
    "density": RHO, "elements": [5, 4],
}  # fmt: skip
FREE = {"left": "free", "right": "free"}
PINNED = {"left": "pinned", "right": "pinned"}


def load(kind="harmonic", **applied_to):
    unit = "N/m" if "line" in applied_to else "Pa"
    signal = {"step": {}, "harmonic": {"frequency": 23.0}}[kind]
    return {"kind": kind, "applied_to": applied_to, "level": f"40 {unit}", **signal}


def case(excitation, *, beam=None, supports=None, plate=None, **more):
    body = {"beam": {**BEAM, "supports": supports or {"left": "clamped"}, **(beam or {})}}
    at = 0.7 * L
    if plate is not None:
        body, at = {"bodies": {"panel": {**PLATE, **plate}}}, [0.25, 0.15]
    return load_scenario(
        {**body, "excitation": excitation, "probes": [{"name": "p", "position": at}], "run": {"duration": 0.2}, **more}
    )


def row(scenario):
    """(N,) load vector of the excitation."""
    return assemble(scenario).row(load_site_in(scenario, scenario.excitation.applied_to))


SHAPES = {
    "uniform": ({"kind": "uniform"}, [1.0]),
    "linear": ({"kind": "linear", "values": [0.5, -2.0]}, [0.5, -2.5]),
    "polynomial": ({"kind": "polynomial", "coefficients": [1, -3, 0, 4, 2]}, [1, -3, 0, 4, 2]),
}


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("line", ["whole", ["20 %", 0.61]])
def test_the_load_vector_of_a_polynomial_is_exact(name, line):
    shape, factors = SHAPES[name]
    scenario = case(load(line=line, shape=shape), supports=FREE)
    structure = assemble(scenario)
    a, b = (0.0, L) if line == "whole" else (0.2 * L, 0.61)
    x, weight = np.polynomial.legendre.leggauss(20)
    x = a + (b - a) * (x + 1) / 2
    p = polyval((x - a) / (b - a), factors)
    for power in range(4):  # cubics are in the space of the elements
        field = np.zeros(structure.size)
        nodes = structure.mesh.nodes * L
        field[0::2] = nodes**power
        field[1::2] = L * (power * nodes ** (power - 1) if power else np.zeros(nodes.size))
        exact = (b - a) / 2 * weight @ (p * x**power)
        assert row(scenario) @ field == pytest.approx(exact, rel=1e-12, abs=1e-14)


def test_the_load_vector_of_a_table_is_that_of_its_straight_pieces():
    table = {"kind": "table", "x": [0.1, 0.37, 0.5], "values": [0.0, 2.0, -1.0]}
    whole = row(case(load(line="whole", shape=table), supports=FREE))
    pieces = [
        row(case(load(line=[0.1, 0.37], shape={"kind": "linear", "values": [0, 2]}), supports=FREE)),
        row(case(load(line=[0.37, 0.5], shape={"kind": "linear", "values": [2, -1]}), supports=FREE)),
    ]
    np.testing.assert_allclose(whole, sum(pieces), rtol=0, atol=1e-14)


def test_the_load_vector_of_a_plate_is_exact():
    coefficients = [[1.0, -2.0, 0.5], [0.0, 3.0, 1.0]]
    area = [[0.11, "10 %"], ["90 %", 0.21]]
    shape = {"kind": "polynomial", "coefficients": coefficients}
    scenario = case(load(area=area, shape=shape), plate={})
    structure = assemble(scenario)
    x, weight = np.polynomial.legendre.leggauss(12)
    (a, c), (b, d) = (0.11, 0.03), (0.45, 0.21)
    s, t = np.meshgrid((x + 1) / 2, (x + 1) / 2, indexing="ij")
    p = polyval2d(s, t, np.array(coefficients))
    nodes = structure.mesh.node_points * (0.5, 0.3)
    for i, j in ((0, 0), (1, 2), (3, 3)):
        field = np.zeros((nodes.shape[0], 4))
        dx = i * nodes[:, 0] ** max(i - 1, 0) * 0.5
        dy = j * nodes[:, 1] ** max(j - 1, 0) * 0.3
        field = np.column_stack(
            [nodes[:, 0] ** i * nodes[:, 1] ** j, nodes[:, 0] ** i * dy, dx * nodes[:, 1] ** j, dx * dy]
        )
        # degrees of freedom are numbered along y, deflection and slope of x first
        nx, ny = structure.mesh.x.nodes.size, structure.mesh.y.nodes.size
        whole = field.reshape(nx, ny, 2, 2).transpose(0, 2, 1, 3).ravel()
        exact = (
            (b - a)
            * (d - c)
            / 4
            * np.einsum("i,j,ij->", weight, weight, p * (a + (b - a) * s) ** i * (c + (d - c) * t) ** j)
        )
        assert row(scenario) @ whole == pytest.approx(exact, rel=1e-12, abs=1e-16)


def static_motion(scenario):
    """The system, and its coordinates under the level of the excitation held for ever."""
    system = build_system(scenario)
    force = 40.0 * system.forcing.load[0]
    return system, force / system.dynamics.stiffness


@pytest.mark.parametrize(
    ("shape", "supports", "deflection", "moment"),
    [
        ({"kind": "uniform"}, {"left": "clamped"}, lambda s: s**2 * (6 - 4 * s + s**2) / 24,
         lambda s: (1 - s) ** 2 / 2),
        ({"kind": "linear", "values": [1, 0]}, {"left": "clamped"},
         lambda s: s**2 * (10 - 10 * s + 5 * s**2 - s**3) / 120, lambda s: (1 - s) ** 3 / 6),
        ({"kind": "uniform"}, PINNED, lambda s: s * (1 - 2 * s**2 + s**3) / 24, lambda s: -s * (1 - s) / 2),
    ],
)  # fmt: skip
@pytest.mark.parametrize("modes", [3, "all"])
def test_static_deflection_and_moment_are_those_of_the_beam(shape, supports, deflection, moment, modes):
    scenario = case(load("step", line="whole", shape=shape), supports=supports, reduction={"modes": modes})
    system, q = static_motion(scenario)
    body = system.bodies[0]
    s = body.position / L
    nodes = np.isin(np.round(s * 14), np.arange(0, 15, 2))  # deflections are exact at nodes alone
    np.testing.assert_allclose(
        (body.deflection @ q)[nodes], 40 * L**4 / EI * deflection(s[nodes]), rtol=1e-9, atol=1e-13
    )
    np.testing.assert_allclose(body.bending_moment @ q, 40 * L**2 * moment(s), rtol=0, atol=1e-9 * 40 * L**2)


def test_moment_inside_a_partly_loaded_element():
    scenario = case(load("step", line=[0.2 * L, 0.55 * L]), supports=PINNED, reduction={"modes": 2})
    system, q = static_motion(scenario)
    x, a, b = system.bodies[0].position, 0.2 * L, 0.55 * L
    right = 40 * (b - a) * (a + b) / 2 / L
    left = 40 * (b - a) - right
    beyond = np.clip(x - a, 0, None) ** 2 / 2 - np.clip(x - b, 0, None) ** 2 / 2
    np.testing.assert_allclose(
        system.bodies[0].bending_moment @ q, -(left * x - 40 * beyond), rtol=0, atol=1e-9 * 40 * L**2
    )


def test_a_mode_shaped_load_drives_that_mode_of_a_uniform_beam():
    system = build_system(case(load(line="whole", shape={"kind": "mode", "mode": 2}), reduction={"modes": 5}))
    modal = np.abs(system.forcing.load[0])
    assert np.delete(modal, 1).max() < 1e-10 * modal[1]


def test_a_product_of_half_waves_drives_one_mode_of_a_simply_supported_plate():
    edges = dict.fromkeys(("left", "right", "bottom", "top"), "pinned")
    scenario = case(
        load(area="whole", shape={"kind": "sine", "half_waves": [2, 1]}),
        plate={"supports": edges, "elements": [10, 10]}, reduction={"modes": 8},
    )  # fmt: skip
    modal = np.abs(build_system(scenario).forcing.load[0])
    one = int(np.argmax(modal))
    assert np.delete(modal, one).max() < 1e-3 * modal[one]
