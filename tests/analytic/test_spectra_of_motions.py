"""Spectra of motions in closed form: no line is an alias, whatever the output rate."""

import numpy as np
import pytest

import beamsim
from beamsim.cli.tables import table_rows
from tests.helpers.spectra import spectra_by_signal, spectrum_of

BEAM = {
    "length": 0.7, "width": 0.05, "thickness": 0.005, "youngs_modulus": 69e9, "density": 2700,
    "damping": {"kind": "modal", "ratio": 0.001},
}  # fmt: skip
TIP = {"name": "tip", "position": 0.7, "side": "below", "stiffness": 1e5, "gap": 0.05}
RELEASED = {
    "beam": BEAM, "snubbers": [TIP], "excitation": {"kind": "none"},
    "run": {"duration": 1.0, "sample_rate": 2000, "start": {"released_force": {"position": 0.7, "force": 5.0}}},
}  # fmt: skip
BOUNCING = {
    "beam": BEAM,
    "snubbers": [{**TIP, "gap": 0.0, "damping": {"kind": "viscous", "coefficient": 20.0}}],
    "excitation": {"kind": "harmonic", "applied_to": "base", "level": "2 g", "frequency": 20.0},
    "run": {"duration": 0.5},
    "reduction": {"modes": 5},
}  # fmt: skip


def run(case, **changes):
    return beamsim.run(beamsim.load_scenario(case, {key.replace("__", "."): value for key, value in changes.items()}))


def lines_of(result, quantity="absolute_acceleration"):
    return spectrum_of(result, quantity).lines


def test_every_line_of_a_released_beam_is_a_mode():
    """At 2 kHz, samples fold the mode at 1317 Hz to 683 Hz, and the residual vector's 2310 Hz to 310 Hz."""
    result = run(RELEASED)
    kept = result.summary["open_frequencies_hz"][: result.summary["kept_modes"]]
    found = [line.frequency_hz for line in lines_of(result) if line.kind == "other"]
    assert found == pytest.approx(kept, abs=0.1)
    assert result.summary["events"] == 0


@pytest.mark.parametrize(("periods", "seen"), [(1.0, False), (2.6, True), (5.0, True), (10.0, True)])
def test_the_highest_line_is_told_by_what_lies_beyond_it(periods, seen):
    """One mass swings freely: the spectrum ended at its frequency, and the table said "a continuous spectrum"."""
    chain = {"masses": [1.0], "springs": [(10 * np.pi) ** 2, 0]}
    free = {"chain": chain, "run": {"duration": periods / 5.0, "start": {"displacement": [1e-3]}}}
    result = run(free)
    found = [line.frequency_hz for line in lines_of(result) if line.kind == "other"]
    assert found == pytest.approx([5.0] * seen, rel=1e-3)
    assert any("other" in text for _, text in table_rows(result)) == bool(seen)


def test_lines_and_rms_of_a_mass_on_a_spring():
    """A released undamped mass: a cosine, seen through any window as its amplitude."""
    case = {
        "chain": {"masses": [1.0], "springs": [(2 * np.pi * 5.3) ** 2, 0.0]},
        "excitation": {"kind": "none"},
        "run": {"duration": 7.7, "sample_rate": 11.0, "start": {"displacement": [0.02]}},
    }
    result = run(case)
    spectrum = spectrum_of(result, "displacement")
    (line,) = (line for line in spectrum.lines if line.kind == "other")
    assert line.frequency_hz == pytest.approx(5.3, abs=1e-3)
    assert line.amplitude == pytest.approx(0.02, rel=1e-4)
    turn = 2 * np.pi * 5.3 * 7.7
    assert spectrum.rms == pytest.approx(0.02 * np.sqrt(0.5 + np.sin(2 * turn) / (4 * turn)), rel=1e-10)
    assert result.summary["rms_displacement_m"][spectrum.name] == spectrum.rms


def test_a_shock_is_seen_from_its_beginning():
    shock = {
        "beam": {**BEAM, "damping": {"kind": "modal", "ratio": 0.03}},
        "excitation": {"kind": "half_sine", "applied_to": "base", "level": "20 g", "duration": "5 ms"},
        "run": {"duration": 2.0},
    }
    by_default, through_hann = run(shock), run(shock, run__spectrum__window="hann")
    window = set(by_default["spectra"]["window"].values.tolist())
    assert window == {"decaying"}
    first, second = (
        {line.frequency_hz for line in lines_of(r) if line.kind == "other"} for r in (by_default, through_hann)
    )
    modes = by_default.summary["open_frequencies_hz"]
    seen = [sum(any(abs(f - mode) < 0.03 * mode for f in found) for mode in modes[:4]) for found in (first, second)]
    assert seen[0] == 4
    level = [max(line.amplitude_db for line in lines_of(r) if line.kind == "other") for r in (by_default, through_hann)]
    assert level[0] > level[1] + 6.0


def test_amplitudes_at_chosen_frequencies(tmp_path):
    """A mass that swings at 5.3 Hz with an amplitude of 20 mm; nothing is at 9 Hz; 5.3 Hz is listed as it is given."""
    case = {
        "chain": {"masses": [1.0], "springs": [(2 * np.pi * 5.3) ** 2, 0.0]},
        "run": {"duration": 7.7, "sample_rate": 11.0, "start": {"displacement": [0.02]},
                "spectrum": {"frequencies": [5.3, 9.0]}},
    }  # fmt: skip
    result = run(case)
    spectrum = spectrum_of(result, "displacement")
    chosen = {line.frequency_hz: line.amplitude for line in spectrum.lines if line.kind == "chosen"}
    assert chosen == pytest.approx({5.3: 0.02, 9.0: 0.0}, rel=1e-9, abs=1e-12)
    assert not any(line.kind == "other" for line in spectrum.lines)
    assert spectrum.frequency_hz[-1] >= 9.0 - 0.2
    assert any("9 Hz" in text for _, text in table_rows(result))
    stored = beamsim.load(beamsim.write_result(result, tmp_path / "run.h5"))
    kept = spectrum_of(stored, "displacement", spectrum.name).lines
    assert [(k.frequency_hz, k.amplitude, k.kind) for k in kept] == [
        (k.frequency_hz, k.amplitude, k.kind) for k in spectrum.lines
    ]


BETWEEN_STOPS = {
    "chain": {"masses": [1.0], "springs": [0.0]}, "gravity": 9.81,
    "snubbers": [
        {"name": name, "mass": 1, "side": name, "stiffness": 1e5, "gap": 0.01} for name in ("below", "above")
    ],
    "run": {"duration": 2.0, "start": {"velocity": [-1.0]}, "convergence": "off"},
}  # fmt: skip


@pytest.mark.parametrize("highest", [None, 200.0, 2000.0])
def test_lines_of_a_mass_between_stops_are_multiples_of_its_frequency(highest):
    """Its acceleration has harmonics far beyond the curve, which showed as a peak at 35.5 Hz and as lines."""
    result = run(BETWEEN_STOPS, **({} if highest is None else {"run__spectrum__to": highest}))
    spectrum = spectrum_of(result, "absolute_acceleration")
    found = [line for line in spectrum.lines if line.kind != "mean"]
    closings = result["events"]["time"].values[
        result["events"]["closing"].values & (result["events"]["snubber"].values == 0)
    ]
    frequency = 1.0 / np.diff(closings).mean()
    orders = np.array([line.frequency_hz for line in found]) / frequency
    assert len(found) >= 3
    np.testing.assert_allclose(orders, np.rint(orders), atol=1e-5)
    assert np.unique(np.rint(orders)).size == len(found)
    near = (spectrum.frequency_hz > 1.7 * frequency) & (spectrum.frequency_hz < 2.3 * frequency)
    beside = near & (np.abs(spectrum.frequency_hz - 2.0 * frequency) > 1.5)
    assert spectrum.amplitude[beside].max() < 2e-3 * spectrum.amplitude.max()
    strongest = max(found, key=lambda line: line.amplitude)
    assert all(line.amplitude >= 1e-3 * strongest.amplitude for line in found)


def test_lines_and_levels_do_not_depend_on_how_far_the_curve_goes():
    few, many = (run(BETWEEN_STOPS, run__spectrum__to=highest) for highest in (60.0, 2000.0))
    others_of = spectra_by_signal(many["spectra"])
    for key, spectrum in spectra_by_signal(few["spectra"]).items():
        others, least = others_of[key].lines, 1e-6 * max(line.amplitude for line in spectrum.lines)
        for line in spectrum.lines:
            same = min(others, key=lambda k, at=line.frequency_hz: abs(k.frequency_hz - at))
            assert same.frequency_hz == pytest.approx(line.frequency_hz, rel=1e-6)
            assert same.amplitude == pytest.approx(line.amplitude, rel=1e-5, abs=least)
            if line.kind != "mean":
                assert same.amplitude_db == pytest.approx(line.amplitude_db, abs=1e-4)


@pytest.mark.parametrize("highest", [None, 100.0, 65.0, 45.0, 20.0, 10.0])
def test_orders_of_a_few_periods_end_with_the_spectrum(highest):
    """A mass against a stop for 6.4 periods: orders beyond the end of its spectrum were looked for, and an error."""
    periods, frequency = 6.4, 20.0
    case = {
        "chain": {"masses": [1.0], "springs": [(2 * np.pi * 30.0) ** 2], "damping": {"kind": "modal", "ratio": 0.05}},
        "snubbers": [{"name": "stop", "mass": 1, "side": "below", "gap": 1e-4, "stiffness": 1e5}],
        "excitation": {"kind": "harmonic", "applied_to": "base", "level": "2 g", "frequency": frequency},
        "run": {"duration": periods / frequency, "convergence": "off"},
    }  # fmt: skip
    all_orders = {line.order: line.amplitude for line in lines_of(run(case))}
    found = {line.order: line.amplitude for line in lines_of(run(case, run__spectrum__to=highest))}
    assert max(all_orders) >= 3.0
    ends_at = 10.0 if highest is None else highest // frequency
    assert list(found) == [order for order in all_orders if order <= ends_at]
    if highest is None:
        assert found == all_orders
