"""Signals in blocks: while workers are under way, in blocks within blocks, in programs with handlers of their own."""

import signal
import subprocess
import sys
import threading
from contextlib import ExitStack, contextmanager

import pytest

from beamsim.analyses.parallel import on_threads
from beamsim.interrupts import NUMBERS, deferred, handled, kept

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
    with deferred() as take_effect:
        signal.raise_signal(signal.SIGTERM)
        assert heard == []
        take_effect()
        assert heard == [signal.SIGTERM]
        take_effect()
        signal.raise_signal(signal.SIGINT)
        assert heard == [signal.SIGTERM, signal.SIGINT]
    assert heard == [signal.SIGTERM, signal.SIGINT]
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == handlers


@pytest.mark.parametrize("failing", [False, True])
def test_a_signal_takes_effect_at_the_end_at_the_latest(failing, heard):
    with pytest.raises(ZeroDivisionError) if failing else ExitStack(), deferred():
        signal.raise_signal(signal.SIGINT)
        assert heard == []
        if failing:
            raise ZeroDivisionError
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


# --- whose handlers ---------------------------------------------------------------------------------------------------


def handlers():
    return [signal.getsignal(number) for number in NUMBERS]


@contextmanager
def noting(notes, name):
    """A block that notes its signals and passes them on."""

    def note(block, number, frame):
        notes.append(name)
        block.pass_on(number, frame)

    with handled(note):
        yield


def test_blocks_end_in_any_order(heard):
    """As those of generators that are dropped before they are exhausted."""
    before, notes = handlers(), []
    outer, middle, inner = ExitStack(), ExitStack(), ExitStack()
    for stack, name in ((outer, "outer"), (middle, "middle"), (inner, "inner")):
        stack.enter_context(noting(notes, name))
    for ended, left in ((middle, ["inner", "outer"]), (outer, ["inner"])):
        ended.close()
        signal.raise_signal(signal.SIGINT)
        assert notes == left
        notes.clear()
    inner.close()
    assert handlers() == before
    assert heard == [signal.SIGINT] * 2


def test_a_handler_that_the_block_sets_is_left_to_it(heard):
    notes = []
    own = lambda number, frame: notes.append("own")  # noqa: E731
    before = handlers()
    with noting(notes, "outer"):
        signal.signal(signal.SIGINT, own)
        with noting(notes, "inner"):
            signal.raise_signal(signal.SIGINT)
        assert signal.getsignal(signal.SIGINT) is own
    assert notes == ["inner", "own"]
    assert handlers() == [own, before[1]]


def test_a_handler_that_chooses_its_successor_is_not_overruled(heard):
    """Programs that end at once at the second signal set another handler at the first one."""
    notes = []

    def first(number, frame):
        signal.signal(number, signal.default_int_handler)

    signal.signal(signal.SIGINT, first)
    with noting(notes, "outer"), noting(notes, "inner"):
        signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert notes == ["inner", "outer"] * 2
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.parametrize("moment", [1, 2, 3, 4])
def test_a_signal_while_handlers_are_set_or_taken_back_leaves_none_behind(moment, heard, monkeypatch):
    """Before `signal.signal` sets a handler it runs those of the signals that have arrived."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    before, calls = handlers(), []
    real = signal.signal

    def arriving(number, handler):
        calls.append(number)
        if len(calls) == moment:
            signal.raise_signal(signal.SIGINT)
        return real(number, handler)

    monkeypatch.setattr(signal, "signal", arriving)
    with pytest.raises(KeyboardInterrupt), noting([], "block"):
        pass
    assert handlers() == before


def test_what_is_raised_in_a_frame_that_loses_it_is_kept(heard):
    signal.signal(signal.SIGINT, signal.default_int_handler)
    raised, losing = [], True
    with kept(raised.append, lambda frame: losing):
        signal.raise_signal(signal.SIGINT)
        losing = False
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert [type(error) for error in raised] == [KeyboardInterrupt] * 2


def test_other_threads_set_no_handlers(heard):
    before, within = handlers(), []

    def work():
        with deferred() as take_effect, kept(within.append, bool):
            within.extend(handlers())
            take_effect()

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert within == before
