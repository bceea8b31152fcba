"""The page of values that are relative to something else: `python -m docs.site_pages.relative_values`.

Which keys these are follows from the fields of a scenario; this module states what each is relative to.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

from beamsim.scenario import Scenario
from beamsim.scenario.base import Schema, descriptions
from beamsim.scenario.quantities import FieldType, NumberOrText, PositionType, Quantity

PAGE = Path(__file__).parents[1] / "relative_values.md"
_INTRODUCTION = """\
# Values that are relative to something else

This page is for people who vary a case. It lists the keys that take a share, a ratio or a factor, or have a default
that follows from other numbers. For example, `position: 40 %` is a share of the length of a beam. If a study, an
override or an identification changes the length, the position follows. Write shares and ratios in percent or as plain
numbers (0.02 for 2 %), shares of a length only in percent (0.4 means 0.4 m). The page is made from the fields of a
scenario (`python -m docs.site_pages.relative_values`).

"""

SHARES = {
    "PointOfBody.position": "length of the beam, or length (x) and width (y) of the plate, that `body` names, or the "
    "only one; the same wherever a place is written",
    "BeamBody.nodes": "length of this beam",
    "PointMass.position": "length of this beam",
    "SegmentBase.from": "length of this beam",
    "SegmentBase.to": "length of this beam",
    "PointSupport.position": "length (x) and width (y) of this plate",
    "PlatePointMass.position": "length (x) and width (y) of this plate",
    "FramePointMass.position": "length of the member, along its centreline",
    "SectionForce.position": "length of the member, along its centreline",
    "SectionForce.point": "local axes of the section; by default the outermost fibre along its z",
    "Stiffener.from": "length (x) and width (y) of this plate",
    "Stiffener.to": "length (x) and width (y) of this plate",
    "LineLoad.line": "length of the beam on which the load acts",
    "AreaLoad.area": "length (x) and width (y) of the plate on which the load acts",
    "DisplacementSystem.points": "origin and axes of the model that wrote the matrices, as the table's x, y, z",
    "TableShape.x": "length of the body on which the load acts, not of the loaded part",
    "TableShape.y": "width of the plate on which the load acts, not of the loaded part",
    "_Path.points_at": "of a position: length of the beam on which the snubber is",
    "Span.from": "of a position: length of the beam on which the snubber is; of a stiffness factor: stiffness of "
    "snubbers and nonlinear springs in the scenario; else absolute",
    "Span.to": "as `from`",
    "MeasuredShapes.positions": "length of the beam on which the snubber is",
}
RATIOS = {
    "ModalDamping.ratio": "critical damping of each mode of the structure without contact",
    "RatioAtFrequency.ratio": "critical damping of a mode at `frequency`",
    "SnubberRatioDamping.ratio": "critical damping at the first natural frequency Omega with only this snubber closed: "
    "the dashpot is 2 ratio stiffness / Omega; it follows stiffness, position and structure",
    "FrictionCoefficients.sliding": "normal force",
    "FrictionCoefficients.static": "normal force",
    "FrictionBase.coefficient": "normal force",
    "RingFriction.coefficient": "normal force",
    "HarmonicBalance.largest_error": "size of the motion",
    "BeforeAfter.pairing": "lower of the two frequencies",
    "Limits.frequency_shift": "frequency before",
    "Limits.amplitude_shift": "amplitude before",
    "Limits.damping_shift": "damping before",
    "Limits.gapping": "level of the sine at which the linear steady motion first changes contact",
    "GeneratedForces.tolerance": "force at the end of the range",
    "PowerLaw.exponent": "power of the penetration over that of the point",
    "IdentifyStiffness.tolerance": "measured frequency",
    "IdentifyStiffness.uncertainty": "measured frequency",
    "IdentifyStiffness.coverage": "certainty (1)",
    "ParameterUncertainty.uncertainty": "value in the scenario",
    "ParameterToIdentify.prior": "value in the scenario",
    "NonlinearFit.spread": "value in the scenario",
    "MeasuredPeak.scatter": "measured peak",
    "_RecordedTest.noise": "largest harmonic of the test, or sample of a transient",
    "_AnyTest.gain": "true value of the channel",
    "PadData.dynamic": "loss factor: storage stiffness at that frequency",
    "PhaseResonance.span": "resonance frequency",
    "Correlation.coefficient": "rank correlation of what is drawn; 1 is the same order",
    "Tolerances.quantile": "number of realisations, the case itself among them, counted from the good side",
    "_Toleranced.tolerance": "in percent: value in the case (of a position too, not the length); with a unit: absolute",
    "ListedParameter.values": "of a position in percent: length of its body, in each case; else absolute",
    "ScatteredParameter.deviation": "in percent: value in the scenario (also for a position); with a unit: absolute",
    "MeasuredParameter.data": "none: absolute, also of a position",
    "_Ranged.from": "none: absolute, also of a position",
    "_Ranged.to": "none: absolute, also of a position",
    "ParameterToIdentify.bounds": "of a position in percent: length of its body in the scenario; else absolute",
}
FACTORS = {
    "MatricesBody.mass": "`units` of the body",
    "MatricesBody.stiffness": "`units` of the body",
    "MatricesBody.viscous": "`units` of the body",
    "MatricesBody.rows": "degrees of freedom, in the `units` of the body",
    "MeasuredForces.scale": "forces as measured",
    "MeasuredForces.segment_factors": "stiffness of each segment as fitted",
    "Rigidity.nu": "stretch along x",
    "FrameSection.poissons_ratio": "stretch along the load",
    "Member.flexibility_factor": "bending flexibility of a straight pipe",
    "Member.orientation": "none: a direction along the axes of the frame",
    "Plate.poissons_ratio": "stretch along the load",
    "LinearShape.values": "level of the load",
    "PolynomialShape.coefficients": "level of the load; its x and y are shares of the loaded part, from 0 to 1",
    "TableShape.values": "level of the load",
    "RecordPreparation.factor": "values of the file",
    "Run.rtol": "size of the state",
    "OrbitStart.factor": "state at the point of the file",
    "ShockSpectrumSettings.quality": "critical damping of the oscillators: 1 / (2 ratio)",
    "MatchedInput.quality": "critical damping of the oscillators: 1 / (2 ratio)",
    "StressLife.cycles": "none: a number of cycles",
    "StressLife.exponent": "none: an exponent",
    "PlateBody.grading": "none: an exponent",
    "Run.atol": "none: absolute",
    "_DirectedSweep.orders": "excitation frequency",
    "SweptSine.tolerance": "amplitude of the sine",
    "SensitiveParameter.tolerance": "as that of a varied number",
    "SteppedSine.steady_to": "size of the motion",
    "Coexisting.steady_to": "size of the motion",
    "MeasuredShapes.shapes": "any scale, of each shape its own",
    "RelaxedMinimisationMethod.tolerance": "twice the energy of the motion",
}
DEFAULTS = {
    "Scenario.probes": "snubbers: one probe at each, on both places between which it acts; else a free end, "
    "a corner or the last mass; none on imported matrices",
    "BeforeAfter.channels": "all that have the same name in both files",
    "BeforeAfter.within": "all that both records have",
    "ChannelPair.after": "name in the file before",
    "RecordedSweep.begin": "where the record follows the sweep",
    "TestRecord.decimal": "what the numbers of the file show",
    "TestRecord.unit": "what the file states",
    "TestRecord.axis_unit": "what the file states",
    "TestRecord.reference": "none: amplitudes are those of the channel",
    "Scenario.reduction": "excitation and structure: modes up to 50 times the excitation frequency (10 times the "
    "highest of a random one), and at least up to 64 times a low natural frequency",
    "Scenario.units": "units in which most quantities of the file are written",
    "Chain.dashpots": "number of springs, zero each",
    "Named.name": "number in its list: snubber_1",
    "SnubberBase.gap": "zero; with `preload` the gap that gives this force at static equilibrium",
    "HingeStop.side": "`below` for a negative angle, else `above`",
    "HingeFrictionMoments.sliding": "`moment`",
    "FrictionCoefficients.stribeck_speed": "none: the coefficient falls at once",
    "RingStop.largest_penetration": "5 % of the gap, of an ellipse of its smaller semi-axis",
    "RingStop.sides": "`10.7 sqrt(gap / largest_penetration)`, at least 24; of an ellipse with the largest radius of "
    "curvature",
    "SnubberBase.law": "`no_tension` with Maxwell branches, else `kelvin_voigt`",
    "PointOfBody.direction": "z",
    "MeasuredForces.fit": "points as they are",
    "GeneralFrameSection.extreme_fibre_y": "`extreme_fibre`",
    "GeneralFrameSection.shear_area_y": "infinite: no shear deformation",
    "GeneralFrameSection.shear_area_z": "infinite: no shear deformation",
    "Member.arc": "straight",
    "Member.elements": "`elements` of the frame",
    "Rigidity.dxy": "sqrt(dx dy) (1 - nu sqrt(dy / dx)) / 2",
    "DrivenInput.quantity": "unit of the level; of a bare number what `applied_to` takes",
    "DrivenInput.direction": "z, or what the imported matrices say",
    "DrivenInput.about": "left end of a beam, lower left corner of a plate, origin of imported matrices",
    "MovedSupport.direction": "z",
    "Step.duration": "no end",
    "Step.rise": "a step at once",
    "Trapezoid.rise": "a tenth of `duration`",
    "Trapezoid.fall": "a tenth of `duration`",
    "_LevelAt.quantity": "unit of the level",
    "SampledInput.time_column": "the last column before the values that is headed as a time",
    "SampledInput.decimal": "what the numbers of the file show",
    "MeasuredForces.decimal": "what the numbers of the file show",
    "PadData.decimal": "what the numbers of the file show",
    "MeasuredParameter.decimal": "what the numbers of the file show",
    "SweepTest.decimal": "what the numbers of the file show",
    "_RecordedTest.decimal": "what the numbers of the file show",
    "SampledInput.unit": "what the file states",
    "SampledInput.angular_unit": "what the file states",
    "SampledInput.time_unit": "what the file states",
    "RandomInput.amplitudes": "`fixed`; `random` in a study over seeds",
    "RandomInput.clip": "root mean square of the noise before it is clipped",
    "RandomInput.period": "`run.duration`",
    "RandomInput.sample_rate": "20 times the highest frequency",
    "BendingOutput.component": "x",
    "BendingOutput.surface": "top",
    "ReactionOutput.direction": "z of a force, ry of a moment",
    "ReactionOutput.about": "origin of the coordinates of the body",
    "Run.test_duration": "`run.duration`",
    "Run.sample_rate": "100 samples a period of the excitation, more where structure or a short run needs it",
    "Run.convergence": "on; in a study for the cases that decide",
    "Run.most_contact_states": "`run.memory`",
    "SpectrumSettings.last": "`run.duration`",
    "SpectrumSettings.window": "excitation: decaying for shocks and motions that die away, else hann",
    "SpectrumSettings.to": "highest frequency of the modes kept and of the excitation",
    "_DirectedSweep.levels": "level of the excitation",
    "_DirectedSweep.convergence": "on; in a study for the cases that decide",
    "Continuation.levels": "level of the excitation",
    "MatricesBody.units": "SI",
    "StructuralDamping.file": "imaginary part of the stiffness matrix",
    "_AnyTest.name": "its file",
    "_RecordedTest.channel": "channel named after the probe",
    "_AnyTest.probe": "first probe",
    "_RecordedTest.unit": "what the file states",
    "_RecordedTest.axis_unit": "what the file states",
    "SteadyTest.last": "whole signal",
    "MeasuredPeak.probe": "probe of the test",
    "TransientTest.excitation": "excitation of the scenario",
    "TransientTest.start": "start of the run, or static equilibrium",
    "TransientTest.duration": "all that follows",
    "PadData.ramp": "zero",
    "PadData.branches": "measurements: as few as fit nearly as well as any number",
    "PhaseResonance.levels": "level of the excitation",
    "_Study.responses": "all that the analysis computes",
    "Reliability.method": "`importance_sampling`; with random inputs `subset`, with a matched record `monte_carlo`",
    "Reliability.coefficient_of_variation": "10 %, of a subset simulation 30 %; of the probability",
    "Tolerances.worst_cases": "50 for each number with a tolerance",
    "Optimise.responses": "the objectives and what limits are compared with",
    "Optimise.minimise": "the smallest margin of the limits, which is to be large",
    "Optimise.maximise": "none with `minimise`",
    "DisplayUnits.acceleration": "unit in which most accelerations are written",
    "DisplayUnits.length": "unit in which most lengths are written",
    "DisplayUnits.angle": "unit in which most angles are written",
    "DisplayUnits.time": "unit in which long times are written",
}
CHAPTERS = {
    "Shares of a length": ("share of", SHARES),
    "Ratios and percentages": ("relative to", RATIOS),
    "Factors and other numbers without a unit": ("relative to", FACTORS),
    "Defaults that follow": ("by default", DEFAULTS),
}
_NO_VALUE = "none|nothing|no wear|0|off|all edges are free|clamped and free|rigid|unknown|sudden"
ABSOLUTE = re.compile(
    rf"({_NO_VALUE})\b[^.;]* by default|by default (none|off|they are independent|0\b|1\b)|[Nn]ot computed by default"
)
"""Defaults that are no values: they follow from nothing."""


def relative_fields() -> dict[str, str]:
    """Every relative key of a scenario by the class that defines it, and the path at which it comes first."""
    found: dict[str, str] = {}
    for section, path in _sections():
        described = descriptions(section)
        for key, name in section.keys().items():
            base = next(each for each in reversed(section.__mro__) if name in getattr(each, "model_fields", {}))
            field = section.model_fields[name]
            derived = name.endswith("_") and hasattr(section, key) and field.default in (None, ())
            text = " ".join(described.get(name, "").split())
            has_default = "default" in text and not ABSOLUTE.search(text)
            follows = has_default and field.get_default(call_default_factory=True) in (None, (), "")
            if any(map(_is_relative, _types(field))) or derived or follows:
                found.setdefault(f"{base.__name__}.{key}", ".".join(filter(None, (path, key))))
    return found


def _is_relative(of: FieldType) -> bool:
    without_unit = isinstance(of, Quantity) and not of.dimension.unit
    return without_unit or isinstance(of, PositionType | NumberOrText)


def _types(field: Any) -> Iterator[FieldType]:
    """What reads a field, but for that of the sections in it."""
    yield from (item for item in field.metadata if isinstance(item, FieldType))
    yield from _within(field.annotation)


def _within(annotation: Any) -> Iterator[FieldType]:
    if isinstance(annotation, type) and issubclass(annotation, Schema):
        return
    yield from (item for item in getattr(annotation, "__metadata__", ()) if isinstance(item, FieldType))
    for inner in get_args(annotation):
        yield from _within(inner)


def _sections() -> Iterator[tuple[type[Schema], str]]:
    """Every section and the path at which it comes first, outer ones first."""
    queue: list[tuple[type[Schema], str]] = [(Scenario, "")]
    seen = {Scenario}
    for section, path in queue:
        yield section, path
        for key, name in section.keys().items():
            for inner, suffix in _inner(section.model_fields[name].annotation, ""):
                if inner not in seen:
                    seen.add(inner)
                    queue.append((inner, ".".join(filter(None, (path, key + suffix)))))


def _inner(annotation: Any, suffix: str) -> Iterator[tuple[Any, str]]:
    if isinstance(annotation, type) and issubclass(annotation, Schema):
        yield annotation, suffix
        return
    origin = getattr(annotation, "__origin__", None)
    below = suffix + {tuple: "[]", dict: ".<name>"}.get(origin, "")
    for inner in get_args(annotation):
        yield from _inner(inner, below)


def page() -> str:
    """Return the page as MyST Markdown."""
    paths = relative_fields()
    text = _INTRODUCTION
    for title, (column, references) in CHAPTERS.items():
        rows = "".join(f"| `{paths[name]}` | {of} |\n" for name, of in references.items())
        text += f"## {title}\n\n| key, where it comes first | {column} |\n|---|---|\n{rows}\n"
    return text


if __name__ == "__main__":
    PAGE.write_text(page().rstrip() + "\n", encoding="utf-8")
