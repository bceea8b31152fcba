"""Force-deflection curves of stops, from the scenario and its files."""

from __future__ import annotations

import os
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path as FilePath
from typing import NamedTuple

import numpy as np

from beamsim.contacts.pads import ForceCurve, fit_curve, loop_width, power_curve, power_curve_within
from beamsim.errors import InputFileError, ScenarioError
from beamsim.files import find_file, open_input
from beamsim.measurements.columns import by_dimension
from beamsim.measurements.read import read_file
from beamsim.measurements.signal import axis_kind
from beamsim.scenario import Scenario, units
from beamsim.scenario.base import InvalidValueError, Path, count_text, path_text, problem
from beamsim.scenario.connections import GeneratedForces, MeasuredForces, check_points
from beamsim.scenario.files import DecimalMark
from beamsim.scenario.parameters import with_values
from beamsim.typing import Floats

LOOP_WIDTH = 0.02  # width of a loop relative to the largest force, above which its energy loss matters
_DIMENSIONS = {"length": units.LENGTH, "force": units.FORCE, "time": units.TIME}


@dataclass(frozen=True)
class TableOfStop:
    """The curve of a stop, with remarks about it."""

    curve: ForceCurve
    misfit: float  # N, root mean square; 0 if the points are the curve
    remark: str = ""

    def scaled(self, factor: float, segment_factors: Sequence[float]) -> TableOfStop:
        """A copy with all forces multiplied by a factor, and each segment's stiffness by its own factor."""
        if factor == 1.0 and not segment_factors:
            return self
        force = factor * self.curve.force
        if segment_factors:
            force = np.concatenate([[0.0], np.cumsum(np.array(segment_factors) * np.diff(force))])
        return TableOfStop(ForceCurve(self.curve.deflection, force), factor * self.misfit, self.remark)


def curves_of(scenario: Scenario) -> tuple[ForceCurve | None, ...]:
    """The curve of each snubber, None for one with a stiffness; errors as for `force_tables`."""
    tables = force_tables(scenario)
    return tuple(
        tables[at].curve if (at := path_text(each.path)) in tables else None for each in scenario.located_snubbers
    )


def force_tables(scenario: Scenario) -> dict[str, TableOfStop]:
    """The curves of snubbers with a table, by path.

    Raises
    ------
    ScenarioError
        For files that cannot be read, and points that are not a rising curve from zero.
    """
    tables = {}
    for path, _, snubber, _ in scenario.located_snubbers:
        if snubber.force_deflection is not None:
            at = (*path, "force_deflection")
            table = tables[path_text(path)] = _table_of(scenario, at, snubber.table)
            if not snubber.may_fall and table.curve.slopes.min() < 0.0:
                remedy = "add unloading: {stiffness: ...} without a curve, or fit: {segments: 5} where it is noise"
                raise ScenarioError(problem(at, "has forces that fall", remedy))
    return tables


def _table_of(scenario: Scenario, path: Path, table: MeasuredForces) -> TableOfStop:
    """The curve at a path; both stops of a pair have the same."""
    file = None
    if table.file is not None:
        file = find_file(table.file, scenario.folder_of(*path, "file"), scenario.folder_of(*path))
        if not os.path.lexists(file):
            remedy = "give its path, relative to the folder of the scenario"
            raise ScenarioError(problem(path, f"= {table.file} does not exist", remedy))
    try:
        changed = 0 if file is None else _last_change(file)
        as_given = table.model_copy(update={"scale": 1.0, "segment_factors": ()})
        measured = _table(as_given, file, changed)  # fitted once for all factors
    except InvalidValueError as error:
        where = path if file is not None else (*path, *error.at)
        raise ScenarioError(problem(where, _of_file(file, error.at) + error.message, error.remedy)) from None
    except InputFileError as fault:
        raise ScenarioError(problem(path, _of_file(file, ()) + fault.message, fault.remedy)) from None
    except ValueError as error:  # no curve fits the points
        remedy = "it needs a column of deflections and one of forces, from zero on"
        raise ScenarioError(problem(path, f"{_of_file(file, ())}cannot be used: {error}", remedy)) from None
    segments = measured.curve.slopes.size
    if len(table.segment_factors) not in (0, segments):
        values = count_text(len(table.segment_factors), "value")
        message = f"has {values}, and the curve has {count_text(segments, 'segment')}"
        remedy = "give one factor for each segment, [1, 1, ...] to begin with"
        raise ScenarioError(problem((*path, "segment_factors"), message, remedy))
    return measured.scaled(table.scale, table.segment_factors)


def _last_change(file: FilePath) -> int:
    """Time of the last change of a file, ns; 0 if it cannot be accessed."""
    with open_input(file) as opened:
        return os.fstat(opened.fileno()).st_mtime_ns


def _of_file(file: FilePath | None, path: Sequence[str | int]) -> str:
    if file is None:
        return ""
    row = next((f", row {part + 1} of the numbers" for part in path if isinstance(part, int)), "")
    return f"= {file.name}{row} "


@lru_cache(maxsize=64)
def _table(table: MeasuredForces, file: FilePath | None, change_time: int) -> TableOfStop:
    """The curve of a table; ``change_time`` is the time of the file's last change and distinguishes its versions."""
    if table.smooth is not None:
        return _generated(table.smooth)
    if file is None:
        assert table.points is not None
        deflection, force = np.array(table.points, dtype=float).T
        time = None
    else:
        deflection, force, time = read_forces(file, table.columns, table.decimal)
    if table.fit is None:
        check_points(tuple(zip(deflection.tolist(), force.tolist(), strict=True)), may_fall=True)
        return TableOfStop(ForceCurve(deflection, force), 0.0)
    curve, misfit, remarks = fit_from_zero(deflection, force, table.fit.segments)
    remarks += _remarks(loop_width(deflection, force), file, time, table.fit.segments)
    return TableOfStop(curve, misfit, "; ".join(remarks))


def _generated(law: GeneratedForces) -> TableOfStop:
    """The table of a smooth law, with its error in the remark."""
    exponent, force = law.power
    if law.segments is None:
        table = power_curve_within(exponent, law.range, force, law.tolerance)
    else:
        table = power_curve(exponent, law.range, force, law.segments)
    remark = (
        f"up to {1e3 * law.range:.4g} mm, {count_text(table.curve.slopes.size, 'straight line')} give the force to "
        f"{100 * table.force_error:.2g} % of {force:.4g} N, and the work to {100 * abs(table.work_error):.2g} %"
    )
    return TableOfStop(table.curve, 0.0, remark)


def with_finer_tables(scenario: Scenario) -> Scenario:
    """A copy with twice as many segments in each table of a smooth law."""
    finer: dict[Path, object] = {}
    for path, _, snubber, _ in scenario.located_snubbers:
        if snubber.force_deflection is not None and (law := snubber.table.smooth) is not None:
            segments = 2 * _generated(law).curve.slopes.size
            kept = {key: getattr(law, key) for key in law.model_fields_set - {"tolerance"}}
            smooth = type(law).model_construct(**{**kept, "segments": segments})
            finer[(*path, "force_deflection")] = snubber.table.model_copy(update={"smooth": smooth})
    return with_values(scenario, finer) if finer else scenario


LARGEST_OFFSET = 0.05  # relative to the largest force or deflection, at the start of contact
SMALL_OFFSET = 0.01  # relative to the largest force, above which a remark is made
FEWEST_FOR_OFFSET = 8  # deflections needed for that remark
FREE_TRAVEL_SLOPE = 0.01  # relative to the steepest slope, below which the start of a fitted curve is free travel
POOR_FIT = 0.05  # misfit relative to the largest force, above which more segments are recommended
LIMITED_ROWS, LIMITED_TRAVEL = 3, 0.1  # at exactly the largest force: rows, and share of the largest deflection
REMEDY_OF_OFFSET = (
    "subtract the reading at the beginning of contact from the column of {}; a real free travel is the gap"
)


class FittedForces(NamedTuple):
    """A curve through zero, fitted to measured points."""

    curve: ForceCurve
    misfit: float  # N, root mean square of the points' distances from the curve
    remarks: tuple[str, ...]  # doubts about the points or the curve


def fit_from_zero(deflection: Floats, force: Floats, segments: int) -> FittedForces:
    """Fit a curve to measured points; refuse an offset, which would change the stiffness of a curve through zero.

    Parameters
    ----------
    deflection, force : (p,) points, m and N.
    segments : largest number of segments.

    Returns
    -------
    FittedForces

    Raises
    ------
    InputFileError
        If the force begins at a deflection of more than 5 % of the largest one, or is more than 5 % of the largest
        one at zero deflection, or compression is negative.
    ValueError
        As for `fit_curve`.
    """
    _demand_positive(deflection, force)
    curve, misfit = fit_curve(deflection, force, segments)
    order = np.argsort(deflection, kind="stable")
    x, y = deflection[order], force[order]
    at_zero, largest = float(np.interp(0.0, x, y)), float(y.max())
    late = bool(x[0] > LARGEST_OFFSET * x[-1])
    if late and abs(y[0]) < LARGEST_OFFSET * largest:
        message = f"has an offset: its force begins at {1e3 * x[0]:.3g} mm"
        raise InputFileError(message, REMEDY_OF_OFFSET.format("deflection"))
    if not late and abs(at_zero) > LARGEST_OFFSET * largest:
        message = f"has an offset: its force is {at_zero:.3g} N at zero deflection"
        raise InputFileError(message, REMEDY_OF_OFFSET.format("force or deflection"))
    width = loop_width(deflection, force)
    remarks = [] if late or width > LOOP_WIDTH else _small_offset(x, y, at_zero)
    if free := free_travel(curve):
        remarks.append(
            f"the force begins at {1e3 * free:.3g} mm, and the curve has that free travel; if it is not real, "
            f"{REMEDY_OF_OFFSET.format('deflection')}"
        )
    remarks += _limited(x, y)
    if misfit > (POOR_FIT + 0.5 * width) * largest:
        more = 2 * segments + 1
        if (finer := fit_curve(deflection, force, more)[1]) < 0.5 * misfit:
            remarks.append(
                f"the curve misses the points by {100 * misfit / largest:.2g} % of the largest force (root mean "
                f"square), with {more} segments by {100 * finer / largest:.2g} %: give more segments"
            )
    return FittedForces(curve, misfit, tuple(remarks))


def _small_offset(x: Floats, y: Floats, at_zero: float) -> list[str]:
    """A remark on a force at zero deflection, N, above 1 % of the largest one, that is larger than the scatter.

    Parameters
    ----------
    x, y : (p,) increasing deflections, m, and forces, N.
    at_zero : force at zero deflection.
    """
    first, largest = x <= 0.5 * x[-1], float(y.max())
    if abs(at_zero) <= SMALL_OFFSET * largest or np.unique(x[first]).size < FEWEST_FOR_OFFSET:
        return []
    parabola, covariance = np.polyfit(x[first] / x[-1], y[first] / largest, 2, cov=True)
    if abs(parabola[2]) < SMALL_OFFSET + 3.0 * np.sqrt(covariance[2, 2]) or parabola[2] * at_zero < 0.0:
        return []
    return [
        f"the force is {at_zero:.3g} N at zero deflection, {100 * abs(at_zero) / largest:.2g} % of the largest one, "
        f"and changes the stiffness by about as much: if that is an offset, "
        f"{REMEDY_OF_OFFSET.format('force or deflection')}"
    ]


def _demand_positive(deflection: Floats, force: Floats) -> None:
    """Refuse points in which most compressions have a negative sign in a column.

    Raises
    ------
    InputFileError
    """
    if np.any((deflection > 0.0) & (force > 0.0)):
        return
    for signs, columns in {(-1, -1): "both columns", (1, -1): "the forces", (-1, 1): "the deflections"}.items():
        if np.count_nonzero((signs[0] * deflection > 0.0) & (signs[1] * force > 0.0)) > 0.5 * force.size:
            remedy = f"multiply {columns} by -1"
            raise InputFileError("has no point with a positive deflection and a positive force", remedy)


def _limited(x: Floats, y: Floats) -> list[str]:
    """A remark on a range of deflections with exactly the largest force, which suggests a limited sensor.

    >>> _limited(np.arange(5.0) * 1e-3, np.array([0.0, 20.0, 40.0, 40.0, 40.0]))[0].partition(":")[0]
    'the force stays at exactly 40 N from 2 mm on'
    """
    at = x[y == y.max()]
    if at.size < LIMITED_ROWS or at[-1] - at[0] < LIMITED_TRAVEL * x[-1]:
        return []
    return [
        f"the force stays at exactly {y.max():.4g} N from {1e3 * at[0]:.3g} mm on: if the sensor was at the end of its "
        "range, leave out the rows from there on"
    ]


def free_travel(curve: ForceCurve) -> float:
    """Deflection, m, at the start of a fitted curve with no force; zero if below 5 % of the largest deflection.

    >>> free_travel(ForceCurve(np.array([0.0, 3e-4, 1e-3]), np.array([0.0, 0.0, 45.0])))
    0.0003
    """
    slopes, free = curve.slopes, float(curve.deflection[1])
    flat = (
        slopes.size > 1
        and slopes[0] < FREE_TRAVEL_SLOPE * slopes.max()
        and free > LARGEST_OFFSET * curve.deflection[-1]
    )
    return free if flat else 0.0


def read_forces(
    file: FilePath, columns: Sequence[str] = (), decimal: DecimalMark | None = None
) -> tuple[Floats, Floats, Floats | None]:
    """Read deflections, m, forces, N, and, if present, times, s.

    Columns are recognised by the dimension of the units in their headings.

    Parameters
    ----------
    file : file of the table.
    columns : headings of the columns to use, if several have the same dimension.
    decimal : decimal mark of the numbers, if the user gives it.

    Returns
    -------
    tuple
        Deflections, forces and times, (n,) each; None for missing times.

    Raises
    ------
    InputFileError
        If the file cannot be read, lacks a column, has several of the same dimension without a choice, or has an
        incomplete row.
    """
    table = read_file(file, decimal)
    with np.errstate(over="ignore"):
        found = by_dimension(table, _DIMENSIONS, columns)
    missing = [f"no column has a unit of {kind}" for kind in ("length", "force") if kind not in found]
    missing += ["its times have no unit" for each in table if axis_kind(each.name) == "time" and not each.unit]
    if missing:
        remedy = "name all units in the headings: deflection (mm), force (N), time (s)"
        raise InputFileError(f"cannot be used: {missing[0]}", remedy)
    values = np.column_stack([*found.values()])
    largest = [_DIMENSIONS[kind].largest for kind in found]
    ranges = " and ".join(f"{_DIMENSIONS[kind].largest:g} {_DIMENSIONS[kind].unit}" for kind in found)
    for wrong, how in (
        (~np.isfinite(values), "is not complete"),
        (np.abs(values) > largest, f"is beyond {ranges}"),
    ):
        if wrong.any():
            row = np.flatnonzero(wrong.any(axis=1))[0] + 1
            raise InputFileError(f"cannot be used: row {row} of the numbers {how}", "correct the table")
    return found["length"], found["force"], found.get("time")


def _remarks(width: float, file: FilePath | None, time: Floats | None, segments: int) -> tuple[str, ...]:
    """Remarks on a loop of this width, whose mean is used as the curve."""
    if width <= LOOP_WIDTH:
        return ()
    remark = f"loading and unloading differ by {width:.2g} of the largest force, and the curve runs between them"
    if file is None or time is None or np.any(np.diff(time) <= 0):
        lost = "Maxwell branches would lose that work: give a file with increasing times to have them fitted"
        return (f"{remark}; {lost}",)
    command = f"beamsim pad --curve {shlex.quote(str(file))} --segments {segments}"
    return (f"{remark}; `{command}` prints the softer curve with the Maxwell branches that lose that work",)
