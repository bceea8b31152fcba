"""The flows of a built system: transient under its own loads, periodic under a sine of any frequency and level."""

from __future__ import annotations

import numpy as np

from beamsim.errors import Problem, ScenarioError
from beamsim.flow.exact import ExactFlow, states_in_memory
from beamsim.flow.periodic_flow import PeriodicFlow, PeriodicForcing
from beamsim.flow.smooth_flow import SmoothFlow
from beamsim.flow.variational import VariationalFlow
from beamsim.inputs.profiles import phase_of_acceleration
from beamsim.inputs.signal import Signal, StreamedSignal
from beamsim.scenario import Scenario
from beamsim.scenario.excitation import Sine
from beamsim.scenario.quantities import acceleration_amplitude, power_of
from beamsim.system.equations import Forcing
from beamsim.system.structural import StructuralSystem
from beamsim.typing import not_none

MOST_PIECES = 4_000_000  # of an input, in motions that are kept as a whole
TABLES_SHARE = 0.2  # of the memory, for tables of contact states


def exact_flow(
    system: StructuralSystem, duration: float, most_states: int | None = None, memory: float = 2e9,
    pieces: tuple[int, int] | None = None,
) -> ExactFlow:  # fmt: skip
    """The exact flow of a built system; its first observer is the base's acceleration.

    Parameters
    ----------
    system : with its forcing.
    duration : longest time that it is asked for, s.
    most_states : contact states that are kept at once; by default those that fit into their share of the memory.
    memory : bytes.
    pieces : see `ExactFlow`.

    Returns
    -------
    ExactFlow

    Raises
    ------
    ScenarioError
        For a record of too many pieces to be taken as a whole.
    """
    observers = () if system.base_acceleration is None else (system.base_acceleration,)
    most = most_states or states_in_memory(system.dynamics, TABLES_SHARE * memory)
    if pieces is None:
        for record in (s.record for s in (*system.forcing.signal, *observers) if isinstance(s, StreamedSignal)):
            if record.pieces > MOST_PIECES:
                raise ScenarioError(_too_many_pieces(record.pieces))
    return ExactFlow(system.dynamics, system.forcing, duration, observers, most, pieces)


def _too_many_pieces(pieces: int) -> Problem:
    """An input has more pieces than a motion that is kept as a whole may have."""
    return Problem(
        "excitation",
        f"has {pieces:.3g} pieces, too many for this command or method (at most {MOST_PIECES:.0e})",
        "shorten run.duration, or give a lower excitation.sample_rate; beamsim run with one random excitation and "
        "method: exact takes any number",
    )


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
    if system.cubic.count == 0:
        return VariationalFlow(system.dynamics, loads, omega, level)
    return SmoothFlow(system.dynamics, loads, omega, level, springs=system.cubic)
