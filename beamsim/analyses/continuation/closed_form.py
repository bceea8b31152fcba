"""What a response curve shows of an orbit that is a sum of exponentials between its events, without samples.

Every measured quantity is linear in the exponential terms, so that its extremes over each segment follow from a search
that bounds skip most of, and its harmonics from integrals of exponentials.
"""

from __future__ import annotations

import numpy as np

from beamsim.analyses.continuation.motion import (
    DrivenSignals,
    MeasuredMotion,
    measure,
    sampled_orbit,
)
from beamsim.analyses.values import DISPLACEMENT
from beamsim.flow.channels import Acting, outputs_of
from beamsim.flow.contact_state import LinearOutput, OutputOf
from beamsim.flow.fourier import fourier_integrals
from beamsim.flow.passage import PeriodicForcing
from beamsim.flow.trajectory import Trajectory
from beamsim.flow.variational import VariationalFlow
from beamsim.orbits.branch import BranchPoint
from beamsim.orbits.shooting import ForcedOrbits
from beamsim.system.channels import ChannelSet
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Complexes, Floats


def measured_orbit(
    system: StructuralSystem,
    loads: PeriodicForcing,
    base: DrivenSignals | None,
    signals: DrivenSignals,
    problem: ForcedOrbits,
    point: BranchPoint,
    channels: ChannelSet,
    harmonics: int = 5,
) -> MeasuredMotion:
    """As :func:`beamsim.analyses.continuation.motion.measure` of an orbit found by shooting.

    Of orbits that are no sums of exponentials, and where energies are asked for, samples are measured.
    """
    flow, _ = problem.flow_at(point.parameter)
    contacts = flow.system.contacts
    output_of = orbit = None
    linear = not (contacts.internal_states or contacts.jointly_acting or channels.squares.size)
    if isinstance(flow, VariationalFlow) and linear:
        output_of, orbit = _outputs(flow, channels, base, signals), flow.motion(point.data)
    if output_of is None or orbit is None or not orbit.exponentials:
        return measure(system, loads, base, signals, sampled_orbit(problem, point), channels, harmonics)
    table = orbit.flow.output_table(output_of)
    spectrum = _harmonics(orbit, table[:, :, channels.places[DISPLACEMENT]], harmonics)
    found, share = orbit.extrema(output_of), orbit.contact_share()[: len(system.snubbers)]
    return MeasuredMotion(found.high, found.low, spectrum, share)


def _outputs(
    flow: VariationalFlow, channels: ChannelSet, base: DrivenSignals | None, signals: DrivenSignals
) -> OutputOf | None:
    """The channels as outputs of the flow; None where a signal is no multiple of one of its sources."""
    exact = flow.exact
    sources = exact.sources
    turning = (sources.exponent == 1j * flow.omega) & (sources.amplitude[0] != 0.0)
    if not (turning.any() or (base is None and not signals.phasor.size)):
        return None

    def driven(of: DrivenSignals | None) -> LinearOutput:
        """Harmonic signals, as combinations of one source of their frequency and its time derivative."""
        if of is None or not of.phasor.size:
            return exact.empty_output(1 if of is None else 0)
        output, f = exact.empty_output(of.phasor.size), int(np.argmax(turning))
        share = of.amplitude(flow.omega, flow.level) / sources.amplitude[0, f]
        output.direct[:, f], output.direct_slope[:, f] = share.real, share.imag / flow.omega
        return output

    moved = Acting.on(exact).base_displacement
    return outputs_of(exact, channels.linear, Acting(driven(signals), driven(base).some(slice(0, 1)), moved))


def _harmonics(orbit: Trajectory, table: Complexes, highest: int) -> Complexes:
    """(k, H + 1) mean and complex amplitudes of outputs (S, T, k)."""
    omega: Floats = 2.0 * np.pi / orbit.end * np.arange(highest + 1.0)
    out = 2.0 / orbit.end * fourier_integrals(orbit, table, omega)
    out[:, 0] *= 0.5
    return out
