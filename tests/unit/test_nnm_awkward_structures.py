"""Nonlinear modes where random structures once tripped them up."""

import numpy as np
import pytest

from beamsim.analyses.nnm.analysis import conservative_system, nnm
from beamsim.analyses.nnm.paths import mode_path
from beamsim.scenario import load_scenario
from beamsim.store.results import load, write_result


def test_two_stops_that_touch_one_point_take_turns():
    """A hinged panel that another stop pushes away, its tip between two stops without gap: when one lets go the other
    takes over, once. (The two change at the same instant, and round-off once had them change back and forth.)"""
    stop = {"position": 0.5, "stiffness": 2e4, "gap": 0.0}
    case = {
        "beam": {"length": 0.5, "width": 0.05, "thickness": 0.0036, "youngs_modulus": 69e9, "density": 2700.0,
                 "elements": 12, "supports": {"left": "pinned", "right": "free"}},
        "reduction": {"modes": 4},
        "snubbers": [stop | {"side": "below"}, stop | {"side": "above", "stiffness": 1e5},
                     {"position": 0.24, "side": "above", "stiffness": 1e4, "gap": -7e-4}],
        "nnm": {"mode": 2, "continue_in": {"kind": "energy", "from": 1.4e-5, "to": 1.4e-2}},
    }  # fmt: skip
    scenario = load_scenario(case)
    system = conservative_system(scenario)
    followed = mode_path(system).follow(None)
    assert followed.backbone.outcome.complete
    for point in followed.backbone.points:
        flow_map = point.data.flow_map
        for contact in (0, 1):
            own = flow_map.event_time[flow_map.event_contact == contact]
            assert np.all(np.diff(own) > 1e-6 * flow_map.duration)
        assert np.unique(flow_map.event_time[flow_map.event_contact < 2].round(9)).size <= 3


def test_free_chain_has_no_resonance_with_its_rigid_body_mode():
    case = {
        "chain": {
            "masses": [1.5, 1.7], "springs": [0.0, 1.0],
            "snubbers": [{"mass": 1, "side": "above", "stiffness": 1.6, "gap": 0.05}],
            "springs_to_ground": [{"mass": 2, "kind": "cubic", "stiffness": 1.6}],
        },
        "nnm": {"mode": 2, "continue_in": {"kind": "energy", "from": 0.03, "to": 30.0}},
    }  # fmt: skip
    result = nnm(load_scenario(case))
    assert result.complete
    assert all(t["mode"].item() != 1 for t in result.branches)


MIXED = {
    "masses": [1.0, 1.0], "springs": [1.0, 0.6, 1.0],
    "snubbers": [{"mass": 1, "side": "below", "stiffness": 2.0, "gap": 0.0},
                 {"mass": 2, "side": "above", "stiffness": 5.0, "gap": 0.5}],
}  # fmt: skip


def test_energy_path_where_one_stop_touches_and_another_has_a_gap():
    """Small motions are bilinear then, not linear: as if the stop with the gap were not there."""
    in_energy = {"mode": 1, "continue_in": {"kind": "energy", "from": 1e-3, "to": 1.0}}
    result = nnm(load_scenario({"chain": MIXED, "nnm": in_energy}))
    assert result.complete
    alone = MIXED | {"snubbers": MIXED["snubbers"][:1]}
    small = nnm(load_scenario({"chain": alone, "nnm": {"mode": 1}}))
    assert result.branches[0]["frequency_hz"].values[0] == pytest.approx(
        small.branches[0]["frequency_hz"].values[-1], rel=1e-9
    )
    assert result.branches[0]["frequency_hz"].values[-1] > 1.05 * result.branches[0]["frequency_hz"].values[0]


def test_strong_coupling_is_no_jump():
    """Modes that share their energy at every step: the predictions fail, yet the branch is in one piece."""
    case = {
        "chain": {
            "masses": [1.63, 1.97, 0.907], "springs": [2.28, 2.15, 2.15, 2.1],
            "snubbers": [{"mass": 2, "side": "below", "stiffness": 26.5, "gap": 1e-6},
                         {"mass": 1, "side": "above", "stiffness": 4.35, "gap": 0.0}],
        },
        "nnm": {"mode": 1, "continue_in": {"kind": "energy", "from": 3e-5, "to": 0.03}},
    }  # fmt: skip
    result = nnm(load_scenario(case))
    assert result.complete
    assert "jumps" not in result.datasets
    steps = np.diff(
        result.branches[0]["coordinates"].values / np.sqrt(result.branches[0]["energy"].values)[:, None], axis=0
    )
    assert np.abs(steps).max() < 0.05 * np.abs(result.branches[0]["coordinates"].values[0]).max() / np.sqrt(3e-5)


PRESSED = {
    "masses": [1.0, 3.0], "springs": [1.0, 0.1, 1.0],
    "snubbers": [{"mass": 2, "side": "above", "stiffness": 50.0, "gap": -1.0}],
}  # fmt: skip


def test_small_motions_under_prestress_while_the_spring_grows():
    """Rest moves twelve times as far as the motion is large; the motion stays that of the closed structure."""
    mode = {"mode": 1, "energy": 1e-3, "continue_in": {"kind": "stiffness_factor", "to": 0.03}}
    result = nnm(load_scenario({"chain": PRESSED, "nnm": mode}))
    assert result.complete
    assert "jumps" not in result.datasets
    for factor, frequency in zip(
        result.branches[0]["parameter"].values, result.branches[0]["frequency_hz"].values, strict=True
    ):
        stiff = np.array([[1.1, -0.1], [-0.1, 1.1 + 50 * factor]])
        closed = np.sqrt(np.linalg.eigvals(stiff / np.array([[1.0], [3.0]]))) / (2 * np.pi)
        assert np.abs(closed / frequency - 1).min() < 1e-9


STOPPED = {
    "masses": [1], "springs": [1],
    "snubbers": [{"mass": 1, "side": side, "stiffness": 1e6, "gap": 1} for side in ("below", "above")],
}  # fmt: skip


def test_stiff_stops_on_both_sides_whatever_the_range():
    """A grazing at which the branch turns within the stop's compliance, and residuals above the tolerance by round-off.

    Half a period is open for 2 asin(1 / R), R^2 = 2 E, and against the stop from x = 1 at the speed sqrt(R^2 - 1) on.
    """
    path = {"kind": "energy", "from": 1e-3, "to": 1e4}
    result = nnm(load_scenario({"chain": STOPPED, "nnm": {"mode": 1, "continue_in": path}}))
    assert result.complete
    energy, w = result.branches[0]["energy"].values, np.sqrt(1 + 1e6)
    hit = energy > 0.5
    reach = np.sqrt(2 * energy[hit])
    half = 2 * np.arcsin(1 / reach) + 2 * np.arctan2(np.sqrt(reach**2 - 1) / w, 1 / w**2) / w
    np.testing.assert_allclose(result.branches[0]["frequency_hz"].values[hit], 0.5 / half, rtol=1e-9)
    np.testing.assert_allclose(result.branches[0]["frequency_hz"].values[~hit], 0.5 / np.pi, rtol=1e-9)


def test_points_at_energies_and_frequencies(tmp_path):
    """Exact motions there, of which the closed form knows the other number; what no branch passes is an outcome."""
    w = np.sqrt(1 + 1e6)

    def frequency(energy):
        reach = np.sqrt(2 * energy)
        return 0.25 / (np.arcsin(1 / reach) + np.arctan2(np.sqrt(reach**2 - 1) / w, 1 / w**2) / w)

    def followed(last, **asked):
        path = {"kind": "energy", "from": 1e-3, "to": last}
        return nnm(load_scenario({"chain": STOPPED, "nnm": {"mode": 1, "continue_in": path, **asked}}))

    result = followed(10.0, energies=[0.6, 5.0], frequencies=[frequency(2.0)])
    assert result.complete
    by_value = {p["value"]: p for p in result.summary["requested_points"]}
    assert list(by_value) == [0.6, frequency(2.0), 5.0]  # in the order of the branch
    for value, energy in ((0.6, 0.6), (5.0, 5.0), (frequency(2.0), 2.0)):
        p = by_value[value]
        assert p["energy_j"] == pytest.approx(energy, rel=1e-9)
        assert p["frequency_hz"] == pytest.approx(frequency(energy), rel=1e-10)
        k = p["point"] - 1
        assert result.branches[0]["energy"].values[k] == p["energy_j"]
        assert result.branches[0]["residual"].values[k] < 1e-9
    stored = load(write_result(result, tmp_path / "mode.h5"))
    assert stored.summary["requested_points"] == result.summary["requested_points"]
    missed = followed(0.1, frequencies=[0.1])
    assert missed.outcome.code == "values_not_passed"
    assert not missed.complete
    assert "no branch passes the requested frequencies: at 0.1 Hz" in missed.status


COUPLED = {
    "masses": [1, 1], "springs": [1, 1, 1],
    "springs_to_ground": [{"mass": 1, "kind": "cubic", "stiffness": 0.5}],
}  # fmt: skip


def test_a_mode_that_gradually_shares_its_energy_is_followed():
    """In phase, one mass on a cubic spring: mode 1 holds less than half of the energy in the end, which is named."""

    def followed(last):
        path = {"kind": "energy", "from": 0.01, "to": last}
        return nnm(load_scenario({"chain": COUPLED, "nnm": {"mode": 1, "continue_in": path}}))

    far, near = followed(1000.0), followed(400.0)
    assert far.complete
    assert "jumps" not in far.datasets.keys() | near.datasets.keys()
    assert 0.35 < far.branches[0]["share"].values[-1] < 0.45
    (shared,) = far.outcome.outcomes_with_code("energy_shared")
    assert shared.numbers["share"] == pytest.approx(far.branches[0]["share"].values[-1], rel=1e-12)
    assert "mode 1 holds 40% of the energy and mode 2 60%" in far.status
    at = np.log(near.branches[0]["energy"].values)
    interpolated = np.interp(at, np.log(far.branches[0]["energy"].values), far.branches[0]["frequency_hz"].values)
    np.testing.assert_allclose(near.branches[0]["frequency_hz"].values, interpolated, rtol=2e-3)


def tip_between_stops(stiffness, last):
    """A cantilever whose tip is between two stops, in energy."""
    stop = {"position": 0.5, "stiffness": stiffness, "gap": 1e-3}
    return load_scenario({
        "beam": {"length": 0.5, "width": 0.05, "thickness": 0.0036, "youngs_modulus": 69e9, "density": 2700.0,
                 "elements": 12, "supports": {"left": "clamped", "right": "free"}},
        "reduction": {"modes": 4},
        "snubbers": [stop | {"side": "below"}, stop | {"side": "above"}],
        "nnm": {"mode": 1, "continue_in": {"kind": "energy", "from": 1e-5, "to": last}},
    })  # fmt: skip


def test_tip_stops_on_both_sides_whatever_the_range():
    """Their backbone enters tongues: it goes on, and the share of its energy is named.

    The path to a lower energy is the beginning of that to a higher one, up to a tongue that it ends in.
    """
    last = 1e-3
    near, far = (nnm(tip_between_stops(2e3, to)) for to in (last, 100.0))
    for result, to in ((near, last), (far, 100.0)):
        assert result.complete
        assert result.branches[0]["parameter"].values[-1] == pytest.approx(to, rel=1e-12)
        assert ("mode 1 holds" in result.status) == (result.branches[0]["share"].values[-1] < 0.5)
    (part,) = near.outcome.outcomes_with_code("ends_in_resonance")
    same = far.branches[0]["parameter"].values.searchsorted(part.place.value[0][0] * (1 + 1e-12))
    assert part.place.value[0][1] == pytest.approx(far.branches[0]["parameter"].values[same], rel=1e-12)
    at = np.log(far.branches[0]["parameter"].values[:same])
    lattice = np.interp(at, np.log(near.branches[0]["parameter"].values), near.branches[0]["frequency_hz"].values)
    np.testing.assert_allclose(lattice, far.branches[0]["frequency_hz"].values[:same], rtol=1e-9)


def test_its_table_of_modes_keeps_the_damping_of_the_structure():
    """A normal mode leaves it out of the motion, and not out of what the result says of the structure."""
    case = load_scenario({
        "chain": {"masses": [1.0], "springs": [100.0, 0.0], "dashpots": [0.4, 0.0], "snubbers": [
            {"name": "stop", "mass": 1, "side": "above", "stiffness": 300.0, "gap": 0.01}
        ]},
        "nnm": {"mode": 1},
    })  # fmt: skip
    system = conservative_system(case)
    assert not system.dynamics.damping.any()
    np.testing.assert_allclose(system.modes["damping_ratios"].values, [0.4 / (2 * 10.0)], rtol=1e-12)
    np.testing.assert_allclose(system.modes["closed_damping_ratios"].values, [0.4 / (2 * 20.0)], rtol=1e-12)
