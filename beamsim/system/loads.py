"""Loads and base motion in reduced coordinates."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from beamsim.inputs.excitation import BaseMotion, Driven, base_motion, level_signal
from beamsim.inputs.signal import Signal
from beamsim.scenario.base import Path
from beamsim.scenario.excitation import sine_problems
from beamsim.scenario.quantities import INTEGRALS
from beamsim.system.equations import Forcing, SineLoads
from beamsim.system.parts import Parts, base_direction, exciting_forces, gravity_loads
from beamsim.typing import Floats


def constant_loads(parts: Parts) -> Floats:
    """(L, n) gravity and constant forces, N/sqrt(kg)."""
    loads = [force.force * parts.shape(force) for force in parts.scenario.constant_forces]
    loads += [acceleration * parts.base_load(direction)[0] for direction, acceleration in gravity_loads(parts.scenario)]
    return np.array(loads).reshape(len(loads), parts.basis.size)


def carried_start(parts: Parts, forcing: Forcing) -> Floats:
    """(2 n,) what supports that move carry the structure along with at t = 0: their static shapes and rates.

    A start is relative to it, as one is to a base that moves.
    """
    start = np.zeros(2 * parts.basis.size)
    first = len(forcing.signal) - 3 * len(parts.moved)
    for k, moved in enumerate(parts.moved):
        _, velocity, displacement = forcing.signal[first + 3 * k : first + 3 * k + 3]
        shape = moved.static_shape(parts.structure, parts.basis)
        start += np.concatenate([shape * float(displacement(0.0)), shape * float(velocity(0.0))])
    return start


def sine_loads(parts: Parts, forcing: Forcing) -> SineLoads | None:
    """How the loads follow the one frequency of a harmonic excitation; None where it is no such excitation."""
    excitation = parts.scenario.excitation
    if excitation.kind == "none" or any(sine_problems(excitation, "sweep")):
        return None
    coefficient: list[complex] = []
    power: list[int] = []
    for _, force in exciting_forces(parts.scenario):
        coefficient.append(_phasor(force) if excitation.kind == "forces" else 1.0)
        power.append(0)
    for moved in parts.moved:
        first = INTEGRALS.get(str(moved.driven.quantity), 0) if excitation.kind == "forces" else 0
        coefficient += 3 * [_phasor(moved.driven) if excitation.kind == "forces" else 1.0]
        power += [first, first - 1, first - 2]
    if not power:  # of a base: its acceleration, and its displacement where springs to the ground feel it
        power = [0, -2][: len(forcing.signal)]
        coefficient = [1.0] * len(power)
    return SineLoads(np.array(coefficient, dtype=complex), np.array(power, dtype=np.int64))


def _phasor(sine: Any) -> complex:
    """Amplitude and phase of a harmonic force, over a sine of unit amplitude."""
    return complex(sine.level * np.exp(1j * sine.phase))


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

    forces = exciting_forces(scenario)
    if forces or parts.moved:
        loads = [(parts.shape(force.applied_to), signal_of(force, path, level_signal)) for path, force in forces]
        for moved in parts.moved:
            support = signal_of(moved.driven, moved.path, base_motion)
            signals = (support.acceleration, support.velocity, support.displacement)
            loads += zip(moved.loads(structure, parts.basis, parts.damping), signals, strict=True)
        return None, Forcing(np.array([vector for vector, _ in loads]), tuple(signal for _, signal in loads))
    assert excitation.kind != "forces"  # which move no base
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
