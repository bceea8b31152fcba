"""The error of every value, from its change when the case is solved again with a finer model.

The finer model has three times the modes, or all of a model that has few, twice the sides of rings and the segments of
smooth laws, and, where a body has a mesh, twice the elements. If the error of a value falls at least with the square of
the number of modes, the change is at least 8/9 of the error; so the stated error is 9/8 of the change (4/3 with plates,
whose meshes are of second order, and with smooth laws, and 1.55 for reactions at the edges of plates, of order 1.5). A
value with an error of more than `ALLOWED_ERROR` is doubtful. Values are numbers by entry of a summary, or by entry and
place (a probe, a snubber, a curve). docs/theory.md, section 7, gives the orders of convergence.

A motion with repeated impacts may be so sensitive that any small change gives a different sequence of contacts after
some time. The motion after this divergence is one of many, and no model or precision can determine which.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self, TypeVar

import numpy as np

from beamsim.analyses.run.stepped_motion import relative_tolerance
from beamsim.flow.reference import ReferenceTrajectory
from beamsim.flow.trajectory import Trajectory
from beamsim.flow.transient import MotionInChunks
from beamsim.labelled import Dataset
from beamsim.outcomes import Outcome, OutcomeKind, numbers_text
from beamsim.results.result import ALLOWED_ERROR, Result
from beamsim.results.values import is_main_value, limits, parse_limit
from beamsim.scenario import Scenario
from beamsim.summaries import value_in_words
from beamsim.system.force_tables import with_finer_tables
from beamsim.typing import Floats, Ints, not_none

FREQUENCIES = 6  # natural frequencies that are compared
SMALLEST_SCALE = 1e-9  # smallest reference of a relative change, over the largest value of its kind

Values = dict[str, dict[str, float] | float]
Changes = Values  # relative, from one model to the other
Errors = Values  # relative, of the first model
SAME_EVENT = 0.1  # of the mean time between a contact's closings: two events further apart are not the same
SMALL, ROUND_OFF = 1e-9, 1e-15  # relative disturbances of the stiffness
LONGER = 8.0  # factor by which the search interval for a divergence is extended
WORTHLESS = 0.5  # relative error of a displacement or force beyond which a result is not reliable
MUST_HOLD = (
    "peak_displacement_m", "peak_force_n", "peak_moment_n_m", "peak_spring_force_n", "peak_friction_force_n",
    "peak_friction_moment_n_m",
)  # fmt: skip
MORE_MODES = 3.0  # times the modes, in the finer model
ORDER = 2.0  # of convergence with the number of modes: the finer model has 1/9 of the error
# values that depend on high modes: accelerations, and outputs of these kinds, which include inertia forces
OF_HIGH_MODES = (
    "peak_acceleration_g",
    "acceleration",
    "reaction_force",
    "reaction_moment",
    "joint_force",
    "joint_moment",
)
LEAST_OF_ACCELERATIONS = 1e-3  # smallest relative error of a peak acceleration, unless both models are the same
LEAST_OF_SHARES = 0.01  # smallest relative error of a share of high peaks, which may agree by chance
SHARE_OF_LARGEST = 0.125  # of the largest error of a peak acceleration of the motion, that each of them has ...
CONVERGING = 0.1  # ... if it is below this
MANY = 10.0  # factor of the number of modes for which the error of a count is stated
COUNTED_PEAKS = ("peaks_over_2_sigma", "peaks_over_3_sigma")  # endings of statistics that are shares of peaks
COUNTED = (*COUNTED_PEAKS, "crossing_rate_hz")  # endings of statistics that are counts
FEW_MODES = 60  # up to so many coordinates without a mesh the finer model keeps all modes, at little cost
COMPARISON, NOT_ASKED = "the comparison with a finer model", "not requested"
_Result = TypeVar("_Result", bound="Result")


def comparable_values(summary: Mapping[str, Any]) -> Values:
    """Comparable values of a summary: numbers, or numbers by place; natural frequencies by their number."""
    values: Values = {}
    for name, value in summary.items():
        if isinstance(value, Sequence):
            values[name] = {str(k): float(x) for k, x in enumerate(value[:FREQUENCIES], 1)}
        elif isinstance(value, Mapping):  # by place, of several curves by curve and place
            curves = {curve: of for curve, of in value.items() if isinstance(of, Mapping)}
            of_curves = {f"{curve} {place}": x for curve, of in curves.items() for place, x in of.items()}
            values[name] = of_curves if curves else dict(value)
        else:
            values[name] = float(value)
    return values


def places(value: dict[str, float] | float) -> list[tuple[str, float]]:
    """Places with their numbers; the place of a single number is empty."""
    return list(value.items()) if isinstance(value, dict) else [("", value)]


def numbers_by_place(values: Values) -> Iterator[tuple[str, float]]:
    """Pairs of ``entry.place`` and number; of ``entry`` alone for single numbers."""
    for name, value in values.items():
        if isinstance(value, dict):
            yield from ((f"{name}.{place}", number) for place, number in value.items())
        else:
            yield name, value


def errors_of(changes: Changes, scenario: Scenario, complete: bool) -> Errors:
    """The errors that follow from changes to the finer model; the changes themselves if that model is complete.

    Most values converge with `ORDER`. Counts may grow with each mode: their error is stated for `MANY` times the
    modes. Peaks of accelerations and of forces with inertia depend on high modes and may agree by chance: their error
    is at least `LEAST_OF_ACCELERATIONS`, and a share of the largest error of the motion. Shares of high peaks likewise.

    Parameters
    ----------
    changes : of the values of a model.
    scenario : its meshes have an order of convergence, too.
    complete : whether the finer model keeps all modes, see `keeps_all`, and no law is approximated.
    """
    if complete:
        return changes
    bodies, of_modes = scenario.all_bodies.values(), MORE_MODES**-ORDER
    left = max(of_modes, *(2.0**-body.mesh_order for body in bodies))
    if scenario.has_force_tables and scenario.has_smooth_laws:
        left = max(left, 2.0**-ORDER)
    at_edges = max(of_modes, *(2.0**-body.reaction_order for body in bodies))
    kinds = {each.name: each.kind for _, each in scenario.requested_outputs}
    errors: Errors = {}
    for name, of in changes.items():
        found = dict(places(of))
        # an output of a sweep has the name of the curve before its own
        is_output = name.endswith("_output")
        kind = {place: kinds.get(place.rpartition(" ")[2], "") if is_output else name for place in found}
        for place in found:
            found[place] /= 1.0 - (at_edges if kind[place].startswith("reaction") else left)
        high = [place for place in found if kind[place] in OF_HIGH_MODES]
        converging = max((found[place] for place in high if found[place] < CONVERGING), default=0.0)
        least = max(LEAST_OF_ACCELERATIONS, SHARE_OF_LARGEST * converging)  # peaks may agree by chance
        found |= {place: max(found[place], least) for place in high if found[place]}
        for place in found:
            if name == "contacts" or place.endswith(COUNTED):
                found[place] *= (MANY - 1.0) / (MORE_MODES - 1.0)
            if place.endswith(COUNTED_PEAKS):
                found[place] = max(found[place], LEAST_OF_SHARES)
        errors[name] = found if isinstance(of, dict) else found[""]
    return errors


def exact(values: Values) -> Errors:
    """Zero errors, for a model that keeps all modes."""
    return {name: dict.fromkeys(value, 0.0) if isinstance(value, dict) else 0.0 for name, value in values.items()}


def relative_changes(
    first: Sequence[Values], second: Sequence[Values], *, scatter: bool = False, reference: Values | None = None
) -> Changes:
    """Relative change of the means of values, or two standard errors of it.

    Parameters
    ----------
    first, second : the values of parts of two motions, or of the whole of each.
    scatter : whether to return the standard errors.
    reference : values that the changes are relative to if they are larger.

    Returns
    -------
    By entry and place of the first; places that the second does not have are left out.
    """
    changes: Changes = {}
    for name, value in first[0].items():
        of_entry = [place for place, _ in places(value)]
        size_of = f"peak{name[3:]}" if name.startswith(("min_", "max_")) else name  # as either extreme may be zero
        known = [
            [dict(places(part.get(entry, {}))) for part in parts]
            for entry in (name, size_of)
            for parts in (first, second)
        ]
        one, other, *sizes = (
            np.array([[of_place.get(place, math.nan) for place in of_entry] for of_place in parts]) for parts in known
        )
        scale = np.maximum(*(np.abs(x).mean(axis=0) for x in sizes))
        if reference is not None:
            of_whole = dict(places(reference[size_of]))
            scale = np.maximum(scale, np.abs([of_whole.get(place, math.nan) for place in of_entry]))
        if not name.endswith("_output"):  # which have units of their own
            scale = np.maximum(scale, SMALLEST_SCALE * np.nanmax(scale, initial=0.0))
        difference = one - other
        size = np.abs(difference.mean(axis=0))
        if scatter:
            size = 2 * difference.std(axis=0, ddof=1) / math.sqrt(len(first))
        relative = np.divide(size, scale, out=np.zeros_like(size), where=size != 0)
        by_place = {place: float(x) for place, x in zip(of_entry, relative, strict=True) if not math.isnan(x)}
        changes[name] = by_place if isinstance(value, dict) else by_place.get("", 0.0)
    return changes


def largest_changes(first: Changes, second: Changes) -> Changes:
    """The larger of two changes of each value."""
    out = dict(first)
    for name, value in second.items():
        present = out.get(name, value)
        if isinstance(value, dict) and isinstance(present, dict):
            out[name] = {place: max(x, present.get(place, 0.0)) for place, x in value.items()}
        elif not isinstance(value, dict) and not isinstance(present, dict):
            out[name] = max(value, present)
    return out


def largest_errors(errors: Errors, lower_bounds: Errors) -> Errors:
    """The errors, raised to the lower bounds of their entries and places."""
    known = dict(numbers_by_place(lower_bounds))
    return {
        name: {place: max(x, known.get(f"{name}.{place}", 0.0)) for place, x in of.items()}
        if isinstance(of, dict) else max(of, known.get(name, 0.0))
        for name, of in errors.items()
    }  # fmt: skip


def unconverged_values(errors: Errors, scatter: Changes) -> Iterator[str]:
    """``entry.place`` of the values whose error exceeds both the allowed one and their scatter.

    A displacement or force with an error of more than half is always included.
    """
    chance = dict(numbers_by_place(scatter))
    for key, error in numbers_by_place(errors):
        most = ALLOWED_ERROR + chance.get(key, 0.0)
        if error > (min(most, WORTHLESS) if key.partition(".")[0] in MUST_HOLD else most):
            yield key


@dataclass(frozen=True)
class ContactEvents:
    """The events (E,) of the snubbers of a motion in order of time."""

    end: float  # s, of the motion
    time: Floats
    contact: Ints
    phase: Ints  # of the contact after the event

    @classmethod
    def of(cls, motion: Trajectory | MotionInChunks | ReferenceTrajectory, snubbers: int) -> Self:
        """The events of a motion whose first ``snubbers`` contacts are snubbers."""
        these = motion.event_contact < snubbers
        return cls(motion.end, motion.event_time[these], motion.event_contact[these], motion.event_phase[these])

    def of_touching(self, motion: Trajectory | MotionInChunks | ReferenceTrajectory) -> Self:
        """The events at which a contact closes or opens; ``phase`` then is 1 or -1.

        Parameters
        ----------
        motion : to which these events belong.
        """
        change = motion.touch_changes[np.isin(motion.event_contact, np.unique(self.contact))]
        met = change != 0
        return replace(self, time=self.time[met], contact=self.contact[met], phase=change[met])

    def until(self, end: float) -> Self:
        """The events up to a time, s."""
        count = int(np.searchsorted(self.time, end, side="right"))
        return replace(self, end=end, time=self.time[:count], contact=self.contact[:count], phase=self.phase[:count])


def divergence(first: ContactEvents, second: ContactEvents) -> float:
    """Time at which the contact sequences of two motions diverge, s; infinite if they do not.

    Each contact has its own sequence: in a symmetric structure the order of two contacts may be round-off.
    """
    end, diverged = min(first.end, second.end), math.inf
    for contact in np.union1d(first.contact, second.contact):
        of_first, of_second = first.contact == contact, second.contact == contact
        one, other = first.time[of_first], second.time[of_second]
        apart = SAME_EVENT * end / max(one.size / 2, 1.0)
        common = min(one.size, other.size)
        same = first.phase[of_first][:common] == second.phase[of_second][:common]
        same &= np.abs(one[:common] - other[:common]) <= apart
        rest = one if one.size > common else other
        if not same.all():
            k = int(np.argmin(same))
            diverged = min(diverged, float(one[k]), float(other[k]))
        elif rest.size > common and rest[common] < end - apart:
            diverged = min(diverged, float(rest[common]))
    return diverged


@dataclass(frozen=True)
class DivergenceTimes:
    """Times after which small changes of the stiffness give other contacts, s; infinite where none was seen."""

    small_change_s: float = math.inf  # for a relative change of 1e-9
    round_off_s: float = math.inf  # for a relative change of 1e-15

    @property
    def sensitive(self) -> bool:
        """Whether changes far below any tolerance of a structure give other contacts."""
        return math.isfinite(min(self.small_change_s, self.round_off_s))


def sensitivity(
    motion: ContactEvents, divergence_s: float, disturbed_events: Callable[[float, float], ContactEvents]
) -> DivergenceTimes:
    """When motions with a disturbed stiffness diverge from a motion.

    Parameters
    ----------
    motion : the events of the motion.
    divergence_s : s, where that of a finer model diverges from it, near which a disturbed one is likely to, too.
    disturbed_events : events of the motion with the stiffness changed by a share of itself, up to a time.

    Returns
    -------
    DivergenceTimes
    """
    end, small = divergence_s, math.inf
    while small == math.inf and end < motion.end:
        end = min(motion.end, LONGER * end)
        small = divergence(motion.until(end), disturbed_events(SMALL, end))
    if small == math.inf:
        return DivergenceTimes()
    end = min(motion.end, LONGER * small)
    return DivergenceTimes(small, divergence(motion.until(end), disturbed_events(ROUND_OFF, end)))


@dataclass(frozen=True)
class Convergence:
    """Relative errors of the values of a result, from a finer model."""

    errors: Errors = field(default_factory=dict)
    unconverged: tuple[str, ...] = ()  # ``entry.place`` of those with more than `ALLOWED_ERROR`
    modes: int = 0  # of the finer model; 0 where the first leaves out nothing
    first_modes: int = 0  # of the first, where it is compared
    diverged_s: float = math.inf  # time at which the contact sequences of a run diverge
    after_divergence: tuple[str, ...] = ()  # ``entry.place`` of those that depend on the motion after that
    sensitivity: DivergenceTimes = field(default_factory=DivergenceTimes)
    processor_time_s: float = 0.0
    reason: str = ""  # why there is no comparison
    lines: Floats | None = None  # of each line of all spectra, where there are spectra
    compared_s: float = math.inf  # length of the first part that is compared, where a motion is not kept as a whole

    def summary(self) -> dict[str, Any]:
        """Entries of the summary."""
        times = {
            "contact_divergence_s": self.diverged_s, "disturbance_divergence_s": self.sensitivity.small_change_s,
            "round_off_divergence_s": self.sensitivity.round_off_s,
        }  # fmt: skip
        model: dict[str, Any] = {
            "modes": self.modes, "first_modes": self.first_modes,
            **{name: time if math.isfinite(time) else None for name, time in times.items()},
            "finer_model_processor_time_s": self.processor_time_s, "reason": self.reason,
        }  # fmt: skip
        if math.isfinite(self.compared_s):
            model["compared_s"] = self.compared_s
        marks = {"doubtful": list(self.unconverged), "after_divergence": list(self.after_divergence)}
        return {"convergence": self.errors, **marks, "convergence_model": model}


def keeps_all(modes: Dataset, kept_modes: int | None = None) -> bool:
    """Whether a model keeps all modes of a structure without meshes.

    Parameters
    ----------
    modes : of the model, or of one of the same structure that keeps so many.
    kept_modes : number of modes that it keeps.
    """
    return bool((kept_modes or modes["kept_modes"].item()) >= _coordinates(modes))


def finer_case(scenario: Scenario, modes: Dataset) -> Scenario:
    """The finer model of a case: three times as many modes, or all of a structure that has few, and finer meshes.

    Parameters
    ----------
    scenario, modes : of the first model.
    """
    every = _coordinates(modes)
    more = every if every <= FEW_MODES else min(math.ceil(MORE_MODES * modes["kept_modes"].item()), every)
    finer = scenario.refine(int(more))
    return with_finer_tables(finer) if scenario.has_force_tables else finer


def _coordinates(modes: Dataset) -> float:
    """How many coordinates a structure has; infinite where a mesh can have more."""
    return float(modes["coordinates"].item()) if "coordinates" in modes else math.inf


def with_convergence(result: _Result, convergence: Convergence, values: Values | None = None) -> _Result:
    """Add the errors of its values to a result: to its summary, its outcome and the verdicts on limits.

    Parameters
    ----------
    result : with its margins, without any error of the values.
    convergence : the errors of its values.
    values : that limits are compared with, where they were compared with a finer model's.

    Returns
    -------
    Result
        With the verdict on each limit, to which the error of its value counts.
    """
    summary = result.summary | convergence.summary()
    if "margins" in summary:
        summary["margins"] = _margins_with_errors(summary, values or {}, convergence.errors)
    result = replace(result, summary={e.name: summary[e.name] for e in result.SUMMARY if e.name in summary})
    outcome, doubts = result.outcome, [_divergence_outcome(result, convergence)] if convergence.after_divergence else []
    if first := [key for key in convergence.unconverged if is_main_value(result.scenario, result["modes"], key)]:
        doubts = [unconverged_outcome(result, first, *doubts)]
    if not doubts or not outcome.usable:
        return result.with_outcome(outcome.copy_with(*doubts))
    # earlier problems come last
    return result.with_outcome(doubts[0].copy_with(outcome) if outcome.message else doubts[0])


def _margins_with_errors(summary: Mapping[str, Any], values: Values, errors: Errors) -> dict[str, dict[str, Any]]:
    """The margins of a summary with the ranges that follow from the errors; see `with_convergence`."""
    margins = {name: item | _range(name, item, (summary, values), errors) for name, item in summary["margins"].items()}
    if summary.get("without_limit"):
        margins = {name: _without_modal_limit(name, item, summary) for name, item in margins.items()}
    return margins


def _range(
    limit: str, item: Mapping[str, Any], of_result: tuple[Mapping[str, Any], Values], errors: Errors
) -> dict[str, float]:
    """Range of the value of a limit: value less and plus its error, the largest of all places.

    Parameters
    ----------
    limit : its name.
    item : of the margins; values above its own are not compared with it (unstable motions).
    of_result : the summary, in which curves have their own values by name, and the values by entry and place.
    errors : by entry and place; a place that the finer model does not have makes the range unknown.
    """
    (summary, values), (value, of) = of_result, parse_limit(limit)
    if "statistic" in item:  # of the largest value of a test: it has the error of that of the motion
        of_place = dict(places(errors.get(value.entry, {})))
        error_of = of_place.get("" if value.single else of or item["at"], math.nan if of_place else 0.0)
        return {"lowest": item["lowest"] * (1.0 - error_of), "highest": item["highest"] * (1.0 + error_of)}
    by_name = summary.get(value.entry) if of else None
    curves = [name for name, each in (by_name or {}).items() if isinstance(each, Mapping)]
    limited_places = {of, *(f"{curve} {of}" for curve in curves)}
    error = dict(places(errors.get(value.entry, {})))
    highest = item["value"] * (1.0 + SMALLEST_SCALE)
    known = dict(numbers_by_place(errors))  # root mean squares are values of the spectra, or of the statistics
    of_run = f"random.{item['at']} {value.quantity} rms", f"{value.reported}.{item['at']}"
    pairs = [
        (number * value.scale, error.get(place, math.nan if errors else 0.0))
        for place, number in places(values.get(value.entry, {}))
        if value.entry in errors and number * value.scale <= highest and (not of or place in limited_places)
    ] or [(item["value"], next((known[name] for name in of_run if name in known), 0.0))]
    size, error_of = np.transpose(pairs)
    return {"lowest": float(np.max(size * (1.0 - error_of))), "highest": float(np.max(size * (1.0 + error_of)))}


def _without_modal_limit(limit: str, item: dict[str, Any], summary: Mapping[str, Any]) -> dict[str, Any]:
    """The margin of a limit on values some of which grow with the number of modes and may exceed any limit.

    Parameters
    ----------
    limit, item : as of `_range`.
    summary : of the result.
    """
    keys = [key.partition(".") for key in summary["without_limit"]]
    growing = {place for entry, _, place in keys if limits(limit, entry, place)}
    if not growing:
        return item
    entry = next(entry for entry, _, place in keys if limits(limit, entry, place))
    errors, scale = dict(places(summary["convergence"].get(entry, {}))), parse_limit(limit)[0].scale
    others = [
        scale * number * (1.0 - errors.get(place, 0.0))
        for place, number in places(comparable_values({entry: summary[entry]})[entry])
        if place not in growing and limits(limit, entry, place)
    ]
    unknown = dict.fromkeys((key for key in item if key.startswith("interval_")), math.nan)  # of a random motion
    return item | {"lowest": max(others, default=0.0), "highest": math.inf} | unknown


def unconverged_outcome(result: Result, keys: Collection[str], *parts: Outcome) -> Outcome:
    """The outcome that lists the values that do not converge, the worst first, with a remedy.

    Parameters
    ----------
    result : that was compared with a finer model.
    keys : ``entry.place`` of the values.
    parts : outcomes that accompany it.
    """
    model = result.summary["convergence_model"]
    sizes = {key: error for key, error in numbers_by_place(result.summary["convergence"]) if key in keys}
    worst = sorted(sizes, key=lambda key: -sizes[key])
    modes = "all" if model["modes"] >= _coordinates(result["modes"]) else f"{MORE_MODES:g} times the"
    finer = f"seen with {modes} modes" + (" and twice the elements of every mesh" if result.scenario.has_mesh else "")
    finer += " and twice the sides of every ring" if result.scenario.rings else ""
    finer += " and twice the segments of every smooth law" if result.scenario.has_smooth_laws else ""
    value_names = tuple(f"{value_in_words(key)} by {100 * sizes[key]:.2g} %" for key in worst)
    remedy = _remedy(result, model["first_modes"], keys)
    kind, code = OutcomeKind.DOUBTFUL, "figures_doubtful"
    sentence = f"values are off by more than {100 * ALLOWED_ERROR:g} % ({finer}): {numbers_text(value_names)}"
    if any(key.partition(".")[0] in MUST_HOLD and error > WORTHLESS for key, error in sizes.items()):
        kind, code = OutcomeKind.UNTRUSTED, "figures_worthless"
        sentence = (
            f"displacements or forces are off by more than {100 * WORTHLESS:g} % ({finer}): {numbers_text(value_names)}"
        )
    return Outcome.of(kind, code, sentence, *parts, remedy=remedy, values=value_names)


def _divergence_outcome(result: Result, convergence: Convergence) -> Outcome:
    """The outcome that lists the values that depend on the motion after its contact sequences diverge."""
    times, time, run = convergence.sensitivity, convergence.diverged_s, not_none(result.scenario.run)
    value_names = tuple(dict.fromkeys(value_in_words(x.partition(".")[0]) for x in convergence.after_divergence))
    if not times.sensitive:
        return Outcome.of(
            OutcomeKind.COMPLETE, "contacts_diverge",
            f"the finer model, also stepped in time, has other contacts from {time:.4g} s on: "
            f"{numbers_text(value_names)} depend on what follows",
            remedy=f"lower run.rtol below {relative_tolerance(run):g}, "
            f"{_finer_model_remedy(result, convergence.first_modes)}, or take means of a longer run",
            time=time, values=value_names,
        )  # fmt: skip
    sentence = (
        f"the motion is so sensitive that from {time:.4g} s on it is one of many possible ones: "
        f"{numbers_text(value_names)} depend on what follows"
    )
    if math.isfinite(times.small_change_s):
        sentence += f"; a relative stiffness change of 1e-9 changes the contacts after {times.small_change_s:.4g} s"
    if math.isfinite(times.round_off_s):
        sentence += f", round-off after {times.round_off_s:.4g} s"
    of = "rms, contact share" + (", run.impacts" if run.impacts is None else "")
    means = f"means of a longer run ({of}), or " if result.scenario.is_lasting else ""  # else nothing is stationary
    return Outcome.of(
        OutcomeKind.COMPLETE, "motion_sensitive", sentence,
        remedy=f"take {means}the spread of peaks over several cases (vary)",
        time=time, values=value_names,
    )  # fmt: skip


def _finer_model_remedy(result: Result, modes: int) -> str:
    """Text: how to get a model finer than one with so many modes."""
    elements = "raise the number of elements" if result.scenario.has_mesh else ""
    sides = "give more sides to the rings" if result.scenario.rings else ""
    segments = "lower the tolerance of the smooth laws" if result.scenario.has_smooth_laws else ""
    if keeps_all(result["modes"]) and (sides or segments):
        return " and ".join(filter(None, (sides, segments)))
    more = result.scenario.more_modes(math.ceil(MORE_MODES * modes))
    return " and ".join(filter(None, (more, elements, sides, segments)))


def _remedy(result: Result, modes: int, unconverged: Collection[str]) -> str:
    """Text: how to make the unconverged values of a model with so many modes converge."""
    places = [key.partition(".")[2] for key in unconverged if key.startswith("peak_acceleration")]
    shares = result.summary.get("contact_share", {})  # by snubber, of a sweep by curve and snubber
    met = {name for of in (shares, *shares.values()) if isinstance(of, dict) for name, share in of.items() if share}
    stops = tuple(name for name in result.scenario.bare_dashpots if name in met or not shares) if places else ()
    unfiltered = result.KIND == "run" and result.scenario.run is not None and result.scenario.run.low_pass is None
    band = ["give the band of the accelerometers (run.low_pass: 2 kHz)"] if unfiltered else []
    contact = (
        [f"give the structure a point mass at {numbers_text(stops)}", "leave out the dashpot there"] if stops else []
    )
    special = [*band, *contact] if places else []
    remedies = [] if special and len(places) == len(unconverged) else [_finer_model_remedy(result, modes)]
    if special:
        remedies.append(f"for the peak acceleration of {numbers_text(tuple(places))} {', or '.join(special)}")
    return "; ".join(remedies)
