"""Force-deflection curves of stops, from the scenario and its files."""

from __future__ import annotations

import os
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path as FilePath

import numpy as np

from beamsim.contacts.pads import ForceCurve, fit_curve, loop_width
from beamsim.errors import InputFileError, ScenarioError
from beamsim.files import found_in, open_input
from beamsim.measurements.columns import by_dimension
from beamsim.measurements.read import read_file
from beamsim.measurements.signal import axis_kind
from beamsim.scenario import Scenario, units
from beamsim.scenario.base import InvalidValueError, Path, counted, path_text, problem
from beamsim.scenario.connections import MeasuredForces, check_points
from beamsim.scenario.files import DecimalMark
from beamsim.typing import Floats

LOOP = 0.02  # width of a loop over the largest force, above which its work counts
_DIMENSIONS = {"length": units.LENGTH, "force": units.FORCE, "time": units.TIME}


@dataclass(frozen=True)
class TableOfStop:
    """The curve of a stop and what there is to say about it."""

    curve: ForceCurve
    misfit: float  # N, root mean square; 0 where the points are the curve
    remark: str = ""

    def scaled(self, factor: float, of_segments: Sequence[float]) -> TableOfStop:
        """All forces multiplied by a factor, and the stiffness of each segment by one of its own, where these are
        given."""
        if factor == 1.0 and not of_segments:
            return self
        force = factor * self.curve.force
        if of_segments:
            force = np.concatenate([[0.0], np.cumsum(np.array(of_segments) * np.diff(force))])
        return TableOfStop(ForceCurve(self.curve.deflection, force), factor * self.misfit, self.remark)


def curves_of(scenario: Scenario) -> tuple[ForceCurve | None, ...]:
    """The curve of each snubber, None of one with a stiffness; raises as `force_tables`."""
    tables = force_tables(scenario)
    return tuple(
        tables[at].curve if (at := path_text(each.path)) in tables else None for each in scenario.located_snubbers
    )


def force_tables(scenario: Scenario) -> dict[str, TableOfStop]:
    """The tables of snubbers by their paths; those with a stiffness have none.

    Raises
    ------
    ScenarioError
        For files that cannot be read and points that are no rising curve from zero.
    """
    return {
        path_text(path): _table_of(scenario, (*path, "force_deflection"), snubber.table)
        for path, _, snubber, _ in scenario.located_snubbers
        if snubber.force_deflection is not None
    }


def _table_of(scenario: Scenario, at: Path, table: MeasuredForces) -> TableOfStop:
    """The table at a path; both stops of a pair have the same."""
    file = None
    if table.file is not None:
        file = found_in(table.file, scenario.folder_of(*at, "file"), scenario.folder_of(*at))
        if not os.path.lexists(file):
            remedy = "give its path, relative to the folder of the scenario"
            raise ScenarioError(problem(at, f"= {table.file} does not exist", remedy))
    try:
        changed = 0 if file is None else _last_change(file)
        as_given = table.model_copy(update={"scale": 1.0, "segment_factors": ()})
        measured = _table(as_given, file, changed)  # is fitted once for all factors
    except InvalidValueError as error:
        where = at if file is not None else (*at, *error.at)
        raise ScenarioError(problem(where, _of_file(file, error.at) + error.message, error.remedy)) from None
    except InputFileError as fault:
        raise ScenarioError(problem(at, _of_file(file, ()) + fault.message, fault.remedy)) from None
    except ValueError as error:  # no curve fits the points
        remedy = "it needs a column of deflections and one of forces, from zero on"
        raise ScenarioError(problem(at, f"{_of_file(file, ())}cannot be used: {error}", remedy)) from None
    segments = measured.curve.slopes.size
    if len(table.segment_factors) not in (0, segments):
        message = (
            f"has {counted(len(table.segment_factors), 'value')}, and the curve has {counted(segments, 'segment')}"
        )
        remedy = "give one factor for each segment, [1, 1, ...] to begin with"
        raise ScenarioError(problem((*at, "segment_factors"), message, remedy))
    return measured.scaled(table.scale, table.segment_factors)


def _last_change(file: FilePath) -> int:
    """Time of the last change of a file that can be opened, ns."""
    with open_input(file) as opened:
        return os.fstat(opened.fileno()).st_mtime_ns


def _of_file(file: FilePath | None, at: Sequence[str | int]) -> str:
    if file is None:
        return ""
    row = next((f", row {part + 1} of the numbers" for part in at if isinstance(part, int)), "")
    return f"= {file.name}{row} "


@lru_cache(maxsize=64)
def _table(table: MeasuredForces, file: FilePath | None, changed: int) -> TableOfStop:
    """``changed`` is the time of the file's last change: it tells versions of a file apart."""
    if file is None:
        assert table.points is not None
        deflection, force = np.array(table.points, dtype=float).T
        time = None
    else:
        deflection, force, time = read_forces(file, table.columns, table.decimal)
    if table.fit is None:
        check_points(tuple(zip(deflection.tolist(), force.tolist(), strict=True)))
        return TableOfStop(ForceCurve(deflection, force), 0.0)
    curve, misfit = fit_from_zero(deflection, force, table.fit.segments)
    free = free_travel(curve)
    remarks = [free_travel_remark(free)] if free else []
    remarks += _remarks(loop_width(deflection, force), file, time, table.fit.segments)
    return TableOfStop(curve, misfit, "; ".join(remarks))


LARGEST_OFFSET = 0.05  # of the largest force or deflection, at the beginning of contact
NO_FORCE = 0.01  # of the steepest slope, below which the beginning of a fitted curve is free travel
REMEDY_OF_OFFSET = "subtract from the column of {} what it reads where contact begins; a real free travel is the gap"


def fit_from_zero(deflection: Floats, force: Floats, segments: int) -> tuple[ForceCurve, float]:
    """`fit_curve` to measured points without an offset, with which a curve through zero has another stiffness.

    Parameters
    ----------
    deflection, force : (p,) points, m and N.
    segments : largest number of them.

    Returns
    -------
    ForceCurve, float
        The curve, and the root mean square of the points' distances from it, N.

    Raises
    ------
    InputFileError
        Where the force begins at a deflection of more than 5 % of the largest one, or is more than 5 % of the largest
        one at zero deflection.
    ValueError
        As `fit_curve`.
    """
    fitted = fit_curve(deflection, force, segments)
    order = np.argsort(deflection, kind="stable")
    x, y = deflection[order], force[order]
    at_zero = float(np.interp(0.0, x, y))
    if x[0] > LARGEST_OFFSET * x[-1] and abs(y[0]) < LARGEST_OFFSET * y.max():
        what, column = f"its force begins at {1e3 * x[0]:.3g} mm", "deflection"
    elif x[0] <= LARGEST_OFFSET * x[-1] and abs(at_zero) > LARGEST_OFFSET * y.max():
        what, column = f"its force is {at_zero:.3g} N at zero deflection", "force or deflection"
    else:
        return fitted
    raise InputFileError(f"has an offset: {what}", REMEDY_OF_OFFSET.format(column))


def free_travel(curve: ForceCurve) -> float:
    """Deflection, m, at the beginning of a fitted curve over which it has no force; zero below 5 % of the largest one.

    >>> free_travel(ForceCurve(np.array([0.0, 3e-4, 1e-3]), np.array([0.0, 0.0, 45.0])))
    0.0003
    """
    slopes, free = curve.slopes, float(curve.deflection[1])
    flat = slopes.size > 1 and slopes[0] < NO_FORCE * slopes.max() and free > LARGEST_OFFSET * curve.deflection[-1]
    return free if flat else 0.0


def free_travel_remark(free: float) -> str:
    """What to say about a curve that begins without a force, over so many metres."""
    return (
        f"the force begins at {1e3 * free:.3g} mm, and the curve has that free travel; if it is none, "
        f"{REMEDY_OF_OFFSET.format('deflection')}"
    )


def read_forces(
    file: FilePath, columns: Sequence[str] = (), decimal: DecimalMark | None = None
) -> tuple[Floats, Floats, Floats | None]:
    """Deflections, m, forces, N, and times, s, where there is a column of them.

    Columns are distinguished by the dimension of the units in their headings.

    Parameters
    ----------
    file : of the table.
    columns : headings of those that are meant, where several have the same dimension.
    decimal : decimal mark of the numbers, where the user states it.

    Returns
    -------
    tuple
        Deflections, forces and times, (n,) each; None in place of times that are not in the file.

    Raises
    ------
    InputFileError
        If the file cannot be read, lacks a column, has several of the same dimension of which none is meant, or has a
        row that is not complete.
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


def _remarks(width: float, file: FilePath | None, time: Floats | None, segments: int) -> list[str]:
    """What to say about a loop of this width: the curve goes through its middle."""
    if width <= LOOP:
        return []
    remark = f"loading and unloading differ by {width:.2g} of the largest force, and the curve runs between them"
    if file is None or time is None or np.any(np.diff(time) <= 0):
        lost = "Maxwell branches would lose that work: give a file with increasing times to have them fitted"
        return [f"{remark}; {lost}"]
    command = f"beamsim pad --curve {shlex.quote(str(file))} --segments {segments}"
    return [f"{remark}; `{command}` prints the softer curve with the Maxwell branches that lose that work"]
