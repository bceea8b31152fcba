"""A damped structure excited on its nonlinear normal mode."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from beamsim.errors import Problem
from beamsim.scenario.base import Schema, fail
from beamsim.scenario.excitation import Harmonic
from beamsim.scenario.quantities import Count, Level, LevelValue, Ratio

if TYPE_CHECKING:
    from beamsim.scenario.scenario import Scenario

WIDEST = 0.5
MOST_PERIODS = 10_000


class PhaseResonance(Schema):
    """The excitation holds the damped structure on the mode at phase resonance; its frequency is computed."""

    levels: tuple[Level, ...] = ()
    """Levels of the excitation, each at its own resonance; by default that of the excitation."""
    periods: Count = 50
    """Number of periods of the damped motion computed from the predicted start."""
    span: Ratio = 0.1
    """Fraction of the frequency by which the response curve extends on both sides."""

    def settle(self) -> None:
        """Reject zero levels and unusable ranges."""
        for index, level in enumerate(self.levels):
            if not level > 0:
                raise fail(f"= {level:g} sustains no motion", "give positive levels: [0.5 g, 1 g]", ("levels", index))
        if not 0.0 < self.span <= WIDEST:
            raise fail(f"= {self.span:g} must be above 0 and at most {WIDEST:g}", "give for example 10 %", ("span",))
        if self.periods > MOST_PERIODS:
            raise fail(
                f"= {self.periods} is over {MOST_PERIODS}",
                "50 are enough to show whether the motion stays",
                ("periods",),
            )


def phase_resonance_problems(scenario: Scenario) -> Iterator[Problem]:
    """Conditions on a scenario for phase resonance."""
    if scenario.nnm is None or scenario.nnm.phase_resonance is None:
        return
    section, excitation = scenario.nnm.phase_resonance, scenario.excitation
    if scenario.nnm.solver.kind == "multiple_scales":
        yield Problem("nnm.phase_resonance", "needs the exact mode, not its expansion", "use method: shooting")
    if not isinstance(excitation, Harmonic):
        yield Problem(
            "nnm.phase_resonance",
            f"needs a harmonic excitation, but this one is {excitation.kind}",
            "give excitation: {kind: harmonic, applied_to: base, level: 1 g, frequency: 50 Hz} (or a force at a "
            "position); the frequency is computed",
        )
        return
    for index, level in enumerate(section.levels):
        meant = level.quantity if isinstance(level, LevelValue) else None
        if meant not in (None, excitation.quantity):
            yield Problem(
                f"nnm.phase_resonance.levels[{index}]",
                f"is given in a unit of {meant}, and the excitation's level is of {excitation.quantity}",
                "give the levels in the unit of excitation.level",
            )
    if not section.levels and not excitation.level > 0:
        yield Problem("excitation.level", "is zero and sustains no motion", "give nnm.phase_resonance.levels")
    if excitation.on_base:
        yield from _driven_through_contacts(scenario)


def _driven_through_contacts(scenario: Scenario) -> Iterator[Problem]:
    """Springs to the ground through which a moving base excites the structure too; its work has no single conjugate."""
    where = "snubbers" if scenario.chain is None else "chain.snubbers"
    for index, snubber in enumerate(scenario.all_snubbers):
        if getattr(snubber, "mounted_on", "base") == "ground":
            yield Problem(
                f"{where}[{index}].mounted_on",
                "= ground: phase resonance does not support a moving base that excites the structure through a contact",
                "mount it on the base, or apply a point force",
            )
    for index, spring in enumerate([] if scenario.chain is None else scenario.chain.springs_to_ground):
        if spring.kind != "linear":
            yield Problem(
                f"chain.springs_to_ground[{index}].kind",
                f"= {spring.kind}: phase resonance does not support a moving base that excites the structure through a "
                "nonlinear spring",
                "apply a force to a mass instead",
            )
