"""Swept and stepped sines are held to their energy balance, as runs are."""

import h5py
import numpy as np
import pytest
from sampling import first_apart

import beamsim
from beamsim.analyses.sweep.analysis import sweep as sweep_alone
from beamsim.analyses.sweep.cycles import CycleRecord
from beamsim.flow import contact_state
from beamsim.outcomes import exit_code
from beamsim.responses.energies import LARGEST_ERROR
from beamsim.scenario import Scenario
from beamsim.store.results import write_result

SWEPT = {"kind": "swept_sine", "from": 0.6, "to": 1.0, "rate": "0.01 Hz/s", "direction": "both"}
STEPPED = {"kind": "stepped", "from": 0.6, "to": 0.9, "points": 3}
KINDS = [
    {},
    {"mounted_on": "ground"},
    {"law": "no_tension"},
    {"law": "no_tension", "mounted_on": "ground"},
    {"preload": 1.0},
]


def case(stop, sweep, **excitation):
    """Two masses on a moving base with a damped stop."""
    stop = {"name": "stop", "mass": 2, "side": "below", "stiffness": 300.0} | stop
    if "preload" not in stop:
        stop.setdefault("gap", 0.01)
    stop["damping"] = {"kind": "viscous", "coefficient": 0.5}
    chain = {"masses": [1.0, 0.5], "springs": [40.0, 30.0], "dashpots": [0.3, 0.1], "snubbers": [stop]}
    shaken = {"kind": "harmonic", "applied_to": "base", "level": 1.5, "frequency": 0.8} | excitation
    return Scenario.model_validate(
        {"chain": chain, "probes": [{"name": "m", "mass": 2}], "excitation": shaken, "sweep": sweep}
    )


@pytest.mark.parametrize("sweep", [SWEPT, STEPPED], ids=["swept", "stepped"])
@first_apart("stop", 2, KINDS, ids=str)
def test_sweeps_are_in_balance(stop, sweep):
    result = sweep_alone(case(stop, sweep))
    assert result.outcome.complete
    for curve in result.curves.values():
        assert curve["contact_share"].sel(snubber="stop").values.max() > 0.05
        assert curve["energy_error"].values.shape == curve.frequency_hz.shape
        assert 0.0 < curve["energy_error"].values.max() < 1e-11
    assert result.summary["energy_error"] == max(c["energy_error"].values.max() for c in result.curves.values())


def test_a_sweep_that_ends_within_a_cycle_is_not_trusted_where_that_cycle_is_wrong(monkeypatch):
    """The incomplete cycle has no row of its own; its imbalance counted for nothing."""
    joined = CycleRecord.join

    def wrong(parts):
        done = joined(parts)
        done.imbalance[-1] += 1e-3 * done.energy.max()
        return done

    monkeypatch.setattr(CycleRecord, "join", wrong)
    result = sweep_alone(case({}, SWEPT | {"to": 0.9937, "direction": "up"}))
    assert result.outcome.code == "sweep_energy_not_balanced"
    assert result.outcome.numbers["error"] == pytest.approx(1e-3, rel=1e-6)


def wrong_responses(*state_and_sources):
    """Forced responses that are too large by 1e-5."""
    return ORIGINAL(*state_and_sources) * (1 + 1e-5)


ORIGINAL = contact_state.responses


@pytest.mark.parametrize("sweep", [SWEPT, STEPPED], ids=["swept", "stepped"])
def test_a_wrong_response_is_not_trusted(monkeypatch, sweep):
    monkeypatch.setattr(contact_state, "responses", wrong_responses)
    result = sweep_alone(case({}, sweep))
    assert result.outcome.code == "sweep_energy_not_balanced"
    assert 0.6 <= result.outcome.numbers["frequency"] <= 0.9
    assert result.outcome.numbers["error"] > LARGEST_ERROR
    assert "at level 1.5 m/s^2" in result.status
    assert exit_code(result.outcome) == 3
    assert all(np.all(np.isfinite(curve.channel("displacement", "m").peak)) for curve in result.curves.values())  # kept


@pytest.mark.parametrize(
    ("level", "sweep", "units"),
    [
        ("20 mm", STEPPED, ("m", "m/s^2")),
        ("0.1 m/s", SWEPT, ("m/s", "m/s^2")),
        (1.0, SWEPT | {"profile": [{"frequency": 0.5, "level": "0.1 g"}]}, ("", "m/s^2")),
    ],
)
def test_a_level_has_the_unit_of_what_is_prescribed(tmp_path, level, sweep, units):
    """A displacement was written in m/s^2."""
    result = sweep_alone(case({}, sweep | {"to": 0.65}, level=level))
    write_result(result, tmp_path / "sweep.h5")
    with h5py.File(tmp_path / "sweep.h5") as file:
        found = []
        file.visititems(lambda name, node: found.append(node) if name.endswith("excitation_amplitude") else None)
        curves = file["curves"]
        assert curves["level"][0] == pytest.approx(result.curves["up_0"].level)
        assert (curves["level_unit"].asstr()[0], found[0].attrs["units"]) == units
    assert beamsim.load(tmp_path / "sweep.h5").curves["up_0"].level_unit == units[0]
