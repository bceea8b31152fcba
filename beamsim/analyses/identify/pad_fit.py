"""Maxwell branches of a pad from measurements of the pad itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from beamsim.analyses.identify.result import PadFit
from beamsim.contacts.pads import MaxwellBranch
from beamsim.errors import ScenarioError
from beamsim.measurements.read import read_file
from beamsim.measurements.signal import MeasurementError, by_dimension
from beamsim.scenario import Scenario, units
from beamsim.scenario.base import Unfit, path_text
from beamsim.scenario.studies import Pad, PadData, check_data
from beamsim.typing import Complexes, Floats

_DIMENSIONS = {
    "frequency": units.FREQUENCY, "time": units.TIME, "stiffness": units.STIFFNESS, "modulus": units.PRESSURE,
}  # fmt: skip
AT = ("identify_stiffness", "pad", "data")


def fit_pad(scenario: Scenario, pad: Pad, data: PadData) -> PadFit:
    """Fit branches to what was measured.

    Parameters
    ----------
    scenario : whose folder the file is relative to.
    pad : with height and area, where a modulus was measured.
    data : what was measured, or its file.

    Returns
    -------
    PadFit

    Raises
    ------
    ScenarioError
        If the file cannot be used, or a dynamic test has a ramp.
    """
    kind, rows = _measured(scenario, pad, data)
    warnings = []
    dynamic, ramp = kind == "dynamic", data.ramp or 0.0
    if dynamic and ramp:
        message = f"goes with a relaxation test, and {data.file} is a dynamic one"
        raise ScenarioError.at(path_text((*AT, "ramp")), message, "leave ramp out")
    fit = (
        fit_dynamic(2 * np.pi * rows[:, 0], rows[:, 1], rows[:, 2], data.branches)
        if dynamic
        else fit_relaxation(rows[:, 0], rows[:, 1], data.branches, ramp)
    )

    def fitted(at: Floats) -> Complexes:
        if dynamic:
            return dynamic_stiffness(fit.stiffness, fit.branches, 2 * np.pi * at)
        return relaxation(fit.stiffness, fit.branches, at, ramp).astype(complex)

    at = np.geomspace(rows[rows[:, 0] > 0.0, 0].min(), rows[-1, 0], 200)
    curve, of_measured = fitted(at), fitted(rows[:, 0])
    if fit.misfit > 0.05:
        remedy = "allow more branches" if fit.misfit > 1.1 * fit.least_misfit else "no branches fit these measurements"
        warnings.append(f"the branches miss the measurements of the pad by {100 * fit.misfit:.3g} %: {remedy}")
    if fit.at_limit:
        times = ", ".join(f"{time:.3g} s" for time in fit.at_limit)
        warnings.append(f"relaxation times far outside what was measured on the pad: {times}; measure further")
    if fit.stiffness == 0.0:
        warnings.append(
            "the pad has no stiffness left after a long rest in these measurements: measure longer or slower"
        )
    return PadFit(
        kind=kind,
        stiffness=fit.stiffness,
        branch_stiffness=np.array([b.stiffness for b in fit.branches]),
        relaxation_time=np.array([b.relaxation_time for b in fit.branches]),
        misfit=fit.misfit,
        least_misfit=fit.least_misfit,
        frequency_hz=rows[:, 0] if dynamic else None,
        time=None if dynamic else rows[:, 0],
        measured_stiffness=rows[:, 1],
        fitted_stiffness=np.ascontiguousarray(of_measured.real),
        measured_loss_factor=rows[:, 2] if dynamic else None,
        fitted_loss_factor=of_measured.imag / of_measured.real if dynamic else None,
        curve_at=at,
        curve_stiffness=np.ascontiguousarray(curve.real),
        curve_loss_factor=curve.imag / curve.real,
        unit="Hz" if dynamic else "s",
        ramp=None if dynamic else ramp,
        warnings=tuple(warnings),
    )


def _measured(scenario: Scenario, pad: Pad, data: PadData) -> tuple[str, Floats]:
    if data.file is None:
        kind = "dynamic" if data.dynamic is not None else "relaxation"
        return kind, np.array(getattr(data, kind), dtype=float)
    at = (*AT, "file")
    file = scenario.folder_of(*at) / data.file
    per_modulus = None if pad.height is None or pad.area is None else pad.area / pad.height
    try:
        kind, rows = _read(file, per_modulus)
        check_data(rows.tolist(), kind, data.branches)
    except Unfit as error:
        row = next((f", row {part + 1} of the numbers" for part in error.at if isinstance(part, int)), "")
        raise ScenarioError.at(path_text(at), f"= {file.name}{row} {error.message}", error.remedy) from None
    except MeasurementError as fault:
        raise ScenarioError.at(path_text(at), f"= {data.file} {fault.message}", fault.remedy) from None
    return kind, rows


def _read(file: Path, per_modulus: float | None) -> tuple[str, Floats]:
    """The kind, dynamic or relaxation, and (p, 3) or (p, 2) rows in SI units.

    ``per_modulus`` is the stiffness for a unit of modulus, area over height, m; None where it is unknown.

    Raises
    ------
    MeasurementError
        If the file cannot be read, or is neither.
    """
    table = read_file(file)
    columns = by_dimension(table, _DIMENSIONS)
    for column in table:
        if not column.unit and any(word in column.name.lower() for word in ("loss", "tan", "eta")):
            columns.setdefault("loss", np.asarray(column.y, dtype=float))
    if "modulus" in columns and "stiffness" not in columns:
        if per_modulus is None:
            raise MeasurementError("gives a modulus", "add height and area of the pad, which make it a stiffness")
        columns["stiffness"] = columns["modulus"] * per_modulus
    for kind, needed in (("dynamic", ("frequency", "stiffness", "loss")), ("relaxation", ("time", "stiffness"))):
        if all(name in columns for name in needed):
            rows = np.column_stack([columns[name] for name in needed])
            bad = np.flatnonzero(~(np.isfinite(rows).all(axis=1) & (rows >= 0.0).all(axis=1) & (rows[:, 1] > 0.0)))
            if bad.size:
                row = f"row {bad[0] + 1} of the numbers is not complete, or not positive"
                raise MeasurementError(f"cannot be used: {row}", "correct the table")
            return kind, rows
    raise MeasurementError(
        "is no test of a pad",
        "it needs columns frequency (Hz), storage (kN/m), loss factor, or time (s), stiffness (kN/m), with units in "
        "the headings",
    )


REACH = 10.0  # beyond the measured range, over which times are sought


@dataclass(frozen=True)
class BranchFit:
    """A spring and branches beside it, in the order of their times."""

    stiffness: float  # N/m
    branches: tuple[MaxwellBranch, ...]
    misfit: float  # root mean square of the relative errors
    least_misfit: float  # the same with as many branches as there could be
    at_limit: tuple[float, ...]  # s, times that are not determined: at the limit of what was measured


def dynamic_stiffness(stiffness: float, branches: tuple[MaxwellBranch, ...], omega: Floats) -> Complexes:
    """Complex stiffness of a spring with Maxwell branches beside it.

    Parameters
    ----------
    stiffness : of the spring, N/m.
    branches : beside it.
    omega : (w,) angular frequencies, rad/s.

    Returns
    -------
    (w,) array
        N/m.
    """
    k = np.array([stiffness, *(b.stiffness for b in branches)])
    return np.asarray(_dynamic(omega, np.array([b.relaxation_time for b in branches])) @ k)


def relaxation(stiffness: float, branches: tuple[MaxwellBranch, ...], time: Floats, ramp: float = 0.0) -> Floats:
    """Force of a spring with Maxwell branches beside it, under a unit deflection that is held.

    Parameters
    ----------
    stiffness : of the spring, N/m.
    branches : beside it.
    time : (t,) since the deflection began, s.
    ramp : time over which the deflection rises evenly, s; 0 where it is sudden.

    Returns
    -------
    (t,) array
        N/m.
    """
    k = np.array([stiffness, *(b.stiffness for b in branches)])
    return np.asarray(_relaxing(time, np.array([b.relaxation_time for b in branches]), ramp) @ k)


def fit_dynamic(omega: Floats, storage: Floats, loss_factor: Floats, branches: int | None = None) -> BranchFit:
    """Maxwell branches from a dynamic test.

    Errors are relative to the size of the complex stiffness.

    Parameters
    ----------
    omega : (w,) angular frequencies, rad/s.
    storage, loss_factor : (w,) storage stiffness, N/m, and loss factor there.
    branches : how many; by default as few as fit nearly as well as any number.

    Returns
    -------
    BranchFit
    """
    measured = storage * (1.0 + 1j * loss_factor)

    def matrix(times: Floats) -> Floats:
        columns = _dynamic(omega, times) / np.abs(measured)[:, None]
        return np.vstack([columns.real, columns.imag])

    target = measured / np.abs(measured)
    span = 1.0 / (float(omega.max()) * REACH), REACH / float(omega.min())
    return _fit(matrix, np.concatenate([target.real, target.imag]), omega.size, span, branches)


def fit_relaxation(time: Floats, stiffness: Floats, branches: int | None = None, ramp: float = 0.0) -> BranchFit:
    """Maxwell branches from a relaxation test.

    The deflection is applied suddenly or evenly; forces measured while it rises count as well.

    Parameters
    ----------
    time : (t,) since the deflection began, s.
    stiffness : (t,) force over the deflection that is held, N/m.
    branches : how many; by default as few as fit nearly as well as any number.
    ramp : time over which the deflection rises, s.

    Returns
    -------
    BranchFit
    """

    def matrix(times: Floats) -> Floats:
        return _relaxing(time, times, ramp) / stiffness[:, None]

    span = float(time[time > 0.0].min()) / REACH, float(time.max()) * REACH
    return _fit(matrix, np.ones(time.size), time.size, span, branches)


def _dynamic(omega: Floats, times: Floats) -> Complexes:
    turning = 1j * np.multiply.outer(omega, times)
    return np.column_stack([np.ones(omega.size), turning / (1.0 + turning)])


def _relaxing(time: Floats, times: Floats, ramp: float) -> Floats:
    if ramp == 0.0:
        return np.column_stack([np.ones(time.size), np.exp(-time[:, None] / times)])
    loaded = np.minimum(time, ramp)[:, None]  # how long the deflection has risen
    held = np.exp(-(time[:, None] - loaded) / times)
    return np.hstack([loaded / ramp, -times / ramp * np.expm1(-loaded / times) * held])


def _fit(
    matrix: Callable[[Floats], Floats], target: Floats, points: int, span: tuple[float, float], wanted: int | None
) -> BranchFit:
    low, high = np.log(span)
    # 60: relaxation times of the fit that is as good as any number of branches can be
    grid = np.linspace(low, high, 60)
    dense, size = _stiffnesses(matrix(np.exp(grid)), target)
    best, least = size / np.sqrt(points), size / np.sqrt(points)
    most = min(8, points) if wanted is None else wanted
    found: tuple[Floats, Floats, float] | None = None
    for count in range(0 if wanted is None else wanted, most + 1):
        found = _of_count(matrix, target, count, grid, dense[1:])
        # so near the best misfit further branches are not worth it
        if found[2] / np.sqrt(points) <= max(1.2 * best, best + 3e-3):
            break
    assert found is not None
    times, k, size = found
    order = np.argsort(times)
    kept = [i for i in order if k[1 + i] > 0.0]
    ends = np.exp([low, high])
    return BranchFit(
        float(k[0]),
        tuple(MaxwellBranch(float(k[1 + i]), float(times[i])) for i in kept),
        float(size / np.sqrt(points)),
        float(least),
        tuple(float(times[i]) for i in kept if times[i] < 1.01 * ends[0] or times[i] > 0.99 * ends[1]),
    )


def _of_count(
    matrix: Callable[[Floats], Floats], target: Floats, count: int, grid: Floats, spectrum: Floats
) -> tuple[Floats, Floats, float]:
    """Times, stiffnesses and size of the residual of the best fit with so many branches."""
    from scipy.optimize import least_squares

    if count == 0:
        return np.zeros(0), *_stiffnesses(matrix(np.zeros(0)), target)

    def residual(logarithms: Floats) -> Floats:
        columns = matrix(np.exp(logarithms))
        return np.asarray(columns @ _stiffnesses(columns, target)[0] - target)

    low, high = grid[0], grid[-1]
    shares = (np.arange(count) + 0.5) / count
    starts = [low + (high - low) * shares]
    if spectrum.sum() > 0.0:  # where the stiffness of the dense fit lies
        summed = np.cumsum(spectrum + 1e-6 * spectrum.sum())
        starts.append(np.interp(shares * summed[-1], summed, grid))
    fits = [least_squares(residual, start, bounds=(low - 1e-9, high + 1e-9)) for start in starts]
    best = min(fits, key=lambda fit: float(fit.cost))
    times = np.exp(best.x)
    return times, *_stiffnesses(matrix(times), target)


def _stiffnesses(columns: Floats, target: Floats) -> tuple[Floats, float]:
    """Non-negative stiffnesses and the size of the residual."""
    from scipy.optimize import nnls

    scale = np.linalg.norm(columns, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    numbers, size = nnls(columns / scale, target)
    return np.asarray(numbers / scale), float(size)
