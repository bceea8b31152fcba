"""Steady motions under a sine of one frequency, reached after the decay of the transient, and those that never are.

The state is taken once a cycle (a Poincaré section). A motion of period p cycles is steady when the section repeats
after p cycles to a tolerance, with the remaining change estimated from the rate at which the difference shrinks.

A motion that does not repeat has the largest Lyapunov exponent of two neighbours in the exact flow. After every cycle
the neighbour is pulled back to its first distance; the mean logarithm of its growth, over the period, is the exponent
(G. Benettin et al., Meccanica 15, 1980). As both motions are exact, their distance may be small against everything but
round-off.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from beamsim.flow.exact import ExactFlow
from beamsim.flow.periodic_flow import PeriodicFlow
from beamsim.flow.trajectory import Trajectory
from beamsim.flow.transient import Log, March, Motion, motion_of, start
from beamsim.flow.variational import VariationalFlow
from beamsim.typing import TINY, Floats


@dataclass
class CycleStepper(March):
    """Carries a state cycle by cycle through a flow whose loads may change between calls.

    Parameters
    ----------
    flow : under loads of one frequency.
    period : of the loads, s.
    """

    flow: ExactFlow
    period: float
    max_events: int = field(default=2**62, kw_only=True)  # what bounds the work are the evaluations
    max_evaluations: int = field(default=200_000_000, kw_only=True)
    cycles: int = field(init=False, default=0)

    @property
    def omega(self) -> float:
        """Angular frequency of the loads, rad/s."""
        return 2 * np.pi / self.period

    def use(self, flow: ExactFlow, period: float, motion: Motion) -> None:
        """Let a motion go on under loads of another frequency.

        Parameters
        ----------
        flow : under the loads of that frequency.
        period : s, of these.
        motion : that goes on; entered into the flow.
        """
        motion.enter(flow, self.flow)
        self.flow, self.period = flow, period

    def march_cycles(self, motion: Motion, cycles: int) -> Floats:
        """March ``motion`` on, in place, from a phase of 0; returns the state (cycles, N) after every cycle.

        Raises
        ------
        ArithmeticError : when the work exceeds ``max_evaluations``.
        """
        return np.array([motion.y.copy() for _ in self._logs(motion, cycles)])

    def trajectory(self, motion: Motion, cycles: int) -> Trajectory:
        """The same; returns the motion over these cycles, from t = 0 on."""
        return motion_of(self.flow, motion, Log.join(list(self._logs(motion, cycles))), self)

    def _logs(self, motion: Motion, cycles: int) -> Iterator[Log]:
        """Of one cycle after the other."""
        motion.time, motion.piece = 0.0, 0
        for k in range(cycles):
            log = self.on(self.flow, motion, (k + 1) * self.period)
            if not self.outcome.complete:
                raise ArithmeticError(f"{self.evaluations} evaluations of the contact gaps were not enough")
            self.cycles += 1
            yield log


@dataclass
class SeriesStepper:
    """The same where cubic springs leave no closed form: by power series."""

    flow: PeriodicFlow
    omega: float  # rad/s

    def march_cycles(self, motion: Motion, cycles: int) -> Floats:
        """March ``motion`` on, in place, from a phase of 0; returns the state (cycles, N) after every cycle."""
        states = []
        for _ in range(cycles):
            motion.y = self.flow.end(motion.y, 2 * np.pi / self.omega)
            states.append(motion.y)
        return np.array(states)


def stepper_on(flow: PeriodicFlow, y: Floats) -> tuple[CycleStepper | SeriesStepper, Motion]:
    """What carries motions of a flow from cycle to cycle, and the motion from a state (N,) at phase 0."""
    if isinstance(flow, VariationalFlow):
        return CycleStepper(flow.exact, 2 * np.pi / flow.omega), start(flow.exact, y)[0]
    return SeriesStepper(flow, flow.omega), Motion(y, 0)


KEPT_CYCLES = 256  # of a motion that does not repeat, for its Poincaré section


@dataclass(frozen=True)
class Periodicity:
    """Whether and how the motion became periodic."""

    period: int  # cycles; 0 where the motion did not become periodic
    cycles: int
    change: float  # of the section over one period (over one cycle where there is none), over its size
    section: Floats  # (cycles kept, 2n) states at the ends of the last cycles


def velocity_weights(flow: ExactFlow | PeriodicFlow, omega: float) -> Floats:
    """(N,) factors that make a state's entries comparable: displacements in units of velocity, internal states left
    out."""
    n, r = flow.system.size, flow.system.contacts.internal_states
    return np.concatenate([np.full(n, omega), np.ones(n), np.zeros(r)])


def settle(
    stepper: CycleStepper | SeriesStepper, motion: Motion, *, tolerance: float, longest_period: int, most_cycles: int
) -> Periodicity:
    """Carry a motion on until it repeats after 1 ... ``longest_period`` cycles, to ``tolerance`` of its size.

    Parameters
    ----------
    stepper : carries the motion from cycle to cycle.
    motion : changed in place.
    tolerance : remaining change over a period, against the section's size.
    longest_period : cycles.
    most_cycles : after which the motion counts as one that does not repeat.

    Returns
    -------
    Period, cycles, and the section of the last ones.
    """
    weight = velocity_weights(stepper.flow, stepper.omega)
    section = [motion.y * weight]
    done, change, kept = 0, np.inf, max(3 * longest_period + 1, KEPT_CYCLES)
    while done < most_cycles:
        chunk = min(16, most_cycles - done)
        states = stepper.march_cycles(motion, chunk)
        section.extend(states * weight)
        del section[:-kept]
        done += chunk
        size = float(np.max(np.abs(section[-2 * longest_period :])))
        if size == 0.0:
            return Periodicity(1, done, 0.0, _unweighted(section[-longest_period:], weight))
        shorter = np.inf  # smallest change over fewer cycles
        for p in range(1, longest_period + 1):
            if len(section) < 3 * p + 1:
                break
            last = np.array(section[-3 * p - 1 :])
            now = float(np.abs(last[-p:] - last[-2 * p : -p]).max())
            before = float(np.abs(last[-2 * p : -p] - last[-3 * p : -2 * p]).max())
            if p == 1:
                change = now / size
            # a difference that shrinks by a factor r a period adds up to r / (1 - r) of itself
            ratio = min(now / before, 0.999) if before > 0 else 0.0
            # 100.0: a longer period counts only where the changes over shorter ones are so many tolerances
            if shorter <= 100.0 * tolerance * size:
                break  # a shorter period is about to be reached
            shorter = min(shorter, now)
            if now <= 1e-12 * size or now * max(1.0, ratio / (1 - ratio)) <= tolerance * size:
                return Periodicity(p, done, now / size, _unweighted(section[-max(p, 1) :], weight))
    return Periodicity(0, done, change, _unweighted(section[-KEPT_CYCLES:], weight))


def _unweighted(section: list[Floats], weight: Floats) -> Floats:
    """(cycles, 2n) states from their weighted entries."""
    weighted = weight > 0
    return np.array(section)[:, weighted] / weight[weighted]


DISTANCE = 1e-7  # of the motion's size
LEAST_GROWTH_RATE = 1e-3  # of a rate of growth or decay, a cycle
BLOCKS = 8


@dataclass(frozen=True)
class Exponent:
    """The largest exponent, with the scatter of its mean over blocks of cycles."""

    value: float  # 1/s
    uncertainty: float  # 1/s, standard error of the mean
    kind: str  # "chaotic", "quasi-periodic" or "not settled"


def largest_exponent(stepper: CycleStepper | SeriesStepper, motion: Motion, cycles: int) -> Exponent:
    """Exponent over ``cycles`` cycles after as many as a quarter of them; ``motion`` is followed to there.

    A motion whose exponent is clearly positive is chaotic; one whose exponent is clearly negative, or that comes closer
    to a motion of some period, is not settled yet (its transient still decays, or its period is longer than those
    looked for); any other is quasi-periodic.

    Parameters
    ----------
    stepper : carries motions from cycle to cycle.
    motion : where it begins; followed to the end.
    cycles : whose growth is averaged.

    Returns
    -------
    The exponent with its uncertainty, 1/s.
    """
    n = stepper.flow.system.size
    omega = stepper.omega
    weight = velocity_weights(stepper.flow, omega)[: 2 * n]
    size = float(np.max(np.abs(motion.y[: 2 * n] * weight)))
    size = size if size > 0 else 1.0
    offset = np.random.default_rng(0).normal(size=2 * n)
    offset *= DISTANCE * size / np.linalg.norm(offset)
    growth, section = [], []
    for _ in range(cycles + cycles // 4):
        neighbour = motion.copy()
        neighbour.guard = -1
        neighbour.y[: 2 * n] += offset / weight
        stepper.march_cycles(neighbour, 1)
        stepper.march_cycles(motion, 1)
        section.append(motion.y[: 2 * n] * weight)
        difference = (neighbour.y - motion.y)[: 2 * n] * weight
        distance = float(np.linalg.norm(difference))
        growth.append(np.log(max(distance, TINY) / (DISTANCE * size)))
        offset = difference * (DISTANCE * size / max(distance, TINY))
    rate = np.array(growth[cycles // 4 :]) * omega / (2 * np.pi)
    mean = float(rate.mean())
    blocks = np.array([block.mean() for block in np.array_split(rate, BLOCKS)])
    error = float(blocks.std(ddof=1) / np.sqrt(BLOCKS))
    noticeable = LEAST_GROWTH_RATE * omega / (2 * np.pi)
    if mean > max(3 * error, noticeable):
        kind = "chaotic"
    elif mean < -max(3 * error, noticeable) or is_nearly_periodic(np.array(section)):
        kind = "not settled"
    else:
        kind = "quasi-periodic"
    return Exponent(mean, error, kind)


def is_nearly_periodic(section: Floats) -> bool:
    """Whether a motion comes closer to one that repeats after some number of cycles, or repeats.

    The exponent of a lightly damped motion with impacts is lost in what its neighbour's distance swings by in a period;
    the change of the motion over the period falls all the same.

    Parameters
    ----------
    section : (cycles, 2n) weighted states after each cycle; periods of up to a quarter of them are found.
    """
    size, longest = float(np.abs(section).max()), len(section) // 4
    changes = [np.linalg.norm(section[p:] - section[:-p], axis=1) for p in range(1, longest + 1)]
    least = min(changes, key=lambda change: float(change[-longest:].max()))
    if least[-longest:].max() <= DISTANCE * size:
        return True
    falls = np.diff([0.5 * np.log(np.mean(part**2)) for part in np.array_split(least, 4)])
    return bool(np.all(falls < 0.0) and falls.sum() < -LEAST_GROWTH_RATE * 0.75 * least.size)
