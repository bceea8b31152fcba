"""The exact periodic response of a scenario to a harmonic excitation, and its harmonics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from beamsim.analyses.identify.fit import UnpredictableError
from beamsim.flow.passage import PeriodicForcing
from beamsim.flow.variational import VariationalFlow
from beamsim.inputs.signal import Signal
from beamsim.orbits.shooting import ForcedOrbits, find_orbit
from beamsim.scenario import Scenario
from beamsim.system.build import build_system
from beamsim.system.parts import SharedBuilds
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Complexes, Floats

_SAMPLES = 512  # of a period, for the harmonics of the displacement
_SETTLE = 300  # most periods of transient


class NoSteadyVibrationError(UnpredictableError):
    """No periodic motion with the period of the excitation was found."""


@dataclass(frozen=True)
class SteadyVibration:
    """A periodic response with the period of its excitation."""

    system: StructuralSystem
    omega: float  # rad/s
    start: Floats  # (N,) state at t = 0, initial guess for neighbouring parameters
    coordinates: Complexes  # (h, n) harmonics 1 to h of q: q = Im sum c_k e^{i k omega t}
    touching: bool  # whether contact is made and lost
    residual: float  # of periodicity, against the motion's size
    penetration: Floats  # (m,) largest one of each contact, at samples and events, m

    def harmonics(self, probe: int, quantity: str, count: int) -> Complexes:
        """(count,) harmonics of a quantity of a probe, as sines in the time of the excitation, zero to peak."""
        order = np.arange(1, count + 1)
        value = self.coordinates[:count] @ self.system.probes[probe].shape.astype(complex)
        if quantity == "velocity":
            return np.asarray(1j * order * self.omega * value)
        if quantity == "absolute_acceleration":
            value = -((order * self.omega) ** 2) * value
            value[0] += self.system.carried[probe] * _amplitude(self.system.base_acceleration)
        elif quantity == "absolute_displacement":
            value = value.copy()
            value[0] += self.system.carried[probe] * _amplitude(self.system.base_displacement)
        return np.asarray(value)

    def largest_deflection(self, snubber: int) -> float:
        """Sum of the harmonics' amplitudes of the deflection at a snubber, m."""
        shape = self.system.dynamics.contacts.shape[snubber]
        return float(np.abs(self.coordinates @ shape.astype(complex)).sum())


def steady_vibration(
    scenario: Scenario,
    guess: Floats | None = None,
    *,
    harmonics: int = 16,
    shared: SharedBuilds | None = None,
) -> SteadyVibration:
    """The periodic response, by Newton's method on the exact flow with its exact monodromy matrix.

    Harmonics of accelerations are taken from those of the displacement, which fall two orders faster, so that a
    jump in the contact force costs no accuracy.

    Parameters
    ----------
    scenario : with a harmonic excitation, without cubic springs.
    guess : state at t = 0 of a neighbouring response.
    harmonics : number wanted.
    shared : keeps what was built for scenarios with the same structure.

    Raises
    ------
    NoSteadyVibrationError
        Where neither Newton's method nor a transient of 300 periods ends in such a motion.
    """
    system = build_system(scenario, shared, assessed=False, recovered=False)
    if system.cubic.count:
        raise NoSteadyVibrationError("cubic springs have no exact flow")
    omega = 2 * np.pi * system.excitation_frequency_hz
    flow = VariationalFlow(system.dynamics, _periodic(system, omega), omega, 1.0)
    problem = ForcedOrbits(flow, "level")
    if guess is not None and guess.size != flow.size:
        guess = None
    try:
        point = find_orbit(problem, guess, settle=_SETTLE)
        if point is None and guess is not None:
            point = find_orbit(problem, None, settle=_SETTLE)
    except (ArithmeticError, np.linalg.LinAlgError) as error:
        raise NoSteadyVibrationError(str(error)) from error
    if point is None:
        raise NoSteadyVibrationError(
            f"no vibration with the period of the excitation ({system.excitation_frequency_hz:g} Hz) was found"
        )
    passage = point.data
    period = 2 * np.pi / omega
    times = np.arange(_SAMPLES, dtype=np.float64) * (period / _SAMPLES)
    states = flow.states_at(passage, np.asarray(times, dtype=np.float64))
    n = system.dynamics.size
    # q = Re sum X e^{i k w t} = Im sum (i X) e^{i k w t}
    spectrum = 1j * np.fft.rfft(states[:, :n], axis=0)[1 : harmonics + 1] * (2.0 / _SAMPLES)
    at = np.concatenate([times, passage.time])
    penetration = flow.penetration_of(np.concatenate([states, passage.y]), at)[0].max(axis=0)
    return SteadyVibration(
        system, omega, point.u[:-1], spectrum, passage.event_time.size > 0, point.residual, penetration
    )


def _periodic(system: StructuralSystem, omega: float) -> PeriodicForcing:
    """The loads of a system under one harmonic, as a phasor: sin(w t + p) is Re(-i e^{i p} e^{i w t})."""
    force = np.zeros(system.dynamics.size, dtype=complex)
    for load, signal in zip(system.forcing.load, system.forcing.signal, strict=True):
        force += load * signal.coefficient[0, 0, 0]
    base = np.zeros(1, dtype=complex)
    if system.forcing.base_displacement is not None:
        base[0] = system.forcing.base_displacement.coefficient[0, 0, 0]
    return PeriodicForcing(np.ones(1, dtype=np.int64), force[None, :], np.zeros(1), base, np.zeros(1), omega)


def _amplitude(signal: Signal | None) -> complex:
    """Of a harmonic signal: c with signal = Im(c e^{i w t})."""
    return 0j if signal is None else complex(1j * signal.coefficient[0, 0, 0])
