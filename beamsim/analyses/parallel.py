"""Workers: threads or processes on this machine, or an existing Dask cluster.

Results are yielded in the order of completion. They do not depend on the worker, which gets plain data and uses one
thread for linear algebra.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from typing import Any, TypeVar

from beamsim.errors import NotTrustedError, ScenarioError

Item = TypeVar("Item")
Result = TypeVar("Result")

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
UNGUARDED = 97  # exit code of a worker that was about to start workers itself
_ASKED_EVERY_S = 0.5  # whether the caller is interrupted, which Windows does not see while it waits
_AHEAD = 3  # tasks queued per worker, so that none is idle


def default_workers() -> int:
    """Number of processors this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on every system
        return os.cpu_count() or 1


def on_threads(
    function: Callable[[Item], Result], items: Sequence[Item], workers: int, stop: Callable[[], None]
) -> Iterator[Result]:
    """Yield ``function(item)`` for every item, computed by threads of this process; one is the calling thread itself.

    ``function`` spends its time in compiled code that lets go of the interpreter. Where the caller is interrupted,
    ``stop`` tells the functions that are under way to end.
    """
    from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait

    workers = max(1, min(workers, len(items)))
    if workers == 1:
        yield from map(function, items)
        return
    pool = ThreadPoolExecutor(workers)
    done = False
    try:
        waiting: set[Future[Result]] = set()
        for item in items:
            waiting.add(pool.submit(function, item))
            while len(waiting) >= _AHEAD * workers:
                ready, waiting = wait(waiting, timeout=_ASKED_EVERY_S, return_when=FIRST_COMPLETED)
                yield from (future.result() for future in ready)
        while waiting:
            ready, waiting = wait(waiting, timeout=_ASKED_EVERY_S, return_when=FIRST_COMPLETED)
            yield from (future.result() for future in ready)
        done = True
    finally:
        if not done:
            stop()
        pool.shutdown(wait=True, cancel_futures=True)


def on_this_machine(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    workers: int,
    prepare: Callable[[Item | None], None],
) -> Iterator[Result]:
    """Yield ``function(item)`` for every item, computed by processes; a single worker is the calling process itself.

    First, one worker calls ``prepare`` with the first item (which fills the cache of the compiler for all) while the
    others call it with None.

    Raises
    ------
    ScenarioError
        If workers cannot start because they import the calling script, which starts workers again.
    NotTrustedError
        If a worker process ends unexpectedly.
    """
    from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
    from concurrent.futures.process import BrokenProcessPool
    from multiprocessing import current_process, get_context

    workers = max(1, min(workers, len(items)))
    if workers == 1:
        yield from map(function, items)
        return
    if getattr(current_process(), "_inheriting", False):  # a worker importing a script without a guard
        raise SystemExit(UNGUARDED)
    with _one_thread_each():
        pool = ProcessPoolExecutor(workers, mp_context=get_context("spawn"), initializer=_begin_worker)
        done, processes = False, []
        try:
            prepared = [pool.submit(prepare, items[0] if k == 0 else None) for k in range(workers)]
            processes = _processes(pool)
            for future in prepared:
                future.result()
            waiting: set[Future[Result]] = set()
            for item in items:
                waiting.add(pool.submit(function, item))
                if len(waiting) >= _AHEAD * workers:
                    ready, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                    yield from (future.result() for future in ready)
            while waiting:
                ready, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                yield from (future.result() for future in ready)
            done = True
        except BrokenProcessPool:
            processes = processes or _processes(pool)
            pool.shutdown(wait=True)  # the pool's own thread collects the exit codes: before, they may be unknown
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
) -> Iterator[Result]:
    """Yield ``function(item)`` for every item, computed by the workers of a Dask scheduler.

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
        client.submit(prepare, items[0], pure=False).result()
        remaining = iter(items)
        first = [item for _, item in zip(range(_AHEAD * threads), remaining, strict=False)]
        queue = distributed.as_completed(
            [client.submit(function, item, pure=False) for item in first], loop=client.loop
        )
        for future in queue:
            yield future.result()
            for item in remaining:
                queue.add(client.submit(function, item, pure=False))
                break
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
    import signal
    import threading
    from multiprocessing import parent_process

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()

    def end_with_parent() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=end_with_parent, daemon=True).start()
