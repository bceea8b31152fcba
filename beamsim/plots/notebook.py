"""Figures in notebooks."""

from __future__ import annotations

import sys
from importlib import import_module
from pkgutil import resolve_name
from typing import Any

from matplotlib.figure import Figure

from beamsim.kinds import KINDS
from beamsim.plots.drawing import plain_text
from beamsim.plots.style import use_units
from beamsim.results.result import Result


def figures_of(result: Result) -> dict[str, Figure]:
    """The figures that the command saves, by name, in the units of the scenario.

    A notebook shows each as a picture, also where pyplot was never imported.
    """
    ipython: Any = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    if shell is not None:
        import_module("IPython.core.pylabtools").select_figure_formats(shell, {"png"})
    with use_units(result.scenario.display_scales), plain_text():
        pictures = resolve_name(KINDS[result.KIND].figures)(result)
        return {name: picture.figure() for name, picture in pictures.items()}
