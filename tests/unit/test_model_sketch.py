"""The sketch of a model: everything is where the scenario puts it, and no label lies over another."""

import json
import shutil
from itertools import combinations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text
from shipped import config_path

from beamsim.plots.model import model_figure
from beamsim.plots.sketch import Sketch
from beamsim.plots.understood import excitation_text, stop_text
from beamsim.scenario import load_scenario
from beamsim.system.build import build_system
from tests.helpers.commands import invoke

BEAM = {"length": 0.4, "width": 0.05, "thickness": 0.008, "youngs_modulus": 70e9, "density": 2700.0, "elements": 6}


def sketched(scenario):
    system = build_system(scenario)
    return model_figure(Sketch(scenario, system.stations, {stop.name: stop for stop in system.snubbers})).figure()


def faces(figure):
    lines = [line for line in figure.axes[0].lines if str(line.get_label()).startswith("stop")]
    return sorted(tuple(line.get_xydata()[0]) for line in lines)


def texts(figure):
    """What the numbers in the sketch mean."""
    return [text.get_text().partition("  ")[2] for legend in figure.legends for text in legend.get_texts()]


def test_stops_are_on_their_sides_with_gaps_in_proportion():
    case = {
        "beam": BEAM,
        "snubbers": [
            {"name": "low", "position": 0.1, "side": "below", "stiffness": 1e4, "gap": 1e-3},
            {"name": "lower", "position": 0.2, "side": "below", "stiffness": 1e4, "gap": 2e-3},
            {"name": "high", "position": 0.3, "side": "above", "stiffness": 1e4, "gap": 0.5e-3},
            {"name": "pressed", "position": 0.4, "side": "above", "stiffness": 1e4, "preload": 3.0},
        ],
    }
    figure = sketched(load_scenario(case))
    (x1, low), (x2, lower), (x3, high), (x4, pressed) = faces(figure)
    np.testing.assert_allclose([x1, x2, x3, x4], [0.1, 0.2, 0.3, 0.4])
    assert lower < low < 0.0 < pressed < high
    touching = pressed  # a stop that presses is drawn at the surface
    np.testing.assert_allclose([-low - touching, -lower - touching], np.array([2.0, 4.0]) * (high - touching))
    assert "pressed: 10 kN/m, preload 3 N" in texts(figure)
    assert "lower: 10 kN/m, gap 2 mm" in texts(figure)


@pytest.mark.parametrize("between", [("one", "two"), ("two", "one")])
def test_of_two_bodies_the_one_that_is_below_is_drawn_below(between):
    """Whatever the order in which they are written; the stop crossed the body that it is to hold."""
    places = [{"body": body, "position": "50 %"} for body in between]
    stop = {"name": "stop", "between": places, "stiffness": 1e4, "gap": 1e-3}
    bodies = {name: {"kind": "beam", **BEAM} for name in ("one", "two")}
    scenario = load_scenario({"bodies": bodies, "snubbers": [stop], "excitation": {"kind": "none"}})
    system = build_system(scenario)
    sketch = Sketch(scenario, system.stations, {each.name: each for each in system.snubbers})
    assert [sketch.lines_of(body)[0].row for body in between] == [0, 1]


SWEPT = {"kind": "swept_sine", "from": 8.0, "to": 90.0, "rate": "2 oct/min", "levels": [0.5, 2.0]}
POINTS = [{"frequency": 8.0, "level": "2 mm"}, {"frequency": 20.0, "level": "1 g"}]
FORCES = [{"kind": "harmonic", "applied_to": {"position": 0.2}, "level": "3 N", "frequency": 9.0}]


@pytest.mark.parametrize(
    ("excitation", "sweep", "said"),
    [
        ({}, {"levels": ["0.5 g", "2 g"]}, "swept sine, 0.5 g and 2 g, 8 to 90 Hz"),
        ({}, {"profile": POINTS}, "swept sine, profile of 2 mm from 8 Hz, 1 g from 20 Hz, times 0.5 and 2, 8 to 90 Hz"),
        ({}, {"profile_file": "level.csv", "levels": None}, "swept sine, profile of level.csv, 8 to 90 Hz"),
        ({}, {"profile": POINTS, "levels": None}, "swept sine, profile of 2 mm from 8 Hz, 1 g from 20 Hz, 8 to 90 Hz"),
        ({"kind": "forces", "forces": FORCES}, {}, "swept sine, 3 N, times 0.5 and 2, 8 to 90 Hz"),
    ],
    ids=["levels", "profile", "profile in a file", "profile alone", "forces"],
)
def test_levels_that_are_factors_are_not_accelerations(excitation, sweep, said):
    """A profile times 0.5 was "0.05099 g" in sketch and report, forces times 2 were "2 N"."""
    shaken = {"kind": "harmonic", "applied_to": "base", "level": "3 g", "frequency": 9.0}
    text = excitation_text(load_scenario({"beam": BEAM, "excitation": excitation or shaken, "sweep": SWEPT | sweep}))
    assert text.startswith(said)


def test_a_case_with_a_run_and_a_sweep_is_not_excited_by_both_at_once():
    """ "harmonic, 3 g, 9 Hz, at the base; swept sine, 3 g, ... at the base" read as one excitation of two parts."""
    shaken = {"kind": "harmonic", "applied_to": "base", "level": "3 g", "frequency": 9.0}
    case = {"beam": BEAM, "excitation": shaken, "sweep": SWEPT | {"levels": ["3 g"]}, "run": {"duration": 1.0}}
    run, sweep = excitation_text(load_scenario(case)).split("\n")
    assert run == "run: harmonic, 3 g, 9 Hz, at the base"
    assert sweep.startswith("sweep: swept sine, 3 g, 8 to 90 Hz")


def test_texts_of_stops():
    prestressed = {"name": "s", "position": 0.4, "side": "below", "stiffness": 1e4, "gap": -1e-4}
    for gap, rest in ((-1e-4, "preload"), (0.0, "just touching"), (2e-3, "gap 2 mm")):
        (stop,) = build_system(load_scenario({"beam": BEAM, "snubbers": [{**prestressed, "gap": gap}]})).snubbers
        assert rest in stop_text("s", stop)


@pytest.mark.parametrize("case", ["one_sided_45hz", "hinged_yoke", "chain_bumpers", "plate_panel", "vibeams"])
def test_no_label_lies_over_another(case):
    figure = sketched(load_scenario(config_path(case)))
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    renderer = canvas.get_renderer()
    boxes = []
    for text in figure.axes[0].texts:
        text.get_window_extent(renderer)  # gives the text its place; with the leader line, which may pass under another
        boxes.append((text.get_text(), Text.get_window_extent(text, renderer)))
    crossing = [
        (a, b) for (a, one), (b, other) in combinations(boxes, 2) if a and b and one.shrunk(0.9, 0.9).overlaps(other)
    ]
    assert len(boxes) >= 4
    assert not crossing


def test_validate_draws_the_model(tmp_path):
    shutil.copy(config_path("two_forces"), tmp_path / "case.yaml")
    done = invoke("validate", tmp_path / "case.yaml", "--sketch", "-o", tmp_path, "--json")
    assert done.exit_code == 0, done.output
    (file,) = json.loads(done.stdout)["files"]
    assert file == str(tmp_path / "case_sketch.png")
    assert (tmp_path / "case_sketch.png").stat().st_size > 10_000


def labels(figure):
    return {text.get_text() for legend in figure.legends for text in legend.get_texts()}


def test_a_continuation_in_shares_of_the_length_is_said_in_metres():
    """The picture ended in a traceback: shares have no order."""
    path = "sweep={kind: continuation, continue_in: {kind: position, from: 50 %, to: 80 %}}"
    scenario = load_scenario(config_path("one_sided_65hz"), [path])
    assert "position 0.135 to 0.216 m" in excitation_text(scenario)


def test_rotational_springs_are_drawn_with_their_stiffness():
    arm = {"kind": "beam", **BEAM}
    hinge = {"kind": "hinge", "between": [{"body": "inner", "position": 0.4}, {"body": "outer", "position": 0.0}]}
    case = {"bodies": {"inner": arm, "outer": {**arm, "supports": {"left": "free", "right": "free"}}},
            "joints": [{**hinge, "name": "hinge", "rotational_stiffness": 200.0}]}  # fmt: skip
    figure = sketched(load_scenario(case))
    assert "rotational spring" in labels(figure)
    assert "hinge (hinge joint, 200 N m/rad)" in texts(figure)
    held = {"left": {"stiffness": 1e6, "rotational_stiffness": 50.0}, "right": "pinned"}
    figure = sketched(load_scenario({"beam": {**BEAM, "supports": held}}))
    assert {"springs", "rotational spring"} <= labels(figure)
    assert "support on 1 MN/m and 50 N m/rad" in texts(figure)
    held["left"] = {"stiffness": 1e6}
    assert "rotational spring" not in labels(sketched(load_scenario({"beam": {**BEAM, "supports": held}})))


def test_supports_that_move_are_marked():
    beam = {**BEAM, "supports": {"left": "pinned", "right": "pinned"}}
    forces = [{"kind": "harmonic", "applied_to": {"support": "right"}, "level": "2 mm", "frequency": 9.0}]
    figure = sketched(load_scenario({"beam": beam, "excitation": {"kind": "forces", "forces": forces}}))
    assert "support right: 2 mm" in texts(figure)
    (arrow,) = [each for each in figure.axes[0].texts if each.arrow_patch is not None]
    assert arrow.xy[0] == pytest.approx(0.4)


def test_what_moves_by_a_record_or_moves_a_stop_is_drawn(tmp_path):
    """A record has no level; a stop that moves has an arrow below it."""
    shipped = load_scenario(config_path("earthquake"))
    drawn = sketched(shipped)
    said = set(texts(drawn))
    arrows = [each.xy[0] for each in drawn.axes[0].texts if each.arrow_patch is not None and each.xycoords == "data"]
    assert sorted(arrows) == pytest.approx([0.0, 1.6, 4.0])  # at both supports, and at the stop on one of them
    assert {"support left: sampled", "support right: sampled"} <= said
    assert "bumper: 200 kN/m, gap 1.5 mm, on support left" in said
    stop = {"name": "cam", "position": 0.2, "side": "below", "stiffness": 1e4, "gap": 1e-3}
    moves = {"kind": "harmonic", "applied_to": {"snubber": "cam"}, "level": "1 mm", "frequency": 9.0}
    figure = sketched(load_scenario({"beam": BEAM, "snubbers": [stop], "excitation": moves}))
    assert "at stop cam" in figure.axes[0].get_title(loc="left")
    assert "stop cam: 1 mm" in texts(figure)
    ((x, face),) = faces(figure)
    (arrow,) = (each for each in figure.axes[0].texts if each.arrow_patch is not None)
    assert arrow.xy[0] == x
    assert arrow.xy[1] < face


@pytest.mark.parametrize(("end", "way"), [(0.0, 1.0), (0.4, -1.0)])
def test_stops_of_a_hinge_are_beside_it_where_the_body_turns_towards_them(end, way):
    """A body to the right of its hinge rises with a positive angle, one to the left falls."""
    body = {"kind": "beam", **BEAM, "supports": {"left": "free", "right": "free"}}
    stops = [{"name": "up", "angle": "2 deg", "side": "above", "stiffness": 100.0},
             {"name": "down", "angle": "-3 deg", "side": "below", "stiffness": 100.0}]  # fmt: skip
    hinge = {"name": "root", "kind": "hinge", "between": [{"body": "arm", "position": end}, "base"], "stops": stops,
             "rotational_stiffness": 5.0, "friction": {"moment": 0.1}}  # fmt: skip
    scenario = load_scenario({"bodies": {"arm": body}, "joints": [hinge]})
    figure = sketched(scenario)
    (x1, low), (x2, high) = sorted(faces(figure), key=lambda at: at[1])
    assert low < 0.0 < high
    assert x1 == x2
    assert np.sign(x1 - end) == way
    assert "root.friction (friction)" in texts(figure)
    markers = {
        line.get_xydata()[0][1] > 0.0: line.get_marker() for line in figure.axes[0].lines if line.get_label() == "stop"
    }
    assert markers == {True: 7, False: 6}
