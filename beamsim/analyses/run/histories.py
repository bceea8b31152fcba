"""What a run reports at its output times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from beamsim.analyses.run.energy import energies, power_factors
from beamsim.analyses.run.result import EnergyHistory
from beamsim.flow.channels import Observed
from beamsim.flow.stretches import MotionInStretches
from beamsim.flow.trajectory import Trajectory
from beamsim.system.channels import ChannelSet, Key
from beamsim.typing import Bools, Floats

VALUES_AT_ONCE = 2**22  # outputs and states at the times that are computed together
COMPONENTS = 3  # of the stress at the surface of a plate: sigma_x, sigma_y, tau_xy
ROUND_OFF = 1e-12  # relative, of the last output time
_STRESSES_AT_ONCE = 256  # samples
SAMPLES_TO_SEED_STRESS = 2000  # values from which the search for the largest stress of every station starts


@dataclass(frozen=True)
class Histories:
    """A motion at the output times."""

    time: Floats  # (nt,) s
    channels: ChannelSet
    values: Floats  # (nt, C) of the channels
    touching: Bools  # (nt, m) whether each contact touches
    energy: EnergyHistory

    def of(self, key: Key) -> Floats:
        """(nt, k) of the channels of a section and quantity."""
        return np.asarray(self.values[:, self.channels.places[key]])

    def column(self, section: str, quantity: str, index: int) -> Floats:
        """(nt,) of one channel of those that are alike."""
        return np.asarray(self.values[:, self.channels.places[section, quantity][index]])


def reached(motion: MotionInStretches | Trajectory, times: Floats) -> Floats:
    """The times up to the end of a motion."""
    return times[: np.searchsorted(times, motion.end * (1.0 + ROUND_OFF), side="right")]


def histories_of(motion: MotionInStretches, channels: ChannelSet, times: Floats) -> Histories:
    """A motion in closed form at output times, stretch by stretch.

    Parameters
    ----------
    motion : as far as it was marched.
    channels : that are sampled.
    times : (nt,) increasing, s; those after the end of the motion are left out.
    """
    flow, observed = motion.flow, Observed(motion.flow, channels)
    times = reached(motion, times)
    columns, contacts = channels.order.size, flow.system.contacts
    values = np.empty((columns, times.size)).T  # each column in one piece
    touching = np.empty((contacts.count, times.size), dtype=bool).T
    energy, work = np.empty((3, times.size)), np.zeros(2)
    factors, at_once = power_factors(flow), max(VALUES_AT_ONCE // (columns + flow.size), 1)
    first = 0
    for stretch in motion.again():
        begin, last = float(stretch.time[0]), reached(stretch, times).size
        for number in range(first, max(last, first + 1), at_once):
            part = slice(number, min(number + at_once, last))
            at = np.minimum(times[part], stretch.end)
            values[part] = observed.values(stretch, at)
            touching[part] = contacts.touching(stretch.phases_at(at))
            end = at[-1:] if part.stop < last else [stretch.end]
            found = energies(stretch, np.append(at, end), factors, begin, work)
            energy[:, part] = found.work_in[:-1], found.dissipated[:-1], found.stored[:-1]
            begin, work = float(end[0]), np.array([found.dissipated[-1], found.work_in[-1]])
        first = last
    return Histories(times, channels, values, touching, EnergyHistory(*energy))


def largest_von_mises(motion: MotionInStretches, times: Floats, stress: Observed, of_body: slice) -> Floats:
    """(nx,) largest von Mises stress of samples of a motion, Pa.

    Parameters
    ----------
    motion : as far as it was marched.
    times : (nt,) of the output, s, of which some are taken.
    stress : sigma_x, sigma_y and tau_xy of all stations.
    of_body : which of them.
    """
    few = times[:: max(1, times.size // SAMPLES_TO_SEED_STRESS)]
    largest = np.zeros((of_body.stop - of_body.start) // COMPONENTS)
    for first in range(0, few.size, _STRESSES_AT_ONCE):
        sampled = motion.sample(few[first : first + _STRESSES_AT_ONCE], stress.linear)[:, of_body]
        x, y, shear = np.moveaxis(sampled.reshape(sampled.shape[0], COMPONENTS, -1), 1, 0)
        largest = np.maximum(largest, (x**2 - x * y + y**2 + 3 * shear**2).max(axis=0))
    return np.sqrt(largest)
