"""Two masses with an elastic stop, a benchmark of the field, from arrays: response curve and special points."""

import numpy as np

import beamsim

stiffness = np.array([[1.0, -1.0], [-1.0, 2.0]])  # N/m
stop = beamsim.Contact(row=[1.0, 0.0], law=100.0, gap=1.0, name="stop")  # acts where u1 > 1 m, with 100 N/m
system = beamsim.System(np.eye(2), stiffness, damping=0.03 * stiffness, contacts=[stop], loads={"shaker": [0.0, 1.0]})

curve = beamsim.continue_motion(system, (0.55 / (2 * np.pi), 0.7 / (2 * np.pi)), {"shaker": {"level": 0.1}})
points = curve["points"]
main = points["branch"].values == points["branch"].values[0]
peak = points["peak_displacement"].sel(probe="q1").values[main]
print(f"largest displacement of the first mass {peak.max():.4f} m")
for point in curve.summary["special_points"]:
    print(f"{point['kind'].replace('_', ' ')} at {2 * np.pi * point['frequency_hz']:.6f} rad/s")

sine = {"shaker": {"kind": "harmonic", "level": 0.1, "frequency": 0.65 / (2 * np.pi)}}
motion = beamsim.simulate(system, 300.0, sine, sample_rate=10.0)
print(f"peak force {motion.summary['peak_force_n']['stop']:.3f} N after {motion.summary['contacts']['stop']} contacts")
