"""Workers: this process alone, processes of this machine, or a Dask cluster.

Results come in the order of completion. They do not depend on the worker, which uses one thread for linear algebra.
An item that fails for no reason of its own, or whose worker ends, is tried once more, the same way everywhere.
"""

from __future__ import annotations

import logging
import math
import os
import pickle
import platform
import signal
import threading
import time as clock
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from importlib.metadata import version
from itertools import islice
from multiprocessing import connection, current_process, get_context
from typing import Any, Generic, TypeVar

from beamsim.errors import BeamsimError, NotTrustedError, ScenarioError
from beamsim.outcomes import stop_requested
from beamsim.version import __version__, code_digest

Item = TypeVar("Item")
Result = TypeVar("Result")

_LOG = logging.getLogger(__name__)
MOST_ATTEMPTS = 2  # at an item
WORKER_DIED = f"its worker process ended in {MOST_ATTEMPTS} attempts: killed, out of memory, or crashed"
POLLED_S = 0.05  # interval at which it is asked whether to stop
ASKED_S = 0.5  # interval at which a scheduler is asked for its workers
NO_WORKERS_S = 30.0  # time without any worker after which the user is warned
WORTH_STARTING_S = 6.0  # time of the work that is left above which processes are started, each of which takes 2 to 3 s

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")


def default_workers() -> int:
    """Number of processors this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on every system
        return os.cpu_count() or 1


def most_processors(workers: int | None, scheduler: str | Cluster | None) -> int:
    """Largest number of processors that share the work; how many a cluster has is not known before the start."""
    processors = default_workers()
    return min(max(workers or processors, 1), processors) if scheduler is None else 10_000


@dataclass(frozen=True)
class Computation(Generic[Item, Result]):
    """The function that workers apply to items, and the result of an item that failed twice.

    Parameters
    ----------
    make_function : makes the function of an item; sent to other processes, each of which calls it once.
    failed : the result of an item that failed twice, given the reason.
    """

    make_function: Callable[[], Callable[[Item], Result]]
    failed: Callable[[Item, str], Result]

    def function(self) -> Callable[[Item], Result]:
        """The function of an item, which tries again once where it fails.

        Errors of beamsim itself are raised at once: they would come again.
        """
        compute = self.make_function()

        def attempted(item: Item, attempt: int = 1) -> Result:
            try:
                return compute(item)
            except BeamsimError:
                raise
            except Exception as error:
                if attempt == MOST_ATTEMPTS:
                    return self.failed(item, f"{_reason(error)} in {MOST_ATTEMPTS} attempts")
            return attempted(item, attempt + 1)

        return attempted


def _reason(error: Exception) -> str:
    """An unexpected error in one line."""
    text = " ".join(str(error).split())
    if isinstance(error, MemoryError):
        return f"not enough memory{text and f' ({text})'}"
    return f"internal error ({type(error).__name__}: {text})"


class WorkerDiedError(Exception):
    """A worker ended while it computed."""


@dataclass
class _Task(Generic[Item]):
    """An item that is sent to a worker."""

    item: Item
    attempt: int = 1
    worker: Hashable = None


class Workers(ABC):
    """Workers other than this process, each of which computes one item or several at once."""

    @abstractmethod
    def capacities(self) -> Mapping[Hashable, int]:
        """The number of items at once of every worker that is there now."""

    @abstractmethod
    def submit(self, worker: Hashable, function: Callable[[Item], Result], item: Item) -> Future[Result]:
        """Send an item to a worker."""

    @abstractmethod
    def result(self, future: Future[Result]) -> Result:
        """The result of an item that is done.

        Raises
        ------
        WorkerDiedError
            If its worker ended.
        """

    @abstractmethod
    def replace(self, worker: Hashable) -> None:
        """Start another worker in place of one that ended, where this process starts them."""

    def iterate_results(self, computation: Computation[Item, Result], items: Iterable[Item]) -> Iterator[Result]:
        """Yield the result of every item, in the order of completion.

        An item whose worker ends is sent once more, alone, to a worker that then computes nothing else: which of
        several items ended a worker is not known otherwise.

        Parameters
        ----------
        computation : of the items.
        items : to be computed; each is taken when a worker is free.

        Yields
        ------
        What the computation gives.

        Raises
        ------
        BeamsimError
            What the computation raises.
        NotTrustedError
            If there are no workers any more.
        """
        function = partial(_compute_remotely, pickle.dumps(computation))
        unsent, again = (_Task(item) for item in items), deque[_Task[Item]]()
        under_way: dict[Future[Result], _Task[Item]] = {}
        while not stop_requested():
            if not under_way and not again:  # whether anything is left does not depend on workers
                again.extend(islice(unsent, 1))
                if not again:
                    return
            capacities = self.capacities()
            for worker, capacity in capacities.items():
                busy = [task for task in under_way.values() if task.worker == worker]
                for task in _next_tasks(capacity, busy, unsent, again):
                    task.worker = worker
                    under_way[self.submit(worker, function, task.item)] = task
            ready = wait(under_way, timeout=POLLED_S, return_when=FIRST_COMPLETED).done
            if not under_way:
                clock.sleep(POLLED_S)
            gone = {future for future, task in under_way.items() if task.worker not in capacities}
            for future in ready | gone:
                task = under_way.pop(future)
                try:
                    result = self._result(future)
                except WorkerDiedError:
                    if stop_requested():  # a signal to all processes of a group, of which the workers die
                        return
                    self.replace(task.worker)
                    if task.attempt < MOST_ATTEMPTS:
                        again.append(_Task(task.item, task.attempt + 1))
                        continue
                    result = computation.failed(task.item, WORKER_DIED)
                yield result

    def _result(self, future: Future[Result]) -> Result:
        """The result of an item that is done, or whose worker is gone."""
        if not future.done():
            future.cancel()
            raise WorkerDiedError
        return self.result(future)


def _next_tasks(
    capacity: int, running: Sequence[_Task[Item]], waiting: Iterator[_Task[Item]], retries: deque[_Task[Item]]
) -> list[_Task[Item]]:
    """Tasks to send to a worker with some running tasks: one task to retry, alone, or new ones."""
    if any(task.attempt > 1 for task in running) or (retries and running):
        return []
    if retries:
        return [retries.popleft()]
    return list(islice(waiting, capacity - len(running)))


@contextmanager
def worker_pool(
    computation: Computation[Item, Result], most: int, *,
    workers: int | None = 1, scheduler: str | Cluster | None = None,
) -> Iterator[Callable[[Iterable[Item]], Iterator[Result]]]:  # fmt: skip
    """Workers for the duration of a block: this process, several others, or a cluster.

    An item that raises an unexpected error, or whose worker ends, is tried once more; then its result is that of
    ``computation.failed``.

    Parameters
    ----------
    computation : of the items.
    most : items at once; there are no more workers.
    workers : their number; one is this process. None: one for each processor, which start as soon as this process
        sees that the items will take longer than the start.
    scheduler : Dask scheduler whose workers are used instead, or its address.

    Yields
    ------
    A function of items, which yields the results in the order of completion.

    Raises
    ------
    ScenarioError
        If there are fewer workers than one; else as `processes` and `cluster_workers`.
    """
    if workers is not None and workers < 1:
        raise ScenarioError.at("workers", f"= {workers} is no number of workers", "give 1 or more, or leave it out")
    count = max(1, min(workers or default_workers(), most))
    if scheduler is None and (count == 1 or workers is None):
        with ExitStack() as started:
            yield _ThisProcess(computation, count, started).iterate_results
        return
    cluster = Cluster(scheduler) if isinstance(scheduler, str) else scheduler
    with processes(count) if cluster is None else cluster_workers(cluster) as there:
        yield partial(there.iterate_results, computation)


class _ThisProcess(Generic[Item, Result]):
    """Computes items here; where several workers are allowed, until it is worth while to start them.

    Parameters
    ----------
    computation : of the items.
    count : number of workers; with one there is only this process.
    started : takes the processes that are started, to end them.
    """

    def __init__(self, computation: Computation[Item, Result], count: int, started: ExitStack) -> None:
        self._computation, self._count, self._started = computation, count, started
        self._function = computation.function()
        self._workers: Workers | None = None
        self._done, self._spent_s = 0, 0.0

    def iterate_results(self, items: Iterable[Item]) -> Iterator[Result]:
        """Yield the result of every item, in the order of completion, until a stop is requested."""
        left = deque(items)
        while left and not stop_requested():
            if self._workers is None and self._worth_starting(len(left)):
                self._workers = self._started.enter_context(processes(self._count))
            if self._workers is not None:
                yield from self._workers.iterate_results(self._computation, left)
                return
            begin = clock.perf_counter()
            result = self._function(left.popleft())
            self._done, self._spent_s = self._done + 1, self._spent_s + clock.perf_counter() - begin
            yield result

    def _worth_starting(self, left: int) -> bool:
        """Whether so many items take longer than the start of processes, or those that are done already have."""
        if self._count == 1 or left < 2 or not self._done:
            return False
        return max(self._spent_s, self._spent_s / self._done * left) > WORTH_STARTING_S


class _WorkerFunction(threading.local):
    """The function that a worker computes by; threads of a cluster's worker have one each."""

    pickled: bytes = b""
    function: Callable[[Any], Any]


_RECEIVED = _WorkerFunction()


def _compute_remotely(pickled: bytes, item: Any) -> Any:
    """Compute an item in another process, which keeps what the function has built for other items."""
    if _RECEIVED.pickled != pickled:
        _RECEIVED.function, _RECEIVED.pickled = pickle.loads(pickled).function(), pickled
    return _RECEIVED.function(item)


# --- Processes of this machine ---------------------------------------------------------------------------------------


class _Processes(Workers):
    """Processes of this machine, each by itself: where one ends, the others go on."""

    def __init__(self, count: int, start: Callable[[], ProcessPoolExecutor], started: Any) -> None:
        self._start, self._begun = start, started
        self.pools: dict[Hashable, ProcessPoolExecutor] = {k: start() for k in range(count)}

    def capacities(self) -> Mapping[Hashable, int]:
        return dict.fromkeys(self.pools, 1)

    def submit(self, worker: Hashable, function: Callable[[Item], Result], item: Item) -> Future[Result]:
        try:
            return self.pools[worker].submit(function, item)
        except BrokenProcessPool:  # it ended while it had nothing to do
            self.replace(worker)
            return self.pools[worker].submit(function, item)

    def result(self, future: Future[Result]) -> Result:
        try:
            return future.result()
        except BrokenProcessPool:
            if self._begun.is_set():
                raise WorkerDiedError from None
            raise ScenarioError(
                "worker processes cannot start: they import the calling script, which starts workers again; put "
                'the call under `if __name__ == "__main__":`, or use workers=1'
            ) from None

    def replace(self, worker: Hashable) -> None:
        self.pools[worker].shutdown(wait=False)
        self.pools[worker] = self._start()


@contextmanager
def processes(count: int) -> Iterator[Workers]:
    """Processes of this machine, which end with the block, also amid a task.

    Parameters
    ----------
    count : how many.

    Raises
    ------
    ScenarioError
        If they cannot start because they import the calling script, which starts workers again.
    """
    context = get_context("spawn")
    begun, (theirs, ours) = context.Event(), context.Pipe(duplex=False)
    with _one_thread_each():
        team = _Processes(count, lambda: ProcessPoolExecutor(1, context, _begin_worker, (begun, theirs)), begun)
        try:
            yield team
        except RuntimeError:
            if current_process().name == "MainProcess" or begun.is_set():
                raise
            raise SystemExit(1) from None  # a worker that imports such a script; its parent says so
        finally:
            ours.close()
            for pool in team.pools.values():
                pool.shutdown(cancel_futures=True)
            theirs.close()


def _begin_worker(started: Any, caller: Any) -> None:
    """Ignore interrupts, which the caller handles, and end when it closes its side of a pipe, or ends itself."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    started.set()

    def end_with_caller() -> None:
        connection.wait([caller])
        signal.raise_signal(signal.SIGTERM)  # from this thread, also within a long computation

    threading.Thread(target=end_with_caller, daemon=True).start()


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Processes started in this context use one thread for linear algebra."""
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


# --- A Dask cluster --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Cluster:
    """A Dask scheduler, and how long to wait for workers.

    Parameters
    ----------
    address : of the scheduler, tcp://host:port.
    wait_s : longest time without any worker, s.
    notify : called with a sentence where there are no workers, or one is refused.
    """

    address: str
    wait_s: float = 600.0
    notify: Callable[[str], None] = _LOG.warning


class _ClusterWorkers(Workers):
    """The workers of a cluster that have the same versions and code as this process; they may come and go."""

    def __init__(self, client: Any, cluster: Cluster) -> None:
        self._client, self._cluster = client, cluster
        self._executors: dict[Hashable, Executor] = {}  # of the workers that are used
        self._refused: dict[Hashable, str] = {}  # why the others are not
        self._capacities: dict[Hashable, int] = {}
        self._asked = -math.inf  # when the scheduler was asked for its workers
        self._empty_since = math.nan  # when the last worker went
        self._notified = False  # that there is none

    def capacities(self) -> Mapping[Hashable, int]:
        now = clock.monotonic()
        if now - self._asked > ASKED_S:
            self._ask()
            self._asked = clock.monotonic()
            self._check_waiting(self._asked)
        return self._capacities

    def _ask(self) -> None:
        """Ask the scheduler for its workers."""
        if self._client.status != "running":
            raise NotTrustedError(_lost(self._cluster, "the scheduler has ended or cannot be reached"))
        present = self._client.nthreads()
        for known in (self._executors, self._refused):
            for address in [address for address in known if address not in present]:
                del known[address]
        for address in present:
            if address not in self._executors and address not in self._refused:
                self._admit(address)
        first = not self._capacities and math.isnan(self._empty_since)
        self._capacities = {address: present[address] for address in self._executors}
        if first and self._refused and not self._capacities:
            raise ScenarioError(f"--scheduler {self._cluster.address}: {next(iter(self._refused.values()))}")

    def _admit(self, address: str) -> None:
        """Use a worker, or refuse it because of its versions."""
        python, there = (self._answer(address, each) for each in (platform.python_version, versions))
        if isinstance(python, OSError) or isinstance(there, OSError):  # it has gone meanwhile
            return
        here = versions()
        if here == there:
            pinned = {"workers": [address], "allow_other_workers": False}
            self._executors[address] = self._client.get_executor(pure=False, **pinned)
            return
        self._refused[address] = (
            f"the worker at {address} has {_difference(there, here, python)}, this command "
            f"{_difference(here, there, platform.python_version())}; start it again, from an environment with the same "
            "versions and code"
        )
        self._cluster.notify(f"{self._refused[address]}; it gets no cases")

    def _answer(self, address: str, function: Callable[[], Any]) -> Any:
        """What a function gives on a worker, or the error that it raises there."""
        return self._client.run(function, workers=[address], on_error="return").get(address, OSError())

    def _check_waiting(self, now: float) -> None:
        """Say that there are no workers, or end, where that has lasted long enough."""
        if self._capacities:
            self._empty_since, self._notified = math.nan, False
            return
        if math.isnan(self._empty_since):
            self._empty_since = now
        address, waited, longest = self._cluster.address, now - self._empty_since, self._cluster.wait_s
        remedy = f"start some with `dask worker {address}`"
        if waited >= longest:
            raise NotTrustedError(
                f"the cluster at {address} has had no workers for {longest:g} s; {remedy} and continue with --resume, "
                "or wait longer with --wait-for-workers"
            )
        if waited >= NO_WORKERS_S and not self._notified:
            self._notified = True
            self._cluster.notify(
                f"the cluster at {address} has had no workers for {NO_WORKERS_S:g} s; waiting for up to {longest:g} s "
                f"(--wait-for-workers); {remedy}"
            )

    def submit(self, worker: Hashable, function: Callable[[Item], Result], item: Item) -> Future[Result]:
        return self._executors[worker].submit(function, item)

    def result(self, future: Future[Result]) -> Result:
        try:
            return future.result()
        except CancelledError as error:
            raise NotTrustedError(_lost(self._cluster, "the scheduler has ended or cannot be reached")) from error
        except Exception as error:
            if type(error).__name__ == "KilledWorker":
                raise WorkerDiedError from None
            raise

    def replace(self, worker: Hashable) -> None:
        """The cluster does so, or whoever started its workers."""


def versions() -> dict[str, str]:
    """What must be the same where a study is computed: versions of packages and of Python, and the code of beamsim."""
    packages = {name: version(name) for name in ("numpy", "scipy", "numba")}
    return {"beamsim": __version__, "Python": _minor(platform.python_version())} | packages | {"code": code_digest()}


def _minor(python: object) -> str:
    return ".".join(str(python).split(".")[:2])


def _difference(own_versions: Any, other_versions: Any, python: object) -> str:
    """Versions of one side as text: of beamsim and Python, and what else differs from the other side.

    Parameters
    ----------
    own_versions, other_versions : of `versions`, or the error that a side gave.
    python : version of Python of the side.
    """
    if not isinstance(own_versions, dict):
        return f"no usable beamsim ({own_versions}) with Python {_minor(python)}"
    others = other_versions if isinstance(other_versions, dict) else own_versions
    names = [
        name for name in own_versions if name not in ("beamsim", "Python") and own_versions[name] != others.get(name)
    ]
    return f"beamsim {own_versions['beamsim']} with Python {own_versions['Python']}" + "".join(
        f", {name} {own_versions[name]}" for name in names
    )


def _lost(cluster: Cluster, reason: object) -> str:
    return f"lost the connection to the cluster at {cluster.address} ({reason}); continue with --resume"


@contextmanager
def _without_tracebacks(*names: str) -> Iterator[None]:
    """Log nothing of the loss of a connection, which becomes an error of one line."""
    logs = [logging.getLogger(name) for name in names]
    levels = [log.level for log in logs]
    try:
        for log in logs:
            log.setLevel(logging.CRITICAL)
        yield
    finally:
        for log, level in zip(logs, levels, strict=True):
            log.setLevel(level)


@contextmanager
def cluster_workers(cluster: Cluster) -> Iterator[Workers]:
    """The workers of a Dask scheduler.

    Raises
    ------
    ScenarioError
        If Dask is not installed, there is no scheduler at the address, or its workers have other versions.
    NotTrustedError
        If the connection to the scheduler is lost, or no worker comes in time.
    """
    try:
        distributed: Any = import_module("distributed")
    except ImportError:
        raise ScenarioError(
            "--scheduler needs Dask distributed, which is not installed; pip install 'beamsim[cluster]'"
        ) from None
    with _without_tracebacks("distributed", "distributed.client", "tornado.application"):
        client = _client(distributed, cluster)
        try:
            yield _ClusterWorkers(client, cluster)
        except (BeamsimError, GeneratorExit):
            raise
        except (OSError, TimeoutError, CancelledError) as error:
            raise NotTrustedError(_lost(cluster, error or type(error).__name__)) from None
        except Exception as error:
            if type(error).__module__.split(".")[0] != "distributed":
                raise
            raise NotTrustedError(_lost(cluster, type(error).__name__)) from None
        finally:
            client.close(timeout=5)


def _client(distributed: Any, cluster: Cluster) -> Any:
    """A connection to a scheduler.

    Raises
    ------
    ScenarioError
        If there is none at the address.
    """
    try:
        return distributed.Client(cluster.address, timeout=10, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise ScenarioError(
            f"--scheduler {cluster.address}: no scheduler answers ({reason}); start one with `dask scheduler`"
        ) from None
