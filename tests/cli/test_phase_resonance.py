"""`nnm: {phase_resonance: …}`: from the config to the file, and against a transient."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

import beamsim
from beamsim.analyses.continuation import motion
from beamsim.analyses.nnm import phase_resonance
from beamsim.analyses.nnm.analysis import nnm
from beamsim.cli.tables import table_rows
from beamsim.errors import ScenarioError
from beamsim.orbits.continuation import BranchStep
from beamsim.scenario import load_scenario
from beamsim.store.results import load
from tests.helpers.commands import invoke

CONFIGS = Path(__file__).parents[2] / "configs"
BACKBONE = CONFIGS / "nnm_forced_backbone.yaml"
SHORT = {"nnm.continue_in": {"kind": "energy", "from": "5 mJ", "to": "30 mJ"}}


@pytest.fixture(scope="module")
def held():
    levels = {"nnm.phase_resonance": {"levels": ["0.8 g", "1.4 g"], "periods": 12, "span": "6 %"}}
    return nnm(load_scenario(BACKBONE, SHORT | levels))


def test_predicted_and_found(held):
    result = held.phase_resonance
    assert result.outcome.complete
    assert held.complete
    assert result.unit == "m/s^2"
    assert result.probe == "tip"
    for m, level in zip(result.motions, (0.8, 1.4), strict=True):
        assert m.level == pytest.approx(level * 9.80665)
        assert m.found
        assert m.residual < 1e-10
        assert abs(m.quadrature) < 1e-7
        assert m.frequency_hz == pytest.approx(m.predicted_frequency_hz, rel=2e-3)
        assert m.amplitude["tip"] == pytest.approx(m.predicted_amplitude["tip"], rel=0.08)
        assert m.level_for_amplitude == pytest.approx(m.level, rel=0.05)
        assert m.stable
    energy = result.predicted.energy
    assert np.all(np.diff(energy) > 0)
    first, second = result.motions
    assert energy[0] < first.predicted_energy < second.predicted_energy < energy[-1]


@pytest.mark.slow
def test_energies_are_in_balance_and_a_lost_one_is_not_trusted(held, monkeypatch):
    for m in held.phase_resonance.motions:
        assert 0.0 < m.energy_error < 1e-10
        assert m.curve.energy_error.shape == m.curve.frequency_hz.shape
        assert m.curve.energy_error.max() < 1e-10
    levels = {"nnm.phase_resonance": {"levels": ["0.8 g"], "periods": 1, "span": "1 %"}}
    monkeypatch.setattr(motion, "energy_error", lambda flow, flow_map: 3e-5)
    lost = nnm(load_scenario(BACKBONE, SHORT | levels))
    assert lost.phase_resonance.outcome.code == "orbit_energy_not_balanced"
    assert "at level 7.84532 m/s^2" in lost.status
    assert not lost.outcome.trusted
    assert lost.phase_resonance.motions[0].found  # and kept


@pytest.mark.slow
def test_a_level_is_found_beside_a_thin_tongue(held, monkeypatch):
    """Where no motion is found on the way from one point of the backbone to the next, halves of it are tried."""
    tried = []

    class Blocked(BranchStep):
        def locate(self, *functions):
            tried.append(self.b.parameter - self.a.parameter)
            return super().locate(*functions) if len(tried) > 2 else None

    monkeypatch.setattr(phase_resonance, "BranchStep", Blocked)
    levels = {"nnm.phase_resonance": {"levels": ["0.8 g"], "periods": 1, "span": "1 %"}}
    motion = nnm(load_scenario(BACKBONE, SHORT | levels)).phase_resonance.motions[0]
    assert motion.predicted_energy == pytest.approx(held.phase_resonance.motions[0].predicted_energy, rel=1e-6)
    np.testing.assert_allclose(np.array(tried[1:3]) / tried[0], [0.5, 0.25], rtol=1e-6)


@pytest.mark.slow
def test_a_level_is_found_beside_motions_on_which_the_force_does_no_work():
    """They are in tongues, through which the search for the level goes; it was refused."""
    asked = {"nnm.phase_resonance": {"levels": ["0.3 g"], "periods": 1, "span": "1 %"}}
    (m,) = nnm(load_scenario(BACKBONE, asked)).phase_resonance.motions
    assert m.found
    assert m.level == pytest.approx(0.3 * 9.80665)
    assert m.residual < 1e-10
    assert abs(m.quadrature) < 1e-7
    assert m.frequency_hz == pytest.approx(m.predicted_frequency_hz, rel=2e-3)


def test_response_rides_the_backbone(held):
    """The largest response at each level lies on the backbone; the twin, the smaller level's curve, does not."""
    ridge = held.phase_resonance.predicted

    def beside(curve, amplitude):
        return np.interp(amplitude, ridge.amplitude["tip"], ridge.frequency_hz) - curve

    peaks = []
    for m in held.phase_resonance.motions:
        k = int(np.argmax(m.curve.peak_displacement["tip"]))
        peaks.append((m.curve.frequency_hz[k], m.curve.peak_displacement["tip"][k]))
        assert m.curve.frequency_hz[0] == pytest.approx(0.94 * m.frequency_hz, rel=1e-9)
        assert abs(beside(*peaks[-1])) < 2e-3 * peaks[-1][0]
    assert abs(beside(peaks[0][0], peaks[1][1])) > abs(beside(*peaks[1]))


def test_a_transient_comes_to_the_same_motion(held):
    """The exact motion at phase resonance, by `beamsim run` from rest."""
    m = held.phase_resonance.motions[0]
    periods = 150
    run = {"duration": periods / m.frequency_hz, "sample_rate": 256 * m.frequency_hz, "start": "rest"}
    scenario = load_scenario(
        BACKBONE, {"excitation.frequency": m.frequency_hz, "excitation.level": m.level, "run": run, "nnm": None}
    )
    result = beamsim.run(scenario)
    x = result["histories"]["displacement"].sel(probe="tip").values[-257:-1]
    if np.abs(x).max() < 0.5 * m.amplitude["tip"]:
        pytest.fail("the transient fell to the other stable motion")
    assert np.abs(x).max() == pytest.approx(m.amplitude["tip"], rel=1e-3)


def test_held_motion(held):
    """Carried from the mode itself it stays near, and its second instant is half a period after the first."""
    for m in held.phase_resonance.motions:
        h = m.held
        assert h.departure.size == 12
        assert h.departure.max() < 0.25
        assert np.diff(h.instants) == pytest.approx(0.5 / m.predicted_frequency_hz)
        assert np.abs(h.shapes - h.mode_shapes).max() < 0.25 * np.abs(h.mode_shapes).max()
        line = int(np.argmax(h.amplitude["tip"][1:])) + 1
        assert h.frequency_hz[line] == pytest.approx(m.predicted_frequency_hz, rel=1e-9)
        assert h.time.size == h.displacement["tip"].size


@pytest.mark.slow
def test_scales_with_the_level():
    """Without gap: twice the level, twice the motion, one frequency."""
    changes = {
        "nnm.continue_in": {"kind": "stiffness_factor", "from": 0, "to": 0.2},
        "nnm.phase_resonance": {"levels": ["1 g", "2 g"], "periods": 5},
    }
    result = nnm(load_scenario(CONFIGS / "nnm_forced_mode_1.yaml", changes)).phase_resonance
    one, two = result.motions
    assert result.scales
    assert two.frequency_hz == pytest.approx(one.frequency_hz, rel=1e-9)
    assert two.amplitude["tip"] == pytest.approx(2 * one.amplitude["tip"], rel=1e-7)
    assert two.predicted_energy == pytest.approx(4 * one.predicted_energy, rel=1e-10)
    per_level = result.predicted.amplitude["tip"] / result.predicted.level
    np.testing.assert_allclose(per_level, one.predicted_amplitude["tip"] / one.level, rtol=1e-9)


def test_point_force_on_a_chain():
    """A force on a mass, by the excitation's own level, in newtons."""
    case = {
        "title": "Chain",
        "chain": {
            "masses": [1, 1, 1], "springs": [1, 1, 1, 1], "dashpots": [0.01, 0.01, 0.01, 0.01],
            "snubbers": [{"name": "stop", "mass": 3, "side": "below", "stiffness": 2, "gap": 0.2}],
        },
        "excitation": {"kind": "harmonic", "applied_to": {"mass": 1}, "level": "5 mN", "frequency": "0.13 Hz"},
        "nnm": {
            "mode": 1, "continue_in": {"kind": "energy", "from": "10 mJ", "to": "1 J"},
            "phase_resonance": {"periods": 5},
        },
    }  # fmt: skip
    result = nnm(load_scenario(case)).phase_resonance
    assert result.unit == "N"
    (m,) = result.motions
    assert m.found
    assert m.level_for_amplitude == pytest.approx(5e-3, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "where", "text"),
    [
        ({"nnm.phase_resonance.levels": ["90 g"]}, "nnm.phase_resonance.levels[0]", "follow it to about"),
        ({"nnm.phase_resonance.levels": ["0.1 g"]}, "nnm.phase_resonance.levels[0]", "below the backbone"),
        ({"beam.damping": None, "snubbers[0].damping": None}, "nnm.phase_resonance", "no damping"),
    ],
)
def test_what_only_the_motions_show_is_refused(changes, where, text):
    with pytest.raises(ScenarioError) as error:
        nnm(load_scenario(BACKBONE, SHORT | changes))
    assert error.value.problems[0].path == where
    assert error.match(text)


def test_a_force_at_a_node_is_refused():
    """The middle mass of three stands still in the second mode."""
    case = {
        "title": "Chain",
        "chain": {
            "masses": [1, 1, 1], "springs": [1, 1, 1, 1], "dashpots": [0.01, 0.01, 0.01, 0.01],
            "snubbers": [{"name": "stop", "mass": 2, "side": "below", "stiffness": 2, "gap": 0.2}],
        },
        "excitation": {"kind": "harmonic", "applied_to": {"mass": 2}, "level": "5 mN", "frequency": "0.13 Hz"},
        "nnm": {
            "mode": 2, "continue_in": {"kind": "energy", "from": "10 mJ", "to": "1 J"},
            "phase_resonance": {"periods": 5},
        },
    }  # fmt: skip
    with pytest.raises(ScenarioError, match="node"):
        nnm(load_scenario(case))


def test_pictures_and_table(held):
    figures = held.plot()
    held_pictures = {"held_departure", "held_shapes", "held_spectrum"}
    assert {"phase_resonance", "phase_resonance_level"} | held_pictures <= set(figures)
    ax = figures["phase_resonance"].axes[0]
    assert {"nonlinear mode", "predicted", "phase resonance"} <= {line.get_label() for line in ax.lines}
    assert {text.get_text() for text in ax.texts} == {"0.8 g", "1.4 g"}  # with leaders to the curves' peaks
    assert figures["phase_resonance_level"].axes[0].get_ylabel() == "Level (g)"
    rows = [text.split() for _, text in table_rows(held)]
    assert any(cells[:1] == ["stable"] and "yes" in cells for cells in rows)


@pytest.mark.slow
def test_command(tmp_path):
    overrides = ["nnm.continue_in.from=6 mJ", "nnm.continue_in.to=7 mJ", "nnm.phase_resonance.levels=[0.65 g]",
                 "nnm.phase_resonance.periods=6"]  # fmt: skip
    arguments = [x for o in overrides for x in ("--set", o)]
    done = invoke("nnm", BACKBONE, "-o", tmp_path, "--json", "--no-plots", *arguments)
    assert done.exit_code == 0, done.output
    level = json.loads(done.stdout)["phase_resonance"]["levels"][0]
    assert level["found"]
    assert level["periods"] == 6
    with h5py.File(tmp_path / "nnm_forced_backbone.h5") as file:
        predicted = file["phase_resonance_predicted"]
        assert predicted["level"].attrs["units"] == "m/s^2"
        assert predicted["level"].dims[0][0] == predicted["point"]
        assert (held := file["phase_resonance_levels_held_instants"])["shapes"].dims[1][0] == held["position"]
    m = load(tmp_path / "nnm_forced_backbone.h5").phase_resonance.motions[0]
    assert m.frequency_hz == level["frequency_hz"]
    assert m.curve.stable.dtype == bool
    assert m.held.displacement["tip"].size == m.held.time.size
