"""What ``pad`` does: quantities as texts to numbers, numbers of a pad, and the section of a scenario."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from beamsim.analyses.pad import PadInput, PadNumbers
from beamsim.analyses.pad import pad as designed
from beamsim.cli.printing import print_json
from beamsim.errors import Problem, ScenarioError
from beamsim.plots.style import amount
from beamsim.scenario import units
from beamsim.scenario.quantities import FieldType, PositionType, Quantity, TextType, Whole

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


_SHOWN = (
    ("stiffness", "stiffness", "N/m"),
    ("dashpot", "dashpot", "N s/m"),
    ("Young's modulus", "modulus", "Pa"),
    ("misfit of the curve", "misfit", "N"),
    ("restitution of the measured loop", "loop_restitution", "1"),
    ("damping ratio of the mass", "damping_ratio", "1"),
    ("restitution", "restitution", "1"),
    ("time in contact", "contact_time", "s"),
    ("largest penetration", "penetration", "m"),
    ("peak force", "peak_force", "N"),
    ("largest strain", "strain", "1"),
)


def pad(
    texts: Mapping[str, str | None], snubber: Mapping[str, Any], curve: Path | None, segments: int, *, as_json: bool
) -> None:
    """Find stiffness and damping of a pad, and print the section of a scenario.

    Parameters
    ----------
    texts : quantities as they were given, by name.
    snubber : name, position, on_mass (instead of the position where it is a number) and law.
    curve, segments : of a measured curve.
    as_json : whether to print JSON.

    Raises
    ------
    ScenarioError
        With every text that is no such quantity, or if a scenario does not take what was found.
    """
    at = "position" if snubber["on_mass"] is None else "on_mass"
    _check_written({"name": snubber["name"], at: snubber[at]})
    numbers = _read_numbers({key: text for key, text in texts.items() if text is not None})
    result = designed(PadInput(curve=curve, segments=segments, law=snubber["law"], **numbers))
    _check_found(result)
    place = f"{at.removeprefix('on_')}: {snubber[at]}"
    lines = list(_snubber(result, snubber["name"], place))
    if as_json:
        print_json({**vars(result), "snubber": "\n".join(lines) + "\n"})
        return
    print(*(f"# {line}" for line in _comments(result)), *lines, sep="\n")


def _read_numbers(texts: Mapping[str, str]) -> dict[str, float]:
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


def _check_written(texts: Mapping[str, str | int]) -> None:
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


def _check_found(pad: PadNumbers) -> None:
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


def _snubber(pad: PadNumbers, name: str, place: str) -> Iterator[str]:
    """The section of a scenario."""
    yield "snubbers:"
    yield f"  - name: {name}"
    yield f"    {place}"
    yield "    side: below"
    yield "    gap: 0 mm"
    if pad.points is None:
        yield f"    stiffness: {pad.stiffness:.12g}  # N/m"
    else:
        points = ", ".join(f"[{x:.12g}, {force:.12g}]" for x, force in pad.points)
        yield f"    force_deflection: [{points}]  # m, N"
    if pad.dashpot > 0.0:
        yield f"    damping: {{kind: viscous, coefficient: {pad.dashpot:.12g}}}  # N s/m"
    yield f"    law: {pad.law}"


def _comments(pad: PadNumbers) -> Iterator[str]:
    """What is known of the pad, a line each."""
    for label, name, unit in _SHOWN:
        value = getattr(pad, name)
        if value is not None:
            yield f"{label}: {amount(value, unit)}"
    yield from pad.notes
