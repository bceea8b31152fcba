"""Supports that move by a signal of their own, and the quantities of motions."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal

from beamsim.errors import Problem
from beamsim.scenario.base import Path, Schema, fail, path_text, suggestion
from beamsim.scenario.place import AtPlace
from beamsim.scenario.quantities import Name

Translation = Literal["acceleration", "velocity", "displacement"]
Rotation = Literal["angular_acceleration", "angular_velocity", "rotation"]

TRANSLATION_TAKES: tuple[Translation, ...] = ("acceleration", "velocity", "displacement")
"""What a motion along an axis is given by; the first is the default."""
ROTATION_TAKES: tuple[Rotation, ...] = ("angular_acceleration", "angular_velocity", "rotation")
"""What a rotation is given by; the first is the default."""


class MovedSupport(Schema):
    """A support, or a joint, that moves relative to the base."""

    support: Name | None = None
    """The support: left or right end of a beam or wall of a chain; left, right, bottom, top or point 1 of a plate;
    node 15 of imported matrices."""
    joint: Name | None = None
    """Instead of a support a joint, or a linear spring between points: its second point moves against the first."""
    body: Name | None = None
    """The body that the support holds; may be left out where there is only one."""
    direction: Literal["x", "y", "z", "rx", "ry", "rz", "slope"] | None = None
    """z, the deflection, by default; slope is a rotation dw/dx; at a node of imported matrices any of x to rz."""

    def settle(self) -> None:
        """Demand a support or a joint."""
        if (self.support is None) == (self.joint is None):
            raise fail("names neither a support nor a joint, or both", "give one of them: {support: left}")
        if self.joint is not None and self.body is not None:
            raise fail("belongs to a support", "leave it out: a joint has a name of its own", ("body",))

    @property
    def rotates(self) -> bool:
        """Whether it turns."""
        return self.direction is not None and self.direction not in ("x", "y", "z")

    @property
    def takes(self) -> tuple[Translation, ...] | tuple[Rotation, ...]:
        """Quantities that its levels may have, the default first."""
        return ROTATION_TAKES if self.rotates else TRANSLATION_TAKES

    @property
    def places(self) -> tuple[AtPlace, ...]:
        """None: it acts on no free point."""
        return ()


def moved_support_problems(scenario: Any, path: Path, moved: MovedSupport) -> Iterator[Problem]:
    """A body or joint that there is not; which supports a body has is known to its model."""
    if moved.joint is not None:
        names = [joint.name for joint in scenario.joints]
        if moved.joint not in names:
            known = suggestion(moved.joint, names, "the joints are") if names else "the scenario has no joint"
            yield Problem(path_text((*path, "joint")), f"= {moved.joint} is an unknown joint", known)
    elif moved.body is not None and moved.body not in scenario.all_bodies:
        known = suggestion(moved.body, scenario.all_bodies, "the bodies are")
        yield Problem(path_text((*path, "body")), f"= {moved.body} is an unknown body", known)
    elif moved.body is None and not scenario.default_body:
        names = list(scenario.all_bodies)
        if len(names) > 1:
            yield Problem(
                path_text(path), f"names no body, and there are several: {', '.join(names)}",
                f"name one: {{body: {names[0]}, support: {moved.support}}}",
            )  # fmt: skip
