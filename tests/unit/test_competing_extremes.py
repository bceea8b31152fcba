"""Derivatives where two extremes compete for a value: closed forms, and what is shown of them."""

import math

import numpy as np
import pytest

import beamsim
from beamsim import load_scenario
from beamsim.cli.motions import run_screen
from beamsim.plots.run import run_figures
from beamsim.results.competition import compete
from beamsim.store.results import load, write_result

K, START = 800.0, 4e-3
FORCE = "constant_forces[0].force"
PEAK = "probes/mass/peak_displacement"


def oscillating(force, tolerance, **changes):
    """Undamped, released at -START under a force F: it moves between -START and START + 2 F / K."""
    case = {
        "chain": {"masses": [2.0], "springs": [K]},
        "constant_forces": [{"mass": 1, "force": force}],
        "excitation": {"kind": "none"},
        "probes": [{"name": "mass", "mass": 1}],
        "run": {
            "duration": 1.0, "start": {"displacement": [-START]}, "convergence": "off",
            "sensitivities": [{"path": FORCE, "tolerance": tolerance}],
        },
    }  # fmt: skip
    return beamsim.run(load_scenario({**case, **changes}))


def notes(result, name=PEAK):
    return [text for text in result.warnings if "run.sensitivities" in text and "extreme" in text and name in text]


@pytest.mark.parametrize("force", [0.0, 1e-6, -1e-6, 0.01, -0.01])
def test_both_sides_of_a_peak_where_the_other_end_of_the_motion_takes_over(force):
    """The largest magnitude is START or START + 2 F / K, the larger one."""
    result = oscillating(force, "0.1 N")
    of = result.summary["sensitivities"][PEAK][FORCE]
    assert of["derivative_below"] == pytest.approx(0.0, abs=1e-9)
    assert of["derivative_above"] == pytest.approx(2.0 / K, rel=1e-6)
    assert of["holds_within"] == pytest.approx(abs(force), rel=1e-5, abs=1e-9)
    peak = [START + max(0.0, 2.0 * (force + change) / K) for change in (0.1, -0.1, 0.0)]
    assert of["change"] == pytest.approx(peak[0] - peak[2], rel=1e-6)
    assert of["change_below"] == pytest.approx(peak[1] - peak[2], rel=1e-6, abs=1e-12)
    if force:
        assert of["derivative"] == pytest.approx(2.0 / K if force > 0.0 else 0.0, rel=1e-6, abs=1e-9)
    assert len(notes(result)) == 1


def test_an_extreme_that_is_out_of_reach_is_not_noted():
    """It is 6 % lower, and takes over where the force falls by more than its tolerance."""
    result = oscillating(0.1, "0.05 N")
    of = result.summary["sensitivities"][PEAK][FORCE]
    assert of["derivative_below"] == of["derivative_above"] == of["derivative"] == pytest.approx(2.0 / K, rel=1e-6)
    assert of["change"] == -of["change_below"] == pytest.approx(0.05 * of["derivative"])
    assert of["holds_within"] == pytest.approx(0.1, rel=1e-6)
    assert notes(result) == []


def test_an_extreme_within_one_percent_is_noted_however_small_the_tolerance_is():
    result = oscillating(0.01, "0.0001 N")  # 0.6 % lower
    of = result.summary["sensitivities"][PEAK][FORCE]
    assert (of["derivative_below"], of["derivative_above"]) == pytest.approx((0.0, 2.0 / K), rel=1e-6, abs=1e-9)
    assert of["change_below"] == pytest.approx(-0.0001 * 2.0 / K, rel=1e-6)  # not that far
    assert len(notes(result)) == 1


def test_equal_extremes_with_equal_derivatives_are_not_noted():
    """An undamped oscillator has the same extreme again and again, on both sides, each proportional to its start."""
    result = oscillating(0.0, "0.1 N", run={
        "duration": 2.0, "start": {"displacement": [START]}, "convergence": "off",
        "sensitivities": [{"path": "run.start.displacement[0]", "tolerance": "10 %"}],
    })  # fmt: skip
    of = result.summary["sensitivities"][PEAK]["run.start.displacement[0]"]
    assert of["derivative"] == of["derivative_below"] == of["derivative_above"] == pytest.approx(1.0, rel=1e-6)
    assert notes(result) == []


def test_probes_compete_for_a_limit_that_holds_at_all_of_them():
    """Two oscillators side by side: the limit is on the larger peak, whichever probe has it."""
    force = 1e-3
    result = oscillating(
        force, "0.1 N", chain={"masses": [2.0, 1.0], "springs": [K, 0.0, K]},
        probes=[{"name": "mass", "mass": 1}, {"name": "other", "mass": 2}], limits={"peak_displacement": "20 mm"},
        constant_forces=[{"mass": 1, "force": force}, {"mass": 2, "force": 0.0}],
        run={
            "duration": 1.0, "start": {"displacement": [-START, START]}, "convergence": "off",
            "sensitivities": [{"path": FORCE, "tolerance": "0.1 N"}],
        },
    )  # fmt: skip
    of = result.summary["sensitivities"]["peak_displacement"][FORCE]
    assert of["derivative"] == of["derivative_above"] == pytest.approx(2.0 / K, rel=1e-6)
    assert of["derivative_below"] == pytest.approx(0.0, abs=1e-9)
    assert of["holds_within"] == pytest.approx(force, rel=1e-4)
    assert len(notes(result, " peak_displacement")) == 1


def test_a_smallest_value_has_its_derivatives_on_both_sides_too():
    """The lowest point of the motion is the start, -START, or 2 F / K + START where that is lower."""
    force = -K * START - 1e-4
    result = oscillating(force, "0.01 N")
    of = result.summary["sensitivities"]["probes/mass/min_displacement"][FORCE]
    assert of["derivative"] == of["derivative_below"] == pytest.approx(2.0 / K, rel=1e-6)
    assert of["derivative_above"] == pytest.approx(0.0, abs=1e-9)
    assert of["change"] == pytest.approx(1e-4 * 2.0 / K, rel=1e-4)


def test_a_force_whose_contact_ends_within_the_tolerance_falls_to_zero():
    """Released at x0 the oscillator comes to -x0, which is just beyond the stop."""
    gap, stiffness = START - 1e-6, 3e4
    stop = {"name": "stop", "mass": 1, "side": "above", "stiffness": stiffness, "gap": gap}
    result = oscillating(0.0, "0.1 N", chain={"masses": [2.0], "springs": [K], "snubbers": [stop]}, run={
        "duration": 0.3, "start": {"displacement": [-START]}, "convergence": "off",
        "sensitivities": [{"path": "chain.snubbers.stop.gap", "tolerance": "0.1 mm"}],
    })  # fmt: skip
    force = result.summary["peak_force_n"]["stop"]
    of = result.summary["sensitivities"]["snubbers/stop/peak_force"]["chain.snubbers.stop.gap"]
    assert of["derivative_below"] == of["derivative"] < 0.0
    assert (of["derivative_above"], of["change"]) == pytest.approx((0.0, -force), rel=1e-6)


def test_a_contact_that_begins_just_after_the_end_of_the_record_is_counted():
    """The stop is 1 um beyond where the record ends; there the structure comes towards it."""
    omega, end = math.sqrt(K / 2.0), 0.07
    there = -START * math.cos(omega * end)
    assert math.sin(omega * end) > 0.0
    stop = {"name": "stop", "mass": 1, "side": "above", "stiffness": 3e4, "gap": there + 1e-6}
    result = oscillating(0.0, "0.1 N", chain={"masses": [2.0], "springs": [K], "snubbers": [stop]}, run={
        "duration": end, "start": {"displacement": [-START]}, "convergence": "off",
        "sensitivities": [{"path": "chain.snubbers.stop.gap", "tolerance": "0.01 mm"}],
    })  # fmt: skip
    of = result.summary["sensitivities"]["snubbers/stop/peak_force"]["chain.snubbers.stop.gap"]
    assert of["holds_within"] == pytest.approx(1e-6, rel=1e-4)
    assert any("enters the record" in text for text in result.warnings)


def of_a_stop(gap, end):
    """How far the gap may change: by closed forms, and by a run; the oscillator is released at -START."""
    stiffness, omega, inside = 3e4, math.sqrt(K / 2.0), math.sqrt((K + 3e4) / 2.0)

    def begins(gap):
        return math.acos(-gap / START) / omega

    def ends(gap):
        """Half of the contact's time is that from the stop to where the motion turns."""
        offset, speed = K * gap / (K + stiffness), omega * math.sqrt(START**2 - gap**2)
        return begins(gap) + 2.0 * math.atan2(speed, inside * offset) / inside

    stop = {"name": "stop", "mass": 1, "side": "above", "stiffness": stiffness, "gap": gap}
    result = oscillating(0.0, "0.1 N", chain={"masses": [2.0], "springs": [K], "snubbers": [stop]}, run={
        "duration": end, "start": {"displacement": [-START]}, "convergence": "off",
        "sensitivities": [{"path": "chain.snubbers.stop.gap", "tolerance": "0.01 mm"}],
    })  # fmt: skip
    found = result.summary["sensitivities"]["snubbers/stop/contact_share"]["chain.snubbers.stop.gap"]["holds_within"]
    rates = [(time(gap + 1e-8) - time(gap - 1e-8)) / 2e-8 for time in (begins, ends)]
    expected = [abs((end - time(gap)) / rate) for time, rate in zip((begins, ends), rates, strict=True)]
    return found, expected, [text for text in result.warnings if "record" in text]


@pytest.mark.parametrize("late", [2e-5, -2e-5])
def test_a_contact_that_begins_near_the_end_leaves_or_enters_the_record(late):
    found, (expected, _), notes = of_a_stop(2e-3, 2.0 * math.pi / 3.0 / math.sqrt(K / 2.0) + late)
    assert found == pytest.approx(expected, rel=2e-3)
    assert len(notes) == 1
    assert ("leaves" if late > 0.0 else "enters") in notes[0]


@pytest.mark.parametrize("late", [2e-5, -2e-5])
def test_a_contact_that_ends_near_the_end_leaves_or_enters_the_record(late):
    """The share of the time in contact then changes otherwise."""
    omega, inside = math.sqrt(K / 2.0), math.sqrt((K + 3e4) / 2.0)
    speed, offset = omega * math.sqrt(START**2 - 4e-6), K * 2e-3 / (K + 3e4)
    ends = 2.0 * math.pi / 3.0 / omega + 2.0 * math.atan2(speed, inside * offset) / inside
    found, (_, expected), notes = of_a_stop(2e-3, ends + late)
    assert found == pytest.approx(expected, rel=2e-3)
    assert len(notes) == (expected < 1e-5)


def test_all_values_for_which_extremes_compete_are_in_one_note():
    """Two numbers, and peaks of the oscillator and of the limit that is the same."""
    result = oscillating(1e-3, "0.1 N", limits={"peak_displacement": "20 mm"}, run={
        "duration": 1.0, "start": {"displacement": [-START]}, "convergence": "off",
        "sensitivities": [{"path": path, "tolerance": "5 %"} for path in (FORCE, "run.start.displacement[0]")]
        + [{"path": "chain.springs[0]", "tolerance": "1 %"}],
    })  # fmt: skip
    rows = {
        (name, path) for name, by in result.summary["sensitivities"].items() for path, of in by.items()
        if of["derivative_below"] != of["derivative_above"]
    }  # fmt: skip
    [note] = [text for text in result.warnings if "extremes compete" in text]
    assert {name for name, _ in rows} == {PEAK}
    assert f"the table gives both sides of {len(rows) - 1} more derivative" in note


def test_the_rule_itself():
    """Three lines over a change: 1, 0.99 + x and 0.5 - 10 x."""
    both = compete(np.array([1.0, 0.99, 0.5]), np.array([0.0, 1.0, -10.0]), 0.02)
    assert (both.derivative_below, both.derivative_above) == (0.0, 1.0)
    assert (both.change_below, both.change_above) == pytest.approx((0.0, 0.01))
    assert both.takeover == pytest.approx(0.01)
    assert both.rival == 1
    wide = compete(np.array([1.0, 0.99, 0.5]), np.array([0.0, 1.0, -10.0]), 0.1)
    assert (wide.derivative_below, wide.derivative_above) == (-10.0, 1.0)
    assert (wide.change_below, wide.change_above) == pytest.approx((0.5, 0.09))


def test_they_are_printed_stored_and_drawn(tmp_path):
    result = oscillating(1e-3, "0.1 N")
    of = result.summary["sensitivities"][PEAK][FORCE]
    text = run_screen(result).text(result, ["case.h5"])
    assert f"{FORCE} +100 mN: +0.25 mm, -100 mN: -2.5 µm" in text
    write_result(result, tmp_path / "case.h5")
    again = load(tmp_path / "case.h5")
    assert again.summary["sensitivities"][PEAK][FORCE] == of
    [row] = [row for row in again["sensitivities"].rows("row") if row["response"] == PEAK]
    assert (row["derivative_below"], row["derivative_above"]) == (of["derivative_below"], of["derivative_above"])
    widths = [bar.get_width() for bar in run_figures(result)["sensitivities"].figure().axes[0].patches]
    np.testing.assert_allclose(widths, [1e3 * of["change"], 1e3 * of["change_below"]], rtol=1e-12)  # mm
