"""Nonlinear normal modes."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from beamsim.scenario.base import BY_KIND, Schema, fail, known
from beamsim.scenario.nnm_method import Method, Solver, solver_of
from beamsim.scenario.phase_resonance import PhaseResonance
from beamsim.scenario.quantities import Count, Energy, Factor, Frequency
from beamsim.scenario.ranges import Span


class StiffnessFactorContinuation(Span[Factor]):
    """The stiffness of the nonlinear springs increases from zero to its full value."""

    kind: Literal["stiffness_factor"] = "stiffness_factor"
    """Factor on the stiffness of snubbers and nonlinear springs."""
    from_: Factor = Field(default=0.0, alias="from")
    """First factor; 0 is the linear mode."""
    to: Factor = 1.0
    """Last factor; 1 is the full stiffness."""


class EnergyContinuation(Span[Energy]):
    """The energy changes."""

    kind: Literal["energy"] = "energy"
    """Energy relative to static equilibrium."""


class FrequencyContinuation(Span[Frequency]):
    """The frequency changes."""

    kind: Literal["frequency"] = "frequency"
    """Frequency of the motion."""


ContinueIn = Annotated[StiffnessFactorContinuation | EnergyContinuation | FrequencyContinuation, BY_KIND]


_IN_FACTOR = {"multiple_scales": "expands in", "relaxed_minimisation": "takes its steps in"}


class NonlinearMode(Schema):
    """The nonlinear normal mode and its continuation parameter."""

    mode: Count
    """Number of the linear mode from which it starts, from 1."""
    energy: Energy | None = None
    """Energy of the motion if the stiffness factor is the parameter."""
    continue_in: ContinueIn = StiffnessFactorContinuation.model_construct()
    """The parameter that changes: stiffness_factor, energy or frequency."""
    method: Method = "shooting"
    """shooting (over half a period, exact), full_period (exact, also non-brake orbits), multiple_scales (the
    expansion for weak springs) or relaxed_minimisation (Hazim 2010, for comparison)."""
    energies: tuple[Energy, ...] = ()
    """Energies at which the backbone and its tongues get a point; if the stiffness factor is the parameter, none."""
    frequencies: tuple[Frequency, ...] = ()
    """Frequencies at which they get a point, whatever the parameter is."""
    phase_resonance: PhaseResonance | None = None
    """Excite the damped structure at phase resonance with the mode."""

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
        for name, values in (("energies", self.energies), ("frequencies", self.frequencies)):
            if going.kind == {"energies": "energy", "frequencies": "frequency"}[name]:
                low, high = sorted((float(going.from_), float(going.to)))
                for k, value in enumerate(values):
                    if not low <= value <= high:
                        raise fail(
                            f"= {value:g} lies outside the range", f"give a value from {low:g} to {high:g}", (name, k)
                        )
        if self.energy is not None and not isinstance(going, StiffnessFactorContinuation):
            raise fail(f"cannot be held constant if the parameter is the {going.kind}", "leave energy out", ("energy",))

    @property
    def solver(self) -> Solver:
        """The method with its settings."""
        return solver_of(self.method)
