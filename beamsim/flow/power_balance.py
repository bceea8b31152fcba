"""The rate at which a motion violates its energy balance.

With the stored energy E, dissipated power and power in,

.. math:: r = \\frac{dE}{dt} + P_\\mathrm{dissipated} - P_\\mathrm{in}
            = \\nabla E(z)^T y' + z^T F z, \\qquad z = (y, u, u', 1),

is zero for the time derivative y' of an exact motion y under the inputs u. Energies and powers are taken from the
structure and the laws of its contacts, not from the equations of motion that were solved. Relative frame; what the
motion of the base does to the structure through contacts on the ground counts as power in.
"""

from __future__ import annotations

import numpy as np

from beamsim.flow.contact_state import LinearOutput
from beamsim.flow.exact import ExactFlow
from beamsim.typing import Floats, Ints


def power_balance(flow: ExactFlow, phases: Ints) -> tuple[Floats, Floats]:
    """The gradient of E by the state, (N, Z) times z, and the form F (Z, Z), written as an upper triangle, with the
    contacts in given phases.

    Parameters
    ----------
    flow : with a constant source, and one source for each of the L inputs; Z = N + 2 L + 1.
    """
    system, contacts, n, N = flow.system, flow.system.contacts, flow.system.size, flow.size
    delta, rate = (_rows(output) for output in flow.penetrations)
    inputs, state = flow.sources.count - 1, np.eye(N, delta.shape[1])
    velocity = state[n : 2 * n]
    factor, by_internal = contacts.force_rows(phases)
    dashpot, internal = contacts.losses(phases)
    elastic = factor[:, :1] * delta + by_internal @ state[2 * n :]
    friction = contacts.friction(phases)
    elastic[:, -1] += factor[:, 2] - friction

    gradient = np.zeros_like(state)
    gradient[:n] = system.stiffness[:, None] * state[:n] - (contacts.sign[:, None] * contacts.shape).T @ elastic
    gradient[n : 2 * n] = velocity
    form = velocity.T @ system.damping @ velocity + (rate.T * dashpot) @ rate
    form[:, -1] += rate.T @ friction
    if internal.size:
        by_states, constant = contacts.energy_slopes(phases)
        gradient[2 * n :] = by_internal.T @ delta + by_states @ state[2 * n :]
        gradient[2 * n :, -1] += constant
        moved = _rows(flow.internal_rates(phases))
        form += (moved.T * internal) @ moved
    load = np.zeros_like(velocity)
    load[:, -1] = system.constant_load
    for source in range(1, inputs + 1):
        channel = flow.sources.channel[source]
        if channel < flow.forcing.load.shape[0]:
            load[:, N + source - 1] = flow.forcing.load[channel]
    form -= velocity.T @ load
    lost = dashpot[:, None] * rate  # (m, Z) parts of the contacts' forces whose work is lost
    lost[:, -1] += friction
    if contacts.presses(phases):
        of_pressed, stretch = contacts.pressing_factors(phases), contacts.pressing_stretches(phases)[:, None]
        normal, rising = _rows(flow.pressing_forces(phases)), _rows(flow.pressing_force_rates(phases))
        rubbing = of_pressed[:, None] * normal
        lost[contacts.pressed] += rubbing
        strained = stretch * rubbing  # E grows with it times the force's change
        gradient += normal[:, :N].T @ strained
        form += rubbing.T @ (rate[contacts.pressed] - stretch * rising)
        by_inputs = np.zeros_like(normal)
        by_inputs[:, N + inputs : N + 2 * inputs] = normal[:, N : N + inputs]
        form += strained.T @ by_inputs
    if flow.base_channel >= 0:  # contacts on the ground: power in, and the change of E by the base's motion alone
        moving = np.zeros_like(delta)
        of_base = int(np.flatnonzero(flow.sources.channel == flow.base_channel)[0])
        moving[:, N + inputs + of_base - 1] = contacts.felt
        form += (contacts.sign[:, None] * lost).T @ moving
    return gradient, np.triu(form + form.T) - np.diag(np.diag(form))


def _rows(output: LinearOutput) -> Floats:
    """(k, Z) an output as a function of z."""
    return np.hstack([output.row, output.direct[:, 1:], output.direct_slope[:, 1:], output.direct[:, :1]])
