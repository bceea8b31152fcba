"""Continuation in level, gap, stiffness and position: against transients of independently built systems."""

import numpy as np
import pytest
from shipped import config_path

from beamsim.analyses.continuation.analysis import continuation
from beamsim.flow.variational import VariationalFlow
from beamsim.responses.parameters import VariedSnubber
from beamsim.scenario import load_scenario
from beamsim.structures.places import Place
from beamsim.system.build import build_family, build_system
from tests.helpers.branches import long_steps, peaks_of

BEAM = config_path("one_sided_65hz")

PATHS = {
    "level": ("{kind: level, from: 1 g, to: 2 g}", "excitation.level"),
    "gap": ("{kind: gap, snubber: tip, from: 0 mm, to: 0.2 mm}", "snubbers[0].gap"),
    "stiffness": ("{kind: stiffness, from: 100 kN/m, to: 200 kN/m}", "snubbers[0].stiffness"),
    "position": ("{kind: position, from: 205 mm, to: 215 mm}", "snubbers[0].position"),
}


def followed(path, **changes):
    sweep = f"{{kind: continuation, continue_in: {path}, longest_period: 1, seek_at: 0}}"
    with long_steps():
        return continuation(load_scenario(BEAM, [f"sweep={sweep}", *(f"{k}={v}" for k, v in changes.items())]))


@pytest.fixture(scope="module", params=["gap", "position", "level", "stiffness"])
def case(request):
    path, key = PATHS[request.param]
    return request.param, key, followed(path)


def settled_peak(key, value):
    """Largest tip displacement of the steady motion of a scenario with this value, from a transient."""
    scenario = load_scenario(BEAM, {key: value, "run": None})
    system = build_system(scenario)
    from beamsim.responses.loads import periodic_forcing

    flow = VariationalFlow(
        system.dynamics, periodic_forcing(scenario, system), 2 * np.pi * 65.0, scenario.excitation.level
    )
    z = np.zeros(flow.size)
    for _ in range(250):
        z = flow.end(z, 1 / 65.0)
    flow_map = flow.flow_map(z, 1 / 65.0)
    x = (
        flow.states_at(flow_map, np.linspace(0, 1 / 65.0, 2001)[:-1])[:, : system.dynamics.size]
        @ system.probes[0].shape
    )
    return float(np.abs(x).max())


def test_both_ends_are_the_motions_that_transients_come_to(case):
    _, key, result = case
    assert result.complete
    (branch,) = result.branches
    assert branch["residual"].values.max() < 1e-10
    for end in (0, -1):
        assert branch["stable"].values[end]
        expected = settled_peak(key, float(branch["parameter"].values[end]))
        assert peaks_of(branch, "tip")[end] == pytest.approx(expected, rel=1e-4)
    other = peaks_of(branch, "tip")[0]
    assert abs(other - expected) > 0.01 * expected  # the comparison can fail


def test_a_curve_in_frequency_crosses_it(case):
    """At a value halfway, the curve in frequency passes the same motion."""
    kind, key, result = case
    (branch,) = result.branches
    k = branch["parameter"].values.size // 2
    sweep = "{kind: continuation, from: 65 Hz, to: 66 Hz, longest_period: 1, seek_at: 0}"
    crossing = continuation(load_scenario(BEAM, [f"sweep={sweep}", f"{key}={float(branch['parameter'].values[k])!r}"]))
    rel = 1e-4 if kind == "position" else 1e-7  # another basis
    assert peaks_of(crossing.branches[0], "tip")[0] == pytest.approx(peaks_of(branch, "tip")[k], rel=rel)


@pytest.fixture(scope="module")
def family():
    """Of a beam on a base that turns, so that a stop on the ground has more of its motion further out."""
    turning = {
        "excitation": {"kind": "harmonic", "applied_to": "base", "direction": "ry", "level": 60.0, "frequency": 23}
    }
    scenario = load_scenario(BEAM, {"run": None, "snubbers[0].mounted_on": "ground", **turning})
    return build_family(scenario, (Place("beam", 0.15), Place("beam", 0.27)))


@pytest.mark.parametrize(
    ("quantity", "value", "h", "changing"),
    [
        ("gap", 1e-4, 1e-6, {"gap"}),
        ("stiffness", 1e5, 1.0, {"stiffness", "dashpot"}),
        ("position", 0.2, 1e-6, {"shape", "dashpot", "base_participation"}),
    ],
)
def test_contacts_have_exact_derivatives(family, quantity, value, h, changing):
    """The dashpot of a damping ratio and the share of a turning base included."""
    moved = VariedSnubber(family, ("snubbers", 0, quantity), (0,), quantity, 0.02)
    above, below, rates = moved(value + h)[0], moved(value - h)[0], moved(value)[1]
    changed = set()
    for name in ("stiffness", "dashpot", "gap", "shape", "base_participation"):
        of = {"base_participation": "base_participations"}.get(name, name)
        difference = (getattr(above, of) - getattr(below, of)) / (2 * h)
        exact = getattr(rates, name)
        np.testing.assert_allclose(exact, difference, rtol=2e-5, atol=1e-8 * np.abs(difference).max(initial=1e-3))
        changed |= {name} if np.any(exact) else set()
    assert changed == changing


def test_extremes_are_those_of_a_stepped_sine():
    """Force (which jumps: a dashpot), acceleration, stress and gap of one stable motion, by the exact machinery."""
    limits = "limits={peak_force: 1 N, bending_stress: 1 MPa, peak_acceleration: 1 g, gap: 1 mm}"
    from beamsim.analyses.sweep.analysis import sweep

    stepped = sweep(
        load_scenario(BEAM, ["sweep={kind: stepped, from: 78 Hz, to: 80 Hz, points: 2, steady_to: 1e-9}", limits])
    ).curves["up_0"]
    with long_steps():
        curve = continuation(load_scenario(BEAM, ["sweep={kind: continuation, from: 78 Hz, to: 80 Hz}", limits]))
    branch = curve.branches[0]
    assert branch["stable"].values[0]
    pairs = [
        (peaks_of(branch, "tip"), stepped.channel("displacement", "tip").peak),
        (peaks_of(branch, "tip", "force"), stepped.channel("force", "tip").peak),
        (peaks_of(branch, "tip", "absolute_acceleration"), stepped.channel("absolute_acceleration", "tip").peak),
        (branch["peak_bending_stress"].values, stepped["peak_bending_stress"].values),
        (branch["peak_gap"].sel(snubber="tip").values, stepped["peak_gap"].sel(snubber="tip").values),
        (branch["contact_share"].sel(snubber="tip").values, stepped["contact_share"].sel(snubber="tip").values),
    ]
    for ours, exact in pairs:
        np.testing.assert_allclose(ours[[0, -1]], exact, rtol=2e-4)
    assert curve.summary["margins"]["peak_force"]["value"] == peaks_of(branch, "tip", "force").max()
    assert curve.summary["peak_force_n"]["tip"] == peaks_of(branch, "tip", "force")[branch["stable"].values].max()


def test_margins_count_stable_motions_only():
    changes = ["limits={peak_displacement: 1.85 m}", "sweep.longest_period=1"]
    result = continuation(load_scenario(config_path("chain_two_dof"), changes))
    margin = result.summary["margins"]["peak_displacement"]
    top = max(float(peaks_of(b, "first").max()) for b in result.branches)
    stable = max(float(peaks_of(b, "first")[b["stable"].values].max()) for b in result.branches)
    assert margin["value"] == stable < 1.85 < top
    assert not margin["exceeded"]
