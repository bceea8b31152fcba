"""How a measured record is prepared before it is used: keys that all sections with a time history in a file share."""

from __future__ import annotations

from typing import Literal

from beamsim.scenario import quantities as q
from beamsim.scenario.base import Schema


class RecordPreparation(Schema):
    """What is done to the values of a record, in the order of the keys."""

    factor: q.NonzeroNumber = 1.0
    """Factor by which the values are multiplied; -1 for a sensor that was mounted upside down."""
    remove: Literal["mean", "trend"] | None = None
    """Taken away from a time history: its mean, such as gravity or the offset of an amplifier, or the straight line
    that fits it best."""
    high_pass: q.Frequency | None = None
    """-3 dB frequency of a high-pass filter without phase (Butterworth, fourth order) against drift of a time history;
    well below the lowest frequency of the motion."""
