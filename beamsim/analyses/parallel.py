"""Workers: threads or processes on this machine, or an existing Dask cluster.

Results are yielded in the order of completion. They do not depend on the worker, which gets plain data and uses one
thread for linear algebra.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from importlib import import_module
from itertools import islice
from threading import Event
from typing import Any, TypeVar

from beamsim.errors import NotTrustedError, ScenarioError
from beamsim.interrupts import Stop, never, until

Item = TypeVar("Item")
Result = TypeVar("Result")

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
UNGUARDED = 97  # exit code of a worker that was about to start workers itself
_ASKED_EVERY_S = 0.05  # whether to stop
_AHEAD = 3  # tasks queued per worker, so that none is idle


def default_workers() -> int:
    """Number of processors this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on every system
        return os.cpu_count() or 1


def on_threads(
    function: Callable[[Item, Stop], Result], items: Sequence[Item], workers: int, stop: Stop = never
) -> Iterator[Result]:
    """Yield what a function gives for every item, computed by threads of this process; one is the calling thread.

    Parameters
    ----------
    function : of an item and of whether to end meanwhile. It spends its time in compiled code that lets go of the
        interpreter.
    items : to be computed.
    workers : number of threads.
    stop : asked whether to end; what is under way then may be yielded or not.
    """
    from concurrent.futures import ThreadPoolExecutor

    workers = max(1, min(workers, len(items)))
    if workers == 1:
        yield from until((function(item, stop) for item in items), stop)
        return
    ended = Event()
    pool = ThreadPoolExecutor(workers)
    tasks = (pool.submit(function, item, lambda: stop() or ended.is_set()) for item in items)
    try:
        yield from _completed(tasks, _AHEAD * workers, stop)
    finally:
        ended.set()
        pool.shutdown(wait=True, cancel_futures=True)


def _completed(tasks: Iterator[Future[Result]], most: int, stop: Stop) -> Iterator[Result]:
    """Yield the results of tasks that are submitted one by one, in the order of completion; at most `most` wait."""
    from concurrent.futures import FIRST_COMPLETED, wait

    queued: set[Future[Result]] = set()
    while not stop():
        queued.update(islice(tasks, most - len(queued)))
        if not queued:
            return
        ready, queued = wait(queued, timeout=_ASKED_EVERY_S, return_when=FIRST_COMPLETED)
        yield from (future.result() for future in ready)


def on_this_machine(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    workers: int,
    prepare: Callable[[Item | None], None],
    stop: Stop = never,
) -> Iterator[Result]:
    """Yield ``function(item)`` for every item, computed by processes.

    Parameters
    ----------
    function : of an item.
    items : to be computed.
    workers : number of processes.
    prepare : called first, by one worker with the first item (which fills the cache of the compiler for all), by the
        others with None.
    stop : asked whether to end; what is under way then is given up.

    Raises
    ------
    ScenarioError
        If workers cannot start because they import the calling script, which starts workers again.
    NotTrustedError
        If a worker process ends unexpectedly.
    """
    from concurrent.futures import ProcessPoolExecutor
    from concurrent.futures.process import BrokenProcessPool
    from multiprocessing import current_process, get_context

    workers = max(1, min(workers, len(items)))
    if getattr(current_process(), "_inheriting", False):  # a worker importing a script without a guard
        raise SystemExit(UNGUARDED)
    with _one_thread_each():
        pool = ProcessPoolExecutor(workers, mp_context=get_context("spawn"), initializer=_begin_worker)
        done, processes = False, []
        try:
            preparing = [pool.submit(prepare, items[0] if k == 0 else None) for k in range(workers)]
            processes = _processes(pool)
            for _ in _completed(iter(preparing), workers, stop):
                pass
            yield from _completed((pool.submit(function, item) for item in items), _AHEAD * workers, stop)
            done = not stop()
        except BrokenProcessPool:
            processes = processes or _processes(pool)
            pool.shutdown(wait=True)  # the pool's own thread collects the exit codes: before, they may be unknown
            if stop():  # a signal to all processes of a group, of which the workers die
                return
            if any(process.exitcode == UNGUARDED for process in processes):
                raise ScenarioError(
                    "worker processes cannot start: they import the calling script, which starts workers again; put "
                    'the call under `if __name__ == "__main__":`, or use workers=1'
                ) from None
            raise NotTrustedError(
                "a worker process ended unexpectedly (killed, or out of memory); continue with --resume, perhaps with "
                "fewer --workers"
            ) from None
        finally:
            if not done:
                for process in _processes(pool):
                    process.terminate()  # without waiting for a long case
            pool.shutdown(wait=True, cancel_futures=True)


def _processes(pool: Any) -> list[Any]:
    return list((getattr(pool, "_processes", None) or {}).values())


def on_cluster(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    address: str,
    prepare: Callable[[Item | None], None],
    stop: Stop = never,
) -> Iterator[Result]:
    """Yield ``function(item)`` for every item, computed by the workers of a Dask scheduler.

    Parameters
    ----------
    function, items, prepare, stop : as of `on_this_machine`.
    address : of the scheduler.

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
        threads = sum(client.nthreads().values())
        if threads == 0:
            raise ScenarioError(f"--scheduler {address}: has no workers; start some with `dask worker {address}`")
        pool = client.get_executor(pure=False)
        for _ in _completed(iter([pool.submit(prepare, items[0])]), 1, stop):
            pass
        yield from _completed((pool.submit(function, item) for item in items), _AHEAD * threads, stop)
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


def _begin_worker() -> None:
    """Ignore interrupts, which the parent handles, and end with the parent."""
    from multiprocessing import parent_process

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    parent = parent_process()

    def end_with_parent() -> None:
        if parent is not None:
            parent.join()
            signal.raise_signal(signal.SIGTERM)  # from this thread, also within a long computation

    threading.Thread(target=end_with_parent, daemon=True).start()
