"""What surrounds every command: what it is options, what it prints, how far it is, and how it ends.

What it raises becomes a message and an exit code (`beamsim.outcomes.ExitCode`). The first Ctrl-C or SIGTERM sets a
flag, the second ends the command at once. Progress is shown on standard error: a bar on terminals, elsewhere a line
every few seconds.
"""

from __future__ import annotations

import errno
import io
import os
import signal
import sys
import threading
import time as clock
import traceback
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from json import dumps
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, NamedTuple

import typer

from beamsim.cli.received import latest_signal
from beamsim.errors import MOST_HOURS, BeamsimError, ScenarioError, TooLongError, VerdictError, allowed_hours, visible
from beamsim.outcomes import ExitCode

if TYPE_CHECKING:
    from beamsim.scenario import Scenario


class CommandOptions(NamedTuple):
    """Options that commands share: a file, numbers to replace in it, where to write, and what to print."""

    case: Path = Path()  # scenario or result
    overrides: list[str] | None = None
    output: Path | None = None
    json: bool = False
    no_plots: bool = False
    quiet: bool = False
    verbose: bool = False  # whether the whole table is printed
    allow_hours: float = MOST_HOURS  # longest time that the computation may be estimated to take
    check: bool = False  # whether exceeding a limit is an error
    resume: bool = False  # whether to go on from what an interrupted command has kept
    open_files: bool = False  # whether files that a result names may be opened to build its model again


RESULTS = (".h5", ".hdf5")
"""Endings of result files."""


def load_case(options: CommandOptions, command: str = "") -> Scenario:
    """The scenario of a command: that of a YAML file, or of a result file, with what is replaced in it.

    The files that the case of a result names are looked for in its folder and where they were, and must be unchanged.

    Raises
    ------
    ScenarioError
        If the scenario is invalid.
    ResultFileError
        If it is that of a result file, and this cannot be read.
    """
    from beamsim.scenario import load_scenario  # without which --help is instant

    overrides = options.overrides or ()
    if options.case.suffix.lower() in RESULTS:
        return _scenario_of_result(options.case, overrides, command)
    return load_scenario(options.case, overrides, command=command)


def _scenario_of_result(file: Path, overrides: Sequence[str], command: str) -> Scenario:
    """The scenario of a result file for a command, with what is replaced in it; raises as `load_case`."""
    from beamsim.scenario import load_scenario
    from beamsim.store.results import load

    scenario: Scenario = load(file).scenario
    if overrides:
        scenario = load_scenario(scenario, overrides, command=command)
    return scenario.with_source(file.stem)


def result_stem(options: CommandOptions) -> str:
    """Stem of the file that a command writes: that of its case, with ``_again`` if the case is a result file."""
    return f"{options.case.stem}_again" if options.case.suffix.lower() in RESULTS else options.case.stem


# --- What is printed -------------------------------------------------------------------------------------------------


def say(text: str) -> None:
    """Print a message on standard error."""
    print(visible(text), file=sys.stderr, flush=True)


def show(*texts: object) -> None:
    """Print texts on standard output, a line each, with escapes in place of control characters from files."""
    print(*(visible(str(text)) for text in texts), sep="\n")


def print_json(values: Mapping[str, Any]) -> None:
    """One JSON object on standard output; non-finite numbers are null.

    Where the encoding of the output lacks a character, JSON's own escapes stand for all that are not ASCII.
    """
    from beamsim.summaries import as_builtin  # and with it NumPy, without which --help is instant

    text = dumps(as_builtin(values), ensure_ascii=False, allow_nan=False)
    try:
        text.encode(sys.stdout.encoding or "utf-8")
    except UnicodeEncodeError:
        text = dumps(as_builtin(values), allow_nan=False)
    show(text)


def print_files(files: Sequence[Path], *, json: bool, quiet: bool = False) -> None:
    """Print the files written by a command, one per line; as JSON also where it is quiet.

    Parameters
    ----------
    files : in the order of printing.
    json : whether to print JSON.
    quiet : whether to print no lines.
    """
    if json:
        print_json({"files": [str(path) for path in files]})
    elif not quiet:
        show(*files)


# --- How a command ends ----------------------------------------------------------------------------------------------

NOTHING_INCOMPLETE = "beamsim: interrupted; no incomplete file was left"

# errors of print when the disk is full; not every system defines all of them
OUTPUT_REFUSED = [getattr(errno, name) for name in ("ENOSPC", "EIO", "EFBIG", "EDQUOT") if hasattr(errno, name)]


def verdict(error: BaseException) -> tuple[int, str]:
    """Exit code and message for an exception."""
    if isinstance(error, KeyboardInterrupt):
        return ExitCode.INTERRUPTED, NOTHING_INCOMPLETE
    if isinstance(error, ScenarioError):
        return error.exit_code, "\n".join(
            str(problem) if problem.file else f"beamsim: {problem}" for problem in error.problems
        )
    if isinstance(error, BeamsimError):
        return error.exit_code, f"beamsim: {error}"
    if isinstance(error, MemoryError):
        reason = f" ({error})" if str(error) else ""
        return ExitCode.USAGE, f"beamsim: not enough memory{reason}; reduce run.duration, run.sample_rate or the model"
    if isinstance(error, OSError) and error.filename is not None:
        return ExitCode.USAGE, f"beamsim: {error.filename}: {error.strerror}"
    if isinstance(error, OSError) and error.errno in OUTPUT_REFUSED:
        return ExitCode.USAGE, f"beamsim: cannot write the output: {error.strerror}"
    text = f"{type(error).__name__}: {error}".splitlines()[0]
    return ExitCode.BUG, f"beamsim: internal error ({text}); use --debug for the traceback"


def interruption_behind(error: BaseException) -> BaseException | None:
    """What SIGINT or SIGTERM raised, where a library made an error of its own of it; None for other errors.

    >>> try:
    ...     try:
    ...         raise KeyboardInterrupt
    ...     except:
    ...         raise ValueError("cannot write")
    ... except ValueError as error:
    ...     interruption_behind(error)
    KeyboardInterrupt()
    """
    if isinstance(error, VerdictError):  # the partial result is kept
        return None
    behind = error.__context__
    while behind is not None and not isinstance(behind, (KeyboardInterrupt, SystemExit)):
        behind = behind.__context__
    return behind


def broken_pipe(error: BaseException) -> bool:
    """Whether standard output was closed by its reader (``| head``); on Windows that is an invalid argument."""
    invalid = sys.platform == "win32" and getattr(error, "errno", None) == errno.EINVAL
    return isinstance(error, BrokenPipeError) or (isinstance(error, OSError) and invalid and error.filename is None)


def discard_output() -> None:
    """Discard buffered standard output, so that flushing it at exit does not fail."""
    try:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (AttributeError, OSError, ValueError):  # no such function, or no file behind standard output
        sys.stdout = io.StringIO()


@contextmanager
def with_exit_code(*, debug: bool) -> Iterator[None]:
    """Let the block end the command with the message and exit code of what it raises.

    Parameters
    ----------
    debug : whether to print the traceback of an error.

    Raises
    ------
    typer.Exit
        With the exit code.
    """
    try:
        yield
        if sys.stdout is not None:
            sys.stdout.flush()  # here, where a full disk can be reported
    except typer.Exit:
        raise
    except (Exception, KeyboardInterrupt, SystemExit) as raised:
        raise _exit_exception(raised, debug=debug) from None


def _exit_exception(raised: BaseException, *, debug: bool) -> BaseException:
    """Say why a command ends, and return what ends it with its exit code."""
    error = raised
    if not isinstance(raised, SystemExit | VerdictError):
        error = interruption_behind(raised) or latest_signal() or raised
    if isinstance(error, SystemExit):
        if error is not raised or error.code == ExitCode.TERMINATED:
            say(NOTHING_INCOMPLETE)
        return error
    if broken_pipe(error):
        discard_output()
        return typer.Exit(ExitCode.BROKEN_PIPE)
    if debug:
        traceback.print_exception(error)
    code, message = verdict(error)
    say(message)
    return typer.Exit(code)


STOPPING = "beamsim: stopping, and saving what was found; press again to stop at once without saving"


@dataclass(eq=False)
class Interruption:
    """Whether a signal asked the command to end: what analyses call ``stop``."""

    signal: int = 0  # its number, or 0; of two that of the second
    at_once: bool = False  # whether there was a second one

    def __call__(self) -> bool:
        """Whether one was received."""
        return self.signal != 0

    def request(self, number: int, _frame: FrameType | None) -> None:
        """Take note of a signal.

        Raises
        ------
        KeyboardInterrupt
            If it is the second one.
        """
        self.at_once, self.signal = self.signal != 0, number
        if self.at_once:
            raise KeyboardInterrupt
        say(STOPPING)


@contextmanager
def interruptible() -> Iterator[Interruption]:
    """Yield a flag that the first SIGINT or SIGTERM in the block sets; the second ends the block at once.

    Signals that the process was started to ignore (``nohup``, background jobs of a shell) stay ignored.
    """
    interruption = Interruption()
    before = {
        number: handler
        for number in (signal.SIGINT, signal.SIGTERM)
        if callable(handler := signal.getsignal(number)) or handler == signal.SIG_DFL
    }

    try:
        for number in before:
            signal.signal(number, interruption.request)
        yield interruption
    except BaseException as error:
        stopped = interruption.at_once or isinstance(error, KeyboardInterrupt)
        if isinstance(error, VerdictError) or not stopped:  # a verdict tells of a complete result, which is kept
            raise
        if interruption.signal == signal.SIGTERM:
            sys.exit(ExitCode.TERMINATED)
        raise KeyboardInterrupt from None  # libraries make errors of their own of it
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


# --- How far it is ---------------------------------------------------------------------------------------------------

SHOWN_AFTER_S = 2.0  # what takes less needs no report
INTERVAL_S = 1.0  # of time, at least, over which a rate is measured
INTERVALS = 4  # before the fastest rate counts: the first ones include the compilation of kernels


class Progress:
    """How far one part of a command is; call it with the fraction that is done.

    Parameters
    ----------
    label : what is done, "simulating case.yaml".
    afterwards : what is done from fraction 1 on, of which no fraction is known; the label where nothing follows.
    """

    def __init__(self, label: str, afterwards: str = "") -> None:
        self._label = visible(label)
        self._afterwards = afterwards or label
        self.begin = clock.monotonic()  # s
        self._first: tuple[float, float] | None = None  # time and fraction of the first call: what was resumed is known
        self._last, self._reached = 0.0, self.begin  # the fraction of the latest call that raised it, and its time
        self._allowed_hours = allowed_hours.get()
        self._interval = (0.0, 0.0)  # time and fraction where the present one begins
        self._paces: list[float] = []  # s for the whole, at the rate of each interval

    def __call__(self, fraction: float) -> None:
        """Set the fraction that is done.

        Raises
        ------
        TooLongError
            If the rest would take longer than is allowed at the fastest rate up to now.
        """
        now, before = clock.monotonic(), self._last
        self._last = min(max(fraction, before), 1.0)  # a step of the part may begin again
        if self._last != before:
            self._reached = now
        if self._first is None:
            self._first = self._interval = now, self._last
        took, gained = now - self._interval[0], self._last - self._interval[1]
        if took < INTERVAL_S or gained <= 0.0:
            return
        self._interval = now, self._last
        self._paces.append(took / gained)
        hours = min(self._paces) * (1.0 - self._last) / 3600.0
        if len(self._paces) >= INTERVALS and hours > self._allowed_hours:
            raise TooLongError(f"{self._label}: the rest would take about", hours)

    def pause(self) -> None:
        """Forget the rate: nothing is being done. No time is estimated before more is done."""
        self._first = None
        self._paces.clear()

    def state(self) -> tuple[str, float | None, float | None]:
        """What is being done, the fraction that is done, and the time left if it goes on as before, s.

        Fraction and time are None where they are not known. The time is what was left when the fraction was reached,
        less what has passed since: parts of which no fraction is known may follow.
        """
        if self._first is None:
            return self._label, None, None
        if self._last >= 1.0:
            return self._afterwards, None, None
        since, begin = self._first
        gained = self._last - begin
        if gained <= 0.0:
            return self._label, self._last, None
        left = (self._reached - since) * (1.0 - self._last) / gained - (clock.monotonic() - self._reached)
        return self._label, self._last, left if left > 0.0 else None

    def __str__(self) -> str:
        label, fraction, remaining = self.state()
        left = f"{duration(clock.monotonic() - self.begin)} so far" if remaining is None else _time_left_text(remaining)
        return f"{label}, {left}" if fraction is None else f"{label}: {100.0 * fraction:.0f} % done, {left}"


@contextmanager
def progress_of(label: str, *, shown: bool, afterwards: str = "") -> Iterator[Progress]:
    """Report on standard error how far the block is, as soon as it takes more than two seconds.

    Parameters
    ----------
    label, afterwards : as of `Progress`.
    shown : whether to report at all.

    Yields
    ------
    To be called with the fraction that is done.
    """
    progress = Progress(label, afterwards)
    if not shown:
        yield progress
        return
    ended = threading.Event()
    report = _show_bar if sys.stderr.isatty() else _print_lines
    reporter = threading.Thread(target=report, args=(progress, ended), daemon=True)
    reporter.start()
    try:
        yield progress
    finally:
        ended.set()
        reporter.join()


def _print_lines(progress: Progress, ended: threading.Event) -> None:
    interval = SHOWN_AFTER_S
    while not ended.wait(interval):
        with suppress(OSError, ValueError):  # standard error is closed: the command itself will see to it
            say(f"beamsim: {progress}")
        interval = min(max(5.0, 0.1 * (clock.monotonic() - progress.begin)), 30.0)  # rarer the longer it takes


def _show_bar(progress: Progress, ended: threading.Event) -> None:
    if ended.wait(SHOWN_AFTER_S):
        return
    from rich.console import Console
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    label, left = TextColumn("{task.description}", markup=False), TextColumn("{task.fields[left]}")
    columns = (label, BarColumn(), TaskProgressColumn(), TimeElapsedColumn(), left)
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(progress.state()[0], total=None, left="")
        while True:
            what, fraction, remaining = progress.state()
            bar.update(
                task,
                description=what,
                total=None if fraction is None else 1.0,
                completed=fraction or 0.0,
                left="" if remaining is None else _time_left_text(remaining),
            )
            if ended.wait(0.2):
                return


def _time_left_text(seconds: float) -> str:
    return f"about {duration(seconds)} remain" if seconds >= 1.0 else "less than 1 s remain"


def duration(seconds: float) -> str:
    """A time as people say it.

    >>> duration(12.3), duration(600.0), duration(7200.0)
    ('12 s', '10 min', '2.0 h')
    """
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"
