import json
import pickle

import numpy as np
import pytest

from beamsim.outcomes import (
    COMPLETE,
    Outcome,
    OutcomeKind,
    Where,
    both_directions,
    combined,
    first_with_others,
    numbers_text,
)

pytestmark = pytest.mark.quick

STOPPED = Outcome.of(
    OutcomeKind.STOPPED, "step_too_small", "no solution", at=2 * np.pi * 20.0, remedy="try a smaller step", points=7
)
REACHED = Outcome.of(OutcomeKind.COMPLETE, "reached_end", "reached the end", at=Where(3.0, "Hz"))
MISSING = Outcome.of(OutcomeKind.INCOMPLETE, "not_covered", "no motion", STOPPED, at=Where([(1.0, 2.0)], "Hz"))


def test_complete():
    assert COMPLETE.complete
    assert COMPLETE.trusted
    assert COMPLETE.text == "complete"
    assert REACHED.complete
    assert REACHED.text == "complete: reached the end at 3 Hz"


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        (OutcomeKind.COMPLETE, "complete: what at 3 Hz"),
        (OutcomeKind.NOTED, "what at 3 Hz"),
        (OutcomeKind.DOUBTFUL, "not converged at 3 Hz: what"),
        (OutcomeKind.INCOMPLETE, "what at 3 Hz"),
        (OutcomeKind.STOPPED, "stopped at 3 Hz: what"),
        (OutcomeKind.UNTRUSTED, "not reliable at 3 Hz: what"),
        (OutcomeKind.INTERRUPTED, "interrupted at 3 Hz what"),
        (OutcomeKind.FAILED, "what at 3 Hz"),
    ],
)
def test_what_each_kind_says_and_means(kind, text):
    outcome = Outcome.of(kind, "code", "what", at=Where(3.0, "Hz"), remedy="do this")
    assert outcome.text == f"{text}; do this"
    assert outcome.complete == (kind in ("complete", "noted"))
    assert outcome.trusted == (kind not in ("untrusted", "failed"))
    assert outcome.cut_short == (kind in ("incomplete", "stopped", "interrupted", "failed"))
    assert outcome.usable == (kind in ("complete", "noted", "doubtful"))
    assert Outcome.of(kind, "code").message in ("", "stopped", "not converged", "not reliable", "interrupted")


def test_the_parameter_of_a_branch_is_converted_once():
    shown = STOPPED.in_unit(lambda omega: omega / (2 * np.pi), "Hz")
    assert shown.place.value == pytest.approx(20.0)
    assert shown.text == "stopped at 20 Hz: no solution; try a smaller step"
    assert shown.in_unit(lambda x: 100 * x, "m") == shown
    assert MISSING.in_unit(lambda omega: omega / (2 * np.pi), "Hz").sub_outcomes == (shown,)


def test_places_in_words():
    assert Where((1.0, 2.5), "g", "level").phrase == "at level 1, 2.5 g"
    assert Where(((1.0, 2.0), (4.0, 5.0)), "Hz").phrase == "from 1 to 2, 4 to 5 Hz"
    assert str(Where(0.5)) == "parameter 0.5"
    assert str(Where(0.5, "1", "stiffness factor")) == "stiffness factor 0.5"
    assert numbers_text(tuple(range(9))) == "0, 1, 2, 3, 4, 5 and 3 more"


def test_combined():
    assert combined([REACHED, STOPPED, COMPLETE]) is STOPPED
    assert combined([REACHED]) is COMPLETE
    assert combined([]) is COMPLETE
    assert first_with_others([]) is COMPLETE
    assert first_with_others([STOPPED, REACHED]).sub_outcomes == (REACHED,)


def test_both_directions():
    assert both_directions(REACHED, REACHED) is REACHED
    two = both_directions(REACHED, STOPPED)
    assert two.code == "step_too_small"
    assert two.text == f"{STOPPED.text}; in the other direction: reached the end at 3 Hz"
    assert two.statements == (STOPPED.text, "in the other direction: reached the end at 3 Hz")
    assert not two.complete
    assert not both_directions(STOPPED, REACHED).complete
    assert COMPLETE.statements == ()
    assert REACHED.copy_with(STOPPED).statements == ("reached the end at 3 Hz", STOPPED.text)


@pytest.mark.parametrize("kind", [OutcomeKind.DOUBTFUL, OutcomeKind.UNTRUSTED, OutcomeKind.STOPPED])
def test_what_has_a_part_that_is_not_complete_is_not_called_complete(kind):
    part = Outcome.of(kind, "code", "values change", context="the best design")
    for whole in (COMPLETE.copy_with(part), REACHED.copy_with(part), COMPLETE.copy_with(COMPLETE.copy_with(part))):
        assert not whole.complete
        assert "complete" not in whole.text
        assert not any("complete" in text for text in whole.statements)
        assert part.message in whole.text


def test_a_part_that_is_complete_is_not_called_so_beside_one_that_is_not():
    """Levels of a sweep, branches, cases: the reader of INCOMPLETE would read it of the whole."""
    fine = COMPLETE.copy_with(context=Where(1.0, "g", "level"))
    for whole in (
        MISSING.copy_with(fine),
        MISSING.copy_with(REACHED),
        MISSING.copy_with(COMPLETE),
        COMPLETE.copy_with(MISSING, fine),
    ):
        assert "complete" not in whole.text
        assert not any("complete" in text for text in whole.statements)
    assert MISSING.copy_with(REACHED).text == f"{MISSING.text}; reached the end at 3 Hz"
    assert REACHED.of_part == "reached the end at 3 Hz"  # what is said of a branch
    assert COMPLETE.of_part == "complete"
    assert COMPLETE.copy_with(REACHED, fine).text == "complete; reached the end at 3 Hz"  # twin: all is


def test_what_a_part_means_for_the_whole():
    doubt = Outcome.of(OutcomeKind.UNTRUSTED, "harmonics_neglected", "they are large")
    assert not STOPPED.copy_with(doubt).trusted
    assert MISSING.copy_with(Outcome.of(OutcomeKind.INTERRUPTED, "interrupted")).interrupted
    assert not REACHED.copy_with(STOPPED).complete
    assert MISSING.outcomes_with_code("step_too_small") == [STOPPED]


@pytest.mark.parametrize(
    "outcome",
    [
        COMPLETE,
        STOPPED,
        MISSING.copy_with(context=Where(9.81, "m/s^2", "level")),
        Outcome.of(OutcomeKind.INCOMPLETE, "cases_missing", "2 of 3", done=np.int64(2), shares=np.array([[1.0, 2.0]])),
    ],
)
def test_there_and_back(outcome):
    assert pickle.loads(pickle.dumps(outcome)) == outcome
    assert Outcome.from_dict(json.loads(json.dumps(outcome.as_dict()))) == outcome
    assert hash(outcome) == hash(Outcome.from_dict(outcome.as_dict()))
