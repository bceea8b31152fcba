r"""Forced motions of a structure with weak one-sided springs, by multiple scales.

*Away from resonance* everything but the springs is kept, and the response is the series :math:`q_0 + \varepsilon q_1 +
\varepsilon^2 q_2` with :math:`Z q_0 = F`, :math:`Z q_1 = f(q_0)`, :math:`Z q_2 = f'(q_0) q_1` harmonic by harmonic.

*Near mode j*, with weak springs, damping and force,

.. math:: \ddot q + \varepsilon C \dot q + \mathrm{diag}(\omega_l^2) q
          = \varepsilon f(q, \dot q) + \varepsilon\, \mathrm{Re}(F e^{i\omega t}), \qquad \omega = \omega_j +
          \varepsilon \sigma,

the motion is :math:`q = \mathrm{Re}(Q e^{i\omega t}) e_j + \varepsilon q_1` and the complex amplitude changes on the
slow time :math:`T = \varepsilon t` only:

.. math:: \frac{dQ}{dT} = i [\Psi(|Q|) - \sigma] Q - \frac{i F_j}{2 \omega_j}, \qquad
          \Psi(a) = -\frac{f_{j,1}(a)}{2 \omega_j a} + \frac{i C_{jj}}{2},

:math:`f_{j,1}` being the fundamental of the springs' force under :math:`a \cos\omega_j t`. Its real part is the
first-order change of the nonlinear mode's frequency: the response curve leans along the backbone. Steady motions are
:math:`a |\Psi(a) - \sigma| = |F_j| / (2\omega_j)`, stable where the slow flow contracts. With :math:`g = 0`,
:math:`\Psi` is constant and the slow flow linear: one steady motion, always stable.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from beamsim.errors import MethodError
from beamsim.orbits.aft import one_sided, product
from beamsim.orbits.expansions.free import HARMONICS, RESONANT, rest_clearances
from beamsim.system.equations import PiecewiseLinearSystem
from beamsim.typing import TINY, Complexes, Floats


@dataclass(frozen=True)
class SteadyMotion:
    """A steady response near a mode, to leading order."""

    amplitude: float  # |Q|
    phase: float  # rad, by which the response lags the force
    sigma: float  # detuning: omega = omega_j + factor * sigma
    exponents: Complexes  # (2,) growth rates of the slow flow, per unit of slow time

    @property
    def complex_amplitude(self) -> complex:
        """Q."""
        return complex(self.amplitude * np.exp(-1j * self.phase))

    @property
    def stable(self) -> bool:
        """The slow flow contracts."""
        return bool(np.max(self.exponents.real) < 0)


@dataclass
class ResonantForcing:
    """A structure shaken near one of its modes; all small quantities are given for a factor of one.

    Parameters
    ----------
    system : the structure; the factor multiplies its springs, dashpots and damping.
    mode : j, from 0.
    load : (n,) complex force F, ``Re(F e^{i omega t})``, multiplied by the factor too.
    harmonics : where series are cut.
    """

    system: PiecewiseLinearSystem
    mode: int
    load: Complexes
    harmonics: int = HARMONICS

    def __post_init__(self) -> None:
        if not 0 <= self.mode < self.system.size or self.system.stiffness[self.mode] <= 0:
            raise MethodError("mode", f"= {self.mode + 1} is not a flexible mode of the model", "ask for another")
        self.omega = float(np.sqrt(self.system.stiffness[self.mode]))
        self.load = np.asarray(self.load, dtype=complex)
        _, self.gap = rest_clearances(self.system)

    def backbone(self, amplitude: Any) -> Any:
        r"""Psi at one or several amplitudes a: its real part the change of the mode's frequency, its imaginary part the
        decay, both per factor.

        A spring that is closed for the angle :math:`2 \alpha`, :math:`\cos\alpha = g / (|\phi| a)`, adds
        :math:`(k + i \omega c) \phi^2 (\alpha - \sin\alpha \cos\alpha) / (2 \pi \omega)`.
        """
        c, j = self.system.contacts.one_sided_springs(), self.mode
        reach = np.multiply.outer(amplitude, np.abs(c.shape[:, j]))
        cosine = np.clip(self.gap / np.maximum(reach, TINY), -1.0, 1.0)
        closed = np.arccos(cosine) - cosine * np.sqrt(1.0 - cosine**2)
        rate = (c.stiffness + 1j * self.omega * c.dashpot) * c.shape[:, j] ** 2
        return closed @ rate / (2.0 * np.pi * self.omega) + 0.5j * self.system.damping[j, j]

    def detunings(self, amplitude: float) -> tuple[float, ...]:
        """The detunings of steady motions of this amplitude: none, or two about the backbone (equal at its tip)."""
        psi = self.backbone(amplitude)
        square = (abs(self.load[self.mode]) / (2.0 * self.omega * amplitude)) ** 2 - psi.imag**2
        if square < 0:
            return ()
        return (psi.real - float(np.sqrt(square)), psi.real + float(np.sqrt(square)))

    def motion(self, amplitude: float, sigma: float) -> SteadyMotion:
        """The steady motion of an amplitude and a detuning that belong together."""
        psi = self.backbone(amplitude)
        Q = self.load[self.mode] / (2.0 * self.omega) / (psi - sigma)
        step = 1e-5 * amplitude
        slope = (self.backbone(amplitude + step) - self.backbone(amplitude - step)) / (2.0 * step)
        # perturbation (xi + i eta) e^{-i phase}: p' = i (Psi - sigma) p + i Psi' a xi
        along, across = 1j * (psi - sigma) + 1j * slope * amplitude, 1j * (psi - sigma) * 1j
        J = np.array([[along.real, across.real], [along.imag, across.imag]])
        return SteadyMotion(amplitude, float(-np.angle(Q)), sigma, np.linalg.eigvals(J).astype(complex))

    def _first(self, Q: complex, omega: float) -> tuple[Complexes, Complexes, list[Complexes]]:
        """(H + 1, n) harmonics of q_1 under ``Re(Q e^{i omega t}) e_j``, without the fundamental of mode j; the force
        at leading order, and the indicators of contact.
        """
        system, c, j, H = self.system, self.system.contacts.one_sided_springs(), self.mode, self.harmonics
        h = np.arange(H + 1)
        force = np.zeros((H + 1, system.size), dtype=complex)
        chi = []
        for i in range(c.count):
            D = np.array([-self.gap[i], -c.sign[i] * c.shape[i, j] * Q], dtype=complex)
            contact = one_sided(D, 2 * H)
            chi.append(contact.chi[: 2 * H + 1])
            rate = c.stiffness[i] + 1j * h * omega * c.dashpot[i]
            force += np.multiply.outer(rate * contact.positive[: H + 1], c.sign[i] * c.shape[i])
        right = force.copy()
        right[1] += self.load - 1j * omega * system.damping[:, j] * Q
        divisor = system.stiffness - (h[:, None] * omega) ** 2
        divisor[1, j] = np.inf
        small = np.abs(divisor) <= RESONANT * (system.stiffness + (h[:, None] * omega) ** 2 + TINY)
        if np.any(small & (np.abs(right) > 1e-13 * np.abs(right).max())):
            k, other = (int(x[0]) for x in np.nonzero(small))
            raise MethodError(
                "frequency",
                f"times {k} is the frequency of mode {other + 1}: multiple scales has no correction there",
                "leave the comparison out, or change the frequency",
            )
        return np.where(small, 0.0, right / np.where(small, 1.0, divisor)), force, chi

    def response(self, motion: SteadyMotion, factor: float, order: int = 1) -> Complexes:
        """(H + 1, n) harmonics of the steady motion.

        Order 0: the leading motion, in error by O(factor). Order 1: with q_1, and the fundamental of mode j from the
        solvability
        condition one order higher, so that the error is O(factor²).

        Parameters
        ----------
        motion : near the mode, to leading order.
        factor : of springs, damping and load.
        order : 0 or 1.

        Returns
        -------
        (H + 1, n) complex amplitudes.
        """
        from scipy.optimize import root

        omega = self.omega + factor * motion.sigma
        Q, j = motion.complex_amplitude, self.mode
        if order == 0:
            out = np.zeros((self.harmonics + 1, self.system.size), dtype=complex)
            out[1, j] = Q
            return out

        def balance(x: Floats) -> tuple[float, float]:
            R = self._fundamental(complex(x[0], x[1]), omega, factor) / abs(Q)
            return R.real, R.imag

        x = root(balance, [Q.real, Q.imag], tol=1e-12).x
        return self.with_correction(complex(x[0], x[1]), omega, factor)

    def with_correction(self, Q: complex, omega: float, factor: float) -> Complexes:
        """(H + 1, n) harmonics of ``Re(Q e^{i omega t}) e_j + factor q_1``.

        Parameters
        ----------
        Q : complex amplitude of the mode.
        omega : rad/s.
        factor : of springs, damping and load.

        Returns
        -------
        (H + 1, n) complex amplitudes.
        """
        out = factor * self._first(Q, omega)[0]
        out[1, self.mode] += Q
        return out

    def _fundamental(self, Q: complex, omega: float, factor: float) -> complex:
        """Balance of the fundamental of mode j, over the factor, with first-order corrections elsewhere."""
        system, c, j = self.system, self.system.contacts.one_sided_springs(), self.mode
        first, force, chi = self._first(Q, omega)
        R = (system.stiffness[j] - omega**2) * Q / factor + 1j * omega * system.damping[j, j] * Q - self.load[j]
        R -= force[1, j]
        R += factor * 1j * omega * complex(system.damping[j] @ first[1])
        for i in range(c.count):
            rate = c.stiffness[i] + 1j * omega * c.dashpot[i]
            R += factor * rate * product(chi[i], first @ c.shape[i], 1)[1] * c.shape[i, j]
        return complex(R)

    def states(self, coefficients: Complexes, omega: float, times: Floats) -> Floats:
        """(nt, 2n) displacements and velocities of a response.

        Parameters
        ----------
        coefficients : (H + 1, n) harmonics.
        omega : rad/s.
        times : (nt,) s.

        Returns
        -------
        (nt, 2n) displacements and velocities.
        """
        used = np.flatnonzero(np.any(np.abs(coefficients) > 1e-17 * np.abs(coefficients).max(), axis=1))
        iw = 1j * used * omega
        e = np.exp(np.multiply.outer(np.asarray(times, dtype=float), iw))
        Q = coefficients[used]
        return np.hstack([(e @ Q).real, (e @ (iw[:, None] * Q)).real])
