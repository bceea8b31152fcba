"""Loads and base motion in reduced coordinates."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.inputs.excitation import BaseMotion, base_motion, level_signal
from beamsim.system.equations import Forcing
from beamsim.system.parts import Parts, base_direction, exciting_forces, gravity_loads
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.inputs.excitation import Driven
    from beamsim.inputs.signal import Signal
    from beamsim.scenario.base import Path


def constant_loads(parts: Parts) -> Floats:
    """(L, n) gravity and constant forces, N/sqrt(kg)."""
    loads = [force.force * parts.shape(force) for force in parts.scenario.constant_forces]
    loads += [acceleration * parts.base_load(direction)[0] for direction, acceleration in gravity_loads(parts.scenario)]
    return np.array(loads).reshape(len(loads), parts.basis.size)


def time_dependent_loads(parts: Parts, felt: bool) -> tuple[BaseMotion | None, Forcing]:
    """The base's motion (None at rest) and the time-dependent loads; ``felt``: a contact or spring is on the ground."""
    scenario, structure = parts.scenario, parts.structure
    excitation = scenario.excitation
    if excitation.kind == "none":
        return None, Forcing(np.zeros((0, parts.basis.size)), ())
    duration = None if scenario.run is None else scenario.run.duration

    def signal_of(driven: Driven, at: Path, signal: Callable[..., Any]) -> Any:
        folder = scenario.folder_of(*at, "file")
        key = (driven, duration, folder)
        return parts.shared.once("signal", key, lambda: signal(driven, duration, folder))

    if forces := exciting_forces(scenario):
        signals = tuple(signal_of(force, path, level_signal) for path, force in forces)
        return None, Forcing(np.array([parts.shape(force.applied_to) for _, force in forces]), signals)
    assert excitation.kind != "forces"
    motion = signal_of(excitation, ("excitation",), base_motion)
    direction = base_direction(scenario)
    assert direction is not None
    inertia, ground = parts.base_load(direction)
    load: list[Floats] = [-inertia]
    signal: list[Signal] = [motion.acceleration]
    if structure.base_load(direction)[1].any():  # springs to ground stretch by the base's displacement as well
        load.append(ground)
        signal.append(motion.displacement)
    return motion, Forcing(np.array(load), tuple(signal), motion.displacement if felt else None)
