"""How nonlinear normal modes are found: a word, or a mapping with the method's own numbers."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Tag

from beamsim.scenario.base import Schema, by_key, fail
from beamsim.scenario.quantities import Count, NotNegativeWhole, PositiveNumber

MOST_STEPS = 10_000
LOOSEST = 0.1  # a functional beyond this is no periodic motion by anybody's measure
TIGHTEST = 1e-20  # the functional is a square: below this it is round-off


class ShootingMethod(Schema):
    """Exact motions that are at rest twice a period, by shooting over half of it."""

    kind: Literal["shooting"] = "shooting"
    """Half-period shooting."""


class FullPeriodMethod(Schema):
    """Exact motions by shooting over the whole period, also such as are never at rest."""

    kind: Literal["full_period"] = "full_period"
    """Full-period shooting with a phase condition."""
    branches: NotNegativeWhole = 3
    """Follow at most so many branches of motions never at rest from where they leave the mode; 0 for none."""
    points: Count = 120
    """Points of each of these branches at most."""


class ExpansionMethod(Schema):
    """The expansion for weak springs, beside exact motions."""

    kind: Literal["multiple_scales"] = "multiple_scales"
    """Method of multiple scales."""


class ThesisMethod(Schema):
    """The thesis's relaxed minimisation of how far a motion is from periodic, beside exact motions."""

    kind: Literal["thesis"] = "thesis"
    """Relaxed minimisation."""
    steps: Count = 75
    """Steps in the stiffness factor, all of one size."""
    tolerance: PositiveNumber = 1e-5
    """A step is done when the functional falls below this."""
    iterations: Count = 200
    """Iterations of the optimiser at each step at most."""

    def settle(self) -> None:
        """Refuse numbers that ask for nothing or for the impossible."""
        if self.steps > MOST_STEPS:
            raise fail(f"= {self.steps} is over {MOST_STEPS}", "the thesis took 35 to 75", ("steps",))
        if not TIGHTEST <= self.tolerance <= LOOSEST:
            raise fail(
                f"= {self.tolerance:g} is not between {TIGHTEST:g} and {LOOSEST:g}: the functional is the square of a "
                "relative miss",
                "the thesis took 1e-5 and 1e-6",
                ("tolerance",),
            )


Solver = ShootingMethod | FullPeriodMethod | ExpansionMethod | ThesisMethod

_SOLVERS: dict[str, type[Solver]] = {
    "shooting": ShootingMethod,
    "full_period": FullPeriodMethod,
    "multiple_scales": ExpansionMethod,
    "thesis": ThesisMethod,
}


def _choose(value: Any) -> str | None:
    if isinstance(value, str):
        return "<text>" if value in _SOLVERS else None
    kind = value.get("kind") if isinstance(value, dict) else getattr(value, "kind", None)
    return f"<{kind}>" if isinstance(kind, str) and kind in _SOLVERS else None


Method = Annotated[
    Annotated[Literal["shooting", "full_period", "multiple_scales", "thesis"], Tag("<text>")]
    | Annotated[ShootingMethod, Tag("<shooting>")]
    | Annotated[FullPeriodMethod, Tag("<full_period>")]
    | Annotated[ExpansionMethod, Tag("<multiple_scales>")]
    | Annotated[ThesisMethod, Tag("<thesis>")],
    by_key(
        _choose,
        "is no method",
        "write shooting, full_period, multiple_scales or thesis, or a mapping such as "
        "{kind: thesis, steps: 75, tolerance: 1e-5}",
    ),
]


def solver_of(method: str | Solver) -> Solver:
    """The method with its numbers; a word stands for the defaults."""
    return _SOLVERS[method]() if isinstance(method, str) else method
