"""Figures to files. A file is written completely or not at all."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from beamsim.files import replacing

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def save_figures(
    figures: Mapping[str, Figure], folder: Path | str, stem: str, form: str = "png", dots_per_inch: float = 150.0
) -> list[Path]:
    """Save every plot as ``<stem>_<name>.<form>`` in ``folder`` (png, pdf or svg); returns the files.

    Raises
    ------
    ResultFileError
        If a file cannot be written.
    """
    written = []
    for name, figure in figures.items():
        path = Path(folder) / f"{stem}_{name}.{form}"
        with replacing(path) as temporary:
            figure.savefig(temporary, format=form, dpi=dots_per_inch)
        written.append(path)
    return written
