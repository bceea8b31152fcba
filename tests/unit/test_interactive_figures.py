"""Plots for plotly: the numbers of the result with units; thinned curves keep their extremes."""

import math

import numpy as np
import pytest

from beamsim.plots.drawing import Chart, Curve, HeatMap, Picture
from beamsim.plots.run import run_figures
from beamsim.report.interactive import MOST_POINTS, interactive

pytestmark = pytest.mark.quick


def test_curves_keep_data_style_and_scales():
    curves = [
        Curve("one", np.array([1.0, 10.0, 100.0]), np.array([1e-3, np.nan, 3e-3]), {"color": "#123456", "marker": "o"}),
        Curve("two & <three>", np.array([1.0]), np.array([2e-3])),
    ]
    chart = Chart(("Frequency", "Hz"), ("Displacement", "m"), curves, log="x", y_ends=(0.0, 4e-3), note="doubt")
    (described,) = interactive(Picture("", [chart]))
    one, two = described["data"]
    assert one["x"] == [1.0, 10.0, 100.0]
    assert one["y"] == [1.0, None, 3.0]
    assert (one["mode"], one["line"]["color"], one["name"]) == ("lines+markers", "#123456", "one")
    assert two["name"] == "two &amp; &lt;three>"
    assert two["mode"] == "lines"
    assert "px" in two["line"]["dash"]  # told apart without colour
    layout = described["layout"]
    assert (layout["xaxis"]["type"], layout["yaxis"]["type"]) == ("log", "linear")
    assert layout["xaxis"]["title"]["text"] == "Frequency (Hz)"
    assert layout["yaxis"]["title"]["text"] == "Displacement (mm)"
    assert layout["yaxis"]["range"] == [0.0, 4.0]
    assert layout["annotations"][0]["text"] == "doubt"


def test_maps_keep_values_and_colour_bars():
    values = np.array([[1e3, 2e3, 3e3], [4e3, 5e3, math.nan]])
    x, y = np.array([1.0, 2.0, 3.0]), np.array([0.0, 1e-3])
    panel = HeatMap(("Stiffness", "N/m"), ("Gap", "m"), ("Peak force", "N"), x, y, values, lambda ax: None)
    (heat,) = interactive(Picture("", [panel]))[0]["data"]
    assert heat["type"] == "heatmap"
    assert heat["z"] == [[1.0, 2.0, 3.0], [4.0, 5.0, None]]
    assert heat["x"] == [1.0, 2.0, 3.0]
    assert heat["y"] == [0.0, 1.0]
    assert heat["colorbar"]["title"]["text"] == "Peak force (kN)"


def test_histories_are_those_of_the_result(fabricated_run):
    result = fabricated_run()
    plots = {name: interactive(picture) for name, picture in run_figures(result).items()}
    assert {"displacement", "acceleration", "contact_force", "spectrum"} <= {name for name in plots if plots[name]}
    first = plots["displacement"][0]["data"][0]
    known = result["histories"]["displacement"].sel(probe="tip").values
    shown = np.array(first["y"], dtype=float) / 1e3
    assert first["name"] == "tip"
    assert len(shown) <= 1.05 * MOST_POINTS
    assert (shown.max(), shown.min()) == pytest.approx((known.max(), known.min()), rel=1e-5)


def test_a_loop_of_many_points_stays_a_picture():
    angle = np.linspace(0.0, 40.0 * np.pi, 2 * MOST_POINTS)
    loop = Chart(("Displacement", "m"), ("Velocity", "m/s"), [Curve("", np.sin(angle), np.cos(angle))])
    assert interactive(Picture("", [loop])) == []
    short = loop._replace(curves=[Curve("", np.sin(angle[::4]), np.cos(angle[::4]))])
    assert len(interactive(Picture("", [short]))) == 1
    assert interactive(Picture("", [short, lambda ax: None])) == []
