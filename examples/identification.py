"""The stiffness of a stop from natural frequencies that were measured with and without it, with its interval."""

from pathlib import Path

import beamsim

CONFIGS = Path(__file__).parents[1] / "configs"

case = beamsim.load_scenario(
    CONFIGS / "one_sided_65hz.yaml",
    {
        "identify_stiffness": {
            "snubber": "tip",
            "measured_without": ["51.9 Hz", "329.4 Hz", "934.4 Hz"],
            "measured_with": ["196.5 Hz", "448 Hz", "969.5 Hz"],  # the contact stays closed
            "fit_to": [1],
            "uncertainty": "0.3 %",  # standard deviation of a measured frequency
        }
    },
)
result = beamsim.identify_stiffness(case)
summary = result.summary
low, high = (1e-3 * end for end in summary["interval_n_per_m"])
print(f"stiffness {1e-3 * summary['stiffness_n_per_m']:.4g} kN/m, with 95 % confidence {low:.4g} to {high:.4g} kN/m")
for number, difference in enumerate(summary["difference_with_percent"], start=1):
    print(f"mode {number} with the stop: computed {difference:+.2f} % off the measured frequency")
