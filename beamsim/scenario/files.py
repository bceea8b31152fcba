"""Files that a section names: how a text table is read, and how a measured record is prepared before it is used."""

from __future__ import annotations

from typing import Annotated, Literal

from beamsim.scenario import quantities as q
from beamsim.scenario.base import Schema, ShortFor

DecimalMark = Literal[".", ","]


class TableFile(Schema):
    """A table in a text file."""

    file: q.FileName
    """CSV or other text file, relative to the scenario's folder."""
    decimal: DecimalMark | None = None
    """Decimal mark of its numbers, "." or ","; needed where exactly three digits follow every point or comma (1,104),
    so that it could also separate thousands."""


class CurveFile(TableFile):
    """A curve over frequency in a text file."""

    column: q.Text | None = None
    """Heading or number of the column of values, where several could be meant."""


AnyTableFile = Annotated[TableFile, ShortFor("file")]
SHORT_FOR_FILE = ShortFor("file")


class RecordPreparation(Schema):
    """Preparation of the values of a record, in the order of the keys."""

    factor: q.NonzeroNumber = 1.0
    """Factor by which the values are multiplied; -1 for a sensor that was mounted upside down."""
    remove: Literal["mean", "trend"] | None = None
    """Taken away from a time history: its mean, such as gravity or the offset of an amplifier, or the straight line
    that fits it best."""
    high_pass: q.Frequency | None = None
    """-3 dB frequency of a high-pass filter without phase (Butterworth, fourth order) against drift of a time history;
    well below the lowest frequency of the motion."""
