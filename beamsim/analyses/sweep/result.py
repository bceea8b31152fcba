"""The result of a sweep: a curve for every direction and level, the peaks in them, and a summary."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from beamsim.fields import (
    ByName,
    Counter,
    Entry,
    Number,
    Plain,
    Text,
    attribute,
    axis,
    by_name,
    dataset,
    declared,
    ending,
    group,
    key,
    members,
    per_probe,
    per_snubber,
    record,
    stored,
    table,
)
from beamsim.inputs.drift import CorrectionSize
from beamsim.outcomes import Outcome
from beamsim.responses.gapping import ContactLevels
from beamsim.results.result import CONVERGENCE, GAPPING, MARGINS, OF_MODES, PROCESSOR_TIME, STATUS, Result
from beamsim.results.values import BY_ENTRY, OUTPUT, RESPONSE, VALUES, AlongCurve, of_angles
from beamsim.scenario.quantities import amplitude_unit, level_unit
from beamsim.scenario.reporting import LimitedQuantity
from beamsim.signals.quality import QualityPeak, peaks_of
from beamsim.system.structural import MODES, ContactUnits
from beamsim.typing import Bools, Complexes, Floats, Ints

OFFSET = 1e-6  # of the peak
_FREQUENCY = ("frequency_hz",)
_TIME = ("time",)
_SECTION = ("poincare_frequency_hz", "section_probe")


@declared(along=_FREQUENCY)
class ChannelExtremes:
    """One channel of a probe or snubber, motion by motion of a branch."""

    name: str = key("name of the probe or snubber")
    quantity: str  # "displacement", "absolute_acceleration", "force", ...
    unit: str
    maximum: Floats = dataset("{unit}", "largest {quantity} of a cycle or period", name="max")
    minimum: Floats = dataset("{unit}", "smallest {quantity} of a cycle or period", name="min")

    @property
    @stored(dataset("{unit}", "largest magnitude of the {quantity} in a cycle or period", name="peak"))
    def peak(self) -> Floats:
        """(np,) largest absolute value."""
        return np.maximum(np.abs(self.maximum), np.abs(self.minimum))


@declared(along=_FREQUENCY)
class OutputExtremes:
    """One of the `outputs`, motion by motion of a branch."""

    name: str = key("name of the output")
    quantity: str = attribute("", "what it is, such as bending_moment or reaction_force")
    unit: str = attribute("", "unit of the quantity")
    at: str = attribute("", "where it is: a place, a support, a joint or a body")
    maximum: Floats = dataset("{unit}", "largest value of a cycle or period")
    minimum: Floats = dataset("{unit}", "smallest value of a cycle or period")

    @property
    def peak(self) -> Floats:
        """(np,) largest absolute value."""
        return np.maximum(np.abs(self.maximum), np.abs(self.minimum))


@declared(along=_FREQUENCY)
class Envelope(ChannelExtremes):
    """One channel of a probe or snubber, cycle by cycle (or frequency by frequency)."""

    # mean included
    rms: Floats = dataset("{unit}", "root mean square of the {quantity} over the time of a cycle", name="rms")
    mean: Floats = dataset("{unit}", "mean of the {quantity} over the time of a cycle", name="mean")
    harmonics: Complexes = dataset(  # (R, C), zero to peak
        "{unit}", "amplitude of cos(order x phase) in the {quantity}; of order p/q over q cycles up to this one",
        along=("order", *_FREQUENCY), name="harmonic",
        imaginary="minus the amplitude of sin(order x phase) in the {quantity}",
    )  # fmt: skip
    at_rest: float = dataset(
        "{unit}", "{quantity} at static equilibrium, of displacements; else 0", along=(),
        name="static", default=0.0,
    )  # fmt: skip
    limit: Floats | None = dataset(
        "{unit}", "limit of the largest magnitude, nan where there is none", name="limit", default=None
    )

    @property
    def response(self) -> Floats:
        """(C,) largest distance from static equilibrium."""
        return np.maximum(np.abs(self.maximum - self.at_rest), np.abs(self.minimum - self.at_rest))

    @property
    def offset(self) -> float:
        """The static part where it is none of round-off, which text names; else 0."""
        return self.at_rest if abs(self.at_rest) > OFFSET * np.nanmax(self.peak, initial=0.0) else 0.0


@declared(along=_FREQUENCY)
class OutputEnvelope(OutputExtremes):
    """One of the `outputs`, cycle by cycle (or frequency by frequency)."""

    rms: Floats = dataset("{unit}", "root mean square over the time of a cycle, mean included")
    mean: Floats = dataset("{unit}", "mean over the time of a cycle")
    harmonics: Complexes = dataset(
        "{unit}", "amplitude of cos(order x phase)", along=("order", *_FREQUENCY),
        imaginary="minus the amplitude of sin(order x phase)",
    )  # fmt: skip


@declared(along=_FREQUENCY)
class CycleImpacts(ContactUnits):
    """Impacts at one snubber, cycle by cycle; at each frequency of a stepped sweep means over the cycles measured."""

    per_cycle: Floats = dataset("1", "impacts per cycle: closings", name="number")
    contact_time: Floats = dataset("s", "mean time in contact of an impact; NaN in a cycle without closing")
    impulse: Floats = dataset("{force_unit} s", "integral of the contact force over a cycle")
    energy_lost: Floats = dataset("J", "energy lost in the snubber in a cycle")
    penetration_rate: Floats = dataset(
        "{gap_unit}/s",
        "highest rate of penetration in contact, which is the approach speed unless the load still accelerates",
    )

    def summary(self) -> dict[str, float]:
        """Largest values along the curve, by name."""
        called = of_angles if self.gap_unit == "rad" else str
        return {
            "most_per_cycle": float(np.max(self.per_cycle, initial=0.0)),
            "longest_mean_contact_time_s": float(np.nanmax(self.contact_time, initial=0.0)),
            called("largest_impulse_n_s"): float(np.max(self.impulse, initial=0.0)),
            "largest_energy_lost_j": float(np.max(self.energy_lost, initial=0.0)),
            called("highest_penetration_rate_m_s"): float(np.max(self.penetration_rate, initial=0.0)),
        }


@declared(along=_FREQUENCY)
class CycleSliding:
    """Sliding of one friction contact, cycle by cycle; at each frequency of a stepped sweep means over the cycles
    measured. What the tangential spring springs back where sliding begins counts in the cycle in which that slide ends,
    under the force of a snubber in that in which it begins.
    """

    per_cycle: Floats = dataset("1", "slides per cycle that end in sticking", name="slides")
    distance: Floats = dataset("m", "sliding distance in a cycle")
    energy_lost: Floats = dataset("J", "energy lost by friction in a cycle")
    wear_power: Floats = dataset("W", "mean of normal force times sliding speed")

    def summary(self) -> dict[str, float]:
        """Largest values along the curve, by name."""
        return {
            "most_slides_per_cycle": float(np.max(self.per_cycle, initial=0.0)),
            "largest_distance_m": float(np.max(self.distance, initial=0.0)),
            "largest_energy_lost_j": float(np.max(self.energy_lost, initial=0.0)),
            "largest_wear_power_w": float(np.max(self.wear_power, initial=0.0)),
        }


@declared(along=_FREQUENCY)
class SteadyStates:
    """What the stepped sweep found at every frequency."""

    kind: tuple[str, ...] = dataset("1", "periodic, quasi-periodic, chaotic or not settled")
    period_cycles: Ints = dataset("1", "cycles after which the motion repeats, 0 where it does not")
    cycles: Ints = dataset("1", "cycles computed until the motion was steady")
    change: Floats = dataset("1", "change of the state over a period, over its size")
    # nan where the motion is periodic
    lyapunov_exponent: Floats = dataset("1/s", "largest Lyapunov exponent, where the motion is not periodic")
    poincare_frequency_hz: Floats = axis("Hz", "excitation frequency of each point of the Poincare sections")
    probes: tuple[str, ...] = axis("1", "name of the probe", name="section_probe", shared=True)
    poincare_displacement: Floats = dataset("m", "probes' displacement at phase 0", along=_SECTION)
    poincare_velocity: Floats = dataset("m/s", "probes' velocity at phase 0", along=_SECTION)


@declared
class NotchLimit:
    """A limit to which the level is lowered, and the largest value it meets."""

    name: str = dataset("1", "what is limited")
    unit: str = dataset("1", "its unit")
    limit: float = dataset("", "the limit, in that unit")
    largest: float = dataset("", "largest magnitude in the sweep, in that unit")
    share: float = dataset("1", "that magnitude over the limit")
    frequency_hz: float = dataset("Hz", "excitation frequency of that cycle")


@declared
class NotchedRange:
    """A range of frequencies in which the level is lowered."""

    limit: str = dataset("1", "the limit that governs, in most of the range")
    from_hz: float = dataset("Hz", "lowest excitation frequency")
    to_hz: float = dataset("Hz", "highest excitation frequency")
    at_hz: float = dataset("Hz", "frequency at which the level is lowered most")
    level: float = dataset("", "level there, in the unit of the table of levels")
    reduction_db: float = dataset("dB", "that level over the specified one")


@declared(along=_FREQUENCY)
class Notching:
    """The level that keeps the limits: a table that is interpolated on log-log axes."""

    quantity: str = attribute(
        "", "what the levels are of: acceleration, velocity or displacement of the base, or force"
    )
    frequency_hz: Floats = axis("Hz", "excitation frequency of the table's points")  # (P,)
    level: Floats = dataset("{unit}", "notched level, zero to peak, interpolated log-log")
    specified: Floats = dataset("{unit}", "level without notches, its steps drawn out over a cycle")
    trials: int = attribute("1", "motions of a few cycles that were computed to choose the level")
    limits: tuple[NotchLimit, ...] = table(
        "limits", NotchLimit, Counter("limit_number", "number of the limit"), default=()
    )
    ranges: tuple[NotchedRange, ...] = table(
        "ranges", NotchedRange, Counter("range", "number of the range"), default=()
    )

    @property
    def unit(self) -> str:
        """SI unit of the levels; 1 where they multiply several forces."""
        return level_unit(self.quantity)

    def summary(self) -> dict[str, Any]:
        """Limits by name, and ranges."""
        limits = {limit.name: {**vars(limit)} for limit in self.limits}
        for limit in limits.values():
            del limit["name"]
        return {"limits": limits, "ranges": [{**vars(part)} for part in self.ranges], "points": self.frequency_hz.size}


@declared(kw_only=True, along=_FREQUENCY)
class SweepCurve(AlongCurve):
    """One way through the frequencies at one level."""

    name: str = key("direction and number of the level, up_0")
    direction: str = attribute("", "up or down")
    level_index: int = attribute("1", "number of the level, from 0")
    level: float = attribute("{level_unit}", "level of the excitation; with a profile the factor applied to it")
    quantity: str = attribute("", "what is prescribed: acceleration, velocity or displacement of the base, or force")
    frequency_hz: Floats = axis("Hz", "excitation frequency", rows="cycle")  # (C,) in the middle of each cycle
    time: Floats = dataset("s", "time at the start of the cycle")
    excitation_amplitude: Floats = dataset(
        "{excitation_unit}", "amplitude of the base's acceleration or of the force, zero to peak"
    )
    orders: Floats = axis("1", "order: frequency over excitation frequency", name="order", shared=True)  # (R,)
    probes: tuple[Envelope, ...] = members("", Envelope, "probe", by=("name", "quantity", "unit"), split="quantity")
    snubbers: tuple[Envelope, ...] = members("", Envelope, "snubber", by=("name", "quantity", "unit"), split="quantity")
    contacts: dict[str, Ints] = per_snubber("1", "number of closings")
    energy_error: Floats | None = dataset(
        "1",
        "imbalance of the energies that has added up since the curve began (of a stepped sweep: over the cycles "
        "evaluated at the frequency), over the largest energy of the structure",
        default=None,
    )
    level_unit: str = attribute("", "SI unit of the level; empty where it is the factor of a profile", default="")
    steady: SteadyStates | None = group("steady", SteadyStates, default=None)  # of a stepped sweep
    impacts: dict[str, CycleImpacts] = members(  # where sweep.impacts asks for them
        "", CycleImpacts, "snubber", prefix="impact_", default_factory=dict
    )
    sliding: dict[str, CycleSliding] = members(  # likewise
        "", CycleSliding, "friction", prefix="friction_", default_factory=dict
    )
    outputs: dict[str, OutputEnvelope] = members("", OutputEnvelope, "output", prefix="output_", default_factory=dict)
    notching: Notching | None = group("notching", Notching, default=None)  # where sweep.notch_to asks for it
    bent: Bools | None = None  # (C,) whether a piecewise-linear spring passed a breakpoint; not stored

    def envelope_of(self, of: LimitedQuantity) -> Envelope | OutputEnvelope:
        """What a limit on the level applies to, in every cycle."""
        return self.outputs[of.item] if of.section == "outputs" else getattr(self, of.quantity)[of.item]

    @property
    def cycles_at(self) -> tuple[Floats, Bools]:
        """(C,) Hz, of each cycle; all count."""
        return self.frequency_hz, np.ones(self.frequency_hz.size, dtype=bool)

    def amplitude_at(self, frequency_hz: Floats) -> Floats:
        """Amplitude of the excitation at any frequencies, Hz, that of the ends beyond them."""
        rising = np.argsort(self.frequency_hz, kind="stable")
        return np.interp(frequency_hz, self.frequency_hz[rising], np.abs(self.excitation_amplitude[rising]))

    @property
    def excitation_unit(self) -> str:
        """Unit of its amplitude."""
        return amplitude_unit(self.quantity)

    @property
    def has_transmissibility(self) -> bool:
        """Whether the base moves, and accelerations and the fundamental were kept."""
        return bool(self.acceleration) and bool(np.any(self.orders == 1.0)) and self.excitation_unit == "m/s^2"

    def transmissibility(self, probe: str) -> Floats:
        """(C,) fundamental of a probe's absolute acceleration over that of the base, where there is one."""
        (first,) = np.flatnonzero(self.orders == 1.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.abs(self.acceleration[probe].harmonics[first]) / np.abs(self.excitation_amplitude)
        return np.asarray(ratio)

    def resonance(self, probe: str) -> QualityPeak | None:
        """Highest peak of the transmissibility, whose Q is known where its half-power band is; None without peaks."""
        order = np.argsort(self.frequency_hz)
        peaks = peaks_of(self.frequency_hz[order], self.transmissibility(probe)[order])
        return max(peaks, key=lambda peak: peak.level, default=None)

    @property
    def weights(self) -> Floats:
        """(C,) shares of the cycles in the time of a swept sine; of a stepped one all frequencies count the same."""
        if self.steady is not None or self.time.size == 0:
            return np.full(self.time.size, 1.0 / max(self.time.size, 1))
        duration = np.diff(self.time, append=self.time[-1] + 1.0 / self.frequency_hz[-1])
        return np.asarray(duration / duration.sum())


@declared(along=_FREQUENCY)
class LinearCurve:
    """Steady response of the structure to a unit of the excitation's amplitude, no contact being made or lost."""

    frequency_hz: Floats = axis("Hz", "excitation frequency")
    displacement: dict[str, Complexes] = per_probe("1", "displacement per unit of excitation, without snubbers")
    acceleration: dict[str, Complexes] = per_probe(
        "1", "absolute acceleration per unit of excitation", name="absolute_acceleration"
    )
    # empty where that is no linear motion, or there are no snubbers
    closed: dict[str, Complexes] = dataset(
        "1", "displacement per unit of excitation, every snubber always closed", per="probe",
        name="displacement_closed", default_factory=dict,
    )  # fmt: skip
    closed_at_rest: bool = attribute("", "whether every snubber is closed at static equilibrium", default=False)
    contact: dict[str, ContactLevels] = members("", ContactLevels, "snubber", prefix="contact_", default_factory=dict)


@declared
class ResponsePeak:
    """A local maximum of a response curve and its classification."""

    curve: str = dataset("1", "name of the curve")
    probe: str = dataset("1", "name of the probe")
    direction: str = dataset("1", "direction of the sweep")
    level: float = dataset("", "level of the excitation")
    frequency_hz: float = dataset("Hz", "excitation frequency of the peak")
    value_m: float = dataset("m", "peak displacement, from static equilibrium")
    kind: str = dataset(
        "1", "kind of the peak"
    )  # linear or nonlinear resonance, superharmonic, subharmonic, beat, level step
    order: float = dataset("1", "order of the resonant harmonic")
    share: float = dataset("1", "share of that harmonic in the peak displacement")


@declared(along=_TIME)
class SweepHistory:
    """The time history of one sweep."""

    time: Floats = axis("s", "time")
    displacement: dict[str, Floats] = per_probe("m", "displacement relative to the base")
    acceleration: dict[str, Floats] = per_probe("m/s^2", "absolute acceleration", name="absolute_acceleration")
    force: dict[str, Floats] = per_snubber("N", "contact force on the structure, positive when it pushes")
    moment: dict[str, Floats] = per_snubber("N m", "that of a stop of a hinge", default_factory=dict)
    aliased: Floats | None = dataset(
        "1",
        "share of the root mean square of each probe's displacement that lies above half the rate",
        along=(Counter("probe_number", "number of the probe", shared=True),),
        default=None,
    )


@declared
class SweepWork:
    """Work of the solver of a sweep."""

    events: int = attribute("1", "contact events, breakpoints of piecewise-linear springs included")
    evaluations: int = attribute("1", "evaluations of the event functions")
    segments: int = attribute("1", "time segments between events")
    states: int = attribute("1", "contact states that were diagonalised")
    processor_time_s: float = attribute("s", "processor time of the solver alone")
    cycles: int = attribute("1", "cycles of the excitation computed")


@declared
class LevelWork:
    """One level that was computed."""

    level: float = attribute("", "level of the excitation; with a profile the factor applied to it")
    outcome: Outcome = ending("how the computation of the level ended")
    truncation: float = attribute(
        "1", "bound on the truncation error of the expansion of the sine, relative to its amplitude"
    )
    work: SweepWork = group("", SweepWork)
    base_correction: CorrectionSize | None = group(
        "", CorrectionSize, prefix="base_correction_", default=None
    )  # of a base that is swept


CURVE = record({"direction": Text, "level": Number, "points": Number}, {"steady": ByName})
_SUMMARY = (
    STATUS,
    GAPPING,
    BY_ENTRY["gapping_ratio"].summary_entry("of the strongest sweep, "),
    Entry("peaks", "", "peaks of the response curves: the columns of the table peaks", "", "peaks",
             ("frequency_hz", "value_m", "kind", "direction", "level", "order", "probe", "curve")),
    Entry("curves", "",
             "by curve its direction, level and number of points, and of a stepped sweep how many motions of "
             "each kind it has", form=by_name(CURVE)),
    Entry("peak_frequencies_hz", "Hz", "by largest value, curve and place the frequency at which it is reached",
             form=dict[str, dict[str, ByName]]),
    Entry("cycles", section="solver", of="work.cycles"),
    Entry("events", section="solver", of="work.events"),
    Entry("truncation", section="solver", of="truncation"),
    *CorrectionSize.ENTRIES,
    *(value.summary_entry(by_curve=True) for value in VALUES if value.followed or value is RESPONSE),
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
    PROCESSOR_TIME._replace(of="work.processor_time_s"),
)  # fmt: skip


@declared(repr=False)
class SweepResult(Result):
    """Everything one `beamsim sweep` of one design computes."""

    KIND = "sweep"
    SUMMARY, DATASETS = _SUMMARY, (MODES,)

    kind: str = attribute("", "swept_sine or stepped")
    curves: dict[str, SweepCurve] = members("curves", SweepCurve, "curve", rows="cycles")
    linear: LinearCurve = group("linear", LinearCurve)
    peaks: tuple[ResponsePeak, ...] = table("peaks", ResponsePeak, Counter("peak", "number of the peak"))
    work: SweepWork = group("work", SweepWork)
    levels: dict[int, LevelWork] = members(
        "levels", LevelWork, "level_index", default_factory=dict
    )  # that were computed
    histories: dict[int, SweepHistory] = members(
        "history_levels", SweepHistory, "level_index", rows="histories", default_factory=dict
    )  # by level index
    truncation: float = attribute(
        "1", "bound on the truncation error of the expansion of the sine, relative to its amplitude", default=0.0
    )

    def unit_of(self, entry: Entry, place: tuple[str, ...], keys: tuple[str, ...], record: Mapping[str, Any]) -> str:
        """That of values which the name does not say; see `Result.unit_of`."""
        if keys == ("level",) and entry.name in ("curves", "peaks"):
            return self.curves[record.get("curve") or place[0]].level_unit
        if entry.name == "notches" and keys[-1] in ("limit", "largest", "level") and keys != ("limit",):
            return str(record.get("unit") or level_unit(self.curves[place[0]].quantity))
        return super().unit_of(entry, place, keys, record)
