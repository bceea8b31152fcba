"""From scenario to system: the only bridge between what the user wrote and the mathematics."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.contacts.contacts import Contacts
from beamsim.contacts.equilibrium import CubicSprings, Equilibrium, find_equilibrium
from beamsim.contacts.snubbers import build_contacts, resists, resolve_preloads, springs_of
from beamsim.contacts.springs import cubic_springs, describe_springs, nonlinear_springs, spring_contacts
from beamsim.errors import Problem, ScenarioError
from beamsim.inputs.excitation import BaseMotion, base_motion, level_signal, single_frequency_hz
from beamsim.scenario.run import ModeStart, PolynomialStart, ReleasedForceStart
from beamsim.structures.beam import assemble_beam
from beamsim.structures.chain import assemble_chain
from beamsim.structures.damping import damping_matrix, damping_ratios
from beamsim.structures.modes import closed_frequencies
from beamsim.structures.moving_point import deflection_and_slope, places_needed
from beamsim.structures.places import pair_of, place_of, row_of
from beamsim.structures.recovery import deflection_rows, inertia_remainder, moment_rows, stations
from beamsim.structures.reduction import LoadPattern, ReducedBasis, reduce_model
from beamsim.structures.reduction_error import LinearState, reduction_error
from beamsim.system.equations import Forcing, PiecewiseLinearSystem
from beamsim.system.initial import largest_deflection, project_field, project_polynomial
from beamsim.system.structural import BeamRecovery, ModeTable, ProbeRow, SnubberInfo, StructuralSystem
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.inputs.signal import Signal
    from beamsim.scenario import Scenario
    from beamsim.scenario.run import Start
    from beamsim.structures.full import FullModel

# Modes that a default reduction keeps at least, whatever the sample rate.
_LEAST_FLEXIBLE_MODES = 6
# Superharmonics that a default reduction provides for.
_LEAST_HARMONICS = 10
# A projected initial shape further off than this is worth a warning.
_PROJECTION_TOLERANCE = 1e-6


@dataclass(frozen=True)
class _Parts:
    """What the steps of the build share."""

    scenario: Scenario
    model: FullModel
    basis: ReducedBasis
    omega: Floats  # (n,) rad/s

    def shape(self, place: float) -> Floats:
        """(n,) deflection at a position (or mass number) for a unit of each coordinate, 1/sqrt(kg)."""
        row = self.model.deflection(place) @ self.basis.vectors
        return np.asarray(row / np.sqrt(self.model.mass_scale))

    def shapes(self, things: Sequence[Any]) -> Floats:
        """(len(things), n) deflection, between two masses stretch, at what sits somewhere, 1/sqrt(kg)."""
        rows = [row_of(self.model, thing) @ self.basis.vectors for thing in things]
        return np.asarray(np.array(rows).reshape(len(things), self.basis.size) / np.sqrt(self.model.mass_scale))

    @property
    def inertia(self) -> Floats:
        """(n,) modal load of a unit acceleration, sqrt(kg)."""
        row = self.model.inertia @ self.basis.vectors
        return np.asarray(row * np.sqrt(self.model.mass_scale))


def build_system(scenario: Scenario) -> StructuralSystem:
    """Assemble, reduce and resolve a scenario.

    Parameters
    ----------
    scenario : a validated scenario.

    Returns
    -------
    StructuralSystem
        In mass-normalised coordinates relative to the base; see its fields.

    Raises
    ------
    ScenarioError
        If a preload or the chosen start needs a static equilibrium that does not exist or is not the only one, or if
        the start asks for a mode that the reduction does not keep.
    """
    try:
        return _build(_parts(scenario))
    except ScenarioError as error:
        raise scenario.located(error) from None


def build_with_moving_point(
    scenario: Scenario, low: float, high: float
) -> tuple[StructuralSystem, Callable[[float], tuple[Floats, Floats]]]:
    """The system in coordinates that serve a snubber anywhere between two positions of the beam, m.

    Static vectors are added until the reduced model's compliance is that of the full one all along the way. The second
    of what is returned gives the deflection (n,) for a unit of each coordinate at a position, and its derivative by it.
    """
    try:
        added = [low, high]
        parts = _parts(scenario, added)
        while more := places_needed(parts.model, parts.basis, low, high, added):
            added += more
            parts = _parts(scenario, added)
        system = _build(parts)
    except ScenarioError as error:
        raise scenario.located(error) from None
    scale = 1 / np.sqrt(parts.model.mass_scale)
    assert scenario.beam is not None
    length = scenario.beam.length

    def shape_at(position: float) -> tuple[Floats, Floats]:
        deflection, slope = deflection_and_slope(parts.model, parts.basis.vectors, position / length)
        return deflection * scale, slope * (scale / length)

    return system, shape_at


def _parts(scenario: Scenario, also_at: Sequence[float] = ()) -> _Parts:
    structure: Any = scenario.beam if scenario.beam is not None else scenario.chain
    model = assemble_beam(scenario.beam) if scenario.beam is not None else assemble_chain(structure)
    basis = _reduce(scenario, model, also_at)
    return _Parts(scenario, model, basis, basis.omega * model.frequency_scale)


def _build(parts: _Parts) -> StructuralSystem:
    scenario, model, basis = parts.scenario, parts.model, parts.basis
    structure: Any = scenario.beam if scenario.beam is not None else scenario.chain
    stiffness = parts.omega**2
    damping = damping_matrix(structure, model, basis, parts.omega)
    warnings: list[str] = []

    snubbers = scenario.all_snubbers
    path = "snubbers" if scenario.beam is not None else "chain.snubbers"
    stops = build_contacts(snubbers, parts.shapes(snubbers), parts.omega, basis.rigid, path)
    nonlinear = [spring for _, spring in nonlinear_springs(scenario.chain)]
    springs = describe_springs(scenario.chain, parts.shapes(nonlinear))
    loads = _constant_loads(parts)
    cubic = cubic_springs(springs, basis.size)
    contacts = stops.with_others(spring_contacts(springs, basis.size))
    contacts = resolve_preloads(contacts, [s.preload for s in snubbers], stiffness, basis.rigid, loads, cubic, path)
    equilibrium = find_equilibrium(stiffness, basis.rigid, springs_of(contacts), loads, cubic)
    initial = _initial_state(parts, contacts, loads, cubic, equilibrium, warnings)

    motion, forcing = _forcing(parts, bool(contacts.on_ground.any() or cubic.felt.any()))
    probes = tuple(ProbeRow(p.name, place_of(p), parts.shape(place_of(p))) for p in scenario.effective_probes)
    beam, position, shapes = _recovery(parts)
    error = reduction_error(model, basis, damping, _linear_state(parts, stops))
    closed = closed_frequencies(parts.omega, stops.shape, stops.stiffness, basis.rigid)
    return StructuralSystem(
        dynamics=PiecewiseLinearSystem(stiffness, damping, contacts, loads.sum(axis=0)),
        forcing=forcing,
        initial_state=initial,
        probes=probes,
        base_acceleration=motion.acceleration if motion else None,
        base_velocity=motion.velocity if motion else None,
        base_displacement=motion.displacement if motion else None,
        snubbers=_describe_snubbers(parts, contacts, equilibrium),
        beam=beam,
        modes=ModeTable(
            open_frequencies_hz=parts.omega / (2 * np.pi),
            closed_frequencies_hz=closed / (2 * np.pi),
            shapes=shapes,
            position=position,
            damping_ratios=damping_ratios(damping, parts.omega),
            kept_modes=basis.modes,
            static_vectors=basis.static_vectors,
            highest_frequency_hz=basis.highest_frequency * model.frequency_scale / (2 * np.pi),
            reduction_error=error,
            position_unit="1" if beam is None else "m",
        ),
        static_equilibrium=equilibrium.q,
        static_reason=equilibrium.reason,
        excitation_frequency_hz=single_frequency_hz(scenario.excitation),
        cubic=cubic,
        springs=springs,
        warnings=tuple(warnings),
    )


def _start(scenario: Scenario) -> Start | None:
    return None if scenario.run is None else scenario.run.start


def _point_of_excitation(scenario: Scenario) -> float | None:
    """Where a point force acts; None for base motion and for no excitation."""
    excitation = scenario.excitation
    if excitation.kind == "none" or excitation.applied_to == "base":
        return None
    return place_of(excitation.applied_to)


def _forces(scenario: Scenario) -> list[float]:
    """Places of every point force, released ones included."""
    places = [place_of(force) for force in scenario.constant_forces]
    point = _point_of_excitation(scenario)
    if point is not None:
        places.append(point)
    start = _start(scenario)
    if isinstance(start, ReleasedForceStart):
        places.append(place_of(start.released_force))
    return places


def _reduce(scenario: Scenario, model: FullModel, also_at: Sequence[float]) -> ReducedBasis:
    """The reduced basis that the scenario asks for, or the default, with static vectors at further places.

    A chain keeps all its modes by default. A beam is reduced for frequencies up to half the sample rate, at
    least ten times the excitation frequency and six flexible modes; modes whose number exceeds that of the elements,
    which the mesh does not carry, are left out unless asked for.
    """
    felt = [*scenario.all_snubbers, *(spring for _, spring in nonlinear_springs(scenario.chain))]
    places = [place_of(thing) for thing in felt if pair_of(thing) is None] + _forces(scenario) + list(also_at)
    patterns = [LoadPattern(model.deflection(x), x) for x in dict.fromkeys(places)]
    pairs = {pair: thing for thing in felt if (pair := pair_of(thing)) is not None}
    patterns += [LoadPattern(row_of(model, thing), place_of(thing)) for thing in pairs.values()]
    if scenario.gravity != 0:
        patterns.append(LoadPattern(model.inertia, None))
    asked = scenario.reduction
    hz = 2 * np.pi / model.frequency_scale
    if asked is not None and asked.modes is not None:
        return reduce_model(model, patterns, count=None if asked.modes == "all" else asked.modes)
    if asked is not None and asked.highest_frequency is not None:
        return reduce_model(model, patterns, highest_frequency=asked.highest_frequency * hz)
    if model.mesh is None:
        return reduce_model(model)
    half_rate = 0.0 if scenario.run is None else scenario.run.output_rate / 2
    wanted = max(half_rate, _LEAST_HARMONICS * scenario.excitation.highest_frequency_hz)
    rigid = model.rigid.shape[1]
    start = _start(scenario)
    least = max(rigid + _LEAST_FLEXIBLE_MODES, start.mode if isinstance(start, ModeStart) else 0)
    return reduce_model(
        model, patterns, highest_frequency=wanted * hz, least=least, most=max(rigid + model.mesh.elements, least)
    )


def _constant_loads(parts: _Parts) -> Floats:
    """(L, n) gravity (towards negative deflection) and constant forces, N/sqrt(kg)."""
    loads = [force.force * parts.shape(place_of(force)) for force in parts.scenario.constant_forces]
    if parts.scenario.gravity != 0:
        loads.append(-parts.scenario.gravity * parts.inertia)
    return np.array(loads).reshape(len(loads), parts.basis.size)


def _forcing(parts: _Parts, felt: bool) -> tuple[BaseMotion | None, Forcing]:
    """The base's motion (None at rest) and the time-dependent loads; ``felt``: a contact or spring is on the ground."""
    excitation = parts.scenario.excitation
    n = parts.basis.size
    if excitation.kind == "none":
        return None, Forcing(np.zeros((0, n)), ())
    duration = None if parts.scenario.run is None else parts.scenario.run.duration
    folder = parts.scenario.folder_of("excitation", "file")
    point = _point_of_excitation(parts.scenario)
    if point is not None:
        return None, Forcing(parts.shape(point)[None, :], (level_signal(excitation, duration, folder),))
    motion = base_motion(excitation, duration, folder)
    load: list[Floats] = [-parts.inertia]
    signal: list[Signal] = [motion.acceleration]
    if parts.model.ground.any():  # springs to ground stretch by the base's displacement as well
        load.append(np.asarray(parts.model.ground @ parts.basis.vectors) / np.sqrt(parts.model.mass_scale))
        signal.append(motion.displacement)
    return motion, Forcing(np.array(load), tuple(signal), motion.displacement if felt else None)


def _recovery(parts: _Parts) -> tuple[BeamRecovery | None, Floats, Floats]:
    """Recovery along a beam, with stations and open mode shapes for the mode table."""
    model, basis = parts.model, parts.basis
    scale = 1 / np.sqrt(model.mass_scale)
    beam = parts.scenario.beam
    if beam is None or model.mesh is None:
        return None, np.arange(1.0, model.size + 1), basis.vectors.T * scale
    length = beam.length
    points = [place_of(s) for s in parts.scenario.all_snubbers] + _forces(parts.scenario)
    x = stations(model.mesh, [p / length for p in points])
    field = np.zeros((2 * model.mesh.nodes.size, basis.size))
    field[model.free] = basis.vectors
    deflection = deflection_rows(model.mesh, x, field) * scale
    moment = moment_rows(model, basis, x, length)
    on_base = parts.scenario.excitation.kind != "none" and _point_of_excitation(parts.scenario) is None
    remainder = inertia_remainder(model, basis, x, moment) if on_base else np.zeros(x.size)
    return (
        BeamRecovery(
            position=x * length,
            deflection=deflection,
            bending_moment=moment * (scale * beam.bending_stiffness / length**2),
            stress_per_moment=beam.extreme_fibre / beam.second_moment,
            base_moment=-remainder * (model.mass_scale * length),
        ),
        x * length,
        deflection.T,
    )


def _linear_state(parts: _Parts, contacts: Contacts) -> LinearState:
    scenario, model = parts.scenario, parts.model
    point = _point_of_excitation(scenario)
    load: Floats | None = None
    if scenario.excitation.kind != "none":
        load = model.inertia if point is None else model.deflection(point)
    return LinearState(
        contact_rows=np.array([row_of(model, s) for s in scenario.all_snubbers]).reshape(-1, model.size),
        stiffness=contacts.stiffness,
        dashpot=contacts.dashpot,
        output_rows=model.rows([place_of(p) for p in scenario.effective_probes]),
        load=load,
        omega=tuple(2 * np.pi * f for f in scenario.excitation.frequencies_hz),
    )


def _describe_snubbers(parts: _Parts, contacts: Contacts, equilibrium: Equilibrium) -> tuple[SnubberInfo, ...]:
    scenario = parts.scenario
    if scenario.beam is not None:
        unit = scenario.beam.bending_stiffness / scenario.beam.length**3
    else:
        assert scenario.chain is not None
        unit = max(scenario.chain.springs)
    return tuple(
        SnubberInfo(
            name=s.name,
            position=place_of(s),
            side=resists(s),
            stiffness=float(contacts.stiffness[i]),
            dashpot=float(contacts.dashpot[i]),
            gap=float(contacts.gap[i]),
            preload=float(equilibrium.force[i]),
            blocked_force=float(contacts.stiffness[i] * max(-contacts.gap[i], 0.0)),
            stiffness_ratio=float(contacts.stiffness[i] / unit) if unit > 0 else float("inf"),
            shape=contacts.shape[i],
        )
        for i, s in enumerate(scenario.all_snubbers)
    )


def _initial_state(
    parts: _Parts,
    contacts: Contacts,
    loads: Floats,
    cubic: CubicSprings,
    equilibrium: Equilibrium,
    warnings: list[str],
) -> Floats:
    """(2 n,) q then q' at t = 0, relative to the base."""
    n = parts.basis.size
    q, v = np.zeros(n), np.zeros(n)
    start = _start(parts.scenario)
    if start is None:
        q = q if equilibrium.q is None else equilibrium.q
    elif start == "static_equilibrium":
        if equilibrium.q is None:
            raise ScenarioError(
                Problem(
                    "run.start",
                    f"= static_equilibrium does not exist: {equilibrium.reason}",
                    "start from rest, or hold the structure with a support, a preload or a load towards a snubber",
                )
            )
        q = equilibrium.q
    elif isinstance(start, ReleasedForceStart):
        force = start.released_force
        extra = (force.force * parts.shape(place_of(force)))[None, :]
        held = find_equilibrium(
            parts.omega**2, parts.basis.rigid, springs_of(contacts), np.vstack([loads, extra]), cubic
        )
        if held.q is None:
            raise ScenarioError(
                Problem(
                    "run.start.released_force",
                    f"holds no static shape: {held.reason}",
                    "let it push towards a snubber, or support the structure",
                )
            )
        q = held.q
    elif isinstance(start, ModeStart):
        q = _mode_start(parts, start.mode, start.amplitude)
    elif isinstance(start, PolynomialStart):
        q = _given_field(parts, start.displacement, "displacement", warnings)
        v = _given_field(parts, start.velocity, "velocity", warnings)
    return np.concatenate([q, v])


def _mode_start(parts: _Parts, mode: int, amplitude: float) -> Floats:
    """Open mode `mode` (numbered from 1, rigid-body modes included) with its largest deflection equal to amplitude."""
    if mode > parts.basis.modes:
        raise ScenarioError(
            Problem(
                "run.start.mode",
                f"= {mode} is not among the {parts.basis.modes} modes of the model",
                "choose a lower mode, or raise reduction.modes or beam.elements",
            )
        )
    vector = parts.basis.vectors[:, mode - 1]
    mesh = parts.model.mesh
    if mesh is None:
        largest = float(np.abs(vector).max())
    else:
        field = np.zeros(2 * mesh.nodes.size)
        field[parts.model.free] = vector
        largest = largest_deflection(mesh, field)
    q = np.zeros(parts.basis.size)
    q[mode - 1] = amplitude / largest * np.sqrt(parts.model.mass_scale)
    return q


def _given_field(parts: _Parts, numbers: tuple[float, ...], name: str, warnings: list[str]) -> Floats:
    """Coordinates of a polynomial in x (beam) or of one number a mass (chain)."""
    if not any(numbers):
        return np.zeros(parts.basis.size)
    beam = parts.scenario.beam
    if beam is None:
        q, error = project_field(parts.model, parts.basis, np.asarray(numbers, dtype=float))
    else:
        masses = [(m.position, m.mass) for m in beam.point_masses]
        q, kinetic, bending = project_polynomial(parts.model, parts.basis, numbers, beam.length, masses)
        # A velocity has kinetic energy only; a displacement's error matters in the strain energy too.
        error = max(kinetic, bending) if name == "displacement" else kinetic
    if error > _PROJECTION_TOLERANCE:
        warnings.append(
            f"run.start.{name} is met by the reduced model to a relative error of {error:.2g} only: "
            "it breaks the supports' conditions or needs more modes (reduction: {modes: all})"
        )
    return q
