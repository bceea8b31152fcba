"""The variables of the labelled datasets of a run, see `beamsim.labelled`."""

from __future__ import annotations

from beamsim.labelled import ROW, Layout, Variable

_TIME, _BASE, _PROBE, _SNUBBER, _SPRING, _FRICTION, _OUTPUT = (
    ("time",), ("base_motion",), ("probe",), ("snubber",), ("spring",), ("friction",), ("output",)
)  # fmt: skip
HISTORIES = Layout(
    "histories",
    "Everything at the output times, and the numbers that describe each place.",
    {
        "time": Variable(_TIME, "s", "time"),
        "base_motion": Variable(_BASE, "1", "direction of the motion of the base", str, optional=True),
        "base_acceleration": Variable(
            _BASE + _TIME, "{base_unit}/s^2", "acceleration of the base", optional=True
        ),
        "base_displacement": Variable(_BASE + _TIME, "{base_unit}", "displacement of the base", optional=True),
        "energy_work_in": Variable(
            _TIME, "J", "work done on the structure by the excitation, in the relative frame", optional=True
        ),
        "energy_dissipated": Variable(_TIME, "J", "energy dissipated", optional=True),
        "energy_stored": Variable(
            _TIME, "J", "energy stored, kinetic and elastic, snubbers included; where supports move relative to the "
            "base, that of the degrees of freedom which they leave", optional=True,
        ),
        "probe": Variable(_PROBE, "1", "name of the probe", str),
        "probe_body": Variable(_PROBE, "1", "name of the body", str, optional=True),
        "position": Variable(_PROBE, "m", "position along the beam; else number of the mass, node or member"),
        "position_y": Variable(_PROBE, "m", "on a plate the y, from its bottom edge", optional=True),
        "displacement": Variable(_PROBE + _TIME, "m", "displacement relative to the base"),
        "absolute_displacement": Variable(_PROBE + _TIME, "m", "absolute displacement"),
        "velocity": Variable(_PROBE + _TIME, "m/s", "velocity relative to the base"),
        "absolute_acceleration": Variable(_PROBE + _TIME, "m/s^2", "absolute acceleration"),
        "low_passed_acceleration": Variable(
            _PROBE + _TIME, "m/s^2", "absolute acceleration behind the low-pass filter of run.low_pass", optional=True
        ),
        "snubber": Variable(_SNUBBER, "1", "name of the snubber", str),
        "snubber_body": Variable(_SNUBBER, "1", "name of the body", str, optional=True),
        "snubber_position": Variable(
            _SNUBBER, "m",
            "position along the beam; else number of the mass, node or member, halfway for one between two masses",
        ),
        "snubber_position_y": Variable(_SNUBBER, "m", "on a plate the y, from its bottom edge", optional=True),
        "snubber_side": Variable(_SNUBBER, "", "below or above; between two masses approach or separation", str),
        "snubber_stiffness": Variable(
            _SNUBBER, "{force_unit}/{gap_unit}", "stiffness; of a force-deflection table its first slope"
        ),
        "snubber_dashpot": Variable(_SNUBBER, "{force_unit} s/{gap_unit}", "damping constant"),
        "snubber_gap": Variable(
            _SNUBBER, "{gap_unit}", "clearance, positive when open; resolved where a preload was given"
        ),
        "snubber_preload": Variable(
            _SNUBBER, "{force_unit}", "contact force at static equilibrium; NaN where there is none"
        ),
        "snubber_blocked_force": Variable(
            _SNUBBER, "{force_unit}",
            "force at a penetration of max(-gap, 0), the structure held at zero displacement",
        ),
        "snubber_stiffness_ratio": Variable(
            _SNUBBER, "1", "k L^3 / (E I); in a chain, over its largest spring stiffness"
        ),
        "snubber_table_misfit": Variable(
            _SNUBBER, "{force_unit}",
            "root mean square of the difference between measured forces and the table", optional=True,
        ),
        "snubber_residual_crush": Variable(
            _SNUBBER, "{gap_unit}", "of a stop that yields, how far it stays crushed at the end of the motion",
            optional=True,
        ),
        "snubber_force": Variable(
            _SNUBBER + _TIME, "{force_unit}", "contact force on the structure, positive when it pushes"
        ),
        "snubber_penetration": Variable(
            _SNUBBER + _TIME, "{gap_unit}", "penetration of the structure into the snubber"
        ),
        "snubber_closed": Variable(
            _SNUBBER + _TIME, "1", "whether the contact is closed", bool, flags=("open", "closed")
        ),
        "snubber_displacement": Variable(
            _SNUBBER + _TIME, "{gap_unit}",
            "displacement of the structure at the snubber, relative to the base; between two masses the extension",
        ),
        "snubber_velocity": Variable(
            _SNUBBER + _TIME, "{gap_unit}/s", "velocity of the structure at the snubber, relative to the base"
        ),
        "spring": Variable(_SPRING, "1", "name of the spring, which is nonlinear or relaxes", str),
        "spring_kind": Variable(
            _SPRING, "",
            "cubic, piecewise_linear, shock_arrestor, linear (which relaxes), or spring of a joint that relaxes", str,
        ),
        "spring_masses": Variable(
            _SPRING, "",
            "JSON list of the mass that it ties to the ground, or the two that it joins; empty between points of beams",
            str,
        ),
        "spring_extension": Variable(
            _SPRING + _TIME, "m", "extension of the spring; to the ground the absolute displacement there"
        ),
        "spring_force": Variable(
            _SPRING + _TIME, "N", "force of the spring, positive where it pulls back a positive extension"
        ),
        "friction": Variable(_FRICTION, "1", "name of the friction contact", str),
        "friction_normal_force": Variable(
            _FRICTION, "{force_unit}", "force that presses the faces together; NaN where it is that of a snubber"
        ),
        "friction_static_force": Variable(
            _FRICTION, "{force_unit}", "friction force up to which it sticks, likewise"
        ),
        "friction_sliding_force": Variable(_FRICTION, "{force_unit}", "friction force while it slides, likewise"),
        "friction_stiffness": Variable(
            _FRICTION, "{force_unit}/{gap_unit}",
            "tangential stiffness while it sticks; infinite where it does not move",
        ),
        "friction_start_force": Variable(
            _FRICTION, "{force_unit}",
            "friction force at the start, positive where it resists a positive displacement",
        ),
        "friction_sliding_share": Variable(_FRICTION, "1", "share of the time during which it slides"),
        # of the continuous motion: none of a time-stepped or interrupted one
        "friction_slides": Variable(_FRICTION, "1", "number of times that sliding begins", int, optional=True),
        "friction_sliding_distance": Variable(_FRICTION, "{gap_unit}", "distance that it slides", optional=True),
        "friction_dissipated_energy": Variable(_FRICTION, "J", "energy lost", optional=True),
        "friction_dissipated_power": Variable(
            _FRICTION, "W", "energy lost over the duration of the run", optional=True
        ),
        "friction_wear_power": Variable(
            _FRICTION, "W", "mean of normal force times sliding speed; NaN in a hinge", optional=True
        ),
        "friction_worn_volume": Variable(
            _FRICTION, "m^3", "volume worn, where wear_rate is given, else NaN", optional=True
        ),
        "friction_displacement": Variable(
            _FRICTION + _TIME, "{gap_unit}",
            "displacement along the face, relative to what it rubs on; between two places the extension",
        ),
        "friction_force": Variable(
            _FRICTION + _TIME, "{force_unit}", "friction force, positive where it resists a positive displacement"
        ),
        "friction_stuck": Variable(
            _FRICTION + _TIME, "1", "whether the contact sticks", bool, flags=("sliding", "stuck")
        ),
        "output": Variable(_OUTPUT, "1", "name of the output, one quantity of run.outputs", str),
        "output_quantity": Variable(_OUTPUT, "", "kind of output, such as bending_moment or reaction_force", str),
        "output_unit": Variable(_OUTPUT, "", "unit of the quantity", str),
        "output_at": Variable(_OUTPUT, "", "where it is: a place, a support, a joint or a body", str),
        "output_value": Variable(_OUTPUT + _TIME, "{unit}", "{quantity}"),
    },
)  # fmt: skip
_RING = ("ring",)
_RING_TIME = ("ring", "time")
RINGS = Layout(
    "rings",
    "Position and force in the plane of each ring at the output times, and the numbers that describe it. Errors are "
    "those of the flat sides that the ring is computed with, over the exact values.",
    {
        "time": Variable(("time",), "s", "time"),
        "ring": Variable(_RING, "1", "name of the ring", str),
        "first_direction": Variable(_RING, "", "first place and direction", str),
        "second_direction": Variable(_RING, "", "second place and direction", str),
        "first_gap": Variable(_RING, "m", "clearance along the first direction"),
        "second_gap": Variable(_RING, "m", "clearance along the second direction"),
        "stiffness": Variable(_RING, "N/m", "radial stiffness"),
        "dashpot": Variable(_RING, "N s/m", "damping constant"),
        "largest_penetration": Variable(_RING, "m", "penetration up to which the force is fitted"),
        "sides": Variable(_RING, "1", "number of flat sides", int),
        "gap_error": Variable(_RING, "1", "how much earlier contact begins, over the clearance"),
        "force_error": Variable(_RING, "1", "largest error of the force, over the force at the largest penetration"),
        "direction_error_deg": Variable(
            _RING, "degree", "largest error of the direction of the force, from a tenth of that penetration on"
        ),
        "impulse_error": Variable(_RING, "1", "largest error of the impulse of an impact, over the impulse"),
        "contact_share": Variable(_RING, "1", "share of the time in contact"),
        "sliding_distance": Variable(_RING, "m", "distance along the wall in contact; NaN where it is not known"),
        "work_rate": Variable(_RING, "W", "mean of normal force times speed along the wall; NaN likewise"),
        "worn_volume": Variable(_RING, "m^3", "volume worn, where wear_rate is given, else NaN"),
        "friction_energy": Variable(_RING, "J", "energy lost by friction; NaN where it is not known"),
        "first_position": Variable(_RING_TIME, "m", "position relative to the centre, along the first direction"),
        "second_position": Variable(_RING_TIME, "m", "position relative to the centre, along the second direction"),
        "first_force": Variable(_RING_TIME, "N", "normal force on the structure along the first direction"),
        "second_force": Variable(_RING_TIME, "N", "normal force on the structure along the second direction"),
        "force": Variable(_RING_TIME, "N", "magnitude of the normal force"),
        "friction_force": Variable(_RING_TIME, "N", "magnitude of the friction force along the wall"),
        "penetration": Variable(_RING_TIME, "m", "distance beyond the clearance, 0 inside of it"),
    },
    optional=True,
)
EVENTS = Layout(
    "events",
    "Contact events of the snubbers in order of time; breakpoints of piecewise-linear springs are not among them. A "
    "contact that is made at t = 0, where the gap is just closed, has its closing there. A snubber that is deflected "
    "at t = 0 (prestressed, or by the start) was in contact before: it has no closing, its first event may be an "
    "opening.",
    {
        "event": Variable(("event",), "1", "number of the contact event", int),
        "time": Variable(("event",), "s", "time of the contact event; 0 where contact begins at the start of the run"),
        "snubber": Variable(("event",), "1", "number of the snubber, from 0", int, names="histories/snubber"),
        "closing": Variable(("event",), "1", "whether the contact closes", bool, flags=("opening", "closing")),
    },
)
_STATION = ("station",)
BODIES = Layout(
    "bodies",
    "Results along each body that has a continuous axis, the stations of one body after those of another.",
    {
        "body": Variable(("body",), "1", "name of the body", str),
        "station": Variable(_STATION, "1", "number of the station", int),
        "station_body": Variable(_STATION, "1", "number of the body, from 0", int, names="bodies/body"),
        "position": Variable(_STATION, "m", "position along the beam, or on the plate from its left edge"),
        "position_y": Variable(
            _STATION, "m", "position on the plate from its bottom edge; NaN on a beam", optional=True
        ),
        "peak_bending_stress": Variable(
            _STATION, "Pa",
            "largest absolute bending stress at any time, of a plate of sigma_x, sigma_y and tau_xy; NaN where no "
            "fibre of the section is known", optional=True,
        ),
        "peak_von_mises_stress": Variable(
            _STATION, "Pa",
            "largest von Mises stress at the surface of a plate, of at least 2000 samples; NaN on a beam",
            optional=True,
        ),
        "static_shape": Variable(_STATION, "m", "deflection at static equilibrium; NaN where there is none"),
        "extreme_time": Variable(("extreme_time",), "s", "times at which the first probe is lowest and highest"),
        "extreme_shape": Variable(("extreme_time", *_STATION), "m", "deflection at these times"),
    },
    optional=True,
)  # fmt: skip
_SIGNAL, _FREQUENCY = ("signal",), ("frequency_hz",)
_OSCILLATOR = {
    "quality": Variable((), "1", "quality factor Q of the oscillators"),
    "frequency_hz": Variable(_FREQUENCY, "Hz", "natural frequency of the oscillator"),
}
SRS = Layout(
    "srs",
    "Shock response spectra: peaks of oscillators' absolute accelerations on a base that moves as one signal does. The "
    "record of the input ends with its pulse, if it is one, and that of a response with the run.",
    {
        **_OSCILLATOR,
        "signal": Variable(_SIGNAL, "1", "name and quantity of the signal; the input comes first", str),
        "name": Variable(_SIGNAL, "1", "input, the name of the probe, or support and its name", str),
        "maximax": Variable(_SIGNAL + _FREQUENCY, "m/s^2", "largest magnitude at any time"),
        "primary": Variable(_SIGNAL + _FREQUENCY, "m/s^2", "largest magnitude during the record"),
        "residual": Variable(_SIGNAL + _FREQUENCY, "m/s^2", "largest magnitude after the end of the record"),
        "positive": Variable(_SIGNAL + _FREQUENCY, "m/s^2", "largest value at any time"),
        "negative": Variable(_SIGNAL + _FREQUENCY, "m/s^2", "magnitude of the smallest value at any time"),
        "limit": Variable(_SIGNAL + _FREQUENCY, "m/s^2", "limit of maximax, NaN where there is none", optional=True),
    },
    optional=True,
)
MATCHED = Layout(
    "matched",
    "Shock response spectra of base motions that were made for them, during the record and after it.",
    {
        "base_motion": Variable(_BASE, "1", "direction of the motion of the base", str),
        "quality": Variable(_BASE, "1", "quality factor Q of the oscillators"),
        "frequency_hz": _OSCILLATOR["frequency_hz"],
        "target": Variable(_BASE + _FREQUENCY, "m/s^2", "required curve; NaN outside it"),
        "reached": Variable(_BASE + _FREQUENCY, "m/s^2", "maximax spectrum of the record; NaN outside the curve"),
        "misfit_db": Variable(_BASE + _FREQUENCY, "dB", "20 log10(reached / target)"),
    },
    optional=True,
)
_LINE = ("line",)
SPECTRA = Layout(
    "spectra",
    "Single-sided spectra of the last part of the run, of probes and outputs, and the lines of all, one signal after "
    "the other.",
    {
        "excitation_hz": Variable((), "Hz", "frequency of the excitation; NaN where there is none, or several"),
        "start_s": Variable((), "s", "beginning of the part that is analysed"),
        "duration_s": Variable((), "s", "its duration"),
        "resolution_hz": Variable((), "Hz", "smallest distance of lines that can be separated: 4 over the duration"),
        "rate_hz": Variable(
            (), "Hz", "rate of the samples that spectra of a time-stepped motion are made of", optional=True
        ),
        "signal": Variable(_SIGNAL, "1", "name and quantity of the signal", str),
        "name": Variable(_SIGNAL, "1", "name of the probe or output", str),
        "quantity": Variable(_SIGNAL, "1", "absolute_acceleration or displacement; of an output its kind", str),
        "window": Variable(_SIGNAL, "1", "window", str),
        "rms": Variable(_SIGNAL, "{unit}", "root mean square over the part that is analysed, mean included"),
        "frequency_hz": Variable(_FREQUENCY, "Hz", "frequency"),
        "amplitude": Variable(_SIGNAL + _FREQUENCY, "{unit}", "single-sided peak amplitude"),
        "amplitude_db": Variable(_SIGNAL + _FREQUENCY, "dB", "20 log10(amplitude / max |x|)"),
        "line": Variable(_LINE, "1", "number of the line", int),
        "line_signal": Variable(_LINE, "1", "number of the signal, from 0", int, names="spectra/signal"),
        "line_order": Variable(_LINE, "1", "frequency over excitation frequency; NaN where there is none"),
        "line_frequency_hz": Variable(_LINE, "Hz", "frequency of the line"),
        "line_amplitude": Variable(_LINE, "{unit}", "amplitude of the line, zero to peak"),
        "line_amplitude_db": Variable(_LINE, "dB", "20 log10(amplitude / max |x|)"),
        "line_phase_deg": Variable(_LINE, "degree", "phase of the line as a sine of the run's time"),
        "line_kind": Variable(
            _LINE, "1", "mean, fundamental, superharmonic, subharmonic, other, chosen; residual: of no mode", str
        ),
        "line_remainder": Variable(
            _LINE, "1",
            "amplitude that all lines together leave within 4 over the duration of this line, over its own amplitude; "
            "above 0.02 it is not one steady line, but several near one another, or one that changes. NaN of the mean, "
            "under half a window, and where a record holds a few periods of the excitation alone",
        ),
        "line_separating_duration_s": Variable(
            _LINE, "s",
            "of a line that is not a steady one the duration that tells the two lines apart that explain the curve "
            "best; NaN of others, where they are farther apart than the resolution, and where no two are found",
        ),
        "line_error": Variable(
            _LINE, "1",
            "relative error of the amplitude, or of the frequency if larger, from three times the modes and twice the "
            "elements; NaN of a line of no mode, and where there is no comparison",
        ),
    },
    optional=True,
)  # fmt: skip
_NUMBER = ("number",)
FRICTION_INTERVALS = Layout(
    "friction_intervals",
    "Intervals of what friction contacts do under a random input.",
    {
        "number": Variable(_NUMBER, "1", ROW, int),
        "friction": Variable(_NUMBER, "1", "number of the friction contact, from 0", int, names="histories/friction"),
        "value_name": Variable(_NUMBER, "1", "name of the value", str),
        "value": Variable(_NUMBER, "", "value without the first part of the run, in its SI unit"),
        "low": Variable(_NUMBER, "", "lower end of the interval, 95 %"),
        "high": Variable(_NUMBER, "", "upper end of the interval, 95 %"),
    },
    optional=True,
)
_IMPACT, _CYCLE, _INTERVAL, _BODY = ("impact",), ("cycle",), ("interval",), ("body",)
IMPACTS = Layout(
    "impacts",
    "Every impact of the run that is counted, in order of time. Those of stops of hinges are in N m and rad where "
    "others are in N and m.",
    {
        "minimum_rest_s": Variable((), "s", "contacts of one snubber with less time between them are one impact"),
        "force_threshold_n": Variable((), "N", "impacts with a smaller peak force are not counted"),
        "impact": Variable(_IMPACT, "1", "number of the impact", int),
        "snubber": Variable(_IMPACT, "1", "number of the snubber, from 0", int, names="impact_statistics/snubber"),
        "begin": Variable(
            _IMPACT, "s", "time at which the impact begins; the start of the run if it is in contact then"
        ),
        "end": Variable(_IMPACT, "s", "time at which the impact ends; the end of the run if it is in contact then"),
        "contact_time": Variable(
            _IMPACT, "s", "time in contact; less than end - begin if the impact consists of several contacts"
        ),
        "contacts": Variable(_IMPACT, "1", "number of contacts that the impact consists of", int),
        "peak_force": Variable(_IMPACT, "N", "largest force"),
        "peak_time": Variable(_IMPACT, "s", "time of the largest force"),
        "impulse": Variable(_IMPACT, "N s", "integral of the force"),
        "approach_speed": Variable(
            _IMPACT, "m/s", "rate of penetration when the impact begins; NaN where the run begins in contact"
        ),
        "separation_speed": Variable(
            _IMPACT, "m/s", "separation speed at the end of the impact; NaN where the run ends in contact"
        ),
        "energy_lost": Variable(
            _IMPACT, "J", "energy lost in the snubber from the beginning of the impact to that of the next"
        ),
        "incomplete": Variable(
            _IMPACT, "1", "whether the start or end of the run cuts it off", bool, flags=("complete", "incomplete")
        ),
        "restitution": Variable(
            _IMPACT, "1", "separation speed over approach speed; NaN if one of them is unknown or zero"
        ),
    },
    optional=True,
)  # fmt: skip
OF_SNUBBERS = {
    "number": Variable(_SNUBBER, "1", "number of counted impacts", int),
    "incomplete": Variable(_SNUBBER, "1", "counted impacts that the start or end of the run cuts off", int),
    "below_threshold": Variable(
        _SNUBBER, "1", "number of impacts that are not counted, because their peak force is below the threshold", int
    ),
    "rate_hz": Variable(_SNUBBER, "Hz", "impacts per second"),
    "contact_share": Variable(_SNUBBER, "1", "share of the time in contact, impacts below the threshold included"),
    "mean_contact_time_s": Variable(_SNUBBER, "s", "mean time in contact of an impact"),
    "longest_contact_time_s": Variable(_SNUBBER, "s", "longest time in contact of an impact"),
    "peak_force_n": Variable(_SNUBBER, "{force_unit}", "largest peak force"),
    "mean_peak_force_n": Variable(_SNUBBER, "{force_unit}", "mean peak force"),
    "mean_impulse_n_s": Variable(_SNUBBER, "{force_unit} s", "mean impulse of an impact"),
    "highest_approach_speed_m_s": Variable(
        _SNUBBER, "{gap_unit}/s", "largest approach speed; NaN where none is known"
    ),
    "mean_approach_speed_m_s": Variable(_SNUBBER, "{gap_unit}/s", "mean approach speed"),
    "restitution": Variable(
        _SNUBBER, "1", "root of the mean square of separation speeds over that of approach speeds"
    ),
    "mean_energy_lost_j": Variable(_SNUBBER, "J", "mean energy lost in an impact"),
    # of all contact, below the threshold or not
    "impulse_n_s": Variable(_SNUBBER, "{force_unit} s", "integral of the contact force over the run"),
    "energy_lost_j": Variable(_SNUBBER, "J", "energy lost in the snubber over the run"),
    "mean_force_n": Variable(_SNUBBER, "{force_unit}", "mean contact force over the run"),
    "rms_force_n": Variable(_SNUBBER, "{force_unit}", "root mean square of the contact force over the run"),
    "mean_force_in_contact_n": Variable(
        _SNUBBER, "{force_unit}", "mean contact force over the time in contact"
    ),
    "rms_force_in_contact_n": Variable(
        _SNUBBER, "{force_unit}", "root mean square of the contact force over the time in contact"
    ),
}  # fmt: skip
"""Numbers of the impacts at each snubber, as the summary has them."""


def _cycles(owner: str, names: str, unit: str) -> dict[str, Variable]:
    """Cycles counted as in ASTM E1049, those of one owner after those of another, in the order in which they close."""
    return {
        "cycle": Variable(_CYCLE, "1", "number of the counted cycle", int),
        f"cycle_{owner}": Variable(_CYCLE, "1", f"number of the {owner}, from 0", int, names=names),
        "range": Variable(_CYCLE, unit, "range of the cycle, largest less smallest value"),
        "mean": Variable(_CYCLE, unit, "mean of the two"),
        "count": Variable(_CYCLE, "1", "1 of a whole cycle, 0.5 of a half one"),
    }


IMPACT_STATISTICS = Layout(
    "impact_statistics",
    "Statistics of the impacts at each snubber, means over those that are counted, NaN without one; rainflow counts of "
    "the contact forces; of a random input intervals of the statistics.",
    {
        "snubber": Variable(_SNUBBER, "1", "name of the snubber", str),
        **OF_SNUBBERS,
        **_cycles("snubber", "impact_statistics/snubber", "{force_unit}"),
        "interval": Variable(_INTERVAL, "1", "number of the interval", int, optional=True),
        "interval_snubber": Variable(
            _INTERVAL, "1", "number of the snubber, from 0", int, names="impact_statistics/snubber"
        ),
        "value_name": Variable(_INTERVAL, "1", "name of the value", str),
        "value": Variable(_INTERVAL, "", "value without the first part of the run, in its SI unit"),
        "low": Variable(_INTERVAL, "", "lower end of the interval, 95 %"),
        "high": Variable(_INTERVAL, "", "upper end of the interval, 95 %"),
    },
    optional=True,
)  # fmt: skip
FATIGUE = Layout(
    "fatigue",
    "Damage of each body where it is largest, and the rainflow count of its bending stress there.",
    {
        "body": Variable(_BODY, "1", "name of the body", str),
        "position": Variable(_BODY, "m", "where the damage is largest, on a plate its x"),
        "position_y": Variable(_BODY, "m", "on a plate the y coordinate; NaN on a beam", optional=True),
        "component": Variable(
            _BODY, "", "on a plate the component of the stress: x, y or xy", str, optional=True
        ),
        "cycles": Variable(_BODY, "1", "cycles counted"),
        "largest_range_pa": Variable(_BODY, "Pa", "largest stress range"),
        "equivalent_range_pa": Variable(
            _BODY, "Pa", "constant range that does the same damage in as many cycles"
        ),
        "damage": Variable(_BODY, "1", "damage of the run, run.duration long, by Palmgren and Miner; 1 is failure"),
        "life_s": Variable(
            _BODY, "s", "time to damage 1 if the run is repeated; infinite without damage"
        ),
        "damage_in_test": Variable(
            _BODY, "1", "damage of a test of run.test_duration, at the rate of the run", optional=True
        ),
        # not known of an input that is not random, or of few cycles
        "damage_low": Variable(
            _BODY, "1", "lower end of the interval of the damage, 95 %, of the mean of runs with other seeds; NaN "
            "where there is none", optional=True,
        ),
        "damage_high": Variable(_BODY, "1", "upper end of this interval", optional=True),
        **_cycles("body", "fatigue/body", "Pa"),
    },
    optional=True,
)  # fmt: skip
_LEVEL = ("level",)
RANDOM = Layout(
    "random",
    "Statistics of a run with a stationary random input, without the first part of the run; the input first.",
    {
        "start_s": Variable((), "s", "earlier times are not analysed"),
        "test_duration_s": Variable((), "s", "duration of the test for which the largest values are expected"),
        "frequency_hz": Variable(_FREQUENCY, "Hz", "frequency"),
        "level": Variable(_LEVEL, "1", "level above the mean, in standard deviations of the signal"),
        "signal": Variable(_SIGNAL, "1", "name and quantity of the signal", str),
        "section": Variable(_SIGNAL, "", "probes, snubbers, outputs or bodies; excitation of the input", str),
        "name": Variable(_SIGNAL, "", "input, or the name of the probe, snubber or output", str),
        "quantity": Variable(_SIGNAL, "", "quantity of the signal", str),
        "unit": Variable(_SIGNAL, "", "unit of the signal", str),
        "mean": Variable(_SIGNAL, "{unit}", "mean"),
        "rms": Variable(_SIGNAL, "{unit}", "root mean square, mean included"),
        "standard_deviation": Variable(_SIGNAL, "{unit}", "standard deviation"),
        "highest": Variable(_SIGNAL, "{unit}", "largest value"),
        "lowest": Variable(_SIGNAL, "{unit}", "smallest value"),
        "crest_factor": Variable(
            _SIGNAL, "1", "largest distance from the mean over the standard deviation"
        ),
        "kurtosis": Variable(_SIGNAL, "1", "kurtosis; 3 for a Gaussian signal"),
        "crossing_rate_hz": Variable(_SIGNAL, "Hz", "upward crossings of the mean per second"),
        "peaks_over_2_sigma": Variable(
            _SIGNAL, "1", "share of the maxima more than 2 standard deviations above the mean"
        ),
        "peaks_over_3_sigma": Variable(
            _SIGNAL, "1", "share of the maxima more than 3 standard deviations above the mean"
        ),
        # NaN of a signal that does not move
        "rms_low": Variable(
            _SIGNAL, "{unit}", "lower end of the interval of the root mean square, 95 % of records of a Gaussian input",
            optional=True,
        ),
        "rms_high": Variable(_SIGNAL, "{unit}", "upper end of this interval", optional=True),
        "degrees_of_freedom": Variable(
            _SIGNAL, "1", "equivalent degrees of freedom of the mean square", optional=True
        ),
        # NaN also where they are not reliable
        "expected_peak": Variable(
            _SIGNAL, "{unit}", "largest magnitude expected in the test, which half of such tests exceed",
            optional=True,
        ),
        "expected_peak_low": Variable(
            _SIGNAL, "{unit}", "lower end of the interval of the largest magnitude, 95 % of tests", optional=True
        ),
        "expected_peak_high": Variable(_SIGNAL, "{unit}", "upper end of this interval", optional=True),
        "expected_peak_unknown": Variable(_SIGNAL, "", "reason why it is not stated", str, optional=True),
        "three_sigma": Variable(
            _SIGNAL, "{unit}", "magnitude of the mean, and three standard deviations; of an acceleration behind "
            "run.low_pass", optional=True,
        ),
        "decided_after_s": Variable(
            _SIGNAL, "s", "duration of a run of which the interval is about to leave the limit that it spans; infinite "
            "where none is, NaN where it spans none", optional=True,
        ),
        # NaN where the structure has no snubbers or is more than linear without them
        "linear_open": Variable(
            _SIGNAL, "{unit}", "standard deviation of the stationary linear response, every snubber always open",
            optional=True,
        ),
        "linear_closed": Variable(
            _SIGNAL, "{unit}", "standard deviation of the stationary linear response, every snubber always closed",
            optional=True,
        ),
        "density": Variable(
            _SIGNAL + _FREQUENCY, "({unit})^2/Hz", "one-sided spectral density of the {quantity}"
        ),
        "density_open": Variable(
            _SIGNAL + _FREQUENCY, "({unit})^2/Hz",
            "density of the stationary linear response, every snubber always open", optional=True,
        ),
        "density_closed": Variable(
            _SIGNAL + _FREQUENCY, "({unit})^2/Hz",
            "density of the stationary linear response, every snubber always closed", optional=True,
        ),
        "limit": Variable(
            _SIGNAL + _FREQUENCY, "({unit})^2/Hz", "limit of the density, NaN where there is none", optional=True
        ),
        "crossings_hz": Variable(
            _SIGNAL + _LEVEL, "Hz", "upward crossings of each level per second, at the samples"
        ),
        # of the absolute acceleration, of the displacement where a force drives the structure
        "probe": Variable(_PROBE, "1", "name of the probe", str),
        "transmissibility_real": Variable(
            _PROBE + _FREQUENCY, "{transmissibility_unit}", "response over input (H1), real part"
        ),
        "transmissibility_imag": Variable(
            _PROBE + _FREQUENCY, "{transmissibility_unit}", "imaginary part of it"
        ),
        "coherence": Variable(_PROBE + _FREQUENCY, "1", "coherence of response and input"),
    },
    optional=True,
)  # fmt: skip
CONTACT = Layout(
    "contact",
    "The motion of several bodies, or of bodies in space, when the largest contact force of all snubbers acts.",
    {
        "time": Variable((), "s", "time of the largest contact force"),
        "contact_snubber": Variable((), "1", "snubber with this force, number from 0", int, names="contact/snubber"),
        "force": Variable((), "N", "largest contact force"),
        "station": Variable(_STATION, "1", "number of the station of the mode shapes", int),
        "deflection": Variable(_STATION, "m", "deflection relative to the base at that time"),
        "direction": Variable(("direction",), "1", "axis of a displacement", str),
        "deflection_in_space": Variable(
            (*_STATION, "direction"), "m", "displacement along x, y and z at that time; NaN on bodies that are not in "
            "space", optional=True,
        ),
        "snubber": Variable(("snubber",), "1", "name of the snubber", str),
        "opening": Variable(
            ("snubber",), "{gap_unit}", "distance to its face at that time; 0 in contact or while latched"
        ),
    },
    optional=True,
)  # fmt: skip
_ROW = ("row",)
SENSITIVITIES = Layout(
    "sensitivities",
    "How values of the run change with numbers of its scenario.",
    {
        "row": Variable(_ROW, "1", "number of the derivative", int),
        "response": Variable(_ROW, "", "name of the value, as in studies", str),
        "value": Variable(_ROW, "{value_unit}", "the value"),
        "value_unit": Variable(_ROW, "", "SI unit of the value", str),
        "derivative": Variable(
            _ROW, "({value_unit})/({number_unit})", "derivative of the value by the number"
        ),
        "derivative_below": Variable(
            _ROW, "({value_unit})/({number_unit})",
            "derivative for smaller numbers: another one where another extreme decides at the lower end of the "
            "tolerance, or is within 1 % and would take over first",
        ),
        "derivative_above": Variable(
            _ROW, "({value_unit})/({number_unit})", "derivative for larger numbers, at the upper end of the tolerance"
        ),
        "path": Variable(_ROW, "", "path of the number", str),
        "number_unit": Variable(_ROW, "", "SI unit of the number", str),
        "number": Variable(_ROW, "{number_unit}", "the number"),
        "tolerance": Variable(_ROW, "{number_unit}", "tolerance of the number"),
        "holds_within": Variable(
            _ROW, "{number_unit}", "smallest change of the number that makes or takes away a contact, or with which "
            "another extreme decides",
        ),
        "change": Variable(
            _ROW, "{value_unit}", "change of the value where the number is larger by its tolerance, by derivatives"
        ),
        "change_below": Variable(
            _ROW, "{value_unit}", "change of the value where the number is smaller by its tolerance, by derivatives"
        ),
    },
    optional=True,
)  # fmt: skip
