"""The column or channel of a file that is meant; where several could be, the user is asked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from beamsim.errors import InputFileError
from beamsim.measurements.functions import FunctionType, is_unit_of
from beamsim.measurements.signal import MeasuredSignal, axis_kind, counts_samples, label_of, split_heading
from beamsim.scenario import units
from beamsim.typing import Complexes, Floats

_OF_AXES = (units.TIME, units.FREQUENCY)
MOST_LISTED = 12  # columns in a message


def column_named(signals: Sequence[MeasuredSignal], name: str) -> MeasuredSignal:
    """The column with a heading, its heading without unit, the path of a data set, or a number from 1 as its name.

    Raises
    ------
    InputFileError
        If there is none, or several have that name.
    """
    headings = [signal.name for signal in signals]
    for names in (headings, [split_heading(heading)[0] for heading in headings]):
        for spelled in (name, label_of(name)):
            found = [signal for signal, each in zip(signals, names, strict=True) if each == spelled]
            if len(found) > 1:
                numbers = [str(signals.index(each) + 1) for each in found]
                raise InputFileError(
                    f"has {len(found)} columns {name}: {names_text(found)}",
                    f"give the whole heading, or the number of the column: {' or '.join(numbers)}",
                )
            if found:
                return found[0]
    if name.isdigit() and 1 <= int(name) <= len(signals):
        return signals[int(name) - 1]
    raise InputFileError(f"has no column {name} among {len(headings)}", f"name one: {names_text(signals)}")


def names_text(signals: Sequence[MeasuredSignal]) -> str:
    """Names of columns, the first dozen."""
    names = [signal.name for signal in signals[:MOST_LISTED]]
    return ", ".join(names) + (", ..." if len(signals) > MOST_LISTED else "")


def only_column(
    signals: Sequence[MeasuredSignal],
    *dimensions: units.Dimension,
    key: str,
    axis: MeasuredSignal | None = None,
    by_unit: bool = True,
) -> MeasuredSignal:
    """The only column that can be meant where the user names none: no time, frequency or count of samples, none empty.

    Parameters
    ----------
    signals : all columns of the file.
    dimensions : that what is looked for can have; any without one.
    key : with which the user names a column, for the remedy.
    axis : a column that is used as the axis.
    by_unit : whether the one column in a unit of the dimension is meant among columns in other units.

    Returns
    -------
    MeasuredSignal

    Raises
    ------
    InputFileError
        If there is none, or several can be meant.
    """
    axes = {label_of(signal.axis) for signal in signals if signal.axis}
    possible = [
        signal
        for signal in signals
        if signal is not axis
        and label_of(signal.name) not in axes
        and not axis_kind(signal.name)
        and not counts_samples(signal.name, signal.y)
        and not np.isnan(signal.y).all()
    ]
    if by_unit and dimensions and len(possible) > 1:
        fitting = [each for each in possible if not each.unit or is_unit_of(each.unit, *dimensions)]
        possible = fitting or possible
    if not possible:
        raise InputFileError("has an axis but no column of values", f"name the column of values in {key}")
    if len(possible) > 1:
        name = split_heading(possible[-1].name)[0] or possible[-1].name
        what = " or ".join(dimension.name for dimension in dimensions) or "values"
        raise InputFileError(
            f"has {len(possible)} columns that can be the {what}: {names_text(possible)}",
            f"name one in {key}, for example {key.rpartition('.')[2]}: {name}",
        )
    return possible[0]


def by_dimension(
    signals: Sequence[MeasuredSignal], dimensions: Mapping[str, units.Dimension], names: Sequence[str] = ()
) -> dict[str, Floats]:
    """The column with a unit of each dimension; those without a unit are passed over.

    Parameters
    ----------
    signals : columns of a table.
    dimensions : by the word for what has them.
    names : names of columns to be used, where several have the same dimension.

    Returns
    -------
    dict
        (n,) values in SI units by these words.

    Raises
    ------
    InputFileError
        If a column has a unit of none of the dimensions, or several have the same one and none of them is chosen.
    """
    wanted = [column_named(signals, name) for name in names]
    found: dict[str, list[MeasuredSignal]] = {}
    factors: dict[str, float] = {}
    for number, signal in enumerate(signals, 1):
        if not signal.unit:
            continue
        if signal.stated_function is not None:
            signal.require((FunctionType.TIME_HISTORY,), "a table of columns")
        try:
            factor, dimension = units.read_level(f"1 {signal.unit}", tuple(dimensions.values()))
        except units.UnitError:
            *words, last = dimensions
            known = f"{', '.join(words)} or {last}"
            raise InputFileError(
                f"cannot be used: column {number} is in {signal.unit}, which is no unit of {known}",
                "leave that column out, or correct its unit",
            ) from None
        kind = next(word for word, known in dimensions.items() if known is dimension)
        found.setdefault(kind, []).append(signal)
        factors[signal.name] = factor
    for signal in wanted:
        if not signal.unit:
            raise InputFileError(f"states no unit of {signal.name}", "give it in the heading, as in force (N)")
    picked: dict[str, MeasuredSignal] = {}
    for kind in sorted(found, key=lambda kind: dimensions[kind] in _OF_AXES):  # axes follow from what is along them
        named = [signal for signal in found[kind] if any(signal is each for each in wanted)]
        picked[kind] = _one_of(named or _columns_along_axes([*wanted, *picked.values()], found[kind]), kind, factors)
        _check_samples(list(picked.values()), factors)
    return {kind: np.asarray(signal.y * factors[signal.name], dtype=float) for kind, signal in picked.items()}


def _has_axis(signal: MeasuredSignal) -> bool:
    """Whether a column is along times or frequencies, not only behind another column."""
    named = signal.axis_unit and is_unit_of(signal.axis_unit, *_OF_AXES)
    return bool(signal.axis and (named or axis_kind(signal.axis)))


def _columns_along_axes(
    columns_with_axes: Sequence[MeasuredSignal], columns: list[MeasuredSignal]
) -> list[MeasuredSignal]:
    """Of several columns those along the axes of other ones, or these axes, where there are any."""
    axes = {signal.axis for signal in columns_with_axes if _has_axis(signal)}
    return [each for each in columns if each.name in axes or each.axis in axes] or columns


def _one_of(columns: Sequence[MeasuredSignal], kind: str, factors: Mapping[str, float]) -> MeasuredSignal:
    """The first of columns with the same values; refuses others."""
    first = columns[0]
    for other in columns[1:]:
        if not _have_equal_values(first.y * factors[first.name], other.y * factors[other.name]):
            names = [split_heading(each.name)[0] for each in columns]
            raise InputFileError(
                f"cannot be used: {names_text(columns)} each have a unit of {kind}",
                f"name the one that is meant: columns: [{names[-1]}] (--column {names[-1]})",
            )
    return first


def _have_equal_values(a: Floats | Complexes, b: Floats | Complexes) -> bool:
    """Whether two columns hold the same values, up to the round-off of their units."""
    return a.shape == b.shape and np.allclose(a, b, rtol=1e-9, atol=0.0, equal_nan=True)


def _check_samples(columns: Sequence[MeasuredSignal], factors: Mapping[str, float]) -> None:
    """Refuse columns that are not of the same samples."""
    if len({column.y.size for column in columns}) > 1:
        raise InputFileError("cannot be used: its columns have different lengths", "use a table of equal columns")
    timed = [column for column in columns if _has_axis(column)]
    for other in timed[1:]:
        if not _have_equal_values(*(each.x * factors.get(each.axis, 1.0) for each in (timed[0], other))):
            raise InputFileError(
                f"cannot be used: {timed[0].name} and {other.name} are measured at different times",
                "resample them to the same times",
            )
