"""What a result states of records and random inputs: their size, their sampling, and how they were made."""

from __future__ import annotations

from dataclasses import dataclass
from math import nan
from typing import Any, ClassVar

from beamsim.fields import Entry, Plain, dataset, declared


@declared
class InputStatement:
    """Size, sampling and treatment of one input."""

    ENTRY: ClassVar[Entry] = Entry(
        "inputs", "", "by path of the excitation, of random inputs and records: rms (of a random input that of its "
        "density, clipping included), unit, sample_rate_hz, and what was done to make it",
        form=dict[str, Plain],
    )  # fmt: skip
    path: str = dataset("1", "path of the excitation in the scenario")
    quantity: str = dataset("1", "quantity of the input")
    unit: str = dataset("1", "unit of the input")
    rms: float = dataset("", "root mean square: of a random input that of its density, clipping included; of a record "
                             "that of its samples as they are used")  # fmt: skip
    sample_rate_hz: float = dataset("Hz", "samples per second; those between which the input is interpolated")
    treatment: str = dataset("1", "what was done to make the input, in order")
    from_hz: float = dataset("Hz", "lower end of the density of a random input; nan of a record", default=nan)
    to_hz: float = dataset("Hz", "upper end of that density; nan of a record", default=nan)
    line_spacing_hz: float = dataset("Hz", "distance of the sines of a random input; nan of a record", default=nan)

    def summary(self) -> dict[str, Any]:
        """What a summary states."""
        keys = ("rms", "unit", "sample_rate_hz", "treatment")
        return {key: value for key in keys if (value := getattr(self, key)) != ""}


@dataclass(frozen=True)
class InputAccount:
    """What a result says of one input: its statement, and warnings about it that follow the path of the excitation."""

    statement: InputStatement | None = None
    warnings: tuple[str, ...] = ()
