"""Nonlinear normal modes."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, Tag

from beamsim.scenario.base import BY_KIND, Schema, fail, known
from beamsim.scenario.nnm_method import Method, Solver, solver_of
from beamsim.scenario.phase_resonance import PhaseResonance
from beamsim.scenario.quantities import Count, Energy, Factor, Frequency


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


_IN_FACTOR = {"multiple_scales": "expands in", "thesis": "takes its steps in"}


class NonlinearMode(Schema):
    """Which nonlinear normal mode, and what to follow it in."""

    mode: Count
    """Number of the linear mode it starts from, from 1."""
    energy: Energy | None = None
    """Energy of the motion while the stiffness factor changes."""
    continue_in: ContinueIn = StiffnessFactorContinuation()
    """The parameter that changes: stiffness_factor, energy or frequency."""
    method: Method = "shooting"
    """shooting (over half a period, exact), full_period (exact, also motions never at rest), multiple_scales (the
    expansion for weak springs) or thesis (relaxed minimisation, for comparison)."""
    phase_resonance: PhaseResonance | None = None
    """Excite the damped structure on the mode."""

    def settle(self) -> None:
        """Resolve the method; refuse an energy where it is what changes, and methods that follow the factor only."""
        if known(self.method):
            self.resolve("method", solver_of(self.method))
        going, kind = self.continue_in, self.solver.kind
        if kind in _IN_FACTOR and not isinstance(going, StiffnessFactorContinuation):
            raise fail(
                f"= {kind} {_IN_FACTOR[kind]} the stiffness factor, not in the {going.kind}",
                "use continue_in: {kind: stiffness_factor}, or method: shooting",
                ("method",),
            )
        if kind == "full_period" and isinstance(going, FrequencyContinuation):
            raise fail(
                "= full_period goes on in the stiffness factor or the energy, not in the frequency",
                "use continue_in: {kind: energy, ...}, or method: shooting",
                ("method",),
            )
        if self.energy is not None and not isinstance(going, StiffnessFactorContinuation):
            raise fail(f"cannot be held while the {going.kind} changes", "leave energy out", ("energy",))

    @property
    def solver(self) -> Solver:
        """The method with its numbers."""
        return solver_of(self.method)
