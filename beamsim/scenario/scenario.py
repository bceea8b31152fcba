"""A complete scenario: the content of the YAML file as written, checked, in SI units.

It also knows the files that it names (their content when they were read, and where they are when a result is opened),
and gives warnings about values that are allowed but questionable.
"""

from __future__ import annotations

import hashlib
import math
import os
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from pathlib import Path as FilePath
from typing import Annotated, Any, ClassVar, Self

from pydantic import Field, ValidationError

from beamsim.errors import InputFileError, ScenarioError
from beamsim.files import is_as_opened, open_input, protect, state_of
from beamsim.scenario import quantities as q
from beamsim.scenario import units
from beamsim.scenario.base import (
    BY_FORM,
    InvalidValueError,
    Path,
    Problems,
    Schema,
    Variants,
    as_plain_data,
    named_twice,
    nested_annotations,
    path_parts,
    path_text,
    problem,
    walk,
)
from beamsim.scenario.beam import AnyBeam
from beamsim.scenario.before_after import BeforeAfter
from beamsim.scenario.body import NUMBERED, AtPlace, Body, LocatedItem, Probe
from beamsim.scenario.chain import Chain
from beamsim.scenario.connections import (
    AnyFriction,
    AnyJoint,
    GroundSpring,
    LinkSpring,
    Maxwell,
    base_problems,
    has_own_law,
)
from beamsim.scenario.distributed import AnyDeadLoad
from beamsim.scenario.excitation import Excitation, NoExcitation, Sine, level_jumps
from beamsim.scenario.frame import FrameBody
from beamsim.scenario.identification import IdentifyStiffness
from beamsim.scenario.matrices import MatricesBody
from beamsim.scenario.plate import Plate, StiffnessPlate
from beamsim.scenario.quantities import FACTOR, Gravity, GravityVector, Name, Text, UsualRange, level_unit, usual_of
from beamsim.scenario.reporting import INPUT, AnyOutput, Limits, ReactionOutput, output_dimension
from beamsim.scenario.rings import AnyStop, RingStop
from beamsim.scenario.run import Reduction, Run
from beamsim.scenario.studies import Optimise, Vary
from beamsim.scenario.sweep import NonlinearMode, Sweep
from beamsim.scenario.tree import (
    Overrides,
    WrittenMapping,
    apply_overrides,
    dump_yaml,
    from_python,
    locate,
    located_problem,
    parse,
    read_file,
    resolve_extends,
    written_number,
)
from beamsim.scenario.units import UNITS_WRITTEN, Dimension
from beamsim.scenario.validation_errors import problems_of


class DisplayUnits(Schema):
    """Units of tables, plots and reports; result files and ``--json`` are always in SI units.

    The default for accelerations, lengths, angles and long times is the unit in which most of them are written.
    """

    acceleration: Annotated[str, q.UnitType(dimension=units.ACCELERATION, example="g")] | None = None
    """Unit of accelerations, such as m/s^2; by default as written, g for numbers without unit."""
    length: Annotated[str, q.UnitType(dimension=units.LENGTH, example="mm")] | None = None
    """Unit of lengths and displacements, such as mm; by default as written, or metres with a suitable prefix if all are
    in metres."""
    angle: Annotated[str, q.UnitType(dimension=units.ANGLE, example="deg")] | None = None
    """Unit of angles, such as deg; by default as most are written, or radians with a prefix for numbers without
    unit."""
    velocity: Annotated[str, q.UnitType(dimension=units.VELOCITY, example="m/s")] | None = None
    """Unit of velocities, such as mm/s."""
    force: Annotated[str, q.UnitType(dimension=units.FORCE, example="N")] | None = None
    """Unit of forces, such as kN."""
    stress: Annotated[str, q.UnitType(dimension=units.PRESSURE, example="MPa")] | None = None
    """Unit of stresses and moduli, such as MPa."""
    time: Annotated[str, q.UnitType(dimension=units.TIME, example="min")] | None = None
    """Unit of times, such as ms or min; by default minutes or hours if times are written so. Times much shorter than
    the unit are shown in seconds."""
    mass: Annotated[str, q.UnitType(dimension=units.MASS, example="kg")] | None = None
    """Unit of masses, such as g."""
    stiffness: Annotated[str, q.UnitType(dimension=units.STIFFNESS, example="N/mm")] | None = None
    """Unit of stiffnesses, such as N/mm."""
    energy: Annotated[str, q.UnitType(dimension=units.ENERGY, example="J")] | None = None
    """Unit of energies, such as mJ."""

    def complete_from(self, unit_counts: Mapping[tuple[Dimension, str], int]) -> DisplayUnits:
        """A copy in which missing units are those used most often in the scenario.

        Parameters
        ----------
        unit_counts : how often each dimension is written in each unit.
        """
        counts: dict[str, dict[str, int]] = {name: {} for name in ("acceleration", "length", "angle", "time")}
        for (of, unit), count in unit_counts.items():
            name = next((name for name in counts if DIMENSIONS[name].unit == of.unit), "")
            # metres are written for the size of a panel, but displacements need a prefix, and so do short times
            if name and unit != units.LENGTH.unit and (name != "time" or units.size_of(unit, units.TIME) >= 60.0):
                counts[name][unit] = counts[name].get(unit, 0) + count
        densities = [unit for of, unit in unit_counts if of.unit == units.ACCELERATION_PSD.unit]
        if densities and not counts["acceleration"] and not any(map(units.is_in_gravities, densities)):
            counts["acceleration"] = {units.ACCELERATION.unit: 1}
        most = {  # of equally many g, in which tests are written next to a gravity in m/s^2, and then the smallest
            name: max(of, key=lambda u: (of[u], units.is_in_gravities(u), -units.size_of(u, DIMENSIONS[name])))
            for name, of in counts.items()
            if of and getattr(self, name) is None
        }
        return self.model_copy(update=most)


DIMENSIONS: dict[str, Dimension] = {
    name: next(each.dimension for each in nested_annotations(field.annotation) if isinstance(each, q.UnitType))
    for name, field in DisplayUnits.model_fields.items()
}
"""Dimension of each display unit."""


AnyBody = Annotated[
    AnyBeam | Chain | FrameBody | MatricesBody | Plate | StiffnessPlate,
    Variants("does not show which kind of body it is", "give kind: beam, chain, frame, plate or matrices"),
]


Record = Mapping[str, Any]
"""Data about one file: ``file``, its name as written; ``folder``; ``bytes``; ``sha256`` of its content, which is
missing if the file was changed or removed during the computation."""


def named_files(scenario: Schema) -> Iterator[tuple[Path, str]]:
    """Yield the path of the key and the name of every file in a scenario."""
    for path, part in walk(scenario):
        for key, name in type(part).keys().items():
            if isinstance(value := part.__dict__.get(name), str):
                field = type(part).model_fields[name]
                if any(
                    isinstance(each, q.FileType) for each in (*field.metadata, *nested_annotations(field.annotation))
                ):
                    yield (*path, key), value


def _sha256(path: FilePath) -> str:
    """SHA-256 digest of a file; an unchanged file is read once."""
    status = path.stat()
    return _digest(path.absolute(), (*state_of(status), status.st_ctime_ns))


@lru_cache(maxsize=256)
def _digest(path: FilePath, state: tuple[int, ...]) -> str:
    del state
    with open_input(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _record(folder: FilePath, name: str, *, unchanged_only: bool) -> Record:
    """Data about the content of a file, see `Scenario.file_records`."""
    path = folder / name
    try:
        content: dict[str, Any] = {"bytes": path.stat().st_size}
        content |= {"sha256": _sha256(path)} if not unchanged_only or is_as_opened(path) else {}
    except (OSError, InputFileError):
        content = {}
    return {"file": name, "folder": str(folder.absolute()), **content}


@dataclass(frozen=True)
class SolvedFiles:
    """The files of a scenario that was read from a result file."""

    records: Mapping[str, Record]  # by key
    result_folder: FilePath  # folder of the result file
    may_be_opened: bool = True  # False if a result is only displayed

    def folder_of(self, path: Path) -> FilePath:
        """Folder of the file at a path: the current folder, that of the result, or that of the computation.

        Raises
        ------
        ScenarioError
            If the file is not found, or its content differs from that used in the computation.
        """
        record = self.records.get(path_text(path)) or self.records.get(path_text(path[:-1]))
        if record is None:
            return FilePath()
        name = str(record["file"])
        folders = {
            FilePath(record["folder"]): "that of the case",
            self.result_folder: "that of the result",
            FilePath().absolute(): "the current folder",
        }  # each once, under the name closest to the user
        there = [folder for folder in reversed(folders) if (folder / name).is_file()]
        for folder in there:
            same_size = (folder / name).stat().st_size == record.get("bytes")
            if same_size and _sha256(folder / name) == record.get("sha256"):
                return folder
        if there:
            reason = (
                "its content is another"
                if "sha256" in record
                else "it was changed or removed while the case was solved"
            )
            message = f"in {folders[there[0]]}, {there[0]}, is not the file that was solved: {reason}"
            remedy = "bring back the file as it was, or run the case again"
        else:
            searched = ", ".join(f"{label} ({folder})" for folder, label in reversed(folders.items()))
            message = f"is not found; searched: {searched}"
            remedy = "give the command in the folder of the case, or put the file next to the result"
        raise ScenarioError(problem(path, f"= {name} {message}", remedy))


MANY_SAMPLES = 2e6  # samples of a run, unless it asks for more
_ANALYSES = {"run", "sweep", "nnm", "identify_stiffness", "vary", "optimise", "limits"}
"""Sections with sample rates and frequencies that depend on the bodies."""


def profile_jumps(scenario: Scenario) -> Iterator[str]:
    """Warnings about steps in the level of a sweep."""
    for key in ("excitation", "sweep"):
        yield from level_jumps(scenario, (key,), getattr(scenario, key))


class Scenario(Schema):
    """A structure with one-sided stops, its excitation and the requested analyses.

    It is frozen, and equal to another one if all quantities are.

    Examples
    --------
    >>> import beamsim
    >>> case = {"chain": {"masses": ["1 kg"], "springs": ["4 kN/m"]}, "nnm": {"mode": 1, "energy": "1 J"}}
    >>> scenario = beamsim.load_scenario(case)
    >>> scenario.chain.springs, scenario.run, scenario.title, scenario.source, scenario.warnings
    ((4000.0,), None, '', 'scenario', ())
    >>> beamsim.load_scenario(scenario.to_yaml()) == scenario
    True
    """

    title: Text = ""
    """Title for tables and plots."""
    beam: Annotated[AnyBeam, BY_FORM] | None = None
    """The structure, if it is a single beam."""
    chain: Chain | None = None
    """The structure, if it is a single chain of masses."""
    bodies: dict[Name, AnyBody] = Field(default_factory=dict)
    """The bodies by name, if there are several; beam or chain is the short form for one body."""
    joints: Annotated[tuple[AnyJoint, ...], NUMBERED] = ()
    """Connections of two points of bodies, or of a point and the base: rigid, hinge or spring."""
    springs_to_ground: Annotated[tuple[GroundSpring, ...], NUMBERED] = ()
    """Springs from points of bodies to the ground: linear, cubic or piecewise linear (those of a chain may be listed in
    it)."""
    springs_between: Annotated[tuple[LinkSpring, ...], NUMBERED] = ()
    """Springs between two points of bodies: linear, cubic or piecewise linear (those of a chain may be listed in
    it)."""
    snubbers: Annotated[tuple[AnyStop, ...], NUMBERED] = ()
    """One-sided stops on bodies and between them (those of a chain may be listed in it), and rings."""
    friction: Annotated[tuple[AnyFriction, ...], NUMBERED] = ()
    """Dry friction at points of bodies against the base or the ground, and between two points."""
    gravity: Annotated[Gravity | GravityVector, BY_FORM] = 0.0
    """Acceleration of gravity, towards negative displacements; or its components [x, y, z], [0, 0, -9.81]."""
    constant_forces: tuple[AnyDeadLoad, ...] = ()
    """Dead loads: a force at a point, {line: whole, force_per_length: 5 N/m} or {area: whole, pressure: 200 Pa}."""
    excitation: Excitation = NoExcitation.model_construct()
    """Excitation of the structure; none by default."""
    probes: tuple[Probe, ...] = ()
    """Points whose motion is recorded; by default one at each snubber (two for a snubber between two masses)."""
    outputs: tuple[AnyOutput, ...] = ()
    """Results of runs, sweeps and continuations in addition to the probes: reactions, joint forces, moments, strains,
    stresses, energies."""
    run: Run | None = None
    """A simulation in time (`beamsim run`)."""
    reduction: Reduction | None = None
    """Modal reduction; chosen automatically by default."""
    sweep: Sweep | None = None
    """A frequency sweep (`beamsim sweep`)."""
    identify_stiffness: IdentifyStiffness | None = None
    """Identification of a snubber's stiffness (`beamsim identify-stiffness`)."""
    nnm: NonlinearMode | None = None
    """Nonlinear normal mode (`beamsim nnm`)."""
    vary: Vary | None = None
    """A study: parameters that vary from case to case (`beamsim sweep`)."""
    optimise: Optimise | None = None
    """Search for the best design (`beamsim sweep`)."""
    before_after: BeforeAfter | None = None
    """Test data before and after another test, whose resonances are compared (`beamsim compare`); without a
    structure."""
    limits: Limits | None = None
    """Limits, for margins in the summary and `--check`."""
    units: DisplayUnits | None = None
    """Units of tables, plots and reports, {acceleration: g, length: mm}; by default those that most quantities are
    written in. Result files and --json are always in SI units."""

    # Equality and YAML ignore where the scenario came from.
    _source: str = "scenario"
    _text: Any = None  # the data as read, see `beamsim.scenario.tree`
    _ignored_sections: tuple[str, ...] = ()
    _solved: SolvedFiles | None = None  # of a scenario from a result file

    def check(self) -> None:
        """Check the sections for internal problems and against each other."""
        self.exclude("chain", "beam", remedy="keep one of the two (null removes an inherited one)")
        self.exclude("bodies", "beam", "chain", remedy="list it among the bodies")
        self.exclude("optimise", "vary")
        self.exclude("before_after", "beam", "chain", "bodies", remedy="compare test data in a file of its own")
        if not (bodies := self.all_bodies):
            self._check_without_structure()
        found = [each for name, body in bodies.items() for each in body.problems(self, self.body_path(name))]
        left_out = _ANALYSES if found else set()
        for k, component in enumerate(self.gravity if isinstance(self.gravity, tuple) else ()):
            if component != 0:
                found += base_problems(self, ("gravity", k), "xyz"[k], f"acts along {'xyz'[k]}, which")
        acting = self.listed("snubbers", "springs_to_ground", "springs_between", "friction")
        found += named_twice((at.path, at.item) for at in acting)
        probes = ((("probes", k), probe) for k, probe in enumerate(self.probes))
        found += named_twice((*probes, *self.requested_outputs))
        found += named_twice((at.path, at.item) for at in self.listed("joints"))
        for at, part in walk(self):
            if not isinstance(part, Body) and not left_out.intersection(at[:1]):
                found += part.problems(self, at)
        if self.requested_outputs and not (found or self.probes):
            found += self._outputs_called_as_probes()
        if found:
            raise ScenarioError(found)

    def _check_without_structure(self) -> None:
        """Refuse a scenario without a structure, unless it compares test data and has nothing else but limits."""
        if self.before_after is None:
            remedy = "give beam:, chain: or bodies: (beamsim new writes a template)"
            raise ScenarioError(problem((), "the scenario has no structure", remedy))
        others = set(self.keys()) - {"title", "before_after", "limits", "units"}
        self.exclude("before_after", *sorted(others), remedy="compare test data in a file of its own")

    def _outputs_called_as_probes(self) -> Problems:
        """Problems of outputs with the name of a default probe: signals are named by place and quantity."""
        names = {probe.name for probe in self.effective_probes}
        for at, output in self.requested_outputs:
            if output.name in names:
                message = f"= {output.name} is already the name of a probe, which is there as long as none is listed"
                yield problem((*at, "name"), message, "choose another name, or list the probes")

    def recheck(self) -> Self:
        """Check all sections again after values were replaced; returns the scenario itself.

        Raises
        ------
        ScenarioError
            If a check fails.
        """
        for path, part in walk(self):
            try:
                part.check()
            except InvalidValueError as error:
                raise ScenarioError(error.problem(path)) from None
        return self

    uncompared_keys: ClassVar[tuple[str, ...]] = ("units",)
    """Equal quantities are equal in any display unit."""

    @property
    def display_scales(self) -> dict[str, tuple[float, str]]:
        """Factor and display unit for each SI unit, if a unit is chosen or written."""
        chosen = [] if self.units is None else [(of, getattr(self.units, name)) for name, of in DIMENSIONS.items()]
        return {of.unit: (1.0 / units.size_of(unit, of), unit) for of, unit in chosen if unit is not None}

    @property
    def source(self) -> str:
        """Name for output files: the scenario file's stem, or ``scenario``."""
        return self._source

    def with_source(self, source: str) -> Scenario:
        """A copy with another name for output files."""
        copy = self.model_copy()
        copy._source, copy._text, copy._ignored_sections = source, None, ()
        return copy

    def with_solved_files(self, files: SolvedFiles) -> Scenario:
        """A copy for the scenario of a result, whose files are searched for and compared."""
        copy = self.model_copy()
        copy._solved = files
        return copy

    def file_records(self, *, unchanged_only: bool) -> Mapping[str, Record]:
        """Data about the files that the scenario names, by key; files that no longer exist are omitted.

        Parameters
        ----------
        unchanged_only : omit the digest of a file that changed after this process read it.
        """
        if self._solved is not None:
            return self._solved.records
        files = {path_text(path): (self.folder_of(*path), name) for path, name in named_files(self)}
        return {key: _record(folder, name, unchanged_only=unchanged_only) for key, (folder, name) in files.items()}

    def located(self, error: ScenarioError) -> ScenarioError:
        """Add the file and line of each path to an error that only the model could find."""
        if self._text is None or self._solved is not None:  # the text in a result file is not visible to the user
            return error
        root = self._text
        return ScenarioError([located_problem(root, problem) for problem in error.problems])

    @contextmanager
    def locating(self) -> Iterator[None]:
        """Context manager that adds file and line to errors that only the model can find."""
        try:
            yield
        except ScenarioError as error:
            raise self.located(error) from None

    def folder_of(self, *path: str | int) -> FilePath:
        """Folder to which the file name at this path is relative.

        This is the folder of the scenario file; for the scenario of a result the folder with the original file;
        otherwise the current folder.

        Raises
        ------
        ScenarioError
            If the original file is not found, or must not be opened.
        """
        if self._solved is not None:
            self._demand_consent(path)
            return self._solved.folder_of(path)
        file = None if self._text is None else locate(self._text, path)[0]
        return FilePath(file).parent if file else FilePath()

    def _demand_consent(self, path: Path) -> None:
        """Refuse to open a file at or below a path if the scenario belongs to a result that is only displayed.

        Raises
        ------
        ScenarioError
            If there is such a file.
        """
        if self._solved is None or self._solved.may_be_opened:
            return
        for at, name in named_files(self):
            if at[: len(path)] == path or path[: len(at)] == at:
                message = f"= {name} is a file that the result names, and is not opened just because it does"
                raise ScenarioError(problem(at, message, "add --open-files if it is yours, or run the case again"))

    def whole_paths(self, part: Schema, body_path: Path = ()) -> dict[Path, str]:
        """Names of files in a section, by their paths from the root.

        Parameters
        ----------
        part : the section, or a variant of the complete scenario.
        body_path : path of the section.
        """
        return {at: str((self.folder_of(*body_path, *at) / name).absolute()) for at, name in named_files(part)}

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about values that are allowed but questionable, one sentence each."""
        found = (text for at, part in walk(self) for text in part.find_warnings(self, at))
        return tuple(dict.fromkeys((*self._ignored_sections, *found, *self.questions(_SIZES))))

    def questions(self, sizes: UsualSizes) -> Iterator[str]:
        """A sentence for each questionable number, with both interpretations; it ends with ``meant?``.

        Parameters
        ----------
        sizes : reference sizes of the ranges to check.
        """
        for at, part in walk(self) if self.as_written is not None else ():
            for name, usual in usual_of(type(part)).items():
                value = getattr(part, name) if usual.reference in sizes and name in part.model_fields_set else None
                size = sizes[usual.reference](self, at) if isinstance(value, float) else None
                if value is not None and size is not None and not usual.contains(value, size):
                    yield from self._question((*at, name), value, size, usual)

    def _question(self, path: Path, value: float, size: float, usual_range: UsualRange) -> Iterator[str]:
        """Yield a question if a number that the user wrote is outside its usual range.

        Parameters
        ----------
        path : path of the number.
        value, size : SI.
        usual_range : usual range of the field.
        """
        written = written_number(self.as_written, path, value, usual_range.dimension)
        if text := "" if written is None else usual_range.question(value, size, written):
            yield f"{path_text(path)} {text}"

    @property
    def as_written(self) -> Any:
        """The data as read, in the original units; None if there is no such source."""
        return None if self._solved is not None else self._text

    def unit_written(self, path: Path, value: float, dimension: Dimension) -> str | None:
        """The unit that a number was written in, empty if it had none; None if the number was not written.

        Parameters
        ----------
        path : path of the number.
        value, dimension : SI, and its dimension.
        """
        written = None if self.as_written is None else written_number(self.as_written, path, value, dimension)
        return None if written is None else units.number_and_unit(written)[1]

    def to_yaml(self) -> str:
        """The scenario as YAML with SI units; it loads to an equal scenario."""
        return dump_yaml(as_plain_data(self))

    @property
    def study(self) -> Vary | Optimise | None:
        """The section of a study, if there is one."""
        return self.vary or self.optimise

    @property
    def base_motion_names(self) -> tuple[str, ...]:
        """Names of the motions of the base: their directions, numbered if one has several."""
        own = next(iter(self.all_bodies.values())).base_directions[0] or "base"
        names: list[str] = []
        for _, each in self.excitation.items:
            if each.on_base:
                name = each.direction or own
                number = 1 + [known.partition(" ")[0] for known in names].count(name)
                names.append(name if number == 1 else f"{name} {number}")
        return tuple(names)

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the inputs among the signals of spectra and statistics: one for each motion of the base."""
        names = self.base_motion_names
        return (INPUT,) if len(names) < 2 else tuple(f"{INPUT} {name}" for name in names)

    @property
    def sine(self) -> Sine:
        """The excitation, for analyses that need a sine."""
        assert isinstance(self.excitation, Sine)
        return self.excitation

    @property
    def sample_rate(self) -> float:
        """Sample rate of a run's output, Hz, without reading files of the excitation."""
        return self.sample_rate_up_to(self.excitation.highest_frequency_hz)

    def sample_rate_up_to(self, highest_hz: float) -> float:
        """Sample rate of a run's output, Hz, as given or chosen from the excitation and the structure.

        Parameters
        ----------
        highest_hz : highest frequency of the excitation, Hz.
        """
        assert self.run is not None
        if self.run.sample_rate is not None:
            return self.run.sample_rate
        return self._chosen_sample_rate(highest_hz, self.run.duration)

    def _chosen_sample_rate(self, highest_hz: float, duration: float) -> float:
        """Default sample rate, Hz, for a duration, s, and a highest excitation frequency, Hz.

        It is 100 samples per period of the excitation, more if the structure or a short run needs it. With a single
        frequency the number of samples per period is an integer, so that spectra of whole periods have no leakage. Long
        runs at high frequency have two million samples, or 20 per period if that is more. A random input has 10 samples
        per period of its highest frequency, or a multiple: half the rate of its own spline, so that the samples
        coincide with its pieces. A record for a shock response spectrum has the same rate.
        """
        random = self._has_random_band and highest_hz > 0.0
        rough = max((body.rough_frequency_hz for body in self.all_bodies.values()), default=0.0)
        rate = max((10.0 if random else 100.0) * highest_hz, 50.0 * rough, 2000.0 / duration)
        rate = min(rate, max(MANY_SAMPLES / duration, (10.0 if random else 20.0) * highest_hz))
        units = (10.0 * highest_hz,) if random else self.excitation.frequencies_hz
        return math.ceil(rate / units[0] * (1.0 - 1e-12)) * units[0] if len(units) == 1 else _round_number(rate)

    def frequency_of_interest_hz(self, highest_hz: float) -> float:
        """Highest frequency, Hz, that the model of a run resolves by default (without ``reduction``).

        It is 50 times the highest frequency of the excitation, Hz (10 times for a random input or a record for a shock
        response spectrum), and at least 64 times a low natural frequency, which is about ten bending modes of a beam:
        peak accelerations at a stop need that many.
        """
        rough = max((body.rough_frequency_hz for body in self.all_bodies.values()), default=0.0)
        return max((10.0 if self._has_random_band else 50.0) * highest_hz, 64.0 * rough)

    @property
    def _has_random_band(self) -> bool:
        """Whether the excitation contains a band of frequencies."""
        return self.excitation.stationary or any(each.kind == "matched" for _, each in self.excitation.items)

    @property
    def all_bodies(self) -> dict[str, Body]:
        """The bodies by name; a single beam or chain is called beam or chain."""
        bodies: dict[str, Body | None] = {"beam": self.beam, "chain": self.chain, **self.bodies}
        return {name: body for name, body in bodies.items() if body is not None}

    @property
    def has_mesh(self) -> bool:
        """Whether a body has a mesh that can be refined."""
        return any(body.refine() is not body for body in self.all_bodies.values())

    @property
    def default_body(self) -> str:
        """Body of places that name none; empty if there are several."""
        bodies = self.all_bodies
        return next(iter(bodies)) if len(bodies) == 1 else ""

    def body_path(self, name: str) -> Path:
        """Path of a body in the scenario."""
        return ("bodies", name) if name in self.bodies else (name,)

    def body_at(self, path: Path) -> str:
        """The body at or above a path; empty if the path is not in a body."""
        return next((name for name in self.all_bodies if (at := self.body_path(name)) == path[: len(at)]), "")

    def refine(self, modes: int) -> Self:
        """A copy with this number of modes and twice as many elements and sides of rings, to estimate errors."""
        bodies = {name: body.refine() for name, body in self.all_bodies.items()}
        named = {name: body for name, body in bodies.items() if name in self.bodies}
        single = {name: body for name, body in bodies.items() if name not in self.bodies}
        stops = tuple([stop.refine() if isinstance(stop, RingStop) else stop for stop in self.snubbers])
        finer = {**single, "bodies": named, "snubbers": stops, "reduction": Reduction(modes=modes)}
        return self.model_copy(update=finer)

    @property
    def is_lasting(self) -> bool:
        """Whether the excitation is steady, so that the motion has mean values."""
        return self.excitation.kind != "none" and not self.excitation.shock

    @property
    def starts_unrelaxed(self) -> bool:
        """Whether a motion starts with Maxwell branches that have not relaxed."""
        return any(isinstance(part, Maxwell) and part.start == "just_mounted" for _, part in walk(self))

    def more_modes(self, mode_count: int) -> str:
        """The reduction setting that gives this number of modes; empty if all are kept."""
        written = self.reduction
        if written is None:
            return f"give reduction: {{modes: {mode_count}}}"
        if written.highest_frequency is not None:
            return f"raise reduction.highest_frequency ({written.highest_frequency:g} Hz)"
        return "" if written.modes == "all" else f"raise reduction.modes to {mode_count}"

    @property
    def bare_dashpots(self) -> tuple[str, ...]:
        """Snubbers with a dashpot, on bodies with a mesh, without a point mass at the contact."""
        return tuple(
            located.item.name
            for located in self.located_snubbers
            if located.item.damping is not None and math.isinf(self.inverse_mass(located))
        )

    def inverse_mass(self, snubber: LocatedItem) -> float:
        """Sum of 1 / m over the places of a snubber on bodies with a mesh, 1/kg, where m is the point mass there.

        It equals the sum of the squared shapes of all modes at the contact: infinite without a point mass.
        """
        bodies, total = self.all_bodies, 0.0
        for place in snubber.item.places:
            body = bodies[place.body or snubber.body]
            if body.refine() is not body:
                point, masses = body.point_of(place), getattr(body, "point_masses", ())
                mass = sum(each.mass for at, each in zip(body.mass_points, masses, strict=True) if at == point)
                total += 1.0 / mass if mass else math.inf
        return total

    def listed(self, *keys: str) -> Iterator[LocatedItem]:
        """Items in these lists of the scenario, then of its bodies and hinges, with their paths."""
        bodies, default = self.all_bodies, self.default_body
        lists: list[tuple[Path, str, Any]] = [((key,), default, getattr(self, key)) for key in keys]
        for name, body in bodies.items():
            lists += [((*self.body_path(name), key), name, getattr(body, key, ())) for key in keys]
        for path, name, items in lists:
            yield from (LocatedItem((*path, index), name, item, bodies) for index, item in enumerate(items))
        for path, item in self._of_hinges(keys) if self.joints else ():
            yield LocatedItem(path, default, item, bodies)

    def _of_hinges(self, keys: Sequence[str]) -> Iterator[tuple[Path, Any]]:
        """Stops and friction of hinges under the keys ``snubbers`` and ``friction``, with their paths."""
        for index, joint in enumerate(self.joints):
            for own in ("all_stops",) * ("snubbers" in keys) + ("all_friction",) * ("friction" in keys):
                for path, item in getattr(joint, own, ()):
                    yield ("joints", index, *path), item

    @property
    def located_snubbers(self) -> tuple[LocatedItem, ...]:
        """All snubbers with paths and bodies: of the scenario, of the bodies, and the stops of hinges.

        Both stops of a pair have the same path.
        """
        return tuple(located._replace(item=stop) for located in self.listed("snubbers") for stop in located.item.stops)

    def located_snubber(self, name: str) -> LocatedItem:
        """The snubber with a name, with its path and body."""
        return next(located for located in self.located_snubbers if located.item.name == name)

    @property
    def joined_by(self) -> tuple[Any, ...]:
        """Joints and springs that are not listed in a body."""
        return (*self.joints, *self.springs_to_ground, *self.springs_between)

    @property
    def nonlinear_springs(self) -> tuple[LocatedItem, ...]:
        """Nonlinear springs and joints, or with Maxwell branches, then friction and parts of rings, with paths."""
        springs = self.listed("springs_to_ground", "springs_between", "joints")
        parts = [at._replace(item=part) for at in self.listed("snubbers") for part in getattr(at.item, "parts", ())]
        return (*(spring for spring in springs if has_own_law(spring.item)), *self.listed("friction"), *parts)

    @property
    def has_cubic_springs(self) -> bool:
        """Whether the motion has no closed form because of a cubic spring."""
        return any(located.item.kind == "cubic" for located in self.nonlinear_springs)

    @property
    def rings(self) -> tuple[RingStop, ...]:
        """The rings."""
        return tuple(stop for stop in self.snubbers if isinstance(stop, RingStop))

    @property
    def all_snubbers(self) -> tuple[Any, ...]:
        """The snubbers of the scenario and of the bodies."""
        return tuple(located.item for located in self.located_snubbers)

    @property
    def has_force_tables(self) -> bool:
        """Whether the force of a snubber is a force-deflection curve."""
        return any(snubber.force_deflection is not None for snubber in self.all_snubbers)

    @property
    def has_smooth_laws(self) -> bool:
        """Whether the curve of a snubber is a table of a law that is not piecewise linear."""
        with_tables = (snubber for snubber in self.all_snubbers if snubber.force_deflection is not None)
        return any(snubber.table.smooth is not None for snubber in with_tables)

    @property
    def requested_outputs(self) -> tuple[tuple[Path, Any], ...]:
        """The outputs with their paths: those of the scenario, then those of the run only."""
        of_run = () if self.run is None else self.run.outputs
        return (
            *((("outputs", k), output) for k, output in enumerate(self.outputs)),
            *((("run", "outputs", k), output) for k, output in enumerate(of_run)),
        )

    def output_unit(self, output: Any) -> str:
        """SI unit of an output; for a row of a recovery matrix the unit given there."""
        dimension = output_dimension(output, self.all_bodies, self.default_body)
        return str(output.unit) if dimension is None else dimension.unit or "1"

    @property
    def output_units(self) -> dict[str, str]:
        """SI unit of each output by its name."""
        return {output.name: self.output_unit(output) for _, output in self.requested_outputs}

    @property
    def base_force(self) -> str | None:
        """Name of the output for the vertical force of the whole base; None if there is none."""
        reactions = (each for each in self.outputs if isinstance(each, ReactionOutput))
        of_base = (each for each in reactions if each.kind == "reaction_force" and each.support == "base")
        return next((each.name for each in of_base if each.direction in (None, "z")), None)

    @property
    def level_unit(self) -> str:
        """SI unit of the excitation's levels; empty if levels are factors or do not exist."""
        if getattr(self.sweep, "profile", ()) or getattr(self.sweep, "profile_file", None):
            return ""
        quantity = getattr(self.excitation, "quantity", None)
        return "" if quantity in (None, FACTOR) else level_unit(quantity)

    @property
    def effective_probes(self) -> tuple[Probe, ...]:
        """The probes; if there are none, the default probes."""
        return self.probes or self._default_probes()

    def _default_probes(self) -> tuple[Probe, ...]:
        """A probe at each place of a snubber, else the default probes of the bodies."""
        several = len(self.all_bodies) > 1
        probes: dict[str, AtPlace] = {}
        for _, body, snubber, _ in sorted(self.listed("snubbers"), key=lambda each: len(each.item.probed_places)):
            for place in snubber.probed_places:
                probed, alone = _on(body if several else None, place), len(snubber.probed_places) == 1
                probes.setdefault(snubber.name if alone else self._probe_name(probed), probed)
        if not probes:
            usual = {name: body.default_probe() for name, body in self.all_bodies.items() if body.has_default_probe}
            for name, (called, place) in usual.items():
                probes[f"{name}_{called}" if several else called] = _on(name if several else None, place)
        return tuple(
            Probe(name=name, at=place)
            if several or place.node is not None or place.row is not None or place.member is not None
            else Probe(name=name, position=place.position, mass=place.mass)
            for name, place in probes.items()
        )

    @property
    def bodies_of_places(self) -> dict[str, dict[str, str]]:
        """Body of each probe and snubber, by section and name (two bodies with a comma)."""
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
        elif place.row is not None:
            named = place.row
        elif place.member is not None:
            named = f"{place.member}_{place.position}_{place.direction or 'z'}"
        elif place.mass is not None:
            named = f"mass_{place.mass}"
        else:
            point = self.all_bodies[place.body or self.default_body].point_of(place)
            named = "_".join(f"{p:g}" for p in (point if isinstance(point, tuple) else (point,)))
        return named if place.body is None else f"{place.body}_{named}"


def _lowest_excited_hz(scenario: Scenario, _: Path) -> float | None:
    """Lowest frequency of the excitation, Hz; for a pulse a thirtieth of its highest."""
    lowest: list[float] = []
    for _path, part in scenario.excitation.items:
        ends = [point[0] for point in getattr(part, "table", ())] or list(part.frequencies_hz)
        ends += part.ends if part.kind == "swept_sine" else [part.highest_frequency_hz / 30.0] * part.shock
        lowest += [min(ends)] if ends else []
    return min(lowest, default=0.0) or None


def _highest_density(scenario: Scenario, path: Path) -> float | None:
    """1 for the first point with the highest acceleration density, so that only this one is checked."""
    owner = next(item for at, item in scenario.excitation.items if ("excitation", *at) == path[: len(at) + 1])
    densities = [point.density or 0.0 for point in owner.psd]
    first = path[-1] == densities.index(max(densities))
    return 1.0 if first and owner.quantity == "acceleration" else None


UsualSizes = Mapping[str, Callable[[Scenario, Path], float | None]]
"""For each reference size, a function that gives it (SI) for a section at a path; None if it does not apply."""
_SIZES: UsualSizes = {
    "": lambda *_: 1.0,
    "excitation": _lowest_excited_hz,
    "highest density": _highest_density,
}
"""Reference sizes that are known without the model."""


def _on(body: str | None, place: AtPlace) -> AtPlace:
    return place if place.body is not None or body is None else place.model_copy(update={"body": body})


def _round_number(least: float) -> float:
    """The next larger number in 1, 2, 5, 10, 20, ..."""
    decade = 10.0 ** math.floor(math.log10(least))
    return next(step * decade for step in (1.0, 2.0, 5.0, 10.0, 20.0) if step * decade >= least * (1.0 - 1e-12))


USED_SECTIONS: dict[str, frozenset[str]] = {
    "run": frozenset({"run", "limits"}),
    "static": frozenset({"limits"}),
    "sweep": frozenset({"sweep", "limits"}),
    "vary": frozenset({"vary", "optimise", "sweep", "run", "limits"}),
    "nnm": frozenset({"nnm"}),
    "identify-stiffness": frozenset({"identify_stiffness"}),
}
"""For each command the sections that it uses, of those that not every command uses (``vary``: sweep of a study)."""


Source = str | FilePath | Mapping[str, Any] | Scenario
"""Anything that a scenario can be read from, see `load_scenario`."""


def scenario_of(source: Source, command: str = "") -> Scenario:
    """The scenario of a source; ``command`` as for `load_scenario`.

    Raises
    ------
    ScenarioError
        As `load_scenario`.
    """
    return source if isinstance(source, Scenario) else load_scenario(source, command=command)


def load_scenario(source: Source, overrides: Overrides = (), *, command: str = "") -> Scenario:
    """Read and check a scenario.

    Parameters
    ----------
    source : path of a YAML file; or YAML text (with a line break, or a brace at its beginning); or a mapping with the
        same content; or a scenario, to be changed.
    overrides : changes that are applied after `extends`: ``{"beam.thickness": "4 mm"}`` or
        ``["beam.thickness=4 mm", "snubbers[0].gap=0.1 mm"]``. An override acts like a file that extends this one:
        mappings are merged, lists and mappings whose ``kind`` changes are replaced, ``null`` (``None``) removes a key,
        so that its default applies.
    command : name of the command, such as ``run`` or ``sweep``: an invalid section that the command does not use is
        then ignored with a warning. By default all sections are checked.

    Returns
    -------
    Scenario
        As written, in SI units.

    Raises
    ------
    ScenarioError
        With every problem: path, message, remedy, file and line.

    Examples
    --------
    >>> import beamsim
    >>> case = beamsim.load_scenario("configs/stops/chain_bumpers.yaml", {"chain.snubbers.bumper.gap": "0.2 mm"})
    >>> case.chain.snubbers[0].gap
    0.0002
    >>> text = "{chain: {masses: [1 kg], springs: [4 kN/m]}, nnm: {mode: 1, energy: 1 J}}"
    >>> beamsim.load_scenario(text).nnm.energy
    1.0
    """
    if isinstance(source, os.PathLike) or (isinstance(source, str) and not _is_yaml(source)):
        path = FilePath(source)
        root, name = resolve_extends(read_file(path), str(path), path.parent, (path.resolve(),)), path.stem
    else:
        root, name = _source_data(source)
    if overrides:
        root = apply_overrides(root, overrides)
    try:
        scenario = _validate(root, name)
        for at, file in named_files(scenario):
            protect(scenario.folder_of(*at) / file)
        return scenario
    except ScenarioError as error:
        if command not in USED_SECTIONS:
            raise
        return _without_unused_sections(root, name, command, error)


def _is_yaml(text: str) -> bool:
    """Whether a text is YAML; otherwise it is the path of a file."""
    return "\n" in text or text.lstrip().startswith("{")


def _source_data(source: str | Mapping[str, Any] | Scenario) -> tuple[WrittenMapping, str]:
    """The data of a source that is not a file, and its name for output files; see `load_scenario`."""
    if isinstance(source, Scenario):
        return _tree_of(source), source.source
    if isinstance(source, Mapping):
        return resolve_extends(from_python(source), None, FilePath()), "scenario"
    if isinstance(source, str):
        return resolve_extends(parse(source, "<text>"), "<text>", FilePath()), "scenario"
    message = f"is a {type(source).__name__}, which no scenario can be read from"
    remedy = "take its scenario" if hasattr(source, "scenario") else "give a path, YAML text or a mapping"
    raise ScenarioError(problem(("scenario",), message, remedy))


def stored_scenario(text: str) -> Scenario:
    """The scenario stored in a result file: complete text, without reference to other files.

    Raises
    ------
    ScenarioError
        If it is not a valid scenario, or extends another one.
    """
    root = parse(text, "<text>")
    if isinstance(root, Mapping) and "extends" in root:
        raise ScenarioError(problem(("extends",), "is not accepted in a stored scenario, which is complete"))
    root = resolve_extends(root, "<text>", FilePath())
    return _validate(root, "scenario")


def _without_unused_sections(root: WrittenMapping, name: str, command: str, error: ScenarioError) -> Scenario:
    """The scenario without sections that a command does not use, if only these are invalid; else raises the error."""
    used = USED_SECTIONS[
        "vary" if command == "sweep" and (root.get("vary") or root.get("optimise")) is not None else command
    ]
    unused = (frozenset().union(*USED_SECTIONS.values()) - used) & root.keys()
    if not all(path_parts(found.path)[:1] and path_parts(found.path)[0] in unused for found in error.problems):
        raise error
    kept = WrittenMapping({key: item for key, item in root.items() if key not in unused})
    kept.mark, kept.marks = root.mark, root.marks
    warnings = tuple(f"left out, since {command} does not use it: {problem}" for problem in error.problems)
    return _validate(kept, name, warnings)


def _tree_of(scenario: Scenario) -> WrittenMapping:
    """The data of a scenario, with file names relative to their original folder."""
    root: WrittenMapping = from_python(as_plain_data(scenario))
    for at, _ in named_files(scenario):
        owner: Any = root
        for part in at[:-1]:
            owner = owner[part]
        owner.marks = {**owner.marks, at[-1]: (str(scenario.folder_of(*at) / f"{scenario.source}.yaml"), None)}
    return root


def _locate(root: WrittenMapping, error: ScenarioError | ValidationError) -> ScenarioError:
    """The errors of data with file and line, in the order of the lines of the first file."""
    problems = error.problems if isinstance(error, ScenarioError) else problems_of(Scenario, error)
    unique = list(dict.fromkeys(located_problem(root, each) for each in problems))
    return ScenarioError(sorted(unique, key=lambda each: (each.file != root.mark[0], each.line or 0)))


def _validate(root: WrittenMapping, name: str, warnings: tuple[str, ...] = ()) -> Scenario:
    """Validate data; raises the errors of all fields, else of all sections, else between sections, with their location.

    Parameters
    ----------
    root : the data.
    name : for output files.
    warnings : about ignored sections.
    """
    written: Counter[tuple[Dimension, str]] = Counter()
    token = UNITS_WRITTEN.set(written)
    try:
        scenario = Scenario.model_validate(root)
    except (ScenarioError, ValidationError) as error:
        raise _locate(root, error) from None
    finally:
        UNITS_WRITTEN.reset(token)
    shown = (scenario.units or DisplayUnits()).complete_from(written)
    if any(getattr(shown, each) is not None for each in DIMENSIONS):
        scenario = scenario.model_copy(update={"units": shown})
    scenario._source, scenario._text, scenario._ignored_sections = name, root, warnings
    return scenario


def template(kind: str = "beam") -> str:
    """A commented scenario that is valid as it stands, as `beamsim new` writes it.

    Parameters
    ----------
    kind : one of `beamsim.kinds.TemplateKind`.
    """
    return (files("beamsim.scenario") / "templates" / f"{kind}.yaml").read_text(encoding="utf-8")
