"""Quantities of a structure that are reported beside the motion of its probes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

from pydantic import Tag

from beamsim.errors import Problem
from beamsim.scenario.base import Path, Schema, Variants, fail, kind_of, path_text, suggestion
from beamsim.scenario.body import Body
from beamsim.scenario.driven import About, point_of
from beamsim.scenario.joint import Joint, body_origins
from beamsim.scenario.place import Sited
from beamsim.scenario.quantities import Name, Text


class Output(Schema):
    """Common part of all outputs."""

    name: Name
    """Name, unique also among the probes; it names the output in the result file."""

    def problems(
        self, at: Path, bodies: Mapping[str, Body], default: str, joints: tuple[Any, ...]
    ) -> Iterator[Problem]:
        """What does not fit the structure; ``joints`` are joints and springs between and to points of bodies."""
        yield from ()


class MotionOutput(Output, Sited):
    """Motion of a point."""

    kind: Literal["displacement", "velocity", "acceleration", "rotation"]
    """Displacement or velocity relative to the base, absolute acceleration, or the slope dw/dx of a beam."""

    def problems(
        self, at: Path, bodies: Mapping[str, Body], default: str, joints: tuple[Any, ...]
    ) -> Iterator[Problem]:
        """Only points of beams have a slope."""
        body = bodies.get(self.place.body or default)
        if body is not None and self.kind == "rotation" and not body.has_slope:
            yield _problem(
                at, f"asks for a slope, but the points of a {body.body_kind} have none", "name a point of a beam"
            )


class BendingOutput(Output, Sited):
    """What bends a beam or plate at a point."""

    kind: Literal["bending_moment", "stress", "strain"]
    """E I w'' of a beam, positive where its top is in compression, or the moment per width of a plate; bending stress
    or strain at a surface, positive in tension; the strain xy of a plate is the shear angle."""
    component: Literal["x", "y", "xy"] | None = None
    """On a plate which of the three: x by default; a beam has one."""
    surface: Literal["top", "bottom"] | None = None
    """Of a stress or strain which surface, top by default."""

    def settle(self) -> None:
        """A moment has no surface."""
        super().settle()
        if self.kind != "bending_moment":
            self.resolve("surface", self.surface or "top")
        elif self.surface is not None:
            raise fail("belongs to a stress or strain", "leave it out", ("surface",))

    def problems(
        self, at: Path, bodies: Mapping[str, Body], default: str, joints: tuple[Any, ...]
    ) -> Iterator[Problem]:
        """Only beams and plates bend, only plates have components, and the distance of the fibre must be known."""
        name = self.place.body or default
        body = bodies.get(name)
        if body is None:
            return
        what = self.kind.replace("_", " ")
        if body.body_kind not in ("beam", "plate"):
            yield _problem(
                at, f"asks for a {what}, but {name} is of the kind {body.body_kind}", "name a point of a beam or plate"
            )
        elif self.component is not None and body.body_kind == "beam":
            yield _problem((*at, "component"), f"belongs to a plate, but {name} is a beam", "leave it out")
        elif self.kind == "strain" and body.gives_strain:
            return
        elif self.kind == "strain" and body.body_kind == "plate":
            yield _problem(
                at, f"needs the thickness of {name}, which its stiffnesses do not tell", "give its thickness"
            )
        elif self.kind != "bending_moment" and not body.gives_stress:
            yield _problem(
                at, f"needs the outermost fibre of {name}, which its bending stiffness does not tell",
                "give a section, or ask for kind: bending_moment",
            )  # fmt: skip


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

    def problems(
        self, at: Path, bodies: Mapping[str, Body], default: str, joints: tuple[Any, ...]
    ) -> Iterator[Problem]:
        """The body must be there; whether it has such a support is known to its model."""
        if self.about is not None and (self.support != "base" or self.kind != "reaction_moment"):
            yield _problem((*at, "about"), "belongs to the moment of the base", "leave it out")
        if self.support != "base":
            yield from _body_problems(at, self.body, bodies, default)
        elif self.body is not None:
            yield _problem((*at, "body"), "belongs to a support; the base holds all bodies", "leave it out")
        elif self.kind == "reaction_moment" or self.direction is not None:
            yield from self._base_problems(at, bodies, default, joints)
        if self.direction is not None and (len(self.direction) == 2) != (self.kind == "reaction_moment"):
            yield _problem((*at, "direction"), f"= {self.direction} is none of a {self.kind.replace('_', ' ')}",
                           "forces have x, y and z, moments rx, ry and rz")  # fmt: skip

    def _base_problems(
        self, at: Path, bodies: Mapping[str, Body], default: str, joints: tuple[Any, ...]
    ) -> Iterator[Problem]:
        """The base must be able to move so, and where the bodies lie be known for a moment."""
        direction = self.direction or ("ry" if self.kind == "reaction_moment" else "z")
        for name, body in bodies.items():
            if direction not in body.base_directions:
                yield _problem(
                    (*at, "direction"), f"= {direction} moves no point of {name}, a {body.body_kind}",
                    f"use {' or '.join(filter(None, body.base_directions))}",
                )  # fmt: skip
        placed = body_origins([joint for joint in joints if isinstance(joint, Joint)], default)
        if direction.startswith("r") and len(bodies) > 1 and set(bodies) - set(placed):
            yield _problem(
                (*at, "support"), f"= base: joints do not say how {', '.join(bodies)} lie to one another",
                "join them by points of beams, or ask for the moment of a support",
            )  # fmt: skip


class JointOutput(Output):
    """What is transmitted by a joint, or by a linear spring between points of bodies."""

    kind: Literal["joint_force", "joint_moment"]
    """Force, positive upwards, or moment, positive as the slope, on the second of the two points; of the base and a
    point on that point."""
    joint: Name
    """Name of the joint or spring."""

    def problems(
        self, at: Path, bodies: Mapping[str, Body], default: str, joints: tuple[Any, ...]
    ) -> Iterator[Problem]:
        """The joint must be there."""
        names = [joint.name for joint in joints]
        if self.joint not in names:
            known = suggestion(self.joint, names, "the joints are") if names else "the scenario has no joint"
            yield _problem((*at, "joint"), f"= {self.joint} is an unknown joint", known)


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

    def problems(
        self, at: Path, bodies: Mapping[str, Body], default: str, joints: tuple[Any, ...]
    ) -> Iterator[Problem]:
        """The body must have a recovery matrix with this row."""
        yield from _body_problems(at, self.body, bodies, default)
        body = bodies.get(self.body or default)
        if body is None:
            return
        if not body.recovered_rows:
            yield _problem(
                at, f"needs a recovery matrix, which {self.body or default} lacks",
                "give recovery: {file: panel.op4, name: stress, rows: [skin]} of imported matrices",
            )  # fmt: skip
        elif self.row not in body.recovered_rows:
            known = suggestion(self.row, body.recovered_rows, "its rows are")
            yield _problem((*at, "row"), f"= {self.row} is no row of the recovery matrix", known)


class EnergyOutput(Output):
    """Energy of a body."""

    kind: Literal["kinetic_energy", "strain_energy"]
    """Kinetic energy of the motion relative to the base, or strain energy."""
    body: Name | None = None
    """The body; may be left out where there is only one."""

    def problems(
        self, at: Path, bodies: Mapping[str, Body], default: str, joints: tuple[Any, ...]
    ) -> Iterator[Problem]:
        """The body must be there."""
        yield from _body_problems(at, self.body, bodies, default)


def _problem(at: Path, message: str, remedy: str) -> Problem:
    return Problem(path_text(at), message, remedy)


def _body_problems(at: Path, body: str | None, bodies: Mapping[str, Body], default: str) -> Iterator[Problem]:
    if body is not None and body not in bodies:
        known = suggestion(body, bodies, "the bodies are")
        yield _problem((*at, "body"), f"= {body} is an unknown body", known)
    elif body is None and not default:
        yield _problem(
            at, f"names no body, and there are several: {', '.join(bodies)}", f"add body: {next(iter(bodies))}"
        )


_GROUPS = {
    "<motion>": ("displacement", "velocity", "acceleration", "rotation"),
    "<bending>": ("bending_moment", "stress", "strain"),
    "<reaction>": ("reaction_force", "reaction_moment"),
    "<joint>": ("joint_force", "joint_moment"),
    "<recovered>": ("recovered",),
    "<energy>": ("kinetic_energy", "strain_energy"),
}


def _choose(value: Any) -> str | None:
    return next((tag for tag, kinds in _GROUPS.items() if kind_of(value) in kinds), None)


AnyOutput = Annotated[
    Annotated[MotionOutput, Tag("<motion>")]
    | Annotated[BendingOutput, Tag("<bending>")]
    | Annotated[ReactionOutput, Tag("<reaction>")]
    | Annotated[JointOutput, Tag("<joint>")]
    | Annotated[RecoveredOutput, Tag("<recovered>")]
    | Annotated[EnergyOutput, Tag("<energy>")],
    Variants(
        _choose,
        "is no output",
        f"give it a name and a kind: {', '.join(kind for kinds in _GROUPS.values() for kind in kinds)}",
    ),
]
