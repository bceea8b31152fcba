"""All time-dependent inputs on one set of breakpoints, in the form the kernels take.

A *source* is one basis function :math:`\\tau^p e^{\\nu\\tau}` of one channel (a load's signal, the base
displacement, an observed signal) with a complex amplitude that depends on where a segment starts.
Source 0 is the constant one, which carries dead loads and gaps.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from beamsim.inputs.signal import Signal, StreamedSignal, common_record
from beamsim.typing import Complexes, Floats, Ints

ORDERS = 8  # derivatives of an input that are known: as many as decide how a motion starts, and of its slope
RESONANCE = 0.02  # |nu - lambda| times a piece, below which the response to an exponential is a power series


@dataclass(frozen=True)
class Sources:
    """F sources on P pieces; the amplitudes are about each piece's own start."""

    start: Floats  # (P,) s
    amplitude: Complexes  # (P, F)
    exponent: Complexes  # (F,) 1/s
    power: Ints  # (F,)
    channel: Ints  # (F,) -1 for the constant source
    longest_piece: Floats  # (F,) s, on which each source acts; the last one ends with the motion
    limit: Floats  # (F,) |nu - lambda| times that piece, below which a response is a power series, see `_lower_limits`
    group_last: Ints  # (F,) number of the last source of the polynomial (same channel and exponent) of each

    def amplitudes_at(self, time: Floats, piece: Ints) -> Complexes:
        """(n, F) amplitudes in pieces (n,) about times (n,)."""
        amplitude, shift = self.amplitude[piece], (time - self.start[piece])[:, None]
        if not np.any(shift):
            return amplitude
        last, out = self.group_last, amplitude.copy()
        for f in np.flatnonzero(last > np.arange(last.size)):
            factor = np.ones(time.size)
            for q in range(f + 1, last[f] + 1):
                factor = factor * shift[:, 0] * ((self.power[f] + q - f) / (q - f))
                out[:, f] += factor * amplitude[:, q]
        if np.any(self.exponent):
            out *= np.exp(self.exponent * shift)
        return out

    @cached_property
    def derivatives_at_start(self) -> Complexes:
        """(`ORDERS`, F) derivatives of each input of unit amplitude where its piece starts, from order 0 on."""
        factorial = np.cumprod(np.maximum(np.arange(ORDERS), 1.0))
        rest = np.arange(ORDERS)[:, None] - self.power  # what is left is the term whose power is differentiated away
        scale = factorial[:, None] / factorial[np.maximum(rest, 0)]
        return np.asarray(np.where(rest >= 0, scale * self.exponent ** np.maximum(rest, 0), 0.0))

    def respond_as(self, others: Sources) -> bool:
        """Whether responses to these are those to others: they differ in amplitudes and starts of pieces at most."""
        names = ("exponent", "power", "channel", "longest_piece", "limit")
        return all(np.array_equal(getattr(self, name), getattr(others, name)) for name in names)


def compile_sources(channels: tuple[Signal, ...], duration: float = np.inf) -> Sources:
    """Merge the channels' breakpoints and list their basis functions, for a motion of a duration, s."""
    start = np.unique(np.concatenate([np.zeros(1)] + [c.start for c in channels]))
    start = start[start >= 0.0]
    exponent, power, channel, last = [0j], [0], [-1], [0]
    columns = [np.ones((start.size, 1), dtype=complex)]
    for index, signal in enumerate(channels):
        c = signal.coefficient if np.array_equal(signal.start, start) else _about(signal, start)
        for i, nu in enumerate(signal.exponent):
            used = np.flatnonzero(np.any(c[:, i, :] != 0, axis=0))
            if used.size == 0 and nu == 0:
                continue
            degree = int(used.max(initial=0))  # a harmonic of amplitude zero stays: there are derivatives by it
            exponent += [complex(nu)] * (degree + 1)
            power += list(range(degree + 1))
            channel += [index] * (degree + 1)
            last += [len(power) - 1] * (degree + 1)
            columns.append(c[:, i, : degree + 1])
    amplitude = np.ascontiguousarray(np.concatenate(columns, axis=1))
    length = np.minimum(np.append(start[1:], np.inf), duration) - start
    acts, powers = amplitude != 0, np.array(power, dtype=np.int64)
    for f in range(powers.size - 2, -1, -1):  # within a piece a power adds to the lower ones of its polynomial
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
    """Lower the limits of powers with which a channel hardly changes.

    A response that is a polynomial has terms that cancel by ``p! / (|nu - lambda| tau)^p`` of the share of the power p
    in its channel. Those of the power series that starts from zero do not while the distance is no larger than
    ``p + 1``; powers with which a channel hardly changes may be polynomials earlier, by the root of their share.
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
            # 0.5: ... to an exponential times a power of time, in any case
            limit[f] = max(limit[f] * share ** (1.0 / sources.power[f]), 0.5)


def sources_of_pieces(channels: tuple[Signal, ...], first: int, last: int, duration: float) -> Sources:
    """The sources on some of the pieces of a record of which all channels are made, see `common_record`.

    All but the pieces' starts and amplitudes is that of the whole motion.

    Parameters
    ----------
    channels : signals made of the record.
    first, last : number of the first piece, and of the one after the last.
    duration : s, of the whole motion.

    Returns
    -------
    Sources
        A constant one first, then those of each channel.
    """
    record = common_record(channels)
    assert record is not None
    parts = [signal.between(first, last) for signal in channels if isinstance(signal, StreamedSignal)]
    degrees = [part.coefficient.shape[2] for part in parts]
    columns = [np.ones((last - first, 1), dtype=complex), *(part.coefficient[:, 0] for part in parts)]
    power = np.concatenate([np.zeros(1, dtype=np.int64), *(np.arange(degree) for degree in degrees)])
    endless = duration - (record.pieces - 1) * record.step  # s, of the last piece, which ends with the motion
    longest = min(max(record.step, endless) + 4.0 * np.finfo(float).eps * duration, duration)  # round-off of the starts
    return Sources(
        record.start(first, last), np.ascontiguousarray(np.concatenate(columns, axis=1)), np.zeros(power.size, complex),
        power, np.repeat(np.arange(-1, len(parts)), [1, *degrees]), np.full(power.size, longest),
        np.where(power == 0, RESONANCE, power + 1.0), np.repeat(np.cumsum([1, *degrees]) - 1, [1, *degrees]),
    )  # fmt: skip


def _about(signal: Signal, start: Floats) -> Complexes:
    """Coefficients (P, E, D) of the signal about new piece starts that include its own."""
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
