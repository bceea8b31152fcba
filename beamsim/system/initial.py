"""Where a motion starts."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from beamsim.contacts.contacts import Contacts
from beamsim.contacts.equilibrium import CubicSprings, Equilibrium, find_equilibrium
from beamsim.contacts.snubbers import springs_of
from beamsim.errors import Problem, ScenarioError
from beamsim.scenario.run import BodiesStart, ModeStart, OrbitStart, PolynomialStart, ReleasedForceStart
from beamsim.structures.mechanisms import floating_motions
from beamsim.system.parts import Parts, start_of
from beamsim.typing import Floats

_FIELDS = ("displacement", "velocity")


def initial_state(
    parts: Parts, contacts: Contacts, loads: Floats, cubic: CubicSprings, equilibrium: Equilibrium
) -> tuple[Floats, list[str]]:
    """The state from which a motion starts.

    Parameters
    ----------
    parts : of the scenario.
    contacts, cubic : its contacts and cubic springs.
    loads : (L, n) constant loads.
    equilibrium : static equilibrium under these, or why there is none.

    Returns
    -------
    (2 n,) q then q' at t = 0, relative to the base; and warnings.

    Raises
    ------
    ScenarioError
        Where the start needs a static shape that does not exist, or a mode that the reduction does not keep.
    """
    n = parts.basis.size
    q, v = np.zeros(n), np.zeros(n)
    warnings: list[str] = []
    start = start_of(parts.scenario)
    if start is None:
        q = q if equilibrium.q is None else equilibrium.q
    elif start == "static_equilibrium":
        remedy = "start from rest, or hold the structure with a support, a preload or a load towards a snubber"
        q = _static_shape(parts, equilibrium, "run.start", "= static_equilibrium does not exist", remedy)
    elif isinstance(start, OrbitStart):
        raise ScenarioError(
            Problem("run.start.orbit", "starts a run, and no other command", "leave run.start out, or `beamsim run`")
        )
    elif isinstance(start, ReleasedForceStart):
        extra = (start.released_force.force * parts.shape(start.released_force))[None, :]
        held = find_equilibrium(
            parts.stiffness, parts.basis.rigid, springs_of(contacts), np.vstack([loads, extra]), cubic
        )
        remedy = "let it push towards a snubber, or support the structure"
        q = _static_shape(parts, held, "run.start.released_force", "holds no static shape", remedy)
    elif isinstance(start, ModeStart):
        q = _mode_shape(parts, start.mode, start.amplitude)
    elif isinstance(start, PolynomialStart):
        q, v = (_given_field(parts, {parts.scenario.default_body: start}, name, warnings) for name in _FIELDS)
    elif isinstance(start, BodiesStart):
        q, v = (_given_field(parts, start.bodies, name, warnings) for name in _FIELDS)
    return np.concatenate([q, v]), warnings


def _static_shape(parts: Parts, equilibrium: Equilibrium, path: str, problem: str, remedy: str) -> Floats:
    """(n,) coordinates of an equilibrium; ScenarioError says why there is none and, where something floats, what."""
    if equilibrium.q is None:
        floats = f" ({floating_motions(parts.structure, parts.basis)})" if parts.basis.rigid else ""
        raise ScenarioError(Problem(path, f"{problem}: {equilibrium.reason}{floats}", remedy))
    return equilibrium.q


def _mode_shape(parts: Parts, mode: int, amplitude: float) -> Floats:
    """Open mode `mode` (numbered from 1, rigid-body modes included) with its largest deflection equal to amplitude."""
    if mode > parts.basis.modes:
        raise ScenarioError(
            Problem(
                "run.start.mode",
                f"= {mode} is not among the {parts.basis.modes} modes of the model",
                "choose a lower mode, or raise reduction.modes or beam.elements",
            )
        )
    largest = parts.structure.largest_deflection(parts.basis.vectors[:, mode - 1])
    q = np.zeros(parts.basis.size)
    q[mode - 1] = amplitude / largest * np.sqrt(parts.structure.mass_scale)
    return q


def _given_field(parts: Parts, given: Mapping[str, PolynomialStart], quantity: str, warnings: list[str]) -> Floats:
    """Coordinates of fields given body by body: a polynomial in x along a beam, one number a mass of a chain."""
    numbers = {name: getattr(start, quantity) for name, start in given.items()}
    field, errors = parts.structure.project(parts.basis, numbers, quantity)
    for name, error in errors.items():
        if error > 1e-6:
            where = f"bodies.{name}.{quantity}" if len(parts.structure.members) > 1 else quantity
            warnings.append(
                f"run.start.{where} is met by the reduced model to a relative error of {error:.2g} only: "
                "it breaks the supports' conditions or needs more modes (reduction: {modes: all})"
            )
    return field
