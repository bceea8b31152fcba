import json
import pickle

import numpy as np
import pytest

from beamsim.outcomes import COMPLETE, Outcome, OutcomeCode, OutcomeKind, both_directions, combined

pytestmark = pytest.mark.quick

STOPPED = Outcome.of(OutcomeCode.STEP_TOO_SMALL, parameter=2 * np.pi * 20.0, points=7, step=1e-6)


def test_complete():
    assert COMPLETE.complete
    assert COMPLETE.trusted
    assert COMPLETE.text == "complete"
    reached = Outcome.of(OutcomeCode.REACHED_END, parameter=3.0, unit="Hz")
    assert reached.complete
    assert reached.text == "complete: reached 3 Hz"


def test_parameter_is_converted_as_a_number():
    shown = STOPPED.shown(lambda omega: omega / (2 * np.pi), "Hz")
    assert shown.numbers["parameter"] == pytest.approx(20.0)
    assert shown.message == "stopped at 20 Hz after 7 points: no solution even with the smallest step of 1e-06"
    assert shown.text == f"{shown.message}; {shown.remedy}"
    assert shown.shown(lambda x: 100 * x, "m") == shown  # once is enough
    whole = Outcome.of(OutcomeCode.NOT_COVERED, STOPPED, ranges=((1.0, 2.0),), unit="Hz")
    assert whole.shown(lambda omega: omega / (2 * np.pi), "Hz").parts[0].numbers["parameter"] == pytest.approx(20.0)
    assert not whole.complete


def test_combined():
    reached = Outcome.of(OutcomeCode.REACHED_END, parameter=3.0)
    assert combined([reached, STOPPED, COMPLETE]) is STOPPED
    assert combined([reached]) is COMPLETE
    assert combined([]) is COMPLETE


def test_both_directions():
    reached = Outcome.of(OutcomeCode.REACHED_END, parameter=3.0, unit="Hz")
    assert both_directions(reached, reached) is reached
    two = both_directions(reached, STOPPED)
    assert two.code is OutcomeCode.STEP_TOO_SMALL
    assert two.text == f"{STOPPED.text}; in the other direction: complete: reached 3 Hz"
    assert two.statements == (STOPPED.text, "in the other direction: reached 3 Hz")
    assert not two.complete
    assert not both_directions(STOPPED, reached).complete
    assert COMPLETE.statements == ("complete",)
    assert reached.but(STOPPED).statements == ("complete", "reached 3 Hz", STOPPED.text)


def test_trust():
    doubt = Outcome.of(OutcomeCode.HARMONICS_NEGLECTED, parameter=3.0, unit="Hz", error=2.0, allowed=1.0)
    assert not doubt.trusted
    assert not STOPPED.but(doubt).trusted
    assert STOPPED.trusted
    stopped = Outcome.of(OutcomeCode.INTERRUPTED)
    assert Outcome.of(OutcomeCode.NOT_COVERED, stopped, ranges=((1.0, 2.0),)).interrupted


@pytest.mark.parametrize(
    "outcome",
    [
        COMPLETE,
        STOPPED,
        Outcome.of(OutcomeCode.NOT_COVERED, STOPPED, ranges=np.array([[1.0, 2.0], [4.0, 5.0]]), unit="Hz"),
        Outcome.of(OutcomeCode.CASES_MISSING, done=np.int64(2), cases=3),
    ],
)
def test_there_and_back(outcome):
    assert pickle.loads(pickle.dumps(outcome)) == outcome
    assert Outcome.from_dict(json.loads(json.dumps(outcome.as_dict()))) == outcome
    assert hash(outcome) == hash(Outcome.from_dict(outcome.as_dict()))


@pytest.mark.parametrize("code", OutcomeCode)
def test_every_message_can_be_written(code):
    values = dict.fromkeys(code.needs, 1.0)
    text = Outcome(code, values).text
    assert text
    assert not set("{}[]") & set(text)
    assert (code.kind is OutcomeKind.COMPLETE) == text.startswith("complete")
