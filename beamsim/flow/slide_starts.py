"""Where sliding begins in a sweep under the force of another contact: what is lost at once follows that force."""

from __future__ import annotations

import numpy as np

from beamsim.flow.march import Log
from beamsim.flow.swept_sine import SweptFlow
from beamsim.typing import Floats, Ints


def pressing_where_sliding_begins(flow: SweptFlow, log: Log) -> Floats:
    """Sums over each cycle, where one of the p pressed contacts begins to slide and loses energy of its spring.

    Parameters
    ----------
    log : segments of a march through the windows that the flow has.

    Returns
    -------
    (C, 2, p) sums of the pressing force, N, and of its square, N^2.
    """
    contacts, windows = flow.system.contacts, flow.windows
    out = np.zeros((windows.cycles, 2, contacts.pressed.size))
    phases = np.array([state.phases for state in flow.bare.states])[log.state]
    begins = np.zeros((log.state.size, contacts.pressed.size), dtype=bool)
    begins[1:] = contacts.pressing_losses(phases[:-1], phases[1:]) > 0.0
    where = np.flatnonzero(begins.any(axis=1))
    if where.size:
        force = _pressing_forces(flow, log, where) * begins[where]
        np.add.at(out, windows.cycle[log.piece[where]], np.stack([force, force**2], axis=1))
    return out


def _pressing_forces(flow: SweptFlow, log: Log, where: Ints) -> Floats:
    """(n, p) forces that press contacts where some of the segments start, N; they have no dashpots."""
    windows, piece = flow.windows, log.piece[where]
    since = log.time[where] - 0.5 * windows.length[piece]
    powers = since[:, None] ** np.arange(flow.channel.shape[2])
    turn = np.exp(1j * windows.omega[piece] * since)
    channels = (turn * np.einsum("cnp,np->cn", flow.channel[:, piece], powers)).real
    inputs = np.vstack([np.ones(where.size), channels]).T
    out = np.empty((where.size, flow.system.contacts.pressed.size))
    for state in np.unique(log.state[where]):
        rows = log.state[where] == state
        force = flow.template.pressing_forces(flow.bare.states[state].phases)
        out[rows] = force.values(log.y[where][rows], inputs[rows], np.zeros_like(inputs[rows]))
    return out
