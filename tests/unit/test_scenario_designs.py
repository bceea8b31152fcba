"""`vary:` and `limits:` read, resolved and refused."""

import pytest

from beamsim.errors import ScenarioError
from beamsim.scenario import load_scenario
from beamsim.scenario.parameters import varied_parameters

pytestmark = pytest.mark.quick

BASE = """\
title: Small study
beam: {length: 270 mm, width: 50 mm, thickness: 5 mm, youngs_modulus: 69 GPa, density: 2700, elements: 4,
  point_masses: [{position: 100 mm, mass: 4 g}, {position: 200 mm, mass: 5 g}]}
snubbers: [{name: tip, position: 270 mm, side: below, stiffness: 151.1 kN/m, gap: 0 mm}]
excitation: {kind: harmonic, applied_to: base, level: 2 g, frequency: 65 Hz}
run: {duration: 0.05 s}
"""
STIFFNESS = "{path: snubbers.tip.stiffness, values: [50 kN/m, 100 kN/m]}"


def study(*parameters, kind="grid", extra="", base=BASE):
    lines = "".join(f"    - {parameter}\n" for parameter in parameters)
    return f"{base}vary:\n  kind: {kind}\n{extra}  parameters:\n{lines}"


def resolved(*parameters, **options):
    return varied_parameters(load_scenario(study(*parameters, **options)))


def refused(text):
    with pytest.raises(ScenarioError) as caught:
        load_scenario(text)
    problems = caught.value.problems
    assert all(problem.remedy and problem.line for problem in problems), problems
    return "\n".join(str(problem) for problem in problems)


def test_values_are_read_by_the_field_they_are_meant_for():
    stiffness, support, level, mass = resolved(
        STIFFNESS,
        "{path: beam.supports.right, values: [free, pinned]}",
        "{path: excitation.level, from: 1 g, to: 20, points: 3}",
        "{path: 'beam.point_masses[*].mass', values: [1 g, 0.002]}",
    )
    assert stiffness.values == (50e3, 100e3)
    assert stiffness.unit == "N/m"
    assert support.values == ("free", "pinned")
    assert (level.low, level.high, level.unit) == (9.80665, 20.0, "m/s^2")
    assert mass.values == (0.001, 0.002)  # g is gram here
    assert mass.places == (("beam", "point_masses", 0, "mass"), ("beam", "point_masses", 1, "mass"))


def test_one_parameter_may_drive_several_numbers():
    (axis,) = resolved("{path: 'beam.point_masses[0].mass', also: ['beam.point_masses[1].mass'], values: [1 g, 2 g]}")
    assert len(axis.places) == 2


def test_sweep_rates_keep_their_unit():
    base = BASE + "sweep: {kind: swept_sine, from: 20 Hz, to: 90 Hz, rate: 2 oct/min}\n"
    (axis,) = resolved("{path: sweep.rate, values: [1.5 oct/min, 3 Hz/s]}", base=base)
    assert axis.values == ("0.025 oct/s", "3.0 Hz/s")
    text = study("{path: sweep.rate, from: 1 oct/min, to: 2 oct/min, points: 2}", base=base)
    assert "is a choice, which has no range" in refused(text)


@pytest.mark.parametrize(
    ("path", "tolerance", "half"),
    [
        ("beam.thickness", "2 %", 1e-4),
        ("beam.thickness", "0.1 mm", 1e-4),
        ("excitation.level", "0.1 g", 0.980665),
        ("snubbers.tip.gap", "0.05 mm", 5e-5),
    ],
)
def test_tolerances_are_relative_in_percent_and_absolute_in_units(path, tolerance, half):
    (axis,) = resolved(f"{{path: {path}, tolerance: {tolerance}}}")
    assert 0.5 * (axis.high - axis.low) == pytest.approx(half, rel=1e-12)
    assert 0.5 * (axis.high + axis.low) == pytest.approx(axis.nominal, abs=1e-15)


@pytest.mark.parametrize("kind", ["grid", "zip", "latin_hypercube"])
def test_the_resolved_text_loads_to_the_same_study(kind):
    extra = "  samples: 5\n  seed: 3\n" if kind == "latin_hypercube" else ""
    points = "" if kind == "latin_hypercube" else ", points: 2"
    text = study(
        f"{{path: beam.thickness, from: 4 mm, to: 6 mm{points}, spacing: logarithmic}}",
        f"{{path: beam.density, tolerance: 1 %{points}}}",
        kind=kind,
        extra=extra,
    )
    scenario = load_scenario(text + "limits: {peak_force: 50 N, bending_stress: 80 MPa, gap: 1 mm}\n")
    again = load_scenario(scenario.to_yaml())
    assert again == scenario
    assert varied_parameters(again) == varied_parameters(scenario)
    assert scenario.limits.given == {"peak_force": 50.0, "bending_stress": 80e6, "gap": 1e-3}


def test_a_grid_of_ten_million_cases_is_refused_without_being_built():
    text = refused(
        study(
            "{path: beam.thickness, from: 4 mm, to: 6 mm, points: 10000}",
            "{path: snubbers.tip.gap, from: 0, to: 1 mm, points: 1000}",
        )
    )
    assert "vary asks for 1e+07 cases (at most 200 000 are computed)" in text
    assert "latin_hypercube" in text


def test_limits_of_what_the_structure_does_not_have():
    chain = (
        "chain: {masses: [1, 1], springs: [1, 1, 1]}\n"
        "excitation: {kind: harmonic, applied_to: {mass: 1}, level: 1 N, frequency: 1 Hz}\n"
        "limits: {bending_stress: 1 MPa, gap: 1 mm}\n"
    )
    text = refused(chain)
    assert "limits.bending_stress applies to a beam" in text
    assert "limits.gap limits the snubbers, and there are none" in text
