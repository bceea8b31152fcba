"""Frequencies and amplitudes of spectral lines of sums of sinusoids, which are known in closed form.

Masses on springs of their own, undamped, move as sinusoids; a chain that is held nowhere drifts besides. Half a window,
for what decays, jumps at its beginning, so that its maxima lie off the lines by up to some percent.
"""

import numpy as np
import pytest
from shipped import config_path

import beamsim
from beamsim.cli.tables import table_rows
from tests.helpers.spectra import lines_of, spectrum_of

WINDOWS = ["hann", "decaying", "flattop"]


def lines_of_mass(scenario, window, quantity="displacement", probe="m1"):
    run = {**scenario["run"], "spectrum": {"window": window}, "convergence": "off"}
    result = beamsim.run(beamsim.load_scenario({**scenario, "run": run, "probes": [{"name": "m1", "mass": 1}]}))
    spectrum = spectrum_of(result, quantity, probe)
    return np.array([(line.frequency_hz, line.amplitude) for line in spectrum.lines if line.kind == "other"])


def two_coupled(own_hz, split_hz):
    """Two equal masses, the first deflected by 2 mm: 1 mm each at both natural frequencies."""
    outer = (2 * np.pi * own_hz) ** 2
    inner = 0.5 * ((2 * np.pi * (own_hz + split_hz)) ** 2 - outer)
    return {"masses": [1.0, 1.0], "springs": [outer, inner, outer]}


@pytest.mark.parametrize("window", WINDOWS)
@pytest.mark.parametrize("periods", [3.0, 3.4, 4.9, 7.83, 20.6])
@pytest.mark.parametrize("offset", [0.0, 1.0])
def test_one_sinusoid_of_few_periods_beside_an_offset(window, periods, offset):
    """A mass under its weight swings by 20 mm about a deflection of 0 or 248 mm."""
    k = (2 * np.pi) ** 2
    weight = 9.81 * offset
    case = {
        "chain": {"masses": [1.0], "springs": [k, 0.0]}, "gravity": weight or None,
        "run": {"duration": periods, "start": {"displacement": [0.02 - weight / k]}},
    }  # fmt: skip
    lines = lines_of_mass({key: value for key, value in case.items() if value is not None}, window)
    np.testing.assert_allclose(lines, [[1.0, 0.02]], rtol=1e-8)


@pytest.mark.parametrize("window", WINDOWS)
@pytest.mark.parametrize("bins", [3.0, 3.7, 5.0, 9.3])
def test_two_close_lines(window, bins):
    """Two sinusoids of 1 mm at 10 Hz and some multiples of one over the duration above it, within 5 s."""
    case = {"chain": two_coupled(10.0, bins / 5.0), "run": {"duration": 5.0, "start": {"displacement": [2e-3, 0.0]}}}
    np.testing.assert_allclose(lines_of_mass(case, window), [[10.0, 1e-3], [10.0 + bins / 5.0, 1e-3]], rtol=1e-8)


@pytest.mark.parametrize("quantity", ["displacement", "absolute_acceleration"])
@pytest.mark.parametrize("bins", [0.6, 0.8, 1.0, 1.2, 1.5, 2.0, 2.4])
def test_two_lines_that_share_a_maximum(bins, quantity):
    """Two lines near one another share a maximum, or have two that lie farther apart than they do."""
    hz = np.array([10.0, 10.0 + bins / 5.0])
    case = {"chain": two_coupled(10.0, bins / 5.0), "run": {"duration": 5.0, "start": {"displacement": [2e-3, 0.0]}}}
    amplitude = 1e-3 * (2 * np.pi * hz) ** (0 if quantity == "displacement" else 2)
    np.testing.assert_allclose(lines_of_mass(case, "hann", quantity), np.transpose([hz, amplitude]), rtol=1e-6)


def shaken(*tones):
    """A mass on a spring with 20 % of critical damping and a natural frequency of 5 Hz, on a base with some tones."""
    chain = {"masses": [1.0], "springs": [(10 * np.pi) ** 2, 0.0], "damping": {"kind": "modal", "ratio": 0.2}}
    base = {"kind": "multi_tone", "applied_to": "base", "tones": [{"level": a, "frequency": f} for f, a in tones]}
    return {
        "chain": chain, "excitation": base, "probes": [{"name": "m1", "mass": 1}],
        "run": {"duration": 10.0, "spectrum": {"last": 5.0}, "convergence": "off"},
    }  # fmt: skip


def transmitted(hz):
    """Magnitude of absolute acceleration over that of the base of `shaken`."""
    r = np.asarray(hz) / 5.0
    return np.abs((1 + 0.4j * r) / (1 - r**2 + 0.4j * r))


@pytest.mark.parametrize("bins", [0.7, 1.5, 2.2])
def test_two_frequencies_of_the_base(bins):
    """The second is 0.7 to 2.2 over the duration above the first; after 5 s the start has decayed to 1e-14."""
    hz, level = np.array([10.0, 10.0 + bins / 5.0]), np.array([1.0, 2.0])
    result = beamsim.run(beamsim.load_scenario(shaken(*zip(hz.tolist(), level.tolist(), strict=True))))
    lines = lines_of(result, "absolute_acceleration", "m1")[1:]
    assert [line.frequency_hz for line in lines] == pytest.approx(hz, rel=1e-9)
    assert [line.amplitude for line in lines] == pytest.approx(level * transmitted(hz), rel=1e-7)
    assert all(line.remainder < 1e-7 for line in lines)
    assert "unresolved_lines" not in result.summary


def test_a_line_beside_an_order_of_the_excitation():
    """A free vibration that does not decay, 1.5 over the duration above the frequency of the base."""
    own = 2 * np.pi * 10.3
    scenario = {
        "chain": {"masses": [1.0], "springs": [own**2, 0.0]}, "probes": [{"name": "m1", "mass": 1}],
        "excitation": {"kind": "harmonic", "applied_to": "base", "level": 1.0, "frequency": 10.0},
        "run": {"duration": 5.0, "start": {"displacement": [0.01]}, "convergence": "off"},
    }  # fmt: skip
    lines = lines_of(beamsim.run(beamsim.load_scenario(scenario)), "displacement", "m1")[1:]
    forced = 1.0 / (own**2 - (20 * np.pi) ** 2)  # of -sin: the free vibration begins with the opposite velocity
    free = np.hypot(0.01, forced * 20 * np.pi / own)
    assert [line.kind for line in lines] == ["fundamental", "other"]
    assert [line.frequency_hz for line in lines] == pytest.approx([10.0, 10.3], rel=1e-8)
    assert [line.amplitude for line in lines] == pytest.approx([forced, free], rel=1e-6)


def test_lines_that_are_not_resolved_are_marked():
    """Three tones within 1.5 over the duration: what one line leaves, and a part of the run that tells them apart."""
    close = ((10.0, 1.0), (10.15, 2.0), (10.3, 1.0))
    result = beamsim.run(beamsim.load_scenario(shaken(*close)))
    (line,) = lines_of(result, "absolute_acceleration", "m1")[1:]
    assert line.remainder > 0.1
    marked = next(x for x in result.summary["unresolved_lines"] if x["quantity"] == "absolute_acceleration")
    assert marked["frequency_hz"] == line.frequency_hz
    assert marked["remainder"] == line.remainder
    assert marked["resolution_hz"] == pytest.approx(4.0 / 5.0)
    labels = [label for label, _ in table_rows(result)]
    assert "unresolved lines" in labels
    assert any(text.startswith("resolution") and "0.8 Hz" in text for _, text in table_rows(result))
    longer = 4.0 / 0.15  # s: the tones are then as far apart as the resolution
    assert marked["separating_duration_s"] == pytest.approx(longer, rel=0.25)
    changes = {"run.duration": 5.0 + 1.02 * longer, "run.spectrum.last": 1.02 * longer}
    result = beamsim.run(beamsim.load_scenario(shaken(*close), changes))
    lines = lines_of(result, "absolute_acceleration", "m1")[1:]
    expected = [(f, a * transmitted(f)) for f, a in close]
    np.testing.assert_allclose([(line.frequency_hz, line.amplitude) for line in lines], expected, rtol=1e-6)


def test_a_line_that_decays_is_marked():
    """A free vibration that decays to a third in the record, seen through a whole window: no duration separates it."""
    own, ratio = 2 * np.pi * 10.0, 0.0035
    chain = {"masses": [1.0], "springs": [own**2, 0.0], "damping": {"kind": "modal", "ratio": ratio}}
    scenario = {
        "chain": chain, "probes": [{"name": "m1", "mass": 1}],
        "run": {"duration": 5.0, "start": {"displacement": [0.01]}, "spectrum": {"window": "hann"}},
    }  # fmt: skip
    result = beamsim.run(beamsim.load_scenario(scenario))
    lines = lines_of(result, "displacement", "m1")
    assert [round(line.frequency_hz, 2) for line in lines[1:]] == [10.0]
    unresolved = next(x for x in result.summary["unresolved_lines"] if x["quantity"] == "displacement")
    assert unresolved["remainder"] == lines[1].remainder > 0.02


@pytest.mark.parametrize(("window", "periods"), [("hann", 5.3), ("flattop", 5.3), ("hann", 10.2)])
def test_a_sinusoid_beside_a_drift(window, periods):
    """Two masses joined by a spring, one of them pushed off: each drifts, and swings about the drift at 1 Hz."""
    case = {
        "chain": {"masses": [1.0, 1.0], "springs": [0.0, 0.5 * (2 * np.pi) ** 2, 0.0]},
        "run": {"duration": periods, "start": {"velocity": [0.2, 0.0]}},
    }
    np.testing.assert_allclose(lines_of_mass(case, window), [[1.0, 0.1 / (2 * np.pi)]], rtol=2e-6)


@pytest.mark.parametrize("ratio", [0.003, 0.01])
def test_the_frequency_of_a_decaying_line(ratio):
    """The falling half of a window sees 12 periods of a motion that decays; a maximum lies off by up to some 1e-3."""
    own = 1.0 / np.sqrt(1.0 - ratio**2)
    chain = {"masses": [1.0], "springs": [(2 * np.pi * own) ** 2, 0.0], "damping": {"kind": "modal", "ratio": ratio}}
    case = {"chain": chain, "run": {"duration": 12.0, "start": {"displacement": [0.02]}}}
    lines = lines_of_mass(case, "decaying")
    assert lines[:, 0] == pytest.approx([1.0], abs=2e-4)


def test_the_line_of_stick_and_slip_is_its_rate(pytestconfig):
    """The shipped block on a belt in 4 s: eight periods, of which the first starts from rest.

    Its acceleration is periodic afterwards, at the rate at which the block comes to rest on the belt.
    """
    config = config_path("stick_slip")
    result = beamsim.run(beamsim.load_scenario(config, {"run.sample_rate": "20 kHz", "run.convergence": "off"}))
    sticks = result["histories"]["time"].values[1:][
        np.diff(np.asarray(result["histories"]["friction_stuck"].sel(friction="belt").values, dtype=int)) > 0
    ]
    rate = (sticks.size - 2) / (sticks[-1] - sticks[1])
    for quantity in ("absolute_acceleration", "displacement"):
        spectrum = spectrum_of(result, quantity, "block")
        assert spectrum.window == "hann"
        first = next(line for line in spectrum.lines if line.kind == "other")
        assert first.frequency_hz == pytest.approx(rate, rel=1e-4)
    lines = [line for line in lines_of(result, "absolute_acceleration", "block") if line.kind == "other"]
    orders = np.array([line.frequency_hz for line in lines]) / rate
    np.testing.assert_allclose(orders, np.arange(1, orders.size + 1), rtol=2e-4)


@pytest.mark.parametrize("window", ["hann", "decaying"])
def test_lines_do_not_depend_on_the_size_of_the_motion(window):
    """Two damped masses, whose lines are not steady, and the same motion a hundred million times smaller."""
    two = {**two_coupled(10.0, 1.1), "dashpots": [0.9, 0.0, 0.4]}
    large, small = (
        lines_of_mass({"chain": two, "run": {"duration": 5.0, "start": {"displacement": [size, 0.0]}}}, window)
        for size in (1.0, 1e-8)
    )
    assert large.shape[0] > 1
    np.testing.assert_allclose(small, large * [1.0, 1e-8], rtol=1e-7)
