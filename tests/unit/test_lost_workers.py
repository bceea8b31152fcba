"""Cases that fail, and workers that end: tried once more, then recorded; the other cases go on."""

import os
import signal

import pytest

from beamsim.errors import ScenarioError
from beamsim.parallel import Computation, worker_pool


class Failing:
    """Makes a function that squares numbers, counts its calls in a folder, and fails for one number."""

    def __init__(self, folder, how, times=100):
        self.folder, self.how, self.times = folder, how, times

    def __call__(self):
        return self.square

    def square(self, number):
        attempts = len(list(self.folder.glob(f"{number}_*"))) + 1
        (self.folder / f"{number}_{attempts}").touch()
        if number == 3 and attempts <= self.times:
            self.how()
        return number**2


def end():
    os._exit(1)


def kill():
    os.kill(os.getpid(), getattr(signal, "SIGKILL", signal.SIGTERM))


def need_memory():
    raise MemoryError("Unable to allocate 9 TiB")


def divide():
    return 1 / 0


def failed(number, reason):
    return number, reason


DEATH = "its worker process ended in 2 attempts: killed, out of memory, or crashed"
ERRORS = {
    need_memory: "not enough memory (Unable to allocate 9 TiB) in 2 attempts",
    divide: "internal error (ZeroDivisionError: division by zero) in 2 attempts",
}
WAYS = [
    (1, need_memory, ERRORS[need_memory]), (1, divide, ERRORS[divide]), (2, divide, ERRORS[divide]), (2, kill, DEATH),
]  # fmt: skip


def results(folder, how, times=100, **who):
    with worker_pool(Computation(Failing(folder, how, times), failed), 20, **who) as solved:
        found = list(solved(range(20)))
    recorded = [each for each in found if isinstance(each, tuple)]
    assert sorted(each for each in found if each not in recorded) == [
        number**2 for number in range(20) if number not in dict(recorded)
    ]
    return recorded


@pytest.mark.parametrize(("workers", "how", "text"), WAYS)
def test_a_case_that_fails_is_tried_once_more_and_recorded(workers, how, text, tmp_path):
    assert results(tmp_path, how, workers=workers) == [(3, text)]
    assert len(list(tmp_path.glob("3_*"))) == 2
    assert len(list(tmp_path.glob("4_*"))) == 1  # no other case is solved twice


@pytest.mark.parametrize(("workers", "how"), [(1, divide), (2, divide), (2, end)])
def test_a_case_that_fails_once_has_its_result(workers, how, tmp_path):
    assert results(tmp_path, how, times=1, workers=workers) == []


def refuse():
    raise ScenarioError("this is not possible")


@pytest.mark.parametrize("workers", [1, 2])
def test_a_refusal_ends_it_at_once(workers, tmp_path):
    with pytest.raises(ScenarioError, match="this is not possible"):
        results(tmp_path, refuse, workers=workers)
    assert len(list(tmp_path.glob("3_*"))) == 1


# --- A Dask cluster --------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def scheduler():
    """Address of a cluster of two processes; each solves two cases at once, and both are lost with it."""
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=2, processes=True, dashboard_address=":0", host="127.0.0.1"
    ) as cluster:
        yield cluster.scheduler_address


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("how", [*ERRORS, end, kill])
def test_a_cluster_does_the_same(how, scheduler, tmp_path):
    assert results(tmp_path, how, scheduler=scheduler) == [(3, ERRORS.get(how, DEATH))]
