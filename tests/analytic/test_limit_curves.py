"""Limit curves of shock response spectra and densities, limits by place and on root mean squares, by hand."""

import math

import numpy as np
import pytest
from scipy.signal import welch

import beamsim
from beamsim.errors import ScenarioError
from beamsim.inputs.measured import limit_curve
from beamsim.results.values import limits_not_met
from beamsim.scenario import load_scenario, units
from beamsim.store.results import load, write_result

G = 9.80665
MASS = """\
chain: {masses: [2 kg], springs: [8 MN/m], damping: {kind: modal, ratio: 5 %},
        snubbers: [{name: stop, mass: 1, side: below, stiffness: 800 N/m, gap: 1}]}
probes: [{name: mass, mass: 1}]
"""
STEP = (
    MASS
    + """\
excitation: {kind: step, applied_to: base, level: 2 g, duration: 20 ms}
run:
  {duration: 0.1 s, sample_rate: 10 kHz, convergence: off, srs: {quality: 1e6, from: 50 Hz, to: 400 Hz, per_octave: 6}}
"""
)


def step(**more):
    return load_scenario(STEP, more)


def test_margin_to_a_curve_of_a_shock_response_spectrum():
    """An undamped oscillator doubles a rectangular pulse of at least half its period: 4 g from 25 Hz on.

    The curve rises as the frequency from 3 g at 100 Hz, where the margin is 20 lg(3/4) = -2.5 dB.
    """
    result = beamsim.run(step(limits={"srs": {"input": [["100 Hz", "3 g"], ["400 Hz", "12 g"]]}}))
    item = result.summary["margins"]["srs.input"]
    assert item["margin_db"] == pytest.approx(20.0 * math.log10(3.0 / 4.0), abs=2e-3)
    assert item["value"] == pytest.approx(4.0 / 3.0, rel=2e-4)
    assert item["frequency_hz"] == pytest.approx(100.0)
    assert item["at"] == "input, 100 Hz"
    assert item["exceeded"]
    (text,) = limits_not_met(result.scenario, result.summary["margins"])
    assert text == "SRS of input exceeds limits.srs.input at input, 100 Hz: the margin is -2.50 dB"
    limit, frequency = result["srs"]["limit"].values[0], result["srs"]["frequency_hz"].values
    of_frequency = dict(zip(np.round(frequency).tolist(), limit / G, strict=True))
    assert of_frequency[200.0] == pytest.approx(6.0)
    assert math.isnan(of_frequency[50.0])  # nothing is limited below the first point


def test_a_curve_from_a_file(tmp_path):
    """Columns in other units; 5 g everywhere leaves 20 lg(5/4) dB."""
    (tmp_path / "curve.csv").write_text("frequency (kHz);limit (m/s^2)\n0,01;49,03325\n10;49,03325\n")
    (tmp_path / "case.yaml").write_text(STEP + "limits: {srs: {input: curve.csv}}\n")
    item = beamsim.run(load_scenario(tmp_path / "case.yaml")).summary["margins"]["srs.input"]
    assert item["margin_db"] == pytest.approx(20.0 * math.log10(5.0 / 4.0), abs=2e-3)
    assert item["verdict"] == "ok"


STEPS_DOWN = [("100 Hz", 10.0), ("200 Hz", 10.0), ("200 Hz", 3.0), ("400 Hz", 3.0)]
STEPS_UP = [("0.1 kHz", 3.0), ("0.2 kHz", 3.0), ("200 Hz", 10.0), ("400 Hz", 10.0)]
NOISE = (
    MASS
    + "excitation: {kind: random, applied_to: base, psd: [{frequency: 50, density: 1}, {frequency: 500, density: 1}]}"
)


@pytest.mark.parametrize("as_file", [False, True])
@pytest.mark.parametrize(("steps", "before", "behind"), [(STEPS_DOWN, 10.0, 3.0), (STEPS_UP, 3.0, 10.0)])
@pytest.mark.parametrize(
    ("limit", "quantity", "unit", "size"),
    [("srs", "acceleration", "g", G), ("psd", units.ACCELERATION_PSD.name, "g^2/Hz", G * G)],
)
def test_a_step_of_a_curve_at_one_frequency(limit, quantity, unit, size, steps, before, behind, as_file, tmp_path):
    """Two points at one frequency, as random inputs have them; the lower one holds there."""
    given = [[frequency, f"{level} {unit}"] for frequency, level in steps]
    if as_file:
        rows = [
            f"{frequency},{level}" for frequency, level in zip([100, 200, 200, 400], [x for _, x in steps], strict=True)
        ]
        (tmp_path / "curve.csv").write_text("\n".join([f"frequency (Hz),limit ({unit})", *rows]) + "\n")
        given = str(tmp_path / "curve.csv")
    case = STEP if limit == "srs" else f"{NOISE}\nrun: {{duration: 2 s}}\n"
    scenario = load_scenario(case, {"limits": {limit: {"input": given}}})
    at = np.array([100.0, 199.999, 200.0, 200.0 * (1.0 + 1e-12), 200.001, 400.0])
    found = limit_curve(scenario, limit, "input", quantity, at) / size
    assert found == pytest.approx([before, before, 3.0, 3.0, behind, behind])


@pytest.mark.parametrize("at", [(100, 100, 200), (100, 200, 200), (100, 200, 200, 200, 300), (100, 300, 200)])
def test_a_step_is_within_a_curve_and_has_two_points(at):
    with pytest.raises(ScenarioError, match=r"limits\.srs\.input\[\d\]\[0\] = .* is not larger than the one before"):
        step(limits={"srs": {"input": [[f, "3 g"] for f in at]}})


def test_a_curve_outside_of_the_spectrum_is_not_met():
    result = beamsim.run(step(limits={"srs": {"input": [["1 kHz", "3 g"], ["2 kHz", "3 g"]]}}))
    assert result.summary["margins"]["srs.input"]["verdict"] == "not reliable"


def test_cases_of_a_study_have_the_margins_of_curves():
    vary = {"kind": "grid", "parameters": [{"path": "excitation.level", "values": ["1 g", "3 g"]}]}
    limits = {"srs": {"input": [["10 Hz", "5 g"], ["1 kHz", "5 g"]]}}
    result = beamsim.design_study(step(limits=limits, vary=vary))
    margin = result["cases"]["margin"].sel(limit="srs.input").values
    np.testing.assert_allclose(margin, [5.0 / 2.0 - 1.0, 5.0 / 6.0 - 1.0], atol=1e-3)
    assert result.summary["margins"]["srs.input"]["margin_db"] == pytest.approx(20 * math.log10(5 / 6), abs=2e-3)


def test_margins_of_densities_and_root_mean_squares_of_a_random_input():
    """Against SciPy's estimate of the stored history without the first tenth, and a curve interpolated here."""
    frequencies, densities = np.array([20.0, 60.0, 200.0]), np.array([0.002, 0.02, 0.001])
    points = [[f"{f} Hz", f"{d} g^2/Hz"] for f, d in zip(frequencies, densities, strict=True)]
    psd = [{"frequency": f"{f} Hz", "density": "0.005 g^2/Hz"} for f in (20, 200)]
    excitation = {"kind": "random", "applied_to": "base", "psd": psd, "seed": 3}
    run = {"duration": 2.0, "sample_rate": "2 kHz", "convergence": "off"}
    limits = {"psd": {"mass": points}, "rms_acceleration": {"mass": "1.2 g"}, "rms_force": "1 N"}
    result = beamsim.run(load_scenario(MASS, {"excitation": excitation, "run": run, "limits": limits}))
    x = (
        result["histories"]["absolute_acceleration"]
        .sel(probe="mass")
        .values[result["histories"]["time"].values >= result["random"]["start_s"].item()]
        / G
    )
    length = 2 * x.size // 17
    f, density = welch(x, 2000.0, "hann", length, length // 2)
    inside = (f >= 20.0) & (f <= 200.0)
    allowed = 10.0 ** np.interp(np.log10(f[inside]), np.log10(frequencies), np.log10(densities))
    margins = result.summary["margins"]
    ratio = density[inside] / allowed
    assert margins["psd.mass"]["margin_db"] == pytest.approx(-10.0 * math.log10(ratio.max()), abs=1e-6)
    assert margins["psd.mass"]["frequency_hz"] == pytest.approx(f[inside][ratio.argmax()])
    rms = math.sqrt(float(np.mean(x**2)))
    assert margins["rms_acceleration.mass"]["value"] == pytest.approx(rms * G, rel=1e-9)
    assert margins["rms_acceleration.mass"]["exceeded"] == (rms > 1.2)
    assert margins["rms_force"]["value"] == 0.0  # the stop is a metre away


def test_root_mean_square_of_a_steady_motion():
    """A mass on a spring of 318 Hz follows a base at 2 Hz: 3 g / sqrt(2) within (2 / 318)^2."""
    excitation = {"kind": "harmonic", "applied_to": "base", "level": "3 g", "frequency": 2.0}
    run = {"duration": 3.0, "sample_rate": "2 kHz", "spectrum": {"last": 1.0}, "convergence": "off"}
    limits = {"rms_acceleration": "2 g", "peak_acceleration": {"mass": "4 g"}}
    margins = beamsim.run(load_scenario(MASS, {"excitation": excitation, "run": run, "limits": limits})).summary[
        "margins"
    ]
    assert margins["rms_acceleration"]["value"] == pytest.approx(3.0 * G / math.sqrt(2.0), rel=2e-4)
    assert margins["rms_acceleration"]["exceeded"]
    assert margins["peak_acceleration.mass"]["verdict"] == "ok"


@pytest.mark.parametrize(
    "sweep", [{"kind": "stepped", "points": 2}, {"kind": "swept_sine", "rate": "0.1 Hz/s"}, {"kind": "continuation"}]
)
def test_limits_by_place_along_sweeps_and_branches(sweep):
    """Of two probes with limits of their own each is compared with its own."""
    two = """\
chain: {masses: [2 kg, 1 kg], springs: [800 N/m, 100 N/m], damping: {kind: modal, ratio: 5 %}}
probes: [{name: low, mass: 1}, {name: high, mass: 2}]
limits: {peak_displacement: {high: 1 m, low: 1 mm}}
excitation: {kind: harmonic, applied_to: base, level: 1 m/s^2, frequency: 1 Hz}
"""
    continued = sweep["kind"] == "continuation"
    result = (beamsim.continuation if continued else beamsim.sweep)(
        load_scenario(two, {"sweep": {"from": 1.0, "to": 1.2, **sweep}})
    )
    margins = result.summary["margins"]
    for name, verdict in (("high", "ok"), ("low", "exceeded")):
        if continued:
            largest = float(result["points"]["peak_displacement"].sel(probe=name).values.max())
        else:
            largest = float(result["cycles"]["peak_displacement"].sel(probe=name).values.max())
        assert margins[f"peak_displacement.{name}"]["value"] == pytest.approx(largest, rel=1e-12)
        assert margins[f"peak_displacement.{name}"]["verdict"] == verdict


SINE = MASS + "excitation: {kind: harmonic, applied_to: base, level: 1 g, frequency: 300 Hz}\n"


@pytest.mark.parametrize("limit", [[["250 Hz", "4 g"], ["400 Hz", "10 g"]], "curve.csv"])
def test_margin_of_the_steps_of_a_sweep_to_a_curve(limit, tmp_path):
    """An oscillator of 318 Hz and 5 % on a base of 1 g, in closed form; outside of the curve nothing is limited."""
    (tmp_path / "curve.csv").write_text("frequency (Hz),limit (m/s^2)\n250,39.2266\n400,98.0665\n")
    steps = "from: 200 Hz, to: 400 Hz, points: 9, direction: both, steady_to: 1e-9, convergence: off"
    sweep = f"sweep: {{kind: stepped, {steps}}}\n"
    if isinstance(limit, str):
        limit = str(tmp_path / limit)
    result = beamsim.sweep(load_scenario(SINE + sweep, {"limits": {"response": {"mass": limit}}}))
    f = np.linspace(200.0, 400.0, 9)
    r, z = f / (math.sqrt(4e6) / (2 * np.pi)), 0.05
    peak = np.sqrt((1 + (2 * z * r) ** 2) / ((1 - r**2) ** 2 + (2 * z * r) ** 2))
    allowed = 4.0 * (f / 250.0) ** (math.log(2.5) / math.log(1.6))
    ratio = np.where(f >= 250.0, peak / allowed, 0.0)
    item = result.summary["margins"]["response.mass"]
    assert item["value"] == pytest.approx(ratio.max(), rel=1e-6)
    assert item["margin_db"] == pytest.approx(-20 * math.log10(ratio.max()), abs=1e-5)
    assert item["at"] in (f"mass, {f[ratio.argmax()]:.4g} Hz {way}" for way in ("up", "down"))
    assert item["exceeded"]
    along = result.curves["up_0"]["limit_absolute_acceleration"].sel(probe="mass").values
    np.testing.assert_allclose(along[f >= 250.0] / G, allowed[f >= 250.0], rtol=1e-9)
    assert np.all(np.isnan(along[f < 250.0]))
    assert "limit_displacement" not in result["cycles"]
    write_result(result, tmp_path / "swept.h5")
    again = load(tmp_path / "swept.h5")
    np.testing.assert_array_equal(again.curves["down_0"]["limit_absolute_acceleration"].values[0], along[::-1])
    limits = {line.get_label(): line for line in again.plot()["acceleration"].axes[0].lines}
    np.testing.assert_allclose(limits["mass, limit"].get_ydata()[-1], 10.0, rtol=1e-9)


def test_curves_of_displacements_forces_and_moments_are_of_their_places(tmp_path):
    """A stop and a probe of one name; units of a stored case still say which, also of densities."""
    curves = {
        "response": {"mass": [["200 Hz", "1 mm"], ["400 Hz", "1 mm"]], "stop": [["200 Hz", "5 N"], ["400 Hz", "9 N"]]}
    }
    sweep = {"kind": "swept_sine", "from": "280 Hz", "to": "350 Hz", "rate": "2000 oct/min", "convergence": "off"}
    changes = {"sweep": sweep, "limits": curves, "chain.snubbers[0].gap": "0.01 mm"}
    scenario = load_scenario(SINE, changes)
    result = beamsim.sweep(scenario)
    curve = result.curves["up_0"]
    f, margins = curve.frequency_hz, result.summary["margins"]
    allowed = 5.0 * (f / 200.0) ** (math.log(9 / 5) / math.log(2.0))
    assert margins["response.stop"]["value"] == pytest.approx((curve["peak_force"].values[0] / allowed).max(), rel=1e-9)
    assert margins["response.stop"]["value"] > 0.0
    assert margins["response.mass"]["value"] == pytest.approx(curve["peak_displacement"].values.max() / 1e-3, rel=1e-9)
    psd = {"limits": {"psd": {"stop": [["20 Hz", "1 N^2/Hz"], ["90 Hz", "2 N^2/Hz"]]}}}
    noise = {
        "kind": "random",
        "applied_to": "base",
        "psd": [{"frequency": 20, "density": 1}, {"frequency": 90, "density": 1}],
    }
    of_run = load_scenario(MASS, psd | {"excitation": noise, "run": {"duration": 1.0}})
    for case in (scenario, of_run):
        assert load_scenario(case.to_yaml()) == case
    with pytest.raises(ScenarioError, match=r"limits.response.mass needs a sweep in frequency"):
        load_scenario(SINE, {"limits": curves})


def test_densities_of_forces_are_drawn_with_their_limits():
    """Of the snubbers, where one has a limit; the margin is that of the two curves."""
    noise = [{"frequency": f, "density": "0.05 g^2/Hz"} for f in (20.0, 200.0)]
    changes = {"excitation": {"kind": "random", "applied_to": "base", "psd": noise, "seed": 3},
               "run": {"duration": 2.0, "sample_rate": "2 kHz", "convergence": "off"},
               "chain.snubbers[0].gap": 0.0}  # fmt: skip
    limits = {"psd": {"stop": [["20 Hz", "1e-4 N^2/Hz"], ["200 Hz", "1e-3 N^2/Hz"]]}}
    result = beamsim.run(load_scenario(MASS, changes | {"limits": limits}))
    panel = result.plot()["random"].axes[-1]
    lines = {line.get_label(): line.get_xydata().T for line in panel.lines}
    f, density = lines["stop"]
    allowed = lines["stop, limit"][1]
    inside = (f >= 20.0) & (f <= 200.0)
    np.testing.assert_allclose(allowed[inside], 1e-4 * f[inside] / 20.0, rtol=1e-9)
    margin = result.summary["margins"]["psd.stop"]["value"]
    assert (density[inside] / allowed[inside]).max() == pytest.approx(margin, rel=1e-9)
    assert len(beamsim.run(load_scenario(MASS, changes)).plot()["random"].axes) == len(result.plot()["random"].axes) - 1
