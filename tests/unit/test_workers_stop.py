"""Workers of a study end when they are told to, and when their caller does."""

import os
import signal
import threading
import time

import pytest

from beamsim.analyses.parallel import processes, threads


@pytest.mark.parametrize("count", [1, 3])
def test_nothing_more_is_begun_once_the_caller_stops(count):
    begun, told = [], threading.Event()
    with threads(count, threading.Event()) as workers:
        for number, _ in enumerate(workers.completed(begun.append, range(1000), told.is_set), 1):
            if number == 2:
                told.set()
    assert 2 <= number <= 2 * count
    assert len(begun) <= 3 * count


@pytest.mark.parametrize("count", [1, 3])
def test_threads_give_everything_where_nothing_stops_them(count):
    with threads(count, threading.Event()) as workers:
        assert sorted(workers.completed(int, range(50))) == list(range(50))


def test_threads_end_with_a_caller_that_fails():
    ended = threading.Event()
    failing = threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT))
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    failing.start()
    try:
        with pytest.raises(KeyboardInterrupt), threads(2, ended) as workers:
            next(workers.completed(lambda _: ended.wait(3600.0), range(3)))
    finally:
        signal.signal(signal.SIGINT, before)


@pytest.mark.slow
def test_processes_are_ended():
    told = threading.Event()
    threading.Timer(1.0, told.set).start()
    with processes(2) as workers:
        assert not list(workers.completed(time.sleep, [3600.0] * 10, told.is_set))
