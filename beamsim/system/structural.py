r"""The one structure that every analysis moves, as `build_system` makes it: its channels, natural modes and damping.

Natural frequencies are those without damping, with every contact in a given phase. The damping ratios are those of the
damped motion,

.. math:: \zeta = -\mathrm{Re}\,\lambda / |\lambda|,

with :math:`\lambda` the eigenvalues of the first-order equations, in which dashpots couple the undamped modes and
Maxwell branches have states of their own. Each undamped mode has the eigenvalue whose motion is most its own.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from beamsim.contacts.contacts import Contacts
from beamsim.contacts.equilibrium import CubicSprings
from beamsim.contacts.laws import PENETRATION, RATE
from beamsim.contacts.sliders import drops
from beamsim.contacts.snubbers import FRICTION, SpringInfo
from beamsim.inputs.drift import CorrectionSize
from beamsim.inputs.signal import Signal
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
from beamsim.system.reduced_model import ReducedModel, base_direction, force_sites, gravity_loads
from beamsim.typing import Floats, Ints

DISTINCT_RATIO_FACTOR = 1.3  # factor between damping ratios that count as different
DAMPING_ROUND_OFF = 1e-14  # damping between two modes, over the largest of a mode, that is round-off
RELAXED_FREQUENCY = 1e-6  # rad/s, at which Maxwell branches have relaxed
LIGHT_MASS_FACTOR = 10.0  # times the modes: a value that only more of them bring to its limit has none in practice


@dataclass(frozen=True)
class ProbeRow:
    """A place whose motion is recorded: deflection = shape @ q, relative to the base."""

    name: str
    position: float  # m along the beam, x on a plate; the mass number for a chain
    across: float | None  # m, y on a plate
    shape: Floats  # (n,) deflection for a unit of each coordinate, 1/sqrt(kg)
    base_influence: float = 1.0  # absolute motion for a unit motion of the base


FORCE_UNITS = {"m": "N", "rad": "N m"}  # by the unit of the motion that they act on


def contact_units(gap_unit: str) -> dict[str, str]:
    """Units of what a contact measures, by the words of its declarations."""
    return {"gap_unit": gap_unit, "force_unit": FORCE_UNITS[gap_unit]}


@dataclass(frozen=True, kw_only=True)
class ContactUnits:
    """The units of what a contact measures; those of a hinge's stops and friction are of angles and moments."""

    gap_unit: str = "m"  # in a hinge rad

    @property
    def force_unit(self) -> str:
        """N, or N m."""
        return FORCE_UNITS[self.gap_unit]


@dataclass(frozen=True)
class SnubberNumbers(ContactUnits):
    """The numbers that describe a snubber, all resolved; in a hinge those of moments and angles."""

    name: str
    position: float  # m along the body; the number of the mass in a chain, halfway between two masses
    side: str  # below or above; between two masses approach or separation
    stiffness: float  # N/m; of a force-deflection table its first slope
    dashpot: float  # N s/m
    gap: float  # m, positive when open; resolved where a preload was given
    preload: float  # N, contact force at static equilibrium; NaN where there is none
    blocked_force: float  # N at a penetration of max(-gap, 0), the structure held at zero displacement
    stiffness_ratio: float  # k L^3 / (E I); in a chain, over its largest spring stiffness


@dataclass(frozen=True)
class SnubberInfo(SnubberNumbers):
    """One snubber of a model."""

    shape: Floats  # (n,) deflection for a unit of each coordinate, 1/sqrt(kg)
    across: float | None = None  # m, y on a plate
    table_misfit: float | None = None  # N, root mean square of what a table leaves of the measured forces


class JumpingForce(NamedTuple):
    """A force that may jump at a point of a structure."""

    cause: str  # for people
    shape: Floats  # (n,) deflection of the point for a unit of each coordinate, 1/sqrt(kg)
    inverse_mass: float  # 1/kg, sum of the squared shapes of all modes: infinite where there is no point mass
    contact: int = -1  # its number, of the force of a contact
    signal: int = -1  # number of the signal, of a force of the excitation

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
        # piecewise-linear springs as at rest
        "closed_frequencies_hz": Variable(_MODE, "Hz", "natural frequencies with every contact closed"),
        "damping_ratios": Variable(
            _MODE, "1", "modal damping ratios of the open structure; NaN for rigid-body modes"
        ),
        "closed_damping_ratios": Variable(
            _MODE, "1", "modal damping ratios with every contact closed, its dashpot and Maxwell branches included"
        ),
        # none where there is no equilibrium, or where contacts hold, are pressed by others, or soften next to it
        "resting_frequencies_hz": Variable(
            _MODE, "Hz",
            "natural frequencies with every contact as it is at static equilibrium, friction included", optional=True,
        ),
        "resting_damping_ratios": Variable(_MODE, "1", "modal damping ratios there", optional=True),
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
            (), "1", "the same of the receptance between these and the probes", optional=True
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
        "across": Variable(
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
    },
)  # fmt: skip


@dataclass(eq=False)
class StructuralSystem:
    """A scenario turned into mathematics, with what is needed to turn the solution back.

    Coordinates q are mass-normalised (M = I) and relative to the base: absolute = relative + what the base carries,
    which is 1 on every deflection where it moves upwards.
    """

    model: ReducedModel  # the reduced structure
    as_built: PiecewiseLinearSystem  # ``dynamics`` of the scenario, of which an analysis may leave out damping or loads
    dynamics: PiecewiseLinearSystem
    forcing: Forcing
    initial_state: Floats  # (N,) q, q', then the internal states of the contacts
    probes: tuple[ProbeRow, ...]
    base_acceleration: Signal | None  # m/s^2; None where the base is at rest
    base_velocity: Signal | None  # m/s
    base_displacement: Signal | None  # m
    snubbers: tuple[SnubberInfo, ...]
    bodies: tuple[Recovery, ...]  # what is known along each body
    stops: Contacts  # the snubbers alone
    static_equilibrium: Floats | None  # (n,) base at d = 0; None where there is none, or more than one
    static_reason: str  # why there is no static equilibrium; empty where there is one
    excitation_frequency_hz: float  # nan where there is none, or several
    cubic: CubicSprings | None
    springs: tuple[SpringInfo, ...] = ()  # nonlinear ones; their laws follow the snubbers in ``dynamics.contacts``
    outputs: tuple[Channel, ...] = ()  # that the scenario asks for
    remarks: tuple[str, ...] = ()  # on what was built
    files: tuple[FileSummary, ...] = ()  # of the bodies that are read from files
    inputs: tuple[InputStatement, ...] = ()  # records and random inputs
    base_correction: CorrectionSize | None = None  # of a base that follows a swept sine
    sine: SineLoads | None = None  # how the loads follow a sine; None where the excitation is none

    # what follows from these
    scenario: Scenario = field(init=False)  # that it was built from
    base_influence: Floats = field(init=False)  # (probes,) absolute motion of each for one of the base; zeros at rest
    kept_modes: int = field(init=False)  # number of modes that the reduction keeps
    open_frequencies_hz: Floats = field(init=False)  # (n,) natural frequencies with every contact open
    stations: Stations = field(init=False)  # where shapes are known
    deflection: Floats = field(init=False)  # (nx, n) there for a unit of each coordinate, 1/sqrt(kg)
    stress: StressRows | None = field(init=False)  # bending stress along the bodies; None where no body gives one

    def __post_init__(self) -> None:
        moving, none = self.base_acceleration is not None, np.zeros((0, self.model.basis.size))
        self.scenario, self.kept_modes = self.model.scenario, self.model.basis.modes
        self.base_influence = np.array([probe.base_influence if moving else 0.0 for probe in self.probes])
        self.open_frequencies_hz = self.model.omega / (2 * np.pi)
        self.stations = Stations.of_recoveries(self.bodies)
        self.deflection = np.vstack([none, *(body.deflection for body in self.bodies)])
        self.stress = stress_rows(self.bodies)

    @cached_property
    def modes(self) -> Dataset:
        """Natural frequencies, damping and accuracy, a dataset of results: they take longer than the rest."""
        at_rest = self.static_equilibrium if self.cubic is None else None
        return modes_of(self.model, self.as_built, self.stops, at_rest, self.stations, self.deflection)

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """Remarks, and warnings that follow from `modes`."""
        return (*self.remarks, *model_warnings(self.scenario, self.modes), *self.scenario.questions(_usual_sizes(self)))

    @cached_property
    def closed_frequencies_hz(self) -> Floats:
        """(n,) natural frequencies with every snubber closed."""
        phases = np.array([law.closed_phase for law in self.stops.laws], dtype=np.int64)
        stopped = replace(self.as_built, contacts=self.stops)
        return undamped_modes(stopped, phases, self.model.basis.rigid)[0] / (2 * np.pi)

    @cached_property
    def jumping_forces(self) -> tuple[JumpingForce, ...]:
        """Forces of dashpots, dry friction and the excitation that may jump where there is little mass."""
        return tuple(force for force in self.forces_that_jump if force.light)

    @cached_property
    def forces_that_jump(self) -> tuple[JumpingForce, ...]:
        """Forces of dashpots, dry friction and the excitation that may jump, whatever mass there is."""
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
        """(nt, places) m, what supports that move add to the deflection of places: no coordinate has it."""
        motion = np.zeros((times.size, len(places)))
        for each in self.model.moving_supports:
            displacement = self.forcing.signal[self.model.acting_loads.signals[each.path, "displacement"]]
            motion += np.outer(displacement(times), [each.support.direct(place) for place in places])
        return motion

    @cached_property
    def channels(self) -> ChannelSet:
        """Everything that can be observed.

        Of probes the displacement and velocity relative to the base, and the absolute acceleration; of snubbers force,
        penetration, distance to the face, and displacement and velocity of the structure there; of springs with laws of
        their own and of friction contacts extension and force; the outputs that the scenario asks for; and the bending
        stress along the bodies.
        """
        cubic = 0 if self.cubic is None else self.cubic.count
        sizes = Sizes(self.dynamics.size, self.dynamics.contacts.count, len(self.forcing.signal), cubic)
        channels = [*_of_probes(self, sizes), *_of_snubbers(self, sizes)]
        if self.springs:
            channels += _of_springs(self, sizes)
        channels += self.outputs
        if (stress := self.stress) is not None:
            rows = sizes.rows(stress.row.shape[0], displacement=stress.row, base_acceleration=stress.base)
            channels.append(Channel("bodies", "", "bending_stress", "Pa", rows))
        return ChannelSet(tuple(channels), sizes)

    @property
    def contact_names(self) -> tuple[str, ...]:
        """(m,) owner of each contact: a snubber's name, or that of a piecewise-linear spring."""
        split = self.cubic is not None
        laws = [(spring.name, spring.law.one_sided_springs or ()) for spring in self.springs if spring.law is not None]
        names = [name for name, parts in laws for _ in range(len(parts) if split else 1)]
        return (*(snubber.name for snubber in self.snubbers), *names)

    @property
    def friction_contacts(self) -> Ints:
        """(f,) numbers of the friction contacts among all contacts, in the order of the scenario."""
        of_springs = [spring.kind for spring in self.springs if spring.law is not None]
        return len(self.snubbers) + np.flatnonzero(np.array(of_springs) == FRICTION)


def _of_probes(system: StructuralSystem, sizes: Sizes) -> list[Channel]:
    channels = []
    for probe, base_influence in zip(system.probes, system.base_influence, strict=True):
        acceleration = sizes.rows(1, acceleration=probe.shape, base_acceleration=base_influence)
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
        penetration = sizes.rows(1, displacement=-sign * shape, constant=-contacts.gap[j],
            base_displacement=-sign * contacts.base_influence[j],
            load=0.0 if influence is None else -sign * influence[j],
        )  # fmt: skip
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
    """Those of springs with laws of their own, whose contacts follow the snubbers: one, or one for each part."""
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
        force = sizes.rows(1, displacement=spring.linear * spring.shape,
            base_displacement=spring.linear * spring.base_influence, contact=of_contacts, cubic=pull,
        )  # fmt: skip
        extension = sizes.rows(1, displacement=spring.shape, base_displacement=spring.base_influence)
        section = "friction" if spring.kind == "friction" else "springs"
        channels += [
            Channel(section, spring.name, "extension", spring.gap_unit, extension),
            Channel(section, spring.name, "force", FORCE_UNITS[spring.gap_unit], force),
        ]
    return channels


def modes_of(
    model: ReducedModel, dynamics: PiecewiseLinearSystem, stops: Contacts, equilibrium: Floats | None,
    stations: Stations, deflection: Floats,
) -> Dataset:  # fmt: skip
    """What a result says of its model: natural frequencies, damping and accuracy.

    Parameters
    ----------
    model : the reduced structure.
    dynamics : the structure and all its contacts.
    stops : those that are snubbers, which alone are open and closed.
    equilibrium : (n,) coordinates at rest; None where that is not known, or not linear.
    stations, deflection : where shapes are known, and (nx, n) deflection there for a unit of each coordinate.

    Returns
    -------
    Dataset
        Of the layout `MODES`.
    """
    basis, structure, contacts = model.basis, model.structure, dynamics.contacts
    omega = [2 * np.pi * frequency for frequency in model.scenario.excitation.frequencies_hz]
    bound = receptance_bound(structure, basis, model.damping, _loads(model), structure.rows(model.probe_sites), omega)
    # the arrays of all contacts are those that the motion needs, too
    stopped = dynamics if contacts.count == stops.count else replace(dynamics, contacts=stops)
    opened = damped_modes(stopped, stops.start, basis.rigid)[1]
    of_stops = np.array([law.closed_phase for law in stops.laws], dtype=np.int64)
    closed, of_closed = damped_modes(stopped, of_stops, basis.rigid)
    resting, of_resting = None, None
    if equilibrium is not None and not contacts.jointly_acting:
        phases = contacts.resting_phases(-contacts.gap - contacts.sign * (contacts.shape @ equilibrium))
        if np.all(contacts.dynamic_stiffness(phases, np.full(1, RELAXED_FREQUENCY)).real >= 0.0):
            resting, of_resting = damped_modes(dynamics, phases, basis.rigid)
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
    """(m, N) rows of contacts and forces, and inertia loads where the base moves or gravity acts."""
    scenario, structure = model.scenario, model.structure
    rows = structure.rows([*model.snubber_sites, *model.spring_sites, *force_sites(scenario)])
    moving = base_direction(scenario)
    directions = dict.fromkeys(direction for direction, _ in gravity_loads(scenario))
    if moving is not None:
        directions = {moving: None} | directions
    moved = [each.pattern(structure).vector for each in model.moving_supports]
    return np.vstack([rows, *moved, *(structure.base_load(direction)[0] for direction in directions)])


# Relative change of every natural frequency, below which closed stops count as without effect: no test shows less.
SMALLEST_EFFECT = 1e-3
_WITHOUT_EFFECT = "closed no natural frequency is more than 0.1 % higher: the stiffness has no effect"
_UNDAMPED = (
    "nothing is damped, so no motion becomes steady; give each body damping, for example {kind: modal, ratio: 1 %}"
)
FARTHEST_MODE = 100.0
"""Frequency of the first mode, over the highest of the excitation, above which the case is probably another one."""
DOUBTFUL_REDUCTION = 0.01  # error of the reduced receptance, over its size, of which a warning tells


def model_warnings(scenario: Scenario, modes: Dataset) -> list[str]:
    """Warnings that follow from the modes.

    They are of stops without effect, of an excited structure without damping, of an inaccurate reduced model and of
    damping ratios of snubbers.
    """
    opened, closed = modes["open_frequencies_hz"].values, modes["closed_frequencies_hz"].values
    stops, warnings, bound = scenario.all_snubbers, [], modes["reduction_bound"].item()
    stiff = [stop.name for stop in stops if stop.stiffness is not None]
    if stops and len(stiff) == len(stops) and np.all(closed - opened <= SMALLEST_EFFECT * opened):
        warnings.append(f"snubbers: with {first_of(stiff, 4)} {_WITHOUT_EFFECT}")
    # what takes energy out of a motion: dashpots of any kind, friction, stops that yield
    loses = any(np.nan_to_num(modes[of].values).any() for of in ("damping_ratios", "closed_damping_ratios"))
    loses |= any(each.item.kind == FRICTION for each in scenario.nonlinear_springs) or any(s.yields for s in stops)
    if scenario.excitation.kind != "none" and scenario.nnm is None and not loses:
        warnings.append(_UNDAMPED)
    if bound > DOUBTFUL_REDUCTION:
        warnings.append(_inaccurate_reduction(scenario, modes))
    return [*warnings, *_far_modes(scenario, modes), *damping_remarks(scenario.located_snubbers, modes)]


def _usual_sizes(system: StructuralSystem) -> UsualSizes:
    """What usual ranges of numbers are multiplied by, as far as the model decides it."""
    elastic = system.open_frequencies_hz[system.open_frequencies_hz > 0.0]
    period = float(1.0 / elastic[0]) if elastic.size else None
    stiffness: dict[Path, float] = {}
    if elastic.size == system.open_frequencies_hz.size:
        compliance = np.sum((system.stops.shape / system.model.omega) ** 2, axis=1)
        located = system.scenario.located_snubbers
        stiffness = {at.path: 1.0 / c for at, c in zip(located, compliance.tolist(), strict=True) if c > 0.0}
    return {"period": lambda *_: period, "structure": lambda _, path: stiffness.get(path)}


def _far_modes(scenario: Scenario, modes: Dataset) -> list[str]:
    """That the first mode lies far beyond what goes on at known frequencies."""
    first = next((f for f in modes["open_frequencies_hz"].values.tolist() if f > 0.0), 0.0)
    if scenario.excitation.shock or (scenario.run is None and scenario.sweep is None):
        return []
    swept: Any = scenario.sweep
    ends = [swept.from_, swept.to] if swept is not None and swept.kind in SWEPT_KINDS else []
    highest = max([scenario.excitation.highest_frequency_hz, *ends])
    return [_far_mode(first, highest)] if first > FARTHEST_MODE * highest > 0.0 else []


def _far_mode(first: float, highest: float) -> str:
    """That a first natural frequency lies far beyond the highest of the excitation, Hz."""
    return (
        f"the first natural frequency, {first:.4g} Hz with open contacts, is {first / highest:.3g} times the highest "
        f"frequency of the excitation, {highest:.4g} Hz; was another unit of a size, a modulus, a mass or a frequency "
        "meant?"
    )


def _inaccurate_reduction(scenario: Scenario, modes: Dataset) -> str:
    """A warning of a reduced model whose receptance has a large bound of its error."""
    return (
        f"the reduced model may not be accurate: up to {modes['highest_frequency_hz'].item():.4g} Hz and at the "
        "frequencies of the excitation the error of its receptance at contacts and loads is bounded by "
        f"{modes['reduction_bound'].item():.2g} of its size; "
        f"{scenario.more_modes(math.ceil(1.5 * modes['kept_modes'].item()))}"
    )


def _dashpots(snubbers: Sequence[LocatedItem], contacts: Contacts) -> dict[str, Any]:
    """Of each snubber its dashpot, N s/m or N m s/rad, and what that follows from; they are the first contacts."""
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
    """That the first closed mode is damped otherwise than a ratio says, which is that of another mode."""
    frequencies = modes["closed_frequencies_hz"].values
    closed = np.flatnonzero(frequencies > 0.0)
    if not closed.size:
        return []
    hz, ratio = frequencies[closed[0]], float(modes["closed_damping_ratios"].values[closed[0]])
    written = {s.name: s.damping.ratio for _, _, s, _ in snubbers if s.damping and s.damping.kind == "ratio"}
    other = {
        name: x
        for name, x in written.items()
        if x > 0.0 and not 1.0 / DISTINCT_RATIO_FACTOR < ratio / x < DISTINCT_RATIO_FACTOR
    }
    return [_damped_otherwise(hz, ratio, other)] if other else []


def _damped_otherwise(frequency_hz: float, ratio: float, other_ratios: Mapping[str, float]) -> str:
    """That the first closed mode, Hz, has another damping ratio than those that are written, by snubber."""
    shares = ", ".join(dict.fromkeys(f"{100 * x:.4g}" for x in other_ratios.values()))
    return (
        f"snubbers: the first mode with all snubbers closed, {frequency_hz:.4g} Hz, has a damping ratio of "
        f"{100 * ratio:.3g} %, but {shares} % is given for {first_of(list(other_ratios), 4)}: a ratio sets the dashpot "
        "2 ratio k / Omega, where Omega is the first natural frequency with only that snubber closed; this mode has "
        "another frequency, or little strain energy in the snubber; to set its damping, give the dashpot in N s/m"
    )


def undamped_modes(dynamics: PiecewiseLinearSystem, phases: Ints, rigid: int) -> tuple[Floats, Floats, Floats]:
    """Natural frequencies (n,), rad/s, and modes (n, n) without damping, with contacts in their phases.

    The third array is the stiffness (m,) of the contacts, N/m, of which Maxwell branches have relaxed.

    Parameters
    ----------
    dynamics, phases, rigid : as of `damped_modes`.
    """
    slow = np.asarray(dynamics.contacts.dynamic_stiffness(phases, np.full(1, RELAXED_FREQUENCY))[0].real)
    return *closed_modes(np.sqrt(dynamics.stiffness), dynamics.contacts.shape, slow, rigid), slow


def _one_for_each(share: Floats) -> tuple[Ints, Ints]:
    """Modes, a row each, and the columns that have most of them together, none for two modes."""
    from scipy.optimize import linear_sum_assignment  # which takes as long to import as a validation

    modes, of = linear_sum_assignment(share, maximize=True)
    return modes, of


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
    if not by_states.any() and coupling <= DAMPING_ROUND_OFF * np.abs(damping).max(initial=0.0):
        return omega, ratio

    scale = np.maximum(omega, 1e-3 * omega.max() or 1.0)  # of displacements; a rigid mode has none
    states, drive = equations.internal_rates[:, equations.equations.internal], equations.internal_rate_factors
    own = depth[contacts.state_owner]
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
        modes, of = _one_for_each(share)
    ratio[modes] = 0.0 - values[of].real / np.abs(values[of])  # 0, not -0
    ratio[omega == 0.0] = np.nan
    return omega, ratio
