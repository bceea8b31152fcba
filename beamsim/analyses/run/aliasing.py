"""Which histories of a run have content above half the output rate, see `beamsim.signals.aliasing`."""

from __future__ import annotations

import numpy as np

from beamsim.analyses.run.motion import RunMotion
from beamsim.analyses.run.observers import Histories
from beamsim.analyses.run.spectra import spectral
from beamsim.flow.channels import Observed
from beamsim.results.values import FORCE
from beamsim.signals.aliasing import NOTABLE, share_above_half_rate, share_of_blocks
from beamsim.system.equations import ChannelSet


def aliased_in_histories(motion: RunMotion, histories: Histories) -> dict[str, float]:
    """Shares of the root mean squares that lie above half the output rate, of those that are notable.

    Of a time-stepped motion, whose values between the output times are not known, it is what lies above a quarter of
    the rate.

    Parameters
    ----------
    motion : of a run.
    histories : of it.

    Returns
    -------
    By place and quantity, ``"tip absolute_acceleration"``.
    """
    channels, time, trajectory = _channels(motion), histories.time, motion.trajectory
    if not (channels.places and time.size):
        return {}
    order = np.argsort(np.hstack([channels.places[key] for key in channels.places]))
    columns = np.hstack([histories.channels.places[key] for key in channels.places])[order]
    if trajectory is None:
        shares = share_above_half_rate(histories.values[: time.size - 1 + time.size % 2, columns], 0.5)
    else:
        first, output_of = np.searchsorted(time, trajectory.time[0]), Observed(trajectory.flow, channels).linear
        shares = share_of_blocks(
            time[first:], histories.values[first:], columns,
            lambda times: trajectory.sample(times, output_of)[:, channels.order],
        )  # fmt: skip
    names = [f"{channel.name} {channel.quantity}" for channel in channels.channels]
    return {name: float(share) for name, share in zip(names, shares, strict=True) if share > NOTABLE}


def _channels(motion: RunMotion) -> ChannelSet:
    """Those whose histories are compared, or may be."""
    keys = (*spectral(motion.system).places, ("probes", "velocity"), FORCE)
    return motion.system.channels.of_keys(*dict.fromkeys(keys))
