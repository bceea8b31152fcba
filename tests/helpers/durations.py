"""Which tests are slow: those that took more than a second of processor time when their durations were recorded.

``pytest --record-durations FILE`` writes what the tests took, with the record of those that did not run. Given the file
of this repository, ``tests/data/durations.csv``, it updates the record. The compilation of kernels is not counted.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Generator
from pathlib import Path

import pytest

from beamsim.flow.compiled import processor_time

RECORD = Path(__file__).parents[1] / "data" / "durations.csv"
SLOW_S = 1.0
LISTED_S = 0.5
"""Shorter tests are not listed: what they take hardly matters, and the record stays short."""
NOISE = 3.0
"""A busy machine takes up to so many times the processor time of a quiet one: new tests are named only above this."""
PROPERTY = "processor_time_s"

Durations = dict[str, float]
"""Seconds of processor time by the name of the test."""


def recorded(path: Path | None = None) -> Durations:
    """The durations in a record, by default that of the repository; empty if there is none yet."""
    path = path or RECORD
    if not path.exists():
        return {}
    with path.open(encoding="utf-8", newline="") as file:
        return {row["test"]: float(row["seconds"]) for row in csv.DictReader(file)}


def updated(record: Durations, measured: Durations) -> Durations:
    """The record with what was measured, in the order of the names, without tests that take little."""
    return {name: seconds for name, seconds in sorted((record | measured).items()) if seconds >= LISTED_S}


def write(path: Path, durations: Durations) -> None:
    """Write a record."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", encoding="utf-8", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["seconds", "test"])
        rows.writerows([f"{seconds:.2g}", name] for name, seconds in durations.items())


def slow_and_unrecorded(record: Durations, measured: Durations) -> list[str]:
    """Tests that are slow beyond any noise and are not recorded as slow, the slowest first."""
    found = {name for name, seconds in measured.items() if seconds > NOISE * SLOW_S and record.get(name, 0) <= SLOW_S}
    return sorted(found, key=lambda name: -measured[name])


REUSED_S: list[float] = []
"""What commands took that an earlier test executed, as a test counts them that reads what came of them."""


def spent() -> float:
    """Seconds of processor time of this process, compilation apart, and of the children that have ended."""
    times = os.times()
    return processor_time() + times.children_user + times.children_system


class DurationRecorder:
    """Measures each test where it runs, and collects what all workers measured."""

    def __init__(self, path: Path | None) -> None:
        self.path = path  # of the new record; None: measure only, in a worker
        self.measured: Durations = {}
        self._begin = 0.0

    def pytest_runtest_logstart(self) -> None:
        """Begin to measure."""
        self._begin = spent() + sum(REUSED_S)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(
        self, item: pytest.Item, call: pytest.CallInfo[None]
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Write into the last report of a test what it takes alone, its fixtures included."""
        if call.when == "teardown":
            item.user_properties.append((PROPERTY, spent() + sum(REUSED_S) - self._begin))
        return (yield)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Collect what a test took."""
        if report.when == "teardown":
            self.measured[report.nodeid] = dict(report.user_properties)[PROPERTY]

    def pytest_sessionfinish(self) -> None:
        """Write the new record."""
        if self.path is not None:
            write(self.path, updated(recorded(), self.measured))

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Print the processor time of all tests, and the tests that are slow and are not recorded as such."""
        total, count = sum(self.measured.values()), len(self.measured)
        terminalreporter.write_line(f"{count} tests took {total:.0f} s of processor time; record in {self.path}")
        for name in slow_and_unrecorded(recorded(), self.measured):
            terminalreporter.write_line(
                f"SLOW {name} took {self.measured[name]:.1f} s and is not recorded as slow; "
                f"record it: pytest --record-durations {os.path.relpath(RECORD)} '{name}'"
            )


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option that records durations."""
    parser.addoption(
        "--record-durations", metavar="FILE", type=Path, help="write the processor time of the tests to FILE"
    )


def configure(config: pytest.Config) -> None:
    """Measure where durations are recorded: in the workers, or in the one process that there is."""
    path = config.getoption("--record-durations")
    if path is not None:
        worker = hasattr(config, "workerinput")
        config.pluginmanager.register(DurationRecorder(None if worker else path), "durations")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests that are recorded as slow, before `-m` chooses."""
    record = recorded()
    for item in items:
        if record.get(item.nodeid, 0.0) > SLOW_S:
            item.add_marker(pytest.mark.slow)
