"""Bad input of every sort: located, with a remedy, and all of it at once."""

from pathlib import Path

import pytest
from pydantic import ValidationError

from beamsim.errors import ScenarioError
from beamsim.scenario import Beam, Scenario, Snubber, load_scenario

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
    ("override", "says"),
    [
        # keys
        ("beam.thicknes=4 mm", "beam.thicknes is not a known key; did you mean thickness?"),
        ("beam.e_modulus=1", "beam.e_modulus is not a known key; did you mean youngs_modulus?"),
        ("beam.colour=1", "beam.colour is not a known key; known keys: length, elements"),
        ("beam.thickness_mm=1", "beam.thickness_mm is not a known key; did you mean thickness?"),
        ("beam.ratio=1 %", "beam.ratio is not a known key; it belongs in damping"),
        ("gap=1 mm", "gap is not a known key; it belongs in snubbers or limits"),
        ("plate={thickness: 3 mm}", "plate is not a known key; write bodies: {NAME: {kind: plate, ...}}"),
        ("half_sine={level: 20 g}", "half_sine is not a known key; write excitation: {kind: half_sine, ...}"),
        ("E=70 GPa", "E is not a known key; known keys: title, beam"),
        (
            "beam.damping={kind: modal, ratio: 0,5 %}",
            "beam.damping[5 %] is not a known key; a comma separates keys: write dec",
        ),
        ("beam.damping={kind: modal, ratio:0.5}", "write a space after the colon: ratio: 0.5"),
        ("excitation={kind: none, level: 1}", "excitation.level is not a known key; this kind has no other keys"),
        ("beam.length=null", "beam.length is missing; give for example length: 270 mm"),
        ("snubbers=[{position: 0.1, stiffness: 1}]", "snubbers[0].side is missing; give side: below or above"),
        ("probes=[{position: 0.1}]", "probes[0].name is missing"),
        # values
        ("beam.length=5 kg", "beam.length = 5 kg must be a length, not a mass; write for example 270 mm"),
        ("beam.length=5 furlogs", "beam.length = 5 furlogs has the unit 'furlogs', which is not known"),
        ("beam.length=0", "beam.length = 0 must be positive"),
        ("beam.length=.nan", "beam.length = nan must be finite"),
        ("beam.length=true", "beam.length = true must be a number"),
        ("beam.elements=2.5", "beam.elements = 2.5 must be a whole number"),
        ("beam.damping.ratio=-1 %", "beam.damping.ratio = -1 % must not be negative"),
        (
            "beam.damping={kind: modal, ratio: [1 %, 2 deg]}",
            "beam.damping.ratio[1] = 2 deg must be a ratio, not an angle",
        ),
        (
            "beam.damping={kind: viscous, coefficient: 3 N s/m}",
            "must be a viscous coefficient per unit length, not a dashpot",
        ),
        (
            "beam.supports.left=clampd",
            "beam.supports.left = clampd is not one of clamped, pinned, free, guided; did you mean clamped?",
        ),
        ("snubbers[0].side=left", "snubbers[0].side = left is not one of below, above"),
        ("probes=[{name: a/b, position: 0.1}]", "probes[0].name = a/b is not a usable name"),
        ("title=[1]", "title = [1] must be text"),
        ("reduction.modes=alle", "write a number of modes, 1 or more, or all"),
        ("excitation.frequency=2 oct/min", "excitation.frequency = 2 oct/min is a sweep rate"),
        # shapes
        ("beam=5", "beam = 5 must be a mapping; its keys are length, elements"),
        ("snubbers=5", "snubbers = 5 must be a list"),
        ("snubbers[0]=3", "snubbers[0] = 3 must be a mapping"),
        ("excitation=none", "excitation = none must be a mapping with a kind; write {kind: none, ...}"),
        ("excitation={level: 2 g, kind: null}", "excitation has no kind; give kind: none, harmonic"),
        ("excitation.kind=harmonc", "excitation.kind = harmonc is not one of none, harmonic"),
        ("beam.damping=1 %", "beam.damping = 1 % must be a mapping with a kind"),
        # sections
        (
            "beam={width: 50 mm, section: {kind: tube, outer_diameter: 20 mm, wall_thickness: 2 mm}}",
            "beam.section is given together with width",
        ),
        ("beam.width=null", "beam.width is missing; give width and thickness"),
        ("beam={width: null, thickness: null}", "beam has no cross-section"),
        (
            "beam={width: null, thickness: null, section: {kind: tube, outer_diameter: 1, wall_thickness: 3}}",
            "beam.section.wall_thickness = 3 m is more than half of outer_diameter = 1 m",
        ),
        # structure
        ("chain={masses: [1], springs: [1]}", "chain and beam exclude each other"),
        ("beam=null", "the scenario has no structure"),
        (
            "beam={elements: 1, supports: {right: clamped}, point_masses: []}",
            "beam.elements = 1 leaves no degree of freedom",
        ),
        # places
        ("snubbers[0].position=-1 mm", "snubbers[0].position = -1 mm must not be negative"),
        ("snubbers[0].position=0", "snubbers[0].position = 0 m is the clamped left end, which cannot deflect"),
        ("beam.supports.right=pinned", "snubbers[0].position = 0.27 m is the pinned right end"),
        ("probes[1].mass=1", "probes[1].mass and position exclude each other"),
        ("probes=[{name: a}]", "probes[0] names no place"),
        ("probes=[{name: a, mass: 1}]", "probes[0].mass applies to a chain, but the structure is a beam"),
        ("beam.length=0.26999999", "snubbers[0].position = 0.27 m lies beyond beam.length = 0.26999999 m"),
        ("probes[1].name=tip", "probes[1].name = tip is already the name of probes[0]"),
        # excitation
        ("excitation.applied_to=bas", "excitation.applied_to = bas names neither the base nor a point"),
        ("excitation={applied_to: {mass: 1}, level: 1 N}", "excitation.applied_to.mass applies to a chain"),
        (
            "excitation.applied_to={position: 0.1}",
            "excitation.level is an acceleration, but a point takes a force",
        ),
        ("excitation.level=3 N", "excitation.level is a force, but the base moves and takes no force"),
        (
            "excitation.level=3 s",
            "a force per length, a pressure, an angular acceleration, an angular velocity or a rotation, not a time",
        ),
        (
            "excitation.quantity=velocity",
            "excitation.level is given in a unit of acceleration, where a velocity is meant",
        ),
        ("excitation={quantity: force, level: 1}", "excitation.quantity is a force, but the base moves"),
        (
            "excitation={kind: step, applied_to: base, level: 1 mm}",
            "step of the base's displacement, which needs an infinite",
        ),
        (
            "excitation={kind: step, applied_to: base, level: 1 m/s}",
            "step of the base's velocity, which needs an infinite",
        ),
        (
            "excitation={kind: half_sine, applied_to: base, level: 1 mm, duration: 5 ms}",
            "excitation.level is a half-sine pulse of the base's displacement",
        ),
        ("excitation={kind: multi_tone, applied_to: base, tones: []}", "excitation.tones is an empty list"),
        (
            "excitation={kind: multi_tone, applied_to: base, tones: [{level: 1 g, frequency: 5}, "
            "{level: 1 mm, frequency: 7}]}",
            "excitation.tones[1].level is given in a unit of displacement, where an acceleration is meant",
        ),
        (
            "excitation={kind: harmonic, applied_to: {position: 0}, level: 1 N, frequency: 5}",
            "a force has no effect there",
        ),
        # run
        (
            "run.sample_rate=129 Hz",
            "run.sample_rate = 129 Hz is under twice the excitation frequency of 65 Hz; use at least 130 Hz",
        ),
        ("run.duration=1e9", "samples, over the limit of 5e+07"),
        (
            "run={duration: 4000 s, spectrum: null}",
            "over run.duration = 4000 s gives 8e+07 samples, over the limit of 5e+07",
        ),
        (
            "sweep={kind: swept_sine, from: 20, to: 400, rate: 2 oct/min, history_rate: 1 MHz}",
            "sweep.history_rate = 1e+06 Hz over 129.658 s gives 1.3e+08 samples, over the limit of 5e+07",
        ),
        ("run.spectrum.last=2 s", "run.spectrum.last = 2 s is longer than run.duration = 0.8 s"),
        ("run.spectrum={last: 0.1, periods: 5}", "run.spectrum.periods and last exclude each other"),
        ("run.spectrum={last: null, periods: 100}", "run.spectrum.periods = 100 periods of 65 Hz take 1.53846 s"),
        ("run.start=static", "run.start = static is not an initial state; write static_equilibrium, rest"),
        ("run.start={mode: 1}", "run.start.amplitude is missing; give for example amplitude: 1 mm"),
        ("run.start={mode: 1, displacement: [0]}", "run.start.mode is not a known key"),
        ("run.start={displacement: [], velocity: []}", "run.start is an empty initial state"),
        ("run.start={displacement: [1 N]}", "run.start.displacement[0] = 1 N must be a displacement, a slope"),
        ("run.start={displacement: [1]}", "has the deflection 1 at the clamped left end, where it must be 0"),
        ("run.start={displacement: [0, 1]}", "has the slope 1 at the clamped left end, where it must be 0"),
        ("run.start={velocity: [0, 1]}", "has the slope velocity 1 at the clamped left end"),
        (
            "run.start={released_force: {position: 0, force: 3}}",
            "run.start.released_force.position = 0 m is the clamped left",
        ),
        ("reduction={modes: 6, highest_frequency: 5}", "reduction.highest_frequency and modes exclude each other"),
        # later commands
        ("sweep={kind: swept_sine, from: 20, to: 400, rate: 2}", "sweep.rate = 2 needs a unit"),
        ("sweep={kind: swept_sine, from: 20, to: 400, rate: 0 oct/min}", "sweep.rate = 0 oct/min must be positive"),
        (
            "sweep={kind: swept_sine, from: 20, to: 20, rate: 2 oct/min}",
            "sweep.to = 20 Hz equals the start of the sweep",
        ),
        ("sweep={kind: swept_sine, from: 40, to: 20, rate: 2 Hz/s}", "sweep.to = 20 Hz lies below sweep.from = 40 Hz"),
        ("sweep={kind: continuation, from: 5, to: 9, levels: [1 N]}", "sweep.levels[0] is a level of force"),
        (
            "identify_stiffness={snubber: tp, measured_with: [3]}",
            "identify_stiffness.snubber = tp is an unknown snubber; did you mean tip?",
        ),
        ("identify_stiffness={snubber: tip, measured_with: [3, 2]}", "measured_with[1] = 2 Hz does not lie above"),
        (
            "identify_stiffness={snubber: tip, measured_with: [3], fit_to: [2]}",
            "fit_to[0] = 2, but measured_with has 1",
        ),
        ("nnm={mode: 1, energy: 1 J, continue_in: {kind: energy, from: 1, to: 2}}", "nnm.energy cannot be held"),
        ("nnm={mode: 1, continue_in: {kind: frequency, from: 1, to: 1}}", "nnm.continue_in.to = 1 Hz equals the start"),
    ],
)
def test_on_a_beam(override, says):
    assert any(says in line for line in problems(BASE, [override]))


@pytest.mark.parametrize(
    ("override", "says"),
    [
        ("chain.springs=[1]", "chain.springs has 1 value for 3 masses; give 4"),
        ("chain.springs=[1, 1, -1]", "chain.springs[2] = -1 must not be negative"),
        ("chain.dashpots=[1, 1]", "chain.dashpots has 2 values for 3 springs"),
        ("chain.damping={kind: viscous, coefficient: 1}", "chain.damping.kind = viscous is not one of modal, rayleigh"),
        (
            "chain.snubbers[0].mass=4",
            "chain.snubbers[0].mass = 4, but the chain has 3 masses; masses are numbered from 1 to 3",
        ),
        ("chain.snubbers[0].position=1", "chain.snubbers[0].mass and position exclude each other"),
        ("chain.springs_to_ground=[{mass: 4, kind: cubic, stiffness: 1}]", "chain.springs_to_ground[0].mass = 4, but"),
        (
            "chain.springs_to_ground=[{mass: 1, kind: cubic, stiffness: 1 N/m}]",
            "must be a cubic stiffness, not a stiffness",
        ),
        ("chain.springs_to_ground=[{mass: 1, kind: quartic, stiffness: 1}]", "is not one of linear, cubic"),
        (
            "chain.springs_to_ground=[{mass: 1, stiffness: 1}]",
            "has no kind; give kind: linear, cubic or piecewise_linear",
        ),
        (
            "excitation.applied_to={position: 1}",
            "excitation.applied_to.position applies to a beam, but the structure is a chain",
        ),
        ("probes=[{name: a, position: 1}]", "probes[0].position applies to a beam"),
        (
            "snubbers=[{position: 1, side: above, stiffness: 1}]",
            "snubbers[0].position applies to a beam, but the structure is a chain; give a mass by its number",
        ),
        ("run.start={displacement: [1, 2]}", "run.start.displacement has 2 numbers for 3 masses"),
        ("run.start={mode: 4, amplitude: 1}", "run.start.mode = 4, but a chain of 3 masses has 3 modes"),
        ("nnm.mode=4", "nnm.mode = 4, but a chain of 3 masses has 3 modes"),
        ("run.sample_rate=0.05", "run.sample_rate = 0.05 Hz gives only one sample"),
        (
            "chain.snubbers=[{mass: 1, side: above, stiffness: 1}, "
            "{mass: 2, side: above, stiffness: 1, name: snubber_1}]",
            "chain.snubbers[1].name = snubber_1 is already the name of chain.snubbers[0]",
        ),
    ],
)
def test_on_a_chain(override, says):
    assert any(says in line for line in problems(CHAIN, [override]))


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
    assert one(tmp_path).startswith(f"{tmp_path}: is a directory")
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


PLATE = """\
bodies:
  panel:
    kind: plate
    length: 400 mm
    width: 200 mm
    thickness: 3 mm
    youngs_modulus: 70 GPa
    poissons_ratio: 0.33
    density: 2700 kg/m^3
    supports: {left: clamped}
snubbers: [{name: s, at: {body: panel, position: [50 %, 100 %]}, side: below, stiffness: 1 kN/m}]
"""


def test_a_share_of_a_length_is_no_second_fault_of_a_body_that_has_one():
    assert "density = -2700 kg/m^3 must be positive" in one(PLATE.replace("2700", "-2700"))


def test_a_material_without_resistance_to_pressure():
    assert "poissons_ratio = 0.6 is above 0.5" in one(PLATE.replace("0.33", "0.6"))


def test_a_node_of_a_plate_is_said_how_points_are_named():
    line = one(PLATE.replace("position: [50 %, 100 %]", "node: 3"))
    assert "applies to imported matrices, but bodies.panel is a plate" in line
    assert "position: [270 mm, 100 mm] on a plate" in line
