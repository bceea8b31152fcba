"""The exact flow under a swept sine: contact states diagonalised as they are visited, and a record of every cycle."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence
from dataclasses import field
from typing import TYPE_CHECKING

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.flow.contact_state import LinearOutput, OutputOf, state_loads
from beamsim.flow.exact import ExactFlow, StartOfMotion
from beamsim.flow.invariant_blocks import Block, SimpleModes
from beamsim.flow.march import Log, Motion, carry
from beamsim.flow.power_balance import power_balance
from beamsim.flow.state_tables import pad
from beamsim.flow.stopping import never
from beamsim.inputs.signal import Signal
from beamsim.inputs.swept import SweepWindows
from beamsim.outcomes import Outcome, OutcomeCode
from beamsim.system.equations import Forcing, PiecewiseLinearSystem
from beamsim.typing import Bools, Complexes, Floats, Ints

if TYPE_CHECKING:
    from beamsim.flow.kernels import Inputs, Tables
    from beamsim.flow.sweep_kernels import Cycles, Forced, OutputTables, PowerBalance, Swept, Windows


WINDOWS_A_CALL = 128  # between two reports of progress, and between which signals are handled


@dataclass
class SweptFlow:
    """A system under channels that are all multiples, or integrals, of one swept sine.

    Parameters
    ----------
    system : the structure.
    load : (L, n) load of a unit of each of the first L channels, N per sqrt(kg).
    channel : (Ch, W, D + 1) coefficients of the channels on the windows: the L loads, then the base displacement
        that contacts on the ground feel (where there is one), then observed signals, which load nothing.
    windows : the windows of the sine.
    base_displacement : whether channel L is the base's displacement.
    """

    system: PiecewiseLinearSystem
    load: Floats
    channel: Complexes
    windows: SweepWindows
    base_displacement: bool = False
    template: ExactFlow = field(init=False)
    bare: ExactFlow = field(init=False)

    def __post_init__(self) -> None:
        L = self.load.shape[0]
        unit = Signal.harmonic(1.0, 1.0)
        base = unit if self.base_displacement else None
        # contacts that do not feel the base's displacement have no channel for it
        felt = self.base_displacement and bool(self.system.contacts.felt.any())
        self._unfelt = self.base_displacement and not felt
        if self._unfelt:
            base = None
        self.swept_by(self.windows, self.channel)
        observers = (unit,) * (self.channel.shape[0] - L - int(felt))
        # one source a channel: outputs are written down with it, for any signal the channels may carry
        self.template = ExactFlow(self.system, Forcing(self.load, (unit,) * L, base), 1.0, observers)
        longest = float(self.windows.length.max())
        self.bare = ExactFlow(self.system, Forcing(np.zeros((0, self.system.size)), ()), longest)
        self._forced: list[_ForcedTables] = []
        self._power: list[tuple[Floats, Floats]] = []

    def swept_by(self, windows: SweepWindows, channel: Complexes) -> None:
        """Go on under other windows and channels, which are given as to the constructor; contact states are kept."""
        L = self.load.shape[0]
        self.windows = windows
        self.channel = np.concatenate([channel[:L], channel[L + 1 :]]) if self._unfelt else channel

    def starting_state(self, state: Floats) -> Ints:
        """Phases of the contacts when the sweep begins."""
        return self.begin(state).phases

    def begin(self, state: Floats) -> StartOfMotion:
        """How the sweep begins; see `ExactFlow.begin`."""
        w = self.windows
        D = self.channel.shape[2] - 1
        sigma = -0.5 * w.length[0]
        turn = np.exp(1j * w.omega[0] * sigma)
        signals = []
        for c in self.channel[:, 0] * turn:
            moved = c.copy()
            for i in range(D):
                for p in range(D - 1, i - 1, -1):
                    moved[p] += sigma * moved[p + 1]
            signals.append(Signal(np.zeros(1), np.array([1j * w.omega[0]]), moved[None, None, :]))
        L = self.load.shape[0]
        base = signals[L] if self.template.base_channel >= 0 else None
        flow = ExactFlow(self.system, Forcing(self.load, tuple(signals[:L]), base), float(w.length[0]))
        return flow.begin(np.asarray(state, dtype=float))

    def state_index(self, phases: Ints) -> int:
        """Number of the contact state, diagonalised when it is first asked for."""
        index = self.bare.state_index(phases)
        self._complete()
        return index

    def follow(self, state: int, guard: int) -> int:
        """The state after the event of a guard."""
        following = self.bare.follow(state, guard)
        self._complete()
        return following

    def touching(self, state: int) -> Bools:
        """(m,) which contacts touch in a state."""
        return self.system.contacts.touching(self.bare.states[state].phases)

    def _complete(self) -> None:
        for s in self.bare.states[len(self._forced) :]:
            load, slope = state_loads(
                self.system, self.template.forcing, self.template.sources, self.template.base_channel, s.phases
            )
            self._forced.append(_forced_tables(s.modes.simple.whole(), s.modes.blocks, load[1:], slope[1:]))
            self._power.append(power_balance(self.template, s.phases))

    def forced(self) -> Forced:
        """Eigenvectors of the states so far, for the kernels."""
        from beamsim.flow.sweep_kernels import Forced

        tables = self._forced
        return Forced(
            np.array([t.eigenvalue.size for t in tables]),
            *(pad([getattr(t, name) for t in tables]) for name in _ForcedTables.__dataclass_fields__),
        )

    def output_tables(self, output_of: OutputOf) -> OutputTables:
        """Rows of the watched functions and of the outputs in every state so far, for the kernels."""
        from beamsim.flow.sweep_kernels import OutputTables

        states = self.bare.states
        contacts = self.system.contacts
        watched = [_parts(self.template.watched(contacts.watched(s.phases), s.phases)) for s in states]
        outputs_of = [output_of(s.phases) for s in states]
        output_parts = [_parts(output) for output in outputs_of]
        bare = [
            LinearOutput(o.row, np.ascontiguousarray(o.direct[:, :1]), np.zeros((o.row.shape[0], 1)))
            for o in outputs_of
        ]
        groups = [_groups(s.exponent) for s in states]
        rows = [pad([part[i] for part in watched]) for i in (0, 1, 2)]
        outputs = [np.array([part[i] for part in output_parts]) for i in (0, 1, 2)]
        return OutputTables(
            watch_row=rows[0],
            watch_channel=rows[1],
            watch_slope=rows[2],
            watch_size=pad([_sizes(w[0], self.system.size) for w in watched]),
            output=pad([s.coefficients(w, self.bare.sources) for s, w in zip(states, bare, strict=True)]),
            output_row=outputs[0],
            output_channel=outputs[1],
            output_slope=outputs[2],
            basis_group=pad([g for g, _ in groups]),
            group_count=np.array([e.size for _, e in groups]),
            group_exponent=pad([e for _, e in groups]),
        )

    def power_balance(self) -> PowerBalance:
        """Gradient of the energy and form of the powers in every state so far, for the kernels."""
        from beamsim.flow.sweep_kernels import PowerBalance

        gradient, form = zip(*self._power, strict=True)
        return PowerBalance(np.array(gradient), np.array(form), self.system.stiffness)

    def kernel_windows(self, orders: Floats) -> Windows:
        """The windows as the kernels take them."""
        from beamsim.flow.sweep_kernels import Windows

        w = self.windows
        return Windows(
            w.start, w.length, w.omega, w.cycle, w.fraction, w.degree,
            np.ascontiguousarray(self.channel), w.deviation, np.asarray(orders, dtype=float),
        )  # fmt: skip


@dataclass
class CycleMarch:
    """The march of a swept flow, with the record of C cycles; see :class:`beamsim.flow.march.Marched`.

    Parameters
    ----------
    output_of : (K) outputs whose envelopes and harmonics are kept, by contact state, written for ``flow.template``.
    order : (R,) tracked harmonics, multiples of the instantaneous frequency.
    count : C.
    """

    flow: SweptFlow
    output_of: OutputOf
    order: Floats
    count: int
    cycles: Cycles = field(init=False)

    def __post_init__(self) -> None:
        self.cycles = self._empty()
        self._renew()

    def _empty(self) -> Cycles:
        from beamsim.flow.sweep_kernels import Cycles

        C, m, R = self.count, self.flow.system.contacts.count, self.order.size
        K = self.output_of(self.flow.bare.states[0].phases).row.shape[0]
        return Cycles(
            np.full((C, K), -np.inf), np.full((C, K), np.inf), np.zeros((C, K)), np.zeros((C, K, R), dtype=complex),
            np.zeros((C, m)), np.zeros((C, m), dtype=np.int64), np.zeros(K), np.zeros(C), np.zeros(C),
        )  # fmt: skip

    def restart(self, count: int) -> None:
        """Begin an empty record of so many cycles under the windows that the flow has now; tables of its states are
        kept."""
        self.count = count
        self.cycles = self._empty()
        if self._states != len(self.flow.bare.states):  # another march of the flow has come to new ones
            self._renew()
            return
        tables, inputs, swept = self.kernel_arguments()
        windows = self.flow.kernel_windows(self.order)
        self._arguments = tables, inputs, swept._replace(windows=windows, cycles=self.cycles)

    def _renew(self) -> None:
        from beamsim.flow.sweep_kernels import Swept

        flow = self.flow
        self._states = len(flow.bare.states)
        swept = Swept(
            flow.forced(), flow.output_tables(self.output_of), flow.kernel_windows(self.order), self.cycles,
            flow.power_balance(),
        )  # fmt: skip
        self._arguments = flow.bare.tables(), flow.bare.inputs(), swept

    def kernel_arguments(self) -> tuple[Tables, Inputs, Swept]:
        """Tables of the contact states so far, their constant source, and the sweep."""
        return self._arguments

    def equal_steps(self) -> None:
        """None: a sweep has windows in place of pieces."""

    def follow(self, state: int, guard: int) -> int:
        """The state after the event of a guard."""
        following = self.flow.follow(state, guard)
        self._renew()
        return following

    def visits(self, states: Ints) -> Ints:
        """The numbers of the states, which are all kept."""
        return states

    def time_of(self, motion: Motion) -> float:
        """Time since the start of the sweep, s."""
        windows = self.flow.windows
        return windows.duration if motion.piece >= windows.count else float(windows.start[motion.piece] + motion.time)

    def harmonic(self, duration: Floats) -> Complexes:
        """(C, K, R) amplitude of cos(order phase) minus i times that of sin, over one cycle of given duration (C,);
        for order 0 the mean over its time."""
        return np.asarray(self.cycles.harmonic / np.where(self.order == 0, duration[:, None, None], np.pi))


@dataclass(frozen=True)
class CycleRecord:
    """Record of C cycles of a sweep; K outputs, R orders, m contacts."""

    flow: SweptFlow
    order: Floats  # (R,)
    high: Floats  # (C, K)
    low: Floats  # (C, K)
    mean_square: Floats  # (C, K), over the cycle's time
    harmonic: Complexes  # (C, K, R) see `CycleMarch.harmonic`
    contact_share: Floats  # (C, m)
    closings: Ints  # (C, m)
    imbalance: Floats  # (C,) J, dissipated energy and change of the stored one, less the work in
    energy: Floats  # (C,) J, largest kinetic and strain energy of the structure
    final_y: Floats
    reached: int  # cycles that were computed
    end: float  # s
    events: int
    segments: int
    evaluations: int
    outcome: Outcome
    processor_time_s: float
    log: Log | None = None  # segments and events, if the time history is requested

    def sample(self, times: Floats, output_of: OutputOf) -> Floats:
        """Outputs (nt, K) at increasing times; only with a log."""
        from beamsim.flow.march_kernels import sample

        if self.log is None:
            raise ValueError("the time history was not kept")
        log, arguments = self.log, CycleMarch(self.flow, output_of, np.zeros(0), 0).kernel_arguments()
        table = arguments[2].outputs.output
        out = np.empty((times.size, table.shape[2]))
        sample(*arguments, table, log.time, log.state, log.piece, log.y, np.ascontiguousarray(times), out)
        return out

    def tracked(self, order: float) -> Complexes:
        """(C, K) complex amplitude of an order: the projection over the fewest whole cycles it repeats in.

        An order p/q repeats after q cycles: row c covers the cycles c - q + 1 to c, the rows before q - 1 are nan.
        """
        from fractions import Fraction

        index = int(np.flatnonzero(np.isclose(self.order, order))[0])
        q = Fraction(float(order)).limit_denominator(64).denominator
        one = self.harmonic[:, :, index]
        if q == 1:
            return one
        total = np.cumsum(np.concatenate([np.zeros((1, one.shape[1])), one]), axis=0)
        out = np.full(one.shape, complex(np.nan, np.nan))
        out[q - 1 :] = (total[q:] - total[:-q]) / q
        return out


def sweep(
    flow: SweptFlow,
    initial_state: Floats,
    output_of: OutputOf,
    *,
    orders: Sequence[float] = (1.0,),
    keep_history: bool = False,
    max_evaluations: int = 2_000_000_000,
    max_events: int = 20_000_000,
    progress: Callable[[float], None] | None = None,
    stop: Callable[[], bool] = never,
) -> CycleRecord:
    """March through the whole sweep.

    Parameters
    ----------
    initial_state : (N,) at t = 0; internal states of the contacts that are left out are zero.
    output_of : outputs whose envelopes and harmonics are kept, by contact state, written for ``flow.template``.
    orders : tracked harmonics, multiples of the instantaneous frequency.
    keep_history : keep the segments, so that the time history can be sampled.
    stop : asked several times a second whether to end the sweep there.
    """
    begin = clock.process_time()
    windows = flow.windows
    y = flow.bare.whole_state(initial_state)
    phases, entered, y = flow.begin(y)
    motion = Motion.beginning(y, flow.state_index(phases))
    march = CycleMarch(flow, output_of, np.asarray(orders, dtype=float), windows.cycles)
    march.cycles.closings[0] += entered & flow.system.contacts.touching(phases)
    carried = carry(
        march, motion, (*range(WINDOWS_A_CALL, windows.count, WINDOWS_A_CALL), windows.count), keep=keep_history,
        max_events=max_events, max_evaluations=max_evaluations,
        progress=None if progress is None else lambda _: progress(motion.piece / windows.count), stop=stop,
    )  # fmt: skip
    cycles, finished = march.cycles, motion.piece >= windows.count
    duration = np.bincount(windows.cycle, weights=windows.length, minlength=windows.cycles).astype(float)
    outcome, reached = carried.outcome, windows.cycles if finished else int(windows.cycle[motion.piece])
    if not np.all(np.isfinite(y)):
        reached = int(np.argmin(np.all(np.isfinite(cycles.square), axis=1)))
        outcome = Outcome.of(OutcomeCode.NOT_FINITE, time=float(windows.start[windows.cycle == reached][0]))
    return CycleRecord(
        flow=flow,
        order=march.order,
        high=cycles.high,
        low=cycles.low,
        mean_square=cycles.square / duration[:, None],
        harmonic=march.harmonic(duration),
        contact_share=cycles.closed_time / duration[:, None],
        closings=cycles.closings,
        imbalance=cycles.imbalance,
        energy=cycles.energy,
        final_y=y,
        reached=reached,
        end=march.time_of(motion),
        events=carried.events + int(entered.sum()),
        segments=carried.segments,
        evaluations=carried.evaluations,
        outcome=outcome,
        processor_time_s=clock.process_time() - begin,
        log=carried.log,
    )


@dataclass(frozen=True)
class _ForcedTables:
    eigenvalue: Complexes  # (E,)
    coupling: Complexes  # (E, E)
    block_start: Ints  # (E,)
    block_end: Ints  # (E,)
    spread: Floats  # (E,)
    right: Complexes  # (E, N)
    gain: Complexes  # (Ch, E)
    gain_slope: Complexes  # (Ch, E)


def _forced_tables(simple: SimpleModes, blocks: list[Block], load: Floats, slope: Floats) -> _ForcedTables:
    """Every eigenvalue, conjugates too, in triangular blocks."""
    from scipy.linalg import schur

    X, Xi, lam = simple
    n = -load.shape[1]
    right, left = [X.T], [Xi]
    value, coupled = list(lam), []
    first, last, spread = list(range(lam.size)), list(range(1, lam.size + 1)), [0.0] * lam.size
    for block in blocks:
        pair = [block]
        if block.weight == 2.0:
            pair.append(block.conjugate())
        for b in pair:
            T, Z = schur(b.matrix.astype(complex), output="complex")
            start, size = len(value), T.shape[0]
            right.append((b.right @ Z).T)
            left.append(Z.conj().T @ b.left)
            coupled.append((start, np.triu(T, 1)))
            value += list(np.diag(T))
            first += [start] * size
            last += [start + size] * size
            spread += [float(b.radius)] * size
    E = len(value)
    coupling = np.zeros((E, E), dtype=complex)
    for start, T in coupled:
        coupling[start : start + T.shape[0], start : start + T.shape[0]] = T
    rows = np.concatenate(left)
    return _ForcedTables(
        eigenvalue=np.array(value, dtype=complex),
        coupling=coupling,
        block_start=np.array(first, dtype=np.int64),
        block_end=np.array(last, dtype=np.int64),
        spread=np.array(spread, dtype=float),
        right=np.ascontiguousarray(np.concatenate(right)),
        gain=np.ascontiguousarray(load.astype(complex) @ rows[:, n:].T),
        gain_slope=np.ascontiguousarray(slope.astype(complex) @ rows[:, n:].T),
    )


def _parts(output: LinearOutput) -> tuple[Floats, Floats, Floats]:
    """Rows, factors of the channels, and of their time derivatives."""
    return (
        np.ascontiguousarray(output.row),
        np.ascontiguousarray(output.direct[:, 1:]),
        np.ascontiguousarray(output.direct_slope[:, 1:]),
    )


def _sizes(row: Floats, n: int) -> Floats:
    """(k, 3) lengths of the parts of rows that multiply displacements, velocities and internal states."""
    parts = (row[:, :n], row[:, n : 2 * n], row[:, 2 * n :])
    return np.stack([np.linalg.norm(part, axis=1) for part in parts], axis=1)


def _groups(exponent: Complexes) -> tuple[Ints, Complexes]:
    """Group of every basis function (equal exponents share one), and the groups' exponents."""
    values: dict[complex, int] = {}
    index = [values.setdefault(complex(e), len(values)) for e in exponent]
    return np.array(index, dtype=np.int64), np.array(list(values), dtype=complex)
