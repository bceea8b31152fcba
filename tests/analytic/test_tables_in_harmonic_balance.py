"""A force-deflection table is several one-sided springs for harmonic balance; its figures are those of the stop."""

import numpy as np
import pytest

from beamsim.analyses.continuation.analysis import continuation
from beamsim.scenario import load_scenario

CASE = {
    "chain": {
        "masses": [1.0, 1.0], "springs": [400.0, 400.0, 0.0], "dashpots": [2.0, 2.0, 0.0],
        "snubbers": [
            {"name": "table", "mass": 1, "side": "below", "gap": 1e-3,
             "force_deflection": [[0, 0], [2e-3, 2], [10e-3, 30]]},
            {"name": "plain", "mass": 2, "side": "below", "gap": 1.5e-3, "stiffness": 300.0},
        ],
    },
    "probes": [{"name": "a", "mass": 1}],
    "excitation": {"kind": "harmonic", "applied_to": {"mass": 1}, "level": 3.0, "frequency": 4.5},
    "limits": {"gap": 1.0},
}  # fmt: skip


def branch(**method):
    sweep = {"kind": "continuation", "from": 4.45, "to": 4.55, "seek_at": 0, **method}
    return continuation(load_scenario({**CASE, "sweep": sweep})).branches[0]


def test_forces_shares_and_openings_are_those_of_shooting():
    """The force of the table was that of its first spring, the force of the other stop that of its second one."""
    balance = branch(method={"kind": "harmonic_balance", "harmonics": 61})
    shooting = branch()

    def at(variable, branch):
        frequency = branch["frequency_hz"].values
        return {name: float(np.interp(4.5, frequency, x.values)) for name, x in branch.by_label(variable).items()}

    forces = at("peak_force", shooting)
    assert forces["table"] > 3.0 > 1.0 > forces["plain"] > 0.4  # beyond the corner of the table
    assert at("peak_force", balance) == pytest.approx(forces, rel=1e-3)
    assert at("contact_share", balance) == pytest.approx(at("contact_share", shooting), rel=1e-3)
    assert at("peak_gap", balance) == pytest.approx(at("peak_gap", shooting), rel=1e-3)
