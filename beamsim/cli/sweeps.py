"""Command ``sweep``: swept or stepped sine, continuation, coexisting motions, or many cases."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from signal import SIGINT
from typing import Any

from beamsim.analyses.continuation.analysis import with_overlay
from beamsim.analyses.continuation.forced_expansion import with_forced_expansion
from beamsim.analyses.continuation.result import ContinuationResult
from beamsim.analyses.studies.plan import check_cases, design, fingerprint_of, plan_designs
from beamsim.analyses.studies.result import StudyResult
from beamsim.analyses.sweep.analysis import demand_consistent
from beamsim.analyses.sweep.result import SweepResult
from beamsim.cli.command import compute_and_save, load_for_command, plot_and_print
from beamsim.cli.session import CommandOptions, Interruption, Progress, interruptible, progress_of, result_stem, say
from beamsim.errors import NotWrittenError, Problem, ResultFileError, ScenarioError, VerdictError
from beamsim.files import check_writable, partial_file, replacement_file
from beamsim.kinds import KINDS
from beamsim.outcomes import COMPLETE, exit_code, stop_requests
from beamsim.parallel import Cluster
from beamsim.results.result import used_processor_time
from beamsim.scenario import Scenario
from beamsim.scenario.base import as_plain_data
from beamsim.scenario.parameters import yaml_with_units
from beamsim.store.results import (
    is_result_of_kind,
    keep_result,
    load,
    refusing_damage,
    write_result,
)
from beamsim.store.studies import Journal, journal_path, opened_journal, stored_study
from beamsim.trust import with_finer_model
from beamsim.version import __version__

_NEEDS_VARY = "leave out the option, or add vary"
_NEEDS_CONTINUATION = "leave it out, or use sweep: {kind: continuation}"
# option -> kinds of sweep with that option; otherwise place (default: the option), message and remedy
_OPTIONS = {
    "workers": (("designs", "coexisting"), "vary", "is missing, but --workers applies to its cases", _NEEDS_VARY),
    "scheduler": (("designs", "coexisting"), "vary", "is missing, but --scheduler applies to its cases", _NEEDS_VARY),
    "wait_for_workers": (
        ("designs", "coexisting"),
        "vary",
        "is missing, but --wait-for-workers applies to its cases",
        _NEEDS_VARY,
    ),
    "resume": (("designs", "coexisting", "sweep"), "", "applies to no continuation", "leave it out"),
    "overlay": (("continuation",), "", "overlays a sweep on a curve by continuation", _NEEDS_CONTINUATION),
    "compare": (("continuation",), "", "compares with a curve of periodic motions", _NEEDS_CONTINUATION),
}


def swept(options: CommandOptions, own_options: Mapping[str, Any]) -> None:
    """Compute the sweep, continuation or study that the scenario requests.

    Parameters
    ----------
    options : shared options.
    own_options : options by name: workers, scheduler, wait_for_workers, overlay, compare.

    Raises
    ------
    ScenarioError
        If an option does not apply to the kind of sweep; also as `compute_and_save`.
    """
    scenario, target = load_for_command("sweep", options)
    kind = _kind(scenario)
    for name, value in {**own_options, "resume": options.resume}.items():
        allowed, path, message, remedy = _OPTIONS[name]
        if value not in (None, False) and kind not in allowed:
            raise ScenarioError(Problem(path or f"--{name}", message, remedy))
    if own_options["wait_for_workers"] is not None and own_options["scheduler"] is None:
        raise ScenarioError(Problem("--wait-for-workers", "applies to the workers of --scheduler", "leave it out"))
    of_cases = {name: own_options[name] for name in ("workers", "scheduler", "wait_for_workers")}
    if kind == "designs":
        sweep_designs(scenario, target, options, **of_cases)
    elif kind == "continuation":
        continue_motions(
            scenario, target, options, own_options["overlay"] or (), expansion=bool(own_options["compare"])
        )
    elif kind == "coexisting":
        _find_coexisting(scenario, target, options, **of_cases)
    else:
        _sweep_sine(scenario, target, options)


def _kind(scenario: Scenario) -> str:
    """Kind of the result, as in `beamsim.kinds.KINDS`."""
    if scenario.study is not None:
        return "designs"
    kind = getattr(scenario.sweep, "kind", "")
    return kind if kind in KINDS else "sweep"


def _sweep_sine(scenario: Scenario, target: Path, options: CommandOptions) -> None:
    """Compute a swept or stepped sine, saving partial results."""

    def save(part: SweepResult) -> None:
        with suppress(NotWrittenError):  # if there is still no room, the complete result is saved elsewhere
            write_result(part, target, resumed=options.resume)

    earlier = _partial_result(target, scenario) if options.resume else None
    if earlier is None:
        _report_no_resume(target, options)

    def computed(progress: Progress, stop: Interruption) -> SweepResult:
        with scenario.locating():
            result = with_finer_model.sweep(scenario, progress, stop=stop, save=save, resume=earlier)
        if not result.curves:  # interrupted before its first cycle
            raise KeyboardInterrupt
        return result

    sweep, cycles = scenario.sweep, ""
    if sweep is not None and sweep.kind == "swept_sine":
        levels = f" at each of {len(sweep.levels)} levels" if len(sweep.levels) > 1 else ""
        cycles = f" ({sweep.cycles:.0f} cycles{levels})"
    compute_and_save("sweep", target, options, computed, f"sweeping {options.case.name}{cycles}")


def _partial_result(path: Path, scenario: Scenario) -> SweepResult | None:
    """Partial result of an interrupted sweep of the same scenario; None without a file.

    Raises
    ------
    ResultFileError
        If the file belongs to another scenario, is damaged, or is inconsistent.
    """
    errors = []
    for file in (path, partial_file(path)):
        if not file.exists():
            continue
        try:
            stored: SweepResult = load(file, "sweep", whole=True)
        except ResultFileError as error:
            errors.append(error)
            continue
        if stored.scenario == scenario:
            with refusing_damage(file):
                demand_consistent(stored)
            return stored
        remedy = "leave out --resume to start again, or choose another path with -o"
        errors.append(ResultFileError(f"{file}: contains a sweep of another scenario; {remedy}"))
    if errors:
        raise errors[0]
    return None


def continue_motions(
    scenario: Scenario, target: Path, options: CommandOptions, overlay: Sequence[Path], *, expansion: bool
) -> None:
    """Trace periodic motions, add the requested overlays, save and print.

    Parameters
    ----------
    scenario : scenario with a continuation.
    target, options : see `compute_and_save`.
    overlay : files of sweeps.
    expansion : True to compare with the multiple-scales expansion.

    Raises
    ------
    BeamsimError
        See `compute_and_save`.
    """
    stored = [(path, load(path, "sweep", whole=True)) for path in overlay]

    def followed(progress: Progress, stop: Interruption) -> ContinuationResult:
        result = with_finer_model.continuation(scenario, progress, stop)
        for path, sweep in stored:
            with refusing_damage(path):
                result = with_overlay(result, sweep, path.name)
        with scenario.locating():
            return with_forced_expansion(result) if expansion and not result.outcome.interrupted else result

    compute_and_save("continuation", target, options, followed, "following periodic motions")


def sweep_designs(scenario: Scenario, target: Path, options: CommandOptions, **worker_options: Any) -> None:
    """Compute all cases (or the missing ones), save and print.

    Parameters
    ----------
    scenario : scenario with ``vary`` or ``optimise``.
    target, options : see `plot_and_print`.
    worker_options : workers, scheduler and wait_for_workers.

    Raises
    ------
    ScenarioError, ResultFileError
        Before the computation.
    VerdictError, NotTrustedError
        See `plot_and_print`; also if workers ended unexpectedly (the partial result is saved).
    """
    plan = plan_designs(scenario)
    check_cases(plan)
    limits = {} if scenario.limits is None else scenario.limits.values_by_name

    def is_same(stored: StudyResult) -> bool:
        return stored["cases"]["fingerprint"].item() == plan.fingerprint and stored.limits == limits

    if options.resume and _is_finished("designs", target, options, is_same):
        return
    for name in _DESIGNS if plan.searches else ():
        check_writable(_design_file(target, name))
    count = plan.most_cases * plan.study.realisations.count
    cases = f"at most {count}" if plan.searches else f"{count}"
    most_further = plan.study.realisations.most_further_cases if plan.study.realisations.judged_by_worst else 0
    further = f" and at most {most_further} further ones for the worst" if most_further else ""
    path = journal_path(target)
    with opened_journal(path, plan.fingerprint, resume=options.resume) as journal, interruptible() as interrupted:
        _report_saved_cases(journal, f" of {cases} cases", target, options)
        with _reporting_saved_cases(journal, f" of {cases} cases", interrupted):
            with progress_of(f"{cases} cases{further}", shown=not options.quiet) as progress:
                by = _workers(progress, **worker_options)
                with stop_requests(interrupted):
                    result, written = stored_study(plan, journal, target, progress=progress, **by)
            if not result.finished:
                raise KeyboardInterrupt
        plot_and_print(
            "designs", result, written, options, interrupted, _best_design(result, written) if plan.searches else ()
        )


def _workers(
    progress: Progress, *, workers: int | None, scheduler: str | None, wait_for_workers: float | None
) -> dict[str, Any]:
    """Arguments that define the workers; while there are no workers, no time is estimated."""

    def notify(text: str) -> None:
        progress.pause()
        say(f"beamsim: {text}")

    waiting = {} if wait_for_workers is None else {"wait_s": wait_for_workers}
    cluster = None if scheduler is None else Cluster(scheduler, notify=notify, **waiting)
    return {"workers": workers, "scheduler": cluster}


@contextmanager
def _reporting_saved_cases(journal: Journal, cases: str, interrupted: Interruption) -> Iterator[None]:
    """Tell how many cases are saved and how to resume, if the block fails or is interrupted.

    Raises
    ------
    VerdictError
        If it is interrupted.
    """
    try:
        yield
    except BaseException as error:
        if isinstance(error, ResultFileError) or not journal.outcomes:
            raise
        kept = f"{len(journal.outcomes)}{cases} are kept in {journal.path}; --resume computes the others"
        if isinstance(error, KeyboardInterrupt):
            code = exit_code(COMPLETE, signal=interrupted.signal or SIGINT)
            raise VerdictError(f"interrupted; {kept}", code) from None
        say(f"beamsim: {kept}")
        raise


def _is_finished(kind: str, target: Path, options: CommandOptions, is_same: Callable[[Any], bool]) -> bool:
    """True if the file has the complete requested result, which is then printed."""
    if journal_path(target).exists() or not is_result_of_kind(target, kind):
        return False
    stored: Any = load(target, kind)
    if not stored.outcome.usable or stored.beamsim_version != __version__:
        return False
    if not is_same(stored):
        return False
    if not options.quiet:
        say(f"beamsim: {target} is complete; there is nothing to compute")
    with refusing_damage(target), interruptible() as interrupted:
        plot_and_print(kind, stored, target, options._replace(no_plots=True), interrupted)
    return True


def _report_saved_cases(journal: Journal, cases: str, target: Path, options: CommandOptions) -> None:
    """Report the number of cases from an earlier call."""
    if not journal.outcomes:
        _report_no_resume(target, options)
    elif not options.quiet:
        say(f"beamsim: {len(journal.outcomes)}{cases} are already computed")


def _report_no_resume(target: Path, options: CommandOptions) -> None:
    """Report that ``--resume`` found nothing; a case from a result file is saved to another file."""
    if not options.resume or options.quiet:
        return
    of_result = options.output is None and result_stem(options) != options.case.stem
    remedy = f"; to go on with {options.case}, give the YAML of its case" if of_result else ""
    say(f"beamsim: there is nothing to resume in {target}; the computation starts again{remedy}")


def _find_coexisting(scenario: Scenario, target: Path, options: CommandOptions, **workers: Any) -> None:
    """Find coexisting motions; each outcome is saved in a journal as soon as it is known."""
    if options.resume and _is_finished("coexisting", target, options, lambda stored: stored.scenario == scenario):
        return
    path, fingerprint = journal_path(target), fingerprint_of(scenario, as_plain_data(scenario))
    with opened_journal(path, fingerprint, resume=options.resume) as journal, interruptible() as interrupted:
        _report_saved_cases(journal, " starts and disturbances", target, options)
        known = tuple(journal.solved)
        with (
            _reporting_saved_cases(journal, " starts and disturbances", interrupted),
            progress_of("motions from many starts", shown=not options.quiet) as progress,
            scenario.locating(),
        ):
            by = _workers(progress, **workers)
            result = with_finer_model.coexisting(
                scenario, progress, interrupted, solved_before=known, on_outcome=journal.add, **by
            )
        result = replace(result, command_processor_time_s=used_processor_time())
        written = keep_result(result, target, resumed=options.resume)
        if result.outcome.cut_short:
            say(f"beamsim: {len(journal.outcomes)} starts and disturbances are kept; --resume computes the others")
        else:
            journal.remove()
        plot_and_print("coexisting", result, written, options, interrupted)


_DESIGNS = ("best", "design_point")


def _design_file(target: Path, name: str) -> Path:
    """File for one of `_DESIGNS`, in the folder of the result file."""
    return target.with_name(f"{target.stem}_{name}.yaml")


def _best_design(result: StudyResult, target: Path) -> Iterator[Path]:
    """Write the best design of a search, or the design point of a probability, as a scenario."""
    best = result.summary.get("best")
    point = result.summary.get("reliability", {}).get("design_point")
    for name, case in zip(_DESIGNS, (best[0] if best else None, {"parameters": point} if point else None), strict=True):
        if case is None:
            continue
        path = _design_file(target, name)
        with replacement_file(path) as temporary:
            temporary.write_text(yaml_with_units(design(result.scenario, case)), encoding="utf-8")
        yield path
