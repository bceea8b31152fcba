"""Every shipped config loads without a warning and does what its sections ask for; numbers are in tests/sameness.

Those whose whole screens are quoted in documents are in test_quoted_screens.py.
"""

import pytest
from shipped import PATHS, asked, shipped, unfit

import beamsim
from beamsim.system.build import build_system
from tests.helpers.commands import invoke
from tests.helpers.quoted import is_whole, wrong_on_screen

SHORTENED = {
    "chain_bumpers sweep": ("sweep.from=10 Hz", "sweep.to=11 Hz"),
    "coexisting_motions sweep": ("sweep.starts.number=20", "sweep.disturbances=[]"),
    "continuation_60_120hz sweep": ("sweep.from=96 Hz", "sweep.to=120 Hz", "sweep.seek_at=0"),
    "continuation_friction sweep": ("sweep.from=4.95 Hz", "sweep.to=5.05 Hz", "sweep.levels=[6 N]"),
    "continuation_overlay sweep": ("sweep.from=80 Hz", "sweep.to=86 Hz"),
    "nnm_first nnm": ("nnm.continue_in.to=0.1", "reduction.modes=4"),
    "nnm_forced_backbone nnm": ("nnm.phase_resonance.levels=[1 g]",),
    "sweep_backlash sweep": ("sweep.rate=16 oct/min", "sweep.levels=[2 g]"),
    "sweep_notched sweep": ("sweep.to=90 Hz",),
    "sweep_one_sided_2g sweep": ("sweep.rate=16 oct/min",),
    "sweep_up_down sweep": ("sweep.rate=16 oct/min", "sweep.levels=[2 g]"),
    "vibeams sweep": ("sweep.levels=[0.028 m/s^2]",),
}
"""Config and command -> overrides that make it short."""


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


COMMANDS = {}
"""Shipped configs by command."""
for path in PATHS:
    for command in asked(path):
        COMMANDS.setdefault(command, []).append(path)


@pytest.mark.parametrize("command", sorted(COMMANDS))
def test_configs_do_what_they_ask_for_and_their_screens_say_what_came_out(command, tmp_path):
    """No verdict, heading, sentence or remedy of the screen contradicts a number of the file."""
    paths = [path for path in COMMANDS[command] if not is_whole(path, command)]
    checked = {path.stem: faults(path, command, tmp_path / path.stem) for path in paths}
    assert checked
    assert {name: found for name, found in checked.items() if found} == {}


def faults(path, command, folder):
    """What is wrong with the screen and the file of a command on a config."""
    changes = [word for change in SHORTENED.get(f"{path.stem} {command}", ()) for word in ("--set", change)]
    done = invoke(command, path, *changes, "--no-plots", "-o", f"{folder}/")
    if done.exit_code:
        return [done.output]
    (file,) = folder.glob("*.h5")
    return wrong_on_screen(done.stdout, file, command, beamsim.load_scenario(path, changes[1::2]))


STUDIES = {
    "design_robust": ("vary.tolerances.samples=3", "vary.tolerances.quantile=0.5", "vary.parameters[0].points=2"),
    "design_stiffness_gap": ("vary.parameters[0].points=3", "vary.parameters[1].points=3"),
    "design_tolerances": ("vary.samples=10",),
    "design_two_motions": ("vary.samples=12",),
    "exceedance": ("vary.samples=100", "limits.peak_force=21 N"),
}
"""Study -> overrides that make it short."""


@pytest.mark.parametrize(
    "path",
    [path for path in PATHS if shipped(path).study is not None and not is_whole(path, "sweep")],
    ids=lambda path: path.stem,
)
def test_the_screen_of_a_study_says_what_came_out(path, tmp_path):
    changes = [word for change in STUDIES.get(path.stem, ()) for word in ("--set", change)]
    done = invoke("sweep", path, *changes, "--no-plots", "--workers", 1, "-o", f"{tmp_path}/")
    assert done.exit_code == 0, done.output
    (file,) = tmp_path.glob("*.h5")
    assert wrong_on_screen(done.stdout, file, "sweep", beamsim.load_scenario(path, changes[1::2])) == []
