"""The exceptions: what went wrong, where, and what to do about it.

Every exception carries the exit code of the command line.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace

from beamsim.outcomes import ExitCode


@dataclass(frozen=True)
class Problem:
    """One error in a scenario.

    ``path`` is written as a user would write it (``snubbers[0].position``); ``file`` and ``line`` are ``None`` if the
    value did not come from a file (a default, an override, the Python API).
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
    """Base class; ends the command line with ``exit_code``."""

    exit_code: int = ExitCode.BUG


class CacheWarning(UserWarning):
    """Compiled code cannot be kept where it usually is."""


class ScenarioError(BeamsimError):
    """The scenario or the use of the command is wrong; holds every problem found, with its place."""

    exit_code = ExitCode.USAGE

    def __init__(self, problems: Problem | str | Sequence[Problem]) -> None:
        if isinstance(problems, str):
            problems = Problem("", problems)
        self.problems: tuple[Problem, ...] = (problems,) if isinstance(problems, Problem) else tuple(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))

    @classmethod
    def at(cls, path: str, message: str, remedy: str = "") -> ScenarioError:
        """With one problem; ``path`` is empty where no key names it."""
        return cls(Problem(path, message, remedy))


class MethodError(BeamsimError):
    """A method cannot be applied to the given system.

    ``about`` names the obstacle in the method's terms (``mode``, ``energy``); `locating` translates it into the
    place in a scenario.
    """

    exit_code = ExitCode.USAGE

    def __init__(self, obstacle: str, message: str, remedy: str = "") -> None:
        self.about, self.message, self.remedy = obstacle, message, remedy
        super().__init__(str(Problem(obstacle, message, remedy)))


@contextmanager
def locating(places: Mapping[str, str]) -> Iterator[None]:
    """Turn a `MethodError` into a `ScenarioError` at the corresponding place of the scenario.

    >>> with locating({"mode": "nnm.mode"}):
    ...     raise MethodError("mode", "= 1 is a rigid-body mode")
    Traceback (most recent call last):
    beamsim.errors.ScenarioError: nnm.mode = 1 is a rigid-body mode
    """
    try:
        yield
    except MethodError as error:
        path = places.get(error.about, error.about)
        raise ScenarioError.at(path, error.message, error.remedy) from None


@contextmanager
def prefix_problems(root: str, path: str) -> Iterator[None]:
    """Put the problems of a section, whose path begins with ``root``, at the path where the section is written."""
    try:
        yield
    except ScenarioError as error:
        raise ScenarioError([_replace_root(each, root, path) for each in error.problems]) from None


def _replace_root(problem: Problem, root: str, path: str) -> Problem:
    """A problem whose path begins with ``root``, at the path where that is written; any other as it is."""
    return replace(problem, path=path + problem.path[len(root) :]) if problem.path.startswith(root) else problem


class InputFileError(BeamsimError):
    """A file, or a channel of it, cannot be used: it is missing, too large, damaged, or lacks what is needed.

    ``message`` goes on from the name of the file or channel; ``remedy`` stands for itself; ``path`` is that of the
    file, where only the reader knows it; ``missing``: whether it does not exist.
    """

    exit_code = ExitCode.USAGE

    def __init__(self, message: str, remedy: str, path: object = "", *, missing: bool = False) -> None:
        self.message, self.remedy, self.missing = message, remedy, missing
        super().__init__(f"{path} {message}; {remedy}".lstrip())


class ResultFileError(BeamsimError):
    """A result file is missing, damaged, or not from beamsim."""

    exit_code = ExitCode.USAGE


class NotWrittenError(ResultFileError):
    """What was computed has no room where it was to be written, or the disk fails."""

    exit_code = ExitCode.NOT_WRITTEN

    def __init__(self, path: object, reason: str, remedy: str = "choose another path with -o") -> None:
        self.reason = reason
        super().__init__(f"cannot write {path}: {reason}; {remedy}")


MOST_HOURS = 1000.0
"""Longest time that a computation may be estimated to take, h, where nothing else is allowed."""
allowed_hours = ContextVar("allowed_hours", default=MOST_HOURS)
"""Longest time that a computation may be estimated to take, h; set by `allowing_hours`."""


@contextmanager
def allowing_hours(hours: float) -> Iterator[None]:
    """Allow computations in the block that are estimated to take longer than 1,000 h, or refuse shorter ones.

    Parameters
    ----------
    hours : h, longest time; infinite for any.

    Examples
    --------
    >>> import beamsim
    >>> with beamsim.allowing_hours(5000.0):
    ...     pass  # beamsim.design_study(scenario)
    """
    token = allowed_hours.set(hours)
    try:
        yield
    finally:
        allowed_hours.reset(token)


class TooLongError(BeamsimError):
    """A computation is estimated to take longer than is allowed.

    Parameters
    ----------
    estimate : what takes how long, up to the number of hours: "simulating case.yaml would take about".
    hours : h, of the estimate.
    keys : of the scenario, whose numbers make it so long; empty where that is not known.
    """

    exit_code = ExitCode.USAGE

    def __init__(self, estimate: str, hours: float, keys: Sequence[str] = ()) -> None:
        step = 10.0 ** math.floor(math.log10(2.0 * hours))
        enough = math.ceil(2.0 * hours / step) * step
        lower = f"lower {' or '.join(keys)}" if keys else "check the numbers of the scenario"
        rounded = f"{hours:,.0f}" if hours >= 10.0 else f"{hours:.2g}"
        super().__init__(
            f"{estimate} {rounded} h, more than the {allowed_hours.get():,g} h that are allowed; {lower}, or allow it: "
            f"--allow-hours {enough:g}, in Python beamsim.allowing_hours({enough:g})"
        )


class NotTrustedError(BeamsimError):
    """A computation ended without a reliable result."""

    exit_code = ExitCode.NOT_CONVERGED


class VerdictError(BeamsimError):
    """A result that was saved is partial or not reliable, or does not meet what is checked."""

    def __init__(self, text: str, exit_code: int) -> None:
        super().__init__(text)
        self.exit_code = exit_code


_UNSEEN = re.compile(
    "[\\x00-\\x08\\x0b-\\x1f\\x7f-\\x9f\\u061c\\u200e\\u200f\\u2028-\\u202e\\u2066-\\u2069\\ud800-\\udfff\\ufffe\\uffff]"
)
"""Control characters but for tab and line feed, what reorders text or ends a line, and halves of surrogate pairs."""


def visible(text: str) -> str:
    """A text with escapes in place of characters that would steer a terminal or reorder a line.

    >>> visible("a\\x1b[31m")
    'a\\\\u001b[31m'
    """
    return _UNSEEN.sub(lambda found: f"\\u{ord(found[0]):04x}", text)
