"""Nonlinear normal modes: their parameter, methods, and damped structures excited on them."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from beamsim.scenario import quantities as q
from beamsim.scenario import units
from beamsim.scenario.base import BY_FORM, Schema, Variants, fail
from beamsim.scenario.excitation import Span

Tolerance = Annotated[float, q.Quantity(replace(units.NUMBER, example="1e-5"), minimum=1e-20, maximum=0.1)]
"""Of the functional, the square of a relative deviation: below it is round-off, above a motion is far from periodic."""
ShareOfFrequency = Annotated[float, q.Quantity(replace(units.RATIO, example="10 %"), above=0.0, maximum=0.5)]


class ShootingMethod(Schema):
    """Brake orbits (at rest twice per period), exact, by shooting over half a period."""

    kind: Literal["shooting"] = "shooting"
    """Half-period shooting."""


class FullPeriodMethod(Schema):
    """Exact motions, including non-brake orbits, by shooting over the whole period."""

    kind: Literal["full_period"] = "full_period"
    """Full-period shooting with a phase condition."""
    branches: q.NotNegativeWhole = 3
    """Largest number of branches of non-brake orbits to follow from their bifurcations; 0 for none."""
    points: q.Count = 120
    """Largest number of points on each of these branches."""


class ExpansionMethod(Schema):
    """The expansion for weak springs, compared with exact motions."""

    kind: Literal["multiple_scales"] = "multiple_scales"
    """Method of multiple scales."""


class RelaxedMinimisationMethod(Schema):
    """Relaxed minimisation of the deviation from periodicity (Hazim 2010), compared with exact motions."""

    kind: Literal["relaxed_minimisation"] = "relaxed_minimisation"
    """Relaxed minimisation."""
    steps: Annotated[int, q.Whole(1, 10_000)] = 75
    """Number of equal steps in the stiffness factor."""
    tolerance: Tolerance = 1e-5
    """Value of the functional, over twice the energy of the motion (no unit), below which a step is accepted."""
    iterations: q.Count = 200
    """Largest number of iterations of the optimiser in each step."""


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
    Variants(
        "is not a known method",
        "write shooting, full_period, multiple_scales or relaxed_minimisation, or a mapping such as "
        "{kind: relaxed_minimisation, steps: 75, tolerance: 1e-5}",
    ),
    BeforeValidator(_renamed),
]


class PhaseResonance(Schema):
    """The excitation holds the damped structure on the mode at phase resonance; its frequency is computed."""

    levels: tuple[q.PositiveLevel, ...] = ()
    """Levels of the excitation, each at its own resonance; by default that of the excitation."""
    periods: Annotated[int, q.Whole(1, 10_000)] = 50
    """Number of periods of the damped motion computed from the predicted start."""
    span: ShareOfFrequency = 0.1
    """Fraction of the frequency by which the response curve extends on both sides."""


class StiffnessFactorContinuation(Span[q.Factor]):
    """The stiffness of the nonlinear springs increases from zero to its full value."""

    kind: Literal["stiffness_factor"] = "stiffness_factor"
    """Factor on the stiffness of snubbers and nonlinear springs."""
    from_: q.Factor = Field(default=0.0, alias="from")
    """First factor; 0 is the linear mode."""
    to: q.Factor = 1.0
    """Last factor; 1 is the full stiffness."""


class EnergyContinuation(Span[q.Energy]):
    """The energy changes."""

    kind: Literal["energy"] = "energy"
    """Energy relative to static equilibrium."""


class FrequencyContinuation(Span[q.Frequency]):
    """The frequency changes."""

    kind: Literal["frequency"] = "frequency"
    """Frequency of the motion."""


ContinueIn = Annotated[StiffnessFactorContinuation | EnergyContinuation | FrequencyContinuation, BY_FORM]


_IN_FACTOR = {"multiple_scales": "expands in", "relaxed_minimisation": "takes its steps in"}


class NonlinearMode(Schema):
    """The nonlinear normal mode and its continuation parameter."""

    mode: q.Count
    """Number of the linear mode from which it starts, from 1."""
    energy: q.Energy | None = None
    """Energy of the motion if the stiffness factor is the parameter."""
    continue_in: ContinueIn = StiffnessFactorContinuation.model_construct()
    """The parameter that changes: stiffness_factor, energy or frequency."""
    method_: Method = Field(default="shooting", alias="method")
    """shooting (over half a period, exact), full_period (exact, also non-brake orbits), multiple_scales (the
    expansion for weak springs) or relaxed_minimisation (Hazim 2010, for comparison)."""
    energies: tuple[q.Energy, ...] = ()
    """Energies at which the backbone and its tongues get a point; if the stiffness factor is the parameter, none."""
    frequencies: tuple[q.Frequency, ...] = ()
    """Frequencies at which they get a point, whatever the parameter is."""
    phase_resonance: PhaseResonance | None = None
    """Excite the damped structure at phase resonance with the mode."""
    convergence: Literal["on", "off"] | None = None
    """Whether values are compared with those of a finer model; by default off."""

    def check(self) -> None:
        """Refuse an energy where it is what changes, and methods that follow the factor only."""
        going, kind = self.continue_in, self.method.kind
        if kind in _IN_FACTOR and not isinstance(going, StiffnessFactorContinuation):
            raise fail(
                f"= {kind} {_IN_FACTOR[kind]} the stiffness factor, not in the {going.kind}",
                "use continue_in: {kind: stiffness_factor}, or method: shooting",
                ("method",),
            )
        if kind == "full_period" and isinstance(going, FrequencyContinuation):
            raise fail(
                "= full_period continues in the stiffness factor or the energy, not in the frequency",
                "use continue_in: {kind: energy, ...}, or method: shooting",
                ("method",),
            )
        if self.energies and isinstance(going, StiffnessFactorContinuation):
            raise fail(
                "differ from the energy that the path in the stiffness factor holds constant",
                "use continue_in: {kind: energy, ...}, or leave them out",
                ("energies",),
            )
        if (self.energies or self.frequencies) and kind in _IN_FACTOR:
            raise fail(f"= {kind} computes no points on request", "use method: shooting", ("method",))
        if isinstance(going, EnergyContinuation):
            going.demand_inside(self.energies, ("energies",))
        if isinstance(going, FrequencyContinuation):
            going.demand_inside(self.frequencies, ("frequencies",))
        if self.energy is not None and not isinstance(going, StiffnessFactorContinuation):
            raise fail(f"cannot be held constant if the parameter is the {going.kind}", "leave energy out", ("energy",))

    @property
    def method(self) -> Solver:
        """The method with its settings; a word selects the defaults."""
        return _SOLVERS[self.method_]() if isinstance(self.method_, str) else self.method_
