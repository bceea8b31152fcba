"""``beamsim sweep`` of kind continuation: configs, folds, overlay, harmonic balance, files, limits, exit codes."""

import numpy as np
import pytest
from shipped import config_path

from beamsim.analyses.continuation.analysis import continuation, with_overlay
from beamsim.cli.tables import table_rows
from beamsim.errors import ScenarioError
from beamsim.scenario import load_scenario
from beamsim.store.results import load
from tests.helpers.branches import events_of, peaks_of
from tests.helpers.commands import invoke

CHAIN, BEAM = config_path("chain_two_dof"), config_path("one_sided_65hz")


def sweep(*arguments):
    return invoke("sweep", *arguments)


@pytest.fixture(scope="module")
def results():
    """The results of the configs by name, each computed when it is first asked for."""

    class Computed(dict):
        def __missing__(self, name):
            return self.setdefault(name, continuation(load_scenario(config_path(name))))

    return Computed()


def test_level_with_backlash_is_linear_until_it_touches(results):
    """Touching at level = gap over the linear response per unit of level; folds enclose three motions."""
    (branch,) = results["continuation_level"].branches
    events = events_of(results["continuation_level"])
    grazing = next(e for e in events if e.kind == "grazing")
    before = branch["parameter"].values < grazing.parameter * (1 - 1e-9)
    linear = before & (peaks_of(branch, "tip", "force") == 0)
    ratio = peaks_of(branch, "tip")[linear] / branch["parameter"].values[linear]
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-6)
    assert grazing.parameter * ratio[0] == pytest.approx(0.4e-3, rel=1e-5)
    folds = [e.parameter for e in events if e.kind == "fold"]
    assert len(folds) == 2
    assert branch["stable"].values.sum() < branch["stable"].values.size


def test_folds_are_followed_and_the_first_is_where_the_stop_is_just_touched(results):
    result = results["continuation_folds"]
    first, second = sorted(result.special_curves, key=lambda c: c["start_hz"].item())
    assert (first["touching"].item(), second["touching"].item()) == ("stop", "")
    for curve in (first, second):
        np.testing.assert_allclose(np.sort(curve["parameter"].values)[[0, -1]], [0.03, 0.3], rtol=1e-9)
        assert curve["residual"].values.max() < 1e-8
    K = np.array([[1.0, -1.0], [-1.0, 2.0]])
    for hz, level in zip(first["frequency_hz"].values, first["parameter"].values, strict=True):
        w = 2 * np.pi * hz
        q = np.linalg.solve(K - w**2 * np.eye(2) + 0.03j * w * K, [0.0, 1.0])
        assert abs(q[0]) * level == pytest.approx(1.0, rel=1e-8)
    assert abs(np.abs(q[0]) * 1.01 * level - 1.0) > 1e-3  # the comparison can fail
    # a curve at another level turns at the second
    alone = ["sweep.longest_period=1", "sweep.seek_at=0"]
    other = continuation(load_scenario(CHAIN, ["excitation.level=0.2 N", *alone]))
    folds = [e.frequency_hz for e in events_of(other) if e.kind == "fold"]
    parameter, frequency = second["parameter"].values, second["frequency_hz"].values
    order = np.argsort(parameter)
    from scipy.interpolate import CubicSpline

    at = CubicSpline(parameter[order], frequency[order])(0.2)
    assert min(abs(f - at) for f in folds) < 1e-5 * at


def test_curves_of_folds_name_the_branch_of_their_own_level():
    """They were numbered within their level."""
    folds = "{kind: gap, snubber: stop, from: 0.99, to: 1.01}"
    path = f"from: 0.8 rad/s, to: 0.64 rad/s, levels: [0.1 N, 0.2 N], longest_period: 1, follow_points_in: {folds}"
    result = continuation(load_scenario(CHAIN, [f"sweep={{kind: continuation, {path}, seek_at: 0}}"]))
    assert len(result.special_curves) == 4
    for curve in result.special_curves:
        branch = curve["branch"].item()
        assert result["branches"]["level"].values[branch] == curve["level"].item()
        events = [e.frequency_hz for e in events_of(result, branch) if e.kind == "fold"]
        assert np.min(np.abs(np.array(events) / curve["start_hz"].item() - 1)) < 1e-9


def test_reported_peaks_are_the_largest_of_all_motions(results):
    """A motion of period 2 goes further than those of period 1: 1.961 m against 1.884 m at the first mass."""
    result = results["continuation_folds"]
    for peak in result.summary["peaks"]:
        periods = {b["period_multiple"].item() for b in result.branches}
        largest = {
            period: max(
                peaks_of(b, peak["probe"]).max() for b in result.branches if b["period_multiple"].item() == period
            )
            for period in periods
        }
        assert largest[2] > largest[1]
        assert peak["value_m"] == largest[2]
        assert peak["period_multiple"] == 2
    row = ["period", "multiple", *["2"] * len(result.summary["peaks"])]
    assert row in [text.split() for _, text in table_rows(result)]


def test_the_sweep_rides_on_the_stable_motions(results):
    result = results["continuation_overlay"]
    assert list(result.overlay) == ["up_0", "down_0"]
    (main,) = [b for b in result.branches if b["period_multiple"].item() == 1]
    tops = {name: o.peaks["displacement", "tip"][1].max() for name, o in result.overlay.items()}
    for top in tops.values():
        assert top == pytest.approx(peaks_of(main, "tip").max(), rel=0.02)
    up = result.overlay["up_0"]
    assert up.level == main["level"].item()
    assert up.frequency_hz.min() > 75.0
    assert up.frequency_hz.max() < 95.0


def test_too_few_harmonics_are_not_trusted(tmp_path):
    few = "sweep.method={kind: harmonic_balance, harmonics: 3}"
    done = sweep(CHAIN, "-o", tmp_path, "--set", few, "--no-plots")
    assert done.exit_code == 3
    assert "raise sweep.method.harmonics above " in done.stderr
    stored = load(tmp_path / "chain_two_dof.h5")
    assert stored.summary["neglected_harmonics"] == stored.branches[0]["neglected_harmonics"].values.max() > 0.01
    assert not stored.complete
    many = continuation(load_scenario(CHAIN, ["sweep.method={kind: harmonic_balance, harmonics: 21}"]))
    assert many.complete
    kinds = [e.kind for e in events_of(many, 0)]
    assert kinds.count("fold") == 2
    assert kinds.count("period_doubling") == 2


def test_a_stored_sweep_is_laid_over_a_curve(tmp_path):
    rate = "sweep={kind: swept_sine, from: 78 Hz, to: 84 Hz, rate: 20 oct/min, direction: both}"
    stepped = "sweep={kind: stepped, from: 78 Hz, to: 84 Hz, points: 4}"
    for name, how in (("swept", rate), ("stepped", stepped)):
        assert sweep(BEAM, "-o", tmp_path / f"{name}.h5", "--set", how, "--no-plots", "-q").exit_code == 0
    curve = "sweep={kind: continuation, from: 78 Hz, to: 84 Hz}"
    laid = ["--overlay", tmp_path / "swept.h5", "--overlay", tmp_path / "stepped.h5"]
    done = sweep(BEAM, "-o", tmp_path / "curve.h5", "--set", curve, *laid, "-v")
    assert done.exit_code == 0, done.output
    rows = [line.split() for line in done.stdout.splitlines()]
    assert ["level", "2", "g", "2", "g", "2", "g"] in rows
    assert ["source", "swept.h5", "swept.h5", "stepped.h5"] in rows
    assert ["stepped", "no", "no", "yes"] in rows
    stored = load(tmp_path / "curve.h5")
    assert list(stored.overlay) == ["up_0", "down_0", "up_1"]
    assert [o.source for o in stored.overlay.values()] == ["swept.h5", "swept.h5", "stepped.h5"]
    steady = stored.overlay["up_1"]
    main = stored.branches[0]
    expected = np.interp(steady.frequency_hz, main["frequency_hz"].values, peaks_of(main, "tip"))
    np.testing.assert_allclose(steady.peaks["displacement", "tip"][1], expected, rtol=2e-3)
    assert (tmp_path / "curve_response_tip.png").is_file()
    # nothing in common
    other = continuation(load_scenario(CHAIN, ["sweep.longest_period=1", "sweep.to=0.78 rad/s"]))
    with pytest.raises(ScenarioError, match="a probe of the same name"):
        with_overlay(other, load(tmp_path / "swept.h5"), "swept.h5")
    assert sweep(BEAM, "--set", rate, *laid[:2]).exit_code == 2
    assert sweep(CHAIN, "--overlay", tmp_path / "none.h5").exit_code == 2
    assert sweep(CHAIN, "--resume").exit_code == 2


def test_limits_are_checked(tmp_path):
    case = [BEAM, "--set", "sweep={kind: continuation, from: 80 Hz, to: 80.5 Hz, seek_at: 0}"]
    run = [*case, "-o", tmp_path, "--no-plots", "-q", "--check", "--set"]
    assert sweep(*run, "limits={peak_force: 10 kN, gap: 1 m, bending_stress: 10 GPa}").exit_code == 0
    done = sweep(*run, "limits={peak_force: 10 kN, gap: 1 um, bending_stress: 1 MPa, peak_acceleration: 1 g}")
    assert done.exit_code == 4
    for name in ("gap", "bending stress", "peak acceleration"):
        assert name in done.stderr
    assert "peak force" not in done.stderr
    assert sweep(*case, "--check").exit_code == 2


def test_a_study_of_continuations(tmp_path):
    case = tmp_path / "study.yaml"
    case.write_text(
        f"extends: {CHAIN}\nlimits: {{peak_force: 1 N}}\n"
        "sweep: {longest_period: 1}\n"
        "vary: {kind: grid, parameters: [{path: chain.snubbers.stop.gap, values: [1, 2]}]}\n"
    )
    done = sweep(case, "-o", tmp_path, "--workers", 1, "--no-plots", "--json")
    assert done.exit_code == 0, done.output
    from beamsim.store.results import load

    stored = load(tmp_path / "study.h5")
    peak = stored.responses["stable_0/probes/first/peak_displacement"].values
    single = continuation(load_scenario(CHAIN, ["sweep.longest_period=1"]))
    assert peak[0] == max(float(peaks_of(b, "first")[b["stable"].values].max()) for b in single.branches)
    assert peak[1] > peak[0]
    assert set(stored.limits) == {"peak_force"}
