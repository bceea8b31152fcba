"""How far a command is, on standard error: a bar on terminals, elsewhere a line every few seconds."""

from __future__ import annotations

import sys
import threading
import time as clock
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from beamsim.cli.failures import say
from beamsim.errors import TooLongError, allowed_hours, visible

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
        self._begin = clock.monotonic()
        self._first: tuple[float, float] | None = None  # time and fraction of the first call: what was resumed is known
        self._last = 0.0
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
        now, self._last = clock.monotonic(), min(max(fraction, 0.0), 1.0)
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

    @property
    def label(self) -> str:
        """What is being done."""
        return self._label if self._first is None or self.fraction is not None else self._afterwards

    @property
    def fraction(self) -> float | None:
        """Fraction that is done; None where it is not known."""
        return self._last if self._first is not None and self._last < 1.0 else None

    @property
    def elapsed(self) -> float:
        """Time since the beginning, s."""
        return clock.monotonic() - self._begin

    def remaining(self) -> float | None:
        """Time left, s, if it goes on as before; None where that is not known."""
        if self.fraction is None or self._first is None:
            return None
        since, begin = self._first
        gained = self._last - begin
        return None if gained <= 0.0 else (clock.monotonic() - since) * (1.0 - self._last) / gained

    def __str__(self) -> str:
        label = self.label
        if self.fraction is None:
            return f"{label}, {duration(self.elapsed)} so far"
        remaining = self.remaining()
        left = f"{duration(self.elapsed)} so far" if remaining is None else f"{_about(remaining)} remain"
        return f"{label}: {100.0 * self.fraction:.0f} % done, {left}"


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
        interval = min(max(5.0, 0.1 * progress.elapsed), 30.0)  # rarer the longer it takes


def _show_bar(progress: Progress, ended: threading.Event) -> None:
    if ended.wait(SHOWN_AFTER_S):
        return
    from rich.console import Console
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    label, left = TextColumn("{task.description}", markup=False), TextColumn("{task.fields[left]}")
    columns = (label, BarColumn(), TaskProgressColumn(), TimeElapsedColumn(), left)
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(progress.label, total=None, left="")
        while True:
            fraction, remaining = progress.fraction, progress.remaining()
            bar.update(
                task,
                description=progress.label,
                total=None if fraction is None else 1.0,
                completed=fraction or 0.0,
                left="" if remaining is None else f"{_about(remaining)} remain",
            )
            if ended.wait(0.2):
                return


def _about(seconds: float) -> str:
    return f"about {duration(seconds)}" if seconds >= 1.0 else "less than 1 s"


def duration(seconds: float) -> str:
    """A time as people say it.

    >>> duration(12.3), duration(600.0), duration(7200.0)
    ('12 s', '10 min', '2.0 h')
    """
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"
