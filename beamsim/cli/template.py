"""The command ``new``."""

from __future__ import annotations

from pathlib import Path

from beamsim.errors import ScenarioError
from beamsim.files import replacing

SCHEMA = "beamsim.schema.json"


def write_template(path: Path, kind: str, *, force: bool) -> list[Path]:
    """Write a template and, beside it, the schema that its first line names; return the files.

    An existing scenario is kept unless ``force``. The schema is that of this version, and is written in any case.

    Raises
    ------
    ScenarioError
        If the file exists.
    ResultFileError
        If it cannot be written.
    """
    from beamsim.cli.validation import schema_text
    from beamsim.scenario import template

    if path.exists() and not force:
        raise ScenarioError(f"{path} already exists; choose another name, or use --force to replace it")
    schema = path.with_name(SCHEMA)
    for target, text in (
        (path, f"# yaml-language-server: $schema={SCHEMA}\n{template(kind)}"),
        (schema, schema_text() + "\n"),
    ):
        with replacing(target) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return [path, schema]
