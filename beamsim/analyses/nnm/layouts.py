"""The variables of the labelled datasets of nonlinear normal modes, see `beamsim.labelled`."""

from __future__ import annotations

from beamsim.labelled import Layout, Variable
from beamsim.results.branch import FLAGS, OF_BRANCHES, OF_MOTIONS, outcome_variables

_BRANCH, _POINT, _PROBE, _STATION = ("branch",), ("point",), ("probe",), ("station",)
_OF_STATIONS = {"station": Variable(_STATION, "1", "number of the station, as in modes", int)}
_OF_PROBES = {"probe": Variable(_PROBE, "1", "name of the probe", str)}
_OF_COORDINATES = {"coordinate": Variable(("coordinate",), "1", "number of the coordinate", int)}
BRANCHES = Layout(
    "branches",
    "The branches of free motions, a row for each, the backbone first. The backbone is that of the mode, a tongue one "
    "of an internal resonance, and non-brake orbits are never at rest.",
    {
        **OF_BRANCHES,
        "mode": Variable(
            _BRANCH, "1", "the other mode of a tongue or a non-brake branch, from 1; 0 of the backbone", int
        ),
        "ratio": Variable(_BRANCH, "1", "n of the n:1 resonance; 0 of the backbone", int),
        "continued_in": Variable((), "", "stiffness_factor, energy or frequency", str),
        "method": Variable((), "", "shooting, full_period, multiple_scales or relaxed_minimisation", str),
    },
)
POINTS = Layout(
    "points",
    "The points of all branches, one branch after the other. Motions are given at the instant of smallest kinetic "
    "energy; brake orbits are at rest then.",
    {
        **OF_MOTIONS,
        "energy": Variable(_POINT, "J", "energy from static equilibrium"),
        "share": Variable(_POINT, "1", "share of the energy in the requested mode, at the slowest instant"),
        "least_kinetic": Variable(
            _POINT, "1", "kinetic energy at the slowest instant, as a share of the energy; zero at rest"
        ),
        **_OF_STATIONS,
        "initial_displacement": Variable(_POINT + _STATION, "m", "deflection at the slowest instant"),
        "half_period_difference": Variable(
            _POINT, "1",
            "for a backbone by full-period shooting, the largest relative difference of period and state from "
            "half-period shooting; else NaN", optional=True,
        ),
    },
)  # fmt: skip
_JUMP = ("jump",)
JUMPS = Layout(
    "jumps",
    "Gaps in the backbone where internal resonances cut it.",
    {
        "jump": Variable(_JUMP, "1", "number of the jump", int),
        "start": Variable(_JUMP, "{unit}", "parameter of the last point before the gap"),
        "end": Variable(_JUMP, "{unit}", "parameter of the first point after the gap"),
        "mode": Variable(_JUMP, "1", "the other mode, from 1; 0 where unknown", int),
        "ratio": Variable(_JUMP, "1", "n of n:1; 0 where unknown", int),
    },
    optional=True,
)
_TIME, _ORDER, _INSTANT, _LINE = ("time",), ("order",), ("instant",), ("spectrum_frequency_hz",)
MOTION = Layout(
    "motion",
    "The motion in the picture: one period from the instant of smallest kinetic energy, and its spectrum over many "
    "periods. It is that of the backbone's last point, or the one furthest from rest of the first non-brake branch.",
    {
        "branch": Variable((), "1", "number of its branch, from 0", int),
        "branch_point": Variable((), "1", "number of its point along the branch, from 1", int),
        "periods": Variable((), "1", "periods of the time history of the spectrum", int),
        "drift": Variable((), "1", "relative difference of the states at the end and at the start of these periods"),
        "time": Variable(_TIME, "s", "time, both ends of the period included"),
        **_OF_PROBES,
        "displacement": Variable(_PROBE + _TIME, "m", "displacement"),
        "velocity": Variable(_PROBE + _TIME, "m/s", "velocity"),
        "order": Variable(_ORDER, "1", "order of the harmonic", int),
        "harmonic_real": Variable(_PROBE + _ORDER, "m", "amplitude of cos(order x phase) of the displacement"),
        "harmonic_imag": Variable(_PROBE + _ORDER, "m", "minus the amplitude of sin(order x phase)"),
        "spectrum_frequency_hz": Variable(_LINE, "Hz", "frequency"),
        "spectrum": Variable(_PROBE + _LINE, "m", "single-sided amplitude of the displacement, zero to peak"),
        "snubber": Variable(("snubber",), "1", "name of the snubber", str),
        "force": Variable(("snubber", *_TIME), "{force_unit}", "contact force, positive when it pushes"),
        **_OF_STATIONS,
        "deflection": Variable(_TIME + _STATION, "m", "deflection at the stations"),
        "instant": Variable(_INSTANT, "1", "share of the period"),
        "extreme_shapes": Variable(
            _INSTANT + _STATION, "m", "deflection at the slowest instant and half a period later"
        ),
        "linear_shape": Variable(_STATION, "m", "linear mode with the largest deflection of this motion"),
    },
)  # fmt: skip

# --- The damped structure excited on its mode -------------------------------------------------------------------------

_LEVEL = ("level_index",)
_OF_LEVEL = "phase_resonance/level_index"
PHASE_RESONANCE = Layout(
    "phase_resonance",
    "The mode excited at phase resonance, a row for each level: the predicted motion; the exact motion, NaN if there "
    "is none; and the damped structure from the predicted state under the predicted force, NaN if contacts chatter.",
    {
        "level_index": Variable(_LEVEL, "1", "number of the level, from 0", int),
        "quantity": Variable((), "", "quantity of the level: force, acceleration, velocity or displacement", str),
        "compared_probe": Variable((), "", "probe whose amplitude is compared: the one with the largest motion", str),
        "scales": Variable(
            (), "1", "whether the level is proportional to the amplitude at a constant frequency", bool,
            flags=("no", "yes"),
        ),
        **outcome_variables(()),
        "level": Variable(_LEVEL, "{level_unit}", "level of the excitation"),
        "predicted_frequency_hz": Variable(_LEVEL, "Hz", "frequency of the predicted motion"),
        "predicted_energy": Variable(_LEVEL, "J", "its energy"),
        "found": Variable(_LEVEL, "1", "whether the exact motion was found", bool, flags=("no", "yes")),
        "frequency_hz": Variable(_LEVEL, "Hz", "frequency of the exact motion"),
        "level_for_amplitude": Variable(
            _LEVEL, "{level_unit}", "predicted level for the exact amplitude at the compared probe"
        ),
        "stable": Variable(_LEVEL, "1", "whether it is stable", bool, flags=FLAGS),
        "residual": Variable(_LEVEL, "1", "largest periodicity error, relative to the size of the motion"),
        "quadrature": Variable(_LEVEL, "1", "cosine of the lag between force and deflection"),
        "energy_error": Variable(_LEVEL, "1", "imbalance of the energies over a period, relative to the energy"),
        "multiplier": Variable(("multiplier",), "1", "number of the Floquet multiplier", int),
        "floquet_multipliers_real": Variable((*_LEVEL, "multiplier"), "1", "Floquet multipliers, real part"),
        "floquet_multipliers_imag": Variable((*_LEVEL, "multiplier"), "1", "Floquet multipliers, imaginary part"),
        "curve_status": Variable(
            _LEVEL, "", "complete, or why the response about the resonance stopped early; empty without one", str
        ),
        **_OF_PROBES,
        "predicted_amplitude": Variable(_LEVEL + _PROBE, "m", "largest deflection of the predicted motion"),
        "amplitude": Variable(_LEVEL + _PROBE, "m", "largest deflection of the exact motion"),
        "period": Variable(("period",), "1", "number of the period", int),
        "departure": Variable(
            (*_LEVEL, "period"), "1", "largest distance from the mode in a period, in the norm of energy"
        ),
        "instant": Variable(_INSTANT, "1", "number of an instant of rest of the mode in the last period", int),
        "instants": Variable(_LEVEL + _INSTANT, "s", "time of the instant of rest"),
        **_OF_STATIONS,
        "shapes": Variable(_LEVEL + _INSTANT + _STATION, "m", "deflection of the structure at that instant"),
        "mode_shapes": Variable(_LEVEL + _INSTANT + _STATION, "m", "deflection of the mode at that instant"),
    },
    optional=True,
)  # fmt: skip
PREDICTED_LEVELS = Layout(
    "predicted_levels",
    "The level from the energy balance along the backbone.",
    {
        "point": Variable(_POINT, "1", "number of the point", int),
        "energy": Variable(_POINT, "J", "energy from static equilibrium"),
        "frequency_hz": Variable(_POINT, "Hz", "frequency of the motion"),
        "level": Variable(_POINT, "{level_unit}", "level of the excitation that sustains the motion"),
        "dissipated": Variable(_POINT, "J", "energy taken by damping in a period"),
        "contact_share": Variable(_POINT, "1", "share of it taken by the contacts' dashpots"),
        **_OF_PROBES,
        "amplitude": Variable(_PROBE + _POINT, "m", "largest deflection of a period"),
    },
    optional=True,
)
RESONANCE_CURVES = Layout(
    "resonance_curves",
    "Forced periodic motions about the resonance of each level, level by level.",
    {
        "point": Variable(_POINT, "1", "number of the point", int),
        "level_index": Variable(_POINT, "1", "number of the level, from 0", int, names=_OF_LEVEL),
        "frequency_hz": Variable(_POINT, "Hz", "frequency of the excitation"),
        "stable": Variable(_POINT, "1", "whether the motion is stable", bool, flags=FLAGS),
        "energy_error": Variable(_POINT, "1", "imbalance of the energies over a period, relative to the energy"),
        **_OF_PROBES,
        "amplitude": Variable(_PROBE + _POINT, "m", "largest deflection of a period"),
    },
    optional=True,
)
_SAMPLE = ("sample",)
UNCONTROLLED = Layout(
    "uncontrolled",
    "The damped structure from a state of the mode, under the predicted force, level by level: whole periods without "
    "their end point.",
    {
        "sample": Variable(_SAMPLE, "1", "number of the sample", int),
        "level_index": Variable(_SAMPLE, "1", "number of the level, from 0", int, names=_OF_LEVEL),
        "time": Variable(_SAMPLE, "s", "time"),
        **_OF_PROBES,
        "displacement": Variable(_PROBE + _SAMPLE, "m", "displacement"),
    },
    optional=True,
)
UNCONTROLLED_SPECTRA = Layout(
    "uncontrolled_spectra",
    "Spectra of these displacements over all periods, level by level.",
    {
        "sample": Variable(_SAMPLE, "1", "number of the line", int),
        "level_index": Variable(_SAMPLE, "1", "number of the level, from 0", int, names=_OF_LEVEL),
        "frequency_hz": Variable(_SAMPLE, "Hz", "frequency of the line"),
        **_OF_PROBES,
        "line": Variable(_PROBE + _SAMPLE, "m", "amplitude of the line, zero to peak"),
    },
    optional=True,
)

# --- Other methods compared with the exact motions -------------------------------------------------------------------

_FACTOR = ("factor",)
_BY_ORDER, _STEP = (*_FACTOR, "order"), ("step", "order")
MULTIPLE_SCALES = Layout(
    "multiple_scales",
    "Frequency and initial condition of the mode against the stiffness factor, to orders 0, 1 and 2, against the exact "
    "motions at the same energy; NaN where none was found near the expansion.",
    {
        "factor": Variable(_FACTOR, "1", "stiffness factor"),
        "order": Variable(("order",), "1", "order of the expansion", int),
        "step": Variable(("step",), "1", "number of the step between neighbouring factors", int),
        "mode": Variable((), "1", "number of the mode", int),
        "energy": Variable((), "J", "energy from static equilibrium"),
        "linear_frequency_hz": Variable((), "Hz", "natural frequency"),
        "first_hz": Variable((), "Hz", "change of the frequency per factor, at the linear mode's amplitude"),
        "second_hz": Variable((), "Hz", "change of the frequency per squared factor"),
        "coupled_mode": Variable((), "1", "mode with the largest first-order component", int),
        "harmonic": Variable((), "1", "its harmonic", int),
        "reach": Variable((), "1", "upper limit of validity: the expansion needs factors well below this one"),
        "pole": Variable((), "1", "factor above which the initial vector is not yet at its asymptotic order"),
        "pole_mode": Variable((), "1", "mode whose coordinate it is; 0 for none", int),
        "pole_harmonic": Variable((), "1", "harmonic that is close to it", int),
        "frequency_hz": Variable(_BY_ORDER, "Hz", "frequency to each order"),
        "exact_frequency_hz": Variable(_FACTOR, "Hz", "frequency by shooting"),
        "exact_residual": Variable(_FACTOR, "1", "largest periodicity error of the exact motion, relative to its size"),
        "frequency_difference": Variable(_BY_ORDER, "1", "relative error of the frequency to each order"),
        "initial_difference": Variable(
            _BY_ORDER, "1", "error of the initial vector to each order, in the norm of the linear strain energy"
        ),
        "uniform_difference": Variable(_BY_ORDER, "1", "error of the uniform expansion's initial vector to each order"),
        "frequency_orders": Variable(
            _STEP, "1", "observed orders of the frequency's difference between neighbouring factors"
        ),
        "initial_orders": Variable(
            _STEP, "1", "observed orders of the initial vector's difference between neighbouring factors"
        ),
        "expected_orders": Variable(_STEP, "1", "expected orders of the initial vector, by the uniform expansion"),
        "uniform_orders": Variable(_STEP, "1", "observed orders of the uniform expansion's initial vector"),
        **_OF_COORDINATES,
        "coordinates": Variable((*_BY_ORDER, "coordinate"), "kg^0.5 m", "initial vector to each order"),
        "uniform_coordinates": Variable(
            (*_BY_ORDER, "coordinate"), "kg^0.5 m", "initial vector of the uniform expansion to each order"
        ),
        "exact_coordinates": Variable((*_FACTOR, "coordinate"), "kg^0.5 m", "coordinates of the exact motion at rest"),
        **_OF_STATIONS,
        "initial_displacement": Variable((*_BY_ORDER, *_STATION), "m", "deflection at rest to each order"),
        "exact_initial_displacement": Variable(_FACTOR + _STATION, "m", "deflection of the exact motion at rest"),
    },
    optional=True,
)
RELAXED_MINIMISATION = Layout(
    "relaxed_minimisation",
    "A path of relaxed minimisation, step by step up to the first that is not reached, and the exact motions at the "
    "same factors; NaN where a tongue cuts the backbone.",
    {
        "factor": Variable(_FACTOR, "1", "stiffness factor"),
        "steps": Variable((), "1", "number of requested steps", int),
        "tolerance": Variable((), "1", "tolerance of the functional"),
        **outcome_variables(()),
        "shooting_motions": Variable(
            (), "1", "motions computed for the backbone, its tongues and the same factors", int
        ),
        "shooting_processor_time_s": Variable((), "s", "processor time of shooting"),
        "frequency_hz": Variable(_FACTOR, "Hz", "frequency"),
        "functional": Variable(_FACTOR, "1", "functional over twice the energy at the end of its minimisation"),
        "motions": Variable(_FACTOR, "1", "motions computed", int),
        "processor_time_s": Variable(_FACTOR, "s", "processor time"),
        "converged": Variable(
            _FACTOR, "1", "whether the functional fell below the tolerance", bool, flags=("no", "yes")
        ),
        "exact_frequency_hz": Variable(_FACTOR, "Hz", "frequency of the backbone by shooting"),
        "frequency_difference": Variable(_FACTOR, "1", "difference of the frequency from the backbone, relative"),
        "shape_difference": Variable(
            _FACTOR,
            "1",
            "difference of the shape from the backbone, relative, in the norm of the linear strain energy",
        ),
        "nearby_motion": Variable(_FACTOR, "", "exact motion near it: same, other, none or between", str),
        "jumped": Variable(
            _FACTOR,
            "1",
            "whether the step jumped to another motion than that of the previous step",
            bool,
            flags=("no", "yes"),
        ),
        **_OF_COORDINATES,
        "coordinates": Variable((*_FACTOR, "coordinate"), "kg^0.5 m", "coordinates at rest"),
        **_OF_STATIONS,
        "initial_displacement": Variable(_FACTOR + _STATION, "m", "deflection at rest"),
    },
    optional=True,
)
