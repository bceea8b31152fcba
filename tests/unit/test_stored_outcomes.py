import json

import h5py
import pytest

from beamsim.outcomes import Outcome, OutcomeKind, Where
from beamsim.store.results import load, write_result

pytestmark = pytest.mark.quick


def test_a_file_holds_text_code_and_numbers(fabricated_run, tmp_path):
    part = Outcome.of(OutcomeKind.NOTED, "no_stable_motion", "none", at=Where([(1.0, 2.0)], "Hz"))
    stopped = Outcome.of(OutcomeKind.STOPPED, "event_limit", "too many", part, at=Where(0.2, "s"), events=9)
    path = write_result(fabricated_run(outcome=stopped), tmp_path / "case.h5")
    with h5py.File(path) as file:
        assert file.attrs["status"] == stopped.text == "stopped at 0.2 s: too many; none from 1 to 2 Hz"
        assert file.attrs["outcome"] == "event_limit"
        assert json.loads(file.attrs["outcome_numbers"])["numbers"] == {"events": 9}
    assert load(path).outcome == stopped
