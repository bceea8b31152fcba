r"""How the stiffness behind a frequency depends on every number of the structure.

At a fixed frequency :math:`k = -1 / (s^T D^{-1} s)` with the dynamic stiffness :math:`D = K - \omega^2 M` and the
deflection row s of the spring's point. With the closed structure's mode scaled as :math:`v = k D^{-1} s`,

.. math:: \frac{\partial k}{\partial p} = -v^T \frac{\partial D}{\partial p} v + 2 k\, \frac{\partial s}{\partial p} v,

one linear solve for all parameters. The derivatives are central differences on an unchanged mesh: the form is that of a
fixed field, so that they are accurate to nine digits or so.

A spring between two parts that nothing else joins has :math:`1/k = 1/k_1 + 1/k_2`, with the stiffness
:math:`k_i` that would give part i alone the frequency.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.scenario.base import walk
from beamsim.scenario.parameters import value_at, with_values
from beamsim.structures.assembly import assemble, snubber_site
from beamsim.structures.places import SpringEnd, spring_ends
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.scenario import Scenario
    from beamsim.structures.structure import BodyStructure, Path, Structure


_STEP = 1e-5  # relative, of central differences


def stiffness_sensitivities(scenario: Scenario, snubber: str, omega: float) -> dict[Path, float]:
    """d ln k / d ln p by place, k being the stiffness at the snubber that makes omega a natural frequency.

    The numbers are those of the bodies that the snubber acts on. What sits on the end or edge of a body moves with it
    when a side changes; the segments of a beam grow with its length.

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
    ends = spring_ends(snubber_site(contact), [(*contact.path, *path) for path in contact.item.place_paths])
    structure = assemble(scenario, contact.bodies)
    rates: dict[Path, float] = {}
    total = 0.0
    for part in [each.structure for each in structure.parts] or [structure]:
        row = _row(part, ends)
        if not row.any():  # a support: the part adds no compliance
            continue
        v, k = _mode(part, row, (omega / part.frequency_scale) ** 2)
        physical = k * part.stiffness_scale
        total += 1.0 / physical
        for member in part.members:
            body, field = member.body, member.field(v)
            for path, changed in _changes(body, scenario.body_path(body.name), _on(ends, [body.name])):
                up, down = (_form(body, *changed(1 + sign * _STEP), field, physical, omega) for sign in (1, -1))
                if up != down:
                    rates[path] = (up - down) / (2 * _STEP * physical**2)
    rates = {path: rate / total for path, rate in rates.items()}
    if structure.couplings:
        # Lengths and positions move joints and their slopes: their rates are differences, as are those of joints.
        geometric = [path for path in rates if path[-1] in ("length", "position")]
        rates |= {path: _difference(scenario, snubber, omega, path) for path in (*geometric, *_joint_numbers(scenario))}
    return rates


def _form(body: BodyStructure, section: Any, ends: Sequence[SpringEnd], v: Floats, k: float, omega: float) -> float:
    """2 k s^T v - v^T D v, N/m, of a field v (N,) of a body with other numbers and other ends of the spring on it."""
    model = body.reassembled(section)
    bent = model.factor @ v
    strain = model.stiffness_scale * float(bent @ bent)
    kinetic = omega**2 * model.mass_scale * float(v @ (model.mass @ v))
    return 2 * k * sum(end.sign * float(model.row(end.place) @ v) for end in ends) - strain + kinetic


Change = Callable[[float], tuple[Any, Sequence[SpringEnd]]]  # of a factor: the section of the body and the ends


def _changes(body: BodyStructure, path: Path, ends: Sequence[SpringEnd]) -> Iterator[tuple[Path, Change]]:
    """Every number of a body, which is at a path of the scenario, and of the places of the spring on it."""
    section = body.section
    for place in _numbers(section):

        def changed(factor: float, place: Path = place) -> tuple[Any, Sequence[SpringEnd]]:
            value = value_at(section, place)
            along, moved = {place}, ends
            if len(place) == 1 and place[0] in body.sides:
                axis = body.sides.index(str(place[0]))
                on_edge = [at for at in _numbers(section) if _axis(at) == axis and value_at(section, at) == value]
                along |= {*on_edge, *_bounds(section)}
                moved = [_moved(end, axis, factor) if end.coordinates[axis] == value else end for end in ends]
            return with_values(section, {at: value_at(section, at) * factor for at in along}), moved

        yield (*path, *place), changed
    for number, end in enumerate(ends):
        for axis in range(len(body.sides)):

            def moved(factor: float, number: int = number, axis: int = axis) -> tuple[Any, Sequence[SpringEnd]]:
                return section, [_moved(e, axis, factor) if i == number else e for i, e in enumerate(ends)]

            yield (*end.path, "position", *((axis,) if isinstance(end.place.point, tuple) else ())), moved


def _numbers(section: Any) -> Iterator[Path]:
    """Paths of the numbers, not zero, of a body; but for the bounds of its segments."""
    for path, part in walk(section):
        for key, name in type(part).keys().items():
            value: Any = getattr(part, name)
            items = {(*path, key, i): item for i, item in enumerate(value)} if isinstance(value, tuple) else {}
            for place, number in (items or {(*path, key): value}).items():
                if isinstance(number, float) and number != 0.0 and not _is_bound(place):
                    yield place


def _is_bound(place: Path) -> bool:
    return place[0] == "segments" and place[-1] in ("from", "to")


def _bounds(section: Any) -> list[Path]:
    return [("segments", i, key) for i, _ in enumerate(getattr(section, "segments", ())) for key in ("from", "to")]


def _axis(place: Path) -> int | None:
    """Which coordinate of a point a number is; None where it is none."""
    if place[-1] == "position":
        return 0
    return place[-1] if isinstance(place[-1], int) and place[-2] in ("position", "from", "to") else None


def _moved(end: SpringEnd, axis: int, factor: float) -> SpringEnd:
    """The end of a spring with a coordinate times a factor."""
    point = [x * factor if i == axis else x for i, x in enumerate(end.coordinates)]
    return replace(end, place=replace(end.place, point=point[0] if len(point) == 1 else (point[0], point[1])))


def _on(ends: Sequence[SpringEnd], names: Sequence[str]) -> list[SpringEnd]:
    return [end for end in ends if end.place.body in names]


def _row(part: Structure, ends: Sequence[SpringEnd]) -> Floats:
    """(N,) stretch of the spring for a unit of each degree of freedom of a part."""
    on_part = _on(ends, [member.body.name for member in part.members])
    return np.asarray(sum((end.sign * part.row(end.place) for end in on_part), np.zeros(part.size)))


def _joint_numbers(scenario: Scenario) -> list[Path]:
    """Stiffnesses of joints and of linear springs between points."""
    return [
        (section, index, key)
        for section in ("joints", "springs_to_ground", "springs_between")
        for index, item in enumerate(getattr(scenario, section))
        for key in ("stiffness", "rotational_stiffness")
        if getattr(item, "kind", "") not in ("cubic", "piecewise_linear") and getattr(item, key, 0.0) > 0.0
    ]


def _difference(scenario: Scenario, snubber: str, omega: float, path: Path) -> float:
    """d ln k / d ln p by a central difference; what sits on a beam's end moves with it."""
    value = float(value_at(scenario, path))
    moved = {path: value}
    if path[-1] == "length":
        name = next(name for name in scenario.all_bodies if scenario.body_path(name) == path[:-1])
        moved |= dict.fromkeys(_on_end(scenario, name, value), value)
    stiffness = [
        _stiffness(with_values(scenario, {at: x * (1.0 + step) for at, x in moved.items()}), snubber, omega)
        for step in (_STEP, -_STEP)
    ]
    return float(np.log(stiffness[0] / stiffness[1]) / (2 * _STEP))


def _on_end(scenario: Scenario, name: str, length: float) -> Iterator[Path]:
    """Positions on the right end of a beam that belong to the structure or the snubbers."""
    for path, part in walk(scenario):
        if path[:1] not in (("joints",), ("springs_to_ground",), ("springs_between",), ("snubbers",), ("bodies",)):
            continue
        body = path[1] if path[0] == "bodies" else getattr(part, "body", None) or scenario.default_body
        if body == name and getattr(part, "position", None) == length:
            yield (*path, "position")


def _stiffness(scenario: Scenario, snubber: str, omega: float) -> float:
    """The stiffness, N/m, at the snubber that makes omega a natural frequency."""
    contact = scenario.located_snubber(snubber)
    ends = spring_ends(snubber_site(contact), [(*contact.path, *path) for path in contact.item.place_paths])
    structure = assemble(scenario, contact.bodies)
    compliance = 0.0
    for part in [each.structure for each in structure.parts] or [structure]:
        row = _row(part, ends)
        if row.any():
            compliance += 1.0 / (_mode(part, row, (omega / part.frequency_scale) ** 2)[1] * part.stiffness_scale)
    return 1.0 / compliance


def _mode(model: Structure, row: Floats, squared: float) -> tuple[Floats, float]:
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
