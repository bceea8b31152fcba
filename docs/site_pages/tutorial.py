"""The tutorial with what its commands print, made by running them."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

SOURCE = Path(__file__).parents[1] / "tutorial.md"
_FILE = re.compile(r"<!-- file: (\S+) -->\n```yaml\n(.*?)```\n", re.S)
_COMMANDS = re.compile(r"```console\n(.*?)```\n", re.S)
_PICTURE = re.compile(r"(!\[[^\]]*\])\((\w+\.png)\)")
_LONGEST = 60  # lines of output that are shown


def page(folder: Path) -> str:
    """Run the tutorial, save its pictures in ``folder`` and return the page, which lies next to it.

    Raises
    ------
    RuntimeError
        If a command of the tutorial fails.
    """
    text = SOURCE.read_text(encoding="utf-8")
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as work:
        for name, content in _FILE.findall(text):
            (Path(work) / name).write_text(content, encoding="utf-8")
        text = _COMMANDS.sub(lambda match: _with_output(match[1], work), text)
        for _, name in _PICTURE.findall(text):
            shutil.copy(Path(work) / name, folder / f"tutorial_{name}")
    text = _PICTURE.sub(rf"\1({folder.name}/tutorial_\2)", text)
    text = re.sub(r"<!-- file: \S+ -->\n", "", text)
    return re.sub(r"\]\((\w+\.md)\)", r"](../\1)", text)


def _with_output(block: str, folder: str) -> str:
    """Return a block of commands with what each prints."""
    shown = []
    for line in block.splitlines():
        shown += [line, *_printed(shlex.split(line.removeprefix("$ ")), folder)]
    return "```console\n" + "\n".join(shown) + "\n```\n"


def _printed(command: list[str], folder: str) -> list[str]:
    """Run a command and return the lines that it prints."""
    if command[0] != "beamsim":
        raise RuntimeError(f"the tutorial runs {command[0]}, which is not beamsim")
    environment = {**os.environ, "COLUMNS": "120"}
    done = subprocess.run(
        [sys.executable, "-m", *command], cwd=folder, env=environment, capture_output=True, text=True, encoding="utf-8"
    )
    if done.returncode != 0:
        raise RuntimeError(f"{shlex.join(command)} ended with exit code {done.returncode}: {done.stderr}")
    lines = done.stdout.rstrip().splitlines()
    return lines if len(lines) <= _LONGEST else [*lines[:_LONGEST], "..."]
