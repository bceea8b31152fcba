"""Signals while workers are under way: whatever lock the caller holds, no worker waits for it for ever."""

import signal
import subprocess
import sys

import pytest

from beamsim.analyses.deferral import signals_deferred
from beamsim.analyses.parallel import on_threads

# In a process of its own, which can be killed: what fails here waits for ever. A signal arrives when the caller has
# just taken one of the locks that it shares with the workers; once at each of them.
AT_EVERY_LOCK = """
import os, signal, threading, time
from beamsim.analyses.parallel import on_threads

enter = threading.Condition.__enter__
taken, moment = 0, 0

def signalled(self):
    global taken
    held = enter(self)
    if threading.get_ident() == threading.main_thread().ident:
        taken += 1
        if taken == moment:
            os.kill(os.getpid(), signal.SIGINT)
    return held

def slowly(item):
    time.sleep(0.002)
    return item

threading.Condition.__enter__ = signalled
signal.signal(signal.SIGINT, signal.default_int_handler)
while taken >= moment:
    taken, moment, ended, stops = 0, moment + 1, False, []
    try:
        assert sorted(on_threads(slowly, range(8), 2, lambda: stops.append(moment))) == list(range(8))
    except KeyboardInterrupt:
        ended = True
    assert ended == (taken >= moment), (moment, taken, ended)
print(moment - 1)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no process can send itself an interrupt there")
def test_a_signal_at_every_lock_of_the_caller_ends_the_threads():
    done = subprocess.run(
        [sys.executable, "-c", AT_EVERY_LOCK], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 20  # locks


@pytest.fixture
def heard():
    """Signals that have taken effect."""
    numbers = []
    before = {
        number: signal.signal(number, lambda number, _: numbers.append(number))
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    yield numbers
    for number, handler in before.items():
        signal.signal(number, handler)


def test_a_signal_waits_until_it_may_take_effect_and_a_second_one_does_not(heard):
    handlers = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    with signals_deferred() as take_effect:
        signal.raise_signal(signal.SIGTERM)
        assert heard == []
        take_effect()
        assert heard == [signal.SIGTERM]
        take_effect()
        signal.raise_signal(signal.SIGINT)
        assert heard == [signal.SIGTERM, signal.SIGINT]
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == handlers


def test_a_signal_takes_effect_at_the_end_at_the_latest(heard):
    with signals_deferred():
        signal.raise_signal(signal.SIGINT)
        assert heard == []
    assert heard == [signal.SIGINT]


def test_threads_are_told_to_stop_when_a_signal_ends_the_caller():
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    stops = []
    try:
        results = on_threads(abs, range(1000), 2, lambda: stops.append(True))
        assert next(results) >= 0
        signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            list(results)
    finally:
        signal.signal(signal.SIGINT, before)
    assert stops == [True]
