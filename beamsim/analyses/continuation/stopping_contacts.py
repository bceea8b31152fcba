"""Why a branch ends at contacts that rub or yield."""

from __future__ import annotations

from typing import Any

import numpy as np

from beamsim.contacts.friction import drops
from beamsim.contacts.hardening import ELASTIC, LOADING
from beamsim.orbits.branch import BranchPoint
from beamsim.orbits.continuation import NOT_SMOOTH, STEP_TOO_SMALL
from beamsim.orbits.shooting import ForcedOrbits
from beamsim.outcomes import Outcome

_SAMPLES = 4000  # of a period
_REACHES = 1e-3  # of the yield force: a motion that comes closer just reaches it


def explained(outcome: Outcome, problem: Any, last: BranchPoint) -> Outcome:
    """The outcome of a branch, with what its contacts have to do with its end; ``last`` is its last point."""
    if not isinstance(problem, ForcedOrbits):
        return outcome
    laws = problem.flow.system.contacts.laws
    if outcome.code == STEP_TOO_SMALL and any(drops(law) for law in laws):
        return outcome.but(
            code="sticking_jumps",
            sentence="where a friction contact with a static coefficient above the sliding one begins to stick or to "
            "slide, it does so at once for a time that is not short, and the motions beyond are not neighbours of "
            "these",
            remedy="follow the range beyond with a stepped sine, begin the continuation there, or give the contact one "
            "coefficient",
        )
    if outcome.code == NOT_SMOOTH and any(law.yields for law in laws) and _just_yields(problem, last):
        return outcome.but(
            code="just_yields",
            sentence="the motion just reaches the yield force of a stop; with any larger crush it is periodic as well, "
            "so that no single branch goes on",
            remedy="follow the range beyond with a stepped sine or a study of runs, where the crush is that of their "
            "past",
        )
    return outcome


def _just_yields(problem: ForcedOrbits, point: BranchPoint) -> bool:
    """Whether in an elastic motion the force of a stop that yields comes close to its yield force."""
    flow, passage = problem.cycle(point)
    contacts, n = flow.system.contacts, 2 * flow.system.size
    times = np.linspace(0.0, passage.duration, _SAMPLES, endpoint=False)
    y = flow.states_at(passage, times)
    penetration = flow.penetration_of(y, times)[0]
    segment = np.searchsorted(passage.time, times, side="right") - 1
    phases = passage.phases[segment]
    for j, law in enumerate(contacts.laws):
        if not law.yields or np.any(phases[:, j] >= LOADING):
            continue
        (guard,) = (guard for guard in law.phases[ELASTIC].guards if guard.next == LOADING)
        slider = y[:, n + contacts.first[j]]
        left = guard.row.constant + guard.row.penetration * penetration[:, j] + guard.row.internal[0] * slider
        if np.any(left[phases[:, j] == ELASTIC] < _REACHES * guard.row.constant):
            return True
    return False
