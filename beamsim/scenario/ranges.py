"""Ranges that a quantity runs through, from one value to another."""

from __future__ import annotations

from typing import ClassVar, Generic, TypeVar

from pydantic import Field

from beamsim.scenario.base import Schema, fail
from beamsim.scenario.quantities import Frequency, Quantity

Number = TypeVar("Number")


class Span(Schema, Generic[Number]):
    """A quantity changes from one value to another."""

    from_: Number = Field(alias="from")
    """First value."""
    to: Number
    """Last value."""

    changing: ClassVar[str] = "continuation"
    suitable: ClassVar[str] = "give a range"

    def settle(self) -> None:
        """Reject an empty range."""
        super().settle()
        if self.from_ == self.to:
            types = type(self).model_fields["to"].metadata
            unit = next((item.dimension.unit for item in types if isinstance(item, Quantity)), "")
            shown = f"{self.to:g} {unit}".rstrip()
            raise fail(f"= {shown} equals the start of the {self.changing}", self.suitable, ("to",))


class FrequencyRange(Span[Frequency]):
    """A frequency that is swept."""

    changing: ClassVar[str] = "sweep"
    suitable: ClassVar[str] = "give a range, from 20 Hz to 400 Hz"
