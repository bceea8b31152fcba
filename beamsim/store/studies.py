"""Design studies, ensembles and coexisting motions that are kept in a file while they are computed.

Each case is written to a journal beside the file as soon as it is solved, so that a killed study can be resumed. The
first line of the journal identifies the study, followed by a line of JSON for every case in the order of completion.
Numbers are read back without loss. An incomplete last line, from a process that was killed, is cut off.
"""

from __future__ import annotations

import json
import os
import time as clock
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from beamsim.analyses.designs.gathering import gather
from beamsim.analyses.designs.plan import DesignPlan, check_cases, plan_draws
from beamsim.analyses.designs.result import CaseOutcome, DesignsResult
from beamsim.errors import ResultFileError
from beamsim.files import check_writable
from beamsim.outcomes import Outcome, Stop, never
from beamsim.scenario import Scenario
from beamsim.store.results import keep_result, write_result
from beamsim.trust.studies import design_study
from beamsim.version import __version__

SAVED_EVERY_S = 30.0  # interval between updates of the result file


def stored_study(
    plan: DesignPlan,
    journal: Journal,
    target: Path,
    *,
    workers: int = 1,
    scheduler: str | None = None,
    progress: Callable[[float], None] | None = None,
    stop: Stop = never,
) -> DesignsResult:
    """Solve the cases that a journal lacks, each kept in it, and write their table to a file.

    The file is written now and then, and with what there is at the end, whatever that is. The journal is removed once
    the file has everything.

    Parameters
    ----------
    plan : checked by `check_cases`.
    journal : of this study.
    target : the result file.
    workers, scheduler, progress, stop : as of `design_study`.

    Returns
    -------
    DesignsResult
        Of the cases solved now and before.

    Raises
    ------
    ResultFileError
        If the file cannot be written.
    NotTrustedError
        If workers end unexpectedly.
    ScenarioError
        If there are fewer workers than one.
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
            plan, workers=workers, scheduler=scheduler, known=journal.kept, each=each, progress=progress,
            stop=stop,
        )  # fmt: skip
    except BaseException:
        if journal.kept:
            save()
        raise
    if journal.kept:
        keep_result(result, target)
    if result.finished:
        journal.remove()
    return result


def ensemble(
    scenario: Scenario,
    draws: Mapping[str, Sequence[Any] | Any],
    responses: Sequence[str] = (),
    *,
    file: str | Path | None = None,
    workers: int = 1,
    progress: Callable[[float], None] | None = None,
) -> DesignsResult:
    """Solve a scenario for every draw of some of its numbers, and tabulate what comes out.

    What the draws do not change (mesh, modes, reduction) is built once by every worker. The numbers are the same bits
    whatever the number of workers.

    Parameters
    ----------
    scenario : with a ``run``; or with a ``sweep``, which is then computed for every draw.
    draws : by path of a number, as in ``vary``, an array of its values, one a case: in SI units, or text with units.
        The path ``excitation.seed`` draws realisations of a random input.
    responses : what is computed: quantities (``peak_force``), or whole names (``snubbers/tip/peak_force``). By default
        everything, of which the bending stress takes most of the time.
    file : where the table is stored. While it is computed, each case is kept beside it, so that an ensemble that was
        interrupted goes on where it was when it is called again.
    workers : number of processes; several need the call below ``if __name__ == "__main__":``, as of `design_study`.
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


LOCKED_BYTE = 2**30  # on Windows, which locks bytes: far beyond the contents


def journal_path(target: Path) -> Path:
    """Path of the journal, in the same folder as the result file."""
    return target.with_name(f"{target.name}.partial")


@contextmanager
def opened_journal(path: Path, fingerprint: str, *, resume: bool) -> Iterator[Journal]:
    """The journal of one study, for one process at a time; it goes with the block where nothing was solved.

    Parameters
    ----------
    path : of the journal.
    fingerprint : hash of everything that the outcomes of the cases depend on.
    resume : keep the cases already solved; else start again.

    Yields
    ------
    Journal
        Locked and open, with the outcomes that are kept.

    Raises
    ------
    ResultFileError
        If the file cannot be written, belongs to another study than the one to be resumed, or is in use.
    """
    check_writable(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "a+b") as file:
        _lock(file, path)
        journal = Journal(path, file, _line({"study": f"{fingerprint} by beamsim {__version__}"}), resume=resume)
        try:
            yield journal
        finally:
            if not journal.kept:
                journal.remove()


class Journal:
    """The cases of a study that are solved; see `opened_journal`."""

    def __init__(self, path: Path, file: IO[bytes], header: bytes, *, resume: bool) -> None:
        self.path, self._file = path, file
        self.kept: list[CaseOutcome] = []  # in the order of completion; of some cases also with a comparison
        self.dropped = 0  # solved cases of this study that are discarded without resume
        file.seek(0)
        lines = file.read().splitlines(keepends=True)
        known, size = _outcomes(lines[1:]) if lines[:1] == [header] else ([], 0)
        if not resume:
            self.dropped = len({outcome.index for outcome in known})
        elif lines[:1] == [header]:
            self.kept = known
            file.truncate(len(header) + size)
            return
        elif lines and lines[0].endswith(b"\n"):
            raise ResultFileError(
                f"{path}: belongs to another study (the scenario, its values or the version of beamsim differ); "
                "leave out --resume to start again, or choose another path with -o"
            )
        file.truncate(0)
        self._write(header)

    @property
    def outcomes(self) -> dict[int, CaseOutcome]:
        """By index of the case; of one that was solved again, with its comparison with a finer model."""
        return {outcome.index: outcome for outcome in sorted(self.kept, key=lambda outcome: outcome.compared)}

    def add(self, outcome: CaseOutcome) -> None:
        """Write one case."""
        self.kept.append(outcome)
        self._write(_line({**vars(outcome), "outcome": outcome.outcome.as_dict()}))

    def _write(self, line: bytes) -> None:
        self._file.write(line)
        self._file.flush()

    def remove(self) -> None:
        """Remove the journal once everything is in the result file."""
        self._file.close()  # Windows cannot remove open files
        self.path.unlink(missing_ok=True)


def _line(values: object) -> bytes:
    return f"{json.dumps(values, ensure_ascii=False)}\n".encode()


def _outcomes(lines: Iterable[bytes]) -> tuple[list[CaseOutcome], int]:
    """The cases in lines up to the first that is incomplete, and their size in bytes."""
    outcomes, size = list[CaseOutcome](), 0
    for line in lines:
        try:
            case = json.loads(line if line.endswith(b"\n") else b"")
            read = {name: tuple(case[name]) for name in ("given", "warnings")}
            outcomes.append(CaseOutcome(**{**case, **read, "outcome": Outcome.from_dict(case["outcome"])}))
        except (KeyError, TypeError, ValueError):
            break
        size += len(line)
    return outcomes, size


def _lock(file: IO[bytes], path: Path) -> None:
    """Lock an open file for this process, if its system and file system have locks.

    Raises
    ------
    ResultFileError
        If another process has locked it.
    """
    try:
        try:
            import fcntl
        except ImportError:
            import msvcrt

            os.lseek(file.fileno(), LOCKED_BYTE, os.SEEK_SET)
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined, unused-ignore]
        else:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):
        raise ResultFileError(
            f"{path}: another process is computing this study; wait for it, or choose another path with -o"
        ) from None
    except (ImportError, OSError):
        pass
