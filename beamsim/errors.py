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

    As text it has all of these in one line.

    Examples
    --------
    >>> import beamsim
    >>> print(beamsim.Problem("run.duration", "= 0 s must be positive", "give for example 1 s", "case.yaml", 12))
    case.yaml:12: run.duration = 0 s must be positive; give for example 1 s
    """

    path: str  #: place as a user writes it, ``snubbers[0].position``; empty where no key names it
    message: str  #: what is wrong, to be read after the path
    remedy: str = ""  #: what to do
    file: str | None = None  #: None if the value did not come from a file (a default, an override, a mapping)
    line: int | None = None  #: in the file, from 1

    def __str__(self) -> str:
        where = "" if self.file is None else f"{self.file}:"
        if self.line is not None:
            where += f"{self.line}:"
        text = f"{where} {self.path} {self.message}".strip() if self.path else f"{where} {self.message}".strip()
        return f"{text}; {self.remedy}" if self.remedy else text


class BeamsimError(Exception):
    """Base class of all exceptions of the package.

    Examples
    --------
    >>> import beamsim
    >>> try:
    ...     beamsim.run("missing.yaml")
    ... except beamsim.BeamsimError as error:
    ...     print(f"{error} (exit code {error.exit_code})")
    missing.yaml: does not exist; check the path (beamsim new writes a template) (exit code 2)
    """

    exit_code: int = ExitCode.BUG  #: with which it ends the command line


class CacheWarning(UserWarning):
    """Compiled code cannot be kept where it usually is."""


class ScenarioError(BeamsimError):
    """The scenario or the use of a function is wrong; the exception has every problem found, with its place.

    Examples
    --------
    >>> import beamsim
    >>> try:
    ...     beamsim.load_scenario("configs/stops/chain_bumpers.yaml", {"chain.snubbers.cable.gap": "3 kg"})
    ... except beamsim.ScenarioError as error:
    ...     for problem in error.problems:
    ...         print(problem.path, problem.message)
    chain.snubbers[1].gap = 3 kg must be a length, not a mass
    """

    exit_code = ExitCode.USAGE

    problems: tuple[Problem, ...]  #: every one that was found

    def __init__(self, problems: Problem | str | Sequence[Problem]) -> None:
        if isinstance(problems, str):
            problems = Problem("", problems)
        self.problems = (problems,) if isinstance(problems, Problem) else tuple(problems)
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
    """A result file cannot be read (missing, damaged, not from beamsim) or cannot be written.

    Examples
    --------
    >>> import beamsim
    >>> try:
    ...     beamsim.load("configs/one_sided_65hz.yaml")
    ... except beamsim.ResultFileError as error:
    ...     print(str(error).partition(";")[0])
    configs/one_sided_65hz.yaml: is not an HDF5 file, or damaged
    """

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

    Raises
    ------
    TooLongError
        In the block, before a computation that is estimated to take longer.

    Examples
    --------
    >>> import beamsim
    >>> with beamsim.allowing_hours(0.5):
    ...     result = beamsim.run("configs/stops/chain_bumpers.yaml")  # refused if it would take longer
    >>> result.complete
    True
    """
    token = allowed_hours.set(hours)
    try:
        yield
    finally:
        allowed_hours.reset(token)


class TooLongError(BeamsimError):
    """A computation is estimated to take longer than is allowed; `allowing_hours` changes what is allowed.

    Parameters
    ----------
    estimate : what takes how long, up to the number of hours: "simulating case.yaml would take about".
    hours : h, of the estimate.
    keys : of the scenario, whose numbers make it so long; empty where that is not known.

    Examples
    --------
    >>> import beamsim
    >>> stepped = {"sweep": {"kind": "stepped", "from": "10 Hz", "to": "18 Hz", "points": 300}}
    >>> case = beamsim.load_scenario("configs/stops/chain_bumpers.yaml", stepped)
    >>> try:
    ...     with beamsim.allowing_hours(1e-6):
    ...         beamsim.sweep(case)
    ... except beamsim.TooLongError as error:
    ...     print(str(error).partition(", more than")[0])
    1 levels x 300 frequencies, at least 1 ms each, would take at least 8.3e-05 h
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
    """A computation ended without a result that can be used, for example no motion was found, or a cluster was lost.

    A result that is only doubtful or incomplete is returned; its `Result.outcome` says so.

    Examples
    --------
    >>> import beamsim
    >>> issubclass(beamsim.NotTrustedError, beamsim.BeamsimError), int(beamsim.NotTrustedError.exit_code)
    (True, 3)
    """

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
