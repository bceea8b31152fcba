r"""``beamsim pad``: stiffness and dashpot of a snubber's pad from its material or from a measured curve.

A block of height h and loaded area A, bonded to both plates or held by friction, cannot spread at its faces. Its
stiffness in compression is (A. N. Gent, P. B. Lindley, The compression of bonded rubber blocks, Proc. Inst. Mech. Eng.
173 (1959) 111–122)

.. math:: k = E\,(1 + 2 S^2)\,A / h

with the shape factor S, loaded area over the area that is free to bulge, of soft unfilled rubber. It holds for strains
of up to about 10 % and compact blocks (circular or square). Lubricated faces: S = 0.

A measured loop from zero to the deflection X and back is a cycle of amplitude X/2 about its middle. With the work
:math:`W_+` done and :math:`W_-` returned, the spring of the same energy has the stiffness
:math:`k = (W_+ + W_-)/X^2`, and the loop the loss factor :math:`\eta = 4 (W_+ - W_-) / (\pi (W_+ + W_-))`. Loops
recorded over time give Maxwell branches in parallel with a softer curve, both fitted together.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from beamsim.contacts.branches import driven_force, dynamic_stiffness, fit_loop, loop_frequency, turning_points
from beamsim.contacts.pads import ForceCurve, MaxwellBranch, loop_width
from beamsim.errors import InputFileError, Problem, ScenarioError
from beamsim.outcomes import COMPLETE, Outcome
from beamsim.scenario.files import DecimalMark
from beamsim.system.force_tables import LOOP_WIDTH, FittedForces, fit_from_zero, free_travel, read_forces
from beamsim.typing import Floats, not_none


@dataclass(frozen=True, kw_only=True)
class PadNumbers:
    """Properties of a snubber in SI units; None if they are not known."""

    stiffness: float  # N/m; for a curve, the spring with the same energy at the largest deflection
    dashpot: float  # N s/m; zero without a loss factor or its frequency
    points: tuple[tuple[float, float], ...] | None = None  # m, N of a curve of several segments
    misfit: float | None = None  # N, of the fitted curve; with branches, of the pad driven as measured
    maxwell: tuple[MaxwellBranch, ...] = ()
    dynamic: tuple[tuple[float, float, float], ...] = ()  # Hz, N/m, loss factor of curve and branches
    loss_factor: float | None = None  # from the input, or of the measured loop
    free_travel: float = 0.0  # m, deflection without force at the beginning of the curve
    remarks: tuple[str, ...] = ()  # warnings about the curve
    outcome: Outcome = COMPLETE  # not reliable if the fit of branches ended at its bounds


@dataclass(frozen=True, kw_only=True)
class KnownPad:
    """Known data of a pad in SI units: material and size, or a measured curve."""

    modulus: float | None = None  # Pa, Young's modulus of the material
    shape_factor: float = 0.0  # see the module's equations
    area: float | None = None  # m^2
    height: float | None = None  # m
    curve: Path | None = None  # file of measured forces over deflections
    segments: int = 5  # of the fitted piecewise linear curve
    loss_factor: float | None = None
    frequency: float | None = None  # Hz, at which the dashpot has the loss factor
    columns: Sequence[str] = ()  # headings of the columns to read, if several have the same dimension
    decimal: DecimalMark | None = None  # decimal mark of the numbers; found from the file by default


def pad(data: KnownPad) -> PadNumbers:
    """Compute the snubber properties of a pad.

    Parameters
    ----------
    data : material and size, or a measured curve.

    Returns
    -------
    PadNumbers

    Raises
    ------
    ScenarioError
        If the data are not enough, or contradict each other.
    """
    _check(data)
    points, misfit, loss_factor, free, remarks = None, None, data.loss_factor, 0.0, tuple[str, ...]()
    if data.curve is not None:
        (fitted, misfit, remarks), of_loop, record = _measured(data.curve, data.segments, data.columns, data.decimal)
        if record is not None and data.loss_factor is None and data.frequency is None:
            return replace(_fit_record(fitted, record, of_loop), remarks=remarks)
        stiffness = 2.0 * _work(fitted.deflection, fitted.force) / float(fitted.deflection[-1]) ** 2
        if fitted.slopes.size > 1:
            points = tuple(zip(fitted.deflection.tolist(), fitted.force.tolist(), strict=True))
        free = free_travel(fitted)
        loss_factor = of_loop if loss_factor is None else loss_factor
    else:
        area, height = not_none(data.area), not_none(data.height)
        stiffness = not_none(data.modulus) * (1.0 + 2.0 * data.shape_factor**2) * area / height
    dashpot = 0.0
    if loss_factor is not None and data.frequency is not None:
        dashpot = loss_factor * stiffness / (2.0 * math.pi * data.frequency)
    return PadNumbers(
        stiffness=stiffness, dashpot=dashpot, points=points, misfit=misfit, loss_factor=loss_factor, free_travel=free,
        remarks=remarks,
    )  # fmt: skip


def _fit_record(middle: ForceCurve, record: Record, loss_factor: float | None) -> PadNumbers:
    """Fit curve and branches together to a record of loops; the curve has the breakpoints of ``middle``."""
    fit = fit_loop(*record, middle.deflection[:-1])
    force = np.concatenate([[0.0], np.cumsum(fit.springs * np.diff(middle.deflection))])
    curve = ForceCurve(middle.deflection, force)
    stiffness = 2.0 * _work(curve.deflection, curve.force) / float(curve.deflection[-1]) ** 2
    missed = driven_force(curve, fit.branches, record.time, record.deflection) - record.force
    at = loop_frequency(record.time, record.deflection) * np.array([0.1, 0.3, 1.0, 3.0, 10.0, 100.0])
    k = dynamic_stiffness(stiffness, fit.branches, 2 * np.pi * at)
    return PadNumbers(
        stiffness=stiffness,
        dashpot=0.0,
        points=tuple(zip(curve.deflection.tolist(), force.tolist(), strict=True)),
        misfit=float(np.sqrt(np.mean(missed**2))),
        loss_factor=loss_factor,
        maxwell=fit.branches,
        free_travel=free_travel(curve),
        outcome=fit.outcome,
        dynamic=tuple(zip(at.tolist(), k.real.tolist(), (k.imag / k.real).tolist(), strict=True)),
    )


def _check(data: KnownPad) -> None:
    """Refuse missing or conflicting data.

    Raises
    ------
    ScenarioError
    """
    problems = []
    if data.modulus is None and data.curve is None:
        problems.append(Problem("--modulus", "is missing", "give --modulus, --area and --height, or --curve"))
    elif data.modulus is not None and data.curve is not None:
        problems.append(Problem("--modulus", "and --curve exclude each other", "give one of them"))
    needs = [("modulus", "area", "'4 cm^2'"), ("modulus", "height", "'6 mm'"), ("loss_factor", "frequency", "'65 Hz'")]
    for name, other, example in needs:
        if getattr(data, name) is not None and getattr(data, other) is None:
            what = f"is missing, which {option(name)} needs"
            problems.append(Problem(option(other), what, f"give for example {option(other)} {example}"))
    if data.frequency is not None and data.modulus is not None and data.loss_factor is None:
        problems.append(Problem("--loss-factor", "is missing, which --frequency needs", "give for example 0.1"))
    if problems:
        raise ScenarioError(problems)


def option(name: str) -> str:
    """Command-line option of a field."""
    return "--" + name.replace("_", "-")


class Record(NamedTuple):
    """Measured loops over time."""

    time: Floats  # (t,) s, increasing
    deflection: Floats  # m
    force: Floats  # N


ROUND_OFF = 1e-12  # misfit of a curve relative to its largest force, which counts as zero


def _measured(
    file: Path, segments: int, columns: Sequence[str], decimal: DecimalMark | None
) -> tuple[FittedForces, float | None, Record | None]:
    """Read a measured curve.

    Returns the fitted curve, the loss factor of the loop if unloading was measured too, and the record if loops were
    measured over time.

    Raises
    ------
    ScenarioError
    """
    try:
        deflection, force, time = read_forces(file, columns, decimal)
        fitted = fit_from_zero(deflection, force, segments)
    except InputFileError as fault:
        raise ScenarioError.at("--curve", f"= {file} {fault.message}", fault.remedy) from None
    except ValueError as error:
        remedy = "it needs a column of deflections and one of forces, from zero on"
        raise ScenarioError.at("--curve", f"= {file} cannot be used: {error}", remedy) from None
    turns = turning_points(deflection)
    work = [_work(deflection[i : j + 1], force[i : j + 1]) for i, j in pairwise(turns)]
    given, back = sum(work[::2]), -sum(work[1::2])
    loss_factor = None
    if 0.0 < back <= given and len(work) % 2 == 0:
        loss_factor = 4.0 * (given - back) / (math.pi * (given + back))
    if fitted.misfit <= ROUND_OFF * float(np.abs(force).max()):
        fitted = fitted._replace(misfit=0.0)
    timed = time is not None and bool(np.all(np.diff(time) > 0.0)) and loop_width(deflection, force) > LOOP_WIDTH
    record = Record(time, deflection, force) if timed and time is not None else None
    return fitted, loss_factor, record


def _work(deflection: Floats, force: Floats) -> float:
    return float(np.trapezoid(force, deflection))
