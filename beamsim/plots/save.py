"""Pictures to files. A file is written completely or not at all."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib import rc_context

from beamsim.files import replacing
from beamsim.plots.drawing import Picture


def save_figures(figures: Mapping[str, Picture], folder: Path | str, stem: str, form: str = "png") -> list[Path]:
    """Draw and save every picture as ``<stem>_<name>.<form>``; slashes and spaces in names become underscores.

    Parameters
    ----------
    figures : by name.
    folder : that the files are written to; it is made if it is missing.
    stem : first part of the file names.
    form : png, pdf or svg.

    Returns
    -------
    The files, in the order of the figures.

    Raises
    ------
    ResultFileError
        If a file cannot be written.
    """
    written = []
    for name, figure in figures.items():
        path = Path(folder) / f"{stem}_{name.replace('/', '_').replace(' ', '_')}.{form}"
        with replacing(path) as temporary:
            write(figure, temporary, form)
        written.append(path)
    return written


def write(picture: Picture, target: Any, form: str = "png") -> None:
    """Draw a picture to a file or stream.

    Parameters
    ----------
    picture : to draw.
    target : path or binary stream.
    form : png, pdf or svg.
    """
    # a sixth of the time less than the default
    packed: dict[str, Any] = {"pil_kwargs": {"compress_level": 1}} if form == "png" else {}
    # logarithmic axes have 0.01, 0.6 and 200 in place of powers of ten; letters are as wide as in PDF and SVG
    with rc_context({"axes.formatter.min_exponent": 4, "text.hinting": "none"}):
        picture.figure().savefig(target, format=form, dpi=150.0, **packed)
