r"""Periodic motions by harmonic balance, condensed exactly to the nonlinear springs.

With :math:`w = B q` the deflections of the one-sided and cubic springs and :math:`\Lambda_h(W)` the harmonics of their
forces, the motions of fundamental frequency :math:`\Omega` solve

.. math:: R_h = W_h - W^0_h(\Omega) - G_h(\Omega)\, (\Lambda_h(W) + S W_h) = 0, \qquad h = 0 \dots H,

where the springs' forces are Galerkin's, without aliasing (:mod:`beamsim.orbits.aft`). The unknowns are ``2 H + 1``
numbers a spring, whatever the model's size. Problems are those of :mod:`beamsim.orbits.continuation`; the Jacobian is
exact.

The receptances G carry the whole linear structure. With :math:`Z(\omega_h) = K - \omega_h^2 I + i \omega_h C`, harmonic
h follows exactly from that of the springs' deflections, :math:`W_h = B Z^{-1} F_h + B Z^{-1} B^T \Lambda_h`. Because Z
is singular at rigid-body and undamped natural frequencies, the same complex spring S is added to both sides:

.. math:: W_h = B Z_S^{-1} F_h + B Z_S^{-1} B^T (\Lambda_h + S W_h), \qquad Z_S = Z + B^T S B .

The solutions are the same and :math:`Z_S` is regular wherever the springs feel every undamped mode.

Stability is that of the same motion by shooting: the balance gives the start, Newton's method corrects it, and the
transition matrix over a period has the multipliers. Where Newton comes to no motion near it, those are of the motion
that begins as the motion does, as good as its harmonics are. At a fold, where the two branches end at slightly
different values, shooting is corrected across its branch instead of at the same value.
"""

from __future__ import annotations

from collections.abc import MutableMapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import ClassVar, Literal
from weakref import WeakKeyDictionary

import numpy as np

from beamsim.contacts.contacts import Contacts
from beamsim.contacts.equilibrium import CubicSprings
from beamsim.errors import MethodError
from beamsim.flow.periodic_flow import FlowMap, PeriodicFlow, PeriodicForcing
from beamsim.flow.smooth_flow import SmoothFlow
from beamsim.flow.variational import VariationalFlow
from beamsim.orbits.aft import cubic, one_sided, to_complex, to_real, toeplitz
from beamsim.orbits.branch import BranchPoint, Orbit
from beamsim.orbits.continuation import Settings, correct_across, newton_step, solve_at
from beamsim.orbits.shooting import STABILITY_MARGIN, ForcedOrbits, find_orbit
from beamsim.system.equations import PiecewiseLinearSystem
from beamsim.typing import Complexes, Floats, Ints


@dataclass(frozen=True)
class Receptances:
    """For harmonics 0 … H of a fundamental frequency."""

    response: Complexes  # (H + 1, r) deflections under the loads, springs S added
    response_slope: Complexes  # (H + 1, r) derivative by the fundamental frequency
    receptance: Complexes  # (H + 1, r, r) B Z_S^-1 B^T
    receptance_slope: Complexes  # (H + 1, r, r)


class Condensation:
    """The linear structure, reduced exactly to the rows at which nonlinear springs act.

    Parameters
    ----------
    stiffness : (n,) diagonal of K, rad^2/s^2, exact zeros for rigid-body modes.
    damping : (n, n) C, 1/s.
    rows : (r, n) B.
    typical : a typical frequency of the motion, rad/s (only the size of S follows from it).
    """

    def __init__(self, stiffness: Floats, damping: Floats, rows: Floats, typical: float) -> None:
        self.stiffness, self.damping, self.rows = stiffness, damping, rows
        compliance = (rows**2 / (stiffness + typical**2)).sum(axis=1)
        self.spring = 1.0 / np.where(compliance > 0, compliance, 1.0)  # (r,) size of S

    def shifts(self, harmonics: int) -> Complexes:
        """(harmonics + 1, r) S: real at harmonic 0, complex above."""
        out = np.multiply.outer(np.full(harmonics + 1, 1.0 + 1.0j), self.spring)
        out[0] = self.spring
        return np.asarray(out)

    def _impedance(self, w: Floats, S: Complexes) -> Complexes:
        """(F, n, n) K - w² I + i w C + B^T S B at frequencies (F,) with springs (F, r)."""
        out = np.multiply.outer(1j * w, self.damping) + (self.rows.T * S[:, None, :]) @ self.rows
        n = np.arange(self.stiffness.size)
        out[:, n, n] += self.stiffness - (w**2)[:, None]
        return np.asarray(out)

    def at(self, fundamental: float, load: Complexes, load_slope: Complexes) -> Receptances:
        """Receptances and responses of harmonics 0 … H.

        Parameters
        ----------
        fundamental : rad/s.
        load : (H + 1, n) generalised forces.
        load_slope : (H + 1, n) their derivatives by the fundamental frequency.

        Returns
        -------
        Receptances with springs S, and the deflections under the loads.
        """
        B, h, S = self.rows, np.arange(load.shape[0]), self.shifts(load.shape[0] - 1)
        w: Floats = np.asarray(h * fundamental, dtype=float)
        inverse = np.asarray(np.linalg.inv(self._impedance(w, S)), dtype=complex)
        dZ = np.multiply.outer(1j * h, self.damping) - np.multiply.outer(2.0 * h * w, np.eye(self.stiffness.size))
        turned: Complexes = B @ inverse  # (H + 1, r, n) B Z_S^-1
        slope: Complexes = -turned @ dZ @ inverse
        response_slope = _times(slope, load) + _times(turned, load_slope)
        return Receptances(_times(turned, load), response_slope, turned @ B.T, slope @ B.T)

    def coordinates(self, fundamental: float, load: Complexes, force: Complexes, W: Complexes) -> Complexes:
        """(H + 1, n) the whole structure's harmonics.

        Parameters
        ----------
        fundamental : rad/s.
        load : (H + 1, n) generalised forces.
        force : (H + 1, r) the springs' forces on the structure.
        W : (H + 1, r) the springs' deflections.

        Returns
        -------
        Harmonics of the modal coordinates, m kg^(1/2).
        """
        w: Floats = np.asarray(np.arange(load.shape[0]) * fundamental, dtype=float)
        S = self.shifts(load.shape[0] - 1)
        right = load + (force + S * W) @ self.rows
        return np.asarray(np.linalg.solve(self._impedance(w, S), right[:, :, None])[:, :, 0])


@dataclass(frozen=True, eq=False)
class HarmonicMotion:
    """A periodic motion as a sum of harmonics; what a balance keeps with each point."""

    fundamental: float  # rad/s
    structure: Condensation
    load: Complexes  # (H + 1, n) on the structure, its springs' forces excepted
    deflections: Complexes  # (H + 1, r) of the springs, one-sided ones first
    forces: Complexes  # (H + 1, r) their forces on the structure
    closed: tuple[Floats, ...]  # (c, 2) of every one-sided spring, the phases during which it is closed, rad

    @cached_property
    def coordinates(self) -> Complexes:
        """(H + 1, n) Q: q(t) = Re sum Q_h e^{i h fundamental t}; of the model's size, so only on request."""
        return self.structure.coordinates(self.fundamental, self.load, self.forces, self.deflections)

    @cached_property
    def edges(self) -> Floats:
        """(G + 1,) s, from 0 to the period, between which no spring opens or closes."""
        cut = [phases[phases[:, 1] - phases[:, 0] < 2 * np.pi].ravel() for phases in self.closed]
        within = np.mod(np.concatenate([np.zeros(0), *cut]) / self.fundamental, self.period)
        return np.unique(np.concatenate([[0.0], within, [self.period]]))

    @cached_property
    def phases(self) -> Ints:
        """(G, m) phases of the springs between the edges, 1 where one is closed."""
        middle = 0.5 * self.fundamental * (self.edges[1:] + self.edges[:-1])
        closed = np.zeros((middle.size, len(self.closed)), dtype=np.int64)
        for j, phases in enumerate(self.closed):
            for begin, end in phases:
                closed[:, j] |= (middle - begin) % (2 * np.pi) < end - begin
        return closed

    @property
    def period(self) -> float:
        """s."""
        return 2 * np.pi / self.fundamental

    @property
    def highest(self) -> int:
        """H."""
        return int(self.deflections.shape[0]) - 1

    def states(self, times: Floats) -> Floats:
        """(nt, 2n) displacements and velocities."""
        iw = 1j * np.arange(self.highest + 1) * self.fundamental
        e = np.exp(np.multiply.outer(np.asarray(times, dtype=float), iw))
        return np.hstack([(e @ self.coordinates).real, (e @ (iw[:, None] * self.coordinates)).real])


def _rows_real(R: Complexes) -> Floats:
    """((2H + 1) r,) real equations, harmonic by harmonic."""
    return to_real(R).ravel()


def _times(matrices: Complexes, vectors: Complexes) -> Complexes:
    """(H + 1, r) products of matrices (H + 1, r, r) with vectors, harmonic by harmonic."""
    return np.asarray((matrices @ vectors[:, :, None])[:, :, 0])


def _jacobian(receptances: Receptances, S: Complexes, by_x: Complexes) -> Floats:
    """((2H+1) r, (2H+1) r) derivative of the residual by the real coefficients, from that of the forces."""
    r, hs, xs = by_x.shape
    k, i = np.arange(1, hs), np.arange(r)
    by_total = by_x.copy()  # of force + S W
    by_total[:, 0, 0] += S[0]
    by_total[:, k, 2 * k - 1] += S[1:].T
    by_total[:, k, 2 * k] += 1j * S[1:].T
    J = -np.einsum("hij,jhx->hixj", receptances.receptance, by_total)
    J[0, i, 0, i] += 1.0
    J[k[:, None], i, 2 * k[:, None] - 1, i] += 1.0
    J[k[:, None], i, 2 * k[:, None], i] += 1j
    return to_real(J).reshape(xs * r, xs * r)


@dataclass
class ForcedBalance:
    """Forced periodic motions as a continuation problem; the unknowns are the springs' harmonics and the parameter.

    Parameters
    ----------
    system : the structure and its contacts, whose laws have no internal states.
    forcing : its periodic loads.
    harmonics : H.
    parameter : the excitation's frequency (rad/s) or its level.
    omega, level : values of those that stay constant.
    multiple : periods of the excitation in one of the motion.
    cubic : cubic springs.

    Raises
    ------
    MethodError : where the springs' law is beyond the method, or there are fewer harmonics than the loads have.
    """

    system: PiecewiseLinearSystem
    forcing: PeriodicForcing
    harmonics: int = 21
    parameter: Literal["frequency", "level"] = "frequency"
    omega: float = 1.0
    level: float = 1.0
    multiple: int = 1
    cubic: CubicSprings | None = None
    bifurcates: ClassVar[bool] = True
    rows: Floats = field(init=False, repr=False)  # (r, n) where the springs act, one-sided ones first
    _structure: Condensation = field(init=False, repr=False)
    _stops: Contacts = field(init=False, repr=False)  # the one-sided springs
    _flow: PeriodicFlow = field(init=False, repr=False)  # of the whole structure
    _spectra: MutableMapping[HarmonicMotion, Complexes] = field(
        default_factory=WeakKeyDictionary, init=False, repr=False
    )

    def __post_init__(self) -> None:
        least = int(np.max(self.forcing.multiple * self.multiple, initial=1))
        if self.harmonics < least:
            raise MethodError(
                "harmonics", f"= {self.harmonics} does not reach the excitation's {least}", f"use {least} or more"
            )
        if not self.system.contacts.one_sided:
            raise MethodError(
                "contacts", "whose laws have internal states (a dashpot that never pulls, Maxwell branches, friction, "
                "hardening, unloading) are beyond harmonic balance", "use shooting, or leave these out",
            )  # fmt: skip
        self._stops = self.system.contacts.one_sided_springs()
        self.rows = self._stops.shape if self.cubic is None else np.vstack([self._stops.shape, self.cubic.shape])
        if self.rows.shape[0] == 0:
            raise MethodError("", "harmonic balance needs a contact or a nonlinear spring", "it is linear without one")
        self._structure = Condensation(self.system.stiffness, self.system.damping, self.rows, self.omega)
        if self.cubic is None:
            self._flow = VariationalFlow(self.system, self.forcing, self.omega, self.level)
        else:
            self._flow = self.flow_at(self.omega if self.parameter == "frequency" else self.level)

    def at(self, value: float) -> tuple[float, float]:
        """Excitation frequency, rad/s, and level at a value of the parameter."""
        return (value, self.level) if self.parameter == "frequency" else (self.omega, value)

    def _loads(self, omega: float, level: float) -> tuple[Complexes, ...]:
        """Loads (H + 1, n) and base motions (H + 1, K), then their derivatives by the parameter."""
        n, index = self.system.size, self.forcing.multiple * self.multiple
        force, base, *slopes = self.forcing.at(omega, level)
        if self.parameter == "level":
            slopes = list(self.forcing.at(omega, 1.0)[:2])
        motions = base.shape[1]
        out = [np.zeros((self.harmonics + 1, size), dtype=complex) for size in (n, motions, n, motions)]
        for target, source in zip(out, (force, base, *slopes), strict=True):
            np.add.at(target, index, source)
        out[0][0] += self.system.constant_load
        return tuple(out)

    def residual(self, u: Floats) -> tuple[Floats, Floats, HarmonicMotion]:
        """The balance, its exact Jacobian, and the motion."""
        omega, level = self.at(float(u[-1]))
        if not (np.isfinite(omega) and omega > 0):
            raise ArithmeticError("the frequency became negative")
        W = to_complex(u[:-1].reshape(-1, self.rows.shape[0]))
        F, d, dF, dd = self._loads(omega, level)
        w, nu = omega / self.multiple, self.multiple
        S = self._structure.shifts(self.harmonics)
        # derivatives by the fundamental frequency: nu times those by omega
        receptances = self._structure.at(w, F, nu * dF)
        force, by_deflection, by_base, by_rate, closed = self._forces(W, w, d, dd)
        total = force + S * W
        J = np.empty((u.size - 1, u.size))
        J[:, :-1] = _jacobian(receptances, S, by_deflection)
        slope = _times(receptances.receptance, by_base)
        if self.parameter == "frequency":
            slope += (receptances.response_slope + _times(receptances.receptance_slope, total)) / nu
            slope += _times(receptances.receptance, by_rate) / nu
        else:
            slope += self._structure.at(w, dF, np.zeros_like(dF)).response
        J[:, -1] = -_rows_real(slope)
        R = _rows_real(W - receptances.response - _times(receptances.receptance, total))
        return R, J, HarmonicMotion(w, self._structure, F, W, force, closed)

    def _forces(
        self, W: Complexes, omega: float, base: Complexes, base_slope: Complexes
    ) -> tuple[Complexes, Complexes, Complexes, Complexes, tuple[Floats, ...]]:
        """Forces of the springs and their derivatives.

        Parameters
        ----------
        W : (H + 1, r) deflections.
        omega : rad/s, fundamental frequency.
        base, base_slope : (H + 1, K) motions of the base, and their derivatives by a parameter.

        Returns
        -------
        The forces (H + 1, r); their derivatives by a spring's own real coefficients (r, H + 1, 2H + 1), by the
        parameter through the base's motion, and by the fundamental frequency (H + 1, r) each; the phases during which
        each one-sided spring is closed.
        """
        c, H, count = self._stops, W.shape[0] - 1, self.rows.shape[0]
        value, by_rate = (np.zeros((H + 1, count), dtype=complex) for _ in range(2))
        by_x = np.zeros((count, H + 1, 2 * H + 1), dtype=complex)
        h = np.arange(H + 1)
        influence, absolute, slopes = c.base_influence, W.copy(), np.zeros_like(W)
        if base.any():
            influence = influence if self.cubic is None else np.vstack([influence, self.cubic.base_influence])
            absolute += base @ influence.T
            slopes += base_slope @ influence.T
        absolute[0] = absolute[0].real
        closed = []
        for j in range(c.count):
            s = float(c.sign[j])
            D = -s * absolute[:, j]
            D[0] -= c.gap[j]
            contact = one_sided(D)
            closed.append(contact.closed_intervals)
            # k delta_+ + c (delta_+)': the force of Kelvin and Voigt while closed
            rate = c.stiffness[j] + 1j * h * omega * c.dashpot[j]
            value[:, j] = s * rate * contact.positive
            by_x[j] = -rate[:, None] * toeplitz(contact.chi, H, H)
            by_rate[:, j] = s * 1j * h * c.dashpot[j] * contact.positive
        for j, k in enumerate([] if self.cubic is None else self.cubic.stiffness, c.count):
            third, slope = cubic(absolute[:, j])
            by_x[j] = -k * toeplitz(slope, H, H)
            value[:, j] = -k * third
        by_base = np.asarray((by_x @ to_real(slopes).T[:, :, None])[:, :, 0].T, dtype=complex)
        return value, by_x, by_base, by_rate, tuple(closed)

    def flow_at(self, value: float) -> SmoothFlow:
        """The flow of the same structure at a value of the parameter, each spring a contact of its own."""
        omega, level = self.at(value)
        motions = self._stops.base_influence.shape[1]
        none = CubicSprings(np.zeros((0, self.system.size)), np.zeros(0), np.zeros((0, motions)))
        return SmoothFlow(self.system, self.forcing, omega, level, springs=self.cubic or none)

    def scale(self, u: Floats) -> tuple[Floats, Floats]:
        """Deflections by the size of each spring's motion, or its gap."""
        x, gap = u[:-1].reshape(-1, self.rows.shape[0]), np.zeros(self.rows.shape[0])
        gap[: self._stops.count] = np.abs(self._stops.gap)
        sizes = np.sqrt(np.sum(x**2, axis=0))
        sizes = np.maximum(sizes, 1e-3 * max(float(gap.max(initial=0.0)), float(sizes.max(initial=0.0))))
        size = np.broadcast_to(np.maximum(sizes, 1e-30), x.shape).ravel()
        omega = abs(self.omega) if self.parameter == "frequency" else max(abs(float(u[-1])), 1e-12)
        return np.append(size, omega), size

    def linear_guess(self, value: float) -> Floats:
        """Unknowns of the response with every spring open."""
        omega, level = self.at(value)
        F = self._loads(omega, level)[0]
        r, structure = self.rows.shape[0], self._structure
        receptances = structure.at(omega / self.multiple, F, np.zeros_like(F))
        S = structure.shifts(self.harmonics)
        # R = 0 without forces
        inverse = np.asarray(
            np.linalg.pinv(np.eye(r) - receptances.receptance * S[:, None, :], rcond=1e-12), dtype=complex
        )
        return np.append(_rows_real(_times(inverse, receptances.response)), value)

    def multipliers(self, point: BranchPoint) -> Complexes:
        """Floquet multipliers, the largest first; computed once for each motion."""
        motion: HarmonicMotion = point.data
        values = self._spectra.get(motion)
        if values is None:
            values = self._spectra[motion] = self._multipliers(point, motion)
        return values

    def _multipliers(self, point: BranchPoint, motion: HarmonicMotion) -> Complexes:
        orbits, state = self.shooting(point.parameter), motion.states(np.zeros(1))[0]
        guess = np.append(state, orbits.omega)
        for correct in (solve_at, correct_across):
            shot = correct(orbits, guess, Settings())
            # 0.2: how far the motion of shooting may be from that of the balance, relative to its size
            if shot is not None and float(np.max(np.abs((shot.u - guess) / shot.scale))) < 0.2:
                return orbits.multipliers(shot)
        return orbits.flow.with_loads(orbits.omega, orbits.level).flow_map(state, motion.period).multipliers

    def shooting(self, value: float) -> ForcedOrbits:
        """The shooting problem in frequency at a value of the parameter."""
        omega, level = self.at(value)
        return ForcedOrbits(self._flow.with_loads(omega, level), multiple=self.multiple)

    def first_motion(self, value: float, forward: float) -> BranchPoint | None:
        """A motion at a value of the parameter: from the linear response, else from one that shooting finds.

        Parameters
        ----------
        value, forward : of the parameter, and where the tangent points.

        Returns
        -------
        The motion; None where none is found.
        """
        if self.cubic is None:
            with suppress(ArithmeticError):
                orbits = self.shooting(value)
                orbit = find_orbit(orbits)
                point = None if orbit is None else self.from_flow_map(orbits.flow, orbit.data, value, forward)
                if point is not None:
                    return point
        return solve_at(self, self.linear_guess(value), Settings(iterations=20), value, forward)

    def from_flow_map(
        self, flow: PeriodicFlow, flow_map: FlowMap, value: float, forward: float = 1.0
    ) -> BranchPoint | None:
        """The balanced motion close to one over a period.

        Parameters
        ----------
        flow, flow_map : of the motion.
        value, forward : of the parameter, and where the tangent points.

        Returns
        -------
        The motion; None where Newton's method does not converge.
        """
        times = np.linspace(0.0, flow_map.duration, 8 * self.harmonics, endpoint=False)
        q = flow.states_at(flow_map, times)[:, : self.system.size]
        W = np.fft.rfft(q @ self.rows.T, axis=0)[: self.harmonics + 1] * (2.0 / times.size)
        W[0] *= 0.5
        return solve_at(self, np.append(_rows_real(W), value), Settings(iterations=20), value, forward)

    def orbit(self, point: BranchPoint) -> Orbit:
        """What a converged point means."""
        motion, mu = point.data, self.multipliers(point)
        stable = bool(np.abs(mu[0]) <= 1.0 + STABILITY_MARGIN)
        return Orbit(point.parameter, motion.states(np.zeros(1))[0], motion.period, mu, stable, point.residual)

    def same_events(self, a: BranchPoint, b: BranchPoint) -> bool:
        """Sums of harmonics have no corners."""
        return True


def with_harmonics(W: Complexes, highest: int) -> Complexes:
    """The same motion with harmonics 0 … ``highest``: cut, or filled up with zeros."""
    out = np.zeros((highest + 1, *W.shape[1:]), dtype=complex)
    used = min(W.shape[0], highest + 1)
    out[:used] = W[:used]
    return out


def truncation(problem: ForcedBalance, point: BranchPoint) -> float:
    """Error by the neglected harmonics relative to the motion, by one Newton step with 2 H + 1 harmonics.

    The step is taken across the branch: at a fold, whose parameter moves, only that has a meaning. It is the error of
    the deflections at the springs up to terms of second order, the harmonics beyond 2 H + 1 excepted.

    Parameters
    ----------
    problem : the balance.
    point : a motion of it.

    Returns
    -------
    The norm of the neglected harmonics and of the change in the others, over that of the motion; infinite where the
    step has none.
    """
    larger = replace(problem, harmonics=2 * problem.harmonics + 1)
    motion: HarmonicMotion = point.data
    u = np.append(_rows_real(with_harmonics(motion.deflections, larger.harmonics)), point.parameter)
    tangent, row = point.tangent * point.scale, np.zeros(u.size)
    row[: tangent.size - 1], row[-1] = tangent[:-1], tangent[-1]
    scale = larger.scale(u)[0]
    try:
        R, J, _ = larger.residual(u)
        step = newton_step(J * scale, row / scale, R, 0.0) * scale
    except (ArithmeticError, np.linalg.LinAlgError):
        return np.inf
    return float(np.linalg.norm(step[:-1]) / np.linalg.norm(u[:-1]))
