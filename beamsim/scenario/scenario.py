"""A complete scenario: the content of the YAML file, checked and in SI units."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path as FilePath
from typing import Annotated, Any, ClassVar

from pydantic import Field, Tag

from beamsim.errors import ScenarioError
from beamsim.scenario import checks
from beamsim.scenario.base import Path, Schema, UnknownValueError, Variants, known, number_or_list
from beamsim.scenario.beam import AnyBeam
from beamsim.scenario.bodies import AnyBody
from beamsim.scenario.body import Body, Located
from beamsim.scenario.chain import Chain
from beamsim.scenario.designs import Vary
from beamsim.scenario.display import DisplayUnits
from beamsim.scenario.distributed import AnyDeadLoad, TableShape
from beamsim.scenario.excitation import Excitation, NoExcitation
from beamsim.scenario.friction import AnyFriction
from beamsim.scenario.identification import IdentifyStiffness
from beamsim.scenario.input_files import Record, SolvedFiles, records_of
from beamsim.scenario.joint import AnyJoint
from beamsim.scenario.limits import Limits
from beamsim.scenario.names import DEFAULT_NAMES, named
from beamsim.scenario.nnm import NonlinearMode
from beamsim.scenario.output import AnyOutput
from beamsim.scenario.place import AtPlace, Probe
from beamsim.scenario.quantities import FACTOR, Gravity, GravityVector, Name, Text, level_unit
from beamsim.scenario.run import Reduction, Run
from beamsim.scenario.snubber import AnySnubber
from beamsim.scenario.spring import PointGroundSpring, PointLinkSpring, has_own_law
from beamsim.scenario.sweep import Sweep
from beamsim.scenario.tree import Node, locate, located, path_parts
from beamsim.scenario.warnings import MANY_SAMPLES, doubts


class Scenario(Schema):
    """A structure with its one-sided stops, its excitation and the requested analyses."""

    title: Text = ""
    """Title for tables and plots."""
    beam: AnyBeam | None = None
    """The structure, if it is a beam."""
    chain: Chain | None = None
    """The structure, if it is a chain of masses."""
    bodies: dict[Name, AnyBody] = Field(default_factory=dict)
    """The bodies by name, where there are several; beam or chain alone is short for one."""
    joints: tuple[AnyJoint, ...] = ()
    """What joins two points of bodies, or a point and the base: rigid, hinge or spring."""
    springs_to_ground: tuple[PointGroundSpring, ...] = ()
    """Springs from points of bodies to the ground: linear, cubic, piecewise linear (those of a chain may be in it)."""
    springs_between: tuple[PointLinkSpring, ...] = ()
    """Springs between two points of bodies, linear, cubic or piecewise linear (those of a chain may be in it)."""
    snubbers: tuple[AnySnubber, ...] = ()
    """One-sided stops on the bodies and between them (those of a chain may be listed in it)."""
    friction: tuple[AnyFriction, ...] = ()
    """Dry friction at points of bodies, on the base or the ground, and between two points."""
    gravity: Annotated[
        Annotated[Gravity, Tag("<number>")] | Annotated[GravityVector, Tag("<list>")], Variants(number_or_list)
    ] = 0.0
    """Acceleration of gravity, towards negative displacement; or its components [x, y, z], [0, 0, -9.81]."""
    constant_forces: tuple[AnyDeadLoad, ...] = ()
    """Dead loads: a force at a point, {line: whole, force_per_length: 5 N/m} or {area: whole, pressure: 200 Pa}."""
    excitation: Excitation = NoExcitation.model_construct()
    """Excitation of the structure; none by default."""
    probes: tuple[Probe, ...] = ()
    """Points whose motion is recorded; by default one at each snubber (on both masses it acts between)."""
    outputs: tuple[AnyOutput, ...] = ()
    """What runs, sweeps and continuations report beside the probes: reactions, joint forces, moments, strains,
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
    limits: Limits | None = None
    """Limits, for margins in the summary and `--check`."""
    units: DisplayUnits | None = None
    """Units of tables, plots and reports, {acceleration: g, length: mm}; by default those in which most quantities are
    written. Result files and --json stay in SI units."""

    def settle(self) -> None:
        """Resolve defaults that need the whole, then check the parts against each other."""
        for name in DEFAULT_NAMES:
            if known(items := self.__dict__[name]):
                self.resolve(name, named(items, name))
        self._snap_to_ends()
        if known(self.run, self.excitation, self.beam, self.chain, self.bodies):
            self._choose_sample_rate()
        problems = checks.problems(self)
        if problems:
            raise ScenarioError(problems)
        self._plain_sweep_levels()

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Scenario):
            return NotImplemented
        return all(self.__dict__[name] == other.__dict__[name] for name in self._compared)

    def __hash__(self) -> int:
        values = (self.__dict__[name] for name in self._compared)
        return hash(tuple(tuple(value.items()) if isinstance(value, dict) else value for value in values))

    @property
    def _compared(self) -> list[str]:
        """Fields that make scenarios equal: 270 mm is 0.27 m, in whatever unit it is shown."""
        return [name for name in type(self).model_fields if name != "units"]

    # The origin is not part of the scenario: equality and YAML ignore it.
    _source: str = "scenario"
    _text: Node | None = None
    _left_out: tuple[str, ...] = ()
    _solved: SolvedFiles | None = None  # of a result

    @property
    def display_scales(self) -> dict[str, tuple[float, str]]:
        """By SI unit the factor and the unit of tables and plots, where one is chosen or written."""
        return {} if self.units is None else self.units.scales

    @property
    def source(self) -> str:
        """Name for output files: the scenario file's stem, or ``scenario``."""
        return self._source

    def with_source(self, source: str, text: Node | None = None, warnings: tuple[str, ...] = ()) -> Scenario:
        """Return the same scenario with another name for output files, and the tree and warnings from reading it."""
        copy = self.model_copy()
        copy._source = source
        copy._text = text
        copy._left_out = warnings
        return copy

    @property
    def text(self) -> dict[str, Any] | None:
        """What was read as plain data, `extends` and overrides merged; None of a scenario made otherwise."""
        return None if self._text is None else self._text.plain()

    def with_solved_files(self, files: SolvedFiles) -> Scenario:
        """Return the same scenario as that of a result, whose files are looked for and compared."""
        copy = self.model_copy()
        copy._solved = files
        return copy

    def file_records(self, since: float) -> Mapping[str, Record]:
        """What the files hold that the scenario names, see `beamsim.scenario.input_files.records_of`."""
        return records_of(self, since) if self._solved is None else self._solved.records

    def located(self, error: ScenarioError) -> ScenarioError:
        """Return the error with the file and line of every path, for problems that only the model could find."""
        if self._text is None or self._solved is not None:  # nobody has seen the text in a result file
            return error
        root = self._text
        return ScenarioError([located(root, path_parts(problem.path), problem) for problem in error.problems])

    def folder_of(self, *path: str | int) -> FilePath:
        """Folder that the name of a file at this path is relative to.

        That of the scenario's file; of the scenario of a result the one in which the file is that was solved; else the
        current one.

        Raises
        ------
        ScenarioError
            If the file that was solved is nowhere.
        """
        if self._solved is not None:
            return self._solved.folder_of(path)
        file = None if self._text is None else locate(self._text, path)[0]
        return FilePath(file).parent if file else FilePath()

    @property
    def automatic_sample_rate(self) -> bool:
        """Whether the run's sample rate was chosen here, not by who wrote the scenario."""
        run = (self.text or {}).get("run")
        return isinstance(run, dict) and run.get("sample_rate") is None

    @property
    def frequency_of_interest_hz(self) -> float:
        """What the model of a run resolves where there is no ``reduction``, Hz; the output has no part in it.

        50 times the frequency of the excitation (10 times the highest of a random one), and with 64 times a low natural
        frequency about ten bending modes of a beam: peak accelerations at a stop need that many.
        """
        harmonics = 10.0 if self.excitation.kind == "random" else 50.0
        return max(harmonics * self.excitation.highest_frequency_hz, 64.0 * self._rough_frequency_hz)

    @property
    def _rough_frequency_hz(self) -> float:
        return max((body.rough_frequency_hz for body in self.all_bodies.values()), default=0.0)

    body_sections: ClassVar[tuple[str, ...]] = ("beam", "chain", "bodies")
    """Sections that hold bodies."""

    @property
    def whole(self) -> Schema:
        """Itself, for what asks for numbers by their paths."""
        return self

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

    def refined(self, modes: int) -> Scenario:
        """The same case with so many modes and twice the elements of every mesh, to see what depends on them."""
        bodies = {name: body.refined() for name, body in self.all_bodies.items()}
        named = {name: body for name, body in bodies.items() if name in self.bodies}
        single = {name: body for name, body in bodies.items() if name not in self.bodies}
        return self.model_copy(update={**single, "bodies": named, "reduction": Reduction(modes=modes)})

    @property
    def located_snubbers(self) -> tuple[Located, ...]:
        """The snubbers with their paths and bodies: those of the scenario, then those listed in the bodies.

        Both stops of a pair have its path.
        """
        return tuple(located._replace(item=stop) for located in self._written_snubbers for stop in located.item.stops)

    @property
    def _written_snubbers(self) -> tuple[Located, ...]:
        """The same with a pair of stops as one."""
        bodies = self.all_bodies
        shared = (Located(("snubbers", k), self.default_body, snubber) for k, snubber in enumerate(self.snubbers))
        of_bodies = (
            Located((*self.body_path(name), "snubbers", k), name, snubber)
            for name, body in bodies.items()
            for k, snubber in enumerate(body.own_snubbers)
        )
        return (*shared, *of_bodies)

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
        shared = tuple(
            Located((key, index), self.default_body, spring)
            for key in ("springs_to_ground", "springs_between", "joints")
            for index, spring in enumerate(getattr(self, key))
            if has_own_law(spring)
        )
        of_bodies = tuple(
            Located((*self.body_path(name), *path), name, spring)
            for name, body in self.all_bodies.items()
            for path, spring in body.nonlinear_springs()
        )
        rubbing = tuple(
            Located(("friction", index), self.default_body, contact) for index, contact in enumerate(self.friction)
        )
        return shared + of_bodies + rubbing

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

    @property
    def level_unit(self) -> str:
        """SI unit of the excitation's levels; empty where levels multiply a profile or several forces, or are none."""
        if getattr(self.sweep, "profile", ()) or getattr(self.sweep, "profile_file", None):
            return ""
        quantity = getattr(self.excitation, "quantity", None)
        return "" if quantity in (None, FACTOR) else level_unit(quantity)

    @property
    def effective_probes(self) -> tuple[Probe, ...]:
        """The probes; without any, one at each snubber, on both places it acts between, else where a body says."""
        if self.probes:
            return self.probes
        several = len(self.all_bodies) > 1
        probes: dict[str, AtPlace] = {}
        for _, body, snubber in self._written_snubbers:
            if len(snubber.places) == 1:
                probes[snubber.name] = _on(body if several else None, snubber.places[0])
        for _, body, snubber in self._written_snubbers:
            for place in snubber.probed_places if len(snubber.places) > 1 else ():
                probed = _on(body if several else None, place)
                probes.setdefault(_probe_name(probed), probed)
        if not probes:
            for name, body_section in self.all_bodies.items():
                called, place = body_section.default_probe()
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
        snubbers = {s.name: (place.body or body for place in s.places) for _, body, s in self.located_snubbers}
        return {
            folder: {name: ", ".join(filter(None, bodies)) for name, bodies in items.items()}
            for folder, items in (("probes", probes), ("snubbers", snubbers))
        }

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about values that are allowed but questionable, one sentence each."""
        return tuple(dict.fromkeys((*self._left_out, *doubts(self))))

    def to_yaml(self) -> str:
        """Return the resolved scenario as YAML: SI numbers, defaults filled in; it loads to an equal scenario."""
        from beamsim.scenario.export import to_yaml

        return to_yaml(self)

    def _choose_sample_rate(self) -> None:
        """Fill in a sample rate: 100 samples a period of the excitation, more if the structure or a short run needs it.

        With a single frequency the samples of a period are a whole number, so that spectra of whole periods
        have no leakage. Long runs at high frequency are sampled down to 20 a period. A random input has 10 samples, or
        a multiple of that, in a period of its highest frequency: half as many as its own spline, whose pieces they fit.
        """
        run = self.run
        if run is None or run.sample_rate is not None:
            return
        try:
            highest = self.excitation.highest_frequency_hz
            random = self.excitation.kind == "random"
            rate = max((10.0 if random else 100.0) * highest, 50.0 * self._rough_frequency_hz, 2000.0 / run.duration)
            rate = min(rate, max(MANY_SAMPLES / run.duration, (10.0 if random else 20.0) * highest))
            units = (10.0 * highest,) if random else self.excitation.frequencies_hz
            rate = _whole_multiple(rate, units[0]) if len(units) == 1 else _round_number(rate)
        except (UnknownValueError, ArithmeticError, ValueError):  # what is wrong is reported where it is
            return
        self.resolve("run", run.model_copy(update={"sample_rate": rate}))

    def _plain_sweep_levels(self) -> None:
        """Forget the units of the sweep's levels, which are those of the excitation."""
        if self.sweep is not None:
            self.resolve("sweep", self.sweep.plain_levels())

    def _snap_to_ends(self) -> None:
        """Put on the end what is beyond it by round-off (3 ft and 36 in differ in the last digit)."""
        if not known(self.beam, self.chain, self.bodies):
            return
        bodies = {name: body for name, body in self.all_bodies.items() if known(body, *body.__dict__.values())}
        if self.beam is not None and "beam" in bodies:
            self.resolve("beam", _snapped(self.beam, bodies, "beam"))
        if self.bodies:
            self.resolve("bodies", {name: _snapped(body, bodies, name) for name, body in self.bodies.items()})
        default = self.default_body
        for name in type(self).model_fields.keys() - {*self.body_sections}:
            self.resolve(name, _snapped(self.__dict__[name], bodies, default))


def _on(body: str | None, place: AtPlace) -> AtPlace:
    return place if place.body is not None or body is None else place.model_copy(update={"body": body})


def _probe_name(place: AtPlace) -> str:
    """Name of a default probe: mass_2, or with its body inner_0.77."""
    position = place.point if isinstance(place.point, tuple) else (place.point,)
    if place.node is not None:
        point = f"node_{place.node}_{place.direction or 'z'}"
    else:
        point = f"mass_{place.mass}" if place.mass is not None else "_".join(f"{p:g}" for p in position)
    return point if place.body is None else f"{place.body}_{point}"


def _whole_multiple(least: float, unit: float) -> float:
    return math.ceil(least / unit * (1.0 - 1e-12)) * unit


def _round_number(least: float) -> float:
    """Return the next of 1, 2, 5, 10, 20, ..."""
    decade = 10.0 ** math.floor(math.log10(least))
    return next(step * decade for step in (1.0, 2.0, 5.0, 10.0, 20.0) if step * decade >= least * (1.0 - 1e-12))


def _snapped(value: object, bodies: dict[str, Body], default: str) -> object:
    """The same with positions on the ends of their bodies; ``default`` is the body of a position that names none."""
    if isinstance(value, tuple):
        items = tuple(_snapped(item, bodies, default) for item in value)
        return items if any(new is not old for new, old in zip(items, value, strict=True)) else value
    if not isinstance(value, Schema):
        return value
    changed: dict[str, object] = {}
    name = getattr(value, "body", None) or default
    if isinstance(value, TableShape) and name in bodies:
        changed = value.on_the_body(bodies[name])
    for key, old in value.__dict__.items():
        if old is None or (isinstance(old, (float, str, int)) and key != "position"):
            continue
        new = _snapped(old, bodies, name if isinstance(name, str) else default)
        point = isinstance(old, tuple) and key in ("position", "from_", "to")  # [x, y] on a plate
        if (point or (key == "position" and isinstance(old, float))) and isinstance(name, str) and name in bodies:
            new = bodies[name].on_the_body(old)
        elif key in ("line", "area") and isinstance(old, tuple) and isinstance(name, str) and name in bodies:
            new = tuple(bodies[name].on_the_body(end) for end in old)
        if (new != old or type(new) is not type(old)) if isinstance(old, float) else new is not old:
            changed[key] = new
    return value.model_copy(update=changed) if changed else value
