"""A result that is written and read says the same, and so does what its scenario gives when it is computed again.

A study is the runs of its cases, and an ensemble of the same draws is that study.
"""

import numpy as np
import pytest

import beamsim

pytestmark = pytest.mark.portable

CASE = """\
beam: {length: 27 cm, width: 50 mm, thickness: 5 mm, youngs_modulus: 69 GPa, density: 2.7 g/cm^3, elements: 4,
  damping: {kind: rayleigh, ratios: [{frequency: 20 Hz, ratio: 2 %}, {frequency: 200 Hz, ratio: 3 %}]}}
snubbers:
- {name: tip, position: 100 %, side: below, stiffness: 0.1 kN/mm, gap: 20 um, damping: {kind: ratio, ratio: 4 %}}
- {name: inner, position: 15 cm, side: both, stiffness: 30 kN/m, gap: 0.1 mm}
gravity: 1 g
constant_forces: [{line: [20 %, 20 cm], force_per_length: 3 N/m}]
excitation: {kind: harmonic, applied_to: base, level: 2 g, frequency: 4000 rpm}
outputs: [{name: moment, kind: bending_moment, at: {position: 40 %}}]
run: {duration: 40 ms, convergence: "off"}
"""

SHORT = "from: 60 Hz, to: 4000 rpm, convergence: 'off', impacts: true"
SECTIONS = {
    "run": "",
    "swept": f"sweep: {{kind: swept_sine, {SHORT}, rate: 90 oct/min}}",
    "stepped": f"sweep: {{kind: stepped, {SHORT}, points: 2, most_cycles: 40}}",
    "continuation": "sweep: {kind: continuation, from: 60 Hz, to: 62 Hz, side_branches: none}",
    "nnm": "nnm: {mode: 1, continue_in: {kind: energy, from: 1 uJ, to: 10 uJ}}",
    "study": "vary: {kind: grid, parameters: [{path: snubbers.tip.gap, values: [0 mm, 30 um]}, "
             "{path: snubbers.tip.position, values: [90 %, 25 cm]}]}",
}  # fmt: skip
COMMANDS = {"swept": "sweep", "stepped": "sweep", "study": "design_study"}
OF_THE_CLOCK = ("processor_time_s", "memory_bytes")


def computed(scenario, name):
    return getattr(beamsim, COMMANDS.get(name, name))(scenario)


def flat(value, path=""):
    """Path and value of all numbers and words of a summary."""
    if isinstance(value, dict):
        parts = [(f"{path}/{key}", part) for key, part in value.items() if key not in OF_THE_CLOCK]
    elif isinstance(value, (list, tuple, np.ndarray)):
        parts = [(f"{path}/{k}", part) for k, part in enumerate(value)]
    else:
        return {path: None if value != value else value}  # both are null in a file
    return {at: leaf for where, part in parts for at, leaf in flat(part, where).items()}


def same(one, other):
    return bool(np.isclose(one, other, rtol=1e-11, atol=0))


def apart(one, other):
    """Paths of what differs by more than round-off."""
    one, other = flat(one), flat(other)
    both = [(at, one[at], other[at]) for at in one.keys() & other.keys()]
    alike = [at for at, a, b in both if a == b or (isinstance(a, float) and isinstance(b, float) and same(a, b))]
    return sorted((one.keys() | other.keys()) - set(alike))


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", SECTIONS)
def test_a_result_that_is_written_read_and_computed_again(name, tmp_path):
    case = CASE if name != "nnm" else CASE.replace("damping: {kind: ratio, ratio: 4 %}", "").replace("gravity: 1 g", "")
    result = computed(beamsim.load_scenario(f"{case}\n{SECTIONS[name]}\n"), name)
    opened = beamsim.load(beamsim.write_result(result, tmp_path / "result.h5"))
    assert len(flat(result.summary)) > 10
    assert apart(opened.summary, result.summary) == []
    assert apart(computed(opened.scenario, name).summary, result.summary) == []


def test_a_study_is_the_runs_of_its_cases_and_an_ensemble_of_the_same_draws():
    text = f"{CASE}\n{SECTIONS['study']}\n"
    study = beamsim.design_study(beamsim.load_scenario(text))
    draws = {"snubbers.tip.gap": [0.0, 0.0, 3e-5, 3e-5], "snubbers.tip.position": [0.9 * 0.27, 0.25] * 2}
    together = beamsim.ensemble(beamsim.load_scenario(CASE), draws)
    words = [(gap, place) for gap in ("0 mm", "30 um") for place in ("90 %", "25 cm")]
    for k, (gap, place) in enumerate(words):
        edited = {"snubbers.tip.gap": gap, "snubbers.tip.position": place}
        alone = beamsim.run(beamsim.load_scenario(CASE, edited)).summary
        for name, of in (("snubbers/tip/peak_force", alone["peak_force_n"]["tip"]),
                         ("outputs/moment/peak_output", alone["peak_output"]["moment"])):  # fmt: skip
            found = [np.ravel(np.asarray(each.responses[name].values))[k] for each in (study, together)]
            np.testing.assert_allclose(found, of, rtol=1e-9, err_msg=name)


def test_a_scenario_that_is_another_gives_another_result():
    """Twin: what is compared sees a millionth of the stiffness of a stop."""
    one, other = (beamsim.run(beamsim.load_scenario(CASE, {"snubbers.tip.stiffness": k})) for k in (1e5, 1.000001e5))
    assert apart(one.summary, other.summary)
