r"""Springs of a chain beside those in its row, as the linear model, statics and the exact flow see them.

A piecewise-linear force is, with its slope :math:`k_0` about zero stretch x, breakpoints :math:`b_i` and the changes of
slope :math:`\Delta_i` met there on the way out from zero,

.. math:: F(x) = k_0 x + \sum_{b_i > 0} \Delta_i [x - b_i]_+ - \sum_{b_i < 0} \Delta_i [b_i - x]_+ ,

a linear spring and one-sided springs with clearances, whose stiffness is negative where the spring softens. So its
motion has a closed form between breakpoints, and they are found as contacts are. The slope in every state that occurs
is one of those given, which are not negative: the strain energy stays convex.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from beamsim.contacts.contacts import Contacts
from beamsim.contacts.equilibrium import CubicSprings
from beamsim.errors import Problem, ScenarioError
from beamsim.scenario.base import path_text
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.scenario import Located


def one_sided_parts(
    breakpoints: Sequence[float], slopes: Sequence[float], at_rest: int
) -> tuple[Floats, Floats, Floats]:
    """Sign, stiffness and gap of the one-sided springs beside the linear part ``slopes[at_rest]``, (c,) each.

    Examples
    --------
    >>> one_sided_parts([-1.0, 2.0], [5.0, 3.0, 1.0], 1)
    (array([ 1., -1.]), array([ 2., -2.]), array([1., 2.]))
    """
    parts = [(1.0, slopes[i] - slopes[i + 1], -breakpoints[i]) for i in range(at_rest)]
    parts += [(-1.0, slopes[i + 1] - slopes[i], breakpoints[i]) for i in range(at_rest, len(breakpoints))]
    sign, stiffness, gap = np.array([p for p in parts if p[1] != 0.0]).reshape(-1, 3).T
    return sign, stiffness, gap + 0.0


@dataclass(frozen=True)
class SpringInfo:
    """One nonlinear spring: where it acts and its law, F = linear x + one-sided parts, or cubic x^3."""

    name: str
    kind: str  # "cubic" or "piecewise_linear"
    masses: tuple[int, ...]  # the one it ties to the ground, or the two it joins
    shape: Floats  # (n,) stretch for a unit of each coordinate, 1/sqrt(kg)
    cubic: float  # N/m^3
    linear: float  # N/m, the slope about zero
    sign: Floats  # (c,) of the one-sided parts: +1 resists negative stretch
    stiffness: Floats  # (c,) N/m, negative where it softens
    gap: Floats  # (c,) m

    @property
    def on_ground(self) -> bool:
        """Whether it feels the absolute displacement."""
        return len(self.masses) == 1

    def force(self, stretch: Floats) -> Floats:
        """N, positive where it pulls back a positive stretch (any shape)."""
        delta = np.maximum(-self.gap - self.sign * stretch[..., None], 0.0)
        return np.asarray(self.linear * stretch + self.cubic * stretch**3 - delta @ (self.sign * self.stiffness))


def describe_springs(springs: Sequence[Located], shape: Floats) -> tuple[SpringInfo, ...]:
    """The nonlinear springs; ``shape`` (count, n) is the stretch of each for a unit of each coordinate.

    Raises ScenarioError where breakpoints do not increase: a design that varies them is not checked where it is read.
    """
    none = np.zeros(0)
    found = []
    for row, (path, _, spring) in zip(shape, springs, strict=True):
        masses = tuple(sorted(spring.masses)) if hasattr(spring, "masses") else (spring.mass,)
        if spring.kind == "cubic":
            law = (float(spring.stiffness), 0.0, none, none, none)
        else:
            if any(b <= a for a, b in pairwise(spring.breakpoints)):
                raise ScenarioError(
                    Problem(
                        f"{path_text(path)}.breakpoints",
                        f"= {list(spring.breakpoints)} do not increase",
                        "keep their order in every case",
                    )
                )
            parts = one_sided_parts(spring.breakpoints, spring.stiffnesses, spring.number_at_rest)
            law = (0.0, float(spring.slope_at_rest), *parts)
        found.append(SpringInfo(spring.name, spring.kind, masses, row, *law))
    return tuple(found)


def cubic_springs(springs: Sequence[SpringInfo], size: int) -> CubicSprings:
    """The cubic ones among them."""
    cubic = [s for s in springs if s.kind == "cubic"]
    return CubicSprings(
        np.array([s.shape for s in cubic]).reshape(-1, size),
        np.array([s.cubic for s in cubic]),
        np.array([s.on_ground for s in cubic], dtype=bool),
    )


def spring_contacts(springs: Sequence[SpringInfo], size: int) -> Contacts:
    """The one-sided parts of all of them, spring by spring."""
    count = [s.gap.size for s in springs]

    def joined(values: list[Floats]) -> Floats:
        return np.concatenate([np.zeros(0), *values])

    total = sum(count)
    return Contacts(
        shape=np.repeat(np.array([s.shape for s in springs]).reshape(-1, size), count, axis=0),
        sign=joined([s.sign for s in springs]),
        stiffness=joined([s.stiffness for s in springs]),
        dashpot=np.zeros(total),
        gap=joined([s.gap for s in springs]),
        on_ground=np.repeat(np.array([s.on_ground for s in springs], dtype=bool), count),
        no_tension=np.zeros(total, dtype=bool),
    )
