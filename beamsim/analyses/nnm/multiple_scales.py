"""A nonlinear normal mode by multiple scales, compared with the exact motion as the stiffness factor vanishes."""

from __future__ import annotations

import numpy as np

from beamsim.analyses.nnm.paths import ModeBranches, flexible_mode, held_energy, spring_family
from beamsim.analyses.nnm.result import SAFELY, ExactModes, ExpansionComparison, ExpansionPath
from beamsim.errors import locating
from beamsim.orbits.branch import BranchPoint
from beamsim.orbits.continuation import Settings, solve_at
from beamsim.orbits.expansions.free import (
    HARMONICS,
    ModeExpansion,
    expand_mode_at_energy,
    observed_orders,
)
from beamsim.orbits.free_orbits import BrakeOrbits
from beamsim.orbits.tongues import LEAST_SHARE
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats

ExactPoints = tuple[BrakeOrbits, list[BranchPoint | None]]  # shooting, and its motions

ORDERS = (0, 1, 2)
MOST_HARMONICS = 4000
NOISE = 5e-12  # relative differences below it are those of the exact motion's own convergence
FURTHEST = 0.3  # relative distance of an exact initial vector from the expansion's


def expansion_path(
    structure: StructuralSystem,
    mode: int,
    energy: float | None = None,
    factors: Floats | None = None,
    largest: float | None = None,
) -> ExpansionPath:
    """Expand a mode at one energy for several stiffness factors.

    Parameters
    ----------
    structure : without damping (see :func:`beamsim.analyses.nnm.analysis.conservative_system`).
    mode : its number, from 1.
    energy : J; may be left out where the motion doesn't depend on it (no gaps, loads or cubic springs).
    factors : of all nonlinear springs' stiffness; by default by halves down into the expansion's reach and on.
    largest : the factor to begin with then, by default a third of the reach.

    Returns
    -------
    ExpansionPath
        Frequencies and initial vectors to the orders 0, 1 and 2 at each factor.

    Raises
    ------
    ScenarioError
        At internal resonances, without nonlinear springs, or where the energy is missing.
    ValueError
        Where the structure is damped.
    """
    c = structure.dynamics.contacts.split()
    if np.any(structure.dynamics.damping) or c.damped:
        raise ValueError("nonlinear normal modes belong to the structure without damping; use conservative_system")
    index, family, held = flexible_mode(structure, mode), spring_family(structure), held_energy(structure, energy)
    away = float((c.sign @ c.shape)[index]) if c.count else 1.0
    # series are cut beyond the harmonics that are close to the highest modes
    highest = int(1.5 * float(family.omega.max() / max(float(family.omega[index]), 1e-300)))
    harmonics = min(max(HARMONICS, highest), MOST_HARMONICS)

    def expand(factor: float, order: int, uniform: bool = False) -> ModeExpansion:
        with locating({"mode": "nnm.mode", "energy": "nnm.energy", "expansion": "nnm.method"}):
            sign = -1.0 if away < 0 else 1.0
            return expand_mode_at_energy(family, index, held, factor, order, sign, harmonics, uniform)

    linear = expand(0.0, 0)
    chosen = np.asarray(factors, dtype=float)
    if factors is None:  # by halves into the reach, and on from there
        first = min(1.0, linear.reach / SAFELY) if largest is None else largest
        above = 0
        while first * 0.5**above > linear.reach / SAFELY:
            above += 1
        chosen = first * 0.5 ** np.arange(above + 7)
    n = structure.dynamics.size
    frequency = np.empty((chosen.size, 3))
    shape, uniform = np.empty((chosen.size, 3, n)), np.empty((chosen.size, 3, n))
    for i, factor in enumerate(chosen):
        for order in ORDERS:
            expansion = expand(float(factor), order)
            frequency[i, order] = expansion.frequency(float(factor), order) / (2 * np.pi)
            shape[i, order] = expansion.initial(float(factor), order)
            uniform[i, order] = expand(float(factor), order, uniform=True).initial(float(factor), order)
    return ExpansionPath(
        mode=mode,
        energy=held,
        linear_frequency_hz=linear.omega / (2 * np.pi),
        first_hz=linear.omega1 / (2 * np.pi),
        second_hz=linear.omega2 / (2 * np.pi),
        factor=chosen,
        frequency_hz=frequency,
        coordinates=shape,
        initial_displacement=shape @ structure.deflection.T,
        partner=linear.partner + 1,
        harmonic=linear.harmonic,
        reach=linear.reach,
        uniform_coordinates=uniform,
        pole=linear.pole,
        pole_mode=linear.pole_mode + 1,
        pole_harmonic=linear.pole_harmonic,
    )


def exact_points(structure: StructuralSystem, path: ExpansionPath, branches: ModeBranches | None = None) -> ExactPoints:
    """The exact motion at each factor of an expansion: that of a backbone, or by shooting from the expansion itself.

    Without a motion of the backbone it must be close to the expansion.

    Parameters
    ----------
    structure, path : the expansion.
    branches : the backbone in the stiffness factor; without it all motions are found from the expansion.

    Returns
    -------
    orbits : the shooting problem.
    points : in the order of the factors; None where Newton's method finds none or ends on another motion, in the tongue
        of an internal resonance or one that is run through twice.
    """
    family, mode = spring_family(structure), path.mode - 1
    orbits = BrakeOrbits(family, energy=path.energy) if branches is None else branches.problem
    points: list[BranchPoint | None] = [None] * path.factor.size
    weight = family.omega
    for i in np.argsort(path.factor):
        factor = float(path.factor[i])
        points[i] = None if branches is None else branches.at_factor(factor)
        if points[i] is not None:
            continue
        guess = path.coordinates[i, 2]
        period = 1.0 / path.frequency_hz[i, 2] if path.frequency_hz[i, 2] > 0 else 1.0 / path.linear_frequency_hz
        point = solve_at(orbits, orbits.unknowns(guess, period, factor), Settings(iterations=15), factor)
        if point is None:
            continue
        q = point.u[: orbits.n]
        far = np.linalg.norm(weight * (q - guess)) > FURTHEST * np.linalg.norm(weight * q)
        own_mode = orbits.share_at(point)[mode] > LEAST_SHARE and orbits.swings_once(point, mode)
        points[i] = point if own_mode and not far else None
    return orbits, points


def compare_expansion(
    structure: StructuralSystem, path: ExpansionPath, exact: ExactPoints | None = None
) -> ExpansionComparison:
    """Differences from the exact motion and the orders in which they vanish with the factor.

    Parameters
    ----------
    structure, path : the expansion.
    exact : as of `exact_points`; by default found from the expansion.

    Returns
    -------
    ExpansionComparison
        NaN at factors without an exact motion.
    """
    orbits, points = exact_points(structure, path) if exact is None else exact
    frequency_hz, residual = np.full((2, len(points)), np.nan)
    shape = np.full((len(points), orbits.n), np.nan)
    for i, point in enumerate(points):
        if point is not None:
            orbit = orbits.orbit(point)
            frequency_hz[i], shape[i], residual[i] = orbit.frequency_hz, orbit.state[: orbits.n], orbit.residual
    modes = ExactModes(frequency_hz, shape, shape @ structure.deflection.T, residual)
    weight = np.sqrt(structure.dynamics.stiffness)
    frequency = np.abs(path.frequency_hz / modes.frequency_hz[:, None] - 1.0)
    size = np.linalg.norm(modes.coordinates * weight, axis=1)

    def away(shapes: Floats, reference: Floats) -> Floats:
        return np.asarray(np.linalg.norm((shapes - reference[:, None, :]) * weight, axis=2) / size[:, None])

    def orders(difference: Floats) -> Floats:
        known = np.where(difference > NOISE, difference, np.nan)
        return np.array([observed_orders(path.factor, known[:, k]) for k in ORDERS]).T

    initial = away(path.coordinates, modes.coordinates)
    uniform = away(path.uniform_coordinates, modes.coordinates)
    expected = away(path.coordinates, path.uniform_coordinates[:, 2])
    return ExpansionComparison(
        path=path,
        exact=modes,
        frequency_difference=frequency,
        initial_difference=initial,
        frequency_orders=orders(frequency),
        initial_orders=orders(initial),
        expected_orders=orders(expected),
        uniform_difference=uniform,
        uniform_orders=orders(uniform),
    )
