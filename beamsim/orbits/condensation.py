r"""Linear structure seen from its nonlinear springs: receptances per harmonic, with their derivative by the frequency.

With the rows B at which the springs act and :math:`Z(\omega_h) = K - \omega_h^2 I + i \omega_h C`, harmonic h of the
whole structure follows exactly from that of the springs' deflections, :math:`W_h = B Z^{-1} F_h + B Z^{-1} B^T
\Lambda_h`. Because Z is singular at rigid-body and undamped natural frequencies, the same complex spring S is added to
both sides:

.. math:: W_h = B Z_S^{-1} F_h + B Z_S^{-1} B^T (\Lambda_h + S W_h), \qquad Z_S = Z + B^T S B .

The solutions are the same and :math:`Z_S` is regular wherever the springs feel every undamped mode.
"""

from __future__ import annotations

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.typing import Complexes, Floats

NEAR_POLE = 1e-4  # |Z| of a mode against its stiffness or inertia, below which the regular form is solved for directly
CONSISTENT = 1e-9  # poles and residues of a damped structure against a direct solution


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
        self._poles = None if self.diagonal else self._find_poles(typical)

    def shifts(self, harmonics: int) -> Complexes:
        """(harmonics + 1, r) S: real at harmonic 0, complex above."""
        out = np.multiply.outer(np.full(harmonics + 1, 1.0 + 1.0j), self.spring)
        out[0] = self.spring
        return np.asarray(out)

    def _find_poles(self, typical: float) -> tuple[Complexes, Complexes, Complexes] | None:
        """Poles, and the state's vectors, where a direct solution confirms them."""
        n = self.stiffness.size
        A = np.block([[np.zeros((n, n)), np.eye(n)], [-np.diag(self.stiffness), -self.damping]])
        values, vectors = np.linalg.eig(A)
        try:
            right = np.linalg.solve(vectors, np.vstack([np.zeros((n, n)), np.eye(n)]))
        except np.linalg.LinAlgError:
            return None
        top = vectors[:n]
        for w in (0.37 * typical, 1.9 * typical, 17.0 * typical):
            direct = np.linalg.inv(self._impedance(np.array([w]))[0])
            modal = (top / (1j * w - values)) @ right
            if np.abs(modal - direct).max() > CONSISTENT * np.abs(direct).max():
                return None
        return values, top, right

    def _impedance(self, frequencies: Floats) -> Complexes:
        """(F, n, n) K - w² I + i w C."""
        n = self.stiffness.size
        out = np.multiply.outer(1j * frequencies, self.damping)
        out[:, np.arange(n), np.arange(n)] += self.stiffness - (frequencies**2)[:, None]
        return np.asarray(out)

    def at(self, fundamental: float, load: Complexes, load_slope: Complexes) -> Receptances:
        """Receptances and responses of harmonics 0 … H.

        Parameters
        ----------
        fundamental : rad/s.
        load : (H + 1, n) generalised forces.
        load_slope : (H + 1, n) their derivatives by the fundamental frequency.
        """
        H, n = load.shape[0] - 1, self.stiffness.size
        r = self.rows.shape[0]
        h = np.arange(H + 1)
        w = h * fundamental
        S = self.shifts(H)
        if self.diagonal:
            c = np.diag(self.damping)
            z = self.stiffness - (w**2)[:, None] + 1j * np.multiply.outer(w, c)
            dz = -2.0 * (h * w)[:, None] + 1j * np.multiply.outer(h, c)
            near = np.any(np.abs(z) <= NEAR_POLE * (self.stiffness + (w**2)[:, None]), axis=1)
            z[near] = 1.0
            inverse = 1.0 / z
            carried = inverse[:, None, :] * self.rows  # (H + 1, r, n) B Z^-1
            slope = -(carried * (dz * inverse)[:, None, :])
        else:
            values = None if self._poles is None else self._poles[0]
            near = np.ones(H + 1, dtype=bool)
            carried = np.zeros((H + 1, r, n), dtype=complex)
            slope = np.zeros((H + 1, r, n), dtype=complex)
            if self._poles is not None and values is not None:
                _, top, right = self._poles
                distance = 1j * w[:, None] - values
                near = np.any(np.abs(distance) <= NEAR_POLE * (np.abs(values) + w[:, None] + 1e-300), axis=1)
                distance[near] = 1.0
                part = (self.rows @ top) / distance[:, None, :]
                carried = part @ right
                slope = -1j * h[:, None, None] * ((part / distance[:, None, :]) @ right)
        if near[0]:  # harmonic 0 has no derivative by the frequency, save through its load
            slope[0] = 0.0
        G = carried @ self.rows.T
        dG = slope @ self.rows.T
        W = np.einsum("hrn,hn->hr", carried, load)
        dW = np.einsum("hrn,hn->hr", slope, load) + np.einsum("hrn,hn->hr", carried, load_slope)
        # springs S by the identity of Woodbury
        stiffened = np.linalg.inv(np.eye(r) + G * S[:, None, :])
        right_side = np.eye(r) - S[:, :, None] * (stiffened @ G)
        receptance = stiffened @ G
        receptance_slope = stiffened @ dG @ right_side
        response = (stiffened @ W[:, :, None])[:, :, 0]
        response_slope = (stiffened @ (dW - (dG @ (S * response)[:, :, None])[:, :, 0])[:, :, None])[:, :, 0]
        for k in np.flatnonzero(near):
            Z = self._impedance(w[k : k + 1])[0] + (self.rows.T * S[k]) @ self.rows
            dZ = 1j * k * self.damping - 2.0 * k * w[k] * np.eye(n)
            solved = np.linalg.solve(Z, np.column_stack([self.rows.T, load[k], load_slope[k]]))
            X = solved[:, :r]
            moved = np.linalg.solve(Z, dZ @ solved[:, : r + 1])
            receptance[k] = self.rows @ X
            receptance_slope[k] = -self.rows @ moved[:, :r]
            response[k] = self.rows @ solved[:, r]
            response_slope[k] = self.rows @ (solved[:, r + 1] - moved[:, r])
        return Receptances(response, response_slope, receptance, receptance_slope)

    def coordinates(self, fundamental: float, load: Complexes, force: Complexes, W: Complexes) -> Complexes:
        """(H + 1, n) the whole structure's harmonics.

        Parameters
        ----------
        fundamental : rad/s.
        load : (H + 1, n) generalised forces.
        force : (H + 1, r) the springs' forces on the structure.
        W : (H + 1, r) the springs' deflections.
        """
        H = load.shape[0] - 1
        w, S = np.arange(H + 1) * fundamental, self.shifts(H)
        right = load + (force + S * W) @ self.rows
        out = np.empty_like(right)
        if self.diagonal:
            z = self.stiffness - (w**2)[:, None] + 1j * np.multiply.outer(w, np.diag(self.damping))
            near = np.any(np.abs(z) <= NEAR_POLE * (self.stiffness + (w**2)[:, None]), axis=1)
            z[near] = 1.0
            out = (load + force @ self.rows) / z
        else:
            near = np.ones(H + 1, dtype=bool)
        for k in np.flatnonzero(near):
            Z = self._impedance(w[k : k + 1])[0] + (self.rows.T * S[k]) @ self.rows
            out[k] = np.linalg.solve(Z, right[k])
        return out
