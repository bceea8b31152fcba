"""The command ``new``."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from beamsim.errors import ScenarioError
from beamsim.files import replacing


def write_template(path: Path, kind: Literal["beam", "chain"], *, force: bool) -> None:
    """Write a template; an existing file is kept unless ``force``.

    Raises
    ------
    ScenarioError
        If the file exists.
    ResultFileError
        If it cannot be written.
    """
    from beamsim.scenario import template

    if path.exists() and not force:
        raise ScenarioError(f"{path} already exists; choose another name, or use --force to replace it")
    with replacing(path) as temporary:
        temporary.write_text(template(kind), encoding="utf-8")
