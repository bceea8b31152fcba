"""Results of a comparison with measured signals."""

from __future__ import annotations

import numpy as np

from beamsim.analyses.result import Result
from beamsim.analyses.run.result import Spectrum
from beamsim.fields import Entry, attribute, axis, dataset, declared, group, numbered, stored
from beamsim.typing import Complexes, Floats, Ints

_ORDER = ("order",)
_TIME = ("time",)


@declared
class ChannelComparison:
    """One quantity at one place, predicted and measured."""

    place: str = attribute("", "name of the probe; that of the snubber for a force")
    quantity: str = attribute("", "quantity that is compared")
    unit: str = attribute("", "its unit")
    channel: str = attribute("", "channel of the measurement")
    source: str = attribute("", "file of the measurement")
    excitation_hz: float = attribute("Hz", "frequency of the excitation; NaN where there is none")
    delay_s: float = attribute("s", "measured(t) = predicted(t + delay)")
    order: Ints = axis("1", "frequency over excitation frequency")
    predicted: Complexes = dataset(  # A e^{i phase} of A sin(2 pi f n t + phase)
        "{unit}", "predicted harmonic, zero to peak", along=_ORDER,
        phase="phase of the predicted harmonic as a sine, in the time of the prediction",
    )  # fmt: skip
    measured: Complexes = dataset(  # amplitudes alone where phases are unknown
        "{unit}", "measured harmonic, zero to peak", along=_ORDER,
        phase="phase of the measured harmonic as a sine, in the time of the prediction",
    )  # fmt: skip
    measured_noise: Floats = dataset("{unit}", "standard deviation of the measured harmonic", along=_ORDER)
    has_phase: bool = attribute("", "whether the measured phases are known")
    rms_difference: float = attribute(
        "1",
        "rms of the difference of the aligned histories over that of the measured one; NaN without histories",
    )
    # a few periods; the measured ones are shifted to the time of the prediction, empty for a measured spectrum
    predicted_time: Floats = axis("s", "time", name="predicted_history/time")
    predicted_history: Floats = dataset(
        "{unit}", "predicted {quantity}", along=_TIME, name="predicted_history/{quantity}"
    )
    measured_time: Floats = axis("s", "time", name="measured_history/time")
    measured_history: Floats = dataset("{unit}", "measured {quantity}", along=_TIME, name="measured_history/{quantity}")
    predicted_spectrum: Spectrum = group("predicted_spectrum")
    measured_spectrum: Spectrum = group("measured_spectrum")
    start_s: float | None = attribute("s", "start of the part of the run that is compared", default=None)

    @property
    @stored(dataset("dB", "20 log10(predicted / measured)", along=_ORDER))
    def difference_db(self) -> Floats:
        """(h,) 20 log10(predicted / measured amplitude)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(20 * np.log10(np.abs(self.predicted) / np.abs(self.measured)))

    @property
    @stored(dataset("degree", "predicted over measured, aligned", along=_ORDER))
    def phase_difference_deg(self) -> Floats:
        """(h,) phase of the predicted harmonic over the measured one, after alignment; nan where phases are unknown."""
        if not self.has_phase:
            return np.full(self.order.size, np.nan)
        return np.asarray(np.degrees(np.angle(self.predicted * np.conj(self.measured))))


@declared
class Comparison(Result):
    """Result of ``beamsim compare``."""

    SUMMARY = (
        Entry("comparisons", "", "by channel: place, quantity, delay, rms difference, and its harmonics one by one",
                 "channels"),
    )  # fmt: skip

    channels: tuple[ChannelComparison, ...] = numbered("channels", start=1, required=True)
