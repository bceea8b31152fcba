"""How long a swept sine takes is said before it starts."""

import re

import pytest
import yaml

import beamsim
from beamsim.flow.compiled import processor_time
from beamsim.scenario import load_scenario
from beamsim.trust import expected_time as module
from beamsim.trust.expected_time import expected_time
from tests.helpers.commands import invoke

SWEPT = yaml.safe_load("""
chain: {masses: [1 kg, 1 kg], springs: [100 kN/m, 100 kN/m], damping: {kind: modal, ratio: 0.01}}
snubbers: [{name: stop, mass: 2, side: both, gap: 0.5 mm, stiffness: 1e6}]
excitation: {kind: swept_sine, applied_to: base, from: 60 Hz, to: 15 Hz, rate: 60 oct/min, level: 0.5 g}
run: {duration: 2 s}
""")


@pytest.fixture
def any_length(monkeypatch):
    """Short runs are estimated, too."""
    monkeypatch.setattr(module, "WORTH_ESTIMATING", 1)


def test_the_time_of_a_swept_sine_is_known_within_a_factor_of_two(any_length):
    scenario = load_scenario(SWEPT)
    expected_time(scenario)  # compiles
    expected, begin = expected_time(scenario), processor_time()
    beamsim.run(scenario)
    assert 0.5 < (processor_time() - begin) / expected < 2.0


def test_the_command_says_it_before_it_starts(any_length, tmp_path):
    swept = {"excitation": SWEPT["excitation"] | {"to": "30 Hz"}, "run": {"duration": "1 s", "convergence": "off"}}
    (tmp_path / "case.yaml").write_text(yaml.safe_dump(SWEPT | swept))
    told = r"^beamsim: simulating case.yaml \(\d+ cycles\) takes about [\d.]+ s of processor time\n"
    done = invoke("run", tmp_path / "case.yaml", "--no-plots", "-o", tmp_path / "case.h5")
    assert re.match(told, done.stderr)
    done = invoke("run", tmp_path / "case.yaml", "--no-plots", "--quiet", "-o", tmp_path / "case.h5")
    assert "takes about" not in done.output


def test_other_runs_and_short_ones_are_not_estimated(tmp_path):
    assert expected_time(load_scenario(SWEPT)) is None
    harmonic = SWEPT | {"excitation": {"kind": "harmonic", "applied_to": "base", "frequency": 5.0, "level": 1.0}}
    assert expected_time(load_scenario(harmonic | {"run": {"duration": 1e4, "sample_rate": 1e3}})) is None
