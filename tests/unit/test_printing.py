"""Tables in a terminal."""

from __future__ import annotations

import os
import sys

import pytest

from beamsim.cli.tables import print_table

pytestmark = pytest.mark.quick

ROWS = [("peak force", "851.8 N at 50.9 Hz; change 0.3 % with a finer model"), ("", "second row"), ("files", "a" * 60)]


def test_rows_are_wrapped_in_a_terminal_alone(monkeypatch, capsys):
    print_table("case", ROWS)
    assert capsys.readouterr().out.splitlines()[1] == f"  peak force  {ROWS[0][1]}"
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setattr("shutil.get_terminal_size", lambda *_, **__: os.terminal_size((60, 24)))
    print_table("case", ROWS)
    assert capsys.readouterr().out.splitlines() == [
        "case",
        "  peak force  851.8 N at 50.9 Hz; change 0.3 % with a finer",
        "                model",
        "              second row",
        "  files",
        f"                {'a' * 60}",  # names of files are never broken
    ]
