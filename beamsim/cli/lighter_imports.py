"""Imports of SciPy, Matplotlib and Numba without what no command uses.

SciPy copies every name of NumPy when it is imported. NumPy itself imports some of its parts only when they are asked
for, so that the copy costs a third of SciPy's import: `numpy.f2py` alone compiles the patterns of a parser of Fortran.
A lazy module (`importlib.util.LazyLoader`) is a name that can be copied; who reads an attribute of it has all of it.

Matplotlib writes the properties of every class of artists into docstrings, a quarter of its import. They are left out.

Numba imports `coverage` where it is installed, to report to it what was compiled: 0.08 s, of use where it measures.

Only the command line does this: a program that imports beamsim has these libraries as they are.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType

PARTS = ("char", "ctypeslib", "f2py", "polynomial", "rec", "strings", "testing")


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
    """Let the first import of SciPy, Matplotlib and Numba do less; without effect on what is imported already."""
    steps = {
        "scipy": _keep_parts_of_numpy_lazy,
        "matplotlib.backend_bases": _leave_out_docstrings,
        "matplotlib.figure": _leave_out_docstrings,
        "numba.misc.coverage_support": _leave_out_coverage,
    }
    if not any(isinstance(finder, Beforehand) for finder in sys.meta_path):
        sys.meta_path.insert(0, Beforehand({name: step for name, step in steps.items() if name not in sys.modules}))


def _keep_parts_of_numpy_lazy() -> None:
    import numpy

    for part in PARTS:
        _import_lazily(numpy, part)


def _import_lazily(package: ModuleType, part: str) -> None:
    """Import a part of a package at its first use, unless it is imported already or does not exist."""
    from importlib.util import LazyLoader, find_spec, module_from_spec

    name = f"{package.__name__}.{part}"
    spec = None if name in sys.modules else find_spec(name)
    if spec is None or spec.loader is None:
        return
    loader = spec.loader = LazyLoader(spec.loader)
    module = sys.modules[name] = module_from_spec(spec)
    loader.exec_module(module)
    setattr(package, part, module)


def _leave_out_docstrings() -> None:
    from matplotlib import artist

    artist.kwdoc = _nothing


def _leave_out_coverage() -> None:
    if "coverage" not in sys.modules:
        sys.modules["coverage"] = None  # type: ignore[assignment]  # for Python: it cannot be imported


def _nothing(artist: object) -> str:
    """The list of an artist's properties, left out."""
    return ""
