r"""Snubber stiffness from natural frequencies with permanent contact.

One mode: the secular equation solved for k gives it in closed form (`beamsim.structures.secular`). Several modes: the
k that minimises :math:`\sum_j ((f_j(k) - m_j) / \sigma_j)^2`, bracketed by the stiffnesses of the single modes
because every f_j increases with k. Algorithm 1 of the thesis (Hazim 2010) is kept for comparison.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from beamsim.errors import Problem, ScenarioError
from beamsim.outcomes import COMPLETE, Outcome, OutcomeKind
from beamsim.structures.modes import closed_frequencies
from beamsim.structures.secular import SpringPoint
from beamsim.typing import Floats

_PATH = "identify_stiffness.measured_with"
_WIDEST = 1e9  # search range: this factor on either side of one over the compliance of the structure


@dataclass(frozen=True)
class MeasuredModes:
    """Frequencies of chosen modes with their standard deviations."""

    mode: tuple[int, ...]  # numbers from 1, including rigid-body modes
    omega: Floats  # (m,) rad/s
    sigma: Floats  # (m,) relative standard deviations; all zero when unknown
    unconstrained: int = 0  # rigid-body modes with the snubber closed, below the first measured frequency

    @property
    def weight(self) -> Floats:
        """(m,) one over the absolute standard deviation, s/rad (equal relative weights when unknown)."""
        sigma = self.sigma if self.sigma.all() else np.ones(self.omega.size)
        return np.asarray(1.0 / (sigma * self.omega))


def fit_stiffness(point: SpringPoint, measured: MeasuredModes) -> float:
    """Stiffness, N/m, that fits the measured frequencies best; 0 or infinity if no stiffness reaches them."""
    single = individual_stiffness(point, measured)
    low, high = float(single.min()), float(single.max())
    if low == high:
        return low
    # a mode out of reach gives no bound: search as far as the compliance of the structure makes a difference
    unit = 1.0 / float(np.sum(point.shape**2 / np.maximum(point.omega, measured.omega[0]) ** 2))
    # The margin keeps a minimum at a bound inside the bracket: there the other modes have a node at the spring.
    low, high = max(low * (1 - 1e-6), unit / _WIDEST), min(high * (1 + 1e-6), unit * _WIDEST)
    if low >= high:
        return low
    from scipy.optimize import least_squares

    x = np.linspace(np.log(low), np.log(high), 241)
    start = x[1:-1][np.argmin(misfit(point, measured, np.exp(x[1:-1])))]
    number = np.array(measured.mode) - 1

    def residuals(y: Floats) -> Floats:
        predicted = point.frequencies(float(np.exp(y[0])), max(measured.mode))[number]
        return np.asarray((predicted - measured.omega) * measured.weight)

    def slopes(y: Floats) -> Floats:
        k = float(np.exp(y[0]))
        return (point.slope(point.frequencies(k, max(measured.mode))[number]) * k * measured.weight)[:, None]

    found = least_squares(residuals, [start], jac=slopes, bounds=(x[0], x[-1]), xtol=1e-15, ftol=None, gtol=None)
    return float(np.exp(found.x[0]))


def misfit(point: SpringPoint, measured: MeasuredModes, stiffness: Floats) -> Floats:
    """(s,) chi^2 at stiffnesses (s,)."""
    predicted = point.frequencies(stiffness, max(measured.mode))[:, np.array(measured.mode) - 1]
    return np.asarray(np.sum(((predicted - measured.omega) * measured.weight) ** 2, axis=1))


def reached_stiffness(point: SpringPoint, mode: int, omega: Floats) -> Floats:
    """Stiffnesses that give a mode each of the frequencies (any shape): 0 below its range, infinity above."""
    low, high = point.reach(mode)
    inside = (omega > low) & (omega < high)
    k = point.stiffness(np.where(inside, omega, 0.5 * (low + min(high, 2 * low + 1.0))))
    return np.asarray(np.where(inside, k, np.where(omega <= low, 0.0, np.inf)))


def individual_stiffness(point: SpringPoint, measured: MeasuredModes) -> Floats:
    """(m,) stiffness from each mode alone, N/m; see `reached_stiffness`."""
    return np.array(
        [float(reached_stiffness(point, *pair)) for pair in zip(measured.mode, measured.omega, strict=True)]
    )


def check_reach(point: SpringPoint, measured: MeasuredModes, without_hz: tuple[float, ...] = ()) -> tuple[str, ...]:
    """Refuse frequencies that no stiffness reaches; with several modes, only warn if one is within reach.

    Raises
    ------
    ScenarioError
        With the reachable range, the likely mistake, and a remedy.
    """
    problems: list[Problem] = []
    for i, mode in enumerate(measured.mode):
        if mode > point.omega.size:
            problems.append(
                Problem(
                    f"{_PATH}[{mode - 1 - measured.unconstrained}]",
                    f"is mode {mode}, but the model has only {point.omega.size} modes",
                    "leave it out of fit_to",
                )
            )
            continue
        problem = _out_of_reach(point, mode, float(measured.omega[i]), without_hz, measured.unconstrained)
        if problem is not None:
            problems.append(problem)
    if problems and (len(problems) == len(measured.mode) or any("node" in p.message for p in problems)):
        raise ScenarioError(problems)
    return tuple(f"{problem}" for problem in problems)


def _out_of_reach(
    point: SpringPoint, mode: int, omega: float, without_hz: tuple[float, ...], unconstrained: int
) -> Problem | None:
    low, high = point.reach(mode)
    hz = 2 * np.pi
    at = f"{_PATH}[{mode - 1 - unconstrained}]"
    if point.on_node(mode) or (np.isfinite(high) and high - low <= 1e-9 * high):
        return Problem(
            at,
            f"= {omega / hz:.6g} Hz does not depend on the snubber: it is at a node of mode {mode}, where the "
            f"structure does not move, so that the frequency is {low / hz:.6g} Hz for every stiffness",
            f"leave mode {mode} out of fit_to and use one with motion at the snubber",
        )
    if low < omega < high:
        return None
    limit = (
        f"the frequency without the snubber, {low / hz:.6g} Hz"
        if omega <= low
        else f"the frequency with the point pinned, {high / hz:.6g} Hz"
    )
    side = "not above" if omega <= low else "not below"
    reach = "upwards without bound" if np.isinf(high) else f"to {high / hz:.6g} Hz"
    return Problem(
        at,
        f"= {omega / hz:.6g} Hz is {side} {limit}: a spring there can shift mode {mode} from {low / hz:.6g} Hz {reach}",
        _remedy(point, mode, omega, without_hz),
    )


def _remedy(point: SpringPoint, mode: int, omega: float, without_hz: tuple[float, ...]) -> str:
    """The most likely mistake behind a frequency out of reach."""
    low, high = point.reach(mode)
    hz = 2 * np.pi
    if mode <= len(without_hz) and omega <= low < hz * without_hz[mode - 1] < high:
        return "were measured_with and measured_without swapped?"
    hints = []
    if (number := _fits(point, mode, omega)) is not None:
        hints.append(f"it fits mode {number}: list the frequencies starting with the first mode")
    for factor, unit in ((1 / hz, "rad/s"), (1000.0, "kHz"), (1 / 60, "1/min")):
        if low < omega * factor < high:
            hints.append(f"was the unit forgotten? write {omega / hz:g} {unit} if that was meant")
            break
    if hints:
        return "; or ".join(hints)
    return (
        "check the measurement, the parameters of the structure (measured_without compares them, update: fits them) "
        "and the units of its dimensions"
    )


def _fits(point: SpringPoint, mode: int, omega: float) -> int | None:
    """Another mode that could have this frequency."""
    number = point.mode_number(omega)
    if number in (0, mode) or number > point.omega.size:
        return None
    low, high = point.reach(number)
    return number if low < omega < high else None


@dataclass(frozen=True)
class LoopResult:
    """Result of the loop of the thesis."""

    stiffness: float  # N/m, of the last step
    solutions: int  # eigenvalue solutions
    outcome: Outcome


def thesis_loop(
    point: SpringPoint, mode: int, omega: float, *, tolerance: float, most_solutions: int, rigid: int = 0
) -> LoopResult:
    """Algorithm 1 of the thesis: k grows by 1 % from 0.01 N/m until the frequency agrees within a tolerance.

    Every step solves the whole eigenvalue problem. A step can jump over a narrow tolerance. The frequency
    never decreases with k, so the loop then stops with that outcome instead of running forever.

    Parameters
    ----------
    point : modes at the snubber.
    mode, omega : number and measured angular frequency.
    tolerance : relative difference in frequency at which the loop ends.
    most_solutions : largest number of eigenvalue solutions.
    rigid : number of rigid-body modes.
    """
    # 0.01: N/m; thesis, algorithm 1
    k, previous = 0.01, np.nan
    for count in range(1, most_solutions + 1):
        predicted = float(closed_frequencies(point.omega, point.shape[None, :], np.array([k]), rigid)[mode - 1])
        if abs(predicted - omega) <= tolerance * omega:
            return LoopResult(k, count, COMPLETE)
        if predicted > omega:
            outcome = Outcome.of(
                OutcomeKind.STOPPED, "stepped_over",
                f"a 1 % step from {previous:.6g} to {k:.6g} N/m stepped over the frequency tolerance of "
                f"{100 * tolerance:g} %",
                remedy="widen identify_stiffness.tolerance, or use method: secular",
            )  # fmt: skip
            return LoopResult(k, count, outcome)
        previous = k
        # 1.01: thesis, algorithm 1
        k *= 1.01
    outcome = Outcome.of(
        OutcomeKind.STOPPED, "solution_limit", f"not converged after {most_solutions} eigenvalue solutions",
        remedy="raise identify_stiffness.most_solutions, or use method: secular",
    )  # fmt: skip
    return LoopResult(previous, most_solutions, outcome)
