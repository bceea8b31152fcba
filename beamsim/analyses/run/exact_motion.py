"""The motion of a run in closed form, marched and evaluated stretch by stretch."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from beamsim.analyses.run.energy import EnergyBalance, energies, energies_of_segments, power_factors
from beamsim.analyses.run.filters import LowPassFilter, filtered
from beamsim.analyses.run.friction import friction_contacts
from beamsim.analyses.run.impacts import ImpactRecord
from beamsim.analyses.run.motion import Histories, RunMotion, breakpoints, events_of, memory_of, with_limit
from beamsim.analyses.run.result import EnergyHistory, Work
from beamsim.analyses.values import ACCELERATION, DISPLACEMENT, STRESS, Extreme, searched
from beamsim.errors import Problem, ScenarioError
from beamsim.flow.channels import Observed
from beamsim.flow.contact_state import OutputOf
from beamsim.flow.exact import ExactFlow, states_in_memory
from beamsim.flow.trajectory import Trajectory
from beamsim.flow.transient import CHECKPOINT_PIECES, MotionInStretches
from beamsim.inputs.signal import StreamedSignal, common_record
from beamsim.scenario import Run
from beamsim.system.equations import ChannelSet, Key
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats

BYTES_A_PIECE = 2000  # that a motion which is kept needs for each piece of its input
STRETCH_SHARE = 0.064  # of the memory, for the pieces of a stretch
COMPARED_SHARE = 0.2  # for those of the first part, which is compared with that of a finer model
SPECTRUM_SHARE = 0.25  # for those of the last part, of which there are spectra
VALUES_AT_ONCE = 2**22  # outputs and states at the times that are computed together
COMPONENTS = 3  # of the stress at the surface of a plate: sigma_x, sigma_y, tau_xy
ROUND_OFF = 1e-12  # relative, of the last output time
_STRESSES_AT_ONCE = 256  # samples
SAMPLES_TO_SEED_STRESS = 2000  # values from which the search for the largest stress of every station starts
MOST_PIECES = 4_000_000  # of an input, in motions that are kept as a whole
MEMORY = 2e9  # bytes, that a run may keep unless it says otherwise
TABLES_SHARE, MOTION_SHARE = 0.2, 0.5  # of it: tables of contact states, the motion between events


def motion_in_stretches(
    system: StructuralSystem,
    settings: Run,
    *,
    most_events: int | None = None,
    progress: Callable[[float], None] | None = None,
    stop: Callable[[], bool],
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
) -> RunMotion:
    """The motion in closed form, with its figures, evaluated and forgotten stretch by stretch.

    Parameters
    ----------
    system, settings : of the run.
    times : (nt,) s, at which it is asked for.
    progress, stop : see `beamsim.flow.transient.simulate`.

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
    figures = StretchFigures.of_run(system, settings, motion.flow, times)
    for stretch in motion.stretches():
        figures.add(stretch)
    balance, extremes = figures.balance, figures.extremes
    of_first_probe = np.array([extremes[DISPLACEMENT][k][0] for k in (1, 3)])
    order = np.argsort(of_first_probe)
    return RunMotion(
        method="exact",
        outcome=balance.checked(with_limit(motion.outcome, limit)),
        sampled=lambda: histories_of(motion, system.channels.without(STRESS), times),
        balance=balance,
        events=events_of(system, motion),
        marched=motion,
        breakpoints=breakpoints(system, motion),
        extremes=extremes,
        extreme_times=of_first_probe,
        extreme_states=motion.states_at(of_first_probe[order])[order],
        state_at=lambda time: motion.states_at(np.array([time]))[0],
        contact_share=motion.contact_share(),
        work=Work(
            events=motion.event_time.size,
            evaluations=motion.evaluations,
            segments=motion.segments,
            states=len(motion.flow.visited),
            processor_time_s=motion.processor_time_s,
        ),
        low_passed=None if figures.low_passed is None else figures.low_passed.reached,
        trajectory=_analysed(motion, settings),
        parts=motion.again,
        von_mises=partial(_von_mises, system, motion, times),
        impacts=figures.impacts,
        memory=memory_of(motion.flow, settings),
        compared_s=None if motion.one_stretch else COMPARED_SHARE * _kept_s(motion, settings),
        warnings=() if motion.one_stretch else (_forgotten(motion, settings),),
    )


def _kept_s(motion: MotionInStretches, settings: Run) -> float:
    """Length of a motion under this input that would fit into the memory, s."""
    assert motion.flow.record is not None
    return settings.memory / BYTES_A_PIECE * motion.flow.record.step


def _analysed(motion: MotionInStretches, settings: Run) -> Trajectory:
    """The last part of the motion, of which there are spectra; all of one stretch."""
    if motion.one_stretch:
        return motion.within(0.0, motion.end)
    room = SPECTRUM_SHARE * _kept_s(motion, settings)
    return motion.within(max(motion.end - min(room, settings.spectrum.last or room), 0.0), motion.end)


def _forgotten(motion: MotionInStretches, settings: Run) -> str:
    """What becomes of a motion that does not fit into the memory."""
    kept = f"the motion is kept {motion.stretch_s:.3g} s at a time (run.memory = {settings.memory:.3g} bytes)"
    if motion.outcome.interrupted:
        return kept
    last = motion.end - float(_analysed(motion, settings).time[0])
    kept += f"; spectra and rms_* are those of the last {last:.3g} s"
    if settings.convergence != "off":
        compared = COMPARED_SHARE * _kept_s(motion, settings)
        kept += f", a finer model is compared on the first {compared:.3g} s"
    return kept


def _von_mises(system: StructuralSystem, motion: MotionInStretches, times: Floats) -> dict[str, Floats]:
    """(nx,) largest von Mises stress at the surface of every plate at its stations, of the samples, Pa."""
    plates = {body.body for body in system.bodies if body.moments == COMPONENTS}
    stress = system.stress
    if stress is None or not plates:
        return {}
    observed, times = Observed(motion.flow, system.channels.of_keys(STRESS)), reached(motion, times)
    parts = {
        part.body if len(stress.stations.parts) > 1 else stress.bodies[0]: part.stations for part in stress.stations
    }
    return {name: _largest_von_mises(motion, times, observed, parts[name]) for name in plates & set(parts)}


def reached(motion: MotionInStretches | Trajectory, times: Floats) -> Floats:
    """The times up to the end of a motion."""
    return times[: np.searchsorted(times, motion.end * (1.0 + ROUND_OFF), side="right")]


def histories_of(motion: MotionInStretches, channels: ChannelSet, times: Floats) -> Histories:
    """A motion in closed form at output times, stretch by stretch.

    Parameters
    ----------
    motion : as far as it was marched.
    channels : that are sampled.
    times : (nt,) increasing, s; those after the end of the motion are left out.

    Returns
    -------
    Histories
    """
    flow, observed = motion.flow, Observed(motion.flow, channels)
    times = reached(motion, times)
    columns, contacts = channels.order.size, flow.system.contacts
    values = np.empty((columns, times.size)).T  # each column in one piece
    touching = np.empty((contacts.count, times.size), dtype=bool).T
    energy, work = np.empty((3, times.size)), np.zeros(2)
    factors, at_once = power_factors(flow), max(VALUES_AT_ONCE // (columns + flow.size), 1)
    first = 0
    for stretch in motion.again():
        begin, last = float(stretch.time[0]), reached(stretch, times).size
        for number in range(first, max(last, first + 1), at_once):
            part = slice(number, min(number + at_once, last))
            at = np.minimum(times[part], stretch.end)
            values[part] = observed.values(stretch, at)
            touching[part] = contacts.touching(stretch.phases_at(at))
            end = at[-1:] if part.stop < last else [stretch.end]
            found = energies(stretch, np.append(at, end), factors, begin, work)
            energy[:, part] = found.work_in[:-1], found.dissipated[:-1], found.stored[:-1]
            begin, work = float(end[0]), np.array([found.dissipated[-1], found.work_in[-1]])
        first = last
    return Histories(times, channels, values, touching, EnergyHistory(*energy))


def _largest_von_mises(motion: MotionInStretches, times: Floats, stress: Observed, of_body: slice) -> Floats:
    """(nx,) largest von Mises stress of samples of a motion, Pa.

    Parameters
    ----------
    motion : as far as it was marched.
    times : (nt,) of the output, s, of which some are taken.
    stress : sigma_x, sigma_y and tau_xy of all stations.
    of_body : which of them.
    """
    few = times[:: max(1, times.size // SAMPLES_TO_SEED_STRESS)]
    largest = np.zeros((of_body.stop - of_body.start) // COMPONENTS)
    for first in range(0, few.size, _STRESSES_AT_ONCE):
        sampled = motion.sample(few[first : first + _STRESSES_AT_ONCE], stress.linear)[:, of_body]
        x, y, shear = np.moveaxis(sampled.reshape(sampled.shape[0], COMPONENTS, -1), 1, 0)
        largest = np.maximum(largest, (x**2 - x * y + y**2 + 3 * shear**2).max(axis=0))
    return np.sqrt(largest)


class StretchFigures:
    """Peaks and energy balance of a motion that is given stretch by stretch.

    Parameters
    ----------
    observed : channels whose extremes are searched for.
    impacts : record that the stretches are added to.
    low_passed : the filter that they are led through; the extremes of accelerations are those behind it.
    """

    def __init__(
        self, observed: Observed, impacts: ImpactRecord | None = None, low_passed: LowPassed | None = None
    ) -> None:
        self.observed, self.impacts, self.low_passed = observed, impacts, low_passed
        self.balance, self.extremes = EnergyBalance(), dict[Key, Extreme]()

    @classmethod
    def of_run(cls, system: StructuralSystem, settings: Run, flow: ExactFlow, times: Floats) -> StretchFigures:
        """Those that a run reports.

        Parameters
        ----------
        system, settings : of the run.
        flow : of the motion.
        times : (nt,) s, all output times.

        Returns
        -------
        StretchFigures
            Of no stretch so far.
        """
        channels, low_passed = searched(system.channels), None
        if settings.low_pass is not None:
            channels, accelerations = channels.without(ACCELERATION), system.channels.of_keys(ACCELERATION)
            low_passed = LowPassed(Observed(flow, accelerations).linear, settings.low_pass, times, len(system.probes))
        impacts = None if settings.impacts is None else ImpactRecord(system, settings.impacts)
        return cls(Observed(flow, channels), impacts, low_passed)

    def add(self, stretch: Trajectory) -> None:
        """Include the next stretch."""
        balance = energies_of_segments(stretch)
        found = self.observed.extremes(stretch) if self.observed.channels.channels else {}
        if self.impacts is not None:
            self.impacts.add(stretch)
        if self.low_passed is not None:
            found[ACCELERATION] = self.low_passed.add(stretch)
        self.balance.add(*balance)
        self.extremes = {name: outer(self.extremes.get(name), each) for name, each in found.items()}


class LowPassed:
    """Accelerations behind the filter at all output times, led through it stretch by stretch.

    Parameters
    ----------
    output_of : accelerations of the probes.
    frequency_hz : of the filter.
    times : (nt,) s, all output times.
    probes : number of accelerations.
    """

    def __init__(self, output_of: OutputOf, frequency_hz: float, times: Floats, probes: int) -> None:
        self._output_of, self._frequency_hz, self._times = output_of, frequency_hz, times
        self._through, self._begin, self._reached = LowPassFilter(frequency_hz, probes), 0.0, 0
        self.values = np.empty((times.size, probes))

    def add(self, stretch: Trajectory) -> Extreme:
        """Go on through the next stretch, and return its lowest and highest values."""
        upto = max(reached(stretch, self._times).size, self._reached)
        times = np.minimum(self._times[self._reached : upto], stretch.end)
        behind = filtered(stretch, self._output_of, self._frequency_hz, times, self._through)
        self.values[self._reached : upto] = behind.at(times)
        begin, self._begin, self._reached = self._begin, stretch.end, upto
        return np.array(behind.extremes(begin, stretch.end))

    @property
    def reached(self) -> Floats:
        """(nt, probes) up to where the motion is evaluated."""
        return self.values[: self._reached]


def outer(before: Extreme | None, new: Extreme) -> Extreme:
    """The lowest and the highest of two extremes, with their times."""
    if before is None:
        return new
    return np.vstack([np.where(new[0] < before[0], new[:2], before[:2]),
                      np.where(new[2] > before[2], new[2:], before[2:])])  # fmt: skip


def events_in_memory(flow: ExactFlow, memory: float) -> int:
    """Number of events that fit into the share of ``memory``, bytes, of the motion between them; joined, it is there
    twice."""
    return int(MOTION_SHARE * memory / (2 * 8 * (flow.size + 8)))


def exact_flow(
    system: StructuralSystem, duration: float, most_states: int | None = None, memory: float = MEMORY,
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
