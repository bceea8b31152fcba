"""Integrals over a period of motions that are known at any time: Gauss-Legendre rules on panels between events."""

from __future__ import annotations

import numpy as np

from beamsim.typing import Floats


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
