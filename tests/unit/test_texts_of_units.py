"""Units in printed numbers, and remedies that fit what was written."""

import numpy as np
import pytest

from beamsim.errors import ScenarioError
from beamsim.plots.style import level_text, scale_for
from beamsim.scenario import load_scenario
from beamsim.scenario.units import LENGTH, UnitError, read_quantity

pytestmark = pytest.mark.quick

CHAIN = "chain: {masses: [1, 1], springs: [1, 1]}\n"


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.4801, "kg", "480.1 g"),  # was 480.1 mkg
        (4.2e-6, "kg", "4.2 mg"),
        (12.5, "kg", "12.5 kg"),
        (0.05, "kg/m", "50 g/m"),
        (0.0123, "m", "12.3 mm"),
        (151100.0, "N/m", "151.1 kN/m"),
        (2.5e-4, "m^2", "250 mm^2"),  # was 250 µm^2, and the next 520.8 pm^4
        (520.8e-12, "m^4", "520.8 mm^4"),
        (2000.0, "1/s", "2000 1/s"),  # was 2 k1/s
    ],
)
def test_prefixes(value, unit, text):
    scale = scale_for(unit, np.array([value]))
    assert f"{value * scale.factor:.4g} {scale.unit}" == text


def test_levels_have_units():
    assert level_text(19.6133, "m/s^2") == "level 2 g"
    assert level_text(0.25, "N") == "level 250 mN"
    assert level_text(0.5, "") == "level 0.5"
    swept = "sweep: {kind: swept_sine, from: 1, to: 9, rate: 1 Hz/s, levels: [1, 2]%s}\n"
    force = CHAIN + "excitation: {kind: harmonic, applied_to: {mass: 1}, level: 1 N, frequency: 1 Hz}\n"
    assert load_scenario(force + swept % "").level_unit == "N"
    assert load_scenario(force + swept % ", profile: [{frequency: 1, level: 2}]").level_unit == ""
    assert load_scenario(force.replace("{mass: 1}", "base").replace("1 N", "1 mm")).level_unit == "m"


@pytest.mark.parametrize("path", ["snubbers[0].gap", "beam.point_masses[*].mass", "chain.masses[1]"])
def test_a_path_with_brackets_in_flow_style_needs_quotes(path):
    text = CHAIN + "vary: {kind: grid, parameters: [{path: %s, values: [1, 2]}]}\n"
    with pytest.raises(ScenarioError) as caught:
        load_scenario(text % path)
    assert caught.value.problems[0].remedy == f'quote a path with brackets: "{path}"'
    assert caught.value.problems[0].line == 2
    with pytest.raises(ScenarioError) as caught:  # other faults keep their remedy
        load_scenario("chain: {masses: [1}\n")
    assert caught.value.problems[0].remedy.startswith("is the [ of line 1 closed")


def test_mil_is_an_angle():
    with pytest.raises(UnitError) as caught:
        read_quantity("200 mil", LENGTH)
    assert caught.value.remedy == "mil is an angle here; give thousandths of an inch as 200 thou or 0.2 in"
    assert read_quantity("200 thou", LENGTH) == pytest.approx(0.2 * 25.4e-3)
    assert read_quantity("0.2 in", LENGTH) == pytest.approx(0.2 * 25.4e-3)
