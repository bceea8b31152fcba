import json

import h5py
import pytest

from beamsim.codecs import outcome_of_text
from beamsim.outcomes import COMPLETE, Outcome, OutcomeCode
from beamsim.store.results import open_run, write_run

pytestmark = pytest.mark.quick

STOPPED = Outcome.of(OutcomeCode.EVENT_LIMIT, time=0.2, events=9, limit="run.max_events")


def test_a_file_holds_text_code_and_numbers(fabricated_run, tmp_path):
    path = write_run(fabricated_run(outcome=STOPPED), tmp_path / "case.h5")
    with h5py.File(path) as file:
        assert file.attrs["status"] == STOPPED.text
        assert file.attrs["outcome"] == "event_limit"
        assert json.loads(file.attrs["outcome_numbers"]) == {"numbers": dict(STOPPED.numbers)}
    assert open_run(path).outcome == STOPPED


@pytest.mark.parametrize("outcome", [COMPLETE, STOPPED])
def test_a_file_without_codes_still_opens(fabricated_run, tmp_path, outcome):
    path = write_run(fabricated_run(outcome=outcome), tmp_path / "case.h5")
    with h5py.File(path, "r+") as file:
        del file.attrs["outcome"], file.attrs["outcome_numbers"]
    read = open_run(path)
    assert (read.status, read.complete) == (outcome.text, outcome.complete)


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("complete", OutcomeCode.COMPLETE),
        ("converged", OutcomeCode.COMPLETE),
        ("complete: reached 20 Hz", OutcomeCode.REACHED_END),
        ("complete: closed curve", OutcomeCode.CLOSED_CURVE),
        ("interrupted at 3 J", OutcomeCode.INTERRUPTED),
        ("not to be trusted: at 3 Hz …", OutcomeCode.HARMONICS_NEGLECTED),
        ("stopped at 3 Hz after 7 points: …", OutcomeCode.STOPPED),
    ],
)
def test_texts_of_old_files(text, code):
    outcome = outcome_of_text(text)
    assert outcome.code is code
    assert outcome.text == text or outcome == COMPLETE
