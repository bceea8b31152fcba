"""First screen of a result: a short summary for decisions. The rest is printed by ``--verbose`` and ``info``.

It has a title with the outcome and its reliability, one table of places, curves, branches, cases or parameters, a few
important lines, and the files. One function for each kind of result makes it (`beamsim.kinds`).
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from beamsim.kinds import KINDS
from beamsim.outcomes import EXIT_RULES, Verdict, first_of
from beamsim.plots.style import amount, is_known, margin_text, percent, scale_for
from beamsim.plots.understood import interpretation
from beamsim.results.result import ALLOWED_ERROR, Result
from beamsim.results.values import is_main_value, limit_label, limit_unit, limits, longer_run
from beamsim.scenario.base import count_text
from beamsim.scenario.quantities import (
    FACTOR,
    QUESTION_END,
    acceleration_amplitude,
    amplitude_unit,
    level_unit,
    power_of,
)
from beamsim.scenario.scenario import USED_SECTIONS
from beamsim.scenario.units import STANDARD_GRAVITY
from beamsim.summaries import value_in_words

MOST_SHOWN = 4  # items of long lists: outputs, contact levels, cases
DIGITS = 3  # largest number of digits; fewer if the last ones are below the second digit of the error
WIDTH = 160  # characters, above which records are printed side by side
MOST_ROWS = 24  # of a table
NO_VALUE = "-"
SMALLEST_ERROR = 1e-6  # relative; less cannot be distinguished from round-off
NO_LIMIT = "no limit: grows with the number of modes"
ONE_OF_MANY = "one of many motions"  # value that depends on the motion after its contact sequences diverge


@dataclass(frozen=True)
class Screen:
    """What is printed of a result below its title."""

    verdict: str  # follows the title and the outcome on the first line
    rows: Sequence[Mapping[str, str]]  # by heading; the first heading is empty
    lines: Sequence[str]

    def text(self, result: Result, files: Sequence[str]) -> str:
        """The screen; columns in which nothing is are left out.

        Parameters
        ----------
        result : with its title, outcome and warnings.
        files : written by the command, the result file first.
        """
        verdict, *statements = self.status(result)
        asked = [text for text in result.warnings if QUESTION_END in text]
        lines = ["  ".join(filter(None, (result.title or files[0], verdict))), *statements]
        lines += textwrap.wrap(interpretation_text(result), WIDTH)
        lines += [*(f"warning: {text}" for text in asked), *self.body()]
        more = len(result.warnings) - len(asked)
        notes = f"{count_text(more, 'note')} (-v shows them); " if more else ""
        pictures = [name for name in files[1:] if name.endswith(".png")]
        others = [name for name in files if name not in pictures]
        plots = [count_text(len(pictures), "plot")] if pictures else []
        return "\n".join([*lines, f"{notes}{', '.join([*others, *plots])}"])

    def status(self, result: Result) -> list[str]:
        """Outcome and reliability of the result; then the reason for an early end, if any."""
        outcome = result.outcome
        doubtful = first_of_keys(result, result.summary.get("doubtful", ()))
        worth = EXIT_RULES[outcome.gravest_kind].first_line
        if worth and doubtful and outcome.usable:
            worth = f"{worth}: {count_text(len(doubtful), 'value')}"
        statements = [part for text in outcome.in_display_units(scale_for).statements for part in text.split("; ")]
        verdict = ", ".join(filter(None, (worth, self.verdict)))
        return [verdict, *(f"{text[:1].upper()}{text[1:]}" for text in statements)]

    def body(self) -> list[str]:
        """The table without empty columns, and the lines below it."""
        names = dict.fromkeys(name for row in self.rows for name in row)
        headings = [name for name in names if any(row.get(name) for row in self.rows)]
        cells = [headings, *([row.get(name) or NO_VALUE for name in headings] for row in self.rows)]
        return [*(align_columns(cells) if headings else ()), *self.lines]


def align_columns(rows: Sequence[Sequence[str]], gap: int = 3) -> list[str]:
    """Join rows of cells to lines with aligned columns."""
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))] if rows else []
    between = " " * gap
    return [between.join(f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]


def more_rows(count: int) -> list[dict[str, str]]:
    """Row that replaces the rest of a table with ``count`` rows."""
    return [{"": f"and {count - MOST_ROWS} more in the file"}] if count > MOST_ROWS else []


def first_of_keys(result: Result, keys: Iterable[str]) -> list[str]:
    """Keys ``entry.place`` of a summary that are most important for a user."""
    modes = result.datasets.get("modes")
    return [key for key in keys if is_main_value(result.scenario, modes, key)]


_WITHOUT_LIMIT = "has no limit: it grows with the number of modes, because a force jumps at a point with little mass"


class Errors:
    """Errors of the values of a summary, from a finer model, for rounding, marks and text.

    Parameters
    ----------
    result : result with the values.
    """

    def __init__(self, result: Result) -> None:
        self._result = result
        self._known = {
            (entry, place): error
            for entry, of in result.summary.get("convergence", {}).items()
            for place, error in (of if isinstance(of, Mapping) else {"": of}).items()
        }
        self._doubtful, self._after, self._unlimited = (
            {(entry, place) for entry, _, place in (key.partition(".") for key in result.summary.get(name) or ())}
            for name in ("doubtful", "after_divergence", "without_limit")
        )
        self._printed: set[tuple[str, str]] = set()

    def number(self, value: float, unit: str, entry: str, place: str = "", size: float | None = None) -> str:
        """Number with its unit, to the second digit of its error, with a mark if it is doubtful.

        Parameters
        ----------
        value : value in ``unit``.
        unit : SI, or g.
        entry, place : key of its error in the summary.
        size : magnitude for prefix and decimals; by default that of the value.

        Returns
        -------
        Text, with a mark if the value is doubtful, of one of many motions, or unbounded.
        """
        if not is_known(value):
            return "unknown"
        digits = significant_digits(value if size is None else size, self._known.get((entry, place), 0.0))
        return round_with_unit(value, unit, digits, size) + self.mark(entry, place)

    def mark(self, entry: str, place: str = "") -> str:
        """Mark of a printed value: doubtful, of one of many motions, or without a limit; else empty."""
        key = entry, place
        self._printed.add(key)
        return " ^" if key in self._unlimited else " *" if key in self._doubtful else " ~" if key in self._after else ""

    def legend(self) -> Iterator[str]:
        """Explanations of the used marks."""
        if self._printed & (self._doubtful - self._unlimited):
            yield f"* off by more than {100 * ALLOWED_ERROR:g} %"
        if self._printed & (self._after - self._doubtful - self._unlimited):
            yield "~ one of many motions: depends on what follows after the contact sequences diverge"
        limits_grow = any(_without_limit_mark(self._result, name) for name in self._result.summary.get("margins", {}))
        if self._printed & self._unlimited or limits_grow:
            low_pass = "run.low_pass, " if self._result.KIND == "run" else ""
            yield f"^ {_WITHOUT_LIMIT}: give {low_pass}a damping of the body, or a point mass there"

    def verdict(self) -> str:
        """Reliability of the values of a complete result, in a few words."""
        summary = self._result.summary
        model = summary.get("convergence_model") or {"reason": "not known"}
        keys = {".".join(key): key for key in self._printed - self._unlimited}
        first = {keys[key] for key in first_of_keys(self._result, keys)}
        means = {key for key in first if self._known.get(key, 0.0) > ALLOWED_ERROR}  # within their standard error
        error = percent(max((self._known.get(key, 0.0) for key in first - means), default=0.0), 2)
        marked = self._printed & self._unlimited
        apart = ", but for what is marked ^" if marked else ""
        scatter = f", {count_text(len(means), 'mean')} within the standard error" if means else ""
        if EXIT_RULES[self._result.outcome.gravest_kind].first_line:
            verdict = ""  # the title has it
        elif model["reason"]:
            verdict = f"not checked with a finer model ({model['reason']})"
        elif not model["modes"]:
            verdict = "all modes kept"
        elif first_of_keys(self._result, summary.get("after_divergence", ())):
            verdict = f"one of many motions, means within {error}{scatter}{apart}"
        else:
            verdict = f"converged within {error}{scatter}{apart}"
        balance = summary.get("energy_error")
        return ", ".join(filter(None, (verdict, f"energy error {balance:.0e}" if is_known(balance) else "")))

    def text(self, entry: str, place: str, *, several: bool = False) -> str:
        """Error of a value as text; of several values the largest."""
        keys = {key for key in self._known if key[0] == entry} if several and not place else {(entry, place)}
        self._printed |= keys
        error = max((self._known[key] for key in keys if key in self._known), default=None)
        after = bool(keys & self._after)
        if keys & self._unlimited:
            return f"NOT CONVERGED, {NO_LIMIT}" if keys & self._doubtful else NO_LIMIT
        if error is None:  # the motion may be one of many even without a finer model
            return ONE_OF_MANY if after else ""
        size = f"error {percent(error, 2 if error < 0.995 else 3)}"
        if error < SMALLEST_ERROR:
            size = f"error below {percent(SMALLEST_ERROR)}" if error else "no error"
        if keys & self._doubtful:
            size = f"NOT CONVERGED, {size}"
        elif error > ALLOWED_ERROR:
            size = f"{size}, within the standard error of its mean"
        return f"{ONE_OF_MANY}, {size}" if after else size

    def other_errors(self) -> Iterator[tuple[str, str]]:
        """Errors of values that the summary contains in another form, such as spectral lines."""
        for entry, place in [*self._known, *sorted(self._after - set(self._known))]:
            if (entry, place) not in self._printed:
                yield value_in_words(f"{entry}.{place}" if place else entry), self.text(entry, place)


def significant_digits(value: float, error: float) -> int:
    """Number of printed digits of a value: up to the second digit of its error, at most `DIGITS`.

    Parameters
    ----------
    value : in any unit.
    error : relative error.

    >>> significant_digits(197.66, 0.033), significant_digits(197.66, 0.6), significant_digits(0.0, 0.1)
    (3, 2, 3)
    """
    if not error or not value or not math.isfinite(error * value):
        return DIGITS
    last = math.floor(math.log10(error * abs(value))) - 1
    return min(max(math.floor(math.log10(abs(value))) - last + 1, 1), DIGITS)


def round_with_unit(value: float, unit: str, digits: int = DIGITS, size: float | None = None) -> str:
    """Value with its unit, and with the decimals that its size has at a number of digits.

    Parameters
    ----------
    value : value in ``unit``.
    unit : SI, or g.
    digits : significant digits.
    size : magnitude for prefix and decimals; by default that of the value.

    Returns
    -------
    Number and unit.
    """
    si = STANDARD_GRAVITY if unit == "g" else 1.0
    size = float(f"{abs(value if size is None else size):.{digits}g}")
    scale = scale_for("m/s^2" if unit == "g" else unit, si * size, digits=digits)
    size *= si * scale.factor
    decimals = digits - 1 - math.floor(math.log10(size)) if 0.0 < size < math.inf else 0
    return f"{round(value * si * scale.factor, decimals) + 0.0:.{max(decimals, 0)}f} {scale.unit}".rstrip()


def limits_by_place(result: Result) -> dict[str, list[str]]:
    """Verdict and margin of each limit, by place."""
    compared, verdicts = result.summary.get("margins", {}), dict[str, list[str]]()
    for name, of in zip(compared, margins(result, compared).values(), strict=True):
        limit, _, place = name.partition(".")
        label = limit_label(limit if place and of["at"].startswith(place) else name)
        verdicts.setdefault(of["at"], []).append(f"{label} {of['verdict']}, margin {of['margin']}")
    return verdicts


def limit_lines(result: Result, shown: Sequence[str] = ()) -> Iterator[str]:
    """A line for each limit with the place of its value, except for places in ``shown``."""
    for at, texts in limits_by_place(result).items():
        yield from (f"{text}{f' at {at}' if at else ''}" for text in texts if at not in shown)


def interpretation_text(result: Result) -> str:
    """Interpretation of the scenario of a result, in one line."""
    command = KINDS[result.KIND].command
    if command not in USED_SECTIONS:
        return ""  # a comparison with a measurement
    inputs = result["inputs"].rows("number") if "inputs" in result.datasets else ()
    return interpretation(result.scenario, result.datasets.get("modes"), {row["path"]: row for row in inputs}, command)


def contact_levels(result: Result, errors: Errors) -> Iterator[str]:
    """Levels at which the linear motion first opens or closes snubbers, unless every motion does.

    If the level of a test depends on frequency, the text also says where the test comes closest to it.
    """
    names: dict[str, list[str]] = {}
    closest = result.summary.get("closest_to_test", {})
    for name, of in result.summary.get("gapping", {}).items():
        if of.get("level", True) and of.get("sigmas", True):
            text = linear_prediction(result, of)[0] + errors.mark("gapping_ratio", name)
            text += _closest_approach_text(result, closest[name], of) if name in closest else ""
            names.setdefault(text, []).append(name)
    for text, alike in sorted(names.items(), key=lambda item: item[0].startswith("not predicted")):
        verb, rest = text.split(" ", 1)
        several = {"opens": "open", "touches": "touch"} if len(alike) > 1 else {}
        yield f"{first_of(alike, MOST_SHOWN)} {several.get(verb, verb)} {rest}"


def _closest_approach_text(result: Result, prediction: Mapping[str, Any], lowest: Mapping[str, Any]) -> str:
    """Closest approach of a test with varying level to opening or closing a contact, as text.

    Parameters
    ----------
    result : result of the test.
    prediction : its level, share of the test level and frequency, or the first event.
    lowest : the same for the lowest level, with which the sentence begins.
    """
    share = prediction["share_of_level"]
    if "not_predicted" in prediction:
        return (
            ""
            if lowest.get("not_predicted") == prediction["not_predicted"]
            else (f"; in this test, raised as a whole, {prediction['not_predicted']}")
        )
    if not math.isfinite(share):
        return "; not in this test at any level"
    verb, where = "opens" if prediction["closed_at_rest"] else "touches", f"{prediction['frequency_hz']:.4g} Hz"
    if prediction["frequency_hz"] == lowest["frequency_hz"]:
        return f"; this test comes closest there, where that is {share:.3g} times its level"
    level = f"{_level(result, prediction)}, {share:.3g} times the level there"
    return f"; this test comes closest at {where}, where it {verb} from {level}"


def margins(result: Result, limits: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, str]]:
    """Margin, value with its place, and limit, by limit."""
    return {
        limit_label(name): {
            "margin": margin_text(item["margin"], item["value"], item.get("margin_db"))
            + _without_limit_mark(result, name),
            "value": amount(item["value"], limit_unit(result.scenario, name)),
            "at": item["at"] or "",
            "limit": amount(item["limit"], limit_unit(result.scenario, name)),
            "verdict": item["verdict"] if item["verdict"] == Verdict.MET else item["verdict"].upper(),
        }
        for name, item in limits.items()
    }


def _without_limit_mark(result: Result, limit: str) -> str:
    """Mark of a limit on values that diverge as the number of modes grows; else empty."""
    keys = (key.partition(".") for key in result.summary.get("without_limit") or ())
    return " ^" if any(limits(limit, entry, place) for entry, _, place in keys) else ""


def limits_in_test(result: Result) -> Iterator[str]:
    """Value of a random test that each limit is compared with, and the run duration that would decide."""
    alike: dict[str, list[str]] = {}
    for name, item in result.summary.get("margins", {}).items():
        if "statistic" in item:
            alike.setdefault(item["statistic"], []).append(limit_label(name))
    yield from (f"compared with limits: {first_of(names, MOST_SHOWN)} by the {of}" for of, names in alike.items())
    for name, item in result.summary.get("margins", {}).items():
        unit = limit_unit(result.scenario, name)
        if item["verdict"] == Verdict.MET and item.get("reached", 0.0) > item["limit"]:
            yield f"{limit_label(name)} is met by that value alone: the run reached {amount(item['reached'], unit, 4)}"
        if item["verdict"] == Verdict.UNDECIDED:
            longer = item["decided_after_s"]
            low, high, limit = (amount(item[key], unit, 4) for key in ("interval_low", "interval_high", "limit"))
            after = longer_run(amount(longer, "s", 2) if is_known(longer) else "")
            yield f"{limit_label(name)} undecided: {low} to {high} at 95 %, the limit {limit} between them; {after}"


SIGMAS_REACHED = 5.0  # of a random motion: a Gaussian process exceeds them about once in a million cycles


def linear_prediction(result: Result, prediction: Mapping[str, Any]) -> tuple[str, bool]:
    """Predicted contact change in linear motion, and whether it happens at the present level.

    Parameters
    ----------
    result : printed result.
    prediction : entry of a snubber in its ``gapping``.
    """
    if "not_predicted" in prediction:
        return f"not predicted: {prediction['not_predicted']}", False
    verb = "opens" if prediction["closed_at_rest"] else "touches"
    if "sigmas" in prediction:  # a random input
        reached = prediction["sigmas"] < SIGMAS_REACHED
        rare = "" if reached else ", rarely or never"
        if not prediction["sigmas"]:
            return f"{verb} as soon as it moves", reached
        return f"{verb} at {prediction['sigmas']:.3g} sigma of the stationary linear motion{rare}", reached
    share = prediction["share_of_level"]
    reached = share <= 1.0
    if math.isinf(prediction.get("level") or 0.0) or (not math.isfinite(share) and "time_s" in prediction):
        return f"{verb} at no level of this input in linear motion", False
    if prediction.get("level") is None:
        level = f"from {share:.4g} times this input"
    else:
        level = f"from {_level(result, prediction)}" if prediction["level"] else "as soon as it moves"
    if "frequency_hz" in prediction:
        where = f"at {prediction['frequency_hz']:.4g} Hz in steady linear motion"
    else:
        where = f"at {amount(prediction['time_s'], 's')} in linear motion"
    here = "there" if "closest_to_test" in result.summary else "here"
    return f"{verb} {level} {where}{'' if reached else f', above the level {here}'}", reached


def _level(result: Result, prediction: Mapping[str, Any]) -> str:
    """Predicted level in the quantity of the excitation; for a sine of the base also its acceleration."""
    quantity = getattr(result.scenario.excitation, "quantity", None) or "acceleration"
    level, acceleration = prediction["level"], ""
    if quantity == FACTOR:
        return f"{amount(level, '1')} times this input"
    if "frequency_hz" in prediction and power_of(quantity):
        acceleration = f" ({amount(level, amplitude_unit(quantity))})"
        level /= acceleration_amplitude(1.0, quantity, prediction["frequency_hz"])
    return f"{amount(level, level_unit(quantity))}{acceleration}"
