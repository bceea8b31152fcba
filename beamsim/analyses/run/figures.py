"""The figures of a motion: extremes of what probes and snubbers report, and contact, by name."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from beamsim.analyses.limits import STANDARD_GRAVITY
from beamsim.analyses.run.outputs import OutputSet
from beamsim.contacts.springs import FRICTION
from beamsim.flow.contact_state import OutputOf
from beamsim.flow.trajectory import Trajectory
from beamsim.system.outputs import OutputRows
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats, Ints

Extreme = tuple[Floats, Floats, Floats, Floats]  # (k,) each: lowest, its time, highest, its time
Extremes = dict[str, Extreme]  # by output group
ROUND_OFF = 1e-12  # of the motion of the structure: a probe that moves by less is at rest
ALWAYS = 1e-12  # of the time: a contact that is open for no longer is closed throughout
ROUND_OFF_PULL = 1e-9  # of the largest contact force


def sampled_extremes(times: Floats, values: Floats) -> Extreme:
    """Lowest values (k,) of samples (nt, k), their times, highest values, their times."""
    return values.min(axis=0), times[values.argmin(axis=0)], values.max(axis=0), times[values.argmax(axis=0)]


def searched_extremes(
    trajectory: Trajectory, searched: Mapping[str, OutputOf], one_figure: Collection[str] = ("stress",)
) -> Extremes:
    """Extremes of the continuous motion, from one search for all of them.

    Parameters
    ----------
    searched : outputs by group.
    one_figure : groups of which only the lowest and the highest value of all outputs is sought; the others keep values
        that they reach.
    """
    outputs, phases = OutputSet(dict(searched)), trajectory.flow.system.contacts.start
    share: list[Ints] = []
    ends = np.cumsum([output_of(phases).row.shape[0] for output_of in searched.values()])
    for name, first, last in zip(searched, np.append(0, ends), ends, strict=False):
        share.append(np.full(last - first, first) if name in one_figure else np.arange(first, last))
    found = trajectory.extrema(outputs, share=np.concatenate(share))
    parts = np.split(np.stack([found.low, found.when_low, found.high, found.when_high]), ends[:-1], axis=1)
    return {name: (part[0], part[1], part[2], part[3]) for name, part in zip(searched, parts, strict=True)}


def energy_extremes(trajectory: Trajectory, energies: Sequence[OutputRows], rows_of: OutputOf) -> Extreme:
    """Extremes of energies over the continuous motion."""
    found = trajectory.extrema(rows_of, squares=np.cumsum([0, *(rows.count for rows in energies[:-1])]))
    return found.low, found.when_low, found.high, found.when_high


def deflection_size(system: StructuralSystem, states: Floats) -> float:
    """Largest deflection of the bodies in some states (k, 2n or more), m."""
    coordinates = states[:, : system.dynamics.size]
    return max((float(np.abs(coordinates @ b.deflection.T).max(initial=0.0)) for b in system.bodies), default=0.0)


def openings(penetration: Floats, contact_share: Floats) -> Floats:
    """(m,) largest openings of contacts with given lowest penetrations, m; no round-off where a contact never opens."""
    return np.where(contact_share < 1.0 - ALWAYS, np.maximum(-penetration, 0.0), 0.0)


def motion_figures(
    system: StructuralSystem, extremes: Extremes, contact_share: Floats, closings: Ints, size: float = 0.0
) -> dict[str, Any]:
    """By entry of the summary the figures of a motion, by name of probe, snubber or spring.

    A probe at a node of the motion moves by round-off: its displacement is 0, and its acceleration where that is no
    larger than such a displacement makes it at the first natural frequency.

    Parameters
    ----------
    size : m, a deflection of the motion, see `deflection_size`.
    contact_share : (m,) of each contact.
    closings : (m,) number of closings of each contact.
    """
    probes = [p.name for p in system.probes]
    snubbers = [s.name for s in system.snubbers]
    count = len(snubbers)
    low, _, high, _ = extremes["displacement"]
    acceleration = largest(extremes["acceleration"])
    still = np.maximum(np.abs(low), np.abs(high)) <= ROUND_OFF * size
    first_hz = min((f for f in system.modes.open_frequencies_hz if f > 0.0), default=0.0)
    unmoved = still & (acceleration <= ROUND_OFF * size * (2.0 * np.pi * first_hz) ** 2)
    low, high = np.where(still, 0.0, low), np.where(still, 0.0, high)
    acceleration = np.where(unmoved, 0.0, acceleration)
    figures: dict[str, Any] = {
        "peak_displacement_m": by_name(probes, np.maximum(np.abs(low), np.abs(high))),
        "min_displacement_m": by_name(probes, low),
        "max_displacement_m": by_name(probes, high),
        "peak_acceleration_g": by_name(probes, acceleration / STANDARD_GRAVITY),
        "largest_pull_n": by_name(snubbers, largest_pulls(extremes["force"])[:count]),
        "peak_force_n": by_name(snubbers, extremes["force"][2][:count]),
        "largest_gap_m": by_name(snubbers, openings(extremes["penetration"][0][:count], contact_share[:count])),
        "contact_share": by_name(snubbers, contact_share[:count]),
        "contacts": {name: int(number) for name, number in zip(snubbers, closings[:count], strict=True)},
    }
    if system.outputs:
        low, _, high, _ = (
            np.concatenate([extremes[group][k] for group in ("output", "energy") if group in extremes])
            for k in range(4)
        )
        ordered = [output.name for output in (*system.linear_outputs, *system.energy_outputs)]
        for name, values in (("peak", np.maximum(np.abs(low), np.abs(high))), ("min", low), ("max", high)):
            by_output = by_name(ordered, values)
            figures[f"{name}_output"] = {output.name: by_output[output.name] for output in system.outputs}
    if system.springs:
        ends = np.array(extremes["stretch"][::2]).T  # (springs, 2); the force is largest at one of them
        stretches = np.abs(ends).max(axis=1).tolist()
        if "spring_force" in extremes:  # which depends on more than the stretch
            forces = largest(extremes["spring_force"]).tolist()
        else:
            forces = [float(np.abs(s.force(x)).max()) for s, x in zip(system.springs, ends, strict=True)]
        rows = list(zip(system.springs, stretches, forces, strict=True))
        if springs := [row for row in rows if row[0].kind != FRICTION]:
            figures["peak_stretch_m"] = {s.name: stretch for s, stretch, _ in springs}
            figures["peak_spring_force_n"] = {s.name: force for s, _, force in springs}
        if rubbing := [row for row in rows if row[0].kind == FRICTION]:
            figures["peak_friction_force_n"] = {s.name: force for s, _, force in rubbing}
    if system.stress is not None and "stress" in extremes:
        figures["largest_bending_stress_pa"] = float(largest(extremes["stress"]).max())
    return figures


def peak_times(system: StructuralSystem, extremes: Extremes, figures: Mapping[str, Any]) -> dict[str, dict[str, float]]:
    """s, by entry of the figures and by name: when the peak is reached; of equal peaks any of them."""
    probes, snubbers = [p.name for p in system.probes], [s.name for s in system.snubbers]
    when = {
        "peak_displacement_m": by_name(probes, _largest_at(extremes["displacement"])),
        "peak_acceleration_g": by_name(probes, _largest_at(extremes["acceleration"])),
        "peak_force_n": by_name(snubbers, extremes["force"][3][: len(snubbers)]),
    }
    return {entry: {n: t for n, t in times.items() if figures[entry][n] > 0.0} for entry, times in when.items()}


def _largest_at(extremes: Extreme) -> Floats:
    """(k,) s, when the largest magnitudes are reached."""
    low, when_low, high, when_high = extremes
    return np.where(np.abs(low) > np.abs(high), when_low, when_high)


def largest_pulls(forces: Extreme) -> Floats:
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


def largest(extremes: Extreme) -> Floats:
    """(k,) largest magnitudes."""
    low, _, high, _ = extremes
    return np.maximum(np.abs(low), np.abs(high))


def by_name(names: Sequence[str], values: Floats) -> dict[str, float]:
    """Numbers by name."""
    return {name: float(value) for name, value in zip(names, values, strict=True)}
