"""Methods for nonlinear normal modes: a word, or a mapping with settings of the method."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator

from beamsim.scenario.base import Schema, fail, word_or_kind
from beamsim.scenario.quantities import Count, NotNegativeWhole, PositiveNumber

MOST_STEPS = 10_000
LOOSEST = 0.1  # above this value a motion is far from periodic
TIGHTEST = 1e-20  # the functional is a square: below this it is round-off


class ShootingMethod(Schema):
    """Brake orbits (at rest twice per period), exact, by shooting over half a period."""

    kind: Literal["shooting"] = "shooting"
    """Half-period shooting."""


class FullPeriodMethod(Schema):
    """Exact motions, including non-brake orbits, by shooting over the whole period."""

    kind: Literal["full_period"] = "full_period"
    """Full-period shooting with a phase condition."""
    branches: NotNegativeWhole = 3
    """Largest number of branches of non-brake orbits to follow from their bifurcations; 0 for none."""
    points: Count = 120
    """Largest number of points on each of these branches."""


class ExpansionMethod(Schema):
    """The expansion for weak springs, compared with exact motions."""

    kind: Literal["multiple_scales"] = "multiple_scales"
    """Method of multiple scales."""


class RelaxedMinimisationMethod(Schema):
    """Relaxed minimisation of the deviation from periodicity (Hazim 2010), compared with exact motions."""

    kind: Literal["relaxed_minimisation"] = "relaxed_minimisation"
    """Relaxed minimisation."""
    steps: Count = 75
    """Number of equal steps in the stiffness factor."""
    tolerance: PositiveNumber = 1e-5
    """Value of the functional, over twice the energy of the motion (no unit), below which a step is accepted."""
    iterations: Count = 200
    """Largest number of iterations of the optimiser in each step."""

    def settle(self) -> None:
        """Reject numbers that are meaningless or impossible."""
        if self.steps > MOST_STEPS:
            raise fail(f"= {self.steps} is over {MOST_STEPS}", "Hazim (2010) used 35 to 75", ("steps",))
        if not TIGHTEST <= self.tolerance <= LOOSEST:
            raise fail(
                f"= {self.tolerance:g} is not between {TIGHTEST:g} and {LOOSEST:g}: the functional is the square of a "
                "relative deviation",
                "Hazim (2010) used 1e-5 and 1e-6",
                ("tolerance",),
            )


Solver = ShootingMethod | FullPeriodMethod | ExpansionMethod | RelaxedMinimisationMethod

_SOLVERS: dict[str, type[Solver]] = {
    "shooting": ShootingMethod,
    "full_period": FullPeriodMethod,
    "multiple_scales": ExpansionMethod,
    "relaxed_minimisation": RelaxedMinimisationMethod,
}


OLD_NAMES = {"thesis": "relaxed_minimisation"}
"""Names that are still accepted."""


def _renamed(value: Any) -> Any:
    """A method under its present name."""
    if isinstance(value, dict) and isinstance(value.get("kind"), str):
        return {**value, "kind": OLD_NAMES.get(value["kind"], value["kind"])}
    return OLD_NAMES.get(value, value) if isinstance(value, str) else value


Method = Annotated[
    Literal["shooting", "full_period", "multiple_scales", "relaxed_minimisation"] | Solver,
    word_or_kind(
        _SOLVERS,
        "is not a known method",
        "write shooting, full_period, multiple_scales or relaxed_minimisation, or a mapping such as "
        "{kind: relaxed_minimisation, steps: 75, tolerance: 1e-5}",
    ),
    BeforeValidator(_renamed),
]


def solver_of(method: str | Solver) -> Solver:
    """The method with its settings; a word selects the defaults."""
    return _SOLVERS[method]() if isinstance(method, str) else method
