"""The damage of a run is that of the station where it is largest, wherever the stress itself is largest."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import beamsim
from beamsim.scenario import load_scenario
from beamsim.signals.rainflow import damage, distinct_cycles

LIFE = {"stress_range": "80 MPa", "cycles": 2e6, "exponent": 5}
BEAM = {
    "beam": {
        "length": "1 m", "width": "50 mm", "thickness": "5 mm", "youngs_modulus": "69 GPa", "density": "2700 kg/m^3",
        "elements": 8, "supports": {"left": "pinned", "right": "pinned"}, "damping": {"kind": "modal", "ratio": "1 %"},
    },
    "constant_forces": [{"position": "0.5 m", "force": "80 N"}],
    "excitation": {"kind": "harmonic", "applied_to": {"position": "0.25 m"}, "level": "3 N", "frequency": "46.3 Hz"},
    "probes": [{"name": "quarter", "position": "25 %"}],
    "run": {
        "duration": "0.5 s", "sample_rate": "50 kHz", "start": "static_equilibrium", "convergence": "off",
        "spectrum": None, "fatigue": LIFE,
    },
}  # fmt: skip
PLATE = {
    "bodies": {
        "panel": {
            "kind": "plate", "length": "600 mm", "width": "400 mm", "thickness": "4 mm", "youngs_modulus": "70 GPa",
            "poissons_ratio": 0.33, "density": "2700 kg/m^3", "elements": [4, 4], "supports": {"left": "clamped"},
            "damping": {"kind": "modal", "ratio": "2 %"},
        }
    },
    "constant_forces": [{"at": {"position": ["600 mm", "0 mm"]}, "force": "10 N"}],
    "excitation": {
        "kind": "harmonic", "applied_to": {"position": ["600 mm", "400 mm"]}, "level": "5 N", "frequency": "30 Hz"
    },
    "probes": [{"name": "corner", "at": {"position": ["600 mm", "400 mm"]}}],
    "reduction": {"modes": 8},
    "run": {"duration": "0.3 s", "sample_rate": "20 kHz", "convergence": "off", "spectrum": None, "fatigue": LIFE},
}  # fmt: skip


def of_samples(history) -> float:
    """Damage of a sampled stress."""
    return damage(distinct_cycles(history), 80e6, 2e6, 5.0)


def with_outputs(case, outputs):
    return beamsim.run(load_scenario(case | {"run": case["run"] | {"outputs": outputs}}))


STATIONS = np.linspace(0.0, 1.0, 17)


@pytest.fixture(scope="module")
def at_stations():
    """The beam's motion, and the cycles of the sampled stress at every station."""
    outputs = [{"kind": "stress", "position": float(at), "name": f"s{k}"} for k, at in enumerate(STATIONS)]
    result = with_outputs(BEAM, outputs)
    stresses = result["histories"]["output_value"]
    return result, [distinct_cycles(stresses.sel(output=f"s{k}").values) for k in range(STATIONS.size)]


def test_damage_is_counted_at_every_station_of_a_beam(at_stations):
    """A constant force makes the stress largest in the middle, where mode 2 moves nothing: 3e-14 there."""
    x, (result, each) = STATIONS, at_stations
    counted = np.array([damage(cycles, 80e6, 2e6, 5.0) for cycles in each])
    worst, body = int(counted.argmax()), result.summary["fatigue"]["beam"]
    assert body["position"] == x[worst] != result.summary["largest_bending_stress_position_m"] == 0.5
    assert body["damage"] == pytest.approx(counted[worst], rel=1e-4)
    assert counted[8] < 1e-3 * body["damage"]
    assert result["fatigue"]["position"].sel(body="beam").item() == body["position"]


def cycles_of(history) -> list[tuple[float, float]]:
    """Ranges and counts of cycles by ASTM E1049, 5.4.4, from the turning points of a history."""
    steps = np.diff(history)
    turns = history[np.concatenate([[True], steps[1:] * steps[:-1] < 0.0, [True]])]
    left, cycles = list[float](), list[tuple[float, float]]()
    for turn in turns.tolist():
        left.append(turn)
        while len(left) >= 3 and abs(left[-1] - left[-2]) >= abs(left[-2] - left[-3]):
            first = len(left) == 3
            cycles.append((abs(left[-2] - left[-3]), 0.5 if first else 1.0))
            left[-3:] = left[-2:] if first else left[-1:]
    return cycles + [(abs(b - a), 0.5) for a, b in pairwise(left)]


def test_damage_of_a_long_motion_is_that_of_an_independent_count():
    """At a quarter of the length 6.889e-6, where the stress is largest almost none, and the worst at three quarters."""
    case = BEAM | {
        "beam": BEAM["beam"] | {"elements": 40},
        "run": BEAM["run"] | {"duration": "3 s", "sample_rate": "5 kHz"},
    }
    at = {"first": "0.25 m", "middle": "0.5 m", "third": "0.75 m"}
    result = with_outputs(case, [{"kind": "stress", "position": x, "name": name} for name, x in at.items()])
    of = {
        name: sum(
            count / 2e6 * (size / 80e6) ** 5
            for size, count in cycles_of(result["histories"]["output_value"].sel(output=name).values)
        )
        for name in at
    }
    assert of["first"] == pytest.approx(6.889e-6, rel=1e-4)
    assert of["middle"] < 1e-12
    body = result.summary["fatigue"]["beam"]
    assert body["position"] == pytest.approx(0.75)
    assert body["damage"] >= of["first"]
    assert body["damage"] == pytest.approx(7.418e-6, rel=1e-4)
    assert body["damage"] == pytest.approx(of["third"], rel=2e-3)  # samples miss 0.1 % of it beside the turning points


@pytest.mark.parametrize("exponent", [1.0, 3.0, 20.0])
@pytest.mark.parametrize("limit", [None, "20 MPa"])
def test_the_worst_station_follows_from_the_line(at_stations, exponent, limit):
    """With any exponent, and with a limit below which nothing counts, no station has more damage."""
    life = {**LIFE, "exponent": exponent, "endurance_limit": limit}
    result = beamsim.run(load_scenario(BEAM | {"run": BEAM["run"] | {"fatigue": life, "sample_rate": "2 kHz"}}))
    counted = np.array([damage(cycles, 80e6, 2e6, exponent, 20e6 if limit else 0.0) for cycles in at_stations[1]])
    assert result.summary["fatigue"]["beam"]["damage"] == pytest.approx(counted.max(), rel=1e-3)
    assert result.summary["fatigue"]["beam"]["position"] == STATIONS[counted.argmax()]


def test_no_range_that_does_damage():
    """Below the endurance limit the station with the largest range is reported."""
    run = BEAM["run"] | {"fatigue": {**LIFE, "endurance_limit": "1 GPa"}}
    body = beamsim.run(load_scenario(BEAM | {"run": run})).summary["fatigue"]["beam"]
    assert body["damage"] == 0.0
    assert body["life_s"] == np.inf
    assert body["largest_range_pa"] > 10e6


def test_damage_is_counted_at_every_point_of_a_plate():
    """Of each component of the stress, at every node."""
    at = [(x, y, of) for x in np.linspace(0, 0.6, 5) for y in np.linspace(0, 0.4, 5) for of in ("x", "y", "xy")]
    outputs = [
        {"kind": "stress", "at": {"position": [float(x), float(y)]}, "component": of, "name": f"s{k}"}
        for k, (x, y, of) in enumerate(at)
    ]
    result = with_outputs(PLATE, outputs)
    counted = np.array(
        [of_samples(result["histories"]["output_value"].sel(output=f"s{k}").values) for k in range(len(at))]
    )
    worst, body = int(counted.argmax()), result.summary["fatigue"]["panel"]
    assert body["damage"] == pytest.approx(counted[worst], rel=1e-3)
    assert (body["position"], body["position_y"], body["component"]) == (
        pytest.approx(at[worst][0]), pytest.approx(at[worst][1]), at[worst][2]
    )  # fmt: skip


def test_equal_stations_give_the_first():
    """In a symmetric structure the place does not depend on round-off."""
    case = BEAM | {"constant_forces": [], "excitation": BEAM["excitation"] | {"applied_to": {"position": "0.5 m"}}}
    body = beamsim.run(load_scenario(case)).summary["fatigue"]["beam"]
    assert body["position"] <= 0.5
