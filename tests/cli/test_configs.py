"""Every shipped config loads without a warning and does what its sections ask for; numbers are in tests/sameness."""

import json

import pytest
from shipped import PATHS, asked, recorded, shipped, unfit

import beamsim
from beamsim.system.build import build_system
from tests.helpers.commands import invoke

SHORTENED = {
    "continuation_friction sweep": ("sweep.from=4.95 Hz", "sweep.to=5.05 Hz", "sweep.levels=[6 N]"),
    "coexisting_motions sweep": ("sweep.starts.number=20", "sweep.disturbances=[]"),
    "continuation_overlay sweep": ("sweep.from=80 Hz", "sweep.to=86 Hz"),
    "sweep_one_sided_2g sweep": ("sweep.rate=8 oct/min",),
    "sweep_up_down sweep": ("sweep.rate=8 oct/min",),
}
"""Config and command -> overrides that make it short."""

ELSEWHERE = (
    "one_sided_", "prestressed_", "backlash_", "point_force_",  # tests/reference/test_thesis_cases.py
    "ms_", "nnm_forced_mode_",  # tests/reference/test_multiple_scales_thesis.py
    "vibeams sweep",  # tests/reference/test_vibeams.py
    "nnm_chain_mass_", "nnm_thesis_mode_",  # docs/site_pages/validation.py, and docs/site_pages/gallery.py:
    "chain_two_dof", "continuation_60_120hz", "crushed_stop", "identify_snubber", "nnm_first", "plate_panel",
    "random_vibration", "shock_panel", "snubber_rubber", "two_panels run", *recorded(SHORTENED),
)  # fmt: skip
"""Beginnings of config and command, of those that other tests or the documents compute as a whole; tests/sameness makes
the checks of this file as well."""


def test_advice_that_does_not_fit_is_found():
    """The comparison can fail."""
    scenario = shipped(next(path for path in PATHS if path.stem == "random_vibration"))
    assert scenario.run.low_pass is None
    band = "give the band of the accelerometers (run.low_pass: 2 kHz)"
    assert not list(unfit(scenario, [band]))
    assert list(unfit(beamsim.load_scenario(scenario, {"run.low_pass": "2 kHz"}), [band])) == [band]


@pytest.mark.parametrize("path", PATHS, ids=lambda path: path.stem)
def test_config_loads(path):
    scenario = shipped(path)
    assert scenario.warnings == ()
    assert scenario.title
    assert beamsim.load_scenario(scenario.to_yaml()) == scenario
    build_system(scenario)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("path", "command"),
    [
        pytest.param(path, command, id=f"{path.stem} {command}")
        for path in PATHS
        for command in asked(path)
        if not f"{path.stem} {command}".startswith(ELSEWHERE)
    ],
)
def test_config_does_what_it_asks_for(path, command, tmp_path):
    alone = [f"{command}.convergence=off"] if command in ("run", "sweep") else []  # of each analysis in tests/analytic
    changes = [word for change in [*SHORTENED.get(f"{path.stem} {command}", ()), *alone] for word in ("--set", change)]
    arguments = [command, str(path), *changes, "--json", "--no-plots", "-o", f"{tmp_path}/"]
    result = invoke(*arguments)
    assert result.exit_code == 0, result.output
    summary = json.loads(result.stdout)
    assert summary.get("energy_error", 0.0) < 1e-8
    assert not list(unfit(beamsim.load_scenario(path, changes[1::2]), [summary["status"], *summary["warnings"]]))
    assert list(tmp_path.glob("*.h5"))
