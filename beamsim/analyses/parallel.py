"""Workers: this process alone, processes of this machine, or a Dask cluster.

Results come in the order of completion. They do not depend on the worker, which uses one thread for linear algebra.
"""

from __future__ import annotations

import os
import pickle
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from itertools import islice, takewhile
from multiprocessing import connection, current_process, get_context
from typing import Any, TypeVar

from beamsim.errors import NotTrustedError, ScenarioError
from beamsim.outcomes import Stop, never

Item = TypeVar("Item")
Result = TypeVar("Result")

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")


def default_workers() -> int:
    """Number of processors this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on every system
        return os.cpu_count() or 1


@dataclass(frozen=True)
class Workers:
    """An executor, and how many tasks it computes side by side."""

    pool: Executor
    count: int

    def completed(
        self, function: Callable[[Item], Result], items: Iterable[Item], stop: Stop = never
    ) -> Iterator[Result]:
        """Yield ``function(item)`` for every item, in the order of completion.

        Parameters
        ----------
        function : of an item.
        items : to be computed; each is taken when a worker is free.
        stop : asked whether to end; what is under way is then not yielded.

        Yields
        ------
        What the function returns.

        Raises
        ------
        Exception
            What the function raises.
        BrokenExecutor
            If a worker ends unexpectedly.
        """
        tasks = (self.pool.submit(function, item) for item in items)
        under_way: set[Future[Result]] = set()
        while not stop():
            under_way.update(islice(tasks, self.count - len(under_way)))
            if not under_way:
                return
            ready, under_way = wait(under_way, timeout=0.05, return_when=FIRST_COMPLETED)  # s, to ask again
            yield from (future.result() for future in ready)


@contextmanager
def working(
    make: Callable[[Stop], Callable[[Item], Result]], most: int, stop: Stop = never, *,
    workers: int = 1, scheduler: str | None = None,
) -> Iterator[Callable[[Iterable[Item]], Iterator[Result]]]:  # fmt: skip
    """Who computes items for all of a block: this process, several others, or a cluster.

    Parameters
    ----------
    make : of what says whether to end, the function of an item; sent to other processes, each of which calls it once.
    most : items at once; there are no more workers.
    stop : asked whether to end; what other processes are computing is then not yielded.
    workers : their number; one is this process.
    scheduler : address of a Dask scheduler whose workers are used instead.

    Yields
    ------
    A function of items, which yields the results in the order of completion.

    Raises
    ------
    ScenarioError
        If there are fewer workers than one; else as `processes` and `cluster`.
    """
    if workers < 1:
        raise ScenarioError.at("workers", f"= {workers} is no number of workers", "give 1 or more, or leave it out")
    count = max(1, min(workers, most))
    if scheduler is None and count == 1:
        function = make(stop)
        yield lambda items: map(function, takewhile(lambda _: not stop(), items))
    else:
        with processes(count, stop) if scheduler is None else cluster(scheduler) as pool:
            yield partial(pool.completed, partial(_there, pickle.dumps(make)), stop=stop)


class _Received(threading.local):
    """The function that a worker computes by; threads of a cluster's worker have one each."""

    sent: bytes = b""
    function: Callable[[Any], Any]


_RECEIVED = _Received()


def _there(sent: bytes, item: Any) -> Any:
    """Compute an item in another process, which keeps what the function has built for other items."""
    if _RECEIVED.sent != sent:
        _RECEIVED.function, _RECEIVED.sent = pickle.loads(sent)(never), sent
    return _RECEIVED.function(item)


@contextmanager
def processes(count: int, stop: Stop = never) -> Iterator[Workers]:
    """Processes of this machine, which end with the block, also amid a task.

    Parameters
    ----------
    count : how many.
    stop : whether to end; then it is no error that they do.

    Raises
    ------
    ScenarioError
        If they cannot start because they import the calling script, which starts workers again.
    NotTrustedError
        If one ends unexpectedly.
    """
    context = get_context("spawn")
    begun, (theirs, ours) = context.Event(), context.Pipe(duplex=False)
    with _one_thread_each():
        pool = ProcessPoolExecutor(count, context, _begin_worker, (begun, theirs))
        try:
            yield Workers(pool, count)
        except BrokenProcessPool:
            if stop():  # a signal to all processes of a group, of which the workers die
                return
            if not begun.is_set():
                raise ScenarioError(
                    "worker processes cannot start: they import the calling script, which starts workers again; put "
                    'the call under `if __name__ == "__main__":`, or use workers=1'
                ) from None
            raise NotTrustedError(
                "a worker process ended unexpectedly (killed, or out of memory); continue with --resume, perhaps with "
                "fewer --workers"
            ) from None
        except RuntimeError:
            if current_process().name == "MainProcess" or begun.is_set():
                raise
            raise SystemExit(1) from None  # a worker that imports such a script; its parent says so
        finally:
            ours.close()
            pool.shutdown(cancel_futures=True)
            theirs.close()


def _begin_worker(begun: Any, caller: Any) -> None:
    """Ignore interrupts, which the caller handles, and end when it closes its side of a pipe, or ends itself."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    begun.set()

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


@contextmanager
def cluster(address: str) -> Iterator[Workers]:
    """The workers of the Dask scheduler at an address.

    Raises
    ------
    ScenarioError
        If Dask is not installed, there is no scheduler at the address, or the cluster has no workers.
    NotTrustedError
        If the connection to the cluster is lost.
    """
    try:
        distributed: Any = import_module("distributed")
    except ImportError:
        raise ScenarioError(
            "--scheduler needs Dask distributed, which is not installed; pip install 'beamsim[cluster]'"
        ) from None
    try:
        client = distributed.Client(address, timeout=10, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise ScenarioError(
            f"--scheduler {address}: no scheduler answers ({reason}); start one with `dask scheduler`"
        ) from None
    try:
        count = sum(client.nthreads().values())
        if count == 0:
            raise ScenarioError(f"--scheduler {address}: has no workers; start some with `dask worker {address}`")
        yield Workers(client.get_executor(pure=False), count)
    except (OSError, TimeoutError) as error:
        raise NotTrustedError(
            f"lost the connection to the cluster at {address} ({error}); continue with --resume"
        ) from None
    except Exception as error:
        if type(error).__module__.split(".")[0] != "distributed":
            raise
        raise NotTrustedError(
            f"the cluster at {address} failed ({type(error).__name__}); continue with --resume"
        ) from None
    finally:
        client.close()
