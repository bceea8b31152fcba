"""Environment of every command: options, printing, progress, interruption and exit code.

Exceptions become a message and an exit code (`beamsim.outcomes.ExitCode`). The first Ctrl-C or SIGTERM sets a flag,
the second one ends the command at once. Progress is shown on standard error: a bar on terminals, elsewhere a line
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
    """Shared options of commands: file, replacements in it, output, and printing."""

    case: Path = Path()  # scenario or result file
    overrides: list[str] | None = None
    output: Path | None = None
    json: bool = False
    no_plots: bool = False
    quiet: bool = False
    verbose: bool = False  # print the complete table
    allow_hours: float = MOST_HOURS  # largest estimated time of the computation
    check: bool = False  # treat an exceeded limit as an error
    resume: bool = False  # resume an interrupted command
    open_files: bool = False  # allow opening the files that a result names, to build its model again


RESULTS = (".h5", ".hdf5")
"""Endings of result files."""


def load_case(options: CommandOptions, command: str = "") -> Scenario:
    """Scenario of a command, from a YAML or a result file, with replaced values.

    Files that the case of a result names are searched in its folder and at their old paths, and must be unchanged.

    Raises
    ------
    ScenarioError
        If the scenario is invalid.
    ResultFileError
        If it is in a result file that cannot be read.
    """
    from beamsim.scenario import load_scenario  # without which --help is instant

    overrides = options.overrides or ()
    if options.case.suffix.lower() in RESULTS:
        return _scenario_of_result(options.case, overrides, command)
    return load_scenario(options.case, overrides, command=command)


def _scenario_of_result(path: Path, overrides: Sequence[str], command: str) -> Scenario:
    """Scenario of a result file for a command, with replaced values; raises as `load_case`."""
    from beamsim.scenario import load_scenario
    from beamsim.store.results import load

    scenario: Scenario = load(path).scenario
    if overrides:
        scenario = load_scenario(scenario, overrides, command=command)
    return scenario.with_source(path.stem)


def result_stem(options: CommandOptions) -> str:
    """Stem of the output file: that of the case, with ``_again`` if the case is a result file."""
    return f"{options.case.stem}_again" if options.case.suffix.lower() in RESULTS else options.case.stem


# --- What is printed -------------------------------------------------------------------------------------------------


def say(text: str) -> None:
    """Print a message on standard error."""
    print(visible(text), file=sys.stderr, flush=True)


def show(*texts: object) -> None:
    """Print texts on standard output, one per line, with control characters escaped."""
    print(*(visible(str(text)) for text in texts), sep="\n")


def print_json(values: Mapping[str, Any]) -> None:
    """Print one JSON object on standard output; non-finite numbers become null.

    If the encoding lacks a character, all non-ASCII characters are escaped.
    """
    from beamsim.summaries import as_builtin  # and with it NumPy, without which --help is instant

    text = dumps(as_builtin(values), ensure_ascii=False, allow_nan=False)
    try:
        text.encode(sys.stdout.encoding or "utf-8")
    except UnicodeEncodeError:
        text = dumps(as_builtin(values), allow_nan=False)
    show(text)


def print_files(files: Sequence[Path], *, json: bool, quiet: bool = False) -> None:
    """Print the files written by a command, one per line, or as JSON (also if quiet).

    Parameters
    ----------
    files : files in the order of printing.
    json : True to print JSON.
    quiet : True to print no lines.
    """
    if json:
        print_json({"files": [str(path) for path in files]})
    elif not quiet:
        show(*files)


# --- How a command ends ----------------------------------------------------------------------------------------------

NOTHING_INCOMPLETE = "beamsim: interrupted; no incomplete file was left"

# errors of print on a full disk; not every system defines all of them
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
    """Exception of SIGINT or SIGTERM, if a library replaced it by its own error; else None.

    >>> try:
    ...     try:
    ...         raise KeyboardInterrupt
    ...     except:
    ...         raise ValueError("cannot write")
    ... except ValueError as error:
    ...     interruption_behind(error)
    KeyboardInterrupt()
    """
    if isinstance(error, VerdictError):  # the partial result is saved
        return None
    behind = error.__context__
    while behind is not None and not isinstance(behind, (KeyboardInterrupt, SystemExit)):
        behind = behind.__context__
    return behind


def broken_pipe(error: BaseException) -> bool:
    """True if the reader closed standard output (``| head``); on Windows that is an invalid argument."""
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
    """End the command with the message and exit code of an exception from the block.

    Parameters
    ----------
    debug : True to print the traceback of an error.

    Raises
    ------
    typer.Exit
        With the exit code.
    """
    try:
        yield
        if sys.stdout is not None:
            sys.stdout.flush()  # report a full disk here
    except typer.Exit:
        raise
    except (Exception, KeyboardInterrupt, SystemExit) as raised:
        raise _exit_exception(raised, debug=debug) from None


def _exit_exception(raised: BaseException, *, debug: bool) -> BaseException:
    """Print why a command ends, and return the exception with its exit code."""
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


STOPPING = "beamsim: stopping and saving the results so far; press again to stop at once without saving"


@dataclass(eq=False)
class Interruption:
    """True after a signal to stop; analyses receive it as ``stop``."""

    signal: int = 0  # number of the (latest) signal, or 0
    at_once: bool = False  # True after a second signal

    def __call__(self) -> bool:
        """True if a signal was received."""
        return self.signal != 0

    def request(self, number: int, _frame: FrameType | None) -> None:
        """Handle a signal.

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
    """Yield a flag that the first SIGINT or SIGTERM in the block sets; the second signal ends the block at once.

    Signals that were ignored when the process started (``nohup``, background jobs) stay ignored.
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
        if isinstance(error, VerdictError) or not stopped:  # a verdict belongs to a saved result
            raise
        if interruption.signal == signal.SIGTERM:
            sys.exit(ExitCode.TERMINATED)
        raise KeyboardInterrupt from None  # libraries replace it by their own errors
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


# --- How far it is ---------------------------------------------------------------------------------------------------

SHOWN_AFTER_S = 2.0  # shorter tasks have no progress report
INTERVAL_S = 1.0  # s, least duration over which a rate is measured
INTERVALS = 4  # before the fastest rate is used: the first ones include compilation


class Progress:
    """Progress of one part of a command; call it with the completed fraction.

    Parameters
    ----------
    label : current task, such as "simulating case.yaml".
    afterwards : task after fraction 1, whose fraction is unknown; by default the label.
    """

    def __init__(self, label: str, later_label: str = "") -> None:
        self._label = visible(label)
        self._afterwards = later_label or label
        self.begin = clock.monotonic()  # s
        self._first: tuple[float, float] | None = None  # time and fraction of the first call
        self._last, self._reached = 0.0, self.begin  # latest increased fraction, and its time
        self._allowed_hours = allowed_hours.get()
        self._interval = (0.0, 0.0)  # start of the current interval: time and fraction
        self._paces: list[float] = []  # s for the whole task, at the rate of each interval

    def __call__(self, fraction: float) -> None:
        """Set the completed fraction.

        Raises
        ------
        TooLongError
            If the remaining time exceeds the allowed time at the fastest rate so far.
        """
        now, before = clock.monotonic(), self._last
        self._last = min(max(fraction, before), 1.0)  # a step may start again
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
        """Discard the rate during a pause; no time is estimated until there is more progress."""
        self._first = None
        self._paces.clear()

    def state(self) -> tuple[str, float | None, float | None]:
        """Current task, completed fraction, and estimated remaining time, s.

        Fraction and time are None if unknown. The time counts from the call with the latest fraction; tasks of unknown
        fraction may follow.
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
def progress_of(label: str, *, shown: bool, later_label: str = "") -> Iterator[Progress]:
    """Report the progress of the block on standard error if it takes more than two seconds.

    Parameters
    ----------
    label, later_label : see `Progress`.
    shown : False for no report.

    Yields
    ------
    To be called with the fraction that is done.
    """
    progress = Progress(label, later_label)
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


def _print_lines(progress: Progress, finished: threading.Event) -> None:
    interval = SHOWN_AFTER_S
    while not finished.wait(interval):
        with suppress(OSError, ValueError):  # a closed standard error is handled by the command itself
            say(f"beamsim: {progress}")
        interval = min(max(5.0, 0.1 * (clock.monotonic() - progress.begin)), 30.0)  # less often, the longer it takes


def _show_bar(progress: Progress, finished: threading.Event) -> None:
    if finished.wait(SHOWN_AFTER_S):
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
            if finished.wait(0.2):
                return


def _time_left_text(seconds: float) -> str:
    return f"about {duration(seconds)} remain" if seconds >= 1.0 else "less than 1 s remain"


def duration(seconds: float) -> str:
    """Duration in readable units.

    >>> duration(12.3), duration(600.0), duration(7200.0)
    ('12 s', '10 min', '2.0 h')
    """
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"
