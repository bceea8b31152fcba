"""Writing and reading of result files; a file is written completely or not at all.

The fields of the result declare what is stored; see `beamsim.fields`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from beamsim.flow.stopping import never
from beamsim.kinds import KINDS, kind_of_class, named
from beamsim.store import declared
from beamsim.store.stored import (
    LazyScenario,
    creating,
    kind_of,
    reading,
    rewrite_outcome,
    root_fields,
    write_root,
)

if TYPE_CHECKING:
    from beamsim.analyses.compare.result import Comparison
    from beamsim.analyses.compare_modes.result import ModeComparison
    from beamsim.analyses.designs.result import DesignsResult
    from beamsim.analyses.identify.result import IdentificationResult
    from beamsim.analyses.nnm.result import NormalModeResult
    from beamsim.analyses.response.result import FrequencyResponse
    from beamsim.analyses.result import Result
    from beamsim.analyses.run.result import RunResult
    from beamsim.analyses.sweep.result import SweepResult

_Result = TypeVar("_Result", bound="Result")


def write_result(result: Result, path: Path | str) -> Path:
    """Write a result to ``path``; an existing file is replaced only when the new one is complete.

    Raises
    ------
    ResultFileError
        If the file cannot be written (no permission, disk full, a folder of that name).
    """
    write_until(result, path, never)
    return Path(path)


def write_until(
    result: _Result, path: Path | str, stop: Callable[[], bool], progress: Callable[[float], None] | None = None
) -> _Result:
    """As `write_result`, but ended by ``stop``, which is asked between parts of long histories.

    Then the file holds the histories up to there, and an outcome that says so.

    Parameters
    ----------
    progress : called with the share of the histories that is written.

    Returns
    -------
    The result with the outcome that is in the file.
    """
    with creating(path) as file:
        write_root(file, result, KINDS[kind_of_class(type(result))].command)
        for done, count in declared.write_in_parts(file, result):
            if progress is not None:
                progress(done / count)
            if done < count and stop():
                result = result.interrupted(f"the writing of the histories ({done} of {count} samples are kept)")
                rewrite_outcome(file, result)
                break
    return result


def has_long_histories(result: Result) -> bool:
    """Whether histories are written in parts, so that they may take a while."""
    return declared.is_long(vars(result).get("time"))


def open_result(path: Path | str, kind: str = "") -> Any:
    """Read a result file of one of `KINDS` (of any kind without `kind`).

    ``result.scenario`` is parsed on first use.

    Raises
    ------
    ResultFileError
        If the file is missing, unreadable, damaged, not from beamsim, or of another layout or kind.
    """
    kind = kind or kind_of(path)
    home = named(KINDS[kind].result)
    with reading(path, kind) as file:
        return _stored(home).of({**root_fields(file), **declared.read(home, file)})


@cache
def _stored(cls: Any) -> Any:
    return type(f"Stored{cls.__name__}", (LazyScenario, cls), {"__doc__": f"A `{cls.__name__}` read from a file."})


write_run = write_sweep = write_frequency_response = write_designs = write_result
write_identification = write_nnm = write_comparison = write_mode_comparison = write_result


def open_run(path: Path | str) -> RunResult:
    """Read a file written by ``beamsim run``; see `open_result`."""
    return open_result(path, "run")  # type: ignore[no-any-return]


def open_sweep(path: Path | str) -> SweepResult:
    """Read a file written by ``beamsim sweep`` for a swept or stepped sine; see `open_result`."""
    return open_result(path, "sweep")  # type: ignore[no-any-return]


def open_response(path: Path | str) -> FrequencyResponse:
    """Read a file written by ``beamsim sweep`` with ``kind: continuation``; see `open_result`."""
    return open_result(path, "continuation")  # type: ignore[no-any-return]


def open_designs(path: Path | str) -> DesignsResult:
    """Read a file written by ``beamsim sweep`` of a scenario with ``vary``; see `open_result`."""
    return open_result(path, "designs")  # type: ignore[no-any-return]


def open_nnm(path: Path | str) -> NormalModeResult:
    """Read a file written by ``beamsim nnm``; see `open_result`."""
    return open_result(path, "nnm")  # type: ignore[no-any-return]


def open_identification(path: Path | str) -> IdentificationResult:
    """Read a file written by ``beamsim identify-stiffness``; see `open_result`."""
    return open_result(path, "identify-stiffness")  # type: ignore[no-any-return]


def open_comparison(path: Path | str) -> Comparison:
    """Read a file written by ``beamsim compare``; see `open_result`."""
    return open_result(path, "compare")  # type: ignore[no-any-return]


def open_mode_comparison(path: Path | str) -> ModeComparison:
    """Read a file written by ``beamsim compare-modes``; see `open_result`."""
    return open_result(path, "compare-modes")  # type: ignore[no-any-return]
