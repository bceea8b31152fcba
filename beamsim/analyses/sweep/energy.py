"""The energy balance of a sweep: work in = dissipated + change of the stored energy, cycle by cycle."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from beamsim.analyses.run.energy import LARGEST_ERROR
from beamsim.analyses.sweep.result import SweepCurve
from beamsim.flow.endings import not_finite
from beamsim.outcomes import Outcome, OutcomeKind, Where, together
from beamsim.typing import Bools, Floats


def energy_errors(imbalance: Floats, energy: Floats, complete: Bools | None = None) -> Floats:
    """Imbalance in J that has added up until each complete cycle, over the largest energy in J of all of them.

    The last one answers for what follows it, too: the end of a sweep may be less than a cycle, which has no row.

    Parameters
    ----------
    imbalance, energy : (C,) of all cycles.
    complete : (C,) which of them are whole; all by default.
    """
    missing = np.abs(np.cumsum(imbalance))
    scale = float(np.max(energy, initial=0.0))
    errors = np.asarray(missing if scale == 0.0 else missing / scale)
    if complete is None:
        return errors
    last = int(np.flatnonzero(complete)[-1])
    errors[last] = np.max(errors[last:])
    return np.asarray(errors[complete])


def balanced(outcome: Outcome, curves: Iterable[SweepCurve]) -> Outcome:
    """The outcome of a level, whose curves are not to be trusted where the balance is lost."""
    parts = [part for curve in curves for part in _lost(curve)]
    if not parts:
        return outcome
    return together([*parts, *outcome.unless_complete])


def _lost(curve: SweepCurve) -> Iterator[Outcome]:
    """Where a curve loses its balance."""
    error = np.zeros(0) if curve.energy_error is None else curve.energy_error
    bad = np.flatnonzero(~(error <= LARGEST_ERROR))
    if not bad.size:
        return
    first = bad[0]
    if not np.all(np.isfinite(error)):
        yield not_finite(float(curve.time[first]))
        return
    yield Outcome.of(
        OutcomeKind.UNTRUSTED, "sweep_energy_not_balanced",
        f"sweeping {curve.direction}, the energy balance is wrong by {error.max():.2g} of the energy, from "
        f"{curve.frequency_hz[first]:.6g} Hz on by more than {LARGEST_ERROR:g}",
        at=Where(curve.level, curve.level_unit, "level"), remedy="sweep a smaller range around it",
        error=float(error.max()), frequency=float(curve.frequency_hz[first]),
    )  # fmt: skip
