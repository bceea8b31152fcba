r"""How the stiffness behind a frequency depends on every number of the structure.

At a fixed frequency :math:`k = -1 / (s^T D^{-1} s)` with the dynamic stiffness :math:`D = K - \omega^2 M` and the
deflection row s of the spring's point. With the closed structure's mode scaled as :math:`v = k D^{-1} s`, fields of the
bodies apart, springs between them in D, and what joints hold as constraints :math:`G v = 0` with the forces
:math:`\mu`,

.. math:: F = 2 k\, s^T v - v^T D v - 2 \mu^T G v

is stationary in v and :math:`\mu`, so that :math:`\partial k / \partial p = \partial F / \partial p` with both as they
are: one linear solve for all parameters. The derivatives are central differences on an unchanged mesh: the form is that
of fixed fields, so that they are accurate to nine digits or so.

A spring between two parts that nothing else joins has :math:`1/k = 1/k_1 + 1/k_2`, with the stiffness
:math:`k_i` that would give part i alone the frequency.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse.linalg import spsolve

from beamsim.scenario import Scenario
from beamsim.scenario.base import Path, walk
from beamsim.scenario.parameters import replaced, side_at, value_at
from beamsim.scenario.quantities import Share
from beamsim.structures.assembly import assemble, couplings_of, snubber_site
from beamsim.structures.places import Site
from beamsim.structures.several import SeveralBodies, assemble_side_by_side
from beamsim.structures.structure import BodyStructure, Structure
from beamsim.typing import Floats

_STEP = 1e-5  # relative, of central differences


def stiffness_sensitivities(scenario: Scenario, snubber: str, omega: float) -> dict[Path, float]:
    """d ln k / d ln p by place, k being the stiffness at the snubber that makes omega a natural frequency.

    The numbers are those of the bodies that the snubber acts on, and of what joins them. What sits on the end or edge
    of a body moves with it when a side changes; the segments of a beam grow with its length.

    Parameters
    ----------
    scenario : a validated scenario.
    snubber : its name.
    omega : angular frequency, rad/s.

    Returns
    -------
    dict
        By path; numbers on which k does not depend are left out.
    """
    contact = scenario.located_snubber(snubber)
    structure = assemble(scenario, contact.bodies)
    site = snubber_site(contact)
    parts = [each.structure for each in structure.parts] or [structure]
    loaded = [_LoadedPart.of(part, site, omega) for part in parts if part.own_row(site).any()]
    total = sum(1 / part.stiffness for part in loaded)
    rates: dict[Path, float] = {}
    for path, along in _parameters(scenario, snubber, [member.body for member in structure.members]):
        up, down = (
            sum(part.form(_scaled(scenario, along, 1 + step), snubber, omega) / part.stiffness**2 for part in loaded)
            for step in (_STEP, -_STEP)
        )
        if up != down:
            rates[path] = (up - down) / (2 * _STEP * total)
    return rates


def _scaled(scenario: Scenario, places: set[Path], factor: float) -> Scenario:
    return replaced(scenario, {at: value_at(scenario, at) * factor for at in places})


@dataclass(frozen=True)
class _LoadedPart:
    """A part of a structure on which the spring acts, and its motion at the frequency."""

    bodies: SeveralBodies  # apart
    stiffness: float  # N/m, of the spring, that gives the part alone the frequency
    field: Floats  # (dofs of the bodies,) v
    forces: Floats  # of the constraints among the couplings, in their order

    @classmethod
    def of(cls, part: Structure, site: Site, omega: float) -> _LoadedPart:
        """Solve for the motion."""
        mode, scaled = _mode(part, part.own_row(site), (omega / part.frequency_scale) ** 2)
        stiffness, bodies = scaled * part.stiffness_scale, assemble_side_by_side([m.body for m in part.members])
        field = np.concatenate([member.expansion @ mode for member in part.members])
        left = stiffness * bodies.own_row(site) + omega**2 * bodies.mass_scale * (bodies.mass @ field)
        left -= bodies.stiffness_scale * (bodies.factor.T @ (bodies.factor @ field))
        for spring in part.couplings:
            if spring.stiffness:
                pull = bodies.own_row(spring.site)
                left -= spring.stiffness * (pull @ field) * pull
        held = [bodies.own_row(each.site) for each in part.couplings if each.stiffness is None]
        forces = np.linalg.lstsq(np.array(held).reshape(-1, field.size).T, left, rcond=None)[0]
        return cls(bodies, stiffness, field, np.asarray(forces, dtype=float))

    def form(self, scenario: Scenario, snubber: str, omega: float) -> float:
        """F, N/m, of the motion with other numbers in the scenario."""
        sections, v = scenario.all_bodies, self.field
        before = [member.body for member in self.bodies.members]
        bodies = assemble_side_by_side(
            [each if each.section is None else each.reassembled(sections[each.name]) for each in before]
        )
        bent = bodies.factor @ v
        total = 2 * self.stiffness * float(bodies.own_row(snubber_site(scenario.located_snubber(snubber))) @ v)
        total += omega**2 * bodies.mass_scale * float(v @ (bodies.mass @ v))
        total -= bodies.stiffness_scale * float(bent @ bent)
        forces, names = iter(self.forces), {each.name for each in before}
        for coupling in couplings_of(scenario):
            if coupling.ends[0].body in names:
                stretch = float(bodies.own_row(coupling.site) @ v)
                held = coupling.stiffness is None
                total -= 2 * next(forces) * stretch if held else (coupling.stiffness or 0.0) * stretch**2
        return total


def _parameters(scenario: Scenario, snubber: str, bodies: list[BodyStructure]) -> Iterator[tuple[Path, set[Path]]]:
    """Every number that k may depend on, and those that change with it."""
    contact = scenario.located_snubber(snubber)
    sides = {body.name: body.sides for body in bodies}
    for body in bodies:
        if body.section is None:
            continue
        base = scenario.body_path(body.name)
        for path in _numbers(scenario.all_bodies[body.name]):
            along = {(*base, *path)}
            if len(path) == 1 and path[0] in body.sides:
                along |= _at_edge(scenario, body.name, body.sides.index(str(path[0])))
                segments = getattr(scenario.all_bodies[body.name], "segments", ())
                along |= {(*base, "segments", i, key) for i, _ in enumerate(segments) for key in ("from", "to")}
            yield (*base, *path), along
    for place, path in zip(contact.item.places, contact.item.place_paths, strict=True):
        for axis in range(len(sides[place.body or contact.body])):
            number = (*contact.path, *path, "position", *((axis,) if isinstance(place.position, tuple) else ()))
            yield number, {number}
    for section in ("joints", "springs_to_ground", "springs_between"):
        for index, item in enumerate(getattr(scenario, section)):
            for key in ("stiffness", "rotational_stiffness"):
                if getattr(item, "kind", "") not in ("cubic", "piecewise_linear") and getattr(item, key, 0.0) > 0.0:
                    yield (section, index, key), {(section, index, key)}


def _at_edge(scenario: Scenario, name: str, axis: int) -> set[Path]:
    """Coordinates of what sits on the end or edge of a body."""
    edge = scenario.all_bodies[name].sides[axis]
    return {
        path
        for path in _numbers(scenario)
        if side_at(scenario, path) == (name, axis) and value_at(scenario, path) == edge
    }


def _numbers(section: Any) -> Iterator[Path]:
    """Paths of the numbers, not zero, of a section, but for the bounds of segments."""
    for path, part in walk(section):
        for key, name in type(part).keys().items():
            value: Any = getattr(part, name)
            items = {(*path, key, i): item for i, item in enumerate(value)} if isinstance(value, tuple) else {}
            for place, number in (items or {(*path, key): value}).items():
                bound = "segments" in place and place[-1] in ("from", "to")
                if isinstance(number, (float, Share)) and number not in (0.0, Share(0.0)) and not bound:
                    yield place


def _mode(model: Structure, row: Floats, squared: float) -> tuple[Floats, float]:
    """Scaled mode v and scaled stiffness k at a scaled omega^2."""
    dynamic = (model.factor.T @ model.factor - squared * model.mass).tocsc()
    x = np.asarray(spsolve(dynamic, row))
    k = -1.0 / float(row @ x)
    return k * x, k
