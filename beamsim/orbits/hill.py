r"""Stability of a harmonic-balance motion by Hill's method.

A perturbation :math:`e^{\lambda t} \sum_h p_h e^{ih\Omega t}` of the motion satisfies, for every h,

.. math:: [(\lambda + ih\Omega)^2 + (\lambda + ih\Omega) C + K] p_h
          + \sum_j B_j^T (k_j + (\lambda + ih\Omega) c_j) \sum_l \chi^j_{h-l} B_j p_l = 0,

a quadratic eigenvalue problem of size n (2H + 1). Of its eigenvalues the 2n whose vectors are centred on harmonic 0 are
the Floquet exponents; the others are copies shifted by multiples of :math:`i\Omega` and spoilt by the truncation. The
perturbation must have as many harmonics as the motion: with fewer the exponents are far off, because short contacts are
stiff. For many modes, or close to a stability boundary, hand the motion to shooting instead, whose multipliers are
exact.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from beamsim.typing import Complexes

if TYPE_CHECKING:
    from beamsim.contacts.equilibrium import CubicSprings
    from beamsim.orbits.harmonic_motion import HarmonicMotion
    from beamsim.system.equations import PiecewiseLinearSystem

PAIRED = 1e-6  # relative distance of a multiplier from another one's conjugate
SAME = 0.02  # exponents over the fundamental frequency that differ by i up to this are copies of each other


def hill_multipliers(
    system: PiecewiseLinearSystem,
    motion: HarmonicMotion,
    cubic: CubicSprings | None = None,
    factor: float = 1.0,
) -> Complexes:
    """(2n,) Floquet multipliers over the motion's period, the largest first.

    Parameters
    ----------
    system : the structure that the motion was found for.
    motion : what harmonic balance kept with a point.
    cubic : its cubic springs.
    factor : of all nonlinear springs' stiffness.
    """
    n, c = system.size, system.contacts.one_sided_parts()
    H = motion.highest
    stiffness, dashpot, rows = factor * c.stiffness, factor * c.dashpot, c.shape
    if cubic is not None:
        stiffness = np.concatenate([stiffness, factor * cubic.stiffness])
        dashpot = np.concatenate([dashpot, np.zeros(cubic.count)])
        rows = np.vstack([rows, cubic.shape])
    h = np.arange(-H, H + 1)
    N = h.size
    iw = 1j * h * motion.fundamental
    difference = h[:, None] - h[None, :]
    A0 = np.zeros((N, n, N, n), dtype=complex)
    A1 = np.zeros((N, n, N, n), dtype=complex)
    i = np.arange(N)
    A0[i, :, i, :] = iw[:, None, None] * system.damping + (iw**2)[:, None, None] * np.eye(n) + np.diag(system.stiffness)
    A1[i, :, i, :] = 2 * iw[:, None, None] * np.eye(n) + system.damping
    for j in range(rows.shape[0]):
        e = motion.tangent[j]
        T = np.where(difference >= 0, e[np.abs(difference)], np.conj(e[np.abs(difference)]))
        outer = np.outer(rows[j], rows[j])
        A0 += np.einsum("hl,ab->halb", (stiffness[j] + iw * dashpot[j])[:, None] * T, outer)
        if dashpot[j]:
            A1 += np.einsum("hl,ab->halb", dashpot[j] * T, outer)
    size = N * n
    # lambda in units of the fundamental frequency, so that both halves of the vectors are alike
    unit = motion.fundamental
    A = np.block([
        [np.zeros((size, size)), np.eye(size)],
        [-A0.reshape(size, size) / unit**2, -A1.reshape(size, size) / unit],
    ])  # fmt: skip
    values, vectors = np.linalg.eig(A)
    weight = np.sum(np.abs(vectors[:size].reshape(N, n, -1)) ** 2, axis=1)
    centre = np.abs(h @ weight) / weight.sum(axis=0)
    ordered = values[np.argsort(centre, kind="stable")]
    # Liouville: the multipliers' product follows from the mean damping
    mean_damping = float(np.trace(system.damping)) + float(
        np.sum(dashpot * motion.tangent[:, 0].real * (rows**2).sum(axis=1))
    )
    sets = [_first(ordered, 2 * n, same) for same in (0.0, SAME)]
    chosen = min(sets, key=lambda x: abs(float(np.sum(x.real)) + mean_damping / unit))
    multipliers = _closed_under_conjugation(np.exp(2 * np.pi * chosen))
    return np.asarray(multipliers[np.lexsort((-multipliers.imag, -np.abs(multipliers)))])


def _closed_under_conjugation(values: Complexes) -> Complexes:
    """Multipliers of a real system: one whose conjugate is not among the others is real.

    Of a multiplier on the negative real axis truncation leaves two copies, half a fundamental up and down, a little off
    the axis, of which one was chosen.
    """
    values = values.copy()
    unpaired = [i for i in range(values.size) if values[i].imag != 0.0]
    while unpaired:
        i = unpaired.pop(0)
        j = min(unpaired, key=lambda k: abs(values[k] - values[i].conjugate()), default=-1)
        if j >= 0 and abs(values[j] - values[i].conjugate()) <= PAIRED * abs(values[i]):
            unpaired.remove(j)
        else:
            values[i] = np.copysign(abs(values[i]), values[i].real)
    return values


def _first(values: Complexes, count: int, same: float) -> Complexes:
    """The first values of which none is another's copy, half a fundamental up instead of down.

    A multiplier on the negative real axis has two equally centred copies; so have, nearly, the two of a pair close to
    it.
    """
    chosen: list[complex] = []
    for value in values:
        if all(min(abs(value - other - 1j), abs(value - other + 1j)) > same for other in chosen):
            chosen.append(complex(value))
        if len(chosen) == count:
            break
    return np.array(chosen)
