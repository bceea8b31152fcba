"""How computations end: a kind, a code, the numbers that belong to it, and a sentence, made where it happens.

Every computation returns an `Outcome`. Programs compare its kind and its code and look up its numbers by name; nothing
is parsed out of the text. Between events, points and cases an analysis asks whether it is to end (`stop_requested`),
and returns what it has. What a kind of outcome means for limits and exit codes is decided here alone (`EXIT_RULES`,
`on_limit`, `exit_code`).

>>> sentence = "no solution even with the smallest step"
>>> outcome = Outcome.of(OutcomeKind.STOPPED, "step_too_small", sentence, at=Where(51.25, "Hz"), points=17)
>>> outcome.complete, outcome.numbers["points"]
(False, 17)
>>> outcome.text
'stopped at 51.25 Hz: no solution even with the smallest step'
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import asdict, dataclass, field, replace
from enum import IntEnum, StrEnum
from typing import Any, NamedTuple, Self, TypeVar

Stop = Callable[[], bool]
"""Whether to end."""
Progress = Callable[[float], None] | None
"""Called with the share that is done."""
Point = TypeVar("Point")


def never() -> bool:
    """No request to end."""
    return False


class Interrupted(KeyboardInterrupt):
    """Raised by `check_stop`. Whoever catches it keeps what was computed before."""


class _Requests(NamedTuple):
    """Who may ask the computation under way to end, whether its unfinished part may be given up, and who follows it."""

    stops: tuple[Stop, ...] = ()
    at_once: bool = False
    progress: Progress = None


_NOBODY = _Requests()
_REQUESTS = ContextVar("requests", default=_NOBODY)


@contextmanager
def stop_requests(stop: Stop = never, *, at_once: bool = False, progress: Progress = None) -> Iterator[None]:
    """Let ``stop`` ask what the block computes to end, besides those who ask the blocks around it.

    Parameters
    ----------
    stop : true once it is time.
    at_once : whether `check_stop` may end the block, on any request; else only what polls `stop_requested` does.
    progress : called with the share of the block that its loops have done, as far as they give it to `check_stop`.
    """
    around = _REQUESTS.get()
    outer = _REQUESTS.set(_Requests((*around.stops, stop), around.at_once or at_once, progress))
    try:
        yield
    finally:
        _REQUESTS.reset(outer)


@contextmanager
def deferred_stop() -> Iterator[None]:
    """Let the block come to its end, whoever asks: a short computation without which what was found would be lost.

    >>> with stop_requests(lambda: True), deferred_stop():
    ...     stop_requested()
    False
    """
    outer = _REQUESTS.set(_NOBODY)
    try:
        yield
    finally:
        _REQUESTS.reset(outer)


def stop_requested() -> bool:
    """Whether the computation is asked to end: polled between points, which are kept.

    >>> with stop_requests(lambda: True):
    ...     stop_requested()
    True
    """
    return any(stop() for stop in _REQUESTS.get().stops)


def check_stop(share: float | None = None) -> None:
    """End the computation if it is asked to end; every loop that may take longer than a second calls this.

    Parameters
    ----------
    share : of the loop that is done, where it is known; it is reported to the ``progress`` of `stop_requests`.

    Raises
    ------
    Interrupted
        If it is, within a block of `stop_requests` that may end at once.

    >>> with stop_requests(never, at_once=True):
    ...     check_stop()
    >>> try:
    ...     with stop_requests(lambda: True, at_once=True):
    ...         check_stop()
    ... except Interrupted:
    ...     print("interrupted")
    interrupted
    """
    requests = _REQUESTS.get()
    if requests.at_once and any(stop() for stop in requests.stops):
        raise Interrupted
    if share is not None:
        report_progress(requests.progress, share)


def part_of(progress: Progress, begin: float, end: float) -> Progress:
    """The progress of a part of the whole, which goes from one share of it to another."""
    return None if progress is None else lambda share: progress(begin + (end - begin) * share)


def report_progress(progress: Progress, share: float) -> None:
    """Tell who asked for it which share is done."""
    if progress is not None:
        progress(share)


def until_stop(points: Iterable[Point]) -> Iterator[Point]:
    """The points up to the first one after which the computation is asked to end.

    >>> with stop_requests(lambda: True):
    ...     list(until_stop("abc"))
    ['a']
    """
    for point in points:
        yield point
        if stop_requested():
            return


MOST_LISTED = 6  # items of a list that are written out

Number = float | int | str | tuple["Number", ...]


class OutcomeKind(StrEnum):
    """What an outcome means for the result that it belongs to; the gravest is last."""

    COMPLETE = "complete"  # everything requested was computed
    NOTED = "noted"  # complete; says something about what was found
    DOUBTFUL = "doubtful"  # complete; values change by more than is allowed with a finer model
    NOT_HELD = "not held"  # computed in full and right; the motion does not keep what it was to be kept to
    INCOMPLETE = "incomplete"  # something requested was not computed
    STOPPED = "stopped"  # before the end; the results up to there are valid
    FAILED = "failed"  # no result
    UNTRUSTED = "untrusted"  # computed to the end, but the estimated error is larger than allowed
    INTERRUPTED = "interrupted"  # on request; the results up to there are valid


class ExitCode(IntEnum):
    """Exit codes of the command line; after a signal it is 128 plus the signal's number."""

    SUCCESS = 0
    BUG = 1
    USAGE = 2  # usage, scenario or file
    NOT_CONVERGED = 3  # incomplete or not reliable; the result is saved; under --check: a limit not met nor exceeded
    LIMIT_EXCEEDED = 4  # under --check
    NOT_WRITTEN = 5  # what was computed: no room where it was to go, or a disk that fails
    INTERRUPTED = 130  # from the keyboard
    BROKEN_PIPE = 141
    TERMINATED = 143  # by SIGTERM


class ExitRule(NamedTuple):
    """What a result is worth whose outcome is of a kind."""

    exit_code: ExitCode
    first_line: str = ""  # follows the title; empty where the comparison with a finer model states it


EXIT_RULES = {
    OutcomeKind.COMPLETE: ExitRule(ExitCode.SUCCESS),
    OutcomeKind.NOTED: ExitRule(ExitCode.SUCCESS),
    OutcomeKind.DOUBTFUL: ExitRule(ExitCode.SUCCESS, "NOT CONVERGED"),
    OutcomeKind.NOT_HELD: ExitRule(ExitCode.NOT_CONVERGED, "LIMITS EXCEEDED"),
    OutcomeKind.INCOMPLETE: ExitRule(ExitCode.NOT_CONVERGED, "INCOMPLETE"),
    OutcomeKind.STOPPED: ExitRule(ExitCode.NOT_CONVERGED, "INCOMPLETE"),
    OutcomeKind.FAILED: ExitRule(ExitCode.NOT_CONVERGED, "INCOMPLETE"),
    OutcomeKind.UNTRUSTED: ExitRule(ExitCode.NOT_CONVERGED, "NOT RELIABLE"),
    OutcomeKind.INTERRUPTED: ExitRule(ExitCode.INTERRUPTED, "INCOMPLETE"),
}


class Verdict(StrEnum):
    """The verdict on a limit."""

    MET = "ok"
    EXCEEDED = "exceeded"
    NOT_RELIABLE = "not reliable"  # neither
    UNDECIDED = "undecided"  # by a random motion of this length: the limit lies inside the interval of the value


_BEGINS = {
    OutcomeKind.STOPPED: "stopped", OutcomeKind.UNTRUSTED: "not reliable", OutcomeKind.DOUBTFUL: "not converged",
}  # fmt: skip
_MISSING = (OutcomeKind.INCOMPLETE, OutcomeKind.STOPPED, OutcomeKind.FAILED, OutcomeKind.INTERRUPTED)


class Where(NamedTuple):
    """Where something happened: a parameter, a time, a level; also several values, and ranges as pairs."""

    value: Any
    unit: str | None = None  # None for the parameter of a branch, whose unit the layer above knows
    name: str = ""

    def __str__(self) -> str:
        name = "parameter" if self.unit is None and not self.name else self.name
        unit = "" if self.unit in (None, "1") else self.unit
        return f"{name} {numbers_text(self.value)} {unit}".strip()

    @property
    def phrase(self) -> str:
        """The place in a sentence."""
        ranges = isinstance(self.value, tuple) and any(isinstance(item, tuple) for item in self.value)
        return f"{'from' if ranges else 'at'} {self}"

    def in_unit(self, convert: Callable[[float], float], unit: str, name: str) -> Where:
        """The parameter of a branch in the unit that people read; any other place as it is.

        Parameters
        ----------
        convert : from the parameter's own unit to the one that people read.
        unit, name : that unit, and what people call the parameter.

        Returns
        -------
        Where
            The same place where it has a unit already.
        """
        return Where(_convert_numbers(self.value, convert), unit, name) if self.unit is None else self

    def in_display_units(self, scale: Callable[[str, list[float]], tuple[float, str]]) -> Where:
        """The place in the unit of tables; ``scale`` gives the factor and the unit for numbers in a unit."""
        if not self.unit:
            return self
        factor, unit = scale(self.unit, _flat(self.value))
        return self._replace(value=_convert_numbers(self.value, lambda x: x * factor), unit=unit)


@dataclass(frozen=True)
class Outcome:
    """How a computation ended.

    Parameters
    ----------
    kind : what that means for the result.
    code : what happened, for programs.
    sentence : what happened, for people; the place is added to it.
    remedy : what to try; may be empty.
    place : where it happened, if that belongs to it.
    context : of which part of the computation it is, such as a level or a direction.
    numbers : by name.
    sub_outcomes : outcomes that caused this one or accompany it.

    Examples
    --------
    >>> import beamsim
    >>> outcome = beamsim.run("configs/stops/chain_bumpers.yaml").outcome
    >>> str(outcome.kind), outcome.code, outcome.text
    ('complete', 'complete', 'complete')
    >>> outcome.complete, outcome.usable, outcome.trusted, outcome.interrupted, outcome.cut_short
    (True, True, True, False, False)
    """

    kind: OutcomeKind
    code: str
    sentence: str = ""
    remedy: str = ""
    place: Where | None = None
    context: Where | str = ""
    numbers: Mapping[str, Number] = field(default_factory=dict, hash=False)
    sub_outcomes: tuple[Outcome, ...] = ()

    @classmethod
    def of(
        cls, kind: OutcomeKind, code: str, sentence: str = "", *sub_outcomes: Outcome, at: Where | float | None = None,
        remedy: str = "", **numbers: Any,
    ) -> Self:  # fmt: skip
        """Make an outcome.

        Parameters
        ----------
        kind, code, sentence : see the class.
        sub_outcomes : outcomes that caused this one or accompany it.
        at : where it happened; a bare number is the parameter of a branch.
        remedy : what to try.
        numbers : by name.

        Returns
        -------
        Outcome
        """
        place = at if isinstance(at, Where) or at is None else Where(float(at))
        if place is not None:
            place = place._replace(value=_as_json(place.value))
        return cls(kind, code, sentence, remedy, place, "", {k: _as_json(v) for k, v in numbers.items()}, sub_outcomes)

    @property
    def gravest_kind(self) -> OutcomeKind:
        """The gravest kind of this outcome and of its parts."""
        if not self.sub_outcomes:  # asked for after every cycle of a march
            return self.kind
        return max((self.kind, *(part.gravest_kind for part in self.sub_outcomes)), key=list(OutcomeKind).index)

    @property
    def complete(self) -> bool:
        """Whether everything requested was computed, and no value of it is known to be doubtful."""
        return self.gravest_kind in (OutcomeKind.COMPLETE, OutcomeKind.NOTED)

    @property
    def usable(self) -> bool:
        """Whether everything requested was computed and can be used: complete, or doubtful in some of its values."""
        return EXIT_RULES[self.gravest_kind].exit_code == ExitCode.SUCCESS

    @property
    def trusted(self) -> bool:
        """Whether what was computed can be used, even if something is missing or some values are doubtful."""
        unreliable = self.kind in (OutcomeKind.UNTRUSTED, OutcomeKind.FAILED)
        return not unreliable and all(part.trusted for part in self.sub_outcomes)

    @property
    def interrupted(self) -> bool:
        """Whether the computation ended on request."""
        return self.kind is OutcomeKind.INTERRUPTED or any(part.interrupted for part in self.sub_outcomes)

    @property
    def cut_short(self) -> bool:
        """Whether something that was requested was not computed."""
        return self.kind in _MISSING or any(part.cut_short for part in self.sub_outcomes)

    @property
    def ended_early(self) -> bool:
        """Whether the computation did not come to its end; what was also asked of it may be missing without that."""
        early = self.kind in _MISSING and self.kind is not OutcomeKind.INCOMPLETE
        return early or any(part.ended_early for part in self.sub_outcomes)

    @property
    def unless_complete(self) -> tuple[Outcome, ...]:
        """This outcome, for the parts of another one; nothing where it is complete."""
        return () if self.complete else (self,)

    @property
    def message(self) -> str:
        """What happened, and where."""
        where = "" if self.place is None else f" {self.place.phrase}"
        if self.kind is OutcomeKind.INTERRUPTED:
            return f"interrupted{where} {self.sentence}".rstrip()
        begins = _BEGINS.get(self.kind)
        if begins is None:
            return f"{self.sentence}{where}".strip()
        return f"{begins}{where}: {self.sentence}" if self.sentence else f"{begins}{where}"

    @property
    def text(self) -> str:
        """Statements about it and its parts; the text begins with ``complete`` where nothing is incomplete or doubtful.

        Parts that are complete are not called so: next to incomplete ones, it would be read as of the whole.
        """
        statements = "; ".join(self.statements)
        if self.kind is not OutcomeKind.COMPLETE or not self.complete:
            return statements
        return f"complete{':' if self.message else ';'} {statements}" if statements else "complete"

    @property
    def statements(self) -> tuple[str, ...]:
        """Message and remedy of this outcome, then those of its parts; nothing of those that have none."""
        own = "; ".join(filter(None, (self.message, self.remedy)))
        own = f"{self.context}: {own}" if own and self.context else own
        return tuple(filter(None, (own, *(text for part in self.sub_outcomes for text in part.statements))))

    @property
    def of_part(self) -> str:
        """Statements about a part of a result, such as a branch; the whole may be incomplete although the part is not.

        >>> Outcome.of(OutcomeKind.COMPLETE, "closed_curve", "closed curve").of_part
        'closed curve'
        """
        return "; ".join(self.statements) or self.text

    def __str__(self) -> str:
        return self.text

    def outcomes_with_code(self, code: str) -> list[Outcome]:
        """This outcome and its parts, as far as they have a code."""
        of_parts = [outcome for part in self.sub_outcomes for outcome in part.outcomes_with_code(code)]
        return [self, *of_parts] if self.code == code else of_parts

    def copy_with(self, *sub_outcomes: Outcome, **fields: Any) -> Self:
        """A copy with additional parts, and other fields."""
        return replace(self, sub_outcomes=(*self.sub_outcomes, *sub_outcomes), **fields)

    def in_unit(self, convert: Callable[[float], float], unit: str = "", name: str = "") -> Self:
        """A copy in which the parameter of a branch, here and in the parts, is in the unit that people read.

        Parameters
        ----------
        convert : from the parameter's own unit to the one that people read.
        unit, name : that unit, and what people call the parameter.

        Returns
        -------
        Outcome
            Places that have a unit already stay as they are.
        """
        place = None if self.place is None else self.place.in_unit(convert, unit, name)
        return replace(
            self, place=place, sub_outcomes=tuple(part.in_unit(convert, unit, name) for part in self.sub_outcomes)
        )

    def in_display_units(self, scale: Callable[[str, list[float]], tuple[float, str]]) -> Self:
        """A copy with its places in the units of tables.

        Parameters
        ----------
        scale : the factor and the unit in which some numbers of a unit are shown.
        """
        place = None if self.place is None else self.place.in_display_units(scale)
        within = self.context.in_display_units(scale) if isinstance(self.context, Where) else self.context
        return replace(
            self,
            place=place,
            context=within,
            sub_outcomes=tuple(part.in_display_units(scale) for part in self.sub_outcomes),
        )

    def as_dict(self) -> dict[str, Any]:
        """Values that JSON can hold."""
        return {name: value for name, value in asdict(self).items() if value not in (None, "", {}, ())} | {
            "sub_outcomes": [part.as_dict() for part in self.sub_outcomes]
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """The outcome that `as_dict` describes.

        Raises
        ------
        KeyError, ValueError
            If there is no such kind.
        """
        read = {name: _as_json(value) for name, value in values.items() if name not in ("numbers", "sub_outcomes")}
        for name in ("place", "context"):
            if isinstance(read.get(name), tuple):
                read[name] = Where(*read[name])
        numbers = {name: _as_json(value) for name, value in values.get("numbers", {}).items()}
        parts = tuple(cls.from_dict(part) for part in values.get("sub_outcomes", ()))
        return cls(**read | {"kind": OutcomeKind(values["kind"])}, numbers=numbers, sub_outcomes=parts)

    def as_texts(self) -> dict[str, str]:
        """Texts that a file stores: ``status`` for people, its code ``outcome``; as JSON ``outcome_numbers``."""
        values = self.as_dict()
        code = str(values.pop("code"))
        return {"status": self.text, "outcome": code, "outcome_numbers": json.dumps(values, ensure_ascii=False)}

    @classmethod
    def from_texts(cls, texts: Mapping[str, Any]) -> Self:
        """The outcome that `as_texts` describes.

        Raises
        ------
        KeyError, ValueError
            If a text is missing, or describes none.
        """
        return cls.from_dict({"code": str(texts["outcome"]), **json.loads(texts["outcome_numbers"])})


COMPLETE = Outcome(OutcomeKind.COMPLETE, "complete")
"""Everything requested was computed."""


def on_limit(lowest: float, highest: float, limit: float, outcome: Outcome = COMPLETE) -> Verdict:
    """The verdict on a limit: met or exceeded only if that holds for a value with its change added and subtracted.

    Parameters
    ----------
    lowest, highest : the value less and plus its change with a finer model, in the unit of the limit; nan if unknown.
    limit : what the value must not exceed.
    outcome : of the computation. What is not reliable meets and exceeds no limit; what is missing may exceed it.

    Returns
    -------
    Verdict

    >>> [str(on_limit(0.9 * x, 1.1 * x, 1.0)) for x in (0.9, 1.0, 1.2)]
    ['ok', 'not reliable', 'exceeded']
    """
    if not outcome.trusted:
        return Verdict.NOT_RELIABLE
    if lowest > limit:
        return Verdict.EXCEEDED
    return Verdict.MET if highest <= limit and not outcome.cut_short else Verdict.NOT_RELIABLE


def exit_code(outcome: Outcome, limits: Iterable[str] = (), signal: int = 0) -> int:
    """Exit code of a command.

    Parameters
    ----------
    outcome : of its result.
    limits : the verdicts on those that are checked.
    signal : that ended it; 0 for none.

    Returns
    -------
    int

    >>> others = [], ["not reliable"], ["undecided"], ["undecided", "exceeded"]
    >>> [int(exit_code(COMPLETE, ["ok", *other])) for other in others]
    [0, 3, 3, 4]
    """
    if signal:
        return 128 + signal
    code, verdicts = EXIT_RULES[outcome.gravest_kind].exit_code, set(limits)
    if code == ExitCode.INTERRUPTED:
        return code
    if Verdict.EXCEEDED in verdicts:
        return ExitCode.LIMIT_EXCEEDED
    return code if verdicts <= {Verdict.MET} else max(code, ExitCode.NOT_CONVERGED)


def interruption(when: str = "", *sub_outcomes: Outcome, at: Where | None = None) -> Outcome:
    """The outcome of what ended on request.

    Parameters
    ----------
    when : what follows "interrupted": "during the search", "after 2 of 3 levels".
    sub_outcomes : outcomes that accompany it.
    at : where it ended.

    Returns
    -------
    Outcome
    """
    return Outcome.of(OutcomeKind.INTERRUPTED, "interrupted", when, *sub_outcomes, at=at)


def combined(outcomes: Iterable[Outcome]) -> Outcome:
    """The first of several outcomes that is not complete; `COMPLETE` if all are."""
    return next((outcome for outcome in outcomes if not outcome.complete), COMPLETE)


def first_with_others(outcomes: Sequence[Outcome]) -> Outcome:
    """Several outcomes as one: the first with the others as its parts; `COMPLETE` if there are none."""
    return outcomes[0].copy_with(*outcomes[1:]) if outcomes else COMPLETE


def both_directions(backward: Outcome, forward: Outcome) -> Outcome:
    """The outcome of a branch that was followed in both directions from a point: the incomplete one comes first."""
    if backward == forward:
        return backward
    swap = backward.complete and not forward.complete
    first, second = (forward, backward) if swap else (backward, forward)
    return first.copy_with(replace(second, context="in the other direction"))


def numbers_text(value: Any) -> str:
    """Numbers to six digits, separated by commas; a pair in a list is a range."""
    if isinstance(value, float):
        return f"{value:.6g}"
    if not isinstance(value, tuple):
        return str(value)
    return first_of(
        [" to ".join(map(numbers_text, item)) if isinstance(item, tuple) else numbers_text(item) for item in value],
        MOST_LISTED,
    )


def first_of(texts: Sequence[str], largest_count: int) -> str:
    """Texts separated by commas, the first ones if there are many.

    >>> first_of(["a", "b", "c"], 2), first_of(["a", "b"], 2)
    ('a, b and 1 more', 'a, b')
    """
    more = f" and {len(texts) - largest_count} more" if len(texts) > largest_count else ""
    return ", ".join(texts[:largest_count]) + more


def _as_json(value: Any) -> Any:
    """A value as JSON would return it, lists as tuples."""
    value = value.tolist() if hasattr(value, "tolist") else value
    return tuple(_as_json(item) for item in value) if isinstance(value, (list, tuple)) else value


def _flat(value: Any) -> list[float]:
    return [x for item in value for x in _flat(item)] if isinstance(value, tuple) else [float(value)]


def _convert_numbers(value: Any, convert: Callable[[float], float]) -> Any:
    """The numbers of nested tuples, converted."""
    return (
        tuple(_convert_numbers(item, convert) for item in value) if isinstance(value, tuple) else float(convert(value))
    )
