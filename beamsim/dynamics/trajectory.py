"""A computed motion: what happened between the events, from which every output follows exactly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from beamsim.dynamics.contact_state import LinearOutput
    from beamsim.dynamics.transient import ExactFlow

__all__ = ["Trajectory"]

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]

PEAK_TOLERANCE = 1e-10  # relative distance within which two peaks of an output are not told apart
QUADRATURE_POINTS = 8
QUADRATURE_RADIANS = 2.0  # of the fastest motion present, per panel


@dataclass(frozen=True)
class Trajectory:
    """Segments of closed-form motion in order of time."""

    flow: ExactFlow
    end: float  # s, reached
    time: Floats  # (S,) start of each segment, s
    length: Floats  # (S,) s
    state: Ints  # (S,) contact state
    piece: Ints  # (S,) of the sources
    y: Floats  # (S, 2n) at the start
    face: Floats  # (S, m) compression of the faces at the start, m
    event_time: Floats  # (E,) s
    event_contact: Ints  # (E,)
    event_closing: Bools  # (E,)
    final_y: Floats  # (2n,)
    final_face: Floats  # (m,)
    evaluations: int
    status: str
    processor_time_s: float

    def _segments(self) -> tuple[Floats, Ints, Ints, Floats, Floats]:
        return self.time, self.state, self.piece, self.y, self.face

    def sample(self, times: Floats, output_of: Callable[[Bools], LinearOutput]) -> Floats:
        """Outputs (nt, k) at increasing times; at an event the state after it counts."""
        from beamsim.dynamics import kernels

        table = self.flow.output_table(output_of)
        out = np.empty((times.size, table.shape[2]))
        kernels.sample(self.flow.tables(), self.flow.inputs(), table, *self._segments(), times, out)
        return out

    def states_at(self, times: Floats) -> Floats:
        """(nt, 2n) the state (q, q')."""
        n = self.flow.system.size
        output = self.flow.empty_output(2 * n)
        output.row[:] = np.eye(2 * n)
        return self.sample(times, lambda closed: output)

    def closed_at(self, times: Floats) -> Bools:
        """(nt, m) which contacts are closed."""
        segment = np.clip(np.searchsorted(self.time, times, side="right") - 1, 0, None)
        flags = np.array([s.closed for s in self.flow.states]).reshape(len(self.flow.states), -1)
        return np.asarray(flags[self.state[segment]])

    def contact_share(self) -> Floats:
        """(m,) share of the time during which each contact is closed."""
        flags = np.array([s.closed for s in self.flow.states]).reshape(len(self.flow.states), -1)
        total = float(self.length.sum())
        return np.asarray(self.length @ flags[self.state] / total) if total > 0 else np.zeros(flags.shape[1])

    def maxima(
        self, output_of: Callable[[Bools], LinearOutput], seed: Floats, when: Floats
    ) -> tuple[Floats, Floats, int]:
        """Largest values (k,) of outputs over the whole continuous motion, with their times.

        ``seed`` and ``when`` are values that are known to be reached; the better they are, the less the work.
        The result is within 1e-10 of the true maximum, relatively: the march skips only what its
        curvature bound proves to be lower. Also returned: the number of evaluations.
        """
        from beamsim.dynamics import kernels

        highest, at = np.array(seed, dtype=float), np.array(when, dtype=float)
        evaluations = kernels.extremes(
            self.flow.tables(), self.flow.inputs(), self.flow.output_table(output_of),
            self.time, self.length, self.state, self.piece, self.y, self.face, highest, at, PEAK_TOLERANCE,
        )  # fmt: skip
        return highest, at, int(evaluations)

    def product_integrals(
        self,
        times: Floats,
        left_of: Callable[[Bools], LinearOutput],
        right_of: Callable[[Bools], LinearOutput],
        weight: Floats,
    ) -> Floats:
        """(nt, Q) integrals from 0 to ``times`` of ``sum_k weight[k, q] left_k right_k``.

        In closed form where the motion consists of pure exponentials; by Gauss-Legendre panels short against the
        fastest motion present where powers of time occur (rigid-body motion, resonance, sampled inputs).
        """
        if all(not np.any(s.power) for s in self.flow.states):
            from beamsim.dynamics import kernels

            out = np.empty((times.size, weight.shape[1]))
            kernels.pair_integrals(
                self.flow.tables(), self.flow.inputs(), self.flow.output_table(left_of),
                self.flow.output_table(right_of), np.ascontiguousarray(weight),
                self.time, self.length, self.state, self.piece, self.y, self.face, times, out,
            )  # fmt: skip
            return out
        fastest = max(float(np.abs(s.exponent).max()) for s in self.flow.states)
        cuts = np.unique(np.concatenate([times, self.time, [0.0, self.end]]))
        cuts = cuts[cuts <= self.end]
        panels = np.maximum(np.ceil(np.diff(cuts) * fastest / QUADRATURE_RADIANS).astype(int), 1)
        node, gauss = np.polynomial.legendre.leggauss(QUADRATURE_POINTS)
        total = np.zeros((cuts.size, weight.shape[1]))
        for first in range(0, panels.size, 4096):
            block = slice(first, first + 4096)
            p = panels[block]
            width = np.repeat(np.diff(cuts)[block] / p, p)
            within = np.arange(p.sum()) - np.repeat(np.cumsum(p) - p, p)
            middle = np.repeat(cuts[:-1][block], p) + (within + 0.5) * width
            t = (middle[:, None] + 0.5 * width[:, None] * node).ravel()
            value = (self.sample(t, left_of) * self.sample(t, right_of)) @ weight
            panel = (value.reshape(-1, node.size, weight.shape[1]) * (0.5 * gauss)[:, None]).sum(axis=1)
            sums = np.add.reduceat(panel * width[:, None], np.cumsum(p) - p, axis=0)
            total[first + 1 : first + 1 + p.size] = total[first] + np.cumsum(sums, axis=0)
        return np.asarray(total[np.searchsorted(cuts, np.minimum(times, self.end))])
