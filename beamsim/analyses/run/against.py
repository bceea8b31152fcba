"""A run compared with a time stepper: the same equations by Newmark's method, HHT or DOP853, and what differs.

The stepper (`beamsim.flow.time_stepping`) shares neither sources, start nor event search with the exact flow.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.analyses.limits import STANDARD_GRAVITY
from beamsim.analyses.run.result import Against, AgainstFigure, RunResult
from beamsim.dataclass import dataclass
from beamsim.errors import Problem, ScenarioError
from beamsim.flow.stopping import Stopped, heeding, never
from beamsim.flow.time_stepping import HHT_ALPHA, MOST_STEPS, RTOL, SteppedMotion, dop853, newmark
from beamsim.system.build import build_system
from beamsim.typing import Bools, Floats

if TYPE_CHECKING:
    from beamsim.system.structural import StructuralSystem

METHODS = ("newmark", "hht", "dop853")
STEPS_A_PERIOD = 40  # of the fastest mode, contacts closed, where no step is given
PARTED = 0.1  # of the mean time between the events of a contact: two events further apart are not the same


@dataclass(frozen=True)
class Stepper:
    """A method and its step, s (`dop853`: its relative tolerance); None for the default."""

    method: str
    number: float | None = None

    @classmethod
    def parse(cls, text: str) -> Stepper:
        """From ``newmark:5e-5``, ``hht``, ``dop853:1e-8``.

        Raises
        ------
        ScenarioError
            If the method is unknown or the number is not one.
        """
        method, _, number = text.strip().lower().partition(":")
        remedy = "write newmark:5e-5 or hht:5e-5 (the step in s), or dop853:1e-10 (its relative tolerance)"
        if method not in METHODS:
            raise ScenarioError(Problem("--against", f"= {text} is not a time stepper", remedy))
        if not number:
            return cls(method)
        try:
            value = float(number.removesuffix("s").strip() if method != "dop853" else number)
        except ValueError:
            value = np.nan
        if not (np.isfinite(value) and value > 0):
            raise ScenarioError(Problem("--against", f"= {text}: {number!r} is not a positive number", remedy))
        return cls(method, value)


def against(result: RunResult, stepper: Stepper, stop: Callable[[], bool] = never) -> RunResult:
    """The result with a comparison with a time stepper, in `RunResult.against` and in its summary.

    Parameters
    ----------
    stop : asked several times a second whether to leave the comparison out; the result is then marked as interrupted.

    Raises
    ------
    ScenarioError
        If the step is so small that the motion takes too many steps.
    """
    try:
        with heeding(stop):
            return _with_comparison(result, stepper)
    except Stopped:
        return result.interrupted("the comparison with a time stepper")


def _with_comparison(result: RunResult, stepper: Stepper) -> RunResult:
    system = build_system(result.scenario, assessed=False)
    end = float(result.time[-1])
    step = _step(stepper, system)
    if step is not None and end / step > MOST_STEPS:
        remedy = f"use a step of at least {end / MOST_STEPS:.1g} s, or a shorter run"
        raise ScenarioError(
            Problem("--against", f"takes {end / step:.3g} steps of {step:g} s (at most {MOST_STEPS:.3g})", remedy)
        )
    rows = np.array([probe.shape for probe in system.probes]).reshape(-1, system.dynamics.size)
    arguments = (system.dynamics, system.forcing, system.cubic, system.base_displacement, system.initial_state)
    if step is None:
        rtol = stepper.number or RTOL
        motion = dop853(*arguments, result.time, rows, rtol, max_step=_period(system) / 4)
        name = f"dop853, rtol {rtol:g}"
    else:
        alpha = HHT_ALPHA if stepper.method == "hht" else 0.0
        motion = newmark(*arguments, end, step, rows, alpha)
        name = f"{stepper.method}, step {step:g} s" + (f", alpha {alpha:g}" if alpha else "")
    compared = _compared(result, system, motion, name, step)
    return replace(result, against=compared, summary={**result.summary, "against": _summary(compared)})


def _period(system: StructuralSystem) -> float:
    """Shortest period with all contacts closed, s."""
    contacts = system.dynamics.contacts
    slopes = np.abs(contacts.arrays.force[:, :, 0]).max(axis=1, initial=0.0)
    closed = np.diag(system.dynamics.stiffness) + (contacts.shape.T * slopes) @ contacts.shape
    fastest = float(np.linalg.eigvalsh(closed)[-1])
    return float(2 * np.pi / np.sqrt(fastest)) if fastest > 0 else np.inf


def _step(stepper: Stepper, system: StructuralSystem) -> float | None:
    """Step of the method, s; None where it chooses its own."""
    if stepper.method == "dop853":
        return None
    if stepper.number is not None:
        return stepper.number
    return min(_period(system) / STEPS_A_PERIOD, 1e-2)


def _compared(
    result: RunResult, system: StructuralSystem, motion: SteppedMotion, name: str, step: float | None
) -> Against:
    every = _events(result, motion)
    least = 1e-6 * float(result.time[-1]) if step is None else 2 * step
    events = [(_lasting(*exact, least), _lasting(*stepped, least)) for exact, stepped in every]
    differences, parted = _event_times(events, float(result.time[-1]))
    difference = 0.0
    figures = []
    for i, probe in enumerate(result.probes.values()):
        peak = float(np.abs(motion.displacement[:, i]).max())
        exact = result.summary["peak_displacement_m"][probe.name]
        figures.append(AgainstFigure("peak displacement", probe.name, "m", exact, peak))
        base = 0.0 if system.base_acceleration is None else system.carried[i] * system.base_acceleration(motion.time)
        peak = float(np.abs(motion.acceleration[:, i] + base).max()) / STANDARD_GRAVITY
        figures.append(
            AgainstFigure("peak acceleration", probe.name, "g", result.summary["peak_acceleration_g"][probe.name], peak)
        )
        before = result.time < parted
        other = _between(motion, i, result.time[before])
        size = max(float(np.abs(probe.displacement).max()), 1e-300)
        apart = np.abs(other - probe.displacement[before]).max(initial=0.0)
        difference = max(difference, float(apart) / size)
    share = _shares(motion)
    for j, snubber in enumerate(result.snubbers.values()):
        names = {"peak contact force": ("N", result.summary["peak_force_n"][snubber.name], motion.force[:, j].max())}
        begins = motion.touching[0, j] and np.any((result.events.snubber == j) & (result.events.time == 0))
        closings = int(every[j][1][1].sum()) + int(begins)
        names["contacts"] = ("1", result.summary["contacts"][snubber.name], closings)
        names["time in contact"] = ("1", result.summary["contact_share"][snubber.name], share[j])
        figures += [
            AgainstFigure(figure, snubber.name, unit, float(exact), float(stepped))
            for figure, (unit, exact, stepped) in names.items()
        ]
    return Against(
        method=name,
        step_s=np.nan if step is None else step,
        steps=motion.steps,
        unsettled_steps=motion.unsettled,
        agrees_until_s=parted,
        largest_state_difference=difference,
        largest_time_difference_s=differences,
        processor_time_s=motion.processor_time_s,
        exact_processor_time_s=result.work.processor_time_s,
        figures=tuple(figures),
    )


def _between(motion: SteppedMotion, probe: int, times: Floats) -> Floats:
    """Displacement of a probe at given times, by the cubic through the steps' values and velocities."""
    from scipy.interpolate import CubicHermiteSpline

    inside = np.append(np.diff(motion.time) > 0, True)  # events of the adaptive stepper are there twice
    spline = CubicHermiteSpline(motion.time[inside], motion.displacement[inside, probe], motion.velocity[inside, probe])
    return np.asarray(spline(times))


def _shares(motion: SteppedMotion) -> Floats:
    """(m,) share of the time in contact."""
    length = np.diff(motion.time)
    return np.asarray(length @ motion.touching[1:] / length.sum())


def _events(result: RunResult, motion: SteppedMotion) -> list[tuple[tuple[Floats, Bools], tuple[Floats, Bools]]]:
    """Times after t = 0 and kinds of the events of each snubber: of the run, then of the stepper."""
    events = []
    for j in range(len(result.snubbers)):
        exact = (result.events.snubber == j) & (result.events.time > 0)
        change = np.flatnonzero(np.diff(motion.touching[:, j].astype(int)) != 0)
        middle = 0.5 * (motion.time[change] + motion.time[change + 1])
        stepped = (middle, motion.touching[change + 1, j])
        events.append(((result.events.time[exact], result.events.closing[exact]), stepped))
    return events


def _lasting(times: Floats, closing: Bools, least: float) -> tuple[Floats, Bools]:
    """Events without the contacts, and the gaps between contacts, that are shorter than the stepper can resolve."""
    keep = times >= least
    brief = np.flatnonzero(np.diff(times) < least)
    while brief.size:
        keep[brief[0] : brief[0] + 2] = False
        brief = brief[brief > brief[0] + 1]
    return times[keep], closing[keep]


def _event_times(events: list[tuple[tuple[Floats, Bools], tuple[Floats, Bools]]], end: float) -> tuple[float, float]:
    """Largest difference of the times of common events, s, and the time at which the sequences of events part, s."""
    parted = end
    pairs = []
    for (a, closes), (b, closes_too) in events:
        count = min(a.size, b.size)
        near = np.abs(a[:count] - b[:count]) <= PARTED * end / max(a.size, 1)
        same = near & (closes[:count] == closes_too[:count])
        first = int(np.argmin(same)) if not same.all() else count
        pairs.append((a[:first], b[:first]))
        for times in (a, b):
            if first < times.size:
                parted = min(parted, float(times[first]))
    late = [np.abs(a - b)[np.maximum(a, b) < parted].max(initial=0.0) for a, b in pairs]
    return float(max(late, default=0.0)), parted


def _summary(compared: Against) -> dict[str, Any]:
    """The comparison as plain values: by figure and place the exact and the stepped value."""
    figures: dict[str, dict[str, Any]] = {}
    for figure in compared.figures:
        values = {"exact": figure.exact, "stepped": figure.stepped, "unit": figure.unit}
        figures.setdefault(figure.figure.replace(" ", "_"), {})[figure.place] = values
    names = (
        "method", "step_s", "steps", "unsettled_steps", "agrees_until_s", "largest_state_difference",
        "largest_time_difference_s", "processor_time_s", "exact_processor_time_s",
    )  # fmt: skip
    return {**{name: getattr(compared, name) for name in names}, "figures": figures}
