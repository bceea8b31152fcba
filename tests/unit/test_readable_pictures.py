"""Pictures of every kind can be read at their own size: no text is cut off or covered, no panel is empty."""

import gzip
from pathlib import Path
from pkgutil import resolve_name

import numpy as np
from readable import faults
from sampling import first_apart
from shipped import config_path

import beamsim
from beamsim.kinds import KINDS
from beamsim.plots.drawing import Chart, Curve, Guide, Picture
from beamsim.plots.model import model_figure
from beamsim.plots.sketch import Sketch
from beamsim.plots.style import use_units
from beamsim.system.build import build_system
from tests.helpers.solved import words_of

ROOT = Path(__file__).parents[2]
STORED = ROOT / "tests" / "data" / "results"
SKETCHED = ("earthquake", "moved_supports", "hinged_yoke", "plate_panel", "deployed_boom", "vibeams", "chain_two_dof")
SOLVED = {  # of kinds of pictures of which no result is kept
    **dict.fromkeys(
        ("earthquake", "hinged_yoke", "plate_panel", "crushed_stop", "deployed_boom", "shock_panel"), "run"
    ),
    **dict.fromkeys(("sensitivities", "two_panels", "stick_slip"), "run"),
    **dict.fromkeys(("spring_position", "ms_forced_oscillator"), "sweep"),
}
"""Shipped config -> command, as in test_configs.py."""


def of_picture(curve, **more):
    return faults(Picture("case", [Chart(("Time", "s"), ("Force", "N"), [curve])._replace(**more)]))


def figures(result):
    with use_units(result.scenario.display_scales):
        return resolve_name(KINDS[result.KIND].figures)(result)


def test_faults_are_found():
    """A text beyond the edge, texts over each other, a panel of nothing, an axis with one number."""
    line = Curve("force", np.linspace(0.0, 1.0, 9), np.linspace(0.0, 1.0, 9))
    assert of_picture(line) == []

    def write(ax, *_):
        ax.text(0.5, 0.5, "one")
        ax.text(0.5, 0.5, "other")
        ax.annotate(
            "far", (0.5, 0.5), xytext=(2000, 0), textcoords="offset pixels", annotation_clip=False
        ).set_in_layout(False)

    assert {"'one' and 'other' overlap", "'far' is cut off"} == set(of_picture(line, draw_extra=write))
    assert of_picture(line, draw_extra=lambda ax, *_: ax.set_xticks(np.linspace(0.4, 0.6, 30)))
    assert of_picture(line, draw_extra=lambda ax, *_: ax.set_xticks([0.5]))
    assert faults(Picture("case", [lambda ax: None])) == ["panel 0 is empty"]
    assert of_picture(line, levels=[Guide("limit", 1.0)]) == []


@first_apart("name", 4, sorted(path.name.partition(".")[0] for path in STORED.glob("*.gz")))
def test_pictures_of_every_kept_result(name, tmp_path):
    path = tmp_path / f"{name}.h5"
    path.write_bytes(gzip.decompress((STORED / f"{name}.h5.gz").read_bytes()))
    drawn = figures(beamsim.load(path))
    assert drawn
    assert {name: found for name, picture in drawn.items() if (found := faults(picture))} == {}


@first_apart("name", 2, SKETCHED)
def test_sketches(name):
    scenario = beamsim.load_scenario(config_path(name))
    system = build_system(scenario)
    with use_units(scenario.display_scales):
        sketch = Sketch(scenario, system.stations, {stop.name: stop for stop in system.snubbers})
        assert faults(model_figure(sketch)) == []


@first_apart("name", 0, list(SOLVED))
def test_pictures_of_shipped_cases(name, solve):
    result = beamsim.load(solve(*words_of(SOLVED[name], config_path(name))).file)
    assert {name: found for name, picture in figures(result).items() if (found := faults(picture))} == {}
