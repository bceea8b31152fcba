"""Conventions of a sweep's values: weights, signs of tables of levels, what a fractional order covers."""

import numpy as np
import pytest
from sampling import first_apart

from beamsim.analyses.sweep.analysis import demand_consistent, sweep
from beamsim.analyses.sweep.layouts import CYCLES
from beamsim.analyses.sweep.peaks import find_peaks
from beamsim.analyses.sweep.result import SweepCurve
from beamsim.scenario import load_scenario
from beamsim.store.results import load, write_result

CHAIN = {
    "chain": {
        "masses": [1, 1], "springs": [400, 400, 400], "dashpots": [0.5, 0.5, 0.5],
        "snubbers": [{"name": "stop", "mass": 2, "side": "below", "stiffness": 5000, "gap": "2 mm"}],
    },
    "probes": [{"name": "first", "mass": 1}],
}  # fmt: skip
SWEEP = {"kind": "swept_sine", "from": "1 Hz", "to": "4 Hz", "rate": "1 Hz/s"}


def curve(excitation, **settings):
    excitation = {"kind": "harmonic", "applied_to": "base", "frequency": "2 Hz", **excitation}
    return sweep(load_scenario({**CHAIN, "excitation": excitation, "sweep": {**SWEEP, **settings}})).curves["up_0"]


@first_apart("level", 1, ["4 mm", "0.1 g"])
def test_a_table_of_levels_has_the_sign_of_a_single_level(level):
    """With a stop on one side the motion depends on the sign of the base's; a table of one point is that level."""
    table = {"profile": [{"frequency": "1 Hz", "level": level}]}
    single = curve({"level": level})
    for quantity in ({}, {"quantity": "acceleration", "level": 1.0}):
        given = curve({"level": level, **quantity}, **table, levels=[1.0])
        np.testing.assert_allclose(
            given.channel("displacement", "first").maximum, single.channel("displacement", "first").maximum, rtol=1e-9
        )
        assert (
            given["contacts"].sel(snubber="stop").values.sum()
            == single["contacts"].sel(snubber="stop").values.sum()
            > 0
        )
    reversed_ = curve({"level": f"-{level}"})
    factor = curve({"level": level}, **table, levels=[-1.0])
    np.testing.assert_allclose(
        factor.channel("displacement", "first").maximum, reversed_.channel("displacement", "first").maximum, rtol=1e-9
    )
    assert (
        np.abs(
            reversed_.channel("displacement", "first").maximum / single.channel("displacement", "first").maximum - 1
        ).max()
        > 0.1
    )


RATE = 20_000.0  # Hz


@pytest.fixture(scope="module")
def recorded():
    """A sweep with its history."""
    excitation = {"kind": "harmonic", "applied_to": "base", "frequency": "2 Hz", "level": "0.1 g"}
    settings = {**SWEEP, "history_rate": RATE, "orders": [0.5, 1]}
    return sweep(load_scenario({**CHAIN, "excitation": excitation, "sweep": settings}))


def test_mean_square_mean_and_contact_share_are_weighted_by_time(recorded):
    values, history = recorded.curves["up_0"], recorded["histories"]
    ends = np.append(values.time, values.time[-1] + 1 / values.frequency_hz[-1])[:-1]
    force = history["force"].sel(snubber="stop").values
    displacement = history["displacement"].sel(probe="first").values
    for cycle in range(ends.size - 1):
        inside = (history["time"].values >= ends[cycle]) & (history["time"].values < ends[cycle + 1])
        size = values.channel("displacement", "first").rms[cycle]
        assert values.channel("displacement", "first").mean[cycle] == pytest.approx(
            displacement[inside].mean(), abs=2e-3 * size
        )
        assert size == pytest.approx(np.sqrt(np.mean(displacement[inside] ** 2)), rel=2e-3)
        assert values["contact_share"].sel(snubber="stop").values[cycle] == pytest.approx(
            np.mean(force[inside] != 0), abs=2e-3
        )
    whole = history["time"].values < ends[-1]
    share = recorded.summary["contact_share"]["up_0"]["stop"]
    assert share == pytest.approx(np.mean(force[whole] != 0), abs=0.02)
    assert share == pytest.approx(values.weights @ values["contact_share"].sel(snubber="stop").values)
    assert values.weights.sum() == pytest.approx(1.0)


def test_the_last_row_takes_up_the_incomplete_cycle_at_the_end():
    """A contact in the last part of a cycle had no row: no force, no count, no larger displacement."""
    free = {"name": "stop", "mass": 1, "side": "above", "stiffness": 5000, "gap": 1.0}
    case = {
        "chain": {"masses": [1.0], "springs": [1421.0, 0.0], "dashpots": [0.5, 0.0], "snubbers": [free]},
        "excitation": {"kind": "harmonic", "applied_to": {"mass": 1}, "level": "1 N", "frequency": 5.0},
        "probes": [{"name": "mass", "mass": 1}],
        "sweep": {"kind": "swept_sine", "from": 5.0, "to": 5.9, "rate": "0.5 Hz/s", "history_rate": 2e4},
    }
    result = sweep(load_scenario(case))
    history, (row,) = result["histories"], result.curves.values()
    moved = history["displacement"].sel(probe="mass").values
    values = row.channel("displacement", "mass")
    assert values.maximum[-1] == pytest.approx(moved.max(), rel=1e-6)
    assert values.maximum[:-1].max() < 0.99 * moved.max()
    last = moved[history["time"].values >= row.time[-1]]
    assert values.mean[-1] == pytest.approx(last.mean(), abs=2e-3 * moved.max())
    assert values.rms[-1] == pytest.approx(np.sqrt(np.mean(last**2)), rel=2e-3)
    case["chain"]["snubbers"] = [{**free, "gap": 0.995 * moved.max()}]
    touched = sweep(load_scenario(case)).curves["up_0"]
    assert (
        touched["contacts"].sel(snubber="stop").values.sum() == touched["contacts"].sel(snubber="stop").values[-1] == 1
    )
    assert touched.channel("force", "stop").maximum[-1] > 0.0
    assert touched["contact_share"].sel(snubber="stop").values[-1] > 0.0


def fast_sweep_of_one_mode(gap=1.0, **sweep_settings):
    """Peaks of a structure whose only natural frequency is 15.9 Hz, in order of frequency."""
    chain = {"masses": [1.0], "springs": [1e4, 0], "damping": {"kind": "modal", "ratio": 0.02}}
    stop = {"name": "s", "mass": 1, "side": "below", "stiffness": 1e5, "gap": gap}
    base = {"kind": "harmonic", "applied_to": "base", "level": 1.0, "frequency": 14.0}
    fast = {"kind": "swept_sine", **sweep_settings}
    result = sweep(load_scenario({"chain": chain, "snubbers": [stop], "excitation": base, "sweep": fast}))
    return sorted(result.peaks, key=lambda peak: peak.frequency_hz)


@pytest.mark.parametrize(("gap", "linear"), [(1.0, True), (0.0, False)])
def test_a_fast_linear_sweep_beats_behind_its_resonance(gap, linear):
    """Its maxima there were named sub- and superharmonic resonances of a structure without contact."""
    peaks = fast_sweep_of_one_mode(gap, **{"from": 10, "to": 30, "rate": "5 Hz/s"})
    kinds = [peak.kind for peak in peaks]
    assert len(kinds) > 3
    assert ("beat" in kinds) == linear
    if linear:
        assert kinds == ["linear resonance", *["beat"] * (len(kinds) - 1)]


@pytest.mark.parametrize(
    ("settings", "resonances"),
    [
        ({"from": 20, "to": 40, "rate": "5 Hz/s"}, []),  # begins behind it
        ({"from": 10, "to": 20, "rate": "8 oct/min"}, [16.9]),
        ({"from": 10, "to": 20, "rate": "8 oct/min", "direction": "down"}, [15.0]),
    ],
)
def test_beats_of_the_start_are_no_resonances(settings, resonances):
    """One mode has one resonance, whatever comes and goes at the excitation frequency; three were listed."""
    peaks = fast_sweep_of_one_mode(**settings)
    assert {peak.kind for peak in peaks} <= {"linear resonance", "beat"}
    assert "beat" in {peak.kind for peak in peaks}
    found = [peak.frequency_hz for peak in peaks if peak.kind == "linear resonance"]
    assert found == pytest.approx(resonances, abs=0.4)


def test_a_jump_ends_the_resonance_whatever_harmonics_it_excites():
    """The excitation frequency holds 1.6 of 1.9 mm before the jump and a tenth behind it: no peak of order 4."""
    f = np.linspace(14.0, 30.0, 200)
    before = f < 21.3
    peak = np.where(before, 1.3 + 0.6 * (f - 14.0) / 7.3, 0.15)
    harmonics = np.array(
        [np.where(before, 1.0 + 0.6 * (f - 14.0) / 7.3, 0.12), 0.4 * np.exp(-(((f - 21.3) / 0.5) ** 2))]
    )
    none, every = np.zeros(f.size), np.arange(f.size)

    def curve(harmonics):
        statistics = dict.fromkeys(("min", "rms", "mean"), -none) | {"max": peak, "peak": peak}
        cycles = CYCLES.dataset({
            "cycle": 1 + every, "curve": 0 * every, "frequency_hz": f, "time": none, "excitation_amplitude": none + 1.0,
            "energy_error": none, "order": [1.0, 4.0], "probe": ["tip"], "static_displacement": [0.0],
            "snubber": ["stop"], "contact_share": np.where(before, 0.3, 0.0)[None], "contacts": 0 * every[None],
            **{f"{name}_displacement": values[None] for name, values in statistics.items()},
            "harmonic_displacement_real": harmonics[None], "harmonic_displacement_imag": 0.0 * harmonics[None],
        }, excitation_unit="N")  # fmt: skip
        return SweepCurve("up_0", "swept_sine", "up", 0, 1.0, "N", "force", {"cycles": cycles})

    (jump,) = find_peaks(curve(harmonics), "tip", None)
    assert (jump.kind, jump.order) == ("nonlinear resonance", 1.0)
    harmonics[0] = 1.0  # what the excitation causes does not change: order 4 has the peak
    (of_order_4,) = find_peaks(curve(harmonics), "tip", None)
    assert (of_order_4.kind, of_order_4.order) == ("superharmonic", 4.0)


def test_without_orders_a_peak_is_at_the_frequency_of_the_excitation():
    chain = {"masses": [1.0], "springs": [1e4, 0], "dashpots": [1, 0]}
    base = {"kind": "harmonic", "applied_to": "base", "level": 1.0, "frequency": 10.0}
    settings = {**SWEEP, "from": 10, "to": 40, "rate": "1 oct/s", "orders": [], "convergence": "off"}
    peaks = sweep(load_scenario({"chain": chain, "excitation": base, "sweep": settings})).peaks
    assert peaks
    assert {peak.order for peak in peaks} == {1.0}
    assert all(np.isnan(peak.share) for peak in peaks)


def test_the_edge_of_a_notch_is_no_resonance():
    chain = {"masses": [1.0], "springs": [1e4, 0], "damping": {"kind": "modal", "ratio": 0.02}}
    notched = {**SWEEP, "from": 20, "to": 30, "rate": "2 Hz/s", "notches": [{"from": 23, "to": 26, "level": 0.1}]}
    base = {"kind": "harmonic", "applied_to": "base", "level": 1.0, "frequency": 14.0}
    result = sweep(load_scenario({"chain": chain, "excitation": base, "sweep": notched}))
    edge, *beats = [peak for peak in result.peaks if peak.frequency_hz > 25]
    assert abs(edge.frequency_hz / 26 - 1) < 0.01
    assert edge.kind == "level step"
    assert {peak.kind for peak in beats} == {"beat"}


def test_a_resumed_sweep_knows_which_springs_pass_breakpoints(tmp_path):
    """Its peaks are nonlinear resonances although no contact closes; the file of a part was refused."""
    law = {"kind": "piecewise_linear", "breakpoints": [-1e-3, 1e-3], "stiffnesses": [6e3, 4e3, 6e3]}
    chain = {"masses": [1.0, 1.0], "springs": [4e3, 0.0, 0.0], "springs_between": [{"masses": [1, 2], **law}],
             "damping": {"kind": "modal", "ratio": 0.05}}  # fmt: skip
    base = {"kind": "harmonic", "applied_to": "base", "level": 1.0, "frequency": 6.0}
    settings = {"kind": "stepped", "from": 5.0, "to": 9.0, "points": 9, "levels": [0.5, 3.0], "most_cycles": 60}
    scenario = load_scenario({"chain": chain, "excitation": base, "sweep": settings})
    whole = sweep(scenario)
    assert "nonlinear resonance" in {peak.kind for peak in whole.peaks}
    write_result(whole, tmp_path / "swept.h5")
    stored = load(tmp_path / "swept.h5", whole=True)
    demand_consistent(stored)
    again = sweep(scenario, resume=stored)
    assert again.peaks == whole.peaks
    assert again.summary == whole.summary
    for name, dataset in whole.datasets.items():
        for variable, array in dataset.items():
            np.testing.assert_array_equal(again[name][variable].values, array.values, variable)
