"""`beamsim pad`: what it prints runs as it stands, and has the stiffness and the loss of what was given."""

import json

import numpy as np
import pytest

import beamsim
from beamsim.scenario import load_scenario
from tests.helpers.commands import invoke

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


@pytest.mark.parametrize("loss_factor", [0.0, 0.2])
def test_a_material(tmp_path, loss_factor):
    """A circular block of radius a has S = a / (2 h): k = E (1 + a^2 / (2 h^2)) A / h; the mass bounces off it."""
    radius, height = 10.0, 4.0
    given = [
        "--modulus", "0.2 MPa", "--area", f"{np.pi * radius**2} mm^2", "--height", f"{height} mm",
        "--shape-factor", radius / (2 * height), "--loss-factor", loss_factor, "--frequency", "65 Hz",
    ]  # fmt: skip
    known = numbers(*given)
    stiffness = 2e5 * (1 + 0.5 * (radius / height) ** 2) * np.pi * radius**2 * 1e-6 / (height * 1e-3)
    assert known["stiffness"] == pytest.approx(stiffness, rel=1e-12)
    assert known["dashpot"] == pytest.approx(loss_factor * stiffness / (2 * np.pi * 65), rel=1e-12)
    (tmp_path / "pad.yaml").write_text(pad(*given)[1].replace("position: 100 %", "mass: 1"))
    (tmp_path / "case.yaml").write_text(CHAIN)
    impacts = beamsim.run(load_scenario(tmp_path / "case.yaml"))["impacts"]
    ratio = known["dashpot"] / (2 * np.sqrt(stiffness * 0.05))
    expected = np.exp(-np.pi * ratio / np.sqrt(1 - ratio**2))
    assert impacts["restitution"].values[0] == pytest.approx(expected, rel=1e-8)


def table(folder, way, force):
    rows = "".join(f"{1e3 * x:.12g},{n:.12g}\n" for x, n in zip(way, force, strict=True))
    (folder / "pad.csv").write_text(f"way (mm),force (N)\n{rows}")
    return ["--curve", folder / "pad.csv"]


def test_a_measured_loop(tmp_path):
    """A spring beside a dashpot, pressed by a cosine from zero to 0.4 mm and back: both are found again."""
    stiffness, dashpot, omega = 150e3, 60.0, 2 * np.pi * 40
    t = np.linspace(0, 2 * np.pi / omega, 4001)
    way, speed = 2e-4 * (1 - np.cos(omega * t)), 2e-4 * omega * np.sin(omega * t)
    given = table(tmp_path, way, stiffness * way + dashpot * speed)
    found = numbers(*given, "--segments", 1, "--frequency", "40 Hz")
    assert found["points"] is None
    assert found["stiffness"] == pytest.approx(stiffness, rel=1e-3)
    assert found["loss_factor"] == pytest.approx(dashpot * omega / stiffness, rel=1e-6)
    assert found["dashpot"] == pytest.approx(dashpot, rel=1e-3)
    without = pad(*given, "--segments", 1)[1]
    assert "damping" not in without
    assert "# no dashpot: give --frequency" in without


@pytest.mark.parametrize(("loops", "noise"), [(1, 0.0), (5, 0.0), (5, 1.0)])
def test_several_loops_lose_as_much_as_one(tmp_path, loops, noise):
    """Whatever loops of the same record come before the largest deflection counted as its loading: five gave 0.7."""
    stiffness, eta, count = 150e3, 0.1, 401 * loops
    scatter = noise * np.random.default_rng(5).normal(size=(2, count))
    turn = np.linspace(0, 2 * np.pi * loops, count)
    way, force = 2e-4 * (1 - np.cos(turn)) + 5e-7 * scatter[0], 30 * (1 - np.cos(turn) + eta * np.sin(turn))
    given = table(tmp_path, way, force + 0.3 * scatter[1])
    # 2 %: of the noise on the work; without noise the polygon of the samples
    found = numbers(*given, "--segments", 1, "--frequency", "40 Hz")
    assert found["loss_factor"] == pytest.approx(eta, rel=0.02 if noise else 1e-4)
    assert found["dashpot"] == pytest.approx(eta * stiffness / (2 * np.pi * 40), rel=0.03 if noise else 2e-3)


@pytest.mark.parametrize(("disturbance", "misfit"), [(0.0, 0.0), (1e-4, 3.8e-5)])
def test_a_curve_through_all_points_has_no_misfit(tmp_path, disturbance, misfit):
    """Round-off of 6e-14 N was printed as that."""
    given = table(tmp_path, np.arange(5) * 1e-4, [0, 73.3, 146.6 + disturbance, 341.9, 537.2])
    assert numbers(*given, "--segments", 2)["misfit"] == pytest.approx(misfit, rel=0.9)


@pytest.mark.parametrize(
    ("arguments", "messages"),
    [
        ([], ["--modulus is missing"]),
        (["--modulus", "5 mm"], ["--modulus = 5 mm"]),
        (["--modulus", "0"], ["--modulus = 0 must be positive"]),
        (["--modulus", "5", "--curve", "a.csv"], ["--modulus and --curve exclude", "--area is missing", "--height"]),
        (["--curve", "a.csv", "--loss-factor", "1"], ["--frequency is missing, which --loss-factor needs"]),
        (["--modulus", "5", "--area", "1", "--height", "1", "--frequency", "1"], ["--loss-factor is missing"]),
        (["--curve", "no.csv"], ["--curve = no.csv"]),
        # numbers in range whose result is not
        (["--modulus", "5e6", "--area", "9e11", "--height", "1e-19"], ["the stiffness found = 4.5e+37 is outside"]),
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
        ("0,0\n0,-3\n", "no point has a positive deflection and a positive force"),
        ("0,0\n1,-3\n1,-4\n", "no point with a positive deflection and a positive force; multiply the forces by -1"),
        ("0,0\n1,nan\n", "row 2 of the numbers is not complete"),
        ("0,0\n1e300,1e300\n", "row 2 of the numbers is beyond 1e+06 m and 1e+15 N"),
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
    assert "force_deflection: [[0 m, 0 N], [0.001 m, 5 N], [0.002 m, 9 N], [0.004 m, 30 N]]" in out
