"""How the stiffness behind a frequency depends on the numbers of a plate; see `beamsim.structures.point_sensitivity`.

Derivatives of the quadratic form v^T (K - omega^2 M) v are central differences on an unchanged mesh: the form is that
of a fixed field, so that they are accurate to nine digits or so.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from beamsim.scenario.base import walk
from beamsim.scenario.parameters import value_at, with_values
from beamsim.structures.places import SpringEnd
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.scenario.plate import PlateBody
    from beamsim.structures.plate_model import PlateModel
    from beamsim.structures.structure import Path

_STEP = 1e-6  # relative
_NO_STIFFNESS = ("elements", "grading", "damping", "section_modulus")


def plate_sensitivities(
    structure: PlateModel,
    assemble: Callable[..., PlateModel],
    path: Path,
    ends: Sequence[SpringEnd],
    v: Floats,
    k: float,
    squared: float,
) -> dict[Path, float]:
    """d ln k / d ln p by path; what sits on an edge moves with it when a side changes.

    Parameters
    ----------
    assemble : of a plate, on a mesh.
    path : of the plate in the scenario.
    ends : places of the spring that are on the plate.
    v : (N,) mode, scaled to a stretch of -1 at the spring.
    k, squared : scaled stiffness, scaled omega^2.
    """
    plate = structure.plate
    physical = k * structure.stiffness_scale
    omega2 = squared * structure.frequency_scale**2

    def minus_form(changed: PlateBody, moved: Sequence[SpringEnd]) -> float:
        """-v^T D v + 2 k s^T v, N/m."""
        model = assemble(changed, structure.name, mesh=structure.mesh)
        bent = model.factor @ v
        form = model.stiffness_scale * float(bent @ bent)
        form -= omega2 * model.mass_scale * float(v @ (model.mass @ v))
        return 2 * physical * sum(end.sign * float(model.row(end.place) @ v) for end in moved) - form

    def rate(step_of: Callable[[float], tuple[PlateBody, Sequence[SpringEnd]]]) -> float:
        return (minus_form(*step_of(1 + _STEP)) - minus_form(*step_of(1 - _STEP))) / (2 * _STEP * physical)

    rates: dict[Path, float] = {}
    for place in _numbers(plate):

        def changed(factor: float, place: Path = place) -> tuple[PlateBody, Sequence[SpringEnd]]:
            value = float(value_at(plate, place))
            numbers = {place: value * factor}
            if place in (("length",), ("width",)):
                axis = ("length", "width").index(str(place[0]))
                numbers |= {
                    at: value * factor for at in _points(plate) if at[-1] == axis and value_at(plate, at) == value
                }
                return with_values(plate, numbers), [_carried(end, axis, value, factor) for end in ends]
            return with_values(plate, numbers), ends

        rates[(*path, *place)] = rate(changed)
    for number, end in enumerate(ends):
        for axis in (0, 1):

            def moved(factor: float, number: int = number, axis: int = axis) -> tuple[PlateBody, Sequence[SpringEnd]]:
                return plate, [_scaled(e, axis, factor) if i == number else e for i, e in enumerate(ends)]

            rates[(*end.path, "position", axis)] = rate(moved)
    return {place: value for place, value in rates.items() if value != 0.0}


def _numbers(plate: PlateBody) -> Iterator[Path]:
    """Paths of the numbers, not zero, that matrices depend on."""
    for path, part in walk(plate):
        for key, name in type(part).keys().items():
            if (path or (key,))[0] in _NO_STIFFNESS:
                continue
            value: Any = getattr(part, name)
            items = [((*path, key), value)]
            if isinstance(value, tuple) and all(isinstance(item, float) for item in value):
                items = [((*path, key, index), item) for index, item in enumerate(value)]
            yield from (place for place, number in items if isinstance(number, float) and number != 0.0)


def _points(plate: PlateBody) -> list[Path]:
    return [place for place in _numbers(plate) if isinstance(place[-1], int)]


def _scaled(end: SpringEnd, axis: int, factor: float) -> SpringEnd:
    point = [end.place.coordinate, end.place.across or 0.0]
    point[axis] *= factor
    return replace(end, place=replace(end.place, point=(point[0], point[1])))


def _carried(end: SpringEnd, axis: int, value: float, factor: float) -> SpringEnd:
    """The end of a spring on an edge that moves."""
    at = (end.place.coordinate, end.place.across)[axis]
    return _scaled(end, axis, factor) if at == value else end
