"""The exception family: what went wrong, where, and what to do about it.

Every exception carries the exit code with which the command line ends.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import IntEnum


class ExitCode(IntEnum):
    """How the command line ends; a signal ends it with 128 and its number."""

    SUCCESS = 0
    BUG = 1
    USAGE = 2  # usage, scenario or file
    NOT_CONVERGED = 3  # stopped before the end, or not to be trusted; the partial result is saved
    LIMIT_EXCEEDED = 4  # under --check
    INTERRUPTED = 130  # from the keyboard
    BROKEN_PIPE = 141


@dataclass(frozen=True)
class Problem:
    """One thing wrong with a scenario.

    ``path`` is written as the user would (``snubbers[0].position``); ``file`` and ``line`` are
    ``None`` where the value did not come from a file (a default, an override, the Python API).
    """

    path: str
    message: str
    remedy: str = ""
    file: str | None = None
    line: int | None = None

    def __str__(self) -> str:
        where = "" if self.file is None else f"{self.file}:"
        if self.line is not None:
            where += f"{self.line}:"
        text = f"{where} {self.path} {self.message}".strip() if self.path else f"{where} {self.message}".strip()
        return f"{text}; {self.remedy}" if self.remedy else text


class BeamsimError(Exception):
    """Root of the family; ends the command line with ``exit_code``."""

    exit_code: int = ExitCode.BUG


class ScenarioError(BeamsimError):
    """The scenario (or the command's usage) is wrong; holds every problem found, located."""

    exit_code = ExitCode.USAGE

    def __init__(self, problems: Problem | str | Sequence[Problem]) -> None:
        if isinstance(problems, str):
            problems = Problem("", problems)
        self.problems: tuple[Problem, ...] = (problems,) if isinstance(problems, Problem) else tuple(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))


class MethodError(BeamsimError):
    """A method cannot treat the system that it was given.

    ``about`` names what is in the way in the method's own terms (``mode``, ``energy``); `locating` turns that into the
    place in a scenario.
    """

    exit_code = ExitCode.USAGE

    def __init__(self, about: str, message: str, remedy: str = "") -> None:
        self.about, self.message, self.remedy = about, message, remedy
        super().__init__(str(Problem(about, message, remedy)))


@contextmanager
def locating(places: Mapping[str, str]) -> Iterator[None]:
    """Raise a `MethodError` as the `ScenarioError` at the place that it is about.

    >>> with locating({"mode": "nnm.mode"}):
    ...     raise MethodError("mode", "= 1 is a rigid-body mode")
    Traceback (most recent call last):
    beamsim.errors.ScenarioError: nnm.mode = 1 is a rigid-body mode
    """
    try:
        yield
    except MethodError as error:
        path = places.get(error.about, error.about)
        raise ScenarioError(Problem(path, error.message, error.remedy)) from None


class ResultFileError(BeamsimError):
    """A result file is missing, damaged, or not one of beamsim's."""

    exit_code = 2


class NotTrustedError(BeamsimError):
    """A computation ended without a result that can be trusted."""

    exit_code = ExitCode.NOT_CONVERGED


class StoppedEarlyError(BeamsimError):
    """A computation ended before it was complete; the partial result was saved."""

    def __init__(self, text: str, exit_code: int) -> None:
        super().__init__(text)
        self.exit_code = exit_code


class LimitExceededError(BeamsimError):
    """An allowable is exceeded, and ``--check`` asked for an answer in the exit code."""

    exit_code = ExitCode.LIMIT_EXCEEDED
