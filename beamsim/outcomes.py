"""How computations end: a code and its numbers, from which the text for the user is made.

Every computation returns an `Outcome`. Programs compare its code and its kind and look up its numbers by name; nothing
is parsed out of the text.

>>> outcome = Outcome.of(OutcomeCode.STEP_TOO_SMALL, parameter=51.25, unit="Hz", points=17, step=1e-6)
>>> outcome.complete, outcome.numbers["parameter"]
(False, 51.25)
>>> outcome.message
'stopped at 51.25 Hz after 17 points: no solution even with the smallest step of 1e-06'
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum, StrEnum
from string import Formatter
from typing import Any, Self

MOST_LISTED = 6  # items of a list that are written out

Number = float | int | str | tuple["Number", ...]


class OutcomeKind(StrEnum):
    """What an outcome means for the result that carries it."""

    COMPLETE = "complete"  # everything requested was computed
    NOTED = "noted"  # complete; says something about what was found
    STOPPED = "stopped"  # before the end; the results up to there are valid
    UNTRUSTED = "untrusted"  # computed to the end, but the estimated error is larger than allowed
    INTERRUPTED = "interrupted"  # on request; the results up to there are valid
    FAILED = "failed"  # no result


class OutcomeCode(Enum):
    """How a computation ended: kind, message and remedy.

    A name in braces stands for a number of the outcome; text in brackets is left out if its numbers are not
    given. ``{place}`` is the number ``parameter`` with its ``name`` and ``unit``, ``{at_level}`` the number ``level``
    with its ``level_unit``.
    """

    # complete
    COMPLETE = OutcomeKind.COMPLETE, "", ""
    REACHED_END = (
        OutcomeKind.COMPLETE,
        "reached {place}[, where mode {mode} holds {share:.0%} of the energy and mode {other} {other_share:.0%}]",
        "",
    )
    CLOSED_CURVE = OutcomeKind.COMPLETE, "closed curve", ""
    JOINED_BRANCH = OutcomeKind.COMPLETE, "joined another branch at {place}", ""
    BACK_TO_PERIOD = OutcomeKind.COMPLETE, "back to period {multiple}", ""
    BACK_TO_BRAKE_ORBITS = OutcomeKind.COMPLETE, "returned to brake orbits", ""
    ENERGY_TRANSFERRED = OutcomeKind.COMPLETE, "the energy has been transferred to the other mode", ""

    FIGURES_DOUBTFUL = (
        OutcomeKind.COMPLETE,
        "values change by more than {percent:g} % with 1.5 times the modes[ and {elements}]: {figures}",
        "[{remedy}]",
    )

    MOTION_SENSITIVE = (
        OutcomeKind.COMPLETE,
        "the motion is so sensitive that from {time:.4g} s on it is one of many: {figures} depend on what follows[; a "
        "change of the stiffness by 1e-9 of itself gives other contacts from {small_s:.4g} s on][, round-off from "
        "{round_off_s:.4g} s on]",
        "take means of a longer run (rms, contact share, run.impacts), or the spread of peaks over several cases "
        "(vary)",
    )
    CONTACTS_PART = (
        OutcomeKind.COMPLETE,
        "the finer model, stepped in time too, has other contacts from {time:.4g} s on: {figures} depend on what "
        "follows",
        "lower run.rtol, keep more modes (reduction.modes), or take means of a longer run",
    )

    # a branch of periodic orbits
    NOT_BEGUN = OutcomeKind.STOPPED, "not started", ""
    STEP_TOO_SMALL = (
        OutcomeKind.STOPPED,
        "stopped[ at {place}] after {points} points: no solution even with the smallest step of {step}",
        "try a smaller step or another starting point",
    )
    STICKING_JUMPS = (
        OutcomeKind.STOPPED,
        "stopped[ at {place}] after {points} points: where a friction contact with a static coefficient above the "
        "sliding one begins to stick or to slide, it does so at once for a time that is not short, and the motions "
        "beyond are not neighbours of these",
        "follow the range beyond with a stepped sine, begin the continuation there, or give the contact one "
        "coefficient",
    )
    ORBIT_NOT_FINITE = (
        OutcomeKind.STOPPED,
        "stopped[ at {place}] after {points} points: beyond it the motion leaves the range of floating-point numbers",
        "check the size of the loads and stiffnesses",
    )
    NOT_SMOOTH = (
        OutcomeKind.STOPPED,
        "stopped[ at {place}]: the last {steps} steps together are shorter than the largest step of {step}; the branch "
        "is not smooth there (grazing, or a fold close to it)",
        "follow it from its other end, or look at the motion there with a stepped sine",
    )
    JUST_YIELDS = (
        OutcomeKind.STOPPED,
        "stopped[ at {place}]: the motion just reaches the yield force of a stop; with any larger crush it is periodic "
        "as well, so that no single branch goes on",
        "follow the range beyond with a stepped sine or a study of runs, where the crush is that of their past",
    )
    POINT_LIMIT = (
        OutcomeKind.STOPPED,
        "stopped[ at {place}] after {points} points, the maximum number",
        "[raise {limit}]",
    )
    TIME_LIMIT = (
        OutcomeKind.STOPPED,
        "stopped[ at {place}] after {seconds:g} s, the maximum time",
        "[raise {limit}]",
    )
    SEARCH_FAILED = (
        OutcomeKind.STOPPED,
        "the search for special points ({kinds}) failed in {steps} of the steps, first at {place}: some of them, and a "
        "change of stability there, may be missing",
        "follow a smaller range around it",
    )
    LEFT_RANGE = OutcomeKind.STOPPED, "stopped at {place}, a factor of {ratio:g} from where it started", ""
    NOT_COVERED = OutcomeKind.STOPPED, "range not covered[ at {at_level}]: {ranges}[ {unit}]", ""
    LIMITS_REACHED = (
        OutcomeKind.STOPPED,
        "limits on the number of points or branches were reached[ at {at_level}][; from {bifurcations} "
        "bifurcations no branch was followed]",
        "raise {limits}",
    )
    SIDE_BRANCHES_CUT = (
        OutcomeKind.NOTED,
        "coexisting and side branches end at limits on points, branches or time[ at {at_level}][; from "
        "{bifurcations} bifurcations no branch was followed]",
        "raise {limits}, or leave these branches out (sweep.side_branches: none)",
    )
    NOT_BRANCHED = (
        OutcomeKind.NOTED,
        "from {bifurcations} bifurcations no branch was followed[ at {at_level}]: {reason}",
        "",
    )
    NOT_SOUGHT = (
        OutcomeKind.NOTED,
        "coexisting motions were not sought[ at {at_level}]: {reason}",
        "",
    )
    NO_STABLE_MOTION = (
        OutcomeKind.NOTED,
        "no stable motion found[ at {at_level}]: {ranges}[ {unit}]",
        "",
    )
    CORNER_TOO_CLOSE = OutcomeKind.STOPPED, "not started: the fold is too close to a corner of the curve", ""

    # nonlinear modes
    MODE_LOST = (
        OutcomeKind.STOPPED,
        "stopped[ at {place}]: the branch turns back into a tongue of internal resonance, and no motion of mode {mode} "
        "was found beyond it[; at the last point that mode held {share:.0%} of the energy and mode {other} "
        "{other_share:.0%}]",
        "[{remedy}]",
    )
    ENDS_IN_RESONANCE = (
        OutcomeKind.NOTED,
        "the backbone is interrupted by an internal resonance from {place} to {beyond:.6g}[ {unit}], beyond the end of "
        "the range",
        "",
    )
    VALUES_NOT_PASSED = (
        OutcomeKind.STOPPED,
        "no branch passes the {quantity} {missed} {unit}, at which a point was asked for",
        "extend the range, or ask for values that the backbone passes (summary: start, end, jumps)",
    )
    NO_FURTHER_MOTION = OutcomeKind.STOPPED, "stopped: no further motion in these two modes alone was found", ""
    ENERGY_UNBOUNDED = (
        OutcomeKind.STOPPED,
        "stopped at {place}: the energy is {energy:.3g} J and grows without bound at nearly constant frequency (a "
        "tongue of internal resonance)",
        "use energy as the continuation parameter instead",
    )
    NO_ORBIT_BESIDE = OutcomeKind.STOPPED, "not started: no non-brake orbit was found near the brake orbit", ""
    BRAKE_ORBIT_ITSELF = (
        OutcomeKind.STOPPED, "not started: the orbits found are brake orbits, shifted in time", "",
    )  # fmt: skip
    FULL_PERIOD_DIVERGED = (
        OutcomeKind.STOPPED,
        "stopped[ at {place}]: Newton's method over the full period does not converge from the half-period solution",
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
        "the limit of {iterations} iterations was reached",
        "raise nnm.method.iterations, steps or the tolerance",
    )
    NO_PHASE_RESONANCE = (
        OutcomeKind.STOPPED,
        "no forced motion at phase resonance was found near the prediction for level {levels} {unit}: the damping is "
        "too strong for a single harmonic force to sustain the mode, or an internal resonance is close",
        "try another level",
    )
    NOTHING_NEAR_EXPANSION = (
        OutcomeKind.STOPPED,
        "no exact motion was found near the expansion of mode {mode}",
        "use smaller factors, well below {reach:.3g}",
    )
    PARTLY_NEAR_EXPANSION = (
        OutcomeKind.STOPPED,
        "no exact motion was found near the expansion at the factors {factors} (tongues of internal resonance)",
        "",
    )

    # motions in time
    EVENT_LIMIT = (
        OutcomeKind.STOPPED,
        "stopped at {time:.6g} s after {events} contact events, the maximum number",
        "[raise {limit}, or check for a chattering contact]",
    )
    EVALUATION_LIMIT = (
        OutcomeKind.STOPPED,
        "stopped at {time:.6g} s after {evaluations} evaluations of the contact gaps, before the end of the run",
        "",
    )
    NOT_FINITE = (
        OutcomeKind.STOPPED,
        "the motion leaves the range of floating-point numbers after {time:.6g} s",
        "check the initial motion and the size of the loads",
    )
    ENERGY_NOT_BALANCED = (
        OutcomeKind.UNTRUSTED,
        "not reliable: the energy balance is wrong by {error:.2g} of the energy, from {time:.6g} s on by more than "
        "{allowed:g}",
        "[{remedy}]",
    )
    ORBIT_ENERGY_NOT_BALANCED = (
        OutcomeKind.UNTRUSTED,
        "not reliable: the energy balance over a period is wrong by {error:.2g} of the energy at {place}, and by more "
        "than {allowed:g} at {points} points",
        "follow a smaller range around it",
    )
    SWEEP_ENERGY_NOT_BALANCED = (
        OutcomeKind.UNTRUSTED,
        "not reliable: sweeping {direction}[ at {at_level}], the energy balance is wrong by "
        "{error:.2g} of the energy, from {frequency:.6g} Hz on by more than {allowed:g}",
        "sweep a smaller range around it",
    )
    NOTCH_NOT_HELD = (
        OutcomeKind.STOPPED,
        "notching: {limit} is exceeded by up to {percent:.3g} % at {frequency:.4g} Hz (limits are exceeded at "
        "{ranges} Hz)[, where {reason}]",
        "sweep more slowly, start further from the resonance or at a lower level, or raise the limit",
    )
    INTEGRATOR_FAILED = OutcomeKind.STOPPED, "the {integrator} integrator failed at {time:.6g} s: {reason}", ""
    NO_STEADY_STATE = OutcomeKind.STOPPED, "stopped at {place}: {reason}", ""

    # many cases, identification
    CASES_MISSING = OutcomeKind.STOPPED, "{done} of {cases} cases computed", ""
    CASES_FAILED = (
        OutcomeKind.STOPPED,
        "{failed} of {cases} cases failed; the first is case {case}: {reason}",
        "",
    )
    STEPPED_OVER = (
        OutcomeKind.STOPPED,
        "a 1 % step from {before:.6g} to {after:.6g} N/m stepped over the frequency tolerance of {percent:g} %",
        "widen identify_stiffness.tolerance, or use method: secular",
    )
    FIT_LIMIT = (
        OutcomeKind.STOPPED,
        "the fit stopped after {evaluations} evaluations, the maximum number",
        "start from better values, or fit fewer parameters",
    )
    SOLUTION_LIMIT = (
        OutcomeKind.STOPPED,
        "not converged after {solutions} eigenvalue solutions",
        "raise identify_stiffness.most_solutions, or use method: secular",
    )

    # any
    STOPPED = OutcomeKind.STOPPED, "stopped", ""
    INTERRUPTED = (
        OutcomeKind.INTERRUPTED,
        "interrupted[ at {place}][ during {during}][ before {before}][ after {done} of {total} {unit_of_work}]"
        "[; not started: {left}]",
        "",
    )
    REDUCTION_NOT_ACCURATE = (
        OutcomeKind.UNTRUSTED,
        "not reliable: the error of the reduced model's receptance at contacts and loads up to {highest:.6g} Hz is "
        "bounded only by {bound:.2g} of its size, more than {allowed:g}",
        "keep more modes (reduction.modes: all), or leave reduction out",
    )
    HARMONICS_NEGLECTED = (
        OutcomeKind.UNTRUSTED,
        "not reliable: at {place} the neglected harmonics amount to {error:.3g} % of the motion "
        "(sweep.method.largest_error = {allowed:g} %)",
        "use more harmonics, or the shooting method",
    )
    DERIVATIVE_UNKNOWN = (
        OutcomeKind.UNTRUSTED,
        "no steady vibration was found close to the estimate of {parameters}: no standard deviation is known",
        "start from other values, or leave out tests with irregular motion",
    )
    FIGURES_WORTHLESS = (
        OutcomeKind.UNTRUSTED,
        "not reliable: with 1.5 times the modes[ and {elements}] values change, displacements among them: {figures}",
        "[{remedy}]",
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
        """Names of the numbers that the message needs."""
        names = _names(_OPTIONAL.sub("", self.message + self.remedy))
        return frozenset(name.replace("place", "parameter") for name in names)


_IN_UNITS = {"unit": ("parameter", "beyond", "ranges", "levels", "missed"), "level_unit": ("level",)}
"""Names of units among the numbers of an outcome, and the numbers that are in them."""
_OPTIONAL = re.compile(r"\[([^\]]*)\]")


@dataclass(frozen=True)
class Outcome:
    """How a computation ended.

    Parameters
    ----------
    code : how it ended.
    numbers : by name; also words that belong to the message. ``parameter`` is the value at which a branch ended, in the
        unit ``unit``. An outcome read from an old file has only ``text``.
    parts : outcomes that caused this one or accompany it.

    Raises
    ------
    ValueError
        If a number that the message needs is missing.
    """

    code: OutcomeCode
    numbers: Mapping[str, Number] = field(default_factory=dict)
    parts: tuple[Outcome, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "numbers", {name: _plain(value) for name, value in self.numbers.items()})
        missing = self.code.needs - self.numbers.keys()
        if missing and "text" not in self.numbers:
            raise ValueError(f"{self.code.name} needs {', '.join(sorted(missing))}")

    def __hash__(self) -> int:
        return hash((self.code, self.parts))

    @classmethod
    def of(cls, code: OutcomeCode, *parts: Outcome, **numbers: Any) -> Self:
        """Make an outcome from its code and its numbers."""
        return cls(code, numbers, parts)

    @property
    def kind(self) -> OutcomeKind:
        """What the outcome means for the result."""
        return self.code.kind

    @property
    def complete(self) -> bool:
        """Whether everything requested was computed and is reliable."""
        return self.kind in (OutcomeKind.COMPLETE, OutcomeKind.NOTED) and all(part.complete for part in self.parts)

    @property
    def trusted(self) -> bool:
        """Whether what was computed is reliable, even if it is not complete."""
        unreliable = self.kind in (OutcomeKind.UNTRUSTED, OutcomeKind.FAILED)
        return not unreliable and all(part.trusted for part in self.parts)

    @property
    def interrupted(self) -> bool:
        """Whether the computation ended on request."""
        return self.kind is OutcomeKind.INTERRUPTED or any(part.interrupted for part in self.parts)

    @property
    def cut_short(self) -> bool:
        """Whether something that was requested was not computed."""
        missing = self.kind in (OutcomeKind.STOPPED, OutcomeKind.FAILED, OutcomeKind.INTERRUPTED)
        return missing or any(part.cut_short for part in self.parts)

    @property
    def message(self) -> str:
        """What happened, with the numbers filled in."""
        return str(self.numbers["text"]) if "text" in self.numbers else _filled(self.code.message, self.numbers)

    @property
    def remedy(self) -> str:
        """What to try; may be empty."""
        return "" if "text" in self.numbers else _filled(self.code.remedy, self.numbers)

    @property
    def text(self) -> str:
        """Message and remedy, followed by those of the parts."""
        own = self._own_text
        if self._says_complete:
            own = f"complete: {own}" if own else "complete"
        return "; ".join(text for text in (self._prefix + own, *(part.text for part in self.parts)) if text)

    @property
    def statements(self) -> tuple[str, ...]:
        """What `text` says, one text for each outcome, the first one ``complete`` where everything was computed."""
        own = self._own_text
        own = self._prefix + (own or "complete") if self._prefix else own
        of_parts = [text for part in self.parts for text in part.statements[part._says_complete :]]
        return tuple(text for text in ("complete" * self._says_complete, own, *of_parts) if text)

    @property
    def _says_complete(self) -> bool:
        return self.kind is OutcomeKind.COMPLETE and "text" not in self.numbers

    @property
    def _prefix(self) -> str:
        return f"{self.numbers['prefix']}: " if "prefix" in self.numbers else ""

    @property
    def _own_text(self) -> str:
        return "; ".join(text for text in (self.message, self.remedy) if text)

    def __str__(self) -> str:
        return self.text

    def all_of(self, code: OutcomeCode) -> list[Outcome]:
        """This outcome and its parts, as far as they have a code."""
        of_parts = [outcome for part in self.parts for outcome in part.all_of(code)]
        return [self, *of_parts] if self.code is code else of_parts

    def but(self, *parts: Outcome, **numbers: Any) -> Self:
        """A copy with other or additional numbers, and with additional parts."""
        return replace(self, numbers={**self.numbers, **numbers}, parts=(*self.parts, *parts))

    def shown(self, convert: Callable[[float], float], unit: str = "", name: str = "") -> Self:
        """A copy whose parameter, and those of its parts, are converted to the units shown to the user."""
        parts = tuple(part.shown(convert, unit, name) for part in self.parts)
        parameter = self.numbers.get("parameter")
        if not isinstance(parameter, (int, float)) or "unit" in self.numbers or "name" in self.numbers:
            return replace(self, parts=parts)
        place: dict[str, Number] = {"parameter": float(convert(parameter)), "unit": unit, "name": name}
        beyond = self.numbers.get("beyond")
        if isinstance(beyond, (int, float)):
            place["beyond"] = float(convert(beyond))
        return replace(self, numbers={**self.numbers, **place}, parts=parts)

    def displayed(self, scale: Callable[[str, list[float]], tuple[float, str]]) -> Self:
        """A copy in the units of tables, for people.

        Parameters
        ----------
        scale : the factor and the unit in which some numbers of a unit are shown.
        """
        numbers = dict(self.numbers)
        for of, names in _IN_UNITS.items():
            held = {name: numbers[name] for name in names if isinstance(numbers.get(name), (int, float, tuple))}
            if numbers.get(of) and held:
                factor, unit = scale(str(numbers[of]), [x for value in held.values() for x in _each(value)])
                numbers |= {name: _times(value, factor) for name, value in held.items()} | {of: unit}
        return replace(self, numbers=numbers, parts=tuple(part.displayed(scale) for part in self.parts))

    def as_dict(self) -> dict[str, Any]:
        """Values that JSON can hold."""
        values: dict[str, Any] = {"code": self.code.label, "numbers": dict(self.numbers)}
        return {**values, "parts": [part.as_dict() for part in self.parts]} if self.parts else values

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """The outcome that `as_dict` describes.

        Raises
        ------
        KeyError
            If the code is unknown.
        """
        code = OutcomeCode[str(values["code"]).upper()]
        return cls(code, values.get("numbers", {}), tuple(cls.from_dict(part) for part in values.get("parts", ())))


def combined(outcomes: Iterable[Outcome]) -> Outcome:
    """The first of several outcomes that is not complete; `COMPLETE` if all are."""
    return next((outcome for outcome in outcomes if not outcome.complete), COMPLETE)


def both_directions(backward: Outcome, forward: Outcome) -> Outcome:
    """The outcome of a branch that was followed in both directions from a point: the incomplete one comes first."""
    if backward == forward:
        return backward
    swap = backward.complete and not forward.complete
    first, second = (forward, backward) if swap else (backward, forward)
    return first.but(second.but(prefix="in the other direction"))


def _plain(value: Any) -> Number:
    """A value as JSON would return it."""
    if isinstance(value, str):
        return str(value)
    if isinstance(value, Sequence) or hasattr(value, "tolist"):
        items = value.tolist() if hasattr(value, "tolist") else value
        return tuple(_plain(item) for item in items) if isinstance(items, Sequence) else items
    return value  # type: ignore[no-any-return]


def _each(value: Any) -> list[float]:
    """The numbers of nested tuples."""
    return [x for item in value for x in _each(item)] if isinstance(value, tuple) else [float(value)]


def _times(value: Any, factor: float) -> Number:
    return tuple(_times(item, factor) for item in value) if isinstance(value, tuple) else float(value) * factor


def _names(template: str) -> set[str]:
    return {name for _, name, _, _ in Formatter().parse(template) if name}


def _filled(template: str, numbers: Mapping[str, Number]) -> str:
    """A template with its numbers filled in; an optional part is left out if one of its numbers is missing or empty."""
    known: dict[str, Number] = dict(numbers)
    if "parameter" in numbers:
        known["place"] = _place(numbers)
    if "level" in numbers:
        known["at_level"] = f"level {numbers['level']:.4g} {numbers.get('level_unit', '')}".rstrip()

    def optional(part: re.Match[str]) -> str:
        return part[1] if all(known.get(name) not in (None, "", ()) for name in _names(part[1])) else ""

    return _TextFormatter().vformat(_OPTIONAL.sub(optional, template), (), known)


def _place(numbers: Mapping[str, Number]) -> str:
    value, name, unit = numbers["parameter"], numbers.get("name", ""), numbers.get("unit", "")
    if not name and "unit" not in numbers:
        name = "parameter"
    return f"{name} {_shown(value)} {unit if unit != '1' else ''}".strip()


class _TextFormatter(Formatter):
    """Formats numbers to six digits and lists with commas."""

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
"""Everything requested was computed."""
