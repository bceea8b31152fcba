"""Numeric fields of the schema, where shipped cases have them, and numbers at the ends of their ranges."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import yaml
from shipped import LOADER, PATHS, config_path, shipped

from beamsim.scenario import Scenario, load_scenario, units
from beamsim.scenario.base import Schema, as_plain_data, nested_annotations, walk
from beamsim.scenario.quantities import Bounded, FieldType, RateType, WholeNumber

REFUSALS = Path(__file__).parents[1] / "data" / "refusals.yaml"
_BASE = {"applied_to": "base", "level": "10 g"}
_PULSE = {**_BASE, "time": "1 ms", "duration": "10 ms"}
_RANGE = {"from": "20 Hz", "to": "40 Hz"}
_SWEPT = {"kind": "swept_sine", **_RANGE, "rate": "2 oct/min"}
MORE: dict[str, tuple[str, dict[str, Any]]] = {
    "mode": ("one_sided_65hz", {"run.start": {"mode": 1, "amplitude": "1 mm"}}),
    "fatigue": (
        "one_sided_65hz",
        {"run.fatigue": {"stress_range": "71 MPa", "cycles": 2e6, "exponent": 5, "endurance_limit": "20 MPa"}},
    ),
    "swept input": (
        "one_sided_65hz",
        {"excitation": {**_BASE, **_SWEPT, "phase": "0 deg"}},
    ),
    "sawtooth": ("one_sided_65hz", {"excitation": {"kind": "sawtooth", **_PULSE}}),
    "trapezoid": ("one_sided_65hz", {"excitation": {"kind": "trapezoid", **_PULSE, "rise": "1 ms", "fall": "1 ms"}}),
    "notches": (
        "one_sided_65hz",
        {"sweep": {**_SWEPT, "notches": [{"from": "30 Hz", "to": "32 Hz", "level": "0.1 g"}]}},
    ),
    "profile": (
        "one_sided_65hz",
        {"sweep": {**_SWEPT, "profile": [{"frequency": "20 Hz", "level": "1 g"}]}},
    ),
    "phases": ("coexisting_motions", {"sweep.starts": {"kind": "phases", "number": 10}}),
    "history": ("coexisting_motions", {"sweep.starts": {"kind": "history", "number": 10, **_RANGE, "rate": "1 Hz/s"}}),
    "base pulse": ("coexisting_motions", {"sweep.disturbances": [{"kind": "base_pulse", "to": "0.5 m/s"}]}),
    "mode over frequency": (
        "nnm_first",
        {"nnm": {"mode": 1, "continue_in": {"kind": "frequency", "from": "52.4 Hz", "to": "60 Hz"}}},
    ),
    "viscous damping": ("one_sided_65hz", {"beam.damping": {"kind": "viscous", "coefficient": 3}}),
    "sample of uncertainties": (
        "identify_snubber",
        {
            "identify_stiffness.monte_carlo": {"samples": 1000, "seed": 1},
            "identify_stiffness.parameter_uncertainty": [{"parameter": "beam.thickness", "uncertainty": "1 %"}],
        },
    ),
}
"""By name a shipped case and changes of it, for sections that no shipped case has."""
JUST = 1e-6  # relative distance from the end of a range


@dataclass(frozen=True)
class Field:
    """A field that takes a number."""

    section: type[Schema]
    key: str
    of: FieldType
    many: bool  # whether it takes a list

    @property
    def name(self) -> str:
        """Class and key."""
        return f"{self.section.__name__}.{self.key}"

    @property
    def ends(self) -> tuple[list[Any], list[Any]]:
        """Numbers just inside and just outside the range."""
        if isinstance(self.of, WholeNumber):
            return [self.of.minimum, self.of.maximum], [self.of.minimum - 1, self.of.maximum + 1]
        if isinstance(self.of, RateType):
            low, high = units.OCTAVES_PER_TIME.smallest, units.OCTAVES_PER_TIME.largest
            inside, outside = [low, high], [0.9 * low, 1.1 * high]
            return [f"{x!r} oct/s" for x in inside], [f"{x!r} oct/s" for x in outside]
        assert isinstance(self.of, Bounded)
        return ends_of(self.of)


def ends_of(of: Bounded) -> tuple[list[float], list[float]]:
    """Numbers just inside and just outside the bounds of a field, within the range of its dimension."""
    smallest, largest = of.range

    def beyond(end: float, way: int) -> float:
        return end + way * max(JUST * abs(end), smallest)

    inside, outside = [], []
    for bound, strict, way in ((of.minimum, of.above, -1), (of.maximum, of.below, 1)):
        if bound is not None and abs(bound) <= largest:
            inside.append(bound)
            outside.append(beyond(bound, way))
        elif strict is not None:
            inside.append(beyond(strict, -way))
            outside.append(strict)
        else:
            inside.append(way * largest)
            outside.append(way * largest * (1.0 + JUST))
    if of.minimum in (None, 0.0) and of.above in (None, 0.0) and (of.maximum is None or of.maximum > smallest):
        inside.append(smallest)
        outside.append(smallest * (1.0 - JUST))
    return inside, outside


@cache
def fields_of(section: type[Schema]) -> tuple[Field, ...]:
    """The fields of a section that take numbers, whether or not they may be left out."""
    found = []
    for key, name in section.keys().items():
        field = section.model_fields[name]
        parts = [*field.metadata, *nested_annotations(field.annotation)]
        numeric = [each for each in parts if isinstance(each, (Bounded, WholeNumber, RateType))]
        if numeric and not any(isinstance(each, type) and issubclass(each, Schema) for each in parts):
            several = any(each is tuple or "tuple" in str(each)[:5] for each in parts)
            found.append(Field(section, key, numeric[0], several))
    return tuple(found)


@cache
def sections() -> tuple[type[Schema], ...]:
    """All classes of sections that a scenario may have."""
    found: dict[type[Schema], None] = {}
    open_: list[type[Schema]] = [Scenario]
    while open_:
        section = open_.pop()
        if section in found:
            continue
        found[section] = None
        for field in section.model_fields.values():
            parts = nested_annotations(field.annotation)
            open_ += [each for each in parts if isinstance(each, type) and issubclass(each, Schema)]
    return tuple(found)


@cache
def cases() -> dict[str, Scenario]:
    """The shipped cases, and those of `tests/data/refusals.yaml` and `MORE`, which have what these lack."""
    of_refusals = {
        group["about"]: load_scenario(group["case"])
        for group in yaml.load(REFUSALS.read_text(encoding="utf-8"), LOADER)
        if isinstance(group["case"], dict) and "extends" not in group["case"]
    }
    more = {name: load_scenario(config_path(case), changes) for name, (case, changes) in MORE.items()}
    return {path.stem: shipped(path) for path in PATHS} | of_refusals | more


@cache
def places() -> dict[Field, tuple[str, tuple[Any, ...]]]:
    """Of every numeric field whose section a case has, that case and the path: one with a value if there is one."""
    written: dict[Field, tuple[str, tuple[Any, ...]]] = {}
    missing: dict[Field, tuple[str, tuple[Any, ...]]] = {}
    for name, case in cases().items():
        for path, part in walk(case):
            for field in fields_of(type(part)):
                value = as_plain_data(part).get(field.key)
                number = value[0] if isinstance(value, list) and value else value
                holds = isinstance(number, (int, float, str))
                (written if holds else missing).setdefault(field, (name, (*path, field.key)))
    return {**missing, **written}


def with_number(data: Any, path: tuple[Any, ...], number: Any) -> Any:
    """A copy of plain data with another number at a path, the first of a list where there is one."""
    if not path:
        return [number, *data[1:]] if isinstance(data, list) and data else number
    copy = dict(data) if isinstance(data, dict) else list(data)
    held = data.get(path[0]) if isinstance(data, dict) else data[path[0]]
    copy[path[0]] = with_number(held, path[1:], number)
    return copy
