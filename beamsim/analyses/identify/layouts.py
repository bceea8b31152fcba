"""The variables of the labelled datasets of an identification, see `beamsim.labelled`."""

from __future__ import annotations

from beamsim.labelled import Layout, Variable

_END = {"end": Variable(("end",), "1", "which end of a range", str)}
ENDS = ("lower", "upper")
"""Values of the dimension ``end``."""
BEFORE, WITHOUT, WITH = "before_update", "without_snubber", "with_snubber"
"""Names of models in `FREQUENCIES`."""
_FREQUENCY = ("frequency",)
FREQUENCIES = Layout(
    "frequencies",
    "Measured and predicted natural frequencies, as in tables 1.2 and 1.3 of the thesis, of one model after the other.",
    {
        "model": Variable(
            ("model",), "1", "before_update or without_snubber, contacts open; with_snubber, permanent contact", str
        ),
        "frequency": Variable(_FREQUENCY, "1", "number of the frequency", int),
        "frequency_model": Variable(_FREQUENCY, "1", "number of the model, from 0", int, names="frequencies/model"),
        "mode": Variable(_FREQUENCY, "1", "number of the mode", int),
        "measured_hz": Variable(_FREQUENCY, "Hz", "measured natural frequency; NaN where none was measured"),
        "predicted_hz": Variable(_FREQUENCY, "Hz", "predicted natural frequency"),
        "difference_percent": Variable(_FREQUENCY, "percent", "100 (predicted - measured) / measured"),
    },
)  # fmt: skip
_MODE = ("mode",)
STIFFNESS = Layout(
    "stiffness",
    "A snubber's stiffness from natural frequencies with permanent contact, with its uncertainty.",
    {
        "mode": Variable(_MODE, "1", "number of the mode used", int),
        **_END,
        "stiffness": Variable((), "N/m", "stiffness of the snubber"),
        "standard_deviation": Variable((), "N/m", "standard deviation, first order; NaN where no uncertainty is known"),
        "interval_first_order": Variable(("end",), "N/m", "confidence interval, first order, symmetric"),
        "interval": Variable(
            ("end",), "N/m",
            "confidence interval: for one mode that of its frequency transformed, for several the profile likelihood",
        ),
        "coverage": Variable((), "1", "probability of the intervals"),
        "total_standard_deviation": Variable(
            (), "N/m", "standard deviation with the uncertainty of the structure's parameters"
        ),
        "monte_carlo_standard_deviation": Variable((), "N/m", "standard deviation of Monte Carlo samples"),
        "monte_carlo_interval": Variable(("end",), "N/m", "confidence interval by Monte Carlo sampling"),
        "monte_carlo_samples": Variable((), "1", "number of Monte Carlo samples", int),
        "monte_carlo_unreachable": Variable((), "1", "share of the Monte Carlo samples that no stiffness fits"),
        "residual": Variable((), "1", "root mean square of (predicted - measured) / measured over the modes used"),
        "individual": Variable(
            _MODE, "N/m", "stiffness from each of these modes alone; NaN where it is out of reach"
        ),
        "individual_interval": Variable(
            (*_MODE, "end"), "N/m", "confidence interval of each of these; NaN where it is not known"
        ),
        "reach_hz": Variable(
            (*_MODE, "end"), "Hz", "for each of these modes the range of frequencies that any stiffness can give"
        ),
        "condition": Variable(
            _MODE, "1", "k df/dk / f of each of these modes: relative change in f for one in k"
        ),
        "eigenvalue_solutions": Variable((), "1", "eigenvalue problems solved", int),
        "table_force": Variable(
            (), "N", "of a snubber with a force-deflection table its force at static equilibrium", optional=True
        ),
        "table_deflection": Variable((), "m", "deflection of the table at static equilibrium", optional=True),
        "table_segment": Variable((), "1", "number of the segment of the table there, from 1", int, optional=True),
        "table_segments": Variable((), "1", "number of segments", int, optional=True),
        "table_slope": Variable((), "N/m", "slope of that segment in the scenario", optional=True),
        "table_factor": Variable((), "1", "identified stiffness over that slope", optional=True),
        "table_at_a_bend": Variable(
            (), "1", "whether it rests where two segments meet", bool, True, ("within_a_segment", "at_a_bend")
        ),
    },
    optional=True,
)  # fmt: skip
_PARAMETER = ("parameter",)
SENSITIVITIES = Layout(
    "sensitivities",
    "How the identified stiffness depends on the numbers of the structure, the largest influence first.",
    {
        "parameter": Variable(_PARAMETER, "1", "path of the parameter in the scenario", str),
        "value": Variable(_PARAMETER, "{unit}", "value of the parameter"),
        "relative": Variable(
            _PARAMETER, "1", "d ln k / d ln p: relative change of the stiffness for that of the parameter"
        ),
        "uncertainty": Variable(_PARAMETER, "1", "relative standard deviation of the parameter; NaN where not given"),
        "contribution": Variable(
            _PARAMETER, "1", "relative standard deviation of the stiffness due to the parameter; NaN where not known"
        ),
    },
    optional=True,
)
_POINT = ("point",)
CURVES = Layout(
    "curves",
    "Natural frequencies against the stiffness of the snubber, one mode after the other.",
    {
        "mode": Variable(_MODE, "1", "number of the mode", int),
        "point": Variable(_POINT, "1", "number of the point", int),
        "point_mode": Variable(_POINT, "1", "number of the curve, from 0", int, names="curves/mode"),
        "stiffness": Variable(_POINT, "N/m", "stiffness of the snubber, increasing"),
        "frequency_hz": Variable(_POINT, "Hz", "natural frequency with a spring of that stiffness"),
    },
    optional=True,
)
_PROFILE = ("profile",)
PROFILES = Layout(
    "profiles",
    "Profile likelihoods, one after the other: the misfit over one parameter, all others fitted again.",
    {
        "profile": Variable(_PROFILE, "1", "number of the profile", int),
        "fit": Variable(_PROFILE, "1", "fit that it belongs to: stiffness, update or nonlinear", str),
        "parameter": Variable(_PROFILE, "1", "path of the parameter in the scenario; stiffness: the snubber's", str),
        "unit": Variable(_PROFILE, "", "SI unit of the parameter", str),
        "coverage": Variable((), "1", "probability of the intervals of the fits"),
        "point": Variable(_POINT, "1", "number of the point", int),
        "point_profile": Variable(_POINT, "1", "number of the profile, from 0", int, names="profiles/profile"),
        "value": Variable(_POINT, "", "value of the parameter, in its SI unit"),
        "misfit": Variable(_POINT, "1", "chi squared above its minimum, all other parameters fitted again"),
    },
    optional=True,
)
_ESTIMATES = {
    "parameter": Variable(_PARAMETER, "1", "path of the parameter in the scenario", str),
    **_END,
    "initial_value": Variable(_PARAMETER, "{unit}", "value in the scenario, for [*] of the first item"),
    "value": Variable(_PARAMETER, "{unit}", "estimated value"),
    "standard_deviation": Variable(_PARAMETER, "{unit}", "standard deviation; NaN where it is not known"),
    "interval": Variable((*_PARAMETER, "end"), "{unit}", "confidence interval"),
    "bounds": Variable((*_PARAMETER, "end"), "{unit}", "bounds of the search"),
    "prior": Variable(_PARAMETER, "1", "relative standard deviation of the prior; NaN without one"),
    "at_bound": Variable(
        _PARAMETER, "1", "whether the estimate lies on its bound", bool, flags=("inside", "on_its_bound")
    ),
    "other_parameter": Variable(("other_parameter",), "1", "path of the other parameter", str),
    "correlation": Variable(
        (*_PARAMETER, "other_parameter"), "1", "correlation of the parameters' logarithms; NaN where it is not known"
    ),
}
UPDATE = Layout(
    "update",
    "Parameters of the structure from frequencies measured without the snubber.",
    {
        **_ESTIMATES,
        "combination": Variable(("combination",), "1", "supports, in the order of their parameters", str),
        "combination_misfit": Variable(
            ("combination",), "1", "chi squared with these supports; infinite where there is no such case"
        ),
        "misfit_before": Variable((), "1", "chi squared with the scenario's values, priors included"),
        "misfit_after": Variable((), "1", "chi squared with the identified values, priors included"),
        "evaluations": Variable((), "1", "eigenvalue problems solved", int),
        "scenario": Variable((), "", "the scenario with the identified parameters, YAML", str),
    },
    optional=True,
)
NONLINEAR = Layout(
    "nonlinear",
    "Parameters from nonlinear tests.",
    {
        **_ESTIMATES,
        "misfit_before": Variable((), "1", "chi squared with the scenario's values"),
        "misfit": Variable((), "1", "chi squared with the estimated values"),
        "degrees_of_freedom": Variable((), "1", "measured numbers minus parameters", int),
        "starts": Variable((), "1", "starting points of the search", int),
        "starts_agreeing": Variable((), "1", "starting points that ended in the best minimum", int),
        "responses": Variable((), "1", "periodic responses and transients computed", int),
        "processor_time_s": Variable((), "s", "processor time"),
        "coverage": Variable((), "1", "probability of the intervals"),
    },
    optional=True,
)
_TEST, _HARMONIC, _SAMPLE, _PEAK = ("test",), ("harmonic",), ("sample",), ("peak",)
_OF_TEST = "number of the test, from 0"
_IN_ITS_UNIT = ", in the unit of its test"
TESTS = Layout(
    "tests",
    "Nonlinear tests, and what was measured and predicted in them. A steady vibration has harmonics, amplitude e^(i "
    "phase) of A sin(2 pi f n t + phase) in the time of the measurement; a transient has samples; a row of a table of "
    "sweeps has peaks and a branch of motions.",
    {
        "test": Variable(_TEST, "1", "number of the test", int),
        "name": Variable(_TEST, "", "name of the test", str),
        "kind": Variable(_TEST, "", "steady, transient or sweep", str),
        "probe": Variable(_TEST, "", "name of the probe", str),
        "quantity": Variable(_TEST, "", "quantity that was measured", str),
        "unit": Variable(_TEST, "", "its unit", str),
        "treatment": Variable(_TEST, "", "what was done to the record, in order", str),
        **_END,
        "delay_s": Variable(_TEST, "s", "measured(t) = predicted(t + delay)"),
        "delay_interval": Variable(
            (*_TEST, "end"), "s", "confidence interval of the delay; NaN where it is not fitted"
        ),
        "misfit": Variable(_TEST, "1", "its part of chi squared with the estimated values"),
        "misfit_without": Variable(
            _TEST, "1", "chi squared of a fit to the other tests alone, to first order; NaN if there are too few"
        ),
        "frequency_hz": Variable(_TEST, "Hz", "frequency of the excitation of a steady vibration", optional=True),
        "noise": Variable(_TEST, "{unit}", "standard deviation of a sample of a transient", optional=True),
        "level": Variable(_TEST, "", "level of the excitation of a sweep, SI units", optional=True),
        "direction": Variable(_TEST, "", "of a sweep up or down", str, optional=True),
        "harmonic": Variable(_HARMONIC, "1", "number of the harmonic", int),
        "harmonic_test": Variable(_HARMONIC, "1", _OF_TEST, int, names="tests/test"),
        "harmonic_order": Variable(_HARMONIC, "1", "frequency over excitation frequency"),
        "harmonic_measured_real": Variable(_HARMONIC, "", f"measured harmonic, real part{_IN_ITS_UNIT}"),
        "harmonic_measured_imag": Variable(_HARMONIC, "", f"measured harmonic, imaginary part{_IN_ITS_UNIT}"),
        "harmonic_noise": Variable(_HARMONIC, "", f"standard deviation of each part of it{_IN_ITS_UNIT}"),
        "harmonic_initial_real": Variable(
            _HARMONIC, "", f"harmonic predicted with the scenario's values, real part{_IN_ITS_UNIT}"
        ),
        "harmonic_initial_imag": Variable(
            _HARMONIC, "", f"harmonic predicted with the scenario's values, imaginary part{_IN_ITS_UNIT}"
        ),
        "harmonic_predicted_real": Variable(
            _HARMONIC, "", f"harmonic predicted with the estimated values, real part{_IN_ITS_UNIT}"
        ),
        "harmonic_predicted_imag": Variable(
            _HARMONIC, "", f"harmonic predicted with the estimated values, imaginary part{_IN_ITS_UNIT}"
        ),
        "sample": Variable(_SAMPLE, "1", "number of the sample", int),
        "sample_test": Variable(_SAMPLE, "1", _OF_TEST, int, names="tests/test"),
        "sample_time": Variable(_SAMPLE, "s", "time since the stated begin"),
        "sample_measured": Variable(_SAMPLE, "", f"measured{_IN_ITS_UNIT}"),
        "sample_initial": Variable(
            _SAMPLE, "", f"predicted with the scenario's values, with the record's mean{_IN_ITS_UNIT}"
        ),
        "sample_predicted": Variable(
            _SAMPLE, "", f"predicted with the estimated values, with the record's mean{_IN_ITS_UNIT}"
        ),
        "peak": Variable(_PEAK, "1", "number of the measured quantity", int),
        "peak_test": Variable(_PEAK, "1", _OF_TEST, int, names="tests/test"),
        "peak_what": Variable(
            _PEAK, "", "measured quantity: a jump, the frequency of a peak, or a peak of a probe", str
        ),
        "peak_measured": Variable(_PEAK, "", "measured, Hz or units of peaks"),
        "peak_noise": Variable(_PEAK, "", "standard deviation, likewise"),
        "peak_initial": Variable(_PEAK, "", "predicted with the scenario's values, likewise"),
        "peak_predicted": Variable(_PEAK, "", "predicted with the estimated values, likewise"),
        "point": Variable(_POINT, "1", "number of the point of a branch", int),
        "point_test": Variable(_POINT, "1", _OF_TEST, int, names="tests/test"),
        "point_frequency_hz": Variable(_POINT, "Hz", "frequency along the branch"),
        "point_peak": Variable(
            _POINT, "",
            f"largest magnitude of a period along the branch, of the first peak's channel{_IN_ITS_UNIT}",
        ),
    },
    optional=True,
)  # fmt: skip
_BRANCH, _MEASUREMENT = ("branch",), ("measurement",)
PAD = Layout(
    "pad",
    "A spring and Maxwell branches fitted to measurements of the pad.",
    {
        "kind": Variable((), "", "dynamic (over frequency) or relaxation (over time)", str),
        **_END,
        "stiffness": Variable((), "N/m", "stiffness after a long rest"),
        "stiffness_interval": Variable(("end",), "N/m", "its confidence interval; NaN where it is not known"),
        "misfit": Variable(
            (), "1", "root mean square of the relative errors of the complex stiffness or the relaxation"
        ),
        "least_misfit": Variable((), "1", "misfit with the largest possible number of branches"),
        "ramp": Variable((), "s", "time over which the deflection of a relaxation test rises", optional=True),
        "branch": Variable(_BRANCH, "1", "number of the Maxwell branch, in the order of relaxation times", int),
        "branch_stiffness": Variable(_BRANCH, "N/m", "stiffness of each branch"),
        "branch_interval": Variable((*_BRANCH, "end"), "N/m", "confidence interval of the stiffness"),
        "relaxation_time": Variable(_BRANCH, "s", "relaxation time of each branch"),
        "time_interval": Variable((*_BRANCH, "end"), "s", "confidence interval of the relaxation time"),
        "measurement": Variable(_MEASUREMENT, "1", "number of the measurement of the pad", int),
        "frequency_hz": Variable(_MEASUREMENT, "Hz", "frequency of each measurement", optional=True),
        "time": Variable(_MEASUREMENT, "s", "time of each measurement since the deflection began", optional=True),
        "measured_stiffness": Variable(
            _MEASUREMENT, "N/m", "measured storage stiffness, or force over deflection in relaxation"
        ),
        "fitted_stiffness": Variable(_MEASUREMENT, "N/m", "storage stiffness or relaxation of spring and branches"),
        "measured_loss_factor": Variable(_MEASUREMENT, "1", "measured loss factor", optional=True),
        "fitted_loss_factor": Variable(_MEASUREMENT, "1", "loss factor of spring and branches", optional=True),
        "point": Variable(_POINT, "1", "number of the point of the fitted curve", int),
        "curve_at": Variable(_POINT, "{unit}", "frequency or time of the fitted curve"),
        "curve_stiffness": Variable(_POINT, "N/m", "storage stiffness or relaxation at that point"),
        "curve_loss_factor": Variable(_POINT, "1", "loss factor at that point; zero in relaxation"),
    },
    optional=True,
)
SHAPES = Layout(
    "shapes",
    "Likeness of measured mode shapes and those of the model without the snubber.",
    {
        "measured_shape": Variable(("measured_shape",), "1", "number of the measured shape", int),
        "predicted_shape": Variable(("predicted_shape",), "1", "number of the predicted shape", int),
        "mac": Variable(
            ("measured_shape", "predicted_shape"), "1", "modal assurance criterion, measured by predicted shapes"
        ),
    },
    optional=True,
)
