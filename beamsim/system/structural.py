"""The one structure that every analysis moves, as `build_system` makes it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from beamsim.contacts.contacts import Contacts
from beamsim.contacts.equilibrium import CubicSprings
from beamsim.contacts.snubbers import SpringInfo
from beamsim.fields import attribute, declared
from beamsim.inputs.drift import CorrectionSize
from beamsim.inputs.signal import Signal
from beamsim.inputs.statements import InputStatement
from beamsim.scenario import Scenario
from beamsim.structures.named_matrices import FileSummary
from beamsim.structures.places import Place, Recovery, Stations, StressRows, stress_rows
from beamsim.system.equations import Channel, ChannelSet, Forcing, PiecewiseLinearSystem, SineLoads, Sizes
from beamsim.system.modes import ModeTable, doubts, mode_table, undamped_modes
from beamsim.system.parts import Parts
from beamsim.typing import Floats


@dataclass(frozen=True)
class ProbeRow:
    """A place whose motion is recorded: deflection = shape @ q, relative to the base."""

    name: str
    position: float  # m along the beam, x on a plate; the mass number for a chain
    across: float | None  # m, y on a plate
    shape: Floats  # (n,) deflection for a unit of each coordinate, 1/sqrt(kg)
    base_influence: float = 1.0  # absolute motion for a unit motion of the base


FORCE_UNITS = {"m": "N", "rad": "N m"}  # by the unit of the motion that they act on


@declared(kw_only=True)
class ContactUnits:
    """The units of what a contact measures; those of a hinge's stops and friction are of angles and moments."""

    turns: bool | None = attribute("", "whether it acts on the angle of a hinge, with a moment", default=None)

    @property
    def gap_unit(self) -> str:
        """m, in a hinge rad."""
        return "rad" if self.turns else "m"

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


@dataclass(eq=False)
class StructuralSystem:
    """A scenario turned into mathematics, with what is needed to turn the solution back.

    Coordinates q are mass-normalised (M = I) and relative to the base: absolute = relative + what the base carries,
    which is 1 on every deflection where it moves upwards.
    """

    parts: Parts  # the reduced structure
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
    cubic: CubicSprings
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
        moving, none = self.base_acceleration is not None, np.zeros((0, self.parts.basis.size))
        self.scenario, self.kept_modes = self.parts.scenario, self.parts.basis.modes
        self.base_influence = np.array([probe.base_influence if moving else 0.0 for probe in self.probes])
        self.open_frequencies_hz = self.parts.omega / (2 * np.pi)
        self.stations = Stations.of_recoveries(self.bodies)
        self.deflection = np.vstack([none, *(body.deflection for body in self.bodies)])
        self.stress = stress_rows(self.bodies)

    @cached_property
    def modes(self) -> ModeTable:
        """Natural frequencies, damping and accuracy, for a result: they take longer than the rest of the system."""
        at_rest = None if self.cubic.count else self.static_equilibrium
        return mode_table(self.parts, self.as_built, self.stops, at_rest, self.stations, self.deflection)

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """Remarks, and doubts that follow from `modes`."""
        return (*self.remarks, *doubts(self.scenario, self.modes))

    @cached_property
    def closed_frequencies_hz(self) -> Floats:
        """(n,) natural frequencies with every snubber closed."""
        phases = np.array([law.closed_phase for law in self.stops.laws], dtype=np.int64)
        stopped = replace(self.as_built, contacts=self.stops)
        return undamped_modes(stopped, phases, self.parts.basis.rigid)[0] / (2 * np.pi)

    def with_supports(self, places: Sequence[Place], times: Floats) -> Floats:
        """(nt, places) m, what supports that move add to the deflection of places: no coordinate has it."""
        moved, first = self.parts.moved, len(self.parts.acting.forces)
        motion = np.zeros((times.size, len(places)))
        for each, displacement in zip(moved, self.forcing.signal[first + 2 :: 3], strict=False):
            motion += np.outer(displacement(times), [each.support.direct(place) for place in places])
        return motion

    @cached_property
    def channels(self) -> ChannelSet:
        """Everything that can be observed.

        Of probes the displacement and velocity relative to the base, and the absolute acceleration; of snubbers force,
        penetration, distance to the face, and displacement and velocity of the structure there; of springs with laws of
        their own and of friction contacts stretch and force; the outputs that the scenario asks for; and the bending
        stress along the bodies.
        """
        sizes = Sizes(self.dynamics.size, self.dynamics.contacts.count, len(self.forcing.signal), self.cubic.count)
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
        split = self.cubic.count > 0
        laws = [(spring.name, spring.law.parts or ()) for spring in self.springs if spring.law is not None]
        names = [name for name, parts in laws for _ in range(len(parts) if split else 1)]
        return (*(snubber.name for snubber in self.snubbers), *names)


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
            Channel("snubbers", snubber.name, "force", snubber.force_unit, force, both_ways=holds),
            Channel("snubbers", snubber.name, "penetration", way, penetration),
            Channel("snubbers", snubber.name, "opening", way, sizes.rows(1, opening=unit[j])),
            Channel("snubbers", snubber.name, "displacement", way, sizes.rows(1, displacement=shape)),
            Channel("snubbers", snubber.name, "velocity", f"{way}/s", sizes.rows(1, velocity=shape)),
        ]
    return channels


def _of_springs(system: StructuralSystem, sizes: Sizes) -> list[Channel]:
    """Those of springs with laws of their own, whose contacts follow the snubbers: one, or one for each part."""
    channels, contact, pulling = [], len(system.snubbers), 0
    split = system.cubic.count > 0
    for spring in system.springs:
        of_contacts, pull = np.zeros(sizes.contacts), np.zeros(sizes.cubic)
        if spring.kind == "cubic":
            pull[pulling] = 1.0
            pulling += 1
        if spring.law is not None:
            for part in (spring.law.parts if split else None) or (None,):
                of_contacts[contact] = 1.0 if part is None else part.direction
                contact += 1
        force = sizes.rows(1, displacement=spring.linear * spring.shape,
            base_displacement=spring.linear * spring.base_influence, contact=of_contacts, cubic=pull,
        )  # fmt: skip
        stretch = sizes.rows(1, displacement=spring.shape, base_displacement=spring.base_influence)
        section = "friction" if spring.kind == "friction" else "springs"
        channels += [
            Channel(section, spring.name, "stretch", spring.gap_unit, stretch),
            Channel(section, spring.name, "force", FORCE_UNITS[spring.gap_unit], force),
        ]
    return channels
