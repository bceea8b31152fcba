"""What belongs to one period of a motion, whatever carries it: the order of its events, extremes, and integrals.

Extremes are those of the search in :mod:`beamsim.flow.extrema`, integrals those of Gauss-Legendre rules on panels
between events.
"""

from __future__ import annotations

from collections.abc import Callable, Collection

import numpy as np
from numpy.polynomial import chebyshev

from beamsim.flow.exact import ExactFlow
from beamsim.flow.extrema import NODES, Extrema, polynomials, search_extrema
from beamsim.flow.periodic_flow import FlowMap, PeriodicFlow
from beamsim.flow.variational import VariationalFlow
from beamsim.typing import Floats, Ints

PIECES = 64  # of a period, on each of which a power series is a polynomial


def phases_of_contacts(flow_map: FlowMap, excluded: Collection[int] = ()) -> dict[int, tuple[int, ...]]:
    """New phases of each contact in the order of its events, some contacts left out.

    Events of different contacts have no order here: of those at one time, as in equal parts of a structure that nothing
    couples, it is round-off that decides on the order, and it changes where such times cross.
    """
    phases: dict[int, list[int]] = {}
    for contact, phase in flow_map.signature:
        if contact not in excluded:
            phases.setdefault(contact, []).append(phase)
    return {contact: tuple(of) for contact, of in sorted(phases.items())}


def cyclic(flow_map: FlowMap, excluded: Collection[int] = ()) -> dict[int, tuple[int, ...]]:
    """The same over a period, whatever event of a contact comes first."""
    phases = phases_of_contacts(flow_map, excluded)
    return {contact: min(s[i:] + s[:i] for i in range(len(s))) for contact, s in phases.items()}


def extrema_of(
    flow: PeriodicFlow,
    flow_map: FlowMap,
    rows: Callable[[ExactFlow], Floats],
    values: Callable[[Floats, Floats], Floats],
    edges: Floats,
    squares: Ints | None = None,
) -> Extrema:
    """Extremes of K outputs between each two of some times of a motion.

    Parameters
    ----------
    flow, flow_map : the motion.
    rows : (K, V) the outputs of a flow in closed form, whose extremes are certified.
    values : the same (nt, K) at times (nt,) of states (nt, N), of power series: those are searched on polynomials.
    edges : (W + 1,) s, increasing.
    squares : first of each group of outputs, of whose squares half the sum is meant.

    Returns
    -------
    Smallest and largest values (W, K) and their times.
    """
    if isinstance(flow, VariationalFlow):
        output = rows(flow.exact)
        return flow.motion(flow_map).extrema(lambda _: output, edges, squares=squares)
    return polynomial_extrema(
        lambda times, _: values(times, flow.states_at(flow_map, times)), edges, flow_map.event_time, squares=squares
    )


def polynomial_extrema(
    values: Callable[[Floats, Floats], Floats],
    edges: Floats,
    event_times: Floats,
    pieces: int = PIECES,
    squares: Ints | None = None,
) -> Extrema:
    """Extremes of K outputs that are smooth, and so polynomials on short pieces, between events.

    Parameters
    ----------
    values : the outputs (nt, K) at times (nt,), s, that do not decrease; with each comes a time inside its piece.
    edges : (W + 1,) s, increasing, between each two of which the extremes are asked for.
    event_times : s, of the events.
    pieces : least number.
    squares : as of `extrema_of`.

    Returns
    -------
    Smallest and largest values (W, K) and their times.
    """
    ends = np.unique(np.concatenate([edges, np.linspace(edges[0], edges[-1], pieces + 1), event_times]))
    length = np.diff(ends)
    times = ends[:-1, None] + 0.5 * length[:, None] * (1.0 + chebyshev.chebpts2(NODES + 1))
    at_points = values(times.ravel(), np.repeat(ends[:-1] + 0.5 * length, NODES + 1))
    window = np.searchsorted(edges, ends[:-1], side="right") - 1
    sums = polynomials(at_points.reshape(*times.shape, -1), ends[:-1], length, window)
    return search_extrema(sums, at_points.shape[1], edges.size - 1, squares)


def gauss_panels(edges: Floats, fastest: float) -> tuple[Floats, Floats]:
    """Nodes and weights (N,) of a rule for a function that is smooth between edges.

    Parameters
    ----------
    edges : (G + 1,) increasing, s.
    fastest : rad/s, of the motion that the function is a product of.

    Returns
    -------
    Nodes in increasing order, and the weights that belong to them, s.
    """
    # 20: of a panel
    node, weight = np.polynomial.legendre.leggauss(20)
    # 15.0: rad, of the fastest motion on a panel: the error of a power is then below 1e-12
    parts = np.maximum(np.ceil(np.diff(edges) * fastest / 15.0), 1).astype(np.int64)
    half = np.repeat(0.5 * np.diff(edges) / parts, parts)
    number = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
    middle = np.repeat(edges[:-1], parts) + half * (2 * number + 1)
    return (middle[:, None] + half[:, None] * node).ravel(), (half[:, None] * weight).ravel()
