"""Evenly sampled signals of any length: their pieces are made block by block, where they are asked for.

Pieces of a cubic spline through the samples of a block differ from those of the spline through all samples by what the
ends of the block add, which falls by 2 - sqrt(3) with each sample; `MARGIN` samples on either side leave round-off.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import ArrayLike

from beamsim.inputs.signal import Signal
from beamsim.typing import Complexes, Floats, Ints

MARGIN = 32  # samples before and after a block
PIECES_OF_A_BLOCK = 2**16
_BLOCKS_AT_HAND = 2


class CubicRecord:
    """An evenly sampled record as a cubic spline, with its first two integrals.

    Parameters
    ----------
    samples_at : values at sample numbers (n,), from ``-MARGIN`` to ``MARGIN`` behind the last piece.
    step : s, between two samples.
    pieces : number of pieces from t = 0 on; the last never ends.
    integrals_at_0 : values of the first and of the second integral at t = 0.
    """

    def __init__(
        self, samples_at: Callable[[Ints], Floats], step: float, pieces: int, integrals_at_0: tuple[float, float]
    ) -> None:
        self.samples_at, self.step, self.pieces = samples_at, step, pieces
        self._at_start = [integrals_at_0]  # of each block that was reached
        self._at_hand: dict[int, tuple[Signal, Signal, Signal]] = {}
        self._few: tuple[Floats, Floats] | None = None  # times in many blocks, and the values there

    def start(self, first: int, last: int) -> Floats:
        """(last - first,) s, where pieces begin."""
        return np.asarray(np.arange(first, last) * self.step, dtype=float)

    def _spline(self, first: int, last: int) -> Signal:
        from scipy.interpolate import CubicSpline

        index = np.arange(first - MARGIN, last + MARGIN + 1)
        coefficient = CubicSpline(index * self.step, self.samples_at(index)).c[::-1].T
        return Signal.polynomial_pieces(self.start(first, last), coefficient[MARGIN : MARGIN + last - first])

    def block(self, number: int) -> tuple[Signal, Signal, Signal]:
        """The record on the pieces of a block, and its integrals; the blocks before are made where they were not."""
        for before in range(len(self._at_start) - 1, number):
            self._make(before)
        if number not in self._at_hand:
            while len(self._at_hand) >= _BLOCKS_AT_HAND:
                del self._at_hand[next(iter(self._at_hand))]
            self._at_hand[number] = self._make(number)
        return self._at_hand[number]

    def at(self, t: Floats, integral: int) -> Floats:
        """The record, or one of its integrals, at times t (any shape).

        At a few times in many blocks all of them are computed, and kept until other times are asked for, so that the
        blocks are made once.
        """
        if self._few is not None and np.array_equal(self._few[0], t):
            return np.asarray(self._few[1][integral])
        block = np.clip(np.floor(t / self.step + 1e-6), 0, self.pieces - 1).astype(np.int64) // PIECES_OF_A_BLOCK
        numbers = np.unique(block)
        together = numbers.size > _BLOCKS_AT_HAND and t.size <= PIECES_OF_A_BLOCK
        wanted = (0, 1, 2) if together else (integral,)
        out = np.empty((3, *t.shape))
        for number in numbers:
            here, parts = block == number, self.block(int(number))
            for k in wanted:
                out[k, here] = parts[k](t[here])
        if together:
            self._few = t.copy(), out
        return np.asarray(out[integral])

    def _make(self, number: int) -> tuple[Signal, Signal, Signal]:
        first = number * PIECES_OF_A_BLOCK
        last = min(first + PIECES_OF_A_BLOCK, self.pieces)
        record = self._spline(first, last)
        velocity = record.antiderivative(self._at_start[number][0])
        displacement = velocity.antiderivative(self._at_start[number][1])
        if number == len(self._at_start) - 1:
            end = last * self.step
            self._at_start.append((float(velocity(end)), float(displacement(end))))
        return record, velocity, displacement


class StreamedSignal(Signal):
    """A record (``integral`` 0), or its first or second integral, times a factor.

    ``start`` and ``coefficient`` are those of all pieces, made when they are read.
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

    def between(self, first: int, last: int) -> Signal:
        """The pieces with numbers ``first`` to ``last``, the last left out."""
        coefficient = [part.coefficient for part in self._parts(first, last)]
        return Signal(self.record.start(first, last), self.exponent, np.concatenate(coefficient))

    def _parts(self, first: int, last: int) -> Iterator[Signal]:
        for number in range(first // PIECES_OF_A_BLOCK, -(-last // PIECES_OF_A_BLOCK)):
            begin = number * PIECES_OF_A_BLOCK
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
    """The record of which all signals are made; None where they are not, or there is none."""
    records = {id(s.record): s.record for s in signals if isinstance(s, StreamedSignal)}
    streamed = len(records) == 1 and all(isinstance(s, StreamedSignal) for s in signals)
    return next(iter(records.values())) if streamed else None
