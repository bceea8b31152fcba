"""The density of a random input: its integral, its lines, how it is written, and what is refused or warned of."""

import numpy as np
import pytest
import pyuff
from scipy.integrate import quad
from scipy.stats import norm

import beamsim
from beamsim.errors import ScenarioError
from beamsim.inputs.density import SpectralDensity, clipped_mean_square, density_of
from beamsim.inputs.excitation import base_motion
from beamsim.scenario import load_scenario
from beamsim.scenario.excitation import RandomInput

G = 9.80665
QUALIFICATION = [(20, 0.01), (80, 0.04), (350, 0.04), (350, 0.001), (2000, 0.0005)]  # with a step


def case(duration=2.0, damping="5 %", **excitation):
    return {
        "chain": {"masses": [1], "springs": [39478.4176], "damping": {"kind": "modal", "ratio": damping}},
        "probes": [{"name": "m", "at": {"mass": 1}}],
        "excitation": {"kind": "random", "applied_to": "base", "seed": 3, **excitation},
        "run": {"duration": duration, "convergence": "off"},
    }


def flat(low, high, density="0.1 g^2/Hz"):
    return [{"frequency": f, "density": density} for f in (low, high)]


def points(*pairs):
    return [{"frequency": f, "density": s} for f, s in pairs]


def given(**excitation):
    return RandomInput.model_validate({"applied_to": "base", **excitation})


def test_the_area_is_that_of_an_independent_integration():
    density = SpectralDensity.from_points(QUALIFICATION)
    pieces = [(20, 80), (80, 350 - 1e-9), (350 + 1e-9, 2000)]
    area = sum(quad(lambda f: float(density(np.array([f]))[0]), *ends, epsrel=1e-11)[0] for ends in pieces)
    assert density.rms**2 == pytest.approx(area, rel=1e-9)
    pink = SpectralDensity.from_points([(10, 3.0), (1000, 0.03)])  # S f = 30, whose integral is a logarithm
    assert pink.rms**2 == pytest.approx(30 * np.log(100), rel=1e-12)


@pytest.mark.parametrize("period", [0.031, 0.4, 1.0, 7.3])
def test_lines_have_the_area_whatever_their_spacing(period):
    density = SpectralDensity.from_points(QUALIFICATION)
    count = int(np.ceil(period * 40_000)) // 2 + 1
    amplitude = density.lines(period, count)
    assert 0.5 * amplitude @ amplitude == pytest.approx(density.rms**2, rel=1e-12)
    k = np.arange(1, count)
    inner = k[(k - 0.5 > 20 * period) & (k + 0.5 < 2000 * period)]
    of_shares = density.mean_squares(np.append(inner - 0.5, inner[-1] + 0.5) / period)
    np.testing.assert_allclose(0.5 * amplitude[inner] ** 2, of_shares, rtol=1e-9)


def test_a_steep_density_loses_no_digits():
    density = SpectralDensity.from_points([(20, 1.0), (2000, 1e-14)])  # S = (f / 20)^-7
    edges = np.linspace(1990, 2000, 11)
    exact = 20**7 / 6 * (edges[:-1] ** -6.0 - edges[1:] ** -6.0)
    np.testing.assert_allclose(density.mean_squares(edges), exact, rtol=1e-9)


@pytest.mark.parametrize(
    ("duration", "psd"),
    [
        (2.0, flat(30, 34)),  # the lines at the two ends were drawn whole: 6 % too much
        (0.5, flat(20, 36)),
        (1.0, flat(20.5, 28.6)),  # ends between lines
        (0.4, [{"frequency": 20, "density": 0.1}, {"frequency": 200, "density": 1.0}]),
    ],
)
def test_the_rms_of_the_input_is_the_root_of_the_area(duration, psd):
    scenario = load_scenario(case(duration, psd=psd))
    expected = density_of(scenario.excitation).rms
    base = base_motion(scenario.excitation, duration).acceleration
    count = 20_000
    samples = base(np.arange(count) * duration / count)
    assert np.sqrt(np.mean(samples**2)) == pytest.approx(expected, rel=1e-4)  # of the spline between samples


def test_the_rms_is_stated_on_the_screen_and_in_the_summary():
    result = beamsim.run(load_scenario(case(psd=flat(30, 34))))
    assert result.summary["inputs"]["excitation"]["rms"] == pytest.approx(np.sqrt(0.1 * 4) * G, rel=1e-12)


@pytest.mark.parametrize(
    ("psd", "duration", "message"),
    [
        (flat(21, 29), 0.1, r"run\.duration = 0\.1 s .*no lines in the band .*21 to 29 Hz.*1 s or more suffices"),
        (flat(30, 34), 1.5, r"7 lines in the band.*2 s or more"),
        (points((20, 0.001), (100, 0.1), (104, 0.1), (500, 0.001)), 1.0, r"plateau .*100 to 104 Hz.*2 s"),
        (
            points((20, 0.001), (99, 0.001), (100, 1.0), (101, 0.001), (500, 0.001)), 1.0, "peak of its .* from 99.8",
        ),
    ],
)  # fmt: skip
def test_too_few_lines_are_refused_with_the_duration_that_suffices(psd, duration, message):
    with pytest.raises(ScenarioError, match=message):
        beamsim.run(load_scenario(case(duration, psd=psd)))


def test_a_longer_period_resolves_a_band_in_a_short_run():
    result = beamsim.run(load_scenario(case(0.1, psd=flat(21, 29), period="1 s")))
    assert result.summary["inputs"]["excitation"]["rms"] == pytest.approx(np.sqrt(0.8) * G)
    with pytest.raises(ScenarioError, match=r"excitation\.period = 0\.5 s.*1 s or more"):
        beamsim.run(load_scenario(case(2.0, psd=flat(21, 29), period="0.5 s")))


def test_a_measured_density_is_not_searched_for_plateaus():
    rng = np.random.default_rng(1)
    measured = np.stack([np.arange(20.0, 520.0), np.round(1.0 + 0.3 * rng.random(500), 2)], axis=1)
    assert [what for what, _, _ in SpectralDensity(*measured.T).features()] == ["band"]


def test_slopes_and_steps_are_those_of_a_specification():
    psd = [
        {"frequency": 20, "slope": "+3 dB/oct"}, {"frequency": 80, "density": "0.04 g^2/Hz"},
        {"frequency": 350, "density": "0.04 g^2/Hz"}, {"frequency": 350, "density": "0.01 g^2/Hz"},
        {"frequency": 700, "slope": "-6 dB/octave"}, {"frequency": 7000, "slope": "-10 dB/dec"},
    ]  # fmt: skip
    table = given(psd=psd).table
    third, half = 10**-0.6, 10**-0.6
    expected = [0.04 * third, 0.04, 0.04, 0.01, 0.01 * half, 0.001 * half]
    assert [f for f, _ in table] == [20, 80, 350, 350, 700, 7000]
    np.testing.assert_allclose([s / G**2 for _, s in table], expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("psd", "message"),
    [
        ([{"frequency": 20}, {"frequency": 80, "density": 1}], r"psd\[0\] needs either density or slope"),
        ([{"frequency": 20, "density": 1}, {"frequency": 80, "density": 1, "slope": 3}], r"psd\[1\] needs either"),
        ([{"frequency": 20, "slope": 3}, {"frequency": 80, "slope": 3}], r"psd\[1\]\.density is missing"),
        (flat(20, 80, 0), r"psd\[0\]\.density = 0 must be positive"),
        (flat(20, 20), r"psd\[1\]\.frequency = 20 Hz is not larger than"),
        ([*flat(20, 20), *flat(20, 80)], "is not larger than"),
        (flat(20, 80, "0.1 N^2/Hz"), r"psd\[0\]\.density is of a force, but the base moves"),
        (flat(20, 80, "0.1 Pa^2/Hz"), "is of a pressure"),
        (flat(20, 80, "0.1 g"), r"psd\[0\]\.density"),
        ([{"frequency": 20, "density": 1}, {"frequency": 80, "slope": "3 dB"}], r"psd\[1\]\.slope"),
        ([{"frequency": 20, "density": 1}, {"frequency": 80, "slope": "500 dB/oct"}], "flatter"),
    ],
)
def test_what_is_no_density_is_refused_where_it_stands(psd, message):
    with pytest.raises(ScenarioError, match=message):
        load_scenario(case(psd=psd))


HEADINGS = [
    ("frequency (Hz),PSD (g^2/Hz)", G**2), ("f [Hz],ASD [g²/Hz]", G**2), ("frequency (Hz),PSD [(m/s^2)^2/Hz]", 1.0),
    ("frequency (kHz),PSD (m2/s3)", 1.0), ("Frequency (Hz),psd (m²/s⁴/Hz)", 1.0),
]  # fmt: skip


@pytest.mark.parametrize(("heading", "unit"), HEADINGS)
def test_a_density_is_read_from_a_file(tmp_path, heading, unit):
    per_hz = 1e3 if "kHz" in heading else 1.0
    rows = [f"{f / per_hz!r},{s!r}" for f, s in QUALIFICATION]
    (tmp_path / "profile.csv").write_text("\n".join([heading, *rows]), encoding="utf-8")
    density = density_of(given(psd="profile.csv"), tmp_path)
    np.testing.assert_allclose(density.frequency_hz, [f for f, _ in QUALIFICATION])
    np.testing.assert_allclose(density.value, [unit * s for _, s in QUALIFICATION], rtol=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("frequency (Hz),PSD\n20,1\n80,1\n", "states no unit"),
        ("frequency (Hz),PSD (g^2/Hz)\n20,1\n80,0\n", "level 0 in row 2"),
        ("frequency (Hz),PSD (N^2/Hz)\n20,1\n80,1\n", "acceleration spectral density"),
        ("frequency (Hz),PSD (g)\n20,1\n80,1\n", "acceleration spectral density"),
        ("frequency (Hz),PSD (g^2/Hz)\n20,1\n10,1\n", "do not increase at row 2"),
        ("frequency (Hz),PSD (g^2/Hz)\n20,1\n20,1\n80,1\n", "do not increase at row 2"),
    ],
)
def test_a_file_without_a_density_is_refused(tmp_path, text, message):
    (tmp_path / "profile.csv").write_text(text, encoding="utf-8")
    with pytest.raises(ScenarioError, match=message):
        density_of(given(psd="profile.csv"), tmp_path)


def test_a_run_with_a_density_in_a_file_is_that_with_points(tmp_path):
    (tmp_path / "profile.csv").write_text("frequency (Hz),PSD (g^2/Hz)\n20,0.01\n60,0.01\n", encoding="utf-8")
    runs = [
        beamsim.run(load_scenario(case(psd=psd)))
        for psd in (flat(20, 60, "0.01 g^2/Hz"), str(tmp_path / "profile.csv"))
    ]
    np.testing.assert_array_equal(*(run["histories"]["displacement"].sel(probe="m").values for run in runs))
    assert not any("linear_open" in run["random"] for run in runs)


def test_clipping_bounds_the_input_between_samples_and_states_its_rms():
    """The mean square of a clipped Gaussian signal by its distribution; a base that is clipped does not drift."""
    density = density_of(given(psd=flat(20, 200)))
    for sigmas in (1.5, 3.0):
        inside, _ = quad(lambda x: x**2 * norm.pdf(x), -sigmas, sigmas)
        closed = inside + 2 * sigmas**2 * norm.sf(sigmas)
        assert clipped_mean_square(sigmas) == pytest.approx(closed, rel=1e-9)
        excitation = given(psd=flat(20, 200), clip=f"{sigmas} sigma", seed=5)
        motion = base_motion(excitation, 20.0)
        samples = motion.acceleration(np.arange(400_000) / 20_000)
        assert np.abs(samples).max() == pytest.approx(sigmas * density.rms, rel=1e-3)
        assert np.mean(samples**2) == pytest.approx(closed * density.rms**2, rel=0.02)
        assert motion.account.statement.rms == pytest.approx(np.sqrt(closed) * density.rms, rel=1e-12)
        ends = motion.velocity(np.array([0.0, 20.0]))
        assert ends[1] == pytest.approx(ends[0], abs=1e-3 * np.abs(motion.velocity(np.arange(2000) / 100)).max())


@pytest.mark.parametrize("clip", ["3 sigma", "3", 3, "3.0 σ", "3 sigmas"])
def test_clipping_is_written_in_sigmas(clip):
    assert given(psd=flat(20, 200), clip=clip).clip == 3.0


def test_a_mode_that_is_narrower_than_the_lines_is_warned_of():
    narrow = beamsim.run(load_scenario(case(psd=flat(20, 60), damping="0.5 %")))
    (warning,) = [text for text in narrow.warnings if "half-power" in text]
    # 2 * 0.005 * 31.62 Hz = 0.316 Hz; lines are 0.5 Hz apart; a quarter of the bandwidth needs 12.6 s
    assert "0.5 Hz apart, which is 1.6 of" in warning
    assert "12.6 s" in warning
    for wide in (case(psd=flat(20, 60), damping="10 %"), case(psd=flat(20, 60), damping="0.5 %", period="13 s")):
        assert not any("half-power" in text for text in beamsim.run(load_scenario(wide)).warnings)


def test_the_density_of_an_analyser_is_read_from_a_universal_file(tmp_path):
    f = np.arange(0.0, 201.0, 5.0)
    uff = {
        "type": 58, "binary": 0, "func_type": 9, "rsp_ent_name": "base", "rsp_node": 1, "rsp_dir": 3,
        "ref_ent_name": "base", "ref_node": 1, "ref_dir": 3, "id1": "base", "id2": "NONE", "id3": "NONE",
        "id4": "NONE", "id5": "NONE", "abscissa_spacing": 1, "abscissa_spec_data_type": 18, "abscissa_axis_lab": "f",
        "abscissa_axis_units_lab": "Hz", "ordinate_spec_data_type": 12, "ordinate_axis_lab": "PSD",
        "ordinate_axis_units_lab": "g^2/Hz", "orddenom_spec_data_type": 0, "x": f, "data": np.full(f.size, 0.01),
    }  # fmt: skip
    pyuff.UFF(str(tmp_path / "psd.uff")).write_sets([uff], mode="overwrite")
    density = density_of(given(psd="psd.uff"), tmp_path)
    assert density.rms == pytest.approx(np.sqrt(0.01 * 195.0) * G, rel=1e-6)
    pyuff.UFF(str(tmp_path / "two.uff")).write_sets([uff, {**uff, "id1": "tip"}], mode="overwrite")
    with pytest.raises(ScenarioError, match="2 power spectral densities"):
        density_of(given(psd="two.uff"), tmp_path)
