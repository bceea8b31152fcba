"""Periodic motions of the forced system by shooting, and the special points of their branches.

A motion of period :math:`T = 2\\pi j/\\omega` solves :math:`z(T; z_0, \\lambda) - z_0 = 0`, z being the state (q, q')
with the contacts' internal states. The Jacobian is the monodromy matrix less one, exact
(:mod:`beamsim.flow.variational`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, MutableMapping
from dataclasses import field
from typing import Literal
from weakref import WeakKeyDictionary

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.flow.passage import Direction, Frequency, Level, Parameter, Passage, StructureDirection
from beamsim.flow.periodic_flow import PeriodicFlow
from beamsim.flow.variational import floquet_multipliers
from beamsim.orbits.branch import BranchPoint, FailedSearch, Orbit, SpecialPoint, recorded
from beamsim.orbits.continuation import (
    Settings,
    between,
    branch_point_between,
    correct,
    follow_orbits,
    locate,
    solve_at,
)
from beamsim.orbits.grazing import cyclic, grazings, smooth_pieces, turned_at
from beamsim.orbits.paths import DampingPath
from beamsim.typing import Complexes, Floats

STABLE = 1e-9  # a multiplier's modulus may exceed one by this much
AT_FOLD = 1e-3  # of the tangent's part along the parameter at the neighbours: what a fold leaves of it
AT_BOUNDARY = 1e-5  # distance of a multiplier from where a located point says that it is
NEAR_MINUS_ONE = 0.1  # distance of a multiplier within which a step is looked into for a pair of period doublings
NEAR_CIRCLE = 0.02  # the same for complex multipliers and two Neimark–Sacker points
EARLY = 30  # periods of a transient before the path of falling damping is tried
MOST_DAMPED = 400  # points of that path
FIRST_AMPLITUDE = 0.01  # of a motion of another branch beside the one that it leaves, over that one's size
RESTS = 1e-7  # change of a slider by a unit of the state, over a period, that is round-off
GUESSED_RATIO = 0.01  # least damping ratio in a first guess, which must have a bound at resonance


@dataclass
class ForcedOrbits:
    """Shooting for periodic motions as a continuation problem.

    Parameters
    ----------
    flow : system and loads; later the one last asked for.
    parameter : the continuation parameter: ``"frequency"`` (rad/s), ``"level"``, or a path of systems (stiffness, gap,
        position …).
    multiple : periods of the excitation in one of the motion.
    """

    flow: PeriodicFlow
    parameter: Literal["frequency", "level"] | Callable[[float], tuple[PeriodicFlow, Direction]] = "frequency"
    multiple: int = 1
    _moved: tuple[float, PeriodicFlow, Direction] | None = field(default=None, repr=False)
    _spectra: MutableMapping[Passage, Complexes] = field(default_factory=WeakKeyDictionary, repr=False)

    def __post_init__(self) -> None:
        contacts = self.flow.system.contacts
        self._one = np.eye(self.flow.size)
        self._smallest = max(1e-3 * float(np.max(np.abs(contacts.clearances), initial=0.0)), 1e-30)
        self._n2 = 2 * self.flow.system.size
        self._may_rest = np.vstack([self._one[self._n2 + contacts.sliders], self._faces()])
        self.omega, self.level = self.flow.omega, self.flow.level

    def _faces(self) -> Floats:
        """(k, N) unit rows of the displacements that contacts may hold."""
        contacts = self.flow.system.contacts
        shapes = contacts.shape[contacts.may_hold]
        rows = np.zeros((shapes.shape[0], self.flow.size))
        rows[:, : shapes.shape[1]] = shapes / np.linalg.norm(shapes, axis=1, keepdims=True)
        return rows

    def with_multiple(self, multiple: int) -> ForcedOrbits:
        """The same problem for another multiple of the excitation's period."""
        other = ForcedOrbits(self.flow, self.parameter, multiple)
        other.omega, other.level = self.omega, self.level
        return other

    @property
    def value(self) -> float:
        """The parameter's value in the flow as it is (frequency and level)."""
        return self.omega if self.parameter == "frequency" else self.level

    def flow_at(self, value: float) -> tuple[PeriodicFlow, Direction | None]:
        """The flow with its parameter set."""
        if self.parameter == "frequency":
            if value <= 0:
                raise ArithmeticError("the frequency became negative")
            self.flow = self.flow.under(value, self.level)
            return self.flow, None
        if self.parameter == "level":
            self.flow = self.flow.under(self.omega, value)
            return self.flow, None
        if self._moved is None or self._moved[0] != value:
            self._moved = (value, *self.parameter(value))
        return self._moved[1].under(self.omega, self.level), self._moved[2]

    def residual(self, u: Floats) -> tuple[Floats, Floats, Passage]:
        """``z(T) - z(0)`` with its Jacobian."""
        flow, direction = self.flow_at(float(u[-1]))
        period = 2 * np.pi * self.multiple / flow.omega
        parameter: Parameter
        parameter = direction if direction is not None else Frequency() if self.parameter == "frequency" else Level()
        z = u[:-1]
        passage = flow.carry(z, period, (parameter,))
        J = np.empty((z.size, z.size + 1))
        J[:, :-1] = passage.transition - self._one
        J[:, -1] = passage.parameters[:, 0]
        if self.parameter == "frequency":
            J[:, -1] -= passage.slope * (period / flow.omega)
        change = passage.end - z
        resting = self._resting(passage)
        # as of a slider that is set anew: the determinant keeps its sign where sliding begins
        J -= resting.T @ (resting @ J)
        J[:, :-1] -= resting.T @ resting
        return change - resting.T @ (resting @ change), J, passage

    def _resting(self, passage: Passage) -> Floats:
        """(k, N) orthonormal rows of what a motion leaves where it is.

        These are sliders of friction and hardening, and faces that stick without a spring. Any place of theirs is
        periodic: the equation says that Newton's method leaves them there too.
        """
        candidates = self._may_rest
        if not candidates.shape[0]:
            return candidates
        change = candidates @ passage.transition - candidates
        n = self._n2 // 2
        change[:, n : 2 * n] *= self.flow.omega
        resting = candidates[np.abs(change).max(axis=1) < RESTS]
        _, size, rows = np.linalg.svd(resting, full_matrices=False)
        return np.asarray(rows[size > RESTS])  # of several that are held at one place one is enough

    def scale(self, u: Floats) -> tuple[Floats, Floats]:
        """Displacements by the largest amplitude of the state, velocities by it times omega."""
        n = self._n2 // 2
        omega = u[-1] if self.parameter == "frequency" else self.omega
        v = u[n : 2 * n] / omega
        size = max(float(np.sqrt(u[:n] @ u[:n] + v @ v)), self._smallest)
        scale = np.full(u.size, size)
        scale[n : 2 * n] *= omega
        residual = scale[:-1].copy()
        scale[-1] = max(abs(u[-1]), 1e-12)
        return scale, residual

    def multipliers(self, point: BranchPoint) -> Complexes:
        """Floquet multipliers, the largest first; computed once for each motion."""
        values = self._spectra.get(point.data)
        if values is None:
            values = self._spectra[point.data] = floquet_multipliers(self.monodromy(point))
        return values

    def cycle(self, point: BranchPoint) -> tuple[PeriodicFlow, Passage]:
        """The flow at a point, and its motion over a period."""
        return self.flow_at(point.parameter)[0], point.data

    def same_events(self, a: BranchPoint, b: BranchPoint) -> bool:
        """Whether two motions have the same cyclic order of contacts."""
        sa, sb = a.data.signature, b.data.signature
        return bool(sa == sb) or (len(sa) == len(sb) and cyclic(a.data) == cyclic(b.data))

    def orbit(self, point: BranchPoint) -> Orbit:
        """What a converged point means."""
        mu = self.multipliers(point)
        stable = bool(np.abs(mu[0]) <= 1.0 + STABLE)
        return Orbit(point.parameter, point.u[:-1], point.data.duration, mu, stable, point.residual)

    def monodromy(self, point: BranchPoint) -> Floats:
        """The monodromy matrix over the free unknowns."""
        return np.asarray(point.data.transition)


def linear_guess(flow: PeriodicFlow) -> Floats:
    """The response of the open structure at t = 0, as a first guess; lightly damped modes have one per cent there."""
    n = flow.system.size
    force, _, _, _ = flow.loads.at(flow.omega, flow.level)
    z = np.zeros(flow.size)
    K, C = np.diag(flow.system.stiffness), flow.system.damping
    least = 2.0 * GUESSED_RATIO * np.sqrt(flow.system.stiffness)
    C = C + np.diag(np.maximum(least - np.diag(C), 0.0))
    with np.errstate(divide="ignore"):
        z[:n] = np.where(flow.system.stiffness > 0, flow.system.constant_load / flow.system.stiffness, 0.0)
    for h in range(flow.loads.count):
        w = flow.loads.multiple[h] * flow.omega
        q = np.linalg.solve(K - w**2 * np.eye(n) + 1j * w * C, force[h])
        z[:n] += q.real
        z[n : 2 * n] += (1j * w * q).real
    return z


def find_orbit(
    problem: ForcedOrbits,
    guess: Floats | None = None,
    *,
    settings: Settings | None = None,
    settle: int = 300,
    forward: float = 1.0,
) -> BranchPoint | None:
    """A periodic motion at the present parameter: Newton from a guess, else one that is well determined.

    Without a guess a stable motion is looked for: Newton from the linear response and from the ends of ever longer
    transients. Where they find none early, the motion that continues the linear response is followed from heavy
    damping down to the structure's own, whatever its stability; longer transients come last. An unstable motion that
    Newton happens to find on the way is taken only if nothing else is: at low frequencies there are many, on branches
    that need not lead anywhere.

    Returns None where nothing converges (no motion of this period is reached within ``settle`` periods).
    """
    settings = Settings(iterations=25) if settings is None else settings
    value = problem.value if isinstance(problem.parameter, str) else 0.0
    flow, _ = problem.flow_at(value)
    z = linear_guess(flow) if guess is None else guess.copy()
    period = 2 * np.pi * problem.multiple / flow.omega
    done, chance = 0, None
    for target in (0, 3, 10, 30, 100, settle):
        if target > EARLY and guess is None:
            point = _from_heavy_damping(problem, flow, value, settings, forward) if done <= EARLY else None
            if point is not None:
                return point
        while done < target:
            z = flow.carry(z, period).end
            done += 1
        point = solve_at(problem, np.append(z, value), settings, value, forward)
        if point is not None and (guess is not None or problem.orbit(point).stable):
            return point
        chance = point if chance is None else chance
    return chance


def _from_heavy_damping(
    problem: ForcedOrbits, flow: PeriodicFlow, value: float, settings: Settings, forward: float
) -> BranchPoint | None:
    """The motion at the end of a path of falling damping."""
    if StructureDirection not in flow.differentiates:
        return None
    path = DampingPath(flow)
    damped = ForcedOrbits(flow, path, problem.multiple)
    heavy, _ = damped.flow_at(path.heavy)
    period = 2 * np.pi * problem.multiple / flow.omega
    z = linear_guess(heavy)
    for _ in range(EARLY):
        z = heavy.carry(z, period).end
    start = solve_at(damped, np.append(z, path.heavy), settings, path.heavy, -1.0)
    if start is None:
        return None
    branch = follow_orbits(damped, start, 1.0, 2.0 * path.heavy, Settings(largest_step=0.2, most_points=MOST_DAMPED))
    last = list(branch)[-1]
    if last.parameter != 1.0:
        return None
    return solve_at(problem, np.append(last.u[:-1], value), settings, value, forward)


def _period_doubling_test(problem: ForcedOrbits) -> Callable[[BranchPoint], float]:
    def test(point: BranchPoint) -> float:
        mu = problem.multipliers(point)
        return float(np.prod((1.0 + mu) / (1.0 + np.abs(mu))).real)

    return test


def _neimark_sacker_test(problem: ForcedOrbits) -> Callable[[BranchPoint], float]:
    def test(point: BranchPoint) -> float:
        mu = problem.multipliers(point)
        i, j = np.triu_indices(mu.size, 1)
        pair = mu[i] * mu[j]
        return float(np.prod((pair - 1.0) / (1.0 + np.abs(pair))).real)

    return test


def special_points(
    problem: ForcedOrbits, a: BranchPoint, b: BranchPoint, settings: Settings, failed: list[FailedSearch] | None = None
) -> list[SpecialPoint]:
    """Folds, period doublings, Neimark–Sacker points, branch points and grazings between two neighbours.

    A change of stability at a corner of the branch (grazing) is no bifurcation of a smooth family and is left to the
    grazing point. A grazing at which the branch turns back, without a multiplier 1, is a nonsmooth fold. A search that
    ends in a numerical error is appended to ``failed``, and the others go on; without a list the error is raised.
    """
    special: list[SpecialPoint] = []
    smooth = problem.same_events(a, b)
    if not smooth:
        with recorded("grazing", a, failed):
            special.extend(grazings(problem, a, b, settings))
            if _in_one_alone(problem, a, b) - {point.contact for point in special}:
                raise ArithmeticError("a contact begins between two neighbours, and no grazing was found")
    parts: list[tuple[tuple[BranchPoint, BranchPoint], BranchPoint, BranchPoint]] = []
    for x, y in smooth_pieces(a, b, special):
        with recorded("neimark_sacker", a, failed):
            parts += [((x, y), *part) for part in _parts(problem, x, y, settings, (x is not a, y is not b))]
    for piece, left, right in parts:
        if left.tangent[-1] * right.tangent[-1] < 0:
            with recorded("fold", a, failed):
                fold = locate(problem, left, right, lambda p: float(p.tangent[-1]), settings)
                if fold is not None:
                    ends = min(abs(float(left.tangent[-1])), abs(float(right.tangent[-1])))
                    if abs(float(fold.tangent[-1])) <= AT_FOLD * ends:
                        special.append(SpecialPoint("fold", fold.parameter, fold))
                    elif not turned_at(special, piece, fold):
                        raise ArithmeticError("the branch turns back at a corner that was not found")
        if smooth:
            with recorded("branch_point", a, failed):
                crossing = branch_point_between(problem, left, right, settings)
                if crossing is not None:
                    special.append(SpecialPoint("branch_point", crossing.parameter, crossing))
        with recorded("period_doubling", a, failed):  # or Neimark–Sacker point
            special += _changes_of_stability(problem, left, right, settings)
    return special


def _in_one_alone(problem: ForcedOrbits, a: BranchPoint, b: BranchPoint) -> set[int]:
    """One-sided contacts that are made and lost in one motion and not in the other."""
    contacts = problem.cycle(a)[0].system.contacts
    made = (set(problem.cycle(point)[1].event_contact.tolist()) for point in (a, b))
    return (
        set.symmetric_difference(*made)
        - set(np.flatnonzero(contacts.may_hold).tolist())
        - set(contacts.pressed.tolist())
    )


def _changes_of_stability(
    problem: ForcedOrbits, left: BranchPoint, right: BranchPoint, settings: Settings
) -> Iterator[SpecialPoint]:
    """Period doublings and Neimark–Sacker points between two motions with the same contacts."""
    (flips, turns, outside), (flips_right, turns_right, outside_right) = (
        _outside(problem.multipliers(p)) for p in (left, right)
    )
    if (flips - flips_right) % 2:
        point = locate(problem, left, right, _period_doubling_test(problem), settings)
        if point is not None and np.min(np.abs(problem.multipliers(point) + 1.0)) < AT_BOUNDARY:
            yield SpecialPoint("period_doubling", point.parameter, point)
    if turns != turns_right or outside != outside_right:
        point = locate(problem, left, right, _neimark_sacker_test(problem), settings)
        if point is not None:
            mu = problem.multipliers(point)
            circle = np.abs(np.abs(mu) - 1.0) < 0.1 * AT_BOUNDARY
            if np.any(circle & (np.abs(mu.imag) > 0.1 * AT_BOUNDARY)):
                yield SpecialPoint("neimark_sacker", point.parameter, point)


def _outside(mu: Complexes) -> tuple[int, int, int]:
    """Multipliers outside the unit circle: real negative ones, complex ones, all."""
    out = np.abs(mu) > 1.0
    turning = mu.imag != 0.0
    return (
        int(np.count_nonzero(out & ~turning & (mu.real < 0))), int(np.count_nonzero(out & turning)),
        int(np.count_nonzero(out)),
    )  # fmt: skip


def _parts(
    problem: ForcedOrbits, a: BranchPoint, b: BranchPoint, settings: Settings, corner: tuple[bool, bool]
) -> Iterator[tuple[BranchPoint, BranchPoint]]:
    """A step, or two parts of it where a pair of special points may hide between its ends.

    Two folds: where the parameter's cubic through both ends with their tangents turns, though both ends point the same
    way. Two period doublings, or two Neimark–Sacker points: where a multiplier close to -1, or a complex one to the
    unit circle, stays inside, or outside, at both ends. Beside a grazing point (``corner``, for either end) multipliers
    change with the square root of the distance: the motion a quarter away is half-way between them.
    """
    if a is b:
        return
    share = _hidden_turn(a, b)
    if share is None and any(corner):
        share = 0.5 if all(corner) else 0.25 if corner[0] else 0.75
    elif share is None:
        for mu in (problem.multipliers(a), problem.multipliers(b)):
            turning = mu[np.abs(mu.imag) > AT_BOUNDARY]
            if np.any(np.abs(mu + 1.0) < NEAR_MINUS_ONE) or np.any(np.abs(np.abs(turning) - 1.0) < NEAR_CIRCLE):
                share = 0.5
    middle = None if share is None else between(problem, a, b, share, settings)
    if middle is None:
        yield a, b
    elif any(corner):
        yield from _parts(problem, a, middle, settings, (False, False))
        yield from _parts(problem, middle, b, settings, (False, False))
    else:
        yield a, middle
        yield middle, b


def _hidden_turn(a: BranchPoint, b: BranchPoint) -> float | None:
    """Where the parameter's cubic over a step has its extreme slope, if that is of another sign than both ends'."""
    scale = a.scale
    at_a, at_b = float(a.tangent[-1]), float(b.tangent[-1] * b.scale[-1] / scale[-1])
    if at_a * at_b <= 0:
        return None
    mean = float((b.u[-1] - a.u[-1]) / scale[-1]) / float(np.linalg.norm((b.u - a.u) / scale))
    bend = 3.0 * (at_a + at_b) - 6.0 * mean  # the slope is left + (…) x + bend x^2
    if bend == 0.0:
        return None
    x = (2.0 * at_a + at_b - 3.0 * mean) / bend
    if not 0.0 < x < 1.0 or (at_a - bend * x**2) * at_a > 0:
        return None
    return x


def switch_at_period_doubling(problem: ForcedOrbits, special: SpecialPoint) -> tuple[ForcedOrbits, BranchPoint] | None:
    """The first motion of the branch of doubled period that leaves at a period doubling.

    The eigenvector of the multiplier -1, `FIRST_AMPLITUDE` times the motion's size, is added to the state; Newton then
    finds the parameter that belongs to this distance from the old branch. Its tangent points away from the old
    branch.
    """
    settings = Settings(iterations=15)
    doubled = problem.with_multiple(2 * problem.multiple)
    M = problem.monodromy(special.point)
    mu, vectors = np.linalg.eig(M)
    v = vectors[:, int(np.argmin(np.abs(mu + 1.0)))].real
    scale, _ = doubled.scale(special.point.u)
    row = np.append(v, 0.0) / scale
    row /= np.linalg.norm(row)
    for factor in (1.0, 0.1, 0.01, 5.0):
        size = factor * FIRST_AMPLITUDE
        w = special.point.u / scale + size * row
        point = correct(doubled, w * scale, row, float(row @ w), scale, settings, reference=row, furthest=10.0 * size)
        if point is not None:
            return doubled, point
    return None


def switch_at_branch_point(problem: ForcedOrbits, special: SpecialPoint, chord: Floats) -> list[BranchPoint]:
    """The first motions to both sides of the branch that crosses at a branch point, with tangents that point away.

    There the Jacobian has a kernel of two dimensions: the tangent, and the direction in which the other branch leaves.
    No tangent is defined by the Jacobian alone; ``chord`` is the difference of the unknowns between the neighbours.
    """
    settings = Settings(iterations=15)
    point = special.point
    J = problem.residual(point.u)[1]
    scale, residual_scale = problem.scale(point.u)
    kernel = np.linalg.svd(J * scale / residual_scale[:, None])[2][-2:]
    along = kernel @ (chord / scale)
    across = np.array([-along[1], along[0]]) @ kernel
    across /= np.linalg.norm(across)
    starts = []
    w = point.u / scale
    for row in (across, -across):
        for factor in (1.0, 0.1, 5.0):
            size = factor * FIRST_AMPLITUDE
            guess = w + size * row
            first = correct(
                problem, guess * scale, row, float(row @ guess), scale, settings, reference=row, furthest=10.0 * size
            )
            if first is not None:
                starts.append(first)
                break
    return starts
