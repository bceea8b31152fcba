"""Shock response spectra of a run: of its moving supports and probes, and of a matched base motion."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np

from beamsim.analyses.run.layouts import MATCHED, SRS
from beamsim.analyses.run.result import MAIN_QUANTITY
from beamsim.flow.channels import outputs_of
from beamsim.flow.trajectory import Trajectory
from beamsim.inputs.measured import limit_curve, on_curve, target_curve
from beamsim.inputs.signal import Signal as Pieces
from beamsim.labelled import Dataset
from beamsim.responses.histories import Histories
from beamsim.results.values import ACCELERATION
from beamsim.scenario.body import MovedSupport
from beamsim.scenario.excitation import MatchedInput
from beamsim.signals.filters import Signal, geomspaced, shock_spectra, smooth_intervals
from beamsim.structures.places import UPWARDS, Link
from beamsim.structures.support_forces import supports_of
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats, not_none


def shock_response(system: StructuralSystem, motion: Trajectory | Histories) -> Dataset:
    """Spectra of the base acceleration, and of the absolute accelerations of moving supports and of probes.

    Parameters
    ----------
    system : system of a run with ``run.srs``.
    motion : closed form; or values at output times, with cubic splines through the accelerations.

    Returns
    -------
    Dataset
        Layout `SRS`: the base's spectrum first, then those of supports.

    Raises
    ------
    ScenarioError
        If the motion is too fast for its duration, see `shock_spectra`.
    """
    from scipy.interpolate import CubicSpline

    settings = not_none(not_none(system.scenario.run).srs)
    along = geomspaced(settings.from_, settings.to, settings.per_octave)
    names, peaks = [(probe.name, MAIN_QUANTITY) for probe in system.probes], []
    if isinstance(motion, Trajectory):
        times, fastest = smooth_intervals(motion)
        accelerations = outputs_of(motion.flow, system.channels.of_keys(ACCELERATION).linear)
        responses: Signal = lambda at: motion.sample(at, accelerations)  # noqa: E731
    else:
        times, fastest = motion.time, np.zeros(motion.time.size - 1)
        responses = CubicSpline(times, motion.of(ACCELERATION))
    for count, (name, signals) in enumerate(_driven_inputs(system)):
        end = max(_end(signal, float(times[-1])) for _, signal in signals)
        until, summed = np.append(times[times < end], end), partial(_summed, signals)
        names.insert(count, name)
        peaks.append(shock_spectra(along, settings.quality, until, summed, fastest[: until.size - 1]))
    peaks.append(shock_spectra(along, settings.quality, times, responses, fastest))
    high, low, after_high, after_low = np.moveaxis(np.concatenate(peaks), 1, 0)
    primary, residual = np.maximum(high, low), np.maximum(after_high, after_low)
    limits = [limit_curve(system.scenario, "srs", name, "acceleration", along) for name, _ in names]
    none = np.full(along.size, np.nan)
    return SRS.dataset(
        {
            "quality": settings.quality,
            "frequency_hz": along,
            "signal": [f"{name} {quantity}" for name, quantity in names],
            "name": [name for name, _ in names],
            "maximax": np.maximum(primary, residual),
            "primary": primary,
            "residual": residual,
            "positive": np.maximum(high, after_high),
            "negative": np.maximum(low, after_low),
            "limit": None if all(x is None for x in limits) else np.array([none if x is None else x for x in limits]),
        }
    )


def _summed(signals: Sequence[tuple[float, Pieces]], at: Floats) -> Floats:
    """(nt, 1) weighted sum of signals at given times."""
    return np.asarray(sum(factor * signal(at) for factor, signal in signals))[:, None]


def _driven_inputs(system: StructuralSystem) -> Iterator[tuple[tuple[str, str], list[tuple[float, Pieces]]]]:
    """Inputs that move along a line, the base first: name and quantity, weighted accelerations.

    A support moves with the base and relative to it.
    """
    model = system.model
    names, moved_base = system.scenario.input_names, [moved.acceleration for moved in system.base]
    for name, base, (_, driven) in zip(names, moved_base, model.acting_loads.base, strict=False):
        if not driven.rotates or len(moved_base) == 1:
            yield (name, "acceleration"), [(1.0, base)]
    levers: dict[Any, list[float]] = {}
    for motion in model.base or (UPWARDS,):
        for each in supports_of(model.structure, motion):
            levers.setdefault((each.body, each.name, each.direction), []).append(each.base_motion)
    moving: dict[str, list[tuple[float, Pieces]]] = {}
    for moved in model.moving_supports:
        support, own = moved.support, system.forcing.signal[model.acting_loads.signals[moved.path, "acceleration"]]
        at, lever = moved.excitation.applied_to, levers.get((support.body, support.name, support.direction))
        if isinstance(at, MovedSupport) and not at.rotates and lever is not None and not isinstance(support.site, Link):
            with_base = [(share, base) for share, base in zip(lever, moved_base, strict=False) if share]
            moving.setdefault(at.label, with_base).append((1.0, own))
    yield from (((name, MAIN_QUANTITY), signals) for name, signals in moving.items())


def matched_spectra(system: StructuralSystem) -> Dataset:
    """Spectra of the base motions that were made for a curve, with the layout `MATCHED`.

    They are those of the motions in closed form, at twelve points per octave and at the points of the curves.
    """
    names, moving = system.scenario.base_motion_names, zip(system.model.acting_loads.base, system.base, strict=True)
    found: dict[str, tuple[float, Floats, Floats, Floats]] = {}
    for name, ((path, excitation), base) in zip(names, moving, strict=True):
        if isinstance(excitation, MatchedInput):
            at, value = target_curve(excitation, system.scenario.folder_of(*path, "srs", "file"))
            frequency = np.union1d(at, geomspaced(at[0], at[-1], 12))
            signal = partial(_summed, [(1.0, base.acceleration)])
            peaks = shock_spectra(frequency, excitation.quality, base.acceleration.start, signal, 0.0)
            found[name] = excitation.quality, frequency, on_curve(frequency, at, value), peaks[0].max(axis=0)
    every = np.unique(np.concatenate([frequency for _, frequency, _, _ in found.values()]))
    target, reached = np.full((2, len(found), every.size), np.nan)
    for k, (_, frequency, *rows) in enumerate(found.values()):
        target[k, np.searchsorted(every, frequency)], reached[k, np.searchsorted(every, frequency)] = rows
    qualities = [quality for quality, *_ in found.values()]
    known = {"target": target, "reached": reached, "misfit_db": 20.0 * np.log10(reached / target)}
    return MATCHED.dataset({"base_motion": list(found), "quality": qualities, "frequency_hz": every, **known})


def _end(signal: Callable[[Floats], Floats], end: float) -> float:
    """End of the record of a motion: the end of its pulse, at most the end of the run."""
    if isinstance(signal, Pieces) and not signal.coefficient[-1].any() and signal.start[-1] > 0.0:
        return min(float(signal.start[-1]), end)
    return end
