"""``beamsim sweep`` of a scenario with ``vary``: many cases, stored as they are completed."""

from __future__ import annotations

import time as clock
from dataclasses import dataclass, replace
from pathlib import Path
from signal import SIGINT
from typing import TYPE_CHECKING, Any

from beamsim.cli.conclusion import Reporting, conclude, keep
from beamsim.cli.failures import say
from beamsim.cli.interruption import interruptible
from beamsim.cli.progress import progress_of
from beamsim.errors import StoppedEarlyError

if TYPE_CHECKING:
    from beamsim.analyses.designs.plan import DesignPlan
    from beamsim.analyses.designs.result import DesignsResult
    from beamsim.scenario import Scenario

SAVED_EVERY_S = 30.0  # interval between updates of the result file


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
    from beamsim.analyses.designs.analysis import design_study
    from beamsim.analyses.designs.gathering import gather
    from beamsim.analyses.designs.table import CaseTable
    from beamsim.store.journal import Journal, journal_path
    from beamsim.store.results import write_designs

    cases = len(plan.tasks)
    journal_file = journal_path(target)
    with Journal(journal_file, plan.fingerprint, resume=options.resume) as journal, interruptible() as interrupted:
        if journal.dropped:
            say(f"beamsim: warning: starting again; --resume would have kept {journal.dropped} of {cases} cases")
        elif journal.known and not reporting.quiet:
            say(f"beamsim: {len(journal.known)} of {cases} cases are already computed")
        table = CaseTable(cases, journal.known)
        begin = saved = clock.monotonic()

        def store(outcome: Any) -> None:
            nonlocal saved
            journal.add(outcome)
            table.add(outcome)
            if clock.monotonic() - saved > SAVED_EVERY_S:
                write_designs(gather(plan, table, clock.monotonic() - begin), target)
                saved = clock.monotonic()

        try:
            with progress_of(f"{cases} cases", shown=reporting.progress) as progress:
                result = design_study(
                    plan, workers=options.workers, scheduler=options.scheduler, known=journal.known, each=store,
                    progress=progress, stop=interrupted,
                )  # fmt: skip
            if table.count < cases:
                raise KeyboardInterrupt
        except BaseException as error:
            if not table.count:
                journal.remove()
                raise
            write_designs(gather(plan, table, clock.monotonic() - begin), target)
            kept = f"{table.count} of {cases} cases are in {target}; --resume computes the others"
            if isinstance(error, KeyboardInterrupt):
                raise StoppedEarlyError(f"interrupted; {kept}", 128 + (interrupted.signal or SIGINT)) from None
            say(f"beamsim: {kept}")
            raise
        result = keep("designs", result, target, reporting)
        journal.remove()
        conclude("designs", result, target, reporting, interrupted)
