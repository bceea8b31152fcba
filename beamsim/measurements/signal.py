"""A measured channel: labelled values with a unit on an axis of time or frequency; names and units in headings."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from beamsim.errors import ScenarioError
from beamsim.scenario import units
from beamsim.typing import Complexes, Floats

TIME_NAMES = ("time", "t", "zeit", "temps")
_FREQUENCY_NAMES = ("frequency", "f", "freq", "frequenz", "fréquence")

_BRACKETS = re.compile(r"(.*?)\s*[(\[]([^)\]]*)[)\]]\s*")
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
class MeasuredSignal:
    """One measured channel: a time history, or a spectrum of single-sided peak amplitudes."""

    name: str  # with its unit, where the file has it there
    x: Floats  # (n,) s or Hz, increasing; as read from a file, in `axis_unit`, and sample numbers where `axis` is empty
    y: Floats | Complexes  # (n,) in `unit`; complex: amplitude e^{i phase} of A cos(2 pi f t + phase)
    of_frequency: bool = False
    unit: str = ""  # as given in the file, or empty
    source: str = ""  # file
    axis: str = ""  # heading of the axis
    axis_unit: str = ""  # the same as `unit`

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
            If values are not finite, or the axis does not increase; with the number of the first such sample.
        """
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
