r"""Channels along a motion: their values and extremes, and Fourier integrals and means of outputs.

Fourier integrals :math:`X(\omega) = \int x(t) e^{-i \omega t} dt` at equally spaced frequencies are free of aliasing:
up to a frequency they are what an ideal low-pass filter leaves of a motion. On a segment an output is a sum of
functions :math:`\tau^p e^{\lambda \tau}`:

- Functions that are not much faster than the highest frequency, on this segment, are sampled at the nodes of a
  Gauss-Legendre rule. Panels are so short that the rule integrates them times :math:`e^{-i \omega \tau}` to round-off.
- The integrals of all others follow from their values at both ends, by parts: with :math:`\rho = \lambda - i \omega`
  that of :math:`\tau^p e^{\rho \tau}` is :math:`e^{\rho \tau} \sum_j (-1)^j p! / (p - j)! \, \tau^{p - j} /
  \rho^{j + 1}`, j = 0 ... p. Up to the highest frequency a power of :math:`1 / \rho` is a sum of a few
  :math:`w_q e^{-i \omega s_q}`, so that an end counts as values at times about it.

All outputs share functions and weights: their values are one product of matrices. Both give sums
:math:`\sum_i v_i e^{-i k \delta t_i}` over uneven times, which are spread to an even grid, transformed there by the
fast Fourier transform and divided by the transform of the spreading function. See A. H. Barnett et al., SIAM J. Sci.
Comput. 41 (2019) C479.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property, lru_cache
from itertools import pairwise
from math import perm

import numpy as np

from beamsim.flow.contact_state import GROWTH, ContactState
from beamsim.flow.exact import ExactFlow
from beamsim.flow.extrema import Extrema
from beamsim.flow.kernels import spread_to_grid
from beamsim.flow.moments import MANY_VALUES, blocks
from beamsim.flow.trajectory import Trajectory
from beamsim.outcomes import check_stop
from beamsim.system.equations import ChannelSet, Key, RowsOf, Sizes
from beamsim.typing import Complexes, Floats, Ints

Exponentials = tuple[tuple[int, float], ...]
r"""A window on [0, T] as a sum of :math:`c e^{-i \pi s u / T}`: whole numbers s, and factors c."""
MARGIN = 18  # half steps of frequency beyond the highest that windows need
SPREAD = 15  # grid points over which a value is spread
SHARPNESS = 2.3 * SPREAD  # of the spreading function exp(SHARPNESS (sqrt(1 - z^2) - 1)), -1 < z < 1
DEGREES = 15  # coefficients of the polynomials that approximate it
OVERSAMPLING = 2  # of the grid
_FREQUENCIES = 64  # frequencies per row of their matrix
FAST = 2.0  # times the highest frequency: faster functions are integrated by parts ...
LONG = 20.0  # ... where a segment is longer than so many of their time constants
NODES_OF_ENDS, TURN_OF_ENDS = 40, 1.2  # times about an end, and the turn, rad, between two at the highest frequency
_FITTED = np.cos(np.pi * (np.arange(160) + 0.5) / 160)  # shares of it at which the sums are fitted
NODES_OF_RULES = (6, 8, 12, 16, 24, 32, 48, 64)
NEIGHBOURS = 20  # frequencies on either side used to interpolate an integral
# turn of an exponential, rad, over which these rules integrate it to 1e-12
_LONGEST_TURN = 8.0 * np.array(NODES_OF_RULES) / np.exp(1.0) * 10.0 ** (-6.0 / np.array(NODES_OF_RULES))
_rule = lru_cache(np.polynomial.legendre.leggauss)


def outputs_of(flow: ExactFlow, rows: Floats) -> RowsOf:
    """Rows of channels in terms of a flow's state and inputs, without cubic springs.

    Parameters
    ----------
    flow : of the system that the channels belong to.
    rows : (k, W) of them, see `beamsim.system.equations.Sizes`.

    Returns
    -------
    The rows (k, V) by the phases of the contacts.
    """
    equations, system, signals = flow.equations, flow.system, len(flow.forcing.signal)
    parts = Sizes(system.size, system.contacts.count, signals, 0).slices  # those of cubic springs are the last ones
    of = {name: rows[:, columns] for name, columns in parts.items()}
    fixed = equations.rows(rows.shape[0], coordinates=of["displacement"], velocities=of["velocity"])
    fixed += equations.constant(of["constant"][:, 0]) + of["load"] @ equations.signals(np.arange(signals))
    of_phases = {name: of[name] for name in ("contact", "opening", "acceleration")}
    varying = np.flatnonzero(np.hstack([*of_phases.values()]).any(axis=1))
    contact, opening, acceleration = (part[varying] for part in of_phases.values())

    def rows_of(phases: Ints) -> Floats:
        if not varying.size:
            return fixed
        at, every = flow.at(phases), fixed.copy()
        every[varying] += contact @ at.force
        if opening.any():
            every[varying] += opening @ at.openings
        if acceleration.any():
            every[varying] += acceleration @ at.rates[equations.velocities]
        return every

    return rows_of


def channel_values(motion: Trajectory, channels: ChannelSet, times: Floats) -> Floats:
    """(nt, C) channels of a motion at increasing times, s; at an event the state after it counts."""
    return channels.values(motion.sample(times, outputs_of(motion.flow, channels.rows)))


def channel_extrema(motion: Trajectory, channels: ChannelSet, largest_of: Key | None = None) -> Extrema:
    """(C,) extreme values of channels of the continuous motion and their times, s; see `Trajectory.extrema`.

    Parameters
    ----------
    motion, channels : C columns of values along a motion.
    largest_of : section and quantity of linear channels of which only the largest magnitude is needed; for the other
        channels of that kind a value that is reached, not the extreme.
    """
    order = channels.order
    competitors = None if largest_of is None else order[channels.places[largest_of]]
    found = motion.extrema(outputs_of(motion.flow, channels.linear), competitors=competitors)
    values, evaluations = np.array(found[:4]), found.evaluations
    if channels.squares.size:
        squares = motion.extrema(outputs_of(motion.flow, channels.squared), squares=channels.squares)
        values, evaluations = np.hstack([values, squares[:4]]), evaluations + squares.evaluations
    low, when_low, high, when_high = values[:, order]
    return Extrema(low, when_low, high, when_high, evaluations)


ON_A_SAMPLE = 1e-9  # share of a step within which a time counts as that of a sample


class MotionPart:
    """K outputs on a part of a motion, with its Fourier integrals up to a frequency, free of aliasing.

    Parameters
    ----------
    motion : the part.
    rows_of : the outputs.
    highest : rad/s, highest frequency of the Fourier integrals; the side lobes of windows may lie beyond.
    """

    def __init__(self, motion: Trajectory, rows_of: RowsOf, highest: float) -> None:
        self.motion = motion.with_all_states() if motion.flow.has_dropped_states else motion
        self.rows_of, self.highest, self.begin = rows_of, highest, float(motion.time[0])
        self.duration = motion.end - self.begin  # s
        self._weighted: dict[Exponentials, Complexes] = {}

    @cached_property
    def all_integrals(self) -> Complexes:
        """(K, count) Fourier integrals at multiples of half the inverse of the duration."""
        step, outputs = np.pi / self.duration, self.rows_of(self.motion.flow.system.contacts.start).shape[0]
        count = int(self.highest / step) + 2 * (MARGIN + NEIGHBOURS)  # twice: every other one serves half of the time
        values = values_to_sum(self.motion, self.rows_of, step * (count - 1))
        return evenly_spaced_sums(values, step, count, outputs).T

    @property
    def means(self) -> Floats:
        """(K,) means."""
        return self.all_integrals[:, 0].real / self.duration

    def windowed_integrals(self, window: Exponentials) -> Complexes:
        """(K, count) Fourier integrals under a window, at the same frequencies but the last, which it needs."""
        if window not in self._weighted:
            known, reach = self.all_integrals, max(abs(steps) for steps, _ in window)
            whole = np.concatenate([known[:, reach:0:-1].conj(), known], axis=1)
            total = np.zeros((known.shape[0], known.shape[1] - reach), dtype=complex)
            for steps, factor in window:
                total += factor * whole[:, reach + steps : reach + steps + total.shape[1]]
            self._weighted[window] = total
        return self._weighted[window]

    def integrals(self, omega: Floats, column: int, window: Exponentials = ((0, 1.0),)) -> Complexes:
        """Fourier integrals of one of the outputs.

        Parameters
        ----------
        omega : (W,) rad/s, up to the highest.
        column : of the K outputs.
        window : factor of the output.

        Returns
        -------
        (W,) since the begin.
        """
        check_stop()
        position = omega * (self.duration / np.pi)
        whole = np.rint(position)
        known = self.windowed_integrals(window)[column]
        if np.all(np.abs(position - whole) < ON_A_SAMPLE):
            found = known[np.abs(whole).astype(np.int64)]
        else:
            found = interpolate_integrals(known, np.abs(position))
        return np.asarray(np.where(position < 0.0, found.conj(), found))

    @cached_property
    def mean_squares(self) -> Floats:
        """(K,) means of the squares."""
        return np.asarray(self.motion.square_integrals(self.rows_of) / self.duration)

    @cached_property
    def extrema(self) -> Extrema:
        """(K,) extreme values."""
        return self.motion.extrema(self.rows_of)

    @cached_property
    def quarter_deviations(self) -> tuple[Floats, Floats]:
        """(K,) standard deviations in the first and in the last quarter of the time.

        The mean is subtracted first, so that a large mean costs no digits.
        """
        constant = self.motion.flow.equations.constant(self.means)
        first, second, *_, third, end = np.linspace(self.begin, self.motion.end, 5).tolist()
        squares = [
            motion.square_integrals(lambda phases: self.rows_of(phases) - constant) / (motion.end - motion.time[0])
            for motion in (self.motion.extract(first, second), self.motion.extract(third, end))
        ]
        early, late = np.sqrt(np.maximum(squares, 0.0))
        return early, late

    @cached_property
    def halves(self) -> tuple[MotionPart, MotionPart]:
        """Both halves of the time. The integrals of the second are those of the whole less those of the first."""
        begin, middle, end = np.linspace(self.begin, self.motion.end, 3).tolist()
        early = MotionPart(self.motion.extract(begin, middle), self.rows_of, self.highest)
        whole = self.all_integrals[:, ::2]
        late = MotionPart(self.motion.extract(middle, end), self.rows_of, self.highest)
        late.all_integrals = (whole - early.all_integrals[:, : whole.shape[1]]) * (-1.0) ** np.arange(whole.shape[1])
        return early, late

    def equal_parts(self, count: int) -> list[MotionPart]:
        """Equal parts of the time, one after the other."""
        if count == 1:
            return [self]
        edges = np.linspace(self.begin, self.motion.end, count + 1).tolist()
        return [MotionPart(self.motion.extract(*span), self.rows_of, self.highest) for span in pairwise(edges)]


def evenly_spaced_sums(values: Iterable[tuple[Floats, Floats]], step: float, count: int, columns: int) -> Complexes:
    r"""Sums :math:`\sum_i v_i e^{-i k \delta t_i}` of K real columns for k = 0, 1, ... ; relative error about 1e-12.

    Parameters
    ----------
    values : times (n,), s, within one period :math:`2 \pi / \delta`, and values (n, K) there, part by part.
    step : :math:`\delta`, rad/s.
    count : of the frequencies.
    columns : K.

    Returns
    -------
    (count, K).
    """
    least = max(2 * OVERSAMPLING * count, 2 * SPREAD)
    power = 2 ** ((least - 1).bit_length() - 3)
    points = -(-least // power) * power  # 5 to 8 times a power of two: fast, without importing scipy.fft in each run
    grid, position = np.zeros((points, columns)), step * points / (2.0 * np.pi)
    for times, value in values:
        spread_to_grid(position * times, np.ascontiguousarray(value), _polynomials(), grid)
    node, weight = _rule(3 * SPREAD)
    spread = 0.5 * SPREAD * weight * _spreading(node)
    turn = 1j * np.pi * SPREAD / points * node
    coarse, fine = np.arange(0, count, _FREQUENCIES), np.arange(_FREQUENCIES)
    # transform of the spreading function: the exponential at a frequency is a product of two
    transform = (np.exp(np.multiply.outer(coarse, turn)) * spread) @ np.exp(np.multiply.outer(turn, fine))
    transform = transform.real.ravel()[:count]
    return np.asarray(np.fft.rfft(grid, axis=0)[:count] / transform[:, None])


def _spreading(z: Floats) -> Floats:
    """The spreading function; zero but for round-off at -1 and 1."""
    return np.asarray(np.exp(SHARPNESS * (np.sqrt(np.maximum(1.0 - z**2, 0.0)) - 1.0)))


@lru_cache(maxsize=1)
def _polynomials() -> Floats:
    """(SPREAD, DEGREES) polynomials that agree with the spreading function to round-off, see `spread_to_grid`."""
    place = np.cos(np.pi * (np.arange(DEGREES) + 0.5) / DEGREES)
    of_points = _spreading((place[:, None] + 1.0 + 2.0 * np.arange(SPREAD)) / SPREAD - 1.0)
    return np.ascontiguousarray(np.linalg.solve(np.vander(place, DEGREES), of_points).T)


def interpolate_integrals(integrals: Complexes, position: Floats) -> Complexes:
    r"""Fourier integrals between the frequencies at which they are known, to about 1e-13 of the largest.

    A signal of length :math:`\pi / \delta` is oversampled twice: its transform is a sum of the given values with
    weights sinc times a window, for which the spreading function above is taken.

    Parameters
    ----------
    integrals : (count,) at 0, :math:`\delta`, ... of a real signal that lasts for :math:`\pi / \delta`.
    position : (n,) frequencies over :math:`\delta`, up to ``count - 1 - NEIGHBOURS``.

    Returns
    -------
    (n,).
    """
    first, apart = np.floor(position).astype(np.int64) - NEIGHBOURS + 1, NEIGHBOURS - 1 - np.arange(2 * NEIGHBOURS)
    number, share = first[:, None] - apart + apart[0], (position - np.floor(position))[:, None]
    distance = share + apart
    inside = np.sqrt(np.maximum(1.0 - (distance / NEIGHBOURS) ** 2, 0.0))
    weight = np.sinc(distance) * np.exp(0.5 * np.pi * NEIGHBOURS * (inside - 1.0))
    known = integrals[np.abs(number)]
    known = np.where(number < 0, known.conj(), known)
    # remove the phase of the middle of the signal before, restore it after
    return np.asarray(((known * weight) @ np.exp(-0.5j * np.pi * apart)) * np.exp(-0.5j * np.pi * share[:, 0]))


def values_to_sum(motion: Trajectory, output_of: RowsOf, highest: float) -> Iterator[tuple[Floats, Floats]]:
    r"""Values whose sums are the Fourier integrals :math:`\int x(t) e^{-i \omega (t - t_0)} dt` of outputs.

    Parameters
    ----------
    motion : from :math:`t_0` on.
    output_of : K outputs, by the phases of the contacts.
    highest : largest :math:`\omega`, rad/s.

    Yields
    ------
    Times (n,) since the motion began, s, and values (n, K) there, part by part.
    """
    lasting = np.flatnonzero(motion.length > 0.0)
    for state, places in motion.by_state(lasting):
        segments, size = lasting[places], np.abs(state.exponent)
        table = state.coefficients(output_of(state.phases), motion.flow.sources)
        order = np.argsort(size, kind="stable")
        limit = np.maximum(FAST * highest, LONG / motion.length[segments])
        slow_functions = np.searchsorted(size[order], limit, side="right")
        for functions in np.unique(slow_functions):
            some, slow = segments[slow_functions == functions], np.zeros(size.size, dtype=bool)
            slow[order[:functions]] = True
            of_terms = slow[state.term_basis, None]
            fastest = float(size[slow].max(initial=0.0)) + highest
            if np.any(table * of_terms):
                yield from _values_at_nodes(motion, state, some, table * of_terms, fastest)
            if np.any(table * ~of_terms):
                yield from _values_about_ends(motion, state, some, table * ~of_terms, highest)


def _values_at_nodes(
    motion: Trajectory, state: ContactState, segments: Ints, table: Complexes, fastest: float
) -> Iterator[tuple[Floats, Floats]]:
    """Values times weights at the nodes of panels, with the rules that need the fewest values.

    Parameters
    ----------
    motion, state, segments : the motion, a contact state and segments in it.
    table : (T, K) coefficients of the terms.
    fastest : rad/s, of these terms and the highest frequency together.

    Yields
    ------
    Times (n,) since the motion began, s, and values (n, K).
    """
    acting = np.flatnonzero(table.any(axis=1))
    acting = acting[np.argsort(state.term_basis[acting], kind="stable")]  # terms of one function follow each other
    functions, first = np.unique(state.term_basis[acting], return_index=True)
    length, nodes, outputs = motion.equal_lengths[segments], np.array(NODES_OF_RULES), table.shape[1]
    panels = np.maximum(np.ceil(fastest * length[:, None] / _LONGEST_TURN), 1.0).astype(np.int64)
    best, (lengths, of_length) = np.argmin(panels * nodes, axis=1), np.unique(length, return_inverse=True)
    for rule in np.unique(best).tolist():
        rows, (node, weight) = np.flatnonzero(best == rule), _rule(NODES_OF_RULES[rule])
        count = panels[rows, rule]
        panel = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        row = np.repeat(rows, count)
        width = length[row] / panels[row, rule]
        values_of_panel = max(node.size * max(2 * functions.size, outputs), acting.size * outputs)
        for part in blocks(row.size, values_of_panel, MANY_VALUES):
            middle, half = width[part] * (panel[part] + 0.5), 0.5 * width[part]
            # panels of one number, in segments of one length, share the values of the functions
            number = panel[part] * lengths.size + of_length[row[part]]
            _, one, kind = np.unique(number, return_index=True, return_inverse=True)
            halves, of_half = np.unique(half[one], return_inverse=True)
            tau = np.multiply.outer(halves, node)  # of the nodes about the middles
            about = state.exponentials_after(tau.ravel(), functions).reshape(*tau.shape, -1)
            shared = state.exponentials_after(middle[one], functions)[:, None] * about[of_half]
            if not state.exponential:
                after = (middle[one, None] + tau[of_half]).ravel()
                shared *= state.powers_after(after, functions).reshape(shared.shape)
            shared = shared.view(float)
            visits, of = np.unique(row[part], return_inverse=True)
            amplitude = motion.amplitudes(state, segments[visits])[:, state.term_source[acting], None]
            coefficient = np.add.reduceat(amplitude * table[acting], first, axis=1)  # of the functions
            factors = np.stack([coefficient.real, -coefficient.imag], axis=2).reshape(visits.size, -1, outputs)
            values = shared[kind] @ factors[of]
            values *= np.multiply.outer(half, weight)[:, :, None]
            begun = motion.time[segments[row[part]]] - motion.time[0]
            yield ((begun + middle)[:, None] + np.multiply.outer(half, node)).ravel(), values.reshape(-1, outputs)


def _values_about_ends(
    motion: Trajectory, state: ContactState, segments: Ints, table: Complexes, highest: float
) -> Iterator[tuple[Floats, Floats]]:
    """Values at times about both ends of segments whose sums are the integrals by parts.

    Parameters
    ----------
    motion, state, segments : the motion, a contact state and segments in it.
    table : (T, K) coefficients of the terms.
    highest : rad/s, frequency.

    Yields
    ------
    Times (n,) since the motion began, s, and values (n, K).
    """
    terms, count = np.flatnonzero(table.any(axis=1)), table.shape[1]
    basis, source = state.term_basis[terms], state.term_source[terms]
    exponent, power = state.exponent[basis], state.power[basis]
    around = (np.arange(NODES_OF_ENDS) - 0.5 * (NODES_OF_ENDS - 1)) * (TURN_OF_ENDS / highest)
    left, singular, right = _fits_of_ends()
    factors = []  # of an order j, by its terms: (-1)^j p! / (p - j)!, then (terms, nodes, K) of values at the nodes
    for order in range(int(power.max()) + 1):
        # weights w_q at which the sum of w_q exp(-i x s_q) is (rate - i x)^-(order + 1) for frequencies x from -1 to 1
        aims = (exponent / highest - 1j * _FITTED[:, None]) ** -(order + 1)
        weights = (right @ ((left @ aims) / singular[:, None])).T * highest ** -(order + 1.0)
        size = np.array([(-1.0) ** order * perm(p, order) for p in power.tolist()])
        factors.append(((size[:, None] * weights)[:, :, None] * table[terms, None]).reshape(terms.size, -1))
    for part in blocks(segments.size, NODES_OF_ENDS * count, MANY_VALUES):
        some = segments[part]
        length, elapsed = motion.length[some, None], motion.time[some] - motion.time[0]
        amplitude, turned = motion.amplitudes(state, some)[:, source], length * exponent
        at_end = amplitude * np.exp(np.where(turned.real < GROWTH, turned, 0.0))  # faster growth has no amplitude
        for begun, sizes in (
            (elapsed, [-amplitude * (power == order) for order in range(len(factors))]),
            (elapsed + length[:, 0], [at_end * length ** np.maximum(power - k, 0) for k in range(len(factors))]),
        ):
            values = sum((x.real @ f.real - x.imag @ f.imag for x, f in zip(sizes, factors, strict=True)), np.zeros(()))
            yield np.add.outer(begun, around).ravel(), values.reshape(-1, count)


@lru_cache(maxsize=1)
def _fits_of_ends() -> tuple[Complexes, Floats, Complexes]:
    """Singular vectors and values of the exponentials at the times about an end, those that are not round-off."""
    place = (np.arange(NODES_OF_ENDS) - 0.5 * (NODES_OF_ENDS - 1)) * TURN_OF_ENDS
    left, size, right = np.linalg.svd(np.exp(-1j * np.multiply.outer(_FITTED, place)), full_matrices=False)
    kept = size > 1e-14 * size[0]
    return left[:, kept].conj().T, size[kept], right[kept].conj().T
