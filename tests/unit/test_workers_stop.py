"""Workers of a study end when they are told to, and when their caller does."""

import math
import os
import signal
import threading
import time

import pytest

from beamsim.outcomes import stop_requests
from beamsim.parallel import Computation, processes, worker_pool


class Noting:
    """Makes a function that notes in a folder which numbers were begun, and squares them; some take long."""

    def __init__(self, folder, long=math.inf):
        self.folder, self.long = folder, long

    def __call__(self):
        return self.square

    def square(self, number):
        (self.folder / str(number)).touch()
        time.sleep(3600.0 if number >= self.long else 0.0)
        return number**2


def failed(number, reason):
    pytest.fail(reason)


def sleeping():
    return time.sleep


@pytest.mark.parametrize("count", [1, 2])
def test_nothing_more_is_begun_once_the_caller_stops(count, tmp_path):
    told = threading.Event()
    with (
        stop_requests(told.is_set),
        worker_pool(Computation(Noting(tmp_path), failed), 1000, workers=count) as solved,
    ):
        for number, _ in enumerate(solved(range(1000)), 1):
            if number == 2:
                told.set()
    assert 2 <= number <= 2 * count
    assert len(os.listdir(tmp_path)) <= 3 * count


@pytest.mark.parametrize("count", [1, 2])
def test_workers_give_everything_where_nothing_stops_them(count, tmp_path):
    with worker_pool(Computation(Noting(tmp_path), failed), 50, workers=count) as solved:
        assert sorted(solved(range(50))) == [number**2 for number in range(50)]


class NamingProcess:
    """Makes a function that gives the process it is called in."""

    def __call__(self):
        return lambda number: (number, os.getpid())


@pytest.mark.parametrize(("worth", "here"), [(0.0, 1), (math.inf, 9)])
def test_processes_start_where_the_work_that_is_left_takes_longer_than_their_start(worth, here, monkeypatch):
    """As the first item shows, which this process computes; they stay for further items."""
    monkeypatch.setattr("beamsim.parallel.WORTH_STARTING_S", worth)
    monkeypatch.setattr("beamsim.parallel.default_workers", lambda: 2)
    with worker_pool(Computation(NamingProcess(), failed), 9, workers=None) as solved:
        found = [*solved(range(6)), *solved(range(6, 9))]
    assert sorted(number for number, _ in found) == list(range(9))
    assert sum(process == os.getpid() for _, process in found) == here


def test_processes_end_with_a_caller_that_fails(tmp_path, heeded):
    def interrupt():
        while not (tmp_path / "1").exists():
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=interrupt).start()
    with (
        pytest.raises(KeyboardInterrupt),
        worker_pool(Computation(Noting(tmp_path, long=1), failed), 3, workers=2) as solved,
    ):
        list(solved(range(3)))


def test_processes_are_ended():
    told = threading.Event()
    threading.Timer(1.0, told.set).start()
    with processes(2) as workers, stop_requests(told.is_set):
        assert not list(workers.iterate_results(Computation(sleeping, failed), [3600.0] * 10))
