"""Compilation of the kernels, and where compiled code is kept.

Numba keeps it beside the sources, else in the user's cache folder, and refuses to compile where it can write neither.
Then it goes to a temporary folder of the user, else nowhere: every process compiles it again.
"""

from __future__ import annotations

import gc
import hashlib
import logging
import os
import stat
import tempfile
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core.runtime.nrt import rtsys

from beamsim.errors import CacheWarning
from beamsim.flow.stopping import check_compilation

_LOG = logging.getLogger(__name__)
_REMEDY = "set NUMBA_CACHE_DIR to a folder that can be written"


def njit(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """`numba.njit` for functions of this package; ``cache=True`` keeps the compiled code where that is possible.

    They let go of the interpreter, so that threads execute them side by side.
    """
    options = {"nogil": True, **options}

    def compiled(function: Callable[..., Any]) -> Any:
        try:
            dispatcher = numba.njit(**options)(function)
        except RuntimeError as error:
            if "cannot cache function" not in str(error):
                raise
            dispatcher = numba.njit(**{**options, "cache": use_temporary_folder()})(function)
        _search_no_garbage(dispatcher)
        _ignore_literals(dispatcher)
        _know_all_sources(dispatcher)
        _tolerate_failures(dispatcher)
        return dispatcher

    return compiled


def kernel(function: Callable[..., Any]) -> Any:
    """A compiled function that Python calls."""
    return njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)(function)


WITHIN: dict[str, Any] = {"cache": True, "error_model": "numpy", "no_cfunc_wrapper": True, "no_cpython_wrapper": True}


def inner(function: Callable[..., Any]) -> Any:
    """A compiled function that only compiled functions call, and that neither makes nor returns arrays.

    It has no entry from Python, which would take a third of the compilation: called from there it crashes. References
    to arrays are not counted in it, which took a third of a swept sine: the caller holds them.
    """
    return njit(**WITHIN, _nrt=False)(function)


def summing(function: Callable[..., Any]) -> Any:
    """As `inner`; sums may be taken in the order that suits the processor."""
    return njit(**WITHIN, _nrt=False, fastmath={"reassoc", "contract", "nsz"})(function)


def allocating(function: Callable[..., Any]) -> Any:
    """A compiled function that only compiled functions call, and that makes arrays."""
    return njit(**WITHIN, _nrt=True)(function)  # not inherited from its caller


@cache
def use_temporary_folder() -> bool:
    """Let Numba keep compiled code in a private temporary folder, also in worker processes; whether there is one."""
    user = str(os.getuid()) if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")
    try:
        folder = Path(tempfile.gettempdir()) / f"beamsim-{user}"
        folder.mkdir(mode=0o700, exist_ok=True)
        if not _is_private(folder):
            raise PermissionError(f"{folder} belongs to another user")
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        _warn("nowhere: every process compiles for half a minute")
        return False
    config: Any = numba.config
    config.CACHE_DIR = os.environ["NUMBA_CACHE_DIR"] = str(folder)
    _warn(f"in {folder}")
    return True


def _is_private(folder: Path) -> bool:
    """Whether nobody else can write to a folder, whose contents will be executed."""
    if not hasattr(os, "getuid"):  # temporary folders are private on Windows
        return True
    state = folder.lstat()
    return stat.S_ISDIR(state.st_mode) and state.st_uid == os.getuid() and not state.st_mode & 0o022


def _warn(place: str) -> None:
    text = f"neither the package's folder nor the home folder can be written: compiled code is kept {place}; {_REMEDY}"
    warnings.warn(text, CacheWarning, stacklevel=2)


@cache
def _announce() -> None:
    """Log, before the first compilation of a process, why it takes a while."""
    _LOG.info(
        "compiling the numerical kernels for this processor; that is done once and takes half a minute, on a busy "
        "machine minutes"
    )


@cache
def _warn_once(reason: str) -> None:
    warnings.warn(f"compiled code cannot be kept ({reason}); {_REMEDY}", CacheWarning, stacklevel=2)


def _search_no_garbage(dispatcher: Any) -> None:
    """Compile without searching for garbage: the many objects of a compilation stay until it ends.

    The searches took a sixth of its time. One at its end, among all that is new by then, took a fortieth: freezing and
    thawing makes it old, so that it is searched when old objects are.
    """
    compiler: Any = dispatcher._compiler
    compile_types = compiler.compile

    def compile_at_once(arguments: Any, returned: Any) -> Any:
        if not gc.isenabled():  # within the compilation of a caller
            return compile_types(arguments, returned)
        gc.disable()
        try:
            return compile_types(arguments, returned)
        finally:
            if not gc.get_freeze_count():  # what others have frozen is left alone
                gc.freeze()
                gc.unfreeze()
            gc.enable()

    compiler.compile = compile_at_once


def _ignore_literals(dispatcher: Any) -> None:
    """Compile a call with a number that is written out for its type, not once more for every such number."""
    template_of = dispatcher.get_call_template
    unliteral: Any = numba.types.unliteral

    def get_call_template(arguments: Any, named: Any) -> Any:
        return template_of(tuple(map(unliteral, arguments)), {name: unliteral(each) for name, each in named.items()})

    dispatcher.get_call_template = get_call_template


def _know_all_sources(dispatcher: Any) -> None:
    """Compile again when any kernel's source has changed: compiled code contains the kernels of other files it calls.

    Numba compares the function's own file alone. After an upgrade, which leaves compiled code where it is, a kernel
    would go on with the old version of another.
    """
    index: Any = getattr(getattr(dispatcher, "_cache", None), "_cache_file", None)
    if index is not None:
        index._source_stamp = (index._source_stamp, _hash_of_kernels())


@cache
def _hash_of_kernels() -> str:
    """Hash of the sources of all kernels, and of how they are compiled."""
    digest = hashlib.sha256()
    for file in sorted(Path(__file__).parent.glob("*.py")):
        if file.stem.endswith("kernels") or file.name == Path(__file__).name:
            digest.update(file.read_bytes())
    return digest.hexdigest()


def _tolerate_failures(dispatcher: Any) -> None:
    """Compile instead of failing where cached code cannot be read or written (a full disk, a damaged file)."""
    files: Any = getattr(dispatcher, "_cache", None)
    if not getattr(files, "cache_path", None):  # nothing is kept
        return
    save, load_index = files.save_overload, files._cache_file._load_index

    def known_overloads() -> Any:
        """What the index lists: nothing where it cannot be read, so that it is written anew."""
        try:
            return load_index()
        except Exception:  # a damaged file, or one that names a class that an older version had
            return {}

    def load_overload(signature: Any, context: Any) -> Any:
        # without Numba's own refresh, which imports all that compiling needs: a tenth of a run; a compilation does that
        rtsys.initialize(context)
        try:
            loaded = files._load_overload(signature, context)
        except Exception:  # a damaged file may raise anything
            loaded = None
        if loaded is None:
            _announce()
            check_compilation()
        return loaded

    def save_overload(*arguments: Any) -> None:
        try:
            save(*arguments)
        except Exception as error:  # what is on the disk may be damaged, too
            _warn_once(str(getattr(error, "strerror", "") or error or type(error).__name__))
        check_compilation()

    files.load_overload, files.save_overload = load_overload, save_overload
    files._cache_file._load_index = known_overloads
