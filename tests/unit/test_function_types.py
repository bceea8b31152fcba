"""Function types: what a channel is a function of, and what may be used for what."""

import h5py
import numpy as np
import pytest

from beamsim.errors import InputFileError, ScenarioError
from beamsim.inputs.measured import read_record
from beamsim.measurements.channels import history_named, read_tests
from beamsim.measurements.functions import BY_NUMBER, FunctionType, function_over_frequency, ratio_of
from beamsim.measurements.read import read_file
from beamsim.scenario import load_scenario
from beamsim.scenario.excitation import SampledInput
from beamsim.signals.harmonics import harmonics_of
from tests.helpers.universal_files import NO_LABEL, OVER_FREQUENCY, amplitudes, function, units

pytestmark = pytest.mark.quick

Y = np.sin(np.arange(24.0))
G = 9.80665


def channel(tmp_path, *sets, encoding="ascii", name="a.uff"):
    """The only channel of a universal file."""
    path = tmp_path / name
    path.write_bytes("".join(sets).encode(encoding))
    (signal,) = read_file(path)
    return signal


@pytest.mark.parametrize(
    ("unit", "expected"),
    [
        ("g", FunctionType.SPECTRUM),
        ("m/s^2", FunctionType.SPECTRUM),
        ("N m", FunctionType.SPECTRUM),
        ("N/mm^2", FunctionType.SPECTRUM),
        ("g^2/Hz", FunctionType.POWER_DENSITY),
        ("g²/Hz", FunctionType.POWER_DENSITY),
        ("(m/s^2)^2/Hz", FunctionType.POWER_DENSITY),
        ("(m/s²)²/Hz", FunctionType.POWER_DENSITY),
        ("m^2/s^3", FunctionType.POWER_DENSITY),
        ("mm^2/Hz", FunctionType.POWER_DENSITY),
        ("N^2/Hz", FunctionType.POWER_DENSITY),
        ("G^2/HZ", FunctionType.POWER_DENSITY),
        ("g/sqrt(Hz)", FunctionType.AMPLITUDE_DENSITY),
        ("g/√Hz", FunctionType.AMPLITUDE_DENSITY),
        ("g^2 s/Hz", FunctionType.ENERGY_DENSITY),
        ("g^2", FunctionType.AUTO_SPECTRUM),
        ("(m/s^2)^2", FunctionType.AUTO_SPECTRUM),
        ("g/g", FunctionType.FREQUENCY_RESPONSE),
        ("g/N", FunctionType.FREQUENCY_RESPONSE),
        ("(m/s^2)/N", FunctionType.FREQUENCY_RESPONSE),
        ("m/s^2/N", FunctionType.FREQUENCY_RESPONSE),
        ("m/(N s^2)", FunctionType.FREQUENCY_RESPONSE),
        ("mm/N", FunctionType.FREQUENCY_RESPONSE),
        ("[m/s^2]/[lbf]", FunctionType.FREQUENCY_RESPONSE),
    ],
)
def test_units_of_values_over_frequency_say_what_they_are(unit, expected):
    assert function_over_frequency("tip", unit) is expected


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("tip coherence", FunctionType.COHERENCE),
        ("PSD_tip", FunctionType.POWER_DENSITY),
        ("SRS tip", FunctionType.SHOCK_SPECTRUM),
        ("FRF tip:+Z/base:+Z", FunctionType.FREQUENCY_RESPONSE),
        ("Transmissibility tip", FunctionType.TRANSMISSIBILITY),
        ("auto power spectrum", FunctionType.AUTO_SPECTRUM),
        ("tip absolute acceleration", FunctionType.SPECTRUM),
        ("passive damper", FunctionType.SPECTRUM),
    ],
)
def test_names_of_values_over_frequency_say_what_they_are(name, expected):
    assert function_over_frequency(name, "g") is expected


@pytest.mark.parametrize("number", [*BY_NUMBER, 28, 99])
@pytest.mark.parametrize("over_frequency", [False, True])
def test_a_sampled_input_takes_time_histories_alone(tmp_path, number, over_frequency):
    """By the numbers of data set 58; 1 is a time response."""
    (tmp_path / "a.uff").write_text(function(Y, kind=number, **(OVER_FREQUENCY if over_frequency else {})))
    sampled = SampledInput(kind="sampled", applied_to="base", file="a.uff")
    if number == 1 and not over_frequency:
        np.testing.assert_allclose(read_record(sampled, tmp_path).y, Y, rtol=1e-5)
        return
    with pytest.raises(ScenarioError) as caught:
        read_record(sampled, tmp_path)
    assert "excitation.file = a.uff" in str(caught.value)
    assert str(BY_NUMBER.get(number, FunctionType.OTHER)) in str(caught.value)


@pytest.mark.parametrize("rate", [None, "1 kHz"])
def test_a_sample_rate_makes_no_history_of_a_density(tmp_path, rate):
    (tmp_path / "a.uff").write_text(function(Y, kind=9, **OVER_FREQUENCY))
    sampled = SampledInput(kind="sampled", applied_to="base", file="a.uff", sample_rate=rate)
    with pytest.raises(ScenarioError, match="has a power spectral density in acc"):
        read_record(sampled, tmp_path)


@pytest.mark.parametrize(
    ("over", "kind", "expected"),
    [
        ((13, "Force", "N"), 1, FunctionType.IMPULSE_RESPONSE),
        ((13, "Force", NO_LABEL), 1, FunctionType.IMPULSE_RESPONSE),
        ((0, NO_LABEL, "N"), 0, FunctionType.IMPULSE_RESPONSE),
        ((12, "Acceleration", "g"), 0, FunctionType.IMPULSE_RESPONSE),
        ((1, NO_LABEL, NO_LABEL), 1, FunctionType.TIME_HISTORY),
        ((0, NO_LABEL, NO_LABEL), 0, FunctionType.TIME_HISTORY),
    ],
)
def test_a_history_with_a_denominator_is_an_impulse_response(tmp_path, over, kind, expected):
    assert channel(tmp_path, function(Y, kind=kind, over=over)).function is expected


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ({"kind": 12}, FunctionType.SPECTRUM),
        ({"kind": 0}, FunctionType.SPECTRUM),
        ({"kind": 12, "over": (13, "Force", "N")}, FunctionType.FREQUENCY_RESPONSE),
        ({"kind": 12, "values": (12, "", "g^2/Hz")}, FunctionType.POWER_DENSITY),
        ({"kind": 0, "values": (12, "", "g"), "over": (18, "Frequency", "Hz")}, FunctionType.POWER_DENSITY),
        ({"kind": 0, "name": "tip coherence"}, FunctionType.COHERENCE),
        ({"kind": 9}, FunctionType.POWER_DENSITY),
        ({"kind": 6}, FunctionType.COHERENCE),
    ],
)
def test_functions_over_frequency_of_universal_files(tmp_path, fields, expected):
    assert channel(tmp_path, function(Y, **OVER_FREQUENCY | fields)).function is expected


@pytest.mark.parametrize(
    ("axis", "of_frequency", "kind"),
    [
        ((0, "Frequency", "Hz"), True, 9),
        ((0, NO_LABEL, "Hz"), True, 0),
        ((1, "Frequency", NO_LABEL), True, 0),
        ((0, NO_LABEL, NO_LABEL), True, 9),
        ((0, NO_LABEL, "rad/s"), True, 12),
        ((0, "Time", "ms"), False, 0),
        ((0, NO_LABEL, NO_LABEL), False, 1),
    ],
)
def test_an_axis_of_an_unknown_data_type_is_what_its_label_says(tmp_path, axis, of_frequency, kind):
    signal = channel(tmp_path, function(Y, axis=axis, kind=kind))
    assert (signal.is_over_frequency, signal.fault) == (of_frequency, None)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"axis": (20, "Order", NO_LABEL), "kind": 27}, "an axis of order"),
        ({"axis": (19, "Speed", "rpm"), "kind": 12}, "an axis of speed of rotation"),
        ({"axis": (0, "Speed", "rpm"), "kind": 0}, "an axis of rpm"),
        ({"axis": (8, "Displacement", "mm"), "kind": 0}, "an axis of displacement"),
        ({"axis": (18, "Frequency", "Hz"), "kind": 1}, "is a time history and has an axis of frequency"),
        ({"axis": (17, "Time", "s"), "kind": 9}, "is a power spectral density and has an axis of time"),
    ],
)
def test_other_axes_are_refused_where_the_channel_is_used(tmp_path, fields, message):
    with pytest.raises(InputFileError, match=message):
        channel(tmp_path, function(Y, **fields)).on_si_axis(None, "").check()


H = (2.0 - 1.0j) * np.arange(1.0, 9.0)


@pytest.mark.parametrize(
    ("values", "over", "level", "expected"),
    [
        ((12, "", "g"), (12, "", "g"), "2 g", 2.0),
        ((12, "", "m/s^2"), (12, "", "g"), "19.6133 m/s^2", 2.0),
        ((12, "", "g"), (13, "", "N"), "0.5 kN", 500.0),
        ((12, "", "g/N"), (13, "", "N"), "3 N", 3.0),
        ((12, "", "g/N"), (0, "", NO_LABEL), "3 N", 3.0),
        ((12, "", "g"), (13, "", NO_LABEL), "3 N", 3.0),
        ((8, "", "mm"), (13, "", "lbf"), "4.4482216152605 N", 1.0),
    ],
)
def test_a_frequency_response_times_its_level_is_an_amplitude(tmp_path, values, over, level, expected):
    """Phases are those under a sine, -i as the amplitude of a cosine."""
    signal = channel(tmp_path, units(), function(H, kind=4, values=values, over=over, **OVER_FREQUENCY))
    amplitude = signal.at_level(level, "--level")
    assert amplitude.function is FunctionType.SPECTRUM
    assert amplitude.unit == values[2].split("/N")[0]
    np.testing.assert_allclose(amplitude.y, -1j * expected * H, rtol=1e-5)
    assert amplitude.scaling[-1] == f"times {level}"


@pytest.mark.parametrize(
    ("level", "message"),
    [
        (None, "a structure with stops responds differently at each level"),
        ("2 g", "must be a force"),
        ("2", "is not an amplitude with a unit"),
        ("0 N", "is not an amplitude with a unit"),
        ("-1 N", "is not an amplitude with a unit"),
        ("loud", "is not a number"),
    ],
)
def test_a_frequency_response_without_its_level_is_refused(tmp_path, level, message):
    signal = channel(tmp_path, function(H, kind=4, over=(13, "Force", "N"), **OVER_FREQUENCY))
    with pytest.raises(InputFileError, match=message) as caught:
        signal.at_level(level, "--level")
    assert "--level '2 N'" in caught.value.remedy


def test_a_frequency_response_without_a_denominator_is_refused(tmp_path):
    signal = channel(tmp_path, function(H, kind=4, **OVER_FREQUENCY))
    with pytest.raises(InputFileError, match="does not state what it is divided by"):
        signal.at_level("2 g", "--level")


@pytest.mark.parametrize("unit", ["g/N", "(m/s^2)/N", "m/s²/N"])
def test_ratios_in_tables_and_arrays_ask_for_the_level_too(tmp_path, unit, without_examination):
    frequency = np.arange(1.0, 9.0)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["frequency"], file["tip"] = frequency, frequency
        file["frequency"].attrs["units"], file["tip"].attrs["units"] = "Hz", unit
    rows = "\n".join(f"{f},{f}" for f in frequency)
    (tmp_path / "a.csv").write_text(f"frequency (Hz),tip [{unit}]\n{rows}\n")
    numerator, denominator = ratio_of(unit)
    for file in ("a.h5", "a.csv"):
        (signal,) = (each for each in read_file(tmp_path / file) if each.name.startswith("tip"))
        assert signal.function is FunctionType.FREQUENCY_RESPONSE
        amplitude = signal.at_level(f"3 {denominator}", "--level")
        assert amplitude.unit == numerator
        np.testing.assert_allclose(amplitude.y, 3 * frequency)


@pytest.mark.parametrize(("number", "factor"), [(0, 1.0), (1, 2.0), (2, 1.0), (3, np.sqrt(2.0))])
def test_amplitude_spectra_are_peaks_whatever_the_file_has(tmp_path, number, factor):
    signal = channel(tmp_path, amplitudes(number), function(Y, kind=12, **OVER_FREQUENCY))
    np.testing.assert_allclose(signal.y, factor * Y, rtol=1e-5)
    assert bool(signal.scaling) == (factor != 1.0)


def test_spectra_of_different_amplitudes_in_one_file_are_refused(tmp_path):
    signal = channel(tmp_path, amplitudes(2), amplitudes(3), function(Y, kind=12, **OVER_FREQUENCY))
    with pytest.raises(InputFileError, match="spectra of different amplitudes"):
        signal.check()


CASE = {
    "chain": {"masses": [1], "springs": [4000], "snubbers": [{"name": "stop", "mass": 1, "side": "above",
                                                               "gap": "1 mm", "stiffness": 3000}]},
    "excitation": {"kind": "harmonic", "applied_to": "base", "level": 1, "frequency": 10},
    "probes": [{"name": "tip", "mass": 1}],
}  # fmt: skip


@pytest.mark.parametrize(
    ("test", "kinds"),
    [({"frequency": "10 Hz"}, "a time history or an amplitude spectrum"), ({"kind": "transient"}, "a time history")],
)
@pytest.mark.parametrize("number", [2, 6, 9])
def test_identification_refuses_what_is_no_amplitude(tmp_path, test, kinds, number):
    (tmp_path / "a.uff").write_text(function(Y, kind=number, name="tip", **OVER_FREQUENCY))
    fit = {"estimate": ["chain.snubbers.stop.gap"], "tests": [{"file": "a.uff", **test}]}
    scenario = load_scenario({**CASE, "identify_stiffness": {"snubber": "stop", "nonlinear": fit}})
    with pytest.raises(ScenarioError, match=f"{BY_NUMBER[number]} in tip .* needs {kinds}"):
        read_tests(scenario, tmp_path)


def test_the_excitation_of_a_tracked_sweep_is_a_time_history(tmp_path):
    (tmp_path / "a.uff").write_text(function(Y, kind=7, name="base"))
    with pytest.raises(ScenarioError, match="auto correlation in base"):
        history_named(tmp_path / "a.uff", "base")


def fit_of(tmp_path, **keys):
    fit = {"estimate": ["chain.snubbers.stop.gap"], "tests": [{"file": "a.uff", **keys}]}
    return load_scenario({**CASE, "identify_stiffness": {"snubber": "stop", "nonlinear": fit}}), tmp_path


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({}, "has no harmonics of a vibration; give harmonics: 1 and the level"),
        ({"harmonics": 1}, r"responds differently at each level; .*tests\[0\]\.level '2 g'"),
        ({"harmonics": 1, "level": "2 g", "frequency": "5 Hz"}, "has no lines about 5 Hz"),
        ({"kind": "transient"}, "the test of a transient needs a time history"),
    ],
)
def test_a_steady_test_asks_for_the_level_of_a_frequency_response(tmp_path, keys, message):
    (tmp_path / "a.uff").write_text(
        function(H, kind=4, name="tip", over=(12, "", "g"), values=(12, "", "g"), **OVER_FREQUENCY)
    )
    scenario, folder = fit_of(tmp_path, **({"frequency": "21 Hz"} if "kind" not in keys else {}) | keys)
    with pytest.raises(ScenarioError, match=message):
        read_tests(scenario, folder)


def test_a_frequency_response_is_the_fundamental_of_a_steady_test(tmp_path):
    """In the phase of an excitation that is a sine."""
    f = np.arange(20.0, 22.0, 0.25)
    (tmp_path / "a.uff").write_text(
        function(H[: f.size], kind=4, name="tip", over=(12, "", "g"), values=(12, "", "g"), **OVER_FREQUENCY)
    )
    scenario, folder = fit_of(tmp_path, frequency="21 Hz", level="2 g", harmonics=1, phase="of_excitation")
    (signal,) = read_tests(scenario, folder)
    harmonics = harmonics_of(signal, 21.0, 1)
    np.testing.assert_allclose(harmonics.value, 2 * G * H[f == 21.0], rtol=1e-5)
    assert harmonics.noise == [0.0]
