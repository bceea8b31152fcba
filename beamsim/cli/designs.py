"""``beamsim sweep`` of a scenario with ``vary``: many cases, stored as they are completed."""

from __future__ import annotations

from pathlib import Path
from signal import SIGINT
from typing import Any

from beamsim import __version__
from beamsim.analyses.designs.plan import DesignPlan, check_cases, plan_designs
from beamsim.analyses.designs.result import DesignsResult
from beamsim.cli.conclusion import conclude
from beamsim.cli.failures import say
from beamsim.cli.interruption import interruptible
from beamsim.cli.options import Reporting
from beamsim.cli.progress import progress_of
from beamsim.errors import ResultFileError, StoppedEarlyError
from beamsim.scenario import Scenario
from beamsim.store.results import holds, open_result
from beamsim.store.studies import journal_path, opened_journal, stored_study


def sweep_designs(scenario: Scenario, target: Path, reporting: Reporting, *, resume: bool, **options: Any) -> None:
    """Compute all cases (or the missing ones), save and print.

    Parameters
    ----------
    scenario : with ``vary``.
    target, reporting : as of `conclude`.
    resume : whether to keep the cases that are computed already.
    options : workers and scheduler, as of `stored_study`.

    Raises
    ------
    ScenarioError, ResultFileError
        Before the computation.
    StoppedEarlyError, NotTrustedError
        If cases failed or workers ended unexpectedly; the partial result is saved.
    LimitExceededError
        With ``--check``.
    """
    plan = plan_designs(scenario)
    check_cases(plan)
    stored = _finished(plan, target) if resume else None
    if stored is None:
        _compute(plan, target, reporting, resume, options)
        return
    if not reporting.quiet:
        say(f"beamsim: {target} is complete; there is nothing to compute")
    with interruptible() as interrupted:
        conclude("designs", stored, target, reporting._replace(plots=False), interrupted)


def _finished(plan: DesignPlan, target: Path) -> DesignsResult | None:
    """The result in the file, if it is complete."""
    if journal_path(target).exists() or not holds(target, "designs"):
        return None
    stored: Any = open_result(target, "designs")
    same = stored.fingerprint == plan.fingerprint and stored.beamsim_version == __version__
    limits = {} if plan.scenario.limits is None else plan.scenario.limits.given
    return stored if same and stored.complete and dict(stored.limits) == limits else None


def _compute(plan: DesignPlan, target: Path, reporting: Reporting, resume: bool, options: dict[str, Any]) -> None:
    cases = len(plan.cases)
    path = journal_path(target)
    with opened_journal(path, plan.fingerprint, resume=resume) as journal, interruptible() as interrupted:
        if journal.dropped:
            say(f"beamsim: warning: starting again; --resume would have kept {journal.dropped} of {cases} cases")
        elif journal.outcomes and not reporting.quiet:
            say(f"beamsim: {len(journal.outcomes)} of {cases} cases are already computed")
        try:
            with progress_of(f"{cases} cases", shown=reporting.progress) as progress:
                result = stored_study(plan, journal, target, progress=progress, stop=interrupted, **options)
            if len(journal.outcomes) < cases:
                raise KeyboardInterrupt
        except BaseException as error:
            if isinstance(error, ResultFileError) or not journal.outcomes:
                raise
            kept = f"{len(journal.outcomes)} of {cases} cases are in {target}; --resume computes the others"
            if isinstance(error, KeyboardInterrupt):
                raise StoppedEarlyError(f"interrupted; {kept}", 128 + (interrupted.signal or SIGINT)) from None
            say(f"beamsim: {kept}")
            raise
        conclude("designs", result, target, reporting, interrupted)
