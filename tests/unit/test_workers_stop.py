"""Workers of a study end when they are told to, and when their caller does."""

import os
import signal
import threading
import time

import pytest

from beamsim.analyses.parallel import on_this_machine, on_threads


def until_told(item, stop):
    """Work without an end."""
    while not stop():
        time.sleep(0.001)
    return item


def at_once(item, stop):
    return item


@pytest.mark.parametrize("workers", [1, 3])
def test_threads_end_when_they_are_told_to(workers):
    begun = threading.active_count()
    told = threading.Event()
    threading.Timer(0.1, told.set).start()
    given = list(on_threads(until_told, range(1000), workers, told.is_set))
    assert len(given) <= 4 * workers  # of what was under way and queued
    deadline = time.monotonic() + 60.0
    while threading.active_count() > begun and time.monotonic() < deadline:
        time.sleep(0.01)
    assert threading.active_count() <= begun


@pytest.mark.parametrize("workers", [1, 3])
def test_threads_give_everything_where_nothing_stops_them(workers):
    assert sorted(on_threads(at_once, range(50), workers)) == list(range(50))


@pytest.mark.parametrize("workers", [1, 3])
def test_nothing_more_is_begun_once_the_caller_stops(workers):
    begun, told = [], threading.Event()

    def counted(item, stop):
        begun.append(item)
        return item

    for number, _ in enumerate(on_threads(counted, range(1000), workers, told.is_set)):
        if number == 1:
            told.set()
    assert 1 <= number <= 1 + 3 * workers
    assert len(begun) < 100


def test_threads_end_with_a_caller_that_fails():
    results = on_threads(until_told, range(3), 2)
    failing = threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT))
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    failing.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            next(results)
    finally:
        signal.signal(signal.SIGINT, before)


def forever(item):
    time.sleep(3600.0)


def nothing(item):
    pass


@pytest.mark.slow
def test_processes_are_ended():
    told = threading.Event()
    threading.Timer(1.0, told.set).start()
    assert not list(on_this_machine(forever, range(10), 2, nothing, told.is_set))
