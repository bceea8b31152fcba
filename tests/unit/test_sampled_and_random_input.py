"""Measured and random inputs: files, what is refused, densities, and the exact flow under them."""

import h5py
import numpy as np
import pytest
import pyuff
from scipy.integrate import quad

import beamsim
from beamsim.errors import ScenarioError
from beamsim.inputs.density import SpectralDensity
from beamsim.inputs.excitation import base_motion, random_signals
from beamsim.inputs.measured import read_record
from beamsim.measurements.channels import channel_named, read_signals
from beamsim.measurements.read import read_file
from beamsim.scenario import load_scenario
from beamsim.scenario.excitation import RandomInput

G = 9.80665
SI = {"unit": "m/s^2", "time_unit": "s"}
CHAIN = {
    "chain": {
        "masses": [1, 1], "springs": [400, 400, 400], "dashpots": [0.5, 0.5, 0.5],
        "snubbers": [{"name": "stop", "mass": 2, "side": "below", "stiffness": 5000, "gap": "2 mm"}],
    },
    "probes": [{"name": "first", "mass": 1}],
    "run": {"duration": 2.0, "sample_rate": 1000, "start": "rest"},
}  # fmt: skip


def case(**excitation):
    return {**CHAIN, "excitation": {**{"applied_to": "base", **excitation}}}


def base_signals(excitation, duration):
    """Acceleration, velocity and displacement."""
    motion = base_motion(excitation, duration)
    return motion.acceleration, motion.velocity, motion.displacement


def read_samples(excitation):
    record = read_record(excitation)
    return record.x, record.y


def sampled(file, **more):
    return load_scenario(case(kind="sampled", file=str(file), **more)).excitation


@pytest.fixture
def record():
    t = np.arange(2201) / 1000.0
    return t, 0.5 * np.sin(2 * np.pi * 3.0 * t) + 0.1 * np.sin(2 * np.pi * 17.0 * t + 0.4)


@pytest.mark.parametrize("form", ["plain", "headings", "semicolons", "one column"])
def test_every_form_of_file_gives_the_samples(tmp_path, record, form):
    t, a = record
    file, more = tmp_path / "a.csv", {}
    if form == "plain":
        np.savetxt(file, np.stack([t, a], axis=1), delimiter=",", header="comment")
        more = SI
    elif form == "headings":
        rows = "\n".join(f"{x!r},{2 * y!r},{y!r}" for x, y in zip(t.tolist(), a.tolist(), strict=True))
        file.write_text("time (s),other,acceleration (m/s^2)\n" + rows, encoding="utf-8")
        more = {"column": "acceleration", "time_column": "time"}
    elif form == "semicolons":
        np.savetxt(file, np.stack([t, a], axis=1), delimiter=";")
        more = {"column": "2", **SI}
    else:
        np.savetxt(file, a)
        more = {"sample_rate": "1 kHz", "unit": "m/s^2"}
    times, values = read_samples(sampled(file, **more))
    np.testing.assert_allclose(times, t, atol=1e-9)
    np.testing.assert_allclose(values, a, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "more"),
    [
        ("time (ms),acceleration [g]\n0,0\n1,1\n2,0\n3,-1\n4,0\n", {}),
        ("time [ms];acceleration (g)\n0,0;0\n1,0;1\n2,0;0\n3,0;-1\n4,0;0\n", {"column": "acceleration"}),
        ("Time_ms\tacc (g)\n0\t0\n1\t1\n2\t0\n3\t-1\n4\t0\n", {}),
        ("time (ms),acceleration\n0,0\n1,1\n2,0\n3,-1\n4,0\n", {"unit": "g"}),
        ("t,a\n0,0\n1,1\n2,0\n3,-1\n4,0\n", {"unit": "g", "time_unit": "ms"}),
    ],
)
def test_units_of_headings_are_read(tmp_path, text, more):
    """`time (ms)` was read as seconds, `acceleration [g]` as m/s^2."""
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    times, values = read_samples(sampled(tmp_path / "a.csv", **more))
    np.testing.assert_allclose(times, np.arange(5) * 1e-3, rtol=1e-12)
    expected = 9.80665 * np.array([0, 1, 0, -1, 0])
    np.testing.assert_allclose(values, expected, rtol=1e-12)


def test_units_of_hdf5_and_uff_files_are_read(tmp_path, record):
    _, a = record
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["time"], file["a"] = 1e3 * np.arange(a.size) / 1000, a
        file["time"].attrs["units"], file["a"].attrs["units"] = "ms", "g"
    uff = {
        "type": 58, "binary": 0, "func_type": 1, "rsp_ent_name": "a", "rsp_node": 1, "rsp_dir": 3,
        "ref_ent_name": "NONE", "ref_node": 0, "ref_dir": 0, "id1": "a", "id2": "NONE", "id3": "NONE",
        "id4": "NONE", "abscissa_spacing": 1, "abscissa_spec_data_type": 17, "abscissa_axis_lab": "Time",
        "abscissa_axis_units_lab": "ms", "ordinate_spec_data_type": 12, "ordinate_axis_lab": "a",
        "ordinate_axis_units_lab": "g", "orddenom_spec_data_type": 0, "x": np.arange(a.size), "data": a,
    }  # fmt: skip
    pyuff.UFF(str(tmp_path / "a.uff")).write_sets([uff], mode="overwrite")
    units = pyuff.prepare_164(
        units_code=9, units_description="mm (N)", temp_mode=1, length=1e3, force=1.0, temp=1.0, temp_offset=0.0
    )
    unlabelled = {**uff, "ordinate_axis_units_lab": "NONE", "data": 9806.65 * a}
    pyuff.UFF(str(tmp_path / "mm.uff")).write_sets([units, unlabelled], mode="overwrite")
    for name, more in (("a.h5", {"column": "a"}), ("a.uff", {}), ("mm.uff", {})):
        times, values = read_samples(sampled(tmp_path / name, **more))
        np.testing.assert_allclose(times, np.arange(a.size) * 1e-3, rtol=1e-9)
        np.testing.assert_allclose(values, 9.80665 * a, atol=1e-5 * np.abs(a).max() + 1e-4)


def test_decimal_commas_are_read_or_named(tmp_path):
    (tmp_path / "a.csv").write_text("t (s);a (m/s^2)\n0,0;1,5\n0,5;2\n1;3\n1,5;4\n", encoding="utf-8")
    times, values = read_samples(sampled(tmp_path / "a.csv"))
    assert (times.tolist(), values.tolist()) == ([0.0, 0.5, 1.0, 1.5], [1.5, 2.0, 3.0, 4.0])
    (tmp_path / "b.csv").write_text("t,a\n0,0,1,5\n0,5,2,0\n", encoding="utf-8")
    with pytest.raises(ScenarioError, match="decimal commas"):
        read_samples(sampled(tmp_path / "b.csv"))


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "cp1252"])
def test_headings_are_read_in_the_encodings_of_measuring_systems(tmp_path, encoding):
    file = tmp_path / "shaker.csv"
    file.write_text("Zeit (ms);tip Weg (µm);tip Beschleunigung (m/s²)\n0;0,5;1\n1;0,7;2\n2;0,6;3\n", encoding=encoding)
    assert [signal.name for signal in read_file(file)] == ["Zeit (ms)", "tip Weg (µm)", "tip Beschleunigung (m/s²)"]
    signals = read_signals(file)
    assert [signal.unit for signal in signals] == ["µm", "m/s²"]
    assert channel_named(signals, "tip Weg", "absolute_acceleration", file, required=True).name == signals[0].name
    file.write_bytes(b"a\0b\xff")
    with pytest.raises(ScenarioError, match="is not text"):
        read_signals(file)


def test_missing_file_short_record_and_wrong_unit(tmp_path, record):
    with pytest.raises(ScenarioError, match="does not exist"):
        read_samples(sampled(tmp_path / "none.csv"))
    t, a = record
    file = tmp_path / "short.csv"
    np.savetxt(file, np.stack([t, a], axis=1)[:500], delimiter=",")
    with pytest.raises(ScenarioError, match="ends after"):
        beamsim.run(load_scenario(case(kind="sampled", file=str(file), **SI)))
    with pytest.raises(ScenarioError, match="unit"):
        sampled(file, unit="kg")
    with pytest.raises(ScenarioError, match="interpolation"):
        sampled(file, unit="mm", interpolation="linear")


def test_a_sampled_sine_is_the_harmonic_run(tmp_path):
    """A measured force, finely sampled, against the harmonic excitation."""
    t = np.arange(0, 2.2, 5e-4)
    file = tmp_path / "sine.csv"
    np.savetxt(file, np.stack([t, 1e3 * np.sin(2 * np.pi * 3.0 * t)], axis=1), delimiter=",")
    force = {"applied_to": {"mass": 1}}
    given = {"file": str(file), "unit": "mN", "time_unit": "s", "factor": 10}
    measured = beamsim.run(load_scenario(case(kind="sampled", **given, **force)))
    exact = beamsim.run(load_scenario(case(kind="harmonic", level="10 N", frequency="3 Hz", **force)))
    a, b = (
        measured["histories"]["displacement"].sel(probe="first").values,
        exact["histories"]["displacement"].sel(probe="first").values,
    )
    assert measured.summary["events"] == exact.summary["events"] > 0
    assert np.abs(a - b).max() < 1e-6 * np.abs(b).max()
    assert measured.summary["energy_error"] < 1e-9


def test_a_sampled_base_acceleration_starts_at_rest(tmp_path):
    """d = d' = 0 at the start: the base then drifts as the integral says."""
    t = np.arange(0, 2.2, 1e-3)
    file = tmp_path / "sine.csv"
    np.savetxt(file, np.stack([t, np.sin(2 * np.pi * 3.0 * t)], axis=1), delimiter=",")
    _, velocity, displacement = base_signals(sampled(file, unit="g", time_unit="s"), 2.0)
    w = 2 * np.pi * 3.0
    np.testing.assert_allclose(velocity(t[:2000]), G / w * (1 - np.cos(w * t[:2000])), atol=1e-6)
    expected = G / w * (t[:2000] - np.sin(w * t[:2000]) / w)
    np.testing.assert_allclose(displacement(t[:2000]), expected, atol=1e-6)


@pytest.mark.parametrize("interpolation", ["cubic", "linear"])
def test_the_input_does_not_depend_on_the_duration(tmp_path, record, interpolation):
    """The record is interpolated before it is cut, so that its last milliseconds are those of a longer run."""
    t, a = record
    file = tmp_path / "a.csv"
    np.savetxt(file, np.stack([t, a], axis=1)[::25], delimiter=",")
    excitation = sampled(file, interpolation=interpolation, **SI)
    short, long = (base_signals(excitation, duration) for duration in (1.0, 2.0))
    x = np.linspace(0.0, 1.0, 2001)
    for one, other in zip(short, long, strict=True):
        np.testing.assert_allclose(one(x), other(x), atol=1e-14 * np.abs(other(x)).max())


def test_displacement_input_has_its_second_derivative_as_acceleration(tmp_path, record):
    t, a = record
    file = tmp_path / "d.csv"
    np.savetxt(file, np.stack([t, a], axis=1), delimiter=",")
    acceleration, velocity, displacement = base_signals(sampled(file, unit="mm", time_unit="s"), 2.0)
    x = np.linspace(0.1, 1.9, 77)
    np.testing.assert_allclose(displacement.derivative()(x), velocity(x))
    np.testing.assert_allclose(velocity.derivative()(x), acceleration(x))
    np.testing.assert_allclose(displacement(t[:2000]), 1e-3 * a[:2000], atol=1e-15)


TABLE = (np.array([5.0, 20.0, 80.0]), np.array([0.01, 0.04, 0.01]))


def test_density_between_its_points():
    f = np.array([4.9, 5.0, 10.0, 20.0, 40.0, 80.0, 81.0])
    np.testing.assert_allclose(SpectralDensity(*TABLE)(f), [0, 0.01, 0.02, 0.04, 0.02, 0.01, 0])


def noise(seed):
    psd = [{"frequency": f, "density": s} for f, s in zip(*map(np.ndarray.tolist, TABLE), strict=True)]
    excitation = RandomInput.model_validate({"applied_to": "base", "psd": psd, "sample_rate": 2000.0, "seed": seed})
    return random_signals(excitation, 50.0)[0](np.arange(100_000) / 2000.0)


def test_noise_has_the_variance_of_its_density_and_the_seed_decides():
    x = noise(3)
    variance, _ = quad(lambda f: float(SpectralDensity(*TABLE)(np.array([f]))[0]), 5.0, 80.0, points=[20.0], limit=200)
    assert x.var() == pytest.approx(variance, rel=2e-3)
    assert abs(x.mean()) < 1e-12
    kurtosis = np.mean(x**4) / x.var() ** 2
    assert kurtosis == pytest.approx(3.0, abs=0.15)
    np.testing.assert_array_equal(x, noise(3))
    assert np.abs(x - noise(4)).max() > 0.1


@pytest.mark.parametrize("ramp", [0.0, 0.2])
def test_random_input_does_not_depend_on_the_duration(ramp):
    """A cubic spline of the samples of one run bent towards that run's end, by 1e-3 of the input."""
    psd = [{"frequency": 20.0, "density": 1.0}, {"frequency": 60.0, "density": 1.0}]
    given = {"kind": "random", "psd": psd, "seed": 2, "period": 1.0, "sample_rate": 400.0, "ramp": ramp}
    excitation = load_scenario(case(**given)).excitation
    short, long = (base_signals(excitation, duration) for duration in (0.5, 3.0))
    t = np.linspace(0.0, 0.5, 999)
    for one, other in zip(short, long, strict=True):
        np.testing.assert_allclose(one(t), other(t), rtol=0, atol=1e-13 * np.abs(other(t)).max())
    if not ramp:
        np.testing.assert_allclose(long[0](t + 1.0), long[0](t), rtol=0, atol=1e-11 * np.abs(long[0](t)).max())


@pytest.mark.parametrize(
    "changes",
    [
        {"sample_rate": 240.0},
        {},
        {"clip": "2.5 sigma", "sample_rate": 240.0},
        {"ramp": 1.3, "sample_rate": 240.0},
        {"amplitudes": "random", "ramp": 0.4, "clip": "3 sigma"},
    ],
    ids=["lowest sampling rate", "default", "clipped", "ramp", "all"],
)
def test_a_base_that_follows_noise_does_not_drift(changes):
    """By a fifth of its rms in 15 s at the lowest sampling rate, and by a hundredth in 1,000 s at the default."""
    psd = [{"frequency": 20.0, "density": 1.0}, {"frequency": 60.0, "density": 1.0}]
    excitation = load_scenario(case(kind="random", psd=psd, seed=2, period=10.0, **changes)).excitation
    _, velocity, displacement = base_signals(excitation, 300.0)
    t = 20.0 + np.arange(0.0, 10.0, 0.001)
    rms = displacement(t).std()
    bound = 1e-14 * (20.0 * 270.0) ** 2
    np.testing.assert_allclose(displacement(t + 270.0), displacement(t), rtol=0, atol=bound * rms)
    sines_start = changes.get("ramp", 0.0) == 0.0
    assert not sines_start or abs(displacement(t).mean()) < 0.02 * rms
    # a velocity off by a ten-thousandth, as that of the sines was, would be seen
    assert 1e-4 * velocity(t).std() * 270.0 > 1e-2 * rms


def test_random_run_is_reproducible():
    psd = [{"frequency": "2 Hz", "density": "0.002 g^2/Hz"}, {"frequency": "30 Hz", "density": "0.002 g²/Hz"}]
    one, two, other = (
        beamsim.run(load_scenario(case(kind="random", psd=psd, seed=seed)))["histories"]["displacement"]
        .sel(probe="first")
        .values
        for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(one, two)
    assert np.abs(one - other).max() > 0.1 * np.abs(one).max()


def test_swept_run_is_the_sweep(tmp_path):
    """`run` with a swept sine, and `sweep`: the same largest displacement within the run's time."""
    from beamsim.analyses.sweep.analysis import sweep

    swept = {"from": "1 Hz", "to": "4 Hz", "rate": "60 oct/min"}
    scenario = {**CHAIN, "excitation": {"kind": "swept_sine", "applied_to": "base", "level": "0.3 g", **swept}}
    run = beamsim.run(load_scenario({**scenario, "run": {**CHAIN["run"], "start": "static_equilibrium"}}))
    harmonic = {"kind": "harmonic", "applied_to": "base", "level": "0.3 g", "frequency": "2 Hz"}
    record = sweep(load_scenario({**CHAIN, "excitation": harmonic, "sweep": {"kind": "swept_sine", **swept}}))
    curve = record.curves["up_0"]
    last = np.searchsorted(curve.time, 2.0) - 2
    until = run["histories"]["time"].values < curve.time[last + 1]
    peak = np.abs(run["histories"]["displacement"].sel(probe="first").values[until]).max()
    assert curve.channel("displacement", "first").peak[: last + 1].max() == pytest.approx(peak, rel=1e-4)
    with pytest.raises(ScenarioError, match="longer than the sweep, which ends at 2 s"):
        beamsim.run(load_scenario({**scenario, "run": {"duration": 3.0}}))


def test_a_record_is_looked_for_beside_the_scenario(tmp_path, monkeypatch, record):
    t, a = record
    folder = tmp_path / "cases"
    folder.mkdir()
    np.savetxt(folder / "record.csv", np.stack([t, a], axis=1), delimiter=",")
    import yaml

    (folder / "case.yaml").write_text(yaml.safe_dump(case(kind="sampled", file="record.csv", **SI)), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    result = beamsim.run(load_scenario("cases/case.yaml"))
    np.testing.assert_allclose(
        result["histories"]["base_acceleration"].values[0], a[: result["histories"]["time"].values.size], atol=1e-9
    )
    with pytest.raises(ScenarioError, match=r"case\.yaml.*does not exist|does not exist"):
        beamsim.run(load_scenario("cases/case.yaml", ["excitation.file=other.csv"]))
