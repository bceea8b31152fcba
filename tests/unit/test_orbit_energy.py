"""Periodic motions are held to their energy balance, as runs are."""

from dataclasses import replace

import numpy as np
from sampling import first_apart

from beamsim.analyses.continuation.analysis import continuation
from beamsim.analyses.nnm.analysis import nnm
from beamsim.flow.variational import VariationalFlow
from beamsim.outcomes import OutcomeKind, exit_code
from beamsim.scenario import Scenario

STOP = {"name": "stop", "mass": 2, "side": "below", "stiffness": 300.0, "gap": 0.01}


def case(kind, **more):
    """Two masses on a moving base with a damped stop; cubic springs, and a law with an internal state, on request."""
    stop = STOP | {"damping": {"kind": "viscous", "coefficient": 0.5}} | more.pop("stop", {})
    chain = {"masses": [1.0, 0.5], "springs": [40.0, 30.0], "dashpots": [0.3, 0.1], "snubbers": [stop]}
    if kind == "cubic":
        chain["springs_to_ground"] = [{"mass": 1, "kind": "cubic", "stiffness": 500.0}]
    return Scenario.model_validate({"chain": chain, "probes": [{"name": "m", "mass": 2}], **more})


def forced(kind, **more):
    shaken = {"kind": "harmonic", "applied_to": "base", "level": 1.5, "frequency": 0.8}
    sweep = {"kind": "continuation", "from": "0.75 Hz", "to": "0.8 Hz", "seek_at": 0}
    return case(kind, excitation=shaken, sweep=sweep, **more)


@first_apart("kind", 1, ["cubic", "linear"])
def test_nonlinear_modes_keep_their_energy_and_a_lost_one_is_not_trusted(kind, monkeypatch):
    undamped = case(kind, nnm={"mode": 1, "continue_in": {"kind": "energy", "from": 0.01, "to": 0.02}})
    result = nnm(undamped)
    assert result.branches[0]["energy_error"].values.max() < 1e-10
    assert result.outcome.kind is not OutcomeKind.UNTRUSTED
    monkeypatch.setattr("beamsim.analyses.nnm.orbits.energy_error", lambda flow, flow_map: 3e-5)
    lost = nnm(undamped)
    assert lost.outcome.code == "orbit_energy_not_balanced"
    assert lost.outcome.kind is OutcomeKind.UNTRUSTED
    assert lost.branches[0]["energy"].values.size == result.branches[0]["energy"].values.size


def test_a_response_out_of_balance_is_not_trusted(monkeypatch):
    monkeypatch.setattr(
        "beamsim.responses.periodic_motion.energy_errors", lambda motions: np.full(len(motions.maps), np.nan)
    )
    result = continuation(forced("linear"))
    assert result.outcome.code == "orbit_energy_not_balanced"
    assert "Hz" in result.status
    assert result.branches[0]["parameter"].values.size > 3


def test_a_search_that_leaves_the_range_of_numbers_says_so(monkeypatch):
    """The base's level becomes NaN above 0.77 Hz: before, the outcome was that of a step too small."""
    change = VariationalFlow.with_loads

    def broken(flow, omega=None, level=None):
        return change(flow, omega, np.nan if omega is not None and omega > 2 * np.pi * 0.77 else level)

    monkeypatch.setattr(VariationalFlow, "with_loads", broken)
    result = continuation(forced("linear"))
    ends = result.outcome.outcomes_with_code("orbit_not_finite")
    assert ends or "orbit_not_finite" in result["branches"]["outcome"].values
    assert 0.75 < ends[0].place.value <= 0.77
    assert not result.complete
    assert exit_code(result.outcome) == 3


def by_balance(kind, harmonics, level=1.0, **more):
    """A response by harmonic balance of few harmonics, far from converged."""
    shaken = {"kind": "harmonic", "applied_to": "base", "level": level, "frequency": 0.8}
    method = {"kind": "harmonic_balance", "harmonics": harmonics, "largest_error": 100}
    sweep = {"kind": "continuation", "from": "0.79 Hz", "to": "0.8 Hz", "side_branches": "none", "method": method}
    return continuation(case(kind, excitation=shaken, sweep=sweep, **more))


def test_a_wrong_sum_of_harmonics_is_seen(monkeypatch):
    """Higher harmonics of the stop's force that are wrong by a thousandth."""
    from beamsim.orbits import harmonic_balance

    exact = harmonic_balance.one_sided

    def sampled(D):
        contact = exact(D)
        return replace(contact, positive=contact.positive * np.where(np.arange(D.size) > 1, 1.001, 1.0))

    monkeypatch.setattr(harmonic_balance, "one_sided", sampled)
    result = by_balance("linear", 7)
    assert result.branches[0]["energy_error"].values.max() > 1e-6
    assert result.outcome.outcomes_with_code("orbit_energy_not_balanced")
    assert exit_code(result.outcome) == 3
