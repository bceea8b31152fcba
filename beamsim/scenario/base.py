"""The base of every part of a scenario, and the tools its parts share.

Every class is frozen, refuses unknown keys, and takes its fields' descriptions from the docstrings
below them (they reach the user through the JSON Schema; they are read when they are needed, since
parsing sources would take a third of the import time).

A scenario with several mistakes should show all of them at once, also those that need two fields to
be seen. pydantic stops at the fields. So a second, *lenient* pass puts `UNKNOWN` where a field is
wrong and carries on; a check that touches an unknown value is skipped.
"""

from __future__ import annotations

import ast
import inspect
import re
import sys
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from itertools import pairwise
from typing import Any, Literal, NoReturn, Self, get_args, get_origin

from pydantic import (
    BaseModel,
    ConfigDict,
    GetCoreSchemaHandler,
    Tag,
    ValidationError,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    model_validator,
)
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from beamsim.errors import ScenarioError

Path = tuple[str | int, ...]


class UnknownValueError(Exception):
    """A check used a value that did not pass validation."""


class _Unknown:
    """Stands for a value that is wrong; any use of it raises `UnknownValueError`."""

    __slots__ = ()

    def _used(self, *_: object) -> NoReturn:
        raise UnknownValueError

    __lt__ = __le__ = __gt__ = __ge__ = _used
    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __rtruediv__ = _used
    __pow__ = __rpow__ = __neg__ = __pos__ = __abs__ = _used
    __float__ = __int__ = __index__ = __bool__ = __str__ = __format__ = _used
    __len__ = __iter__ = __getitem__ = __contains__ = _used

    def __eq__(self, other: object) -> bool:
        raise UnknownValueError

    def __hash__(self) -> int:
        raise UnknownValueError

    def __getattr__(self, name: str) -> NoReturn:
        if name.startswith("__"):  # pydantic probes for special methods
            raise AttributeError(name)
        raise UnknownValueError


LONGEST_VALUE = 60  # characters of a value in a message
UNKNOWN = _Unknown()


def known(*values: object) -> bool:
    """Whether none of the values is the one that stands for a wrong value."""
    return not any(value is UNKNOWN for value in values)


_KEY = r"[A-Za-z_](?:[\w -]*[\w-])?"
_ITEM = r"\[(?:\*|\w(?:[\w .+-]*[\w+-])?)\]"
_PATH = re.compile(rf"[A-Za-z_][\w-]*(?:{_ITEM})*(?:\.{_KEY}(?:{_ITEM})*)*")
_PATH_PART = re.compile(rf"({_KEY})|({_ITEM})")


def path_parts(path: str) -> list[str | int]:
    """Keys, names, indices and ``*`` of a path that a user wrote; empty if it is none.

    Brackets hold an index, ``*`` for every item, or a name, which may have points there.

    >>> path_parts("snubbers.hard stop.gap"), path_parts("bodies.panel.point_masses[*].mass")
    (['snubbers', 'hard stop', 'gap'], ['bodies', 'panel', 'point_masses', '*', 'mass'])
    >>> path_parts("snubbers[0].gap"), path_parts("probes[no. 1].position"), path_parts("snubbers[0")
    (['snubbers', 0, 'gap'], ['probes', 'no. 1', 'position'], [])
    """
    if not _PATH.fullmatch(path):
        return []
    parts = (key or item[1:-1] for key, item in _PATH_PART.findall(path))
    return [int(part) if part.isdecimal() else part for part in parts]


def path_text(path: Path) -> str:
    """Write a path as the user would.

    >>> path_text(("snubbers", 0, "position"))
    'snubbers[0].position'
    """
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text


class LenientPass:
    """Validation context of the lenient pass."""


def fail(message: str, remedy: str = "", at: Path = (), show_value: bool = False) -> PydanticCustomError:
    """Build the error a validator raises; ``at`` is the path below the value being validated.

    ``message`` follows the path of the value (``beam.length`` + ``must be ...``); with ``show_value`` the
    value as it was written comes between them (``= -5 mm``).
    """
    context = {"message": message, "remedy": remedy, "at": at, "show_value": show_value}
    return PydanticCustomError("beamsim", "{message}", context)


class Schema(BaseModel):
    """A frozen part of a scenario."""

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        allow_inf_nan=False,
        validate_by_name=True,
        validate_by_alias=True,
        defer_build=True,
    )

    _late: Exception | None = None  # what `settle` found in the lenient pass

    @property
    def late_error(self) -> Exception | None:
        """What the fields' comparison raised in the lenient pass, if anything."""
        return self._late

    def settle(self) -> None:
        """Check fields against each other and resolve defaults; raises what `fail` builds."""

    def resolve(self, name: str, value: object) -> None:
        """Set a field while the object is being validated (it is frozen for everybody else)."""
        self.__dict__[name] = value

    @classmethod
    def keys(cls) -> dict[str, str]:
        """Map the key as it is written in YAML to the attribute's name."""
        return _keys(cls)

    @classmethod
    def descriptions(cls) -> dict[str, str]:
        """Map every attribute's name to the docstring below it."""
        docstrings: dict[str, str] = {}
        for base in reversed(cls.__mro__):
            if issubclass(base, Schema) and base is not Schema:
                docstrings |= _attribute_docstrings(base.__module__).get(base.__name__, {})
        return docstrings

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Let every field take a wrong value in the lenient pass; a validator of pydantic's takes longer to build."""
        schema = handler(source)
        part: Any = handler.resolve_ref_schema(schema)
        while part["type"] != "model-fields":
            part = part["schema"]
        for field in part["fields"].values():
            holder = field["schema"] if field["schema"]["type"] == "default" else field
            holder["schema"] = core_schema.with_info_wrap_validator_function(_trap, holder["schema"])
        return schema

    @model_validator(mode="before")
    @classmethod
    def _tidy_keys(cls, data: Any, info: ValidationInfo) -> Any:
        """Read ``null`` as if the key were not there; in the lenient pass repair the keys."""
        if not isinstance(data, dict):
            return data
        keys = cls.keys() | {name: name for name in cls.model_fields}
        data = {key: value for key, value in data.items() if value is not None or key not in keys}
        if not isinstance(info.context, LenientPass):
            return data
        needed = {key: UNKNOWN for key, name in cls.keys().items() if cls.model_fields[name].is_required()}
        return needed | {key: value for key, value in data.items() if key in keys}

    @model_validator(mode="after")
    def _settle(self, info: ValidationInfo) -> Self:
        if not isinstance(info.context, LenientPass):
            self.settle()
            return self
        try:
            self.settle()
        except UnknownValueError:
            pass
        except (PydanticCustomError, ScenarioError) as error:
            self._late = error
        return self


def _trap(value: Any, handler: ValidatorFunctionWrapHandler, info: ValidationInfo) -> Any:
    """The value of a field; in the lenient pass `UNKNOWN` if it is wrong."""
    if not isinstance(info.context, LenientPass):
        return handler(value)
    try:
        return UNKNOWN if value is UNKNOWN else handler(value)
    except ValidationError:
        return UNKNOWN


@cache
def _keys(schema: type[Schema]) -> dict[str, str]:
    return {key_of(schema, name): name for name in schema.model_fields}


@cache
def _attribute_docstrings(module: str) -> dict[str, dict[str, str]]:
    """Map class and attribute to docstring, for a module."""
    tree = ast.parse(inspect.getsource(sys.modules[module]))
    docstrings: dict[str, dict[str, str]] = {}
    for item in tree.body:
        if not isinstance(item, ast.ClassDef):
            continue
        texts = docstrings.setdefault(item.name, {})
        for field, doc in pairwise(item.body):
            if not (isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)):
                continue
            if isinstance(doc, ast.Expr) and isinstance(doc.value, ast.Constant) and isinstance(doc.value.value, str):
                texts[field.target.id] = inspect.cleandoc(doc.value.value)
    return docstrings


def key_of(schema: type[Schema], name: str) -> str:
    """Return the YAML key of an attribute (``from`` for ``from_``)."""
    return schema.model_fields[name].alias or name


def walk(value: object, path: Path = ()) -> Iterator[tuple[Path, Schema]]:
    """Yield every part of a scenario with its path."""
    parts: Iterable[tuple[Any, object]] = ()
    if isinstance(value, Schema):
        yield path, value
        held = value.__dict__
        parts = [(key, held.get(name)) for key, name in _keys(type(value)).items()]
    elif isinstance(value, tuple):
        parts = enumerate(value)
    elif isinstance(value, dict):
        parts = value.items()
    for key, part in parts:
        if isinstance(part, (Schema, tuple, dict)):
            yield from walk(part, (*path, key))


def tag_of(member: Any) -> str:
    """Tag of one member of a union, in angle brackets: as given, else its kind, else ``<text>`` for words."""
    for item in getattr(member, "__metadata__", ()):
        if isinstance(item, Tag):
            return item.tag
    if isinstance(member, type) and issubclass(member, Schema):
        kind = member.model_fields.get("kind")
        return f"<{kind.default}>" if kind else ""
    return "<text>" if get_origin(member) is Literal else ""


@dataclass(frozen=True)
class Variants:
    """Marks a union whose members are distinguished by a function of the raw value, see `tag_of`.

    With a message, it stands for all errors about the choice itself.
    """

    choose: Callable[[Any], str | None]
    message: str = ""
    remedy: str = ""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        choices = {tag_of(member): handler.generate_schema(member) for member in get_args(source)}
        if not self.message:
            return core_schema.tagged_union_schema(choices, self.choose)
        return core_schema.tagged_union_schema(
            choices,
            self.choose,
            custom_error_type="beamsim",
            custom_error_message=self.message,
            custom_error_context={"message": self.message, "remedy": self.remedy, "show_value": 1},
        )


def kind_of(value: Any) -> Any:
    """The kind of a raw value or of a part of a scenario, None without one."""
    return value.get("kind") if isinstance(value, dict) else getattr(value, "kind", None)


def _kind(value: Any) -> str | None:
    kind = kind_of(value)
    return f"<{kind}>" if isinstance(kind, str) else None


BY_KIND = Variants(_kind)
"""Variants distinguished by their key ``kind``."""


def word_or_kind(words: Collection[str], message: str, remedy: str) -> Variants:
    """One of the words, or a mapping whose kind is one of them."""

    def choose(value: Any) -> str | None:
        if isinstance(value, str):
            return "<text>" if value in words else None
        kind = kind_of(value)
        return f"<{kind}>" if isinstance(kind, str) and kind in words else None

    return Variants(choose, message, remedy)


def number_or_list(value: Any) -> str:
    """Tag of a number or a list of numbers: ``<number>`` and ``<list>``."""
    return "<list>" if isinstance(value, (list, tuple)) else "<number>"


def counted(number: int, noun: str, plural: str = "") -> str:
    """A number with its noun.

    >>> counted(1, "value"), counted(2, "mass", "masses")
    ('1 value', '2 masses')
    """
    return f"{number} {noun if number == 1 else plural or noun + 's'}"


def suggestion(name: str, names: Iterable[str], otherwise: str) -> str:
    """The remedy for an unknown name: the similar one, else ``otherwise`` with all of them."""
    names = list(names)
    close = get_close_matches(name, names, n=1)
    return f"did you mean {close[0]}?" if close else f"{otherwise} {', '.join(names)}"


def single_line(value: object) -> str:
    """Show a raw value as the user would write it, shortened.

    >>> single_line({"kind": "modal", "on": True})
    '{kind: modal, on: true}'
    """
    text = _flow(value)
    return text if len(text) <= LONGEST_VALUE else text[: LONGEST_VALUE - 1] + "…"


def _flow(value: object) -> str:
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return value if value and value == value.strip() and value.isprintable() else repr(value)
    if isinstance(value, float):
        return f"{value:.12g}"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_flow(item)}" for key, item in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_flow(item) for item in value) + "]"
    return str(value)
