"""Bodies of a scenario with several: each has a name and a kind."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Tag

from beamsim.scenario.base import Variants, kind_of
from beamsim.scenario.beam import Beam, SandwichBeam, SegmentedBeam, StiffnessBeam, beam_tag
from beamsim.scenario.chain import Chain
from beamsim.scenario.matrices import MatricesBody
from beamsim.scenario.plate import Plate, StiffnessPlate, plate_by_stiffness


class NamedBeam(Beam):
    """A uniform Euler-Bernoulli beam, one of several bodies."""

    kind: Literal["beam"] = "beam"
    """A beam."""


class NamedStiffnessBeam(StiffnessBeam):
    """A uniform beam by its bending stiffness and mass per length, one of several bodies."""

    kind: Literal["beam"] = "beam"
    """A beam."""


class NamedSandwichBeam(SandwichBeam):
    """A uniform beam of two faces and a core, one of several bodies."""

    kind: Literal["beam"] = "beam"
    """A beam."""


class NamedSegmentedBeam(SegmentedBeam):
    """A beam of segments, one of several bodies."""

    kind: Literal["beam"] = "beam"
    """A beam."""


class NamedChain(Chain):
    """A chain of masses, one of several bodies."""

    kind: Literal["chain"] = "chain"
    """A chain of masses."""


_BEAMS = {"<section>": "", "<stiffness>": " by stiffness", "<sandwich>": " of sandwich", "<segments>": " of segments"}


class NamedMatricesBody(MatricesBody):
    """A structure by matrices of another program, one of several bodies."""

    kind: Literal["matrices"] = "matrices"
    """Imported matrices."""


def _choose(value: Any) -> str | None:
    kind = kind_of(value)
    if kind == "beam":
        return f"<beam{_BEAMS[beam_tag(value)]}>"
    if kind == "plate":
        return "<plate by stiffness>" if plate_by_stiffness(value) else "<plate>"
    return f"<{kind}>" if kind in ("chain", "matrices") else None


AnyBody = Annotated[
    NamedBeam
    | Annotated[NamedStiffnessBeam, Tag("<beam by stiffness>")]
    | Annotated[NamedSandwichBeam, Tag("<beam of sandwich>")]
    | Annotated[NamedSegmentedBeam, Tag("<beam of segments>")]
    | NamedChain
    | NamedMatricesBody
    | Plate
    | Annotated[StiffnessPlate, Tag("<plate by stiffness>")],
    Variants(_choose, "does not say which kind of body it is", "give kind: beam, chain, plate or matrices"),
]
