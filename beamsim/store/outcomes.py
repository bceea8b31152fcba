"""Outcomes in result files: the text for people, the code and its numbers for programs."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from beamsim.outcomes import COMPLETE, Outcome, OutcomeCode

# how the texts of files without a code begin, the longer first; what ends otherwise has stopped
_OLD = {
    "complete: reached": OutcomeCode.REACHED_END,
    "complete: closed curve": OutcomeCode.CLOSED_CURVE,
    "complete: joined another branch": OutcomeCode.JOINED_BRANCH,
    "complete: back to period": OutcomeCode.BACK_TO_PERIOD,
    "complete: came back": OutcomeCode.BACK_TO_BRAKE_ORBITS,
    "complete: the energy": OutcomeCode.ENERGY_TRANSFERRED,
    "complete": OutcomeCode.COMPLETE,
    "converged": OutcomeCode.COMPLETE,
    "interrupted": OutcomeCode.INTERRUPTED,
    "not to be trusted": OutcomeCode.HARMONICS_NEGLECTED,
    "": OutcomeCode.STOPPED,
}


def outcome_attributes(outcome: Outcome) -> dict[str, str]:
    """Attributes of a group that keep an outcome."""
    values = outcome.as_dict()
    label = values.pop("code")
    return {"status": outcome.text, "outcome": label, "outcome_numbers": json.dumps(values, ensure_ascii=False)}


def read_outcome(attributes: Mapping[str, Any]) -> Outcome:
    """The outcome that `outcome_attributes` describes; of an old file its text, and what the text says of its code."""
    label = str(attributes.get("outcome", ""))
    if label.upper() in OutcomeCode.__members__:
        return Outcome.from_dict({"code": label, **json.loads(attributes["outcome_numbers"])})
    return outcome_of_text(str(attributes["status"]))


def outcome_of_text(text: str) -> Outcome:
    """What a file without codes says; an empty text is that of a complete result."""
    code = next(code for beginning, code in _OLD.items() if text.startswith(beginning))
    return Outcome.of(code, text=text) if text and text != COMPLETE.text else COMPLETE
