"""A channel of one's own: the bending moment at the root from the model, and power made from two histories."""

from pathlib import Path

import numpy as np

import beamsim

CONFIGS = Path(__file__).parents[1] / "configs"

outputs = [{"name": "root", "kind": "bending_moment", "at": {"position": 0.0}}]
result = beamsim.run(beamsim.load_scenario(CONFIGS / "one_sided_65hz.yaml", {"outputs": outputs}))
histories = result["histories"]
moment = histories["output_value"].sel(output="root").values  # N m
print(f"largest moment at the root {np.abs(moment).max():.4g} N m, in the samples")
print(f"largest moment at the root {result.summary['peak_output']['root']:.4g} N m, between samples too")

# the snubber pushes upwards: the power that it gives to the tip
force = histories["snubber_force"].sel(snubber="tip").values  # N
power = force * histories["snubber_velocity"].sel(snubber="tip").values  # W
work = np.trapezoid(power, histories["time"].values)
print(f"work of the snubber on the beam {work:.4g} J: its dashpot takes energy")
