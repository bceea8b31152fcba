"""The tables of identifications and comparisons."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from beamsim.analyses.compare.result import Comparison
from beamsim.analyses.identify.result import (
    FrequencyTable,
    IdentificationResult,
    ParameterEstimate,
    StiffnessEstimate,
)
from beamsim.plots.style import scale_for

Row = tuple[str, str]
SENSITIVITIES_SHOWN = 6


def comparison_rows(comparison: Comparison) -> Iterator[Row]:
    """Label and text of every row of the table of a comparison."""
    for c in comparison.channels:
        yield f"{c.place} {c.quantity.replace('_', ' ')}", f"measured: {c.channel}"
        if math.isfinite(c.rms_difference):
            negligible = abs(c.delay_s) * (c.excitation_hz if math.isfinite(c.excitation_hz) else 1.0) < 1e-9
            delay = "no delay" if negligible else f"a delay of {_si(c.delay_s, 's')}"
            yield "  histories", f"differ by {100 * c.rms_difference:.3g} % rms after {delay}"
        scale = scale_for(c.unit, np.abs(c.predicted), np.abs(c.measured))
        for n, p, m, d, a in zip(
            c.order, c.predicted, c.measured, c.difference_db, c.phase_difference_deg, strict=True
        ):
            text = f"predicted {abs(p) * scale.factor:9.4g}, measured {abs(m) * scale.factor:9.4g} {scale.unit}"
            phase = f", {a:+.1f} deg" if math.isfinite(a) else ""
            yield f"  harmonic {n}", f"{text}, difference {d:+.2f} dB{phase}"


def identification_rows(result: IdentificationResult) -> Iterator[Row]:
    """Label and text of every row of the table of an identification."""
    if result.update is not None:
        for k, parameter in enumerate(result.update.parameters):
            yield "" if k else "updated", _parameter(parameter)
        for path, choice in result.update.choices.items():
            yield "", f"{path}: {choice}"
        for text, misfit in result.update.alternatives[:4]:
            yield "  supports tried", f"{text}: misfit {misfit:.4g}"
        yield "  misfit", f"{result.update.misfit_before:.4g} before, {result.update.misfit_after:.4g} after"
        yield from _table("without, before", result.update.before)
    yield from _table("without the snubber", result.without_snubber)
    if result.mac is not None:
        for i, row in enumerate(result.mac):
            yield "MAC" if i == 0 else "", f"shape {i + 1}: " + ", ".join(f"{value:.3f}" for value in row)
    if result.estimate is not None and result.with_snubber is not None:
        yield from _stiffness(result.estimate, result)
        yield from _table("with permanent contact", result.with_snubber)
        for k, s in enumerate(result.sensitivities[:SENSITIVITIES_SHOWN]):
            part = f", uncertainty of k {100 * s.contribution:.2g} %" if math.isfinite(s.contribution) else ""
            yield "sensitivity" if k == 0 else "", f"1 % of {s.parameter} gives {s.relative:+.3g} % of k{part}"
    if result.nonlinear is not None:
        fit = result.nonlinear
        for k, parameter in enumerate(fit.parameters):
            yield "" if k else "estimated", _parameter(parameter)
        yield (
            "  misfit",
            f"{fit.misfit_before:.4g} before, {fit.misfit:.4g} after, {fit.degrees_of_freedom} degrees of freedom",
        )
        yield "  starts", f"{fit.starts_agreeing} of {fit.starts} reached the same minimum"
    yield "processor time", f"{1e3 * result.processor_time_s:.3g} ms"


def _stiffness(estimate: StiffnessEstimate, result: IdentificationResult) -> Iterator[Row]:
    modes = ", ".join(str(mode) for mode in estimate.fit_to)
    yield f"stiffness of {estimate.snubber}", f"{_si(estimate.stiffness, 'N/m')} (mode {modes}, {estimate.method})"
    if math.isfinite(estimate.standard_deviation):
        low, high = estimate.interval
        source = "" if estimate.uncertainty_from == "given" else ", from the scatter of the modes"
        yield "  standard deviation", f"{_si(estimate.standard_deviation, 'N/m')}{source}"
        yield f"  {100 * estimate.coverage:g} % interval", f"{_si(low, 'N/m')} to {_si(high, 'N/m')}"
        yield (
            "  Monte Carlo",
            f"{_si(estimate.monte_carlo_standard_deviation, 'N/m')}, {_si(estimate.monte_carlo_interval[0], 'N/m')} to "
            f"{_si(estimate.monte_carlo_interval[1], 'N/m')} ({estimate.monte_carlo_samples} samples)",
        )
    if estimate.total_standard_deviation > estimate.standard_deviation or (
        math.isnan(estimate.standard_deviation) and math.isfinite(estimate.total_standard_deviation)
    ):
        yield "  with the structure", f"{_si(estimate.total_standard_deviation, 'N/m')} standard deviation"
    if len(estimate.fit_to) > 1:
        each = (
            f"mode {mode}: {_si(k, 'N/m') if math.isfinite(k) else 'out of reach'}"
            for mode, k in zip(estimate.fit_to, estimate.individual, strict=True)
        )
        yield "  each mode alone", ", ".join(each)
    for mode, (low, high) in zip(estimate.fit_to, estimate.reach_hz, strict=True):
        yield f"  reach of mode {mode}", f"{low:.5g} Hz (free) to {high:.5g} Hz (pinned)"
    if math.isfinite(result.pad_modulus):
        yield "  pad's Young's modulus", _si(result.pad_modulus, "Pa")
    yield "  eigenvalue solutions", str(estimate.eigenvalue_solutions)


def _table(label: str, table: FrequencyTable) -> Iterator[Row]:
    for k, (mode, measured, predicted, difference) in enumerate(
        zip(table.mode, table.measured_hz, table.predicted_hz, table.difference_percent, strict=True)
    ):
        text = f"mode {mode}: predicted {predicted:.5g} Hz"
        if np.isfinite(measured):
            text += f", measured {measured:.5g} Hz, difference {difference:+.2f} %"
        yield label if k == 0 else "", text


def _parameter(p: ParameterEstimate) -> str:
    text = f"{p.parameter}: {p.before:.5g} -> {p.value:.5g}"
    if math.isfinite(p.standard_deviation):
        text += f" +- {p.standard_deviation:.2g} ({p.interval[0]:.5g} to {p.interval[1]:.5g})"
    return text + (" at its bound" if p.at_bound else "")


def _si(value: float, unit: str) -> str:
    if math.isnan(value):
        return "unknown"
    if math.isinf(value):
        return "infinity"
    scale = scale_for(unit, np.array([value]))
    return f"{value * scale.factor:.5g} {scale.unit}"
