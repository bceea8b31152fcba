"""The sections of a scenario, and what follows from several of them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Annotated, Any, Self

from pydantic import Field

from beamsim.scenario.base import BY_FORM, Path, Problems, Schema, Variants, Whole, named_twice, walk
from beamsim.scenario.beam import AnyBeam
from beamsim.scenario.body import NUMBERED, AtPlace, Body, Located, Probe, WrittenPosition
from beamsim.scenario.chain import Chain
from beamsim.scenario.connections import (
    AnyFriction,
    AnyJoint,
    AnySnubber,
    GroundSpring,
    LinkSpring,
    Maxwell,
    base_problems,
    has_own_law,
    placed,
)
from beamsim.scenario.distributed import AnyDeadLoad
from beamsim.scenario.excitation import Excitation, NoExcitation, Sine
from beamsim.scenario.identification import IdentifyStiffness
from beamsim.scenario.matrices import MatricesBody
from beamsim.scenario.plate import Plate, StiffnessPlate
from beamsim.scenario.quantities import FACTOR, Gravity, GravityVector, Name, Text, level_unit
from beamsim.scenario.reporting import AnyOutput, DisplayUnits, Limits, ReactionOutput, output_dimension
from beamsim.scenario.run import Reduction, Run
from beamsim.scenario.studies import Optimise, Vary
from beamsim.scenario.sweep import NonlinearMode, Sweep

AnyBody = Annotated[
    AnyBeam | Chain | MatricesBody | Plate | StiffnessPlate,
    Variants("does not say which kind of body it is", "give kind: beam, chain, plate or matrices"),
]


class ScenarioParts(Schema):
    """The sections, and what follows from several of them."""

    title: Text = ""
    """Title for tables and plots."""
    beam: Annotated[AnyBeam, BY_FORM] | None = None
    """The structure, if it is a beam."""
    chain: Chain | None = None
    """The structure, if it is a chain of masses."""
    bodies: dict[Name, AnyBody] = Field(default_factory=dict)
    """The bodies by name, where there are several; beam or chain alone is short for one."""
    joints: Annotated[tuple[AnyJoint, ...], NUMBERED] = ()
    """What joins two points of bodies, or a point and the base: rigid, hinge or spring."""
    springs_to_ground: Annotated[tuple[GroundSpring, ...], NUMBERED] = ()
    """Springs from points of bodies to the ground: linear, cubic, piecewise linear (those of a chain may be in it)."""
    springs_between: Annotated[tuple[LinkSpring, ...], NUMBERED] = ()
    """Springs between two points of bodies, linear, cubic or piecewise linear (those of a chain may be in it)."""
    snubbers: Annotated[tuple[AnySnubber, ...], NUMBERED] = ()
    """One-sided stops on the bodies and between them (those of a chain may be listed in it)."""
    friction: Annotated[tuple[AnyFriction, ...], NUMBERED] = ()
    """Dry friction at points of bodies, on the base or the ground, and between two points."""
    gravity: Annotated[Gravity | GravityVector, BY_FORM] = 0.0
    """Acceleration of gravity, towards negative displacement; or its components [x, y, z], [0, 0, -9.81]."""
    constant_forces: tuple[AnyDeadLoad, ...] = ()
    """Dead loads: a force at a point, {line: whole, force_per_length: 5 N/m} or {area: whole, pressure: 200 Pa}."""
    excitation: Excitation = NoExcitation.model_construct()
    """Excitation of the structure; none by default."""
    probes: tuple[Probe, ...] = ()
    """Points whose motion is recorded; by default one at each snubber (on both masses it acts between)."""
    outputs: tuple[AnyOutput, ...] = ()
    """What runs, sweeps and continuations report in addition to the probes: reactions, joint forces, moments, strains,
    stresses, energies."""
    run: Run | None = None
    """A run in time (`beamsim run`)."""
    reduction: Reduction | None = None
    """Modal reduction; chosen automatically by default."""
    sweep: Sweep | None = None
    """A sweep in frequency (`beamsim sweep`)."""
    identify_stiffness: IdentifyStiffness | None = None
    """Identification of a snubber's stiffness (`beamsim identify-stiffness`)."""
    nnm: NonlinearMode | None = None
    """Nonlinear normal mode (`beamsim nnm`)."""
    vary: Vary | None = None
    """Parameters varied from case to case (`beamsim sweep`)."""
    optimise: Optimise | None = None
    """Search for the best design (`beamsim sweep`)."""
    limits: Limits | None = None
    """Limits, for margins in the summary and `--check`."""
    units: DisplayUnits | None = None
    """Units of tables, plots and reports, {acceleration: g, length: mm}; by default those in which most quantities are
    written. Result files and --json stay in SI units."""

    def problems(self, scenario: Whole, at: Path) -> Problems:
        """Gravity that moves no point of a body, and names that are given twice."""
        for k, component in enumerate(self.gravity if isinstance(self.gravity, tuple) else ()):
            if component != 0:
                axis = "xyz"[k]
                yield from base_problems(self, ("gravity", k), axis, f"acts along {axis}, which")
        keys = ("snubbers", "springs_to_ground", "springs_between", "friction")
        acting: list[tuple[Path, Sequence[Any]]] = [((key,), getattr(self, key)) for key in keys]
        for name, body in self.all_bodies.items():
            acting += [((*self.body_path(name), key), items) for key, items in body.own_lists.items()]
        of_run = () if self.run is None else self.run.outputs
        shown = [(("probes",), self.probes), (("outputs",), self.outputs), (("run", "outputs"), of_run)]
        for lists in (acting, shown, [(("joints",), self.joints)]):
            yield from named_twice(lists)

    def doubts(self, scenario: Whole, at: Path) -> Iterator[str]:
        """Joints between points that lie apart."""
        for apart in placed(self.joints, self.all_bodies, self.default_body).apart if self.joints else ():
            yield (
                f"joints[{apart.index}] joins points that lie {1e3 * apart.distance:g} mm apart, as the joints before "
                f"it place {apart.through}: it acts as if they were together; check its positions"
            )

    @property
    def study(self) -> Vary | Optimise | None:
        """The section that asks for many cases."""
        return self.vary or self.optimise

    @property
    def sine(self) -> Sine:
        """The excitation of what follows sines."""
        assert isinstance(self.excitation, Sine)
        return self.excitation

    @property
    def sample_rate(self) -> float:
        """That of a run's output, Hz, as far as it is known without the files that the excitation names."""
        return self.sample_rate_up_to(self.excitation.highest_frequency_hz)

    def sample_rate_up_to(self, highest: float) -> float:
        """Sample rate of a run's output, Hz, as it is written or chosen from the excitation and the structure.

        Parameters
        ----------
        highest : frequency of the excitation, Hz.
        """
        assert self.run is not None
        if self.run.sample_rate is not None:
            return self.run.sample_rate
        return self._chosen_sample_rate(highest, self.run.duration)

    def _chosen_sample_rate(self, highest: float, duration: float) -> float:
        """Sample rate, Hz, of a run of a duration, s, under an excitation up to a frequency, Hz.

        100 samples a period of the excitation, more if the structure or a short run needs it. With a single frequency
        the samples of a period are a whole number, so that spectra of whole periods have no leakage. Long runs at high
        frequency have two million samples, or 20 a period where these are more. A random input has 10 samples, or a
        multiple of that, in a period of its highest frequency: half as many as its own spline, whose pieces they fit.
        A record that is made for a spectrum has as many.
        """
        random = self._banded and highest > 0.0
        rate = max((10.0 if random else 100.0) * highest, 50.0 * self._rough_frequency_hz, 2000.0 / duration)
        # 2e6: samples that are many without being asked for
        rate = min(rate, max(2e6 / duration, (10.0 if random else 20.0) * highest))
        units = (10.0 * highest,) if random else self.excitation.frequencies_hz
        return math.ceil(rate / units[0] * (1.0 - 1e-12)) * units[0] if len(units) == 1 else _round_number(rate)

    def frequency_of_interest_hz(self, highest: float) -> float:
        """What the model of a run resolves where there is no ``reduction``, Hz; the output has no part in it.

        50 times the highest frequency of the excitation, Hz (10 times that of a random one or of a record that is made
        for a spectrum), and with 64 times a low natural frequency about ten bending modes of a beam: peak accelerations
        at a stop need that many.
        """
        return max((10.0 if self._banded else 50.0) * highest, 64.0 * self._rough_frequency_hz)

    @property
    def _banded(self) -> bool:
        """Whether the excitation fills a band of frequencies."""
        return self.excitation.stationary or any(each.kind == "matched" for _, each in self.excitation.items)

    @property
    def _rough_frequency_hz(self) -> float:
        return max((body.rough_frequency_hz for body in self.all_bodies.values()), default=0.0)

    @property
    def all_bodies(self) -> dict[str, Body]:
        """The bodies by name; a beam or chain alone is called beam or chain."""
        bodies: dict[str, Body | None] = {"beam": self.beam, "chain": self.chain, **self.bodies}
        return {name: body for name, body in bodies.items() if body is not None}

    @property
    def has_mesh(self) -> bool:
        """Whether a body has a mesh that can be finer."""
        return any(body.refined() is not body for body in self.all_bodies.values())

    @property
    def default_body(self) -> str:
        """The body that a place without one means; empty where there are several."""
        bodies = self.all_bodies
        return next(iter(bodies)) if len(bodies) == 1 else ""

    def body_path(self, name: str) -> Path:
        """Where a body is written."""
        return ("bodies", name) if name in self.bodies else (name,)

    def body_at(self, path: Path) -> str:
        """The body that a path leads into; empty where it leads into none."""
        return next((name for name in self.all_bodies if (at := self.body_path(name)) == path[: len(at)]), "")

    def points_of(self, item: Any, body: str = "") -> Iterator[tuple[Body, WrittenPosition]]:
        """Bodies and positions on them where something sits; ``body``, or the only one, where a place names none."""
        for place in item.places:
            of = self.all_bodies.get(place.body or body or self.default_body)
            if of is not None and place.position is not None:
                yield of, place.position

    def refined(self, modes: int) -> Self:
        """The same case with so many modes and twice the elements of every mesh, to see what depends on them."""
        bodies = {name: body.refined() for name, body in self.all_bodies.items()}
        named = {name: body for name, body in bodies.items() if name in self.bodies}
        single = {name: body for name, body in bodies.items() if name not in self.bodies}
        return self.model_copy(update={**single, "bodies": named, "reduction": Reduction(modes=modes)})

    @property
    def lasting(self) -> bool:
        """Whether the excitation goes on, so that the motion has means."""
        return self.excitation.kind != "none" and not self.excitation.shock

    @property
    def just_mounted(self) -> bool:
        """Whether a motion begins with Maxwell branches that have not relaxed."""
        return any(isinstance(part, Maxwell) and part.start == "just_mounted" for _, part in walk(self))

    def more_modes(self, kept: int) -> str:
        """What of the reduction gives a model of 1.5 times so many modes; empty where all are kept."""
        wanted, written = math.ceil(1.5 * kept), self.reduction
        if written is None:
            return f"give reduction: {{modes: {wanted}}}"
        if written.highest_frequency is not None:
            return f"raise reduction.highest_frequency ({written.highest_frequency:g} Hz)"
        return "" if written.modes == "all" else f"raise reduction.modes to {wanted}"

    @property
    def bare_dashpots(self) -> tuple[str, ...]:
        """Snubbers with a dashpot at points of bodies with a mesh that have no point mass there."""
        bodies = self.all_bodies
        return tuple(
            located.item.name
            for located in self.located_snubbers
            if located.item.damping is not None
            and any(
                (body := bodies[place.body or located.body]).refined() is not body
                and body.point_of(place) not in body.mass_points
                for place in located.item.places
            )
        )

    def _listed(self, *keys: str) -> Iterator[Located]:
        """What the scenario has in these lists, then what is listed in the bodies under these keys."""
        bodies = self.all_bodies
        lists: list[tuple[Path, str, Any]] = [((key,), self.default_body, getattr(self, key)) for key in keys]
        for name, body in bodies.items():
            of_body = body.own_lists.items()
            lists += [((*self.body_path(name), key), name, items) for key, items in of_body if key in keys]
        for path, name, items in lists:
            yield from (Located((*path, index), name, item, bodies) for index, item in enumerate(items))

    @property
    def located_snubbers(self) -> tuple[Located, ...]:
        """The snubbers with their paths and bodies: those of the scenario, of the bodies, and the stops of hinges.

        Both stops of a pair have its path.
        """
        return tuple(located._replace(item=stop) for located in self.written_snubbers for stop in located.item.stops)

    @property
    def written_snubbers(self) -> tuple[Located, ...]:
        """The same with a pair of stops as one."""
        return (*self._listed("snubbers"), *self._of_hinges("all_stops"))

    def _of_hinges(self, what: str) -> Iterator[Located]:
        """What acts between the rotations of hinges, with its paths."""
        for index, joint in enumerate(self.joints):
            for path, item in getattr(joint, what, ()):
                yield Located(("joints", index, *path), self.default_body, item, self.all_bodies)

    def located_snubber(self, name: str) -> Located:
        """The snubber with this name, its path and its body."""
        return next(located for located in self.located_snubbers if located.item.name == name)

    @property
    def joined_by(self) -> tuple[Any, ...]:
        """Joints and springs that are not listed in a body."""
        return (*self.joints, *self.springs_to_ground, *self.springs_between)

    @property
    def nonlinear_springs(self) -> tuple[Located, ...]:
        """Springs and joints of the scenario and of all bodies that are nonlinear or relax, with their paths; then the
        friction contacts, springs of kind friction."""
        springs = self._listed("springs_to_ground", "springs_between", "joints")
        return (*(spring for spring in springs if has_own_law(spring.item)), *self.located_friction)

    @property
    def has_cubic_springs(self) -> bool:
        """Whether the motion has no closed form, because of a cubic spring."""
        return any(located.item.kind == "cubic" for located in self.nonlinear_springs)

    @property
    def located_friction(self) -> tuple[Located, ...]:
        """The friction contacts with their paths: those of the scenario, then those of hinges."""
        return (*self._listed("friction"), *self._of_hinges("all_friction"))

    @property
    def all_snubbers(self) -> tuple[Any, ...]:
        """The snubbers of the scenario and those listed in the bodies."""
        return tuple(located.item for located in self.located_snubbers)

    @property
    def requested_outputs(self) -> tuple[tuple[Path, Any], ...]:
        """The outputs with their paths: those of the scenario, then those of the run alone."""
        of_run = () if self.run is None else self.run.outputs
        return (
            *((("outputs", k), output) for k, output in enumerate(self.outputs)),
            *((("run", "outputs", k), output) for k, output in enumerate(of_run)),
        )

    def output_unit(self, output: Any) -> str:
        """SI unit of an output; that which it states for a row of a recovery matrix."""
        dimension = output_dimension(output, self.all_bodies, self.default_body)
        return str(output.unit) if dimension is None else dimension.unit or "1"

    @property
    def output_units(self) -> dict[str, str]:
        """SI unit of each output by its name."""
        return {output.name: self.output_unit(output) for _, output in self.requested_outputs}

    @property
    def base_force(self) -> str | None:
        """Name of the output that is the force of the whole base, vertically; None where there is none."""
        reactions = (each for each in self.outputs if isinstance(each, ReactionOutput))
        of_base = (each for each in reactions if each.kind == "reaction_force" and each.support == "base")
        return next((each.name for each in of_base if each.direction in (None, "z")), None)

    @property
    def level_unit(self) -> str:
        """SI unit of the excitation's levels; empty where levels multiply a profile or several forces, or are none."""
        if getattr(self.sweep, "profile", ()) or getattr(self.sweep, "profile_file", None):
            return ""
        quantity = getattr(self.excitation, "quantity", None)
        return "" if quantity in (None, FACTOR) else level_unit(quantity)

    @property
    def effective_probes(self) -> tuple[Probe, ...]:
        """The probes; without any, those by default."""
        return self.probes or self._default_probes()

    def _default_probes(self) -> tuple[Probe, ...]:
        """One at each snubber, on both places it acts between, else where bodies say."""
        several = len(self.all_bodies) > 1
        probes: dict[str, AtPlace] = {}
        for _, body, snubber, _ in sorted(self.written_snubbers, key=lambda each: len(each.item.probed_places)):
            for place in snubber.probed_places:
                probed, alone = _on(body if several else None, place), len(snubber.probed_places) == 1
                probes.setdefault(snubber.name if alone else self._probe_name(probed), probed)
        if not probes:
            usual = {name: body.default_probe() for name, body in self.all_bodies.items() if body.has_default_probe}
            for name, (called, place) in usual.items():
                probes[f"{name}_{called}" if several else called] = _on(name if several else None, place)
        return tuple(
            Probe(name=name, at=place)
            if several or place.node is not None
            else Probe(name=name, position=place.position, mass=place.mass)
            for name, place in probes.items()
        )

    @property
    def bodies_of_places(self) -> dict[str, dict[str, str]]:
        """Of ``probes`` and ``snubbers``, by name, the body (two with a comma); empty where there is one body."""
        if len(self.all_bodies) < 2:
            return {}
        probes = {probe.name: (probe.place.body,) for probe in self.effective_probes}
        snubbers = {s.name: (place.body or body for place in s.places) for _, body, s, _ in self.located_snubbers}
        return {
            folder: {name: ", ".join(filter(None, bodies)) for name, bodies in items.items()}
            for folder, items in (("probes", probes), ("snubbers", snubbers))
        }

    def _probe_name(self, place: AtPlace) -> str:
        """Name of a default probe: mass_2, or with its body inner_0.77."""
        if place.node is not None:
            named = f"node_{place.node}_{place.direction or 'z'}"
        elif place.mass is not None:
            named = f"mass_{place.mass}"
        else:
            point = self.all_bodies[place.body or self.default_body].point_of(place)
            named = "_".join(f"{p:g}" for p in (point if isinstance(point, tuple) else (point,)))
        return named if place.body is None else f"{place.body}_{named}"


def _on(body: str | None, place: AtPlace) -> AtPlace:
    return place if place.body is not None or body is None else place.model_copy(update={"body": body})


def _round_number(least: float) -> float:
    """Return the next of 1, 2, 5, 10, 20, ..."""
    decade = 10.0 ** math.floor(math.log10(least))
    return next(step * decade for step in (1.0, 2.0, 5.0, 10.0, 20.0) if step * decade >= least * (1.0 - 1e-12))
