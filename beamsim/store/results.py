"""Results as files: written whole or not at all, read back as the result they were written from."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from beamsim.store import declared
from beamsim.store.stored import KINDS, LazyScenario, creating, reading, root_fields, write_root

if TYPE_CHECKING:
    from beamsim.analyses.result import Result
    from beamsim.analyses.run.result import RunResult
    from beamsim.analyses.sweep.result import SweepResult


def write_result(result: Result, path: Path | str, command: str) -> Path:
    """Write a result to ``path``; an existing file is replaced only when the new one is complete.

    Raises
    ------
    ResultFileError
        When the file cannot be written (no permission, disk full, a folder of that name).
    """
    with creating(path) as file:
        write_root(file, result, command)
        declared.write(file, result)
    return Path(path)


def read_result(cls: type, path: Path | str, kind: str) -> Any:
    """The result of class ``cls`` that a file of one of `KINDS` holds; its scenario is parsed when it is asked for.

    Raises
    ------
    ResultFileError
        When the file is missing, damaged, or holds something else; see `beamsim.store.stored.reading`.
    """
    with reading(path, kind) as file:
        return _stored(cls).of({**root_fields(file), **declared.read(cls, file)})


@cache
def _stored(cls: Any) -> Any:
    return type(f"Stored{cls.__name__}", (LazyScenario, cls), {"__doc__": f"A `{cls.__name__}` read from a file."})


def write_run(result: RunResult, path: Path | str) -> Path:
    """Write the result of `beamsim.run`; see `write_result`."""
    return write_result(result, path, KINDS["run"].command)


def open_run(path: Path | str) -> RunResult:
    """Read a file written by ``beamsim run``; see `read_result`."""
    from beamsim.analyses.run.result import RunResult

    return read_result(RunResult, path, "run")  # type: ignore[no-any-return]


def write_sweep(result: SweepResult, path: Path | str) -> Path:
    """Write the result of `beamsim.sweep`; see `write_result`."""
    return write_result(result, path, KINDS["sweep"].command)


def open_sweep(path: Path | str) -> SweepResult:
    """Read a file written by ``beamsim sweep`` of one design, swept or stepped; see `read_result`."""
    from beamsim.analyses.sweep.result import SweepResult

    return read_result(SweepResult, path, "sweep")  # type: ignore[no-any-return]
