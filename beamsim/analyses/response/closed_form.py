"""What a response curve shows of an orbit that is a sum of exponentials between its events, without samples.

Every measured quantity is linear in the exponential terms, so that its extremes over each segment follow from a search
that bounds skip most of, and its harmonics from integrals of exponentials.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import TYPE_CHECKING

import numpy as np

from beamsim.analyses.response.motion import DrivenSignals, MeasuredMotion, measure, of_extremes, sampled_orbit
from beamsim.analyses.run.outputs import stack
from beamsim.flow.contact_state import LinearOutput
from beamsim.flow.fourier import fourier_integrals
from beamsim.flow.trajectory import Trajectory
from beamsim.flow.variational import VariationalFlow
from beamsim.typing import Complexes, Floats, Ints

if TYPE_CHECKING:
    from beamsim.flow.passage import PeriodicForcing
    from beamsim.orbits.branch import BranchPoint
    from beamsim.orbits.shooting import ForcedOrbits
    from beamsim.system.structural import StructuralSystem


def measured_orbit(
    system: StructuralSystem,
    loads: PeriodicForcing,
    base: DrivenSignals | None,
    signals: DrivenSignals,
    problem: ForcedOrbits,
    point: BranchPoint,
    limited: Collection[str] = (),
    harmonics: int = 5,
) -> MeasuredMotion:
    """As :func:`beamsim.analyses.response.motion.measure` of an orbit found by shooting.

    Of orbits that are no sums of exponentials, and where energies are asked for, samples are measured.
    """
    flow, _ = problem.flow_at(point.parameter)
    contacts = flow.system.contacts
    output_of = orbit = None
    if isinstance(flow, VariationalFlow) and not (contacts.internal_states or contacts.jointly_acting):
        output_of, orbit = _outputs(system, flow, base, signals, limited), flow.motion(point.data)
    if output_of is None or orbit is None or not orbit.exponentials:
        return measure(system, loads, base, signals, sampled_orbit(problem, point), limited, harmonics)
    sizes: dict[str, int] = {}

    def rows(phases: Ints) -> LinearOutput:
        parts = output_of(phases)
        sizes.update({name: part.row.shape[0] for name, part in parts.items()})
        return stack(*parts.values())

    table = orbit.flow.output_table(rows)
    extrema = orbit.extrema(rows)
    spectrum = _harmonics(orbit, table[:, :, : sizes["x"]], harmonics)
    return of_extremes(system, sizes, extrema.high, extrema.low, spectrum, orbit.contact_share())


def _outputs(
    system: StructuralSystem, flow: VariationalFlow, base: DrivenSignals | None, signals: DrivenSignals,
    limited: Collection[str],
) -> Callable[[Ints], dict[str, LinearOutput]] | None:  # fmt: skip
    """The measured quantities by the phases of the contacts; None where some are not linear."""
    exact, n = flow.exact, flow.system.size
    sources = exact.sources
    turning = (sources.exponent == 1j * flow.omega) & (sources.amplitude[0] != 0.0)
    if any(rows.squared for rows in system.outputs) or not (
        turning.any() or (base is None and not signals.phasor.size)
    ):
        return None

    def driven(of: DrivenSignals) -> LinearOutput:
        """Harmonic signals, as combinations of one source of their frequency and its time derivative."""
        output, f = exact.empty_output(of.phasor.size), int(np.argmax(turning))
        share = of.amplitude(flow.omega, flow.level) / sources.amplitude[0, f]
        output.direct[:, f], output.direct_slope[:, f] = share.real, share.imag / flow.omega
        return output

    def of_state(rows: Floats, part: slice) -> LinearOutput:
        output = exact.empty_output(rows.shape[0])
        output.row[:, part] = rows
        return output

    place, speed = slice(0, n), slice(n, 2 * n)
    carried = exact.empty_output(1) if base is None else driven(base).some(slice(0, 1))
    load = driven(signals) if system.outputs and signals.phasor.size else exact.empty_output(signals.phasor.size)
    shapes = np.array([p.shape for p in system.probes]).reshape(-1, n)

    def output_of(phases: Ints) -> dict[str, LinearOutput]:
        acceleration, force = exact.rates(phases).some(speed), exact.contact_forces(phases)
        parts = {
            "x": of_state(shapes, place),
            "acceleration": acceleration.combined(shapes) + carried.combined(system.carried[:, None]),
            "force": force,
        }
        if "gap" in limited:
            parts["penetration"] = exact.penetrations[0]
        if "bending_stress" in limited and system.stress is not None:
            parts["bending"] = of_state(system.stress.row, place) + carried.combined(system.stress.base[:, None])
        if system.outputs:
            parts["outputs"] = stack(*(
                of_state(rows.displacement, place) + of_state(rows.velocity, speed)
                + acceleration.combined(rows.acceleration) + carried.combined(rows.base_acceleration[:, None])
                + load.combined(rows.load) + force.combined(rows.contact) + exact.constant_output(rows.constant)
                for rows in system.outputs
            ))  # fmt: skip
        return parts

    return output_of


def _harmonics(orbit: Trajectory, table: Complexes, highest: int) -> Complexes:
    """(k, H + 1) mean and complex amplitudes of outputs (S, T, k)."""
    omega: Floats = 2.0 * np.pi / orbit.end * np.arange(highest + 1.0)
    out = 2.0 / orbit.end * fourier_integrals(orbit, table, omega)
    out[:, 0] *= 0.5
    return out
