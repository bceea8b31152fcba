r"""Linear structure seen from its nonlinear springs: receptances per harmonic, with their derivative by the frequency.

With the rows B at which the springs act and :math:`Z(\omega_h) = K - \omega_h^2 I + i \omega_h C`, harmonic h of the
whole structure follows exactly from that of the springs' deflections, :math:`W_h = B Z^{-1} F_h + B Z^{-1} B^T
\Lambda_h`. Because Z is singular at rigid-body and undamped natural frequencies, the same complex spring S is added to
both sides:

.. math:: W_h = B Z_S^{-1} F_h + B Z_S^{-1} B^T (\Lambda_h + S W_h), \qquad Z_S = Z + B^T S B .

The solutions are the same and :math:`Z_S` is regular wherever the springs feel every undamped mode.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from beamsim.system.equations import PiecewiseLinearSystem
from beamsim.typing import Bools, Complexes, Floats

SMALL = 8  # coordinates that are kept as they are


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
        self.diagonal = bool(np.all(damping == np.diag(np.diag(damping))))
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

    def _modal(self, w: Floats) -> tuple[Complexes, Bools]:
        """(F, n) K - w² I + i w C of modes that damping does not couple, and at which frequencies (F,) one is near a
        pole: everywhere where it couples them."""
        z = self.stiffness - (w**2)[:, None] + 1j * np.multiply.outer(w, np.diag(self.damping))
        # 1e-4: |Z| of a mode against its stiffness or inertia, below which the regular form is solved for directly
        near = np.any(np.abs(z) <= 1e-4 * (self.stiffness + (w**2)[:, None]), axis=1) | (not self.diagonal)
        z[near] = 1.0
        return z, near

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
        B, r, n = self.rows, self.rows.shape[0], self.stiffness.size
        h = np.arange(load.shape[0])
        w: Floats = np.asarray(h * fundamental, dtype=float)
        S = self.shifts(load.shape[0] - 1)
        z, near = self._modal(w)
        inverse = 1.0 / z
        carried = inverse[:, None, :] * B  # (H + 1, r, n) B Z^-1
        by_frequency = 1j * np.multiply.outer(h, np.diag(self.damping)) - 2.0 * (h * w)[:, None]
        slope = -(carried * (by_frequency * inverse)[:, None, :])
        G, dG = carried @ B.T, slope @ B.T
        W = (carried @ load[:, :, None])[:, :, 0]
        dW = (slope @ load[:, :, None] + carried @ load_slope[:, :, None])[:, :, 0]
        # springs S by the identity of Woodbury
        stiffened = np.linalg.inv(np.eye(r) + G * S[:, None, :])
        receptance = stiffened @ G
        receptance_slope = stiffened @ dG @ (np.eye(r) - S[:, :, None] * receptance)
        response = (stiffened @ W[:, :, None])[:, :, 0]
        response_slope = (stiffened @ (dW - (dG @ (S * response)[:, :, None])[:, :, 0])[:, :, None])[:, :, 0]
        k = np.flatnonzero(near)
        if k.size:
            Z = self._impedance(w[k], S[k])
            dZ = np.multiply.outer(1j * h[k], self.damping) - np.multiply.outer(2.0 * h[k] * w[k], np.eye(n))
            right = np.concatenate(
                [np.broadcast_to(B.T, (k.size, n, r)), load[k, :, None], load_slope[k, :, None]], axis=2
            )
            solved = np.linalg.solve(Z, right)
            moved = np.linalg.solve(Z, dZ @ solved[:, :, : r + 1])
            receptance[k], receptance_slope[k] = B @ solved[:, :, :r], -B @ moved[:, :, :r]
            response[k] = solved[:, :, r] @ B.T
            response_slope[k] = (solved[:, :, r + 1] - moved[:, :, r]) @ B.T
        return Receptances(response, response_slope, receptance, receptance_slope)

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
        z, near = self._modal(w)
        out = (load + force @ self.rows) / z
        k = np.flatnonzero(near)
        right = load[k] + (force[k] + S[k] * W[k]) @ self.rows
        out[k] = np.linalg.solve(self._impedance(w[k], S[k]), right[:, :, None])[:, :, 0]
        return np.asarray(out)


def reduced_for_stability(system: PiecewiseLinearSystem, highest: float) -> tuple[PiecewiseLinearSystem, Floats]:
    """The structure in the modes below `highest` (rad/s) and residual vectors of the contacts for those above.

    Modes far above the motion's highest harmonic follow the springs statically, so that the modes below and the
    residual vector of every spring are enough; the compliance that the springs see stays as it is.

    Returns the reduced system, and its coordinates (n, k) in the given ones.
    """
    n, shape = system.size, system.contacts.shape
    # 1.5: modes up to this multiple of the motion's highest harmonic are kept
    high = np.flatnonzero(system.stiffness > (1.5 * highest) ** 2)
    if n <= SMALL or high.size <= shape.shape[0]:
        return system, np.eye(n)
    basis = np.delete(np.eye(n), high, axis=1)
    residual = np.zeros((n, shape.shape[0]))
    residual[high] = (shape[:, high] / system.stiffness[high]).T
    if np.any(residual):
        u, size, _ = np.linalg.svd(residual, full_matrices=False)
        basis = np.hstack([basis, u[:, size > 1e-12 * size[0]]])
    values, turn = np.linalg.eigh(basis.T @ (system.stiffness[:, None] * basis))
    basis = basis @ turn
    values[values < 1e-12 * values[-1]] = 0.0
    contacts = replace(system.contacts, shape=shape @ basis)
    return PiecewiseLinearSystem(
        values, basis.T @ system.damping @ basis, contacts, system.constant_load @ basis
    ), basis
