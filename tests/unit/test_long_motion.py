"""Motions under random input that are not kept as a whole: the same as kept ones, in bounded memory."""

from contextlib import contextmanager

import numpy as np
import pytest

import beamsim
from beamsim.analyses.run import motion
from beamsim.errors import ScenarioError
from beamsim.flow import exact
from beamsim.inputs import signal
from beamsim.trust import convergence

PIECES = 1400  # of the input in 0.14 s


def scenario(**run):
    data = beamsim.load_scenario("configs/one_sided_65hz.yaml").model_dump(
        mode="json", by_alias=True, exclude_none=True
    )
    edges = [{"frequency": 20.0, "density": 2.0}, {"frequency": 500.0, "density": 2.0}]
    data["excitation"] = {"kind": "random", "applied_to": "base", "seed": 3, "psd": edges}
    data["run"] = {"duration": 0.14, "convergence": "off", "memory": 64e6, **run}
    return beamsim.load_scenario(data)


@pytest.fixture(autouse=True, scope="module")
def small_parts():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(signal, "PIECES_PER_BLOCK", 175)
        patch.setattr(motion, "FEWEST_PIECES", 64)
        patch.setattr(motion, "BYTES_A_PIECE", 51200)
        yield


LIFE = {"stress_range": 100e6, "cycles": 1e6, "exponent": 5.0}
ASKED = {"low_pass": 1000.0, "impacts": {"minimum_rest": 1e-3}, "fatigue": LIFE, "sample_rate": 20000.0}


@contextmanager
def counted_pieces():
    """Numbers of pieces of which sources were made."""
    counts = []
    make = exact.sources_of_pieces

    def counted(channels, first, last, duration):
        counts.append(last - first)
        return make(channels, first, last, duration)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(exact, "sources_of_pieces", counted)
        yield counts


@pytest.fixture(scope="module")
def both():
    """A run that is kept and the same in chunks, with accelerations behind a filter, impacts and fatigue."""
    with counted_pieces() as counts:
        whole = beamsim.run(scenario(memory=1e9, **ASKED))
        assert counts == [PIECES + 2]  # it was kept
        counts.clear()
        parts = beamsim.run(scenario(**ASKED))
        _, *of_chunks, latest = counts  # the first is for the start
        assert len(of_chunks) > 15
        assert sum(count - 1 for count in of_chunks) == PIECES + 1  # every piece is in one chunk, and marched once
        assert latest <= PIECES // 2  # for the spectra
    return whole, parts


def histories(result):
    return {name: of.values for name, of in result["histories"].items() if "time" in of.dims}


def test_a_motion_in_chunks_is_that_which_is_kept(both):
    whole, parts = both
    assert parts.summary["solver_events"] == whole.summary["solver_events"] > 20
    assert parts.summary["segments"] == whole.summary["segments"] > PIECES
    for name, values in histories(whole).items():
        round_off = 1e-12 * np.abs(values).max()  # sums of products depend on how many are taken together
        np.testing.assert_allclose(histories(parts)[name], values, rtol=0, atol=round_off, err_msg=name)
    np.testing.assert_array_equal(parts["events"]["time"].values, whole["events"]["time"].values)
    np.testing.assert_array_equal(parts["events"]["closing"].values, whole["events"]["closing"].values)
    exact_figures = ("peak_displacement_m", "min_displacement_m", "peak_acceleration_g", "peak_force_n", "contacts",
                     "largest_pull_n", "largest_gap_m")  # fmt: skip
    for name in exact_figures:
        assert parts.summary[name] == pytest.approx(whole.summary[name], rel=1e-9), name
    assert parts.summary["largest_bending_stress_pa"] == pytest.approx(whole.summary["largest_bending_stress_pa"])
    assert parts.summary["contact_share"] == pytest.approx(whole.summary["contact_share"], rel=1e-12)
    assert parts.summary["energy_error"] < 1e-10
    assert parts.summary["memory_bytes"] == 64e6
    assert parts.summary["random"].keys() == whole.summary["random"].keys()
    for name, values in whole.summary["random"].items():
        found, said = dict(parts.summary["random"][name]), dict(values)
        assert found.pop("expected_peak_unknown", "") == said.pop("expected_peak_unknown", "")
        assert found == pytest.approx(said, rel=1e-9), name
    stress = whole["bodies"]["peak_bending_stress"].values
    np.testing.assert_allclose(parts["bodies"]["peak_bending_stress"], stress, rtol=0, atol=1e-9 * stress.max())
    shapes = whole["bodies"]["extreme_shape"].values
    np.testing.assert_allclose(parts["bodies"]["extreme_shape"], shapes, rtol=0, atol=1e-7 * np.abs(shapes).max())


def test_impacts_from_a_time_on_are_the_same_in_chunks():
    asked = {"impacts": {}, "from": 0.0517, "sample_rate": 20000.0}
    whole, parts = (beamsim.run(scenario(memory=memory, **asked)) for memory in (1e9, 64e6))
    begin = whole["impacts"]["begin"].values
    assert begin.size > 10
    assert begin[0] >= 0.0517
    np.testing.assert_allclose(parts["impacts"]["begin"], begin, rtol=0, atol=1e-12)
    np.testing.assert_allclose(parts["impacts"]["impulse"], whole["impacts"]["impulse"], rtol=1e-9)
    assert parts.summary["impacts"]["tip"]["rate_hz"] == pytest.approx(begin.size / (0.14 - 0.0517), rel=1e-12)


def test_an_interrupted_motion_keeps_what_it_reached(both):
    reached = []
    result = beamsim.run(scenario(**ASKED), progress=reached.append, stop=lambda: reached[-1:] > [0.4])
    assert result.outcome.code == "interrupted"
    assert np.all(np.diff(reached) >= 0)
    assert 0.2 * 0.14 < result["histories"]["time"].values[-1] < 0.8 * 0.14
    with counted_pieces() as counts:
        assert result["bodies"]["peak_bending_stress"].values.max() > 0.0
    assert not counts  # nothing is marched again
    whole = both[0]
    kept = np.isin(whole["histories"]["time"].values, result["histories"]["time"].values)
    tip = result["histories"]["displacement"].sel(probe="tip").values
    np.testing.assert_allclose(
        tip, whole["histories"]["displacement"].sel(probe="tip").values[kept], rtol=1e-12, atol=1e-18
    )
    assert result.summary["peak_displacement_m"]["tip"] >= np.abs(tip).max()
    assert 0 < result.summary["events"] < whole.summary["events"]


def test_what_needs_the_whole_motion_is_refused():
    with pytest.raises(ScenarioError, match=r"run.srs.*run.memory"):
        beamsim.run(scenario(srs={"from": 20.0, "to": 500.0}))


def test_a_filter_impacts_and_fatigue_of_chunks_are_those_of_a_kept_motion(both):
    whole, parts = both
    for name in whole["histories"].labels("probe"):
        values, scale = (
            whole["histories"]["low_passed_acceleration"].sel(probe=name).values,
            np.abs(whole["histories"]["low_passed_acceleration"].sel(probe=name).values).max(),
        )
        np.testing.assert_allclose(
            parts["histories"]["low_passed_acceleration"].sel(probe=name).values, values, rtol=0, atol=1e-9 * scale
        )
    assert parts.summary["peak_acceleration_g"] == pytest.approx(whole.summary["peak_acceleration_g"], rel=1e-9)
    assert parts["impacts"]["begin"].values.size == whole["impacts"]["begin"].values.size > 10
    for name in ("begin", "end", "contact_time", "peak_force", "impulse", "approach_speed", "energy_lost"):
        values = whole["impacts"][name].values
        np.testing.assert_allclose(
            parts["impacts"][name], values, rtol=1e-9, atol=1e-12 * np.nanmax(values), err_msg=name
        )
    np.testing.assert_array_equal(parts["impacts"]["contacts"], whole["impacts"]["contacts"])
    for dataset, owner in (("impact_statistics", "cycle_snubber"), ("fatigue", "cycle_body")):
        for name, of in whole[dataset].groups(owner).items():
            of_parts, of_whole = (
                [each[column].values for column in ("range", "mean", "count")]
                for each in (parts[dataset].groups(owner)[name], of)
            )
            assert of_parts[2].sum() == of_whole[2].sum() > 10
            order = [np.lexsort((np.round(mean, 3), np.round(span, 3))) for span, mean, _ in (of_parts, of_whole)]
            values = of_whole[0][order[1]]
            np.testing.assert_allclose(of_parts[0][order[0]], values, rtol=0, atol=1e-7 * values.max())
    damage = whole["fatigue"]["damage"].values
    assert parts["fatigue"]["damage"].values == pytest.approx(damage, rel=1e-6)


def test_a_finer_model_is_compared_on_the_first_part():
    result = beamsim.run(scenario(convergence="on", memory=128e6))
    assert result.summary["convergence"]["peak_displacement_m"]["tip"] > 0.0
    assert any("finer model is compared on the first" in warning for warning in result.warnings)


def test_a_disturbance_is_followed_to_the_end(monkeypatch):
    """Only the first part was disturbed: what parts later was reported without a mark."""
    monkeypatch.setattr(convergence, "SMALL", 0.05)
    result = beamsim.run(scenario(convergence="on", memory=64e6, duration=0.4))
    model = result.summary["convergence_model"]
    assert 0.0 < model["compared_s"] < model["disturbance_divergence_s"] < 0.4
    assert {"peak_force_n.tip", "contacts.tip", "peak_displacement_m.tip"} <= set(result.summary["after_divergence"])
    assert not any("frequencies" in name for name in result.summary["after_divergence"])
    assert any("rms_*" in warning for warning in result.warnings)


def test_too_many_pieces_are_refused_where_a_motion_is_kept(monkeypatch):
    monkeypatch.setattr("beamsim.inputs.signal.MOST_PIECES", 500)
    with pytest.raises(ScenarioError, match="pieces, too many for this command or method"):
        beamsim.run(scenario(method="reference"))
