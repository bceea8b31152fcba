"""Screens that the README and the documents quote are what the commands print now."""

import re
from itertools import pairwise
from pathlib import Path

import pytest

import beamsim
from tests.helpers.commands import invoke
from tests.helpers.quoted import QUOTED, wrong_on_screen

ROOT = Path(__file__).parents[2]


def quoted(document, begins):
    """The lines of the block of a document that begins so."""
    blocks = re.findall(r"^```(\w*)\n(.*?)\n```$", (ROOT / document).read_text(encoding="utf-8"), re.S | re.M)
    (block,) = (text for language, text in blocks if not language and text.startswith(begins))
    return block.splitlines()


def without_spaces(text):
    return " ".join(text.split())


def missing(lines, printed):
    """Lines that are not in what was printed; lines may be broken in two, left out (...), or be of plots and files."""
    printed = without_spaces(printed)
    text = "\n".join(line for line in lines if ".h5" not in line and line.strip() != "...")
    parts = [without_spaces(part) for part in text.splitlines()]
    wrapped = [" ".join(pair) for pair in pairwise(parts)]
    return [
        part
        for k, part in enumerate(parts)
        if part not in printed and not any(both in printed for both in wrapped[max(k - 1, 0) : k + 1])
    ]


def test_a_stale_line_is_found():
    assert missing(["one  19.4 N", "...", "two broken", "in two"], "one 19.4 N\ntwo broken in two") == []
    assert missing(["one 19.4 N", "two 3 N"], "one 19.5 N\ntwo 3 N") == ["one 19.4 N"]


@pytest.mark.parametrize(
    ("of", "commands"),
    QUOTED.items(),
    ids=[f"{document} {begins.split()[0]}" for document, begins in QUOTED],
)
def test_a_quoted_screen_is_what_is_printed(of, commands, solve, monkeypatch):
    """No verdict, heading, sentence or remedy of the screen contradicts a number of the file, either."""
    monkeypatch.chdir(ROOT)
    command, config, *changes = commands[0].split()
    done = solve(command, config, *changes)
    assert done.exit_code == 0, done.output
    assert wrong_on_screen(done.stdout, done.file, command, beamsim.load_scenario(config, changes[1::2])) == []
    printed = done.output
    for further in commands[1:]:  # on the result of the first one
        words = [done.file if word == done.file.name else word for word in further.split()]
        result = invoke(*words, "--no-plots", "-o", f"{done.folder}/compared/")
        assert result.exit_code == 0, result.output
        printed = result.output
    assert missing(quoted(*of), printed) == []
