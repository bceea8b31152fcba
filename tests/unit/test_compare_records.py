"""Records that do not repeat: transients of known scale, delay and noise, and what each place of a result can be."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lsim

import beamsim
from beamsim.analyses.compare.analysis import ChannelChoice, compare, compare_records, pair_channels
from beamsim.analyses.compare.sweeps import compare_sweep
from beamsim.errors import ScenarioError
from beamsim.measurements.signal import MeasuredSignal
from beamsim.outcomes import COMPLETE, Outcome, OutcomeKind, exit_code, interruption
from beamsim.plots.comparison import comparison_figures
from beamsim.scenario import Scenario
from beamsim.scenario.run import ShockSpectrumSettings
from tests.helpers.commands import invoke

RATE = 5000.0
TIME = np.arange(4000) / RATE


def transient(time):
    """Two decaying modes, which begin smoothly."""
    t = np.maximum(time - 0.05, 0.0)
    return t**2 * np.exp(-12 * t) * (np.sin(2 * np.pi * 23 * t) + 0.6 * np.sin(2 * np.pi * 61 * t + 1.0))


@pytest.fixture(scope="module")
def shaken():
    """A run of a mass under a half sine, whose histories the tests replace."""
    return beamsim.run(Scenario.model_validate({
        "title": "Shock", "chain": {"masses": [1.0], "springs": [2e4], "dashpots": [5.0]},
        "excitation": {"kind": "half_sine", "applied_to": "base", "level": 50.0, "duration": 0.011},
        "probes": [{"name": "mass", "mass": 1}],
        "run": {"duration": float(TIME[-1]), "sample_rate": RATE, "convergence": "off"},
    }))  # fmt: skip


def moving(run, displacement):
    """The run with another motion of its only probe."""
    return replace(run, datasets={"histories": run["histories"].assign(displacement=displacement[None])})


def compared(run, measured, time=TIME, quantity="displacement", **given):
    """The one channel of a comparison of the probe."""
    return compare(run, [("mass", quantity, MeasuredSignal("mass", time, measured))], **given).channels[0]


@pytest.mark.parametrize("rate", [RATE, 3217.0])
@pytest.mark.parametrize("delay", [0.0, 0.01234, -0.0209])
def test_known_scale_and_delay(shaken, delay, rate):
    """The measurement is the prediction over 0.8, later by the delay, at its own rate; delays between samples too."""
    run = moving(shaken, transient(TIME))
    time = np.arange(0.0, TIME[-1], 1.0 / rate)
    c = compared(run, transient(time - delay) / 0.8, time)
    of, s = c.record, c.record.summary()
    assert c.delay_s == pytest.approx(-delay, abs=0.02 / rate)
    assert of.scale == pytest.approx(0.8, rel=1e-3)
    assert of.scale_error < 1e-3
    assert of.correlation > 0.99999
    assert s["peak_ratio"] == pytest.approx(0.8, rel=3e-3)
    assert np.abs(of.difference_db - 20 * np.log10(0.8)).max() < 0.05
    assert c.rms_difference == pytest.approx(0.2, abs=0.01)


def warned(run, measured, **given):
    """The warnings of a comparison of the probe's displacement."""
    return compare(run, [("mass", "displacement", MeasuredSignal("rec", TIME, measured, unit="m"))], **given).warnings


def test_a_record_with_the_other_sign_or_an_offset_is_named(shaken):
    """A mass at a stop on one side: a scale of -32 and a correlation of -0.03 stood there without a word."""
    bounces = np.maximum(transient(TIME), 0.0) * 1e3
    run = moving(shaken, bounces)
    assert warned(run, bounces) == run.warnings
    (turned,) = set(warned(run, -bounces)) - set(run.warnings)
    assert "with opposite sign the correlation is 1.0000" in turned
    assert "give --factor -1" in turned
    (offset,) = set(warned(run, bounces + 0.5 * bounces.std())) - set(run.warnings)
    assert f"its mean differs from that of the run by {0.5 * bounces.std():+.4g} m, 50 % of the computed" in offset


def test_the_largest_difference_of_spectra_is_where_they_differ(shaken):
    """A mode at 61 Hz that is measured twice as large is found there, at 6 dB less a little of the other one."""
    t = np.maximum(TIME - 0.05, 0.0)
    slow, fast = (t**2 * np.exp(-12 * t) * np.sin(2 * np.pi * f * t) for f in (9.0, 61.0))
    run = moving(shaken, slow + fast)
    s = compared(run, slow + 2 * fast).record.summary()
    assert -6.03 < s["largest_difference_db"] < -5.3
    assert 55.0 < s["largest_frequency_hz"] < 80.0


def test_response_spectra_against_integrated_oscillators():
    """Maximax of absolute acceleration during the record, of each oscillator by itself."""
    settings = ShockSpectrumSettings.model_validate({"from": 10.0, "to": 100.0, "quality": 5.0, "per_octave": 1})
    late = transient(TIME - 0.1)
    of = compare_records((TIME, transient(TIME)), (TIME, late), settings)
    fine = np.linspace(0.0, TIME[-1], 8 * TIME.size)
    for k, hz in enumerate(of.frequency_hz):
        omega = 2 * np.pi * hz
        system = ([omega / 5.0, omega**2], [1.0, omega / 5.0, omega**2])
        for found, signal in ((of.predicted_response, transient(fine)), (of.measured_response, transient(fine - 0.1))):
            assert found[k] == pytest.approx(np.abs(lsim(system, signal, fine)[1]).max(), rel=1e-3)
    assert (of.quality, of.frequency_hz[0], of.frequency_hz[-1]) == (5.0, 10.0, pytest.approx(100.0))


def test_noise_makes_the_standard_error_of_the_scale():
    """Over sixty records with noise of 20 % of the signal the scale is true on average and scatters as it is said."""
    x = transient(TIME)
    rng, size = np.random.default_rng(5), float(np.sqrt(np.mean(x**2)))
    settings = ShockSpectrumSettings.model_validate({"from": 10.0, "to": 20.0, "per_octave": 1})
    found = [
        compare_records((TIME, x), (TIME, x / 0.8 + 0.2 * size * rng.standard_normal(TIME.size)), settings)
        for _ in range(60)
    ]
    scales, errors = np.array([of.scale for of in found]), np.array([of.scale_error for of in found])
    assert np.mean(scales) == pytest.approx(0.8, abs=3 * scales.std() / np.sqrt(60))
    assert 0.6 < np.sqrt(np.mean(errors**2)) / scales.std() < 1.7
    assert found[0].correlation == pytest.approx(1 / np.sqrt(1 + (0.8 * 0.2) ** 2), abs=2e-3)


def test_records_that_share_little_or_nothing():
    x = transient(TIME)
    assert compare_records((TIME, x), (TIME + TIME[-1] - 10 / RATE, x), None) is None
    assert compare_records((TIME, 0 * x), (TIME, x), None) is None


def test_table_json_file_and_picture(tmp_path, shaken):
    """What a user reads: the first screen, the table, --json, the result file and the three panels."""
    path = tmp_path / "shock.h5"
    beamsim.write_result(shaken, path)
    acceleration = shaken["histories"]["absolute_acceleration"].sel(probe="mass").values / 9.80665 / 1.25
    rows = [
        f"{t!r},{a!r}"
        for t, a in zip((shaken["histories"]["time"].values + 0.004).tolist(), acceleration.tolist(), strict=True)
    ]
    (tmp_path / "lab.csv").write_text("\n".join(["t [s],mass acceleration [g]", *rows]))
    screen = invoke("compare", path, tmp_path / "lab.csv", "--no-plots").output
    assert "1.25" in screen
    assert "+1.94 dB" in screen
    table = invoke("compare", path, tmp_path / "lab.csv", "--no-plots", "-v").output
    assert "ratio   scale" in table
    assert "1.25    1.25 \u00b1 " in table
    done = invoke("compare", path, tmp_path / "lab.csv", "--json", "--no-plots", "-o", tmp_path)
    assert '"peak_ratio": 1.25' in done.stdout
    (kept,) = beamsim.load(tmp_path / "shock_compare.h5").channels
    assert kept.record.scale == pytest.approx(1.25)
    figures = comparison_figures(beamsim.load(tmp_path / "shock_compare.h5"))
    assert len(figures["mass_absolute_acceleration"].panels) == 3


@pytest.fixture(scope="module")
def boom(tmp_path_factory):
    """A boom that latches, with an output, and its channels as a laboratory would name them."""
    folder = tmp_path_factory.mktemp("boom")
    result = beamsim.run(beamsim.load_scenario("configs/structures/deployed_boom.yaml"))
    columns = {
        "root.end moment [N mm]": 1e3 * result["histories"]["snubber_force"].sel(snubber="root.end").values / 1.1,
        "angle [deg]": np.degrees(result["histories"]["output_value"].sel(output="angle").values) / 1.1,
    }
    lines = [",".join(["t [s]", *columns])]
    lines += [
        ",".join(f"{x!r}" for x in row)
        for row in np.column_stack([result["histories"]["time"].values, *columns.values()]).tolist()
    ]
    (folder / "lab.csv").write_text("\n".join(lines))
    return result, folder / "lab.csv"


def test_moments_of_hinges_and_outputs(boom):
    """Found by their names, in N m and rad, and refused in other units."""
    result, path = boom
    pairs = pair_channels(result, path)
    assert [(place, quantity, signal.unit) for place, quantity, signal in pairs] == [
        ("root.end", "moment", "N m"), ("angle", "rotation", "rad")]  # fmt: skip
    for c in compare(result, pairs).channels:
        assert c.record.scale == pytest.approx(1.1, rel=1e-9)
        assert c.unit == {"root.end": "N m", "angle": "rad"}[c.place]
        assert c.record.summary()["peak_ratio"] == pytest.approx(1.1, rel=1e-9)
    ((place, quantity, signal),) = pair_channels(
        result, path, ChannelChoice(channel="root.end moment", place="root.end")
    )
    assert (place, quantity) == ("root.end", "moment")
    assert np.abs(signal.y).max() == pytest.approx(
        result["histories"]["snubber_force"].sel(snubber="root.end").values.max() / 1.1
    )
    with pytest.raises(ScenarioError, match="give the unit of the moment"):
        pair_channels(result, path, ChannelChoice(channel="root.end moment", place="root.end", unit="N"))
    with pytest.raises(ScenarioError, match=r"--probe root.end has no force|force is not one of"):
        pair_channels(result, path, ChannelChoice(channel="root.end moment", place="root.end", quantity="force"))


def test_files_of_results_are_compared_with_themselves(boom, tmp_path):
    """Channels of an HDF5 file and of a table that the package wrote: of probes, stops of hinges and outputs."""
    path = beamsim.write_result(boom[0], tmp_path / "boom.h5")
    invoke("export", path, "-o", tmp_path / "boom.csv")
    for file in (path, tmp_path / "boom_csv" / "histories_by_time.csv"):
        pairs = pair_channels(boom[0], file)
        assert {(place, quantity) for place, quantity, _ in pairs} == {
            ("tip", "absolute_acceleration"), ("tip", "displacement"), ("tip", "absolute_displacement"),
            ("tip", "velocity"), ("root.end", "moment"), ("angle", "rotation")}  # fmt: skip
        assert all(c.rms_difference < 1e-9 for c in compare(boom[0], pairs).channels)


def test_moments_and_outputs_of_a_sweep(tmp_path):
    """A response over frequency that is the computed one over 1.1, of a hinge's stop and of an output."""
    body = {"kind": "beam", "length": 0.5, "bending_stiffness": 5e6, "mass_per_length": 1.2, "elements": 2,
            "supports": {"left": "free", "right": "free"}}  # fmt: skip
    stop = {"name": "end", "angle": 0.01, "side": "above", "stiffness": 400.0}
    hinge = {"name": "root", "kind": "hinge", "between": [{"body": "arm", "position": 0}, "base"], "stops": [stop],
             "rotational_stiffness": 2.0, "rotational_dashpot": 0.2}  # fmt: skip
    result = beamsim.sweep(beamsim.load_scenario({
        "bodies": {"arm": body}, "joints": [hinge], "reduction": {"modes": 1},
        "outputs": [{"name": "angle", "kind": "rotation", "at": {"body": "arm", "position": 0}}],
        "probes": [{"name": "tip", "at": {"body": "arm", "position": 0.5}}],
        "excitation": {"kind": "harmonic", "applied_to": "base", "level": 0.5, "frequency": 0.5},
        "sweep": {"kind": "swept_sine", "from": 0.4, "to": 1.0, "rate": "0.02 Hz/s", "convergence": "off"},
    }))  # fmt: skip
    (curve,) = result.curves.values()
    moment, angle = (
        curve.channel("force", "root.end").peak / 1.1,
        np.degrees(curve.channel("output", "angle").peak) / 1.1,
    )
    rows = np.column_stack([curve.frequency_hz, moment, angle]).tolist()
    text = ["frequency [Hz],root.end moment [N m],angle [deg]", *(",".join(map(repr, row)) for row in rows)]
    (tmp_path / "lab.csv").write_text("\n".join(text))
    pairs = pair_channels(result, tmp_path / "lab.csv")
    assert [(place, quantity) for place, quantity, _ in pairs] == [("root.end", "moment"), ("angle", "rotation")]
    for c in compare_sweep(result, pairs, detector="peak").sweeps:
        assert np.abs(c.predicted) == pytest.approx(1.1 * np.abs(c.measured))
        assert c.unit == {"root.end": "N m", "angle": "rad"}[c.place]


UNTRUSTED = Outcome.of(OutcomeKind.UNTRUSTED, "reduction_not_accurate", "its reduced model is not accurate")
DOUBTFUL = Outcome.of(OutcomeKind.DOUBTFUL, "figures_doubtful", "values change by 3 %")
INTERRUPTED = interruption("after 0.1 s")


@pytest.mark.parametrize(
    ("ended", "kind", "code"),
    [(COMPLETE, "complete", 0), (DOUBTFUL, "doubtful", 0), (UNTRUSTED, "untrusted", 3), (INTERRUPTED, "incomplete", 3)],
    ids=lambda each: str(each)[:12],
)
def test_a_comparison_is_as_reliable_as_the_result_that_is_compared(shaken, ended, kind, code):
    """It was complete, with exit code 0, whatever the run was."""
    history = shaken["histories"]["displacement"].sel(probe="mass").values
    run = replace(shaken, warnings=("a warning of the run",)).with_outcome(ended)
    result = compare(run, [("mass", "displacement", MeasuredSignal("mass", TIME, 1.1 * history))])
    assert result.outcome.gravest_kind == kind
    assert exit_code(result.outcome) == code
    assert result.complete == (kind == "complete")
    assert result.warnings[0] == "a warning of the run"
    assert ended is COMPLETE or ended.sentence in result.status
