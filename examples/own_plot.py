"""A plot of one's own from a result: contact force over the deflection of the tip, coloured by time."""

from pathlib import Path

from matplotlib.figure import Figure

import beamsim

CONFIGS = Path(__file__).parents[1] / "configs"

result = beamsim.run(beamsim.load_scenario(CONFIGS / "one_sided_65hz.yaml"))
histories = result["histories"]
time = histories["time"].values
deflection = 1e3 * histories["displacement"].sel(probe="tip").values  # mm
force = histories["snubber_force"].sel(snubber="tip").values  # N

figure = Figure(figsize=(6, 4), layout="constrained")
axes = figure.add_subplot(xlabel="deflection of the tip, mm", ylabel="contact force, N")
dots = axes.scatter(deflection, force, c=time, s=2)
figure.colorbar(dots, label="time, s")
figure.savefig("force_over_deflection.png")
