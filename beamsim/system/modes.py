r"""Natural frequencies and damping ratios of a structure whose contacts stay in given phases, for results.

The frequencies are those without damping. The ratios are those of the damped motion,

.. math:: \zeta = -\mathrm{Re}\,\lambda / |\lambda|,

with :math:`\lambda` the eigenvalues of the first-order equations, in which dashpots couple the undamped modes and
Maxwell branches have states of their own. Each undamped mode has the eigenvalue whose motion is most its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from beamsim.contacts.contacts import Contacts
from beamsim.contacts.laws import PENETRATION, RATE
from beamsim.contacts.snubbers import FRICTION
from beamsim.fields import JSON, Counter, attribute, dataset, declared, group
from beamsim.outcomes import first_of
from beamsim.scenario import Scenario
from beamsim.scenario.base import counted
from beamsim.scenario.body import Located
from beamsim.structures.modes import closed_modes
from beamsim.structures.places import Stations
from beamsim.structures.reduction import receptance_bound
from beamsim.structures.structure import ReducedBasis, Structure
from beamsim.system.equations import Equations, PiecewiseLinearSystem, StateEquations
from beamsim.system.parts import Parts, base_direction, force_sites, gravity_loads
from beamsim.typing import Floats, Ints

DIFFERENT = 1.3  # factor between damping ratios that are told apart
UNCOUPLED = 1e-14  # damping between two modes, over the largest of a mode, that is round-off
SLOW = 1e-6  # rad/s, at which Maxwell branches have relaxed

_MODE = (Counter("mode", "mode number"),)


@declared(along=_MODE)
class ModeTable:
    """Natural frequencies, damping and mode shapes of the reduced model."""

    stations: Stations = group("", Stations)  # nx of them
    # (r,), every snubber closed: piecewise-linear springs as at rest
    open_frequencies_hz: Floats = dataset("Hz", "natural frequencies with every contact open")
    closed_frequencies_hz: Floats = dataset("Hz", "natural frequencies with every contact closed")
    shapes: Floats = dataset(  # (r, nx)
        "kg^-0.5", "mode shapes of the open structure, unit modal mass", along=(*_MODE, "position")
    )
    damping_ratios: Floats = dataset("1", "modal damping ratios of the open structure")  # (r,) nan for rigid-body modes
    closed_damping_ratios: Floats = dataset(
        "1", "modal damping ratios with every contact closed, its dashpot and Maxwell branches included"
    )
    kept_modes: int = attribute("1", "number of modes kept by the reduction")
    static_vectors: int = attribute("1", "number of static vectors kept by the reduction")
    highest_frequency_hz: float = attribute("Hz", "the highest frequency that the reduction was made for")
    reduction_bound: float = attribute(  # see docs/theory.md
        "1",
        "bound of the error of the receptance at contacts and loads, up to highest_frequency_hz and at the frequencies "
        "of the excitation, over the static compliance there, or over the receptance where that is larger; NaN where "
        "it is not known",
    )
    dashpots: dict[str, dict[str, Any]] = attribute(
        "", "JSON object: by snubber its dashpot, N s/m, and what that follows from", codec=JSON
    )
    probe_bound: float | None = attribute("1", "the same of the receptance between these and the probes", default=None)
    # by body, of several bodies only
    kinetic_energy_share: dict[str, Floats] = dataset(
        "1", "share of a mode's kinetic energy in this body", per="body", default_factory=dict
    )
    strain_energy_share: dict[str, Floats] = dataset(
        "1",
        "share of a mode's strain energy in this body, the rest being in springs of joints; NaN for rigid-body modes",
        per="body",
        default_factory=dict,
    )
    # None where there is no equilibrium, or where contacts hold, are pressed by others, or soften beside it
    resting_frequencies_hz: Floats | None = dataset(
        "Hz", "natural frequencies with every contact as it is at static equilibrium, friction included", default=None
    )
    resting_damping_ratios: Floats | None = dataset("1", "modal damping ratios there", default=None)


def mode_table(
    parts: Parts, dynamics: PiecewiseLinearSystem, stops: Contacts, equilibrium: Floats | None, stations: Stations,
    deflection: Floats,
) -> ModeTable:  # fmt: skip
    """What a result says of its model: natural frequencies, damping and accuracy.

    Parameters
    ----------
    parts : the reduced structure.
    dynamics : the structure and all its contacts.
    stops : those that are snubbers, which alone are open and closed.
    equilibrium : (n,) coordinates at rest; None where that is not known, or not linear.
    stations, deflection : where shapes are known, and (nx, n) deflection there for a unit of each coordinate.

    Returns
    -------
    ModeTable
    """
    basis, structure, contacts = parts.basis, parts.structure, dynamics.contacts
    omega = [2 * np.pi * frequency for frequency in parts.scenario.excitation.frequencies_hz]
    bound = receptance_bound(structure, basis, parts.damping, _loads(parts), structure.rows(parts.probe_sites), omega)
    # the arrays of all contacts are those that the motion needs, too
    stopped = dynamics if contacts.count == stops.count else replace(dynamics, contacts=stops)
    opened = damped_modes(stopped, stops.start, basis.rigid)[1]
    of_stops = np.array([law.closed_phase for law in stops.laws], dtype=np.int64)
    closed, of_closed = damped_modes(stopped, of_stops, basis.rigid)
    resting, of_resting = None, None
    if equilibrium is not None and not contacts.jointly_acting:
        phases = contacts.resting_phases(-contacts.gap - contacts.sign * (contacts.shape @ equilibrium))
        if np.all(contacts.dynamic_stiffness(phases, np.full(1, SLOW)).real >= 0.0):
            resting, of_resting = damped_modes(dynamics, phases, basis.rigid)
    return ModeTable(
        open_frequencies_hz=parts.omega / (2 * np.pi),
        closed_frequencies_hz=closed / (2 * np.pi),
        damping_ratios=opened,
        closed_damping_ratios=of_closed,
        resting_frequencies_hz=None if resting is None else resting / (2 * np.pi),
        resting_damping_ratios=of_resting,
        dashpots=dashpots(parts.scenario.located_snubbers, contacts),
        shapes=deflection.T,
        stations=stations,
        kept_modes=basis.modes,
        static_vectors=basis.size - basis.modes,
        highest_frequency_hz=basis.highest_frequency * structure.frequency_scale / (2 * np.pi),
        reduction_bound=bound.loads,
        probe_bound=bound.probes,
        **(_energy_shares(structure, basis) if len(structure.members) > 1 else {}),
    )


def _energy_shares(structure: Structure, basis: ReducedBasis) -> dict[str, Any]:
    """(r,) by body the shares of kinetic and of strain energy of the coordinates."""
    kinetic, strain = {}, {}
    squared = np.where(basis.omega > 0, basis.omega, np.nan) ** 2
    for member in structure.members:
        fields = member.expansion @ basis.vectors
        moving = np.einsum("ij,ij->j", fields, member.body.mass @ fields)
        kinetic[member.body.name] = moving * member.mass_ratio
        bent = np.asarray(member.body.factor @ fields)
        strain[member.body.name] = np.sum(bent**2, axis=0) * member.stiffness_ratio / squared
    return {"kinetic_energy_share": kinetic, "strain_energy_share": strain}


def _loads(parts: Parts) -> Floats:
    """(m, N) rows of contacts and forces, and inertia loads where the base moves or gravity acts."""
    scenario, structure = parts.scenario, parts.structure
    rows = structure.rows([*parts.snubber_sites, *parts.spring_sites, *force_sites(scenario)])
    moving = base_direction(scenario)
    directions = dict.fromkeys(direction for direction, _ in gravity_loads(scenario))
    if moving is not None:
        directions = {moving: None} | directions
    moved = [each.pattern(structure).vector for each in parts.moved]
    return np.vstack([rows, *moved, *(structure.base_load(direction)[0] for direction in directions)])


def doubts(scenario: Scenario, modes: ModeTable) -> list[str]:
    """Warnings that follow from the table.

    They are of stops without effect, of an excited structure without damping, of an inaccurate reduced model and of
    damping ratios of snubbers.
    """
    opened, closed, stops, warnings = modes.open_frequencies_hz, modes.closed_frequencies_hz, scenario.all_snubbers, []
    stiff = [stop.name for stop in stops if stop.stiffness is not None]
    if stops and len(stiff) == len(stops) and np.all(closed - opened <= 1e-3 * opened):
        warnings.append(
            f"snubbers: with {first_of(stiff, 4)} closed no natural frequency is more than 0.1 % higher: the stiffness "
            "has no effect; was kN/m meant?"
        )
    # what takes energy out of a motion: dashpots of any kind, friction, stops that yield
    loses = any(np.nan_to_num(each).any() for each in (modes.damping_ratios, modes.closed_damping_ratios))
    loses |= any(each.item.kind == FRICTION for each in scenario.nonlinear_springs) or any(s.yields for s in stops)
    if scenario.excitation.kind != "none" and scenario.nnm is None and not loses:
        warnings.append(
            "nothing is damped: what an excitation puts in stays, and no motion becomes steady; give each body "
            "damping, for example {kind: modal, ratio: 1 %}"
        )
    if modes.reduction_bound > 0.01:
        warnings.append(
            f"the reduced model may not be accurate: up to {modes.highest_frequency_hz:.4g} Hz and at the frequencies "
            f"of the excitation the error of its receptance at contacts and loads is bounded by "
            f"{modes.reduction_bound:.2g} of its size; {scenario.more_modes(modes.kept_modes)}"
        )
    return warnings + damping_remarks(scenario.located_snubbers, modes)


def dashpots(located: Sequence[Located], contacts: Contacts) -> dict[str, dict[str, Any]]:
    """By snubber its dashpot, N s/m or N m s/rad, and what that follows from; the snubbers are the first contacts."""
    entry, found = {"m": "dashpot_n_s_per_m", "rad": "dashpot_n_m_s_per_rad"}, {}
    for at, law in zip(located, contacts.laws, strict=False):
        snubber, number = at.item, len(at.item.maxwell)
        if snubber.damping is None:
            source = "none written"
        elif snubber.damping.kind == "viscous" or not law.dashpot:
            source = "as written"
        else:
            ratio = snubber.damping.ratio
            hz = ratio * law.stiffness / (np.pi * law.dashpot)
            source = f"{100 * ratio:.4g} % of {hz:.4g} Hz, the first natural frequency with it alone closed"
        beside = f", beside {counted(number, 'Maxwell branch', 'Maxwell branches')}" if number else ""
        found[snubber.name] = {entry[snubber.units[0]]: law.dashpot, "from": source + beside}
    return found


def damping_remarks(snubbers: Sequence[Located], modes: ModeTable) -> list[str]:
    """That the first closed mode is damped otherwise than a ratio says, which is that of another mode."""
    closed = np.flatnonzero(modes.closed_frequencies_hz > 0.0)
    if not closed.size:
        return []
    hz, ratio = modes.closed_frequencies_hz[closed[0]], float(modes.closed_damping_ratios[closed[0]])
    written = {s.name: s.damping.ratio for _, _, s, _ in snubbers if s.damping and s.damping.kind == "ratio"}
    other = {name: x for name, x in written.items() if x > 0.0 and not 1.0 / DIFFERENT < ratio / x < DIFFERENT}
    if not other:
        return []
    shares = ", ".join(dict.fromkeys(f"{100 * x:.3g}" for x in other.values()))
    return [
        f"snubbers: the first mode with all snubbers closed, {hz:.4g} Hz, has a damping ratio of {100 * ratio:.3g} %, "
        f"{shares} % is written for {first_of(list(other), 4)}: the dashpot 2 ratio k / Omega damps a mode by the "
        "snubber's share of its energy, and Omega is the first natural frequency with that snubber alone closed; give "
        "the dashpot in N s/m where the damping of this mode is known"
    ]


def undamped_modes(dynamics: PiecewiseLinearSystem, phases: Ints, rigid: int) -> tuple[Floats, Floats, Floats]:
    """Natural frequencies (n,), rad/s, and modes (n, n) without damping, with contacts in their phases.

    The third array is the stiffness (m,) of the contacts, N/m, of which Maxwell branches have relaxed.

    Parameters
    ----------
    dynamics, phases, rigid : as of `damped_modes`.
    """
    slow = np.asarray(dynamics.contacts.dynamic_stiffness(phases, np.full(1, SLOW))[0].real)
    return *closed_modes(np.sqrt(dynamics.stiffness), dynamics.contacts.shape, slow, rigid), slow


def damped_modes(dynamics: PiecewiseLinearSystem, phases: Ints, rigid: int) -> tuple[Floats, Floats]:
    """Natural frequencies and damping ratios with contacts in their phases.

    Parameters
    ----------
    dynamics : the structure and its contacts, none of which holds or is pressed by another.
    phases : (m,) of the contacts.
    rigid : number of rigid-body coordinates.

    Returns
    -------
    (n,), (n,)
        rad/s, ascending, without damping; and the ratios, nan of rigid-body modes. A mode that does not oscillate has
        that of its own coordinate alone, which is 1 or more for a single mass.
    """
    contacts, n = dynamics.contacts, dynamics.size
    omega, shapes, slow = undamped_modes(dynamics, phases, rigid)
    equations = StateEquations(Equations(dynamics), phases)
    force, by_states = equations.factors, equations.internal_factors
    depth = -contacts.sign[:, None] * (contacts.shape @ shapes)
    damping = shapes.T @ dynamics.damping @ shapes + (depth.T * force[:, RATE]) @ depth
    ratio = np.divide(np.diag(damping), 2.0 * omega, out=np.full(n, np.nan), where=omega > 0.0)
    coupling = np.abs(damping - np.diag(np.diag(damping))).max(initial=0.0)
    if not by_states.any() and coupling <= UNCOUPLED * np.abs(damping).max(initial=0.0):
        return omega, ratio

    scale = np.maximum(omega, 1e-3 * omega.max() or 1.0)  # of displacements; a rigid mode has none
    states, drive = equations.internal_rates[:, equations.equations.internal], equations.internal_drive
    own = depth[contacts.owner]
    beyond = (depth.T * (force[:, PENETRATION] - slow)) @ depth  # of branches that have not relaxed
    matrix = np.block([
        [np.zeros((n, n)), np.diag(scale), np.zeros((n, contacts.internal_states))],
        [-(np.diag(omega**2) + beyond) / scale, -damping, -own.T * by_states],
        [drive[:, PENETRATION, None] * own / scale, drive[:, RATE, None] * own, states],
    ])  # fmt: skip
    values, vectors = np.linalg.eig(matrix)
    values, vectors = values[values.imag > 0.0], vectors[: 2 * n, values.imag > 0.0]
    share = np.abs(vectors[:n]) ** 2 + np.abs(vectors[n:]) ** 2
    share /= share.sum(axis=0)
    modes, of = share.argmax(axis=0), np.arange(share.shape[1])
    if np.unique(modes).size < modes.size:  # of two that have most of the same mode
        from scipy.optimize import linear_sum_assignment  # which takes as long to import as a validation

        modes, of = linear_sum_assignment(share, maximize=True)
    ratio[modes] = 0.0 - values[of].real / np.abs(values[of])  # 0, not -0
    ratio[omega == 0.0] = np.nan
    return omega, ratio
