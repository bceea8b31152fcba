"""What an accelerometer reads whose signal passes a filter.

The filter is a Butterworth low-pass of four poles, -3 dB at its frequency, causal, and zero before the run:
``H(s) = Omega^4 / prod(s - p_j)`` with ``p_j = Omega exp(i pi (2 j + 3) / 8)``, ``j = 1 ... 4``. Its output is a sum
of ``r_j z_j`` with ``z_j' = p_j z_j + a(t)``. Over a panel of length h, ``z_j`` is exact up to the integral of
``exp(p_j (h - t)) a(t)``, which a Gauss-Legendre rule takes: panels end at contact events, so that the acceleration is
smooth on each, and are short against the fastest motion.
"""

from __future__ import annotations

import numpy as np

from beamsim.analyses.run.outputs import OutputOf
from beamsim.flow.trajectory import Trajectory
from beamsim.typing import Complexes, Floats

POLES = 4
NODES = 8
LONGEST_TURN = 4.0  # of the fastest motion on a panel, rad: the rule's error is then below 1e-10
PANELS_A_PERIOD = 32  # of the filter's frequency, so that a peak is found between panels
BLOCK = 16384  # panels at a time
NEGLIGIBLE = 1e-17

Extreme = tuple[Floats, Floats, Floats, Floats]  # lowest, its time, highest, its time


def filtered(trajectory: Trajectory, output_of: OutputOf, frequency_hz: float, times: Floats) -> tuple[Floats, Extreme]:
    """Outputs of a motion through the filter: (nt, k) at increasing ``times``, and the extremes of the whole motion."""
    flow = trajectory.flow
    fastest = flow.largest_exponent
    longest = min(LONGEST_TURN / fastest if fastest > 0 else np.inf, 1.0 / (PANELS_A_PERIOD * frequency_hz))
    known = np.unique(np.concatenate([trajectory.time, times[times <= trajectory.end], [trajectory.end]]))
    ends = _subdivided(known, longest)
    node, weight = np.polynomial.legendre.leggauss(NODES)
    node, weight = 0.5 * (1 + node), 0.5 * weight

    state: Complexes | None = None
    parts = []
    for first in range(0, ends.size - 1, BLOCK):
        block = ends[first : first + BLOCK + 1]
        length = np.diff(block)
        at = block[:-1, None] + length[:, None] * node
        values = trajectory.sample(at.ravel(), output_of).reshape(length.size, NODES, -1)
        output, state = _through(values, length, node, weight, frequency_hz, state)
        parts.append(output)
    history = np.vstack([np.zeros((1, parts[0].shape[1])), *parts])
    return history[np.searchsorted(ends, times)], _extremes(ends, history)


def filtered_samples(times: Floats, values: Floats, frequency_hz: float) -> tuple[Floats, Extreme]:
    """The same of samples (nt, k), straight lines between them."""
    node, weight = np.polynomial.legendre.leggauss(NODES)
    node, weight = 0.5 * (1 + node), 0.5 * weight
    between = values[:-1, None, :] + np.diff(values, axis=0)[:, None, :] * node[:, None]
    output, _ = _through(between, np.diff(times), node, weight, frequency_hz, None)
    history = np.vstack([np.zeros((1, values.shape[1])), output])
    return history, _extremes(times, history)


def _poles(frequency_hz: float) -> tuple[Complexes, Complexes]:
    """Poles with a positive imaginary part, rad/s, and their residues; the others are their conjugates."""
    omega = 2 * np.pi * frequency_hz
    poles = omega * np.exp(1j * np.pi * (2 * np.arange(1, POLES + 1) + POLES - 1) / (2 * POLES))
    others = poles[:, None] - poles + np.eye(POLES)
    residues = omega**POLES / others.prod(axis=1)
    upper = poles.imag > 0
    return poles[upper], residues[upper]


def _subdivided(known: Floats, longest: float) -> Floats:
    """Times with further ones between them, so that no step is longer."""
    steps = np.maximum(np.ceil(np.diff(known) / longest), 1).astype(np.int64)
    start = np.repeat(known[:-1], steps)
    number = np.arange(steps.sum()) - np.repeat(np.cumsum(steps) - steps, steps)
    return np.append(start + number * np.repeat(np.diff(known) / steps, steps), known[-1])


def _through(
    values: Floats, length: Floats, node: Floats, weight: Floats, frequency_hz: float, state: Complexes | None
) -> tuple[Floats, Complexes]:
    """Output (P, k) at the ends of panels from values (P, nodes, k) inside, and the filter's state (poles, k) there."""
    poles, residues = _poles(frequency_hz)
    output = np.zeros((values.shape[0], values.shape[2]))
    final = np.zeros((poles.size, values.shape[2]), dtype=np.complex128)
    for j, (pole, residue) in enumerate(zip(poles, residues, strict=True)):
        kernel = weight * np.exp(pole * length[:, None] * (1 - node)) * length[:, None]
        added = np.einsum("pn,pnk->pk", kernel, values)
        factor = np.exp(pole * length)[:, None]
        if state is not None:
            added[0] += factor[0] * state[j]
        z = _recurrence(factor, added)
        output += 2 * (residue * z).real
        final[j] = z[-1]
    return output, final


def _recurrence(factor: Complexes, added: Complexes) -> Complexes:
    """``z_i = factor_i z_(i-1) + added_i`` from zero, (P, k), by doubling."""
    z, reach, step = added.copy(), factor.copy(), 1
    while step < z.shape[0] and np.abs(reach).max() > NEGLIGIBLE:
        z[step:] += reach[step:] * z[:-step].copy()
        reach[step:] *= reach[:-step].copy()
        reach[:step] = 0.0
        step *= 2
    return z


def _extremes(times: Floats, history: Floats) -> Extreme:
    """Extremes of curves (nt, k): of the parabola through the lowest or highest point and its neighbours."""
    highest, when = _highest(times, history)
    lowest, when_low = _highest(times, -history)
    return -lowest, when_low, highest, when


def _highest(times: Floats, history: Floats) -> tuple[Floats, Floats]:
    at = history.argmax(axis=0)
    highest, when = history[at, np.arange(history.shape[1])].copy(), times[at].copy()
    for k in np.flatnonzero((at > 0) & (at < times.size - 1)):
        t, y = times[at[k] - 1 : at[k] + 2] - times[at[k]], history[at[k] - 1 : at[k] + 2, k]
        bend, slope, top = np.polyfit(t / t[2], y, 2)
        if bend < 0:
            highest[k], when[k] = top - slope**2 / (4 * bend), times[at[k]] - t[2] * slope / (2 * bend)
    return highest, when
