"""Axes that count have ticks at whole numbers, in pictures and on pages."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from beamsim.plots.drawing import Chart, Curve, draw
from beamsim.report.interactive import plot

COUNTS = (1, 2, 3, 7, 40, 1000)


def chart(most, whole="y"):
    x = np.arange(4.0)
    return Chart(
        ("Force", "N"),
        ("Cases", ""),
        [Curve("", x, np.array([0.0, most, 1.0, 0.0]))],
        integer_axes=whole,
        y_ends=(0.0, None),
    )


@pytest.mark.parametrize("most", COUNTS)
def test_no_half_cases_are_marked_in_a_picture(most):
    ax = Figure(figsize=(8, 4)).subplots()
    draw(ax, chart(most))
    ticks = ax.get_yticks()
    assert np.array_equal(ticks, np.round(ticks))
    assert 2 <= ticks.size <= 12


def test_other_axes_have_ticks_between():
    ax = Figure(figsize=(8, 4)).subplots()
    draw(ax, chart(1, whole=""))
    assert np.any(ax.get_yticks() % 1.0)


@pytest.mark.parametrize("most", COUNTS)
def test_nor_on_a_page(most):
    axis = plot(chart(most))["layout"]["yaxis"]
    assert axis["dtick"] == int(axis["dtick"]) >= 1
    assert most / axis["dtick"] <= 8
    assert "dtick" not in plot(chart(most, whole=""))["layout"]["yaxis"]
