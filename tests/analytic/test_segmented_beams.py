"""Beams of segments, elastic supports, rotary inertia, sections and Rayleigh ratios: against closed forms."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq

import beamsim
from beamsim.scenario import load_scenario
from beamsim.scenario.parameters import value_at, with_values
from beamsim.structures.assembly import assemble
from beamsim.structures.places import Place
from beamsim.structures.secular import stiffness_sensitivities
from beamsim.system.build import build_system

L, EI, M = 0.9, 12.0, 0.7
THIN = {"bending_stiffness": EI, "mass_per_length": M}
THICK = {"bending_stiffness": 40.0, "mass_per_length": 1.1}
WIDE = {"width": 0.05, "thickness": 0.01, "youngs_modulus": 70e9, "density": 2700.0}


def beam(**more):
    return {"beam": {"length": L, "elements": 80, **more}, "reduction": {"modes": 5}}


def frequencies(case):
    return build_system(load_scenario(case)).modes["open_frequencies_hz"].values


def exact_frequencies(determinant, count, highest=400.0):
    """The first zeros, Hz, of a characteristic determinant of omega."""
    omega = np.linspace(1.0, 2 * np.pi * highest, 4000)
    values = np.array([determinant(w) for w in omega])
    at = np.flatnonzero(values[1:] * values[:-1] < 0)[:count]
    assert at.size == count
    return np.array([brentq(determinant, omega[i], omega[i + 1], xtol=1e-13) for i in at]) / (2 * np.pi)


def shapes(beta, x):
    """(4, 4) rows w, w', w'', w''' of the four solutions of w'''' = beta^4 w at x."""
    s, c, sh, ch = np.sin(beta * x), np.cos(beta * x), np.sinh(beta * x), np.cosh(beta * x)
    return np.array(
        [
            [s, c, sh, ch],
            beta * np.array([c, -s, ch, sh]),
            beta**2 * np.array([-s, -c, sh, ch]),
            beta**3 * np.array([-c, s, ch, sh]),
        ]
    )


def test_beam_on_end_springs_has_the_frequencies_of_its_characteristic_equation():
    k, kr = 900.0, 15.0

    def determinant(omega):
        beta = (omega**2 * M / EI) ** 0.25
        left, right = shapes(beta, 0.0), shapes(beta, L)
        rows = [
            left[0],
            EI * left[2] - kr * left[1],  # pinned, with a rotational spring
            EI * right[2],
            EI * right[3] - k * right[0],
        ]
        matrix = np.array(rows)
        return np.linalg.det(matrix / np.linalg.norm(matrix, axis=1, keepdims=True))

    supports = {"left": {"kind": "pinned", "rotational_stiffness": kr}, "right": {"stiffness": k}}
    got = frequencies(beam(**THIN, supports=supports))[:4]
    np.testing.assert_allclose(got, exact_frequencies(determinant, 4), rtol=1e-6)


def test_rotary_inertia_inside_a_stepped_beam():
    """Moment and shear jump at the mass, where the section changes too."""
    mass, inertia, at = 0.2, 4e-3, 0.4 * L

    def determinant(omega):
        betas = [(omega**2 * s["mass_per_length"] / s["bending_stiffness"]) ** 0.25 for s in (THICK, THIN)]
        left, right, end = shapes(betas[0], at), shapes(betas[1], 0.0), shapes(betas[1], L - at)
        matrix = np.zeros((8, 8))
        matrix[:2, :4] = shapes(betas[0], 0.0)[:2]
        matrix[2:4, :4], matrix[2:4, 4:] = left[:2], -right[:2]
        thick, thin = THICK["bending_stiffness"], THIN["bending_stiffness"]
        matrix[4, :4], matrix[4, 4:] = thick * left[2] - omega**2 * inertia * left[1], -thin * right[2]
        matrix[5, :4], matrix[5, 4:] = thick * left[3] + omega**2 * mass * left[0], -thin * right[3]
        matrix[6:, 4:] = end[2:]
        return np.linalg.det(matrix / np.linalg.norm(matrix, axis=1, keepdims=True))

    segments = [{"from": 0.0, "to": at, **THICK}, {"from": at, "to": L, **THIN}]
    inside = {"position": "40 %", "mass": mass, "rotary_inertia": inertia}
    got = frequencies(beam(segments=segments, elements=160, point_masses=[inside]))[:4]
    np.testing.assert_allclose(got, exact_frequencies(determinant, 4), rtol=1e-6)
    without = frequencies(beam(segments=segments, elements=160, point_masses=[{**inside, "rotary_inertia": 0.0}]))[:4]
    assert np.all(without / got - 1 > 1e-3)


def test_deflections_at_structural_nodes_are_exact():
    """Of a coarse mesh under a load along the beam: between nodes they lack the particular solution."""
    at, load = 0.371 * L, -3.0

    def deflection(nodes):
        case = beam(**THIN, elements=2, nodes=nodes)
        case |= {
            "constant_forces": [{"line": "whole", "force_per_length": load}],
            "probes": [{"name": "inside", "position": at}],
            "reduction": {"modes": "all"},
            "run": {"duration": 0.01, "sample_rate": 1000.0},
        }
        system = build_system(load_scenario(case))
        return float(system.probes[0].shape @ system.static_equilibrium), system

    exact = load * at**2 * (6 * L**2 - 4 * L * at + at**2) / (24 * EI)
    got, system = deflection([at])
    assert got == pytest.approx(exact, rel=1e-9)
    assert np.abs(system.bodies[0].position - at).min() < 1e-12
    moment = system.bodies[0].bending_moment @ system.static_equilibrium
    assert abs(deflection([])[0] / exact - 1) > 1e-4
    assert moment[np.abs(system.bodies[0].position - at).argmin()] == pytest.approx(load * (L - at) ** 2 / 2, rel=1e-6)


def test_uniform_beam_in_segments_is_the_uniform_beam():
    shaken = {
        "snubbers": [{"name": "s", "position": L, "stiffness": 5e4, "gap": 1e-4, "side": "below"}],
        "excitation": {"kind": "harmonic", "applied_to": "base", "level": 5.0, "frequency": 9.0},
        "run": {"duration": 0.3, "sample_rate": 2000.0},
    }
    more = {
        "damping": {"kind": "rayleigh", "ratios": [{"frequency": 8, "ratio": 0.01}, {"frequency": 90, "ratio": 0.02}]}
    }
    cuts = [0.0, 0.3 * L, 0.75 * L, L]
    segments = [{"from": a, "to": b, **WIDE} for a, b in pairwise(cuts)]
    nodes = [{"nodes": ["30 %", "75 %"]}, {}]
    one, cut = (
        beamsim.run(load_scenario(beam(**given, **extra, **more) | shaken))
        for given, extra in zip((WIDE, {"segments": segments}), nodes, strict=True)
    )
    assert one.summary["contacts"]["s"] >= 2
    assert cut.summary["contacts"] == one.summary["contacts"]
    np.testing.assert_allclose(cut["modes"]["open_frequencies_hz"], one["modes"]["open_frequencies_hz"], rtol=1e-12)
    for name, history in one["histories"].by_label("displacement").items():
        other, expected = cut["histories"]["displacement"].sel(probe=name).values, history.values
        np.testing.assert_allclose(other, expected, atol=1e-11 * np.abs(expected).max(), err_msg=name)
    stress = [result["bodies"]["peak_bending_stress"].values for result in (one, cut)]
    np.testing.assert_allclose(stress[1], stress[0], rtol=1e-9, atol=1e-9 * stress[0].max())


def test_stress_where_segments_meet_is_that_of_the_weaker_one():
    thick = {**WIDE, "thickness": 0.02}
    case = beam(segments=[{"from": 0.0, "to": 0.4, **thick}, {"from": 0.4, "to": L, **WIDE}])
    case |= {"constant_forces": [{"position": L, "force": -3.0}], "reduction": {"modes": "all"}}
    system = build_system(load_scenario(case))
    (body,), q = system.bodies, system.static_equilibrium
    x = body.position
    moment = -3.0 * (L - x)  # positive where the top is compressed
    np.testing.assert_allclose(body.bending_moment @ q, moment, atol=1e-7)
    depth = np.where(x < 0.4 - 1e-9, 0.02, 0.01)
    np.testing.assert_allclose(system.stress.row @ q, 6 * moment / (0.05 * depth**2), atol=1.0)


@pytest.mark.parametrize(
    ("section", "area", "second_moment", "fibre"),
    [
        ({"kind": "circle", "diameter": 0.02}, np.pi * 1e-4, np.pi * 0.01**4 / 4, 0.01),
        ({"kind": "square", "side": 0.02}, 4e-4, 0.02**4 / 12, 0.01),
        ({"kind": "tube", "outer_diameter": 0.02, "wall_thickness": 0.01}, np.pi * 1e-4, np.pi * 0.01**4 / 4, 0.01),
        (
            {"kind": "I", "height": 0.05, "width": 0.03, "web_thickness": 0.004, "flange_thickness": 0.006},
            2 * 0.03 * 0.006 + 0.004 * 0.038,
            2 * (0.03 * 0.006**3 / 12 + 0.03 * 0.006 * 0.022**2) + 0.004 * 0.038**3 / 12,
            0.025,
        ),
    ],
)
def test_sections(section, area, second_moment, fibre):
    scenario = load_scenario(beam(section=section, youngs_modulus=2e9, density=1500.0))
    (stretch,) = scenario.beam.uniform_segments
    assert stretch.bending_stiffness == pytest.approx(2e9 * second_moment, rel=1e-13)
    assert stretch.mass_per_length == pytest.approx(1500 * area, rel=1e-13)
    assert stretch.bending.stress_per_moment == pytest.approx(fibre / second_moment, rel=1e-13)


def test_sandwich_section():
    faces = {"thickness": 0.5e-3, "youngs_modulus": 70e9, "density": 2700.0}
    core = {"thickness": 19e-3, "youngs_modulus": 1e8, "density": 50.0}
    section = {"kind": "sandwich", "width": 0.4, "faces": faces, "core": core}
    scenario = load_scenario(beam(section=section))
    (stretch,) = scenario.beam.uniform_segments
    steiner = 0.4 * 70e9 * (2 * 0.5e-3 * 9.75e-3**2 + 0.5e-3**3 / 6)
    stiffness = steiner + 0.4 * 1e8 * 19e-3**3 / 12
    assert stretch.bending_stiffness == pytest.approx(stiffness, rel=1e-13)
    assert stretch.mass_per_length == pytest.approx(0.4 * (2700 * 1e-3 + 50 * 19e-3), rel=1e-13)
    assert stretch.bending.stress_per_moment == pytest.approx(70e9 * 10e-3 / stiffness, rel=1e-13)
    assert load_scenario(scenario.to_yaml()) == scenario


def test_rayleigh_damping_has_the_ratios_at_the_two_frequencies():
    ratios = [{"frequency": "60 Hz", "ratio": "1.5 %"}, {"frequency": "12 Hz", "ratio": "1 %"}]
    case = beam(**THIN, damping={"kind": "rayleigh", "ratios": ratios})
    modes = build_system(load_scenario(case)).modes
    a, b = np.linalg.solve([[1 / (2 * w), w / 2] for w in (2 * np.pi * 60, 2 * np.pi * 12)], [0.015, 0.01])
    omega = 2 * np.pi * modes["open_frequencies_hz"].values
    np.testing.assert_allclose(modes["damping_ratios"].values, a / (2 * omega) + b * omega / 2, rtol=1e-12)


def test_derivatives_by_every_number_of_segments_springs_and_rotary_masses():
    """Against central differences of the stiffness that gives a frequency."""
    sandwich = {
        "kind": "sandwich", "width": 0.05,
        "faces": {"thickness": 1e-3, "youngs_modulus": 70e9, "density": 2700.0},
        "core": {"thickness": 8e-3, "youngs_modulus": 1e8, "density": 100.0},
    }  # fmt: skip
    case = beam(
        elements=24,  # the differences lose digits with the fourth power of the number
        segments=[
            {"from": 0.0, "to": 0.4, "section": sandwich, "added_mass_per_length": 0.1},
            {"from": 0.4, "to": L, **THIN},
        ],
        supports={"left": {"kind": "pinned", "rotational_stiffness": 20.0}, "right": {"stiffness": 300.0}},
        point_masses=[{"position": 0.61, "mass": 0.1, "rotary_inertia": 1e-3}],
    ) | {"snubbers": [{"name": "s", "position": 0.7, "side": "below", "stiffness": 1e4}]}
    scenario = load_scenario(case)
    omega = 2 * np.pi * 21.0
    rates = stiffness_sensitivities(scenario, "s", omega)

    def stiffness(path, value):
        structure = assemble(with_values(scenario, {path: value}))
        position = value if path == ("snubbers", 0, "position") else 0.7
        row = structure.row(Place("beam", position))
        dynamic = structure.factor.T @ structure.factor - (omega / structure.frequency_scale) ** 2 * structure.mass
        return -structure.stiffness_scale / float(row @ np.linalg.solve(dynamic.toarray(), row))

    checked = 0
    for path, rate in rates.items():
        if path == ("beam", "length"):  # its segments grow with it
            continue
        value, step = float(value_at(scenario, path)), 1e-4
        up, down = (stiffness(path, value * (1 + s * step)) for s in (1, -1))
        # a rate of position holds a slope or curvature between elements, which converges with the second order
        near = 3e-3 if path[-1] == "position" else 2e-4
        assert rate == pytest.approx(np.log(up / down) / (2 * step), rel=near, abs=1e-7), path
        checked += 1
    assert checked >= 16
