"""Accelerations that have no limit as the number of modes grows, since a force jumps at a point with little mass.

A jump F makes an acceleration of F times the sum of the products of the shapes at its point and at the place. At the
point itself the sum grows with every mode, up to 1 / m with a point mass m. Elsewhere the modes come one after the
other, as a wave in which about sqrt(n) of the modes near number n are in phase; damping leaves those up to
1 / (pi ratio). With a point mass the limit of the acceleration at the point, just after the jump, follows from
any model. See docs/theory.md, section 7.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from beamsim.flow.channels import channel_values
from beamsim.flow.trajectory import Trajectory
from beamsim.inputs.signal import Signal, StreamedSignal
from beamsim.results.values import ACCELERATION, OUTPUT
from beamsim.system.equations import Channel, ChannelSet
from beamsim.system.structural import LIGHT_MASS_FACTOR, JumpingForce, StructuralSystem
from beamsim.typing import Floats, Ints

NOTED = 0.25  # of a peak acceleration: a larger jump exceeds it in a model of a few times the modes
SAME_SHAPE = 1e-9  # relative difference of the shapes of one place
JUST_BEFORE = 1e-6  # of the length of the segment that an event ends
ACCELERATIONS = (ACCELERATION, (OUTPUT.section, "acceleration"))
OF_PROBES = ("peak_acceleration_g", "rms_acceleration_g")  # entries of summaries that grow with an acceleration


class ForceJumps(NamedTuple):
    """Jumps of one force in order of time, each or those of a cycle."""

    force: JumpingForce
    time: Floats  # (k,) s
    largest: Floats  # (k,) N
    square: Floats  # (k,) N^2, sum of the squares


class WithoutLimit(NamedTuple):
    """A value that has no limit as the number of modes grows."""

    channel: Channel  # an acceleration
    force: JumpingForce
    at_force: bool  # else the acceleration is that of waves, which no damping of the body ends

    @property
    def warning(self) -> str:
        """One sentence, with a remedy."""
        output, cause = self.channel.section == OUTPUT.section, self.force.cause
        why = "at a point that has little or no mass" if self.at_force else "and its waves meet next to no damping"
        remedies = [
            *([] if output else ["give the band of the accelerometer (run.low_pass: 2 kHz)"]),
            f"{'give' if output else 'or'} the mass there as a point mass",
            *(["or let the force rise in a finite time"] if self.force.signal >= 0 else []),
            *([] if self.at_force else ["or give a damping of the body"]),
        ]
        return (
            f"{self.channel.section}.{self.channel.name}: its peak acceleration has no limit, it grows with the number "
            f"of modes: {cause} jumps, {why}; {', '.join(remedies)}"
        )


def contact_jumps(motion: Trajectory) -> tuple[Floats, Floats]:
    """When the phases of contacts change, (k,) s, and by how much their forces jump there, (k, m) N."""
    changed = np.flatnonzero(np.diff(motion.state)) + 1
    time, first = np.unique(motion.time[changed], return_index=True)
    before = motion.length[changed[first] - 1]
    after, previous = (
        motion.sample(at, lambda phases: motion.flow.at(phases).force) for at in (time, time - JUST_BEFORE * before)
    )
    return time, np.abs(after - previous)


def signal_jumps(signal: Signal, end: float) -> tuple[Floats, Floats]:
    """When a signal jumps before an end, s, the jump from zero at t = 0 included, and by how much; (k,) each."""
    if isinstance(signal, StreamedSignal):  # a record, smooth between its samples
        return np.zeros(1), np.abs(signal(np.zeros(1)))
    pieces = np.arange(signal.start.size)
    before = np.append(0.0, signal.piece_values(pieces[:-1], np.diff(signal.start)))
    size, begun = np.abs(signal.piece_values(pieces, np.zeros(pieces.size)) - before), signal.start < end
    return signal.start[begun], size[begun]


def jumps_of_motion(system: StructuralSystem, motion: Trajectory) -> Iterator[ForceJumps]:
    """Jumps of those forces of a system that can jump."""
    time, of_contacts = contact_jumps(motion)
    for force in system.forces_that_jump:
        if force.signal >= 0:
            at, size = signal_jumps(system.forcing.signal[force.signal], motion.end)
        else:
            at, size = time, of_contacts[:, force.contact]
        if size.any():
            yield ForceJumps(force, at, size, size**2)


def peaks_after_jumps(
    system: StructuralSystem, motion: Trajectory, jumps: Sequence[ForceJumps]
) -> Iterator[tuple[Channel, float]]:
    """Accelerations of points with a mass of their own just after a force jumps there, whatever the model.

    A jump F changes the acceleration by F / m, of which the modes of a model make F times the sum of their squared
    shapes. The rest of the acceleration does not depend on the model.

    Parameters
    ----------
    system : whose forces jump.
    motion : of it.
    jumps : of its forces.

    Yields
    ------
    channel, peak : an acceleration, and the largest magnitude of its limits just after the jumps of a force, m/s^2.
    """
    for of in jumps:
        here = [channel for channel in accelerations(system) if at_force(system, channel, of.force)]
        if not here or not math.isfinite(of.force.inverse_mass):
            continue
        at = ChannelSet(tuple(here), system.channels.sizes)
        missing = (of.force.inverse_mass - float(of.force.shape @ of.force.shape)) * of.largest
        before = of.time - JUST_BEFORE * motion.length[np.maximum(motion.segments_at(of.time) - 1, 0)]
        after = channel_values(motion, at, of.time)
        change = after - channel_values(motion, at, np.maximum(before, 0.0))
        way = np.sign(np.where(of.time[:, None] > 0.0, change, after))  # at rest before the beginning
        yield from zip(at.channels, np.abs(after + way * missing[:, None]).max(axis=0).tolist(), strict=True)


def accelerations(system: StructuralSystem) -> list[Channel]:
    """Channels of accelerations."""
    return [c for c in system.channels.channels if c.key in ACCELERATIONS]


def without_limit(
    system: StructuralSystem, jumps: Sequence[ForceJumps], peaks: Mapping[tuple[str, str], float]
) -> Iterator[WithoutLimit]:
    """The accelerations that grow with the modes: those of which jumps reach a share of the peak in a larger model.

    Parameters
    ----------
    system : whose forces jump.
    jumps : of them; jumps at points with enough mass are skipped.
    peaks : largest magnitudes of accelerations by section and name, SI; other channels are skipped.
    """
    waves, channels = Waves.of(system), [c for c in accelerations(system) if (c.section, c.name) in peaks]
    light = [of for of in jumps if of.force.light and channels]
    sizes = np.array([waves.accelerations(system, channels, of).max(axis=1) for of in light])
    for k, channel in enumerate(channels if light else ()):
        most = int(sizes[:, k].argmax())
        if sizes[most, k] > NOTED * peaks[channel.section, channel.name]:
            force = light[most].force
            yield WithoutLimit(channel, force, at_force(system, channel, force))


def at_force(system: StructuralSystem, channel: Channel, force: JumpingForce) -> bool:
    """Whether an acceleration is that of the point at which a force acts."""
    shape, other = system.channels.sizes.part(channel.rows, "acceleration")[0], force.shape
    apart = min(np.abs(shape - other).max(), np.abs(shape + other).max())
    return bool(apart <= SAME_SHAPE * np.abs(other).max())


def keys_of(channel: Channel) -> list[tuple[str, str]]:
    """Entries and places of a summary whose values have no limit if the acceleration of this channel has none."""
    entries = OF_PROBES if channel.key == ACCELERATION else ("peak_output", "min_output", "max_output")
    return [(entry, channel.name) for entry in entries]


@dataclass(frozen=True)
class Waves:
    """Waves that a force jump excites in a model's modes, away from the point where it acts.

    Parameters
    ----------
    upper : upper half of the kept modes.
    ratio : smallest of their damping ratios.
    decay : 1/s, of the highest of them.
    number : of modes that count: `LIGHT_MASS_FACTOR` times those kept; 0 if damping ends the waves of fewer modes.
    """

    upper: Ints
    ratio: float
    decay: float
    number: float

    @classmethod
    def of(cls, system: StructuralSystem) -> Self:
        """The waves of a system."""
        kept = system.kept_modes
        upper = np.argsort(system.dynamics.stiffness, kind="stable")[kept // 2 : kept]
        ratio = float(np.nanmin(system.modes["damping_ratios"].values[kept // 2 : kept], initial=np.inf))
        number = LIGHT_MASS_FACTOR * kept if np.pi * ratio * LIGHT_MASS_FACTOR * kept < 1.0 else 0.0
        return cls(upper, ratio, 2 * np.pi * ratio * float(system.open_frequencies_hz[max(kept - 1, 0)]), number)

    def accelerations(self, system: StructuralSystem, channels: Sequence[Channel], jumps: ForceJumps) -> Floats:
        """(C, k) m/s^2, jumps of the accelerations of channels at the force, and by travelling waves elsewhere.

        Waves are those of a model of `LIGHT_MASS_FACTOR` times the modes, and add as those of random phases.
        """
        shape, rows = jumps.force.shape, np.vstack([channel.rows for channel in channels])
        at = np.array([at_force(system, channel, jumps.force) for channel in channels])
        direct = np.multiply.outer(at * float(shape @ shape), jumps.largest)
        if self.number == 0.0:
            return direct
        squares, sum_of = np.zeros(jumps.time.size), 0.0
        lasting = np.exp(-2.0 * self.decay * np.diff(jumps.time, prepend=jumps.time[:1]))
        for k, (square, share) in enumerate(zip(jumps.square.tolist(), lasting.tolist(), strict=True)):
            squares[k] = sum_of = sum_of * share + square
        row = system.channels.sizes.part(rows, "acceleration")
        of_mode = np.sqrt(np.mean((row * shape)[:, self.upper] ** 2, axis=1))
        return np.maximum(direct, np.multiply.outer(of_mode, np.sqrt(squares * 2.0 * self.number / (math.pi * math.e))))
