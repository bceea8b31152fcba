r"""Derivatives of a run's values by numbers of its scenario.

A number changes the system that is built from it. Its derivative follows from systems built on both sides, by
fourth-order differences, in coordinates rotated to those of the run: the orthogonal factor of :math:`V_0^T M V` does
not depend on signs, order and mixing of modes. Along the motion, :mod:`beamsim.flow.variational` propagates it exactly
from event to event. A peak :math:`x = D v` of an output, with v the state and the inputs, has

.. math:: dx/dp = D\, \partial_p v + \partial_p D\, v + \dot x\, \partial_p t,

if its time moves with an event, otherwise :math:`\dot x = 0`; a time in contact changes with the times of its events.

A contact whose guard has the rate g' and the second derivative g'' at its event only grazes after a change of the
number by about :math:`|g' / (2 g''\, \partial_p t)|`; a contact that stays open at a distance closes after about that
distance over its derivative. A contact near the end of the record leaves or enters the record when its time has moved
that far. Beyond such changes the contact sequence differs, and no derivative applies. A peak is the largest of many
extremes, each with derivatives: where they cross, another one takes over (:mod:`beamsim.results.competition`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from beamsim.analyses.run.extremes import Contenders, LocalExtremes, Variation
from beamsim.analyses.run.layouts import SENSITIVITIES
from beamsim.analyses.run.motion import RunMotion
from beamsim.errors import Problem, ScenarioError
from beamsim.flow.exact import ExactFlow, exact_flow
from beamsim.flow.trajectory import Trajectory
from beamsim.flow.transient import Log
from beamsim.flow.variational import Differences, FlowOutputs, MotionDerivative, sensitivity
from beamsim.labelled import Dataset
from beamsim.outcomes import first_of
from beamsim.results.competition import NEGLIGIBLE, Competition
from beamsim.results.values import ACCELERATION, VALUES, Value, parse_limit, searched_channels
from beamsim.scenario import Scenario
from beamsim.scenario.parameters import with_values
from beamsim.scenario.studies import VariedParameter, resolve_parameter
from beamsim.system.build import build_system
from beamsim.system.equations import ChannelSet
from beamsim.system.reduced_model import ReducedModel, SharedBuilds
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats, not_none

STEP = 2.0**-11  # relative to a number, or to the tolerance of one that is zero: distance of neighbouring systems
NEIGHBOUR_STEPS = (1, -1, 2, -2)  # positions of the neighbouring systems, in steps
# weights of central differences: own system, then neighbours
CENTRAL_WEIGHTS = 0.0, 8.0 / 12.0, -8.0 / 12.0, -1.0 / 12.0, 1.0 / 12.0
FORWARD_WEIGHTS = (-1.5, 2.0, 0.0, -0.5, 0.0)
SEPARATE_RATIO = 1.5  # ratio of frequencies above which modes are not mixed
GRAZING = 1e-9  # relative to a number: a contact that such a change removes only grazes
GRAZED = "is only grazed"
KINK = 0.01  # relative difference of a one-sided derivative that counts as a kink


class Derivative(NamedTuple):
    """Change of a value of a run with a number of its scenario; a row of `SENSITIVITIES`."""

    response: str
    value: float
    value_unit: str
    derivative: float
    derivative_below: float
    derivative_above: float
    path: str
    number_unit: str
    number: float
    tolerance: float
    holds_within: float
    change: float  # in the unit of the value
    change_below: float


NearContact = tuple[float, float, Floats]
"""Time of a contact that nearly changes, s, its distance from the change, and its derivatives (P,)."""


class Reach(NamedTuple):
    """Change of a number at which a contact begins or ends."""

    change: float
    time: float  # s, time of the contact
    event: str  # description of the change


def sensitivities_of(scenario: Scenario, motion: RunMotion) -> tuple[Dataset | None, list[str]]:
    """Derivatives of a run's values by the numbers that it lists, and warnings.

    Parameters
    ----------
    scenario : scenario of the run.
    motion : motion of the run; no derivatives if it is incomplete.

    Returns
    -------
    derivatives, warnings

    Raises
    ------
    ScenarioError
        If the motion is not known completely in closed form, or a number changes the size of the model.
    """
    settings, system, whole = not_none(scenario.run), motion.system, motion.trajectory
    if whole is None or whole.time[0] > 0.0:
        message = "need the whole motion in closed form"
        remedy = "use method: exact, piecewise_linear springs instead of cubic ones, and enough run.memory"
        raise ScenarioError(Problem("run.sensitivities", message, remedy))
    if not motion.outcome.complete:
        return None, ["run.sensitivities are left out: the motion is not complete"]
    trajectory, filtered = whole.with_all_states(), settings.low_pass is not None
    # a filtered peak does not belong to the motion
    chosen = [v for v in VALUES if v.from_extreme is not None and not (filtered and v.key == ACCELERATION)]
    numbers = [resolve_parameter(scenario, each) for each in settings.sensitivities]
    along = LocalExtremes(trajectory, _linear(system, chosen))
    plain = with_values(scenario, {("run", "sensitivities"): ()})
    pairs = [_variation_of_number(plain, system, along, chosen, number) for number in numbers]
    varied = [each for of in zip(*pairs, strict=True) for each in of]  # two-sided, then one-sided
    everywhere = [
        of for of, place in map(parse_limit, scenario.limits.values_by_name if scenario.limits else ()) if not place
    ]
    contests, misses = along.contests(chosen, everywhere), along.misses()
    ends, order = along.ends(), lambda peak: (peak.segment, peak.time, peak.later)
    peaks = sorted({*misses, *ends, *(peak for of in contests for peak in of.peaks)}, key=order)
    log, instants = along.cut(peaks)
    start = np.stack([each.start for each in varied], axis=1)
    found = sensitivity(trajectory.flow, along.outputs, log, [each.rates for each in varied], start, instants)
    by = dict(zip(peaks, along.slopes(peaks, varied, found), strict=True))
    near = [(miss.time, along.distance(miss), by[miss]) for miss in misses]
    beyond = [*along.entering(ends, [peaks.index(end) for end in ends], varied, found)]
    every = [*(of.contenders(by) for of in contests), *_shares(system, trajectory, log, found)]
    rows, warnings = list[Derivative](), along.constant_channel_warnings(contests)
    noted = list[tuple[VariedParameter, Contenders, Competition]]()
    for p, number in enumerate(numbers):
        holds = min(_reaches_of_number(found, log, near, beyond, p))
        decided = [of.competition(p, _tolerance(number)) for of in every]
        rows += [_derivative(number, of, each, holds.change) for of, each in zip(every, decided, strict=True)]
        warnings += _derivative_limits(number, _kinks(every, p, p + len(numbers), _tolerance(number)), holds)
        noted += [(number, of, each) for of, each in zip(every, decided, strict=True) if each.is_close]
    warnings += _competition_notes(noted)
    units = [{"value_unit": row.value_unit, "number_unit": row.number_unit} for row in rows]
    return (SENSITIVITIES.table(rows, units) if rows else None), warnings


def _tolerance(number: VariedParameter) -> float:
    """Tolerance on either side, in the unit of the number."""
    return 0.5 * (number.high - number.low)


def _derivative(number: VariedParameter, contenders: Contenders, competition: Competition, holds: float) -> Derivative:
    """Row of a value and a number.

    Parameters
    ----------
    number, contenders : number, and value with its derivatives.
    competition : change of the value with the number.
    holds : smallest change of the number that adds or removes a contact.
    """
    return Derivative(
        contenders.name, float(contenders.values[0]), contenders.unit,
        competition.derivative, competition.derivative_below, competition.derivative_above,
        number.path, number.unit, float(number.nominal), _tolerance(number),
        min(holds, abs(competition.takeover)), competition.change_above, competition.change_below,
    )  # fmt: skip


def _kinks(contenders: Iterable[Contenders], p: int, one_sided: int, tolerance: float) -> Iterator[tuple[float, str]]:
    """Relative differences of one-sided derivatives, with the names of the values.

    Parameters
    ----------
    contenders : the values.
    p, one_sided : columns of the two-sided and the one-sided derivatives.
    tolerance : tolerance of the number.
    """
    for of in contenders:
        both, one = float(of.slopes[0, p]), float(of.slopes[0, one_sided])
        if size := max(abs(both), NEGLIGIBLE * abs(float(of.values[0])) / tolerance):
            yield abs(one - both) / size, of.name


def _competition_notes(noted: Sequence[tuple[VariedParameter, Contenders, Competition]]) -> Iterator[str]:
    """Note on values with competing extremes: the closest one with both derivatives, and the number of others.

    Parameters
    ----------
    noted : numbers, values, and changes of the values.
    """
    if not noted:
        return
    nearest = min(noted, key=lambda one: abs(one[2].takeover) / _tolerance(one[0]))
    number, of, each = nearest
    unit, per = ("" if unit == "1" else f" {unit}" for unit in (number.unit, _derivative_unit(of.unit, number.unit)))
    names = list(dict.fromkeys(one[1].name for one in noted if one is not nearest))
    others = f"{len(noted) - 1} more {'derivative' if len(noted) == 2 else 'derivatives'} of {first_of(names, 3)}"
    yield (
        f"run.sensitivities: {number.path}: extremes compete: {of.name} has the derivative "
        f"{each.derivative_below:.4g}{per} for smaller and {each.derivative_above:.4g}{per} for larger values (the "
        f"extreme at {of.times[each.rival]:.6g} s takes over where it changes by {each.takeover + 0.0:+.3g}{unit})"
        + (f"; the table gives both sides of {others}, too" if names else "")
    )


def _derivative_unit(unit: str, number_unit: str) -> str:
    """Unit of a derivative.

    >>> _derivative_unit("N", "N/m"), _derivative_unit("m", "m"), _derivative_unit("m", "1")
    ('N/(N/m)', '1', 'm')
    """
    if unit == number_unit:
        return "1"
    if number_unit == "1":
        return unit
    return f"{unit}/({number_unit})" if set(number_unit) & set("/ ") else f"{unit}/{number_unit}"


def _reaches_of_number(
    derivative: MotionDerivative, log: Log, misses: Iterable[NearContact], record_ends: Iterable[NearContact], p: int
) -> Iterator[Reach]:
    """Changes of a number at which contacts appear in, or disappear from, the motion.

    Parameters
    ----------
    derivative, log : derivatives along segments.
    misses : times of closest approach of open contacts, s, distances, and their derivatives.
    record_ends : ends of the record with a contact about to change, the event function, and its derivatives.
    p : index of the number.
    """
    yield Reach(np.inf, 0.0, "")
    end = float(log.time[-1] + log.length[-1])
    for time, (pace, turn), dt in zip(
        log.time.tolist(), derivative.stored.guard_rate.T, derivative.stored.dt[:, p], strict=False
    ):
        if pace and dt:
            yield Reach(abs(float(pace / (2.0 * turn * dt))) if turn else np.inf, time, GRAZED)
            yield Reach(abs(min(time, end - time) / float(dt)), time, "leaves the record")
    for what, nears in ((GRAZED, misses), ("enters the record", record_ends)):
        yield from (Reach(distance / abs(float(slope[p])), time, what) for time, distance, slope in nears if slope[p])


def _derivative_limits(number: VariedParameter, kinks: Iterable[tuple[float, str]], reach: Reach) -> Iterator[str]:
    """Reasons why the derivatives by a number are valid only within a range.

    Parameters
    ----------
    number : number of the scenario.
    kinks : relative differences of one-sided derivatives, with the names of the values.
    reach : smallest change of the number that adds or removes a contact.
    """
    if bent := [each for each in kinks if each[0] > KINK]:
        bend, name = max(bent)
        known = f"known to {100.0 * bend:.2g} %" if bend < 1.0 else "not known"
        others = f", and those of {len(bent) - 1} more" if len(bent) > 1 else ""
        yield (
            f"run.sensitivities: {number.path}: on both sides of it derivatives differ (a contact just touches, a node "
            f"of the mesh moves, a record is fitted anew), or they are lost in round-off: that of {name} is "
            f"{known}{others}"
        )
    at = f"run.sensitivities: {number.path}: at {reach.time:.6g} s a contact {reach.event}"
    if reach.event == GRAZED and reach.change <= GRAZING * abs(float(number.nominal)):
        yield f"{at}: the derivatives of what follows are infinite"
    elif reach.change < _tolerance(number):
        unit = "" if number.unit == "1" else f" {number.unit}"
        yield f"{at} if it changes by {reach.change:.3g}{unit}: the derivatives are valid for smaller changes"


def _linear(system: StructuralSystem, values: Iterable[Value]) -> ChannelSet:
    """Channels of values; energies have none."""
    return searched_channels(system.channels, values).select(lambda channel: not channel.squared)


def _variation_of_number(
    scenario: Scenario,
    system: StructuralSystem,
    extremes: LocalExtremes,
    values: Sequence[Value],
    number: VariedParameter,
) -> tuple[Variation, Variation]:
    """Effect of a number, from systems built on both sides of its value, or on one side only.

    Parameters
    ----------
    scenario, system, extremes : scenario, system and extremes of the run.
    values : values whose channels are needed.
    number : number of the scenario.
    """
    shared = system.model.builds
    own, step = extremes.outputs, STEP * (abs(float(number.nominal)) or _tolerance(number))
    step /= max(
        1.0, _rotation_between(own.flow, _neighbouring_flow(scenario, own.flow, number, step, shared)[1]) / STEP
    )
    rows = {own: extremes.channels.linear}
    starts = {own: np.pad(system.initial_state, (0, own.flow.size - system.initial_state.size))}
    for side in NEIGHBOUR_STEPS:
        built, flow = _neighbouring_flow(scenario, own.flow, number, side * step, shared)
        outputs = FlowOutputs(flow, _rotation(system.model, built.model), own.flow)
        rows[outputs] = _linear(built, values).linear
        starts[outputs] = outputs.state(built.initial_state)
    both, ahead = (
        Differences(own.flow, list(rows), [w / step for w in weights]) for weights in (CENTRAL_WEIGHTS, FORWARD_WEIGHTS)
    )
    one, other = (Variation(each, rows, each.of(starts.__getitem__)) for each in (both, ahead))
    return one, other


def _neighbouring_flow(
    scenario: Scenario, flow: ExactFlow, number: VariedParameter, change: float, builds: SharedBuilds
) -> tuple[StructuralSystem, ExactFlow]:
    """System for another value of a number, and its flow.

    Parameters
    ----------
    scenario, flow : scenario and flow of the run.
    number, change : number of the scenario, and its change.
    builds : cache of built systems.

    Raises
    ------
    ScenarioError
        If the value is refused, or the model has another size.
    """
    try:
        values = dict.fromkeys(number.places, float(number.nominal) + change)
        built = build_system(with_values(scenario, values).recheck(), builds)
    except ScenarioError as error:
        first = error.problems[0]
        message = f"{number.path} has a neighbouring value that is refused: {first.path} {first.message}"
        remedy = "let what depends on it follow: {path: ..., also: [...]}"
        raise ScenarioError(Problem("run.sensitivities", message, remedy)) from None
    other = exact_flow(built, flow.duration)
    if flow.sources.amplitude.shape != other.sources.amplitude.shape:
        message = f"{number.path} changes the number of pieces or sines of the input"
        raise ScenarioError(Problem("run.sensitivities", message, "vary it in a study: kind: one_at_a_time"))
    if not flow.has_same_layout(other):
        message = f"{number.path} changes the number of nodes or modes of the model"
        remedy = "give reduction.modes, or a number of elements with which no node of the mesh is at its place"
        raise ScenarioError(Problem("run.sensitivities", message, remedy))
    return built, other


def _rotation_between(flow: ExactFlow, other: ExactFlow) -> float:
    """Angle in rad between the inputs of two flows at the start of a piece; it can be large at late pieces."""
    own, changed = flow.sources, other.sources
    faster, later = np.abs(changed.exponent - own.exponent), np.abs(changed.start - own.start)
    return float(faster.max() * own.start.max() + np.abs(own.exponent).max() * later.max())


def _rotation(own: ReducedModel, other: ReducedModel) -> Floats:
    """(n, n) orthogonal matrix: coordinates of a system for each unit coordinate of a neighbouring one.

    Modes with very different frequencies are not mixed: mixed by round-off, the stiffness of the higher ones would
    dominate that of the lower ones.
    """
    order = np.argsort(own.omega)
    group = np.empty(order.size, dtype=np.int64)
    group[order] = np.cumsum(np.append(False, own.omega[order][1:] > SEPARATE_RATIO * own.omega[order][:-1]))
    common = own.basis.vectors.T @ (own.structure.mass @ other.basis.vectors)
    left, _, right = np.linalg.svd(np.where(group[:, None] == group, common, 0.0))
    return np.asarray(left @ right)


def _shares(system: StructuralSystem, motion: Trajectory, log: Log, derivative: MotionDerivative) -> list[Contenders]:
    """Time shares in contact of snubbers, with their derivatives.

    Parameters
    ----------
    system, motion : system and motion of the run.
    log : cut segments of the motion.
    derivative : derivatives along them.
    """
    touching = motion.flow.system.contacts.closed(np.array(motion.flow.visited_phases)[log.state]).astype(int)
    by = -np.diff(touching, axis=0).T @ derivative.stored.dt[1:-1] / motion.end
    shares, end = motion.contact_share(), np.array([motion.end])
    names = [f"snubbers/{snubber.name}/contact_share" for snubber in system.snubbers]
    return [Contenders(name, "1", 1.0, 0.0, shares[[j]], end, by[[j]]) for j, name in enumerate(names)]
