"""The motion of a run in closed form, marched and evaluated stretch by stretch."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from copy import copy as copied
from copy import deepcopy
from functools import partial

import numpy as np

from beamsim.analyses.run.energy import EnergyBalance, energies, energies_of_segments, power_factors
from beamsim.analyses.run.filters import LowPassed, filtered
from beamsim.analyses.run.impacts import friction_contacts
from beamsim.analyses.run.motion import COMPONENTS, Histories, RunMotion, memory_of, reached, with_limit
from beamsim.analyses.run.needed import EVERYTHING, Needed
from beamsim.analyses.run.result import EnergyHistory
from beamsim.analyses.values import (
    ACCELERATION,
    STRESS,
    Extreme,
    extreme_times,
    outer,
)
from beamsim.errors import Problem, ScenarioError, locating
from beamsim.flow.channels import Observed
from beamsim.flow.compiled import processor_time
from beamsim.flow.exact import ExactFlow, states_in_memory
from beamsim.flow.trajectory import Trajectory
from beamsim.flow.transient import CHECKPOINT_PIECES, MotionInStretches
from beamsim.inputs.signal import StreamedSignal, common_record
from beamsim.outcomes import Interrupted, never, stopped_by
from beamsim.scenario.run import Run
from beamsim.system.equations import ChannelSet, Key
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats, not_none

BYTES_A_PIECE = 2000  # that a motion which is kept needs for each piece of its input
STRETCH_SHARE = 0.064  # of the memory, for the pieces of a stretch
COMPARED_SHARE = 0.2  # for those of the first part, which is compared with that of a finer model
SPECTRUM_SHARE = 0.25  # for those of the last part, of which there are spectra
VALUES_AT_ONCE = 2**22  # outputs and states at the times that are computed together
_STRESSES_AT_ONCE = 256  # samples
SAMPLES_TO_SEED_STRESS = 2000  # values from which the search for the largest stress of every station starts
MOST_PIECES = 4_000_000  # of an input, in motions that are kept as a whole
TABLES_SHARE, MOTION_SHARE = 0.2, 0.5  # of it: tables of contact states, the motion between events


def motion_in_stretches(
    system: StructuralSystem,
    settings: Run,
    *,
    most_events: int | None = None,
    progress: Callable[[float], None] | None = None,
    stop: Callable[[], bool] = never,
) -> tuple[MotionInStretches, str]:
    """The motion of a run, to be marched, and the setting that limits its events.

    It is one stretch where its input has no more pieces than the motion between them has room for in the memory.

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
        If a motion of one stretch has an input of too many pieces.
    """
    record, at_once = common_record(system.forcing.signal), None  # of which all loads are made
    pieces = 0 if record is None else record.pieces
    if pieces * BYTES_A_PIECE > MOTION_SHARE * settings.memory:
        at_once = max(int(STRETCH_SHARE * settings.memory / BYTES_A_PIECE), CHECKPOINT_PIECES)
    flow = exact_flow(
        system, settings.duration, settings.most_contact_states, settings.memory,
        None if at_once is None else (0, min(at_once, pieces)),
    )  # fmt: skip
    room = events_in_memory(flow, settings.memory)
    most = min(settings.max_events, room) if most_events is None else most_events
    motion = MotionInStretches(flow, system.initial_state, at_once, max_events=most, progress=progress, stop=stop)
    return motion, "run.max_events" if settings.max_events <= room else "run.memory"


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
    """The motion in closed form, with its figures, evaluated and forgotten stretch by stretch.

    Parameters
    ----------
    system, settings : of the run.
    times : (nt,) s, at which it is asked for.
    progress, stop : see `beamsim.flow.transient.simulate`.
    needed : which extremes are searched for.

    Returns
    -------
    RunMotion
        Up to where it ended; its histories are evaluated when they are asked for.

    Raises
    ------
    ScenarioError
        Where something is asked for that needs the whole motion, which does not fit into the memory; where the input
        has too many pieces, or the filter of the accelerations would need too many panels.
    """
    motion, limit = motion_in_stretches(system, settings, progress=progress, stop=stop)
    if not motion.one_stretch:
        _refuse_what_needs_all(system, settings)
    figures, overdue = StretchFigures(system, settings, motion.flow, times, needed), Overdue(stop)
    with locating({"duration": "run.duration"}):
        for stretch in motion.stretches():
            try:
                with stopped_by(overdue):
                    figures = figures.with_stretch(stretch)
            except Interrupted:
                figures, part = figures.with_beginning(stretch)
                motion.end_with(part)
    at = extreme_times(figures.extremes)
    order = np.argsort(at)
    return RunMotion(
        system=system,
        method="exact",
        outcome=figures.balance.checked(with_limit(motion.outcome, limit)),
        sampled=lambda: histories_of(motion, system.channels.without(STRESS), times, stop),
        balance=figures.balance,
        marched=motion,
        extremes=figures.extremes,
        extreme_states=motion.states_at(at[order])[np.argsort(order)],
        state_at=lambda time: motion.states_at(np.array([time]))[0],
        openings_at=lambda time: motion.sample(np.array([time]), lambda of: motion.flow.at(of).openings)[0],
        contact_share=motion.contact_share(),
        low_passed=None if figures.low_passed is None else figures.low_passed.values,
        last=lambda: motion.within(_last_begin(motion, settings), motion.end),
        parts=motion.again,
        von_mises=partial(_von_mises, system, motion, times),
        memory=memory_of(motion.flow, settings),
        compared_s=None if motion.one_stretch else COMPARED_SHARE * _kept_s(motion, settings),
        warnings=() if motion.one_stretch else (_forgotten(motion, settings),),
    )


def _kept_s(motion: MotionInStretches, settings: Run) -> float:
    """Length of a motion under this input that would fit into the memory, s."""
    return settings.memory / BYTES_A_PIECE * not_none(motion.flow.record).step


def _last_begin(motion: MotionInStretches, settings: Run) -> float:
    """Where the part of the motion begins of which there are spectra, s; all of one stretch."""
    if motion.one_stretch:
        return 0.0
    room = SPECTRUM_SHARE * _kept_s(motion, settings)
    return max(motion.end - min(room, settings.spectrum.last or room), 0.0)


def _forgotten(motion: MotionInStretches, settings: Run) -> str:
    """What becomes of a motion that does not fit into the memory."""
    kept = f"the motion is kept {motion.stretch_s:.3g} s at a time (run.memory = {settings.memory:.3g} bytes)"
    if motion.outcome.interrupted:
        return kept
    last = motion.end - _last_begin(motion, settings)
    kept += f"; spectra and rms_* are those of the last {last:.3g} s"
    if settings.convergence != "off":
        compared = COMPARED_SHARE * _kept_s(motion, settings)
        kept += f", a finer model is compared on the first {compared:.3g} s"
    return kept


def _von_mises(system: StructuralSystem, motion: MotionInStretches, times: Floats) -> dict[str, Floats]:
    """(nx,) largest von Mises stress at the surface of every plate at its stations, of the samples, Pa."""
    stress, plates = system.stress, {body.body for body in system.bodies if body.moments == COMPONENTS}
    if stress is None or not plates:
        return {}
    alone = len(stress.stations.parts) == 1
    named = {stress.bodies[0] if alone else part.body: part.stations for part in stress.stations}
    parts = {name: stations for name, stations in named.items() if name in plates}
    times, of_all = reached(motion.end, times), Observed(motion.flow, system.channels.of_keys(STRESS)).linear
    few = times[:: max(1, times.size // SAMPLES_TO_SEED_STRESS)]
    squares = {name: np.zeros((part.stop - part.start) // COMPONENTS) for name, part in parts.items()}
    for first in range(0, few.size, _STRESSES_AT_ONCE):
        sampled = motion.sample(few[first : first + _STRESSES_AT_ONCE], of_all)
        for name, part in parts.items():
            x, y, shear = np.moveaxis(sampled[:, part].reshape(sampled.shape[0], COMPONENTS, -1), 1, 0)
            squares[name] = np.maximum(squares[name], (x**2 - x * y + y**2 + 3 * shear**2).max(axis=0))
    return {name: np.sqrt(largest) for name, largest in squares.items()}


def histories_of(
    motion: MotionInStretches, channels: ChannelSet, times: Floats, stop: Callable[[], bool] = never
) -> Histories:
    """A motion in closed form at output times, stretch by stretch.

    Parameters
    ----------
    motion : as far as it was marched.
    channels : that are sampled.
    times : (nt,) increasing, s; those after the end of the motion are left out.
    stop : asked now and then whether to end.

    Returns
    -------
    Histories
        At the times up to which they were evaluated within `GRACE_S` after an interruption, `FEWEST_SAMPLES` at least.
    """
    flow, observed = motion.flow, Observed(motion.flow, channels)
    times = reached(motion.end, times)
    columns, contacts = channels.order.size, flow.system.contacts
    values = np.empty((columns, times.size)).T  # each column in one piece
    touching = np.empty((contacts.count, times.size), dtype=bool).T
    energy, work = np.empty((3, times.size)), np.zeros(2)
    factors, at_once = power_factors(flow), max(VALUES_AT_ONCE // (columns + flow.size), 1)
    first = filled = 0
    with suppress(Interrupted), stopped_by(Overdue(stop)):
        for stretch in motion.again():
            begin, last = float(stretch.time[0]), reached(stretch.end, times).size
            for number in range(first, max(last, first + 1), at_once):
                part = slice(number, min(number + at_once, last))
                at = np.minimum(times[part], stretch.end)
                values[part] = observed.values(stretch, at)
                touching[part] = contacts.touching(stretch.phases_at(at))
                end = at[-1:] if part.stop < last else [stretch.end]
                found = energies(stretch, np.append(at, end), factors, begin, work)
                energy[:, part] = found.work_in[:-1], found.dissipated[:-1], found.stored[:-1]
                begin, work = float(end[0]), np.array([found.dissipated[-1], found.work_in[-1]])
                filled = part.stop
            first = last
    if not filled < times.size:
        return Histories(times, channels, values, touching, EnergyHistory(*energy))
    if not filled:
        return histories_of(motion, channels, times[:FEWEST_SAMPLES])
    return Histories(times[:filled], channels, values[:filled], touching[:filled], EnergyHistory(*energy[:, :filled]))


GRACE_S = 0.7
"""Processor time after an interruption in which a motion that was marched is evaluated as a whole, so that it is kept
as a whole; the same again for its histories."""
KEPT_S = 0.25
"""Processor time after that in which the first part of a longer motion is evaluated, which is kept."""
FEWEST_SEGMENTS, FEWEST_SAMPLES = 64, 1000
"""Of a motion, which are evaluated whatever time that takes."""


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


class StretchFigures:
    """What a run reports of a motion that is given stretch by stretch: peaks and energy balance.

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

    def with_stretch(self, stretch: Trajectory) -> StretchFigures:
        """The same with the next stretch; these stay as they are if that is interrupted."""
        copy = copied(self)
        copy.balance, copy.low_passed = (
            deepcopy(self.balance),
            None if self.low_passed is None else self.low_passed.copy(),
        )
        copy._add(stretch)
        return copy

    def with_beginning(self, stretch: Trajectory) -> tuple[StretchFigures, Trajectory]:
        """The same with as much of the next stretch as is evaluated in `KEPT_S`, and that part of the stretch."""
        begin, segments = processor_time(), FEWEST_SEGMENTS
        while True:
            part = stretch.only(slice(0, segments))
            kept = self.with_stretch(part)
            if segments >= stretch.segments or processor_time() - begin > KEPT_S:
                return kept, part
            segments *= 2

    def _add(self, stretch: Trajectory) -> None:
        """Include the next stretch."""
        balance = energies_of_segments(stretch)
        found = self._observed.extremes(stretch)
        if (low := self.low_passed) is not None:
            hz, through = low.frequency_hz, low.filter
            low.add(stretch.end, lambda times: filtered(stretch, self._accelerations, hz, times, through))
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
