"""Parts of NumPy that SciPy names and hardly ever uses, imported at their first use.

SciPy copies every name of NumPy when it is imported. NumPy itself imports these parts when they are asked for, so that the
copy costs a third of SciPy's import: `numpy.f2py` alone reads a parser of Fortran. A lazy module (`importlib.util.LazyLoader`)
is a name that can be copied; whoever reads an attribute of it has the whole module.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType

PARTS = ("char", "ctypeslib", "f2py", "rec", "strings", "testing")


class BeforeScipy:
    """Looks for modules before all other finders; prepares NumPy when SciPy is first imported, and finds nothing."""

    def find_spec(self, name: str, path: Sequence[str] | None, target: ModuleType | None = None) -> ModuleSpec | None:
        """See `importlib.abc.MetaPathFinder`; always None, so that the other finders are asked."""
        if name == "scipy":
            sys.meta_path.remove(self)
            import numpy

            for part in PARTS:
                _import_lazily(numpy, part)
        return None


def prepare_import_of_scipy() -> None:
    """Let the first import of SciPy leave NumPy's rarely used parts alone; without effect if it is imported already."""
    if "scipy" not in sys.modules and not any(isinstance(finder, BeforeScipy) for finder in sys.meta_path):
        sys.meta_path.insert(0, BeforeScipy())


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
