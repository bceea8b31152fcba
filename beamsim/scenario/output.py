"""Quantities of a structure that are reported beside the motion of its probes."""

from __future__ import annotations

from typing import Annotated, Literal

from beamsim.scenario.base import Schema, Variants, fail
from beamsim.scenario.excitation import About, point_of
from beamsim.scenario.place import Sited
from beamsim.scenario.quantities import Name, Text


class Output(Schema):
    """Common part of all outputs."""

    name: Name
    """Name, unique also among the probes; it names the output in the result file."""


class MotionOutput(Output, Sited):
    """Motion of a point."""

    kind: Literal["displacement", "velocity", "acceleration", "rotation"]
    """Displacement or velocity relative to the base, absolute acceleration, or the slope dw/dx of a beam."""


class BendingOutput(Output, Sited):
    """What bends a beam or plate at a point."""

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
            raise fail("belongs to a stress or strain", "leave it out", ("surface",))


class ReactionOutput(Output):
    """What a support exerts on the structure."""

    kind: Literal["reaction_force", "reaction_moment"]
    """Force, positive upwards, or moment, positive as the slope dw/dx, at the bottom and top of a plate dw/dy."""
    support: Name
    """The support: left or right end of a beam; left, right, bottom, top or point 1 of a plate; left or right wall of a
    chain, or its spring to the ground; node 15 of imported matrices; base, for all that the base exerts together."""
    body: Name | None = None
    """The body that the support holds; may be left out where there is only one."""
    direction: Literal["x", "y", "z", "rx", "ry", "rz"] | None = None
    """At a node of imported matrices, or of the base; z of a force and ry of a moment by default."""
    about: About | None = None
    """Of the moment of the base, a point on its axis, m: a position along a beam, [x, y] of a plate, [x, y, z] of
    imported matrices; their origin by default."""

    @property
    def axis_point(self) -> tuple[float, float, float]:
        """The point, m."""
        return point_of(self.about)


class JointOutput(Output):
    """What is transmitted by a joint, or by a linear spring between points of bodies."""

    kind: Literal["joint_force", "joint_moment"]
    """Force, positive upwards, or moment, positive as the slope, on the second of the two points; of the base and a
    point on that point."""
    joint: Name
    """Name of the joint or spring."""


class RecoveredOutput(Output):
    """A row of the recovery matrix of a body."""

    kind: Literal["recovered"]
    """The product of a row with the motion of the degrees of freedom."""
    row: Name
    """Name of the row."""
    body: Name | None = None
    """The body; may be left out where there is only one."""
    motion: Literal["displacement", "velocity", "acceleration"] = "displacement"
    """What the row multiplies: displacement or velocity relative to the base, for stress, or absolute acceleration."""
    unit: Text = "1"
    """Unit of the product, for tables and files: Pa where the matrix gives stress in Pa."""


class EnergyOutput(Output):
    """Energy of a body."""

    kind: Literal["kinetic_energy", "strain_energy"]
    """Kinetic energy of the motion relative to the base, or strain energy."""
    body: Name | None = None
    """The body; may be left out where there is only one."""


AnyOutput = Annotated[
    MotionOutput | BendingOutput | ReactionOutput | JointOutput | RecoveredOutput | EnergyOutput,
    Variants(
        "is no output",
        "give it a name and a kind: displacement, velocity, acceleration, rotation, bending_moment, stress, strain, "
        "reaction_force, reaction_moment, joint_force, joint_moment, recovered, kinetic_energy, strain_energy",
    ),
]
