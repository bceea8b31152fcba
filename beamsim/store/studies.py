"""Design studies, ensembles and coexisting motions that are kept in a file while they are computed.

Each case is written to a journal in the folder of the file as soon as it is solved, so that a killed study can be
resumed. The first line of the journal identifies the study, followed by a line of JSON for every case in the order of
completion. Numbers are read back without loss. Lines that are damaged or incomplete are ignored and reported. Nothing
is removed from a journal: one that is not continued is moved aside.
"""

from __future__ import annotations

import json
import logging
import os
import sys
import time as clock
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import IO, Any

from beamsim.analyses.studies.plan import StudyPlan, check_cases, plan_draws
from beamsim.analyses.studies.result import StudyResult
from beamsim.analyses.studies.summary import result_of
from beamsim.cases import CaseOutcome
from beamsim.errors import NotWrittenError, ResultFileError
from beamsim.files import Content, check_writable, demand_memory, destination, move_aside, open_to_append
from beamsim.outcomes import Outcome
from beamsim.parallel import Cluster
from beamsim.results.result import used_processor_time
from beamsim.scenario import Source, scenario_of
from beamsim.scenario.base import count_text
from beamsim.store.results import keep_result, write_result
from beamsim.trust.studies import design_study
from beamsim.version import __version__

_LOG = logging.getLogger(__name__)
SAVED_EVERY_S = 30.0  # interval between updates of the result file


def stored_study(
    plan: StudyPlan, journal: Journal, target: Path, *, workers: int = 1, scheduler: str | Cluster | None = None,
    progress: Callable[[float], None] | None = None,
) -> tuple[StudyResult, Path]:  # fmt: skip
    """Solve the cases that a journal lacks, each kept in it, and write their table to a file.

    The file is written now and then, and with what there is at the end, whatever that is. The journal is removed once
    the file has everything.

    Parameters
    ----------
    plan : checked by `check_cases`.
    journal : of this study.
    target : the result file.
    workers, scheduler, progress : as of `design_study`.

    Returns
    -------
    result : StudyResult
        Of the cases solved now and before.
    written : Path
        The file that was written: ``target``, or that of a partial result if ``target`` is a complete one.

    Raises
    ------
    ResultFileError
        If the file cannot be written.
    NotTrustedError
        If the connection to the cluster is lost, or it has no workers.
    ScenarioError
        If there are fewer workers than one.
    """
    begin = saved = clock.monotonic()

    def add_to_journal(outcome: CaseOutcome) -> None:
        nonlocal saved
        journal.add(outcome)
        if clock.monotonic() - saved > SAVED_EVERY_S:
            save()
            saved = clock.monotonic()

    def save() -> None:
        with suppress(NotWrittenError):  # every case is in the journal
            write_result(result_of(plan, journal.outcomes, clock.monotonic() - begin), target, resumed=journal.resumed)

    try:
        result = design_study(
            plan, workers=workers, scheduler=scheduler, progress=progress, solved_before=journal.solved,
            on_outcome=add_to_journal)  # fmt: skip
    except BaseException:
        if journal.added:
            save()
        raise
    written = target
    if journal.added or result.finished:
        result = replace(result, command_processor_time_s=used_processor_time())
        written = keep_result(result, target, resumed=journal.resumed)
    if result.finished:
        journal.remove()
    return result, written


def ensemble(
    scenario: Source,
    draws: Mapping[str, Sequence[Any] | Any],
    responses: Sequence[str] = (),
    *,
    file: str | Path | None = None,
    workers: int = 1,
    progress: Callable[[float], None] | None = None,
) -> StudyResult:
    """Solve a scenario for every draw of some of its numbers, and tabulate what comes out.

    What the draws do not change (mesh, modes, reduction) is built once by every worker. The numbers are the same bits
    whatever the number of workers.

    Parameters
    ----------
    scenario : with a ``run``; or with a ``sweep``, which is then computed for every draw; or what
        `beamsim.load_scenario` reads.
    draws : by path of a number, as in ``vary``, an array of its values, one a case: in SI units, or text with units.
        The path ``excitation.seed`` draws realisations of a random input.
    responses : what is computed: quantities (``peak_force``), or whole names (``snubbers/tip/peak_force``). By default
        everything, of which the bending stress takes most of the time.
    file : where the table is stored. While it is computed, each case is kept in a journal in the same folder, so that
        an ensemble that was interrupted continues when it is called again.
    workers : number of processes; several need the call below ``if __name__ == "__main__":``, as of `design_study`.
    progress : called with the fraction of cases done.

    Returns
    -------
    StudyResult
        Of the kind ``draws``; `StudyResult.table` has the columns. A draw that is no valid scenario or that fails has
        no responses (nan); ``failure`` of ``cases`` says why.

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
    >>> case = beamsim.load_scenario("configs/stops/chain_bumpers.yaml", {"sweep": None})
    >>> gaps, levels = rng.normal(5e-4, 1e-4, 20), rng.uniform(9.0, 11.0, 20)
    >>> draws = {"chain.snubbers.bumper.gap": gaps, "excitation.level": levels}
    >>> table = beamsim.ensemble(case, draws, ["peak_force"]).table
    >>> print(f"{np.quantile(table['snubbers/bumper/peak_force'], 0.9):.2f} N")
    40.98 N
    """
    scenario = scenario_of(scenario)
    plan = plan_draws(scenario, draws, responses)
    check_cases(plan)
    if file is None:
        return design_study(plan, workers=workers, progress=progress)
    target = Path(file)
    with opened_journal(journal_path(target), plan.fingerprint, resume=True) as journal:
        return stored_study(plan, journal, target, workers=workers, progress=progress)[0]


_MEMORY_OF_JOURNAL = 10
"""Bytes of memory for each byte of a journal that is read."""
_BEGIN = b'{"study": '
LOCKED_BYTE = 2**30  # on Windows, which locks bytes: far beyond the contents


def journal_path(target: Path) -> Path:
    """Path of the journal, in the same folder as the result file."""
    return target.with_name(f"{target.name}.partial")


@contextmanager
def opened_journal(path: Path, fingerprint: str, *, resume: bool) -> Iterator[Journal]:
    """The journal of one study, for one process at a time; an empty one goes with the block.

    Nothing that was solved is lost: a journal that is not continued stays as it is until the first case of the new
    study is solved, and is then moved aside.

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
    journal = Journal(path, _line({"study": f"{fingerprint} by beamsim {__version__}"}), resume=resume)
    try:
        yield journal
    finally:
        journal.close()


class Journal:
    """The cases of a study that are solved; see `opened_journal`."""

    def __init__(self, path: Path, header: bytes, *, resume: bool) -> None:
        self.path, self._header = path, header
        self.solved: list[CaseOutcome] = []  # in the order of completion; of some cases also with a comparison
        self.added = False  # whether a case was solved since it was opened
        self.resumed = resume
        self._found = Content.CONTAINED  # which it goes on from
        self._lead = header  # what is written before the next line
        self._file = _opened_and_locked(path)
        try:
            self._read()
        except BaseException:
            self._file.close()
            raise

    def _read(self) -> None:
        if not self.resumed:
            self._found = Content.JOURNAL if self._file.read(len(_BEGIN)) == _BEGIN else Content.UNKNOWN
            return
        size = os.fstat(self._file.fileno()).st_size
        demand_memory(self.path, _MEMORY_OF_JOURNAL * size, "for its cases", "leave out --resume to move it aside")
        content = self._file.read()
        lines = content.splitlines(keepends=True)
        if len(content) >= len(self._header) or not self._header.startswith(content):
            self._lead = b"" if content.endswith(b"\n") else b"\n"
        else:  # its writer was killed before the first case
            self._lead = self._header[len(content) :]
        if lines and lines[0] == self._header:
            self.solved, damaged = _outcomes(lines[1:])
            if damaged:
                numbers = ", ".join(map(str, damaged[:20])) + (", ..." if len(damaged) > 20 else "")
                text = "warning: %s: %s damaged and ignored, and solved again: line %s"
                _LOG.warning(text, self.path, count_text(len(damaged), "line is", "lines are"), numbers)
        elif not self._header.startswith(content):
            raise ResultFileError(
                f"{self.path}: belongs to another study (the scenario, its values or the version of beamsim differ); "
                "leave out --resume to move it aside and start again, or choose another path with -o"
            )

    @property
    def outcomes(self) -> dict[int, CaseOutcome]:
        """By index of the case; of one that was solved again, with its comparison with a finer model."""
        return {outcome.index: outcome for outcome in sorted(self.solved, key=lambda outcome: outcome.compared)}

    def add(self, outcome: CaseOutcome) -> None:
        """Write one case.

        Raises
        ------
        NotWrittenError
            If there is no room for it.
        """
        line = _line({**vars(outcome), "outcome": outcome.outcome.as_dict()})
        try:
            if not self.added and destination(self.path, Content.JOURNAL, lambda _: self._found).moves_aside:
                self._move_aside()
            _write(self._file, self._lead + line)
        except OSError as error:
            remedy = f"the {count_text(len(self.solved), 'case')} before are kept; make room and continue with --resume"
            raise NotWrittenError(self.path, error.strerror or str(error), remedy) from error
        self._lead, self.added = b"", True
        self.solved.append(outcome)

    def _move_aside(self) -> None:
        """Give the journal found here another name, and begin a new one."""
        earlier = self._file
        if sys.platform == "win32":
            earlier.close()
        aside = move_aside(self.path)
        self._file, self._lead = _opened_and_locked(self.path), self._header
        earlier.close()
        _LOG.warning("warning: starting again; %s held %s; it is kept in %s", self.path, self._found.value, aside)
        self._found = Content.CONTAINED

    def remove(self) -> None:
        """Remove the journal once everything is in the result file."""
        self._file.close()  # Windows cannot remove open files
        if self.added or self._found is Content.CONTAINED:
            self.path.unlink(missing_ok=True)

    def close(self) -> None:
        """Close the journal; one without any content is removed."""
        if self._file.closed:
            return
        empty = os.fstat(self._file.fileno()).st_size == 0
        if empty and sys.platform != "win32":
            self.path.unlink(missing_ok=True)  # before it is unlocked, so that no other process has it
        self._file.close()
        if empty and sys.platform == "win32":
            self.path.unlink(missing_ok=True)


def _line(values: object) -> bytes:
    return f"{json.dumps(values, ensure_ascii=False)}\n".encode()


def _write(file: IO[bytes], data: bytes) -> None:
    """Write all bytes to an unbuffered file, which may take them in parts."""
    rest = memoryview(data)
    while rest:
        rest = rest[file.write(rest) :]


def _outcomes(lines: Iterable[bytes]) -> tuple[list[CaseOutcome], list[int]]:
    """The cases in the lines after the first one, and the numbers of lines in the file that hold none."""
    outcomes, damaged = list[CaseOutcome](), list[int]()
    for number, line in enumerate(lines, 2):
        try:
            outcomes.append(_outcome(json.loads(line)))
        except (AttributeError, LookupError, TypeError, ValueError, RecursionError):
            damaged.append(number)
    return outcomes, damaged


def _outcome(case: Any) -> CaseOutcome:
    """The case that a line holds.

    Raises
    ------
    AttributeError, LookupError, TypeError, ValueError
        If it is damaged.
    """
    outcome = Outcome.from_dict(case["outcome"])
    read = {name: tuple(case[name]) for name in ("given", "warnings", "deviations")}
    found = CaseOutcome(**{**case, **read, "outcome": outcome})
    responses = [value for item in found.values.values() for value in (item if isinstance(item, list) else [item])]
    margins = [value for margin in found.margins.values() for value in margin.values()]
    right = (
        type(found.index) is int and found.index >= 0 and type(found.compared) is bool
        and all(_is_number(value) or isinstance(value, str) for value in responses)
        and _is_number(found.processor_time_s)
        and type(found.within) is int and all(_is_number(value) for value in found.deviations)
        and isinstance(case["given"], list)
        and isinstance(case["warnings"], list) and all(isinstance(text, str) for text in found.warnings)
        and all(value is None or isinstance(value, str | bool) or _is_number(value) for value in margins)
    )  # fmt: skip
    if not right or not isinstance(outcome.text, str):
        raise ValueError("not a case")
    return found


def _is_number(value: object) -> bool:
    return type(value) in (int, float)


def _opened_and_locked(path: Path) -> IO[bytes]:
    """The file at a path, made if it is missing, locked for this process and at its beginning.

    Raises
    ------
    ResultFileError
        If another process has locked it.
    """
    while True:
        file = open_to_append(path)
        try:
            _lock(file, path)
            file.seek(0)
            with suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(file.fileno()), path.stat()):
                    return file
        except BaseException:
            file.close()
            raise
        file.close()  # another process removed or moved it between opening and locking


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
