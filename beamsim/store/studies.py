"""Design studies and ensembles that are kept in a file while they are computed."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from beamsim.analyses.designs.analysis import design_study
from beamsim.analyses.designs.gathering import gather
from beamsim.analyses.designs.plan import DesignPlan, check_cases, plan_draws
from beamsim.analyses.designs.result import CaseOutcome, DesignsResult
from beamsim.outcomes import Stop, never
from beamsim.scenario import Scenario
from beamsim.store.journal import Journal, journal_path, opened_journal
from beamsim.store.results import write_result

SAVED_EVERY_S = 30.0  # interval between updates of the result file


def stored_study(
    plan: DesignPlan,
    journal: Journal,
    target: Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Callable[[float], None] | None = None,
    stop: Stop = never,
) -> DesignsResult:
    """Solve the cases that a journal lacks, each kept in it, and write their table to a file.

    The file is written now and then, and with what there is at the end, whatever that is. The journal is removed once
    the file has everything, or where no case was solved.

    Parameters
    ----------
    plan : checked by `check_cases`.
    journal : of this study.
    target : the result file.
    workers, scheduler, progress, stop : as of `design_study`.

    Raises
    ------
    ResultFileError
        If the file cannot be written.
    NotTrustedError
        If workers end unexpectedly.
    """
    begin = saved = clock.monotonic()

    def each(outcome: CaseOutcome) -> None:
        nonlocal saved
        journal.add(outcome)
        if clock.monotonic() - saved > SAVED_EVERY_S:
            save()
            saved = clock.monotonic()

    def save() -> None:
        write_result(gather(plan, journal.outcomes, clock.monotonic() - begin), target)

    try:
        result = design_study(
            plan, workers=workers, scheduler=scheduler, known=journal.outcomes.values(), each=each, progress=progress,
            stop=stop,
        )  # fmt: skip
    except BaseException:
        if journal.outcomes:
            save()
        else:
            journal.remove()
        raise
    if journal.outcomes:
        write_result(result, target)
    if len(journal.outcomes) in (0, len(plan.cases)):
        journal.remove()
    return result


def ensemble(
    scenario: Scenario,
    draws: Mapping[str, Sequence[Any] | Any],
    responses: Sequence[str] = (),
    *,
    file: str | Path | None = None,
    workers: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> DesignsResult:
    """Solve a scenario for every draw of some of its numbers, and tabulate what comes out.

    What the draws do not change (mesh, modes, reduction) is built once; runs march side by side on threads. The numbers
    are the same bits whatever the number of threads.

    Parameters
    ----------
    scenario : with a ``run``; or with a ``sweep``, which is then computed for every draw.
    draws : by path of a number, as in ``vary``, an array of its values, one a case: in SI units, or text with units.
        The path ``excitation.seed`` draws realisations of a random input.
    responses : what is computed: quantities (``peak_force``), or whole names (``snubbers/tip/peak_force``). By default
        everything, of which the bending stress takes most of the time.
    file : where the table is stored. While it is computed, each case is kept beside it, so that an ensemble that was
        interrupted goes on where it was when it is called again.
    workers : number of threads (of processes, where a case is a sweep); by default the number of processors.
    progress : called with the fraction of cases done.

    Returns
    -------
    DesignsResult
        Of the kind ``draws``; `DesignsResult.table` has the columns. A draw that is no valid scenario or that fails has
        no responses (nan), and is listed in ``failures``.

    Raises
    ------
    ScenarioError
        If a path or a response does not exist, numbers of values differ, or one of an evenly spaced selection of the
        draws is invalid.
    ResultFileError
        If ``file`` cannot be written, or what was kept there belongs to another ensemble.

    Examples
    --------
    >>> import beamsim, numpy as np
    >>> rng = np.random.default_rng(1)
    >>> case = beamsim.load_scenario("configs/one_sided_65hz.yaml")  # doctest: +SKIP
    >>> draws = {"snubbers.tip.gap": rng.normal(0.0, 2e-5, 1000), "excitation.level": rng.uniform(15.0, 25.0, 1000)}
    >>> table = beamsim.ensemble(case, draws, ["peak_force"]).table  # doctest: +SKIP
    >>> np.quantile(table["snubbers/tip/peak_force"], 0.99)  # doctest: +SKIP
    """
    plan = plan_draws(scenario, draws, responses)
    check_cases(plan)
    if file is None:
        return design_study(plan, workers=workers, progress=progress)
    target = Path(file)
    with opened_journal(journal_path(target), plan.fingerprint, resume=True) as journal:
        return stored_study(plan, journal, target, workers=workers, progress=progress)
