"""Text tables in files: the keys that say how one is read."""

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
