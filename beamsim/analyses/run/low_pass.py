"""What an accelerometer reads whose signal passes a filter.

The filter is a Butterworth low-pass of four poles, -3 dB at its frequency, causal, and zero before the run:
``H(s) = Omega^4 / prod(s - p_j)`` with ``p_j = Omega exp(i pi (2 j + 3) / 8)``, ``j = 1 ... 4``. Its output is a sum
of ``r_j z_j`` with ``z_j' = p_j z_j + a(t)``. Over a panel of length h, ``z_j`` is exact up to the integral of
``exp(p_j (h - t)) a(t)``, which a Gauss-Legendre rule takes: panels end at contact events, so that the acceleration is
smooth on each, and are short against the fastest motion. Of time-stepped motions they end at the integrator's steps,
whose dense output is a polynomial there: the peaks do not depend on the rate of the output.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from beamsim.analyses.run.outputs import OutputOf
from beamsim.flow.trajectory import Trajectory
from beamsim.typing import Complexes, Floats, Ints

POLES = 4
NODES = 8
LONGEST_TURN = 4.0  # of the fastest motion on a panel, rad: the rule's error is then below 1e-10
PANELS_A_PERIOD = 32  # of the filter's frequency, so that a peak is found between panels
BLOCK = 16384  # panels at a time
NEGLIGIBLE = 1e-17
_NODE, _WEIGHT = (0.5 * x for x in np.polynomial.legendre.leggauss(NODES))
_NODE = 0.5 + _NODE  # on (0, 1)

Extreme = tuple[Floats, Floats, Floats, Floats]  # lowest, its time, highest, its time
Signal = Callable[[Floats], Floats]  # times (nt,) -> (nt, k)


class LowPassFilter:
    """The filter of k signals, led through them from t = 0 on part by part; it keeps the extremes of its output.

    Between the ends of panels the output is the cubic through values and slopes there, ``y' = sum r_j p_j z_j``; at
    `PANELS_A_PERIOD` its peaks are right to 1e-5.
    """

    def __init__(self, frequency_hz: float, signals: int) -> None:
        self.poles, self.residues = _poles(frequency_hz)
        self.longest = 1.0 / (PANELS_A_PERIOD * frequency_hz)
        self.state: Complexes = np.zeros((self.poles.size, signals), dtype=np.complex128)
        none = np.zeros(signals)
        self.value, self.slope = none, none
        self.extremes: Extreme = (none, none, none, none)

    def through(self, times: Floats, signal: Signal, longest: float = np.inf) -> Floats:
        """(nt, k) the output at increasing ``times``, the first of which is the end of the part before.

        Between two of them the signal is smooth; a panel is at most ``longest``, s.
        """
        ends, of_time = _subdivided(times, min(longest, self.longest))
        parts = [self.value[None, :]]
        for first in range(0, ends.size - 1, BLOCK):
            block = ends[first : first + BLOCK + 1]
            length = np.diff(block)
            values = signal((block[:-1, None] + length[:, None] * _NODE).ravel()).reshape(length.size, NODES, -1)
            parts.append(self._block(block, length, values))
        return np.vstack(parts)[of_time]

    def _block(self, ends: Floats, length: Floats, values: Floats) -> Floats:
        """Output (P, k) at the ends of panels with values (P, nodes, k) inside."""
        output, slope = (np.zeros((length.size, values.shape[2])) for _ in range(2))
        for j, (pole, residue) in enumerate(zip(self.poles, self.residues, strict=True)):
            kernel = _WEIGHT * np.exp(pole * length[:, None] * (1 - _NODE)) * length[:, None]
            added = np.einsum("pn,pnk->pk", kernel, values)
            factor = np.exp(pole * length)[:, None]
            added[0] += factor[0] * self.state[j]
            z = _recurrence(factor, added)
            output += 2 * (residue * z).real
            slope += 2 * (residue * pole * z).real  # the residues' sum is zero: the signal itself has no part in it
            self.state[j] = z[-1]
        y, dy = np.vstack([self.value, output]), np.vstack([self.slope, slope])
        low, low_time, high, high_time = self.extremes
        self.extremes = (*_lower(ends, y, dy, low, low_time), *_higher(ends, y, dy, high, high_time))
        self.value, self.slope = y[-1], dy[-1]
        return output


def filtered(trajectory: Trajectory, output_of: OutputOf, frequency_hz: float, times: Floats) -> tuple[Floats, Extreme]:
    """Outputs of a motion through the filter: (nt, k) at increasing ``times``, and the extremes of the whole motion."""
    flow = trajectory.flow
    fastest = flow.largest_exponent
    known = np.unique(np.concatenate([trajectory.time, times[times <= trajectory.end], [trajectory.end]]))
    count = output_of(flow.system.contacts.start).row.shape[0]
    through = LowPassFilter(frequency_hz, count)
    longest = LONGEST_TURN / fastest if fastest > 0 else np.inf
    history = through.through(known, lambda at: trajectory.sample(at, output_of), longest)
    return history[np.searchsorted(known, times)], through.extremes


def _poles(frequency_hz: float) -> tuple[Complexes, Complexes]:
    """Poles with a positive imaginary part, rad/s, and their residues; the others are their conjugates."""
    omega = 2 * np.pi * frequency_hz
    poles = omega * np.exp(1j * np.pi * (2 * np.arange(1, POLES + 1) + POLES - 1) / (2 * POLES))
    others = poles[:, None] - poles + np.eye(POLES)
    residues = omega**POLES / others.prod(axis=1)
    upper = poles.imag > 0
    return poles[upper], residues[upper]


def _subdivided(known: Floats, longest: float) -> tuple[Floats, Ints]:
    """Times with further ones between them, so that no step is longer, and the indices of the given ones."""
    steps = np.maximum(np.ceil(np.diff(known) / longest), 1).astype(np.int64)
    of_known = np.concatenate([[0], np.cumsum(steps)])
    start = np.repeat(known[:-1], steps)
    number = np.arange(steps.sum()) - np.repeat(of_known[:-1], steps)
    return np.append(start + number * np.repeat(np.diff(known) / steps, steps), known[-1]), of_known


def _recurrence(factor: Complexes, added: Complexes) -> Complexes:
    """``z_i = factor_i z_(i-1) + added_i`` from zero, (P, k), by doubling."""
    z, reach, step = added.copy(), factor.copy(), 1
    while step < z.shape[0] and np.abs(reach).max() > NEGLIGIBLE:
        z[step:] += reach[step:] * z[:-step].copy()
        reach[step:] *= reach[:-step].copy()
        reach[:step] = 0.0
        step *= 2
    return z


def _lower(ends: Floats, y: Floats, slope: Floats, lowest: Floats, when: Floats) -> tuple[Floats, Floats]:
    """The same for the lowest values."""
    value, at = _higher(ends, -y, -slope, -lowest, when)
    return -value, at


def _higher(ends: Floats, y: Floats, slope: Floats, highest: Floats, when: Floats) -> tuple[Floats, Floats]:
    """The highest values (k,) so far and their times, of curves with values and slopes (P + 1, k) at given times."""
    h = np.diff(ends)[:, None]
    a, b, rise = h * slope[:-1], h * slope[1:], np.diff(y, axis=0)
    # y(s) = y_0 + a s + c_2 s^2 + c_3 s^3 on a panel has its maximum inside where it begins rising and ends falling
    inside = (a > 0) & (b < 0)
    c2, c3 = 3 * rise - 2 * a - b, a + b - 2 * rise
    root = np.sqrt(np.where(inside, c2**2 - 3 * a * c3, 1.0))
    s = np.where(inside, a / np.where(inside, root - c2, 1.0), 0.0)
    top = y[:-1] + s * (a + s * (c2 + s * c3))
    top, at = np.vstack([top, y[-1]]), np.vstack([ends[:-1, None] + s * h, np.full(y.shape[1], ends[-1])])
    best, column = top.argmax(axis=0), np.arange(y.shape[1])
    better = top[best, column] > highest
    return np.where(better, top[best, column], highest), np.where(better, at[best, column], when)
