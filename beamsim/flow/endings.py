"""How the computation of a motion ends, other than at the end of its time."""

from __future__ import annotations

from beamsim.outcomes import Outcome, OutcomeKind, Where

EVENT_LIMIT, NOT_FINITE = "event_limit", "not_finite"


def too_many_events(time: float, events: int) -> Outcome:
    """The outcome of a motion that has the largest number of contact events at a time in s."""
    sentence = f"the limit of {events} contact events is reached"
    return Outcome.of(OutcomeKind.STOPPED, EVENT_LIMIT, sentence, at=Where(time, "s"), events=events)


def not_finite(time: float) -> Outcome:
    """The outcome of a motion that cannot be represented after a time in s."""
    return Outcome.of(
        OutcomeKind.STOPPED, NOT_FINITE, "the motion leaves the range of floating-point numbers", at=Where(time, "s"),
        remedy="check the initial motion and the size of the loads",
    )  # fmt: skip
