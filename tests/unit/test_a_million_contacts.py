"""Runs with very many contacts or samples: complete, counted, and within run.memory."""

import json
import subprocess
import sys
import tracemalloc

import numpy as np
import pytest

import beamsim
from beamsim.analyses.run.motion import Histories
from beamsim.errors import ScenarioError
from beamsim.inputs.signal import Signal

CASE = {
    "chain": {"masses": ["1 kg"], "springs": ["1 kN/m"], "damping": {"kind": "modal", "ratio": 0.01}},
    "snubbers": [
        {"name": "below", "mass": 1, "side": "below", "gap": "0.05 mm", "stiffness": 1e5},
        {"name": "above", "mass": 1, "side": "above", "gap": "0.05 mm", "stiffness": 1e5},
    ],
    "excitation": {"kind": "harmonic", "applied_to": "base", "frequency": "40 Hz", "level": 2},
    "run": {"duration": "1 s", "sample_rate": "2 kHz", "convergence": "off"},
}


def case(**run):
    return beamsim.load_scenario({**CASE, "run": {**CASE["run"], **run}})


CHILD = """
import json, resource, sys
import beamsim
from tests.unit.test_a_million_contacts import case
unit = 1 if sys.platform == "darwin" else 1024
beamsim.run(case())  # imports and kernels
before = unit * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
result = beamsim.run(case(**json.loads(sys.argv[1])))
peak = unit * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
times = result["events"]["time"].values
print(json.dumps({
    "complete": result.complete, "contacts": result.summary["contacts"], "events": int(times.size),
    "ordered": bool((times[1:] >= times[:-1]).all()), "samples": int(result["histories"]["time"].values.size),
    "error": result.summary["energy_error"], "taken": peak - before,
}))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no largest memory of a process")
@pytest.mark.parametrize(
    ("run", "memory"),
    [
        ({"duration": "800 s", "sample_rate": "100 Hz"}, 1e8),  # 64,000 contacts, 128,000 events
        ({"duration": "25 s", "sample_rate": "10 kHz"}, 1.7e8),  # 250,000 samples
    ],
)
def test_many_contacts_and_samples_stay_within_the_memory(run, memory):
    """In a process of its own, whose largest memory is that of the run. A period of the input has two contacts."""
    run = {**run, "memory": memory, "max_events": 1_000_000}
    done = subprocess.run([sys.executable, "-c", CHILD, json.dumps(run)], capture_output=True, text=True, check=True)
    found = json.loads(done.stdout)
    periods = 40 * float(run["duration"].split()[0])
    assert found["complete"]
    assert found["contacts"] == {"below": pytest.approx(periods, abs=30), "above": pytest.approx(periods, abs=30)}
    assert found["events"] == pytest.approx(2 * sum(found["contacts"].values()), abs=2)
    assert found["ordered"]
    assert found["error"] < 1e-6  # round-off of each contact adds up
    assert found["taken"] < memory


def test_histories_beyond_the_memory_are_refused_before_the_march():
    """4 GB are not used in silence: the message says how much memory would do, and it does."""
    with pytest.raises(ScenarioError) as refused:
        beamsim.run(case(duration="100 s", sample_rate="20 kHz", memory=1e8), lambda share: pytest.fail("marched"))
    (problem,) = refused.value.problems
    assert problem.path == "run.sample_rate"
    assert "gives histories of 2000001 samples" in problem.message
    with pytest.raises(ScenarioError) as refused:
        beamsim.run(case(duration="0.6 s", sample_rate="200 kHz", memory=64e6))
    enough = refused.value.problems[0].remedy.partition("run.memory: ")[2].partition(" GB")[0]
    assert beamsim.run(case(duration="0.6 s", sample_rate="200 kHz", memory=f"{enough} GB")).complete


def test_without_histories_nothing_is_refused():
    result = beamsim.run(case(duration="0.6 s", sample_rate="200 kHz", memory=64e6), entries=["peak_force_n"])
    assert result.complete
    assert result.summary["peak_force_n"]["below"] > 0.0


def test_histories_of_a_result_are_no_copies(monkeypatch):
    """A value at an output time is in memory once, whatever the result calls it."""
    whole, of = [], Histories.of

    def recorded(self, key):
        whole.append(self.values)
        return of(self, key)

    monkeypatch.setattr(Histories, "of", recorded)
    result = beamsim.run(case())
    of_probe = ("displacement", "velocity", "absolute_acceleration")
    for name in (*of_probe, "snubber_force", "snubber_penetration"):
        assert np.shares_memory(result["histories"][name].values, whole[0])
    absolute = result["histories"]["absolute_displacement"].values
    assert not np.shares_memory(absolute, whole[0])  # the twin: computed of two


def test_signals_are_evaluated_in_blocks():
    signal, times = Signal.harmonic([1.0, 2.0], [3.0, 5.0]), np.linspace(0.0, 100.0, 1_000_000)
    signal(times[:10])
    tracemalloc.start()
    values = signal(times)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 3 * values.nbytes
    np.testing.assert_allclose(values, np.sin(3.0 * times) + 2.0 * np.sin(5.0 * times), atol=1e-12)
    np.testing.assert_array_equal(signal(times.reshape(1000, 1000)), values.reshape(1000, 1000))
    assert signal(0.1).shape == ()
