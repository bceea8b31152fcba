"""The figures of a motion: extremes of what probes and snubbers report, and contact, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from beamsim.analyses.limits import STANDARD_GRAVITY
from beamsim.analyses.run.outputs import OutputOf
from beamsim.flow.contact_state import LinearOutput
from beamsim.flow.trajectory import Trajectory
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats, Ints

Extremes = dict[str, tuple[Floats, Floats, Floats, Floats]]  # by output group: lowest, its time, highest, its time
ROUND_OFF_PULL = 1e-9  # of the largest contact force


def sampled_extremes(times: Floats, values: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Lowest values (k,) of samples (nt, k), their times, highest values, their times."""
    return values.min(axis=0), times[values.argmin(axis=0)], values.max(axis=0), times[values.argmax(axis=0)]


def refine_extremes(
    trajectory: Trajectory, searched: Mapping[str, OutputOf], extremes: Extremes, check: Callable[[], None]
) -> None:
    """Replace extremes of samples by those of the continuous motion; ``check`` may raise an exception to end it."""
    for name, output_of in searched.items():
        low, when_low, high, when = extremes[name]
        high, when, _ = trajectory.maxima(output_of, high, when, check)
        low, when_low, _ = trajectory.maxima(_negative(output_of), -low, when_low, check)
        extremes[name] = (-low, when_low, high, when)


def _negative(output_of: OutputOf) -> Callable[[Ints], LinearOutput]:
    return lambda phases: -output_of(phases)


def motion_figures(
    system: StructuralSystem, extremes: Extremes, contact_share: Floats, closings: Ints
) -> dict[str, Any]:
    """By entry of the summary the figures of a motion, by name of probe, snubber or spring.

    Parameters
    ----------
    contact_share : (m,) of each contact.
    closings : (m,) number of closings of each contact.
    """
    probes = [p.name for p in system.probes]
    snubbers = [s.name for s in system.snubbers]
    count = len(snubbers)
    low, _, high, _ = extremes["displacement"]
    figures: dict[str, Any] = {
        "peak_displacement_m": by_name(probes, np.maximum(np.abs(low), np.abs(high))),
        "min_displacement_m": by_name(probes, low),
        "max_displacement_m": by_name(probes, high),
        "peak_acceleration_g": by_name(probes, largest(extremes["acceleration"]) / STANDARD_GRAVITY),
        "largest_pull_n": by_name(snubbers, largest_pulls(extremes["force"])[:count]),
        "peak_force_n": by_name(snubbers, extremes["force"][2][:count]),
        "largest_gap_m": by_name(snubbers, np.maximum(-extremes["penetration"][0][:count], 0.0)),
        "contact_share": by_name(snubbers, contact_share[:count]),
        "contacts": {name: int(number) for name, number in zip(snubbers, closings[:count], strict=True)},
    }
    if system.springs:
        ends = np.array(extremes["stretch"][::2]).T  # (springs, 2); the force is largest at one of them
        springs = [s.name for s in system.springs]
        figures["peak_stretch_m"] = by_name(springs, np.abs(ends).max(axis=1))
        forces = [np.abs(s.force(x)).max() for s, x in zip(system.springs, ends, strict=True)]
        figures["peak_spring_force_n"] = by_name(springs, np.array(forces))
    if system.stress is not None and "stress" in extremes:
        figures["largest_bending_stress_pa"] = float(largest(extremes["stress"]).max())
    return figures


def largest_pulls(forces: tuple[Floats, Floats, Floats, Floats]) -> Floats:
    """(m,) largest tension of each contact; 0 where it is the round-off of an opening."""
    low, _, high, _ = forces
    return np.where(-low > ROUND_OFF_PULL * high, np.maximum(-low, 0.0), 0.0)


def static_figures(system: StructuralSystem) -> dict[str, Any]:
    """By entry of the summary the figures of the model itself: of static equilibrium, and natural frequencies."""
    return {
        "static_force_n": {s.name: s.preload for s in system.snubbers},
        "gap_m": {s.name: s.gap for s in system.snubbers},
        "open_frequencies_hz": system.modes.open_frequencies_hz.tolist(),
        "closed_frequencies_hz": system.modes.closed_frequencies_hz.tolist(),
    }


def largest(extremes: tuple[Floats, Floats, Floats, Floats]) -> Floats:
    """(k,) largest magnitudes."""
    low, _, high, _ = extremes
    return np.maximum(np.abs(low), np.abs(high))


def by_name(names: Sequence[str], values: Floats) -> dict[str, float]:
    """Numbers by name."""
    return {name: float(value) for name, value in zip(names, values, strict=True)}
