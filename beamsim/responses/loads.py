"""The loads of a built system under a sine of any frequency and level, and the periodic flow that they drive."""

from __future__ import annotations

from dataclasses import replace

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


def harmonic_loads(system: StructuralSystem, omega: float, sine: complex) -> Forcing:
    """The loads of a built system under a sine of one frequency.

    Parameters
    ----------
    system : whose excitation is harmonic.
    omega : rad/s.
    sine : complex amplitude of ``exp(i omega t)``, of which the sine is the real part.

    Returns
    -------
    Forcing
    """

    def signal(amplitude: complex) -> Signal:
        return Signal(np.zeros(1), np.array([1j * omega]), np.full((1, 1, 1), amplitude))

    factors = not_none(system.sine).at(np.array([omega]))[0]
    return replace(system.forcing, signal=tuple(signal(factor * sine) for factor in factors))


def periodic_forcing(scenario: Scenario, system: StructuralSystem) -> PeriodicForcing:
    """The loads of a scenario with harmonic excitation, as functions of frequency, for a level of one.

    The excitation's own quantity is what stays the same: a base acceleration held moves the base by ``A / omega^2``.
    """
    excitation, factors = scenario.sine, not_none(system.sine)
    omega, held = 2 * np.pi * excitation.frequency, power_of(excitation.quantity)
    sine = sine_of(excitation, omega, 1.0)
    amplitude, displacements = sine * factors.at(np.array([omega]))[0], list(system.forcing.base_displacements)
    count, motions = amplitude.size, np.arange(len(displacements))
    base, power = np.zeros((count, motions.size), dtype=complex), held + factors.power.astype(float)
    base[displacements, motions] = amplitude[displacements]
    return PeriodicForcing(
        np.ones(count, dtype=np.int64), system.forcing.load * amplitude[:, None], power, base, power, omega
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
