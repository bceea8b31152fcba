"""How long a run of a swept sine takes, from two short runs of it."""

from __future__ import annotations

from beamsim.analyses.run.motion import output_times
from beamsim.flow.compiled import processor_time
from beamsim.inputs.excitation import highest_excited_hz
from beamsim.scenario import Scenario
from beamsim.scenario.run import SpectrumSettings
from beamsim.system.reduced_model import SharedBuilds
from beamsim.trust.runs import run
from beamsim.typing import not_none

PIECE, LONGER = 0.01, 3.0  # share of the duration of the first short run, and how much longer the second one is
CYCLES_OF_PIECE, LONGEST_PIECE = 10.0, 0.05  # of the first: cycles, at least, and share of the duration, at most
WORTH_ESTIMATING = 200_000  # samples of the histories; with fewer, a run takes less than about ten seconds


def expected_time(scenario: Scenario) -> float | None:
    """Processor time of a run with its finer model, compilation left out.

    Both samples and cycles take time. The short runs start at the mean frequency, where a second has as many of both as
    an average second of the whole. Their difference gives the time per second of motion.

    Parameters
    ----------
    scenario : with a ``run`` section.

    Returns
    -------
    float or None
        s; None for other excitations than one swept sine, and for runs that are short.
    """
    sweep, settings = scenario.excitation, not_none(scenario.run)
    if sweep.kind != "swept_sine" or output_times(scenario).size < WORTH_ESTIMATING:
        return None
    mean = sweep.cycles_in(settings.duration) / settings.duration
    rate = scenario.sample_rate_up_to(highest_excited_hz(scenario))
    first = min(max(PIECE * settings.duration, CYCLES_OF_PIECE / mean), LONGEST_PIECE * settings.duration)
    taken, shared = [], SharedBuilds()
    for duration in (first, LONGER * first):
        short = settings.model_copy(update={"duration": duration, "sample_rate": rate, "spectrum": SpectrumSettings()})
        piece = scenario.model_copy(update={"excitation": sweep.model_copy(update={"from_": mean}), "run": short})
        begin = processor_time()
        run(piece, builds=shared)
        taken.append(processor_time() - begin)
    of_second = (taken[1] - taken[0]) / ((LONGER - 1.0) * first)
    return taken[0] + of_second * (settings.duration - first)
