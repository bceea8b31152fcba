r"""How the stiffness behind a frequency depends on every number of the structure.

At a fixed frequency :math:`k = -1 / (s^T D^{-1} s)` with the dynamic stiffness :math:`D = K - \omega^2 M` and the
deflection row s of the spring's point. With the closed structure's mode scaled as :math:`v = k D^{-1} s`,

.. math:: \frac{\partial k}{\partial p} = -v^T \frac{\partial D}{\partial p} v + 2 k\, \frac{\partial s}{\partial p} v,

one linear solve for all parameters. The beam's length follows from the others because k, made
adimensional, depends on adimensional numbers only.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.structures.assembly import assemble
from beamsim.structures.chain import linear_stiffness
from beamsim.structures.hermite import shape_functions
from beamsim.structures.places import row_of
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.scenario import Beam, Chain, Scenario
    from beamsim.structures.full import FullModel

Place = tuple[str | int, ...]

_SECTION_STEP = 1e-6  # relative, for the derivatives of area and second moment


def stiffness_sensitivities(scenario: Scenario, snubber: str, omega: float) -> dict[Place, float]:
    """d ln k / d ln p by place, k being the stiffness at the snubber that makes omega (rad/s) a natural frequency.

    What sits on the beam's end moves with it when the length changes.
    """
    model = assemble(scenario)
    row = row_of(model, scenario.snubber(snubber))
    index = [s.name for s in scenario.all_snubbers].index(snubber)
    squared = (omega / model.frequency_scale) ** 2
    v, k = _mode(model, row, squared)
    if scenario.beam is not None:
        return _of_beam(scenario, scenario.beam, index, model, v, k, squared)
    assert scenario.chain is not None
    return _of_chain(scenario.chain, model, v, k, squared)


def _mode(model: FullModel, row: Floats, squared: float) -> tuple[Floats, float]:
    """Scaled mode v and scaled stiffness k at a scaled omega^2."""
    stiffness: Any = model.factor.T @ model.factor
    dynamic = stiffness - squared * model.mass
    if model.size <= 400:
        x = np.linalg.solve(dynamic.toarray(), row)
    else:
        from scipy.sparse.linalg import spsolve

        x = np.asarray(spsolve(dynamic.tocsc(), row))
    k = -1.0 / float(row @ x)
    return k * x, k


def _of_beam(
    scenario: Scenario, beam: Beam, index: int, model: FullModel, v: Floats, k: float, squared: float
) -> dict[Place, float]:
    length = beam.length
    bent = np.asarray(model.factor @ v)
    elastic = -float(bent @ bent) / k
    whole = squared * float(v @ (model.mass @ v)) / k
    masses: dict[Place, float] = {}
    places: dict[Place, float] = {}
    for i, mass in enumerate(beam.point_masses):
        w, slope = _deflection(model, v, mass.position / length)
        ratio = mass.mass / model.mass_scale
        masses["beam", "point_masses", i, "mass"] = squared * ratio * w**2 / k
        places["beam", "point_masses", i, "position"] = squared * ratio * 2 * w * slope * mass.position / length / k
    inertia = whole - sum(masses.values())
    at = scenario.snubbers[index].position / length
    _, slope = _deflection(model, v, at)
    # v is -1 at the spring, so moving it adds 2 k slope * v(spring) * (-1).
    places["snubbers", index, "position"] = 2 * slope * at
    fixed = -sum(places.values()) - 3 * elastic + inertia
    carried = sum(rate for place, rate in places.items() if _position(scenario, place) >= length)
    found: dict[Place, float] = {
        ("beam", "length"): fixed + carried,
        ("beam", "youngs_modulus"): elastic,
        ("beam", "density"): inertia,
        **{place: inertia * area + elastic * second for place, area, second in _section(beam)},
        **{place: rate for place, rate in masses.items() if rate != 0},
        **{place: rate for place, rate in places.items() if _position(scenario, place) > 0},
    }
    return found


def _position(scenario: Scenario, place: Place) -> float:
    from beamsim.scenario.parameters import value_at

    return float(value_at(scenario, place))


def _deflection(model: FullModel, v: Floats, x: float) -> tuple[float, float]:
    """Deflection and slope (per adimensional length) of a field at x / L."""
    assert model.mesh is not None
    field = np.zeros(2 * model.mesh.nodes.size)
    field[model.free] = v
    element, xi = model.mesh.locate(x)
    local, h = field[model.mesh.dofs[element]], model.mesh.lengths[element]
    return float(shape_functions(xi, h) @ local), float(shape_functions(xi, h, 1) @ local)


def _section(beam: Beam) -> list[tuple[Place, float, float]]:
    """Place, d ln A / d ln p and d ln I / d ln p of every number of the cross-section."""
    if beam.section is None:
        return [(("beam", "width"), 1.0, 1.0), (("beam", "thickness"), 1.0, 3.0)]
    section = beam.section
    found: list[tuple[Place, float, float]] = []
    for key in type(section).model_fields:
        value = getattr(section, key)
        if not isinstance(value, float) or key == "extreme_fibre":
            continue
        up, down = (section.model_copy(update={key: value * (1 + s * _SECTION_STEP)}) for s in (1, -1))
        area = (up.area - down.area) / (2 * _SECTION_STEP * section.area)
        second = (up.second_moment - down.second_moment) / (2 * _SECTION_STEP * section.second_moment)
        found.append((("beam", "section", key), area, second))
    return found


def _of_chain(chain: Chain, model: FullModel, v: Floats, k: float, squared: float) -> dict[Place, float]:
    found: dict[Place, float] = {
        ("chain", "masses", i): squared * mass / model.mass_scale * float(v[i]) ** 2 / k
        for i, mass in enumerate(chain.masses)
    }
    ends = np.concatenate([[0.0], v, [0.0]])
    for i, spring in enumerate(chain.springs):
        if spring > 0:
            found["chain", "springs", i] = -spring / model.stiffness_scale * float(ends[i + 1] - ends[i]) ** 2 / k
    for name in ("springs_to_ground", "springs_between"):
        for i, beside in enumerate(getattr(chain, name)):
            stretch = float(row_of(model, beside) @ v)
            rate = -linear_stiffness(beside) / model.stiffness_scale * stretch**2 / k
            if beside.kind == "linear":
                found["chain", name, i, "stiffness"] = rate
            elif beside.kind == "piecewise_linear":
                found["chain", name, i, "stiffnesses", beside.number_at_rest] = rate
    return found
