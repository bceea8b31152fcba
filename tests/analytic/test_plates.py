"""Plates against closed forms: all edges pinned, Levy's cases, orthotropic plates, strips that are beams, statics."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from beamsim.scenario import load_scenario
from beamsim.scenario.beam import Beam
from beamsim.scenario.parameters import value_at, with_values
from beamsim.scenario.plate import EDGES, Plate, PlateSupports, Stiffener
from beamsim.structures.assembly import assemble, snubber_site
from beamsim.structures.beam import assemble_beam
from beamsim.structures.modes import natural_modes
from beamsim.structures.places import UPWARDS, Place
from beamsim.structures.plate import PlateStructure, assemble_plate, moment_operator
from beamsim.structures.reduction import static_deflections
from beamsim.structures.secular import stiffness_sensitivities

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


def levy_determinant(squared: float, m: int, bottom: str, top: str, width: float, nu: float) -> float:
    """Of the conditions at y = 0 and width for w = Y(y) sin(m pi x) at a frequency parameter, length 1.

    Y'''' - 2 k^2 Y'' + (k^4 - lambda^2) Y = 0 with k = m pi (A. W. Leissa, J. Sound Vib. 31 (1973), equations 5 to 9).
    """
    k = m * np.pi
    p = np.sqrt(k**2 + squared)
    r = squared - k**2
    q = np.sqrt(abs(r))
    # sinh and cosh from both edges, which does not overflow, and the pair of the other root
    values = {
        "decaying": lambda y, n: (-p) ** n * np.exp(-p * y),
        "growing": lambda y, n: p**n * np.exp(-p * (width - y)),
    }

    def other(y: float, n: int) -> tuple[float, float]:
        if r >= 0:
            return q**n * np.cos(q * y + n * np.pi / 2), q ** (n - 1) * np.sin(q * y + n * np.pi / 2) if n else (
                np.sin(q * y) / q if q > 0 else y
            )
        return (
            q**n * (np.cosh(q * y) if n % 2 == 0 else np.sinh(q * y)),
            q ** (n - 1) * (np.sinh(q * y) if n % 2 == 0 else np.cosh(q * y)),
        )

    def row(y: float, n: int) -> np.ndarray:
        return np.array([values["decaying"](y, n), values["growing"](y, n), *other(y, n)])

    rows = []
    for y, edge in ((0.0, bottom), (width, top)):
        deflection, slope = row(y, 0), row(y, 1)
        moment = row(y, 2) - nu * k**2 * deflection
        force = row(y, 3) - (2 - nu) * k**2 * slope
        rows += {"C": [deflection, slope], "S": [deflection, moment], "F": [moment, force]}[edge]
    matrix = np.array(rows)
    return float(np.linalg.det(matrix / np.linalg.norm(matrix, axis=1, keepdims=True)))


def levy_parameters(bottom: str, top: str, count: int, width: float = 1.0, nu: float = 0.3) -> np.ndarray:
    """The lowest frequency parameters, length 1, left and right edges pinned."""
    roots: list[float] = []
    highest = 140.0 if width == 1.0 else 70.0
    for m in range(1, 4):
        grid = np.linspace(0.02, highest, 500)
        found = [levy_determinant(g, m, bottom, top, width, nu) for g in grid]
        for (a, fa), (b, fb) in pairwise(zip(grid, found, strict=True)):
            if fa * fb < 0 and not a < (m * np.pi) ** 2 < b:
                roots.append(brentq(levy_determinant, a, b, args=(m, bottom, top, width, nu), xtol=1e-12))
    return np.sort(roots)[:count]


def test_all_edges_pinned_converge_with_order_four() -> None:
    exact = np.sort([np.pi**2 * (m**2 + (n / 0.7) ** 2) for m in range(1, 6) for n in range(1, 6)])[:6]
    errors = [parameters(plate("SSSS", (n, n), width=0.7), 6) / exact - 1 for n in (6, 12)]
    order = np.log2(errors[0] / errors[1])
    assert np.all(errors[1] > 0)  # the element conforms: frequencies come from above
    assert np.all(errors[1] < 1e-3)
    assert order == pytest.approx(4.0, abs=0.15)


@pytest.mark.parametrize(
    ("edges", "width", "published"),
    [("CC", 1.0, 28.9509), ("FF", 1.0, 9.6314), ("CS", 1.0, 23.6463), ("SF", 1.0, 11.6845), ("CF", 1.0, 12.6874),
     ("SS", 1.0, 19.7392), ("CF", 2.5, None), ("SF", 2.5, None)],
)  # fmt: skip
def test_levy_cases(edges: str, width: float, published: float | None) -> None:
    """A. W. Leissa, J. Sound Vib. 31 (1973), tables C1 to C6, square, nu = 0.3; five modes of the solution itself."""
    exact = levy_parameters(edges[0], edges[1], 5, width)
    assert exact.size == 5
    if published is not None:
        assert exact[0] == pytest.approx(published, abs=6e-5)
    coarse, fine = (parameters(plate(f"SS{edges}", (n, n), width=width), 5) / exact - 1 for n in (6, 12))
    assert np.all(fine > -1e-10)
    assert np.all(fine < 1e-3)
    assert np.all(fine < coarse / 10)  # fourth order: 16, of the highest of them not yet


def test_axes_exchanged_give_the_same() -> None:
    one = assemble_plate(plate("CFSF", (5, 7), length=0.8, width=0.5))
    other = assemble_plate(plate("SFCF", (7, 5), length=0.5, width=0.8))
    a, b = (natural_modes(s, count=10).omega[:10] * s.frequency_scale for s in (one, other))
    np.testing.assert_allclose(a, b, rtol=1e-11)


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
    field = structure.all_dofs_map @ _uniform_pressure(structure, d)
    assert structure.mesh.rows(np.array([[0.5, 0.5]])) @ field == pytest.approx(w.sum(), rel=2e-5)
    moments = (moment_operator(structure) @ field).reshape(3, -1) / d
    centre = int(np.argmin(np.abs(structure.mesh.node_points - 0.5).sum(axis=1)))
    assert -moments[0, centre] == pytest.approx((w * (x**2 + nu * y**2)).sum(), rel=3e-4)
    assert -moments[1, centre] == pytest.approx((w * (nu * x**2 + y**2)).sum(), rel=3e-4)


def test_moments_of_a_strip_under_pressure_are_exact() -> None:
    """Mx = q (L - x)^2 / 2 at every node of a cantilever strip (nu = 0), where second derivatives alone are 2 % off."""
    structure = assemble_plate(plate("CFFF", (5, 2), width=0.3, poissons_ratio=0.0))
    field = structure.all_dofs_map @ _uniform_pressure(structure, 1.0)
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


def test_energy_of_a_stiffener_along_a_diagonal() -> None:
    """w = x^2 and w = x y are in the space of the elements; their energies along a line are exact."""
    beam = stiffener((0.1, 0.05), (0.7, 0.45))
    bare = plate("FFFF", (5, 4), length=0.8, width=0.5)
    forms = []
    for section in (bare, bare.model_copy(update={"stiffeners": (beam,)})):
        s = assemble_plate(section)
        x, y = s.mesh.x.nodes, s.mesh.y.nodes
        square = np.column_stack([(0.8 * x) ** 2, 2 * 0.8 * x * 0.8]).ravel()
        one_y = np.tile([1.0, 0.0], y.size)
        linear_x = np.column_stack([0.8 * x, np.full(x.size, 0.8)]).ravel()
        linear_y = np.column_stack([0.5 * y, np.full(y.size, 0.5)]).ravel()
        fields = np.column_stack([np.kron(square, one_y), np.kron(linear_x, linear_y)])
        bent = s.factor @ fields
        forms.append(
            (s.stiffness_scale * (bent.T @ bent).diagonal(), s.mass_scale * np.diag(fields.T @ (s.mass @ fields)))
        )
    length = np.hypot(0.6, 0.4)
    c, sn = 0.6 / length, 0.4 / length
    stiffness = forms[1][0] - forms[0][0]
    assert stiffness[0] == pytest.approx(length * (30.0 * (2 * c**2) ** 2 + 7.0 * (2 * c * sn) ** 2), rel=1e-9)
    assert stiffness[1] == pytest.approx(length * (30.0 * (2 * c * sn) ** 2 + 7.0 * (c**2 - sn**2) ** 2), rel=1e-9)
    points, weights = np.polynomial.legendre.leggauss(8)
    t = (points + 1) / 2
    x = 0.1 + 0.6 * t
    assert forms[1][1][0] - forms[0][1][0] == pytest.approx(0.4 * length * (weights / 2 @ x**4), rel=1e-9)


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
