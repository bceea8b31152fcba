"""The response curve of two masses and a stop with its special points, and the Floquet multipliers of its motions."""

from pathlib import Path

import numpy as np

import beamsim

CONFIGS = Path(__file__).parents[1] / "configs"

case = beamsim.load_scenario(CONFIGS / "continuation" / "chain_two_dof.yaml", {"sweep.to": "0.7 rad/s"})
result = beamsim.continuation(case)
points = result["points"]
multipliers = points["floquet_multipliers_real"].values + 1j * points["floquet_multipliers_imag"].values
largest = np.abs(multipliers).max(axis=1)  # a motion is stable where all multipliers lie within the unit circle
omega = 2 * np.pi * points["frequency_hz"].values
peak = points["peak_displacement"].sel(probe="first").values
main = np.flatnonzero(points["branch"].values == points["branch"].values[0])
for i in main[:: len(main) // 10]:
    stability = "stable" if largest[i] < 1 else "unstable"
    print(f"{omega[i]:.4f} rad/s  peak {peak[i]:.4f} m  largest multiplier {largest[i]:.4f}  {stability}")
for point in result.summary["special_points"]:
    kind = point["kind"].replace("_", " ")
    print(f"{kind} at {2 * np.pi * point['frequency_hz']:.6f} rad/s, period {point['period_multiple']}")
