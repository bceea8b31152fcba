r"""Linear filters in partial fractions, driven by a signal that is smooth on panels.

The output of :math:`H(s) = \sum_j r_j / (s - p_j)` is a sum of :math:`r_j z_j` with :math:`z_j' = p_j z_j + a(t)`.
Over a panel of length h, :math:`z_j` is exact up to the integral of :math:`e^{p_j (h - t)} a(t)`, which a
Gauss-Legendre rule takes: panels end where the signal may jump, so that it is smooth on each, and are short against its
fastest motion.
Between the ends of panels the output is the cubic through values and slopes there, in which its extremes are sought.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from beamsim.errors import Problem, ScenarioError
from beamsim.typing import Complexes, Floats, Ints

NODES = 8
LONGEST_TURN = 4.0  # of the fastest motion on a panel, rad: the rule's error is then below 1e-10
BLOCK = 16384  # panels at a time
MOST_PANELS = 1e8  # 3 GB, and minutes
NEGLIGIBLE = 1e-17
_NODE, _WEIGHT = (0.5 * x for x in np.polynomial.legendre.leggauss(NODES))
_NODE = 0.5 + _NODE  # on (0, 1)
_AT_BEGIN, _AT_END = (  # values of the polynomial through the nodes at the ends of a panel
    np.array([np.prod([(x - _NODE[m]) / (_NODE[n] - _NODE[m]) for m in range(NODES) if m != n]) for n in range(NODES)])
    for x in (0.0, 1.0)
)

Extreme = tuple[Floats, Floats, Floats, Floats]  # lowest, its time, highest, its time
Signal = Callable[[Floats], Floats]  # times (nt,) -> (nt, k)


@dataclass(frozen=True)
class Panels:
    """A block of panels with what the signal is on them.

    Parameters
    ----------
    ends : (P + 1,) s.
    length : (D,) s, the different lengths.
    which : (P,) index into these.
    values : (P, nodes, k) the signal at the nodes.
    """

    ends: Floats
    length: Floats
    which: Ints
    values: Floats


def panels(times: Floats, signal: Signal, longest: float) -> tuple[Iterator[Panels], Ints]:
    """Blocks of panels no longer than ``longest`` from the first to the last of increasing ``times``.

    Also returns the index of each of these times among all ends of panels.

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
                f"asks for run.srs or run.low_pass, which would take {count:.2g} steps of {longest:.2g} s (at most "
                f"{MOST_PANELS:.0g}): the shortest pulse, the fastest mode or a stiff contact of the motion turns by "
                f"{LONGEST_TURN:g} rad in one",
                "make the pulse longer (of much shorter ones than the fastest mode's period only the area counts) or "
                "the run shorter, keep fewer modes, or leave run.srs and run.low_pass out",
            )
        )
    steps = np.maximum(np.ceil(np.diff(times) / longest), 1).astype(np.int64)
    of_times = np.concatenate([[0], np.cumsum(steps)])
    lengths = np.diff(times) / steps
    number = np.arange(steps.sum()) - np.repeat(of_times[:-1], steps)  # of a panel between two of the times
    ends = np.append(np.repeat(times[:-1], steps) + number * np.repeat(lengths, steps), times[-1])
    of_panel = np.repeat(np.arange(steps.size), steps)

    def blocks() -> Iterator[Panels]:
        for first in range(0, ends.size - 1, BLOCK):
            block, part = ends[first : first + BLOCK + 1], of_panel[first : first + BLOCK]
            length = lengths[part[0] : part[-1] + 1]
            which = part - part[0]
            nodes = (block[:-1, None] + length[which, None] * _NODE).ravel()
            yield Panels(block, length, which, signal(nodes).reshape(which.size, NODES, -1))

    return blocks(), of_times


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
        none = np.zeros(signals)
        self.extremes: Extreme = (none, none, none, none)

    def through(self, block: Panels) -> tuple[Floats, Floats]:
        """(P, k) the output at the ends of panels, and its slope."""
        values = block.values
        output = np.zeros((values.shape[0] + 1, values.shape[2]))
        direct = 2 * self.residues.real.sum()  # the signal's own part in the slope
        begin, end = (direct * np.einsum("n,pnk->pk", at, values) for at in (_AT_BEGIN, _AT_END))
        for j, (pole, residue) in enumerate(zip(self.poles, self.residues, strict=True)):
            kernel = _WEIGHT * np.exp(pole * block.length[:, None] * (1 - _NODE)) * block.length[:, None]
            added = np.matmul(kernel[block.which][:, None, :], values)[:, 0]
            factor = np.exp(pole * block.length)[block.which, None]
            first = self.state[j]
            added[0] += factor[0] * first
            z = np.vstack([first[None], recurrence(factor, added)])
            output += 2 * (residue * z).real
            slope = 2 * (residue * pole * z).real
            begin += slope[:-1]
            end += slope[1:]
            self.state[j] = z[-1]
        low, low_time, high, high_time = self.extremes
        self.extremes = (
            *lower(block.ends, output, begin, end, low, low_time),
            *higher(block.ends, output, begin, end, high, high_time),
        )
        return output[1:], end


def recurrence(factor: Complexes, added: Complexes) -> Complexes:
    """``z_i = factor_i z_(i-1) + added_i`` from zero, (P, k), by doubling."""
    z, reach, step = added.copy(), factor.copy(), 1
    while step < z.shape[0] and np.abs(reach).max() > NEGLIGIBLE:
        z[step:] += reach[step:] * z[:-step].copy()
        reach[step:] *= reach[:-step].copy()
        reach[:step] = 0.0
        step *= 2
    return z


def cubic_factors(left: Floats, right: Floats, begin: Floats, end: Floats) -> tuple[Floats, Floats]:
    """Factors of the square and of the cube of the place in cubics on panels of length one.

    Parameters
    ----------
    left, right : values at the ends of the panels.
    begin, end : slopes there.
    """
    rise = right - left
    return 3.0 * rise - 2.0 * begin - end, begin + end - 2.0 * rise


def lower(ends: Floats, y: Floats, begin: Floats, end: Floats, lowest: Floats, when: Floats) -> tuple[Floats, Floats]:
    """As `higher`, for the lowest values."""
    value, at = higher(ends, -y, -begin, -end, -lowest, when)
    return -value, at


def higher(ends: Floats, y: Floats, begin: Floats, end: Floats, highest: Floats, when: Floats) -> tuple[Floats, Floats]:
    """The highest values (k,) so far and their times.

    The curves have values (P + 1, k) at the ends of panels, and slopes (P, k) at the beginning and the end of each.
    """
    h = np.diff(ends)[:, None]
    a, b = h * begin, h * end
    inside = (a > 0) & (b < 0)  # it begins rising and ends falling, so that it has its maximum inside
    c2, c3 = cubic_factors(y[:-1], y[1:], a, b)
    root = np.sqrt(np.where(inside, c2**2 - 3 * a * c3, 1.0))
    inside &= root > c2  # else both underflow
    s = np.where(inside, a / np.where(inside, root - c2, 1.0), 0.0)
    tops = y[:-1] + s * (a + s * (c2 + s * c3))
    top, at = np.vstack([tops, y[-1]]), np.vstack([ends[:-1, None] + s * h, np.full(y.shape[1], ends[-1])])
    best, column = top.argmax(axis=0), np.arange(y.shape[1])
    better = top[best, column] > highest
    return np.where(better, top[best, column], highest), np.where(better, at[best, column], when)
