"""What becomes of a result whose reduced model is not accurate."""

from __future__ import annotations

from beamsim.outcomes import Outcome, OutcomeCode
from beamsim.system.structural import ModeTable

WORTHLESS_REDUCTION = 0.1
"""Bound of the receptance's error over the static compliance above which a result is not to be trusted."""


def reduction_checked(outcome: Outcome, modes: ModeTable) -> Outcome:
    """The outcome, which is not to be trusted where the reduced receptance has no useful bound."""
    if not modes.reduction_bound > WORTHLESS_REDUCTION:
        return outcome
    return Outcome.of(
        OutcomeCode.REDUCTION_NOT_ACCURATE, *(() if outcome.complete else (outcome,)),
        bound=modes.reduction_bound, highest=modes.highest_frequency_hz, allowed=WORTHLESS_REDUCTION,
    )  # fmt: skip
