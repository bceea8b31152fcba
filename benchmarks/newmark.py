"""Newmark's method and HHT with contacts, as one would write them: what a fixed step costs, and what it gives.

Average acceleration and its variant with numerical damping (Hilber, Hughes and Taylor, 1977),

    a1 + (1 + alpha)(C v1 + K q1 - F1) - alpha (C v0 + K q0 - F0) = (1 + alpha) f1 - alpha f0,

for one-sided springs with dashpots and one load. A force at a contact changes the penetrations by a constant matrix;
which contacts are closed at the end of a step is found by iteration. Contacts are seen with the resolution of a step.
"""

from __future__ import annotations

import numpy as np
from numba import njit

MOST_ITERATIONS = 40  # of the contacts in one step
HHT_ALPHA = -0.05


@njit(cache=True)
def newmark(matrices, contacts, load, start, step, alpha):
    """States (nt, 2 n) at steps of one length, and the number of steps in which the contacts did not settle.

    Parameters
    ----------
    matrices : K (n,), C (n, n) in mass-normalised modal coordinates, and P (m, n), `penetration = P q - gap`.
    contacts : stiffness, dashpot and gap, (m,) each.
    load : (nt, n) at the steps.
    start : (2 n,) q and q'.
    step : s.
    alpha : 0 for Newmark's average acceleration, -1/3 to 0 for HHT.
    """
    K, C, P = matrices
    k, c, gap = contacts
    n, m = K.size, gap.size
    beta, gamma = (1.0 - alpha) ** 2 / 4.0, (1.0 - 2.0 * alpha) / 2.0
    share, fast = 1.0 + alpha, gamma / (beta * step)
    inverse = np.linalg.inv(np.eye(n) / (beta * step**2) + share * (fast * C + np.diag(K)))
    moved = inverse @ np.ascontiguousarray(P.T)
    compliance = P @ moved
    out = np.empty((load.shape[0], 2 * n))
    q, v = start[:n].copy(), start[n:].copy()
    delta, rate = P @ q - gap, P @ v
    closed = delta > 0.0
    N = np.where(closed, k * delta + c * rate, 0.0)
    a = load[0] - K * q - C @ v - N @ P
    out[0, :n], out[0, n:] = q, v
    unsettled = 0
    for i in range(1, load.shape[0]):
        before = C @ v + K * q + N @ P
        drift = fast * q + (gamma / beta - 1.0) * v + step * (gamma / (2.0 * beta) - 1.0) * a
        right = q / (beta * step * step) + v / (beta * step) + (0.5 / beta - 1.0) * a
        right += share * (C @ drift) + alpha * before + share * load[i] - alpha * load[i - 1]
        free = inverse @ right
        free_delta, free_rate = P @ free - gap, P @ (fast * free - drift)
        for _ in range(MOST_ITERATIONS):
            A = np.eye(m)
            for j in range(m):
                if closed[j]:
                    A[j] += share * (k[j] + c[j] * fast) * compliance[j]
            N = np.linalg.solve(A, np.where(closed, k * free_delta + c * free_rate, 0.0))
            delta = free_delta - share * (compliance @ N)
            again = delta > 0.0
            settled = np.all(again == closed)
            closed = again
            if settled:
                break
        unsettled += not settled
        new = free - share * (moved @ N)
        a = (new - q) / (beta * step * step) - v / (beta * step) - (0.5 / beta - 1.0) * a
        v = fast * new - drift
        q = new
        out[i, :n], out[i, n:] = q, v
    return out, unsettled
