"""What the steps of the build share: the structure, its reduced coordinates, and where things sit on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from beamsim.errors import MethodError, Problem, ScenarioError
from beamsim.inputs.excitation import Driven
from beamsim.scenario import Located, Scenario
from beamsim.scenario.base import Path
from beamsim.scenario.body import ROTATION_TAKES, TRANSLATION_TAKES
from beamsim.scenario.run import ModeStart, ReleasedForceStart, Start
from beamsim.structures.assembly import assemble, load_site_in, site_in, snubber_site
from beamsim.structures.damping import reduced_damping
from beamsim.structures.places import TRANSLATIONS, UPWARDS, BaseDirection, LoadSite, Place, Site, ends_of
from beamsim.structures.reduction import reduce_model
from beamsim.structures.structure import LoadPattern, ReducedBasis, Structure
from beamsim.system.moved_supports import Moved, driven_supports, moved_supports
from beamsim.system.shared import SharedBuilds
from beamsim.typing import Floats

# First quantities of what moves supports and the base, and is no force.
MOTIONS = (TRANSLATION_TAKES[0], ROTATION_TAKES[0])


@dataclass(frozen=True)
class Parts:
    """The structure of a scenario in reduced, mass-normalised coordinates."""

    scenario: Scenario
    structure: Structure
    basis: ReducedBasis
    shared: SharedBuilds
    moved: tuple[Moved, ...] = ()  # supports that move

    @cached_property
    def omega(self) -> Floats:
        """(n,) rad/s."""
        return np.asarray(self.basis.omega * self.structure.frequency_scale)

    @cached_property
    def damping(self) -> Floats:
        """(n, n) C, 1/s."""
        return reduced_damping(self.structure, self.basis, self.omega)

    def base_load(self, motion: BaseDirection) -> tuple[Floats, Floats]:
        """(n,) modal inertia, sqrt(kg), and force of springs to the ground, N/(m sqrt(kg)), of a unit base motion."""
        inertia, ground = self.structure.base_load(motion)
        scale = np.sqrt(self.structure.mass_scale)
        return np.asarray((inertia @ self.basis.vectors) * scale), np.asarray(ground @ self.basis.vectors) / scale

    @property
    def stiffness(self) -> Floats:
        """(n,) diagonal of K, rad^2/s^2."""
        return np.asarray(self.omega**2)

    def shape(self, load: Any) -> Floats:
        """(n,) what the work of a load of unit level is for a unit of each coordinate, 1/sqrt(kg) times its unit."""
        return np.asarray(self.shapes([load_site_in(self.scenario, load)])[0])

    def shapes(self, sites: Sequence[LoadSite]) -> Floats:
        """(m, n) deflection, of links stretch, at sites for a unit of each coordinate, 1/sqrt(kg)."""
        return np.asarray(self.structure.rows(sites) @ self.basis.vectors / np.sqrt(self.structure.mass_scale))

    @cached_property
    def located_snubbers(self) -> tuple[Located, ...]:
        """The snubbers, see `Scenario.located_snubbers`."""
        return self.scenario.located_snubbers

    @cached_property
    def nonlinear_springs(self) -> tuple[Located, ...]:
        """Springs, joints and friction contacts with laws, see `Scenario.nonlinear_springs`."""
        return self.scenario.nonlinear_springs

    @cached_property
    def snubber_sites(self) -> list[Site]:
        """Where the snubbers sit."""
        return [snubber_site(located) for located in self.located_snubbers]

    @cached_property
    def spring_sites(self) -> list[Site]:
        """Where nonlinear springs, joints and friction contacts sit."""
        return [snubber_site(located) for located in self.nonlinear_springs]

    @cached_property
    def probe_sites(self) -> list[Site]:
        """Where the probes sit."""
        return [site_in(self.scenario, probe) for probe in self.scenario.effective_probes]


def reduced_parts(scenario: Scenario, also_at: Sequence[Place] = (), shared: SharedBuilds | None = None) -> Parts:
    """Assemble and reduce the structure of a scenario, with static vectors at further places.

    Parameters
    ----------
    scenario : a validated scenario.
    also_at : the further places.
    shared : keeps what is built for other scenarios with the same structure.

    Returns
    -------
    Parts

    Raises
    ------
    ScenarioError
        Where matrices do not know a direction that is asked for.
    """
    shared = SharedBuilds() if shared is None else shared
    bodies = tuple(scenario.all_bodies.items())
    driven = tuple((path, each.applied_to) for path, each in driven_supports(scenario))
    nodes = tuple(_sensed(scenario)) if driven else ()
    structure = shared.once("structure", (bodies, scenario.joined_by, nodes), lambda: assemble(scenario, nodes=nodes))
    moved = moved_supports(scenario, structure)
    _check_directions(scenario, structure)
    # where forces act whose static deflections the reduced model needs
    sites: list[LoadSite] = [*_contact_sites(scenario), *force_sites(scenario), *also_at]
    asked = _asked_reduction(scenario, structure)
    gravity = tuple(direction for direction, _ in gravity_loads(scenario))
    # the coordinates are those of the undamped structure
    undamped = tuple((name, body.model_copy(update={"damping": None})) for name, body in bodies)
    key = (undamped, scenario.joined_by, nodes, tuple(sites), gravity, driven, tuple(asked.items()))
    basis = shared.once(
        "reduction", key, lambda: reduce_model(structure, _patterns(structure, sites, gravity, moved), **asked)
    )
    return Parts(scenario, structure, basis, shared, tuple(moved))


def _contact_sites(scenario: Scenario) -> list[Site]:
    """Where snubbers and nonlinear springs sit."""
    return [snubber_site(each) for each in (*scenario.located_snubbers, *scenario.nonlinear_springs)]


def _sensed(scenario: Scenario) -> list[Place]:
    """Places whose motion is felt or recorded."""
    sites = [*_contact_sites(scenario), *(site_in(scenario, probe) for probe in scenario.effective_probes)]
    return list(dict.fromkeys(end for site in sites for end in ends_of(site)))


def _check_directions(scenario: Scenario, structure: Structure) -> None:
    """Refuse what imported matrices do not know enough for: the base's direction, and those of gravity."""
    asked = {"gravity": [direction for direction, _ in gravity_loads(scenario)]}
    if (moving := base_direction(scenario)) is not None:
        asked["excitation.direction"] = [moving]
    for path, directions in asked.items():
        for direction in directions:
            try:
                structure.base_load(direction)
            except MethodError as error:
                about = f"= {direction.direction}: {error.about} {error.message}"
                raise ScenarioError(Problem(path, about, error.remedy)) from None


def start_of(scenario: Scenario) -> Start | None:
    """The initial state that the scenario asks for; None where it has no run."""
    return None if scenario.run is None else scenario.run.start


def exciting_forces(scenario: Scenario) -> list[tuple[Path, Driven]]:
    """The forces of the excitation with their paths; none of base motion and of no excitation."""
    excitation = scenario.excitation
    if excitation.kind == "none":
        return []
    listed: list[tuple[Path, Driven]] = (
        [(("excitation",), excitation)]
        if excitation.kind != "forces"
        else [(("excitation", "forces", index), force) for index, force in enumerate(excitation.forces)]
    )
    return [(p, each) for p, each in listed if each.applied_to != "base" and each.applied_to.takes[0] not in MOTIONS]


def base_direction(scenario: Scenario) -> BaseDirection | None:
    """How the excitation moves the base; None where the base is at rest."""
    excitation = scenario.excitation
    if excitation.kind in ("none", "forces") or excitation.applied_to != "base":  # type: ignore[union-attr]
        return None
    direction = excitation.direction or ""  # type: ignore[union-attr]
    return _named(scenario, direction, excitation.axis_point)  # type: ignore[union-attr]


def output_direction(scenario: Scenario, output: Any) -> BaseDirection:
    """The motion of the base that the force or moment of the whole base, an output, works along."""
    rotates = output.kind == "reaction_moment"
    return _named(scenario, output.direction or ("ry" if rotates else ""), output.axis_point)


def _named(scenario: Scenario, direction: str, about: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> BaseDirection:
    """A direction; without a name where it is that of every body anyhow."""
    default = not direction or all(body.base_directions[0] == direction for body in scenario.all_bodies.values())
    return UPWARDS if default else BaseDirection(direction, about)


def gravity_loads(scenario: Scenario) -> list[tuple[BaseDirection, float]]:
    """Directions and accelerations, m/s^2, of gravity; the scalar acts downwards, against the direction of the base."""
    if isinstance(scenario.gravity, tuple):
        along = zip(TRANSLATIONS, scenario.gravity, strict=True)
        return [(_named(scenario, direction), g) for direction, g in along if g != 0]
    return [] if scenario.gravity == 0 else [(UPWARDS, -scenario.gravity)]


def force_sites(scenario: Scenario) -> list[LoadSite]:
    """Sites of every force, released ones included."""
    sites = [load_site_in(scenario, force) for force in scenario.constant_forces]
    sites += [load_site_in(scenario, force.applied_to) for _, force in exciting_forces(scenario)]
    start = start_of(scenario)
    if isinstance(start, ReleasedForceStart):
        sites.append(load_site_in(scenario, start.released_force))
    return sites


def _patterns(
    structure: Structure, sites: Sequence[LoadSite], gravity: Sequence[BaseDirection], moved: Sequence[Moved]
) -> list[LoadPattern]:
    patterns = [LoadPattern(structure.row(site), site) for site in structure.loaded_sites(sites)]
    patterns += [each.pattern(structure) for each in moved]
    return patterns + [LoadPattern(structure.base_load(direction)[0], direction) for direction in gravity]


def _asked_reduction(scenario: Scenario, structure: Structure) -> dict[str, Any]:
    """How much `reduce_model` keeps: what the scenario asks for, or the default.

    By default a structure keeps the modes up to the frequency of interest of a run, at least ten times the excitation
    frequency and six flexible modes, and none that its discretisation does not carry; one that carries all of its modes
    keeps them. The sample rate and the duration of the output have no part in it.
    """
    asked = scenario.reduction
    hz = 2 * np.pi / structure.frequency_scale
    if asked is not None and asked.modes is not None:
        return {"count": None if asked.modes == "all" else asked.modes}
    if asked is not None and asked.highest_frequency is not None:
        return {"highest_frequency": asked.highest_frequency * hz}
    of_run = 0.0 if scenario.run is None else scenario.frequency_of_interest_hz
    highest = max(of_run, 10 * scenario.excitation.highest_frequency_hz)
    start = start_of(scenario)
    mode = start.mode if isinstance(start, ModeStart) else 0
    return {"highest_frequency": highest * hz, "default": True, "least": 6, "mode": mode}
