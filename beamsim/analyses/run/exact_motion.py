"""The motion of a run in closed form, marched and evaluated chunk by chunk, each once."""

from __future__ import annotations

import math
from collections.abc import Callable
from copy import copy as copied
from copy import deepcopy
from dataclasses import dataclass

from beamsim.analyses.run.energy import EnergyBalance, energies_of_segments
from beamsim.analyses.run.fatigue import PlateStress, StressObserver
from beamsim.analyses.run.filters import LowPassed, filtered
from beamsim.analyses.run.impacts import ImpactObserver, friction_contacts
from beamsim.analyses.run.motion import RunMotion, memory_of, with_limit
from beamsim.analyses.run.needed import EVERYTHING, Needed
from beamsim.analyses.run.observers import (
    HistoryRecorder,
    LatestPart,
    StatesAtExtremes,
    StatesAtTimes,
)
from beamsim.errors import Problem, ScenarioError, locating
from beamsim.flow.channels import Observed
from beamsim.flow.compiled import processor_time
from beamsim.flow.exact import ExactFlow, states_in_memory
from beamsim.flow.trajectory import Trajectory
from beamsim.flow.transient import MotionInChunks
from beamsim.inputs.signal import StreamedSignal, common_record
from beamsim.outcomes import Interrupted, Stop, never, stopped_by
from beamsim.results.values import (
    ACCELERATION,
    STRESS,
    Extreme,
    Extremes,
    outer,
)
from beamsim.scenario.run import Run
from beamsim.structures.stations import COMPONENTS
from beamsim.system.equations import Key
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats, not_none

BYTES_A_PIECE = 2000  # that a motion which is kept needs for each piece of its input
CHUNK_SHARE = 0.064  # of the memory, for the pieces of a chunk
FEWEST_PIECES = 4096  # in a chunk
COMPARED_SHARE = 0.2  # for those of the first part, which is compared with that of a finer model
SPECTRUM_SHARE = 0.25  # for those of the last part, of which there are spectra
MOST_PIECES = 4_000_000  # of an input, in motions that are kept as a whole
TABLES_SHARE, MOTION_SHARE, HISTORIES_SHARE = 0.2, 0.5, 0.3  # of it: tables of contact states, the motion, samples


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
    room = events_in_memory(flow, settings.memory)
    most = min(settings.max_events, room) if most_events is None else most_events
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
        factor, enough = needed / (HISTORIES_SHARE * settings.memory), needed / HISTORIES_SHARE / 1e9
        raise ScenarioError(
            Problem(
                "run.sample_rate",
                f"gives histories of {samples} samples with {columns} values each, {needed / 1e9:.3g} GB, more than "
                f"{100 * HISTORIES_SHARE:.0f} % of run.memory = {settings.memory:.3g} bytes",
                f"give run.memory: {math.ceil(10 * enough) / 10:g} GB, or a sample rate that is lower by a factor of "
                f"{math.ceil(10 * factor) / 10:g} (peaks, events and spectra do not depend on it)",
            )
        )


def _refuse_what_needs_all(system: StructuralSystem, settings: Run) -> None:
    """Refuse what needs the whole motion, which does not fit into the memory."""
    needed = {"run.srs": settings.srs is not None, "friction": friction_contacts(system).size > 0}
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
    """The motion in closed form: every chunk is marched, evaluated once and forgotten.

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
        Where something is asked for that needs the whole motion, which does not fit into the memory; where the input
        has too many pieces, or the filter of the accelerations would need too many panels.
    """
    motion, limit = motion_in_chunks(system, settings, progress=progress, stop=stop)
    if not motion.one_chunk:
        _refuse_what_needs_all(system, settings)
    observed = _Observers.of(system, settings, motion, times, needed, stop)
    with locating({"duration": "run.duration"}):
        values = _evaluated(motion, ChunkValues(system, settings, motion.flow, times, needed), observed, Overdue(stop))
    return RunMotion(
        system=system,
        method="exact",
        outcome=values.balance.checked(with_limit(motion.outcome, limit)),
        balance=values.balance,
        marched=motion,
        extremes=values.extremes,
        extreme_states=observed.at_extremes.states,
        contact_share=motion.contact_share(),
        histories=observed.histories.result(),
        at_contact=observed.at_extremes.at_contact,
        states=observed.states.result(),
        low_passed=None if values.low_passed is None else values.low_passed.values,
        trajectory=observed.latest.result(),
        impacts=observed.impacts,
        stresses=observed.stresses,
        plates=observed.plates,
        memory=memory_of(motion.flow, settings),
        compared_s=None if motion.one_chunk else COMPARED_SHARE * _kept_s(motion, settings),
        warnings=() if motion.one_chunk else (_forgotten(motion, settings),),
    )


def _evaluated(motion: MotionInChunks, values: ChunkValues, observed: _Observers, overdue: Overdue) -> ChunkValues:
    """March a motion, show every chunk to the observers, and return its values, those of its beginning if overdue."""
    for chunk in motion.chunks():
        part = chunk
        try:
            with stopped_by(overdue):
                values = values.with_chunk(chunk)
        except Interrupted:
            values, part = values.with_beginning(chunk)
            motion.end_with(part)
        observed.add(part, values.extremes)
    return values


@dataclass(frozen=True)
class _Observers:
    """What is taken of each chunk beside the values of the motion."""

    histories: HistoryRecorder
    at_extremes: StatesAtExtremes
    states: StatesAtTimes
    latest: LatestPart
    impacts: ImpactObserver | None
    stresses: StressObserver | None
    plates: PlateStress | None

    @classmethod
    def of(
        cls, system: StructuralSystem, settings: Run, motion: MotionInChunks, times: Floats, needed: Needed, stop: Stop
    ) -> _Observers:
        """Those of a run; without histories there is a sample at the start of the motion."""
        flow, channels = motion.flow, system.channels.without(STRESS)
        impacts = needed.derived and needed.everything and settings.impacts is not None
        stresses = needed.derived and settings.fatigue is not None and system.stress is not None
        plates = needed.derived and needed.everything and any(b.moments == len(COMPONENTS) for b in system.bodies)
        return cls(
            HistoryRecorder(flow, channels, times if needed.histories else times[:1], Overdue(stop)),
            StatesAtExtremes(system, flow.size),
            StatesAtTimes(needed.state_times, flow.size),
            LatestPart(_latest_s(motion, settings)),
            ImpactObserver(system, stop) if impacts else None,
            StressObserver(system, stop) if stresses else None,
            PlateStress(system, times, stop) if plates else None,
        )

    def add(self, chunk: Trajectory, extremes: Extremes) -> None:
        """Show the next chunk to all; extremes are those of the motion up to its end."""
        self.at_extremes.add(chunk, extremes)
        for each in (self.histories, self.states, self.latest, self.impacts, self.stresses, self.plates):
            if each is not None:
                each.add(chunk)


def _kept_s(motion: MotionInChunks, settings: Run) -> float:
    """Length of a motion under this input that would fit into the memory, s."""
    return settings.memory / BYTES_A_PIECE * not_none(motion.flow.record).step


def _latest_s(motion: MotionInChunks, settings: Run) -> float:
    """Length of the last part of the motion, of which there are spectra, s; infinite of a motion of one chunk."""
    if motion.one_chunk:
        return math.inf
    room = SPECTRUM_SHARE * _kept_s(motion, settings)
    return min(room, settings.spectrum.last or room)


def _forgotten(motion: MotionInChunks, settings: Run) -> str:
    """What becomes of a motion that does not fit into the memory."""
    kept = f"the motion is kept {motion.chunk_s:.3g} s at a time (run.memory = {settings.memory:.3g} bytes)"
    if motion.outcome.interrupted:
        return kept
    kept += f"; spectra and rms_* are those of the last {min(_latest_s(motion, settings), motion.end):.3g} s"
    if settings.convergence != "off":
        compared = COMPARED_SHARE * _kept_s(motion, settings)
        kept += f", a finer model is compared on the first {compared:.3g} s"
    return kept


GRACE_S = 0.7
"""Processor time after an interruption in which a motion that was marched is evaluated as a whole, so that it is kept
as a whole; the same again for its histories."""
KEPT_S = 0.25
"""Processor time after that in which the first part of a longer motion is evaluated, which is kept."""
FEWEST_SEGMENTS = 64  # of a motion, that are evaluated whatever time that takes


class Overdue:
    """Whether more than `GRACE_S` of processor time was spent since an interruption was noticed.

    Parameters
    ----------
    stop : says whether there was one.
    """

    def __init__(self, stop: Callable[[], bool]) -> None:
        self._stop, self._since = stop, math.inf

    def __call__(self) -> bool:
        """Whether to give up."""
        if not self._stop():
            return False
        self._since = min(self._since, processor_time())
        return processor_time() - self._since > GRACE_S


class ChunkValues:
    """What a run reports of a motion that is given chunk by chunk: peaks and energy balance.

    Parameters
    ----------
    system, settings : of the run.
    flow : of the motion.
    times : (nt,) s, all output times.
    needed : which extremes are searched for.
    """

    def __init__(
        self,
        system: StructuralSystem,
        settings: Run,
        flow: ExactFlow,
        times: Floats,
        needed: Needed = EVERYTHING,
    ) -> None:
        self.balance, self.extremes = EnergyBalance(), dict[Key, Extreme]()
        self.low_passed = None
        channels = needed.searched(system.channels)
        if settings.low_pass is not None:  # extremes of accelerations are those behind the filter
            channels = channels.without(ACCELERATION)
            self.low_passed = LowPassed(settings.low_pass, times, len(system.probes))
            self._accelerations = Observed(flow, system.channels.of_keys(ACCELERATION)).linear
        largest_alone = STRESS if STRESS in channels.places and not needed.every_station else None
        self._observed = Observed(flow, channels, largest_alone)

    def with_chunk(self, chunk: Trajectory) -> ChunkValues:
        """The same with the next chunk; these stay as they are if that is interrupted."""
        copy = copied(self)
        copy.balance, copy.low_passed = (
            deepcopy(self.balance),
            None if self.low_passed is None else self.low_passed.copy(),
        )
        copy._add(chunk)
        return copy

    def with_beginning(self, chunk: Trajectory) -> tuple[ChunkValues, Trajectory]:
        """The same with as much of the next chunk as is evaluated in `KEPT_S`, and that part of the chunk."""
        begin, segments = processor_time(), FEWEST_SEGMENTS
        while True:
            part = chunk.only(slice(0, segments))
            kept = self.with_chunk(part)
            if segments >= chunk.segments or processor_time() - begin > KEPT_S:
                return kept, part
            segments *= 2

    def _add(self, chunk: Trajectory) -> None:
        """Include the next chunk."""
        balance = energies_of_segments(chunk)
        found = self._observed.extremes(chunk)
        if (low := self.low_passed) is not None:
            hz, through = low.frequency_hz, low.filter
            low.add(chunk.end, lambda times: filtered(chunk, self._accelerations, hz, times, through))
        self.balance.add(*balance)
        self.extremes = {name: outer(self.extremes.get(name), each) for name, each in found.items()}
        if low is not None and low.extremes is not None:
            self.extremes[ACCELERATION] = low.extremes


def events_in_memory(flow: ExactFlow, memory: float) -> int:
    """Number of events that fit into the share of ``memory``, bytes, of the motion between them; joined, it is there
    twice."""
    return int(MOTION_SHARE * memory / (2 * 8 * (flow.size + 8)))


def exact_flow(
    system: StructuralSystem, duration: float, most_states: int | None = None, memory: float = 2e9,
    pieces: tuple[int, int] | None = None,
) -> ExactFlow:  # fmt: skip
    """The exact flow of a built system; its first observer is the base's acceleration.

    Parameters
    ----------
    system : with its forcing.
    duration : longest time that it is asked for, s.
    most_states : contact states that are kept at once; by default those that fit into their share of the memory.
    memory : bytes.
    pieces : see `ExactFlow`.

    Returns
    -------
    ExactFlow

    Raises
    ------
    ScenarioError
        For a record of too many pieces to be taken as a whole.
    """
    observers = () if system.base_acceleration is None else (system.base_acceleration,)
    most = most_states or states_in_memory(system.dynamics, TABLES_SHARE * memory)
    if pieces is None:
        for record in (s.record for s in (*system.forcing.signal, *observers) if isinstance(s, StreamedSignal)):
            if record.pieces > MOST_PIECES:
                raise ScenarioError(
                    Problem(
                        "excitation",
                        f"has {record.pieces:.3g} pieces, too many for this command or method (at most "
                        f"{MOST_PIECES:.0e})",
                        "shorten run.duration, or give a lower excitation.sample_rate; beamsim run with one random "
                        "excitation and method: exact takes any number",
                    )
                )
    return ExactFlow(system.dynamics, system.forcing, duration, observers, most, pieces)
