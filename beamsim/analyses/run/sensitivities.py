r"""Derivatives of a run's values by numbers of its scenario: which number matters.

A number changes the system that is built from it. Its derivative is that of systems built on both sides, by differences
of fourth order, in coordinates that are turned to those of the run: the orthogonal factor of :math:`V_0^T M V` does not
depend on signs, order and mixing of modes. Along the motion the one pass of :mod:`beamsim.flow.variational` goes on
with it exactly, from event to event. A peak :math:`x = D v` of an output, v being the state and the inputs, has

.. math:: dx/dp = D\, \partial_p v + \partial_p D\, v + \dot x\, \partial_p t,

where its time moves with an event, or :math:`\dot x = 0`; a time in contact changes with the times of its events.

A contact at whose event the guard has the rate g' and the second derivative g'' is only grazed after a change of the
number by about :math:`|g' / (2 g''\, \partial_p t)|`, and one that stays open at a distance is touched after about
that over the distance's derivative. Beyond, the motion has other contacts, of which no derivative tells.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from beamsim.analyses.run.layouts import SENSITIVITIES
from beamsim.analyses.run.motion import RunMotion
from beamsim.errors import Problem, ScenarioError
from beamsim.flow.channels import outputs_of
from beamsim.flow.exact import ExactFlow, exact_flow
from beamsim.flow.trajectory import Trajectory
from beamsim.flow.transient import Log
from beamsim.flow.variational import Differences, FlowOutputs, MotionDerivative, sensitivity
from beamsim.labelled import Dataset
from beamsim.results.values import ACCELERATION, OPENING, VALUES, Value, searched
from beamsim.scenario import Scenario
from beamsim.scenario.parameters import with_values
from beamsim.scenario.studies import VariedParameter, resolve_parameter
from beamsim.system.build import build_system
from beamsim.system.equations import ChannelSet
from beamsim.system.parts import Parts, SharedBuilds
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats, Ints, not_none

STEP = 2.0**-11  # of a number, or of the tolerance of one that is zero, between the systems that are built
SIDES = (1, -1, 2, -2)  # steps to systems that are built beside that of the run
BOTH = (
    0.0,
    8.0 / 12.0,
    -8.0 / 12.0,
    -1.0 / 12.0,
    1.0 / 12.0,
)  # weights of differences: of the run's own system, and of those
AHEAD = (-1.5, 2.0, 0.0, -0.5, 0.0)
APART = 1.5  # ratio of frequencies from which on modes have coordinates of their own
GRAZING = 1e-9  # of a number: a contact that so small a change takes away is only grazed
AT_END = 1e-9  # of a segment: what is nearer to its end is there
ROUND_OFF = 1e-12  # of a peak
STILL = 1e-9  # of its size, within which a channel is constant
MISSED = 2
MISSES = 8  # of each snubber, the nearest ones, that are looked at
BEND = 0.01  # of a derivative, by which that on one side may differ from it
NEGLIGIBLE = 1e-6  # of a value: changes that are smaller are not looked at


class Derivative(NamedTuple):
    """How a value of a run changes with a number of its scenario; a row of `SENSITIVITIES`."""

    response: str
    value: float
    value_unit: str
    derivative: float
    path: str
    number_unit: str
    number: float
    tolerance: float
    holds_within: float

    @property
    def change(self) -> float:
        """In the unit of the value."""
        return self.derivative * self.tolerance


class Varied(NamedTuple):
    """What a number of the scenario changes."""

    number: VariedParameter
    rates: Differences
    rows: dict[FlowOutputs, Floats]  # of the channels, of the systems on both sides
    start: Floats  # (N,) change of the state at the start


class Peak(NamedTuple):
    """An extreme of a channel, and when it is reached."""

    row: int  # of the channel
    high: int  # 1 the highest, 0 the lowest; `MISSED` what does not touch
    segment: int
    time: float  # s
    later: int  # 0 where the segment ends, 1 where it begins or between


def sensitivities_of(scenario: Scenario, motion: RunMotion) -> tuple[Dataset | None, list[str]]:
    """The derivatives of a run's values by the numbers that it names, and what is to be said of them.

    Parameters
    ----------
    scenario : of the run.
    motion : of it; of one that is not complete there are none.

    Returns
    -------
    derivatives, warnings

    Raises
    ------
    ScenarioError
        Where the motion is not known in closed form as a whole, or a number changes the size of the model.
    """
    settings, system, whole = not_none(scenario.run), motion.system, motion.trajectory
    if whole is None or whole.time[0] > 0.0:
        message = "need the whole motion in closed form"
        remedy = "use method: exact, piecewise_linear springs instead of cubic ones, and enough run.memory"
        raise ScenarioError(Problem("run.sensitivities", message, remedy))
    if not motion.outcome.complete:
        return None, ["run.sensitivities are left out: the motion is not complete"]
    trajectory, filtered = whole.held(), settings.low_pass is not None
    # a peak behind a filter is none of the motion
    chosen = [v for v in VALUES if v.of is not None and not (filtered and v.key == ACCELERATION)]
    numbers = [resolve_parameter(scenario, each) for each in settings.sensitivities]
    along = _Along(trajectory, _linear(system, chosen))
    plain = with_values(scenario, {("run", "sensitivities"): ()})
    pairs = [_varied(plain, system, along, chosen, number) for number in numbers]
    varied = [each for of in zip(*pairs, strict=True) for each in of]  # from both sides, then from one
    told = along.told(chosen)
    peaks = [along.peak(*key) for key in {key for *_, factors in told.values() for key in factors}]
    peaks = sorted(peaks + along.misses(), key=lambda peak: (peak.segment, peak.time))
    log, instants = along.cut(peaks)
    start = np.stack([each.start for each in varied], axis=1)
    found = sensitivity(trajectory.flow, along.outputs, log, [each.rates for each in varied], start, instants)
    slopes = [along.slope(peak, k, varied, found) for k, peak in enumerate(peaks)]
    by = {peak[:2]: slope for peak, slope in zip(peaks, slopes, strict=True)}
    values = {
        name: (value, unit, sum((w * by[key] for key, w in factors.items()), np.zeros(len(varied))))
        for name, (value, unit, factors) in told.items()
    } | _shares(system, trajectory, log, found)
    rows, warnings = list[Derivative](), along.still(told)
    missed = [k for k, peak in enumerate(peaks) if peak.high == MISSED]
    near = [(peaks[k].time, along.distance(peaks[k]), slopes[k]) for k in missed]
    for p, number in enumerate(numbers):
        holds, time = min(_reaches(found, log, near, p))
        tolerance, ahead = 0.5 * (number.high - number.low), p + len(numbers)
        about = number.path, number.unit, float(number.nominal), tolerance, holds
        rows += [Derivative(name, value, unit, float(of[p]), *about) for name, (value, unit, of) in values.items()]
        size = {name: max(abs(of[p]), NEGLIGIBLE * abs(value) / tolerance) for name, (value, _, of) in values.items()}
        bends = [(abs(of[ahead] - of[p]) / size[name], name) for name, (_, _, of) in values.items() if size[name]]
        warnings += _doubts(number, bends, holds, time)
    units = [{"value_unit": row.value_unit, "number_unit": row.number_unit} for row in rows]
    return (SENSITIVITIES.table(rows, units) if rows else None), warnings


def _reaches(
    found: MotionDerivative, log: Log, missed: Sequence[tuple[float, float, Floats]], p: int
) -> Iterator[tuple[float, float]]:
    """Changes of a number with which the contact of an event is only grazed, or an open one touches; and times, s.

    Parameters
    ----------
    found, log : derivatives along segments.
    missed : times at which an open contact is near, its distance, and the derivatives of that.
    p : which number.
    """
    yield np.inf, 0.0
    for time, (pace, turn), dt in zip(log.time, found.kept.pace.T, found.kept.dt[:, p], strict=False):
        if pace and turn * dt:
            yield abs(float(pace / (2.0 * turn * dt))), float(time)
    yield from ((distance / abs(float(slope[p])), time) for time, distance, slope in missed if slope[p])


def _doubts(number: VariedParameter, bends: Iterable[tuple[float, str]], holds: float, time: float) -> Iterator[str]:
    """What limits the derivatives by a number.

    Parameters
    ----------
    number : from the scenario.
    bends : shares of derivatives by which those on one side differ, with the names of the values.
    holds, time : the smallest change of the number that makes or takes away a contact, and when that is, s.
    """
    if bent := [each for each in bends if each[0] > BEND]:
        bend, name = max(bent)
        known = f"known to {100.0 * bend:.2g} %" if bend < 1.0 else "not known"
        others = f", and those of {len(bent) - 1} more" if len(bent) > 1 else ""
        yield (
            f"run.sensitivities: {number.path}: on both sides of it derivatives differ (a contact just touches, a node "
            f"of the mesh moves, a record is fitted anew), or they are lost in round-off: that of {name} is "
            f"{known}{others}"
        )
    at = f"run.sensitivities: {number.path}: at {time:.6g} s a contact is only grazed"
    if holds <= GRAZING * abs(float(number.nominal)):
        yield f"{at}: the derivatives of what follows are infinite"
    elif holds < 0.5 * (number.high - number.low):
        unit = "" if number.unit == "1" else f" {number.unit}"
        yield f"{at} where it changes by {holds:.3g}{unit}: the derivatives hold for smaller changes"


def _linear(system: StructuralSystem, chosen: Iterable[Value]) -> ChannelSet:
    """The channels of values; energies have none."""
    return searched(system.channels, chosen).only(lambda channel: not channel.squared)


def _varied(
    scenario: Scenario, system: StructuralSystem, along: _Along, chosen: Sequence[Value], number: VariedParameter
) -> tuple[Varied, Varied]:
    """What a number changes, from systems that are built on both sides of it, and from those on one side alone.

    Parameters
    ----------
    scenario, system, along : of the run.
    chosen : values of whose channels there are rows.
    number : from the scenario.
    """
    shared = system.parts.shared
    own, step = along.outputs, STEP * (abs(float(number.nominal)) or 0.5 * (number.high - number.low))
    step /= max(1.0, _turned(own.flow, _beside(scenario, own.flow, number, step, shared)[1]) / STEP)
    rows = {own: along.channels.linear}
    starts = {own: np.pad(system.initial_state, (0, own.flow.size - system.initial_state.size))}
    for side in SIDES:
        built, flow = _beside(scenario, own.flow, number, side * step, shared)
        outputs = FlowOutputs(flow, _turn(system.parts, built.parts), own.flow)
        rows[outputs] = _linear(built, chosen).linear
        starts[outputs] = outputs.state(built.initial_state)
    both, ahead = (Differences(own.flow, list(rows), [w / step for w in weights]) for weights in (BOTH, AHEAD))
    one, other = (Varied(number, each, rows, each.of(starts.__getitem__)) for each in (both, ahead))
    return one, other


def _beside(
    scenario: Scenario, flow: ExactFlow, number: VariedParameter, change: float, shared: SharedBuilds
) -> tuple[StructuralSystem, ExactFlow]:
    """The system for another value of a number, and its flow.

    Parameters
    ----------
    scenario, flow : of the run.
    number, change : from the scenario, and by how much it differs.
    shared : what systems of the run are built from.

    Raises
    ------
    ScenarioError
        Where the value is refused, or the model has another size.
    """
    try:
        values = dict.fromkeys(number.places, float(number.nominal) + change)
        built = build_system(with_values(scenario, values).rechecked(), shared)
    except ScenarioError as error:
        first = error.problems[0]
        message = f"{number.path} has a neighbouring value that is refused: {first.path} {first.message}"
        remedy = "let what depends on it follow: {path: ..., also: [...]}"
        raise ScenarioError(Problem("run.sensitivities", message, remedy)) from None
    other = exact_flow(built, flow.duration)
    if flow.sources.amplitude.shape != other.sources.amplitude.shape:
        message = f"{number.path} changes the number of pieces or sines of the input"
        raise ScenarioError(Problem("run.sensitivities", message, "vary it in a study: kind: one_at_a_time"))
    if not flow.is_like(other):
        message = f"{number.path} changes the number of nodes or modes of the model"
        remedy = "give reduction.modes, or a number of elements with which no node of the mesh is at its place"
        raise ScenarioError(Problem("run.sensitivities", message, remedy))
    return built, other


def _turned(flow: ExactFlow, other: ExactFlow) -> float:
    """rad, by how much inputs of two flows turn against one another where a piece of them begins: far at a late one."""
    own, changed = flow.sources, other.sources
    faster, later = np.abs(changed.exponent - own.exponent), np.abs(changed.start - own.start)
    return float(faster.max() * own.start.max() + np.abs(own.exponent).max() * later.max())


def _turn(own: Parts, other: Parts) -> Floats:
    """(n, n) orthogonal: the coordinates of a system for a unit of each of one beside it.

    Those whose frequencies are far apart stay apart: turned into one another by round-off, the stiffness of the higher
    ones would outweigh that of the lower ones.
    """
    order = np.argsort(own.omega)
    group = np.empty(order.size, dtype=np.int64)
    group[order] = np.cumsum(np.append(False, own.omega[order][1:] > APART * own.omega[order][:-1]))
    common = own.basis.vectors.T @ (own.structure.mass @ other.basis.vectors)
    left, _, right = np.linalg.svd(np.where(group[:, None] == group, common, 0.0))
    return np.asarray(left @ right)


class _Along:
    """Linear channels along the motion of a run."""

    def __init__(self, motion: Trajectory, channels: ChannelSet) -> None:
        self.motion, self.channels, self.outputs = motion, channels, FlowOutputs(motion.flow)
        self.output_of = outputs_of(motion.flow, channels.linear)
        low, when_low, high, when_high = motion.extrema(self.output_of)[:4]
        self.extremes, self.when = np.array([low, when_low, high, when_high]), (when_low, when_high)

    def told(self, chosen: Iterable[Value]) -> dict[str, tuple[float, str, dict[tuple[int, int], float]]]:
        """By name of a value: the value, its unit, and the factors of lowest and highest values of channels in it."""
        told: dict[str, tuple[float, str, dict[tuple[int, int], float]]] = {}
        for value in chosen:
            for channel, first in self.channels.located:
                extreme = self.extremes[:, first : first + channel.columns]
                if not value.takes(channel):
                    continue
                of = partial(value.of_channels, [channel])
                numbers, size = of(extreme), 2.0**-20 * (np.abs(extreme[::2]).max() or 1.0)
                best, name = int(np.argmax(numbers)), f"{value.section}/{channel.name}/{value.name}"
                name = value.name if value.single else name
                if name in told and told[name][0] >= numbers[best]:
                    continue
                units = [size * np.eye(4)[:, [2 * high]] for high in (0, 1)]
                apart = extreme + 4.0 * units[1]  # of two that are as large the highest counts
                slopes = [(of(apart + u) - of(apart - u))[best] / (2.0 * size) for u in units]
                signs = [float(np.round(slope)) if numbers[best] else 0.0 for slope in slopes]
                factors = {(first + best, high): sign for high, sign in enumerate(signs) if sign}
                told[name] = float(numbers[best]), channel.unit, factors
        return told

    def still(self, told: Mapping[str, tuple[float, str, Mapping[tuple[int, int], float]]]) -> list[str]:
        """A warning of values whose channel is constant, so that any number may make them larger, either way."""
        low, _, high, _ = self.extremes
        flat = high - low <= STILL * np.maximum(np.abs(low), np.abs(high))
        names = [name for name, (value, _, factors) in told.items() if value and any(flat[row] for row, _ in factors)]
        message = (
            "does not change along the motion: its derivatives are those of one instant, and any change may raise it"
        )
        return [f"run.sensitivities: {name} {message}" for name in names]

    def output(self, row: int, segment: int, time: float) -> Floats:
        """(3,) a channel on a segment, its rate and the rate of that."""
        motion, flow, values = self.motion, self.motion.flow, np.empty(3)
        phases, part = flow.states[motion.state[segment]].phases, motion.only(slice(segment, segment + 1))
        factors, rates = self.outputs.outputs(self.output_of, phases)[row], self.outputs.rates(phases)
        inputs, y = flow.inputs_at(np.array([time]), 3, part.time)[0], part.states_at(np.array([time]))[0]
        for order in range(3):
            v = np.append(y, inputs[order])
            values[order], y = factors @ v, rates @ v
        return values

    def distance(self, miss: Peak) -> float:
        """That of an open contact where it is near, m; as far as round-off tells where it just touches."""
        opening = self.output(miss.row, miss.segment, miss.time)[0]
        return float(max(abs(opening), ROUND_OFF * np.abs(self.extremes[::2, miss.row]).max()))

    def peak(self, row: int, high: int) -> Peak:
        """An extreme of a channel; between the ends of a segment its rate is zero there to round-off."""
        motion, time, sign = self.motion, float(self.when[high][row]), 2 * high - 1
        ends, near = motion.time + motion.length, 1e-12 * motion.end
        here = np.flatnonzero((motion.time <= time + near) & (ends >= time - near) & (motion.length > 0.0)).tolist()
        within = {g: min(max(time, float(motion.time[g])), float(ends[g])) for g in here}
        segment = max(here, key=lambda g: sign * self.output(row, g, within[g])[0])
        begin, end, at = float(motion.time[segment]), float(ends[segment]), within[segment]
        value = sign * float(self.output(row, segment, at)[0])
        least = value - ROUND_OFF * abs(value)
        for _ in range(8):
            _, rate, turn = self.output(row, segment, at)
            moved = at - rate / turn if sign * turn < 0.0 else np.nan
            if not begin <= moved <= end or sign * self.output(row, segment, moved)[0] < least:
                break
            at = moved
        if min(at - begin, end - at) > AT_END * (end - begin):
            return Peak(row, high, segment, at, 1)
        later = int(at - begin < end - at)
        return Peak(row, high, segment, begin if later else end, later)

    def misses(self) -> list[Peak]:
        """The nearest ones of the moments when an open snubber is closest to the structure and does not touch."""
        motion, found = self.motion, list[Peak]()
        touching = motion.flow.system.contacts.touching(motion.phases)
        for j, row in enumerate(self.channels.places.get(OPENING, ())):

            def opening(phases: Ints, row: int = row) -> Floats:
                return self.output_of(phases)[row : row + 1]

            segment, time, value = motion.turning_points(opening, np.flatnonzero(~touching[:, j]))
            least = -ROUND_OFF * float(np.abs(value).max(initial=0.0))  # what just touches may be beyond by that
            inner = 1 + np.flatnonzero((value[1:-1] < value[:-2]) & (value[1:-1] < value[2:]) & (value[1:-1] > least))
            inner = inner[(segment[inner - 1] == segment[inner]) & (segment[inner + 1] == segment[inner])]
            nearest = inner[np.argsort(value[inner])[:MISSES]]
            found += [Peak(int(row), MISSED, int(segment[k]), float(time[k]), 1) for k in nearest]
        return found

    def cut(self, peaks: Sequence[Peak]) -> tuple[Log, list[tuple[int, int]]]:
        """The motion with a segment that begins at each peak, and where the peaks are for `sensitivity`."""
        motion = self.motion
        inner = sorted({p[2:4] for p in peaks if motion.time[p.segment] < p.time and p.later})
        segments, times = (np.array([each[k] for each in inner]) for k in (0, 1))
        of = np.concatenate([np.arange(motion.time.size), segments]).astype(np.int64)
        time = np.concatenate([motion.time, times])
        y = np.concatenate([motion.y, motion.states_at(times) if inner else motion.y[:0]])
        order = np.lexsort((time, of))
        of, time = of[order], time[order]
        last = np.append(of[1:] != of[:-1], True)
        length = np.where(last, motion.time[of] + motion.length[of], np.append(time[1:], 0.0)) - time
        log = Log(
            time, length, motion.state[of], motion.piece[of], y[order], motion.event_time, motion.event_contact,
            motion.event_before, motion.event_phase,
        )  # fmt: skip
        instants = [
            (int(np.flatnonzero((of == p.segment) & (time == p.time))[0]) if p.later
             else int(np.searchsorted(of, p.segment, side="right")), p.later)
            for p in peaks
        ]  # fmt: skip
        return log, instants

    def slope(self, peak: Peak, place: int, varied: Sequence[Varied], found: MotionDerivative) -> Floats:
        """(P,) derivatives of an extreme.

        Parameters
        ----------
        peak : the extreme.
        place : of the instant when it is reached, among those that are kept.
        varied : (P,) what changes.
        found : derivatives of the motion.
        """
        flow, kept = self.motion.flow, found.kept
        phases, v = flow.states[self.motion.state[peak.segment]].phases, kept.instant.v[place]

        def factors(side: FlowOutputs, rows: Mapping[FlowOutputs, Floats]) -> Floats:
            row = rows[side][peak.row : peak.row + 1]
            return np.asarray(side.outputs(outputs_of(side.flow, row), phases)[0])

        own = factors(self.outputs, {self.outputs: self.channels.linear})
        rows = [each.rates.of(partial(factors, rows=each.rows)) for each in varied]
        fixed = own[: flow.size] @ kept.S[place] + kept.instant.moved[place] @ own[flow.size :]
        moves = own @ kept.instant.moving[place] * kept.dt[kept.event[place]]
        return np.asarray(fixed + [row @ v for row in rows] + moves)


def _shares(
    system: StructuralSystem, motion: Trajectory, log: Log, found: MotionDerivative
) -> dict[str, tuple[float, str, Floats]]:
    """Shares of the time in contact of snubbers by name, with unit and derivatives (P,).

    Parameters
    ----------
    system, motion : of the run.
    log : cut segments of the motion.
    found : derivatives along them.
    """
    touching = motion.flow.system.contacts.touching(np.array(motion.flow.visited)[log.state]).astype(int)
    by = -np.diff(touching, axis=0).T @ found.kept.dt[1:-1] / motion.end
    shares = motion.contact_share()
    names = [snubber.name for snubber in system.snubbers]
    return {f"snubbers/{name}/contact_share": (float(shares[j]), "1", by[j]) for j, name in enumerate(names)}
