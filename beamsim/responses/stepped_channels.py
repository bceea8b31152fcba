"""Channels of motions whose states are known at discrete times, from time stepping or harmonic balance."""

from __future__ import annotations

from beamsim.flow.channels import outputs_of
from beamsim.flow.exact import ExactFlow
from beamsim.system.equations import ChannelSet
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats, Ints


class SteppedChannels:
    """Channels evaluated from states, cubic springs included.

    Parameters
    ----------
    system : of the channels.
    flow : of the system.
    channels : C columns of values.
    """

    def __init__(self, system: StructuralSystem, flow: ExactFlow, channels: ChannelSet) -> None:
        self.channels, self._system, self._flow = channels, system, flow
        self._output_of = outputs_of(flow, channels.rows)

    def of_states(self, times: Floats, y: Floats, phases: Ints, piece_time: float | None = None) -> Floats:
        """Values of the channels at times with known states.

        Parameters
        ----------
        times : (nt,) s.
        y : (nt, N) states then.
        phases : (nt, m) of the contacts.
        piece_time : s, time that selects the piece of the inputs; by default each of ``times``.

        Returns
        -------
        (nt, C).
        """
        known = self._flow.outputs_of_states(times, y, phases, self._output_of, piece_time)
        return self.channels.values(known + self._additional_values(self.channels.rows, times, y))

    def _additional_values(self, rows: Floats, times: Floats, y: Floats) -> Floats | float:
        """(nt, k) contributions of cubic springs, which the flow leaves out."""
        cubic, of = self._system.cubic, self.channels.sizes.part
        if cubic is None:
            return 0.0
        forcing = self._flow.forcing
        pull = cubic.stiffness * cubic.extension(y[:, : self._system.dynamics.size], forcing.base_at(times)) ** 3
        return pull @ (of(rows, "cubic") - of(rows, "acceleration") @ cubic.shape.T).T
