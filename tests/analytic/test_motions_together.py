"""Motion of the base, of supports and forces in one list, each with a signal of any kind."""

import numpy as np
import pytest

import beamsim
from beamsim.scenario import load_scenario
from beamsim.structures.places import Place
from beamsim.system.build import build_system

BEAM = {
    "length": 0.9, "width": 0.03, "thickness": 0.004, "youngs_modulus": 70e9, "density": 2700.0, "elements": 9,
    "supports": {"left": "pinned", "right": "pinned"}, "damping": {"kind": "modal", "ratio": 0.02},
}  # fmt: skip
OUTPUTS = [
    {"name": "right", "kind": "reaction_force", "support": "right"},
    {"name": "base", "kind": "reaction_force", "support": "base"},
    {"name": "hinge", "kind": "acceleration", "position": 0.9},
]
SPRING = {"name": "hanger", "kind": "linear", "position": 0.3, "stiffness": "2 kN/m"}
NOISE = {"kind": "random", "psd": [{"frequency": f, "density": "0.01 N^2/Hz"} for f in (20.0, 90.0)], "seed": 4}


def record(folder):
    time = np.arange(81) / 100.0
    moved = np.sin(9.0 * time) ** 3 * np.exp(-2.0 * time)
    np.savetxt(folder / "r.csv", np.column_stack([time, moved]), delimiter=",", header="time (s),w (mm)", comments="")
    return {"kind": "sampled", "file": str(folder / "r.csv"), "column": "w", "quantity": "displacement"}


def entries(folder):
    return [
        {**record(folder), "applied_to": {"support": "right"}},
        {"kind": "half_sine", "applied_to": "base", "level": "2 g", "duration": "11 ms", "time": 0.1},
        {**NOISE, "applied_to": {"position": 0.5}},
        {"kind": "step", "applied_to": {"line": "whole"}, "level": "3 N/m", "time": 0.2},
        {"kind": "trapezoid", "applied_to": {"support": "left"}, "level": "0.1 m/s", "duration": "20 ms", "time": 0.3},
        {"kind": "swept_sine", "applied_to": {"position": 0.7}, "level": 0.5, "from": 30, "to": 60, "rate": "40 Hz/s"},
        {"kind": "multi_tone", "applied_to": {"support": "left", "direction": "z"},
         "tones": [{"level": "0.1 mm", "frequency": 11.0}, {"level": "0.2 mm", "frequency": 17.0, "phase": 1.0}]},
    ]  # fmt: skip


def run_of(excitation, **more):
    return beamsim.run(load_scenario({
        "beam": BEAM, "excitation": excitation, "reduction": {"modes": "all"}, "springs_to_ground": [SPRING],
        "probes": [{"name": "p", "position": 0.6}], "outputs": OUTPUTS,
        "run": {"duration": 0.7, "sample_rate": 2000.0, "start": "rest", "convergence": "off"}, **more,
    }))  # fmt: skip


def histories(result):
    of = result["histories"].sel(probe="p")
    names = ("displacement", "absolute_acceleration", "absolute_displacement")
    outputs = {name: output.values for name, output in of.by_label("output_value").items()}
    return {name: of[name].values for name in names} | outputs


def test_a_linear_motion_is_the_sum_of_those_of_the_entries(tmp_path):
    """Records, noise, pulses, steps, tones and a sweep, of the base, of supports and of forces; reactions too."""
    each = entries(tmp_path)
    together = run_of({"kind": "forces", "forces": each})
    alone = [histories(run_of(entry)) for entry in each]
    for name, values in histories(together).items():
        total = np.sum([of[name] for of in alone], axis=0)
        np.testing.assert_allclose(values, total, rtol=0, atol=1e-9 * np.abs(total).max(), err_msg=name)
    assert together.summary["energy_error"] < 1e-9


def test_a_base_alone_in_a_list_is_a_base(tmp_path):
    base = entries(tmp_path)[1]
    stop = {"name": "s", "position": 0.5, "side": "above", "stiffness": 2e4, "gap": "0.2 mm", "mounted_on": "ground"}
    listed = run_of({"kind": "forces", "forces": [base]}, snubbers=[stop], run=BRIEF)
    plain = run_of(base, snubbers=[stop], run=BRIEF)
    assert listed.summary["contacts"]["s"] > 0
    for name, values in histories(plain).items():
        np.testing.assert_array_equal(histories(listed)[name], values)
    assert listed.summary["peak_force_n"] == plain.summary["peak_force_n"]


def test_ends_that_move_beside_a_base_are_drawn_where_they_are(tmp_path):
    moved, base = entries(tmp_path)[:2]
    excitation = {"kind": "forces", "forces": [moved, base]}
    times = np.linspace(0.0, 0.7, 8)
    case = {
        "beam": BEAM,
        "excitation": excitation,
        "run": {"duration": 0.7},
        "probes": [{"name": "p", "position": 0.6}],
    }
    ends = build_system(load_scenario(case)).with_supports([Place("beam", 0.0), Place("beam", 0.9)], times)
    expected = 1e-3 * np.sin(9.0 * times) ** 3 * np.exp(-2.0 * times)
    np.testing.assert_allclose(ends, np.transpose([0.0 * times, expected]), rtol=0, atol=1e-9)


def test_noise_in_a_list_has_statistics_where_nothing_else_comes_and_goes(tmp_path):
    noise, tone = {**NOISE, "applied_to": {"position": 0.5}}, {**entries(tmp_path)[6]}
    response = run_of({"kind": "forces", "forces": [noise, tone]})["random"]
    assert response["unit"].values[0] == "N"
    assert response["rms"].values[0] == pytest.approx(np.sqrt(0.01 * 70.0), rel=0.1)
    assert not response.labels("probe")  # of one input among several
    assert "random" not in run_of({"kind": "forces", "forces": [noise, entries(tmp_path)[0]]}).datasets


BRIEF = {"duration": 0.2, "sample_rate": 2000.0, "start": "rest", "convergence": "off"}
SWEEP = {"kind": "swept_sine", "from": 20, "to": 90, "rate": "100 Hz/s"}


@pytest.mark.parametrize("level", ["1 g", "0.05 mm"])
def test_supports_that_follow_one_swept_sine_are_a_base_that_follows_it(level):
    """Relative to a base at rest the motion contains that of the supports; accelerations and reactions are the same."""
    based = run_of({**SWEEP, "applied_to": "base", "level": level}, springs_to_ground=[], run=BRIEF)
    each = [{**SWEEP, "applied_to": {"support": side}, "level": level} for side in ("left", "right")]
    moved = run_of({"kind": "forces", "forces": each}, springs_to_ground=[], run=BRIEF)
    size = np.abs(based["histories"]["absolute_acceleration"].sel(probe="p").values).max()
    np.testing.assert_allclose(
        moved["histories"]["absolute_acceleration"].sel(probe="p").values / size,
        based["histories"]["absolute_acceleration"].sel(probe="p").values / size,
        atol=1e-6,
    )
    absolute = (
        based["histories"]["displacement"].sel(probe="p").values + based["histories"]["base_displacement"].values[0]
    )
    np.testing.assert_allclose(
        moved["histories"]["displacement"].sel(probe="p").values, absolute, rtol=0, atol=1e-6 * np.abs(absolute).max()
    )
    reactions = (
        moved["histories"]["output_value"].sel(output="right").values,
        based["histories"]["output_value"].sel(output="right").values,
    )
    np.testing.assert_allclose(*reactions, rtol=0, atol=1e-6 * np.abs(reactions[1]).max())
    assert moved.summary["energy_error"] < 1e-9


def test_a_stop_follows_a_swept_sine():
    """Positive upwards: a stop 1 mm below a resting mass touches it where the sweep first rises by that."""
    sweep = {**SWEEP, "rate": "2 Hz/s", "applied_to": {"snubber": "s"}, "level": "2 mm"}
    chain = {"masses": ["1000 kg"], "springs": ["4 MN/m"]}
    result = beamsim.run(load_scenario({
        "chain": chain, "excitation": sweep, "snubbers": [{"name": "s", "mass": 1, "side": "below", "stiffness": 10.0,
                                                           "gap": "1 mm"}],
        "run": {"duration": 0.1, "sample_rate": 1e5, "convergence": "off"},
    }))  # fmt: skip
    t = result["histories"]["time"].values[result["histories"]["snubber_closed"].sel(snubber="s").values][0]
    assert 0.0 < t < 0.02
    phase = 2 * np.pi * (20 * t + t**2)
    assert result["histories"]["snubber_penetration"].sel(snubber="s").values[
        result["histories"]["time"].values == t
    ] == pytest.approx(2e-3 * np.sin(phase) - 1e-3, abs=2e-5)


def test_a_base_with_two_directions_is_a_base_and_supports_that_move():
    """A support that moves as the turning base would does the same."""
    pulse = {"kind": "half_sine", "duration": "20 ms", "applied_to": "base"}
    up, turn = {**pulse, "level": "2 g"}, {**pulse, "level": "10 rad/s^2", "direction": "ry", "time": 0.02}
    end = {**pulse, "applied_to": {"support": "right"}, "level": -10.0 * BEAM["length"], "time": 0.02}
    both, turned = (
        run_of({"kind": "forces", "forces": [up, other]}, springs_to_ground=[], run=BRIEF) for other in (end, turn)
    )
    alone = [run_of(each, springs_to_ground=[], run=BRIEF) for each in (up, turn)]
    for of in (
        lambda r: r["histories"]["absolute_acceleration"].sel(probe="p").values,
        lambda r: r["histories"]["output_value"].sel(output="right").values,
    ):
        total = of(alone[0]) + of(alone[1])
        np.testing.assert_allclose(of(both), total, rtol=0, atol=1e-8 * np.abs(total).max())
        np.testing.assert_allclose(of(turned), total, rtol=0, atol=1e-9 * np.abs(total).max())
