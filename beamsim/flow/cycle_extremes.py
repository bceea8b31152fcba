"""Largest and smallest values of outputs in very many windows, such as the cycles of a sweep."""

from __future__ import annotations

import numpy as np

from beamsim.flow.contact_state import OutputOf
from beamsim.flow.state_tables import pad
from beamsim.flow.trajectory import Trajectory
from beamsim.typing import Floats


def extremes_of_cycles(motion: Trajectory, output_of: OutputOf, edge: Floats) -> tuple[Floats, Floats]:
    """Smallest and largest values of K outputs in C windows, to 1e-10 of their range in the window before.

    Parameters
    ----------
    motion : of which no segment crosses an edge.
    output_of : the outputs by the phases of the contacts.
    edge : (C + 1,) s, increasing.

    Returns
    -------
    tuple
        (C, K) each; infinite where there is no motion.
    """
    from beamsim.flow.peak_kernels import Groups, Segments, extremes_of_windows

    flow, count = motion.flow, edge.size - 1
    table = flow.output_table(output_of)
    different = [np.unique(state.exponent, return_inverse=True) for state in flow.states]
    groups = Groups(
        np.array([exponent.size for exponent, _ in different]), pad([exponent for exponent, _ in different]),
        pad([number for _, number in different]),
    )  # fmt: skip
    window = np.clip(np.searchsorted(edge, motion.time, side="right") - 1, 0, count - 1)
    segments = Segments(motion.time, motion.length, motion.state, motion.piece, motion.y, window)
    high, low = np.full((count, table.shape[2]), -np.inf), np.full((count, table.shape[2]), np.inf)
    extremes_of_windows(flow.tables(), flow.inputs(), table, groups, segments, high, low)
    return low, high
