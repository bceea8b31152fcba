"""`beamsim nnm` by other methods: relaxed minimisation, multiple scales, the whole period; files read back."""

import dataclasses
import gzip
from pathlib import Path

import numpy as np
import pytest
from sampling import first_apart
from shipped import config_path

from beamsim.analyses.nnm.analysis import conservative_system, nnm
from beamsim.analyses.nnm.orbits import orbit_motion
from beamsim.analyses.nnm.paths import mode_path
from beamsim.cli.branches import nnm_screen
from beamsim.cli.tables import table_rows
from beamsim.scenario import load_scenario
from beamsim.store.results import load
from tests.helpers.commands import invoke

CHAIN = config_path("nnm_chain_mass_5")
FIRST = config_path("nnm_first")
ENERGY = config_path("nnm_energy")


@pytest.fixture(scope="module")
def compared():
    """A chain by relaxed minimisation, the expansion beside it."""
    changes = {"nnm.method": {"kind": "relaxed_minimisation", "steps": 12, "tolerance": 1e-8}}
    return nnm(load_scenario(CHAIN, changes), compare=["multiple_scales"])


@pytest.fixture(scope="module")
def beam():
    changes = {"nnm.continue_in.to": 0.1, "reduction": {"modes": 4}}
    return nnm(load_scenario(FIRST, changes))


def test_thesis_method_beside_shooting(compared):
    """As close as its tolerance lets it, and not closer; what was computed is counted."""
    relaxed = compared["relaxed_minimisation"]
    assert compared.complete
    assert relaxed["converged"].values.sum() == 12
    assert relaxed["functional"].values.max() <= 1e-8
    assert set(relaxed["nearby_motion"].values) == {"same"}
    assert not relaxed["jumped"].values.any()
    assert 1e-12 < relaxed["frequency_difference"].values.max() < 1e-4
    assert relaxed["motions"].values.sum() > 12
    assert relaxed["shooting_motions"].item() > compared.branches[0]["parameter"].values.size
    np.testing.assert_allclose(
        relaxed["exact_frequency_hz"].values[-1], compared.branches[0]["frequency_hz"].values[-1], rtol=1e-10
    )
    tighter = nnm(
        load_scenario(CHAIN, {"nnm.method": {"kind": "relaxed_minimisation", "steps": 12, "tolerance": 1e-14}})
    )["relaxed_minimisation"]
    assert tighter["shape_difference"].values.max() < 1e-2 * relaxed["shape_difference"].values.max()
    assert tighter["motions"].values.sum() > relaxed["motions"].values.sum()


@first_apart(("name", "steps", "period"), 1, [("nnm_chain_mass_5", 35, 4.0098), ("nnm_chain_mass_1", 55, 3.9697)])
def test_thesis_method_on_the_thesis_chains(name, steps, period):
    """Steps and tolerance of the thesis, periods as computed apart (4.011 and 3.97 s printed)."""
    changes = {"nnm.method": {"kind": "relaxed_minimisation", "steps": steps, "tolerance": 1e-6}}
    result = nnm(load_scenario(config_path(name), changes))
    relaxed = result["relaxed_minimisation"]
    assert result.complete
    assert relaxed["converged"].values.sum() == steps
    assert 1 / relaxed["frequency_hz"].values[-1] == pytest.approx(period, abs=1e-3)


def test_thesis_method_is_caught_by_an_internal_resonance(tmp_path):
    """The bare beam: the minimiser goes into the 5:1 tongue with mode 2 and stays there. Exit code 3, steps kept."""
    done = invoke("nnm", config_path("nnm_thesis_mode_1"), "--set", "nnm.method=relaxed_minimisation", "--set",
                  "reduction.modes=5", "-o", tmp_path, "--no-plots")  # fmt: skip
    assert done.exit_code == 3
    assert "stopped at stiffness factor 0.1" in done.stderr
    assert ": the functional of relaxed minimisation is" in done.stderr
    assert "nnm.method." in done.stderr
    stored = load(tmp_path / "nnm_thesis_mode_1.h5")
    relaxed = stored["relaxed_minimisation"]
    assert not stored.complete
    assert not relaxed["converged"].values[-1]
    assert relaxed["converged"].values[:-1].all()
    assert stored.branches[0]["parameter"].values[-1] == 1.0  # shooting goes on
    tongue = next(t for t in stored.branches if (t["mode"].item(), t["ratio"].item()) == (2, 5))
    assert relaxed["factor"].values[-1] == pytest.approx(tongue["parameter"].values[0], abs=0.05)


def test_expansion_writes_a_file(tmp_path):
    done = invoke("nnm", CHAIN, "--set", "nnm.method=multiple_scales", "-o", tmp_path, "--no-plots", "-v")
    assert done.exit_code == 0
    assert "observed order frequency" in done.stdout
    stored = load(tmp_path / "nnm_chain_mass_5.h5")
    assert stored["branches"]["method"].item() == "multiple_scales"
    exact = stored["multiple_scales"]["exact_frequency_hz"].values
    np.testing.assert_allclose(
        np.sort(exact[np.isfinite(exact)]), np.sort(stored.branches[0]["frequency_hz"].values[1:]), rtol=1e-12
    )


def test_spectrum_over_fifty_periods(compared, beam):
    """Steps of a fiftieth of the frequency; lines at the harmonics alone, as large as the harmonics of one period."""
    motion = compared["motion"]
    period = motion["time"].values[-1]
    assert motion["periods"].item() == 50
    np.testing.assert_allclose(np.diff(motion["spectrum_frequency_hz"].values), 1 / (50 * period), rtol=1e-9)
    harmonics = np.abs(motion["harmonic_real"].values + 1j * motion["harmonic_imag"].values)
    for k, amplitude in enumerate(motion["spectrum"].values):
        np.testing.assert_allclose(amplitude[::50][:21], harmonics[k], atol=1e-9)
        between = np.delete(amplitude, np.arange(0, amplitude.size, 50))
        assert between.max() < 1e-9 * amplitude.max()
    assert motion["drift"].item() < 1e-9


def test_an_unstable_motion_drifts_from_its_period(compared):
    """The twin: fifty periods of an unstable mode are not periodic, and the result says so."""
    scenario = load_scenario(ENERGY, {"nnm.continue_in.to": "65 uJ"})
    system = conservative_system(scenario)
    followed = mode_path(system).follow(None)
    points = followed.backbone.points
    modes = [followed.problem.orbit(point) for point in points]
    growth = [np.abs(m.multipliers).max() for m in modes]
    k = int(np.argmax(growth))
    assert growth[k] > 1.4
    motion = orbit_motion(
        system,
        points[k].data.flow,
        modes[k].state[: 2 * system.dynamics.size],
        modes[k].period,
        np.eye(system.dynamics.size)[0],
    )
    assert motion["drift"].item() > 1e-6
    unstable = dataclasses.replace(compared, summary={**compared.summary, "motion_drift": motion["drift"].item()})
    assert any("it is unstable" in line for line in nnm_screen(unstable).lines)
    assert not any("unstable" in line for line in nnm_screen(compared).lines)


def test_jumps_that_nothing_explains(tmp_path):
    """A jump without a known resonance has neither mode nor ratio."""
    path = tmp_path / "nnm.h5"
    path.write_bytes(gzip.decompress((Path(__file__).parents[1] / "data" / "results" / "nnm.h5.gz").read_bytes()))
    result = load(path)
    jumps = [
        {"start": 0.1, "end": 0.2, "mode": 2, "ratio": 5},
        {"start": 0.3, "end": 0.4, "mode": None, "ratio": None},
    ]
    changed = dataclasses.replace(result, summary={**result.summary, "jumps": jumps})
    rows = [text.split() for _, text in table_rows(changed)]
    for row in (["start", "0.1", "0.3"], ["end", "0.2", "0.4"], ["mode", "2", "-"], ["ratio", "5", "-"]):
        assert row in rows


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ([config_path("one_sided_65hz")], "one_sided_65hz.yaml: nnm is missing; add for example"),
        ([FIRST, "--set", "nnm.mode=40"], "choose a lower mode, or raise reduction.modes"),
        ([ENERGY, "--compare", "relaxed_minimisation"], "nnm_energy.yaml:17: nnm.continue_in.kind = energy, but "
         "relaxed_minimisation needs the stiffness factor"),
        ([FIRST, "--set", "nnm.method=multiple_scales", "--compare", "relaxed_minimisation"], "use method: shooting"),
        (
            [ENERGY, "--set", "nnm.continue_in={kind: frequency, from: 300 Hz, to: 310 Hz}"],
            "choose one between 52.39",
        ),
        ([FIRST, "--compare", "guesswork"], "relaxed_minimisation"),
    ],
)  # fmt: skip
def test_what_only_the_model_can_refuse(arguments, text, tmp_path):
    done = invoke("nnm", *arguments, "-o", tmp_path)
    assert done.exit_code == 2
    assert text in " ".join(done.stderr.split())
    assert list(tmp_path.iterdir()) == []


def test_a_range_of_many_decades_is_covered(tmp_path):
    """Steps grow with the stiffness factor and are no hundredth of the range: pi + pi / sqrt(1 + k e) for one mass."""
    case = tmp_path / "mass.yaml"
    case.write_text(
        "chain: {masses: [1], springs: [1], snubbers: [{mass: 1, side: above, stiffness: 1, gap: 0}]}\n"
        "nnm: {mode: 1, continue_in: {kind: stiffness_factor, from: 0, to: 1e6}}\n"
    )
    done = invoke("nnm", case, "-o", tmp_path, "--no-plots")
    assert done.exit_code == 0
    backbone = load(tmp_path / "mass.h5").branches[0]
    exact = 1 / (np.pi + np.pi / np.sqrt(1 + backbone["parameter"].values))
    np.testing.assert_allclose(backbone["frequency_hz"].values, exact, rtol=1e-9)
    assert np.all(np.diff(backbone["parameter"].values) <= 0.25 * np.maximum(1, backbone["parameter"].values[1:]))


def test_an_order_of_no_difference_is_not_printed(tmp_path):
    """A spring in the support changes nothing."""
    case = config_path("ms_beam_tip_mode_1")
    done = invoke(
        "nnm", case, "-o", tmp_path, "--no-plots", "--set", "snubbers[0].position=2.7e-10", "--set", "beam.elements=4"
    )
    assert done.exit_code == 0
    assert "differences of the frequency have no order that could be measured" in done.stdout
    assert "nan" not in done.stdout
