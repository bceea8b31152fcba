"""What commands print on standard output: tables, lists of files, JSON."""

from __future__ import annotations

import shutil
import sys
import textwrap
from collections.abc import Mapping, Sequence
from json import dumps
from pathlib import Path
from typing import Any

from beamsim.fields import plain


def print_json(values: Mapping[str, Any]) -> None:
    """One JSON object on standard output; non-finite numbers are null."""
    print(dumps(plain(values), ensure_ascii=False, allow_nan=False))


def print_files(files: Sequence[Path], *, json: bool, quiet: bool = False) -> None:
    """Print the files written by a command, one per line; as JSON also where it is quiet."""
    if json:
        print_json({"files": [str(path) for path in files]})
    elif not quiet:
        print(*files, sep="\n")


def print_table(title: str, rows: Sequence[tuple[str, str]]) -> None:
    """A title and aligned rows on standard output, wrapped to the width of a terminal."""
    terminal = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    print(table_text(title, rows, terminal))


def table_text(title: str, rows: Sequence[tuple[str, str]], terminal: int | None = None) -> str:
    """A title and aligned rows, in lines of at most ``terminal`` characters."""
    width = max((len(label) for label, _ in rows), default=0)
    lines = [title]
    for label, text in rows:
        lines += _wrapped(f"  {label:<{width}}  {text}".rstrip(), width + 4, terminal)
    return "\n".join(lines)


def _wrapped(row: str, indent: int, width: int | None) -> list[str]:
    """A row in lines of at most ``width`` characters, those after the first indented, where there is room for text."""
    # texts get at least 40 columns; narrower terminals wrap by themselves
    if width is None or len(row) <= width or width - indent < 40:
        return [row]
    return textwrap.wrap(row, width, subsequent_indent=" " * (indent + 2), break_long_words=False)
