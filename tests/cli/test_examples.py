"""The examples of the Python interface run as they stand, and what they compute is right."""

import runpy
from pathlib import Path

import numpy as np
import pytest

FOLDER = Path(__file__).parents[2] / "examples"


def a_mass_between_springs_has_these_modes(known):
    springs, masses = known["springs"], known["masses"]
    stiffness = np.diag(springs[:-1] + springs[1:]) - np.diag(springs[1:-1], 1) - np.diag(springs[1:-1], -1)
    for column, added in (("open", 0.0), ("closed", 2e5)):
        row = np.zeros(masses.size)
        row[2:4] = -1.0, 1.0
        squares = np.linalg.eigvals((stiffness + added * np.outer(row, row)) / masses[:, None])
        expected = np.sort(np.sqrt(squares)) / (2 * np.pi)
        np.testing.assert_allclose(known["modes"][f"{column}_frequencies_hz"].values, expected, rtol=1e-9)


def a_finer_table_comes_closer_to_the_closed_form(known):
    errors = [abs(peak / known["exact"] - 1) for peak in known["peaks"].values()]
    assert errors[-1] < 1e-3
    assert max(errors) < 5e-3


def the_multipliers_agree_with_the_stability(known):
    apart = abs(known["largest"] - 1) > 1e-6
    assert ((known["largest"] < 1) == (known["points"]["stable"].values == 1))[apart].all()
    folds = [point for point in known["result"].summary["special_points"] if point["kind"] == "fold"]
    assert 2 * np.pi * folds[0]["frequency_hz"] == pytest.approx(0.755627, abs=1e-6)


def every_start_comes_to_one_of_two_motions(known):
    stable = [motion for motion in known["result"].summary["motions"] if motion["stable"]]
    assert len(stable) == 2
    assert sum(motion["starts"] for motion in stable) == 100
    # the one that does not touch is that of the linear oscillator
    linear = 0.15 / np.hypot(1 - 1.15**2, 0.05 * 1.15)
    assert min(motion["peak_displacement_m"]["mass"] for motion in stable) == pytest.approx(linear, rel=1e-8)


def the_curve_grazes_where_it_is_published(known):
    found = [2 * np.pi * p["frequency_hz"] for p in known["curve"].summary["special_points"] if p["kind"] == "grazing"]
    np.testing.assert_allclose(sorted(found), [0.581900, 0.653440], atol=1e-6)


def the_rod_leaves_when_the_wave_is_back(known):
    events = known["events"]
    assert events[-1] - events[0] == pytest.approx(2 * known["LENGTH"] / known["wave"], rel=0.01)


CHECKS = {
    "beam_and_stop": lambda known: known["summary"]["energy_error"] < 1e-9 or pytest.fail("energy"),
    "chain_from_arrays": a_mass_between_springs_has_these_modes,
    "user_defined_law": a_finer_table_comes_closer_to_the_closed_form,
    "continuation_with_multipliers": the_multipliers_agree_with_the_stability,
    "basins": every_start_comes_to_one_of_two_motions,
    "two_masses_from_arrays": the_curve_grazes_where_it_is_published,
    "own_matrices_with_stop": the_rod_leaves_when_the_wave_is_back,
    "study": lambda known: (
        np.corrcoef(known["draws"]["snubbers.tip.gap"], known["force"])[0, 1] > 0.9
        or pytest.fail("a larger gap gives harder impacts here")
    ),
    "identification": lambda known: known["low"] < 151.1 < known["high"] or pytest.fail("the interval of the thesis"),
    "custom_channel": lambda known: known["work"] < 0 or pytest.fail("a dashpot takes energy"),
    "own_plot": lambda known: Path("force_over_deflection.png").stat().st_size > 0 or pytest.fail("empty"),
    "result_in_xarray": lambda known: (
        len(known["events"]) == known["result"].summary["events"] or pytest.fail("events")
    ),
}


def test_every_example_is_run():
    assert {path.stem for path in FOLDER.glob("*.py")} == CHECKS.keys()


@pytest.mark.parametrize("name", CHECKS)
def test_an_example_runs_and_is_right(name, tmp_path, monkeypatch, capsys):
    if name == "result_in_xarray":
        pytest.importorskip("h5netcdf")
    monkeypatch.chdir(tmp_path)
    known = runpy.run_path(str(FOLDER / f"{name}.py"))
    CHECKS[name](known)
    assert capsys.readouterr().out or name == "own_plot"
    assert 20 <= len((FOLDER / f"{name}.py").read_text().splitlines()) <= 40
