"""Harmonic balance of free motions: an independent twin of shooting for nonlinear normal modes."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from beamsim.contacts.equilibrium import CubicSprings
from beamsim.orbits.aft import cubic, one_sided, to_complex, to_real
from beamsim.orbits.harmonic_balance import (
    _Forces,
    _jacobian,
    _residual,
    _rows_real,
    _sizes,
    _Springs,
    _with_shifts,
)
from beamsim.orbits.harmonic_motion import HarmonicMotion
from beamsim.system.equations import PiecewiseLinearSystem
from beamsim.typing import Complexes, Floats


@dataclass(frozen=True, eq=False)
class FreeMotion(HarmonicMotion):
    """A free motion with its energy."""

    energy: float  # J, averaged over the period, springs included; less the rest energy given


def _mean(a: Complexes, b: Complexes) -> float:
    """Mean over a period of the product of two real functions given by their harmonics."""
    return float(a[0].real * b[0].real + 0.5 * np.sum((a[1:] * np.conj(b[1:])).real))


def _potential(springs: _Springs, W: Complexes) -> float:
    """Mean energy of the springs over a base at rest, for a factor of one."""
    c, energy = springs.system.contacts, 0.0
    for j in range(c.count):
        D = -float(c.sign[j]) * W[:, j]
        D[0] = D[0].real - c.gap[j]
        energy += 0.5 * c.stiffness[j] * _mean(one_sided(D).positive, D)
    for j, k in enumerate(springs.cubic.tolist(), c.count):
        energy += 0.25 * k * _mean(cubic(W[:, j])[0], W[:, j])
    return energy


def _linear_energy(system: PiecewiseLinearSystem, w: float, Q: Complexes) -> float:
    """Mean energy of the linear structure, dead loads included."""
    h = np.arange(1, Q.shape[0])[:, None]
    moving = 0.25 * np.sum((system.stiffness + (h * w) ** 2) * np.abs(Q[1:]) ** 2)
    still = 0.5 * np.sum(system.stiffness * Q[0].real ** 2) - system.constant_load @ Q[0].real
    return float(moving + still)


@dataclass
class FreeBalance:
    """Periodic motions of the undamped, unforced structure, their frequency unknown.

    Unknowns are the springs' harmonics, the frequency (rad/s) and the parameter: the ``"stiffness_factor"`` of all
    nonlinear
    springs at a fixed energy, or the natural logarithm of the ``"energy"`` at a fixed factor; for ``"frequency"`` the
    harmonics and the
    frequency only. There are more equations than needed, which are consistent.

    Parameters
    ----------
    system : damping and dashpots are left out.
    harmonics : H.
    even : motions that are at rest at t = 0 (cosines only), else any, with a phase condition against ``reference``.
    energy : J, the mean over a period, less ``rest_energy`` (that of static equilibrium).
    reference : (H + 1, r) deflections whose phase the motion keeps, for ``even = False`` (default: the first guess).
    """

    system: PiecewiseLinearSystem
    harmonics: int = 21
    parameter: Literal["stiffness_factor", "energy", "frequency"] = "stiffness_factor"
    energy: float = 1.0
    factor: float = 1.0
    even: bool = True
    cubic: CubicSprings | None = None
    rest_energy: float = 0.0
    typical: float | None = None  # rad/s
    reference: Complexes | None = None
    _springs: _Springs = field(init=False, repr=False)

    def __post_init__(self) -> None:
        c = self.system.contacts
        system = replace(
            self.system,
            damping=np.zeros_like(self.system.damping),
            contacts=c.undamped(),
        )
        moving = system.stiffness[system.stiffness > 0]
        typical = self.typical
        if typical is None:
            typical = float(np.sqrt(moving.min())) if moving.size else 1.0
        self._springs = _Springs(system, self.cubic, typical)
        x = np.arange(2 * self.harmonics + 1)
        kept = x[(x == 0) | (x % 2 == 1)] if self.even else x
        self._kept = (kept[:, None] * self._springs.count + np.arange(self._springs.count)).ravel()
        self._tail = 1 if self.parameter == "frequency" else 2

    @property
    def rows(self) -> Floats:
        """(r, n) where the springs act, one-sided ones first."""
        return self._springs.rows

    def split(self, u: Floats) -> tuple[Complexes, float, float, float]:
        """Deflections (H + 1, r), frequency (rad/s), factor and energy (nan where it isn't held)."""
        r = self._springs.count
        x = np.zeros((2 * self.harmonics + 1) * r)
        x[self._kept] = u[: -self._tail]
        W = to_complex(x.reshape(-1, r))
        if self.parameter == "frequency":
            return W, float(u[-1]), self.factor, np.nan
        if self.parameter == "energy":
            return W, float(u[-2]), self.factor, float(np.exp(u[-1]))
        return W, float(u[-2]), float(u[-1]), self.energy

    def unknowns(self, W: Complexes, frequency: float, value: float) -> Floats:
        """The reverse; ``value`` is the parameter (factor, logarithm of the energy, or rad/s)."""
        tail = [value] if self.parameter == "frequency" else [frequency, value]
        return np.concatenate([_rows_real(W)[self._kept], tail])

    def residual(self, u: Floats) -> tuple[Floats, Floats, HarmonicMotion]:
        """The balance, the energy and the phase, with the exact Jacobian, and the motion."""
        W, w, factor, energy = self.split(u)
        if not (np.isfinite(w) and w > 0):
            raise ArithmeticError("the frequency became negative")
        H, n = self.harmonics, self.system.size
        none = np.zeros(H + 1, dtype=complex)
        F = np.zeros((H + 1, n), dtype=complex)
        F[0] = self.system.constant_load
        structure = self._springs.structure
        S = structure.shifts(H)
        found = structure.at(w, F, np.zeros_like(F))
        forces = self._springs.forces(W, w, none, none)
        value, potential = factor * forces.value, _potential(self._springs, W)
        R = _residual(W, found, value + S * W)
        by_frequency = found.response_slope + (found.receptance_slope @ (value + S * W)[:, :, None])[:, :, 0]
        columns = [
            _jacobian(found, S, factor * forces.by_deflection)[:, self._kept],
            -_rows_real(by_frequency)[:, None],
        ]
        if self.parameter == "stiffness_factor":
            columns.append(-_rows_real((found.receptance @ forces.value[:, :, None])[:, :, 0])[:, None])
        elif self.parameter == "energy":
            columns.append(np.zeros((R.size, 1)))
        equations, rows = [R], [np.hstack(columns)]
        if self.parameter != "frequency":
            own, gradient, by_w, by_f = self._energy(W, F, w, factor, forces, potential)
            last = by_f if self.parameter == "stiffness_factor" else -energy
            equations.append(np.array([own - energy]))
            rows.append(np.concatenate([gradient[self._kept], [by_w, last]])[None, :])
        if not self.even:
            if self.reference is None:
                self.reference = W.copy()
            row = to_real(1j * np.arange(H + 1)[:, None] * self.reference).ravel()
            equations.append(np.array([float(row @ _rows_real(W))]))
            rows.append(np.concatenate([row[self._kept], np.zeros(self._tail)])[None, :])
        Q = structure.coordinates(w, F, value, W)
        mean = _linear_energy(self._springs.system, w, Q) + factor * potential - self.rest_energy
        motion = FreeMotion(
            w, structure, F, W, value, forces.closed, forces.tangent, self._springs.system.contacts,
            self._springs.owner, self._springs.direction, mean,
        )  # fmt: skip
        return np.concatenate(equations), np.vstack(rows), motion

    def _energy(
        self, W: Complexes, F: Complexes, w: float, factor: float, forces: _Forces, potential: float
    ) -> tuple[float, Floats, float, float]:
        """Mean energy with its derivatives by all real coefficients, the frequency and the factor."""
        structure, system = self._springs.structure, self._springs.system
        H, r = self.harmonics, self._springs.count
        S, K = structure.shifts(H), system.stiffness
        carried = np.empty((H + 1, r), dtype=complex)
        energy, by_w = factor * potential - self.rest_energy, 0.0
        right = F + (factor * forces.value + S * W) @ self.rows
        for k in range(H + 1):
            inertia = (k * w) ** 2
            inverse = np.linalg.inv(np.diag(K - inertia).astype(complex) + (self.rows.T * S[k]) @ self.rows)
            Q = inverse @ right[k]
            if k == 0:
                weight = K * Q.real - system.constant_load + 0j
                energy += float(0.5 * Q.real @ (K * Q.real) - system.constant_load @ Q.real)
            else:
                weight = 0.5 * (K + inertia) * np.conj(Q)
                energy += float(0.25 * (K + inertia) @ np.abs(Q) ** 2)
            adjoint = inverse @ weight  # the inverse is symmetric
            carried[k] = self.rows @ adjoint
            by_w += k * k * w * float(2.0 * (adjoint @ Q).real + 0.5 * np.sum(np.abs(Q) ** 2))
        # Q_h = Z_S^-1 (F + B^T (factor Lambda + S W)), and the springs' energy gives -mean(force dw)
        M = _with_shifts(factor * forces.by_deflection, S)
        gradient = np.einsum("hr,rhx->xr", carried, M).real
        gradient[0] -= factor * forces.value[0].real
        gradient[1::2] -= 0.5 * factor * forces.value[1:].real
        gradient[2::2] -= 0.5 * factor * forces.value[1:].imag
        by_factor = float(np.sum(carried * forces.value).real) + potential
        return energy, gradient.ravel(), by_w, by_factor

    def scale(self, u: Floats) -> tuple[Floats, Floats]:
        """Deflections by the size of each spring's motion, or its gap."""
        r = self._springs.count
        W, w, _, energy = self.split(u)
        size = _sizes(to_real(W), self._springs.system.contacts.gap)
        frequency = w if w > 0 else 1.0
        tail = [frequency] if self.parameter == "frequency" else [frequency, 1.0]
        residual = [size]
        if self.parameter != "frequency":
            residual.append(np.array([energy]))
        if not self.even:
            residual.append(np.array([float(np.sum(size[:r] ** 2)) * max(self.harmonics, 1)]))
        return np.concatenate([size[self._kept], tail]), np.concatenate(residual)

    def linear_guess(self, mode: int, value: float, sign: float = 1.0) -> Floats:
        """Unknowns of linear mode ``mode`` (from 0) with the energy asked for."""
        omega = float(np.sqrt(self.system.stiffness[mode]))
        energy = float(np.exp(value)) if self.parameter == "energy" else self.energy
        W = np.zeros((self.harmonics + 1, self._springs.count), dtype=complex)
        W[1] = sign * self.rows[:, mode] * np.sqrt(2.0 * energy) / omega
        return self.unknowns(W, omega, value)
