"""Paths of the output files."""

from __future__ import annotations

from pathlib import Path

from beamsim.files import check_writable


def output_file(output: Path | None, stem: str, *suffixes: str) -> Path:
    """File named by ``-o``: the file itself if it has one of the suffixes, else ``stem`` in that folder.

    Raises
    ------
    ResultFileError
        If the file could not be written.
    """
    if output is not None and output.suffix.lower() in suffixes and not output.is_dir():
        path = output
    else:
        path = (output or Path()) / f"{stem}{suffixes[0]}"
    check_writable(path)
    return path


def output_folder(output: Path | None, stem: str) -> Path:
    """Folder named by ``-o``, checked; the current one by default."""
    folder = output or Path()
    check_writable(folder / f"{stem}_")
    return folder
