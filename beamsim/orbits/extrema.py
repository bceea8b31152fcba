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
    pieces = np.unique(np.concatenate([edges, np.linspace(0.0, passage.duration, PIECES + 1), passage.event_time]))
    length = np.diff(pieces)
    times = pieces[:-1, None] + 0.5 * length[:, None] * (1.0 + chebyshev.chebpts2(NODES + 1))
    at_points = values(times.ravel(), flow.states_at(passage, times.ravel()))
    waves = polynomials(at_points.reshape(*times.shape, -1), pieces[:-1], length)
    search = Search.of(at_points.shape[1], edges.size - 1, squares=squares)
    search.add([replace(waves, window=np.searchsorted(edges, pieces[:-1], side="right") - 1)])
    return search.extrema()
