"""`nnm: {phase_resonance: …}`: from the config to the file, and against a transient."""

import json

import h5py
import numpy as np
import pytest
from shipped import config_path

import beamsim
from beamsim.analyses.nnm import phase_resonance
from beamsim.analyses.nnm.analysis import nnm
from beamsim.cli.tables import table_rows
from beamsim.errors import ScenarioError
from beamsim.orbits.continuation import BranchStep
from beamsim.responses import periodic_motion
from beamsim.results.branch import rows_by_owner
from beamsim.scenario import load_scenario
from beamsim.store.results import load
from tests.helpers.commands import invoke

BACKBONE = config_path("nnm_forced_backbone")
SHORT = {"nnm.continue_in": {"kind": "energy", "from": "5 mJ", "to": "30 mJ"}}

CHAIN = {
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


@pytest.fixture(scope="module")
def chain():
    """A force on a mass, by the excitation's own level, in newtons."""
    return nnm(load_scenario(CHAIN))


@pytest.fixture(scope="module")
def held():
    levels = {"nnm.phase_resonance": {"levels": ["0.8 g", "1.4 g"], "periods": 12, "span": "6 %"}}
    return nnm(load_scenario(BACKBONE, SHORT | levels))


def of_levels(result):
    """What is known of each level, and its response about the resonance."""
    return rows_by_owner(result["phase_resonance"], result["resonance_curves"], "level_index")


def test_predicted_and_found(held):
    result = held["phase_resonance"]
    assert result["outcome"].item() == "complete"
    assert held.complete
    assert result["level"].unit == "m/s^2"
    assert result["compared_probe"].item() == "tip"
    assert result["level"].values == pytest.approx(np.array([0.8, 1.4]) * 9.80665)
    for k in (0, 1):
        m = result.sel(level_index=k)
        predicted, found = (m[f"{of}amplitude"].sel(probe="tip").item() for of in ("predicted_", ""))
        assert m["found"].item()
        assert m["residual"].item() < 1e-10
        assert abs(m["quadrature"].item()) < 1e-7
        assert m["frequency_hz"].item() == pytest.approx(m["predicted_frequency_hz"].item(), rel=2e-3)
        assert found == pytest.approx(predicted, rel=0.08)
        assert m["level_for_amplitude"].item() == pytest.approx(m["level"].item(), rel=0.05)
        assert m["stable"].item()
    energy = held["predicted_levels"]["energy"].values
    assert np.all(np.diff(energy) > 0)
    first, second = result["predicted_energy"].values
    assert energy[0] < first < second < energy[-1]


def test_energies_are_in_balance_and_a_lost_one_is_not_trusted(held, chain, monkeypatch):
    assert np.all(held["phase_resonance"]["energy_error"].values > 0.0)
    assert held["phase_resonance"]["energy_error"].values.max() < 1e-10
    assert held["resonance_curves"]["energy_error"].values.max() < 1e-10
    assert chain.outcome.trusted
    monkeypatch.setattr(periodic_motion, "energy_errors", lambda motions: np.full(len(motions.maps), 3e-5))
    lost = nnm(load_scenario(CHAIN))
    assert lost["phase_resonance"]["outcome"].item() == "orbit_energy_not_balanced"
    assert "at level 0.005 N" in lost.status
    assert not lost.outcome.trusted
    assert lost["phase_resonance"]["found"].values.all()  # and kept


def test_a_level_is_found_beside_a_thin_tongue(chain, monkeypatch):
    """Where no motion is found on the way from one point of the backbone to the next, halves of it are tried."""
    tried = []

    class Blocked(BranchStep):
        def locate(self, *functions):
            tried.append(self.b.parameter - self.a.parameter)
            return super().locate(*functions) if len(tried) > 2 else None

    monkeypatch.setattr(phase_resonance, "BranchStep", Blocked)
    one, other = (each["phase_resonance"] for each in (nnm(load_scenario(CHAIN)), chain))
    assert one["predicted_energy"].values[0] == pytest.approx(other["predicted_energy"].values[0], rel=1e-6)
    np.testing.assert_allclose(np.array(tried[1:3]) / tried[0], [0.5, 0.25], rtol=1e-6)


def test_a_level_is_found_beside_motions_on_which_the_force_does_no_work():
    """They are in tongues, through which the search for the level goes; it was refused."""
    asked = {"nnm.phase_resonance": {"levels": ["0.3 g"], "periods": 1, "span": "1 %"}}
    m = nnm(load_scenario(BACKBONE, asked))["phase_resonance"].sel(level_index=0)
    assert m["found"].item()
    assert m["level"].item() == pytest.approx(0.3 * 9.80665)
    assert m["residual"].item() < 1e-10
    assert abs(m["quadrature"].item()) < 1e-7
    assert m["frequency_hz"].item() == pytest.approx(m["predicted_frequency_hz"].item(), rel=2e-3)


def test_response_rides_the_backbone(held):
    """The largest response at each level lies on the backbone; the twin, the smaller level's curve, does not."""
    ridge = held["predicted_levels"]

    def beside(curve, amplitude):
        return np.interp(amplitude, ridge["amplitude"].sel(probe="tip").values, ridge["frequency_hz"].values) - curve

    peaks = []
    for m, resonance in zip(of_levels(held), held["phase_resonance"]["frequency_hz"].values, strict=True):
        frequency, amplitude = m["frequency_hz"].values, m["amplitude"].sel(probe="tip").values
        k = int(np.argmax(amplitude))
        peaks.append((frequency[k], amplitude[k]))
        assert frequency[0] == pytest.approx(0.94 * resonance, rel=1e-9)
        assert abs(beside(*peaks[-1])) < 2e-3 * peaks[-1][0]
    assert abs(beside(peaks[0][0], peaks[1][1])) > abs(beside(*peaks[1]))


def test_a_transient_comes_to_the_same_motion(held):
    """The exact motion at phase resonance, by `beamsim run` from rest."""
    m = held["phase_resonance"].sel(level_index=0)
    hz, level, amplitude = m["frequency_hz"].item(), m["level"].item(), m["amplitude"].sel(probe="tip").item()
    run = {"duration": 150 / hz, "sample_rate": 256 * hz, "start": "rest"}
    scenario = load_scenario(BACKBONE, {"excitation.frequency": hz, "excitation.level": level, "run": run, "nnm": None})
    result = beamsim.run(scenario)
    x = result["histories"]["displacement"].sel(probe="tip").values[-257:-1]
    if np.abs(x).max() < 0.5 * amplitude:
        pytest.fail("the transient fell to the other stable motion")
    assert np.abs(x).max() == pytest.approx(amplitude, rel=1e-3)


def test_held_motion(held):
    """Carried from the mode itself it stays near, and its second instant is half a period after the first."""
    of_all, spectra = (
        held["phase_resonance"],
        rows_by_owner(held["phase_resonance"], held["uncontrolled_spectra"], "level_index"),
    )
    for k, spectrum in enumerate(spectra):
        m = of_all.sel(level_index=k)
        predicted, mode = m["predicted_frequency_hz"].item(), m["mode_shapes"].values
        assert m["departure"].values.size == 12
        assert m["departure"].values.max() < 0.25
        assert np.diff(m["instants"].values) == pytest.approx(0.5 / predicted)
        assert np.abs(m["shapes"].values - mode).max() < 0.25 * np.abs(mode).max()
        line = int(np.argmax(spectrum["line"].sel(probe="tip").values[1:])) + 1
        assert spectrum["frequency_hz"].values[line] == pytest.approx(predicted, rel=1e-9)
    assert (
        held["uncontrolled"]["displacement"].sel(probe="tip").values.size
        == held["uncontrolled"]["time"].values.size
        == 2 * 12 * 512
    )


def test_scales_with_the_level():
    """Without gap: twice the level, twice the motion, one frequency."""
    changes = {
        "nnm.continue_in": {"kind": "stiffness_factor", "from": 0, "to": 0.2},
        "nnm.phase_resonance": {"levels": ["1 g", "2 g"], "periods": 5},
    }
    result = nnm(load_scenario(config_path("nnm_forced_mode_1"), changes))
    levels, predicted = result["phase_resonance"], result["predicted_levels"]
    assert levels["scales"].item()
    assert np.ptp(levels["frequency_hz"].values) < 1e-9 * levels["frequency_hz"].values[0]
    one, two = levels["amplitude"].sel(probe="tip").values
    assert two == pytest.approx(2 * one, rel=1e-7)
    one, two = levels["predicted_energy"].values
    assert two == pytest.approx(4 * one, rel=1e-10)
    per_level = predicted["amplitude"].sel(probe="tip").values / predicted["level"].values
    expected = levels["predicted_amplitude"].sel(probe="tip").values / levels["level"].values
    np.testing.assert_allclose(per_level, expected[0], rtol=1e-9)


def test_point_force_on_a_chain(chain):
    result = chain["phase_resonance"]
    assert result["level"].unit == "N"
    assert result["found"].values.tolist() == [True]
    assert result["level_for_amplitude"].item() == pytest.approx(5e-3, rel=0.02)


@pytest.mark.parametrize(
    ("changes", "where", "text"),
    [
        ({"nnm.phase_resonance.levels": ["90 N"]}, "nnm.phase_resonance.levels[0]", "follow it to about"),
        ({"nnm.phase_resonance.levels": ["0.1 mN"]}, "nnm.phase_resonance.levels[0]", "below the backbone"),
        ({"chain.dashpots": None}, "nnm.phase_resonance", "no damping"),
    ],
)
def test_what_only_the_motions_show_is_refused(changes, where, text):
    with pytest.raises(ScenarioError) as error:
        nnm(load_scenario(CHAIN, changes))
    assert error.value.problems[0].path == where
    assert error.match(text)


def test_a_force_at_a_node_is_refused():
    """The middle mass of three stands still in the second mode."""
    changes = {"chain.snubbers[0].mass": 2, "excitation.applied_to.mass": 2, "nnm.mode": 2}
    with pytest.raises(ScenarioError, match="node"):
        nnm(load_scenario(CHAIN, changes))


def test_pictures_and_table(chain):
    figures = chain.plot()
    held_pictures = {"held_departure", "held_shapes", "held_spectrum"}
    assert {"phase_resonance", "phase_resonance_level"} | held_pictures <= set(figures)
    ax = figures["phase_resonance"].axes[0]
    assert {"nonlinear mode", "predicted", "phase resonance"} <= {line.get_label() for line in ax.lines}
    assert {text.get_text() for text in ax.texts} == {"5 mN"}  # with a leader to the curve's peak
    assert figures["phase_resonance_level"].axes[0].get_ylabel() == "Level (mN)"
    rows = [text.split() for _, text in table_rows(chain)]
    assert any(cells[:1] == ["stable"] and "yes" in cells for cells in rows)


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
        predicted = file["predicted_levels"]
        assert predicted["level"].attrs["units"] == "m/s^2"
        assert predicted["level"].dims[0][0] == predicted["point"]
        assert (held := file["phase_resonance"])["shapes"].dims[2][0] == held["station"]
    stored = load(tmp_path / "nnm_forced_backbone.h5")
    assert stored["phase_resonance"]["frequency_hz"].item() == level["frequency_hz"]
    assert stored["resonance_curves"]["stable"].values.dtype == bool
    assert stored["uncontrolled"]["displacement"].sel(probe="tip").values.size == 6 * 512
