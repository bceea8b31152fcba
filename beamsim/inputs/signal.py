r"""Signals with pieces that are polynomials times exponentials, as the closed-form flow requires.

Between two breakpoints a signal is

.. math:: s(t) = \mathrm{Re} \sum_i e^{\nu_i \sigma} \sum_p c_{i,p}\, \sigma^p, \qquad \sigma = t - t_k,

which covers harmonics (:math:`\nu = i\omega`), sums of sines, steps, half-sine pulses, and samples interpolated by
polynomials (:math:`\nu = 0`). Derivatives and integrals of such signals have the same form, so the base displacement
follows exactly from the base acceleration.

A cubic spline through the samples of a block differs from that through all samples by an end effect, which decays by a
factor of 2 - sqrt(3) per sample; after `MARGIN` samples it is below round-off.

The kernels use all signals of a motion on common breakpoints (`Sources`). A *source* is a basis function
:math:`\tau^p e^{\nu\tau}` of one channel (the signal of a load, or a displacement of the base), with a complex
amplitude that depends on the start of the segment. Source 0 is constant; it represents dead loads and gaps.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from beamsim.errors import ScenarioError
from beamsim.typing import Complexes, Floats, Ints

MOST_PIECES = 4_000_000  # pieces of a signal that is stored completely
ORDERS = 8  # derivatives of an input: enough to determine how a motion starts, and its slope
RESONANCE = 0.02  # abs(nu - lambda) times a piece, below which the response to an exponential is a power series
TIMES_PER_BLOCK = 2**17  # times per block of values, to limit memory


@dataclass(frozen=True)
class Signal:
    """A signal of polynomials times exponentials, piece by piece, on [start[0], infinity).

    Parameters
    start : (P,) start times of the pieces, s, increasing; the last piece never ends.
    start : (P,) increasing times at which a piece begins, s; the last piece never ends.
    coefficient : (P, E, D) complex coefficients of the powers of time since the start of the piece.
    coefficient : (P, E, D) complex coefficients, in powers of the time since the start of the piece.
    """

    start: Floats
    exponent: Complexes
    coefficient: Complexes

    @classmethod
    def harmonic(cls, amplitude: ArrayLike, omega: ArrayLike, phase: ArrayLike = 0.0) -> Signal:
        """``sum_k amplitude_k * sin(omega_k t + phase_k)``.

        Parameters
        ----------
        amplitude, omega, phase : (k,) or single numbers; rad/s and rad.

        Returns
        -------
        Signal
            With one piece and k exponents.
        """
        amplitude, omega, phase = np.broadcast_arrays(
            *(np.atleast_1d(np.asarray(x, dtype=float)) for x in (amplitude, omega, phase))
        )
        coefficient = -1j * amplitude * np.exp(1j * phase)
        return cls(np.zeros(1), 1j * omega, coefficient[None, :, None])

    @classmethod
    def polynomial_pieces(cls, start: ArrayLike, coefficient: ArrayLike) -> Signal:
        """Real polynomials: ``coefficient[k, p]`` multiplies ``(t - start[k])**p``."""
        c = np.asarray(coefficient, dtype=complex)
        return cls(np.asarray(start, dtype=float), np.zeros(1, dtype=complex), c[:, None, :])

    def __call__(self, t: ArrayLike) -> Floats:
        """Values at times t (any shape); the first piece is extended to earlier times."""
        t = np.asarray(t, dtype=float)
        times, values = t.ravel(), np.empty(t.size)
        for first in range(0, t.size, TIMES_PER_BLOCK):
            part = times[first : first + TIMES_PER_BLOCK]
            k = np.clip(np.searchsorted(self.start, part, side="right") - 1, 0, None)
            values[first : first + TIMES_PER_BLOCK] = self.piece_values(k, part - self.start[k])
        return values.reshape(t.shape)

    def __mul__(self, factor: float) -> Signal:
        return Signal(self.start, self.exponent, self.coefficient * factor)

    __rmul__ = __mul__

    def derivative(self) -> Signal:
        """The exact time derivative within each piece (without jumps between pieces)."""
        c = self.coefficient
        d = c * self.exponent[None, :, None]
        d[:, :, :-1] += c[:, :, 1:] * np.arange(1, c.shape[2])
        return Signal(self.start, self.exponent, d)

    def antiderivative(self, initial: float = 0.0) -> Signal:
        """The exact integral from ``start[0]``, continuous across pieces, plus ``initial``."""
        exponent = self.exponent
        zero = np.flatnonzero(exponent == 0)
        c = self.coefficient
        if zero.size == 0:
            exponent = np.append(exponent, 0.0)
            c = np.concatenate([c, np.zeros((c.shape[0], 1, c.shape[2]))], axis=1)
        constant = int(zero[0]) if zero.size else exponent.size - 1
        c = np.concatenate([c, np.zeros((*c.shape[:2], 1))], axis=2)
        degree = c.shape[2] - 1
        out = np.zeros_like(c)
        for i, nu in enumerate(exponent):
            if nu == 0:
                out[:, i, 1:] = c[:, i, :-1] / np.arange(1, degree + 1)
            else:
                for p in range(degree, -1, -1):
                    above = out[:, i, p + 1] * (p + 1) if p < degree else 0.0
                    out[:, i, p] = (c[:, i, p] - above) / nu
        length = np.diff(self.start)
        grown = Signal(self.start, exponent, out).piece_values(np.arange(length.size), length)  # without the constants
        first = out[:, :, 0].sum(axis=1).real
        # each piece starts at the final value of the one before
        out[:, constant, 0] += initial + np.concatenate([[0.0], np.cumsum(grown - first[:-1])]) - first
        return Signal(self.start, exponent, out)

    def piece_values(self, piece: Ints, sigma: Floats) -> Floats:
        """Value of each piece at time ``sigma`` since its start (arrays of the same shape)."""
        value = np.zeros(sigma.shape)
        for i, nu in enumerate(self.exponent):
            polynomial = np.zeros(sigma.shape, dtype=complex)
            for p in range(self.coefficient.shape[2] - 1, -1, -1):
                polynomial = polynomial * sigma + self.coefficient[piece, i, p]
            value = value + (polynomial * np.exp(nu * sigma)).real
        return value


MARGIN = 32  # samples before and after a block
PIECES_PER_BLOCK = 2**16
_CACHED_BLOCKS = 2


class CubicRecord:
    """A uniformly sampled record as a cubic spline, with its first two integrals.

    Parameters
    ----------
    samples_at : function of sample numbers (n,), from ``-MARGIN`` to ``MARGIN`` after the last piece.
    step : sample interval, s.
    pieces : number of pieces from t = 0 on; the last never ends.
    integrals_at_0 : values of the first and second integral at t = 0.
    limit : magnitude that the record must not exceed between samples if no sample exceeds it; slopes near it are
        reduced.
    """

    def __init__(
        self,
        samples_at: Callable[[Ints], Floats],
        step: float,
        pieces: int,
        integrals_at_0: tuple[float, float],
        limit: float = np.inf,
    ) -> None:
        self.samples_at, self.step, self.pieces, self.limit = samples_at, step, pieces, limit
        self._at_start = [integrals_at_0]  # integrals at the start of each computed block
        self._at_hand: dict[int, tuple[Signal, Signal, Signal]] = {}
        self._few: tuple[Floats, Floats] | None = None  # times in many blocks, and their values

    def start(self, first: int, last: int) -> Floats:
        """(last - first,) start times of pieces, s."""
        return np.asarray(np.arange(first, last) * self.step, dtype=float)

    def _spline(self, first: int, last: int) -> Signal:
        """The record over the sample number.

        Piece starts in seconds are rounded, and integrals between them would drift with the square of time.
        """
        from scipy.interpolate import CubicHermiteSpline, CubicSpline, PPoly

        index = np.arange(first - MARGIN, last + MARGIN + 1)
        samples = self.samples_at(index)
        spline: PPoly = CubicSpline(index, samples)
        if np.isfinite(self.limit):
            # a cubic stays within its Bezier points, which lie at a third of a step along the end slopes
            steepest = 3.0 * np.maximum(self.limit - np.abs(samples), 0.0)
            spline = CubicHermiteSpline(index, samples, np.clip(spline(index, 1), -steepest, steepest))
        coefficient = spline.c[::-1].T
        return Signal.polynomial_pieces(np.arange(first, last), coefficient[MARGIN : MARGIN + last - first])

    def block(self, number: int) -> tuple[Signal, Signal, Signal]:
        """The record on the pieces of a block, and its integrals; earlier blocks are computed first if necessary."""
        for before in range(len(self._at_start) - 1, number):
            self._make(before)
        if number not in self._at_hand:
            while len(self._at_hand) >= _CACHED_BLOCKS:
                del self._at_hand[next(iter(self._at_hand))]
            self._at_hand[number] = self._make(number)
        return self._at_hand[number]

    def at(self, t: Floats, integral: int) -> Floats:
        """The record, or one of its integrals, at times t (any shape).

        A few times in many blocks are evaluated for record and integrals together, and stored until other times are
        requested, so that each block is computed once.
        """
        if self._few is not None and np.array_equal(self._few[0], t):
            return np.asarray(self._few[1][integral])
        block = np.clip(np.floor(t / self.step + 1e-6), 0, self.pieces - 1).astype(np.int64) // PIECES_PER_BLOCK
        numbers = np.unique(block)
        together = numbers.size > _CACHED_BLOCKS and t.size <= PIECES_PER_BLOCK
        wanted = (0, 1, 2) if together else (integral,)
        out = np.empty((3, *t.shape))
        for number in numbers:
            here, parts = block == number, self.block(int(number))
            for k in wanted:
                out[k, here] = parts[k](t[here])
        if together:
            self._few = t.copy(), out
        return np.asarray(out[integral])

    def mean_slope(self, first: int) -> float:
        """Mean slope of the second integral from the start of a piece to the end of the last one, per s."""
        begin, end = self.at(np.array([first, self.pieces]) * self.step, 2)
        return float(end - begin) / ((self.pieces - first) * self.step)

    def _make(self, number: int) -> tuple[Signal, Signal, Signal]:
        first = number * PIECES_PER_BLOCK
        last = min(first + PIECES_PER_BLOCK, self.pieces)
        record, (velocity_0, displacement_0), step = self._spline(first, last), self._at_start[number], self.step
        velocity = record.antiderivative(velocity_0 / step)
        displacement = velocity.antiderivative(displacement_0 / step**2)
        if number == len(self._at_start) - 1:
            self._at_start.append((float(velocity(last)) * step, float(displacement(last)) * step**2))

        def in_seconds(signal: Signal, integrals: int) -> Signal:
            scale = step ** (integrals - np.arange(float(signal.coefficient.shape[2])))
            return Signal(self.start(first, last), signal.exponent, signal.coefficient * scale)

        return in_seconds(record, 0), in_seconds(velocity, 1), in_seconds(displacement, 2)


class StreamedSignal(Signal):
    """A record (``integral`` 0) or its first or second integral, times a factor; pieces are computed when needed.

    ``start`` and ``coefficient`` contain all pieces and are computed when they are read.
    """

    def __init__(self, record: CubicRecord, integral: int, factor: float = 1.0) -> None:
        self.__dict__.update(record=record, integral=integral, factor=factor)

    record: CubicRecord
    integral: int
    factor: float

    @property
    def exponent(self) -> Complexes:
        """(1,) 1/s."""
        return np.zeros(1, dtype=complex)

    @property
    def start(self) -> Floats:
        """(P,) s."""
        return self.record.start(0, self.record.pieces)

    @property
    def coefficient(self) -> Complexes:
        """(P, 1, D)."""
        return np.concatenate([part.coefficient for part in self._parts(0, self.record.pieces)])

    def signal_of_pieces(self, first: int, last: int) -> Signal:
        """The pieces ``first`` to ``last`` - 1."""
        coefficient = [part.coefficient for part in self._parts(first, last)]
        return Signal(self.record.start(first, last), self.exponent, np.concatenate(coefficient))

    def _parts(self, first: int, last: int) -> Iterator[Signal]:
        for number in range(first // PIECES_PER_BLOCK, -(-last // PIECES_PER_BLOCK)):
            begin = number * PIECES_PER_BLOCK
            inside = slice(max(first - begin, 0), last - begin)
            whole = self.record.block(number)[self.integral]
            yield Signal(whole.start[inside], whole.exponent, self.factor * whole.coefficient[inside])

    def __call__(self, t: ArrayLike) -> Floats:
        """Values at times t (any shape)."""
        return self.factor * self.record.at(np.asarray(t, dtype=float), self.integral)

    def __mul__(self, factor: float) -> Signal:
        return StreamedSignal(self.record, self.integral, self.factor * factor)

    __rmul__ = __mul__

    def derivative(self) -> Signal:
        """The exact time derivative within each piece."""
        if self.integral:
            return StreamedSignal(self.record, self.integral - 1, self.factor)
        return super().derivative()

    def antiderivative(self, initial: float = 0.0) -> Signal:
        """The exact integral from t = 0 on, of all pieces."""
        return Signal(self.start, self.exponent, self.coefficient).antiderivative(initial)


def common_record(signals: tuple[Signal, ...]) -> CubicRecord | None:
    """The record from which all signals are derived; None if there is none, or they differ."""
    records = {id(s.record): s.record for s in signals if isinstance(s, StreamedSignal)}
    streamed = len(records) == 1 and all(isinstance(s, StreamedSignal) for s in signals)
    return next(iter(records.values())) if streamed else None


def refuse_many_pieces(signals: Iterable[Signal]) -> None:
    """Refuse a record that must be stored completely and has too many pieces.

    Raises
    ------
    ScenarioError
    """
    for record in (s.record for s in signals if isinstance(s, StreamedSignal)):
        if record.pieces > MOST_PIECES:
            raise _many_pieces(record.pieces)


def _many_pieces(pieces: int) -> ScenarioError:
    """The error of a record with too many pieces."""
    return ScenarioError.at(
        "excitation",
        f"has {pieces:.3g} pieces, too many for this command or method (at most {MOST_PIECES:.0e})",
        "shorten run.duration, or give a lower excitation.sample_rate; beamsim run with one random excitation "
        "and method: exact accepts any number",
    )


@dataclass(frozen=True)
class Sources:
    """F sources on P pieces; amplitudes refer to the start of each piece."""

    start: Floats  # (P,) s
    amplitude: Complexes  # (P, F)
    exponent: Complexes  # (F,) 1/s
    power: Ints  # (F,)
    channel: Ints  # (F,) -1 for the constant source
    longest_piece: Floats  # (F,) s, longest piece of each source; the last one ends with the motion
    limit: Floats  # (F,) limit of abs(nu - lambda) times that piece for a power series, see `_lower_limits`
    group_last: Ints  # (F,) index of the last source with the same channel and exponent

    def _of_higher_powers(self, amplitude: Complexes, time_shift: Floats) -> Complexes:
        """(n, F) contributions of higher powers of time to lower ones after a time shift (n, 1)."""
        added, last = np.zeros_like(amplitude), self.group_last
        for f in np.flatnonzero(last > np.arange(last.size)):
            factor = np.ones(time_shift.size)
            for q in range(f + 1, last[f] + 1):
                factor = factor * time_shift[:, 0] * ((self.power[f] + q - f) / (q - f))
                added[:, f] += factor * amplitude[:, q]
        return added

    def amplitudes_at(self, time: Floats, piece: Ints) -> Complexes:
        """(n, F) amplitudes in pieces (n,), relative to times (n,)."""
        amplitude, shift = self.amplitude[piece], (time - self.start[piece])[:, None]
        if not np.any(shift):
            return amplitude
        out = amplitude + self._of_higher_powers(amplitude, shift) if self.power.any() else amplitude.copy()
        if np.any(self.exponent):
            out *= np.exp(self.exponent * shift)
        return out

    @cached_property
    def derivatives_at_start(self) -> Complexes:
        """(`ORDERS`, F) derivatives of each source with unit amplitude at the start of its piece, from order 0 on."""
        factorial = np.cumprod(np.maximum(np.arange(ORDERS), 1.0))
        rest = np.arange(ORDERS)[:, None] - self.power  # what is left is the power that became a constant
        scale = factorial[:, None] / factorial[np.maximum(rest, 0)]
        return np.asarray(np.where(rest >= 0, scale * self.exponent ** np.maximum(rest, 0), 0.0))

    def has_responses_of(self, others: Sources) -> bool:
        """Whether responses to these sources equal those to others, up to amplitudes and starts."""
        names = ("exponent", "power", "channel", "longest_piece", "limit")
        return all(np.array_equal(getattr(self, name), getattr(others, name)) for name in names)


def compile_sources(channels: tuple[Signal, ...], duration: float = np.inf) -> Sources:
    """Merge the breakpoints of channels and list their basis functions, for a motion of a duration, s."""
    start = np.unique(np.concatenate([np.zeros(1)] + [c.start for c in channels]))
    start = start[start >= 0.0]
    exponent, power, channel, last = [0j], [0], [-1], [0]
    columns = [np.ones((start.size, 1), dtype=complex)]
    for index, signal in enumerate(channels):
        c = signal.coefficient if np.array_equal(signal.start, start) else _coefficients_at_starts(signal, start)
        for i, nu in enumerate(signal.exponent):
            used = np.flatnonzero(np.any(c[:, i, :] != 0, axis=0))
            if used.size == 0 and nu == 0:
                continue
            degree = int(used.max(initial=0))  # a harmonic of amplitude zero stays: derivatives by it are needed
            exponent += [complex(nu)] * (degree + 1)
            power += list(range(degree + 1))
            channel += [index] * (degree + 1)
            last += [len(power) - 1] * (degree + 1)
            columns.append(c[:, i, : degree + 1])
    amplitude = np.ascontiguousarray(np.concatenate(columns, axis=1))
    length = np.minimum(np.append(start[1:], np.inf), duration) - start
    acts, powers = amplitude != 0, np.array(power, dtype=np.int64)
    for f in range(powers.size - 2, -1, -1):  # within a piece, a power contributes to the lower ones of its polynomial
        if last[f] > f:
            acts[:, f] |= acts[:, f + 1]
    sources = Sources(
        start, amplitude, np.array(exponent), powers, np.array(channel, dtype=np.int64),
        longest_piece=np.max(np.where(acts, length[:, None], 0.0), axis=0),
        limit=np.where(powers == 0, RESONANCE, powers + 1.0),
        group_last=np.array(last, dtype=np.int64),
    )  # fmt: skip
    if powers.any():
        _lower_limits(sources)
    return sources


def _lower_limits(sources: Sources) -> None:
    """Lower the limits for powers of time that hardly contribute to a channel.

    The terms of a polynomial response cancel by ``p! / (|nu - lambda| tau)^p`` of the share of the power p in its
    channel. A power series that starts from zero does not, up to a distance of ``p + 1``. Powers with a small share may
    use polynomials at smaller distances, by the root of their share.
    """
    limit = sources.limit
    for first in np.flatnonzero((sources.power == 0) & (sources.group_last > np.arange(limit.size))):
        group = np.arange(first, sources.group_last[first] + 1)
        scale = sources.longest_piece[first] ** sources.power[group]
        if not np.all(np.isfinite(scale)):
            continue
        largest = np.zeros(sources.start.size)
        for f, unit in zip(group, scale, strict=True):
            np.maximum(largest, unit * np.abs(sources.amplitude[:, f]), out=largest)
        largest[largest == 0.0] = 1.0
        for f, unit in zip(group[1:], scale[1:], strict=True):
            share = float((unit * np.abs(sources.amplitude[:, f]) / largest).max())
            # 0.5: in any case a power series for an exponential times a power of time
            limit[f] = max(limit[f] * share ** (1.0 / sources.power[f]), 0.5)


def sources_of_pieces(channels: tuple[Signal, ...], first: int, last: int, duration: float) -> Sources:
    """The sources on some pieces of a record that all channels share, see `common_record`.

    Only piece starts and amplitudes differ from those of the whole motion.

    Parameters
    ----------
    channels : signals derived from the record.
    first, last : index of the first piece, and of the one after the last.
    duration : duration of the whole motion, s.

    Returns
    -------
    Sources
        A constant source first, then those of each channel.
    """
    record = common_record(channels)
    assert record is not None
    parts = [signal.signal_of_pieces(first, last) for signal in channels if isinstance(signal, StreamedSignal)]
    degrees = [part.coefficient.shape[2] for part in parts]
    columns = [np.ones((last - first, 1), dtype=complex), *(part.coefficient[:, 0] for part in parts)]
    power = np.concatenate([np.zeros(1, dtype=np.int64), *(np.arange(degree) for degree in degrees)])
    endless = duration - (record.pieces - 1) * record.step  # s, length of the last piece, which ends with the motion
    longest = min(max(record.step, endless) + 4.0 * np.finfo(float).eps * duration, duration)  # round-off of the starts
    return Sources(
        record.start(first, last), np.ascontiguousarray(np.concatenate(columns, axis=1)), np.zeros(power.size, complex),
        power, np.repeat(np.arange(-1, len(parts)), [1, *degrees]), np.full(power.size, longest),
        np.where(power == 0, RESONANCE, power + 1.0), np.repeat(np.cumsum([1, *degrees]) - 1, [1, *degrees]),
    )  # fmt: skip


def _coefficients_at_starts(signal: Signal, start: Floats) -> Complexes:
    """Coefficients (P, E, D) of the signal at new piece starts, which include its own."""
    k = np.clip(np.searchsorted(signal.start, start, side="right") - 1, 0, None)
    shift = start - signal.start[k]
    c = signal.coefficient[k].copy()
    if np.any(shift != 0.0):
        for p in range(c.shape[2]):
            total = c[:, :, p].copy()
            factor = np.ones_like(shift)
            for q in range(p + 1, c.shape[2]):
                factor = factor * shift * q / (q - p)
                total += c[:, :, q] * factor[:, None]
            c[:, :, p] = total
        c *= np.exp(signal.exponent[None, :] * shift[:, None])[:, :, None]
    return c
