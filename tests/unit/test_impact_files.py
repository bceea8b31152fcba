"""Impacts in result files and pictures."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from shipped import config_path

import beamsim
from beamsim.plots.run import cycles, impact_map, plot_peak_forces
from beamsim.scenario import load_scenario


@pytest.fixture(scope="module")
def result():
    overrides = ["run.impacts={}", "run.duration=0.5", "run.spectrum.periods=7", "run.convergence=off"]
    return beamsim.run(load_scenario(config_path("chain_bumpers"), overrides))


def test_every_impact_is_in_the_pictures(result):
    impacts, histogram = result["impacts"], Figure().subplots()
    by_snubber = impacts.groups("snubber", result["histories"].labels("snubber"))
    many = impacts["impact"].values.size
    chart = impact_map(by_snubber, many, end=40.0)
    assert chart.x_ends == pytest.approx((-0.8, 40.8))  # the run, not what lies between two impacts
    drawn = np.concatenate([np.stack([curve.x, curve.y], axis=1) for curve in chart.curves])
    both = np.stack([impacts["peak_time"].values, impacts["peak_force"].values], axis=1)
    np.testing.assert_allclose(np.sort(drawn, axis=0), np.sort(both, axis=0), rtol=1e-14)
    plot_peak_forces(by_snubber, histogram)
    assert sum(patch.get_xy()[1:-1:2, 1].sum() for patch in histogram.patches) == many
    counted = result["impact_statistics"].groups("cycle_snubber")
    curves = cycles(counted, "Force range", "N", "snubbers").curves
    for curve, rainflow in zip(curves, counted.values(), strict=True):
        assert curve.x[-1] == rainflow["count"].values.sum()
        assert np.all(np.diff(curve.y) <= 0.0)
    assert {"impact_map", "impact_histogram"} <= set(result.plot())
