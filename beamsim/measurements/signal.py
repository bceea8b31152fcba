"""A measured channel: labelled values with a unit on an axis of time or frequency; names and units in headings."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from beamsim.errors import InputFileError, ScenarioError
from beamsim.measurements.functions import MEASURED, RATIOS, FunctionType, function_over_frequency, is_unit_of, ratio_of
from beamsim.scenario import units
from beamsim.typing import Complexes, Floats

# words for the axes, numbered or named further as measuring systems do: Time 2 - Default sample rate
_TIME_WORDS = r"(?:abs\w*\.? |rel\w*\.? |elapsed |test )?(?:time|zeit|messzeit|temps|tiempo|tempo|timestamp|time stamp)"
_FREQUENCY_WORDS = r"(?:frequency|freq\.?|frequenz|fréquence|frecuencia|frequenza)"
_NUMBERED = r"(?:[ _.:#]*[0-9]+)?(?: *- .*)?"
_AXES = {
    kind: re.compile(rf"{words}{_NUMBERED}", re.IGNORECASE)
    for kind, words in (("time", _TIME_WORDS), ("frequency", _FREQUENCY_WORDS))
}
_LETTERS = {"t": ("time", units.TIME), "f": ("frequency", units.FREQUENCY)}

LARGEST_VALUE = 1e30
"""Magnitude above which a sample is no measured value: files fill what was never written with such numbers."""
_COUNTS = re.compile(r"|#|n|i|no\.?|nr\.?|index|samples?|rows?|count|lfd\.? ?nr\.?|unnamed: 0", re.IGNORECASE)
_BRACKETS = re.compile(r"(.*?)\s*[(\[]((?:[^()\[\]]|\([^()]*\))*)[)\]]\s*")
_BARE_POWER = re.compile(r"(?<=[A-Za-z])(-[1-4])(?![\w.])")
_NUMBER_BEHIND = re.compile(r"(.*\S)\s+\([0-9]+\)")  # that tells equal headings apart
_ENDING = re.compile(r"(.+?)_(m_per_s2|m_per_s|m/s\^2|m/s2|m/s|mm|ms|us|k?hz|rad|deg)", re.IGNORECASE)
_SPELLED = {"m_per_s2": "m/s^2", "m_per_s": "m/s", "m/s2": "m/s^2", "hz": "Hz", "khz": "kHz"}


def split_heading(heading: str) -> tuple[str, str]:
    """Name and unit of a column; the unit is empty where the heading has none.

    A unit stands in brackets, or behind an underscore where it cannot be part of a name: a_g is a ground acceleration.

    >>> split_heading("time (ms)"), split_heading("tip_m_per_s2"), split_heading("channel 3"), split_heading("a_g")
    (('time', 'ms'), ('tip', 'm/s^2'), ('channel 3', ''), ('a_g', ''))
    """
    if match := _NUMBER_BEHIND.fullmatch(heading):
        heading = match[1]
    if match := _BRACKETS.fullmatch(heading):
        unit = match[2].strip()
        return match[1], "" if unit.isdigit() else unit
    if match := _ENDING.fullmatch(heading.strip()):
        ending = match[2].lower()
        return match[1], _SPELLED.get(ending, ending)
    return heading.strip(), ""


def label_unit(unit: str) -> str:
    """The unit of a label in a file; empty where it says none. Powers may lack their sign, as in netCDF.

    >>> label_unit(" NONE "), label_unit("m s-2")
    ('', 'm s^-2')
    """
    return "" if unit.strip().upper() in ("", "NONE", "1", "-") else _BARE_POWER.sub(r"^\1", unit.strip())


def axis_kind(heading: str) -> str:
    """``time`` or ``frequency`` of a heading that names such an axis, else nothing.

    >>> axis_kind("Time 2 - Default sample rate"), axis_kind("f (kHz)"), axis_kind("F (N)"), axis_kind("F")
    ('time', 'frequency', '', '')
    """
    name, unit = split_heading(heading)
    for kind, words in _AXES.items():
        if words.fullmatch(name):
            return kind
    kind, dimension = _LETTERS.get(name.lower(), ("", units.NUMBER))
    return kind if kind and (is_unit_of(unit, dimension) if unit else name.islower()) else ""


def counts_samples(heading: str, values: Floats | Complexes) -> bool:
    """Whether a column only numbers the rows, from 0 or 1, as its heading says: n, index, sample, or nothing."""
    if not _COUNTS.fullmatch(heading.strip()) or not values.size:
        return False
    return bool(values[0] in (0, 1) and np.all(np.diff(values) == 1))


def label_of(name: str) -> str:
    """Name of the channel of a data set.

    >>> label_of("histories/base_acceleration"), label_of("/bench/arm")
    ('histories base_acceleration', 'bench arm')
    """
    return name.strip("/").replace("/", " ")


@dataclass(frozen=True)
class Reference:
    """What the values of a channel are divided by: the excitation of a frequency response."""

    unit: str = ""  # empty where the file has none
    node: int | None = None
    direction: str = ""  # +X to -RZ


@dataclass(frozen=True)
class ExcitationLevel:
    """Amplitude of the excitation in a test."""

    amplitude: float  # in SI units
    dimension: units.Dimension


@dataclass(frozen=True)
class MeasuredSignal:
    """One measured channel: its values on an axis, and what the file says of them.

    `beamsim.read_tests` and `beamsim.pair_channels` return it in SI units. As read from a file, it has the units of
    the file: before values are used, ask `require` for the function type, `on_si_axis` for the axis, `in_si` for the
    unit and `check` for the values.

    Examples
    --------
    >>> import beamsim
    >>> signal = beamsim.read_tests("configs/identification/identify_nonlinear.yaml")[0]
    >>> signal.name, signal.unit, signal.x.shape, signal.y.shape, signal.is_over_frequency
    ('tip (g)', 'm/s^2', (1500,), (1500,), False)
    """

    name: str  #: name of the channel, with its unit where the file has it there
    x: Floats  #: (n,) s or Hz, increasing; as read from a file in `axis_unit`, or sample numbers if `axis` is empty
    y: Floats | Complexes  #: (n,) in `unit`; of a complex spectrum amplitude e^{i phase} of A cos(2 pi f t + phase)
    is_over_frequency: bool = False  #: whether the axis is one of frequencies
    unit: str = ""  #: as given in the file, or empty; of a ratio that of its numerator
    source: str = ""  #: path of the file
    axis: str = ""  #: heading of the axis
    axis_unit: str = ""  #: the same as `unit`
    stated_function: FunctionType | None = None  #: function type in the file; None where that has none
    quantity: str = ""  #: what was measured, such as acceleration, where the file says it
    node: int | None = None  #: where it was measured
    direction: str = ""  #: +X to -RZ, as in the file
    reference: Reference | None = None  #: what the values are divided by
    scaling: tuple[str, ...] = ()  #: what was done to the values of the file, in words
    warnings: tuple[str, ...] = ()  #: what is doubtful about it
    level: ExcitationLevel | None = None  #: of the excitation, by which the values of a ratio were multiplied
    fault: tuple[str, str] | None = None  #: why the values cannot be used, and a remedy

    @property
    def function(self) -> FunctionType:
        """Function type: that of the file, else what name, unit and axis say."""
        if self.stated_function is not None:
            return self.stated_function
        if not self.is_over_frequency:
            return FunctionType.TIME_HISTORY if self.reference is None else FunctionType.IMPULSE_RESPONSE
        if self.reference is not None:
            return FunctionType.FREQUENCY_RESPONSE
        return function_over_frequency(self.name, self.unit)

    @property
    def description(self) -> str:
        """The name with what was done to the values of the file."""
        return ", ".join((self.name, *self.scaling))

    def require(self, functions: Sequence[FunctionType], purpose: str) -> MeasuredSignal:
        """The signal itself, if it is a function of one of some types.

        Parameters
        ----------
        functions : types that can be used.
        purpose : what needs them, for the message: ``a sampled input``.

        Returns
        -------
        MeasuredSignal

        Raises
        ------
        InputFileError
            If it is of another type.
        """
        if self.function in functions:
            return self
        *others, last = (each.with_article for each in functions)
        needed = f"{', '.join(others)} or {last}" if others else last
        unit = f" ({self.unit_text})" if self.unit_text and self.unit_text not in self.name else ""
        raise InputFileError(
            f"has {self.function.with_article} in {self.name}{unit}, and {purpose} needs {needed}",
            f"choose another channel, or export {'one of these' if others else last}",
        )

    @property
    def unit_text(self) -> str:
        """The unit, of a ratio with its denominator; empty where none is stated."""
        over = "" if self.reference is None else self.reference.unit
        return f"{self.unit} per {over}" if self.unit and over else self.unit

    def at_level(self, level: str | None, key: str) -> MeasuredSignal:
        """The amplitudes of a frequency response: its values times the level at which it was measured.

        Parameters
        ----------
        level : amplitude of what the response is divided by, with its unit; None where it is not given.
        key : where a user can give it, for the remedy.

        Returns
        -------
        MeasuredSignal
            An amplitude spectrum, its phases those under an excitation that is a sine; a signal of another function
            type as it is.

        Raises
        ------
        InputFileError
            If the level is missing, or of another quantity than the denominator, or if that has no unit.
        """
        if self.function not in RATIOS:
            return self
        numerator, denominator = ratio_of(self.unit) or (self.unit, "")
        if self.reference is not None:
            numerator, denominator = self.unit, self.reference.unit
        if not denominator:
            raise InputFileError(
                f"has {self.function.with_article} in {self.name}, and does not state what it is divided by",
                "export it with the unit of its denominator, for example g/N, or export the amplitude spectrum",
            )
        what = f"has {self.function.with_article} in {self.name} ({numerator} per {denominator})"
        remedy = f"give the amplitude of the excitation in the test, for example {key} '2 {denominator}'"
        if level is None:
            raise InputFileError(f"{what}, and a structure with stops responds differently at each level", remedy)
        try:
            size, dimension = units.read_level(f"1 {denominator}", MEASURED)
            amplitude, stated = units.read_level(level, (dimension or units.ACCELERATION,))
        except units.UnitError as error:
            raise InputFileError(f"{what}, and {key} = {level} {error.message}", remedy) from None
        if dimension is None or stated is None or amplitude <= 0.0:
            raise InputFileError(f"{what}, and {key} = {level} is not an amplitude with a unit", remedy)
        factor = amplitude / size * (-1j if np.iscomplexobj(self.y) else 1.0)
        return replace(
            self, y=np.asarray(factor * self.y), unit=numerator, reference=None,
            level=ExcitationLevel(amplitude, dimension), stated_function=FunctionType.SPECTRUM,
            scaling=(*self.scaling, f"times {level}"),
        )  # fmt: skip

    @property
    def label(self) -> str:
        """The channel with its file, as messages name it."""
        return f"{self.source or self.name}: {self.name}"

    @property
    def has_phase(self) -> bool:
        """Whether phases between harmonics are known."""
        return not self.is_over_frequency or bool(np.iscomplexobj(self.y))

    def last(self, duration: float | None) -> MeasuredSignal:
        """The last part of a time history, s; the signal itself without a duration, and a spectrum."""
        if duration is None or self.is_over_frequency:
            return self
        kept = self.x >= self.x[-1] - duration
        return replace(self, x=self.x[kept], y=self.y[kept])

    def on_si_axis(self, unit: str | None, key: str) -> MeasuredSignal:
        """The signal on an axis in s or Hz.

        Parameters
        ----------
        unit : of the axis; by default the one that the file states.
        key : where a user can give it, for the remedy.

        Returns
        -------
        MeasuredSignal

        Raises
        ------
        InputFileError
            If neither states a unit, or it is not one of time (of frequency).
        """
        if self.fault is not None:  # which `check` states
            return self
        kind, example = ("frequency", "frequency (Hz)") if self.is_over_frequency else ("time", "time (ms)")
        named = unit or self.axis_unit
        remedy = f"name its unit in the heading, for example {example}, or give {key}"
        if not named:
            plural = "frequencies" if self.is_over_frequency else "times"
            raise InputFileError(f"states no unit of its {plural} (axis {self.axis})", remedy)
        dimension = units.FREQUENCY if self.is_over_frequency else units.TIME
        try:
            factor = units.read_quantity(f"1 {named}", dimension)
        except units.UnitError as error:
            raise InputFileError(f"has a {kind} axis in {named}, which {error.message}", remedy) from None
        return replace(self, x=self.x * factor, axis_unit=dimension.unit)

    def check(self) -> MeasuredSignal:
        """The signal itself.

        Raises
        ------
        InputFileError
            If the file says that its values cannot be used, if they are not finite, or if the axis does not increase;
            with the number of the first such sample.
        """
        if self.fault is not None:
            raise InputFileError(*self.fault)
        bad = np.flatnonzero(~np.isfinite(self.y) | ~np.isfinite(self.x))
        if bad.size:
            raise InputFileError(
                f"has {bad.size} values that are not finite, the first at sample {bad[0] + 1}",
                "repair or remove that part of the record",
            )
        large = np.flatnonzero((np.abs(self.y) > LARGEST_VALUE) | (np.abs(self.x) > LARGEST_VALUE))
        if large.size:
            raise InputFileError(
                f"has the value {max(abs(self.y[large[0]]), abs(self.x[large[0]])):g} at sample {large[0] + 1}",
                "the file is damaged, or marks missing values by it: repair or remove that part of the record",
            )
        back = np.flatnonzero(np.diff(self.x) <= 0)
        if back.size:
            kind, unit = ("frequency", "Hz") if self.is_over_frequency else ("time", "s")
            raise InputFileError(
                f"has a {kind} axis that does not increase at sample {back[0] + 2} "
                f"({self.x[back[0]]:g} {unit}, then {self.x[back[0] + 1]:g} {unit})",
                "sort the samples and remove duplicates, or name the correct column",
            )
        return self


def in_si(signal: MeasuredSignal, unit: str | None, dimension: units.Dimension, key: str) -> MeasuredSignal:
    """The signal converted to SI from the given unit, else from that of the file.

    Parameters
    ----------
    signal : as read.
    unit : of the values; by default the one that the file states.
    dimension : of what is measured.
    key : key of the scenario, or option, with which a user gives the unit.

    Returns
    -------
    MeasuredSignal

    Raises
    ------
    ScenarioError
        If neither is given, or the unit is not one of the quantity.
    """
    named, source = unit or signal.unit, signal.source or signal.name
    example = {units.ACCELERATION.unit: "g", units.LENGTH.unit: "mm"}.get(dimension.unit, dimension.unit)
    remedy = f"give the unit of the {dimension.name}, for example {example}"
    if not named:
        raise ScenarioError.at(key, f"is missing, and {source} states no unit of {signal.name}", remedy)
    try:
        factor = units.read_quantity(f"1 {named}", dimension)
    except units.UnitError as error:
        given = f"= {named}" if unit else f"is missing, and {source} has values in {named}, which"
        raise ScenarioError.at(key, f"{given} {error.message}", remedy) from None
    with np.errstate(over="ignore"):  # which `check` finds
        return replace(signal, y=signal.y * factor, unit=dimension.unit)
