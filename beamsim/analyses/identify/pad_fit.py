"""Fit of a spring and Maxwell branches to measurements of a pad."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from beamsim.analyses.identify.fit import inverse_information
from beamsim.analyses.identify.layouts import ENDS, PAD
from beamsim.analyses.identify.result import Findings
from beamsim.contacts.branches import BranchFit, dynamic_stiffness, fit_dynamic, fit_relaxation, relaxation
from beamsim.contacts.pads import MaxwellBranch
from beamsim.errors import InputFileError, ScenarioError
from beamsim.measurements.columns import by_dimension
from beamsim.measurements.read import read_file
from beamsim.scenario import Scenario, units
from beamsim.scenario.base import InvalidValueError, path_text
from beamsim.scenario.identification import Pad, PadData, check_data
from beamsim.typing import Complexes, Floats

_DIMENSIONS = {
    "frequency": units.FREQUENCY, "time": units.TIME, "stiffness": units.STIFFNESS, "modulus": units.PRESSURE,
}  # fmt: skip
DATA_PATH = ("identify_stiffness", "pad", "data")


def fit_pad(scenario: Scenario, pad: Pad, data: PadData, coverage: float) -> Findings:
    """Fit a spring and Maxwell branches to measurements of a pad.

    Parameters
    ----------
    scenario : scenario; the path of the data file is relative to its folder.
    pad : section of the pad; needs height and area if a modulus was measured.
    data : measured values, or their file.
    coverage : probability of the intervals.

    Returns
    -------
    Findings.

    Raises
    ------
    ScenarioError
        If the file cannot be used, or a ramp is given with a dynamic test.
    """
    kind, rows = _measured(scenario, pad, data)
    dynamic, ramp = kind == "dynamic", data.ramp or 0.0
    at, measured, *loss = rows.T
    fit = (fit_dynamic(2 * np.pi * at, measured, loss[0], data.branches) if dynamic
           else fit_relaxation(at, measured, data.branches, ramp))  # fmt: skip

    def model(numbers: Floats, at: Floats) -> Complexes:
        branches = tuple(map(MaxwellBranch, *numbers[1:].reshape(2, -1).tolist()))
        if dynamic:
            return dynamic_stiffness(numbers[0], branches, 2 * np.pi * at)
        return relaxation(numbers[0], branches, at, ramp).astype(complex)

    stiffness = np.array([b.stiffness for b in fit.branches])
    numbers = np.array([fit.stiffness, *stiffness, *(b.relaxation_time for b in fit.branches)])
    response = measured * (1.0 + 1j * (loss[0] if dynamic else 0.0))
    intervals = _intervals(numbers, lambda each: model(each, at) / response, coverage)
    curve_at = np.geomspace(at[at > 0.0].min(), at[-1], POINTS_OF_CURVE)
    curve, of_measured = model(numbers, curve_at), model(numbers, at)
    values = {
        "kind": kind,
        "end": ENDS,
        "stiffness": fit.stiffness,
        "stiffness_interval": intervals[0],
        "misfit": fit.misfit,
        "least_misfit": fit.least_misfit,
        "ramp": None if dynamic else ramp,
        "branch": 1 + np.arange(stiffness.size),
        "branch_stiffness": stiffness,
        "branch_interval": intervals[1 : stiffness.size + 1],
        "relaxation_time": numbers[stiffness.size + 1 :],
        "time_interval": intervals[stiffness.size + 1 :],
        "measurement": 1 + np.arange(at.size),
        "frequency_hz": at if dynamic else None,
        "time": None if dynamic else at,
        "measured_stiffness": measured,
        "fitted_stiffness": np.ascontiguousarray(of_measured.real),
        "measured_loss_factor": loss[0] if dynamic else None,
        "fitted_loss_factor": of_measured.imag / of_measured.real if dynamic else None,
        "point": 1 + np.arange(curve_at.size),
        "curve_at": curve_at,
        "curve_stiffness": np.ascontiguousarray(curve.real),
        "curve_loss_factor": curve.imag / curve.real,
    }
    summary = {"pad_yaml": _yaml(fit)}
    dataset = PAD.dataset(values, unit="Hz" if dynamic else "s")
    return Findings([dataset], summary, list(_warnings(fit)), outcome=fit.outcome)


def _yaml(fit: BranchFit) -> str:
    """YAML keys of a snubber with the fitted spring and branches."""
    branches = ", ".join(
        f"{{stiffness: {each.stiffness:.5g} N/m, relaxation_time: {each.relaxation_time:.4g} s}}"
        for each in fit.branches
    )
    return f"stiffness: {fit.stiffness:.5g} N/m\nmaxwell: [{branches}]"


POINTS_OF_CURVE = 200
MOST_MISFIT = 0.05  # misfit above which a fit gives a warning
WORTH_BRANCHES = 1.1  # ratio of the misfit to that with any number of branches, above which more branches are suggested


def _warnings(fit: BranchFit) -> Iterator[str]:
    """Warn if the fitted branches do not reproduce the measurements."""
    if fit.misfit > MOST_MISFIT:
        more = fit.misfit > WORTH_BRANCHES * fit.least_misfit
        remedy = "allow more branches" if more else "no branches fit these measurements"
        yield f"the branches miss the measurements of the pad by {100 * fit.misfit:.3g} %: {remedy}"


STEP_OF_LOGARITHM = 1e-5  # of finite differences


def _intervals(numbers: Floats, relative: Callable[[Floats], Complexes], coverage: float) -> Floats:
    """First-order confidence intervals of logarithms from the residual scatter, by Student's t distribution.

    Parameters
    ----------
    numbers : (p,) the estimates.
    relative : function from numbers to predicted over measured values, (r,); real for relaxation curves.
    coverage : probability of the intervals.

    Returns
    -------
    (p, 2) array
        nan if there are no more measurements than numbers, and for numbers that are zero or not determined.
    """
    from scipy.special import stdtrit

    def rows(x: Floats) -> Floats:
        ratio = relative(numbers * np.exp(x)) - 1.0
        return np.concatenate([ratio.real, ratio.imag] if ratio.imag.any() else [ratio.real])

    left, found = rows(np.zeros(numbers.size)), np.flatnonzero(numbers > 0.0)
    steps = STEP_OF_LOGARITHM * np.eye(numbers.size)[found]
    jacobian = np.column_stack([(rows(step) - rows(-step)) / (2.0 * STEP_OF_LOGARITHM) for step in steps])
    freedom, wide = left.size - found.size, np.full(numbers.size, np.nan)
    if freedom > 0:
        variance = np.diag(inverse_information(jacobian)) * (left @ left) / freedom
        wide[found] = stdtrit(freedom, 0.5 + coverage / 2) * np.sqrt(variance)
    return np.asarray(numbers[:, None] * np.exp(np.multiply.outer(wide, [-1.0, 1.0])))


def _measured(scenario: Scenario, pad: Pad, data: PadData) -> tuple[str, Floats]:
    if data.file is None:
        kind = "dynamic" if data.dynamic is not None else "relaxation"
        return kind, np.array(getattr(data, kind), dtype=float)
    at = (*DATA_PATH, "file")
    file = scenario.folder_of(*at) / data.file
    per_modulus = None if pad.height is None or pad.area is None else pad.area / pad.height
    try:
        kind, rows = _read(file, data, per_modulus)
        check_data(rows.tolist(), kind, data.branches)
    except InvalidValueError as error:
        row = next((f", row {part + 1} of the numbers" for part in error.at if isinstance(part, int)), "")
        raise ScenarioError.at(path_text(at), f"= {file.name}{row} {error.message}", error.remedy) from None
    except InputFileError as fault:
        raise ScenarioError.at(path_text(at), f"= {data.file} {fault.message}", fault.remedy) from None
    if kind == "dynamic" and data.ramp:
        message = f"goes with a relaxation test, and {data.file} is a dynamic one"
        raise ScenarioError.at(path_text((*DATA_PATH, "ramp")), message, "leave ramp out")
    return kind, rows


def _read(file: Path, data: PadData, per_modulus: float | None) -> tuple[str, Floats]:
    """Read the kind of test, dynamic or relaxation, and its rows in SI units, (p, 3) or (p, 2).

    ``per_modulus`` is stiffness over modulus, m (area over height); None if it is unknown.

    Raises
    ------
    InputFileError
        If the file cannot be read, or is neither kind of test.
    """
    table = read_file(file, data.decimal)
    columns = by_dimension(table, _DIMENSIONS, data.columns)
    for column in table:
        if not column.unit and any(word in column.name.lower() for word in ("loss", "tan", "eta")):
            columns.setdefault("loss", np.asarray(column.y, dtype=float))
    if "modulus" in columns and "stiffness" not in columns:
        if per_modulus is None:
            raise InputFileError("gives a modulus", "add height and area of the pad, from which the stiffness follows")
        columns["stiffness"] = columns["modulus"] * per_modulus
    for kind, needed in (("dynamic", ("frequency", "stiffness", "loss")), ("relaxation", ("time", "stiffness"))):
        if all(name in columns for name in needed):
            rows = np.column_stack([columns[name] for name in needed])
            bad = np.flatnonzero(~(np.isfinite(rows).all(axis=1) & (rows >= 0.0).all(axis=1) & (rows[:, 1] > 0.0)))
            if bad.size:
                row = f"row {bad[0] + 1} of the numbers is not complete, or not positive"
                raise InputFileError(f"cannot be used: {row}", "correct the table")
            return kind, rows
    raise InputFileError(
        "is not a dynamic or relaxation test of a pad",
        "it needs columns frequency (Hz), storage (kN/m), loss factor, or time (s), stiffness (kN/m), with units in "
        "the headings",
    )
