"""Outcomes in result files: the text for the user, the code and its numbers for programs."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from beamsim.outcomes import COMPLETE, Outcome, OutcomeCode

if TYPE_CHECKING:
    from beamsim.analyses.designs.result import CaseFailure

# beginnings of the texts in files without a code, longer ones first; anything else means stopped
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
    """Attributes of a group that store an outcome."""
    values = outcome.as_dict()
    label = values.pop("code")
    return {"status": outcome.text, "outcome": label, "outcome_numbers": json.dumps(values, ensure_ascii=False)}


def read_outcome(attributes: Mapping[str, Any]) -> Outcome:
    """The outcome stored by `outcome_attributes`; for an old file its text, and the code that the text implies."""
    label = str(attributes.get("outcome", ""))
    if label.upper() in OutcomeCode.__members__:
        return Outcome.from_dict({"code": label, **json.loads(attributes["outcome_numbers"])})
    return outcome_of_text(str(attributes["status"]))


def failures_text(failures: Iterable[CaseFailure]) -> str:
    """Cases that failed, as JSON: number, values of the parameters, text and code of the outcome."""
    rows = [[f.case, list(f.values), f.outcome.text, f.outcome.as_dict()] for f in failures]
    return json.dumps(rows, ensure_ascii=False)


def read_failures(text: str) -> tuple[CaseFailure, ...]:
    """The cases stored by `failures_text`; in an old file without codes."""
    from beamsim.analyses.designs.result import CaseFailure

    return tuple(
        CaseFailure(case, tuple(values), Outcome.from_dict(code[0]) if code else outcome_of_text(why))
        for case, values, why, *code in json.loads(text)
    )


def outcome_of_text(text: str) -> Outcome:
    """The outcome in a file without codes; an empty text means complete."""
    code = next(code for beginning, code in _OLD.items() if text.startswith(beginning))
    return Outcome.of(code, text=text) if text and text != COMPLETE.text else COMPLETE
