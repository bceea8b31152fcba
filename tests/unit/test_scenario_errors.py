"""Bad input of every sort: located, with a remedy, and all of it at once."""

from pathlib import Path

import pytest
from pydantic import ValidationError

from beamsim.errors import ScenarioError
from beamsim.scenario import Scenario, load_scenario
from beamsim.scenario.base import SYNONYMS
from beamsim.scenario.beam import Beam
from beamsim.scenario.connections import Snubber
from beamsim.scenario.jsonschema import json_schema

pytestmark = pytest.mark.quick

BASE = (Path(__file__).parents[1] / "data" / "examples" / "one_sided_65hz.yaml").read_text()
CHAIN = """\
chain:
  masses: [1, 1, 1]
  springs: [1, 1, 1]
  snubbers:
    - {mass: 1, side: above, stiffness: 100}
excitation: {kind: harmonic, applied_to: {mass: 2}, level: 1 N, frequency: 1 Hz}
run: {duration: 10 s}
"""


def problems(source, overrides=()):
    with pytest.raises(ScenarioError) as caught:
        load_scenario(source, overrides)
    assert caught.value.exit_code == 2
    assert all(problem.remedy for problem in caught.value.problems)
    return [str(problem) for problem in caught.value.problems]


def one(source, overrides=()):
    (line,) = problems(source, overrides)
    return line


def test_the_documented_message(tmp_path):
    path = tmp_path / "case.yaml"
    path.write_text(BASE.replace("position: 270 mm\n    side", "position: 310 mm\n    side"))
    with pytest.raises(ScenarioError) as caught:
        load_scenario(path)
    (problem,) = caught.value.problems
    assert problem.path == "snubbers[0].position"
    assert problem.message == "= 0.31 m lies beyond beam.length = 0.27 m"
    assert (problem.file, problem.line) == (str(path), 20)
    assert str(problem).startswith(f"{path}:20: snubbers[0].position = 0.31 m lies beyond beam.length = 0.27 m; ")


@pytest.mark.parametrize(
    ("right", "wrong", "line", "message"),
    [
        ("stiffness: 151 kN/m", "stiffness:151 kN/m", 3, "snubbers[0][stiffness:151 kN/m] is not a known key"),
        ("gap: 0.1 mm", "gap (mm): 0.1", 4, "snubbers[0][gap (mm)] is not a known key"),
        ("gap: 0.1 mm", "gap[mm: 0.1", 4, "is not YAML"),
        ("gap: 0.1 mm", '"gap [mm]": 0.1', 4, "snubbers[0][gap [mm]] is not a known key"),
        ("width: 50 mm", "width:50 mm", 1, "beam[width:50 mm] is not a known key"),
        ("beam:", '"beam:":', 1, "beam: is not a known key"),
    ],
)
def test_keys_that_are_no_names_are_located(tmp_path, right, wrong, line, message):
    text = """\
beam: {length: 270 mm, width: 50 mm, thickness: 5 mm, youngs_modulus: 69 GPa, density: 2700 kg/m^3}
snubbers:
  - {name: tip, position: 270 mm, side: below, stiffness: 151 kN/m,
     gap: 0.1 mm}
"""
    path = tmp_path / "case.yaml"
    path.write_text(text.replace(right, wrong))
    found = [each for each in problems(path) if message in each]
    assert [each.partition(": ")[0] for each in found] == [f"{path}:{line}"]


def test_another_number_is_no_spelling_mistake():
    stops = [{"name": f"stop_{k}", "position": 0.1 * k, "side": "below", "stiffness": 1e5} for k in (1, 2)]
    said = one(BASE, {"snubbers": stops, "limits": {"peak_force": {"stop_12": "5 N"}}})
    assert said.endswith("peak_force.stop_12 names no snubber; the snubbers are stop_1, stop_2")
    said = one(BASE, {"snubbers": stops, "limits": {"peak_force": {"stpo_2": "5 N"}}})
    assert said.endswith("did you mean stop_2?")


def test_everything_at_once_in_the_order_of_the_file():
    text = BASE
    for right, wrong in (
        ("thickness: 5 mm", "thickness: -5 mm"),
        ("density: 2700 kg/m^3", "density: 2700 mm"),
        ("position: 270 mm\n    side: below", "position: 310 mm\n    sde: below"),
        ("gap: 0 mm ", "gap: 0 mm\n    preload: 1 N"),
        ("sample_rate: 20 kHz", "sample_rate: 100 Hz"),
        ("last: 0.4 s", "last: 4 s"),
        ("{name: middle,", "{name: tip,"),
        ("title: One", "titel: One"),
    ):
        assert right in text
        text = text.replace(right, wrong)
    found = problems(text)
    starts = [line.split(" must")[0].split(" is ")[0].split(" lies")[0].split(" and ")[0] for line in found]
    assert starts == [
        "<text>:2: titel",
        "<text>:7: beam.thickness = -5 mm",
        "<text>:9: beam.density = 2700 mm",
        "<text>:19: snubbers[0].side",
        "<text>:21: snubbers[0].sde",
    ]
    for wrong, right in (
        ("titel", "title"), ("thickness: -5", "thickness: 5"), ("2700 mm", "2700 kg/m^3"), ("sde:", "side:"),
    ):  # fmt: skip
        text = text.replace(wrong, right)
    (found,) = problems(text)  # two fields of one section
    assert found.startswith("<text>:26: snubbers[0].preload and gap exclude each other")
    found = problems(text.replace("\n    preload: 1 N", ""))  # between sections
    assert [line.split(" lies")[0].split(" is ")[0] for line in found] == [
        "<text>:20: snubbers[0].position = 0.31 m",
        "<text>:35: probes[1].name = tip",
        "<text>:39: run.sample_rate = 100 Hz",
        "<text>:41: run.spectrum.last = 4 s",
    ]


@pytest.mark.parametrize(
    ("supports", "polynomial", "refused"),
    [
        ("{left: free, right: free}", "[1, 2, 3]", False),
        ("{left: pinned, right: free}", "[0, 2, 3]", False),
        ("{left: pinned, right: free}", "[1, 2, 3]", True),
        ("{left: guided, right: free}", "[1, 0, 3]", False),
        ("{left: guided, right: free}", "[0, 1]", True),
        ("{left: clamped, right: free}", "[0, 0, 3]", False),
        ("{left: free, right: pinned}", "[0.27, -1]", False),
        ("{left: free, right: pinned}", "[0.27, -1.001]", True),
        ("{left: free, right: clamped}", "[0.0729, -0.54, 1]", False),  # (L - x)^2
        ("{left: free, right: clamped}", "[0.0729, -0.54, 1.01]", True),
        ("{left: free, right: guided}", "[1, 0.54, -1]", False),
        ("{left: free, right: guided}", "[1, 0.5, -1]", True),
        ("{left: clamped, right: clamped}", "[0]", False),
    ],
)
def test_initial_shapes_must_fit_the_supports(supports, polynomial, refused):
    text = BASE.replace("{left: clamped, right: free}", supports).replace("position: 270 mm\n", "position: 200 mm\n")
    overrides = [f"run.start={{displacement: {polynomial}}}"]
    if refused:
        assert any("where it must be 0" in line for line in problems(text, overrides))
    else:
        load_scenario(text, overrides)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("\n", "<text>: is empty; "),
        ("# only a comment\n", "<text>: is empty; "),
        ("- a list\n", "<text>:1: holds a list instead of the keys of a scenario"),
        ("just text\n", "<text>:1: holds only just text instead"),
        ("123\n", "<text>:1: holds only 123 instead"),
        ("title: x\n", "<text>: the scenario has no structure; give beam:, chain: or bodies:"),
        ("beam:\nchain:\n", "<text>: the scenario has no structure"),
    ],
)
def test_no_scenario(text, says):
    assert one(text).startswith(says)


def test_files(tmp_path):
    assert one(tmp_path / "absent.yaml").startswith(f"{tmp_path / 'absent.yaml'}: does not exist; check the path")
    (tmp_path / "absnt.yaml").write_text("title: x\n")
    assert one(tmp_path / "absent.yaml").endswith(f"did you mean {tmp_path / 'absnt.yaml'}?")
    assert one(str(tmp_path / "no" / "folder.yaml")).startswith(f"{tmp_path / 'no' / 'folder.yaml'}: does not exist")
    assert one(tmp_path).startswith(f"{tmp_path}: is a folder")
    assert "cannot be read" in one(tmp_path / "absnt.yaml" / "x")
    assert "cannot be read" in one("nul\0.yaml")
    binary = tmp_path / "binary.yaml"
    binary.write_bytes(b"title: x\n\xff\xfe\x00\x01")
    assert one(binary) == f"{binary}:2: is not text in UTF-8; give a YAML file"
    empty = tmp_path / "empty.yaml"
    empty.write_bytes(b"")
    assert one(empty).startswith(f"{empty}: is empty")
    marked = tmp_path / "marked.yaml"
    marked.write_bytes(b"\xef\xbb\xbf" + CHAIN.encode())
    assert load_scenario(marked).source == "marked"


def test_what_python_builds_is_checked_too():
    with pytest.raises(ValidationError, match="must be positive"):
        Beam(length=-1.0, width=1.0, thickness=1.0, youngs_modulus=1.0, density=1.0)
    with pytest.raises(ValidationError, match="exclude each other"):
        Snubber(position=1.0, side="below", stiffness=1.0, gap=0.0, preload=1.0)
    beam = Beam(length=1.0, width=0.1, thickness=0.01, youngs_modulus=70e9, density=2700.0)
    with pytest.raises(ScenarioError, match="lies beyond"):
        Scenario(beam=beam, snubbers=(Snubber(position=2.0, side="below", stiffness=1.0),))
    with pytest.raises(ValidationError):
        beam.length = 2.0
    with pytest.raises(ValidationError):
        Snubber(mass=1, side="below", stiffness=1.0, nonsense=1)


def test_round_off_at_the_end_is_forgiven():
    text = BASE.replace("length: 270 mm", "length: 0.26999999999999996").replace("position: 202.5", "position: 100")
    scenario = load_scenario(text)
    places = (scenario.snubbers[0], scenario.beam.point_masses[2], scenario.probes[0])
    assert [scenario.beam.point(place.position) for place in places] == [scenario.beam.length] * 3


def test_words_that_mean_a_key_are_no_keys_beside_it():
    """A key or choice that is proposed exists, and a word that stands for it is none beside it."""
    nodes = list(mappings(json_schema()))
    groups = [set(node.get("properties", ())) or set(node.get("enum", ())) for node in nodes]
    kinds = {str(node["const"]) for node in nodes if "const" in node}
    for key, words in SYNONYMS.items():
        beside = [names for names in groups if key in names]
        assert beside or key in kinds, key
        assert not any(set(words.split()) & names for names in beside), key


def mappings(node):
    """All mappings within a JSON value."""
    if isinstance(node, dict):
        yield node
    if isinstance(node, dict | list):
        for each in node.values() if isinstance(node, dict) else node:
            yield from mappings(each)
