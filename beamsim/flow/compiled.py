"""Compilation of the kernels, the folder of compiled code, and the processor time without compilation.

Numba caches compiled code per source file and does not notice when a called function in another file changes. Therefore
the folder's name is a hash of all kernels: after any change all are compiled again.
"""

from __future__ import annotations

import hashlib
import logging
import os
import sys
import tempfile
import threading
import time as clock
import warnings
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any, cast

import numba
from numba.core import event

from beamsim.errors import CacheWarning

_LOG = logging.getLogger(__name__)


class CompilationTime(event.Listener):
    """Processor time spent in the compiler, whose calls may be nested."""

    def __init__(self) -> None:
        self.spent, self._begun, self._depth = 0.0, 0.0, 0  # s, s
        self._lock = threading.Lock()

    def on_start(self, event: Any) -> None:
        """Start timing at the outermost call of the compiler."""
        with self._lock:
            self._begun = self._begun if self._depth else clock.process_time()
            self._depth += 1

    def on_end(self, event: Any) -> None:
        """Add the time of the outermost call."""
        with self._lock:
            self._depth -= 1
            self.spent += 0.0 if self._depth else clock.process_time() - self._begun


COMPILATION = CompilationTime()
cast("Any", event).register("numba:compiler_lock", COMPILATION)


def processor_time() -> float:
    """Processor time of this process without compilation, s."""
    return clock.process_time() - COMPILATION.spent


def kernel(function: Callable[..., Any], **options: Any) -> Any:
    """Compile a function of arrays and numbers when it is first called, and keep what was compiled.

    The kernel releases the interpreter lock, so that threads execute kernels in parallel. A division by zero gives
    infinity. A function with a leading underscore can only be called by kernels and is compiled into them.

    Parameters
    ----------
    function : to be compiled.
    options : further ones of `numba.njit`.

    Returns
    -------
    The compiled function.
    """
    folder, config = cache_folder(), cast("Any", numba.config)
    before = config.CACHE_DIR
    if folder is not None:
        config.CACHE_DIR = str(folder)  # read when the function is decorated
    try:
        if function.__name__.startswith("_"):  # their wrappers and files took a third of the compilation time
            options |= {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
        else:
            options["cache"] = folder is not None
        return numba.njit(nogil=True, error_model="numpy", **options)(function)
    finally:
        config.CACHE_DIR = before


# a kernel whose sums may be reordered for vectorisation
summing = partial(kernel, fastmath={"reassoc", "contract", "nsz"})


_COMPILING = (
    "compiling the numerical kernels for this processor, once; this takes half a minute, on a busy machine minutes"
)


@cache
def cache_folder() -> Path | None:
    """The folder of compiled code, created if missing; None, with a warning, if it cannot be written.

    It is in ``NUMBA_CACHE_DIR``, else in the user's folder for caches.
    """
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    place = Path(chosen) if chosen else _user_caches() / "beamsim"
    digest = hashlib.sha256(numba.__version__.encode())  # of the sources of all kernels, and of how they are compiled
    here = Path(__file__)
    for file in [here, here.with_name("extrema.py"), *sorted(here.parent.glob("*kernels.py"))]:
        digest.update(file.read_bytes())
    folder = place / f"kernels-{digest.hexdigest()[:16]}"
    try:
        place.mkdir(mode=0o700, parents=True, exist_ok=True)
        folder.mkdir(mode=0o700, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        text = f"{place} cannot be written: every process compiles for half a minute"
        warnings.warn(f"{text}; set NUMBA_CACHE_DIR to a folder that can be written", CacheWarning, stacklevel=2)
        return None
    if not any(folder.iterdir()):
        _LOG.info(_COMPILING)
    return folder


def _user_caches() -> Path:
    """The user's cache folder by the conventions of the operating system."""
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData/Local")
    if sys.platform == "darwin":
        return Path.home() / "Library/Caches"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
