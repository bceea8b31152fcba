"""Records of a test before and after another one, whose resonances are compared."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, ClassVar

from beamsim.scenario import quantities as q
from beamsim.scenario import units
from beamsim.scenario.base import InvalidValueError, Schema, ShortFor
from beamsim.scenario.excitation import FrequencyRange
from beamsim.scenario.files import SHORT_FOR_FILE, DecimalMark, RecordPreparation


class RecordedSweep(FrequencyRange):
    """The sine sweep in which a record was made."""

    rate: q.SweepRate
    """Sweep rate: oct/min (logarithmic) or Hz/s (linear)."""
    begin: q.Time | None = None
    """Time in the record at which the sweep begins; by default found from the record."""

    range_remedy: ClassVar[str] = (
        "give the range of the test: from 20 Hz to 400 Hz, or from 400 Hz to 20 Hz if it falls"
    )

    def rate_at(self, frequency_hz: float) -> float:
        """Sweep rate at a frequency, Hz/s, negative of a falling frequency."""
        sign = 1.0 if self.to > self.from_ else -1.0
        return sign * self.rate.value * (frequency_hz * math.log(2.0) if self.rate.unit == "oct/s" else 1.0)


class TestRecord(RecordPreparation):
    """A file with records of a test, or with functions over frequency that were made of them."""

    __test__ = False  # keep pytest from collecting this class

    file: q.FileName
    """Test data: CSV, HDF5 (also a beamsim result), netCDF-4, MATLAB or UFF dataset 58; the path is relative to the
    scenario's folder."""
    decimal: DecimalMark | None = None
    """Decimal mark in a text file, "." or ","; by default detected from the numbers."""
    unit: q.Text | None = None
    """Unit of the values in the file, for example g or mm; by default the unit in the file."""
    axis_unit: q.Text | None = None
    """Unit of the times or frequencies in the file, for example ms; by default the unit in the file."""
    sweep: RecordedSweep | None = None
    """The sine sweep of the test; its fundamental is tracked in time histories, and its rate displaces resonances in
    all records."""
    cycles: Annotated[int, q.WholeNumber(1, 1000)] = 1
    """Number of cycles over which the fundamental of a sweep is averaged: the bandwidth is the frequency over it."""
    line_spacing: q.Frequency | None = None
    """Distance of the lines of the spectral densities (Welch's method) that are made of time histories of a random
    test."""
    reference: q.Text | None = None
    """Channel of the excitation: time histories are compared by the response over it, a transmissibility or frequency
    response function. By default they are compared by their own amplitudes."""

    def check(self) -> None:
        """Refuse settings that exclude each other."""
        self.exclude("line_spacing", "sweep", remedy="a test is a sine sweep or random, keep one of the two")
        if self.cycles > 1 and self.sweep is None:
            raise InvalidValueError("belongs to a sine sweep", "give sweep, or leave it out", ("cycles",))


class ChannelPair(Schema):
    """A channel with different names in the two files; may be abbreviated to its common name."""

    before: q.Text
    """Name in the file before."""
    after: q.Text | None = None
    """Name in the file after; by default the same."""


AnyTestRecord = Annotated[TestRecord, SHORT_FOR_FILE]
AnyChannelPair = Annotated[ChannelPair, ShortFor("before")]


class SearchedRange(FrequencyRange):
    """A range of frequencies in which resonances are compared."""

    range_noun: ClassVar[str] = "range"
    falling_range_remedy: ClassVar[str] = "exchange the two"


class BeforeAfter(Schema):
    """Test data before and after another test, such as a qualification test; their resonances are compared."""

    before: AnyTestRecord
    """The file before."""
    after: AnyTestRecord
    """The file after."""
    channels: tuple[AnyChannelPair, ...] = ()
    """Channels to compare: names that both files have, or {before: NAME, after: NAME}; by default all that have the
    same name in both."""
    within: SearchedRange | None = None
    """Frequencies in which resonances are compared; by default all that both records have."""
    pairing: Annotated[float, q.Quantity(replace(units.RATIO, example="15 %"), above=0.0, maximum=0.5)] = 0.15
    """Largest relative difference of the frequencies of two peaks that can be the same resonance."""
