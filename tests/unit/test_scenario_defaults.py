"""Defaults, doubts, the JSON Schema, templates, and what importing costs."""

import re
from functools import cache
from pathlib import Path

import pytest
import yaml
from jsonschema import Draft202012Validator
from shipped import PATHS

from beamsim.errors import ScenarioError
from beamsim.kinds import TemplateKind
from beamsim.scenario import load_scenario, template, units
from beamsim.scenario.base import path_text, walk
from beamsim.scenario.body import AtPlace
from beamsim.scenario.excitation import HalfSine
from beamsim.scenario.jsonschema import json_schema
from beamsim.scenario.run import ModeStart, ReleasedForceStart
from beamsim.scenario.tree import parse

pytestmark = pytest.mark.quick

EXAMPLES = Path(__file__).parents[1] / "data" / "examples"
BASE = (EXAMPLES / "one_sided_65hz.yaml").read_text()
BEAM = "beam: {length: 1, width: 0.02, thickness: 0.02, youngs_modulus: 70e9, density: 2700}\n"
CHAIN = "chain: {masses: [1, 1], springs: [1, 1, 1]}\n"


def test_only_sections_that_are_written_are_compared_with_the_others():
    """Defaults of a section are right, and are not asked whether they are."""
    asked = {path_text(at) for at, _ in walk(load_scenario(CHAIN + "run: {duration: 1}\n"))}
    assert asked == {"", "chain", "run"}
    more = CHAIN + "run: {duration: 1, spectrum: {last: 2}}\nlimits: {peak_force: 1 N}\n"
    with pytest.raises(ScenarioError) as caught:
        load_scenario(more)
    assert {problem.path for problem in caught.value.problems} == {"run.spectrum.last", "limits.peak_force"}


def test_stops_of_a_hinge_have_names_of_their_own():
    stops = [{"name": "end", "angle": f"{angle} deg", "stiffness": 100} for angle in (5, -5)]
    ends = [{"body": "a", "position": 1}, {"body": "b", "position": 0}]
    beam = yaml.safe_load(BEAM)["beam"] | {"kind": "beam"}
    case = {"bodies": {"a": beam, "b": beam}, "joints": [{"kind": "hinge", "between": ends, "stops": stops}]}
    with pytest.raises(ScenarioError) as caught:
        load_scenario(case)
    assert "stops[1].name = joint_1.end is already the name of joints[0].stops[0]" in str(caught.value)
    case["joints"][0]["stops"][1]["name"] = "other end"
    assert len(load_scenario(case).all_snubbers) == 2
    like_a_stop = {"name": "joint_1.end", "at": {"body": "b", "position": 1}, "stiffness": 1e3, "side": "below"}
    with pytest.raises(ScenarioError, match=r"stops\[0\].name = joint_1.end is already the name of snubbers\[0\]"):
        load_scenario(case | {"snubbers": [like_a_stop]})


def test_half_of_what_a_bending_stress_needs_is_doubted():
    """`extreme_fibre` without the modulus of that fibre gave no stress and no word."""
    panel = {"length": 1, "bending_stiffness": 210, "mass_per_length": 3, "extreme_fibre": "6 mm"}
    (warning,) = load_scenario({"beam": panel}).warnings
    assert "beam.extreme_fibre has no effect without youngs_modulus" in warning
    assert load_scenario({"beam": {**panel, "youngs_modulus": "70 GPa"}}).warnings == ()
    panel.pop("extreme_fibre")
    (warning,) = load_scenario({"beam": {**panel, "youngs_modulus": "70 GPa"}}).warnings
    assert "beam.youngs_modulus has no effect without extreme_fibre" in warning


def test_the_least_scenario():
    scenario = load_scenario(BEAM)
    assert (scenario.beam.supports.left, scenario.beam.supports.right) == ("clamped", "free")
    assert scenario.beam.damping.ratio == 0.0
    assert scenario.excitation.kind == "none"
    assert (scenario.gravity, scenario.snubbers, scenario.run, scenario.title) == (0.0, (), None, "")


@pytest.mark.parametrize(
    ("text", "probes"),
    [
        (BEAM, [("right_end", 1.0)]),
        (BEAM[:-2] + ", supports: {left: free, right: clamped}}\n", [("left_end", 0.0)]),
        (BEAM[:-2] + ", supports: {left: clamped, right: pinned}}\n", [("middle", 0.5)]),
        (BEAM[:-2] + ", supports: {left: clamped, right: guided}}\n", [("right_end", 1.0)]),
        (
            BEAM + "snubbers: [{position: 0.5, side: above, stiffness: 1}, "
            "{name: tip, position: 1, side: above, stiffness: 1}]\n",
            [("snubber_1", 0.5), ("tip", 1.0)],
        ),
        (BEAM + "probes: [{name: here, position: 0.3}]\n", [("here", 0.3)]),
        (CHAIN, [("mass_2", 2)]),
        (CHAIN[:-2] + ", snubbers: [{mass: 1, side: above, stiffness: 1}]}\n", [("snubber_1", 1)]),
    ],
)
def test_effective_probes(text, probes):
    found = load_scenario(text).effective_probes
    assert [(p.name, p.position if p.position is not None else p.mass) for p in found] == probes


def test_gap_and_preload():
    text = (
        BEAM + "snubbers: [{position: 1, side: below, stiffness: 1}, "
        "{position: 1, side: above, stiffness: 1, preload: 2 N}]\n"
    )
    first, second = load_scenario(text).snubbers
    assert (first.gap, first.preload) == (0.0, None)
    assert (second.gap, second.preload) == (None, 2.0)


@pytest.mark.parametrize(
    ("run", "rate"),
    [
        ("excitation: {kind: harmonic, applied_to: base, level: 1, frequency: 65}", 100 * 65.0),
        ("excitation: {kind: harmonic, applied_to: base, level: 1, frequency: 0.7}", pytest.approx(3299 * 0.7)),
        ("excitation: {kind: none}", 5000.0),
        (
            "excitation: {kind: multi_tone, applied_to: base, "
            "tones: [{level: 1, frequency: 30}, {level: 1, frequency: 90}]}",
            10_000.0,
        ),
        ("excitation: {kind: half_sine, applied_to: base, level: 1, duration: 1 ms}", 50_000.0),
    ],
)
def test_default_sample_rates(run, rate):
    scenario = load_scenario(BEAM + run + "\nrun: {duration: 2 s}\n")
    assert scenario.sample_rate == rate
    periods = [scenario.sample_rate / f for f in scenario.excitation.frequencies_hz]
    assert all(samples >= 99.9 for samples in periods)
    if len(periods) == 1:  # whole periods have no leakage
        assert periods[0] == pytest.approx(round(periods[0]), rel=1e-12)


def test_a_long_run_at_high_frequency_is_sampled_less():
    text = BEAM + "excitation: {kind: harmonic, applied_to: base, level: 1, frequency: 100 kHz}\nrun: {duration: 1 s}\n"
    assert load_scenario(text.replace("1 s}", "0.5 s}")).sample_rate == 40 * 1e5
    for longer in ("1 s}", "10 s}"):
        assert load_scenario(text.replace("1 s}", longer)).sample_rate == 20 * 1e5
    with pytest.raises(ScenarioError, match="over the limit"):
        load_scenario(text.replace("1 s}", "1000 s}"))


@pytest.mark.parametrize(
    ("highest", "duration", "rate"), [(2000, "1 s", 20e3), (2000, "600 s", 20e3), (300, "0.2 s", 12e3)]
)
def test_a_random_input_is_sampled_where_the_pieces_of_its_spline_begin(highest, duration, rate):
    psd = f"psd: [{{frequency: 20, density: 1}}, {{frequency: {highest}, density: 1}}]"
    text = BEAM + f"excitation: {{kind: random, applied_to: base, {psd}}}\nrun: {{duration: {duration}}}\n"
    assert load_scenario(text).sample_rate == pytest.approx(rate)


def test_a_short_run_gets_enough_samples():
    assert load_scenario(CHAIN + "run: {duration: 1 ms}\n").sample_rate == 2e6


def test_starts_and_points():
    scenario = load_scenario(
        BEAM + "excitation: {kind: half_sine, applied_to: {position: 1}, level: 3 N, duration: 5 ms, time: 1 ms}\n"
        "run: {duration: 1, start: {released_force: {position: 1, force: 10 N}}}\n"
    )
    assert scenario.excitation == HalfSine(
        applied_to=AtPlace(position=1.0), level=3.0, quantity="force", duration=0.005, time=0.001
    )
    assert isinstance(scenario.run.start, ReleasedForceStart)
    assert scenario.run.start.released_force.place == AtPlace(position=1.0)
    moded = load_scenario(BEAM + "run: {duration: 1, start: {mode: 2, amplitude: -1 mm}}\n")
    assert moded.run.start == ModeStart(mode=2, amplitude=-0.001)


@pytest.mark.parametrize(
    ("level", "quantity", "value"),
    [
        ("2 g", "acceleration", 19.6133),
        ("0.1 m/s", "velocity", 0.1),
        ("0.1 mm", "displacement", 1e-4),
        ("3", "acceleration", 3.0),
    ],
)
def test_the_level_says_what_moves(level, quantity, value):
    scenario = load_scenario(BASE, [f"excitation.level={level}"])
    assert (scenario.excitation.quantity, scenario.excitation.level) == (quantity, value)
    assert isinstance(scenario.excitation.level, float)


def test_bare_levels_follow_quantity_and_place():
    assert load_scenario(BASE, ["excitation={level: 3, quantity: displacement}"]).excitation.quantity == "displacement"
    force = "excitation={kind: harmonic, applied_to: {position: 0.27}, level: 3, frequency: 1}"
    assert load_scenario(BASE, [force]).excitation.quantity == "force"


@pytest.mark.parametrize(
    ("override", "says"),
    [
        ("beam.thickness=40 mm", "Euler-Bernoulli theory (no shear) is doubtful"),
        ("beam.elements=1", "elements a bending wavelength at 65 Hz"),
        ("beam.youngs_modulus=69", "= 69 Pa is outside the range of structural materials; was 69 GPa meant?"),
        ("beam.density=2.7", "= 2.7 kg/m^3 is outside the range of solids; was 2.7 g/cm^3 meant?"),
        ("beam.density=27", ""),
        ("beam.density=0.5", "was 0.5 g/cm^3 meant?"),
        ("beam.damping.ratio=5", "was 5 % meant?"),
        ("run={duration: 10 ms, spectrum: null}", "shorter than one period of the excitation"),
        ("run.sample_rate=200 Hz", "superharmonics fold back"),
        ("run={duration: 1000 s}", "make a very large result file"),
        ("excitation={kind: step, applied_to: base, level: 1 g, time: 2 s}", "lies after the end of the run"),
        (
            "excitation={kind: half_sine, applied_to: base, level: 1 g, duration: 0.1 ms}",
            "fewer than 10 samples into the pulse",
        ),
        ("constant_forces=[{position: 0, force: 1 N}]", "constant_forces[0] is at a support"),
        ("probes=[{name: root, position: 0}]", "probes[0] is at a support"),
        ("reduction={highest_frequency: 20 Hz}", "the modes it excites are omitted"),
    ],
)
def test_doubts(override, says):
    doubts = load_scenario(BASE, [override]).warnings
    assert any(says in doubt for doubt in doubts) if says else doubts == ()


@pytest.mark.parametrize("kind", TemplateKind)
def test_templates_are_valid(kind):
    text = template(kind)
    scenario = load_scenario(text)
    assert getattr(scenario, kind.command.replace("-", "_")) is not None
    assert scenario.warnings == ()
    assert 20 <= len(text.splitlines()) <= 50
    assert text.count("#") >= 5
    commented = re.sub(r"^# (?=(?:limits|vary): )", "", text, flags=re.M)  # what is proposed in a line is valid too
    assert load_scenario(commented).title == scenario.title


# --- JSON Schema ---------------------------------------------------------------------------------------------------


@cache
def the_schema():
    return Draft202012Validator(json_schema())


@pytest.mark.parametrize("path", PATHS, ids=lambda path: path.stem)
def test_schema_accepts_what_is_shipped(path):
    """It refused null for a key whose default is a mapping, and tests of an identification that name no kind."""
    assert the_schema().is_valid(parse(path.read_text()))


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.yaml")), ids=lambda path: path.stem)
def test_schema_accepts_the_examples_and_their_resolved_form(path):
    assert the_schema().is_valid(parse(path.read_text()))
    assert the_schema().is_valid(yaml.safe_load(load_scenario(path).to_yaml()))


def test_every_example_of_the_schema_is_read_by_its_key():
    """In its dimension, and not the example of a beam's length for a wall thickness."""
    schema = the_schema().schema

    def quantities(item, key=""):
        if isinstance(item, dict):
            if "x-unit" in item:
                yield key, item
            for name, inner in item.items():
                if name == "properties":
                    for field in inner:
                        yield from quantities(inner[field], field)
                else:
                    yield from quantities(inner, key)
        elif isinstance(item, list):
            for inner in item:
                yield from quantities(inner, key)

    known = {}
    for key, item in quantities(schema["$defs"]):
        for example in item["examples"]:
            known.setdefault(key, set()).add(example)
            gravity = item["x-unit"] == "m/s^2"
            assert units.read_quantity(example, units.Dimension(key, item["x-unit"], example, gravity=gravity)) > 0
    assert known["wall_thickness"] == {"2 mm"}
    assert known["length"] == {"270 mm"}


def test_schema_accepts_templates_and_partial_files_that_extend():
    for kind in TemplateKind:
        assert the_schema().is_valid(parse(template(kind)))
    assert the_schema().is_valid({"extends": "a.yaml", "excitation": {"frequency": "45 Hz"}, "beam": {"length": 1}})
    assert the_schema().is_valid({"extends": "a.yaml", "run": {"start": "rest"}, "beam": None})


@pytest.mark.parametrize(
    "change",
    [
        "beam.thicknes=1",
        "beam.length=-1",
        "beam.length=long",
        "beam.length=null",
        "beam.elements=2.5",
        "beam.supports.left=clampd",
        "beam.damping={ratio: 1}",
        "excitation.kind=harmonc",
        "excitation=none",
        "snubbers={}",
        "snubbers[0].side=left",
        "run.start=static",
    ],
)
def test_schema_refuses(change):
    data = parse(BASE)
    assert the_schema().is_valid(data)
    path, _, text = change.partition("=")
    target, keys = data, [int(k) if k.isdigit() else k for k in re.findall(r"\w+", path)]
    for key in keys[:-1]:
        target = target[key]
    target[keys[-1]] = parse(text)
    assert not the_schema().is_valid(data)
    if text != "null":
        with pytest.raises(ScenarioError):
            load_scenario(data)


def test_every_key_is_described_with_its_unit():
    schema = the_schema().schema
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    for name, part in schema["$defs"].items():
        if "properties" not in part:
            continue
        for key, item in part["properties"].items():
            assert item.get("description") or key == "extends", f"{name}.{key}"
    beam = schema["$defs"]["Beam"]["properties"]
    assert beam["length"]["description"].endswith("[m]")
    assert beam["width"]["description"].endswith("[m]")
    assert beam["youngs_modulus"]["description"] == "Young's modulus. [Pa]"
    assert schema["$defs"]["Chain"]["properties"]["masses"]["description"].endswith("[kg]")
    assert "from" in schema["$defs"]["SweptSine"]["properties"]
    assert schema["properties"]["beam"]["description"]


# --- the package ---------------------------------------------------------------------------------------------------
