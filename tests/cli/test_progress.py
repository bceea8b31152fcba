"""What commands say of their progress on standard error: lines where it is redirected, a bar on a terminal."""

import io
import threading
from types import SimpleNamespace

import pytest

from beamsim.cli import session as module
from beamsim.cli.session import Progress, duration, progress_of
from beamsim.errors import TooLongError, allowing_hours

pytestmark = pytest.mark.quick


@pytest.fixture
def at(monkeypatch):
    """Sets the clock of the progress."""
    now = SimpleNamespace(value=100.0)
    monkeypatch.setattr(module, "clock", SimpleNamespace(monotonic=lambda: now.value))

    def set_to(seconds):
        now.value = 100.0 + seconds

    return set_to


@pytest.fixture
def lines(monkeypatch):
    """The lines that are printed, with no time between them; waits for one."""
    printed, arrived = [], threading.Event()

    def say(text):
        printed.append(text)
        arrived.set()

    monkeypatch.setattr(module, "say", say)
    monkeypatch.setattr(module, "SHOWN_AFTER_S", 0.0)
    return SimpleNamespace(printed=printed, wait=lambda: arrived.wait(60.0))


def test_share_and_time_left(at):
    progress = Progress("sweeping")
    assert str(progress) == "sweeping, 0 s so far"
    progress(0.0)
    at(30.0)
    assert str(progress) == "sweeping: 0 % done, 30 s so far"  # how long the rest takes is not known yet
    progress(0.25)
    assert str(progress) == "sweeping: 25 % done, about 2 min remain"


def test_what_an_earlier_run_did_does_not_count_as_fast(at):
    """Of a study resumed at a half, a quarter in 10 s: the last quarter takes 10 s."""
    progress = Progress("100 cases")
    progress(0.5)
    at(10.0)
    progress(0.75)
    assert str(progress) == "100 cases: 75 % done, about 10 s remain"


def steps(progress, at, share, count):
    for second in range(count):
        at(2.0 * second)
        progress(share * second)


def test_what_takes_too_long_is_refused_after_seconds(at):
    """A millionth in 2 s is the whole in 556 h."""
    refused = r"simulating: the rest would take about 556 h, more than the 500 h .* --allow-hours 2000"
    with allowing_hours(500.0), pytest.raises(TooLongError, match=refused) as raised:
        steps(Progress("simulating"), at, 1e-6, 10)
    assert raised.value.exit_code == 2
    with allowing_hours(600.0):
        steps(Progress("simulating"), at, 1e-6, 100)


def test_a_slow_beginning_is_no_reason_to_refuse(at):
    """Kernels are compiled in the first case: the fastest of the seconds after it counts."""
    with allowing_hours(1.0):
        progress = Progress("cases")
        progress(0.0)
        at(30.0)
        progress(1e-5)
        for second in range(10):
            at(32.0 + 2.0 * second)
            progress(1e-5 + (second + 1) * 1e-3)


def test_what_follows_the_last_step_has_its_own_name(at):
    progress = Progress("simulating case.yaml", "evaluating the motion of case.yaml")
    assert str(progress) == "simulating case.yaml, 0 s so far"
    progress(1.0)
    at(4.0)
    assert str(progress) == "evaluating the motion of case.yaml, 4 s so far"


@pytest.mark.parametrize(("seconds", "text"), [(3.2, "3 s"), (600.0, "10 min"), (9000.0, "2.5 h")])
def test_duration(seconds, text):
    assert duration(seconds) == text


def test_lines_where_standard_error_is_redirected(lines):
    with progress_of("sweeping", shown=True) as progress:
        progress(0.5)
        assert lines.wait()
    assert lines.printed[0].startswith("beamsim: sweeping")
    count = threading.active_count()
    with progress_of("sweeping", shown=True):
        assert threading.active_count() == count + 1
    assert threading.active_count() == count  # nothing goes on afterwards


def test_nothing_when_it_is_quick_or_not_asked_for(lines, monkeypatch):
    with progress_of("sweeping", shown=False) as progress:
        progress(0.5)
    monkeypatch.setattr(module, "SHOWN_AFTER_S", 1e6)
    with progress_of("sweeping", shown=True) as progress:
        progress(0.5)
    assert lines.printed == []


def test_bar_on_a_terminal(monkeypatch):
    drawn = threading.Event()

    class Terminal(io.StringIO):
        def isatty(self):
            return True

        def write(self, text):
            if "sweeping" in text:
                drawn.set()
            return super().write(text)

    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    monkeypatch.setattr(module, "SHOWN_AFTER_S", 0.0)
    monkeypatch.setenv("TERM", "xterm")
    with progress_of("sweeping", shown=True) as progress:
        progress(0.25)
        assert drawn.wait(60.0)
    assert "sweeping" in terminal.getvalue()


def test_closed_standard_error_does_not_end_the_command(monkeypatch):
    tried = threading.Event()

    def refused(_):
        tried.set()
        raise BrokenPipeError

    monkeypatch.setattr(module, "say", refused)
    monkeypatch.setattr(module, "SHOWN_AFTER_S", 0.0)
    with progress_of("sweeping", shown=True) as progress:
        progress(0.25)
        assert tried.wait(60.0)
