"""Results of a comparison with measured signals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from beamsim.fields import (
    Counter,
    Entry,
    Number,
    Plain,
    attribute,
    axis,
    dataset,
    declared,
    group,
    members,
    record,
    stored,
    table,
    unit_in,
)
from beamsim.outcomes import COMPLETE, Outcome, OutcomeKind
from beamsim.results.result import CONVERGENCE, MARGINS, Result
from beamsim.typing import Bools, Complexes, Floats

_ORDER = ("order",)


@declared(along=("frequency_hz",))
class RecordComparison:
    """A record that does not repeat, predicted and measured, while both last."""

    unit: str = attribute("", "unit of the quantity")
    predicted_peak: float = attribute("{unit}", "largest magnitude of the prediction")
    measured_peak: float = attribute("{unit}", "largest magnitude of the measurement")
    scale: float = attribute("1", "predicted over measured: the prediction over this fits the measurement best")
    scale_error: float = attribute("1", "standard error of the scale, from leaving out tenths of the record")
    correlation: float = attribute("1", "correlation of both about zero")
    quality: float = attribute("1", "quality factor of the oscillators")
    frequency_hz: Floats = axis("Hz", "natural frequency of the oscillators")
    predicted_response: Floats = dataset("{unit}", "response spectrum of the prediction, maximax")
    measured_response: Floats = dataset("{unit}", "response spectrum of the measurement, maximax")

    @property
    @stored(dataset("dB", "20 log10(predicted / measured response spectrum)"))
    def difference_db(self) -> Floats:
        """(nf,) of the response spectra."""
        return np.asarray(20 * np.log10(self.predicted_response / self.measured_response))

    def summary(self) -> dict[str, float]:
        """The numbers, with the largest difference of the spectra."""
        at = int(np.argmax(np.abs(self.difference_db)))
        numbers = {"largest_difference_db": self.difference_db[at], "largest_frequency_hz": self.frequency_hz[at]}
        numbers["peak_ratio"] = self.predicted_peak / self.measured_peak
        names = ("predicted_peak", "measured_peak", "scale", "scale_error", "correlation")
        return {name: getattr(self, name) for name in names} | {name: float(x) for name, x in numbers.items()}


@declared
class ComparedChannel:
    """What is compared with which channel."""

    place: str = attribute("", "name of the probe or output; that of the snubber for a force or moment")
    quantity: str = attribute("", "quantity that is compared")
    unit: str = attribute("", "its unit")
    channel: str = attribute("", "channel of the measurement")
    source: str = attribute("", "file of the measurement")


@declared(along=("frequency_hz",))
class ComparedSpectrum:
    """Single-sided spectrum of a record."""

    place: str = attribute("", "name of the probe or output")
    quantity: str = attribute("", "absolute_acceleration or displacement; of an output what it is")
    unit: str = attribute("", "unit of the quantity")
    frequency_hz: Floats = axis("Hz", "frequency")
    amplitude: Floats = dataset("{unit}", "single-sided peak amplitude of the {quantity}")
    amplitude_db: Floats = dataset("dB", "20 log10(amplitude / max |x|) of the {quantity}")


ROUND_OFF = 1e-9  # of the largest harmonic: what no record resolves


@declared(along=_ORDER)
class ChannelComparison(ComparedChannel):
    """One quantity at one place, predicted and measured."""

    excitation_hz: float = attribute("Hz", "frequency of the excitation; NaN where there is none")
    delay_s: float = attribute("s", "measured(t) = predicted(t + delay)")
    order: Floats = axis("1", "frequency over excitation frequency")
    # A e^{i phase} of A sin(2 pi f n t + phase)
    predicted: Complexes = dataset(
        "{unit}",
        "predicted harmonic, zero to peak",
        imaginary="its imaginary part, as a sine in the time of the prediction",
    )
    # amplitudes alone where phases are unknown
    measured: Complexes = dataset(
        "{unit}",
        "measured harmonic, zero to peak",
        imaginary="its imaginary part, as a sine in the time of the prediction",
    )
    measured_noise: Floats = dataset("{unit}", "standard deviation of the measured harmonic")
    has_phase: bool = attribute("", "whether the measured phases are known")
    rms_difference: float = attribute(
        "1",
        "rms of the difference of the aligned histories over that of the measured one; NaN without histories",
    )
    # a few periods; the measured ones are shifted to the time of the prediction, empty for a measured spectrum
    predicted_time: Floats = axis("s", "time")
    predicted_history: Floats = dataset("{unit}", "predicted {quantity}", along=("predicted_time",))
    measured_time: Floats = axis("s", "time")
    measured_history: Floats = dataset("{unit}", "measured {quantity}", along=("measured_time",))
    predicted_spectrum: ComparedSpectrum = group("predicted_spectrum", ComparedSpectrum)
    measured_spectrum: ComparedSpectrum = group("measured_spectrum", ComparedSpectrum)
    start_s: float | None = attribute("s", "start of the part of the run that is compared", default=None)
    aliased_share: float | None = attribute(
        "1",
        "share of the run's root mean square above half its output rate, which its harmonics and spectrum show at "
        "lower frequencies",
        default=None,
    )
    record: RecordComparison | None = group("record", RecordComparison, default=None)  # of histories that do not repeat

    @property
    def is_round_off(self) -> Bools:
        """(h,) whether a harmonic of either is nothing but round-off beside the largest of its own."""
        sizes = (np.abs(self.predicted), np.abs(self.measured))
        return np.asarray(np.any([size <= ROUND_OFF * size.max(initial=0.0) for size in sizes], axis=0))

    @property
    @stored(dataset("dB", "20 log10(predicted / measured); NaN where one is round-off"))
    def difference_db(self) -> Floats:
        """(h,) 20 log10(predicted / measured amplitude); nan where one of them is round-off."""
        with np.errstate(divide="ignore", invalid="ignore"):
            difference = 20 * np.log10(np.abs(self.predicted) / np.abs(self.measured))
        return np.where(self.is_round_off, np.nan, difference)

    @property
    @stored(dataset("degree", "predicted over measured, aligned"))
    def phase_difference_deg(self) -> Floats:
        """(h,) phase of the predicted harmonic over the measured one, after alignment; nan where it is unknown."""
        if not self.has_phase:
            return np.full(self.order.size, np.nan)
        phase = np.degrees(np.angle(self.predicted * np.conj(self.measured)))
        return np.where(self.is_round_off, np.nan, phase)


@declared
class PeakPair:
    """A measured peak over frequency, and the computed one beside it; NaN where there is none."""

    measured_hz: float = dataset("Hz", "frequency of the measured peak")
    predicted_hz: float = dataset("Hz", "frequency of the computed peak")
    measured_level: float = dataset("", "level of the measured peak, in the unit of the channel")
    predicted_level: float = dataset("", "level of the computed peak, in the unit of the channel")
    measured_q: float = dataset("1", "measured frequency over the half-power band; NaN where that has no end")
    predicted_q: float = dataset("1", "computed frequency over the half-power band; NaN where that has no end")

    @property
    @stored(dataset("1", "computed frequency over the measured one, less 1"))
    def frequency_difference(self) -> float:
        """Relative difference of the frequencies."""
        return self.predicted_hz / self.measured_hz - 1.0

    @property
    @stored(dataset("dB", "20 log10(computed / measured level)"))
    def difference_db(self) -> float:
        """Difference of the levels, dB."""
        return float(20 * np.log10(self.predicted_level / self.measured_level))


@declared(along=("frequency_hz",))
class SweptComparison(ComparedChannel):
    """One quantity at one place over the frequency of a sweep, predicted and measured."""

    curve: str = attribute("", "curve of the sweep")
    detector: str = attribute("", "what is compared of each cycle: peak, fundamental or rms")
    has_phase: bool = attribute("", "whether phases are compared, too")
    frequency_hz: Floats = axis("Hz", "excitation frequency, those of the measurement")
    predicted: Complexes = dataset("{unit}", "predicted response", imaginary="its imaginary part")
    measured: Complexes = dataset("{unit}", "measured response", imaginary="its imaginary part")
    frac: float = attribute("1", "frequency response assurance criterion")
    peaks: tuple[PeakPair, ...] = table("peaks", PeakPair, Counter("peak", "number of the measured peak"), default=())
    begin_s: float | None = attribute(
        "s", "time of the measured history at which the curve begins; of a history alone", default=None
    )
    bandwidth: float | None = attribute(
        "1", "bandwidth of the tracking filter over the frequency; of the fundamental of a history alone", default=None
    )


@declared
class Assurance:
    """Frequency domain assurance criterion: likeness of the deflection at two frequencies, over all channels."""

    predicted_hz: Floats = axis("Hz", "frequency of the prediction")
    measured_hz: Floats = axis("Hz", "frequency of the measurement")
    fdac: Floats = dataset("1", "frequency domain assurance criterion", along=("predicted_hz", "measured_hz"))

    def summary(self) -> dict[str, float]:
        """Mean and lowest value at equal frequencies, and where that is."""
        diagonal = np.diagonal(self.fdac)
        lowest = int(np.argmin(diagonal))
        return {"mean": float(np.mean(diagonal)), "lowest": float(diagonal[lowest]),
                "lowest_hz": float(self.measured_hz[lowest])}  # fmt: skip


FDAC = record(dict.fromkeys(("mean", "lowest", "lowest_hz"), Number))


@declared(repr=False)
class Comparison(Result):
    """Result of ``beamsim compare``."""

    KIND = "compare"
    SUMMARY = (
        Entry("comparisons", "", "by channel: place, quantity, delay, rms difference, and its harmonics one by one; of "
                 "a record that does not repeat peaks, scale, correlation, largest difference of response spectra",
             form=list[Plain]),
        Entry("sweeps", "", "by channel of a sweep: place, quantity, curve, FRAC, and its peaks",
                 form=list[Plain]),
        Entry("fdac", "", "of two or more channels of a sweep, frequency domain assurance criterion at equal "
                 "frequencies: its mean, its lowest value and where that is", form=FDAC),
        MARGINS,
        *(entry for entry in CONVERGENCE if entry.name == "doubtful"),
    )  # fmt: skip

    channels: tuple[ChannelComparison, ...] = members("channels", ChannelComparison, "comparison", default=())
    sweeps: tuple[SweptComparison, ...] = members("sweeps", SweptComparison, "comparison", default=())
    assurance: Assurance | None = group("assurance", Assurance, default=None)  # of two channels of a sweep or more

    def unit_of(self, entry: Entry, place: tuple[str, ...], keys: tuple[str, ...], record: Mapping[str, Any]) -> str:
        """That of values which the name does not say; see `Result.unit_of`."""
        compared: Sequence[ComparedChannel] = self.sweeps if entry.name == "sweeps" else self.channels
        if entry.name in ("comparisons", "sweeps") and keys[-1].startswith(("predicted", "measured")):
            return unit_in(keys[-1]) or ("1" if keys[-1].endswith("_q") else compared[int(place[0]) - 1].unit)
        return super().unit_of(entry, place, keys, record)


def outcome_of_comparison(result: Result) -> Outcome:
    """The outcome of a comparison with a result: that of the result, which no comparison makes reliable.

    Parameters
    ----------
    result : of a run or a sweep, which is compared with a measurement.

    Returns
    -------
    Outcome
        Incomplete where the result was interrupted: the comparison was not.
    """
    outcome = result.outcome
    if outcome.interrupted:
        sentence = f"what is compared was {outcome.text}"
        return Outcome.of(OutcomeKind.INCOMPLETE, "result_interrupted", sentence, remedy="compute the whole of it")
    return (
        COMPLETE if outcome.kind is OutcomeKind.COMPLETE and outcome.complete else replace(outcome, within="the result")
    )
