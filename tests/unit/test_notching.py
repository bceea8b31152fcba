"""Sweeps whose level is lowered to limits: the limits are met, the level can be run again, what fails is said."""

import json
import re

import numpy as np
import pytest

from beamsim.analyses.sweep.analysis import sweep
from beamsim.analyses.sweep.swept_sine import combine_level_outcomes
from beamsim.cli.motions import in_gravities, notch_texts
from beamsim.outcomes import COMPLETE, Outcome, OutcomeKind, Where
from beamsim.scenario import load_scenario
from beamsim.store.results import load, write_result
from tests.helpers.commands import invoke

G = 9.80665
CASE = {
    "chain": {"masses": [1, 0.5], "springs": [39478.4, 60000, 0], "damping": {"kind": "modal", "ratio": "2 %"}},
    "excitation": {"kind": "harmonic", "applied_to": "base", "level": "2 g", "frequency": "20 Hz"},
    "probes": [{"name": "first", "mass": 1}, {"name": "second", "mass": 2}],
}
SWEEP = {
    "kind": "swept_sine", "from": "14 Hz", "to": "45 Hz", "rate": "4 oct/min", "orders": [1],
    "notch_to": {"probes.second.acceleration": "6 g", "base.force": "75 N"},
}  # fmt: skip


def case(**settings):
    given = {key: value for key, value in {**SWEEP, **settings}.items() if value is not None}
    return load_scenario({**CASE, "sweep": given})


@pytest.fixture(scope="module")
def notched():
    return sweep(case())


def shares(curve, settings):
    peaks = {
        "probes.second.acceleration": curve.channel("absolute_acceleration", "second").peak,
        "base.force": curve.channel("output", "base_force").peak,
    }
    return {name: peaks[name] / float(limit) for name, limit in settings.notch_to.items()}


def test_limits_are_met_and_reached_where_the_level_is_lowered(notched):
    """At 4 oct/min within 5 %; the sweep without notches exceeds both several times."""
    (curve,) = notched.curves.values()
    share = shares(curve, notched.scenario.sweep)
    worst = np.max(list(share.values()), axis=0)
    assert notched.outcome.complete
    assert worst.max() < 1.05
    notching = curve.notching
    level = np.interp(curve.frequency_hz, notching.frequency_hz, notching.level / notching.specification)
    inside = (level < 0.9) & (curve.frequency_hz > 15.0)
    assert inside.sum() > 100
    assert worst[inside].min() > 0.95
    plain = sweep(case(notch_to=None, rate="12 oct/min", to="30 Hz"))
    (free,) = plain.curves.values()
    assert free.channel("absolute_acceleration", "second").peak.max() > 3 * 6 * G
    assert free.notching is None
    assert plain.summary.get("notches") is None


def test_the_level_of_a_slow_sweep_is_the_limit_over_the_transfer_function():
    """The chain without stops is linear: in a slow sweep the level that holds the limit is known."""
    result = sweep(case(rate="1 oct/min", to="24 Hz", notch_to={"probes.second.acceleration": "6 g"}))
    (curve,) = result.curves.values()
    linear, notching = result["linear"].sel(probe="second"), curve.notching
    f = np.linspace(15.5, 23.5, 50)
    response = np.hypot(*(linear[f"absolute_acceleration_{part}"].values for part in ("real", "imag")))
    gain = np.interp(f, linear["frequency_hz"].values, response)
    level = np.exp(np.interp(np.log(f), np.log(notching.frequency_hz), np.log(notching.level)))
    expected = np.minimum(6 * G / gain, 2 * G)
    # the response lags behind the frequency
    assert np.max(np.abs(np.log(level / expected))) < 0.02
    assert np.ptp(expected) > 10.0


def test_which_limit_governs_where_is_told(notched):
    summary = notched.summary["notches"]["up_0"]
    names = {part["limit"] for part in summary["ranges"]}
    assert names == {"probes.second.acceleration", "base.force"}
    for name, limit in summary["limits"].items():
        assert 0.97 < limit["share"] < 1.05, name
    for part in summary["ranges"]:
        assert part["from_hz"] <= part["at_hz"] <= part["to_hz"]
        assert part["reduction_db"] < 0


def test_the_saved_level_gives_the_same_response_as_a_given_profile(notched, tmp_path):
    """Through the result file and its CSV export, number by number."""
    write_result(notched, tmp_path / "notched.h5")
    stored = load(tmp_path / "notched.h5").curves["up_0"].notching
    np.testing.assert_array_equal(stored.level, notched.curves["up_0"].notching.level)
    assert [limit.name for limit in stored.limits] == list(SWEEP["notch_to"])
    done = invoke("export", tmp_path / "notched.h5", "--format", "csv", "-o", tmp_path)
    assert done.exit_code == 0, done.output
    (table,) = tmp_path.rglob("notches_by_point.csv")
    outputs = [{"name": "base_force", "kind": "reaction_force", "support": "base"}]
    settings = {**SWEEP, "notch_to": None, "profile_file": {"file": str(table), "column": "level"}}
    again = sweep(load_scenario({**CASE, "outputs": outputs, "sweep": settings}))
    one, other = notched.curves["up_0"], again.curves["up_0"]
    for place in ("first", "second"):
        np.testing.assert_allclose(
            other.channel("absolute_acceleration", place).maximum,
            one.channel("absolute_acceleration", place).maximum,
            rtol=1e-12,
        )
    np.testing.assert_allclose(
        other.channel("output", "base_force").peak, one.channel("output", "base_force").peak, rtol=1e-12
    )


def test_a_level_given_as_displacement_is_saved_as_one(tmp_path):
    """The table has the quantity with which the sweep begins, whose phase it keeps."""
    settings = {"from": "18 Hz", "to": "22 Hz", "notch_to": {"probes.second.displacement": "3 mm"}}
    displaced = {**CASE, "excitation": {**CASE["excitation"], "level": "1 mm"}}
    one = sweep(load_scenario({**displaced, "sweep": {**SWEEP, **settings}})).curves["up_0"]
    assert one.notching.unit == "m"
    assert one.channel("displacement", "second").peak.max() < 1.05 * 3e-3
    rows = zip(one.notching.frequency_hz.tolist(), (1e3 * one.notching.level).tolist(), strict=True)
    lines = ["frequency (Hz); level (mm)", *(f"{f!r}; {level!r}".replace(".", ",") for f, level in rows)]
    (tmp_path / "level.csv").write_text("\n".join(lines))
    given = {**SWEEP, **settings, "notch_to": None, "profile_file": str(tmp_path / "level.csv")}
    other = sweep(load_scenario({**displaced, "sweep": given})).curves["up_0"]
    np.testing.assert_allclose(
        other.channel("displacement", "second").maximum, one.channel("displacement", "second").maximum, rtol=1e-9
    )


def test_limits_that_impacts_exceed_are_an_outcome():
    """A stiff stop that is hit in every cycle: its force jumps from cycle to cycle and no level holds it."""
    stop = {"name": "stop", "mass": 2, "side": "below", "stiffness": 5e6, "gap": "0 mm"}
    chain = {**CASE["chain"], "snubbers": [stop]}
    settings = {**SWEEP, "to": "19 Hz", "rate": "12 oct/min", "notch_to": {"snubbers.stop.force": "30 N"}}
    result = sweep(load_scenario({**CASE, "chain": chain, "sweep": settings}))
    (missed,) = result.outcome.outcomes_with_code("notch_not_held")
    (curve,) = result.curves.values()
    assert missed.numbers["percent"] == pytest.approx(100 * (curve.channel("force", "stop").peak.max() / 30 - 1))
    assert missed.numbers["percent"] > 5
    assert not result.outcome.complete
    assert result.outcome.trusted
    assert not result.outcome.cut_short  # every cycle was computed


def test_the_largest_excess_of_all_levels_comes_first_and_each_is_named():
    over = [
        Outcome.of(
            OutcomeKind.NOT_HELD, "notch_not_held", "notching: first is exceeded", remedy="sweep more slowly",
            limit="first", percent=percent, frequency=20.0,
        )
        for percent in (6.29, 6.94)
    ]  # fmt: skip
    outcome = combine_level_outcomes(
        [over[0], COMPLETE, over[1]], [Where(level, "g", "level") for level in (0.5, 1.0, 2.0)]
    )
    assert outcome.text == (
        "level 2 g: notching: first is exceeded; sweep more slowly; "
        "level 0.5 g: first is exceeded by up to 6.29 % at 20 Hz"
    )
    assert [each.numbers["percent"] for each in outcome.outcomes_with_code("notch_not_held")] == [6.94, 6.29]
    assert combine_level_outcomes([COMPLETE, COMPLETE], [Where(1.0, "g", "level")] * 2) is COMPLETE


def test_the_command_prints_the_notches_and_draws_them(tmp_path, notched):
    figure = notched.plot()["notching_up_0"]
    level, *responses = (ax.get_ylabel().split(" (")[0] for ax in figure.axes)
    assert level == "Level"
    assert set(responses) == {"second acceleration", "base force"}
    path = tmp_path / "case.yaml"
    path.write_text(json.dumps({**CASE, "sweep": {**SWEEP, "to": "20 Hz"}}))
    done = invoke("sweep", path, "--no-plots")
    assert done.exit_code == 0, done.output
    assert "at most" in done.output
    assert "% of 75 N" in done.output
    assert "lowest level" in done.output


def test_a_limit_that_the_level_keeps_is_met_as_well_as_the_level_is_known():
    """By 0.15 % above it is met, by 0.3 % exceeded; the limit of a probe for which nothing is lowered always is."""
    settings = {"to": "18 Hz", "rate": "12 oct/min", "notch_to": {"probes.second.acceleration": "6 g"}}
    (curve,) = sweep(case(**settings)).curves.values()
    first, second = (float(curve.channel("absolute_acceleration", name).peak.max()) for name in ("first", "second"))
    for share, verdict in ((1.0015, "ok"), (1.003, "exceeded")):
        limits = {"first": first / share, "second": second / share}
        given = {**CASE, "sweep": {**SWEEP, **settings}, "limits": {"peak_acceleration": limits}}
        margins = sweep(load_scenario(given)).summary["margins"]
        assert margins["peak_acceleration.second"]["verdict"] == verdict
        assert margins["peak_acceleration.first"]["verdict"] == "exceeded"


def test_the_level_of_a_notch_is_given_in_the_unit_of_the_input_and_in_g():
    """A displacement X at f is (2 pi f)^2 X."""
    settings = {"to": "18 Hz", "rate": "12 oct/min", "notch_to": {"probes.second.acceleration": "6 g"}}
    given = {**CASE, "excitation": {**CASE["excitation"], "level": "6 mm"}, "sweep": {**SWEEP, **settings}}
    result = sweep(load_scenario(given))
    (curve,) = result.curves.values()
    lowered = curve.notching.ranges[0]
    text = notch_texts(result)["up_0 range 1"]
    in_g = lowered.level * (2.0 * np.pi * lowered.at_hz) ** 2 / G
    first, last = (6e-3 * (2.0 * np.pi * f) ** 2 / G for f in (14.0, 18.0))
    free = sweep(load_scenario({**given, "sweep": {**given["sweep"], "notch_to": None}}))
    low, high = (float(x) for x in re.fullmatch(r" \((.*) to (.*) g\)", in_gravities(free.curves["up_0"])).groups())
    assert (low, high) == pytest.approx((first, last), rel=0.03)  # the last whole cycle is 1.5 cycles before the end
    assert f"lowest level {1e3 * lowered.level:.4g} mm or {in_g:.4g} g (" in text


@pytest.mark.parametrize(
    ("profile", "said"),
    [
        # 10 mm at 20 Hz are 0.01 (2 pi 20)^2 / 9.80665 = 16.1 g; 2 g are reached at sqrt(2 g / 10 mm) / 2 pi
        (
            [(5, "10 mm"), (20, "2 g")],
            "jumps at 20 Hz from 16.1 g to 2 g (-18.1 dB); let the levels meet (they meet at 7.048 Hz)",
        ),
        ([(5, "10 mm"), (20, "2 g"), (90, "4 g")], "jumps at 90 Hz from 2 g to 4 g (+6.0 dB); let the levels meet"),
        ([(5, "1 g"), (20, "0 g")], "jumps at 20 Hz from 1 g to 0 g; let the levels meet"),
        ([(5, "1 g"), (20, "1 g"), (200, "9 g")], ""),
    ],
)  # fmt: skip
def test_jumps_of_a_profile_are_named_before_the_sweep(profile, said):
    settings = {
        "from": "5 Hz", "to": "100 Hz", "notch_to": None,
        "profile": [{"frequency": f, "level": level} for f, level in profile],
    }  # fmt: skip
    warnings = case(**settings).warnings
    assert any(text == f"sweep: the level of the profile {said}" for text in warnings) == bool(said)
    assert said or not any("jumps" in text for text in warnings)
    if "0 g" not in said:
        assert not any("jumps" in text for text in case(**settings, between="log_log").warnings)
