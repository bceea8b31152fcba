"""What a response curve shows of an orbit that is a sum of exponentials between its events, without samples.

Every measured quantity is linear in the exponential terms, so that its extremes over each segment follow from a search
that bounds skip most of, and its harmonics from integrals of exponentials.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np

from beamsim.analyses.response.motion import DrivenSignals, MeasuredMotion, measure, of_extremes, sampled_orbit
from beamsim.flow.variational import ExponentialTerms, VariationalFlow
from beamsim.typing import Complexes, Floats

if TYPE_CHECKING:
    from beamsim.flow.passage import Passage, PeriodicForcing
    from beamsim.flow.periodic_flow import PeriodicFlow
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
    terms = None
    if isinstance(flow, VariationalFlow) and not flow.system.contacts.internal_states and not system.cubic.count:
        terms = flow.exponential_terms(point.data)
    tables = None if terms is None else _tables(system, flow, terms, base, signals, limited)
    if terms is None or tables is None:
        return measure(system, loads, base, signals, sampled_orbit(problem, point), limited, harmonics)
    passage, contacts = point.data, flow.system.contacts
    share = passage.length @ contacts.touching(terms.phases)[terms.state] / passage.duration
    high, low = _extremes(terms, passage, np.concatenate(list(tables.values()), axis=2))
    spectrum = _harmonics(terms, passage, tables["x"], harmonics)
    return of_extremes(system, {name: table.shape[2] for name, table in tables.items()}, high, low, spectrum, share)


def _tables(
    system: StructuralSystem,
    flow: PeriodicFlow,
    terms: ExponentialTerms,
    base: DrivenSignals | None,
    signals: DrivenSignals,
    limited: Collection[str],
) -> dict[str, Complexes] | None:
    """(U, T, k) coefficients of the measured quantities in the terms; None where some are not linear in them."""
    t, loads = terms.tables, flow.loads
    driven = t.term_source == 1 + int(np.argmax(np.append(loads.multiple == 1, True)))  # those that turn with the loads
    drives = base is not None or signals.phasor.size > 0
    if any(rows.squared for rows in system.outputs) or (drives and not driven.any(axis=1).all()):
        return None
    exponent = np.take_along_axis(t.exponent, t.term_basis, axis=1)[:, :, None]

    def turning(of: DrivenSignals) -> Complexes:
        """(U, T, k) coefficients of signals."""
        return np.asarray(driven[:, :, None] * of.amplitude(flow.omega, flow.level))

    acceleration = exponent * terms.velocity
    carried = np.zeros((*driven.shape, 1)) if base is None else turning(base)[:, :, :1]
    shapes = np.array([p.shape for p in system.probes]).reshape(-1, system.dynamics.size)
    parts = {
        "x": terms.displacement @ shapes.T,
        "acceleration": acceleration @ shapes.T + carried * system.carried,
        "force": terms.force,
    }
    if "gap" in limited:
        parts["penetration"] = terms.penetration
    if "bending_stress" in limited and system.stress is not None:
        parts["bending"] = terms.displacement @ system.stress.row.T + carried * system.stress.base
    if system.outputs:
        constant = np.arange(driven.shape[0]), np.argmax(t.term_source == 0, axis=1)
        columns = []
        for rows in system.outputs:
            table = (
                terms.displacement @ rows.displacement.T + terms.velocity @ rows.velocity.T
                + acceleration @ rows.acceleration.T + carried * rows.base_acceleration
                + turning(signals) @ rows.load.T + terms.force @ rows.contact.T
            )  # fmt: skip
            table[constant] += rows.constant
            columns.append(table)
        parts["outputs"] = np.concatenate(columns, axis=2)
    return parts


def _extremes(terms: ExponentialTerms, passage: Passage, table: Complexes) -> tuple[Floats, Floats]:
    """Largest and smallest values (k,) of outputs (U, T, k) over an orbit, both sides of every event included."""
    from beamsim.orbits.extreme_kernels import periodic_extremes

    high, low = np.full(table.shape[2], -np.inf), np.full(table.shape[2], np.inf)
    periodic_extremes(
        terms.tables, terms.inputs, table, passage.time, passage.length, terms.state, passage.y, high, low
    )
    return high, low


def _harmonics(terms: ExponentialTerms, passage: Passage, table: Complexes, highest: int) -> Complexes:
    """(k, H + 1) mean and complex amplitudes of outputs (U, T, k)."""
    from beamsim.flow.fourier_kernels import fourier_integrals

    omega = 2.0 * np.pi / passage.duration * np.arange(highest + 1)
    out = np.zeros((table.shape[2], omega.size), dtype=complex)
    fourier_integrals(
        terms.tables, terms.inputs, np.ascontiguousarray(table), passage.time, passage.length, terms.state,
        np.zeros_like(terms.state), passage.y, omega, 0, passage.time.size, out,
    )  # fmt: skip
    out *= 2.0 / passage.duration
    out[:, 0] *= 0.5
    return out
