"""`beamsim identify-stiffness` and `beamsim compare` as a user meets them."""

import json
import re

import h5py
import numpy as np
import pytest
import yaml
from shipped import config_path

import beamsim
from beamsim.analyses.identify.vibrations import steady_vibration
from beamsim.scenario import load_scenario
from benchmarks import identification_coverage as coverage
from tests.helpers.commands import invoke

CASE = config_path("identify_snubber")


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def section(text):
    return f"extends: {config_path('one_sided_65hz')}\nidentify_stiffness:\n  snubber: tip\n{text}"


def test_prints_writes_and_draws(tmp_path):
    done = invoke("identify-stiffness", CASE, "-v")
    assert done.exit_code == 0, done.output
    assert "153.6 kN/m   2.6 kN/m" in done.output
    assert "reachable" in done.output
    made = {p.name for p in tmp_path.iterdir()}
    assert made == {
        "identify_snubber.h5", "identify_snubber_frequencies.png", "identify_snubber_residuals.png",
        "identify_snubber_profiles.png",
    }  # fmt: skip
    with h5py.File(tmp_path / "identify_snubber.h5") as file:
        assert file.attrs["command"] == "identify-stiffness"
        assert file["stiffness/stiffness"][()] == pytest.approx(153.59e3, rel=1e-3)
        assert file["stiffness/standard_deviation"][()] > 0
        assert file["stiffness/interval"].dims[0][0].asstr()[()].tolist() == ["lower", "upper"]
        for name in ("measured_hz", "predicted_hz", "difference_percent"):
            assert file["frequencies"][name].dims[0][0].name == "/frequencies/frequency"
        datasets = []
        file.visititems(lambda name, item: datasets.append(item) if isinstance(item, h5py.Dataset) else None)
        assert all("units" in d.attrs and "long_name" in d.attrs for d in datasets)
        again = load_scenario(file.attrs["scenario"])
    assert again.identify_stiffness == load_scenario(CASE).identify_stiffness


def test_json_has_the_fixed_names_and_nothing_else():
    done = invoke("identify-stiffness", CASE, "--json", "--no-plots")
    values = json.loads(done.stdout)
    for name in (
        "stiffness_n_per_m", "standard_deviation_n_per_m", "frequencies_with_hz", "frequencies_without_hz",
        "pad_youngs_modulus_pa", "eigenvalue_solutions",
    ):  # fmt: skip
        assert name in values
    assert values["files"] == ["identify_snubber.h5"]


def test_a_loop_that_jumps_ends_with_3_and_keeps_what_it_has(tmp_path):
    done = invoke(
        "identify-stiffness", CASE, "--no-plots", "--set", "identify_stiffness.method=thesis", "--set",
        "identify_stiffness.tolerance=1e-7",
    )  # fmt: skip
    assert done.exit_code == 3
    assert "stepped over" in done.output
    assert (tmp_path / "identify_snubber.h5").is_file()


def test_without_the_section():
    done = invoke("identify-stiffness", config_path("one_sided_65hz"))
    assert done.exit_code == 2
    assert "identify_stiffness is missing" in done.output


NONLINEAR = """\
  nonlinear:
    estimate: [snubbers.tip.stiffness, snubbers.tip.gap]
    starts: 1
    profiles: false
    tests:
      - {file: FILE, probe: tip, quantity: absolute_acceleration, unit: g, harmonics: 5, frequency: 65 Hz}
"""


@pytest.fixture(scope="module")
def history():
    scenario = load_scenario(config_path("one_sided_65hz"), {"snubbers[0].gap": 1e-5})
    harmonics = steady_vibration(scenario).harmonics(0, "absolute_acceleration", 36)
    time = np.arange(2000) / 5000.0
    signal = np.imag(np.exp(2j * np.pi * 65.0 * np.outer(time + 0.004, np.arange(1, 37))) @ harmonics) / 9.80665
    return time, signal + 0.01 * np.random.default_rng(0).standard_normal(time.size)


def _write(path, time, signal):
    np.savetxt(path, np.column_stack([time, signal]), delimiter=",", header="time (s),tip (g)", comments="")


def test_nonlinear_parameters_from_a_file(tmp_path, history):
    folder = tmp_path / "lab"
    folder.mkdir()
    _write(folder / "test.csv", *history)
    case = folder / "case.yaml"
    case.write_text(section(NONLINEAR.replace("FILE", "test.csv")))
    done = invoke("identify-stiffness", case, "--json", "-o", tmp_path / "out.h5")
    assert done.exit_code == 0, done.output
    values = json.loads(done.stdout)
    for path, truth in (("snubbers.tip.stiffness", 151.1e3), ("snubbers.tip.gap", 1e-5)):
        found = values["estimated"][path]
        assert abs(found["value"] - truth) < 4 * found["standard_deviation"]
    assert (tmp_path / "out_harmonics.png").is_file()
    with h5py.File(tmp_path / "out.h5") as file:
        assert file["nonlinear/parameter"].asstr()[()].tolist() == ["snubbers.tip.stiffness", "snubbers.tip.gap"]
        assert file["tests/harmonic_measured_real"].shape == (5,)


@pytest.fixture(scope="module")
def run_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("compared") / "run.h5"
    changes = ["--set", "snubbers[0].gap=0.01 mm", "--set", "run.duration=1.6 s", "--set", "run.convergence=off"]
    done = invoke("run", config_path("one_sided_65hz"), "--no-plots", "-q", *changes, "-o", path)
    assert done.exit_code == 0, done.output
    return path


def test_compare_aligns_and_tabulates(tmp_path, run_file, history):
    _write(tmp_path / "lab.csv", *history)
    done = invoke("compare", run_file, tmp_path / "lab.csv", "--json", "--harmonics", 6)
    assert done.exit_code == 0, done.output
    (channel,) = json.loads(done.stdout)["comparisons"]
    assert channel["place"] == "tip"
    assert channel["quantity"] == "absolute_acceleration"
    assert len(channel["harmonics"]) == 6
    for line in channel["harmonics"]:
        assert abs(line["difference_db"]) < 0.1
        assert abs(line["phase_difference_deg"]) < 1.0
    assert channel["rms_difference"] < 0.1
    assert (channel["delay_s"] - 0.004 + 0.5 / 65) % (1 / 65) == pytest.approx(0.5 / 65, abs=2e-5)
    assert (tmp_path / "run_compare_tip_absolute_acceleration.png").is_file()
    with h5py.File(tmp_path / "run_compare.h5") as file:
        assert file["harmonics/difference_db"].shape == (6,)


def test_compare_asks_where_a_single_channel_was_measured(tmp_path):
    """A file with one channel was compared with the first probe, whatever its name (92 % error on the wrong mass)."""
    case = tmp_path / "chain.yaml"
    case.write_text(
        "chain: {masses: [1, 1], springs: [400, 400, 0], dashpots: [1, 1, 0]}\n"
        "excitation: {kind: harmonic, applied_to: {mass: 1}, level: 1 N, frequency: 2 Hz}\n"
        "probes: [{name: mass_1, mass: 1}, {name: mass_2, mass: 2}]\nrun: {duration: 60 s}\n"
    )
    assert invoke("run", case, "-q", "--no-plots", "-o", tmp_path / "run.h5").exit_code == 0
    result = beamsim.load(tmp_path / "run.h5")
    rows = np.stack(
        [result["histories"]["time"].values, result["histories"]["displacement"].sel(probe="mass_2").values], axis=1
    )
    rows = rows[result["histories"]["time"].values > 30]
    for heading, more in (("mass_2 (m)", ()), ("sensor (m)", ("--probe", "mass_2")), ("mass 2 displacement (m)", ())):
        np.savetxt(tmp_path / "lab.csv", rows, delimiter=",", header=f"time (s),{heading}", comments="")
        done = invoke(
            "compare", tmp_path / "run.h5", tmp_path / "lab.csv", *more, "--json", "--no-plots", "--harmonics", 1
        )
        assert done.exit_code == 0, done.output
        (channel,) = json.loads(done.stdout)["comparisons"]
        assert (channel["place"], channel["quantity"]) == ("mass_2", "displacement")
        assert channel["rms_difference"] < 1e-3
        # without run.spectrum the transient is left out, and the part is said
        assert 1 < channel["start_s"] < 30
        assert abs(channel["harmonics"][0]["difference_db"]) < 0.05
    np.savetxt(tmp_path / "lab.csv", rows, delimiter=",", header="time (s),sensor (m)", comments="")
    done = invoke("compare", tmp_path / "run.h5", tmp_path / "lab.csv")
    assert done.exit_code == 2
    assert (
        "the channel sensor (m) is named after none of the probes; give the place of measurement: --probe"
        in done.output
    )
    np.savetxt(tmp_path / "lab.csv", rows, delimiter=",", header="time,mass_2", comments="")
    done = invoke("compare", tmp_path / "run.h5", tmp_path / "lab.csv", "--unit", "m")
    assert done.exit_code == 2
    assert "states no unit of its times (axis time)" in " ".join(done.output.split())
    given = ("--unit", "m", "--axis-unit", "s", "--json", "--no-plots", "--harmonics", 1)
    done = invoke("compare", tmp_path / "run.h5", tmp_path / "lab.csv", *given)
    assert done.exit_code == 0, done.output
    (channel,) = json.loads(done.stdout)["comparisons"]
    assert (channel["place"], channel["quantity"]) == ("mass_2", "displacement")  # by the unit that is given
    with_units = "time (s),mass_1 displacement,mass_1 velocity"
    np.savetxt(tmp_path / "lab.csv", np.c_[rows, rows[:, 1]], delimiter=",", header=with_units, comments="")
    done = invoke("compare", tmp_path / "run.h5", tmp_path / "lab.csv", "--unit", "mm")
    assert done.exit_code == 2
    assert "choose one with --quantity, for example --quantity displacement" in done.output


def test_harmonics_of_round_off_have_no_difference(tmp_path, run_file, history):
    """A record of one sine was said to differ by 300 dB, with a phase, at each harmonic that it does not have."""
    time = np.asarray(history[0])
    _write(tmp_path / "lab.csv", time, np.sin(2 * np.pi * 65.0 * time))
    done = invoke("compare", run_file, "lab.csv", "--no-plots", "-v")
    assert done.exit_code == 0, done.output
    lines = done.output.partition("harmonics ")[2].splitlines()
    assert " dB" in lines[1]
    assert sum("dB" not in line and " - " in line for line in lines[2:11]) == 9  # one of the two is round-off


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["nothing.uff"], "does not exist"),
        (["lab.csv", "--channel", "tap"], "name one: tip (g)"),
        (["lab.csv", "--probe", "nose"], "is not in the result"),
        (["lab.csv", "--quantity", "colour"], "is not one of"),
        (["lab.csv", "--unit", "mm"], "acceleration"),
        (["lab.xyz"], "unknown format"),
        (["lab.csv", "--curve", "up_0"], "--curve belongs to sweeps, and this is a run"),  # was ignored
        (["lab.csv", "--detector", "rms"], "--detector belongs to sweeps"),
        (["zero.csv"], "tip (g) is zero throughout"),
    ],
)
def test_compare_explains_mistakes(tmp_path, run_file, history, arguments, says):
    _write(tmp_path / "zero.csv", history[0], 0.0 * np.asarray(history[1]))
    _write(tmp_path / "lab.csv", *history)
    (tmp_path / "lab.xyz").write_text("1")
    done = invoke("compare", run_file, *arguments)
    assert done.exit_code == 2, done.output
    assert says in done.output


def test_the_first_screen_names_the_record_that_has_most_of_the_misfit(tmp_path):
    """With units and intervals of what was found; the same lines of -v."""
    tests = []
    for name, f, wrong in (("good", 0.2, 1.0), ("loose", 0.25, 1.1), ("other", 0.3, 1.0)):
        case = load_scenario(coverage.case(coverage.TRUTH), {"excitation.frequency": f})
        t = np.arange(16 * 48) / (48 * f)
        turning = np.exp(2j * np.pi * f * np.outer(t, np.arange(1, 13)))
        true = np.imag(turning @ steady_vibration(case).harmonics(0, "displacement", 12))
        noise = 1e-2 * np.random.default_rng(0).standard_normal(t.size)
        columns = np.column_stack([t, 1e3 * (wrong * true + noise)])
        np.savetxt(tmp_path / f"{name}.csv", columns, delimiter=",", header="time (s),mass (mm)", comments="")
        tests.append({"file": f"{name}.csv", "name": name, "frequency": f, "quantity": "displacement", "harmonics": 4})
    fit = {"estimate": list(coverage.TRUTH)[:2], "tests": tests, "starts": 1, "profiles": False}
    section = {"snubber": "stop", "nonlinear": fit}
    (tmp_path / "case.yaml").write_text(yaml.safe_dump(coverage.case(coverage.BEGIN, identify_stiffness=section)))
    screen = invoke("identify-stiffness", tmp_path / "case.yaml", "-o", tmp_path, "--no-plots").stdout
    assert re.search(r"loose has \d+ % of the misfit; without it [\d.]+ would be left", screen)
    (line,) = [each for each in screen.splitlines() if each.startswith("chain dashpot 1")]
    assert re.search(r"290 mN s/m +[\d.]+ mN s/m +[\d.]+ [mµ]N s/m +[\d.]+ to [\d.]+ mN s/m", line)
