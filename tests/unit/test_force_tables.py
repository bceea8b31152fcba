"""Force-deflection tables of stops: their law, files, fits, and what is refused."""

import itertools
import json

import numpy as np
import pytest

import beamsim
from beamsim.analyses.continuation.analysis import continuation
from beamsim.analyses.identify.vibrations import steady_vibration
from beamsim.analyses.nnm.analysis import nnm
from beamsim.analyses.sweep.analysis import sweep
from beamsim.contacts.branches import fit_loop
from beamsim.contacts.pads import ForceCurve, _slopes, fit_curve, loop_width, relaxed_part
from beamsim.errors import ScenarioError
from beamsim.measurements.signal import MeasuredSignal
from beamsim.scenario import load_scenario
from beamsim.system.build import build_system
from beamsim.system.force_tables import force_tables
from tests.helpers.commands import invoke
from tests.helpers.tables import estimates, variables

POINTS = [[0, 0], [1e-4, 8], [2e-4, 22], [4e-4, 70]]
CASE = {
    "beam": {
        "length": 0.27, "width": 0.05, "thickness": 0.005, "youngs_modulus": 69e9, "density": 2700, "elements": 8,
        "supports": {"left": "clamped", "right": "free"}, "damping": {"kind": "modal", "ratio": 0.01},
    },
    "excitation": {"kind": "harmonic", "applied_to": "base", "level": "2 g", "frequency": 65},
    "probes": [{"name": "tip", "position": 0.27}],
    "run": {"duration": 0.2, "sample_rate": 5000, "convergence": "off"},
}  # fmt: skip


def case(*stops, **sections):
    stops = [{"position": 0.27, "side": "below", **stop} for stop in stops]
    return load_scenario({**CASE, "snubbers": stops, **sections})


@pytest.mark.parametrize("gap", [-5e-5, 0.0, 3e-5])
def test_a_table_is_a_stack_of_one_sided_springs(gap):
    slopes = np.diff([f for _, f in POINTS]) / np.diff([x for x, _ in POINTS])
    added = np.diff(slopes, prepend=0.0)
    stack = [
        {"name": f"s{i}", "stiffness": k, "gap": gap + POINTS[i][0]} for i, k in enumerate(added.tolist())
    ]  # fmt: skip
    one = beamsim.run(case({"name": "pad", "force_deflection": POINTS, "gap": gap}))
    many = beamsim.run(case(*stack))
    scale = np.abs(many["histories"]["displacement"].sel(probe="tip").values).max()
    apart = (
        one["histories"]["displacement"].sel(probe="tip").values
        - many["histories"]["displacement"].sel(probe="tip").values
    )
    assert np.abs(apart).max() <= 1e-12 * scale
    together = many["histories"]["snubber_force"].values.sum(axis=0)
    np.testing.assert_allclose(
        one["histories"]["snubber_force"].sel(snubber="pad").values, together, atol=1e-12 * together.max() + 1e-11
    )
    assert one.summary["contacts"]["pad"] == many.summary["contacts"]["s0"] >= 5
    assert one["events"]["time"].values.size == np.sum(many["events"]["snubber"].values == 0)
    assert one.summary["events"] < many.summary["events"]
    assert one["histories"]["snubber_blocked_force"].sel(snubber="pad").item() == pytest.approx(
        np.interp(-gap, *np.array(POINTS).T) if gap < 0 else 0
    )
    assert one.summary["energy_error"] < 1e-10


def test_one_segment_is_a_stiffness():
    table = beamsim.run(case({"name": "pad", "force_deflection": [[0, 0], [1e-3, 50]]}))
    linear = beamsim.run(case({"name": "pad", "stiffness": 5e4}))
    np.testing.assert_array_equal(
        table["histories"]["displacement"].sel(probe="tip").values,
        linear["histories"]["displacement"].sel(probe="tip").values,
    )


def beyond(result):
    return [text for text in result.warnings if "its table ends at" in text]


def test_a_stop_pressed_further_than_its_table_goes():
    short = {"name": "pad", "force_deflection": POINTS[:2]}
    run = beamsim.run(case(short))
    (warning,) = beyond(run)
    force = run.summary["peak_force_n"]["pad"]
    assert f"compressed by up to {force / 80:.4g} mm, its table ends at 0.1 mm, 8 N" in warning  # 8 N over 0.1 mm
    assert not beyond(beamsim.run(case({"name": "pad", "force_deflection": POINTS})))
    chain = {
        "chain": {"masses": [1.0], "springs": [1e4], "damping": {"kind": "modal", "ratio": 0.05}},
        "snubbers": [
            {"name": "pad", "mass": 1, "side": "above", "force_deflection": [[0, 0], [1e-3, 20]], "gap": 1e-3}
        ],
        "excitation": {"kind": "harmonic", "applied_to": {"mass": 1}, "level": "5 N", "frequency": "16 Hz"},
        "run": {"duration": 0.5, "sample_rate": 1000, "convergence": "off"},
    }  # fmt: skip
    swept = {"kind": "swept_sine", "from": 15, "to": 18, "rate": "2 Hz/s"}
    levels, scales = (
        {"kind": "grid", "parameters": [{"path": path, "values": values}]}
        for path, values in (("excitation.level", [1.0, 5.0]), ("snubbers.pad.force_deflection.scale", [1.0, 2.0]))
    )
    points = [{**chain["snubbers"][0], "force_deflection": {"points": [[0, 0], [1e-3, 20]]}}]
    results = [
        sweep(load_scenario(chain | {"sweep": swept})),
        continuation(load_scenario(chain | {"sweep": {"kind": "continuation", "from": 15, "to": 18}})),
        beamsim.design_study(load_scenario(chain | {"vary": levels})),
        nnm(load_scenario(chain | {"nnm": {"mode": 1, "energy": 0.06}, "excitation": {"kind": "none"}})),
    ]
    assert [len([w for w in beyond(result) if "its table ends at 1 mm, 20 N" in w]) for result in results] == [1] * 4
    (warning,) = beyond(beamsim.design_study(load_scenario(chain | {"vary": scales, "snubbers": points})))
    assert warning.startswith("case 1: ")  # with the table of its scale; the other table is twice as stiff


def test_a_preload_on_a_table():
    run = beamsim.run(
        case({"name": "pad", "force_deflection": POINTS, "preload": 0.4}, excitation={"kind": "none"})
    )  # fmt: skip
    assert run["histories"]["snubber_preload"].sel(snubber="pad").item() == pytest.approx(0.4, rel=1e-10)
    np.testing.assert_allclose(run["histories"]["snubber_force"].sel(snubber="pad").values, 0.4, rtol=1e-8)


def build_curve():
    return ForceCurve(*np.array(POINTS, dtype=float).T)


def test_the_fit_is_the_best_one():
    """Against every choice of knots on a grid; slopes by another solver."""
    rng = np.random.default_rng(3)
    x = np.sort(rng.uniform(0.0, 1.0, 150))
    y = 40 * x**2 + 30 * x**5 + rng.normal(0, 0.5, x.size)
    for segments in (2, 3):
        curve, misfit = fit_curve(x, y, segments)
        grid = np.linspace(0.0, 1.0, 50)[1:-1]
        best = min(
            np.sqrt(_slopes(x, y, np.array([0.0, *knots]))[1] / x.size)
            for knots in itertools.combinations(grid, segments - 1)
        )
        assert misfit <= best * (1 + 1e-6)
        assert misfit > 0.9 * best
        assert np.all(curve.slopes >= 0)
        assert curve.slopes.size == segments
        assert misfit == pytest.approx(np.sqrt(np.mean((curve.at(x) - y) ** 2)), rel=1e-9)


def test_a_table_from_a_file(tmp_path):
    (tmp_path / "pad.csv").write_text("deflection (mm),force (kN)\n0,0\n0.1,0.008\n0.2,0.022\n0.4,0.07\n")
    given = case({"name": "pad", "force_deflection": POINTS})
    for form in (str(tmp_path / "pad.csv"), {"file": str(tmp_path / "pad.csv")}):
        read = build_system(case({"name": "pad", "force_deflection": form}))
        mine, other = read.dynamics.contacts.laws[0], build_system(given).dynamics.contacts.laws[0]
        np.testing.assert_allclose(mine.arrays.force, other.arrays.force, rtol=1e-12)
    (tmp_path / "turned.csv").write_text("force [N];way [mm]\n0;0\n8;0,1\n")
    law = build_system(case({"name": "pad", "force_deflection": str(tmp_path / "turned.csv")})).dynamics.contacts.laws[
        0
    ]
    assert law.stiffness == pytest.approx(8e4)


def loop(rate=20.0, noise=0.1):
    """A cycle of a pad with a branch (2e4 N/m, 8 ms), starting relaxed."""
    t = np.linspace(0.0, 1.0 / rate, 200)
    x = 2e-4 * (1 - np.cos(2 * np.pi * rate * t))
    force = build_curve().at(x) + 2e4 * (x - relaxed_part(t, x, 8e-3))
    return t, x, force + np.random.default_rng(1).normal(0, noise, t.size)


def written(path, header, *columns):
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="")


def test_a_loop_is_remarked_on_and_its_branch_is_offered(tmp_path):
    t, x, force = loop()
    assert loop_width(x, force) > 0.02
    fit = fit_loop(t, x, force, build_curve().deflection[:-1])
    (branch,) = fit.branches
    assert branch.stiffness == pytest.approx(2e4, rel=0.05)
    assert branch.relaxation_time == pytest.approx(8e-3, rel=0.1)
    assert fit.springs == pytest.approx(build_curve().slopes, rel=0.05)
    assert fit.misfit < 0.12 / force.max()
    written(tmp_path / "loop.csv", "time (s),x (m),N (N)", t, x, force)
    table = {"file": str(tmp_path / "loop.csv"), "fit": {"segments": 5}}
    (warning,) = build_system(case({"name": "pad", "force_deflection": table})).warnings
    assert "snubbers[0].force_deflection: loading and unloading differ" in warning
    assert warning.endswith(
        f"`beamsim pad --curve {tmp_path}/loop.csv --segments 5` prints the softer curve with the Maxwell branches "
        "that lose that work"
    )
    written(tmp_path / "loop.csv", "x (m),N (N)", x, force)
    (warning,) = build_system(case({"name": "pad", "force_deflection": table})).warnings
    assert "give a file with increasing times" in warning


def test_a_curve_without_a_loop_is_not_remarked_on():
    x = np.concatenate([np.linspace(0, 4e-4, 100), np.linspace(4e-4, 0, 100)])
    force = build_curve().at(x) + np.random.default_rng(2).normal(0, 0.5, x.size)
    assert loop_width(x, force) < 0.01
    points = np.column_stack([x, force]).tolist()
    system = build_system(case({"name": "pad", "force_deflection": {"points": points, "fit": {"segments": 3}}}))
    assert system.warnings == ()
    assert system.snubbers[0].table_misfit == pytest.approx(0.5, rel=0.2)


def pressed(preload, frequencies, **others):
    """Two masses, the first pressed against a pad whose table has slopes of 300 and 600 N/m, which meet at 0.6 N."""
    pad = {"name": "pad", "mass": 1, "side": "below", "force_deflection": [[0, 0], [2e-3, 0.6], [1e-2, 5.4]], **others}
    pad |= {} if preload is None else {"preload": preload}
    chain = {"masses": [1.0, 1.0], "springs": [400.0, 400.0], "snubbers": [pad]}
    section = {"snubber": "pad", "measured_with": frequencies, "fit_to": [1, 2]}
    return load_scenario({"chain": chain, "identify_stiffness": section})


@pytest.mark.parametrize(("preload", "segment", "slope"), [(0.5, 1, 300.0), (2.0, 2, 600.0)])
def test_natural_frequencies_give_the_slope_where_a_table_rests(preload, segment, slope):
    """Of a structure whose spring there is 1.05 times as stiff as the table; eigenvalues of a matrix by hand."""
    matrix = [[800.0 + 1.05 * slope, -400.0], [-400.0, 400.0]]
    frequencies = (np.sqrt(np.linalg.eigvalsh(matrix)) / (2 * np.pi)).tolist()
    found = beamsim.identify_stiffness(pressed(preload, frequencies))
    at = variables(found["stiffness"])
    assert at.stiffness == pytest.approx(1.05 * slope, rel=1e-9)
    assert (at.table_segment, at.table_segments, at.table_at_a_bend) == (segment, 2, False)
    numbers = [at.table_slope, at.table_factor, at.table_force, at.table_deflection]
    deflection = 2e-3 + (preload - 0.6) / slope
    np.testing.assert_allclose(numbers, [slope, 1.05, preload, deflection], rtol=1e-9)
    assert not found.warnings


def test_slopes_of_another_table_are_remarked_on():
    frequencies = (np.sqrt(np.linalg.eigvalsh([[1600.0, -400.0], [-400.0, 400.0]])) / (2 * np.pi)).tolist()
    stiffer = beamsim.identify_stiffness(pressed(0.7, frequencies))  # 800 N/m; 0.7 N is on the first segment then
    assert ["would rest on another segment" in warning for warning in stiffer.warnings] == [True]
    bend = beamsim.identify_stiffness(pressed(0.6, frequencies))
    assert any("rests at a bend of its table, 2 mm" in warning for warning in bend.warnings)
    with pytest.raises(ScenarioError, match=r"measured_with gives the slope.*open at rest; give chain.snubbers\[0\]"):
        beamsim.identify_stiffness(pressed(None, frequencies, gap=1e-3))


def test_the_scale_multiplies_the_forces():
    table = {"points": POINTS, "fit": {"segments": 1}}
    once, twice = (
        next(iter(force_tables(case({"force_deflection": {**table, "scale": scale}})).values())) for scale in (1.0, 2.0)
    )
    np.testing.assert_allclose(twice.curve.force, 2.0 * once.curve.force, rtol=1e-15)
    assert twice.misfit == pytest.approx(2.0 * once.misfit, rel=1e-15)
    assert once.misfit > 0.1


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_the_scale_of_a_table_from_a_measured_vibration(noise):
    """Found from the harmonics of a probe, with a deviation that is that of the noise."""

    def of_scale(scale, **sections):
        pad = {"name": "pad", "mass": 1, "side": "below", "gap": 1e-3,
               "force_deflection": {"points": [[0, 0], [2e-3, 0.8], [1e-2, 6.0]], "scale": scale}}  # fmt: skip
        chain = {"masses": [1.0, 1.0], "springs": [400.0, 400.0], "dashpots": [4.0, 4.0], "snubbers": [pad]}
        shaken = {"kind": "harmonic", "applied_to": {"mass": 1}, "level": 2.0, "frequency": 2.2}
        return load_scenario({"chain": chain, "probes": [{"name": "a", "mass": 1}], "excitation": shaken, **sections})

    sought = "chain.snubbers.pad.force_deflection.scale"
    nonlinear = {"estimate": [sought], "tests": [{"file": "a.csv", "harmonics": 5}], "starts": 1, "profiles": False}
    turning = np.exp(2j * np.pi * 2.2 * np.outer(np.arange(600) / 200.0, np.arange(1, 13)))
    history = np.imag(turning @ steady_vibration(of_scale(1.25)).harmonics(0, "absolute_acceleration", 12))
    scatter = noise * history.std() * np.random.default_rng(3).standard_normal(history.size)
    signal = MeasuredSignal("a", np.arange(600) / 200.0, history + scatter, unit="m/s^2")
    section = {"snubber": "pad", "nonlinear": nonlinear}
    (found,) = estimates(beamsim.identify_stiffness(of_scale(1.0, identify_stiffness=section), [signal]), "nonlinear")
    assert found.parameter == sought
    assert found.value == pytest.approx(1.25, abs=max(3.0 * found.standard_deviation, 1e-6))
    if noise:
        assert 1e-4 < found.standard_deviation < 0.05


def of_segments(*factors, **sections):
    """Two masses against a pad of three segments, the last of which no motion of the tests reaches."""
    table = {"points": [[0, 0], [2e-3, 0.8], [1e-2, 6.0], [1e-1, 90.0]], "segment_factors": factors}
    pad = {"name": "pad", "mass": 1, "side": "below", "gap": 1e-3, "force_deflection": table}
    chain = {"masses": [1.0, 1.0], "springs": [400.0, 400.0], "dashpots": [4.0, 4.0], "snubbers": [pad]}
    shaken = {"kind": "harmonic", "applied_to": {"mass": 1}, "level": 2.0, "frequency": 2.2}
    return load_scenario({"chain": chain, "probes": [{"name": "a", "mass": 1}], "excitation": shaken, **sections})


def test_segments_of_a_table_from_vibrations_at_two_levels():
    """The first from a weak vibration, the second from a strong one; the third keeps its value, with a warning."""
    turning, signals, tests = np.exp(2j * np.pi * 2.2 * np.outer(np.arange(600) / 200.0, np.arange(1, 13))), [], []
    generator = np.random.default_rng(2)
    for level in (0.6, 2.0):
        true = load_scenario(of_segments(0.8, 1.3, 1.0), {"excitation.level": level})
        history = np.imag(turning @ steady_vibration(true).harmonics(0, "absolute_acceleration", 12))
        scatter = 0.01 * history.std() * generator.standard_normal(history.size)
        signals.append(MeasuredSignal("a", np.arange(600) / 200.0, history + scatter, unit="m/s^2"))
        tests.append({"file": "a.csv", "harmonics": 5, "level": level})
    sought = [f"chain.snubbers.pad.force_deflection.segment_factors[{k}]" for k in range(3)]
    fit = {"estimate": sought, "tests": tests, "starts": 1, "profiles": False}
    section = {"snubber": "pad", "nonlinear": fit}
    found = beamsim.identify_stiffness(of_segments(1, 1, 1, identify_stiffness=section), signals)
    *reached, beyond = estimates(found, "nonlinear")
    for parameter, true in zip(reached, (0.8, 1.3), strict=True):
        assert parameter.value == pytest.approx(true, abs=3.0 * parameter.standard_deviation)
        assert 1e-4 < parameter.standard_deviation < 0.05
    assert beyond.value == 1.0
    assert np.isnan(beyond.standard_deviation)
    (warning,) = found.warnings
    assert "segment_factors[2]: no test reaches segment 3, which begins at 10 mm" in warning


HEAVY = """
extends: pad.yaml
chain: {{masses: [1e6], springs: [{spring}]}}
probes: [{{name: m, mass: 1}}]
run: {{duration: {duration}, sample_rate: {rate}, convergence: off, start: {{displacement: [-2e-4], velocity: [0]}}}}
"""


BRANCH = "maxwell: [{stiffness: 20 kN/m, relaxation_time: 8 ms}]"


def under_the_loop(folder, text, rate=20.0):
    """Force of a pad of this text whose deflection is that of `loop`: a heavy mass on a spring presses it."""
    (folder / "pad.yaml").write_text(text.replace("position: 100 %", "mass: 1").replace("below", "above"))
    edited = (folder / "pad.yaml").read_text().replace("gap: 0 mm", "gap: -0.2 mm")
    (folder / "pad.yaml").write_text(edited)
    spring = 1e6 * (2 * np.pi * rate) ** 2
    numbers = {"spring": spring, "duration": 1.0 / rate, "rate": 199 * rate}
    (folder / "case.yaml").write_text(HEAVY.format(**numbers))
    return beamsim.run(load_scenario(folder / "case.yaml"))["histories"]["snubber_force"].sel(snubber="pad").values


def test_what_a_loop_gives_runs_as_it_is_printed_and_has_the_loop(tmp_path):
    """The branch stood beside the curve through the middle of the loop; now under the measured deflection the pad has
    the measured force."""
    t, x, _ = loop()
    points = ", ".join(f"[{way}, {n}]" for way, n in POINTS)
    true = f"snubbers: [{{name: pad, position: 100 %, side: below, gap: 0 mm, force_deflection: [{points}], {BRANCH}}}]"
    measured = under_the_loop(tmp_path, true)
    force = measured + np.random.default_rng(1).normal(0.0, 0.1, measured.size)
    written(tmp_path / "loop.csv", "time (s),x (m),N (N)", t, x, force)
    run = under_the_loop(tmp_path, invoke("pad", "--curve", tmp_path / "loop.csv").stdout)
    rms = float(np.sqrt(np.mean((run - force) ** 2)))
    assert rms < 0.2  # of 75 N, with noise of 0.1 N
    assert run.max() == pytest.approx(measured.max(), rel=0.01)
    told = json.loads(invoke("pad", "--curve", tmp_path / "loop.csv", "--json").stdout)
    assert told["misfit"] == pytest.approx(rms, rel=0.1)
    (branch,) = told["maxwell"]
    k, tau = branch["stiffness"], branch["relaxation_time"]
    for frequency, stiffness, loss in told["dynamic"]:
        turning = 2j * np.pi * frequency * tau
        by_hand = told["stiffness"] + k * turning / (1 + turning)
        assert (stiffness, loss) == pytest.approx((by_hand.real, by_hand.imag / by_hand.real), rel=1e-9)
    assert told["dynamic"][2][0] == pytest.approx(20.0, rel=1e-6)


def test_a_loop_of_dry_rubbing_makes_no_pad_that_is_stiff_in_an_impact(tmp_path):
    """A loop of constant width had a branch of 0.1 ms, a hundred times as stiff, which an impact met."""
    t = np.linspace(0.0, 2.0, 801)
    x, way = 1e-3 * (1.0 - np.abs(t - 1.0)), np.sign(1.0 - t)
    force = np.maximum(5e4 * x + 2.5 * way * np.minimum(1.0, x / 2e-5), 0.0)
    force += np.random.default_rng(0).normal(0.0, 0.05, t.size)
    written(tmp_path / "loop.csv", "time (s),x (m),N (N)", t, x, force)
    told = json.loads(invoke("pad", "--curve", tmp_path / "loop.csv", "--segments", 1, "--json").stdout)
    assert told["maxwell"]
    fast = told["stiffness"] + sum(branch["stiffness"] for branch in told["maxwell"])
    assert fast < 3.0 * 5e4  # an impact has at most 1.7 times the force of the curve
    assert told["misfit"] < 1.0  # of 2.5 N to either side


@pytest.mark.parametrize(
    ("points", "remedy"),
    [
        ("0.002,-0.01\n0.1,8\n0.2,22\n", "add fit: {segments: 5}"),
        ("0.05,0\n0.1,8\n0.09,9\n0.2,22\n", "add fit: {segments: 5}"),
        ("0.05,0\n0.1,8\n0.2,22\n", "subtract the gap"),
        ("0,5\n0.1,8\n0.2,22\n", "subtract the gap"),
    ],
)
def test_a_noisy_curve_is_offered_a_fit(tmp_path, points, remedy):
    """And not told that it has a gap."""
    (tmp_path / "pad.csv").write_text(f"x (mm),N (N)\n{points}")
    with pytest.raises(ScenarioError) as caught:
        force_tables(case({"name": "pad", "force_deflection": str(tmp_path / "pad.csv")}))
    assert remedy in caught.value.problems[0].remedy
