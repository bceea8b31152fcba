"""Damping of contact states: one mass in closed form, two panels against SciPy's eigenvalues, a half-power check."""

import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.linalg import eig, eigh

import beamsim
from beamsim.cli.tables import table_rows
from beamsim.plots.understood import first_modes
from beamsim.scenario import load_scenario
from beamsim.store.results import load, write_result
from beamsim.system.build import build_system
from tests.helpers.independent import Beam

M, K, C, STOP = 2.0, 500.0, 3.0, 300.0


def mass(**stop):
    stop = {"name": "stop", "mass": 1, "side": "below", "stiffness": STOP, "gap": -1e-3, **stop}
    return build_system(
        load_scenario(
            {
                "chain": {"masses": [M], "springs": [K], "dashpots": [C], "snubbers": [stop]},
                "probes": [{"name": "mass", "mass": 1}],
                "run": {"duration": 1.0},
            }
        )
    )


@pytest.mark.parametrize("law", ["kelvin_voigt", "no_tension"])
@pytest.mark.parametrize("dashpot", [0.0, 4.0, 200.0])
def test_one_mass_and_a_stop_in_closed_form(law, dashpot):
    """Up to 254 % of critical damping."""
    table = mass(law=law, damping={"kind": "viscous", "coefficient": dashpot}).modes
    closed = (C + dashpot) / (2 * np.sqrt(M * (K + STOP)))
    assert table["damping_ratios"].values[0] == pytest.approx(C / (2 * np.sqrt(M * K)), rel=1e-12)
    assert table["closed_damping_ratios"].values[0] == pytest.approx(closed, rel=1e-12)
    assert table["resting_damping_ratios"].values[0] == pytest.approx(closed, rel=1e-12)  # it is pressed at rest
    assert table["resting_frequencies_hz"].values[0] == pytest.approx(np.sqrt((K + STOP) / M) / (2 * np.pi), rel=1e-12)
    stop = table.sel(snubber="stop")
    assert (stop["dashpot"].item(), stop["dashpot"].unit, stop["dashpot_from"].item()) == (
        dashpot,
        "N s/m",
        "as written",
    )


def test_a_ratio_is_damped_by_the_share_of_the_stop():
    system = mass(damping={"kind": "ratio", "ratio": 0.05}, gap=1e-3)
    omega = np.sqrt((K + STOP) / M)
    assert system.snubbers[0].dashpot == pytest.approx(0.1 * STOP / omega, rel=1e-12)
    own = C / (2 * M * omega)
    assert system.modes["closed_damping_ratios"].values[0] == pytest.approx(own + 0.05 * STOP / (K + STOP), rel=1e-12)
    # it is open at rest
    assert system.modes["resting_damping_ratios"].values[0] == system.modes["damping_ratios"].values[0]
    hz = omega / (2 * np.pi)
    source = f"5 % of {hz:.4g} Hz, the first natural frequency with it alone closed"
    assert system.modes["dashpot_from"].item() == source
    assert not any("damping ratio" in text for text in system.warnings)  # 5.6 % in all


@pytest.mark.parametrize("time", [1e-3, 0.05, 2.0])
def test_a_maxwell_branch_counts_in_the_ratio(time):
    """(m s^2 + c s + k + k_s) (1 + s tau) + k_1 s tau = 0."""
    branch = 250.0
    system = mass(maxwell=[{"stiffness": branch, "relaxation_time": time}])
    roots = np.roots([M * time, M + C * time, C + (K + STOP + branch) * time, K + STOP])
    pole = roots[np.argmax(roots.imag)]
    assert system.modes["closed_damping_ratios"].values[0] == pytest.approx(-pole.real / abs(pole), rel=1e-9)
    assert system.modes["resting_damping_ratios"].values[0] == pytest.approx(-pole.real / abs(pole), rel=1e-9)
    assert system.modes["dashpot_from"].item() == "none written, in parallel with 1 Maxwell branch"


def test_a_table_is_closed_on_its_first_slope_that_rises_and_rests_on_its_own():
    table = [[0, 0], [1e-3, 0.0], [2e-3, 0.4], [4e-3, 2.4]]
    system = mass(stiffness=None, gap=-4e-3, force_deflection=table, damping={"kind": "viscous", "coefficient": 4.0})
    rest = brent(table)
    assert 2e-3 < rest < 4e-3  # on the slope of 1000 N/m
    for name, slope in (("closed", 400.0), ("resting", 1000.0)):
        omega = np.sqrt((K + slope) / M)
        assert system.modes[f"{name}_frequencies_hz"].values[0] == pytest.approx(omega / (2 * np.pi), rel=1e-12)
        assert system.modes[f"{name}_damping_ratios"].values[0] == pytest.approx(7.0 / (2 * M * omega), rel=1e-12)


def brent(table):
    """Penetration at rest of the mass that a table presses by 4 mm."""
    from scipy.optimize import brentq

    points = np.array(table)
    return brentq(lambda x: np.interp(x, *points.T) - K * (4e-3 - x), 0.0, 4e-3)


def test_friction_that_sticks_at_rest_is_a_spring_there():
    scenario = {
        "chain": {"masses": [M], "springs": [K], "dashpots": [C]},
        "friction": [{"name": "pad", "mass": 1, "normal_force": 10.0, "coefficient": 0.5, "stiffness": 700.0}],
        "probes": [{"name": "mass", "mass": 1}],
        "run": {"duration": 1.0},
    }
    table = build_system(load_scenario(scenario)).modes
    omega = np.sqrt((K + 700.0) / M)
    assert table["closed_frequencies_hz"].values[0] == table["open_frequencies_hz"].values[0]
    assert table["resting_frequencies_hz"].values[0] == pytest.approx(omega / (2 * np.pi), rel=1e-12)
    assert table["resting_damping_ratios"].values[0] == pytest.approx(C / (2 * M * omega), rel=1e-12)


PLACE = 0.58


def text_of_the_page():
    """The example of the documents."""
    page = (Path(__file__).parents[2] / "docs" / "stops.md").read_text()
    return page, re.search(r"```yaml\n(title: Two panels on preloaded pads.*?)```", page, re.S).group(1)


def panels(dashpot=None, **more):
    scenario = yaml.safe_load(text_of_the_page()[1]) | more
    if dashpot is not None:
        for stop in scenario["snubbers"]:
            stop["damping"] = {"kind": "viscous", "coefficient": dashpot}
    return scenario


def test_two_panels_on_preloaded_pads_against_eigenvalues_of_other_matrices():
    """Rayleigh damping, elements of the textbook, and the general eigenvalue problem of SciPy."""
    scenario = panels(reduction={"modes": "all"})
    alpha, beta = 0.4, 2e-5
    for body in scenario["bodies"].values():
        body |= {"damping": {"kind": "rayleigh", "mass": alpha, "stiffness": beta}, "elements": 16}
    del scenario["sweep"]
    system = build_system(load_scenario(scenario))
    beam = Beam(1.0, 1.0, 1.0, 12 * 800.0, 4.0, 16, "clamped")
    n = beam.K.shape[0]
    row, none = beam.whole_row(PLACE)[beam.free], np.zeros(n)
    rows = np.array([np.concatenate([row, none]), np.concatenate([-row, row])])
    K0, M0 = (np.kron(np.eye(2), matrix) for matrix in (beam.K, beam.M))
    alone = np.sqrt(eigh(K0 + 2e5 * np.outer(rows[0], rows[0]), M0, eigvals_only=True)[0])
    dashpot = 2 * 0.05 * 2e5 / alone
    assert [s.dashpot for s in system.snubbers] == pytest.approx([dashpot, dashpot], rel=1e-8)
    K1, C1 = K0 + 2e5 * rows.T @ rows, alpha * M0 + beta * K0 + dashpot * rows.T @ rows
    unit = np.eye(2 * n)
    first = np.block([[0 * unit, unit], [-K1, -C1]])
    poles = eig(first, np.block([[unit, 0 * unit], [0 * unit, M0]]), right=False)
    poles = poles[poles.imag > 0.0]
    poles = poles[np.argsort(np.abs(poles))][:4]
    np.testing.assert_allclose(
        system.modes["closed_damping_ratios"].values[:3], (-poles.real / np.abs(poles))[:3], rtol=1e-6
    )
    np.testing.assert_allclose(
        system.modes["resting_damping_ratios"].values[:3], system.modes["closed_damping_ratios"].values[:3]
    )
    assert system.modes["closed_damping_ratios"].values[0] > 1.3 * 0.05


def test_the_half_power_check_of_the_documents():
    page, _ = text_of_the_page()
    result = beamsim.sweep(load_scenario(panels()))
    (curve,) = result.curves.values()
    assert np.all(curve["contact_share"].values > 1 - 1e-12)  # linear
    response = (curve.channel("displacement", "tip").maximum - curve.channel("displacement", "tip").minimum) / 2
    top, hz = int(response.argmax()), curve.frequency_hz
    half = response[top] / np.sqrt(2)
    low = np.interp(half, response[: top + 1], hz[: top + 1])
    high = np.interp(half, response[top:][::-1], hz[top:][::-1])
    ratio = result["modes"]["closed_damping_ratios"].values[0]
    assert (high - low) / (2 * hz[top]) == pytest.approx(ratio, rel=0.02)
    measured = f"{high - low:.2f} Hz, which is {100 * (high - low) / (2 * hz[top]):.1f} %"
    assert f"peaks at {hz[top]:.1f} Hz with a bandwidth of {measured}" in page.replace("\n", " ")
    assert next(first_modes(result.scenario, result["modes"])) in page
    for _, text in table_rows(result):
        if "it alone closed" in text:
            assert " ".join(text.split()) in " ".join(page.split())
    wanted = float(re.search(r"`coefficient: (\d+) N s/m` in both pads", page).group(1))
    assert build_system(load_scenario(panels(wanted))).modes["closed_damping_ratios"].values[0] == pytest.approx(
        0.05, rel=5e-3
    )


@pytest.mark.parametrize(("dashpot", "noted"), [(None, True), (402.2, False)])
def test_a_note_says_that_the_first_closed_mode_has_other_damping(dashpot, noted):
    notes = [text for text in build_system(load_scenario(panels(dashpot))).warnings if "has a damping ratio of" in text]
    assert len(notes) == noted
    if noted:
        for part in ("18.13 Hz", "6.75 %", "5 % is given for floor, pad"):
            assert part in notes[0]


def test_the_first_closed_mode_of_a_free_body_is_the_first_that_moves_elastically():
    """A mass on a stop alone has a rigid-body mode while it is open."""
    scenario = {
        "chain": {"masses": [1.0, 1.0], "springs": [0.0, 900.0, 0.0],
                  "snubbers": [{"name": "stop", "mass": 1, "side": "below", "stiffness": 100.0}]},
        "excitation": {"kind": "half_sine", "applied_to": {"mass": 2}, "level": "-1 N", "duration": "10 ms"},
        "run": {"duration": 0.1, "start": "rest", "convergence": "off"},
    }  # fmt: skip
    result = beamsim.run(load_scenario(scenario))
    low, high = np.sqrt(eigh([[1000.0, -900.0], [-900.0, 900.0]], eigvals_only=True)) / (2 * np.pi)
    assert high > 6.75 > low
    assert (
        next(first_modes(result.scenario, result["modes"]))
        == f"first mode 6.75 Hz open (0 %), {low:.3g} Hz closed (0 %)"
    )


def test_result_files_keep_the_damping_of_all_states(tmp_path):
    scenario = panels(run={"duration": 0.05, "convergence": "off"})
    del scenario["sweep"]
    result = beamsim.run(load_scenario(scenario))
    write_result(result, tmp_path / "case.h5")
    again = load(tmp_path / "case.h5")
    for name in ("closed_damping_ratios", "resting_damping_ratios", "resting_frequencies_hz"):
        np.testing.assert_array_equal(again["modes"][name], result["modes"][name])
        assert again.summary[name] == result.summary[name]
    assert again.summary["dashpots"] == result.summary["dashpots"]
    for name, of in again.summary["dashpots"].items():
        stop = again["modes"].sel(snubber=name)
        assert of == {"dashpot_n_s_per_m": stop["dashpot"].item(), "from": stop["dashpot_from"].item()}


def test_masses_that_only_dashpots_join_have_no_ratio():
    """Nothing oscillates: both modes are rigid bodies'."""
    scenario = {
        "chain": {"masses": [1.0, 1.0], "springs": [0.0, 0.0, 0.0], "dashpots": [0.0, 5.0, 0.0]},
        "excitation": {"kind": "half_sine", "applied_to": {"mass": 2}, "level": "1 N", "duration": "10 ms"},
        "run": {"duration": 0.1, "start": "rest"},
    }
    table = build_system(load_scenario(scenario)).modes
    assert np.all(np.isnan(table["damping_ratios"].values))
    assert np.all(table["open_frequencies_hz"].values == 0.0)


def test_the_first_screen_has_the_state_at_rest_where_that_is_a_third_one():
    stops = [{"name": f"stop{k}", "mass": 1, "side": side, "stiffness": 300.0, "gap": gap,
              "damping": {"kind": "viscous", "coefficient": 4.0}}
             for k, side, gap in ((1, "below", -1e-3), (2, "above", 1.0))]  # fmt: skip
    scenario = load_scenario(
        {
            "chain": {"masses": [M], "springs": [K], "snubbers": stops},
            "probes": [{"name": "mass", "mass": 1}],
            "run": {"duration": 0.1, "convergence": "off"},
        }
    )  # fmt: skip
    result = beamsim.run(scenario)
    line = next(first_modes(result.scenario, result["modes"]))
    assert line == "first mode 2.52 Hz open (0 %), 3.73 Hz closed (8.5 %), 3.18 Hz at rest (5 %)"
