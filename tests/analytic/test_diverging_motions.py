"""Motions so sensitive that round-off decides on their contacts say from when on, and which figures that concerns."""

from dataclasses import replace

import numpy as np
import pytest

import beamsim
from beamsim.cli.screens import ONE_OF_MANY
from beamsim.cli.tables import table_rows
from beamsim.scenario import load_scenario
from beamsim.trust.convergence import ContactEvents, divergence


def oscillator(frequency=0.45, stiffness=1.0, **run):
    """One mass above a stiff stop: chaotic at 0.45 Hz, periodic at 0.4 Hz. No model is finer."""
    chain = {
        "masses": [1.0], "springs": [stiffness, 0.0], "damping": {"kind": "modal", "ratio": 0.01},
        "snubbers": [{"name": "stop", "mass": 1, "side": "below", "stiffness": 1000.0, "gap": 0.0}],
    }  # fmt: skip
    shake = {"kind": "harmonic", "applied_to": {"mass": 1}, "level": 1.0, "frequency": frequency}
    return load_scenario({"chain": chain, "excitation": shake, "run": {"duration": 300.0, "sample_rate": 20.0} | run})


@pytest.fixture(scope="module")
def chaotic():
    return beamsim.run(oscillator())


def closings(result):
    return result["events"]["time"].values[result["events"]["closing"].values]


def test_round_off_gives_other_contacts_from_the_time_stated_on(chaotic):
    """A change of the level by round-off, which is another disturbance than that of the stiffness."""
    model = chaotic.summary["convergence_model"]
    stated = model["round_off_divergence_s"]
    assert 0.0 < model["disturbance_divergence_s"] < stated < 300.0
    moved = oscillator()
    level = moved.excitation.model_copy(update={"level": 1.0 + 1e-15})
    other = beamsim.run(moved.model_copy(update={"excitation": level}))
    common = min(closings(chaotic).size, closings(other).size)
    apart = np.abs(closings(chaotic)[:common] - closings(other)[:common])
    first = closings(chaotic)[np.argmax(apart > 0.1)]
    assert apart[closings(chaotic)[:common] < 0.5 * model["disturbance_divergence_s"]].max() < 1e-6
    assert 0.7 * stated < first < 1.3 * stated


def test_what_is_marked_depends_on_what_follows(chaotic):
    s = chaotic.summary
    stiffer = beamsim.run(oscillator(stiffness=1.0 + 1e-9, convergence="off")).summary
    figures = (
        "peak_displacement_m",
        "min_displacement_m",
        "peak_acceleration_g",
        "peak_force_n",
        "contact_share",
        "contacts",
    )
    after = s["after_divergence"]
    for figure in figures:
        for name, value in s[figure].items():
            assert abs(stiffer[figure][name] / value - 1.0) > 1e-3, figure  # although the peaks come before the parting
            assert f"{figure}.{name}" in after
    assert s["convergence"]["peak_force_n"]["stop"] == 0.0  # all modes are kept


def test_a_peak_above_all_that_follows_is_not_marked():
    """A throw from high above gives the first impact; what goes on after it is chaotic, but much smaller."""
    thrown = oscillator(start={"displacement": [5.0]}, duration=400.0)
    result = beamsim.run(thrown)
    after = result.summary["after_divergence"]
    assert "contacts.stop" in after
    assert not {"peak_displacement_m.stop", "peak_force_n.stop", "max_displacement_m.stop"} & set(after)
    start = {"displacement": [5.0]}
    stiffer = beamsim.run(oscillator(stiffness=1.0 + 1e-9, start=start, duration=400.0, convergence="off")).summary
    assert stiffer["peak_force_n"]["stop"] == pytest.approx(result.summary["peak_force_n"]["stop"], rel=1e-7)


def test_status_table_and_file_say_so(chaotic, tmp_path):
    assert chaotic.complete
    assert chaotic.outcome.code == "motion_sensitive"
    assert "run.impacts" in chaotic.outcome.remedy
    rows = [text for _, text in table_rows(chaotic)]
    assert any(text.startswith("peak force") and text.endswith(f"{ONE_OF_MANY}, no error") for text in rows)
    assert any(text.startswith("round off divergence") and text.endswith(" s") for text in rows)
    stored = beamsim.load(beamsim.write_result(chaotic, tmp_path / "run.h5"))
    assert stored.outcome == chaotic.outcome
    assert stored.summary["after_divergence"] == chaotic.summary["after_divergence"]
    assert {"peak_force_n.stop", "peak_displacement_m.stop"} <= set(stored.summary["after_divergence"])


def test_a_periodic_motion_has_no_marks():
    result = beamsim.run(oscillator(0.4))
    assert result.summary["events"] > 100
    assert result.summary["after_divergence"] == []
    assert result.summary["convergence_model"]["disturbance_divergence_s"] is None
    assert not result.outcome.message


def events(*times, end=10.0):
    time = np.array(times)
    return ContactEvents(end, time, np.zeros(time.size, dtype=np.int64), np.arange(time.size) % 2)


def test_motions_diverge_at_the_first_event_that_is_not_shared():
    one = events(1.0, 1.1, 3.0, 3.1, 5.0, 5.1)
    assert divergence(one, one) == np.inf
    assert divergence(one, events(1.0, 1.1, 3.0, 3.1)) == 5.0
    assert divergence(one, events(1.0, 1.1, 4.0, 4.1, 5.0, 5.1)) == 3.0
    assert divergence(events(), events()) == np.inf
    assert divergence(events(), events(2.0, 2.1)) == 2.0


def test_two_contacts_at_one_time_have_no_order():
    """A symmetric structure meets two stops at once; round-off says which of them comes first."""
    time, phase = np.array([1.0, 1.0, 2.0, 2.0]), np.array([1, 1, 0, 0])
    one, other = (ContactEvents(10.0, time, np.array(contact), phase) for contact in ([0, 1, 0, 1], [1, 0, 0, 1]))
    assert divergence(one, other) == np.inf
    assert divergence(one, replace(other, phase=np.array([1, 1, 0, 1]))) == 2.0


def test_another_model_with_other_contacts_is_no_sensitive_motion():
    """A light dashpot bounces at once in one model and not in the other; what follows is the same motion."""
    stop = {"name": "tip", "position": 0.27, "side": "below", "stiffness": "100 kN/m", "gap": 0}
    case = {
        "beam": {"length": 0.27, "bending_stiffness": 2.0, "mass_per_length": 0.25,
                 "damping": {"kind": "modal", "ratio": 0.01}},
        "snubbers": [stop],
        "excitation": {"kind": "harmonic", "applied_to": {"position": 0.135}, "level": "5 N", "frequency": "32 Hz"},
        "run": {"duration": 0.4},
    }  # fmt: skip
    s = beamsim.run(load_scenario(case)).summary
    assert s["convergence_model"]["contact_divergence_s"] is not None
    assert s["convergence_model"]["disturbance_divergence_s"] is None
    assert s["after_divergence"] == []
