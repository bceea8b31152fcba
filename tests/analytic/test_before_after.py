"""Resonances before and after a test: closed forms, independent integration, and properties of the comparison."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import TransferFunction, lsim

import beamsim
from beamsim.signals.resonance_peaks import pair_peaks, peaks_of
from beamsim.signals.sweep_rate import is_beat, is_too_narrow, largest_displacement, sweep_effect

FREQUENCY = np.arange(20.0, 200.0, 0.05)


def receptance(*modes, frequency=FREQUENCY):
    """Sum of modes (natural frequency, damping ratio, static response)."""
    return sum(a / (1 - (frequency / fn) ** 2 + 2j * z * frequency / fn) for fn, z, a in modes)


def write(path, columns, header):
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="", fmt="%.9g")
    return str(path)


@pytest.fixture
def compare(tmp_path):
    """Compare two responses over frequency, which are amplitudes in g."""

    def compared(before, after, header="frequency (Hz),tip (g)", frequency=(FREQUENCY, FREQUENCY), **section):
        files = [
            write(tmp_path / f"{side}.csv", [f, *np.atleast_2d(y)], header)
            for side, f, y in zip(("before", "after"), frequency, (before, after), strict=True)
        ]
        record = section.pop("record", {})
        limits = section.pop("limits", None)
        records = {side: {"file": file, **record} for side, file in zip(("before", "after"), files, strict=True)}
        return beamsim.compare_tests({"before_after": {**records, **section}, "limits": limits})

    return compared


def test_shifts_of_two_modes_are_those_of_the_closed_form(compare):
    """The peak of a receptance is at fn sqrt(1 - 2 z^2), with 1 / (2 z sqrt(1 - z^2)) times the static response."""
    before, after = [(50.0, 0.01, 1.0), (130.0, 0.02, 0.4)], [(47.0, 0.012, 1.0), (131.3, 0.02, 0.4)]
    result = compare(np.abs(receptance(before[0])), np.abs(receptance(after[0])))
    (shift,) = result.pairs[0].resonances
    at = [fn * np.sqrt(1 - 2 * z**2) for fn, z, _ in (before[0], after[0])]
    height = [1 / (2 * z * np.sqrt(1 - z**2)) for _, z, _ in (before[0], after[0])]
    assert shift.frequency.change == pytest.approx(at[1] / at[0] - 1, abs=2e-6)
    assert shift.amplitude.change == pytest.approx(height[1] / height[0] - 1, abs=1e-4)
    assert shift.damping.change == pytest.approx(0.2, abs=2e-3)
    assert shift.before_level == pytest.approx(height[0] * 9.80665, rel=1e-4)
    assert shift.frequency.significant
    assert shift.amplitude.significant
    assert shift.damping.significant
    assert result.summary["margins"]["frequency_shift"]["verdict"] == "exceeded"  # 6 %
    assert result.summary["margins"]["amplitude_shift"]["verdict"] == "ok"  # 16.7 %
    both = compare(np.abs(receptance(*before)), np.abs(receptance(*after))).pairs[0].resonances
    assert [each.frequency.change for each in both] == pytest.approx([-0.06, 0.01], abs=2e-4)
    assert not both[1].damping.significant


def test_exchanging_before_and_after_changes_the_sign(compare):
    """Every ratio is inverted; what is significant stays so."""
    rng = np.random.default_rng(3)
    for _ in range(5):
        first, second = (
            np.abs(receptance(*((fn * rng.uniform(0.95, 1.05), rng.uniform(0.01, 0.03), 1.0) for fn in (40, 70, 120))))
            for _ in range(2)
        )
        one, other = compare(first, second).pairs[0].resonances, compare(second, first).pairs[0].resonances
        assert len(one) == len(other) >= 3
        for a, b in zip(one, sorted(other, key=lambda each: each.after_hz), strict=True):
            for name in ("frequency", "amplitude", "damping"):
                change, back = getattr(a, name), getattr(b, name)
                assert (1 + change.change) * (1 + back.change) == pytest.approx(1.0, rel=1e-9)
                assert change.significant == back.significant
                assert change.resolution == pytest.approx(back.resolution, rel=1e-9)


def test_other_units_and_sampling_change_nothing(compare, tmp_path):
    """A file in g with fine lines, and one in m/s^2 over kHz with other lines."""
    coarse = np.arange(20.0, 200.0, 0.11)
    before = write(tmp_path / "b.csv", [FREQUENCY, np.abs(receptance((50, 0.02, 1.0)))], "frequency (Hz),tip (g)")
    y = 9.80665 * np.abs(receptance((50, 0.02, 1.0), frequency=coarse))
    after = write(tmp_path / "a.csv", [coarse / 1000, y], "frequency (kHz),sensor 7 (m/s^2)")
    result = beamsim.compare_tests({"before_after": {"before": before, "after": after}})
    (shift,) = result.pairs[0].resonances
    assert abs(shift.frequency.change) < 2e-5
    assert abs(shift.amplitude.change) < 1e-3
    assert not (shift.frequency.significant)
    assert not (shift.amplitude.significant)
    assert not (shift.damping.significant)
    assert all(margin["verdict"] == "ok" for margin in result.summary["margins"].values())


def test_powers_have_the_shifts_of_amplitudes(compare):
    before, after = (np.abs(receptance((fn, 0.02, 1.0))) for fn in (50.0, 48.0))
    (of_amplitude,) = compare(before, after).pairs[0].resonances
    of_power = compare(before**2, after**2, "frequency (Hz),tip (g^2/Hz)").pairs[0]
    assert of_power.unit == "m/s^2/Hz^0.5"
    (shift,) = of_power.resonances
    for name in ("frequency", "amplitude", "damping"):
        assert getattr(shift, name).change == pytest.approx(getattr(of_amplitude, name).change, rel=1e-6, abs=1e-8)


@pytest.mark.parametrize("vanished", [True, False])
def test_a_resonance_without_partner_is_beyond_the_limit(compare, vanished):
    two, one = np.abs(receptance((50, 0.01, 1.0), (90, 0.01, 0.5))), np.abs(receptance((50, 0.01, 1.0)))
    result = compare(*((two, one) if vanished else (one, two)))
    paired, lone = result.pairs[0].resonances
    assert paired.is_paired
    assert not lone.is_paired
    assert np.isnan(lone.after_hz if vanished else lone.before_hz)
    margin = result.summary["margins"]["frequency_shift"]
    assert margin["verdict"] == "exceeded"
    assert margin["value"] == 0.15
    assert margin["at"].endswith("vanished" if vanished else "appeared")
    wide = compare(*((two, one) if vanished else (one, two)), limits={"frequency_shift": "20 %"})
    assert wide.summary["margins"]["frequency_shift"]["verdict"] == "not reliable"  # it may have moved by more


def test_close_peaks_have_no_damping_and_are_paired_in_their_order(compare):
    """Half-power bands overlap, so that their width is that of no resonance."""
    before, after = (np.abs(receptance(*((fn * shift, 0.004, 1.0) for fn in (50.0, 50.8)))) for shift in (1.0, 1.03))
    found = peaks_of(FREQUENCY, before)
    assert len(found) == 2
    shifts = compare(before, after).pairs[0].resonances
    assert [each.frequency.change for each in shifts] == pytest.approx([0.03, 0.03], abs=1e-3)
    assert pair_peaks([50.0, 55.0, 90.0], [54.0, 59.4]) == {0: 0, 1: 1}  # not the nearest alone
    assert pair_peaks([50.0, 60.0], [58.0]) == {1: 0}
    assert pair_peaks([50.0], [60.0]) == {}
    assert pair_peaks([], [1.0]) == {}


def test_overlapping_bands_have_no_q():
    shape = np.abs(receptance((50.0, 0.01, 1.0), (51.1, 0.01, 1.0)))
    assert all(np.isnan(peak.quality) for peak in peaks_of(FREQUENCY, shape))
    assert len(peaks_of(FREQUENCY, shape)) == 2


def test_noise_has_no_resonances_and_decides_no_limit(compare):
    rng = np.random.default_rng(5)
    noise = [np.exp(0.15 * rng.normal(size=FREQUENCY.size)) for _ in range(2)]
    result = compare(*noise)
    assert result.pairs[0].resonances == ()
    assert "neither test has a peak" in " ".join(result.warnings)
    assert all(margin["verdict"] == "not reliable" for margin in result.summary["margins"].values())


@pytest.mark.parametrize("noise", [0.003, 0.02])
def test_noise_alone_is_seldom_significant(compare, noise):
    """Forty pairs of one oscillator with noise: at most two in twenty are beyond two standard deviations."""
    rng = np.random.default_rng(7)
    true = np.abs(receptance((50.0, 0.02, 1.0), frequency=FREQUENCY[::2]))
    wrong = dict.fromkeys(("frequency", "amplitude", "damping"), 0)
    for _ in range(10):
        pair = [true * (1 + noise * rng.normal(size=true.size)) for _ in range(2)]
        (shift,) = compare(*pair, frequency=(FREQUENCY[::2],) * 2).pairs[0].resonances
        for name in wrong:
            wrong[name] += getattr(shift, name).significant
    assert max(wrong.values()) <= 1


# --- Sweep rate ------------------------------------------------------------------------------------------------------


def integrated_sweep(natural, damping, rate, first, last):
    """Fundamental of an oscillator under a base swept linearly, by its complex amplitude over the phase of the sweep.

    x = Re z e^{i phi}, z'' + 2 (i w + zeta wn) z' + (wn^2 - w^2 + 2 i zeta wn w + i w') z = wn^2, exactly.
    """
    wn = 2 * np.pi * natural
    sign = np.sign(last - first)
    end = abs(last - first) / rate

    def slope(t, state):
        z, v = state
        w, dw = 2 * np.pi * (first + sign * rate * t), sign * 2 * np.pi * rate
        force = wn**2 - (wn**2 - w**2 + 2j * damping * wn * w + 1j * dw) * z
        return [v, force - 2 * (1j * w + damping * wn) * v]

    w = 2 * np.pi * first
    start = wn**2 / (wn**2 - w**2 + 2j * damping * wn * w)
    times = np.linspace(0.0, end, 4001)
    solved = solve_ivp(slope, (0.0, end), [complex(start), 0j], t_eval=times, rtol=1e-6, atol=1e-6, method="DOP853")
    f, z = first + sign * rate * times, np.abs(solved.y[0])
    return (f, z) if sign > 0 else (f[::-1], z[::-1])


@pytest.mark.parametrize(("number", "falling"), [(0.3, False), (0.6, False), (0.6, True), (2.0, False)])
def test_what_a_sweep_explains_is_what_an_independent_integration_gives(number, falling):
    """Q = 50 at 65 Hz, a rate of ``number`` f^2 / Q^2; first order in the displacement, which is below 2 %."""
    natural, quality = 65.0, 50.0
    rate = number * natural**2 / quality**2
    ends = (57.0, 73.0)
    f, z = integrated_sweep(natural, 0.5 / quality, rate, *(ends[::-1] if falling else ends))
    peak = max(peaks_of(f, z), key=lambda each: each.level)
    effect = sweep_effect(peak.frequency_hz, peak.quality, -rate if falling else rate)
    assert peak.frequency_hz / effect.frequency == pytest.approx(natural, rel=1e-3)
    assert peak.level / effect.amplitude == pytest.approx(quality, rel=0.015)
    assert 1 / (peak.quality * effect.damping) == pytest.approx(1 / quality, rel=0.03)
    assert (peak.frequency_hz < natural) == falling
    assert abs(peak.frequency_hz - natural) < abs(largest_displacement(rate))


@pytest.mark.parametrize("number", [0.5, 1.0, 2.0, 4.0])
def test_the_height_is_that_of_cronins_formula(number):
    """1 - exp(-2.86 n^-0.445) with n = rate Q^2 / f^2 (D. L. Cronin 1968), which he fitted to within 2 %."""
    natural, quality = 65.0, 50.0
    rate = number * natural**2 / quality**2
    f, z = integrated_sweep(natural, 0.5 / quality, rate, 57.0, 75.0)
    top = max(peaks_of(f, z), key=lambda each: each.level)
    formula = 1.0 - np.exp(-2.86 * number**-0.445)
    assert top.level / quality == pytest.approx(formula, rel=0.025)
    assert sweep_effect(top.frequency_hz, top.quality, rate).amplitude == pytest.approx(formula, rel=0.025)


def test_without_damping_the_displacement_is_that_of_a_cornu_spiral():
    """The largest |C(v) + i S(v) + (1 + i) / 2| is at v = 1.217, and the frequency there is v sqrt(rate / 2) higher."""
    from scipy.special import fresnel

    v = np.linspace(0.0, 3.0, 30001)
    sine, cosine = fresnel(v)
    top = v[np.argmax(np.abs(cosine + 1j * sine + 0.5 + 0.5j))]
    assert largest_displacement(4.0) == pytest.approx(top * np.sqrt(2.0), rel=1e-3)
    assert largest_displacement(-4.0) == -largest_displacement(4.0)


def test_beats_behind_a_resonance_are_recognised():
    natural, quality, rate = 50.0, 50.0, 2.3
    f, z = integrated_sweep(natural, 0.5 / quality, rate, 40.0, 65.0)
    peaks = peaks_of(f, z)
    top = max(peaks, key=lambda each: each.level)
    lower = [each for each in peaks if each is not top]
    assert lower
    assert all(is_beat(each.frequency_hz, top.frequency_hz, top.quality, rate) for each in lower)
    assert not is_beat(45.0, top.frequency_hz, top.quality, rate)
    assert not is_beat(60.0, top.frequency_hz, top.quality, rate)


@pytest.mark.parametrize("number", [0.3, 2.0, 30.0])
def test_no_resonance_is_narrower_than_a_sweep_allows(number):
    """Also with so little damping that the free vibration lasts longer than the sweep."""
    natural, quality = 65.0, 50.0 * np.sqrt(number)
    f, z = integrated_sweep(natural, 0.5 / quality, natural**2 / 50.0**2, 58.0, 72.0)
    top = max(peaks_of(f, z), key=lambda each: each.level)
    assert not is_too_narrow(top.frequency_hz, top.quality, natural**2 / 50.0**2)


def test_beats_behind_a_jump_are_no_resonances(compare):
    """A response that drops, and ripples of the free vibration that it leaves behind, at 2 Hz/s."""
    f = np.arange(40.0, 80.0, 0.01)
    time = (f - 60.0) / 2.0
    ripple = 0.6 * np.exp(-0.5 * np.abs(time)) * np.cos(2 * np.pi * (6.0 * time + time**2))
    bent = np.where(f < 60.0, np.abs(receptance((60.0, 0.02, 1.0), frequency=f)), 4.0 * (1.0 + ripple))
    record = {"sweep": {"from": "20 Hz", "to": "200 Hz", "rate": "2 Hz/s"}}
    assert len(compare(bent, bent, frequency=(f, f)).pairs[0].resonances) > 1
    (shift,) = compare(bent, bent, frequency=(f, f), record=record).pairs[0].resonances
    assert shift.before_hz == pytest.approx(60.0, abs=0.1)


def swept_record(path, natural, damping, first, last, octaves_per_minute, late=0.3):
    """Record of an oscillator on a base that follows a logarithmic sweep; its level rises for half a second. In g."""
    growth = octaves_per_minute / 60 * np.log(2.0) * np.sign(last - first)
    time = np.arange(0.0, np.log(last / first) / growth, 1 / 800.0)
    base = np.minimum(2.0 * time, 1.0) * np.sin(2 * np.pi * first * np.expm1(growth * time) / growth)
    w = 2 * np.pi * natural
    tip = lsim(TransferFunction([2 * damping * w, w**2], [1, 2 * damping * w, w**2]), base, time)[1]
    return write(path, [time + late, base, tip], "time (s),base (g),tip (g)")


@pytest.mark.parametrize("reference", [None, "base"])
def test_a_sweep_up_and_one_down_of_one_structure_do_not_differ(tmp_path, reference):
    up, down = ({"from": a, "to": b, "rate": "12 oct/min"} for a, b in (("40 Hz", "60 Hz"), ("60 Hz", "40 Hz")))
    record = {} if reference is None else {"reference": reference}
    section = {
        "before": {"file": swept_record(tmp_path / "up.csv", 50.0, 0.02, 40.0, 60.0, 12.0), "sweep": up, **record},
        "after": {"file": swept_record(tmp_path / "down.csv", 50.0, 0.02, 60.0, 40.0, 12.0), "sweep": down, **record},
        "channels": ["tip"],
    }
    result = beamsim.compare_tests({"before_after": section})
    (pair,) = result.pairs
    (shift,) = pair.resonances
    assert pair.unit == ("m/s^2" if reference is None else "1")
    assert shift.frequency.change < -0.02  # of the two directions
    # without the excitation the beginning of so short a sweep is found to half a percent of the frequency only
    assert shift.frequency.change == pytest.approx(shift.frequency.of_sweep, abs=6e-3 if reference is None else 2e-3)
    assert not (shift.frequency.significant)
    assert not (shift.amplitude.significant)
    assert not (shift.damping.significant)
    assert result.summary["margins"]["frequency_shift"]["verdict"] == "ok"


def test_a_loosened_structure_is_found_in_records_of_opposite_sweeps(tmp_path):
    up, down = ({"from": a, "to": b, "rate": "12 oct/min"} for a, b in (("40 Hz", "60 Hz"), ("60 Hz", "40 Hz")))
    section = {
        "before": {
            "file": swept_record(tmp_path / "down.csv", 50.0, 0.02, 60.0, 40.0, 12.0),
            "sweep": down,
            "reference": "base",
        },
        "after": {
            "file": swept_record(tmp_path / "up.csv", 48.0, 0.02, 40.0, 60.0, 12.0),
            "sweep": up,
            "reference": "base",
        },
        "channels": ["tip"],
    }
    (shift,) = beamsim.compare_tests({"before_after": section}).pairs[0].resonances
    assert shift.frequency.change > -0.02  # the directions hide half of it
    assert (1 + shift.frequency.change) / (1 + shift.frequency.of_sweep) - 1 == pytest.approx(-0.04, abs=3e-3)
    assert shift.frequency.significant


# --- Random tests ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("natural", "reference"), [(50.0, "base"), (47.0, "base"), (47.0, None)])
def test_shifts_of_random_tests(tmp_path, natural, reference):
    rng, time = np.random.default_rng(11), np.arange(0.0, 64.0, 1 / 160.0)
    files = []
    for name, fn in (("before", 50.0), ("after", natural)):
        base, w = rng.normal(size=time.size), 2 * np.pi * fn
        tip = lsim(TransferFunction([0.04 * w, w**2], [1, 0.04 * w, w**2]), base, time)[1]
        files.append(write(tmp_path / f"{name}.csv", [time, base, tip], "time (s),base (g),tip (g)"))
    record = {"line_spacing": "0.625 Hz"} | ({} if reference is None else {"reference": reference})
    section = {"before": {"file": files[0], **record}, "after": {"file": files[1], **record}, "channels": ["tip"]}
    result = beamsim.compare_tests({"before_after": section, "limits": {"frequency_shift": "2 %"}})
    (shift,) = result.pairs[0].resonances
    assert shift.frequency.change == pytest.approx(natural / 50.0 - 1.0, abs=shift.frequency.resolution)
    assert shift.frequency.significant == (natural != 50.0)
    assert not shift.amplitude.significant
    assert not shift.damping.significant
    verdict = result.summary["margins"]["frequency_shift"]["verdict"]
    assert verdict == ("exceeded" if natural != 50.0 else "ok" if shift.frequency.highest <= 0.02 else "not reliable")
