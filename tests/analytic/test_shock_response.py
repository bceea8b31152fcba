"""Shock response spectra against closed forms, an independent simulation and an independent recursive filter."""

import numpy as np
import pytest
from scipy.signal import lfilter, lsim

import beamsim
from beamsim.analyses.run.shock_response import shock_response
from beamsim.errors import ScenarioError
from beamsim.flow.exact import exact_flow
from beamsim.flow.transient import simulate
from beamsim.scenario import load_scenario
from beamsim.scenario.run import ShockSpectrumSettings
from beamsim.signals.filters import geomspaced, longest_panel, shock_spectra, smooth_intervals
from beamsim.store.export import export_result
from beamsim.store.results import load, write_result
from beamsim.system.build import build_system

G = 9.80665


def settings(**more):
    return ShockSpectrumSettings.model_validate({"from": 10.0, "to": 1280.0, "per_octave": 2, **more})


def panel(**more):
    run = {"duration": 0.06, "srs": {"from": "20 Hz", "to": "2 kHz", "per_octave": 3}} | more.pop("run", {})
    return load_scenario(
        {
            "beam": {"length": 1.2, "bending_stiffness": 2967.0, "mass_per_length": 2.4,
                     "supports": {"left": "pinned", "right": "pinned"}, "damping": {"kind": "modal", "ratio": 0.02}},
            "snubbers": [{"name": side, "position": 0.6, "side": side, "stiffness": "100 kN/m", "gap": "-0.1 mm"}
                         for side in ("below", "above")],
            "excitation": {"kind": "half_sine", "applied_to": "base", "level": "20 g", "duration": "11 ms",
                           "time": "2 ms"},
            "probes": [{"name": "middle", "position": 0.6}],
            "reduction": {"modes": 6},
            "run": run,
            **more,
        }
    )  # fmt: skip


def along(chosen):
    return geomspaced(chosen.from_, chosen.to, chosen.per_octave)


def half_sine(duration):
    def pulse(t):
        return np.where((t >= 0) & (t <= duration), np.sin(np.pi * t / duration), 0.0)[:, None]

    return pulse


def test_undamped_residual_of_a_half_sine_is_that_of_its_fourier_transform():
    """After a pulse an undamped oscillator swings with omega |integral of a exp(-i omega t)|."""
    duration = 0.011
    chosen = settings(quality=1e9, to=700.0, per_octave=5)
    (peaks,) = shock_spectra(along(chosen), chosen.quality, np.array([0.0, duration]), half_sine(duration), 0.0)
    omega, b = 2 * np.pi * along(chosen), np.pi / duration
    expected = np.abs(omega * b * (1 + np.exp(-1j * omega * duration)) / (b**2 - omega**2))
    np.testing.assert_allclose(peaks[2], expected, rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(peaks[3], expected, rtol=1e-7, atol=1e-7)


def test_primary_and_residual_against_a_simulation():
    """Damped oscillators simulated by SciPy on fine samples, during the pulse and long after."""
    duration, chosen = 0.005, settings(quality=5.0, per_octave=1)
    (peaks,) = shock_spectra(along(chosen), chosen.quality, np.array([0.0, duration]), half_sine(duration), 0.0)
    for i, hz in enumerate(along(chosen)):
        t = np.linspace(0.0, duration + 1.1 / hz, 20_001)
        w, z = 2 * np.pi * hz, 0.1
        _, y, _ = lsim(([2 * z * w, w**2], [1, 2 * z * w, w**2]), half_sine(duration)(t)[:, 0], t)
        during, after = y[t <= duration], y[t > duration]
        expected = during.max(), -min(during.min(), 0.0), max(after.max(), 0.0), -min(after.min(), 0.0)
        np.testing.assert_allclose(peaks[:, i], expected, rtol=2e-4, atol=2e-4)


def test_a_bouncing_response_against_a_ramp_invariant_filter():
    """D. O. Smallwood's recursive filter (Shock and Vibration Bulletin 51, 1981) on fine exact samples."""
    result = beamsim.run(panel(run={"sample_rate": "1 MHz", "convergence": "off"}))
    assert result.summary["contacts"]["below"] > 1
    of_middle = result["srs"]["primary"].sel(signal="middle absolute_acceleration").values
    a, step = result["histories"]["absolute_acceleration"].sel(probe="middle").values[:], 1e-6
    for hz, primary in zip(result["srs"]["frequency_hz"].values, of_middle, strict=True):
        w, z = 2 * np.pi * hz, 0.05
        e, k = np.exp(-z * w * step), w * np.sqrt(1 - z**2) * step
        c, s = e * np.cos(k), e * np.sin(k) / k
        y = lfilter([1 - s, 2 * (s - c), e**2 - s], [1, -2 * c, e**2], a)
        assert primary == pytest.approx(np.abs(y).max(), rel=2e-4)


def test_convergence_summary_files_and_pictures(tmp_path):
    result = beamsim.run(panel())
    s = result.summary
    assert set(s["srs"]) == {"input acceleration", "middle absolute_acceleration"}
    assert s["srs"]["input acceleration"]["maximax_g"] == pytest.approx(result["srs"]["maximax"].values[0].max() / G)
    assert s["convergence"]["srs"]["input acceleration"] < 1e-9
    assert 0.0 < s["convergence"]["srs"]["middle absolute_acceleration"] < 0.02
    path = write_result(result, tmp_path / "case.h5")
    read = load(path)
    np.testing.assert_array_equal(read["srs"]["maximax"], result["srs"]["maximax"])
    export_result(path, tmp_path / "tables", "csv")
    header = (tmp_path / "tables" / "srs_by_frequency_hz.csv").read_text(encoding="utf-8").splitlines()[0]
    assert header.startswith("frequency (Hz),")
    assert "middle absolute_acceleration maximax" in header


TIP = {"name": "tip", "position": "270 mm", "side": "below", "stiffness": "151 kN/m", "gap": "0.1 mm"}


def released_face(law, coefficient):
    """A beam that bounces on a dashpot whose face returns with a time constant of c / k."""
    return load_scenario(
        {
            "beam": {"length": "270 mm", "width": "50 mm", "thickness": "5 mm", "youngs_modulus": "69 GPa",
                     "density": 2700, "damping": {"kind": "modal", "ratio": 0.01}},
            "snubbers": [TIP | {"law": law, "damping": {"kind": "viscous", "coefficient": coefficient}}],
            "excitation": {"kind": "half_sine", "applied_to": "base", "level": "20 g", "duration": "5 ms"},
            "run": {"duration": 0.02, "sample_rate": "20 kHz", "convergence": "off",
                    "srs": {"quality": 10, "from": "10 Hz", "to": "2 kHz"}},
        }
    )  # fmt: skip


@pytest.mark.parametrize("coefficient", [1.0, 1e-3, 1e-9])
def test_what_decays_at_once_costs_a_few_panels(coefficient):
    """Panels were as short as the time constant of the face throughout the run."""
    counts, spectra = [], []
    for law in ("kelvin_voigt", "no_tension"):
        system = build_system(released_face(law, coefficient))
        motion = simulate(exact_flow(system, 0.02), system.initial_state)
        edges, fastest = smooth_intervals(motion)
        assert edges[0] == 0.0
        assert edges[-1] == motion.end
        counts.append(np.ceil(np.diff(edges) / longest_panel(fastest, 16 * 2000.0)).sum())
        spectra.append(shock_response(system, motion)["maximax"].values[-1])
    assert counts[1] < 1.3 * counts[0] + 20 * motion.time.size
    if coefficient < 1e-2:
        np.testing.assert_allclose(*spectra, rtol=2e-5)  # that of peaks between the ends of panels


def test_a_decay_within_a_panel_is_integrated():
    """An oscillator of 100 Hz behind exp(-t / T) for T = 1 us, whose panels end where 1 - 1e-20 of it are gone."""
    decay, hz, quality = 1e-6, 100.0, 10.0
    until = 45.0 * decay
    times, fastest = np.array([0.0, until, 0.01]), np.array([1.0 / decay, 0.0])
    signal = lambda t: np.exp(-t / decay)[:, None]  # noqa: E731
    peaks = shock_spectra(np.array([hz]), quality, times, signal, fastest)[0, :, 0]
    omega, zeta = 2 * np.pi * hz, 0.5 / quality
    at = np.linspace(0.0, 0.01, 100_001)
    turned, sink = omega * np.sqrt(1 - zeta**2), zeta * omega
    velocity = decay * np.exp(-sink * at)  # of the impulse response, the base having gained T m/s at once
    impulse = velocity * (omega**2 - 2 * sink**2) * np.sin(turned * at) / turned
    impulse += velocity * 2 * sink * np.cos(turned * at)
    assert peaks[0] == pytest.approx(impulse[at > until].max(), rel=1e-3)


def test_samples_of_a_time_stepped_run_agree_and_coarse_ones_warn():
    exact = beamsim.run(panel(run={"convergence": "off", "sample_rate": "40 kHz"}))
    more = {"convergence": "off", "method": "reference", "integrator": "DOP853", "rtol": 1e-9}
    stepped = beamsim.run(panel(run={**more, "sample_rate": "40 kHz"}))
    np.testing.assert_allclose(stepped["srs"]["maximax"], exact["srs"]["maximax"], rtol=0.01)
    assert not [w for w in stepped.warnings if "shock response" in w]
    coarse = beamsim.run(panel(run={**more, "sample_rate": "5 kHz", "duration": 0.02}))
    assert any("run.sample_rate to 20000 Hz" in w for w in coarse.warnings)


def test_a_low_pass_beyond_all_sense_is_refused():
    """It was an internal error: an array was too big."""
    with pytest.raises(ScenarioError) as raised:
        panel(run={"low_pass": 1e14})
    assert "run.low_pass = 1e+14 Hz has" in str(raised.value)
