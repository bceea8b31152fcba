"""How the stiffness behind a frequency depends on the numbers of a beam; see `beamsim.structures.point_sensitivity`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from beamsim.structures.places import Place, Site
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.scenario import Beam
    from beamsim.structures.beam_model import BeamModel
    from beamsim.structures.structure import Path

_SECTION_STEP = 1e-6  # relative, for the derivatives of area and second moment


def beam_sensitivities(
    structure: BeamModel, path: Path, site: Site, site_path: Path, v: Floats, k: float, squared: float
) -> dict[Path, float]:
    """d ln k / d ln p by path; what sits on the beam's end moves with it when the length changes.

    Parameters
    ----------
    path, site_path : of the beam and of the snubber in the scenario.
    v, k, squared : scaled mode, scaled stiffness, scaled omega^2.
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
    _, slope = _deflection_and_slope(structure, v, site.coordinate)
    # v is -1 at the spring, so moving it adds 2 k slope * v(spring) * (-1).
    at = (*site_path, "position")
    places[at] = 2 * slope * site.coordinate
    position[at] = site.coordinate
    fixed = -sum(places.values()) - 3 * elastic + inertia
    carried = sum(rate for place, rate in places.items() if position[place] >= beam.length)
    return {
        (*path, "length"): fixed + carried,
        (*path, "youngs_modulus"): elastic,
        (*path, "density"): inertia,
        **{(*path, *place): inertia * area + elastic * second for place, area, second in _section(beam)},
        **{place: rate for place, rate in masses.items() if rate != 0},
        **{place: rate for place, rate in places.items() if position[place] > 0},
    }


def _deflection_and_slope(structure: BeamModel, v: Floats, position: float) -> tuple[float, float]:
    w, slope = structure.deflection_and_slope(v[:, None], Place(structure.name, position))
    return float(w[0]), float(slope[0])


def _section(beam: Beam) -> list[tuple[Path, float, float]]:
    """Place, d ln A / d ln p and d ln I / d ln p of every number of the cross-section."""
    if beam.section is None:
        return [(("width",), 1.0, 1.0), (("thickness",), 1.0, 3.0)]
    section = beam.section
    rates: list[tuple[Path, float, float]] = []
    for key in type(section).model_fields:
        value = getattr(section, key)
        if not isinstance(value, float) or key == "extreme_fibre":
            continue
        up, down = (section.model_copy(update={key: value * (1 + s * _SECTION_STEP)}) for s in (1, -1))
        area = (up.area - down.area) / (2 * _SECTION_STEP * section.area)
        second = (up.second_moment - down.second_moment) / (2 * _SECTION_STEP * section.second_moment)
        rates.append((("section", key), area, second))
    return rates
