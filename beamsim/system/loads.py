"""Loads and base motion in reduced coordinates."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from beamsim.inputs.excitation import BaseMotion, base_motion, level_signal
from beamsim.system.equations import Forcing
from beamsim.system.parts import Parts
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.inputs.signal import Signal


def constant_loads(parts: Parts) -> Floats:
    """(L, n) gravity (towards negative deflection) and constant forces, N/sqrt(kg)."""
    loads = [force.force * parts.shape(force) for force in parts.scenario.constant_forces]
    if parts.scenario.gravity != 0:
        loads.append(-parts.scenario.gravity * parts.inertia)
    return np.array(loads).reshape(len(loads), parts.basis.size)


def time_dependent_loads(parts: Parts, felt: bool) -> tuple[BaseMotion | None, Forcing]:
    """The base's motion (None at rest) and the time-dependent loads; ``felt``: a contact or spring is on the ground."""
    scenario, structure = parts.scenario, parts.structure
    excitation = scenario.excitation
    if excitation.kind == "none":
        return None, Forcing(np.zeros((0, parts.basis.size)), ())
    duration = None if scenario.run is None else scenario.run.duration
    folder = scenario.folder_of("excitation", "file")
    key = (excitation, duration, folder)
    if excitation.applied_to != "base":
        signals = (parts.shared.once("signal", key, lambda: level_signal(excitation, duration, folder)),)
        return None, Forcing(parts.shape(excitation.applied_to)[None, :], signals)
    motion = parts.shared.once("signal", key, lambda: base_motion(excitation, duration, folder))
    load: list[Floats] = [-parts.inertia]
    signal: list[Signal] = [motion.acceleration]
    if structure.ground.any():  # springs to ground stretch by the base's displacement as well
        load.append(np.asarray(structure.ground @ parts.basis.vectors) / np.sqrt(structure.mass_scale))
        signal.append(motion.displacement)
    return motion, Forcing(np.array(load), tuple(signal), motion.displacement if felt else None)
