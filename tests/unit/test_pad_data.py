"""Maxwell branches from dynamic tests and relaxation curves of a pad."""

import numpy as np
import pytest
import yaml
from scipy.integrate import solve_ivp
from typer.testing import CliRunner

import beamsim
from beamsim.analyses.pad.analysis import KnownPad, pad
from beamsim.cli.app import app
from beamsim.contacts.branches import driven_force, dynamic_stiffness, fit_dynamic, fit_relaxation, relaxation
from beamsim.contacts.pads import ForceCurve, MaxwellBranch, recovering_law
from beamsim.errors import ScenarioError
from beamsim.scenario import load_scenario
from beamsim.system.force_tables import curves_of
from tests.helpers.tables import variables

BRANCHES = (MaxwellBranch(40e3, 1e-3), MaxwellBranch(25e3, 2e-2), MaxwellBranch(10e3, 0.5))
STIFFNESS = 60e3
OMEGA = 2 * np.pi * np.geomspace(0.1, 2e3, 30)


def measured(omega=OMEGA, branches=BRANCHES):
    k = dynamic_stiffness(STIFFNESS, branches, omega)
    return k.real, k.imag / k.real


def agree(fit, branches=BRANCHES, rel=1e-5):
    assert fit.stiffness == pytest.approx(STIFFNESS, rel=rel)
    assert [b.stiffness for b in fit.branches] == pytest.approx([b.stiffness for b in branches], rel=rel)
    assert [b.relaxation_time for b in fit.branches] == pytest.approx([b.relaxation_time for b in branches], rel=rel)


def test_the_formula_is_that_of_the_law():
    line = ForceCurve(np.array([0.0, 1.0]), np.array([0.0, STIFFNESS]))
    law = recovering_law(line, 0.0, BRANCHES)
    expected = law.dynamic_stiffness(law.resting_phase(1.0), OMEGA)
    np.testing.assert_allclose(dynamic_stiffness(STIFFNESS, BRANCHES, OMEGA), expected, rtol=1e-12)


def test_branches_are_found_again():
    agree(fit_dynamic(OMEGA, *measured()))
    agree(fit_dynamic(OMEGA, *measured(), branches=3))
    time = np.geomspace(1e-4, 5.0, 40)
    agree(fit_relaxation(time, relaxation(STIFFNESS, BRANCHES, time)))
    agree(fit_relaxation(time, relaxation(STIFFNESS, BRANCHES[1:2], time)), BRANCHES[1:2])
    assert fit_dynamic(OMEGA, *measured()).misfit < 1e-6


@pytest.mark.parametrize("ramp", [1e-6, 0.05])
def test_relaxation_after_a_ramp(ramp):
    """Against the branches' equation p' = (x - p) / tau, integrated; a ramp that is left out shows in the branches."""
    time = np.geomspace(2e-3, 5.0, 30)
    force = relaxation(STIFFNESS, BRANCHES, time, ramp)

    def rates(t, p):
        return (min(t / ramp, 1.0) - p) / np.array([b.relaxation_time for b in BRANCHES])

    ends = [t for t in (ramp,) if t > time[0]]
    solved = solve_ivp(rates, (0.0, time[-1]), np.zeros(3), "Radau", rtol=1e-9, atol=1e-12, t_eval=time,
                       max_step=ramp if ends else np.inf)  # fmt: skip
    springs = np.array([b.stiffness for b in BRANCHES])
    moved = np.minimum(time / ramp, 1.0)
    np.testing.assert_allclose(force, STIFFNESS * moved + springs @ (moved - solved.y), rtol=1e-5)
    agree(fit_relaxation(time, force, ramp=ramp), rel=1e-3)
    if ramp > time[0]:
        sudden = fit_relaxation(time[time > ramp], force[time > ramp])
        assert sudden.branches[0].relaxation_time > 10 * BRANCHES[0].relaxation_time


def test_noise_is_not_fitted_by_more_branches():
    noise = np.random.default_rng(3).normal(size=(2, OMEGA.size))
    storage, loss = measured()
    fit = fit_dynamic(OMEGA, storage * (1 + 0.01 * noise[0]), loss * (1 + 0.02 * noise[1]))
    assert len(fit.branches) <= 4
    assert 0.005 < fit.misfit < 0.02
    k = dynamic_stiffness(fit.stiffness, fit.branches, OMEGA)
    np.testing.assert_allclose(np.abs(k), np.abs(dynamic_stiffness(STIFFNESS, BRANCHES, OMEGA)), rtol=0.02)


# -- scenarios -------------------------------------------------------------------------------------------------------

CASE = {
    "chain": {"masses": [1.0], "springs": [50.0], "damping": {"kind": "modal", "ratio": 0.02}},
    "snubbers": [{"name": "pad", "at": {"mass": 1}, "side": "above", "stiffness": "1 kN/m", "gap": "1 mm"}],
}


def case(**pad):
    return {**CASE, "identify_stiffness": {"snubber": "pad", "pad": pad}}


def rows(*columns):
    return [[float(x) for x in row] for row in np.column_stack(columns)]


def test_a_dynamic_test_in_a_scenario():
    storage, loss = measured()
    result = beamsim.identify_stiffness(load_scenario(case(data={"dynamic": rows(OMEGA / (2 * np.pi), storage, loss)})))
    fit = variables(result["pad"])
    assert fit.stiffness == pytest.approx(STIFFNESS, rel=1e-5)
    np.testing.assert_allclose(fit.relaxation_time, [b.relaxation_time for b in BRANCHES], rtol=1e-5)
    np.testing.assert_allclose(fit.fitted_loss_factor, loss, rtol=1e-5)
    assert "stiffness" not in result.datasets
    stop = {**CASE["snubbers"][0], **yaml.safe_load(result.summary["pad_yaml"])}
    built = load_scenario({**CASE, "snubbers": [stop]})  # what is printed is a snubber
    assert [b.stiffness for b in built.all_snubbers[0].maxwell] == pytest.approx([40e3, 25e3, 10e3], rel=1e-4)


@pytest.mark.parametrize("unit", ["stiffness", "modulus"])
def test_a_relaxation_curve_from_a_file(tmp_path, unit):
    time = np.geomspace(1e-3, 5.0, 30)
    k = relaxation(STIFFNESS, BRANCHES[1:], time, 0.03)
    height, area = 0.02, 250e-6
    heading, values = ("stiffness (kN/m)", k / 1e3) if unit == "stiffness" else ("E (MPa)", k * height / area / 1e6)
    lines = [f"time (ms),{heading}", *(f"{1e3 * t:.10g},{x:.12g}" for t, x in zip(time, values, strict=True))]
    (tmp_path / "pad.csv").write_text("\n".join(lines))
    text = yaml.safe_dump(case(height=height, area=area, data={"file": "pad.csv", "ramp": "30 ms"}))
    (tmp_path / "case.yaml").write_text(text)
    result = beamsim.identify_stiffness(load_scenario(tmp_path / "case.yaml"))
    pad = variables(result["pad"])
    assert (pad.kind, pad.ramp, result["pad"]["curve_at"].unit) == ("relaxation", 0.03, "s")
    np.testing.assert_allclose(pad.relaxation_time, [2e-2, 0.5], rtol=1e-4)
    assert pad.stiffness == pytest.approx(STIFFNESS, rel=1e-4)


def spread(samples):
    """By number of the pad how often the interval of 95 % holds the truth, of noisy tests with these seeds."""
    truth = np.array([STIFFNESS, 40e3, 25e3, 10e3, 1e-3, 2e-2, 0.5])
    held, storage, loss = np.zeros(truth.size), *measured()
    for seed in samples:
        generator = np.random.default_rng(seed)
        noisy = storage * (1.0 + 1j * loss) + np.abs(storage * (1.0 + 1j * loss)) * 0.01 * (
            generator.standard_normal(OMEGA.size) + 1j * generator.standard_normal(OMEGA.size)
        )
        rows = np.column_stack([OMEGA / (2 * np.pi), noisy.real, noisy.imag / noisy.real]).tolist()
        fit = variables(beamsim.identify_stiffness(load_scenario(case(data={"dynamic": rows, "branches": 3})))["pad"])
        ends = np.vstack([fit.stiffness_interval, fit.branch_interval, fit.time_interval])
        held += (ends[:, 0] <= truth) & (truth <= ends[:, 1])
    return held


def test_intervals_hold_the_truth_as_often_as_they_say():
    """Of 40 tests with 1 % of noise 38 are expected; fewer than 33 come once in two thousand times a number."""
    held = spread(range(40))
    assert held.min() >= 33
    assert held.sum() < 7 * 40


def test_intervals_are_unknown_where_nothing_tells_the_scatter():
    """As many measured numbers as branches and spring have."""
    rows = [[1.0, 100.0, 0.1], [10.0, 120.0, 0.1]]
    result = beamsim.identify_stiffness(load_scenario(case(data={"dynamic": rows, "branches": 1})))
    pad = variables(result["pad"])
    assert pad.branch_interval.shape == (1, 2)
    assert np.isfinite(pad.stiffness_interval).all()  # four numbers for three
    rows = [[1e-3, 100.0], [1e-2, 90.0], [0.1, 80.0]]
    result = beamsim.identify_stiffness(load_scenario(case(data={"relaxation": rows, "branches": 1})))
    pad = variables(result["pad"])
    assert np.isnan(pad.stiffness_interval).all()
    assert np.isnan(pad.time_interval).all()


OFFSETS = [
    (0.3, 0.0, "its force begins at 0.3 mm"), (-0.2, 0.0, "its force is 12.8 N at zero deflection"),
    (0.0, 8.0, "its force is 8 N at zero deflection"), (0.0, -8.0, "its force is -8 N at zero deflection"),
    (0.0, 0.0, ""),
]  # fmt: skip


@pytest.mark.parametrize(("shift", "preload", "says"), OFFSETS)
def test_a_curve_with_an_offset_is_refused(tmp_path, shift, preload, says):
    """A pad of 64.1 kN/m; a curve through zero would have 38 to 96 kN/m: by the pad's command, of a stop, in a fit."""
    file = tmp_path / "curve.csv"
    points = [(x + shift, 64.1 * x + preload) for x in np.linspace(0, 1, 41).tolist()]
    file.write_text("deflection (mm),force (N)\n" + "".join(f"{x:.6g},{force:.6g}\n" for x, force in points))
    written = [[f"{x:.6g} mm", f"{force:.6g} N"] for x, force in points]
    stops = [
        with_table({"file": str(file), "fit": {"segments": 3}}),
        with_table({"points": written, "fit": {"segments": 3}}),
    ]
    if not says:
        assert pad(KnownPad(curve=file)).stiffness == pytest.approx(64100.0)
        assert [curves_of(stop)[0].stiffness for stop in stops] == pytest.approx([64100.0, 64100.0])
        return
    remedy = "subtract the reading at the beginning of contact from the column .* a real free travel is the gap"
    refused = f"has an offset: {says}; {remedy}"
    with pytest.raises(ScenarioError, match=f"--curve = .*curve.csv {refused}"):
        pad(KnownPad(curve=file))
    for stop in stops:
        for command in (beamsim.run, beamsim.identify_stiffness):
            with pytest.raises(ScenarioError, match=f"force_deflection.* {refused}"):
                command(stop)


def with_table(table):
    """A beam that rests on a stop with a table, and a frequency to identify its slope from."""
    beam = {"length": 0.27, "width": 0.05, "thickness": 0.005, "youngs_modulus": 69e9, "density": 2700.0}
    stop = {"name": "tip", "position": 0.27, "side": "below", "force_deflection": table, "preload": "1 N"}
    case = {
        "beam": beam, "snubbers": [stop], "excitation": {"kind": "none"}, "run": {"duration": 0.01},
        "identify_stiffness": {"snubber": "tip", "measured_with": [190.0]},
    }  # fmt: skip
    return load_scenario(case)


def test_free_travel_of_a_curve_is_named(tmp_path):
    """Its sensor reads zero force up to 0.3 mm: a gap, or where the sensor's zero is."""
    file = tmp_path / "curve.csv"
    rows = [f"{x:.6g},{max(64.1 * (x - 0.3), 0.0):.6g}\n" for x in np.linspace(0, 1.3, 53)]
    file.write_text("deflection (mm),force (N)\n" + "".join(rows))
    assert pad(KnownPad(curve=file)).free_travel == pytest.approx(3e-4, rel=1e-6)
    stop = with_table({"file": str(file), "fit": {"segments": 3}})
    assert curves_of(stop)[0].stiffness == pytest.approx(64100.0)
    (said,) = (each for each in beamsim.run(stop).warnings if "free travel" in each)
    assert "the force begins at 0.3 mm, and the curve has that free travel; if it is not real, subtract" in said


def curve_of(folder, x, force, *, segments=1):
    """The pad of a curve in mm and N."""
    file = folder / "curve.csv"
    file.write_text(
        "deflection (mm),force (N)\n" + "".join(f"{a:.9g},{b:.9g}\n" for a, b in zip(x, force, strict=True))
    )
    return pad(KnownPad(curve=file, segments=segments))


@pytest.mark.parametrize(
    ("signs", "remedy"), [((-1, -1), "both columns"), ((1, -1), "the forces"), ((-1, 1), "the deflections")]
)
def test_a_curve_with_another_sign_says_which(tmp_path, signs, remedy):
    """A machine that counts tension positive; the remedy gives the pad's 64.1 kN/m."""
    x = np.linspace(0.0, 1.0, 41)
    with pytest.raises(ScenarioError, match=f"no point with a positive deflection .*; multiply {remedy} by -1"):
        curve_of(tmp_path, signs[0] * x, signs[1] * 64.1 * x)
    assert curve_of(tmp_path, x, 64.1 * x).stiffness == pytest.approx(64100.0)


def test_a_curve_up_to_the_end_of_a_sensors_range_is_remarked_on(tmp_path):
    """64.1 kN/m, of which 40 N were recorded at most: 51.8 kN/m were found without a word; as advised, 64.1."""
    x = np.linspace(0.0, 1.0, 41)
    force = np.minimum(64.1 * x, 40.0)
    for segments in (1, 3):
        remark = next(each for each in curve_of(tmp_path, x, force, segments=segments).remarks if "sensor" in each)
        assert remark.startswith("the force stays at exactly 40 N from 0.625 mm on: ")
        assert remark.endswith("leave out the rows from there on")
    left = x < 0.625
    found = curve_of(tmp_path, x[left], force[left])
    assert (found.stiffness, found.remarks) == (pytest.approx(64100.0), ())


def test_a_small_offset_and_too_few_segments_are_remarked_on(tmp_path):
    """1.5 N at zero made 66.3 of 64.1 kN/m, and one segment through 0.3 mm of free travel 36.4."""
    x = np.linspace(0.0, 1.0, 41)
    (remark,) = curve_of(tmp_path, x, 64.1 * x + 1.5).remarks
    assert remark.startswith("the force is 1.5 N at zero deflection, 2.3 % of the largest one")
    late = 64.1 * np.maximum(x - 0.3, 0.0)
    found = curve_of(tmp_path, x, late)
    assert found.misfit == pytest.approx(0.13 * late.max(), rel=0.05)
    assert "misses the points by 13 % of the largest force" in found.remarks[0]
    assert found.remarks[0].endswith("give more segments")
    found = curve_of(tmp_path, x, late, segments=3)
    assert found.misfit < 1e-6
    assert found.remarks[0].startswith("the force begins at 0.3 mm")


def test_branches_at_the_limit_of_what_was_measured_are_not_reliable(tmp_path):
    """A pad that relaxes within 0.1 ms, tested up to 100 Hz, and one that relaxes to nothing."""
    fast, omega = (MaxwellBranch(20e3, 1e-4),), 2 * np.pi * np.geomspace(1.0, 100.0, 20)
    fit = fit_dynamic(omega, *measured(omega, fast))
    assert fit.outcome.text == (
        "not reliable: relaxation times at the limit of what was measured on the pad: 0.000159 s; measure longer, "
        "slower or faster, or allow fewer branches"
    )
    time = np.geomspace(1e-3, 10.0, 30)
    assert "no stiffness left" in fit_relaxation(time, relaxation(0.0, BRANCHES, time)).outcome.text
    time = np.geomspace(1e-4, 5.0, 40)
    assert fit_relaxation(time, relaxation(STIFFNESS, BRANCHES, time)).outcome.complete


def test_a_loop_that_does_not_tell_the_branches_is_not_reliable(tmp_path):
    """Loops of 1 Hz over 3 s of a pad that relaxes within 5 s."""
    time = np.linspace(0.0, 3.0, 600)
    deflection = 2e-4 * (1.0 - np.cos(2 * np.pi * time))
    curve = ForceCurve(np.array([0.0, 4e-4]), np.array([0.0, 56.0]))
    force = driven_force(curve, (MaxwellBranch(80e3, 5.0),), time, deflection)
    file = tmp_path / "loop.csv"
    rows = zip(time, 1e3 * deflection, force, strict=True)
    file.write_text("time (s),way (mm),force (N)\n" + "".join(f"{t:.6g},{x:.6g},{f:.6g}\n" for t, x, f in rows))
    ended = CliRunner().invoke(app, ["pad", "--curve", str(file), "--segments", "1"])
    assert ended.exit_code == 3
    assert ended.stdout.splitlines()[0] == "# NOT RELIABLE"
    assert "not reliable: relaxation times at the limit of what was measured on the pad: 3 s" in ended.stderr
