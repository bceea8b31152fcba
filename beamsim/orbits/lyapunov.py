"""The largest Lyapunov exponent of a motion under a sine, from two neighbouring motions of the exact flow.

After every cycle the neighbour is pulled back to its first distance; the mean logarithm of its growth, over the period,
is the exponent (G. Benettin et al., Meccanica 15, 1980). As both motions are exact, their distance may be small against
everything but round-off.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from beamsim.flow.march import Motion
from beamsim.orbits.steady import CycleStepper, velocity_weights

DISTANCE = 1e-7  # of the motion's size
BLOCKS = 8


@dataclass(frozen=True)
class Exponent:
    """The largest exponent, with the scatter of its mean over blocks of cycles."""

    value: float  # 1/s
    uncertainty: float  # 1/s, standard error of the mean
    kind: str  # "chaotic", "quasi-periodic" or "not settled"


def largest_exponent(stepper: CycleStepper, motion: Motion, cycles: int, seed: int = 0) -> Exponent:
    """Exponent over ``cycles`` cycles after as many as a quarter of them; ``motion`` is carried along.

    A motion whose exponent is clearly positive is chaotic, clearly negative not settled yet (its transient still
    decays), and quasi-periodic when it is neither.

    Parameters
    ----------
    stepper : carries motions from cycle to cycle.
    motion : where it begins; carried along.
    cycles : whose growth is averaged.
    seed : of the first neighbour.

    Returns
    -------
    The exponent with its uncertainty, 1/s.
    """
    n = stepper.flow.system.size
    omega = stepper.omega
    weight = velocity_weights(stepper.flow, omega)[: 2 * n]
    size = float(np.max(np.abs(motion.y[: 2 * n] * weight)))
    size = size if size > 0 else 1.0
    offset = np.random.default_rng(seed).normal(size=2 * n)
    offset *= DISTANCE * size / np.linalg.norm(offset)
    growth = []
    for _ in range(cycles + cycles // 4):
        neighbour = motion.copy()
        neighbour.guard = -1
        neighbour.y[: 2 * n] += offset / weight
        stepper.carry(neighbour, 1)
        stepper.carry(motion, 1)
        difference = (neighbour.y - motion.y)[: 2 * n] * weight
        distance = float(np.linalg.norm(difference))
        growth.append(np.log(max(distance, 1e-300) / (DISTANCE * size)))
        offset = difference * (DISTANCE * size / max(distance, 1e-300))
    rate = np.array(growth[cycles // 4 :]) * omega / (2 * np.pi)
    mean = float(rate.mean())
    blocks = np.array([block.mean() for block in np.array_split(rate, BLOCKS)])
    error = float(blocks.std(ddof=1) / np.sqrt(BLOCKS))
    noticeable = 1e-3 * omega / (2 * np.pi)
    if mean > max(3 * error, noticeable):
        kind = "chaotic"
    elif mean < -max(3 * error, noticeable):
        kind = "not settled"
    else:
        kind = "quasi-periodic"
    return Exponent(mean, error, kind)
