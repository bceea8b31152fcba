"""Summaries as tables and as JSON.

The entries of a summary (`Result.SUMMARY`) give order, labels and units of the table. Values that are more than a
number and its unit have texts of their own, in a module for each kind of result.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from html import escape
from typing import Any

from beamsim.analyses.limits import limit_label, limit_unit
from beamsim.analyses.result import Result
from beamsim.analyses.run.result import ALLOWED_CHANGE
from beamsim.cli.printing import table_text
from beamsim.kinds import KINDS, named
from beamsim.plots.style import amount, is_known, level_text, margin_text, scale_for, shown_in
from beamsim.scenario.quantities import amplitude_unit

VALUES_SHOWN = 6  # of a list
SMALLEST_CHANGE = 5e-7  # relative; less is shown as none
ONE_OF_MANY = "one of many motions"  # what depends on the motion after its contact sequences diverge
Row = tuple[str, str]
Rows = Iterable[Row]  # the label of the first is that of the entry if it is empty
Texts = Mapping[str, Callable[[Any, Any], str | Mapping[str, str] | Rows]]
"""Of entries of a summary: the text of a value, texts by name, or whole rows, from the result and the value."""


def table_rows(kind: str, result: Result) -> Iterator[Row]:
    """Label and text of every row of a result's table: first the status if there is more to say than complete."""
    if result.outcome.message or result.outcome.parts:
        yield from _labelled("status", [("", text) for text in result.outcome.displayed(scale_for).statements])
    texts = named(KINDS[kind].texts) if KINDS[kind].texts else {}
    for entry in type(result).SUMMARY:
        if entry.label and entry.name in result.summary:
            value = result.summary[entry.name]
            text = texts[entry.name](result, value) if entry.name in texts else shown(value, entry.unit)
            text = _with_changes(result.summary, entry.name, text)
            yield from _labelled(entry.label, text)
    yield "wall time", amount(result.wall_time_s, "s")


def text_table(kind: str, result: Result) -> str:
    """Return the rows of a result's table as text, for Python's prompt, in the units of the scenario."""
    with shown_in(result.scenario.display_scales):
        return table_text(result.title, list(table_rows(kind, result)))


def html_table(kind: str, result: Result) -> str:
    """Return the rows of a result's table as HTML, for notebooks, in the units of the scenario."""
    with shown_in(result.scenario.display_scales):
        rows = "".join(
            f'<tr><th style="text-align:left;vertical-align:top">{escape(label)}</th>'
            f'<td style="text-align:left;white-space:pre-wrap">{escape(text)}</td></tr>'
            for label, text in table_rows(kind, result)
        )
    return f"<table><caption>{escape(result.title)}</caption>{rows}</table>"


def _with_changes(
    summary: Mapping[str, Any], figure: str, text: str | Mapping[str, str] | Rows
) -> str | Mapping[str, str] | Rows:
    """The texts of a figure with its relative change with a finer model, where that is known."""
    changes = summary.get("convergence", {}).get(figure)
    if changes is None:  # without a finer model the motion may be one of many, too
        after = summary.get("after_parting", ())
        if isinstance(text, Mapping):
            marked = {name: f"{figure}.{name}" in after for name in text}
            return {name: f"{item}; {ONE_OF_MANY}" if marked[name] else item for name, item in text.items()}
        return f"{text}; {ONE_OF_MANY}" if isinstance(text, str) and figure in after else text
    if isinstance(text, str) and isinstance(changes, float):
        return f"{text}; {change_of(summary, figure)}"
    if isinstance(text, Mapping) and isinstance(changes, Mapping) and text.keys() == changes.keys():
        return {name: f"{item}; {change_of(summary, figure, name)}" for name, item in text.items()}
    return text


def change_of(summary: Mapping[str, Any], figure: str, name: str = "") -> str:
    """The text of a figure's change, marked where it does not converge or is one of many motions."""
    changes = summary["convergence"][figure]
    called = f"{figure}.{name}" if name else figure
    marks = called in summary.get("doubtful", ()), called in summary.get("after_parting", ())
    return change_text(changes[name] if name else changes, *marks)


def change_text(change: float, doubtful: bool, after_parting: bool = False) -> str:
    """A relative change with a finer model, for the table."""
    size = "no change" if change < SMALLEST_CHANGE else f"change {percent(change, 2 if change < 0.995 else 3)}"
    if doubtful:
        size = f"NOT CONVERGED, {size}"
    elif change > ALLOWED_CHANGE:
        size = f"{size}, within the standard error of its mean"
    return f"{ONE_OF_MANY}, {size}" if after_parting else size


def _labelled(label: str, text: str | Mapping[str, str] | Rows) -> Iterator[Row]:
    if isinstance(text, str):
        text = [("", text)] if text else []
    elif isinstance(text, Mapping):
        text = aligned(text)
    for k, (first, value) in enumerate(text):
        yield first if k else first or label, value


def aligned(texts: Mapping[str, str]) -> Iterator[Row]:
    """Texts by name as rows, the names in a column."""
    width = max((len(name) for name in texts), default=0)
    for name, text in texts.items():
        yield "", f"{name:<{width}}  {text}".strip()


def shown(value: Any, unit: str) -> str | Mapping[str, str]:
    """The text of a value that needs no more than its unit; of a mapping the texts of all its values by name."""
    if isinstance(value, Mapping):
        return dict(_shown_by_name(value, unit))
    if isinstance(value, (list, tuple)):
        texts = [f"{item:.4g}" for item in value[:VALUES_SHOWN]]
        return f"{', '.join(texts)}{', …' if len(value) > VALUES_SHOWN else ''} {'' if unit == '1' else unit}".strip()
    return value.replace("_", " ") if isinstance(value, str) else amount(value, unit)


def _shown_by_name(value: Mapping[str, Any], unit: str, name: str = "") -> Iterator[Row]:
    for key, item in value.items():
        path = f"{name} {key}".strip()
        if isinstance(item, Mapping):
            yield from _shown_by_name(item, unit, path)
        else:
            yield path, str(shown(item, unit))


def percent(share: float, digits: int = 3) -> str:
    """A share in percent."""
    return f"{100 * share:.{digits}g} %"


def pair(values: Sequence[float]) -> str:
    """Two observed orders; one that could not be observed is called unknown.

    >>> pair([1.998, float("nan")])
    '2.00 and unknown'
    """
    return " and ".join("unknown" if math.isnan(value) else f"{value:.2f}" for value in values[:2])


def counted(number: int, noun: str) -> str:
    """A number of things.

    >>> counted(1, "mode"), counted(2, "mode")
    ('1 mode', '2 modes')
    """
    return f"{number} {noun}{'' if number == 1 else 's'}"


def few(texts: Iterable[str], most: int = VALUES_SHOWN) -> str:
    """The first of several texts, and how many more there are."""
    known = list(texts)
    return ", ".join(known[:most]) + (f" and {len(known) - most} more" if len(known) > most else "")


def margins(result: Result, compared: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    """By limit: margin, value with its place, and limit."""
    texts = {}
    for name, item in compared.items():
        unit = limit_unit(result.scenario, name)
        share = margin_text(item["margin"], item["value"])
        verdict = "EXCEEDED, " if item["exceeded"] else ""
        at = f" at {item['at']}" if item["at"] else ""
        texts[limit_label(name)] = (
            f"{verdict}margin {share}: {amount(item['value'], unit)}{at}, limit {amount(item['limit'], unit)}"
        )
    return texts


def _natural_frequencies(result: Result, opened: Sequence[float]) -> dict[str, str]:
    """Those of the modes kept, with open and with closed contacts; once where they are the same.

    What the static vectors add are no frequencies of the structure.
    """
    kept = result.summary.get("kept_modes", len(opened))
    opened, closed = opened[:kept], result.summary["closed_frequencies_hz"][:kept]
    states = {"open": str(shown(opened, "Hz")), "closed": str(shown(closed, "Hz"))}
    return states if opened != closed else {"": states["open"]}


def _reduction(result: Result, bound: float) -> str:
    s = result.summary
    kept = f"{counted(s['kept_modes'], 'mode')} and {counted(s['static_vectors'], 'static vector')}"
    if math.isnan(bound):
        return f"{kept}, error not known"
    probes = s.get("probe_bound")
    beside = "" if probes is None or math.isnan(probes) else f", {probes:.2g} between these and the probes,"
    highest = s.get("highest_frequency_hz")  # which earlier files lack
    up_to = "" if highest is None else f" up to {amount(highest, 'Hz')}"
    return f"{kept}, error below {bound:.2g} of the receptance at contacts and loads{beside}{up_to}"


def base_correction(result: Result, share: float) -> str:
    """How the acceleration of a swept base differs from the specified one, if it does."""
    return f"{amount(result.summary['base_correction_m_s2'], 'm/s^2')}, {percent(share)} of the level" if share else ""


SIGMAS_REACHED = 5.0  # of a random motion: a Gaussian one passes them once in about a million cycles


def gapping(result: Result, snubbers: Mapping[str, Mapping[str, Any]]) -> Iterator[Row]:
    """By snubber: the level of the linear motion that changes contact, what the motion did, and the preload."""
    width = max((len(name) for name in snubbers), default=0)
    unit = amplitude_unit(getattr(result.scenario.excitation, "quantity", None) or "acceleration")
    for name, of in snubbers.items():
        past = "opened" if of["closed_at_rest"] else "touched"
        text, reached = predicted(of, unit)
        yield "", f"{name:<{width}}  {text}"
        happened = list(_happened(of, past))
        if happened:
            yield "", f"{'':<{width}}  {'; '.join(happened)}"
        if of["closed_at_rest"] and reached:
            kept = amount(of["preload_n"], "N")
            both = f"{kept} with all closed, {amount(of['preload_alone_n'], 'N')} alone" if len(snubbers) > 1 else kept
            to = " to 3 sigma" if "sigmas" in of else ""
            yield "", f"{'':<{width}}  preload that keeps contact{to}: {both}"


def predicted(of: Mapping[str, Any], unit: str) -> tuple[str, bool]:
    """What the linear motion does to a contact, and whether it changes it at the level here.

    Parameters
    ----------
    of : the entry of a snubber in the summary's ``gapping``.
    unit : of the level.
    """
    verb = "opens" if of["closed_at_rest"] else "touches"
    if "sigmas" in of:  # of a random input
        reached = of["sigmas"] < SIGMAS_REACHED
        rare = "" if reached else ", rarely or never"
        if not of["sigmas"]:
            return f"{verb} as soon as it moves", reached
        return f"{verb} at {of['sigmas']:.3g} sigma of the stationary linear motion{rare}", reached
    share = of["share_of_level"]
    reached = share <= 1.0
    if not math.isfinite(share) and "time_s" in of:
        return f"{verb} at no level of this input in linear motion", False
    if of.get("level") is None:
        level = f"from {share:.4g} times this input"
    else:
        level = f"from {level_text(of['level'], unit).removeprefix('level ')}" if of["level"] else "as soon as it moves"
    if "frequency_hz" in of:
        where = f"at {of['frequency_hz']:.4g} Hz in steady linear motion"
    else:
        where = f"at {amount(of['time_s'], 's')} in linear motion"
    return f"{verb} {level} {where}{'' if reached else ', above the level here'}", reached


def _happened(of: Mapping[str, Any], past: str) -> Iterator[str]:
    for curve, frequency in of.get("first_change_hz", {}).items():
        yield f"{curve} {f'{past} first at {frequency:.4g} Hz' if is_known(frequency) else 'never ' + past}"
    if "first_change_s" in of:
        time = of["first_change_s"]
        yield f"this motion {past} first at {amount(time, 's')}" if is_known(time) else f"this motion never {past}"
    if of["closed_at_rest"] and of.get("largest_gap_m"):
        yield f"largest opening {amount(of['largest_gap_m'], 'm')}"


def _convergence(result: Result, changes: Mapping[str, Any]) -> Iterator[Row]:
    """What the changes of the values are those of, and the largest of them."""
    model = result.summary["convergence_model"]
    if model["reason"]:
        yield "", f"not checked: {model['reason']}"
    elif not model["modes"]:
        yield "", "all modes are kept: nothing is left out"
    else:
        sizes = [x for value in changes.values() for x in (value.values() if isinstance(value, Mapping) else [value])]
        finer = f"{model['modes']} instead of {model['first_modes']} modes"
        largest = percent(max(sizes, default=0.0), 2)
        where = f" of the first {amount(model['compared_s'], 's')}" if is_known(model.get("compared_s")) else ""
        elements = " and twice the elements of every mesh" if result.scenario.has_mesh else ""
        yield "", f"changes{where} with {finer}{elements}: at most {largest}"
        if is_known(model["sequences_part_s"]):
            yield "", f"the contact sequences diverge at {amount(model['sequences_part_s'], 's')}"
    small, round_off = (
        ("disturbance_parts_s", "a relative change of 1e-9 of a stiffness"),
        ("round_off_parts_s", "round-off"),
    )
    for key, of in (small, round_off):
        if is_known(model.get(key)):
            yield "", f"they diverge at {amount(model[key], 's')} with {of}"
    if result.summary.get("after_parting"):
        yield "", f"values marked '{ONE_OF_MANY}' depend on what follows"


SHARED: Texts = {
    "convergence": _convergence,
    "margins": margins,
    "open_frequencies_hz": _natural_frequencies,
    "reduction_bound": _reduction,
}
"""Texts of the entries that several analyses share."""
