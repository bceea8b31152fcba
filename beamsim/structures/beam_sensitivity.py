"""How the stiffness behind a frequency depends on the numbers of a beam; see `beamsim.structures.point_sensitivity`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from beamsim.scenario.base import walk
from beamsim.scenario.bending import SandwichBending, SolidBending, StatedBending
from beamsim.structures.beam_model import deflection_row
from beamsim.structures.hermite import curvature_factor, mass_matrix
from beamsim.structures.places import SpringEnd
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.scenario.base import Schema
    from beamsim.scenario.bending import Stretch
    from beamsim.structures.beam_model import BeamModel
    from beamsim.structures.structure import Path

_BESIDE = 1e-9  # nondimensional distance from a node to the inside of its elements
_SECTION_STEP = 1e-6  # relative, for the derivatives of area and second moment


def beam_sensitivities(
    structure: BeamModel, path: Path, ends: Sequence[SpringEnd], v: Floats, k: float, squared: float
) -> dict[Path, float]:
    """d ln k / d ln p by path; what sits on the beam's end moves with it when the length changes.

    Parameters
    ----------
    path : of the beam in the scenario.
    ends : places of the spring that are on the beam.
    v : (N,) mode, scaled to a stretch of -1 at the spring.
    k, squared : scaled stiffness, scaled omega^2.
    """
    beam = structure.beam
    rates: dict[Path, float] = {}
    elastic, inertia = _of_stretches(structure, v, k, squared)
    for stretch, bending, mass in zip(beam.stretches, elastic, inertia, strict=True):
        rates |= {(*path, *stretch.path, *at): mass * m + bending * b for at, m, b in _properties(stretch)}
    lengths = -3 * sum(elastic) + sum(inertia)  # the sum of what all lengths would give, less those below
    places: dict[Path, float] = {}
    position: dict[Path, float] = {}
    for i, point in enumerate(beam.point_masses):
        w, slope, curvature = (_derivative(structure, v, point.position, order) for order in range(3))
        at = (*path, "point_masses", i)
        of_mass, of_rotation = (squared * x / structure.mass_scale / k for x in (point.mass, point.rotary_inertia))
        rates |= {(*at, "mass"): of_mass * w**2} if of_mass * w else {}
        rates |= {(*at, "rotary_inertia"): of_rotation * slope**2} if of_rotation * slope else {}
        places[(*at, "position")] = 2 * slope * point.position * (of_mass * w + of_rotation * curvature)
        position[(*at, "position")] = point.position
        lengths -= 2 * of_rotation * slope**2
    for end, springs, x in zip(("left", "right"), beam.supports.springs, (0.0, beam.length), strict=True):
        for order, key in enumerate(("stiffness", "rotational_stiffness")):
            if springs is not None and getattr(springs, key) > 0.0:
                moved = _derivative(structure, v, x, order)
                rate = -getattr(springs, key) / structure.stiffness_scale * moved**2 / k
                rates[(*path, "supports", end, key)] = rate
                lengths -= 2 * order * rate
    for spring in ends:
        slope = _derivative(structure, v, spring.place.coordinate, 1)
        at = (*spring.path, "position")
        places[at] = 2 * spring.sign * slope * spring.place.coordinate  # moving the end adds 2 k (ds/dx) v to k
        position[at] = spring.place.coordinate
    carried = sum(rate for place, rate in places.items() if position[place] >= beam.length)
    return {
        (*path, "length"): lengths - sum(places.values()) + carried,
        **rates,
        **{place: rate for place, rate in places.items() if position[place] > 0},
    }


def _of_stretches(structure: BeamModel, v: Floats, k: float, squared: float) -> tuple[list[float], list[float]]:
    """d ln k / d ln E I and d ln k / d ln (rho S) of every stretch."""
    mesh = structure.mesh
    u = structure.whole_field(v)[mesh.dofs]
    bent = np.einsum("esd,ed->es", curvature_factor(mesh.lengths), u)
    elastic = -structure.bending * np.einsum("es,es->e", bent, bent) / k
    inertia = squared * structure.line_mass * np.einsum("ec,ecd,ed->e", u, mass_matrix(mesh.lengths), u) / k
    count = len(structure.beam.stretches)
    elastic, inertia = (np.bincount(structure.stretch_of, rates, count) for rates in (elastic, inertia))
    return elastic.tolist(), inertia.tolist()


def _derivative(structure: BeamModel, v: Floats, position: float, order: int) -> float:
    """Deflection, slope, 1/m, or curvature, 1/m^2, of a mode; where the curvature jumps its mean."""
    x = position / structure.beam.length
    beside = (max(x - _BESIDE, 0.0), min(x + _BESIDE, 1.0)) if order == 2 else (x,)
    rows = [deflection_row(structure.mesh, at, order) for at in beside]
    return float(np.mean(rows @ structure.whole_field(v))) / structure.beam.length**order


def _properties(stretch: Stretch) -> list[tuple[Path, float, float]]:
    """Path, d ln(rho S) / d ln p and d ln(E I) / d ln p of every number of the material and the cross-section."""
    bending = stretch.bending
    share = bending.mass_per_length / stretch.mass_per_length
    rates: list[tuple[Path, float, float]] = []
    if stretch.added_mass_per_length:
        rates.append((("added_mass_per_length",), 1.0 - share, 0.0))
    if isinstance(bending, StatedBending):
        return [*rates, (("bending_stiffness",), 0.0, 1.0), (("mass_per_length",), share, 0.0)]
    assert isinstance(bending, (SolidBending, SandwichBending))
    if isinstance(bending, SolidBending):
        rates += [(("youngs_modulus",), 0.0, 1.0), (("density",), share, 0.0)]
        if bending.section is None:
            return [*rates, (("width",), share, 1.0), (("thickness",), share, 3.0)]
    section = bending.section
    assert section is not None
    for path, value in _numbers(section):
        if path == ("extreme_fibre",) or value == 0.0:
            continue
        up, down = (
            bending.model_copy(update={"section": _with(section, path, value * (1 + s * _SECTION_STEP))})
            for s in (1, -1)
        )
        mass = (up.mass_per_length - down.mass_per_length) / (2 * _SECTION_STEP * stretch.mass_per_length)
        stiffness = (up.bending_stiffness - down.bending_stiffness) / (2 * _SECTION_STEP * bending.bending_stiffness)
        rates.append((("section", *path), mass, stiffness))
    return rates


def _numbers(section: Schema) -> Iterator[tuple[Path, float]]:
    """The numbers of a section and its parts, by path."""
    for path, part in walk(section):
        for key in type(part).model_fields:
            if isinstance(value := getattr(part, key), float):
                yield (*path, key), value


def _with(section: Schema, path: Path, value: float) -> Schema:
    """The section with another number."""
    key = str(path[0])
    changed = value if len(path) == 1 else _with(getattr(section, key), path[1:], value)
    return section.model_copy(update={key: changed})
