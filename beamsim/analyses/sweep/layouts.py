"""The variables of the labelled datasets of a sweep, see `beamsim.labelled`.

`curves` has a row for each way through the frequencies at one level. What a curve has cycle by cycle is in `cycles`,
the rows of one curve after those of another; so are steady states, points of Poincaré sections and notches.
"""

from __future__ import annotations

from beamsim.labelled import ROW, Layout, Variable
from beamsim.results.values import VALUES

_CURVE, _CYCLE, _LEVEL, _POINT, _SAMPLE = ("curve",), ("cycle",), ("level_index",), ("point",), ("sample",)
_PROBE, _SNUBBER, _FRICTION, _OUTPUT = ("probe",), ("snubber",), ("friction",), ("output",)
_DIMENSIONS = {"probes": "probe", "snubbers": "snubber"}
FOLLOWED = {value.quantity: _DIMENSIONS[value.section] for value in VALUES if value.in_sweeps}
"""Quantities that sweeps follow in any case, each with the dimension of the places that have it."""
UNITS = {value.quantity: value.unit for value in reversed(VALUES) if value.in_sweeps} | {"force": "{force_unit}"}


def _statistics(quantity: str) -> dict[str, Variable]:
    """Variables of a quantity in every cycle; optional, since a sweep may not evaluate the quantity."""
    place, unit, name = (FOLLOWED[quantity],), UNITS[quantity], quantity.replace("_", " ")
    each, harmonics = place + _CYCLE, (*place, "order", *_CYCLE)
    return {
        f"max_{quantity}": Variable(each, unit, f"largest {name} of a cycle", optional=True),
        f"min_{quantity}": Variable(each, unit, f"smallest {name} of a cycle", optional=True),
        f"peak_{quantity}": Variable(each, unit, f"largest magnitude of the {name} in a cycle", optional=True),
        f"rms_{quantity}": Variable(
            each, unit, f"root mean square of the {name} over the time of a cycle, mean included", optional=True
        ),
        f"mean_{quantity}": Variable(each, unit, f"mean of the {name} over the time of a cycle", optional=True),
        f"harmonic_{quantity}_real": Variable(
            harmonics, unit,
            f"amplitude of cos(order x phase) in the {name}, zero to peak; of order p/q over q cycles up to this one",
            optional=True,
        ),
        f"harmonic_{quantity}_imag": Variable(
            harmonics, unit, f"minus the amplitude of sin(order x phase) in the {name}", optional=True
        ),
        f"limit_{quantity}": Variable(
            each, unit, f"limit of the largest magnitude of the {name}, NaN where there is none", optional=True
        ),
    }  # fmt: skip


CURVES = Layout(
    "curves",
    "The curves: one direction at one level each.",
    {
        "curve": Variable(_CURVE, "1", "name of the curve: direction and number of the level, up_0", str),
        "kind": Variable(_CURVE, "", "swept_sine or stepped", str),
        "direction": Variable(_CURVE, "", "up or down", str),
        "level_index": Variable(_CURVE, "1", "number of the level, from 0", int),
        "level": Variable(
            _CURVE, "{level_unit}", "level of the excitation; with a profile the factor applied to it"
        ),
        "level_unit": Variable(
            _CURVE, "", "SI unit of the level; empty where it is the factor of a profile", str
        ),
        "quantity": Variable(
            _CURVE, "", "what is prescribed: acceleration, velocity or displacement of the base, or force", str
        ),
    },
)  # fmt: skip
_OF_CURVE = {"curve": Variable(_CYCLE, "1", "number of the curve, from 0", int, names="curves/curve")}
CYCLES = Layout(
    "cycles",
    "Every cycle of every curve; of a stepped sweep every frequency, with means over the cycles measured there.",
    {
        "cycle": Variable(_CYCLE, "1", ROW, int),
        **_OF_CURVE,
        "frequency_hz": Variable(_CYCLE, "Hz", "excitation frequency in the middle of the cycle"),
        "time": Variable(_CYCLE, "s", "time at the start of the cycle"),
        "excitation_amplitude": Variable(
            _CYCLE, "{excitation_unit}", "amplitude of the base's acceleration or of the force, zero to peak"
        ),
        "energy_error": Variable(
            _CYCLE, "1",
            "imbalance of the energies that has added up since the curve began (of a stepped sweep: over the cycles "
            "evaluated at the frequency), over the largest energy of the structure",
        ),
        "peak_bending_stress": Variable(
            _CYCLE, "Pa", "largest bending stress along the bodies in a cycle, where it is limited", optional=True
        ),
        "spring_changes": Variable(
            _CYCLE, "1",
            "whether a piecewise-linear spring passes a breakpoint, or a friction contact begins to slide or to stick",
            bool, optional=True, flags=("no", "yes"),
        ),
        "order": Variable(("order",), "1", "order: frequency over excitation frequency"),
        "probe": Variable(_PROBE, "1", "name of the probe", str),
        "static_displacement": Variable(
            _PROBE, "m", "displacement at static equilibrium; 0 where there is none"
        ),
        "snubber": Variable(_SNUBBER, "1", "name of the snubber", str),
        "contact_share": Variable(_SNUBBER + _CYCLE, "1", "share of the time in contact"),
        "contacts": Variable(_SNUBBER + _CYCLE, "1", "number of closings", int),
        "ring": Variable(("ring",), "1", "name of the ring", str, optional=True),
        "peak_radial_force": Variable(("ring", *_CYCLE), "N", "largest force of the ring in a cycle", optional=True),
        "ring_penetration": Variable(("ring", *_CYCLE), "m", "largest penetration into the ring", optional=True),
        "peak_gap": Variable(
            _SNUBBER + _CYCLE, "m", "largest opening of the contact in a cycle, where it is limited or a snubber is "
            "closed at rest; NaN in a hinge", optional=True,
        ),
        **{name: variable for quantity in FOLLOWED for name, variable in _statistics(quantity).items()},
        "acceleration_jump": Variable(
            _PROBE + _CYCLE, "m/s^2", "acceleration by jumps of contact forces in the cycle, at a point with little "
            "mass, or elsewhere by waves in a model of ten times the modes", optional=True,
        ),
        "impact_number": Variable(_SNUBBER + _CYCLE, "1", "impacts per cycle: closings", optional=True),
        "impact_contact_time": Variable(
            _SNUBBER + _CYCLE, "s", "mean time in contact of an impact; NaN in a cycle without closing", optional=True
        ),
        "impact_impulse": Variable(
            _SNUBBER + _CYCLE, "{force_unit} s", "integral of the contact force over a cycle", optional=True
        ),
        "impact_energy_lost": Variable(
            _SNUBBER + _CYCLE, "J", "energy lost in the snubber in a cycle", optional=True
        ),
        "impact_penetration_rate": Variable(
            _SNUBBER + _CYCLE, "{gap_unit}/s",
            "highest rate of penetration in contact, which is the approach speed unless the load still accelerates",
            optional=True,
        ),
        # what the tangential spring springs back where sliding begins counts in the cycle in which that slide ends,
        # under the force of a snubber in that in which it begins
        "friction": Variable(_FRICTION, "1", "name of the friction contact", str),
        "friction_slides": Variable(_FRICTION + _CYCLE, "1", "slides per cycle that end in sticking", optional=True),
        "friction_distance": Variable(_FRICTION + _CYCLE, "m", "sliding distance in a cycle", optional=True),
        "friction_energy_lost": Variable(
            _FRICTION + _CYCLE, "J", "energy lost by friction in a cycle", optional=True
        ),
        "friction_wear_power": Variable(
            _FRICTION + _CYCLE, "W", "mean of normal force times sliding speed", optional=True
        ),
        "output": Variable(_OUTPUT, "1", "name of the output", str),
        "output_quantity": Variable(_OUTPUT, "", "kind of output, such as bending_moment or reaction_force", str),
        "output_unit": Variable(_OUTPUT, "", "unit of the quantity", str),
        "output_at": Variable(_OUTPUT, "", "where it is: a place, a support, a joint or a body", str),
        "output_maximum": Variable(_OUTPUT + _CYCLE, "{unit}", "largest value of a cycle"),
        "output_minimum": Variable(_OUTPUT + _CYCLE, "{unit}", "smallest value of a cycle"),
        "output_jump": Variable(_OUTPUT + _CYCLE, "{unit}", "of an acceleration by jumps of forces", optional=True),
        "output_rms": Variable(
            _OUTPUT + _CYCLE, "{unit}", "root mean square over the time of a cycle, mean included"
        ),
        "output_mean": Variable(_OUTPUT + _CYCLE, "{unit}", "mean over the time of a cycle"),
        "output_harmonics_real": Variable(
            (*_OUTPUT, "order", *_CYCLE), "{unit}", "amplitude of cos(order x phase)"
        ),
        "output_harmonics_imag": Variable(
            (*_OUTPUT, "order", *_CYCLE), "{unit}", "minus the amplitude of sin(order x phase)"
        ),
    },
)  # fmt: skip
STEADY_STATES = Layout(
    "steady_states",
    "Steady motions of a stepped sweep at every frequency, in the order of the rows of cycles.",
    {
        "cycle": Variable(_CYCLE, "1", ROW, int),
        **_OF_CURVE,
        "frequency_hz": Variable(_CYCLE, "Hz", "excitation frequency"),
        "kind": Variable(_CYCLE, "", "periodic, quasi-periodic, chaotic or not settled", str),
        "period_cycles": Variable(
            _CYCLE, "1", "cycles after which the motion repeats, 0 where it does not", int
        ),
        "cycles": Variable(_CYCLE, "1", "cycles computed until the motion was steady", int),
        "change": Variable(_CYCLE, "1", "change of the state over a period, over its size"),
        "lyapunov_exponent": Variable(
            _CYCLE, "1/s", "largest Lyapunov exponent; NaN where the motion is periodic"
        ),
    },
    optional=True,
)  # fmt: skip
POINCARE = Layout(
    "poincare",
    "Poincaré sections of the steady motions that are not periodic: the state at phase 0 of the excitation.",
    {
        "point": Variable(_POINT, "1", ROW, int),
        "curve": Variable(_POINT, "1", "number of the curve, from 0", int, names="curves/curve"),
        "frequency_hz": Variable(_POINT, "Hz", "excitation frequency"),
        "probe": Variable(_PROBE, "1", "name of the probe", str),
        "section_displacement": Variable(_PROBE + _POINT, "m", "probe's displacement at phase 0"),
        "section_velocity": Variable(_PROBE + _POINT, "m/s", "probe's velocity at phase 0"),
    },
    optional=True,
)
_NOTCHED = {"quantity": Variable(
    (), "", "what the levels are of: acceleration, velocity or displacement of the base, or force", str
)}  # fmt: skip
NOTCHES = Layout(
    "notches",
    "The level that keeps the limits of sweep.notch_to: a table that is interpolated on log-log axes.",
    {
        "point": Variable(_POINT, "1", ROW, int),
        "curve": Variable(_POINT, "1", "number of the curve, from 0", int, names="curves/curve"),
        **_NOTCHED,
        "frequency_hz": Variable(_POINT, "Hz", "excitation frequency"),
        "level": Variable(_POINT, "{notch_unit}", "notched level, zero to peak, interpolated log-log"),
        "specified": Variable(
            _POINT, "{notch_unit}", "level without notches, its steps drawn out over a cycle"
        ),
    },
    optional=True,
)  # fmt: skip
NOTCH_LIMITS = Layout(
    "notch_limits",
    "The limits to which the level is lowered, and the largest values of the limited quantities.",
    {
        "limit_number": Variable(("limit_number",), "1", ROW, int),
        "curve": Variable(("limit_number",), "1", "number of the curve, from 0", int, names="curves/curve"),
        "name": Variable(("limit_number",), "", "what is limited", str),
        "unit": Variable(("limit_number",), "", "its unit", str),
        "limit": Variable(("limit_number",), "", "the limit, in that unit"),
        "largest": Variable(("limit_number",), "", "largest magnitude in the sweep, in that unit"),
        "share": Variable(("limit_number",), "1", "largest magnitude over the limit"),
        "frequency_hz": Variable(("limit_number",), "Hz", "excitation frequency of that cycle"),
    },
    optional=True,
)
NOTCH_RANGES = Layout(
    "notch_ranges",
    "The ranges of frequency in which the level is lowered.",
    {
        "range": Variable(("range",), "1", ROW, int),
        "curve": Variable(("range",), "1", "number of the curve, from 0", int, names="curves/curve"),
        "limit": Variable(("range",), "", "the limit that governs, in most of the range", str),
        "from_hz": Variable(("range",), "Hz", "lowest excitation frequency"),
        "to_hz": Variable(("range",), "Hz", "highest excitation frequency"),
        "at_hz": Variable(("range",), "Hz", "frequency at which the level is lowered most"),
        "level": Variable(("range",), "{notch_unit}", "level at that point"),
        "reduction_db": Variable(("range",), "dB", "lowered level over the specified one"),
    },
    optional=True,
)
OF_CURVES = (CYCLES, STEADY_STATES, POINCARE, NOTCHES, NOTCH_LIMITS, NOTCH_RANGES)
"""The tables of which a curve has rows, numbered by their column ``curve``."""
PEAKS = Layout(
    "peaks",
    "Local maxima of the response curves, with the kind of resonance.",
    {
        "peak": Variable(("peak",), "1", "number of the peak", int),
        "curve": Variable(("peak",), "", "name of the curve", str),
        "probe": Variable(("peak",), "", "name of the probe", str),
        "direction": Variable(("peak",), "", "direction of the sweep", str),
        "level": Variable(("peak",), "{level_unit}", "level of the excitation"),
        "frequency_hz": Variable(("peak",), "Hz", "excitation frequency of the peak"),
        "value_m": Variable(("peak",), "m", "peak displacement, from static equilibrium"),
        "kind": Variable(
            ("peak",), "",
            "linear resonance, nonlinear resonance, superharmonic, subharmonic, beat or level step", str,
        ),
        "order": Variable(("peak",), "1", "order of the resonant harmonic"),
        "share": Variable(("peak",), "1", "share of that harmonic in the peak displacement"),
    },
)  # fmt: skip
LEVELS = Layout(
    "levels",
    "The levels that were computed, and the work of the solver.",
    {
        "level_index": Variable(_LEVEL, "1", "number of the level, from 0", int),
        "level": Variable(
            _LEVEL, "{level_unit}", "level of the excitation; with a profile the factor applied to it"
        ),
        "status": Variable(_LEVEL, "", "how the computation of the level ended", str),
        "outcome": Variable(_LEVEL, "", "code of how it ended", str),
        "outcome_numbers": Variable(
            _LEVEL, "", "its kind, sentence, remedy, place, numbers and sub-outcomes, JSON object", str
        ),
        "truncation": Variable(
            _LEVEL, "1", "bound on the truncation error of the expansion of the sine, relative to its amplitude"
        ),
        "cycles": Variable(_LEVEL, "1", "cycles of the excitation computed", int),
        "events": Variable(_LEVEL, "1", "contact events, breakpoints of piecewise-linear springs included", int),
        "evaluations": Variable(_LEVEL, "1", "evaluations of the event functions", int),
        "segments": Variable(_LEVEL, "1", "time segments between events", int),
        "states": Variable(_LEVEL, "1", "contact states that were diagonalised", int),
        "processor_time_s": Variable(_LEVEL, "s", "processor time of the solver alone"),
        "base_correction_acceleration": Variable(
            _LEVEL, "m/s^2", "largest correction of the base's acceleration", optional=True
        ),
        "base_correction_share": Variable(
            _LEVEL, "1", "that correction over the level of the sweep there", optional=True
        ),
        "base_correction_time": Variable(_LEVEL, "s", "time of the largest correction", optional=True),
        "notch_trials": Variable(
            _LEVEL, "1", "motions of a few cycles that were computed to choose the level", int, optional=True
        ),
        "probe": Variable(_PROBE, "1", "name of the probe whose history is kept", str),
        "aliased_displacement": Variable(
            _LEVEL + _PROBE, "1",
            "share of the root mean square of the probe's displacement that lies above half the rate of the history",
        ),
    },
)  # fmt: skip
HISTORIES = Layout(
    "histories",
    "The time histories of all directions at a level, level by level.",
    {
        "sample": Variable(_SAMPLE, "1", ROW, int),
        "level": Variable(_SAMPLE, "1", "number of the level, from 0", int, names="levels/level_index"),
        "time": Variable(_SAMPLE, "s", "time"),
        "probe": Variable(_PROBE, "1", "name of the probe", str),
        "displacement": Variable(_PROBE + _SAMPLE, "m", "displacement relative to the base"),
        "absolute_acceleration": Variable(_PROBE + _SAMPLE, "m/s^2", "absolute acceleration", optional=True),
        "snubber": Variable(_SNUBBER, "1", "name of the snubber", str),
        "force": Variable(
            _SNUBBER + _SAMPLE, "{force_unit}", "contact force on the structure, positive when it pushes"
        ),
    },
    optional=True,
)  # fmt: skip
_FREQUENCY = ("frequency_hz",)
_LINEAR, _CONTACT = _PROBE + _FREQUENCY, _SNUBBER + _FREQUENCY


def _response(name: str, meaning: str, *, optional: bool = False) -> dict[str, Variable]:
    """A complex response per unit of excitation."""
    return {
        f"{name}_real": Variable(_LINEAR, "1", f"{meaning} per unit of excitation, real part", optional=optional),
        f"{name}_imag": Variable(_LINEAR, "1", f"{meaning} per unit of excitation, imaginary part", optional=optional),
    }


LINEAR = Layout(
    "linear",
    "Steady response of the structure to a unit of the excitation's amplitude, no contact being made or lost, and the "
    "levels at which the linear motion makes or loses one; of contacts for which these are known.",
    {
        "frequency_hz": Variable(_FREQUENCY, "Hz", "excitation frequency"),
        "probe": Variable(_PROBE, "1", "name of the probe", str),
        **_response("displacement", "displacement without snubbers"),
        **_response("absolute_acceleration", "absolute acceleration without snubbers"),
        # none where that is no linear motion, or there are no snubbers
        **_response("displacement_closed", "displacement, every snubber always closed,", optional=True),
        "closed_at_rest": Variable(
            (), "1", "whether every snubber is closed at static equilibrium", bool, flags=("no", "yes")
        ),
        "snubber": Variable(_SNUBBER, "1", "name of the snubber", str),
        "contact_turns": Variable(
            _SNUBBER, "1", "whether it acts on the angle of a hinge, with a moment", bool, flags=("no", "yes")
        ),
        "contact_onset": Variable(
            _CONTACT, "{excitation_unit}",
            "level of the excitation at which the linear motion first makes contact; NaN where it is closed at rest",
        ),
        "contact_loss": Variable(
            _CONTACT, "{excitation_unit}",
            "level of the excitation at which the linear motion first loses contact; NaN where it is open at rest",
        ),
        "contact_preload_needed": Variable(
            _CONTACT, "1",
            "{force_unit} per unit of level: contact force at equilibrium that just keeps contact, all snubbers closed",
        ),
        "contact_preload_alone": Variable(
            _CONTACT, "1", "preload per unit of level, with the other snubbers as they are at equilibrium"
        ),
        "contact_valid_below": Variable(
            _CONTACT, "{excitation_unit}",
            "level at which the linear motion first changes another contact; beyond it the motion is another one",
        ),
    },
)  # fmt: skip
