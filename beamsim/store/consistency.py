"""Result files whose curves contradict their own figures, which no reading notices: they are damaged.

A motion that leaves the range of numbers is cut before that and has an outcome, so that no stored curve holds NaN; and
none goes beyond the peak in the summary. Both are looked at before a result is drawn, animated or exported.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from beamsim.analyses.run.result import EnergyHistory
from beamsim.errors import ResultFileError
from beamsim.fields import Dataset, Group, Members, RowBlocks, filled, members_of, rows_of
from beamsim.store.results import open_result

FAR = 2.0  # times the peak: those of stepped and of stopped motions are peaks of some of the samples
BEYOND = 1e100  # in its unit: no input within the range of physical quantities (1e30, 1e-30 Hz) leads there

Curve = tuple[str, str, Any, float | None]  # what it is, its unit, its values, the peak in the summary if there is one


def open_consistent(path: Path | str, kind: str = "") -> Any:
    """Read a result file as `open_result` does, and look at its curves.

    Raises
    ------
    ResultFileError
        Also where a curve holds NaN or infinity, goes far beyond its peak, or beyond all that inputs lead to.
    """
    result = open_result(path, kind)
    for name, unit, values, peak in _curves(result):
        largest = _largest(values)
        if not np.isfinite(largest):
            reason = f"the {name} holds values that are not finite"
        elif peak is not None and largest > FAR * peak:
            reason = f"the {name} reaches {largest:.4g} {unit}, and its peak is {peak:.4g} {unit}"
        elif largest > BEYOND:
            reason = f"the {name} reaches {largest:.4g} {unit}"
        else:
            continue
        raise ResultFileError(f"{path}: damaged ({reason}); run the case again")
    return result


def _largest(values: Any) -> float:
    """Largest magnitude; NaN where there is one."""
    size = values.size if isinstance(values, RowBlocks) else len(values)
    part = values.block if isinstance(values, RowBlocks) else max(size, 1)
    parts = (np.max(np.abs(values[first : first + part]), initial=0.0) for first in range(0, size, part))
    return float(np.max(list(parts), initial=0.0))


def _curves(result: Any) -> Iterator[Curve]:
    """What a result shows over time, frequency or another parameter."""
    from beamsim.analyses.response.result import FrequencyResponse
    from beamsim.analyses.run.result import RunResult
    from beamsim.analyses.sweep.result import SweepResult

    summary: Mapping[str, Any] = result.summary
    if isinstance(result, RunResult):
        peaks = {f"displacement of {name}": peak for name, peak in summary["peak_displacement_m"].items()}
        for name, unit, values in _histories(result):
            yield name, unit, values, peaks.get(name)
    elif isinstance(result, SweepResult) and result.complete:
        for curve in result.curves.values():
            for name, envelope in curve.displacement.items():
                peak = summary["peak_displacement_m"].get(curve.name, {}).get(name)
                yield f"displacement of {name}, {curve.name},", "m", envelope.peak, peak
    elif isinstance(result, FrequencyResponse) and result.complete:
        for number, branch in enumerate(result.branches):
            for name, values in branch.peak_displacement.items():
                largest = max((peak["value_m"] for peak in summary["peaks"] if peak["probe"] == name), default=None)
                peak = largest if branch.period_multiple == 1 else None  # files of earlier versions: only those count
                yield f"displacement of {name}, branch {number + 1},", "m", values, peak


def _histories(owner: Any, called: str = "") -> Iterator[tuple[str, str, Any]]:
    """Quantities over time, with their units; energies are NaN where their computation was interrupted."""
    for member in members_of(type(owner)):
        declaration, value = member.declaration, None if member.derived else rows_of(owner, member.name)
        if value is None or isinstance(value, EnergyHistory):
            continue
        if isinstance(declaration, Dataset) and declaration.along == ("time",) and declaration.flags is None:
            unit = filled(declaration.unit, (owner,))
            yield f"{member.name.replace('_', ' ')}{f' of {called}' if called else ''}", unit, value
        elif isinstance(declaration, Group):
            yield from _histories(value, called or member.name)
        elif isinstance(declaration, Members) and isinstance(value, Mapping):
            for name, item in value.items():
                yield from _histories(item, str(name))
