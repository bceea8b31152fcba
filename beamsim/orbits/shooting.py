"""Periodic motions of the forced system by shooting.

A motion of period :math:`T = 2\\pi j/\\omega` solves :math:`z(T; z_0, \\lambda) - z_0 = 0`, z being the state (q, q')
with the contacts' internal states. The Jacobian is the monodromy matrix less one, exact
(:mod:`beamsim.flow.variational`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np

from beamsim.flow.periodic_flow import ContactDirection, FlowMap, Frequency, Level, Parameter, PeriodicFlow
from beamsim.orbits.branch import BranchPoint, Orbit
from beamsim.orbits.continuation import Settings, solve_at
from beamsim.orbits.period import cyclic
from beamsim.typing import Complexes, Floats

STABILITY_MARGIN = 1e-9  # a multiplier's modulus may exceed one by this much
SLIDER_ROUND_OFF = 1e-7  # change of a slider by a unit of the state, over a period, that is round-off


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

    bifurcates: ClassVar[bool] = True
    flow: PeriodicFlow
    parameter: Literal["frequency", "level"] | Callable[[float], tuple[PeriodicFlow, ContactDirection]] = "frequency"
    multiple: int = 1
    _varied_flow: tuple[float, PeriodicFlow, ContactDirection] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        contacts = self.flow.system.contacts
        self._one = np.eye(self.flow.size)
        self._smallest = max(1e-3 * float(np.max(np.abs(contacts.clearances), initial=0.0)), 1e-30)
        self._n2 = 2 * self.flow.system.size
        held = contacts.shape[contacts.may_stick_rigidly]  # displacements that contacts may hold
        held = held / np.linalg.norm(held, axis=1, keepdims=True)
        faces = np.pad(held, ((0, 0), (0, self.flow.size - held.shape[1])))
        self._may_rest = np.vstack([self._one[self._n2 + contacts.sliders], faces])
        self.omega, self.level = self.flow.omega, self.flow.level

    @property
    def value(self) -> float:
        """The parameter's value in the flow as it is (frequency and level)."""
        return self.omega if self.parameter == "frequency" else self.level

    def flow_at(self, value: float) -> tuple[PeriodicFlow, Parameter]:
        """The flow with its parameter set, and the parameter to differentiate by."""
        if self.parameter == "frequency":
            if value <= 0:
                raise ArithmeticError("the frequency became negative")
            self.flow = self.flow.with_loads(value, self.level)
            return self.flow, Frequency()
        if self.parameter == "level":
            self.flow = self.flow.with_loads(self.omega, value)
            return self.flow, Level()
        if self._varied_flow is None or self._varied_flow[0] != value:
            self._varied_flow = (value, *self.parameter(value))
        return self._varied_flow[1].with_loads(self.omega, self.level), self._varied_flow[2]

    def shoot(self, flow: PeriodicFlow, z: Floats, parameters: Sequence[Parameter]) -> tuple[Floats, Floats, FlowMap]:
        """``z(T) - z(0)`` with its Jacobian by the start and by parameters.

        Parameters
        ----------
        flow : the structure under its loads.
        z : (N,) state at t = 0.
        parameters : P of them; the period follows the frequency.

        Returns
        -------
        The residual (N,), its Jacobian (N, N + P), and the motion.
        """
        period = 2 * np.pi * self.multiple / flow.omega
        flow_map = flow.flow_map(z, period, parameters)
        J = np.hstack([flow_map.transition - self._one, flow_map.parameters])
        for column, parameter in enumerate(parameters, z.size):
            if isinstance(parameter, Frequency):
                J[:, column] -= flow_map.slope * (period / flow.omega)
        change = flow_map.end - z
        resting = self._resting_directions(flow_map)
        # as of a slider that is set anew: the determinant keeps its sign where sliding begins
        J -= resting.T @ (resting @ J)
        J[:, : z.size] -= resting.T @ resting
        return change - resting.T @ (resting @ change), J, flow_map

    def residual(self, u: Floats) -> tuple[Floats, Floats, FlowMap]:
        """The residual of the state and the parameter, with its Jacobian."""
        flow, parameter = self.flow_at(float(u[-1]))
        return self.shoot(flow, u[:-1], (parameter,))

    def _resting_directions(self, flow_map: FlowMap) -> Floats:
        """(k, N) orthonormal rows of what a motion leaves where it is.

        These are sliders of friction and hardening, and faces that stick without a spring. Any place of theirs is
        periodic: the equation says that Newton's method leaves them there too.
        """
        candidates = self._may_rest
        if not candidates.shape[0]:
            return candidates
        change = candidates @ flow_map.transition - candidates
        n = self._n2 // 2
        change[:, n : 2 * n] *= self.flow.omega
        resting = candidates[np.abs(change).max(axis=1) < SLIDER_ROUND_OFF]
        _, size, rows = np.linalg.svd(resting, full_matrices=False)
        return np.asarray(rows[size > SLIDER_ROUND_OFF])  # of several that are held at one place one is enough

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
        """Floquet multipliers, the largest first."""
        flow_map: FlowMap = point.data
        return flow_map.multipliers

    def cycle(self, point: BranchPoint) -> tuple[PeriodicFlow, FlowMap]:
        """The flow at a point, and its motion over a period."""
        return self.flow_at(point.parameter)[0], point.data

    def same_events(self, a: BranchPoint, b: BranchPoint) -> bool:
        """Whether each contact has the same events in two motions, in cyclic order."""
        sa, sb = a.data.signature, b.data.signature
        return bool(sa == sb) or (len(sa) == len(sb) and cyclic(a.data) == cyclic(b.data))

    def orbit(self, point: BranchPoint) -> Orbit:
        """What a converged point means."""
        mu = self.multipliers(point)
        stable = bool(np.abs(mu[0]) <= 1.0 + STABILITY_MARGIN)
        return Orbit(point.parameter, point.u[:-1], point.data.duration, mu, stable, point.residual)


def linear_guess(flow: PeriodicFlow) -> Floats:
    """The response of the open structure at t = 0, as a first guess; lightly damped modes have one per cent there."""
    n = flow.system.size
    force, _, _, _ = flow.loads.at(flow.omega, flow.level)
    z = np.zeros(flow.size)
    K, C = np.diag(flow.system.stiffness), flow.system.damping
    # 0.01: least damping ratio in a first guess, which must have a bound at resonance
    least = 2.0 * 0.01 * np.sqrt(flow.system.stiffness)
    C = C + np.diag(np.maximum(least - np.diag(C), 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):  # of a mode without stiffness
        z[:n] = np.where(flow.system.stiffness > 0, flow.system.constant_load / flow.system.stiffness, 0.0)
    for h in range(flow.loads.count):
        w = flow.loads.multiple[h] * flow.omega
        q = np.linalg.solve(K - w**2 * np.eye(n) + 1j * w * C, force[h])
        z[:n] += q.real
        z[n : 2 * n] += (1j * w * q).real
    return z


def find_orbit(problem: ForcedOrbits, guess: Floats | None = None, *, forward: float = 1.0) -> BranchPoint | None:
    """A periodic motion at the present parameter: Newton from a guess, else one that is well determined.

    Without a guess a stable motion is looked for: Newton from the linear response and from the ends of ever longer
    transients. An unstable motion that Newton finds on the way is taken only if nothing else is: at low frequencies
    there are many, on branches that need not lead anywhere.

    Parameters
    ----------
    problem : at the parameter where the motion is looked for.
    guess : (N,) state to begin with.
    forward : whether the tangent points to larger parameters (> 0) or smaller ones.

    Returns
    -------
    The motion; None where nothing converges (no motion of this period is reached within the longest transient).
    """
    settings = Settings(iterations=25)
    value = problem.value if isinstance(problem.parameter, str) else 0.0
    flow, _ = problem.flow_at(value)
    z = linear_guess(flow) if guess is None else guess.copy()
    period = 2 * np.pi * problem.multiple / flow.omega
    done, chance = 0, None
    for target in (0, 3, 10, 30, 100, 300):
        if done < target:
            z, done = flow.end(z, (target - done) * period), target
        point = solve_at(problem, np.append(z, value), settings, value, forward)
        if point is not None and (guess is not None or problem.orbit(point).stable):
            return point
        chance = point if chance is None else chance
    return chance
