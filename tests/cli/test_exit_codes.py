"""Every exit code has one meaning, and every outcome and every verdict on a limit leads to one."""

import gzip
from itertools import product
from pathlib import Path
from pkgutil import resolve_name

import pytest

from beamsim.cli.command import plot_and_print
from beamsim.cli.session import CommandOptions, Interruption
from beamsim.errors import VerdictError
from beamsim.kinds import KINDS
from beamsim.outcomes import EXIT_RULES, Outcome, OutcomeKind, Verdict, exit_code, on_limit
from beamsim.results.values import margins_of, with_verdicts
from beamsim.scenario.reporting import Limits
from tests.helpers.commands import invoke

pytestmark = pytest.mark.quick

CODES = {
    OutcomeKind.COMPLETE: 0, OutcomeKind.NOTED: 0, OutcomeKind.DOUBTFUL: 0, OutcomeKind.INCOMPLETE: 3,
    OutcomeKind.STOPPED: 3, OutcomeKind.FAILED: 3, OutcomeKind.UNTRUSTED: 3, OutcomeKind.INTERRUPTED: 130,
    OutcomeKind.NOT_HELD: 3,
}  # fmt: skip
FIRST_LINES = {
    OutcomeKind.DOUBTFUL: "NOT CONVERGED", OutcomeKind.UNTRUSTED: "NOT RELIABLE", OutcomeKind.INCOMPLETE: "INCOMPLETE",
    OutcomeKind.STOPPED: "INCOMPLETE", OutcomeKind.FAILED: "INCOMPLETE", OutcomeKind.INTERRUPTED: "INCOMPLETE",
    OutcomeKind.NOT_HELD: "LIMITS EXCEEDED",
}  # fmt: skip


def of_kind(kind):
    return Outcome.of(kind, "a_code", "a sentence")


def ended(result, **more):
    """Exit code of a command that ends with a result."""
    try:
        plot_and_print(
            "run", result, Path("case.h5"), CommandOptions(no_plots=True, quiet=True, **more), Interruption()
        )
    except VerdictError as error:
        return error.exit_code
    return 0


@pytest.mark.parametrize("kind", OutcomeKind)
def test_an_outcome_has_its_code_and_its_first_line(kind, fabricated_run):
    outcome = of_kind(kind)
    result = fabricated_run(outcome=outcome)
    assert exit_code(outcome) == EXIT_RULES[kind].exit_code == CODES[kind]
    assert ended(result) == CODES[kind]
    assert outcome.usable == (CODES[kind] == 0)
    assert outcome.complete == (kind not in FIRST_LINES)  # what is marked NOT CONVERGED was called complete
    first = resolve_name(KINDS["run"].screen)(result).text(result, ["case.h5"]).splitlines()[0]
    assert first.partition("  ")[2].startswith(FIRST_LINES.get(kind, "not checked"))


@pytest.mark.parametrize(("kind", "part"), [*product(OutcomeKind, OutcomeKind)])
def test_what_accompanies_an_outcome_counts_as_the_outcome_itself(kind, part):
    """A part that is not reliable made a result that is complete incomplete, with exit code 0."""
    both = of_kind(kind).copy_with(of_kind(part))
    assert both.gravest_kind is max(kind, part, key=list(OutcomeKind).index)
    assert exit_code(both) == max(CODES[kind], CODES[part])
    assert both.usable == (exit_code(both) == 0)
    assert both.complete == (both.gravest_kind not in FIRST_LINES)


@pytest.mark.parametrize(
    ("lowest", "highest", "verdict"),
    [(45, 49, "ok"), (50, 50, "ok"), (45, 51, "not reliable"), (51, 60, "exceeded"),
     (float("nan"), float("nan"), "not reliable"), (45, float("nan"), "not reliable")],
)  # fmt: skip
def test_a_limit_is_met_or_exceeded_only_with_the_change_of_its_value(lowest, highest, verdict):
    assert on_limit(lowest, highest, 50.0) == verdict


@pytest.mark.parametrize("kind", OutcomeKind)
def test_a_limit_is_judged_by_what_was_computed_reliably(kind):
    """What is missing may exceed a limit that is met so far; what is not reliable says nothing."""
    met, beyond = (on_limit(x, x, 50.0, of_kind(kind)) for x in (40.0, 60.0))
    assert met == ("ok" if CODES[kind] == 0 or kind is OutcomeKind.NOT_HELD else "not reliable")  # all is computed
    assert beyond == ("not reliable" if kind in (OutcomeKind.UNTRUSTED, OutcomeKind.FAILED) else "exceeded")


@pytest.mark.parametrize(
    ("kind", "verdicts"), [*product(OutcomeKind, [(), (Verdict.MET,), (Verdict.NOT_RELIABLE,), tuple(Verdict)])]
)
def test_limits_that_are_checked_have_their_codes(kind, verdicts):
    """Exceeded 4, else not reliable 3; an interruption stays one."""
    of_limits = 4 if Verdict.EXCEEDED in verdicts else 3 if {*verdicts} - {Verdict.MET} else 0
    interrupted = kind is OutcomeKind.INTERRUPTED
    assert exit_code(of_kind(kind), verdicts) == (130 if interrupted else max(CODES[kind], of_limits))
    assert exit_code(of_kind(kind), verdicts, signal=15) == 143


@pytest.mark.parametrize(
    ("value", "change", "code"), [(60.0, 0.1, 4), (52.0, 0.1, 3), (48.0, 0.1, 3), (40.0, 0.1, 0), (48.0, 0.0, 0)]
)
def test_a_limit_counts_only_where_it_is_checked(value, change, code, fabricated_run, capsys):
    result = fabricated_run()
    (item,) = margins_of(Limits(peak_force=50.0), {"peak_force": (value, "tip")}).values()
    ends = {"lowest": value * (1 - change), "highest": value * (1 + change)}
    result.summary["margins"] = with_verdicts({"peak_force": item | ends})
    assert ended(result, check=True) == code
    assert ended(result) == 0
    verdict = result.summary["margins"]["peak_force"]["verdict"]
    assert {0: "ok", 3: "not reliable", 4: "exceeded"}[code] == verdict
    plot_and_print("run", result, Path("case.h5"), CommandOptions(no_plots=True), Interruption())
    assert f"peak force {verdict if verdict == 'ok' else verdict.upper()}" in capsys.readouterr().out


def test_a_limit_that_nothing_is_compared_with_is_neither_met_nor_exceeded():
    """Of a continuation without a stable motion it was left out, and --check passed."""
    (item,) = margins_of(Limits(peak_force=50.0), {}).values()
    assert item["verdict"] == "not reliable"


def test_a_reader_that_leaves_early_is_no_damage_of_the_file(tmp_path, monkeypatch):
    """`beamsim info case.h5 | head` said that the file is damaged."""

    def closed(*_):
        raise BrokenPipeError

    stored = Path(__file__).parents[1] / "data/results/sweep.h5.gz"
    (tmp_path / "sweep.h5").write_bytes(gzip.decompress(stored.read_bytes()))
    monkeypatch.setattr("beamsim.cli.session.discard_output", lambda: None)
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
    monkeypatch.setattr("beamsim.cli.session.discard_output", lambda: None)
    assert invoke("schema").exit_code == code
