"""Numbers with a tolerance about their value in every case of a study."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from pydantic_core import PydanticCustomError

from beamsim.errors import Problem
from beamsim.scenario.base import path_text
from beamsim.scenario.designs import (
    Path,
    Sobol,
    Tolerances,
    Varied,
    VariedParameter,
    parameter_problems,
    resolve_parameter,
    varied_parameters,
)

_PARAMETERS: Path = ("vary", "tolerances", "parameters")


@dataclass(frozen=True)
class ToleratedParameter:
    """A number with a tolerance, in SI units."""

    number: VariedParameter  # about its value in the scenario
    share: float | None  # the tolerance as a share of the value, where it is given in percent
    varied: int | None  # which of the varied numbers it is; None for one that only has a tolerance

    def reach(self, value: float) -> float:
        """Largest deviation from a value."""
        return 0.5 * (self.number.high - self.number.low) if self.share is None else self.share * abs(value)


def tolerances_of(scenario: Varied) -> Tolerances | None:
    """The tolerances of a study."""
    return None if scenario.vary is None or isinstance(scenario.vary, Sobol) else scenario.vary.tolerances


def tolerated_parameters(scenario: Varied) -> tuple[ToleratedParameter, ...]:
    """The numbers with a tolerance of a scenario that passed its checks; none without tolerances."""
    tolerances = tolerances_of(scenario)
    if tolerances is None:
        return ()
    varied = {frozenset(parameter.places): k for k, parameter in enumerate(varied_parameters(scenario))}
    parameters = []
    for asked in tolerances.parameters:
        number = resolve_parameter(scenario.whole, asked)
        share = None
        if isinstance(asked.tolerance, str) and asked.tolerance.rstrip().endswith("%"):
            share = 0.5 * (number.high - number.low) / abs(float(number.nominal))
        parameters.append(ToleratedParameter(number, share, varied.get(frozenset(number.places))))
    return tuple(parameters)


def tolerance_problems(scenario: Varied) -> Iterator[Problem]:
    """Unknown paths, deviations that a field does not accept, whole numbers, numbers that are varied only in part."""
    tolerances = tolerances_of(scenario)
    if tolerances is None:
        return
    problems = list(parameter_problems(scenario.whole, tolerances.parameters, _PARAMETERS))
    yield from problems
    try:
        varied = varied_parameters(scenario)
    except PydanticCustomError:
        return  # reported where it is varied
    if problems:
        return
    for k, asked in enumerate(tolerances.parameters):
        number = resolve_parameter(scenario.whole, asked)
        at = path_text((*_PARAMETERS, k, "path"))
        if number.whole:
            yield Problem(at, f"= {asked.path} is a whole number, which has no tolerance", "vary it: values: [...]")
        yield from _partly_varied(at, number, varied)


def _partly_varied(at: str, number: VariedParameter, varied: tuple[VariedParameter, ...]) -> Iterator[Problem]:
    places: set[Any] = set(number.places)
    for other in varied:
        if places & set(other.places) and places != set(other.places):
            yield Problem(
                at,
                f"= {number.path} is varied in part, as {other.path}",
                f"write the path as it is varied: {other.path}, with the same `also`",
            )
