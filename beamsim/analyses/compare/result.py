"""Result of a comparison with measured signals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from beamsim.labelled import ROW, Dataset, Layout, Variable
from beamsim.outcomes import COMPLETE, Outcome, OutcomeKind
from beamsim.results.result import CONVERGENCE, MARGINS, Result
from beamsim.summaries import Entry, Number, Plain, record, unit_in
from beamsim.typing import Bools, Complexes, Floats

_CHANNEL, _ROW, _SAMPLE = ("comparison",), ("row",), ("sample",)
_COMPARISON_NUMBER = "number of the comparison, from 0"
_ABOUT = {
    "comparison": Variable(_CHANNEL, "1", _COMPARISON_NUMBER, int),
    "place": Variable(_CHANNEL, "", "name of the probe or output; that of the snubber for a force or moment", str),
    "quantity": Variable(_CHANNEL, "", "quantity that is compared", str),
    "unit": Variable(_CHANNEL, "", "its unit", str),
    "channel": Variable(_CHANNEL, "", "channel of the measurement", str),
    "source": Variable(_CHANNEL, "", "file of the measurement", str),
    "has_phase": Variable(_CHANNEL, "1", "whether the phases are compared, too", bool, flags=("no", "yes")),
}
_OF_RECORD = {  # of a transient record; NaN for a periodic one
    "predicted_peak": Variable(_CHANNEL, "", "largest magnitude of the prediction, in the unit of the channel"),
    "measured_peak": Variable(_CHANNEL, "", "largest magnitude of the measurement, in the unit of the channel"),
    "scale": Variable(
        _CHANNEL, "1", "predicted over measured: the prediction over this fits the measurement best"
    ),
    "scale_error": Variable(
        _CHANNEL, "1", "standard error of the scale, from leaving out tenths of the record"
    ),
    "correlation": Variable(_CHANNEL, "1", "correlation of both about zero"),
    "quality": Variable(_CHANNEL, "1", "quality factor of the oscillators"),
}  # fmt: skip
CHANNELS = Layout(
    "channels",
    "Channels that are compared with a run, a row for each.",
    {
        **_ABOUT,
        "excitation_hz": Variable(_CHANNEL, "Hz", "frequency of the excitation; NaN where there is none"),
        "start_s": Variable(_CHANNEL, "s", "start of the part of the run that is compared"),
        "delay_s": Variable(_CHANNEL, "s", "measured(t) = predicted(t + delay)"),
        "rms_difference": Variable(
            _CHANNEL, "1",
            "rms of the difference of the aligned histories over that of the measured one; NaN without histories",
        ),
        "aliased_share": Variable(
            _CHANNEL, "1",
            "share of the run's root mean square above half its output rate, which its harmonics and spectrum show at "
            "lower frequencies; NaN where it is not notable",
        ),
        **_OF_RECORD,
    },
    optional=True,
)  # fmt: skip


def _rows(
    name: str, text: str, columns: Mapping[str, tuple[str, str]], dim: str = "row", owner: str = "channels"
) -> Layout:
    """Layout of a table with the rows of all comparisons, one after the other; columns with unit and meaning."""
    along = (dim,)
    return Layout(
        name,
        text,
        {
            dim: Variable(along, "1", ROW, int),
            "comparison": Variable(along, "1", _COMPARISON_NUMBER, int, names=f"{owner}/comparison"),
            **{column: Variable(along, unit, meaning) for column, (unit, meaning) in columns.items()},
        },
        optional=True,
    )


_COMPLEX = {
    "predicted_real": ("", "predicted value, zero to peak, in the unit of the channel: real part"),
    "predicted_imag": ("", "its imaginary part, as a sine in the time of the prediction"),
    "measured_real": ("", "measured value, zero to peak, in the unit of the channel: real part"),
    "measured_imag": ("", "its imaginary part, as a sine in the time of the prediction; 0 where phases are unknown"),
}
_HISTORY = {"time": ("s", "time, of the prediction"), "history": ("", "the values, in the unit of the channel")}
_SPECTRUM = {
    "frequency_hz": ("Hz", "frequency"),
    "amplitude": ("", "single-sided peak amplitude, in the unit of the channel"),
    "amplitude_db": ("dB", "20 log10(amplitude / max |x|)"),
}
HARMONICS = _rows(
    "harmonics", "Harmonics of all channels.",
    {
        "order": ("1", "frequency over excitation frequency"), **_COMPLEX,
        "measured_noise": ("", "standard deviation of the measured harmonic, in the unit of the channel"),
        "difference_db": ("dB", "20 log10(predicted / measured); NaN where one is round-off"),
        "phase_difference_deg": ("degree", "predicted over measured, aligned"),
    },
)  # fmt: skip
RECORDS = {
    f"{side}_{what}": _rows(f"{side}_{what}", f"{side.capitalize()} {what} of all channels.", columns, "sample")
    for what, columns in (("histories", _HISTORY), ("spectra", _SPECTRUM))
    for side in ("predicted", "measured")
}
"""A few periods, or a complete transient record; empty for a measured spectrum."""
RESPONSE_SPECTRA = _rows(
    "response_spectra", "Response spectra, maximax, of records that do not repeat.",
    {
        "frequency_hz": ("Hz", "natural frequency of the oscillators"),
        "predicted_response": ("", "of the prediction, in the unit of the channel"),
        "measured_response": ("", "of the measurement, in the unit of the channel"),
        "difference_db": ("dB", "20 log10(predicted / measured response spectrum)"),
    },
)  # fmt: skip
SWEEPS = Layout(
    "sweeps",
    "Channels that are compared with a sweep, a row for each.",
    {
        **_ABOUT,
        "curve": Variable(_CHANNEL, "", "curve of the sweep", str),
        "detector": Variable(_CHANNEL, "", "compared value of each cycle: peak, fundamental or rms", str),
        "frac": Variable(_CHANNEL, "1", "frequency response assurance criterion"),
        "begin_s": Variable(
            _CHANNEL, "s", "time of the measured history at which the curve begins; NaN of responses over frequency"
        ),
        "bandwidth": Variable(
            _CHANNEL, "1",
            "bandwidth of the tracking filter over the frequency; NaN but of the fundamental of a history",
        ),
    },
    optional=True,
)  # fmt: skip
SWEEP_RESPONSES = _rows(
    "sweep_responses", "Responses over the frequencies of the measurements.",
    {"frequency_hz": ("Hz", "excitation frequency"), **_COMPLEX}, owner="sweeps",
)  # fmt: skip
SWEEP_PEAKS = _rows(
    "sweep_peaks", "Measured peaks over frequency, each with the paired computed one, or NaN.",
    {
        "measured_hz": ("Hz", "frequency of the measured peak"),
        "predicted_hz": ("Hz", "frequency of the computed peak"),
        "measured_level": ("", "level of the measured peak, in the unit of the channel"),
        "predicted_level": ("", "level of the computed peak, in the unit of the channel"),
        "measured_q": ("1", "measured frequency over the half-power band; NaN where that has no end or "
            "the sweep is too fast to show it"),
        "predicted_q": ("1", "computed frequency over the half-power band; NaN where that has no end or "
            "the sweep is too fast to show it"),
        "frequency_difference": ("1", "computed frequency over the measured one, less 1"),
        "difference_db": ("dB", "20 log10(computed / measured level)"),
    },
    "peak", "sweeps",
)  # fmt: skip
ASSURANCE = Layout(
    "assurance",
    "Frequency domain assurance criterion: likeness of the deflection at two frequencies, over all channels.",
    {
        "predicted_hz": Variable(("predicted_hz",), "Hz", "frequency of the prediction"),
        "measured_hz": Variable(("measured_hz",), "Hz", "frequency of the measurement"),
        "fdac": Variable(("predicted_hz", "measured_hz"), "1", "frequency domain assurance criterion"),
    },
    optional=True,
)

_PAIR = ("pair",)
RECORD_PAIRS = Layout(
    "record_pairs",
    "Channels of two tests whose resonances are compared, a row for each.",
    {
        "pair": Variable(_PAIR, "1", "number of the pair of channels, from 0", int),
        "channel": Variable(_PAIR, "", "channel of the test before", str),
        "channel_after": Variable(_PAIR, "", "channel of the test after", str),
        "unit": Variable(_PAIR, "", "unit of both", str),
        "source": Variable(_PAIR, "", "file of the test before", str),
        "source_after": Variable(_PAIR, "", "file of the test after", str),
    },
    optional=True,
)


def _pair_rows(name: str, dim: str, text: str, columns: Mapping[str, Variable]) -> Layout:
    """Layout of a table with the rows of all pairs of channels, one after the other."""
    own = {
        dim: Variable((dim,), "1", ROW, int),
        "pair": Variable((dim,), "1", "number of the pair of channels, from 0", int, names="record_pairs/pair"),
    }
    return Layout(name, text, {**own, **columns}, optional=True)


SHIFTED = ("frequency", "amplitude", "damping")
_RESONANCE = ("resonance",)
RESONANCES = _pair_rows(
    "resonances", "resonance",
    "Resonances of two tests, a row for each; NaN in the test where one is missing.",
    {
        **{
            f"{side}_{name}": Variable(_RESONANCE, unit, f"{text} in the test {side}")
            for side in ("before", "after")
            for name, unit, text in (
                ("hz", "Hz", "frequency of the peak"),
                ("level", "", "level of the peak, in the unit of the channel,"),
                ("damping", "1", "damping ratio by the half-power band; NaN where that is not known,"),
            )
        },
        **{
            f"{name}_shift{ending}": Variable(_RESONANCE, "1", f"{text} {name}")
            for name in SHIFTED
            for ending, text in (
                ("", "change relative to the test before: of the"),
                ("_of_sweep", "part of the change that the sweep rate explains: of the"),
                ("_resolution", "change that the resolution can explain: of the"),
                ("_lowest", "smallest magnitude of the change less the part of the sweep: of the"),
                ("_highest", "largest magnitude of the change less the part of the sweep: of the"),
            )
        },
        **{
            f"{name}_significant": Variable(
                _RESONANCE, "1", f"whether sweep rate and resolution do not explain the change of the {name}", bool,
                flags=("no", "yes"),
            )
            for name in SHIFTED
        },
    },
)  # fmt: skip
_LINE = ("line",)
RECORD_CURVES = {
    f"responses_{side}": _pair_rows(
        f"responses_{side}", "line", f"Responses over frequency in the test {side}.",
        {
            "frequency_hz": Variable(_LINE, "Hz", "frequency"),
            "amplitude": Variable(_LINE, "", "amplitude, in the unit of the channel"),
        },
    )
    for side in ("before", "after")
}  # fmt: skip


class Shift(NamedTuple):
    """Change of a value between two tests, relative to the one before."""

    change: float
    of_sweep: float  # part that the sweep rate explains
    resolution: float  # change that the resolution can explain
    lowest: float  # smallest magnitude of the change less the part of the sweep
    highest: float  # largest such magnitude
    significant: bool  # whether sweep rate and resolution do not explain it


class ResonanceShift(NamedTuple):
    """A resonance before and after a test, and how it changed; NaN where it is missing or not known.

    Changes are relative to the test before.
    """

    before_hz: float
    before_level: float
    before_damping: float
    after_hz: float
    after_level: float
    after_damping: float
    frequency: Shift
    amplitude: Shift
    damping: Shift

    @property
    def is_paired(self) -> bool:
        """Whether both tests have it."""
        return self.before_hz == self.before_hz and self.after_hz == self.after_hz


@dataclass(frozen=True, kw_only=True)
class RecordPair:
    """A channel before and after a test: responses over frequency, and resonances."""

    channel: str
    channel_after: str
    unit: str
    source: str
    source_after: str
    before: tuple[Floats, Floats]  # frequency, Hz, and amplitude
    after: tuple[Floats, Floats]
    resonances: tuple[ResonanceShift, ...] = ()


@dataclass(frozen=True)
class RecordComparison:
    """Comparison of a predicted and a measured transient record over their common time."""

    predicted_peak: float
    measured_peak: float
    scale: float
    scale_error: float
    correlation: float
    quality: float
    frequency_hz: Floats  # (nf,) Hz, natural frequencies of the oscillators
    predicted_response: Floats  # (nf,)
    measured_response: Floats  # (nf,)

    @property
    def difference_db(self) -> Floats:
        """(nf,) difference of the response spectra, dB."""
        return np.asarray(20 * np.log10(self.predicted_response / self.measured_response))

    def summary(self) -> dict[str, float]:
        """Values of the comparison, with the largest difference of the spectra."""
        at = int(np.argmax(np.abs(self.difference_db)))
        numbers = {"largest_difference_db": self.difference_db[at], "largest_frequency_hz": self.frequency_hz[at]}
        numbers["peak_ratio"] = self.predicted_peak / self.measured_peak
        names = ("predicted_peak", "measured_peak", "scale", "scale_error", "correlation")
        return {name: getattr(self, name) for name in names} | {name: float(x) for name, x in numbers.items()}


class ComparedSpectrum(NamedTuple):
    """Single-sided spectrum of a record."""

    frequency_hz: Floats
    amplitude: Floats
    amplitude_db: Floats


ROUND_OFF = 1e-9  # relative to the largest harmonic; below the resolution of records


@dataclass(frozen=True, kw_only=True)
class ComparedChannel:
    """Place, quantity and measured channel of a comparison."""

    place: str
    quantity: str
    unit: str
    channel: str
    source: str
    has_phase: bool


@dataclass(frozen=True, kw_only=True)
class ChannelComparison(ComparedChannel):
    """Predicted and measured quantity at a place; fields are variables of the datasets."""

    excitation_hz: float
    delay_s: float
    order: Floats
    predicted: Complexes  # A e^{i phase} of A sin(2 pi f n t + phase)
    measured: Complexes  # amplitudes only if phases are unknown
    measured_noise: Floats
    rms_difference: float
    predicted_time: Floats
    predicted_history: Floats
    measured_time: Floats
    measured_history: Floats
    predicted_spectrum: ComparedSpectrum
    measured_spectrum: ComparedSpectrum
    start_s: float
    aliased_share: float | None = None
    record: RecordComparison | None = None  # of transient histories

    @property
    def is_round_off(self) -> Bools:
        """(h,) True for harmonics that are round-off relative to the largest of the same signal."""
        sizes = (np.abs(self.predicted), np.abs(self.measured))
        return np.asarray(np.any([size <= ROUND_OFF * size.max(initial=0.0) for size in sizes], axis=0))

    @property
    def difference_db(self) -> Floats:
        """(h,) 20 log10(predicted / measured amplitude); nan if one of them is round-off."""
        with np.errstate(divide="ignore", invalid="ignore"):
            difference = 20 * np.log10(np.abs(self.predicted) / np.abs(self.measured))
        return np.where(self.is_round_off, np.nan, difference)

    @property
    def phase_difference_deg(self) -> Floats:
        """(h,) phase of the predicted minus the measured harmonic after alignment; nan if it is unknown."""
        if not self.has_phase:
            return np.full(self.order.size, np.nan)
        phase = np.degrees(np.angle(self.predicted * np.conj(self.measured)))
        return np.where(self.is_round_off, np.nan, phase)


class PeakPair(NamedTuple):
    """Measured peak over frequency with its computed partner; NaN if there is none."""

    measured_hz: float
    predicted_hz: float
    measured_level: float
    predicted_level: float
    measured_q: float
    predicted_q: float

    @property
    def frequency_difference(self) -> float:
        """Relative difference of the frequencies."""
        return self.predicted_hz / self.measured_hz - 1.0

    @property
    def difference_db(self) -> float:
        """Difference of the levels, dB."""
        return float(20 * np.log10(self.predicted_level / self.measured_level))


@dataclass(frozen=True, kw_only=True)
class SweptComparison(ComparedChannel):
    """Predicted and measured quantity at a place over the frequency of a sweep."""

    curve: str
    detector: str
    frequency_hz: Floats
    predicted: Complexes
    measured: Complexes
    frac: float
    peaks: tuple[PeakPair, ...] = ()
    begin_s: float | None = None
    bandwidth: float | None = None


class Assurance(NamedTuple):
    """Frequency domain assurance criterion: similarity of the deflections at two frequencies, over all channels."""

    predicted_hz: Floats
    measured_hz: Floats
    fdac: Floats

    def summary(self) -> dict[str, float]:
        """Mean and lowest value at equal frequencies, and the frequency of the lowest."""
        diagonal = np.diagonal(self.fdac)
        lowest = int(np.argmin(diagonal))
        return {"mean": float(np.mean(diagonal)), "lowest": float(diagonal[lowest]),
                "lowest_hz": float(self.measured_hz[lowest])}  # fmt: skip


# --- As datasets, and back -------------------------------------------------------------------------------------------


def _table(layout: Layout, parts: Sequence[Mapping[str, Any]]) -> Dataset:
    """Concatenate the rows of all comparisons."""
    dim, *_ = layout.variables
    columns = [name for name in layout.variables if name not in (dim, "comparison")]
    sizes = [len(part[columns[0]]) for part in parts]
    values = {name: np.concatenate([np.asarray(part[name], dtype=float) for part in parts]) for name in columns}
    comparison = np.repeat(np.arange(len(parts)), np.array(sizes, dtype=np.int64))
    return layout.dataset({dim: 1 + np.arange(sum(sizes)), "comparison": comparison, **values})


def _parts(values: Complexes, side: str) -> dict[str, Floats]:
    return {f"{side}_real": values.real, f"{side}_imag": values.imag}


def channel_datasets(channels: Sequence[ChannelComparison]) -> dict[str, Dataset]:
    """Datasets of a comparison with a run."""
    unknown = dict.fromkeys(_OF_RECORD, np.nan)
    of_record = [unknown if c.record is None else {name: getattr(c.record, name) for name in unknown} for c in channels]
    about: dict[str, Any] = {name: [row[name] for row in of_record] for name in _OF_RECORD}
    number = np.arange(len(channels))
    datasets = {"channels": CHANNELS.table(channels, comparison=number, **about)}
    derived = ("order", "measured_noise", "difference_db", "phase_difference_deg")
    rows = [
        {**_parts(c.predicted, "predicted"), **_parts(c.measured, "measured"), **{n: getattr(c, n) for n in derived}}
        for c in channels
    ]
    datasets["harmonics"] = _table(HARMONICS, rows)
    for side in ("predicted", "measured"):
        histories = [{n: getattr(c, f"{side}_{n}") for n in _HISTORY} for c in channels]
        datasets[f"{side}_histories"] = _table(RECORDS[f"{side}_histories"], histories)
        spectra = [getattr(c, f"{side}_spectrum")._asdict() for c in channels]
        datasets[f"{side}_spectra"] = _table(RECORDS[f"{side}_spectra"], spectra)
    none = dict.fromkeys(("frequency_hz", "predicted_response", "measured_response", "difference_db"), np.zeros(0))
    spectra = [none if c.record is None else {name: getattr(c.record, name) for name in none} for c in channels]
    if any(c.record is not None for c in channels):
        datasets["response_spectra"] = _table(RESPONSE_SPECTRA, spectra)
    return datasets


def sweep_datasets(channels: Sequence[SweptComparison], assurance: Assurance | None) -> dict[str, Dataset]:
    """Datasets of a comparison with a sweep."""
    number = np.arange(len(channels))
    responses = [
        {"frequency_hz": c.frequency_hz, **_parts(c.predicted, "predicted"), **_parts(c.measured, "measured")}
        for c in channels
    ]
    columns = (*PeakPair._fields, "frequency_difference", "difference_db")
    peaks = [{name: [getattr(peak, name) for peak in c.peaks] for name in columns} for c in channels]
    datasets = {
        "sweeps": SWEEPS.table(channels, comparison=number),
        "sweep_responses": _table(SWEEP_RESPONSES, responses),
        "sweep_peaks": _table(SWEEP_PEAKS, peaks),
    }
    return datasets if assurance is None else datasets | {"assurance": ASSURANCE.dataset(assurance._asdict())}


_OF_SHIFT = ("", "_of_sweep", "_resolution", "_lowest", "_highest")
_OF_TESTS = ResonanceShift._fields[:6]


def pair_datasets(pairs: Sequence[RecordPair]) -> dict[str, Dataset]:
    """Datasets of a comparison of two tests."""
    found = [resonance for pair in pairs for resonance in pair.resonances]
    columns: dict[str, Any] = {name: [getattr(each, name) for each in found] for name in _OF_TESTS}
    for name in SHIFTED:
        shifts = [getattr(each, name) for each in found]
        columns |= {f"{name}_shift{end}": [each[k] for each in shifts] for k, end in enumerate(_OF_SHIFT)}
        columns[f"{name}_significant"] = [each.significant for each in shifts]
    tables = [(RESONANCES, "resonance", [len(pair.resonances) for pair in pairs], columns)]
    for side in ("before", "after"):
        curves = [getattr(pair, side) for pair in pairs]
        rows = {n: np.concatenate([curve[k] for curve in curves]) for k, n in enumerate(("frequency_hz", "amplitude"))}
        tables.append((RECORD_CURVES[f"responses_{side}"], "line", [curve[0].size for curve in curves], rows))
    datasets = {"record_pairs": RECORD_PAIRS.table(pairs, pair=np.arange(len(pairs)))}
    for layout, dim, sizes, values in tables:
        owner = np.repeat(np.arange(len(pairs)), np.array(sizes, dtype=np.int64))
        datasets[layout.name] = layout.dataset({dim: 1 + np.arange(sum(sizes)), "pair": owner, **values})
    return datasets


def _pair_of(datasets: Mapping[str, Dataset], number: int) -> RecordPair:
    """Channels of two tests, from their rows."""
    about = datasets["record_pairs"].rows("pair", *[name for name in RECORD_PAIRS.variables if name != "pair"])[number]
    of_pair = {
        name: {key: array.values[table["pair"].values == number] for key, array in table.items()}
        for name, table in datasets.items()
        if name in ("resonances", *RECORD_CURVES)
    }
    rows = of_pair["resonances"]
    resonances = []
    for k in range(rows["before_hz"].size):
        shifts: list[Any] = [
            Shift._make(
                [*(float(rows[f"{name}_shift{end}"][k]) for end in _OF_SHIFT), bool(rows[f"{name}_significant"][k])]
            )
            for name in SHIFTED
        ]
        resonances.append(ResonanceShift._make((*(float(rows[name][k]) for name in _OF_TESTS), *shifts)))
    before, after = ((of_pair[name]["frequency_hz"], of_pair[name]["amplitude"]) for name in RECORD_CURVES)
    return RecordPair(**about, before=before, after=after, resonances=tuple(resonances))


def _rows_of(table: Dataset, number: int) -> dict[str, Floats]:
    """Columns of a table for one comparison."""
    own = table["comparison"].values == number
    return {name: array.values[own] for name, array in table.items()}


def _complex(rows: Mapping[str, Floats], side: str) -> Complexes:
    return np.asarray(rows[f"{side}_real"] + 1j * rows[f"{side}_imag"])


def _row_values(table: Dataset, number: int, names: Sequence[str]) -> dict[str, Any]:
    """Values of a row; None for unknown numbers."""
    values = table.rows("comparison", *names)[number]
    return {name: None if value != value and name in _OPTIONAL else value for name, value in values.items()}


_OPTIONAL = ("aliased_share", "begin_s", "bandwidth")  # None if NaN


def _channel_of(datasets: Mapping[str, Dataset], number: int) -> ChannelComparison:
    """Channel of a comparison with a run, from its rows."""
    about = _row_values(datasets["channels"], number, [name for name in CHANNELS.variables if name != "comparison"])
    of_record = {name: about.pop(name) for name in _OF_RECORD}
    harmonics, record = _rows_of(datasets["harmonics"], number), None
    computed, recorded = (_rows_of(datasets[f"{side}_histories"], number) for side in ("predicted", "measured"))
    spectra = [_rows_of(datasets[f"{side}_spectra"], number) for side in ("predicted", "measured")]
    if not np.isnan(of_record["quality"]):
        of = _rows_of(datasets["response_spectra"], number)
        responses = (of[name] for name in ("frequency_hz", "predicted_response", "measured_response"))
        record = RecordComparison(*of_record.values(), *responses)
    predicted, measured = (ComparedSpectrum(*(of[name] for name in ComparedSpectrum._fields)) for of in spectra)
    return ChannelComparison(
        **about,
        order=harmonics["order"],
        predicted=_complex(harmonics, "predicted"),
        measured=_complex(harmonics, "measured"),
        measured_noise=harmonics["measured_noise"],
        predicted_time=computed["time"],
        predicted_history=computed["history"],
        measured_time=recorded["time"],
        measured_history=recorded["history"],
        predicted_spectrum=predicted,
        measured_spectrum=measured,
        record=record,
    )


def _sweep_of(datasets: Mapping[str, Dataset], number: int) -> SweptComparison:
    """Channel of a comparison with a sweep, from its rows."""
    about = _row_values(datasets["sweeps"], number, [name for name in SWEEPS.variables if name != "comparison"])
    responses = _rows_of(datasets["sweep_responses"], number)
    peaks = datasets["sweep_peaks"].groups("comparison", range(number + 1))[number].records("peak", PeakPair)
    return SweptComparison(
        **about,
        frequency_hz=responses["frequency_hz"],
        predicted=_complex(responses, "predicted"),
        measured=_complex(responses, "measured"),
        peaks=tuple(peaks),
    )


FDAC = record(dict.fromkeys(("mean", "lowest", "lowest_hz"), Number))


@dataclass(frozen=True, repr=False)
class Comparison(Result):
    """Result of `beamsim.compare` and `beamsim.compare_tests`: each compared channel with its differences.

    Examples
    --------
    >>> import beamsim
    >>> changes = {"run.convergence": "off", "run.duration": "0.3 s", "run.spectrum.last": "0.1 s"}
    >>> result = beamsim.run(beamsim.load_scenario("configs/one_sided_65hz.yaml", changes))
    >>> pairs = beamsim.pair_channels(result, "configs/measurements/tip_65hz_2g.csv")
    >>> comparison = beamsim.compare(result, pairs)
    >>> channel = comparison.channels[0]
    >>> channel.place, channel.quantity, comparison.sweeps, comparison.assurance
    ('tip', 'absolute_acceleration', (), None)
    >>> list(comparison.datasets)[:4]
    ['channels', 'harmonics', 'predicted_histories', 'predicted_spectra']
    """

    KIND = "compare"
    DATASETS = (
        CHANNELS, HARMONICS, *RECORDS.values(), RESPONSE_SPECTRA, SWEEPS, SWEEP_RESPONSES, SWEEP_PEAKS, ASSURANCE,
        RECORD_PAIRS, RESONANCES, *RECORD_CURVES.values(),
    )  # fmt: skip
    SUMMARY = (
        Entry("comparisons", "", "by channel: place, quantity, delay, rms difference, and its harmonics one by one; of "
                 "a record that does not repeat peaks, scale, correlation, largest difference of response spectra",
             form=list[Plain]),
        Entry("sweeps", "", "by channel of a sweep: place, quantity, curve, FRAC, and its peaks",
                 form=list[Plain]),
        Entry("fdac", "", "of two or more channels of a sweep, frequency domain assurance criterion at equal "
                 "frequencies: its mean, its lowest value and where that is", form=FDAC),
        Entry("resonances", "", "of two tests, by channel and resonance: frequency, level and damping before and "
              "after; of each its change, relative to the test before, the parts that sweep rate and resolution "
              "explain, and whether it is significant", form=list[Plain]),
        MARGINS,
        *(entry for entry in CONVERGENCE if entry.name == "doubtful"),
    )  # fmt: skip

    @cached_property
    def channels(self) -> tuple[ChannelComparison, ...]:
        """Channels that are compared with a run: harmonics, aligned histories, spectra; of a transient its peaks."""
        return tuple(_channel_of(self.datasets, k) for k in self._numbers("channels"))

    @cached_property
    def sweeps(self) -> tuple[SweptComparison, ...]:
        """Channels that are compared with a sweep: complex responses over frequency, peaks, FRAC."""
        return tuple(_sweep_of(self.datasets, k) for k in self._numbers("sweeps"))

    @cached_property
    def pairs(self) -> tuple[RecordPair, ...]:
        """Channels of two tests that are compared: responses over frequency and resonances."""
        count = len(self["record_pairs"].labels("pair")) if "record_pairs" in self.datasets else 0
        return tuple(_pair_of(self.datasets, k) for k in range(count))

    @property
    def assurance(self) -> Assurance | None:
        """Assurance criteria of two or more channels of a sweep over frequency; None of others."""
        of = self.datasets.get("assurance")
        return None if of is None else Assurance(*(of[name].values for name in Assurance._fields))

    def _numbers(self, dataset: str) -> range:
        return range(len(self[dataset].labels("comparison")) if dataset in self.datasets else 0)

    def unit_of(self, entry: Entry, place: tuple[str, ...], keys: tuple[str, ...], record: Mapping[str, Any]) -> str:
        """That of values which the name does not say; see `Result.unit_of`."""
        if entry.name == "resonances" and keys[-1].endswith("_level"):
            return next(pair.unit for pair in self.pairs if pair.channel == record["channel"])
        compared: Sequence[ComparedChannel] = self.sweeps if entry.name == "sweeps" else self.channels
        if entry.name in ("comparisons", "sweeps") and keys[-1].startswith(("predicted", "measured")):
            return unit_in(keys[-1]) or ("1" if keys[-1].endswith("_q") else compared[int(place[0]) - 1].unit)
        return super().unit_of(entry, place, keys, record)


def outcome_of_comparison(result: Result) -> Outcome:
    """Outcome of a comparison, which is not more reliable than the compared result.

    Parameters
    ----------
    result : run or sweep that is compared with a measurement.

    Returns
    -------
    Outcome
        Incomplete if the result was interrupted; the comparison itself was not.
    """
    outcome = result.outcome
    if outcome.interrupted:
        sentence = f"the result was {outcome.text}"
        return Outcome.of(OutcomeKind.INCOMPLETE, "result_interrupted", sentence, remedy="compute all of it")
    return (
        COMPLETE
        if outcome.kind is OutcomeKind.COMPLETE and outcome.complete
        else replace(outcome, context="the result")
    )
