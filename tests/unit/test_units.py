"""Units: what a user writes becomes the SI number the field means."""

import math

import pytest

from beamsim.scenario import units
from beamsim.scenario.quantities import RateType
from beamsim.scenario.units import UnitError, read_level, read_quantity

pytestmark = pytest.mark.quick

G = 9.80665
TAU = 2.0 * math.pi


@pytest.mark.parametrize(
    ("text", "dimension", "expected"),
    [
        # what a plain conversion gets wrong here
        ("0.8 rad/s", units.FREQUENCY, 0.8 / TAU),
        ("60 rpm", units.FREQUENCY, 1.0),
        ("2 g", units.ACCELERATION, 2 * G),
        ("4.2 g", units.MASS, 0.0042),
        # frequencies
        ("5 1/s", units.FREQUENCY, 5.0),
        ("3600 deg/s", units.FREQUENCY, 10.0),
        ("120 rev/min", units.FREQUENCY, 2.0),
        ("3 cycle/s", units.FREQUENCY, 3.0),
        ("1 krad/s", units.FREQUENCY, 1000 / TAU),
        # accelerations
        ("500 mg", units.ACCELERATION, 0.5 * G),
        ("9.81 m/s²", units.ACCELERATION, 9.81),
        ("2 N/kg", units.ACCELERATION, 2.0),
        # masses and densities
        ("45 mg", units.MASS, 45e-6),
        ("2700 kg/m^3", units.DENSITY, 2700.0),
        ("2700 kg·m⁻³", units.DENSITY, 2700.0),
        # the rest
        ("270mm", units.LENGTH, 0.27),
        ("5 µm", units.LENGTH, 5e-6),
        ("5 μm", units.LENGTH, 5e-6),
        ("-0.2 mm", units.LENGTH, -0.0002),
        ("151.1 N/mm", units.STIFFNESS, 151100.0),
        ("12 N·s/m", units.DASHPOT, 12.0),
        ("12 kg/s", units.DASHPOT, 12.0),
        ("3 N s/m^2", units.VISCOUS_PER_LENGTH, 3.0),
        ("0.5 N/m^3", units.CUBIC_STIFFNESS, 0.5),
        ("250 mm**2", units.AREA, 250e-6),
        ("2 min", units.TIME, 120.0),
        ("0.3%", units.RATIO, 0.003),
        ("90 deg", units.ANGLE, math.pi / 2),
        ("90°", units.ANGLE, math.pi / 2),
        ("1.5 rad", units.ANGLE, 1.5),
        # numbers
        (0.27, units.LENGTH, 0.27),
        (3, units.LENGTH, 3.0),
        ("2e5", units.PRESSURE, 2e5),
        (" 0.27 ", units.LENGTH, 0.27),
        (".5", units.TIME, 0.5),
        ("5.", units.TIME, 5.0),
        ("1_000", units.TIME, 1000.0),
        ("1e-3 m", units.LENGTH, 1e-3),
        ("0 mm", units.LENGTH, 0.0),
        ("1.57", units.ANGLE, 1.57),
    ],
)
def test_reads_what_is_meant(text, dimension, expected):
    assert read_quantity(text, dimension) == pytest.approx(expected, rel=1e-14, abs=0.0)


def test_g_in_a_power_spectral_density_is_gravity():
    psd = units.Dimension("acceleration PSD", "m^2/s^3", "0.01 g^2/Hz", gravity=True)
    assert read_quantity("0.01 g^2/Hz", psd) == pytest.approx(0.01 * G**2, rel=1e-14)
    assert read_quantity("0.01 g²/Hz", psd) == pytest.approx(0.01 * G**2, rel=1e-14)
    with pytest.raises(UnitError, match="must be"):  # without gravity it is gram squared
        read_quantity("0.01 g^2/Hz", units.Dimension("acceleration PSD", "m^2/s^3", ""))


@pytest.mark.parametrize(
    ("one", "other", "dimension"),
    [
        ("7 mm", "0.7 cm", units.LENGTH),
        ("4.2 g", "0.0042 kg", units.MASS),
        ("0.3 mm", "300 um", units.LENGTH),
        ("19.6133 m/s^2", "2 g", units.ACCELERATION),
        ("1.1 kHz", "1100 Hz", units.FREQUENCY),
        ("0.1 %", "0.001", units.RATIO),
        ("7850 kg/m3", "7850 kg/m^3", units.DENSITY),  # as data sheets and headings write powers
        ("9.81 m/s2", "9.81 m/s^2", units.ACCELERATION),
        ("0.01 g2/Hz", "0.01 g^2/Hz", units.ACCELERATION_PSD),
        ("3 lb/ft3", "3 lb/ft^3", units.DENSITY),
    ],
)
def test_conversion_rounds_once(one, other, dimension):
    assert read_quantity(one, dimension) == read_quantity(other, dimension)


@pytest.mark.parametrize(
    ("value", "dimension", "meant"),
    [
        ("65 hz", units.FREQUENCY, "Hz"),
        ("70 Gpa", units.PRESSURE, "GPa"),
        ("151 KN/m", units.STIFFNESS, "kN/m"),
        ("2 G", units.ACCELERATION, "g"),
        ("2 G", units.MASS, "g"),
        ("2 oct", units.LENGTH, ""),
    ],
)
def test_asks_whether_another_spelling_was_meant(value, dimension, meant):
    for read in (read_quantity, lambda value, dimension: units.read_level(value, (dimension, units.ANGLE))):
        with pytest.raises(UnitError) as caught:
            read(value, dimension)
        assert caught.value.remedy == f"did you mean {meant}?" if meant else "did you mean" not in caught.value.remedy


@pytest.mark.parametrize(
    ("value", "dimension", "says"),
    [
        ("5 kg", units.LENGTH, "must be a length, not a mass"),
        ("2700 mm", units.DENSITY, "must be a density, not a length"),
        ("2 g", units.LENGTH, "must be a length, not a mass"),
        ("2 kg", units.ACCELERATION, "must be an acceleration, not a mass"),
        ("5 %", units.ANGLE, "must be an angle, not a ratio"),
        ("5 deg", units.RATIO, "must be a ratio, not an angle"),
        ("5 mm rad", units.LENGTH, "must be a length"),
        ("2 oct/min", units.FREQUENCY, "must be a frequency, not a sweep rate"),
        ("3 dB", units.RATIO, "must be a ratio"),
        ("20 degC", units.LENGTH, "must be a length"),
        ("5 furlogs", units.LENGTH, "'furlogs', which is not known"),
        ("65 hz", units.FREQUENCY, "'hz', which is not known"),
        ("5,2 mm", units.LENGTH, "is not a number with a unit"),
        ("mm", units.LENGTH, "is not a number"),
        ("", units.LENGTH, "is empty"),
        ("  ", units.LENGTH, "is empty"),
        ("five mm", units.LENGTH, "is not a number"),
        ("5 3 mm", units.LENGTH, "is not a number"),
        ("1 + 2 mm", units.LENGTH, "is not a number"),
        ("1 m^9^9^9^9", units.LENGTH, "is not a number"),
        ("1 m**9999999", units.LENGTH, "is not a number"),
        ("1 m(", units.LENGTH, "which is not known"),
        ("1 __import__('os')", units.LENGTH, "is not a number"),
        ("1 " + "m*" * 100 + "m", units.LENGTH, "is not a number"),
        ("nan", units.LENGTH, "is not a number"),
        (math.nan, units.LENGTH, "must be finite"),
        (math.inf, units.LENGTH, "must be finite"),
        ("1e999 mm", units.LENGTH, "must be finite"),
        ("1e308 km", units.LENGTH, "must be finite"),
        (10**400, units.LENGTH, "must be finite"),
        (True, units.LENGTH, "must be a number"),
        (None, units.LENGTH, "must be a number"),
        ([1], units.LENGTH, "must be a number"),
    ],
)
def test_refuses_with_the_reason_and_an_example(value, dimension, says):
    with pytest.raises(UnitError) as caught:
        read_quantity(value, dimension)
    assert says in caught.value.message
    assert caught.value.remedy


def test_tiny_exponents_do_not_take_forever():
    assert read_quantity("1e-999999999 mm", units.LENGTH) == 0.0


def test_plain_numbers_refuse_units():
    assert read_quantity("2e5", units.NUMBER) == 2e5
    with pytest.raises(UnitError, match="must be a plain number, not a length"):
        read_quantity("2 mm", units.NUMBER)


@pytest.mark.parametrize(
    ("text", "value", "unit"),
    [
        ("2 oct/min", 2 / 60, "oct/s"),
        ("0.5 octaves/s", 0.5, "oct/s"),
        ("1 dec/min", math.log2(10) / 60, "oct/s"),
        ("5 Hz/s", 5.0, "Hz/s"),
        ("30 Hz/min", 0.5, "Hz/s"),
        ("60 rpm/s", 1.0, "Hz/s"),
        ("6 rad/s^2", 6 / TAU, "Hz/s"),
    ],
)
def test_sweep_rates(text, value, unit):
    rate = RateType().read(text)
    assert (rate.value, rate.unit) == (pytest.approx(value, rel=1e-14), unit)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (2, "needs a unit"),
        ("2", "needs a unit"),
        ("2 Hz", "not a frequency"),
        ("2 foo/s", "is not known"),
        ("", "is empty"),
    ],
)
def test_sweep_rates_refuse(text, says):
    with pytest.raises(UnitError) as caught:
        RateType().read(text)
    assert says in caught.value.message
    assert "oct/min" in caught.value.remedy


def test_levels_say_what_they_are():
    choices = (units.ACCELERATION, units.VELOCITY, units.LENGTH, units.FORCE)
    assert read_level("2 g", choices) == (pytest.approx(2 * G), units.ACCELERATION)
    assert read_level("0.1 mm", choices) == (0.0001, units.LENGTH)
    assert read_level("1.5 kN", choices) == (1500.0, units.FORCE)
    assert read_level(3, choices) == (3.0, None)
    with pytest.raises(UnitError, match="or a force, not a time"):
        read_level("3 s", choices)
    with pytest.raises(UnitError, match="is not known"):
        read_level("3 foo", choices)


FACTORS = (
    ("mm", units.LENGTH, 1e-3), ("in", units.LENGTH, 0.0254), ("mm^2", units.AREA, 1e-6),
    ("cm**4", units.SECOND_MOMENT, 1e-8), ("g", units.MASS, 1e-3), ("lb", units.MASS, 0.45359237),
    ("slug", units.MASS, 14.593902937206365), ("tonnes", units.MASS, 1e3), ("kilogram", units.MASS, 1.0),
    ("g/cm^3", units.DENSITY, 1e3), ("lb/in^3", units.DENSITY, 27679.904710203125), ("GPa", units.PRESSURE, 1e9),
    ("N/mm^2", units.PRESSURE, 1e6),
    ("psi", units.PRESSURE, 6894.757293168361),
    ("ksi", units.PRESSURE, 6894757.293168361), ("mbar", units.PRESSURE, 100.0),
    ("N m^2", units.BENDING_STIFFNESS, 1.0),
    ("kN/m", units.STIFFNESS, 1e3), ("J/m^2", units.STIFFNESS, 1.0), ("lbf/in", units.STIFFNESS, 175.12683524647637),
    ("N/mm^3", units.CUBIC_STIFFNESS, 1e9), ("N*s/m", units.DASHPOT, 1.0), ("N/(m/s)", units.DASHPOT, 1.0),
    ("lbf s/in", units.DASHPOT, 175.12683524647637), ("1/s", units.PER_TIME, 1.0), ("ms", units.TIME, 1e-3),
    ("hours", units.TIME, 3600.0), ("kHz", units.FREQUENCY, 1e3), ("1 / min", units.FREQUENCY, 1 / 60),
    ("rps", units.FREQUENCY, 1.0), ("uJ", units.ENERGY, 1e-6), ("ft lbf", units.ENERGY, 1.3558179483314003),
    ("mm/s", units.VELOCITY, 1e-3), ("km/h", units.VELOCITY, 1 / 3.6), ("g", units.ACCELERATION, 9.80665),
    ("mg", units.ACCELERATION, 9.80665e-3), ("m/s/s", units.ACCELERATION, 1.0), ("kgf", units.FORCE, 9.80665),
    ("g^2/Hz", units.ACCELERATION_PSD, 9.80665**2), ("N^2/Hz", units.FORCE_PSD, 1.0), ("%", units.RATIO, 0.01),
    ("mm/m", units.RATIO, 1e-3), ("N m/deg", units.ROTATIONAL_STIFFNESS, 180 / math.pi),
    ("N m", units.ROTATIONAL_STIFFNESS, 1.0), ("deg/s^2", units.ANGULAR_ACCELERATION, math.pi / 180),
    ("rpm/s", units.ANGULAR_ACCELERATION, math.pi / 30), ("GB", units.MEMORY, 1e9),
    ("mm^3/(N m)", units.WEAR_RATE, 1e-9),
)  # fmt: skip


@pytest.mark.parametrize(("text", "dimension", "size"), FACTORS)
def test_sizes_of_units(text, dimension, size):
    """Those of NIST SP 811, to the last digit."""
    assert read_quantity(f"1 {text}", dimension) == pytest.approx(size, rel=4e-16, abs=0)


@pytest.mark.parametrize("text", ["kN/m mm/", "/s", "N//m", "1 mm", "mm 1", "kHzz", "m^", "(m", "m)", "()"])
def test_what_is_no_unit(text):
    with pytest.raises(UnitError, match=r"not a number|not known|without"):
        read_quantity(f"1 {text}", units.LENGTH)
