"""Contents of results: outputs in addition to the motion of probes, and limits."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, Literal

from beamsim.scenario import quantities as q
from beamsim.scenario import units
from beamsim.scenario.base import BY_FORM, InvalidValueError, Path, Problems, Schema, Variants, Whole, problem, unknown
from beamsim.scenario.body import Body, MovedSupport, PlacedItem, body_problems
from beamsim.scenario.connections import HingeStop, base_problems
from beamsim.scenario.excitation import (
    About,
    AtLeastTwo,
    ShockCurve,
    check_limit_curve,
    sine_problems,
)
from beamsim.scenario.files import SHORT_FOR_FILE, CurveFile

INPUT = "input"  # name of the excitation among the signals of spectra and statistics
SHIFTS = ("frequency_shift", "amplitude_shift", "damping_shift")  # limits on resonances before and after
SWEPT_KINDS = ("swept_sine", "stepped")  # sweeps that give a response over frequency


def named_body(scenario: Whole, output: Any) -> tuple[str, Body | None]:
    """Name of the body of an output, and the body; None if there is no such body."""
    name = (output.place if isinstance(output, PlacedItem) else output).body or scenario.default_body
    return name, scenario.all_bodies.get(name)


class Output(Schema):
    """Common part of all outputs."""

    name: q.Name
    """Unique name, also different from the probes; the result file uses it."""


class MotionOutput(Output, PlacedItem):
    """Motion of a point."""

    kind: Literal["displacement", "velocity", "acceleration", "rotation"]
    """displacement or velocity relative to the base, absolute acceleration, or rotation: the slope dw/dx of a beam."""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """A problem: a slope at points that only deflect."""
        yield from super().problems(scenario, path)
        _, body = named_body(scenario, self)
        if self.kind == "rotation" and body is not None and not body.has_slope:
            message = f"requests a slope, but the points of a {body.body_kind} have none"
            yield problem(path, message, "name a point of a beam")


class BendingOutput(Output, PlacedItem):
    """Bending moment, stress or strain of a beam or plate at a point."""

    kind: Literal["bending_moment", "stress", "strain"]
    """bending_moment: E I w'' of a beam, positive for compression at the top, or the moment per width of a plate;
    stress or strain at a surface, positive in tension; the strain xy of a plate is the shear angle."""
    component: Literal["x", "y", "xy"] | None = None
    """Component on a plate, x by default; a beam has only one."""
    surface: Literal["top", "bottom"] | None = None
    """Surface of a stress or strain, top by default."""

    def check(self) -> None:
        """Refuse a surface for a moment."""
        super().check()
        if self.kind == "bending_moment" and self.surface is not None:
            raise InvalidValueError("belongs to a stress or strain", "leave it out", ("surface",))

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems: a body that does not bend, a component of a beam, an unknown distance of the fibre."""
        yield from super().problems(scenario, path)
        name, body = named_body(scenario, self)
        if body is None:
            return
        if body.body_kind not in ("beam", "plate"):
            message = f"asks for a {self.kind.replace('_', ' ')}, but {name} is of the kind {body.body_kind}"
            remedy = "name a point of a beam or plate"
            if body.body_kind == "frame":
                remedy = "give recovered: {foot: {member: leg, position: 0, quantity: stress}}, and kind: recovered"
            yield problem(path, message, remedy)
        elif self.component is not None and body.body_kind == "beam":
            yield problem((*path, "component"), f"belongs to a plate, but {name} is a beam", "leave it out")
        elif self.kind == "strain" and body.gives_strain:
            return
        elif self.kind == "strain" and body.body_kind == "plate":
            yield problem(
                path, f"needs the thickness of {name}, which does not follow from its stiffnesses", "give its thickness"
            )
        elif self.kind != "bending_moment" and not body.gives_stress:
            yield problem(
                path, f"needs the outermost fibre of {name}, which does not follow from its bending stiffness",
                "give a section, or use kind: bending_moment",
            )  # fmt: skip


class ReactionOutput(Output):
    """Force or moment of a support on the structure."""

    kind: Literal["reaction_force", "reaction_moment"]
    """reaction_force, positive upwards, or reaction_moment, positive as the slope dw/dx (dw/dy at the bottom and top of
    a plate)."""
    support: q.Name
    """The support: left or right end of a beam; left, right, bottom, top or point 1 of a plate; left or right wall of a
    chain, or its spring to the ground; node 15 of imported matrices; base for the total force of the base."""
    body: q.Name | None = None
    """The body with this support; may be omitted if there is only one."""
    direction: Literal["x", "y", "z", "rx", "ry", "rz"] | None = None
    """Direction at a node of imported matrices, or of the base; by default z for a force and ry for a moment."""
    about: About | None = None
    """For a moment of the base, a point on its axis, m: a position along a beam, [x, y] on a plate, [x, y, z] of
    imported matrices; by default their origin."""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems of the base or the support; the supports of a body are known only to its model."""
        of_base, is_moment = self.support == "base", self.kind == "reaction_moment"
        if not of_base:
            yield from body_problems(scenario, path, self.body, "add body: BODY")
        if self.about is not None and not (of_base and is_moment):
            yield problem((*path, "about"), "belongs to the moment of the base", "leave it out")
        if of_base and self.body is not None:
            yield problem((*path, "body"), "is valid for a support only; the base supports all bodies", "leave it out")
        elif of_base and (is_moment or self.direction is not None):
            direction = self.direction or ("ry" if is_moment else "z")
            yield from base_problems(scenario, (*path, "direction"), direction, f"= {direction}")
        if self.direction is not None and (len(self.direction) == 2) != is_moment:
            yield problem((*path, "direction"), f"= {self.direction} is none of a {self.kind.replace('_', ' ')}",
                           "forces have x, y and z, moments rx, ry and rz")  # fmt: skip


class JointOutput(Output):
    """Force or moment that a joint, or a linear spring between points of bodies, transmits."""

    kind: Literal["joint_force", "joint_moment"]
    """joint_force, positive upwards, or joint_moment, positive as the slope, on the second of the two points; for a
    joint to the base, on the point."""
    joint: q.Name
    """Name of the joint or spring."""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """A problem if the joint does not exist."""
        yield from unknown((*path, "joint"), self.joint, "joint", (joint.name for joint in scenario.joined_by))


class RecoveredOutput(Output):
    """A quantity given by a row of the recovery matrix of a body."""

    kind: Literal["recovered"]
    """The product of the row with the motion of the degrees of freedom."""
    row: q.Name
    """Name of the row of the recovery matrix, or of what a frame recovers."""
    body: q.Name | None = None
    """The body; may be omitted if there is only one."""
    motion: Literal["displacement", "velocity", "acceleration"] = "displacement"
    """Motion that the row multiplies: displacement or velocity relative to the base (as for stress), or absolute
    acceleration."""
    unit: q.Text = "1"
    """Unit of the result, for tables and files: Pa if the matrix gives stress in Pa."""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems: an unknown body, or one without this row in a recovery matrix."""
        yield from body_problems(scenario, path, self.body, "add body: BODY")
        name, body = named_body(scenario, self)
        if body is not None and not body.recovered_rows:
            yield problem(
                path, f"needs a recovery matrix, which {name} lacks",
                "give recovery: {file: panel.op4, name: stress, rows: [skin]} of imported matrices",
            )  # fmt: skip
        elif body is not None:
            yield from unknown((*path, "row"), self.row, "row of the recovery matrix", body.recovered_rows)


class EnergyOutput(Output):
    """Energy of a body."""

    kind: Literal["kinetic_energy", "strain_energy"]
    """Kinetic energy of the motion relative to the base, or strain energy."""
    body: q.Name | None = None
    """The body; may be omitted if there is only one."""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """A problem if the body does not exist."""
        yield from body_problems(scenario, path, self.body, "add body: BODY")


AnyOutput = Annotated[
    MotionOutput | BendingOutput | ReactionOutput | JointOutput | RecoveredOutput | EnergyOutput,
    Variants(
        "is no output",
        "give it a name and a kind: displacement, velocity, acceleration, rotation, bending_moment, stress, strain, "
        "reaction_force, reaction_moment, joint_force, joint_moment, recovered, kinetic_energy, strain_energy",
    ),
]


_STRESS = replace(units.PRESSURE, name="stress", example="80 MPa")
_ACCELERATION = replace(units.ACCELERATION, example="20 g")

Stress = Annotated[float, q.Quantity(_STRESS, above=0.0)]
PositiveRatio = Annotated[float, q.Quantity(replace(units.RATIO, example="80 %"), above=0.0)]

_MOMENT_PER_WIDTH = replace(units.FORCE, name="moment per width", unit="N m/m", example="12 N m/m")
_OUTPUT_DIMENSIONS = {
    "displacement": replace(units.LENGTH, example="2 mm"), "velocity": units.VELOCITY, "acceleration": _ACCELERATION,
    "rotation": units.ANGLE, "bending_moment": units.MOMENT, "stress": _STRESS,
    "strain": replace(units.RATIO, name="strain", example="0.1 %"), "reaction_force": units.FORCE,
    "reaction_moment": units.MOMENT, "joint_force": units.FORCE, "joint_moment": units.MOMENT,
    "kinetic_energy": units.ENERGY, "strain_energy": units.ENERGY,
}  # fmt: skip
"""Dimension of each kind of output."""


_ENERGIES_AND_FORCES = {"N m": "J", "N m/m": "N"}
"""Units of energies for units of moments, and units of forces for moments per width."""

OutputLimit = Annotated[
    float,
    q.LevelType(
        tuple((_ENERGIES_AND_FORCES.get(of.unit, of.unit), of) for of in dict.fromkeys(_OUTPUT_DIMENSIONS.values())),
        "200 N", ("200 N", "80 MPa"), above=0.0,
    ),
]  # fmt: skip
"""A limit on an output in any unit of an output; it stores its SI unit."""


ForceLimit = Annotated[q.PositiveForce | dict[q.Name, q.PositiveForce], BY_FORM]
MomentLimit = Annotated[q.PositiveMoment | dict[q.Name, q.PositiveMoment], BY_FORM]
LengthLimit = Annotated[q.Length | dict[q.Name, q.Length], BY_FORM]
AccelerationLimit = Annotated[q.PositiveAcceleration | dict[q.Name, q.PositiveAcceleration], BY_FORM]
RatioLimit = Annotated[PositiveRatio | dict[q.Name, PositiveRatio], BY_FORM]
LIMITED_DENSITIES = {each.name: each for each in (units.ACCELERATION_PSD, units.FORCE_PSD, units.MOMENT_PSD)}
PositiveDensity = Annotated[
    float, q.LevelType(tuple(LIMITED_DENSITIES.items()), "0.01 g^2/Hz", ("0.01 g^2/Hz", "0.1 N^2/Hz"), above=0.0)
]
DensityCurve = Annotated[
    Annotated[tuple[tuple[q.Frequency, PositiveDensity], ...], AtLeastTwo] | CurveFile, BY_FORM, SHORT_FOR_FILE
]
LIMITED_RESPONSES = {each.name: each for each in (units.ACCELERATION, units.LENGTH, units.FORCE, units.MOMENT)}
PositiveResponse = Annotated[
    float, q.LevelType(tuple(LIMITED_RESPONSES.items()), "20 g", ("20 g", "0.5 mm", "50 N"), above=0.0)
]
ResponseCurve = Annotated[
    Annotated[tuple[tuple[q.Frequency, PositiveResponse], ...], AtLeastTwo] | CurveFile, BY_FORM, SHORT_FOR_FILE
]


class Limits(Schema):
    """Limits: the summary shows margins and verdicts; `--check` exits with code 4 if a limit is exceeded, 3 if unsure.

    A limit is one value for all places, or one for each name: {tip: 20 g, root: 5 g}.
    """

    peak_force: ForceLimit | None = None
    """Largest contact force of any snubber, or by snubber."""
    peak_ring_force: ForceLimit | None = None
    """Largest force of any ring, or by ring."""
    peak_moment: MomentLimit | None = None
    """Largest contact moment of any stop of a hinge, or by stop."""
    bending_stress: Stress | None = None
    """Largest bending stress anywhere."""
    peak_displacement: LengthLimit | None = None
    """Largest displacement of any probe relative to the base, or by probe."""
    peak_acceleration: AccelerationLimit | None = None
    """Largest absolute acceleration of any probe, or by probe."""
    gap: LengthLimit | None = None
    """Largest opening between the structure and any snubber (lift-off), or by snubber."""
    gapping: RatioLimit | None = None
    """Largest ratio of the level of a sine to the level at which the linear motion first changes a contact, for any
    snubber or by snubber: 80 % allows levels of a run or sweep up to 80 % of that level."""
    rms_displacement: LengthLimit | None = None
    """Root mean square of any probe's displacement, or by probe; computed over the time range of the spectra, or for a
    stationary input without the first tenth of the run."""
    rms_acceleration: AccelerationLimit | None = None
    """Root mean square of any probe's absolute acceleration, or by probe; over the same time as rms_displacement."""
    rms_force: ForceLimit | None = None
    """Root mean square of any snubber's force, or by snubber, in a run with a stationary input."""
    frequency_shift: RatioLimit | None = None
    """Largest shift of the frequency of any resonance in before_after, relative to the one before, or by channel; 5 %
    by default."""
    amplitude_shift: RatioLimit | None = None
    """Largest change of the amplitude of any such resonance, or by channel; 20 % by default."""
    damping_shift: RatioLimit | None = None
    """Largest change of the damping of any such resonance, or by channel; no limit by default."""
    outputs: dict[q.Name, OutputLimit] | None = None
    """Largest magnitude of each output, by name: {clamp: 200 N, gauge: 0.1 %}; a plain number is in its SI unit."""

    srs: dict[q.Name, ShockCurve] | None = None
    """For each probe, input or moving support (support left) a curve that its maximax shock response spectrum (run.srs)
    must not exceed: pairs of frequency and acceleration, [[100 Hz, 20 g], [1 kHz, 90 g]], or a CSV file; log-log
    interpolation between the points. In all curves two points at one frequency make a step; the lower value applies
    there. """
    psd: dict[q.Name, DensityCurve] | None = None
    """For each probe, input or snubber a curve that the spectral density of its response to a stationary input must not
    exceed: pairs of frequency and density, [[20 Hz, 0.01 g^2/Hz], [200 Hz, 0.1 g^2/Hz]], or a CSV file. The density of
    a snubber's force is in N^2/Hz, that of the moment of a hinge stop in N^2 m^2/Hz. """
    response: dict[q.Name, ResponseCurve] | None = None
    """For each probe or snubber a curve over the excitation frequency that its largest magnitude in a cycle of a sweep
    must not exceed: pairs of frequency and acceleration, displacement, force or moment, [[20 Hz, 5 g], [400 Hz, 20 g]],
    or a CSV file. """

    curves: ClassVar[Mapping[str, Mapping[str, units.Dimension]]] = {
        "srs": {units.ACCELERATION.name: units.ACCELERATION}, "psd": LIMITED_DENSITIES, "response": LIMITED_RESPONSES,
    }  # fmt: skip
    """Keys of limits that are curves, with their quantities, the default first."""
    unit_attributes: ClassVar[Mapping[str, str]] = {"psd": "psd_with_units", "response": "response_with_units"}

    def check(self) -> None:
        """Refuse a section without limits, and invalid curves."""
        if not self.values_by_name:
            raise InvalidValueError(
                "limit nothing", "give for example limits: {peak_force: 50 N, bending_stress: 80 MPa}"
            )
        for name, place, points in self.given_curves():
            check_limit_curve(points, (name, place))

    def _with_units(self, name: str) -> dict[str, Any] | None:
        """Curves of several possible quantities, with units that show the quantity; None if there are none."""
        if not (curves := getattr(self, name)):
            return None
        written: dict[str, Any] = {}
        for place, points in curves.items():
            if isinstance(points, CurveFile):
                written[place] = points.model_dump(exclude_none=True)
                continue
            units_of = [(f, x, self.curves[name].get(q.meant(x) or "")) for f, x in points]
            written[place] = [[f, float(x) if of is None else f"{float(x)!r} {of.unit}"] for f, x, of in units_of]
        return written

    @property
    def psd_with_units(self) -> dict[str, Any] | None:
        """Curves of densities with their units."""
        return self._with_units("psd")

    @property
    def response_with_units(self) -> dict[str, Any] | None:
        """Curves of responses with their units."""
        return self._with_units("response")

    def given_curves(self) -> Iterator[tuple[str, str, Any]]:
        """Yield the name of the limit, the place, and the points or file of each curve."""
        for name in self.curves:
            yield from ((name, place, points) for place, points in (getattr(self, name) or {}).items())

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems: limits on quantities that this structure or analysis does not have."""
        of_records = scenario.before_after is not None
        given = [name for name in type(self).model_fields if getattr(self, name)]
        unsuitable = [name for name in given if (name in SHIFTS) != of_records]
        if unsuitable:
            what, remedy = (
                ("a motion, but test data are compared", f"give {', '.join(SHIFTS)}")
                if of_records
                else ("resonances before and after, which are in before_after", "leave it out")
            )
            yield from (problem((*path, name), f"limits {what}", remedy) for name in unsuitable)
            return
        stationary = scenario.excitation.stationary
        if self.bending_stress is not None:
            yield from stress_problems(scenario, (*path, "bending_stress"))
        for name in ("rms_displacement", "rms_acceleration"):
            if getattr(self, name) is not None and not stationary and scenario.run is None:
                yield problem((*path, name), "needs a run", "limit peaks, or add run: {duration: 1 s}")
        if self.rms_force is not None and not stationary:
            message = f"needs a stationary input, and the excitation is {scenario.excitation.kind}"
            yield problem((*path, "rms_force"), message, "limit peak_force")
        if self.gapping is not None:
            sine = scenario.excitation.kind != "none" and not any(sine_problems(scenario.excitation, "sweep"))
            if not sine or getattr(scenario.sweep, "kind", "stepped") not in SWEPT_KINDS:
                needed = "needs a run or a sweep of a harmonic excitation"
                yield problem((*path, "gapping"), needed, "limit gap instead")
        yield from self._problems_of_curves(scenario, path)
        yield from self._problems_of_places(scenario, path)
        yield from self._problems_of_outputs(scenario, (*path, "outputs"))

    def _problems_of_places(self, scenario: Whole, path: Path) -> Problems:
        """Problems of unknown places."""
        for name in type(self).model_fields:
            of_place = getattr(self, name)
            if of_place is None or name in ("outputs", *SHIFTS, *self.curves):
                continue
            moment, both, ring = name.endswith("moment"), name == "gapping", name == "peak_ring_force"
            snubbers = moment or name.endswith(("force", "gap", "gapping"))
            stops: Sequence[Any] = scenario.rings
            if not ring:
                stops = [stop for stop in scenario.all_snubbers if both or isinstance(stop, HingeStop) == moment]
            if snubbers and not stops:
                what, remedy = ("stops of hinges", "stops to a hinge") if moment else ("snubbers", "a snubber")
                what, remedy = ("rings", "a snubber with kind: ring") if ring else (what, remedy)
                message = f"limits the {what}, and there are none"
                yield problem((*path, name), message, f"add {remedy}, or leave it out")
            elif isinstance(of_place, dict):
                known = [each.name for each in (stops if snubbers else scenario.effective_probes)]
                for place in of_place:
                    yield from unknown((*path, name, place), place, "snubber" if snubbers else "probe", known)

    def _problems_of_outputs(self, scenario: Whole, path: Path) -> Problems:
        """Problems of unknown outputs, and of limits in a wrong unit."""
        outputs = {output.name: output for _, output in scenario.requested_outputs}
        for name, limit in (self.outputs or {}).items():
            yield from unknown((*path, name), name, "output", outputs, "list it in outputs")
            if name in outputs:
                dimension = output_dimension(outputs[name], scenario.all_bodies, scenario.default_body)
                kind = outputs[name].kind.replace("_", " ")
                yield from unit_problems((*path, name), limit, dimension, f"and the output is a {kind}")

    def _problems_of_curves(self, scenario: Whole, path: Path) -> Problems:
        """Problems of curves for spectra that are not computed, and of unknown places."""
        for name, place, points in self.given_curves():
            item_path = (*path, name, place)
            needed, remedy = _missing_for_curve(scenario, name)
            stated = None if name == "srs" or isinstance(points, CurveFile) else q.meant(points[0][1])
            if needed:
                yield problem(item_path, f"needs {needed}", remedy)
            elif name != "srs" and not isinstance(points, CurveFile):
                other = [k for k, (_, level) in enumerate(points) if q.meant(level) != stated]
                if other:
                    yield problem(
                        (*item_path, other[0], 1), "is of another quantity than the first", "give all in one unit"
                    )
            snubbers, forces = [each.name for each in scenario.all_snubbers], not needed and stated in _FORCES
            places = [each.name for each in scenario.effective_probes]
            places += scenario.input_names if name in ("srs", "psd") else []
            if name == "srs":
                moved = (each.applied_to for _, each in scenario.excitation.items)
                places += [path.label for path in moved if isinstance(path, MovedSupport) and not path.rotates]
            elif isinstance(points, CurveFile):
                places += snubbers
            yield from unknown(item_path, place, "place", snubbers if forces else places)

    @property
    def values_by_name(self) -> dict[str, float]:
        """All limits in SI units, by name: the name of the value, with the place after a point if there is one.

        A curve counts as a limit of 1 on the ratio to it.
        """
        given: dict[str, float] = {}
        for name in type(self).model_fields:
            held = getattr(self, name)
            if isinstance(held, dict):
                of_curve = name in self.curves
                given |= {f"{name}.{place}": 1.0 if of_curve else float(limit) for place, limit in held.items()}
            elif held is not None:
                given[name] = held
        return given


_FORCES = {each.name for each in (units.FORCE_PSD, units.MOMENT_PSD, units.FORCE, units.MOMENT)}


def _missing_for_curve(scenario: Whole, name: str) -> tuple[str, str]:
    """Input that a limit curve still needs, and a remedy; empty if nothing is missing."""
    run = scenario.run
    if name == "srs":
        there = run is not None and run.srs is not None
        needed, remedy = "shock response spectra", "add run.srs: {from: 10 Hz, to: 2 kHz}"
    elif name == "psd":
        there = run is not None and scenario.excitation.stationary
        needed = "a run with a stationary input"
        remedy = "limit peaks or srs, or give random noise or a record with stationary: true"
    else:
        there = getattr(scenario.sweep, "kind", "") in SWEPT_KINDS
        needed = "a sweep in frequency"
        remedy = "limit peaks, or add sweep: {kind: swept_sine, ...} or {kind: stepped, ...}"
    return ("", "") if there else (needed, remedy)


def stress_problems(scenario: Whole, path: Path) -> Problems:
    """A problem of an item that needs a stress if no body has one."""
    if not any(body.gives_stress for body in scenario.all_bodies.values()):
        remedy = "leave it out, or give a beam's extreme_fibre and youngs_modulus"
        yield problem(path, "needs a body whose stress is known", remedy)


def unit_problems(path: Path, limit: float, dimension: units.Dimension | None, quantity_text: str) -> Problems:
    """A problem if the unit of a limit does not fit.

    Parameters
    ----------
    path : path of the limit.
    limit : its value, which stores its unit.
    dimension : of the limited quantity; None for rows of recovery matrices, which have their own units.
    quantity_text : name of the limited quantity, for the message.

    Yields
    ------
    Problem
    """
    stated = q.meant(limit)
    if dimension is None and stated is not None:
        yield problem(path, "has a unit, but the output has its own unit", "give a plain number in that unit")
    elif dimension is not None and stated not in (None, _ENERGIES_AND_FORCES.get(dimension.unit, dimension.unit)):
        yield problem(path, f"is in {stated or 'no unit'}, {quantity_text}", f"write {dimension.example}")


def output_dimension(output: Any, bodies: Mapping[str, Body], default_body: str) -> units.Dimension | None:
    """The dimension of an output on one of the bodies.

    Parameters
    ----------
    output : its section.
    bodies : by name.
    default_body : name of the body of places that name none.

    Returns
    -------
    Dimension or None
        None for rows of recovery matrices, which have their own units.
    """
    if output.kind == "bending_moment":
        body = bodies.get(output.place.body or default_body)
        return _MOMENT_PER_WIDTH if body is not None and body.body_kind == "plate" else units.MOMENT
    return _OUTPUT_DIMENSIONS.get(output.kind)


BASE_FORCE = ReactionOutput.model_construct(
    name="base_force", kind="reaction_force", support="base", body=None, direction=None, about=None
)
"""The output that a limit on the base's force uses if the scenario has no such output."""
QUANTITIES_OF = {
    "probes": {"acceleration": units.ACCELERATION, "displacement": units.LENGTH},
    "snubbers": {"force": units.FORCE},
}


@dataclass(frozen=True)
class LimitedQuantity:
    """The quantity to which a limit applies."""

    section: str  # probes, snubbers or outputs
    item: str
    quantity: str  # acceleration, displacement or force; empty of an output


def limited_quantity(name: str, base_force: str = BASE_FORCE.name) -> LimitedQuantity | None:
    """The quantity that a name stands for, or None; ``base_force`` is the name of the base force output.

    >>> limited_quantity("probes.tip.acceleration")
    LimitedQuantity(section='probes', item='tip', quantity='acceleration')
    """
    if name == "base.force":
        return LimitedQuantity("outputs", base_force, "")
    section, _, rest = name.partition(".")
    if section == "outputs" and rest:
        return LimitedQuantity(section, rest, "")
    item, _, quantity = rest.rpartition(".")
    return LimitedQuantity(section, item, quantity) if item and quantity in QUANTITIES_OF.get(section, ()) else None
