"""Result of ``beamsim run``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from beamsim.analyses.run.layouts import (
    BODIES,
    CONTACT,
    EVENTS,
    FATIGUE,
    FRICTION_INTERVALS,
    HISTORIES,
    IMPACT_STATISTICS,
    IMPACTS,
    MATCHED,
    RANDOM,
    RINGS,
    SENSITIVITIES,
    SPECTRA,
    SRS,
)
from beamsim.inputs.drift import CorrectionSize
from beamsim.inputs.statements import INPUTS
from beamsim.labelled import Dataset
from beamsim.results.result import CONVERGENCE, GAPPING, MARGINS, OF_MODES, PROCESSOR_TIME, STATUS, Result
from beamsim.results.values import BY_ENTRY, VALUES
from beamsim.scenario.units import STANDARD_GRAVITY
from beamsim.summaries import (
    ByName,
    Entry,
    Flag,
    Number,
    Plain,
    Text,
    by_name,
    list_of,
    record,
)
from beamsim.system.structural import MODES
from beamsim.typing import Floats

MAIN_QUANTITY = "absolute_acceleration"  # of probes
ALLOWED_REMAINDER = 0.02  # of a steady line
STATISTICS = ("rms", "crest_factor", "kurtosis", "crossing_rate_hz", "peaks_over_2_sigma", "peaks_over_3_sigma")
_FREQUENCY = ("frequency_hz",)


def over_limit(frequency_hz: Floats, spectra: Iterable[tuple[str, Floats, Floats]]) -> dict[str, tuple[float, float]]:
    """Largest ratio of each spectrum to its limit, and its frequency, by name.

    Parameters
    ----------
    frequency_hz : (nf,) Hz.
    spectra : name, values (nf,) and limit (nf,) of each; nan where there is no limit.
    """
    ratios = {name: values / limit for name, values, limit in spectra if not np.isnan(limit).all()}
    known = {name: (ratio, int(np.nanargmax(ratio))) for name, ratio in ratios.items() if np.isfinite(ratio).any()}
    return {name: (float(ratio[k]), float(frequency_hz[k])) for name, (ratio, k) in known.items()}


def highest_of_srs(srs: Dataset) -> dict[str, dict[str, float]]:
    """Highest point of each maximax spectrum, in g, and its frequency, by signal."""
    highest = {name: (x.values, int(x.values.argmax())) for name, x in srs.by_label("maximax").items()}
    frequency = srs["frequency_hz"].values
    return {
        name: {"maximax_g": float(x[k]) / STANDARD_GRAVITY, "frequency_hz": float(frequency[k])}
        for name, (x, k) in highest.items()
    }


def srs_over_limit(srs: Dataset) -> dict[str, tuple[float, float]]:
    """Largest ratio of each maximax spectrum to its limit curve, and its frequency, Hz, by name."""
    if "limit" not in srs:
        return {}
    spectra = zip(srs["name"].values.tolist(), srs["maximax"].values, srs["limit"].values, strict=True)
    return over_limit(srs["frequency_hz"].values, spectra)


def misfit_of_matched(matched: Dataset) -> dict[str, float]:
    """Largest deviations below and above its curve of the base motion that is furthest from it, and its band."""
    each = matched.by_label("misfit_db")
    motion = max(each, key=lambda name: float(np.nanmax(np.abs(each[name].values))))
    misfit, quality = each[motion].values, matched["quality"].sel(base_motion=motion).item()
    band = matched["frequency_hz"].values[np.isfinite(misfit)]
    return {
        "lowest_db": float(np.nanmin(misfit)),
        "highest_db": float(np.nanmax(misfit)),
        "from_hz": float(band[0]),
        "to_hz": float(band[-1]),
        "quality": float(quality),
    }


LINE = record(
    {"probe": Text, "quantity": Text, "kind": Text,
     **dict.fromkeys(("order", "frequency_hz", "amplitude", "amplitude_db"), Number)},
    {"error": Number},
)  # fmt: skip
UNRESOLVED_LINE = record(
    {"probe": Text, "quantity": Text,
     **dict.fromkeys(("frequency_hz", "remainder", "resolution_hz", "separating_duration_s"), Number)},
)  # fmt: skip
COMPARED = record({
    "method": Text, "values": by_name(by_name(record({"exact": Number, "stepped": Number, "unit": Text}))),
    **dict.fromkeys(
        ("agrees_until_s", "largest_state_difference", "largest_time_difference_s", "exact_processor_time_s",
         "processor_time_s", "evaluations"), Number),
})  # fmt: skip
RANDOM_SIGNAL = record(dict.fromkeys(("rms", "crest_factor", "kurtosis"), Number))
RATIOS = ("crest_factor", "kurtosis", "crossing_rate_hz", "peaks_over_2_sigma", "peaks_over_3_sigma",
          "degrees_of_freedom", "expected_peak_unknown")  # fmt: skip
MISFIT = record(dict.fromkeys(("lowest_db", "highest_db", "from_hz", "to_hz", "quality"), Number))
_SUMMARY = (
    STATUS,
    Entry("inputs", "", "by path of the excitation, of random inputs and records: rms (of a random input that of its "
          "density, clipping included), unit, sample_rate_hz, and what was done to make it", form=dict[str, Plain]),
    BY_ENTRY["contact_share"].summary_entry(),
    BY_ENTRY["contacts"].summary_entry(),
    Entry("events", "1", "closings and openings of all snubbers"),
    Entry("linear", "", "whether contact neither begins nor ends and no spring is nonlinear", form=Flag),
    GAPPING,
    BY_ENTRY["gapping_ratio"].summary_entry(),
    *(value.summary_entry() for value in VALUES if value.from_extreme),
    Entry("peak_times_s", "s", "by entry (peak_force_n, peak_displacement_m, peak_acceleration_g) and name: when the "
             "peak is reached; of equal peaks any of them", form=dict[str, ByName]),
    Entry("gap_m", "m", "clearance of a snubber, resolved where a preload was given", "snubbers", form=ByName),
    BY_ENTRY["static_force_n"].summary_entry(),
    Entry("blocked_force_n", "N", "contact force of a snubber with the structure held at zero displacement", "snubbers",
             form=ByName),
    Entry("gap_rad", "rad", "clearance of a stop of a hinge at the angle zero", "snubbers", form=ByName),
    BY_ENTRY["static_moment_n_m"].summary_entry(),
    Entry("blocked_moment_n_m", "N m", "contact moment of a stop of a hinge that is held at the angle zero", "snubbers",
             form=ByName),
    Entry("stiffness_ratio", "1", "k L^3 / (E I) of a snubber; in a chain, k over the largest spring stiffness",
             "snubbers",
             form=ByName),
    Entry("residual_crush_m", "m", "of a snubber that yields, how far it stays crushed at the end", "snubbers",
             form=ByName),
    Entry("residual_crush_rad", "rad", "of a stop of a hinge that yields, likewise", "snubbers",
             form=ByName),
    Entry("impacts", "", "statistics of the impacts by snubber, if run.impacts asks for them; units are in the names",
             form=by_name(record({"restitution": Number}))),
    Entry("impacts_total", "", "total over all snubbers", form=Plain),
    Entry("rms_displacement_m", "m", "rms of a probe's relative displacement over the time of the spectra", "probes",
             form=ByName),
    Entry("rms_acceleration_g", "g", "rms of its absolute acceleration, likewise", "probes", form=ByName),
    Entry("friction", "", "by friction contact share of time, number and distance of sliding, energy and power lost, "
             "wear power, worn volume and force at the start; units are in the names",
             form=dict[str, Plain]),
    Entry("rings", "", "by ring number of sides, and the largest errors of the sides: of the clearance, of force and "
             "direction, and of the impulse of an impact", form=dict[str, Plain]),
    Entry("breakpoints_passed", "1", "breakpoints of piecewise-linear springs that were passed", "solver"),
    Entry("rms_output", "", "rms over the time of the spectra; energies have none", "outputs", form=ByName),
    Entry("output_unit", "", "units of the outputs", form=dict[str, Text]),
    BY_ENTRY["largest_bending_stress_position_m"].summary_entry(),
    Entry("largest_bending_stress_y_m", "m", "on a plate the y coordinate", "bodies"),
    Entry("largest_bending_stress_body", "", "body on which it is, if there are several", "bodies", form=Text),
    Entry("largest_von_mises_stress_pa", "Pa", "largest von Mises stress at the surface of a plate",
             "bodies"),
    BY_ENTRY["srs_over_limit"].summary_entry(),
    BY_ENTRY["psd_over_limit"].summary_entry(),
    MARGINS,
    Entry("fatigue", "", "by body rainflow count and damage where its damage is largest, if run.fatigue asks for it",
             form=dict[str, Plain]),
    Entry("random", "", "of a stationary random input, by signal: rms with its 95 % interval, crest factor, kurtosis, "
             "largest value expected in the test with its interval, and more",
             form=by_name(RANDOM_SIGNAL)),
    Entry("random_linear", "", "of a random input, by signal: standard deviation of the run, and of the linear "
             "structure with every snubber always open and always closed", form=dict[str, ByName]),
    Entry("srs", "", "of shock response spectra, by signal: highest point of the maximax spectrum, and where it is",
             form=dict[str, ByName]),
    Entry("matched", "", "of the matched base motion that is furthest from its curve: how far its shock response "
             "spectrum is below and above it, in which band and with which quality factor", form=MISFIT),
    Entry("spectral_lines", "", "lines of all spectra: probe, quantity and the columns of lines",
             form=list_of(LINE), ranked_by="amplitude_db"),
    Entry("aliased_in_histories", "1", "by place and quantity: share of the root mean square that lies above half the "
          "output rate (of a time-stepped motion above a quarter), where above 0.1 %; a spectrum of the samples shows "
          "it at lower frequencies, those of the run are free of it", form=ByName),
    Entry("unresolved_lines", "", "lines with a remainder above 2 %, which are several lines or change during the "
          "record: probe, quantity, frequency_hz, remainder; resolution_hz, the smallest distance of lines that can be "
          "separated; separating_duration_s, which separates the two lines that explain the curve best (null: they are "
          "farther apart than that)", form=list_of(UNRESOLVED_LINE), ranked_by="remainder"),
    *OF_MODES,
    *CONVERGENCE,
    BY_ENTRY["energy_error"].summary_entry(),
    Entry("sensitivities", "", "by value, as studies name it, and by path of run.sensitivities: derivative, those for "
             "smaller and larger numbers where another extreme takes over (derivative_below, derivative_above), "
             "tolerance, "
             "change of the value where the number is larger and where it is smaller by it (change, change_below), and "
             "the change of the number within which the derivative holds, in SI units",
             form=dict[str, dict[str, Plain]]),
    Entry("method", "", "exact, or reference with its integrator", "solver", form=Text),
    Entry("samples", "1", "samples of the histories", "solver"),
    Entry("memory_bytes", "B", "bound on what the run keeps in memory, run.memory", "solver"),
    Entry("contact_states_kept", "1", "contact states whose tables were kept at once, where the motion visited more",
             "solver"),
    Entry("solver_events", "1", "contact events, those of springs and friction included", "solver"),
    Entry("evaluations", "1", "evaluations of the event functions", "solver"),
    Entry("segments", "1", "time segments between events", "solver"),
    Entry("contact_states", "1", "contact states that were diagonalised", "solver"),
    PROCESSOR_TIME,
    *CorrectionSize.ENTRIES,
    Entry("against", "", "differences from the reference integrator (`--against`) by value, and the cost of both",
             form=COMPARED),
)  # fmt: skip


@dataclass(frozen=True, kw_only=True, repr=False)
class RunResult(Result):
    """Result of `beamsim.run`: the motion in time, its contacts and peaks, spectra, and what was asked for in addition.

    Examples
    --------
    >>> import beamsim
    >>> result = beamsim.run("configs/stops/chain_bumpers.yaml")
    >>> result["histories"]["snubber_force"].sel(snubber="bumper").unit
    'N'
    >>> round(result.summary["peak_force_n"]["bumper"], 2), result.summary["contacts"]["bumper"]
    (37.91, 30)
    >>> strongest = max(result.summary["spectral_lines"], key=lambda line: line["amplitude"])
    >>> strongest["probe"], strongest["quantity"], round(strongest["frequency_hz"], 1)
    ('third', 'absolute_acceleration', 15.0)
    >>> result["modes"]["open_frequencies_hz"].values.round(2).tolist()
    [16.09, 37.06, 54.11]
    >>> result.root_mean_squares  # the excitation is not random
    {}
    """

    KIND = "run"
    SUMMARY = _SUMMARY
    DATASETS = (
        INPUTS, HISTORIES, EVENTS, IMPACTS, IMPACT_STATISTICS, BODIES, FATIGUE, CONTACT, FRICTION_INTERVALS, RINGS,
        SPECTRA, SRS, MATCHED, RANDOM, SENSITIVITIES, MODES,
    )  # fmt: skip

    @property
    def root_mean_squares(self) -> dict[str, dict[str, float]]:
        """SI, root mean squares of responses to a stationary random input, by quantity and probe; else nothing."""
        entries: dict[str, dict[str, float]] = {}
        for row in self["random"].rows("signal") if "random" in self.datasets else ():
            if row["section"] != "excitation":
                entries.setdefault(f"rms_{row['quantity']}", {})[row["name"]] = row["rms"]
        return entries

    def unit_of(self, entry: Entry, place: tuple[str, ...], keys: tuple[str, ...], record: Mapping[str, Any]) -> str:
        """Unit of values whose entry does not name it; see `Result.unit_of`."""
        if entry.name == "inputs" and keys == ("rms",):
            return str(record["unit"])
        if entry.name in ("random", "random_linear") and keys[0] not in RATIOS:
            return str(self["random"]["unit"].sel(signal=place[0]).item())
        if entry.name == "spectral_lines" and keys == ("amplitude",):
            signal = f"{record['probe']} {record['quantity']}"
            return self["spectra"]["amplitude"].sel(signal=signal).unit
        if entry.name == "against" and keys[-1] in ("exact", "stepped"):
            return str(record["unit"])
        if entry.name == "sensitivities":
            rows = self["sensitivities"].rows("row")
            of = next(row for row in rows if (row["response"], row["path"]) == place)
            units = dict.fromkeys(("change", "change_below"), of["value_unit"]) | {
                "tolerance": of["number_unit"], "holds_within": of["number_unit"]
            }  # fmt: skip
            return str(units.get(keys[0], "1"))
        return super().unit_of(entry, place, keys, record)
