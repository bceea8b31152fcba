"""Examples in docstrings print what they show."""

import doctest
import importlib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
OPTIONS = doctest.NORMALIZE_WHITESPACE | doctest.REPORT_NDIFF


def modules_with_examples():
    """Names of the modules of the package that have an example in a docstring."""
    for path in sorted((ROOT / "beamsim").rglob("*.py")):
        if ">>> " in path.read_text(encoding="utf-8"):
            name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
            yield name.removesuffix(".__init__")


@pytest.mark.parametrize("name", list(modules_with_examples()))
def test_examples_of_docstrings_print_what_they_show(name, monkeypatch):
    monkeypatch.chdir(ROOT)  # the files that they name are relative to it
    counts = doctest.testmod(importlib.import_module(name), optionflags=OPTIONS)
    assert counts.attempted > 0
    assert counts.failed == 0


def test_a_wrong_example_is_found(capsys):
    wrong = doctest.DocTestParser().get_doctest(">>> 1 + 1\n3\n", {}, "wrong", None, None)
    assert doctest.DocTestRunner(optionflags=OPTIONS).run(wrong).failed == 1
    assert "3" in capsys.readouterr().out
