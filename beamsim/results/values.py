"""The values that analyses report: what each is called in summaries, studies and limits, and what it is of the extremes
of its channel, if it is one of them. Everything that lists values takes them from this table.

Of a limit the margin of safety is limit / value - 1: zero where the limit is just reached, negative beyond it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import islice
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np

from beamsim.labelled import Dataset
from beamsim.outcomes import COMPLETE, Outcome, Verdict, on_limit
from beamsim.scenario import Scenario
from beamsim.scenario.reporting import Limits
from beamsim.scenario.units import STANDARD_GRAVITY
from beamsim.structures.places import StressRows
from beamsim.summaries import ByName, Entry, Number
from beamsim.system.equations import Channel, ChannelSet, Key
from beamsim.typing import Floats, not_none

ALWAYS = 1e-12  # contact shares within this distance of 0 or 1 count as never or always
ROUND_OFF_PULL = 1e-9  # of the largest contact force
DISPLACEMENT, ACCELERATION = ("probes", "displacement"), ("probes", "absolute_acceleration")
FORCE, PENETRATION, OPENING = ("snubbers", "force"), ("snubbers", "penetration"), ("snubbers", "opening")
STRESS = ("bodies", "bending_stress")
RING_FORCE, RING_PENETRATION = ("rings", "radial_force"), ("rings", "penetration")
UNSAMPLED = (STRESS, RING_FORCE, RING_PENETRATION)  # channels of many columns, without histories
ROTATIONAL = ("N m", "rad")  # units of values that are there only where a hinge has them
ALWAYS_THERE = ("probes", "snubbers")  # sections whose entries are there even where they are empty

Extreme = Floats  # (4, k): lowest, its time, highest, its time
NO_EXTREMES: Extreme = np.zeros((4, 0))  # where there is no probe
Extremes = Mapping[Key, Extreme]  # by section and quantity of the channels
Margins = dict[str, dict[str, Any]]
"""By limit (SI) ``limit``, ``value``, ``lowest`` and ``highest`` (the range of its change), ``margin``, ``at``,
``verdict``, ``exceeded``; of a value of a random motion also which ``statistic`` it is."""


def hinge_key(entry: str) -> str:
    """The entry of a hinge that stands for one of a snubber or friction contact: moments for forces, rad for m.

    >>> hinge_key("peak_force_n"), hinge_key("gap_m"), hinge_key("impulse_n_s"), hinge_key("approach_speed_m_s")
    ('peak_moment_n_m', 'gap_rad', 'impulse_n_m_s', 'approach_speed_rad_s')
    """
    name = entry.replace("force", "moment")
    for end, turned in (("_n_s", "_n_m_s"), ("_m_s", "_rad_s"), ("_n", "_n_m"), ("_m", "_rad")):
        if name.endswith(end):
            return name.removesuffix(end) + turned
    return name


def by_hinge_key(entry: str, contacts: Iterable[Any], value: Callable[[Any], float]) -> dict[str, dict[str, float]]:
    """A value by name of contacts, those of hinges under the entry of angles, which is there only with them."""
    found: dict[str, dict[str, float]] = {entry: {}}
    for contact in contacts:
        name = hinge_key(entry) if contact.gap_unit == "rad" else entry
        found.setdefault(name, {})[contact.name] = value(contact)
    return found


def extreme_times(extremes: Extremes) -> Floats:
    """(2,) s, of the lowest and highest point of the first probe; (0,) without any."""
    return extremes.get(DISPLACEMENT, NO_EXTREMES)[1::2, :1].ravel()


def largest(extreme: Extreme) -> Floats:
    """(k,) largest magnitudes."""
    low, _, high, _ = extreme
    return np.asarray(np.maximum(np.abs(low), np.abs(high)))


def largest_at(extreme: Extreme) -> Floats:
    """(k,) s, when the largest magnitudes are reached."""
    low, when_low, high, when_high = extreme
    return np.asarray(np.where(np.abs(low) > np.abs(high), when_low, when_high))


def largest_pulls(forces: Extreme) -> Floats:
    """(m,) largest tension of each contact; 0 where it is the round-off of an opening."""
    low, _, high, _ = forces
    return np.where(-low > ROUND_OFF_PULL * high, np.maximum(-low, 0.0), 0.0)


def highest_penetrations(penetrations: Extreme) -> Floats:
    """(k,) largest penetrations, m."""
    return np.asarray(np.maximum(penetrations[2], 0.0))


def largest_openings(openings: Extreme) -> Floats:
    """(m,) largest distances of contacts to their faces, m."""
    return np.asarray(np.maximum(openings[2], 0.0))


def by_magnitude(channels: Sequence[Channel], extreme: Extreme) -> Extreme:
    """Extremes of channels, where a force that counts in both directions has its largest magnitude as the highest."""
    both = np.repeat([channel.counts_pulling for channel in channels], [channel.columns for channel in channels])
    low, when_low, high, when_high = extreme
    pulls = both & (-low > high)
    return np.array([low, when_low, np.where(pulls, -low, high), np.where(pulls, when_low, when_high)])


def of_ring(channel: Channel) -> bool:
    """Whether a channel is the force or penetration of a ring, which sweeps and branches follow in any case."""
    return channel.key in (RING_FORCE, RING_PENETRATION)


def merge_extremes(first: Extreme | None, second: Extreme) -> Extreme:
    """The lowest and the highest of two extremes, with their times."""
    if first is None:
        return second
    return np.vstack([np.where(second[0] < first[0], second[:2], first[:2]),
                      np.where(second[2] > first[2], second[2:], first[2:])])  # fmt: skip


class Value(NamedTuple):
    """A value of every channel of a section that has a quantity; of all outputs, whatever they are.

    Values that are no extremes of channels are found by each analysis in its own way.
    """

    name: str  # in studies, in SI
    entry: str  # in summaries, with its unit; empty where only studies have it
    section: str
    quantity: str  # empty: any
    from_extreme: Callable[[Extreme], Floats] | None  # None: no extreme
    unit: str  # SI
    meaning: str
    label: str = ""  # of its row in a printed table
    limit: str = ""  # by which it is limited
    scale: float = 1.0  # SI over the unit of the entry
    decibels: float = 0.0  # of a decade of the ratio to a curve: 20 of an amplitude, 10 of a power; 0 of other values
    reported: str = ""  # entry of a run's summary that has it in another unit or under another name

    def of_channels(self, channels: Sequence[Channel], extreme: Extreme) -> Floats:
        """Its values from the extremes of channels, of which each that acts in both directions counts in both."""
        return not_none(self.from_extreme)(by_magnitude(channels, extreme))

    def is_extreme_of(self, channel: Channel) -> bool:
        """Whether it is an extreme of a channel: of its section, quantity and unit."""
        if self.from_extreme is None or channel.section != self.section or self.quantity not in ("", channel.quantity):
            return False
        return self.unit in ("", channel.unit)

    def on_peak_of(self, signal: Mapping[str, Any]) -> bool:
        """Whether it is the peak of a signal, which has a section, a quantity and a unit."""
        if (
            self.from_extreme is None
            or signal["section"] != self.section
            or self.quantity not in ("", signal["quantity"])
        ):
            return False
        return self.unit in ("", signal["unit"])

    @property
    def key(self) -> Key:
        """Section and quantity of its channels."""
        return self.section, self.quantity

    @property
    def single(self) -> bool:
        """Whether it is the largest along all bodies, and not one for each name."""
        return self.section == "bodies"

    @property
    def in_sweeps(self) -> bool:
        """Whether sweeps follow it in any case: what has a limit and a row in the table, at probes and snubbers."""
        return bool(self.limit and self.label) and self.section in ALWAYS_THERE

    def summary_entry(self, prefix: str = "", *, by_curve: bool = False) -> Entry:
        """Its entry in the summary, with words before its meaning; of a sweep by curve."""
        unit = "g" if self.entry.endswith("_g") else "" if self.section == "outputs" else self.unit
        form: Any = Number if self.single or not self.section else ByName
        meaning = ("by curve, " if by_curve else prefix) + self.meaning
        return Entry(self.entry, unit, meaning, self.section, form=dict[str, form] if by_curve else form)


VALUES = (
    Value("peak_force", "peak_force_n", *FORCE, itemgetter(2), "N",
          "largest contact force of a snubber; of a latch, which also pulls, its magnitude", "peak contact force",
          "peak_force"),
    Value("peak_moment", "peak_moment_n_m", *FORCE, itemgetter(2), "N m",
          "largest contact moment of a stop of a hinge; of a latch, which also pulls, its magnitude",
          "peak contact moment", "peak_moment"),
    Value("largest_pull", "largest_pull_n", *FORCE, largest_pulls, "N",
          "largest tensile force of a snubber, 0 where it never pulls"),
    Value("largest_pulling_moment", "largest_pulling_moment_n_m", *FORCE, largest_pulls, "N m",
          "largest moment with which a stop of a hinge pulls, 0 where it never does"),
    Value("largest_gap", "largest_gap_m", *OPENING, largest_openings, "m",
          "largest distance of a contact to its face as it is then (crushed, recovering); 0 of what touches or is held",
          limit="gap"),
    Value("largest_gap_angle", "largest_gap_rad", *OPENING, largest_openings, "rad",
          "largest distance of a stop of a hinge to its face as it is then"),
    Value("peak_displacement", "peak_displacement_m", *DISPLACEMENT, largest, "m",
          "largest magnitude of a probe's displacement relative to the base", "peak displacement",
          "peak_displacement"),
    Value("min_displacement", "min_displacement_m", *DISPLACEMENT, itemgetter(0), "m",
          "smallest relative displacement of a probe"),
    Value("max_displacement", "max_displacement_m", *DISPLACEMENT, itemgetter(2), "m",
          "largest relative displacement of a probe"),
    Value("peak_acceleration", "peak_acceleration_g", *ACCELERATION, largest, "m/s^2",
          "largest magnitude of a probe's absolute acceleration", "peak acceleration", "peak_acceleration",
          STANDARD_GRAVITY),
    Value("peak_spring_force", "peak_spring_force_n", "springs", "force", largest, "N",
          "largest magnitude of a spring's force", "peak spring force"),
    Value("peak_extension", "peak_extension_m", "springs", "extension", largest, "m",
          "largest magnitude of a spring's extension"),
    Value("peak_friction_force", "peak_friction_force_n", "friction", "force", largest, "N",
          "largest magnitude of a friction contact's force", "peak friction force"),
    Value("peak_friction_moment", "peak_friction_moment_n_m", "friction", "force", largest, "N m",
          "largest magnitude of the friction moment of a hinge", "peak friction moment"),
    Value("peak_ring_force", "peak_ring_force_n", *RING_FORCE, largest, "N",
          "largest force of a ring, in any direction of its plane", "peak ring force", "peak_ring_force"),
    Value("ring_penetration", "ring_penetration_m", *RING_PENETRATION, highest_penetrations, "m",
          "largest penetration into a ring, 0 without contact", "ring penetration"),
    Value("peak_output", "peak_output", "outputs", "", largest, "",
          "largest magnitude of an output, in its output_unit", "outputs", "outputs"),
    Value("min_output", "min_output", "outputs", "", itemgetter(0), "", "smallest value of an output"),
    Value("max_output", "max_output", "outputs", "", itemgetter(2), "", "largest value of an output"),
    Value("bending_stress", "largest_bending_stress_pa", *STRESS, largest, "Pa",
          "largest bending stress at any time and place", "largest bending stress", "bending_stress"),
    Value("contact_share", "contact_share", "snubbers", "", None, "1", "share of the time in contact of a snubber",
          "time in contact"),
    Value("contacts", "contacts", "snubbers", "", None, "1",
          "closings of a snubber; a gap that is just closed at t = 0 is made there, what touched before is not"),
    Value("gapping", "gapping_ratio", "snubbers", "", None, "1",
          "level of a sine over that at which the linear motion first changes contact of a snubber, where that is "
          "predicted", limit="gapping"),
    Value("static_force", "static_force_n", "snubbers", "", None, "N",
          "contact force of a snubber at static equilibrium"),
    Value("static_moment", "static_moment_n_m", "snubbers", "", None, "N m",
          "contact moment of a stop of a hinge at static equilibrium"),
    Value("reaction", "reaction_n", "supports", "reaction", None, "N",
          "force of a support on the structure at static equilibrium", "reaction"),
    Value("reaction_moment", "reaction_moment_n_m", "supports", "reaction", None, "N m",
          "moment of a support on the structure at static equilibrium", "reaction moment"),
    Value("rms_absolute_acceleration", "rms_absolute_acceleration", *ACCELERATION, None, "m/s^2",
          "root mean square of the absolute acceleration", limit="rms_acceleration", reported="rms_acceleration_g"),
    Value("rms_displacement", "rms_displacement", *DISPLACEMENT, None, "m",
          "root mean square of the displacement, relative to the base", limit="rms_displacement",
          reported="rms_displacement_m"),
    Value("rms_force", "rms_force", *FORCE, None, "N", "root mean square of the contact force", limit="rms_force"),
    Value("srs_over_limit", "srs_over_limit", "probes", "", None, "1",
          "largest ratio of a maximax shock response spectrum to its limit curve", limit="srs", decibels=20.0),
    Value("psd_over_limit", "psd_over_limit", "probes", "", None, "1",
          "largest ratio of a spectral density to its limit curve", limit="psd", decibels=10.0),
    Value("response_over_limit", "response_over_limit", "probes", "", None, "1",
          "largest ratio of the peak of a cycle to its limit curve", limit="response", decibels=20.0),
    Value("bending_stress_position", "largest_bending_stress_position_m", "bodies", "", None, "m",
          "where the bending stress is largest, on a plate its x"),
    Value("open_frequencies_hz", "open_frequencies_hz", "", "", None, "Hz",
          "natural frequencies with every contact open"),
    Value("closed_frequencies_hz", "closed_frequencies_hz", "", "", None, "Hz",
          "natural frequencies with every contact closed"),
    Value("stuck_frequencies_hz", "stuck_frequencies_hz", "", "", None, "Hz",
          "natural frequencies about static equilibrium with friction stuck"),
    Value("sliding_frequencies_hz", "sliding_frequencies_hz", "", "", None, "Hz",
          "natural frequencies about static equilibrium with friction sliding"),
    Value("bilinear_frequency_hz", "", "", "", None, "Hz",
          "2 f F / (f + F) of the first open (f) and closed (F) frequency"),
    Value("resonance_frequency", "", "probes", "", None, "Hz", "frequency of the largest response"),
    Value("energy_error", "energy_error", "", "", None, "1",
          "largest error of the energy balance, over the larger of stored energy and the integral of |power in|",
          "energy balance error"),
)  # fmt: skip
SHIFTS = (
    Value("frequency_shift", "", "resonances", "", None, "1",
          "change of the frequency of a resonance between two tests, less what the sweep rate explains",
          limit="frequency_shift"),
    Value("amplitude_shift", "", "resonances", "", None, "1", "change of its amplitude, likewise",
          limit="amplitude_shift"),
    Value("damping_shift", "", "resonances", "", None, "1", "change of its damping ratio, likewise",
          limit="damping_shift"),
)  # fmt: skip
"""What is limited of test data before and after another test."""
BY_NAME = {value.name: value for value in VALUES}
BY_ENTRY = {value.entry: value for value in VALUES if value.entry}
OUTPUT, RESPONSE = BY_ENTRY["peak_output"], BY_ENTRY["response_over_limit"]
LIMITED = {value.limit: value for value in (*VALUES, *SHIFTS) if value.limit}


MAIN_ENTRIES = frozenset(
    value.entry
    for value in VALUES
    if value.from_extreme is not None
    and value.section in ("probes", "snubbers", "springs", "friction", "rings", "outputs")
) | {"frequency_hz", "peak_frequency_hz"}  # of modes and of peaks, which analyses of frequencies are asked for
"""Entries of displacements, accelerations, forces and outputs."""
NATURAL_FREQUENCIES = ("open_frequencies_hz", "closed_frequencies_hz")


def is_main_value(scenario: Scenario, modes: Dataset | None, key: str) -> bool:
    """Whether a value is one that a user reads first, so that a doubt about it is one about the result.

    Those are displacements, accelerations, forces, what has a limit, and the first natural frequency, open and closed,
    that is none of a rigid body; with a smooth law the open one alone, since such a law has no stiffness where it
    closes. Others are marked where they are printed.

    Parameters
    ----------
    scenario : with its limits.
    modes : natural frequencies of the structure; None where they are not known.
    key : ``entry.place`` of a summary, as in ``doubtful``; frequencies have their number as place.
    """
    entry, _, place = key.partition(".")
    if entry in MAIN_ENTRIES:
        return True
    if entry in NATURAL_FREQUENCIES and place == str(_first_elastic(modes, entry)):
        return entry == NATURAL_FREQUENCIES[0] or not scenario.has_smooth_laws
    given = () if scenario.limits is None else scenario.limits.values_by_name
    return any(limits(name, entry, place) for name in given)


def limits(name: str, entry: str, place: str) -> bool:
    """Whether a limit is one on this entry of a summary at this place."""
    value, of = parse_limit(name)
    rms = entry == "random" and place.endswith(f" {value.quantity} rms")
    found = rms or entry in filter(None, (value.entry, value.reported))
    return found and (not of or of in (place, *place.split(" ")) or place.endswith(f" {of}"))


def _first_elastic(modes: Dataset | None, entry: str) -> int:
    """The number of the first natural frequency that is none of a rigid body, from 1."""
    frequencies = [] if modes is None else modes[entry].values.tolist()
    return next((number for number, hz in enumerate(frequencies, 1) if hz > 0.0), 1)


def peaks_in(points: Dataset) -> Iterator[tuple[Value, dict[str, Floats]]]:
    """The values that have limits, and outputs, each with the largest of every point of a table by name."""
    for value in LIMITED.values():
        if value is OUTPUT:
            low, high = (points.by_label(f"output_{end}") for end in ("minimum", "maximum"))
            of = {name: np.maximum(np.abs(low[name].values), np.abs(high[name].values)) for name in low}
        elif value is RESPONSE:
            of = _over_limits(points)
        elif value.key == OPENING:
            gaps = {name: gap.values for name, gap in points.by_label("peak_gap").items()}
            of = {name: gap for name, gap in gaps.items() if not np.isnan(gap).all()}
        elif value.key == STRESS:
            of = {"": points["peak_bending_stress"].values} if "peak_bending_stress" in points else {}
        else:
            followed = points.by_label(f"peak_{value.quantity}")
            of = {name: peak.values for name, peak in followed.items() if peak.unit == value.unit}
        if of and (value.from_extreme is not None or value is RESPONSE):
            yield value, of


def _over_limits(points: Dataset) -> dict[str, Floats]:
    """By name of those that have a limit over frequency, the largest magnitudes over it."""
    ratios = {}
    for quantity in dict.fromkeys(value.quantity for value in VALUES if value.in_sweeps):
        for name, limit in points.by_label(f"limit_{quantity}").items():
            if not np.isnan(limit.values).all():
                ratios[name] = points.by_label(f"peak_{quantity}")[name].values / limit.values
    return ratios


def largest_in(parts: Sequence[Dataset], at: str, counts: str = "") -> Iterator[tuple[Value, str, float, float]]:
    """The values of `peaks_in`: by name the largest of all points that count, and where that is.

    Both are NaN where it is known of none.

    Parameters
    ----------
    parts : tables of points.
    at : column that says where each point is.
    counts : column that says whether its values count; by default all do.
    """
    where = np.concatenate([part[at].values for part in parts])
    which = np.concatenate([part[counts].values for part in parts]) if counts else np.ones(where.size, dtype=bool)
    peaks = [dict(peaks_in(part)) for part in parts]
    for value in peaks[0]:
        for name in peaks[0][value]:
            along = np.where(which, np.concatenate([each[value][name] for each in peaks]), np.nan)
            best = int(np.argmax(np.where(np.isnan(along), -np.inf, along)))
            yield value, name, float(along[best]), np.nan if np.isnan(along[best]) else float(where[best])


def searched_channels(channels: ChannelSet, values: Iterable[Value] | None = None) -> ChannelSet:
    """The channels of whose extremes values are made; by default all that a run reports, and the penetrations."""
    wanted, always = (VALUES, PENETRATION) if values is None else (tuple(values), None)
    return channels.select(
        lambda channel: channel.key == always or any(value.is_extreme_of(channel) for value in wanted)
    )


def values_of(channels: ChannelSet, extremes: Extremes) -> dict[str, Any]:
    """Values of a motion, by entry of the summary, and by name where there are several.

    Those of channels without extremes (by section and quantity) are left out.
    """
    found: dict[str, Any] = {}
    for value in VALUES:
        if value.from_extreme is None:
            continue
        some = [c for c in channels.channels if value.is_extreme_of(c) and c.key in extremes]
        alike = {key: channels.of_keys(key).channels for key in {c.key for c in some}}
        numbers = {key: (value.of_channels(each, extremes[key]) / value.scale).tolist() for key, each in alike.items()}
        if value.single:
            of_all = [number for key in numbers for number in numbers[key]]
            found |= {value.entry: max(of_all)} if of_all else {}
        elif some or (value.section in ALWAYS_THERE and value.unit not in ROTATIONAL):
            if value.section == "rings":
                numbers = {key: _largest_of_each(alike[key], numbers[key]) for key in numbers}
            named = {(c.key, c.name): x for k in numbers for c, x in zip(alike[k], numbers[k], strict=True)}
            found[value.entry] = {channel.name: named[channel.key, channel.name] for channel in some}
    return found


def _largest_of_each(channels: Sequence[Channel], numbers: Sequence[float]) -> list[float]:
    """The largest of the numbers of each channel, of which it has one for each of its columns."""
    rest = iter(numbers)
    return [max(islice(rest, channel.columns)) for channel in channels]


def place_of_stress(stress: StressRows, extremes: Extremes, *, several: bool) -> dict[str, Any]:
    """Place of the largest bending stress; with the body if there are several."""
    where = int(largest(extremes[STRESS]).argmax())
    place: dict[str, Any] = {"largest_bending_stress_position_m": float(stress.stations.position[where])}
    if stress.stations.position_y is not None:
        place["largest_bending_stress_y_m"] = float(stress.stations.position_y[where])
    return place | ({"largest_bending_stress_body": stress.bodies[where]} if several else {})


def parse_limit(name: str) -> tuple[Value, str]:
    """The value that a limit is on, and at which place alone; no place where that is any of them.

    >>> value, place = parse_limit("peak_force.tip")
    >>> value.name, place
    ('peak_force', 'tip')
    """
    limit, _, place = name.partition(".")
    return LIMITED[limit], place


def limit_unit(scenario: Scenario, name: str) -> str:
    """SI unit of a limit."""
    value, place = parse_limit(name)
    if value is OUTPUT:
        return scenario.output_units[place]
    return value.unit


def limit_label(name: str) -> str:
    """The name for people.

    >>> limit_label("peak_force"), limit_label("peak_force.tip_1"), limit_label("outputs.root_moment")
    ('peak force', 'peak force of tip_1', 'output root_moment')
    """
    limit, _, place = name.partition(".")
    if limit == OUTPUT.limit:
        return f"output {place}"
    words = limit.upper() if limit in ("srs", "psd") else limit.replace("_", " ")
    return " of ".join(filter(None, (words, place)))


_OF_NAMED = (
    "snubbers", "probes", "bodies", "joints", "springs_to_ground", "springs_between", "friction", "outputs", "tests",
)  # sections of things with names  # fmt: skip


def parameter_label(path: str) -> str:
    """A path of the scenario in words.

    >>> parameter_label("snubbers.tip.gap"), parameter_label("snubbers[*].gap")
    ('tip gap', 'snubbers gap')
    >>> parameter_label("beam.youngs_modulus"), parameter_label("beam.point_masses[0].mass")
    ("beam Young's modulus", 'beam point mass 1 mass')
    """
    first, *others = path.removeprefix("identify_stiffness.nonlinear.").split(".")
    parts = others if len(others) > 1 and first in _OF_NAMED else [first, *others]
    words = []
    for part in parts:
        name, _, index = part.partition("[")
        if index not in ("", "*]"):
            singular = name.removesuffix("es") if name.endswith("ses") else name.removesuffix("s")
            name = f"{singular} {int(index[:-1]) + 1}"
        words.append("Young's modulus" if name == "youngs_modulus" else name.replace("_", " "))
    return " ".join(words)


def margin_of(limit: float, value: float) -> float:
    """Return limit / value - 1, infinite if the value is zero.

    >>> margin_of(50.0, 40.0)
    0.25
    """
    return limit / value - 1.0 if value > 0.0 else math.nan if math.isnan(value) else math.inf


def margins(limits: Limits | None, summary: Mapping[str, Any]) -> Margins:
    """The margins of a run, from the values of its summary; a curve's limit is 1, on the largest ratio to it."""
    largest = {}
    for name in {} if limits is None else limits.values_by_name:
        value, place = parse_limit(name)
        found = summary.get(value.entry, {})
        if isinstance(found, Mapping):
            found = found or {place: math.nan}  # of what was left out, or is not known
            at = place or max(found, key=lambda each: found[each])
            size = float(found.get(at, math.nan))
        else:
            body = f"{summary['largest_bending_stress_body']}, " if "largest_bending_stress_body" in summary else ""
            x = summary["largest_bending_stress_position_m"]
            at, size = f"{body}x = {f'{x:.6g} m' if x else '0'}", float(found)
        largest[name] = size * value.scale, "" if value is OUTPUT else at
    return margins_of(limits, largest)


def margins_of(limits: Limits | None, largest: Mapping[str, tuple[float, str]]) -> Margins:
    """The margins of the largest values by limit and where they are (SI), without any change of them.

    A limit that nothing is compared with has a value that is not known.
    """
    compared: Margins = {}
    for name, limit in ({} if limits is None else limits.values_by_name).items():
        value, at = largest.get(name, (math.nan, ""))
        ends = {"lowest": value, "highest": value}
        compared[name] = {"limit": limit, "value": value, **ends, "margin": margin_of(limit, value), "at": at}
        if decade := parse_limit(name)[0].decibels:
            compared[name]["margin_db"] = decade * math.log10(limit / value) if value > 0.0 else math.nan
    return with_verdicts(compared)


def margins_along(limits: Limits | None, values: Iterable[tuple[Value, str, float, str]]) -> Margins:
    """The margins of values along curves or branches: each with whose it is, its size (SI), and where that is."""
    largest: dict[str, tuple[float, str]] = {}
    for value, name, size, where in values:
        at = where if value is OUTPUT or not name else f"{name}, {where}"
        for limit in (value.limit, f"{value.limit}.{name}"):
            if size > largest.get(limit, (-1.0, ""))[0]:
                largest[limit] = size, at
    return margins_of(limits, largest)


def with_verdicts(margins: Margins, outcome: Outcome = COMPLETE) -> Margins:
    """Margins with the verdict on each limit.

    Parameters
    ----------
    margins : with the range of each value, ``lowest`` to ``highest``, by its change; ``held_within`` is the share of
        the limit to which the level of a sweep is known that holds it there; ``interval_low`` and ``interval_high``
        are the interval of a value of a random motion, where that decides.
    outcome : of the computation.

    Returns
    -------
    With ``verdict`` (`Verdict`), and ``exceeded`` where it says so.
    """
    verdicts = {
        name: on_limit(item["lowest"], item["highest"], item["limit"] * (1.0 + item.get("held_within", 0.0)), outcome)
        for name, item in margins.items()
    }
    for name, verdict in verdicts.items():
        low, high = (margins[name].get(f"interval_{end}", math.nan) for end in ("low", "high"))
        if verdict is Verdict.NOT_RELIABLE and outcome.trusted and low <= margins[name]["limit"] < high:
            verdicts[name] = Verdict.UNDECIDED
    return {
        name: item | {"exceeded": verdicts[name] is Verdict.EXCEEDED, "verdict": verdicts[name].value}
        for name, item in margins.items()
    }


def longer_run(duration: str) -> str:
    """What would decide on a limit that is undecided: a run of a duration, as it is printed; empty where none would."""
    if duration:
        return f"if a longer run is more of the same, it decides from a duration of about {duration}"
    return "no longer run decides, since the largest values of tests themselves scatter so much"


def limits_not_met(scenario: Scenario, margins: Margins) -> list[str]:
    """A message for every limit that is exceeded, and for every one that cannot be decided reliably."""
    texts = []
    for name, item in margins.items():
        if item["verdict"] == Verdict.MET:
            continue
        unit, changes = f" {limit_unit(scenario, name)}".removesuffix(" 1"), item["lowest"] < item["highest"]
        between = f" ({item['lowest']:.5g} to {item['highest']:.5g}{unit} with its change)" if changes else ""
        if "interval_low" in item:
            between = f" ({item['interval_low']:.5g} to {item['interval_high']:.5g}{unit} at 95 % of tests)"
        verdict = "exceeds" if item["exceeded"] else "neither meets nor exceeds"
        if item["verdict"] == Verdict.UNDECIDED:
            interval = f"{item['interval_low']:.5g} to {item['interval_high']:.5g}{unit}"
            test = f"the largest value in run.test_duration, {interval} at 95 %, may meet or exceed"
            after = longer_run(f"{float(f'{longer:.2g}'):g} s" if (longer := item["decided_after_s"]) > 0.0 else "")
            texts.append(f"{limit_label(name)} undecided: {test} limits.{name} = {item['limit']:.5g}{unit}; {after}")
            continue
        if "margin_db" in item:
            margin = f"the margin is {item['margin_db']:.2f} dB"
            texts.append(f"{limit_label(name)} {verdict} limits.{name} at {item['at']}: {margin}")
            continue
        limit = f"limits.{name} = {item['limit']:.5g}{unit}"
        if math.isnan(item["value"]):
            texts.append(f"{limit_label(name)} is not known, so that {limit} is neither met nor exceeded")
            continue
        texts.append(f"{limit_label(name)} = {item['value']:.5g}{unit}{between} {verdict} {limit}")
    return texts
