"""A stored result in xarray: histories by name, a mean over time, and a table of contact events in pandas."""

from pathlib import Path

import xarray

import beamsim

CONFIGS = Path(__file__).parents[1] / "configs"

result = beamsim.run(beamsim.load_scenario(CONFIGS / "one_sided_65hz.yaml"))
beamsim.write_result(result, "one_sided.h5")
with xarray.open_datatree("one_sided.h5", engine="h5netcdf") as tree:
    displacement = tree["histories"].displacement
    late = displacement.sel(probe="tip").where(tree["histories"].time > 0.4, drop=True)
    mean, unit = float(late.mean()), displacement.units
    events = tree["events"].to_dataset().to_dataframe()
print(displacement)
print(f"mean of the tip after 0.4 s: {mean:.4g} {unit}")
print(events.head())
