"""Motion of a run: which parts are computed, and marching with evaluation in one pass.

Every chunk of a motion in closed form is marched, evaluated once, and discarded.
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
    UNSAMPLED,
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
BYTES_A_PIECE = 2000  # memory per piece of the input if the motion is kept
CHUNK_SHARE = 0.064  # of the memory, for the pieces of a chunk
FEWEST_PIECES = 4096  # in a chunk
COMPARED_SHARE = 0.2  # for the pieces of the first part, which is compared with a finer model
SPECTRUM_SHARE = 0.25  # for the pieces of the last part, which has spectra
MOTION_SHARE, HISTORIES_SHARE = 0.5, 0.3  # for the motion (twice while it is joined), and for its samples
GRACE_S = 0.7
"""Processor time after an interruption, s, in which a marched motion is evaluated completely and therefore kept; the
same again for its histories."""
BEGINNING_S = 0.25
"""Processor time after that, s, in which the first part of a longer motion is evaluated, which is then kept."""
FEWEST_SEGMENTS = 64  # of a motion that are always evaluated


class TimeShares(NamedTuple):
    """Shares of the processor time of a run at the end of each of its steps."""

    march: float
    extremes: float
    histories: float
    own_model: float  # of the total time with a finer model: all steps with the model of the run


TIME_SHARES = {False: TimeShares(0.01, 0.2, 0.8, 0.6), True: TimeShares(0.12, 0.56, 0.68, 0.2)}
"""Approximate, measured for swept sines (False) and for random runs with a stationary input (True)."""


@dataclass(frozen=True)
class Needed:
    """Which parts of a run are computed: everything, or the parts that certain summary entries need.

    Outcome, warnings and margins of a run do not depend on it.

    Parameters
    ----------
    entries : needed summary entries, with those that have limits; None for everything, with histories, spectra and
    shapes.
    statistics : whether statistics of a stationary response are needed.
    root_mean_squares : whether root mean squares of other responses, which belong to the spectra, are needed.
    every_station : whether the largest stress of every station is needed, not only the overall largest.
    derived : whether histories, impacts, fatigue and plate stresses are needed.
    state_times : (nt,) increasing times of needed states, s; none by default.
    """

    entries: frozenset[str] | None = None
    statistics: bool = True
    root_mean_squares: bool = True
    every_station: bool = True
    derived: bool = True
    state_times: Floats = field(default_factory=lambda: np.zeros(0), compare=False)

    @classmethod
    def of(cls, scenario: Scenario, entries: Collection[str]) -> Self:
        """Parts that certain summary entries, the limits and the settings of a scenario need.

        Parameters
        ----------
        scenario : scenario with a ``run`` section.
        entries : entries of the summary.
        """
        settings, stationary = not_none(scenario.run), scenario.excitation.stationary
        limits = {} if scenario.limits is None else scenario.limits.values_by_name
        over_curves = {"srs_over_limit", "psd_over_limit"}  # used only by limits
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
        """True if any of the given summary entries is needed."""
        return self.entries is None or not self.entries.isdisjoint(entries)

    def searched_channels(self, channels: ChannelSet) -> ChannelSet:
        """Channels whose extremes the needed entries use; warnings always need those of probes and snubbers."""
        entries = not_none(self.entries) | ({STRESS_ENTRIES[0]} if self.has(*STRESS_ENTRIES) else set())
        values = [value for value in VALUES if value.section in ALWAYS_THERE or value.entry in entries]
        return channels.select(
            lambda each: each.key == PENETRATION or any(value.is_extreme_of(each) for value in values)
        )


EVERYTHING = Needed()
MOTION_ALONE = Needed(derived=False, every_station=False)


@dataclass
class Evaluation:
    """Stepwise evaluation of a motion; after an interruption the remaining steps are skipped.

    Parameters
    ----------
    stop : polled before and during every step.
    """

    stop: Stop
    skipped_steps: list[str] = field(default_factory=list)  # descriptions of skipped steps

    def compute(self, description: str, compute: Callable[[], Value], replacement: Value, minor: bool = False) -> Value:
        """Result of a step; ``replacement`` if it is skipped.

        Parameters
        ----------
        description : description, recorded if the step is skipped.
        compute, replacement : function that computes the result, and the replacement.
        minor : record the description only if nothing before it was skipped.
        """
        with suppress(Interrupted), stop_requests(self.stop, at_once=True):
            if not self.skipped_steps:
                check_stop()
                return compute()
        if not (minor and self.skipped_steps):
            self.skipped_steps.append(description)
        return replacement


class Work(NamedTuple):
    """Work of the solver."""

    events: int  # of contacts, springs and friction
    evaluations: int  # of the event functions
    segments: int  # between events
    states: int  # of contacts, diagonalised
    processor_time_s: float


@dataclass
class RunMotion:
    """Motion of a run, in closed form or by time stepping."""

    system: StructuralSystem
    method: str
    source_motion: MotionInChunks | ReferenceTrajectory
    outcome: Outcome
    energy_error: float  # of the energy balance, relative
    extremes: Extremes
    extreme_states: Floats  # (2, 2n) at `extreme_times`
    contact_share: Floats
    histories: Histories | None = None  # at the output times
    contact: LargestContact | None = None  # for several bodies, and bodies in space
    states: Floats | None = None  # (nt, 2n or more) at the requested times; None for a time-stepped motion
    low_passed: Floats | None = None  # (nt or more, probes) filtered acceleration, if there is a filter
    trajectory: Trajectory | None = None  # closed form; its last part if not all is kept
    impacts: ImpactObserver | None = None
    stresses: StressObserver | None = None
    plates: PlateStress | None = None
    memory: Mapping[str, int] = field(default_factory=dict)  # memory entries of the summary
    compared_s: float | None = None  # s, length of the first part, compared with a finer model, if not all is kept
    warnings: tuple[str, ...] = ()
    # closed form, or time-stepped motion at the output times
    available_motion: Trajectory | Histories = field(init=False)
    work: Work = field(init=False)  # of the solver
    events: Dataset = field(init=False)  # closings and openings of the snubbers, without breakpoints of their tables

    def __post_init__(self) -> None:
        """Set the work of the march and the contact events."""
        of, count = self.source_motion, len(self.system.snubbers)  # higher contact numbers are springs and friction
        self.available_motion = self.trajectory or not_none(self.histories)
        self.work = Work(of.event_time.size, of.evaluations, of.segments, of.states, of.processor_time_s)
        chosen = (of.event_contact < count) & (of.touch_changes != 0)
        events = {
            "event": np.arange(1, chosen.sum() + 1), "time": of.event_time[chosen],
            "snubber": of.event_contact[chosen], "closing": (of.touch_changes > 0)[chosen],
        }  # fmt: skip
        self.events = EVENTS.dataset(events)

    @cached_property
    def jumps(self) -> list[ForceJumps]:
        """Jumps of forces that may jump; unknown for a time-stepped motion."""
        found = self.trajectory is not None and self.system.forces_that_jump
        return [*jumps_of_motion(self.system, not_none(self.trajectory))] if found else []

    @property
    def breakpoints(self) -> int:
        """Number of passed breakpoints of piecewise-linear springs, without the start."""
        rubbing = np.isin(self.source_motion.event_contact, self.system.friction_contacts)
        of_spring = (self.source_motion.event_contact >= len(self.system.snubbers)) & ~rubbing
        return int(np.sum(of_spring & (self.source_motion.event_time > 0)))


def steps_in_time(system: StructuralSystem, settings: Run) -> bool:
    """True if the motion is integrated in time steps."""
    return settings.method == "reference" or system.cubic is not None


def output_times(scenario: Scenario) -> Floats:
    """(nt,) output times of a run, s."""
    rate = scenario.sample_rate_up_to(highest_excited_hz(scenario))
    return np.asarray(np.arange(samples_until(not_none(scenario.run).duration, rate)) / rate)


def motion_in_chunks(
    system: StructuralSystem, settings: Run, *, most_events: int | None = None,
    progress: Callable[[float], None] | None = None, stop: Callable[[], bool] = never,
) -> tuple[MotionInChunks, str]:  # fmt: skip
    """Prepare the motion of a run for marching, with the setting that limits its events.

    It is one chunk if the memory has room for its input and for the motion between the input's pieces.

    Parameters
    ----------
    system, settings : system and settings of the run.
    most_events : limit of the events; by default that of the settings and of the memory.
    progress, stop : see `beamsim.flow.transient.simulate`.

    Returns
    -------
    motion, limit
        Motion at its start; path of the limiting setting in the scenario.

    Raises
    ------
    ScenarioError
        If the input of a motion in one chunk has too many pieces.
    """
    record, at_once = common_record(system.forcing.signal), None  # common record of all loads
    pieces = 0 if record is None else record.pieces
    if pieces * BYTES_A_PIECE > MOTION_SHARE * settings.memory:
        at_once = max(int(CHUNK_SHARE * settings.memory / BYTES_A_PIECE), FEWEST_PIECES)
    flow = exact_flow(
        system, settings.duration, settings.most_contact_states, settings.memory,
        None if at_once is None else (0, min(at_once, pieces)),
    )  # fmt: skip
    room = int(MOTION_SHARE * settings.memory / (2 * 8 * (flow.size + 8)))  # events
    most = min(settings.max_events, room) if most_events is None else most_events
    if at_once is None:  # a motion in one chunk is evaluated afterwards
        progress = part_of(progress, 0.0, TIME_SHARES[system.scenario.excitation.stationary].march)
    motion = MotionInChunks(flow, system.initial_state, at_once, max_events=most, progress=progress, stop=stop)
    return motion, "run.max_events" if settings.max_events <= room else "run.memory"


def refuse_long_histories(system: StructuralSystem, settings: Run, samples: int) -> None:
    """Refuse histories that exceed their share of the memory.

    Parameters
    ----------
    system, settings : system and settings of the run.
    samples : number of output times.

    Raises
    ------
    ScenarioError
        Before anything is computed; the message gives the needed memory.
    """
    probes, filtered_too = len(system.probes), settings.low_pass is not None
    # the time, three energies, two base histories; absolute displacements of probes
    columns = system.channels.without(*UNSAMPLED).order.size + 6 + probes * (2 if filtered_too else 1)
    needed = samples * (8 * columns + system.dynamics.contacts.count)
    if needed > HISTORIES_SHARE * settings.memory:
        raise ScenarioError(_too_long_histories(samples, columns, needed, settings.memory))


def _too_long_histories(samples: int, columns: int, needed: int, memory: float) -> Problem:
    """Problem of histories that need more bytes than their share of the memory."""
    factor, enough = needed / (HISTORIES_SHARE * memory), needed / HISTORIES_SHARE / 1e9
    return Problem(
        "run.sample_rate",
        f"gives histories of {samples} samples with {columns} values each, {needed / 1e9:.3g} GB, more than "
        f"{100 * HISTORIES_SHARE:.0f} % of run.memory = {memory:.3g} bytes",
        f"give run.memory: {math.ceil(10 * enough) / 10:g} GB, or a sample rate that is lower by a factor of "
        f"{math.ceil(10 * factor) / 10:g} (peaks, events and spectra do not depend on it)",
    )


def _refuse_whole_motion_settings(system: StructuralSystem, settings: Run) -> None:
    """Refuse settings that need the whole motion in memory, if it does not fit."""
    needed = {"run.srs": settings.srs is not None, "friction": system.friction_contacts.size > 0}
    problems = [
        Problem(
            name,
            f"needs the whole motion in memory, but it does not fit into run.memory = {settings.memory:.3g} bytes",
            "raise run.memory, shorten run.duration, or leave it out",
        )
        for name, asked in needed.items()
        if asked
    ]
    if problems:
        raise ScenarioError(problems)


def exact_motion_of(
    system: StructuralSystem, settings: Run, times: Floats, progress: Callable[[float], None] | None,
    stop: Callable[[], bool], needed: Needed = EVERYTHING,
) -> RunMotion:  # fmt: skip
    """March and evaluate the motion in closed form, in one pass.

    Parameters
    ----------
    system, settings : system and settings of the run.
    times : (nt,) output times, s.
    progress, stop : see `beamsim.flow.transient.simulate`.
    needed : needed parts of the results.

    Returns
    -------
    RunMotion
        Motion up to its end.

    Raises
    ------
    ScenarioError
        If the request exceeds limits of memory, pieces of the input, or panels of a filter.
    """
    march, limit = motion_in_chunks(system, settings, progress=progress, stop=stop)
    flow, latest = march.flow, None if march.one_chunk else _LatestPart.of(march, system, settings)
    sampled = needed.derived and (needed.entries is None or needed.statistics)
    shares = TIME_SHARES[system.scenario.excitation.stationary]
    shown = progress if march.one_chunk else None
    extremes = part_of(shown, shares.march, shares.extremes if sampled else 1.0)
    samples = part_of(shown, shares.extremes, shares.histories)
    channels = system.channels.without(*UNSAMPLED)
    recorder = HistoryRecorder(flow, channels, times, GracePeriod(stop), samples) if sampled else None
    derived = _chunk_observers(system, settings, times, needed, stop) if needed.derived else (None, None, None)
    impacts, stresses, plates = derived
    states = _StateRecorder(needed.state_times) if needed.state_times.size else None
    values = ChunkValues(system, settings, flow, times, needed)
    with locating({"duration": "run.duration"}):
        for part in _evaluate_chunks(march, values, GracePeriod(stop), extremes):
            for observer in (recorder, impacts, stresses, plates, latest, states):
                if observer is not None:
                    observer.add(part)
    return RunMotion(
        system=system, method="exact", outcome=values.balance.check(with_limit(march.outcome, limit)),
        source_motion=march, energy_error=values.balance.error,
        extremes=values.extremes, extreme_states=values.extreme_states,
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
    """March a motion and include the values of its chunks, until these take too long after an interruption."""
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
    """Observer of the states of a motion at (nt,) increasing times, s."""

    def __init__(self, times: Floats) -> None:
        self._times, self._known, self._of_chunks = times, 0, list[Floats]()

    def add(self, chunk: Trajectory) -> None:
        """Store the states at the times within the next chunk."""
        first, self._known = self._known, times_reached(chunk.end, self._times).size
        self._of_chunks.append(chunk.states_at(np.minimum(self._times[first : self._known], chunk.end)))

    @property
    def states(self) -> Floats:
        """(nt, 2n or more) states, up to the end of the motion."""
        return np.concatenate(self._of_chunks)


class _LatestPart:
    """Last part of a motion that does not fit into memory and is passed chunk by chunk.

    Parameters
    ----------
    length_s : length of the part, s.
    compared_s : length of the first part, which is compared with a finer model, s.
    """

    def __init__(self, length_s: float, compared_s: float) -> None:
        self.length_s, self.compared_s, self._chunks = length_s, compared_s, list[Trajectory]()

    @classmethod
    def of(cls, march: MotionInChunks, system: StructuralSystem, settings: Run) -> _LatestPart:
        """The part that has spectra; raises ScenarioError if a setting needs the whole motion."""
        _refuse_whole_motion_settings(system, settings)
        kept_s = settings.memory / BYTES_A_PIECE * not_none(march.flow.record).step  # s, length that fits
        return cls(min(SPECTRUM_SHARE * kept_s, settings.spectrum.last or math.inf), COMPARED_SHARE * kept_s)

    def add(self, chunk: Trajectory) -> None:
        """Store the next chunk, and drop earlier chunks that no longer belong to the part."""
        self._chunks = [each for each in self._chunks if each.end > chunk.end - self.length_s] + [chunk]

    def fields(self, march: MotionInChunks, settings: Run) -> dict[str, Any]:
        """Result fields of a march that depend on the part."""
        return {"compared_s": self.compared_s, "warnings": (_memory_note(march, settings, self),)}

    @property
    def trajectory(self) -> Trajectory:
        """The part; shorter if the motion ended early."""
        whole = self._chunks[0] if len(self._chunks) == 1 else Trajectory.join(self._chunks)
        begin = whole.end - self.length_s
        return whole.extract(begin, whole.end) if begin > whole.time[0] else whole


def _chunk_observers(
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
    """Note that a motion exceeds the memory, and that spectra are those of its last part."""
    kept = f"the motion is kept {march.chunk_s:.3g} s at a time (run.memory = {settings.memory:.3g} bytes)"
    if march.outcome.interrupted:
        return kept
    kept += f"; spectra and rms_* are those of the last {min(latest.length_s, march.end):.3g} s"
    if settings.convergence != "off":
        kept += f", a finer model is compared on the first {latest.compared_s:.3g} s"
    return kept


@dataclass
class GracePeriod:
    """True after more than `GRACE_S` of processor time since an interruption was noticed.

    Parameters
    ----------
    stop : True after an interruption.
    """

    stop: Stop
    start_s: float = math.inf

    def __call__(self) -> bool:
        """True if the time is over."""
        if not self.stop():
            return False
        self.start_s = min(self.start_s, processor_time())
        return processor_time() - self.start_s > GRACE_S


Computed = tuple[tuple[Floats, EnergyHistory, float], dict[Key, Extreme], LowPassed | None]
"""For a chunk: data of its energy balance, its extremes, and the filter at its end."""


class ChunkValues:
    """Values of a motion, collected chunk by chunk: peaks, states at peaks, energy balance.

    Parameters
    ----------
    system, settings : system and settings of the run.
    flow : flow of the motion.
    times : (nt,) output times, s.
    needed : needed parts, which decide about the searched extremes.
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
        if settings.low_pass is not None:  # extremes of filtered accelerations
            channels = channels.without(ACCELERATION)
            self.low_passed = LowPassed(settings.low_pass, times, len(system.probes))
            self._accelerations = outputs_of(flow, system.channels.of_keys(ACCELERATION).linear)
        self._largest_alone = STRESS if STRESS in channels.places and not needed.every_station else None
        self._channels = channels

    def compute(self, chunk: Trajectory) -> Computed:
        """Compute the values of the next chunk without including it (inclusion is fast and not interrupted)."""
        energies, low = energies_of_segments(chunk), None
        found = self._channels.split(np.array(channel_extrema(chunk, self._channels, self._largest_alone)[:4]))
        if self.low_passed is not None:
            low = self.low_passed.copy()
            hz, through = low.frequency_hz, low.filter
            low.add(chunk.end, lambda times: filter_outputs(chunk, self._accelerations, hz, times, through))
        return energies, found, low

    def computed_of_beginning(self, chunk: Trajectory) -> tuple[Trajectory, Computed]:
        """Part of the next chunk that can be evaluated in `BEGINNING_S`, and its values."""
        begin, segments = processor_time(), FEWEST_SEGMENTS
        while True:
            part = chunk.select(slice(0, segments))
            found = self.compute(part)
            if segments >= chunk.time.size or processor_time() - begin > BEGINNING_S:
                return part, found
            segments *= 2

    def include(
        self, chunk: Trajectory, energies: tuple[Floats, EnergyHistory, float], extremes: dict[Key, Extreme],
        low: LowPassed | None,
    ) -> None:  # fmt: skip
        """Include the values of the next chunk, with its states at new extremes."""
        self.balance.add(*energies)
        self.extremes = {name: merge_extremes(self.extremes.get(name), each) for name, each in extremes.items()}
        self.low_passed = low
        if low is not None and low.extremes is not None:
            self.extremes[ACCELERATION] = low.extremes
        times = extreme_times(self.extremes)
        self.extreme_states = self.extreme_states[: times.size]
        for k in np.flatnonzero(times != self._extreme_times[: times.size]).tolist():
            self._extreme_times[k], self.extreme_states[k] = times[k], chunk.states_at(times[[k]])[0]
        if (len(self.system.bodies) > 1 or self.system.stations.in_space is not None) and self.system.snubbers:
            self._include_contact(chunk)

    def _include_contact(self, chunk: Trajectory) -> None:
        """Store the openings for several bodies or bodies in space if the next chunk has the largest contact force."""
        largest = largest_contact(self.system, self.extremes)
        if largest is not None and (self.contact is None or largest.time != self.contact.time):
            at, flow = np.array([largest.time]), chunk.flow
            opening = chunk.sample(at, lambda phases: flow.at(phases).openings)[0]
            self.contact = largest._replace(state=chunk.states_at(at)[0], opening=opening)


class LargestContact(NamedTuple):
    """Largest contact force of a motion, and the motion at that time."""

    snubber: int
    force: float  # N
    time: float  # s
    state: Floats = np.zeros(0)  # (2n or more,)
    opening: Floats = np.zeros(0)  # (snubbers or more,) distances to the faces


def largest_contact(system: StructuralSystem, extremes: Extremes) -> LargestContact | None:
    """Largest contact force of a structure with snubbers; None without contact."""
    forces, times = by_magnitude(system.channels.of_keys(FORCE).channels, extremes[FORCE])[2:]
    forces = np.where([s.gap_unit == "m" for s in system.snubbers], forces, 0.0)  # the sketch does not show moments
    at = int(forces.argmax())
    return LargestContact(at, float(forces[at]), float(times[at])) if forces[at] > 0.0 else None


def with_limit(outcome: Outcome, limit: str = "run.max_events") -> Outcome:
    """The outcome, with the scenario key that limits the events."""
    if outcome.code != EVENT_LIMIT:
        return outcome
    return outcome.copy_with(remedy=f"raise {limit}, or check for a chattering contact")
