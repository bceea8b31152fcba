"""How computations end: a code with the numbers that belong to it; text is made from them where people read it.

A computation hands back an `Outcome`. Programs compare its code and its kind, and take its numbers by name; nothing
reads them out of the text.

>>> ended = Outcome.of(OutcomeCode.STEP_TOO_SMALL, parameter=51.25, unit="Hz", points=17, step=1e-6)
>>> ended.complete, ended.numbers["parameter"]
(False, 51.25)
>>> ended.message
'stopped at 51.25 Hz after 17 points: no solution within the smallest step of 1e-06'
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum, StrEnum
from string import Formatter
from typing import Any, Self

MOST_LISTED = 6  # items of a list in a text

Number = float | int | str | tuple["Number", ...]


class OutcomeKind(StrEnum):
    """What an outcome means for the result that carries it."""

    COMPLETE = "complete"  # everything asked for was computed
    STOPPED = "stopped"  # before the end; what was found by then is right
    UNTRUSTED = "untrusted"  # computed to the end, but with an error larger than allowed
    INTERRUPTED = "interrupted"  # on request; what was found by then is right
    FAILED = "failed"  # without a result


class OutcomeCode(Enum):
    """How a computation ended: kind, message and remedy.

    A name in braces stands for a number of the outcome; what is in brackets is left out where its numbers are not
    given. ``{place}`` is the number ``parameter`` with its ``name`` and ``unit``.
    """

    # complete
    COMPLETE = OutcomeKind.COMPLETE, "", ""
    REACHED_END = OutcomeKind.COMPLETE, "reached {place}", ""
    CLOSED_CURVE = OutcomeKind.COMPLETE, "closed curve", ""
    JOINED_BRANCH = OutcomeKind.COMPLETE, "joined another branch at {place}", ""
    BACK_TO_PERIOD = OutcomeKind.COMPLETE, "back to period {multiple}", ""
    BACK_TO_BRAKE_ORBITS = OutcomeKind.COMPLETE, "came back to brake orbits", ""
    ENERGY_TRANSFERRED = OutcomeKind.COMPLETE, "the energy has been transferred to the other mode", ""

    # a branch of periodic orbits
    NOT_BEGUN = OutcomeKind.STOPPED, "not begun", ""
    STEP_TOO_SMALL = (
        OutcomeKind.STOPPED,
        "stopped[ at {place}] after {points} points: no solution within the smallest step of {step}",
        "a smaller step or another starting point may go on",
    )
    NOT_SMOOTH = (
        OutcomeKind.STOPPED,
        "stopped[ at {place}]: the last {steps} steps together are shorter than the largest step of {step}; the branch "
        "is not smooth there (grazing, or a fold beside it)",
        "",
    )
    POINT_LIMIT = OutcomeKind.STOPPED, "stopped[ at {place}] after {points} points, the most allowed", "[raise {limit}]"
    TIME_LIMIT = (
        OutcomeKind.STOPPED,
        "stopped[ at {place}] after {seconds:g} s, the longest time allowed",
        "[raise {limit}]",
    )
    LEFT_RANGE = OutcomeKind.STOPPED, "stopped at {place}, {ratio:g} times away from where it began", ""
    NOT_COVERED = OutcomeKind.STOPPED, "not reached[ at level {level:.4g}]: {ranges}[ {unit}]", ""
    CORNER_TOO_CLOSE = OutcomeKind.STOPPED, "not begun: the fold lies too close to a corner of the curve", ""

    # nonlinear modes
    MODE_LOST = (
        OutcomeKind.STOPPED,
        "stopped[ at {place}]: no motion dominated by mode {mode} was found within {steps} steps beyond"
        "[; {share:.0%} of the energy was left in that mode at the last point]",
        "[{remedy}]",
    )
    NO_FURTHER_MOTION = OutcomeKind.STOPPED, "stopped: no further motion of these two modes alone was found", ""
    ENERGY_UNBOUNDED = (
        OutcomeKind.STOPPED,
        "stopped at {place}: the energy is {energy:.3g} J and grows without bound at nearly constant frequency (a "
        "tongue of internal resonance)",
        "follow the energy instead",
    )
    NO_ORBIT_BESIDE = OutcomeKind.STOPPED, "not begun: no orbit was found beside the brake orbit", ""
    BRAKE_ORBIT_ITSELF = (
        OutcomeKind.STOPPED, "not begun: the orbits found are brake orbits too, at another instant", "",
    )  # fmt: skip
    FULL_PERIOD_DIVERGED = (
        OutcomeKind.STOPPED,
        "stopped[ at {place}]: over the whole period Newton's method does not converge beside the half-period solution",
        "",
    )
    NO_DESCENT = (
        OutcomeKind.STOPPED,
        "relaxed minimisation stopped at {place}: its functional is {functional:.3g}, the tolerance {tolerance:g}; no "
        "further descent was found",
        "use more nnm.method.steps or a larger tolerance",
    )
    TOO_FEW_ITERATIONS = (
        OutcomeKind.STOPPED,
        "relaxed minimisation stopped at {place}: its functional is {functional:.3g}, the tolerance {tolerance:g}; "
        "{iterations} iterations were not enough",
        "raise nnm.method.iterations, steps or the tolerance",
    )
    NO_PHASE_RESONANCE = (
        OutcomeKind.STOPPED,
        "no forced motion at phase resonance was found near the prediction for level {levels} {unit}: the damping is "
        "too strong for one harmonic force to hold the mode, or an internal resonance is close",
        "try another level",
    )
    NOTHING_NEAR_EXPANSION = (
        OutcomeKind.STOPPED,
        "no exact motion was found near the expansion of mode {mode}",
        "use smaller factors, well below {reach:.3g}",
    )
    PARTLY_NEAR_EXPANSION = (
        OutcomeKind.STOPPED,
        "no exact motion was found near the expansion at the factors {factors}: tongues of internal resonance",
        "",
    )

    # motions in time
    EVENT_LIMIT = (
        OutcomeKind.STOPPED,
        "stopped at {time:.6g} s after {events} contact events, the most allowed",
        "[raise {limit}, or look for a contact that chatters]",
    )
    EVALUATION_LIMIT = (
        OutcomeKind.STOPPED,
        "stopped at {time:.6g} s after {evaluations} evaluations of the contact gaps without reaching the end",
        "",
    )
    INTEGRATOR_FAILED = OutcomeKind.STOPPED, "the {integrator} integrator gave up at {time:.6g} s: {reason}", ""
    NO_STEADY_STATE = OutcomeKind.STOPPED, "stopped at {place}: {reason}", ""

    # many cases, identification
    CASES_MISSING = OutcomeKind.STOPPED, "{done} of {cases} cases computed", ""
    CASES_FAILED = (
        OutcomeKind.STOPPED,
        "{failed} of {cases} cases failed, the first (case {case}) because {reason}",
        "",
    )
    STEPPED_OVER = (
        OutcomeKind.STOPPED,
        "one step of 1 % from {before:.6g} to {after:.6g} N/m stepped over the tolerance of {percent:g} % of the "
        "frequency",
        "widen identify_stiffness.tolerance, or use method: secular",
    )
    FIT_LIMIT = (
        OutcomeKind.STOPPED,
        "the fit stopped after {evaluations} evaluations, the most allowed",
        "start from better values, or seek fewer parameters",
    )
    SOLUTION_LIMIT = (
        OutcomeKind.STOPPED,
        "{solutions} eigenvalue solutions were not enough",
        "raise identify_stiffness.most_solutions, or use method: secular",
    )

    # any
    STOPPED = OutcomeKind.STOPPED, "stopped", ""
    INTERRUPTED = (
        OutcomeKind.INTERRUPTED,
        "interrupted[ at {place}][ during {during}][ before {before}][ after {done} of {total} {unit_of_work}]"
        "[; not begun: {left}]",
        "",
    )
    HARMONICS_NEGLECTED = (
        OutcomeKind.UNTRUSTED,
        "not to be trusted: at {place} the neglected harmonics are worth {error:.3g} % of the motion "
        "(sweep.method.largest_error = {allowed:g} %)",
        "use more harmonics, or shooting",
    )
    FAILED = OutcomeKind.FAILED, "{reason}", ""

    def __init__(self, kind: OutcomeKind, message: str, remedy: str) -> None:
        self.kind = kind
        self.message = message
        self.remedy = remedy

    @property
    def label(self) -> str:
        """Name in files and in ``--json``."""
        return self.name.lower()

    @property
    def needs(self) -> frozenset[str]:
        """Numbers without which there is no message."""
        names = _names(_OPTIONAL.sub("", self.message + self.remedy))
        return frozenset(name.replace("place", "parameter") for name in names)


_OPTIONAL = re.compile(r"\[([^\]]*)\]")


@dataclass(frozen=True)
class Outcome:
    """How a computation ended.

    Parameters
    ----------
    code : how.
    numbers : by name; besides numbers also words that belong to the message. ``parameter`` is where a branch ended,
        in the unit ``unit``. An outcome read from an old file has only ``text``.
    parts : outcomes that led to this one, or that go with it.

    Raises
    ------
    ValueError
        Where the message asks for a number that is not given.
    """

    code: OutcomeCode
    numbers: Mapping[str, Number] = field(default_factory=dict)
    parts: tuple[Outcome, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "numbers", {name: _plain(value) for name, value in self.numbers.items()})
        absent = self.code.needs - self.numbers.keys()
        if absent and "text" not in self.numbers:
            raise ValueError(f"{self.code.name} needs {', '.join(sorted(absent))}")

    def __hash__(self) -> int:
        return hash((self.code, self.parts))

    @classmethod
    def of(cls, code: OutcomeCode, *parts: Outcome, **numbers: Any) -> Self:
        """Make an outcome from its code and its numbers."""
        return cls(code, numbers, parts)

    @property
    def kind(self) -> OutcomeKind:
        """What it means for the result."""
        return self.code.kind

    @property
    def complete(self) -> bool:
        """Whether everything asked for was computed and can be trusted."""
        return self.kind is OutcomeKind.COMPLETE and all(part.complete for part in self.parts)

    @property
    def trusted(self) -> bool:
        """Whether what was computed can be trusted, as far as it goes."""
        wrong = self.kind in (OutcomeKind.UNTRUSTED, OutcomeKind.FAILED)
        return not wrong and all(part.trusted for part in self.parts)

    @property
    def interrupted(self) -> bool:
        """Whether it ended on request."""
        return self.kind is OutcomeKind.INTERRUPTED or any(part.interrupted for part in self.parts)

    @property
    def message(self) -> str:
        """What happened, its numbers filled in."""
        return str(self.numbers["text"]) if "text" in self.numbers else _filled(self.code.message, self.numbers)

    @property
    def remedy(self) -> str:
        """What to try; empty where nothing is known."""
        return "" if "text" in self.numbers else _filled(self.code.remedy, self.numbers)

    @property
    def text(self) -> str:
        """Message and remedy, with those of the parts."""
        message = self.message
        if self.kind is OutcomeKind.COMPLETE and "text" not in self.numbers:
            message = f"complete: {message}" if message else "complete"
        if "way" in self.numbers:
            message = f"{self.numbers['way']}: {message}"
        return "; ".join(text for text in (message, self.remedy, *(part.text for part in self.parts)) if text)

    def __str__(self) -> str:
        return self.text

    def but(self, *parts: Outcome, **numbers: Any) -> Self:
        """The same with other or more numbers, and more parts."""
        return replace(self, numbers={**self.numbers, **numbers}, parts=(*self.parts, *parts))

    def shown(self, convert: Callable[[float], float], unit: str = "", name: str = "") -> Self:
        """The same, its parameter (and those of its parts) as people read it."""
        parts = tuple(part.shown(convert, unit, name) for part in self.parts)
        where = self.numbers.get("parameter")
        if not isinstance(where, (int, float)) or "unit" in self.numbers or "name" in self.numbers:
            return replace(self, parts=parts)
        place: dict[str, Number] = {"parameter": float(convert(where)), "unit": unit, "name": name}
        return replace(self, numbers={**self.numbers, **place}, parts=parts)

    def as_dict(self) -> dict[str, Any]:
        """Plain values, as JSON can hold them."""
        values: dict[str, Any] = {"code": self.code.label, "numbers": dict(self.numbers)}
        return {**values, "parts": [part.as_dict() for part in self.parts]} if self.parts else values

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """The outcome that `as_dict` gave.

        Raises
        ------
        KeyError
            Where the code is unknown.
        """
        code = OutcomeCode[str(values["code"]).upper()]
        return cls(code, values.get("numbers", {}), tuple(cls.from_dict(part) for part in values.get("parts", ())))


def combined(outcomes: Iterable[Outcome]) -> Outcome:
    """The first of several outcomes that is not complete; `COMPLETE` where all are."""
    return next((outcome for outcome in outcomes if not outcome.complete), COMPLETE)


def both_ways(back: Outcome, forth: Outcome) -> Outcome:
    """The outcome of a branch that was followed both ways from a point: the first that is not complete leads."""
    if back == forth:
        return back
    first, second = (forth, back) if back.complete and not forth.complete else (back, forth)
    return first.but(second.but(way="the other way"))


def _plain(value: Any) -> Number:
    """A value as it comes back from JSON."""
    if isinstance(value, str):
        return str(value)
    if isinstance(value, Sequence) or hasattr(value, "tolist"):
        items = value.tolist() if hasattr(value, "tolist") else value
        return tuple(_plain(item) for item in items) if isinstance(items, Sequence) else items
    return value  # type: ignore[no-any-return]


def _names(template: str) -> set[str]:
    return {name for _, name, _, _ in Formatter().parse(template) if name}


def _filled(template: str, numbers: Mapping[str, Number]) -> str:
    """A template with its numbers; an optional part is left out where one of its numbers is missing or empty."""
    known: dict[str, Number] = dict(numbers)
    if "parameter" in numbers:
        known["place"] = _place(numbers)

    def optional(found: re.Match[str]) -> str:
        return found[1] if all(known.get(name) not in (None, "", ()) for name in _names(found[1])) else ""

    return _TextFormatter().vformat(_OPTIONAL.sub(optional, template), (), known)


def _place(numbers: Mapping[str, Number]) -> str:
    value, name, unit = numbers["parameter"], numbers.get("name", ""), numbers.get("unit", "")
    if not name and "unit" not in numbers:
        name = "parameter"
    return f"{name} {_shown(value)} {unit if unit != '1' else ''}".strip()


class _TextFormatter(Formatter):
    """Numbers to six digits, lists separated by commas."""

    def format_field(self, value: Any, format_spec: str) -> str:
        return format(value, format_spec) if format_spec else _shown(value)


def _shown(value: Number) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if not isinstance(value, tuple):
        return str(value)
    # a pair of numbers in a list is a range
    items = [
        " to ".join(map(_shown, item)) if isinstance(item, tuple) else _shown(item) for item in value[:MOST_LISTED]
    ]
    more = f" and {len(value) - MOST_LISTED} more" if len(value) > MOST_LISTED else ""
    return ", ".join(items) + more


COMPLETE = Outcome(OutcomeCode.COMPLETE)
"""Everything asked for was computed."""
