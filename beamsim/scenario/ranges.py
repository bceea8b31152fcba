"""Numbers that are far from plausible, and what was probably meant: one table of ranges by field.

A number is doubtful where it lies outside its range and the same number in another usual unit lies inside: 2 Hz of a
filter for a sine of 65 Hz, where 2 kHz is inside. It is taken as it is where it is written in a unit in which no other
reading is plausible: 0.002 kHz, 120 rpm. Ranges reach about thirty times beyond what is plausible. A question refuses
no case, changes no exit code and stops no study.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from beamsim.scenario import units
from beamsim.scenario.base import Path, Whole, path_text, walk
from beamsim.scenario.tree import WrittenList
from beamsim.scenario.units import Dimension, UnitError

RangeSizes = Mapping[str, Callable[[Whole, Path, Any], float | None]]
"""By `Range.beside` what a range is multiplied by, SI, of a section at a path; None where nothing is asked."""


@dataclass(frozen=True)
class Range:
    """Range of a field, and the usual units of its number."""

    sections: tuple[str, ...]  # names of classes that have the field
    key: str
    of: Dimension
    usual: tuple[str, ...]  # units in which the number may have been meant, SI first
    smallest: float  # SI, or over what stands beside it
    largest: float
    why: str  # what is wrong with the value; it may name its ratio to what stands beside it, and that
    beside: str = ""  # what the range is multiplied by
    bare: bool = False  # whether only a number without a unit is doubtful

    def question(self, value: float, size: float, written: float | str) -> str:
        """What is doubtful about a value, and what else may have been meant; empty if nothing is.

        Parameters
        ----------
        value : SI.
        size : what the range is multiplied by, SI.
        written : what was read to the value.
        """
        number, unit = units.number_and_unit(written)
        sizes = [units.size_of(name, self.of) for name in self.usual]
        if unit and (self.bare or not any(math.isclose(number * of, value, rel_tol=1e-12) for of in sizes)):
            return ""
        readings = (
            f"{number:g} {name}"
            for name, of in zip(self.usual, sizes, strict=True)
            if self.smallest * size <= number * of <= self.largest * size
        )
        meant = next(readings, "" if value != number else "another unit")
        why = self.why.format(ratio=value / size, size=size)
        return meant and f"= {number:g} {unit or self.usual[0]} {why}; was {meant} meant?"


_SOLIDS = ("Beam", "SolidSegment", "Plate")
_BODIES = ("Beam", "StiffnessBeam", "SandwichBeam", "SegmentedBeam", "Plate", "StiffnessPlate")
_HERTZ, _METRES, _SECONDS = ("Hz", "kHz"), ("m", "mm"), ("s", "ms")
RANGES = (
    Range(
        _SOLIDS, "youngs_modulus", units.PRESSURE, ("Pa", "kPa", "MPa", "GPa"), 1e8, 3e13,
        "is outside the range of structural materials",
    ),
    Range(
        _SOLIDS, "density", units.DENSITY, ("kg/m^3", "g/cm^3"), 25.0, 7e5, "is outside the range of solids"
    ),
    Range(_BODIES, "length", units.LENGTH, _METRES, 0.0, 100.0, "is long for a structure"),
    Range(_BODIES, "width", units.LENGTH, _METRES, 0.0, 100.0, "is wide for a structure"),
    Range((*_SOLIDS, "StiffnessPlate"), "thickness", units.LENGTH, _METRES, 0.0, 3.0, "is thick for a structure"),
    Range(
        ("Run",), "low_pass", units.FREQUENCY, _HERTZ, 1.0, math.inf, "lies below the excitation, {size:.4g} Hz",
        "excitation",
    ),
    Range(
        ("PsdPoint",), "density", units.ACCELERATION_PSD, ("m^2/s^3", "g^2/Hz"), 1.0 / 30.0, math.inf,
        "is low for the highest density of a test", "highest density", bare=True,
    ),
    Range(
        ("HalfSine", "Sawtooth", "Trapezoid"), "duration", units.TIME, _SECONDS, 0.0, 100.0,
        "is {ratio:.3g} periods of the first mode", "period",
    ),
    Range(
        ("Snubber", "LinkSnubber"), "stiffness", units.STIFFNESS, ("N/m", "kN/m"), 1.0 / 30.0, math.inf,
        "is {ratio:.2g} of the static stiffness of the structure there, {size:.4g} N/m", "structure",
    ),
)  # fmt: skip
_OF_SECTION: dict[str, list[Range]] = {}
for _range in RANGES:
    for _name in _range.sections:
        _OF_SECTION.setdefault(_name, []).append(_range)
ASKS = "meant?"
"""In warnings that ask for another reading, which are printed on the first screen."""
FARTHEST_MODE = 100.0
"""Frequency of the first mode, over the highest of the excitation, above which the case is probably another one."""
LARGEST_MARGIN = 100.0
"""A limit over the value that it limits, above which one of them is probably another one."""


def _lowest_excited_hz(scenario: Whole, _: Path, __: Any) -> float | None:
    """Frequency below which the excitation has nothing, Hz; of a pulse a thirtieth of its highest."""
    lowest: list[float] = []
    for _path, part in scenario.excitation.items:
        ends = [point[0] for point in getattr(part, "table", ())] or list(part.frequencies_hz)
        ends += part.ends if part.kind == "swept_sine" else [part.highest_frequency_hz / 30.0] * part.shock
        lowest += [min(ends)] if ends else []
    return min(lowest, default=0.0) or None


def _highest_density(scenario: Whole, path: Path, part: Any) -> float | None:
    """1 for the first point with the highest density of an acceleration; nothing is asked of the others."""
    owner = next(item for at, item in scenario.excitation.items if ("excitation", *at) == path[: len(at) + 1])
    densities = [point.density or 0.0 for point in owner.psd]
    first = path[-1] == densities.index(max(densities))
    return 1.0 if first and owner.quantity == "acceleration" else None


SIZES: RangeSizes = {
    "": lambda *_: 1.0,
    "excitation": _lowest_excited_hz,
    "highest density": _highest_density,
}
"""What is known of a scenario without its model."""


def questions(scenario: Whole, sizes: RangeSizes) -> Iterator[str]:
    """A sentence for each written number that is doubtful, with both readings.

    Parameters
    ----------
    scenario : with what was written; of what comes from elsewhere nothing is asked.
    sizes : of the ranges that are looked at.

    Yields
    ------
    str
        A question that ends with ``meant?``.
    """
    for at, part in walk(scenario) if scenario.as_written is not None else ():
        for each in _OF_SECTION.get(type(part).__name__, ()):
            value = getattr(part, each.key) if each.beside in sizes and each.key in part.model_fields_set else None
            size = None if value is None else sizes[each.beside](scenario, at, part)
            if value is not None and size is not None and not each.smallest * size <= value <= each.largest * size:
                written = _written(scenario, (*at, each.key), value, each.of)
                if text := "" if written is None else each.question(value, size, written):
                    yield f"{path_text((*at, each.key))} {text}"


def _written(scenario: Whole, path: Path, value: float, of: Dimension) -> float | str | None:
    """How a value was written: at its path, or, of a case of a study, among what varies; None where neither says it."""
    root: Any = scenario.as_written
    here = root
    for key in path:
        inside = key in here if isinstance(here, dict) else isinstance(here, list) and key in range(len(here))
        here = here[key] if inside else None
    for text in (here, *_numbers(root.get("vary")), *_numbers(root.get("optimise"))):
        try:
            if units.read_quantity(text, of) == value:
                return text  # type: ignore[no-any-return]
        except UnitError:
            continue
    return None


def _numbers(written: Any) -> Iterator[Any]:
    """All numbers and texts in what was written, but for arrays that come from Python."""
    if isinstance(written, dict):
        written = list(written.values())
    if isinstance(written, list):
        for item in () if isinstance(written, WrittenList) and written.of_python else written:
            yield from _numbers(item)
    else:
        yield written
