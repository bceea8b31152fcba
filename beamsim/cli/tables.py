"""Summaries as tables.

The entries of a summary (`Result.SUMMARY`) give order, labels and units of the table, which `beamsim.cli.printing`
prints. What the summary does not say by itself is told by views, which are where the first screen of each kind is. What
a first screen tells whole has no label, and no row: the table stands below the screen.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

from beamsim.analyses.run.result import ALLOWED_CHANGE
from beamsim.cli.printing import aligned, lines, percent, table_text, told
from beamsim.fields import place_in_words, words
from beamsim.kinds import KINDS, named
from beamsim.outcomes import OnLimit, Outcome
from beamsim.plots.style import amount, is_known, margin_text, scale_for, shown_in
from beamsim.results.result import Result
from beamsim.results.values import limit_label, limit_unit, of_angles
from beamsim.scenario.base import counted
from beamsim.scenario.quantities import acceleration_amplitude, amplitude_unit, level_unit, power_of

SMALLEST_CHANGE = 5e-7  # relative; less is shown as none
ONE_OF_MANY = "one of many motions"  # what depends on the motion after its contact sequences diverge
Row = tuple[str, str]


class Labelled(dict[str, Any]):
    """What an entry tells in several rows, by their labels; "" stands for that of the entry."""


Views = Mapping[str, Callable[[Any, Any], Any]]
"""By entry of a summary what is printed of its value, made of the result and the value: `Labelled`, or what
`beamsim.cli.printing.lines` takes."""


def all_rows(kind: str, result: Result) -> Iterator[Row]:
    """Label and text of every row of a result's table: what its first screen tells, then what that does not."""
    screen = named(KINDS[kind].screen)(result)
    yield from _labelled("status", filter(None, screen.status(result)))
    yield from _labelled("result", screen.told())
    yield from table_rows(kind, result)


def table_rows(kind: str, result: Result) -> Iterator[Row]:
    """Label and text of what the entries of a summary tell beyond the first screen."""
    views = SHARED | named(KINDS[kind].views)
    for entry in type(result).SUMMARY:
        if entry.label and entry.name in result.summary:
            value, unit = result.summary[entry.name], entry.unit
            change = partial(_change, result.summary, entry.name)
            if entry.name in views:
                value, unit = views[entry.name](result, value), ""
            for label, part in (value if isinstance(value, Labelled) else {"": value}).items():
                yield from _labelled(label or entry.label, lines(entry.name, part, unit, change))
    yield "wall time", amount(result.wall_time_s, "s")


def _labelled(label: str, texts: Iterable[str]) -> Iterator[Row]:
    for k, text in enumerate(texts):
        yield "" if k else label, text


def text_table(kind: str, result: Result) -> str:
    """Return the rows of a result's table as text, for Python's prompt, in the units of the scenario."""
    with shown_in(result.scenario.display_scales):
        return table_text(result.title, list(all_rows(kind, result)))


def _change(summary: Mapping[str, Any], entry: str, name: str) -> str:
    """What is said of the change of a value with a finer model; of a record the largest of its values.

    Parameters
    ----------
    summary : of a result.
    entry : of the value.
    name : of one of several values or records, perhaps in words; empty for a single one.
    """

    def of_record(place: str) -> str:  # the value of a record that a place is; empty if it is the whole
        record, _, value = place.rpartition(" ") if entry == "random" else ("", "", "")
        return value if name and name in (record, place_in_words("srs", record)) else ""

    def meant(place: str) -> bool:
        return name in (place, place_in_words(entry, place)) or bool(of_record(place))

    changes = summary.get("convergence", {}).get(entry, {})
    known = {
        place: x for place, x in (changes if isinstance(changes, Mapping) else {"": changes}).items() if meant(place)
    }
    marked = [[key.partition(".") for key in summary.get(which, ())] for which in ("after_parting", "doubtful")]
    after, doubtful = (any(of == entry and meant(place) for of, _, place in keys) for keys in marked)
    if not known:  # without a finer model the motion may be one of many, too
        return ONE_OF_MANY if after else ""
    worst = max(known, key=lambda place: known[place])
    of = words(of_record(worst))
    return _change_text(known[worst], doubtful, after) + (f" ({of})" if of else "")


def _change_text(change: float, doubtful: bool, after_parting: bool = False) -> str:
    """A relative change with a finer model, for the table."""
    size = "no change" if change < SMALLEST_CHANGE else f"change {percent(change, 2 if change < 0.995 else 3)}"
    if doubtful:
        size = f"NOT CONVERGED, {size}"
    elif change > ALLOWED_CHANGE:
        size = f"{size}, within the standard error of its mean"
    return f"{ONE_OF_MANY}, {size}" if after_parting else size


def together(*entries: str) -> Callable[[Result, Any], dict[str, dict[str, Any]]]:
    """The view of an entry with others that belong to it, by the names of the first, and when that is where known."""

    def view(result: Result, values: Mapping[str, float]) -> dict[str, dict[str, Any]]:
        s = result.summary
        times = s.get("peak_times_s", {}).get(entries[0], {})
        return {name: {entry: s[entry].get(name) for entry in entries} | {"at_s": times.get(name)} for name in values}

    return view


def output_text(output: Any, peak: float, **more: str) -> dict[str, str]:
    """The peak of an output, more of it by heading, what it is and where."""
    of = {"of": output.quantity.replace("_", " "), "on": output.at}
    return {"peak": amount(peak, output.unit), **more, **of}


def in_units(record: Mapping[str, Any], units: Mapping[str, str], digits: int = 4) -> dict[str, Any]:
    """A record with texts for the numbers whose unit is not that of their name.

    Parameters
    ----------
    record : what is told.
    units : by name of a number.
    digits : of these numbers.

    Returns
    -------
    A record of the same names in the same order.
    """
    return {
        name: amount(value, units[name], digits) if name in units and is_known(value) else value
        for name, value in record.items()
    }


def margins(result: Result, compared: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, str]]:
    """By limit: margin, value with its place, and limit."""
    return {
        limit_label(name): {
            "margin": margin_text(item["margin"], item["value"], item.get("margin_db")),
            "value": amount(item["value"], limit_unit(result.scenario, name)),
            "at": item["at"] or "",
            "limit": amount(item["limit"], limit_unit(result.scenario, name)),
            "verdict": item["verdict"] if item["verdict"] == OnLimit.MET else item["verdict"].upper(),
        }
        for name, item in compared.items()
    }


def of_states(texts: Mapping[str, str]) -> dict[str, str]:
    """Texts by the state of contacts, or the states that have the same; states whose text is empty are left out."""
    told = dict.fromkeys(filter(None, texts.values()))
    return {" and ".join(state for state, text in texts.items() if text == each): each for each in told}


def _by_state(entry: str, unit: str, factor: float = 1.0) -> Callable[[Result, Sequence[float]], dict[str, str] | str]:
    """The view of what modes have, with contacts open, closed and as they are at rest.

    What the static vectors add are no modes of the structure.
    """

    def view(result: Result, opened: Sequence[float]) -> dict[str, str] | str:
        s = result.summary
        states = {"open": opened, "closed": s.get(f"closed_{entry}"), "at rest": s.get(f"resting_{entry}")}
        known = {state: x[: s["kept_modes"]] for state, x in states.items() if x is not None}
        texts = of_states({state: told("", [factor * each for each in x], unit) for state, x in known.items()})
        return texts if len(texts) > 1 else next(iter(texts.values()))

    return view


def _reduction(result: Result, bound: float) -> str:
    s = result.summary
    kept = f"{counted(s['kept_modes'], 'mode')} and {counted(s['static_vectors'], 'static vector')}"
    if math.isnan(bound):
        return f"{kept}, error not known"
    probes = s.get("probe_bound")
    beside = "" if probes is None or math.isnan(probes) else f", {probes:.2g} between these and the probes,"
    up_to = f" up to {amount(s['highest_frequency_hz'], 'Hz')}"
    return f"{kept}, error below {bound:.2g} of the receptance at contacts and loads{beside}{up_to}"


def _base_correction(result: Result, share: float) -> str:
    """How the acceleration of a swept base differs from the specified one, if it does."""
    return f"{amount(result.summary['base_correction_m_s2'], 'm/s^2')}, {percent(share)} of the level" if share else ""


def stress_text(summary: Mapping[str, Any], stress: str) -> str:
    """The largest bending stress, which is given as text, on which body if there are several, and where."""
    body = f"{summary['largest_bending_stress_body']}, " if "largest_bending_stress_body" in summary else ""
    y = summary.get("largest_bending_stress_across_m", math.nan)
    across = "" if math.isnan(y) else f", y = {_length(y)}"
    return f"{stress} at {body}x = {_length(summary['largest_bending_stress_position_m'])}{across}"


def _length(metres: float) -> str:
    """A place along a body."""
    return amount(metres, "m") if metres else "0"


SIGMAS_REACHED = 5.0  # of a random motion: a Gaussian one passes them once in about a million cycles


def _gapping(result: Result, snubbers: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """By snubber: the level of the linear motion that changes contact, what the motion did, and the preload."""
    rows = []
    change = any(predicted(result, of)[1] for of in snubbers.values())
    for name, of in snubbers.items():
        past = "opened" if of["closed_at_rest"] else "touched"
        text, reached = predicted(result, of)
        reached |= change and "not_predicted" in of
        rows += [(name, text), *(("", happened) for happened in _happened(of, past))]
        if of["closed_at_rest"] and reached:
            unit_of = "N" if "preload_n" in of else "N m"
            together, alone = (of.get(key, of.get(of_angles(key))) for key in ("preload_n", "preload_alone_n"))
            kept = [amount(together, unit_of)]
            if len(snubbers) > 1:
                kept[0] += " with all closed"
                if "not_predicted" not in of:
                    kept.append(f"{amount(alone, unit_of)} with the others as at rest")
            sigmas = " to 3 sigma" if "sigmas" in of else ""
            rows.append(("", f"preload that keeps contact{sigmas}: {', '.join(kept)}"))
    return aligned(rows, gap=2)


def predicted(result: Result, of: Mapping[str, Any]) -> tuple[str, bool]:
    """What the linear motion does to a contact, and whether it is known to change it at the level here.

    Parameters
    ----------
    result : of which a summary is printed.
    of : the entry of a snubber in its ``gapping``.
    """
    if "not_predicted" in of:
        return f"not predicted: {of['not_predicted']}", False
    verb = "opens" if of["closed_at_rest"] else "touches"
    if "sigmas" in of:  # of a random input
        reached = of["sigmas"] < SIGMAS_REACHED
        rare = "" if reached else ", rarely or never"
        if not of["sigmas"]:
            return f"{verb} as soon as it moves", reached
        return f"{verb} at {of['sigmas']:.3g} sigma of the stationary linear motion{rare}", reached
    share = of["share_of_level"]
    reached = share <= 1.0
    if math.isinf(of.get("level") or 0.0) or (not math.isfinite(share) and "time_s" in of):
        return f"{verb} at no level of this input in linear motion", False
    if of.get("level") is None:
        level = f"from {share:.4g} times this input"
    else:
        level = f"from {_level(result, of)}" if of["level"] else "as soon as it moves"
    if "frequency_hz" in of:
        where = f"at {of['frequency_hz']:.4g} Hz in steady linear motion"
    else:
        where = f"at {amount(of['time_s'], 's')} in linear motion"
    return f"{verb} {level} {where}{'' if reached else ', above the level here'}", reached


def _level(result: Result, of: Mapping[str, Any]) -> str:
    """A predicted level in the quantity of the excitation; of a sine that moves the base also its acceleration."""
    quantity = getattr(result.scenario.excitation, "quantity", None) or "acceleration"
    level, beside = of["level"], ""
    if "frequency_hz" in of and power_of(quantity):
        beside = f" ({amount(level, amplitude_unit(quantity))})"
        level /= acceleration_amplitude(1.0, quantity, of["frequency_hz"])
    return f"{amount(level, level_unit(quantity))}{beside}"


def _happened(of: Mapping[str, Any], past: str) -> Iterator[str]:
    for curve, frequency in of.get("first_change_hz", {}).items():
        yield f"{curve} {f'{past} first at {frequency:.4g} Hz' if is_known(frequency) else 'never ' + past}"
    if "first_change_s" in of:
        time = of["first_change_s"]
        yield f"this motion {past} first at {amount(time, 's')}" if is_known(time) else f"this motion never {past}"
    for entry, unit in (("largest_gap_m", "m"), ("largest_gap_rad", "rad")):
        if of["closed_at_rest"] and of.get(entry):
            yield f"largest opening {amount(of[entry], unit)}"


def _convergence(result: Result, changes: Mapping[str, Any]) -> Iterator[str]:
    """What the changes of the values are those of, and the largest of them."""
    model = result.summary["convergence_model"]
    if model["reason"]:
        yield f"not checked: {model['reason']}"
    elif not model["modes"]:
        yield "all modes are kept: nothing is left out"
    else:
        sizes = [x for value in changes.values() for x in (value.values() if isinstance(value, Mapping) else [value])]
        finer = f"{model['modes']} instead of {model['first_modes']} modes"
        largest = percent(max(sizes, default=0.0), 2)
        where = f" of the first {amount(model['compared_s'], 's')}" if is_known(model.get("compared_s")) else ""
        elements = " and twice the elements of every mesh" if result.scenario.has_mesh else ""
        yield f"changes{where} with {finer}{elements}: at most {largest}"
    for key, of in (
        ("sequences_part_s", "the finer model"),
        ("disturbance_parts_s", "a relative change of 1e-9 of a stiffness"),
        ("round_off_parts_s", "round-off"),
    ):
        if is_known(model.get(key)):
            yield f"the contact sequences diverge at {amount(model[key], 's')} with {of}"
    if result.summary.get("after_parting"):
        yield f"values marked '{ONE_OF_MANY}' depend on what follows"


def _solver(result: Result, time: float) -> str:
    """What the solver did, and how long it took."""
    counts = {"cycles": "cycle", "events": "contact event", "breakpoints_passed": "passed breakpoint"}
    did = [counted(result.summary[name], noun) for name, noun in counts.items() if result.summary.get(name)]
    return ", ".join([*did, f"processor time {amount(time, 's')}"])


def ended(outcome: Outcome) -> str:
    """How a part of a computation ended, without saying of it that it is complete."""
    return "; ".join(text for text in outcome.displayed(scale_for).statements if text != "complete")


SHARED: Views = {
    "processor_time_s": _solver,
    "convergence": lambda result, changes: list(_convergence(result, changes)),
    "margins": margins,
    "open_frequencies_hz": _by_state("frequencies_hz", "Hz"),
    "damping_ratios": _by_state("damping_ratios", "%", 100.0),
    "reduction_bound": _reduction,
    "base_correction_share": _base_correction,
    "gapping": _gapping,
    "largest_bending_stress_pa": lambda result, stress: stress_text(result.summary, amount(stress, "Pa")),
    "energy_error": lambda _, error: f"{error:.2g}",
    "largest_residual": lambda _, residual: f"{residual:.2g}",
}
"""Of the entries that several analyses share."""
