"""Every shipped config loads without a warning and does what its sections ask for; numbers are in tests/sameness.

Those whose whole screens are quoted in documents are in test_quoted_screens.py.
"""

import pytest
from shipped import PATHS, asked, shipped, unfit

import beamsim
from beamsim.system.build import build_system
from tests.helpers.quoted import is_whole, wrong_on_screen
from tests.helpers.solved import SHORTENED, words_of


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
"""Shipped configs by command, without those whose screen a document quotes as a whole."""
for path in PATHS:
    for command in (each for each in asked(path) if not is_whole(path, each)):
        COMMANDS.setdefault(command, []).append(path)


@pytest.mark.parametrize("command", sorted(COMMANDS))
def test_configs_do_what_they_ask_for_and_their_screens_say_what_came_out(command, solve):
    """No verdict, heading, sentence or remedy of the screen contradicts a number of the file."""
    checked = {path.stem: faults(path, command, solve) for path in COMMANDS[command]}
    assert checked
    assert {name: found for name, found in checked.items() if found} == {}


def faults(path, command, solve):
    """What is wrong with the screen and the file of a command on a config."""
    done = solve(*words_of(command, path))
    if done.exit_code:
        return [done.output]
    changed = beamsim.load_scenario(path, SHORTENED.get(f"{path.stem} {command}", ()))
    return wrong_on_screen(done.stdout, done.file, command, changed)


@pytest.mark.parametrize(
    "path",
    [path for path in PATHS if shipped(path).study is not None and not is_whole(path, "sweep")],
    ids=lambda path: path.stem,
)
def test_the_screen_of_a_study_says_what_came_out(path, solve):
    assert faults(path, "sweep", solve) == []
