"""Maxwell branches of a pad from measurements of the pad itself."""

from __future__ import annotations

import numpy as np
from pydantic_core import PydanticCustomError

from beamsim.analyses.identify.branch_fit import dynamic_stiffness, fit_dynamic, fit_relaxation, relaxation
from beamsim.analyses.identify.pad_data import read_pad_data
from beamsim.analyses.identify.result import PadFit
from beamsim.errors import Problem, ScenarioError
from beamsim.measurements.signal import MeasurementError
from beamsim.scenario import Scenario
from beamsim.scenario.base import path_text
from beamsim.scenario.identification import Pad, PadData, check_data
from beamsim.typing import Complexes, Floats

AT = ("identify_stiffness", "pad", "data")
CURVE = 200  # points of the fitted curve
POOR = 0.05  # misfit above which a warning says so


def fit_pad(scenario: Scenario, pad: Pad, data: PadData) -> PadFit:
    """Fit branches to what was measured.

    Raises
    ------
    ScenarioError
        For a file that cannot be used.
    """
    kind, rows = _measured(scenario, pad, data)
    warnings = []
    dynamic, ramp = kind == "dynamic", data.ramp or 0.0
    if dynamic and ramp:
        message = f"goes with a relaxation test, and {data.file} is a dynamic one"
        raise ScenarioError(Problem(path_text((*AT, "ramp")), message, "leave ramp out"))
    fit = (
        fit_dynamic(2 * np.pi * rows[:, 0], rows[:, 1], rows[:, 2], data.branches)
        if dynamic
        else fit_relaxation(rows[:, 0], rows[:, 1], data.branches, ramp)
    )

    def fitted(at: Floats) -> Complexes:
        if dynamic:
            return dynamic_stiffness(fit.stiffness, fit.branches, 2 * np.pi * at)
        return relaxation(fit.stiffness, fit.branches, at, ramp).astype(complex)

    at = np.geomspace(rows[rows[:, 0] > 0.0, 0].min(), rows[-1, 0], CURVE)
    curve, of_measured = fitted(at), fitted(rows[:, 0])
    if fit.misfit > POOR:
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
        kind, rows = read_pad_data(file, per_modulus)
        check_data(rows.tolist(), kind, data.branches)
    except PydanticCustomError as error:
        context = error.context or {}
        row = next((f", row {part + 1} of the numbers" for part in context["at"] if isinstance(part, int)), "")
        raise ScenarioError(
            Problem(path_text(at), f"= {file.name}{row} {context['message']}", context["remedy"])
        ) from None
    except MeasurementError as fault:
        raise ScenarioError(Problem(path_text(at), f"= {data.file} {fault.message}", fault.remedy)) from None
    return kind, rows
