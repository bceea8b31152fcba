"""Builds the system of a scenario."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from beamsim.contacts.contacts import Contacts
from beamsim.contacts.equilibrium import CubicSprings, Equilibrium, Springs, find_equilibrium
from beamsim.contacts.snubbers import (
    FRICTION,
    SpringInfo,
    build_contacts,
    cubic_springs,
    describe_springs,
    pressed_by,
    resists,
    resolve_preloads,
    spring_contacts,
    springs_of,
)
from beamsim.errors import NotTrustedError, Problem, ScenarioError, prefix_problems
from beamsim.inputs.drift import CorrectionSize
from beamsim.inputs.excitation import BaseMotion, base_motion, level_signal
from beamsim.inputs.signal import Signal
from beamsim.inputs.statements import InputAccount
from beamsim.scenario import Scenario
from beamsim.scenario.base import Path, path_text, problem, walk
from beamsim.scenario.body import LocatedItem, SupportMounting
from beamsim.scenario.connections import SHOCK_ARRESTOR
from beamsim.scenario.excitation import SingleExcitation, has_level_steps, sine_problems
from beamsim.scenario.parameters import replace_values
from beamsim.scenario.quantities import power_of
from beamsim.scenario.run import BodiesStart, ModeStart, OrbitStart, PolynomialStart, ReleasedForceStart
from beamsim.structures.assembly import load_site_in
from beamsim.structures.mechanisms import check_mechanisms, floating_motions, immobile_problems, open_loops
from beamsim.structures.places import SLOPE, LoadSite, Place, Site
from beamsim.structures.reduction import places_needed
from beamsim.system.equations import Channel, Forcing, PiecewiseLinearSystem, SineLoads
from beamsim.system.force_tables import TableOfStop, force_tables
from beamsim.system.outputs import output_channels, output_sites, reaction_channels
from beamsim.system.reduced_model import (
    ReducedModel,
    SharedBuilds,
    build_reduced_model,
    check_places,
    force_sites,
    gravity_loads,
)
from beamsim.system.structural import ProbeRow, SnubberInfo, StructuralSystem
from beamsim.typing import Floats, Ints


def _start_on_supports(model: ReducedModel, forcing: Forcing) -> Floats:
    """(2 n,) displacement and velocity of the structure at t = 0 due to moving supports, from static shapes.

    The initial state is relative to this motion, as it is to a moving base.
    """
    start = np.zeros(2 * model.basis.size)
    number = model.acting_loads.signals
    for moved in model.moving_supports:
        velocity, displacement = (forcing.signal[number[moved.path, of]] for of in ("velocity", "displacement"))
        shape = moved.static_shape(model.structure, model.basis)
        start += np.concatenate([shape * float(displacement(0.0)), shape * float(velocity(0.0))])
    return start


def sine_loads(model: ReducedModel, forcing: Forcing) -> SineLoads | None:
    """Amplitudes of the loads relative to the sine of a harmonic excitation; None for other excitations."""
    excitation = model.scenario.excitation
    if excitation.kind == "none" or any(sine_problems(excitation, "sweep")) or forcing.influence is not None:
        return None
    several = excitation.kind == "forces"
    forces = [force for _, force in model.acting_loads.forces]
    terms: list[tuple[complex, int]] = [(_phasor(force) if several else 1.0, 0) for force in forces]
    for moved in model.moving_supports:
        amplitude = _phasor(moved.excitation) if several else complex(1.0)
        power = power_of(moved.excitation.quantity) if several else 0
        terms += [(amplitude, power), (amplitude, power - 1), (amplitude, power - 2)]
    base = [(_phasor(each), power_of(each.quantity)) if several else (1.0, 0) for _, each in model.acting_loads.base]
    terms += base
    if len(forcing.signal) > len(terms):  # also the displacements of the base
        terms += [(amplitude, power - 2) for amplitude, power in base]
    amplitudes, powers = zip(*terms, strict=True)
    return SineLoads(np.array(amplitudes, dtype=complex), np.array(powers, dtype=np.int64))


def _phasor(sine: Any) -> complex:
    """Complex amplitude of a harmonic force, relative to a sine of unit amplitude."""
    return complex(sine.level * np.exp(1j * sine.phase))


class TimeDependent(NamedTuple):
    """The time-dependent parts of the equations."""

    base: tuple[BaseMotion, ...]  # (K,)
    forcing: Forcing
    accounts: list[tuple[str, InputAccount]]  # description of every input, with its path


_FILE_KEYS = {
    "matched": ("srs", "file"),
    "random": ("psd", "file"),
}  # by kind of input; else ``file``


def time_dependent_loads(model: ReducedModel, static_loads: _StaticLoads) -> TimeDependent:
    """The motion of the base and the time-dependent loads.

    The loads are: one for each force, three for each moving support, one for each stop that moves by itself (without
    load), the accelerations of the base, then its displacements if something on the ground follows them.
    """
    accounts = list[tuple[str, InputAccount]]()
    loads = [
        (model.shape(force.applied_to), _signal_of(model, path, force, level_signal, accounts).signal)
        for path, force in model.acting_loads.forces
    ]
    if model.moving_supports or model.acting_loads.stops:
        loads += _loads_of_moving_supports(model, accounts)
    base = [_signal_of(model, *moving, base_motion, accounts) for moving in model.acting_loads.base]
    of_base, displacements = [model.base_load(motion) for motion in model.base], tuple[int, ...]()
    loads += [(-inertia, moved.acceleration) for (inertia, _), moved in zip(of_base, base, strict=True)]
    cubic = static_loads.cubic
    followed = static_loads.contacts.on_ground.any() or (cubic and cubic.base_influence.any())
    # springs to the ground extend with the base's displacements
    if base and (followed or np.any([ground for _, ground in of_base])):
        displacements = tuple(range(len(loads), len(loads) + len(base)))
        loads += [(ground, moved.displacement) for (_, ground), moved in zip(of_base, base, strict=True)]
    load = np.array([vector for vector, _ in loads]).reshape(len(loads), model.basis.size)
    mountings = (getattr(snubber, "mounted_on", None) for snubber in model.scenario.all_snubbers)
    moved_mountings = model.acting_loads.stops or any(isinstance(on, SupportMounting) for on in mountings)
    influence = _influence_of_mountings(model, static_loads, len(loads)) if moved_mountings else None
    forcing = Forcing(load, tuple(signal for _, signal in loads), displacements, influence)
    return TimeDependent(tuple(base), forcing, accounts)


def _signal_of(
    model: ReducedModel, path: Path, excitation: SingleExcitation, build_signal: Callable[..., Any], accounts: list[Any]
) -> Any:
    """Build the signal of one excitation at a path, and append its description to ``accounts``."""
    scenario = model.scenario
    duration = None if scenario.run is None else scenario.run.duration
    section = path[: path.index("columns")] if "columns" in path else path  # one file has several columns
    folder = scenario.folder_of(*section, *_FILE_KEYS.get(excitation.kind, ("file",)))
    with prefix_problems("excitation", path_text(path)):
        key = (excitation, duration, folder)
        made: Any = model.builds.once("signal", key, lambda: build_signal(excitation, duration, folder))
    accounts.append((path_text(path), made.account))
    return made


def _loads_of_moving_supports(model: ReducedModel, accounts: list[Any]) -> list[tuple[Floats, Signal]]:
    """Loads of moving supports (by acceleration, velocity and displacement) and of stops that move by themselves."""
    loads: list[tuple[Floats, Signal]] = []
    for moved in model.moving_supports:
        support = _signal_of(model, moved.path, moved.excitation, base_motion, accounts)
        signals = (support.acceleration, support.velocity, support.displacement)
        loads += zip(moved.loads(model.structure, model.basis, model.damping), signals, strict=True)
    for path, driven in model.acting_loads.stops:
        loads.append((np.zeros(model.basis.size), _signal_of(model, path, driven, base_motion, accounts).displacement))
    return loads


def _influence_of_mountings(model: ReducedModel, static_loads: _StaticLoads, signals: int) -> Floats | None:
    """(m, L) displacement of each contact point relative to its mounting for a unit of each signal; None if zero."""
    influence = model.influence(signals)
    if not influence.any():
        return None
    return np.vstack([influence, np.zeros((len(model.spring_sites), signals))])[static_loads.owner]


def build_system(
    scenario: Scenario, builds: SharedBuilds | None = None, *, with_stations: bool = True
) -> StructuralSystem:
    """Assemble, reduce and resolve a scenario.

    Parameters
    ----------
    scenario : a valid scenario.
    builds : cache of parts built for other scenarios with the same structure, reduction or excitation.
    with_stations : whether to compute deflections and stresses along the bodies; without them there are no stations.

    Returns
    -------
    StructuralSystem
        In mass-normalised coordinates relative to the base; see its fields.

    Raises
    ------
    ScenarioError
        If a preload or the initial state needs a static equilibrium that does not exist or is not unique, or a mode
        that the reduction omits.
    """
    with scenario.locating():
        try:
            return _build(*_model_with_contacts(scenario, builds=builds), with_stations)
        except (ArithmeticError, np.linalg.LinAlgError) as error:
            raise ScenarioError(_out_of_range(scenario, error)) from None


def _out_of_range(scenario: Scenario, error: Exception) -> Problem:
    """The problem of numbers of too different sizes; located at the number furthest from 1."""
    sizes: dict[Path, float] = {
        (*path, name): abs(math.log10(abs(value)))
        for path, part in walk(scenario)
        for name, attribute in type(part).keys().items()
        if isinstance(value := part.__dict__.get(attribute), float) and value != 0.0
    }
    path = max(sizes, key=lambda place: sizes[place], default=())
    return problem(
        path,
        f"is too large or too small compared with the other numbers: the equations cannot be solved ({error})",
        "check its unit",
    )


@dataclass(frozen=True)
class SystemFamily:
    """The system of a scenario, and variants with other values for a snubber, all in the same coordinates."""

    model: ReducedModel
    system: StructuralSystem

    def at(self, path: Path, value: float) -> StructuralSystem:
        """The system with another value for a snubber.

        Parameters
        ----------
        path : path of the gap, stiffness or position of a snubber.
        value : new value, SI.
        """
        model = self._model_with(path, value)
        return _build(model, _build_static_loads(model))

    def contacts_at(self, path: Path, value: float) -> Contacts:
        """Only the contacts of `at`, for systems without preloads."""
        return _build_static_loads(self._model_with(path, value)).contacts

    def rates_along(self, place: Place) -> tuple[Floats, Floats]:
        """Derivatives with respect to the position of a place on its body, per m.

        Returns
        -------
        tuple
            (n,) derivative of the deflection for a unit of each coordinate, 1/(sqrt(kg) m), and (K,) of the motion for
            a unit of each motion of the base.
        """
        turned = replace(place, direction=SLOPE)
        return self.model.shapes([turned])[0], self.model.base_participations([turned])[0]

    def _model_with(self, path: Path, value: float) -> ReducedModel:
        return replace(self.model, scenario=replace_values(self.model.scenario, {path: value}))


def build_family(scenario: Scenario, ends: tuple[Place, Place] | None = None) -> SystemFamily:
    """Build the system in coordinates that are valid for a range of values of a snubber.

    Parameters
    ----------
    scenario : a valid scenario.
    ends : two places on a body between which a snubber may act. Static vectors are added until the reduced model has
        the compliance of the full model everywhere between them.

    Raises
    ------
    ScenarioError
        As `build_system`.
    """
    with scenario.locating():
        added = [] if ends is None else [*ends]
        model, pushing = _model_with_contacts(scenario, added)
        while ends is not None and (more := places_needed(model.structure, model.basis, *ends, added)):
            added += more
            model, pushing = _model_with_contacts(scenario, added)
        return SystemFamily(model, _build(model, pushing))


# Contact stiffness times the compliance of the omitted modes at the contact, for a beam with twice the modes that move
# with the contact (theory, section 7).
_STIFFNESS_BEYOND_MODES = 0.04
# If modes up to twice the frequency reduce this product less, it comes from local deformation, not from modes.
_LEAST_FALL = 0.7


def _model_with_contacts(
    scenario: Scenario, extra_places: Sequence[Place] = (), builds: SharedBuilds | None = None
) -> tuple[ReducedModel, _StaticLoads]:
    """The reduced model and its contacts; by default with more modes as long as the contacts need them."""
    model = build_reduced_model(scenario, extra_places, builds)
    pushing, before = _build_static_loads(model), math.inf
    found = model, pushing
    while model.default_reduction:
        static = slice(model.basis.modes, model.basis.size)
        compliance = np.sum((pushing.contacts.shape[:, static] / model.omega[static]) ** 2, axis=1)
        stiffness = np.nan_to_num(pushing.contacts.quasi_static[0], posinf=0.0)  # not for rigid friction
        beyond = float(np.max(stiffness * compliance, initial=0.0))
        if beyond > _LEAST_FALL * before:
            break
        found, before = (model, pushing), beyond
        if beyond <= _STIFFNESS_BEYOND_MODES:
            break
        model = build_reduced_model(scenario, extra_places, model.builds, 2.0 * model.highest_hz)
        pushing = _build_static_loads(model)
    return found


def _build(model: ReducedModel, static_loads: _StaticLoads, with_stations: bool = True) -> StructuralSystem:
    scenario = model.scenario
    if model.moving_supports:
        _check_places_on_supports(model)
    free = _check_couplings(model, static_loads) if model.structure.couplings else []
    forces = [force.force * model.shape(force) for force in scenario.constant_forces]
    weights = [value * model.base_load(direction)[0] for direction, value in gravity_loads(scenario)]
    loads = np.array(forces + weights).reshape(-1, model.basis.size)  # N/sqrt(kg)
    contacts, equilibrium, initial, warnings = _statics(model, static_loads, loads)
    base, forcing, accounts = time_dependent_loads(model, static_loads)
    if model.moving_supports:
        initial += _start_on_supports(model, forcing)
    if contacts.internal_states:
        initial = np.append(initial, _relaxed_states(contacts, forcing, initial[: model.basis.size]))
    sizes = [CorrectionSize.of(motion.corrections) for motion in base if motion.corrections is not None]
    correction = max(sizes, key=lambda size: size.share, default=None)
    if correction is not None:
        stepped = any(has_level_steps(each) for _, each in scenario.excitation.items)
        warnings += correction.warnings(stepped_levels=stepped)
    sites = [*model.snubber_sites, *force_sites(scenario), *(output_sites(model) if scenario.requested_outputs else ())]
    recoveries = model.recoveries(sites) if with_stations else ()
    asked = (model, recoveries, static_loads.sites, contacts, forcing)
    outputs = output_channels(*asked) if with_stations and scenario.requested_outputs else ()
    dynamics = PiecewiseLinearSystem(model.stiffness, model.damping, contacts, loads.sum(axis=0))
    return StructuralSystem(
        model=model, as_built=dynamics, dynamics=dynamics, forcing=forcing, initial_state=initial,
        probes=_describe_probes(model), base=base,
        snubbers=_describe_snubbers(model, contacts, equilibrium, static_loads.tables), bodies=recoveries,
        stops=static_loads.stops, static_equilibrium=equilibrium.q, static_forces=equilibrium.force,
        static_reason=equilibrium.reason, excitation_frequency_hz=scenario.excitation.tone_hz,
        cubic=static_loads.cubic, springs=static_loads.springs, outputs=outputs,
        files=tuple(each for member in model.structure.members if (each := member.body.file_summary) is not None),
        remarks=(
            *(f"{member.body.name}: {note}" for member in model.structure.members for note in member.body.notes),
            *free, *warnings,
            *(f"{at}.force_deflection: {table.remark}" for at, table in static_loads.tables.items() if table.remark),
            *(f"{path}: {text}" for path, account in accounts for text in account.warnings),
        ),
        inputs=tuple(replace(a.statement, path=path) for path, a in accounts if a.statement is not None),
        base_correction=correction, sine=sine_loads(model, forcing),
    )  # fmt: skip


def static_shape_of(system: StructuralSystem) -> Floats:
    """(n,) coordinates of the static equilibrium of a system.

    Raises
    ------
    ScenarioError
        With the reason if there is none, or if it is not unique.
    """
    found = Equilibrium(system.static_equilibrium, system.static_forces, system.static_reason)
    return _static_shape(system.model, found, "", "there is no single static equilibrium", _HOLD)


def support_channels(system: StructuralSystem) -> list[tuple[Channel, bool]]:
    """The forces and moments of all supports of a system, each with whether the motion determines it."""
    sites = _build_static_loads(system.model).sites
    return reaction_channels(system.model, sites, system.dynamics.contacts, system.forcing)


def _statics(
    model: ReducedModel, static_loads: _StaticLoads, loads: Floats
) -> tuple[Contacts, Equilibrium, Floats, list[str]]:
    """Contacts with gaps from preloads, their equilibrium under constant loads (L, n), and the state at t = 0.

    The state (2 n,) comes with warnings, and without the effect of moving supports and internal states of contacts.
    """
    snubbers, cubic = model.scenario.located_snubbers, static_loads.cubic
    contacts = static_loads.contacts
    resting = np.array([law.resting_force for law in contacts.laws])  # in addition to the static springs
    loads = np.vstack([loads, (contacts.sign * resting) @ contacts.shape])
    if any(located.item.preload is not None for located in snubbers):
        contacts = resolve_preloads(contacts, snubbers, model.stiffness, model.basis.rigid_count, loads, cubic)
    equilibrium = _equilibrium(model, contacts, loads, cubic)
    first, mounted = equilibrium, _with_initial_branches(contacts)
    if mounted is not contacts:
        first = _equilibrium(model, mounted, loads, cubic)
    return contacts, equilibrium, *initial_state(model, mounted, loads, cubic, first)


def _with_initial_branches(contacts: Contacts) -> Contacts:
    """The contacts at the start of a motion, with branches that have not relaxed; the same if all have relaxed."""
    if all(law.as_installed is None for law in contacts.laws):
        return contacts
    return replace(contacts, laws=tuple(law.as_installed or law for law in contacts.laws))


@dataclass(frozen=True)
class _StaticLoads:
    """Contacts and springs that act on a structure in addition to loads."""

    tables: Mapping[str, TableOfStop]  # by path, for snubbers with a force-deflection curve
    stops: Contacts  # the snubbers
    springs: tuple[SpringInfo, ...]
    cubic: CubicSprings | None
    contacts: Contacts  # snubbers, then springs with laws
    owner: Ints  # (m,) index of the snubber or nonlinear spring of each contact
    sites: list[Site]  # (m,) places of the contacts


def _build_static_loads(model: ReducedModel) -> _StaticLoads:
    nonlinear, basis, snubbers = model.scenario.nonlinear_springs, model.basis, model.scenario.located_snubbers
    tables = force_tables(model.scenario) if model.scenario.has_force_tables else {}
    curves = [tables[at].curve if (at := path_text(each.path)) in tables else None for each in snubbers]
    of_stops = model.shapes(model.snubber_sites), model.base_participations(model.snubber_sites)
    stops = build_contacts(snubbers, curves, *of_stops, model.omega, basis.rigid_count)
    if not nonlinear:
        return _StaticLoads(tables, stops, (), None, stops, np.arange(stops.count), model.snubber_sites)
    return _build_static_loads_with_springs(model, tables, stops)


def _build_static_loads_with_springs(
    model: ReducedModel, tables: Mapping[str, TableOfStop], stops: Contacts
) -> _StaticLoads:
    """Stops, nonlinear springs, joints with relaxation, and friction."""
    nonlinear, basis, snubbers = model.scenario.nonlinear_springs, model.basis, model.scenario.located_snubbers
    springs = describe_springs(
        nonlinear, model.shapes(model.spring_sites), model.base_participations(model.spring_sites)
    )
    pressing = pressed_by(nonlinear, [snubber.name for snubber in model.scenario.all_snubbers])
    contacts = replace(stops.first_with_others(spring_contacts(springs, basis.size)), pressed_by=pressing)
    if any(model.scenario.listed("friction")):
        _check_rigid_friction(model, springs, stops)
    cubic = cubic_springs(springs)
    with_laws = [site for site, spring in zip(model.spring_sites, springs, strict=True) if spring.law is not None]
    sites: list[Site] = [*model.snubber_sites, *with_laws]
    owner = np.arange(len(sites))
    if cubic is not None:  # time stepping for cubic springs supports only one-sided springs
        _refuse_memory(snubbers, stops, nonlinear)
        owner = contacts.owners_of_springs[0]
        sites = [sites[j] for j in owner]
        contacts = contacts.split()
    return _StaticLoads(tables, stops, springs, cubic, contacts, owner, sites)


def _check_couplings(model: ReducedModel, static_loads: _StaticLoads) -> list[str]:
    """Warnings about unclosed loops of joints, and about motions that only contacts stop.

    Raises
    ------
    ScenarioError
        If nothing stops a motion, or something acts at an immobile place.
    """
    problems = immobile_problems(model.structure, _load_sites(model))
    if problems:
        raise ScenarioError(problems)
    stopping = np.vstack([static_loads.stops.shape, *(spring.shape for spring in static_loads.springs)])
    joints = [joint.name for joint in model.scenario.joints]
    free = check_mechanisms(joints, model.structure, model.basis, stopping)
    return [*open_loops(model.scenario, model.structure), *free]


def _check_places_on_supports(model: ReducedModel) -> None:
    """Refuse contacts and probes at places that move with a support."""
    probes = [(("probes", k), site) for k, site in enumerate(model.probe_sites)]
    check_places(model.moving_supports, [*((located.path, site) for located, site in _located_sites(model)), *probes])


def _relaxed_states(contacts: Contacts, forcing: Forcing, q: Floats) -> Floats:
    """(r,) internal states of contacts at the start: after a long rest, or as installed."""
    apart = contacts.shape @ q
    if (moved := forcing.base_at(np.zeros(1))) is not None:
        apart += contacts.base_influence @ moved[0]
    if forcing.influence is not None:
        apart += forcing.influence @ [float(signal(0.0)) for signal in forcing.signal]
    return _with_initial_branches(contacts).relaxed_states(-contacts.gap - contacts.sign * apart)


def _located_sites(model: ReducedModel) -> list[tuple[LocatedItem, Site]]:
    """Snubbers and nonlinear springs with their places."""
    located = (*model.scenario.located_snubbers, *model.scenario.nonlinear_springs)
    return list(zip(located, (*model.snubber_sites, *model.spring_sites), strict=True))


def _load_sites(model: ReducedModel) -> list[tuple[Path, LoadSite, str]]:
    """Snubbers, nonlinear springs and forces of the excitation: path, place and name of each."""
    forces = model.acting_loads.forces
    return [
        *((located.path, site, f"{located.item.name}") for located, site in _located_sites(model)),
        *(((*path, "applied_to"), load_site_in(model.scenario, force.applied_to), "a force") for path, force in forces),
    ]


def _check_rigid_friction(model: ReducedModel, springs: Sequence[SpringInfo], stops: Contacts) -> None:
    """Refuse rigid friction together with relaxing or sticking contacts, and under a moving base."""
    laws = [(spring.name, spring.law) for spring in springs if spring.law is not None]
    laws += zip((stop.name for stop in model.scenario.all_snubbers), stops.laws, strict=True)
    coupled = [name for name, law in laws if law.arrays.coupled.any()]
    problems = []
    for path, _, contact, _ in model.scenario.nonlinear_springs:
        if contact.kind != FRICTION or contact.stiffness is not None:
            continue
        if coupled:
            why = f"is missing, and {', '.join(coupled)} relaxes or sticks with its own spring"
            problems.append(problem((*path, "stiffness"), why, "give the contact a tangential stiffness"))
        if getattr(contact, "mounted_on", "base") == "ground" and model.base:
            why = "is missing, and the base moves while the contact sticks to the ground"
            remedy = "give the contact a tangential stiffness, or mount it on the base"
            problems.append(problem((*path, "stiffness"), why, remedy))
    if problems:
        raise ScenarioError(problems)


def _describe_probes(model: ReducedModel) -> tuple[ProbeRow, ...]:
    sites = model.probe_sites
    of_probes = model.scenario.effective_probes, sites, model.shapes(sites), model.base_participations(sites)
    return tuple(
        ProbeRow(probe.name, site.coordinate, site.position_y, shape, lever)
        for probe, site, shape, lever in zip(*of_probes, strict=True)
    )


def _equilibrium(model: ReducedModel, contacts: Contacts, loads: Floats, cubic: CubicSprings | None) -> Equilibrium:
    """The static equilibrium; an error is raised only if the motion starts from it."""
    springs = springs_of(contacts)
    if not (model.basis.rigid_count or loads.any() or np.any(springs.gap < 0.0) or np.any(springs.stiffness < 0.0)):
        return Equilibrium(np.zeros(model.basis.size), np.zeros(contacts.count))  # the structure is undeformed
    return _compute_equilibrium(model, contacts, springs, loads, cubic)


def _compute_equilibrium(
    model: ReducedModel, contacts: Contacts, springs: Springs, loads: Floats, cubic: CubicSprings | None
) -> Equilibrium:
    """Compute the static equilibrium; see `_equilibrium`."""
    try:
        found = find_equilibrium(model.stiffness, model.basis.rigid_count, springs, loads, cubic)
        return replace(found, force=springs.contact_forces(found.force, contacts.sign))
    except NotTrustedError as error:
        if model.scenario.run is not None and model.scenario.run.start == "static_equilibrium":
            raise
        return Equilibrium(None, np.full(contacts.count, np.nan), str(error))


def _refuse_memory(snubbers: Sequence[LocatedItem], stops: Contacts, springs: Sequence[LocatedItem]) -> None:
    """Raise ScenarioError if contacts are more than one-sided springs."""
    linear = "give the snubber a stiffness alone, or make the springs piecewise_linear"
    refused = [
        (f".{snubber.memory or ('law' if snubber.limits_dashpot else 'force_deflection')}", path, linear)
        for (path, _, snubber, _), law in zip(snubbers, stops.laws, strict=True)
        if law.rebuild is None
    ]
    for path, _, spring, _ in springs:
        if getattr(spring, "maxwell", ()):
            refused.append((".maxwell", path, "leave one of the two out"))
        if spring.kind in (FRICTION, SHOCK_ARRESTOR):
            refused.append(("", path, "make the springs piecewise_linear"))
    if refused:
        message = "cannot be combined with cubic springs"
        raise ScenarioError([Problem(path_text(path) + key, message, remedy) for key, path, remedy in refused])


def _describe_snubbers(
    model: ReducedModel, contacts: Contacts, equilibrium: Equilibrium, tables: Mapping[str, TableOfStop]
) -> tuple[SnubberInfo, ...]:
    described = []
    located = model.scenario.located_snubbers
    for i, (site, (path, _, s, _)) in enumerate(zip(model.snubber_sites, located, strict=True)):
        table = tables.get(path_text(path))
        unit = model.structure.unit_stiffness(site)
        stiffness = contacts.laws[i].stiffness
        described.append(
            SnubberInfo(
                gap_unit=s.units[0], name=s.name, position=site.coordinate, position_y=site.position_y, side=resists(s),
                stiffness=stiffness, dashpot=contacts.laws[i].dashpot, gap=float(contacts.gap[i]),
                preload=float(equilibrium.force[i]),
                blocked_force=float(contacts.laws[i].static_force(np.maximum(-contacts.gap[i], 0.0))),
                table_misfit=None if table is None else table.misfit,
                stiffness_ratio=stiffness / unit if unit > 0 else float("inf"), shape=contacts.shape[i],
            )
        )  # fmt: skip
    return tuple(described)


_HOLD = "hold the structure with a support, a preload or a load towards a snubber"


def initial_state(
    model: ReducedModel, contacts: Contacts, loads: Floats, cubic: CubicSprings | None, equilibrium: Equilibrium
) -> tuple[Floats, list[str]]:
    """The initial state of a motion.

    Parameters
    ----------
    model : reduced model of the scenario.
    contacts, cubic : contacts and cubic springs of the system.
    loads : (L, n) constant loads.
    equilibrium : static equilibrium under these loads, or the reason why there is none.

    Returns
    -------
    (2 n,) q and q' at t = 0, relative to the base; and warnings.

    Raises
    ------
    ScenarioError
        If the initial state needs a static shape that does not exist, or a mode that the reduction omits.
    """
    start = None if model.scenario.run is None else model.scenario.run.start
    if start != "static_equilibrium":
        return _other_start(model, start, contacts, loads, cubic, equilibrium)
    q = _static_shape(
        model, equilibrium, "run.start", "= static_equilibrium does not exist", f"start from rest, or {_HOLD}"
    )
    return np.concatenate([q, np.zeros(q.size)]), []


def _other_start(
    model: ReducedModel,
    start: Any,
    contacts: Contacts,
    loads: Floats,
    cubic: CubicSprings | None,
    equilibrium: Equilibrium,
) -> tuple[Floats, list[str]]:
    """An initial state other than the static equilibrium; see `initial_state`."""
    warnings: list[str] = []
    q = v = np.zeros(model.basis.size)
    if start is None:
        q = q if equilibrium.q is None else equilibrium.q
    elif isinstance(start, ReleasedForceStart):
        q = _release_shape(model, start, contacts, loads, cubic)
    elif not isinstance(start, str):  # start at rest
        q, v = _moving_start(model, start, warnings)
    return np.concatenate([q, v]), warnings


def _moving_start(
    model: ReducedModel, start: ModeStart | PolynomialStart | BodiesStart | OrbitStart, warnings: list[str]
) -> tuple[Floats, Floats]:
    """q and q', (n,) each, of a start in a mode, with given fields, or on an orbit; warnings are appended."""
    if isinstance(start, OrbitStart):
        remedy = "leave run.start out, or `beamsim run`"
        raise ScenarioError(Problem("run.start.orbit", "starts a run, and no other command", remedy))
    if isinstance(start, ModeStart):
        return _mode_shape(model, start.mode, start.amplitude), np.zeros(model.basis.size)
    given = {model.scenario.default_body: start} if isinstance(start, PolynomialStart) else start.bodies
    displacement, velocity = (_start_field(model, given, name, warnings) for name in ("displacement", "velocity"))
    return displacement, velocity


def _release_shape(
    model: ReducedModel, start: ReleasedForceStart, contacts: Contacts, loads: Floats, cubic: CubicSprings | None
) -> Floats:
    """(n,) static equilibrium under the constant loads (L, n) and the force that is then released."""
    extra = (start.released_force.force * model.shape(start.released_force))[None, :]
    held = find_equilibrium(
        model.stiffness, model.basis.rigid_count, springs_of(contacts), np.vstack([loads, extra]), cubic
    )
    remedy = "let it push towards a snubber, or support the structure"
    return _static_shape(model, held, "run.start.released_force", "holds no static shape", remedy)


def _static_shape(model: ReducedModel, equilibrium: Equilibrium, path: str, problem: str, remedy: str) -> Floats:
    """(n,) coordinates of an equilibrium; ScenarioError with the reason, and the floating bodies, if there is none."""
    if equilibrium.q is None:
        floats = f" ({floating_motions(model.structure, model.basis)})" if model.basis.rigid_count else ""
        raise ScenarioError(Problem(path, f"{problem}: {equilibrium.reason}{floats}", remedy))
    return equilibrium.q


def _mode_shape(model: ReducedModel, mode: int, amplitude: float) -> Floats:
    """Mode number `mode` of the open structure (from 1, with rigid-body modes), scaled to a largest deflection."""
    if mode > model.basis.modes:
        raise ScenarioError(
            Problem(
                "run.start.mode",
                f"= {mode} is not among the {model.basis.modes} modes of the model",
                "choose a lower mode, or raise reduction.modes or beam.elements",
            )
        )
    largest = model.structure.largest_deflection(model.basis.vectors[:, mode - 1])
    q = np.zeros(model.basis.size)
    q[mode - 1] = amplitude / largest * np.sqrt(model.structure.mass_scale)
    return q


def _start_field(
    model: ReducedModel, fields: Mapping[str, PolynomialStart], quantity: str, warnings: list[str]
) -> Floats:
    """Coordinates of a start given by body: a polynomial in x along a beam, one number for each mass of a chain."""
    numbers = {name: getattr(start, quantity) for name, start in fields.items()}
    field, errors = model.structure.project(model.basis, numbers, quantity)
    for name, error in errors.items():
        if error > 1e-6:
            where = f"bodies.{name}.{quantity}" if len(model.structure.members) > 1 else quantity
            warnings.append(
                f"run.start.{where} has a relative error of {error:.2g} in the reduced model: "
                "it violates the conditions of the supports, or needs more modes (reduction: {modes: all})"
            )
    return field
