"""The values of a motion: extremes of its channels, and contact, by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from beamsim.analyses.values import (
    ACCELERATION,
    DISPLACEMENT,
    FORCE,
    PENETRATION,
    Extreme,
    Extremes,
    largest,
    largest_at,
    values_of,
)
from beamsim.flow.channels import Observed
from beamsim.flow.trajectory import Trajectory
from beamsim.system.channels import ChannelSet, Key
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats, Ints

ROUND_OFF = 1e-12  # of the motion of the structure: a probe that moves by less is at rest
ALWAYS = 1e-12  # of the time: a contact that is open for no longer is closed throughout


def sampled_extremes(times: Floats, values: Floats) -> Extreme:
    """Lowest values (k,) of samples (nt, k), their times, highest values, their times."""
    return values.min(axis=0), times[values.argmin(axis=0)], values.max(axis=0), times[values.argmax(axis=0)]


def extremes_of(motion: Trajectory, observed: Observed) -> dict[Key, Extreme]:
    """Extremes of the continuous motion, by section and quantity of the channels."""
    return by_key(observed.channels, observed.extrema(motion).extremes)


def by_key(channels: ChannelSet, extreme: Extreme) -> dict[Key, Extreme]:
    """Extremes (C,) of channels by section and quantity."""
    low, when_low, high, when_high = extreme
    return {key: (low[some], when_low[some], high[some], when_high[some]) for key, some in channels.places.items()}


def deflection_size(system: StructuralSystem, states: Floats) -> float:
    """Largest deflection of the bodies in some states (k, 2n or more), m."""
    coordinates = states[:, : system.dynamics.size]
    return max((float(np.abs(coordinates @ b.deflection.T).max(initial=0.0)) for b in system.bodies), default=0.0)


def motion_figures(
    system: StructuralSystem, extremes: Extremes, contact_share: Floats, closings: Ints, size: float = 0.0
) -> dict[str, Any]:
    """By entry of the summary the values of a motion, by name of probe, snubber or spring.

    Parameters
    ----------
    system : of the channels.
    extremes : of them.
    contact_share : (m,) of each contact.
    closings : (m,) number of closings of each contact.
    size : m, a deflection of the motion, see `deflection_size`.
    """
    snubbers = [s.name for s in system.snubbers]
    count = len(snubbers)
    return {
        **values_of(system.channels, _without_round_off(system, extremes, contact_share[:count], size)),
        "contact_share": by_name(snubbers, contact_share[:count]),
        "contacts": {name: int(number) for name, number in zip(snubbers, closings[:count], strict=True)},
    }


def _without_round_off(
    system: StructuralSystem, extremes: Extremes, contact_share: Floats, size: float
) -> dict[Key, Extreme]:
    """The extremes where what is round-off is zero.

    A probe at a node of the motion moves by round-off: its displacement is 0, and its acceleration where that is no
    larger than such a displacement makes it at the first natural frequency. A contact that never opens has no gap.
    """
    settled = dict(extremes)
    if DISPLACEMENT in extremes:
        still = largest(extremes[DISPLACEMENT]) <= ROUND_OFF * size
        settled[DISPLACEMENT] = _zero_where(still, extremes[DISPLACEMENT])
        if ACCELERATION in extremes:
            first_hz = min((f for f in system.modes.open_frequencies_hz if f > 0.0), default=0.0)
            slow = largest(extremes[ACCELERATION]) <= ROUND_OFF * size * (2.0 * np.pi * first_hz) ** 2
            settled[ACCELERATION] = _zero_where(still & slow, extremes[ACCELERATION])
    if PENETRATION in extremes:
        settled[PENETRATION] = _zero_where(contact_share >= 1.0 - ALWAYS, extremes[PENETRATION])
    return settled


def _zero_where(still: Any, extreme: Extreme) -> Extreme:
    low, when_low, high, when_high = extreme
    return np.where(still, 0.0, low), when_low, np.where(still, 0.0, high), when_high


def peak_times(extremes: Extremes, figures: Mapping[str, Any]) -> dict[str, dict[str, float]]:
    """s, by entry of the figures and by name: when the peak is reached; of equal peaks any of them."""
    when = {
        "peak_displacement_m": largest_at(extremes[DISPLACEMENT]),
        "peak_acceleration_g": largest_at(extremes[ACCELERATION]),
        "peak_force_n": extremes[FORCE][3] if FORCE in extremes else np.zeros(0),
    }
    reached = {entry: zip(figures[entry].items(), times.tolist(), strict=True) for entry, times in when.items()}
    return {entry: {name: t for (name, peak), t in of if peak > 0.0} for entry, of in reached.items()}


def static_figures(system: StructuralSystem) -> dict[str, Any]:
    """By entry of the summary the figures of the model itself: of static equilibrium, and natural frequencies."""
    return {
        "static_force_n": {s.name: s.preload for s in system.snubbers},
        "gap_m": {s.name: s.gap for s in system.snubbers},
        "open_frequencies_hz": system.modes.open_frequencies_hz.tolist(),
        "closed_frequencies_hz": system.modes.closed_frequencies_hz.tolist(),
    }


def by_name(names: Sequence[str], values: Floats) -> dict[str, float]:
    """Numbers by name."""
    return {name: float(value) for name, value in zip(names, values, strict=True)}
