"""Compiled solution of small linear systems; numpy's takes eight times as long to compile, with its messages."""

from __future__ import annotations

from beamsim.flow.compiled import inner


@inner
def eliminate(A, order):  # type: ignore[no-untyped-def]
    """Triangular factors of A (n, n), in place, and the row that was exchanged with each; False where A is singular.

    Elimination with partial pivoting (G. H. Golub, C. F. Van Loan, Matrix Computations, section 3.4).
    """
    n = order.size
    for i in range(n):
        p = i
        largest = abs(A[i, i])
        for k in range(i + 1, n):
            if abs(A[k, i]) > largest:
                p, largest = k, abs(A[k, i])
        order[i] = p
        if largest == 0.0:
            return False
        if p != i:
            for k in range(n):
                A[i, k], A[p, k] = A[p, k], A[i, k]
        for k in range(i + 1, n):
            factor = A[k, i] / A[i, i]
            A[k, i] = factor
            if factor != 0.0:
                for j in range(i + 1, n):
                    A[k, j] -= factor * A[i, j]
    return True


@inner
def substitute(A, order, b):  # type: ignore[no-untyped-def]
    """Solution of a linear system, in place of its right-hand side b (n,); A and ``order`` are from `eliminate`."""
    n = order.size
    for i in range(n):
        p = order[i]
        b[i], b[p] = b[p], b[i]
    for i in range(n):
        for k in range(i):
            b[i] -= A[i, k] * b[k]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            b[i] -= A[i, k] * b[k]
        b[i] /= A[i, i]
