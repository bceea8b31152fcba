r"""Curves of special points of periodic motions in two parameters, each kind by one defining equation.

A curve has as unknowns the state z at phase zero, further ones of its kind, and the two parameters. It satisfies the
shooting equations :math:`R = 0` with the Jacobian :math:`M - I`, M being the monodromy matrix, and its defining
equation:

- a multiplier :math:`\mu = 1` (fold) or :math:`\mu = -1` (period doubling): the scalar g of the bordered system

  .. math:: \begin{pmatrix} M - \mu I & b \\ c^T & 0 \end{pmatrix} \begin{pmatrix} v \\ g \end{pmatrix} =
            \begin{pmatrix} 0 \\ 1 \end{pmatrix}

  vanishes exactly where M has this multiplier (W. Govaerts, *Numerical Methods for Bifurcations of Dynamical
  Equilibria*, 2000);
- a pair of multipliers :math:`e^{\pm i\theta}` (Neimark–Sacker point): :math:`M^2 - 2\kappa M + I` with the further
  unknown :math:`\kappa = \cos\theta` has a kernel of two dimensions, so that the 2 x 2 matrix G of the system with two
  borders vanishes;
- a grazing: the penetration of a contact, relative to the border of its two phases, and its rate vanish together;
- a branch point that a symmetry preserves: the map :math:`z \mapsto -z(T/2)` has a multiplier -1 where the motion
  repeats with the opposite sign after half a period.

Derivatives of M follow from central differences of the Jacobian along few directions, for a model of any size, since
second derivatives are symmetric.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Any, ClassVar, Literal, Protocol

import numpy as np

from beamsim.flow.periodic_flow import ContactDirection, FlowMap, Frequency, Parameter, PeriodicFlow
from beamsim.orbits.branch import BranchPoint, SpecialPoint
from beamsim.orbits.continuation import BranchStep, Settings, solve_at
from beamsim.orbits.shooting import ForcedOrbits
from beamsim.orbits.special_points import lowest
from beamsim.typing import Floats

SecondParameter = Literal["level"] | Callable[[float], tuple[PeriodicFlow, ContactDirection]]
CurveEventKind = Literal[
    "isola", "joining_branches", "cusp", "extremum", "resonance_1_1", "resonance_1_2", "resonance_1_3", "resonance_1_4"
]
STEP_ALONG = 1e-6  # of a finite difference, relative to the scale of the unknowns
STRONG_RESONANCES: dict[CurveEventKind, float] = {
    "resonance_1_1": 1.0, "resonance_1_2": -1.0, "resonance_1_3": -0.5, "resonance_1_4": 0.0,
}  # fmt: skip
"""cos theta of the pair of multipliers at each strong resonance."""
AT_RESONANCE = 1e-7  # distance of cos theta from that of a resonance, within which a point lies there


class DefiningEquation(Protocol):
    """What a special point of one kind satisfies in addition to the shooting equations."""

    further: Floats  # (f,) further unknowns at the first point

    @property
    def half_period(self) -> bool:
        """Whether the motion is shot over half its period, onto its mirror image."""

    def rows(self, curve: CurveProblem, u: Floats, A: Floats, flow_map: FlowMap) -> tuple[Floats, Floats]:
        """Values (f + 1,) and their derivatives (f + 1, size of u).

        Parameters
        ----------
        curve : with the flow and the scales.
        u : unknowns.
        A : (N, N + 2) Jacobian of the shooting equations by the state and both parameters.
        flow_map : motion over the period.
        """

    def size(self, scale: Floats) -> Floats | float:
        """Typical size of the values, from the scale of the unknowns."""


@dataclass
class CurveProblem:
    """A continuation problem: special points of one kind in the frequency and a second parameter.

    The unknowns are the state, the further unknowns of the kind, omega and the second parameter.

    Parameters
    ----------
    orbits : shooting problem in frequency.
    second_parameter : the level, or a path of systems.
    equation : of the kind.
    """

    orbits: ForcedOrbits
    second_parameter: SecondParameter
    equation: DefiningEquation

    def __post_init__(self) -> None:
        self._along = ForcedOrbits(self.orbits.flow, self.second_parameter, self.orbits.multiple)
        self._along.level = self.orbits.level
        self.n = self.orbits.flow.size

    def flow_at(self, u: Floats) -> tuple[PeriodicFlow, tuple[Parameter, Parameter]]:
        """Flow at both parameters, and the parameters as perturbations."""
        self._along.omega = float(u[-2])
        if self._along.omega <= 0:
            raise ArithmeticError("the frequency became negative")
        flow, parameter = self._along.flow_at(float(u[-1]))
        return flow, (Frequency(), parameter)

    def shoot(self, u: Floats) -> tuple[Floats, Floats, FlowMap]:
        """Shooting residual (N,), its Jacobian (N, N + 2) by the state and both parameters, and the flow map."""
        flow, parameters = self.flow_at(u)
        z = u[: self.n]
        if not self.equation.half_period:
            return self._along.shoot(flow, z, parameters)
        half = np.pi * self.orbits.multiple / flow.omega
        flow_map = flow.flow_map(z, half, parameters)
        by_parameters = flow_map.parameters - np.outer(flow_map.slope * (half / flow.omega), [1.0, 0.0])
        return -flow_map.end - z, -np.hstack([flow_map.transition + np.eye(self.n), by_parameters]), flow_map

    def residual(self, u: Floats) -> tuple[Floats, Floats, FlowMap]:
        """Shooting residual and defining equation, with their Jacobian, and the motion over the whole period."""
        R, A, flow_map = self.shoot(u)
        values, rows = self.equation.rows(self, u, A, flow_map)
        between = np.zeros((self.n, self.equation.further.size))
        whole = np.hstack([A[:, : self.n], between, A[:, self.n :]])
        if self.equation.half_period:
            flow, parameters = self.flow_at(u)
            flow_map = self._along.shoot(flow, u[: self.n], parameters)[2]
        return np.append(R, values), np.vstack([whole, rows]), flow_map

    def change_along(self, u: Floats, direction: Floats) -> Floats:
        """Derivative (N, N + 2) of the shooting Jacobian along a direction of the state, or of state and parameters.

        Parameters
        ----------
        u : unknowns.
        direction : (N,) of the state, or (N + 2,) of state and parameters.
        """
        scale = self.scale(u)[0]
        reached = np.append(scale[: self.n], scale[-2:])[: direction.size]
        size = float(np.linalg.norm(direction / reached))
        if size == 0.0:
            return np.zeros((self.n, self.n + 2))
        h = np.zeros(u.size)
        h[: self.n] = direction[: self.n]
        h[u.size - 2 :] += np.append(direction[self.n :], np.zeros(2))[:2]
        step = STEP_ALONG / size
        return (self.shoot(u + step * h)[1] - self.shoot(u - step * h)[1]) / (2.0 * step)

    def same_events(self, a: BranchPoint, b: BranchPoint) -> bool:
        """True always: curves in two parameters are continued without a test for corners."""
        return True

    def cycle(self, point: BranchPoint) -> tuple[PeriodicFlow, FlowMap]:
        """Flow at a point, and its motion over a period."""
        return self.flow_at(point.u)[0], point.data

    def scale(self, u: Floats) -> tuple[Floats, Floats]:
        """Scales of the unknowns and of the equations."""
        further = self.equation.further.size
        scale, residual = self.orbits.scale(np.append(u[: self.n], u[-2]))
        whole = np.concatenate([scale[:-1], np.ones(further), scale[-1:], [max(abs(u[-1]), 1e-12)]])
        return whole, np.append(residual, np.ones(further + 1) * self.equation.size(scale))


@dataclass
class Multiplier:
    """One multiplier is 1 (fold) or -1 (period doubling); over half a period -1 breaks the symmetry."""

    value: float
    half_period: bool = False
    further: Floats = field(default_factory=lambda: np.zeros(0))
    border: tuple[Floats, Floats] | None = None  # b and c, unit vectors in scaled unknowns, of the last motion

    def rows(self, curve: CurveProblem, u: Floats, A: Floats, flow_map: FlowMap) -> tuple[Floats, Floats]:
        """The scalar g of the bordered system and its derivative."""
        g, w, v = self.vectors(curve, u, A)
        return np.array([g]), -(w @ curve.change_along(u, v))[None]

    def vectors(self, curve: CurveProblem, u: Floats, A: Floats) -> tuple[float, Floats, Floats]:
        """The scalar g with left and right vectors w and v (N,), in the unknowns' own units.

        The borders follow the vectors along the curve, so that the system stays regular; g = 0 does not depend on them.
        """
        n = curve.n
        s = curve.scale(u)[0][:n]
        shifted = A[:, :n] * s / s[:, None] + (1.0 - self.value) * np.eye(n)
        if self.border is None:
            left, _, right = np.linalg.svd(shifted)
            self.border = left[:, -1], right[-1]
        b, c = self.border
        bordered = np.block([[shifted, b[:, None]], [c[None], np.zeros((1, 1))]])
        last = np.append(np.zeros(n), 1.0)
        x, y = np.linalg.solve(bordered, last), np.linalg.solve(bordered.T, last)
        self.border = y[:n] / np.linalg.norm(y[:n]), x[:n] / np.linalg.norm(x[:n])
        return float(x[-1]), y[:n] / s, x[:n] * s

    def size(self, scale: Floats) -> float:
        """Of g, which is a number without unit."""
        return 1.0


@dataclass
class NeimarkSacker:
    r"""Two multipliers are :math:`e^{\pm i\theta}`; the further unknown is :math:`\kappa = \cos\theta`.

    Of the four entries of G two combinations are taken: next to the curve :math:`G` is a combination of
    :math:`W^T M V` and :math:`W^T V` by the theorem of Cayley and Hamilton, and the values are its parts along both.
    """

    half_period: ClassVar[bool] = False
    further: Floats  # (1,) kappa at the first point
    border: tuple[Floats, Floats] | None = None  # (N, 2) each

    def rows(self, curve: CurveProblem, u: Floats, A: Floats, flow_map: FlowMap) -> tuple[Floats, Floats]:
        """Two values that vanish where the kernel has two dimensions, and their derivatives."""
        n, kappa = curve.n, float(u[curve.n])
        s = curve.scale(u)[0][:n]
        M = A[:, :n] * s / s[:, None] + np.eye(n)
        square = M @ M - 2.0 * kappa * M + np.eye(n)
        if self.border is None:
            left, _, right = np.linalg.svd(square)
            self.border = left[:, -2:], right[-2:].T
        B, C = self.border
        bordered = np.block([[square, B], [C.T, np.zeros((2, 2))]])
        last = np.vstack([np.zeros((n, 2)), np.eye(2)])
        X, Y = np.linalg.solve(bordered, last), np.linalg.solve(bordered.T, last)
        V, W, G = X[:n], Y[:n], X[n:]
        self.border = np.linalg.qr(W)[0], np.linalg.qr(V)[0]
        moved = M @ V
        parts = np.linalg.qr(np.column_stack([(W.T @ moved).ravel(), (W.T @ V).ravel()]))[0]
        rows = np.zeros((2, 2, u.size))
        for j in range(2):
            one = curve.change_along(u, s * (moved[:, j] - 2.0 * kappa * V[:, j])) / s[:, None]
            other = curve.change_along(u, s * V[:, j]) / s[:, None]
            change = -(W.T @ one + (W.T @ M) @ other)
            rows[:, j, :n], rows[:, j, -2:] = change[:, :n], change[:, n:]
            rows[:, j, n] = 2.0 * W.T @ moved[:, j]
        return parts.T @ G.ravel(), parts.T @ rows.reshape(4, -1)

    def size(self, scale: Floats) -> float:
        """Of both values, which have no unit."""
        return 1.0


@dataclass
class Grazing:
    """The extreme of the penetration is that at the border of two phases, where the rate is zero.

    If a stiff stop turns a response curve back, the fold nearly coincides with the grazing: the curve has a corner, and
    there is no smooth fold to continue. The border of the region with several motions is then the curve of grazings.
    The derivative of the extreme is that of the penetration at a fixed time, since the rate is zero at an extreme.
    """

    half_period: ClassVar[bool] = False
    contact: int
    from_below: bool  # whether the penetration reaches the border from below
    period_share: float  # position in the period near which the extreme is searched
    level: float  # m, penetration at the border
    further: Floats = field(default_factory=lambda: np.zeros(0))

    def rows(self, curve: CurveProblem, u: Floats, A: Floats, flow_map: FlowMap) -> tuple[Floats, Floats]:
        """The extreme of the penetration above the border, m, and its derivative."""
        flow, parameters = curve.flow_at(u)
        guard = np.zeros(flow.system.contacts.arrays.guard.shape[-1])  # positive next to the border
        guard[[0, 2]] = (-1.0, self.level) if self.from_below else (1.0, -self.level)
        height, time = lowest(flow, flow_map, self.contact, guard, self.period_share * flow_map.duration)
        if not np.isfinite(height):
            raise ArithmeticError("the penetration has no extreme near the grazing")
        self.period_share = time / flow_map.duration
        touch = flow.flow_map(flow_map.start, time, parameters)
        by_start, by_parameters = flow.penetration_derivative(touch, self.contact, parameters)
        return np.array([height / guard[0]]), np.append(by_start, by_parameters)[None]

    def size(self, scale: Floats) -> float:
        """That of the displacements."""
        return float(scale[0])


def equation_of(special_point: SpecialPoint) -> DefiningEquation:
    """The defining equation of a located special point.

    Parameters
    ----------
    special_point : on a branch in one parameter.
    """
    kind, flow_map = special_point.kind, special_point.point.data
    if kind in ("fold", "period_doubling"):
        return Multiplier(1.0 if kind == "fold" else -1.0)
    if kind == "branch_point":
        return Multiplier(-1.0, half_period=True)
    if kind == "neimark_sacker":
        mu = flow_map.multipliers[flow_map.multipliers.imag > 0.0]
        pair = mu[int(np.argmin(np.abs(np.abs(mu) - 1.0)))]
        return NeimarkSacker(np.array([pair.real / np.abs(pair)]))
    share = special_point.time / flow_map.duration
    return Grazing(special_point.contact, special_point.top, share, special_point.level)


def start_of_curve(
    orbits: ForcedOrbits, special_point: SpecialPoint, second: SecondParameter, value: float, sign: float = 1.0
) -> tuple[CurveProblem, BranchPoint] | None:
    """Curve of special points through a located one, starting at its value of the second parameter.

    Parameters
    ----------
    orbits : shooting problem in frequency.
    special_point : on a branch of the problem.
    second : the second parameter.
    value : value of the second parameter on that branch.
    sign : 1 to continue to larger values, -1 to smaller ones.

    Returns
    -------
    The problem and its first point; None if Newton's method does not converge.
    """
    curve = CurveProblem(orbits, second, equation_of(special_point))
    u = special_point.point.u
    guess = np.concatenate([u[:-1], curve.equation.further, u[-1:], [value]])
    point = solve_at(curve, guess, Settings(iterations=12), value, sign)
    return None if point is None else (curve, point)


@dataclass(frozen=True)
class CurveEvent:
    """A special point of a curve of special points."""

    kind: CurveEventKind
    point: BranchPoint


def events_between(step: BranchStep[CurveProblem]) -> Iterator[CurveEvent]:
    """Special points between two neighbours of a curve: extremes of the second parameter, cusps, strong resonances.

    Parameters
    ----------
    step : of a curve.

    Raises
    ------
    ArithmeticError, LinAlgError : where a search fails.
    """
    curve, a, b = step.problem, step.a, step.b

    def beyond(point: BranchPoint, cosine: float) -> float:
        return float(point.u[curve.n]) - cosine

    if isinstance(curve.equation, NeimarkSacker):
        for kind, cosine in STRONG_RESONANCES.items():
            at = beyond(a, cosine), beyond(b, cosine)
            if at[0] * at[1] < 0.0 or abs(at[1]) < AT_RESONANCE:
                found = step.locate(partial(beyond, cosine=cosine), at)
                yield CurveEvent(kind, b if found is None else found)
    if a.tangent[-1] * b.tangent[-1] < 0.0:
        turn = step.locate(lambda p: float(p.tangent[-1]))
        if turn is None:
            raise ArithmeticError("the second parameter turns back, and no extreme was found")
        yield CurveEvent(_kind_of_turn(step, turn), turn)


def _kind_of_turn(step: BranchStep[CurveProblem], turn: BranchPoint) -> CurveEventKind:
    r"""What an extreme of the second parameter means.

    With the left vector w, the second derivatives D of the shooting equations along the right vector v and along the
    tangent t of a curve of folds are those of :math:`h = a x^2 + 2 b x\,\omega + c\,\omega^2 + d\,p`: their product
    has the sign of :math:`ac - b^2`. Where it is positive, motions near the point form a closed curve on one side of it
    and do not exist on the other; where it is negative, two branches join. At a cusp a changes its sign.
    """
    curve, equation = step.problem, step.problem.equation
    if not isinstance(equation, Multiplier) or equation.value != 1.0:
        return "extremum"
    bends = [_bend(curve, equation, point) for point in (step.a, step.b)]
    if step.a.tangent[-2] * step.b.tangent[-2] < 0.0 and bends[0] * bends[1] < 0.0:
        return "cusp"
    along = np.append((turn.tangent * turn.scale)[:-1], 0.0)
    _, w, _ = equation.vectors(curve, turn.u, curve.shoot(turn.u)[1])
    across = float(w @ curve.change_along(turn.u, along) @ along)
    return "isola" if _bend(curve, equation, turn) * across > 0.0 else "joining_branches"


def _bend(curve: CurveProblem, equation: Multiplier, point: BranchPoint) -> float:
    """Second derivative of the shooting equations along the right vector, times the left one."""
    _, w, v = equation.vectors(curve, point.u, curve.shoot(point.u)[1])
    return float(w @ curve.change_along(point.u, v)[:, : curve.n] @ v)


def mirror_error(curve: CurveProblem, point: BranchPoint) -> float:
    """How far a motion is from repeating with the opposite sign after half a period, relative to its size.

    The state and its derivative, the state transition matrix, are compared in both halves.

    Parameters
    ----------
    curve : with the flow.
    point : of the curve, or of a branch with the same unknowns of the state and parameters.
    """
    flow = curve.flow_at(point.u)[0]
    z, half = point.u[: curve.n], np.pi * curve.orbits.multiple / flow.omega
    scale = curve.scale(point.u)[0][: curve.n]
    first = flow.flow_map(z, half)
    second = flow.flow_map(first.end, half, t=half)
    state = np.abs((first.end + z) / scale).max()
    halves = np.abs((second.transition - first.transition) * scale / scale[:, None]).max()
    return float(max(state, halves / max(1.0, float(np.abs(first.transition * scale / scale[:, None]).max()))))


def angle_of(equation: Any, u: Floats, n: int) -> float:
    """Angle of the multipliers on the unit circle, rad: 0 of a fold, pi of a period doubling; NaN of a grazing."""
    if isinstance(equation, Grazing):
        return float("nan")
    if isinstance(equation, NeimarkSacker):
        return float(np.arccos(np.clip(u[n], -1.0, 1.0)))
    return 0.0 if equation.value == 1.0 or equation.half_period else float(np.pi)
