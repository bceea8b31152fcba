"""Figures to files. A file is written completely or not at all."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.files import replacing
from beamsim.plots.layout import lay_out
from beamsim.plots.png import write_png

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DOTS_PER_INCH = 150.0
SETTINGS: Any = {  # of Matplotlib
    "axes.formatter.min_exponent": 4,  # logarithmic axes have 0.01, 0.6 and 200 instead of powers of ten below 10^4
    "text.hinting": "none",  # letters have their own widths, as in PDF and SVG, and take half the time
}


def save_figures(figures: Mapping[str, Figure], folder: Path | str, stem: str, form: str = "png") -> list[Path]:
    """Save every plot as ``<stem>_<name>.<form>`` in ``folder`` (png, pdf or svg); returns the files.

    Raises
    ------
    ResultFileError
        If a file cannot be written.
    """
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    written = []
    for name, figure in figures.items():
        path = Path(folder) / f"{stem}_{name}.{form}"
        with replacing(path) as temporary, rc_context(SETTINGS):
            figure.set_dpi(DOTS_PER_INCH)
            canvas: Any = FigureCanvasAgg(figure)
            lay_out(figure, canvas.get_renderer())
            if form == "png":
                canvas.draw()
                write_png(temporary, np.asarray(canvas.buffer_rgba()), DOTS_PER_INCH)
            else:
                figure.savefig(temporary, format=form)
        written.append(path)
    return written
