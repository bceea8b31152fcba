"""What becomes of a result whose reduced model is not accurate."""

from __future__ import annotations

from beamsim.outcomes import Outcome, OutcomeKind
from beamsim.system.structural import ModeTable

WORTHLESS_REDUCTION = 0.1
"""Bound of the receptance's error over the static compliance above which a result is not to be trusted."""


def reduction_checked(outcome: Outcome, modes: ModeTable) -> Outcome:
    """The outcome, which is not to be trusted where the reduced receptance has no useful bound."""
    if not modes.reduction_bound > WORTHLESS_REDUCTION:
        return outcome
    return Outcome.of(
        OutcomeKind.UNTRUSTED, "reduction_not_accurate",
        "the error of the reduced model's receptance at contacts and loads up to "
        f"{modes.highest_frequency_hz:.6g} Hz is bounded only by {modes.reduction_bound:.2g} of its size, more than "
        f"{WORTHLESS_REDUCTION:g}",
        *outcome.unless_complete,
        remedy="keep more modes (reduction.modes: all), or leave reduction out", bound=modes.reduction_bound,
    )  # fmt: skip
