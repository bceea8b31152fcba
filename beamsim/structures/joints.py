"""From the joints and linear springs of a scenario to what couples its bodies."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from beamsim.structures.chain import linear_stiffness
from beamsim.structures.places import SLOPE, Link, Place, Site, ends_of, site_of
from beamsim.structures.structure import Coupling

if TYPE_CHECKING:
    from beamsim.scenario import Scenario


def couplings_of(scenario: Scenario) -> list[Coupling]:
    """Joints, direction by direction, and the linear part of springs that are not listed in a body."""
    body = scenario.default_body
    couplings = [coupling for joint in scenario.joints for coupling in _of_joint(scenario, joint, site_of(joint, body))]
    for spring in (*scenario.springs_to_ground, *scenario.springs_between):
        site = site_of(spring, body)
        if stiffness := linear_stiffness(spring):
            couplings.append(Coupling(spring.name, site, stiffness, to_ground=isinstance(site, Place)))
    return couplings


def _of_joint(scenario: Scenario, joint: Any, site: Site) -> list[Coupling]:
    held = joint.kind in ("rigid", "hinge")
    couplings = [Coupling(joint.name, site, None if held else joint.stiffness, 0.0 if held else joint.dashpot)]
    if all(scenario.all_bodies[end.body].has_slope for end in ends_of(site)):
        rigid = joint.kind == "rigid"
        rotation = (None, 0.0) if rigid else (joint.rotational_stiffness, joint.rotational_dashpot)
        couplings.append(Coupling(joint.name, slope_of(site), *rotation))
    return couplings


def slope_of(site: Site) -> Site:
    """The same places, in the direction of the slope."""
    if isinstance(site, Link):
        return Link(replace(site.first, direction=SLOPE), replace(site.second, direction=SLOPE))
    return replace(site, direction=SLOPE)
