"""Every shipped config loads without a warning, and does what its sections ask for."""

import pytest
from shipped import PATHS, shipped

import beamsim
from beamsim.system.build import build_system

ALREADY_RUN = (
    *("one_sided_", "prestressed_", "backlash_", "point_force_"),  # tests/reference/test_thesis_cases.py
    "imported_panel",  # tests/sameness, tests/analytic/test_recovery_matrices.py
)


@pytest.mark.parametrize("path", PATHS, ids=lambda path: path.stem)
def test_config_loads(path):
    scenario = shipped(path)
    assert scenario.warnings == ()
    assert scenario.title
    assert beamsim.load_scenario(scenario.to_yaml()) == scenario
    build_system(scenario)


# a comparison with a larger model beside each is among those of tests/sameness
SHORTER = {"random_vibration": {"run.duration": 0.5, "run.spectrum.last": 0.3}}
SLOW = ("plate_panel", "pressure_on_plate", "shock_panel")  # parts of these run in tests/analytic
RUN = [path for path in PATHS if not path.stem.startswith(ALREADY_RUN) and shipped(path).run]


@pytest.mark.parametrize(
    "path", [pytest.param(path, id=path.stem, marks=[pytest.mark.slow] * (path.stem in SLOW)) for path in RUN]
)
def test_config_runs(path):
    result = beamsim.run(beamsim.load_scenario(path, {"run.convergence": "off", **SHORTER.get(path.stem, {})}))
    assert result.complete
    assert result.summary["energy_error"] < 1e-8
