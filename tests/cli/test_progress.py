"""What commands say of their progress on standard error: lines where it is redirected, a bar on a terminal."""

import io
import threading
from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

import beamsim
from beamsim.cli import command
from beamsim.cli import session as module
from beamsim.cli.session import Progress, duration, progress_of
from beamsim.errors import TooLongError, allowing_hours
from beamsim.responses import histories
from beamsim.scenario import load_scenario
from tests.helpers.commands import invoke

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


def test_the_time_left_passes_while_nothing_is_reported(at):
    """A quarter in 30 s leaves 90 s; 60 s later 30 s are left, and later it is not known."""
    progress = Progress("sweeping")
    progress(0.0)
    at(30.0)
    progress(0.25)
    at(90.0)
    progress(0.25)
    assert str(progress) == "sweeping: 25 % done, about 30 s remain"
    at(130.0)
    assert str(progress) == "sweeping: 25 % done, 2 min so far"


SWEPT = """
chain: {masses: [1 kg], springs: [1 kN/m]}
snubbers: [{name: stop, mass: 1, side: below, gap: 1 mm, stiffness: 1e5}]
excitation: {kind: swept_sine, applied_to: base, from: 4 Hz, to: 40 Hz, rate: 60 oct/min, level: 2}
run: {duration: 2 s, sample_rate: 1 kHz}
"""


def test_a_swept_sine_has_its_cycles_in_the_label(monkeypatch, tmp_path):
    """From 4 Hz at an octave a second: 4 (2^2 - 1) / ln 2 = 17.3 cycles in 2 s."""
    labels, shares = [], []

    @contextmanager
    def recorded(label, **_):
        labels.append(label)
        yield shares.append

    monkeypatch.setattr(command, "progress_of", recorded)
    (tmp_path / "case.yaml").write_text(SWEPT)
    done = invoke("run", tmp_path / "case.yaml", "--no-plots", "-o", tmp_path / "case.h5")
    assert done.exit_code == 0, done.output
    assert labels[0] == "simulating case.yaml (17 cycles)"
    assert "60 oct/min, 17 cycles" in done.output
    assert shares == sorted(shares)
    assert shares[-1] == 1.0  # of the finer model, too
    assert any(0.0 < share < 1.0 for share in shares)


BEAM = """
beam: {length: 200 mm, width: 20 mm, thickness: 3 mm, youngs_modulus: 70 GPa, density: 2700 kg/m^3, elements: 6,
  supports: {left: clamped, right: free}, damping: {kind: modal, ratio: 0.02}}
reduction: {modes: 2}
snubbers: [{name: stop, position: 200 mm, side: below, gap: 0.2 mm, stiffness: 1e4}]
probes: [{name: tip, position: 200 mm}]
"""
INPUTS = {
    "swept sine": "excitation: {kind: swept_sine, applied_to: base, from: 20 Hz, to: 60 Hz, "
    "rate: 20 oct/min, level: 5}\n"
    "run: {duration: 2 s, sample_rate: 5 kHz}\n",
    "random": "excitation: {kind: random, applied_to: base, seed: 3, "
    "psd: [{frequency: 20 Hz, density: 1}, {frequency: 100 Hz, density: 1}]}\n"
    "run: {duration: 2 s, sample_rate: 5 kHz, spectrum: {last: 1 s}}\n",
}


@pytest.mark.parametrize("kind", INPUTS)
def test_evaluation_and_finer_model_report_what_is_done(kind, monkeypatch):
    """With samples in blocks, as of a long run: of a swept sine nothing was reported over 38 %, then over 60 %."""
    monkeypatch.setattr(histories, "VALUES_AT_ONCE", 2**16)
    shares = []
    result = beamsim.run(load_scenario(yaml.safe_load(BEAM + INPUTS[kind])), progress=shares.append)
    assert result.summary["convergence"]["peak_displacement_m"]["tip"] > 0.0
    assert shares[-1] == 1.0
    assert shares == sorted(shares)
    assert np.diff([0.0, *shares]).max() < 0.3
    assert len(shares) > 8


@pytest.mark.parametrize(("rate", "cycles"), [("60 oct/min", 4 * 3 / np.log(2)), ("6 Hz/s", 4 * 2 + 0.5 * 6 * 4)])
def test_cycles_of_a_part_of_a_sweep(rate, cycles, tmp_path):
    """The integral of the frequency, up and down."""
    data = yaml.safe_load(SWEPT)
    data["excitation"]["rate"] = rate
    assert load_scenario(data).excitation.cycles_in(2.0) == pytest.approx(cycles, rel=1e-12)
    end = 16.0
    data["excitation"] |= {"from": end, "to": 2.0}
    down = 2 * end - 12.0 if "Hz/s" in rate else end * (1 - 0.25) / np.log(2)
    assert load_scenario(data).excitation.cycles_in(2.0) == pytest.approx(down, rel=1e-12)


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
