"""Descriptions of records and random inputs in results: size, sampling, and treatment."""

from __future__ import annotations

from dataclasses import dataclass
from math import nan

from beamsim.labelled import Layout, Variable

_NUMBER = ("number",)
INPUTS = Layout(
    "inputs",
    "Size, sampling and treatment of records and random inputs.",
    {
        "number": Variable(_NUMBER, "1", "number of the input", int),
        "path": Variable(_NUMBER, "", "path of the excitation in the scenario", str),
        "quantity": Variable(_NUMBER, "", "quantity of the input", str),
        "unit": Variable(_NUMBER, "", "unit of the input", str),
        "rms": Variable(
            _NUMBER, "{unit}", "root mean square: of a random input that of its density, clipping included; of a "
            "record that of its samples as they are used",
        ),
        "peak": Variable(
            _NUMBER, "{unit}", "largest magnitude of a record's samples after conditioning; NaN for a random input",
            optional=True,
        ),
        "sample_rate_hz": Variable(
            _NUMBER, "Hz", "sample rate of the input, which is interpolated between its samples"
        ),
        "treatment": Variable(_NUMBER, "", "what was done to make the input, in order", str),
        "from_hz": Variable(_NUMBER, "Hz", "lower end of the frequency range of a random input; NaN for a record"),
        "to_hz": Variable(_NUMBER, "Hz", "upper end of the frequency range of a random input; NaN for a record"),
        "line_spacing_hz": Variable(
            _NUMBER, "Hz", "frequency spacing of the sines of a random input; NaN for a record"
        ),
    },
    optional=True,
)  # fmt: skip


@dataclass(frozen=True)
class InputStatement:
    """Size, sampling and treatment of one input; see `INPUTS`."""

    path: str
    quantity: str
    unit: str
    rms: float
    sample_rate_hz: float
    treatment: str
    from_hz: float = nan
    to_hz: float = nan
    line_spacing_hz: float = nan
    peak: float = nan


@dataclass(frozen=True)
class InputAccount:
    """What a result reports about one input: its statement, and warnings that are prefixed by the input's path."""

    statement: InputStatement | None = None
    warnings: tuple[str, ...] = ()
