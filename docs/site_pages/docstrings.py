"""Sphinx extension: docstrings of the package in the form that `sphinx.ext.napoleon` reads.

A parameter is written ``name : what it is``, without a type, which the signature has. Napoleon reads the text behind
the colon of a parameter as its type, and the text before a colon in the first line of a property as the type of that.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

_PARAMETER = re.compile(r"(\w+(?:, \w+)*) : (.+)")


def described_parameters(lines: Sequence[str]) -> Iterator[str]:
    """Lines of a docstring with the text of each parameter below its name."""
    section = ""
    for line, following in pairwise([*lines, ""]):
        if following and not following.strip("-"):
            section = line
        parameter = _PARAMETER.fullmatch(line) if section == "Parameters" else None
        yield from (line,) if parameter is None else (parameter[1], f"    {parameter[2]}")


_kept: dict[str, list[str]] = {}  # docstrings of properties and attributes by name, which napoleon does not see


def _before_napoleon(_app: Any, what: str, name: str, _value: object, _options: object, lines: list[str]) -> None:
    if what in ("attribute", "property"):
        _kept[name] = [*lines]
        lines.clear()
    else:
        lines[:] = described_parameters(lines)


def _after_napoleon(_app: Any, _what: str, name: str, _value: object, _options: object, lines: list[str]) -> None:
    lines[:] = _kept.pop(name, lines)


def _signature(_app: Any, what: str, _name: str, value: Any, *_rest: object) -> tuple[str, str] | None:
    """No signature of a class whose docstring has no parameters: results, for example, are not made by users."""
    made_by_users = what not in ("class", "exception") or "Parameters\n" in (value.__doc__ or "")
    return None if made_by_users else ("", "")


def setup(app: Any) -> dict[str, bool]:
    """Register the extension, before and after napoleon, whose priority is 500."""
    app.connect("autodoc-process-docstring", _before_napoleon, priority=400)
    app.connect("autodoc-process-docstring", _after_napoleon, priority=600)
    app.connect("autodoc-process-signature", _signature)
    return {"parallel_read_safe": True}
