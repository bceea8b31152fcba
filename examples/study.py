"""Tolerances of a stop: the peak force for random draws of its gap and stiffness, and how it follows each."""

from pathlib import Path

import numpy as np

import beamsim

CONFIGS = Path(__file__).parents[1] / "configs"

rng = np.random.default_rng(1)
draws = {
    "snubbers.tip.gap": rng.uniform(0.0, 0.1e-3, 60),  # m
    "snubbers.tip.stiffness": rng.normal(151e3, 8e3, 60),  # N/m
}
case = beamsim.load_scenario(CONFIGS / "one_sided_65hz.yaml", {"reduction": {"modes": 6}})
result = beamsim.ensemble(case, draws, ["peak_force"])
table = result.table
force = np.array(table["snubbers/tip/peak_force"])
print(f"peak force {force.mean():.3g} N, standard deviation {force.std(ddof=1):.2g} N, largest {force.max():.3g} N")
for name, values in draws.items():
    print(f"correlation with {name}: {np.corrcoef(values, force)[0, 1]:+.2f}")
