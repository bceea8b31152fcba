"""Time and frequency axes of measured records: their unit, and that they increase."""

from __future__ import annotations

import numpy as np

from beamsim.scenario import units
from beamsim.typing import Complexes, Floats


class AxisError(Exception):
    """A fault of a record; the message goes on from the name of the file or channel, the remedy stands for itself."""

    def __init__(self, message: str, remedy: str) -> None:
        super().__init__(message)
        self.message, self.remedy = message, remedy


def axis_name(of_frequency: bool) -> str:
    """What is measured along an axis."""
    return "frequency" if of_frequency else "time"


def without_unit(of_frequency: bool) -> str:
    """The message about a file that does not say in which unit its axis is."""
    return f"states no unit of its {'frequencies' if of_frequency else 'times'}"


def axis_factor(unit: str, key: str, *, of_frequency: bool) -> float:
    """Seconds (Hz of a frequency axis) in one of the unit of an axis.

    Parameters
    ----------
    unit : of the axis; one that is empty is SI.
    key : where a user can give another unit, for the remedy.
    of_frequency : whether it is an axis of frequencies, not of times.

    Returns
    -------
    float
        1 without a unit.

    Raises
    ------
    AxisError
        If the unit is not one of time (of frequency).
    """
    if not unit:
        return 1.0
    try:
        return units.read_quantity(f"1 {unit}", units.FREQUENCY if of_frequency else units.TIME)
    except units.UnitError as error:
        example = "frequency (Hz)" if of_frequency else "time (ms)"
        raise AxisError(
            f"has a {axis_name(of_frequency)} axis in {unit}, which {error.message}",
            f"name its unit in the heading, for example {example}, or give {key}",
        ) from None


def check_record(axis: Floats, values: Floats | Complexes, *, of_frequency: bool) -> None:
    """Refuse values that are not finite, and an axis that does not increase.

    Parameters
    ----------
    axis : (n,) s or, ``of_frequency``, Hz.
    values : (n,) there.

    Raises
    ------
    AxisError
        With the number of the first such sample.
    """
    bad = np.flatnonzero(~np.isfinite(values) | ~np.isfinite(axis))
    if bad.size:
        raise AxisError(
            f"has {bad.size} values that are not finite, the first at sample {bad[0] + 1}",
            "repair or remove that part of the record",
        )
    back = np.flatnonzero(np.diff(axis) <= 0)
    if back.size:
        unit, before, after = "Hz" if of_frequency else "s", axis[back[0]], axis[back[0] + 1]
        raise AxisError(
            f"has a {axis_name(of_frequency)} axis that does not increase at sample {back[0] + 2} "
            f"({before:g} {unit}, then {after:g} {unit})",
            "sort the samples and remove duplicates, or name the correct column",
        )
