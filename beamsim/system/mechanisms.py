"""Motions that joints leave free, and things that act where nothing can move."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from beamsim.errors import Problem, ScenarioError
from beamsim.scenario.base import Path, path_text
from beamsim.structures.places import SLOPE, LoadSite
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.structures.structure import Coupling
    from beamsim.system.parts import Parts

# A motion below this fraction of the largest possible one is round-off.
_NOTHING = 1e-9


def held_problems(parts: Parts, acting: Sequence[tuple[Path, LoadSite, str]]) -> list[Problem]:
    """What acts (path, where, its name) where joints leave no motion."""
    if not parts.structure.couplings:
        return []
    return [
        Problem(
            path_text(path),
            f"acts at {site.label}, where a joint leaves no motion: {what} has no effect there",
            "move it along the body, or change the joint",
        )
        for path, site, what in acting
        if np.abs(parts.structure.row(site)).max() <= _NOTHING
    ]


def check_mechanisms(parts: Parts, stopping: Floats) -> list[str]:
    """Warnings about motions that joints leave free and contacts stop.

    A motion of the bodies as rigid ones that turns or opens a joint is a mechanism. Floating as a whole is none.

    Parameters
    ----------
    stopping : (m, n) rows of contacts and nonlinear springs, the only things that can stop such a motion.

    Raises
    ------
    ScenarioError
        If nothing stops it; it names joint and bodies.
    """
    rigid, couplings = parts.basis.rigid, parts.structure.couplings
    if not rigid or not couplings:
        return []
    opening = np.array([_opening(parts, coupling) for coupling in couplings])[:, :rigid]
    size = np.linalg.norm(stopping, axis=1, keepdims=True)
    felt = (stopping / np.where(size > 0, size, 1.0))[:, :rigid]
    _, s, vt = np.linalg.svd(felt)
    unstopped = vt[int(np.sum(s > _NOTHING)) :].T
    problems = [
        Problem(
            path_text(("joints", index)),
            f"({coupling.name}) leaves {bodies} free to {verb} there, and nothing stops that motion",
            f"give the joint a {stiffness}, hold {bodies} by a support or another joint, or let a snubber meet it",
        )
        for index, coupling, bodies, verb, stiffness in _free(parts, couplings, opening, unstopped)
    ]
    if problems:
        raise ScenarioError(problems)
    return [
        f"joints[{index}] ({coupling.name}) leaves {bodies} free to {verb} there: snubbers or nonlinear springs alone "
        "stop that motion"
        for index, coupling, bodies, verb, _ in _free(parts, couplings, opening, np.eye(rigid))
    ]


def _opening(parts: Parts, coupling: Coupling) -> Floats:
    """(n,) how far a joint opens, beside the motion of its ends, for a unit of each coordinate."""
    ends = parts.shapes(list(coupling.ends))
    return np.asarray(parts.shapes([coupling.site])[0] / max(float(np.abs(ends).max()), np.finfo(float).tiny))


def _free(
    parts: Parts, couplings: Sequence[Coupling], opening: Floats, motions: Floats
) -> list[tuple[int, Coupling, str, str, str]]:
    """Number and coupling of every joint that the rigid motions (rigid, k) open, with bodies and words."""
    names = [joint.name for joint in parts.scenario.joints]
    opened = []
    for coupling, row in zip(couplings, opening @ motions, strict=True):
        largest = float(np.linalg.norm(row))
        if coupling.stiffness != 0.0 or coupling.name not in names or largest <= _NOTHING:
            continue
        turns = coupling.ends[0].direction == SLOPE
        moving = parts.basis.vectors[:, : motions.shape[0]] @ (motions @ (row / largest))
        opened.append(
            (
                names.index(coupling.name),
                coupling,
                _bodies(parts, moving),
                "turn" if turns else "move",
                "rotational_stiffness" if turns else "stiffness",
            )
        )
    return opened


def _bodies(parts: Parts, field: Floats) -> str:
    """Names of the bodies that a field (N,) moves."""
    reach = [member.body.largest_deflection(member.field(field)) for member in parts.structure.members]
    moved = [m.body.name for m, x in zip(parts.structure.members, reach, strict=True) if x > _NOTHING * max(reach)]
    return " and ".join(moved)
