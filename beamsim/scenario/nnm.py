"""Nonlinear normal modes."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, Tag

from beamsim.scenario.base import BY_KIND, Schema, fail
from beamsim.scenario.quantities import Count, Energy, Factor, Frequency

__all__ = [
    "ContinueIn",
    "EnergyContinuation",
    "FrequencyContinuation",
    "NonlinearMode",
    "StiffnessFactorContinuation",
]


class StiffnessFactorContinuation(Schema):
    """The nonlinear springs' stiffness grows from nothing to its full value."""

    kind: Literal["stiffness_factor"] = "stiffness_factor"
    """Factor of the snubbers' and nonlinear springs' stiffness."""
    from_: Factor = Field(default=0.0, alias="from")
    """First factor; 0 is the linear mode."""
    to: Factor = 1.0
    """Last factor; 1 is the full stiffness."""

    def settle(self) -> None:
        """Refuse an empty range."""
        _refuse_empty(self.from_, self.to)


class EnergyContinuation(Schema):
    """The energy changes."""

    kind: Literal["energy"] = "energy"
    """Energy, measured from static equilibrium."""
    from_: Energy = Field(alias="from")
    """First energy."""
    to: Energy
    """Last energy."""

    def settle(self) -> None:
        """Refuse an empty range."""
        _refuse_empty(self.from_, self.to)


class FrequencyContinuation(Schema):
    """The frequency changes."""

    kind: Literal["frequency"] = "frequency"
    """Frequency of the motion."""
    from_: Frequency = Field(alias="from")
    """First frequency."""
    to: Frequency
    """Last frequency."""

    def settle(self) -> None:
        """Refuse an empty range."""
        _refuse_empty(self.from_, self.to)


def _refuse_empty(first: float, last: float) -> None:
    if first == last:
        raise fail(f"= {last:g} is where the continuation begins", "give a range", ("to",))


ContinueIn = Annotated[
    Annotated[StiffnessFactorContinuation, Tag("<stiffness_factor>")]
    | Annotated[EnergyContinuation, Tag("<energy>")]
    | Annotated[FrequencyContinuation, Tag("<frequency>")],
    BY_KIND,
]


class NonlinearMode(Schema):
    """Which nonlinear normal mode, and what to follow it in."""

    mode: Count
    """Number of the linear mode it starts from, from 1."""
    energy: Energy | None = None
    """Energy of the motion while the stiffness factor changes."""
    continue_in: ContinueIn = StiffnessFactorContinuation()
    """The parameter that changes: stiffness_factor, energy or frequency."""
    method: Literal["shooting", "multiple_scales"] = "shooting"
    """Exact periodic motions (shooting), or their expansion for weak springs (multiple_scales)."""

    def settle(self) -> None:
        """Refuse an energy where it is what changes, and an expansion in anything but the stiffness factor."""
        if self.method == "multiple_scales" and not isinstance(self.continue_in, StiffnessFactorContinuation):
            raise fail(
                f"= multiple_scales expands in the stiffness factor, not in the {self.continue_in.kind}",
                "use continue_in: stiffness_factor, or method: shooting",
                ("method",),
            )
        if self.energy is not None and not isinstance(self.continue_in, StiffnessFactorContinuation):
            raise fail(f"cannot be held while the {self.continue_in.kind} changes", "leave energy out", ("energy",))
