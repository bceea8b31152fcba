"""Where the contact sequences of two motions diverge that begin alike, and how soon a disturbance makes them.

A motion that bounces may be so sensitive that any small change gives it other contacts after some time. What comes
after that is one of many motions, and no model or precision of the computation can say which.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from beamsim.flow.reference import ReferenceTrajectory
from beamsim.flow.stretches import MotionInStretches
from beamsim.flow.trajectory import Trajectory
from beamsim.typing import Floats, Ints

SAME_EVENT = 0.1  # of the mean time between a contact's closings: two events further apart are not the same
SMALL, ROUND_OFF = 1e-9, 1e-15  # relative disturbances of the stiffness
LONGER = 8.0  # times the time up to which a disturbance has been followed in vain, or needed to diverge


@dataclass(frozen=True)
class ContactEvents:
    """The events (E,) of the snubbers of a motion in order of time."""

    end: float  # s, of the motion
    time: Floats
    contact: Ints
    phase: Ints  # of the contact after the event

    @classmethod
    def of(cls, motion: Trajectory | MotionInStretches | ReferenceTrajectory, snubbers: int) -> Self:
        """Those of a motion whose first ``snubbers`` contacts are snubbers."""
        these = motion.event_contact < snubbers
        return cls(motion.end, motion.event_time[these], motion.event_contact[these], motion.event_phase[these])

    def of_contact(self, contact: int) -> Self:
        """Those of one contact."""
        these = self.contact == contact
        return replace(self, time=self.time[these], contact=self.contact[these], phase=self.phase[these])

    def until(self, end: float) -> Self:
        """Those up to a time."""
        count = int(np.searchsorted(self.time, end, side="right"))
        return replace(self, end=end, time=self.time[:count], contact=self.contact[:count], phase=self.phase[:count])


def divergence(first: ContactEvents, second: ContactEvents) -> float:
    """Time at which the contact sequences of two motions diverge, s; infinite if they do not.

    Each contact has its own sequence: which of two comes first is round-off where a symmetric structure meets both.
    """
    end = min(first.end, second.end)
    contacts = np.union1d(first.contact, second.contact)
    return min((_divergence_of(first.of_contact(k), second.of_contact(k), end) for k in contacts), default=math.inf)


def _divergence_of(first: ContactEvents, second: ContactEvents, end: float) -> float:
    """The same of the events of one contact."""
    apart = SAME_EVENT * end / max(first.time.size / 2, 1.0)
    common = min(first.time.size, second.time.size)
    same = first.phase[:common] == second.phase[:common]
    same &= np.abs(first.time[:common] - second.time[:common]) <= apart
    if not same.all():
        k = int(np.argmin(same))
        return float(min(first.time[k], second.time[k]))
    rest = first if first.time.size > common else second
    if rest.time.size > common and rest.time[common] < end - apart:
        return float(rest.time[common])
    return math.inf


@dataclass(frozen=True)
class DivergenceTimes:
    """Times after which small changes of the stiffness give other contacts, s; infinite where none was seen."""

    small_s: float = math.inf  # of a change by 1e-9 of itself
    round_off_s: float = math.inf  # by 1e-15

    @property
    def sensitive(self) -> bool:
        """Whether changes that no structure is known to give other contacts."""
        return math.isfinite(min(self.small_s, self.round_off_s))


def sensitivity(
    motion: ContactEvents, diverged: float, disturbed: Callable[[float, float], ContactEvents]
) -> DivergenceTimes:
    """When motions with a disturbed stiffness diverge from a motion.

    Parameters
    ----------
    motion : the events of the motion.
    diverged : s, where that of a finer model diverges from it, near which a disturbed one is likely to, too.
    disturbed : events of the motion with the stiffness changed by a share of itself, up to a time.
    """
    end, small = diverged, math.inf
    while small == math.inf and end < motion.end:
        end = min(motion.end, LONGER * end)
        small = divergence(motion.until(end), disturbed(SMALL, end))
    if small == math.inf:
        return DivergenceTimes()
    end = min(motion.end, LONGER * small)
    return DivergenceTimes(small, divergence(motion.until(end), disturbed(ROUND_OFF, end)))
