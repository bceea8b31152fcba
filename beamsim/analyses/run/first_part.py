"""Whether the figures of a run depend on its model, where the motion does not fit into the memory: its first part."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from beamsim.analyses.run.convergence import Convergence, followed_to_the_end
from beamsim.analyses.run.derived import DerivedFigures
from beamsim.analyses.run.exact_motion import exact_motion_of, motion_in_stretches
from beamsim.analyses.run.figures import static_figures
from beamsim.analyses.run.model_check import convergence_of, disturbed_system
from beamsim.analyses.run.motion import RunMotion, output_times, spectra_of
from beamsim.analyses.run.parting import ContactEvents
from beamsim.analyses.run.summary import figures_of_motion
from beamsim.system.build import build_system
from beamsim.system.structural import StructuralSystem

if TYPE_CHECKING:
    from beamsim.scenario import Run, Scenario
    from beamsim.scenario.excitation import RandomInput
    from beamsim.system.shared import SharedBuilds


def checked_on_first_part(
    scenario: Scenario, system: StructuralSystem, motion: RunMotion, shared: SharedBuilds, stop: Callable[[], bool]
) -> Convergence | None:
    """What a finer model changes in the first part, and when a disturbance changes the contacts of the whole motion.

    Parameters
    ----------
    scenario, system : of the run.
    motion : that is not kept as a whole.
    shared : what the system was built from.
    stop : asked several times a second whether to give up.

    Returns
    -------
    Convergence | None
        None where it is not asked for, or the run is not complete.
    """
    settings, excitation = scenario.run, scenario.excitation
    assert settings is not None
    assert motion.compared_s is not None
    assert excitation.kind == "random"
    if settings.convergence == "off" or not motion.outcome.complete:
        return None
    duration = motion.compared_s
    first = _first_part_of(scenario, excitation, settings, duration)
    assert first.run is not None
    of_part = build_system(first, shared, assessed=False)
    part = exact_motion_of(of_part, first.run, output_times(first), None, stop)
    if not part.outcome.complete:
        return Convergence({}, reason="interrupted" if part.outcome.interrupted else part.outcome.text)
    spectra = spectra_of(first, of_part, part)
    probes = {probe.name for probe in of_part.probes}
    of_probes = {key: spectra[key] for key in spectra if key[0] in probes}
    derived = DerivedFigures(first, of_probes, None, np.zeros(0), None)
    checked = convergence_of(first, of_part, part, figures_of_motion(of_part, part), derived, shared, stop)
    if checked is None:
        return None
    assert motion.contact_events is not None

    def disturbed(share: float, end: float) -> ContactEvents:
        again = disturbed_system(system, share)
        most = 4 * motion.work.events + 1000
        marched, _ = motion_in_stretches(again, settings, most_events=most, stop=stop)
        for stretch in marched.stretches():
            if stretch.end >= end:
                break
        return ContactEvents.of(marched, len(again.snubbers)).until(min(end, marched.end))

    known = static_figures(system)
    figures = {name: value for name, value in figures_of_motion(system, motion).items() if name not in known}
    whole = followed_to_the_end(checked, duration, motion.contact_events, disturbed, figures)
    return replace(checked, reason="interrupted") if stop() else replace(whole, lines={})


def _first_part_of(scenario: Scenario, excitation: RandomInput, settings: Run, duration: float) -> Scenario:
    """The scenario of a shorter run under the same input."""
    same = excitation.model_copy(update={"period": excitation.period or settings.duration})
    shorter = settings.model_copy(update={"duration": duration, "convergence": "on"})
    return scenario.model_copy(update={"excitation": same, "run": shorter})
