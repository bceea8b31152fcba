"""Steady motions under a sine of one frequency, reached after the decay of the transient.

The state is taken once a cycle (a Poincaré section). A motion of period p cycles is steady when the section repeats
after p cycles to a tolerance, with the remaining change estimated from the rate at which the difference shrinks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.flow.contact_state import OutputOf
from beamsim.flow.march import Log, Motion, carry
from beamsim.flow.slide_starts import pressing_where_sliding_begins
from beamsim.flow.stopping import never
from beamsim.flow.swept_sine import CycleMarch, SweptFlow
from beamsim.inputs.swept import SweepWindows
from beamsim.typing import Complexes, Floats, Ints

CYCLES_A_CALL = 16
MOST_EVENTS = 2**62  # in a cycle: what bounds the work are the evaluations
DISTINCT = 100.0  # a longer period counts only where the changes over shorter ones are so many tolerances


class MotionStopped(Exception):
    """A motion was stopped from outside."""


@dataclass
class CycleStepper:
    """Carries a state cycle by cycle through a flow whose windows may change between calls.

    Parameters
    ----------
    flow : its windows are replaced by ``use``; the diagonalised contact states are kept.
    channels_of : the channels' coefficients for given windows.
    stop : asked several times a second whether to end.
    """

    flow: SweptFlow
    channels_of: Callable[[SweepWindows], Complexes]
    most_evaluations: int = 200_000_000
    stop: Callable[[], bool] = never
    events: int = field(init=False, default=0)
    segments: int = field(init=False, default=0)
    evaluations: int = field(init=False, default=0)
    cycles: int = field(init=False, default=0)
    _unmeasured: CycleMarch | None = field(init=False, default=None, repr=False)

    def use(self, windows: SweepWindows) -> None:
        """Change the sine."""
        self.flow.windows = windows
        self.flow.channel = self.channels_of(windows)

    def carry(
        self,
        motion: Motion,
        cycles: int,
        output_of: OutputOf | None = None,
        orders: Floats | None = None,
        *,
        slides: bool = False,
    ) -> tuple[Floats, MeasuredCycles | None]:
        """Carry ``motion`` on, in place, from a phase of 0; returns the state (cycles, 2n) after every cycle.

        ``slides`` asks for the forces that press contacts where sliding begins, with the outputs.

        Raises
        ------
        ArithmeticError
            When the work exceeds ``most_evaluations``.
        MotionStopped
            When ``stop`` says so.
        """
        flow = self.flow
        if output_of is None:
            march = self._without_outputs(cycles)
        else:
            march = CycleMarch(flow, output_of, np.asarray([] if orders is None else orders, dtype=float), cycles)
        states = np.empty((cycles, motion.y.size))
        motion.piece, motion.time = 0, 0.0
        logs: list[Log] = []
        for k in range(cycles):
            carried = carry(
                march, motion, (k + 1,), keep=slides, max_events=MOST_EVENTS,
                max_evaluations=self.most_evaluations - self.evaluations, stop=self.stop,
            )  # fmt: skip
            self.events, self.segments = self.events + carried.events, self.segments + carried.segments
            self.evaluations += carried.evaluations
            if carried.outcome.interrupted:
                raise MotionStopped
            if not carried.outcome.complete:
                raise ArithmeticError(f"{self.evaluations} evaluations of the contact gaps were not enough")
            states[k] = motion.y
            if carried.log is not None:
                logs.append(carried.log)
        self.cycles += cycles
        if output_of is None:
            return states, None
        period, record = flow.windows.length[0], march.cycles
        harmonic = march.harmonic(np.full(cycles, period))
        return states, MeasuredCycles(
            record.high, record.low, record.square / period, harmonic, record.closed_time / period, record.closings,
            record.imbalance, record.energy,
            pressing_where_sliding_begins(flow, Log.join(logs))[:cycles] if logs else None,
        )  # fmt: skip

    def _without_outputs(self, cycles: int) -> CycleMarch:
        """A march whose tables are made once: some motions are carried on by thousands of single cycles."""
        if self._unmeasured is None:
            self._unmeasured = CycleMarch(self.flow, lambda _: self.flow.template.empty_output(0), np.zeros(0), cycles)
        else:
            self._unmeasured.restart(cycles)
        return self._unmeasured


@dataclass(frozen=True)
class MeasuredCycles:
    """Envelopes, mean squares and harmonics of whole cycles; K outputs."""

    high: Floats  # (cycles, K)
    low: Floats  # (cycles, K)
    mean_square: Floats  # (cycles, K)
    harmonic: Complexes  # (cycles, K, R)
    contact_share: Floats  # (cycles, m)
    closings: Ints  # (cycles, m)
    imbalance: Floats  # (cycles,) J, see `beamsim.flow.swept_sine.CycleRecord`
    energy: Floats  # (cycles,) J
    pressing: Floats | None = None  # (cycles, 2, p) see `beamsim.flow.slide_starts`, where asked for


@dataclass(frozen=True)
class Settled:
    """Whether and how the motion became periodic."""

    period: int  # cycles; 0 where the motion did not become periodic
    cycles: int
    change: float  # of the section over one period (over one cycle where there is none), over its size
    section: Floats  # (cycles kept, 2n) states at the ends of the last cycles


def velocity_weights(flow: SweptFlow, omega: float) -> Floats:
    """(N,) factors that make a state's entries comparable: displacements in units of velocity, internal states left
    out."""
    n, r = flow.system.size, flow.system.contacts.internal_states
    return np.concatenate([np.full(n, omega), np.ones(n), np.zeros(r)])


def settle(
    stepper: CycleStepper, motion: Motion, *, tolerance: float, longest_period: int, most_cycles: int
) -> Settled:
    """Carry a motion on until it repeats after 1 ... ``longest_period`` cycles, to ``tolerance`` of its size."""
    omega = float(stepper.flow.windows.omega[0])
    weight = velocity_weights(stepper.flow, omega)
    section = [motion.y * weight]
    done, change = 0, np.inf
    while done < most_cycles:
        chunk = min(CYCLES_A_CALL, most_cycles - done, stepper.flow.windows.count)
        states, _ = stepper.carry(motion, chunk)
        section.extend(states * weight)
        done += chunk
        size = float(np.max(np.abs(section[-2 * longest_period :])))
        if size == 0.0:
            return Settled(1, done, 0.0, _unweighted(section[-longest_period:], weight))
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
            if shorter <= DISTINCT * tolerance * size:
                break  # a shorter period is about to be reached
            shorter = min(shorter, now)
            if now <= 1e-12 * size or now * max(1.0, ratio / (1 - ratio)) <= tolerance * size:
                return Settled(p, done, now / size, _unweighted(section[-max(p, 1) :], weight))
    return Settled(0, done, change, _unweighted(section[-min(len(section), 256) :], weight))


def _unweighted(section: list[Floats], weight: Floats) -> Floats:
    """(cycles, 2n) states from their weighted entries."""
    weighted = weight > 0
    return np.array(section)[:, weighted] / weight[weighted]


def measure(
    stepper: CycleStepper,
    motion: Motion,
    cycles: int,
    output_of: OutputOf,
    orders: Floats,
    *,
    slides: bool = False,
) -> tuple[Floats, MeasuredCycles]:
    """Carry a motion on for some cycles, keeping envelopes and harmonics; returns the section too."""
    states, measured = stepper.carry(motion, cycles, output_of, orders, slides=slides)
    assert measured is not None
    return states, measured
