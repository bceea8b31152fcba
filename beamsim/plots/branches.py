"""Branches of periodic motions as curves: stable and unstable pieces, marks of special points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from beamsim.orbits.branch import special_name
from beamsim.plots.drawing import Curve, marks_curve, with_neighbours
from beamsim.typing import Bools, Floats

MARKS = {"fold": "s", "nonsmooth_fold": "X", "period_doubling": "D", "neimark_sacker": "v", "branch_point": "P",
         "grazing": "x", "symmetry_breaking": "*"}  # fmt: skip
CURVE_MARKS = {"isola": "*", "joining_branches": "P", "extremum": "d", "cusp": "^", "resonance_1_1": "1",
               "resonance_1_2": "2", "resonance_1_3": "3", "resonance_1_4": "4"}  # fmt: skip
UNSTABLE = (0, (3, 1.5))  # dashes of what is unstable


class BranchLine(NamedTuple):
    """A branch to be drawn, in SI units; its special points have a kind and a place."""

    label: str
    x: Floats
    y: Floats
    stable: Bools
    style: dict[str, Any]  # with colour and width
    special_points: Sequence[tuple[str, float, float]] = ()


def branch_curves(lines: Sequence[BranchLine]) -> list[Curve]:
    """Branches as curves: stable pieces full, unstable ones thinner and dashed, special points with marks.

    Labels that are alike are in the legend once.
    """
    curves: list[Curve] = []
    for line in lines:
        known = any(curve.label == line.label for curve in curves)
        style = {**line.style, "linestyle": "-"}
        curves.append(Curve("" if known else line.label, line.x, np.where(line.stable, line.y, np.nan), style))
        if not line.stable.all():
            dashed = {**style, "linewidth": 0.8 * style["linewidth"], "linestyle": UNSTABLE}
            curves.append(Curve("", line.x, np.where(with_neighbours(~line.stable), line.y, np.nan), dashed))
    if not all(line.stable.all() for line in lines):
        curves.append(Curve("unstable", np.zeros(0), np.zeros(0), {"color": "0.3", "linestyle": UNSTABLE}))
    for kind, mark in MARKS.items():
        places = [(x, y) for line in lines for name, x, y in line.special_points if name == kind]
        if places:
            face = {"markerfacecolor": "white", "markeredgewidth": 0.8, "zorder": 4}
            curves.append(marks_curve(special_name(kind), places, marker=mark, markersize=4.5, color="0.2", **face))
    return curves
