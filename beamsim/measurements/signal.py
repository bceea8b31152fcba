"""A measured channel: labelled values with a unit on an axis of time or frequency; names and units in headings."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from beamsim.errors import ScenarioError
from beamsim.measurements.functions import MEASURED, RATIOS, FunctionType, function_over_frequency, ratio_of
from beamsim.scenario import units
from beamsim.typing import Complexes, Floats

TIME_NAMES = ("time", "t", "zeit", "temps")
_FREQUENCY_NAMES = ("frequency", "f", "freq", "frequenz", "fréquence")

_BRACKETS = re.compile(r"(.*?)\s*[(\[]((?:[^()\[\]]|\([^()]*\))*)[)\]]\s*")
_ENDING = re.compile(r"(.+?)_(m_per_s2|m_per_s|m/s\^2|m/s2|m/s|mm|n_m|m|n|g|s|ms|us|k?hz|rad|deg|pa|j)", re.IGNORECASE)
_SPELLED = {"m_per_s2": "m/s^2", "m_per_s": "m/s", "m/s2": "m/s^2", "n": "N", "n_m": "N m", "pa": "Pa",
            "j": "J", "hz": "Hz", "khz": "kHz"}  # fmt: skip


def split_heading(heading: str) -> tuple[str, str]:
    """Name and unit of a column; the unit is empty where the heading has none.

    >>> split_heading("time (ms)"), split_heading("tip_m_per_s2"), split_heading("channel 3")
    (('time', 'ms'), ('tip', 'm/s^2'), ('channel 3', ''))
    """
    if match := _BRACKETS.fullmatch(heading):
        unit = match[2].strip()
        return match[1], "" if unit.isdigit() else unit
    if match := _ENDING.fullmatch(heading.strip()):
        ending = match[2].lower()
        return match[1], _SPELLED.get(ending, ending)
    return heading.strip(), ""


def stated(unit: str) -> str:
    """The unit of a label in a file; empty where it says none."""
    return "" if unit.strip().upper() in ("", "NONE", "1", "-") else unit.strip()


def is_time(heading: str) -> bool:
    """Whether a heading is that of a time axis."""
    return split_heading(heading)[0].lower() in TIME_NAMES


def is_frequency(heading: str) -> bool:
    """Whether a heading is that of a frequency axis."""
    return split_heading(heading)[0].lower() in _FREQUENCY_NAMES


def label_of(name: str) -> str:
    """Name of the channel of a data set.

    >>> label_of("probes/tip/velocity"), label_of("outputs/foot/value")
    ('tip velocity', 'foot')
    """
    return re.sub(r"^(probes|snubbers|spectra|outputs)/|/value$", "", name.strip("/")).replace("/", " ")


class MeasurementError(Exception):
    """A fault of a file or channel; the message goes on from its name, the remedy stands for itself."""

    def __init__(self, message: str, remedy: str) -> None:
        super().__init__(message)
        self.message, self.remedy = message, remedy


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

    Before values are used, ask `required` for the function type, `on_si_axis` for the axis, `in_si` for the unit and
    `checked` for the values.
    """

    name: str  # with its unit, where the file has it there
    x: Floats  # (n,) s or Hz, increasing; as read from a file, in `axis_unit`, and sample numbers where `axis` is empty
    y: Floats | Complexes  # (n,) in `unit`; of a complex spectrum amplitude e^{i phase} of A cos(2 pi f t + phase)
    of_frequency: bool = False  # whether the axis is one of frequencies
    unit: str = ""  # as given in the file, or empty; of a ratio that of its numerator
    source: str = ""  # file
    axis: str = ""  # heading of the axis
    axis_unit: str = ""  # the same as `unit`
    stated_function: FunctionType | None = None  # function type in the file; None where that has none
    quantity: str = ""  # what was measured, such as acceleration, where the file says it
    node: int | None = None  # where it was measured
    direction: str = ""  # +X to -RZ, as in the file
    reference: Reference | None = None  # what the values are divided by
    scaling: tuple[str, ...] = ()  # what was done to the values of the file, in words
    level: ExcitationLevel | None = None  # of the excitation, by which the values of a ratio were multiplied
    fault: tuple[str, str] | None = None  # why the values cannot be used, and a remedy

    @property
    def function(self) -> FunctionType:
        """Function type: that of the file, else what name, unit and axis say."""
        if self.stated_function is not None:
            return self.stated_function
        if not self.of_frequency:
            return FunctionType.TIME_HISTORY if self.reference is None else FunctionType.IMPULSE_RESPONSE
        if self.reference is not None:
            return FunctionType.FREQUENCY_RESPONSE
        return function_over_frequency(self.name, self.unit)

    @property
    def description(self) -> str:
        """The name with what was done to the values of the file."""
        return ", ".join((self.name, *self.scaling))

    def required(self, functions: Sequence[FunctionType], purpose: str) -> MeasuredSignal:
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
        MeasurementError
            If it is of another type.
        """
        if self.function in functions:
            return self
        *others, last = (each.with_article for each in functions)
        needed = f"{', '.join(others)} or {last}" if others else last
        unit = f" ({self.unit_text})" if self.unit_text and self.unit_text not in self.name else ""
        raise MeasurementError(
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
        MeasurementError
            If the level is missing, or of another quantity than the denominator, or if that has no unit.
        """
        if self.function not in RATIOS:
            return self
        numerator, denominator = ratio_of(self.unit) or (self.unit, "")
        if self.reference is not None:
            numerator, denominator = self.unit, self.reference.unit
        if not denominator:
            raise MeasurementError(
                f"has {self.function.with_article} in {self.name}, and does not state what it is divided by",
                "export it with the unit of its denominator, for example g/N, or export the amplitude spectrum",
            )
        what = f"has {self.function.with_article} in {self.name} ({numerator} per {denominator})"
        remedy = f"give the amplitude of the excitation in the test, for example {key} '2 {denominator}'"
        if level is None:
            raise MeasurementError(f"{what}, and a structure with stops responds differently at each level", remedy)
        try:
            size, dimension = units.read_level(f"1 {denominator}", MEASURED)
            amplitude, stated = units.read_level(level, (dimension or units.ACCELERATION,))
        except units.UnitError as error:
            raise MeasurementError(f"{what}, and {key} = {level} {error.message}", remedy) from None
        if dimension is None or stated is None or amplitude <= 0.0:
            raise MeasurementError(f"{what}, and {key} = {level} is no amplitude with a unit", remedy)
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
        return not self.of_frequency or bool(np.iscomplexobj(self.y))

    def last(self, duration: float | None) -> MeasuredSignal:
        """The last part of a time history, s; the signal itself without a duration, and a spectrum."""
        if duration is None or self.of_frequency:
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
        MeasurementError
            If neither states a unit, or it is not one of time (of frequency).
        """
        if self.fault is not None:  # which `checked` states
            return self
        kind, example = ("frequency", "frequency (Hz)") if self.of_frequency else ("time", "time (ms)")
        named = unit or self.axis_unit
        remedy = f"name its unit in the heading, for example {example}, or give {key}"
        if not named:
            plural = "frequencies" if self.of_frequency else "times"
            raise MeasurementError(f"states no unit of its {plural} (axis {self.axis})", remedy)
        dimension = units.FREQUENCY if self.of_frequency else units.TIME
        try:
            factor = units.read_quantity(f"1 {named}", dimension)
        except units.UnitError as error:
            raise MeasurementError(f"has a {kind} axis in {named}, which {error.message}", remedy) from None
        return replace(self, x=self.x * factor, axis_unit=dimension.unit)

    def checked(self) -> MeasuredSignal:
        """The signal itself.

        Raises
        ------
        MeasurementError
            If the file says that its values cannot be used, if they are not finite, or if the axis does not increase;
            with the number of the first such sample.
        """
        if self.fault is not None:
            raise MeasurementError(*self.fault)
        bad = np.flatnonzero(~np.isfinite(self.y) | ~np.isfinite(self.x))
        if bad.size:
            raise MeasurementError(
                f"has {bad.size} values that are not finite, the first at sample {bad[0] + 1}",
                "repair or remove that part of the record",
            )
        back = np.flatnonzero(np.diff(self.x) <= 0)
        if back.size:
            kind, unit = ("frequency", "Hz") if self.of_frequency else ("time", "s")
            raise MeasurementError(
                f"has a {kind} axis that does not increase at sample {back[0] + 2} "
                f"({self.x[back[0]]:g} {unit}, then {self.x[back[0] + 1]:g} {unit})",
                "sort the samples and remove duplicates, or name the correct column",
            )
        return self


def column_named(signals: Sequence[MeasuredSignal], name: str) -> MeasuredSignal:
    """The column with a heading, its heading without unit, the path of a data set, or a number from 1 as its name.

    Raises
    ------
    MeasurementError
        If there is none.
    """
    headings = [signal.name for signal in signals]
    for names in (headings, [split_heading(heading)[0] for heading in headings]):
        for spelled in (name, label_of(name)):
            if spelled in names:
                return signals[names.index(spelled)]
    if name.isdigit() and 1 <= int(name) <= len(signals):
        return signals[int(name) - 1]
    known = ", ".join(headings[:12]) + (", ..." if len(headings) > 12 else "")
    raise MeasurementError(f"has no column {name} among {len(headings)}", f"name one: {known}")


def by_dimension(signals: Sequence[MeasuredSignal], dimensions: Mapping[str, units.Dimension]) -> dict[str, Floats]:
    """The first column with a unit of each dimension; those without a unit are passed over.

    Parameters
    ----------
    signals : columns of a table.
    dimensions : by the word for what has them.

    Returns
    -------
    dict
        (n,) values in SI units by these words.

    Raises
    ------
    MeasurementError
        If a column has a unit of none of the dimensions.
    """
    found: dict[str, Floats] = {}
    for number, signal in enumerate(signals, 1):
        if not signal.unit:
            continue
        try:
            factor, dimension = units.read_level(f"1 {signal.unit}", tuple(dimensions.values()))
        except units.UnitError:
            *words, last = dimensions
            known = f"{', '.join(words)} or {last}"
            raise MeasurementError(
                f"cannot be used: column {number} is in {signal.unit}, which is no unit of {known}",
                "leave that column out, or correct its unit",
            ) from None
        kind = next(word for word, known in dimensions.items() if known is dimension)
        found.setdefault(kind, np.asarray(signal.y * factor, dtype=float))
    if len({column.size for column in found.values()}) > 1:
        raise MeasurementError("cannot be used: its columns have different lengths", "use a table of equal columns")
    return found


def in_si(signal: MeasuredSignal, unit: str | None, dimension: units.Dimension, at: str) -> MeasuredSignal:
    """The signal converted to SI from the given unit, else from that of the file.

    Parameters
    ----------
    signal : as read.
    unit : of the values; by default the one that the file states.
    dimension : of what is measured.
    at : key of the scenario, or option, with which a user gives the unit.

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
        raise ScenarioError.at(at, f"is missing, and {source} states no unit of {signal.name}", remedy)
    try:
        factor = units.read_quantity(f"1 {named}", dimension)
    except units.UnitError as error:
        given = f"= {named}" if unit else f"is missing, and {source} has values in {named}, which"
        raise ScenarioError.at(at, f"{given} {error.message}", remedy) from None
    return replace(signal, y=signal.y * factor, unit=dimension.unit)
