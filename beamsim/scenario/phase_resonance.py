"""A damped structure excited on its nonlinear normal mode."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from beamsim.errors import Problem
from beamsim.scenario.base import Schema, fail, path_text
from beamsim.scenario.excitation import Harmonic, level_problems
from beamsim.scenario.moved_support import MovedSupport
from beamsim.scenario.quantities import Count, Level, Ratio
from beamsim.scenario.spring import OnMass

if TYPE_CHECKING:
    from beamsim.scenario.whole import ScenarioParts

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


def phase_resonance_problems(scenario: ScenarioParts, section: PhaseResonance, method: str) -> Iterator[Problem]:
    """What a scenario lacks, or has too much of, to hold its mode by a force; ``method`` is that of the mode."""
    excitation = scenario.excitation
    if method == "multiple_scales":
        yield Problem("nnm.phase_resonance", "needs the exact mode, not its expansion", "use method: shooting")
    if not isinstance(excitation, Harmonic):
        yield Problem(
            "nnm.phase_resonance",
            f"needs a harmonic excitation, but this one is {excitation.kind}",
            "give excitation: {kind: harmonic, applied_to: base, level: 1 g, frequency: 50 Hz} (or a force at a "
            "position); the frequency is computed",
        )
        return
    if isinstance(excitation.applied_to, MovedSupport):
        yield Problem(
            "excitation.applied_to", "is a support that moves, which phase resonance does not account for",
            "move the base (applied_to: base), or apply a force",
        )  # fmt: skip
        return
    for index, level in enumerate(section.levels):
        yield from level_problems(excitation, ("nnm", "phase_resonance", "levels", index), level)
    if not section.levels and not excitation.level > 0:
        yield Problem("excitation.level", "is zero and sustains no motion", "give nnm.phase_resonance.levels")
    if excitation.on_base:
        yield from _driven_through_contacts(scenario)


def _driven_through_contacts(scenario: ScenarioParts) -> Iterator[Problem]:
    """Springs to the ground through which a moving base excites the structure too; its work has no single conjugate."""
    for path, _, snubber in scenario.located_snubbers:
        if getattr(snubber, "mounted_on", "base") == "ground":
            yield Problem(
                f"{path_text(path)}.mounted_on",
                "= ground lets the moving base push through the contact too, which phase resonance does not account "
                "for",
                "mount it on the base, or apply a point force",
            )
    for path, _, spring in scenario.nonlinear_springs:
        if isinstance(spring, OnMass):
            yield Problem(
                f"{path_text(path)}.kind",
                f"= {getattr(spring, 'kind', '')} lets the moving base push through a nonlinear spring, which phase "
                "resonance does not account for",
                "apply a force to a mass instead",
            )
