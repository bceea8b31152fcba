"""What an identification stores comes back, and can be drawn and printed again."""

from pathlib import Path

import numpy as np
import pytest

from beamsim.analyses.identify.analysis import identify_stiffness
from beamsim.measurements.channels import read_tests
from beamsim.plots.identification import identification_figures
from beamsim.scenario import load_scenario
from beamsim.store.results import open_result, write_result

CONFIGS = Path(__file__).parents[2] / "configs"


def same(a, b):
    if hasattr(a, "__dataclass_fields__"):
        return all(same(getattr(a, name), getattr(b, name)) for name in a.__dataclass_fields__)
    if isinstance(a, np.ndarray):
        return a.shape == b.shape and bool(np.array_equal(a, b, equal_nan=True))
    if isinstance(a, tuple | list):
        return len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, float) and np.isnan(a):
        return bool(np.isnan(b))
    return bool(a == b)


@pytest.fixture(scope="module", params=["identify_snubber", "identify_accelerometers", "identify_nonlinear"])
def result(request):
    scenario = load_scenario(CONFIGS / f"{request.param}.yaml")
    if request.param == "identify_nonlinear":
        scenario = load_scenario(scenario, {"identify_stiffness.nonlinear.starts": 1})
    if request.param == "identify_snubber":
        shapes = {"positions": [0.1, 0.2, 0.27], "shapes": [[0.1, 0.6, 1.0], [0.5, 0.1, -1.0]]}
        scenario = load_scenario(scenario, {"identify_stiffness.shapes_without": shapes})
    return identify_stiffness(scenario, read_tests(scenario, CONFIGS))


def test_round_trip(result, tmp_path):
    again = open_result(write_result(result, tmp_path / "case.h5"))
    for name in result.__dataclass_fields__:
        if name not in ("update", "nonlinear"):
            assert same(getattr(result, name), getattr(again, name)), name
    for name in ("update", "nonlinear"):
        part, read = getattr(result, name), getattr(again, name)
        assert (part is None) == (read is None)
        for field in () if part is None else part.__dataclass_fields__:
            if (name, field) != ("update", "warnings"):  # they are among the result's
                assert same(getattr(part, field), getattr(read, field)), (name, field)


def test_every_picture_can_be_drawn(result):
    figures = identification_figures(result)
    assert figures
    for figure in figures.values():
        figure.canvas.draw()
        assert all(ax.get_xlabel() and ax.get_ylabel() for ax in figure.axes if ax.get_visible())
    if (profiles := figures.get("profiles")) is not None:
        labels = [ax.get_xlabel() for ax in profiles.axes if ax.get_visible()]
        assert not any("SI" in label or "." in label for label in labels)  # words, not paths
        assert all(label.endswith("kN/m)") for label in labels if "stiffness" in label)
