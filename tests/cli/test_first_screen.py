"""The first screens: what is decided by, and nothing that is not sure."""

import gzip
import math
import re
from collections import Counter
from pathlib import Path
from pkgutil import resolve_name

import pytest
import yaml
from typer.testing import CliRunner

from beamsim.cli.app import app
from beamsim.kinds import KINDS
from beamsim.plots.style import use_units
from beamsim.store.results import kind_of, load

STORED = Path(__file__).parents[1] / "data" / "results"

BEAM = {"length": 0.27, "bending_stiffness": 2.0, "mass_per_length": 0.25, "damping": {"kind": "modal", "ratio": 0.05}}
TIP = {"name": "tip", "position": 0.27, "side": "below", "stiffness": "10 kN/m", "gap": "0.1 mm"}
CASE = {
    "title": "A beam with a stop",
    "beam": BEAM,
    "snubbers": [TIP],
    "probes": [{"name": "middle", "position": 0.135}],
    "excitation": {"kind": "harmonic", "applied_to": "base", "level": "2 g", "frequency": "60 Hz"},
    "reduction": {"modes": 6},
    "limits": {"peak_force": "1 N", "peak_displacement": "5 mm"},
    "run": {"duration": 0.1, "spectrum": {"last": 0.05}},
}


@pytest.fixture
def printed(tmp_path):
    def call(*options, command="run", **more):
        case = tmp_path / "case.yaml"
        case.write_text(yaml.safe_dump(CASE | more))
        done = CliRunner().invoke(app, [command, str(case), "--no-plots", "-o", str(tmp_path / "case.h5"), *options])
        assert done.exit_code == 0, done.output
        return done.stdout.splitlines()

    return call


def test_a_run_shows_places_limits_and_how_sure_it_is(printed):
    lines = printed()
    assert lines[0].startswith("A beam with a stop  converged within ")
    assert "energy error" in lines[0]
    said, lines = lines[1], [lines[0], *lines[2:]]
    assert (
        said == "harmonic, 2 g, 60 Hz, at the base; first mode 21.7 Hz open and at rest (5 %), 81.6 Hz closed (2.9 %)"
    )
    assert lines[1].split("  ")[0] == ""
    assert "peak force" in lines[1]
    tip = next(line for line in lines if line.startswith("tip"))
    assert "peak force EXCEEDED" in tip
    assert next(line for line in lines if line.startswith("middle")).split()[1:3] == ["-", "-"]
    assert any("touches from" in line for line in lines)
    assert lines[-1].endswith("case.h5")
    assert len(lines) < 10


def test_a_long_command_states_its_processor_time(printed, monkeypatch):
    monkeypatch.setattr("beamsim.cli.command.WORTH_STATING_S", 0.0)
    assert printed()[-1].startswith("processor time of the command ")


def test_everything_on_request(printed):
    lines = printed("-v")
    assert any("open frequencies" in line for line in lines)
    first = printed()
    assert all(any(line.endswith(told) for line in lines) for told in first[1:-1])
    assert any(line.strip().startswith("convergence") for line in lines)
    assert any("amplitude (dB)" in line for line in lines)  # beside the amplitude in its own unit


def test_what_does_not_converge_is_marked_and_has_fewer_digits(printed):
    lines = printed(reduction={"modes": 1}, snubbers=[TIP | {"stiffness": "1000 kN/m"}])
    tip = next(line for line in lines if line.startswith("tip"))
    assert " * " in tip
    assert "* off by more than 2 %" in lines
    force = tip.split()[1]
    assert len(force.replace(".", "").lstrip("0")) <= 2


def test_a_comparison_that_was_left_out_is_said(printed):
    assert "not checked with a finer model (not requested)" in printed("--set", "run.convergence=off")[0]


def test_a_sweep_shows_its_curves_and_names_those_that_exceed_a_limit(printed):
    """Below the stop the displacement grows with the level: 1, 2 and 4 times."""
    stepped = {"kind": "stepped", "from": "50 Hz", "to": "52 Hz", "points": 2, "levels": ["1 mg", "2 mg", "4 mg"]}
    more = {"sweep": stepped | {"convergence": "off"}, "run": None}
    lines = printed(command="sweep", **more)
    rows = [line for line in lines if line.startswith("up, ")]
    assert [row.split(" (")[0] for row in rows] == ["up, 1 mg", "up, 2 mg", "up, 4 mg"]
    assert all(" Hz" in row and "m " in row for row in rows)
    assert len(lines) < 13
    size, unit = re.search(r"([\d.e-]+) (\wm) at", rows[0]).groups()
    lines = printed(command="sweep", **more, limits={"peak_displacement": f"{1.5 * float(size)} {unit}"})
    assert "peak displacement exceeded in 2 of 3 sweeps: up, 2 mg; up, 4 mg" in lines


SHOWN = {
    "continuation": ("400 mN   0.085 to 0.1 Hz", "1.44 m at 0.1 Hz, the other", "gap EXCEEDED, margin -61.2 %"),
    "folds": ("62 of 123 points", "3 folds at 0.104, 0.1203, 0.1203 Hz", "1.96 m at 0.12 Hz, first",
              "folds in level: 30 to 300 mN"),
    "designs": ("4 cases, each a run", "1.94 m (2 N/m, 0.2 m)", "EXCEEDED in 4 of 4 cases: 1.936 m at the other",
                "1 of 4 cases compared with a finer model, the other 3 not"),
    "designs_zip": ("2 cases, each a swept sine", "1.87 N (6 N/m, below)", "6 more responses", "none of 2 cases"),
    "identify_nonlinear": ("tip gap", "15 µm", "19.83 µm", "19.5 to 20.15 µm", "misfit 2057 before, 27.16 after"),
    "identify_snubber": ("153.6 kN/m   2.6 kN/m   148.7 to 158.8 kN/m", "with contact: 196.5, 448.6, 967.7 Hz"),
    "identify_update": ("4.049 g", "3.811 to 4.302 g", "45 g"),
    "nnm": ("mode 1: 101 points, all stable", "0.105 Hz"),
    "compare": ("one velocity", "+0.00 dB"),
    "compare_modes": ("lowest MAC 0.968", "mode 2, 351.01 Hz   +9.69 %"),
}  # fmt: skip


@pytest.mark.parametrize("name", SHOWN)
def test_every_kind_says_first_what_is_decided_by(name, tmp_path):
    path = tmp_path / f"{name}.h5"
    path.write_bytes(gzip.decompress((STORED / f"{name}.h5.gz").read_bytes()))
    result = load(path)
    with use_units(result.scenario.display_scales):
        text = resolve_name(KINDS[kind_of(path)].screen)(result).text(result, [f"{name}.h5", "picture.png"])
    for words in SHOWN[name]:
        assert words in text, text
    lines = text.splitlines()
    assert lines[0].startswith(result.title)
    assert lines[-1] == f"{name}.h5, 1 plot"
    assert len(lines) <= 12
    assert "complete:" not in text


@pytest.mark.parametrize("name", ["continuation", "folds", "nnm"])
@pytest.mark.parametrize("more", [0, 9])
def test_counts_of_special_points_are_those_of_their_table(name, more, tmp_path):
    """All levels and periods count, also at one value of the parameter, and all kinds."""
    path = tmp_path / f"{name}.h5"
    path.write_bytes(gzip.decompress((STORED / f"{name}.h5.gz").read_bytes()))
    result = load(path)
    table = result.summary["special_points"]
    assert [point["kind"] for point in table] == result["special_points"]["kind"].values.tolist()
    table += [
        {"kind": kind, "parameter": 0.09, "frequency_hz": 0.09, "snubber": "", "level": 1.0, "period_multiple": 2}
        for kind in ("neimark_sacker", "grazing", "nonsmooth_fold", "fold")
        for _ in range(more)
    ]
    with use_units(result.scenario.display_scales):
        text = resolve_name(KINDS[kind_of(path)].screen)(result).text(result, [path.name]).replace("\n", " ")
    for kind, count in Counter(point["kind"] for point in table).items():
        called = {"neimark_sacker": "Neimark–Sacker bifurcation"}.get(kind, kind.replace("_", " "))
        said = re.search(rf"(?<!\d)(\d+) {called}s?\b(?: at ([^;]*? and (\d+) more)?)?", text)
        assert said, (kind, text)
        assert int(said[1]) == count
        if said[3]:
            assert int(said[3]) + said[2].count(",") + 1 == count


TWO_FORCES = """
chain: {masses: [1 kg], springs: [10 kN/m], damping: {kind: modal, ratio: 2 %}}
snubbers: [{name: stop, mass: 1, side: above, stiffness: 20 kN/m, gap: 1 mm}]
excitation: {kind: forces, forces: [
  {kind: harmonic, applied_to: {mass: 1}, level: 3 N, frequency: 10 Hz},
  {kind: harmonic, applied_to: {mass: 1}, level: 1 N, frequency: 10 Hz}]}
run: {duration: 0.2 s}
"""


def test_a_level_of_several_forces_multiplies_them(tmp_path):
    """Closed form: 4 N move the mass by 4 / 10000 / sqrt((1 - r^2)^2 + (2 zeta r)^2), r = 10 / 15.92."""
    (tmp_path / "case.yaml").write_text(TWO_FORCES)
    done = CliRunner().invoke(app, ["run", str(tmp_path / "case.yaml"), "--no-plots", "-o", str(tmp_path / "case.h5")])
    r = 20 * math.pi / 100
    times = 1e-3 / (4e-4 / math.hypot(1 - r**2, 0.04 * r))
    assert f"stop touches from {times:.4g} times this input at 10 Hz in steady linear motion" in done.stdout


IDENTIFIED = """
chain: {masses: [1 kg], springs: [10 kN/m]}
snubbers: [{name: stop, mass: 1, side: above, gap: 1 mm, stiffness: 1 kN/m}]
excitation: {kind: harmonic, applied_to: base, level: 1 g, frequency: 10 Hz}
"""
FOR_MODES = "nnm: {mode: 1, continue_in: {kind: energy, from: 1 mJ, to: 2 mJ}, phase_resonance: {levels: [0.5 g, 1 g]}}"
FOR_STOPS = "identify_stiffness: {snubber: stop, measured_with: [17 Hz], fit_to: [1]}"


@pytest.mark.parametrize(
    ("section", "excited"),
    [
        ("", "harmonic, 1 g, 10 Hz, at the base"),
        ("run: {duration: 1 s}", "harmonic, 1 g, 10 Hz, at the base"),
        (FOR_MODES, "sine at phase resonance, 0.5 g and 1 g, at the base"),
        (FOR_MODES.replace(", phase_resonance: {levels: [0.5 g, 1 g]}", ""), ""),
        (FOR_STOPS, ""),
    ],
)
def test_validate_names_the_excitation_that_a_command_uses(section, excited, tmp_path):
    (tmp_path / "case.yaml").write_text(IDENTIFIED + section)
    done = CliRunner().invoke(app, ["validate", str(tmp_path / "case.yaml")])
    assert done.exit_code == 0, done.output
    assert (excited in done.stdout) if excited else (" at the base" not in done.stdout)
