"""Imports of libraries without what no command uses.

SciPy copies every name of NumPy when it is imported. NumPy itself imports some of its parts only when they are asked
for, so that the copy costs a third of SciPy's import: `numpy.f2py` alone compiles the patterns of a parser of Fortran.
Matplotlib imports the table of the glyphs of TeX's fonts. They are executed when something of them is first asked for.

Matplotlib writes the properties of every class of artists into docstrings, a quarter of its import. They are left out.

Numba imports `coverage` where it is installed, to report to it what was compiled: 0.08 s, of use where it measures.

Only the command line does this: a program that imports beamsim has these libraries as they are.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib.machinery import ModuleSpec
from threading import RLock
from types import ModuleType
from typing import Any

PARTS = ("char", "ctypeslib", "f2py", "polynomial", "rec", "strings", "testing")
_PENDING, _EXECUTING = "_not_yet_executed", RLock()


class Beforehand:
    """A finder of modules that finds none: before the first import of a module it calls what belongs to it."""

    def __init__(self, prepare: Mapping[str, Callable[[], None]]) -> None:
        self._prepare = dict(prepare)

    def find_spec(self, name: str, path: Sequence[str] | None, target: ModuleType | None = None) -> ModuleSpec | None:
        """See `importlib.abc.MetaPathFinder`; always None, so that the other finders are asked."""
        prepare = self._prepare.pop(name, None)
        if prepare is not None:
            prepare()
        return None


def lighten_imports() -> None:
    """Let the first imports of some libraries do less; without effect on what is imported already."""
    steps: dict[str, Callable[[], None]] = {
        "scipy": _keep_parts_of_numpy_for_later,
        "matplotlib.backend_bases": _leave_out_docstrings,
        "matplotlib.figure": _leave_out_docstrings,
        "matplotlib.dviread": partial(_import_later, "fontTools", "agl"),
        "numba.misc.coverage_support": _leave_out_coverage,
    }
    if not any(isinstance(finder, Beforehand) for finder in sys.meta_path):
        sys.meta_path.insert(0, Beforehand({name: step for name, step in steps.items() if name not in sys.modules}))


class _LateModule(ModuleType):
    """A module that is executed when a name of it is first asked for.

    That of `importlib.util.LazyLoader` is executed by the next ``import`` of it, too.
    """

    def __getattr__(self, name: str) -> Any:
        with _EXECUTING:
            if vars(self).pop(_PENDING, False):  # not while its own code asks for its names
                self.__spec__.loader.exec_module(self)  # type: ignore[union-attr]
                self.__class__ = ModuleType  # type: ignore[assignment]
            return ModuleType.__getattribute__(self, name)


def _import_later(package: str, part: str) -> None:
    """Execute a part of a package at its first use, unless it is imported already or does not exist."""
    from importlib import import_module
    from importlib.util import find_spec, module_from_spec

    name = f"{package}.{part}"
    if name in sys.modules:
        return
    try:
        parent, spec = import_module(package), find_spec(name)
    except ModuleNotFoundError:
        return
    if spec is None or spec.loader is None:
        return
    module = module_from_spec(spec)
    module.__class__ = _LateModule
    vars(module)[_PENDING] = True
    sys.modules[name] = module
    setattr(parent, part, module)


def _keep_parts_of_numpy_for_later() -> None:
    for part in PARTS:
        _import_later("numpy", part)


def _leave_out_docstrings() -> None:
    from matplotlib import artist

    artist.kwdoc = _nothing


def _leave_out_coverage() -> None:
    if "coverage" not in sys.modules:
        sys.modules["coverage"] = None  # type: ignore[assignment]  # for Python: it cannot be imported


def _nothing(artist: object) -> str:
    """The list of an artist's properties, left out."""
    return ""
