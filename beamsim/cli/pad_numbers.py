"""Numbers with units on the command line of ``beamsim pad``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from beamsim.errors import Problem, ScenarioError
from beamsim.scenario import units
from beamsim.scenario.quantities import Between, Quantity

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
    "restitution": Between(replace(_RATIO, example="0.6"), low=1e-6, high=1.0, closed=True),
    "dashpot": Quantity(units.DASHPOT, minimum=0.0),
    "loss_factor": Quantity(_RATIO, minimum=0.0),
    "frequency": Quantity(units.FREQUENCY, above=0.0),
    "mass": Quantity(units.MASS, above=0.0),
    "speed": Quantity(units.VELOCITY, above=0.0),
}
_OPTIONS = {"factor": "--kappa"}


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
            option = _OPTIONS.get(name, f"--{name.replace('_', '-')}")
            problems.append(Problem(option, f"= {text} {error.message}", error.remedy))
    if problems:
        raise ScenarioError(problems)
    return numbers


def _number(text: str) -> str | float:
    """A bare number as such."""
    try:
        return float(text)
    except ValueError:
        return text
