"""Records that a fit cannot explain: the other sign, a clipped sensor, no contact; nothing of it is silent.

A mass of 1 kg on 1 kN/m, released 5 mm from rest above a stop of 80 kN/m behind a gap of 1 mm, integrated from contact
to contact apart from the program.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import beamsim
from beamsim.measurements.channels import read_signals
from beamsim.measurements.conditioning import clipping_warnings
from beamsim.measurements.signal import MeasuredSignal
from beamsim.outcomes import exit_code
from beamsim.scenario import load_scenario

GAP, STIFFNESS, RATE = 1e-3, 80e3, 2000.0
FIT = {"starts": 1, "profiles": False, "estimate": ["snubbers.stop.stiffness", "snubbers.stop.gap"]}


def released(height, duration=0.5):
    """Displacement at the sampled times, m."""
    time, y, begin = np.arange(int(duration * RATE) + 1) / RATE, np.array([height, 0.0]), 0.0
    out, closed = np.full(time.size, height), False
    damping = 2 * 0.02 * np.sqrt(1000.0)
    while begin < time[-1]:
        of_stop = STIFFNESS if closed else 0.0

        def slope(_, y, of_stop=of_stop):
            return [y[1], -1000.0 * y[0] - damping * y[1] - of_stop * (y[0] + GAP)]

        def touches(_, y):
            return y[0] + GAP

        touches.terminal, touches.direction = True, 1.0 if closed else -1.0
        found = solve_ivp(
            slope, (begin, time[-1]), y, method="DOP853", rtol=1e-10, atol=1e-13, events=touches, dense_output=True
        )
        inside = (time > begin) & (time <= found.t[-1])
        out[inside] = found.sol(time[inside])[0]
        begin, y, closed = found.t[-1], found.y[:, -1], not closed
    return time, out


def identified(folder, values, *, height=5e-3, **test):
    """The result of a record in mm with a scatter of 5 um."""
    time = np.arange(values.size) / RATE
    (folder / "mm.csv").write_text(
        "time (s),mass (mm)\n" + "".join(f"{t:.9g},{x:.9g}\n" for t, x in zip(time, values, strict=True))
    )
    of_test = {
        "kind": "transient", "name": "rec", "file": str(folder / "mm.csv"), "quantity": "displacement",
        "start": {"displacement": [height], "velocity": [0.0]}, **test,
    }  # fmt: skip
    case = {
        "chain": {"masses": [1.0], "springs": [1000.0], "damping": {"kind": "modal", "ratio": 0.02}},
        "snubbers": [{"name": "stop", "mass": 1, "side": "below", "gap": 1e-3, "stiffness": 60e3}],
        "probes": [{"name": "mass", "mass": 1}],
        "excitation": {"kind": "none"},
        "identify_stiffness": {"snubber": "stop", "nonlinear": {**FIT, "tests": [of_test]}},
    }
    return beamsim.identify_stiffness(load_scenario(case), beamsim.read_tests(load_scenario(case)))


def stiffness(result):
    return result["nonlinear"]["value"].sel(parameter="snubbers.stop.stiffness").item()


@pytest.fixture(scope="module")
def record():
    """mm."""
    time, x = released(5e-3)
    return 1e3 * x + 5e-3 * np.random.default_rng(7).standard_normal(time.size)


def test_a_record_with_the_other_sign_is_not_reliable_and_its_remedy_gives_the_stiffness(record, tmp_path):
    """A stop of 1.4 kN/m behind a gap of -4.3 mm was found, with exit code 0."""
    found = identified(tmp_path, -record)
    assert found.outcome.text.startswith("not reliable: rec agrees much better")
    assert exit_code(found.outcome) == 3
    assert "write factor: -1 in the test" in found.outcome.text
    right = identified(tmp_path, -record, factor=-1)
    assert right.outcome.complete
    assert stiffness(right) == pytest.approx(STIFFNESS, rel=1e-2)


def test_a_clipped_record_is_not_reliable(record, tmp_path):
    """The largest displacements were cut at 2.5 mm: 40.2 +- 4.1 kN/m, with exit code 0."""
    found = identified(tmp_path, np.minimum(record, 2.5))
    assert "rec is clipped at the end of the sensor's range" in found.outcome.text
    assert any("stays at exactly 2.5 mm" in text for text in found.warnings)
    assert exit_code(found.outcome) == 3


def test_a_record_without_contact_determines_no_stop(tmp_path):
    time, x = released(0.9e-3)
    values = 1e3 * x + 5e-4 * np.random.default_rng(3).standard_normal(time.size)
    found = identified(tmp_path, values, height=0.9e-3)
    text = "not reliable: the tests do not determine snubbers.stop.stiffness, snubbers.stop.gap"
    assert found.outcome.text.startswith(text)
    assert exit_code(found.outcome) == 3


def of_values(y):
    return MeasuredSignal("a", np.arange(y.size) / 1e3, y, unit="g", axis="time", axis_unit="s")


def test_records_that_are_not_clipped():
    """Of few digits, at rest between pulses, and a single load that is held."""
    t = np.arange(4000) / 1e3
    sine, pulses = np.sin(2 * np.pi * 3 * t), np.maximum(np.sin(2 * np.pi * 3 * t), 0.0)
    for y in (sine, np.round(20 * sine), pulses, np.clip(4 * t, 0.0, 1.0), 0.0 * t):
        assert clipping_warnings(of_values(y)) == []


def test_clipped_records_of_every_reader(tmp_path):
    """At one end, at both ends, with the steps of a converter of 12 bits; as an input of a run, too."""
    t = np.arange(4000) / 1e3
    sine = 3.0 * np.sin(2 * np.pi * 3 * t)
    assert len(clipping_warnings(of_values(np.minimum(sine, 2.0)))) == 1
    assert len(clipping_warnings(of_values(np.clip(sine, -2.5, 2.0)))) == 2
    assert len(clipping_warnings(of_values(np.round(np.clip(sine, -2.5, 2.5) * 819.2) / 819.2))) == 2
    file = tmp_path / "a.csv"
    rows = zip(t.tolist(), np.clip(sine, -2.0, 2.0).tolist(), strict=True)
    file.write_text("time (s),a (g)\n" + "".join(f"{time:.9g},{a:.9g}\n" for time, a in rows))
    (signal,) = read_signals(file)
    assert clipping_warnings(signal)
    case = {
        "chain": {"masses": [1.0], "springs": [1000.0], "damping": {"kind": "modal", "ratio": 0.02}},
        "excitation": {"kind": "sampled", "applied_to": "base", "file": str(file)},
        "run": {"duration": 0.2, "sample_rate": 1000.0, "convergence": "off"},
    }
    assert any("end of its range" in text for text in beamsim.run(load_scenario(case)).warnings)
