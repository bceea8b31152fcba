"""Extremes over a periodic motion, whatever carries it: the search of :mod:`beamsim.flow.extrema`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.polynomial import chebyshev

from beamsim.flow.contact_state import LinearOutput
from beamsim.flow.dense_extremes import NODES, polynomials
from beamsim.flow.exact import ExactFlow
from beamsim.flow.extrema import Extrema, Search
from beamsim.flow.passage import Passage
from beamsim.flow.periodic_flow import PeriodicFlow
from beamsim.flow.variational import VariationalFlow
from beamsim.typing import Floats, Ints

PIECES = 64  # of a period, on each of which a power series is a polynomial


def extrema_of(
    flow: PeriodicFlow,
    passage: Passage,
    rows: Callable[[ExactFlow], LinearOutput],
    values: Callable[[Floats, Floats], Floats],
    edges: Floats,
    squares: Ints | None = None,
) -> Extrema:
    """Extremes of K outputs between each two of some times of a passage.

    Parameters
    ----------
    flow, passage : the motion.
    rows : the outputs of a flow in closed form, whose extremes are certified.
    values : the same (nt, K) at times (nt,) of states (nt, N), of power series: those are searched on polynomials.
    edges : (W + 1,) s, increasing.
    squares : first of each group of outputs, of whose squares half the sum is meant.

    Returns
    -------
    Smallest and largest values (W, K) and their times.
    """
    if isinstance(flow, VariationalFlow):
        output = rows(flow.exact)
        return flow.motion(passage).extrema(lambda _: output, edges, squares=squares)
    return polynomial_extrema(
        lambda times, _: values(times, flow.states_at(passage, times)), edges, passage.event_time, squares=squares
    )


def polynomial_extrema(
    values: Callable[[Floats, Floats], Floats],
    edges: Floats,
    breaks: Floats,
    pieces: int = PIECES,
    squares: Ints | None = None,
) -> Extrema:
    """Extremes of K outputs that are smooth, and so polynomials on short pieces, between events.

    Parameters
    ----------
    values : the outputs (nt, K) at times (nt,), s, that do not decrease; with each comes a time inside its piece.
    edges : (W + 1,) s, increasing, between each two of which the extremes are asked for.
    breaks : s, of the events.
    pieces : least number.
    squares : as of `extrema_of`.

    Returns
    -------
    Smallest and largest values (W, K) and their times.
    """
    ends = np.unique(np.concatenate([edges, np.linspace(edges[0], edges[-1], pieces + 1), breaks]))
    length = np.diff(ends)
    times = ends[:-1, None] + 0.5 * length[:, None] * (1.0 + chebyshev.chebpts2(NODES + 1))
    at_points = values(times.ravel(), np.repeat(ends[:-1] + 0.5 * length, NODES + 1))
    waves = polynomials(at_points.reshape(*times.shape, -1), ends[:-1], length)
    search = Search.of(at_points.shape[1], edges.size - 1, squares=squares)
    search.add([replace(waves, window=np.searchsorted(edges, ends[:-1], side="right") - 1)])
    return search.extrema()
