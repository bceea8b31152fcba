"""Every shipped config loads without a warning; that it does what its sections ask for is in tests/sameness."""

import pytest
from shipped import PATHS, shipped

import beamsim
from beamsim.system.build import build_system


@pytest.mark.parametrize("path", PATHS, ids=lambda path: path.stem)
def test_config_loads(path):
    scenario = shipped(path)
    assert scenario.warnings == ()
    assert scenario.title
    assert beamsim.load_scenario(scenario.to_yaml()) == scenario
    build_system(scenario)
