"""The loads of a built system under a sine of any frequency and level, and the periodic flow that they drive."""

from __future__ import annotations

import numpy as np

from beamsim.flow.periodic_flow import PeriodicFlow, PeriodicForcing
from beamsim.flow.smooth_flow import SmoothFlow
from beamsim.flow.variational import VariationalFlow
from beamsim.inputs.profiles import phase_of_acceleration
from beamsim.inputs.signal import Signal
from beamsim.scenario import Scenario
from beamsim.scenario.excitation import Sine
from beamsim.scenario.quantities import acceleration_amplitude, power_of
from beamsim.system.equations import Forcing
from beamsim.system.structural import StructuralSystem
from beamsim.typing import not_none


def sine_of(excitation: Sine, omega: float, level: float) -> complex:
    """Amplitude of ``exp(i omega t)`` of the sine that all loads follow: of an acceleration, a force or a factor.

    Parameters
    ----------
    excitation : harmonic.
    omega : rad/s.
    level : of the excitation's own quantity, which is what stays the same at other frequencies.

    Returns
    -------
    complex
        m/s^2, N or 1; the sine is the real part.
    """
    quantity = excitation.quantity or "acceleration"
    amplitude = acceleration_amplitude(abs(level), quantity, omega / (2 * np.pi))
    return complex(-1j * amplitude * np.exp(1j * (excitation.phase + phase_of_acceleration(quantity, level))))


def harmonic_loads(system: StructuralSystem, omega: float, sine: complex) -> tuple[Forcing, tuple[Signal, ...]]:
    """The loads of a built system under a sine of one frequency.

    Parameters
    ----------
    system : whose excitation is harmonic.
    omega : rad/s.
    sine : complex amplitude of ``exp(i omega t)``, of which the sine is the real part.

    Returns
    -------
    forcing : the loads, and the displacement of the base where contacts on the ground need it.
    observers : the base's acceleration; none where the base rests.
    """

    def signal(amplitude: complex) -> Signal:
        return Signal(np.zeros(1), np.array([1j * omega]), np.full((1, 1, 1), amplitude))

    forcing, moves = system.forcing, system.base_acceleration is not None
    signals = tuple(signal(factor * sine) for factor in not_none(system.sine).at(np.array([omega]))[0])
    base = None if forcing.base_displacement is None else signal(-sine / omega**2)
    return Forcing(forcing.load, signals, base), (signal(sine),) if moves else ()


def periodic_forcing(scenario: Scenario, system: StructuralSystem) -> PeriodicForcing:
    """The loads of a scenario with harmonic excitation, as functions of frequency, for a level of one.

    The excitation's own quantity is what stays the same: a base acceleration held moves the base by ``A / omega^2``.
    """
    excitation, factors = scenario.sine, not_none(system.sine)
    omega, held = 2 * np.pi * excitation.frequency, power_of(excitation.quantity)
    sine = sine_of(excitation, omega, 1.0)
    force = system.forcing.load * (sine * factors.at(np.array([omega]))[0])[:, None]
    moves = system.forcing.base_displacement is not None
    count, base = force.shape[0], int(moves)  # the base moves with a load of its own, which is no force
    return PeriodicForcing(
        np.ones(count + base, dtype=np.int64),
        np.pad(force, ((0, base), (0, 0))),
        np.append(held + factors.power, np.zeros(base)),
        np.append(np.zeros(count), np.full(base, -sine / omega**2)),
        np.append(np.zeros(count), np.full(base, held - 2.0)),
        omega,
    )


def periodic_flow(system: StructuralSystem, loads: PeriodicForcing, omega: float, level: float) -> PeriodicFlow:
    """A flow with its derivatives, of cubic springs by series.

    Parameters
    ----------
    system : whose motions are followed.
    loads : at rad/s ``omega``, and times ``level``.
    omega, level : of the excitation.

    Returns
    -------
    PeriodicFlow
        In closed form where the system has no cubic springs.

    Raises
    ------
    ValueError
        Where snubbers and cubic springs do not go together.
    """
    if system.cubic is None:
        return VariationalFlow(system.dynamics, loads, omega, level)
    return SmoothFlow(system.dynamics, loads, omega, level, springs=system.cubic)
