"""Why a branch ends at contacts that rub or yield."""

from __future__ import annotations

from typing import Any

import numpy as np

from beamsim.contacts.friction import drops
from beamsim.contacts.hardening import ELASTIC, LOADING
from beamsim.orbits.branch import BranchPoint
from beamsim.orbits.shooting import ForcedOrbits
from beamsim.outcomes import Outcome, OutcomeCode

_SAMPLES = 4000  # of a period
_REACHES = 1e-3  # of the yield force: a motion that comes closer just reaches it


def explained(outcome: Outcome, problem: Any, last: BranchPoint) -> Outcome:
    """The outcome of a branch, with what its contacts have to do with its end; ``last`` is its last point."""
    if not isinstance(problem, ForcedOrbits):
        return outcome
    laws = problem.flow.system.contacts.laws
    code = None
    if outcome.code is OutcomeCode.STEP_TOO_SMALL and any(drops(law) for law in laws):
        code = OutcomeCode.STICKING_JUMPS
    elif outcome.code is OutcomeCode.NOT_SMOOTH and any(law.yields for law in laws) and _just_yields(problem, last):
        code = OutcomeCode.JUST_YIELDS
    return outcome if code is None else Outcome.of(code, *outcome.parts, **outcome.numbers)


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
