"""What ``beamsim pad`` reads on its command line, and what a scenario takes of the snubber that it prints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from beamsim.errors import Problem, ScenarioError
from beamsim.scenario import units
from beamsim.scenario.quantities import FieldType, PositionType, Quantity, TextType, Whole

if TYPE_CHECKING:
    from beamsim.analyses.pad.analysis import PadNumbers

_RATIO = replace(units.NUMBER, name="ratio")
_READ: dict[str, Quantity] = {
    "modulus": Quantity(units.PRESSURE, above=0.0),
    "shape_factor": Quantity(_RATIO, minimum=0.0),
    "area": Quantity(units.AREA, above=0.0),
    "height": Quantity(units.LENGTH, above=0.0),
    "factor": Quantity(_RATIO, above=0.0),
    "bulk_modulus": Quantity(units.PRESSURE, above=0.0),
    "stiffness": Quantity(units.STIFFNESS, above=0.0),
    "contact_time": Quantity(units.TIME, above=0.0),
    "restitution": Quantity(replace(_RATIO, example="0.6"), minimum=1e-6, maximum=1.0),
    "dashpot": Quantity(units.DASHPOT, minimum=0.0),
    "loss_factor": Quantity(_RATIO, minimum=0.0),
    "frequency": Quantity(units.FREQUENCY, above=0.0),
    "mass": Quantity(units.MASS, above=0.0),
    "speed": Quantity(units.VELOCITY, above=0.0),
}
_OPTIONS = {"factor": "--kappa"}
_WRITTEN: dict[str, FieldType] = {
    "name": TextType(name=True),
    "position": PositionType(replace(units.LENGTH, name="position", example="100 %"), minimum=0.0),
    "on_mass": Whole(1),
}


def read_numbers(texts: Mapping[str, str]) -> dict[str, float]:
    """Values in SI units by name.

    Raises
    ------
    ScenarioError
        With every text that is no such quantity.
    """
    numbers, problems = {}, []
    for name, text in texts.items():
        try:
            numbers[name] = _READ[name].read(_number(text))
        except units.UnitError as error:
            problems.append(_problem(name, text, error))
    if problems:
        raise ScenarioError(problems)
    return numbers


def check_written(texts: Mapping[str, str | int]) -> None:
    """Check name and place of the snubber, which are written as they are.

    Raises
    ------
    ScenarioError
        With everything that a scenario does not take.
    """
    problems = []
    for name, text in texts.items():
        try:
            _WRITTEN[name].read(_number(text) if name == "position" else text)
        except units.UnitError as error:
            problems.append(_problem(name, text, error))
    if problems:
        raise ScenarioError(problems)


def check_found(pad: PadNumbers) -> None:
    """Check the stiffness and the dashpot that were found, which follow from numbers in range and may lie outside.

    Raises
    ------
    ScenarioError
        If a scenario does not take one of them.
    """
    for name, value in (("stiffness", pad.stiffness), ("dashpot", pad.dashpot)):
        try:
            _READ[name].read(value)
        except units.UnitError as error:
            found = Problem(f"the {name} found", f"= {value:g} {error.message}", "check the numbers and their units")
            raise ScenarioError(found) from None


def _problem(name: str, text: str | int, error: units.UnitError) -> Problem:
    option = _OPTIONS.get(name, f"--{name.replace('_', '-')}")
    return Problem(option, f"= {text} {error.message}", error.remedy)


def _number(text: str | int) -> str | float:
    """A bare number as such."""
    try:
        return float(text)
    except ValueError:
        return str(text)
