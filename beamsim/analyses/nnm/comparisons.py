"""Other methods for a nonlinear normal mode, compared with the exact motion.

Multiple scales for a vanishing stiffness factor, and relaxed minimisation (Hazim 2010) with its range, accuracy and
cost.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from beamsim.analyses.nnm.layouts import MULTIPLE_SCALES, RELAXED_MINIMISATION
from beamsim.analyses.nnm.paths import ModeBranches, ModePath, energy_of_factors, flexible_mode, spring_family
from beamsim.errors import locating
from beamsim.flow.compiled import processor_time
from beamsim.labelled import Dataset
from beamsim.orbits.branch import BranchPoint
from beamsim.orbits.continuation import Settings, solve_at
from beamsim.orbits.expansions.free import HARMONICS, ModeAtEnergy, ModeExpansion, observed_orders
from beamsim.orbits.expansions.relaxed import RelaxedStep, relaxed_path
from beamsim.orbits.free_orbits import BrakeOrbits
from beamsim.orbits.tongues import LEAST_SHARE
from beamsim.outcomes import COMPLETE, Outcome, OutcomeKind, Progress, Where, interruption, report_progress, until_stop
from beamsim.results.branch import endings
from beamsim.scenario.sweep import RelaxedMinimisationMethod
from beamsim.system.structural import StructuralSystem
from beamsim.typing import TINY, Bools, Floats, Ints

ExactPoints = tuple[BrakeOrbits, list[BranchPoint | None]]  # shooting problem, and its motions

ORDERS = (0, 1, 2)
SMALL_FACTOR_MARGIN = 3.0  # factors this much below the limit of the expansion count as small
MOST_HARMONICS = 4000
NOISE = 5e-12  # relative differences below it are the convergence error of the exact motion
LARGEST_DISTANCE = 0.3  # largest relative distance of an exact initial vector from the expansion's


@dataclass(frozen=True)
class ExpansionPath:
    """Frequency and initial condition of a mode of n coordinates to orders 0, 1 and 2, at F stiffness factors.

    The fields are variables of `MULTIPLE_SCALES`.
    """

    mode: int  # from 1
    energy: float
    linear_frequency_hz: float
    first_hz: float
    second_hz: float
    factor: Floats  # (F,)
    frequency_hz: Floats  # (F, 3)
    coordinates: Floats  # (F, 3, n) the shape at rest at t = 0
    initial_displacement: Floats  # (F, 3, nx)
    coupled_mode: int
    harmonic: int
    reach: float
    uniform_coordinates: Floats  # (F, 3, n)
    pole: float
    pole_mode: int
    pole_harmonic: int

    @property
    def small(self) -> float:
        """Largest factor that counts as small."""
        return self.reach / SMALL_FACTOR_MARGIN * (1.0 + 1e-9)


@dataclass(frozen=True)
class ExactModes:
    """Exact motions at the same energy, by shooting; NaN if none was found near the expansion."""

    frequency_hz: Floats  # (F,)
    coordinates: Floats  # (F, n)
    initial_displacement: Floats  # (F, nx)
    residual: Floats  # (F,)


@dataclass(frozen=True)
class ExpansionComparison:
    """Expansion compared with the exact motion; see `MULTIPLE_SCALES`."""

    path: ExpansionPath
    exact: ExactModes
    frequency_difference: Floats  # (F, 3)
    initial_difference: Floats  # (F, 3)
    frequency_orders: Floats  # (F - 1, 3)
    initial_orders: Floats  # (F - 1, 3)
    expected_orders: Floats  # (F - 1, 3)
    uniform_difference: Floats  # (F, 3)
    uniform_orders: Floats  # (F - 1, 3)

    @property
    def dataset(self) -> Dataset:
        """Build the labelled dataset."""
        path, of_self = vars(self.path), {k: v for k, v in vars(self).items() if k not in ("path", "exact")}
        exact = {f"exact_{name}": of for name, of in vars(self.exact).items()}
        counted = {
            "order": np.array(ORDERS),
            "step": _numbers(self.path.factor.size - 1),
            "coordinate": _numbers(self.path.coordinates.shape[-1]),
            "station": _numbers(self.path.initial_displacement.shape[-1]),
        }
        return MULTIPLE_SCALES.dataset({**path, **of_self, **exact, **counted})


@dataclass(frozen=True)
class RelaxedComparison:
    """Path of S steps of relaxed minimisation, compared with the exact motions at the same factors.

    The fields are variables of `RELAXED_MINIMISATION`.
    """

    steps: int  # requested number
    tolerance: float
    outcome: Outcome
    factor: Floats  # (S,) of the computed steps; the last may not have converged
    frequency_hz: Floats  # (S,)
    functional: Floats  # (S,)
    motions: Ints  # (S,)
    processor_time_s: Floats  # (S,)
    converged: Bools  # (S,)
    coordinates: Floats  # (S, n)
    initial_displacement: Floats  # (S, nx)
    exact_frequency_hz: Floats  # (S,)
    frequency_difference: Floats  # (S,)
    shape_difference: Floats  # (S,)
    nearby_motion: Sequence[str]  # (S,)
    jumped: Bools  # (S,)
    shooting_motions: int
    shooting_processor_time_s: float

    @property
    def cost_ratio(self) -> float:
        """Processor time divided by that of shooting."""
        return float(self.processor_time_s.sum() / max(self.shooting_processor_time_s, 1e-9))

    @property
    def dataset(self) -> Dataset:
        """Build the labelled dataset."""
        values: dict[str, Any] = {name: of for name, of in vars(self).items() if name != "outcome"}
        values |= {name: text for name, (text,) in endings([self.outcome]).items()}
        counted = {
            "coordinate": _numbers(self.coordinates.shape[1]),
            "station": _numbers(self.initial_displacement.shape[1]),
        }
        return RELAXED_MINIMISATION.dataset(values | counted)


def _numbers(count: int) -> Ints:
    return np.arange(1, count + 1)


def expansion_path(
    structure: StructuralSystem, mode: int, energy: float | None = None, factors: Floats | None = None,
    largest: float | None = None,
) -> ExpansionPath:  # fmt: skip
    """Expand a mode in the stiffness factor at one energy.

    Parameters
    ----------
    structure : structure without damping (see :func:`beamsim.analyses.nnm.analysis.conservative_system`).
    mode : number of the mode, from 1.
    energy : J; optional if the motion does not depend on it (no gaps, loads or cubic springs).
    factors : factors on the stiffness of all nonlinear springs; by default halves down into the range of validity.
    largest : largest of the default factors; by default a third of the range of validity.

    Returns
    -------
    ExpansionPath
        Frequencies and initial vectors to the orders 0, 1 and 2 at each factor.

    Raises
    ------
    ScenarioError
        At internal resonances, without nonlinear springs, or if the energy is missing.
    ValueError
        If the structure is damped.
    """
    c = structure.dynamics.contacts.split()
    if np.any(structure.dynamics.damping) or c.damped:
        raise ValueError("nonlinear normal modes need a structure without damping; use conservative_system")
    index, family = flexible_mode(structure, mode), spring_family(structure)
    sign, held = -1.0 if c.count and (c.sign @ c.shape)[index] < 0 else 1.0, energy_of_factors(structure, energy)
    of_mode = ModeAtEnergy(family, index, held, sign, _harmonics(family.omega, index))

    def expand(factor: float, order: int, uniform: bool = False) -> ModeExpansion:
        with locating({"mode": "nnm.mode", "energy": "nnm.energy", "expansion": "nnm.method"}):
            return of_mode.expand(factor, order, uniform=uniform)

    linear = expand(0.0, 0)
    chosen = _factors_into_reach(linear.reach, largest) if factors is None else np.asarray(factors, dtype=float)
    frequency, shape, uniform = _at_factors(expand, chosen, structure.dynamics.size)
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
        coupled_mode=linear.coupled_mode + 1,
        harmonic=linear.harmonic,
        reach=linear.reach,
        uniform_coordinates=uniform,
        pole=linear.pole,
        pole_mode=linear.pole_mode + 1,
        pole_harmonic=linear.pole_harmonic,
    )


BEYOND_MODES = 1.5  # highest harmonic of a series over the highest mode


def _harmonics(omega: Floats, index: int) -> int:
    """Number of harmonics in the series of a mode, for natural frequencies (n,), rad/s."""
    highest = int(BEYOND_MODES * float(omega.max() / max(float(omega[index]), TINY)))
    return min(max(HARMONICS, highest), MOST_HARMONICS)


def _at_factors(expand: Callable[..., ModeExpansion], factors: Floats, n: int) -> tuple[Floats, Floats, Floats]:
    """Frequency, Hz, initial vector, and initial vector of the uniform expansion at each factor.

    Parameters
    ----------
    expand : function from factor and order to the expansion.
    factors : (f,) stiffness factors.
    n : number of coordinates.

    Returns
    -------
    frequency, shape, uniform : (f, 3), (f, 3, n) twice; to the orders 0, 1 and 2.
    """
    frequency = np.empty((factors.size, 3))
    shape, uniform = np.empty((factors.size, 3, n)), np.empty((factors.size, 3, n))
    for i, factor in enumerate(factors.tolist()):
        for order in ORDERS:
            expansion = expand(factor, order)
            frequency[i, order] = expansion.frequency(factor, order) / (2 * np.pi)
            shape[i, order] = expansion.initial(factor, order)
            uniform[i, order] = expand(factor, order, uniform=True).initial(factor, order)
    return frequency, shape, uniform


FACTORS_IN_REACH = 7  # number of factors within the range of validity


def _factors_into_reach(reach: float, largest: float | None) -> Floats:
    """Factors by halves down into the range of validity of an expansion, and on from there."""
    first = min(1.0, reach / SMALL_FACTOR_MARGIN) if largest is None else largest
    above = 0
    while first * 0.5**above > reach / SMALL_FACTOR_MARGIN:
        above += 1
    return np.asarray(first * 0.5 ** np.arange(above + FACTORS_IN_REACH))


def exact_points(structure: StructuralSystem, path: ExpansionPath, branches: ModeBranches | None = None) -> ExactPoints:
    """Exact motion at each factor of an expansion, from a backbone or by shooting from the expansion itself.

    A motion that was found from the expansion must be close to it.

    Parameters
    ----------
    structure, path : the expansion.
    branches : backbone in the stiffness factor; without it all motions are found from the expansion.

    Returns
    -------
    orbits : the shooting problem.
    points : in the order of the factors; None if Newton's method finds no motion or another one: in the tongue of an
    internal resonance, or a motion that repeats within its period.
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
        far = np.linalg.norm(weight * (q - guess)) > LARGEST_DISTANCE * np.linalg.norm(weight * q)
        own_mode = orbits.share_at(point)[mode] > LEAST_SHARE and orbits.swings_once(point, mode)
        points[i] = point if own_mode and not far else None
    return orbits, points


def compare_expansion(
    structure: StructuralSystem, path: ExpansionPath, exact: ExactPoints | None = None
) -> ExpansionComparison:
    """Differences from the exact motion, and the orders at which they vanish with the factor.

    Parameters
    ----------
    structure, path : the expansion.
    exact : result of `exact_points`; by default found from the expansion.

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

    def distances(shape: Floats, reference: Floats) -> Floats:
        return np.asarray(np.linalg.norm((shape - reference[:, None, :]) * weight, axis=2) / size[:, None])

    def orders(difference: Floats) -> Floats:
        known = np.where(difference > NOISE, difference, np.nan)
        return np.array([observed_orders(path.factor, known[:, k]) for k in ORDERS]).T

    initial = distances(path.coordinates, modes.coordinates)
    uniform = distances(path.uniform_coordinates, modes.coordinates)
    expected = distances(path.coordinates, path.uniform_coordinates[:, 2])
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


SAME_SHAPE = 1e-6  # relative distance within which two shapes are the same motion
# relative distance of the exact motions at neighbouring steps above which they are not on one branch
LARGEST_STEP = 0.25


def compare_relaxed(
    job: ModePath,
    branches: ModeBranches,
    shooting_time_s: float,
    settings: RelaxedMinimisationMethod,
    progress: Progress = None,
) -> RelaxedComparison:
    """Take steps of relaxed minimisation along a backbone computed by shooting, and compare.

    Parameters
    ----------
    job, branches : path and branches of the backbone in the stiffness factor.
    shooting_time_s : processor time of shooting so far, s.
    settings : steps, tolerance and iterations.
    progress : called with the completed fraction of the steps.

    Returns
    -------
    RelaxedComparison
        Steps up to the first that misses the tolerance (included), or up to an interruption.
    """
    orbits, points = branches.problem, branches.backbone.points
    factors = np.linspace(job.first, job.last, settings.steps + 1)[1:]
    begin = processor_time()
    exact = [branches.at_factor(float(factor)) for factor in factors]
    shooting_motions = orbits.family.motions_computed
    shooting_time_s += processor_time() - begin
    steps: list[RelaxedStep] = []
    for step in until_stop(relaxed_path(orbits, points[0].u, factors, settings.tolerance, settings.iterations)):
        steps.append(step)
        report_progress(progress, len(steps) / settings.steps)
        if not step.converged:
            break
    apart, nearby, jumped = _errors_against_exact(orbits, steps, exact)
    shapes, frequency = np.array([s.shape for s in steps]), np.array([1.0 / s.period for s in steps])
    known = np.array([np.nan if e is None else 1.0 / float(e.u[-2]) for e in exact[: len(steps)]])
    return RelaxedComparison(
        steps=settings.steps,
        tolerance=settings.tolerance,
        outcome=_end_of_steps(steps, settings),
        factor=np.array([s.factor for s in steps]),
        frequency_hz=frequency,
        functional=np.array([s.functional for s in steps]),
        motions=np.array([s.motions for s in steps], dtype=np.int64),
        processor_time_s=np.array([s.processor_time_s for s in steps]),
        converged=np.array([s.converged for s in steps], dtype=bool),
        coordinates=shapes,
        initial_displacement=shapes @ job.system.deflection.T,
        exact_frequency_hz=known,
        frequency_difference=np.abs(frequency / known - 1.0),
        shape_difference=apart,
        nearby_motion=nearby,
        jumped=jumped,
        shooting_motions=shooting_motions,
        shooting_processor_time_s=shooting_time_s,
    )


def _end_of_steps(steps: Sequence[RelaxedStep], settings: RelaxedMinimisationMethod) -> Outcome:
    """Outcome of the steps: why they ended."""
    last = Where(steps[-1].factor, "", "stiffness factor")
    if not steps[-1].converged:
        code, sentence, remedy = (
            "too_few_iterations",
            f"the limit of {settings.iterations} iterations is reached",
            ("raise nnm.method.iterations, steps or the tolerance"),
        )
        if steps[-1].stalled:
            code, sentence = "no_descent", "no further descent was found"
            remedy = "use more nnm.method.steps or a larger tolerance"
        return Outcome.of(
            OutcomeKind.STOPPED, code,
            f"the functional of relaxed minimisation is {steps[-1].functional:.3g}, the tolerance "
            f"{settings.tolerance:g}; {sentence}", at=last, remedy=remedy,
        )  # fmt: skip
    return COMPLETE if len(steps) == settings.steps else interruption("during relaxed minimisation", at=last)


def _errors_against_exact(
    orbits: BrakeOrbits, steps: Sequence[RelaxedStep], exact: Sequence[BranchPoint | None]
) -> tuple[Floats, list[str], Bools]:
    """Compare steps of relaxed minimisation with exact motions.

    Parameters
    ----------
    orbits : shooting problem of the exact motions.
    steps : the s steps.
    exact : motions at the same stiffness factors, or None; at least s.

    Returns
    -------
    (s,) relative differences of the shapes; exact motion that Newton's method reaches from each step (see
    `RelaxedComparison`); (s,) True if the step jumped to another motion than the step before.
    """
    n, apart = orbits.n, np.full(len(steps), np.nan)
    nearby: list[str] = []
    jumped: list[bool] = []
    last: Floats | None = None  # the exact motion compared with the previous step
    for k, (step, point) in enumerate(zip(steps, exact, strict=False)):
        if point is not None:
            apart[k] = _distance(orbits, step.shape, point.u[:n])
        near = solve_at(orbits, orbits.unknowns(step.shape, step.period, step.factor), Settings(iterations=15))
        nearby.append("none" if near is None else "between" if point is None else "other")
        if near is not None and point is not None:
            same = _distance(orbits, near.u[:n], point.u[:n]) < SAME_SHAPE
            nearby[-1] = "same" if same and abs(near.u[-2] / point.u[-2] - 1.0) < SAME_SHAPE else "other"
        here = None if near is None else near.u[:n]
        jumped.append(nearby[-1] in ("other", "none") and (k == 0 or nearby[-2] in ("same", "between")))
        if nearby[-1] == "other" and not jumped[-1] and last is not None and here is not None:
            jumped[-1] = _distance(orbits, here, last) > LARGEST_STEP
        last = here
    return apart, nearby, np.array(jumped, dtype=bool)


def _distance(orbits: BrakeOrbits, shape: Floats, other: Floats) -> float:
    """Distance of two shapes at rest, relative to the second, in the norm of the linear strain energy."""
    w = orbits.family.omega
    return float(np.linalg.norm(w * (shape - other)) / max(float(np.linalg.norm(w * other)), TINY))
