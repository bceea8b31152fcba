"""Figures in notebooks."""

from __future__ import annotations

import sys
from importlib import import_module
from typing import Any


def show_figures() -> None:
    """Let a notebook show a figure as a picture, also where pyplot was never imported; elsewhere nothing."""
    ipython: Any = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    if shell is not None:
        import_module("IPython.core.pylabtools").select_figure_formats(shell, {"png"})
