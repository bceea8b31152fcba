"""The first screens of identifications and of comparisons with measurements."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from beamsim.analyses.compare.result import ChannelComparison, Comparison
from beamsim.analyses.compare_modes.analysis import ModeComparison
from beamsim.analyses.identify.result import IdentificationResult, NonlinearEstimate, PadFit, ParameterEstimate
from beamsim.cli.screens import MOST_ROWS, SHOWN, Screen, limit_lines, rounded
from beamsim.plots.style import amount, extent, percent, value_text
from beamsim.results.values import parameter_label
from beamsim.scenario.base import counted
from beamsim.scenario.parameters import unit_of

# --- Identification --------------------------------------------------------------------------------------------------


def identification_screen(result: IdentificationResult) -> Screen:
    """What was found with its interval, and how well the model then has the measured frequencies."""
    rows = []
    if (estimate := result.estimate) is not None:
        std, (low, high) = estimate.standard_deviation, estimate.interval
        row = {"": f"stiffness of {estimate.snubber}", "found": _found(estimate.stiffness, "N/m", std)}
        row |= _scatter(std, low, high, "N/m", estimate.coverage)
        rows.append(row | {"from": f"mode {', '.join(map(str, estimate.fit_to))}, {estimate.method}"})
    for part in (result.update, result.nonlinear):
        rows += [] if part is None else _parameters(result, part.parameters)
    return Screen(_agreement(result), rows, list(_facts(result)))


def _found(value: float, unit: str, deviation: float) -> str:
    """A value to the digits that its standard deviation supports."""
    known = math.isfinite(deviation) and deviation > 0.0 and value
    return rounded(value, unit, max(round(math.log10(abs(value) / deviation)) + 2, 1) if known else 4)


def _scatter(deviation: float, low: float, high: float, unit: str, coverage: float) -> dict[str, str]:
    if not math.isfinite(deviation):
        return {}
    return {"\u00b1": rounded(deviation, unit, 2), f"{percent(coverage)} interval": extent(low, high, unit)}


def _agreement(result: IdentificationResult) -> str:
    """How far the largest measured frequency is from the model, with and without the stop."""
    tables = {"with contact": result.with_snubber, "without the stop": result.without_snubber}
    worst = {
        name: float(np.nanmax(np.abs(table.difference_percent)))
        for name, table in tables.items()
        if table is not None and np.any(np.isfinite(table.difference_percent))
    }
    within = " and ".join(f"{value:.2g} % {name}" for name, value in worst.items())
    return f"frequencies within {within}" if within else ""


def _facts(result: IdentificationResult) -> Iterator[str]:
    """Frequencies, misfits and what the values depend on."""
    s = result.summary
    for name, table in (("with contact", result.with_snubber), ("without the stop", result.without_snubber)):
        if table is not None and np.any(np.isfinite(table.measured_hz)):
            computed, measured = (value_text("_hz", list(f)) for f in (table.predicted_hz, table.measured_hz))
            yield f"frequencies {name}: {computed}; measured {measured}"
    if result.mac is not None:
        yield f"MAC of paired shapes: {value_text('', np.diagonal(result.mac).tolist())}"
    for name in ("update_misfit", "nonlinear_misfit"):
        if name in s:
            yield "misfit {:.4g} before, {:.4g} after".format(*s[name])
    if result.nonlinear is not None:
        yield from _facts_of_fit(result.nonlinear, s)
    if result.update is not None and result.update.choices:
        yield ", ".join(f"{parameter_label(path)} {choice}" for path, choice in result.update.choices.items())
    if result.pad is not None:
        yield _pad_text(result.pad)
    if result.sensitivities:
        parts = (f"{parameter_label(each.parameter)} {each.relative:+.2g} %" for each in result.sensitivities[:SHOWN])
        yield f"1 % more changes the stiffness: {', '.join(parts)}"


def _facts_of_fit(fit: NonlinearEstimate, summary: Mapping[str, Any]) -> Iterator[str]:
    """Which test a fit agrees with least, and how many starts led to it."""
    judged = [test for test in fit.records if np.isfinite(test.misfit_without)]
    if judged and fit.misfit > 0.0:
        worst = min(judged, key=lambda test: test.misfit_without)
        share = percent(worst.misfit / fit.misfit, 2)
        yield f"{worst.name} has {share} of the misfit; without it {worst.misfit_without:.4g} would be left"
    if "starts_agreeing" in summary:
        agreeing, starts = summary["starts_agreeing"]
        freedom = counted(summary["nonlinear_degrees_of_freedom"], "degree of freedom", "degrees of freedom")
        yield f"{agreeing} of {starts} starts reached the same minimum, {freedom}"


def _pad_text(pad: PadFit) -> str:
    low, high = pad.stiffness_interval
    interval = extent(low, high, "N/m") if math.isfinite(low) else "not known"
    branches, misfit = counted(pad.branch_stiffness.size, "relaxation time"), percent(pad.misfit, 2)
    return f"pad {amount(pad.stiffness, 'N/m', 5)} ({interval}) at rest, {branches}, misfit {misfit} rms"


def _parameters(result: IdentificationResult, parameters: Sequence[ParameterEstimate]) -> list[dict[str, str]]:
    section, rows = result.scenario.identify_stiffness, []
    assert section is not None
    for p in parameters:
        unit = unit_of(result.scenario, p.parameter)
        row = {"": parameter_label(p.parameter), "before": amount(p.before, unit)}
        row["found"] = _found(p.value, unit, p.standard_deviation) + (" at its bound" if p.at_bound else "")
        rows.append(row | _scatter(p.standard_deviation, *p.interval, unit, section.coverage))
    return rows


# --- Comparison ------------------------------------------------------------------------------------------------------


def comparison_screen(result: Comparison) -> Screen:
    """By channel the first harmonic, or the highest peak of a sweep, measured and computed."""
    rows = []
    for c in result.channels[:MOST_ROWS]:
        rows.append({"": f"{c.place} {c.quantity.replace('_', ' ')}"})
        for k in np.flatnonzero(c.order == 1)[:1]:
            size = rounded(float(abs(c.measured[k])), c.unit), rounded(float(abs(c.predicted[k])), c.unit)
            phase = c.phase_difference_deg[k]
            rows[-1] |= dict(zip(("measured at 1 x", "computed"), size, strict=True)) | {
                "difference": f"{c.difference_db[k]:+.2f} dB" if math.isfinite(c.difference_db[k]) else "",
                "phase": f"{phase:+.1f} deg" if math.isfinite(phase) else "",
            }  # fmt: skip
        if (of := c.record) is not None:
            spectra = "{largest_difference_db:+.2f} dB at {largest_frequency_hz:.4g} Hz".format(**of.summary())
            rows[-1] |= {
                "measured peak": amount(of.measured_peak, c.unit), "computed peak": amount(of.predicted_peak, c.unit),
                "ratio": f"{of.summary()['peak_ratio']:.4g}", "scale": f"{of.scale:.4g} \u00b1 {of.scale_error:.2g}",
                "correlation": f"{of.correlation:.4f}", f"response spectra, Q = {of.quality:g}": spectra,
            }  # fmt: skip
        if math.isfinite(c.rms_difference):
            rows[-1]["histories"] = f"{percent(c.rms_difference)} rms after {_delay(c)}"
    for each in result.sweeps[:MOST_ROWS]:
        frac = f"{each.frac:.4f}{'' if each.has_phase else ' (of amplitudes)'}"
        rows.append({"": f"{each.place} {each.quantity.replace('_', ' ')}, {each.curve}", "FRAC": frac})
        for p in sorted(each.peaks, key=lambda p: -p.measured_level)[:1]:
            rows[-1]["measured peak"] = f"{amount(p.measured_level, each.unit, 3)} at {p.measured_hz:.4g} Hz"
            if math.isfinite(p.predicted_hz):
                rows[-1]["computed"] = f"{amount(p.predicted_level, each.unit, 3)} at {p.predicted_hz:.4g} Hz"
                rows[-1]["difference"] = f"{p.difference_db:+.2f} dB, {100 * p.frequency_difference:+.2f} %"
    more = len(result.channels) + len(result.sweeps) - len(rows)
    lines = [f"{counted(more, 'more channel')} in the file"] if more else []
    return Screen("", rows, [*lines, *limit_lines(result)])


def modes_screen(result: ModeComparison) -> Screen:
    """The pairs of modes."""
    s = result.summary
    lowest, apart = f"{s['lowest_mac']:.3f}", percent(s["largest_difference"])
    verdict = f"contacts {result.contacts}, lowest MAC {lowest}, frequencies within {apart}"
    return Screen(verdict, _pair_rows(s["pairs"]), [f"shapes of {result.source}, with those of the structure"])


def _delay(c: ChannelComparison) -> str:
    periods = abs(c.delay_s) * (c.excitation_hz if math.isfinite(c.excitation_hz) else 1.0)
    return "no delay" if periods < 1e-9 else f"a delay of {amount(c.delay_s, 's')}"


def _pair_rows(pairs: Sequence[Mapping[str, Any]]) -> list[dict[str, str]]:
    return [
        {
            "": f"mode {pair['number']}",
            "measured": f"{pair['measured_hz']:.5g} Hz",
            "computed": f"mode {pair['predicted']}, {pair['predicted_hz']:.5g} Hz"
            if pair["predicted"]
            else "none fits",
            "difference": f"{100 * pair['difference']:+.2f} %" if pair["predicted"] else "",
            "MAC": f"{pair['mac']:.3f}",
        }
        for pair in pairs
    ]
