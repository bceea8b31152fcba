"""What results report: outputs in addition to the motion of probes, and limits."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, Literal

from beamsim.scenario import quantities as q
from beamsim.scenario import units
from beamsim.scenario.base import BY_FORM, InvalidValueError, Path, Problems, Schema, Variants, Whole, problem, unknown
from beamsim.scenario.body import Body, MovedSupport, Sited, body_problems
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
SWEPT = ("swept_sine", "stepped")  # sweeps that give a response over frequency


def named_body(scenario: Whole, output: Any) -> tuple[str, Body | None]:
    """The body of an output and its name; None where there is none of that name."""
    name = (output.place if isinstance(output, Sited) else output).body or scenario.default_body
    return name, scenario.all_bodies.get(name)


class Output(Schema):
    """Common part of all outputs."""

    name: q.Name
    """Name, unique also among the probes; it names the output in the result file."""


class MotionOutput(Output, Sited):
    """Motion of a point."""

    kind: Literal["displacement", "velocity", "acceleration", "rotation"]
    """Displacement or velocity relative to the base, absolute acceleration, or the slope dw/dx of a beam."""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """A slope of points that only deflect."""
        yield from super().problems(scenario, path)
        _, body = named_body(scenario, self)
        if self.kind == "rotation" and body is not None and not body.has_slope:
            message = f"asks for a slope, but the points of a {body.body_kind} have none"
            yield problem(path, message, "name a point of a beam")


class BendingOutput(Output, Sited):
    """Bending moment of a beam or plate at a point."""

    kind: Literal["bending_moment", "stress", "strain"]
    """E I w'' of a beam, positive where its top is in compression, or the moment per width of a plate; bending stress
    or strain at a surface, positive in tension; the strain xy of a plate is the shear angle."""
    component: Literal["x", "y", "xy"] | None = None
    """On a plate which of the three: x by default; a beam has one."""
    surface: Literal["top", "bottom"] | None = None
    """Of a stress or strain which surface, top by default."""

    def check(self) -> None:
        """A moment has no surface."""
        super().check()
        if self.kind == "bending_moment" and self.surface is not None:
            raise InvalidValueError("belongs to a stress or strain", "leave it out", ("surface",))

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """A body that does not bend, a component of a beam, and an unknown distance of the fibre."""
        yield from super().problems(scenario, path)
        name, body = named_body(scenario, self)
        if body is None:
            return
        if body.body_kind not in ("beam", "plate"):
            message = f"asks for a {self.kind.replace('_', ' ')}, but {name} is of the kind {body.body_kind}"
            yield problem(path, message, "name a point of a beam or plate")
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
                "give a section, or ask for kind: bending_moment",
            )  # fmt: skip


class ReactionOutput(Output):
    """Force or moment that a support exerts on the structure."""

    kind: Literal["reaction_force", "reaction_moment"]
    """Force, positive upwards, or moment, positive as the slope dw/dx, at the bottom and top of a plate dw/dy."""
    support: q.Name
    """The support: left or right end of a beam; left, right, bottom, top or point 1 of a plate; left or right wall of a
    chain, or its spring to the ground; node 15 of imported matrices; base, for all that the base exerts together."""
    body: q.Name | None = None
    """The body that the support holds; may be left out where there is only one."""
    direction: Literal["x", "y", "z", "rx", "ry", "rz"] | None = None
    """At a node of imported matrices, or of the base; z of a force and ry of a moment by default."""
    about: About | None = None
    """Of the moment of the base, a point on its axis, m: a position along a beam, [x, y] of a plate, [x, y, z] of
    imported matrices; their origin by default."""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems of the base or a support; only the model of a body knows its supports."""
        of_base, is_moment = self.support == "base", self.kind == "reaction_moment"
        if not of_base:
            yield from body_problems(scenario, path, self.body, "add body: BODY")
        if self.about is not None and not (of_base and is_moment):
            yield problem((*path, "about"), "belongs to the moment of the base", "leave it out")
        if of_base and self.body is not None:
            yield problem((*path, "body"), "belongs to a support; the base holds all bodies", "leave it out")
        elif of_base and (is_moment or self.direction is not None):
            direction = self.direction or ("ry" if is_moment else "z")
            yield from base_problems(scenario, (*path, "direction"), direction, f"= {direction}")
        if self.direction is not None and (len(self.direction) == 2) != is_moment:
            yield problem((*path, "direction"), f"= {self.direction} is none of a {self.kind.replace('_', ' ')}",
                           "forces have x, y and z, moments rx, ry and rz")  # fmt: skip


class JointOutput(Output):
    """Force that a joint, or a linear spring between points of bodies, transmits."""

    kind: Literal["joint_force", "joint_moment"]
    """Force, positive upwards, or moment, positive as the slope, on the second of the two points; of the base and a
    point on that point."""
    joint: q.Name
    """Name of the joint or spring."""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """A joint that there is not."""
        yield from unknown((*path, "joint"), self.joint, "joint", (joint.name for joint in scenario.joined_by))


class RecoveredOutput(Output):
    """A row of the recovery matrix of a body."""

    kind: Literal["recovered"]
    """The product of a row with the motion of the degrees of freedom."""
    row: q.Name
    """Name of the row."""
    body: q.Name | None = None
    """The body; may be left out where there is only one."""
    motion: Literal["displacement", "velocity", "acceleration"] = "displacement"
    """What the row multiplies: displacement or velocity relative to the base, for stress, or absolute acceleration."""
    unit: q.Text = "1"
    """Unit of the product, for tables and files: Pa where the matrix gives stress in Pa."""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """A body that is unknown, or has no recovery matrix with this row."""
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
    """The body; may be left out where there is only one."""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """A body that there is not."""
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
"""By kind of output."""


_ENERGIES_AND_FORCES = {"N m": "J", "N m/m": "N"}
"""Units in which moments are energies, and moments per width forces."""

OutputLimit = Annotated[
    float,
    q.LevelType(
        tuple((_ENERGIES_AND_FORCES.get(of.unit, of.unit), of) for of in dict.fromkeys(_OUTPUT_DIMENSIONS.values())),
        "200 N", ("200 N", "80 MPa"), above=0.0,
    ),
]  # fmt: skip
"""A limit on an output, in the unit of any kind of output, which it remembers as its SI unit."""


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
    """Limits; the summary has margins and verdicts, and `--check` exits with code 4 if one is exceeded, 3 if that is
    not certain. A limit is one for all places, or by name of the place: {tip: 20 g, root: 5 g}."""

    peak_force: ForceLimit | None = None
    """Largest contact force of any snubber, or by snubber."""
    peak_moment: MomentLimit | None = None
    """Largest contact moment of any stop of a hinge, or by stop."""
    bending_stress: Stress | None = None
    """Largest bending stress anywhere on the beam."""
    peak_displacement: LengthLimit | None = None
    """Largest displacement of any probe relative to the base, or by probe."""
    peak_acceleration: AccelerationLimit | None = None
    """Largest absolute acceleration of any probe, or by probe."""
    gap: LengthLimit | None = None
    """Largest opening between the structure and any snubber (lift-off), or by snubber."""
    gapping: RatioLimit | None = None
    """Largest level of a sine over that at which the linear motion first changes contact of any snubber, or by snubber:
    80 % keeps the level of a run, or all levels of a sweep, at 80 % of it or below."""
    rms_displacement: LengthLimit | None = None
    """Root mean square of any probe's displacement, or by probe: of a run over the part of the spectra, of a stationary
    input without the first tenth."""
    rms_acceleration: AccelerationLimit | None = None
    """The same of the absolute acceleration."""
    rms_force: ForceLimit | None = None
    """Root mean square of any snubber's force, or by snubber, of a run with a stationary input."""
    outputs: dict[q.Name, OutputLimit] | None = None
    """By name the largest magnitude of outputs: {clamp: 200 N, gauge: 0.1 %}; a plain number is in their SI unit."""

    srs: dict[q.Name, ShockCurve] | None = None
    """By probe, input or support that moves (support left) a curve that the maximax shock response spectrum (run.srs)
    must not exceed: pairs of frequency and acceleration, [[100 Hz, 20 g], [1 kHz, 90 g]], or a CSV file; log-log
    interpolation between them. Two points at one frequency are a step, in all curves; the lower one holds there."""
    psd: dict[q.Name, DensityCurve] | None = None
    """By probe, input or snubber a curve that the spectral density of a stationary input's response must not exceed:
    pairs of frequency and density, [[20 Hz, 0.01 g^2/Hz], [200 Hz, 0.1 g^2/Hz]], or a CSV file; that of a snubber's
    force is in N^2/Hz, of the moment of a stop of a hinge in N^2 m^2/Hz."""
    response: dict[q.Name, ResponseCurve] | None = None
    """By probe or snubber a curve over the excitation frequency that the largest magnitude of no cycle of a sweep must
    exceed: pairs of frequency and acceleration, displacement, force or moment, [[20 Hz, 5 g], [400 Hz, 20 g]], or a CSV
    file."""

    curves: ClassVar[Mapping[str, Mapping[str, units.Dimension]]] = {
        "srs": {units.ACCELERATION.name: units.ACCELERATION}, "psd": LIMITED_DENSITIES, "response": LIMITED_RESPONSES,
    }  # fmt: skip
    """What is limited by curves, with the quantities that these may be of, the default first."""
    stated: ClassVar[Mapping[str, str]] = {"psd": "psd_with_units", "response": "response_with_units"}

    def check(self) -> None:
        """Reject a section that limits nothing, and curves that are none."""
        if not self.values_by_name:
            raise InvalidValueError(
                "limit nothing", "give for example limits: {peak_force: 50 N, bending_stress: 80 MPa}"
            )
        for name, place, points in self.given_curves():
            check_limit_curve(points, (name, place))

    def _with_units(self, name: str) -> dict[str, Any] | None:
        """Curves that may be of several quantities, with the units that say which; None where there are none."""
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
        """Name of the limit, place, and points or file of each curve."""
        for name in self.curves:
            yield from ((name, place, points) for place, points in (getattr(self, name) or {}).items())

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Limits on what this structure or analysis does not have."""
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
            if not sine or getattr(scenario.sweep, "kind", "stepped") not in SWEPT:
                needed = "needs a run or a sweep of a harmonic excitation"
                yield problem((*path, "gapping"), needed, "limit gap instead")
        yield from self._problems_of_curves(scenario, path)
        yield from self._problems_of_places(scenario, path)
        yield from self._problems_of_outputs(scenario, (*path, "outputs"))

    def _problems_of_places(self, scenario: Whole, path: Path) -> Problems:
        """Places that there are not."""
        for name in type(self).model_fields:
            of_place = getattr(self, name)
            if of_place is None or name in ("outputs", *self.curves):
                continue
            moment, both = name.endswith("moment"), name == "gapping"
            snubbers = moment or name.endswith(("force", "gap", "gapping"))
            stops = [stop for stop in scenario.all_snubbers if both or isinstance(stop, HingeStop) == moment]
            if snubbers and not stops:
                what, remedy = ("stops of hinges", "stops to a hinge") if moment else ("snubbers", "a snubber")
                message = f"limits the {what}, and there are none"
                yield problem((*path, name), message, f"add {remedy}, or leave it out")
            elif isinstance(of_place, dict):
                known = [each.name for each in (stops if snubbers else scenario.effective_probes)]
                for place in of_place:
                    yield from unknown((*path, name, place), place, "snubber" if snubbers else "probe", known)

    def _problems_of_outputs(self, scenario: Whole, path: Path) -> Problems:
        """Outputs that there are not, and limits in a unit of something else."""
        outputs = {output.name: output for _, output in scenario.requested_outputs}
        for name, limit in (self.outputs or {}).items():
            yield from unknown((*path, name), name, "output", outputs, "list it in outputs")
            if name in outputs:
                dimension = output_dimension(outputs[name], scenario.all_bodies, scenario.default_body)
                kind = outputs[name].kind.replace("_", " ")
                yield from unit_problems((*path, name), limit, dimension, f"and the output is a {kind}")

    def _problems_of_curves(self, scenario: Whole, path: Path) -> Problems:
        """Curves of spectra that are not asked for, and of places that there are not."""
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
            places = [*(each.name for each in scenario.effective_probes), *([INPUT] if name in ("srs", "psd") else [])]
            if name == "srs":
                moved = (each.applied_to for _, each in scenario.excitation.items)
                places += [path.label for path in moved if isinstance(path, MovedSupport) and not path.rotates]
            elif isinstance(points, CurveFile):
                places += snubbers
            yield from unknown(item_path, place, "place", snubbers if forces else places)

    @property
    def values_by_name(self) -> dict[str, float]:
        """The given limits in SI units, by name: that of the value, and behind a point the place where it has one.

        A curve is the limit 1 on the ratio to it.
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
    """Input that a curve of a name still needs, and a remedy; empty if nothing is missing."""
    run = scenario.run
    if name == "srs":
        there = run is not None and run.srs is not None
        needed, remedy = "shock response spectra", "add run.srs: {from: 10 Hz, to: 2 kHz}"
    elif name == "psd":
        there = run is not None and scenario.excitation.stationary
        needed = "a run with a stationary input"
        remedy = "limit peaks or srs, or give random noise or a record with stationary: true"
    else:
        there = getattr(scenario.sweep, "kind", "") in SWEPT
        needed = "a sweep in frequency"
        remedy = "limit peaks, or add sweep: {kind: swept_sine, ...} or {kind: stepped, ...}"
    return ("", "") if there else (needed, remedy)


def stress_problems(scenario: Whole, path: Path) -> Problems:
    """A problem: an item at a path needs a stress, which no body has."""
    if not any(body.gives_stress for body in scenario.all_bodies.values()):
        remedy = "leave it out, or give a beam's extreme_fibre and youngs_modulus"
        yield problem(path, "needs a body whose stress is known", remedy)


def unit_problems(path: Path, limit: float, dimension: units.Dimension | None, but: str) -> Problems:
    """A limit in a unit of something else.

    Parameters
    ----------
    path : path of the limit.
    limit : its value, which remembers its unit.
    dimension : of what is limited; None of rows of recovery matrices, which have units of their own.
    but : what is limited, for the message.

    Yields
    ------
    Problem
    """
    stated = q.meant(limit)
    if dimension is None and stated is not None:
        yield problem(path, "has a unit, and the output has one of its own", "give a plain number in that unit")
    elif dimension is not None and stated not in (None, _ENERGIES_AND_FORCES.get(dimension.unit, dimension.unit)):
        yield problem(path, f"is in {stated or 'no unit'}, {but}", f"write {dimension.example}")


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
        None of rows of recovery matrices, which have units of their own.
    """
    if output.kind == "bending_moment":
        body = bodies.get(output.place.body or default_body)
        return _MOMENT_PER_WIDTH if body is not None and body.body_kind == "plate" else units.MOMENT
    return _OUTPUT_DIMENSIONS.get(output.kind)


BASE_FORCE = ReactionOutput.model_construct(
    name="base_force", kind="reaction_force", support="base", body=None, direction=None, about=None
)
"""The output that a limit on the base's force stands for where the scenario has none."""
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
    """The quantity that a name stands for, or None. ``base_force`` is the name of that output.

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
