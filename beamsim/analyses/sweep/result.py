"""Result of a sweep: a curve for every direction and level, their peaks, and a summary."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from beamsim.analyses.sweep.layouts import (
    CURVES,
    FOLLOWED,
    HISTORIES,
    LEVELS,
    LINEAR,
    OF_CURVES,
    PEAKS,
)
from beamsim.inputs.drift import CorrectionSize
from beamsim.labelled import Dataset, LabelledArray, join_tables
from beamsim.responses.gapping import ContactLevels
from beamsim.results.result import (
    CLOSEST_TO_TEST,
    CONVERGENCE,
    GAPPING,
    MARGINS,
    OF_MODES,
    PROCESSOR_TIME,
    STATUS,
    Result,
)
from beamsim.results.values import BY_ENTRY, OUTPUT, RESPONSE, VALUES, Value, largest_in
from beamsim.scenario.quantities import amplitude_unit, level_unit
from beamsim.scenario.reporting import LimitedQuantity
from beamsim.signals.resonance_peaks import QualityPeak, peaks_of
from beamsim.summaries import ByName, Entry, Number, Plain, Text, by_name, list_of, record
from beamsim.system.structural import MODES
from beamsim.typing import Complexes, Floats

LEAST_OFFSET = 1e-6  # relative to the peak
_OF_QUANTITY = ("max_{}", "min_{}", "rms_{}", "mean_{}", "harmonic_{}_real", "harmonic_{}_imag")
_OF_OUTPUT = (
    "output_maximum", "output_minimum", "output_rms", "output_mean", "output_harmonics_real", "output_harmonics_imag",
)  # fmt: skip


class NotchLimit(NamedTuple):
    """Limit that lowers the level, and the largest value of its quantity: a row of `NOTCH_LIMITS`."""

    name: str
    unit: str
    limit: float
    largest: float
    share: float  # largest value over the limit
    frequency_hz: float  # of the cycle with the largest value


class NotchedRange(NamedTuple):
    """Frequency range with a lowered level: a row of `NOTCH_RANGES`."""

    limit: str  # limit that governs most of the range
    from_hz: float
    to_hz: float
    at_hz: float  # frequency of the largest reduction
    level: float  # level at that frequency
    reduction_db: float


@dataclass(frozen=True)
class Notching:
    """Level that keeps the limits: a table for interpolation on log-log axes."""

    quantity: str  # of the levels: acceleration, velocity or displacement of the base, or force
    frequency_hz: Floats  # (P,) Hz, excitation frequency
    level: Floats  # (P,) zero to peak
    specification: Floats  # (P,) specification without notches; its steps take one cycle
    limits: Sequence[NotchLimit] = ()
    ranges: Sequence[NotchedRange] = ()
    trials: int = 0  # short motions computed to choose the level

    @property
    def unit(self) -> str:
        """SI unit of the levels; "1" if they multiply several forces."""
        return level_unit(self.quantity)


@dataclass(frozen=True)
class SweepCurve:
    """Curve of one direction at one level: a row of `curves`, with its rows of the other datasets."""

    name: str  # direction and index of the level, such as up_0
    kind: str  # swept_sine or stepped
    direction: str  # up or down
    level_index: int
    level: float  # with a profile, the factor on it
    level_unit: str  # empty if the level is the factor on a profile
    quantity: str  # prescribed quantity
    tables: Mapping[str, Dataset]  # rows of `OF_CURVES`, by name

    @property
    def cycles(self) -> Dataset:
        """Its C cycles; for a stepped sweep, frequencies."""
        return self.tables["cycles"]

    def __getitem__(self, name: str) -> LabelledArray:
        """Variable of the cycles, such as ``curve["peak_force"].sel(snubber="tip")``."""
        return self.cycles[name]

    @property
    def frequency_hz(self) -> Floats:
        """(C,) excitation frequency, Hz."""
        return self["frequency_hz"].values

    @property
    def time(self) -> Floats:
        """(C,) start time of the cycles, s."""
        return self["time"].values

    @property
    def excitation_amplitude(self) -> Floats:
        """(C,) amplitude of the base acceleration or of the force, zero to peak."""
        return self["excitation_amplitude"].values

    @property
    def excitation_unit(self) -> str:
        """Unit of that amplitude."""
        return amplitude_unit(self.quantity)

    @property
    def orders(self) -> Floats:
        """(R,) orders of the harmonics."""
        return self["order"].values

    def places(self, quantity: str) -> list[str]:
        """Names of the probes, snubbers or outputs with a quantity; empty if it was not evaluated."""
        kept = quantity == "output" or f"peak_{quantity}" in self.cycles
        return self.cycles.labels(FOLLOWED.get(quantity, quantity)) if kept else []

    def channel(self, quantity: str, place: str) -> CycleValues:
        """Values of a quantity at a place in every cycle.

        Parameters
        ----------
        quantity : evaluated quantity, or ``output``.
        place : name of the probe, snubber or output.

        Returns
        -------
        CycleValues
        """
        forms = _OF_OUTPUT if quantity == "output" else _OF_QUANTITY
        at = {FOLLOWED.get(quantity, quantity): place}
        arrays = [self[form.format(quantity)].sel(**at) for form in forms]
        *statistics, real, imaginary = (array.values for array in arrays)
        maximum, minimum, rms, mean = statistics
        return CycleValues(arrays[0].unit, maximum, minimum, rms, mean, real + 1j * imaginary)

    def limited_values(self, limit: LimitedQuantity) -> CycleValues:
        """Values that a limit on the level applies to."""
        quantity = "absolute_acceleration" if limit.quantity == "acceleration" else limit.quantity or "output"
        return self.channel(quantity, limit.item)

    def response(self, probe: str) -> Floats:
        """(C,) largest distance of a probe from static equilibrium, m."""
        high, low = (self[f"{end}_displacement"].sel(probe=probe).values for end in ("max", "min"))
        at_rest = self["static_displacement"].sel(probe=probe).item()
        return np.asarray(np.maximum(np.abs(high - at_rest), np.abs(low - at_rest)))

    def offset(self, probe: str) -> float:
        """Displacement of a probe at static equilibrium if it exceeds round-off, else 0."""
        at_rest = float(self["static_displacement"].sel(probe=probe).item())
        peak = self["peak_displacement"].sel(probe=probe).values
        return at_rest if abs(at_rest) > LEAST_OFFSET * np.nanmax(peak, initial=0.0) else 0.0

    def largest(self) -> Iterator[tuple[Value, str, float, float]]:
        """Largest limited quantities and outputs: value, name, maximum over the cycles, and its frequency, Hz."""
        return largest_in([self.cycles], "frequency_hz")

    def amplitude_at(self, frequency_hz: Floats) -> Floats:
        """Excitation amplitude at any frequencies, Hz; constant beyond the ends."""
        rising = np.argsort(self.frequency_hz, kind="stable")
        return np.interp(frequency_hz, self.frequency_hz[rising], np.abs(self.excitation_amplitude[rising]))

    def rate_at(self, frequency_hz: Floats) -> Floats | None:
        """(n,) sweep rate at given frequencies, Hz/s, constant beyond the ends; None for a stepped sweep."""
        if self.kind == "stepped" or self.time.size < 2:
            return None
        rising, rate = np.argsort(self.frequency_hz, kind="stable"), np.abs(np.gradient(self.frequency_hz, self.time))
        return np.interp(frequency_hz, self.frequency_hz[rising], rate[rising])

    @property
    def notching(self) -> Notching | None:
        """Lowered level with its limits and ranges; None if the sweep has no notching."""
        if "notches" not in self.tables:
            return None
        table = self.tables["notches"]
        frequency_hz, level, specified = (table[name].values for name in ("frequency_hz", "level", "specified"))
        limits = self.tables["notch_limits"].records("limit_number", NotchLimit)
        ranges = self.tables["notch_ranges"].records("range", NotchedRange)
        return Notching(str(table["quantity"].item()), frequency_hz, level, specified, limits, ranges)

    @property
    def has_transmissibility(self) -> bool:
        """True if the base moves, and accelerations with their fundamental were evaluated."""
        kept = bool(self.places("absolute_acceleration")) and bool(np.any(self.orders == 1.0))
        return kept and self.excitation_unit == "m/s^2"

    def transmissibility(self, probe: str) -> Floats:
        """(C,) fundamental of a probe's absolute acceleration over that of the base."""
        (first,) = np.flatnonzero(self.orders == 1.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            harmonics = self.channel("absolute_acceleration", probe).harmonics
            return np.asarray(np.abs(harmonics[first]) / np.abs(self.excitation_amplitude))

    def resonance(self, probe: str) -> QualityPeak | None:
        """Highest peak of the transmissibility, with Q if its half-power band is covered; None without peaks."""
        order = np.argsort(self.frequency_hz)
        peaks = peaks_of(
            self.frequency_hz[order], self.transmissibility(probe)[order], self.rate_at(self.frequency_hz[order])
        )
        return max(peaks, key=lambda peak: peak.level, default=None)

    @property
    def weights(self) -> Floats:
        """(C,) time shares of the cycles of a swept sine; equal weights for a stepped sine."""
        if self.kind == "stepped" or self.time.size == 0:
            return np.full(self.time.size, 1.0 / max(self.time.size, 1))
        duration = np.diff(self.time, append=self.time[-1] + 1.0 / self.frequency_hz[-1])
        return np.asarray(duration / duration.sum())


class CycleValues(NamedTuple):
    """Values of a quantity at a place in C cycles."""

    unit: str
    maximum: Floats  # (C,)
    minimum: Floats  # (C,)
    rms: Floats  # (C,) with the mean
    mean: Floats  # (C,)
    harmonics: Complexes  # (R, C) amplitudes of cos(order phase) minus i times those of sin

    @property
    def peak(self) -> Floats:
        """(C,) largest magnitude."""
        return np.asarray(np.maximum(np.abs(self.maximum), np.abs(self.minimum)))


def tables_of(curves: Sequence[SweepCurve]) -> dict[str, Dataset]:
    """Datasets of several curves, with the rows of one curve after those of another."""
    units = [{"level_unit": curve.level_unit or "1"} for curve in curves]
    tables = {"curves": CURVES.table(curves, units, curve=[curve.name for curve in curves])}
    for layout in OF_CURVES:
        parts = {k: curve.tables[layout.name] for k, curve in enumerate(curves) if layout.name in curve.tables}
        if parts:
            dim = next(iter(layout.variables))
            number = np.repeat(list(parts), [part[dim].values.size for part in parts.values()])
            rows = {dim: 1 + np.arange(number.size), "curve": number}
            tables[layout.name] = join_tables(list(parts.values()), **rows)
    return tables


def curves_of(tables: Mapping[str, Dataset]) -> dict[str, SweepCurve]:
    """Curves contained in datasets, by name.

    Raises
    ------
    ValueError
        If the rows are not ordered by curve.
    """
    described = tables["curves"]
    names, parts = described.labels("curve"), dict[str, list[Dataset]]()
    for layout in OF_CURVES:
        if layout.name in tables:
            table, dim = tables[layout.name], next(iter(layout.variables))
            number = table["curve"].values
            if number.size and (np.any(np.diff(number) < 0) or number[0] < 0 or number[-1] >= len(names)):
                raise ValueError(f"the rows of {layout.name} are not those of one curve after another")
            ends = np.searchsorted(number, np.arange(len(names) + 1)).tolist()
            parts[layout.name] = [table.isel(**{dim: slice(a, b)}) for a, b in pairwise(ends)]
    columns = {name: described[name].values.tolist() for name in CURVES.variables if name != "curve" and names}
    return {
        name: SweepCurve(
            name, **{column: values[k] for column, values in columns.items()},
            tables={table: of[k] for table, of in parts.items()},
        )
        for k, name in enumerate(names)
    }  # fmt: skip


def contact_levels_of(linear: Dataset) -> dict[str, ContactLevels]:
    """Levels at which the linear motion makes or loses contact, by snubber."""
    columns = [f"contact_{name}" for name in ("onset", "loss", "preload_needed", "preload_alone", "valid_below")]
    units = {name: "rad" if of.item() else "m" for name, of in linear.by_label("contact_turns").items()}
    return {
        name: ContactLevels(*(linear[column].sel(snubber=name).values for column in columns), gap_unit=unit)
        for name, unit in units.items()
    }


class ResponsePeak(NamedTuple):
    """Local maximum of a response curve with its classification: a row of `PEAKS`."""

    curve: str
    probe: str
    direction: str
    level: float
    frequency_hz: float
    value_m: float
    kind: str
    order: float
    share: float


PEAK_COLUMNS: dict[str, Any] = {
    "frequency_hz": Number, "value_m": Number, "kind": Text, "direction": Text, "level": Number, "order": Number,
    "probe": Text, "curve": Text,
}  # fmt: skip
"""Columns of the peaks in the summary, with their types."""
CURVE = record({"direction": Text, "level": Number, "points": Number}, {"steady": ByName})
_SUMMARY = (
    STATUS,
    GAPPING,
    CLOSEST_TO_TEST,
    BY_ENTRY["gapping_ratio"].summary_entry("of the strongest sweep, "),
    Entry("peaks", "", "peaks of the response curves: the columns of the table peaks",
          form=list_of(record(PEAK_COLUMNS))),
    Entry("curves", "",
             "by curve its direction, level and number of points, and of a stepped sweep how many motions of "
             "each kind it has", form=by_name(CURVE)),
    Entry("peak_frequencies_hz", "Hz", "by largest value, curve and place the frequency at which it is reached",
             form=dict[str, dict[str, ByName]]),
    Entry("cycles", "1", "cycles of the excitation computed", "solver"),
    Entry("events", "1", "contact events, breakpoints of piecewise-linear springs included", "solver"),
    Entry("truncation", "1", "bound on the truncation error of the expansion of the sine, relative to its amplitude",
             "solver"),
    *CorrectionSize.ENTRIES,
    *(value.summary_entry(by_curve=True) for value in VALUES if value.in_sweeps or value is RESPONSE),
    Entry("contact_share", "1", "by curve, share of its time in contact of a snubber; of a stepped sweep the mean over "
             "the frequencies", "snubbers", form=dict[str, ByName]),
    OUTPUT.summary_entry(by_curve=True),
    Entry("output_unit", "", "units of the outputs", form=dict[str, Text]),
    Entry("notches", "", "by curve, the limits of sweep.notch_to with the largest values, and the ranges in which each "
             "governs", form=dict[str, Plain]),
    Entry("impacts", "", "by curve and snubber the largest values per cycle, if sweep.impacts asks for them",
             form=dict[str, Plain]),
    Entry("sliding", "", "by curve and friction contact the largest values per cycle, likewise",
             form=dict[str, Plain]),
    Entry("energy_error", "1", "largest imbalance of the energies along a curve, over the largest energy", "solver"),
    MARGINS,
    *OF_MODES,
    *CONVERGENCE,
    PROCESSOR_TIME,
)  # fmt: skip


@dataclass(frozen=True, kw_only=True, repr=False)
class SweepResult(Result):
    """Result of `beamsim.sweep`: for each direction and level a curve of cycles, with peaks over frequency.

    Examples
    --------
    >>> import beamsim
    >>> stepped = {"sweep": {"kind": "stepped", "from": "14 Hz", "to": "18 Hz", "points": 3}}
    >>> result = beamsim.sweep(beamsim.load_scenario("configs/stops/chain_bumpers.yaml", stepped))
    >>> list(result.curves), result["steady_states"]["frequency_hz"].values.tolist()
    (['up_0'], [14.0, 16.0, 18.0])
    >>> force = result["cycles"]["peak_force"].sel(snubber="bumper")
    >>> force.dims, force.unit, round(force.values.max().item(), 1)
    (('cycle',), 'N', 129.0)
    >>> result.peaks  # three frequencies show no resonance
    []
    """

    KIND = "sweep"
    SUMMARY = _SUMMARY
    DATASETS = (CURVES, *OF_CURVES, PEAKS, LEVELS, HISTORIES, LINEAR, MODES)

    @cached_property
    def curves(self) -> dict[str, SweepCurve]:
        """Curves by name (``up_0``: upwards, first level), each with its rows of ``cycles`` and other datasets."""
        return curves_of(self.datasets)

    @cached_property
    def peaks(self) -> list[ResponsePeak]:
        """Peaks of all curves: frequency, level, probe, value, kind (linear or nonlinear resonance, harmonic)."""
        return self["peaks"].records("peak", ResponsePeak)

    def unit_of(self, entry: Entry, place: tuple[str, ...], keys: tuple[str, ...], record: Mapping[str, Any]) -> str:
        """Unit of values whose entry does not name it; see `Result.unit_of`."""
        if keys == ("level",) and entry.name in ("curves", "peaks"):
            return str(self["curves"]["level_unit"].sel(curve=record.get("curve") or place[0]).item())
        if entry.name == "notches" and keys[-1] in ("limit", "largest", "level") and keys != ("limit",):
            return str(record.get("unit") or level_unit(self["notches"]["quantity"].item()))
        return super().unit_of(entry, place, keys, record)
