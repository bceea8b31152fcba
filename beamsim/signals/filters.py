r"""Signals behind linear filters in partial fractions: what an accelerometer reads, oscillators of a shock spectrum.

The output of :math:`H(s) = \sum_j r_j / (s - p_j)` is a sum of :math:`r_j z_j` with :math:`z_j' = p_j z_j + a(t)`.
Over a panel of length h, :math:`z_j` is exact up to the integral of :math:`e^{p_j (h - t)} a(t)`, which a
Gauss-Legendre rule takes: panels end where the signal may jump, so that it is smooth on each, and are short against the
fastest motion that has not decayed there.
Between the ends of panels the output is the cubic through values and slopes there, in which its extremes are sought.
Of time-stepped motions panels end at the integrator's steps, whose dense output is a polynomial there: the peaks do not
depend on the rate of the output.

Of a motion in closed form an output is :math:`a = \mathrm{Re} \sum_t A_t e^{\lambda_t \tau}` between two events.
Behind the filter it is

.. math:: y = \mathrm{Re} \sum_t A_t H(\lambda_t) e^{\lambda_t \tau} + \sum_j r_j w_j e^{p_j \tau},

and the amplitudes :math:`w_j` follow from segment to segment, since :math:`z_j` does not jump. Its extremes are
certified as those of the motion are. Motions with powers of time are led through panels, whose ends are kept.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from beamsim.errors import Problem, ScenarioError
from beamsim.flow.contact_state import ContactState
from beamsim.flow.extrema import Sums, search_extrema
from beamsim.flow.trajectory import Trajectory
from beamsim.outcomes import check_stop
from beamsim.system.equations import RowsOf
from beamsim.typing import Complexes, Floats, Ints

NODES = 8
LONGEST_TURN = 4.0  # of the fastest motion on a panel, rad: the rule's error is then below 1e-10
BLOCK = 16384  # panels at a time
MOST_PANELS = 1e8  # 3 GB, and minutes
NEGLIGIBLE = 1e-17
DECAYED = 45.0  # logarithm of the decay after which a motion counts no more: 3e-20 of what it was
SLOWER = 0.5  # of the fastest motion that is left, for which panels become longer
_NODE, _WEIGHT = (0.5 * x for x in np.polynomial.legendre.leggauss(NODES))
_NODE = 0.5 + _NODE  # on (0, 1)
_AT_BEGIN, _AT_END = (  # values of the polynomial through the nodes at the ends of a panel
    np.array([np.prod([(x - _NODE[m]) / (_NODE[n] - _NODE[m]) for m in range(NODES) if m != n]) for n in range(NODES)])
    for x in (0.0, 1.0)
)

Extreme = tuple[Floats, Floats, Floats, Floats]  # lowest, its time, highest, its time
Signal = Callable[[Floats], Floats]  # times (nt,) -> (nt, k)
POLES = 4
PANELS_A_PERIOD = 32  # of the filter's frequency; peaks between panels are then right to 1e-5
NEAREST_POLE = 1e-6  # relative distance of an exponent from a pole of the filter, which loses as many digits
PANELS_OF_OSCILLATOR = 16  # of the highest oscillator; peaks between panels are then right to 1e-4
SAMPLES_OF_OSCILLATOR = 10  # of the highest oscillator, of a time-stepped motion


@dataclass(frozen=True)
class Panels:
    """A block of panels with what the signal is on them.

    Parameters
    ----------
    ends : (P + 1,) s.
    length : (D,) s, the different lengths.
    length_index : (P,) index into these.
    values : (P, nodes, k) the signal at the nodes.
    """

    ends: Floats
    length: Floats
    length_index: Ints
    values: Floats


def smooth_intervals(motion: Trajectory) -> tuple[Floats, Floats]:
    """Intervals on which a motion in closed form is smooth, and its fastest motion on each that has not decayed.

    Parameters
    ----------
    motion : S segments.

    Returns
    -------
    edges : (E + 1,) s, where segments begin, and where what decays faster than all else has done so; the end.
    fastest : (E,) rad/s.
    """
    begins, sizes = [np.zeros(0)], [np.zeros(0)]
    for state, segments in motion.by_state():
        since, size = _remaining_exponents(state.exponent)
        inside = since < motion.length[segments, None]
        begins.append((motion.time[segments, None] + since)[inside])
        sizes.append(np.broadcast_to(size, inside.shape)[inside])
    begin, fastest = np.concatenate(begins), np.concatenate(sizes)
    order = np.argsort(begin, kind="stable")
    edges = np.append(begin[order], motion.end)
    lasting = np.diff(edges) > 0.0
    return np.append(edges[:-1][lasting], motion.end), fastest[order][lasting]


def _remaining_exponents(exponent: Complexes) -> tuple[Floats, Floats]:
    """Times (m,), s, since a segment began, and the largest exponent (m,), rad/s, of what has not decayed from each on.

    The first is 0; at each of the others the largest exponent falls to `SLOWER` of the one before, or less.
    """
    size, decay = np.abs(exponent), -exponent.real
    until = np.divide(DECAYED, decay, out=np.full(decay.size, np.inf), where=decay > 0.0)
    order = np.argsort(until, kind="stable")
    left = np.append(np.maximum.accumulate(size[order][::-1])[::-1], 0.0)  # before each of the decays, and after all
    since, largest = [0.0], [float(left[0])]
    for time, rest in zip(until[order].tolist(), left[1:].tolist(), strict=True):
        if np.isfinite(time) and rest <= SLOWER * largest[-1]:
            since.append(time)
            largest.append(rest)
    return np.array(since), np.array(largest)


def _panels(times: Floats, signal: Signal, longest: float | Floats) -> Iterator[Panels]:
    """Blocks of panels from the first to the last of increasing times.

    Parameters
    ----------
    times : (E + 1,) s, which are ends of panels.
    signal : times (nt,) -> (nt, k).
    longest : s, that a panel may be, everywhere or (E,) between each two of the times.

    Raises
    ------
    ScenarioError
        If there would be too many: something in the motion is very fast against its duration.
    """
    count = float(np.sum(np.maximum(np.ceil(np.diff(times) / longest), 1)))
    if count > MOST_PANELS:
        raise ScenarioError(
            Problem(
                "run",
                f"asks for run.srs or run.low_pass, which would take {count:.2g} steps (at most {MOST_PANELS:.0g}), "
                f"the shortest of {np.min(longest):.2g} s: the shortest pulse, the fastest mode or a stiff contact "
                f"of the motion turns by {LONGEST_TURN:g} rad in one",
                "make the pulse longer (of much shorter ones than the fastest mode's period only the area counts) or "
                "the run shorter, keep fewer modes, or leave run.srs and run.low_pass out",
            )
        )
    steps = np.maximum(np.ceil(np.diff(times) / longest), 1).astype(np.int64)
    begun = np.concatenate([[0], np.cumsum(steps)])
    lengths = np.diff(times) / steps
    number = np.arange(begun[-1]) - np.repeat(begun[:-1], steps)  # of a panel between two of the times
    ends = np.append(np.repeat(times[:-1], steps) + number * np.repeat(lengths, steps), times[-1])
    of_panel = np.repeat(np.arange(steps.size), steps)
    for first in range(0, ends.size - 1, BLOCK):
        check_stop()
        block, part = ends[first : first + BLOCK + 1], of_panel[first : first + BLOCK]
        length = lengths[part[0] : part[-1] + 1]
        which = part - part[0]
        nodes = (block[:-1, None] + length[which, None] * _NODE).ravel()
        yield Panels(block, length, which, signal(nodes).reshape(which.size, NODES, -1))


class LinearFilter:
    """A filter of k signals, led through them from zero, block by block; it keeps the extremes of its output.

    Parameters
    ----------
    poles, residues : (m,) rad/s, of each conjugate pair that with a positive imaginary part.
    signals : k.
    """

    def __init__(self, poles: Complexes, residues: Complexes, signals: int) -> None:
        self.poles, self.residues = poles, residues
        self.state: Complexes = np.zeros((poles.size, signals), dtype=np.complex128)
        self.value = self.slope = none = np.zeros(signals)  # reached
        self.extremes: Extreme = (none, none, none, none)

    def panels(self, times: Floats, signal: Signal, longest: float | Floats) -> FilteredPanels:
        """The output from the time that was reached on.

        Parameters
        ----------
        times : (nt,) increasing, s; the first is the end of the part before. Between two of them the signal is smooth.
        signal : times (nt,) -> (nt, k).
        longest : s, that a panel may be, everywhere or (nt - 1,) between each two of the times.

        Returns
        -------
        FilteredPanels
            Known at the times and at the ends of all panels.

        Raises
        ------
        ScenarioError
            If there would be too many panels.
        """
        ends, values, slopes = [times[:1]], [self.value[None]], [self.slope[None]]
        for block in _panels(times, signal, longest):
            value, slope = self.apply(block)
            ends.append(block.ends[1:])
            values.append(value)
            slopes.append(slope)
        return FilteredPanels(np.concatenate(ends), np.vstack(values), np.vstack(slopes))

    def apply(self, block: Panels) -> tuple[Floats, Floats]:
        """(P, k) the output at the ends of panels, and its slope."""
        values = block.values
        output = np.zeros((values.shape[0] + 1, values.shape[2]))
        direct = 2 * self.residues.real.sum()  # the signal's own part in the slope
        begin, end = (direct * np.einsum("n,pnk->pk", at, values) for at in (_AT_BEGIN, _AT_END))
        for j, (pole, residue) in enumerate(zip(self.poles, self.residues, strict=True)):
            kernel = _WEIGHT * np.exp(pole * block.length[:, None] * (1 - _NODE)) * block.length[:, None]
            added = np.matmul(kernel[block.length_index][:, None, :], values)[:, 0]
            factor = np.exp(pole * block.length)[block.length_index, None]
            first = self.state[j]
            added[0] += factor[0] * first
            z = np.vstack([first[None], recurrence(factor, added)])
            output += 2 * (residue * z).real
            slope = 2 * (residue * pole * z).real
            begin += slope[:-1]
            end += slope[1:]
            self.state[j] = z[-1]
        self.extremes = _peaks(block.ends, output, (begin, end), self.extremes)
        self.value, self.slope = output[-1], end[-1]
        return output[1:], end


def recurrence(factor: Complexes, input: Complexes) -> Complexes:
    """``z_i = factor_i z_(i-1) + added_i`` from zero, (P, k), by doubling."""
    z, reach, step = input.copy(), factor.copy(), 1
    while step < z.shape[0] and np.abs(reach).max() > NEGLIGIBLE:
        z[step:] += reach[step:] * z[:-step].copy()
        reach[step:] *= reach[:-step].copy()
        reach[:step] = 0.0
        step *= 2
    return z


def _cubic_factors(left: Floats, right: Floats, begin: Floats, end: Floats) -> tuple[Floats, Floats]:
    """Factors of the square and of the cube of the place in cubics on panels of length one.

    Parameters
    ----------
    left, right : values at the ends of the panels.
    begin, end : slopes there.
    """
    rise = right - left
    return 3.0 * rise - 2.0 * begin - end, begin + end - 2.0 * rise


def _higher(
    ends: Floats, y: Floats, begin: Floats, end: Floats, highest: Floats, times: Floats
) -> tuple[Floats, Floats]:
    """The highest values (k,) so far and their times.

    The curves have values (P + 1, k) at the ends of panels, and slopes (P, k) at the beginning and the end of each.
    """
    h = np.diff(ends)[:, None]
    a, b = h * begin, h * end
    inside = (a > 0) & (b < 0)  # it begins rising and ends falling, so that it has its maximum inside
    c2, c3 = _cubic_factors(y[:-1], y[1:], a, b)
    root = np.sqrt(np.where(inside, c2**2 - 3 * a * c3, 1.0))
    inside &= root > c2  # else both underflow
    s = np.where(inside, a / np.where(inside, root - c2, 1.0), 0.0)
    tops = y[:-1] + s * (a + s * (c2 + s * c3))
    top, at = np.vstack([tops, y[-1]]), np.vstack([ends[:-1, None] + s * h, np.full(y.shape[1], ends[-1])])
    best, column = top.argmax(axis=0), np.arange(y.shape[1])
    better = top[best, column] > highest
    return np.where(better, top[best, column], highest), np.where(better, at[best, column], times)


def butterworth(frequency_hz: float) -> tuple[Complexes, Complexes]:
    """Poles with a positive imaginary part, rad/s, and their residues, of the low-pass in front of an accelerometer.

    It has four poles and -3 dB at its frequency, and is causal: ``H(s) = Omega^4 / prod(s - p_j)`` with
    ``p_j = Omega exp(i pi (2 j + 3) / 8)``, ``j = 1 ... 4``. The others are conjugates.
    """
    omega = 2 * np.pi * frequency_hz
    turns = (2 * np.arange(1, POLES + 1) + POLES - 1) / (4 * POLES)
    poles = np.asarray(omega * np.exp(2j * np.pi * turns), dtype=complex)
    others = poles[:, None] - poles + np.eye(POLES)
    residues = omega**POLES / others.prod(axis=1)
    upper = poles.imag > 0
    return poles[upper], residues[upper]


def filter_outputs(
    trajectory: Trajectory,
    output_of: RowsOf,
    frequency_hz: float,
    times: Floats,
    filter_state: LinearFilter | None = None,
) -> FilteredMotion:
    """Outputs of a motion behind the Butterworth low-pass of a frequency.

    Parameters
    ----------
    trajectory : the motion, or its next chunk.
    output_of : k outputs.
    frequency_hz : of the filter.
    times : (nt,) increasing, s, at which the values are to be right to 1e-9; elsewhere to 1e-5 at least.
    filter_state : the filter, led through the chunks before; only inputs with powers of time are taken in chunks.

    Returns
    -------
    FilteredMotion
        In closed form where the motion is made of exponentials alone, none of them near a pole of the filter; else
        known at the ends of panels.

    Raises
    ------
    ScenarioError
        If a motion that is led through panels would need too many of them.
    """
    if trajectory.exponentials and not _near_poles(trajectory, butterworth(frequency_hz)[0]):
        return FilteredSegments.of(trajectory, output_of, frequency_hz)
    edges, fastest = smooth_intervals(trajectory)
    known = np.unique(np.concatenate([trajectory.time[:1], edges, times[times <= trajectory.end]]))
    outputs = output_of(trajectory.flow.system.contacts.start).shape[0]
    through = filter_state or LinearFilter(*butterworth(frequency_hz), outputs)
    if fastest.size:
        fastest = fastest[np.clip(np.searchsorted(edges, known[:-1], side="right") - 1, 0, fastest.size - 1)]
    longest = longest_panel(fastest, PANELS_A_PERIOD * frequency_hz)
    return through.panels(known, lambda at: trajectory.sample(at, output_of), longest)


def longest_panel(fastest: float | Floats, rate: float) -> Floats:
    """Lengths of panels (E,), s: short against fastest motions (E,), rad/s, and no fewer than a number a second."""
    with np.errstate(divide="ignore"):
        return np.minimum(LONGEST_TURN / np.asarray(fastest, dtype=float), 1.0 / rate)


@dataclass(frozen=True)
class FilteredPanels:
    """Known by values and slopes at the ends of panels; a cubic in between."""

    ends: Floats  # (P + 1,) s
    value: Floats  # (P + 1, k)
    slope: Floats  # (P + 1, k)

    def at(self, times: Floats) -> Floats:
        """(nt, k) at increasing times."""
        panel = np.clip(np.searchsorted(self.ends, times, side="right") - 1, 0, self.ends.size - 2)
        return self._inside(panel, times)[0]

    def extremes(self, begin: float, end: float) -> Extreme:
        """Lowest and highest values between two times, and when."""
        inside = self.ends[(self.ends > begin) & (self.ends < end)]
        first = int(np.searchsorted(self.ends, begin, side="right")) - 1
        last = first + inside.size + 1
        part = slice(first + 1, last)
        edges = np.array([begin, end])
        value, slope = self._inside(np.clip([first, last - 1], 0, self.ends.size - 2), edges)
        value = np.vstack([value[:1], self.value[part], value[1:]])
        slope = np.vstack([slope[:1], self.slope[part], slope[1:]])
        ends = np.concatenate([edges[:1], inside, edges[1:]])
        return _peaks(ends, value, (slope[:-1], slope[1:]), _unknown(value.shape[1]))

    def _inside(self, panel: Ints, times: Floats) -> tuple[Floats, Floats]:
        """(nt, k) values and slopes of the cubics of panels."""
        h = (self.ends[panel + 1] - self.ends[panel])[:, None]
        h = np.where(h > 0, h, 1.0)  # a motion that ends where it begins
        s, left, begin = (times - self.ends[panel])[:, None] / h, self.value[panel], h * self.slope[panel]
        c2, c3 = _cubic_factors(left, self.value[panel + 1], begin, h * self.slope[panel + 1])
        return left + s * (begin + s * (c2 + s * c3)), (begin + s * (2.0 * c2 + 3.0 * s * c3)) / h


@dataclass(frozen=True)
class FilteredSegments:
    """Known in closed form, of a motion without powers of time.

    Parameters
    ----------
    motion, output_of : the motion, and k outputs that the filter follows.
    poles : of the filter.
    free_amplitude : (S, 2, k) amplitudes of the filter's own motion where segments begin, the residues included.
    """

    motion: Trajectory
    output_of: RowsOf
    poles: Complexes
    free_amplitude: Complexes

    @classmethod
    def of(cls, motion: Trajectory, output_of: RowsOf, frequency_hz: float) -> FilteredSegments:
        """Follow the filter from a state of zero through the segments of a motion.

        Parameters
        ----------
        motion : from its start, without powers of time.
        output_of : k outputs.
        frequency_hz : of the filter.

        Returns
        -------
        FilteredSegments
        """
        poles, residues = butterworth(frequency_hz)
        begin, end = _forced_states(motion, output_of, poles)
        decay = np.exp(poles * motion.length[:, None])  # (S, 2)
        free = np.empty_like(begin)
        for j, residue in enumerate(residues):
            after = recurrence(decay[:, j, None], end[:, j] - decay[:, j, None] * begin[:, j])
            free[:, j] = 2.0 * residue * (np.vstack([np.zeros_like(after[:1]), after[:-1]]) - begin[:, j])
        return cls(motion, output_of, poles, free)

    def at(self, times: Floats) -> Floats:
        """(nt, k) at increasing times."""
        segment = self.motion.segments_at(times)
        turned = np.exp(self.poles * (times - self.motion.time[segment])[:, None])
        fading = np.einsum("nj,njk->nk", turned, self.free_amplitude[segment]).real
        return np.asarray(self.motion.sample(times, self.output_of, self._gain) + fading)

    def extremes(self, begin: float, end: float) -> Extreme:
        """Lowest and highest values between two times, and when."""
        found = search_extrema(self._sums(np.array([begin, end])), self.free_amplitude.shape[2])
        low, when_low, high, when_high = (of_window[0] for of_window in found[:4])
        return low, when_low, high, when_high

    def _gain(self, state: ContactState) -> Complexes:
        """(T,) factor by which the filter changes ``e^{exponent tau}``; one at rest."""
        both, exponent = np.append(self.poles, self.poles.conj()), state.exponent[state.term_basis]
        return np.asarray(np.prod(both) / np.prod(exponent[:, None] - both, axis=1))

    def _sums(self, edges: Floats) -> Iterator[Sums]:
        """The outputs between two times, s, for the search for extremes: the filter's own motions are more terms."""
        poles, outputs = self.poles, self.free_amplitude.shape[2]
        own = np.tile(np.eye(outputs), (poles.size, 1))  # each pole moves each output with an amplitude of its own
        pole = np.repeat(np.arange(poles.size), outputs)
        every = np.ones(self.motion.time.size, dtype=bool)
        for segment, sums in self.motion.sums(self.output_of, every, edges, gain=self._gain):
            fading = self.free_amplitude[segment].reshape(segment.size, -1)
            yield sums._replace(
                rate=np.concatenate([sums.rate, poles]),
                power=np.concatenate([sums.power, np.zeros_like(sums.power, shape=poles.size)]),
                basis=np.concatenate([sums.basis, sums.rate.size + pole]),
                amplitude=np.hstack([sums.amplitude, fading]),
                noise=np.hstack([sums.noise, np.finfo(float).eps * np.abs(fading)]),
                table=np.concatenate([sums.table, own]),
            )  # fmt: skip


FilteredMotion = FilteredPanels | FilteredSegments
"""k outputs of a motion behind a filter: ``at`` times, and ``extremes`` between two."""


def _near_poles(trajectory: Trajectory, poles: Complexes) -> bool:
    """Whether a motion has an exponent so close to a pole of the filter that their difference loses its digits."""
    both = np.concatenate([poles, poles.conj()])
    states = (state for state, _ in trajectory.by_state())
    return any(np.abs(state.exponent[:, None] - both).min() < NEAREST_POLE * abs(poles[0]) for state in states)


def _forced_states(motion: Trajectory, output_of: RowsOf, poles: Complexes) -> tuple[Complexes, Complexes]:
    """(S, 2, k) what z would be at the begin and the end of each segment if the filter had always seen its motion."""
    outputs = output_of(motion.flow.system.contacts.start).shape[0]
    begin, end = np.empty((2, motion.time.size, poles.size, outputs), dtype=complex)
    for state, segments in motion.by_state():
        amplitude = motion.amplitudes(state, segments)[:, state.term_source]
        acts = amplitude.any(axis=0)  # what rests may grow without bound
        amplitude, exponent = amplitude[:, acts], state.exponent[state.term_basis[acts]]
        of_terms = state.coefficients(output_of(state.phases), motion.flow.sources)[acts]
        later = amplitude * np.exp(motion.length[segments, None] * exponent)
        for j, pole in enumerate(poles):
            one, other = of_terms / (exponent - pole)[:, None], of_terms.conj() / (exponent.conj() - pole)[:, None]
            begin[segments, j] = 0.5 * (amplitude @ one + amplitude.conj() @ other)
            end[segments, j] = 0.5 * (later @ one + later.conj() @ other)
    return begin, end


def _unknown(count: int) -> Extreme:
    nothing, low = np.full(count, np.nan), np.full(count, np.inf)
    return low, nothing, -low, nothing


def _peaks(ends: Floats, value: Floats, slopes: tuple[Floats, Floats], extremes: Extreme) -> Extreme:
    """Extremes of cubics, and of what is known before.

    Parameters
    ----------
    ends : (P + 1,) of panels, s.
    value : (P + 1, k) there.
    slopes : (P, k) at the beginning and at the end of each panel.
    extremes : extremes so far.
    """
    low, low_time, high, high_time = extremes
    least, when = _higher(ends, -value, -slopes[0], -slopes[1], -low, low_time)
    return (-least, when, *_higher(ends, value, *slopes, high, high_time))


def geomspaced(lowest: float, highest: float, per_octave: int) -> Floats:
    """(nf,) Hz, equally spaced in the logarithm from the lowest to the highest, which both belong to them."""
    return np.geomspace(lowest, highest, max(round(per_octave * np.log2(highest / lowest)), 1) + 1)


def shock_spectra(frequency: Floats, quality: float, times: Floats, signal: Signal, fastest: float | Floats) -> Floats:
    r"""Peaks of the absolute acceleration of oscillators on a base that moves as a signal does.

    An oscillator of natural frequency :math:`\omega` and damping ratio :math:`\zeta = 1 / (2 Q)` is the linear filter
    :math:`H(s) = (2 \zeta \omega s + \omega^2) / (s^2 + 2 \zeta \omega s + \omega^2)` (ISO 18431-4), so there is no
    sample rate to choose. After the end of the record it moves freely, and its peaks follow from its state there.

    Parameters
    ----------
    frequency : (nf,) Hz, increasing natural frequencies of the oscillators.
    quality : Q of the oscillators.
    times : increasing, s, from the begin of the record to its end; the signal is smooth between two of them.
    signal : times (nt,) -> (nt, k); zero before the record and after it.
    fastest : rad/s, of the signal's motion, everywhere or (nt - 1,) between each two of the times.

    Returns
    -------
    (k, 4, nf) array
        Positive and negative peaks during the record, then both after it, as magnitudes in the unit of the signals.

    Raises
    ------
    ScenarioError
        If there would be too many panels.
    """
    longest = longest_panel(fastest, PANELS_OF_OSCILLATOR * frequency[-1])
    count = signal(times[:1]).shape[1]
    oscillators = [LinearFilter(*_oscillator(hz, quality), count) for hz in frequency]
    for block in _panels(times, signal, longest):
        for oscillator in oscillators:
            oscillator.apply(block)
    peaks = np.empty((count, 4, frequency.size))
    for i, oscillator in enumerate(oscillators):
        low, _, high, _ = oscillator.extremes
        after_low, after_high = _free_peaks(oscillator.poles[0], oscillator.residues[0] * oscillator.state[0])
        peaks[:, :, i] = np.column_stack([high, -low, after_high, -after_low])
    return peaks


def _oscillator(frequency_hz: float, quality: float) -> tuple[Complexes, Complexes]:
    """Pole with a positive imaginary part, rad/s, and its residue."""
    omega, damping = 2 * np.pi * frequency_hz, 0.5 / quality
    pole = omega * (-damping + 1j * np.sqrt(1.0 - damping**2))
    return np.array([pole]), np.array([(2 * damping * omega * pole + omega**2) / (2j * pole.imag)])


def _free_peaks(pole: complex, state: Complexes) -> tuple[Floats, Floats]:
    """Lowest and highest value of ``2 Re(state exp(pole t))`` for t >= 0, not above and not below zero."""
    # the slope vanishes where pole * state * exp(pole t) is imaginary
    first = np.mod(0.5 * np.pi - np.angle(state) - np.angle(pole), np.pi) / pole.imag
    times = (np.zeros_like(first), first, first + np.pi / pole.imag)
    values = np.stack([2 * (state * np.exp(pole * t)).real for t in times])
    return np.minimum(values.min(axis=0), 0.0), np.maximum(values.max(axis=0), 0.0)
