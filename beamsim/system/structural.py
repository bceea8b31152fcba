r"""The system that every analysis uses, as `build_system` makes it: channels, natural modes and damping.

Natural frequencies are undamped, with every contact in a given phase. The damping ratios are those of the damped
motion,

.. math:: \zeta = -\mathrm{Re}\,\lambda / |\lambda|,

with :math:`\lambda` the eigenvalues of the first-order equations, in which dashpots couple the undamped modes and
Maxwell branches have their own states. Each undamped mode is assigned the eigenvalue with the largest modal overlap.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from beamsim.contacts.contacts import Contacts
from beamsim.contacts.equilibrium import CubicSprings
from beamsim.contacts.laws import PENETRATION, RATE
from beamsim.contacts.sliders import drops
from beamsim.contacts.snubbers import FRICTION, SpringInfo
from beamsim.inputs.drift import CorrectionSize
from beamsim.inputs.excitation import BaseMotion
from beamsim.inputs.statements import InputStatement
from beamsim.labelled import Dataset, Layout, Variable
from beamsim.outcomes import first_of
from beamsim.scenario import Scenario
from beamsim.scenario.base import Path, count_text
from beamsim.scenario.body import LocatedItem
from beamsim.scenario.reporting import SWEPT_KINDS
from beamsim.scenario.scenario import UsualSizes
from beamsim.structures.modes import closed_modes
from beamsim.structures.named_matrices import FileSummary
from beamsim.structures.places import Place, Recovery, Stations, StressRows, stress_rows
from beamsim.structures.reduction import receptance_bound
from beamsim.structures.structure import ReducedBasis, Structure
from beamsim.system.equations import (
    Channel,
    ChannelSet,
    Equations,
    Forcing,
    PiecewiseLinearSystem,
    SineLoads,
    Sizes,
    StateEquations,
)
from beamsim.system.reduced_model import ReducedModel, force_sites, gravity_loads
from beamsim.typing import Floats, Ints

if TYPE_CHECKING:
    from beamsim.system.rings import RingInfo

DISTINCT_RATIO_FACTOR = 1.3  # factor between damping ratios that count as different
DAMPING_ROUND_OFF = 1e-14  # damping between two modes relative to the largest of a mode; a smaller value is round-off
RELAXED_FREQUENCY = 1e-6  # rad/s, frequency at which Maxwell branches have relaxed
LIGHT_MASS_FACTOR = 10.0  # times the modes; a value that needs even more modes to converge has no practical limit


@dataclass(frozen=True)
class ProbeRow:
    """A recorded place: deflection = shape @ q, relative to the base."""

    name: str
    position: float  # m along the beam, x on a plate; the mass number for a chain
    position_y: float | None  # m, y on a plate
    shape: Floats  # (n,) deflection for a unit of each coordinate, 1/sqrt(kg)
    base_influence: Floats  # (K,) absolute motion for a unit of each motion of the base


FORCE_UNITS = {"m": "N", "rad": "N m"}  # by unit of the corresponding motion


def contact_units(gap_unit: str) -> dict[str, str]:
    """Units of the quantities of a contact, by the names used in declarations."""
    return {"gap_unit": gap_unit, "force_unit": FORCE_UNITS[gap_unit]}


@dataclass(frozen=True, kw_only=True)
class ContactUnits:
    """Units of the quantities of a contact; stops and friction of a hinge have angles and moments."""

    gap_unit: str = "m"  # in a hinge rad

    @property
    def force_unit(self) -> str:
        """N, or N m."""
        return FORCE_UNITS[self.gap_unit]


@dataclass(frozen=True)
class SnubberNumbers(ContactUnits):
    """The resolved numbers of a snubber; for a hinge stop moments and angles."""

    name: str
    position: float  # m along the body; the number of the mass in a chain, halfway between two masses
    side: str  # below or above; between two masses approach or separation
    stiffness: float  # N/m; for a force-deflection curve its first slope
    dashpot: float  # N s/m
    gap: float  # m, positive when open; resolved if a preload is given
    preload: float  # N, contact force at static equilibrium; NaN if there is none
    blocked_force: float  # N at a penetration of max(-gap, 0), with the structure fixed at zero displacement
    stiffness_ratio: float  # k L^3 / (E I); in a chain, over its largest spring stiffness


@dataclass(frozen=True)
class SnubberInfo(SnubberNumbers):
    """One snubber of a model."""

    shape: Floats  # (n,) deflection for a unit of each coordinate, 1/sqrt(kg)
    position_y: float | None = None  # m, y on a plate
    table_misfit: float | None = None  # N, root mean square residual of a fitted force-deflection curve


class JumpingForce(NamedTuple):
    """A force that may jump, at a point of a structure."""

    cause: str  # text for messages
    shape: Floats  # (n,) deflection of the point for a unit of each coordinate, 1/sqrt(kg)
    inverse_mass: float  # 1/kg, sum of the squared shapes of all modes: infinite without a point mass
    contact: int = -1  # index of the contact, for a contact force
    signal: int = -1  # index of the signal, for a force of the excitation

    @property
    def light(self) -> bool:
        """True if the mass at the point is so small that the modes of the model do not represent it."""
        return self.inverse_mass > LIGHT_MASS_FACTOR * float(self.shape @ self.shape)


_MODE, _BODY, _STATION, _SNUBBER = ("mode",), ("body",), ("station",), ("snubber",)
MODES = Layout(
    "modes",
    "Natural frequencies, damping and mode shapes of the reduced model, and how accurate that is.",
    {
        "mode": Variable(_MODE, "1", "mode number", int),
        "open_frequencies_hz": Variable(_MODE, "Hz", "natural frequencies with every contact open"),
        # piecewise-linear springs with their slope at rest
        "closed_frequencies_hz": Variable(_MODE, "Hz", "natural frequencies with every contact closed"),
        "damping_ratios": Variable(
            _MODE, "1", "modal damping ratios of the open structure; NaN for rigid-body modes"
        ),
        "closed_damping_ratios": Variable(
            _MODE, "1", "modal damping ratios with every contact closed, its dashpot and Maxwell branches included"
        ),
        # none without equilibrium, or with sticking, pressed or softening contacts
        "resting_frequencies_hz": Variable(
            _MODE, "Hz",
            "natural frequencies with every contact as it is at static equilibrium, friction included", optional=True,
        ),
        "resting_damping_ratios": Variable(_MODE, "1", "modal damping ratios at static equilibrium", optional=True),
        "kept_modes": Variable((), "1", "number of modes kept by the reduction", int),
        "coordinates": Variable(
            (), "1", "number of coordinates of a structure without a mesh of its own, imported or of masses", int,
            optional=True,
        ),
        "static_vectors": Variable((), "1", "number of static vectors kept by the reduction", int),
        "highest_frequency_hz": Variable((), "Hz", "the highest frequency that the reduction was made for"),
        "reduction_bound": Variable(  # see docs/theory.md
            (), "1",
            "bound of the error of the receptance at contacts and loads, up to highest_frequency_hz and at the "
            "frequencies of the excitation, over the static compliance there, or over the receptance where that is "
            "larger; NaN where it is not known",
        ),
        "probe_bound": Variable(
            (), "1", "bound of the error of the receptance between contacts, loads and probes, likewise", optional=True
        ),
        "snubber": Variable(_SNUBBER, "1", "name of the snubber", str),
        "dashpot": Variable(_SNUBBER, "{force_unit} s/{gap_unit}", "damping constant of the snubber"),
        "dashpot_from": Variable(_SNUBBER, "", "what the damping constant follows from", str),
        "body": Variable(_BODY, "1", "name of the body", str),
        "body_axis": Variable(_BODY, "", "what the position is on the body", str),
        "kinetic_energy_share": Variable(
            _BODY + _MODE, "1", "share of a mode's kinetic energy in this body; of several bodies", optional=True
        ),
        "strain_energy_share": Variable(
            _BODY + _MODE, "1", "share of a mode's strain energy in this body, the rest being in springs of joints; "
            "NaN for rigid-body modes; of several bodies", optional=True,
        ),
        "station": Variable(_STATION, "1", "number of the station", int),
        "station_body": Variable(_STATION, "1", "number of the body, from 0", int, names="modes/body"),
        "position": Variable(_STATION, "{position_unit}", "{position}"),
        "position_y": Variable(
            _STATION, "m", "position on the plate from its bottom edge; NaN on other bodies", optional=True
        ),
        "direction": Variable(("direction",), "1", "coordinate of the place", str),
        "points": Variable(
            (*_STATION, "direction"), "m",
            "place of the nodes of imported bodies, NaN where they have none; NaN on other bodies",
        ),
        "drawn_line": Variable(("drawn_line",), "1", "number of the line", int),
        "end": Variable(("end",), "1", "end of the line", int),
        "lines": Variable(
            ("drawn_line", "end"), "1",
            "stations, from 0, between which lines are drawn: their nodes belong to one element", int,
        ),
        "shapes": Variable(
            _MODE + _STATION, "kg^-0.5", "mode shapes of the open structure, unit modal mass"
        ),
        "shapes_in_space": Variable(
            (*_MODE, *_STATION, "direction"), "kg^-0.5",
            "mode shapes along x, y and z of frames, and of imported bodies whose nodes have coordinates, unit modal "
            "mass; NaN on other bodies", optional=True,
        ),
    },
)  # fmt: skip


@dataclass(eq=False)
class StructuralSystem:
    """The equations of a scenario, with the data needed to interpret their solution.

    Coordinates q are mass-normalised (M = I) and relative to the base; the absolute deflection adds the motion of the
    base.
    """

    model: ReducedModel  # the reduced structure
    as_built: PiecewiseLinearSystem  # ``dynamics`` of the scenario; an analysis may omit damping or loads
    dynamics: PiecewiseLinearSystem
    forcing: Forcing
    initial_state: Floats  # (N,) q, q', then the internal states of the contacts
    probes: tuple[ProbeRow, ...]
    base: tuple[BaseMotion, ...]  # (K,) motions of the base; none where it is at rest
    snubbers: tuple[SnubberInfo, ...]
    bodies: tuple[Recovery, ...]  # quantities recovered along each body
    stops: Contacts  # the snubbers alone
    static_equilibrium: Floats | None  # (n,) base at d = 0; None if there is none, or it is not unique
    static_forces: Floats  # (m,) N, of the contacts at static equilibrium; NaN if there is none
    static_reason: str  # why there is no static equilibrium; empty if there is one
    excitation_frequency_hz: float  # nan if there is none, or several
    cubic: CubicSprings | None
    springs: tuple[SpringInfo, ...] = ()  # nonlinear ones; their laws follow the snubbers in ``dynamics.contacts``
    outputs: tuple[Channel, ...] = ()  # outputs of the scenario
    remarks: tuple[str, ...] = ()  # remarks from building the system
    files: tuple[FileSummary, ...] = ()  # data about files of imported bodies
    inputs: tuple[InputStatement, ...] = ()  # records and random inputs
    base_correction: CorrectionSize | None = None  # for a base that follows a swept sine
    sine: SineLoads | None = None  # loads relative to a sine; None for other excitations

    # derived fields
    scenario: Scenario = field(init=False)  # the scenario of the system
    base_influence: Floats = field(init=False)  # (probes, K) absolute motion for a unit of each motion of the base
    kept_modes: int = field(init=False)  # number of modes in the reduced model
    open_frequencies_hz: Floats = field(init=False)  # (n,) natural frequencies with every contact open
    stations: Stations = field(init=False)  # points with known mode shapes
    deflection: Floats = field(init=False)  # (nx, n) at the stations for a unit of each coordinate, 1/sqrt(kg)
    stress: StressRows | None = field(init=False)  # bending stress along the bodies; None if no body has one

    def __post_init__(self) -> None:
        none = np.zeros((0, self.model.basis.size))
        self.scenario, self.kept_modes = self.model.scenario, self.model.basis.modes
        influences = [probe.base_influence for probe in self.probes]
        self.base_influence = np.array(influences).reshape(len(influences), len(self.base))
        self.open_frequencies_hz = self.model.omega / (2 * np.pi)
        self.stations = Stations.of_recoveries(self.bodies)
        self.deflection = np.vstack([none, *(body.deflection for body in self.bodies)])
        self.stress = stress_rows(self.bodies)

    @cached_property
    def modes(self) -> Dataset:
        """Natural frequencies, damping and accuracy, as a dataset of results; computed on first use."""
        at_rest = self.static_equilibrium if self.cubic is None else None
        return modes_of(self.model, self.as_built, self.stops, at_rest, self.stations, self.deflection)

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """Remarks, and warnings from `modes`."""
        return (*self.remarks, *model_warnings(self.scenario, self.modes), *self.scenario.questions(_usual_sizes(self)))

    @cached_property
    def closed_frequencies_hz(self) -> Floats:
        """(n,) natural frequencies with every snubber closed."""
        phases = np.array([law.closed_phase for law in self.stops.laws], dtype=np.int64)
        stopped = replace(self.as_built, contacts=self.stops)
        return undamped_modes(stopped, phases, self.model.basis.rigid_count)[0] / (2 * np.pi)

    @cached_property
    def jumping_forces(self) -> tuple[JumpingForce, ...]:
        """Forces of dashpots, dry friction and the excitation that may jump at points with little mass."""
        return tuple(force for force in self.forces_that_jump if force.light)

    @cached_property
    def forces_that_jump(self) -> tuple[JumpingForce, ...]:
        """Forces of dashpots, dry friction and the excitation that may jump, at any mass."""
        scenario = self.scenario
        found = [
            JumpingForce(
                f"the force of the dashpot of {snubber.name}", snubber.shape, scenario.inverse_mass(located), contact=j
            )
            for j, (snubber, located) in enumerate(zip(self.snubbers, scenario.located_snubbers, strict=True))
            if snubber.dashpot > 0.0
        ]
        if self.springs:
            found += self._jumping_friction()
        if self.model.acting_loads.forces:
            found += self._jumping_loads()
        return tuple(found)

    def _jumping_friction(self) -> Iterator[JumpingForce]:
        contacts, listed = self.dynamics.contacts, self.scenario.listed("friction")
        springs = [spring for spring in self.springs if spring.kind == FRICTION]
        for j, spring, located in zip(self.friction_contacts.tolist(), springs, listed, strict=True):
            if drops(contacts.laws[j]) or contacts.laws[j].needs_normal_contact:
                cause, inverse_mass = f"the friction force of {spring.name}", self.scenario.inverse_mass(located)
                yield JumpingForce(cause, contacts.shape[j], inverse_mass, contact=j)

    def _jumping_loads(self) -> Iterator[JumpingForce]:
        scenario, acting = self.scenario, self.model.acting_loads
        for path, force in acting.forces:
            if getattr(force.applied_to, "places", ()):
                number = acting.signals[path, "force"]
                where = LocatedItem(path, scenario.default_body, force.applied_to, scenario.all_bodies)
                cause, inverse_mass = "the force of the excitation", scenario.inverse_mass(where)
                yield JumpingForce(cause, self.forcing.load[number], inverse_mass, signal=number)

    def with_supports(self, places: Sequence[Place], times: Floats) -> Floats:
        """(nt, places) contribution of moving supports to the deflection of places, m; it is not in the coordinates."""
        motion = np.zeros((times.size, len(places)))
        for each in self.model.moving_supports:
            displacement = self.forcing.signal[self.model.acting_loads.signals[each.path, "displacement"]]
            motion += np.outer(displacement(times), [each.support.direct(place) for place in places])
        return motion

    @cached_property
    def channels(self) -> ChannelSet:
        """All observables of the system.

        They are: for probes displacement and velocity relative to the base, and absolute acceleration; for snubbers
        force, penetration, distance to the face, and displacement and velocity of the structure there; for nonlinear
        springs and friction contacts extension and force; the outputs of the scenario; and the bending stress along the
        bodies.
        """
        cubic = 0 if self.cubic is None else self.cubic.count
        sizes = Sizes(self.dynamics.size, self.dynamics.contacts.count, len(self.forcing.signal), cubic)
        channels = [*_of_probes(self, sizes), *_of_snubbers(self, sizes)]
        if self.springs:
            channels += _of_springs(self, sizes)
            channels += [channel for ring in self.rings for channel in ring.channels(sizes, self.model)]
        channels += self.outputs
        if (stress := self.stress) is not None:
            by_base = stress.base.reshape(stress.row.shape[0], -1)[:, : len(self.base)]
            by_base = self.model.of_base("acceleration", by_base, sizes.signals)
            rows = sizes.rows(stress.row.shape[0], displacement=stress.row, load=by_base)
            channels.append(Channel("bodies", "", "bending_stress", "Pa", rows))
        return ChannelSet(tuple(channels), sizes)

    @cached_property
    def rings(self) -> tuple[RingInfo, ...]:
        """The rings, whose sides are contacts."""
        from beamsim.system.rings import rings_of

        return rings_of(self.springs, len(self.snubbers))

    @property
    def contact_names(self) -> tuple[str, ...]:
        """(m,) name of the snubber or piecewise-linear spring of each contact."""
        split = self.cubic is not None
        laws = [(spring.name, spring.law.one_sided_springs or ()) for spring in self.springs if spring.law is not None]
        names = [name for name, parts in laws for _ in range(len(parts) if split else 1)]
        return (*(snubber.name for snubber in self.snubbers), *names)

    @property
    def friction_contacts(self) -> Ints:
        """(f,) indices of the friction contacts among all contacts, in the order of the scenario."""
        of_springs = [spring.kind for spring in self.springs if spring.law is not None]
        return len(self.snubbers) + np.flatnonzero(np.array(of_springs) == FRICTION)


def _of_probes(system: StructuralSystem, sizes: Sizes) -> list[Channel]:
    channels = []
    for probe in system.probes:
        by_base = system.model.of_base("acceleration", probe.base_influence[None], sizes.signals)
        acceleration = sizes.rows(1, acceleration=probe.shape, load=by_base)
        channels += [
            Channel("probes", probe.name, "displacement", "m", sizes.rows(1, displacement=probe.shape)),
            Channel("probes", probe.name, "velocity", "m/s", sizes.rows(1, velocity=probe.shape)),
            Channel("probes", probe.name, "absolute_acceleration", "m/s^2", acceleration),
        ]
    return channels


def _of_snubbers(system: StructuralSystem, sizes: Sizes) -> list[Channel]:
    contacts, influence, channels = system.dynamics.contacts, system.forcing.influence, []
    unit = np.eye(contacts.count)
    for j, snubber in enumerate(system.snubbers):
        sign, shape = contacts.sign[j], contacts.shape[j]
        moved = system.model.of_base("displacement", contacts.base_influence[j : j + 1], sizes.signals)
        moved += 0.0 if influence is None else influence[j]
        penetration = sizes.rows(1, displacement=-sign * shape, constant=-contacts.gap[j], load=-sign * moved)
        way, force = snubber.gap_unit, sizes.rows(1, contact=unit[j])
        holds = contacts.laws[j].latches
        channels += [
            Channel("snubbers", snubber.name, "force", snubber.force_unit, force, counts_pulling=holds),
            Channel("snubbers", snubber.name, "penetration", way, penetration),
            Channel("snubbers", snubber.name, "opening", way, sizes.rows(1, opening=unit[j])),
            Channel("snubbers", snubber.name, "displacement", way, sizes.rows(1, displacement=shape)),
            Channel("snubbers", snubber.name, "velocity", f"{way}/s", sizes.rows(1, velocity=shape)),
        ]
    return channels


def _of_springs(system: StructuralSystem, sizes: Sizes) -> list[Channel]:
    """Channels of nonlinear springs, whose contacts (one, or several one-sided springs) follow the snubbers."""
    channels, contact, pulling = [], len(system.snubbers), 0
    split = system.cubic is not None
    for spring in system.springs:
        of_contacts, pull = np.zeros(sizes.contacts), np.zeros(sizes.cubic)
        if spring.kind == "cubic":
            pull[pulling] = 1.0
            pulling += 1
        if spring.law is not None:
            for part in (spring.law.one_sided_springs if split else None) or (None,):
                of_contacts[contact] = 1.0 if part is None else part.direction
                contact += 1
        if spring.part is not None:
            continue
        moved = system.model.of_base("displacement", spring.base_influence[None], sizes.signals)
        force = sizes.rows(1, displacement=spring.linear * spring.shape, load=spring.linear * moved,
            contact=of_contacts, cubic=pull,
        )  # fmt: skip
        extension = sizes.rows(1, displacement=spring.shape, load=moved)
        channels += [
            Channel(spring.listed_as, spring.name, "extension", spring.gap_unit, extension),
            Channel(spring.listed_as, spring.name, "force", FORCE_UNITS[spring.gap_unit], force),
        ]
    return channels


def modes_of(
    model: ReducedModel, dynamics: PiecewiseLinearSystem, stops: Contacts, equilibrium: Floats | None,
    stations: Stations, deflection: Floats,
) -> Dataset:  # fmt: skip
    """Natural frequencies, damping and accuracy of a model, for results.

    Parameters
    ----------
    model : the reduced structure.
    dynamics : the structure with all its contacts.
    stops : contacts of snubbers, which are open or closed in the dataset.
    equilibrium : (n,) coordinates at rest; None if unknown, or if the motion around it is not linear.
    stations, deflection : points of the shapes, and (nx, n) deflection there for a unit of each coordinate.

    Returns
    -------
    Dataset
        With the layout `MODES`.
    """
    basis, structure, contacts = model.basis, model.structure, dynamics.contacts
    omega = [2 * np.pi * frequency for frequency in model.scenario.excitation.frequencies_hz]
    bound = receptance_bound(structure, basis, model.damping, _loads(model), structure.rows(model.probe_sites), omega)
    # the motion needs the arrays of all contacts too
    stopped = dynamics if contacts.count == stops.count else replace(dynamics, contacts=stops)
    opened = damped_modes(stopped, stops.start, basis.rigid_count)[1]
    of_stops = np.array([law.closed_phase for law in stops.laws], dtype=np.int64)
    closed, of_closed = damped_modes(stopped, of_stops, basis.rigid_count)
    resting, of_resting = None, None
    if equilibrium is not None and not contacts.jointly_acting:
        phases = contacts.resting_phases(-contacts.gap - contacts.sign * (contacts.shape @ equilibrium))
        if np.all(contacts.dynamic_stiffness(phases, np.full(1, RELAXED_FREQUENCY)).real >= 0.0):
            resting, of_resting = damped_modes(dynamics, phases, basis.rigid_count)
    values: dict[str, Any] = {
        "mode": 1 + np.arange(basis.size),
        "open_frequencies_hz": model.omega / (2 * np.pi),
        "closed_frequencies_hz": closed / (2 * np.pi),
        "damping_ratios": opened,
        "closed_damping_ratios": of_closed,
        "resting_frequencies_hz": None if resting is None else resting / (2 * np.pi),
        "resting_damping_ratios": of_resting,
        "kept_modes": basis.modes,
        "coordinates": None if model.scenario.has_mesh else structure.size,
        "static_vectors": basis.size - basis.modes,
        "highest_frequency_hz": model.highest_hz,
        "reduction_bound": bound.loads,
        "probe_bound": bound.probes,
        "shapes": deflection.T,
    }
    values |= stations.columns()
    snubbers = model.scenario.located_snubbers
    if snubbers:
        values |= _dashpots(snubbers, contacts)
    if len(structure.members) > 1:
        values |= _energy_shares(structure, basis)
    of_snubbers = [contact_units(each.item.units[0]) for each in snubbers]
    return MODES.dataset(values, {"snubber": of_snubbers}, **stations.position_words)


def _energy_shares(structure: Structure, basis: ReducedBasis) -> dict[str, Floats]:
    """(bodies, r) shares of kinetic and of strain energy of the coordinates."""
    kinetic, strain = [], []
    squared = np.where(basis.omega > 0, basis.omega, np.nan) ** 2
    for member in structure.members:
        fields = member.expansion @ basis.vectors
        moving = np.einsum("ij,ij->j", fields, member.body.mass @ fields)
        kinetic.append(moving * member.mass_ratio)
        bent = np.asarray(member.body.factor @ fields)
        strain.append(np.sum(bent**2, axis=0) * member.stiffness_ratio / squared)
    return {"kinetic_energy_share": np.array(kinetic), "strain_energy_share": np.array(strain)}


def _loads(model: ReducedModel) -> Floats:
    """(m, N) rows of contacts and forces, and inertia loads for base motion or gravity."""
    scenario, structure = model.scenario, model.structure
    rows = structure.rows([*model.snubber_sites, *model.spring_sites, *force_sites(scenario)])
    directions = dict.fromkeys((*model.base, *(direction for direction, _ in gravity_loads(scenario))))
    moved = [each.pattern(structure).vector for each in model.moving_supports]
    return np.vstack([rows, *moved, *(structure.base_load(direction)[0] for direction in directions)])


# Relative frequency change below which closed stops count as having no effect; no test shows less.
SMALLEST_EFFECT = 1e-3
_WITHOUT_EFFECT = "closed no natural frequency is more than 0.1 % higher: the stiffness has no effect"
_UNDAMPED = (
    "nothing is damped, so no motion becomes steady; give each body damping, for example {kind: modal, ratio: 1 %}"
)
FARTHEST_MODE = 100.0
"""Ratio of the first mode to the highest excitation frequency above which the case is probably wrong."""
DOUBTFUL_REDUCTION = 0.01  # error of the reduced receptance, relative to its size, above which there is a warning


def model_warnings(scenario: Scenario, modes: Dataset) -> list[str]:
    """Warnings from the modes of a model.

    They concern stops without effect, an excited structure without damping, an inaccurate reduced model, and damping
    ratios of snubbers.
    """
    opened, closed = modes["open_frequencies_hz"].values, modes["closed_frequencies_hz"].values
    stops, warnings, bound = scenario.all_snubbers, [], modes["reduction_bound"].item()
    stiff = [stop.name for stop in stops if stop.stiffness is not None]
    if stops and len(stiff) == len(stops) and np.all(closed - opened <= SMALLEST_EFFECT * opened):
        warnings.append(f"snubbers: with {first_of(stiff, 4)} {_WITHOUT_EFFECT}")
    # sources of damping: dashpots of any kind, friction, yielding stops
    loses = any(np.nan_to_num(modes[of].values).any() for of in ("damping_ratios", "closed_damping_ratios"))
    loses |= any(each.item.kind == FRICTION for each in scenario.nonlinear_springs) or any(s.yields for s in stops)
    if scenario.excitation.kind != "none" and scenario.nnm is None and not loses:
        warnings.append(_UNDAMPED)
    if bound > DOUBTFUL_REDUCTION:
        warnings.append(_inaccurate_reduction(scenario, modes))
    return [*warnings, *_far_modes(scenario, modes), *damping_remarks(scenario.located_snubbers, modes)]


def _usual_sizes(system: StructuralSystem) -> UsualSizes:
    """Reference sizes of usual ranges that the model determines."""
    elastic = system.open_frequencies_hz[system.open_frequencies_hz > 0.0]
    period = float(1.0 / elastic[0]) if elastic.size else None
    stiffness: dict[Path, float] = {}
    if elastic.size == system.open_frequencies_hz.size:
        compliance = np.sum((system.stops.shape / system.model.omega) ** 2, axis=1)
        located = system.scenario.located_snubbers
        stiffness = {at.path: 1.0 / c for at, c in zip(located, compliance.tolist(), strict=True) if c > 0.0}
    return {"period": lambda *_: period, "structure": lambda _, path: stiffness.get(path)}


def _far_modes(scenario: Scenario, modes: Dataset) -> list[str]:
    """A warning if the first mode is far above all excitation frequencies."""
    first = next((f for f in modes["open_frequencies_hz"].values.tolist() if f > 0.0), 0.0)
    if scenario.excitation.shock or (scenario.run is None and scenario.sweep is None):
        return []
    swept: Any = scenario.sweep
    ends = [swept.from_, swept.to] if swept is not None and swept.kind in SWEPT_KINDS else []
    highest = max([scenario.excitation.highest_frequency_hz, *ends])
    return [_far_mode(first, highest)] if first > FARTHEST_MODE * highest > 0.0 else []


def _far_mode(first: float, highest: float) -> str:
    """The warning for a first natural frequency far above the highest of the excitation, Hz."""
    return (
        f"the first natural frequency, {first:.4g} Hz with open contacts, is {first / highest:.3g} times the highest "
        f"frequency of the excitation, {highest:.4g} Hz; was another unit of a size, a modulus, a mass or a frequency "
        "meant?"
    )


def _inaccurate_reduction(scenario: Scenario, modes: Dataset) -> str:
    """A warning for a reduced model with a large error bound of its receptance."""
    return (
        f"the reduced model may not be accurate: up to {modes['highest_frequency_hz'].item():.4g} Hz and at the "
        "frequencies of the excitation the error of its receptance at contacts and loads is bounded by "
        f"{modes['reduction_bound'].item():.2g} of its size; "
        f"{scenario.more_modes(math.ceil(1.5 * modes['kept_modes'].item()))}"
    )


def _dashpots(snubbers: Sequence[LocatedItem], contacts: Contacts) -> dict[str, Any]:
    """Dashpot of each snubber, N s/m or N m s/rad, and damping of the modes; snubbers are the first contacts."""
    sources = []
    for at, law in zip(snubbers, contacts.laws, strict=False):
        snubber, number = at.item, len(at.item.maxwell)
        if snubber.damping is None:
            source = "none written"
        elif snubber.damping.kind == "viscous" or not law.dashpot:
            source = "as written"
        else:
            ratio = snubber.damping.ratio
            hz = ratio * law.stiffness / (np.pi * law.dashpot)
            source = f"{100 * ratio:.4g} % of {hz:.4g} Hz, the first natural frequency with it alone closed"
        branches = f", in parallel with {count_text(number, 'Maxwell branch', 'Maxwell branches')}" if number else ""
        sources.append(source + branches)
    dashpots = [law.dashpot for law in contacts.laws[: len(snubbers)]]
    return {"snubber": [each.item.name for each in snubbers], "dashpot": dashpots, "dashpot_from": sources}


def damping_remarks(snubbers: Sequence[LocatedItem], modes: Dataset) -> list[str]:
    """A warning if the damping of the first closed mode differs from the ratio that was given for another mode."""
    frequencies = modes["closed_frequencies_hz"].values
    closed = np.flatnonzero(frequencies > 0.0)
    if not closed.size:
        return []
    hz, ratio = frequencies[closed[0]], float(modes["closed_damping_ratios"].values[closed[0]])
    written = {s.name: s.damping.ratio for _, _, s, _ in snubbers if s.damping and s.damping.kind == "ratio"}
    low, high = ratio / DISTINCT_RATIO_FACTOR, ratio * DISTINCT_RATIO_FACTOR
    other = {name: x for name, x in written.items() if x > 0.0 and not low < x < high}
    return [_damped_otherwise(hz, ratio, other)] if other else []


def _damped_otherwise(frequency_hz: float, ratio: float, other_ratios: Mapping[str, float]) -> str:
    """The warning for the damping ratio of the first closed mode; ``other_ratios`` are those given, by snubber."""
    shares = ", ".join(dict.fromkeys(f"{100 * x:.4g}" for x in other_ratios.values()))
    return (
        f"snubbers: the first mode with all snubbers closed, {frequency_hz:.4g} Hz, has a damping ratio of "
        f"{100 * ratio:.3g} %, but {shares} % is given for {first_of(list(other_ratios), 4)}: a ratio sets the dashpot "
        "2 ratio k / Omega, where Omega is the first natural frequency with only that snubber closed; this mode has "
        "another frequency, or little strain energy in the snubber; to set its damping, give the dashpot in N s/m"
    )


def undamped_modes(dynamics: PiecewiseLinearSystem, phases: Ints, rigid_count: int) -> tuple[Floats, Floats, Floats]:
    """Undamped natural frequencies (n,), rad/s, and modes (n, n), with contacts in given phases.

    The third array is the stiffness (m,) of the contacts, N/m, with relaxed Maxwell branches.

    Parameters
    ----------
    dynamics, phases, rigid_count : as for `damped_modes`.
    """
    slow = np.asarray(dynamics.contacts.dynamic_stiffness(phases, np.full(1, RELAXED_FREQUENCY))[0].real)
    return *closed_modes(np.sqrt(dynamics.stiffness), dynamics.contacts.shape, slow, rigid_count), slow


def _one_for_each(share: Floats) -> tuple[Ints, Ints]:
    """Assign each mode (row) a column with the largest total overlap."""
    from scipy.optimize import linear_sum_assignment  # importing it takes as long as a validation

    modes, of = linear_sum_assignment(share, maximize=True)
    return modes, of


def damped_modes(dynamics: PiecewiseLinearSystem, phases: Ints, rigid_count: int) -> tuple[Floats, Floats]:
    """Natural frequencies and damping ratios, with contacts in given phases.

    Parameters
    ----------
    dynamics : the structure and its contacts, without rigid sticking or normal contacts.
    phases : (m,) phases of the contacts.
    rigid_count : number of rigid-body coordinates.

    Returns
    -------
    (n,), (n,)
        rad/s, ascending, undamped; and the ratios, nan for rigid-body modes. A mode that does not oscillate has the
        ratio of its own coordinate alone, which is 1 or more for a single mass.
    """
    contacts, n = dynamics.contacts, dynamics.size
    omega, shapes, slow = undamped_modes(dynamics, phases, rigid_count)
    equations = StateEquations(Equations(dynamics), phases)
    force, by_states = equations.factors, equations.internal_factors
    depth = -contacts.sign[:, None] * (contacts.shape @ shapes)
    damping = shapes.T @ dynamics.damping @ shapes + (depth.T * force[:, RATE]) @ depth
    ratio = np.divide(np.diag(damping), 2.0 * omega, out=np.full(n, np.nan), where=omega > 0.0)
    coupling = np.abs(damping - np.diag(np.diag(damping))).max(initial=0.0)
    if not by_states.any() and coupling <= DAMPING_ROUND_OFF * np.abs(damping).max(initial=0.0):
        return omega, ratio

    scale = np.maximum(omega, 1e-3 * omega.max() or 1.0)  # scale of displacements; a rigid mode has none
    states, drive = equations.internal_rates[:, equations.equations.internal], equations.internal_rate_factors
    own = depth[contacts.state_owner]
    beyond = (depth.T * (force[:, PENETRATION] - slow)) @ depth  # from branches that have not relaxed
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
    if np.unique(modes).size < modes.size:  # for two modes with the same largest overlap
        modes, of = _one_for_each(share)
    ratio[modes] = 0.0 - values[of].real / np.abs(values[of])  # 0, not -0
    ratio[omega == 0.0] = np.nan
    return omega, ratio
