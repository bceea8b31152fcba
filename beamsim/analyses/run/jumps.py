"""Accelerations that jump where a dashpot meets a structure: what they owe to the modes that are kept.

At touch-down a dashpot's force jumps to F = c v, and the acceleration of its place by F times the sum of the squares of
the mass-normalised shapes there. At a point without mass that sum grows with every mode that is kept: the continuous
structure has no largest acceleration there, only one within a band. A point mass m there bounds it by F / m.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from beamsim.analyses.run.motion import RunMotion
from beamsim.analyses.values import STANDARD_GRAVITY
from beamsim.scenario import Scenario
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats

NOTED = 0.25  # of a peak acceleration: a larger jump may exceed it in a model of a few times the modes
SETTLED = 0.8  # of the sum over all modes, that the lower half of them reaches where the sum converges


def jump_warnings(
    scenario: Scenario, system: StructuralSystem, motion: RunMotion, peak_g: Mapping[str, float]
) -> list[str]:
    """A warning for each probe at a dashpot whose acceleration jumps at touch-down by what grows with the modes.

    Parameters
    ----------
    peak_g : peak acceleration of every probe, g.
    """
    assert scenario.run is not None
    if motion.trajectory is None or not scenario.has_mesh or scenario.run.low_pass is not None:
        return []
    largest = None
    order = np.argsort(system.dynamics.stiffness, kind="stable")
    damped = [(j, snubber) for j, snubber in enumerate(system.snubbers) if snubber.dashpot > 0.0]
    shapes = np.array([snubber.shape for _, snubber in damped]).reshape(len(damped), order.size)
    warnings = []
    for probe in system.probes:
        apart = np.minimum(np.abs(probe.shape - shapes).max(axis=1), np.abs(probe.shape + shapes).max(axis=1))
        for row in np.flatnonzero(apart <= 1e-9 * np.abs(probe.shape).max()):  # of a shape
            j, snubber = damped[row]
            reached = np.cumsum(probe.shape[order] ** 2)
            if reached[reached.size // 2 - 1] >= SETTLED * reached[-1]:
                continue
            largest = _touch_down_forces(motion) if largest is None else largest
            jump = largest[j] * reached[-1] / STANDARD_GRAVITY
            if jump > NOTED * peak_g[probe.name]:
                warnings.append(
                    f"probes.{probe.name}: its acceleration jumps by up to {jump:.3g} g where the dashpot of "
                    f"{snubber.name} meets the structure, and by more in a model of more modes, since the point has "
                    "little or no mass of its own: give the band of the accelerometer (run.low_pass: 2 kHz) or the "
                    "whole mass at the contact as a point mass"
                )
    return warnings


def _touch_down_forces(motion: RunMotion) -> Floats:
    """(m,) N, the largest force with which each contact is made."""
    trajectory = motion.trajectory
    assert trajectory is not None
    made = trajectory.event_closing
    contact = trajectory.event_contact[made]
    forces = trajectory.sample(trajectory.event_time[made], trajectory.flow.contact_forces)
    largest = np.zeros(trajectory.flow.system.contacts.count)
    np.maximum.at(largest, contact, forces[np.arange(contact.size), contact])
    return largest
