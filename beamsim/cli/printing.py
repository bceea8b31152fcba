"""What commands print on standard output: tables, lists of files, JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any


def print_json(values: Mapping[str, Any]) -> None:
    """One JSON object on standard output; non-finite numbers are null."""
    from beamsim.store.schema import plain

    print(json.dumps(plain(values), ensure_ascii=False, allow_nan=False))


def print_files(files: Sequence[Path], *, as_json: bool) -> None:
    """Print the files written by a command, one per line."""
    if as_json:
        print_json({"files": [str(path) for path in files]})
    else:
        print(*files, sep="\n")


def print_table(title: str, rows: Sequence[tuple[str, str]]) -> None:
    """A title and aligned rows on standard output."""
    width = max((len(label) for label, _ in rows), default=0)
    print(title)
    for label, text in rows:
        print(f"  {label:<{width}}  {text}".rstrip())
