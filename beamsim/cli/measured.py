"""What is printed of identifications and of comparisons with measurements: first screens, and what tables tell beyond
the entries of the summary."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from beamsim.analyses.compare.result import ChannelComparison, Comparison, PeakPair
from beamsim.analyses.compare_modes.analysis import ModeComparison
from beamsim.analyses.designs.result import parameter_label
from beamsim.analyses.identify.result import FrequencyTable, IdentificationResult, ParameterEstimate
from beamsim.cli.printing import MOST_ROWS, lines, percent, told
from beamsim.cli.screens import SHOWN, Screen, limit_lines, rounded
from beamsim.cli.tables import Labelled, Views
from beamsim.plots.style import amount, extent, scale_for
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
        rows += _parameters(result, () if part is None else part.parameters)
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
            computed, measured = (told("_hz", list(f)) for f in (table.predicted_hz, table.measured_hz))
            yield f"frequencies {name}: {computed}; measured {measured}"
    if result.mac is not None:
        yield f"MAC of paired shapes: {told('', np.diagonal(result.mac).tolist())}"
    for name in ("update_misfit", "nonlinear_misfit"):
        if name in s:
            yield "misfit {:.4g} before, {:.4g} after".format(*s[name])
    judged = [] if (fit := result.nonlinear) is None else [r for r in fit.records if np.isfinite(r.misfit_without)]
    if fit is not None and judged and fit.misfit > 0.0:
        worst = min(judged, key=lambda test: test.misfit_without)
        share = percent(worst.misfit / fit.misfit, 2)
        yield f"{worst.name} has {share} of the misfit; without it {worst.misfit_without:.4g} would be left"
    if "starts_agreeing" in s:
        agreeing, starts = s["starts_agreeing"]
        freedom = counted(s["nonlinear_degrees_of_freedom"], "degree of freedom", "degrees of freedom")
        yield f"{agreeing} of {starts} starts reached the same minimum, {freedom}"
    if result.update is not None and result.update.choices:
        yield ", ".join(f"{parameter_label(path)} {choice}" for path, choice in result.update.choices.items())
    if result.pad is not None:
        branches = counted(result.pad.branch_stiffness.size, "relaxation time")
        rest, misfit = _newtons(result.pad.stiffness), percent(result.pad.misfit, 2)
        yield f"pad {rest} ({_extent(result.pad.stiffness_interval)}) at rest, {branches}, misfit {misfit} rms"
    if result.sensitivities:
        parts = (f"{parameter_label(each.parameter)} {each.relative:+.2g} %" for each in result.sensitivities[:SHOWN])
        yield f"1 % more changes the stiffness: {', '.join(parts)}"


def _newtons(value: float) -> str:
    return amount(value, "N/m", 5)


def _updated(result: IdentificationResult, _: Any) -> Labelled | str:
    update = result.update
    if update is None:
        return ""
    supports = {text: f"misfit {misfit:.4g}" for text, misfit in update.alternatives[:4]}
    return Labelled({
        "supports tried": supports,
        "without, before": _frequencies(update.before),
    })  # fmt: skip


def _parameters(result: IdentificationResult, parameters: Sequence[ParameterEstimate]) -> list[dict[str, str]]:
    section, rows = result.scenario.identify_stiffness, []
    assert section is not None
    for p in parameters:
        unit = unit_of(result.scenario, p.parameter)
        row = {"": parameter_label(p.parameter), "before": amount(p.before, unit)}
        row["found"] = _found(p.value, unit, p.standard_deviation) + (" at its bound" if p.at_bound else "")
        rows.append(row | _scatter(p.standard_deviation, *p.interval, unit, section.coverage))
    return rows


def _frequencies(table: FrequencyTable | None) -> list[dict[str, Any]]:
    columns = ("mode", "predicted_hz", "measured_hz", "difference_percent")
    values = () if table is None else zip(*(getattr(table, name).tolist() for name in columns), strict=True)
    return [dict(zip(columns, row, strict=True)) for row in values]


def _monte_carlo(result: IdentificationResult, deviation: float) -> dict[str, Any] | str:
    if result.estimate is None or not math.isfinite(deviation):
        return ""
    low, high = result.summary["monte_carlo_interval_n_per_m"]
    of = {"standard_deviation_n_per_m": deviation, "from_n_per_m": low, "to_n_per_m": high}
    return of | {"samples": result.estimate.monte_carlo_samples}


def _each_mode(result: IdentificationResult, stiffness: Sequence[float]) -> str:
    modes = result.summary["fit_to"]
    texts = (
        f"mode {mode}: {_newtons(k) + f' ({_extent(ends)})' if math.isfinite(k) else 'out of reach'}"
        for mode, k, ends in zip(modes, stiffness, result.summary["stiffness_by_mode_interval_n_per_m"], strict=True)
    )
    return ", ".join(texts) if len(modes) > 1 else ""


def _reach(result: IdentificationResult, ranges: Sequence[Sequence[float]]) -> dict[str, str]:
    texts = {}
    for mode, (low, high) in zip(result.summary["fit_to"], ranges, strict=True):
        upwards = f"to {high:.5g} Hz (pinned)" if math.isfinite(high) else "upwards without bound"
        texts[f"mode {mode}"] = f"{low:.5g} Hz (free) {upwards}"
    return texts


def _table_slope(result: IdentificationResult, slope: float) -> list[str]:
    at = result.table_slope
    assert at is not None
    return [
        f"{_newtons(slope)} on segment {at.segment} of {at.segments}, under {amount(at.force, 'N', 4)}",
        f"identified: {at.factor:.4g} of it; all forces so with force_deflection.scale times {at.factor:.4g}",
    ]


def _sensitivities(result: IdentificationResult, _: Any) -> list[dict[str, str]]:
    return [
        {
            "1 % of": s.parameter,
            "changes the stiffness by": f"{s.relative:+.3g} %",
            "its uncertainty": percent(s.contribution, 2) if math.isfinite(s.contribution) else "",
        }
        for s in result.sensitivities[:6]
    ]


def _pad_branches(result: IdentificationResult, _: Any) -> list[dict[str, str]]:
    pad = result.pad
    assert pad is not None
    columns = (pad.branch_stiffness, pad.branch_interval, pad.relaxation_time, pad.time_interval)
    return [
        {"stiffness": amount(k, "N/m", 4), "its interval": _extent(of_stiffness),
         "relaxation time": amount(tau, "s", 4), "interval": _extent(of_time, "s")}
        for k, of_stiffness, tau, of_time in zip(*columns, strict=True)
    ]  # fmt: skip


def _extent(interval: Sequence[float], unit: str = "N/m") -> str:
    return extent(interval[0], interval[1], unit) if math.isfinite(interval[0]) else "not known"


def _test_misfits(result: IdentificationResult, misfits: Mapping[str, Sequence[float]]) -> list[dict[str, str]]:
    whole = sum(own for own, _ in misfits.values()) or 1.0
    return [
        {
            "": name,
            "misfit": f"{own:.4g}",
            "share": percent(own / whole, 2),
            "of the others alone": f"{without:.4g}" if math.isfinite(without) else "",
        }
        for name, (own, without) in misfits.items()
        if len(misfits) > 1
    ]


def _delays(_: IdentificationResult, delays: Mapping[str, Sequence[float]]) -> dict[str, str]:
    return {name: f"{amount(at, 's')} ({extent(low, high, 's')})" for name, (at, low, high) in delays.items()}


IDENTIFICATION_VIEWS: Views = {
    "updated": _updated,
    "frequencies_without_hz": lambda result, _: _frequencies(result.without_snubber),
    "mac": lambda _, mac: {f"shape {i}": told("", row) for i, row in enumerate(mac, 1)},
    "monte_carlo_standard_deviation_n_per_m": _monte_carlo,
    "stiffness_by_mode_n_per_m": _each_mode,
    "reachable_hz": _reach,
    "table_slope_n_per_m": _table_slope,
    "pad_branch_stiffness_n_per_m": _pad_branches,
    "pad_youngs_modulus_interval_pa": lambda result, ends: _extent(ends, "Pa") if math.isfinite(ends[0]) else "",
    "pad_yaml": lambda _, keys: keys.splitlines(),
    "frequencies_with_hz": lambda result, _: _frequencies(result.with_snubber),
    "sensitivities": _sensitivities,
    "test_misfits": _test_misfits,
    "test_delays_s": _delays,
}


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


def _channels(comparison: Comparison, _: Sequence[Any]) -> Labelled:
    parts = Labelled()
    for c in comparison.channels:
        texts = [f"measured: {c.channel}"]
        if c.start_s is not None:
            texts[0] += f", the run from {amount(c.start_s, 's')} on"
        if (of := c.record) is not None:
            texts.append(f"response spectra: {of.frequency_hz[0]:.4g} to {of.frequency_hz[-1]:.4g} Hz")
        parts[f"{c.place} {c.quantity.replace('_', ' ')}"] = [*texts, *lines("harmonics", _harmonics(c))]
    return parts


def _harmonics(c: ChannelComparison) -> list[dict[str, Any]]:
    scale = scale_for(c.unit, np.abs(c.predicted), np.abs(c.measured))
    rows = zip(c.order.tolist(), c.predicted, c.measured, c.difference_db, c.phase_difference_deg, strict=True)
    return [
        {
            "harmonic": str(Fraction(order).limit_denominator(12)),
            "predicted": f"{abs(p) * scale.factor:.4g} {scale.unit}",
            "measured": f"{abs(m) * scale.factor:.4g} {scale.unit}",
            "difference": f"{d:+.2f} dB" if math.isfinite(d) else "one of them is round-off",
            "phase": f"{a:+.1f} deg" if math.isfinite(a) else "",
        }
        for order, p, m, d, a in rows
    ]


def _delay(c: ChannelComparison) -> str:
    periods = abs(c.delay_s) * (c.excitation_hz if math.isfinite(c.excitation_hz) else 1.0)
    return "no delay" if periods < 1e-9 else f"a delay of {amount(c.delay_s, 's')}"


def _sweeps(comparison: Comparison, _: Sequence[Any]) -> Labelled:
    parts = Labelled()
    for c in comparison.sweeps:
        texts = [f"measured: {c.channel}, {c.detector} of {c.curve}"]
        if c.begin_s is not None:
            width = "" if c.bandwidth is None else f", bandwidth {100 * c.bandwidth:.3g} % of the frequency"
            texts.append(f"tracked from {amount(c.begin_s, 's')} of the record{width}")
        parts[f"{c.place} {c.quantity.replace('_', ' ')}"] = [*texts, *lines("peaks", _peaks(c.peaks, c.unit))]
    if comparison.assurance is not None:
        diagonal = np.diagonal(comparison.assurance.fdac)
        lowest = f"lowest {np.min(diagonal):.3f} at {comparison.assurance.measured_hz[np.argmin(diagonal)]:.4g} Hz"
        parts["FDAC"] = f"at equal frequencies {np.mean(diagonal):.3f} in the mean, {lowest}"
    return parts


def _peaks(peaks: Iterable[PeakPair], unit: str) -> list[dict[str, Any]]:
    """What was measured and what is computed near it; of the computed peak nothing where none is near."""
    rows = []
    for p in peaks:
        row = {"measured": f"{p.measured_hz:.2f} Hz", "level": amount(p.measured_level, unit), "Q": p.measured_q}
        if math.isfinite(p.predicted_hz):
            row |= {"predicted": f"{p.predicted_hz:.2f} Hz", "its level": amount(p.predicted_level, unit)}
            row |= {"its Q": p.predicted_q, "difference": f"{100 * p.frequency_difference:+.2f} %"}
            row["in level"] = f"{p.difference_db:+.2f} dB"
        rows.append(row)
    return rows


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


COMPARISON_VIEWS: Views = {"comparisons": _channels, "sweeps": _sweeps}
MODE_VIEWS: Views = {}  # the first screen tells all
