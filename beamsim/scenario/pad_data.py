"""Measurements of a pad itself: dynamic stiffness over frequency, or relaxation over time."""

from __future__ import annotations

from typing import Annotated, Any

from beamsim.scenario.base import Schema, counted, fail
from beamsim.scenario.quantities import Duration, FileName, Frequency, Ratio, Stiffness, Time, Whole

DynamicPoint = tuple[Frequency, Stiffness, Ratio]
"""Frequency, storage stiffness and loss factor."""
RelaxationPoint = tuple[Time, Stiffness]
"""Time since the deflection began, and force over the deflection that is held."""


class PadData(Schema):
    """What was measured on the pad; one of dynamic, relaxation and file."""

    dynamic: tuple[DynamicPoint, ...] | None = None
    """Frequency, storage stiffness and loss factor of each measurement: [[10 Hz, 120 kN/m, 0.08], ...]."""
    relaxation: tuple[RelaxationPoint, ...] | None = None
    """Time since the deflection began, and force over the deflection that is held: [[1 ms, 190 kN/m], ...]."""
    ramp: Duration | None = None
    """Time over which the deflection of a relaxation test rises evenly; by default it is sudden."""
    file: FileName | None = None
    """CSV file of either, relative to the scenario's folder; headings state units: frequency (Hz), storage (kN/m), loss
    factor, or time (s), stiffness (kN/m). A modulus in place of a stiffness takes height and area of the pad."""
    branches: Annotated[int, Whole(1, 8)] | None = None
    """Number of Maxwell branches; by default as few as fit nearly as well as any number."""

    def settle(self) -> None:
        """Demand one kind of measurement, and points that determine the branches."""
        given = [key for key in ("dynamic", "relaxation", "file") if getattr(self, key) is not None]
        if len(given) != 1:
            message = f"has {' and '.join(given)}" if given else "needs one of dynamic, relaxation and file"
            raise fail(message, "give for example dynamic: [[10 Hz, 120 kN/m, 0.08], [100 Hz, 150 kN/m, 0.11]]")
        if self.ramp is not None and self.dynamic is not None:
            raise fail("goes with a relaxation test", "leave ramp out", ("ramp",))
        if given != ["file"]:
            check_data(getattr(self, given[0]), given[0], self.branches)


def check_data(points: Any, kind: str, branches: int | None) -> None:
    """Reject measurements that are out of order or too few; `points` are rows of frequency or time first."""
    least = 2 if branches is None else branches + 1
    if len(points) < least:
        what = counted(len(points), "measurement")
        raise fail(f"has {what}", f"measure at {least} or more", (kind,))
    unit = "Hz" if kind == "dynamic" else "s"
    for index in range(1, len(points)):
        if not points[index][0] > points[index - 1][0]:
            raise fail(
                f"= {points[index][0]:g} {unit} does not lie above the one before, {points[index - 1][0]:g} {unit}",
                "list the measurements in their order, each once", (kind, index, 0),
            )  # fmt: skip
    if kind == "dynamic" and all(point[2] == 0.0 for point in points):
        raise fail("has no loss at all", "a pad without loss needs a stiffness alone", (kind,))
