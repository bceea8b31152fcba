"""Every exit code has one meaning, and every outcome leads to one."""

import gzip
from pathlib import Path

import pytest

from beamsim.cli.conclusion import EXIT_CODES, conclude, exit_code
from beamsim.cli.failures import Interruption
from beamsim.cli.options import Reporting
from beamsim.errors import ExitCode, LimitExceededError, StoppedEarlyError
from beamsim.outcomes import COMPLETE, Outcome, OutcomeKind
from tests.helpers.commands import invoke

pytestmark = pytest.mark.quick

STOPPED = Outcome.of(OutcomeKind.STOPPED, "stopped")
INTERRUPTED = Outcome.of(OutcomeKind.INTERRUPTED, "interrupted")
UNTRUSTED = Outcome.of(OutcomeKind.UNTRUSTED, "harmonics_neglected")


def ended(result, **more):
    """Exit code of a command that ends with a result."""
    try:
        conclude("run", result, Path("case.h5"), Reporting(plots=False, quiet=True, **more), Interruption())
    except (StoppedEarlyError, LimitExceededError) as error:
        return error.exit_code
    return 0


@pytest.mark.parametrize(
    ("outcome", "code"), [(COMPLETE, 0), (STOPPED, 3), (UNTRUSTED, 3), (INTERRUPTED, 130)], ids=["0", "3", "3", "130"]
)
def test_an_outcome_has_its_code(outcome, code, fabricated_run):
    assert exit_code(outcome) == code
    assert ended(fabricated_run(outcome=outcome)) == code


def test_every_kind_of_outcome_has_a_code():
    assert set(EXIT_CODES) == set(OutcomeKind)
    assert [kind for kind, code in EXIT_CODES.items() if code == ExitCode.SUCCESS] == [
        OutcomeKind.COMPLETE,
        OutcomeKind.NOTED,
    ]


def test_a_limit_counts_only_where_it_is_checked(fabricated_run):
    result = fabricated_run()
    result.summary["margins"] = {"peak_force": {"value": 60.0, "limit": 50.0, "exceeded": True}}
    assert ended(result, check=True) == ExitCode.LIMIT_EXCEEDED == 4
    assert ended(result) == 0
    result.summary["margins"]["peak_force"]["exceeded"] = False
    assert ended(result, check=True) == 0


def test_a_reader_that_leaves_early_is_no_damage_of_the_file(tmp_path, monkeypatch):
    """`beamsim info case.h5 | head` said that the file is damaged."""

    def closed(*_):
        raise BrokenPipeError

    stored = Path(__file__).parents[1] / "data/results/sweep.h5.gz"
    (tmp_path / "sweep.h5").write_bytes(gzip.decompress(stored.read_bytes()))
    monkeypatch.setattr("beamsim.cli.failures.discard_output", lambda: None)
    for printer, more in (("print_table", []), ("print_json", ["--json"])):
        monkeypatch.setattr(f"beamsim.cli.stored.{printer}", closed)
        assert invoke("info", tmp_path / "sweep.h5", *more).exit_code == 141


@pytest.mark.parametrize(
    ("raised", "code"),
    [(ZeroDivisionError(), 1), (KeyboardInterrupt(), 130), (BrokenPipeError(), 141)],
)
def test_an_exception_has_its_code(raised, code, tmp_path, monkeypatch):
    def fail(*_):
        raise raised

    monkeypatch.setattr("beamsim.cli.cases.schema_text", fail)
    monkeypatch.setattr("beamsim.cli.failures.discard_output", lambda: None)
    assert invoke("schema").exit_code == code
