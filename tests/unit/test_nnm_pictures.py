"""Pictures of nonlinear modes: what is drawn, and that names can be read."""

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from shipped import config_path

from beamsim.analyses.nnm.analysis import nnm
from beamsim.cli.tables import table_rows
from beamsim.plots.drawing import Chart, Curve, draw
from beamsim.plots.nnm import configuration
from beamsim.scenario import load_scenario


@pytest.fixture(scope="module")
def result():
    """Two masses between stops with a tongue, motions never at rest and a grazing."""
    changes = {"nnm.continue_in.from": 0.5, "nnm.continue_in.to": 4.0}
    return nnm(load_scenario(config_path("nnm_never_at_rest"), changes))


def test_names_beside_a_panel_stay_clear_of_each_other_and_of_curves():
    x = np.linspace(0, 10, 2001)
    names = {f"{n}:1, mode {n % 4}": (0.1 * k, 60 + 20 * np.tanh(0.1 * k)) for k, n in enumerate((17, 6, 16, 15, 5))}
    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    ax = figure.add_subplot()
    draw(ax, Chart(("Time", "s"), ("Frequency", "Hz"), [Curve("", x, 60 + 20 * np.tanh(x))], names=names))
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    boxes = [Text.get_window_extent(text) for text in ax.texts]  # the name alone, without its leader
    for k, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[:k])
        assert ax.bbox.x1 < box.x0 < box.x1 <= figure.bbox.x1
    assert [text.get_text() for text in ax.texts] == list(names)[::-1]  # in the order of their heights


def test_a_motion_that_goes_back_the_way_it_came_is_drawn_once(result):
    chain = nnm(load_scenario(config_path("nnm_chain_mass_5")))
    lengths = [configuration(one).curves[0].x.size / one["motion"]["time"].values.size for one in (result, chain)]
    assert lengths == pytest.approx([1.0, 0.5], abs=1e-3)


def test_rows_have_units(result):
    rows = list(table_rows(result))
    at = [label for label, _ in rows].index("start")
    assert [text.split() for _, text in rows[at : at + 3]] == [
        ["parameter", "500", "mJ"], ["frequency", "0.159155", "Hz"], ["energy", "500", "mJ"]
    ]  # fmt: skip
    at = [label for label, _ in rows].index("internal resonances")
    tongue = {name: " ".join(rest) for name, *rest in (text.split() for _, text in rows[at : at + 5]) if rest}
    assert (tongue["mode"], tongue["ratio"]) == ("2", "2")
    assert tongue["parameter"].startswith("2.5")
    assert tongue["parameter"].endswith(" J")
    assert any(label.startswith("full period symmetry breakings") for label, _ in rows)
