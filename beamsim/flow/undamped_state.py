"""The tables of an undamped contact state in a few array operations.

Paths in the contacts' stiffness ask for a new closed state at every step of Newton's method; where nothing damps and
every mode is elastic, its tables are written down from one symmetric eigenvalue problem, ten times as fast as by
:func:`beamsim.flow.contact_state.build_state`, which serves all other cases and gives the same tables.
"""

from __future__ import annotations

import numpy as np

from beamsim.flow.contact_state import RESONANCE, ContactState, state_matrices
from beamsim.system.equations import PiecewiseLinearSystem
from beamsim.typing import Ints


def undamped_state(system: PiecewiseLinearSystem, phases: Ints, longest_window: float) -> ContactState | None:
    """The state with the contacts in given phases, under constant loads alone; None where the general form is needed.

    ``q = V (K_modal^-1 V^T f + Re sum_j 2 z_j e^{i w_j tau})`` with ``z = (V^T q - i V^T q' / w) / 2`` of the motion
    less its static part.
    """
    c, n = system.contacts, system.size
    if system.damping.any() or c.damped or not system.stiffness.all():
        return None
    row, _ = c.force_rows(phases)
    stiffness, _ = state_matrices(system, phases)
    if row[:, 0].any():
        squares, V = np.linalg.eigh(stiffness)
    else:
        squares, V = system.stiffness, np.eye(n)
    if squares.min() <= 0.0:
        return None
    w = np.sqrt(squares)
    if w.min() * longest_window < RESONANCE:
        return None
    load = system.constant_load - (c.gap * c.sign * row[:, 0]) @ c.shape + (c.sign * row[:, 2]) @ c.shape
    vectors = np.zeros((1 + n, 2 * n), dtype=complex)
    vectors[0, :n] = V @ ((V.T @ load) / squares)
    vectors[1:, :n], vectors[1:, n:] = 2.0 * V.T, (2j * w)[:, None] * V.T
    projector = np.empty((n, 2 * n), dtype=complex)
    projector[:, :n], projector[:, n:] = 0.5 * V.T, (-0.5j / w)[:, None] * V.T
    return ContactState(
        phases=phases.copy(),
        internal_states=0,
        exponent=np.append(0j, 1j * w),
        power=np.zeros(1 + n, dtype=np.int64),
        projector=projector,
        term_basis=np.arange(1 + n),
        term_source=np.arange(1 + n),
        term_vector=vectors,
        horizon=longest_window,
        simple_count=n,
        blocks=[],
        basis_of_source=np.zeros(1, dtype=np.int64),
        basis_below_source=np.full(1, -1),
    )  # fmt: skip
