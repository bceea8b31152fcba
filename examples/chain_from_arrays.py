"""A chain of masses from NumPy arrays with a stop between two of them, and its modes with the stop open and closed."""

import numpy as np

import beamsim

masses = np.linspace(1.0, 2.0, 6)  # kg
springs = np.append(np.full(6, 4e4), 0.0)  # N/m: from the wall to mass 1, ..., none behind mass 6
case = beamsim.load_scenario(
    {
        "chain": {
            "masses": masses,
            "springs": springs,
            "damping": {"kind": "modal", "ratio": 0.02},
            "snubbers": [{"name": "bumper", "between": [3, 4], "stiffness": 2e5, "gap": 1e-3}],
        },
        "excitation": {"kind": "harmonic", "applied_to": "base", "level": 5.0, "frequency": 6.0},  # m/s^2, Hz
        "run": {"duration": 2.0, "sample_rate": 1000.0},
    }
)
result = beamsim.run(case)
modes = result["modes"]
for number, (free, closed) in enumerate(
    zip(modes["open_frequencies_hz"].values, modes["closed_frequencies_hz"].values, strict=True), start=1
):
    print(f"mode {number}: {free:.4g} Hz open, {closed:.4g} Hz closed")
print(f"peak force of the bumper {result.summary['peak_force_n']['bumper']:.4g} N")
