"""Sections whose classes are defined, and whose validators are built, when a scenario has such a section.

Those of all sections take a third of the processor time of `beamsim validate`, and most scenarios have a body and an
analysis. The JSON Schema is made of all of them.
"""

from __future__ import annotations

from functools import cache, reduce
from importlib import import_module
from operator import or_
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import GetCoreSchemaHandler, TypeAdapter, ValidationInfo
from pydantic_core import CoreSchema, core_schema

from beamsim.dataclass import dataclass


def on_demand(module: str, name: str) -> Any:
    """The type of a field that holds what ``name`` of a module is: a class, or a union of classes."""
    return Annotated[Any, OnDemand(module, name)]


def resolved(annotation: Any) -> Any:
    """A field's annotation with the types themselves."""
    for mark in getattr(annotation, "__metadata__", ()):
        if isinstance(mark, OnDemand):
            return mark.annotation
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin not in (Union, UnionType, tuple, dict):
        return annotation
    parts = tuple(map(resolved, arguments))
    return reduce(or_, parts) if origin in (Union, UnionType) else origin[parts]


@dataclass(frozen=True)
class OnDemand:
    """Marks a field whose type is imported when it is first needed."""

    module: str
    name: str

    @property
    def annotation(self) -> Any:
        """The type itself."""
        return getattr(import_module(self.module), self.name)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.with_info_plain_validator_function(self._validated)

    def _validated(self, value: Any, info: ValidationInfo) -> Any:
        return _adapter(self).validate_python(value, context=info.context)


@cache
def _adapter(section: OnDemand) -> TypeAdapter[Any]:
    return TypeAdapter(section.annotation)
