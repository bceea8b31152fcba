"""First screens of identifications and of comparisons with measurements."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from beamsim.analyses.compare.result import SHIFTED, ChannelComparison, Comparison, RecordPair, Shift
from beamsim.analyses.compare_modes.analysis import ModeComparison
from beamsim.analyses.identify.layouts import WITH, WITHOUT
from beamsim.analyses.identify.result import IdentificationResult
from beamsim.cli.screens import MOST_ROWS, MOST_SHOWN, Screen, limit_lines, more_rows, round_with_unit
from beamsim.labelled import Dataset
from beamsim.measurements.signal import split_heading
from beamsim.plots.style import amount, extent, percent, value_text
from beamsim.results.values import parameter_label
from beamsim.scenario.base import count_text

# --- Identification --------------------------------------------------------------------------------------------------


def identification_screen(result: IdentificationResult) -> Screen:
    """Identified values with intervals, and the remaining differences of the frequencies."""
    rows, s = [], result.summary
    if "stiffness" in result.datasets:
        estimate, std = result["stiffness"], s["standard_deviation_n_per_m"]
        row = {"": f"stiffness of {s['snubber']}", "found": _estimate_text(s["stiffness_n_per_m"], "N/m", std)}
        row |= _scatter(std, estimate["interval"].values.tolist(), "N/m", s["coverage"])
        rows.append(row | {"from": f"mode {', '.join(map(str, s['fit_to']))}, {s['method']}"})
    for name in ("update", "nonlinear"):
        rows += _parameters(result, result[name]) if name in result.datasets else []
    tables = {
        words: table
        for name, words in ((WITH, "with contact"), (WITHOUT, "without the stop"))
        if (table := result["frequencies"].groups("frequency_model").get(name)) is not None
        and np.any(np.isfinite(table["difference_percent"].values))
    }
    return Screen(_agreement(tables), rows, list(_facts(result, tables)))


def _estimate_text(value: float, unit: str, deviation: float) -> str:
    """Value to the digits that its standard deviation supports."""
    known = math.isfinite(deviation) and deviation > 0.0 and value
    return round_with_unit(value, unit, max(round(math.log10(abs(value) / deviation)) + 2, 1) if known else 4)


def _scatter(deviation: float, interval: Sequence[float], unit: str, coverage: float) -> dict[str, str]:
    if not math.isfinite(deviation):
        return {}
    return {
        "\u00b1": round_with_unit(deviation, unit, 2),
        f"{percent(coverage)} interval": extent(interval[0], interval[1], unit),
    }


def _agreement(tables: Mapping[str, Dataset]) -> str:
    """Largest difference of measured frequencies from the model, with and without the stop."""
    worst = {name: np.nanmax(np.abs(table["difference_percent"].values)) for name, table in tables.items()}
    within = " and ".join(f"{value:.2g} % {name}" for name, value in worst.items())
    return f"frequencies within {within}" if within else ""


def _facts(result: IdentificationResult, tables: Mapping[str, Dataset]) -> Iterator[str]:
    """Frequencies, misfits and sensitivities."""
    s, datasets = result.summary, result.datasets
    for name, table in tables.items():
        computed, measured = (value_text("_hz", table[f"{of}_hz"].values.tolist()) for of in ("predicted", "measured"))
        yield f"frequencies {name}: {computed}; measured {measured}"
    if "shapes" in datasets:
        yield f"MAC of paired shapes: {value_text('', np.diagonal(datasets['shapes']['mac'].values).tolist())}"
    for name in ("update_misfit", "nonlinear_misfit"):
        if name in s:
            yield "misfit {:.4g} before, {:.4g} after".format(*s[name])
    if "nonlinear" in datasets:
        yield from _facts_of_fit(datasets["tests"], s)
    if supports := {path: each for path, each in s.get("updated", {}).items() if isinstance(each, str)}:
        yield ", ".join(f"{parameter_label(path)} {choice}" for path, choice in supports.items())
    if "pad" in datasets:
        yield _pad_text(datasets["pad"])
    if s.get("sensitivities"):
        largest = list(s["sensitivities"].items())[:MOST_SHOWN]
        parts = (f"{parameter_label(path)} {value:+.2g} %" for path, value in largest)
        yield f"an increase of 1 % changes the stiffness by: {', '.join(parts)}"


def _facts_of_fit(tests: Dataset, summary: Mapping[str, Any]) -> Iterator[str]:
    """Test with the worst agreement, and number of starts that reached the minimum."""
    without, misfit = tests["misfit_without"].values, summary["nonlinear_misfit"][1]
    if np.isfinite(without).any() and misfit > 0.0:
        worst = int(np.nanargmin(without))
        name, share = tests["name"].values[worst], percent(float(tests["misfit"].values[worst]) / misfit, 2)
        yield f"{name} has {share} of the misfit; without it {without[worst]:.4g} would be left"
    agreeing, starts = summary["starts_agreeing"]
    freedom = count_text(summary["nonlinear_degrees_of_freedom"], "degree of freedom", "degrees of freedom")
    yield f"{agreeing} of {starts} starts reached the same minimum, {freedom}"


def _pad_text(pad: Dataset) -> str:
    low, high = pad["stiffness_interval"].values.tolist()
    interval = extent(low, high, "N/m") if math.isfinite(low) else "not known"
    branches, misfit = count_text(len(pad.labels("branch")), "relaxation time"), percent(pad["misfit"].item(), 2)
    return f"pad {amount(pad['stiffness'].item(), 'N/m', 5)} ({interval}) at rest, {branches}, misfit {misfit} rms"


def _parameters(result: IdentificationResult, fit: Dataset) -> list[dict[str, str]]:
    section, rows = result.scenario.identify_stiffness, []
    assert section is not None
    for name in fit.labels("parameter"):
        p = fit.sel(parameter=name)
        unit, value, deviation = p["value"].unit, p["value"].item(), p["standard_deviation"].item()
        row = {"": parameter_label(name), "before": amount(p["initial_value"].item(), unit)}
        row["found"] = _estimate_text(value, unit, deviation) + (" at its bound" if p["at_bound"].item() else "")
        rows.append(row | _scatter(deviation, p["interval"].values.tolist(), unit, section.coverage))
    return rows


# --- Comparison ------------------------------------------------------------------------------------------------------


def comparison_screen(result: Comparison) -> Screen:
    """First harmonic of each channel, or highest peak of a sweep, measured and computed."""
    rows = []
    for c in result.channels[:MOST_ROWS]:
        rows.append({"": f"{c.place} {c.quantity.replace('_', ' ')}"})
        for k in np.flatnonzero(c.order == 1)[:1]:
            size = (
                round_with_unit(float(abs(c.measured[k])), c.unit),
                round_with_unit(float(abs(c.predicted[k])), c.unit),
            )
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
    of_pairs = [row for pair in result.pairs for row in _resonance_rows(pair)]
    more = len(result.channels) + len(result.sweeps) - len(rows)
    lines = [f"{count_text(more, 'more channel')} in the file"] if more else []
    if result.pairs:
        rows = [*of_pairs[:MOST_ROWS], *more_rows(len(of_pairs))]
        rate = f"; {SWEPT}: part that the sweep rate explains" if any(SWEPT in str(row) for row in rows) else ""
        lines = [f"±: what the resolution can explain; ({NOT_SIGNIFICANT}): explained by it{rate}"]
    return Screen("", rows, [*lines, *limit_lines(result)])


NOT_SIGNIFICANT, SWEPT = "not significant", "sweep"


def _resonance_rows(pair: RecordPair) -> Iterator[dict[str, str]]:
    """A row for each resonance of a channel in two tests."""
    names = split_heading(pair.channel)[0], split_heading(pair.channel_after)[0]
    name = " / ".join(dict.fromkeys(names))
    if not pair.resonances:
        yield {"": name, "before": "no peak", "after": "no peak"}
    for each in pair.resonances:
        row = {"": name}
        for side, f, level, damping in (("before", *each[:3]), ("after", *each[3:6])):
            parts = [f"{f:.5g} Hz", amount(level, pair.unit, 3), f"damping {percent(damping, 3)}"]
            known = parts[: 3 if math.isfinite(damping) else 2]
            row[side] = ", ".join(known) if math.isfinite(f) else f"none within {percent(each.frequency.lowest, 3)}"
        for quantity in SHIFTED:
            shift = getattr(each, quantity)
            row[quantity] = _shift_text(shift) if math.isfinite(shift.change) else ""
        yield row


def _shift_text(shift: Shift) -> str:
    """A change with what resolution and sweep rate explain."""
    if not math.isfinite(shift.resolution):
        return f"{100 * shift.change:+.3g} %, not known how much of it the sweep explains"
    swept = f", {SWEPT} {100 * shift.of_sweep:+.2g} %" if shift.of_sweep else ""
    verdict = "" if shift.significant else f" ({NOT_SIGNIFICANT})"
    return f"{100 * shift.change:+.3g} % ± {100 * shift.resolution:.2g} %{swept}{verdict}"


def modes_screen(result: ModeComparison) -> Screen:
    """Pairs of modes."""
    s, modes = result.summary, result["compared_modes"]
    lowest, apart = f"{s['lowest_mac']:.3f}", percent(s["largest_difference"])
    verdict = f"contacts {modes['contacts'].item()}, lowest MAC {lowest}, frequencies within {apart}"
    return Screen(verdict, _pair_rows(s["pairs"]), [f"shapes of {modes['source'].item()}, with those of the structure"])


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
