"""The user's interface: the example files load as they stand, with the values they mean."""

from pathlib import Path

import pytest

from beamsim.scenario import load_scenario
from beamsim.scenario.body import ModalDamping
from beamsim.scenario.connections import SnubberRatioDamping
from beamsim.scenario.excitation import Harmonic
from beamsim.scenario.quantities import Rate
from beamsim.scenario.sweep import EnergyContinuation, StiffnessFactorContinuation, SweptSine

pytestmark = pytest.mark.quick

EXAMPLES = Path(__file__).parents[1] / "data" / "examples"
FILES = sorted(EXAMPLES.glob("*.yaml"))
G = 9.80665


def test_all_are_here():
    assert len(FILES) == 12


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_loads_without_doubts_and_round_trips(path):
    scenario = load_scenario(path)
    again = load_scenario(scenario.to_yaml())
    assert again == scenario
    assert hash(again) == hash(scenario)
    assert again.to_yaml() == scenario.to_yaml()
    # the outer panel's fibre has no modulus, so that it gives no stress
    assert len(scenario.warnings) == (path.stem == "two_panels")
    assert scenario.source == path.stem


def test_one_sided():
    scenario = load_scenario(EXAMPLES / "one_sided_65hz.yaml")
    beam = scenario.beam
    assert (beam.length, beam.width, beam.thickness) == (0.27, 0.05, 0.005)
    assert (beam.youngs_modulus, beam.density, beam.elements) == (69e9, 2700.0, 20)
    assert (beam.supports.left, beam.supports.right) == ("clamped", "free")
    assert beam.damping == ModalDamping(ratio=0.01)
    assert [(mass.position, mass.mass) for mass in beam.point_masses] == [
        (0.135, 0.0042),
        (0.2025, 0.0042),
        (0.27, 0.0042),
    ]
    (snubber,) = scenario.all_snubbers
    assert (snubber.name, snubber.position, snubber.side, snubber.mounted_on) == ("tip", 0.27, "below", "base")
    assert (snubber.stiffness, snubber.gap, snubber.preload, snubber.law) == (151100.0, 0.0, None, "kelvin_voigt")
    assert snubber.damping == SnubberRatioDamping(ratio=0.02)
    assert scenario.excitation == Harmonic(
        applied_to="base", level=2 * G, frequency=65.0, quantity="acceleration", phase=0.0
    )
    assert scenario.excitation.frequencies_hz == (65.0,)
    assert [(probe.name, probe.position) for probe in scenario.probes] == [("tip", 0.27), ("middle", 0.135)]
    run = scenario.run
    assert (run.duration, run.sample_rate, run.start) == (0.8, 20e3, "static_equilibrium")
    assert (run.spectrum.last, run.spectrum.window) == (0.4, "hann")
    assert (run.method, run.integrator) == ("exact", "BDF")


def test_extending_files_change_only_what_they_say():
    base = load_scenario(EXAMPLES / "one_sided_65hz.yaml")
    swept = load_scenario(EXAMPLES / "sweep_up_down.yaml")
    assert swept.title == "Swept sine, 20 to 400 Hz and back"
    assert (swept.beam, swept.snubbers, swept.run) == (base.beam, base.snubbers, base.run)
    assert swept.sweep == SweptSine(
        from_=20.0, to=400.0, rate=Rate(2 / 60, "oct/s"), direction="both", levels=(G, 2 * G)
    )
    backlash = load_scenario(EXAMPLES / "nnm_energy.yaml")
    assert backlash.snubbers[0].gap == 0.0001
    assert backlash.nnm.continue_in == EnergyContinuation(from_=1e-6, to=1.0)
    assert load_scenario(EXAMPLES / "nnm_first.yaml").nnm.continue_in == StiffnessFactorContinuation(from_=0.0, to=1.0)
