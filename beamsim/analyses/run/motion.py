"""The motion of a run: what is computed of it, how it is marched and evaluated in one pass, and what that leaves.

Every chunk of a motion in closed form is marched, evaluated once and forgotten.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple, Self, TypeVar

import numpy as np

from beamsim.analyses.run.fatigue import PlateStress, StressObserver
from beamsim.analyses.run.impacts import ImpactObserver
from beamsim.analyses.run.layouts import EVENTS
from beamsim.errors import Problem, ScenarioError, locating
from beamsim.flow.channels import channel_extrema, outputs_of
from beamsim.flow.compiled import processor_time
from beamsim.flow.exact import ExactFlow, exact_flow
from beamsim.flow.reference import ReferenceTrajectory
from beamsim.flow.trajectory import EVENT_LIMIT, Trajectory
from beamsim.flow.transient import MotionInChunks
from beamsim.inputs.excitation import highest_excited_hz
from beamsim.inputs.signal import common_record
from beamsim.labelled import Dataset
from beamsim.outcomes import Interrupted, Outcome, Progress, Stop, check_stop, never, part_of, stop_requests
from beamsim.responses.energies import EnergyBalance, EnergyHistory, energies_of_segments
from beamsim.responses.histories import Histories, HistoryRecorder, LowPassed, samples_until, times_reached
from beamsim.responses.jumps import ForceJumps, jumps_of_motion
from beamsim.results.values import (
    ACCELERATION,
    ALWAYS_THERE,
    BY_ENTRY,
    FORCE,
    PENETRATION,
    STRESS,
    VALUES,
    Extreme,
    Extremes,
    by_magnitude,
    extreme_times,
    merge_extremes,
    parse_limit,
    searched_channels,
)
from beamsim.scenario import Scenario
from beamsim.scenario.run import Run
from beamsim.signals.filters import filter_outputs
from beamsim.structures.places import COMPONENTS
from beamsim.system.equations import ChannelSet, Key
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats, not_none

Value = TypeVar("Value")

STRESS_ENTRIES = ("largest_bending_stress_pa", "largest_bending_stress_position_m")
ROOT_MEAN_SQUARES = tuple(entry for entry, value in BY_ENTRY.items() if value.quantity and entry.startswith("rms_"))
BYTES_A_PIECE = 2000  # that a motion which is kept needs for each piece of its input
CHUNK_SHARE = 0.064  # of the memory, for the pieces of a chunk
FEWEST_PIECES = 4096  # in a chunk
COMPARED_SHARE = 0.2  # for those of the first part, which is compared with that of a finer model
SPECTRUM_SHARE = 0.25  # for those of the last part, of which there are spectra
MOTION_SHARE, HISTORIES_SHARE = 0.5, 0.3  # for the motion (joined, it is there twice), and for its samples
GRACE_S = 0.7
"""Processor time after an interruption in which a motion that was marched is evaluated as a whole, so that it is kept
as a whole; the same again for its histories."""
KEPT_S = 0.25
"""Processor time after that in which the first part of a longer motion is evaluated, which is kept."""
FEWEST_SEGMENTS = 64  # of a motion, that are evaluated whatever time that takes


class TimeShares(NamedTuple):
    """Shares of the processor time of a run that have passed after each of its steps."""

    march: float
    extremes: float
    histories: float
    own_model: float  # of the time with a finer model: after all steps with the model of the run


TIME_SHARES = {False: TimeShares(0.01, 0.2, 0.8, 0.6), True: TimeShares(0.12, 0.56, 0.68, 0.2)}
"""About as they were measured of swept sines, and where the input is stationary of a random run."""


@dataclass(frozen=True)
class Needed:
    """Which parts of a run are computed: everything, or as much as some entries of its summary take.

    How a run is judged does not depend on it: outcome, warnings and margins are the same whatever is needed.

    Parameters
    ----------
    entries : of the summary, those that limits are compared with among them; None for everything, with histories,
        spectra and shapes.
    statistics : whether the statistics of a stationary response are.
    root_mean_squares : whether those of any other response, which belong to its spectra, are.
    every_station : whether the largest stress of every station is, not only the largest of all.
    derived : whether what is taken of the motion while it is marched is: histories, impacts, fatigue, plates.
    state_times : (nt,) s, increasing, at which states are; none by default.
    """

    entries: frozenset[str] | None = None
    statistics: bool = True
    root_mean_squares: bool = True
    every_station: bool = True
    derived: bool = True
    state_times: Floats = field(default_factory=lambda: np.zeros(0), compare=False)

    @classmethod
    def of(cls, scenario: Scenario, entries: Collection[str]) -> Self:
        """The parts that some entries of the summary, the limits and the settings of a scenario need.

        Parameters
        ----------
        scenario : with a ``run`` section.
        entries : of the summary.
        """
        settings, stationary = not_none(scenario.run), scenario.excitation.stationary
        limits = {} if scenario.limits is None else scenario.limits.values_by_name
        over_curves = {"srs_over_limit", "psd_over_limit"}  # which only limits have
        needed = (frozenset(entries) - over_curves) | {parse_limit(name)[0].entry for name in limits}
        if settings.fatigue is not None:
            needed |= set(STRESS_ENTRIES)
        of_records = needed & {*ROOT_MEAN_SQUARES, "psd_over_limit"}
        statistics = stationary and (bool(of_records) or settings.test_duration is not None)
        return cls(
            needed,
            statistics,
            not stationary and not needed.isdisjoint(ROOT_MEAN_SQUARES),
            settings.fatigue is not None,
        )

    def has(self, *entries: str) -> bool:
        """Whether one of some entries of the summary is needed."""
        return self.entries is None or not self.entries.isdisjoint(entries)

    def searched_channels(self, channels: ChannelSet) -> ChannelSet:
        """The channels whose extremes some entries take; warnings need those of probes and snubbers in any case."""
        entries = not_none(self.entries) | ({STRESS_ENTRIES[0]} if self.has(*STRESS_ENTRIES) else set())
        values = [value for value in VALUES if value.section in ALWAYS_THERE or value.entry in entries]
        return channels.select(
            lambda each: each.key == PENETRATION or any(value.is_extreme_of(each) for value in values)
        )


EVERYTHING = Needed()
MOTION_ALONE = Needed(derived=False, every_station=False)


@dataclass
class Evaluation:
    """Evaluation of a motion step by step; after an interruption the remaining steps are left out.

    Parameters
    ----------
    stop : asked before and during every step whether to leave it out.
    """

    stop: Stop
    left_out: list[str] = field(default_factory=list)  # what is missing

    def compute(self, what: str, compute: Callable[[], Value], instead: Value, minor: bool = False) -> Value:
        """The result of a step; ``instead`` if it is left out.

        Parameters
        ----------
        what : is noted as missing.
        compute, instead : the result.
        minor : whether it is noted only where nothing before it is left out.
        """
        with suppress(Interrupted), stop_requests(self.stop, at_once=True):
            if not self.left_out:
                check_stop()
                return compute()
        if not (minor and self.left_out):
            self.left_out.append(what)
        return instead


class Work(NamedTuple):
    """Work of the solver."""

    events: int  # of contacts, those of springs and friction included
    evaluations: int  # of the event functions
    segments: int  # between events
    states: int  # of contacts, that were diagonalised
    processor_time_s: float


@dataclass
class RunMotion:
    """The motion of a run, from the closed form or from time stepping."""

    system: StructuralSystem
    method: str
    marched: MotionInChunks | ReferenceTrajectory
    outcome: Outcome
    energy_error: float  # of the balance, relative
    extremes: Extremes
    extreme_states: Floats  # (2, 2n) at `extreme_times`
    contact_share: Floats
    histories: Histories | None = None  # at the output times
    contact: LargestContact | None = None  # of several bodies
    states: Floats | None = None  # (nt, 2n or more) at the times that were asked for; of a time-stepped motion none
    low_passed: Floats | None = None  # (nt or more, probes) acceleration behind the filter, where there is one
    trajectory: Trajectory | None = None  # of the closed form, its last part where not all is kept
    impacts: ImpactObserver | None = None
    stresses: StressObserver | None = None
    plates: PlateStress | None = None
    memory: Mapping[str, int] = field(default_factory=dict)  # entries of the summary
    compared_s: float | None = None  # s, first part that is compared with a finer model, where not all is kept
    warnings: tuple[str, ...] = ()
    known: Trajectory | Histories = field(init=False)  # the closed form, or time stepping at the output times
    work: Work = field(init=False)  # of the solver
    events: Dataset = field(init=False)  # contacts of the snubbers made and ended, without breakpoints of their tables

    def __post_init__(self) -> None:
        """Say what the march took, and when contacts were made and ended."""
        of, count = self.marched, len(self.system.snubbers)  # contacts with higher numbers are springs and friction
        self.known = self.trajectory or not_none(self.histories)
        self.work = Work(of.event_time.size, of.evaluations, of.segments, of.states, of.processor_time_s)
        chosen = (of.event_contact < count) & (of.touch_changes != 0)
        events = {
            "event": np.arange(1, chosen.sum() + 1), "time": of.event_time[chosen],
            "snubber": of.event_contact[chosen], "closing": (of.touch_changes > 0)[chosen],
        }  # fmt: skip
        self.events = EVENTS.dataset(events)

    @cached_property
    def jumps(self) -> list[ForceJumps]:
        """Those of the forces that may jump; of a time-stepped motion they are not known."""
        found = self.trajectory is not None and self.system.forces_that_jump
        return [*jumps_of_motion(self.system, not_none(self.trajectory))] if found else []

    @property
    def breakpoints(self) -> int:
        """Number of breakpoints of piecewise-linear springs that are passed, the start left out."""
        rubbing = np.isin(self.marched.event_contact, self.system.friction_contacts)
        of_spring = (self.marched.event_contact >= len(self.system.snubbers)) & ~rubbing
        return int(np.sum(of_spring & (self.marched.event_time > 0)))


def steps_in_time(system: StructuralSystem, settings: Run) -> bool:
    """Whether the motion is marched in time steps."""
    return settings.method == "reference" or system.cubic is not None


def output_times(scenario: Scenario) -> Floats:
    """(nt,) s, the times at which the motion of a run is asked for."""
    rate = scenario.sample_rate_up_to(highest_excited_hz(scenario))
    return np.asarray(np.arange(samples_until(not_none(scenario.run).duration, rate)) / rate)


def motion_in_chunks(
    system: StructuralSystem,
    settings: Run,
    *,
    most_events: int | None = None,
    progress: Callable[[float], None] | None = None,
    stop: Callable[[], bool] = never,
) -> tuple[MotionInChunks, str]:
    """The motion of a run, to be marched, and the setting that limits its events.

    It is one chunk where its input has no more pieces than the motion between them has room for in the memory.

    Parameters
    ----------
    system, settings : of the run.
    most_events : by default as many as the settings allow and the memory has room for.
    progress, stop : see `beamsim.flow.transient.simulate`.

    Returns
    -------
    motion, limit
        At its start; the path of the setting in the scenario.

    Raises
    ------
    ScenarioError
        If a motion of one chunk has an input of too many pieces.
    """
    record, at_once = common_record(system.forcing.signal), None  # of which all loads are made
    pieces = 0 if record is None else record.pieces
    if pieces * BYTES_A_PIECE > MOTION_SHARE * settings.memory:
        at_once = max(int(CHUNK_SHARE * settings.memory / BYTES_A_PIECE), FEWEST_PIECES)
    flow = exact_flow(
        system, settings.duration, settings.most_contact_states, settings.memory,
        None if at_once is None else (0, min(at_once, pieces)),
    )  # fmt: skip
    room = int(MOTION_SHARE * settings.memory / (2 * 8 * (flow.size + 8)))  # events, with the motion between them
    most = min(settings.max_events, room) if most_events is None else most_events
    if at_once is None:  # what is marched as a whole is evaluated afterwards
        progress = part_of(progress, 0.0, TIME_SHARES[system.scenario.excitation.stationary].march)
    motion = MotionInChunks(flow, system.initial_state, at_once, max_events=most, progress=progress, stop=stop)
    return motion, "run.max_events" if settings.max_events <= room else "run.memory"


def refuse_long_histories(system: StructuralSystem, settings: Run, samples: int) -> None:
    """Refuse histories that do not fit into their share of the memory.

    Parameters
    ----------
    system, settings : of the run.
    samples : number of output times.

    Raises
    ------
    ScenarioError
        Before anything is computed, with the memory that they need.
    """
    probes, filtered_too = len(system.probes), settings.low_pass is not None
    # the time, three energies, both of the base; absolute displacements of probes
    columns = system.channels.without(STRESS).order.size + 6 + probes * (2 if filtered_too else 1)
    needed = samples * (8 * columns + system.dynamics.contacts.count)
    if needed > HISTORIES_SHARE * settings.memory:
        raise ScenarioError(_too_long_histories(samples, columns, needed, settings.memory))


def _too_long_histories(samples: int, columns: int, needed: int, memory: float) -> Problem:
    """Histories of samples with some columns need more bytes than their share of the memory."""
    factor, enough = needed / (HISTORIES_SHARE * memory), needed / HISTORIES_SHARE / 1e9
    return Problem(
        "run.sample_rate",
        f"gives histories of {samples} samples with {columns} values each, {needed / 1e9:.3g} GB, more than "
        f"{100 * HISTORIES_SHARE:.0f} % of run.memory = {memory:.3g} bytes",
        f"give run.memory: {math.ceil(10 * enough) / 10:g} GB, or a sample rate that is lower by a factor of "
        f"{math.ceil(10 * factor) / 10:g} (peaks, events and spectra do not depend on it)",
    )


def _refuse_what_needs_all(system: StructuralSystem, settings: Run) -> None:
    """Refuse what needs the whole motion, which does not fit into the memory."""
    needed = {"run.srs": settings.srs is not None, "friction": system.friction_contacts.size > 0}
    problems = [
        Problem(
            name,
            f"needs the whole motion in memory, and that does not fit into run.memory = {settings.memory:.3g} bytes",
            "raise run.memory, shorten run.duration, or leave it out",
        )
        for name, asked in needed.items()
        if asked
    ]
    if problems:
        raise ScenarioError(problems)


def exact_motion_of(
    system: StructuralSystem,
    settings: Run,
    times: Floats,
    progress: Callable[[float], None] | None,
    stop: Callable[[], bool],
    needed: Needed = EVERYTHING,
) -> RunMotion:
    """The motion in closed form, marched and evaluated in one pass.

    Parameters
    ----------
    system, settings : of the run.
    times : (nt,) s, at which it is asked for.
    progress, stop : see `beamsim.flow.transient.simulate`.
    needed : what is taken of it.

    Returns
    -------
    RunMotion
        Up to where it ended.

    Raises
    ------
    ScenarioError
        Where what is asked for needs more memory, pieces of the input or panels of a filter than there may be.
    """
    march, limit = motion_in_chunks(system, settings, progress=progress, stop=stop)
    flow, latest = march.flow, None if march.one_chunk else _LatestPart.of(march, system, settings)
    sampled = needed.derived and (needed.entries is None or needed.statistics)
    shares = TIME_SHARES[system.scenario.excitation.stationary]
    extremes, samples = (
        part_of(progress if march.one_chunk else None, shares.march, shares.extremes if sampled else 1.0),
        part_of(progress if march.one_chunk else None, shares.extremes, shares.histories),
    )
    channels = system.channels.without(STRESS)
    recorder = HistoryRecorder(flow, channels, times, GracePeriod(stop), samples) if sampled else None
    impacts, stresses, plates = _longer(system, settings, times, needed, stop) if needed.derived else (None, None, None)
    states = _StateRecorder(needed.state_times) if needed.state_times.size else None
    values = ChunkValues(system, settings, flow, times, needed)
    with locating({"duration": "run.duration"}):
        for part in _evaluate_chunks(march, values, GracePeriod(stop), extremes):
            for observer in (recorder, impacts, stresses, plates, latest, states):
                if observer is not None:
                    observer.add(part)
    return RunMotion(
        system=system, method="exact", outcome=values.balance.check(with_limit(march.outcome, limit)), marched=march,
        energy_error=values.balance.error, extremes=values.extremes, extreme_states=values.extreme_states,
        contact_share=march.contact_share, histories=None if recorder is None else recorder.histories,
        contact=values.contact, states=None if states is None else states.states,
        low_passed=None if values.low_passed is None else values.low_passed.values,
        trajectory=part if latest is None else latest.trajectory, impacts=impacts, stresses=stresses, plates=plates,
        memory={"memory_bytes": round(settings.memory)}
        | ({"contact_states_kept": len(flow.states)} if flow.has_dropped_states else {}),
        **({} if latest is None else latest.fields(march, settings)),
    )  # fmt: skip


def _evaluate_chunks(
    march: MotionInChunks, values: ChunkValues, overdue: GracePeriod, progress: Progress
) -> Iterator[Trajectory]:
    """March a motion; its chunks, whose values are included, up to where these take too long after an interruption."""
    for chunk in march.chunks():
        try:
            with stop_requests(overdue, at_once=True, progress=progress):
                part, found = chunk, values.compute(chunk)
        except Interrupted:
            part, found = values.computed_of_beginning(chunk)
            march.end_with(part)
        values.include(part, *found)
        yield part


class _StateRecorder:
    """States of a motion that is given chunk by chunk, at (nt,) increasing times, s."""

    def __init__(self, times: Floats) -> None:
        self._times, self._known, self._of_chunks = times, 0, list[Floats]()

    def add(self, chunk: Trajectory) -> None:
        """Take the states at the times in the next chunk."""
        first, self._known = self._known, times_reached(chunk.end, self._times).size
        self._of_chunks.append(chunk.states_at(np.minimum(self._times[first : self._known], chunk.end)))

    @property
    def states(self) -> Floats:
        """(nt, 2n or more), up to where the motion ended."""
        return np.concatenate(self._of_chunks)


class _LatestPart:
    """The last part of a motion that is given chunk by chunk and does not fit into the memory.

    Parameters
    ----------
    length_s : s, of the part.
    compared_s : s, length of the first part, which is compared with a finer model.
    """

    def __init__(self, length_s: float, compared_s: float) -> None:
        self.length_s, self.compared_s, self._chunks = length_s, compared_s, list[Trajectory]()

    @classmethod
    def of(cls, march: MotionInChunks, system: StructuralSystem, settings: Run) -> _LatestPart:
        """That of which there are spectra; raises ScenarioError where something needs the whole motion."""
        _refuse_what_needs_all(system, settings)
        kept_s = settings.memory / BYTES_A_PIECE * not_none(march.flow.record).step  # of a motion that fits
        return cls(min(SPECTRUM_SHARE * kept_s, settings.spectrum.last or math.inf), COMPARED_SHARE * kept_s)

    def add(self, chunk: Trajectory) -> None:
        """Keep the next chunk, and of those before it what belongs to the part."""
        self._chunks = [each for each in self._chunks if each.end > chunk.end - self.length_s] + [chunk]

    def fields(self, march: MotionInChunks, settings: Run) -> dict[str, Any]:
        """Fields of the result of a march that depend on the part."""
        return {"compared_s": self.compared_s, "warnings": (_memory_note(march, settings, self),)}

    @property
    def trajectory(self) -> Trajectory:
        """The part, shorter where the motion ended early."""
        whole = self._chunks[0] if len(self._chunks) == 1 else Trajectory.join(self._chunks)
        begin = whole.end - self.length_s
        return whole.extract(begin, whole.end) if begin > whole.time[0] else whole


def _longer(
    system: StructuralSystem, settings: Run, times: Floats, needed: Needed, stop: Stop
) -> tuple[ImpactObserver | None, StressObserver | None, PlateStress | None]:
    """Observers of chunks that take longer than the values of the motion itself."""
    everything, plates = needed.entries is None, any(body.moments == len(COMPONENTS) for body in system.bodies)
    return (
        ImpactObserver(system, stop) if everything and settings.impacts is not None else None,
        StressObserver(system, stop) if settings.fatigue is not None and system.stress is not None else None,
        PlateStress(system, times, stop) if everything and plates else None,
    )


def _memory_note(march: MotionInChunks, settings: Run, latest: _LatestPart) -> str:
    """A note that a motion exceeds the memory, and that spectra are of its last part."""
    kept = f"the motion is kept {march.chunk_s:.3g} s at a time (run.memory = {settings.memory:.3g} bytes)"
    if march.outcome.interrupted:
        return kept
    kept += f"; spectra and rms_* are those of the last {min(latest.length_s, march.end):.3g} s"
    if settings.convergence != "off":
        kept += f", a finer model is compared on the first {latest.compared_s:.3g} s"
    return kept


@dataclass
class GracePeriod:
    """Whether more than `GRACE_S` of processor time was spent since an interruption was noticed.

    Parameters
    ----------
    stop : says whether there was one.
    """

    stop: Stop
    since: float = math.inf

    def __call__(self) -> bool:
        """Whether to give up."""
        if not self.stop():
            return False
        self.since = min(self.since, processor_time())
        return processor_time() - self.since > GRACE_S


Computed = tuple[tuple[Floats, EnergyHistory, float], dict[Key, Extreme], LowPassed | None]
"""Of a chunk: what its energy balance follows from, its extremes, and the filter at its end."""


class ChunkValues:
    """Reported values of a motion, collected chunk by chunk: peaks, states at peaks, energy balance.

    Parameters
    ----------
    system, settings : of the run.
    flow : of the motion.
    times : (nt,) s, all output times.
    needed : which extremes are searched for.
    """

    def __init__(
        self, system: StructuralSystem, settings: Run, flow: ExactFlow, times: Floats, needed: Needed = EVERYTHING
    ) -> None:
        self.system, self.balance, self.extremes = system, EnergyBalance(), dict[Key, Extreme]()
        self.extreme_states, self._extreme_times = np.zeros((2, flow.size)), np.full(2, np.nan)
        self.contact: LargestContact | None = None
        self.low_passed: LowPassed | None = None
        channels = (
            searched_channels(system.channels) if needed.entries is None else needed.searched_channels(system.channels)
        )
        if settings.low_pass is not None:  # extremes of accelerations are those behind the filter
            channels = channels.without(ACCELERATION)
            self.low_passed = LowPassed(settings.low_pass, times, len(system.probes))
            self._accelerations = outputs_of(flow, system.channels.of_keys(ACCELERATION).linear)
        self._largest_alone = STRESS if STRESS in channels.places and not needed.every_station else None
        self._channels = channels

    def compute(self, chunk: Trajectory) -> Computed:
        """The values of the next chunk, which is not included yet: that takes no time, and is not interrupted."""
        energies, low = energies_of_segments(chunk), None
        found = self._channels.split(np.array(channel_extrema(chunk, self._channels, self._largest_alone)[:4]))
        if self.low_passed is not None:
            low = self.low_passed.copy()
            hz, through = low.frequency_hz, low.filter
            low.add(chunk.end, lambda times: filter_outputs(chunk, self._accelerations, hz, times, through))
        return energies, found, low

    def computed_of_beginning(self, chunk: Trajectory) -> tuple[Trajectory, Computed]:
        """The part of the next chunk that can be evaluated in `KEPT_S`, and its values."""
        begin, segments = processor_time(), FEWEST_SEGMENTS
        while True:
            part = chunk.select(slice(0, segments))
            found = self.compute(part)
            if segments >= chunk.time.size or processor_time() - begin > KEPT_S:
                return part, found
            segments *= 2

    def include(
        self, chunk: Trajectory, energies: tuple[Floats, EnergyHistory, float], found: dict[Key, Extreme],
        low: LowPassed | None,
    ) -> None:  # fmt: skip
        """Include the next chunk with its values, and look up its states where it has new extremes."""
        self.balance.add(*energies)
        self.extremes = {name: merge_extremes(self.extremes.get(name), each) for name, each in found.items()}
        self.low_passed = low
        if low is not None and low.extremes is not None:
            self.extremes[ACCELERATION] = low.extremes
        times = extreme_times(self.extremes)
        self.extreme_states = self.extreme_states[: times.size]
        for k in np.flatnonzero(times != self._extreme_times[: times.size]).tolist():
            self._extreme_times[k], self.extreme_states[k] = times[k], chunk.states_at(times[[k]])[0]
        if len(self.system.bodies) > 1 and self.system.snubbers:
            self._include_contact(chunk)

    def _include_contact(self, chunk: Trajectory) -> None:
        """Look up the openings of several bodies in the next chunk, where the largest contact force is in it."""
        largest = largest_contact(self.system, self.extremes)
        if largest is not None and (self.contact is None or largest.time != self.contact.time):
            at, flow = np.array([largest.time]), chunk.flow
            opening = chunk.sample(at, lambda phases: flow.at(phases).openings)[0]
            self.contact = largest._replace(state=chunk.states_at(at)[0], opening=opening)


class LargestContact(NamedTuple):
    """The largest contact force of a motion, and the motion then."""

    snubber: int
    force: float  # N
    time: float  # s
    state: Floats = np.zeros(0)  # (2n or more,)
    opening: Floats = np.zeros(0)  # (snubbers or more,) distances to the faces


def largest_contact(system: StructuralSystem, extremes: Extremes) -> LargestContact | None:
    """That of a structure with snubbers; None without contact."""
    forces, times = by_magnitude(system.channels.of_keys(FORCE).channels, extremes[FORCE])[2:]
    forces = np.where([s.gap_unit == "m" for s in system.snubbers], forces, 0.0)  # moments have no place in the sketch
    at = int(forces.argmax())
    return LargestContact(at, float(forces[at]), float(times[at])) if forces[at] > 0.0 else None


def with_limit(outcome: Outcome, limit: str = "run.max_events") -> Outcome:
    """The outcome, with the key of the scenario that limits the events."""
    if outcome.code != EVENT_LIMIT:
        return outcome
    return outcome.copy_with(remedy=f"raise {limit}, or check for a chattering contact")
