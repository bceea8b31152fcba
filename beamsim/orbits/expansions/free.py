r"""Nonlinear normal modes of a structure with weak one-sided or cubic springs, by multiple scales to second order.

The springs' stiffness is :math:`\varepsilon k`. In modal coordinates and the strained time :math:`\theta = \omega t`,

.. math:: \omega^2 q'' + \mathrm{diag}(\omega_l^2)\, q = \varepsilon f(q), \qquad
          f(q) = \sum_i s_i k_i \phi_i\, [-g_i - s_i \phi_i q]_+ ,

has near mode j the expansion :math:`q = A e_j \cos\theta + \varepsilon q_1 + \varepsilon^2 q_2 + O(\varepsilon^3)`,
:math:`\omega^2 = \omega_j^2 + \varepsilon a_1 + \varepsilon^2 a_2 + O(\varepsilon^3)` with

.. math:: \omega_j^2 q_1'' + \Omega^2 q_1 &= f(q_0) - a_1 q_0'', \\
          \omega_j^2 q_2'' + \Omega^2 q_2 &= f'(q_0) q_1 - a_1 q_1'' - a_2 q_0'',

:math:`a_1` and :math:`a_2` being what keeps a secular term (:math:`\cos\theta` in equation j) away, which the method of
multiple scales calls solvability. A is the amplitude of the fundamental of coordinate j. A one-sided force is only
Lipschitz continuous: f' jumps, which adds terms of third order at the instants of contact, provided that the spring is
met with speed (no grazing). For :math:`g = 0`: :math:`a_1 = \tfrac12 \sum_i k_i \phi_{ij}^2`, hence :math:`\omega =
\omega_j + \varepsilon \sum_i k_i \phi_{ij}^2 / (4 \omega_j) + O(\varepsilon^2)` (H. Hazim, thesis, 2010, chapter 4).

Every term is a Fourier series with exact coefficients, cut where it no longer matters.

The divisors :math:`\omega_l^2 - h^2 \omega_j^2` stand where the motion has :math:`\omega_l^2 - h^2 \omega^2`: as series
in the factor these only agree within :math:`\varepsilon < |\omega_l / h - \omega_j| / |\omega_1|`, the *pole* nearest
to zero. A high mode l always has a harmonic h close by, so that its coordinate comes to its asymptotic order at far
smaller factors than the rest. The *uniform* expansion keeps :math:`\omega` in the divisors,

.. math:: \omega^2 q_1'' + \Omega^2 q_1 = f(q_0), \qquad \omega^2 q_2'' + \Omega^2 q_2 = f'(q_0) q_1

(both without the fundamental of coordinate j), has the same orders and no such poles but at resonances that are there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from beamsim.contacts.equilibrium import CubicSprings
from beamsim.errors import MethodError
from beamsim.orbits.aft import cubic as cubic_harmonics
from beamsim.orbits.aft import one_sided, product
from beamsim.orbits.spring_families import SpringFamily
from beamsim.system.equations import PiecewiseLinearSystem
from beamsim.typing import TINY, Complexes, Floats

HARMONICS = 400
RESONANT = 1e-7  # relative distance of h omega_j from omega_l at which the expansion does not exist


@dataclass(frozen=True)
class ModeExpansion:
    """The first terms of a nonlinear normal mode in powers of the stiffness factor."""

    mode: int  # j, from 0
    amplitude: float  # A, of the fundamental of coordinate j
    omega: float  # omega_j, rad/s
    a1: float  # (rad/s)^2
    a2: float
    rest: Floats  # (n,) static shape of the structure without springs under its dead loads
    first: Floats  # (H + 1, n) cosine coefficients of q_1
    second: Floats  # (H + 1, n) of q_2
    coupled_mode: int  # mode of the largest component of q_1 beyond the mean, from 0
    harmonic: int  # and its harmonic: the nearest internal resonance that counts
    share: float  # its size against A
    pole: float = np.inf  # factor (its absolute value) of the pole of the divisors nearest to zero
    pole_mode: int = -1  # mode l of that divisor, from 0
    pole_harmonic: int = 0  # and its harmonic h

    @property
    def omega1(self) -> float:
        """First-order change of the frequency, rad/s."""
        return self.a1 / (2.0 * self.omega)

    @property
    def omega2(self) -> float:
        """Second-order change of the frequency, rad/s."""
        return self.a2 / (2.0 * self.omega) - self.a1**2 / (8.0 * self.omega**3)

    @property
    def reach(self) -> float:
        """Small factors are well below this one, at which a term reaches a tenth of the one before it."""
        ratios = [self.share]
        for above, below in ((self.omega2, self.omega1), (np.abs(self.second).max(), np.abs(self.first).max())):
            if below != 0.0:
                ratios.append(abs(float(above / below)))
        return 0.1 / max(ratios) if max(ratios) > 0 else np.inf

    def frequency(self, factor: float, order: int = 2) -> float:
        """rad/s, to order 0, 1 or 2 in the factor."""
        return self.omega + sum(x * factor ** (i + 1) for i, x in enumerate((self.omega1, self.omega2)[:order]))

    def coefficients(self, factor: float, order: int = 1) -> Floats:
        """(H + 1, n) cosine coefficients of the motion, to order 0, 1 or 2."""
        out = np.zeros_like(self.first)
        out[1, self.mode] = self.amplitude
        out[0] += self.rest
        for power, term in enumerate((self.first, self.second)[:order], start=1):
            out += factor**power * term
        return out

    def initial(self, factor: float, order: int = 1) -> Floats:
        """(n,) the motion at t = 0, where it is at rest: the mode's initial condition."""
        return np.asarray(self.coefficients(factor, order).sum(axis=0))


def weaken(system: PiecewiseLinearSystem, factor: float) -> PiecewiseLinearSystem:
    """The system with its springs, dashpots and damping multiplied by a factor."""
    return replace(system, damping=factor * system.damping, contacts=system.contacts.scaled(factor))


def rest_clearances(system: PiecewiseLinearSystem) -> tuple[Floats, Floats]:
    """(n,) static shape without springs, and the (m,) clearances of the one-sided springs there."""
    flexible = system.stiffness > 0
    rest = np.where(flexible, system.constant_load / np.where(flexible, system.stiffness, 1.0), 0.0)
    c = system.contacts.one_sided_springs()
    return rest, c.gap + c.sign * (c.shape @ rest)


def _springs_under(
    system: PiecewiseLinearSystem, cubic: CubicSprings | None, mode: int, amplitude: float, H: int
) -> tuple[Floats, list[tuple[Complexes, Floats, float]]]:
    """(H + 1, n) harmonics of the springs' force under one mode, and of each spring the two-sided coefficients of its
    tangent, its row and its stiffness."""
    c = system.contacts.one_sided_springs()
    rest, gap = rest_clearances(system)
    force = np.zeros((H + 1, system.size))
    tangents: list[tuple[Complexes, Floats, float]] = []
    for i in range(c.count):
        D = np.array([-gap[i], -c.sign[i] * c.shape[i, mode] * amplitude], dtype=complex)
        contact = one_sided(D, 2 * H)
        force += np.multiply.outer(contact.positive[: H + 1].real, c.sign[i] * c.stiffness[i] * c.shape[i])
        tangents.append((contact.chi[: 2 * H + 1], c.shape[i], float(c.stiffness[i])))
    if cubic is not None:
        for row, k in zip(cubic.shape, cubic.stiffness, strict=True):
            third, slope = cubic_harmonics(np.array([row @ rest, row[mode] * amplitude], dtype=complex), 2 * H)
            force -= np.multiply.outer(third[: H + 1].real, k * row)
            tangents.append((slope[: 2 * H + 1], row, float(k)))
    return force, tangents


def expand_mode(
    system: PiecewiseLinearSystem,
    mode: int,
    amplitude: float,
    harmonics: int = HARMONICS,
    cubic: CubicSprings | None = None,
    uniform_at: float | None = None,
) -> ModeExpansion:
    """The expansion of a nonlinear normal mode; damping, dashpots and the base's motion are left out.

    Parameters
    ----------
    system : the structure; its contacts' stiffness is what the factor multiplies.
    mode : j, from 0; its frequency must not be zero.
    amplitude : A in modal coordinate j, of either sign: the extreme from which the motion starts.
    harmonics : where the series are cut.
    cubic : cubic springs, multiplied by the factor as well (without dead loads).
    uniform_at : the factor at whose frequency the divisors are taken (default: those of the linear mode).

    Returns
    -------
    The expansion to second order.

    Raises
    ------
    MethodError : at an internal resonance, where the expansion has a vanishing divisor, and for rigid-body modes.
    """
    n, H, w2 = system.size, harmonics, system.stiffness
    if not 0 <= mode < n:
        raise MethodError("mode", f"= {mode + 1}, but the model has {n} modes", "ask for a lower one")
    if w2[mode] <= 0:
        raise MethodError("mode", f"= {mode + 1} is a rigid-body mode", "ask for a flexible one")
    force, tangents = _springs_under(system, cubic, mode, amplitude, H)
    a1 = -float(force[1, mode]) / amplitude
    first = _solve(w2, mode, force)
    second_force = a1 * (np.arange(H + 1) ** 2)[:, None] * first
    for tangent, row, k in tangents:
        second_force -= np.multiply.outer(product(tangent, (first @ row).astype(complex), H).real, k * row)
    a2 = -float(second_force[1, mode]) / amplitude
    if uniform_at is None:
        second = _solve(w2, mode, second_force)
    else:
        squared = float(w2[mode]) + uniform_at * a1 + uniform_at**2 * a2
        first = _solve(w2, mode, force, squared)
        second_force = np.zeros_like(force)
        for tangent, row, k in tangents:
            second_force -= np.multiply.outer(product(tangent, (first @ row).astype(complex), H).real, k * row)
        second = _solve(w2, mode, second_force, squared)
    pole, pole_mode, pole_harmonic = _nearest_pole(w2, mode, force, a1)
    moving = np.abs(first[1:])
    largest = np.unravel_index(int(np.argmax(moving)), moving.shape)
    return ModeExpansion(
        mode, float(amplitude), float(np.sqrt(w2[mode])), a1, a2, rest_clearances(system)[0], first, second,
        int(largest[1]), int(largest[0]) + 1, float(moving[largest] / abs(amplitude)), pole, pole_mode, pole_harmonic,
    )  # fmt: skip


COUNTED_HARMONIC = 1e-9  # share of the largest harmonic of the force above which one counts


def _nearest_pole(w2: Floats, mode: int, force: Floats, a1: float) -> tuple[float, int, int]:
    """Factor next to zero with ``h (omega_j + factor omega_1) = omega_l``, l (from 0) and h; where forced at all."""
    omega = np.sqrt(w2)
    shift = abs(a1) / (2.0 * float(omega[mode]))
    forced = np.abs(force[1:]) > COUNTED_HARMONIC * np.abs(force).max(initial=0.0)
    forced[0, mode] = False
    if shift == 0.0 or not np.any(forced):
        return np.inf, -1, 0
    h = np.arange(1, force.shape[0])[:, None]
    factor = np.where(forced, np.abs(omega / h - omega[mode]) / shift, np.inf)
    at = np.unravel_index(int(np.argmin(factor)), factor.shape)
    return float(factor[at]), int(at[1]), int(at[0]) + 1


def _solve(w2: Floats, mode: int, force: Floats, squared: float | None = None) -> Floats:
    """Periodic solution of ``w² x'' + diag(w2) x = force`` (cosines) without the fundamental of coordinate j.

    ``squared`` is w²; that of mode j by default.
    """
    h2 = (np.arange(force.shape[0]) ** 2)[:, None]
    divisor = w2 - h2 * (w2[mode] if squared is None else squared)
    skipped = np.zeros(divisor.shape, dtype=bool)
    skipped[1, mode] = True
    small = (np.abs(divisor) <= RESONANT * (w2 + h2 * w2[mode] + TINY)) & ~skipped
    bad = small & (np.abs(force) > 1e-13 * np.abs(force).max())
    if np.any(bad):
        h, other = (int(x[0]) for x in np.nonzero(bad))
        whose = "of a rigid-body mode" if w2[other] == 0 else f"of mode {other + 1}"
        raise MethodError(
            "expansion", f"fails at an internal resonance: {h} times the frequency of mode {mode + 1} is that {whose}",
            "use shooting, or change the structure",
        )  # fmt: skip
    return np.asarray(np.where(skipped | small, 0.0, force / np.where(skipped | small, 1.0, divisor)))


@dataclass(frozen=True)
class ModeAtEnergy:
    """A mode whose motions have one energy at all factors of the springs."""

    family: SpringFamily
    mode: int  # from 0
    energy: float  # J, from static equilibrium
    sign: float = 1.0  # of the mode's coordinate in the extreme from which the motion starts
    harmonics: int = HARMONICS  # where the series are cut

    def expand(self, factor: float, order: int = 1, *, uniform: bool = False) -> ModeExpansion:
        """The expansion whose initial vector has the energy as its potential energy.

        Parameters
        ----------
        factor : of the springs.
        order : of the initial vector.
        uniform : whether the divisors are taken at the frequency that belongs to the factor.

        Returns
        -------
        The expansion.

        Raises
        ------
        MethodError : where no motion of the expansion has this energy.
        """
        family, energy = self.family, self.energy
        if energy <= 0:
            raise MethodError("energy", f"= {energy:g} J has no motion", "give a positive energy")
        omega, at = float(family.omega[self.mode]) or 1.0, factor if uniform else None
        amplitude = self.sign * np.sqrt(2.0 * energy) / omega
        for _ in range(50):
            expansion = expand_mode(family.system, self.mode, amplitude, self.harmonics, family.cubic, at)
            potential = family.potential(expansion.initial(factor, order), factor)[0]
            if potential <= 0:
                raise MethodError("energy", f"= {energy:g} J is beyond the expansion", "give more or a smaller factor")
            new = amplitude * float(np.sqrt(energy / potential))  # exact in one step where there is no gap
            if abs(new - amplitude) <= 1e-14 * abs(amplitude):
                break
            amplitude = new
        return expansion


def observed_orders(factors: Floats, errors: Floats) -> Floats:
    """(E - 1,) slopes of log error over log factor between neighbours: the order in which a difference vanishes."""
    factors, errors = np.asarray(factors, dtype=float), np.asarray(errors, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.diff(np.log(errors)) / np.diff(np.log(factors)))
