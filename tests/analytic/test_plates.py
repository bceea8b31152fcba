"""Plates against closed forms: all edges pinned, Levy's cases, orthotropic plates, strips that are beams, statics."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from beamsim.scenario.beam import Beam
from beamsim.scenario.loading import load_scenario
from beamsim.scenario.parameters import value_at, with_values
from beamsim.scenario.plate import EDGES, Plate, PlateSupports, Stiffener, StiffnessPlate
from beamsim.structures.assembly import assemble, snubber_site
from beamsim.structures.beam import assemble_beam
from beamsim.structures.modes import natural_modes
from beamsim.structures.places import UPWARDS, Place
from beamsim.structures.plate import PlateStructure, assemble_plate, moment_operator
from beamsim.structures.point_sensitivity import stiffness_sensitivities
from beamsim.structures.reduction import static_deflections

pytestmark = pytest.mark.quick

WORD = {"C": "clamped", "S": "pinned", "F": "free"}
SOLID = {"thickness": 0.005, "youngs_modulus": 70e9, "poissons_ratio": 0.3, "density": 2700.0}


def supports(edges: str) -> PlateSupports:
    """From letters of the left, right, bottom and top edge."""
    return PlateSupports(**{edge: WORD[letter] for edge, letter in zip(EDGES, edges, strict=True)})


def plate(edges: str, elements: tuple[int, int], length: float = 1.0, width: float = 1.0, **given: Any) -> Plate:
    return Plate(
        length=length, width=width, elements=elements, supports=supports(edges), **{**SOLID, **given}
    )  # fmt: skip


def parameters(section: Any, count: int) -> np.ndarray:
    """Flexible frequency parameters omega L^2 sqrt(m / Dx)."""
    structure = assemble_plate(section)
    modes = natural_modes(structure, count=count + structure.rigid.shape[1])
    omega = modes.omega[structure.rigid.shape[1] :][:count] * structure.frequency_scale
    return np.asarray(omega * section.length**2 * np.sqrt(section.bending.mass_per_area / section.bending.rigidity.dx))


def stiffener(start: tuple[float, float], end: tuple[float, float], **given: float) -> Stiffener:
    numbers = {"bending_stiffness": 30.0, "torsional_stiffness": 7.0, "mass_per_length": 0.4, **given}
    return Stiffener(**{"from": start, "to": end, **numbers})


def test_all_edges_pinned_converge_with_order_four() -> None:
    exact = np.sort([np.pi**2 * (m**2 + (n / 0.7) ** 2) for m in range(1, 6) for n in range(1, 6)])[:6]
    errors = [parameters(plate("SSSS", (n, n), width=0.7), 6) / exact - 1 for n in (6, 12)]
    order = np.log2(errors[0] / errors[1])
    assert np.all(errors[1] > 0)  # the element conforms: frequencies come from above
    assert np.all(errors[1] < 1e-3)
    assert order == pytest.approx(4.0, abs=0.15)


def test_orthotropic_plate_with_pinned_edges() -> None:
    stiffness = {"dx": 3000.0, "dy": 800.0, "nu": 0.4, "dxy": 500.0}
    section = StiffnessPlate(
        length=0.9, width=0.6, bending_stiffness=stiffness, mass_per_area=4.0, elements=(14, 14),
        supports=supports("SSSS"),
    )  # fmt: skip
    h = 0.4 * 800.0 + 2 * 500.0
    squared = np.sort(
        [
            (3000.0 * x**4 + 2 * h * x**2 * y**2 + 800.0 * y**4) / 4.0
            for x in np.arange(1, 8) * np.pi / 0.9
            for y in np.arange(1, 8) * np.pi / 0.6
        ]
    )[:8]
    structure = assemble_plate(section)
    omega = natural_modes(structure, count=8).first(8).omega * structure.frequency_scale
    np.testing.assert_allclose(omega, np.sqrt(squared), rtol=2e-4)
    assert np.all(omega >= np.sqrt(squared))


@pytest.mark.parametrize("ends", ["CF", "CC", "SS", "FF"])
def test_strip_without_contraction_is_a_beam(ends: str) -> None:
    """With nu = 0 a beam's deflection, constant along y, is an exact mode of the discrete plate."""
    section = plate(f"{ends}FF", (9, 2), length=0.6, width=0.05, poissons_ratio=0.0)
    structure = assemble_plate(section)
    beam = assemble_beam(
        Beam(
            length=0.6,
            width=0.05,
            thickness=0.005,
            youngs_modulus=70e9,
            density=2700.0,
            elements=9,
            supports={"left": WORD[ends[0]], "right": WORD[ends[1]]},
        )
    )
    expected = natural_modes(beam)
    flexible = expected.omega[expected.omega > 0][:4] * beam.frequency_scale
    modes = natural_modes(structure)
    omega = modes.omega * structure.frequency_scale
    for value in flexible:
        assert np.abs(omega / value - 1).min() < 1e-9


def test_point_supports_take_rigid_body_modes() -> None:
    corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)]
    for count, rigid in ((1, 2), (2, 1), (3, 0)):
        section = plate("FFFF", (4, 4)).model_copy(
            update={"supports": PlateSupports(points=[{"position": p} for p in corners[:count]])}
        )
        structure = assemble_plate(section)
        assert structure.rigid.shape[1] == rigid
        for x, y in corners[:count]:
            assert np.abs(structure.row(Place("plate", (x, y)))).max() < 1e-15


def _uniform_pressure(structure: PlateStructure, pressure: float) -> np.ndarray:
    """(N,) deflection, m: the inertia load of a unit acceleration is that of a pressure m a."""
    unit = static_deflections(structure, structure.base_load(UPWARDS)[0][:, None])[:, 0] / structure.frequency_scale**2
    return np.asarray(unit * pressure / structure.section.bending.mass_per_area)


@pytest.mark.parametrize("width", [1.0, 1.5])
def test_pinned_plate_under_pressure_against_navier(width: float) -> None:
    """Deflection and moments at the centre (Timoshenko and Woinowsky-Krieger, articles 29 and 30)."""
    structure = assemble_plate(plate("SSSS", (12, 12), width=width))
    d, nu, m = structure.section.bending.rigidity.dx, 0.3, np.arange(1, 400, 2)
    x, y = (m * np.pi)[:, None], (m * np.pi / width)[None, :]
    sign = np.outer((-1.0) ** ((m - 1) // 2), (-1.0) ** ((m - 1) // 2))
    w = 16 * sign / (np.pi**2 * np.outer(m, m) * (x**2 + y**2) ** 2)
    field = structure.whole_field(_uniform_pressure(structure, d))
    assert structure.mesh.rows(np.array([[0.5, 0.5]])) @ field == pytest.approx(w.sum(), rel=2e-5)
    moments = (moment_operator(structure) @ field).reshape(3, -1) / d
    centre = int(np.argmin(np.abs(structure.mesh.node_points - 0.5).sum(axis=1)))
    assert -moments[0, centre] == pytest.approx((w * (x**2 + nu * y**2)).sum(), rel=3e-4)
    assert -moments[1, centre] == pytest.approx((w * (nu * x**2 + y**2)).sum(), rel=3e-4)


def test_moments_of_a_strip_under_pressure_are_exact() -> None:
    """Mx = q (L - x)^2 / 2 at every node of a cantilever strip (nu = 0), where second derivatives alone are 2 % off."""
    structure = assemble_plate(plate("CFFF", (5, 2), width=0.3, poissons_ratio=0.0))
    field = structure.whole_field(_uniform_pressure(structure, 1.0))
    exact = 0.5 * (1 - structure.mesh.node_points[:, 0]) ** 2
    moments = (moment_operator(structure) @ field).reshape(3, -1)
    np.testing.assert_allclose(moments[0], exact, atol=1e-9)
    np.testing.assert_allclose(moments[1:], 0.0, atol=1e-9)
    plain = structure.mesh.rows(structure.mesh.node_points, (2, 0)) @ field * structure.section.bending.rigidity.dx
    assert np.abs(plain - exact).max() > 1e-3


def test_stiffeners_alone_bend_and_twist_as_beams() -> None:
    """A stiffener along the middle line of a strip adds its E I and mass to those of the strip (nu = 0)."""
    beam = stiffener((0.0, 0.025), (0.6, 0.025))
    section = plate("CFFF", (9, 2), length=0.6, width=0.05, poissons_ratio=0.0).model_copy(
        update={"stiffeners": (beam,)}
    )
    structure = assemble_plate(section)
    bending = 70e9 * 0.05 * 0.005**3 / 12 + 30.0
    mass = 2700 * 0.05 * 0.005 + 0.4
    first = 1.8751040687119611**2 * np.sqrt(bending / mass) / 0.6**2
    omega = natural_modes(structure, count=1).omega[0] * structure.frequency_scale
    # Slightly less: across its width the strip bends at the stiffener, which carries the most of it.
    assert omega == pytest.approx(first, rel=2e-3)


def test_sensitivities_of_a_plate_against_differences() -> None:
    """d ln k / d ln p of every number, and of the snubber's place, against assembling the changed scenario anew."""
    scenario = load_scenario(
        {
            "bodies": {
                "panel": {
                    "kind": "plate", "length": 0.77, "width": 0.44, **SOLID, "elements": [6, 4],
                    "supports": {"left": "clamped"},
                }
            },
            "snubbers": [{"name": "near", "at": {"position": [0.7, 0.05]}, "side": "below", "stiffness": 5e3}],
        }
    )  # fmt: skip
    omega = 2 * np.pi * 9.0
    rates = stiffness_sensitivities(scenario, "near", omega)
    assert len(rates) == 8
    for path, rate in rates.items():
        value = value_at(scenario, path)
        stiffness = []
        for factor in (1 + 1e-5, 1 - 1e-5):
            changed = with_values(scenario, {path: value * factor})
            structure = assemble(changed)
            row = structure.row(snubber_site(changed.located_snubber("near")))
            dynamic = structure.factor.T @ structure.factor - (omega / structure.frequency_scale) ** 2 * structure.mass
            stiffness.append(-structure.stiffness_scale / (row @ np.linalg.solve(dynamic.toarray(), row)))
        assert rate == pytest.approx(np.log(stiffness[0] / stiffness[1]) / 2e-5, rel=1e-5), path
