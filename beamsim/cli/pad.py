"""Command ``pad``: read quantities, compute the properties of a pad, print a section of a scenario."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from beamsim.analyses.pad.analysis import KnownPad, PadNumbers, option
from beamsim.analyses.pad.analysis import pad as designed
from beamsim.cli.session import print_json, show
from beamsim.errors import Problem, ScenarioError, VerdictError
from beamsim.outcomes import EXIT_RULES, exit_code
from beamsim.plots.style import amount
from beamsim.scenario import units
from beamsim.scenario.quantities import Quantity

_READ: dict[str, Quantity] = {
    "modulus": Quantity(units.PRESSURE, above=0.0),
    "shape_factor": Quantity(units.RATIO, minimum=0.0),
    "area": Quantity(units.AREA, above=0.0),
    "height": Quantity(units.LENGTH, above=0.0),
    "loss_factor": Quantity(units.RATIO, minimum=0.0),
    "frequency": Quantity(units.FREQUENCY, above=0.0),
    "stiffness": Quantity(units.STIFFNESS, above=0.0),
    "dashpot": Quantity(units.DASHPOT, minimum=0.0),
}
_SHOWN = (
    ("stiffness", "stiffness", "N/m"),
    ("dashpot", "dashpot", "N s/m"),
    ("loss factor", "loss_factor", "1"),
    ("misfit of the curve", "misfit", "N"),
)


def pad(texts: Mapping[str, str | None], curve: Mapping[str, Any], *, as_json: bool) -> None:
    """Compute stiffness and dashpot of a pad, and print a section of a scenario.

    Parameters
    ----------
    texts : quantities as text, by name.
    curve : file of a measured curve and options for reading it, by argument name.
    as_json : whether to print JSON.

    Raises
    ------
    ScenarioError
        If a text is not a valid quantity, or the scenario does not accept the results.
    VerdictError
        If the results are not reliable.
    """
    numbers = _read_numbers({name: text for name, text in texts.items() if text is not None})
    known: dict[str, Any] = {**curve, **numbers}
    found = designed(KnownPad(**known))
    _check_found(found)
    lines = list(_snubber(found))
    if as_json:
        numbers = {name: value for name, value in vars(found).items() if name != "outcome"}
        maxwell = [vars(branch) for branch in found.maxwell]
        print_json({"status": found.outcome.text, **numbers, "maxwell": maxwell, "snubber": "\n".join(lines) + "\n"})
    else:
        show(*(f"# {line}" for line in _comments(found)), *lines)
    if code := exit_code(found.outcome):
        raise VerdictError(found.outcome.text, code)


def _read_numbers(texts: Mapping[str, str]) -> dict[str, float]:
    """Values in SI units by name.

    Raises
    ------
    ScenarioError
        For every text that is not a valid quantity.
    """
    numbers, problems = {}, []
    for name, text in texts.items():
        try:
            numbers[name] = _READ[name].read(text)
        except units.UnitError as error:
            problems.append(Problem(option(name), f"= {text} {error.message}", error.remedy))
    if problems:
        raise ScenarioError(problems)
    return numbers


def _check_found(numbers: PadNumbers) -> None:
    """Check that the scenario accepts the computed stiffness and dashpot.

    Raises
    ------
    ScenarioError
        If it does not accept one of them.
    """
    for name, value in (("stiffness", numbers.stiffness), ("dashpot", numbers.dashpot)):
        try:
            _READ[name].read(value)
        except units.UnitError as error:
            what = f"= {value:g} {error.message}"
            raise ScenarioError(Problem(f"the {name} found", what, "check the numbers and their units")) from None


def _snubber(numbers: PadNumbers) -> Iterator[str]:
    """Lines of a section of a scenario."""
    yield "snubbers:"
    yield "  - name: pad"
    yield "    position: 100 %"
    yield "    side: below"
    yield "    gap: 0 mm"
    if numbers.points is None:
        yield f"    stiffness: {numbers.stiffness:.12g} N/m"
    else:
        points = ", ".join(f"[{x:.12g} m, {force:.12g} N]" for x, force in numbers.points)
        yield f"    force_deflection: [{points}]"
    if numbers.maxwell:
        branches = (
            f"{{stiffness: {b.stiffness:.12g} N/m, relaxation_time: {b.relaxation_time:.12g} s}}"
            for b in numbers.maxwell
        )
        yield f"    maxwell: [{', '.join(branches)}]"
    if numbers.dashpot > 0.0:
        yield f"    damping: {{kind: viscous, coefficient: {numbers.dashpot:.12g} N s/m}}"


def _comments(numbers: PadNumbers) -> Iterator[str]:
    """Comment lines with reliability and properties of the pad."""
    if verdict := EXIT_RULES[numbers.outcome.gravest_kind].first_line:
        yield verdict
    for label, name, unit in _SHOWN:
        value = getattr(numbers, name)
        if value is not None:
            yield f"{label}: {amount(value, unit)}"
    if numbers.maxwell:
        yield "the misfit is that of curve and branches under the measured deflection; at other frequencies:"
        for frequency, stiffness, loss in numbers.dynamic:
            yield f"  {amount(frequency, 'Hz')}: stiffness {amount(stiffness, 'N/m')}, loss factor {loss:.2g}"
        fast = numbers.stiffness + sum(branch.stiffness for branch in numbers.maxwell)
        yield f"and in an impact {amount(fast, 'N/m')}; the loop shows no more than ten times its own frequency"
    yield from numbers.remarks
    if numbers.loss_factor and not numbers.dashpot and not numbers.maxwell:
        yield "no dashpot: give --frequency, at which the pad has this loss factor"
