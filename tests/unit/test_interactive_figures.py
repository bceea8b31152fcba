"""Figures as plotly draws them: the same curves, scales and labels; thinned curves keep their extremes."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from beamsim.report.interactive import MOST_POINTS, plotly_of, thinning


def test_curves_keep_data_style_and_scales():
    figure = Figure()
    above, below = figure.subplots(2)
    above.plot([1.0, 10.0, 100.0], [1.0, np.nan, 3.0], color="#123456", linestyle="--", marker="o", label="one")
    above.set(xscale="log", xlim=(1.0, 100.0), xlabel="Frequency (Hz)", ylabel="Level (g)")
    above.axhline(2.0, color="red", linestyle=":", label="limit")
    above.set_title("level 1 g", loc="left")
    above.legend()
    below.bar([1.0, 2.0], [3.0, -4.0], width=0.5, color="#abcdef")
    below.annotate("here", (1.0, 3.0), xytext=(5, 6), textcoords="offset points")
    described = plotly_of(figure)
    curve, bars = described["data"]
    assert curve["x"] == [1.0, 10.0, 100.0]
    assert curve["y"] == [1.0, None, 3.0]
    assert (curve["mode"], curve["line"]["color"], curve["name"]) == ("lines+markers", "rgb(18,52,86)", "one")
    assert curve["showlegend"]
    assert "px" in curve["line"]["dash"]
    layout = described["layout"]
    assert layout["xaxis"]["type"] == "log"
    np.testing.assert_allclose(layout["xaxis"]["range"], [0.0, 2.0])
    assert layout["xaxis"]["title"]["text"] == "Frequency (Hz)"
    assert (layout["xaxis"]["dtick"], layout["xaxis"]["tickformat"]) == ("D2", "~g")  # 20, not a small 2 beside 10
    limit = layout["shapes"][0]
    assert (limit["y0"], limit["xref"], limit["name"], limit["line"]["dash"]) == (2.0, "x domain", "limit", "dot")
    assert limit["showlegend"]
    assert layout["legend"]["y"] > 1.02  # above the title
    assert layout["yaxis"]["domain"][0] > layout["yaxis2"]["domain"][1]
    assert bars["fillcolor"] == "rgb(171,205,239)"
    assert bars["xaxis"] == "x2"
    assert min(v for v in bars["y"] if v is not None) == -4.0
    assert layout["annotations"][-1]["text"] == "here"


def test_maps_keep_values_and_colour_bars():
    figure = Figure()
    ax = figure.subplots()
    drawn = ax.pcolormesh([0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 2.0], [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    figure.colorbar(drawn, ax=ax, label="Peak force (N)")
    (heat,) = plotly_of(figure)["data"]
    assert heat["type"] == "heatmap"
    assert heat["z"] == [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]
    assert heat["x"] == [0.0, 1.0, 2.0, 3.0]
    assert heat["colorbar"]["title"]["text"] == "Peak force (N)"


def test_filled_contours_are_left_to_their_picture():
    figure = Figure()
    figure.subplots().contourf(np.arange(9.0).reshape(3, 3))
    assert plotly_of(figure) is None


def test_thinned_histories_keep_their_extremes_and_ends():
    figure = Figure()
    ax = figure.subplots()
    time = np.linspace(0.0, 1.0, 100_000)
    values = np.sin(300.0 * time)
    values[54_321], values[77_777] = 9.0, -9.0
    ax.plot(time, values)
    keep = thinning(ax, time, values)
    assert keep.size <= 1.05 * MOST_POINTS
    assert {0, 54_321, 77_777, 99_999} <= set(keep.tolist())


def test_thinned_loops_stay_close_to_the_curve_and_keep_their_gaps():
    figure = Figure()
    ax = figure.subplots()
    angle = np.linspace(0.0, 40.0 * np.pi, 200_001)
    x, y = np.cos(angle) * (1 + 0.01 * angle), np.sin(angle)
    y[100_000:100_100] = np.nan
    ax.plot(x, y)
    keep = thinning(ax, x, y)
    assert keep.size <= 1.1 * MOST_POINTS
    assert np.isnan(y[keep]).any()
    chord = np.hypot(np.diff(x[keep]), np.diff(y[keep]))
    assert np.nanmax(chord) < 0.1


@pytest.mark.parametrize("size", [0, 1, 2])
def test_short_curves(size):
    figure = Figure()
    figure.subplots().plot(np.arange(float(size)), np.arange(float(size)))
    assert len(plotly_of(figure)["data"]) == (size > 0)
