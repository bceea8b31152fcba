"""A complete scenario: the content of the YAML file, checked and in SI units."""

from __future__ import annotations

import math
from pathlib import Path as FilePath
from typing import Any, ClassVar

from beamsim.errors import ScenarioError
from beamsim.scenario import checks
from beamsim.scenario.base import Path, Schema, UnknownValueError, known
from beamsim.scenario.beam import Beam
from beamsim.scenario.body import Body, Located
from beamsim.scenario.chain import Chain
from beamsim.scenario.designs import Vary
from beamsim.scenario.excitation import Excitation, NoExcitation
from beamsim.scenario.identification import IdentifyStiffness
from beamsim.scenario.limits import Limits
from beamsim.scenario.names import named
from beamsim.scenario.nnm import NonlinearMode
from beamsim.scenario.place import ConstantForce, Probe
from beamsim.scenario.quantities import Gravity, Text
from beamsim.scenario.run import Reduction, Run
from beamsim.scenario.snubber import ChainSnubber, LinkSnubber, Snubber
from beamsim.scenario.sweep import Sweep
from beamsim.scenario.tree import Node, locate, located, path_parts
from beamsim.scenario.warnings import MANY_SAMPLES, doubts


class Scenario(Schema):
    """A structure with its one-sided stops, its excitation and the requested analyses."""

    title: Text = ""
    """Title for tables and plots."""
    beam: Beam | None = None
    """The structure, if it is a beam."""
    chain: Chain | None = None
    """The structure, if it is a chain of masses."""
    snubbers: tuple[Snubber, ...] = ()
    """One-sided stops on the beam (those of a chain are listed in it)."""
    gravity: Gravity = 0.0
    """Acceleration of gravity, towards negative displacement."""
    constant_forces: tuple[ConstantForce, ...] = ()
    """Dead loads."""
    excitation: Excitation = NoExcitation()
    """Excitation of the structure; none by default."""
    probes: tuple[Probe, ...] = ()
    """Points whose motion is recorded; by default one at each snubber (on both masses it acts between)."""
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

    def settle(self) -> None:
        """Resolve defaults that need the whole, then check the parts against each other."""
        if known(self.snubbers):
            self.resolve("snubbers", named(self.snubbers, "snubber"))
        if self.beam is not None and known(self.beam) and known(self.beam.length):
            self._snap_to_end(self.beam.length)
        if known(self.run, self.excitation, self.beam, self.chain):
            self._choose_sample_rate()
        problems = checks.problems(self)
        if problems:
            raise ScenarioError(problems)
        self._plain_sweep_levels()

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Scenario):
            return NotImplemented
        return self.__dict__ == other.__dict__

    def __hash__(self) -> int:
        return hash(tuple(self.__dict__[name] for name in type(self).model_fields))

    # The origin is not part of the scenario: equality and YAML ignore it.
    _source: str = "scenario"
    _text: Node | None = None

    @property
    def source(self) -> str:
        """Name for output files: the scenario file's stem, or ``scenario``."""
        return self._source

    def with_source(self, source: str, text: Node | None = None) -> Scenario:
        """Return the same scenario with another name for output files, and the tree that it was read from."""
        copy = self.model_copy()
        copy._source = source
        copy._text = text
        return copy

    def located(self, error: ScenarioError) -> ScenarioError:
        """Return the error with the file and line of every path, for problems that only the model could find."""
        if self._text is None:
            return error
        root = self._text
        return ScenarioError([located(root, path_parts(problem.path), problem) for problem in error.problems])

    def folder_of(self, *path: str | int) -> FilePath:
        """Folder of the file in which a value is written; the current one where it was read from no file."""
        file = None if self._text is None else locate(self._text, path)[0]
        return FilePath(file).parent if file else FilePath()

    @property
    def automatic_sample_rate(self) -> bool:
        """Whether the run's sample rate was chosen here, not by who wrote the scenario."""
        run = None if self._text is None else self._text.plain().get("run")
        return isinstance(run, dict) and run.get("sample_rate") is None

    @property
    def all_bodies(self) -> dict[str, Body]:
        """The bodies by name."""
        bodies: dict[str, Body | None] = {"beam": self.beam, "chain": self.chain}
        return {name: body for name, body in bodies.items() if body is not None}

    body_sections: ClassVar[tuple[str, ...]] = ("beam", "chain")
    """Sections that hold bodies."""

    def body_path(self, name: str) -> Path:
        """Where a body is written."""
        return (name,)

    @property
    def located_snubbers(self) -> tuple[Located, ...]:
        """The snubbers with their paths and bodies: those of the scenario, then those listed in the bodies."""
        bodies = self.all_bodies
        default = next(iter(bodies), "")
        shared = (Located(("snubbers", k), default, snubber) for k, snubber in enumerate(self.snubbers))
        own = (
            Located((*self.body_path(name), "snubbers", k), name, snubber)
            for name, body in bodies.items()
            for k, snubber in enumerate(body.own_snubbers)
        )
        return (*shared, *own)

    def located_snubber(self, name: str) -> Located:
        """The snubber with this name, its path and its body."""
        return next(located for located in self.located_snubbers if located.item.name == name)

    @property
    def nonlinear_springs(self) -> tuple[Located, ...]:
        """The nonlinear springs of all bodies, with their paths."""
        return tuple(
            Located((*self.body_path(name), *path), name, spring)
            for name, body in self.all_bodies.items()
            for path, spring in body.nonlinear_springs()
        )

    @property
    def all_snubbers(self) -> tuple[Any, ...]:
        """The snubbers of the scenario and those listed in the bodies."""
        return tuple(located.item for located in self.located_snubbers)

    @property
    def effective_probes(self) -> tuple[Probe, ...]:
        """The probes; without any, one at each snubber, else at a free end or the last mass."""
        if self.probes:
            return self.probes
        if self.chain is not None:
            if self.chain.snubbers:
                return _probes_of(self.chain.snubbers)
            return (Probe(name=f"mass_{self.chain.count}", mass=self.chain.count),)
        if self.snubbers:
            return tuple(Probe(name=snubber.name, position=snubber.position) for snubber in self.snubbers)
        assert self.beam is not None
        moving = ("free", "guided")
        if self.beam.supports.right in moving:
            return (Probe(name="right_end", position=self.beam.length),)
        if self.beam.supports.left in moving:
            return (Probe(name="left_end", position=0.0),)
        return (Probe(name="middle", position=self.beam.length / 2.0),)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about values that are allowed but questionable, one sentence each."""
        return tuple(doubts(self))

    def to_yaml(self) -> str:
        """Return the resolved scenario as YAML: SI numbers, defaults filled in; it loads to an equal scenario."""
        from beamsim.scenario.export import to_yaml

        return to_yaml(self)

    def _choose_sample_rate(self) -> None:
        """Fill in a sample rate: 100 samples a period of the excitation, more if the structure or a short run needs it.

        With a single frequency the samples of a period are a whole number, so that spectra of whole periods
        have no leakage. Long runs at high frequency are sampled down to 20 a period.
        """
        run = self.run
        if run is None or run.sample_rate is not None:
            return
        try:
            highest = self.excitation.highest_frequency_hz
            rate = max(100.0 * highest, 50.0 * self._rough_frequency_hz(), 2000.0 / run.duration)
            rate = min(rate, max(MANY_SAMPLES / run.duration, 20.0 * highest))
            tones = self.excitation.frequencies_hz
            rate = _whole_multiple(rate, tones[0]) if len(tones) == 1 else _round_number(rate)
        except (UnknownValueError, ArithmeticError, ValueError):  # what is wrong is reported where it is
            return
        self.resolve("run", run.model_copy(update={"sample_rate": rate}))

    def _rough_frequency_hz(self) -> float:
        """Return the order of magnitude of a low natural frequency, Hz."""
        if self.beam is not None:
            beam = self.beam
            return math.pi / 2.0 * math.sqrt(beam.bending_stiffness / beam.mass_per_length) / beam.length**2
        if self.chain is None:
            return 0.0
        return math.sqrt(self.chain.stiffest_spring / min(self.chain.masses)) / (2.0 * math.pi)

    def _plain_sweep_levels(self) -> None:
        """Forget the units of the sweep's levels, which are those of the excitation."""
        if self.sweep is not None:
            self.resolve("sweep", self.sweep.plain_levels())

    def _snap_to_end(self, length: float) -> None:
        """Put on the end what is beyond it by round-off (3 ft and 36 in differ in the last digit)."""
        for name in ("beam", "snubbers", "constant_forces", "excitation", "probes", "run"):
            self.resolve(name, _snapped(self.__dict__[name], length))


def _probes_of(snubbers: tuple[ChainSnubber, ...]) -> tuple[Probe, ...]:
    """Return a probe at each snubber on a mass, and one on every mass that a snubber between two acts on."""
    probes = {snubber.name: snubber.mass for snubber in snubbers if not isinstance(snubber, LinkSnubber)}
    for snubber in snubbers:
        for mass in snubber.between if isinstance(snubber, LinkSnubber) else ():
            probes.setdefault(f"mass_{mass}", mass)
    return tuple(Probe(name=name, mass=mass) for name, mass in probes.items())


def _whole_multiple(least: float, unit: float) -> float:
    return math.ceil(least / unit * (1.0 - 1e-12)) * unit


def _round_number(least: float) -> float:
    """Return the next of 1, 2, 5, 10, 20, ..."""
    decade = 10.0 ** math.floor(math.log10(least))
    return next(step * decade for step in (1.0, 2.0, 5.0, 10.0, 20.0) if step * decade >= least * (1.0 - 1e-12))


def _snapped(value: object, length: float) -> object:
    if isinstance(value, tuple):
        items = tuple(_snapped(item, length) for item in value)
        return items if any(new is not old for new, old in zip(items, value, strict=True)) else value
    if not isinstance(value, Schema):
        return value
    changed: dict[str, object] = {}
    for name, old in value.__dict__.items():
        new = _snapped(old, length)
        if name == "position" and isinstance(old, float) and length < old <= length * (1.0 + 1e-12):
            new = length
        if new is not old:
            changed[name] = new
    return value.model_copy(update=changed) if changed else value
