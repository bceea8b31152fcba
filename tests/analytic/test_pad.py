"""`beamsim pad`: what it prints runs as it stands and does what was asked for; every way back."""

import json

import numpy as np
import pytest

import beamsim
from beamsim.analyses.pad import angle, block_modulus, block_stiffness, contact_time, damping_ratio, restitution
from beamsim.scenario import load_scenario
from tests.helpers.commands import invoke

MASS, SPEED = 0.05, 0.4  # kg, m/s
IMPACT = ["--mass", "50 g", "--speed", "0.4 m/s"]
CHAIN = """
extends: pad.yaml
chain: {masses: [50 g], springs: [1e-6]}
probes: [{name: m, mass: 1}]
run: {duration: 40 ms, sample_rate: 10 kHz, convergence: off, impacts: {}, start: {displacement: [0], velocity: [-0.4]}}
"""


def pad(*arguments):
    outcome = invoke("pad", *arguments)
    return outcome.exit_code, outcome.stdout, outcome.stderr


def numbers(*arguments):
    code, out, errors = pad(*arguments, "--json")
    assert code == 0, errors
    return json.loads(out)


def simulated(folder, *arguments):
    """The impact of the mass on the pad that was printed."""
    code, out, errors = pad(*arguments, "--on-mass", 1)
    assert code == 0, errors
    (folder / "pad.yaml").write_text(out)
    (folder / "case.yaml").write_text(CHAIN)
    impacts = beamsim.run(load_scenario(folder / "case.yaml")).impacts
    assert impacts.begin.size == 1
    return impacts


@pytest.mark.parametrize("law", [[], ["--no-tension"]])
@pytest.mark.parametrize("value", [0.9, 0.5, 0.05])
def test_a_restitution_is_seen_in_the_simulation(tmp_path, law, value):
    arguments = ["--stiffness", "150 kN/m", "--restitution", value, *IMPACT, *law]
    known, impacts = numbers(*arguments), simulated(tmp_path, *arguments)
    assert impacts.restitution[0] == pytest.approx(value, rel=1e-8)
    assert known["restitution"] == pytest.approx(value, rel=1e-12)
    assert impacts.contact_time[0] == pytest.approx(known["contact_time"], rel=1e-8)
    assert impacts.peak_force[0] == pytest.approx(known["peak_force"], rel=1e-8)
    assert impacts.energy_lost[0] == pytest.approx(0.5 * MASS * SPEED**2 * (1 - value**2), rel=1e-7)


@pytest.mark.parametrize("law", [[], ["--no-tension"]])
def test_a_contact_time_is_seen_in_the_simulation(tmp_path, law):
    impacts = simulated(tmp_path, "--contact-time", "3 ms", "--restitution", 0.6, *IMPACT, *law)
    assert impacts.contact_time[0] == pytest.approx(3e-3, rel=1e-8)
    assert impacts.restitution[0] == pytest.approx(0.6, rel=1e-8)


def test_the_largest_penetration_by_samples(tmp_path):
    arguments = ["--stiffness", "15 kN/m", "--dashpot", "20 N s/m", *IMPACT, "--no-tension"]
    known = numbers(*arguments)
    simulated(tmp_path, *arguments)
    case = load_scenario(tmp_path / "case.yaml", ["run.sample_rate=2 MHz"])
    deepest = beamsim.run(case).snubbers["pad"].penetration.max()
    assert deepest == pytest.approx(known["penetration"], rel=1e-6)


def test_the_closed_forms_and_their_inverses():
    assert angle(1.0 - 2e-5) == pytest.approx(angle(1.0 - 1e-6), rel=1e-5)
    assert angle(1.0 + 1.01e-5) == pytest.approx(1.0 - 1.01e-5 / 3.0, rel=1e-9)
    for value in (1.0, 0.999, 0.7, np.exp(-2.0), 0.1, 1e-4):
        assert restitution(damping_ratio(value, "no_tension"), "no_tension") == pytest.approx(value, rel=1e-9)
        assert restitution(damping_ratio(value, "kelvin_voigt"), "kelvin_voigt") == pytest.approx(value, rel=1e-12)
    assert contact_time(0.0, 2.0, "no_tension") == contact_time(0.0, 2.0, "kelvin_voigt") == np.pi / 2.0
    assert np.isnan(restitution(1.0, "kelvin_voigt"))
    block = {"area": 4e-4, "height": 6e-3, "shape_factor": 0.8, "factor": 0.7, "bulk": 1.1e9}
    assert block_modulus(block_stiffness(5e6, **block), **block) == pytest.approx(5e6, rel=1e-13)


def test_a_material_and_back():
    """A circular block of radius a has S = a / (2 h): E_c = E (1 + a^2 / (2 h^2)) with kappa 1."""
    radius, height = 10.0, 4.0
    size = ["--area", f"{np.pi * radius**2} mm^2", "--height", f"{height} mm", "--shape-factor", radius / (2 * height)]
    known = numbers("--modulus", "2 MPa", *size)
    expected = 2e6 * (1 + 0.5 * (radius / height) ** 2) * np.pi * radius**2 * 1e-6 / (height * 1e-3)
    assert known["stiffness"] == pytest.approx(expected, rel=1e-12)
    back = numbers("--stiffness", known["stiffness"], *size)
    assert back["modulus"] == pytest.approx(2e6, rel=1e-11)
    lossy = numbers("--modulus", "2 MPa", *size, "--loss-factor", 0.1, "--frequency", "65 Hz")
    assert lossy["dashpot"] == pytest.approx(0.1 * expected / (2 * np.pi * 65), rel=1e-12)
    assert numbers("--modulus", "2 MPa", *size, *IMPACT)["notes"] == []
    fast = numbers("--modulus", "2 MPa", *size, "--mass", "50 g", "--speed", "5 m/s")
    assert fast["strain"] > 0.1
    assert "strain" in fast["notes"][0]


def test_a_measured_loop(tmp_path):
    """Loading along one curve, back along 0.64 of it: the loop's restitution is 0.8, and the mass gets that."""
    way = np.concatenate([np.linspace(0.0, 0.4, 41), np.linspace(0.4, 0.0, 41)[1:]])
    force = np.interp(way, [0.0, 0.2, 0.4], [0.0, 22.0, 70.0]) * np.where(np.arange(81) > 40, 0.64, 1.0)
    table = "way (mm),force (N)\n" + "".join(f"{x:.10g},{n:.10g}\n" for x, n in zip(way, force, strict=True))
    (tmp_path / "pad.csv").write_text(table)
    known = numbers("--curve", tmp_path / "pad.csv", "--segments", 2, "--mass", "50 g", "--no-tension")
    assert known["loop_restitution"] == pytest.approx(0.8, rel=1e-2)
    assert known["restitution"] == pytest.approx(known["loop_restitution"], rel=1e-9)
    assert len(known["points"]) == 3
    assert known["points"][-1][1] == pytest.approx(0.82 * 70.0, rel=0.05)
    impacts = simulated(tmp_path, "--curve", tmp_path / "pad.csv", "--segments", 2)
    assert impacts.restitution[0] == pytest.approx(1.0, rel=1e-9)
    one = numbers("--curve", tmp_path / "pad.csv", "--segments", 1)
    assert one["points"] is None
    assert one["stiffness"] > 0.0


@pytest.mark.parametrize(("disturbance", "misfit"), [("", 0.0), ("001", 3.8e-5)])
def test_a_curve_through_all_points_has_no_misfit(tmp_path, disturbance, misfit):
    """Round-off of 6e-14 N was printed as that."""
    rows = ["0,0", "0.1,73.3", f"0.2,146.6{disturbance}", "0.3,341.9", "0.4,537.2"]
    (tmp_path / "pad.csv").write_text("\n".join(["way (mm),force (N)", *rows]) + "\n")
    assert numbers("--curve", tmp_path / "pad.csv", "--segments", 2)["misfit"] == pytest.approx(misfit, rel=0.9)


def test_beyond_critical_damping_a_mass_stays():
    known = numbers("--stiffness", "1 kN/m", "--dashpot", "200 N s/m", *IMPACT)
    assert known["restitution"] is None
    assert "--no-tension" in known["notes"][0]
    assert (
        0.0 < numbers("--stiffness", "1 kN/m", "--dashpot", "200 N s/m", *IMPACT, "--no-tension")["restitution"] < 0.1
    )


@pytest.mark.parametrize(
    ("arguments", "messages"),
    [
        ([], ["--stiffness is missing"]),
        (["--stiffness", "5 mm"], ["--stiffness = 5 mm"]),
        (["--stiffness", "0"], ["--stiffness = 0 must be positive"]),
        (
            ["--stiffness", "5", "--modulus", "2"],
            ["--modulus and --stiffness exclude", "--area is missing", "--height"],
        ),
        (["--stiffness", "5", "--restitution", "0.5"], ["--mass is missing, which --restitution needs"]),
        (["--stiffness", "5", "--restitution", "1.5", "--mass", "1"], ["--restitution = 1.5 must be from"]),
        (
            ["--stiffness", "5", "--dashpot", "1", "--loss-factor", "1", "--frequency", "1"],
            ["--dashpot and --loss-factor"],
        ),
        (["--stiffness", "5", "--loss-factor", "1"], ["--frequency is missing"]),
        (["--contact-time", "5 ms", "--mass", "1", "--dashpot", "1"], ["--contact-time and --dashpot"]),
        (["--curve", "no.csv"], ["--curve = no.csv"]),
        # what was written into the scenario unread
        (["--stiffness", "5", "--name", "x: y"], ["--name = x: y is not a usable name"]),
        (["--stiffness", "5", "--name", ""], ["--name =  is not a usable name"]),
        (["--stiffness", "5", "--position", "nan"], ["--position = nan must be finite"]),
        (["--stiffness", "5", "--position", "-3"], ["--position = -3 must not be negative"]),
        (["--stiffness", "5", "--position", "12 kg"], ["--position = 12 kg must be a position"]),
        (["--stiffness", "5", "--on-mass", "0"], ["--on-mass = 0 is out of range"]),
        # numbers in range whose result is not
        (["--modulus", "5e6", "--area", "9e29", "--height", "1e-29"], ["the stiffness found = 4.5e+65 is outside"]),
        (["--contact-time", "1e-29", "--mass", "1"], ["the stiffness found = 9.8696e+58 is outside"]),
        (
            ["--modulus", "5 MPa", "--area", "1", "--height", "1", "--bulk-modulus", "1 MPa"],
            ["--bulk-modulus = 1e+06 Pa is less than a third of --modulus = 5e+06 Pa"],
        ),
    ],
)
def test_what_cannot_be_used(arguments, messages):
    code, out, errors = pad(*arguments)
    assert (code, out) == (2, "")
    assert all(message in errors for message in messages), errors
    assert all(";" in line for line in errors.splitlines())


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        ("0,0\n1,-3\n", "no point has a positive deflection and a positive force"),
        ("0,0\n1,nan\n", "row 2 of the numbers is not complete"),
        ("0,0\n1e300,1e300\n", "row 2 of the numbers is beyond 1e+30 in SI units"),
        ("", "no line starts with a number"),
    ],
)
def test_a_file_without_a_curve(tmp_path, rows, says):
    (tmp_path / "pad.csv").write_text(f"way (mm),force (N)\n{rows}")
    code, _, errors = pad("--curve", tmp_path / "pad.csv")
    assert code == 2
    assert says in errors


def test_a_curve_of_few_points_goes_through_them(tmp_path):
    """Its bends lay anywhere between the points, where nothing was measured."""
    (tmp_path / "pad.csv").write_text("way (mm),force (N)\n0,0\n1,5\n2,9\n4,30\n")
    code, out, errors = pad("--curve", tmp_path / "pad.csv")
    assert code == 0, errors
    assert "force_deflection: [[0, 0], [0.001, 5], [0.002, 9], [0.004, 30]]  # m, N" in out
