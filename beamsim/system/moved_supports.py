r"""Supports that move by signals of their own, as loads on the degrees of freedom that they leave.

With b the motion of a support, the others being held, and q the degrees of freedom relative to the base,

.. math:: M_{qq} \ddot q + C_{qq} \dot q + K_{qq} q = f - M_{qb} \ddot b - C_{qb} \dot b - K_{qb} b.

Matrices and dashpots have their own :math:`C_{qb}`. Modal and Rayleigh damping act on the motion relative to the static
shape :math:`\psi = -K_{qq}^{-1} K_{qb}`, so that there :math:`C_{qb} = -C_{qq} \psi`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from beamsim.errors import Problem, ScenarioError
from beamsim.inputs.excitation import Driven
from beamsim.scenario import Scenario
from beamsim.scenario.base import Path, path_text, suggestion
from beamsim.scenario.body import MovedSupport
from beamsim.structures.places import DEFLECTION, SLOPE, Link, Site
from beamsim.structures.structure import LoadPattern, ReducedBasis, Structure
from beamsim.structures.support_forces import Support, supports_of
from beamsim.typing import Floats


@dataclass(frozen=True)
class Moved:
    """A support of the structure and what moves it."""

    path: Path
    driven: Driven
    support: Support

    def pattern(self, structure: Structure) -> LoadPattern:
        """The load of a unit motion that is held for ever."""
        return LoadPattern(-self.support.on_dofs[0] / structure.stiffness_scale, self.support.motion)

    def static_shape(self, structure: Structure, basis: ReducedBasis) -> Floats:
        """(n,) coordinates of the static shape for a unit motion, sqrt(kg) m."""
        momentum = structure.mass @ self.support.shape
        return np.asarray(basis.vectors.T @ momentum * np.sqrt(structure.mass_scale))

    def loads(self, structure: Structure, basis: ReducedBasis, damping: Floats) -> tuple[Floats, Floats, Floats]:
        """The loads on the reduced structure.

        Parameters
        ----------
        structure, basis : that the support belongs to, and its reduced coordinates.
        damping : (n, n) C, 1/s.

        Returns
        -------
        tuple
            (n,) per acceleration, velocity and displacement of the support.
        """
        vectors = basis.vectors / np.sqrt(structure.mass_scale)
        if structure.damping is not None:
            damping = damping - vectors.T @ (structure.damping @ vectors)
        stiffness, mass, viscous = self.support.on_dofs @ vectors
        return -mass, damping @ self.static_shape(structure, basis) - viscous, -stiffness


def driven_supports(scenario: Scenario) -> Iterator[tuple[Path, Driven]]:
    """What of the excitation moves a support, with its path."""
    excitation = scenario.excitation
    if excitation.kind == "none":
        return
    listed = enumerate(excitation.forces) if excitation.kind == "forces" else [(None, excitation)]
    for index, driven in listed:
        if isinstance(driven.applied_to, MovedSupport):
            yield ("excitation",) if index is None else ("excitation", "forces", index), driven


def moved_supports(scenario: Scenario, structure: Structure) -> list[Moved]:
    """The supports that the excitation moves.

    Raises
    ------
    ScenarioError
        Where the structure has no such support.
    """
    driven = list(driven_supports(scenario))
    if not driven:
        return []
    supports = supports_of(structure)
    return [Moved(path, each, _moved_support(scenario, supports, path, each.applied_to)) for path, each in driven]


def _moved_support(scenario: Scenario, supports: Sequence[Support], path: Path, moved: Any) -> Support:
    path = (*path, "applied_to")
    directions = (moved.direction or DEFLECTION,)
    if moved.direction == "slope":
        directions = (SLOPE,)
    if moved.joint is not None:
        named = [each for each in supports if each.at is not None and each.name == moved.joint]
        key = "joint"
    else:
        body = moved.body or scenario.default_body
        on_body = [each for each in supports if each.body == body and each.at is None]
        named, key = [each for each in on_body if each.name == moved.support], "support"
        if not named:
            names = list(dict.fromkeys(each.name for each in on_body))
            remedy = suggestion(str(moved.support), names, "its supports are") if names else "it is free"
            raise ScenarioError(
                Problem(path_text((*path, key)), f"= {moved.support} is not a support of {body}", remedy)
            )
    fits = [each for each in named if each.direction in directions]
    if not fits:
        held = " and ".join(dict.fromkeys("slope" if each.direction == SLOPE else each.direction for each in named))
        name = moved.joint or moved.support
        raise ScenarioError(
            Problem(path_text((*path, key)), f"= {name} does not hold {moved.direction or 'z'}", f"it holds {held}")
        )
    if not fits[0].determined:
        raise ScenarioError(
            Problem(
                path_text((*path, key)),
                f"= {moved.joint} holds what others hold already, and cannot move against them",
                "leave out the joint that is too many, or give it a stiffness",
            )
        )
    return fits[0]


def check_places(moved: Sequence[Moved], places: Sequence[tuple[Path, Site]]) -> None:
    """Refuse contacts and probes on what moves with a support: their motion is not that of a free point."""
    problems = []
    for path, site in places:
        ends = (site.first, site.second) if isinstance(site, Link) else (site,)
        for each in moved:
            if any(abs(each.support.direct(end)) > 1e-9 for end in ends):
                where = path_text((*each.path, "applied_to"))
                problems.append(
                    Problem(
                        path_text(path),
                        f"is at {site.label}, which moves with the support of {where}",
                        "move it along the body",
                    )
                )
                break
    if problems:
        raise ScenarioError(problems)
