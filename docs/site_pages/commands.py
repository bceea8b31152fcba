"""The page of all commands, made from the declarations that the program's own help is made from."""

from __future__ import annotations

import enum
import inspect
import types
from collections.abc import Iterator
from typing import Any, Literal, get_args, get_origin

from typer.models import ArgumentInfo

from beamsim.cli.app import app

_INTRODUCTION = """\
# Commands

This page is a reference for everybody who types a command. It lists all commands and their options, as
`beamsim COMMAND --help` prints them. [What beamsim can do](../features.md) shows which command suits which question;
[outcomes and exit codes](../exit_codes.md) shows how a command can end.

"""


def page() -> str:
    """Return the page as MyST Markdown."""
    return _INTRODUCTION + "".join(
        _section(command.name or command.callback.__name__.replace("_", "-"), command.callback)
        for command in app.registered_commands
        if command.callback is not None
    )


def _section(name: str, function: Any) -> str:
    parameters = list(_parameters(function))
    usage = " ".join([f"beamsim {name}", *(value for value, _, positional in parameters if positional), "[OPTIONS]"])
    rows = "".join(f"| `{value}` | {text} |\n" for value, text, _ in parameters)
    text = inspect.cleandoc(function.__doc__ or "").split("\f")[0].strip()
    return f"## `beamsim {name}`\n\n{text}\n\n```text\n{usage}\n```\n\n| argument | meaning |\n|---|---|\n{rows}\n"


def _parameters(function: Any) -> Iterator[tuple[str, str, bool]]:
    """Yield how each parameter is given, its help, and whether it is positional."""
    for name, parameter in inspect.signature(function).parameters.items():
        kind, info = get_args(parameter.annotation)[:2]
        if info.hidden:
            continue
        text = " ".join((info.help or "").split()).replace("|", "\\|")
        if isinstance(info, ArgumentInfo):
            yield info.metavar or name.upper(), text, True
            continue
        declared = [item for item in (info.default, *(info.param_decls or ())) if str(item).startswith("-")]
        names = ", ".join(declared or [f"--{name.replace('_', '-')}"])
        value = "" if bool in _types(kind) else f" {info.metavar or _value(kind)}"
        yield (names + value).replace("|", "\\|"), text, False


def _types(kind: Any) -> tuple[Any, ...]:
    return get_args(kind) if isinstance(kind, types.UnionType) else (kind,)


def _value(kind: Any) -> str:
    """Return what a value may be: its choices, or the name of its type."""
    for item in _types(kind):
        if get_origin(item) is Literal:
            return "|".join(map(str, get_args(item)))
        if isinstance(item, type) and issubclass(item, enum.Enum):
            return "|".join(str(choice.value) for choice in item)
        if isinstance(item, type) and item is not types.NoneType:
            return {"int": "INTEGER", "float": "NUMBER", "Path": "PATH"}.get(item.__name__, "TEXT")
    return "TEXT"
