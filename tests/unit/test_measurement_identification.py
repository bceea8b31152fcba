"""Measured signals: harmonics, noise, and the files they come from."""

from dataclasses import replace

import numpy as np
import pytest

import beamsim
from beamsim.analyses.compare.analysis import compare
from beamsim.errors import ScenarioError
from beamsim.measurements.channels import channel_named, read_signals
from beamsim.measurements.signal import MeasuredSignal, in_si
from beamsim.scenario import Scenario
from beamsim.scenario.units import ACCELERATION
from beamsim.signals.harmonics import harmonics_of, period_multiple, steady_part

TIME = np.arange(4000) / 8000.0
TRUE = np.array([2.0 * np.exp(0.3j), 0.5 * np.exp(-1.2j), 0.1j])


def history(frequency=40.0):
    return np.imag(np.exp(2j * np.pi * frequency * np.outer(TIME, [1, 2, 3])) @ TRUE) + 0.7


def test_harmonics_without_noise_are_exact():
    found = harmonics_of(MeasuredSignal("x", TIME, history()), 40.0, 3)
    assert found.value == pytest.approx(TRUE, abs=1e-12)
    # a frequency that does not fit the record leaks nothing
    found = harmonics_of(MeasuredSignal("x", TIME, history(41.3)), 41.3, 3)
    assert found.value == pytest.approx(TRUE, abs=1e-10)


def test_the_noise_is_that_of_the_harmonics():
    deviations = []
    for seed in range(200):
        x = history() + 0.05 * np.random.default_rng(seed).standard_normal(TIME.size)
        found = harmonics_of(MeasuredSignal("x", TIME, x), 40.0, 3)
        deviations.append(np.concatenate([(found.value - TRUE).real, (found.value - TRUE).imag]))
        assert found.noise == pytest.approx(np.full(3, 0.05 * np.sqrt(2 / TIME.size)), rel=0.1)
    assert np.std(deviations) == pytest.approx(0.05 * np.sqrt(2 / TIME.size), rel=0.1)


def test_the_settled_part_of_a_history():
    t = np.arange(0, 20, 1e-3)
    steady = np.sin(2 * np.pi * 3 * t) + 0.3 * np.sin(2 * np.pi * 9 * t)
    start, difference = steady_part(t, steady + 2 * np.exp(-t) * np.sin(2 * np.pi * 5.1 * t), 1 / 3)
    assert 4.0 < start < 6.0  # 2 exp(-t) is 1 % of the motion at 5.6 s
    assert difference < 0.01
    doubled, _ = steady_part(t, steady + 0.5 * np.sin(2 * np.pi * 1.5 * t), 1 / 3)
    assert doubled < 1.0
    start, difference = steady_part(t, np.sin(2 * np.pi * 3 * t + t**2), 1 / 3)  # never settles
    assert start == pytest.approx(10.0, abs=0.5)
    assert difference > 0.1


@pytest.mark.parametrize("multiple", [1, 2, 3, 4])
@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_how_many_periods_a_motion_has(multiple, noise):
    """A subharmonic of 30 %, in a history with and without noise and in its spectrum."""
    rng, harmonics = np.random.default_rng(multiple), np.imag(np.exp(2j * np.pi * 40.0 * TIME))
    x = harmonics + 0.3 * np.sin(2 * np.pi * 40.0 / multiple * TIME + 0.4) * (multiple > 1)
    x = x + noise * rng.standard_normal(TIME.size)
    assert period_multiple(MeasuredSignal("x", TIME, x), 40.0) == multiple
    start, deviation = steady_part(TIME, x, 1 / 40.0)
    assert (deviation < 0.01) == (noise == 0.0)
    assert (start < 0.03) == (noise == 0.0)
    long = np.tile(x[: 200 * 12], 5)
    lines = np.abs(np.fft.rfft(long)) * 2 / long.size
    spectrum = MeasuredSignal("x", np.fft.rfftfreq(long.size, 1 / 8000.0), lines, is_over_frequency=True)
    assert period_multiple(spectrum, 40.0) == multiple
    # what does not tell: eleven periods of the excitation, and lines as far apart as half of it
    short = TIME < 11 / 40
    assert period_multiple(MeasuredSignal("x", TIME[short], x[short]), 40.0) == 1
    coarse = MeasuredSignal("x", np.arange(20) * 20.0, np.ones(20), is_over_frequency=True)
    assert period_multiple(coarse, 40.0) == 1


@pytest.fixture(scope="module")
def oscillator():
    """A run of one mass at 40 Hz, whose history the tests replace."""
    return beamsim.run(
        Scenario.model_validate({
            "chain": {"masses": [1.0], "springs": [1e5], "dashpots": [20.0]},
            "excitation": {"kind": "harmonic", "applied_to": "base", "level": 1.0, "frequency": 40.0},
            "probes": [{"name": "mass", "mass": 1}],
            "run": {"duration": 0.5, "sample_rate": 8000.0, "convergence": "off"},
        })
    )  # fmt: skip


@pytest.mark.parametrize("multiple", [1, 2, 3, 4])
@pytest.mark.parametrize("late", [0, 1, 2, 3])
def test_a_motion_of_several_periods_is_aligned_over_all_of_them(oscillator, multiple, late):
    """Records that began in another period of the excitation differed by half of themselves."""

    def motion(t):
        cycles = 2 * np.pi * 40.0 * t
        return np.sin(cycles) + 0.2 * np.sin(2 * cycles) + 0.4 * np.sin(cycles / multiple + 0.4) * (multiple > 1)

    histories = oscillator["histories"]
    moved = histories.assign(displacement=motion(histories["time"].values)[None])
    run = replace(oscillator, datasets=oscillator.datasets | {"histories": moved})
    delay = (late + 0.3) / 40.0
    measured = motion(TIME + delay) + 1e-3 * np.random.default_rng(late).standard_normal(TIME.size)
    (c,) = compare(run, [("mass", "displacement", MeasuredSignal("mass", TIME, measured))], harmonics=3).channels
    assert c.order.tolist() == (np.arange(1, 3 * multiple + 1) / multiple).tolist()
    assert c.rms_difference < 5e-3
    assert 40.0 * c.delay_s == pytest.approx(0.3 + late % multiple, abs=1e-3) or 40.0 * c.delay_s == pytest.approx(
        0.3 + late % multiple - multiple, abs=1e-3
    )
    present = np.isin(c.order, [1.0 / multiple, 1.0, 2.0])
    assert np.abs(c.difference_db[present]).max() < 0.05
    assert np.abs(c.predicted[~present]).max(initial=0.0) < 1e-9


def test_complex_and_plain_spectra():
    frequency = np.fft.rfftfreq(TIME.size, 1 / 8000.0)
    spectrum = np.fft.rfft(history()) * 2 / TIME.size
    found = harmonics_of(MeasuredSignal("x", frequency, spectrum, is_over_frequency=True), 40.0, 3)
    assert found.has_phase
    assert found.value == pytest.approx(TRUE, abs=1e-10)
    found = harmonics_of(MeasuredSignal("x", frequency, np.abs(spectrum), is_over_frequency=True), 40.0, 3)
    assert not found.has_phase
    assert np.abs(found.value) == pytest.approx(np.abs(TRUE), abs=1e-10)


def test_units_of_header_and_scenario(tmp_path):
    (tmp_path / "a.csv").write_text("time,tip (g)\n0,1\n1,2\n")
    with pytest.raises(ScenarioError, match=r"states no unit of its times \(axis time\)"):
        read_signals(tmp_path / "a.csv")
    (signal,) = read_signals(tmp_path / "a.csv", "ms")
    assert signal.x.tolist() == [0.0, 1e-3]
    assert signal.unit == "g"
    assert in_si(signal, None, ACCELERATION, "x").y.tolist() == pytest.approx([9.80665, 19.6133])
    assert in_si(signal, "mm/s^2", ACCELERATION, "x").y.tolist() == pytest.approx([1e-3, 2e-3])
    with pytest.raises(ScenarioError, match="acceleration"):
        in_si(signal, "mm", ACCELERATION, "x")
    (tmp_path / "b.csv").write_text("time (s),tip\n0,1\n1,2\n")
    (signal,) = read_signals(tmp_path / "b.csv")
    with pytest.raises(ScenarioError, match=r"x is missing, and .*b\.csv states no unit of tip") as error:
        in_si(signal, None, ACCELERATION, "x")
    assert error.value.problems[0].remedy == "give the unit of the acceleration, for example g"


def test_functions_of_one_name_are_told_apart(tmp_path):
    """Accelerometers labelled alike could not be chosen."""
    pyuff, t = pytest.importorskip("pyuff"), np.arange(8) / 8.0
    sides = [("panel", 3, 3), ("panel", 3, -1), ("panel", 7, 3), ("panel", 7, 3), ("shaker", 1, 3)]
    for number, (label, node, direction) in enumerate(sides):
        record = pyuff.prepare_58(
            binary=0, func_type=1, rsp_node=node, rsp_dir=direction, ref_dir=3, ref_node=1, data=t + number, x=t,
            id1=label, rsp_ent_name="NONE", ref_ent_name="NONE", abscissa_spacing=1, abscissa_spec_data_type=17,
            ordinate_spec_data_type=12, orddenom_spec_data_type=0, ordinate_axis_units_lab="g",
        )  # fmt: skip
        pyuff.UFF(str(tmp_path / "a.uff")).write_sets(record, "add")
    names = ["panel node 3 +Z", "panel node 3 -X", "panel node 7 +Z (3)", "panel node 7 +Z (4)", "shaker"]
    columns = ["panel (g)", "panel (g)", "tip", "tip", "shaker"]
    rows = [",".join(map(str, row)) for row in np.column_stack([t, *(t + k for k in range(5))])]
    (tmp_path / "a.csv").write_text("\n".join([",".join(["time (s)", *columns]), *rows]))
    for file, found in (
        ("a.uff", names),
        ("a.csv", ["panel (g) (2)", "panel (g) (3)", "tip (4)", "tip (5)", "shaker"]),
    ):
        signals = [signal for signal in read_signals(tmp_path / file) if signal.name != "time (s)"]
        assert [signal.name for signal in signals] == found
        for number, name in enumerate(found):
            first = channel_named(signals, name, "", tmp_path / file, required=True).y[0]
            assert first == (-number if "-X" in name else number)
    with pytest.raises(ScenarioError, match=r"2 channels that could be tip .*panel \(g\) \(2\)"):
        channel_named(signals, "tip", "velocity", tmp_path / "a.csv", required=True)


@pytest.mark.parametrize("name", ["a.uff", "a.h5"])
def test_damaged_files(tmp_path, name):
    (tmp_path / name).write_text("    -1\n    58\nrubbish\n    -1\n")
    with pytest.raises(ScenarioError) as caught:
        read_signals(tmp_path / name)
    assert name in str(caught.value)


def test_faults_are_named_with_their_line_and_column(tmp_path):
    """Lines were counted without comments and headings, or not at all."""
    path = tmp_path / "a.csv"
    path.write_text("# shaker 2\nZeit (ms);Kraft (N)\n\n0;1,5\n1;zwei\n", encoding="utf-16")
    with pytest.raises(ScenarioError, match=r"a\.csv has 'zwei' in line 5, sample 2 of Kraft \(N\)") as error:
        read_signals(path)
    assert error.value.problems[0].remedy
    path.write_text("time (s),tip (g)\n0,1\n1,2,3\n")
    with pytest.raises(ScenarioError, match="has 3 columns in line 3 instead of 2"):
        read_signals(path)


def test_blanks_separate_columns_and_not_units_from_their_names(tmp_path):
    (tmp_path / "a.txt").write_text("time [ms]   tip (m/s^2)\n0   1\n1   2\n")
    (signal,) = read_signals(tmp_path / "a.txt")
    assert (signal.name, signal.unit, signal.x.tolist()) == ("tip (m/s^2)", "m/s^2", [0.0, 1e-3])
