"""Units that a scenario chooses for tables, plots and reports; files and --json stay in SI units."""

import json
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from beamsim.analyses.continuation.result import ContinuationResult
from beamsim.errors import ScenarioError
from beamsim.orbits.branch import reached_end
from beamsim.outcomes import Outcome, OutcomeKind, Where
from beamsim.plots.run import run_figures
from beamsim.plots.style import amount, level_text, scale_for, use_units, value_text
from beamsim.scenario import load_scenario
from tests.helpers.commands import invoke

MASS = {"chain": {"masses": [1.0], "springs": [1000.0]}}
CHOSEN = {"acceleration": "m/s^2", "length": "um", "force": "kN", "time": "min", "stress": "MPa"}
CASE = {
    **MASS,
    "excitation": {"kind": "harmonic", "applied_to": "base", "level": 3.0, "frequency": 4.0},
    "run": {"duration": 2.0, "sample_rate": 1000.0, "convergence": "off"},
}


def chosen(**units):
    return load_scenario({**MASS, "units": units}).display_scales


def test_amounts_are_shown_in_the_units_chosen():
    with use_units(chosen(**CHOSEN)):
        assert amount(0.0123, "m") == "1.23e+04 um"
        assert amount(851.8, "N") == "0.8518 kN"
        assert amount(2.0, "g") == amount(19.6133, "m/s^2") == "19.61 m/s^2"
        assert amount(90.0, "s") == "1.5 min"
        assert amount(2.5e7, "Pa") == "25 MPa"
        assert level_text(19.6133, "m/s^2") == "level 19.61 m/s^2"
        assert scale_for("m", np.array([1e-9])).unit == "um"
        assert amount(5.0, "N/m") == "5 N/m"  # not chosen
    assert amount(851.8, "N") == "851.8 N"
    assert amount(1.5, "s") == "1.5 s"  # times over a second are in seconds
    assert scale_for("m/s^2").unit == "g"


def test_continuations_and_outcomes_use_them():
    """They were in SI units alone, whatever the scenario is written in."""
    grazing = {"kind": "grazing", "snubber": "tip", "parameter": 19.6133, "period_multiple": 1, "level": float("nan")}
    result: Any = SimpleNamespace(unit="m/s^2", level_unit="m/s^2")
    entry = next(entry for entry in ContinuationResult.SUMMARY if entry.name == "special_points")
    units = {key: ContinuationResult.unit_of(result, entry, (), (key,), grazing) for key in ("parameter", "level")}
    assert {key: value_text(key, grazing[key], unit) for key, unit in units.items()} == {
        "parameter": "2 g",
        "level": "",
    }
    missing = Outcome.of(OutcomeKind.NOTED, "none", "no stable motion", at=Where([(9.80665, 19.6133)], "m/s^2"))
    whole = Outcome.of(OutcomeKind.COMPLETE, "end", "reached the end", missing, at=Where(0.0012, "m"))
    assert (
        whole.in_display_units(scale_for).text == "complete: reached the end at 1.2 mm; no stable motion from 1 to 2 g"
    )
    within = missing.copy_with(context=Where(4.903325, "m/s^2", "level"))
    assert within.in_display_units(scale_for).text == "level 0.5 g: no stable motion from 1 to 2 g"
    with use_units(chosen(**CHOSEN)):
        assert missing.in_display_units(scale_for).message == "no stable motion from 9.80665 to 19.6133 m/s^2"
    assert reached_end(65.5).in_unit(float, "Hz").in_display_units(scale_for).text.endswith("65.5 Hz")


def test_g_is_gravity_in_an_acceleration_and_gram_in_a_mass():
    with use_units(chosen(acceleration="g", mass="g")):
        assert amount(9.80665, "m/s^2") == "1 g"
        assert amount(0.0042, "kg") == "4.2 g"


@pytest.mark.parametrize(("name", "unit"), [("length", "N"), ("force", "parsnip"), ("acceleration", "m"), ("time", "")])
def test_a_unit_of_something_else_is_an_error_with_a_remedy(name, unit):
    with pytest.raises(ScenarioError) as caught:
        chosen(**{name: unit})
    (problem,) = caught.value.problems
    assert problem.path == f"units.{name}"
    assert problem.remedy


def test_the_section_is_kept_and_left_out():
    scenario = load_scenario({**MASS, "units": CHOSEN})
    assert load_scenario(scenario.to_yaml()).units == scenario.units
    assert "units" not in load_scenario(MASS).to_yaml()


WRITTEN = """
beam: {length: 270 mm, width: 50 mm, thickness: 0.005, youngs_modulus: 69 GPa, density: 2700 kg/m^3,
       supports: {left: clamped, right: free}, point_masses: [{position: 27 cm, mass: 4 g}]}
excitation: {kind: harmonic, applied_to: base, level: 20 m/s^2, frequency: 65 Hz}
run: {duration: 0.5 min}
"""


def test_units_are_those_that_quantities_are_written_in():
    scenario = load_scenario(WRITTEN)
    assert scenario.units.model_dump(exclude_none=True) == {"acceleration": "m/s^2", "length": "mm", "time": "min"}
    chosen_length = load_scenario(WRITTEN, {"units": {"length": "in"}}).units
    assert (chosen_length.length, chosen_length.acceleration) == ("in", "m/s^2")
    assert load_scenario(scenario.to_yaml()).units == scenario.units  # as result files hold it
    with use_units(scenario.display_scales):
        assert amount(0.0123, "m") == "12.3 mm"
        assert amount(90.0, "s") == "1.5 min"
        assert amount(0.003, "s") == "3 ms"  # not in minutes
    scenario = load_scenario(WRITTEN, ["excitation.level=2 g", "run.duration=500 ms"])
    assert scenario.display_scales.keys() == {"m/s^2", "m"}


def test_long_times_are_in_units_that_a_reader_uses():
    assert [amount(t, "s") for t in (599.0, 900.0, 5.4e4, 1e6)] == ["599 s", "15 min", "15 h", "11.57 days"]
    assert amount(101.5e9, "s") == "3216 years"
    with use_units(chosen(time="min")):
        assert amount(5.4e4, "s") == "900 min"
        assert amount(101.5e9, "s") == "3216 years"


def test_run_info_and_plots_use_them_and_json_does_not(tmp_path, monkeypatch):
    (tmp_path / "case.yaml").write_text(json.dumps({**CASE, "units": CHOSEN}))
    printed = invoke("run", tmp_path / "case.yaml", "-o", tmp_path, "--no-plots", "-v")
    assert printed.exit_code == 0, printed.output
    displacement, acceleration = printed.output.partition("peak displacement")[2].split("peak acceleration")
    row = displacement.splitlines()[0]
    assert " um" in row
    assert " m/s^2" in acceleration.splitlines()[0]
    again = invoke("info", tmp_path / "case.h5")
    assert row in again.output
    as_json = json.loads(invoke("info", tmp_path / "case.h5", "--json").stdout)
    peak = next(iter(as_json["peak_displacement_m"].values()))
    assert 1e-4 < peak < 1.0
    assert f"{1e6 * peak:.4g} um" in row

    from beamsim.store.results import load

    result = load(tmp_path / "case.h5")
    above = result.plot()["displacement"].axes[0]
    assert above.get_ylabel() == "Relative displacement (um)"
    assert np.abs(above.lines[0].get_ydata()).max() == pytest.approx(1e6 * peak, rel=1e-3)
    assert f"{1e6 * peak:.4g} um" in result._repr_html_()
    below = run_figures(result)["displacement"].figure().axes[1]
    assert below.get_xlabel() == "Time (s)"

    drawn = []
    monkeypatch.setattr("beamsim.plots.animation.save_gif", lambda *_: drawn.append(scale_for("m", np.ones(1)).unit))
    animated = invoke("animate", tmp_path / "case.h5", "-o", tmp_path / "case.gif")
    assert animated.exit_code == 0, animated.output
    assert drawn == ["um"]
