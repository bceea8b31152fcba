"""Data classes whose methods are compiled when they are first called.

`dataclasses.dataclass` writes the source of up to seven methods of a class and compiles each, half a millisecond for a
class: an eighth of ``beamsim validate``, most of it for methods that are never called. Here ``__init__`` is compiled
when the first object is made, and the others go through the fields. Fields, `dataclasses.replace` and the like, and
what type checkers see are those of the standard library.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from operator import attrgetter
from reprlib import recursive_repr
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass
else:

    def dataclass(cls=None, /, *, frozen=False, eq=True, kw_only=False):
        """As `dataclasses.dataclass`, of whose options it has three; a class that compares by itself gives its hash."""
        if cls is None:
            return lambda made: dataclass(made, frozen=frozen, eq=eq, kw_only=kw_only)
        own = dict(vars(cls))
        cls.__doc__ = cls.__doc__ or f"{cls.__name__}."  # it would be the signature, which compiles
        dataclasses.dataclass(cls, init=False, repr=False, eq=False, kw_only=kw_only)
        fields = dataclasses.fields(cls)
        methods = {"__init__": _CompiledLater(cls, frozen), "__repr__": _representation(fields)}
        if eq:
            values = _values_of(fields)
            methods["__eq__"] = _equality(values)
            methods["__hash__"] = _hash(values) if frozen else None
        for name, method in methods.items():
            if name not in own:
                setattr(cls, name, method)
        if frozen:
            _freeze(cls, frozenset(field.name for field in fields))
        return cls


class _Made:
    """Default of a parameter whose value is made by a function if it is not given."""

    def __repr__(self) -> str:
        return "<factory>"


class _CompiledLater:
    """The method ``__init__`` of a class, in whose place the compiled one comes when it is first asked for."""

    def __init__(self, owner: type, frozen: bool) -> None:
        self._owner, self._frozen = owner, frozen

    def __get__(self, instance: Any, cls: type | None = None) -> Any:
        function = _compiled(self._owner, self._frozen)
        self._owner.__init__ = function  # type: ignore[misc]
        return function if instance is None else function.__get__(instance, cls)


def _compiled(cls: type, frozen: bool) -> Callable[..., None]:
    """The method ``__init__`` of a data class."""
    fields: tuple[dataclasses.Field[Any], ...] = dataclasses.fields(cls)
    known: dict[str, Any] = {"_put": object.__setattr__, "_made": _Made()}
    given: dict[bool, list[str]] = {False: [], True: []}  # by whether it is given by keyword only
    body = []
    for field in fields:
        name, value = field.name, field.name
        if field.default_factory is not dataclasses.MISSING:
            known[f"_make_{name}"], value = field.default_factory, f"_make_{name}()"
            if field.init:
                given[bool(field.kw_only)].append(f"{name}=_made")
                value = f"{value} if {name} is _made else {name}"
        elif not field.init:
            continue
        elif field.default is not dataclasses.MISSING:
            known[f"_default_{name}"] = field.default
            given[bool(field.kw_only)].append(f"{name}=_default_{name}")
        else:
            given[bool(field.kw_only)].append(name)
        body.append(f"_put(self, {name!r}, {value})" if frozen else f"self.{name} = {value}")
    if hasattr(cls, "__post_init__"):
        body.append("self.__post_init__()")
    parameters = ["self", *given[False], *(["*", *given[True]] if given[True] else [])]
    exec(f"def __init__({', '.join(parameters)}):\n " + "\n ".join(body or ["pass"]), known)
    function: Callable[..., None] = known["__init__"]
    function.__qualname__, function.__module__ = f"{cls.__qualname__}.__init__", cls.__module__
    function.__annotations__ = {field.name: field.type for field in fields if field.init} | {"return": None}
    return function


def _representation(fields: tuple[dataclasses.Field[Any], ...]) -> Callable[[Any], str]:
    names = [field.name for field in fields if field.repr]

    @recursive_repr()
    def __repr__(self: Any) -> str:
        return f"{type(self).__qualname__}({', '.join(f'{name}={getattr(self, name)!r}' for name in names)})"

    return __repr__


def _values_of(fields: tuple[dataclasses.Field[Any], ...]) -> Callable[[Any], tuple[Any, ...]]:
    """What objects are compared by."""
    names = [field.name for field in fields if field.compare]
    if len(names) > 1:
        return attrgetter(*names)
    return lambda self: tuple(getattr(self, name) for name in names)


def _equality(values: Callable[[Any], tuple[Any, ...]]) -> Callable[[Any, Any], bool]:
    def __eq__(self: Any, other: Any) -> bool:
        return values(self) == values(other) if other.__class__ is self.__class__ else NotImplemented

    return __eq__


def _hash(values: Callable[[Any], tuple[Any, ...]]) -> Callable[[Any], int]:
    def __hash__(self: Any) -> int:
        return hash(values(self))

    return __hash__


def _freeze(cls: Any, names: frozenset[str]) -> None:
    """Refuse to set or delete fields, and anything else of the class itself."""

    def __setattr__(self: Any, name: str, value: Any) -> None:
        if type(self) is cls or name in names:
            raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")
        super(cls, self).__setattr__(name, value)

    def __delattr__(self: Any, name: str) -> None:
        if type(self) is cls or name in names:
            raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")
        super(cls, self).__delattr__(name)

    cls.__setattr__, cls.__delattr__ = __setattr__, __delattr__
