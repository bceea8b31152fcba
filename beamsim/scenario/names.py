"""Items of a list that have a name, given or by default."""

from __future__ import annotations

from typing import TypeVar

from beamsim.scenario.base import Schema, known
from beamsim.scenario.quantities import Name


class Named(Schema):
    """Something with a name."""

    name: Name = ""
    """Name, unique; made of the kind and a number by default."""


DEFAULT_NAMES = {
    "snubbers": "snubber",
    "springs_to_ground": "ground_spring",
    "springs_between": "link_spring",
    "joints": "joint",
    "friction": "friction",
}
"""Lists whose items have a name by default: this and their number."""

AnyNamed = TypeVar("AnyNamed", bound=Named)


def named(items: tuple[AnyNamed, ...], key: str) -> tuple[AnyNamed, ...]:
    """Give items of a list without a name their default one: see `DEFAULT_NAMES`, numbered from 1."""
    prefix = DEFAULT_NAMES[key]
    return tuple(
        item if not known(item) or not known(item.name) or item.name else item.model_copy(update={"name": name})
        for item, name in ((item, f"{prefix}_{number}") for number, item in enumerate(items, start=1))
    )
