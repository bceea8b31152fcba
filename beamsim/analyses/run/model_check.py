"""Whether the figures of a run depend on its model: the case again with a finer one and small disturbances."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from beamsim.analyses.run.convergence import (
    Convergence,
    Solution,
    behind_filter,
    check_convergence,
    march_again,
    solve_exactly,
)
from beamsim.analyses.run.derived import DerivedFigures, OutputSamples
from beamsim.analyses.run.motion import RunMotion, output_times
from beamsim.analyses.run.parting import ContactEvents
from beamsim.analyses.run.stepped_motion import stepped_motion_of
from beamsim.analyses.run.summary import figures_of_motion
from beamsim.scenario.run import OrbitStart
from beamsim.system.structural import StructuralSystem

if TYPE_CHECKING:
    from beamsim.scenario import Scenario
    from beamsim.system.shared import SharedBuilds


def convergence_of(
    scenario: Scenario,
    system: StructuralSystem,
    motion: RunMotion,
    figures: Mapping[str, Any],
    derived: DerivedFigures,
    shared: SharedBuilds,
    stop: Callable[[], bool],
) -> Convergence | None:
    """What a finer model changes; None where that is not asked for, or the run is not complete.

    ``shared`` keeps what the system was built from: a finer model may have the same matrices.
    """
    settings = scenario.run
    assert settings is not None
    if settings.convergence == "off" or not motion.outcome.complete:
        return None

    def solve(finer: StructuralSystem) -> Solution | None:
        if finer.cubic.count:
            again = stepped_motion_of(finer, settings, output_times(scenario), None, stop)
            if again.outcome.interrupted:
                return None
            assert again.contact_events is not None
            sampled = OutputSamples(again.histories.time, again.histories.values)
            return Solution(finer, settings, figures_of_motion(finer, again), again.contact_events, sampled=sampled)
        return solve_exactly(finer, settings, motion.work, stop)

    kept = {name: figures[name] for name in figures_of_motion(system, motion)}
    assert motion.contact_events is not None
    behind = behind_filter(system, settings, motion.trajectory)
    first = Solution(system, settings, kept, motion.contact_events, motion.trajectory, filtered=behind)

    def disturbed(share: float, end: float) -> ContactEvents:
        again = march_again(disturbed_system(system, share), settings, end, motion.work, stop)
        return ContactEvents.of(again, len(system.snubbers))

    checked = check_convergence(
        scenario, first, derived, shared, None if isinstance(settings.start, OrbitStart) else solve,
        None if motion.trajectory is None else disturbed,
    )  # fmt: skip
    return Convergence({}, reason="interrupted") if stop() else checked


def disturbed_system(system: StructuralSystem, share: float) -> StructuralSystem:
    """The system with its stiffness changed by a share of itself."""
    dynamics = replace(system.dynamics, stiffness=(1.0 + share) * system.dynamics.stiffness)
    return replace(system, dynamics=dynamics)
