r"""A scenario's structure in reduced coordinates, its loads, and moving supports.

Moving supports load the remaining degrees of freedom. With b the motion of one support, the others being fixed, and q
the degrees of freedom relative to the base,

.. math:: M_{qq} \ddot q + C_{qq} \dot q + K_{qq} q = f - M_{qb} \ddot b - C_{qb} \dot b - K_{qb} b.

Matrices and dashpots have their own :math:`C_{qb}`. Modal and Rayleigh damping act on the motion relative to the static
shape :math:`\psi = -K_{qq}^{-1} K_{qb}`, so that :math:`C_{qb} = -C_{qq} \psi`.
"""

from __future__ import annotations

from collections import OrderedDict, defaultdict
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple, TypeVar

import numpy as np

from beamsim.errors import MethodError, Problem, ScenarioError
from beamsim.inputs.excitation import highest_excited_hz
from beamsim.scenario import Scenario
from beamsim.scenario.base import Path, path_text, problem, suggestion
from beamsim.scenario.body import TRANSLATION_TAKES, MovedStop, MovedSupport, SupportMounting
from beamsim.scenario.excitation import SingleExcitation, point_of
from beamsim.scenario.run import ModeStart, ReleasedForceStart
from beamsim.structures.assembly import assemble, load_site_in, site_in, snubber_site
from beamsim.structures.places import (
    DEFLECTION,
    SLOPE,
    TRANSLATIONS,
    UPWARDS,
    BaseDirection,
    Link,
    LoadSite,
    Place,
    Recovery,
    Site,
    ends_of,
)
from beamsim.structures.reduction import reduce_model, reduced_damping
from beamsim.structures.structure import LoadPattern, ReducedBasis, Structure
from beamsim.structures.support_forces import Support, supports_of
from beamsim.typing import Floats

MOST_BUILDS = 8  # of each kind; the least recently used one is dropped

Built = TypeVar("Built")


class SharedBuilds:
    """Cache of structures, reduced structures and signals, by the data that they depend on."""

    def __init__(self) -> None:
        self._kept: defaultdict[str, OrderedDict[Hashable, Any]] = defaultdict(OrderedDict)

    def once(self, kind: str, key: Hashable, build: Callable[[], Built]) -> Built:
        """Build an object, or return it if it was built before.

        Parameters
        ----------
        kind : kind of object; the `MOST_BUILDS` most recently used of each kind are stored.
        key : all data that the object depends on.
        build : function that builds it.

        Returns
        -------
        The object.
        """
        kept = self._kept[kind]
        if key not in kept:
            kept[key] = build()
        kept.move_to_end(key)
        if len(kept) > MOST_BUILDS:
            kept.popitem(last=False)
        known: Built = kept[key]
        return known


@dataclass(frozen=True)
class MovingSupport:
    """A support of the structure, with the excitation that moves it."""

    path: Path
    excitation: SingleExcitation
    support: Support

    def pattern(self, structure: Structure) -> LoadPattern:
        """The load of a constant unit displacement."""
        return LoadPattern(-self.support.on_dofs[0] / structure.stiffness_scale, self.support.motion)

    def static_shape(self, structure: Structure, basis: ReducedBasis) -> Floats:
        """(n,) coordinates of the static shape for a unit motion, sqrt(kg) m."""
        momentum = structure.mass @ self.support.shape
        return np.asarray(basis.vectors.T @ momentum * np.sqrt(structure.mass_scale))

    def loads(self, structure: Structure, basis: ReducedBasis, damping: Floats) -> tuple[Floats, Floats, Floats]:
        """Loads of a unit motion on the reduced structure.

        Parameters
        ----------
        structure, basis : structure with the support, and its reduced coordinates.
        damping : (n, n) C, 1/s.

        Returns
        -------
        tuple
            (n,) each, for unit acceleration, velocity and displacement of the support.
        """
        vectors = basis.vectors / np.sqrt(structure.mass_scale)
        if structure.damping is not None:
            damping = damping - vectors.T @ (structure.damping @ vectors)
        stiffness, mass, viscous = self.support.on_dofs @ vectors
        return -mass, damping @ self.static_shape(structure, basis) - viscous, -stiffness


class ActingLoads(NamedTuple):
    """The parts of the excitation, with their paths."""

    forces: list[tuple[Path, SingleExcitation]]
    supports: list[tuple[Path, SingleExcitation]]  # moving supports
    stops: list[tuple[Path, SingleExcitation]]  # moving stops
    base: list[tuple[Path, SingleExcitation]]  # motions of the base

    @classmethod
    def of(cls, scenario: Scenario) -> ActingLoads:
        """The parts of a scenario's excitation; empty without excitation."""
        forces, supports, stops, base = [], [], [], []
        for place, each in scenario.excitation.items:
            item, on = (("excitation", *place), each), each.applied_to
            if isinstance(on, MovedSupport):
                supports.append(item)
            elif isinstance(on, MovedStop):
                stops.append(item)
            elif each.on_base:
                base.append(item)
            else:
                forces.append(item)
        return cls(forces, supports, stops, base)

    @property
    def signals(self) -> dict[tuple[Path, str], int]:
        """Index of each load signal, by the path of its excitation and its quantity.

        The displacements of the base, which come last, are included only if something on the ground follows them.
        """
        named = [
            *((path, "force") for path, _ in self.forces),
            *((path, quantity) for path, _ in self.supports for quantity in TRANSLATION_TAKES),
            *((path, "displacement") for path, _ in self.stops),
        ]
        named += [(path, quantity) for quantity in ("acceleration", "displacement") for path, _ in self.base]
        return {key: number for number, key in enumerate(named)}


def moving_supports(scenario: Scenario, structure: Structure) -> list[MovingSupport]:
    """The supports that the excitation moves.

    Raises
    ------
    ScenarioError
        If the structure has no such support.
    """
    supports = supports_of(structure)
    return [
        MovingSupport(path, each, _support_of_excitation(scenario, supports, path, each.applied_to))
        for path, each in ActingLoads.of(scenario).supports
    ]


def _support_of_excitation(scenario: Scenario, supports: Sequence[Support], path: Path, excitation: Any) -> Support:
    path = (*path, "applied_to")
    directions = (excitation.direction or DEFLECTION,)
    if excitation.direction == "slope":
        directions = (SLOPE,)
    if excitation.joint is not None:
        named = [each for each in supports if each.site is not None and each.name == excitation.joint]
        key = "joint"
    else:
        body = excitation.body or scenario.default_body
        named, key = supports_named(supports, body, str(excitation.support), (*path, "support")), "support"
    fits = [each for each in named if each.direction in directions]
    if not fits:
        held = " and ".join(dict.fromkeys("slope" if each.direction == SLOPE else each.direction for each in named))
        name = excitation.joint or excitation.support
        message = f"= {name} does not restrain {excitation.direction or 'z'}"
        raise ScenarioError(problem((*path, key), message, f"it restrains {held}"))
    return check_determined(fits[0], (*path, key), ", and cannot move against them")


def supports_named(supports: Sequence[Support], body: str, name: str, path: Path) -> list[Support]:
    """All supports with a name on a body.

    Parameters
    ----------
    supports : supports of the structure.
    body, name : names of body and support.
    path : path of the reference, for the error.

    Raises
    ------
    ScenarioError
        If the body has no such support.
    """
    on_body = [each for each in supports if each.body == body and each.site is None]
    named = [each for each in on_body if each.name == name]
    if not named:
        names = list(dict.fromkeys(each.name for each in on_body))
        remedy = suggestion(name, names, "its supports are") if names else "it is free"
        raise ScenarioError(problem(path, f"= {name} is not a support of {body}", remedy))
    return named


def check_determined(support: Support, path: Path, consequence: str) -> Support:
    """Return a support if its force is determined by the motion; otherwise raise an error.

    Parameters
    ----------
    support : support of a joint or a body.
    path : path of the reference, for the error.
    consequence : consequence of an undetermined force, for the message.

    Raises
    ------
    ScenarioError
    """
    if not support.determined:
        raise ScenarioError(
            problem(
                path, f"= {support.name} constrains a motion that others already constrain{consequence}",
                "leave out the joint that is too many, or give it a stiffness",
            )
        )  # fmt: skip
    return support


def check_places(moving_supports: Sequence[MovingSupport], places: Sequence[tuple[Path, Site]]) -> None:
    """Refuse contacts and probes at places that move with a support: their motion is not that of a free point."""
    problems = []
    for path, site in places:
        ends = ends_of(site)
        for each in moving_supports:
            if any(abs(each.support.direct(end)) > 1e-9 for end in ends):
                where = path_text((*each.path, "applied_to"))
                message = f"is at {site.label}, which moves with the support of {where}"
                problems.append(problem(path, message, "move it along the body"))
                break
    if problems:
        raise ScenarioError(problems)


@dataclass(eq=False)
class ReducedModel:
    """The structure of a scenario in reduced, mass-normalised coordinates."""

    scenario: Scenario
    structure: Structure
    basis: ReducedBasis
    builds: SharedBuilds
    acting_loads: ActingLoads
    moving_supports: tuple[MovingSupport, ...] = ()  # moving supports
    default_reduction: bool = False  # whether the scenario leaves the number of modes to the program
    base: tuple[BaseDirection, ...] = field(init=False)  # (K,) motions of the base by the excitation
    omega: Floats = field(init=False)  # (n,) rad/s
    stiffness: Floats = field(init=False)  # (n,) diagonal of K, rad^2/s^2
    snubber_sites: list[Site] = field(init=False)  # places of the snubbers
    spring_sites: list[Site] = field(init=False)  # places of nonlinear springs, joints and friction contacts
    probe_sites: list[Site] = field(init=False)  # places of the probes

    def __post_init__(self) -> None:
        self.base = base_directions(self.scenario)
        self.omega = np.asarray(self.basis.omega * self.structure.frequency_scale)
        self.stiffness = self.omega**2
        self.snubber_sites = [snubber_site(located) for located in self.scenario.located_snubbers]
        self.spring_sites = [snubber_site(located) for located in self.scenario.nonlinear_springs]
        self.probe_sites = [site_in(self.scenario, probe) for probe in self.scenario.effective_probes]

    @property
    def highest_hz(self) -> float:
        """Highest frequency for which the modes were selected, Hz."""
        return self.basis.highest_frequency * self.structure.frequency_scale / (2 * np.pi)

    @cached_property
    def damping(self) -> Floats:
        """(n, n) C, 1/s."""
        return reduced_damping(self.structure, self.basis, self.omega)

    def base_load(self, motion: BaseDirection) -> tuple[Floats, Floats]:
        """(n,) modal inertia, sqrt(kg), and force of springs to the ground, N/(m sqrt(kg)), for a unit base motion."""
        inertia, ground = self.structure.base_load(motion)
        scale = np.sqrt(self.structure.mass_scale)
        return np.asarray((inertia @ self.basis.vectors) * scale), np.asarray(ground @ self.basis.vectors) / scale

    def shape(self, load: Any) -> Floats:
        """(n,) generalised force of a unit load, 1/sqrt(kg) times the unit of the load."""
        return np.asarray(self.shapes([load_site_in(self.scenario, load)])[0])

    def shapes(self, sites: Sequence[LoadSite]) -> Floats:
        """(m, n) deflection (for links the extension) at sites for a unit of each coordinate, 1/sqrt(kg)."""
        key, scale = (self.basis, tuple(sites)), np.sqrt(self.structure.mass_scale)
        return self.builds.once("shapes", key, lambda: self.structure.rows(sites) @ self.basis.vectors / scale)

    def recoveries(self, sites: Sequence[LoadSite]) -> tuple[Recovery, ...]:
        """Quantities that can be recovered along each body, with stations at the sites; independent of damping."""
        key, recovered = (self.basis, tuple(sites), self.base), self.structure.recoveries
        if len(self.base) > 1:
            return self.builds.once("recoveries", key, lambda: self._recoveries(sites))
        motion = self.base[0] if self.base else None
        return self.builds.once("recoveries", key, lambda: recovered(self.basis, sites, motion))

    def _recoveries(self, sites: Sequence[LoadSite]) -> tuple[Recovery, ...]:
        """Recoveries with the moments of several motions of the base, (moments nx, K)."""
        first, *others = [self.structure.recoveries(self.basis, sites, motion) for motion in self.base]
        moments = [[each.base_moment for each in bodies] for bodies in zip(first, *others, strict=True)]
        return tuple(
            each if of[0] is None else replace(each, base_moment=np.column_stack(of))
            for each, of in zip(first, moments, strict=True)
        )

    def base_participations(self, sites: Sequence[Site]) -> Floats:
        """(k, K) motion of places for a unit of each motion of the base; 1 for links."""
        at_base, moved = self.structure.base_motion_at, np.ones((len(sites), len(self.base)))
        for row, site in zip(moved, sites, strict=True):
            if not isinstance(site, Link):
                row[:] = [at_base(site, motion) for motion in self.base]
        return np.where(np.abs(moved - 1.0) < 1e-9, 1.0, moved)

    def of_base(self, quantity: str, participations: Floats, signals: int) -> Floats:
        """(k, L) coefficients of the load signals in rows (k, K) that multiply a quantity of each motion of the base.

        Parameters
        ----------
        quantity : acceleration or displacement.
        participations : (k, K) factors.
        signals : L; the displacements are not among them if nothing follows these.
        """
        rows, number = np.zeros((participations.shape[0], signals)), self.acting_loads.signals
        for (path, _), factors in zip(self.acting_loads.base, participations.T, strict=True):
            if (column := number[path, quantity]) < signals:
                rows[:, column] = factors
        return rows

    def influence(self, signals: int) -> Floats:
        """(k, L) displacement of each snubber's place relative to its mounting, for a unit of each of the load signals.

        Entries are -1 if a support or the snubber's own motion moves its mounting.

        Raises
        ------
        ScenarioError
            If a snubber is mounted on a support that does not exist.
        """
        scenario, number = self.scenario, self.acting_loads.signals
        influence = np.zeros((len(self.snubber_sites), signals))
        for row, site, (path, _, snubber, _) in zip(
            influence, self.snubber_sites, scenario.located_snubbers, strict=True
        ):
            on = getattr(snubber, "mounted_on", None)
            if isinstance(on, SupportMounting):
                at, body = (*path, "mounted_on", "support"), on.body or scenario.default_body
                assert isinstance(site, Place)
                supports_named(supports_of(self.structure), body, on.support, at)
                for moved in self.moving_supports:
                    by = moved.support
                    if by.site is None and (by.body, by.name, by.direction) == (body, on.support, site.direction):
                        row[number[moved.path, "displacement"]] = -1.0
            for of_stop, driven in self.acting_loads.stops:
                row[number[of_stop, "displacement"]] = -float(driven.moves_stop(snubber.name))
        return influence


def build_reduced_model(
    scenario: Scenario, extra_places: Sequence[Place] = (), builds: SharedBuilds | None = None, least_hz: float = 0.0
) -> ReducedModel:
    """Assemble and reduce the structure of a scenario, with static vectors at additional places.

    Parameters
    ----------
    scenario : a valid scenario.
    extra_places : the additional places.
    builds : cache of parts built for other scenarios with the same structure.
    least_hz : frequency up to which the default number of modes is at least valid.

    Returns
    -------
    ReducedModel

    Raises
    ------
    ScenarioError
        If imported matrices lack a required direction.
    """
    builds = SharedBuilds() if builds is None else builds
    bodies, acting = tuple(scenario.all_bodies.items()), ActingLoads.of(scenario)
    driven = tuple((path, each.applied_to) for path, each in acting.supports)
    contacts = [snubber_site(each) for each in (*scenario.located_snubbers, *scenario.nonlinear_springs)]
    # a place in an element next to a moving support would move with the support
    nodes = (*_sensor_places(scenario, contacts), *extra_places) if driven else ()
    structure = builds.once("structure", (bodies, scenario.joined_by, nodes), lambda: assemble(scenario, nodes=nodes))
    moving = moving_supports(scenario, structure) if driven else []
    if any(body.is_read_from_files for _, body in bodies):
        _check_directions(scenario, structure)
    # places of forces, whose static deflections the reduced model needs
    sites: list[LoadSite] = [*contacts, *force_sites(scenario), *extra_places]
    asked = _reduction_arguments(scenario, structure, least_hz)
    gravity = tuple(direction for direction, _ in gravity_loads(scenario))
    # the coordinates are those of the undamped structure
    undamped = tuple((name, body.model_copy(update={"damping": None})) for name, body in bodies)
    key = (undamped, scenario.joined_by, nodes, tuple(sites), gravity, driven, tuple(asked.items()))
    basis = builds.once(
        "reduction", key, lambda: reduce_model(structure, _patterns(structure, sites, gravity, moving), **asked)
    )
    return ReducedModel(scenario, structure, basis, builds, acting, tuple(moving), "default_reduction" in asked)


def _patterns(
    structure: Structure, sites: Sequence[LoadSite], gravity: Sequence[BaseDirection],
    moving_supports: Sequence[MovingSupport],
) -> list[LoadPattern]:  # fmt: skip
    """The loads whose static deflections a reduced model includes."""
    patterns = [LoadPattern(structure.row(site), site) for site in structure.loaded_sites(sites)]
    springs = [*structure.couplings, *(each for member in structure.members for each in member.body.end_springs)]
    patterns += [LoadPattern(structure.own_row(each.site), each) for each in springs if each.dashpot]
    patterns += [each.pattern(structure) for each in moving_supports]
    return patterns + [LoadPattern(structure.base_load(direction)[0], direction) for direction in gravity]


def _sensor_places(scenario: Scenario, contacts: Sequence[Site]) -> list[Place]:
    """Places of contacts and of recorded motions."""
    sites = [*contacts, *(site_in(scenario, probe) for probe in scenario.effective_probes)]
    return list(dict.fromkeys(end for site in sites for end in ends_of(site)))


def _check_directions(scenario: Scenario, structure: Structure) -> None:
    """Refuse imported matrices that lack the direction of the base motion or of gravity."""
    moving, paths = base_directions(scenario), ActingLoads.of(scenario).base
    asked = [("gravity", direction) for direction, _ in gravity_loads(scenario)]
    asked += [(path_text((*path, "direction")), motion) for (path, _), motion in zip(paths, moving, strict=True)]
    for path, direction in asked:
        try:
            structure.base_load(direction)
            for member in structure.members if direction in moving else ():
                member.body.demand_undamped(structure.base_direction_of(member.body.name, direction))
        except MethodError as error:
            about = f"= {direction.direction}: {error.about} {error.message}"
            raise ScenarioError(Problem(path, about, error.remedy)) from None


def base_directions(scenario: Scenario) -> tuple[BaseDirection, ...]:
    """(K,) motions of the base by the excitation."""
    moving = ActingLoads.of(scenario).base
    return (*[_named(scenario, each.direction or "", point_of(each.about)) for _, each in moving],)


def output_direction(scenario: Scenario, output: Any) -> BaseDirection:
    """Motion of the base whose work defines an output's total force or moment of the base."""
    rotates = output.kind == "reaction_moment"
    return _named(scenario, output.direction or ("ry" if rotates else ""), point_of(output.about))


def _named(scenario: Scenario, direction: str, point: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> BaseDirection:
    """A direction, about a point if it is a rotation; without a name if it is the natural direction of every body."""
    default = not direction or all(body.base_directions[0] == direction for body in scenario.all_bodies.values())
    return UPWARDS if default else BaseDirection(direction, point)


def gravity_loads(scenario: Scenario) -> list[tuple[BaseDirection, float]]:
    """Directions and accelerations, m/s^2, of gravity; a scalar acts downwards, opposite to the base's direction."""
    if isinstance(scenario.gravity, tuple):
        along = zip(TRANSLATIONS, scenario.gravity, strict=True)
        return [(_named(scenario, direction), g) for direction, g in along if g != 0]
    return [] if scenario.gravity == 0 else [(UPWARDS, -scenario.gravity)]


def force_sites(scenario: Scenario) -> list[LoadSite]:
    """Places of all forces, including released ones."""
    sites = [load_site_in(scenario, force) for force in scenario.constant_forces]
    sites += [load_site_in(scenario, force.applied_to) for _, force in ActingLoads.of(scenario).forces]
    start = None if scenario.run is None else scenario.run.start
    if isinstance(start, ReleasedForceStart):
        sites.append(load_site_in(scenario, start.released_force))
    return sites


def _reduction_arguments(scenario: Scenario, structure: Structure, least_hz: float) -> dict[str, Any]:
    """Arguments of `reduce_model`: the reduction that the scenario requests, or the default.

    The default keeps the modes up to the frequency of interest of a run, at least ten times the excitation frequency,
    ``least_hz`` and six flexible modes, but none that the discretisation does not resolve; a structure that resolves
    all of its modes keeps all of them. The sample rate and duration of the output have no influence.
    """
    asked = scenario.reduction
    hz = 2 * np.pi / structure.frequency_scale
    if asked is not None and asked.modes is not None:
        return {"count": None if asked.modes == "all" else asked.modes}
    if asked is not None and asked.highest_frequency is not None:
        return {"highest_frequency": asked.highest_frequency * hz}
    excited = highest_excited_hz(scenario)
    of_run = 0.0 if scenario.run is None else scenario.frequency_of_interest_hz(excited)
    highest = max(of_run, 10 * excited, least_hz)
    start = None if scenario.run is None else scenario.run.start
    mode = start.mode if isinstance(start, ModeStart) else 0
    return {"highest_frequency": highest * hz, "default_reduction": True, "least_modes": 6, "mode": mode}
