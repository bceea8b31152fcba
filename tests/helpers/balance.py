"""Energies of a motion in closed form, and their balance."""

from typing import NamedTuple

import numpy as np

from beamsim.responses.energies import EnergyBalance, EnergyHistory, energies_of_segments, sampled_energies


class Balance(NamedTuple):
    """Energies, and the largest imbalance relative to them."""

    history: EnergyHistory
    error: float


def energy_history(trajectory, times):
    """At some times."""
    with np.errstate(over="ignore", invalid="ignore"):
        return _balance(*sampled_energies(trajectory, times))


def energy_of_segments(trajectory):
    """At the ends of segments."""
    return _balance(*energies_of_segments(trajectory))


def _balance(times, history, exchanged):
    balance = EnergyBalance()
    balance.add(times, history, exchanged)
    return Balance(history, balance.error)
