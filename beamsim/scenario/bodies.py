"""Bodies of a scenario with several: each has a name and a kind."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Tag

from beamsim.scenario.base import Variants, kind_of
from beamsim.scenario.beam import Beam, StiffnessBeam, by_stiffness
from beamsim.scenario.chain import Chain


class NamedBeam(Beam):
    """A uniform Euler-Bernoulli beam, one of several bodies."""

    kind: Literal["beam"] = "beam"
    """A beam."""


class NamedStiffnessBeam(StiffnessBeam):
    """A uniform beam by its bending stiffness and mass per length, one of several bodies."""

    kind: Literal["beam"] = "beam"
    """A beam."""


class NamedChain(Chain):
    """A chain of masses, one of several bodies."""

    kind: Literal["chain"] = "chain"
    """A chain of masses."""


def _choose(value: Any) -> str | None:
    kind = kind_of(value)
    if kind == "beam":
        return "<beam by stiffness>" if by_stiffness(value) else "<beam>"
    return "<chain>" if kind == "chain" else None


AnyBody = Annotated[
    NamedBeam | Annotated[NamedStiffnessBeam, Tag("<beam by stiffness>")] | NamedChain,
    Variants(_choose, "has no kind of body", "give kind: beam or kind: chain"),
]
