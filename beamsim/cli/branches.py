"""First screens of continuations, coexisting motions and nonlinear normal modes."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from beamsim.analyses.coexisting.result import CoexistingResult
from beamsim.analyses.continuation.result import ContinuationResult
from beamsim.analyses.nnm.result import NormalModeResult
from beamsim.cli.screens import MOST_ROWS, MOST_SHOWN, WIDTH, Errors, Screen, limit_lines, more_rows, round_with_unit
from beamsim.orbits.branch import curve_event_name, special_name
from beamsim.outcomes import first_of
from beamsim.plots.style import amount, extent, is_known, percent, scale_for
from beamsim.scenario.base import count_text

# --- Continuation ----------------------------------------------------------------------------------------------------

LARGEST_DRIFT = 1e-6  # relative; after some fifty periods the round-off of a stable motion stays below it


def continuation_screen(result: ContinuationResult) -> Screen:
    """Largest displacement by level, special points and stability; largest forces."""
    s, errors = result.summary, Errors(result)
    of_branches = (result["branches"][name].values.tolist() for name in ("level", "period_multiple"))
    levels = list({repr(key): key for key in zip(*of_branches, strict=True)}.values())  # nan is not equal to itself
    rows = [_level_row(result, errors, *key) for key in levels[: 2 * MOST_SHOWN]]
    lines = (
        [f"{len(levels) - 2 * MOST_SHOWN} more levels and periods in the file"] if len(levels) > 2 * MOST_SHOWN else []
    )
    for entry, unit, what in (("peak_force_n", "N", "force"), ("peak_moment_n_m", "N m", "moment")):
        hardest = sorted(s.get(entry, {}).items(), key=lambda item: -item[1])[:MOST_SHOWN]
        forces = [f"{errors.number(force, unit, entry, name)} at {name}" for name, force in hardest if force > 0]
        if forces:
            lines.append(f"peak {what} of stable motions {', '.join(forces)}")
    lines += [*_special_lines(result), *_coexisting_ranges_text(result)]
    lines += [
        f"peak of {name} {errors.number(of['value'], s['output_unit'][name], 'peak_output', name)} at "
        f"{_parameter(of['parameter'], result.unit)}"
        for name, of in list(s.get("peak_output", {}).items())[:MOST_SHOWN]
    ]
    lines += _special_curve_lines(result)
    for of in s.get("multiple_scales", ()):
        lines.append(f"multiple scales: differences from the exact motions {_orders_text(of['observed_orders'])}")
    lines += limit_lines(result)
    return Screen(errors.verdict(), rows, [*lines, *errors.legend()])


def _special_curve_lines(result: ContinuationResult) -> Iterator[str]:
    """Extents of curves of special points, and their own special points."""
    s, unit = result.summary, result.second_unit
    curves = s.get("special_curves", ())
    for curve in curves:
        where = extent(curve["smallest_hz"], curve["largest_hz"], "Hz")
        if not curve["points"]:
            continue
        if curve["kind"] == "isola":
            yield f"isola at the {s['second_parameter']} of {amount(curve['smallest_parameter'], unit)}: {where}"
            continue
        over = extent(curve["smallest_parameter"], curve["largest_parameter"], unit)
        touching = f" ({curve['touching']} just touches)" if curve["touching"] else ""
        yield f"{special_name(curve['kind'])}s in {s['second_parameter']}: {over}, at {where}{touching}"
    events = [event for curve in curves for event in curve["events"]]
    events.sort(key=lambda event: event["kind"] == "extremum")  # the commonest ones last
    for event in events[:MOST_ROWS]:
        place = f"{amount(event['parameter'], unit)}, {event['frequency_hz']:.6g} Hz"
        yield f"{curve_event_name(event['kind'])} at {place}"
    if len(events) > MOST_ROWS:
        yield f"{count_text(len(events) - MOST_ROWS, 'more special point')} of these curves in the file"


def _orders_text(orders: Sequence[float | None]) -> str:
    """Orders of the differences from exact motions; unknown where there is no difference."""
    if not any(is_known(order) for order in orders):
        return "have no order that could be measured: there are none, or round-off is larger"
    return f"vanish with orders {', '.join(f'{order:.2f}' if is_known(order) else 'unknown' for order in orders)}"


def _level_row(result: ContinuationResult, errors: Errors, level: float, period: int) -> dict[str, str]:
    """Row of the branches of one level whose motions have the same period."""

    def is_of_level(
        item: Mapping[str, Any],
    ) -> bool:
        # in files the level is nan or missing if it is the continuation parameter
        same = item["level"] == level or not is_known(item["level"])
        return same and item.get("period_multiple", 1) == period

    rows, branch_of_point = result["branches"], result["points"]["branch"].values
    of_branch = (rows["level"].values == level) | np.isnan(level)
    own = (of_branch & (rows["period_multiple"].values == period))[branch_of_point]
    points, stable = int(own.sum()), int(result["points"]["stable"].values[own].sum())
    ends = result["points"]["parameter"].values[own]
    peak = max((p for p in result.summary["peaks"] if is_of_level(p)), key=lambda p: p["value_m"], default=None)
    row = {
        "": f"{_level(result, level)['level']}{f', period {period}' if period > 1 else ''}".removeprefix(", "),
        result.parameter: extent(float(ends.min()), float(ends.max()), result.unit),
        "largest displacement": "",
    }
    if peak is not None:
        place = f"{peak['probe']} level {peak['level']:.6g} period {period}"
        size = errors.number(peak["value_m"], "m", "peak_displacement_m", place)
        row["largest displacement"] = f"{size} at {_parameter(peak['parameter'], result.unit, 4)}, {peak['probe']}"
    row["stable"] = "all" if stable == points else f"{stable} of {points} points"
    return row


def _coexisting_ranges_text(result: ContinuationResult) -> Iterator[str]:
    """Widest range with several stable motions, as text."""
    ranges = sorted(result.coexisting(), key=lambda several: several.low - several.high)
    for several in ranges[:1]:
        where = extent(several.low, several.high, result.unit)
        several_levels = len(set(map(repr, result["branches"]["level"].values.tolist()))) > 1
        level = f" at {_level(result, several.level)['level']}" if several_levels else ""
        peaks = " or ".join(dict.fromkeys(amount(peak, "m", 3) for peak in several.peaks))
        at, more = _parameter(several.parameter, result.unit, 4), count_text(len(ranges) - 1, "more range")
        likely = " (kind: coexisting says how likely)"
        probes = result["points"].labels("probe")
        probe = f": {probes[0]} reaches {peaks} at {at}, by the start{likely}" if probes else ""
        yield f"{len(several.peaks)} stable motions from {where}{level}{probe}{f'; {more}' if ranges[1:] else ''}"


def _special_lines(result: ContinuationResult) -> list[str]:
    """Number and places of special points of each kind, over all levels and periods."""
    texts = []
    for kind, places in _special_points(result).items():
        scale = scale_for(result.unit, places)
        at = [f"{x * scale.factor:.4g}" for x in sorted(places)]
        more = f" and {len(at) - MOST_SHOWN} more" if len(at) > MOST_SHOWN else ""
        texts.append(f"{count_text(len(at), kind)} at {', '.join(at[:MOST_SHOWN])} {scale.unit}{more}")
    return textwrap.wrap("; ".join(texts), WIDTH)


def _special_points(result: ContinuationResult | NormalModeResult) -> dict[str, list[float]]:
    """Parameters of all special points, by the name of their kind."""
    special: dict[str, list[float]] = {}
    for point in result.summary.get("special_points") or ():
        special.setdefault(special_name(point["kind"]), []).append(point["parameter"])
    return special


def _level(result: ContinuationResult, level: float) -> dict[str, str]:
    return {"level": "" if np.isnan(level) else amount(level, result.level_unit)}


def _parameter(value: float, unit: str, digits: int = 6) -> str:
    """Value of the continuation parameter; frequencies with all requested digits."""
    return f"{value:.{digits}g} Hz" if unit == "Hz" else amount(value, unit, digits)


# --- Coexisting motions ----------------------------------------------------------------------------------------------


def coexisting_screen(result: CoexistingResult) -> Screen:
    """Motions with their shares of the starts, peaks, and smallest disturbances."""
    s, errors = result.summary, Errors(result)
    rows = [_motion(result, errors, motion) for motion in s["motions"][:MOST_ROWS]]
    unsettled = (
        (f"{count_text(count, 'start')} at {hz} Hz did not settle", count) for hz, count in s["not_settled"].items()
    )
    rows += more_rows(len(s["motions"]))
    lines = [text for text, count in unsettled if count]
    lines += [f"{_motion_name(each)}: {_smallest_disturbance_text(each)}" for each in s["disturbances"][:MOST_ROWS]]
    lines += limit_lines(result)
    starts = f"{s['starts']} starts at each of {count_text(len(s['not_settled']), 'frequency', 'frequencies')}"
    return Screen(f"{starts}, {errors.verdict()}", rows, [*lines, *errors.legend()])


def _motion(result: CoexistingResult, errors: Errors, motion: Mapping[str, Any]) -> dict[str, str]:
    """Row of a motion: displacement of the first probe, and force of the most loaded snubber."""
    row = {"": _motion_name(motion)}
    if is_known(motion["share"]):  # of an unstable motion, which no start comes to, there is none
        low, high = (f"{100 * motion[end]:.3g}" for end in ("share_low", "share_high"))
        row["share of starts"] = f"{percent(motion['share'])} ({low} to {high} %)"
    of, forces = motion.get("peak_displacement_m", {}), motion.get("peak_force_n", {})
    for what, name, entry, unit, sizes in (
        ("displacement", next(iter(of), ""), "peak_displacement_m", "m", of),
        ("peak force", max(forces, key=lambda name: forces[name], default=""), "peak_force_n", "N", forces),
    ):
        row[what] = f"{errors.number(sizes[name], unit, entry, name)}, {name}" if name else ""
    cycles, size = motion["period_cycles"], motion["largest_multiplier"]
    kind = f"period {cycles}, multiplier {size:.3f}" if cycles else motion["kind"]
    return row | {"motion": kind if motion["stable"] else f"unstable, {kind}"}


def _motion_name(record: Mapping[str, Any]) -> str:
    return f"{record['frequency_hz']:.6g} Hz, motion {record['number']}"


def _smallest_disturbance_text(record: Mapping[str, Any]) -> str:
    """Smallest disturbance after which a motion is left."""
    of = f"impulse at {record['probe']}" if record["probe"] else "velocity step of the base"
    if not is_known(record["amplitude"]):
        return f"no {of} up to {amount(record['largest_tried'], record['unit'], 3)} was found that leaves it"
    size, when = amount(abs(record["amplitude"]), record["unit"], 3), amount(record["time_s"], "s", 3)
    return f"left by the {of} of {size}, the smallest found ({when} into its period)"


# --- Nonlinear normal modes ------------------------------------------------------------------------------------------


def nnm_screen(result: NormalModeResult) -> Screen:
    """Forced motions at phase resonance if there are some, otherwise main points of the backbone."""
    s, errors = result.summary, Errors(result)
    first, last = s["start"], s["end"]
    stable = "all stable" if s["stable_points"] == s["points"] else f"{s['stable_points']} stable"
    followed = f"mode {s['mode']}: {s['points']} points, {stable}, in {result.parameter.replace('_', ' ')}"
    if "phase_resonance" in s:
        rows = [_phase_resonance_row(s["phase_resonance"], level) for level in s["phase_resonance"]["levels"]]
        span = extent(first["frequency_hz"], last["frequency_hz"], "Hz")
        followed += f", {span} at {extent(first['energy_j'], last['energy_j'], 'J')}"
    else:
        rows = [_backbone_row(result, errors, name, s[name], name) for name in ("start", "end")]
        for point in s.get("requested_points") or ():
            place = f"{point['quantity']} {point['value']:.6g} branch {point['branch']}"
            rows.append(_backbone_row(result, errors, "asked for", point, place))
    lines = [
        f"{followed}; linear frequency {amount(s['linear_frequency_hz'], 'Hz')}",
        *_branches_and_methods(result),
    ]
    return Screen(errors.verdict(), rows, [*lines, *errors.legend()])


def _backbone_row(
    result: NormalModeResult, errors: Errors, label: str, point: Mapping[str, Any], place: str
) -> dict[str, str]:
    """Row of a point: parameter, frequency and energy; a requested point has more.

    Parameters
    ----------
    label : name of the row.
    point : point of the summary.
    place : place of its frequency among the values compared with a finer model.
    """
    row = {
        "": label,
        "stiffness factor": f"{point['parameter']:.4g}" if result.parameter == "stiffness_factor" else "",
        "frequency": errors.number(point["frequency_hz"], "Hz", "frequency_hz", place),
        "energy": round_with_unit(point["energy_j"], "J"),
    }
    return row | ({"stable": "yes" if point["stable"] else "no"} if "stable" in point else {})


def _branches_and_methods(result: NormalModeResult) -> Iterator[str]:
    """Origins of other branches on the backbone, and differences of other methods."""
    s, unit = result.summary, result.unit
    tongues = s.get("internal_resonances", ())
    if tongues:
        at = [f"{_parameter(tongue['parameter'], unit, 3)} ({_cause(tongue)})" for tongue in tongues]
        yield f"internal resonances at {result.parameter.replace('_', ' ')} {first_of(at, MOST_SHOWN)}"
    found = {"jump": s.get("jumps") or (), **_special_points(result)}
    if some := [count_text(len(points), kind) for kind, points in found.items() if points]:
        yield f"along the backbone: {', '.join(some)}"
    if (drift := s.get("motion_drift", 0.0)) > LARGEST_DRIFT:
        after = f"after {s['motion_periods']} periods the drawn motion differs by {percent(drift, 2)} from its start"
        yield f"{after}: it is unstable, and the lines of its spectrum are broadened"
    if full := s.get("full_period"):
        branches = count_text(len(full["never_at_rest"]), "branch", "branches")
        yield f"full period: {branches} of motions that are never at rest"
    if of := s.get("multiple_scales"):
        yield f"multiple scales: differences of the frequency {_orders_text(of['observed_order_frequency'])}"
    if of := s.get("relaxed_minimisation"):
        apart = percent(of["largest_frequency_difference"], 2)
        reached = f"{of['steps_converged']} of {of['steps']} steps, frequency within {apart} of the exact one"
        yield f"relaxed minimisation: {reached}, {of['cost_ratio']:.3g} times the cost of shooting"


def _cause(record: Mapping[str, Any]) -> str:
    known = record["ratio"] and record["mode"]
    return f"{record['ratio']}:1 with mode {record['mode']}" if known else "of high order, not traced"


def _phase_resonance_row(resonance_summary: Mapping[str, Any], level: Mapping[str, Any]) -> dict[str, str]:
    """Row of a level: phase resonance, and prediction from the mode."""
    row = {"": amount(level["level"], resonance_summary["unit"])}
    if level["found"]:
        row |= {
            "resonance": round_with_unit(level["frequency_hz"], "Hz", 4),
            f"amplitude of {resonance_summary['probe']}": round_with_unit(level["amplitude_m"], "m"),
            "stable": "yes" if level["stable"] else "no",
        }  # fmt: skip
    else:
        row |= {"resonance": "not found"}
    return row | {
        "predicted resonance": round_with_unit(level["predicted_frequency_hz"], "Hz", 4),
        "predicted amplitude": round_with_unit(level["predicted_amplitude_m"], "m"),
        "predicted level": amount(level["level_for_amplitude"], resonance_summary["unit"], 3) if level["found"] else "",
    }
