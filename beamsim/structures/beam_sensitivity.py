"""How the stiffness behind a frequency depends on the numbers of a beam; see `beamsim.structures.point_sensitivity`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from beamsim.scenario.beam import Beam, StiffnessBeam
from beamsim.structures.places import SLOPE, Place, SpringEnd
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.scenario.beam import BeamBody
    from beamsim.structures.beam_model import BeamModel
    from beamsim.structures.structure import Path

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
    bent = np.asarray(structure.factor @ v)
    elastic = -float(bent @ bent) / k
    whole = squared * float(v @ (structure.mass @ v)) / k
    masses: dict[Path, float] = {}
    places: dict[Path, float] = {}
    position: dict[Path, float] = {}
    for i, mass in enumerate(beam.point_masses):
        w, slope = _deflection_and_slope(structure, v, mass.position)
        ratio = mass.mass / structure.mass_scale
        masses[(*path, "point_masses", i, "mass")] = squared * ratio * w**2 / k
        at = (*path, "point_masses", i, "position")
        places[at] = squared * ratio * 2 * w * slope * mass.position / k
        position[at] = mass.position
    inertia = whole - sum(masses.values())
    for end in ends:
        _, slope = _deflection_and_slope(structure, v, end.place.point)
        at = (*end.path, "position")
        places[at] = 2 * end.sign * slope * end.place.point  # moving the end adds 2 k (ds/dx) v to k
        position[at] = end.place.point
    fixed = -sum(places.values()) - 3 * elastic + inertia
    carried = sum(rate for place, rate in places.items() if position[place] >= beam.length)
    return {
        (*path, "length"): fixed + carried,
        **{(*path, *place): inertia * mass + elastic * bending for place, mass, bending in _properties(beam)},
        **{place: rate for place, rate in masses.items() if rate != 0},
        **{place: rate for place, rate in places.items() if position[place] > 0},
    }


def _deflection_and_slope(structure: BeamModel, v: Floats, position: float) -> tuple[float, float]:
    place = Place(structure.name, position)
    return float(structure.row(place) @ v), float(structure.row(replace(place, direction=SLOPE)) @ v)


def _properties(beam: BeamBody) -> list[tuple[Path, float, float]]:
    """Path, d ln(rho A) / d ln p and d ln(E I) / d ln p of every number of the material and the cross-section."""
    if isinstance(beam, StiffnessBeam):
        return [(("bending_stiffness",), 0.0, 1.0), (("mass_per_length",), 1.0, 0.0)]
    assert isinstance(beam, Beam)
    rates: list[tuple[Path, float, float]] = [(("youngs_modulus",), 0.0, 1.0), (("density",), 1.0, 0.0)]
    section = beam.section
    if section is None:
        return [*rates, (("width",), 1.0, 1.0), (("thickness",), 1.0, 3.0)]
    for key in type(section).model_fields:
        value = getattr(section, key)
        if not isinstance(value, float) or key == "extreme_fibre":
            continue
        up, down = (section.model_copy(update={key: value * (1 + s * _SECTION_STEP)}) for s in (1, -1))
        area = (up.area - down.area) / (2 * _SECTION_STEP * section.area)
        second = (up.second_moment - down.second_moment) / (2 * _SECTION_STEP * section.second_moment)
        rates.append((("section", key), area, second))
    return rates
