"""``beamsim sweep`` of a scenario with ``vary``: many cases, stored as they are completed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from signal import SIGINT
from typing import TYPE_CHECKING, Any

from beamsim.cli.conclusion import Reporting, conclude
from beamsim.cli.failures import say
from beamsim.cli.interruption import interruptible
from beamsim.cli.progress import progress_of
from beamsim.errors import ResultFileError, StoppedEarlyError

if TYPE_CHECKING:
    from beamsim.analyses.designs.plan import DesignPlan
    from beamsim.analyses.designs.result import DesignsResult
    from beamsim.scenario import Scenario


@dataclass(frozen=True)
class StudyOptions:
    """How a study is computed."""

    workers: int | None = None
    scheduler: str | None = None
    resume: bool = False


def sweep_designs(scenario: Scenario, target: Path, options: StudyOptions, reporting: Reporting) -> None:
    """Compute all cases (or the missing ones), save and print.

    Raises
    ------
    ScenarioError, ResultFileError
        Before the computation.
    StoppedEarlyError, NotTrustedError
        If cases failed or workers ended unexpectedly; the partial result is saved.
    LimitExceededError
        With ``--check``.
    """
    from beamsim.analyses.designs.plan import check_cases, plan_designs

    plan = plan_designs(scenario)
    check_cases(plan)
    stored = _finished(plan, target) if options.resume else None
    if stored is None:
        _compute(plan, target, options, reporting)
        return
    if not reporting.quiet:
        say(f"beamsim: {target} is complete; there is nothing to compute")
    with interruptible() as interrupted:
        conclude("designs", stored, target, replace(reporting, plots=False), interrupted)


def _finished(plan: DesignPlan, target: Path) -> DesignsResult | None:
    """The result in the file, if it is complete."""
    from beamsim.store.journal import journal_path
    from beamsim.store.results import holds, open_result
    from beamsim.version import __version__

    if journal_path(target).exists() or not holds(target, "designs"):
        return None
    stored: Any = open_result(target, "designs")
    same = stored.fingerprint == plan.fingerprint and stored.beamsim_version == __version__
    limits = {} if plan.scenario.limits is None else plan.scenario.limits.given
    return stored if same and stored.complete and dict(stored.limits) == limits else None


def _compute(plan: DesignPlan, target: Path, options: StudyOptions, reporting: Reporting) -> None:
    from beamsim.store.journal import journal_path, opened_journal
    from beamsim.store.studies import stored_study

    cases, resume = len(plan.cases), options.resume
    path = journal_path(target)
    with opened_journal(path, plan.fingerprint, resume=resume) as journal, interruptible() as interrupted:
        if journal.dropped:
            say(f"beamsim: warning: starting again; --resume would have kept {journal.dropped} of {cases} cases")
        elif journal.outcomes and not reporting.quiet:
            say(f"beamsim: {len(journal.outcomes)} of {cases} cases are already computed")
        try:
            with progress_of(f"{cases} cases", shown=reporting.progress) as progress:
                result = stored_study(
                    plan, journal, target, workers=options.workers, scheduler=options.scheduler, progress=progress,
                    stop=interrupted,
                )  # fmt: skip
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
