"""`extends` and overrides: one tree over another, and clear refusals."""

from pathlib import Path

import pytest

from beamsim.errors import ScenarioError
from beamsim.scenario import load_scenario
from beamsim.scenario.base import InvalidValueError
from beamsim.scenario.body import RayleighDamping
from beamsim.scenario.connections import SnubberViscousDamping
from beamsim.scenario.excitation import NoExcitation, Step
from beamsim.scenario.parameters import find_parameters
from beamsim.scenario.run import PolynomialStart

pytestmark = pytest.mark.quick

BASE = (Path(__file__).parents[1] / "data" / "examples" / "one_sided_65hz.yaml").read_text()


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "base.yaml").write_text(BASE)
    return tmp_path


def load(folder, text, overrides=(), name="case.yaml"):
    path = folder / name
    path.parent.mkdir(exist_ok=True)
    path.write_text(text)
    return load_scenario(path, overrides)


def problems(call, *arguments):
    with pytest.raises(ScenarioError) as caught:
        call(*arguments)
    return [str(problem) for problem in caught.value.problems]


def test_mappings_merge_and_lists_replace(folder):
    scenario = load(
        folder,
        "extends: base.yaml\nbeam: {thickness: 6 mm, point_masses: []}\nexcitation: {frequency: 45 Hz}\n",
    )
    assert (scenario.beam.thickness, scenario.beam.width, scenario.beam.point_masses) == (0.006, 0.05, ())
    assert (scenario.excitation.frequency, scenario.excitation.level) == (45.0, 2 * 9.80665)


def test_a_mapping_whose_kind_changes_is_replaced_whole(folder):
    scenario = load(folder, "extends: base.yaml\nbeam: {damping: {kind: rayleigh, stiffness: 1 us}}\n")
    assert scenario.beam.damping == RayleighDamping(stiffness=1e-6)
    same = load(folder, "extends: base.yaml\nexcitation: {kind: harmonic, frequency: 45 Hz}\n")
    assert same.excitation.level == 2 * 9.80665


def test_mappings_told_apart_by_their_keys_are_replaced_whole(folder):
    load(folder, "extends: base.yaml\nrun: {start: {mode: 1, amplitude: 1 mm}}\n", name="mode.yaml")
    scenario = load(folder, "extends: mode.yaml\nrun: {start: {displacement: [0, 0, 1]}}\n")
    assert scenario.run.start == PolynomialStart(displacement=(0.0, 0.0, 1.0))


def test_null_takes_away(folder):
    scenario = load(
        folder,
        "extends: base.yaml\nbeam: null\nsnubbers: null\nprobes:\nrun: {spectrum: null}\n"
        "chain: {masses: [1], springs: [1]}\n",
    )
    assert scenario.beam is None
    assert scenario.snubbers == ()
    assert scenario.run.spectrum.last is None


def test_chains_of_extends_start_from_each_files_own_folder(folder):
    load(folder, "extends: ../base.yaml\ntitle: middle\ngravity: 1 g\n", name="sub/middle.yaml")
    scenario = load(folder, "extends: sub/middle.yaml\ntitle: last\n")
    assert (scenario.title, scenario.gravity, scenario.beam.length) == ("last", 9.80665, 0.27)


def test_problems_name_the_file_they_stand_in(folder):
    (folder / "base.yaml").write_text(BASE.replace("thickness: 5 mm", "thickness: -5 mm"))
    found = problems(load, folder, "extends: base.yaml\nbeam: {length: 260 mm}\n")
    assert found[0].startswith(f"{folder / 'base.yaml'}:7: beam.thickness = -5 mm must be positive")
    (folder / "base.yaml").write_text(BASE)
    found = problems(load, folder, "extends: base.yaml\nbeam: {length: 260 mm}\n")
    assert any(f"{folder / 'base.yaml'}:20: snubbers[0].position = 0.27 m lies beyond" in line for line in found)


def test_circles_are_found(folder):
    (folder / "b.yaml").write_text("extends: c.yaml\n")
    (folder / "c.yaml").write_text("title: x\nextends: case.yaml\n")
    (line,) = problems(load, folder, "extends: b.yaml\n")
    assert line.startswith(f"{folder / 'c.yaml'}:2: extends = case.yaml refers back to")
    (line,) = problems(load, folder, "extends: case.yaml\n")
    assert "circle" in line


@pytest.mark.parametrize(
    ("value", "says"),
    [
        ("missing.yaml", "missing.yaml does not exist"),
        ("bse.yaml", "did you mean"),
        (".", "is a folder"),
        ("[a, b]", "must be the path of one file"),
        ("3", "must be the path of one file"),
        ("''", "must be the path of one file"),
    ],
)
def test_what_cannot_be_extended(folder, value, says):
    (line,) = problems(load, folder, f"title: x\nextends: {value}\n")
    assert line.startswith(f"{folder / 'case.yaml'}:2: extends = ")
    assert says in line


def test_a_broken_base_is_located_in_itself(folder):
    (folder / "base.yaml").write_text("beam: {\n")
    (line,) = problems(load, folder, "extends: base.yaml\n")
    assert line.startswith(f"{folder / 'base.yaml'}:")
    (folder / "base.yaml").write_text("")
    (line,) = problems(load, folder, "extends: base.yaml\n")
    assert line.startswith(f"{folder / 'base.yaml'}: is empty")


@pytest.mark.parametrize(
    ("override", "value"),
    [
        ("beam.thickness=4 mm", 0.004),
        ("beam.thickness='4 mm'", 0.004),
        ("beam.thickness = 4e-3", 0.004),
        ({"beam.thickness": "4 mm"}, 0.004),
        ({"beam.thickness": 0.004}, 0.004),
        ({"beam": {"thickness": 0.004}}, 0.004),
    ],
)
def test_overrides_as_text_and_mapping(override, value):
    scenario = load_scenario(BASE, override if isinstance(override, dict) else [override])
    assert scenario.beam.thickness == value
    assert scenario.beam.width == 0.05


def test_overrides_come_after_extends(folder):
    scenario = load(folder, "extends: base.yaml\nbeam: {thickness: 6 mm}\n", ["beam.thickness=4 mm"])
    assert scenario.beam.thickness == 0.004


def test_overrides_reach_into_lists_and_absent_mappings():
    scenario = load_scenario(
        BASE,
        [
            "snubbers[0].gap=0.1 mm",
            "beam.point_masses[1].mass=1 g",
            "reduction.modes=6",
            "snubbers[0].damping.kind=viscous",
            "snubbers[0].damping.coefficient=3",
        ],
    )
    assert scenario.snubbers[0].gap == 0.0001
    assert [mass.mass for mass in scenario.beam.point_masses] == [0.0042, 0.001, 0.0042]
    assert scenario.reduction.modes == 6
    assert scenario.snubbers[0].damping == SnubberViscousDamping(coefficient=3.0)


def test_an_override_of_a_kind_replaces_the_mapping_and_comes_first():
    assert load_scenario(BASE, ["excitation.kind=none"]).excitation == NoExcitation()
    scenario = load_scenario(BASE, ["excitation.applied_to=base", "excitation.level=3 g", "excitation.kind=step"])
    assert scenario.excitation == Step(applied_to="base", level=3 * 9.80665, quantity="acceleration")
    kept = load_scenario(BASE, ["excitation.kind=harmonic"])
    assert kept == load_scenario(BASE)


def test_null_takes_away_what_another_form_does_not_have(folder):
    """A uniform beam becomes one of segments, by overrides and by a file that extends it."""
    segments = "[{from: 0 mm, to: 300 mm, bending_stiffness: 40 N m^2, mass_per_length: 1 kg/m}]"
    uniform = {"beam": {"length": 0.3, "bending_stiffness": 30.0, "mass_per_length": 1.0}}
    without = ["beam.bending_stiffness=null", "beam.mass_per_length=null", f"beam.segments={segments}"]
    for order in (without, without[::-1]):
        assert load_scenario(uniform, order).beam.segments[0].bending_stiffness == 40.0
    (folder / "uniform.yaml").write_text("beam: {length: 0.3, bending_stiffness: 30, mass_per_length: 1}\n")
    (folder / "stepped.yaml").write_text(
        f"extends: uniform.yaml\nbeam: {{bending_stiffness: null, mass_per_length: null, segments: {segments}}}\n"
    )
    assert load_scenario(folder / "stepped.yaml").beam == load_scenario(uniform, without).beam


def test_an_override_of_a_whole_mapping_comes_before_those_of_what_is_in_it():
    for overrides in (
        ["beam.length=1 m", "beam={length: 2 m, width: 9 mm}"],
        ["beam={width: 9 mm}", "beam.length=1 m"],
    ):
        beam = load_scenario(BASE, overrides).beam
        assert (beam.length, beam.width, beam.thickness) == (1.0, 9e-3, 5e-3)


def test_a_file_that_an_override_of_its_section_names_is_not_looked_for_beside_the_case(folder):
    record = "excitation: {kind: sampled, applied_to: base, file: a.csv, unit: g}\n"
    for overrides in (["excitation.file=b.csv"], ["excitation={file: b.csv}"]):
        kept, other = (load(folder, "extends: base.yaml\n" + record, given) for given in ((), overrides))
        assert kept.folder_of("excitation", "file") == folder
        assert other.folder_of("excitation", "file") == Path()


def test_null_in_an_override():
    scenario = load_scenario(BASE, ["run.sample_rate=null", "probes=", "beam.damping=null"])
    assert scenario.sample_rate == 121 * 65.0
    assert scenario.probes == ()
    assert scenario.beam.damping.ratio == 0.0
    assert load_scenario(BASE, {"run.sample_rate": None}).sample_rate == 121 * 65.0


def test_a_start_by_name_gives_way_to_one_by_keys():
    scenario = load_scenario(BASE, ["run.start.mode=1", "run.start.amplitude=1 mm"])
    assert (scenario.run.start.mode, scenario.run.start.amplitude) == (1, 0.001)


CHAIN = """
chain:
  masses: [1, 2]
  springs: [50, 60]
  snubbers: [{name: stop, mass: 1, side: below, stiffness: 900, gap: 1 mm, damping: {kind: ratio, ratio: 0.5}}]
  springs_to_ground: [{mass: 1, kind: cubic, stiffness: 3}]
"""


@pytest.mark.parametrize(
    ("short", "whole"),
    [
        ("snubbers.stop.gap", "chain.snubbers.stop.gap"),
        ("springs_to_ground.ground_spring_1.stiffness", "chain.springs_to_ground.ground_spring_1.stiffness"),
    ],
)
@pytest.mark.parametrize("several", [False, True], ids=["chain", "bodies"])
def test_paths_to_what_a_body_lists_are_named_whole(short, whole, several):
    """A body's snubbers were looked for beside it: `snubbers = {stop: {gap: 1 mm}} must be a list`."""
    text = CHAIN
    if several:
        text = "bodies:\n  one:\n    kind: chain" + CHAIN.removeprefix("\nchain:").replace("\n", "\n  ")
        whole = whole.replace("chain", "bodies.one")
    assert f"{short} does not exist: there is no {short.split('.')[0]}; did you mean {whole}?" in problems(
        load_scenario, text, [f"{short}=2"]
    )
    with pytest.raises(InvalidValueError) as caught:
        find_parameters(load_scenario(text), short)
    assert caught.value.problem(()).remedy == f"did you mean {whole}?"
    # with another of the kind beside the body, and the twin that nothing is called so
    other = "\nsnubbers: [{name: a, at: {mass: 2}, side: above, stiffness: 9, gap: 1}]\n"
    if short.startswith("snubbers"):
        assert any(f"did you mean {whole}?" in line for line in problems(load_scenario, text + other, [f"{short}=2"]))
    assert not any("did you mean chain" in line for line in problems(load_scenario, text, ["snubbers.foot.gap=1"]))


def test_all_bad_overrides_at_once():
    found = problems(load_scenario, BASE, ["a", "b c=1", "snubbers[9].gap=1", "beam.length=}"])
    assert len(found) == 4
    assert not any(line.startswith("<text>") for line in found)  # an override stands in no file


def test_overrides_name_items_of_lists_as_vary_does():
    """`--set` refused `snubbers.tip.gap` and `snubbers[*].gap`, and took the name for a key."""
    assert load_scenario(BASE, ["snubbers.tip.gap=0.1 mm"]).snubbers[0].gap == 1e-4
    assert load_scenario(BASE, ["snubbers[*].gap=0.1 mm"]).snubbers[0].gap == 1e-4
    for name, path in (("hard stop", "snubbers.hard stop.gap"), ("no. 1+", "snubbers[no. 1+].gap")):
        renamed = load_scenario(BASE, [f"snubbers[0].name={name}", f"{path}=0.1 mm"])
        assert renamed.snubbers[0].gap == 1e-4
        assert find_parameters(renamed, path) == [("snubbers", 0, "gap")]
    masses = load_scenario(BASE, ["beam.point_masses[*].mass=1 g"]).beam.point_masses
    assert [mass.mass for mass in masses] == [1e-3] * 3
    nameless = "chain: {masses: [1, 1], springs: [1, 1], snubbers: [&s {mass: 1, side: below, stiffness: 9}, *s]}\n"
    chain = load_scenario(nameless, ["chain.snubbers.snubber_2.gap=3"])  # the name it has by default
    assert [snubber.gap for snubber in chain.chain.snubbers] == [0.0, 3.0]
    again = load_scenario(
        nameless, ["chain.snubbers[*].damping.kind=viscous", "chain.snubbers[*].damping.coefficient=2"]
    )
    assert [snubber.damping.coefficient for snubber in again.chain.snubbers] == [2.0, 2.0]


@pytest.mark.parametrize(
    ("before", "after", "kept", "gone"),
    [
        ("sweep: {kind: continuation, from: 20 Hz, to: 90 Hz}", "sweep: {continue_in: {kind: level, from: 1, to: 2}}",
         ("sweep", "continue_in"), ("sweep", "from_")),
        ("sweep: {kind: continuation, continue_in: {kind: level, from: 1, to: 2}}", "sweep: {from: 20 Hz, to: 90 Hz}",
         ("sweep", "to"), ("sweep", "continue_in")),
        ("run: {spectrum: {last: 0.2 s}}", "run: {spectrum: {periods: 5}}",
         ("run", "spectrum", "periods"), ("run", "spectrum", "last")),
        ("beam: {width: 50 mm}", "beam: {section: {kind: tube, outer_diameter: 20 mm, wall_thickness: 2 mm}}",
         ("beam", "section"), ("beam", "width")),
    ],
)  # fmt: skip
def test_a_key_replaces_inherited_ones_that_it_excludes(folder, before, after, kept, gone):
    """`extends` kept the `from` and `to` of the parent beside `continue_in`, and refused both."""

    def value(scenario, path):
        for name in path:
            scenario = getattr(scenario, name)
        return scenario

    (folder / "before.yaml").write_text(f"extends: base.yaml\n{before}\n")
    scenario = load(folder, f"extends: before.yaml\n{after}\n")
    assert value(scenario, kept) is not None
    assert value(scenario, gone) is None
    key, _, text = after.partition(": ")
    inner, _, text = text.strip("{}").partition(": ") if key != "run" else ("spectrum", "", "{periods: 5}")
    if inner != "from":
        whole = text + "}" * (text.count("{") - text.count("}"))
        assert value(load(folder, "extends: before.yaml\n", [f"{key}.{inner}={whole}"]), kept) is not None


def test_both_of_two_alternatives_in_one_place_are_refused(folder):
    for text, overrides in (
        ("extends: base.yaml\nrun: {spectrum: {last: 0.1 s, periods: 5}}\n", ()),
        ("extends: base.yaml\n", ["run.spectrum.last=0.1 s", "run.spectrum.periods=5"]),
        ("extends: base.yaml\n", ["run.spectrum.periods=5", "run.spectrum.last=0.1 s"]),
        ("extends: base.yaml\n", ["snubbers.tip.gap=0", "snubbers.tip.preload=1 N"]),
    ):
        assert any("exclude each other" in line for line in problems(load, folder, text, overrides))
    assert load(folder, "extends: base.yaml\n", ["snubbers.tip.preload=1 N"]).snubbers[0].preload == 1.0


def test_a_section_that_a_command_does_not_use_never_stops_it(folder):
    """A parent's `sweep` stopped `run` with an excitation that is not swept."""
    (folder / "swept.yaml").write_text(
        "extends: base.yaml\nsweep: {kind: swept_sine, from: 20, to: 90, rate: 2 oct/min}\n"
    )
    text = "extends: swept.yaml\nexcitation: {kind: half_sine, applied_to: base, level: 20 g, duration: 11 ms}\n"
    (folder / "case.yaml").write_text(text)
    with pytest.raises(ScenarioError, match="needs the frequency of a harmonic excitation"):
        load_scenario(folder / "case.yaml")
    for command in ("run", "nnm", "identify-stiffness"):
        scenario = load_scenario(folder / "case.yaml", command=command)
        assert scenario.sweep is None
        (warning,) = [text for text in scenario.warnings if "left out" in text]
        assert warning.startswith(f"left out, since {command} does not use it: {folder / 'swept.yaml'}:2: sweep needs")
    with pytest.raises(ScenarioError, match="needs the frequency"):
        load_scenario(folder / "case.yaml", command="sweep")
    # also where a section's fault is seen elsewhere, and where its keys are wrong
    for section in ("nnm: {mode: 1, phase_resonance: {}}", "vary: {kind: gird}", "identify_stiffness: {snuber: tip}"):
        (folder / "case.yaml").write_text(f"extends: base.yaml\nexcitation: {{kind: none}}\n{section}\n")
        assert load_scenario(folder / "case.yaml", command="run").run is not None
        with pytest.raises(ScenarioError):
            load_scenario(folder / "case.yaml")
    # what the command uses is still checked
    (folder / "case.yaml").write_text("extends: base.yaml\nbeam: {length: -1}\nvary: {kind: gird}\n")
    assert problems(lambda: load_scenario(folder / "case.yaml", command="run"))[0].endswith("for example 270 mm")
