"""A scenario written in other words gives the same result, as a thousand do in `python -m tests.attack`."""

import copy
import itertools
from pathlib import Path

import numpy as np
import pytest
from rewritten import (
    SAME,
    difference,
    get,
    histories,
    in_unit,
    mirrored,
    positions,
    put,
    reflected,
    rewrite,
    scenario_of,
    told,
)
from sampling import first_apart

import beamsim
from beamsim.scenario.units import LENGTH, STIFFNESS, read_quantity

SEEDS = {9: "a plate", 10: "imported matrices", 21: "a beam and a chain that are joined", 22: "a chain"}


@pytest.mark.parametrize("seed", SEEDS)
def test_the_same_physics_in_other_words(seed, tmp_path):
    """Shares and metres, ratios and dashpots, units, names, order, both mirrors, studies, files."""
    findings = rewrite(seed, tmp_path)
    assert [(f.source, f.words, f.differences) for f in findings if f.differences] == []
    assert {f.words for f in findings} == set(SAME)
    assert sum(f.outcome == "agrees" for f in findings) >= 5


@first_apart("seed", 1, range(40, 44))
def test_more_scenarios_in_other_words(seed, tmp_path):
    assert [(f.source, f.words, f.differences) for f in rewrite(seed, tmp_path) if f.differences] == []


FOUND = {
    3000012: "a peak in a late contact, which the last digits move, and a mirror of 0 m",
    3000024: "the force of a stop of 50 GN/m with a prestress of 1 mm, of which one digit is 1e-8",
    3000116: "a moment whose correction weighed a place twice that was listed with another last digit",
    6000117: "a moment of one element with one mode, for which all loads were taken for one, the first one listed",
}


@first_apart("seed", 1, FOUND)
def test_scenarios_that_differed_before(seed, tmp_path):
    findings = rewrite(seed, tmp_path)
    assert [(f.words, f.differences) for f in findings if f.differences] == []
    assert any(f.compared for f in findings)


MATRICES = """\
bodies: {{panel: {{kind: matrices, mass: {{file: {folder}/strip.op4, name: mxx}}, dofs: {dofs},
  stiffness: {{file: {folder}/strip.op4, name: kxx}}, base: {{nodes: [15], direction: z}},
  damping: {{kind: modal, ratio: 1 %}}}}}}
snubbers: [{{name: corner, at: {{node: 14}}, side: below, stiffness: 100 kN/m, gap: 0.1 mm}}]
excitation: {{kind: harmonic, applied_to: base, direction: ry, about: {about}, level: 30 rad/s^2, frequency: 20 Hz}}
probes: [{{name: corner, at: {{node: 14}}}}]
reduction: {{modes: 6}}
run: {{duration: 0.1 s, sample_rate: 1 kHz, convergence: off}}
"""


def test_coordinates_of_imported_matrices_begin_anywhere(tmp_path):
    """Nodes and the axis of a turning base moved together; moved alone, the axis is another one."""
    folder, shift, about = Path(__file__).parents[2] / "configs" / "matrices", (0.3, -0.2, 0.1), (0.1, 0.0, 0.0)
    heading, *rows = (folder / "strip_dofs.csv").read_text().splitlines()
    lines = [heading]
    for row in rows:
        named, coordinates = row.split(",")[:2], np.array(row.split(",")[2:], dtype=float) + shift
        lines.append(",".join([*named, *map(repr, coordinates.tolist())]))
    (tmp_path / "dofs.csv").write_text("\n".join(lines) + "\n")

    def motion(dofs, about):
        return histories(beamsim.run(beamsim.load_scenario(MATRICES.format(folder=folder, dofs=dofs, about=[*about]))))

    first = motion(folder / "strip_dofs.csv", about)
    other = motion(tmp_path / "dofs.csv", np.add(about, shift).tolist())
    assert [said for name in first if (said := difference(name, first[name], other[name], ()))] == []
    alone = motion(tmp_path / "dofs.csv", about)
    assert difference("force of corner", first["force of corner"], alone["force of corner"], ())
    assert first["force of corner"].max() > 0


def test_a_place_that_is_another_differs(tmp_path):
    """Twin of the agreement: a millionth of a body's length is seen in every scenario that has places."""
    _, tree = scenario_of(9, tmp_path)
    first, moved = told(tree), copy.deepcopy(tree)
    path, side, _ = next(each for each in positions(tree) if each[0][0] == "snubbers")
    put(moved, path, f"{100 * (tree['snubbers'][0]['position'][path[-1]] / side + 1e-6)!r} %")
    other = told(moved)
    assert any(difference(name, first[name], other[name], ()) for name in first)


def test_what_the_words_are_made_with():
    """Polynomials from the other end, and quantities in other units, against numbers that are known."""
    assert reflected(np.array([1.0, 2.0, 3.0]), 2.0).tolist() == [
        1 + 4 + 12,
        -2 - 12,
        3.0,
    ]  # 1 + 2 (2 - x) + 3 (2 - x)^2
    rng = np.random.default_rng(1)
    for unit, dimension in (("m", LENGTH), ("N/m", STIFFNESS)):
        texts = {in_unit(0.3048, unit, rng) for _ in range(40)}
        assert len({text.split(" ")[1] for text in texts}) > 3
        assert all(read_quantity(text, dimension) == pytest.approx(0.3048, rel=1e-15) for text in texts)


def test_a_mirror_of_places_at_an_end_and_of_shares(tmp_path):
    """0.1 + 0.2 m is the end of 0.3 m, whose mirror is 0 m; an area in shares is drawn as one in metres."""
    beam = {"length": 0.3, "snubbers": [{"name": "tip", "position": 0.1 + 0.2, "side": "below"}]}
    assert mirrored({"beam": beam, "run": {}}, None)["beam"]["snubbers"][0]["position"] == 0.0
    drawn = ((seed, *scenario_of(seed, tmp_path)) for seed in itertools.count())
    shares_of_an_area, _, tree = next(each for each in drawn if each[1] == "pressure_on_plate")
    places = [get(tree, path) for path, _, _ in positions(tree)]
    assert all(isinstance(place, float) for place in places)
    (finding,) = rewrite(shares_of_an_area, tmp_path, ["mirrored"])
    assert (finding.outcome, finding.differences) == ("agrees", [])
