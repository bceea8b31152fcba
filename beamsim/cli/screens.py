"""The first screen of a result: what an engineer decides by. The rest is behind ``--verbose`` and in ``info``.

It has a title with the outcome and how sure it is, one table of places, curves, branches, cases or parameters, a few
lines of what decides, and the files. What stands there is said by a function for each kind (`beamsim.kinds`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from beamsim.cli.printing import aligned, percent, under_headings
from beamsim.outcomes import STANDINGS, OnLimit, Outcome, first_of
from beamsim.plots.style import amount, is_known, margin_text, scale_for
from beamsim.results.result import Result
from beamsim.results.values import limit_label, limit_unit
from beamsim.scenario.base import counted
from beamsim.scenario.quantities import acceleration_amplitude, amplitude_unit, level_unit, power_of
from beamsim.scenario.units import STANDARD_GRAVITY

SHOWN = 4  # of what there may be many of: outputs, levels of contacts, cases
DIGITS = 3  # at most; fewer where the convergence supports no more


@dataclass(frozen=True)
class Screen:
    """What is printed of a result below its title."""

    verdict: str  # beside the title, behind what the outcome comes to
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
        lines = ["  ".join(filter(None, (result.title or files[0], verdict))), *statements, *self.told()]
        notes = f"{counted(len(result.warnings), 'note')} (-v shows them); " if result.warnings else ""
        pictures = [name for name in files[1:] if name.endswith(".png")]
        others = [name for name in files if name not in pictures]
        plots = [counted(len(pictures), "plot")] if pictures else []
        return "\n".join([*lines, f"{notes}{', '.join([*others, *plots])}"])

    def status(self, result: Result) -> list[str]:
        """What the outcome comes to and how sure the result is; then how the computation ended, if early."""
        statements = filter(None, ended(result.outcome).split("; "))
        verdict = ", ".join(filter(None, (standing(result), self.verdict)))
        return [verdict, *(f"{text[:1].upper()}{text[1:]}" for text in statements)]

    def told(self) -> list[str]:
        """The table and the lines below it."""
        table = under_headings(self.rows)
        return [*(aligned(table) if table[0] else ()), *self.lines]


class Numbers:
    """Numbers of a summary as text, to the digits that their convergence supports, with marks.

    Parameters
    ----------
    summary : of a result.
    """

    def __init__(self, summary: Mapping[str, Any]) -> None:
        self._summary = summary
        self._doubtful, self._after = set(summary.get("doubtful", ())), set(summary.get("after_parting", ()))
        self._met: set[str] = set()
        self.largest_change = 0.0

    def text(self, value: float, unit: str, entry: str, place: str = "", size: float | None = None) -> str:
        """A number with its unit.

        Parameters
        ----------
        value : in ``unit``.
        unit : SI, or g.
        entry, place : of the summary, whose change counts.
        size : magnitude that chooses prefix and decimals, by default that of the value.

        Returns
        -------
        Text, with a mark where the value is doubtful or of one of many motions.
        """
        if not is_known(value):
            return "unknown"
        key = f"{entry}.{place}" if place else entry
        changes = self._summary.get("convergence", {}).get(entry, {})
        change = changes.get(place) if isinstance(changes, Mapping) else changes
        if change is not None:
            self.largest_change = max(self.largest_change, change)
        mark = " *" if key in self._doubtful else " ~" if key in self._after else ""
        self._met |= {mark.strip()}
        return rounded(value, unit, digits_of(change), size) + mark

    def legend(self) -> Iterator[str]:
        """What the marks mean that were printed."""
        if "*" in self._met:
            yield "* changes by more than 2 % with a finer model"
        if "~" in self._met:
            yield "~ one of many motions: depends on what follows after the contact sequences diverge"


def digits_of(change: float | None) -> int:
    """Significant digits of a value that changes by so much, relatively.

    >>> digits_of(None), digits_of(2e-5), digits_of(0.0078), digits_of(0.05), digits_of(0.4)
    (3, 3, 3, 2, 1)
    """
    return DIGITS if change is None or change <= 0.0 else min(max(math.ceil(-math.log10(change)), 1), DIGITS)


def rounded(value: float, unit: str, digits: int = DIGITS, size: float | None = None) -> str:
    """A value with as many decimals as its size has in so many digits, and with its unit.

    Parameters
    ----------
    value : in ``unit``.
    unit : SI, or g.
    digits : significant digits.
    size : magnitude that chooses prefix and decimals, by default that of the value.

    Returns
    -------
    Number and unit.
    """
    si = STANDARD_GRAVITY if unit == "g" else 1.0
    size = float(f"{abs(value if size is None else size):.{digits}g}")
    scale = scale_for("m/s^2" if unit == "g" else unit, si * size)
    size *= si * scale.factor
    decimals = digits - 1 - math.floor(math.log10(size)) if 0.0 < size < math.inf else 0
    return f"{round(value * si * scale.factor, decimals) + 0.0:.{max(decimals, 0)}f} {scale.unit}".rstrip()


def sureness(result: Result, change: float) -> str:
    """Whether the values of a result that is complete can be trusted, in a few words.

    Parameters
    ----------
    result : with its outcome and summary.
    change : the largest with a finer model of the values that are printed.
    """
    summary = result.summary
    model = summary.get("convergence_model") or {"reason": "not known"}
    if standing(result):
        said = ""
    elif model["reason"]:
        said = f"not checked with a finer model ({model['reason']})"
    elif not model["modes"]:
        said = "all modes kept"
    elif summary.get("after_parting"):
        said = f"one of many motions, means within {percent(change, 2)}"
    else:
        said = f"converged within {percent(change, 2)}"
    error = summary.get("energy_error")
    return ", ".join(filter(None, (said, f"energy error {error:.0e}" if is_known(error) else "")))


def standing(result: Result) -> str:
    """What the outcome comes to, with the number of values that do not converge; empty of what is complete."""
    said, doubtful = STANDINGS[result.outcome.gravest].first_line, result.summary.get("doubtful")
    return f"{said}: {counted(len(doubtful), 'value')}" if said and doubtful and result.outcome.usable else said


def limits_by_place(result: Result) -> dict[str, list[str]]:
    """By place the verdict on each limit, with its margin."""
    compared, verdicts = result.summary.get("margins", {}), dict[str, list[str]]()
    for name, of in zip(compared, margins(result, compared).values(), strict=True):
        limit, _, place = name.partition(".")
        label = limit_label(limit if place and of["at"].startswith(place) else name)
        verdicts.setdefault(of["at"], []).append(f"{label} {of['verdict']}, margin {of['margin']}")
    return verdicts


def limit_lines(result: Result, shown: Sequence[str] = ()) -> Iterator[str]:
    """A line for each limit, with the place of its value; none of places that are shown already."""
    for at, texts in limits_by_place(result).items():
        yield from (f"{text}{f' at {at}' if at else ''}" for text in texts if at not in shown)


def modes(result: Any) -> Iterator[str]:
    """The first natural frequency of a result with modes, with its damping: contacts open, closed, and as at rest."""
    table = result.modes
    states = {"open": (table.open_frequencies_hz, table.damping_ratios)}
    if result.scenario.located_snubbers:
        states["closed"] = table.closed_frequencies_hz, table.closed_damping_ratios
        states["at rest"] = table.resting_frequencies_hz, table.resting_damping_ratios
    texts: dict[str, str] = {}
    for state, (frequencies, ratios) in states.items():
        elastic = [] if frequencies is None else [k for k, f in enumerate(frequencies[: table.kept_modes]) if f > 0.0]
        if elastic:
            damping = f" ({percent(ratios[elastic[0]], 2)})" if is_known(ratios[elastic[0]]) else ""
            texts[state] = f"{frequencies[elastic[0]]:.3g} Hz {{}}{damping}"
    if texts:
        yield f"first mode {', '.join(text.format(state) for state, text in of_states(texts).items())}"


def contact_levels(result: Result) -> Iterator[str]:
    """From which level on the linear motion first opens or closes snubbers, where that is not with every motion."""
    names: dict[str, list[str]] = {}
    for name, of in result.summary.get("gapping", {}).items():
        if of.get("level", True) and of.get("sigmas", True):
            names.setdefault(predicted(result, of)[0], []).append(name)
    for text, alike in sorted(names.items(), key=lambda item: item[0].startswith("not predicted")):
        verb, rest = text.split(" ", 1)
        several = {"opens": "open", "touches": "touch"} if len(alike) > 1 else {}
        yield f"{first_of(alike, SHOWN)} {several.get(verb, verb)} {rest}"


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


def ended(outcome: Outcome) -> str:
    """How a part of a computation ended, without saying of it that it is complete."""
    return "; ".join(text for text in outcome.displayed(scale_for).statements if text != "complete")
